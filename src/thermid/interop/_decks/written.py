"""A model in a scenario as a deck of SINDA or ESATAN; what the language has no row for is refused in words."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Iterator, Mapping
from typing import Final

from thermid.base.errors import DeckError
from thermid.base.units import ICE_POINT, STEFAN_BOLTZMANN, value_of
from thermid.interop._wired import HeatSource, Wired, Writer, exported, number_text, one_line, resting, table_points, wired
from thermid.model.tree import Drawn, Model, TableSignal
from thermid.simulation.runs import ConductorRow, Scenario

MAX_SUBMODEL_LETTERS: Final = 24
"""Letters of a submodel's name; SINDA/FLUINT takes 32."""


def to_sinda(model: Model, scenario: Scenario, path: str | os.PathLike[str] | None = None) -> str:
    """Return a model in a scenario as a deck of SINDA/FLUINT in SI units and degC.

    Linear and radiation conductors are rows, tables over temperature SIV with an array, those of specific heats too, powers SOURCE DATA,
    courses over time D1DEG1.

    Parameters
    ----------
    model, scenario     As in `simulate`; the scenario needs a duration.
    path : path         Where to write it too.

    Raises
    ------
    DeckError       When a law, a load or a boundary cannot be written.
    ScenarioError   When the scenario does not fit the model or follows a schedule.
    """
    w = wired(model, scenario, Writer("SINDA", forms=("linear", "radiation", "table"), stores=True, numbers=True, load_tables=False))
    return exported(w, _Sinda(w).lines(), path, "C ")


def to_esatan(model: Model, scenario: Scenario, path: str | os.PathLike[str] | None = None) -> str:
    """Return a model in a scenario as a deck of ESATAN-TMS.

    Conductors are GL and GR, powers QI, courses INTRP1 in $VARIABLES1. Tables over temperature are refused.

    Parameters
    ----------
    model, scenario     As in `simulate`; the scenario needs a duration.
    path : path         Where to write it too.

    Raises
    ------
    DeckError       When a law, a load or a boundary cannot be written.
    ScenarioError   When the scenario does not fit the model or follows a schedule.
    """
    w = wired(model, scenario, Writer("ESATAN", forms=("linear", "radiation"), numbers=True, load_tables=False))
    return exported(w, _Esatan(w).lines(), path, "#")


class _Deck:
    """What both languages share: numbers of nodes, points of courses."""

    tool = ""

    def __init__(self, w: Wired) -> None:
        self.w = w
        self.numbers: dict[str, tuple[str, int]] = {}
        taken: set[tuple[str, int]] = set()
        for node in (*w.network.nodes, *w.network.boundaries):
            # what an import named keeps its submodel and number; everything else is counted
            match = re.fullmatch(r"(?:(\w+)[._])?T(\d+)", node)
            owner = (match[1] if match and match[1] else self.main).upper()[:MAX_SUBMODEL_LETTERS]
            number = int(match[2]) if match else 0
            while number == 0 or (owner, number) in taken:
                number = 1 + max((n for o, n in taken if o == owner), default=0)
            taken.add((owner, number))
            self.numbers[node] = (owner, number)

    main = "MAIN"

    def notes(self) -> Iterator[str]:
        """Yield what a reader of the deck has to know of its run."""
        drawn = (*self.w.scenario.loads.values(), *self.w.scenario.commands.values())
        if any(isinstance(signal, TableSignal) and signal.after == "repeat" for signal in drawn):
            yield f"courses that repeat are written out to TIMEND = {number_text(self.w.scenario.seconds)}; a longer run needs a new export"

    def radiation(self, row: ConductorRow) -> float:
        """Return the exchange area of a radiation row. [m^2]"""
        return value_of(row.coefficients[0]) / STEFAN_BOLTZMANN

    def constant(self, boundary: str) -> float:
        """Return the temperature of a boundary. [degC]"""
        value = resting(self.w.boundaries[boundary])
        if value is None:
            raise DeckError(
                f"the boundary '{boundary}' changes in time, which is not written to {self.tool}.",
                self.w.network.title,
                code="output.not-expressible",
            )
        return round(value - ICE_POINT, 12)

    def course(self, source: HeatSource) -> TableSignal | None:
        """Return the table of a source; None where its power is constant."""
        signal: Drawn = source.signal
        if resting(signal) is not None:
            return None
        if not isinstance(signal, TableSignal) or signal.hold:
            raise DeckError(
                f"the load '{source.load}' follows steps or a sine; only straight lines between points are written to {self.tool}.",
                self.w.network.title,
                code="output.not-expressible",
            )
        return signal

    def watts(self, source: HeatSource) -> float:
        """Return the power of a source that does not change. [W]"""
        return float(source.power) * (resting(source.signal) or 0.0)


def _array(arrays: list[list[float]], x: Iterable[float], y: Iterable[float]) -> str:
    """Put an array of pairs down; return its name."""
    arrays.append(_pairs(x, y))
    return f"A{len(arrays)}"


def _pairs(x: Iterable[float], y: Iterable[float]) -> list[float]:
    """Return the numbers of pairs one after the other."""
    return [float(number) for pair in zip(x, y, strict=True) for number in pair]


def _celsius(kelvin: Iterable[float]) -> list[float]:
    """Return temperatures in degC, without the digits that the difference makes."""
    return [round(float(t) - ICE_POINT, 12) for t in kelvin]


class _Sinda(_Deck):
    """A deck of SINDA/FLUINT."""

    tool = "SINDA"

    def lines(self) -> Iterator[str]:
        """Yield the lines of the deck."""
        w, arrays = self.w, list[list[float]]()
        courses = [(source, self.course(source)) for source in w.sources]
        yield "HEADER OPTIONS"
        yield f"C    {one_line(w.network.title)}, {one_line(w.scenario.title)}: W, J, s, degC, m"
        yield from (f"C    {note}" for note in self.notes())
        yield f"TITLE {one_line(w.network.title)}"
        yield "HEADER CONTROL DATA, GLOBAL"
        control = {"ABSZRO": -ICE_POINT, "SIGMA": STEFAN_BOLTZMANN, "TIMEND": w.scenario.seconds}
        yield from (*(f"      {name} = {number_text(value)}" for name, value in control.items()), "      UID = SI")
        for owner in dict.fromkeys(owner for owner, _ in self.numbers.values()):
            yield f"HEADER NODE DATA, {owner}"
            yield from (self._node(node, number, arrays) for node, (o, number) in self.numbers.items() if o == owner)
        conductors = [self._conductor(k, label, row, arrays) for k, (label, row) in enumerate(w.conductors, 1)]
        yield f"HEADER CONDUCTOR DATA, {self.main}"
        yield from conductors
        rows = [(source, *self.numbers[source.node]) for source, table in courses if table is None]
        for owner in dict.fromkeys(owner for _, owner, _ in rows):
            yield f"HEADER SOURCE DATA, {owner}"
            yield from (f"      {n}, {number_text(self.watts(s))} $ {one_line(s.load)}" for s, o, n in rows if o == owner)
        logic = [line for source, table in courses if table is not None for line in self._followed(source, table, arrays)]
        if arrays:
            yield f"HEADER ARRAY DATA, {self.main}"
            for k, values in enumerate(arrays, 1):
                yield f"      {k} = {number_text(values[0])}" + ("," if len(values) > 1 else "")
                yield from (f"          {', '.join(map(number_text, values[i : i + 6]))}" for i in range(1, len(values), 6))
        if logic:
            yield f"HEADER VARIABLES 0, {self.main}"
            yield from logic

    def _node(self, node: str, number: int, arrays: list[list[float]]) -> str:
        """Return the line of a node: its start [degC or K], its heat capacity [J/K], or that it is a boundary or has no mass."""
        capacitance = self.w.capacitances.get(node)
        if node in self.w.boundaries:
            return f"      -{number}, {number_text(self.constant(node))}, 0. $ {one_line(node)}"
        start = number_text(round(self.w.initial.get(node, ICE_POINT + 20.0) - ICE_POINT, 12))
        if (store := self.w.network.stores.get(node)) is not None and capacitance is not None:
            mass = number_text(float(capacitance) / store.reference)
            array = _array(arrays, _celsius(store.given.x), store.given.y)
            return f"      SIV {number}, {start}, {self.main}.{array}, {mass} $ {one_line(node)}"
        return f"      {number}, {start}, {number_text(float(capacitance)) if capacitance is not None else '-1.'} $ {one_line(node)}"

    def _conductor(self, k: int, label: str, row: ConductorRow, arrays: list[list[float]]) -> str:
        """Return the line of a conductor."""
        ends = ", ".join(f"{owner}.{number}" for owner, number in (self.numbers[end] for end in row.ends))
        tail = f"$ {one_line(label)}"
        if row.form == "linear":
            return f"      {k}, {ends}, {number_text(value_of(row.coefficients[0]))} {tail}"
        if row.form == "radiation":
            return f"      -{k}, {ends}, {number_text(self.radiation(row))} {tail}"
        x, y, _ = table_points(row.curve)  # type: ignore[arg-type]  # a table has one
        return f"      SIV {k}, {ends}, {_array(arrays, _celsius(x), y)}, {number_text(value_of(row.coefficients[0]))} {tail}"

    def _followed(self, source: HeatSource, table: TableSignal, arrays: list[list[float]]) -> Iterator[str]:
        """Yield the statements of a course, and put its array down."""
        owner, number = self.numbers[source.node]
        yield f"      CALL D1DEG1(TIMEM, {_array(arrays, table.times, table.values)}, Q__TD)"
        yield f"      {owner}.Q{number} = {owner}.Q{number} + Q__TD*{number_text(float(source.power))}"


class _Esatan(_Deck):
    """A deck of ESATAN-TMS."""

    tool = "ESATAN"

    def __init__(self, w: Wired) -> None:
        self.main = re.sub(r"\W", "_", w.network.title).upper()[:MAX_SUBMODEL_LETTERS] or "MODEL"
        super().__init__(w)
        # one model: numbers must differ over all of it
        numbers: set[int] = set()
        for node, (_, number) in self.numbers.items():
            while number in numbers:
                number = 1 + max(numbers)
            numbers.add(number)
            self.numbers[node] = (self.main, number)

    def lines(self) -> Iterator[str]:
        """Yield the lines of the deck."""
        w = self.w
        courses = [(source, self.course(source)) for source in w.sources]
        powers: dict[str, float] = {}
        for source, table in courses:
            if table is None:
                powers[source.node] = powers.get(source.node, 0.0) + self.watts(source)
        yield f"$MODEL {self.main}"
        yield f"# {one_line(w.network.title)}, {one_line(w.scenario.title)}"
        yield from (f"# {note}" for note in self.notes())
        yield from ("$CONSTANTS", "$REAL", f"STEFAN = {number_text(STEFAN_BOLTZMANN)};", "$NODES")
        yield from (self._node(node, number, powers) for node, (_, number) in self.numbers.items())
        yield "$CONDUCTORS"
        yield from (self._conductor(label, row) for label, row in w.conductors)
        followed = [(source, table) for source, table in courses if table is not None]
        if followed:
            yield from ("$ARRAYS", "$REAL")
            for k, (_, table) in enumerate(followed, 1):
                pairs = _pairs(table.times, table.values)
                rows = ",\n  ".join(", ".join(map(number_text, pairs[i : i + 6])) for i in range(0, len(pairs), 6))
                yield f"COURSE{k}(2, {table.times.size}) = {rows};"
            yield "$VARIABLES1"
            yield from self._logic(followed)
        yield from ("$EXECUTION", f"  TIMEND = {number_text(w.scenario.seconds)}", f"$ENDMODEL {self.main}")

    def _node(self, node: str, number: int, powers: Mapping[str, float]) -> str:
        """Return the line of a node: its start [degC or K], its heat capacity [J/K], or that it is a boundary or has no mass."""
        label = one_line(node).replace("'", " ")
        if node in self.w.boundaries:
            return f"B{number} = '{label}', T = {number_text(self.constant(node))};"
        capacitance = self.w.capacitances[node]
        start = number_text(round(self.w.initial.get(node, ICE_POINT + 20.0) - ICE_POINT, 12))
        mass = f", C = {number_text(float(capacitance))}" if capacitance is not None else ""
        power = f", QI = {number_text(powers[node])}" if node in powers else ""
        return f"D{number} = '{label}', T = {start}{mass}{power};"

    def _conductor(self, label: str, row: ConductorRow) -> str:
        """Return the line of a conductor."""
        a, b = (self.numbers[end][1] for end in row.ends)
        if row.form == "linear":
            return f"GL({a}, {b}) = {number_text(value_of(row.coefficients[0]))}; # {one_line(label)}"
        return f"GR({a}, {b}) = {number_text(self.radiation(row))}; # {one_line(label)}"

    def _logic(self, followed: list[tuple[HeatSource, TableSignal]]) -> Iterator[str]:
        """Yield the statements of courses; ESATAN adds QA, QE, QS and QR of a node, so each takes one."""
        free: dict[str, list[str]] = {}
        for k, (source, _) in enumerate(followed, 1):
            names = free.setdefault(source.node, ["QR", "QE", "QA", "QS"])
            if not names:
                raise DeckError(
                    f"more than four loads of '{source.node}' change in time, but ESATAN has only four. Combine some of them.",
                    self.w.network.title,
                    code="output.not-expressible",
                )
            number, power = self.numbers[source.node][1], number_text(float(source.power))
            yield f"  {names.pop()}{number} = INTRP1(TIMEM, COURSE{k}, 1) * {power}"
