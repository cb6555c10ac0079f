"""Unknown clocks: offset and rate found by a grid and then by least squares, as unknowns of a fit.

In: a `Problem` with unknown clocks in its records. Out: the problem with its clocks at the best place of the grid. Powers that switch make
many valleys, so that offset and rate of each are looked for on a grid first, one clock after the other.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np

from thermid.base.errors import IdentificationError, ScenarioError, SolverError
from thermid.base.linear_algebra import Array
from thermid.fit._minimisation import Fit, minimise
from thermid.fit._problem.experiment import OFFSET, SCALE, Experiment
from thermid.fit._problem.residuals import Problem, clock_at, loss_of, starting_point
from thermid.model.elements import TableSignal

GRID_OFFSETS, GRID_RATES, GRID_ROUNDS = 25, 5, 5


def with_clocks(problem: Problem, loss: str, loss_scale: float, fitted: Array | None = None) -> Problem:
    """Return a problem whose second clocks start where a grid over their ranges fits best, all other unknowns as they are.

    Raises
    ------
    IdentificationError   When the model runs at no offset.
    """
    at = starting_point(problem.unknowns) if fitted is None else fitted.copy()
    for i, number in ((i, number) for i, e in enumerate(problem.experiments) for number in range(len(e.ticks))):
        experiment = problem.experiments[i]
        costs = [(_cost(problem, i, there, loss, loss_scale), there) for there in _grid(problem, i, at, number)]
        if fitted is not None:
            costs.append((_cost(problem, i, at, loss, loss_scale), at))
        cost, at = min(costs, key=lambda pair: pair[0])
        if not np.isfinite(cost):
            raise IdentificationError(
                "the model fails at every offset of the second clock in the given range. Widen the range of offsets.",
                f"record '{experiment.record.name}'",
                code="fit.model-fails",
            )
    return at_clocks(problem, at)


def in_turns(
    problem: Problem, minimum: Fit, loss: str, loss_scale: float, progress: Callable[[int, float], None] | None
) -> tuple[Problem, Fit]:
    """Return the problem and the end of its fit after the grid was looked at again with the fitted values, as long as that gains."""
    for _ in range(GRID_ROUNDS):
        moved = with_clocks(problem, loss, loss_scale, minimum.fitted)
        at = minimum.fitted.copy()
        for i in range(len(problem.experiments)):
            for k, _, _ in moved.ticking(i):
                at[k] = moved.unknowns[k].start
        if np.array_equal(at, minimum.fitted):
            return problem, minimum
        again = minimise(moved, loss, loss_scale, at, progress)
        again = replace(again, evaluations=minimum.evaluations + again.evaluations, search=minimum.search, remarks=minimum.remarks)
        if again.cost >= minimum.cost:
            return problem, minimum
        problem, minimum = moved, again
    return problem, minimum


def at_clocks(problem: Problem, fitted: Array) -> Problem:
    """Return a problem whose experiments hold their second clocks where the unknowns put them."""
    experiments, unknowns = list(problem.experiments), list(problem.unknowns)
    for i, experiment in enumerate(problem.experiments):
        if experiment.ticks:
            experiments[i] = experiment.on_clocks(clock_at(problem, i, fitted))
            for k, _, _ in problem.ticking(i):
                unknowns[k] = replace(unknowns[k], start=float(fitted[k]))
    return replace(problem, experiments=tuple(experiments), unknowns=tuple(unknowns))


CHANGED = 3.5
"""Standard deviations of the difference of two samples of a power from which it changed, and was not only noise. [-]"""


MAX_ERROR_GROWTH = 1e3
"""Most times that an error grows: without a true change of the power nothing is known of its clock. [-]"""


def widened_by_noise_of_powers(problem: Problem, fitted: Array) -> Array:
    """Return how many times larger errors of the unknowns (unknowns,) are because noise of sampled powers adds to derivatives by clocks.

    A shift moves the noise of a meter with its power. The derivatives of readings by an offset then hold two parts, of true changes and of
    noise, J = J_0 + N, and J'J counts N'N as information. It is none: about the best offset the sum of squares curves by J_0'J_0 alone,
    because residuals answer to the same noise (errors in variables: Fuller, Measurement Error Models, 1987, 1.1). With the covariance of
    J'r as it is, errors grow by J'J / J_0'J_0, each beside what the other unknowns explain. J_0 is that of a power that stays at its mean
    between its true changes.
    """
    out = np.ones(len(problem.unknowns))
    for i, e in enumerate(problem.experiments):
        calm = _calm(e)
        ticking = [k for k, _, _ in problem.ticking(i)]
        if calm is None or not ticking:
            continue
        quiet = replace(problem, experiments=tuple(calm if j == i else other for j, other in enumerate(problem.experiments)))
        full, true = (p.slopes(i, fitted).reshape(-1, out.size) for p in (problem, quiet))
        others, _ = np.linalg.qr(full[:, [k for k in range(out.size) if k not in ticking]])
        for k in ticking:
            sizes = [float(np.sum((c - others @ (others.T @ c)) ** 2)) for c in (full[:, k], true[:, k])]
            out[k] = min(max(sizes[0] / max(sizes[1], 1e-300), 1.0), MAX_ERROR_GROWTH)
    return out


def _calm(experiment: Experiment) -> Experiment | None:
    """Return an experiment whose sampled powers on a second clock stay at their means between true changes; None where none has noise."""
    tables: dict[str, dict[str, Any]] = {}
    for name, path in (of for ticks in experiment.ticks for of in ticks.driven):
        table = getattr(experiment.scenario, name)[path]
        noise = experiment.noisy.get(SCALE + path)
        if noise is None or not noise.white > 0.0 or not isinstance(table, TableSignal):
            continue
        calm = table.levelled(CHANGED * math.sqrt(2.0) * noise.white)
        tables.setdefault(name, dict(getattr(experiment.scenario, name)))[path] = calm
    return replace(experiment, scenario=experiment.scenario.with_(**tables)) if tables else None


def _grid(problem: Problem, i: int, fitted: Array, number: int) -> Iterator[Array]:
    """Yield values of all unknowns with one clock on a grid: offsets with both ends of their range, rates amid equal parts of theirs."""
    clock = problem.experiments[i].ticks[number].clock
    (first, last), (slowest, fastest) = clock.offset, clock.rate
    offsets = np.linspace(first, last, GRID_OFFSETS if first < last else 1)
    rates = slowest + (fastest - slowest) * (np.arange(GRID_RATES if slowest < fastest else 1) + 0.5) / GRID_RATES
    for offset, rate in product(offsets, rates):
        point = fitted.copy()
        for k, of, name in problem.ticking(i):
            if of == number:
                point[k] = offset if name == OFFSET else rate
        yield point


def _cost(problem: Problem, i: int, fitted: Array, loss: str, loss_scale: float) -> float:
    """Return the loss of one record's residuals; infinite where it cannot be run."""
    try:
        z = np.concatenate([b.weighted for b in problem.blocks_of(i, fitted)])
    except (ScenarioError, SolverError):
        return float("inf")
    return float(loss_of(z**2, loss, loss_scale)[0].sum())
