"""A record: the channels of one log on one axis of times. Every method returns a new record; the samples read are never changed.

Filters act on temperatures. A command holds between its samples, so no filter touches it; a power is filtered only when asked. A masked
sample keeps its number.
"""

from __future__ import annotations

import csv
import hashlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from thermid.base.errors import RecordError, ThermidError, errors_at, optional, quoted, refuse_first, refuse_unknown
from thermid.base.files import FileKinds
from thermid.base.results import PlottedTrace, Result, Row
from thermid.base.units import (
    DEVIATION_OF_MEDIAN,
    TEMPERATURE,
    amount,
    clocked,
    counted,
    counts_rows,
    duration_text,
    format_value,
    from_si,
    in_si,
    positive_seconds,
    seconds,
    unit,
)
from thermid.measure._record import windows
from thermid.measure._record.channel import (
    ROLES,
    Channel,
    FloatArray,
    Origin,
    Samples,
    SecondClock,
    codes_to_mask,
    digest,
    even_step,
    gap_limit,
    quantity_of,
    strays,
    unseen_pulses,
    with_sensor,
)
from thermid.measure._record.sensor import ICE, KEYS, SensorCertificate, SensorPart
from thermid.measure._record.steadiness import SETTLED, SteadyPoint, steady_point

if TYPE_CHECKING:
    from pandas import DataFrame
    from xarray import Dataset

FAULT_CODES: Final = ("85 [degC]", "-127 [degC]")
"""What a DS18B20 gives after power-on (note to table 1 of its data sheet), and what its usual driver gives when the sensor is gone."""


MAX_SEARCHED_READINGS = 600
"""Readings that a structure is searched with; longer logs are resampled. [-]"""


class Record(Samples, Result):
    """Measured channels on one time axis.

    Parameters
    ----------
    name : str                       Its name.
    times : array (samples,)         Strictly increasing times. [s]
    channels : mapping to Channel    Channels by name.
    origin : Origin                  Where the samples came from; kept by every copy.
    steps : tuple of str             What was done to the samples, in words and numbers.
    clocks : tuple of SecondClock    Clocks beside its own that a fit has yet to find.
    stated_clocks : tuple of SecondClock   Those of joined logs whose offset and rate somebody, or their stamps, stated.
    environment : mapping            Gas node -> the state of its gas in this test, as of a scenario; see `with_environment`.

    Raises
    ------
    RecordError   When times do not increase, lengths differ, or two channels have one target.
    """

    @classmethod
    def from_arrays(cls, name: str, times: Any, channels: Mapping[str, Any], *, unit: str = "", synthetic: bool = True) -> Record:
        """Return a record of samples made in Python, marked as synthetic.

        Parameters
        ----------
        name : str               Its name.
        times : array (samples,) Times: numbers in seconds, texts such as "2 [h]", durations or stamps.
        channels : mapping       Arrays of temperatures, or whole `Channel` values, by name.
        unit : str               Of the arrays that do not state their own: ``"degC"``, ``"K"``.
        synthetic : bool         Set it False for samples that were measured and read by other means.

        Raises
        ------
        UnitError     When an array has no unit.
        RecordError   As of the class.
        """
        of = {
            key: samples if isinstance(samples, Channel) else Channel.from_array(key, samples, unit=unit, column=key)
            for key, samples in channels.items()
        }
        axis, begun = clocked(times)
        sha = digest([("time", axis), *((key, samples.values) for key, samples in of.items())])
        start = begun.text if begun is not None and np.isfinite(begun.seconds) else None
        held = {n: np.where(c.valid, c.values, np.nan) for n, c in of.items() if c.held and c.prompt is None and c.samples != "average"}
        origin = Origin(name, sha, start, ("time", *of), axis.size, "time", synthetic, tuple(unseen_pulses(axis, held)))
        return cls(name, axis, of, origin)

    @classmethod
    def from_dataframe(
        cls, name: str, frame: DataFrame, channels: Mapping[str, Mapping[str, Any]], *, time: str | None = None, synthetic: bool = False
    ) -> Record:
        """Return a record of a pandas frame; its samples are taken as measured unless said otherwise.

        Parameters
        ----------
        name : str          Its name.
        frame : DataFrame   A row a time, a column a channel. NaN is a missing sample.
        channels : mapping  Column -> table: ``unit`` ("degC", "W"), what it is of (``node``, ``boundary``, ``load``, ``prescribed``,
                            ``command`` or ``schedule``, a value that the log gives: a path in the model), and where known ``noise``,
                            ``accuracy`` and ``resolution`` ("0.1 [K]"), and the keys of `with_sensor`, such as ``lag``.
        time : str          Column of the times, numbers in seconds or stamps; the index without it, unless that counts rows.
        synthetic : bool    Whether a simulation made the samples.

        Raises
        ------
        RecordError   When a column or key is unknown, a unit is missing, or times do not increase.
        """
        if not hasattr(frame, "columns"):
            raise RecordError(f"a pandas DataFrame is needed, not {frame!r:.60}.", name, code="value.wrong-kind")
        refuse_unknown([*channels, *([time] if time is not None else [])], list(frame.columns), name, "the frame has no column '{}'.")
        if time is None and counts_rows(frame.index):
            raise RecordError(
                "its index counts rows and says no times. Name the column of the times, time='t [s]', or make the index the times: "
                "frame.index = 60.0 * frame.index for rows one minute apart.",
                name,
                code="record.time-not-read",
            )
        axis = frame.index if time is None else frame[time]
        _check_order(axis, name)
        channels_of_frame = {
            column: _channel_of(column, frame[column].to_numpy(dtype=np.float64), table, name) for column, table in channels.items()
        }
        record = cls.from_arrays(name, axis, channels_of_frame, synthetic=synthetic)
        for column, table in channels.items():
            if keys := {key: table[key] for key in KEYS if key in table}:
                record = record.with_sensor(column, **keys)
        return record

    def select(self, *names: str) -> Record:
        """Return the record with these channels only.

        Raises
        ------
        NameNotFoundError   When there is none of a name.
        """
        clocks, stated = (
            tuple(replace(c, channels=tuple(n for n in c.channels if n in names)) for c in several if {*c.channels} & {*names})
            for several in (self.clocks, self.stated_clocks)
        )
        return replace(self, channels={name: self.channel(name) for name in names}, clocks=clocks, stated_clocks=stated)

    def with_channels(self, *channels: Channel) -> Record:
        """Return the record with these channels added, or in place of those of the same name."""
        for channel in channels:
            if not isinstance(channel, Channel):
                raise RecordError(f"it takes channels, not {channel!r:.60}.", f"record '{self.name}'", code="value.wrong-kind")
        return replace(self, channels={**self.channels, **{channel.name: channel for channel in channels}})

    def with_sensor(self, name: str, **keys: object) -> Record:
        """Return the record with more known of a channel's sensor, by the keys of a campaign: ``lag="20 [s]"``, ``certificate={...}``.

        Raises
        ------
        RecordError   When a key is unknown or lacks another one that it needs.
        """
        where = f"record '{self.name}', {name}"
        refuse_unknown(keys, KEYS, where)
        certificate = SensorCertificate.read(keys["certificate"], f"{where}, certificate") if "certificate" in keys else None
        channel, notes = with_sensor(self.channel(name), SensorPart.read(keys, where), certificate, where)
        return replace(self, channels={**self.channels, name: channel}, steps=(*self.steps, *notes))

    def with_environment(self, environment: Mapping[str, Any]) -> Record:
        """Return the record of a test whose gases are stated: every run of it has them, as if its scenario stated them.

        Parameters
        ----------
        environment : mapping   Gas node -> `thermid.simulation.Environment`; ``*`` for every gas not named. Courses over time count from
                                the record's first sample.

        Raises
        ------
        RecordError   When something else is given.
        """
        where = f"record '{self.name}', environment"
        if not isinstance(environment, Mapping):
            raise RecordError(
                f"it takes a dictionary from gas nodes to environments, not {environment!r:.60}.", where, code="value.wrong-kind"
            )
        for gas, state in environment.items():
            if not hasattr(state, "pressure"):
                words = f"it takes an environment, not {state!r:.60}. Make one: td.simulation.Environment('0.1 [Pa]')."
                raise RecordError(words, f"{where}.{gas}", code="value.wrong-kind")
        steps = (f"environment of {gas}: {state}" for gas, state in environment.items())
        return replace(self, environment={**self.environment, **environment}, steps=(*self.steps, *steps))

    def trim(self, start: str | float = "start", end: str | float = "end") -> Record:
        """Return the samples from `start` to `end`, both included; times stay as they are.

        Parameters
        ----------
        start, end : str or float   Texts such as ``"2 [s]"``, "start", "end", or seconds.

        Raises
        ------
        RecordError   When fewer than two samples remain, or a channel keeps no valid one.
        """
        inside, text = self.stretch(start, end, "trim")
        count = int(inside.sum())
        if count < 2:
            raise RecordError(f"only {count} sample lies from {text}; at least two are needed.", "trim", code="record.too-short")
        channels = {name: channel.taken(inside) for name, channel in self.channels.items()}
        steps = (*self.steps, f"trim: {text}, {count} of {inside.size} samples kept")
        return replace(self._with_clocks(*self.times[inside][[0, -1]].tolist()), times=self.times[inside], channels=channels, steps=steps)

    def _with_clocks(self, first: float, last: float, zero: float = 0.0) -> Record:
        """Return the record with its further clocks from `first` to `last` of its own one, whose zero moves to `zero`. [s]"""

        def moved(clock: SecondClock) -> SecondClock:
            later = zero if clock.offset_is == SecondClock.offset_is else 0.0  # a delay is on the record's own clock
            times = max(clock.times[0], first) - zero, min(clock.times[1], last) - zero
            at, offset = (clock.at[0] - later, clock.at[1]), (clock.offset[0] - later, clock.offset[1] - later)
            return replace(clock, offset=offset, at=at, times=times)

        return replace(self, clocks=tuple(map(moved, self.clocks)), stated_clocks=tuple(map(moved, self.stated_clocks)))

    def shift_start(self) -> Record:
        """Return the record with its first time subtracted from all times."""
        first = float(self.times[0])
        moved = self._with_clocks(first, float(self.times[-1]), first)
        return replace(moved, times=self.times - first, steps=(*self.steps, f"shift_start: {first:.6g} s taken from all times"))

    def median(self, window: str | float, *, powers: bool = False) -> Record:
        """Return temperatures (and powers, if asked) through a moving median, centred in time, of valid samples within half a window.

        At the ends the window is cut; there a slope leaves an error of at most a quarter of the window times the slope. Masked samples
        stay masked.

        Raises
        ------
        RecordError   When the window is not above zero or longer than the record.
        """
        width = self._window(window, "median")
        chosen = self._filtered(powers, "median")
        channels = [
            replace(
                channel,
                values=np.where(channel.valid, windows.moving_median(self.times, channel.values, channel.valid, width), channel.values),
            )
            for channel in chosen
        ]
        return self._noted(f"median: centred window of {width:g} s on {', '.join(channel.name for channel in chosen)}", *channels)

    def filter(self, window: str | float, *, powers: bool = False) -> Record:
        """Return temperatures (and powers, if asked) through a second-order Butterworth low-pass, forward and backward: no shift in time.

        `window` is the period at which half the amplitude remains. Masked stretches of up to a window are bridged for the filter and stay
        masked; longer ones split the signal.

        Raises
        ------
        RecordError   When times are uneven, or the window is not above two steps or longer than the record.
        """
        width = self._window(window, "filter")
        chosen = self._filtered(powers, "filter")
        step = even_step(self.times)
        if step is None:
            intervals = np.diff(self.times)
            raise RecordError(
                f"the times of record '{self.name}' are uneven (intervals from {intervals.min():g} to {intervals.max():g} s), but "
                f"this filter needs equal intervals. Resample first, for example {{ step = '{self.step:.3g} [s]', switches = false }}, "
                "or use median.",
                "filter",
                code="record.uneven-times",
            )
        if width <= 2 * step:
            raise RecordError(
                f"{width:g} s is not above two steps of {step:g} s, so the filter would have no effect. Give a larger width.",
                "filter, window",
                code="value.outside-range",
            )
        channels = [replace(channel, values=windows.low_pass(channel.values, channel.valid, step, width)) for channel in chosen]
        names = ", ".join(channel.name for channel in chosen)
        return self._noted(f"filter: zero-phase Butterworth low-pass of second order, half amplitude at {width:g} s, on {names}", *channels)

    def resample(self, step: str | float, max_gap: str | float | None = None, *, switches: bool = True) -> Record:
        """Return the record on an even grid from its first time, with the instants at which a power or command was switched.

        Powers and commands are as below; all else runs straight between valid samples. Nothing is filled in across more than
        `max_gap` (by default five times what nine of ten intervals between valid samples reach, and never less than two steps): such
        samples are masked as 'gap'. A coarser grid keeps the noise of single samples, so filter first.

        A power or command that changes between two grid times would seem to change at the later one. So the instants at which one is
        switched (`Channel.switched`) are kept as times of their own, at which all else is masked as 'switch'; the grid is then no longer
        even. What changes of a power between two times of it, such as the noise of a power meter, is its mean until the later one, so that
        no heat is lost. Switches that outnumber the grid are averaged likewise. Without `switches` the grid is even, as a filter needs
        it, and powers and commands hold their last sample.

        Raises
        ------
        RecordError   When the step is not above zero or longer than the record, or a channel keeps no valid sample.
        """
        width = self._window(step, "resample")
        count = int(np.floor(self.duration / width + 1e-9)) + 1
        even = self.times[0] + width * np.arange(count)
        instants = self._switches(even[-1]) if switches else even[:0]
        grid = np.union1d(even, instants) if instants.size <= even.size else even
        regular = np.isin(grid, even)
        channels: dict[str, Channel] = {}
        for channel in self.channels.values():
            law = windows.hold if channel.held else windows.interpolate
            channel.checked()
            values, valid = law(self.times, channel.values, channel.valid, grid, gap_limit(self.times, channel.valid, width, max_gap))
            if channel.held and switches and channel.quantity != "temperature":
                values = np.where(valid, windows.mean_until_next(self.times[channel.valid], channel.values[channel.valid], grid), np.nan)
            masks = {"gap": ~valid} if channel.held else {"gap": ~valid & regular, "switch": ~regular}
            channels[channel.name] = replace(channel, values=values, valid=valid & (regular | channel.held), masks=masks).checked()
        text = f"resample: {self.times.size} samples to {count} at {width:g} s; powers and commands held, others linear"
        if switches:
            ends = (
                f"{grid.size - count} instants of their changes kept"
                if instants.size <= count
                else "changes that outnumber the grid are averaged"
            )
            text = f"{text.replace('held', 'as means until the next')}; {ends}"
        gaps = ", ".join(f"{channel.name} {channel.flags['gap']}" for channel in channels.values() if "gap" in channel.flags)
        raw = not any(done.startswith(("filter", "median")) for done in self.steps) and width > 2 * self.step
        text += (f"; masked as gaps: {gaps}" if gaps else "") + (
            "; no filter was applied before, so single samples were taken" if raw else ""
        )
        return replace(self, times=grid, channels=channels, steps=(*self.steps, text))

    def _switches(self, last: float) -> FloatArray:
        """Return the times up to `last` at which a held channel was switched. [s]"""
        switched = np.any([c.switched for c in self.channels.values() if c.held] or [np.zeros(self.times.size, dtype=bool)], axis=0)
        return np.asarray(self.times[switched & (self.times <= last)])

    def flag_spikes(self, threshold: str | float, window: str | float, channels: Sequence[str] | None = None) -> Record:
        """Return the record with temperatures masked that stand out from the moving median (Hampel's identifier).

        A sample is a spike when it is further from the median of its window than `threshold`: a temperature difference such as
        ``"3 [K]"``, or a number of robust standard deviations of the window. A quantised sensor shows no deviation smaller than half a
        step, so it is never taken below that.

        Raises
        ------
        RecordError   When window or threshold are not above zero, the window is longer than the record, or nothing valid remains.
        """
        width = self._window(window, "spikes")
        absolute = isinstance(threshold, str)
        limit = amount(threshold, "K" if absolute else "1", "spikes, threshold")
        if limit <= 0:
            raise RecordError(f"{threshold!r} is not above zero.", "spikes, threshold", code="value.outside-range")
        masked = []
        for channel in self._temperatures(channels, "spikes"):
            centre, spread = windows.hampel(self.times, channel.values, channel.valid, width)
            # a median deviation of zero only says that half the window lies in one level of the sensor, half a step either side
            allowed = limit if absolute else limit * np.maximum(spread, DEVIATION_OF_MEDIAN * channel.step / 2.0)
            masked.append(channel.masked(np.abs(channel.values - centre) > allowed, "spike"))
        unit = "K" if absolute else "robust standard deviations"
        return self._noted(
            f"spikes: masked {self._lost(masked)}; further than {limit:g} {unit} from the median of {width:g} s",
            *masked,
        )

    def flag_faults(
        self,
        codes: Iterable[str | float] = FAULT_CODES,
        low: str | float | None = None,
        high: str | float | None = None,
        jump: str | float = "2 [K]",
        channels: Sequence[str] | None = None,
    ) -> Record:
        """Return the record with fault codes, and temperatures outside a range, masked as 'fault'.

        85 degC is also a temperature that a sensor can pass. A code is therefore a fault only where it differs by more than `jump` from
        the line between the nearest samples that are no codes.

        Parameters
        ----------
        codes : texts or floats       Temperatures that stand for faults, ``"85 [degC]"``, or [K].
        low, high : text or float     Lowest and highest temperature that can be, or None. [K]
        jump : text or float          Difference to the neighbours from which a code is a fault. [K]
        channels : sequence of str    Channels to look at; all temperatures by default.
        """
        levels = [amount(code, TEMPERATURE, "faults, codes") for code in (codes if isinstance(codes, Iterable) else [codes])]
        bottom = -np.inf if low is None else amount(low, TEMPERATURE, "faults, low")
        top = np.inf if high is None else amount(high, TEMPERATURE, "faults, high")
        if bottom >= top:
            raise RecordError(f"low ({low}) is not below high ({high}).", "faults", code="value.outside-range")
        least = amount(jump, "K", "faults, jump")
        masked = []
        for channel in self._temperatures(channels, "faults"):
            outside = channel.valid & ((channel.values < bottom) | (channel.values > top))
            read = channel.values + channel.correction  # a code is what the sensor said, not what a certificate makes of it
            code = channel.valid & np.any([np.abs(read - level) < 1e-6 for level in levels] or [np.zeros_like(channel.valid)], axis=0)
            good = channel.valid & ~outside & ~code
            if good.any():
                code &= np.abs(channel.values - np.interp(self.times, self.times[good], channel.values[good])) > least
            masked.append(channel.masked(outside | code, "fault"))
        listed = ", ".join(format_value(level, "degC") for level in levels) or "none"
        limits = "".join(f", {word} {format_value(end, 'degC')}" for word, end in (("low", bottom), ("high", top)) if np.isfinite(end))
        return self._noted(f"faults: masked {self._lost(masked)}; codes {listed}{limits}", *masked)

    def mask(self, channel: str, start: str | float = "start", end: str | float = "end", reason: str = "masked by hand") -> Record:
        """Return the record with a stretch of a channel masked, both ends included.

        Parameters
        ----------
        channel : str               The channel.
        start, end : str or float   As in `trim`.
        reason : str                Reason under which the samples are counted.

        Raises
        ------
        RecordError   When no valid sample would remain.
        """
        measured = self.channel(channel)
        inside, text = self.stretch(start, end, f"mask of '{channel}'")
        masked = measured.masked(inside, reason)
        return self._noted(f"mask: {channel} from {text} ({self._masked_since(masked)} samples), {reason}", masked)

    def joined(self, other: Record, offset: Any = None, rate: float | tuple[float, float] = 1.0) -> Record:
        """Return the channels of both records, on the times of both; where one has no reading, it is missing.

        In a run an input keeps its first and last reading before and after its log; `trim` cuts a record to the time of both.

        A time t on the other's clock is ``offset + rate t`` on this one's [s]; without an offset they are laid by their stamps, or, where
        one has none, zero on zero. Pairs are ranges, within which `calibrate` finds them; until then the record stands in their middle.

        Raises
        ------
        RecordError   When the rate is not above zero, a channel is in both, the logs do not overlap, a range is none, or a clock of the
                      other log is left to the fit itself.
        """
        if other.clocks:
            raise RecordError(
                f"a clock or a delay of '{other.name}' is left to the fit, so that its channels would follow two. State that delay as "
                f"one time, or join each log with '{self.name}'.",
                self.name,
                code="record.second-clock",
            )
        if offset is None:
            offset = self._later(other)
        offsets, rates = (
            clock_range(written, slot, name, other.name)
            for written, slot, name in ((offset, "s", "offset of its clock"), (rate, "1", "rate of its clock"))
        )
        middle = 0.5 * sum(offsets), 0.5 * sum(rates)
        joint = self._joined(other, *middle, rates[0])
        clock = SecondClock(tuple(other.channels), offsets, rates, middle, self.ends, other.step, other.name)
        if offsets[0] == offsets[1] and rates[0] == rates[1]:
            return replace(joint, stated_clocks=(*self.stated_clocks, clock))
        between = f"between {offsets[0]:.6g} and {offsets[1]:.6g} s late and {rates[0]:.6g} to {rates[1]:.6g} times as slow, by the fit"
        steps = (*joint.steps[:-1], f"joined with {other.origin.file}, whose clock is {between}")
        return replace(joint, clocks=(*self.clocks, clock), steps=steps)

    def with_open_clock(self, channels: Sequence[str], offset: tuple[float, float]) -> Record:
        """Return the record with the clock of the joined log of some channels left to the fit, in a range about its stated offset. [s]

        Raises
        ------
        RecordError   When no joined log with a stated offset has just these channels.
        """
        clock = next((c for c in self.stated_clocks if c.channels == tuple(channels)), None)
        if clock is None:
            raise RecordError(
                f"{quoted(channels)} are not the channels of a joined log with a stated offset.", self.name, code="record.does-not-apply"
            )
        stated = tuple(c for c in self.stated_clocks if c is not clock)
        opened = replace(clock, offset=(clock.at[0] + offset[0], clock.at[0] + offset[1]))
        return replace(self, clocks=(*self.clocks, opened), stated_clocks=stated)

    @property
    def ends(self) -> tuple[float, float]:
        """First and last time on its own clock, without logs whose clocks are unknown. [s]"""
        return self.clocks[0].times if self.clocks else (float(self.times[0]), float(self.times[-1]))

    def _later(self, other: Record) -> float:
        """Return by how much another log begins later by the stamps of both; 0 where one has none. [s]

        Raises
        ------
        RecordError   When both have stamps that differ and cannot be compared.
        """
        here, there = self.zero, other.zero
        if here is not None and there is not None and here.zoned == there.zoned:
            return there.seconds - here.seconds
        starts = {(one.origin.start, one.moved) for one in (self, other)}
        if None in (self.origin.start, other.origin.start) or len(starts) == 1:
            return 0.0
        raise RecordError(
            f"one log begins at {self.origin.start}, the other at {other.origin.start}, which cannot be compared. Give the offset of the "
            "second log's clock.",
            f"{self.name}, {other.name}",
            code="record.time-unclear",
        )

    def _joined(self, other: Record, offset: float, rate: float, slowest: float) -> Record:
        """Return the channels of both on one axis of all their times, a time t of the other at ``offset + rate t`` [s]. [rate: s/s]

        Origins are joined, and what was done is noted. `slowest`, the lowest rate of its range, is only looked at.

        Raises
        ------
        RecordError   When `slowest` is not above zero, a channel is in both, the logs do not overlap, or they state a gas differently.
        """
        if not slowest > 0:
            raise RecordError(
                f"the rate of a clock must be above zero; its lowest value is {slowest:g}.", other.name, code="value.outside-range"
            )
        both = sorted(set(self.channels) & set(other.channels))
        if both:
            raise RecordError(
                f"'{both[0]}' is a channel in both logs. Give it another name in one of them: "
                f'"{both[0]} again" = {{ column = "{both[0]}", ... }}.',
                f"{self.name}, {other.name}",
                code="record.name-twice",
            )
        there = offset + rate * other.times
        if there[-1] <= self.times[0] or there[0] >= self.times[-1]:
            raise RecordError(
                f"the logs do not overlap: {there[0]:.6g} .. {there[-1]:.6g} s and {self.times[0]:.6g} .. {self.times[-1]:.6g} s. "
                "Give another offset.",
                f"{self.name}, {other.name}",
                code="record.not-overlapping",
            )
        times, channels = _interleaved(self, other, there)
        origin = replace(
            self.origin,
            file=f"{self.origin.file} + {other.origin.file}",
            sha256=hashlib.sha256(f"{self.origin.sha256} {other.origin.sha256}".encode()).hexdigest(),
            columns=(*self.origin.columns, *other.origin.columns),
            rows=self.origin.rows + other.origin.rows,
            synthetic=self.origin.synthetic or other.origin.synthetic,
        )
        step = f"joined with {other.origin.file}, whose clock is {offset:.6g} s late and {rate:.8g} times as slow"
        clash = next((gas for gas, state in other.environment.items() if self.environment.get(gas, state) != state), None)
        if clash is not None:
            raise RecordError(
                f"both logs state the gas '{clash}', and not alike: {self.environment[clash]}; {other.environment[clash]}. Leave one out.",
                f"{self.name}, {other.name}",
                code="value.excludes-another",
            )
        return replace(
            self,
            environment={**self.environment, **other.environment},
            times=times,
            channels=channels,
            origin=origin,
            steps=(*self.steps, *(f"{other.name}: {s}" for s in other.steps), step),
        )

    def delayed(self, by: str | float | Sequence[str | float], channels: Sequence[str] | None = None) -> Record:
        """Return the record with powers and commands that act later than they were logged.

        Parameters
        ----------
        by : str, float or pair       Delay, such as ``"12 [s]"``, or seconds; negative for earlier. A pair is a range, within which
                                      `calibrate` finds the delay; until then the record stands in its middle.
        channels : sequence of str    Loads, commands and boundaries; every load and command by default.

        Raises
        ------
        RecordError   When there is no such channel, one is compared with the model, the delay is as long as the record, a range is none
                      or the clock of these channels is unknown already.
        """
        chosen = [n for n, c in self.channels.items() if c.role in ("load", "command")] if channels is None else list(channels)
        compared = [n for n in chosen if not self.channel(n).drives]
        if compared or not chosen:
            what = f"'{compared[0]}' is no load, command or boundary" if compared else "the record has no load or command"
            raise RecordError(
                f"{what}, so it cannot be delayed. Name the channels that drive the model.",
                f"{self.name}, delay",
                code="record.does-not-apply",
            )
        low, high = clock_range(by, "s", "delay", self.name)
        refuse_first(
            f"{self.name}, delay",
            (
                max(abs(low), abs(high)) >= self.duration,
                f"a delay of up to {max(abs(low), abs(high)):g} s is as long as the record. Give a shorter delay.",
                "record.too-short",
            ),
            (
                low < high and any(set(chosen) & set(c.channels) for c in self.clocks),
                "the clock of these channels is left to the fit already, and the log does not determine a delay beside it. "
                "State this delay as one time.",
                "record.second-clock",
            ),
            error=RecordError,
        )
        late = replace(self, channels={n: self.channels[n] for n in chosen})
        rest = replace(self, channels={n: c for n, c in self.channels.items() if n not in chosen})
        middle = 0.5 * (low + high)
        times, mixed = _interleaved(rest, late, self.times + middle)
        inside = times >= self.times[0]  # what was logged last acts after the last reading; a fit may move it back
        delay_text = f"{low:g} s" if low == high else f"{low:g} to {high:g} s, by the fit"
        clock = SecondClock(tuple(chosen), (low, high), (1.0, 1.0), (middle, 1.0), self.ends, self.step, self.name, "delay")
        return replace(
            self,
            times=times[inside],
            channels={n: mixed[n].taken(inside) for n in self.channels},
            steps=(*self.steps, f"delay: {', '.join(chosen)}, {delay_text}"),
            clocks=self.clocks if low == high else (*self.clocks, clock),
        )

    def steady(
        self,
        start: str | float = "start",
        end: str | float = "end",
        *,
        tau: object | None = None,
        limit: str | float = SETTLED,
        name: str = "",
    ) -> SteadyPoint[Record]:
        """Return the mean of a settled stretch with its uncertainty, corrected for stored heat and drift.

        Parameters
        ----------
        start, end : str or float   The stretch, as in `trim`.
        tau : str, float or dict    Slowest time constant, or channel -> its own, for the correction rate tau. [s]
        limit : str or float        Drift above which a temperature is not settled. [K/s]
        name : str                  Name of the point; the record's with the stretch when empty.

        Raises
        ------
        RecordError   When a channel drifts faster than the limit beyond doubt, or has fewer than 8 readings.
        """
        return steady_point(self, start, end, tau, limit, name)

    def prepare(self, steps: Iterable[Mapping[str, object]]) -> Record:
        """Return the record after the steps of a campaign file, each a table with one key, such as ``[{median = "4 [s]"}]``.

        A step takes a table of options, a list of them in order, or the first one alone: ``{spikes = {threshold = 5, window = "10 [s]"}}``,
        ``{trim = ["2 [s]", "end"]}``, ``{median = "4 [s]"}``. A step without options takes true.

        Raises
        ------
        RecordError   When a step or an option is unknown or one is missing; with the place in the list, as every error of a step has.
        """
        record = self
        for number, table in enumerate(steps, 1):
            where = f"record '{record.name}', prepare[{number}]"
            if not isinstance(table, Mapping) or len(table) != 1:
                raise RecordError(
                    f"{table!r} is not a step. Write one step in each table, such as {{median = '4 [s]'}}.", where, code="value.wrong-kind"
                )
            ((name, written),) = table.items()
            refuse_unknown(table, STEPS, where, "no step '{}'; there are {known}.")
            options = _options(STEPS[name], written, f"{where}, {name}")
            try:
                record = getattr(record, STEPS[name].method)(**options)
            except ThermidError as error:
                raise type(error)(error.message, f"{where}, {error.where or name}") from None
        return record

    def to_csv(self, path: str | Path) -> None:
        """Write a record as a comma-separated log with units in its header, each channel in the unit of its file, masked samples empty.

        Read again, times and values are the same to one unit in the last place. The hash is the same too when nothing was masked, averaged
        or left out and the numbers had at most 12 digits, 9 of them decimals.
        """
        columns = [_texts(self.times, "s")]
        header = []
        taken = [self.origin.time, *(channel.column for channel in self.channels.values())]
        for channel in self.channels.values():
            # a column that feeds two channels is written twice, under their own names
            header.append(f"{channel.column if channel.column and taken.count(channel.column) == 1 else channel.name} [{channel.unit}]")
            cells = _texts(np.where(channel.valid, channel.values, 0.0), channel.unit)
            columns.append([cell if good else "" for cell, good in zip(cells, channel.valid.tolist(), strict=True)])
        with FileKinds.LOG.replacing(path) as half, half.open("w", encoding="utf-8", newline="") as file:
            file.write(f'"{self.origin.time} [s]"' + ("," if header else ""))
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(header)
            writer.writerows(zip(*columns, strict=True))

    def to_xarray(self) -> Dataset:
        """Return a record as a data set over `time`, SI units in the attributes, masked samples as NaN.

        Raises
        ------
        MissingExtraError   When xarray is not installed.
        """
        data: Dataset = optional("xarray", "to_xarray").Dataset(coords={"time": ("time", self.times, {"units": "s"})})
        for channel in self.channels.values():
            words = {
                "quantity": channel.quantity,
                "role": channel.role,
                "target": channel.target,
                "gain": channel.gain,
                "noise": channel.noise,
                "accuracy": channel.accuracy,
            }
            attributes = {"units": _si_unit(channel), **{key: value for key, value in words.items() if value is not None}}
            data[channel.name] = ("time", np.where(channel.valid, channel.values, np.nan), attributes)
        data.attrs = {"name": self.name, "file": self.origin.file, "sha256": self.origin.sha256, "steps": "\n".join(self.steps)}
        return data

    def __repr__(self) -> str:
        """Return name, samples, duration, step and channels in one line."""
        step = f"{self.step:.4g} s" + ("" if even_step(self.times) is not None else " (median, uneven)")
        origin_text = "synthetic, " if self.origin.synthetic else ""
        return (
            f"Record '{self.name}': {origin_text}{self.times.size} samples over {duration_text(self.duration)}, step {step}; "
            f"channels {', '.join(self.channels) or 'none'}"
        )

    def _noted(self, text: str, *changed: Channel) -> Record:
        """Return the record with changed channels and one more step in words."""
        return replace(self.with_channels(*changed), steps=(*self.steps, text))

    def _window(self, written: object, what: str) -> float:
        """Return a window that is not longer than the record. [s]

        Raises
        ------
        RecordError   When it is, or is not above zero.
        """
        window = positive_seconds(written, f"{what}, window")
        if window > self.duration:
            raise RecordError(
                f"{window:g} s is longer than record '{self.name}', which lasts {self.duration:g} s.",
                f"{what}, window",
                code="record.too-short",
            )
        return window

    def _filtered(self, powers: bool, what: str) -> list[Channel]:
        """Return the channels that a filter acts on: temperatures, and powers when asked.

        Raises
        ------
        RecordError   When there is none.
        """
        chosen = [
            channel for channel in self.channels.values() if channel.quantity == "temperature" or (powers and channel.quantity == "power")
        ]
        if not chosen:
            raise RecordError(
                f"record '{self.name}' has no temperature channel, so this step has nothing to act on. Leave it out.",
                what,
                code="record.does-not-apply",
            )
        return chosen

    def _temperatures(self, names: Sequence[str] | None, what: str) -> list[Channel]:
        """Return the named temperature channels, or all of them.

        Raises
        ------
        RecordError   When a named channel is no temperature.
        """
        if names is None:
            return self._filtered(False, what)
        chosen = [self.channel(name) for name in ([names] if isinstance(names, str) else names)]
        for channel in chosen:
            if channel.quantity != "temperature":
                raise RecordError(
                    f"channel '{channel.name}' is a {channel.quantity}, not a temperature.", what, code="record.does-not-apply"
                )
        return chosen

    def _masked_since(self, channel: Channel) -> int:
        """Return how many samples are valid in this record and masked in `channel`."""
        return int(np.count_nonzero(self.channels[channel.name].valid & ~channel.valid))

    def _lost(self, masked: Sequence[Channel]) -> str:
        """Return how many samples of each channel were masked, in words."""
        return ", ".join(f"{channel.name} {self._masked_since(channel)}" for channel in masked)

    def _as_traces(self) -> Sequence[PlottedTrace]:
        """Return the valid samples of every temperature, else of every channel in its unit."""
        chosen = [c for c in self.channels.values() if c.quantity == "temperature"] or list(self.channels.values())
        shift = ICE if chosen and chosen[0].quantity == "temperature" else 0.0
        return [PlottedTrace(c.name, self.times[c.valid], c.values[c.valid] - shift, measured=True) for c in chosen]

    def _as_rows(self) -> list[Row]:
        """Return every channel with its range."""
        return [
            {
                "channel": c.name,
                "quantity": c.quantity,
                "role": c.role,
                "target": c.target,
                "lowest": float(c.values[c.valid].min()),
                "highest": float(c.values[c.valid].max()),
                "valid": int(c.valid.sum()),
            }
            for c in self.channels.values()
            if c.valid.any()
        ]

    def to_frame(self) -> DataFrame:
        """Return a record as a frame over `time_s`, a column a channel in the unit of its file, masked samples as NaN.

        Raises
        ------
        MissingExtraError   When pandas is not installed.
        """
        pandas = optional("pandas", "to_frame")
        columns = {c.name: from_si(np.where(c.valid, c.values, np.nan), c.unit) for c in self.channels.values()}
        frame: DataFrame = pandas.DataFrame(columns, index=pandas.Index(self.times, name="time_s"))
        return frame

    def _ipython_key_completions_(self) -> list[str]:
        """Return the names of the channels."""
        return list(self.channels)

    def thin(self) -> Record:
        """Return a record of at most `MAX_SEARCHED_READINGS` readings, switching of powers kept."""
        if self.times.size <= MAX_SEARCHED_READINGS:
            return self
        return self.resample(thinned_step(self.duration))

    def drop_strays(self) -> tuple[Record, tuple[str, ...]]:
        """Return a record with codes of faults masked, and a sentence for each channel on what was masked."""
        remarks, cleaned = [], self
        for name, channel in self.channels.items():
            codes = strays(channel)
            if not codes:
                continue
            cleaned = cleaned.flag_faults(codes_to_mask(codes, channel), channels=[name])
            count = counted(int(np.count_nonzero(channel.valid & ~cleaned[name].valid)), "reading")
            remarks.append(f"{name}: {count} masked: {', '.join(dict.fromkeys(codes.values()))}")
        return cleaned, tuple(remarks)


def thinned_step(duration: float) -> float:
    """Return the interval that a record of a duration is resampled to where it is long, two digits of it. [s]"""
    step = duration / (MAX_SEARCHED_READINGS - 1)
    scale = 10.0 ** (np.floor(np.log10(step)) - 1)
    return float(np.ceil(step / scale) * scale)


def _spread(channel: Channel, places: np.ndarray, samples: int) -> Channel:
    """Return a channel with its samples at some of `samples` places (indices) and nothing between them."""
    values, valid = np.full(samples, np.nan), np.zeros(samples, dtype=bool)
    values[places], valid[places] = channel.values, channel.valid
    masks = {reason: np.zeros(samples, dtype=bool) for reason in channel.masks}
    for reason, mask in channel.masks.items():
        masks[reason][places] = mask
    return replace(channel, values=values, valid=valid, masks=masks)


def _interleaved(one: Samples, other: Samples, there: FloatArray) -> tuple[FloatArray, dict[str, Channel]]:
    """Return the times (times,) of two logs as one axis [s], and name -> channel of both on it, NaN where it has no sample.

    `there` (samples,) are the second one's times on the clock of the first. [s] Times that differ by rounding only are one time.
    """
    after = np.clip(np.searchsorted(one.times, there), 1, one.times.size - 1)
    near = np.where(there - one.times[after - 1] < one.times[after] - there, one.times[after - 1], one.times[after])
    there = np.where(np.abs(near - there) <= 1e-12 * np.abs(there).max(), near, there)
    times = np.union1d(one.times, there)
    return times, {
        name: _spread(channel, np.searchsorted(times, axis), times.size)
        for record, axis in ((one, one.times), (other, there))
        for name, channel in record.channels.items()
    }


def clock_range(written: Any, slot: str, name: str, where: str) -> tuple[float, float]:
    """Return the (low, high) of a clock's offset or rate, or of a delay; equal for a single value.

    Raises
    ------
    RecordError   When it has not two ends, or the first is the higher.
    """
    several = isinstance(written, tuple | list)
    if several and len(written) != 2:
        raise RecordError(f"the range of the {name} has two ends, not {len(written)}.", where, code="value.wrong-kind")
    low, high = (amount(end, slot, f"{where}, {name}") for end in (written if several else (written, written)))
    if not low <= high:
        raise RecordError(
            f"the range {low:g} .. {high:g} of the {name} must begin with the lower number.", where, code="value.outside-range"
        )
    return float(low), float(high)


class Step(NamedTuple):
    """A method of `Record` as a step of a campaign file: the first `required` of its options must be given."""

    method: str
    required: int
    options: tuple[str, ...]


STEPS: Final = {
    "trim": Step("trim", 1, ("start", "end")),
    "median": Step("median", 1, ("window", "powers")),
    "filter": Step("filter", 1, ("window", "powers")),
    "resample": Step("resample", 1, ("step", "max_gap", "switches")),
    "spikes": Step("flag_spikes", 2, ("threshold", "window", "channels")),
    "faults": Step("flag_faults", 0, ("codes", "low", "high", "jump", "channels")),
    "mask": Step("mask", 1, ("channel", "start", "end", "reason")),
    "shift_start": Step("shift_start", 0, ()),
    "delay": Step("delayed", 1, ("by", "channels")),
}
"""Steps of a campaign file by name."""


def _options(step: Step, written: object, where: str) -> dict[str, object]:
    """Return the options of one step by name, from a table, a list, one value or true.

    Raises
    ------
    RecordError   When an option is unknown or missing, or there are too many values.
    """
    if isinstance(written, Mapping):
        refuse_unknown(written, step.options, where, "no option '{}'; there are {known}.")
        options = dict(written)
    elif written is True and step.required == 0:
        options = {}
    else:
        values = list(written) if isinstance(written, Sequence) and not isinstance(written, str) else [written]
        if len(values) > len(step.options):
            raise RecordError(
                f"{len(values)} values are given; it takes {', '.join(step.options) or 'none: write true'}.", where, code="value.wrong-kind"
            )
        options = dict(zip(step.options, values, strict=False))
    missing = [option for option in step.options[: step.required] if option not in options]
    if missing:
        raise RecordError(f"it needs {' and '.join(missing)}.", where, code="value.incomplete")
    return options


def _texts(values: FloatArray, text: str) -> list[str]:
    """Return SI values as numbers in the unit `text`, as short as gives the same SI values again."""
    of = unit(text)
    numbers = from_si(values, of).tolist()
    texts = [f"{number:.17g}" for number in numbers]
    # the offset of a scale leaves rounding in late decimals; the first form that gives the same SI value again is the one of the file
    for short in ([f"{number:.15g}" for number in numbers], [f"{round(number, 9):.15g}" for number in numbers]):
        same = (in_si(np.array(list(map(float, short))), text) == values).tolist()
        texts = [brief if good else long for brief, good, long in zip(short, same, texts, strict=True)]
    return texts


def _si_unit(channel: Channel) -> str:
    """Return the SI unit of a channel's values as text, in base units where it has no short name."""
    dimension = unit(channel.unit).dimension
    for short in ("K", "W", "1", "Pa", "V", "A"):
        if unit(short).dimension == dimension:
            return short
    bases = ("m", "kg", "s", "A", "K")
    return " ".join(f"{base}^{power}" if power != 1 else base for base, power in zip(bases, dimension, strict=True) if power)


def _check_order(times: Any, where: str) -> None:
    """Refuse the times of a frame that do not increase strictly.

    Raises
    ------
    RecordError   With what to do.
    """
    with errors_at(where):
        axis = seconds(times)
    if axis.size < 2 or not np.all(np.diff(axis) > 0.0):
        raise RecordError(
            "the times do not increase strictly. Sort the frame by time and drop what is there twice.", where, code="record.time-order"
        )


def _channel_of(column: str, values: FloatArray, table: Mapping[str, Any], name: str) -> Channel:
    """Return a column of a frame as a channel, by its table of unit, role and target.

    Raises
    ------
    RecordError   When a key is unknown or missing, or the unit does not fit the role.
    """
    where = f"{name}, {column}"
    if not isinstance(table, Mapping):
        raise RecordError(f"give a table such as {{'unit': 'degC', 'node': 'case'}}, not {table!r:.60}.", where, code="value.wrong-kind")
    refuse_unknown(table, [*ROLES, "unit", "noise", "accuracy", "resolution", *KEYS], where)
    roles = [key for key in ROLES if key in table]
    if "unit" not in table or len(roles) != 1:
        raise RecordError(
            f"give its unit, and one of {', '.join(ROLES)}: {{'unit': 'degC', 'node': 'case'}}.", where, code="value.incomplete"
        )
    of, role = unit(str(table["unit"])), ROLES[roles[0]]
    warm = role.quantity == "temperature"
    if role.slot and of.dimension != unit("K" if warm else role.slot).dimension and role.quantity != "command":
        raise RecordError(f"'{of.text}' is no unit of a {role.quantity}.", where, code="unit.wrong-dimension")
    sizes = {key: amount(table[key], "K" if warm else of.text, where) for key in ("noise", "accuracy", "resolution") if key in table}
    return Channel.from_array(
        column,
        values,
        quantity=role.quantity or quantity_of(of),
        role=roles[0],
        target=str(table[roles[0]]),
        column=column,
        unit=of.text,
        **sizes,
    )
