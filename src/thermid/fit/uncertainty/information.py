"""What readings and priors hold about the unknowns of a fit, as rows whose squares add up."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from thermid.errors import SolverError
from thermid.fit.least_squares.solve import at_least_square
from thermid.fit.problem.residuals import Problem
from thermid.fit.problem.unknowns import Unknown
from thermid.simulation.solver.engine import Options

Array = NDArray[np.float64]
RANK_TOLERANCE = 1e-6
LOST = 1e-3
EXACT = Options(tolerance=1e-9, relative=1e-10, input_tolerance=1e-3)
"""Tight enough that a direction without information shows as such and not as the integrator's error.

How closely a noisy input is followed does not matter for that, and following it to 1e-7 K can take the integrator millions of steps.
"""


@dataclass(frozen=True, eq=False)
class Information:
    """Rows of weighted derivatives in the fitted form of the unknowns: rows' rows is the information matrix.

    Parameters
    ----------
    unknowns : tuple of Unknown
    at : array (unknowns,)                  Values where the derivatives were taken, in the fitted form.
    data : array (rows, unknowns)           Of the readings.
    nuisance : array (rows, unknowns)       Of the priors of constant errors and of local values.
    given : array (rows, unknowns)          Of the priors of parameters, those handed on from a stage below among them.
    """

    unknowns: tuple[Unknown, ...]
    at: Array
    data: Array
    nuisance: Array
    given: Array

    @classmethod
    def of(cls, problem: Problem, fitted: Array, spread: float = 1.0, exact: bool = True) -> Information:
        """Return what a problem holds at some values; readings scatter `spread` times as much as their noise says."""
        tight = replace(problem, options=EXACT) if exact else problem
        rows = problem.prior_rows(fitted)[1]
        kinds = [u.kind for u in problem.unknowns if u.prior is not None]
        own = np.array([k == "parameter" for k in kinds] + [True] * (rows.shape[0] - len(kinds)), dtype=bool)
        return cls(problem.unknowns, fitted, tight.compressed(fitted).slopes / spread, rows[~own], rows[own])

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the unknowns."""
        return tuple(u.name for u in self.unknowns)

    @property
    def parameters(self) -> tuple[int, ...]:
        """Positions of the parameters."""
        return tuple(k for k, u in enumerate(self.unknowns) if u.kind == "parameter")

    @property
    def values(self) -> Array:
        """Values (unknowns,). [SI]"""
        return np.array([u.to_value(float(x)) for u, x in zip(self.unknowns, self.at, strict=True)])

    @property
    def slopes(self) -> Array:
        """Derivatives (unknowns,) of the values with respect to their fitted form."""
        return np.array([u.slope(float(x)) for u, x in zip(self.unknowns, self.at, strict=True)])

    @property
    def sizes(self) -> Array:
        """What a relative change (unknowns,) is taken of, in the fitted form: 1 for a logarithm, the value or a typical change else."""
        return np.array([1.0 if u.log else abs(float(x)) or u.scale for u, x in zip(self.unknowns, self.at, strict=True)])

    @property
    def rows(self) -> Array:
        """All rows: readings and priors."""
        return np.concatenate([self.data, self.nuisance, self.given])

    @property
    def alone(self) -> Array:
        """Relative error (unknowns,) that each would have with all others known. [-]"""
        length = np.linalg.norm(self.rows, axis=0)
        out: Array = np.divide(1.0, length * self.sizes, out=np.full(length.size, np.inf), where=length > 0)
        return out

    def prior_row(self, k: int, relative: float) -> Array:
        """Return the row (1, unknowns) of a prior on one unknown, its standard deviation relative to its value."""
        row = np.zeros((1, len(self.unknowns)))
        row[0, k] = 1.0 / (relative * self.sizes[k])
        return row

    def covariance(self, held: Sequence[int] = (), more: Array | None = None) -> Array:
        """Return the covariance of the fitted form, some unknowns held, with more rows if given; infinite where nothing is known."""
        rows = self.rows if more is None else np.concatenate([self.rows, more])
        kept = [k for k in range(len(self.unknowns)) if k not in held]
        out = np.zeros((len(self.unknowns),) * 2)
        out[np.ix_(kept, kept)] = inverse(rows[:, kept])
        return out

    def errors(self, held: Sequence[int] = (), more: Array | None = None) -> Array:
        """Return the relative standard error (unknowns,). [-]"""
        relative: Array = np.sqrt(np.diag(self.covariance(held, more))) / self.sizes
        return relative

    def rank(self) -> int:
        """How many independent facts about the parameters the readings hold, what constant errors may do taken off."""
        at = list(self.parameters)
        rows = np.concatenate([self.data, self.nuisance])
        rest = [k for k in range(rows.shape[1]) if k not in at]
        part = rows[:, at]
        if rest:
            length = np.linalg.norm(rows[:, rest], axis=0)
            basis, s, _ = np.linalg.svd(rows[:, rest] / np.where(length > 0, length, 1.0), full_matrices=False)
            basis = basis[:, s > RANK_TOLERANCE * max(s[0], 1e-300)]
            part = part - basis @ (basis.T @ part)
        size = np.linalg.norm(rows[:, at], axis=0)
        singular = np.linalg.svd(part / np.where(size > 0, size, 1.0), compute_uv=False)
        return int((singular > RANK_TOLERANCE).sum())


def inverse(rows: Array) -> Array:
    """Return (rows' rows)^-1; an unknown that has a part in a direction without information gets an infinite variance."""
    if rows.shape[1] == 0:
        return np.zeros((0, 0))
    scale = np.linalg.norm(rows, axis=0)
    dead = scale <= 1e-12 * scale.max(initial=0.0)
    scale = np.where(dead, 1.0, scale)
    _, s, v = np.linalg.svd(at_least_square(np.where(dead, 0.0, rows / scale)), full_matrices=False)
    weak = s <= RANK_TOLERANCE * s[0]
    inverted = np.where(weak, 0.0, 1.0 / np.where(weak, 1.0, s))
    out = (v.T * inverted**2) @ v / np.outer(scale, scale)
    lost = np.linalg.norm(v[weak], axis=0) > LOST
    out[lost, lost] = np.inf
    return np.asarray(out)


def null_space(rows: Array) -> Array:
    """Return the directions (directions, unknowns) that no row sees, in the fitted form; unknowns that no row depends on are left out."""
    length = np.linalg.norm(rows, axis=0)
    seen = np.flatnonzero(length > 1e-12 * length.max(initial=0.0))
    out = np.zeros((0, rows.shape[1]))
    if seen.size < 2:
        return out
    _, s, v = np.linalg.svd(at_least_square(rows[:, seen] / length[seen]), full_matrices=False)
    null = v[s < RANK_TOLERANCE * s[0]]
    out = np.zeros((null.shape[0], rows.shape[1]))
    out[:, seen] = null / length[seen]
    return out


def elsewhere(problem: Problem, info: Information, spread: float = 1.0) -> Information | None:
    """Return the information at other values of the parameters, inside their bounds; None where the model cannot be run there.

    What binds parameters by law binds them there too; an accident of the first values does not.
    """
    # no two shifts alike, or a sum would look like a product
    shift = (0.1 + 0.2 * (0.618034 * np.arange(len(info.unknowns)) % 1.0)) * info.sizes
    moved = info.at.copy()
    for k in info.parameters:
        low, high = info.unknowns[k].fitted_bounds()
        room = high - info.at[k] > info.at[k] - low
        step = min(shift[k], 0.5 * max(high - info.at[k], info.at[k] - low))
        moved[k] += step if room else -step
    try:
        return Information.of(problem, moved, spread)
    except SolverError:
        return None
