"""What readers of decks share: files that include each other, numbers with their places, expressions of names, and what was left out."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final, TypeVar

from thermid.base.errors import DeckError, ThermidError, cap, raising
from thermid.base.expression import parse
from thermid.base.files import read_bytes
from thermid.interop._decks.network_file import DeckRemark, FileConductor, FileLoad, FileNode, TextSpan, fortran, identifier

Element = TypeVar("Element", FileConductor, FileLoad)


@dataclass(frozen=True)
class Line:
    """A line of a deck without its comment: text, place, the words of the comment lines right before it, and of its own comment."""

    text: str
    where: TextSpan
    before: tuple[str, ...] = ()
    note: str = ""

    @property
    def words(self) -> str:
        """The text with single blanks, as a remark quotes it."""
        return " ".join(self.text.split())

    def part(self, begin: int, end: int) -> TextSpan:
        """Return the place of some characters of the text."""
        return TextSpan(self.where.file, self.where.line, self.where.begin + begin, self.where.begin + end)

    def cut(self, begin: int, end: int) -> Line:
        """Return the line with some characters of the text only."""
        return replace(self, text=self.text[begin:end], where=self.part(begin, end))

    def joined(self, line: Line) -> Line:
        """Return the line with one that continues it: each character keeps its distance from the first, as in the file."""
        room = line.where.begin - self.where.begin if line.where.file == self.where.file else 0
        return replace(self, text=self.text.ljust(max(room, len(self.text) + 1)) + line.text)


@dataclass
class DeckReading:
    """The state of a reader: texts of files as opened, names of parameters and their numbers, what was defined where, remarks.

    Files of which there is a text `instead` are read as that text.
    """

    instead: Mapping[str, str] = field(default_factory=dict)
    texts: dict[str, str] = field(default_factory=dict)
    names: dict[str, str] = field(default_factory=dict)
    numbers: dict[str, float] = field(default_factory=dict)
    parameters: dict[str, tuple[float | str, TextSpan]] = field(default_factory=dict)
    defined: dict[str, TextSpan] = field(default_factory=dict)
    remarks: list[DeckRemark] = field(default_factory=list)
    control: dict[str, float] = field(default_factory=dict)

    def open(self, path: Path, inside: tuple[Path, ...] = (), named_in: str = "") -> str:
        """Return the text of a file, byte for byte as Latin-1.

        Raises
        ------
        DeckError   When it is missing, too large, binary, or includes itself.
        """
        if not path.is_file():
            raise DeckError(
                f"there is no file '{path.name}' in {path.parent.name or 'this folder'}.", named_in or str(path), code="file.not-found"
            )
        if path in inside or len(inside) >= cap("includes"):
            chain = " -> ".join(file.name for file in (*inside, path))
            raise DeckError(
                f"files include each other endlessly: {chain}.{'' if path in inside else raising('includes')}",
                named_in,
                code="model.self-reference" if path in inside else "cap.exceeded",
            )
        if path.stat().st_size > cap("deck"):
            raise DeckError(
                f"the file has more than {cap('deck') / 1e6:.0f} MB. Split it into include files.{raising('deck')}",
                str(path),
                code="cap.exceeded",
            )
        text = self.instead.get(str(path)) or read_bytes(path).decode("latin-1")
        if "\0" in text:
            raise DeckError(
                "this is a binary file, but a deck is a text. Give its text file (.cc, .k, .inp, .d).", str(path), code="file.another-kind"
            )
        self.texts[str(path)] = text
        for mark in _MARK.finditer(text):  # an export of an incomplete model states this
            span = TextSpan(str(path), text.count("\n", 0, mark.start()) + 1, *mark.span())
            self.remarks.append(DeckRemark(span, mark[1].strip(), mark=True))
        return text

    def remark(self, where: TextSpan, what: str, dropped: bool = True) -> None:
        """Keep what was not taken over, or was assumed."""
        self.remarks.append(DeckRemark(where, what, dropped))

    def name_logic(self, lines: Iterable[Line]) -> None:
        """Name statements that no reader took over, those that follow each other together."""
        runs: list[list[Line]] = []
        for line in sorted(lines, key=lambda line: (line.where.file, line.where.line)):
            last = runs[-1][-1].where if runs else None
            if last is None or line.where.file != last.file or line.where.line > last.line + 4:
                runs.append([])
            runs[-1].append(line)
        for run in runs:
            rows = f"lines {run[0].where.line} to {run[-1].where.line}" if len(run) > 1 else "line"
            quoted = "; ".join(line.words for line in run)
            self.remark(run[0].where, f"logic not taken over ({rows}): '{quoted}'")

    def is_first(self, what: str, where: TextSpan) -> bool:
        """Return whether something of this name is defined for the first time; a second definition is named and left out."""
        first = self.defined.setdefault(what.upper(), where)
        if first is not where:
            self.remark(where, f"{what} is defined again: its first definition, at {first}, holds")
        return first is where

    def define(self, word: str, text: str, where: TextSpan, scope: str = "") -> None:
        """Make a parameter of a name of the deck; of a name defined twice in its scope the first holds.

        Raises
        ------
        DeckError   As `value` does.
        """
        value = self.value(text, where)
        if self.is_first(f"{scope}.{word}".strip("."), where):
            name = self.name(word)
            self.parameters[name], self.numbers[name] = (value, where), self.number(value)

    def take_control(self, name: str, text: str, line: Line) -> None:
        """Keep a control constant of a line; one that is neither a number nor arithmetic of names is named."""
        try:
            self.control[name.upper()] = self.number(self.value(text, line.where))
        except ThermidError:
            self.name_logic([line])

    def number(self, value: float | str) -> float:
        """Return the number of a value, with the names as the deck has them."""
        return value if isinstance(value, float) else float(parse(value).evaluate(lambda name: self.numbers[name]))

    def value(self, text: str, where: TextSpan) -> float | str:
        """Return a number, or an expression of the deck's names as a model has it.

        Raises
        ------
        DeckError   When it is neither; an unknown name is stated. When it is a number with an exponent without its letter: 2.5+4 is 25000
                    in data that Fortran reads, and 6.5 as arithmetic.
        """
        words, shown = fortran(text), " ".join(text.split())
        if match := re.fullmatch(r"([-+]?(?:\d+\.\d*|\.\d+))([-+]\d{1,2})", words):
            raise DeckError(
                f"'{words}' is {match[1]}E{match[2]} to Fortran, and a sum as arithmetic. Write the E, or blanks around the sign.",
                str(where),
                code="import.not-understood",
            )
        try:
            return float(words)
        except ValueError:
            pass
        written = re.sub(r"(?<![\w.])[A-Za-z_]\w*", lambda match: self._name(match[0], where), words)
        try:
            expression = parse(written)
        except ThermidError as error:
            raise DeckError(
                f"'{shown}' is neither a number nor arithmetic of numbers and names: {error.message}",
                str(where),
                code=error.code,
            ) from None
        return written if expression.names else float(expression.evaluate(lambda name: 0.0))

    def _name(self, word: str, where: TextSpan) -> str:
        """Return what a name of the file is called in the model."""
        name = self.names.get(word.upper()) or FUNCTIONS.get(word.upper())
        if name is None:
            raise DeckError(f"'{word}' is not defined before it is used.", str(where), code="import.not-understood")
        return name

    def name(self, word: str) -> str:
        """Return the name of a parameter for a name of the file, and remember it."""
        name, n = identifier(word), 2
        while name in self.parameters or name in RESERVED:
            name, n = f"{identifier(word)}_{n}", n + 1
        self.names[word.upper()] = name
        return name


FUNCTIONS: Final[Mapping[str, str]] = {
    "SQRT": "sqrt", "DSQRT": "sqrt", "EXP": "exp", "DEXP": "exp", "ABS": "abs", "DABS": "abs", "MIN": "min", "MAX": "max", "AMIN1": "min",
    "AMAX1": "max", "PI": "pi",
}  # fmt: skip
"""Function of Fortran -> of an expression here."""
RESERVED: Final = frozenset({"pi", "sqrt", "exp", "abs", "min", "max"})
_MARK: Final = re.compile(r"^(?:C|#)\s*INCOMPLETE: (.+)$", re.MULTILINE)


def nesting(text: str) -> float:
    """Return by how much a statement of Fortran or Mortran deepens what follows; after a GO TO all is conditional."""
    words = " ".join(text.upper().split())
    if re.search(r"\bGO ?TO\b", words):
        return math.inf
    opens = re.match(r"(?:IF\b.*\bTHEN|DO\b.*|FOR\b.*\bDO|WHILE\b.*)$", words)
    closes = re.match(r"(?:END ?(?:IF|DO|FOR|WHILE)|\d+ CONTINUE)$", words)
    return float(opens is not None) - float(closes is not None)


def acts(line: Line, called: Iterable[str], harmless: re.Pattern[str], assigned: re.Pattern[str], names: Iterable[str]) -> bool:
    """Return whether a statement can change a network or its run; variables of its own, prints and the frames of statements cannot.

    Parameters
    ----------
    line, called        The statement, and the routines that it calls.
    harmless, assigned  Routines without effect; assignments to what a deck defines by kind and number.
    names               Names of the deck, in capitals, and its control constants.
    """
    target = re.search(r"(?:^|\)|\s)(\w+)\s*=(?!=)", line.text)
    by_name = target is not None and target[1].upper() in names
    return by_name or assigned.search(line.text) is not None or any(not harmless.fullmatch(name) for name in called)


def with_defined_ends(reading: DeckReading, nodes: Iterable[FileNode], elements: Iterable[Element], unread: bool) -> Iterator[Element]:
    """Yield conductors and loads; where a statement of nodes was not taken over, those of undefined nodes are named instead."""
    defined = {(node.submodel, node.name) for node in nodes}
    for element in elements:
        ends = element.ends if isinstance(element, FileConductor) else (element.into,)
        absent = [end for end in ends if end not in defined]
        if absent and unread:
            reading.remark(element.where, f"{element.name} is at node {'.'.join(absent[0])}, whose statement was not taken over")
        else:
            yield element


def with_unit(value: float | str, unit: str, factor: float = 1.0) -> str:
    """Return a value of a deck in SI: a number with its unit, or an expression times the unit."""
    if isinstance(value, float | int):
        return f"{value * factor!r} [{unit}]"
    return f"({value}) * {factor!r} [{unit}]" if factor != 1.0 else f"({value}) * 1 [{unit}]"


def numbered(text: str, path: str) -> Iterator[Line]:
    """Yield the lines of a text with their places, without line ends."""
    begin = 0
    for n, row in enumerate(text.split("\n"), 1):
        yield Line(row.removesuffix("\r"), TextSpan(path, n, begin, begin + len(row)))
        begin += len(row) + 1


def fields(line: Line) -> list[tuple[str, TextSpan]]:
    """Return what stands between the commas of a line, with its place; commas inside parentheses do not part."""
    parts, depth, start = [], 0, 0
    for k, mark in enumerate([*line.text, ","]):
        depth += (mark == "(") - (mark == ")")
        if mark == "," and depth <= 0:
            word = line.text[start:k]
            lead = len(word) - len(word.lstrip())
            parts.append((word.strip(), line.part(start + lead, start + lead + len(word.strip()))))
            start = k + 1
    return parts[:-1] if parts and not parts[-1][0] else parts


def stream(value: float | str, ratio: float = 1.0) -> dict[str, object]:
    """Return the table of a one-way conductor of so many W/K times a ratio, from its first end to its second.

    Files give the product of mass flow and specific heat; with 1 J/(kg K) the mass flow has its number.
    """
    return {"kind": "flow", "mass_flow": with_unit(value, "kg/s", ratio), "specific_heat": "1 [J/(kg K)]"}
