"""Models as SPICE netlists, the electrical analogue: degC are volts, W are amperes, K/W are ohms, J/K are farads."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator

from thermid.base.errors import DeckError
from thermid.base.units import ICE_POINT, value_of
from thermid.interop._wired import (
    Wired,
    Writer,
    conductance_text,
    exported,
    identifiers,
    number_text,
    one_line,
    resting,
    table_points,
    wired,
)
from thermid.model.tree import EXTENSION_REACH, Constant, Curve, Drawn, Model, Sine, TableSignal
from thermid.simulation.runs import ConductorRow, Scenario

MIN_STEPS_PER_RUN = 5000
"""The largest step is this part of the run."""
JUMP_SHARE_OF_RUN = 1e-7
"""A jump of a source takes this part of the run, since SPICE has no jumps."""
SPICE = Writer("SPICE", forms=("linear", "flow", "power", "radiation", "table", "table of difference"))
_PAIRS = 4


def to_spice(model: Model, scenario: Scenario, path: str | os.PathLike[str] | None = None) -> str:
    """Return a model in a scenario as a SPICE netlist (Fig. 4 of the source document).

    Temperatures in degC are volts, heat in W is current. A boundary is a voltage source, a conductor a resistor of 1/G, a capacitance a
    capacitor to ground with its start, a load a current source. Laws that are not linear are written as behavioural sources.

    Parameters
    ----------
    model, scenario     As in `simulate`.
    path : path         Where to write it too.

    Raises
    ------
    DeckError       When a law or a load cannot be written.
    ScenarioError   When the scenario does not fit the model or follows a schedule.
    """
    w = wired(model, scenario, SPICE)
    return exported(w, _Netlist(w).lines(), path, "*")


class _Netlist:
    """Writes one netlist."""

    def __init__(self, w: Wired) -> None:
        self.w = w
        # 0 is ground; SPICE knows no capitals
        self.nodes = identifiers((*w.network.nodes, *w.network.boundaries), caseless=True)
        self.rows = identifiers((label for label, _ in w.conductors), caseless=True)
        self.end = w.scenario.seconds

    def lines(self) -> Iterator[str]:
        """Yield the lines of the netlist."""
        w = self.w
        yield f"* {one_line(w.network.title)}, {one_line(w.scenario.title)}: volts are degC, amperes W, ohms K/W, farads J/K"
        for boundary, signal in w.boundaries.items():
            yield from self._source(f"V_{self.nodes[boundary]} {self.nodes[boundary]} 0", signal, 1.0, ICE_POINT)
        for node in w.massive:
            capacitance = number_text(value_of(w.capacitances[node] or 0.0))  # type: ignore[arg-type]
            yield f"C_{self.nodes[node]} {self.nodes[node]} 0 {capacitance} IC={number_text(round(w.initial[node] - ICE_POINT, 12))}"
        for label, row in w.conductors:
            yield self._conductor(label, row)
        for k, source in enumerate(w.sources, 1):
            yield f"* load {source.load}"
            if source.curve is not None:
                if source.signal != Constant(1.0):
                    raise DeckError(
                        f"the load '{source.load}' is a table that changes in time, which is not written to SPICE.",
                        self.w.network.title,
                        code="output.not-expressible",
                    )
                at = f"V({self.nodes[source.sensor]})+{ICE_POINT}"
                yield f"B_load_{k} 0 {self.nodes[source.node]} I={number_text(float(source.power))}*{self._pwl(source.curve, at)}"
                continue
            yield from self._source(f"I_{k} 0 {self.nodes[source.node]}", source.signal, float(source.power), 0.0)
        yield ".options reltol=1e-7 abstol=1e-12 vntol=1e-9"
        largest = number_text(self.end / MIN_STEPS_PER_RUN)
        yield f".tran {largest} {number_text(self.end)} 0 {largest} UIC"
        yield ".print tran " + " ".join(f"V({self.nodes[n]})" for n in w.network.nodes)
        yield ".end"

    def _conductor(self, label: str, row: ConductorRow) -> str:
        """Return the line of a conductor as a resistor or controlled source."""
        a, b = (self.nodes[end] for end in row.ends)
        name = self.rows[label]
        g, *rest = (value_of(c) for c in row.coefficients)
        if g == 0.0:
            return f"* {name}: no conductance, an open path"
        if row.form == "linear":
            return f"R_{name} {a} {b} {number_text(1.0 / g)}"
        if row.form == "flow":
            return f"B_{name} 0 {b} I={number_text(g)}*V({a},{b})"
        warm, cold = (f"(V({end})+{ICE_POINT})" for end in (a, b))
        conductance = conductance_text(row, [number_text(c) for c in (g, *rest)], warm, cold, self._pwl)
        return f"B_{name} {a} {b} I=V({a},{b})*{conductance}"

    def _pwl(self, curve: Curve, at: str) -> str:
        """Return a table of straight lines as SPICE has it; it goes on as a line there, so that points far out hold the last value."""
        x, y, _ = table_points(curve)
        x, y = [x[0] - EXTENSION_REACH, *x, x[-1] + EXTENSION_REACH], [y[0], *y, y[-1]]
        return f"pwl({at}, {', '.join(f'{number_text(a)}, {number_text(b)}' for a, b in zip(x, y, strict=True))})"

    def _source(self, start: str, signal: Drawn, factor: float, zero: float) -> Iterator[str]:
        """Yield a source: a number, a sine or a line of points; `zero` is where its scale begins."""
        if (value := resting(signal)) is not None:
            yield f"{start} DC {number_text(round(factor * value - zero, 12))}"
        elif isinstance(signal, Sine):
            mean, phase = round(factor * signal.mean - zero, 12), math.degrees(signal.phase)
            amplitude = factor * signal.amplitude
            yield f"{start} SIN({' '.join(number_text(x) for x in (mean, amplitude, 1.0 / signal.period, 0.0, 0.0, phase))})"
        elif isinstance(signal, TableSignal):
            yield f"{start} PWL("
            points = [f"{number_text(t)} {number_text(round(factor * v - zero, 12))}" for t, v in self._points(signal)]
            for k in range(0, len(points), _PAIRS):
                yield "+ " + "  ".join(points[k : k + _PAIRS])
            yield "+ )"

    def _points(self, table: TableSignal) -> Iterator[tuple[float, float]]:
        """Yield the corners (time [s], value) of a table; a jump becomes a steep ramp that ends where the jump is.

        The ramp takes `JUMP_SHARE_OF_RUN` of the run. Values are in the SI unit of the signal.
        """
        before: float | None = None
        for time, value in zip(table.times.tolist(), table.values.tolist(), strict=True):
            if table.hold and before is not None and value != before:
                yield time - JUMP_SHARE_OF_RUN * self.end, before
            yield time, value
            before = value
