"""`next_test`: which of the tests that could be made would say most of a parameter, or of a prediction, and how long it would take."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thermid.arguments import takes_objects
from thermid.errors import IdentificationError, NameNotFoundError, ThermidError, nearest
from thermid.identify.actions import Action, Aim, usual_actions
from thermid.identify.calibration import Calibration
from thermid.identify.gather import problem_for
from thermid.identify.planned import Sensor, planned_record, sensors_of
from thermid.identify.ranking import Advice, Option
from thermid.identify.request import Request
from thermid.identify.residuals import Problem
from thermid.model.model import Model
from thermid.model.signal import literal
from thermid.prediction.budget import budget_of
from thermid.prediction.doubts import doubted, doubts_without_gas
from thermid.prediction.knowledge import WITHOUT_GAS, Knowledge
from thermid.prediction.setting import Setting
from thermid.prediction.structural import GAS_IN_JOINTS, SPLIT
from thermid.simulation.scenario import Scenario
from thermid.simulation.simulator import prepare

__all__ = ["next_test"]

Array = NDArray[np.float64]
NAME = "next test"
HERE = ("fit", SPLIT, GAS_IN_JOINTS)
"""Causes whose information a test adds to; the others are said beside."""
DURATIONS = 24
ENOUGH = 0.9
"""A test is long enough when it has brought nine tenths of what it could."""


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
    Information adds up: that of what is known, the inverse of the covariance, constant errors of instruments included, and J'J of the
    planned readings. A new instrument brings the prior of its constant error, one that was there before brings none a second time
    (Fedorov, Theory of Optimal Experiments, Academic Press 1972, chapter 1).
    """
    aim = target.scenario if isinstance(target, Aim) else None
    known = Knowledge.of_fit(source, aim) if isinstance(source, Calibration) else Knowledge.of_model(source, priors or {})
    model = known.model
    if scenario is None and not actions:
        raise IdentificationError("there is nothing to choose from: give actions, or a scenario to vary.", model.title)
    base = scenario if scenario is not None else actions[0].scenario
    given = sensors_of(model, base, sensors) if sensors else _sensors(source)
    if not given:
        raise IdentificationError("no sensor is given, so a test would say nothing.", model.title)
    gradient, value, label, slot = _gradient(known, target)
    now = _error(known.information, gradient)
    wanted = _goal(goal, slot, value)
    todo = tuple(actions) or usual_actions(model, base, given)
    options = [_option(known, a, a.sensors or given, every, gradient, wanted) for a in todo]
    ranked = sorted(options, key=lambda o: _rank(o, wanted))
    return Advice(label, value, now, slot, wanted, tuple(ranked), _beside(source, target))


def _rank(option: Option, goal: float) -> tuple[float, float, float]:
    """Return what options are sorted by: the time to the goal, or without one the error in steps of 5 %, and then the time."""
    if np.isfinite(goal):
        return (option.hours, option.error, 0.0)
    return (round(20.0 * float(np.log(option.error))) if np.isfinite(option.error) else np.inf, option.hours, option.error)


def _sensors(source: Calibration | Model) -> tuple[Sensor, ...]:
    """Return the instruments of a fit's first record, with the noise that the fit used."""
    if not isinstance(source, Calibration) or source.problem is None:
        return ()
    from thermid.identify.experiment import _bound

    experiment = source.experiments[0]
    out = []
    for name, c in experiment.record.channels.items():
        role, path = _bound(experiment.record, c, experiment.network)
        noise = c.noise if c.noise is not None else source.problem.noise.get(name)
        if role != "command":
            out.append(Sensor(name, path, role, noise, c.accuracy))
    return tuple(out)


def _gradient(known: Knowledge, target: str | Aim) -> tuple[Array, float, str, str]:
    """Return the derivative of the target with respect to the fitted forms, its value, its name and its unit."""
    gradient = np.zeros(len(known.names))
    unknowns = known.unknowns()
    if isinstance(target, str):
        path = known.model.canonical(target)
        if path not in unknowns:
            raise NameNotFoundError(f"'{target}' is not among what is looked for.{nearest(path, unknowns)}", known.model.title)
        u = unknowns[path]
        gradient[known.names.index(path)] = u.slope(known.fitted[path])
        return gradient, u.to_value(known.fitted[path]), f"'{path}'", u.unit if u.unit != "K" else "1"
    at = _instant(target)
    every = [q for paths in known.free.values() for q in paths]
    run = prepare(known.model, target.scenario, every, times=[at]).run(sensitivities=True)
    for path, u in unknowns.items():
        name = path + WITHOUT_GAS if path + WITHOUT_GAS in known.names else path
        slope = sum(float(run.sensitivity(target.node, q)[0]) for q in known.free[path])
        gradient[known.names.index(name)] = slope * u.slope(known.fitted[path])
    return gradient, float(run[target.node].kelvin[0]), str(target), "K"


def _instant(aim: Aim) -> float:
    return literal(aim.at, "s", "at") if isinstance(aim.at, str) and aim.at else float(aim.at or aim.scenario.seconds)


def _beside(source: Calibration | Model, target: str | Aim) -> dict[str, float]:
    """Return cause -> standard error of a prediction that comes from nothing a fit has freed. [K]"""
    if isinstance(target, str) or not isinstance(source, Calibration) or not np.isfinite(source.values.covariance).all():
        return {}
    setting = Setting.of(budget_of(source, target.scenario), times=[_instant(target)])
    (columns,) = setting.linear([target.node]).columns.values()
    parts = setting.budget.parts(columns[:-1])
    return {cause: float(np.sqrt(v[-1])) for cause, v in parts.items() if cause not in HERE}


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


def _option(known: Knowledge, action: Action, sensors: Sequence[Sensor], every: str | float, gradient: Array, goal: float) -> Option:
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
        durations, matrices, names = _growing(known, problem, doubts)
    except ThermidError as error:
        return Option(action.name, np.inf, np.inf, longest, np.zeros((0, 2)), error.message)
    full = np.zeros(len(names))
    full[: gradient.size] = gradient
    errors = np.array([_error(m, full) for m in matrices])
    now = _error(known.information, gradient)
    wanted = goal if np.isfinite(goal) else now - ENOUGH * (now - errors[-1]) if np.isfinite(now) else errors[-1] / ENOUGH
    met = np.flatnonzero(errors <= wanted * (1 + 1e-9))
    hours = float(durations[met[0]]) / 3600.0 if met.size else np.inf
    return Option(action.name, float(errors[-1]), hours, longest, np.column_stack([durations / 3600.0, errors]))


def _growing(known: Knowledge, problem: Problem, doubts: Mapping[str, float]) -> tuple[Array, list[Array], list[str]]:
    """Return durations, the information at each, and the names that it is over: those known now, then the test's own."""
    # what holds with gas says nothing of the same value without it
    own = [u.name + WITHOUT_GAS if u.name in doubts else u.name for u in problem.unknowns]
    names = [*known.names, *(n for n in own if n not in known.names)]
    place = [names.index(n) for n in own]
    at = np.array([known.fitted.get(u.name, u.to_fitted(u.start)) for u in problem.unknowns])
    rows = problem.jacobian(at)
    times = np.concatenate([problem.experiments[0].times[o.index] for o in problem.experiments[0].observations])
    base = np.zeros((len(names),) * 2)
    base[: len(known.names), : len(known.names)] = known.information
    for k, u in enumerate(problem.unknowns):
        if u.prior is not None and (u.kind != "parameter" or (u.name in doubts and own[k] not in known.names)):
            # a meter good to so many watts is known better as a share once it has read a larger power
            base[place[k], place[k]] += max(0.0, u.prior.sd**-2 - known.held.get(u.name, 0.0))
    durations = np.linspace(0.0, float(times.max()), DURATIONS + 1)[1:]
    matrices = []
    for end in durations:
        part = rows[times <= end * (1 + 1e-9)]
        matrix = base.copy()
        matrix[np.ix_(place, place)] += part.T @ part
        matrices.append(matrix)
    return durations, matrices, names
