"""One run: the kernel's answer put back into names."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from thermid.dual import value_of
from thermid.network.network import Network
from thermid.simulation.engine import Answer, Engine
from thermid.simulation.ranges import outside
from thermid.simulation.solution import HeatBalance
from thermid.simulation.traces import Traces
from thermid.simulation.wiring import Assembled, Wiring

__all__ = ["Run"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Run:
    """A wiring, its numbers, and what the kernel answered."""

    wiring: Wiring
    engine: Engine
    assembled: Assembled
    answer: Answer
    times: Array

    @cached_property
    def traces(self) -> Traces:
        """Temperatures and derivatives by name."""
        return Traces(
            self.wiring, self.assembled, self.times, self.assembled.reduced.nodes, self.answer.temperatures, self.answer.sensitivities
        )

    @property
    def network(self) -> Network:
        """The network that was run."""
        return self.wiring.network

    def _index(self, nodes: tuple[str, ...]) -> dict[str, int]:
        return {n: k for k, n in enumerate(nodes)}

    def all_nodes(self) -> tuple[str, ...]:
        """Nodes, then boundaries: the order of a solution's columns."""
        return (*self.network.nodes, *self.network.boundaries)

    def time_constants(self, temperatures: Array) -> Array:
        """Return the time constants of the network linearised at temperatures (nodes,), longest first. [s]"""
        at = np.array(self.assembled.reduced.states(dict(zip(self.all_nodes(), temperatures, strict=True))), dtype=float)
        return self.engine.time_constants(self.assembled, at, self.answer.end)

    def flows(self, times: Array, temperatures: Array) -> dict[str, Array]:
        """Return conductor -> heat flow (times,). [W]"""
        by_node = {n: temperatures[:, k] for n, k in self._index(self.all_nodes()).items()}
        return self.wiring.conductor_flows(self.assembled.numbers, by_node, times)

    def powers(self, times: Array, temperatures: Array) -> dict[str, Array]:
        """Return load -> power (times,). [W]"""
        return self.engine.powers(self.assembled, self._columns(temperatures), times, self.answer.states(times))

    def out_of_range(self) -> tuple[str, ...]:
        """Return a sentence for each law of the user that was asked for values beyond its range at a stored time."""
        out = []
        at = self.traces.temperature
        numbers = self.assembled.numbers
        plain = {r.name for r in numbers.conductors if r.form == "table"} | {r.name for r in numbers.loads}
        rows = [(r.name, r.curve, r.ends) for r in numbers.conductors] + [(r.name, r.curve, (r.node, r.node)) for r in numbers.loads]
        rows += [
            (c.path, c.curve.film[1], (e, e)) for c in self.network.flat.conductors if c.curve is not None and c.curve.film for e in c.ends
        ]
        rows += [(node, store.given, (node, node)) for node, store in self.network.stores.items()]
        for name, curve, (a, b) in rows:
            if curve is None or curve.film or (curve.d is None and name in plain):
                continue
            seen = at(a) - at(b) if curve.over == "difference" else 0.5 * (at(a) + at(b))
            beyond = (seen < curve.x[0]) | (seen > curve.x[-1])
            if beyond.any():
                first, low, high = self.times[beyond.argmax()], float(seen.min()), float(seen.max())
                out.append(
                    f"'{name}' left the range of its law, {curve.x[0]:.6g} to {curve.x[-1]:.6g} K, at {first:.6g} s: it saw {low:.6g} to"
                    f" {high:.6g} K; beyond its range a law stays constant"
                )
        return (*out, *outside(self))

    def _columns(self, temperatures: Array) -> Array:
        by_node = dict(zip(self.all_nodes(), temperatures.T, strict=True))
        return np.column_stack([*self.assembled.reduced.states(by_node), *(by_node[b] for b in self.network.boundaries)])

    def heat_balance(self) -> HeatBalance:
        """Return where the heat went, by the integrator's own weights."""
        answer = self.answer
        loads = float(answer.load_energy.sum())
        boundaries = float(answer.boundary_energy.sum()) - float(answer.flow_energy.sum())
        capacities = np.array([value_of(c) if c is not None else 0.0 for c in self.assembled.reduced.capacitances.values()])
        stored = float(capacities @ (answer.final - answer.initial))
        seen = np.vstack((answer.initial, answer.temperatures, answer.final))
        # heat that only passes through, from one boundary to another, is heat that the integrator handled too
        gross = max(float(np.abs(part).sum()) for part in (answer.load_energy, answer.boundary_energy, answer.flow_energy))
        size = max(gross, float(capacities @ np.ptp(seen, axis=0)), 1e-300)
        residual = loads - boundaries - stored
        return HeatBalance(loads, boundaries, stored, residual, abs(residual) / size)
