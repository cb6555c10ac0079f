"""Two logs on two clocks as one record."""

from __future__ import annotations

import hashlib
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from thermid.errors import RecordError
from thermid.measure.channel import Channel

if TYPE_CHECKING:
    from thermid.measure.record import Record

__all__ = ["joined"]


def joined(first: Record, second: Record, offset: float, rate: float) -> Record:
    """Return both records' channels on the times of both.

    A time t of the second record's clock is ``offset + rate t`` on the first one's. [s]

    Raises
    ------
    RecordError   When the rate is not above zero, a channel is in both, or the logs do not overlap.
    """
    if not rate > 0:
        raise RecordError(f"a clock runs forward; its rate {rate:g} must be above zero.", second.name)
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
