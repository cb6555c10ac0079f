"""Preparation of a record: each function returns a new record with its step noted in words. The samples read are never changed.

Filters act on temperatures. A command holds between its samples, so no filter touches it; a power is filtered only when asked.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from thermid.errors import RecordError
from thermid.measure.amounts import duration_text, positive_seconds, seconds
from thermid.measure.record import windows
from thermid.measure.record.channel import BoolArray, Channel, FloatArray
from thermid.units import format_value

if TYPE_CHECKING:
    from thermid.measure.record.record import Record


def noted(record: Record, text: str, *changed: Channel) -> Record:
    """Return the record with changed channels and one more step."""
    channels = {**record.channels, **{each.name: each for each in changed}}
    return replace(record, channels=channels, steps=(*record.steps, text))


def _moment(record: Record, given: object, what: str) -> float:
    """Return a time on the record's axis [s]."""
    if isinstance(given, str) and given.strip() in ("start", "end"):
        return float(record.times[0 if given.strip() == "start" else -1])
    try:
        return seconds(given, what)
    except RecordError as error:
        raise RecordError(f"{error.message} 'start' and 'end' are known too.", error.where) from None


def stretch(record: Record, start: object, end: object, what: str) -> tuple[BoolArray, str]:
    """Return the samples from start to end, and the stretch in words.

    Raises
    ------
    RecordError   When the end is not after the start, or no sample lies between.
    """
    low, high = _moment(record, start, what), _moment(record, end, what)
    text = f"{format_value(low, 's')} to {format_value(high, 's')}"
    if high < low:
        raise RecordError(f"its end lies before its start: {text}.", what)
    # a time written with few digits must still meet the sample that it names
    near = 1e-6 * windows.usual_step(record.times)
    inside = (record.times >= low - near) & (record.times <= high + near)
    if not inside.any():
        axis = f"{format_value(record.times[0], 's')} to {format_value(record.times[-1], 's')}"
        raise RecordError(f"no sample lies from {text}; record '{record.name}' runs from {axis}.", what)
    return inside, text


def within_log(record: Record, time: object, what: str) -> None:
    """Refuse the time of a question that lies beyond the end of a log.

    Raises
    ------
    RecordError   With where the log ends.
    """
    asked, last = _moment(record, time, what), float(record.times[-1])
    if asked > last + windows.usual_step(record.times):
        raise RecordError(f"nothing was logged at {duration_text(asked)}; the log ends at {duration_text(last)}. Ask for 'end'.", what)


def trim(record: Record, start: str | float, end: str | float) -> Record:
    """Return the samples from start to end, both included; times stay as they are.

    Raises
    ------
    RecordError   When fewer than two samples remain, or a channel keeps no valid one.
    """
    inside, text = stretch(record, start, end, "trim")
    kept = int(inside.sum())
    if kept < 2:
        raise RecordError(f"only {kept} sample lies from {text}; two are needed.", "trim")
    channels = {name: each.taken(inside) for name, each in record.channels.items()}
    steps = (*record.steps, f"trim: {text}, {kept} of {inside.size} samples kept")
    return replace(record, times=record.times[inside], channels=channels, steps=steps)


def shift_start(record: Record) -> Record:
    """Return the record with times from zero."""
    first = float(record.times[0])
    return replace(record, times=record.times - first, steps=(*record.steps, f"shift_start: {first:.6g} s taken from all times"))


def window_of(record: Record, given: object, what: str) -> float:
    """Return a window that fits into the record [s]."""
    window = positive_seconds(given, f"{what}, window")
    if window > record.duration:
        raise RecordError(f"{window:g} s is longer than record '{record.name}', which lasts {record.duration:g} s.", f"{what}, window")
    return window


def filtered(record: Record, powers: bool, what: str) -> list[Channel]:
    """Return the channels that a filter acts on: temperatures, and powers when asked."""
    chosen = [each for each in record.channels.values() if each.quantity == "temperature" or (powers and each.quantity == "power")]
    if not chosen:
        raise RecordError(f"record '{record.name}' has no temperature channel to act on.", what)
    return chosen


def median(record: Record, window: str | float, *, powers: bool = False) -> Record:
    """Return temperatures through a moving median, centred in time, of the valid samples within half a window either side.

    At the ends the window is cut; there a slope leaves an error of at most a quarter of the window times the slope. Masked samples stay
    masked.

    Raises
    ------
    RecordError   When the window is not above zero or longer than the record.
    """
    width = window_of(record, window, "median")
    chosen = filtered(record, powers, "median")
    made = [
        replace(each, values=np.where(each.valid, windows.moving_median(record.times, each.values, each.valid, width), each.values))
        for each in chosen
    ]
    return noted(record, f"median: centred window of {width:g} s on {', '.join(each.name for each in chosen)}", *made)


def low_pass_filter(record: Record, window: str | float, *, powers: bool = False) -> Record:
    """Return temperatures through a second-order Butterworth low-pass, run forward and backward: no shift in time.

    `window` is the period at which half the amplitude remains. Masked stretches of up to a window are bridged for the filter and stay
    masked; longer ones split the signal.

    Raises
    ------
    RecordError   When times are uneven, or the window is not above two steps or longer than the record.
    """
    width = window_of(record, window, "filter")
    chosen = filtered(record, powers, "filter")
    step = windows.even_step(record.times)
    if step is None:
        intervals = np.diff(record.times)
        raise RecordError(
            f"the times of record '{record.name}' are uneven (intervals from {intervals.min():g} to {intervals.max():g} s); "
            f"this filter needs an even grid. Resample first, for example to '{windows.usual_step(record.times):.3g} [s]', or use median.",
            "filter",
        )
    if width <= 2 * step:
        raise RecordError(f"{width:g} s is not above two steps of {step:g} s, so there is nothing to filter out.", "filter, window")
    made = [replace(each, values=windows.low_pass(each.values, each.valid, step, width)) for each in chosen]
    names = ", ".join(each.name for each in chosen)
    text = f"filter: zero-phase Butterworth low-pass of second order, half amplitude at {width:g} s, on {names}"
    return noted(record, text, *made)


def gap_limit(times: FloatArray, valid: BoolArray, step: float, max_gap: str | float | None) -> float:
    """Return the longest interval that is bridged [s].

    It is as given, or else five times what nine of ten intervals between valid samples reach, and never less than two steps.
    """
    if max_gap is not None:
        return positive_seconds(max_gap, "max_gap")
    return max(windows.gap_from(times[valid]), 2.0 * step)


def resample(record: Record, step: str | float, max_gap: str | float | None = None, *, switches: bool = False) -> Record:
    """Return the record on an even grid from its first time.

    Powers and commands hold their last sample; all else runs straight between valid samples. Nothing is filled in across more than
    `max_gap` (by default see `gap_limit`): such samples are masked as 'gap'. A coarser grid
    keeps the noise of single samples, so filter first.

    A power or command that changes between two grid times would seem to change at the later one. With `switches` the instants of such
    changes are kept as times of their own, at which all else is masked as 'switch'; the grid is then no longer even.

    Raises
    ------
    RecordError   When the step is not above zero or longer than the record, or a channel keeps no valid sample.
    """
    width = window_of(record, step, "resample")
    count = int(np.floor(record.duration / width + 1e-9)) + 1
    even = record.times[0] + width * np.arange(count)
    grid = np.union1d(even, _switches(record, even[-1])) if switches else even
    regular = np.isin(grid, even)
    made: dict[str, Channel] = {}
    for each in record.channels.values():
        law = windows.hold if each.held else windows.interpolate
        each.checked()
        values, valid = law(record.times, each.values, each.valid, grid, gap_limit(record.times, each.valid, width, max_gap))
        masks = {"gap": ~valid} if each.held else {"gap": ~valid & regular, "switch": ~regular}
        made[each.name] = replace(each, values=values, valid=valid & (regular | each.held), masks=masks).checked()
    text = f"resample: {record.times.size} samples to {count} at {width:g} s; powers and commands held, others linear"
    text += f"; {grid.size - count} instants of their changes kept" if switches else ""
    gaps = ", ".join(f"{each.name} {each.flags['gap']}" for each in made.values() if "gap" in each.flags)
    raw = not any(done.startswith(("filter", "median")) for done in record.steps) and width > 2 * windows.usual_step(record.times)
    text += (f"; masked as gaps: {gaps}" if gaps else "") + ("; no filter before it, so single samples were picked" if raw else "")
    return replace(record, times=grid, channels=made, steps=(*record.steps, text))


def _switches(record: Record, last: float) -> FloatArray:
    """Return the times up to `last` at which a held channel has another value than before [s]."""
    out = np.zeros(0)
    for each in record.channels.values():
        if each.held:
            times, values = record.times[each.valid], each.values[each.valid]
            out = np.union1d(out, times[1:][np.diff(values) != 0])
    return out[out <= last]
