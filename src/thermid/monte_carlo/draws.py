"""What a campaign of runs draws: the budget of its question, weather and start times."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from thermid.errors import ScenarioError
from thermid.fit.calibration import Calibration
from thermid.knowledge.sources import Choice, Source
from thermid.knowledge.values import FittedValues
from thermid.model.tree.model import Model
from thermid.monte_carlo.chunks import Job
from thermid.monte_carlo.starts import begun_at, starts
from thermid.network.network import compile_network
from thermid.prediction.budget import Budget, budget_of
from thermid.prediction.known import known_of
from thermid.prediction.spread import Spread
from thermid.prediction.stated import check_variants
from thermid.simulation.scenarios.scenario import Scenario
from thermid.simulation.simulator import output_times
from thermid.simulation.solver.engine import Options

__all__ = ["Values", "plan_runs"]

SAMPLES = 121
CHUNK = 500

Values = Calibration | FittedValues | Spread


def plan_runs(
    model: Model,
    scenario: Scenario | Sequence[Scenario],
    values: Values | Sequence[Values] = (),
    *,
    at: str = "",
    spread: Mapping[str, Any] | None = None,
    without: Sequence[str] = (),
    seed: int = 0,
    nodes: Sequence[str] | None = None,
    every: str | float | None = None,
    chunk: int = CHUNK,
    options: Options | None = None,
) -> tuple[Job, tuple[str, ...]]:
    """Return what `uncertain_runs` would run, and what a reader must know."""
    from importlib.metadata import version

    given = [values] if isinstance(values, Values) else list(values)
    scenarios = [scenario] if isinstance(scenario, Scenario) else list(scenario)
    if not scenarios or chunk < 1:
        raise ScenarioError("a campaign of runs needs a scenario, and chunks of at least one member.", model.title)
    stated = dict(spread or {})
    begun, stays, remarks = starts(stated.pop("start_time"), scenarios[0]) if "start_time" in stated else ([0.0], (), ())
    first = begun_at(scenarios[0], begun[0], stays)
    known = known_of([v for v in given if not isinstance(v, Spread)], model, at)
    joint = [v for v in given if isinstance(v, Spread)]
    budget = budget_of(known, first, [*joint, *([stated] if stated else [])], without=without)
    check_variants(stated, budget.model, scenarios)
    variants = tuple(begun_at(s, t, stays) for s in scenarios for t in begun)
    for variant in variants:
        variant.check_spans()
    chosen = " and ".join(n for n, several in (("scenario", len(scenarios)), ("start_time", len(begun))) if several > 1)
    budget = _with_variants(budget, chosen, len(variants)) if len(variants) > 1 else budget
    network = compile_network(budget.model, media=first.media(), prescribed=tuple(first.prescribed))
    points = [n.path for n in network.flat.nodes if n.reference_point]
    wanted = nodes if nodes is not None else points or [n for n in network.nodes if network.numbers().capacitances.get(n) is not None]
    kept = tuple(dict.fromkeys(network.find(n) for n in wanted))
    grid = output_times(first, every, None if every is not None else np.linspace(0.0, first.seconds, SAMPLES))
    return Job(budget, variants, kept, grid, seed, chunk, options or Options(), version("thermid")), (*remarks, *budget.remarks)


def _with_variants(budget: Budget, chosen: str, count: int) -> Budget:
    """Return a budget with a source that tells scenarios apart, all as likely; it moves nothing by itself."""
    source = Source(chosen, "variant", Choice(count), f"which of {count} scenarios or starts")
    return budget.beside(source, chosen)
