"""Masking of samples that are no temperatures: spikes, fault codes, stretches named by hand. A masked sample keeps its number."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Final

import numpy as np

from thermid.errors import RecordError
from thermid.measure.amounts import amount
from thermid.measure.record import windows
from thermid.measure.record.channel import BoolArray, Channel
from thermid.measure.record.prepare import filtered, noted, stretch, window_of
from thermid.units import TEMPERATURE, format_value

if TYPE_CHECKING:
    from thermid.measure.record.record import Record

FAULT_CODES: Final = ("85 [degC]", "-127 [degC]")
"""What a DS18B20 gives after power-on (note to table 1 of its data sheet), and what its usual driver gives when the sensor is gone."""


def _named(record: Record, names: Sequence[str] | None, what: str) -> list[Channel]:
    """Return the named temperature channels, or all of them."""
    if names is None:
        return filtered(record, False, what)
    if isinstance(names, str):
        names = [names]
    for each in map(record.channel, names):
        if each.quantity != "temperature":
            raise RecordError(f"channel '{each.name}' is a {each.quantity}, not a temperature.", what)
    return [record.channel(name) for name in names]


def _sensor_step(channel: Channel) -> float:
    """Return the step of a sensor: its resolution, or the usual difference between the levels that it took, or zero.

    A record that takes each value twice or more on average is one of levels.
    """
    if channel.resolution is not None:
        return channel.resolution
    samples = channel.values[channel.valid]
    levels = np.unique(np.round(samples, 9))  # a level converted from degC may differ in its last digit
    if not 1 < levels.size <= samples.size / 2:
        return 0.0
    # the lower quarter, because spikes leave wide gaps between levels, and fillers a few narrow ones
    return float(np.quantile(np.diff(levels), 0.25, method="lower"))


def flag_spikes(record: Record, threshold: str | float, window: str | float, channels: Sequence[str] | None = None) -> Record:
    """Return the record with temperatures masked that stand out from the moving median (Hampel's identifier).

    A sample is a spike when it is further from the median of its window than `threshold`: a temperature difference such as ``"3 [K]"``,
    or a number of robust standard deviations of the window. A quantised sensor shows no
    deviation smaller than half a step, so it is never taken below that.

    Raises
    ------
    RecordError   When window or threshold are not above zero, the window is longer than the record, or nothing valid remains.
    """
    width = window_of(record, window, "spikes")
    absolute = isinstance(threshold, str)
    limit = amount(threshold, "K" if absolute else "1", "spikes, threshold")
    if limit <= 0:
        raise RecordError(f"{threshold!r} is not above zero.", "spikes, threshold")
    made = []
    for each in _named(record, channels, "spikes"):
        centre, spread = windows.hampel(record.times, each.values, each.valid, width)
        # a median deviation of zero only says that half the window lies in one level of the sensor, half a step either side
        allowed = limit if absolute else limit * np.maximum(spread, 1.4826 * 0.5 * _sensor_step(each))
        made.append(each.masked(np.abs(each.values - centre) > allowed, "spike"))
    counts = ", ".join(f"{new.name} {_lost(record.channels[new.name], new)}" for new in made)
    unit = "K" if absolute else "robust standard deviations"
    return noted(record, f"spikes: masked {counts}; further than {limit:g} {unit} from the median of {width:g} s", *made)


def _lost(old: Channel, new: Channel) -> int:
    """Count the samples that were valid and are not."""
    return int(np.count_nonzero(old.valid & ~new.valid))


def flag_faults(
    record: Record,
    codes: Iterable[str | float],
    low: str | float | None,
    high: str | float | None,
    jump: str | float,
    channels: Sequence[str] | None,
) -> Record:
    """Return the record with fault codes, and temperatures outside a range, masked as 'fault'.

    85 degC is also a temperature that a sensor can pass. A code is therefore a fault only where it differs by more than `jump` from the
    line between the nearest samples that are no codes.

    Parameters
    ----------
    record : Record               What was measured.
    codes : texts or floats       Temperatures that stand for faults, ``"85 [degC]"``, or [K].
    low, high : text or float     Lowest and highest temperature that can be, or None. [K]
    jump : text or float          Difference to the neighbours from which a code is a fault. [K]
    channels : sequence of str    Channels to look at; all temperatures by default.
    """
    known = [amount(code, TEMPERATURE, "faults, codes") for code in codes]
    bottom = -np.inf if low is None else amount(low, TEMPERATURE, "faults, low")
    top = np.inf if high is None else amount(high, TEMPERATURE, "faults, high")
    if bottom >= top:
        raise RecordError(f"low ({low}) is not below high ({high}).", "faults")
    least = amount(jump, "K", "faults, jump")
    made = []
    for each in _named(record, channels, "faults"):
        outside = each.valid & ((each.values < bottom) | (each.values > top))
        read = each.values + each.correction  # a code is what the sensor said, not what a certificate makes of it
        code = each.valid & np.any([np.abs(read - value) < 1e-6 for value in known] or [np.zeros_like(each.valid)], axis=0)
        good = each.valid & ~outside & ~code
        if good.any():
            code &= np.abs(each.values - np.interp(record.times, record.times[good], each.values[good])) > least
        made.append(each.masked(outside | code, "fault"))
    counts = ", ".join(f"{new.name} {_lost(record.channels[new.name], new)}" for new in made)
    listed = ", ".join(format_value(value, "degC") for value in known) or "none"
    limits = "".join(f", {word} {format_value(value, 'degC')}" for word, value in (("low", bottom), ("high", top)) if np.isfinite(value))
    return noted(record, f"faults: masked {counts}; codes {listed}{limits}", *made)


def mask(record: Record, channel: str, start: str | float, end: str | float, reason: str) -> Record:
    """Return the record with a stretch of one channel masked, both ends included."""
    each = record.channel(channel)
    inside, text = stretch(record, start, end, f"mask of '{channel}'")
    new = each.masked(inside, reason)
    return noted(record, f"mask: {channel} from {text} ({_lost(each, new)} samples), {reason}", new)


def masked_where(record: Record, channel: str, where: BoolArray, reason: str) -> Record:
    """Return the record with the samples of one channel masked where an array (samples,) is True."""
    each = record.channel(channel)
    chosen = np.asarray(where)
    if chosen.dtype != np.bool_ or chosen.shape != record.times.shape:
        raise RecordError(
            f"an array of {record.times.size} truth values is needed; this one has shape {chosen.shape} and type {chosen.dtype}.",
            "masked_where",
        )
    new = each.masked(chosen, reason)
    return noted(record, f"mask: {channel}, {_lost(each, new)} samples, {reason}", new)
