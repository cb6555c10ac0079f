"""Decks of ESATAN-TMS: nested models, locals and constants with expressions, nodes, conductors, arrays, courses of VARIABLES1.

Conventions of ESATAN-TMS's user manual: D is a diffusion node (without C an arithmetic one), B a boundary, X inactive; temperatures in
degC, all else in SI; GL is a conductance, GR an exchange area times emissivities; QI, QS, QE, QA and QR are powers into a node.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Final

import numpy as np

from thermid.base.errors import CodedText, DeckError, ThermidError, cap, code_of, raising
from thermid.base.units import ICE_POINT, STEFAN_BOLTZMANN, counted
from thermid.interop._decks.network_file import (
    DeckReading,
    FileConductor,
    FileCourse,
    FileLoad,
    FileNode,
    Line,
    NetworkFile,
    TextSpan,
    acts,
    fields,
    identifier,
    nesting,
    numbered,
    stream,
    with_defined_ends,
    with_unit,
)

STEFAN: Final = 5.6686e-8
"""Stefan-Boltzmann constant that ESATAN takes where a deck sets no STEFAN. [W/(m^2 K^4)]"""
POWERS: Final = ("QI", "QS", "QE", "QA", "QR")
SURFACES: Final = ("A", "ALP", "EPS", "FX", "FY", "FZ")
"""Values of nodes that ESATAN hands to the deck's own logic, and computes nothing with."""
_STEADY: Final = re.compile(r"SOLVIT|SOLVFM|SOLVCG")
_TRANSIENT: Final = re.compile(r"SLFRWD|SLFWBK|SLCRNC|SLGEAR|SLGRDJ")
"""Solution routines of ESATAN-TMS's user manual."""
_PRINTS: Final = re.compile(r"PR\w+|DMP\w+|SETND[RI]|STORMM|GENMOR")
"""Routines that print, keep or prepare; what they do is no part of the network."""
_ACTS: Final = re.compile(
    r"(?<![\w.:])(?:T|C|Q[ISEAR]|G[LRFV]|ALP|EPS|A)\s*:?(?:\w+:)*\s*(?:\d+|\([^()=]*\))\s*=(?!=)|^\s*\$?INCLUDE\b", re.IGNORECASE
)
"""An assignment to a node or a conductor; or more of the deck."""
_LOOP: Final = re.compile(r"FOR (\w+) ?= ?(.+?) TO (.+?)(?: STEP (.+?))? DO", re.IGNORECASE)
_FRAME: Final = re.compile(r"\s*(?:\$.*|(?:FOR|WHILE)\b.*\bDO|END ?DO)\s*", re.IGNORECASE)
"""Lines that end without a semicolon: sub-headings, and the first and last line of a loop."""
_RUN: Final = ("STEFAN", "TABS", "TIMEO", "TIMEND")
"""Control constants that decide numbers; others say how ESATAN solves and prints."""


@dataclass
class _Scope:
    """A model of the deck: its name, its blocks, the models inside it."""

    name: str
    where: TextSpan
    blocks: list[tuple[str, list[Line]]] = field(default_factory=list)
    inner: list[_Scope] = field(default_factory=list)


@dataclass
class EsatanDeck:
    """What has been read so far."""

    reading: DeckReading = field(default_factory=DeckReading)
    nodes: list[FileNode] = field(default_factory=list)
    conductors: list[FileConductor] = field(default_factory=list)
    loads: list[FileLoad] = field(default_factory=list)
    boundaries: dict[str, FileCourse] = field(default_factory=dict)
    inactive: set[tuple[str, str]] = field(default_factory=set)
    arrays: dict[tuple[str, str], np.ndarray] = field(default_factory=dict)
    again: dict[str, int] = field(default_factory=dict)
    paths: dict[str, tuple[str, ...]] = field(default_factory=dict)
    subroutines: set[str] = field(default_factory=set)
    start: str = ""
    repeats: int = 0


def read_esatan(path: str | Path) -> NetworkFile:
    """Return the network of an ESATAN deck (.d) with what it includes.

    Raises
    ------
    DeckError   With file and line: a file is missing, includes itself, is binary or too large; a statement is no node, conductor or number.
    """
    return _network(Path(path))


def _network(path: Path, instead: Mapping[str, str] = MappingProxyType({})) -> NetworkFile:
    """Return the network of a deck, read with texts instead of some of its files."""
    deck = EsatanDeck(DeckReading(instead))
    lines = list(_lines(deck, path, deck.reading.open(path), ()))
    begins = (re.match(r"\s*(?:\w+\s+)?SUBROUTINE\s+(\w+)", line.text, re.IGNORECASE) for line in lines)
    deck.subroutines = {match[1].upper() for match in begins if match}
    top = _models(deck, lines, path)
    _read(deck, top, "")
    control = deck.reading.control
    deck.conductors = [c for c in deck.conductors if not deck.inactive.intersection(c.ends)]
    deck.loads = [load for load in deck.loads if load.into not in deck.inactive]
    if any(c.table["kind"] == "radiation" for c in deck.conductors) and "STEFAN" not in control:
        first = next(c for c in deck.conductors if c.table["kind"] == "radiation")
        deck.reading.remark(first.where, f"STEFAN is not set; ESATAN's {STEFAN:g} W/(m^2 K^4) is assumed", dropped=False)
    offset, ratio = control.get("TABS", ICE_POINT) - ICE_POINT, control.get("STEFAN", STEFAN) / STEFAN_BOLTZMANN
    unread = any(code_of(remark.what) == "import.not-understood" for remark in deck.reading.remarks)
    begin = control.get("TIMEO", 0.0)
    return NetworkFile(
        identifier(top.name or path.stem), "ESATAN", tuple(replace(node, celsius=node.celsius + offset) for node in deck.nodes),
        tuple(_radiating(c, ratio) for c in with_defined_ends(deck.reading, deck.nodes, deck.conductors, unread)),
        tuple(with_defined_ends(deck.reading, deck.nodes, deck.loads, unread)), deck.reading.parameters,
        max(control.get("TIMEND", 0.0) - begin, 0.0), tuple(deck.reading.remarks), deck.reading.texts, partial(_network, path),
        {name: replace(course, numbers=course.numbers + offset) for name, course in deck.boundaries.items()},
        zero_and_degree=(-ICE_POINT - offset, 1.0),
        start=deck.start,
        begin=begin,
    )  # fmt: skip


def _radiating(conductor: FileConductor, ratio: float) -> FileConductor:
    """Return a conductor, its exchange area by ESATAN's constant of radiation as one by the constant here."""
    if conductor.table["kind"] != "radiation":
        return conductor
    return replace(conductor, table={**conductor.table, "area": with_unit(conductor.table["area"], "m^2", ratio)})


def _lines(deck: EsatanDeck, path: Path, text: str, inside: tuple[Path, ...]) -> Iterator[Line]:
    """Yield the lines of a deck without comments, following $INCLUDE."""
    words: list[str] = []
    for line in numbered(text, str(path)):
        row = re.sub(r"#.*", "", line.text).rstrip()
        if not row.strip() or re.match(r"[Cc](?:\s+[^\s=]|$)", row):  # C = 5.0 may go on with a node
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
            scope = _Scope(word[2].upper(), line.where)
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
            deck.reading.name_logic([line])
        elif head and head not in ("REAL", "INTEGER", "CHARACTER", "CONTROL", "DOUBLE"):
            open_[-1].blocks.append((head, []))
            rest = line.text[word.end(1) :] if word else ""
            if rest.strip():
                open_[-1].blocks[-1][1].append(replace(line, text=" " * (word.end(1) if word else 0) + rest))
        elif open_[-1].blocks:
            open_[-1].blocks[-1][1].append(line if not head else replace(line, text=f"${head}"))
        elif head:
            open_[-1].blocks.append(("LOCALS", [replace(line, text=f"${head}")]))
        else:
            deck.reading.name_logic([line])
    if top is None:
        raise DeckError("no $MODEL found: this is not an ESATAN deck.", str(path), code="file.another-kind")
    if open_:
        raise DeckError(f"$MODEL {open_[-1].name} has no $ENDMODEL, so the file is incomplete.", str(path), code="import.not-understood")
    return top


def _statements(lines: list[Line]) -> Iterator[Line]:
    """Yield statements that end with a semicolon, each as one line, in which every character keeps its distance from the first.

    Sub-headings and the frames of loops stand as they are.
    """
    pending: Line | None = None
    for line in lines:
        if _FRAME.fullmatch(line.text):
            yield line
            continue
        for match in re.finditer(r"[^;]+|;", line.text):
            if match[0] == ";":
                if pending is not None:
                    yield replace(pending, text=pending.text.rstrip())
                pending = None
            elif pending is not None:
                pending = pending.joined(line.cut(*match.span()))
            elif match[0].strip():
                pending = line.cut(match.end() - len(match[0].lstrip()), match.end())
    if pending is not None:
        raise DeckError(f"'{pending.words[:60]}' has no end. Add the missing semicolon.", str(pending.where), code="import.not-understood")


def _looped(deck: EsatanDeck, statements: Iterable[Line]) -> Iterator[Line]:
    """Yield statements, those of a loop once for each value of its variable, which is a name meanwhile; other loops are named whole."""
    loop, depth = list[Line](), 0.0
    for statement in statements:
        depth = max(depth + (nesting(statement.text) if _FRAME.fullmatch(statement.text) else 0.0), 0.0)
        if depth or loop:
            loop.append(statement)
        else:
            yield statement
        if loop and not depth:
            yield from _unrolled(deck, loop)
            loop = []
    if loop:
        _not_elements(deck, loop)


def _unrolled(deck: EsatanDeck, loop: list[Line]) -> Iterator[Line]:
    """Yield the statements of a loop once for each value of its variable.

    Raises
    ------
    DeckError   When all loops of the deck together have more turns than the cap `repeats`.
    """
    match = _LOOP.fullmatch(loop[0].words)
    try:
        first, last, step = (_integer(deck, match[k] or "1", loop[0].where) for k in (2, 3, 4)) if match else (0, 0, 0)
        values = range(first, last + (1 if step > 0 else -1), step)
    except (ThermidError, ValueError):
        values = range(0)
    if match is None or not values:
        _not_elements(deck, loop)
        return
    name, outer = match[1].upper(), dict(deck.reading.names)
    for value in values:
        deck.repeats += 1
        if deck.repeats > cap("repeats"):
            raise DeckError(f"the loops of the deck are too long.{raising('repeats')}", str(loop[0].where), code="cap.exceeded")
        deck.reading.names[name] = f"({value})"
        yield from _looped(deck, loop[1:-1])
    deck.reading.names = outer


def _not_elements(deck: EsatanDeck, loop: list[Line]) -> None:
    """Name a loop that is over no numbers."""
    rows = "; ".join(line.words for line in loop)
    deck.reading.remark(
        loop[0].where,
        CodedText(f"'{rows}' is not a node nor a conductor, because the loop is not over whole numbers", "import.not-understood"),
    )


def _integer(deck: EsatanDeck, word: str, where: TextSpan) -> int:
    """Return a whole number: digits, or arithmetic of names."""
    number = deck.reading.number(deck.reading.value(word, where))
    if not number.is_integer():
        raise ValueError
    return int(number)


def _read(deck: EsatanDeck, scope: _Scope, prefix: str) -> None:
    """Add a model to `deck`: its names and elements, then the models inside it, then its logic; its names count inside it alone."""
    outer = dict(deck.reading.names)
    owner = _owner(deck, prefix, scope.name)
    for wanted in ("LOCALS", "CONSTANTS", "ARRAYS", "NODES", "CONDUCTORS"):
        for head, lines in scope.blocks:
            if head == wanted:
                _READERS[wanted](deck, owner, lines)
    for inner in scope.inner:
        if deck.reading.is_first(f"$MODEL {owner}.{inner.name}", inner.where):
            _read(deck, inner, owner)
    for head, rows in scope.blocks:
        lines = [replace(line, text=line.text.rstrip("; ")) for line in rows]
        if head == "EXECUTION":
            _execution(deck, lines)
        elif head in ("INITIAL", "VARIABLES1"):
            _variables(deck, owner, lines, head == "VARIABLES1")
        elif head in ("VARIABLES2", "OUTPUTS", "SUBROUTINES"):
            deck.reading.name_logic(line for line in lines if _acts(deck, line))
        elif head not in _READERS and lines:
            deck.reading.remark(lines[0].where, f"${head}: {counted(len(lines), 'line')}")
    deck.reading.names = outer


def _acts(deck: EsatanDeck, line: Line) -> bool:
    """Return whether a statement can change the network or its run."""
    called = [name for name in _called(line) if name not in deck.subroutines]
    return acts(line, called, _PRINTS, _ACTS, (*deck.reading.names, *_RUN))


def _called(line: Line) -> list[str]:
    """Return the routines that a statement calls."""
    return [name.upper() for name in re.findall(r"\bCALL\s+(\w+)", line.text, re.IGNORECASE)]


def _owner(deck: EsatanDeck, outer: str, *inner: str) -> str:
    """Return the name of a submodel for models inside each other: A_B_C for A.B.C, and another one for A.B_C after it."""
    path = (*deck.paths.get(outer, ()), *inner)
    name = "_".join(path)
    while deck.paths.setdefault(name, path) != path:
        name += "_2"
    return name


def _names(deck: EsatanDeck, owner: str, lines: list[Line]) -> None:
    """Read $LOCALS and $CONSTANTS: name = number or arithmetic of earlier names; of control constants those that decide numbers."""
    kind = "REAL"
    for statement in _statements(lines):
        if statement.text.strip().startswith("$"):
            kind = statement.text.strip()[1:].upper()
            continue
        match = re.match(r"(\w+)\s*=\s*(.+)", statement.text, re.DOTALL)
        if match is None:
            deck.reading.name_logic([statement])
        elif match[1].upper() in _RUN:
            deck.reading.take_control(match[1], match[2], statement)
        elif kind not in ("CHARACTER", "CONTROL") and "'" not in match[2]:
            deck.reading.define(match[1], match[2], statement.part(match.start(2), match.end(2)), owner)


def _arrays(deck: EsatanDeck, owner: str, lines: list[Line]) -> None:
    """Read $ARRAYS: name(size, ...) = numbers."""
    for statement in _statements(lines):
        match = re.match(r"(\w+)\s*\(([^)]*)\)\s*=\s*(.+)", statement.text, re.DOTALL)
        if not match:
            if not statement.text.strip().startswith("$"):
                deck.reading.name_logic([statement])
            continue
        if not deck.reading.is_first(f"array {owner}.{match[1]}", statement.where):
            continue
        words = [word for word in re.split(r"[\s,]+", match[3].strip()) if word]
        try:
            values = np.array([deck.reading.number(deck.reading.value(word, statement.where)) for word in words])
        except ThermidError:
            deck.reading.remark(statement.where, f"array {match[1]} is not of numbers")
            continue
        sizes = [int(size) for size in match[2].split(",") if size.strip().isdigit()]
        if sizes and int(np.prod(sizes)) != values.size:
            raise DeckError(
                f"array {match[1]}({match[2]}) has {counted(values.size, 'number')}.", str(statement.where), code="import.not-understood"
            )
        deck.arrays[owner, match[1].upper()] = values.reshape(sizes[::-1]) if len(sizes) > 1 else values


_NODE: Final = re.compile(r"([DBX])\s*(\d+|\((?:[^()]|\([^()]*\))*\))\s*=\s*('(?:[^']*)')?\s*,?\s*(.*)", re.DOTALL | re.IGNORECASE)


def _nodes(deck: EsatanDeck, owner: str, lines: list[Line]) -> None:
    """Read $NODES: D, B or X with number, label and values: T [degC], C [J/K], powers [W]; values of surfaces are passed over."""
    for statement in _looped(deck, _statements(lines)):
        match = _NODE.match(statement.text)
        if not match:
            deck.reading.remark(statement.where, CodedText(f"'{statement.words[:60]}' is not a node", "import.not-understood"))
            continue
        kind, title = match[1].upper(), (match[3] or "").strip("' ")
        _, name = _node_of(deck, owner, match[2], statement)
        body = statement.cut(match.start(4), len(statement.text))
        values: dict[str, tuple[float | str, TextSpan]] = {}
        for cell, where in fields(body):
            key, mark, word = cell.partition("=")
            if key.strip().upper() not in ("T", "C", *POWERS, *SURFACES):
                deck.reading.remark(where, f"value of a node: '{cell}'")
            elif mark:
                values[key.strip().upper()] = (
                    deck.reading.value(word, where),
                    TextSpan(where.file, where.line, where.end - len(word.lstrip()), where.end),
                )
        if not deck.reading.is_first(f"node {owner}.{name}", statement.where):
            continue
        if kind == "X":
            deck.inactive.add((owner, name))
            continue
        celsius = deck.reading.number(values["T"][0]) if "T" in values else 0.0
        mass = values.get("C", (0.0, statement.where))
        capacitance = None if kind == "B" or mass[0] == 0.0 else with_unit(mass[0], "J/K")
        deck.nodes.append(FileNode(owner, name, capacitance, celsius, kind == "B", mass[1], title))
        for key in POWERS:
            if key in values:
                deck.loads.append(FileLoad(f"{owner}_{key}_{name}", (owner, name), with_unit(values[key][0], "W"), values[key][1]))


def _node_of(deck: EsatanDeck, owner: str, word: str, line: Line) -> tuple[str, str]:
    """Return the node that a reference names: 10, or SUB:10, or SUB:SUB:10, or with arithmetic of names, SUB:K + 10.

    Raises
    ------
    DeckError   When it names none.
    """
    *path, number = [part.strip() for part in word.split(":")]
    plain = re.fullmatch(r"[DBX]?(\d+)", number, re.IGNORECASE)
    try:
        return _owner(deck, owner, *(part.upper() for part in path)), f"T{int(plain[1]) if plain else _integer(deck, number, line.where)}"
    except ValueError:
        raise DeckError(
            f"'{number}' of '{line.words[:60]}' is no number of a node.", str(line.where), code="import.not-understood"
        ) from None


def _conductors(deck: EsatanDeck, owner: str, lines: list[Line]) -> None:
    """Read $CONDUCTORS: GL, GR and streams (GF); others are named. A comment before rows makes a group of them."""
    views: list[Line] = []
    for statement in _looped(deck, _statements(lines)):
        match = re.match(r"(G[LRFV])\s*\(([^,()]+),([^,()]+)\)\s*=\s*(.+)", statement.text, re.DOTALL | re.IGNORECASE)
        if match and match[1].upper() == "GV":
            views.append(statement)
            continue
        if not match:
            deck.reading.remark(statement.where, f"'{statement.words[:60]}' is not a GL, GR or GF")
            continue
        a, b = (_node_of(deck, owner, match[k], statement) for k in (2, 3))
        where = statement.part(match.start(4), match.end(4))
        value = deck.reading.value(match[4], where)
        ends = "_".join(n if model == owner else f"{model.removeprefix(f'{owner}_')}_{n}" for model, n in (a, b))
        name = f"{owner}_{match[1].upper()}_{ends}"
        if match[1].upper() == "GL":
            table: dict[str, object] = {"kind": "conduction", "conductance": with_unit(value, "W/K")}
        elif match[1].upper() == "GF":
            table = stream(value)
        else:
            table = {"kind": "radiation", "exchange_factor": 1.0, "area": value}  # STEFAN may still come
        n = deck.again[name] = deck.again.get(name, 0) + 1
        deck.conductors.append(FileConductor(f"{name}_{n}" if n > 1 else name, (a, b), table, where))
    if views:
        deck.reading.remark(
            views[0].where, f"{counted(len(views), 'view factor')} (GV) have no conductance and were left out", dropped=False
        )


_CONSTANT: Final = re.compile(r"\s*(QI|QS|QE|QA|QR|T)\s*:?((?:\w+:)*\d+)\s*=\s*([^=]+?)\s*$", re.IGNORECASE)
_COURSE: Final = re.compile(
    r"\s*(QI|QS|QE|QA|QR|T)\s*:?((?:\w+:)*\d+)\s*=\s*(?:([^=]+?)\s*\*\s*)?(INTCYC|INTRP1)\s*\(([^()]*)\)\s*(?:\*\s*(.+?))?\s*$",
    re.IGNORECASE,
)


def _variables(deck: EsatanDeck, owner: str, lines: list[Line], repeats: bool) -> None:
    """Read $INITIAL and $VARIABLES1, which repeats at each time: powers and temperatures, also by arrays of time; the rest is named."""
    depth, unknown = 0.0, list[Line]()
    for line in lines:
        deeper = nesting(line.text)
        if depth or deeper > 0.0:
            depth = max(depth + deeper, 0.0)
        elif _set(deck, owner, line, repeats):
            continue
        if _acts(deck, line) or "=" in line.text:
            unknown.append(line)
    deck.reading.name_logic(unknown)


def _set(deck: EsatanDeck, owner: str, line: Line, repeats: bool) -> bool:
    """Take a statement that sets a power or a temperature to arithmetic of names or, where it repeats, to a course times factors.

    A temperature is a boundary's or, of a statement that acts once, a start. Returns whether it was one.
    """
    followed = _COURSE.match(line.text) if repeats else None
    match = followed or _CONSTANT.match(line.text)
    into = _node_of(deck, owner, match[2], line) if match else ("", "")
    if match is None or f"node {'.'.join(into)}".upper() not in deck.reading.defined:
        return False
    where = line.where if followed else line.part(match.start(3), match.end(3))
    text = "*".join(f"({word})" for word in (match[3], match[6]) if word) or "1.0" if followed else match[3]
    try:
        course = _course(deck, owner, followed, line) if followed else None
        value = deck.reading.value(text, where)
    except ThermidError:
        return False
    if followed and course is None:
        return False
    if match[1].upper() == "T":
        k = next((k for k, node in enumerate(deck.nodes) if (node.submodel, node.name) == into), None)
        if k is None or (repeats and not deck.nodes[k].held):
            return False
        number = deck.reading.number(value)
        if course is None:
            deck.nodes[k] = replace(deck.nodes[k], celsius=number)
        else:
            deck.boundaries["_".join(into)] = replace(course, numbers=course.numbers * number)
        return True
    name = f"{into[0]}_{match[1].upper()}_{into[1]}"
    deck.loads = [load for load in deck.loads if load.name != name]
    deck.loads.append(FileLoad(name, into, with_unit(value, "W"), where, "", course, scales=course is not None))
    return True


def _course(deck: EsatanDeck, owner: str, match: re.Match[str], line: Line) -> FileCourse | None:
    """Return the course of INTCYC(time, times, values, order, period, shift) or INTRP1(time, pairs, order); INTCYC takes pairs too.

    Raises
    ------
    ThermidError    When a period or a shift is no number.
    """
    words = [word.strip().upper() for word in match[5].split(",")]
    arrays = [deck.arrays[owner, word] for word in words[1:3] if (owner, word) in deck.arrays]
    if len(arrays) == 1 and arrays[0].ndim == 2 and arrays[0].shape[1] == 2:
        arrays = [arrays[0][:, 0], arrays[0][:, 1]]
        words.insert(2, "")
    if words[0] not in ("TIMEM", "TIMEN", "TIME") or len(arrays) != 2 or words[3:4] != ["1"]:
        return None  # another order is no straight line
    if match[4].upper() == "INTRP1":
        return FileCourse(arrays[0], arrays[1], 0.0, str(line.where)) if len(words) == 4 else None
    period, shift = ([deck.reading.number(deck.reading.value(word, line.where)) for word in words[4:]] + [0.0])[:2]
    return FileCourse(arrays[0] + shift, arrays[1], period, str(line.where))


def _execution(deck: EsatanDeck, lines: list[Line]) -> None:
    """Read $EXECUTION: control constants, and whether a steady state comes before the transient, which begins with its temperatures."""
    rest, depth, solved = list[Line](), 0.0, list[str]()
    for line in lines:
        deeper = nesting(line.text)
        called = _called(line)
        if depth or deeper > 0.0:
            depth = max(depth + deeper, 0.0)
            rest.append(line)
        elif (match := re.match(r"\s*(\w+)\s*=\s*(.+?)\s*$", line.text)) and match[1].upper() in _RUN:
            deck.reading.take_control(match[1], match[2], line)
        elif called[:1] == ["SOLCYC"]:
            deck.reading.remark(line.where, "the cyclic solution of SOLCYC is no start here; --start periodic is", dropped=False)
        elif called and (_STEADY.fullmatch(called[0]) or _TRANSIENT.fullmatch(called[0])):
            solved.append("steady" if _STEADY.fullmatch(called[0]) else "transient")
        else:
            rest.append(line)
    if solved[:1] == ["steady"] and "transient" in solved:
        deck.start = "steady"
    deck.reading.name_logic(line for line in rest if _acts(deck, line))


_READERS = {"LOCALS": _names, "CONSTANTS": _names, "ARRAYS": _arrays, "NODES": _nodes, "CONDUCTORS": _conductors}
