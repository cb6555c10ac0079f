"""Blocks of SINDA/G and of the older SINDAs, whose headers are cards: ``BCD 3NODE DATA`` to ``END``.

What they say is handed on as the rows of SINDA/FLUINT that say the same. A letter in the first column marks a comment (C) or a line of
Fortran (F, M). Constants with a number, ``5, 0.3``, are registers K5. Of a listing, which repeats the cards among what SINDA says about
them, only the cards are read.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from typing import Final

from thermid.interop._decks.network_file import Line

SUBMODEL: Final = "MAIN"
"""Name of the one submodel that such a deck has."""
_HEADER: Final = re.compile(r"\s*BCD\s+3\s*([A-Z]+(?:\s+(?:DATA|CALLS|\d))?)", re.IGNORECASE)
_HEADERS: Final = {"CONSTANTS DATA": "CONTROL DATA", "EXECUTION": "OPERATION DATA"}
_SIGN: Final = re.compile(r"\s*\(C\) COPYRIGHT\b.*SINDA", re.IGNORECASE)
_CONSTANT: Final = re.compile(r"^(\s*)\s(\d+)\s*[,=]")
_BEGIN: Final = re.compile(r"\s*(\d+)\s*(?:,|$)")


def card_blocks(lines: Iterator[Line]) -> Iterator[tuple[str, str, list[Line]]]:
    """Yield header, submodel and rows of each block.

    Numbered constants come first, as a block of registers. Comment lines go with the row below them. An ``END`` inside array data ends
    the array, not the block; in a listing the cards begin one column to the right, and the first three lines of a page are skipped.
    """
    header, rows, words = "", list[Line](), list[str]()
    shift, page, inside = 0, 0, False  # a listing has a blank before each card; its pages begin with three lines of their own
    for line in lines:
        if _SIGN.match(line.text):
            shift, page = 1, 3
        page -= page > 0
        mark = line.text[shift : shift + 1].upper()
        if page or mark in ("C", "*"):
            words.append(line.text[shift + 1 :].strip())
            continue
        row = line.text.split("$", 1)[0].rstrip()
        card, named = row.strip().upper(), _HEADER.match(row)
        if named:
            name = " ".join(named[1].upper().split())
            if name == "END":
                return
            header, rows, inside = _HEADERS.get(name, name), [], False
        elif mark in ("F", "M") and header.startswith(("OPERATION", "VARIABLES")):
            rows.append(replace(line, text=row[:shift] + " " + row[shift + 1 :]))
        elif card == "END" and inside:
            inside = False
        elif card == "END" and header:
            yield from _constants(header, rows)
            header, rows = "", []
        elif card and header and not card.startswith("BCD"):
            if header == "ARRAY DATA" and not inside and (begin := _BEGIN.match(row)):
                row, inside = f"{begin[1]} = {row[begin.end() :]}", True
            if header == "ARRAY DATA" and inside and re.search(r"[,\s]END$", row, re.IGNORECASE):
                row, inside = row[:-3].rstrip(" ,"), False
            rows.append(replace(line, text=row, before=tuple(words)))
        words = []
    yield from _constants(header, rows)


def _constants(header: str, rows: list[Line]) -> Iterator[tuple[str, str, list[Line]]]:
    """Yield a block; of constants those with a number apart, as registers K5."""
    numbered = [row for row in rows if header == "CONTROL DATA" and _CONSTANT.match(row.text)]
    if numbered:
        yield (
            "REGISTER DATA",
            "",
            [replace(row, text=_CONSTANT.sub(lambda m: f"{m[1]}K{m[2]}".ljust(len(m[0]) - 1) + "=", row.text)) for row in numbered],
        )
    if header == "CONTROL DATA":
        rows = [replace(row, text=re.sub(r"(?<![\w.])([A-Za-z]\w*\s*),", r"\1=", row.text)) for row in rows if row not in numbered]
    if header:
        yield header, SUBMODEL, rows
