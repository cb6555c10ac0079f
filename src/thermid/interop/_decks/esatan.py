"""Decks of ESATAN-TMS: nested models, locals and constants with expressions, nodes, conductors, arrays, courses of VARIABLES1.

Conventions of ESATAN-TMS's user manual: D is a diffusion node (without C an arithmetic one), B a boundary, X inactive; temperatures in
degC, all else in SI; GL is a conductance, GR an exchange area times emissivities; QI, QS, QE, QA and QR are powers into a node.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final

import numpy as np

from thermid.base.errors import DeckError, ThermidError
from thermid.base.expression import parse
from thermid.base.units import counted
from thermid.interop._decks.network_file import FileConductor, FileCourse, FileLoad, FileNode, NetworkFile, TextSpan, identifier
from thermid.interop._decks.statements import DeckReading, Line, fields, numbered, stream, with_unit
from thermid.physics.constants import STEFAN_BOLTZMANN

STEFAN: Final = 5.6686e-8
"""Stefan-Boltzmann constant that ESATAN takes where a deck sets no STEFAN. [W/(m^2 K^4)]"""
POWERS: Final = ("QI", "QS", "QE", "QA", "QR")
_IGNORED: Final = ("OUTPUTS", "SUBROUTINES", "VARIABLES2")
"""Blocks that say how ESATAN runs or prints, not what the network is; TIMEND and a cycle's period are read from EXECUTION."""


@dataclass
class _Scope:
    """A model of the deck: its name, its names, what it holds."""

    name: str
    names: dict[str, str] = field(default_factory=dict)
    arrays: dict[str, np.ndarray] = field(default_factory=dict)
    blocks: list[tuple[str, list[Line]]] = field(default_factory=list)
    inner: list[_Scope] = field(default_factory=list)


@dataclass
class EsatanDeck:
    """What has been read so far."""

    reading: DeckReading = field(default_factory=DeckReading)
    parameters: dict[str, tuple[float | str, TextSpan]] = field(default_factory=dict)
    nodes: list[FileNode] = field(default_factory=list)
    conductors: list[FileConductor] = field(default_factory=list)
    loads: list[FileLoad] = field(default_factory=list)
    boundaries: dict[str, FileCourse] = field(default_factory=dict)
    inactive: set[tuple[str, str]] = field(default_factory=set)
    duration: float = 0.0
    numbers: dict[str, float] = field(default_factory=dict)


def read_esatan(path: str | Path) -> NetworkFile:
    """Return the network of an ESATAN deck (.d) with what it includes.

    Raises
    ------
    DeckError   With file and line: a file is missing, includes itself, is binary or too large; a statement is no node, conductor or number.
    """
    path = Path(path)
    deck = EsatanDeck()
    top = _models(deck, list(_lines(deck, path, deck.reading.open(path), ())), path)
    _read(deck, top, "")
    radiating = [c for c in deck.conductors if c.table["kind"] == "radiation"]
    if radiating and "stefan" not in deck.parameters:
        deck.reading.remark(radiating[0].where, f"STEFAN is not set; ESATAN's {STEFAN:g} W/(m^2 K^4) is assumed", dropped=False)
    return NetworkFile(
        identifier(top.name or path.stem), "ESATAN", tuple(deck.nodes), tuple(deck.conductors), tuple(deck.loads), deck.parameters,
        deck.duration, tuple(deck.reading.remarks), deck.reading.texts, deck.boundaries,
    )  # fmt: skip


def _lines(deck: EsatanDeck, path: Path, text: str, inside: tuple[Path, ...]) -> Iterator[Line]:
    """Yield the lines of a deck without comments, following $INCLUDE."""
    words: list[str] = []
    for line in numbered(text, str(path)):
        row = re.sub(r"#.*", "", line.text).rstrip()
        if not row.strip() or (row[:1] in "Cc" and not row[1:2].strip()):
            comment = line.text.partition("#")[2].strip(" *")
            words = [comment] if comment else words
            continue
        include = re.match(r"\s*\$INCLUDE\s+[\"']?([^\"';]+)[\"']?", row, re.IGNORECASE)
        if include:
            target = path.parent / include[1].strip().replace("\\", "/")
            yield from _lines(deck, target, deck.reading.open(target, (*inside, path), str(line.where)), (*inside, path))
        else:
            yield replace(line, text=row, before=tuple(words))
        words = []


def _models(deck: EsatanDeck, lines: list[Line], path: Path) -> _Scope:
    """Return the tree of models with their blocks."""
    top: _Scope | None = None
    open_: list[_Scope] = []
    for line in lines:
        word = re.match(r"\s*\$(\w+)\s*([\w]*)", line.text)
        head = word[1].upper() if word else ""
        if word and head in ("MODEL", "VIRTUAL"):
            scope = _Scope(word[2].upper())
            if open_:
                open_[-1].inner.append(scope)
            elif top is None:
                top = scope
            open_.append(scope)
        elif head == "ENDMODEL" and open_:
            open_.pop()
        elif not open_:
            if head:
                raise DeckError(f"'{line.text.strip()}' is outside a $MODEL block.", str(line.where), code="import.not-understood")
        elif head and head not in ("REAL", "INTEGER", "CHARACTER", "CONTROL", "DOUBLE"):
            open_[-1].blocks.append((head, []))
            rest = line.text[word.end(1) :] if word else ""
            if rest.strip():
                open_[-1].blocks[-1][1].append(replace(line, text=" " * (word.end(1) if word else 0) + rest))
        elif open_[-1].blocks:
            open_[-1].blocks[-1][1].append(line if not head else replace(line, text=f"${head}"))
    if top is None:
        raise DeckError("no $MODEL found: this is not an ESATAN deck.", str(path), code="file.another-kind")
    if open_:
        raise DeckError(f"$MODEL {open_[-1].name} has no $ENDMODEL, so the file is incomplete.", str(path), code="import.not-understood")
    return top


def _statements(lines: list[Line]) -> Iterator[Line]:
    """Yield statements that end with a semicolon, as one line each; sub-headings as they are."""
    text, first, before = "", None, tuple[str, ...]()
    for line in lines:
        if line.text.strip().startswith("$"):
            yield line
            continue
        rest, at = line.text, 0
        while True:
            if first is None:
                lead = len(rest) - len(rest.lstrip())
                first, before = TextSpan(line.where.file, line.where.line, line.where.begin + at + lead, line.where.end), line.before
                rest, at = rest.lstrip(), at + lead
            head, mark, tail = rest.partition(";")
            text += head + (" " if not mark else "")
            if not mark:
                break
            if text.strip():
                yield Line(text.rstrip(), first, before)
            text, first, at, rest = "", None, at + len(head) + 1, tail
            if not rest.strip():
                break
        if not text.strip():
            text, first = "", None
    if text.strip() and first is not None:
        raise DeckError(f"'{text.strip()[:60]}' has no end. Add the missing semicolon.", str(first), code="import.not-understood")


def _read(deck: EsatanDeck, scope: _Scope, prefix: str) -> None:
    """Read a model, its names first, then the models inside it."""
    outer = dict(deck.reading.names)
    owner = f"{prefix}_{scope.name}" if prefix else scope.name
    for wanted in ("LOCALS", "CONSTANTS", "ARRAYS", "NODES", "CONDUCTORS"):
        for head, lines in scope.blocks:
            if head == wanted:
                _READERS[wanted](deck, scope, owner, lines)
    for inner in scope.inner:
        _read(deck, inner, owner)
    for head, lines in scope.blocks:
        if head == "EXECUTION":
            _execution(deck, lines)
        elif head in ("INITIAL", "VARIABLES1"):
            _variables(deck, scope, owner, lines)
        elif head not in _READERS and head not in _IGNORED and lines:
            deck.reading.remark(lines[0].where, f"${head}: {counted(len(lines), 'line')}")
    deck.reading.names = outer


def _names(deck: EsatanDeck, scope: _Scope, owner: str, lines: list[Line]) -> None:
    """Read $LOCALS and $CONSTANTS: name = number or arithmetic of earlier names; texts and control words are not values."""
    kind = "REAL"
    for statement in _statements(lines):
        if statement.text.strip().startswith("$"):
            kind = statement.text.strip()[1:].upper()
            continue
        match = re.match(r"(\w+)\s*=\s*(.+)", statement.text, re.DOTALL)
        if match is None or kind == "CHARACTER" or "'" in match[2] or (kind == "CONTROL" and match[1].upper() != "STEFAN"):
            continue
        where = statement.part(match.start(2), match.end(2))
        value = deck.reading.value(match[2], where)
        name = deck.reading.name(match[1])
        deck.parameters[name] = (value, where)
        deck.numbers[name] = _number(deck, value)


def _number(deck: EsatanDeck, value: float | str) -> float:
    """Return the number of a value, with the names as the deck has them."""
    return value if isinstance(value, float) else float(parse(value).evaluate(lambda name: deck.numbers[name]))


def _arrays(deck: EsatanDeck, scope: _Scope, owner: str, lines: list[Line]) -> None:
    """Read $ARRAYS: name(size, ...) = numbers."""
    for statement in _statements(lines):
        match = re.match(r"(\w+)\s*\(([^)]*)\)\s*=\s*(.+)", statement.text, re.DOTALL)
        if not match:
            continue
        words = [word for word in re.split(r"[\s,]+", match[3].strip()) if word]
        try:
            values = np.array([_number(deck, deck.reading.value(word, statement.where)) for word in words])
        except ThermidError:
            deck.reading.remark(statement.where, f"array {match[1]} is not of numbers")
            continue
        sizes = [int(size) for size in match[2].split(",") if size.strip().isdigit()]
        if sizes and int(np.prod(sizes)) != values.size:
            raise DeckError(
                f"array {match[1]}({match[2]}) has {counted(values.size, 'number')}.", str(statement.where), code="import.not-understood"
            )
        scope.arrays[match[1].upper()] = values.reshape(sizes[::-1]) if len(sizes) > 1 else values


def _nodes(deck: EsatanDeck, scope: _Scope, owner: str, lines: list[Line]) -> None:
    """Read $NODES: D, B or X with number, label and values."""
    for statement in _statements(lines):
        match = re.match(r"([DBX])(\d+)\s*=\s*('(?:[^']*)')?\s*,?\s*(.*)", statement.text, re.DOTALL | re.IGNORECASE)
        if not match:
            deck.reading.remark(statement.where, f"'{statement.text[:60]}' is not a node")
            continue
        kind, name, title = match[1].upper(), f"T{int(match[2])}", (match[3] or "").strip("' ")
        body = Line(statement.text[match.start(4) :], statement.part(match.start(4), len(statement.text)))
        values: dict[str, tuple[float | str, TextSpan]] = {}
        for cell, where in fields(body):
            key, mark, word = cell.partition("=")
            if mark and key.strip().upper() in ("T", "C", *POWERS):
                values[key.strip().upper()] = (
                    deck.reading.value(word, where),
                    TextSpan(where.file, where.line, where.end - len(word.lstrip()), where.end),
                )
        if kind == "X":
            deck.inactive.add((owner, name))
            continue
        celsius = _number(deck, values["T"][0]) if "T" in values else 0.0
        mass = values.get("C", (0.0, statement.where))
        capacitance = None if kind == "B" or mass[0] == 0.0 else with_unit(mass[0], "J/K")
        deck.nodes.append(FileNode(owner, name, capacitance, celsius, kind == "B", mass[1], title))
        for key in POWERS:
            if key in values:
                deck.loads.append(FileLoad(f"{owner}_{key}_{name}", (owner, name), with_unit(values[key][0], "W"), values[key][1]))


def _node_of(scope: _Scope, owner: str, word: str) -> tuple[str, str]:
    """Return the node that a reference names: 10, or SUB:10, or SUB:SUB:10."""
    *path, number = [part.strip() for part in word.split(":")]
    return ("_".join([owner, *(part.upper() for part in path)]) if path else owner, f"T{int(number.lstrip('DBXdbx'))}")


def _conductors(deck: EsatanDeck, scope: _Scope, owner: str, lines: list[Line]) -> None:
    """Read $CONDUCTORS: GL, GR and streams (GF); others are named. A comment before rows makes a group of them."""
    again: dict[str, int] = {}
    views: list[Line] = []
    for statement in _statements(lines):
        match = re.match(r"(G[LRFV])\s*\(([^,()]+),([^,()]+)\)\s*=\s*(.+)", statement.text, re.DOTALL | re.IGNORECASE)
        if match and match[1].upper() == "GV":
            views.append(statement)
            continue
        if not match:
            deck.reading.remark(statement.where, f"'{statement.text[:60]}' is not a GL, GR or GF")
            continue
        try:
            a, b = (_node_of(scope, owner, match[k]) for k in (2, 3))
        except ThermidError:
            raise
        except ValueError:
            raise DeckError(
                f"'{statement.text[:60]}' does not name two nodes.", str(statement.where), code="import.not-understood"
            ) from None
        if deck.inactive & {a, b}:
            continue
        where = statement.part(match.start(4), match.end(4))
        value = deck.reading.value(match[4], where)
        ends = "_".join(n if model == owner else f"{model.removeprefix(f'{owner}_')}_{n}" for model, n in (a, b))
        name = f"{owner}_{match[1].upper()}_{ends}"
        if match[1].upper() == "GL":
            table: dict[str, object] = {"kind": "conduction", "conductance": with_unit(value, "W/K")}
        elif match[1].upper() == "GF":
            table = stream(value)
        else:
            ratio = deck.numbers.get(deck.reading.names.get("STEFAN", ""), STEFAN) / STEFAN_BOLTZMANN
            table = {"kind": "radiation", "exchange_factor": 1.0, "area": with_unit(value, "m^2", ratio)}
        again[name] = again.get(name, 0) + 1
        deck.conductors.append(FileConductor(f"{name}_{again[name]}" if again[name] > 1 else name, (a, b), table, where))
    if views:
        deck.reading.remark(
            views[0].where, f"{counted(len(views), 'view factor')} (GV) have no conductance and were left out", dropped=False
        )


_SILENT: Final = re.compile(r"GENMOR|CALL SETND[RI]|CALL STORMM|CALL STATST")
"""Statements of $INITIAL and $VARIABLES1 that prepare printing."""
_CONSTANT: Final = re.compile(r"\s*(QI|QS|QE|QA|QR)\s*:?(\d+)\s*=\s*([^=]+?)\s*$", re.IGNORECASE)
_COURSE: Final = re.compile(r"\s*(QI|QS|QE|QA|QR|T)\s*:?(\d+)\s*=\s*(INTCYC|INTRP1)\s*\(([^()]*)\)\s*(?:\*\s*(.+?))?\s*$", re.IGNORECASE)


def _variables(deck: EsatanDeck, scope: _Scope, owner: str, lines: list[Line]) -> None:
    """Read $VARIABLES1: powers and temperatures that follow arrays of time; every other statement is named."""
    depth = 0
    for line in lines:
        word = line.text.strip().upper()
        depth += bool(re.match(r"IF\b.*\bTHEN$", word))
        if _SILENT.match(word):
            continue
        match = None if depth else _COURSE.match(line.text)
        course = _course(deck, scope, match, line) if match else None
        depth -= bool(re.match(r"END ?IF$", word))
        if course is None and not depth and word not in ("ENDIF", "END IF") and _constant(deck, owner, line):
            continue
        if match is None or course is None:
            deck.reading.remark(line.where, f"logic not taken over: '{line.text.strip()[:60]}'")
            continue
        into = (owner, f"T{int(match[2])}")
        factor = deck.reading.value(match[5], line.part(match.start(5), match.end(5))) if match[5] else 1.0
        if match[1].upper() == "T":
            deck.boundaries[f"{owner}_{into[1]}"] = replace(course, numbers=course.numbers * _number(deck, factor))
            continue
        name = f"{owner}_{match[1].upper()}_{into[1]}"
        deck.loads = [load for load in deck.loads if load.name != name]
        deck.loads.append(FileLoad(name, into, with_unit(factor, "W"), line.where, "", course, scales=True))


def _constant(deck: EsatanDeck, owner: str, line: Line) -> bool:
    """Take a power that VARIABLES1 sets to arithmetic of names; whether it did."""
    match = _CONSTANT.match(line.text)
    if match is None:
        return False
    where = line.part(match.start(3), match.end(3))
    try:
        power = deck.reading.value(match[3], where)
    except DeckError:
        return False
    name = f"{owner}_{match[1].upper()}_T{int(match[2])}"
    deck.loads = [load for load in deck.loads if load.name != name]
    deck.loads.append(FileLoad(name, (owner, f"T{int(match[2])}"), with_unit(power, "W"), where))
    return True


def _course(deck: EsatanDeck, scope: _Scope, match: re.Match[str], line: Line) -> FileCourse | None:
    """Return the course of INTCYC(time, times, values, order, period, shift) or INTRP1(time, array of pairs, order)."""
    words = [word.strip() for word in match[4].split(",")]
    if words[0].upper() not in ("TIMEM", "TIMEN", "TIME"):
        return None
    if match[3].upper() == "INTCYC":
        times, values = (scope.arrays.get(word.upper()) for word in words[1:3])
        if times is None or values is None or len(words) < 5 or words[3] != "1":
            return None
        shift = _number(deck, deck.reading.value(words[5], line.where)) if len(words) > 5 else 0.0
        period = _number(deck, deck.reading.value(words[4], line.where))
        return FileCourse(times + shift, values, period, str(line.where))
    pairs = scope.arrays.get(words[1].upper())
    if pairs is None or pairs.ndim != 2 or pairs.shape[1] != 2:
        return None
    return FileCourse(pairs[:, 0], pairs[:, 1], 0.0, str(line.where))


def _execution(deck: EsatanDeck, lines: list[Line]) -> None:
    """Take the end of the transient from $EXECUTION."""
    for line in lines:
        match = re.match(r"\s*TIMEND\s*=\s*(.+?)\s*$", line.text, re.IGNORECASE)
        if match:
            try:
                deck.duration = _number(deck, deck.reading.value(match[1], line.where))
            except ThermidError:
                deck.reading.remark(line.where, f"the end of the run, '{match[1]}', is not a number")


_READERS = {"LOCALS": _names, "CONSTANTS": _names, "ARRAYS": _arrays, "NODES": _nodes, "CONDUCTORS": _conductors}
