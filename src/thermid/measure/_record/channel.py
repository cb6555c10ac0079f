"""Measured channels: one with its sensor, and several on one axis of times."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import combinations
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from thermid.base.arguments import guard_methods
from thermid.base.errors import CodedText, ExpressionError, RecordError, UnitError, code_of, errors_at, look_up, refuse_unknown
from thermid.base.results import Row, Shown
from thermid.base.units import (
    DEVIATION_OF_MEDIAN,
    TEMPERATURE,
    Stamp,
    Unit,
    amount,
    describe,
    duration_text,
    format_value,
    from_si,
    in_si,
    positive_seconds,
    quantity,
    require_unit,
    short,
    si_values,
    stated,
    unit as read_unit,
)
from thermid.measure._record.sensor import KEYS, SensorCertificate, SensorPart

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]


class Role(NamedTuple):
    """What a channel is to a model.

    Parameters
    ----------
    quantity : str      What its readings are; empty where their unit tells.
    slot : str          Dimension that they must have: a unit, or `temperature`; empty where only the model knows it.
    unit : str          Unit that is taken where nothing states one.
    drives : bool       Whether the readings are an input of the model; else they are compared with it.
    """

    quantity: str
    slot: str
    unit: str
    drives: bool


ROLES: Final = {
    "node": Role("temperature", TEMPERATURE, "degC", drives=False),
    "boundary": Role("temperature", TEMPERATURE, "degC", drives=True),
    "load": Role("power", "W", "W", drives=True),
    "command": Role("command", "1", "%", drives=True),
    "prescribed": Role("temperature", TEMPERATURE, "degC", drives=True),
    "schedule": Role("", "", "1", drives=True),
}
"""Role, a key in the table of a channel -> what it is. A channel without one is 'auto': the model decides by the name of its target."""
HELD: Final = frozenset({"power", "command"})
"""Quantities that keep their value until the next sample (zero-order hold); all others run straight from sample to sample."""

SAMPLES: Final = ("instant", "average")
"""What a sample of a log may be: the value at its stamp, or the mean over the interval that ends there."""

INTERPOLATIONS: Final = ("linear", "previous")
"""What holds between two samples: a straight line, or the sample before."""

SI_UNITS: Final = {"temperature": "K", "power": "W", "command": "1"}
"""Quantity -> its SI unit; a quantity that is not here has the unit 1."""
COLUMN_UNITS: Final = {"power": ("W", "mW", "kW"), "temperature": ("degC", "degF", "K")}
"""Quantity -> units that columns of it usually have, the likeliest first."""


@dataclass(frozen=True)
class Origin:
    """Where the samples of a record came from. Trimmed, filtered and resampled copies keep it as the identity of the data.

    Parameters
    ----------
    file : str              Name of the file without its folder, or the name of a synthetic record.
    sha256 : str            Hash of the parsed samples, see `digest`.
    start : str or None     First stamp as written, where the log has stamps.
    columns : tuple of str  Column names in file order, without their units.
    rows : int              Number of lines with samples.
    time : str              Name of the time column.
    synthetic : bool        Whether the samples were made and not measured.
    questions : tuple       What the log leaves open and its owner can answer, in words: a unit, an hour, two readings at one time.
    """

    file: str
    sha256: str
    start: str | None
    columns: tuple[str, ...]
    rows: int
    time: str = "time"
    synthetic: bool = False
    questions: tuple[str, ...] = ()


def digest(columns: Iterable[tuple[str, ArrayLike]]) -> str:
    """Return the SHA-256 of named columns: time first, then every numeric column in file order.

    Each column is its name (UTF-8), a zero byte, and its samples as little-endian float64, with one form of NaN and of zero. Compression,
    separator, decimal sign and number format of the file do not enter.
    """
    total = hashlib.sha256()
    for name, values in columns:
        samples = np.atleast_1d(np.asarray(values, dtype="<f8")) + 0.0  # a copy, in which -0.0 becomes 0.0
        samples[np.isnan(samples)] = np.nan
        total.update(name.encode() + b"\0" + samples.data)
    return total.hexdigest()


def frozen(values: ArrayLike, kind: Any) -> NDArray[Any]:
    """Return an array of a dtype `kind` that cannot be written to: a copy where it could be."""
    if isinstance(values, np.ndarray) and values.dtype == kind and not values.flags.writeable:
        if values.base is None or (isinstance(values.base, np.ndarray) and not values.base.flags.writeable):
            return values
    copy = np.array(values, dtype=kind)
    copy.flags.writeable = False
    return copy


def quantity_of(of: Unit) -> str:
    """Return what readings in a unit measure, in words: temperature, power, command, current ..."""
    usual = (quantity for quantity, text in SI_UNITS.items() if read_unit(text).dimension == of.dimension)
    return next(usual, describe(of.dimension).removeprefix("an ").removeprefix("a "))


SIZES: Final = ("noise", "accuracy", "resolution", "common")
"""Fields of a channel that are sizes of an error or of a step, in its own unit."""


@guard_methods
@dataclass(frozen=True, eq=False)
class Channel(Shown):
    """Samples of one sensor or command, and what they are bound to.

    Parameters
    ----------
    name : str                      Its name in the record.
    values : array (samples,)       Samples; a masked sample keeps its number, a missing one is NaN. [SI]
    valid : array (samples,)        False where a sample is masked.
    quantity : str                  'temperature', 'power', 'command' or another word.
    role : str                      'auto', 'node', 'boundary', 'load', 'command', 'prescribed' or 'schedule'; see `ROLES`.
    target : str or None            Path in the model.
    gain : str or None              Path of the parameter that turns a command into a power.
    noise : float or None           Standard deviation of one sample. [SI]
    accuracy : float or None        Standard deviation of the constant error. [SI]
    resolution : float or None      Smallest step of the sensor, where known. [SI]
    column : str                    Its column in the file; empty where it is computed from several.
    unit : str                      Its unit in the file; SI when it was not read from one.
    masks : mapping to arrays       Masked samples by reason, each (samples,).
    correction : float              What a certificate has taken off the readings. [SI]
    part : SensorPart or None       What else its sensor does: scale, lag, noise in time, mass, leads.
    prompt : bool or None           Whether a power or command has a sample at every change, so that the log has its moment; false, a fit
                                    looks for the part of the interval before a sample in which it changed; None, it changed at samples.
    samples : str                   Of what drives a model: ``instant`` or ``average`` (the mean over the interval up to the stamp), as
                                    somebody said; empty where nobody did, which is taken as instants.
    interpolation : str             Between samples: ``linear`` or ``previous``, which keeps a sample until the next; empty for previous of
                                    powers and commands, and linear of temperatures.
    assumed : bool                  Whether nothing said its unit, so that the usual one was taken.
    common : float or None          Standard deviation of an error that all samples share and no other record has, as that of a mean. [SI]

    Raises
    ------
    RecordError   When arrays differ in length, a valid sample is not finite, or role, noise, accuracy or resolution make no sense.
    """

    name: str
    values: FloatArray
    valid: BoolArray
    quantity: str = "temperature"
    role: str = "auto"
    target: str | None = None
    gain: str | None = None
    noise: float | None = None
    accuracy: float | None = None
    resolution: float | None = None
    column: str = ""
    unit: str = ""
    masks: Mapping[str, BoolArray] = field(default_factory=dict)
    correction: float = 0.0
    part: SensorPart | None = None
    prompt: bool | None = None
    samples: str = ""
    interpolation: str = ""
    assumed: bool = False
    common: float | None = None

    def __post_init__(self) -> None:
        """Check the parts against each other and lock the arrays."""
        where = f"channel '{self.name}'"
        values, valid = frozen(self.values, np.float64), frozen(self.valid, np.bool_)
        masks = {reason: frozen(mask, np.bool_) for reason, mask in self.masks.items() if np.any(mask)}
        if values.ndim != 1 or any(array.shape != values.shape for array in (valid, *masks.values())):
            raise RecordError("values, valid and masks must be one-dimensional and of equal length.", where, code="record.shape")
        if np.any(valid & ~np.isfinite(values)):
            raise RecordError("a valid sample is not finite. Mask it.", where, code="record.shape")
        bare = ~valid & ~np.any([np.zeros_like(valid), *masks.values()], axis=0)
        for reason, part in (("not a number", np.isnan(values)), ("infinite", np.isinf(values)), ("masked", np.isfinite(values))):
            if np.any(bare & part):
                masks[reason] = frozen(masks.get(reason, False) | (bare & part), np.bool_)
        refuse_unknown([self.samples], ("", *SAMPLES), where, "its samples are 'instant' or 'average', not '{}'.", RecordError)
        refuse_unknown([self.interpolation], ("", *INTERPOLATIONS), where, "no interpolation '{}'; it is one of {known}.", RecordError)
        refuse_unknown([self.role], ("auto", *ROLES), where, "no role '{}'; it is one of {known}.", RecordError)
        for word, size, least in (
            ("noise", self.noise, "above"),
            ("accuracy", self.accuracy, "not below"),
            ("resolution", self.resolution, "above"),
        ):
            if size is not None and not (np.isfinite(size) and (size > 0 or (size == 0 and least == "not below"))):
                raise RecordError(f"its {word} is {size:g}; a finite number {least} zero is needed.", where, code="value.outside-range")
        for key, value in (("values", values), ("valid", valid), ("masks", masks), ("unit", self.unit or SI_UNITS.get(self.quantity, "1"))):
            object.__setattr__(self, key, value)

    @cached_property
    def step(self) -> float:
        """The smallest step of the sensor: as stated, or as its readings show it; zero where they show none. [SI]

        Readings that are all one number have the step of its last digit, in the unit of the file.
        """
        return self.resolution if self.resolution is not None else _step_of(self)

    @cached_property
    def white_noise(self) -> float:
        """The standard deviation of white noise that the samples show: how far each lies from its neighbours' course. [SI]

        Differences of order k of white noise have binomial(2 k, k) times its variance, and those of anything slow next to nothing, less the
        higher the order: the smallest of three estimates counts. The median size stands for the root mean square, so that jumps do not
        count. Readings in steps show the noise of their rounding too; their differences are spread evenly over a step, and its variance is
        taken off again (Sheppard's correction), since a median of whole steps is off by up to a third. Where most differences are zero, and
        of a power that is switched between few levels, there is no noise.
        """
        valid = self.values[self.valid]
        if valid.size < SWITCHED or (self.quantity != "temperature" and np.unique(np.round(valid, 9)).size * SWITCHED <= valid.size):
            return 0.0
        even = self.step * np.array([math.remainder(k * math.e, 1.0) for k in range(valid.size)])
        orders = [k for k in ORDERS if valid.size >= SWITCHED + k]
        sizes = [
            DEVIATION_OF_MEDIAN * float(np.median(np.abs(d + even[: d.size]))) if np.median(np.abs(d)) else 0.0
            for d in (np.diff(valid, k) for k in orders)
        ]
        squares = [max(size**2 - float(even.var()), 0.0) / math.comb(2 * k, k) for size, k in zip(sizes, orders, strict=True)]
        return math.sqrt(min(squares, default=0.0))

    @property
    def noise_seen(self) -> float:
        """max(white_noise, step / sqrt(12)): the noise that one reading of a temperature shows. [K]"""
        return max(self.white_noise, self.step / math.sqrt(12.0))

    @property
    def switched(self) -> BoolArray:
        """The samples at which a power or command was switched (samples,); noise of a power meter is no switch."""
        out, places = np.zeros(self.values.size, dtype=bool), np.flatnonzero(self.valid)
        apart = np.abs(np.diff(self.values[places]))
        if apart.size:
            least = max(USUAL_CHANGES * float(np.median(apart)), 0.01 * float(np.ptp(self.values[places])))
            out[places[1:][apart > least]] = True
        return out

    def in_unit(self, text: str) -> Channel:
        """Return it as it would be if its column were in the unit `text` and not in the one that was declared."""
        return replace(self, values=in_si(from_si(self.values, self.unit), text), unit=text, masks={})

    def unit_remedy(self, text: str) -> str:
        """Return how to declare that its column is in the unit `text`; a power computed from columns has their units."""
        if not self.column:
            return f"Check the units of the columns from which '{self.name}' is computed."
        return f"Write unit = \"{text}\" for '{self.name}'."

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> FloatArray:
        """Return its readings (samples,), NaN where one is masked. [degC of a temperature, else the unit of the channel]"""
        shown = from_si(self.values, "degC" if self.quantity == "temperature" else self.unit)
        return np.asarray(np.where(self.valid, shown, np.nan), dtype=dtype)

    @classmethod
    def from_array(cls, name: str, values: Any, *, unit: str = "", **fields: Any) -> Channel:
        """Return a channel of an array, with samples that are not finite masked.

        Parameters
        ----------
        name : str                  Its name in the record.
        values : array (samples,)   In `unit`; or with their own, by `thermid.celsius`, or of pint, pandas or xarray.
        unit : str                  Without it, and without a unit of the values, these are SI; temperatures need one.
        fields                      As of the class; noise, accuracy, resolution and common also as text with a unit, ``"0.5 [K]"``.

        Raises
        ------
        RecordError   When one of these sizes is no amount.
        UnitError     When temperatures have no unit, or a unit is of something else.
        """
        kind = str(fields.get("quantity", "temperature"))
        sizes = {w: amount(fields[w], SI_UNITS.get(kind, "1"), f"channel '{name}', {w}") for w in SIZES if fields.get(w) is not None}
        with errors_at(f"channel '{name}'"):
            with_unit = quantity(values, unit=unit) if unit else stated(values)
            if with_unit is not None and kind in SI_UNITS:
                require_unit(with_unit.unit, TEMPERATURE if kind == "temperature" else SI_UNITS[kind])
            if with_unit is None and kind == "temperature":
                with_unit = quantity(si_values(values, TEMPERATURE), unit="K")
        samples = np.asarray(values if with_unit is None else with_unit.si, dtype=np.float64)
        return cls(name, samples, np.isfinite(samples), unit="" if with_unit is None else with_unit.unit.text, **fields | sizes)

    def _summary(self) -> str:
        """Name, quantity, target, and how many samples are valid."""
        seat = f" of {self.target}" if self.target else ""
        return f"{self.name}: {self.quantity or 'samples'}{seat}, {int(np.count_nonzero(self.valid))} of {self.values.size} samples valid"

    def _as_rows(self) -> list[Row]:
        """Return lowest and highest valid sample. [SI]"""
        good = self.values[self.valid]
        ends = {"low": float(good.min()), "high": float(good.max())} if good.size else {}
        return [{"channel": self.name, "unit": self.unit, "samples": self.values.size, **ends}]

    @property
    def flags(self) -> dict[str, int]:
        """Masked samples, counted by reason."""
        return {reason: int(np.count_nonzero(mask)) for reason, mask in self.masks.items()}

    @property
    def drives(self) -> bool:
        """Whether its role makes it an input of the model; not so of a channel without a role."""
        return self.role in ROLES and ROLES[self.role].drives

    @property
    def held(self) -> bool:
        """Whether a sample holds until the next one: by `interpolation`, else true of powers, commands and what is scheduled."""
        return self.quantity in HELD or self.role == "schedule" if not self.interpolation else self.interpolation == "previous"

    def masked(self, where: ArrayLike, reason: str) -> Channel:
        """Return the channel with its valid samples masked where the array `where` (samples,) is True, for a reason.

        Raises
        ------
        RecordError   When no valid sample would remain.
        """
        new = np.asarray(where, dtype=np.bool_) & self.valid
        masks = dict(self.masks)
        masks[reason] = masks.get(reason, np.zeros_like(self.valid)) | new
        return replace(self, valid=self.valid & ~new, masks=masks).checked()

    def checked(self) -> Channel:
        """Return the channel itself if it has a valid sample.

        Raises
        ------
        RecordError   When all samples are masked.
        """
        if not self.valid.any():
            counts = ", ".join(f"{reason} {count}" for reason, count in self.flags.items())
            raise RecordError(
                f"all {self.valid.size} samples are masked ({counts}). Leave the channel out, or keep a part where it works.",
                f"channel '{self.name}'",
                code="record.nothing-there",
            )
        return self

    def taken(self, keep: BoolArray) -> Channel:
        """Return the channel at the samples where `keep` (samples,) is True.

        Raises
        ------
        RecordError   When none of these is valid.
        """
        masks = {reason: mask[keep] for reason, mask in self.masks.items()}
        return replace(self, values=self.values[keep], valid=self.valid[keep], masks=masks).checked()


def ranged(channel: Channel, part: SensorPart) -> tuple[Channel, str]:
    """Return the channel with readings at or beyond the sensor's range masked, and a sentence on that; empty for none."""
    outside = channel.valid & ((channel.values <= part.low) | (channel.values >= part.high))
    if not outside.any():
        return channel, ""
    shown = " to ".join(format_value(end, "degC") for end in (part.low, part.high))
    return channel.masked(outside, "out of range"), f"{channel.name}: {np.count_nonzero(outside)} readings at or beyond its range {shown}"


def certified(channel: Channel, certificate: SensorCertificate) -> tuple[Channel, str]:
    """Return the channel corrected by a certificate, with its remaining accuracy, and a sentence on that.

    Mean and standard deviation of the correction are those of `SensorCertificate.combined`.
    """
    mean, sd = certificate.combined(channel.accuracy)
    date = f" of {certificate.date}" if certificate.date else ""
    correction = f"{certificate.offset:+.3g} +- {certificate.uncertainty:.2g} K at {format_value(certificate.at, 'degC')}"
    text = f"{channel.name}: certificate{date} {correction}; readings corrected by {-mean:+.3g} K, accuracy {sd:.2g} K"
    if channel.accuracy is not None:
        far = abs(certificate.offset) / math.hypot(channel.accuracy, certificate.uncertainty)
        text += f" (before {channel.accuracy:.2g} K)"
        if far > 3.0:
            text += f"; the offset is {far:.1f} times the accuracy of its type. Check that this is the right sensor."
    return replace(channel, values=channel.values - mean, accuracy=sd, correction=channel.correction + mean), text


def with_sensor(channel: Channel, part: SensorPart | None, certificate: SensorCertificate | None, where: str) -> tuple[Channel, list[str]]:
    """Return a channel with its sensor's range and certificate applied, and sentences on what they did.

    Raises
    ------
    RecordError   When the channel holds no temperature, or all of its readings lie outside the range; a power may have `gain_accuracy`.
    """
    if part is None and certificate is None:
        return channel, []
    if channel.quantity == "power" and part is not None and replace(part, gain_accuracy=0.0) == SensorPart():
        return replace(channel, part=part), []
    if channel.quantity != "temperature":
        raise RecordError(
            f"it holds a {channel.quantity}; {', '.join(KEYS)} apply to temperature sensors only, and gain_accuracy to powers too.",
            where,
            code="record.does-not-apply",
        )
    notes = []
    if part is not None:
        channel, note = ranged(replace(channel, part=part), part)
        notes.append(note)
    if certificate is not None:
        channel, note = certified(channel, certificate)
        notes.append(note)
    return channel, [note for note in notes if note]


UNSEEN_PULSES: Final = "record.unseen-pulses"
MIN_PULSES: Final = 8
"""Pulses of a power from which it is judged whether its log shows them all. [-]"""
MOST_PULSES: Final = 0.7
"""Share of pulses with a single reading from which others may be unseen: of a heater whose phases vary by 30 % and last an interval or less
on average, an eighth or more of all changes were. [-]"""
CLEAR: Final = 0.25
"""How far levels of a switched power are from the middle, over its range, and how far intervals of an even log may be from usual. [-]"""
EVEN: Final = 0.01
"""Share of the mean interval by which intervals of an even grid may differ from it."""


def usual_step(times: FloatArray) -> float:
    """Return the median interval of times (samples,); zero for a single sample. [s]"""
    return float(np.median(np.diff(times))) if times.size > 1 else 0.0


def gap_from(times: FloatArray) -> float:
    """Return the interval from which samples are missing: five times the 90 % quantile of all intervals. [s]

    A log may change its rate, which this quantile follows better than the median does.
    """
    return 5.0 * float(np.quantile(np.diff(times), 0.9, method="lower")) if times.size > 1 else 0.0


def even_step(times: FloatArray) -> float | None:
    """Return the mean interval where every interval is within 1 % of it; None where times are uneven. [s]"""
    steps = np.diff(times)
    if steps.size == 0:
        return None
    mean = float(steps.mean())
    return mean if np.all(np.abs(steps - mean) <= EVEN * mean) else None


def gap_limit(times: FloatArray, valid: BoolArray, step: float, max_gap: str | float | None) -> float:
    """Return the longest interval bridged: `max_gap`, or five times the 90 % quantile of valid intervals, at least two steps. [s]"""
    return positive_seconds(max_gap, "max_gap") if max_gap is not None else max(gap_from(times[valid]), 2.0 * step)


class SampleTable(NamedTuple):
    """One channel as a signal.

    Parameters
    ----------
    times : array (points,)    Times, from the start of the record to its end. [s]
    values : array (points,)   Values: straight lines between them, or held where the channel is held. [SI]
    bridged : float            Share of the record's duration that no pair of neighbouring valid samples covers. [-]
    """

    times: FloatArray
    values: FloatArray
    bridged: float


@dataclass(frozen=True)
class SecondClock:
    """A further clock of a record, known within ranges only: its time t is ``offset + rate t`` on the record's own. A fit finds both.

    Parameters
    ----------
    channels : tuple of str         Channels that were logged on it.
    offset, rate : (low, high)      Ranges in which they lie. [s, -]
    at : (offset, rate)             Values at which the record holds these channels until a fit. [s, -]
    times : (first, last)           Times of the record before it was joined. [s]
    step : float                    Median interval of the log on this clock. [s]
    log : str                       Name of the log on this clock.
    offset_is : str                 Name of the offset in results: a delay where the clock is the record's own.
    """

    channels: tuple[str, ...]
    offset: tuple[float, float]
    rate: tuple[float, float]
    at: tuple[float, float]
    times: tuple[float, float]
    step: float
    log: str
    offset_is: str = "clock offset"

    def possible(self, times: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the earliest and the latest that times of the record, where it holds these channels, may be (times,) each. [s]"""
        ticks = (times - self.at[0]) / self.at[1]
        corners = [offset + rate * ticks for offset in self.offset for rate in self.rate]
        return np.min(corners, axis=0), np.max(corners, axis=0)


UNPAIRED: Final = 0.05
"""Part of a record that only one of two joined logs covers, from which the offset between them is questioned. [-]"""


@guard_methods
@dataclass(frozen=True, eq=False, repr=False)
class Samples:
    """The fields of a `Record` and what reads them; methods that return a changed record are added there."""

    name: str
    times: FloatArray
    channels: Mapping[str, Channel]
    origin: Origin
    steps: tuple[str, ...] = ()
    clocks: tuple[SecondClock, ...] = ()
    stated_clocks: tuple[SecondClock, ...] = ()
    environment: Mapping[str, Any] = field(default_factory=dict)

    @property
    def zero(self) -> Stamp | None:
        """Instant of its time zero, also of a steady point; None without stamps of a known form, and where its times were begun anew."""
        if self.origin.start is None or self.moved.startswith("shift_start"):
            return None
        try:
            return Stamp.read(self.origin.start)
        except UnitError:
            return None

    @property
    def questions(self) -> tuple[str, ...]:
        """What its owner should answer: what the logs leave open, and whether it is meant that a joined log covers a part of the time."""
        out = list(self.origin.questions)
        for clock in (*self.clocks, *self.stated_clocks):
            sides = ([c.valid for n, c in self.channels.items() if (n in clock.channels) is joined] for joined in (False, True))
            here, there = (self.times[np.any(valid, axis=0)] if valid else self.times for valid in sides)
            begin, end = max(here[0], there[0]), min(here[-1], there[-1])
            if self.duration - (end - begin) > UNPAIRED * self.duration:
                out.append(
                    f"for {duration_text(self.duration - (end - begin))} of its {duration_text(self.duration)} only one of its log and "
                    f"'{clock.log}' has readings; there a run keeps the first or last reading of an input. Check the offset of "
                    f"{clock.at[0]:.6g} s. To use only the time of both, trim each log; on this clock it is {begin:.6g} to {end:.6g} s."
                )
        return tuple(out)

    @property
    def moved(self) -> str:
        """The step after which its times are no longer those of its log; empty without one."""
        return next((step for step in self.steps if step.startswith(("shift_start", "steady point"))), "")

    def __post_init__(self) -> None:
        """Check the channels against the times and each other."""
        where = f"record '{self.name}'"
        times = frozen(self.times, np.float64)
        if times.ndim != 1 or times.size < 2 or not np.all(np.isfinite(times)):
            raise RecordError(
                f"its times have shape {times.shape}; at least two finite times in one row are needed.", where, code="record.shape"
            )
        back = np.flatnonzero(np.diff(times) <= 0)
        if back.size:
            at = int(back[0])
            raise RecordError(
                f"its times do not increase: {times[at]:g} s is followed by {times[at + 1]:g} s (sample {at + 2}).",
                where,
                code="record.time-order",
            )
        taken: dict[tuple[str, str], str] = {}
        for key, channel in self.channels.items():
            if key != channel.name:
                raise RecordError(
                    f"channel '{channel.name}' is stored under another name, '{key}'. Use one name.", where, code="record.name-twice"
                )
            if channel.values.size != times.size:
                raise RecordError(f"channel '{key}' has {channel.values.size} samples for {times.size} times.", where, code="record.shape")
            if channel.target is not None and channel.role != "node":
                # one node may have several sensors, and be prescribed for beside them; what drives a run has one channel
                kind = "load" if channel.role == "command" else channel.role
                other = taken.setdefault((kind, channel.target), key)
                if other != key:
                    raise RecordError(
                        f"channels '{other}' and '{key}' are both bound to {kind} '{channel.target}'. "
                        "Bind one of them. For several sensors on one node use the role 'node'.",
                        where,
                        code="record.name-twice",
                    )
        object.__setattr__(self, "times", times)
        object.__setattr__(self, "channels", dict(self.channels))
        object.__setattr__(self, "environment", dict(self.environment))

    @property
    def duration(self) -> float:
        """Time from the first to the last sample [s]."""
        return float(self.times[-1] - self.times[0])

    def channel(self, name: str) -> Channel:
        """Return a channel.

        Raises
        ------
        NameNotFoundError   When the record has none of that name.
        """
        return look_up(name, self.channels, "no channel '{}'; it has {known}.", f"record '{self.name}'")

    __getitem__ = channel

    def __iter__(self) -> Iterator[str]:
        """Iterate over the names of the channels."""
        return iter(self.channels)

    def __len__(self) -> int:
        """How many channels there are."""
        return len(self.channels)

    def __contains__(self, name: object) -> bool:
        """Whether there is a channel of that name."""
        return name in self.channels

    @property
    def measured(self) -> list[str]:
        """Names of the temperatures that are not those of a boundary."""
        return [name for name, channel in self.channels.items() if channel.quantity == "temperature" and channel.role != "boundary"]

    @property
    def step(self) -> float:
        """Median interval of the channel with most readings; channels of other clocks do not count. [s]"""
        read = (np.isfinite(c.values) for c in self.channels.values())
        return usual_step(self.times[max(read, key=np.count_nonzero, default=slice(None))])

    def table(self, name: str, max_gap: str | float | None = None) -> SampleTable:
        """Return a channel as a signal over the whole record.

        Masked stretches are bridged: by a straight line, or by holding the last value of a held channel. Before the first and after the
        last valid sample the nearest one is taken. An interval longer than `max_gap` counts as bridged too. [s]

        Raises
        ------
        NameNotFoundError   When there is no such channel.
        RecordError         When all of its samples are masked.
        """
        channel = self.channel(name).checked()
        gap = gap_limit(self.times, channel.valid, 0.0, max_gap)
        steps = np.diff(self.times)
        covered = channel.valid[:-1] & (channel.valid[1:] | channel.held) & (steps <= gap)
        keep = channel.valid.copy()
        keep[[0, -1]] = True
        first, last = np.flatnonzero(channel.valid)[[0, -1]]
        values = channel.values.copy()
        if not channel.valid[0]:
            values[0] = values[first]
        if not channel.valid[-1]:
            values[-1] = values[last]
        return SampleTable(self.times[keep], values[keep], float(1.0 - steps[covered].sum() / steps.sum()))

    def stretch(self, start: object, end: object, what: str) -> tuple[BoolArray, str]:
        """Return which samples lie from start to end (samples,), and that period in words.

        Raises
        ------
        RecordError   When the end is before the start, or no sample lies between.
        """
        low, high = _moment(self, start, what), _moment(self, end, what)
        text = f"{format_value(low, 's')} to {format_value(high, 's')}"
        if high < low:
            raise RecordError(f"its end is before its start: {text}.", what, code="value.outside-range")
        # a time written with few digits must still meet the sample that it names
        near = 1e-6 * self.step
        inside = (self.times >= low - near) & (self.times <= high + near)
        if not inside.any():
            axis = f"{format_value(self.times[0], 's')} to {format_value(self.times[-1], 's')}"
            raise RecordError(f"there is no sample from {text}; record '{self.name}' runs from {axis}.", what, code="record.nothing-there")
        return inside, text

    def refuse_beyond(self, time: object, what: str) -> None:
        """Refuse a time that lies beyond the end of a log.

        Raises
        ------
        RecordError   With the time at which the log ends.
        """
        moment, last = _moment(self, time, what), float(self.times[-1])
        if moment > last + self.step:
            raise RecordError(
                f"nothing was logged at {duration_text(moment)}; the log ends at {duration_text(last)}. Ask for 'end'.",
                what,
                code="record.nothing-there",
            )


def _moment(record: Samples, written: object, what: str) -> float:
    """Return a time on the record's axis, from a number, a text with a unit, "start" or "end". [s]"""
    if isinstance(written, str) and written.strip() in ("start", "end"):
        return float(record.times[0 if written.strip() == "start" else -1])
    try:
        return amount(written, "s", what)
    except (RecordError, ExpressionError) as error:
        raise RecordError(f"{error.message} 'start' and 'end' are allowed too.", error.where, code=error.code) from None


MIN_SAMPLES_PER_LEVEL: Final = 2
"""Samples a level must have on average for readings to count as ones of steps."""
ON_GRID: Final = 0.05
"""Part of a step by which the distance of two levels may miss a whole number of steps; one in ten may miss it by more, as spikes do."""
MAX_DECIMALS: Final = 6
"""Decimals down to which the last digit of a constant reading is looked for."""
ORDERS: Final = (2, 4, 6)
"""Orders of the differences by which noise is told from what a signal does."""
USUAL_CHANGES: Final = 8.0
"""Usual changes between neighbours from which a power counts as switched."""
SWITCHED: Final = 8
"""Samples a level of a power has on average from which it is switched between levels and does not scatter; fewer samples show no noise."""


def _step_of(channel: Channel) -> float:
    """Return the step that the readings of a sensor show, zero where they show none, in the channel's SI unit.

    It is the distance s of levels of which nine tenths, by readings, lie whole numbers of s apart, within `ON_GRID` of s; tried are the
    lower quartile of the distances of neighbouring levels, then the least.
    """
    readings = channel.values[channel.valid]
    levels, count = np.unique(np.round(readings, 6), return_counts=True)
    if levels.size == 1 and channel.quantity == "temperature" and readings.size >= SWITCHED:
        return _last_digit(float(readings[0]), channel.unit)
    if not 1 < levels.size <= readings.size / MIN_SAMPLES_PER_LEVEL:
        return 0.0
    apart, weight = np.diff(levels), np.minimum(count[1:], count[:-1])
    # the lower quarter, because spikes leave wide gaps between levels, and fillers a few narrow ones
    for step in (float(np.quantile(apart, 0.25, method="lower")), float(apart.min())):
        away = np.abs(apart / step - np.round(apart / step))
        if step > 2e-6 and float(weight @ (away <= ON_GRID)) > 0.9 * float(weight.sum()):
            return step
    return 0.0


def _last_digit(value: float, text: str) -> float:
    """Return the step of the last decimal digit of an SI value written in the unit `text`; zero where it has more than six. [SI]"""
    of = read_unit(text)
    shown = (value - float(of.offset)) / float(of.factor)
    for digits in range(MAX_DECIMALS + 1):
        if abs(shown * 10.0**digits - round(shown * 10.0**digits)) < 1e-6 * 10.0**digits:
            return float(of.factor) * 10.0**-digits
    return 0.0


def unrounded(times: FloatArray, values: FloatArray) -> FloatArray:
    """Return a slow signal (samples,) behind readings `values` (samples,) in steps at `times` (samples,) [s]: lines between their changes.

    A reading changes where the signal passes the middle between two steps; before the first and after the last change it is held. [as
    values]
    """
    change = np.flatnonzero(np.diff(values))
    if not change.size:
        return values
    at = 0.5 * (times[change] + times[change + 1])
    return np.interp(times, at, 0.5 * (values[change] + values[change + 1]))


# ---- readings that are no temperatures: codes that sensors and loggers write in place of one

SENSOR_FAULT_CODES: Final = {-127.0: "sensor lost (-127)", 85.0: "reset of a DS18B20 (85)"}
"""Codes of a common sensor, and what they stand for. [degC]"""
MIN_OVERLOAD_READING: Final = 1e9
"""A reading from it on is the sign of an overload or an open sensor, as 1e9 of a Fluke and 9.9e37 of a Keysight logger; counters of joules
and milliseconds pass a million. [the column's unit]"""
MAX_LEAP_OF_TEMPERATURE: Final = 2.0
"""Distance from the line between its neighbours up to which a known code may be a temperature. [the column's unit]"""
MIN_GAP_OF_BRIEF_CODE: Final = 10.0
"""Distance from all other readings from which a value stands alone that is seldom and has others before and after. [the column's unit]"""
MIN_GAP_OF_CODE: Final = 500.0
"""The same for any value. [the column's unit]"""
SELDOM: Final = 0.1
"""Part of the readings that a value has at most that stands alone and is not far. [-]"""
MIN_OTHER_READINGS: Final = 8
"""Readings besides it without which no value stands alone. [-]"""
MIN_LOOSE: Final = 3.0
"""Distance of a sensor from others of its part from which it may be loose: thermocouples are within 2.5 K (IEC 60584-1, class 2). [K]"""


def codes_of(values: FloatArray, zero: float = -273.15) -> dict[float, str]:
    """Return value -> meaning, of the readings (samples,) of a temperature that are codes of faults.

    Codes are overloads, those of common sensors, values below absolute zero, and values that stand alone: farther from all others than
    these range, with others before and after, since no part with a heat capacity goes there and back between two samples.

    Parameters
    ----------
    values : array (samples,)   In the unit of its column; NaN where a reading is missing.
    zero : float                Absolute zero in that unit.
    """
    finite = values[np.isfinite(values)]
    out = {float(v): "overload or open sensor" for v in np.unique(finite[np.abs(finite) >= MIN_OVERLOAD_READING])}
    readings = finite[np.abs(finite) < MIN_OVERLOAD_READING]
    if not readings.size:
        return out
    out |= {code: words for code, words in SENSOR_FAULT_CODES.items() if np.any(readings == code) and _leaps(readings, code)}
    out |= {float(v): f"below absolute zero ({v:g})" for v in np.unique(readings[readings < zero])}
    rest = readings[~np.isin(readings, list(out))]
    while (code_alone := _alone(rest)) is not None:
        out[code_alone] = f"far from all other readings ({code_alone:g})"
        rest = rest[rest != code_alone]
    return out


def _leaps(values: FloatArray, code: float) -> bool:
    """Whether a value differs from the line between its neighbours: 85 is a fault in a log at 20, and none in one that passes 85."""
    here = np.isin(values, list(SENSOR_FAULT_CODES))
    if here.all():
        return True
    order = np.arange(values.size)
    return bool(np.any(np.abs(np.interp(order, order[~here], values[~here])[values == code] - code) > MAX_LEAP_OF_TEMPERATURE))


def _alone(values: FloatArray) -> float | None:
    """Return the lowest or highest of values (samples,) where it stands alone, see `codes_of`; else None."""
    for end in (float(values.max()), float(values.min())) if values.size else ():
        here = values == end
        others = values[~here]
        if others.size < MIN_OTHER_READINGS:
            continue
        gap = float(np.abs(others - end).min())
        brief = np.mean(here) <= SELDOM and not here[0] and not here[-1]
        if gap > max(float(np.ptp(others)), MIN_GAP_OF_BRIEF_CODE if brief else MIN_GAP_OF_CODE):
            return end
    return None


def strays(channel: Channel) -> dict[float, str]:
    """Return value -> meaning, of the valid readings of a channel that are codes of faults. [the unit of its file]"""
    if channel.quantity != "temperature":
        return {}
    written = channel.values + channel.correction  # a code is what the sensor said, not what a certificate makes of it
    return codes_of(
        np.where(channel.valid, np.round(from_si(written, channel.unit), 6), np.nan), float(from_si(np.zeros(1), channel.unit)[0])
    )


def stray_readings(records: Sequence[Samples]) -> tuple[str, ...]:
    """Return a sentence for each channel with codes of faults, with the step of `prepare` that masks them, and for each loose sensor."""
    out = []
    for r in records:
        for c in r.channels.values():
            codes = strays(c)
            if codes:
                step = ", ".join(f'"{text}"' for text in codes_to_mask(codes, c))
                out.append(
                    CodedText(
                        f"readings of '{c.name}' in '{r.name}' are no temperatures: {', '.join(dict.fromkeys(codes.values()))}. Mask them: "
                        f"prepare = [{{ faults = {{ codes = [{step}] }} }}] of the record.",
                        "record.stray-readings",
                    )
                )
        out += _loose_sensors(r)
    return tuple(out)


def single_pulses(times: FloatArray, values: FloatArray) -> float:
    """Return which share of the pulses of an on/off power has a single reading; NaN where an even log does not show such pulses. [-]

    Pulses are what lies between two crossings of the middle of its range; those of the level that has more single ones count. NaN with
    fewer than `MIN_PULSES`; where intervals are not alike, since a log written by hand or at each change shows all; or where readings are
    not near two levels, the lower below half of the upper, since means have levels between.

    Parameters
    ----------
    times : array (samples,)    [s]
    values : array (samples,)   NaN where there is none.
    """
    rows = np.flatnonzero(np.isfinite(values))
    if rows.size <= 2 * MIN_PULSES:
        return math.nan
    steps, read = np.diff(times[rows]), values[rows]
    low, high = float(read.min()), float(read.max())
    level = (read - low) / ((high - low) or 1.0) - 0.5
    even = np.mean(np.abs(steps / np.median(steps) - 1.0) <= CLEAR) >= MOST_PULSES  # else written by hand, or as it changes
    two_levels = 2.0 * abs(low) < abs(high) and np.mean(np.abs(level) > CLEAR) >= MOST_PULSES  # else means, or a last digit
    shown = np.flatnonzero(np.abs(level) > CLEAR)  # noise of a third level in the middle switches nothing
    lengths = np.diff(shown[1:][np.diff(level[shown] > 0.0)])
    shares = [float(np.mean(p == 1)) for p in (lengths[::2], lengths[1::2]) if p.size >= MIN_PULSES]
    return max(shares, default=math.nan) if even and two_levels else math.nan


def unseen_pulses(times: FloatArray, powers: Mapping[str, FloatArray]) -> Iterator[CodedText]:
    """Yield a sentence for each power that is switched so fast that pulses may lie between two readings: most have a single one.

    Parameters
    ----------
    times : array (samples,)    [s]
    powers : dict               Power or command that is held -> readings (samples,), NaN where there is none.
    """
    for name, values in powers.items():
        if (single := single_pulses(times, values)) >= MOST_PULSES:
            yield CodedText(
                f"{name} switches between {short(np.nanmin(values), 3)} and {short(np.nanmax(values), 3)}, and {100 * single:.0f} % of its "
                f"pulses have a single reading, one in {short(usual_step(times), 3)} s: others may lie between two readings. Its "
                "heat is then not known, and fitted values may be far off. Log it faster, or log its energy or its mean "
                "(samples = 'average'). If no pulse is shorter than that, state prompt = false; if every change has a row, prompt = true.",
                UNSEEN_PULSES,
            )


def _loose_sensors(record: Samples) -> Iterator[CodedText]:
    """Yield a sentence for each of three or more sensors of a part that reads nearer to a boundary than to any other of them.

    Distances are root mean squares over the samples that both have. The others must be nearer to one another, and gradients in a part
    lie between it and its surroundings: such a sensor is nearer to the part. [K]
    """

    def apart(one: Channel, other: Channel) -> float:
        """Return the distance of two channels; infinite where they have no sample in common. [K]"""
        both = one.valid & other.valid
        return float(np.mean((one.values - other.values)[both] ** 2)) ** 0.5 if both.any() else math.inf

    warm = [c for c in record.channels.values() if c.quantity == "temperature"]
    for c in (c for c in warm if c.role == "node"):
        others = [o for o in warm if o.role == "node" and o.target == c.target and o is not c]
        near, room = min(((apart(c, o), o.name) for o in warm if o.role == "boundary"), default=(math.inf, ""))
        away = min((apart(c, o) for o in others), default=math.inf)
        least = max(MIN_LOOSE, near, *(apart(a, b) for a, b in combinations(others, 2)))
        if len(others) > 1 and math.inf > away > least:
            yield CodedText(
                f"'{c.name}' in '{record.name}' is {short(away, 2)} K from the other {len(others)} sensors of '{c.target}' and "
                f"{short(near, 2)} K from '{room}': it may be loose. Remove its channel, or fasten it and test again.",
                "record.loose-sensor",
            )


def open_questions(records: Sequence[Samples]) -> tuple[str, ...]:
    """Return what the owner of the logs should answer first: codes of faults, and the questions of each log."""
    questions = (CodedText(f"record '{r.name}': {question}", code_of(question)) for r in records for question in r.questions)
    return (*stray_readings(records), *dict.fromkeys(questions))


def codes_to_mask(codes: Iterable[float], channel: Channel) -> list[str]:
    """Return codes as texts with the channel's unit, as `prepare` takes them."""
    return [f"{code:.10g} [{channel.unit}]" for code in codes]
