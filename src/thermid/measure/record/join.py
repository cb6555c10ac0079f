"""Two logs on two clocks as one record."""

from __future__ import annotations

import hashlib
import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from thermid.errors import RecordError
from thermid.measure.record.channel import Channel

if TYPE_CHECKING:
    from thermid.measure.record.record import Record


@dataclass(frozen=True)
class SecondClock:
    """A clock beside a record's own, known within ranges only: a time t on it is ``offset + rate t``. A fit finds both.

    Parameters
    ----------
    channels : tuple of str         What was logged on it.
    offset, rate : (low, high)      Where they are looked for. [s, -]
    at : (offset, rate)             Those at which the record holds these channels. [s, -]
    times : (first, last)           Of the log with the other clock, to which the fit counts. [s]
    step : float                    Median interval of the log on this clock. [s]
    """

    channels: tuple[str, ...]
    offset: tuple[float, float]
    rate: tuple[float, float]
    at: tuple[float, float]
    times: tuple[float, float]
    step: float


def joined(first: Record, second: Record, offset: float | tuple[float, float], rate: float | tuple[float, float]) -> Record:
    """Return both records' channels on the times of both.

    A time t of the second record's clock is ``offset + rate t`` on the first one's. [s] Where either is a range, the record stands in its
    middle and a fit finds it.

    Raises
    ------
    RecordError   When the rate is not above zero, a channel is in both, the logs do not overlap, or a range is none.
    """
    offsets, rates = (_range(given, name, second.name) for given, name in ((offset, "offset"), (rate, "rate")))
    at = 0.5 * sum(offsets), 0.5 * sum(rates)
    made = _at(first, second, *at, rates[0])
    if offsets[0] == offsets[1] and rates[0] == rates[1]:
        return made
    if first.second is not None or second.second is not None:
        raise RecordError("one of them holds a clock already that a fit has to find. One at a time can be left open.", first.name)
    step = float(np.median(np.diff(second.times)))
    clock = SecondClock(tuple(second.channels), offsets, rates, at, (float(first.times[0]), float(first.times[-1])), step)
    between = f"between {offsets[0]:.6g} and {offsets[1]:.6g} s late and {rates[0]:.6g} to {rates[1]:.6g} times as slow, by the fit"
    return replace(made, second=clock, steps=(*made.steps[:-1], f"joined with {second.origin.file}, whose clock is {between}"))


def _range(given: float | tuple[float, float], name: str, where: str) -> tuple[float, float]:
    low, high = given if isinstance(given, tuple | list) else (given, given)
    if not (math.isfinite(low) and math.isfinite(high) and low <= high):
        raise RecordError(f"the range {low:g} .. {high:g} of its clock's {name} must go from a lower to a higher number.", where)
    return float(low), float(high)


def _at(first: Record, second: Record, offset: float, rate: float, slowest: float) -> Record:
    if not slowest > 0:
        raise RecordError(f"a clock runs forward; its rate {slowest:g} must be above zero.", second.name)
    both = sorted(set(first.channels) & set(second.channels))
    if both:
        raise RecordError(f"'{both[0]}' is a channel of both logs. Rename it in one of them.", f"{first.name}, {second.name}")
    there = offset + rate * second.times
    if there[-1] <= first.times[0] or there[0] >= first.times[-1]:
        raise RecordError(
            f"the logs do not overlap: {there[0]:.6g} .. {there[-1]:.6g} s and {first.times[0]:.6g} .. {first.times[-1]:.6g} s. "
            "Give another offset.",
            f"{first.name}, {second.name}",
        )
    times = np.union1d(first.times, there)
    channels: dict[str, Channel] = {}
    for record, own in ((first, first.times), (second, there)):
        at = np.searchsorted(times, own)
        for name, channel in record.channels.items():
            values, valid = np.full(times.size, np.nan), np.zeros(times.size, dtype=bool)
            values[at], valid[at] = channel.values, channel.valid
            masks = {}
            for reason, mask in channel.masks.items():
                masks[reason] = np.zeros(times.size, dtype=bool)
                masks[reason][at] = mask
            channels[name] = replace(channel, values=values, valid=valid, masks=masks)
    identity = hashlib.sha256(f"{first.origin.sha256} {second.origin.sha256}".encode()).hexdigest()
    origin = replace(
        first.origin,
        file=f"{first.origin.file} + {second.origin.file}",
        sha256=identity,
        columns=(*first.origin.columns, *second.origin.columns),
        rows=first.origin.rows + second.origin.rows,
        synthetic=first.origin.synthetic or second.origin.synthetic,
    )
    step = f"joined with {second.origin.file}, whose clock is {offset:.6g} s late and {rate:.8g} times as slow"
    return replace(first, times=times, channels=channels, origin=origin, steps=(*first.steps, *second.steps, step))
