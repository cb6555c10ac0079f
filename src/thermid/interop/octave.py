"""Models as functions for Octave and MATLAB: one file that holds its parameters, its equations and a driver, in the style of Fig. 20."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Sequence
from importlib.metadata import version

from thermid.base.units import ICE_POINT
from thermid.interop._wired import (
    Text,
    Wired,
    Writer,
    conductance_text,
    exported,
    file_and_name,
    identifiers,
    number_text,
    one_line,
    refuse_crooked,
    resting,
    table_points,
    wired,
)
from thermid.model.tree import Constant, Curve, Drawn, Model, Sine, TableSignal
from thermid.simulation.runs import ConductorRow, Scenario

FUNCTION_NAMES = ("parameters", "derived", "initial", "derivatives")
"""Names of the functions in the file."""
KEYWORDS = frozenset(
    "break case catch classdef continue do else elseif end for function global if otherwise parfor persistent return spmd switch try "
    "until unwind_protect while end_try_catch endfor endfunction endif endswitch endwhile".split()
)
DEFAULT_INSTANTS = 301
_WORDS_A_LINE = 8


def to_octave(model: Model, scenario: Scenario, path: str | os.PathLike[str] | None = None, *, name: str = "") -> str:
    """Return a model in a scenario as the text of one function file for Octave or MATLAB.

    The file needs nothing else: parameters by name, inputs as functions of time, the derivatives, the start and a driver that calls
    ode15s. Everything is written with conductances, so that an open path is a zero and not a NaN.

    Parameters
    ----------
    model, scenario     As in `simulate`.
    path : path         Where to write it too; the function is then called as the file.
    name : str          Name of the function; by default that of the file, or the model's title.

    Raises
    ------
    DeckError       When a law or a load cannot be written, or the name is none for a function.
    ScenarioError   When the scenario does not fit the model or follows a schedule.
    """
    target, called = file_and_name(path, name, model.title, "a function", {*KEYWORDS, *FUNCTION_NAMES})
    w = wired(model, scenario, Writer("Octave", gas=True, open_tables=True))
    refuse_crooked(w, "Octave")
    return exported(w, _Writer(w, called).lines(), target, "%")


HEAD = f"""\
function [t, T, names] = {{name}}(t, p)
% {{name}}: temperatures of the thermal model '{{model}}' in the scenario '{{scenario}}'.
%
%   [t, T, names] = {{name}}()    at {DEFAULT_INSTANTS} instants from 0 to {{end}} s
%   [t, T] = {{name}}(t)          at the instants t [s], which increase and are not below 0
%   p = {{name}}('parameters')    the values [SI], to be changed and given back:
%   [t, T] = {{name}}([], p)
%
% Columns of T [degC]: {{nodes}}.{{massless}}
% Written by thermid {{version}}; for Octave and MATLAB."""
DRIVER = f"""\
  names = {{{{{{names}}}}}};
  if nargin > 0 && ischar(t)
    t = parameters();
    return
  end
  if nargin < 1 || isempty(t), t = linspace(0, {{end}}, {DEFAULT_INSTANTS}); end
  if nargin < 2, p = parameters(); end
  p = derived(p);
  options = odeset('RelTol', 1e-10, 'AbsTol', 1e-10);
  t = t(:);
  state = initial();
  T = repmat(state', numel(t), 1);
  % The run is cut where an input jumps or bends, so that no step reaches across.
{{breaks}}
  edges = unique([0; breaks(breaks < t(end)); t(end)]);
  for k = 1:numel(edges) - 1
    rows = find(t > edges(k) & t <= edges(k + 1));
    asked = unique([edges(k); (edges(k) + edges(k + 1))/2; t(rows); edges(k + 1)]);
    last = edges(k + 1) - 1e-9*(edges(k + 1) - edges(k));
    options = odeset(options, 'InitialSlope', derivatives(edges(k), state, p));
    [~, found] = ode15s(@(s, x) derivatives(min(s, last), x, p), asked, state, options);
    [~, where] = ismember(t(rows), asked);
    T(rows, :) = found(where, :);
    state = found(end, :)';
  end
  T = T - {ICE_POINT};
end"""
VALUES = """
function p = parameters()
  % Values. [SI]
{parameters}end

function p = derived(p)
  % Values that follow from others. [SI]
{derived}end

function T = initial()
  % Temperatures at the start. [K]
{initial}
end"""
LINES = (
    "",
    "function v = lines(u, table)",
    "  % Straight lines between the points of a table; outside, its last value, or none where it is refused.",
    "  [x, y, held] = table();",
    "  if held, u = min(max(u, x(1)), x(end)); end",
    "  v = interp1(x, y, u);",
    "end",
)
AREA = (
    "",
    "function v = area(u, table)",
    "  % Integral of a table of straight lines from its first point on.",
    "  [x, y, held] = table();",
    "  k = min(max(sum(u >= x), 1), numel(x) - 1);",
    "  s = u - x(k);",
    "  v = sum(diff(x(1:k)).*(y(1:k - 1) + y(2:k)))/2 + s*(y(k) + s*(y(k + 1) - y(k))/(x(k + 1) - x(k))/2);",
    "  if ~held && (u < x(1) || u > x(end)), v = NaN; end",
    "end",
)


class _Writer:
    """Writes one file."""

    def __init__(self, w: Wired, called: str) -> None:
        self.w, self.called = w, called
        short = identifiers(parameter.path for parameter in w.parameters)
        self.fields = {p: f"{n}_" if n in KEYWORDS else n for p, n in short.items()}
        self.nodes = identifiers((*w.network.nodes, *w.network.boundaries))
        self.rows = identifiers(label for label, _ in w.conductors)
        self.curves: dict[Curve, int] = {}
        self.text = Text(lambda path: f"p.{self.fields[path]}")

    def lines(self) -> Iterator[str]:
        """Yield the lines of the file."""
        w = self.w
        fields = [(self.fields[p.path], p) for p in w.parameters]
        yield "\n".join((HEAD, DRIVER, VALUES)).format(
            name=self.called,
            model=one_line(w.network.title),
            scenario=one_line(w.scenario.title),
            end=number_text(w.scenario.seconds),
            nodes=", ".join(w.massive),
            massless=f"\n% Without mass, and eliminated: {', '.join(w.massless)}." if w.massless else "",
            version=version("thermid"),
            names=", ".join("'" + n.replace("'", "''") + "'" for n in w.massive),
            breaks="\n".join(_listed("  breaks = ", w.breaks(), column=True)),
            parameters="".join(
                f"  p.{word} = {number_text(p.value)};  % {one_line(f'[{p.unit}] {p.note}')}\n" for word, p in fields if p.formula is None
            ),
            derived="".join(f"  p.{word} = {self.text.text_of(p.formula)};  % [{p.unit}]\n" for word, p in fields if p.formula is not None),
            initial="\n".join(_listed("  T = ", [w.initial[n] for n in w.massive], column=True)),
        )
        yield from self._derivatives()
        for name, signal, what in self._signals():
            yield from ("", f"function y = {name}(t)", f"  % {what}")
            yield from (f"  {line}" for line in _signal_lines(signal))
            yield "end"
        yield from self._tables()

    def _derivatives(self) -> Iterator[str]:
        """Yield the function of the differential equations."""
        w, name = self.w, self.nodes
        yield from ("", "function dTdt = derivatives(t, T, p)", "  % Nodes. [K]")
        yield from (f"  T_{name[node]} = T({k});" for k, node in enumerate(w.massive, 1))
        yield "  % Inputs. [K] and [W]"
        yield from (f"  T_{name[b]} = boundary_{name[b]}(t);" for b in w.boundaries)
        heat: dict[str, list[str]] = {}
        for k, source in enumerate(w.sources, 1):
            power = self.text.text_of(source.power, 2)
            if source.signal != Constant(1.0):
                power = f"input_{k}(t)" if power == "1" else f"{power}*input_{k}(t)"
            if source.curve is not None:
                power = f"{power}*{self._read(source.curve, f'T_{name[source.sensor]}')}"
            yield f"  Q_{k} = {power};  % {source.load}"
            heat.setdefault(source.node, []).append(f"Q_{k}")
        yield "  % Conductances. [W/K]"
        yield from (f"  G_{self.rows[label]} = {self._conductance(row)};" for label, row in w.conductors if row.kernel.linear)
        yield from self._massless(heat)
        yield from (f"  G_{self.rows[label]} = {self._conductance(row)};" for label, row in w.conductors if not row.kernel.linear)
        yield "  % Heat flows. [W]"
        for label, row in w.conductors:
            a, b = (name[end] for end in row.ends)
            if row.form == "potential" and row.curve is not None:
                areas = (self._read(row.curve, f"T_{end}", "area") for end in (a, b))
                yield f"  q_{self.rows[label]} = G_{self.rows[label]}*({' - '.join(areas)});"
                continue
            yield f"  q_{self.rows[label]} = G_{self.rows[label]}*(T_{a} - T_{b});"
        yield "  % Differential equations. [K/s]"
        capacities = {n: self.text.text_of(w.capacitances[n] or 0.0) for n in w.massive}
        yield from (f"  dT_{name[n]} = ({self._balance(n, heat)})/({capacity});" for n, capacity in capacities.items())
        yield from _wrapped("  dTdt = [", [f"dT_{name[n]}" for n in w.massive], "; ", "];")
        yield "end"

    def _conductance(self, row: ConductorRow) -> str:
        """Return the conductance of a row as a formula of the temperatures. [W/K]"""
        coefficients = [self.text.text_of(c, 2) for c in row.coefficients]  # type: ignore[arg-type]
        a, b = (f"T_{self.nodes[end]}" for end in row.ends)
        text = conductance_text(row, coefficients, a, b, self._read)
        return f"{text}*{_gas(row.signal)}(t)" if row.signal else text

    def _read(self, curve: Curve, at: str, what: str = "lines") -> str:
        """Return the text that reads a table, or its integral (`what` is 'area'), and keep the table for the end of the file."""
        self.curves.setdefault(curve, len(self.curves) + 1)
        return f"{what}({at}, @table_{self.curves[curve]})"

    def _tables(self) -> Iterator[str]:
        """Yield the tables, and the functions that read them: straight lines between their points."""
        for curve, k in self.curves.items():
            x, y, held = table_points(curve)
            yield from (
                "",
                f"function [x, y, held] = table_{k}()",
                f"  % Over {'a' if curve.over == 'difference' else 'the'} {curve.over}. [K] and [SI]",
            )
            yield from _listed("  x = ", x, column=True)
            yield from _listed("  y = ", y, column=True)
            yield from (f"  held = {str(held).lower()};", "end")
        if self.curves:
            yield from (*LINES, *AREA)

    def _balance(self, node: str, heat: dict[str, list[str]]) -> str:
        """Return the heat into a node."""
        terms = [f" + {q}" for q in heat.get(node, [])]
        for label, row in self.w.conductors:
            if row.ends[1] == node:
                terms.append(f" + q_{self.rows[label]}")
            elif row.ends[0] == node and row.form != "flow":
                terms.append(f" - q_{self.rows[label]}")
        return "".join(terms).removeprefix(" + ").strip() or "0"

    def _massless(self, heat: dict[str, list[str]]) -> Iterator[str]:
        """Yield the temperatures of massless nodes: means weighted by conductance, together where they are joined to one another."""
        if not self.w.massless:
            return
        yield "  % Nodes without mass: the heat in is the heat out. [K]"
        for group in _groups(self.w):
            terms = {node: self._mean(node, heat) for node in group}
            if len(group) == 1:
                (total, known_heat, _) = terms[group[0]]
                yield f"  T_{self.nodes[group[0]]} = ({known_heat})/({total});"
                continue
            yield f"  M = zeros({len(group)}); r = zeros({len(group)}, 1);"
            for i, node in enumerate(group, 1):
                total, known_heat, others = terms[node]
                yield f"  M({i}, {i}) = {total}; r({i}) = {known_heat or '0'};"
                for j, other in enumerate(group, 1):
                    if other in others:
                        yield f"  M({i}, {j}) = -({others[other]});"
            yield "  m = M\\r;"
            for i, node in enumerate(group, 1):
                yield f"  T_{self.nodes[node]} = m({i});"

    def _mean(self, node: str, heat: dict[str, list[str]]) -> tuple[str, str, dict[str, str]]:
        """Return sum of conductances, given heat, and massless neighbour -> conductance."""
        totals, known_heat, others = [], list(heat.get(node, [])), {}  # type: list[str], list[str], dict[str, str]
        for label, row in self.w.conductors:
            if node not in row.ends or (row.form == "flow" and row.ends[0] == node):
                continue
            other = row.ends[1] if row.ends[0] == node else row.ends[0]
            g = f"G_{self.rows[label]}"
            totals.append(g)
            if other in self.w.massless:
                others[other] = f"{others[other]} + {g}" if other in others else g
            else:
                known_heat.append(f"{g}*T_{self.nodes[other]}")
        return " + ".join(totals), " + ".join(known_heat), others

    def _signals(self) -> Iterator[tuple[str, Drawn, str]]:
        """Yield name, signal and meaning of everything that follows time: boundaries, drives of loads, presence of gases."""
        for boundary, signal in self.w.boundaries.items():
            yield f"boundary_{self.nodes[boundary]}", signal, f"Temperature of '{boundary}'. [K]"
        for k, source in enumerate(self.w.sources, 1):
            if source.signal != Constant(1.0):
                yield f"input_{k}", source.signal, f"What drives '{source.load}'."
        for row_signal in dict.fromkeys(row.signal for _, row in self.w.conductors if row.signal):
            yield _gas(row_signal), self.w.gas[row_signal], f"Presence, '{row_signal}'. [-]"


def _gas(signal: str) -> str:
    """Return the name in Octave of the signal of a gas."""
    return re.sub(r"\W", "_", signal.replace("*", "any"))


def _groups(w: Wired) -> list[list[str]]:
    """Return the massless nodes, those that are joined to one another together."""
    groups: list[list[str]] = []
    for node in w.massless:
        joined = {e for _, row in w.conductors if node in row.ends for e in row.ends if e in w.massless} | {node}
        touched = [g for g in groups if joined & set(g)]
        merged = [*dict.fromkeys([n for g in touched for n in g] + [node])]
        groups = [g for g in groups if g not in touched] + [merged]
    return [[n for n in w.massless if n in g] for g in groups]


def _signal_lines(signal: Drawn) -> Iterator[str]:
    """Yield the body of a function of time."""
    if isinstance(signal, Sine):
        angle = f"2*pi*t/{number_text(signal.period)} + {number_text(signal.phase)}"
        yield f"y = {number_text(signal.mean)} + {number_text(signal.amplitude)}*sin({angle});"
    elif (value := resting(signal)) is not None:
        yield f"y = {number_text(value)};"
    elif isinstance(signal, TableSignal):
        yield from _listed("x = ", signal.times.tolist())
        yield from _listed("v = ", signal.values.tolist())
        yield f"y = interp1(x, v, min(max(t, x(1)), x(end)), '{'previous' if signal.hold else 'linear'}');"


def _listed(start: str, numbers: Sequence[float], column: bool = False) -> Iterator[str]:
    """Yield the lines of a row or column of numbers; an empty one is ``zeros(0, 1)``."""
    if not numbers:
        yield f"{start}zeros(0, 1);"
        return
    yield from _wrapped(f"{start}[", [number_text(float(n)) for n in numbers], "; " if column else " ", "];")


def _wrapped(start: str, words: Sequence[str], between: str, end: str) -> Iterator[str]:
    """Yield a list over as many lines as it needs."""
    rows = [words[k : k + _WORDS_A_LINE] for k in range(0, len(words), _WORDS_A_LINE)]
    for k, row in enumerate(rows):
        last = k == len(rows) - 1
        head = start if k == 0 else "    "
        yield f"{head}{between.join(row)}{end if last else between.rstrip() + ' ...'}"
