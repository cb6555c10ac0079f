"""A profile run on a model: phase by phase, each dwell beginning when the unit is stable."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from thermid.arguments import takes_objects
from thermid.errors import ScenarioError, nearest
from thermid.extensions import extension
from thermid.measure.record.steadiness import StabilityRule, rule_of
from thermid.model.laws.signal import Constant, literal
from thermid.model.tree.model import Model
from thermid.network.network import compile_network
from thermid.profile_runs.legs import ChamberConditions, ChamberSetup, Leg, Timeline, memory_of
from thermid.profile_runs.profile_run import Phase, ProfileRun, SettledWater
from thermid.profile_runs.waiting import Wanted, wait
from thermid.profiles.profile import ProfileStep, ThermalProfile, ordered
from thermid.simulation.scenarios.scenario import Scenario
from thermid.simulation.simulator import network_for
from thermid.simulation.solver.problem import Options
from thermid.simulation.transient import simulate


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
    asked = (chamber,) if isinstance(chamber, str) else tuple(chamber)
    if not asked and len(network.boundaries) != 1:
        raise ScenarioError(f"say which boundaries are the chamber: chamber = ... out of {', '.join(network.boundaries)}.", profile.title)
    names = tuple(model.canonical(n) for n in asked) or network.boundaries
    for name in names:
        if name not in network.boundaries:
            raise ScenarioError(f"'{name}' is no boundary.{nearest(name, network.boundaries)}", f"{profile.title}, chamber")
    free = [b for b in network.boundaries if b not in names and b not in {model.canonical(k) for k in base.boundaries}]
    if free:
        raise ScenarioError(
            f"boundary '{free[0]}' is not the chamber and has no temperature. Name it in chamber, or give it one in the scenario.",
            profile.title,
        )
    loads = {load.path: load for load in network.flat.loads}
    switched = tuple(model.canonical(n) for n in equipment) if equipment is not None else ()
    for name in switched:
        if name not in loads:
            raise ScenarioError(f"there is no load '{name}' to switch.{nearest(name, loads)}", f"{profile.title}, equipment")
    if equipment is None:
        controlled = ("thermostat", "proportional")
        switched = tuple(p for p, load in loads.items() if not any(f.startswith(controlled) for f in load.fields))
    ambient = profile.value("ambient")
    others = {k: v for k, v in base.boundaries.items() if model.canonical(k) not in names}
    steps = profile.steps
    thin = any(s.pressure is not None for s in steps)
    kept = replace(
        base,
        boundaries=others,
        loads={model.canonical(k): v for k, v in base.loads.items()},
        commands={model.canonical(k): v for k, v in base.commands.items()},
        start=base.start if base.start != "" else ambient,
    )
    gases = tuple(n for n in names if n in base.environment) or (("*",) if thin else ())
    bench = ChamberSetup(model, kept, names, switched, gases, profile.ground, options, memory_of(model, _kept_with(kept, names, ambient)))
    humid = profile.value("humidity") if profile.has("humidity") else None
    first = next((s.power for s in steps if s.power is not None), True)
    return bench, ChamberConditions(ambient, bool(first), profile.ground if thin else None, humid)


def _kept_with(base: Scenario, chamber: tuple[str, ...], kelvin: float) -> Scenario:
    """Return a scenario with the chamber at a temperature."""
    return base.with_(boundaries={name: Constant(kelvin) for name in chamber})


def node_of(bench: ChamberSetup, name: str) -> str:
    """Return the path of a node."""
    network = network_for(bench.model, bench.base)
    return network.find(name)


def watched(bench: ChamberSetup, watch: Sequence[str]) -> tuple[str, ...]:
    """Return the nodes that must be stable."""
    network = network_for(bench.model, bench.base)
    if watch:
        return tuple(network.find(n) for n in watch)
    capacities = network.numbers().capacitances
    return tuple(n for n in network.nodes if capacities.get(n) is not None)


Array = NDArray[np.float64]
SET_POINT_TRIES = 12
MOIST_SAMPLES = 400
"""Outputs over which humidity is followed; the balance of vapour takes steps of its own between them."""


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
    told: Callable[[int, int, float], None] | None = None,
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
    told : callable                 Told after each step its number, how many there are, and the time reached in seconds; at the end of them
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
    limit = float("inf") if chamber_ramp is None else _rate(chamber_ramp)
    bench, start = bench_of(model, profile, chamber, equipment, scenario or Scenario(profile.title), options or Options())
    course = _Course(bench, profile, start, watched(bench, watch), base and node_of(bench, base), limit)
    for k, step in enumerate(profile.steps, 1):
        course.do(step)
        if told is not None:
            told(k, len(profile.steps), course.plan.times[-1])
    return _finished(course, every, told)


def _rate(given: str | float) -> float:
    """Return what a chamber can. [K/s]"""
    found = literal(given, "K/s", "chamber_ramp") if isinstance(given, str) else float(given)
    if found <= 0.0:
        raise ScenarioError("a chamber that cannot change its temperature runs no profile.", "chamber_ramp")
    return found


class _Course:
    """The test so far: conditions, state, phases."""

    def __init__(
        self, bench: ChamberSetup, profile: ThermalProfile, start: ChamberConditions, watch: tuple[str, ...], base: str, limit: float
    ) -> None:
        self.bench, self.profile, self.watch, self.base, self.limit = bench, profile, watch, base, limit
        self.plan = Timeline((0.0,), (start,))
        first = Leg.of(bench, self.plan.scenario(bench.base, bench, profile.title, tail=1.0), 0.0)
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
        asked = step.over if step.over is not None else way / step.ramp if step.ramp else 0.0
        least = way / self.limit
        if least > asked:
            self.remarks[f"the chamber is limited to {60.0 * self.limit:.3g} K/min, slower than the profile asks for"] = None
        return max(asked, least)

    def _set_point(self, after: ChamberConditions, level: float) -> float:
        """Return the temperature of the chamber at which the base plate settles at its level. [K]"""
        if not self.base:
            return level
        at, found = level, []  # type: float, list[tuple[float, float]]
        for _ in range(SET_POINT_TRIES):
            leg = self.bench.leg(Timeline((0.0,), (replace(after, chamber=at),)), replace(after, chamber=at), 0.0)
            steady = leg.steady((self.base,))
            if steady is None:
                self.remarks[f"'{self.base}' has no steady state to aim at: the chamber stays at the level itself"] = None
                return level
            off = steady[self.base] - level
            if abs(off) < 1e-3:
                return at
            found.append((at, off))
            moved = found[-1][0] - found[-2][0] if len(found) > 1 else 0.0
            slope = (found[-1][1] - found[-2][1]) / moved if moved else 1.0
            if abs(slope) < 1e-3 or (len(found) > 1 and not moved):
                break
            at = max(at - off / slope, 5.0)
        raise ScenarioError(
            f"no temperature of the chamber brings '{self.base}' to {level - 273.15:.1f} degC; the level is out of its reach.",
            self.profile.title,
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
            raise ScenarioError("it waits for a stable unit and has no rule for that. Give it: stable = '3 C/h'.", self.profile.title)
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
        after = self.now if kind != "way" else None
        at = leg.named(final[None, :], self.watch, np.array([span]))[0]
        steady = leg.steady(self.watch) if kind != "way" else None
        left = {n: steady[n] - float(t) for n, t in zip(self.watch, at, strict=True)} if steady else {}
        furthest = max(left, key=lambda n: abs(left[n])) if left else ""
        chamber = (after or leg_end(leg, self.bench, span)).chamber
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
                left.get(furthest),
                base,
            )
        )


def leg_end(leg: Leg, bench: ChamberSetup, span: float) -> ChamberConditions:
    """Return the temperature of the chamber at the end of a way."""
    at = leg.wiring.boundary(bench.chamber[0], np.array([leg.begin + span]), leg.assembled.offsets)
    return ChamberConditions(float(at[0]), True)


def _finished(course: _Course, every: str | float, told: Callable[[int, int, float], None] | None) -> ProfileRun:
    """Return the run: the whole course as one solution, its moisture, its remarks."""
    bench, profile, plan = course.bench, course.profile, course.plan
    scenario = plan.scenario(bench.base, bench, profile.title)
    step = literal(every, "s", "every") if isinstance(every, str) else float(every)
    if step <= 0.0:
        raise ScenarioError("the interval of output must be above zero.", "every")
    grid = np.arange(0.0, scenario.seconds, step)
    times = np.unique(np.concatenate([grid, plan.times]))
    times = times[np.append(True, np.diff(times) > 1e-6)]
    solution = simulate(bench.model, scenario, times=times, options=bench.options)
    wet: SettledWater | None = None
    damp = plan.humidity()
    if damp is not None:
        steps, interval = len(profile.steps), max(step, scenario.seconds / MOIST_SAMPLES)
        still = None if told is None else lambda count, moved: told(steps, steps, scenario.seconds)
        humid = extension("humidity along a profile", profile.title)
        wet, remark = humid(bench.model, scenario, damp, bench.chamber, solution, interval, still)
        solution = wet.solution
        course.remarks |= dict.fromkeys((remark, *wet.warnings) if remark else wet.warnings)
    return ProfileRun(profile, tuple(course.phases), scenario, solution, wet, tuple(course.remarks), course.base, bench.chamber)
