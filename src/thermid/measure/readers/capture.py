"""Captures of a serial monitor: a stamp and an arrow before each line, banners between, values in columns or as names with numbers."""

from __future__ import annotations

import re
from collections import Counter
from typing import Final

from thermid.errors import RecordError
from thermid.measure.readers.columns import spelt
from thermid.measure.readers.textfile import Cells, Layout, cells_of_text, is_number

_LINE: Final = re.compile(r"(?P<stamp>(?:\d{4}-\d\d-\d\d[ T])?\d{1,2}:[0-5]\d:[0-5]\d(?:[.,]\d+)?) -> ?(?P<text>.*)\Z")
_PAIR: Final = re.compile(
    r"(?P<name>[A-Za-z_][\w .#-]*?)\s*(?:\((?P<inner>[^()]*)\)\s*)?[:=]\s*(?P<value>[+-]?\d+(?:\.\d+)?)\s*"
    r"(?P<unit>(?:[°º˚]\s?|deg ?)?[CF](?![A-Za-z])|K(?![A-Za-z])|[mk]?W(?![A-Za-z])|m?[VA](?![A-Za-z])|%|ms\b|s\b)?"
)


def is_capture(head: str) -> bool:
    """Whether most lines of a text have a stamp and an arrow."""
    lines = [line for line in head.splitlines() if line.strip()][:50]
    return len(lines) > 1 and sum(bool(_LINE.match(line)) for line in lines[:-1]) > 0.5 * (len(lines) - 1)


def read(text: str, file: str) -> Cells:
    """Return the cells of a serial capture.

    Raises
    ------
    RecordError   When its lines hold neither columns nor names with values.
    """
    lines = [(number, match) for number, line in enumerate(text.split("\n"), 1) if (match := _LINE.match(line.rstrip()))]
    passed = sum(bool(line.strip()) for line in text.split("\n")) - len(lines)
    for mark in (",", ";", "\t"):
        kept = _columns(lines, mark)
        if kept is not None:
            body = "".join(f"{stamp}{mark}{rest}\n" for stamp, rest in kept[1])
            cells = cells_of_text(f"time{mark}{kept[0]}\n{body}", file, mark)
            left = len(lines) - len(kept[1]) - 1 + passed
            return _of(cells, [number for number, _ in kept[2]], left, file)
    return _pairs(lines, passed, file)


def _of(cells: Cells, numbers: list[int], left: int, file: str) -> Cells:
    notes = (f"{left} lines of the capture hold no samples and were passed over",) if left > 0 else ()
    layout = Layout("serial capture", "", cells.layout.separator)
    return Cells(file, cells.header, cells.columns, numbers[: len(cells.lines)], notes, time="time", layout=layout)


Kept = tuple[str, list[tuple[str, str]], list[tuple[int, str]]]


def _columns(lines: list[tuple[int, re.Match[str]]], mark: str) -> Kept | None:
    """Return the header and the lines of samples where most lines hold as many numbers divided by a mark."""
    split = [match["text"].split(mark) for _, match in lines]
    widths = Counter(len(row) for row in split if len(row) > 1 and sum(is_number(cell) for cell in row) >= 0.5 * len(row))
    if not widths:
        return None
    width, count = widths.most_common(1)[0]
    if count < max(2, 0.25 * len(lines)):
        return None
    first = next(k for k, row in enumerate(split) if len(row) == width and any(is_number(cell) for cell in row))
    above = [row for row in split[:first] if len(row) == width and not any(is_number(cell) for cell in row)]
    names = above[-1] if above else [f"value {k}" for k in range(1, width + 1)]
    rows = [k for k in range(first, len(split)) if len(split[k]) == width and any(is_number(c) for c in split[k])]
    return mark.join(names), [(lines[k][1]["stamp"], lines[k][1]["text"]) for k in rows], [(lines[k][0], "") for k in rows]


def _pairs(lines: list[tuple[int, re.Match[str]]], passed: int, file: str) -> Cells:
    """Return the cells of lines such as ``T1: 23.50 C  T2: 24.06 C``; lines of one cycle that name other channels are one row."""
    rows: list[tuple[int, str, dict[str, str]]] = []
    units: dict[str, str] = {}
    left = passed
    for number, match in lines:
        pairs = list(_PAIR.finditer(match["text"]))
        if not pairs:
            left += 1
            continue
        values = {pair["name"].strip(): pair["value"] for pair in pairs}
        for pair in pairs:
            unit = spelt(pair["inner"] or pair["unit"] or "")
            if units.setdefault(pair["name"].strip(), unit) != unit:
                raise RecordError(f"'{pair['name']}' changes its unit here.", f"{file}:{number}")
        rows.append((number, match["stamp"], values))
    counts = Counter(name for _, _, values in rows for name in values)
    usual = [name for name, count in counts.items() if count > 0.2 * max(counts.values())]
    rows = [(number, stamp, values) for number, stamp, values in rows if any(name in values for name in usual)]
    if len(rows) < 2 or len(rows) < 0.3 * len(lines):
        raise RecordError(
            "its lines hold neither columns of numbers nor names with values such as 'T1: 23.5'. Take the stamps and banners out.", file
        )
    columns = [tuple(stamp for _, stamp, _ in rows), *(tuple(values.get(name, "") for _, _, values in rows) for name in usual)]
    header = ("time", *(f"{name} [{units[name]}]" if units[name] else name for name in usual))
    notes = (f"{left} lines of the capture hold no samples and were passed over",) if left > 0 else ()
    return Cells(file, header, columns, [number for number, _, _ in rows], notes, time="time", layout=Layout("serial capture", ""))
