"""A model in a scenario as exporters need it: rows with formulas, signals, the start; what cannot be exported is refused in words."""

from __future__ import annotations

import operator
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from thermid.dual import real_power, value_of
from thermid.errors import DeckError, ScenarioError
from thermid.model.laws.curves import Curve, slopes, whole
from thermid.model.laws.signal import Constant, Drawn, TableSignal
from thermid.model.parts.kinds import HINGES
from thermid.model.tree.model import Model
from thermid.network.controls import refuse_controls
from thermid.network.network import Network, Numbers
from thermid.network.rows import SMOOTHING, ConductorRow
from thermid.network.streams import signal_of
from thermid.simulation.scenarios.scenario import Scenario
from thermid.simulation.simulator import network_for
from thermid.simulation.solver.engine import Engine
from thermid.simulation.solver.wiring import Wiring

MOVING = tuple(HINGES.values())


@dataclass(frozen=True, eq=False)
class HeatSource:
    """Heat into a node: a formula times a signal.

    Parameters
    ----------
    load, node : str    Path of the load; node that it heats.
    power : Formula or float    What the signal is multiplied by. [W]
    signal : Signal     [-], or in watts where `power` is one.
    curve : Curve       Power over the temperature of a node, times both; None where it does not depend on one. [W]
    sensor : str        That node.
    """

    load: str
    node: str
    power: Formula | float
    signal: Drawn
    curve: Curve | None = None
    sensor: str = ""


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
    """

    network: Network
    scenario: Scenario
    capacitances: Mapping[str, Formula | float | None]
    conductors: tuple[tuple[str, ConductorRow], ...]
    sources: tuple[HeatSource, ...]
    boundaries: Mapping[str, Drawn]
    gas: Mapping[str, Drawn]
    initial: Mapping[str, float]

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
        signals = (*self.boundaries.values(), *self.gas.values(), *(s.signal for s in self.sources))
        times = {float(t) for s in signals if isinstance(s, TableSignal) for t in s.times}
        return sorted(t for t in times if 0.0 < t < self.scenario.seconds)


def wired(model: Model, scenario: Scenario, what: str) -> Wired:
    """Return a model in a scenario, ready to be written for another tool.

    Parameters
    ----------
    model, scenario     As in `simulate`; the scenario needs a duration.
    what : str          The tool, for messages.

    Raises
    ------
    ScenarioError   When something in it cannot be written: a schedule, a tabulated law, a load that depends on temperature.
    """
    if scenario.schedule:
        raise ScenarioError(
            f"'{next(iter(scenario.schedule))}' follows a schedule, which is not written to {what}. Export one run for each value.",
            scenario.title,
        )
    if scenario.seconds <= 0:
        raise ScenarioError('an export of a run needs a duration above zero: duration = "5 [h]", or --for "5 [h]".', scenario.title)
    network = network_for(model, scenario)
    refuse_controls(network.controls, what, "Export the model without it, or one run for each share.")
    wiring = Wiring(network, scenario)
    numbers = wiring.flowing(with_formulas(network), {})
    for row in numbers.conductors:
        if row.form in MOVING or row.form in ("gas", "natural"):
            kind = "a table that follows values" if row.form in MOVING else "a law of gas at a pressure, which rests on tables"
            raise DeckError(f"'{row.name}' is {kind}, which is not written to {what}.", network.title)
    given = {c.path: c.curve for c in network.flat.conductors} | {load.path: load.curve for load in network.flat.loads}
    for name, curve in given.items():
        if curve is not None and not (curve.film[-1] if curve.film else curve).straight:
            raise DeckError(f"'{name}' is a smooth table, which is not written to {what}; straight lines are.", network.title)
    for node in network.stores:
        raise DeckError(f"the specific heat of '{node}' changes with temperature, which is not written to {what}.", network.title)
    sources = []
    for load in numbers.loads:
        if load.form == "table" and not load.control and load.curve is not None:
            signal = wiring.signals[load.signal] if load.signal else Constant(1.0)
            if load.node in network.nodes:
                sources.append(HeatSource(load.name, load.node, load.coefficients[0], signal, load.curve, load.node))  # type: ignore[arg-type]
            continue
        if not load.fixed:
            law = load.control or load.form
            raise DeckError(f"the load '{load.name}' depends on temperature ({law}), which is not written to {what}.", network.title)
        signal = wiring.signals[load.signal]
        power: Formula | float = load.coefficients[0]  # type: ignore[assignment]  # formulas stand where numbers do
        if load.signal.startswith("load "):
            gain = wiring.scenario.gains.get(load.name)
            power = numbers.values[gain] if gain else 1.0 if f"watts {load.name}" in wiring.signals else power
        if load.node in network.nodes and signal != Constant(0.0) and float(power) != 0.0:
            sources.append(HeatSource(load.name, load.node, power, signal))
    rows = named_rows(row for row in numbers.conductors if row.ends[0] != row.ends[1])
    engine = Engine(wiring)
    start = dict(zip(engine.nodes, engine.started(wiring.assemble(gradients=False)).initial.tolist(), strict=True))
    capacitances: dict[str, Formula | float | None] = dict(numbers.capacitances)  # type: ignore[arg-type]
    massive = {n: start[n] for n, c in capacitances.items() if c is not None}
    return Wired(
        network,
        wiring.scenario,
        capacitances,
        rows,
        tuple(sources),
        {b: wiring.signals[f"boundary {b}"] for b in network.boundaries},
        {name: given.drawn(wiring.scenario.seconds) for name, given in network.media.signals().items()}
        | {name: given for name, given in wiring.signals.items() if name.startswith(signal_of(""))},
        massive,
    )


def named_rows(rows: Iterable[ConductorRow]) -> tuple[tuple[str, ConductorRow], ...]:
    """Return rows with unique labels: a conductor of several rows is numbered."""
    seen: dict[str, int] = {}
    out = []
    for row in rows:
        seen[row.name] = seen.get(row.name, 0) + 1
        out.append((row.name if seen[row.name] == 1 else f"{row.name}.{seen[row.name]}", row))
    return tuple(out)


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
            )
    for source in w.sources:
        at = [end for end in (source.node, source.sensor) if end in w.massless]
        if source.curve is not None and at:
            raise DeckError(
                f"the load '{source.load}' depends on temperature and acts on the massless node '{at[0]}', whose temperature has no formula"
                f" then. Give the node a capacitance to write the model to {what}.",
                w.network.title,
            )
    _check_reached(w)


def conductance_text(row: ConductorRow, coefficients: Sequence[str], a: str, b: str, read: Callable[[Curve, str], str]) -> str:
    """Return the conductance of a row as text, by the temperatures of its ends, in signs that Octave and SPICE share. [W/K]

    Parameters
    ----------
    coefficients : sequence of str  Those of the row; each binds as strongly as a product.
    a, b : str                      Temperatures of the ends. [K]
    read : callable                 Table, and where it is read -> text.
    """
    first, *rest = coefficients
    if row.form == "power":
        return f"{first}*(({a} - {b})^2 + {SMOOTHING}^2)^({rest[0]}/2)"
    if row.form == "radiation":
        return f"{first}*({a}^2 + {b}^2)*({a} + {b})"
    if row.form == "table" and row.curve is not None:
        return f"{first}*{read(row.curve, f'{a} - {b}' if row.curve.over == 'difference' else f'({a} + {b})/2')}"
    return first


def table_points(curve: Curve) -> tuple[list[float], list[float], bool]:
    """Return abscissae and ordinates of a table of straight lines, or of the integrand of a potential, as far as it reaches.

    Third: whether it is held outside; a table that is refused has no values there.
    """
    if curve.film:
        return curve.x.tolist(), slopes(curve).tolist(), curve.limits is None
    x, y, _ = whole(curve)
    return x.tolist(), y.tolist(), curve.limits is None


def _check_reached(w: Wired) -> None:
    """Refuse a massless node that nothing leads to."""
    for node in w.massless:
        if not any(value_of(row.coefficients[0]) > 0 for _, row in w.conductors if node in row.ends):
            raise DeckError(f"the massless node '{node}' has no conductance to anything, so its temperature is undefined.", w.network.title)


def one_line(text: str) -> str:
    """Return a title or note on one line, so that it cannot leave its comment."""
    return " ".join(text.split())


def identifiers(paths: Iterable[str], longest: int = 50, caseless: bool = False) -> dict[str, str]:
    """Return path -> a word of letters, digits and ``_`` that begins with a letter, no two alike; `caseless` without capitals."""
    out: dict[str, str] = {}
    taken: set[str] = set()
    for path in paths:
        word = re.sub(r"\W", "_", path)[:longest]
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


Binary = Callable[["Formula", Any], "Formula"]


def _operator(sign: str) -> tuple[Binary, Binary]:
    """Return the methods of a sign: the formula on its left, and on its right."""
    return lambda own, other: _made(sign, own, other), lambda own, other: _made(sign, other, own)


@dataclass(frozen=True, eq=False)
class Formula:
    """A number and the arithmetic that it comes from.

    Parameters
    ----------
    value : float       The number. [SI]
    operator : str      ``name``, ``number``, ``neg``, or one of ``+ - * / **``.
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

    def paths(self) -> set[str]:
        """Return the names it holds."""
        if self.operator == "name":
            return {self.parts[0]}
        return {path for part in self.parts for path in part.paths()}


def _made(operator: str, left: Any, right: Any) -> Formula:
    """Return the formula of two operands; a plain number becomes a formula, and a factor of one goes."""
    a, b = (x if isinstance(x, Formula) else Formula(float(x), "number") for x in (left, right))
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
    power : str         The sign of a power.
    """

    name: Callable[[str], str]
    power: str = "^"

    def of(self, formula: Formula | float, above: int = 0) -> str:
        """Return a formula as text, in parentheses where its surroundings bind as strongly as `above`."""
        if not isinstance(formula, Formula):
            return number_text(float(formula)) if formula >= 0 or not above else f"({number_text(float(formula))})"
        rank = _RANK[formula.operator]
        if formula.operator == "name":
            return self.name(formula.parts[0])
        if formula.operator == "number":
            return self.of(formula.value, above)
        if formula.operator == "neg":
            text = f"-{self.of(formula.parts[0], rank)}"
        else:
            left, right = formula.parts
            # equal ranks: a - (b - c) needs its parentheses, (a - b) - c does not; powers get them on both sides
            tight = formula.operator == "**"
            sign = self.power if tight else f" {formula.operator} " if rank == 1 else formula.operator
            firm = rank + (formula.operator in "-/" or tight)
            text = f"{self.of(left, rank + tight)}{sign}{self.of(right, firm)}"
        return f"({text})" if rank < above else text


def with_formulas(network: Network) -> Numbers:
    """Return the rows of a network with formulas over parameter paths as coefficients and capacitances."""
    values = network.numbers().values
    given: dict[str, Any] = {path: named(path, value_of(value)) for path, value in values.items()}
    return network.numbers(given)
