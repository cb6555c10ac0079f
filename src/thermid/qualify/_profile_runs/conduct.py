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

from thermid.base.errors import ScenarioError, SolverError, extension, refuse_unknown
from thermid.base.units import ATMOSPHERE, ICE_POINT, Array, Kelvin, Memo, amount, duration_text
from thermid.measure.records import StabilityRule
from thermid.model.tree import Constant, Model, Signal, TableSignal, multiplied
from thermid.qualify._profile_runs.profile_run import Phase, ProfileRun, SettledWater
from thermid.qualify._profiles.profile import ProfileStep, ThermalProfile, check_level_order
from thermid.simulation.runs import (
    Assembled,
    Engine,
    Environment,
    Options,
    Scenario,
    Traces,
    Wiring,
    compile_network,
    network_for,
    settle,
    simulate,
)

HELD_AFTER_END = 1e6
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
    """Conditions in the chamber at one time.

    Parameters
    ----------
    chamber : float             Temperature of the chamber. [K]
    power : bool                Whether the unit is switched on.
    pressure : float or None    Of the gas in the chamber; None where the profile gives none. [Pa]
    humidity : float or None    Relative humidity; None where the profile gives none. [-]
    """

    chamber: float
    power: bool
    pressure: float | None = None
    humidity: float | None = None


@dataclass(frozen=True)
class Timeline:
    """Conditions over the course of a test so far.

    Between two times temperature and humidity run straight and pressure by equal factors; power jumps.

    Parameters
    ----------
    times : tuple of float                  Ends of stretches, from zero. [s]
    states : tuple of ChamberConditions     Conditions at those times; power is that of the stretch that follows.
    """

    times: tuple[float, ...]
    states: tuple[ChamberConditions, ...]

    def then(self, span: float, after: ChamberConditions) -> Timeline:
        """Return the course with one more stretch of a duration `span` [s] to the conditions `after`; power changes at its beginning."""
        last = replace(self.states[-1], power=after.power)
        return Timeline((*self.times, self.times[-1] + span), (*self.states[:-1], last, after))

    def scenario(self, base: Scenario, bench: ChamberSetup, title: str, tail: float = 0.0) -> Scenario:
        """Return the scenario of the whole course beside `base`; the conditions at its end hold for a further time `tail`. [s]"""
        end = self.times[-1] + tail
        # a stretch is looked at beyond its end; the whole course, without a tail, is refused where a signal ends before it
        base = base.mapped(lambda s: s.held_on()) if tail else base
        changes: dict[str, Any] = {}
        chamber = _piecewise_signal(self.times, [s.chamber for s in self.states])
        changes["boundaries"] = {name: chamber for name in bench.chamber}
        changes |= bench.switched(base, _piecewise_signal(self.times, [float(s.power) for s in self.states], stepped=True))
        if self.states[0].pressure is not None:
            thin = _pressure_signal(self.times, [s.pressure or 0.0 for s in self.states])
            changes["environment"] = {gas: replace(base.environment.get(gas, Environment()), pressure=thin) for gas in bench.gases}
        return replace(base.with_(**changes), title=title, duration=end)

    def humidity(self) -> Signal | None:
        """Return the relative humidity over the course as a signal; None where the profile gives none. [-]"""
        humidities = [s.humidity for s in self.states]
        return None if any(h is None for h in humidities) else _piecewise_signal(self.times, [float(h or 0.0) for h in humidities])


def _piecewise_signal(times: tuple[float, ...], values: list[float], *, stepped: bool = False) -> Signal:
    """Return values [SI] at times [s] as a signal: straight lines, or jumps if `stepped`; of two values at one time the later holds."""
    if len(set(values)) == 1:
        return Constant(values[0])
    t, v = np.array(times), np.array(values)
    keep = np.append(np.diff(t) > 0.0, True)
    t, v = t[keep], v[keep]
    if not stepped:
        return TableSignal(t, v, after="hold")
    change = np.append(True, np.diff(v) != 0.0)
    return TableSignal(t[change], v[change], hold=True)


def _pressure_signal(times: tuple[float, ...], values: list[float]) -> Signal:
    """Return a pressure through `values` at `times` that changes by equal factors: p(t) = p0 (p1 / p0)^((t - t0) / (t1 - t0)). [Pa]

    A point at one atmosphere long after the end makes every leg's gas laws those of a pressure that changes.
    """
    t, p = [times[0]], [values[0]]
    for k in range(1, len(times)):
        if times[k] <= times[k - 1]:
            p[-1] = values[k]
            continue
        points = PUMP_POINTS if values[k] != values[k - 1] else 1
        share = np.arange(1, points + 1) / points
        t += (times[k - 1] + share * (times[k] - times[k - 1])).tolist()
        p += (values[k - 1] * (values[k] / values[k - 1]) ** share).tolist()
    return TableSignal(
        np.array([*t, times[-1] + 2.0 * HELD_AFTER_END, times[-1] + 3.0 * HELD_AFTER_END]), np.array([*p, values[-1], ATMOSPHERE])
    )


@dataclass(frozen=True)
class ChamberSetup:
    """A model in a chamber.

    Parameters
    ----------
    model : Model
    base : Scenario             Inputs that the profile does not give.
    chamber : tuple of str      Boundaries that are the chamber: its gas, its shroud, its plate.
    equipment : tuple of str    Loads that are switched off and on.
    gases : tuple of str        Gas nodes whose pressure is the chamber's.
    options : Options           Of the integrator.
    memory : str                Why stretches cannot be run one by one (a thermostat's state, a clock); empty where they can.
    memo : Memo                 Legs that were made.
    """

    model: Model
    base: Scenario
    chamber: tuple[str, ...]
    equipment: tuple[str, ...]
    gases: tuple[str, ...]
    options: Options
    memory: str
    memo: Memo = field(init=False, default_factory=Memo, compare=False, repr=False)

    def switched(self, base: Scenario, on: Signal) -> dict[str, Any]:
        """Return the commands and loads of the equipment, each multiplied by the signal `on` (0 or 1)."""
        driven = {load: multiplied(base.loads[load], on) for load in self.equipment if load in base.loads}
        rest = (load for load in self.equipment if load not in driven)
        return {"loads": driven, "commands": {load: multiplied(base.commands.get(load, Constant(1.0)), on) for load in rest}}

    def leg(self, past: Timeline, after: ChamberConditions, span: float) -> Leg:
        """Return the stretch after a course: the way to the conditions `after` in `span` seconds, or these held where `span` is zero.

        With a `memory` it includes the whole past. Otherwise it begins at zero, and one leg serves all equal pairs of conditions.
        """
        before = replace(past.states[-1], power=after.power)
        if self.memory:
            course = past.then(span, after) if span else past.then(0.0, after)
            return Leg.of_scenario(self, course.scenario(self.base, self, "profile", tail=HELD_AFTER_END), past.times[-1])

        def make() -> Leg:
            """Return the leg from one chamber temperature to another over `span`. [s]"""
            course = Timeline((0.0, span), (before, after)) if span else Timeline((0.0,), (after,))
            return Leg.of_scenario(
                self, replace(course.scenario(self.base, self, "profile", tail=HELD_AFTER_END), initial={}, start=Kelvin(293.15)), 0.0
            )

        return self.memo.value((before, after, span), make)


@dataclass(frozen=True)
class Leg:
    """One stretch of a test, ready to be run from any state.

    Parameters
    ----------
    bench : ChamberSetup
    wiring : Wiring         The network with its inputs.
    engine : Engine         The integrator.
    assembled : Assembled   Values and start.
    begin : float           Time at which it begins on the clock of its scenario. [s]
    """

    bench: ChamberSetup
    wiring: Wiring
    engine: Engine
    assembled: Assembled
    begin: float

    @classmethod
    def of_scenario(cls, bench: ChamberSetup, scenario: Scenario, begin: float) -> Leg:
        """Return the leg of a scenario that begins at a time of its clock. [s]"""
        wiring = Wiring(network_for(bench.model, scenario), scenario)
        engine = Engine(wiring)
        assembled = wiring.assemble()
        return cls(bench, wiring, engine, engine.started(assembled) if begin or bench.memory else assembled, begin)

    def run(self, state: Array | None, times: Array) -> tuple[Array, Array]:
        """Return temperatures (times, nodes) at times from the beginning of the leg, and those at the last one (nodes,). [K]

        `state` (nodes,) are the temperatures at the beginning; None, or a model with memory, takes the scenario's start.
        """
        a = self.assembled if self.bench.memory or state is None else replace(self.assembled, initial=state)
        axis = times + self.begin
        answer = self.engine.integrate(a, axis, a.reduced.nodes, float(axis[-1]), self.bench.options)
        return answer.temperatures, answer.final

    @property
    def nodes(self) -> tuple[str, ...]:
        """Nodes in the order of a state."""
        return self.assembled.reduced.nodes

    def named(self, temperatures: Array, names: tuple[str, ...], times: Array) -> Array:
        """Return temperatures (times, names) of nodes by name, of temperatures (times, nodes) in the order of a state. [K]"""
        axis = times + self.begin
        traces = Traces(self.wiring, self.assembled, axis, self.nodes, temperatures, np.zeros((*temperatures.shape, 0)))
        return np.column_stack([traces.temperature(n) for n in names])

    def power(self, state: Array) -> float:
        """Return the sum of |power| of all loads at a state (nodes,). [W]"""
        rows = self.wiring.network.boundaries
        now = np.array([self.begin])
        outer = [float(self.wiring.boundary(b, now, self.assembled.offsets)[0]) for b in rows]
        powers = self.engine.powers(self.assembled, np.ascontiguousarray([[*state, *outer]]), now)
        return float(sum(abs(p[0]) for p in powers.values()))

    def steady(self, names: tuple[str, ...]) -> Mapping[str, float] | None:
        """Return node -> steady temperature under the conditions of the leg; None where there is none or the model has memory. [K]"""
        if self.bench.memory:
            return None
        try:
            settled, _ = settle(self.engine, self.assembled, self.begin + 0.5 * HELD_AFTER_END)
        except (SolverError, ScenarioError):
            return None
        return dict(zip(names, self.named(settled[None, :], names, np.array([0.5 * HELD_AFTER_END]))[0].tolist(), strict=True))

    def slowest(self, state: Array) -> float:
        """Return the longest time constant at a state (nodes,); zero where there is none. [s]"""
        constants = self.engine.time_constants(self.assembled, state, self.begin + 0.5 * HELD_AFTER_END)
        return float(constants[0]) if constants.size else 0.0


def reason_for_one_run(model: Model, scenario: Scenario) -> str:
    """Return why stretches cannot be run one by one: a thermostat, an input or a gas with a clock of its own; empty where they can."""
    for load in network_for(model, scenario).flat.loads:
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
class WaitResult:
    """When and how a rule of stability came to hold.

    Parameters
    ----------
    after : float       Time waited. [s]
    slowest : str       The node that was stable last.
    rate : float        Its rate over the window before. [K/s]
    """

    after: float
    slowest: str
    rate: float


@dataclass(frozen=True)
class WaitRequest:
    """A rule of stability to wait for.

    Parameters
    ----------
    rule : StabilityRule
    watch : tuple of str            Nodes that must be stable.
    base : str                      Node that must also be at its level; empty for none.
    level, tolerance : float        Level of the base, and how far it may be off. [K]
    longest : float                 Time after which the wait is given up. [s]
    where : str                     Place for messages.
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
        """Time over which changes are taken: the rule's, or a minute. [s]"""
        return self.rule.window or SIMULATED_WINDOW


def wait_until_stable(leg: Leg, state: Array, wanted: WaitRequest) -> WaitResult:
    """Return when the rule holds for every watched node, interpolated between two outputs.

    Raises
    ------
    SolverError     When it does not hold within the longest wait; with the node, its rate and the rule.
    ScenarioError   When a rule on stored heat is asked of averages.
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
        if axis.size > MAX_OUTPUTS and not wanted.average:  # of a long wait pairs of neighbours, one step apart
            coarse = np.round(np.linspace(axis[0], axis[-1], MAX_OUTPUTS // 2) / step) * step
            axis = np.unique(np.concatenate([coarse, coarse - step]))[1:]
        run, _ = leg.run(state, axis)
        times, traces = np.append(0.0, axis), np.vstack((state, run))
        excess, movers = _rule_excess(leg, wanted, times, traces)
        held = np.flatnonzero(excess <= 0.0)
        if held.size:
            k = int(held[0])
            after = float(times[k])
            if k and np.isfinite(excess[k - 1]):
                after -= float((times[k] - times[k - 1]) * excess[k] / (excess[k] - excess[k - 1]))
            slowest = wanted.watch[movers[max(k - 1, int(np.flatnonzero(np.isfinite(excess))[0]))]]
            return WaitResult(after, slowest, _rate_over_window(leg, wanted, times, traces, slowest, after))
        if reach >= wanted.longest:
            raise SolverError(_not_stable_message(leg, wanted, times, traces, int(movers[-1])), wanted.where, code="run.not-stable")
        reach *= 2.0


def _rule_excess(leg: Leg, wanted: WaitRequest, times: Array, traces: Array) -> tuple[Array, NDArray[np.int64]]:
    """Return by how much the rule is exceeded at each time (times,), and the index of the node furthest from it (times,).

    It is max over nodes of (T_max - T_min in the window) - rate window [K]; of a rule on stored heat |sum C dT| / window - share power [W].
    With a base plate it is at least |T_base - level| - tolerance. Before one whole window it is infinite.
    """
    of = _trailing_mean(leg.named(traces, wanted.watch, times), times, wanted.average)
    before = np.searchsorted(times, times - wanted.window - 1e-6 * wanted.window)
    is_due = times >= (wanted.window + wanted.average) * (1.0 - 1e-9)
    never = np.full(of.shape[1], np.inf)
    spans = np.stack([np.ptp(of[before[k] : k + 1], axis=0) if is_due[k] else never for k in range(times.size)])
    movers = np.argmax(np.where(np.isfinite(spans), spans, -1.0), axis=1)
    if wanted.rule.stored:
        heat = traces @ leg.engine.capacities(leg.assembled)
        power = leg.power(traces[-1])
        stored = np.array([abs(heat[k] - heat[before[k]]) / wanted.window if is_due[k] else np.inf for k in range(times.size)])
        excess = stored - wanted.rule.rate * power if power > 0 else np.full(times.size, np.inf)
    else:
        excess = spans.max(axis=1) - wanted.rule.rate * wanted.window
    if wanted.base:
        base = _trailing_mean(leg.named(traces, (wanted.base,), times), times, wanted.average)[:, 0]
        off = np.abs(base - wanted.level) - wanted.tolerance
        excess = np.maximum(excess, off)
    return excess, movers


def _trailing_mean(of: Array, times: Array, average: float) -> Array:
    """Return temperatures (times, nodes) averaged over the time `average` [s] before each output, by trapezoids. [K]

    `of` (times, nodes) are the temperatures at evenly spaced `times` (times,) [s]. Outputs before one whole average stay as they are.
    """
    if not average:
        return of
    count = round(average / float(times[1] - times[0]))
    inside = np.vstack((np.zeros((1, of.shape[1])), np.cumsum(0.5 * (of[1:] + of[:-1]), axis=0)))
    out = of.copy()
    out[count:] = (inside[count:] - inside[:-count]) / count
    return out


def _rate_over_window(leg: Leg, wanted: WaitRequest, times: Array, traces: Array, node: str, time: float) -> float:
    """Return (T(time) - T(time - window)) / window of a node. [K/s]"""
    of = _trailing_mean(leg.named(traces, (node,), times), times, wanted.average)[:, 0]
    now, then = np.interp([time, time - wanted.window], times, of)
    return float((now - then) / wanted.window)


def _not_stable_message(leg: Leg, wanted: WaitRequest, times: Array, traces: Array, mover: int) -> str:
    """Return why a wait was given up, and what to do: node, rate, rule, and the steady state if there is one."""
    node = wanted.watch[mover]
    rate = _rate_over_window(leg, wanted, times, traces, node, float(times[-1]))
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


def chamber_setup(
    model: Model,
    profile: ThermalProfile,
    chamber: str | Sequence[str],
    equipment: Sequence[str] | None,
    base: Scenario,
    options: Options,
) -> tuple[ChamberSetup, ChamberConditions]:
    """Return the model in its chamber, and the conditions at the start.

    Arguments are those of `run_profile`; `base` is the scenario with the inputs that the profile does not give.

    Raises
    ------
    ScenarioError   When a name is no boundary or load, or a boundary has no temperature.
    """
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
    memory = reason_for_one_run(model, scenario.with_(boundaries={name: Constant(ambient) for name in names}))
    bench = ChamberSetup(model, scenario, names, switched, gases, options, memory)
    humid = profile.value("humidity") if profile.has("humidity") else None
    first = next((s.power for s in steps if s.power is not None), True)
    return bench, ChamberConditions(ambient, bool(first), ATMOSPHERE if thin else None, humid)


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
    """Run a profile on a model: ways, waits until the unit is stable, dwells, off times and starts.

    Parameters
    ----------
    model : Model
    profile : ThermalProfile
    chamber : str or sequence       Boundaries that are the chamber (gas, shroud, plate); needed where the model has several.
    base : str                      Base plate. Levels then apply to it: the chamber is set so that it settles there, and it must be within
                                    the tolerance before a dwell begins. Without it levels apply to the chamber.
    watch : sequence                Nodes that must be stable; all that store heat by default.
    equipment : sequence            Loads that power switches; by default all without a thermostat or a controller.
    scenario : Scenario             Other inputs: boundaries, loads, environment, start.
    values : dict                   Parameters in place of the deck's.
    chamber_ramp : str or float     Fastest rate of the chamber, where it is below that of the profile. [K/s]
    every : str or float            Interval of the stored samples. [s]
    options : Options               Of the integrator.
    progress : callable             Called after each step with its number, the number of steps and the time reached [s]; after the last
                                    also with each pass of the humidity's balance. An exception of it ends the run.

    Returns
    -------
    run : ProfileRun                Its phases, and the whole course as one solution.

    Raises
    ------
    ScenarioError   When names do not fit, or a number of the profile is missing.
    SolverError     When the unit does not become stable within the longest wait; with the node, its rate and the rule.
    """
    if {"hot", "cold"} & set(profile.used):
        check_level_order(profile)
    if values:
        model = model.with_values(values, profile.title)
    limit = float("inf") if chamber_ramp is None else amount(chamber_ramp, "K/s", "chamber_ramp")
    if limit <= 0.0:
        raise ScenarioError("the chamber's rate of change must be above zero.", "chamber_ramp", code="value.outside-range")
    bench, start = chamber_setup(model, profile, chamber, equipment, scenario or Scenario(profile.title), options or Options())
    network = network_for(bench.model, bench.base)
    massive = [n for n in network.nodes if network.numbers().capacitances.get(n) is not None]
    course = _Course(bench, profile, start, tuple(map(network.find, watch or massive)), base and network.find(base), limit)
    for k, step in enumerate(profile.steps, 1):
        course.do(step)
        if progress is not None:
            progress(k, len(profile.steps), course.plan.times[-1])
    return _as_profile_run(course, every, progress)


class _Course:
    """A test while it is run: conditions and temperatures reached, and the phases so far.

    Parameters
    ----------
    watch : tuple of str    Nodes that must be stable.
    base : str              Base plate; empty for none.
    limit : float           Fastest rate of the chamber. [K/s]
    """

    def __init__(
        self, bench: ChamberSetup, profile: ThermalProfile, start: ChamberConditions, watch: tuple[str, ...], base: str, limit: float
    ) -> None:
        self.bench, self.profile, self.watch, self.base, self.limit = bench, profile, watch, base, limit
        self.plan = Timeline((0.0,), (start,))
        first = Leg.of_scenario(bench, self.plan.scenario(bench.base, bench, profile.title, tail=1.0), 0.0)
        self.state: Array = first.engine.started(first.assembled).initial
        self.last, self.ran = first, 0.0
        self.phases: list[Phase] = []
        self.rule: StabilityRule | None = StabilityRule.named(profile.word("stable", "")) if profile.has("stable") else None
        self.level = start.chamber
        self.remarks: dict[str, None] = {}

    @property
    def now(self) -> ChamberConditions:
        """Conditions at the time that is reached."""
        return self.plan.states[-1]

    def do(self, step: ProfileStep) -> None:
        """Run one step: the way to its conditions, the wait, the stay."""
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
        span = self._way_duration(step, after)
        if span > 0.0:
            self._run_for(step, after, span, "way")
        else:
            self.plan = self.plan.then(0.0, after)
        if step.wait:
            self._wait(step)
        if step.dwell > 0.0:
            self._run_for(step, self.now, step.dwell, "stay")

    def _way_duration(self, step: ProfileStep, after: ChamberConditions) -> float:
        """Return how long the way to other conditions takes: the step's time or |dT| / ramp, at least |dT| / the chamber's limit. [s]"""
        way = abs(after.chamber - self.now.chamber)
        if not (way > 0.0 or after.pressure != self.now.pressure or after.humidity != self.now.humidity):
            return 0.0
        wanted = step.over if step.over is not None else way / step.ramp if step.ramp else 0.0
        least = way / self.limit
        if least > wanted:
            self.remarks[f"the chamber is limited to {60.0 * self.limit:.3g} K/min, slower than the profile requires"] = None
        return max(wanted, least)

    def _set_point(self, after: ChamberConditions, level: float) -> float:
        """Return the temperature of the chamber at which the base plate settles at a level, by the secant method. [K]

        Without a base plate, or where nothing settles, it is the level itself.

        Raises
        ------
        ScenarioError   When no temperature brings it there.
        """
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

    def _run_for(self, step: ProfileStep, after: ChamberConditions, span: float, kind: str) -> None:
        """Run on for a time `span` [s]: on the ``way`` to the conditions `after`, or at a ``stay`` under them; a phase is added."""
        leg = self.bench.leg(self.plan, after, span if kind == "way" else 0.0)
        _, final = leg.run(self._state_for(leg), np.array([span]))
        self._add_phase(step, leg, after, final, span, kind)

    def _state_for(self, leg: Leg) -> Array:
        """Return the temperatures reached in the order of a leg's nodes; a joint's gas is a node only while it is pumped out. [K]"""
        if leg.nodes == self.last.nodes:
            return self.state
        return np.asarray(self.last.named(self.state[None, :], leg.nodes, np.array([self.ran]))[0])

    def _wait(self, step: ProfileStep) -> None:
        """Run on until the rule holds; a phase is added.

        Raises
        ------
        ScenarioError   When the profile has no rule.
        SolverError     When it does not hold within the longest wait.
        """
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
        wanted = WaitRequest(self.rule, self.watch, base, self.level, tolerance, self.profile.value("longest_wait"), where, average)
        leg = self.bench.leg(self.plan, self.now, 0.0)
        begun = self._state_for(leg)
        reached = wait_until_stable(leg, begun, wanted)
        _, final = leg.run(begun, np.array([reached.after]))
        self._add_phase(step, leg, self.now, final, reached.after, "wait", self.rule.name, reached.slowest, reached.rate)

    def _add_phase(
        self,
        step: ProfileStep,
        leg: Leg,
        after: ChamberConditions,
        final: Array,
        span: float,
        kind: str,
        rule: str = "",
        slowest: str = "",
        rate: float = 0.0,
    ) -> None:
        """Add a phase that ends in the conditions `after` at temperatures `final` (nodes,) [K] after `span` seconds, and go on from there.

        It states the node that is furthest from its steady state then. Rule, slowest node and its rate [K/s] are those of a wait.
        """
        kelvin = leg.named(final[None, :], self.watch, np.array([span]))[0]
        steady = leg.steady(self.watch) if kind != "way" else None
        to_go = {n: steady[n] - float(t) for n, t in zip(self.watch, kelvin, strict=True)} if steady else {}
        furthest = max(to_go, key=lambda n: abs(to_go[n])) if to_go else ""
        base = float(leg.named(final[None, :], (self.base,), np.array([span]))[0, 0]) if self.base else None
        self.phases.append(
            Phase(
                step.name,
                step.cycle,
                kind,
                self.plan.times[-1],
                span,
                self.now.power if step.power is None else step.power,
                after.chamber,
                rule,
                slowest,
                rate,
                furthest,
                to_go.get(furthest),
                base,
            )
        )
        self.plan, self.state, self.last, self.ran = self.plan.then(span, after), final, leg, span


def _as_profile_run(course: _Course, every: str | float, progress: Callable[[int, int, float], None] | None) -> ProfileRun:
    """Return the run: the whole course simulated once more as one solution, with its moisture and remarks.

    Raises
    ------
    ScenarioError   When the interval of output is not above zero.
    """
    bench, profile, plan = course.bench, course.profile, course.plan
    scenario = plan.scenario(bench.base, bench, profile.title)
    step = amount(every, "s", "every")
    if step <= 0.0:
        raise ScenarioError("the interval of output must be above zero.", "every", code="value.outside-range")
    times = np.unique(np.concatenate([np.arange(0.0, scenario.seconds, step), plan.times]))
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
