"""`ErrorModel`: a fit in, one object out that says how far any answer of its model may be from the truth, and why."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.stats import norm, qmc

from thermid.base.dual import value_of
from thermid.base.errors import IdentificationError
from thermid.base.linear_algebra import Array
from thermid.fit.calibration import Calibration
from thermid.fit.discrepancy import coefficient_path, constant_coefficients
from thermid.fit.problem import Problem, Unknown, prior_rows
from thermid.inference._error_model.elements import (
    Course,
    ElementLaw,
    Heat,
    Way,
    conductors_of,
    course_of,
    point_of,
    ways_of,
    with_heats,
    with_laws,
)
from thermid.inference._error_model.gaussian import Mixture, Wander, weights_of
from thermid.inference._error_model.posterior import Members, RunRows, members_of
from thermid.inference._error_model.runs import Column, Departures, Trace, departures_of, white_rows, widened
from thermid.inference._error_model.sizes import AGAIN, COUNTED, DRAWN, LEFT_SIZES, LEFT_TIMES, LIKELY, REACH, SHARES_OF_RUN, STEPS, TABLE
from thermid.simulation.runs import Simulator, network_for, output_times
from thermid.simulation.scenarios import Scenario
from thermid.simulation.solver import Engine, Options, Wiring

GROUPS = tuple(name for name in TABLE if name != "left")
"""Sizes that are drawn."""


@dataclass(frozen=True, eq=False)
class FittedWay:
    """The posterior where the heat is carried in one way.

    Parameters
    ----------
    way : Way
    laws : dict                 Conductor -> its law where the derivatives were taken.
    fitted : array (values,)    Values of the fit there, in the fitted form.
    departures : Departures
    columns : tuple of Column   Unknowns beside the values.
    members : Members           Of values and columns, less `fitted`.
    sizes : array (members, groups)     Of each member, in the order of `GROUPS`.
    left : tuple of Wander      Of each member.
    """

    way: Way
    laws: Mapping[str, ElementLaw]
    fitted: Array
    departures: Departures
    columns: tuple[Column, ...]
    members: Members
    sizes: Array
    left: tuple[Wander, ...]


def drawn_sizes(count: int) -> Array:
    """Return sizes (count, groups) of departures, evenly over their half-normal priors: points of Sobol's sequence."""
    points = qmc.Sobol(len(GROUPS), scramble=True, seed=0).random(count)
    return np.asarray(norm.ppf(0.5 + 0.5 * points) * [TABLE[g].value for g in GROUPS])


def deviations(columns: Sequence[Column], sizes: Array) -> Array:
    """Return the prior's standard deviations (members, columns)."""
    place = {g: k for k, g in enumerate(GROUPS)}
    return np.column_stack([np.full(len(sizes), c.size) if not c.group else c.size * sizes[:, place[c.group]] for c in columns]).reshape(
        len(sizes), len(columns)
    )


def reach(u: Unknown) -> float:
    """Return how far an unknown of a fit may lie that has no prior: by its bounds, else far; fitted form."""
    low, high = u.fitted_bounds()
    if np.isfinite(high - low):
        return float(high - low) / 12.0**0.5
    return REACH if u.log else REACH * u.scale


@dataclass(frozen=True, eq=False)
class _Linearised:
    """All runs of a fit at some values: courses, columns, traces."""

    departures: Departures
    columns: tuple[Column, ...]
    own: tuple[tuple[Column, ...], ...]
    traces: tuple[tuple[Trace, ...], ...]
    spans: tuple[float, ...]


def _linearised(
    problem: Problem, way: Way, laws: Mapping[str, ElementLaw], fitted: Array, points: Mapping[str, Any], kept: Departures | None
) -> _Linearised:
    courses: list[Course] = []
    networks = []
    for i, experiment in enumerate(problem.experiments):
        network = with_laws(experiment.network, laws)
        bare = widened(problem, i, network, experiment.scenario, ())
        bench = bare.benches()[0]
        courses.append(course_of(bench.wiring, bench.engine, bare.inputs(0, fitted)[0], problem.options))
        networks.append(network)
    longest = max(float(c.times[-1]) for c in courses)
    departures = kept or departures_of(networks[0], courses, points, tuple(part * longest for part in SHARES_OF_RUN))
    columns: tuple[Column, ...] = ()
    own: list[tuple[Column, ...]] = []
    traces: list[tuple[Trace, ...]] = []
    for i, (network, course) in enumerate(zip(networks, courses, strict=True)):
        shared, alone = departures.shared(network, course, way, laws), departures.own(network, course)
        columns = tuple(c for c, _ in shared)
        own.append(tuple(c for c, _ in alone))
        traces.append(_traces(problem, i, network, [h for _, h in (*shared, *alone)], fitted))
    return _Linearised(departures, columns, tuple(own), tuple(traces), tuple(float(c.times[-1]) for c in courses))


def _traces(problem: Problem, i: int, network: Any, heats: Sequence[Heat], fitted: Array) -> tuple[Trace, ...]:
    """Return the sensors of a run, with derivatives by every unknown and heat."""
    wide = widened(problem, i, *with_heats(network, problem.experiments[i].scenario, heats), heats)
    at = np.concatenate([fitted, np.zeros(len(heats))])
    slopes = wide.slopes(0, at)
    out = []
    for k, (o, block) in enumerate(zip(wide.experiments[0].observations, wide.blocks_of(0, at), strict=True)):
        noise = np.full(block.times.size, block.noise)
        out.append(Trace(block.times, block.residuals, noise, -slopes[o.index, k, :] * block.noise).averaged())
    return tuple(out)


def _white(runs: _Linearised, values: int, size: float, part: float) -> list[RunRows]:
    shared = values + len(runs.columns)
    return [RunRows.of(white_rows(traces, Wander(size, part * span)), shared) for traces, span in zip(runs.traces, runs.spans, strict=True)]


def _priors(problem: Problem, fitted: Array, columns: int) -> RunRows:
    """Return the priors of a fit as rows about its values."""
    left, rows = prior_rows(problem.unknowns, problem.coupled, fitted)
    joined = np.column_stack([rows, np.zeros((len(left), columns)), -left])
    return RunRows(joined.T @ joined, len(problem.unknowns) + columns, 0.0, 0)


def _posterior(problem: Problem, runs: _Linearised, fitted: Array, centre: Array, sizes: Array, left: tuple[float, float]) -> Members:
    values = len(problem.unknowns)
    rows = [_priors(problem, fitted, len(runs.columns)), *_white(runs, values, *left)]
    wide = np.array([reach(u) for u in problem.unknowns])
    shared = np.column_stack([np.broadcast_to(wide, (len(sizes), values)), deviations(runs.columns, sizes)])
    own = [np.zeros((len(sizes), 0)), *(deviations(c, sizes) for c in runs.own)]
    return members_of(rows, centre, shared, own)


def fitted_way(problem: Problem, fitted: Array, way: Way, points: Mapping[str, Any]) -> FittedWay:
    """Return the posterior where the heat is carried in one way: Newton steps in values, exponents and shares, then all sizes."""
    values, usual = fitted.size, np.array([[TABLE[g].value for g in GROUPS]])
    at, laws, kept = fitted.copy(), dict(way.laws), None
    bounds = np.array([u.fitted_bounds() for u in problem.unknowns]).reshape(values, 2)
    for step in range(STEPS + 1):
        runs = _linearised(problem, way, laws, at, points, kept)
        kept = runs.departures
        keys = {k: (path, kind) for k, c in enumerate(runs.columns) for (path, kind) in way.sizes if c.name == f"{kind} of {path}"}
        apart = {(p, what): x - laws[p].shape[what] for p, law in way.laws.items() for what, x in law.shape.items()}
        # the prior's mean, as seen from where the derivatives were taken
        centre = np.concatenate([fitted - at, [apart.get(keys.get(k), 0.0) for k in range(len(runs.columns))]])
        if step == STEPS:
            break
        found = _posterior(problem, runs, at, centre, usual, (TABLE["left"].value * LEFT_SIZES[2], LEFT_TIMES[1])).mean[0]
        at = np.clip(at + found[:values], bounds[:, 0], bounds[:, 1])
        laws = {
            path: law.moved({key[1]: float(found[values + k]) for k, key in keys.items() if key[0] == path}) for path, law in laws.items()
        }
    return _averaged(problem, runs, way, laws, at, centre)


def _averaged(problem: Problem, runs: _Linearised, way: Way, laws: Mapping[str, ElementLaw], at: Array, centre: Array) -> FittedWay:
    """Return the posterior at all sizes that count."""
    scale = TABLE["left"].value
    prior = left_prior()
    first = {key: _posterior(problem, runs, at, centre, drawn_sizes(DRAWN), (scale * key[0], key[1])) for key in prior}
    logs = {key: log + _mean_of(first[key].log_evidence) for key, log in prior.items()}
    likely = dict(zip(logs, weights_of(list(logs.values())), strict=True))
    sizes = drawn_sizes(AGAIN)
    parts, left = [], []
    for size, part in (key for key, share in likely.items() if share > LIKELY):
        again = _posterior(problem, runs, at, centre, sizes, (scale * size, part))
        parts.append(replace(again, log_evidence=again.log_evidence + prior[size, part]))
        left += [Wander(scale * size, part * max(runs.spans))] * AGAIN
    members = Members(*(np.concatenate([getattr(p, name) for p in parts]) for name in ("log_evidence", "mean", "root")))
    return FittedWay(way, laws, at, runs.departures, runs.columns, members, np.tile(sizes, (len(parts), 1)), tuple(left))


def left_prior() -> dict[tuple[float, float], float]:
    """Return (size, time) of what no element explains, in parts -> ln of its probability."""
    edges = np.r_[0.0, 0.5 * (np.array(LEFT_SIZES[1:]) + LEFT_SIZES[:-1]), np.inf]
    mass = 2.0 * np.diff(norm.cdf(edges))
    out = {(0.0, LEFT_TIMES[0]): float(np.log(mass[0]))}
    return out | {(s, t): float(np.log(m / len(LEFT_TIMES))) for s, m in zip(LEFT_SIZES[1:], mass[1:], strict=True) for t in LEFT_TIMES}


def _mean_of(logs: Array) -> float:
    """Return ln of the mean of what has these logarithms."""
    return float(logs.max() + np.log(np.mean(np.exp(logs - logs.max()))))


@dataclass(frozen=True, eq=False)
class ErrorBand:
    """What is known of the temperature of a node.

    Parameters
    ----------
    node : str
    times : array (times,)      [s]
    mixture : Mixture           Of its temperature. [K]
    parts : dict                Source -> variance (times,). [K^2]
    """

    node: str
    times: Array
    mixture: Mixture
    parts: Mapping[str, Array]

    @property
    def centre(self) -> Array:
        """Expected temperature (times,). [K]"""
        return self.mixture.mean

    @property
    def half_width(self) -> Array:
        """Half-width (times,) of the 95 % band. [K]"""
        low, high = self.mixture.interval()
        return 0.5 * (high - low)


@dataclass(frozen=True, eq=False)
class ErrorModel:
    """One model of error beside a fit.

    Parameters
    ----------
    fit : Calibration
    ways : tuple of FittedWay   What may carry the heat.
    weights : array (members of all ways,)
    """

    fit: Calibration
    ways: tuple[FittedWay, ...]
    weights: Array

    @classmethod
    def of(cls, fit: Calibration) -> ErrorModel:
        """Return the model of error of a fit."""
        problem = fit.problem
        if problem is None or not problem.unknowns:
            raise IdentificationError("this calibration does not hold what its fit was asked. Run the fit again.", fit.stage)
        fitted = np.array(list(fit.fitted.values()))
        courses = []
        for i, bench in enumerate(problem.benches()):
            courses.append(course_of(bench.wiring, bench.engine, problem.inputs(i, fitted)[0], problem.options))
        network = problem.experiments[0].network
        every = {p: c for course in courses for p, c in conductors_of(network, course).items()}
        points = {p: at for p, c in every.items() if (at := point_of(courses, c)) is not None}
        values = network.numbers({p: v.value for p, v in fit.values.assignments.items()}).values
        coefficients = {p: float(value_of(values[coefficient_path(c)])) for p, c in constant_coefficients(network).items()}
        ways = tuple(fitted_way(problem, fitted, way, points) for way in ways_of(network, points, coefficients))
        return cls(fit, ways, weights_of(np.concatenate([w.members.log_evidence for w in ways])))

    def band(
        self, scenario: Scenario, nodes: Sequence[str] = (), *, times: Any = None, every: Any = None, instruments: bool = False
    ) -> dict[str, ErrorBand]:
        """Return node -> what is known of its temperature in a scenario."""
        wanted = output_times(scenario, every, times)
        found: dict[str, list[tuple[Array, Array, dict[str, Array]]]] = {}
        weights, first = [], 0
        for way in self.ways:
            own = self.weights[first : first + len(way.left)]
            first += len(way.left)
            if own.max() < COUNTED * self.weights.max():
                continue
            kept = np.flatnonzero(own > COUNTED * self.weights.max())
            answer = _answer(self.fit, way, scenario, wanted, nodes, instruments)
            for n in answer.kelvin:
                found.setdefault(n, []).append(_members(way, answer, n, kept))
            weights.append(own[kept])
        share = np.concatenate(weights) / np.concatenate(weights).sum()
        out = {}
        for n, several in found.items():
            means, variances = (np.concatenate([s[k] for s in several]) for k in (0, 1))
            parts = {c: share @ np.concatenate([s[2][c] for s in several]) for c in several[0][2]}
            mixture = Mixture(share, means, variances)
            parts["which sizes, and what carries the heat"] = share @ (means - mixture.mean) ** 2
            out[n] = ErrorBand(n, wanted, mixture, parts)
        return out


@dataclass(frozen=True, eq=False)
class _Answer:
    """A question's run: temperatures and responses.

    kelvin: node -> (times,); rows: node -> (times, values + columns); own: node -> (times, own columns)
    """

    kelvin: Mapping[str, Array]
    rows: Mapping[str, Array]
    own: Mapping[str, Array]
    columns: tuple[Column, ...]
    beyond: Mapping[str, tuple[str, float]]


def _answer(fit: Calibration, way: FittedWay, scenario: Scenario, times: Array, nodes: Sequence[str], instruments: bool) -> _Answer:
    problem = fit.problem
    assert problem is not None
    network = with_laws(network_for(fit.fitted_model, scenario), way.laws)
    unknowns = problem.unknowns
    names: dict[str, tuple[int, float]] = {}
    for k, u in enumerate(unknowns):
        if u.kind == "parameter":
            names |= {n: (k, u.slope(float(way.fitted[k]))) for n in (u.name, *u.also)}
    values = np.array([unknowns[k].to_value(float(way.fitted[k])) for k, _ in names.values()])
    bare = Wiring(network, scenario, tuple(names))
    options = Options()
    course = course_of(bare, Engine(bare), values, options)
    shared = way.departures.shared(network, course, way.way, way.laws)
    alone = way.departures.own(network, course)
    heats = [h for _, h in (*shared, *alone)]
    wide, asked = with_heats(network, scenario, heats)
    loads = [f"scale.{n}" for h in heats for n in h.loads]
    made = Wiring(wide, asked, (*names, *loads))
    simulator = Simulator(fit.model.title, made, Engine(made), times, options)
    run = simulator.run(dict(zip(names, values.tolist(), strict=True)) | dict.fromkeys(loads, 0.0), sensitivities=True)
    chain = np.zeros((len(names) + len(loads), len(unknowns) + len(heats)))
    for row, (k, slope) in enumerate(names.values()):
        chain[row, k] = slope
    row = len(names)
    for j, h in enumerate(heats):
        chain[row : row + len(h.loads), len(unknowns) + j] = 1.0
        row += len(h.loads)
    wanted = list(dict.fromkeys(run[n].path for n in (nodes or run.nodes)))
    place = {(c.name): j for j, (c, _) in enumerate(shared)}
    cut = len(unknowns) + len(shared)
    rows = {n: run.slopes(n) @ chain for n in wanted}
    order = [*range(len(unknowns)), *(len(unknowns) + place[c.name] for c in way.columns if c.name in place)]
    assert [c.name for c in way.columns] == [c.name for c, _ in shared]
    return _Answer(
        {n: run[n].kelvin for n in wanted},
        {n: r[:, order] for n, r in rows.items()},
        {n: r[:, cut:] for n, r in rows.items()},
        tuple(c for c, _ in alone),
        way.departures.beyond(network, course),
    )


def _members(way: FittedWay, answer: _Answer, node: str, kept: Any) -> tuple[Array, Array, dict[str, Array]]:
    """Return means and variances (members, times) of a node, and what these come from."""
    rows, own = answer.rows[node], answer.own[node]
    sizes = way.sizes[kept]
    means = answer.kelvin[node] + way.members.mean[kept] @ rows.T
    spread = rows @ way.members.root[kept]
    known = np.sum(spread**2, axis=2)
    alone = deviations(answer.columns, sizes)
    place = {g: k for k, g in enumerate(GROUPS)}
    for j, c in enumerate(answer.columns):
        if c.source in answer.beyond and c.group == "run":
            kind, rest = answer.beyond[c.source]
            alone[:, j] = np.sqrt(alone[:, j] ** 2 + rest * sizes[:, place[kind]] ** 2)
    parts = {"values and structure": known}
    for group, name in (("run", "this run"), ("room", "room")):
        which = [j for j, c in enumerate(answer.columns) if c.group == group]
        parts[name] = (alone[:, which] ** 2) @ (own[:, which] ** 2).T
    parts["not explained"] = np.repeat(np.array([way.left[k].size ** 2 for k in kept])[:, None], own.shape[0], axis=1)
    return means, np.sum(list(parts.values()), axis=0), parts
