"""Temperature limits at reference points, their file, and the check of a run or of readings against them: by how much, where, when.

From a predicted temperature to a limit: model uncertainty, acceptance and qualification margin in one table, beside a fixed margin.

The power margin of controlled heaters too.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from statistics import NormalDist
from typing import Any

import numpy as np

from thermid.base.arguments import check_two, guard_methods
from thermid.base.errors import CodedText, NameNotFoundError, ScenarioError, errors_at, look_up, refuse_unknown
from thermid.base.files import Places, by_grammar, read_toml
from thermid.base.results import MARKS, Figure, Result
from thermid.base.units import ICE_POINT, Array, Bools, amount, end_of_range
from thermid.campaign._judge._constants import COLDER, HEATER_SHARE, SMC, UNTESTED_MARGIN
from thermid.model.tree import UNJUDGED, Standing
from thermid.prediction.bands import Foresight
from thermid.simulation.runs import Dense, Solution, Trace, resolved

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
        Figure.check_mark(self.mark, where)
        for state, ends_of in STATES.items():
            if (ends := getattr(self, ends_of)) is not None or ends_of == "operating":
                check_two(ends, ends_of, where)
                with errors_at(f"{where}, {state}"):
                    object.__setattr__(self, ends_of, tuple(end_of_range(end) for end in ends))
        if not np.isfinite(self.operating).any():
            raise ScenarioError(
                "operating: both ends are empty, so no limit would be checked. Give the lower, the upper, or both.",
                where,
                code="value.incomplete",
            )
        for state, ends_of in STATES.items():
            ends = getattr(self, ends_of)
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
            return CodedText(f"the limits of {self.point} are quoted from memory", "verdict.from-memory")
        if self.stand_in and self.crossings:
            return CodedText(
                f"{self.point} is beyond its operating limits while it is switched off, and no non-operating limits are given",
                "verdict.no-limits-of-this-state",
            )
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
    """Return when a limit is first passed [s], how far [K] and how long [s]; None where it is not.

    Parameters
    ----------
    side : str                  high or low.
    limit : float               [K]
    times, kelvin : array       Instants (times,) [s] and temperatures then [K], straight between them without `dense`.
    inside : array (times,)     Whether the unit is then in the state that the limit is for.
    dense : Dense               Temperatures between the instants.
    """
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


HEATER = Figure(HEATER_SHARE, "read", f"{SMC}, 4.4.2.2")


@dataclass(frozen=True)
class Policy:
    """What is added to a predicted temperature.

    Parameters
    ----------
    name : str
    acceptance, qualification : Figure      Margins beyond predicted and uncertainty. [K]
    level : float                           Probability that the model's uncertainty stands for, both sides. [-]
    heater : Figure                         Power margin of an actively controlled heater. [-]
    """

    name: str
    acceptance: Figure
    qualification: Figure
    level: float = 0.95
    heater: Figure = HEATER

    @property
    def deviations(self) -> float:
        """Standard deviations of a normal distribution that hold its level, on either side. [-]"""
        return NormalDist().inv_cdf(0.5 + 0.5 * self.level)


POLICIES = {
    p.name: p
    for p in (
        Policy(SMC, Figure(0.0, "read", f"{SMC}, 6.3.8.3"), Figure(10.0, "read", f"{SMC}, 6.3.8.3: qualification 10 C beyond acceptance")),
        Policy(
            f"{SMC}, protoqualification",
            Figure(0.0, "read", f"{SMC}, 6.3.8.3"),
            Figure(5.0, "read", f"{SMC}, 6.3.8.3: protoqualification 5 C"),
        ),
        Policy("ECSS", Figure(5.0, "memory", "ECSS-E-ST-31C"), Figure(5.0, "memory", "ECSS-E-ST-31C")),
    )
}
"""Named rules; a project may give its own."""


def fixed_margin(kelvin: float, tested: bool) -> Figure:
    """Return the fixed thermal uncertainty margin of passive hardware. [K]

    SMC-S-016, 4.4.2.1 and Table 4.4-2: 11 C where a balance test correlated the model, 17 C where none did; less for colder hardware.

    >>> fixed_margin(300.0, True).value, fixed_margin(300.0, False).value, fixed_margin(153.0, True).value
    (11.0, 17.0, 8.0)
    """
    if not tested:
        return Figure(UNTESTED_MARGIN, "read", f"{SMC}, 4.4.2.1")
    celsius = kelvin - ICE_POINT
    kelvins = next((m for low, m in COLDER if celsius >= low), 1)
    return Figure(float(kelvins), "read", f"{SMC}, 4.4.2.1, Table 4.4-2")


@dataclass(frozen=True)
class Margin(Result):
    """One reference point on one side: the run and instant that come nearest to its limit, and what is added up there.

    Parameters
    ----------
    point, side, state, run : str   Side is 'hot' or 'cold'.
    time : float                [s]
    predicted : float           [K]
    error : float               Standard error of the prediction. [K]
    shares : dict               Cause -> share of the variance. [-]
    limit : float               [K]
    limit_mark : str            Mark of the limit.
    policy : Policy
    tested : bool               Whether a balance test correlated the model.
    course_mark : str           Mark of the course: 'memory' where the run goes by numbers that nobody has checked.
    assumed : float             What assumed values that no spread names may move it by, 95 %; in no sum. [K]
    not_counted : tuple of str  What the uncertainty does not hold, in words.
    standing : Standing         Of the values that the prediction rests on.
    """

    point: str
    side: str
    state: str
    run: str
    time: float
    predicted: float
    error: float
    shares: Mapping[str, float]
    limit: float
    limit_mark: str
    policy: Policy
    tested: bool
    course_mark: str = "read"
    assumed: float = 0.0
    not_counted: tuple[str, ...] = field(default=())
    standing: Standing = UNJUDGED

    @property
    def sign(self) -> float:
        """One on the hot side, minus one on the cold side."""
        return 1.0 if self.side == "hot" else -1.0

    @property
    def uncertainty(self) -> float:
        """Half the interval of the prediction at the policy's level. [K]"""
        return self.policy.deviations * self.error

    @property
    def printed(self) -> float:
        """The uncertainty as it is printed, to a tenth: what is left between the printed temperature and the printed margin. [K]

        Each rounded by itself, the terms of the sum would miss it by up to two tenths.
        """
        room = self.sign * (self.limit - ICE_POINT - round(self.predicted - ICE_POINT, 1))
        return abs(round(room - self.policy.acceptance.value - self.policy.qualification.value - round(self.margin, 1), 1))

    @property
    def margin(self) -> float:
        """What is left to the limit once uncertainty, acceptance and qualification margin are added. [K]"""
        return self.room - self.uncertainty - self.policy.acceptance.value - self.policy.qualification.value

    @property
    def room(self) -> float:
        """Distance from the predicted temperature to the limit, without uncertainty and margins. [K]"""
        return self.sign * (self.limit - self.predicted)

    @property
    def fixed(self) -> Figure:
        """The fixed margin of the standard in place of the model's uncertainty. [K]"""
        return fixed_margin(self.predicted, self.tested)

    @property
    def left_with_fixed(self) -> float:
        """What is left to the limit with the fixed margin in place of the uncertainty. [K]"""
        return self.room - self.fixed.value - self.policy.acceptance.value - self.policy.qualification.value

    @property
    def exceedance(self) -> float:
        """Probability that the limit itself is passed at that instant, errors being normal. [-]"""
        if self.error <= 0:
            return float(self.room < 0)
        return NormalDist().cdf(-self.room / self.error)

    @property
    def mark(self) -> str:
        """The least sure of the marks that the margin rests on."""
        return Figure.weakest((self.limit_mark, self.policy.acceptance.mark, self.policy.qualification.mark, self.course_mark))

    @property
    def with_assumed(self) -> float:
        """Margin left once assumed values that no spread names are counted too. [K]"""
        return self.margin + self.uncertainty - float(np.hypot(self.uncertainty, self.assumed))

    @property
    def undecided(self) -> str:
        """Why it is not decided, as text; empty where it is: below zero, or with a known error above it even by assumed values."""
        if self.mark == "memory":
            return CodedText("a number quoted from memory", "verdict.from-memory")
        if self.margin < 0:
            return ""
        if self.error <= 0 and not self.is_start_value:
            return "the model's error is not known. Fit the model, or state a spread"
        if self.with_assumed < 0:
            return f"assumed values alone may change it by {self.assumed:.1f} K. Measure them, or state their spread"
        return ""

    @property
    def is_start_value(self) -> bool:
        """Whether the temperature is the given one of a start, which the model says nothing about."""
        return self.time <= 0.0

    @property
    def passed(self) -> bool | None:
        """Whether anything is left; None where that is not decided, see `undecided`."""
        return None if self.undecided else self.margin >= 0

    def __str__(self) -> str:
        """Return the sum as a line."""
        p = self.policy
        mark = Figure.weakest((p.acceptance.mark, p.qualification.mark))
        source = "" if mark == "read" else f", {MARKS[mark]}"
        word = f"not decided: {self.undecided}" if self.undecided else "met" if self.passed else "NOT met"
        return (
            f"{self.point}, {self.side} ({self.run}, {self.time / 3600:.2f} h, {self.state}): {self.predicted - ICE_POINT:.1f} degC, "
            f"uncertainty {self.printed:.1f} + acceptance {p.acceptance.value:g} + qualification {p.qualification.value:g} "
            f"({p.name}{source}), limit {self.limit - ICE_POINT:.1f} degC: "
            f"{self.margin:+.1f} K, {word}; with the fixed {self.fixed.value:g} K of {SMC} instead of the uncertainty: "
            f"{self.left_with_fixed:+.1f} K"
        )


def margins(
    runs: Mapping[str, Foresight],
    limits: Sequence[Limits],
    policy: Policy | str = SMC,
    *,
    tested: bool = False,
    states: Mapping[str, str] | None = None,
) -> tuple[Margin, ...]:
    """Return the margin of every reference point on both sides, each at the run, state and instant that come nearest to a limit.

    Parameters
    ----------
    runs : dict             Name -> what is expected of it.
    limits : sequence       Of the reference points.
    policy : Policy, str    What is added up, or the name of one of `POLICIES`.
    tested : bool           Whether a balance test correlated the model: 11 K against 17 K of fixed margin.
    states : dict           Run -> its state, for points whose limits name no loads; operating by default.

    Raises
    ------
    NameNotFoundError   When there is no such policy.
    ScenarioError       Without a run.
    """
    policy = _policy(policy)
    refuse_unknown(filter(None, (states or {}).values()), STATES, "margins", "no state '{}'; there are {known}.", ScenarioError)
    if not runs:
        raise ScenarioError("margins need at least one run.", "margins", code="value.outside-range")
    out = []
    for one in limits:
        for k, side in enumerate(("cold", "hot")):
            candidates = [
                m
                for name, run in runs.items()
                for m in _tightest_instants(name, run, one, k, side, policy, tested, (states or {}).get(name, ""))
            ]
            if candidates:
                out.append(min(candidates, key=lambda m: m.margin))
    return tuple(out)


def _policy(policy: Policy | str) -> Policy:
    """Return a policy, or that of a name.

    Raises
    ------
    NameNotFoundError   When there is none.
    """
    if isinstance(policy, Policy):
        return policy
    return look_up(policy, POLICIES, f"unknown margin policy '{{}}'. Use one of {'; '.join(POLICIES)}.", "margins")


def _tightest_instants(name: str, run: Foresight, one: Limits, k: int, side: str, policy: Policy, tested: bool, state: str) -> list[Margin]:
    """Return, of each state that a point has limits for, the margin at the instant nearest to its limit in one run.

    `k` is 0 for the lower and 1 for the upper limit; nearest counts how far the band of the policy's level reaches. `name` is the run's.
    """
    band, level = run.prediction[one.node], policy.level
    sign, end = 1.0 if k else -1.0, band.interval(level)[k] + ICE_POINT
    out = []
    for state_name in ("operating", "non-operating", "start-up"):
        ends, inside = one.ends(state_name), times_in_state(run.solution, one, state_name, state or "operating")
        if ends is None or not np.isfinite(ends[k]) or not inside.any():
            continue
        index = int(np.where(inside, sign * end, -np.inf).argmax())
        variance = sum(float(v[index]) for v in band.parts.values())  # of a mixture it is not that of the interval
        shares = {c: float(v[index]) / variance if variance > 0.0 else 0.0 for c, v in band.parts.items()}
        expected, furthest = band.extreme(sign, inside, level) if band.switches else (float(band.kelvin[index]), float(end[index]))
        figures = (float(band.times[index]), expected, sign * (furthest - expected) / policy.deviations)
        out.append(Margin(one.point, side, state_name, name, *figures, shares, ends[k], one.mark, policy, tested, standing=run.standing))
    return out


@dataclass(frozen=True)
class HeaterDuty:
    """How busy a controlled heater is, and whether its power margin is left.

    Parameters
    ----------
    load, run : str
    duty : float        Mean power over full power in the window. [-]
    full : float        Full power. [W]
    window : (begin, end)   [s]
    rule : Figure       The power margin. [-]
    """

    load: str
    run: str
    duty: float
    full: float
    window: tuple[float, float]
    rule: Figure

    @property
    def max_duty(self) -> float:
        """The largest duty that leaves the margin: 80 % for a margin of 25 %. [-]"""
        return 1.0 / (1.0 + self.rule.value)

    @property
    def margin(self) -> float:
        """Power at full duty over the power needed, less one. [-]"""
        return np.inf if self.duty <= 0 else 1.0 / self.duty - 1.0

    @property
    def passed(self) -> bool | None:
        """Whether the margin is left; None where the rule is from memory."""
        return self.duty <= self.max_duty + 1e-12 if self.rule.decides else None


def heater_duty(
    run: Foresight, load: str, full: float, *, window: tuple[float, float] | None = None, name: str = "", policy: Policy | str = SMC
) -> HeaterDuty:
    """Return the duty of a heater: its mean power over its full power, at the lowest bus voltage of the coldest case. [-]

    The mean is (integral of the power by trapezoids) / (end - begin) over stored times in the window.

    Parameters
    ----------
    run : Foresight     The coldest run.
    load : str          The heater.
    full : float        Its power when it is on, at that voltage. [W]
    window : (begin, end)   Over which it is averaged, several of its cycles; the second half of the run by default. [s]
    name : str          Of the run.
    policy : Policy, str    Holds the power margin.

    Raises
    ------
    NameNotFoundError   When there is no such load.
    ScenarioError       When the full power is not above zero, or the window lies outside the run.
    """
    rule = _policy(policy).heater
    powers, times = run.solution.load_powers, run.solution.times
    refuse_unknown([load], powers, run.solution.title, "no load '{}'.", NameNotFoundError)
    if full <= 0:
        raise ScenarioError(f"the full power of heater '{load}' must be above zero.", run.solution.title, code="value.outside-range")
    begin, end = (0.5 * float(times[-1]), float(times[-1])) if window is None else (amount(t, "s", f"window of '{load}'") for t in window)
    inside = (times >= begin) & (times <= end)
    if np.count_nonzero(inside) < 2:
        raise ScenarioError(
            f"the window of heater '{load}', {begin:g} s to {end:g} s, holds fewer than two stored times.",
            run.solution.title,
            code="record.too-short",
        )
    watts = np.broadcast_to(powers[load], times.shape)[inside]
    mean = float(np.trapezoid(watts, times[inside]) / (times[inside][-1] - times[inside][0]))
    return HeaterDuty(load, name or run.scenario.title, mean / full, full, (begin, end), rule)
