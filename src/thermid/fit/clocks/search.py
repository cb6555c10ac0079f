"""Where a second clock may stand: powers that switch make many valleys, so that offset and rate are looked for on a grid first."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from thermid.errors import IdentificationError, ScenarioError, SolverError
from thermid.fit.least_squares.solve import Fit, minimise
from thermid.fit.problem.statistics import loss_of
from thermid.fit.problem.ticks import OFFSET, clock_at

if TYPE_CHECKING:
    from thermid.fit.problem.residuals import Problem
    from thermid.fit.problem.ticks import Ticks

Array = NDArray[np.float64]
OFFSETS, RATES, ROUNDS = 25, 5, 5


def with_clocks(problem: Problem, loss: str, knee: float, fitted: Array | None = None) -> Problem:
    """Return a problem whose second clocks start where a grid over their ranges fits best, all other unknowns as they are.

    Raises
    ------
    IdentificationError   When the model runs at no offset.
    """
    at = np.array([u.to_fitted(u.start) for u in problem.unknowns]) if fitted is None else fitted.copy()
    for i, experiment in enumerate(problem.experiments):
        if experiment.ticks is None:
            continue
        found = [(_cost(problem, i, there, loss, knee), there) for there in _grid(problem, i, at, experiment.ticks)]
        if fitted is not None:
            found.append((_cost(problem, i, at, loss, knee), at))
        cost, at = min(found, key=lambda pair: pair[0])
        if not np.isfinite(cost):
            raise IdentificationError(
                "no offset of its second clock lets the model run. Widen the range of offsets.", f"record '{experiment.record.name}'"
            )
    return at_clocks(problem, at)


def in_turns(problem: Problem, found: Fit, loss: str, knee: float, progress: Callable[[int, float], None] | None) -> tuple[Problem, Fit]:
    """Return the problem and the end of its fit after the grid was looked at again with the fitted values, as long as that gains."""
    for _ in range(ROUNDS if any(e.ticks is not None for e in problem.experiments) else 0):
        moved = with_clocks(problem, loss, knee, found.fitted)
        at = found.fitted.copy()
        for i in range(len(problem.experiments)):
            for k, _name in moved.ticking(i):
                at[k] = moved.unknowns[k].start
        if np.array_equal(at, found.fitted):
            return problem, found
        again = minimise(moved, loss, knee, at, progress)
        again = replace(again, evaluations=found.evaluations + again.evaluations, search=found.search, remarks=found.remarks)
        if again.cost >= found.cost:
            return problem, found
        problem, found = moved, again
    return problem, found


def at_clocks(problem: Problem, fitted: Array) -> Problem:
    """Return a problem whose experiments hold their second clocks where the unknowns put them."""
    experiments, unknowns = list(problem.experiments), list(problem.unknowns)
    for i, experiment in enumerate(problem.experiments):
        if experiment.ticks is not None:
            experiments[i] = experiment.ticks.moved(experiment, clock_at(problem, i, fitted))
            for k, _ in problem.ticking(i):
                unknowns[k] = replace(unknowns[k], start=float(fitted[k]))
    if all(e.ticks is None for e in experiments):
        return problem
    return replace(problem, experiments=tuple(experiments), unknowns=tuple(unknowns))


def _grid(problem: Problem, i: int, at: Array, ticks: Ticks) -> list[Array]:
    """Return values of all unknowns with offset and rate of one experiment's clock on a grid."""
    points = [at]
    for k, name in problem.ticking(i):
        low, high = ticks.clock.offset if name == OFFSET else ticks.clock.rate
        count = OFFSETS if name == OFFSET else RATES
        values = np.linspace(low, high, count) if name == OFFSET else low + (high - low) * (np.arange(count) + 0.5) / count
        points = [_with(p, k, float(v)) for p in points for v in values]
    return points


def _with(at: Array, k: int, value: float) -> Array:
    out = at.copy()
    out[k] = value
    return out


def _cost(problem: Problem, i: int, fitted: Array, loss: str, knee: float) -> float:
    """Return the loss of one record's residuals; infinite where it cannot be run."""
    try:
        z = np.concatenate([b.residuals / b.noise for b in problem.blocks_of(i, fitted)])
    except (ScenarioError, SolverError):
        return float("inf")
    return float(loss_of(z**2, loss, knee)[0].sum())
