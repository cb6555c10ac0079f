"""Bounded weighted least squares on exact derivatives: one descent, and the covariance at its end.

In: a `Problem`, a loss, a start. Out: a `Fit`: where it ended, its derivatives there, and how it got there; and covariances. The interrupt
key ends a descent with the best values so far. Starts beyond one: `fit.search`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from thermid.base.errors import IdentificationError, SolverError, refuse_unknown
from thermid.base.linear_algebra import NOTHING, Array, covariance, finite, sandwich
from thermid.base.units import counted
from thermid.fit._problem.residuals import FAILED, Compressed, Sums, Unknown, starting_point

NEAR, DONE = 0.02, 1e-4
"""A search goes on with new steps once the step ahead is below this part of every unknown's typical change, and ends once it is below this
part of a standard error."""
LOSSES = ("linear", "soft_l1", "huber", "cauchy")


class LeastSquares(Protocol):
    """What can be minimised: the records of a fit (`Problem`), or a plain function of its unknowns."""

    @property
    def unknowns(self) -> tuple[Unknown, ...]:
        """What is looked for."""
        ...

    @property
    def samples(self) -> int:
        """How many readings there are."""
        ...

    def compressed(self, fitted: Array, loss: str = "linear", loss_scale: float = 1.0, meshes: Sequence[Array] = ()) -> Compressed:
        """Return the weighted residuals of all data with their derivatives."""
        ...

    def prior_rows(self, fitted: Array) -> tuple[Array, Array]:
        """Return the residuals of the priors and their derivatives."""
        ...

    def square(self, found: Compressed) -> float:
        """Return the sum of the squares of the residuals in units of the noise, whatever the loss."""
        ...


@dataclass(frozen=True, eq=False)
class Fit:
    """The end of a minimisation.

    Parameters
    ----------
    fitted : array (unknowns,)              In the fitted form.
    jacobian : array (rows, unknowns)       Of the data, weights of a robust loss included, in as few rows as hold the same information.
    priors : array (rows, unknowns)         Of the priors.
    cost : float                            Half the weighted sum of squares, priors included. [-]
    chi_square : float                      Weighted sum of squares of the data alone. [-]
    sums : tuple of (str, str, Sums)        Record, sensor, and the sums of its residuals.
    evaluations : int                       How often the records were simulated.
    message : str                           How it ended.
    converged : bool
    search : str                            What was looked at beyond one descent; empty for nothing.
    remarks : tuple of str                  What a reader must know of it.
    stopped : bool                          Whether the interrupt key ended it; it then stands at the best values so far.
    """

    fitted: Array
    jacobian: Array
    priors: Array
    cost: float
    chi_square: float
    sums: tuple[tuple[str, str, Sums], ...]
    evaluations: int
    message: str
    converged: bool
    search: str = ""
    remarks: tuple[str, ...] = ()
    stopped: bool = False


@dataclass(frozen=True)
class KeptFit:
    """What is kept of a fit that ended: enough to take it again without a search, and to say the same of it.

    Parameters
    ----------
    fitted : dict               Unknown -> its value, in the fitted form.
    evaluations : int           How often the records were simulated.
    search : str                What was looked at beyond one descent; empty for nothing.
    remarks : tuple of str      What a reader must know of the search.
    """

    fitted: Mapping[str, float]
    evaluations: int
    search: str = ""
    remarks: tuple[str, ...] = ()


class _Arrived(Exception):  # noqa: N818 - it ends a search, nothing went wrong
    """The step ahead is so small that it is not worth a run."""

    def __init__(self, x: Array, step: str) -> None:
        super().__init__(f"the step ahead is below {step}")
        self.x = x


class _Search:
    """What `least_squares` asks for; residuals and derivatives come from one run, all runs on the steps of one among them."""

    def __init__(
        self, problem: LeastSquares, loss: str, loss_scale: float, progress: Callable[[int, float], None] | None, done: float = DONE
    ) -> None:
        self.problem, self.loss, self.loss_scale, self.progress, self.done = problem, loss, loss_scale, progress, done
        self.count = 0
        self.best: tuple[float, Array] | None = None
        self.fine = False
        self.scale = np.array([u.scale for u in problem.unknowns])
        self._settled: Array | None = None
        self._known: dict[bytes, Compressed] = {}
        self._meshes: tuple[Array, ...] = ()

    def settle(self, x: Array) -> None:
        """Let the integrator choose its steps at some values, unless it did so near by; these hold until the next call.

        Raises
        ------
        SolverError   When a record cannot be run.
        """
        if self._settled is not None and (np.abs(x - self._settled) < NEAR * self.scale).all():
            return
        found = self.problem.compressed(x, self.loss, self.loss_scale)
        self._known, self._meshes, self._settled = {x.tobytes(): found}, found.meshes, x

    def at(self, x: Array) -> Compressed:
        """Return the residuals at some values; the latest two sets of values are remembered."""
        key = x.tobytes()
        if key not in self._known:
            found = self.problem.compressed(x, self.loss, self.loss_scale, self._meshes)
            self._known = dict([*self._known.items()][-1:]) | {key: found}
        return self._known[key]

    def residuals(self, x: Array) -> Array:
        """Return the residuals; of a run that the integrator could not finish very large ones, so that the optimiser turns back."""
        self.count += 1
        samples = self.problem.samples
        try:
            found = self.at(x)
            rows, square = found.rows, self.problem.square(found)
        except SolverError:
            square = samples * FAILED**2
            rows = np.zeros(next(iter(self._known.values())).rows.size)
            rows[-1] = np.sqrt(square)
        out = np.concatenate([rows, self.problem.prior_rows(x)[0]])
        cost = float(out @ out)
        if self.best is None or cost < self.best[0]:
            self.best = cost, x.copy()
        if self.progress is not None:
            self.progress(self.count, float(np.sqrt(square / samples)))
        return out

    def slopes(self, x: Array) -> Array:
        """Return their derivatives, unless the step of Gauss and Newton from here is not worth a run."""
        priors, prior_slopes = self.problem.prior_rows(x)
        found = self.at(x)
        slopes, rows = np.concatenate([found.slopes, prior_slopes]), np.concatenate([found.rows, priors])
        step = np.linalg.lstsq(slopes / self.scale, -rows, rcond=None)[0]
        if not self.fine and (np.abs(step) < NEAR).all():
            raise _Arrived(x, f"{NEAR} of every typical change")
        gain = float(np.sum(((slopes / self.scale) @ step) ** 2))  # in squares of a standard error, where the noise is what is stated
        if self.fine and gain < self.done**2 * max(1.0, self.problem.square(found) / self.problem.samples):
            raise _Arrived(x, f"{self.done:g} standard errors")
        return slopes


def minimise(
    problem: LeastSquares,
    loss: str = "linear",
    loss_scale: float = 1.0,
    start: Array | None = None,
    progress: Callable[[int, float], None] | None = None,
    done: float = DONE,
    stoppable: bool = False,
) -> Fit:
    """Return the least-squares fit of a problem.

    Parameters
    ----------
    problem : LeastSquares
    loss : str              linear, soft_l1, huber or cauchy, on residuals in units of the noise; priors stay quadratic.
    loss_scale : float      Residual, in units of the noise, from which the loss bends.
    start : array           In the fitted form; the unknowns' own start by default.
    progress : callable     Called with the number of evaluations and the RMS of the weighted residuals.
    done : float            The search ends once the step ahead is below this part of a standard error. [-]
    stoppable : bool        Whether the interrupt key ends it with the best values so far, once there are any: `Fit.stopped`, not converged.

    Raises
    ------
    SolverError             When the model cannot be run at the start.
    IdentificationError     When there is no such loss.
    """
    refuse_unknown([loss], LOSSES, "", "unknown loss '{}'. Use one of {known}.", IdentificationError)
    unknowns = problem.unknowns
    at = starting_point(unknowns) if start is None else np.asarray(start, dtype=float)
    if not unknowns:
        return ended(problem, at, loss, loss_scale, message="no parameter was free")
    low, high = (np.array(b) for b in zip(*(u.fitted_bounds() for u in unknowns), strict=True))
    at = np.clip(at, np.nextafter(low, np.inf), np.nextafter(high, -np.inf))
    search = _Search(problem, loss, loss_scale, progress, done)
    try:
        for fine in (False, True):
            search.fine = fine
            search.settle(at)  # a model that cannot be run at the start says why, in the integrator's words
            at, message, converged = _searched(search, at, (low, high))
    except KeyboardInterrupt:
        if search.best is None or not stoppable:
            raise
        at, message = search.best[1], f"stopped by the user after {counted(search.count, 'evaluation')}, at the best values so far"
        return replace(_fit_at(problem, at, search.at(at), search.count, message, False), stopped=True)
    return _fit_at(problem, at, search.at(at), search.count, message, converged)


def _searched(search: _Search, at: Array, bounds: tuple[Array, Array]) -> tuple[Array, str, bool]:
    """Return where a search from some values ends, how, and whether it converged."""
    from scipy.optimize import least_squares

    tolerance = min(1e-10, max(search.done**2, 1e-15)) if search.fine else 1e-3
    try:
        # where a log contradicts its model a search may run very far, and its region of trust may have no slope left to divide by
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            found = least_squares(
                search.residuals,
                at,
                jac=search.slopes,
                bounds=bounds,
                x_scale=search.scale,
                method="trf",
                ftol=tolerance,
                xtol=min(1e-10, max(search.done**2, 1e-15)),
                gtol=1e-10,
                max_nfev=200,
            )
    except _Arrived as arrived:
        return arrived.x, str(arrived), True
    except np.linalg.LinAlgError:
        raise SolverError(
            "the fit diverged: its derivatives are not finite. Give its parameters min and max, or priors. Check the log too: a "
            "column, a unit or a node may be wrong.",
            "fit",
        ) from None
    return found.x, found.message, bool(found.success)


def ended(
    problem: LeastSquares,
    fitted: Array,
    loss: str = "linear",
    loss_scale: float = 1.0,
    evaluations: int = 1,
    message: str = "kept as it was",
    converged: bool = True,
) -> Fit:
    """Return the fit that ended at some values of the unknowns, with its derivatives."""
    return _fit_at(problem, fitted, problem.compressed(fitted, loss, loss_scale), evaluations, message, converged)


def _fit_at(problem: LeastSquares, fitted: Array, data: Compressed, evaluations: int, message: str, converged: bool) -> Fit:
    rows, slopes = problem.prior_rows(fitted)
    cost = 0.5 * (data.chi_square + float(rows @ rows))
    return Fit(fitted, data.slopes, slopes, cost, data.chi_square, data.sums, evaluations, message, converged)


def covariances(fit: Fit, level: float = 1.0, excess: Array | None = None) -> tuple[Array, Array, Array]:
    """Return three covariances of the fitted form: total, random, and the one that the weights of the fit stand for.

    The weights stand for ``C = (J'J / level + priors)^-1``, J the weighted derivatives of the data and `level` the variance of residuals
    that do not wander, in squares of the noise. Residuals that wander add ``C E C / level^2``, with E (unknowns, unknowns) the `excess` of
    the covariance of J'r over ``level J'J``: the sandwich of Huber, Proc. 5th Berkeley Symposium 1 (1967) 221, which widens the directions
    along which they wander and leaves the others. The random part is the scatter of a repeat of the same tests with the same instruments;
    what is left is what the priors hold of constant errors. A combination that the data depend on, however weakly, has a finite error.
    """
    data = fit.jacobian / np.sqrt(level)
    weights = covariance(np.concatenate([data, fit.priors]), NOTHING)
    known = finite(weights)
    spread = data @ known
    added = sandwich(known, excess) / level**2 if excess is not None else np.zeros_like(known)
    return weights + added, np.where(np.isinf(weights), np.inf, spread.T @ spread + added), weights
