"""Times of a log: which column holds them, and what its cells mean. Where two readings of a stamp give different times, it is refused."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Final

import numpy as np

from thermid.base.errors import CodedText, NameNotFoundError, RecordError, errors_at
from thermid.base.units import DAY, HOUR, MINUTE, duration_text, require, unit
from thermid.measure._readers.columns import find_column, numbers
from thermid.measure._readers.headers import COUNTED, DATED, MISSING, TIME_NAMES, is_time_name, name_and_unit, plainly, spelt
from thermid.measure._readers.questions import begins_again
from thermid.measure._readers.textfile import Cells
from thermid.measure._record.channel import FloatArray

SPREADSHEET_EPOCH: Final = datetime(1899, 12, 30)
MATLAB_DAYS: Final = (715000.0, 770000.0, 693960.0)
"""Days since year 0 of logs, from 1957 to 2108, and that of `SPREADSHEET_EPOCH`."""
_SINCE_1970: Final = (9.4e8, 2.2e9)
"""Seconds since 1970 from October 1999 to September 2039; a thousand, a million or a milliard times as much are ms, us or ns."""
_EPOCHS: Final = (("s", 1.0), ("ms", 1e3), ("us", 1e6), ("ns", 1e9))
_LONGEST: Final = 20.0 * 365.25 * DAY
"""A log that is longer was not read in its own unit. [s]"""
_SLOW: Final = 600.0
"""Time between samples above which a time column without a unit is remarked on. [s]"""
_FAST: Final = 1e-3
"""Time between samples below which no temperature says anything new. [s]"""
COMPACT: Final = re.compile(r"(?:19|20)\d\d(?:0[1-9]|1[0-2])(?:0[1-9]|[12]\d|3[01])(?:[01]\d|2[0-3])[0-5]\d[0-5]\d\Z", re.ASCII)
"""Stamps of 14 digits without signs between them, 20260305095800; no time since 1970 has as many digits."""
CLOCK: Final = re.compile(r"(\d+):([0-5]\d):([0-5]\d(?:[.,]\d+)?)\Z", re.ASCII)
HALF_DAY_CLOCK: Final = re.compile(r"(\d{1,2}):([0-5]\d)(?::([0-5]\d(?:[.,]\d+)?))?\s*([AaPp])\.?\s?[Mm]\.?\Z", re.ASCII)
MINUTES_CLOCK: Final = re.compile(r"([01]?\d|2[0-3]):([0-5]\d)()\Z", re.ASCII)
"""Times of day without seconds; from 0:00 on they may be minutes and seconds of a stopwatch as well."""
_ZONE: Final = r"(?:\s*(?P<zone>Z|UTC|GMT|[+-]\d\d:?\d\d))?"
_HOURS: Final = (
    r"(?:[T, ]+(?P<h>\d{1,2}):(?P<m>[0-5]\d)(?::(?P<s>[0-5]\d)(?:[.,:](?P<f>\d{1,9}))?)?"
    r"\s*(?:(?P<half>[AaPp])\.?\s?[Mm]\.?)?" + _ZONE + r")?\Z"
)
NUMERIC: Final = re.compile(r"(?P<a>\d{1,4})(?P<sign>[/.-])(?P<b>\d{1,2})(?P=sign)(?P<c>\d{1,4})\.?" + _HOURS, re.ASCII)
_WORD: Final = r"(?P<word>[A-Za-zÀ-ÿ]{3,10})\.?"
_NAMED: Final = re.compile(r"(?P<a>\d{1,2})[ ./-]+" + _WORD + r"[ ,./-]+(?P<c>\d{4}|\d\d)" + _HOURS)
_AMERICAN: Final = re.compile(_WORD + r" (?P<a>\d{1,2}),? (?P<c>\d{4})" + _HOURS)
_MONTHS: Final = {
    name: month
    for month, names in enumerate(
        "jan ene|feb fev|mar mär mrz|apr abr avr|may mai|jun|jul|aug ago aoû|sep set|oct okt out|nov|dec dez dic déc".split("|"), 1
    )
    for name in names.split()
}
ORDERS: Final = {"day/month/year": ("c", "b", "a"), "month/day/year": ("c", "a", "b"), "year/month/day": ("a", "b", "c")}
"""Which of the three numbers of a stamp are year, month and day."""


@dataclass(frozen=True)
class Clock:
    """The time column of a log, or its date and time in two columns.

    Parameters
    ----------
    places : tuple of int   Places of its columns: one, or that of the date and that of the time.
    name : str              Name without unit.
    header : str            As written.
    texts : sequence        Cells; date and time joined by a space.
    unit : str or None      Unit of the header.
    """

    places: tuple[int, ...]
    name: str
    header: str
    texts: Sequence[str]
    unit: str | None


@dataclass(frozen=True, eq=False)
class Times:
    """Times of a log.

    Parameters
    ----------
    values : array (samples,)   Times; from the first stamp where the log has stamps or times since 1970. [s]
    start : str or None         First stamp as written; of times since 1970 the date they stand for.
    notes : tuple of str        Remarks for a reader.
    kind : str                  How the cells were read, in words.
    zone : str                  Time zone, where the log names one.
    """

    values: FloatArray
    start: str | None
    notes: tuple[str, ...] = ()
    kind: str = "seconds"
    zone: str = ""


def clock_column(cells: Cells, wanted: str | None) -> Clock:
    """Return the time column: the one named, else by its name, else the only one whose cells are stamps.

    Raises
    ------
    NameNotFoundError   When it is not there, or none is named and none is clear.
    RecordError         When several could be it.
    """
    names = [name_and_unit(header)[0] for header in cells.header]
    dates, clocks = _kinds(cells)
    if wanted is not None:
        at = find_column(cells.header, wanted, f"{cells.file}, time")
    elif cells.time:
        at = names.index(cells.time) if cells.time in names else 0  # first in every format that states it; a damaged unit may join its name
    else:
        at = _by_name_or_content(cells, names, dates, clocks)
        stamps = _stamp_columns(cells)
        # a counter of the board stands beside the stamps of whoever wrote the log, and may tell more where several of these are alike
        distinct = len(stamps) == 1 and is_time_name(names[at], COUNTED) and len({*cells.columns[stamps[0]]}) == len(cells.lines)
        counted = numbers(cells.columns[at], ".") if len(stamps) == 1 and not distinct and _numeric(cells, at) else 0
        restarted = isinstance(counted, np.ndarray) and begins_again(counted).any()  # the board that counts
        at = stamps[0] if distinct or restarted else at
    if at in clocks and len(dates) == 1 and names[dates[0]] != names[at]:
        return _joined(cells, names, dates[0], at)
    if at in dates and len(clocks) == 1:
        return _joined(cells, names, at, clocks[0])
    return Clock((at,), names[at], cells.header[at], cells.columns[at], name_and_unit(cells.header[at])[1])


def _joined(cells: Cells, names: list[str], date: int, clock: int) -> Clock:
    """Return the clock of a date and a clock time in two columns, given by their places."""
    texts = tuple(f"{d.strip()} {c.strip()}" for d, c in zip(cells.columns[date], cells.columns[clock], strict=True))
    return Clock((date, clock), f"{names[date]} {names[clock]}", cells.header[clock], texts, None)


def _kinds(cells: Cells) -> tuple[list[int], list[int]]:
    """Return the columns with dates and no clock time, and those with clock times and no date, by their first and last cells."""
    dates, clocks = [], []
    for at, column in enumerate(cells.columns):
        ends = (column[0].strip(), column[-1].strip())
        if all(CLOCK.match(cell) or HALF_DAY_CLOCK.match(cell) or re.fullmatch(r"\d{1,2}:[0-5]\d", cell) for cell in ends):
            clocks.append(at)
        elif all(is_date(cell) for cell in ends):
            dates.append(at)
    return dates, clocks


def _by_name_or_content(cells: Cells, names: list[str], dates: list[int], clocks: list[int]) -> int:
    """Return the place of the time column by the names of columns, else by cells that are stamps or by units of time.

    Raises
    ------
    NameNotFoundError   When none is clear.
    RecordError         When several could be it.
    """
    hits = [at for at, name in enumerate(names) if is_time_name(name, TIME_NAMES)]
    if len(hits) == 1:
        return hits[0]
    stamps = _stamp_columns(cells)
    if len(hits) > 1:
        # a date in one column and the clock time in the other are one time
        if len(hits) == 2 and {*hits} <= {*dates, *clocks}:
            return hits[0]
        raise RecordError(
            f"{' and '.join(cells.header[at] for at in hits)} could both be the time column. Give time='...' with the right one.",
            cells.file,
            code="record.time-unclear",
        )
    timely = {*stamps, *dates, *clocks}
    named = [
        at
        for at, name in enumerate(names)
        if (is_time_name(name) and at in timely)
        or (is_time_name(name, COUNTED) and _rises(cells, at))
        or (is_time_name(name, DATED) and _numeric(cells, at) and _epoch(float(cells.columns[at][0].replace(",", "."))) is not None)
    ]
    named = named or [at for at, name in enumerate(names) if plainly(name).startswith(("date time", "time,", "datetime"))]
    units = [name_and_unit(header)[1] for header in cells.header]
    rising = [at for at, unit in enumerate(units) if unit in ("s", "ms", "us", "ns", "min", "h", "d") and _rises(cells, at)]
    for hits in (named, stamps, clocks, rising):
        # the only one, a date with its clock time, or several with the same cells
        parted = len(hits) == 2 and {*hits} <= {*dates, *clocks} and len({*hits} & {*dates}) == 1
        if len(hits) == 1 or parted or (hits and all([*cells.columns[at]] == [*cells.columns[hits[0]]] for at in hits)):
            return hits[0]
        if hits:
            raise RecordError(
                f"{' and '.join(cells.header[at] for at in hits)} could both be the time column. Give time='...' with the right one.",
                cells.file,
                code="record.time-unclear",
            )
    raise NameNotFoundError(
        f"no time column found: none of {', '.join(cells.header)} has one of the names {', '.join(TIME_NAMES)}. Give time='...' with "
        "the name of the column.",
        cells.file,
        code="record.time-unclear",
    )


def _stamp_columns(cells: Cells) -> list[int]:
    """Return the places of columns whose first and last cells are stamps."""
    return [at for at, column in enumerate(cells.columns) if is_stamp(column[0]) and is_stamp(column[-1])]


def _numeric(cells: Cells, at: int) -> bool:
    """Whether the first and last cells of a column are numbers."""
    column = cells.columns[at]
    return all(isinstance(numbers((cell.strip().replace(",", "."),), "."), np.ndarray) and cell.strip() for cell in (column[0], column[-1]))


def _rises(cells: Cells, at: int) -> bool:
    """Whether a column has numbers, and its last is above its first."""
    column = cells.columns[at]
    return _numeric(cells, at) and float(column[0].replace(",", ".")) < float(column[-1].replace(",", "."))


_PARTS_OF_A_SECOND: Final = {"ms": "milliseconds", "us": "microseconds", "ns": "nanoseconds"}
"""Unit at the end of a time column's name by which its numbers are read -> the unit in words."""


def _unit_of_name(name: str) -> str:
    """Return the unit that the last word of a time column's name is, such as ``h`` of elapsed_hours; else that word."""
    return spelt(re.split("[_ ]", name)[-1].lower().removesuffix("()"))


def read_times(cells: Cells, clock: Clock, decimal: str, form: str | None, unit_text: str | None, unit_is_given: bool = False) -> Times:
    """Return the times of a log.

    Numbers, ISO 8601 stamps, dates by day, month and year, and clock times are recognised by their form; any other stamp needs `form`, a
    format of `datetime.strptime`. Numbers that only times since 1970 can be are read as such, in s, ms, us or ns. The order of day and
    month is that which the whole column allows: times do not run back, and no day is missing.

    Parameters
    ----------
    cells, clock : Cells, Clock   The log and its time column.
    decimal : str                 Decimal sign.
    form : str or None            Form of the stamps.
    unit_text : str or None       Unit of the numbers.
    unit_is_given : bool          Whether the unit was asked for and does not stand in the file.

    Raises
    ------
    RecordError   When a time is missing or cannot be read, times run back, or two readings give different times.
    """
    column, name = clock.texts, clock.name
    if form is None and unit_text is None and all(COMPACT.match(cell.strip()) for cell in column):
        form = "%Y%m%d%H%M%S"
    parsed = numbers(column, decimal) if form is None else 0
    if isinstance(parsed, int) or np.isnan(parsed).any():
        for row, cell in enumerate(column):
            if cell.strip().lower() in MISSING:
                raise RecordError(
                    "this line has no time. Remove it, or correct the log.", cells.where(row, name), code="record.time-not-read"
                )
    if isinstance(parsed, np.ndarray):
        times_read = _counted(cells, clock, parsed, unit_text, unit_is_given)
    elif form is None and parsed > 0:
        raise RecordError(
            f"'{column[parsed]}' is text; the lines above it have times in numbers.", cells.where(parsed, name), code="record.time-not-read"
        )
    else:
        times_read = _stamped(cells, clock, form)
    back = np.flatnonzero(np.diff(times_read.values) < 0)
    if back.size:
        row = int(back[0]) + 1
        if isinstance(parsed, np.ndarray) and begins_again(parsed)[row]:
            raise RecordError(
                f"the counter begins again here, at {column[row].strip()} after {column[row - 1].strip()}: the board restarted, and "
                f"how long it was off is not known. `thermid look {cells.file} --cut FOLDER` writes each part as a log of its own.",
                cells.where(row, name),
                code="record.time-order",
            )
        hour = (
            " A step back of one hour is typical of the end of summer time."
            if 3000 < times_read.values[row - 1] - times_read.values[row] <= 3660
            else ""
        )
        raise RecordError(
            f"time decreases here, from {column[row - 1].strip()} to {column[row].strip()}.{hour} "
            "Sort the log, or read its parts as separate records.",
            cells.where(row, name),
            code="record.time-order",
        )
    return times_read


def _counted(cells: Cells, clock: Clock, parsed: FloatArray, unit_text: str | None, unit_is_given: bool) -> Times:
    """Return times that are numbers `parsed` (rows,): since 1970, or in the unit of the column. [s]

    Raises
    ------
    RecordError   When one is no time, or the unit is not clear.
    """
    name = clock.name
    odd = np.flatnonzero(~np.isfinite(parsed))
    if odd.size:
        raise RecordError(f"'{clock.texts[odd[0]]}' is not a time.", cells.where(int(odd[0]), name), code="record.time-not-read")
    since, factor = _epoch(float(parsed[0])) or (None, 1.0)
    if since is not None and unit_text in (None, since):
        start = datetime.fromtimestamp(float(parsed[0]) / factor, UTC).isoformat()
        # the difference is taken first: a float has no room for the nanoseconds of fifty years
        whole = all(cell.strip().isdigit() for cell in clock.texts)
        values = (np.array([int(t) - int(clock.texts[0]) for t in clock.texts]) if whole else parsed - parsed[0]) / factor
        remark = (f"times read as {since} since 1970, from {start}",) if since != "s" else ()
        return Times(values, start, remark, f"{since} since 1970", "UTC")
    factor = _factor(cells, name, unit_text)
    if since is not None and not unit_is_given and parsed[0] * factor > _LONGEST * 5:
        raise RecordError(
            f"{clock.texts[0].strip()} in {unit_text} is {duration_text(float(parsed[0]) * factor)}, and looks like {since} since 1970. "
            f"Give units={{'{name}': '{since}'}}.",
            cells.where(0, name),
            code="record.time-unclear",
        )
    if unit_text is None:
        _refuse_serial_days(parsed, cells, name)
    values = parsed if factor == 1.0 else parsed * factor
    word = _PARTS_OF_A_SECOND.get(_unit_of_name(name), "")
    usual = f"{word}, by its name" if word else "seconds, no unit in the log"
    kind = unit_text or ("s" if name.lower().endswith(("_s", "seconds")) and not word else usual)
    return Times(values, cells.start, _questioned(values, cells, name, unit_text, unit_is_given), kind)


def _questioned(times: FloatArray, cells: Cells, name: str, unit_text: str | None, unit_is_given: bool) -> tuple[str, ...]:
    """Return a remark on an unusual step of times [s]; refuse a step or length that no thermal test has, unless its unit was given.

    Raises
    ------
    RecordError   With the step and the length.
    """
    step = float(np.median(np.diff(times))) if times.size > 1 else 0.0
    length = float(times[-1] - times[0])
    shown = f"a step of {duration_text(step)} and a length of {duration_text(length)}"
    if not unit_is_given and (length > _LONGEST or (unit_text is None and step >= DAY)):
        reading = f"in {unit_text}" if unit_text else "in seconds, because it names no unit,"
        raise RecordError(
            f"read {reading} it has {shown}, which is implausible for a thermal test. Give its unit: units={{'{name}': 'ms'}}, or 's' if "
            "that is right.",
            cells.where(None, name),
            code="record.time-unclear",
        )
    if unit_text is None and step > _SLOW:
        return (f"'{name}' names no unit and was read in seconds: {shown}",)
    return (
        (f"a sample every {step:g} s is faster than temperatures usually change. Check the unit of '{name}'",) if 0.0 < step < _FAST else ()
    )


def _factor(cells: Cells, name: str, unit_text: str | None) -> float:
    """Return the seconds in one unit of the time column; without a unit, one or what its name says.

    Raises
    ------
    RecordError   When its name ends in min, h or d and no unit is given.
    UnitError     When the unit is not of time.
    """
    if unit_text is None:
        tail = _unit_of_name(name)
        if tail in ("min", "h", "d"):
            raise RecordError(
                f"its name ends in a unit, '{tail}', but without one in the header it is read in seconds. Give "
                f"units={{'{name}': '{tail}'}} or 's', or write the unit into the header: '{name} [{tail}]'.",
                cells.where(None, name),
                code="record.time-unclear",
            )
        return float(unit(tail).factor) if tail in _PARTS_OF_A_SECOND else 1.0
    with errors_at(cells.where(None, name)):
        of = unit(unit_text)
        require(of.dimension, "s", unit_text, of.absolute)
    return float(of.factor)


def _refuse_serial_days(times: FloatArray, cells: Cells, name: str) -> None:
    """Refuse times that look like days of a spreadsheet (since 1900) or of MATLAB (since year 0), less than an hour apart as days.

    Raises
    ------
    RecordError   With the date.
    """
    first, last = float(times[0]), float(times[-1])
    if not 0.0 < last - first < 0.04 * (times.size - 1):
        return
    for kind, (low, high, zero) in (("a spreadsheet's day", (25000.0, 80000.0, 0.0)), ("MATLAB's day", MATLAB_DAYS)):
        if low < first < high:
            day = SPREADSHEET_EPOCH + timedelta(days=first - zero)
            raise RecordError(
                f"{first:g} looks like {kind} ({day:%Y-%m-%d %H:%M}), but without a unit it is read in seconds. Give "
                f"units={{'{name}': 'd'}} or 's', or write it into the header: '{name} [d]'.",
                cells.where(0, name),
                code="record.time-unclear",
            )


def _stamped(cells: Cells, clock: Clock, form: str | None) -> Times:
    """Return times that are stamps, from the first one.

    Raises
    ------
    RecordError   When one cannot be read, or the order of day and month is ambiguous.
    """
    first = clock.texts[0].strip()
    match = re.search(r"\b((?:GMT|UTC)(?:[+-]\d{1,2}(?::?\d\d)?)?)", clock.header)
    zone = match[1] if match else ""
    if form is not None:
        return Times(_by_form(cells, clock, form), first, (), form, zone)
    for pattern, form_of, kind in (
        (CLOCK, "HH:MM:SS", "clock times"),
        (MINUTES_CLOCK, "HH:MM", "clock times, hours and minutes"),
        (HALF_DAY_CLOCK, "with AM or PM", "clock times, AM/PM"),
    ):
        if pattern.match(first) and first.strip("0") != ":":
            return Times(_clock_times(cells, clock, pattern, form_of), first, (), kind, zone)
    if NUMERIC.match(first) and not is_iso(first):
        values, order, notes = _by_order(cells, clock)
        return Times(values, first, notes, order, zone or zone_of_stamp(first))
    return Times(_plain_stamps(cells, clock), first, (), "stamps", zone or zone_of_stamp(first))


def stamp_seconds(texts: Sequence[str], file: str = "") -> FloatArray:
    """Return stamps or numbers of any known form as times on one axis (samples,), in the order given. [s]

    Raises
    ------
    RecordError   When one is no time, or the order of day and month is ambiguous.
    """
    cells = Cells(file, ("time",), [tuple(texts)], list(range(1, len(texts) + 1)), ())
    clock = Clock((0,), "time", "time", tuple(texts), None)
    parsed = numbers(clock.texts, ".")
    if isinstance(parsed, np.ndarray):
        epoch = _epoch(float(parsed[0]))
        return parsed / (epoch[1] if epoch else 1.0)
    if NUMERIC.match(texts[0].strip()) and not is_iso(texts[0].strip()):
        return _by_order(cells, clock, sort=True)[0]
    return _plain_stamps(cells, clock)


def _epoch(first: float) -> tuple[str, float] | None:
    """Return the unit of time since 1970 that a number can be, and how many of it are a second; None where it can be none."""
    return next(((text, factor) for text, factor in _EPOCHS if _SINCE_1970[0] * factor <= first <= _SINCE_1970[1] * factor), None)


def _by_order(cells: Cells, clock: Clock, sort: bool = False) -> tuple[FloatArray, str, tuple[str, ...]]:
    """Return seconds from the first stamp of dates in numbers (samples,), the order of day, month and year, and notes.

    With `sort` stamps may run back, as in long tables.

    Raises
    ------
    RecordError   When no order of the three fits, or several do and differ.
    """
    matches = []
    for row, cell in enumerate(clock.texts):
        match = NUMERIC.match(cell.strip())
        if match is None:
            raise RecordError(
                f"'{cell}' is not a time stamp in the form of the first line: '{clock.texts[0].strip()}'.",
                cells.where(row, clock.name),
                code="record.time-not-read",
            )
        matches.append(match)
    seconds = np.array([of_day(match) for match in matches])
    german = matches[0]["sign"] == "." and len(matches[0]["a"]) <= 2
    times_by_order: dict[str, FloatArray] = {}
    days: dict[tuple[str, ...], int | None] = {}
    for order, (y, m, d) in ORDERS.items():
        if german and order != "day/month/year":
            continue
        fields = [(match[y], match[m], match[d]) for match in matches]
        for key in dict.fromkeys(fields):
            days[key] = day_number(*key)
        read = [days[key] for key in fields]
        if None in read:
            continue
        values = np.array(read, dtype=np.float64) * DAY + seconds
        values = np.round(values - values[0], 9)
        if sort or not np.any(np.diff(values) < 0):
            times_by_order[order] = values
    if not times_by_order:
        raise RecordError(
            f"no order of day, month and year gives increasing times in this column: '{clock.texts[0].strip()}' to "
            f"'{clock.texts[-1].strip()}'. Sort the log, or give clock='%d/%m/%Y %H:%M:%S' or the form used.",
            cells.where(0, clock.name),
            code="record.time-order",
        )
    order = _chosen(cells, clock, times_by_order)
    if german or len(matches[0]["a"]) > 2:
        return times_by_order[order], order, ()
    open_ = len(times_by_order) > 1 and all(np.array_equal(values, times_by_order[order]) for values in times_by_order.values())
    notes = (
        CodedText(
            f"the order of day and month in the stamps is ambiguous ({' or '.join(times_by_order)}), but the times are the same",
            "record.time-unclear",
        )
        if open_
        else f"stamps read as {order}"
    )
    return times_by_order[order], " or ".join(times_by_order) if open_ else order, (notes,)


def _chosen(cells: Cells, clock: Clock, times_by_order: dict[str, FloatArray]) -> str:
    """Return the only order that is left, or the one in which no day is missing where the others have gaps.

    Raises
    ------
    RecordError   When several remain that differ.
    """
    name, first = next(iter(times_by_order.items()))
    if all(np.array_equal(values, first) for values in times_by_order.values()):
        return name  # within a day their order does not count
    steps = {order: np.sort(np.diff(np.unique(values))) for order, values in times_by_order.items()}
    whole = [order for order, step in steps.items() if step.size and step[-1] <= 5.0 * max(step[(step.size - 1) // 2], 1.0)]
    alike = {tuple(times_by_order[order][[0, -1]]) for order in whole}
    if whole and len(alike) == 1 and len(whole) < len(times_by_order):
        return whole[0]
    raise RecordError(
        f"'{clock.texts[0].strip()}' to '{clock.texts[-1].strip()}': {' and '.join(times_by_order)} both fit and give different times. "
        f"Give clock='{_form(clock.texts[0], 'day/month/year')}' or clock='{_form(clock.texts[0], 'month/day/year')}'.",
        cells.where(0, clock.name),
        code="record.time-unclear",
    )


def _form(text: str, order: str) -> str:
    """Return the format of `datetime.strptime` of a stamp in an order of day and month."""
    match = NUMERIC.match(text.strip())
    assert match is not None
    sign = match["sign"]
    year = "%Y" if len(match["c"]) == 4 else "%y"
    out = sign.join(("%d", "%m", year) if order.startswith("day") else ("%m", "%d", year))
    if match["h"] is None:
        return out
    between = text.strip()[match.end("c") : match.start("h")]
    hours = ("%I" if match["half"] else "%H") + ":%M" + (":%S" if match["s"] else "")
    hours += f"{text.strip()[match.start('f') - 1]}%f" if match["f"] else ""
    return out + between + hours + (" %p" if match["half"] else "")


def _clock_times(cells: Cells, clock: Clock, form: re.Pattern[str], kind: str) -> FloatArray:
    """Return seconds from the first clock time (samples,); a step back of more than half a day passes midnight.

    Raises
    ------
    RecordError   When a cell has another form.
    """
    out = np.empty(len(clock.texts))
    for row, cell in enumerate(clock.texts):
        match = form.match(cell.strip())
        if match is None:
            raise RecordError(
                f"'{cell}' is not a clock time {kind}, the form of the first line.",
                cells.where(row, clock.name),
                code="record.time-not-read",
            )
        out[row] = day_seconds(match[1], match[2], match[3], match[4] if form is HALF_DAY_CLOCK else None)
    return _past_midnight(out)


def day_seconds(hour: str, minute: str, second: str | None, half: str | None) -> float:
    """Return the seconds since midnight of a clock time of 24 hours, or of 12 with the letter of AM or PM (`half`)."""
    hours = int(hour) if half is None else int(hour) % 12 + (12 if half in "Pp" else 0)
    return HOUR * hours + MINUTE * int(minute) + float((second or "0").replace(",", "."))


def _past_midnight(of_day: FloatArray) -> FloatArray:
    """Return times of day (samples,) as times from the first that go on past midnight; hours above 23 show a stopwatch. [s]"""
    nights = np.cumsum(np.diff(of_day, prepend=of_day[0]) < -DAY / 2.0)
    days = nights.astype(np.float64) * (DAY if of_day.max() < DAY else 0.0)
    return np.asarray(np.round(of_day + days - of_day[0], 9))


def _plain_stamps(cells: Cells, clock: Clock) -> FloatArray:
    """Return seconds from the first stamp (samples,), of ISO 8601 or with the month as a word.

    Raises
    ------
    RecordError   When a cell is neither.
    """

    def refusal(cell: str, error: ValueError) -> str:
        """Return what is wrong with a time that cannot be read, and how to state its form."""
        return (
            f"'{cell}' is not a known time (seconds, an ISO 8601 stamp, HH:MM:SS, or HH:MM after 0:00). Give its form, for "
            "example clock='%d.%m.%Y %H:%M:%S', '%H:%M' or '%M:%S'."
        )

    return _since_first(_datetimes(cells, clock, one_stamp, refusal))


def _by_form(cells: Cells, clock: Clock, form: str) -> FloatArray:
    """Return seconds from the first stamp (samples,) of a given form; of clock times without a date past midnight too.

    Raises
    ------
    RecordError   When a cell does not have that form.
    """
    stamps = _datetimes(
        cells,
        clock,
        lambda text: datetime.strptime(text, form),
        lambda cell, error: f"'{cell}' does not have the form clock='{form}' ({error}).",
    )
    if not any(sign in form for sign in ("%d", "%j", "%c", "%x")):
        return _past_midnight(
            np.array([stamp.hour * HOUR + stamp.minute * MINUTE + stamp.second + stamp.microsecond * 1e-6 for stamp in stamps])
        )
    return _since_first(stamps)


def _datetimes(cells: Cells, clock: Clock, parse: Callable[[str], datetime], refusal: Callable[[str, ValueError], str]) -> list[datetime]:
    """Return the stamps of a column, all with a time zone or none.

    Parameters
    ----------
    cells, clock : Cells, Clock     The log and its time column.
    parse : callable                Text -> stamp; raises ValueError.
    refusal : callable              (cell, error) -> text of the error.

    Raises
    ------
    RecordError   When a cell cannot be parsed, or only some have a time zone.
    """
    stamps: list[datetime] = []
    for row, cell in enumerate(clock.texts):
        try:
            stamps.append(parse(cell.strip()))
        except ValueError as error:
            raise RecordError(refusal(cell, error), cells.where(row, clock.name), code="record.time-not-read") from None
        if (stamps[row].tzinfo is None) != (stamps[0].tzinfo is None):
            raise RecordError(
                f"'{cell}' and the first stamp differ: only one has a time zone. Write all with a time zone, or none.",
                cells.where(row, clock.name),
                code="record.time-not-read",
            )
    return stamps


def _since_first(stamps: Sequence[datetime]) -> FloatArray:
    """Return seconds from the first stamp (samples,)."""
    return np.array([(stamp - stamps[0]).total_seconds() for stamp in stamps])


def is_date(text: str) -> bool:
    """Whether a text is a date without a clock time."""
    match = NUMERIC.match(text) or _NAMED.match(text) or _AMERICAN.match(text)
    return match is not None and match["h"] is None and len(text) >= 6


def is_stamp(text: str) -> bool:
    """Whether a text is a date with a clock time."""
    plain = text.strip()
    match = NUMERIC.match(plain) or _NAMED.match(plain) or _AMERICAN.match(plain)
    if match is not None:
        return match["h"] is not None
    try:
        return len(plain) > 10 and datetime.fromisoformat(plain) is not None
    except ValueError:
        return False


def is_iso(text: str) -> bool:
    """Whether a text is an ISO 8601 stamp."""
    try:
        datetime.fromisoformat(text)
    except ValueError:
        return False
    return True


def zone_of_stamp(text: str) -> str:
    """Return the time zone at the end of a stamp; empty where it has none."""
    match = re.search(r"(Z|UTC|GMT|[+-]\d\d:?\d\d)\s*\Z", text)
    return match[1] if match and ":" in text else ""


def of_day(match: re.Match[str]) -> float:
    """Return the seconds since midnight of a matched stamp, in UTC where it has a zone."""
    if match["h"] is None:
        return 0.0
    fraction = float(f"0.{match['f']}") if match["f"] else 0.0
    return day_seconds(match["h"], match["m"], match["s"], match["half"]) + fraction - zone_offset(match["zone"] or "")


def zone_offset(zone: str) -> float:
    """Return by how much a time zone such as +01:00 or GMT-3 is ahead of UTC; zero for UTC or none. [s]"""
    match = re.search(r"([+-])(\d\d?):?(\d\d)?\Z", zone)
    return float(f"{match[1]}1") * (HOUR * int(match[2]) + MINUTE * int(match[3] or 0)) if match else 0.0


def _years(text: str) -> int:
    """Return a year of four or two digits as a number; of two in the 2000s."""
    return int(text) if len(text) > 2 else 2000 + int(text)


def day_number(year: str, month: str, day: str) -> int | None:
    """Return the ordinal number of a day; None where there is no such day."""
    if len(month) > 2 or len(day) > 2 or len(year) == 3:
        return None
    try:
        return datetime(_years(year), int(month), int(day)).toordinal()
    except ValueError:
        return None


def one_stamp(text: str) -> datetime:
    """Return the datetime of an ISO 8601 stamp, or of one with the month as a word.

    Raises
    ------
    ValueError   When it is neither.
    """
    numeric = text[:1].isdigit() and text[4:5] in "-0123456789"
    match = None if numeric else _NAMED.match(text) or _AMERICAN.match(text)
    if match is None:
        return datetime.fromisoformat(text)
    month = _MONTHS.get(match["word"].lower()[:3])
    if month is None:
        raise ValueError("no month")
    day = datetime(_years(match["c"]), month, int(match["a"]), tzinfo=UTC if match["zone"] else None)
    return day + timedelta(seconds=of_day(match))
