"""A record: the channels of one log on one time axis. Every method returns a new record; the samples read are never changed."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from thermid.arguments import takes_objects
from thermid.errors import NameNotFoundError, RecordError, nearest
from thermid.measure.record import export, flags, join, prepare, sensor
from thermid.measure.record.channel import BoolArray, Channel, FloatArray, Origin, digest, frozen
from thermid.measure.record.join import SecondClock
from thermid.measure.record.steps import run_steps
from thermid.measure.record.windows import usual_step

if TYPE_CHECKING:
    from xarray import Dataset

    from thermid.measure.record.steady import SteadyPoint


class Table(NamedTuple):
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


@dataclass(frozen=True, eq=False, repr=False)
class Record:
    """Measured channels on one time axis.

    Parameters
    ----------
    name : str                       Its name.
    times : array (samples,)         Strictly increasing times. [s]
    channels : mapping to Channel    Channels by name.
    origin : Origin                  Where the samples came from; kept by every copy.
    steps : tuple of str             What was done to the samples, in words and numbers.
    second : SecondClock or None     A clock beside its own that a fit has yet to find.

    Raises
    ------
    RecordError   When times do not increase, lengths differ, or two channels have one target.
    """

    name: str
    times: FloatArray
    channels: Mapping[str, Channel]
    origin: Origin
    steps: tuple[str, ...] = ()
    second: SecondClock | None = None

    def __post_init__(self) -> None:
        """Check the channels against the times and each other."""
        where = f"record '{self.name}'"
        times = frozen(self.times, np.float64)
        if times.ndim != 1 or times.size < 2 or not np.all(np.isfinite(times)):
            raise RecordError(f"its times have shape {times.shape}; at least two finite times in one row are needed.", where)
        back = np.flatnonzero(np.diff(times) <= 0)
        if back.size:
            at = int(back[0])
            raise RecordError(f"its times do not increase: {times[at]:g} s is followed by {times[at + 1]:g} s (sample {at + 2}).", where)
        taken: dict[tuple[str, str], str] = {}
        for key, channel in self.channels.items():
            if key != channel.name:
                raise RecordError(f"channel '{channel.name}' stands under the name '{key}'. Use one name.", where)
            if channel.values.size != times.size:
                raise RecordError(f"channel '{key}' has {channel.values.size} samples for {times.size} times.", where)
            if channel.target is not None:
                # one node may be measured and prescribed for, but not measured twice under one role
                kind = "load" if channel.role == "command" else channel.role
                other = taken.setdefault((kind, channel.target), key)
                if other != key:
                    raise RecordError(
                        f"channels '{other}' and '{key}' are both bound to {kind} '{channel.target}'. "
                        "Bind one of them, or give the model a node for each sensor.",
                        where,
                    )
        object.__setattr__(self, "times", times)
        object.__setattr__(self, "channels", dict(self.channels))

    @classmethod
    def from_arrays(cls, name: str, times: ArrayLike, channels: Mapping[str, ArrayLike | Channel], *, synthetic: bool = True) -> Record:
        """Return a record of samples made in Python, marked as synthetic.

        Parameters
        ----------
        name : str               Its name.
        times : array (samples,) Times. [s]
        channels : mapping       Arrays of temperatures [K], or whole `Channel` values, by name.
        synthetic : bool         Set it False for samples that were measured and read by other means.
        """
        made = {key: each if isinstance(each, Channel) else Channel.of(key, each, column=key) for key, each in channels.items()}
        axis = np.asarray(times, dtype=np.float64)
        sha = digest([("time", axis), *((key, each.values) for key, each in made.items())])
        origin = Origin(name, sha, None, ("time", *made), axis.size, "time", synthetic)
        return cls(name, axis, made, origin)

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
        if name not in self.channels:
            known = ", ".join(self.channels) or "none"
            raise NameNotFoundError(f"no channel '{name}'; it has {known}.{nearest(name, self.channels)}", f"record '{self.name}'")
        return self.channels[name]

    __getitem__ = channel

    def select(self, *names: str) -> Record:
        """Return the record with these channels only."""
        return replace(self, channels={name: self.channel(name) for name in names})

    def with_channels(self, *channels: Channel) -> Record:
        """Return the record with these channels added, or in place of those of the same name."""
        return replace(self, channels={**self.channels, **{each.name: each for each in channels}})

    def with_sensor(self, name: str, **keys: object) -> Record:
        """Return the record with more said of a channel's sensor, as a campaign says it: ``lag="20 [s]"``, ``certificate={...}``.

        Raises
        ------
        RecordError   When a key is unknown or says something by half.
        """
        where = f"record '{self.name}', {name}"
        for key in keys:
            if key not in sensor.KEYS:
                raise RecordError(f"no key '{key}'; there are {', '.join(sensor.KEYS)}.{nearest(key, sensor.KEYS)}", where)
        certificate = sensor.SensorCertificate.read(keys["certificate"], f"{where}, certificate") if "certificate" in keys else None
        made, notes = sensor.worn(self.channel(name), sensor.SensorPart.read(keys, where), certificate, where)
        return replace(self, channels={**self.channels, name: made}, steps=(*self.steps, *notes))

    def trim(self, start: str | float = "start", end: str | float = "end") -> Record:
        """Return the samples from `start` to `end`, both included; texts such as ``"2 [s]"``, "start", "end", or seconds."""
        return prepare.trim(self, start, end)

    def resample(self, step: str | float, max_gap: str | float | None = None, *, switches: bool = False) -> Record:
        """Return the record on an even grid, with the instants at which a command changes kept if asked; see `prepare.resample`."""
        return prepare.resample(self, step, max_gap, switches=switches)

    def median(self, window: str | float, *, powers: bool = False) -> Record:
        """Return temperatures (and powers, if asked) through a centred moving median; see `prepare.median`."""
        return prepare.median(self, window, powers=powers)

    def filter(self, window: str | float, *, powers: bool = False) -> Record:
        """Return temperatures (and powers, if asked) through a zero-phase low-pass; see `prepare.low_pass_filter`."""
        return prepare.low_pass_filter(self, window, powers=powers)

    def flag_spikes(self, threshold: str | float, window: str | float, channels: Sequence[str] | None = None) -> Record:
        """Return the record with single wild temperatures masked; see `flags.flag_spikes`."""
        return flags.flag_spikes(self, threshold, window, channels)

    def flag_faults(
        self,
        codes: Iterable[str | float] = flags.FAULT_CODES,
        low: str | float | None = None,
        high: str | float | None = None,
        jump: str | float = "2 [K]",
        channels: Sequence[str] | None = None,
    ) -> Record:
        """Return the record with fault codes and temperatures outside a range masked; see `flags.flag_faults`."""
        return flags.flag_faults(self, codes, low, high, jump, channels)

    def mask(self, channel: str, start: str | float = "start", end: str | float = "end", reason: str = "masked by hand") -> Record:
        """Return the record with a stretch of a channel masked, both ends included."""
        return flags.mask(self, channel, start, end, reason)

    def masked_where(self, channel: str, where: BoolArray, reason: str) -> Record:
        """Return the record with the samples of a channel masked where an array (samples,) is True."""
        return flags.masked_where(self, channel, where, reason)

    def shift_start(self) -> Record:
        """Return the record with times from zero."""
        return prepare.shift_start(self)

    @takes_objects
    def joined(self, other: Record, offset: float | tuple[float, float] = 0.0, rate: float | tuple[float, float] = 1.0) -> Record:
        """Return the channels of both records: a time t on the other's clock is ``offset + rate t`` on this one's. [s]

        Pairs are ranges, within which `calibrate` finds them.
        """
        return join.joined(self, other, offset, rate)

    def steady(
        self,
        start: str | float = "start",
        end: str | float = "end",
        *,
        tau: object | None = None,
        limit: str | float = "1 [K/h]",
        name: str = "",
    ) -> SteadyPoint:
        """Return the mean of a settled stretch with its uncertainty, corrected for stored heat and drift; see `steady.steady_point`."""
        from thermid.measure.record.steady import steady_point

        return steady_point(self, start, end, tau, limit, name)

    def prepare(self, steps: Iterable[Mapping[str, object]]) -> Record:
        """Return the record after the steps of a campaign file, such as ``[{median = "4 [s]"}]``; see `steps.run_steps`."""
        return run_steps(self, steps)

    def table(self, name: str, max_gap: str | float | None = None) -> Table:
        """Return a channel as a signal over the whole record.

        Masked stretches are bridged: by a straight line, or by holding the last value of a held channel. Before the first and after the
        last valid sample the nearest one is taken. An interval longer than `max_gap` counts as bridged too. [s]
        """
        channel = self.channel(name).checked()
        gap = prepare.gap_limit(self.times, channel.valid, 0.0, max_gap)
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
        return Table(self.times[keep], values[keep], float(1.0 - steps[covered].sum() / steps.sum()))

    def to_csv(self, path: str | Path) -> None:
        """Write the record as a log that `read_record` reads; see `export.to_csv`."""
        export.to_csv(self, path)

    def to_xarray(self) -> Dataset:
        """Return the record as an `xarray.Dataset` in SI units, masked samples as NaN."""
        return export.to_xarray(self)

    def summary(self) -> str:
        """Return samples, duration, step, gaps, channels with their masked counts, and steps, as text."""
        return export.summary(self)

    @property
    def step(self) -> float:
        """Median interval [s]."""
        return usual_step(self.times)

    def __repr__(self) -> str:
        """One line: name, size, channels."""
        return export.headline(self)
