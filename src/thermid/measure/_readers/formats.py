"""The formats of logs: each is recognised by what stands in the file, never by its name, and read into cells.

One line of `FORMATS` is one format; what reads text ends in `textfile.cells_of_text`, what reads numbers in `textfile.merged`. Text that is
no plain table is read here:

- a capture of a serial monitor: a stamp and an arrow before each line, banners between, values in columns or as names with numbers;
- a LabVIEW measurement file (.lvm): a header of keys, then segments with their own header, as National Instruments publishes the layout;
- a long table: a row for each reading of each sensor, or cells that carry their unit.
"""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from pathlib import Path
from typing import Final

import numpy as np

from thermid.base.errors import RecordError, ThermidError, cap, extension, raising
from thermid.base.files import kind_of_text
from thermid.base.units import unit
from thermid.measure._readers import binary
from thermid.measure._readers.columns import table_of_text
from thermid.measure._readers.confined import EndedError
from thermid.measure._readers.headers import MISSING, TIME_NAMES, is_number, name_and_unit, spelt
from thermid.measure._readers.stamps import stamp_seconds
from thermid.measure._readers.textfile import Cells, ChannelSeries, Layout, cells_of_text, decoded, merged, read_bytes

_LINE: Final = re.compile(r"(?P<stamp>(?:\d{4}-\d\d-\d\d[ T])?\d{1,2}:[0-5]\d:[0-5]\d(?:[.,]\d+)?) -> ?(?P<text>.*)\Z")
_PAIR: Final = re.compile(
    r"(?P<name>[A-Za-z_][\w .#-]*?)\s*(?:\((?P<inner>[^()]*)\)\s*)?[:=]\s*(?P<value>[+-]?\d+(?:\.\d+)?)\s*"
    r"(?P<unit>(?:[°º˚]\s?|deg ?)?[CF](?![A-Za-z])|K(?![A-Za-z])|[mk]?W(?![A-Za-z])|m?[VA](?![A-Za-z])|%|ms\b|s\b)?"
)
_END: Final = "***End_of_Header***"
_MARKS: Final = {"Tab": "\t", "Comma": ","}
_KEYS: Final = frozenset(
    "entity_id entity series metric sensor sensor_id sensor_name channel channel_name device device_id name topic tag variable parameter "
    "point measurement _field field signal label id".split()
)
"""Names of the column that says whose reading a row is."""
_VALUES: Final = frozenset("state value _value reading val mean wert valor messwert".split())
"""Names of the column that holds it."""
_UNITS: Final = frozenset("unit units unit_of_measurement uom einheit unidade".split())
_LOST: Final = frozenset(("unavailable", "unknown", "none", "undef"))
"""States of a home automation that are no reading."""
_WITH_UNIT: Final = re.compile(
    r"(?P<number>[+-]?(?:\d+(?:[.,]\d*)?|[.,]\d+)(?:[eE][+-]?\d+)?)\s?(?P<unit>[^\d\s.,:;+-][^\d\s]*|°\s?[CF])\Z"
)


def is_capture(head: str) -> bool:
    """Whether most lines of a text have a stamp and an arrow, ``12:00:01 -> 23.5``."""
    lines = [line for line in head.splitlines() if line.strip()][:50]
    return len(lines) > 1 and sum(bool(_LINE.match(line)) for line in lines[:-1]) > 0.5 * (len(lines) - 1)


def serial_capture(text: str, file: str) -> Cells:
    """Return the cells of a serial capture.

    Raises
    ------
    RecordError   When its lines hold neither columns nor names with values.
    """
    lines = [(number, match) for number, line in enumerate(text.split("\n"), 1) if (match := _LINE.match(line.rstrip()))]
    passed = sum(bool(line.strip()) for line in text.split("\n")) - len(lines)
    for mark in (",", ";", "\t"):
        names, rows = _columns(lines, mark)
        if rows:
            body = "".join(f"{match['stamp']}{mark}{match['text']}\n" for _, match in rows)
            cells = cells_of_text(f"time{mark}{names}\n{body}", file, mark)
            numbers = [number for number, _ in rows][: len(cells.lines)]
            return _captured(cells.header, cells.columns, numbers, len(lines) - len(rows) - 1 + passed, file, cells.layout.separator)
    return _pairs(lines, passed, file)


def _captured(
    header: tuple[str, ...], columns: Sequence[Sequence[str]], numbers: list[int], others: int, file: str, separator: str = ""
) -> Cells:
    """Return the cells of a capture, with a note on lines that hold no samples (`others`); `numbers` are the lines of its rows."""
    notes = (f"{others} lines of the capture hold no samples and were skipped",) if others > 0 else ()
    return Cells(file, header, columns, numbers, notes, time="time", layout=Layout("serial capture", "", separator))


Lines = list[tuple[int, re.Match[str]]]


def _columns(lines: Lines, mark: str) -> tuple[str, Lines]:
    """Return the header and the lines of samples where many lines hold as many numbers between marks; no lines where they do not."""
    split = [match["text"].split(mark) for _, match in lines]
    numeric = [any(is_number(cell) for cell in row) for row in split]
    widths = Counter(len(row) for row in split if len(row) > 1 and sum(is_number(cell) for cell in row) >= 0.5 * len(row))
    width, count = widths.most_common(1)[0] if widths else (0, 0)
    if count < max(2, 0.25 * len(lines)):
        return "", []
    rows = [k for k, row in enumerate(split) if len(row) == width and numeric[k]]
    above = [row for k, row in enumerate(split[: rows[0]]) if len(row) == width and not numeric[k]]
    names = above[-1] if above else [f"value {k}" for k in range(1, width + 1)]
    return mark.join(names), [lines[k] for k in rows]


def _pairs(lines: Lines, passed: int, file: str) -> Cells:
    """Return the cells of lines such as ``T1: 23.50 C  T2: 24.06 C``; lines of one cycle that name other channels are one row."""
    rows: list[tuple[int, str, dict[str, str]]] = []
    units: dict[str, str] = {}
    others = passed
    for number, match in lines:
        pairs = list(_PAIR.finditer(match["text"]))
        if not pairs:
            others += 1
            continue
        values = {pair["name"].strip(): pair["value"] for pair in pairs}
        for pair in pairs:
            unit = spelt(pair["inner"] or pair["unit"] or "")
            if units.setdefault(pair["name"].strip(), unit) != unit:
                raise RecordError(f"'{pair['name']}' changes its unit here.", f"{file}:{number}", code="record.unit-contradicts")
        rows.append((number, match["stamp"], values))
    counts = Counter(name for _, _, values in rows for name in values)
    usual = [name for name, count in counts.items() if count > 0.2 * max(counts.values())]
    rows = [(number, stamp, values) for number, stamp, values in rows if any(name in values for name in usual)]
    if len(rows) < 2 or len(rows) < 0.3 * len(lines):
        raise RecordError(
            "its lines hold neither columns of numbers nor names with values such as 'T1: 23.5'. Remove time stamps and banners from "
            "the lines.",
            file,
            code="record.layout-unclear",
        )
    columns = [tuple(stamp for _, stamp, _ in rows), *(tuple(values.get(name, "") for _, _, values in rows) for name in usual)]
    header = ("time", *(f"{name} [{units[name]}]" if units[name] else name for name in usual))
    return _captured(header, columns, [number for number, _, _ in rows], others, file)


def labview(text: str, file: str) -> Cells:
    """Return the cells of a LabVIEW measurement file; times run from the start of its first segment. [s]

    Raises
    ------
    RecordError   When it has no samples, its segments differ in channels, or its channels have times of their own.
    """
    lines = text.split("\n")
    keys, at = _keys(lines, 0, file)
    mark = _MARKS.get(keys.get("Separator", ["Tab"])[0].strip(), "\t")
    mark = mark if mark in lines[1] else ("," if "," in lines[1] else "\t")
    sign = keys.get("Decimal_Separator", [""])[0].strip()
    x_columns = keys.get("X_Columns", ["One"])[0].strip()
    notes: list[str] = []
    header: tuple[str, ...] = ()
    times: list[float] = []
    rows: list[list[str]] = []
    numbers: list[int] = []
    first: datetime | None = None
    while at < len(lines):
        if not lines[at].strip():
            at += 1
            continue
        segment, at = _keys(lines, at, file, mark)
        names, begun, at_rows, stop = _segment(lines, at, segment, mark, file)
        if header and names != header:
            raise RecordError(
                "a later segment has other channels than the first. Split the file into its segments.",
                f"{file}:{at + 1}",
                code="record.layout-unclear",
            )
        header, first = names, first or begun
        shift = (begun - first).total_seconds() if begun and first else 0.0
        sample_times, samples = _samples(at_rows, segment, x_columns, len(names), file)
        stated_count = segment.get("Samples", [""])[0].strip()
        if stated_count.isdigit() and 0 < int(stated_count) < len(samples) and x_columns == "No":
            notes.append(f"{len(samples)} samples are present, but the header states {stated_count}: read as consecutive, without a pause")
        times += [shift + t for t in sample_times]
        rows += [row for _, row in samples]
        numbers += [number for number, _ in samples]
        at = stop
    if not rows:
        raise RecordError(
            "the file has a header but no samples below it. Export the log again, with its data.", file, code="record.no-samples"
        )
    columns = [tuple(repr(t) for t in times), *(tuple(column) for column in zip(*rows, strict=True))]
    if sign == ",":
        columns[1:] = [tuple(cell.replace(",", ".") if is_number(cell) else cell for cell in column) for column in columns[1:]]
    first = first or _stamp(keys)  # older files date the whole, not their segments
    start = first.isoformat() if first else None
    layout = Layout("LabVIEW measurement", "", "tab" if mark == "\t" else "comma", numbers[0] - 1)
    return Cells(file, ("X_Value [s]", *header), columns, numbers, tuple(notes), time="X_Value", start=start, layout=layout)


def _keys(lines: list[str], at: int, file: str, mark: str = "\t") -> tuple[dict[str, list[str]], int]:
    """Return key -> cells of a LabVIEW header, and the number of the line after it.

    Raises
    ------
    RecordError   When the header has no end.
    """
    out: dict[str, list[str]] = {}
    for k in range(at, len(lines)):
        if lines[k].startswith(_END):
            return out, k + 1
        key, *cells = lines[k].split(mark) if mark in lines[k] else lines[k].split(",", 1)
        out.setdefault(key.strip(), cells or [""])
    raise RecordError("its header has no end: the line ***End_of_Header*** is missing.", file, code="record.damaged")


def _stamp(segment: dict[str, list[str]]) -> datetime | None:
    """Return the start of a segment by its Date and Time; None where it has none."""
    date, clock = (segment.get(key, [""])[0].strip().replace(",", ".") for key in ("Date", "Time"))
    try:
        day = datetime.strptime(date, "%Y/%m/%d")
        hour, minute, second = clock.split(":")
        return day + timedelta(hours=int(hour), minutes=int(minute), seconds=round(float(second), 6))
    except (ValueError, OverflowError):
        return None


def _segment(
    lines: list[str], at: int, segment: dict[str, list[str]], mark: str, file: str
) -> tuple[tuple[str, ...], datetime | None, list[tuple[int, list[str]]], int]:
    """Return the names of the channels with units, the start, the (number, cells) of its lines, and the line after the segment.

    Raises
    ------
    RecordError   When it has no channels, or these have different times.
    """
    if at == len(lines):
        raise RecordError(
            "the file ends behind a header, without channels. Export the log again, with its data.", file, code="record.no-samples"
        )
    names = [name.strip() for name in lines[at].rstrip("\n").split(mark)]
    stop = at + 1
    while stop < len(lines) and lines[stop].strip() and lines[stop].split(mark)[0].strip() not in ("Channels", "Notes"):
        stop += 1
    rows = [(k + 1, lines[k].split(mark)) for k in range(at + 1, stop)]
    comment = names and names[-1].lower() == "comment"
    inner = names[1:-1] if comment else names[1:]
    width = len(names)
    if "X_Value" in inner:
        pairs = [k for k, name in enumerate(names) if name == "X_Value"]
        for number, row in rows:
            if len({row[k].strip() for k in pairs if k < len(row)} - {""}) > 1:
                raise RecordError(
                    "its channels have different times. Export them with one X column.", f"{file}:{number}", code="record.times-differ"
                )
    units = segment.get("Y_Unit_Label", [])
    keep = [k for k in range(1, width) if names[k] != "X_Value"]
    named = tuple(_named(names[k], units[k - 1].strip() if k - 1 < len(units) else "") for k in keep)
    samples = [(number, [row[0], *(row[k].strip() if k < len(row) else "" for k in keep)]) for number, row in rows]
    return named, _stamp(segment), samples, stop


def _named(name: str, unit: str) -> str:
    """Return the name of a channel with the unit of its segment in brackets, unless it has that unit."""
    return name if not unit or name_and_unit(name)[1] == spelt(unit) or name.lower() == "comment" else f"{name} [{unit}]"


def _samples(
    rows: list[tuple[int, list[str]]], segment: dict[str, list[str]], x_columns: str, width: int, file: str
) -> tuple[list[float], list[tuple[int, list[str]]]]:
    """Return times from the start of a segment [s], and (number, cells) of its samples without their X column.

    Raises
    ------
    RecordError   When the samples have no time.
    """
    begin, step = (_number(segment.get(key, ["0"])[0]) for key in ("X0", "Delta_X"))
    out = []
    for k, (number, row) in enumerate(rows):
        if row[0].strip() and x_columns != "No":
            if not is_number(row[0]):
                raise RecordError(f"'{row[0]}' is not a time.", f"{file}:{number}", code="record.time-not-read")
            out.append(_number(row[0]))
        elif np.isfinite(step) and step > 0:
            out.append(begin + step * k)
        else:
            raise RecordError(
                "its samples have no time: X_Value is empty and Delta_X is missing.", f"{file}:{number}", code="record.time-unclear"
            )
    return out, [(number, row[1 : width + 1]) for number, row in rows]


def _number(text: str) -> float:
    """Return a number with a point or a comma; NaN where it is none."""
    return float(text.strip().replace(",", ".") or "nan") if is_number(text) else float("nan")


def influx(text: str, file: str) -> Cells:
    """Return the cells of an annotated CSV: tables one after the other, each with annotations and a header of its own.

    Raises
    ------
    RecordError   When a table has no _time or no _value.
    """
    series: dict[str, tuple[list[str], list[str], list[int]]] = {}
    header: list[str] = []
    for number, row in _rows(text, file):
        if not row or row[0].startswith("#"):
            header = []
            continue
        if not header:
            header = row
            if not {"_time", "_value"} <= {*header}:
                raise RecordError(
                    "the table has no _time and _value. Query a series, not an aggregate.", f"{file}:{number}", code="record.layout-unclear"
                )
            continue
        if len(row) != len(header):
            raise RecordError(
                f"{len(row)} cells in this line, {len(header)} columns in the header. Correct or remove the line.",
                f"{file}:{number}",
                code="record.layout-unclear",
            )
        cells = dict(zip(header, row, strict=True))
        # the field of a row with its tags, without what all rows share by their format
        tags = [cells.get(k, "") for k in header if k and not k.startswith("_") and k not in ("result", "table")]
        name = " ".join(filter(None, [cells.get("_field", ""), *tags])) or cells.get("_measurement", "value")
        texts, stamps, lines = series.setdefault(name, ([], [], []))
        texts.append(cells["_value"])
        stamps.append(cells["_time"])
        lines.append(number)
    return _as_cells(series, file, "_time", Layout("InfluxDB annotated CSV", "UTF-8", "comma"))


def _rows(text: str, file: str) -> Iterator[tuple[int, list[str]]]:
    """Yield (line number, cells) of the rows of a CSV.

    Raises
    ------
    RecordError   When a quotation mark is misplaced.
    """
    try:
        yield from enumerate(csv.reader(text.split("\n"), strict=True), 1)
    except csv.Error as error:
        raise RecordError(f"a quotation mark is misplaced ({error}). Correct the line.", file, code="record.layout-unclear") from None


def pivoted(cells: Cells) -> Cells:
    """Return a table with one column for each sensor where the cells are a long table; other cells as they are.

    A long table has a column that says whose reading a row is, by its name, with text in it; one that holds the reading; and stamps.

    Raises
    ------
    RecordError   When one sensor has readings in two units, or two readings at one time that differ.
    """
    names = [name_and_unit(header)[0].strip().lower() for header in cells.header]
    keys = [at for at, name in enumerate(names) if name in _KEYS and _is_key(cells.columns[at])]
    values = [at for at, name in enumerate(names) if name in _VALUES]
    times = [
        at for at, name in enumerate(names) if name in (*TIME_NAMES, "last_changed", "last_updated", "_time", "ts", "date time", "date")
    ]
    if not keys or len(values) != 1 or not times:
        return _remarked(cells, names)
    units = next((cells.columns[at] for at, name in enumerate(names) if name in _UNITS), None)
    series: dict[str, tuple[list[str], list[str], list[int]]] = {}
    of_unit: dict[str, str] = {}
    for row, line in enumerate(cells.lines):
        name = " ".join(filter(None, (cells.columns[at][row].strip() for at in keys)))
        if units is not None and of_unit.setdefault(name, units[row].strip()) != units[row].strip():
            raise RecordError(
                f"'{name}' changes its unit here, from {of_unit[name]} to {units[row]}.",
                f"{cells.file}:{line}",
                code="record.unit-contradicts",
            )
        texts, stamps, lines = series.setdefault(name, ([], [], []))
        text = cells.columns[values[0]][row].strip()
        texts.append("" if text.lower() in _LOST else text)
        stamps.append(cells.columns[times[0]][row].strip())
        lines.append(line)
    common = name_and_unit(cells.header[values[0]])[1]
    named = {f"{name} [{u}]" if (u := of_unit.get(name) or common) else name: held for name, held in series.items()}
    layout = replace(cells.layout, format="long table")
    out = _as_cells(named, cells.file, cells.header[times[0]], layout)
    return replace(out, notes=(*cells.notes, *out.notes), synthetic=cells.synthetic, commas=cells.commas)


def _is_key(column: Sequence[str]) -> bool:
    """Whether a column holds few values that come again and again, at most half as many as rows."""
    return 1 <= len({*column}) <= max(1, len(column) // 2)


def _remarked(cells: Cells, names: Sequence[str]) -> Cells:
    """Return cells with a note where a column distinguishes the rows of several sources; `names` are the columns' in small letters."""
    for at, name in enumerate(names):
        if name in _KEYS and _is_key(cells.columns[at]) and len(kinds := list(dict.fromkeys(cells.columns[at]))) > 1:
            of = f"'{cells.header[at]}' distinguishes rows of {len(kinds)} sources ({', '.join(kinds[:4])})"
            remark = f"{of}: each column mixes their readings"
            return replace(cells, notes=(*cells.notes, remark))
    return cells


def _as_cells(series: dict[str, tuple[list[str], list[str], list[int]]], file: str, time: str, layout: Layout) -> Cells:
    """Return the cells of series, name -> (texts, stamps, lines), on one axis of times.

    Raises
    ------
    RecordError   When there are none, or one has two different readings at one time.
    """
    if not series:
        raise RecordError(
            "the file has a header but no samples below it. Export the log again, with its data.", file, code="record.no-samples"
        )
    out = []
    every = [stamp for _, stamps, _ in series.values() for stamp in stamps]
    axis = stamp_seconds(every, file)
    begin = 0
    for name, (texts, stamps, lines) in series.items():
        times = axis[begin : begin + len(stamps)].tolist()
        begin += len(stamps)
        reading_at: dict[float, str] = {}
        for t, text, line in zip(times, texts, lines, strict=True):
            if reading_at.setdefault(t, text) != text:
                raise RecordError(
                    f"'{name}' has two readings at {stamps[times.index(t)]}, {reading_at[t]} and {text}. Give the rows different names, or "
                    "remove one.",
                    f"{file}:{line}",
                    code="record.two-readings-at-one-time",
                )
        out.append(ChannelSeries(name, texts, times, stamps, lines))
    notes = (f"a long table with {len(every)} rows of {len(out)} series: read as one column for each",)
    cells = merged(out, file, time, notes, layout)
    return with_units_of_cells(cells)


def with_units_of_cells(cells: Cells) -> Cells:
    """Return cells without the units that they carry themselves, such as ``24.0 °C``, which then stand in the header.

    A column whose cells carry units of one dimension, such as mW and W, is read in that of its first cell.

    Raises
    ------
    UnitError     When a unit is not known.
    RecordError   When cells of one column carry units of different dimensions, or some none.
    """
    header, columns = list(cells.header), list(cells.columns)
    for at, column in enumerate(cells.columns):
        first = next((cell.strip() for cell in column if cell.strip().lower() not in MISSING), "")
        if is_number(first) or not _WITH_UNIT.match(first) or name_and_unit(cells.header[at])[1]:
            continue
        without_units = _without_units(cells, at)
        if without_units is not None:
            header[at], columns[at] = without_units
    return cells if header == list(cells.header) else replace(cells, header=tuple(header), columns=columns)


def _without_units(cells: Cells, at: int) -> tuple[str, tuple[str, ...]] | None:
    """Return the header with a unit, and the cells of a column without theirs; None where its first cell has no known unit.

    Numbers in other units of the same dimension are converted to that of the first cell, as mW to W.

    Raises
    ------
    RecordError   When a later cell has no unit, or one of another dimension.
    UnitError     When a later cell's unit is not known.
    """
    out, text = [], ""
    name = cells.header[at]
    for row, cell in enumerate(cells.columns[at]):
        plain = cell.strip()
        if plain.lower() in MISSING:
            out.append("")
            continue
        match = _WITH_UNIT.match(plain)
        if match is None:
            if not text:
                return None
            raise RecordError(
                f"'{plain}' has no unit; the cells above are in {text}.", cells.where(row, name), code="record.unit-contradicts"
            )
        unit_text = spelt(match["unit"])
        try:
            unit_of_cell = unit(unit_text)
            text = text or unit_text
            first = unit(text)
        except ThermidError as error:
            if not text:
                return None
            raise error.located(cells.where(row, name)) from None
        if unit_text == text:
            out.append(match["number"])
        elif unit_of_cell.dimension == first.dimension and unit_of_cell.offset == first.offset == 0:
            out.append(repr(float(match["number"].replace(",", ".")) * float(unit_of_cell.factor / first.factor)))
        else:
            raise RecordError(
                f"'{plain}' is in {unit_text}; the cells above are in {text}.", cells.where(row, name), code="record.unit-contradicts"
            )
    return (f"{name} [{text}]", tuple(out)) if text else None


@dataclass(frozen=True)
class Format:
    """One format of logs.

    Parameters
    ----------
    name : str            Its name.
    known_by : str        What it is recognised by, in words.
    recognised : function Whether the first bytes of a file are of it.
    read : function       (bytes, name of the file, separator or None) -> cells.
    needs : str           Package that reads it, where an extra brings it.
    """

    name: str
    known_by: str
    recognised: Callable[[bytes], bool]
    read: Callable[[bytes, str, str | None], Cells]
    needs: str = ""


def _text(read: Callable[[str, str], Cells]) -> Callable[[bytes, str, str | None], Cells]:
    """Return a reader of bytes from a reader of text."""

    def of_bytes(data: bytes, file: str, separator: str | None) -> Cells:
        """Decode a text file and read its cells; synthetic where one of its first lines has that word."""
        text, notes = decoded(data, file)
        cells = read(text, file)
        is_synthetic = any("SYNTHETIC" in line for line in text.split("\n", 20)[:20])
        return replace(cells, notes=(*notes, *cells.notes), synthetic=cells.synthetic or is_synthetic)

    return of_bytes


def _plain(data: bytes, file: str, separator: str | None) -> Cells:
    """Return the cells of a text log or a long table."""
    text, notes = decoded(data, file)
    del data  # of a long log, text and numbers are enough to hold
    return pivoted(with_units_of_cells(table_of_text(text, file, separator, notes)))


def _head(data: bytes) -> str:
    """Return the first characters of a text, whatever its encoding."""
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return data[: len(data) // 2 * 2].decode("utf-16", "replace")
    return data.decode("latin-1").removeprefix("\xef\xbb\xbf")


def is_bench_log(data: bytes) -> bool:
    """Whether the first bytes of a file are those of a log of the bench."""
    head = data[:4096]
    return head.startswith(b"# thermid bench log") or b"# session {" in head


def _bench(data: bytes, file: str, separator: str | None) -> Cells:
    """Return the cells of a log of the bench, read by the optional package that writes it.

    Raises
    ------
    ThermidError   When that package is not there.
    """
    cells: Cells = extension("bench_log", "the log of a bench", file)(data, file)
    return cells


OLD_OFFICE: Final = b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1"
"""Signature of Microsoft's compound files, such as .xls."""


_workbook = binary.in_child(binary.workbook, "python_calamine")

FORMATS: Final = (
    Format("bench log", "its first line", is_bench_log, _bench),
    Format("NI TDMS", "the bytes TDSm", lambda d: d[:4] == b"TDSm", binary.in_child(binary.tdms, "nptdms"), "npTDMS"),
    Format("HDF5", "its signature", lambda d: d[:8] == b"\x89HDF\r\n\x1a\n", binary.in_child(binary.hdf5, "h5py"), "h5py"),
    Format(
        "netCDF classic", "the bytes CDF", lambda d: d[:3] == b"CDF" and d[3:4] in b"\x01\x02", binary.in_child(binary.netcdf, "scipy.io")
    ),
    Format("MATLAB", "MATLAB 5.0 in its first line", lambda d: d[:10] == b"MATLAB 5.0", binary.in_child(binary.matlab, "scipy.io")),
    Format("MATLAB 7.3", "MATLAB 7.3 in its first line", lambda d: d[:10] == b"MATLAB 7.3", binary.in_child(binary.hdf5, "h5py"), "h5py"),
    Format(
        "workbook",
        "a zip archive with xl/ or content.xml",
        lambda d: d[:4] == b"PK\x03\x04" and any(n in d for n in (b"xl/", b"[Content_Types].xml", b"opendocument.spreadsheet")),
        _workbook,
        "python-calamine",
    ),
    Format("workbook of old Excel", "its signature", lambda d: d[:8] == OLD_OFFICE, _workbook, "python-calamine"),
    Format(
        "LabVIEW measurement", "LabVIEW Measurement in its first line", lambda d: _head(d).startswith("LabVIEW Measurement"), _text(labview)
    ),
    Format(
        "InfluxDB annotated CSV",
        "#datatype or #group before a header",
        lambda d: _head(d).startswith(("#datatype,", "#group,", "#default,")),
        _text(influx),
    ),
    Format("serial capture", "stamps with -> before each line", lambda d: is_capture(_head(d)), _text(serial_capture)),
    Format("text", "anything else that is text: columns divided by commas, semicolons or tabs", lambda d: True, _plain),
)
"""In the order in which they are tried."""

_HEAD: Final = 8192


def log_cells(path: Path, separator: str | None = None) -> Cells:
    """Return the cells of a log in any known format.

    Raises
    ------
    MissingDataError   When there is no such file, or the package that reads it is not installed.
    RecordError        When it cannot be read for certain.
    """
    data, name = [read_bytes(path)], path.name
    of = next(log_format for log_format in FORMATS if log_format.recognised(data[0][:_HEAD]))
    try:
        cells = of.read(data.pop(), name, separator)  # which alone holds the bytes then
    except EndedError as error:
        cause, memory = f" ({error})" if str(error) else "", binary.MEMORY_OVER_UNPACKED * cap("unpacked") / 1e6
        raise RecordError(
            f"the file is damaged, laid out in an unknown way, or takes more than {memory:.0f} MB of memory, as where a cell of a sheet "
            f"stands far out{cause}. Save it again, or as CSV.{raising('unpacked')}",
            name,
            code="record.damaged",
        ) from None
    except RecordError:
        if path.is_file() and (kind := kind_of_text(read_bytes(path))):
            raise RecordError(f"this is {kind}, not a log.", name, code="file.another-kind") from None
        raise
    return replace(cells, layout=replace(cells.layout, format=of.name)) if cells.layout.format == Layout().format else cells
