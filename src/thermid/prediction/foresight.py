"""What a model says of a test before it is made: temperatures, their errors, and how large these were before anything was fitted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from thermid.arguments import takes_objects
from thermid.knowledge.store import Normal, Source, State
from thermid.linear_algebra import Array
from thermid.model.parts.parameter import Standing
from thermid.prediction.budget import MISFIT, Budget, budget_of
from thermid.prediction.known import Known, Rows
from thermid.prediction.predict import Band, Prediction, predicted
from thermid.prediction.setting import Setting
from thermid.simulation.scenarios.scenario import Scenario
from thermid.simulation.solution import Solution
from thermid.simulation.solver.problem import Options
from thermid.simulation.transient import simulate

Given = Mapping[str, Any]
FURTHEST = 3
"""How many of the highest and of the lowest turning points of every node are stored beside the times that are asked for."""
IN_TESTS = "misfit in tests"
"""Cause: what the model could not follow in the logs of a plan."""


@dataclass(frozen=True, eq=False)
class Foresight:
    """What is expected of one run.

    Parameters
    ----------
    scenario : Scenario
    solution : Solution     The run with the best values.
    prediction : Prediction Expected temperatures with their errors and what these come from, at the same times.
    before : dict           Node -> standard error (times,) if nothing had been fitted, the values anywhere in their ranges. [K]
    """

    scenario: Scenario
    solution: Solution
    prediction: Prediction
    before: Mapping[str, Array] = field(default_factory=dict)

    @property
    def standing(self) -> Standing:
        """Of the values that it rests on."""
        return self.prediction.standing


@takes_objects
def foresee(
    known: Known,
    scenario: Scenario,
    *,
    nodes: Sequence[str] = (),
    spread: Given | Sequence[Given] = (),
    times: Any = None,
    without: Sequence[str] = (),
    options: Options | None = None,
) -> Foresight:
    """Pretest prediction of a scenario: `predict`, the run with the best values, and the errors before any fit.

    Parameters
    ----------
    known : Known           The model and what is known of its values.
    scenario : Scenario     The test.
    nodes : sequence        Nodes to predict; all by default.
    spread : dict           What else is not known exactly, as in `predict`.
    times : array           Times to store; 301 by default. Those of the furthest turning points between them are added. [s]
    without : sequence      Sources that are not counted, as in `predict`.
    options : Options       The integrator's.
    """
    budget = budget_of(known, scenario, spread, without=without)
    solution = simulate(budget.model, scenario, times=times, options=options)
    wanted = list(nodes) or list(solution.nodes)
    solution = solution.refined(wanted, FURTHEST)
    told = predicted(budget, wanted, times=solution.times, options=options)
    return Foresight(scenario, solution, told, _before(budget, known, wanted, solution.times, options))


def _before(budget: Budget, known: Known, nodes: Sequence[str], times: Array, options: Options | None) -> dict[str, Array]:
    """Prior predictive error: node -> standard error (times,) with every value anywhere in its range before any fit. [K]"""
    own = {s.acts[0]: s for store in known.stores for s in store.parameters.values() if s.acts}
    sizes = {path: size for path, s in own.items() if (size := _size_before(s))}
    if not sizes:
        return {}
    sources = tuple(Source(path, "stated", Normal(), f"{path} before any fit") for path in sizes)
    log, also = tuple(own[path].log for path in sizes), {path: own[path].acts[1:] for path in sizes}
    rows = Rows(tuple(sizes), log, also, sources, ("before any fit",) * len(sizes), np.diag(list(sizes.values())))
    setting = Setting.of(Budget.of_rows(rows, budget.model, budget.scenario), times=times, options=options)
    return {n: np.linalg.norm(column[:-1], axis=1) for n, column in setting.linear(nodes).columns.items()}


def _size_before(v: State) -> float:
    """Return how far a value could lie before it was fitted, by its prior or its bounds; fitted form, zero where that has no size."""
    low, high = v.bounds
    if v.prior is not None and np.isfinite(v.prior[1]):
        return float(v.prior[1])
    if v.log and low > 0 and np.isfinite(high):
        return float(np.log(high / low)) / 12**0.5
    if not v.log and np.isfinite(low) and np.isfinite(high):
        return float(high - low) / 12**0.5
    if v.log and low >= 0 and np.isfinite(high) and v.start > 0:
        return float(min(1.0, (high - low) / 12**0.5 / v.start))
    return 0.0


def widened(seen: Foresight, sizes: Mapping[str, float], cause: str, words: str) -> Foresight:
    """Return what is expected with a further standard deviation for what the model could not follow.

    Nodes without a reading of their own get the root mean square of those that have one; boundaries get none. What is counted of this
    already, under another of the two causes, is not added up but the larger one taken.

    Parameters
    ----------
    seen : Foresight
    sizes : dict        Node -> standard deviation; empty for none. [K]
    cause, words : str  What it is called, and what it stands for.
    """
    if not any(sizes.values()):
        return seen
    other = float(np.sqrt(np.mean(np.square(list(sizes.values())))))
    boundaries = seen.solution._run.network.boundaries
    bands = {
        path: _wider(b, 0.0 if path in boundaries else sizes.get(path, other) ** 2, cause) for path, b in seen.prediction.bands.items()
    }
    told = replace(seen.prediction, bands=bands, causes={**seen.prediction.causes, cause: words})
    return replace(seen, prediction=told)


def _wider(band: Band, variance: float, cause: str) -> Band:
    """Return a band with the larger of a variance and of the misfit that it holds."""
    before = band.parts.get(MISFIT, np.zeros(band.times.size))
    if not variance > float(before.max()):
        return replace(band, parts={**band.parts, MISFIT: before})
    members = band.members
    if members is not None:
        # what is added to each member: independent of all others, constant over the run
        more = np.sqrt(variance - before[:, None]) * np.random.default_rng(0).standard_normal(members.shape[1])
        members = members + more
    parts = {c: v for c, v in band.parts.items() if c != MISFIT} | {cause: np.full(band.times.size, variance)}
    return replace(band, parts=parts, members=members)
