"""Temperature limits at reference points, their file, and the check of a run or of readings against them: by how much, where, when."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from thermid.base.arguments import check_two, guard_methods
from thermid.base.errors import NameNotFoundError, ScenarioError, errors_at, refuse_unknown
from thermid.base.expression import end_of_range
from thermid.base.extensions import by_grammar
from thermid.base.linear_algebra import Array, Bools
from thermid.base.sourced import check_mark
from thermid.base.toml_files import Places, read_toml
from thermid.base.units import ICE_POINT
from thermid.simulation.runs import Solution, Trace
from thermid.simulation.solver import Dense, resolved

Ends = tuple[float, float]
STATES = {"operating": "operating", "non-operating": "non_operating", "start-up": "start_up"}
"""State of a unit -> the limit that holds in it."""


@guard_methods
@dataclass(frozen=True)
class Limits:
    """Limits of temperature at one reference point.

    Parameters
    ----------
    point : str             What people call it.
    node : str              Its node in the model.
    operating : (low, high) Temperatures while it is switched on, ``("-20 [degC]", td.celsius(55))``; infinite where nobody set one.
    non_operating, start_up : (low, high) or None   Switched off, and at the instant at which it is switched on. All are kept in kelvin.
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
            if (ends := getattr(self, field)) is not None or field == "operating":
                check_two(ends, field, where)
                with errors_at(f"{where}, {state}"):
                    object.__setattr__(self, field, tuple(end_of_range(end) for end in ends))
        if not np.isfinite(self.operating).any():
            raise ScenarioError(
                "operating: both ends are empty, so no limit would be checked. Give the lower, the upper, or both.",
                where,
                code="value.incomplete",
            )
        for state, field in STATES.items():
            ends = getattr(self, field)
            if ends is not None and not ends[0] < ends[1]:
                raise ScenarioError(
                    f"{state}: the lower limit, {text_of(ends[0])}, is not below the upper one, {text_of(ends[1])}.",
                    where,
                    code="value.outside-range",
                )
        for inner, outer in (("operating", "non-operating"), ("start-up", "non-operating")):
            a, b = self.ends(inner), self.ends(outer)
            if a is None or b is None:
                continue
            for side, wrong in (("lower", -np.inf < a[0] < b[0]), ("upper", np.inf > a[1] > b[1])):
                if wrong:
                    k = 0 if side == "lower" else 1
                    raise ScenarioError(
                        f"the {side} {inner} limit, {text_of(a[k])}, lies beyond the {side} {outer} one, {text_of(b[k])}. "
                        "Non-operating limits must be at least as wide as operating limits.",
                        where,
                        code="value.outside-range",
                    )

    def ends(self, state: str) -> Ends | None:
        """Return the limits of a state. [K]"""
        pair: Ends | None = getattr(self, STATES[state])
        return pair


def text_of(kelvin: float) -> str:
    """Return a temperature in degrees Celsius as text; none where there is none."""
    return f"{kelvin - ICE_POINT:.1f} degC" if np.isfinite(kelvin) else "none"


def load_limits(path: str | os.PathLike[str]) -> tuple[Limits, ...]:
    """Return the limits of a file: a table per reference point.

    Raises
    ------
    ScenarioError   When a key is unknown, a limit is no pair of temperatures, or limits are in the wrong order.
    """
    target = Path(path)
    data, lines = read_toml(target)
    return read_limits(data, Places(target.name, lines))


def read_limits(tables: Mapping[str, Any], where: str | Callable[[str], str]) -> tuple[Limits, ...]:
    """Return limits from tables: name of a reference point -> node, operating, non_operating, start_up, loads, mark, source.

    Raises
    ------
    ScenarioError   As in `load_limits`; `where` is the file, or says the place of each key in it.
    """
    place = Places(where) if isinstance(where, str) else where
    if not tables:
        raise ScenarioError(
            "no limits are given. Write a table per reference point: node, operating = [low, high].", place(""), code="value.incomplete"
        )
    read = by_grammar("thermid.campaign._judge.schema.LimitsFile", tables, place).root
    return tuple(Limits(name, **{**dict(table), "loads": tuple(table.loads)}) for name, table in read.items())


@dataclass(frozen=True)
class Crossing:
    """A limit that was passed.

    Parameters
    ----------
    side : str          'low' or 'high'.
    limit : float       [K]
    time : float        When it was first passed; of readings, by straight lines between them. [s]
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
    lowest, highest : float     In that state, between samples too unless `sampled`. [K]
    lowest_time, highest_time : float   [s]
    crossings : tuple of Crossing
    mark : str                  Of the limits.
    by : str                    'predicted' or 'measured'.
    stand_in : bool             Whether operating limits stand for those of a unit switched off, which nobody gave: it bears at least these.
    sampled : bool              Whether only samples are known, as of readings: what lies between them is unknown.
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
    by: str = "predicted"
    stand_in: bool = False
    sampled: bool = False

    @property
    def room(self) -> float:
        """What is left to the nearer limit, below zero where it is passed. [K]"""
        return min(self.limits[1] - self.highest, self.lowest - self.limits[0])

    @property
    def passed(self) -> bool | None:
        """Whether no limit was passed; None where the limits are from memory, or are those of another state and passed."""
        if self.mark == "memory" or (self.stand_in and self.crossings):
            return None
        return not self.crossings

    @property
    def undecided(self) -> str:
        """Why `passed` is None: limits quoted from memory, or operating limits passed while switched off; empty where it is decided."""
        if self.mark == "memory":
            return f"the limits of {self.point} are quoted from memory"
        if self.stand_in and self.crossings:
            return f"{self.point} is beyond its operating limits while it is switched off, and no non-operating limits are given"
        return ""

    def __str__(self) -> str:
        """Return the check as a line."""
        ends = " .. ".join(map(text_of, self.limits))
        how = ("" if self.by == "predicted" else f", {self.by}") + ("; not known between samples" if self.sampled else "")
        head = f"{self.point} {self.state}{how}: {text_of(self.lowest)} .. {text_of(self.highest)} within {ends}"
        if not self.crossings:
            return f"{head}, {self.room:.1f} K left"
        words = {"high": "upper", "low": "lower"}
        crossings = "; ".join(
            f"exceeds the {words[c.side]} limit at {c.time:.0f} s, furthest {text_of(c.worst)} at {c.worst_time:.0f} s, "
            f"{c.outside:.0f} s beyond"
            for c in self.crossings
        )
        return f"{head}: {crossings}" + (f" (not decided: {self.undecided})" if self.undecided else "")


@dataclass(frozen=True)
class Span:
    """A stretch of a run in which a state, and with it its limits (low, high) [K], holds for a reference point.

    Parameters
    ----------
    state : str
    limits : (low, high)    [K]
    start, end : float      First and last stored time in that state. [s]
    """

    state: str
    limits: Ends
    start: float
    end: float


def spans(run: Solution, limits: Limits, default: str = "operating") -> tuple[Span, ...]:
    """Return where the limits of a reference point hold, to the instant of switching; of a state without limits nothing is returned.

    Parameters
    ----------
    run, limits, default    As in `times_in_state`.
    """
    out = []
    run = run.refined([limits.node]) if limits.loads else run
    for state in STATES:
        ends = limits.ends(state)
        if ends is None:
            continue
        inside = times_in_state(run, limits, state, default)
        edges = np.flatnonzero(np.diff(np.concatenate([[False], inside, [False]]).astype(int)))
        out += [Span(state, ends, float(run.times[a]), float(run.times[b - 1])) for a, b in zip(edges[::2], edges[1::2], strict=True)]
    return tuple(out)


def times_in_state(run: Solution, limits: Limits, state: str, default: str = "operating") -> Bools:
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
        refuse_unknown([load], powers, f"limits of '{limits.point}'", "no load '{}'.", NameNotFoundError)
        on |= np.broadcast_to(powers[load], run.times.shape) != 0.0  # a cooler takes heat: its power is negative
    if state == "start-up":
        return np.asarray(on & ~np.concatenate([[False], on[:-1]]))
    return on if state == "operating" else np.asarray(~on)


def check_limits(run: Solution, limits: Sequence[Limits], *, state: str = "operating") -> tuple[LimitCheck, ...]:
    """Return every reference point of a run in every state that it was in, held against its limits, at all times between samples too.

    Where no limits are given for a unit that is switched off, the operating ones stand for them; what lies beyond those is not decided.

    Parameters
    ----------
    run : Solution              The run. Extremes between stored samples count; a check of a run without tracking is marked.
    limits : sequence of Limits
    state : str                 operating or non-operating: of points whose limits name no loads.

    Raises
    ------
    NameNotFoundError   When a node or a load is not in the model.
    ScenarioError       When the state is none.
    """
    if state not in ("operating", "non-operating"):
        raise ScenarioError(f"a run is operating or non-operating, not '{state}'.", run.scenario, code="value.wrong-kind")
    fine = run.refined([one.node for one in limits])
    out = []
    for one in limits:
        trace = fine[one.node]
        if one.loads:
            times, kelvin = fine.times, trace.kelvin
            inside = {name: times_in_state(fine, one, name, state) for name in STATES}
        else:
            times, kelvin = trace.course
            inside = {name: np.full(times.size, name == state) for name in STATES}
        out += _checks(one, times, kelvin, inside, "predicted", trace)
    return tuple(out)


def check_readings(
    readings: Sequence[tuple[str, Array, Array]], limits: Sequence[Limits], run: Solution, *, state: str = "operating"
) -> tuple[LimitCheck, ...]:
    """Return the reference points that a sensor sat at, its readings held against their limits.

    Parameters
    ----------
    readings : sequence         Node, times (samples,) [s] and temperatures (samples,) [K] of each sensor.
    limits : sequence of Limits
    run : Solution              Says at which times each point was on.
    state : str                 As in `check_limits`.
    """
    out = []
    for one, times, kelvin in ((x, t, k) for x in limits for node, t, k in readings if node == x.node):
        # the state of the last stored time of the run before each reading
        before = np.clip(np.searchsorted(run.times, times, side="right") - 1, 0, run.times.size - 1)
        on = times_in_state(run, one, "operating", state)[before]
        started = on & ~np.concatenate([[False], on[:-1]]) if one.loads else np.zeros(times.size, dtype=bool)
        out += _checks(one, times, kelvin, {"operating": on, "non-operating": ~on, "start-up": started}, "measured")
    return tuple(out)


def _checks(one: Limits, times: Array, kelvin: Array, states: Mapping[str, Bools], by: str, trace: Trace | None = None) -> list[LimitCheck]:
    """Return a point held against its limits in every state that it was in; `trace` is the course between samples, if there is one."""
    out = []
    for name, inside in states.items():
        ends, stand_in = one.ends(name), False
        if ends is None and name == "non-operating":
            ends, stand_in = one.operating, True
        if ends is not None and inside.any():
            out.append(_check(one, name, ends, times, kelvin, inside, by, stand_in, trace))
    return out


def _check(
    one: Limits,
    state: str,
    ends: Ends,
    times: Array,
    kelvin: Array,
    inside: Bools,
    by: str,
    stand_in: bool,
    trace: Trace | None,
) -> LimitCheck:
    """Return how one node keeps its lower and upper limit over the times that count, with the times of crossing. [K, s]"""
    index = np.flatnonzero(inside)
    low, high = int(index[kelvin[index].argmin()]), int(index[kelvin[index].argmax()])
    dense = trace.dense if trace is not None else None
    passed = [_crossing(side, limit, times, kelvin, inside, dense) for side, limit in zip(("low", "high"), ends, strict=True)]
    sampled, crossings = trace is None or trace.turnings is None, tuple(c for c in passed if c is not None)
    extremes = (float(kelvin[low]), float(times[low]), float(kelvin[high]), float(times[high]))
    return LimitCheck(one.point, one.node, state, ends, *extremes, crossings, one.mark, by, stand_in, sampled)


def _crossing(side: str, limit: float, times: Array, kelvin: Array, inside: Bools, dense: Dense | None) -> Crossing | None:
    """Return when a limit is first passed, and how far and how long; None where it is not."""
    if not np.isfinite(limit):
        return None
    sign = 1.0 if side == "high" else -1.0
    beyond = (kelvin - limit) * sign
    if dense is not None:
        stored, states = times, inside
        times, beyond = resolved(times, beyond, lambda t: sign * (dense.kelvin(t) - limit))
        inside = states[np.searchsorted(stored, times, side="right") - 1]  # it changes at stored times only
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
    return Crossing(side, limit, begin, limit + sign * float(beyond[worst]), float(times[worst]), outside)
