"""`next_test`: which of the tests that could be made would say most of a parameter, or of a prediction, and how long it would take."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from thermid.base.arguments import guard_methods
from thermid.base.errors import IdentificationError, NameNotFoundError, ThermidError, nearest, quoted, with_time_left
from thermid.base.linear_algebra import variance
from thermid.base.results import Result, Shown
from thermid.base.units import HOUR, Array, amount, duration_text, short, value_of
from thermid.fit.calibration import (
    SCALE,
    Binned,
    Calibration,
    Experiment,
    Prior,
    Problem,
    Request,
    TraceNoise,
    Unknown,
    answers_to_inputs,
    build_problem,
    percent,
    prior_of,
    priors_of,
    role_and_target,
    score_excess,
)
from thermid.fit.error_model import BandCause, KeptWay, course_in_fit, deviations_of_run, widened, with_heats
from thermid.inference.planned_records import Sensor, planned_record
from thermid.model.tree import Constant, Model, Parameter, Signal, TableSignal, literal
from thermid.prediction._budget import AVERAGED, Budget, budget_of
from thermid.prediction._known import Knowledge, Rows, rows_of
from thermid.prediction._predict import WayAnswer, mixed_answer
from thermid.prediction._setting import prepared
from thermid.simulation.runs import Scenario, Workers, compile_network, in_tasks, network_for, simulate
from thermid.values.store import AS_FITTED, EXPECTED, INPUT, Normal, Source

CHAMBER_STEP = 20.0
"""Step of a chamber that costs little and is far from what most parts fear. [K]"""
MIN_SHARE_OF_ERROR = 0.1
"""Part of the error now below which what else a prediction has is not spoken of."""
WITHOUT_GAS = " without gas"
"""After the name of a value that is another one without gas."""
UNTESTED_CAUSES = (BandCause.STRUCTURE, BandCause.RUN, BandCause.ROOM, BandCause.UNEXPLAINED)
"""Causes that a test adds no information to: they are said beside."""
NO_ERROR_SUFFIX = ": open"
"""After the name of a value, its source where no fit has a finite error of it."""
MAX_THIN_PRESSURE = 1e4
"""Pressure below which gas no longer does what it did in the room. [Pa]"""
EMISSIVITY_SD = 0.15
"""What an emissivity of a deck is good to, where no finish says it. [-]"""
JOINT_LOG_SD = 0.7
"""Standard deviation of the logarithm of a joint's conductance without gas about that with it: a factor of two either way. Gas carries more
than half of the heat between bare, lightly pressed faces (Yovanovich, IEEE Trans. CPT 28 (2005) 182); a filled joint loses nothing. [-]"""
SWITCHING_REMARK = (
    "not counted: temperatures switch parts of tests such as '{}', and readings near an instant of switching tell less than these figures "
    "say"
)
NAME = "next test"
DURATIONS = 24
MIN_SINGULAR_VALUE = 1e-9
"""Part of what readings see best from which they see a direction."""
REPEAT_SHARE_OF_STEP, MIN_ERROR_RATIO = 0.25, 1.1
"""Part of a step within which temperatures repeat a log's; how many times larger an error must be there to be spoken of."""
SHARE_OF_GAIN = 0.9
"""A test is long enough when it has brought nine tenths of what it could."""
AGAIN, PUMPED_DOWN = "the same test again", "the same, pumped down"
"""Two of the tests that are proposed without being asked for."""


@guard_methods
@dataclass(frozen=True)
class Aim(Shown):
    """A temperature that is to be known better.

    Parameters
    ----------
    scenario : Scenario     Where.
    node : str              Of what.
    at : str or float       When; the end when empty. [s]
    """

    scenario: Scenario
    node: str
    at: str | float = ""

    def __str__(self) -> str:
        """It in words."""
        when = f" at {self.at}" if self.at else " at the end"
        return f"'{self.node}' in '{self.scenario.title}'{when}"


@guard_methods
@dataclass(frozen=True, eq=False)
class Action(Shown):
    """A test that could be made.

    Parameters
    ----------
    name : str                  In words.
    scenario : Scenario         What is done; its duration is the longest that is thought of.
    sensors : tuple of Sensor   What is logged; empty for the sensors there are.
    """

    name: str
    scenario: Scenario
    sensors: tuple[Sensor, ...] = ()


def usual_actions(model: Model, scenario: Scenario, sensors: Sequence[Sensor]) -> tuple[Action, ...]:
    """Return the tests that are usually at hand: the same for longer, power and chamber steps, other powers, another sensor, a pump-down.

    Parameters
    ----------
    model : Model
    scenario : Scenario             A test as it was made; its duration holds for all.
    sensors : sequence of Sensor    What is logged.
    """
    network = network_for(model, scenario)
    half = 0.5 * scenario.seconds
    out = [Action(AGAIN, scenario)]
    powers = {row.name: float(value_of(row.coefficients[0])) for row in network.numbers().loads if row.fixed}
    metered = {s.target for s in sensors if s.role == "load"} | set(scenario.loads)
    for load, deck_power in powers.items():
        watts = _initial_level(scenario.loads.get(load), deck_power)
        if watts > 0 and load not in scenario.commands:
            # a power that nobody meters is as unknown at twice its level as it is now: then the command changes, not the power
            table, unit = ("loads", watts) if load in metered else ("commands", 1.0)
            words = f"from {watts:.3g} to {2 * watts:.3g} W" if load in metered else "to twice its power"
            up, off = (TableSignal(np.array([0.0, half]), unit * np.array([1.0, end]), True) for end in (2.0, 0.0))
            out.append(Action(f"'{load}' {words} after half the time", scenario.with_(**{table: {load: up}})))
            twice = f"at {2 * watts:.3g} W" if load in metered else "at twice its power"
            out.append(Action(f"'{load}' {twice}", scenario.with_(**{table: {load: Constant(2.0 * unit)}})))
            out.append(Action(f"'{load}' off after half the time", scenario.with_(**{table: {load: off}})))
    for boundary, signal in scenario.boundaries.items():
        level = _initial_level(signal, 0.0)
        ramp = TableSignal(
            np.array([0.0, half, half + 600.0, max(2.0 * half, half + 601.0)]), level + np.array([0.0, 0.0, 1.0, 1.0]) * CHAMBER_STEP
        )
        variant = scenario.with_(boundaries={boundary: ramp})
        out.append(Action(f"'{boundary}' {CHAMBER_STEP:g} K warmer after half the time", variant))
    measured_nodes = {s.target for s in sensors if s.role == "node"}
    noise = min((s.noise for s in sensors if s.role == "node" and s.noise), default=0.1)
    accuracy = next((s.accuracy for s in sensors if s.role == "node" and s.accuracy), None)
    for node in (n for n in network.nodes if n not in measured_nodes):
        more = Sensor(f"new sensor at {node}", node, "node", noise, accuracy)
        out.append(Action(f"the same with a sensor at '{node}'", scenario, (*sensors, more)))
    out.append(Action(PUMPED_DOWN, scenario.vacuum()))
    return tuple(out)


def _initial_level(signal: Signal | None, deck_level: float) -> float:
    """Return the value of a signal at time zero; `deck_level` where there is no signal."""
    return deck_level if signal is None else float(signal.at(np.zeros(1))[0])


@dataclass(frozen=True)
class Option:
    """A test that could be made, and what it would be worth.

    Parameters
    ----------
    name : str              What is done.
    error : float           Standard error of the target after all of it; infinite where it cannot be made. [SI]
    hours : float           Duration after which the goal is met, or, without one, nine tenths of the gain are in; infinite where never.
    longest : float         Its whole duration. [h]
    errors : array (durations, 2)   Duration [h] and error [SI].
    refused : str           Why it cannot be made; empty where it can.
    alike : float           Standard error where temperatures repeat a log's to a fraction of its sensors' steps, so that readings are
                            rounded as they were; nan where no log had such temperatures or no sensor has steps. [SI]
    """

    name: str
    error: float
    hours: float
    longest: float
    errors: Array
    refused: str = ""
    alike: float = float("nan")


@dataclass(frozen=True, eq=False)
class Advice(Result):
    """What to test next.

    Parameters
    ----------
    target : str            What is to be known better.
    value, now : float      Its value and standard error now. [SI]
    unit : str              'K' for a prediction; SI unit of a parameter otherwise.
    goal : float            Error to be reached; nan without one. [SI]
    options : tuple         The best first.
    beside : dict           Of a prediction: cause -> standard error [K] that it has besides and that these figures leave out.
    remarks : tuple of str  What the figures take for granted of the noise.
    not_counted : str       What no figure counts, printed first; empty where nothing.
    """

    target: str
    value: float
    now: float
    unit: str
    goal: float
    options: tuple[Option, ...]
    beside: Mapping[str, float] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()
    not_counted: str = ""

    @property
    def best(self) -> Option:
        """The first option."""
        return self.options[0]

    def _shown(self, error: float) -> str:
        """Return an error in K, or in per cent of the value of a parameter."""
        return f"{short(error)} K" if self.unit == "K" else percent(error / abs(self.value) if self.value else np.inf)

    def __str__(self) -> str:
        """Return a table: what to do, what error it leaves, how long it takes."""
        aim = f", wanted +- {self._shown(self.goal)}" if np.isfinite(self.goal) else ""
        is_met = self.now <= self.goal  # never without a goal
        aim += ". The goal is met already; no further test is needed for it" if is_met else ""
        lines = [*filter(None, [self.not_counted]), f"Next test for {self.target}: now +- {self._shown(self.now)}{aim}"]
        width = max(len(o.name) for o in self.options)
        for o in self.options:
            if o.refused:
                lines.append(f"  {o.name:<{width}}  cannot be made: {o.refused}")
                continue
            gain = f"{short(self.now / o.error)} times better" if self.now > 1.02 * o.error else "no better"
            took = duration_text(HOUR * o.hours) if np.isfinite(o.hours) else ""
            what = "goal after" if np.isfinite(self.goal) and not is_met else "most of it after"
            long = duration_text(HOUR * o.longest)
            when = f"{what} {took} of {long}" if took else f"goal not within {long}"
            lines.append(f"  {o.name:<{width}}  +- {self._shown(o.error):<10} {gain:<20} {when}")
        relevant = {cause: error for cause, error in self.beside.items() if error >= MIN_SHARE_OF_ERROR * self.now}
        if relevant:
            named = ", ".join(f"{cause} +- {short(error)} K" for cause, error in relevant.items())
            nearer = (
                f" No test is credited with what it tells of '{BandCause.STRUCTURE}': one in the gas and near the state asked narrows it."
            )
            lines.append(f"  Not included in these figures: {named}.{nearer if BandCause.STRUCTURE in relevant else ''}")
        lines += [f"  {remark}" for remark in self.remarks]
        return "\n".join(lines)


@dataclass(frozen=True, eq=False)
class Before:
    """What a budget says before a test, and what the budget does not hold: instruments.

    Parameters
    ----------
    budget : Budget         Of what is known, in the scenario of the prediction that is asked for.
    instruments : Rows      Constant errors of sensors and powers; sources that values respond to as well bear one name.
    readings : dict         Instrument -> its value. [SI]
    held : dict             Name -> information that a prior has brought already, in the fitted form.
    spread : float          Readings that do not wander scatter so many times as much as their noise says. [-]
    noise : dict            Sensor -> how its residuals wandered; the longest trace of each.
    sizes : dict            Sensor -> the noise in whose squares that is given. [K]
    untie : bool            Whether instances have values of their own.
    thin : bool             Whether it was learnt with thin gas already.
    seen : dict             Sensor -> times [s] and what each log's model says that it read [K].
    split : tuple of str    Emissivities that an effective coefficient was split into.
    departing : KeptWay or None     What of a planned run differs from other runs, where the errors of the fit count that.
    worth : dict            Sensor whose readings count less, as they are said to be correlated or weigh less -> as many a second. [1/s]
    """

    budget: Budget
    instruments: Rows = field(default_factory=Rows)
    readings: Mapping[str, float] = field(default_factory=dict)
    held: Mapping[str, float] = field(default_factory=dict)
    spread: float = 1.0
    noise: Mapping[str, TraceNoise] = field(default_factory=dict)
    sizes: Mapping[str, float] = field(default_factory=dict)
    untie: bool = False
    thin: bool = False
    seen: Mapping[str, Sequence[tuple[Array, Array]]] = field(default_factory=dict)
    split: tuple[str, ...] = ()
    departing: KeptWay | None = None
    worth: Mapping[str, float] = field(default_factory=dict)

    @property
    def model(self) -> Model:
        """The model, effective coefficients split where the prediction needs it."""
        return self.budget.model

    @cached_property
    def place(self) -> dict[str, int]:
        """Source -> its column."""
        names = [s.name for s, cause in zip(self.budget.sources, self.budget.causes, strict=True) if cause not in UNTESTED_CAUSES]
        return {name: k for k, name in enumerate(dict.fromkeys([*names, *(s.name for s in self.instruments.sources)]))}

    @property
    def information(self) -> Array:
        """What is known of each source (sources,): one, or nothing of a value without a finite error."""
        return np.array([0.0 if name.endswith(NO_ERROR_SUFFIX) else 1.0 for name in self.place])

    @cached_property
    def free(self) -> dict[str, tuple[str, ...]]:
        """Parameter that is not known exactly -> all paths that share its value."""
        return {t.name: (t.name, *t.also) for t in self.budget.targets if t.form in ("add", "log")}

    @cached_property
    def values(self) -> dict[str, float]:
        """Name -> value, of parameters and instruments. [SI]"""
        numbers = compile_network(self.model).numbers().values
        return {p: float(value_of(numbers[p])) for p in self.free} | dict(self.readings)

    @cached_property
    def responses(self) -> dict[str, Array]:
        """Name -> change of the value per standard deviation of each source (sources,). [SI]

        A logarithm is taken back to the value to first order, ``dv = v d(ln v)``. The value without gas (`WITHOUT_GAS`) responds as the
        value with gas, plus what its factor adds.
        """
        out: dict[str, Array] = {}
        for t, row in zip(self.budget.targets, self.budget.gain, strict=True):
            if t.form in ("add", "log", "factor"):
                moved = (1.0 if t.form == "add" else self.values[t.name]) * self.placed(row)
                out[t.name + WITHOUT_GAS if t.form == "factor" else t.name] = moved + (out[t.name] if t.form == "factor" else 0.0)
        for name, log, row in zip(self.instruments.names, self.instruments.log, self.instruments.matrix, strict=True):
            by_source = np.zeros(len(self.place))
            by_source[[self.place[s.name] for s in self.instruments.sources]] = row
            out[name] = by_source * (self.values[name] if log else 1.0)
        return out

    def placed(self, column: Array) -> Array:
        """Return what a standard deviation s of each source does (sources,), s x, from what a unit of each source of the budget does.

        That is `column` x (sources of the budget,) [K per unit of the source]. What only a value as fitted errs by is left out, as it is
        of the errors that a fit states first.
        """
        out = np.zeros(len(self.place))
        for s, size, x in zip(self.budget.sources, self.budget.sizes, column, strict=True):
            if s.name in self.place and EXPECTED not in s.name and AS_FITTED not in s.name:
                out[self.place[s.name]] = size * x
        return out

    def temperature(self, node: str, at: float) -> tuple[Array, float, dict[str, float]]:
        """Return how a node's temperature `at` a time [s] responds (sources,), its value, and cause -> error that no test takes away. [K]

        The response is in K per standard deviation of a source, of the likeliest way, scaled so that its squares sum to the variance of
        all ways.
        """
        ways = WayAnswer.of_budget(self.budget, [node], prepared(self.budget, times=[at]))
        ways = [replace(w, linear=w.setting.secants(w.linear)) for w in ways]
        (columns,) = max(ways, key=lambda w: w.weight).linear.columns.values()
        parts, _, centre, _ = mixed_answer(ways, next(iter(ways[0].linear.columns)), np.zeros(1))
        beside = {cause: float(np.sqrt(v[0])) for cause, v in parts.items() if cause in (*UNTESTED_CAUSES, AVERAGED)}
        # of several ways of carrying heat the likeliest has the gradient, and all of them its size
        gradient, whole = self.placed(columns[0]), sum(float(v[0]) for cause, v in parts.items() if cause not in beside)
        size = float(np.sum(gradient[self.information > 0.0] ** 2))
        return gradient * (whole / size if size > 0.0 else 1.0) ** 0.5, float(centre[0]), beside


def before_fit(fit: Calibration, scenario: Scenario | None = None) -> Before:
    """Return what a fit knows, at every depth; with a scenario what it knows of that one, as in `predict`.

    Raises
    ------
    IdentificationError   When a coefficient that must be split cannot be.
    """
    knowledge = _with_open_sources(Knowledge.of_source(fit))
    rows = rows_of(knowledge)
    budget = budget_of(knowledge, scenario) if scenario is not None else Budget.of_rows(rows, knowledge.model)
    states = fit.store.states
    errors_of_instruments = Rows()
    for store in reversed(knowledge.stores):  # what a later fit found of an instrument counts
        kinds = ("sensor", "instrument", INPUT)
        new = {s.path: s for s in store.states.values() if s.kind in kinds and s.path not in errors_of_instruments.names}
        errors_of_instruments = errors_of_instruments.beside(Rows.of_states(store, new, "instruments"))
    instruments = _beside_values(errors_of_instruments, budget)
    # sensor -> times from the start of each record [s] and what the fit says that it read. [K]
    predicted: dict[str, list[tuple[Array, Array]]] = {}
    for b in fit.blocks:
        predicted.setdefault(b.sensor, []).append((b.times - b.times[0], b.predicted))
    observations = [(e, o) for e in fit.experiments for o in e.observations]
    shares = [(o.sensor, o.weight**2 * o.effective_share, e.times[o.index]) for e, o in observations]
    worth = {sensor: share * times.size / np.ptp(times) for sensor, share, times in shares if share < 1.0 and times.size > 1}
    return Before(
        budget,
        instruments,
        {n: states[n].value for n in instruments.names},
        {n: s.prior[1] ** -2 for n, s in states.items() if s.prior is not None},
        (fit.autocorrelation.variance_factor if fit.autocorrelation is not None else max(1.0, fit.reduced_chi_square)) ** 0.5,
        {t.sensor: t for t in sorted(fit.autocorrelation.traces, key=lambda t: t.samples)} if fit.autocorrelation is not None else {},
        {o.sensor: o.sigma(fit.problem.noise) for _, o in observations} if fit.problem is not None else {},
        fit.request.untie if fit.request is not None else False,
        any(e.scenario.environment for e in fit.experiments),
        predicted,
        tuple(t.name for t in budget.targets if t.form == "log" and t.name not in rows.names),
        max(budget.ways, key=lambda w: w.weight).kept[0] if budget.ways and fit.structural_errors else None,
        worth,
    )


def _beside_values(instruments: Rows, budget: Budget) -> Rows:
    """Return constant errors of instruments by the sources of a budget, of those that it knows with its values."""
    if not budget.ways:
        return instruments
    likeliest = max(budget.ways, key=lambda w: w.weight).kept[0]
    place, size = likeliest.places, len(likeliest.values)
    value_columns = [
        k for k, cause in enumerate(budget.causes) if cause == BandCause.VALUES and budget.sources[k].name.startswith("errors of ")
    ][:size]
    known_instruments = [n for n in instruments.names if n in place]
    log = tuple(x for n, x in zip(instruments.names, instruments.log, strict=True) if n in place)
    matrix = np.array([likeliest.root[place[n], :size] for n in known_instruments]).reshape(len(known_instruments), size)
    rows_of_values = Rows(
        tuple(known_instruments), log, {}, tuple(budget.sources[k] for k in value_columns), (BandCause.VALUES,) * size, matrix
    )
    rest = [k for k, n in enumerate(instruments.names) if n not in place]
    others = replace(
        instruments,
        names=tuple(instruments.names[k] for k in rest),
        log=tuple(instruments.log[k] for k in rest),
        matrix=instruments.matrix[rest],
    )
    return rows_of_values.beside(others)


def before_model(model: Model, priors: Mapping[str, Any], scenario: Scenario | None = None) -> Before:
    """Return what is known of a model before any test: the budget of the given priors, each a normal source of its own.

    Parameters
    ----------
    model : Model
    priors : dict           Path of a value that can be freed -> its spread, such as "5 %".
    scenario : Scenario     Of the prediction asked for, if any.

    Raises
    ------
    IdentificationError   When there are no priors.
    """
    if not priors:
        raise IdentificationError("a model alone has no uncertainties. Give priors, or a fit.", model.title, code="value.incomplete")
    parameters = compile_network(model).flat.parameters
    texts = {parameters.freeable(raw, model.canonical): spread for raw, spread in priors_of(model, priors, model.title).items()}
    unknowns = [unknown_of(model, p) for p in texts]
    spreads = np.array([prior_of(u, texts[u.name]).sd for u in unknowns])
    sources = tuple(Source(u.name, "stated", Normal(), f"the prior of {u.name}") for u in unknowns)
    rows = Rows(tuple(texts), tuple(u.log for u in unknowns), {}, sources, ("stated",) * len(sources), np.diag(spreads))
    return Before(Budget.of_rows(rows, model, scenario))


def unknown_of(model: Model, path: str) -> Unknown:
    """Return the unknown that a parameter of a model would be."""
    parameters = compile_network(model).flat.parameters
    value, of = float(parameters.evaluate({})[path]), parameters.bounded(path)
    return Unknown(path, "parameter", (), value, *of.form(path, parameters.dimension(path), value), unit=of.unit or "1")


def _with_open_sources(knowledge: Knowledge) -> Knowledge:
    """Return the knowledge with a source of unit deviation, fitted form, for each value that its fit has no finite error of."""
    fit = knowledge.fit
    assert fit is not None
    store = fit.store
    loose = [k for k, s in enumerate(store.states.values()) if not s.known and s.origin.kind == "fit"]
    if not loose:
        return knowledge
    names = [list(store.states)[k] for k in loose]
    sources = tuple(Source(n + NO_ERROR_SUFFIX, "data", Normal(), f"no uncertainty is known for {n}") for n in names)
    root = np.hstack([store.root, np.zeros((len(store.states), len(loose)))])
    root[loose, len(store.sources) + np.arange(len(loose))] = 1.0
    states = {n: replace(s, known=True) if n in names else s for n, s in store.states.items()}
    whole = replace(store, states=states, sources=(*store.sources, *sources), root=root)
    values = fit.values.only([n for n in fit.values if n not in names])
    return replace(knowledge, fit=replace(fit, store=whole), values=(values,))


def doubts_without_gas(model: Model, scenario: Scenario) -> dict[str, float]:
    """Return path -> relative standard deviation of what thin gas meets and air does not tell; empty where gas stays as it is."""
    if not any(e.pressure.bounds[0] < MAX_THIN_PRESSURE for e in scenario.environment.values()):
        return {}
    flat = compile_network(model).flat
    parameters = flat.parameters
    out: dict[str, float] = {}

    def doubt(path: str, size: float) -> None:
        """Note by how much the number behind a path is doubted, relative; what is no positive number is left out."""
        root = parameters.literal_behind(path)
        parameter: Parameter = parameters.table[root].parameter
        if parameter.is_literal and parameters.evaluate({})[root] > 0:
            out[root] = size

    numbers = parameters.evaluate({})
    ranges = {path: r.log_sd(numbers[path]) for path, r in parameters.stated_ranges.items() if numbers[path] > 0.0}
    for c in flat.conductors:
        for path in filter(None, (c.emissivity, c.fields.get("emissivity", ""))):
            doubt(path, ranges.get(parameters.literal_behind(path), EMISSIVITY_SD))
        if "contact_conductance" in c.fields:
            doubt(c.fields["contact_conductance"], JOINT_LOG_SD)
    return out


def doubted(problem: Problem, doubts: Mapping[str, float]) -> Problem:
    """Return a problem in which each value of `doubts` (path -> relative standard deviation) has a prior about its start."""

    def with_prior(u: Unknown, size: float) -> Unknown:
        """Return an unknown with a prior of this relative width about its start."""
        return replace(u, prior=Prior(math.log(u.start), size) if u.log else Prior(u.start, size * u.start))

    return replace(problem, unknowns=tuple(with_prior(u, doubts[u.name]) if u.name in doubts else u for u in problem.unknowns))


def next_test(
    source: Calibration | Model,
    target: str | Aim,
    actions: Sequence[Action] = (),
    *,
    scenario: Scenario | None = None,
    sensors: Mapping[str, Any] | None = None,
    priors: Mapping[str, Any] | None = None,
    every: str | float = "1 [min]",
    goal: str = "",
    executor: Workers = None,
) -> Advice:
    """Return which test would say most of a parameter or a prediction, from the sensitivities of the model as it is.

    Parameters
    ----------
    source : Calibration or Model   What is known: a fit, or a model with `priors` on what is not.
    target : str or Aim             A parameter's path, or a temperature somewhere else.
    actions : sequence of Action    What could be done; the usual ones about `scenario` when none are given.
    scenario : Scenario             A test as it was made, for the usual actions and their duration.
    sensors : dict                  As in `identifiability`; those of the fit's records when not given.
    priors : dict                   Of a model, as in `calibrate`.
    every : str or float            Interval of the readings. [s]
    goal : str                      Error to be reached, with its unit, such as ``5 [%]`` of a value or ``0.1 [K]``.
    executor                        As in `ensemble`: who weighs the actions.

    Raises
    ------
    IdentificationError   When there is nothing to choose from, or the target is not among what is looked for.

    Notes
    -----
    The unknowns are the sources of the budget that `predict` has, each known to its own size: the noise of fits at every level, constant
    errors of instruments, splits of coefficients, gas in joints. The planned readings respond to them through the values of the model, and
    their information J'J adds up (Fedorov, Theory of Optimal Experiments, Academic Press 1972, chapter 1). A new instrument is a source
    more, with the prior of its constant error; one that was there before brings none a second time.
    """
    aim = target.scenario if isinstance(target, Aim) else None
    before = before_fit(source, aim) if isinstance(source, Calibration) else before_model(source, priors or {}, aim)
    model = before.model
    if scenario is None and not actions:
        raise IdentificationError(
            "no test is given to choose from. Give actions, or a scenario to vary.", model.title, code="value.incomplete"
        )
    base = scenario if scenario is not None else actions[0].scenario
    instruments = Sensor.of_model(model, base, sensors) if sensors else _sensors_of_fit(source)
    if not instruments:
        raise IdentificationError(
            "no sensor is given, so a test would give no information. Name at least one.", model.title, code="value.incomplete"
        )
    gradient, value, label, slot, beside = _gradient(before, target)
    now = _error(np.diag(before.information), gradient)
    wanted = _goal(goal, slot, value)
    todo = tuple(actions) or usual_actions(model, base, instruments)
    tasks = [(f"action '{a.name}'", (before, a, a.sensors or instruments, every, gradient, wanted)) for a in todo]
    done = with_time_left(in_tasks(_option, tasks, executor), len(tasks), "next_test", "further actions")
    ranked = sorted((option for _, option in sorted(done, key=lambda numbered: numbered[0])), key=lambda o: _rank(o, wanted))
    remarks = (*_remarks(before, instruments), *_repeat_remarks(ranked, slot, value))
    not_counted = next((SWITCHING_REMARK.format(a.name) for a in todo if _switches(model, a.scenario)), "")
    return Advice(label, value, now, slot, wanted, tuple(ranked), beside, remarks, not_counted)


def _switches(model: Model, scenario: Scenario) -> bool:
    """Return whether temperatures switch anything in a run; false where it cannot be made."""
    try:
        return bool(network_for(model, scenario).switches) and bool(simulate(model, scenario)._run.answer.switched)
    except ThermidError:
        return False


def _repeat_remarks(options: Sequence[Option], slot: str, value: float) -> tuple[str, ...]:
    """Return what is left where readings are rounded as they were, of tests that repeat the temperatures of a log."""
    out = []
    for o in options:
        if o.alike > MIN_ERROR_RATIO * o.error:
            size = f"{short(o.alike)} K" if slot == "K" else percent(o.alike / abs(value) if value else np.inf)
            out.append(
                f"'{o.name}' leaves +- {size} where temperatures repeat those of a log to a fraction of the steps of its sensors, because "
                "readings are then rounded alike."
            )
    return tuple(out)


def _rank(option: Option, goal: float) -> tuple[float, float, float]:
    """Return what options are sorted by: hours to the goal, or without one the error in steps of 5 %, then the hours."""
    if np.isfinite(goal):
        return (option.hours, option.error, 0.0)
    return (round(20.0 * float(np.log(option.error))) if np.isfinite(option.error) else np.inf, option.hours, option.error)


def _sensors_of_fit(source: Calibration | Model) -> tuple[Sensor, ...]:
    """Return the instruments of a fit's records, with the noise that the fit used; of one in several records as the first has it."""
    if not isinstance(source, Calibration) or source.problem is None:
        return ()
    out: dict[str, Sensor] = {}
    for experiment in source.experiments:
        for name, c in experiment.record.channels.items():
            role, path = role_and_target(experiment.record, c, experiment.network)
            if role in ("command", "schedule") or name in out or any(path == s.target and s.role != "node" for s in out.values()):
                continue
            if role == "node":
                noise, scatter = c.noise, source.problem.noise.get(name)
                if noise is None and scatter is not None:  # less rounding to steps, step^2 / 12; a tenth of it is left at least
                    noise = math.sqrt(max(scatter**2 - c.step**2 / 12.0, (0.1 * scatter) ** 2))
                out[name] = Sensor(name, path, role, noise, c.accuracy, c.step or None)
            else:
                noisy = experiment.noisy.get(path if role == "boundary" else SCALE + path)
                noise_and_step = (noisy.white or None, noisy.step or None) if noisy is not None else (c.noise, None)
                out[name] = Sensor(name, path, role, noise_and_step[0], c.accuracy, noise_and_step[1])
    return tuple(out.values())


def _remarks(before: Before, sensors: Sequence[Sensor]) -> tuple[str, ...]:
    """Return what the figures take for granted of the noise of planned readings."""
    slow = [s.name for s in sensors if s.name in before.noise and before.noise[s.name].correlated_variance > 0.0]
    if not slow:
        return ()
    return (
        f"Planned readings of {quoted(slow)} are assumed to be autocorrelated like the residuals of the fit, because missing physics "
        "would remain.",
    )


def _gradient(before: Before, target: str | Aim) -> tuple[Array, float, str, str, Mapping[str, float]]:
    """Return how the target responds to the sources (sources,), its value, its name, its unit, and cause -> error beside them [K].

    The response is in that unit per standard deviation of a source.
    """
    if not isinstance(target, str):
        at = target.scenario.seconds if isinstance(target.at, str) and not target.at else amount(target.at, "s", "at")
        gradient, value, beside = before.temperature(target.node, at)
        return gradient, value, str(target), "K", beside
    path = before.model.canonical(target)
    name = next((n for n, paths in before.free.items() if path in paths), None)
    if name is None:
        raise NameNotFoundError(f"'{target}' is not one of the free parameters.{nearest(path, before.free)}", before.model.title)
    unit = unknown_of(before.model, name).unit
    return before.responses[name], before.values[name], f"'{path}'", unit if unit != "K" else "1", {}


def _goal(text: str, slot: str, value: float) -> float:
    """Return the error to be reached [SI], from a text in per cent of `value` or in the unit `slot`; NaN for an empty one."""
    if not text:
        return float("nan")
    if text.rstrip(" ]").endswith("%"):
        return abs(value) * literal(text, "1", "goal")
    return literal(text, slot, "goal")


def _error(information: Array, gradient: Array) -> float:
    """Return the standard error of a target: sqrt(g' I^-1 g), I the information and g the `gradient` (sources,)."""
    return float(np.sqrt(variance(information, gradient)))


def _option(before: Before, action: Action, sensors: Sequence[Sensor], every: str | float, gradient: Array, goal: float) -> Option:
    """Return what an action is worth over its duration: the error [unit of the goal] after each part of it, and the hours to reach it.

    Parameters
    ----------
    every : str or float            Interval of the readings. [s]
    gradient : array (sources,)     Of the predicted quantity by the known sources, in units of their deviations.
    goal : float                    Error that is wanted; where today's is below it, `SHARE_OF_GAIN` of what the whole action gains.
    """
    longest = action.scenario.seconds / HOUR
    try:
        shares = {name: min(rate * amount(every, "s", "every"), 1.0) for name, rate in before.worth.items()}
        grown = [
            replace(s, noise=(s.noise or 0.0) * before.spread / math.sqrt(shares.get(s.name, 1.0)) if s.role == "node" else s.noise)
            for s in sensors
        ]
        record = planned_record(before.model, action.scenario, grown, every, NAME)
        doubts = {} if before.thin else doubts_without_gas(before.model, action.scenario)
        doubts = {path: size for path, size in doubts.items() if path not in before.split}
        free = (*before.free, *(p for p in doubts if p not in before.free))
        request = Request(before.model, (record,), free, {"*": action.scenario}, untie=before.untie)
        problem = doubted(build_problem(request), doubts)
        durations, matrices, alike = _information_over_time(before, problem, doubts, _planned_noise(before, grown))
    except ThermidError as error:
        return Option(action.name, np.inf, np.inf, longest, np.zeros((0, 2)), error.message)
    full = np.zeros(len(matrices[0]))
    full[: gradient.size] = gradient
    errors = np.array([_error(m, full) for m in matrices])
    now = _error(np.diag(before.information), gradient)
    wanted = goal if now > goal else now - SHARE_OF_GAIN * (now - errors[-1]) if np.isfinite(now) else errors[-1] / SHARE_OF_GAIN
    met = np.flatnonzero(errors <= wanted * (1 + 1e-9))
    hours = float(durations[met[0]]) / HOUR if met.size else np.inf
    table = np.column_stack([durations / HOUR, errors])
    same = _error(alike, full) if _rounds_alike(before, problem.experiments[0]) else float("nan")
    return Option(action.name, float(errors[-1]), hours, longest, table, alike=same)


def _rounds_alike(before: Before, planned: Experiment) -> bool:
    """Whether the median difference of a sensor's planned and logged temperatures is below `REPEAT_SHARE_OF_STEP` of its resolution."""
    logged = ((o, planned.times[o.index], t, kelvin) for o in planned.observations if o.step for t, kelvin in before.seen.get(o.sensor, ()))
    return any(
        np.median(np.abs(np.interp(times - times[0], t, kelvin) - o.measured)) < REPEAT_SHARE_OF_STEP * o.step
        for o, times, t, kelvin in logged
    )


def _planned_noise(before: Before, sensors: Sequence[Sensor]) -> tuple[TraceNoise, ...]:
    """Return how planned readings are autocorrelated, variances in squares of their noise: as the residuals of each sensor were.

    A new sensor has the median size [K] and time [s] of the others.
    """
    out = []
    size = {s.name: before.sizes.get(s.name, s.noise or 0.0) * before.spread for s in sensors if s.role == "node"}
    slow = [before.noise[n] for n in size if n in before.noise and before.noise[n].correlated_variance > 0.0]
    typical = float(np.median([t.correlated_variance * before.sizes[t.sensor] ** 2 for t in slow])) if slow else 0.0
    for name, noise in size.items():
        t = before.noise.get(name)
        if t is None and slow and noise:
            out.append(TraceNoise(NAME, name, 0, 1.0, typical / noise**2, float(np.median([s.correlation_time for s in slow])), 0.0))
        elif t is not None and t.white_variance > 0.0:
            white, correlated = (v / before.spread**2 for v in (t.white_variance, t.correlated_variance))
            out.append(TraceNoise(NAME, name, 0, white, correlated, t.correlation_time, 0.0))
        else:
            out.append(TraceNoise(NAME, name, 0, 0.0, 0.0, 0.0, 0.0))
    return tuple(out)


def _informed(rows: Array, excess: Array) -> Array:
    """Return what least squares learn from readings (unknowns, unknowns) whose noise adds `excess` E to the covariance of J'r.

    ``J'J (J'J + E)^-1 J'J``, the inverse of the sandwich of Huber, in the directions that the readings see; `rows` J (rows, unknowns). [-]
    """
    if not excess.any():
        return np.asarray(rows.T @ rows)
    _, s, turned = np.linalg.svd(np.linalg.qr(rows, mode="r"), full_matrices=False)
    s, turned = s[s > MIN_SINGULAR_VALUE * s[0]], turned[s > MIN_SINGULAR_VALUE * s[0]]
    back = turned / s[:, None]
    inner = np.linalg.inv(np.eye(s.size) + back @ excess @ back.T)
    ends = turned.T * s
    return np.asarray(ends @ inner @ ends.T)


def _informed_alike(rows: Array, excess: Array, rounding: Array) -> Array:
    """Return what a log adds to one that was rounded alike (unknowns, unknowns), `rounding` that part of the covariance of J'r.

    With ``N = W + R = J'J + excess``, R by rounding, one log says ``J'J N^-1 J'J`` and both say ``J'J (W / 2 + R)^-1 J'J``; returned is
    the difference. `rows` J (rows, unknowns). [-]
    """
    _, s, turned = np.linalg.svd(np.linalg.qr(rows, mode="r"), full_matrices=False)
    s, turned = s[s > MIN_SINGULAR_VALUE * s[0]], turned[s > MIN_SINGULAR_VALUE * s[0]]
    back = turned / s[:, None]
    whole, shared = np.eye(s.size) + back @ excess @ back.T, back @ rounding @ back.T
    sizes, vectors = np.linalg.eigh(whole - shared)
    bounded = (vectors * np.maximum(sizes, 0.0)) @ vectors.T
    both = np.linalg.inv(whole - 0.5 * bounded)
    ends = turned.T * s
    return np.asarray(ends @ (both - np.linalg.inv(whole)) @ ends.T)


def _with_departures_of_run(before: Before, problem: Problem, at: Array) -> tuple[Problem, dict[str, float]]:
    """Return a planned run with what of it differs from other runs as further unknowns, and name -> standard deviation [-] of each.

    `at` (unknowns,), fitted form, is where the heats of the departures are taken.
    """
    way = before.departing
    if way is None:
        return problem, {}
    e = problem.experiments[0]
    own = way.departures.of_run(e.network, course_in_fit(problem, 0, e.network, at))
    return widened(problem, 0, *with_heats(e.network, e.scenario, [h for _, h in own]), [h for _, h in own]), {
        c.name: deviations_of_run(c, way.sizes, {})[0] for c, _ in own
    }


def _information_over_time(
    before: Before, problem: Problem, doubts: Mapping[str, float], noise: Sequence[TraceNoise]
) -> tuple[Array, list[Array], Array]:
    """Return durations (`DURATIONS`,) [s], the information of the sources after each, and that at the end if rounding errors are shared.

    The sources are those known now, in units of their standard deviations, then the test's own: I = B + C'(J'J - excess) C, J of the
    readings so far in units of their noise, C (unknowns, sources) the responses of the unknowns, B (sources, sources) what is known before.

    Parameters
    ----------
    doubts : dict       Path -> size of a value that holds with gas alone.
    noise : sequence    Of the planned traces, with the times of their correlation. [s]
    """
    leader = {q: name for name, paths in before.free.items() for q in paths}
    at = np.array([u.to_fitted(before.values.get(leader.get(u.name, u.name), u.start)) for u in problem.unknowns])
    problem, apart = _with_departures_of_run(before, problem, at)
    at = np.append(at, np.zeros(len(apart)))
    # what holds with gas says nothing of the same value without it
    names = [leader.get(u.name, u.name) + (WITHOUT_GAS if u.name in doubts else "") for u in problem.unknowns]
    fresh = [k for k, name in enumerate(names) if name not in before.responses]
    size = len(before.place)
    chain = np.zeros((len(names), size + len(fresh)))
    base = np.diag(np.concatenate([before.information, [1.0 * (names[k] in apart) for k in fresh]]))
    for k, (u, name) in enumerate(zip(problem.unknowns, names, strict=True)):
        if k in fresh:
            chain[k, size + fresh.index(k)] = apart.get(name, 1.0)
        else:
            chain[k, :size] = before.responses[name] / u.slope(at[k])
        if u.prior is not None and (k in fresh or u.kind != "parameter"):
            # a meter good to so many watts is known better as a share once it has read a larger power
            base += max(0.0, u.prior.sd**-2 - before.held.get(u.name, 0.0)) * np.outer(chain[k], chain[k])
    rows = problem.jacobian(at) @ chain
    times = np.concatenate([problem.experiments[0].times[o.index] for o in problem.experiments[0].observations])
    durations = np.linspace(0.0, float(times.max()), DURATIONS + 1)[1:]
    pieces = Binned.of_problem(problem, at)
    inputs = answers_to_inputs(problem, at, pieces)
    out = []
    for end in (durations * (1 + 1e-9)).tolist():
        part = {key: b.before(end) for key, b in pieces.items()}
        causes = {key: h[pieces[key].times <= end] for key, h in inputs.items()}
        excess = chain.T @ score_excess(part, noise, 1.0, causes) @ chain
        out.append(base + _informed(rows[times <= end], excess))
    moved = [b.slopes.T @ b.rounding for b in pieces.values() if b.shares_rounding]
    rounding = chain.T @ sum((m @ m.T for m in moved), np.zeros((len(names),) * 2)) @ chain
    return durations, out, base + _informed_alike(rows, excess, rounding) if moved else out[-1]
