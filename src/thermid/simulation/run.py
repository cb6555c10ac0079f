"""One run: the kernel's answer put back into names."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from thermid.dual import value_of
from thermid.memo import Memo
from thermid.network.network import Network
from thermid.simulation.ranges import outside
from thermid.simulation.solution import HeatBalance
from thermid.simulation.solver.beyond import left_tables, read_nodes
from thermid.simulation.solver.engine import Answer, Engine, Options
from thermid.simulation.solver.extremes import Turnings, signal_turnings
from thermid.simulation.solver.kernel_form import break_times
from thermid.simulation.solver.traces import Traces
from thermid.simulation.solver.wiring import Assembled, Wiring

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Run:
    """A wiring, its numbers, and what the kernel answered."""

    wiring: Wiring
    engine: Engine
    assembled: Assembled
    answer: Answer
    times: Array
    options: Options
    memo: Memo = field(init=False, default_factory=Memo, compare=False, repr=False)

    @cached_property
    def traces(self) -> Traces:
        """Temperatures and derivatives by name."""
        return Traces(
            self.wiring, self.assembled, self.times, self.assembled.reduced.nodes, self.answer.temperatures, self.answer.sensitivities
        )

    def turnings(self, path: str) -> Turnings | None:
        """Return the turning points of a node or boundary between samples; None where the run did not follow it."""
        if path in self.network.boundaries:
            offset = value_of(self.assembled.offsets[path])
            return signal_turnings(self.wiring.signals[f"boundary {path}"], self.answer.end, offset)
        return (self.answer.turnings or {}).get(path)

    def again(self, times: Array) -> Run:
        """Return the same run stored at other, increasing times (times,) [s], by the same method."""
        return self.memo.made(times.tobytes(), lambda: self._again(times), most=4)

    def _again(self, times: Array) -> Run:
        method = str(self.answer.statistics["method"]).removesuffix(" + CG")
        options = replace(self.options, method=method, extremes=False)
        answer = self.engine.integrate(self.assembled, times, self.assembled.reduced.nodes, self.answer.end, options)
        return replace(self, answer=replace(answer, turnings=self.answer.turnings), times=times)

    def dense(self, path: str) -> RunDense:
        """Return the course of a node or boundary at any time."""
        return RunDense(self, path)

    @cached_property
    def switches(self) -> Array:
        """When inputs jump and thermostats switch. [s]"""
        signals = [self.wiring.signals[name] for name in self.wiring.used]
        return np.unique(np.concatenate((break_times(signals, self.answer.end), [t for t, _, _ in self.answer.switched])))

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

    def conductances(self, times: Array, temperatures: Array) -> dict[str, Array]:
        """Return conductor -> conductance (times,), radiation made linear. [W/K]"""
        by_node = {n: temperatures[:, k] for n, k in self._index(self.all_nodes()).items()}
        return self.wiring.conductor_conductances(self.assembled.numbers, by_node, times)

    def powers(self, times: Array, temperatures: Array) -> dict[str, Array]:
        """Return load -> power (times,). [W]"""
        return self.engine.powers(self.assembled, self._columns(temperatures), times, self.answer.states(times))

    def out_of_range(self) -> tuple[str, ...]:
        """Return a sentence for each table that was asked for values outside its points, at a stored time or a turning point."""
        numbers = self.assembled.numbers
        fine = self._at_turnings(read_nodes(self.network, numbers))
        return (*left_tables(self.network, numbers, fine.traces.temperature, fine.times), *outside(self))

    def _at_turnings(self, nodes: Iterable[str]) -> Run:
        """Return the run stored at the turning points of some nodes too."""
        found = [t.times for t in map(self.turnings, nodes) if t is not None]
        times = np.union1d(self.times, np.concatenate([np.zeros(0), *found]))
        times = times[(times >= self.times[0]) & (times <= self.times[-1])]
        return self if times.size == self.times.size else self.again(times)

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


@dataclass(frozen=True, eq=False)
class RunDense:
    """The course of a node or boundary of a run at any time; see `Dense`.

    Parameters
    ----------
    run : Run
    path : str      Of the node.
    """

    run: Run
    path: str

    def kelvin(self, times: Array) -> Array:
        """Return the temperatures (times,) [K] at increasing times (times,) [s]."""
        if self.path in self.run.network.boundaries:
            return self.run.wiring.boundary(self.path, times, self.run.assembled.offsets)
        return self.run.again(times).traces.temperature(self.path)

    @property
    def switches(self) -> Array:
        """When inputs jump and thermostats switch. [s]"""
        return self.run.switches
