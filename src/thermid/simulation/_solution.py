"""`Solution`: temperatures by name, the heat flow of every conductor, the heat balance, and how the run went."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Final, overload

import numpy as np

from thermid.base.errors import NameNotFoundError, ScenarioError, look_up, optional
from thermid.base.files import NETCDF_SOURCE, FileKinds
from thermid.base.results import PlottedTrace, Result, Row
from thermid.base.units import HOUR, ICE_POINT, MINUTE, Array, Memo, amount, kelvin, value_of, values_of
from thermid.model.tree import Standing, degrees, literal
from thermid.physics.correlations import GapLaw, correlation
from thermid.simulation._condensation import condensation
from thermid.simulation._duty import DutyCycle, on_shares
from thermid.simulation._network.network import Network
from thermid.simulation._solver.engine import Engine
from thermid.simulation._solver.extremes import Dense, Extreme, Turnings, first_above
from thermid.simulation._solver.problem import Answer, Options, Traces, break_times, left_tables, read_nodes, signal_turnings
from thermid.simulation._solver.wiring import Assembled, Wiring

if TYPE_CHECKING:
    import xarray

JUST_BEFORE = 1e-6
"""How long before a switching a course is looked at: at the switching, powers are those after it. [s]"""


@dataclass(frozen=True, eq=False)
class Trace(Result):
    """The temperature of one node over time; as an array it is in degC.

    Parameters
    ----------
    path : str              Canonical path of the node.
    times : array (times,)  [s]
    kelvin : array (times,) [K]
    turnings : Turnings     The highest and the lowest point between every two samples, as the integrator followed the course; None where
                            nothing is known between samples: of a log, or of a run with ``Options(extremes=False)``.
    dense : Dense           The course at any time; None where only samples are known.
    """

    path: str
    times: Array
    kelvin: Array
    turnings: Turnings | None = None
    dense: Dense | None = field(default=None, repr=False)

    @property
    def celsius(self) -> Array:
        """Temperatures (times,). [degC]"""
        return self.kelvin - ICE_POINT

    @property
    def final(self) -> float:
        """The last temperature. [degC]"""
        return float(self.celsius[-1])

    @cached_property
    def course(self) -> tuple[Array, Array]:
        """Samples and turning points in order: times (points,) [s] and temperatures (points,) [K]."""
        return self.turnings.beside(self.times, self.kelvin) if self.turnings is not None else (self.times, self.kelvin)

    def _extreme(self, sign: float) -> Extreme:
        """Return the highest (sign 1) or lowest (sign -1) point of samples and turning points, the first of equals."""
        times, kelvin = self.course
        place = int((sign * kelvin).argmax())
        return Extreme(float(kelvin[place]), float(times[place]), self.turnings is not None)

    @cached_property
    def maximum(self) -> Extreme:
        """The highest temperature of the run, between samples too where it was tracked, and when."""
        return self._extreme(1.0)

    @cached_property
    def minimum(self) -> Extreme:
        """The lowest temperature of the run, between samples too where it was tracked, and when."""
        return self._extreme(-1.0)

    @property
    def highest(self) -> float:
        """The highest temperature; see `maximum`. [degC]"""
        return self.maximum.celsius

    @property
    def lowest(self) -> float:
        """The lowest temperature; see `minimum`. [degC]"""
        return self.minimum.celsius

    @property
    def rise(self) -> float:
        """The last temperature less the first. [K]"""
        return float(self.kelvin[-1] - self.kelvin[0])

    def at(self, time: float | str | Sequence[float] | Array) -> Array:
        """Return the temperature at one or more times within the run [s], or at a text such as ``10 [min]``. [degC]

        By the integrator's dense output, for which the run is made again: ask for many times at once. Stored times cost nothing. Where
        only samples are known (`dense` is None), straight lines between them.

        Raises
        ------
        ScenarioError   When a time lies outside the run.
        """
        times = time if np.ndim(time) else amount(time, "s", f"{self.path}, at")
        try:
            wanted_times = np.asarray(times, dtype=float)
        except (TypeError, ValueError):
            raise ScenarioError(f"it takes times, not {time!r:.60}.", f"{self.path}, at", code="value.wrong-kind") from None
        first, last = float(self.times[0]), float(self.times[-1])
        near = 1e-9 * (last - first)
        outside = [t for t in np.ravel(wanted_times) if not first - near <= t <= last + near]
        if outside:
            raise ScenarioError(
                f"the run goes from {first:g} s to {last:g} s; it has no temperature at {outside[0]:g} s.",
                f"{self.path}, at",
                code="run.outside-times",
            )
        wanted = np.clip(wanted_times, first, last)
        if self.dense is None or np.isin(wanted, self.times).all():
            return np.asarray(np.interp(wanted, self.times, self.celsius))
        unique, places = np.unique(wanted, return_inverse=True)
        return np.asarray(self.dense.kelvin(unique)[places].reshape(wanted.shape) - ICE_POINT)

    def __str__(self) -> str:
        """One line: end, span and how many times."""
        between_samples = "" if self.turnings is not None else ", between them unknown"
        span = f"{self.lowest:.3f} .. {self.highest:.3f} degC"
        return f"{self.path}: {self.final:.3f} degC at {self.times[-1]:g} s, {span} at {self.times.size} times{between_samples}"

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Array:
        """Return the temperatures (times,). [degC]"""
        return np.asarray(self.celsius, dtype=dtype)

    def __len__(self) -> int:
        """How many times there are."""
        return self.times.size

    @overload
    def __getitem__(self, place: int) -> float: ...

    @overload
    def __getitem__(self, place: slice | Array) -> Array: ...

    def __getitem__(self, place: int | slice | Array) -> float | Array:
        """Return the temperature at one or more places of `times`. [degC]"""
        celsius = self.celsius[place]
        return float(celsius) if np.ndim(celsius) == 0 else np.asarray(celsius)

    def _as_rows(self) -> list[Row]:
        """Return its last, highest and lowest temperature."""
        return [{"node": self.path, "final_C": self.final, "highest_C": self.highest, "lowest_C": self.lowest}]

    def _as_traces(self) -> Sequence[PlottedTrace]:
        """Return the temperature."""
        return [PlottedTrace(self.path, self.times, self.celsius)]

    def crossing(self, limit: Any, *, below: bool = False) -> float | None:
        """Return the first time at which the node is above a limit, such as ``"50 [degC]"``, or below it; None where never. [s]

        Between samples too where the run was tracked: a pulse counts. To a few digits more than the samples by the integrator's dense
        output, where it can be had.
        """
        (times, values), sign, level = self.course, -1.0 if below else 1.0, kelvin(limit)
        if self.dense is None:
            return first_above(times, sign * (values - level))
        dense = self.dense
        return first_above(times, sign * (values - level), lambda t: sign * (dense.kelvin(t) - level), dense.switches)


@dataclass(frozen=True)
class HeatBalance:
    """Where the heat went, by the integrator's own weights: loads - boundaries = stored + residual.

    Parameters
    ----------
    loads : float       Heat put in. [J]
    boundaries : float  Heat that left into boundaries; what one-way flow links bring is counted against it. [J]
    stored : float      Heat that the nodes took up. [J]
    residual : float    What does not add up. [J]
    relative : float    The residual over the largest of loads and boundary flows, each without sign, and the range of what was stored. [-]
    """

    loads: float
    boundaries: float
    stored: float
    residual: float
    relative: float


@dataclass(frozen=True, eq=False)
class Run:
    """One run of the kernel: wiring, engine and numbers that it was made with, its answer at the stored times (times,) [s]."""

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
        return self.memo.value(times.tobytes(), lambda: self._again(times), most=4)

    def _again(self, times: Array) -> Run:
        """Return what `again` keeps: the run integrated once more."""
        options = replace(self.options, method=str(self.answer.statistics["method"]).removesuffix(" + CG"), extremes=False)
        answer = self.engine.integrate(self.assembled, times, self.assembled.reduced.nodes, self.answer.end, options)
        return replace(self, answer=replace(answer, turnings=self.answer.turnings), times=times)

    @cached_property
    def switches(self) -> Array:
        """When inputs jump and thermostats switch. [s]"""
        return np.unique(np.concatenate((break_times(self.engine.inputs, self.answer.end), [t for t, *_ in self.answer.switched])))

    @property
    def network(self) -> Network:
        """The network that was run."""
        return self.wiring.network

    def all_nodes(self) -> tuple[str, ...]:
        """Return nodes, then boundaries: the order of a solution's columns."""
        return (*self.network.nodes, *self.network.boundaries)

    def _by_node(self, temperatures: Array) -> dict[str, Array]:
        """Return node or boundary -> column of temperatures (times, nodes). [K]"""
        return {n: temperatures[:, k] for k, n in enumerate(self.all_nodes())}

    def time_constants(self, temperatures: Array) -> Array:
        """Return the time constants of the network linearised at temperatures (nodes,), longest first. [s]"""
        by_node = dict(zip(self.all_nodes(), temperatures, strict=True))
        by_node |= {n: self.answer.final[self.engine.nodes.index(n)] for n in self.assembled.reduced.controllers}
        states = np.array(self.assembled.reduced.states(by_node), dtype=float)
        return self.engine.time_constants(self.assembled, states, self.answer.end)

    def flows(self, times: Array, temperatures: Array) -> dict[str, Array]:
        """Return conductor -> heat flow (times,). [W]"""
        by_node = self._by_node(temperatures)
        return self.wiring.conductor_flows(self.assembled.numbers, by_node, times, self._shares(by_node, times))

    def conductances(self, times: Array, temperatures: Array) -> dict[str, Array]:
        """Return conductor -> heat flow over the temperature difference of its ends (times,); where that is zero its limit. [W/K]"""
        by_node = self._by_node(temperatures)
        return self.wiring.conductor_flows(self.assembled.numbers, by_node, times, self._shares(by_node, times), over_difference=True)

    def powers(self, times: Array, temperatures: Array) -> dict[str, Array]:
        """Return load -> power (times,). [W]"""
        return self.engine.powers(self.assembled, self._columns(temperatures, times), times, self.answer.states(times))

    def shares(self, times: Array, temperatures: Array) -> dict[str, Array]:
        """Return control -> its share (times,). [-]"""
        return self._shares(self._by_node(temperatures), times)

    def modes(self, times: Array) -> dict[str, Array]:
        """Return control with modes -> number of its mode (times,)."""
        states = self.answer.states(times)
        return {name: states[:, self.engine.control_names.index(name)].astype(float) for name in self.engine.machines}

    def _shares(self, by_node: Mapping[str, Array], times: Array) -> dict[str, Array]:
        """Return control -> its share (times,) for temperatures (times,) by node [K]; empty without controls. [-]"""
        if not self.assembled.numbers.controls:
            return {}
        temperatures = {**by_node, **self._controllers(times)}
        return self.wiring.shares(self.assembled.numbers, temperatures.__getitem__, times, self.modes(times).__getitem__)

    def _controllers(self, times: Array) -> dict[str, Array]:
        """Return state of a controller -> its course (times,). [K]"""
        states = self.assembled.reduced.controllers
        run = self if not states or np.array_equal(times, self.times) else self.again(times)
        return {n: run.traces.temperature(n) for n in states}

    def out_of_range(self) -> tuple[str, ...]:
        """Return a remark for each table or correlation used outside its range, at a stored time or at a turning point between them."""
        numbers = self.assembled.numbers
        # the run stored at the turning points of some nodes too
        stamps = [t.times for t in map(self.turnings, read_nodes(self.network, numbers)) if t is not None]
        times = np.union1d(self.times, np.concatenate(stamps)) if stamps else self.times  # numpy.unique would load numpy.ma
        times = times[(times >= self.times[0]) & (times <= self.times[-1])]
        fine = self if times.size == self.times.size else self.again(times)
        return (*left_tables(self.network, numbers, fine.traces.temperature, fine.times), *correlation_range_remarks(self))

    def _columns(self, temperatures: Array, times: Array) -> Array:
        """Return the kernel's states, then boundaries (times, columns) [K], from temperatures (times, nodes) in `all_nodes` order."""
        by_node = {**self._by_node(temperatures), **self._controllers(times)}
        return np.column_stack([*self.assembled.reduced.states(by_node), *(by_node[b] for b in self.network.boundaries)])

    def open_balance(self) -> tuple[str, ...]:
        """Return a remark where the heat balance is open by more than `OPEN`, with the node whose rounding explains it; else nothing."""
        balance = self.heat_balance()
        if not balance.relative > OPEN:
            return ()
        answer, reduced = self.answer, self.assembled.reduced
        digits = {
            n: float(value_of(reduced.capacitances.get(n) or 0.0)) * float(np.spacing(answer.final[k]))
            for k, n in enumerate(reduced.nodes)
            if n not in reduced.controllers
        }
        worst = max(digits, key=digits.__getitem__)
        size = f"the heat balance is open by {abs(balance.residual):.3g} J, {100.0 * balance.relative:.2g} % of the heat handled"
        if sum(digits.values()) < abs(balance.residual) / len(digits):
            return (size,)
        holds = float(value_of(reduced.capacitances.get(worst) or 0.0))
        return (
            f"{size}: '{worst}' stores {holds:.3g} J/K, so the last digit of its temperature is {digits[worst]:.2g} J, and heat into "
            "it is lost. If it holds its temperature, make it a boundary; else check its mass and units.",
        )

    def heat_balance(self) -> HeatBalance:
        """Return where the heat went: ``residual = loads - boundaries - stored``, of powers integrated with the weights of the integrator.

        ``stored = sum C (T_end - T_begin)``. The residual is divided by the heat that passed through the integrator, so that one that only
        passes from one boundary to another counts too.
        """
        answer = self.answer
        loads = float(answer.load_energy.sum())
        boundaries = float(answer.boundary_energy.sum()) - float(answer.flow_energy.sum())
        reduced = self.assembled.reduced
        weighed = {n: c for n, c in reduced.capacitances.items() if n not in reduced.controllers}
        capacities = values_of(weighed.get(n) or 0.0 for n in reduced.nodes)
        stored = float(capacities @ (answer.final - answer.initial))
        states = np.vstack((answer.initial, answer.temperatures, answer.final))
        # heat that only passes through, from one boundary to another, is heat that the integrator handled too
        gross = max(float(np.abs(part).sum()) for part in (answer.load_energy, answer.boundary_energy, answer.flow_energy))
        size = max(gross, float(capacities @ np.ptp(states, axis=0)), 1e-300)
        residual = loads - boundaries - stored
        return HeatBalance(loads, boundaries, stored, residual, abs(residual) / size)


OPEN: Final = 1e-6
"""Part of the heat that a run handled from which a balance that does not close is told."""


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


def correlation_range_remarks(run: Run) -> tuple[str, ...]:
    """Return a remark for each correlation whose largest Rayleigh number at a stored time is outside its range, and for wide gaps.

    Ra = b^4 |T_hot - T_cold|, with b = (g beta L^3 / (nu a))^(1/4) [K^-1/4] at the film temperature, which a conductor of natural
    convection holds as its second coefficient times a function of that temperature.
    """
    out = []
    words = {c.path: c.words for c in run.network.flat.conductors}
    for row in run.assembled.numbers.conductors:
        if row.form != "natural" or row.curve is None:
            continue
        hot, cold = (run.traces.temperature(end) for end in row.ends)
        strength = run.wiring.signals[row.second].at(run.times) if row.second else 1.0
        root = value_of(row.coefficients[1]) * strength * row.curve.film[1].evaluate(0.5 * (hot + cold))
        highest = float(np.max(root**4 * np.abs(hot - cold), initial=0.0))
        fields = words[row.name]
        if "tilt" in fields:
            gap = GapLaw(degrees(fields["tilt"]), literal(fields["aspect"], "1"))
            if highest > gap.high:
                out.append(f"{gap.name}, of '{row.name}', goes up to a Rayleigh number of {gap.high:g}; here it reaches {highest:.3g}")
            continue
        law = correlation(fields.get("htc.correlation", ""), fields.get("htc.orientation", "vertical"))
        if highest > law.high or 0.0 < highest < law.low:
            out.append(
                f"{law.name} of '{row.name}' is valid for Rayleigh numbers from {law.low:g} to {law.high:g}, but here they reach "
                f"{highest:.3g}, so its scatter is larger than stated"
            )
    return (*dict.fromkeys(out), *_convecting_gaps(run))


CONVECTS: Final = 1708.0
"""Rayleigh number of a layer that is heated from below, above which its gas moves (Incropera, 6th ed., Section 9.8). [-]"""


def _convecting_gaps(run: Run) -> tuple[str, ...]:
    """Return a remark for each gap modelled with gas at rest whose Rayleigh number exceeds `CONVECTS` at a stored time.

    Ra = g beta d^3 |T_hot - T_cold| / (nu a), properties at the mean of both temperatures, d the gap [m].
    """
    out, values = [], run.assembled.numbers.values
    for c in run.network.flat.conductors:
        if "gap" not in c.fields or "tilt" in c.words:
            continue
        hot, cold = (run.traces.temperature(end) for end in c.ends)
        distance = value_of(values[c.fields["gap"]])
        highest = float(np.max(run.network.media.buoyancy(c, 0.5 * (hot + cold), run.times) * np.abs(hot - cold), initial=0.0))
        highest *= distance**3
        if highest > CONVECTS:
            out.append(
                f"the gap of '{c.path}', {1e3 * distance:.4g} mm, reaches a Rayleigh number of {highest:.3g}. The model has gas at rest, "
                f"but convection begins above {CONVECTS:.0f} if the lower plate is warmer, and at about 1e4 between upright plates. Give "
                "tilt and aspect of the gap to include it"
            )
    return tuple(out)


@dataclass(frozen=True, eq=False)
class Solution(Result):
    """The result of a run.

    Parameters
    ----------
    title : str                     The model's.
    scenario : str                  The scenario's title.
    times : array (times,)          [s]
    nodes : tuple of str            Every node and boundary, in the order of the columns.
    free : tuple of str             Names that the sensitivities belong to; empty where none were asked for.
    status : str                    ``ok``, or what ended the run early.
    statistics : dict               Steps, rejected steps and the like.
    """

    title: str
    scenario: str
    times: Array
    nodes: tuple[str, ...]
    free: tuple[str, ...]
    status: str
    statistics: Mapping[str, Any]
    _remarks: tuple[str, ...] = field(repr=False)
    _run: Run = field(repr=False)

    def __getitem__(self, name: str) -> Trace:
        """Return the temperature over time of a node or boundary; aliases are accepted, an unknown name raises `NameNotFoundError`."""
        run, path = self._run, self._run.network.find(name)
        return Trace(path, self.times, run.traces.temperature(path), run.turnings(path), RunDense(run, path))

    def __iter__(self) -> Iterator[str]:
        """Yield every node and boundary."""
        return iter(self.nodes)

    def __contains__(self, name: object) -> bool:
        """Whether a node or boundary has this name; aliases are accepted."""
        names = self._run.network.flat.names
        return isinstance(name, str) and names.knows(name)

    def __len__(self) -> int:
        """How many nodes and boundaries there are."""
        return len(self.nodes)

    def refined(self, nodes: Iterable[str] = (), most: int | None = None) -> Solution:
        """Return the same run stored besides at the turning points of some nodes, and just before and at every switching.

        Whatever is read off its samples then holds between those of this run too. The run is made once more; where it was not tracked, or
        nothing lies between its samples, it is returned as it is.

        Parameters
        ----------
        nodes : iterable of str
        most : int      Of each node only so many of the highest and of the lowest turning points, and of the switchings only those where
                        one of them lies: for runs whose samples are dear. All where None.
        """
        run, first, last = self._run, float(self.times[0]), float(self.times[-1])
        turnings = [t for t in (run.turnings(run.network.find(n)) for n in nodes) if t is not None]
        turning_times = [t.times if most is None or t.times.size <= 2 * most else t.furthest(most) for t in turnings]
        more = np.unique(np.concatenate([np.zeros(0), *turning_times]))
        switches = run.switches if most is None else np.intersect1d(run.switches, more)
        before = switches - np.maximum(JUST_BEFORE, 1e-12 * switches)
        more = np.concatenate([more, switches, before])
        times = np.union1d(self.times, more[(more > first) & (more < last)])
        if not turnings or times.size == self.times.size:
            return self
        return replace(self, times=times, free=(), _run=run.again(times))

    @cached_property
    def warnings(self) -> tuple[str, ...]:
        """Warnings of the run, in words: of the model, tables and correlations outside their range, an open heat balance."""
        return (*self._remarks, *self._run.out_of_range(), *self._run.open_balance())

    @cached_property
    def doubts(self) -> tuple[Standing, ...]:
        """Why its temperatures are not credible, whatever its values: water condenses, whose heat it leaves out; empty where it does not.

        Of the gases whose humidity the scenario states.
        """
        return () if self._run is None else tuple(condensation(self._run.wiring, self._run.traces.temperature, self.times))

    @cached_property
    def _kelvin(self) -> Array:
        """Temperatures (times, nodes) of every node and boundary of the network, as its run takes them. [K]"""
        return np.column_stack([self._run.traces.temperature(n) for n in self._run.all_nodes()])

    @cached_property
    def temperatures(self) -> Array:
        """Temperatures (times, nodes) of every node and boundary but gases that are not there, in the order of `nodes`. [K]"""
        return np.column_stack([self._run.traces.temperature(n) for n in self.nodes])

    @cached_property
    def shares(self) -> dict[str, Array]:
        """Control of the deck -> its share (times,), by which what names it is multiplied. [-]"""
        shares = self._run.shares(self.times, self._kelvin)
        return {name: shares[name] for name in self._run.network.controls}

    @cached_property
    def duty_cycles(self) -> dict[str, DutyCycle]:
        """Thermostat, or load that has one of its own -> its duty cycle, and the power of the loads that it switches."""
        if self._run is None:  # one of a block, in which nothing switches
            return {}
        engine, answer = self._run.engine, self._run.answer
        out = {}
        for name in engine.thermostats:
            k = engine.control_names.index(name)
            events = [(time, state, before) for time, row, state, before in answer.switched if row == k]
            times, states = np.array([[time, state] for time, state, _ in events]).reshape(-1, 2).T
            share, last, period = on_shares(times, states, events[0][2] if events else int(answer.on[k]), answer.end)
            loads = {name, *(x.path for x in self._run.network.flat.loads if name in x.controls)}
            energy = sum(e for load, e in zip(engine.load_names, answer.load_energy.tolist(), strict=False) if load in loads)
            mean = energy / answer.end
            of_last = mean * last / share if share > 0.0 else last
            out[name] = DutyCycle(share, last, period, int(states.sum()), energy, mean, of_last)
        return out

    @cached_property
    def modes(self) -> dict[str, tuple[str, ...]]:
        """Control with modes -> its mode (times,); of a thermostat off and on."""
        names = {row.name: row.modes for row in self._run.assembled.numbers.controls}
        return {name: tuple(names[name][int(k)] for k in numbers) for name, numbers in self._run.modes(self.times).items()}

    def sensitivity(self, node: str, name: str) -> Array:
        """Return the derivative (times,) of a node's temperature with respect to a free name. [K per SI unit]

        Raises
        ------
        NameNotFoundError   When the node does not exist, or the run was not asked for derivatives with respect to that name.
        """
        path, wanted = self._run.network.find(node), self._run.network.flat.names.model.canonical(name)
        if wanted not in self.free:
            computed = f"it has those to {', '.join(self.free)}" if self.free else "none was computed. Run with run(sensitivities=True)"
            raise NameNotFoundError(f"the solution holds no sensitivity to '{name}': {computed}.", self.title)
        return self._run.traces.slope(path)[:, self.free.index(wanted)]

    def slopes(self, node: str) -> Array:
        """Return the derivatives (times, free) of a node's temperature with respect to all free names, in the order of `free`."""
        return self._run.traces.slope(self._run.network.find(node))

    @property
    def time_constants(self) -> Array:
        """Time constants of the network linearised at the end of the run, longest first. [s]"""
        return self._run.time_constants(self._kelvin[-1])

    def heat_flow(self, conductor: str) -> Array:
        """Return the heat flow (times,) of a conductor, positive from its first end to its second. [W]

        Raises
        ------
        NameNotFoundError   With the nearest name.
        """
        path = self._run.network.flat.names.model.canonical(conductor)
        return look_up(path, self.heat_flows, f"no conductor '{conductor}'.", self.title)

    @property
    def heat_flows(self) -> Mapping[str, Array]:
        """Conductor -> heat flow (times,). [W]"""
        return self._run.flows(self.times, self._kelvin)

    @property
    def load_powers(self) -> Mapping[str, Array]:
        """Load -> power (times,). [W]"""
        return self._run.powers(self.times, self._kelvin)

    def heat_balance(self) -> HeatBalance:
        """Return loads, heat into boundaries, heat stored and residual over the run; see `HeatBalance`. [J]"""
        return self._run.heat_balance()

    def to_dict(self, steady: Mapping[str, float] | None, at: Sequence[float]) -> dict[str, Any]:
        """Return the object of ``thermid simulate --json``.

        Parameters
        ----------
        steady : dict or None   Node -> steady temperature, where there is one. [K]
        at : sequence           Times asked for. [s]
        """
        nodes = {
            name: {
                "final_C": trace.final,
                "max_C": trace.highest,
                "max_time_s": trace.maximum.time,
                "min_C": trace.lowest,
                "min_time_s": trace.minimum.time,
                "at_C": trace.at(at).tolist() if len(at) else [],
                "steady_C": None if steady is None else steady[name] - ICE_POINT,
            }
            for name, trace in ((n, self[n]) for n in self.nodes)
        }
        return {
            "title": self.title,
            "scenario": self.scenario,
            "nodes": nodes,
            "time_constants_s": list(self.time_constants),
            "heat_balance": asdict(self.heat_balance()),
            "duty_cycles": {name: duty.to_dict() for name, duty in self.duty_cycles.items()},
            "steady_of": getattr(steady, "held", None),
            "warnings": list(self.warnings),
        }

    def to_xarray(self) -> xarray.Dataset:
        """Return temperatures [K], heat flows and powers [W] over time as a labelled data set of xarray, with each node's extremes.

        Raises
        ------
        MissingExtraError   When xarray is not installed.
        """
        library = optional("xarray", "to_xarray")
        flows, powers = self.heat_flows, self.load_powers
        tables = {"heat_flow": ("conductor", flows, "W"), "power": ("load", powers, "W")}
        data: dict[str, Any] = {"temperature": (("time", "node"), self.temperatures, {"units": "K"})}
        coordinates: dict[str, Any] = {"time": ("time", self.times, {"units": "s"}), "node": list(self.nodes)}
        node_traces = [self[n] for n in self.nodes]
        between = {"between_samples": "tracked" if all(t.turnings is not None for t in node_traces) else "unknown"}
        for word, ends in (("highest", [t.maximum for t in node_traces]), ("lowest", [t.minimum for t in node_traces])):
            data[word] = ("node", np.array([e.kelvin for e in ends]), {"units": "K"} | between)
            data[f"{word}_time"] = ("node", np.array([e.time for e in ends]), {"units": "s"})
        for name, (axis, traces, units) in tables.items():
            if traces:
                coordinates[axis] = list(traces)
                data[name] = (("time", axis), np.column_stack(list(traces.values())), {"units": units})
        dataset: xarray.Dataset = library.Dataset(
            data, coordinates, {"title": self.title, "scenario": self.scenario, "status": self.status}
        )
        return dataset

    def to_netcdf(self, path: str | os.PathLike[str]) -> None:
        """Write the data set of `to_xarray` as a netCDF file, which MATLAB and Octave can open."""
        with self.to_xarray() as data, FileKinds.NETCDF.replacing(path) as half:
            data.attrs["source"] = NETCDF_SOURCE
            data.to_netcdf(half, engine="h5netcdf")

    def to_csv(self, path: str | os.PathLike[str]) -> None:
        """Write a CSV file with the times [s] and a column of temperatures [degC] per node."""
        header = ",".join(['"time_s"', *(f"{n} [degC]" for n in self.nodes)])
        table = np.column_stack((self.times, self.temperatures - ICE_POINT))
        with FileKinds.TABLE.replacing(path) as half:
            np.savetxt(half, table, delimiter=",", header=header, comments="", fmt="%.9g")

    def __str__(self) -> str:
        """Return the end of the run as a short table."""
        width = max(len(n) for n in self.nodes)
        size, unit = next(((s, u) for s, u in ((HOUR, "h"), (MINUTE, "min")) if self.times[-1] >= s), (1.0, "s"))
        lines = [f"{self.title}, {self.scenario}: {self.times[-1] / size:.4g} {unit}, {self.status}"]
        for node in self.nodes:
            trace = self[node]
            lines.append(f"  {node:<{width}}  end {trace.final:9.3f} degC   highest {trace.highest:9.3f} degC")
        if any(self[n].turnings is None for n in self.nodes):
            lines.append("  highest of the stored samples; not known between them")
        lines += [f"  {name}: {duty}" for name, duty in self.duty_cycles.items()]
        lines += [f"  warning: {w}" for w in self.warnings]
        return Standing.worst(self.doubts).over("\n".join(lines))

    def _as_rows(self) -> list[Row]:
        """Return every node with its last, highest and lowest temperature."""
        traces = [(n, self[n]) for n in self.nodes]
        return [{"node": n, "final_C": t.final, "highest_C": t.highest, "lowest_C": t.lowest} for n, t in traces]

    def _as_traces(self) -> Sequence[PlottedTrace]:
        """Return the temperature of every node."""
        return [PlottedTrace(n, self.times, self[n].celsius) for n in self.nodes]
