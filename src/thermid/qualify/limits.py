"""Limits of temperature at reference points, and a run held against them: by how much, where, and when they are crossed."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thermid.errors import NameNotFoundError, ScenarioError, nearest
from thermid.model.modelfile import read_toml
from thermid.model.signal import literal
from thermid.physics.constants import ICE_POINT
from thermid.qualify.marks import check_mark
from thermid.simulation.solution import Solution
from thermid.units import TEMPERATURE

__all__ = ["STATES", "Crossing", "LimitCheck", "Limits", "check_limits", "load_limits", "read_limits", "times_in_state"]

Array = NDArray[np.float64]
Ends = tuple[float, float]
STATES = {"operating": "operating", "non-operating": "non_operating", "start-up": "start_up"}
"""State of a unit -> the limit that holds in it."""
KEYS = ("node", *STATES.values(), "loads", "mark", "source")


@dataclass(frozen=True)
class Limits:
    """Limits of temperature at one reference point.

    Parameters
    ----------
    point : str             What people call it.
    node : str              Its node in the model.
    operating : (low, high) While it is switched on; infinite where nobody set one. [K]
    non_operating, start_up : (low, high) or None   Switched off, and at the instant at which it is switched on. [K]
    loads : tuple of str    Loads that are on when it operates; without them the run says the state.
    mark : str              How sure the numbers are, a key of `MARKS`.
    source : str            Where they stand.
    """

    point: str
    node: str
    operating: Ends
    non_operating: Ends | None = None
    start_up: Ends | None = None
    loads: tuple[str, ...] = ()
    mark: str = "project"
    source: str = ""

    def __post_init__(self) -> None:
        """Refuse limits in the wrong order.

        Raises
        ------
        ScenarioError   Which two are the wrong way round.
        """
        where = f"limits of '{self.point}'"
        check_mark(self.mark, where)
        for state, field in STATES.items():
            ends = getattr(self, field)
            if ends is not None and not ends[0] < ends[1]:
                raise ScenarioError(f"{state}: the lower limit, {_c(ends[0])}, is not below the upper one, {_c(ends[1])}.", where)
        for inner, outer in (("operating", "non-operating"), ("start-up", "non-operating")):
            a, b = self.ends(inner), self.ends(outer)
            if a is None or b is None:
                continue
            for side, wrong in (("lower", -np.inf < a[0] < b[0]), ("upper", np.inf > a[1] > b[1])):
                if wrong:
                    k = 0 if side == "lower" else 1
                    raise ScenarioError(
                        f"the {side} {inner} limit, {_c(a[k])}, lies beyond the {side} {outer} one, {_c(b[k])}; what a unit bears "
                        "switched off it must bear at least as far as what it works at.",
                        where,
                    )

    def ends(self, state: str) -> Ends | None:
        """Return the limits of a state. [K]"""
        found: Ends | None = getattr(self, STATES[state])
        return found


@dataclass(frozen=True)
class Crossing:
    """A limit that was passed.

    Parameters
    ----------
    side : str          'low' or 'high'.
    limit : float       [K]
    time : float        When it was first passed, by straight lines between stored times. [s]
    worst : float       The temperature that lies furthest beyond. [K]
    worst_time : float  [s]
    outside : float     How long the point was beyond it. [s]
    """

    side: str
    limit: float
    time: float
    worst: float
    worst_time: float
    outside: float


@dataclass(frozen=True)
class LimitCheck:
    """One reference point in one state during a run.

    Parameters
    ----------
    point, node, state : str
    limits : (low, high)        [K]
    lowest, highest : float     Of the stored times in that state. [K]
    lowest_time, highest_time : float   [s]
    crossings : tuple of Crossing
    mark : str                  Of the limits.
    """

    point: str
    node: str
    state: str
    limits: Ends
    lowest: float
    lowest_time: float
    highest: float
    highest_time: float
    crossings: tuple[Crossing, ...]
    mark: str

    @property
    def room(self) -> float:
        """What is left to the nearer limit, below zero where it is passed. [K]"""
        return min(self.limits[1] - self.highest, self.lowest - self.limits[0])

    @property
    def passed(self) -> bool | None:
        """Whether no limit was passed; None where the limits are from memory and decide nothing."""
        return None if self.mark == "memory" else not self.crossings

    def __str__(self) -> str:
        """Return the check as a line."""
        head = f"{self.point} {self.state}: {_c(self.lowest)} .. {_c(self.highest)} within {_c(self.limits[0])} .. {_c(self.limits[1])}"
        if not self.crossings:
            return f"{head}, {self.room:.1f} K left"
        ends = {"high": "upper", "low": "lower"}
        said = "; ".join(
            f"passes the {ends[c.side]} limit at {c.time:.0f} s, furthest {_c(c.worst)} at {c.worst_time:.0f} s, {c.outside:.0f} s beyond"
            for c in self.crossings
        )
        return f"{head}: {said}" + (" (limits from memory: not decided)" if self.mark == "memory" else "")


def _c(kelvin: float) -> str:
    return f"{kelvin - ICE_POINT:.1f} degC" if np.isfinite(kelvin) else "none"


def load_limits(path: str | os.PathLike[str]) -> tuple[Limits, ...]:
    """Return the limits of a file: a table per reference point.

    Raises
    ------
    ScenarioError   When a key is unknown, a limit is no pair of temperatures, or limits are in the wrong order.
    """
    target = Path(path)
    data, _ = read_toml(target)
    return read_limits(data, target.name)


def read_limits(tables: Mapping[str, Any], where: str) -> tuple[Limits, ...]:
    """Return limits from tables: name of a reference point -> node, operating, non_operating, start_up, loads, mark, source."""
    if not tables:
        raise ScenarioError("no limits are given. Write a table per reference point: node, operating = [low, high].", where)
    return tuple(_limits(name, table, f"{where}, {name}") for name, table in tables.items())


def _limits(name: str, table: Any, where: str) -> Limits:
    if not isinstance(table, Mapping):
        raise ScenarioError("a reference point is a table with node and operating = [low, high].", where)
    for key in table:
        if key not in KEYS:
            raise ScenarioError(f"a reference point has {', '.join(KEYS)}, not '{key}'.{nearest(key, KEYS)}", where)
    if "node" not in table or "operating" not in table:
        raise ScenarioError("a reference point needs its node, and operating = [low, high].", where)
    ends = {field: _ends(table[field], f"{where}.{field}") for field in STATES.values() if field in table}
    loads, mark = table.get("loads", []), str(table.get("mark", "project"))
    return Limits(name, str(table["node"]), **ends, loads=tuple(loads), mark=mark, source=str(table.get("source", "")))


def _ends(given: Any, where: str) -> Ends:
    if not isinstance(given, list | tuple) or len(given) != 2:
        raise ScenarioError('a limit is a pair, ["-20 [degC]", "55 [degC]"]; an empty text for an end that nobody set.', where)
    low, high = (literal(t, TEMPERATURE, where) if t else None for t in given)
    return (-np.inf if low is None else low, np.inf if high is None else high)


def times_in_state(run: Solution, limits: Limits, state: str, default: str = "operating") -> NDArray[np.bool_]:
    """Return at which stored times (times,) a reference point is in a state.

    Parameters
    ----------
    run : Solution      The run.
    limits : Limits     Of the point; its loads say when it is on.
    state : str         operating, non-operating or start-up.
    default : str       The state of a point whose limits name no loads.

    Raises
    ------
    NameNotFoundError   When a load of the limits is not in the model.
    """
    if not limits.loads:
        return np.full(run.times.size, state == default)
    powers = run.load_powers
    on = np.zeros(run.times.size, dtype=bool)
    for load in limits.loads:
        if load not in powers:
            raise NameNotFoundError(f"no load '{load}'.{nearest(load, powers)}", f"limits of '{limits.point}'")
        on |= np.broadcast_to(powers[load], run.times.shape) > 0
    if state == "start-up":
        return np.asarray(on & ~np.concatenate([[False], on[:-1]]))
    return on if state == "operating" else np.asarray(~on)


def check_limits(run: Solution, limits: Sequence[Limits], *, state: str = "operating") -> tuple[LimitCheck, ...]:
    """Return every reference point of a run in every state that it was in, held against its limits.

    Parameters
    ----------
    run : Solution              The run; store it closely enough for its fastest part.
    limits : sequence of Limits
    state : str                 operating or non-operating: of points whose limits name no loads.

    Raises
    ------
    NameNotFoundError   When a node or a load is not in the model.
    ScenarioError       When the state is none.
    """
    if state not in ("operating", "non-operating"):
        raise ScenarioError(f"a run is operating or non-operating, not '{state}'.", run.scenario)
    out = []
    for one in limits:
        kelvin = run[one.node].kelvin
        for name in STATES:
            ends, inside = one.ends(name), times_in_state(run, one, name, state)
            if ends is not None and inside.any():
                out.append(_check(one, name, ends, run.times, kelvin, inside))
    return tuple(out)


def _check(one: Limits, state: str, ends: Ends, times: Array, kelvin: Array, inside: NDArray[np.bool_]) -> LimitCheck:
    at = np.flatnonzero(inside)
    low, high = int(at[kelvin[at].argmin()]), int(at[kelvin[at].argmax()])
    found = [_crossing(side, limit, times, kelvin, inside) for side, limit in zip(("low", "high"), ends, strict=True)]
    extremes = (float(kelvin[low]), float(times[low]), float(kelvin[high]), float(times[high]))
    return LimitCheck(one.point, one.node, state, ends, *extremes, tuple(c for c in found if c is not None), one.mark)


def _crossing(side: str, limit: float, times: Array, kelvin: Array, inside: NDArray[np.bool_]) -> Crossing | None:
    """Return when a limit is first passed, and how far and how long; None where it is not."""
    if not np.isfinite(limit):
        return None
    beyond = (kelvin - limit) * (1.0 if side == "high" else -1.0)
    past = inside & (beyond > 0)
    if not past.any():
        return None
    first = int(past.argmax())
    begin = float(times[first])
    # the unit may have been beyond before it came into this state; then the change of state is what counts
    if first and inside[first - 1]:
        begin = float(np.interp(0.0, beyond[first - 1 : first + 1], times[first - 1 : first + 1]))
    worst = int(np.flatnonzero(past)[beyond[past].argmax()])
    outside = 0.0
    for k in np.flatnonzero(inside[:-1] & inside[1:]):
        a, b = beyond[k], beyond[k + 1]
        share = 1.0 if min(a, b) >= 0 else 0.0 if max(a, b) <= 0 else max(a, b) / abs(a - b)
        outside += share * float(times[k + 1] - times[k])
    return Crossing(side, limit, begin, float(kelvin[worst]), float(times[worst]), outside)
