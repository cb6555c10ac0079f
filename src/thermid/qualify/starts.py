"""The same scenario begun at another time of the day: weather moves, what is done stays."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from thermid.errors import ScenarioError
from thermid.model.signal import Constant, Signal, Sine, Table, literal
from thermid.simulation.scenario import Scenario

__all__ = ["begun_at", "starts"]

STEP = 1800.0
"""Step of start times where none is given. [s]"""


def begun_at(scenario: Scenario, seconds: float) -> Scenario:
    """Return a scenario whose boundaries, loads and prescribed nodes are those from a time on; schedules, commands and gases stay."""
    tables: dict[str, Mapping[str, Signal]] = {
        key: {n: _later(s, seconds) for n, s in getattr(scenario, key).items()} for key in ("boundaries", "loads", "prescribed")
    }
    changed: dict[str, Any] = dict(tables)
    return replace(scenario, **changed)


def _later(signal: Signal, seconds: float) -> Signal:
    if isinstance(signal, Constant):
        return signal
    if isinstance(signal, Sine):
        return replace(signal, phase=signal.phase + 2.0 * math.pi * seconds / signal.period)
    rest = signal.times > seconds
    first = signal.at(np.array([seconds]))
    return Table(np.concatenate(([0.0], signal.times[rest] - seconds)), np.concatenate((first, signal.values[rest])), signal.hold)


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
    short = [
        n
        for key in ("boundaries", "loads", "prescribed")
        for n, s in getattr(scenario, key).items()
        if isinstance(s, Table) and s.times.size > 1 and s.times[-1] < times[-1] + scenario.seconds - 1e-6
    ]
    remark = (f"the tables of {', '.join(short)} end before a run that begins last; they stay at their last value",) if short else ()
    return times, remark
