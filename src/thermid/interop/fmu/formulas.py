"""Coefficients of the kernel as formulas over what a host may set (parameters, constant boundaries and loads), and which of them hold."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from thermid.dual import value_of
from thermid.errors import ThermidError
from thermid.interop.wired import Formula, named
from thermid.model.laws.curves import Curve
from thermid.model.laws.signal import Constant
from thermid.network.network import Network, Numbers
from thermid.simulation.scenarios.scenario import Scenario
from thermid.simulation.solver.wiring import Assembled, Wiring

CLOSE = 1e-10
"""How far a formula's number may be from that of the network, as a share of it. [-]"""
MOVES = (1.13, 0.83)
"""What values are multiplied by to see whether the formulas hold away from the model's own values. [-]"""


@dataclass(frozen=True)
class Symbol:
    """A value that a host may set.

    Parameters
    ----------
    name : str      ``parameter``, ``boundary`` or ``load``, a space, and the path.
    start : float   [SI]
    """

    name: str
    start: float

    @property
    def kind(self) -> str:
        """``parameter``, ``boundary`` or ``load``."""
        return self.name.partition(" ")[0]

    @property
    def path(self) -> str:
        """Its path in the model."""
        return self.name.partition(" ")[2]


@dataclass(frozen=True, eq=False)
class Formulas:
    """Coefficients as formulas.

    Parameters
    ----------
    assembled : Assembled       The numbers at the model's own values.
    symbols : tuple of Symbol   What the formulas hold, in order: parameters, boundaries, loads.
    coefficients : tuple        In the kernel's order; what a constant load multiplies holds it. [SI]
    refused : dict              Name of a symbol that is not offered -> why.
    """

    assembled: Assembled
    symbols: tuple[Symbol, ...]
    coefficients: tuple[Formula | float, ...]
    refused: Mapping[str, str]


def free_parameters(network: Network, scenario: Scenario) -> tuple[str, ...]:
    """Return the parameters that a host might set: values of their own, not those that follow a schedule."""
    table = network.flat.parameters
    scheduled = {table.literal_behind(network.flat.names.model.canonical(raw)) for raw in scenario.schedule}
    return tuple(p for p in table.order if table.table[p].parameter.is_literal and p not in scheduled)


def formulas_of(wiring: Wiring) -> Formulas:
    """Return the coefficients of a wiring as formulas.

    A symbol is offered where the formulas give what the network itself gives after it has moved, and tables stay as they are: a table that
    was made from a parameter, or a branch that it decides, has no formula.

    Parameters
    ----------
    wiring : Wiring     Without eliminated nodes, its parameters free.
    """
    own = wiring.assemble(gradients=False)
    values = {f"parameter {p}": value_of(own.numbers.values[p]) for p in wiring.parameters}
    constant = [b for b in wiring.network.boundaries if isinstance(wiring.signals[f"boundary {b}"], Constant)]
    values |= {f"boundary {b}": value_of(own.offsets[b]) for b in constant}
    offered, refused = dict(values), {}
    if not _holds(wiring, own, values, offered, tuple(values)):
        offered = {}
        for name in values:
            if _holds(wiring, own, values, {**offered, name: values[name]}, (name,)):
                offered[name] = values[name]
            elif _acts(wiring, own, values, name):
                refused[name] = "tables or branches follow it"
    coefficients = _made(wiring, own, offered)
    used = {path for c in coefficients if isinstance(c, Formula) for path in c.paths()}
    symbols = [Symbol(name, start) for name, start in offered.items() if name in used]
    loads = {n.removeprefix("load "): s.value for n, s in wiring.signals.items() if n.startswith("load ") and isinstance(s, Constant)}
    coefficients = _with_loads(wiring, coefficients, loads)
    used = {path for c in coefficients if isinstance(c, Formula) for path in c.paths()}
    symbols += [Symbol(f"load {path}", start) for path, start in loads.items() if f"load {path}" in used]
    return Formulas(own, tuple(symbols), tuple(coefficients), refused)


def _plain(name: str) -> str:
    """Return what the wiring calls a symbol."""
    return name.partition(" ")[2]


def _made(wiring: Wiring, own: Assembled, offered: Mapping[str, float]) -> list[Formula | float]:
    """Return the coefficients with a formula over every symbol that is offered."""
    given: dict[str, Any] = {_plain(n): named(n, v) for n, v in offered.items()}
    return [c if isinstance(c, Formula) else value_of(c) for c in wiring.every(wiring.assembled_at(given), given)]


def _holds(wiring: Wiring, own: Assembled, values: Mapping[str, float], offered: Mapping[str, float], moved: Sequence[str]) -> bool:
    """Return whether formulas over `offered` give the network's own numbers at values that are `moved`, and tables stay."""
    try:
        coefficients = _made(wiring, own, offered)
    except (ThermidError, ArithmeticError, TypeError, ValueError):
        return False
    seen = False
    for by in MOVES:
        at = {**values, **{n: _moved(wiring, n, values[n], by) for n in moved}}
        found = _network(wiring, {n: at[n] for n in moved})
        if found is None:
            continue
        seen = True
        line = Line(coefficients)
        ours = line.values(at)
        theirs = np.array(found.coefficients)
        if (
            ours.shape != theirs.shape
            or not np.allclose(ours, theirs, rtol=CLOSE, atol=0.0)
            or not _same_tables(own.numbers, found.numbers)
        ):
            return False
    return seen


def _acts(wiring: Wiring, own: Assembled, values: Mapping[str, float], name: str) -> bool:
    """Return whether a symbol changes anything at all, or cannot be changed."""
    for by in MOVES:
        found = _network(wiring, {name: _moved(wiring, name, values[name], by)})
        if found is None or not np.array_equal(found.coefficients, own.coefficients) or not _same_tables(own.numbers, found.numbers):
            return True
    return False


def _network(wiring: Wiring, given: Mapping[str, float]) -> Assembled | None:
    """Return the numbers at some values; None where there are none."""
    try:
        return wiring.assembled_at({_plain(n): v for n, v in given.items()})
    except (ThermidError, ArithmeticError, ValueError):
        return None


def _moved(wiring: Wiring, name: str, value: float, by: float) -> float:
    """Return another value of a symbol, within the bounds that its author gives."""
    if name.startswith("boundary "):
        return value + 20.0 * (by - 1.0)
    given = wiring.network.flat.parameters.table[_plain(name)].parameter
    moved = value * by if value else 0.1 * by
    if given.maximum is not None:
        moved = min(moved, given.maximum)
    return moved if given.minimum is None else max(moved, given.minimum)


def _curves(numbers: Numbers) -> list[Curve | None]:
    """Return the table of every row."""
    return [*(row.curve for row in numbers.conductors), *(row.curve for row in numbers.loads)]


def _same_tables(one: Numbers, other: Numbers) -> bool:
    """Return whether the tables of all rows are the same."""
    for a, b in zip(_curves(one), _curves(other), strict=True):
        if (a is None) != (b is None):
            return False
        if a is not None and b is not None and not (np.array_equal(a.x, b.x) and np.array_equal(a.y, b.y)):
            return False
    return True


def _with_loads(wiring: Wiring, coefficients: Sequence[Formula | float], loads: Mapping[str, float]) -> list[Formula | float]:
    """Return the coefficients, each times the constant signal that multiplies it; loads are symbols."""
    out, names = [], list(wiring.used)
    structure = wiring.structure
    for coefficient, place in zip(coefficients, structure.coefficient_input, strict=True):
        base = structure.driven[place - len(names)].base if place >= len(names) else place
        signal = wiring.signals[names[base]] if base >= 0 else None
        if not isinstance(signal, Constant):
            out.append(coefficient)
            continue
        kind, _, path = names[base].partition(" ")
        symbol: Formula | float = named(f"load {path}", loads[path]) if kind in ("load", "curve") and path in loads else signal.value
        factor = symbol * (symbol - 1.0) if kind == "curve" and isinstance(symbol, Formula) else symbol
        out.append(coefficient * factor)
    return out


class Line:
    """Formulas as one straight line of operations, each written once.

    Parameters
    ----------
    formulas : sequence     Formulas or numbers. [SI]
    """

    def __init__(self, formulas: Sequence[Formula | float]) -> None:
        self.names: dict[str, int] = {}
        self.numbers: dict[float, int] = {}
        self.steps: list[tuple[int, int, int]] = []
        self._known: dict[tuple[int, int, int], int] = {}
        self._made: dict[int, int] = {}
        self._kept = list(formulas)  # identities stay those of these objects
        self.results = [self._of(f) for f in self._kept]

    def _of(self, formula: Formula | float) -> int:
        if not isinstance(formula, Formula):
            return self._step(OPERATIONS.index("number"), self.numbers.setdefault(float(formula), len(self.numbers)), 0)
        if id(formula) in self._made:
            return self._made[id(formula)]
        if formula.operator == "name":
            at = self._step(OPERATIONS.index("name"), self.names.setdefault(formula.parts[0], len(self.names)), 0)
        elif formula.operator == "number":
            at = self._of(formula.value)
        else:
            parts = [self._of(part) for part in formula.parts]
            at = self._step(OPERATIONS.index(formula.operator), parts[0], parts[1] if len(parts) > 1 else 0)
        self._made[id(formula)] = at
        return at

    def _step(self, operation: int, a: int, b: int) -> int:
        if (operation, a, b) not in self._known:
            self._known[operation, a, b] = len(self.steps)
            self.steps.append((operation, a, b))
        return self._known[operation, a, b]

    def values(self, at: Mapping[str, float]) -> Any:
        """Return the numbers (formulas,) at values of the names. [SI]"""
        names, numbers, out = list(self.names), list(self.numbers), np.empty(len(self.steps))
        with np.errstate(all="ignore"):
            for k, (operation, a, b) in enumerate(self.steps):
                word = OPERATIONS[operation]
                if word in ("number", "name"):
                    out[k] = numbers[a] if word == "number" else at[names[a]]
                elif word == "neg":
                    out[k] = -out[a]
                else:
                    out[k] = COMPUTE[word](out[a], out[b])
        return out[self.results]


OPERATIONS = ("number", "name", "+", "-", "*", "/", "neg", "**")
"""In the order of Program::Operation of the library."""
COMPUTE = {"+": np.add, "-": np.subtract, "*": np.multiply, "/": np.divide, "**": np.power}
