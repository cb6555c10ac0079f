"""Stretches of a test between two changes, run one after the other: the state of every node goes from each to the next as it is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thermid.errors import ScenarioError, SolverError
from thermid.memo import Memo
from thermid.model.laws.signal import Constant, Signal, Table, multiplied
from thermid.model.tree.model import Model
from thermid.network.environment import Environment
from thermid.simulation.scenarios.scenario import Scenario
from thermid.simulation.simulator import network_for
from thermid.simulation.solver.engine import Engine
from thermid.simulation.solver.problem import Options
from thermid.simulation.solver.settling import settle
from thermid.simulation.solver.traces import Traces
from thermid.simulation.solver.wiring import Assembled, Wiring

Array = NDArray[np.float64]
TAIL = 1e6
"""Time for which the conditions at the end of a course can be held. [s]"""
PUMP_POINTS = 25
"""Points of a pressure that falls or rises by equal factors."""


@dataclass(frozen=True)
class ChamberConditions:
    """What is held at one time.

    Parameters
    ----------
    chamber : float             Temperature of the chamber. [K]
    power : bool                Whether the unit is switched on.
    pressure : float or None    Of the gas in the chamber; None where nothing is said. [Pa]
    humidity : float or None    Relative. [-]
    """

    chamber: float
    power: bool
    pressure: float | None = None
    humidity: float | None = None


@dataclass(frozen=True)
class Timeline:
    """The course of a test so far: conditions at the ends of stretches; power jumps, everything else runs straight (a pressure by factors).

    Parameters
    ----------
    times : tuple of float      Ends of stretches, from zero. [s]
    states : tuple              Conditions at those times; power is that of the stretch that follows.
    """

    times: tuple[float, ...]
    states: tuple[ChamberConditions, ...]

    def then(self, span: float, after: ChamberConditions) -> Timeline:
        """Return the course with one more stretch; power acts from its beginning."""
        last = replace(self.states[-1], power=after.power)
        return Timeline((*self.times, self.times[-1] + span), (*self.states[:-1], last, after))

    def scenario(self, base: Scenario, bench: ChamberSetup, title: str, tail: float = 0.0) -> Scenario:
        """Return the scenario of the whole course, with what holds at its end held for a time more. [s]"""
        end = self.times[-1] + tail
        # a stretch is looked at beyond its end; the whole course, without a tail, is refused where a signal ends before it
        base = base.mapped(lambda s: s.held_on()) if tail else base
        given: dict[str, Any] = {}
        chamber = _straight(self.times, [s.chamber for s in self.states])
        given["boundaries"] = {name: chamber for name in bench.chamber}
        given |= bench.switched(base, _steps(self.times, [float(s.power) for s in self.states]))
        if self.states[0].pressure is not None:
            thin = _by_factors(self.times, [s.pressure or 0.0 for s in self.states], bench.ground)
            given["environment"] = {gas: replace(base.environment.get(gas, Environment()), pressure=thin) for gas in bench.gases}
        return replace(base.with_(**given), title=title, duration=end)

    def humidity(self) -> Signal | None:
        """Return the relative humidity over the course, or None where nothing is said. [-]"""
        known = [s.humidity for s in self.states]
        return None if any(h is None for h in known) else _straight(self.times, [float(h or 0.0) for h in known])


def _straight(times: tuple[float, ...], values: list[float]) -> Signal:
    if len(set(values)) == 1:
        return Constant(values[0])
    t, v = np.array(times), np.array(values)
    keep = np.append(np.diff(t) > 0.0, True)
    return Table(t[keep], v[keep], after="hold")


def _steps(times: tuple[float, ...], values: list[float]) -> Signal:
    if len(set(values)) == 1:
        return Constant(values[0])
    t, v = np.array(times), np.array(values)
    keep = np.append(np.diff(t) > 0.0, True)
    t, v = t[keep], v[keep]
    change = np.append(True, np.diff(v) != 0.0)
    return Table(t[change], v[change], hold=True)


def _by_factors(times: tuple[float, ...], values: list[float], ground: float) -> Signal:
    """Return a pressure that goes by equal factors; a point on the ground after the end keeps its laws the same in every leg."""
    t, p = [times[0]], [values[0]]
    for k in range(1, len(times)):
        if times[k] <= times[k - 1]:
            p[-1] = values[k]
            continue
        points = PUMP_POINTS if values[k] != values[k - 1] else 1
        share = np.arange(1, points + 1) / points
        t += (times[k - 1] + share * (times[k] - times[k - 1])).tolist()
        p += (values[k - 1] * (values[k] / values[k - 1]) ** share).tolist()
    return Table(np.array([*t, times[-1] + 2.0 * TAIL, times[-1] + 3.0 * TAIL]), np.array([*p, values[-1], ground]))


@dataclass(frozen=True)
class ChamberSetup:
    """A model in a chamber.

    Parameters
    ----------
    model : Model
    base : Scenario             What else is done to it.
    chamber : tuple of str      Boundaries that are the chamber: its gas, its shroud, its plate.
    equipment : tuple of str    Loads that are switched off and on.
    gases : tuple of str        Gas nodes whose pressure is the chamber's.
    ground : float              Pressure of the room. [Pa]
    options : Options
    memory : str                Why stretches cannot be run apart (a thermostat's state, a clock); empty where they can.
    memo : Memo                 Stretches that were made ready.
    """

    model: Model
    base: Scenario
    chamber: tuple[str, ...]
    equipment: tuple[str, ...]
    gases: tuple[str, ...]
    ground: float
    options: Options
    memory: str
    memo: Memo = field(init=False, default_factory=Memo, compare=False, repr=False)

    def switched(self, base: Scenario, on: Signal) -> dict[str, Any]:
        """Return commands and loads with the equipment switched."""
        commands: dict[str, Any] = {}
        loads: dict[str, Any] = {}
        for load in self.equipment:
            kind = "loads" if load in base.loads else "commands"
            own = getattr(base, kind).get(load, Constant(1.0))
            (loads if kind == "loads" else commands)[load] = multiplied(own, on)
        return {"commands": commands, "loads": loads}

    def leg(self, past: Timeline, after: ChamberConditions, span: float) -> Leg:
        """Return the stretch that follows a course: the way to other conditions in a time, or conditions held (`span` zero). [s]"""
        before = replace(past.states[-1], power=after.power)
        if self.memory:
            course = past.then(span, after) if span else past.then(0.0, after)
            return Leg.of(self, course.scenario(self.base, self, "profile", tail=TAIL), past.times[-1])

        def made() -> Leg:
            course = Timeline((0.0, span), (before, after)) if span else Timeline((0.0,), (after,))
            return Leg.of(self, replace(course.scenario(self.base, self, "profile", tail=TAIL), initial={}, start=293.15), 0.0)

        return self.memo.made((before, after, span), made)


@dataclass(frozen=True)
class Leg:
    """One stretch, ready to be run from any state.

    Parameters
    ----------
    bench : ChamberSetup
    begin : float   Time at which it begins on the clock of its scenario. [s]
    """

    bench: ChamberSetup
    wiring: Wiring
    engine: Engine
    assembled: Assembled
    begin: float

    @classmethod
    def of(cls, bench: ChamberSetup, scenario: Scenario, begin: float) -> Leg:
        """Return the leg of a scenario."""
        wiring = Wiring(network_for(bench.model, scenario), scenario)
        engine = Engine(wiring)
        assembled = wiring.assemble()
        return cls(bench, wiring, engine, engine.started(assembled) if begin or bench.memory else assembled, begin)

    def run(self, state: Array | None, times: Array) -> tuple[Array, Array]:
        """Return temperatures (times, nodes) and those at the last time (nodes,), from a state at time zero. [K]"""
        a = self.assembled if self.bench.memory or state is None else replace(self.assembled, initial=state)
        axis = times + self.begin
        end = float(axis[-1])
        answer = self.engine.integrate(a, axis, a.reduced.nodes, end, self.bench.options)
        return answer.temperatures, answer.final

    @property
    def nodes(self) -> tuple[str, ...]:
        """Nodes in the order of a state."""
        return self.assembled.reduced.nodes

    @property
    def capacities(self) -> Array:
        """Capacitances (nodes,) in the order of a state. [J/K]"""
        return self.engine.capacities(self.assembled)

    def named(self, temperatures: Array, names: tuple[str, ...], times: Array) -> Array:
        """Return temperatures (times, names) of some nodes out of those of a state. [K]"""
        axis = times + self.begin
        traces = Traces(self.wiring, self.assembled, axis, self.nodes, temperatures, np.zeros((*temperatures.shape, 0)))
        return np.column_stack([traces.temperature(n) for n in names])

    def power(self, state: Array) -> float:
        """Return the heat that all loads put in at a state. [W]"""
        rows = self.wiring.network.boundaries
        at = np.array([self.begin])
        outer = [float(self.wiring.boundary(b, at, self.assembled.offsets)[0]) for b in rows]
        powers = self.engine.powers(self.assembled, np.ascontiguousarray([[*state, *outer]]), at)
        return float(sum(abs(p[0]) for p in powers.values()))

    def steady(self, names: tuple[str, ...]) -> Mapping[str, float] | None:
        """Return where nodes settle under what is held, or None where nothing settles. [K]"""
        if self.bench.memory:
            return None
        try:
            found, _ = settle(self.engine, self.assembled, self.begin + 0.5 * TAIL)
        except (SolverError, ScenarioError):
            return None
        return dict(zip(names, self.named(found[None, :], names, np.array([0.5 * TAIL]))[0].tolist(), strict=True))

    def slowest(self, state: Array) -> float:
        """Return the longest time constant at a state. [s]"""
        constants = self.engine.time_constants(self.assembled, state, self.begin + 0.5 * TAIL)
        return float(constants[0]) if constants.size else 0.0


def memory_of(model: Model, scenario: Scenario) -> str:
    """Return why stretches cannot be run apart, or an empty text."""
    flat = network_for(model, scenario).flat
    for load in flat.loads:
        for word, why in (
            ("thermostat", "its thermostat keeps a state"),
            ("periodic", "it follows a clock"),
            ("sine", "it follows a clock"),
        ):
            if any(f.startswith(word) for f in load.fields):
                return f"load '{load.path}': {why}"
    for kind in ("boundaries", "loads", "commands", "schedule", "prescribed"):
        for name, given in getattr(scenario, kind).items():
            if not isinstance(given, Constant):
                return f"{kind}.{name} changes with time"
    for gas, e in scenario.environment.items():
        if e.vented or e.sealed or e.pressure.cycle != 0.0:
            return f"the gas '{gas}' has a pressure of its own"
    return ""
