"""Models as Modelica packages: a network of HeatPorts on the Modelica Standard Library or on a few parts of its own, and its scenario."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from importlib.metadata import version

from thermid.base.errors import DeckError, ScenarioError, refuse_unknown
from thermid.base.units import STEFAN_BOLTZMANN
from thermid.interop._wired import (
    Formula,
    HeatSource,
    Text,
    Wired,
    Writer,
    distinct,
    exported,
    file_and_name,
    identifiers,
    one_line,
    resting,
    table_points,
    wired,
)
from thermid.model.tree import Curve, Drawn, Model, Sine, TableSignal
from thermid.simulation.runs import SMOOTHING, ConductorRow, Scenario

MODELICA = Writer("Modelica", loads=True, schedules=True)
LIBRARIES = {"modelica": "Modelica.Thermal.HeatTransfer", "none": "Library"}
"""Name of a library -> the package that holds its parts."""
MAX_COURSE_SAMPLES = 500
"""A course of more samples makes an expression that tools do not compile in useful time."""
KEYWORDS = frozenset(
    "algorithm and annotation assert block break class connect connector constant constrainedby der discrete each else elseif elsewhen "
    "encapsulated end enumeration equation expandable extends external false final flow for function if import impure in initial inner "
    "input loop model not operator or outer output package parameter partial protected public pure record redeclare replaceable return "
    "stream then true type when while within time abs sign sqrt exp log min max Real Integer Boolean String".split()
)
OWN_CONTROLS = """\
  package Library "What the network needs of Modelica.Thermal.HeatTransfer"
    package Interfaces
      connector HeatPort_a "Heat into the part is positive"
        Real T(unit = "K", start = 293.15);
        flow Real Q_flow(unit = "W");
      end HeatPort_a;
      connector HeatPort_b "The same on the other side"
        Real T(unit = "K", start = 293.15);
        flow Real Q_flow(unit = "W");
      end HeatPort_b;
      partial model Element1D "Heat from port_a to port_b, none kept"
        Real Q_flow(unit = "W");
        Real dT(unit = "K");
        HeatPort_a port_a;
        HeatPort_b port_b;
      equation
        dT = port_a.T - port_b.T;
        port_a.Q_flow = Q_flow;
        port_b.Q_flow = -Q_flow;
      end Element1D;
    end Interfaces;
    package Components
      model HeatCapacitor
        parameter Real C(unit = "J/K");
        Real T(unit = "K", start = 293.15);
        Interfaces.HeatPort_a port;
      equation
        T = port.T;
        C*der(T) = port.Q_flow;
      end HeatCapacitor;
      model ThermalConductor
        extends Interfaces.Element1D;
        parameter Real G(unit = "W/K");
      equation
        Q_flow = G*dT;
      end ThermalConductor;
      model BodyRadiation
        extends Interfaces.Element1D;
        parameter Real Gr(unit = "m2");
      equation
        Q_flow = Gr*5.670374419e-08*(port_a.T^4 - port_b.T^4);
      end BodyRadiation;
    end Components;
    package Sources
      model PrescribedTemperature
        input Real T(unit = "K");
        Interfaces.HeatPort_b port;
      equation
        port.T = T;
      end PrescribedTemperature;
      model PrescribedHeatFlow
        input Real Q_flow(unit = "W");
        Interfaces.HeatPort_b port;
      equation
        port.Q_flow = -Q_flow;
      end PrescribedHeatFlow;
    end Sources;
  end Library;
"""
LAWS = """\
  package Laws "Laws that the library does not have"
    model Junction "A node without mass: the heat in is the heat out"
      {library}.Interfaces.HeatPort_a port;
    equation
      port.Q_flow = 0;
    end Junction;
    model PowerLaw "G (dT^2 + s^2)^(n/2) dT, as natural convection"
      extends {library}.Interfaces.Element1D;
      parameter Real G;
      parameter Real n;
    equation
      Q_flow = G*dT*(dT^2 + {smoothing})^(n/2);
    end PowerLaw;
    model VariableConductor "A conductance that follows temperature or time"
      extends {library}.Interfaces.Element1D;
      input Real G(unit = "W/K");
    equation
      Q_flow = G*dT;
    end VariableConductor;
    model VariableFlow "A heat flow that follows temperatures"
      extends {library}.Interfaces.Element1D;
      input Real heat(unit = "W");
    equation
      Q_flow = heat;
    end VariableFlow;
    model Stream "Heat that a stream brings to port_b; port_a keeps its own"
      {library}.Interfaces.HeatPort_a port_a;
      {library}.Interfaces.HeatPort_b port_b;
      input Real G(unit = "W/K");
    equation
      port_a.Q_flow = 0;
      port_b.Q_flow = -G*(port_a.T - port_b.T);
    end Stream;
  end Laws;
"""
RUN = """\
  model Run {title}
    Network network;
{parts}  equation
{equations}  annotation(experiment(StartTime = 0, StopTime = {end}, Tolerance = 1e-8));
  end Run;"""


def to_modelica(
    model: Model, scenario: Scenario, path: str | os.PathLike[str] | None = None, *, name: str = "", library: str = "modelica"
) -> str:
    """Return a model in a scenario as the text of one Modelica package.

    ``Network`` has a HeatPort for each boundary and an input for each load; ``Run`` is it in the scenario. Parts of
    Modelica.Thermal.HeatTransfer are used where it has them; what follows from parameters is a formula.

    Parameters
    ----------
    model, scenario     As in `simulate`.
    path : path         Where to write it too; the package is then called as the file.
    name : str          Name of the package; by default that of the file, or the model's title.
    library : str       ``modelica``, the Standard Library, or ``none``: the package holds the few parts that it needs.

    Raises
    ------
    DeckError       When a law cannot be written, or the name is none for a package.
    ScenarioError   When the scenario does not fit the model, or a course has more than 500 samples.
    """
    target, called = file_and_name(path, name, model.title, "a Modelica package", {*KEYWORDS, "Modelica", "Library", "Laws"})
    refuse_unknown([library], tuple(LIBRARIES), "--library", "there is no library '{}'.{near} There are {known}.", DeckError)
    w = wired(model, scenario, MODELICA)
    return exported(w, _Package(w, called, library).lines(), target, "//")


class _Package:
    """Writes one package."""

    def __init__(self, w: Wired, called: str, library: str) -> None:
        self.w, self.called, self.library = w, called, LIBRARIES[library]
        places = (*w.network.nodes, *w.network.boundaries)
        loads = [f"load_{s.load}" for s in w.sources]
        every = [*places, *(f"row_{label}" for label, _ in w.conductors), *dict.fromkeys(loads), *(f"p_{q.path}" for q in w.parameters)]
        every += [f"at_{path}" for path in w.courses]
        words = {k: f"{v}_" if v in KEYWORDS else v for k, v in identifiers(every).items()}
        self.node = {n: words[n] for n in places}
        self.row = {label: words[f"row_{label}"] for label, _ in w.conductors}
        self.names = {q.path: words[f"p_{q.path}"] for q in w.parameters} | {path: words[f"at_{path}"] for path in w.courses}
        self.load = distinct((words[load] for load in loads), "__")
        self.moving = set(w.courses)
        for q in w.parameters:
            if q.formula is not None and q.formula.paths() & self.moving:
                self.moving.add(q.path)
        self.text = Text(lambda path: self.names[path], number=_number)

    def lines(self) -> Iterator[str]:
        """Yield the lines of the package."""
        w = self.w
        comment = f"{w.network.title}, {w.scenario.title}; written by thermid {version('thermid')}"
        yield f"package {self.called} {_quoted(comment)}"
        if self.library == "Library":
            yield OWN_CONTROLS.rstrip()
        yield LAWS.format(library=self.library, smoothing=_number(SMOOTHING**2)).rstrip()
        yield from self._network()
        yield self._run()
        yield f"end {self.called};"

    def _network(self) -> Iterator[str]:
        """Yield the lines of the model of the network: parameters, inputs, ports, components, connections."""
        w, lib = self.w, self.library
        yield '  model Network "A HeatPort for each boundary, an input for each load and each parameter that follows time"'
        for q in w.parameters:
            kind = "Real" if q.path in self.moving else "parameter Real"
            value = _number(q.value) if q.formula is None else self.text.text_of(q.formula)
            yield f"    {kind} {self.names[q.path]} = {value} {_quoted(f'{q.path} [{q.unit}] {q.note}'.strip())};"
        inputs = {self.names[path]: f"{path}, SI" for path in w.courses}
        inputs |= {f"{name}_input": f"what drives {source.load}" for name, source in zip(self.load, w.sources, strict=True)}
        yield from (f"    input Real {name} {_quoted(what)};" for name, what in inputs.items())
        yield from (f"    {lib}.Interfaces.HeatPort_a {self.node[b]} {_quoted(b)};" for b in w.network.boundaries)
        for n in w.massive:
            start = f"T(start = {_number(w.initial[n])}, fixed = true)"
            yield f"    {lib}.Components.HeatCapacitor {self.node[n]}(C = {self._text_of(w.capacitances[n])}, {start}) {_quoted(n)};"
        yield from (f"    Laws.Junction {self.node[n]} {_quoted(n)};" for n in w.massless)
        equations = []
        for label, row in w.conductors:
            part, more = self._conductor(label, row)
            yield f"    {part} {_quoted(label)};"
            equations += more
        for name, source in zip(self.load, w.sources, strict=True):
            yield f"    {lib}.Sources.PrescribedHeatFlow {name} {_quoted(source.load)};"
            if source.control == "thermostat":
                low = self._text_of(source.settings[0])
                yield f"    Boolean {name}_on(start = {str(self._is_on(source)).lower()}, fixed = true) {_quoted(f'below {low} K')};"
        yield "  equation"
        for label, row in w.conductors:
            a, b = (self._port(end) for end in row.ends)
            yield f"    connect({a}, {self.row[label]}.port_a);"
            yield f"    connect({self.row[label]}.port_b, {b});"
        yield from (f"    {line}" for line in equations)
        for name, source in zip(self.load, w.sources, strict=True):
            yield from (f"    {line}" for line in self._load(name, source))
        yield "  end Network;"

    def _conductor(self, label: str, row: ConductorRow) -> tuple[str, list[str]]:
        """Return the part of a conductor, and the equations of what follows temperature or time in it."""
        name, lib, first = self.row[label], self.library, self._text_of(row.coefficients[0])
        moves = any(isinstance(c, Formula) and c.paths() & self.moving for c in row.coefficients)
        if row.form == "flow":
            return f"Laws.Stream {name}", [f"{name}.G = {first};"]
        if row.form == "linear" and not moves:
            return f"{lib}.Components.ThermalConductor {name}(G = {first})", []
        if row.form == "linear":
            return f"Laws.VariableConductor {name}", [f"{name}.G = {first};"]
        a, b = (f"{self.node[end]}{'' if end in self.w.network.boundaries else '.port'}.T" for end in row.ends)
        if row.form == "radiation" and not moves:
            return f"{lib}.Components.BodyRadiation {name}(Gr = ({first})/{_number(STEFAN_BOLTZMANN)})", []
        if row.form == "radiation":
            return f"Laws.VariableFlow {name}", [f"{name}.heat = ({first})*({a}^4 - {b}^4);"]
        if row.form == "power" and not moves:
            return f"Laws.PowerLaw {name}(G = {first}, n = {self._text_of(row.coefficients[1])})", []
        if row.form == "table" and row.curve is not None:
            at = f"({a} - {b})" if row.curve.over == "difference" else f"({a} + {b})/2"
            return f"Laws.VariableConductor {name}", [f"{name}.G = ({first})*({self._lines(row.curve, at)});"]
        if row.form == "potential" and row.curve is not None:
            areas = (self._lines(row.curve, end, area=True) for end in (a, b))
            return f"Laws.VariableFlow {name}", [f"{name}.heat = ({first})*({' - '.join(f'({x})' for x in areas)});"]
        raise DeckError(
            f"'{label}' follows time in a law that is not written to Modelica: {row.form}.",
            self.w.network.title,
            code="output.not-expressible",
        )

    def _load(self, name: str, source: HeatSource) -> Iterator[str]:
        """Yield the lines of a load with its dependence on temperature."""
        at = f"{self._port(source.sensor or source.node)}.T"
        power = f"{self.text.text_of(source.power, 2)}*{name}_input"
        rest = [self._text_of(c) for c in source.rest]
        if source.form == "polynomial":
            power = f"{power}*(1 + ({at} - {rest[2]})*({rest[0]} + {rest[1]}*({at} - {rest[2]})))"
        elif source.form == "exponential":
            power = f"{power}*exp({rest[0]}*({at} - {rest[1]}))"
        elif source.form == "table" and source.curve is not None:
            power = f"{power}*({self._lines(source.curve, at)})"
        if source.control == "proportional":
            raise DeckError(
                f"the proportional control of '{source.load}' is not written to Modelica.",
                self.w.network.title,
                code="output.not-expressible",
            )
        if source.control == "thermostat":
            watched, low, high = f"{self._port(source.watched)}.T", *(self._text_of(c) for c in source.settings)
            yield f"when {{{watched} <= {low}, {watched} >= {high}}} then"
            yield f"  {name}_on = {watched} <= {low};"
            yield "end when;"
            power = f"(if {name}_on then {power} else 0)"
        yield f"{name}.Q_flow = {power};"
        yield f"connect({name}.port, {self._port(source.node)});"

    def _is_on(self, source: HeatSource) -> bool:
        """Return whether a thermostat is on at the start."""
        w = self.w
        if source.watched in w.initial:
            return w.initial[source.watched] <= float(source.settings[0])
        signal = w.boundaries.get(source.watched)
        if signal is None:
            raise DeckError(
                f"the thermostat of '{source.load}' watches a node without mass, which is not written to Modelica.",
                code="output.not-expressible",
            )
        return signal.mean_over(0.0, 0.0) <= float(source.settings[0])

    def _run(self) -> str:
        """Return the scenario around the network."""
        w, held = self.w, [(self.node[b], b, signal) for b, signal in self.w.boundaries.items()]
        driven = [(f"{name}_input", source.load, source.signal) for name, source in zip(self.load, w.sources, strict=True)]
        driven += [(self.names[path], path, signal) for path, signal in w.courses.items()]
        equations = [f"    {word}.T = {self._signal(b, signal)};\n    connect({word}.port, network.{word});\n" for word, b, signal in held]
        equations += [f"    network.{word} = {self._signal(what, signal)};\n" for word, what, signal in driven]
        return RUN.format(
            title=_quoted(w.scenario.title or "scenario"),
            parts="".join(f"    {self.library}.Sources.PrescribedTemperature {word};\n" for word, _, _ in held),
            equations="".join(equations),
            end=_number(w.scenario.seconds),
        )

    def _text_of(self, formula: object) -> str:
        """Return a formula in Modelica."""
        return self.text.text_of(formula)  # type: ignore[arg-type]

    def _port(self, node: str) -> str:
        """Return the heat port of a node or boundary."""
        return self.node[node] if node in self.w.network.boundaries else f"{self.node[node]}.port"

    def _lines(self, curve: Curve, at: str, area: bool = False) -> str:
        """Return a table of straight lines, or its integral, as a sum of ramps: no function, no array."""
        x, y, _ = table_points(curve)
        slopes = [0.0, *((d - c) / (b - a) for a, b, c, d in zip(x, x[1:], y, y[1:], strict=False)), 0.0]
        terms = [f"{_number(y[0])}*({at})" if area else _number(y[0])]
        for before, after, corner in zip(slopes, slopes[1:], x, strict=False):
            ramp = f"max(0.0, {at} - {_number(corner)})"
            if after != before:
                terms.append(f"({_number((after - before) * (0.5 if area else 1.0))})*{ramp}{'^2' if area else ''}")
        return " + ".join(terms)

    def _signal(self, name: str, signal: Drawn) -> str:
        """Return a course as an expression of time."""
        if isinstance(signal, Sine):
            angle = f"{_number(2.0 * math.pi / signal.period)}*time + {_number(signal.phase)}"
            return f"{_number(signal.mean)} + {_number(signal.amplitude)}*sin({angle})"
        if (value := resting(signal)) is not None:
            return _number(value)
        assert isinstance(signal, TableSignal)
        return _pieces(name, signal, self.w.scenario.title)


def _pieces(name: str, table: TableSignal, where: str) -> str:
    """Return a table in time as an expression of cases."""
    if table.times.size > MAX_COURSE_SAMPLES:
        raise ScenarioError(
            f"the course of '{name}' has {table.times.size} samples, of which Modelica gets at most {MAX_COURSE_SAMPLES}. "
            "Give it fewer rows.",
            where,
            code="output.not-expressible",
        )
    x, y = table.times.tolist(), table.values.tolist()
    cases = [f"if time < {_number(x[0])} then {_number(y[0])}"]
    for a, b, c, d in zip(x, x[1:], y, y[1:], strict=False):
        value = _number(c) if table.hold else f"{_number(c)} + {_number((d - c) / (b - a))}*(time - {_number(a)})"
        cases.append(f"elseif time < {_number(b)} then {value}")
    return f"{' '.join(cases)} else {_number(y[-1])}"


def _number(value: float) -> str:
    """Return a number of type Real."""
    if math.isinf(value):
        return "1e60" if value > 0 else "-1e60"
    return repr(float(value)) if value >= 0.0 else f"({float(value)!r})"  # no sign follows a sign


def _quoted(text: str) -> str:
    """Return an author's words as a string."""
    return '"' + one_line(text).replace("\\", "\\\\").replace('"', '\\"') + '"'
