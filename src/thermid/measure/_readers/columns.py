"""Cells to names, units and numbers. A cell that is neither a number nor a known sign of a missing one stops the reader, with its line.

The samples of a long text log are read in blocks by `numpy.loadtxt`: the layout is told from its first lines and its last two, as of a
short log, and every row must be as the first ones are. Where one is not, or a block holds text, the log is read cell by cell.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from thermid.base.errors import NameNotFoundError, RecordError, ThermidError, nearest
from thermid.measure._readers.headers import MISSING, name_and_unit, signed
from thermid.measure._readers.textfile import BLOCK, LOOKED_AT, SEPARATORS, UNFINISHED, Cells, cells_of_text, holds_cells
from thermid.measure._record.channel import FloatArray

_FRACTION = re.compile(r"\s*[+-]?\s*(\d+[.,]\d*|[.,]\d+)([eE][+-]?\d+)?\s*\Z")
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?\Z|[+-]?inf(inity)?\Z", re.IGNORECASE | re.ASCII)
LINES_AT_ONCE: Final = 5_000
"""Lines of a text log that are read at once; the layout is told from the first so many, and from the last two."""
_UNUSED: Final = "\x1f"  # no text log has it: `textfile` refuses control characters


def find_column(header: tuple[str, ...], wanted: str, where: str) -> int:
    """Return the place of a column, by its header as written or by the name before its unit.

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


def decimal_sign(cells: Cells, wanted: str | None) -> str:
    """Return '.' or ',': as given, or the one that the numbers of the file use.

    Raises
    ------
    RecordError   When the file has numbers with a comma and numbers with a point.
    """
    if wanted is not None:
        if wanted not in (".", ","):
            raise RecordError(f"decimal={wanted!r} is neither '.' nor ','.", cells.file, code="value.wrong-kind")
        return wanted
    texts = [column for column in cells.columns if not isinstance(column, NumberColumn)]
    if not cells.commas or not any("," in "".join(column) for column in texts):
        return "."
    first_of_sign: dict[str, tuple[str, int]] = {}
    for column in cells.columns:
        for sign in {",", "."} - set(first_of_sign):
            first = next(((cell, cells.lines[row]) for row, cell in enumerate(column) if sign in cell and _FRACTION.match(cell)), None)
            if first is not None:
                first_of_sign[sign] = first
    if len(first_of_sign) == 2:
        (comma, one), (point, other) = first_of_sign[","], first_of_sign["."]
        raise RecordError(
            f"the decimal sign is ambiguous: '{comma}' (line {one}) and '{point}' (line {other}). Give decimal=',' or decimal='.'.",
            cells.file,
            code="record.number-unclear",
        )
    return next(iter(first_of_sign), ".")


def numbers(cells: Sequence[str], decimal: str) -> FloatArray | int:
    """Return the numbers of a column (rows,), NaN where one is missing, or the row of the first cell that is text."""
    if isinstance(cells, NumberColumn) and decimal == ".":
        return cells.values
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
        word = signed(cell).strip()
        if _NUMBER.match(word):
            out[row] = float(word)
        elif cells[row].strip().lower() not in MISSING and word.lower().lstrip("+-") != "nan":
            return row
    return out


def kelvin_sized(values: FloatArray) -> bool:
    """Whether all readings (samples,) lie from 223 to 400: -50 to 127 degC if they are kelvin, hot if they are degC."""
    return bool(values.size and values.min() >= 223.0 and values.max() <= 400.0)


@dataclass(frozen=True, eq=False)
class NumberColumn(Sequence[str]):
    """The cells of a column of plain numbers as a sequence; the text of a cell is looked up in the file when it is asked for.

    Parameters
    ----------
    values : array (rows,)          The numbers.
    text : str                      Text of the file.
    starts : array (rows + 1,)      Where each line begins, and where one behind the last would.
    mark : str                      Separator.
    place : int                     Place of the column among the others.
    """

    values: FloatArray
    text: str
    starts: Any
    mark: str
    place: int

    def __len__(self) -> int:
        """How many rows there are."""
        return int(self.values.size)

    def __getitem__(self, row: Any) -> Any:
        """The cell of a row, as it is written."""
        at = range(len(self))[row]
        return self.text[self.starts[at] : self.starts[at + 1] - 1].split(self.mark)[self.place]


def table_of_text(text: str, file: str, separator: str | None, notes: Sequence[str] = ()) -> Cells:
    """Return the cells of a text as `cells_of_text` does, the columns of numbers of a long one as `NumberColumn`.

    Raises
    ------
    RecordError   As `cells_of_text`.
    """
    whole = _long_table(text.rstrip("\n") + "\n" if text.endswith("\n\n") else text, file, separator, notes)
    return whole or cells_of_text(text, file, separator, notes)


def _long_table(text: str, file: str, separator: str | None, notes: Sequence[str]) -> Cells | None:
    """Return the cells of a long text whose rows are all as the first ones; None where it is short, or a row is not."""
    if not text.isascii() or '"' in text or text.count("\n") < LINES_AT_ONCE + 2:
        return None
    blocks = ((at, text[at : at + BLOCK].encode("ascii")) for at in range(0, len(text), BLOCK))
    ends = (np.flatnonzero(np.frombuffer(block, np.uint8) == ord("\n")) + at + 1 for at, block in blocks)
    starts = np.concatenate([[0], *ends, [len(text) + 1][text.endswith("\n") :]], dtype=int, casting="unsafe")
    try:
        first_rows = cells_of_text(text[: starts[LINES_AT_ONCE]] + text[starts[-3] :], file, separator, notes)
    except ThermidError:  # told again below, with the line where it stands
        return None
    marks = [mark for mark, word in SEPARATORS.items() if word == first_rows.layout.separator]
    if len(first_rows.lines) < LOOKED_AT or not marks:
        return None
    cut = [note.endswith(UNFINISHED) for note in first_rows.notes]
    remarks = [f"line {starts.size - 1}, the last one, {UNFINISHED}" if c else note for c, note in zip(cut, first_rows.notes, strict=True)]
    columns = _columns(first_rows, text, starts[first_rows.lines[0] - 1 : starts.size - sum(cut)], marks[0])
    lines = range(first_rows.lines[0], starts.size - sum(cut))
    return None if columns is None else replace(first_rows, columns=columns, lines=lines, notes=tuple(remarks))


def _columns(first_rows: Cells, text: str, starts: Any, mark: str) -> list[Sequence[str]] | None:
    """Return the columns of all rows, numbers and texts as in the first rows; None where a row differs from these."""
    width = len(first_rows.columns)
    plain = [k for k, column in enumerate(first_rows.columns) if not isinstance(numbers(column, "."), int)]
    values = np.empty((len(plain), starts.size - 1))
    texts: dict[int, list[str]] = {k: [] for k in range(width) if k not in plain}
    for first in range(0, starts.size - 1, LINES_AT_ONCE):
        last = min(first + LINES_AT_ONCE, starts.size - 1)
        lines = text[starts[first] : starts[last] - 1].split("\n")
        parsed = _numbers_of_lines(lines, mark, plain, width)
        if parsed is None:
            return None
        values[:, first:last] = parsed
        for k, texts_of_column in texts.items():
            texts_of_column += [line.split(mark, k + 1)[k] for line in lines]
    values.flags.writeable = False  # so that a channel need not copy its own
    number_columns = {k: NumberColumn(row, text, starts, mark, k) for k, row in zip(plain, values, strict=True)}
    return [number_columns[k] if k in number_columns else texts[k] for k in range(width)]


def _numbers_of_lines(lines: list[str], mark: str, plain: list[int], width: int) -> FloatArray | None:
    """Return the numbers (columns, lines) of the columns `plain` of lines, NaN where one is missing, in the file's units.

    None where a cell is text, a line has not `width` cells, or is blank or a comment.
    """
    whole = len(plain) == width  # then what reads the numbers also sees how many there are
    if not whole and not ({line.count(mark) for line in lines} == {width - 1} and all(map(holds_cells, lines))):
        return None
    try:
        columns = np.loadtxt(lines, delimiter=mark, comments=None, ndmin=2, usecols=None if whole else plain).T
    except ValueError:  # some cell is empty, or text
        if whole and not ({line.count(mark) for line in lines} == {width - 1} and all(map(holds_cells, lines))):
            return None
        parsed = [numbers([line.split(mark)[k] for line in lines], ".") for k in plain]
        return None if any(isinstance(column, int) for column in parsed) else np.array(parsed)
    return columns if columns.shape == (len(plain), len(lines)) else None
