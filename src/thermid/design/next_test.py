"""`next_test`: which of the tests that could be made would say most of a parameter, or of a prediction, and how long it would take."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thermid.arguments import takes_objects
from thermid.design.actions import Action, Aim, usual_actions
from thermid.design.planned import Sensor, planned_record, sensors_of
from thermid.design.ranking import Advice, Option
from thermid.dual import value_of
from thermid.errors import IdentificationError, NameNotFoundError, ThermidError, nearest
from thermid.fit.calibration import Calibration
from thermid.fit.problem.experiment import role_and_target
from thermid.fit.problem.gather import prior_of, problem_for
from thermid.fit.problem.request import Request
from thermid.fit.problem.residuals import Problem
from thermid.fit.problem.unknowns import Prior, Unknown, parameter_unknown
from thermid.knowledge.sources import Normal, Source
from thermid.model.laws.signal import Signal, literal
from thermid.model.parts.parameter import Parameter
from thermid.model.tree.model import Model
from thermid.network.network import compile_network
from thermid.physics.finishes import finish
from thermid.prediction.budget import Budget, budget_of
from thermid.prediction.known import Known, Rows, instruments_of, rows_of
from thermid.prediction.setting import Setting
from thermid.prediction.structural import CONSTANT, MISFIT
from thermid.simulation.scenarios.scenario import Scenario

Array = NDArray[np.float64]
WITHOUT_GAS = " without gas"
"""After the name of a value that is another one without gas."""
BESIDE = (CONSTANT, MISFIT)
"""Causes that a test adds no information to: they are said beside."""
OPEN = ": open"
"""After the name of a value, its source where no fit has a finite error of it."""
THIN = 1e4
"""Pressure below which gas no longer does what it did in the room. [Pa]"""
EMISSIVITY = 0.15
"""What an emissivity of a deck is good to, where no finish says it. [-]"""
JOINT = 0.7
"""Standard deviation of the logarithm of a joint's conductance without gas about that with it: a factor of two either way. Gas carries more
than half of the heat between bare, lightly pressed faces (Yovanovich, IEEE Trans. CPT 28 (2005) 182); a filled joint loses nothing. [-]"""
NAME = "next test"
DURATIONS = 24
ENOUGH = 0.9
"""A test is long enough when it has brought nine tenths of what it could."""


@dataclass(frozen=True, eq=False)
class Before:
    """What a budget says before a test, and what the budget does not hold: instruments.

    Parameters
    ----------
    budget : Budget         Of what is known, in the scenario of the prediction that is asked for.
    instruments : Rows      Constant errors of sensors and powers; sources that values respond to as well bear one name.
    readings : dict         Instrument -> its value. [SI]
    held : dict             Name -> information that a prior has brought already, in the fitted form.
    spread : float          Readings scatter so many times as much as their noise says. [-]
    untie : bool            Whether instances have values of their own.
    thin : bool             Whether it was learnt with thin gas already.
    split : tuple of str    Emissivities that an effective coefficient was split into.
    """

    budget: Budget
    instruments: Rows = field(default_factory=Rows)
    readings: Mapping[str, float] = field(default_factory=dict)
    held: Mapping[str, float] = field(default_factory=dict)
    spread: float = 1.0
    untie: bool = False
    thin: bool = False
    split: tuple[str, ...] = ()

    @property
    def model(self) -> Model:
        """The model, effective coefficients split where the prediction needs it."""
        return self.budget.model

    @cached_property
    def place(self) -> dict[str, int]:
        """Source -> its column."""
        own = [s.name for s, cause in zip(self.budget.sources, self.budget.causes, strict=True) if cause not in BESIDE]
        return {name: k for k, name in enumerate(dict.fromkeys([*own, *(s.name for s in self.instruments.sources)]))}

    @property
    def information(self) -> Array:
        """What is known of each source (sources,): one, or nothing of a value without a finite error."""
        return np.array([0.0 if name.endswith(OPEN) else 1.0 for name in self.place])

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
        """Name -> what a standard deviation of each source (sources,) does to the value; without gas by a name of its own. [SI]"""
        out: dict[str, Array] = {}
        for t, row in zip(self.budget.targets, self.budget.gain, strict=True):
            if t.form in ("add", "log", "factor"):
                moved = (1.0 if t.form == "add" else self.values[t.name]) * self.placed(row)
                out[t.name + WITHOUT_GAS if t.form == "factor" else t.name] = moved + (out[t.name] if t.form == "factor" else 0.0)
        for name, log, row in zip(self.instruments.names, self.instruments.log, self.instruments.matrix, strict=True):
            own = np.zeros(len(self.place))
            own[[self.place[s.name] for s in self.instruments.sources]] = row
            out[name] = own * (self.values[name] if log else 1.0)
        return out

    def placed(self, column: Array) -> Array:
        """Return what a standard deviation of each source does (sources,), from what a unit of each source of the budget does."""
        out = np.zeros(len(self.place))
        for s, size, x in zip(self.budget.sources, self.budget.sizes, column, strict=True):
            if s.name in self.place:
                out[self.place[s.name]] = size * x
        return out

    def temperature(self, node: str, at: float) -> tuple[Array, float, dict[str, float]]:
        """Return how a temperature responds (sources,), its value, and cause -> error that no test takes away. [K]"""
        linear = Setting.of(self.budget, times=[at]).linear([node])
        (columns,) = linear.columns.values()
        parts = self.budget.parts(columns[:1])
        beside = {cause: float(np.sqrt(v[0])) for cause, v in parts.items() if cause in BESIDE}
        return self.placed(columns[0]), float(linear.run[node].kelvin[0]), beside


def before_fit(fit: Calibration, scenario: Scenario | None = None) -> Before:
    """Return what a fit knows, at every depth; with a scenario what it knows of that one, as in `predict`.

    Raises
    ------
    IdentificationError   When a coefficient that must be split cannot be.
    """
    known = _opened(Known.of(fit))
    rows = rows_of(known)
    budget = budget_of(known, scenario) if scenario is not None else Budget.of_rows(rows, known.model)
    states = fit.store.states
    instruments = instruments_of(known)
    return Before(
        budget,
        instruments,
        {n: states[n].value for n in instruments.names},
        {n: s.prior[1] ** -2 for n, s in states.items() if s.prior is not None},
        max(1.0, fit.reduced_chi_square) ** 0.5,
        fit.request.untie if fit.request is not None else False,
        any(e.scenario.environment for e in fit.experiments),
        tuple(t.name for t in budget.targets if t.form == "log" and t.name not in rows.names),
    )


def before_model(model: Model, priors: Mapping[str, tuple[str, str]], scenario: Scenario | None = None) -> Before:
    """Return what priors say of a model.

    Raises
    ------
    IdentificationError   When there are none.
    """
    if not priors:
        raise IdentificationError("a model alone says nothing of what it does not know: give priors, or a fit.", model.title)
    parameters = compile_network(model).flat.parameters
    texts = {parameters.freeable(raw, model.canonical): given for raw, given in priors.items()}
    unknowns = [unknown_of(model, p) for p in texts]
    spreads = np.array([prior_of(u, texts[u.name]).sd for u in unknowns])
    sources = tuple(Source(u.name, "stated", Normal(), f"the prior of {u.name}") for u in unknowns)
    rows = Rows(tuple(texts), tuple(u.log for u in unknowns), {}, sources, ("stated",) * len(sources), np.diag(spreads))
    return Before(Budget.of_rows(rows, model, scenario))


def unknown_of(model: Model, path: str) -> Unknown:
    """Return the unknown that a parameter of a model would be."""
    parameters = compile_network(model).flat.parameters
    return parameter_unknown(
        path, parameters.table[path].parameter, parameters.dimension(path), float(parameters.evaluate({})[path]), (), None
    )


def _opened(known: Known) -> Known:
    """Return it with a source of its own for each value that its fit has no finite error of."""
    fit = known.fit
    assert fit is not None
    store = fit.store
    loose = [k for k, s in enumerate(store.states.values()) if not s.known and s.origin.kind == "fit"]
    if not loose:
        return known
    names = [list(store.states)[k] for k in loose]
    sources = tuple(Source(n + OPEN, "data", Normal(), f"nothing is known of {n}") for n in names)
    root = np.hstack([store.root, np.zeros((len(store.states), len(loose)))])
    root[loose, len(store.sources) + np.arange(len(loose))] = 1.0
    states = {n: replace(s, known=True) if n in names else s for n, s in store.states.items()}
    whole = replace(store, states=states, sources=(*store.sources, *sources), root=root)
    values = fit.values.only([n for n in fit.values if n not in names])
    return replace(known, fit=replace(fit, store=whole), values=(values,))


def doubts_without_gas(model: Model, scenario: Scenario) -> dict[str, float]:
    """Return path -> relative standard deviation of what thin gas meets and air does not tell; empty where gas stays as it is."""
    if not any(_thin(e.pressure) for e in scenario.environment.values()):
        return {}
    flat = compile_network(model).flat
    parameters = flat.parameters
    out: dict[str, float] = {}

    def doubt(path: str, size: float) -> None:
        root = parameters.literal_behind(path)
        given: Parameter = parameters.table[root].parameter
        if given.is_literal and parameters.evaluate({})[root] > 0:
            out[root] = size

    finishes = {parameters.literal_behind(path): finish(named).log_sd for path, named in flat.finishes.items()}
    for c in flat.conductors:
        for path in filter(None, (c.emissivity, c.fields.get("emissivity", ""))):
            doubt(path, finishes.get(parameters.literal_behind(path), EMISSIVITY))
        if "contact_conductance" in c.fields:
            doubt(c.fields["contact_conductance"], JOINT)
    return out


def _thin(pressure: Signal) -> bool:
    return pressure.bounds[0] < THIN


def doubted(problem: Problem, doubts: Mapping[str, float]) -> Problem:
    """Return a problem whose doubtful values have priors of their own."""
    unknowns = []
    for u in problem.unknowns:
        if u.name in doubts:
            size = doubts[u.name]
            u = replace(u, prior=Prior(math.log(u.start), size) if u.log else Prior(u.start, size * u.start))
        unknowns.append(u)
    return replace(problem, unknowns=tuple(unknowns))


@takes_objects
def next_test(
    source: Calibration | Model,
    target: str | Aim,
    actions: Sequence[Action] = (),
    *,
    scenario: Scenario | None = None,
    sensors: Mapping[str, Any] | None = None,
    priors: Mapping[str, tuple[str, str]] | None = None,
    every: str | float = "1 [min]",
    goal: str = "",
) -> Advice:
    """Return which test would say most of a parameter or a prediction, from the sensitivities of the model as it stands.

    Parameters
    ----------
    source : Calibration or Model   What is known: a fit, or a model with `priors` on what is not.
    target : str or Aim             A parameter's path, or a temperature somewhere else.
    actions : sequence of Action    What could be done; the usual ones about `scenario` when none are given.
    scenario : Scenario             A test as it was made, for the usual actions and their duration.
    sensors : dict                  As in `identifiability`; those of the fit's records when not given.
    priors : dict                   Of a model: path -> (mean, standard deviation) as texts.
    every : str or float            Interval of the readings. [s]
    goal : str                      Error to be reached, with its unit, such as ``5 [%]`` of a value or ``0.1 [K]``.

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
    known = before_fit(source, aim) if isinstance(source, Calibration) else before_model(source, priors or {}, aim)
    model = known.model
    if scenario is None and not actions:
        raise IdentificationError("there is nothing to choose from: give actions, or a scenario to vary.", model.title)
    base = scenario if scenario is not None else actions[0].scenario
    given = sensors_of(model, base, sensors) if sensors else _sensors(source)
    if not given:
        raise IdentificationError("no sensor is given, so a test would say nothing.", model.title)
    gradient, value, label, slot, beside = _gradient(known, target)
    now = _error(np.diag(known.information), gradient)
    wanted = _goal(goal, slot, value)
    todo = tuple(actions) or usual_actions(model, base, given)
    options = [_option(known, a, a.sensors or given, every, gradient, wanted) for a in todo]
    ranked = sorted(options, key=lambda o: _rank(o, wanted))
    return Advice(label, value, now, slot, wanted, tuple(ranked), beside)


def _rank(option: Option, goal: float) -> tuple[float, float, float]:
    """Return what options are sorted by: the time to the goal, or without one the error in steps of 5 %, and then the time."""
    if np.isfinite(goal):
        return (option.hours, option.error, 0.0)
    return (round(20.0 * float(np.log(option.error))) if np.isfinite(option.error) else np.inf, option.hours, option.error)


def _sensors(source: Calibration | Model) -> tuple[Sensor, ...]:
    """Return the instruments of a fit's first record, with the noise that the fit used."""
    if not isinstance(source, Calibration) or source.problem is None:
        return ()
    experiment = source.experiments[0]
    out = []
    for name, c in experiment.record.channels.items():
        role, path = role_and_target(experiment.record, c, experiment.network)
        noise = c.noise if c.noise is not None else source.problem.noise.get(name)
        if role != "command":
            out.append(Sensor(name, path, role, noise, c.accuracy))
    return tuple(out)


def _gradient(known: Before, target: str | Aim) -> tuple[Array, float, str, str, Mapping[str, float]]:
    """Return how the target responds to the sources, its value, its name, its unit, and what else makes it uncertain [K]."""
    if not isinstance(target, str):
        gradient, value, beside = known.temperature(target.node, _instant(target))
        return gradient, value, str(target), "K", beside
    path = known.model.canonical(target)
    name = next((n for n, paths in known.free.items() if path in paths), None)
    if name is None:
        raise NameNotFoundError(f"'{target}' is not among what is looked for.{nearest(path, known.free)}", known.model.title)
    unit = unknown_of(known.model, name).unit
    return known.responses[name], known.values[name], f"'{path}'", unit if unit != "K" else "1", {}


def _instant(aim: Aim) -> float:
    return literal(aim.at, "s", "at") if isinstance(aim.at, str) and aim.at else float(aim.at or aim.scenario.seconds)


def _goal(text: str, slot: str, value: float) -> float:
    if not text:
        return float("nan")
    if text.rstrip(" ]").endswith("%"):
        return abs(value) * literal(text, "1", "goal")
    return literal(text, slot, "goal")


def _error(information: Array, gradient: Array) -> float:
    """Return the standard error of a target."""
    scale = np.sqrt(np.maximum(np.diag(information), 1e-300))
    sizes, vectors = np.linalg.eigh(information / np.outer(scale, scale))
    part = vectors.T @ (gradient / scale)
    weak = sizes < 1e-11 * sizes[-1]
    if (np.abs(part[weak]) > 1e-6 * np.linalg.norm(part)).any():
        return float("inf")
    return float(np.sqrt(np.sum(part[~weak] ** 2 / sizes[~weak])))


def _option(known: Before, action: Action, sensors: Sequence[Sensor], every: str | float, gradient: Array, goal: float) -> Option:
    """Return what an action would be worth, over its duration."""
    longest = action.scenario.seconds / 3600.0
    try:
        grown = [replace(s, noise=(s.noise or 0.0) * known.spread if s.role == "node" else s.noise) for s in sensors]
        record = planned_record(known.model, action.scenario, grown, every, NAME)
        doubts = {} if known.thin else doubts_without_gas(known.model, action.scenario)
        doubts = {path: size for path, size in doubts.items() if path not in known.split}
        free = (*known.free, *(p for p in doubts if p not in known.free))
        request = Request(known.model, (record,), free, {"*": action.scenario}, untie=known.untie)
        problem = doubted(problem_for(request), doubts)
        durations, matrices = _growing(known, problem, doubts)
    except ThermidError as error:
        return Option(action.name, np.inf, np.inf, longest, np.zeros((0, 2)), error.message)
    full = np.zeros(len(matrices[0]))
    full[: gradient.size] = gradient
    errors = np.array([_error(m, full) for m in matrices])
    now = _error(np.diag(known.information), gradient)
    wanted = goal if np.isfinite(goal) else now - ENOUGH * (now - errors[-1]) if np.isfinite(now) else errors[-1] / ENOUGH
    met = np.flatnonzero(errors <= wanted * (1 + 1e-9))
    hours = float(durations[met[0]]) / 3600.0 if met.size else np.inf
    return Option(action.name, float(errors[-1]), hours, longest, np.column_stack([durations / 3600.0, errors]))


def _growing(known: Before, problem: Problem, doubts: Mapping[str, float]) -> tuple[Array, list[Array]]:
    """Return durations, and at each the information of the sources: those known now, then the test's own."""
    leader = {q: name for name, paths in known.free.items() for q in paths}
    # what holds with gas says nothing of the same value without it
    own = [leader.get(u.name, u.name) + (WITHOUT_GAS if u.name in doubts else "") for u in problem.unknowns]
    fresh = [k for k, name in enumerate(own) if name not in known.responses]
    size = len(known.place)
    at = np.array([u.to_fitted(known.values.get(leader.get(u.name, u.name), u.start)) for u in problem.unknowns])
    chain = np.zeros((len(own), size + len(fresh)))
    base = np.diag(np.concatenate([known.information, np.zeros(len(fresh))]))
    for k, (u, name) in enumerate(zip(problem.unknowns, own, strict=True)):
        if k in fresh:
            chain[k, size + fresh.index(k)] = 1.0
        else:
            chain[k, :size] = known.responses[name] / u.slope(at[k])
        if u.prior is not None and (k in fresh or u.kind != "parameter"):
            # a meter good to so many watts is known better as a share once it has read a larger power
            base += max(0.0, u.prior.sd**-2 - known.held.get(u.name, 0.0)) * np.outer(chain[k], chain[k])
    rows = problem.jacobian(at) @ chain
    times = np.concatenate([problem.experiments[0].times[o.index] for o in problem.experiments[0].observations])
    durations = np.linspace(0.0, float(times.max()), DURATIONS + 1)[1:]
    parts = [rows[times <= end * (1 + 1e-9)] for end in durations]
    return durations, [base + part.T @ part for part in parts]
