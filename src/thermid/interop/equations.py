"""The equations of a linear network as symbols: massless nodes eliminated, matrix form, steady state; as LaTeX and as code.

Needs sympy (``pip install 'thermid[symbolic]'``), which is imported when equations are asked for.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from typing import Any

from thermid.base.errors import DeckError, NameNotFoundError, ThermidError, optional, refuse_unknown
from thermid.base.results import Shown
from thermid.base.units import value_of
from thermid.interop._wired import identifiers
from thermid.model.tree import Model
from thermid.simulation.runs import Network, compile_network

Expr = Any
"""An expression of sympy, which is an optional package."""
MOST_STATES = 6
"""Steady states of more nodes are quotients of polynomials that nobody reads."""


@dataclass(frozen=True, eq=False)
class Equations(Shown):
    """The state equations of a linear network, ``C dT/dt = heat``.

    Parameters
    ----------
    title : str             The model's.
    states : tuple          Symbols of the temperatures with a capacitance, in the network's order.
    capacitances : tuple    Symbols of their capacitances, in order.
    inputs : tuple          Symbols of boundary temperatures and powers.
    heat : tuple            Heat into each state by conductor, massless nodes eliminated: the right sides of Eq. 4. [W]
    auxiliaries : dict      Symbol -> expression of what `heat` uses as an abbreviation, such as Delta.
    massless : dict         Symbol of a massless temperature -> expression over states, inputs, abbreviations and those before it.
    symbols : dict          Symbol's name -> what it stands for: a path of the model.
    values : dict           Name of a capacitance or resistance -> its number in the model; infinite for an open path. [SI]

    Notes
    -----
    In resistances, as the source document prints them: with an open path (an infinite resistance) the abbreviations are not numbers.
    `to_octave` and `simulate` work with conductances, where it is a zero.
    """

    title: str
    states: tuple[Expr, ...]
    capacitances: tuple[Expr, ...]
    inputs: tuple[Expr, ...]
    heat: tuple[Expr, ...]
    auxiliaries: Mapping[Expr, Expr]
    massless: Mapping[Expr, Expr]
    symbols: Mapping[str, str]
    values: Mapping[str, float]

    @cached_property
    def rates(self) -> tuple[Expr, ...]:
        """The right sides of dT/dt = A T + b, with abbreviations. [K/s]"""
        return tuple(q / c for q, c in zip(self.heat, self.capacitances, strict=True))

    @cached_property
    def matrix(self) -> Expr:
        """The matrix A of Eq. 5, a sympy Matrix (states, states). [1/s]"""
        import sympy

        # each rate is linear in every state, so its derivative is the coefficient
        return sympy.Matrix([[rate.diff(t) for t in self.states] for rate in self.rates])

    @cached_property
    def vector(self) -> Expr:
        """The vector b of Eq. 5, a sympy Matrix (states, 1). [K/s]"""
        import sympy

        zero = dict.fromkeys(self.states, 0)
        return sympy.Matrix([rate.subs(zero) for rate in self.rates])

    @cached_property
    def steady(self) -> Mapping[Expr, Expr]:
        """State -> steady temperature under constant inputs (Eq. 6). [K]

        Raises
        ------
        ThermidError   When there are more than six states, or no steady state.
        """
        import sympy

        if len(self.states) > MOST_STATES:
            raise ThermidError(
                f"{self.title} has {len(self.states)} states; a symbolic steady state is limited to {MOST_STATES}. Use steady() for "
                "numbers.",
                self.title,
                code="model.element-not-supported",
            )
        solutions = sympy.solve([self.expanded(q) for q in self.heat], self.states, dict=True)
        if not solutions or set(solutions[0]) != set(self.states):
            raise ThermidError(
                "no steady state exists: a part has no path to a boundary. Connect it.", self.title, code="run.no-steady-state"
            )
        return {t: sympy.factor(solutions[0][t]) for t in self.states}

    def expanded(self, expression: Expr) -> Expr:
        """Return an expression without abbreviations."""
        for symbol, meaning in reversed(list(self.auxiliaries.items())):
            expression = expression.subs(symbol, meaning)
        return expression

    def latex(self) -> str:
        """Return the state equations, their abbreviations and the massless temperatures as LaTeX, in an align environment."""
        import sympy

        def shown(expression: Expr) -> str:
            """Return an expression in the form asked for: LaTeX or MathML."""
            return str(sympy.latex(expression, order="none"))

        rows = [
            rf"{shown(c)} \frac{{d{shown(t)}}}{{dt}} &= {shown(q)}"
            for t, c, q in zip(self.states, self.capacitances, self.heat, strict=True)
        ]
        rows += [f"{shown(s)} &= {shown(e)}" for s, e in (*self.auxiliaries.items(), *self.massless.items())]
        return "\\begin{align}\n  " + " \\\\\n  ".join(rows) + "\n\\end{align}\n"

    def mathml(self) -> tuple[str, ...]:
        """Return the same lines as MathML, which browsers draw without help."""
        from sympy import mathml

        def shown(expression: Expr) -> str:
            """Return an expression in the form asked for: LaTeX or MathML."""
            return str(mathml(expression, printer="presentation", order="none"))

        def rate(c: Expr, t: Expr) -> str:
            """Return c dT/dt in MathML."""
            return f"{shown(c)}<mfrac><mrow><mi>d</mi>{shown(t)}</mrow><mrow><mi>d</mi><mi>t</mi></mrow></mfrac>"

        sides = [(rate(c, t), shown(q)) for t, c, q in zip(self.states, self.capacitances, self.heat, strict=True)]
        sides += [(shown(s), shown(e)) for s, e in (*self.auxiliaries.items(), *self.massless.items())]
        return tuple(f'<math display="block"><mrow>{lhs}<mo>=</mo>{right}</mrow></math>' for lhs, right in sides)

    def python(self, name: str = "derivatives") -> str:
        """Return the state equations as a Python function of time, temperatures and a dictionary of values."""
        from sympy import pycode

        states = ", ".join(map(str, self.states))
        lines = [f"def {name}(t, T, p):", f'    """Rates of the states {states}. [K/s]"""']
        lines.append(f"    {states} = T" if len(self.states) > 1 else f"    ({states},) = T")
        lines += [f'    {s} = p["{s}"]' for s in self.values]
        lines += [f'    {s} = p["{s}"](t)' for s in self.inputs]
        lines += [f"    {s} = {pycode(e)}" for s, e in self.auxiliaries.items()]
        lines += ["    return [", *(f"        {pycode(r)}," for r in self.rates), "    ]"]
        return "\n".join(lines) + "\n"

    def octave(self, name: str = "derivatives") -> str:
        """Return the state equations as an Octave or MATLAB function, in the form of Fig. 20: inputs are ``p.<name>_fun(t)``."""
        from sympy import octave_code

        def scalar(expression: Expr) -> str:
            """Return an expression in Octave with operators of scalars."""
            return re.sub(r"\.([*/^])", r"\1", str(octave_code(expression)))

        lines = [f"function dTdt = {name}(t, T, p)"]
        lines += [f"  {s} = T({k});" for k, s in enumerate(self.states, 1)]
        lines += [f"  {s} = p.{s};" for s in self.values]
        lines += [f"  {s} = p.{s}_fun(t);" for s in self.inputs]
        lines += [f"  {s} = {scalar(e)};" for s, e in self.auxiliaries.items()]
        lines += [f"  d{s}dt = {scalar(r)};" for s, r in zip(self.states, self.rates, strict=True)]
        lines += [f"  dTdt = [{'; '.join(f'd{s}dt' for s in self.states)}];", "end"]
        return "\n".join(lines) + "\n"

    def __str__(self) -> str:
        """The equations as plain text, with what each symbol stands for."""
        from sympy import sstr

        lines = [f"{self.title}"]
        lines += [f"  {c} d{t}/dt = {sstr(q, order='none')}" for t, c, q in zip(self.states, self.capacitances, self.heat, strict=True)]
        lines += [f"  {s} = {sstr(e, order='none')}" for s, e in (*self.auxiliaries.items(), *self.massless.items())]
        return "\n".join([*lines, *(f"  {n}: {what}" for n, what in self.symbols.items())])


def equations(model: Model, names: Mapping[str, str] | None = None) -> Equations:
    """Return the state equations of a linear model as symbols, derived from its network.

    Every conductor is a resistance ``R_<path>``, every node a ``T_<path>`` with a ``C_<path>``, every load a ``Q_<path>``.

    Parameters
    ----------
    model : Model   What the hardware is.
    names : dict    Path of a conductor, node, boundary or load -> the symbol to use, without its ``C_``: ``{"stack.gap": "R_cn3"}``.
                    The capacitance of a node that is called ``T_x`` is ``C_x``.

    Raises
    ------
    MissingExtraError   When sympy is not installed.
    DeckError           When a law is not linear.
    NameNotFoundError   When a path of `names` does not exist.
    """
    sympy = optional("sympy", "a derivation of equations")
    network = compile_network(model)
    return _Derivation(sympy, network, _Symbols(network, dict(names or {}), model)).result()


class _Symbols:
    """Path -> the name of its symbol."""

    def __init__(self, network: Network, names: dict[str, str], model: Model) -> None:
        numbers = network.numbers()
        rows = [row.name for row in numbers.conductors]
        places = [*network.nodes, *network.boundaries]
        loads = [row.name for row in numbers.loads]
        names_stated = {}
        for raw, name in names.items():
            path = model.canonical(raw)
            refuse_unknown([path], (*rows, *places, *loads), model.title, f"no conductor, node or load '{raw}' to name.", NameNotFoundError)
            if not re.fullmatch(r"[A-Za-z]\w*", name):
                raise ThermidError(
                    f"'{name}' is not a valid symbol. Use letters, digits and _, beginning with a letter.",
                    model.title,
                    code="name.not-valid",
                )
            names_stated[path] = name
        short = identifiers(dict.fromkeys((*rows, *places, *loads)))
        self.resistance = {r: names_stated.get(r, f"R_{short[r]}") for r in rows}
        self.temperature = {n: names_stated.get(n, f"T_{short[n]}") for n in places}
        self.power = {q: names_stated.get(q, f"Q_{short[q]}") for q in loads}
        self.capacitance = {
            n: f"C_{re.sub(r'^T_?', '', t)}" for n, t in self.temperature.items() if numbers.capacitances.get(n) is not None
        }
        every = [*self.resistance.values(), *self.temperature.values(), *self.power.values(), *self.capacitance.values(), "Delta"]
        twice = next((name for name in every if every.count(name) > 1), "")
        if twice:
            raise ThermidError(
                f"the symbol '{twice}' would have two meanings. Choose another name for one of them.", model.title, code="name.taken"
            )


class _Derivation:
    """From rows to equations: each massless node becomes a mesh between its neighbours, as a printed Delta."""

    def __init__(self, sympy: Any, network: Network, names: _Symbols) -> None:
        self.sympy, self.network, self.names = sympy, network, names
        self.numbers = network.numbers()
        crooked = [(r.name, r.form) for r in self.numbers.conductors if r.form != "linear" or r.signal]
        crooked += [(r.name, r.control or r.form) for r in self.numbers.loads if not r.fixed]
        crooked += [(node, "a specific heat that changes") for node in network.stores]
        crooked += [(name, "a control") for name in network.controls]
        if crooked:
            raise DeckError(
                f"'{crooked[0][0]}' is not a linear, two-way law ({crooked[0][1]}), so it has no symbolic equation. Use a linear "
                "conductor, or steady() for numbers.",
                network.title,
                code="model.element-not-supported",
            )
        make = self._symbol
        self.symbols: dict[str, str] = {}
        self.t = {n: make(names.temperature[n], f"temperature of {n} [K]") for n in (*network.nodes, *network.boundaries)}
        self.c = {n: make(names.capacitance[n], f"capacitance of {n} [J/K]") for n in network.nodes if n in names.capacitance}
        self.r: dict[str, Expr] = {}
        self.arms: dict[frozenset[str], list[Expr]] = {}
        for row in self.numbers.conductors:
            self.r[row.name] = make(names.resistance[row.name], f"resistance of {row.name} [K/W]")
            if row.ends[0] != row.ends[1]:
                self.arms.setdefault(frozenset(row.ends), []).append(self.r[row.name])
        self.q: dict[str, Expr] = dict.fromkeys(network.nodes, sympy.Integer(0))
        self.powers: list[Expr] = []
        for load in self.numbers.loads:
            if load.node in self.q and load.signal.startswith("load "):
                symbol = make(names.power[load.name], f"power of {load.name} [W]")
                self.powers.append(symbol)
                self.q[load.node] += symbol
        self.auxiliaries: dict[Expr, Expr] = {}
        self.recovered: list[tuple[str, Expr]] = []

    def _symbol(self, name: str, what: str) -> Expr:
        """Return the symbol of a name, whose meaning is noted for the legend."""
        self.symbols[name] = what
        return self.sympy.Symbol(name)

    def result(self) -> Equations:
        """Return the equations."""
        massless = [n for n in self.network.nodes if n not in self.c]
        for node in massless:
            self._eliminate(node, len(massless) > 1)
        states = [n for n in self.network.nodes if n in self.c]
        heat = tuple(self._heat(n) for n in states)
        recovered = {self.t[n]: e for n, e in reversed(self.recovered)}
        return Equations(
            self.network.title,
            tuple(self.t[n] for n in states),
            tuple(self.c[n] for n in states),
            (*(self.t[b] for b in self.network.boundaries), *self.powers),
            heat,
            self.auxiliaries,
            recovered,
            self.symbols,
            self._values(),
        )

    def _values(self) -> dict[str, float]:
        """Return the numbers of capacitances and resistances."""
        numbers = {str(self.c[n]): value_of(c) for n in self.c if (c := self.numbers.capacitances[n]) is not None}
        for row in self.numbers.conductors:
            g = value_of(row.coefficients[0])
            numbers[str(self.r[row.name])] = 1.0 / g if g else math.inf
        return numbers

    def _eliminate(self, node: str, several: bool) -> None:
        """Replace a massless node by a mesh between its neighbours; its own heat goes to them by the same weights."""
        sympy = self.sympy
        star = {}
        for joined, arms in self.arms.items():
            if node in joined:
                (end,) = joined - {node}
                arm = arms[0] if len(arms) == 1 else 1 / sum(1 / a for a in arms)
                star[end] = self._defined(arm, f"R_{self._word(node)}_{self._word(end)}", f"resistance between {node} and {end} [K/W]")
        if not star:
            raise DeckError(
                f"the massless node '{node}' has no conductance to any node, so its temperature is undefined. Connect it.",
                self.network.title,
                code="model.massless-undefined",
            )
        self.arms = {pair: arms for pair, arms in self.arms.items() if node not in pair}
        ends = list(star)
        product = {k: sympy.Mul(*(star[e] for e in ends if e not in k)) for k in combinations(ends, 2)}
        single = {e: sympy.Mul(*(star[o] for o in ends if o != e)) for e in ends}
        delta = sympy.Integer(1)
        if len(ends) > 1:
            name = f"Delta_{self._word(node)}" if several else "Delta"
            delta = self._abbreviated(sympy.Add(*(single[e] for e in ends)), name, f"abbreviation from the elimination of {node}")
        for pair, above in product.items():
            # R between two neighbours: Delta over the product of the other arms
            self.arms.setdefault(frozenset(pair), []).append(delta / above)
        own_heat = self._defined(self.q.pop(node), f"Q_{self._word(node)}", f"heat that reaches {node} [W]")
        everything = sympy.Mul(*star.values())
        for end in ends:
            if end in self.q:
                self.q[end] += own_heat * single[end] / delta
        mean = sympy.Add(*(single[e] * self.t[e] for e in ends))
        self.recovered.append((node, (mean + own_heat * everything) / delta))

    def _word(self, node: str) -> str:
        """Return the symbol of a node's temperature without its T."""
        return re.sub(r"^T_?", "", self.names.temperature[node])

    def _defined(self, expression: Expr, name: str, what: str) -> Expr:
        """Return a symbol for what holds abbreviations, so that eliminations one after the other do not put them into each other."""
        if expression.is_Symbol or not expression.free_symbols & self.auxiliaries.keys():
            return expression
        while name in self.symbols:
            name += "_"
        return self._abbreviated(expression, name, what)

    def _abbreviated(self, expression: Expr, name: str, what: str) -> Expr:
        """Return the symbol that abbreviates an expression."""
        symbol = self._symbol(name, what)
        self.auxiliaries[symbol] = expression
        return symbol

    def _heat(self, node: str) -> Expr:
        """Return the heat into a node: powers, then what each resistance carries away."""
        total = self.q[node]
        for pair, arms in self.arms.items():
            if node in pair:
                (other,) = pair - {node}
                for arm in arms:
                    total -= (self.t[node] - self.t[other]) / arm
        return total
