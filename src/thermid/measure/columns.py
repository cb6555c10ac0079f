"""Cells to numbers and times. A cell that is neither a number nor a known sign of a missing one stops the reader, with its line."""

from __future__ import annotations

import re
from datetime import datetime, timedelta
from typing import Final

import numpy as np

from thermid.errors import RecordError, ThermidError
from thermid.measure.channel import FloatArray
from thermid.measure.textfile import MISSING, Cells
from thermid.units import require, unit

__all__ = ["decimal_sign", "name_and_unit", "numbers", "read_times"]

_BRACKET = re.compile(r"(?P<name>.*\S)\s*\[(?P<unit>[^\[\]]*)\]\s*\Z")
_FRACTION = re.compile(r"\s*[+-]?(\d+[.,]\d*|[.,]\d+)([eE][+-]?\d+)?\s*\Z")
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?\Z|[+-]?inf(inity)?\Z", re.IGNORECASE | re.ASCII)
_CLOCK = re.compile(r"(\d+):([0-5]\d):([0-5]\d(?:[.,]\d+)?)\Z", re.ASCII)
_HALF_DAY: Final = 43200.0
_UNUSED: Final = "\x1f"  # no text log has it: `textfile` refuses control characters


def name_and_unit(header: str) -> tuple[str, str | None]:
    """Return the name and the unit of a header such as ``T1 [degC]``; None without a bracket."""
    match = _BRACKET.match(header)
    return (match["name"], match["unit"].strip()) if match else (header, None)


def decimal_sign(cells: Cells, given: str | None) -> str:
    """Return '.' or ',': as given, or the one that the numbers of the file use.

    Raises
    ------
    RecordError   When the file has numbers with a comma and numbers with a point.
    """
    if given is not None:
        if given not in (".", ","):
            raise RecordError(f"decimal={given!r} is neither '.' nor ','.", cells.file)
        return given
    if not cells.commas or not any("," in "".join(column) for column in cells.columns):
        return "."
    seen: dict[str, tuple[str, int]] = {}
    for column in cells.columns:
        for sign in {",", "."} - set(seen):
            hits = ((cell, cells.lines[row]) for row, cell in enumerate(column) if sign in cell and _FRACTION.match(cell))
            first = next(hits, None)
            if first is not None:
                seen[sign] = first
    if len(seen) == 2:
        (comma, one), (point, other) = seen[","], seen["."]
        raise RecordError(
            f"the decimal sign is ambiguous: '{comma}' (line {one}) and '{point}' (line {other}). Give decimal=',' or decimal='.'.",
            cells.file,
        )
    return next(iter(seen), ".")


def numbers(cells: tuple[str, ...], decimal: str) -> FloatArray | int:
    """Return the numbers of a column, NaN where one is missing, or the row of the first cell that is text."""
    joined = _UNUSED.join(cells)
    if decimal == ",":
        # a point beside decimal commas would be a thousands sign; it is text here, so that 1.234 is never read as 1.2
        joined = joined.replace(".", "x").replace(",", ".")
    plain = joined.split(_UNUSED) if decimal == "," else cells
    if joined.isascii() and "_" not in joined:
        try:
            return np.array(list(map(float, plain)))
        except ValueError:
            pass  # some cell is empty, which is the usual sign of a missing one
        try:
            return np.array([float(cell) if cell else np.nan for cell in plain])
        except ValueError:
            pass  # another sign, or text
    out = np.full(len(plain), np.nan)
    for row, cell in enumerate(plain):
        word = cell.strip()
        if _NUMBER.match(word):
            out[row] = float(word)
        elif word.lower() not in MISSING and word.lower().lstrip("+-") != "nan":
            return row
    return out


def read_times(cells: Cells, at: int, decimal: str, clock: str | None, unit_text: str | None) -> tuple[FloatArray, str | None]:
    """Return the times of the time column, and its first stamp where it has stamps (times then run from it) [s].

    Seconds, ISO 8601 stamps and clock times HH:MM:SS are told apart by their form; any other stamp needs `clock`, a format of
    `datetime.strptime`.

    Raises
    ------
    RecordError   When a time is missing or cannot be read, or times run back.
    """
    name, column = name_and_unit(cells.header[at])[0], cells.columns[at]
    parsed = numbers(column, decimal) if clock is None else 0
    if isinstance(parsed, int) or np.isnan(parsed).any():
        for row, cell in enumerate(column):
            if cell.strip().lower() in MISSING:
                raise RecordError("this line has no time. Take it out, or mend the log.", cells.where(row, name))
    start: str | None = column[0].strip()
    if clock is None and isinstance(parsed, np.ndarray):
        times, start = parsed * _time_factor(cells, name, unit_text), None
        if unit_text is None:
            _refuse_serial_days(parsed, cells, name)
        odd = np.flatnonzero(~np.isfinite(times))
        if odd.size:
            raise RecordError(f"'{column[odd[0]]}' is no time.", cells.where(int(odd[0]), name))
    elif clock is None and isinstance(parsed, int) and parsed > 0:
        raise RecordError(f"'{column[parsed]}' is text; the lines above it have times in numbers.", cells.where(parsed, name))
    elif clock is None and _CLOCK.match(column[0].strip()):
        times = _clock_times(cells, column, name)
    else:
        times = _stamps(cells, column, name, clock)
    back = np.flatnonzero(np.diff(times) < 0)
    if back.size:
        row = int(back[0]) + 1
        raise RecordError(
            f"time runs back here, from {column[row - 1].strip()} to {column[row].strip()}. "
            "Sort the log, or read its parts as records of their own.",
            cells.where(row, name),
        )
    return times, start


def _time_factor(cells: Cells, name: str, unit_text: str | None) -> float:
    """Return the seconds in one step of the time column's unit."""
    if unit_text is None:
        tail = name.rpartition("_")[2] if "_" in name else ""
        if tail in ("ms", "us", "min", "h"):
            raise RecordError(
                f"its name ends in '_{tail}', and without a unit it would be read in seconds. Give units={{'{name}': '{tail}'}} or 's', or "
                f"write it into the header: '{name} [{tail}]'.",
                cells.where(None, name),
            )
        return 1.0
    try:
        of = unit(unit_text)
        require(of.dimension, "s", unit_text, of.absolute)
    except ThermidError as error:
        raise error.located(cells.where(None, name)) from None
    return float(of.factor)


def _refuse_serial_days(times: FloatArray, cells: Cells, name: str) -> None:
    """Refuse times that look like a spreadsheet's days since 1900: near 45000, and less than an hour apart as days."""
    first, last = float(times[0]), float(times[-1])
    if 25000.0 < first < 80000.0 and 0.0 < last - first < 0.04 * (times.size - 1):
        day = datetime(1899, 12, 30) + timedelta(days=first)
        raise RecordError(
            f"{first:g} looks like a spreadsheet's day ({day:%Y-%m-%d %H:%M}), and would be read in seconds. "
            f"Give units={{'{name}': 'd'}} or 's', or write it into the header: '{name} [d]'.",
            cells.where(0, name),
        )


def _clock_times(cells: Cells, column: tuple[str, ...], name: str) -> FloatArray:
    """Return seconds from the first clock time; a step back of more than half a day passes midnight."""
    out = np.empty(len(column))
    for row, cell in enumerate(column):
        match = _CLOCK.match(cell.strip())
        if match is None:
            raise RecordError(f"'{cell}' is no clock time HH:MM:SS, as the first line has.", cells.where(row, name))
        out[row] = 3600.0 * int(match[1]) + 60.0 * int(match[2]) + float(match[3].replace(",", "."))
    return _past_midnight(out)


def _past_midnight(of_day: FloatArray) -> FloatArray:
    """Return times that go on past midnight, from zero; hours above 23 show a stopwatch, which has no midnight."""
    nights = np.cumsum(np.diff(of_day, prepend=of_day[0]) < -_HALF_DAY)
    days = nights.astype(np.float64) * (2 * _HALF_DAY if of_day.max() < 2 * _HALF_DAY else 0.0)
    times: FloatArray = np.round(of_day + days - of_day[0], 9)
    return times


def _stamps(cells: Cells, column: tuple[str, ...], name: str, clock: str | None) -> FloatArray:
    """Return seconds from the first stamp."""
    stamps: list[datetime] = []
    for row, cell in enumerate(column):
        try:
            stamps.append(datetime.fromisoformat(cell.strip()) if clock is None else datetime.strptime(cell.strip(), clock))
        except ValueError as error:
            if clock is not None:
                raise RecordError(f"'{cell}' does not have the form clock='{clock}' ({error}).", cells.where(row, name)) from None
            hint = "Give its form, for example clock='%d.%m.%Y %H:%M:%S', or clock='%H:%M'."
            raise RecordError(
                f"'{cell}' is no time that is known: seconds, an ISO 8601 stamp, or HH:MM:SS. {hint}", cells.where(row, name)
            ) from None
        if (stamps[row].tzinfo is None) != (stamps[0].tzinfo is None):
            raise RecordError(
                f"'{cell}' and the first stamp differ in that one has a time zone. Write all with it, or none.", cells.where(row, name)
            )
    if clock is not None and not any(sign in clock for sign in ("%d", "%j", "%c", "%x")):
        return _past_midnight(
            np.array([each.hour * 3600.0 + each.minute * 60.0 + each.second + each.microsecond * 1e-6 for each in stamps])
        )
    return np.array([(each - stamps[0]).total_seconds() for each in stamps])
