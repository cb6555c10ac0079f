"""The cells of a text log, with their line numbers. What cannot be told from the file is asked for, never guessed."""

from __future__ import annotations

import codecs
import csv
import gzip
import io
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from thermid import files
from thermid.errors import MissingDataError, RecordError, nearest
from thermid.measure.part import SensorCertificate

__all__ = ["MISSING", "Cells", "is_number", "read_bytes", "read_cells"]

MISSING: Final = frozenset({"", "nan", "na", "n/a", "null"})
"""Cells that stand for a missing number, in any case of letters. A dash is none: in real logs it shows columns that have slipped."""

LARGEST_UNPACKED: Final = 200_000_000
"""Bytes that a packed log may have: some megabytes can hold what no memory does."""
_SEPARATORS: Final = {",": "comma", ";": "semicolon", "\t": "tab"}
_LOOKED_AT = 500
_MEND: Final = "Mend it, put '#' before it, or give the separator."
_LEAD: Final = frozenset({"", "#", " ", "\t", "\f"})
"""How a line may begin that holds no cells."""
_CONTROL: Final = bytes(set(range(32)) - set(b"\t\n\r\f")) + b"\x7f"
"""Signs that no text log has."""


@dataclass(frozen=True)
class Cells:
    """The cells of a log.

    Parameters
    ----------
    file : str                       Name of the file.
    header : tuple of str            Names as written.
    columns : list of tuples of str  Cells by column, in file order.
    lines : list of int              Line number of each row.
    notes : tuple of str             What a reader must know: encoding, separator, a dropped line.
    synthetic : bool                 Whether its first lines say so.
    reasons : mapping                Rows that are masked, by column and reason; of a log that names its faults.
    resolution : mapping             Step of a sensor, as text, where the log itself says it, by column.
    certificates : mapping           The same for its certificate.
    prompt : frozenset of str        Columns with a row at every change.
    commas : bool                    Whether a cell may hold a comma.
    """

    file: str
    header: tuple[str, ...]
    columns: list[tuple[str, ...]]
    lines: list[int]
    notes: tuple[str, ...]
    synthetic: bool = False
    reasons: Mapping[str, Mapping[str, list[int]]] = field(default_factory=dict)
    resolution: Mapping[str, str] = field(default_factory=dict)
    certificates: Mapping[str, SensorCertificate] = field(default_factory=dict)
    prompt: frozenset[str] = frozenset()
    commas: bool = True

    def where(self, row: int | None = None, column: str = "") -> str:
        """Return a place for a message: file, line, column."""
        line = "" if row is None else f":{self.lines[row]}"
        return f"{self.file}{line}" + (f", column '{column}'" if column else "")


def is_number(cell: str) -> bool:
    """Whether a cell is a number, with a point or a comma."""
    try:
        float(cell.replace(",", "."))
    except ValueError:
        return False
    return True


def _holds_cells(line: str) -> bool:
    return bool(line.strip()) and not line.lstrip().startswith("#")


def _plain_header(line: str, mark: str) -> str:
    """Return a header without its quotation marks, where no name needs them."""
    if line.count('"') % 2:
        return line
    try:
        names = next(csv.reader([line], delimiter=mark), [])
    except csv.Error:  # a name without end; the reader of rows says so
        return line
    plain = mark.join(names)
    return plain if '"' not in plain and plain.count(mark) == len(names) - 1 else line


def _columns(lines: list[tuple[int, str]], mark: str) -> list[tuple[str, ...]] | None:
    """Return the columns, header included, of lines without quotation marks that all have as many cells; None where they do not."""
    if len({line.count(mark) for _, line in lines}) != 1:
        return None
    cells = mark.join([line for _, line in lines]).split(mark)
    width = lines[0][1].count(mark) + 1
    return [tuple(cells[k::width]) for k in range(width)]


def read_cells(data: bytes, file: str, separator: str | None) -> Cells:
    """Return the cells of a log: commas, semicolons or tabs; lines that are blank or start with '#' left out.

    Raises
    ------
    RecordError   When it is empty, binary, has no samples, or its columns cannot be told.
    """
    text, notes = _text(data, file)
    whole = text.endswith("\n")
    lines = [(number, line) for number, line in enumerate(text.split("\n"), 1) if line[:1] not in _LEAD or _holds_cells(line)]
    if not lines:
        raise RecordError("the file is empty." if not text.strip() else "the file has only comments.", file)
    mark = _separator(lines, separator, file)
    lines[0] = (lines[0][0], _plain_header(lines[0][1], mark))
    columns = None if any('"' in line for _, line in lines) else _columns(lines, mark)
    if columns is None:
        rows, numbers = _rows(lines, mark, file)
    else:  # all lines have as many cells, so the first one and the last two tell the rest
        rows, numbers = list(map(list, zip(*((c[0], *c[1:][-2:]) for c in columns), strict=True))), [number for number, _ in lines]
    header = tuple(name.strip() or f"column {at}" for at, name in enumerate(rows[0], 1))
    if all(is_number(name) for name in rows[0]):
        raise RecordError(
            "the first line holds numbers; a header line with the names of the columns is needed above it.", f"{file}:{numbers[0]}"
        )
    rows, numbers = rows[1:], numbers[1:]
    rows, cut = _without_cut_line(rows, len(header), whole)
    if cut:
        notes.append(f"line {numbers[-1]}, the last one, is cut short and was dropped")
        numbers = numbers[:-1]
    if columns is not None:
        columns = [column[1 : len(numbers) + 1] for column in columns]
    if not rows:
        raise RecordError("there is a header and no samples below it.", file)
    for row, number in zip(rows, numbers, strict=False):
        if len(row) != len(header):
            twice = mark == "," and len(row) == 2 * len(header)
            hint = "Commas seem to be the decimal sign too: export the log with semicolons." if twice else _MEND
            raise RecordError(f"{len(row)} columns stand in this line, {len(header)} in the header. {hint}", f"{file}:{number}")
    synthetic = any(line.lstrip().startswith("#") and "SYNTHETIC" in line for line in text.split("\n", 20)[:20])
    commas = columns is None or mark != ","
    return Cells(file, header, columns or list(zip(*rows, strict=True)), numbers, tuple(notes), synthetic, commas=commas)


def read_bytes(place: Path) -> bytes:
    """Return the bytes of a file, unpacked where it is packed by gzip.

    Raises
    ------
    MissingDataError   When it does not exist.
    RecordError        When it is a folder, or a damaged gzip file.
    """
    if not place.exists():
        near = (
            nearest(place.name, [each.name for each in place.parent.iterdir()])
            if place.parent.is_dir()
            else " Its folder does not exist either."
        )
        raise MissingDataError(f"there is no such file.{near} Check the path, or fetch the log first.", str(place))
    if place.is_dir():
        raise RecordError("this is a folder; the path of one log is needed.", str(place))
    data = files.read_bytes(place)
    if data[:2] == b"\x1f\x8b":
        try:
            with gzip.GzipFile(fileobj=io.BytesIO(data)) as packed:
                data = packed.read(LARGEST_UNPACKED + 1)
        except (EOFError, OSError, zlib.error) as error:
            raise RecordError(f"the gzip file is damaged or cut short ({error}). Fetch it again.", place.name) from None
        if len(data) > LARGEST_UNPACKED:
            raise RecordError(
                f"it unpacks to more than {LARGEST_UNPACKED / 1e6:.0f} MB. If that is right, unpack it and give the plain file.", place.name
            )
    return data


def _text(data: bytes, file: str) -> tuple[str, list[str]]:
    """Return the text of a file with plain line ends, and notes on how it was read."""
    text, notes = _decoded(data, file)
    return text.replace("\r\n", "\n").replace("\r", "\n"), notes


def _decoded(data: bytes, file: str) -> tuple[str, list[str]]:
    """Return the text of some bytes.

    Raises
    ------
    RecordError   When they hold what no text holds.
    """
    binary = "this is a binary file, not a text log" + (" (a workbook or archive)" if data[:2] == b"PK" else "") + ". Export it as CSV."
    try:
        if data[:2] in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE):
            text, notes = data.decode("utf-16"), ["read as UTF-16"]
        else:
            text, notes = data.decode("utf-8-sig"), []
    except UnicodeDecodeError:
        # older loggers write the degree sign in Latin-1, which takes any byte; control characters still show a binary file
        text, notes = data.decode("latin-1"), ["read as Latin-1, because it is not UTF-8"]
    plain = text.encode() if notes == ["read as UTF-16"] else data
    if len(plain.translate(None, _CONTROL)) < len(plain):
        raise RecordError(binary, file)
    return text, notes


def _split(lines: list[tuple[int, str]], mark: str) -> list[int]:
    """Return the number of columns of each line."""
    try:
        return [len(row) for row in csv.reader((line for _, line in lines), delimiter=mark)]
    except csv.Error:
        return []


def _separator(lines: list[tuple[int, str]], given: str | None, file: str) -> str:
    """Return the separator: as given, or the only one that gives every line as many columns as the header.

    Raises
    ------
    RecordError   When none or several do.
    """
    if given is not None:
        if len(given) != 1 or given in '"\r\n':
            raise RecordError(f"separator {given!r} is not one character, such as ',' or ';' or '\\t'.", file)
        return given
    # the last line of a log is often cut short
    looked = lines[:_LOOKED_AT] if len(lines) > _LOOKED_AT else lines[: max(2, len(lines) - 1)]
    counts = {mark: found for mark in _SEPARATORS if (found := _split(looked, mark)) and found[0] > 1}
    if not counts:
        raise RecordError(
            f"no comma, semicolon or tab divides the header '{lines[0][1][:60]}'. Give separator='...'.", f"{file}:{lines[0][0]}"
        )
    even = [mark for mark, found in counts.items() if all(count == found[0] for count in found)]
    # one bad line must not hide the separator: it is named later, with its number
    usual = even or [mark for mark, found in counts.items() if sum(count == found[0] for count in found) > 0.5 * len(found)] or list(counts)
    if len(usual) == 1:
        return usual[0]
    names = " and ".join(f"{_SEPARATORS[mark]} ({counts[mark][0]} columns)" for mark in usual)
    raise RecordError(
        f"the separator is ambiguous: {names} both fit. Give separator='{usual[0] if usual[0] != chr(9) else chr(92) + 't'}' or the other.",
        file,
    )


def _rows(lines: list[tuple[int, str]], mark: str, file: str) -> tuple[list[list[str]], list[int]]:
    """Return the rows and their line numbers."""
    reader = csv.reader((line for _, line in lines), delimiter=mark, strict=True)
    rows, numbers = [], []
    try:
        for row in reader:
            rows.append(row)
            numbers.append(lines[reader.line_num - 1][0])
    except csv.Error as error:
        at = lines[min(len(rows), len(lines) - 1)][0]
        raise RecordError(f"a quotation mark is out of place ({error}). Mend the line.", f"{file}:{at}") from None
    return rows, numbers


def _without_cut_line(rows: list[list[str]], columns: int, whole: bool) -> tuple[list[list[str]], bool]:
    """Drop the last row where writing stopped in the middle: columns are missing, or no line end follows and its last cell is no number."""
    if not rows:
        return rows, False
    last = rows[-1]
    cut = len(last) < columns
    if not cut and not whole and len(rows) > 1 and len(last) == len(rows[-2]):
        cut = is_number(rows[-2][-1]) and not is_number(last[-1]) and last[-1].strip().lower() not in MISSING
    return (rows[:-1], True) if cut else (rows, False)
