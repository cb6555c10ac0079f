"""LabVIEW measurement files (.lvm): a header of keys, then segments with their own header, as National Instruments publishes the layout."""

from __future__ import annotations

from datetime import datetime, timedelta
from typing import Final

import numpy as np

from thermid.errors import RecordError
from thermid.measure.readers.columns import name_and_unit, spelt
from thermid.measure.readers.textfile import Cells, Layout, is_number

_END: Final = "***End_of_Header***"
_MARKS: Final = {"Tab": "\t", "Comma": ","}

Row = list[str]


def is_labview(head: str) -> bool:
    """Whether a text begins as a LabVIEW measurement file."""
    return head.startswith("LabVIEW Measurement")


def read(text: str, file: str) -> Cells:
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
    rows: list[Row] = []
    numbers: list[int] = []
    first: datetime | None = None
    while at < len(lines):
        if not lines[at].strip():
            at += 1
            continue
        segment, at = _keys(lines, at, file, mark)
        names, begun, at_rows, stop = _segment(lines, at, segment, mark, file)
        if header and names != header:
            raise RecordError("a later segment has other channels than the first. Split the file into its segments.", f"{file}:{at + 1}")
        header, first = names, first or begun
        shift = (begun - first).total_seconds() if begun and first else 0.0
        made, kept = _samples(at_rows, segment, x_columns, len(names), file)
        said = segment.get("Samples", [""])[0].strip()
        if said.isdigit() and 0 < int(said) < len(kept) and x_columns == "No":
            notes.append(f"{len(kept)} samples stand where the header says {said}: read one after the other, without a pause")
        times += [shift + t for t in made]
        rows += [row for _, row in kept]
        numbers += [number for number, _ in kept]
        at = stop
    if not rows:
        raise RecordError("there is a header and no samples below it.", file)
    columns = [tuple(repr(t) for t in times), *(tuple(column) for column in zip(*rows, strict=True))]
    if sign == ",":
        columns[1:] = [tuple(_pointed(cell) for cell in column) for column in columns[1:]]
    start = first.isoformat() if first else None
    layout = Layout("LabVIEW measurement", "", "tab" if mark == "\t" else "comma", numbers[0] - 1)
    return Cells(file, ("X_Value [s]", *header), columns, numbers, tuple(notes), time="X_Value", start=start, layout=layout)


def _pointed(cell: str) -> str:
    """Return a number with a decimal point, text as it is."""
    return cell.replace(",", ".") if is_number(cell) else cell


def _keys(lines: list[str], at: int, file: str, mark: str = "\t") -> tuple[dict[str, Row], int]:
    """Return the keys of a header with their cells, and the line after it."""
    out: dict[str, Row] = {}
    for k in range(at, len(lines)):
        if lines[k].startswith(_END):
            return out, k + 1
        key, *cells = lines[k].split(mark) if mark in lines[k] else lines[k].split(",", 1)
        out.setdefault(key.strip(), cells or [""])
    raise RecordError("its header has no end: the line ***End_of_Header*** is missing.", file)


def _stamp(segment: dict[str, Row]) -> datetime | None:
    """Return when a segment begins, by its first channel."""
    date, clock = (segment.get(key, [""])[0].strip().replace(",", ".") for key in ("Date", "Time"))
    try:
        day = datetime.strptime(date, "%Y/%m/%d")
        hour, minute, second = clock.split(":")
        return day + timedelta(hours=int(hour), minutes=int(minute), seconds=round(float(second), 6))
    except ValueError:
        return None


def _segment(
    lines: list[str], at: int, segment: dict[str, Row], mark: str, file: str
) -> tuple[tuple[str, ...], datetime | None, list[tuple[int, Row]], int]:
    """Return the names of the channels with units, the start, the lines of samples, and the line after the segment."""
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
                raise RecordError("its channels have times of their own. Export them with one X column.", f"{file}:{number}")
    units = segment.get("Y_Unit_Label", [])
    keep = [k for k in range(1, width) if names[k] != "X_Value"]
    named = tuple(_named(names[k], units[k - 1].strip() if k - 1 < len(units) else "") for k in keep)
    kept = [(number, [row[0], *(row[k].strip() if k < len(row) else "" for k in keep)]) for number, row in rows]
    return named, _stamp(segment), kept, stop


def _named(name: str, unit: str) -> str:
    """Return the name of a channel with the unit of its segment, once."""
    return name if not unit or name_and_unit(name)[1] == spelt(unit) or name.lower() == "comment" else f"{name} [{unit}]"


def _samples(
    rows: list[tuple[int, Row]], segment: dict[str, Row], x_columns: str, width: int, file: str
) -> tuple[list[float], list[tuple[int, Row]]]:
    """Return times from the start of a segment, and the samples without their X column."""
    begin, step = (_number(segment.get(key, ["0"])[0]) for key in ("X0", "Delta_X"))
    out = []
    for k, (number, row) in enumerate(rows):
        if row[0].strip() and x_columns != "No":
            if not is_number(row[0]):
                raise RecordError(f"'{row[0]}' is no time.", f"{file}:{number}")
            out.append(_number(row[0]))
        elif np.isfinite(step) and step > 0:
            out.append(begin + step * k)
        else:
            raise RecordError("its samples have no time: X_Value is empty and Delta_X is missing.", f"{file}:{number}")
    return out, [(number, row[1 : width + 1]) for number, row in rows]


def _number(text: str) -> float:
    """Return a number with a point or a comma; not a number where it is none."""
    return float(text.strip().replace(",", ".") or "nan") if is_number(text) else float("nan")
