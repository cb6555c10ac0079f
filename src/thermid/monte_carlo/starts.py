"""The same scenario begun at another time of the day: what changes in time moves, commands count from the start."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

import numpy as np

from thermid.errors import ScenarioError, nearest
from thermid.model.laws.signal import literal
from thermid.simulation.scenarios.scenario import SLOTS, Scenario

__all__ = ["begun_at", "starts"]

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
