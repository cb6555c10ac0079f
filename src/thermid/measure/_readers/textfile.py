"""The cells of a text log, with their line numbers. What cannot be told from the file is asked for, never guessed."""

from __future__ import annotations

import codecs
import csv
import gzip
import io
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final, NamedTuple

from thermid.base import files
from thermid.base.errors import MissingDataError, RecordError, cap, errors_at, nearest, raising
from thermid.base.units import counted
from thermid.measure._readers.headers import (
    MISSING,
    MOST_NAMES,
    TIMELY,
    counts_columns,
    is_number,
    lines_of_names,
    may_name,
    may_number,
    name_and_unit,
    numbers_a_channel,
    one_line_of_names,
    refuse_two_units,
    with_units_above,
    with_units_row,
)
from thermid.measure._record.sensor import SensorCertificate

SEPARATORS: Final = {",": "comma", ";": "semicolon", "\t": "tab"}
LOOKED_AT = 500
MAX_CUT_SHARE: Final = 0.03
"""Part of the lines of a log up to which lines with fewer cells than the header are dropped: more are another layout. [-]"""
UNFINISHED: Final = "is incomplete and was dropped"
"""What is said of a last line that is still being written."""
_MEND: Final = "Correct the line, put '#' before it, or give the separator."
_HEAD: Final = MOST_NAMES + 4
"""Lines in which a head ends: names, units, what was done with samples, and two of samples."""
LEAD: Final = frozenset({"", "#", " ", "\t", "\f"})
"""How a line may begin that holds no cells."""
BLOCK: Final = 1_000_000
"""Characters that are looked through at once: a whole text would be copied."""
_CONTROL: Final = bytes(set(range(32)) - set(b"\t\n\r\f")) + b"\x7f"
"""Signs that no text log has."""
_MARKED: Final = dict.fromkeys(_CONTROL, "\ufffd")
MAX_BROKEN_LINES: Final = 0.01
"""Share of lines with such signs up to which a file is a text that was broken on its way. [-]"""


@dataclass(frozen=True)
class Layout:
    """How a log is laid out, for a person.

    Parameters
    ----------
    format : str       Name of the format.
    encoding : str     Encoding of its text; empty where it is no text.
    separator : str    Separator of its columns in words.
    preamble : int     Number of lines above the header that hold no samples.
    units_row : bool   Whether units stand in a row of their own.
    """

    format: str = "text"
    encoding: str = "UTF-8"
    separator: str = ""
    preamble: int = 0
    units_row: bool = False


@dataclass(frozen=True)
class Cells:
    """The cells of a log by column, before they are numbers.

    Parameters
    ----------
    file : str                       Name of the file.
    header : tuple of str            Names as written.
    columns : sequence of sequences  Cells by column, in file order: texts, in a tuple or a `NumberColumn`.
    lines : sequence of int          Line number of each row.
    notes : tuple of str             Remarks for a reader: encoding, separator, a dropped line.
    synthetic : bool                 Whether its first lines state that it is synthetic.
    reasons : mapping                Column -> reason -> masked rows, of a log that names its faults.
    resolution : mapping             Column -> step of the sensor as text, where the log states it.
    certificates : mapping           Column -> certificate of the sensor, where the log states it.
    prompt : frozenset of str        Columns with a row at every change.
    commas : bool                    Whether a cell may hold a comma.
    time : str                       Name of the time column, where the format states it.
    start : str or None              Start of the times, where they are numbers and the format states it.
    layout : Layout                  How the cells stand in the file.
    """

    file: str
    header: tuple[str, ...]
    columns: Sequence[Sequence[str]]
    lines: Sequence[int]
    notes: tuple[str, ...]
    synthetic: bool = False
    reasons: Mapping[str, Mapping[str, list[int]]] = field(default_factory=dict)
    resolution: Mapping[str, str] = field(default_factory=dict)
    certificates: Mapping[str, SensorCertificate] = field(default_factory=dict)
    prompt: frozenset[str] = frozenset()
    commas: bool = True
    time: str = ""
    start: str | None = None
    layout: Layout = field(default_factory=lambda: Layout())

    def where(self, row: int | None = None, column: str = "") -> str:
        """Return a place for a message: file, line of a row, column."""
        line = "" if row is None else f":{self.lines[row]}"
        return f"{self.file}{line}" + (f", column '{column}'" if column else "")


def holds_cells(line: str) -> bool:
    """Whether a line is neither blank nor a comment."""
    return bool(line.strip()) and not line.lstrip().startswith("#")


def _plain_header(line: str, mark: str) -> str:
    """Return a header line without its quotation marks, where no name needs them."""
    if line.count('"') % 2:
        return line
    try:
        names = next(csv.reader([line], delimiter=mark), [])
    except csv.Error:  # a name without end, which the reader of rows refuses
        return line
    plain = mark.join(names)
    return plain if '"' not in plain and plain.count(mark) == len(names) - 1 else line


def _columns(lines: list[tuple[int, str]], mark: str) -> list[tuple[str, ...]] | None:
    """Return the columns, header included, of lines without quotation marks; None where the lines differ in their number of cells."""
    if len({line.count(mark) for _, line in lines}) != 1:
        return None
    cells = mark.join([line for _, line in lines]).split(mark)
    width = lines[0][1].count(mark) + 1
    return [tuple(cells[k::width]) for k in range(width)]


def cells_of_text(text: str, file: str, separator: str | None, notes: Sequence[str] = ()) -> Cells:
    """Return the cells of a text with plain line ends: commas, semicolons or tabs; lines that are blank or start with '#' left out.

    Lines above the header (a preamble) are passed over where the samples below have another number of columns, and a row of units below the
    header is joined to it.

    Raises
    ------
    RecordError   When it is empty, binary, has no samples, or its columns cannot be told.
    """
    notes = list(notes)
    whole = text.endswith("\n")
    every = list(enumerate(text.split("\n"), 1))
    lines = [(number, line) for number, line in every if line[:1] not in LEAD or holds_cells(line)]
    if not lines:
        raise RecordError("the file is empty." if not text.strip() else "the file has only comments.", file, code="record.no-samples")
    lines, again = _without_repeats(lines)
    if again:
        shown = ", ".join(map(str, again[:3])) + (", ..." if len(again) > 3 else "")
        notes.append(f"the lines above the samples stand again in the middle (line {shown}): a restart of the logger, skipped")
    above, lines, mark = _below_preamble(lines, separator)
    mark = mark or _separator(lines, separator, file)
    rows, numbers, columns = _table(every, lines, mark, file, notes, above)
    width = len(rows[0])
    rows, numbers, columns, notes_on_names = _with_one_line_of_names(rows, numbers, columns, file)
    notes += notes_on_names
    header, extra = with_units_row(rows)
    if header.units:
        with errors_at(f"{file}:{numbers[1]}"):
            refuse_two_units(rows[0], rows[1])
    if extra:
        notes.append(
            f"line {numbers[extra]}: a row of units below the header"
            if header.units
            else f"line {numbers[extra]} below the header holds no samples"
        )
    names = _named_above(header.names, _cells_of_lines(every[:above], mark), notes)
    names = with_units_above(names, _cells_of_lines([(n, line.lstrip("#% ")) for n, line in every[: numbers[0] - 1]], mark))
    rows, numbers = rows[extra + 1 :], numbers[extra + 1 :]
    rows, numbers, notes_on_cut = _without_cut_lines(rows, numbers, width, whole)
    notes += notes_on_cut
    if columns is not None:
        columns = [column[extra + 1 : len(numbers) + extra + 1] for column in columns]
    if not rows:
        raise RecordError(
            "the file has a header but no samples below it. Export the log again, with its data.", file, code="record.no-samples"
        )
    _refuse_odd_rows(rows, numbers, width, mark, file)
    synthetic = any(
        line.lstrip(' "#').startswith("SYNTHETIC") or ("#" in line[:3] and "SYNTHETIC" in line) for line in text.split("\n", 20)[:20]
    )
    layout = Layout(
        separator=SEPARATORS.get(mark, mark),
        preamble=above,
        units_row=header.units,
        encoding=next((note.split()[2].rstrip(",") for note in notes if note.startswith("read as ")), "UTF-8"),
    )
    commas, table = columns is None or mark != ",", columns or list(zip(*rows, strict=True))
    return Cells(file, names, table, numbers, tuple(notes), synthetic, commas=commas, layout=layout)


def _named_above(names: tuple[str, ...], above: Sequence[Sequence[str]], notes: list[str]) -> tuple[str, ...]:
    """Return names, those of numbered channels as a table above the header has them: `CH1, LID, ...`; as they are where two are alike."""
    titles = {row[0].strip(): row[1].strip() for row in above if len(row) > 1 and row[1].strip() and numbers_a_channel(row[0])}
    named = [name.replace(short, titles.get(short, short), 1) for name in names for short in [name_and_unit(name)[0]]]
    if named == [*names] or len({*named}) < len(named):
        return names
    notes.append("channels are named by the table above the header")
    return tuple(named)


Table = tuple[list[list[str]], list[int], list[tuple[str, ...]] | None]
"""Rows of cells, their line numbers, and the columns where all lines have as many cells; then the rows are the first and the last two."""


def _table(every: list[tuple[int, str]], lines: list[tuple[int, str]], mark: str, file: str, notes: list[str], above: int) -> Table:
    """Return the header and what stands below it in `lines`, of `every` line of the file, without separators at the ends of lines.

    Raises
    ------
    RecordError   When the first line holds numbers and no comment above it names them.
    """
    lines[0] = (lines[0][0], _plain_header(lines[0][1], mark))
    columns = None if any('"' in line for _, line in lines) else _columns(lines, mark)
    if columns is None:
        rows, numbers = _rows(lines, mark, file)
    else:  # all lines have as many cells, so the first ones and the last two tell the rest
        rows, numbers = list(map(list, zip(*((*c[:_HEAD], *c[_HEAD:][-2:]) for c in columns), strict=True))), [n for n, _ in lines]
    if above:
        notes.append(f"{counted(above, 'line')} above the header in line {numbers[0]} skipped")
    if all(is_number(name) for name in rows[0]) and lines_of_names(rows, numbers) == 1:
        names = _comment_above(every, numbers[0], mark, len(rows[0]))
        if names is None:
            raise RecordError(
                "the first line holds numbers. Add a header line with the names of the columns above it.",
                f"{file}:{numbers[0]}",
                code="record.layout-unclear",
            )
        rows, numbers = _rows(lines, mark, file)
        rows, numbers, columns = [names, *rows], [numbers[0] - 1, *numbers], None
        notes.append("the header was read from the comment above the samples")
    if ends := _ends_with_separator(rows):
        rows[:ends], columns = [row[:-1] for row in rows[:ends]], None
    width = len(rows[0])
    if len(rows) > 1 and all(len(row) == width + 1 and not row[-1].strip() for row in rows[1:]):
        rows, columns = [rows[0], *(row[:-1] for row in rows[1:])], None  # samples that end with a separator, as their header does not
    return rows, numbers, columns


def _refuse_odd_rows(rows: list[list[str]], numbers: list[int], width: int, mark: str, file: str) -> None:
    """Refuse samples that are not `width` cells wide, and a first one that may number the columns.

    Raises
    ------
    RecordError   With the line.
    """
    if counts_columns(rows):
        raise RecordError(
            f"'{mark.join(rows[0])}' may number the columns: only the lines below it have decimals. Put '#' before the line, or, if it "
            "is a sample, write it with decimals.",
            f"{file}:{numbers[0]}",
            code="record.layout-unclear",
        )
    for row, number in zip(rows, numbers, strict=False):
        if len(row) != width:
            twice = mark == "," and len(row) == 2 * width
            hint = "Commas seem to be the decimal sign too. Export the log with semicolons." if twice else _MEND
            raise RecordError(
                f"{len(row)} cells in this line, {width} columns in the header. {hint}", f"{file}:{number}", code="record.layout-unclear"
            )


def _ends_with_separator(rows: list[list[str]]) -> int:
    """Return how many lines from the first on end with a separator, where the samples below do not."""
    width = len(rows[0])
    for at, row in enumerate(rows[:_HEAD]):
        if len(row) == width - 1:
            return at
        if len(row) != width or row[-1].strip():
            break
    return 0


def _with_one_line_of_names(
    rows: list[list[str]], numbers: list[int], columns: list[tuple[str, ...]] | None, file: str
) -> tuple[list[list[str]], list[int], list[tuple[str, ...]] | None, list[str]]:
    """Return rows, line numbers and columns with one line of names where several stand above each other, and what was assumed.

    Raises
    ------
    RecordError   When the lines contradict each other.
    """
    count = lines_of_names(rows, numbers)
    if count == 1:
        return rows, numbers, columns, []
    with errors_at(f"{file}:{numbers[0]}"):
        names, note = one_line_of_names(rows[:count], numbers[:count])
    if columns is not None:
        columns = [(name, *column[count:]) for name, column in zip(names, columns, strict=True)]
    return [names, *rows[count:]], numbers[count - 1 :], columns, [note]


def _without_repeats(lines: list[tuple[int, str]]) -> tuple[list[tuple[int, str]], list[int]]:
    """Return the lines without repeats of those above the first samples, and the numbers of the repeats."""
    first = next((at for at, (_, line) in enumerate(lines[:LOOKED_AT]) if TIMELY.search(line) or _has_number(line)), len(lines))
    heads = {line for _, line in lines[:first]}
    again = [number for number, line in lines[first:] if line in heads] if heads else []
    left = {*again}
    for k in (k for k, (number, _) in enumerate(lines) if number in left):  # a board greets before it writes its header again
        while not _has_number(lines[k - 1][1]) and not TIMELY.search(lines[k - 1][1]):
            k -= 1
            left.add(lines[k][0])
    return ([*lines[:first], *((n, line) for n, line in lines[first:] if n not in left)] if again else lines), again


def _has_number(line: str) -> bool:
    """Whether a line holds a number between separators."""
    return any(is_number(cell.strip('" ')) for mark in SEPARATORS for cell in line.split(mark))


def _below_preamble(lines: list[tuple[int, str]], separator: str | None) -> tuple[int, list[tuple[int, str]], str | None]:
    """Return how many lines stand above the header, the lines from there on, and their separator where a preamble was passed over.

    The samples are the longest run of lines with as many cells, numbers or stamps among them; the header is the nearest line above with
    as many cells and without numbers. A first line that is as wide as the samples is the header itself.
    """
    looked = lines[:LOOKED_AT]
    candidates: list[tuple[int, int, int, str]] = []
    for mark in SEPARATORS if separator is None else [separator]:
        if len(mark) != 1 or mark in '"\r\n':
            return 0, lines, None
        split = _cells_of_lines(looked, mark)
        start, length = _longest_run(split)
        if length > 1:
            if _wordy(split[0]) and len(split[0]) in (len(split[start]), len(split[start]) + 1) and start < 4:
                if not any(may_name(row, len(split[0])) for row in split[1:start]):
                    return 0, lines, None  # the usual file: a header, and samples below
            head = _first_of_names(split, [number for number, _ in looked], _header_above(split, start))
            candidates.append((length * len(split[start]), start, head, mark))
    _, _, head, mark = max(candidates, default=(0, 0, -1, ""))
    return (0, lines, None) if head < 1 else (lines[head][0] - 1, lines[head:], mark)


def _comment_above(every: list[tuple[int, str]], first: int, mark: str, width: int) -> list[str] | None:
    """Return the names of the columns where the line above line `first` is a comment with `width` names, else None."""
    if first < 2:
        return None
    line = every[first - 2][1].strip()
    names = [name.strip() for name in line.lstrip("#%; ").split(mark)]
    return names if line.startswith("#") and len(names) == width and not any(is_number(name) for name in names) else None


def _cells_of_lines(lines: list[tuple[int, str]], mark: str) -> list[list[str]]:
    """Return the cells of each line; a line with a misplaced quotation mark is one cell."""
    out = []
    for _, line in lines:
        if '"' not in line:
            out.append(line.split(mark))
            continue
        try:
            out.append(next(csv.reader([line], delimiter=mark), []))
        except csv.Error:
            out.append([line])
    return out


def _holds_samples(row: Sequence[str]) -> bool:
    """Whether a row has two cells or more and a number among them."""
    return len(row) > 1 and any(is_number(cell) for cell in row)


def _longest_run(rows: list[list[str]]) -> tuple[int, int]:
    """Return the first row and the length of the longest run of rows with as many cells and a number in each."""
    best, start = (0, 0), 0
    for at in range(len(rows) + 1):
        inside = at < len(rows) and _holds_samples(rows[at]) and (at == start or len(rows[at]) == len(rows[start]))
        if not inside:
            if at - start > best[1]:
                best = (start, at - start)
            start = at if at < len(rows) and _holds_samples(rows[at]) else at + 1
    return best


def _header_above(rows: list[list[str]], start: int) -> int:
    """Return the index of the row that can be the header of the samples from row `start` on; -1 where none can.

    It is the highest of adjacent rows of names of their width, among the three above the samples; rows of units between do not count.
    """
    near = [at for at in range(start - 1, max(start - 4, -1), -1) if len(rows[at]) in (len(rows[start]), len(rows[start]) + 1)]
    wordy = [at for at in near if _wordy(rows[at])]
    if not wordy:
        return -1
    block = [wordy[0]]
    for at in wordy[1:]:
        if at == block[-1] - 1 and with_units_row([rows[at], rows[block[-1]], rows[start], rows[start]])[1]:
            block.append(at)
        else:
            break
    # of a header, a row of units and a row of what was done, the header is the highest
    return next(
        (at for at in reversed(block) if at + with_units_row([rows[at], *rows[at + 1 : start + 1], rows[start]])[1] + 1 >= start), block[0]
    )


def _first_of_names(rows: list[list[str]], numbers: list[int], head: int) -> int:
    """Return the first of the rows of names directly above each other, of which row `head` is the last."""
    first = head
    while 0 < first > head + 1 - MOST_NAMES and numbers[first] == numbers[first - 1] + 1 and may_name(rows[first], len(rows[head])):
        above = rows[first - 1]
        if may_name(above, len(rows[head])):
            first -= 1
        else:
            return first - 1 if may_number(above, len(rows[head])) else first
    return first


def _wordy(row: Sequence[str]) -> bool:
    """Whether a line holds names: no number or stamp among its cells, and half of them at least are not empty."""
    return not any(is_number(cell) or (cell.lstrip()[:1].isdigit() and TIMELY.search(cell)) for cell in row) and 2 * sum(
        bool(cell.strip()) for cell in row
    ) >= len(row)


def read_bytes(place: Path) -> bytes:
    """Return the bytes of a file, unpacked where it is packed by gzip.

    Raises
    ------
    MissingDataError   When it does not exist.
    RecordError        When it is a folder, or a damaged gzip file.
    """
    if not place.exists():
        near = (
            nearest(place.name, [neighbour.name for neighbour in place.parent.iterdir()])
            if place.parent.is_dir()
            else " Its folder does not exist either."
        )
        raise MissingDataError(f"the file does not exist.{near} Check the path, or fetch the log first.", str(place))
    if place.is_dir():
        raise RecordError("this is a folder. Give the path of one log.", str(place), code="file.not-a-file")
    data = files.read_bytes(place)
    if data[:2] == b"\x1f\x8b":
        try:
            with gzip.GzipFile(fileobj=io.BytesIO(data)) as packed:
                data = packed.read(int(cap("unpacked")) + 1)
        except (EOFError, OSError, zlib.error) as error:
            raise RecordError(
                f"the gzip file is damaged or cut short ({error}). Fetch it again.", place.name, code="record.damaged"
            ) from None
        if len(data) > cap("unpacked"):
            raise RecordError(
                f"it unpacks to more than {cap('unpacked') / 1e6:.0f} MB. If that is right, unpack it and give the plain file."
                f"{raising('unpacked')}",
                place.name,
                code="cap.exceeded",
            )
    return data


def decoded(data: bytes, file: str) -> tuple[str, list[str]]:
    """Return the text of a file with plain line ends, and notes on its encoding.

    Raises
    ------
    RecordError   When it is no text.
    """
    wide = "utf-16" if data[:2] in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE) else ""
    for zero, order in ((1, "utf-16-le"), (0, "utf-16-be")):  # without a mark: every other byte of Latin letters is zero
        if len(data) > 3 and not any(data[zero:200:2]) and all(data[1 - zero : 200 : 2]):
            wide = order
    try:
        text, notes = data.decode(wide or "utf-8-sig"), ["read as UTF-16"] if wide else []
    except UnicodeDecodeError:
        # older loggers write the degree sign in Latin-1, which takes any byte; control characters still show a binary file
        text, notes = data.decode("latin-1"), ["read as Latin-1, because it is not UTF-8"]
    plain = text.encode() if notes == ["read as UTF-16"] else data
    blocks = (plain[at : at + BLOCK] for at in range(0, len(plain), BLOCK))
    if any(len(block.translate(None, _CONTROL)) < len(block) for block in blocks):
        lines = text.splitlines()
        broken = [k for k, line in enumerate(lines, 1) if line.translate(_MARKED) != line]
        if data[:2] == b"PK" or len(broken) > MAX_BROKEN_LINES * len(lines):
            packed = " (a workbook or archive)" if data[:2] == b"PK" else ""
            advice = f"Export it as CSV, or take out line {broken[0]} if a transmission broke there."
            raise RecordError(f"this is a binary file, not a text log{packed}. {advice}", file, code="record.damaged")
        text = text.translate(_MARKED)  # a cell with a mark is no number
        notes.append(f"{counted(len(broken), 'line')} with signs that no text has, as broken transmissions leave them (line {broken[0]})")
    return text.replace("\r\n", "\n").replace("\r", "\n"), notes


def _split(lines: list[tuple[int, str]], mark: str) -> list[int]:
    """Return the number of cells of each line; empty where quotation marks do not match."""
    try:
        return [len(row) for row in csv.reader((line for _, line in lines), delimiter=mark)]
    except csv.Error:
        return []


def _separator(lines: list[tuple[int, str]], wanted: str | None, file: str) -> str:
    """Return the separator: as given, or the only one that gives every line as many cells as the header.

    Raises
    ------
    RecordError   When none or several do.
    """
    if wanted is not None:
        if len(wanted) != 1 or wanted in '"\r\n':
            raise RecordError(f"separator {wanted!r} is not a single character. Give ',' or ';' or '\\t'.", file, code="value.wrong-kind")
        return wanted
    # the last line of a log is often cut short
    looked = lines[:LOOKED_AT] if len(lines) > LOOKED_AT else lines[: max(2, len(lines) - 1)]
    counts = {mark: widths for mark in SEPARATORS if (widths := _split(looked, mark)) and widths[0] > 1}
    if not counts:
        raise RecordError(
            f"no comma, semicolon or tab divides the header '{lines[0][1][:60]}'. Give separator='...'.",
            f"{file}:{lines[0][0]}",
            code="record.layout-unclear",
        )
    even = [mark for mark, widths in counts.items() if all(count == widths[0] for count in widths)]
    # one bad line must not hide the separator: it is named later, with its number
    usual = (
        even or [mark for mark, widths in counts.items() if sum(count == widths[0] for count in widths) > 0.5 * len(widths)] or list(counts)
    )
    if len(usual) == 1:
        return usual[0]
    names = " and ".join(f"{SEPARATORS[mark]} ({counts[mark][0]} columns)" for mark in usual)
    raise RecordError(
        f"the separator is ambiguous: {names} are both possible. Give separator='{usual[0] if usual[0] != chr(9) else chr(92) + 't'}' "
        "or the other.",
        file,
        code="record.layout-unclear",
    )


def _rows(lines: list[tuple[int, str]], mark: str, file: str) -> tuple[list[list[str]], list[int]]:
    """Return the rows of cells and their line numbers.

    Raises
    ------
    RecordError   When a quotation mark is misplaced.
    """
    reader = csv.reader((line for _, line in lines), delimiter=mark, strict=True)
    rows, numbers = [], []
    try:
        for row in reader:
            rows.append(row)
            numbers.append(lines[reader.line_num - 1][0])
    except csv.Error as error:
        at = lines[min(len(rows), len(lines) - 1)][0]
        raise RecordError(
            f"a quotation mark is misplaced ({error}). Correct the line.", f"{file}:{at}", code="record.layout-unclear"
        ) from None
    return rows, numbers


def _without_cut_lines(rows: list[list[str]], numbers: list[int], width: int, whole: bool) -> tuple[list[list[str]], list[int], list[str]]:
    """Return rows and line numbers without those that were cut while they were written, and a note on these.

    The last one has fewer cells than there are columns, or no line end follows and its last cell is no number. Of a board that restarts, or
    a port that loses characters, few others have fewer cells; where more have, the layout is another one.
    """
    notes = []
    cut = bool(rows) and len(rows[-1]) < width
    if not cut and not whole and len(rows) > 1 and len(rows[-1]) == len(rows[-2]):
        cut = is_number(rows[-2][-1]) and not is_number(rows[-1][-1]) and rows[-1][-1].strip().lower() not in MISSING
    if cut:
        rows, numbers, notes = rows[:-1], numbers[:-1], [f"line {numbers[-1]}, the last one, {UNFINISHED}"]
    short = [k for k, row in enumerate(rows) if len(row) < width]
    if not 0 < len(short) <= MAX_CUT_SHARE * len(rows):
        return rows, numbers, notes
    places = ", ".join(str(numbers[k]) for k in short[:3]) + ", ..." * (len(short) > 3)
    notes.append(f"{counted(len(short), 'line')} with fewer cells than the header dropped, as cut while written (line {places})")
    kept = [k for k, row in enumerate(rows) if len(row) >= width]
    return [rows[k] for k in kept], [numbers[k] for k in kept], notes


class ChannelSeries(NamedTuple):
    """Samples of one sensor with times of their own.

    Parameters
    ----------
    name : str                  With its unit in a bracket, where known.
    texts : sequence of str     Its cells.
    times : sequence of float   Their times on an axis common to all series, in any order. [s]
    stamps : sequence of str    The times as the file has them.
    lines : sequence of int     Their lines in the file.
    """

    name: str
    texts: Sequence[str]
    times: Sequence[float]
    stamps: Sequence[str]
    lines: Sequence[int]


def merged(
    series: Sequence[ChannelSeries], file: str, time: str, notes: tuple[str, ...], layout: Layout, start: str | None = None
) -> Cells:
    """Return the cells of several series on one axis: a row for each time of any of them, empty cells where a series has none.

    Parameters
    ----------
    series : sequence       The series.
    file, time : str        Name of the file, and header of the time column.
    notes, layout, start    As in `Cells`.
    """
    rows: dict[float, tuple[str, int]] = {}
    for channel_series in series:
        for t, stamp, line in zip(channel_series.times, channel_series.stamps, channel_series.lines, strict=True):
            rows.setdefault(t, (stamp, line))
    axis = sorted(rows)
    columns: list[Sequence[str]] = [tuple(rows[t][0] for t in axis)]
    for channel_series in series:
        values: Mapping[float, str] = dict(zip(channel_series.times, channel_series.texts, strict=True))
        columns.append(tuple(values.get(t, "") for t in axis))
    header = (time, *(channel_series.name for channel_series in series))
    return Cells(file, header, columns, [rows[t][1] for t in axis], notes, time=time.partition(" [")[0], start=start, layout=layout)


def text_of(value: object) -> str:
    """Return a number, stamp or text as the text of a cell; empty for None and NaN."""
    if value is None:
        return ""
    if isinstance(value, bool):
        return str(int(value))
    if isinstance(value, int | float):
        return "" if value != value else repr(value)
    stamp = getattr(value, "isoformat", None)
    return str(stamp()) if stamp is not None else str(value).strip()
