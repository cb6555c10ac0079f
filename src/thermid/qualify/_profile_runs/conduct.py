"""A profile run on a model: phase by phase, each dwell beginning when the unit is stable.

A test is run in stretches between two changes (legs), each from the state that the one before leaves. The whole course is then run once
more as one solution.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from thermid.base.arguments import takes_objects
from thermid.base.errors import ScenarioError, SolverError, refuse_unknown
from thermid.base.expression import Kelvin, amount
from thermid.base.extensions import extension
from thermid.base.linear_algebra import Array
from thermid.base.memo import Memo
from thermid.measure.amounts import duration_text
from thermid.measure.steadiness import StabilityRule, rule_of
from thermid.model.elements import Constant, Signal, TableSignal, multiplied
from thermid.model.tree import Model
from thermid.physics.constants import ICE_POINT
from thermid.qualify._profile_runs.profile_run import Phase, ProfileRun, SettledWater
from thermid.qualify._profiles.profile import ProfileStep, ThermalProfile, ordered
from thermid.simulation.network import Environment, compile_network
from thermid.simulation.runs import Scenario, network_for, simulate
from thermid.simulation.solver import Assembled, Engine, Options, Traces, Wiring, settle

TAIL = 1e6
"""Time for which the conditions at the end of a course can be held. [s]"""
SIMULATED_WINDOW: Final = 60.0
"""Window of a rule that names none, on a simulated trace. [s]"""
OUTPUTS_PER_WINDOW: Final = 60
"""Outputs within the window of a rule that names one."""
MAX_OUTPUTS: Final = 3000
"""Outputs of one stretch of waiting."""
MIN_OUTPUTS_PER_AVERAGE: Final = 30
"""Outputs within the time that temperatures are averaged over, at least."""
PUMP_POINTS = 25
"""Points of a pressure that falls or rises by equal factors."""
SET_POINT_TRIES = 12
MOIST_SAMPLES = 400
"""Outputs over which humidity is followed; the balance of vapour takes steps of its own between them."""


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
        changes: dict[str, Any] = {}
        chamber = _course_of(self.times, [s.chamber for s in self.states])
        changes["boundaries"] = {name: chamber for name in bench.chamber}
        changes |= bench.switched(base, _course_of(self.times, [float(s.power) for s in self.states], stepped=True))
        if self.states[0].pressure is not None:
            thin = _by_factors(self.times, [s.pressure or 0.0 for s in self.states], bench.ground)
            changes["environment"] = {gas: replace(base.environment.get(gas, Environment()), pressure=thin) for gas in bench.gases}
        return replace(base.with_(**changes), title=title, duration=end)

    def humidity(self) -> Signal | None:
        """Return the relative humidity over the course, or None where nothing is said. [-]"""
        humidities = [s.humidity for s in self.states]
        return None if any(h is None for h in humidities) else _course_of(self.times, [float(h or 0.0) for h in humidities])


def _course_of(times: tuple[float, ...], values: list[float], *, stepped: bool = False) -> Signal:
    """Return values at the ends of stretches as a signal that runs straight between them, or jumps; of two at one time the later holds."""
    if len(set(values)) == 1:
        return Constant(values[0])
    t, v = np.array(times), np.array(values)
    keep = np.append(np.diff(t) > 0.0, True)
    t, v = t[keep], v[keep]
    if not stepped:
        return TableSignal(t, v, after="hold")
    change = np.append(True, np.diff(v) != 0.0)
    return TableSignal(t[change], v[change], hold=True)


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
    return TableSignal(np.array([*t, times[-1] + 2.0 * TAIL, times[-1] + 3.0 * TAIL]), np.array([*p, values[-1], ground]))


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
            command = getattr(base, kind).get(load, Constant(1.0))
            (loads if kind == "loads" else commands)[load] = multiplied(command, on)
        return {"commands": commands, "loads": loads}

    def leg(self, past: Timeline, after: ChamberConditions, span: float) -> Leg:
        """Return the stretch that follows a course: the way to other conditions in a time, or conditions held (`span` zero). [s]

        Where a model remembers what was before (`memory`) it holds the whole past; else it begins at zero and is made once for each pair of
        conditions.
        """
        before = replace(past.states[-1], power=after.power)
        if self.memory:
            course = past.then(span, after) if span else past.then(0.0, after)
            return Leg.of_scenario(self, course.scenario(self.base, self, "profile", tail=TAIL), past.times[-1])

        def make() -> Leg:
            course = Timeline((0.0, span), (before, after)) if span else Timeline((0.0,), (after,))
            return Leg.of_scenario(
                self, replace(course.scenario(self.base, self, "profile", tail=TAIL), initial={}, start=Kelvin(293.15)), 0.0
            )

        return self.memo.value((before, after, span), make)


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
    def of_scenario(cls, bench: ChamberSetup, scenario: Scenario, begin: float) -> Leg:
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
        now = np.array([self.begin])
        outer = [float(self.wiring.boundary(b, now, self.assembled.offsets)[0]) for b in rows]
        powers = self.engine.powers(self.assembled, np.ascontiguousarray([[*state, *outer]]), now)
        return float(sum(abs(p[0]) for p in powers.values()))

    def chamber_at(self, time: float) -> float:
        """Return the temperature of the chamber at a time from the beginning. [K]"""
        return float(self.wiring.boundary(self.bench.chamber[0], np.array([self.begin + time]), self.assembled.offsets)[0])

    def steady(self, names: tuple[str, ...]) -> Mapping[str, float] | None:
        """Return where nodes settle under what is held, or None where nothing settles. [K]"""
        if self.bench.memory:
            return None
        try:
            settled, _ = settle(self.engine, self.assembled, self.begin + 0.5 * TAIL)
        except (SolverError, ScenarioError):
            return None
        return dict(zip(names, self.named(settled[None, :], names, np.array([0.5 * TAIL]))[0].tolist(), strict=True))

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
        for name, signal in getattr(scenario, kind).items():
            if not isinstance(signal, Constant):
                return f"{kind}.{name} changes with time"
    for gas, e in scenario.environment.items():
        if e.vented or e.sealed or e.pressure.cycle != 0.0:
            return f"the gas '{gas}' has a different pressure"
    return ""


@dataclass(frozen=True)
class Reached:
    """When and how a rule came to hold.

    Parameters
    ----------
    after : float       Time waited. [s]
    slowest : str       The node that held it up.
    rate : float        How fast that node still changes. [K/s]
    """

    after: float
    slowest: str
    rate: float


@dataclass(frozen=True)
class Wanted:
    """What is waited for.

    Parameters
    ----------
    rule : StabilityRule
    watch : tuple of str            Nodes that must be stable.
    base : str                      Node that must be at its level too; empty for none.
    level, tolerance : float        [K]
    longest : float                 Time after which it is given up. [s]
    where : str                     For the message.
    average : float                 Time over which temperatures are averaged first, for heaters that switch; zero for none. [s]
    """

    rule: StabilityRule
    watch: tuple[str, ...]
    base: str
    level: float
    tolerance: float
    longest: float
    where: str
    average: float = 0.0

    @property
    def window(self) -> float:
        """The window over which changes are taken. [s]"""
        return self.rule.window or SIMULATED_WINDOW


def wait(leg: Leg, state: Array, wanted: Wanted) -> Reached:
    """Return when the rule holds for every watched node, found between two outputs by a straight line.

    Raises
    ------
    SolverError     When it does not hold within the longest wait; with the node, its rate and the rule.
    ScenarioError   When a rule on stored heat is to be asked of averages.
    """
    if wanted.average and wanted.rule.stored:
        raise ScenarioError(
            f"'{wanted.rule.name}' does not apply to averages. Use a rule on the rate, or no average.",
            wanted.where,
            code="value.without-effect",
        )
    step = wanted.window / (OUTPUTS_PER_WINDOW if wanted.rule.window else 1)
    if wanted.average:
        step = wanted.average / max(MIN_OUTPUTS_PER_AVERAGE, math.ceil(wanted.average / step))
    times, traces = np.zeros(1), state[None, :]
    reach = 2.0 * (wanted.window + wanted.average)
    while True:
        reach = min(reach, wanted.longest)
        axis = np.asarray(np.arange(1, math.ceil(reach / step) + 1) * step, dtype=np.float64)
        axis = axis if wanted.average else _thinned(axis, step)
        run, _ = leg.run(state, axis)
        times, traces = np.append(0.0, axis), np.vstack((state, run))
        excess, movers = _excess(leg, wanted, times, traces)
        held = np.flatnonzero(excess <= 0.0)
        if held.size:
            k = int(held[0])
            after = float(times[k])
            if k and np.isfinite(excess[k - 1]):
                after -= float((times[k] - times[k - 1]) * excess[k] / (excess[k] - excess[k - 1]))
            slowest = wanted.watch[movers[max(k - 1, int(np.flatnonzero(np.isfinite(excess))[0]))]]
            return Reached(after, slowest, _rate(leg, wanted, times, traces, slowest, after))
        if reach >= wanted.longest:
            raise SolverError(_never(leg, wanted, times, traces, int(movers[-1])), wanted.where)
        reach *= 2.0


def _thinned(axis: NDArray[np.floating[Any]], step: float) -> Array:
    """Return output times: whole windows stay dense, and a long wait is looked at less often."""
    if axis.size <= MAX_OUTPUTS:
        return np.asarray(axis, dtype=np.float64)
    coarse = np.linspace(axis[0], axis[-1], MAX_OUTPUTS // 2)
    return np.unique(np.concatenate([np.round(coarse / step) * step, np.round(coarse / step) * step - step]))[1:]


def _excess(leg: Leg, wanted: Wanted, times: Array, traces: Array) -> tuple[Array, NDArray[np.int64]]:
    """Return by how much the rule is missed at each time (infinite before it can be asked), and which watched node is furthest from it."""
    of = _averaged(leg.named(traces, wanted.watch, times), times, wanted.average)
    before = np.searchsorted(times, times - wanted.window - 1e-6 * wanted.window)
    is_due = times >= (wanted.window + wanted.average) * (1.0 - 1e-9)
    spans = np.stack([_spread(of, before, k) if is_due[k] else np.full(of.shape[1], np.inf) for k in range(times.size)])
    movers = np.argmax(np.where(np.isfinite(spans), spans, -1.0), axis=1)
    if wanted.rule.stored:
        heat = traces @ leg.capacities
        power = leg.power(traces[-1])
        stored = np.array([abs(heat[k] - heat[before[k]]) / wanted.window if is_due[k] else np.inf for k in range(times.size)])
        excess = stored - wanted.rule.rate * power if power > 0 else np.full(times.size, np.inf)
    else:
        excess = spans.max(axis=1) - wanted.rule.rate * wanted.window
    if wanted.base:
        base = _averaged(leg.named(traces, (wanted.base,), times), times, wanted.average)[:, 0]
        off = np.abs(base - wanted.level) - wanted.tolerance
        excess = np.maximum(excess, off)
    return excess, movers


def _averaged(of: Array, times: Array, average: float) -> Array:
    """Return temperatures averaged over the time before each output (times, nodes); outputs are evenly spaced. [K]"""
    if not average:
        return of
    step = float(times[1] - times[0])
    count = round(average / step)
    inside = np.vstack((np.zeros((1, of.shape[1])), np.cumsum(0.5 * (of[1:] + of[:-1]), axis=0)))
    out = of.copy()
    out[count:] = (inside[count:] - inside[:-count]) / count
    return out


def _spread(of: Array, before: NDArray[np.int64], k: int) -> Array:
    """Return by how much each node moved within the window that ends at an output."""
    part = of[before[k] : k + 1]
    return np.asarray(part.max(axis=0) - part.min(axis=0))


def _rate(leg: Leg, wanted: Wanted, times: Array, traces: Array, node: str, time: float) -> float:
    """Return the rate of a node over the window that ends at a time. [K/s]"""
    of = _averaged(leg.named(traces, (node,), times), times, wanted.average)[:, 0]
    now, then = np.interp([time, time - wanted.window], times, of)
    return float((now - then) / wanted.window)


def _never(leg: Leg, wanted: Wanted, times: Array, traces: Array, mover: int) -> str:
    """Return why a wait was given up: node, rate, rule, and what to do."""
    node = wanted.watch[mover]
    rate = _rate(leg, wanted, times, traces, node, float(times[-1]))
    rule, waited = wanted.rule.name, duration_text(wanted.longest)
    text = f"it is not stable by the rule '{rule}' after {waited}: '{node}' still changes by {3600.0 * rate:+.3g} K/h"
    steady = leg.steady((node, *([wanted.base] if wanted.base else [])))
    if wanted.average:
        mean = duration_text(wanted.average)
        return f"{text} in its mean over {mean}. Allow a longer wait (longest_wait), another rule, or a longer average."
    if leg.bench.memory and not leg.bench.memory.startswith("the gas"):
        return (
            f"{text}. {leg.bench.memory}, so its temperature oscillates without end. Apply the rule to means over whole periods "
            "(average = '30 [min]'), watch other nodes, or use a wider rule."
        )
    if steady is None:
        return f"{text}, and it has no steady state. Look for a part without a path to the chamber, or a power that grows without limit."
    if wanted.base and abs(steady[wanted.base] - wanted.level) > wanted.tolerance:
        return (
            f"{text}; '{wanted.base}' would settle at {steady[wanted.base] - ICE_POINT:.1f} degC, outside {wanted.level - ICE_POINT:.1f} "
            f"+- {wanted.tolerance:g} degC. Give the chamber another level."
        )
    tau = leg.slowest(traces[-1])
    more = "" if not rate else f" The slowest time constant is {duration_text(tau)};"
    if rate and not wanted.rule.stored:
        moved, allowed = abs(rate), wanted.rule.rate
        need = tau * math.log(max(moved / allowed, 1.0)) + wanted.rule.window
        more += f" about {duration_text(max(need, 60.0))} more would be needed."
    return f"{text}, on its way to {steady[node] - ICE_POINT:.2f} degC.{more} Allow a longer wait (longest_wait), or another rule."


def bench_of(
    model: Model,
    profile: ThermalProfile,
    chamber: str | Sequence[str],
    equipment: Sequence[str] | None,
    base: Scenario,
    options: Options,
) -> tuple[ChamberSetup, ChamberConditions]:
    """Return the model in its chamber, and the conditions at the start."""
    network = compile_network(model, prescribed=tuple(base.prescribed))  # the steps say in which gas it runs
    chosen = (chamber,) if isinstance(chamber, str) else tuple(chamber)
    if not chosen and len(network.boundaries) != 1:
        raise ScenarioError(
            f"name the boundaries that are the chamber: chamber = ... out of {', '.join(network.boundaries)}.",
            profile.title,
            code="value.incomplete",
        )
    names = tuple(model.canonical(n) for n in chosen) or network.boundaries
    refuse_unknown(names, network.boundaries, f"{profile.title}, chamber", "'{}' is not a boundary.", ScenarioError)
    free = [b for b in network.boundaries if b not in names and b not in {model.canonical(k) for k in base.boundaries}]
    if free:
        raise ScenarioError(
            f"boundary '{free[0]}' is not the chamber and has no temperature. Name it in chamber, or give it one in the scenario.",
            profile.title,
            code="run.input-missing",
        )
    loads = {load.path: load for load in network.flat.loads}
    switched = tuple(model.canonical(n) for n in equipment) if equipment is not None else ()
    refuse_unknown(switched, loads, f"{profile.title}, equipment", "there is no load '{}' to switch.", ScenarioError)
    if equipment is None:
        controlled = ("thermostat", "proportional")
        switched = tuple(p for p, load in loads.items() if not load.controls and not any(f.startswith(controlled) for f in load.fields))
    ambient = profile.value("ambient")
    others = {k: v for k, v in base.boundaries.items() if model.canonical(k) not in names}
    steps = profile.steps
    thin = any(s.pressure is not None for s in steps)
    scenario = replace(
        base,
        boundaries=others,
        loads={model.canonical(k): v for k, v in base.loads.items()},
        commands={model.canonical(k): v for k, v in base.commands.items()},
        start=base.start if base.start != "" else Kelvin(ambient),
    )
    gases = tuple(n for n in names if n in base.environment) or (("*",) if thin else ())
    memory = memory_of(model, scenario.with_(boundaries={name: Constant(ambient) for name in names}))
    bench = ChamberSetup(model, scenario, names, switched, gases, profile.ground, options, memory)
    humid = profile.value("humidity") if profile.has("humidity") else None
    first = next((s.power for s in steps if s.power is not None), True)
    return bench, ChamberConditions(ambient, bool(first), profile.ground if thin else None, humid)


def watched(bench: ChamberSetup, watch: Sequence[str]) -> tuple[str, ...]:
    """Return the nodes that must be stable."""
    network = network_for(bench.model, bench.base)
    if watch:
        return tuple(network.find(n) for n in watch)
    capacities = network.numbers().capacitances
    return tuple(n for n in network.nodes if capacities.get(n) is not None)


@takes_objects
def run_profile(
    model: Model,
    profile: ThermalProfile,
    *,
    chamber: str | Sequence[str] = (),
    base: str = "",
    watch: Sequence[str] = (),
    equipment: Sequence[str] | None = None,
    scenario: Scenario | None = None,
    values: Mapping[str, str | float] | None = None,
    chamber_ramp: str | float | None = None,
    every: str | float = 60.0,
    options: Options | None = None,
    progress: Callable[[int, int, float], None] | None = None,
) -> ProfileRun:
    """Return a profile run on a model, phase by phase: ways, waits, dwells, off times and starts.

    Parameters
    ----------
    model : Model
    profile : ThermalProfile
    chamber : str or sequence       Boundaries that are the chamber (gas, shroud, plate); needed where the model has several.
    base : str                      Base plate: the levels then hold there, the chamber goes as far as that needs, and the plate must be
                                    within the tolerance before a dwell begins. Without it the levels are those of the chamber.
    watch : sequence                Nodes that must be stable; all that store heat where none is named.
    equipment : sequence            Loads that power switches; all without a thermostat or a controller where none is named.
    scenario : Scenario             What else is done: other boundaries, loads, environment, start.
    values : dict                   Parameters in place of the deck's.
    chamber_ramp : str or float     What the chamber can, where that is less than the profile asks for. [K/s]
    every : str or float            Interval of the stored samples. [s]
    options : Options               Of the integrator.
    progress : callable             Told after each step its number, how many there are, and the time reached in seconds; at the end of them
                                    again with each pass of the humidity's balance. What it raises ends the run.

    Raises
    ------
    ScenarioError   When names do not fit, or a number of the profile is missing.
    SolverError     When the unit does not become stable within the longest wait; with the node, its rate and the rule.
    """
    if {"hot", "cold"} & set(profile.used):
        ordered(profile)
    if values:
        model = model.with_values(values, profile.title)
    limit = float("inf") if chamber_ramp is None else _chamber_ramp(chamber_ramp)
    bench, start = bench_of(model, profile, chamber, equipment, scenario or Scenario(profile.title), options or Options())
    course = _Course(bench, profile, start, watched(bench, watch), base and network_for(bench.model, bench.base).find(base), limit)
    for k, step in enumerate(profile.steps, 1):
        course.do(step)
        if progress is not None:
            progress(k, len(profile.steps), course.plan.times[-1])
    return _finished(course, every, progress)


def _chamber_ramp(ramp: str | float) -> float:
    """Return what a chamber can. [K/s]"""
    rate = amount(ramp, "K/s", "chamber_ramp")
    if rate <= 0.0:
        raise ScenarioError("the chamber's rate of change must be above zero.", "chamber_ramp", code="value.outside-range")
    return rate


class _Course:
    """The test so far: conditions, state, phases."""

    def __init__(
        self, bench: ChamberSetup, profile: ThermalProfile, start: ChamberConditions, watch: tuple[str, ...], base: str, limit: float
    ) -> None:
        self.bench, self.profile, self.watch, self.base, self.limit = bench, profile, watch, base, limit
        self.plan = Timeline((0.0,), (start,))
        first = Leg.of_scenario(bench, self.plan.scenario(bench.base, bench, profile.title, tail=1.0), 0.0)
        self.first = first.engine.started(first.assembled).initial
        self.state: Array = self.first
        self.last, self.ran = first, 0.0
        self.phases: list[Phase] = []
        self.rule: StabilityRule | None = rule_of(profile.word("stable", "")) if profile.has("stable") else None
        self.level = start.chamber
        self.remarks: dict[str, None] = {}

    @property
    def now(self) -> ChamberConditions:
        """The conditions that hold."""
        return self.plan.states[-1]

    def do(self, step: ProfileStep) -> None:
        """Do one step: the way there, the wait, the stay."""
        power = self.now.power if step.power is None else step.power
        after = replace(self.now, power=power)
        if step.pressure is not None:
            after = replace(after, pressure=max(step.pressure, 1e-6))
        if step.humidity is not None and self.now.humidity is not None:
            after = replace(after, humidity=step.humidity)
        if step.target is not None:
            self.level = step.target
            home = step.cycle == 0 and not step.wait  # back to the room: nobody asks for the base plate
            after = replace(after, chamber=step.target if home else self._set_point(after, step.target))
        span = self._span(step, after)
        if span > 0.0:
            self._pass(step, after, span, "way")
        else:
            self.plan = self.plan.then(0.0, after)
        if step.wait:
            self._wait(step)
        if step.dwell > 0.0:
            self._pass(step, self.now, step.dwell, "stay")

    def _span(self, step: ProfileStep, after: ChamberConditions) -> float:
        """Return how long the way to other conditions takes. [s]"""
        way = abs(after.chamber - self.now.chamber)
        moving = way > 0.0 or after.pressure != self.now.pressure or after.humidity != self.now.humidity
        if not moving:
            return 0.0
        wanted = step.over if step.over is not None else way / step.ramp if step.ramp else 0.0
        least = way / self.limit
        if least > wanted:
            self.remarks[f"the chamber is limited to {60.0 * self.limit:.3g} K/min, slower than the profile requires"] = None
        return max(wanted, least)

    def _set_point(self, after: ChamberConditions, level: float) -> float:
        """Return the temperature of the chamber at which the base plate settles at its level. [K]"""
        if not self.base:
            return level
        chamber, tries = level, []  # type: float, list[tuple[float, float]]
        for _ in range(SET_POINT_TRIES):
            leg = self.bench.leg(Timeline((0.0,), (replace(after, chamber=chamber),)), replace(after, chamber=chamber), 0.0)
            steady = leg.steady((self.base,))
            if steady is None:
                self.remarks[f"'{self.base}' has no steady state, so the chamber is set to the level itself"] = None
                return level
            off = steady[self.base] - level
            if abs(off) < 1e-3:
                return chamber
            tries.append((chamber, off))
            moved = tries[-1][0] - tries[-2][0] if len(tries) > 1 else 0.0
            slope = (tries[-1][1] - tries[-2][1]) / moved if moved else 1.0
            if abs(slope) < 1e-3 or (len(tries) > 1 and not moved):
                break
            chamber = max(chamber - off / slope, 5.0)
        raise ScenarioError(
            f"no chamber temperature brings '{self.base}' to {level - 273.15:.1f} degC. Use another level.",
            self.profile.title,
            code="value.outside-range",
        )

    def _pass(self, step: ProfileStep, after: ChamberConditions, span: float, kind: str) -> None:
        """Run on for a time, on the way to other conditions or under the same."""
        leg = self.bench.leg(self.plan, after, span if kind == "way" else 0.0)
        _, final = leg.run(self._state_for(leg), np.array([span]))
        self._note(step, leg, final, span, kind, "", "", 0.0)
        self.plan, self.state, self.last, self.ran = self.plan.then(span, after), final, leg, span

    def _state_for(self, leg: Leg) -> Array:
        """Return where the unit is in the order of a leg's nodes: a joint whose gas is being pumped out is a node of its own there. [K]"""
        if leg.nodes == self.last.nodes:
            return self.state
        return np.asarray(self.last.named(self.state[None, :], leg.nodes, np.array([self.ran]))[0])

    def _wait(self, step: ProfileStep) -> None:
        """Run on until the unit is stable."""
        if self.rule is None:
            raise ScenarioError(
                "it waits for a stable unit, but the rule is missing. Give one: stable = '3 C/h'.",
                self.profile.title,
                code="value.incomplete",
            )
        tolerance = self.profile.value("tolerance") if self.profile.has("tolerance") else float("inf")
        base = self.base if np.isfinite(tolerance) else ""
        where = f"{self.profile.title}, {step.name}"
        average = self.profile.value("average") if self.profile.has("average") else 0.0
        wanted = Wanted(self.rule, self.watch, base, self.level, tolerance, self.profile.value("longest_wait"), where, average)
        leg = self.bench.leg(self.plan, self.now, 0.0)
        begun = self._state_for(leg)
        reached = wait(leg, begun, wanted)
        _, final = leg.run(begun, np.array([reached.after]))
        self._note(step, leg, final, reached.after, "wait", self.rule.name, reached.slowest, reached.rate)
        self.plan, self.state, self.last, self.ran = self.plan.then(reached.after, self.now), final, leg, reached.after

    def _note(self, step: ProfileStep, leg: Leg, final: Array, span: float, kind: str, rule: str, slowest: str, rate: float) -> None:
        """Write a phase down: what moved, what is left to go."""
        kelvin = leg.named(final[None, :], self.watch, np.array([span]))[0]
        steady = leg.steady(self.watch) if kind != "way" else None
        to_go = {n: steady[n] - float(t) for n, t in zip(self.watch, kelvin, strict=True)} if steady else {}
        furthest = max(to_go, key=lambda n: abs(to_go[n])) if to_go else ""
        chamber = self.now.chamber if kind != "way" else leg.chamber_at(span)
        base = float(leg.named(final[None, :], (self.base,), np.array([span]))[0, 0]) if self.base else None
        self.phases.append(
            Phase(
                step.name,
                step.cycle,
                kind,
                self.plan.times[-1],
                span,
                self.now.power if step.power is None else step.power,
                chamber,
                rule,
                slowest,
                rate,
                furthest,
                to_go.get(furthest),
                base,
            )
        )


def _finished(course: _Course, every: str | float, progress: Callable[[int, int, float], None] | None) -> ProfileRun:
    """Return the run: the whole course as one solution, its moisture, its remarks."""
    bench, profile, plan = course.bench, course.profile, course.plan
    scenario = plan.scenario(bench.base, bench, profile.title)
    step = amount(every, "s", "every")
    if step <= 0.0:
        raise ScenarioError("the interval of output must be above zero.", "every", code="value.outside-range")
    grid = np.arange(0.0, scenario.seconds, step)
    times = np.unique(np.concatenate([grid, plan.times]))
    times = times[np.append(True, np.diff(times) > 1e-6)]
    solution = simulate(bench.model, scenario, times=times, options=bench.options)
    wet: SettledWater | None = None
    damp = plan.humidity()
    if damp is not None:
        steps, interval = len(profile.steps), max(step, scenario.seconds / MOIST_SAMPLES)
        still = None if progress is None else lambda count, moved: progress(steps, steps, scenario.seconds)
        humid = extension("humidity", "humidity along a profile", profile.title)
        wet, remark = humid(bench.model, scenario, damp, bench.chamber, solution, interval, still)
        solution = wet.solution
        course.remarks |= dict.fromkeys((remark, *wet.warnings) if remark else wet.warnings)
    return ProfileRun(profile, tuple(course.phases), scenario, solution, wet, tuple(course.remarks), course.base, bench.chamber)
