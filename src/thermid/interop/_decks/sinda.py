"""Decks of SINDA/G and SINDA/FLUINT, as Thermal Desktop writes them: nodes, conductors, sources, arrays, registers, heaters.

Conventions of SINDA/FLUINT's user manual: a boundary node has a negative number, a node without mass a negative capacitance; a radiation
conductor has a negative number, its heat is ``SIGMA G (T_a^4 - T_b^4)``; a minus before a node of a conductor makes it one-way.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Generator, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Final

import numpy as np

from thermid.base.errors import DeckError, ThermidError, cap, raising
from thermid.base.units import HOUR, ICE_POINT, STEFAN_BOLTZMANN, counted
from thermid.interop._constants import BTU, ENERGY, LENGTH, RANKINE, TIME, ZERO
from thermid.interop._decks.cards import card_blocks
from thermid.interop._decks.emissivities import PROPERTY, FileEmissivity, read_emissivities
from thermid.interop._decks.heat_rates import CALL, OWNER, SUFFIX, CommentedArrays, heat_rates
from thermid.interop._decks.network_file import (
    SCALED,
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
    fortran,
    identifier,
    nesting,
    numbered,
    stream,
    with_defined_ends,
    with_unit,
)
from thermid.interop._wired import distinct

INSULATION: Final = 20_000
"""By how much the number of an insulation's node exceeds that of the surface below, as Thermal Desktop numbers them."""
Cells = list[tuple[str, TextSpan]]
"""What stands between the commas of a row, each with its place."""
_REPEATS: Final = {"GEN": "CAL", "SIM": "SIV", "SPM": "SPV", "DIM": "DIV"}
"""Option that makes several elements: number, count, increment -> the option that each of them has."""
_WITHOUT_EFFECT: Final = ("OPTIONS", "SOLVER", "USER DATA", "DESIGN", "PROCEDURE", "RELIABILITY")
"""Blocks that act by calls and names alone: titles, settings of an optimizer, variables of logic; a call of them is named."""
_STEADY: Final = re.compile(r"STEADY|STDSTL|FASTIC|CINDS[SLBM]|SNDSNR|SNSOSS|SNHOSS")
_TRANSIENT: Final = re.compile(
    r"TRANSIENT|FWDBCK|FORWRD|ATSDUF|CN(?:FRWD|FRDL|FAST|FWBK|BACK|VARB|EXPN|DUFR|QUIK)|SN(?:FRWD|FRDL|FWBK|DUFR)"
)
"""Solution routines of SINDA/FLUINT, SINDA/G and the older SINDAs, as in their user's manuals."""
_PRINTS: Final = re.compile(r"\w*(?:PRINT|PRNT|PRT)|SAVE|RESAVE|CHGSAV|NODMAP|QMAP|HNQCAL|OUTLOG|COMMON|DPCS|LOAD\w+")
"""Routines that print, keep or prepare, and LOADQ, whose heat rates are read: what else they do is no part of the network."""
_ACTS: Final = re.compile(
    r"(?<![\w.])(?:\w+\.)?(?:XK|[TQCGAK])\s*(?:\d+|\((?:[^()=]|\([^()=]*\))*\))\s*=(?!=)|^\s*(?:INCLUDE|INSERT)\b", re.IGNORECASE
)
"""An assignment to a node, a conductor, an array or a constant; or more of the deck."""
_RUN: Final = ("ABSZRO", "TMPZRO", "SIGMA", "TIMEO", "TIMEND", "DTIMES")
"""Control constants that decide numbers; others say how SINDA solves and prints."""
_INTERPOLATIONS: Final = {
    "D1DEG1": "xPr", "D1D1DA": "xTYr", "D1D1WM": "xPzr", "D11MDA": "xTYzr",
    "D11CYL": "pxPr", "DA11CY": "pxTYr", "D11MCY": "pxPzr", "DA11MC": "pxTYzr",
}  # fmt: skip
"""Linear interpolations of SINDA's manuals: their arguments are a period (p), what they interpolate over (x), an array of pairs (P) or two
of abscissas and ordinates (T, Y), a factor (z) and where the result is put (r)."""


@dataclass
class Units:
    """Units of a file: what its numbers are in SI, and its absolute zero."""

    energy: float = 1.0
    time: float = 1.0
    degree: float = 1.0
    length: float = 1.0
    zero: float = 0.0
    lengths: set[float] = field(default_factory=set)
    sigma: float | None = None
    temperature_stated: bool = False
    power_stated: bool = False

    @property
    def power(self) -> float:
        """A unit of power. [W]"""
        return self.energy / self.time

    def celsius(self, number: float) -> float:
        """Return a temperature in degC."""
        return (number - self.zero) * self.degree - ICE_POINT

    def take(self, words: str) -> None:
        """Take units of energy, time, length and temperature from words such as `BTU s in F`; W is J and s.

        Raises
        ------
        DeckError   When a word is none of them, or when no temperature or no power is among them.
        """
        for word in re.findall(r"[^\s,]+", words.upper()):
            if word in ZERO:
                self.zero, self.degree, self.temperature_stated = ZERO[word], RANKINE if word in "FR" else 1.0, True
            elif word == "W" or word in ENERGY:
                self.energy, self.power_stated = ENERGY.get(word, 1.0), True
            elif word in TIME:
                self.time = TIME[word]
            elif word in LENGTH:
                self.length = LENGTH[word]
            else:
                names = ", ".join(("W", *ENERGY, *TIME, *LENGTH, *ZERO))
                raise DeckError(f"'{word}' is not a unit of a SINDA deck. There are {names}.", "units", code="value.wrong-kind")

    def exchange_area(self) -> float:
        """Return the area that a radiation conductor of 1 exchanges over. [m^2]"""
        if self.sigma is None:
            return self.length**2
        return self.sigma * self.power / self.degree**4 / STEFAN_BOLTZMANN


@dataclass
class SindaDeck:
    """What has been read so far."""

    reading: DeckReading = field(default_factory=DeckReading)
    units: Units = field(default_factory=Units)
    title: str = ""
    nodes: list[FileNode] = field(default_factory=list)
    conductors: list[FileConductor] = field(default_factory=list)
    loads: list[FileLoad] = field(default_factory=list)
    arrays: dict[tuple[str, str], list[float]] = field(default_factory=dict)
    words: dict[str, list[str]] = field(default_factory=dict)
    owners: dict[tuple[str, str], tuple[str, str]] = field(default_factory=dict)
    courses: dict[str, FileCourse] = field(default_factory=dict)
    emissivities: dict[str, tuple[float, int]] = field(default_factory=dict)
    listed: dict[TextSpan, tuple[str, float]] = field(default_factory=dict)
    steps: list[tuple[str, str, list[Line]]] = field(default_factory=list)
    subroutines: set[str] = field(default_factory=set)
    operations: list[Line] = field(default_factory=list)
    cards: bool = False
    settles: bool = False
    ends: bool = False
    averages: bool = False


def read_sinda(path: str | Path, units: str = "") -> NetworkFile:
    """Return the network of a SINDA deck: a case (.inp) with what it inserts, one of its files (.cc, .k), or cards (.sin).

    Parameters
    ----------
    path : path     The file.
    units : str     Units of energy, time, length and temperature of a deck that does not state them: ``"BTU h ft F"``, ``"W m C"``.

    Raises
    ------
    DeckError   With file and line: a file is missing, includes itself, is binary or too large; a row is no node, no conductor or no number;
                nothing states the unit of temperatures or of powers, or the deck contradicts the stated ones.
    """
    return _network(Path(path), units)


def _network(path: Path, units: str, instead: Mapping[str, str] = MappingProxyType({})) -> NetworkFile:
    """Return the network of a deck, read with texts instead of some of its files."""
    deck = SindaDeck(DeckReading(instead))
    text = deck.reading.open(path)
    deck.title = path.stem
    if units:
        deck.units.take(units)
    deck.cards = re.search(r"^\s*BCD\s+3NODE\b", text, re.MULTILINE | re.IGNORECASE) is not None
    if deck.cards:
        deck.units.sigma = 1.0
    deck.steps.extend(card_blocks(numbered(text, str(path))) if deck.cards else _blocks(deck, path, text, ()))
    if not any(header.startswith("NODE") for header, _, _ in deck.steps):
        raise DeckError("no HEADER NODE DATA found: this is not a SINDA deck.", str(path), code="file.another-kind")
    _read_units(deck, path, units)
    begins = (re.match(r"\s*F?\s*SUBROUTINE\s+(\w+)", line.text, re.IGNORECASE) for _, _, lines in deck.steps for line in lines)
    deck.subroutines = {match[1].upper() for match in begins if match}
    for wanted in _READERS:
        for header, submodel, lines in deck.steps:
            if header.startswith(wanted):
                _READERS[wanted](deck, submodel, lines if "ARRAY" in wanted else list(_joined(lines)))
    _name_what_is_left(deck)
    unread = any(remark.what.startswith("node") for remark in deck.reading.remarks if remark.dropped)
    deck.conductors = list(with_defined_ends(deck.reading, deck.nodes, deck.conductors, unread))
    deck.loads = list(with_defined_ends(deck.reading, deck.nodes, deck.loads, unread))
    if deck.units.sigma is None and any(c.table["kind"] == "radiation" for c in deck.conductors):
        first = next(c for c in deck.conductors if c.table["kind"] == "radiation")
        deck.reading.remark(
            first.where,
            f"SIGMA is defined in the case's .inp file, which was not read; {STEFAN_BOLTZMANN:.6g} W/(m^2 K^4) is assumed. Compare it "
            "with the file",
            dropped=False,
        )
    names = distinct((load.name for load in deck.loads), "_")  # a node may have several loads
    loads = tuple(replace(load, name=name) for load, name in zip(deck.loads, names, strict=True))
    begin, start = deck.reading.control.get("TIMEO", 0.0) * deck.units.time, _start(deck)
    return NetworkFile(
        identifier(deck.title), "SINDA", tuple(deck.nodes), tuple(deck.conductors), loads, deck.reading.parameters,
        deck.reading.control.get("TIMEND", 0.0) * deck.units.time - begin, tuple(deck.reading.remarks), deck.reading.texts,
        partial(_network, path, units),
        zero_and_degree=(deck.units.zero, deck.units.degree),
        start=start,
        seconds=deck.units.time,
        courses=deck.courses,
        begin=begin,
        emissivities=deck.emissivities,
        listed=deck.listed,
    )  # fmt: skip


def _start(deck: SindaDeck) -> str:
    """Return where the transient begins: empty for the temperatures of NODE DATA."""
    if not deck.settles or deck.ends:
        return ""
    means = deck.averages and not deck.reading.control.get("DTIMES", 0.0)
    courses = [(load, load.course) for load in deck.loads if load.course is not None]
    alone = [load for load, course in courses if course.rests and (means or course.period)]
    others = [load for load, course in courses if load.stands and means and not course.rests]
    for loads, sinda in (
        (others, "those of {} that no heat rate is at the time of its start"),
        (alone, "none of {} of the transient alone"),
    ):
        if loads:
            takes = "the means of all courses" if means else "all courses at the time of its start"
            what = sinda.format(counted(len(loads), "course"))
            deck.reading.remark(loads[0].where, f"the steady state before the transient takes {takes}; SINDA takes {what}", dropped=False)
    return "steady, mean" if means else "steady"


Blocks = Generator[tuple[str, str, list[Line]], None, tuple[str, str]]
"""Header, submodel and lines of every block; at the end the header and submodel that what follows belongs to."""


def _blocks(deck: SindaDeck, path: Path, text: str, inside: tuple[Path, ...], at: tuple[str, str] = ("", "")) -> Blocks:
    """Yield the blocks of a text that begins in the block `at`, following INSERT and INCLUDE as if their text stood there."""
    (header, submodel), lines = at, list[Line]()
    words: list[str] = []
    commented = CommentedArrays() if path.suffix.lower() == SUFFIX else None
    for line in numbered(text, str(path)):
        row = line.text
        row = (commented.row(row) if commented is not None else None) or row
        if row[:1] in ("C", "c", "*") and not row[1:2].isalnum():
            words.append(row[1:].strip())
            _stated_unit(deck, row)
            continue
        row, _, note = row.partition("$")
        row = row.rstrip()
        if not row.strip() or row.strip().upper() in ("PSTOP", "PSTART"):
            words = [] if not row else words
            continue
        match = re.match(r"\s*HEADER\s+([A-Z]+(?:\s+(?:DATA|CALLS|\d))?)\s*,?\s*(\w*)", row, re.IGNORECASE)
        inserted = re.match(r"\s*(?:INSERT|INCLUDE)\s+'?([^'\s]+)'?\s*$", row, re.IGNORECASE)
        if inserted:
            yield header, submodel, lines
            lines = []
            header, submodel = yield from _inserted(deck, path, inserted[1], line, (*inside, path), (header, submodel))
        elif match:
            yield header, submodel, lines
            header, submodel, lines = " ".join(match[1].upper().split()), match[2].upper(), []
        else:
            lines.append(replace(line, text=row, before=tuple(words), note=note))
        words = []
    yield header, submodel, lines
    return header, submodel


def _inserted(deck: SindaDeck, path: Path, name: str, line: Line, inside: tuple[Path, ...], at: tuple[str, str]) -> Blocks:
    """Yield the blocks of an inserted file; the text beside a binary one (.k for .k_in) takes its place."""
    target = path.parent / name.replace("\\", "/").rsplit("/", 1)[-1]
    try:
        text = deck.reading.open(target, inside, str(line.where))
    except DeckError as error:
        beside = target.with_suffix(".k")
        if error.code != "file.another-kind" or target.suffix != ".k_in" or not beside.is_file():
            if error.code == "model.self-reference" or len(inside) >= cap("includes"):
                raise
            deck.reading.remark(line.part(0, len(line.text)), f"INSERT {name}: {error.message}")
            return at
        deck.reading.remark(line.part(0, len(line.text)), f"{name} is binary; the text file {beside.name} was read instead", dropped=False)
        target, text = beside, deck.reading.open(beside, inside, str(line.where))
    return (yield from _blocks(deck, target, text, inside, at))


def _stated_unit(deck: SindaDeck, row: str) -> None:
    """Take the units that Thermal Desktop states in comments."""
    match = re.match(r"C\s+TDUNITS,\s*(\w+)\s*=\s*(\S+)", row)
    if not match:
        return
    what, unit = match[1], match[2].upper()
    if what == "Energy" and unit in ENERGY:
        deck.units.take(unit)
    elif what == "Time" and unit in TIME:
        deck.units.time = TIME[unit]
    elif what == "Length" and unit in LENGTH:
        deck.units.lengths.add(LENGTH[unit])
        deck.units.length = LENGTH[unit] if unit in ("FT", "IN") else 1.0  # radiation conductors stay in m^2 under mm
    elif what == "Temp":
        deck.units.take(unit)


def _control(deck: SindaDeck, _: str, lines: list[Line]) -> None:
    """Read CONTROL DATA: absolute zero, Stefan-Boltzmann constant, unit system, end of the transient."""
    control = deck.reading.control
    for line in lines:
        if not re.match(r"\s*\w+\s*=", line.text):
            deck.reading.name_logic([line])
        for name, word in re.findall(r"(\w+)\s*=\s*([^=]*?)\s*,?\s*(?=\w+\s*=|$)", line.text):
            if name.upper() == "UID":
                deck.units.power_stated = True
                if word.upper().startswith("E"):
                    deck.units.energy, deck.units.time, deck.units.degree, deck.units.length = BTU, HOUR, RANKINE, LENGTH["FT"]
                deck.units.lengths.add(LENGTH["FT"] if word.upper().startswith("E") else 1.0)
            elif name.upper() in _RUN:
                deck.reading.take_control(name, word, line)
    if "TMPZRO" in control:
        control["ABSZRO"] = -abs(control["TMPZRO"])
    if "ABSZRO" in control:
        deck.units.zero, deck.units.temperature_stated = control["ABSZRO"], True
        if round(deck.units.zero) in (-459, -460):
            deck.units.degree = RANKINE
    deck.units.sigma = control.get("SIGMA", deck.units.sigma)


def _registers(deck: SindaDeck, _: str, lines: list[Line]) -> None:
    """Read REGISTER DATA: name = number or arithmetic of earlier names."""
    for line in lines:
        match = re.match(r"\s*(?:INT:|REAL:)?\s*(\w+)\s*=\s*(.+?)\s*$", line.text, re.IGNORECASE)
        if not match:
            deck.reading.remark(line.where, f"'{line.text.strip()}' is not a register")
            continue
        deck.reading.define(match[1], match[2], line.part(match.start(2), match.end(2)))
        if deck.cards:  # lines of Fortran call a constant by another name
            deck.reading.names[f"X{match[1].upper()}"] = deck.reading.names[match[1].upper()]


def _arrays(deck: SindaDeck, submodel: str, lines: list[Line]) -> None:
    """Read ARRAY DATA: number = values, over as many lines as they take."""
    numbers: list[float] | None = None
    repeated: list[tuple[str, TextSpan, list[float]]] = []
    for line in lines:
        row = line.text
        match = re.match(r"\s*(\d+)\s*=(\s*SPACE\s*,\s*\d+\s*$)?", row, re.IGNORECASE)
        if match:
            row, numbers, where = row[match.end() :], [], line.part(match.start(1), match.end(1))
            name = f"array {submodel}.{match[1]}"
            if match[2]:  # room that a file with the numbers fills
                deck.arrays.setdefault((submodel, match[1]), [0.0] * int(match[2].rpartition(",")[2]))
            elif name.upper() in deck.reading.defined:
                repeated.append((match[1], where, numbers))
            elif deck.reading.is_first(name, where):
                deck.arrays[submodel, match[1]] = numbers
                if owner := next((m for comment in reversed(line.before) if (m := OWNER.match(comment))), None):
                    deck.owners[submodel, match[1]] = (owner[1].upper(), f"T{int(owner[2])}")
        for word in re.findall(r"[^\s,&]+", row):
            if word.upper() == "END":
                continue
            if numbers is None:
                raise DeckError(f"'{word}' is not in an array.", str(line.where), code="import.not-understood")
            numbers.append(deck.reading.number(deck.reading.value(word, line.where)))
    for key, where, again in repeated:
        if again != deck.arrays[submodel, key]:
            deck.reading.is_first(f"array {submodel}.{key}", where)


def _carrays(deck: SindaDeck, submodel: str, lines: list[Line]) -> None:
    """Read CARRAY DATA: number = words, over as many lines as they take, in the order of the numbers."""
    rows: list[tuple[int, str]] = []
    for line in lines:
        match = re.match(r"\s*(\d+)\s*=", line.text)
        rows.append((int(match[1]) if match else rows[-1][0] if rows else 0, line.text[match.end() :] if match else line.text))
    rows.sort(key=lambda row: row[0])
    deck.words.setdefault(submodel, []).extend(word for _, row in rows for word in re.split(r"[\s,]+", row.strip()) if word)


def _operation(deck: SindaDeck, _: str, lines: list[Line]) -> None:
    """Read OPERATION DATA: the run's times, whether a steady state comes before the transient, or no transient at all.

    The temperatures of a steady state are those that the transient after it begins with; the steady state is that at TIMEO.
    """
    if not lines:
        return
    rest, solved = list[Line](), list[str]()
    for line in lines:
        if solution := next((name for name in _called(deck, line) if _STEADY.fullmatch(name) or _TRANSIENT.fullmatch(name)), None):
            solved.append("steady" if _STEADY.fullmatch(solution) else "transient")
        elif match := re.fullmatch(r"\s*(TIMEO|TIMEND|DTIMES)\s*=\s*(.+?)\s*", line.text, re.IGNORECASE):
            deck.reading.take_control(match[1], match[2], line)
        else:
            rest.append(line)
    deck.settles = solved[:1] == ["steady"]
    deck.ends = deck.settles and "transient" not in solved
    deck.operations.extend(rest)


def _called(deck: SindaDeck, line: Line) -> list[str]:
    """Return the routines that a statement calls; among cards a name alone, or one with arguments, is a call."""
    text = re.sub(r"^\s*[FM]\b", "", line.text)
    names = re.findall(r"\bCALL\s+(\w+)", text, re.IGNORECASE)
    if deck.cards and not names and (match := re.fullmatch(r"\s*([A-Z]\w*)\s*(\(.*\))?\s*", text, re.IGNORECASE)):
        names = [] if re.fullmatch(r"IF|ELSE|ENDIF|ENDDO|RETURN|END|CONTINUE|CLOSE|OPEN|COMMON", match[1], re.IGNORECASE) else [match[1]]
    return [name.upper() for name in names]


def _acts(deck: SindaDeck, line: Line) -> bool:
    """Return whether a statement can change the network or its run; one that builds all submodels cannot."""
    if match := re.match(r"\s*BUILDF?\s+(?:\w+\s*,)?(.+)", line.text, re.IGNORECASE):
        built = set(re.split(r"[\s,]+", match[1].strip().upper()))
        return "ALL" not in built and not {node.submodel for node in deck.nodes} <= built
    called = [name for name in _called(deck, line) if name not in deck.subroutines]
    return acts(line, called, _PRINTS, _ACTS, (*deck.reading.names, *_RUN, "TIMEN"))


def _nodes(deck: SindaDeck, submodel: str, lines: list[Line]) -> None:
    """Read NODE DATA: groups of number, temperature, capacitance; GEN, CAL, SIV, SPV, DIV, SIM, SPM, DIM, FAC, and SIT of boundaries."""

    def take(line: Line, kind: str, cells: Cells, factor: float | str) -> None:
        """Add what a card of this kind states, times a factor."""
        for node, course in _nodes_of_card(deck, submodel, line, kind, cells):
            if deck.reading.is_first(f"node {submodel}.{node.name}", node.where):
                mass = node.capacitance
                if factor != 1.0 and mass is not None:
                    product = {**mass, "mass": f"({factor})*{mass['mass']}"} if isinstance(mass, Mapping) else f"({factor})*{mass}"
                    node = replace(node, capacitance=product)
                deck.nodes.append(node)
                if course is not None:
                    deck.courses[node.path] = course

    _each_card(deck, lines, take, "a node. Write number, temperature, capacitance")


def _each_card(deck: SindaDeck, lines: list[Line], take: Callable[[Line, str, Cells, float | str], None], what: str) -> None:
    """Hand each card of a block on: its line, option and cells, and the factor of the FAC before it.

    Raises
    ------
    DeckError   When one is not what it should be.
    """
    factor: float | str = 1.0
    for line in lines:
        kind, cells = _card(line)
        try:
            if kind == "FAC":
                ((word, where),) = cells
                factor = deck.reading.value(word, where)
            else:
                take(line, kind, cells, factor)
        except ThermidError:
            raise
        except (ValueError, IndexError):
            raise DeckError(f"'{line.text.strip()}' is not {what}.", str(line.where), code="import.not-understood") from None


def _nodes_of_card(deck: SindaDeck, submodel: str, line: Line, kind: str, cells: Cells) -> Iterator[tuple[FileNode, FileCourse | None]]:
    """Yield the nodes of a card, with the course of a boundary's temperature; a card that is not read is named."""
    if kind == "":
        if len(cells) % 3:
            raise ValueError
        yield from ((_node(deck, submodel, line, cells[k : k + 3]), None) for k in range(0, len(cells), 3))
    elif kind in _REPEATS:
        for number in _numbers(cells):
            yield from _nodes_of_card(deck, submodel, line, _REPEATS[kind], [number, *cells[3:]])
    elif kind in ("SIV", "SPV", "DIV"):
        yield _tabulated_node(deck, submodel, line, kind, cells), None
    elif kind == "CAL":
        yield _node(deck, submodel, line, [*cells[:2], _product(cells[2:])]), None
    elif kind == "SIT" and cells[0][0].startswith("-") and not any(deck.reading.number(deck.reading.value(*cell)) for cell in cells[3:]):
        course = _over_time(deck, submodel, cells[2][0], line)
        yield _node(deck, submodel, line, [cells[0], cells[1], ("0.0", cells[2][1])]), _celsius(deck, course)
    else:
        deck.reading.remark(line.where, f"node option {kind}: '{line.words}'")


def _celsius(deck: SindaDeck, course: FileCourse) -> FileCourse:
    """Return a course of temperatures in degC."""
    return replace(course, numbers=np.array([deck.units.celsius(t) for t in course.numbers]))


def _node(deck: SindaDeck, submodel: str, line: Line, cells: Cells) -> FileNode:
    """Return the node of a line of NODE DATA: capacitance [J/K], start [degC], whether its temperature is fixed."""
    number = int(cells[0][0])
    celsius = deck.units.celsius(deck.reading.number(deck.reading.value(*cells[1])))
    text, where = cells[2]
    mass = deck.reading.value(text, where)
    held, massless = number < 0, isinstance(mass, float) and mass < 0.0
    capacitance = None if held or massless else with_unit(mass, "J/K", deck.units.energy / deck.units.degree)
    return FileNode(submodel, f"T{abs(number)}", capacitance, celsius, held, where, " ".join(line.before[-1:]))


def _card(line: Line) -> tuple[str, Cells]:
    """Return the option of a card, "" without one, and its cells."""
    (head, where), *rest = fields(line) or [("", line.where)]
    option = re.match(r"[A-Za-z]\w*", head)
    if option is None:
        return "", [(head, where), *rest]
    first = head[option.end() :].strip()
    return option[0].upper(), [(first, where), *rest] if first else rest


def _stepped(word: str, by: int) -> str:
    """Return a number of a node or conductor, moved by so much; its sign and its submodel stay."""
    match = re.fullmatch(r"(-?(?:\w+\.)?)(\d+)", word)
    if match is None:
        raise ValueError
    return f"{match[1]}{int(match[2]) + by}"


def _numbers(cells: Cells) -> Iterator[tuple[str, TextSpan]]:
    """Yield the numbers that an option makes of the first, their count and their increment.

    Raises
    ------
    DeckError   When there are more than the cap `repeats`.
    """
    (first, where), count, step = cells[0], int(cells[1][0]), int(cells[2][0])
    if count < 1:
        raise ValueError
    if count > cap("repeats"):
        raise DeckError(f"{count} elements of one statement are too many.{raising('repeats')}", str(where), code="cap.exceeded")
    yield from ((_stepped(first, k * step), where) for k in range(count))


def _product(cells: Cells) -> tuple[str, TextSpan]:
    """Return factors of a row as one, with the place of the first, where a changed value is written back."""
    return cells[0] if len(cells) == 1 else ("*".join(f"({word})" for word, _ in cells), cells[0][1])


def _over_time(deck: SindaDeck, submodel: str, word: str, line: Line) -> FileCourse:
    """Return an array of pairs as a course over time."""
    times, numbers = _pairs(deck, submodel, word, line)
    return FileCourse(np.array(times) * deck.units.time, np.array(numbers), 0.0, str(line.where))


def _pairs(deck: SindaDeck, submodel: str, word: str, line: Line) -> tuple[list[float], list[float]]:
    """Return an array of pairs, of times or temperatures and of values.

    Raises
    ------
    DeckError   When the deck has no such array, or an odd number of values in it.
    """
    values = _array(deck, submodel, word)
    if values is None or len(values) % 2:
        what = "is missing" if values is None else f"has {counted(len(values), 'number')}, but needs pairs"
        raise DeckError(f"array {word} of ARRAY DATA of {submodel} {what}.", str(line.where), code="import.not-understood")
    return values[::2], values[1::2]


def _tabulated_node(deck: SindaDeck, submodel: str, line: Line, kind: str, cells: Cells) -> FileNode:
    """Return a node whose capacitance is an array over temperature (SIV), a polynomial of it (SPV), or two arrays (DIV), times factors."""
    if len(cells) not in ((5, 6) if kind == "DIV" else (3, 4)):
        raise ValueError
    factors = [deck.reading.value(*cell) for cell in cells[3::2]] or [1.0]
    tables = [np.array(_points(deck, submodel, kind, word, line)).T for word, _ in cells[2::2]]
    number, celsius = int(cells[0][0]), deck.units.celsius(deck.reading.number(deck.reading.value(*cells[1])))
    unit = deck.units.energy / deck.units.degree
    mass, (grid, values) = factors[0], tables[0]
    if len(tables) > 1:
        mass, grid = 1.0, np.unique(np.concatenate([t for t, _ in tables]))
        numbers = [_as_number(deck, factor, line) for factor in factors]
        values = sum(factor * np.interp(grid, t, c) for factor, (t, c) in zip([*numbers, 1.0], tables, strict=False))
    points = [[f"{t!r} [degC]", f"{c * unit!r} [J/(kg K)]"] for t, c in zip(grid.tolist(), values.tolist(), strict=True)]
    table = {"points": points, "source": "derived", "basis": str(line.where)}
    return FileNode(submodel, f"T{abs(number)}", {"mass": with_unit(mass, "kg"), "specific_heat": table}, celsius, number < 0, cells[2][1])


def _as_number(deck: SindaDeck, value: float | str, line: Line) -> float:
    """Return the number of a factor that a table takes in; of an expression of registers a remark says that the table does not follow."""
    if isinstance(value, str):
        deck.reading.remark(line.where, f"'{line.words}': the table has {value} as it is here and does not follow it", dropped=False)
    return deck.reading.number(value)


def _array(deck: SindaDeck, submodel: str, word: str) -> list[float] | None:
    """Return the numbers of an array: A3 of the submodel that names it, or OTHER.A3."""
    owner, _, name = word.upper().rpartition(".")
    return deck.arrays.get((owner or submodel, name.removeprefix("A").strip(" ()")))


def _points(deck: SindaDeck, submodel: str, kind: str, word: str, line: Line) -> list[tuple[float, float]]:
    """Return temperature [degC] and value, in the deck's unit, of an array of pairs, or of a polynomial (SPV) every 5 K.

    Raises
    ------
    DeckError   As `_pairs`.
    """
    if kind != "SPV":
        return [(deck.units.celsius(t), v) for t, v in zip(*_pairs(deck, submodel, word, line), strict=True)]
    values = _array(deck, submodel, word)
    if values is None:
        raise DeckError(f"array {word} of ARRAY DATA of {submodel} is missing.", str(line.where), code="import.not-understood")
    grid = np.arange(-270.0, 230.1, 5.0)
    deck.reading.remark(line.where, "polynomial over temperature as a table every 5 K from -270 to 230 degC", dropped=False)
    native = (grid + 273.15) / deck.units.degree + deck.units.zero
    return list(zip(grid.tolist(), np.polynomial.polynomial.polyval(native, values).tolist(), strict=True))


def _conductors(deck: SindaDeck, submodel: str, lines: list[Line]) -> None:
    """Read CONDUCTOR DATA: number, pairs of nodes, value; GEN, CAL, SIV, SPV, SIM, SPM, FAC. A contactor of a comment groups its rows.

    An array of a radiation conductor is its emissivity at the mean of both temperatures, a control of the model. A block of
    radiation alone, as Thermal Desktop writes one for each group of surfaces that see each other, is one group, and its rows follow the
    emissivities that its comments state. The rows through an insulation are a group for each submodel.
    """
    block = len(lines) > 1 and all(line.text.lstrip().startswith("-") for line in lines)
    group = _Group(f"radiation_{identifier(submodel)}" if block else "", _followed(deck, lines) if block else {})

    def take(line: Line, kind: str, cells: Cells, factor: float | str) -> None:
        """Add what a card of this kind states, times a factor."""
        for row in _conductors_of_card(deck, submodel, line, kind, cells, group):
            key = SCALED[row.table["kind"]]
            product = row.table[key] if factor == 1.0 else f"({factor})*{row.table[key]}"
            deck.conductors.append(replace(row, table={**row.table, key: product}))

    _each_card(deck, lines, take, "a conductor. Write number, node, node, value")


def _conductors_of_card(deck: SindaDeck, submodel: str, line: Line, kind: str, cells: Cells, group: _Group) -> Iterator[FileConductor]:
    """Yield the conductors of a card; a card that is not read is named."""
    if kind in _REPEATS and kind != "DIM":
        single = "" if kind == "GEN" and len(cells) == 8 else _REPEATS[kind]
        for k, number in enumerate(_numbers(cells)):
            ends = [(_stepped(cells[n][0], k * int(cells[n + 1][0])), cells[n][1]) for n in (3, 5)]
            yield from _conductors_of_card(deck, submodel, line, single, [number, *ends, *cells[7:]], group)
    elif kind == "CAL" and len(cells) > 4 and (len(cells) == 7 or deck.reading.number(deck.reading.value(*cells[-1])) == 1.0):
        # X Y Z / W
        product, where = _product(cells[3:-1])
        yield from _row(deck, submodel, "", [*cells[:3], (f"({product})/({cells[-1][0]})", where)], group, line)
    elif kind in ("SIV", "SPV"):
        yield from _row(deck, submodel, kind, cells, group, line)
    elif kind == "":
        for k, n in _groups(cells):
            yield from _row(deck, submodel, "", cells[k:n], group, line)
    else:
        deck.reading.remark(line.where, f"conductor option {kind}: '{line.words}'")


def _followed(deck: SindaDeck, lines: list[Line]) -> dict[TextSpan, tuple[FileEmissivity, ...]]:
    """Return place of a row -> the emissivities that it follows, and keep their values; empty where the files do not say them."""
    areas = Path(lines[0].where.file).with_suffix(".ar")
    text, emissivities, places = deck.reading.texts[lines[0].where.file], dict[str, tuple[float, float]](), dict[str, TextSpan]()
    begin = lines[0].where.begin if any("PROPERTY NAME" in words for words in lines[0].before) else 0
    at = text.find("\n", text.rfind("PROPERTY NAME", 0, begin)) + 1
    while found := PROPERTY.match(text, at, begin):  # the list stands above the block
        at = found.end()
        emissivities[made := f"emissivity_{identifier(found[1])}"] = (float(found[3] or found[2]), float(found[2]))
        places[made] = TextSpan(lines[0].where.file, text.count("\n", 0, found.start()) + 1, *found.span(2))
    block = read_emissivities([(x.text, x.note) for x in lines], emissivities, deck.reading.open(areas)) if areas.is_file() else None
    if block is None:
        return {}
    for name, (value, nodes) in block.values.items():
        old, n = deck.emissivities.get(name, (value, 0))
        now, stood = emissivities[name][1], next((e for each, e in deck.listed.values() if each == name), emissivities[name][1])
        if (old, stood) != (value, now):
            deck.reading.remark(
                lines[0].where, f"{name} is {now:g} here and {stood:g} in another block: its rows follow no emissivity", False
            )
            return {}
        deck.emissivities[name] = (value, n + nodes)
        deck.listed[places[name]] = (name, now)
    if block.between:
        deck.reading.remark(
            lines[0].where,
            f"{counted(block.between, 'node')} of several coatings: counted to the emissivity that is nearest",
            dropped=False,
        )
    return {line.where: row for line, row in zip(lines, block.rows, strict=True)}


_NO_NAME: Final = re.compile(r"^\w+ - |(?:Face|Edge) Contactor-?|\[[^\]]*\]")
"""What stands around the name of a contactor in its comment."""


class _Group:
    """The contactor that comments name, as long as its rows last.

    Rows belong to it until their pair of submodels changes; inside one submodel until their first node does.
    """

    def __init__(self, block: str = "", followed: Mapping[TextSpan, tuple[FileEmissivity, ...]] = MappingProxyType({})) -> None:
        self.name, self.key, self.block, self.followed = "", ("", ""), block, followed

    def name_for(self, line: Line, ends: tuple[tuple[str, str], tuple[str, str]]) -> str:
        """Return the name of the conductor of a line, by the contactor or block of comments above it and by its two ends."""
        (sub_a, a), (sub_b, b) = ends
        key = (sub_a, sub_b) if sub_a != sub_b else (sub_a, a)
        # `Contact - Face Contactor-Chip to board[SUB][7]::738` is contact_chip_to_board_738
        comments = (comment for comment in line.before if re.match(r"(?:Contact|Conductor) - ", comment))
        contactors = [f"contact_{identifier(_NO_NAME.sub('', comment)).removeprefix('n_')}" for comment in comments]
        if contactors:
            self.name, self.key = "_and_".join(dict.fromkeys(contactors)), key
        elif key != self.key:
            self.name = ""
        if not contactors and sub_a == sub_b and abs(int(b[1:]) - int(a[1:])) == INSULATION:
            return f"mli_{identifier(sub_a)}" + ("" if line.text.lstrip().startswith("-") else "_conduction")
        return self.name or self.block


def _end(word: str, submodel: str) -> tuple[tuple[str, str], bool]:
    """Return the node that a word names, and whether a minus makes it the upstream end of a one-way conductor."""
    oneway = word.startswith("-")
    owner, _, number = word.lstrip("-").rpartition(".")
    return ((owner.upper() or submodel), f"T{int(number)}"), oneway


def _groups(cells: Cells) -> Iterator[tuple[int, int]]:
    """Yield the indices (begin, end) of each conductor's cells on a card: number, pairs of nodes, value.

    Where several stand on a card, a value before the last is told from a node by its form: it is no whole number.

    Raises
    ------
    ValueError  When cells are left over.
    """
    begin = 0
    for k in range(1, len(cells)):
        if k == len(cells) - 1 or re.fullmatch(r"-?(?:[A-Za-z]\w*\.)?\d+", cells[k][0]) is None:
            yield begin, k + 1
            begin = k + 1
    if begin < len(cells):
        raise ValueError


def _row(deck: SindaDeck, submodel: str, kind: str, cells: Cells, group: _Group, line: Line) -> Iterator[FileConductor]:
    """Yield the conductors of a row: one for each pair of nodes."""
    number = int(cells[0][0])
    many = 2 if kind and len(cells) % 2 else 1  # an array may have a factor behind it
    pairs, values = cells[1:-many], cells[-many:]
    if not pairs or len(pairs) % 2:
        raise ValueError
    if not deck.reading.is_first(f"conductor {submodel}.{abs(number)}", cells[0][1]):
        return
    for k in range(0, len(pairs), 2):
        (a, minus_a), (b, minus_b) = _end(pairs[k][0], submodel), _end(pairs[k + 1][0], submodel)
        name = f"{submodel}_{'R' if number < 0 else 'G'}{abs(number)}" + (f"_{k // 2 + 1}" if len(pairs) > 2 else "")
        where = values[-1][1]  # of an array and its factor: the factor
        if minus_a or minus_b:
            if kind or number < 0 or (minus_a and minus_b):
                deck.reading.remark(line.where, f"{name} is one-way, and not a plain number of W/K: '{line.text.strip()}'")
                continue
            value = deck.reading.value(values[0][0], where)
            ends = (a, b) if minus_a else (b, a)
            yield FileConductor(name, ends, stream(value, deck.units.power / deck.units.degree), where, group.name_for(line, (a, b)))
            continue
        law = _law(deck, submodel, kind, number, values, line)
        yield FileConductor(name, (a, b), law, where, group.name_for(line, (a, b)), group.followed.get(line.where, ()))


def _law(deck: SindaDeck, submodel: str, kind: str, number: int, values: Cells, line: Line) -> dict[str, object]:
    """Return the table that a model has of a conductor, without its ends.

    A positive number is a conductance G [W/K], a negative one radiation: SIGMA G (T_a^4 - T_b^4), an exchange area [m^2] in a model. With
    SIV or SPV, G is an array or a polynomial over the mean temperature of both ends, times a factor; of radiation it is an emissivity.
    """
    text, where = values[0]
    units = deck.units
    if kind:
        factor = deck.reading.value(*values[1]) if len(values) > 1 else 1.0
        points = _points(deck, submodel, kind, text, line)
        if number < 0:
            by = {"points": [[f"{t!r} [degC]", f"{e!r}"] for t, e in points]}
            return {"kind": "radiation", "exchange_factor": 1.0, "area": with_unit(factor, "m^2", units.exchange_area()), "control": by}
        table = [[f"{t!r} [degC]", f"{g * units.power / units.degree!r} [W/K]"] for t, g in points]
        return {"kind": "table", "table": {"points": table}, "scale": f"({factor})" if isinstance(factor, str) else repr(factor)}
    value = deck.reading.value(text, where)
    if number < 0:
        return {"kind": "radiation", "exchange_factor": 1.0, "area": with_unit(value, "m^2", units.exchange_area())}
    return {"kind": "conduction", "conductance": with_unit(value, "W/K", units.power / units.degree)}


def _sources(deck: SindaDeck, submodel: str, lines: list[Line]) -> None:
    """Read SOURCE DATA: groups of node and power; GEN; SIT and SIV with an array over time or over the node's temperature, and a factor."""
    unit = deck.units.power
    for line in lines:
        kind, cells = _card(line)
        loads: list[FileLoad] = []
        try:
            if kind in ("SIT", "SIV"):
                (node, _), (array, _), (word, _) = cells
                factor = deck.reading.value(word, line.where)
                load = FileLoad(f"{submodel}_Q{int(node)}", (submodel, f"T{int(node)}"), 0.0, line.where, stands=False)
                if kind == "SIT":
                    loads.append(_following(load, _over_time(deck, submodel, array, line), factor, unit))
                else:
                    watts = _as_number(deck, factor, line) * unit
                    points = [[f"{t!r} [degC]", f"{p * watts!r} [W]"] for t, p in _points(deck, submodel, kind, array, line)]
                    loads.append(replace(load, more={"table": {"points": points}}))
            elif kind in ("", "GEN"):
                numbers = list(_numbers(cells)) if kind else cells[::2]
                powers = [_product(cells[3:])] * len(numbers) if kind else cells[1::2]
                for (node, _), (text, where) in zip(numbers, powers, strict=True):
                    value = with_unit(deck.reading.value(text, where), "W", unit)
                    loads.append(FileLoad(f"{submodel}_Q{int(node)}", (submodel, f"T{int(node)}"), value, where))
            else:
                raise ValueError
        except ThermidError:
            raise
        except (ValueError, IndexError):
            deck.reading.remark(line.where, f"source '{line.words}'")
            continue
        deck.loads.extend(loads)


def _following(load: FileLoad, course: FileCourse, factor: float | str, unit: float) -> FileLoad:
    """Return a load that follows a course times a factor and a unit [W]: in watts, or by shares of a power where the factor has names."""
    if isinstance(factor, str):
        return replace(load, power=with_unit(factor, "W", unit), course=course, scales=True)
    return replace(load, power=course.mean * factor * unit, course=course, factor=factor * unit)


_SET: Final = re.compile(r"\s*(?:(\w+)\.)?([QT])(\d+)\s*=\s*(?:((?:\w+\.)?Q\d+)\s*\+)?\s*(.+?)\s*$", re.IGNORECASE)


Variable = tuple[FileCourse, float | str]
"""A course over time that a call put into a variable, and the factor that it had."""


def _joined(lines: list[Line]) -> Iterator[Line]:
    """Yield statements, their continuation lines joined: each character keeps its distance from the first, as in the file."""
    pending: Line | None = None
    for line in lines:
        mark = re.match(r"\s*[+&]", line.text)
        if pending is not None and (mark or pending.text.endswith("&")):
            begin = mark.end() if mark else 0
            pending = replace(pending, text=pending.text.removesuffix("&")).joined(line.cut(begin, len(line.text)))
            continue
        if pending is not None:
            yield pending
        pending = line
    if pending is not None:
        yield pending


def _logic(deck: SindaDeck, submodel: str, lines: list[Line]) -> None:
    """Read VARIABLES 0 and 1: powers, temperatures of boundaries, both over time too, heaters; every other statement is named."""
    lines = list(_heaters(deck, submodel, lines))
    variables: dict[str, Variable] = {}
    branch, label, depth, unknown, unused = "", "", 0.0, list[Line](), dict[str, Line]()
    for line in lines:
        text = line.words
        label = next((_label(words) for words in line.before if words.startswith("Heat Load")), label)
        deeper = nesting("GO TO" if branch and re.match(r"ELSE ?IF\b", text, re.IGNORECASE) else text)
        if not branch and not depth and _NOT_STEADY.fullmatch(text):
            branch = "transient"
            continue
        if depth or deeper > 0.0:
            depth = max(depth + deeper, 0.0)
            unknown.append(line)
        elif branch and text.upper() == "ELSE":
            branch = "steady"
        elif branch and text.upper().replace(" ", "") == "ENDIF":
            branch = ""
        elif branch != "steady" and (match := CALL.match(line.text)):
            _absorbed(deck, (match[1] or match[2]).upper(), line)
        elif put := _interpolated(deck, submodel, line):
            target, variable = put
            if match := re.fullmatch(r"(?:(\w+)\.)?([QT])(\d+)", target):
                into = ((match[1] or submodel).upper(), f"T{int(match[3])}")
                if branch or not _put(deck, match[2], into, variable[1], line.where, variable[0], label):
                    unknown.append(line)
            else:
                unknown.extend([unused[target]] if target in unused else [])
                variables[target] = variable
                unused[target] = line
        elif not _taken(deck, submodel, line, variables, unused, branch, label) and not (deck.cards and text.upper() == "CONTINUE"):
            unknown.append(line)
    deck.reading.name_logic([*unknown, *unused.values()])


_NOT_STEADY: Final = re.compile(r"IF ?\( ?NSOL ?\.GT\. ?1(?: ?\.OR\. ?DTIMES ?\.GT\. ?0\.?)? ?\) ?THEN", re.IGNORECASE)
"""The question whether a transient is computed, as Thermal Desktop writes it."""


def _interpolated(deck: SindaDeck, submodel: str, line: Line) -> tuple[str, Variable] | None:
    """Return where the interpolation of a statement goes, and its course over time; None when it is none over time."""
    match = re.match(r"\s*(?:CALL\s+)?(\w+)\s*\((.*)\)\s*$", line.text, re.IGNORECASE)
    form = _INTERPOLATIONS.get(match[1].upper(), "") if match else ""
    words = [word for word, _ in fields(replace(line, text=match[2]))] if match else []
    if not form or len(words) != len(form) or words[form.index("x")].upper() not in ("TIMEM", "TIMEN"):
        return None
    arguments = dict(zip(form, words, strict=True))
    try:
        pairs = [_array(deck, submodel, arguments[key]) for key in "PTY" if key in arguments]
        times, numbers = (pairs[0][::2], pairs[0][1::2]) if "P" in arguments and pairs[0] is not None else pairs
        factor = deck.reading.value(arguments.get("z", "1.0"), line.where)
        period = deck.reading.number(deck.reading.value(arguments.get("p", "0.0"), line.where))
        if times is None or numbers is None:
            return None
        course = FileCourse(np.array(times) * deck.units.time, np.array(numbers), period * deck.units.time, str(line.where))
    except (ThermidError, ValueError):
        return None
    return arguments["r"].upper(), (course, factor)


def _taken(
    deck: SindaDeck, submodel: str, line: Line, variables: Mapping[str, Variable], unused: dict[str, Line], branch: str, label: str
) -> bool:
    """Take a statement that sets a power or a boundary's temperature, or adds a power; whether it is one."""
    match = _SET.fullmatch(line.text)
    if match is None:
        return False
    owner, kind, node = (match[1] or submodel).upper(), match[2].upper(), f"T{int(match[3])}"
    adds = match[4] is not None
    if adds and _end(re.sub(r"Q(?=\d+$)", "", match[4].upper()), submodel)[0] != (owner, node):
        return False
    text, where = match[5], line.part(match.start(5), match.end(5))
    used = next((name for name in variables if re.search(rf"(?<![\w.]){re.escape(name)}(?!\w)", text, re.IGNORECASE)), None)
    try:
        if used is None:
            factor, course = deck.reading.value(text, where), None
        else:
            rows = [re.sub(rf"(?<![\w.]){re.escape(used)}(?!\w)", at, text, flags=re.IGNORECASE) for at in ("1.0", "2.0", "3.0")]
            one, two, three = (deck.reading.number(deck.reading.value(row, where)) for row in rows)
            if not math.isclose(two, one + one) or not math.isclose(three, one + two):
                return False  # no multiple of the course
            course, factor = variables[used]
            factor = _times(deck.reading.value(rows[0], where), factor)
    except (ThermidError, ArithmeticError):
        return False
    if (branch and not adds) or not _put(deck, kind, (owner, node), factor, where, course, label, adds, branch):
        return False
    unused.pop(used or "", None)
    return True


def _times(a: float | str, b: float | str) -> float | str:
    """Return the product of two values of a deck."""
    return a * b if isinstance(a, float) and isinstance(b, float) else f"({a})*({b})"


def _put(
    deck: SindaDeck,
    kind: str,
    into: tuple[str, str],
    factor: float | str,
    where: TextSpan,
    course: FileCourse | None,
    label: str,
    adds: bool = False,
    branch: str = "",
) -> bool:
    """Take a power into a node (kind Q) or the temperature of a boundary (T): a constant, or a course times a factor, in the deck's units.

    A power that does not add to the node's own replaces those set before. In a `branch`, transient or steady, a course is of the transient
    and a constant of the steady state before it, where it stands for that course. Returns whether there is a place for it.
    """
    unit = deck.units.power
    if kind == "T":
        k = next((k for k, node in enumerate(deck.nodes) if (node.submodel, node.name) == into and node.held), None)
        if k is None or adds or branch or not isinstance(factor, float):
            return False
        if course is None:
            deck.nodes[k] = replace(deck.nodes[k], celsius=deck.units.celsius(factor))
        else:
            deck.courses[deck.nodes[k].path] = _celsius(deck, replace(course, numbers=course.numbers * factor))
        return True
    if not adds and (old := [load for load in deck.loads if load.into == into]):
        deck.reading.remark(where, f"the power of {'.'.join(into)} replaces {counted(len(old), 'power')} set before", dropped=False)
        deck.loads = [load for load in deck.loads if load.into != into]
    if branch == "steady" and course is not None:
        return False
    name = f"{into[0]}_Q{into[1][1:]}" + (f"_{label}" if label else "")
    load = FileLoad(name, into, with_unit(factor, "W", unit), where, label)
    if course is not None:
        load = _following(load, replace(course, rests=branch != "" and deck.settles), factor, unit)
    elif branch:  # in a steady state, what stands for a course of the transient
        for k, other in enumerate(deck.loads):
            if branch == "steady" and other.course is not None and (other.into, other.group) == (into, label):
                now = replace(other.course, rests=False)
                deck.loads[k], deck.averages = replace(other, power=load.power, course=now, stands=False), True
                return True
        return False
    deck.loads.append(load)
    return True


def _absorbed(deck: SindaDeck, submodel: str, line: Line) -> None:
    """Add a load for each array of heat rates of a submodel: its course, and the mean over it for a steady state [W].

    Named are a submodel of which no text file was read, and nodes of which the file has no rates.
    """
    arrays = {int(key): numbers for (owner, key), numbers in deck.arrays.items() if owner == submodel}
    if submodel not in deck.words:
        deck.reading.remark(line.where, f"heat rates: no text file with those of {submodel} was read")
        return
    owners = {int(key): node for (owner, key), node in deck.owners.items() if owner == submodel}
    rates, absent = heat_rates(arrays, owners, deck.words[submodel], deck.units.time, str(line.where))
    for node in absent:
        deck.reading.remark(line.where, f"heat rate: {node} has none in the text file of {submodel}")
    for rate in rates:
        name = f"{rate.into[0]}_{submodel.lower()}_{rate.into[1]}"
        mean, course = rate.mean * deck.units.power, None if deck.ends else rate.course
        deck.averages |= course is not None
        deck.loads.append(FileLoad(name, rate.into, mean, line.where, submodel, course, factor=deck.units.power, stands=False))


def _label(words: str) -> str:
    """Return the name of a heat load: `Heat Load-chips[SUB]::3EA` -> `chips_3ea`."""
    return identifier(re.sub(r"^Heat Load-?|\[[^\]]*\]", "", words)).removeprefix("n_")


def _heaters(deck: SindaDeck, submodel: str, lines: list[Line]) -> Iterator[Line]:
    """Take the heaters out that Thermal Desktop writes by a template, each as loads with a thermostat; yield all other lines."""
    block: list[Line] = []
    for line in lines:
        if any(re.match(r"Heater\b", words) for words in line.before):
            yield from _heater(deck, submodel, block)
            block = [line]
        elif block:
            block.append(line)
        else:
            yield line
    yield from _heater(deck, submodel, block)


def _heater(deck: SindaDeck, submodel: str, block: list[Line]) -> list[Line]:
    """Add the loads of one heater; return its lines where they are not the template."""
    text = "\n".join(line.text for line in block)
    power = re.search(r"\bPO(\w+)\s*=\s*([-\d.eEdD+]+)\s*$", text, re.MULTILINE)
    sensed = re.search(r"T__TD\s*=\s*1\.?\s*\*\s*(?:(\w+)\.)?T(\d+)\s*$", text, re.MULTILINE)
    on, off = (re.search(rf"\b{name}__TD\s*=\s*([-\d.eEdD+]+)\s*$", text, re.MULTILINE) for name in "OF")
    if not block or power is None or sensed is None or on is None or off is None:
        return block
    shares = dict.fromkeys(re.findall(rf"(\w+)\.Q(\d+)\s*=\s*\1\.Q\2\s*\+\s*PO{power[1]}\s*\*\s*([\d.]+)", text, re.IGNORECASE))
    limits = [deck.units.celsius(float(fortran(heater_line[1]))) for heater_line in (on, off)]
    sensor = f"{(sensed[1] or submodel).upper()}.T{int(sensed[2])}"
    for owner, node, share in shares:
        watts = float(fortran(power[2])) * float(share) * deck.units.power
        control = {"thermostat": {"sensor": sensor, "on_below": f"{limits[0]!r} [degC]", "off_above": f"{limits[1]!r} [degC]"}}
        name = f"{owner.upper()}_heater{power[1]}_Q{int(node)}"
        deck.loads.append(FileLoad(name, (owner.upper(), f"T{int(node)}"), watts, block[0].where, "", None, control))
    return [] if shares else block


def _read_units(deck: SindaDeck, path: Path, words: str) -> None:
    """Read REGISTER and CONTROL DATA, and ask for the units that neither nor anything else states.

    Raises
    ------
    DeckError   When the unit of temperatures is open, or that of powers beside degrees Fahrenheit; when the deck states others than given.
    """
    for wanted, reader in (("REGISTER", _registers), ("CONTROL", _control)):
        for header, submodel, lines in deck.steps:
            if header.startswith(wanted):
                reader(deck, submodel, list(_joined(lines)))
    units, stated = deck.units, Units()
    stated.take(words)
    other_zero = stated.temperature_stated and round(stated.zero) != round(units.zero)
    lengths = {LENGTH[word] for word in re.findall(r"[^\s,]+", words.upper()) if word in LENGTH}
    if (
        other_zero
        or (lengths and units.lengths and not lengths <= units.lengths)
        or (stated.power_stated and round(stated.power / units.power, 2) != 1.0)
    ):
        raise DeckError(
            f"the units '{words}' contradict the deck: its absolute zero is {units.zero:g}, its unit of power {units.power:g} W"
            f"{''.join(f', its unit of length {metres:g} m' for metres in sorted(units.lengths))}. "
            "Give the units that it states, or none.",
            str(path),
            code="value.contradicts",
        )
    fahrenheit = round(units.zero) in (-459, -460)
    if not units.temperature_stated or (fahrenheit and not units.power_stated):
        what = "the unit of powers (UID)" if units.temperature_stated else "the unit of temperatures (ABSZRO)"
        raise DeckError(
            f'the deck does not state {what}. Give its units, as in --units "BTU h ft F" or "W m C", or write ABSZRO (-459.67, -273.15 or '
            "0) and UID (ENG or SI) into CONTROL DATA.",
            str(path),
            code="value.incomplete",
        )
    if not units.power_stated:
        where = deck.steps[-1][2][0].where if deck.steps[-1][2] else deck.steps[0][2][0].where
        deck.reading.remark(where, "UID is not stated; W, J and s are assumed", dropped=False)


def _name_what_is_left(deck: SindaDeck) -> None:
    """Name what no reader took: in blocks of statements those that act, other blocks whole."""
    rest = [step for step in deck.steps if not step[0].startswith(("REGISTER", "CONTROL", *_READERS, *_WITHOUT_EFFECT))]
    deck.reading.name_logic(line for line in deck.operations if _acts(deck, line))
    for header, submodel, lines in rest:
        if header.startswith(("VARIABLES", "OUTPUT", "SUBROUTINE")):
            deck.reading.name_logic(line for line in _joined(lines) if _acts(deck, line))
        elif lines:
            what = "FLUINT (fluid submodels)" if header.startswith(("FLOW", "FPROP")) else f"HEADER {header} {submodel}".strip()
            deck.reading.remark(lines[0].where, f"{what}: {counted(len(lines), 'line')}")


_READERS = {
    "OPERATION": _operation,
    "ARRAY": _arrays,
    "CARRAY": _carrays,
    "NODE": _nodes,
    "CONDUCTOR": _conductors,
    "SOURCE": _sources,
    "VARIABLES 0": _logic,
    "VARIABLES 1": _logic,
}
"""Block -> its reader, in the order in which they are read."""
