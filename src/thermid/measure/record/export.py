"""A record as text: a CSV log, a summary; and as an xarray data set."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from thermid.files import LOG, replacing
from thermid.measure.amounts import duration_text
from thermid.measure.record.channel import Channel, FloatArray, Samples, even_step, gap_from
from thermid.units import format_value, unit

if TYPE_CHECKING:
    from xarray import Dataset


def from_unit(values: FloatArray, text: str) -> FloatArray:
    """Return SI values of numbers in a unit."""
    of = unit(text)
    return values * float(of.factor) + float(of.offset)


def _texts(values: FloatArray, text: str) -> list[str]:
    """Return SI values as numbers in a unit, short where the short form gives the same SI value again."""
    of = unit(text)
    numbers = ((values - float(of.offset)) / float(of.factor)).tolist()
    texts = [f"{number:.17g}" for number in numbers]
    # the offset of a scale leaves rounding in late decimals; the first form that gives the same SI value again is the one of the file
    for short in ([f"{number:.15g}" for number in numbers], [f"{round(number, 9):.15g}" for number in numbers]):
        same = (from_unit(np.array(list(map(float, short))), text) == values).tolist()
        texts = [brief if good else long for brief, good, long in zip(short, same, texts, strict=True)]
    return texts


def to_csv(record: Samples, path: str | Path) -> None:
    """Write a record as a comma-separated log with units in its header, each channel in the unit of its file, masked samples empty.

    Read again, times and values are the same to one unit in the last place. The hash is the same too when nothing was masked, averaged or
    left out and the numbers had at most 12 digits, 9 of them decimals.
    """
    columns = [_texts(record.times, "s")]
    header = []
    taken = [record.origin.time, *(each.column for each in record.channels.values())]
    for each in record.channels.values():
        # a column that feeds two channels is written twice, under their own names
        header.append(f"{each.column if each.column and taken.count(each.column) == 1 else each.name} [{each.unit}]")
        cells = _texts(np.where(each.valid, each.values, 0.0), each.unit)
        columns.append([cell if good else "" for cell, good in zip(cells, each.valid.tolist(), strict=True)])
    with replacing(path, LOG) as half, half.open("w", encoding="utf-8", newline="") as file:
        file.write(f'"{record.origin.time} [s]"' + ("," if header else ""))
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(header)
        writer.writerows(zip(*columns, strict=True))


def to_xarray(record: Samples) -> Dataset:
    """Return a record as a data set over `time`, SI units in the attributes, masked samples as NaN."""
    import xarray

    data = xarray.Dataset(coords={"time": ("time", record.times, {"units": "s"})})
    for each in record.channels.values():
        words = {
            "quantity": each.quantity,
            "role": each.role,
            "target": each.target,
            "gain": each.gain,
            "noise": each.noise,
            "accuracy": each.accuracy,
        }
        attributes = {"units": si_unit(each), **{key: value for key, value in words.items() if value is not None}}
        data[each.name] = ("time", np.where(each.valid, each.values, np.nan), attributes)
    data.attrs = {"name": record.name, "file": record.origin.file, "sha256": record.origin.sha256, "steps": "\n".join(record.steps)}
    return data


def si_unit(channel: Channel) -> str:
    """Return the SI unit of a channel's values as text, in base units where it has no short name."""
    dimension = unit(channel.unit).dimension
    for short in ("K", "W", "1", "Pa", "V", "A"):
        if unit(short).dimension == dimension:
            return short
    bases = ("m", "kg", "s", "A", "K")
    return " ".join(f"{base}^{power}" if power != 1 else base for base, power in zip(bases, dimension, strict=True) if power)


def headline(record: Samples) -> str:
    """Return name, samples, duration, step and channels in one line."""
    step = f"{record.step:.4g} s" + ("" if even_step(record.times) is not None else " (median, uneven)")
    made = "synthetic, " if record.origin.synthetic else ""
    return (
        f"Record '{record.name}': {made}{record.times.size} samples over {duration_text(record.duration)}, step {step}; "
        f"channels {', '.join(record.channels) or 'none'}"
    )


def summary(record: Samples) -> str:
    """Return a record in words: its size, gaps, origin, channels and steps, a line for each."""
    origin = record.origin
    start = f", from {origin.start}" if origin.start else ""
    lines = [headline(record), f"  origin {origin.file}, {origin.rows} rows, sha256 {origin.sha256[:16]}{start}"]
    intervals = np.diff(record.times)
    limit = gap_from(record.times)
    gaps = np.flatnonzero(intervals > limit)
    if gaps.size:
        worst = int(np.argmax(intervals))
        longest, place = duration_text(float(intervals[worst])), format_value(record.times[worst], "s")
        lines.append(f"  gaps longer than {limit:.4g} s: {gaps.size}, the longest {longest} at {place}")
    lines += [f"  {_channel_line(each)}" for each in record.channels.values()]
    return "\n".join([*lines, *(f"  - {step}" for step in record.steps)])


def _channel_line(channel: Channel) -> str:
    """Return one channel in words."""
    shown = channel.values[channel.valid]
    role = f"{channel.role} {channel.target}" if channel.target else channel.role
    parts = [f"{channel.name}: {channel.quantity}, {role}"]
    if shown.size:
        parts.append(f"{format_value(shown.min(), channel.unit, 4)} to {format_value(shown.max(), channel.unit, 4)}")
    for word, size in (("noise", channel.noise), ("accuracy", channel.accuracy)):
        if size is not None:
            scale = "K" if channel.quantity == "temperature" else channel.unit
            parts.append(f"{word} {format_value(size, scale, 3)}")
    counts = ", ".join(f"{reason} {count}" for reason, count in channel.flags.items())
    masked = channel.valid.size - shown.size
    parts.append(f"{masked} of {channel.valid.size} masked" + (f" ({counts})" if counts else ""))
    if channel.assumed:
        parts.append(f"no unit in the log, read in {channel.unit}")
    return "; ".join(parts)
