"""Tables of elements: a CSV file or a list of rows, each of which is one element of a deck, written out before the grammar is checked."""

from __future__ import annotations

import csv
import re
from collections.abc import Callable, Iterator, Mapping
from typing import Any

from thermid.base.errors import DeckError, refuse_unknown
from thermid.base.files import Places

NAME = "name"
ONCE = ("values", "bind")
"""Groups whose keys are paths themselves: `values.heater.power` is the value `heater.power`."""
BAR = "|"
"""What parts the entries of a list in one cell: `hot | cold`."""
_HEADER = re.compile(r"^(?P<key>[^\[\]]+?)\s*(?:\[(?P<unit>[^\[\]]*)\])?$")
_NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?\Z")
_WORDS = {"true": True, "false": False}


Rows = list[tuple[dict[str, Any], str]]
"""Rows as dictionaries, each with its place."""
Reader = Callable[[str, str], str]
"""File name and place in the deck -> text of the file."""


def written_out(
    data: Mapping[str, Any], tables: Mapping[str, Any], where: Places, read: Reader | None, grammar: Mapping[str, Any]
) -> tuple[dict[str, Any], dict[str, int | str]]:
    """Return a deck in which every row of its `tables` stands among its elements, and the place of every key.

    Parameters
    ----------
    data, tables : dict     The deck, and its tables by name as `schema.RowsTable`.
    where : Places          Key path -> place.
    read : callable         Gives the text of a file; None where a deck has no folder.
    grammar : dict          Group of a deck -> the fields of its elements.

    Raises
    ------
    DeckError   When a table makes nothing that a deck has, a column is no field, or a name occurs twice.
    """
    out, places = {key: value for key, value in data.items() if key != "tables"}, dict(where.lines)
    for title, table in tables.items():
        key = f"tables.{title}"
        refuse_unknown([table.makes], grammar, where(f"{key}.makes"), "a table makes {known}; not '{}'.", DeckError)
        if bool(table.file) == bool(table.rows):
            raise DeckError("give either file or rows for a table.", where(key), code="value.incomplete")
        rows_with_places = (
            rows_of_file(table.file, where(f"{key}.file"), read, (NAME,))
            if table.file
            else [(dict(row), f"{where(key)}, row {n}") for n, row in enumerate(table.rows, start=1)]
        )
        group = dict(out.get(table.makes, {}))
        for row, place in rows_with_places:
            name = str(row.pop(NAME, ""))
            if not name:
                raise DeckError(f"a row needs a {NAME}.", place, code="value.incomplete")
            if name in group:
                before = places.get(f"{table.makes}.{name}")
                also = f" It is defined at {before} too." if isinstance(before, str) else " The deck defines it too."
                raise DeckError(f"'{name}' is the name of another of the {table.makes}.{also}", place, code="name.taken")
            group[name] = _nested(table.each, row, grammar[table.makes], place)
            places[f"{table.makes}.{name}"] = place
        out[table.makes] = group
    return out, places


def rows_of_file(name: str, where: str, read: Reader | None, wanted: tuple[str, ...]) -> Rows:
    """Return the rows of a CSV file, its columns by name; lines that begin with # and empty ones are left out, and so are empty cells.

    Parameters
    ----------
    name, where : str   The file, and its place in the deck.
    read : callable     Gives the text of a file; None where a deck has no folder.
    wanted : tuple      Columns that it must have.

    Raises
    ------
    DeckError   With file and line.
    """
    if read is None:
        raise DeckError("a table file works in a deck file only. Here give rows.", where, code="value.wrong-kind")
    lines = [(n, line) for n, line in enumerate(read(name, where).splitlines(), start=1) if line.strip() and not line.startswith("#")]
    if len(lines) < 2:
        raise DeckError(
            f"'{name}' has no rows. Write the names of the columns in the first line, and one element in each further line.",
            where,
            code="value.incomplete",
        )
    sign = ";" if ";" in lines[0][1] and "," not in lines[0][1] else ","
    cells = list(csv.reader((line for _, line in lines), delimiter=sign, skipinitialspace=True))
    heads = [_HEADER.match(cell.strip()) for cell in cells[0]]
    for cell, head in zip(cells[0], heads, strict=True):
        if head is None:
            raise DeckError(
                f"'{cell}' is not a valid column heading. Write a field and its unit in brackets: theta_JC [K/W].",
                f"{name}:{lines[0][0]}",
                code="value.wrong-kind",
            )
    keys = [head["key"] for head in heads if head]
    twice = next((k for k in keys if keys.count(k) > 1), None)
    missing = next((k for k in wanted if k not in keys), None)
    if twice or missing:
        what = f"the column '{twice}' twice" if twice else f"no column '{missing}'"
        raise DeckError(f"it has {what}.", f"{name}:{lines[0][0]}", code="model.refused")
    out: Rows = []
    for (number, _), row in zip(lines[1:], cells[1:], strict=True):
        place = f"{name}:{number}"
        if len(row) != len(heads):
            raise DeckError(
                f"the line has {len(row)} cells for {len(heads)} columns. A text with '{sign}' in it must be in quotes.",
                place,
                code="value.wrong-kind",
            )
        head_cells = zip(heads, (cell.strip() for cell in row), strict=True)
        out.append(({head["key"]: _cell(cell, head["unit"]) for head, cell in head_cells if head and cell}, place))
    return out


def _cell(text: str, unit: str | None) -> Any:
    """Return the value of a cell: '<text> [<unit>]' with the unit of its column, a number, true or false, a list, or a text."""
    if BAR in text:
        return [part.strip() for part in text.split(BAR)]
    if unit is not None and "[" not in text:
        return f"{text} [{unit}]"
    if text.lower() in _WORDS:
        return _WORDS[text.lower()]
    return float(text) if _NUMBER.match(text) else text


def _nested(common: Mapping[str, Any], row: Mapping[str, Any], fields: Any, place: str) -> dict[str, Any]:
    """Return the table of one element: the fields common to all rows, replaced by those of this row; `top.area` is a nested key."""
    out: dict[str, Any] = _copied(common)
    for key, value in row.items():
        head = key.partition(".")[0]
        refuse_unknown([head], fields, place, "'{}' is not a field of the elements of this table.", DeckError)
        *groups, last = _steps(key)
        here = out
        for group in groups:
            here = here.setdefault(group, {})
            if not isinstance(here, dict):
                raise DeckError(f"'{key}': '{group}' is used as a value and as a group of values.", place, code="name.taken")
        here[last] = value
    return out


def _copied(entry: Any) -> Any:
    """Return a copy of nested tables; other values are not copied."""
    return {key: _copied(value) for key, value in entry.items()} if isinstance(entry, Mapping) else entry


def _steps(key: str) -> Iterator[str]:
    """Yield the nested keys of a column's name: `top.area` is top, area; `values.a.b` is values, a.b."""
    head, _, rest = key.partition(".")
    yield head
    if rest:
        yield from ([rest] if head in ONCE else rest.split("."))
