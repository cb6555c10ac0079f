"""The same scenario begun at another time of the day: what changes in time moves, commands count from the start."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from thermid.errors import ScenarioError
from thermid.model.signal import literal
from thermid.simulation.scenario import Scenario

__all__ = ["begun_at", "starts"]

STEP = 1800.0
"""Step of start times where none is given. [s]"""


def begun_at(scenario: Scenario, seconds: float) -> Scenario:
    """Return a scenario as it is from a time on, sun, wind, gases and schedules with it; commands stay, as they count from its start."""
    return scenario.begun(seconds, but=("commands",))


def starts(given: Any, scenario: Scenario) -> tuple[list[float], tuple[str, ...]]:
    """Return the start times that a spread of ``start_time`` means [s], and what a reader must know.

    Parameters
    ----------
    given : dict        ``{"low": "0 [h]", "high": "6 [h]", "step": "30 [min]"}``; every step is as likely, the step may be left out.
    scenario : Scenario Its tables should reach from the first start to the end of a run begun last.

    Raises
    ------
    ScenarioError   When it is none, or has more than a thousand steps.
    """
    where = f"{scenario.title}, spread of 'start_time'"
    if not isinstance(given, Mapping) or not {"low", "high"} <= set(given) <= {"low", "high", "step"}:
        raise ScenarioError('write { low = "0 [h]", high = "6 [h]", step = "30 [min]" }.', where)
    low, high = (literal(given[k], "s", where) for k in ("low", "high"))
    step = literal(given["step"], "s", where) if "step" in given else STEP
    if not (0.0 <= low <= high and step > 0.0 and (high - low) / step <= 1000.0):
        raise ScenarioError("start times go from zero or later upward, in a thousand steps at most.", where)
    times = np.arange(low, high + 1e-9 * step, step).tolist()
    stay = [name for name, given in scenario.commands.items() if given.cycle is None or given.cycle > 0.0]
    return times, (f"the start moves all that changes in time but the commands of {', '.join(stay)}, which count from it",) if stay else ()
