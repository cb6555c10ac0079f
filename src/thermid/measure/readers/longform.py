"""Long tables, with a row for each reading of each sensor, as one column for each sensor; and cells that carry their unit."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Final

from thermid.errors import RecordError, ThermidError
from thermid.measure.readers.columns import name_and_unit, spelt
from thermid.measure.readers.series import Series, merged
from thermid.measure.readers.stamps import TIME_NAMES, stamp_seconds
from thermid.measure.readers.textfile import MISSING, Cells, Layout, is_number
from thermid.units import unit

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


def is_influx(head: str) -> bool:
    """Whether a text begins as an annotated CSV of InfluxDB."""
    return head.startswith(("#datatype,", "#group,", "#default,"))


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
                raise RecordError("a table without _time and _value. Query a series, not an aggregate of one.", f"{file}:{number}")
            continue
        if len(row) != len(header):
            raise RecordError(
                f"{len(row)} columns stand in this line, {len(header)} in the header. Mend it, or take it out.", f"{file}:{number}"
            )
        cells = dict(zip(header, row, strict=True))
        name = _name_of(cells, header)
        texts, stamps, lines = series.setdefault(name, ([], [], []))
        texts.append(cells["_value"])
        stamps.append(cells["_time"])
        lines.append(number)
    return _as_cells(series, file, "_time", Layout("InfluxDB annotated CSV", "UTF-8", "comma"))


def _rows(text: str, file: str) -> Iterator[tuple[int, list[str]]]:
    """Return the rows of a CSV with their line numbers."""
    try:
        yield from enumerate(csv.reader(text.split("\n"), strict=True), 1)
    except csv.Error as error:
        raise RecordError(f"a quotation mark is out of place ({error}). Mend the line.", file) from None


def _name_of(cells: dict[str, str], header: Sequence[str]) -> str:
    """Return the field of a row with its tags, without what all rows share by their format."""
    tags = [cells.get(k, "") for k in header if k and not k.startswith("_") and k not in ("result", "table")]
    return " ".join(filter(None, [cells.get("_field", ""), *tags])) or cells.get("_measurement", "value")


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
            raise RecordError(f"'{name}' changes its unit here, from {of_unit[name]} to {units[row]}.", f"{cells.file}:{line}")
        texts, stamps, lines = series.setdefault(name, ([], [], []))
        text = cells.columns[values[0]][row].strip()
        texts.append("" if text.lower() in _LOST else text)
        stamps.append(cells.columns[times[0]][row].strip())
        lines.append(line)
    common = name_and_unit(cells.header[values[0]])[1]
    named = {}
    for name, held in series.items():
        said = of_unit.get(name) or common
        named[f"{name} [{said}]" if said else name] = held
    layout = replace(cells.layout, format="long table")
    out = _as_cells(named, cells.file, cells.header[times[0]], layout)
    return replace(out, notes=(*cells.notes, *out.notes), synthetic=cells.synthetic, commas=cells.commas)


def _is_key(column: Sequence[str]) -> bool:
    """Whether a column holds few texts, or numbers, that come again and again."""
    return 1 <= len({*column}) <= max(1, len(column) // 2)


def _remarked(cells: Cells, names: Sequence[str]) -> Cells:
    """Return cells with a remark where a column tells the rows of several things apart."""
    for at, name in enumerate(names):
        if name in _KEYS and _is_key(cells.columns[at]) and len(kinds := list(dict.fromkeys(cells.columns[at]))) > 1:
            of = f"'{cells.header[at]}' tells rows of {len(kinds)} things apart ({', '.join(kinds[:4])})"
            said = f"{of}: each column mixes their readings"
            return replace(cells, notes=(*cells.notes, said))
    return cells


def _as_cells(series: dict[str, tuple[list[str], list[str], list[int]]], file: str, time: str, layout: Layout) -> Cells:
    """Return the cells of series by name: texts, stamps, lines."""
    if not series:
        raise RecordError("there is a header and no samples below it.", file)
    out = []
    every = [stamp for _, stamps, _ in series.values() for stamp in stamps]
    axis, _ = stamp_seconds(every, file)
    begin = 0
    for name, (texts, stamps, lines) in series.items():
        own = axis[begin : begin + len(stamps)].tolist()
        begin += len(stamps)
        seen: dict[float, str] = {}
        for t, text, line in zip(own, texts, lines, strict=True):
            if seen.setdefault(t, text) != text:
                raise RecordError(
                    f"'{name}' has two readings at {stamps[own.index(t)]}, {seen[t]} and {text}. Name its rows apart, or take one out.",
                    f"{file}:{line}",
                )
        out.append(Series(name, texts, own, stamps, lines))
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
        made = _without_units(cells, at)
        if made is not None:
            header[at], columns[at] = made
    return cells if header == list(cells.header) else replace(cells, header=tuple(header), columns=columns)


def _without_units(cells: Cells, at: int) -> tuple[str, tuple[str, ...]] | None:
    """Return the header and the cells of a column whose cells carry units; None where the first one's is no unit."""
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
            raise RecordError(f"'{plain}' carries no unit; the cells above are in {text}.", cells.where(row, name))
        own = spelt(match["unit"])
        try:
            known = unit(own)
            text = text or own
            first = unit(text)
        except ThermidError as error:
            if not text:
                return None
            raise error.located(cells.where(row, name)) from None
        if own == text:
            out.append(match["number"])
        elif known.dimension == first.dimension and known.offset == first.offset == 0:
            out.append(repr(float(match["number"].replace(",", ".")) * float(known.factor / first.factor)))
        else:
            raise RecordError(f"'{plain}' is in {own}; the cells above are in {text}.", cells.where(row, name))
    return (f"{name} [{text}]", tuple(out)) if text else None
