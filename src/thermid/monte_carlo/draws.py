"""What a campaign of runs draws: the budget of its question, weather and start times."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np

from thermid.errors import ScenarioError, nearest
from thermid.fit.calibration import Calibration
from thermid.knowledge.sources import Choice, Source
from thermid.knowledge.values import FittedValues
from thermid.model.model import Model
from thermid.model.signal import literal
from thermid.monte_carlo.chunks import Job
from thermid.network.network import compile_network
from thermid.prediction.budget import Budget, budget_of
from thermid.prediction.known import known_of
from thermid.prediction.spread import Spread
from thermid.prediction.stated import check_variants
from thermid.simulation.engine import Options
from thermid.simulation.scenario import SLOTS, Scenario
from thermid.simulation.simulator import output_times

__all__ = ["Values", "begun_at", "plan_runs", "starts"]

STEP = 1800.0
"""Step of start times where none is given. [s]"""


def begun_at(scenario: Scenario, seconds: float, stays: Collection[str] = ()) -> Scenario:
    """Return a scenario as it is from a time on: sun, wind, gases and schedules too; commands, and what `stays`, do not move."""
    return scenario.begun(seconds, but=("commands", *stays))


def starts(given: Any, scenario: Scenario) -> tuple[list[float], tuple[str, ...], tuple[str, ...]]:
    """Return the start times that a spread of ``start_time`` means [s], what stays where it is, and what a reader must know.

    Parameters
    ----------
    given : dict        ``{"low": "0 [h]", "high": "6 [h]", "step": "30 [min]", "stays": ["air_flow"]}``; every step is as likely. The step
                        may be left out; ``stays`` names what is done and counts from the start, as commands do.
    scenario : Scenario Its tables reach from the first start to the end of a run begun last.

    Raises
    ------
    ScenarioError   When it is none, has more than a thousand steps, or names what the scenario does not have.
    """
    where = f"{scenario.title}, spread of 'start_time'"
    if not isinstance(given, Mapping) or not {"low", "high"} <= set(given) <= {"low", "high", "step", "stays"}:
        raise ScenarioError('write { low = "0 [h]", high = "6 [h]", step = "30 [min]" }.', where)
    low, high = (literal(given[k], "s", where) for k in ("low", "high"))
    step = literal(given["step"], "s", where) if "step" in given else STEP
    if not (0.0 <= low <= high and step > 0.0 and (high - low) / step <= 1000.0):
        raise ScenarioError("start times go from zero or later upward, in a thousand steps at most.", where)
    times = np.arange(low, high + 1e-9 * step, step).tolist()
    stays = tuple(given.get("stays", ()))
    known = {name for place, _ in scenario.signals() for name in (place.partition(".")[2], place.split(".")[1])} | set(SLOTS)
    for name in stays:
        if name not in known:
            raise ScenarioError(f"nothing called '{name}' changes in the scenario.{nearest(name, known)}", f"{where}, stays")
    still = [k for k, s in scenario.commands.items() if s.cycle != 0.0] + [n for n in stays if n not in scenario.commands]
    said = (f"the start moves all that changes in time but {', '.join(still)}, which count{'s' * (len(still) == 1)} from it",)
    return times, stays, said if still and len(times) > 1 else ()


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
