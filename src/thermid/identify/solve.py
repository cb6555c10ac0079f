"""Bounded weighted least squares on the kernel's derivatives, and the covariance at the end."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thermid.errors import IdentificationError
from thermid.identify.residuals import Problem

__all__ = ["Fit", "at_least_square", "covariances", "ended", "minimise"]

Array = NDArray[np.float64]

LOSSES = ("linear", "soft_l1", "huber", "cauchy")


@dataclass(frozen=True, eq=False)
class Fit:
    """The end of a minimisation.

    Parameters
    ----------
    fitted : array (unknowns,)              In the fitted form.
    jacobian : array (rows, unknowns)       Of the data, weights of a robust loss included.
    priors : array (rows, unknowns)         Of the priors.
    cost : float                            Half the weighted sum of squares, priors included. [-]
    chi_square : float                      Weighted sum of squares of the data alone. [-]
    evaluations : int                       How often the records were simulated.
    message : str                           How it ended.
    converged : bool
    """

    fitted: Array
    jacobian: Array
    priors: Array
    cost: float
    chi_square: float
    evaluations: int
    message: str
    converged: bool


def _robust(loss: str, samples: int) -> Any:
    """Return a loss for `least_squares` that leaves the rows of the priors as they are."""
    if loss == "linear":
        return "linear"

    def rho(z: Array) -> Array:
        out = np.vstack([z, np.ones_like(z), np.zeros_like(z)])
        data = z[:samples]
        if loss == "soft_l1":
            root = np.sqrt(1.0 + data)
            out[:, :samples] = (2.0 * (root - 1.0), 1.0 / root, -0.5 / root**3)
        elif loss == "huber":
            far = data > 1.0
            root = np.sqrt(np.where(far, data, 1.0))
            out[:, :samples] = (np.where(far, 2 * root - 1, data), np.where(far, 1 / root, 1.0), np.where(far, -0.5 / root**3, 0.0))
        else:
            out[:, :samples] = (np.log1p(data), 1.0 / (1.0 + data), -1.0 / (1.0 + data) ** 2)
        return out

    return rho


def minimise(
    problem: Problem,
    loss: str = "linear",
    knee: float = 1.0,
    start: Array | None = None,
    progress: Callable[[int, float], None] | None = None,
) -> Fit:
    """Return the least-squares fit of a problem.

    Parameters
    ----------
    problem : Problem
    loss : str              linear, soft_l1, huber or cauchy, on residuals in units of the noise; priors stay quadratic.
    knee : float            Residual, in units of the noise, from which the loss bends.
    start : array           In the fitted form; the unknowns' own start by default.
    progress : callable     Called with the number of evaluations and the RMS of the weighted residuals.

    Raises
    ------
    SolverError             When the model cannot be run at the start.
    IdentificationError     When there is no such loss.
    """
    from scipy.optimize import least_squares

    if loss not in LOSSES:
        raise IdentificationError(f"there is no loss '{loss}'; there are {', '.join(LOSSES)}.")
    unknowns = problem.unknowns
    at = np.array([u.to_fitted(u.start) for u in unknowns]) if start is None else np.asarray(start, dtype=float)
    samples, count = problem.samples, 0
    if not unknowns:
        return ended(problem, at, loss, knee, message="nothing was free")

    def all_residuals(x: Array) -> Array:
        nonlocal count
        count += 1
        residuals = problem.residuals(x)
        if progress is not None:
            progress(count, float(np.sqrt(np.mean(residuals**2))))
        return np.concatenate([residuals, problem.prior_rows(x)[0]])

    def all_slopes(x: Array) -> Array:
        return np.concatenate([problem.jacobian(x), problem.prior_rows(x)[1]])

    problem.blocks(at)  # a model that cannot be run at the start says why, in the integrator's words
    low, high = (np.array(b) for b in zip(*(u.fitted_bounds() for u in unknowns), strict=True))
    at = np.clip(at, np.nextafter(low, np.inf), np.nextafter(high, -np.inf))
    found = least_squares(
        all_residuals,
        at,
        jac=all_slopes,
        bounds=(low, high),
        x_scale=np.array([u.scale for u in unknowns]),
        method="trf",
        loss=_robust(loss, samples),
        f_scale=knee,
        ftol=1e-10,
        xtol=1e-10,
        gtol=1e-10,
        max_nfev=200,
    )
    return ended(problem, found.x, loss, knee, count, found.message, bool(found.success))


def ended(
    problem: Problem,
    fitted: Array,
    loss: str = "linear",
    knee: float = 1.0,
    evaluations: int = 1,
    message: str = "taken as it was",
    converged: bool = True,
) -> Fit:
    """Return the fit that ended at some values of the unknowns, with its derivatives."""
    residuals, slopes = problem.residuals(fitted), problem.jacobian(fitted)
    rows, prior_slopes = problem.prior_rows(fitted)
    weight, rho = np.ones(problem.samples), _robust(loss, problem.samples)
    if not isinstance(rho, str):
        weight = np.sqrt(rho((residuals / knee) ** 2)[1])
    chi = float(np.sum((weight * residuals) ** 2))
    return Fit(fitted, weight[:, None] * slopes, prior_slopes, 0.5 * (chi + float(rows @ rows)), chi, evaluations, message, converged)


def covariances(fit: Fit, problem: Problem) -> tuple[Array, Array]:
    """Return the covariance of the fitted form: total, and the part of it that comes from the noise of the readings alone (random).

    With C the total covariance, data and priors together, and J the weighted derivatives of the data, the values that a repeat of the
    same tests with the same instruments would give scatter by ``C J'J C``; what is left is what the priors hold of constant errors.
    Where the residuals are larger than the noise says, the errors grow with them.
    """
    freedom = max(fit.jacobian.shape[0] - len(problem.unknowns), 1)
    data = fit.jacobian / np.sqrt(max(1.0, fit.chi_square / freedom))
    total = _inverse(np.concatenate([data, fit.priors]))
    spread = data @ np.where(np.isfinite(total), total, 0.0)
    random = spread.T @ spread
    return total, np.where(np.isinf(total), np.inf, random)


def at_least_square(rows: Array) -> Array:
    """Return a matrix with rows of zeros below it, so that its singular values count every unknown; data may be fewer than unknowns."""
    return np.concatenate([rows, np.zeros((max(0, rows.shape[1] - rows.shape[0]), rows.shape[1]))])


def _inverse(rows: Array) -> Array:
    """Return (J'J)^-1 by singular values of the column-scaled matrix; directions without information get an infinite variance."""
    if rows.shape[1] == 0:
        return np.zeros((0, 0))
    scale = np.linalg.norm(rows, axis=0)
    scale[scale == 0] = 1.0
    _, s, v = np.linalg.svd(at_least_square(rows / scale), full_matrices=False)
    weak = s < 1e-12 * s[0]
    inverse = np.where(weak, 0.0, 1.0 / np.where(weak, 1.0, s))
    out = (v.T * inverse**2) @ v
    lost = (np.abs(v[weak]) > 1e-6).any(axis=0) if weak.any() else np.zeros(rows.shape[1], dtype=bool)
    out[lost, :] = out[:, lost] = 0.0
    out[lost, lost] = np.inf
    return np.asarray(out / np.outer(scale, scale))
