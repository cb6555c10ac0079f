"""The kinds of run among the records of a fit, and how far its coefficients, powers and masses differ between them.

Every record is looked at in stretches of time. Its residuals there are what the deviations of its kind do to the predicted readings, less
what the fit followed of them (its values, and the room and start of the run itself), and what wanders beyond. The sizes of the deviations
have the largest restricted likelihood, taken at each stretch by itself (a composite likelihood: Varin, Reid and Firth, Statistica Sinica 21
(2011) 5), so that the predicted variance is right where it is used; each kind counts as many numbers as its residuals are worth
(Satterthwaite: ``n^2 / sum rho^2``), however many records or readings it has.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from thermid.base.dual import value_of
from thermid.base.linear_algebra import Array, Indices, quadratic_forms, symmetric_inverse
from thermid.fit._calibration import Calibration
from thermid.fit._discrepancy.regimes import (
    BALANCE,
    GROUPS,
    LEFT,
    ROOM,
    ROOMS,
    Beside,
    OwnValue,
    Regimes,
    grid_of,
    log_prior,
    root_mean_square,
)
from thermid.fit._problem.experiment import SCALE, Experiment, first_reading, of_a_sensor
from thermid.fit._problem.gather import wired
from thermid.fit._problem.residuals import Influence, Problem, Unknown
from thermid.fit._uncertainty.noise import stretch_means
from thermid.model.identity import identity_of
from thermid.model.laws import Signal, TableSignal
from thermid.model.tree import Flat, FlatConductor, FlatLoad, FlatNode
from thermid.physics.constants import ICE_POINT
from thermid.simulation.scenarios import Scenario
from thermid.simulation.solver import Engine, Wiring

STRETCHES = 40
"""Stretches of time of a record."""
MANY = 40
"""Deviations beyond which only what a fit found, and powers, deviate: each costs a derivative of every run."""
MEMORY = 0.15
"""Correlation time of what wanders, in lengths of the run, where it only says how much of it a fitted room follows. [-]"""
SWEEPS = 4
"""How often each size is looked for in turn."""
SLOPE = 0.5
"""Standard deviation of what one more kelvin of another sensor's first reading says of a room or start, before any run: from none of it
to all of it (the other sensor alone). [-]"""
INSTANTS = 601
"""Times at which the powers of a run are looked at."""
ACTIVE, STEP, RESTLESS = 0.02, 0.02, 0.6
"""Share of the power from which a load acts; change of it, in parts of its largest, that is one; share of samples with one from which a
command is a controller's, and a power varies continuously. [-]"""
HOT, BAND, BORDER = 5.0, 20.0, -10.0
"""Kelvin from the boundary from which a start is hot; width of the classes of a boundary's temperature, and one of their borders
[degC]."""


# ---- kinds of run -----------------------------------------------------------------------------------------------------------------


def kind_of_run(wiring: Wiring, engine: Engine, x: Array | None) -> str:
    """Return the kind of a run in words: what is heated, how much and how, from which start, in which surroundings."""
    scenario, network = wiring.scenario, wiring.network
    started = engine.started(wiring.assemble(x, False))
    first = dict(zip(started.reduced.nodes, np.asarray(started.initial, dtype=float).tolist(), strict=True))
    around = {b: s.at(np.array([0.0, scenario.seconds])) for b, s in scenario.boundaries.items() if b in network.boundaries}
    room = float(np.mean(list(around.values()))) if around else float(np.mean(list(first.values())))
    parts = [network.flat.parameters.title, _heated(wiring)]
    hottest = max(first, key=lambda n: abs(first[n] - room), default="")
    if hottest and abs(first[hottest] - room) > HOT:
        parts.append(f"from {'hot' if first[hottest] > room else 'cold'} {hottest}")
    low = BORDER + BAND * ((room - ICE_POINT - BORDER) // BAND)
    parts.append(f"at {low:.0f} to {low + BAND:.0f} degC")
    return ", ".join([*parts, *_gases(scenario)])


def _heated(wiring: Wiring) -> str:
    """Return which loads act, how much power they put in together, and how it changes."""
    times = np.linspace(0.0, max(wiring.scenario.seconds, 1e-9), INSTANTS)
    watts = {n: w for n, w in _powers(wiring, times).items() if w.any()}
    whole = sum(np.abs(w).mean() for w in watts.values())
    active = sorted(n for n, w in watts.items() if np.abs(w).mean() > ACTIVE * whole)
    if not active:
        return "unheated"
    scenario = wiring.scenario
    commanded = max((_changes(scenario.commands[n], 0.0) for n in active if n in scenario.commands), default=0.0)
    powered = max((_changes(scenario.loads[n], STEP) for n in active if n in scenario.loads), default=0.0)
    steady = all(np.ptp(watts[n]) <= STEP * np.abs(watts[n]).max() for n in active)
    shape = "steady" if steady else "switched"
    if max(commanded, powered) > RESTLESS:
        shape = "in closed loop" if commanded > RESTLESS else "varied continuously"
    return f"{' and '.join(active)} {shape} about {2.0 ** round(float(np.log2(whole))):g} W"


def _changes(given: Signal, least: float) -> float:
    """Return the share of the samples of a signal at which it changes by more than a part of its largest value. [-]

    A command that is set anew at most samples is a controller's: one that a person or a plan gives is held.
    """
    if not isinstance(given, TableSignal) or given.instants.size < 2:
        return 0.0
    taken = given.at(given.instants)
    return float(np.mean(np.abs(np.diff(taken)) > least * np.abs(taken).max()))


def _powers(wiring: Wiring, times: Array) -> dict[str, Array]:
    """Return load -> its power at some times, as far as its inputs say it; what a temperature does to it is left out. [W]"""
    scenario, values = wiring.scenario, wiring.network.numbers().values
    out = {}
    for load in wiring.network.flat.loads:
        given = scenario.loads.get(load.path)
        if given is not None:
            out[load.path] = given.at(times)
            continue
        power = float(value_of(values[load.fields["power"]])) if "power" in load.fields else 0.0
        command = scenario.commands.get(load.path)
        out[load.path] = power * (command.at(times) if command is not None else np.ones(times.size))
    return out


def _gases(scenario: Scenario) -> list[str]:
    """Return the states of gases that are not the atmosphere on the ground, in decades of pressure."""
    out = []
    for gas, around in scenario.environment.items():
        low, high = around.pressure.bounds
        level = 0.5 * (low + high)
        decade = f"{10.0 ** round(float(np.log10(level))):g} Pa" if level > 0.0 else "no gas"
        out.append(f"{gas} at {decade}")
    return out


# ---- what deviates ----------------------------------------------------------------------------------------------------------------


def directions(flat: Flat, fitted: Sequence[str], loads: Sequence[str]) -> dict[str, str]:
    """Return what deviates from kind to kind -> its group: of every element what was fitted of it, else its first number.

    Parameters
    ----------
    flat : Flat
    fitted : sequence   Parameters that this fit or one below found.
    loads : sequence    Loads that act.
    """
    touched = {p: set(flat.parameters.downstream([p])) for p in fitted if p in flat.parameters.table}
    elements: list[tuple[str, FlatConductor | FlatLoad | FlatNode]] = [
        *(("power", e) for e in flat.loads if e.path in loads),
        *(("mass", e) for e in flat.nodes if e.fields),
        *(("coefficient", e) for e in flat.conductors),
    ]
    found: dict[str, str] = {}
    other: dict[str, str] = {}
    for group, element in elements:
        own = [p for p, reach in touched.items() if reach & {*element.fields.values(), *_emissivity(element)}]
        for p in own:
            found.setdefault(p, group)
        if own:
            continue
        if isinstance(element, FlatLoad):
            found[SCALE + element.path] = group
        elif literal := _number(flat, element):
            other.setdefault(literal, group)
    return found | other if len(found) + len(other) <= MANY else found


def _emissivity(element: FlatConductor | FlatLoad | FlatNode) -> list[str]:
    return [element.emissivity] if isinstance(element, FlatConductor) and element.emissivity else []


SIZES = (
    *("conductance", "resistance", "effective_htc", "htc", "htc.coefficient"),
    *("contact_conductance", "emissivity", "conductivity", "scale"),
)
"""Fields of a conductor that its heat flow is proportional to, the first one that it has counts."""
STORES = ("capacitance", "mass")
"""The same of a node."""


def _number(flat: Flat, element: FlatConductor | FlatNode) -> str:
    """Return the number in a deck that an element is proportional to; empty where it has none above zero."""
    for key in STORES if isinstance(element, FlatNode) else SIZES:
        path = flat.parameters.literal_behind(element.fields[key]) if key in element.fields else ""
        if path and flat.parameters.table[path].parameter.is_literal and flat.parameters.evaluate({}, [path])[path] > 0:
            return path
    return ""


# ---- records in stretches of time ---------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class RegimeRun:
    """A record in stretches of time, one row per stretch and sensor.

    Parameters
    ----------
    record, kind : str
    residuals : array (rows,)           Measured less predicted. [K]
    inner : array (rows,)               Variance of the mean of a stretch by what scatters in it. [K^2]
    misfit : array (rows,)              What wanders in the residuals of its node. [K]
    weights : array (rows,)             Of the fit. [1/K^2]
    shared : array (rows, globals)      Derivatives of the reading by what all records share; fitted form.
    deviating : array (rows, directions)    The same by the logarithm of what deviates. [K]
    own : array (rows, locals)          The same by what the record has for itself.
    known : array (locals, locals)      Inverse covariance of the priors of these.
    spans : array (rows,)               Times, in lengths of the run. [-]
    sensor : array (rows,)              Which sensor a row is of.
    values : dict                       Own temperature with a stated start -> (text of the start, found less start [K], column).
    first : dict                        Sensor -> its first reading. [K]
    """

    record: str
    kind: str
    residuals: Array
    inner: Array
    misfit: Array
    weights: Array
    shared: Array
    deviating: Array
    own: Array
    known: Array
    spans: Array
    sensor: Indices
    values: Mapping[str, tuple[str, float, int]]
    first: Mapping[str, float]

    @property
    def follows(self) -> Array:
        """What the record's own values answer to a change of its residuals (locals, rows)."""
        weighed = self.own * self.weights[:, None]
        return symmetric_inverse(weighed.T @ self.own + self.known) @ weighed.T if self.own.shape[1] else weighed.T

    def left(self, moved: Array) -> Array:
        """Return what is left of changes (rows, columns) of the residuals once the record's own values have answered."""
        return moved - self.own @ (self.follows @ moved)

    @property
    def wandering(self) -> Array:
        """Correlations (rows, rows) of what wanders, each sensor by itself."""
        return wandering(self.spans, self.sensor)


def wandering(spans: Array, sensor: Indices) -> Array:
    """Return exponential correlations of what wanders (rows, rows) at times in lengths of the run, each sensor by itself."""
    apart = np.exp(-np.abs(spans[:, None] - spans[None, :]) / MEMORY)
    return np.asarray(np.where(sensor[:, None] == sensor[None, :], apart, 0.0))


def _widened(fit: Calibration, problem: Problem, names: Mapping[str, str]) -> tuple[Problem, Array, dict[str, int]]:
    """Return the problem with what deviates among its unknowns, where it is, and the column of each."""
    at = np.array(list(fit.fitted.values()))
    place = {u.name: k for k, u in enumerate(problem.unknowns)}
    numbers = problem.experiments[0].network.numbers({p: v.value for p, v in fit.values.assignments.items()}).values
    more: list[Unknown] = []
    for name in (n for n in names if n not in place):
        targets = [Influence(i, name) for i in range(len(problem.experiments))]
        value = 1.0
        if name.startswith(SCALE):  # beside a meter's error, which is a factor on the same power
            taken = {t.experiment for u in problem.unknowns for t in u.targets if t.name == name}
            targets = [Influence(i, name, -1.0 if i in taken else 0.0) for i in range(len(problem.experiments))]
        else:
            value = float(value_of(numbers[name]))
        place[name] = len(problem.unknowns) + len(more)
        more.append(Unknown(name, "parameter", tuple(targets), value, True))
    wide = replace(problem, unknowns=(*problem.unknowns, *more))
    return wide, np.concatenate([at, [u.to_fitted(u.start) for u in more]]), place


def _runs(fit: Calibration, problem: Problem, names: Mapping[str, str], misfit: Mapping[str, float]) -> list[RegimeRun]:
    """Return the records of a fit in stretches of time."""
    wide, at, place = _widened(fit, problem, names)
    end, size = at[: len(problem.unknowns)], len(problem.unknowns)
    rows = problem.prior_rows(end)[1]
    priors = rows.T @ rows
    alone = [{*(t.experiment for t in u.targets)} if u.kind == "local" else set[int]() for u in problem.unknowns]
    shared = [k for k in range(size) if not alone[k]]
    unit = np.array([1.0 if wide.unknowns[place[n]].log else at[place[n]] for n in names])
    out = []
    for i, e in enumerate(problem.experiments):
        times, span = e.times, max(float(e.times[-1] - e.times[0]), 1e-9)
        count = max(min(STRETCHES, times.size // 2), 1)
        edges = np.linspace(times[0], times[-1], count + 1)
        centres = 0.5 * (edges[1:] + edges[:-1])
        slopes = wide.slopes(i, at, centres)
        own = [k for k in range(size) if alone[k] == {i}]
        parts: list[list[Array]] = []
        for k, (o, block) in enumerate(zip(e.observations, problem.blocks_of(i, end), strict=True)):
            where = np.clip(np.searchsorted(edges, block.times, side="right") - 1, 0, count - 1)
            inside = np.bincount(where, minlength=count).astype(float)
            full = inside > 0
            means = stretch_means(block.residuals, where, count)
            scatter = block.residuals - means[where]
            inner = float(scatter @ scatter) / max(block.residuals.size - int(full.sum()), 1)
            moved = -o.sigma(problem.noise) * slopes[full, k, :]
            n = int(full.sum())
            weights = inside[full] / o.sigma(problem.noise) ** 2
            flat = [means[full], inner / inside[full], np.full(n, misfit.get(o.seat, 0.0)), weights, centres[full] / span, np.full(n, k)]
            parts.append([*flat, moved[:, shared], moved[:, [place[n] for n in names]] * unit, moved[:, own]])
        r, inner_rows, size_rows, w, spans, sensor, x, d, f = (np.concatenate(p) for p in zip(*parts, strict=True))
        known = priors[np.ix_(own, own)]
        kind = kind_of_run(problem.bench(i, end).wiring, problem.bench(i, end).engine, problem.inputs(i, end)[0])
        values = _stated_starts(fit, problem, i, end, own)
        window = fit.request.window if fit.request is not None else 0.0
        first = {o.sensor: first_reading(e.record, o.sensor, window) for o in e.observations}
        out.append(
            RegimeRun(e.record.name, kind, r, inner_rows, size_rows, w, x, d, f, known, spans, sensor.astype(np.intp), values, first)
        )
    return out


def _stated_starts(fit: Calibration, problem: Problem, i: int, end: Array, own: Sequence[int]) -> dict[str, tuple[str, float, int]]:
    """Return name -> (text of its stated start, found less start [K], column), of the rooms and starts of a record."""
    e, request = problem.experiments[i], fit.request
    if request is None:
        return {}
    find = {wired(e, n): n for n in request.locals_of(e.record)}
    out = {}
    for column, k in enumerate(own):
        name = problem.unknowns[k].name.removeprefix(f"{e.record.name}: ")
        if name in find:
            raw = find[name]
            out[name] = (request.locals_of(e.record)[raw].start, float(end[k]) - request.local_start(e.record, raw), column)
        elif (node := name.removeprefix("initial.")) in e.hidden and node != name:
            out[name] = (BALANCE, float(end[k]) - e.hidden[node].mean, column)
    return out


# ---- sizes --------------------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Stack:
    """All rows of all records: squared residuals, and what a unit of each size adds to their variance.

    Parameters
    ----------
    squares : array (rows,)         [K^2]
    unit : dict                     Group, or ``left`` -> (rows,). [K^2]
    inner : array (rows,)           Variance that no size changes. [K^2]
    weight : array (rows,)          How much each row counts.
    """

    squares: Array
    unit: Mapping[str, Array]
    inner: Array
    weight: Array

    def logs(self, sizes: Mapping[str, float], group: str) -> Array:
        """Return the log-likelihood of each size of a group that is tried, the others held."""
        # ln N(r; 0, v) = -(ln v + r^2 / v) / 2 but for a constant, with v = inner + sum of unit size^2
        rest = self.inner + sum(self.unit[g] * sizes[g] ** 2 for g in self.unit if g != group)
        variance = rest[None, :] + grid_of(group)[:, None] ** 2 * self.unit[group][None, :]
        return np.asarray(-0.5 * (np.log(variance) + self.squares / variance) @ self.weight)


def regimes_of(fit: Calibration, misfit: Mapping[str, float]) -> Regimes | None:
    """Return what the kinds of run of a fit say of a further one; None of synthetic records, and where nothing was fitted.

    A prior of what hardware differs by says nothing of records that a law made. Of a joint fit of several levels the stages say it.

    Parameters
    ----------
    fit : Calibration
    misfit : dict       Node -> standard deviation of what wanders in its residuals. [K]
    """
    problem = fit.problem
    if fit.synthetic or problem is None or not any(u.kind == "parameter" for u in problem.unknowns):
        return None
    if any(identity_of(e.model) != identity_of(fit.model) for e in problem.experiments):
        return None  # levels of an assembly fitted together have no parameter paths in common
    below = list(fit.store.parameters) if fit.store is not None else []
    flat = problem.experiments[0].network.flat
    fitted = [*(u.name for u in problem.unknowns if u.kind == "parameter"), *(p for p in below if p in flat.parameters.table)]
    acting = {n for e in problem.experiments for n in _acting(e)}
    fixed = {p for e in problem.experiments for p in e.scenario.driven(e.network.flat)}
    every = directions(flat, list(dict.fromkeys(fitted)), sorted(acting))
    # a sensor that is a node of its own is an instrument: no other kind of run of the hardware has it
    names = {n: group for n, group in every.items() if n not in fixed and not of_a_sensor(n)}
    if not names:
        return None
    runs = _runs(fit, problem, names, misfit)
    return _estimated(fit, problem, runs, names)


def _acting(e: Experiment) -> list[str]:
    """Return the loads that put in any power in a record."""
    wiring = e.memo.made("plain wiring", lambda: Wiring(e.network, e.scenario, ()))
    times = np.linspace(0.0, max(e.scenario.seconds, 1e-9), INSTANTS)
    return [n for n, w in _powers(wiring, times).items() if w.any()]


def _estimated(fit: Calibration, problem: Problem, runs: Sequence[RegimeRun], names: Mapping[str, str]) -> Regimes:
    kinds: dict[str, list[RegimeRun]] = {}
    for run in runs:
        kinds.setdefault(run.kind, []).append(run)
    responses = _responses(problem, kinds)
    groups = np.array(list(names.values()))
    sizes = {g: 0.03 for g in GROUPS if g in groups} | {LEFT: 0.7}
    unit = [_units(run, responses, groups) for run in runs]
    worth = np.full(len(runs), 4.0)
    evidence: dict[str, Array] = {}
    for _ in range(2):
        stack = _stacked(runs, unit, worth, kinds)
        for _ in range(SWEEPS):
            for g in sizes:
                evidence[g] = stack.logs(sizes, g)
                sizes[g] = root_mean_square(grid_of(g), evidence[g] + log_prior(g))
        worth = np.array([_worth(run, sizes, groups) for run in runs])
    shared = [u.name for u in problem.unknowns if u.kind != "local"]
    kept = [k for k, n in enumerate(shared) if n in fit.values]
    noise: dict[str, list[float]] = {}
    for e in problem.experiments:
        run = next(r for r in runs if r.record == e.record.name)
        for k, o in enumerate(e.observations):
            at = run.sensor == k
            noise.setdefault(o.seat, []).append(float(np.median(run.inner[at] * run.weights[at]) * o.sigma(problem.noise) ** 2))
    return Regimes(
        {k: tuple(r.record for r in several) for k, several in kinds.items()},
        tuple(names),
        tuple(groups.tolist()),
        tuple(shared[k] for k in kept),
        {k: r[kept] for k, r in responses.items()},
        evidence,
        _own_values(runs, kinds, responses, sizes, groups),
        {n: float(np.sqrt(np.median(v))) for n, v in noise.items()},
        tuple(e.record.origin.sha256 for e in problem.experiments),
    )


def _responses(problem: Problem, kinds: Mapping[str, Sequence[RegimeRun]]) -> dict[str, Array]:
    """Return kind -> (shared unknowns, directions): what the fit moves by for a unit of the deviations of that kind."""
    shared = [k for k, u in enumerate(problem.unknowns) if u.kind != "local"]
    rows = problem.prior_rows(np.zeros(len(problem.unknowns)))[1][:, shared]
    known = rows.T @ rows
    cross = {}
    for kind, several in kinds.items():
        cross[kind] = np.zeros((len(shared), several[0].deviating.shape[1]))
        for run in several:
            # least squares: (P + sum X'WX)^-1 X'WD, X the shared unknowns less what the run's own values follow, D the deviations
            weighed = run.left(run.shared).T * run.weights
            known = known + weighed @ run.shared
            cross[kind] = cross[kind] + weighed @ run.deviating
    inverse = symmetric_inverse(known)
    return {kind: inverse @ c for kind, c in cross.items()}


def _units(run: RegimeRun, responses: Mapping[str, Array], groups: Array) -> dict[str, Array]:
    """Return group, or ``left`` -> what a unit of its size adds to the variance of the residuals of a run (rows,). [K^2]"""
    seen = run.left(run.shared)
    # a deviation of another kind acts through the fit alone, X R; one of this kind also by itself, D - X R
    parts = sum((seen @ r) ** 2 for kind, r in responses.items() if kind != run.kind)
    parts = parts + (run.left(run.deviating) - seen @ responses[run.kind]) ** 2
    out = {g: parts[:, groups == g].sum(axis=1) for g in GROUPS if (groups == g).any()}
    through = np.eye(run.residuals.size) - run.own @ run.follows
    like = run.misfit[:, None] * run.wandering * run.misfit
    # diag(T C T'), T = 1 - F: what wanders, less what the run's own values follow of it
    out[LEFT] = quadratic_forms(through, like)
    return out


def _stacked(
    runs: Sequence[RegimeRun], unit: Sequence[Mapping[str, Array]], worth: Array, kinds: Mapping[str, Sequence[RegimeRun]]
) -> Stack:
    weight = [np.full(r.residuals.size, n / len(kinds[r.kind]) / r.residuals.size) for r, n in zip(runs, worth, strict=True)]
    together = {g: np.concatenate([u[g] for u in unit]) for g in unit[0]}
    return Stack(
        np.concatenate([r.residuals**2 for r in runs]),
        together,
        np.maximum(np.concatenate([r.inner for r in runs]), 1e-6),
        np.concatenate(weight),
    )


def _worth(run: RegimeRun, sizes: Mapping[str, float], groups: Array) -> float:
    """Return how many independent numbers the residuals of a run are worth about their variance."""
    moved = run.left(run.deviating) * np.array([sizes[g] for g in groups])
    through = np.eye(run.residuals.size) - run.own @ run.follows
    wanders = (sizes[LEFT] * run.misfit)[:, None] * run.wandering * (sizes[LEFT] * run.misfit)
    whole = moved @ moved.T + through @ wanders @ through.T + np.diag(np.maximum(run.inner, 1e-6))
    size = np.sqrt(np.diag(whole))
    # Satterthwaite: n^2 / sum of rho_ij^2, rho the correlations of the residuals
    return float(run.residuals.size**2 / np.sum((whole / size[:, None] / size) ** 2))


def _own_values(
    runs: Sequence[RegimeRun],
    kinds: Mapping[str, Sequence[RegimeRun]],
    responses: Mapping[str, Array],
    sizes: Mapping[str, float],
    groups: Array,
) -> tuple[OwnValue, ...]:
    """Return how far rooms and starts stand from where they are assumed, what the deviations of kinds do to them taken off."""
    scale = np.array([sizes[g] for g in groups])
    found: dict[tuple[str, str], list[tuple[RegimeRun, float, float]]] = {}
    for run in runs:
        for name, (start, off, column) in run.values.items():
            answer = run.follows[column]
            moved = answer @ run.deviating - answer @ run.shared @ responses[run.kind]
            parts = moved**2 + sum((answer @ run.shared @ r) ** 2 for kind, r in responses.items() if kind != run.kind)
            drifts = sizes[LEFT] * run.misfit * answer
            variance = float(parts @ scale**2 + drifts @ run.wandering @ drifts)
            found.setdefault((name, start), []).append((run, off, variance))
    return tuple(_own_value(name, start, several) for (name, start), several in found.items() if len(several) > 1)


def _own_value(name: str, start: str, several: Sequence[tuple[RegimeRun, float, float]]) -> OwnValue:
    """Return one of them from the runs that have it: what each found [K], and variance by deviations and by what wanders. [K^2]

    Offsets are ``N(mean + X slopes, sd^2 + V)``; X is how far the first readings of other sensors stand from the one that the value
    stands on. Each kind counts alike. The sd has the largest restricted likelihood (Patterson and Thompson, Biometrika 58 (1971) 545).
    """
    off, known = np.array([o for _, o, _ in several]), np.array([v for _, _, v in several])
    kinds = [r.kind for r, _, _ in several]
    alike = np.array([1.0 / kinds.count(k) for k in kinds])
    counts = alike * alike.sum() / (alike @ alike)  # as many runs as such weights leave (Kish, Survey Sampling, 1965)
    others = [c for c in several[0][0].first if c != start and all(c in r.first and start in r.first for r, _, _ in several)]
    apart = np.array([[r.first[c] - r.first[start] for c in others] for r, _, _ in several]).reshape(off.size, len(others))
    usual = counts @ apart / counts.sum()
    rows = np.column_stack([np.ones(off.size), apart - usual])
    prior = np.diag([0.0, *np.full(len(others), SLOPE**-2.0)])
    logs, ends, squares = np.zeros(ROOMS.size), np.zeros((ROOMS.size, rows.shape[1])), np.zeros((ROOMS.size, rows.shape[1]))
    for i, sd in enumerate(ROOMS):
        variance = known + sd**2
        weighed = rows * (counts / variance)[:, None]
        spread = symmetric_inverse(weighed.T @ rows + prior)
        ends[i] = spread @ weighed.T @ off
        left = off - rows @ ends[i]
        squares[i] = np.diag(spread) + ends[i] ** 2
        # the last term stands for the estimated mean and slopes
        logs[i] = -0.5 * counts @ (np.log(variance) + left**2 / variance) - 0.5 * ends[i] @ prior @ ends[i]
        logs[i] += 0.5 * np.linalg.slogdet(spread)[1]
    # ln sd because each size that is tried stands for an equal step of its logarithm, then the half-normal prior
    logs += np.log(ROOMS) - 0.5 * (ROOMS / ROOM) ** 2
    share = np.exp(logs - logs.max())
    share /= share.sum()
    end = share @ ends
    errors = np.sqrt(np.maximum(share @ squares - end**2, 0.0))
    beside = tuple(Beside(c, float(m), float(k), float(s)) for c, m, k, s in zip(others, usual, end[1:], errors[1:], strict=True))
    return OwnValue(name, start, float(end[0]), root_mean_square(ROOMS, logs), off.size, beside)
