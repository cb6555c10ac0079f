"""`next_test`: which of the tests that could be made would say most of a parameter, or of a prediction, and how long it would take."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thermid.arguments import takes_objects
from thermid.design.actions import Action, Aim, usual_actions
from thermid.design.planned import Sensor, planned_record, sensors_of
from thermid.design.ranking import Advice, Option
from thermid.errors import IdentificationError, NameNotFoundError, ThermidError, nearest
from thermid.fit.calibration import Calibration
from thermid.fit.problem.gather import build_problem
from thermid.fit.problem.request import Request
from thermid.fit.problem.residuals import Problem
from thermid.linear_algebra import variance
from thermid.model.laws.signal import literal
from thermid.model.tree.model import Model
from thermid.prediction.before import WITHOUT_GAS, Before, before_fit, before_model, unknown_of
from thermid.prediction.doubts import doubted, doubts_without_gas
from thermid.simulation.scenarios.scenario import Scenario

Array = NDArray[np.float64]
NAME = "next test"
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
    from thermid.fit.problem.experiment import role_and_target

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
    return float(np.sqrt(variance(information, gradient)))


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
        problem = doubted(build_problem(request), doubts)
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
