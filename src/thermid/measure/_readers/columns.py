"""Cells to names, units and numbers. A cell that is neither a number nor a known sign of a missing one stops the reader, with its line."""

from __future__ import annotations

import re
from typing import Final

import numpy as np

from thermid.base.errors import NameNotFoundError, RecordError, nearest
from thermid.measure._readers.headers import MISSING, name_and_unit
from thermid.measure._readers.textfile import Cells
from thermid.measure._record.channel import FloatArray

_FRACTION = re.compile(r"\s*[+-]?(\d+[.,]\d*|[.,]\d+)([eE][+-]?\d+)?\s*\Z")
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?\Z|[+-]?inf(inity)?\Z", re.IGNORECASE | re.ASCII)
_UNUSED: Final = "\x1f"  # no text log has it: `textfile` refuses control characters


def find_column(header: tuple[str, ...], wanted: str, where: str) -> int:
    """Return the place of a column, asked for by its header as written or by the name before its unit.

    Raises
    ------
    NameNotFoundError   When there is none.
    RecordError         When there are several.
    """
    hits = [at for at, name in enumerate(header) if name == wanted] or [
        at for at, name in enumerate(header) if name_and_unit(name)[0] == wanted
    ]
    if not hits:
        raise NameNotFoundError(
            f"no column '{wanted}'; there are {', '.join(header)}.{nearest(wanted, header)}", where, code="name.unknown"
        )
    if len(hits) > 1:
        raise RecordError(f"{len(hits)} columns have the name '{wanted}'. Rename all but one.", where, code="record.name-twice")
    return hits[0]


def decimal_sign(cells: Cells, given: str | None) -> str:
    """Return '.' or ',': as given, or the one that the numbers of the file use.

    Raises
    ------
    RecordError   When the file has numbers with a comma and numbers with a point.
    """
    if given is not None:
        if given not in (".", ","):
            raise RecordError(f"decimal={given!r} is neither '.' nor ','.", cells.file, code="value.wrong-kind")
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
            code="record.number-unclear",
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
        elif cells[row].strip().lower() not in MISSING and word.lower().lstrip("+-") != "nan":
            return row
    return out


def kelvin_sized(values: FloatArray) -> bool:
    """Whether readings (samples,) would all be hot in degC and usual in kelvin: -50 to 127 degC."""
    return bool(values.size and values.min() >= 223.0 and values.max() <= 400.0)
