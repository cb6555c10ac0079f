"""Signals: what changes with time - a boundary temperature, a power, a scheduled parameter - and the one algebra of them.

Nothing outside this file takes a signal apart, but for what writes it down for another program (the kernel, SPICE, Octave): builders of
scenarios shift, cut, scale, add and multiply by the methods below, which keep every property of every kind.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from numbers import Real
from typing import Any, Self

import numpy as np

from thermid.base.errors import ScenarioError, cap, errors_at, raising
from thermid.base.units import (
    HOUR,
    TEMPERATURE,
    THREE_WAYS,
    Array,
    Expression,
    Quantity,
    Stamp,
    clocked,
    plain_numbers,
    quantity,
    require,
    si_value,
    si_values,
    stated,
    text_value,
    unit as read_unit,
)

Span = tuple[float, float]

AFTER = ("hold", "repeat")
"""What a table may say of the time beyond its last row."""
SAMPLES = ("instant", "average")
"""What a sample of a log is: the value at its stamp, or the mean over the interval that ends there."""
SINE_SAMPLES = 400
"""Samples of a period where a sine must become a table: within 3e-5 of its amplitude. [-]"""
JUMP_TIME = 1e-6
"""Time in which a held value jumps where it meets one that is not held. [s]"""
SMALL_CHANGE = 0.01
"""Change over the largest one up to which it is noise or nearly nothing: what it adds to a variance is its square of that. [-]"""
END_TOLERANCE = 1e-12
"""Share of a run by which times of an edge and of its end may differ. [-]"""
MAX_LINE_ERROR_SHARE = 2e-5
"""Share of a signal's range by which straight lines may miss what follows from other signals. [-]"""
MOST_HALVINGS = 8
"""Times that a stretch is halved until straight lines do."""
END_SLACK = 0.01
"""Share of its length by which a table may end before a run, or begin after it, if that is no more than one of its intervals. [-]"""
FOREVER = (-math.inf, math.inf)
CONDUCT = ("before", "after", "period", "samples")
"""What may be said of a table and of a column of a log alike."""


class _Endless:
    """What has no rows: it is known for all times, has no last value to hold, and nothing to cut."""

    span: Span = FOREVER
    onset = 0.0

    def held_on(self) -> Self:
        """Return the signal with its last value held: itself."""
        return self

    def cut(self, begin: float, end: float) -> Self:
        """Return the signal without its rows outside `begin` .. `end` [s]: itself."""
        return self


class _Still(_Endless):
    """What has one value all through a run, `value` in SI: the members that `Constant` and `MeanOf` share."""

    value: float

    @property
    def extent(self) -> float:
        """Time of its last event: the last row of a table, one period of a sine, zero of a constant. [s]"""
        return 0.0

    @property
    def held(self) -> bool:
        """Whether it is constant between jumps, as steps are."""
        return True

    @property
    def cycle(self) -> float | None:
        """Period after which its values repeat; zero where they never change, None where they do not repeat. [s]"""
        return 0.0

    @property
    def bounds(self) -> tuple[float, float]:
        """Lowest and highest value that it takes. [SI]"""
        return self.value, self.value

    def at(self, times: Array) -> Array:
        """Return its values (times,) at times [s]. [SI]"""
        return np.full(times.shape, self.value)

    @property
    def levels(self) -> Array:
        """Values (levels,) of its rows; one of a constant. Those on the lines between rows are left out. [SI]"""
        return np.array([self.value])

    def drawn(self, end: float) -> Constant:
        """Return the signal as a run from zero to `end` [s] sees it: a constant, a sine, or a table that repeats nothing."""
        return Constant(self.value)

    def knots(self, begin: float, end: float) -> Array:
        """Return the times (knots,), from before `begin` or at it to `end` or beyond, between which it is a straight line. [s]"""
        return np.zeros(1)

    def turning_times(self, end: float) -> Array:
        """Return the times (turns,) in 0 .. `end` at which it turns from rising to falling or back; none of a constant. [s]"""
        return np.zeros(0)

    def mean_over(self, begin: float, end: float) -> float:
        """Return its mean over `begin` .. `end` [s], the integral over the length; its value at `begin` where the length is zero. [SI]"""
        return self.value


@dataclass(frozen=True)
class Constant(_Still):
    """A value that does not change. [SI]"""

    value: float

    def shifted(self, seconds: float) -> Constant:
        """Return the signal on a clock that starts later: its value at t is the old one at t + `seconds`."""
        return self

    def scaled(self, factor: float) -> Constant:
        """Return `factor` times the signal."""
        return Constant(factor * self.value)

    def raised(self, shift: float) -> Constant:
        """Return the signal with `shift` added to every value. [SI]"""
        return Constant(self.value + shift)


@dataclass(frozen=True, eq=False)
class TableSignal:
    """Samples, joined by straight lines or held until the next one.

    Parameters
    ----------
    times : array (samples,)    Strictly increasing. [s]
    values : array (samples,)   [SI]
    hold : bool                 Whether each value holds until the next sample; the last one of a table that was written then holds on.
    unit : str                  Unit in which a log had the values; what it stands for must be of the same dimension. Empty where none said.
    log : (str, float) or None  Of a column of a log: the hash of its samples, and the time in it that is zero here; of a Series or a
                                DataArray no hash. [s]
    after : str                 What holds beyond the last row: ``hold``, ``repeat`` (the last row ends the period), or nothing (empty): a
                                run that lasts longer is refused.
    before : str                What holds before the first row: ``hold``, or nothing (empty): a run that begins earlier is refused.
    samples : str               Of a log: ``instant`` or ``average``, as somebody said; empty where nobody did, which is taken as instants.
    stamp : Stamp or None       Instant of its time zero, until a scenario has laid it on its own clock.
    """

    times: Array
    values: Array
    hold: bool = False
    unit: str = ""
    log: tuple[str, float] | None = None
    after: str = ""
    before: str = ""
    samples: str = ""
    stamp: Stamp | None = None

    def __post_init__(self) -> None:
        """Refuse a table that is no function of time: shapes that differ, times that do not increase, a period whose ends differ."""
        if self.times.ndim != 1 or self.times.shape != self.values.shape or self.times.size == 0:
            raise ScenarioError("a table needs as many values as times, and at least one.", code="value.shape")
        if not (np.isfinite(self.times).all() and np.isfinite(self.values).all()):
            raise ScenarioError("a table holds a time or a value that is not a number.", code="value.outside-range")
        if (np.diff(self.times) <= 0).any():
            k = int(np.argmax(np.diff(self.times) <= 0))
            raise ScenarioError(
                f"times of a table must increase; {self.times[k + 1]:g} s follows {self.times[k]:g} s.", code="value.outside-range"
            )
        for written, words, rule in (
            (self.after, AFTER, "after is 'hold' or 'repeat'"),
            (self.before, AFTER[:1], "before is 'hold' (the first value)"),
            (self.samples, SAMPLES, "samples are 'instant' or 'average'"),
        ):
            if written not in ("", *words):
                raise ScenarioError(f"{rule}, not '{written}'.", code="value.wrong-kind")
        if self.after == "repeat":
            # refuse a table whose end does not meet its beginning
            if self.times.size < 2:
                raise ScenarioError("a table of one row has no period to repeat.", code="model.law-refused")
            size = max(float(np.ptp(self.values)), 1e-12 * float(np.abs(self.values).max()))
            if abs(float(self.values[-1] - self.values[0])) > 1e-9 * size:
                raise ScenarioError(
                    f"a table that repeats must end with its first value. Its last row, at {self.times[-1]:g} s, has "
                    f"{self.values[-1]:.6g} and its "
                    f"first {self.values[0]:.6g} (SI). Repeat the first value at the end, or give the period: period = '24 [h]'.",
                    code="model.law-refused",
                )

    @property
    def span(self) -> Span:
        """First and last time at which its value is known; a run beyond is refused. [s]

        `before` = hold reaches back, `after` = hold or repeat, and the steps of a table that was written, reach on for ever. Else a table
        reaches one interval beyond each end, but at most a hundredth of its length; a log reaches the whole interval.
        """
        first, last = float(self.times[0]), float(self.times[-1])
        if self.after == "repeat" or self.times.size == 1:
            return FOREVER
        least, steps = END_SLACK * (last - first), np.diff(self.times)
        ahead = float(steps[0]) if self.log and self.log[0] else min(float(steps[0]), least)  # the stamps of a Series are meant
        beyond = float(steps[-1]) if self.log else min(float(steps[-1]), least)
        begin = -math.inf if self.before == "hold" else first - ahead
        return begin, math.inf if self.after == "hold" or (self.hold and self.log is None) else last + beyond

    @property
    def extent(self) -> float:
        """Time of its last event: the last row of a table, one period of a sine, zero of a constant. [s]"""
        return float(self.times[-1])

    @property
    def onset(self) -> float:
        """Time of its first row, zero where it has none. [s]"""
        return float(self.times[0])

    @property
    def held(self) -> bool:
        """Whether it is constant between jumps, as steps are."""
        return self.hold or self.times.size == 1

    @property
    def cycle(self) -> float | None:
        """Period after which its values repeat; zero where they never change, None where they do not repeat. [s]"""
        if self.after == "repeat":
            return float(self.times[-1] - self.times[0])
        return 0.0 if float(np.ptp(self.values)) == 0.0 else None

    @property
    def bounds(self) -> tuple[float, float]:
        """Lowest and highest value that it takes. [SI]"""
        return float(self.values.min()), float(self.values.max())

    @property
    def levels(self) -> Array:
        """Values (levels,) of its rows; one of a constant. Those on the lines between rows are left out. [SI]"""
        return self.values

    def at(self, times: Array) -> Array:
        """Return values (times,) at times [s]: on the line between two rows, or held. [SI]

        Outside the rows the first and last one hold; a table that repeats does so before its first row too.
        """
        if self.after == "repeat":
            times = self.times[0] + np.mod(times - self.times[0], self.times[-1] - self.times[0])
        if self.hold:
            return self.values[np.clip(np.searchsorted(self.times, times, side="right") - 1, 0, None)]
        return np.interp(times, self.times, self.values)

    def shifted(self, seconds: float) -> TableSignal:
        """Return the signal on a clock that starts later: its value at t is the old one at t + `seconds`."""
        log = None if self.log is None else (self.log[0], self.log[1] + seconds)
        return replace(self, times=self.times - seconds, log=log)

    @property
    def instants(self) -> Array:
        """Times of its samples. [s]"""
        return self.times

    def held_on(self) -> TableSignal:
        """Return the signal with `after` = hold, unless it has an `after` already."""
        return self if self.after else replace(self, after="hold")

    def within(self, times: Array, where: str) -> Array:
        """Return values (times,) at times [s], all of which must lie within `span`; `where` is for the message. [SI]

        Raises
        ------
        ScenarioError   When one lies outside.
        """
        first, last = self.span
        beyond = times[(times < first - 1e-6) | (times > last + 1e-6)]
        if beyond.size:
            raise ScenarioError(
                f"it is known from {first:g} to {last:g} s, but requested at {beyond[0]:g} s.", where, code="value.outside-range"
            )
        return self.at(times)

    def retimed(self, law: Callable[[Array], Array]) -> TableSignal:
        """Return the signal with its times [s] mapped to those of another clock by `law`; its first and last value then hold."""
        return replace(self, times=law(self.times), before="hold", after=self.after or "hold")

    def changed_within(self) -> TableSignal:
        """Return the signal with each sample that differs from the one before moved half an interval earlier; first and last value hold."""
        times, change = self.times.copy(), 1 + np.flatnonzero(np.diff(self.values))
        times[change] -= 0.5 * (self.times[change] - self.times[change - 1])
        return self.retimed(lambda _: times)

    def jumps_at(self, time: float) -> bool:
        """Return whether it is held and has another value from a time on than before. [s]"""
        return self.hold and time in self.corners()[1:]

    def with_row_later(self, row: int, by: float) -> TableSignal:
        """Return the signal with one row later by some time, and those that it would pass right behind it. [s]"""
        order = JUMP_TIME * np.arange(self.times.size)
        times = self.times + np.where(np.arange(self.times.size) == row, by, 0.0)
        return replace(self, times=np.maximum.accumulate(times - order) + order)

    def largest_changes(self, most: int) -> list[int]:
        """Return the indices of the samples after its `most` largest steps, the largest first; none below `SMALL_CHANGE` of that."""
        steps = np.abs(np.diff(self.values))
        large = np.count_nonzero(steps > SMALL_CHANGE * steps.max(initial=0.0))
        return [int(k) + 1 for k in np.argsort(-steps, kind="stable")[: min(most, large)]]

    def levelled(self, least: float) -> TableSignal:
        """Return the signal with the samples between two steps larger than `least` [SI] replaced by their mean."""
        stretch = np.append(0, np.cumsum(np.abs(np.diff(self.values)) > least))
        return replace(self, values=(np.bincount(stretch, self.values) / np.bincount(stretch))[stretch], unit="")

    def gaps(self, place: int) -> tuple[float, float]:
        """Return the intervals before and after the sample of index `place`; infinite after the last one. [s]"""
        before, after = np.diff(self.times[place - 1 : place + 2], append=np.inf)[:2]
        return float(before), float(after)

    def steps_above(self, share: float, least: float) -> Array:
        """Return the steps between samples (samples - 1,), zero where they are below a share of the largest value or `least`. [SI]"""
        steps = np.diff(self.values)
        return np.where(np.abs(steps) > max(share * float(np.abs(self.values).max()), least), steps, 0.0)

    def mapped(self, law: Callable[[Array], Array]) -> TableSignal:
        """Return the signal with `law` applied to its values; lines between samples, or steps, stay so."""
        return replace(self, values=law(self.values), unit="")

    def cut(self, begin: float, end: float) -> TableSignal:
        """Return the signal without its rows outside `begin` .. `end` [s], with rows at both ends; one that repeats is kept whole."""
        if self.after == "repeat" or self.times.size == 1:
            return self
        inside = self.times[(self.times > begin) & (self.times < end)]
        ends = [t for t in (max(begin, float(self.times[0])), min(end, float(self.times[-1]))) if begin <= t <= end]
        times = np.union1d(inside, ends) if inside.size or ends else np.array([begin])
        return replace(self, times=times, values=self.at(times))

    def scaled(self, factor: float) -> TableSignal:
        """Return `factor` times the signal."""
        return replace(self, values=factor * self.values)

    def raised(self, shift: float) -> TableSignal:
        """Return the signal with `shift` added to every value. [SI]"""
        return replace(self, values=self.values + shift)

    def drawn(self, end: float) -> TableSignal:
        """Return the signal as a run from zero to `end` [s] sees it: its rows of that time, and periods laid one after the other.

        Of a table that does not repeat the rows from the last at or before zero to the first at or after `end` stay.
        """
        if self.after != "repeat":
            if end <= 0.0:
                return self
            first = max(int(np.searchsorted(self.times, 0.0, side="right")) - 1, 0)
            last = int(np.searchsorted(self.times, end, side="left")) + 1
            return (
                self
                if first == 0 and last >= self.times.size
                else replace(self, times=self.times[first:last], values=self.values[first:last])
            )
        length = float(self.times[-1] - self.times[0])
        lead = math.floor((0.0 - self.times[0]) / length)
        count = max(math.ceil((end - self.times[0]) / length), lead + 1) - lead
        _samples(float(count * self.times.size), length)
        times = (self.times[:-1][None, :] + (lead + np.arange(count))[:, None] * length).ravel()
        values = np.tile(self.values[:-1], count)
        last = self.times[0] + (lead + count) * length
        return replace(self, times=np.append(times, last), values=np.append(values, self.values[-1]), after="hold", log=None)

    def turning_times(self, end: float) -> Array:
        """Return the times (turns,) in 0 .. `end` at which it turns from rising to falling or back, and of its first and last row. [s]"""
        drawn = self.drawn(end)
        steps = np.sign(np.diff(drawn.values))
        turns = np.concatenate(([True], steps[1:] * steps[:-1] <= 0.0, [True])) if steps.size else np.ones(1, dtype=bool)
        times = drawn.times[turns]
        return np.asarray(times[(times >= 0.0) & (times <= end)])

    def corners(self) -> Array:
        """Return the times (corners,) of its rows; of steps the first and those at which the value changes. [s]"""
        changes = np.concatenate(([True], np.diff(self.values) != 0.0)) if self.hold else np.ones(self.times.size, dtype=bool)
        return np.asarray(self.times[changes])

    def knots(self, begin: float, end: float) -> Array:
        """Return the times (knots,) between which it is a straight line; a jump of a held table becomes a line `JUMP_TIME` long. [s]"""
        times = self.drawn(end).times if self.after == "repeat" else self.times
        if not self.hold or times.size < 2:
            return times
        moment = min(JUMP_TIME, 0.25 * float(np.diff(times).min()))
        return np.union1d(times, times[1:] - moment)

    def mean_over(self, begin: float, end: float) -> float:
        """Return its mean over `begin` .. `end` [s], the integral over the length; its value at `begin` where the length is zero. [SI]"""
        if end <= begin:
            return float(self.at(np.array([begin]))[0])
        whole = self.drawn(end)
        times = np.concatenate(([begin], whole.times[(whole.times > begin) & (whole.times < end)], [end]))
        values = whole.at(times)
        levels = values[:-1] if self.hold else 0.5 * (values[1:] + values[:-1])
        return float(levels @ np.diff(times)) / (end - begin)

    def with_details(self, details: Mapping[str, Any], where: str) -> TableSignal:
        """Return a table with what the keys `samples`, `before`, `after` and `period` of `details` say of it.

        Raises
        ------
        ScenarioError   When a word is unknown, a period is too short, or steps of their own are said to be averages.
        """
        samples, after = str(details.get("samples", "")), str(details.get("after", ""))
        if samples == "average":
            if details.get("hold"):
                raise ScenarioError(
                    "samples = 'average' implies steps, each up to its time stamp. Leave hold out.", where, code="value.without-effect"
                )
            self = averages(self.times, self.values, unit=self.unit, log=self.log, stamp=self.stamp)
        if "period" in details:
            if after != "repeat":
                raise ScenarioError(
                    "a period applies to after = 'repeat' only. Add it, or leave the period out.", where, code="value.incomplete"
                )
            length = literal(details["period"], "s", where)
            if not length > float(self.times[-1] - self.times[0]):
                raise ScenarioError(
                    f"a period of {length:g} s ends before the last row of its table. Give a longer period, or leave it out if the last "
                    "row is its end.",
                    where,
                    code="value.outside-range",
                )
            self = replace(self, times=np.append(self.times, self.times[0] + length), values=np.append(self.values, self.values[0]))
        return replace(self, samples=samples or self.samples, after=after, before=str(details.get("before", "")))


@dataclass(frozen=True)
class Sine(_Endless):
    """A mean and a sine: mean + amplitude sin(2 pi t / period + phase).

    Parameters
    ----------
    mean, amplitude : float   [SI]
    period : float            [s]
    phase : float             [rad]
    unit : str                Unit in which it was written, where only the model knows what it is for; empty otherwise.
    """

    mean: float
    amplitude: float
    period: float
    phase: float = 0.0
    unit: str = ""

    def turning_times(self, end: float) -> Array:
        """Return the times (turns,) in 0 .. `end` at which it turns from rising to falling or back; none of a constant. [s]"""
        first = (0.25 - self.phase / (math.tau)) % 0.5
        return np.asarray(self.period * np.arange(first, end / self.period, 0.5))

    @property
    def extent(self) -> float:
        """Time of its last event: the last row of a table, one period of a sine, zero of a constant. [s]"""
        return self.period

    @property
    def held(self) -> bool:
        """Whether it is constant between jumps, as steps are."""
        return False

    @property
    def cycle(self) -> float | None:
        """Period after which its values repeat; zero where the amplitude is. [s]"""
        return self.period if self.amplitude else 0.0

    @property
    def bounds(self) -> tuple[float, float]:
        """Lowest and highest value that it takes. [SI]"""
        return self.mean - abs(self.amplitude), self.mean + abs(self.amplitude)

    def at(self, times: Array) -> Array:
        """Return its values (times,) at times [s]. [SI]"""
        return self.mean + self.amplitude * np.sin(math.tau * times / self.period + self.phase)

    def shifted(self, seconds: float) -> Sine:
        """Return the signal on a clock that starts later: its value at t is the old one at t + `seconds`."""
        return replace(self, phase=self.phase + math.tau * math.fmod(seconds / self.period, 1.0))

    @property
    def levels(self) -> Array:
        """Lowest and highest value that it takes. [SI]"""
        return np.array(self.bounds)

    def scaled(self, factor: float) -> Sine:
        """Return `factor` times the signal."""
        return replace(self, mean=factor * self.mean, amplitude=factor * self.amplitude)

    def raised(self, shift: float) -> Sine:
        """Return the signal with `shift` added to every value. [SI]"""
        return replace(self, mean=self.mean + shift)

    def drawn(self, end: float) -> Sine:
        """Return the signal as a run from zero to `end` [s] sees it: itself."""
        return self

    def knots(self, begin: float, end: float) -> Array:
        """Return times (knots,), `SINE_SAMPLES` in a period, between which it is straight to 3e-5 of its amplitude. [s]"""
        return np.unique(np.linspace(begin, end, max(2, _samples((end - begin) / self.period * SINE_SAMPLES, self.period))))

    def mean_over(self, begin: float, end: float) -> float:
        """Return its mean over `begin` .. `end` [s].

        m + A (cos(w begin + phase) - cos(w end + phase)) / (w (end - begin)), w = 2 pi / period; its value at `begin` where the length is
        zero. [SI]
        """
        if end <= begin:
            return float(self.at(np.array([begin]))[0])
        rate = math.tau / self.period
        ups = math.cos(rate * begin + self.phase) - math.cos(rate * end + self.phase)
        return self.mean + self.amplitude * ups / (rate * (end - begin))


@dataclass(frozen=True, eq=False)
class Mixed:
    """What follows at every instant from other signals: a product, a sum, the radiation between two temperatures.

    It keeps its parts as they are, so that a shift loses nothing, until a run draws it as a table.

    Parameters
    ----------
    law : callable      Values (times,) of the parts -> values (times,); a ufunc, or an object whose fields say what it is. [SI]
    parts : tuple       Signals that it is made of.
    bend : float        Share of its range by which straight lines between the rows of a table may miss it; without limit it is straight
                        between the rows of its parts. [-]
    """

    law: Callable[..., Array]
    parts: tuple[Signal, ...]
    bend: float = MAX_LINE_ERROR_SHARE

    @property
    def span(self) -> Span:
        """Time that all parts hold for. [s]"""
        spans = [p.span for p in self.parts]
        return max(s[0] for s in spans), min(s[1] for s in spans)

    @property
    def extent(self) -> float:
        """Time of its last event: the last row of a table, one period of a sine, zero of a constant. [s]"""
        return max(p.extent for p in self.parts)

    @property
    def onset(self) -> float:
        """Time of its first row, zero where it has none. [s]"""
        return max(p.onset for p in self.parts)

    @property
    def held(self) -> bool:
        """Whether it is constant between jumps, as steps are."""
        return all(p.held for p in self.parts)

    @property
    def cycle(self) -> float | None:
        """Time after which all parts repeat, where one is a multiple of every other. [s]"""
        return common_cycle([p.cycle for p in self.parts])

    @property
    def bounds(self) -> tuple[float, float]:
        """Lowest and highest value at the knots of its parts. [SI]"""
        return self.drawn(self.extent).bounds

    def at(self, times: Array) -> Array:
        """Return its values (times,) at times [s]. [SI]"""
        return np.asarray(self.law(*(p.at(times) for p in self.parts)))

    def shifted(self, seconds: float) -> Mixed:
        """Return the signal on a clock that starts later: its value at t is the old one at t + `seconds`."""
        return replace(self, parts=tuple(p.shifted(seconds) for p in self.parts))

    @property
    def levels(self) -> Array:
        """Values that it takes (levels,) as a table. [SI]"""
        return self.drawn(self.extent).levels

    def held_on(self) -> Mixed:
        """Return the same law of parts whose last values hold."""
        return replace(self, parts=tuple(p.held_on() for p in self.parts))

    def cut(self, begin: float, end: float) -> Mixed:
        """Return the signal without its rows outside `begin` .. `end` [s]; what has no rows stays as it is."""
        return replace(self, parts=tuple(p.cut(begin, end) for p in self.parts))

    def scaled(self, factor: float) -> Mixed:
        """Return `factor` times the signal."""
        return Mixed(np.multiply, (Constant(factor), self))

    def raised(self, shift: float) -> Mixed:
        """Return the signal with `shift` added to every value. [SI]"""
        return Mixed(np.add, (Constant(shift), self))

    def drawn(self, end: float) -> Constant | TableSignal:
        """Return it as a table (of constants a constant) for a run 0 .. `end` [s]; rows are added until lines are within `bend`."""
        parts = [p.drawn(end) for p in self.parts]
        if all(isinstance(p, Constant) for p in parts):
            return Constant(float(self.at(np.zeros(1))[0]))
        drawn = replace(self, parts=tuple(parts))
        times, held = together(parts, end)
        if held:
            return TableSignal(times, drawn.at(times), hold=True, after="hold")
        times = np.append(times[times < end], end) if times[0] < end < times[-1] else times
        return TableSignal(*_straightened(drawn.at, times, self.bend), after="hold")

    def knots(self, begin: float, end: float) -> Array:
        """Return the times (knots,), from before `begin` or at it to `end` or beyond, between which it is a straight line. [s]"""
        return self.drawn(end).knots(begin, end)

    def mean_over(self, begin: float, end: float) -> float:
        """Return its mean over `begin` .. `end` [s], the integral over the length; its value at `begin` where the length is zero. [SI]"""
        return self.drawn(end).mean_over(begin, end)


@dataclass(frozen=True, eq=False)
class MeanOf(_Still):
    """The mean of a signal over a run: what no law of the network follows in time.

    Parameters
    ----------
    of : Signal
    length : float  Of the run. [s]
    value : float   The mean. [SI]
    """

    of: Signal
    length: float
    value: float = field(init=False)

    def __post_init__(self) -> None:
        """Set `value` to the mean of `of` over 0 .. `length`."""
        object.__setattr__(self, "value", self.of.mean_over(0.0, self.length))

    def shifted(self, seconds: float) -> MeanOf:
        """Return the mean over a run that begins at another time."""
        return replace(self, of=self.of.shifted(seconds))

    def held_on(self) -> MeanOf:
        """Return the mean of the signal with its last value held."""
        return replace(self, of=self.of.held_on())

    def scaled(self, factor: float) -> MeanOf:
        """Return the mean times a number."""
        return replace(self, of=self.of.scaled(factor))

    def raised(self, shift: float) -> MeanOf:
        """Return the mean with a number added."""
        return replace(self, of=self.of.raised(shift))


Signal = Constant | TableSignal | Sine | Mixed | MeanOf
Drawn = Constant | TableSignal | Sine
"""What a run sees, and what is written for other programs."""


def in_run(signal: Signal, end: float) -> Drawn:
    """Return a signal drawn for a run 0 .. `end` [s], as `drawn` does; a jump at `end` itself is left out, so the value before it stays."""
    drawn = signal.drawn(end)
    if not isinstance(drawn, TableSignal) or end <= 0.0:
        return drawn
    before = np.flatnonzero(drawn.times < end * (1.0 - END_TOLERANCE))
    if not before.size or before.size == drawn.times.size:
        return drawn
    last, following = before[-1], before[-1] + 1
    if drawn.hold:
        return (
            drawn
            if drawn.values[last] == drawn.values[following]
            else replace(drawn, times=drawn.times[before], values=drawn.values[before])
        )
    if drawn.times[following] - drawn.times[last] <= 2.0 * JUMP_TIME:  # a jump that is written as a steep line
        values = drawn.values.copy()
        values[following:] = values[last]
        return replace(drawn, values=values)
    return drawn


def check_span(course: Signal, end: float, where: str) -> None:
    """Refuse a signal that ends before a run, or begins after it: nothing says what holds there.

    Parameters
    ----------
    course : Signal
    end : float     Of the run, which begins at zero. [s]
    where : str     For messages.

    Raises
    ------
    ScenarioError   With what can be said of the time beyond.
    """
    first, last = course.span
    if last < end:
        raise ScenarioError(
            f"it ends at {_hours(course.extent)} and the run lasts {_hours(end)}. State the value beyond its end: after = 'hold' (its "
            "last value) or 'repeat'; or give it up to the end, or shorten the run.",
            where,
            code="run.input-missing",
        )
    if first > 0.0:
        raise ScenarioError(
            f"its first row is at {_hours(course.onset)} and the run begins at zero. Give the value there, or before = 'hold'.",
            where,
            code="run.input-missing",
        )


def _hours(seconds: float) -> str:
    """Return a time as text, in seconds below an hour and in hours from there on."""
    return f"{seconds:g} s" if seconds < HOUR else f"{seconds / 3600.0:.5g} h"


def together(signals: Sequence[Drawn], end: float) -> tuple[Array, bool]:
    """Return the union of the times (times,) at which signals have rows or bend, up to `end` [s], and whether all of them are steps."""
    held = all(s.held for s in signals)
    return np.unique(np.concatenate([s.times if held and isinstance(s, TableSignal) else s.knots(0.0, end) for s in signals])), held


def multiplied(*factors: Signal) -> Signal:
    """Return the product of signals: of constants a constant, of constants and one signal that signal scaled, else a `Mixed`."""
    number = math.prod(s.value for s in factors if isinstance(s, Constant))
    rest = [s for s in factors if not isinstance(s, Constant)]
    if not rest:
        return Constant(number)
    whole: Signal = rest[0] if len(rest) == 1 else Mixed(_product, tuple(rest))
    return whole if number == 1.0 else whole.scaled(number)


def _product(*values: Array) -> Array:
    """Return the product (times,) of values (times,) of several signals."""
    return np.asarray(np.prod(values, axis=0))


def joined(before: Signal, instant: float, then: Signal) -> Signal:
    """Return the signal `before` up to `instant` [s] and `then` from it on, both on the same clock."""
    if instant <= 0.0:
        return then
    whole = before.held_on() if before.span[1] >= instant * (1.0 - 1e-9) else before
    return Mixed(Until(), (whole, then, TableSignal(np.array([0.0, instant]), np.array([0.0, 1.0]), hold=True)))


@dataclass(frozen=True)
class Until:
    """The law of `joined`: the values of one signal while a switch is 0, those of another once it is 1."""

    def __call__(self, before: Array, then: Array, gone: Array) -> Array:
        """Return `before` where `gone` is below one half, `then` elsewhere (times,). [SI]"""
        return np.where(gone > 0.5, then, before)


def common_cycle(cycles: Sequence[float | None]) -> float | None:
    """Return the least common multiple of periods; zero without any above zero. [s]

    None where one is None, they have no common multiple to 1e-9, or it exceeds 1000 times the shortest.
    """
    from fractions import Fraction

    if any(c is None for c in cycles):
        return None
    several = [c for c in cycles if c]
    if not several:
        return 0.0
    shares = [Fraction(c / several[0]).limit_denominator(1000) for c in several]
    if any(abs(float(f) * several[0] - c) > 1e-9 * c for f, c in zip(shares, several, strict=True)):
        return None
    whole = Fraction(math.lcm(*(f.numerator for f in shares)), math.gcd(*(f.denominator for f in shares)))
    length = float(whole) * several[0]
    return length if length <= 1000.0 * min(several) else None


def _straightened(law: Callable[[Array], Array], times: Array, bend: float) -> tuple[Array, Array]:
    """Return times (times,) [s] and law(times), with middles added until straight lines miss the law by at most `bend` [-] of its range.

    Intervals of a jump, two `JUMP_TIME` or less, are not halved, and none more than `MOST_HALVINGS` times.
    """
    values = law(times)
    for _ in range(MOST_HALVINGS if math.isfinite(bend) else 0):
        middles = 0.5 * (times[1:] + times[:-1])
        mine = law(middles)
        size = max(float(np.ptp(values)), 1e-300)
        bent = (np.abs(mine - 0.5 * (values[1:] + values[:-1])) > bend * size) & (np.diff(times) > 2.0 * JUMP_TIME)
        if not bent.any():
            break
        order = np.argsort(np.concatenate((times, middles[bent])), kind="stable")
        times, values = np.concatenate((times, middles[bent]))[order], np.concatenate((values, mine[bent]))[order]
    return times, values


def _samples(count: float, period: float) -> int:
    """Return `count` rounded up, plus one: the samples that a signal of this period [s] needs.

    Raises
    ------
    ScenarioError   When they would fill the memory.
    """
    if count > cap("samples"):
        raise ScenarioError(
            f"a period of {period:g} s would take {count:.3g} samples for this run, more than the limit of {cap('samples'):.0e}. "
            f"Give a longer period, its mean instead, or a shorter run.{raising('samples')}",
            "a periodic signal",
            code="cap.exceeded",
        )
    return int(np.ceil(count)) + 1


def averages(times: Array, values: Array, **more: Any) -> TableSignal:
    """Return steps from samples that are means over the intervals which end at their times (samples,); the first is as long as the second.

    Steps keep the integral of every interval, which straight lines between means would not.
    """
    if times.size < 2:
        return TableSignal(times, values, **more)
    edges = np.concatenate(([2.0 * times[0] - times[1]], times))
    # a row at the last stamp says how far the last mean reaches
    return TableSignal(edges, np.append(values, values[-1]), **{**more, "hold": True, "samples": "average"})


def literal(text: Any, slot: str, where: str = "") -> float:
    """Return the SI value of a number with a unit, in one of the ways of `thermid.base.units`, checked against a slot.

    Raises
    ------
    ThermidError   When it is not a number, or of another dimension.
    """
    with errors_at(where):
        if isinstance(text, str):
            return text_value(text, slot)
        value = si_value(text, slot)
        if value is not None:
            return value
        if isinstance(text, bool) or not isinstance(text, Real):
            raise ScenarioError(f"a number with a unit is needed, such as '5 [{slot or 'K'}]', not {text!r}.", code="value.incomplete")
        return text_value(repr(text if isinstance(text, int) else float(text)), slot)


def signal(value: Any, slot: str, where: str = "", held: bool = False) -> Signal:
    """Return a signal from what a scenario writes.

    Parameters
    ----------
    value : str, number, Quantity, pair, table or Signal
        ``"24 [degC]"``; ``td.celsius(24)``; a pair of times and values, ``([0, 18000], td.celsius([24, 25]))``, whose times are seconds,
        texts, durations or stamps, and whose values are SI where they have no unit and are no temperatures; a pandas Series or an xarray
        DataArray with a unit, whose index or coordinate gives the times, alone or as the values of a table without times;
        ``{times = ["0 [s]", "1 [h]"], values = ["24 [degC]", "25 [degC]"]}`` with ``hold = true`` for steps, ``after`` (hold or repeat;
        ``period`` where the last row does not end it) for the time beyond the last row, ``before`` (hold), and ``samples = "average"``
        where each value is the mean over the interval that ends at its time; an array as its times is as in a pair;
        ``{mean = "24 [degC]", amplitude = "3 [K]", period = "24 [h]", phase = 0.0}``.
    slot : str      What it must be: a unit text or `temperature`.
    held : bool     Whether each sample of a Series or a DataArray holds until the next where its table does not say.

    Raises
    ------
    ThermidError    When it is none of these.
    """
    if isinstance(value, TableSignal | Sine) and value.unit:
        of = read_unit(value.unit)
        with errors_at(where):
            require(of.dimension, slot, value.unit, of.absolute)
    if isinstance(value, Signal):
        return value
    if isinstance(value, Mapping):
        return _from_table(value, slot, where, held)
    with errors_at(where):
        if isinstance(value, tuple) and len(value) == 2 and not isinstance(value[0], str):
            return _paired(*value, slot)
        with_unit = _array(value, slot)
        if with_unit is not None and np.ndim(with_unit.si):
            return _sampled(with_unit, slot, held)
        if with_unit is not None or isinstance(value, str | Real):
            return Constant(literal(value, slot))
    hint = f" {THREE_WAYS}; with times in seconds ([0, 18000], td.celsius([24, 25]))." if slot == TEMPERATURE else ""
    raise ScenarioError(
        f"give a signal as a value with a unit, a table of times and values, or a sine.{hint}", where, code="value.incomplete"
    )


def _paired(times: Any, values: Any, slot: str) -> TableSignal:
    """Return a table of an array of times, in seconds where they have no unit, and of values, in SI where they have none."""
    in_si, (seconds, stamp) = si_values(values, slot), clocked(times)
    return TableSignal(seconds, np.atleast_1d(plain_numbers(values if in_si is None else in_si)), stamp=stamp)


def _array(value: Any, slot: str) -> Quantity | None:
    """Return an array with a unit as a Quantity, a Series or DataArray of plain numbers as one in the unit `slot`; None of all else."""
    with_unit = stated(value)
    if with_unit is None and (hasattr(value, "iloc") or hasattr(value, "coords")) and slot != TEMPERATURE:
        return quantity(value, unit=slot)
    return with_unit


def _sampled(values: Quantity, slot: str, held: bool) -> TableSignal:
    """Return a table of values that carry their own times, such as a pandas Series, on their own clock.

    Raises
    ------
    ScenarioError   When it does not.
    """
    if values.times is None:
        text = "its values have no times: an array, or a Series whose index counts rows. Give a pair: (times, values)."
        raise ScenarioError(text, code="value.wrong-kind")
    return TableSignal(values.times, np.asarray(si_values(values, slot), dtype=float), held, log=("", 0.0), stamp=values.stamp)


def own_signal(value: Any, where: str = "") -> Any:
    """Return what is written of a parameter that only the model knows, as a signal in its own unit; a constant stays as it is written.

    Raises
    ------
    ThermidError    When it is no table and no sine.
    """
    if not isinstance(value, Mapping):
        with errors_at(where):
            with_unit = None if isinstance(value, str | Signal) else stated(value)
        return value if with_unit is None or with_unit.times is None else own_signal({"values": with_unit}, where)
    rows = value.get("values", ())
    with errors_at(where):
        rows = rows if isinstance(rows, str | list | tuple) else stated(rows) or rows
    first = next(iter(rows if isinstance(rows, Sequence | np.ndarray | Quantity) else ()), None) if "values" in value else value.get("mean")
    if first is None:
        return signal(value, "1", where)
    with errors_at(where):
        of = Expression.parse(first).literal if isinstance(first, str) else stated(first)
    if of is None:
        return signal(value, "1", where)
    parsed = signal(value, TEMPERATURE if of.unit.absolute else of.unit.text, where)
    return replace(parsed, unit=of.unit.text) if isinstance(parsed, TableSignal | Sine) else parsed


def _column(values: Any, slot: str, where: str) -> Array:
    """Return the SI values of a list of texts or numbers, each read by `literal`."""
    return np.array([literal(v, slot, where) for v in values])


def _from_table(value: Mapping[str, Any], slot: str, where: str, held: bool = False) -> Signal:
    """Read the table form of a signal."""
    keys = {str(key) for key in value}
    if "values" in keys and not isinstance(value["values"], str):
        with errors_at(where):
            timed = _array(value["values"], slot)
            if timed is not None and timed.times is not None and "times" not in keys and keys <= {"values", "hold", *CONDUCT}:
                held = bool(value.get("hold", held)) and value.get("samples") != "average"
                return _sampled(timed, slot, held).with_details(value, where)
    for key in ("times", "values"):
        if key in value and (isinstance(value[key], str) or not isinstance(value[key], Sequence | np.ndarray | Quantity)):
            raise ScenarioError(f"the {key} of a table are a list, not {value[key]!r}.", where, code="value.wrong-kind")
    if {"times", "values"} <= keys <= {"times", "values", "hold", *CONDUCT}:
        with errors_at(where):
            rows = (
                _paired(value["times"], value["values"], slot)
                if isinstance(value["times"], np.ndarray)
                else TableSignal(_column(value["times"], "s", where), _column(value["values"], slot, where))
            )
            return replace(rows, hold=bool(value.get("hold", False))).with_details(value, where)
    if {"mean", "amplitude", "period"} <= keys <= {"mean", "amplitude", "period", "phase"}:
        difference = "K" if slot == TEMPERATURE else slot
        period = literal(value["period"], "s", where)
        if period <= 0:
            raise ScenarioError("a sine needs a period above zero.", where, code="value.outside-range")
        amplitude = literal(value["amplitude"], difference, where)
        return Sine(literal(value["mean"], slot, where), amplitude, period, literal(value.get("phase", 0.0), "1", where))
    raise ScenarioError(
        f"a signal is a table of times and values (hold, before, after, period, samples), or of mean, amplitude and period (phase), not of "
        f"{', '.join(sorted(keys))}.",
        where,
        code="value.wrong-kind",
    )
