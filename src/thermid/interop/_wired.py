"""A model in a scenario as exporters need it: rows with formulas, signals, the start; what cannot be exported is refused in words."""

from __future__ import annotations

import math
import operator
import os
import re
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Final

import numpy as np

from thermid import _kernel
from thermid.base.errors import DeckError, ScenarioError
from thermid.base.files import FileKinds
from thermid.base.units import real_power, si_unit, value_of
from thermid.model.tree import HINGES, Constant, Curve, Drawn, Law, Model, TableSignal
from thermid.simulation.runs import SMOOTHING, ConductorRow, Engine, Network, Numbers, Scenario, Wiring, network_for, signal_of

IN_WORDS = dict.fromkeys(HINGES.values(), "is a table that depends on parameters") | dict.fromkeys(
    ("gas", "natural"), "is a law of gas that convects or changes in time"
)
"""Form of a conductor that few formats have -> what it is."""


@dataclass(frozen=True)
class Writer:
    """What a format can hold beyond linear conductors, radiation, powers of differences, tables of straight lines and loads in time.

    Parameters
    ----------
    name : str          What it is called in messages.
    forms : tuple       Forms of conductors, as `form_of` names them.
    gas : bool          Conductors that change with their gas in time.
    open_tables : bool  Tables that are refused outside their points; others hold the last value there.
    load_tables : bool  Loads that are a table over temperature.
    smooth : bool       Tables of cubic pieces.
    loads : bool        Loads that follow a temperature, thermostats, proportional control.
    schedules : bool    Parameters that follow signals.
    stores : bool       Specific heats that are straight lines over temperature.
    numbers : bool      Whether it has numbers where others have formulas, so that what is zero in the scenario can be left out.
    """

    name: str
    forms: tuple[str, ...] = ("linear", "flow", "potential", "power", "radiation", "table", "table of difference")
    gas: bool = False
    open_tables: bool = False
    load_tables: bool = True
    smooth: bool = False
    loads: bool = False
    schedules: bool = False
    stores: bool = False
    numbers: bool = False


@dataclass(frozen=True, eq=False)
class HeatSource:
    """Heat into a node: a law times a signal, let through by a control.

    Parameters
    ----------
    load, node : str    Path of the load; node that it heats.
    power : Formula or float    First coefficient of the law, which the signal is multiplied by. [W]
    signal : Signal     [-], or in watts where `power` is one.
    curve : Curve       Power over the temperature of a node, times both; None where it does not depend on one. [W]
    sensor : str        Node whose temperature the law follows; empty where it follows none.
    form : str          Its law, one of `thermid.simulation._network.rows.LOADS`.
    rest : tuple        Further coefficients of the law.
    control : str       One of `thermid.simulation._network.rows.CONTROLS`; empty for none.
    settings : tuple    Coefficients of the control; a proportional one without its third has full power, `power` times the signal, for it.
    watched : str       Node whose temperature the control follows.
    """

    load: str
    node: str
    power: Formula | float
    signal: Drawn
    curve: Curve | None = None
    sensor: str = ""
    form: str = "signal"
    rest: tuple[Formula | float, ...] = ()
    control: str = ""
    settings: tuple[Formula | float, ...] = ()
    watched: str = ""

    @property
    def coefficients(self) -> tuple[Formula | float, ...]:
        """All of the law and the control."""
        return (self.power, *self.rest, *self.settings)


@dataclass(frozen=True, eq=False)
class ExportedParameter:
    """A parameter that the rows of a network need.

    Parameters
    ----------
    path : str          Its path in the model.
    value : float       [SI]
    formula : Formula   What it is computed from; None for a number, which a user of the export may change.
    unit : str          SI unit: ``W/(m^2 K)``, ``-`` for a plain number.
    note : str          What its author says of it.
    """

    path: str
    value: float
    formula: Formula | None
    unit: str
    note: str


@dataclass(frozen=True, eq=False)
class Wired:
    """A model in a scenario.

    Parameters
    ----------
    network : Network           The compiled model.
    scenario : Scenario         With canonical names.
    capacitances : dict         Node -> formula [J/K]; None for a massless node.
    conductors : tuple          (label, row): rows with formulas as coefficients, labels unique.
    sources : tuple of HeatSource   Every heat load that is not zero.
    boundaries : dict           Boundary -> its temperature. [K]
    gas : dict                  Signal name -> presence of a gas in time, for rows that follow it.
    initial : dict              Massive node -> its temperature at the start. [K]
    courses : dict              Parameter path -> what it follows in time; formulas hold its name. [SI]
    lacking : tuple             What the model lacks of the hardware, in words.
    idle : tuple                Names of conductors and loads that carry nothing in the scenario and are left out.
    held : tuple                What is written as it is in the scenario and does not follow values or temperature, in words.
    """

    network: Network
    scenario: Scenario
    capacitances: Mapping[str, Formula | float | None]
    conductors: tuple[tuple[str, ConductorRow], ...]
    sources: tuple[HeatSource, ...]
    boundaries: Mapping[str, Drawn]
    gas: Mapping[str, Drawn]
    initial: Mapping[str, float]
    courses: Mapping[str, Drawn] = field(default_factory=dict)
    lacking: tuple[str, ...] = ()
    idle: tuple[str, ...] = ()
    held: tuple[str, ...] = ()

    @cached_property
    def parameters(self) -> tuple[ExportedParameter, ...]:
        """Parameters that the rows need, each after what it is computed from; those that follow signals are left out."""
        table = self.network.flat.parameters
        values = self.network.numbers().values
        formulas: list[object] = [c for _, row in self.conductors for c in row.coefficients]
        formulas += [*self.capacitances.values(), *(c for s in self.sources for c in s.coefficients)]
        wanted = {path for f in formulas if isinstance(f, Formula) for path in f.paths()}
        for path in reversed(table.order):
            if path in wanted and path not in self.courses:
                entry = table.table[path]
                wanted |= {entry.scope + n for n in entry.parameter.expression.names}
        out = []
        for path in table.order:
            if path not in wanted or path in self.courses:
                continue
            entry = table.table[path]
            written = entry.parameter
            formula = None
            if not written.is_literal:
                formula = written.expression.evaluate(lambda n, s=entry.scope: named(s + n, float(values[s + n])))  # type: ignore[misc]
            note, of = one_line(written.note or written.basis), si_unit(table.dimension(path))
            out.append(ExportedParameter(path, float(values[path]), formula, "-" if of == "1" else of, note))
        return tuple(out)

    @property
    def massive(self) -> tuple[str, ...]:
        """Nodes with a capacitance, in the network's order."""
        return tuple(n for n in self.network.nodes if self.capacitances[n] is not None)

    @property
    def massless(self) -> tuple[str, ...]:
        """Nodes without."""
        return tuple(n for n in self.network.nodes if self.capacitances[n] is None)

    def breaks(self) -> list[float]:
        """Return the times within the run at which a signal jumps or bends. [s]"""
        signals = (*self.boundaries.values(), *self.gas.values(), *self.courses.values(), *(s.signal for s in self.sources))
        times = {float(t) for s in signals if isinstance(s, TableSignal) for t in s.times}
        return sorted(t for t in times if 0.0 < t < self.scenario.seconds)


def wired(model: Model, scenario: Scenario, what: str | Writer) -> Wired:
    """Return a model in a scenario, ready to be written for another tool.

    Parameters
    ----------
    model, scenario     As in `simulate`; the scenario needs a duration.
    what : str or Writer    The tool, for messages, and what it can hold.

    Raises
    ------
    ScenarioError   When something of the scenario cannot be written, such as a schedule.
    DeckError       When a law or a load of the model cannot be written.
    """
    writer = what if isinstance(what, Writer) else Writer(what)
    if scenario.schedule and not writer.schedules:
        raise ScenarioError(
            f"'{next(iter(scenario.schedule))}' follows a schedule, which is not written to {writer.name}. Export one run for each value.",
            scenario.title,
            code="output.not-expressible",
        )
    if scenario.seconds <= 0:
        raise ScenarioError(
            'an export of a run needs a duration above zero: duration = "5 [h]", or --for "5 [h]".',
            scenario.title,
            code="value.outside-range",
        )
    network = network_for(model, scenario)
    if network.controls:
        what = f"{writer.name} does not support controls, and '{network.controls[0]}' is in use"
        raise DeckError(f"{what}. Export the model without it, or one run for each share.", code="model.element-not-supported")
    wiring = Wiring(network, scenario)
    numbers = wiring.flowing(with_formulas(network), {})
    laws = [row for row in numbers.conductors if writer.numbers and row.form in ("power", "table") and not row.signal]
    idle = [row for row in laws if value_of(row.coefficients[0]) == 0.0]
    numbers, held = _gas_at_rest(replace(numbers, conductors=tuple(row for row in numbers.conductors if row not in idle)), writer)
    _refuse_laws(network, numbers, writer)
    sources = _sources(network, wiring, numbers, writer)
    _refuse_open_tables(network, numbers, sources, writer)
    off = [load.name for load in numbers.loads if writer.numbers and not load.fixed and load.name not in {s.load for s in sources}]
    engine = Engine(wiring)
    start = dict(zip(engine.nodes, engine.started(wiring.assemble(gradients=False)).initial.tolist(), strict=True))
    capacitances: dict[str, Formula | float | None] = dict(numbers.capacitances)  # type: ignore[arg-type]
    out = Wired(
        network,
        wiring.scenario,
        capacitances,
        named_rows(row for row in numbers.conductors if row.ends[0] != row.ends[1]),
        sources,
        {b: wiring.signals[f"boundary {b}"] for b in network.boundaries},
        {name: curve.drawn(wiring.scenario.seconds) for name, curve in network.media.signals().items()}
        | {name: curve for name, curve in wiring.signals.items() if name.startswith(signal_of(""))},
        {n: start[n] for n, c in capacitances.items() if c is not None},
        {} if wiring.schedule is None else {p: s.drawn(wiring.scenario.seconds) for p, s in wiring.schedule.signals.items()},
        tuple(model.missing_parts()),
        tuple(dict.fromkeys([*(f"{row.name} ({row.form} law)" for row in idle), *off])),
        held,
    )
    _refuse_bent_courses(out, writer)
    _refuse_other_formulas(out, wiring, writer)
    return out


def _gas_at_rest(numbers: Numbers, writer: Writer) -> tuple[Numbers, tuple[str, ...]]:
    """Return numbers in which gas at rest at one pressure has a law that a format holds, and what that law does not follow, in words.

    Its conductance, ``G k(T) / (1 + k(T) (T / 300 K)^(1/2) / c)`` with the continuum's k [-] and the ratio c of free molecules to it, is a
    table over the mean temperature; where a format has no tables, its value at 300 K.
    """
    rows, held = [], []
    for row in numbers.conductors:
        if row.form != "gas" or row.form in writer.forms or row.signal or row.second or row.curve is None:
            rows.append(row)
            continue
        x, k, _ = row.curve.table
        y = k / (1.0 + k * np.sqrt(x / _kernel.GAS_ANCHOR) / float(value_of(row.coefficients[1])))
        first = row.coefficients[0]
        if "table" in writer.forms:
            rows.append(replace(row, law=Law("table", (first,)), curve=Curve("temperature", x, y)))
            held.append(f"{row.name}: the share of free molecules in its gas")
        else:
            rows.append(replace(row, law=Law("linear", (first * float(np.interp(_kernel.GAS_ANCHOR, x, y)),)), curve=None))
            held.append(f"{row.name}: its gas is at {_kernel.GAS_ANCHOR:g} K")
    return replace(numbers, conductors=tuple(rows)), tuple(held)


def _refuse_laws(network: Network, numbers: Numbers, writer: Writer) -> None:
    """Refuse laws of conductors and stores that a format does not hold."""
    for node, store in network.stores.items():
        if writer.stores and store.given.straight and store.given.limits is None and store.rise.d is not None:
            continue
        raise DeckError(
            f"the specific heat of '{node}' changes with temperature, which is not written to {writer.name}.",
            network.title,
            code="output.not-expressible",
        )
    for row in numbers.conductors:
        form = form_of(row)
        if form not in writer.forms or (row.signal and not writer.gas):
            what = IN_WORDS.get(form, f"is of the form '{form}'") if form not in writer.forms else "changes with its gas in time"
            raise DeckError(f"'{row.name}' {what}, which is not written to {writer.name}.", network.title, code="output.not-expressible")
    curves = {c.path: c.curve for c in network.flat.conductors} | {load.path: load.curve for load in network.flat.loads}
    for name, curve in curves.items():
        if curve is not None and not (curve.film[-1] if curve.film else curve).straight and not writer.smooth:
            raise DeckError(
                f"'{name}' is a smooth table, which is not written to {writer.name}. Use interpolation = 'linear'.",
                network.title,
                code="output.not-expressible",
            )


def _refuse_open_tables(network: Network, numbers: Numbers, sources: Iterable[HeatSource], writer: Writer) -> None:
    """Refuse tables that have no values outside their points, where a format holds the last one."""
    for name, curve in (*((row.name, row.curve) for row in numbers.conductors), *((s.load, s.curve) for s in sources)):
        if curve is not None and not writer.open_tables and not table_points(curve)[2]:
            raise DeckError(
                f"'{name}' is a table with outside = 'refuse', which is not written to {writer.name}, where it holds its last value. Use "
                "outside = 'hold'.",
                network.title,
                code="output.not-expressible",
            )


def _sources(network: Network, wiring: Wiring, numbers: Numbers, writer: Writer) -> tuple[HeatSource, ...]:
    """Return every heat load that is not zero."""
    sources = []
    for load in numbers.loads:
        signal = wiring.signals[load.signal] if load.signal else Constant(1.0)
        power: Formula | float = load.coefficients[0]  # type: ignore[assignment]  # formulas stand where numbers do
        if load.signal.startswith("load ") and load.form != "table":
            gain = wiring.scenario.gains.get(load.name)
            power = numbers.values[gain] if gain else 1.0 if load.name in wiring.scenario.loads else power
        if load.node not in network.nodes or (load.form == "signal" and (signal == Constant(0.0) or float(power) == 0.0)):
            continue
        plain = load.fixed or (writer.load_tables and load.form == "table" and not load.control and load.curve is not None)
        if not plain and not writer.loads and signal == Constant(0.0):
            continue
        if not plain and not writer.loads:
            law = load.control or load.form
            raise DeckError(
                f"the load '{load.name}' depends on temperature ({law}), which is not written to {writer.name}. Give its power: --load "
                f"{load.name}=0 leaves it out.",
                network.title,
                code="output.not-expressible",
            )
        sources.append(
            HeatSource(
                load.name,
                load.node,
                power,
                signal,
                load.curve,
                sensor="" if load.form == "signal" else load.node,
                form=load.form,
                rest=load.of_law[1:],  # type: ignore[arg-type]
                control=load.control,
                settings=load.settings,  # type: ignore[arg-type]
                watched=load.sensor if load.control else "",
            )
        )
    return tuple(sources)


MOST_DEGREE: Final = 99
"""Degree of what is no polynomial."""


def _degree(formula: Formula | float, degrees: Mapping[str, int]) -> int:
    """Return the degree of a formula in what changes in time, by the degrees of the names in it."""
    if not isinstance(formula, Formula) or formula.operator == "number":
        return 0
    if formula.operator == "name":
        return degrees.get(formula.parts[0], 0)
    several = [_degree(part, degrees) for part in formula.parts]
    if formula.operator in ("+", "-", "neg"):
        return max(several)
    if formula.operator == "*":
        return sum(several)
    if formula.operator == "/" and several[1] == 0:
        return several[0]
    return MOST_DEGREE if any(several) else 0


def _refuse_bent_courses(w: Wired, writer: Writer) -> None:
    """Refuse a coefficient that is no straight line in time where the parameter that it follows is one.

    A run joins the values of the coefficient, and a format those of the parameter, by straight lines; of held values both are equal.
    """
    bent = [path for path, course in w.courses.items() if not course.held]
    if not bent:
        return
    degrees = dict.fromkeys(bent, 1)
    for parameter in w.parameters:
        if parameter.formula is not None:
            degrees[parameter.path] = _degree(parameter.formula, degrees)
    for name, formulas in (*((label, row.coefficients) for label, row in w.conductors), *((s.load, s.coefficients) for s in w.sources)):
        if any(_degree(f, degrees) > 1 for f in formulas):  # type: ignore[arg-type]
            raise ScenarioError(
                f"'{name}' follows '{bent[0]}' otherwise than in proportion, and its schedule is made of straight lines, which is not "
                f"written to {writer.name}. Give the schedule as steps: hold = true.",
                w.scenario.title,
                code="output.not-expressible",
            )


def _refuse_other_formulas(w: Wired, wiring: Wiring, writer: Writer) -> None:
    """Refuse a coefficient whose formula is another one at a value that its parameter has later: only the first one is written."""
    for time in (0.0, *w.breaks()) if w.courses else ():
        numbers = w.network.numbers({path: float(course.at(np.array([time]))[0]) for path, course in w.courses.items()})
        now = named_rows(row for row in wiring.flowing(numbers, {}).conductors if row.ends[0] != row.ends[1])
        for (name, row), (_, then) in zip(w.conductors, now, strict=True):
            pairs: list[tuple[Any, Any]] = list(zip(row.coefficients, then.coefficients, strict=True))
            if any(isinstance(f, Formula) and abs(f.at(numbers.values) - value_of(c)) > 1e-9 * abs(value_of(c)) for f, c in pairs):
                raise ScenarioError(
                    f"'{name}' has another formula at {time:g} s, where '{next(iter(w.courses))}' has changed, which is not written to "
                    f"{writer.name}. Export one run for each value.",
                    w.scenario.title,
                    code="output.not-expressible",
                )


def form_of(row: ConductorRow) -> str:
    """Return the form of a row; a table over a difference is one of its own."""
    return "table of difference" if row.form == "table" and row.curve is not None and row.curve.over == "difference" else row.form


def named_rows(rows: Iterable[ConductorRow]) -> tuple[tuple[str, ConductorRow], ...]:
    """Return rows with unique labels: a conductor of several rows is numbered."""
    every = list(rows)
    return tuple(zip(distinct((row.name for row in every), "."), every, strict=True))


def refuse_crooked(w: Wired, what: str) -> None:
    """Refuse laws that are not linear at massless nodes, whose temperatures have no formula then.

    Raises
    ------
    DeckError   With the conductor and the node.
    """
    for label, row in w.conductors:
        at = [end for end in row.ends if end in w.massless]
        if at and not row.kernel.linear:
            raise DeckError(
                f"'{label}' is not linear ({row.form}) and ends at the massless node '{at[0]}', whose temperature has no formula then. "
                f"Give the node a capacitance to write the model to {what}.",
                w.network.title,
                code="output.not-expressible",
            )
    for source in w.sources:
        at = [end for end in (source.node, source.sensor) if end in w.massless]
        if source.curve is not None and at:
            raise DeckError(
                f"the load '{source.load}' depends on temperature and acts on the massless node '{at[0]}', whose temperature has no formula"
                f" then. Give the node a capacitance to write the model to {what}.",
                w.network.title,
                code="output.not-expressible",
            )
    # refuse a massless node that nothing leads to
    for node in w.massless:
        if not any(value_of(row.coefficients[0]) > 0 for _, row in w.conductors if node in row.ends):
            raise DeckError(
                f"the massless node '{node}' has no conductance to any node, so its temperature is undefined. Connect it.",
                w.network.title,
                code="model.massless-undefined",
            )


def conductance_text(row: ConductorRow, coefficients: Sequence[str], a: str, b: str, read: Callable[[Curve, str], str]) -> str:
    """Return the conductance of a row as text, by the temperatures of its ends, in signs that Octave and SPICE share. [W/K]

    Parameters
    ----------
    coefficients : sequence of str  Those of the row; each binds as strongly as a product.
    a, b : str                      Temperatures of the ends. [K]
    read : callable                 Table, and where it is read -> text.

    Raises
    ------
    DeckError   When the law has no such text.
    """
    first, *rest = coefficients
    if row.form in ("linear", "flow", "potential"):  # of a potential, what its integrals are multiplied by
        return first
    if row.form == "power":
        return f"{first}*(({a} - {b})^2 + {SMOOTHING}^2)^({rest[0]}/2)"
    if row.form == "radiation":
        return f"{first}*({a}^2 + {b}^2)*({a} + {b})"
    if row.form == "table" and row.curve is not None:
        return f"{first}*{read(row.curve, f'{a} - {b}' if row.curve.over == 'difference' else f'({a} + {b})/2')}"
    raise DeckError(
        f"'{row.name}' is of a form that is not written to this format: {row.form}. Export an FMU, which has every law.",
        code="output.not-expressible",
    )


def table_points(curve: Curve) -> tuple[list[float], list[float], bool]:
    """Return abscissae [K] and ordinates of a table of straight lines, or of the integrand of a potential, as far as it reaches.

    Ordinates are in the SI unit of the table. Third: whether it is held outside; a table that is refused has no values there.
    """
    if curve.film:
        return curve.x.tolist(), curve.slopes.tolist(), curve.limits is None
    x, y, _ = curve.table
    return x.tolist(), y.tolist(), curve.limits is None


def one_line(text: str) -> str:
    """Return a title or note on one line, so that it cannot leave its comment."""
    return " ".join(text.split())


def distinct(words: Iterable[str], between: str) -> list[str]:
    """Return words of which the second of a kind and later ones are numbered: a, b, a -> a, b, a.2."""
    counts: Counter[str] = Counter()
    out = []
    for word in words:
        counts[word] += 1
        out.append(word if counts[word] == 1 else f"{word}{between}{counts[word]}")
    return out


def resting(signal: Drawn) -> float | None:
    """Return the value of a signal that does not change in time; None of one that does."""
    if isinstance(signal, TableSignal):
        return float(signal.values[0]) if signal.times.size == 1 else None
    return signal.value if isinstance(signal, Constant) else None


def file_and_name(
    path: str | os.PathLike[str] | None, name: str, title: str, what: str, taken: Iterable[str], longest: int = 63
) -> tuple[Path | None, str]:
    """Return the file of an export, and what it holds is called: as given, else as the file, else as the model's title.

    Raises
    ------
    DeckError   When the name is none of the language: it is of ASCII letters, digits and ``_``, and none that is `taken`.
    """
    target = Path(path) if path is not None else None
    called = name or (target.stem if target is not None else re.sub(r"\W+", "_", title, flags=re.ASCII).strip("_"))
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", called) or len(called) > longest or called in taken:
        raise DeckError(
            f"'{called}' is not a valid name of {what}. Use letters, digits and _, beginning with a letter, at most {longest}, and no "
            "reserved word. Give another file name.",
            title,
            code="name.not-valid",
        )
    return target, called


MAX_PATH_LETTERS = 50
"""Letters of a path that a word keeps."""


def identifiers(paths: Iterable[str], caseless: bool = False) -> dict[str, str]:
    """Return path -> a word of letters, digits and ``_`` that begins with a letter, no two alike; `caseless` without capitals."""
    out: dict[str, str] = {}
    taken: set[str] = set()
    for path in paths:
        word = re.sub(r"\W", "_", path)[:MAX_PATH_LETTERS]
        word = word if word[0].isalpha() else f"x{word}"
        name, k = word, 1
        while (name.lower() if caseless else name) in taken:
            k += 1
            name = f"{word}_{k}"
        taken.add(name.lower() if caseless else name)
        out[path] = name
    return out


_COMPUTE: dict[str, Callable[[float, float], float]] = {
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "/": operator.truediv,
    "**": real_power,
}
_RANK = {"+": 1, "-": 1, "*": 2, "/": 2, "neg": 3, "**": 4, "name": 5, "number": 5}
FUNCTIONS: Final[Mapping[str, Callable[..., float]]] = {"exp": math.exp, "log": math.log, "sqrt": math.sqrt, "min": min, "max": max}
"""Functions of a formula by name; the last two take two values."""
_UFUNCS = {
    "maximum": "max",
    "minimum": "min",
    "add": "+",
    "subtract": "-",
    "multiply": "*",
    "divide": "/",
    "power": "**",
    "negative": "neg",
}
"""What numpy calls an operator or a function otherwise than a formula does."""


Binary = Callable[["Formula", Any], "Formula"]


def _operator(sign: str) -> tuple[Binary, Binary]:
    """Return the methods of a sign: the formula on its left, and on its right."""
    return lambda formula, other: _operation(sign, formula, other), lambda formula, other: _operation(sign, other, formula)


@dataclass(frozen=True, eq=False)
class Formula:
    """A number and the arithmetic that it comes from.

    Parameters
    ----------
    value : float       The number. [SI]
    operator : str      ``name``, ``number``, ``neg``, one of ``+ - * / **``, or a function: one of `FUNCTIONS`.
    parts : tuple       The operands; the path for a name; empty for a number.
    """

    value: float
    operator: str
    parts: tuple[Any, ...] = ()

    def __float__(self) -> float:
        """The number."""
        return self.value

    __add__, __radd__ = _operator("+")
    __sub__, __rsub__ = _operator("-")
    __mul__, __rmul__ = _operator("*")
    __truediv__, __rtruediv__ = _operator("/")
    __pow__, __rpow__ = _operator("**")

    def __neg__(self) -> Formula:
        """Negative."""
        return Formula(-self.value, "neg", (self,))

    def __pos__(self) -> Formula:
        """Itself."""
        return self

    def __array_ufunc__(self, ufunc: Any, method: str, *inputs: Any, **options: Any) -> Any:
        """Return the formula of a function or operator of numpy, which recipes and expressions use."""
        name = _UFUNCS.get(ufunc.__name__, ufunc.__name__)
        several = [x.item() if isinstance(x, np.ndarray) and x.size == 1 else x for x in inputs]
        if method != "__call__" or options or not all(isinstance(x, (Formula, float, int)) for x in several):
            return NotImplemented
        if name in FUNCTIONS:
            parts = tuple(_formula(x) for x in several)
            return Formula(float(FUNCTIONS[name](*(x.value for x in parts))), name, parts)
        if name == "neg":
            return -_formula(several[0])
        if name in _COMPUTE:
            return _operation(name, *several)
        return NotImplemented

    def at(self, values: Mapping[str, Any]) -> float:
        """Return its number at other values of its names. [SI]"""
        if not self.parts or self.operator == "name":
            return value_of(values[self.parts[0]]) if self.parts else self.value
        compute: Any = FUNCTIONS.get(self.operator) or _COMPUTE.get(self.operator, operator.neg)
        return float(compute(*(part.at(values) for part in self.parts)))

    def paths(self) -> set[str]:
        """Return the names it holds."""
        if self.operator == "name":
            return {self.parts[0]}
        return {path for part in self.parts for path in part.paths()}


def _formula(x: Any) -> Formula:
    """Return a plain number as a formula, a formula as it is."""
    return x if isinstance(x, Formula) else Formula(float(x), "number")


def _operation(operator: str, lhs: Any, right: Any) -> Formula:
    """Return the formula of two operands; a plain number becomes a formula, and a factor of one goes."""
    a, b = _formula(lhs), _formula(right)
    if operator in "*/" and b.operator == "number" and b.value == 1.0:
        return a
    if operator == "*" and a.operator == "number" and a.value == 1.0:
        return b
    return Formula(_COMPUTE[operator](a.value, b.value), operator, (a, b))


def named(path: str, value: float) -> Formula:
    """Return the formula that is one name."""
    return Formula(value, "name", (path,))


def number_text(value: float) -> str:
    """Return the shortest text that is read as the same number."""
    if value in (float("inf"), -float("inf")):
        return "Inf" if value > 0 else "-Inf"
    return repr(int(value)) if value == int(value) and abs(value) < 1e15 else repr(float(value))


@dataclass(frozen=True)
class Text:
    """How formulas are written in one language.

    Parameters
    ----------
    name : callable     Path -> how it is written.
    power : str         The sign of a power; the name of a function of two values where it is a word.
    number : callable   Number -> how it is written.
    functions : dict    Function -> how it is written, where that is otherwise.
    """

    name: Callable[[str], str]
    power: str = "^"
    number: Callable[[float], str] = field(default_factory=lambda: number_text)
    functions: Mapping[str, str] = field(default_factory=dict)

    def text_of(self, formula: Formula | float, above: int = 0) -> str:
        """Return a formula as text, in parentheses where its surroundings bind as strongly as `above`."""
        if not isinstance(formula, Formula):
            return self.number(float(formula)) if formula >= 0 or not above else f"({self.number(float(formula))})"
        if formula.operator in FUNCTIONS or (formula.operator == "**" and self.power.isalpha()):
            called = self.power if formula.operator == "**" else self.functions.get(formula.operator, formula.operator)
            return f"{called}({', '.join(self.text_of(part) for part in formula.parts)})"
        rank = _RANK[formula.operator]
        if formula.operator == "name":
            return self.name(formula.parts[0])
        if formula.operator == "number":
            return self.text_of(formula.value, above)
        if formula.operator == "neg":
            text = f"-{self.text_of(formula.parts[0], rank)}"
        else:
            lhs, right = formula.parts
            # equal ranks: a - (b - c) needs its parentheses, (a - b) - c does not; powers get them on both sides
            tight = formula.operator == "**"
            sign = self.power if tight else f" {formula.operator} " if rank == 1 else formula.operator
            firm = rank + (formula.operator in "-/" or tight)
            text = f"{self.text_of(lhs, rank + tight)}{sign}{self.text_of(right, firm)}"
        return f"({text})" if rank < above else text


def with_formulas(network: Network) -> Numbers:
    """Return the rows of a network with formulas over parameter paths as coefficients and capacitances."""
    values = network.numbers().values
    expressions: dict[str, Any] = {path: named(path, value_of(value)) for path, value in values.items()}
    return network.numbers(expressions)


def exported(w: Wired, lines: Iterable[str], path: str | os.PathLike[str] | None, comment: str) -> str:
    """Return a model as written, also in the file at `path` where there is one; `comment` begins a comment of the language.

    What the model lacks stands in the first lines, where readers of decks find it again.
    """
    lacking = [f"{comment.strip()} INCOMPLETE: {one_line(what)}" for what in w.lacking]
    idle = [f"{comment.strip()} left out, because nothing flows through it in this scenario: {one_line(name)}" for name in w.idle]
    held = [f"{comment.strip()} as in this scenario, whatever else changes: {one_line(what)}" for what in w.held]
    text = "\n".join([*lacking, *idle, *held, *lines]) + "\n"
    if path is not None:
        FileKinds.EXPORT.save_text(path, text, comment)
    return text
