"""What a deck of another tool says before it is a model: nodes, conductors, loads and parameters with their lines; what was left out.

What readers of decks share: files that include each other, numbers with their places, expressions of names, and what was left out.
"""

from __future__ import annotations

import math
import os
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final, TypeVar

import numpy as np

from thermid.base.errors import DeckError, ThermidError, cap, raising
from thermid.base.files import read_bytes
from thermid.base.units import ICE_POINT, Expression, counted
from thermid.interop._decks.emissivities import FileEmissivity
from thermid.model.tree import Model, ParameterSet, model_from_dict
from thermid.simulation.runs import Scenario

GROUP: Final[Mapping[str, float]] = {"value": 1.0, "min": 0.05, "max": 20.0}
"""A factor of all conductors that one statement of the deck's author made: what an analyst correlates."""
TWOFOLD: Final = 2.0
"""How far an emissivity may move from its value in the file: conductors follow it to first order."""
CYCLE_END_SHARE: Final = 1e-9
"""Share of a period over which the end of a cycle steps to its beginning."""
REST: Final = CYCLE_END_SHARE
"""How long a course is zero that a steady state before its run must not see. [s]"""

MOST_KINDS: Final = 4
"""Kinds of missing statements that are listed by name."""


@dataclass(frozen=True)
class TextSpan:
    """Where a number stands in a file.

    Parameters
    ----------
    file : str           The file's path as it was opened.
    line : int           Line, from 1.
    begin, end : int     Characters of the file's text.
    """

    file: str
    line: int
    begin: int
    end: int

    def __str__(self) -> str:
        """Return file and line."""
        return f"{os.path.basename(self.file)}:{self.line}"


@dataclass(frozen=True)
class DeckRemark:
    """A statement of a deck that was not taken over as it is; a mark says what another import, whose export the deck is, had dropped."""

    where: TextSpan
    what: str
    dropped: bool = True
    mark: bool = False

    def __str__(self) -> str:
        """Return place and words."""
        return f"{self.where}: {self.what}"


@dataclass(frozen=True)
class FileNode:
    """A node: submodel and number, capacitance [J/K] as text or number (None: massless), temperature [degC]; a boundary when `held`."""

    submodel: str
    name: str
    capacitance: float | str | Mapping[str, Any] | None
    celsius: float
    held: bool
    where: TextSpan
    title: str = ""

    @property
    def path(self) -> str:
        """Path of the node in the model; a boundary stands at the top."""
        return f"{self.submodel}_{self.name}" if self.held else f"{self.submodel}.{self.name}"


@dataclass(frozen=True)
class FileConductor:
    """A conductor: its table of a deck without ends, the ends as (submodel, name), its group ("" without one), its emissivities."""

    name: str
    ends: tuple[tuple[str, str], tuple[str, str]]
    table: Mapping[str, Any]
    where: TextSpan
    group: str = ""
    follows: tuple[FileEmissivity, ...] = ()

    def factor(self) -> str:
        """Return what multiplies the conductor's value: the factor of its group and its change since emissivities were as computed."""
        kept = math.prod(1.0 + emissivity.term for emissivity in self.follows if emissivity.lost < 0.0)
        kept /= 1.0 + sum(emissivity.term for emissivity in self.follows if emissivity.lost > 0.0)
        up = ([self.group] if self.group else []) + ([repr(1.0 / kept)] if kept != 1.0 else [])
        up += [f"(1 + {emissivity.text})" for emissivity in self.follows if emissivity.lost < 0.0]
        down = [emissivity.text for emissivity in self.follows if emissivity.lost > 0.0]
        return "*".join(up or ["1"] if down else up) + (f"/(1 + {' + '.join(down)})" if down else "")


@dataclass(frozen=True)
class FileLoad:
    """A load: node, power [W] as number or text, the group that its author named.

    Parameters
    ----------
    course : FileCourse     What it follows in time; with `scales` it multiplies the power, else its numbers times `factor` are watts.
    more : dict             Further fields of a model's load: a thermostat, a table of power over temperature.
    stands : bool           Whether the power is a number of the text that can be written back.
    """

    name: str
    into: tuple[str, str]
    power: float | str
    where: TextSpan
    group: str = ""
    course: FileCourse | None = None
    more: Mapping[str, Any] = field(default_factory=dict)
    scales: bool = False
    factor: float = 1.0
    stands: bool = True


def _defined(at: Mapping[tuple[str, str], str], end: tuple[str, str], what: str, element: FileConductor | FileLoad) -> str:
    """Return the path of a node that a line of a deck names.

    Raises
    ------
    DeckError   When the deck does not define it.
    """
    if end not in at:
        raise DeckError(
            f"{what} {element.name} names node {'.'.join(end).strip('.')}, which the deck does not define.",
            str(element.where),
            code="import.not-understood",
        )
    return at[end]


@dataclass(frozen=True, eq=False)
class NetworkFile:
    """A thermal network as a deck of SINDA or ESATAN has it.

    Parameters
    ----------
    title : str                    Name of the case.
    tool : str                     What wrote the deck.
    nodes, conductors, loads       In the order of the files.
    parameters : dict              Name -> number or text of a deck, with the place where it stands.
    duration : float               Length of the transient [s]; 0 without one.
    remarks : tuple of DeckRemark      What was dropped or assumed, line by line.
    texts : dict                   File -> its text, as read.
    again : callable               Returns the network of the deck as it would be with other texts of its files.
    zero_and_degree : tuple        Absolute zero in the deck's unit of temperature, and a degree of it [K].
    courses : dict                 Boundary -> temperature over time, where it is no constant. [degC]
    start : str                    Where the transient begins, as a scenario says it; empty for the temperatures of the nodes.
    seconds : float                The deck's unit of time. [s]
    begin : float                  The deck's time at which its transient begins. [s]
    emissivities : dict            Parameter -> an optical property's emissivity as it was computed with [-], and how many nodes have it.
    listed : dict                  Where an emissivity stands in a list of optical properties -> its parameter, and the number there.
    """

    title: str
    tool: str
    nodes: tuple[FileNode, ...]
    conductors: tuple[FileConductor, ...]
    loads: tuple[FileLoad, ...]
    parameters: Mapping[str, tuple[Any, TextSpan]]
    duration: float
    remarks: tuple[DeckRemark, ...]
    texts: Mapping[str, str]
    again: Callable[[Mapping[str, str]], NetworkFile]
    courses: Mapping[str, FileCourse] = field(default_factory=dict)
    zero_and_degree: tuple[float, float] = (-ICE_POINT, 1.0)
    start: str = ""
    seconds: float = 1.0
    begin: float = 0.0
    emissivities: Mapping[str, tuple[float, int]] = field(default_factory=dict)
    listed: Mapping[TextSpan, tuple[str, float]] = field(default_factory=dict)

    def __str__(self) -> str:
        """Return what was read in one line, then what was not."""
        held = sum(node.held for node in self.nodes)
        head = (
            f"{self.title} ({self.tool}): {counted(len(self.nodes) - held, 'node')}, {counted(held, 'boundary node')}, "
            f"{counted(len(self.conductors), 'conductor')} in {counted(len(self.groups()), 'group')}, {counted(len(self.loads), 'load')}"
        )
        if self.incomplete:
            head = f"INCOMPLETE: {self.incomplete}\n{head}"
        return "\n".join([head, *(f"  {remark}" for remark in self.remarks)])

    @property
    def incomplete(self) -> str:
        """What was not taken over, counted by kind, after the marks of other imports; empty where nothing is missing."""
        dropped = [remark for remark in self.remarks if remark.dropped]
        kinds = Counter(re.split(r":| \(", remark.what, maxsplit=1)[0] for remark in dropped if not remark.mark)
        listed = ", ".join(f"{n} x {what}" if n > 1 else what for what, n in kinds.most_common(MOST_KINDS))
        more = f" and {len(kinds) - MOST_KINDS} more kinds" if len(kinds) > MOST_KINDS else ""
        here = [f"{counted(kinds.total(), 'statement')} of {self.tool} not taken over ({listed}{more})"] if kinds else []
        return "; ".join([*(remark.what for remark in dropped if remark.mark), *here])

    def celsius(self, printed: Mapping[str, float]) -> dict[str, float]:
        """Return printed temperatures in degC; a deck in kelvin or Fahrenheit prints in its own unit."""
        return {node: self.zero_and_degree[1] * (number - self.zero_and_degree[0]) - ICE_POINT for node, number in printed.items()}

    def groups(self) -> dict[str, int]:
        """Return the groups of conductors and how many each has: one factor each in the model."""
        sizes: dict[str, int] = {}
        for conductor in self.conductors:
            if conductor.group:
                sizes[conductor.group] = sizes.get(conductor.group, 0) + 1
        return sizes

    def model(self) -> Model:
        """Return the network as a model: a submodel for each of the deck's, a parameter for each group of conductors.

        Raises
        ------
        DeckError   Where the network is no valid model.
        """
        at = {(node.submodel, node.name): node.path for node in self.nodes}
        inner: dict[str, dict[str, Any]] = {}
        settings: dict[str, Any] = {}
        for node in self.nodes:
            if not node.held:
                inner.setdefault(node.submodel, {})[node.name] = node_table = _node(node)
                key, unit = ("mass", "kg") if isinstance(node.capacitance, Mapping) else ("capacitance", "J/K")
                text = node.capacitance[key] if isinstance(node.capacitance, Mapping) else node.capacitance
                if isinstance(text, str) and Expression.parse(text).names:  # names are known at the top only
                    settings[f"{node.path}.{key}"], node_table[key] = node_table[key], f"1 [{unit}]"
        submodels = {
            name: {"use": model_from_dict({"title": name, "offers": list(nodes), "nodes": nodes})} for name, nodes in inner.items()
        }
        groups = {name: {**GROUP, "note": f"factor of {counted(n, 'conductor')}"} for name, n in self.groups().items()}
        now = dict(self.listed.values())
        coatings = {
            name: {"value": now[name], "min": e / TWOFOLD, "max": min(e * TWOFOLD, 1.0), "note": f"of {counted(n, 'node')}"}
            for name, (e, n) in self.emissivities.items()
        } | {FileEmissivity(name, e, 0.0, e).fall: f"{e!r}/{name} - 1" for name, (e, _) in self.emissivities.items()}
        stated = {name: {"value": value, "source": "derived", "basis": str(span)} for name, (value, span) in self.parameters.items()}
        deck = {
            "title": self.title,
            "incomplete": self.incomplete,
            "needs": [node.path for node in self.nodes if node.held],
            "parameters": stated | groups | coatings,
            "submodels": submodels,
            "set": settings,
            "conductors": {element.name: self._conductor(element, at) for element in self.conductors},
            "controls": {
                f"{element.name}_e": {"follows": [_defined(at, end, "conductor", element) for end in element.ends], "table": by}
                for element in self.conductors
                if (by := element.table.get("control"))
            },
            "loads": {
                element.name: {"into": _defined(at, element.into, "load", element), **_power(element), **element.more}
                for element in self.loads
            },
        }
        return model_from_dict(deck)

    def _conductor(self, conductor: FileConductor, at: Mapping[tuple[str, str], str]) -> dict[str, Any]:
        """Return the table of a conductor, times its factor."""
        table = {"between": [_defined(at, end, "conductor", conductor) for end in conductor.ends], **conductor.table}
        if "control" in table:
            table["control"] = f"{conductor.name}_e"
        key = SCALED[table["kind"]]
        value = table.get(key, "1")
        factor = conductor.factor()
        table[key] = {"value": f"{factor}*{value}" if factor else value, "source": "derived", "basis": str(conductor.where)}
        return table

    def case(self) -> dict[str, Any]:
        """Return the tables of a scenario file: boundaries and starts of the deck, courses of loads, its length."""
        followed = [(load, load.course.beginning(self.begin)) for load in self.loads if load.course is not None]
        held = [node for node in self.nodes if node.held]
        tables = {
            "boundaries": {
                node.path: self.courses[node.path].beginning(self.begin).table("degC")
                if node.path in self.courses
                else f"{node.celsius!r} [degC]"
                for node in held
            },
            "loads": {load.name: course.table("W", load.factor) for load, course in followed if not load.scales},
            "commands": {load.name: course.table("") for load, course in followed if load.scales},
            "initial": {node.path: f"{node.celsius!r} [degC]" for node in self.nodes if not node.held and node.capacitance is not None},
        }
        start = self.start
        if self.start:
            tables["initial"] = {}
        elif len(held) != 1:  # a run needs a start though every node has its own
            start = next((f"{node.celsius!r} [degC]" for node in self.nodes if not node.held and node.capacitance is not None), "")
        head = {"title": self.title, "duration": f"{self.duration!r} [s]"} | ({"start": start} if start else {})
        return head | {name: table for name, table in tables.items() if table}

    def scenario(self) -> Scenario:
        """Return the case as a scenario."""
        return Scenario(**self.case())

    def written_back(self, model: Model) -> dict[str, str]:
        """Return the texts of the deck with the values of a model: equal but for the numbers that changed.

        `not_written_back` names the changed values that have no number of their own in the files.

        Parameters
        ----------
        model : Model   Made by `model` of this file, with other values of its parameters.

        Returns
        -------
        dict            File -> text; files in which nothing changed are left out.

        Raises
        ------
        DeckError       When the model lacks a parameter of this file; when a number of the written deck, read again, is not that of the
                        model.
        """
        edits: dict[str, list[tuple[TextSpan, str]]] = {}
        written, _, wanted = self._edits(model)
        for span, text in written.items():
            edits.setdefault(span.file, []).append((span, text))
        texts = {file: _edited(self.texts[file], changes, self.tool) for file, changes in edits.items()}
        try:
            reread = ParameterSet(self.again({**self.texts, **texts}).model()).evaluate({})
            wrong = next((p for p, value in wanted.items() if not _is_same_number(value, reread.get(p, math.nan))), "")
            why = f"would read '{wrong}' as {reread.get(wrong, math.nan):g} instead of {wanted[wrong]:g}" if wrong else ""
        except ThermidError as error:
            why = f"could not be read again: {error}"
        if why:
            raise DeckError(f"the written deck {why}. Write the number on a line of its own.", self.title, code="output.edit-refused")
        return texts

    def not_written_back(self, model: Model) -> tuple[str, ...]:
        """Return the paths of values of a model that differ from the deck's and that `written_back` cannot write; raises as that does."""
        return self._edits(model)[1]

    def _edits(self, model: Model) -> tuple[dict[TextSpan, str], tuple[str, ...], dict[str, float]]:
        """Return the numbers that changed where they stand, changed paths without a number of their own, and what a changed deck states."""
        now = ParameterSet(model).evaluate({})
        numbers = {name: float(value) for name, (value, _) in self.parameters.items() if isinstance(value, int | float)}
        groups = self.groups()
        factors = (*groups, *self.emissivities)
        lacking = sorted({*numbers, *factors} - now.keys())
        if lacking:
            raise DeckError(
                f"the deck has no '{lacking[0]}', so it is no import of this file. Import it again.", self.title, code="file.another-kind"
            )
        named = {name: float(now[name]) for name in (*numbers, *factors)}
        read = ParameterSet(self.model())
        before = read.evaluate(named)  # what the files state with the changed parameters and factors
        rows = read.evaluate({name: named[name] for name in numbers})  # what their rows state
        changed = {p for p in before.keys() | now.keys() if not _is_same_number(now.get(p, math.nan), before.get(p, math.nan))}
        out = {self.parameters[n][1]: f"{named[n]:.12g}" for n, value in numbers.items() if not _is_same_number(named[n], value)}
        out |= {span: f"{named[name]:.12g}" for span, (name, value) in self.listed.items() if not _is_same_number(named[name], value)}
        places: dict[TextSpan, dict[str, float]] = {}  # a row that makes several conductors has one number for all of them
        for path, span in self._places():
            places.setdefault(span, {})[path] = now.get(path, math.nan) / rows[path] if rows[path] else 1.0
        for span, ratios in places.items():
            ratio = next(iter(ratios.values()))
            text = self.texts[span.file][span.begin : span.end]
            # a factor can stand beside a number or an expression, not beside an array or a list
            scales = re.fullmatch(r"[\w.+\-*/() ]+", text) and not re.fullmatch(r"\s*S?A\d+\s*", text, re.IGNORECASE)
            if scales and all(_is_same_number(ratio, change_ratio) for change_ratio in ratios.values()):
                changed -= {p for p in ratios if rows[p]}
                if not _is_same_number(ratio, 1.0):
                    out[span] = _times(text, ratio)
            else:
                changed |= {p for p, change_ratio in ratios.items() if not _is_same_number(change_ratio, 1.0)}
        return out, tuple(sorted(changed)), {p: float(rows[p] if p in changed else now[p]) for p in rows if p not in groups}

    def _places(self) -> Iterator[tuple[str, TextSpan]]:
        """Yield the values that stand in the files as a number or expression: path, place."""
        for conductor in self.conductors:
            yield f"{conductor.name}.{SCALED[conductor.table['kind']]}", conductor.where
        for node in self.nodes:
            if isinstance(node.capacitance, float | str):
                yield f"{node.path}.capacitance", node.where
        for load in self.loads:
            if load.course is None and not load.more and load.stands:
                yield f"{load.name}.power", load.where


def _is_same_number(a: float, b: float) -> bool:
    """Return whether two values are one number written twice."""
    return math.isclose(a, b, rel_tol=1e-9)


SCALED: Final = {"conduction": "conductance", "radiation": "area", "table": "scale", "flow": "mass_flow"}
"""Kind of a conductor -> field that a group's factor multiplies."""


def _node(node: FileNode) -> dict[str, Any]:
    """Return the table of a node."""
    if node.capacitance is None:
        return {}
    if isinstance(node.capacitance, Mapping):
        return dict(node.capacitance)
    text = node.capacitance if isinstance(node.capacitance, str) else f"{node.capacitance!r} [J/K]"
    return {"capacitance": {"value": text, "source": "derived", "basis": str(node.where), "note": node.title}}


def _power(load: FileLoad) -> dict[str, Any]:
    """Return the power of a load, with the remark that its course is elsewhere; nothing where a table has it."""
    watts = load.power if isinstance(load.power, str) else f"{load.power!r} [W]"
    if load.course is None:
        return {} if "table" in load.more else {"power": watts}
    what = "scale of its course" if load.scales else "mean of its course"
    return {"power": {"value": watts, "source": "derived", "basis": str(load.where), "note": f"{what}, which the scenario has"}}


def _times(number: str, factor: float) -> str:
    """Return a number of a file times a factor; an expression in brackets times it."""
    try:
        return f"{float(fortran(number)) * factor:.12g}"
    except ValueError:
        return f"({number.strip()}) * {factor:.12g}"


def _edited(text: str, changes: list[tuple[TextSpan, str]], tool: str) -> str:
    """Return a text with numbers replaced, each line in which one ends with a comment of the tool's language."""
    mark, pieces, at, before = "$" if tool == "SINDA" else "#", list[str](), 0, list[str]()
    for span, new in sorted(changes, key=lambda change: change[0].begin):
        between, before = _noted(text[at : span.begin], before, mark)
        pieces += between, new
        before.append(" ".join(text[span.begin : span.end].split()))
        at = span.end
    return "".join([*pieces, _noted(text[at:] + "\n", before, mark)[0][:-1]])


def _noted(text: str, before: list[str], mark: str) -> tuple[str, list[str]]:
    """Return a text, its first line with a comment of what was before where there was something, and what is left to comment."""
    row, end, rest = text.partition("\n")
    if not end or not before:
        return text, before
    tail = "\r" if row.endswith("\r") else ""
    return f"{row.removesuffix(tail)} {mark} fitted, was {', '.join(before)}{tail}\n{rest}", []


_EXPONENT = re.compile(r"(?<=[\d.])[dD](?=[-+]?\d)")


def fortran(text: str) -> str:
    """Return a number or expression of Fortran with exponents as Python has them."""
    return _EXPONENT.sub("e", text.strip())


def identifier(text: str) -> str:
    """Return a name for a model from words of a deck: letters, digits and underscores, not beginning with a digit."""
    name = re.sub(r"\W+", "_", text, flags=re.ASCII).strip("_").lower()
    return f"n_{name}" if not name or name[0].isdigit() else name


@dataclass(frozen=True, eq=False)
class FileCourse:
    """A quantity over time: straight lines between points [s], repeated after a period [s] or held beyond its ends (period 0).

    One that `rests` is zero in a steady state from which the run starts: the deck has it in its transient alone.
    """

    seconds: np.ndarray
    numbers: np.ndarray
    period: float
    where: str
    rests: bool = False

    def __post_init__(self) -> None:
        """Refuse points that are no course."""
        t = self.seconds
        if t.size != self.numbers.size or t.size == 0:
            raise DeckError(
                f"{counted(t.size, 'time')} and {counted(self.numbers.size, 'value')} do not form a table.",
                self.where,
                code="import.not-understood",
            )
        if self.period and t[-1] - t[0] > self.period * (1.0 + 1e-9):
            raise DeckError(
                f"times over {t[-1] - t[0]:g} s exceed the period of {self.period:g} s.", self.where, code="import.not-understood"
            )

    @property
    def mean(self) -> float:
        """Mean over time, from the first point to the last."""
        span = self.seconds[-1] - self.seconds[0]
        return float(np.trapezoid(self.numbers, self.seconds) / span) if span else float(self.numbers[0])

    def beginning(self, seconds: float) -> FileCourse:
        """Return the course with another time as its zero [s]; one that rests steps up from 0 there, if it does not repeat."""
        t, v = self.seconds - seconds, self.numbers
        if self.rests and not self.period:
            later = t > REST
            t, v = np.append((0.0, REST), t[later]), np.append((0.0, np.interp(REST, t, v)), v[later])
        return replace(self, seconds=t, numbers=v)

    def table(self, unit: str, factor: float = 1.0, offset: float = 0.0) -> dict[str, Any]:
        """Return the table of a scenario: ``times`` [s] and ``values``, `numbers` times `factor` plus `offset`, as text in `unit`.

        A step becomes a line over `CYCLE_END_SHARE` of the course's length. Beyond its ends the course holds its values, or repeats.
        """
        t, v = self.seconds, self.numbers * factor + offset
        if t.size > 1:  # two values at one time are a step
            t = np.where(np.append(np.diff(t) == 0.0, False), t - CYCLE_END_SHARE * (t[-1] - t[0]), t)
        if self.period and t.size > 1:
            if (
                t[0] + self.period - t[-1] > CYCLE_END_SHARE * self.period
            ):  # a straight line from the last point to the first of the next period
                t, v = np.append(t, t[0] + self.period), np.append(v, v[0])
            elif v[-1] != v[0]:  # the end of the cycle steps to its beginning
                t, v = np.append(t[:-1], (t[0] + (1.0 - CYCLE_END_SHARE) * self.period, t[0] + self.period)), np.append(v, v[0])
        values = [f"{number!r} [{unit}]" if unit else number for number in v.tolist()]
        table: dict[str, Any] = {"times": [f"{number!r} [s]" for number in t.tolist()], "values": values}
        return table | ({"after": "repeat"} if self.period and t.size > 1 else {"after": "hold", "before": "hold"})


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
        return value if isinstance(value, float) else float(Expression.parse(value).evaluate(lambda name: self.numbers[name]))

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
            expression = Expression.parse(written)
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
    "SQRT": "sqrt", "DSQRT": "sqrt", "EXP": "exp", "DEXP": "exp", "ALOG": "log", "DLOG": "log", "ABS": "abs", "DABS": "abs", "MIN": "min",
    "MAX": "max", "AMIN1": "min", "AMAX1": "max", "PI": "pi",
}  # fmt: skip
"""Function of Fortran -> of an expression here."""
RESERVED: Final = frozenset({"pi", "sqrt", "exp", "log", "abs", "min", "max"})
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
