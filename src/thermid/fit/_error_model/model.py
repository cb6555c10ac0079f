"""Posterior of a fit under the model of error: Newton steps in values and laws, then all sizes that count."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from thermid.base.linear_algebra import Array
from thermid.fit._error_model.courses import ElementCourse, OperatingPoint, course_of, point_of
from thermid.fit._error_model.elements import (
    DepartureHeat,
    ElementLaw,
    Way,
    conductors_of,
    with_heats,
    with_laws,
)
from thermid.fit._error_model.gaussian import Members, RunRows, Wander, members_of, weights_of
from thermid.fit._error_model.runs import Departures, SensorRows, UnknownColumn, departures_of, run_rows, widened
from thermid.fit._error_model.sizes import (
    ARRIVED,
    FEWEST_SETS,
    FIRST_SETS,
    LEAST_NOISE,
    LEFT_SIZES,
    LEFT_TIMES,
    LIKELY,
    NEWTON_STEPS,
    SETS,
    SETS_COST,
    SHARES_OF_RUN,
    SIZES,
    UNBOUNDED,
    USUAL_LEFT,
    USUAL_NOISE,
)
from thermid.fit._problem.experiment import Experiment, Observation
from thermid.fit._problem.residuals import Problem, Unknown, prior_rows
from thermid.measure.records import noise_seen
from thermid.simulation.network import Network

ROOT_STEPS = 60
"""Steps in which the root of a recurrence is found to the last digit."""
GROUPS = tuple(name for name in SIZES if name != "left")
"""Sizes that are drawn, in order."""


@dataclass(frozen=True, eq=False)
class FittedWay:
    """The posterior where the heat is carried in one way.

    Parameters
    ----------
    way : Way
    laws : dict                 Conductor -> its law where the derivatives were taken.
    values : dict               Value of the fit that runs share -> where the derivatives were taken, in the fitted form.
    departures : Departures
    columns : tuple of UnknownColumn   Unknowns beside the values.
    members : Members           Of values, less where the derivatives were taken, and of columns.
    sizes : array (members, groups)     Of each member, in the order of `GROUPS`.
    left : array (members, 2)   Size of what no element explains [K], and its time constant in parts of a run.
    """

    way: Way
    laws: Mapping[str, ElementLaw]
    values: Mapping[str, float]
    departures: Departures
    columns: tuple[UnknownColumn, ...]
    members: Members
    sizes: Array
    left: Array

    @property
    def places(self) -> dict[str, int]:
        """Value or column -> its place among the unknowns."""
        return {name: k for k, name in enumerate((*self.values, *(c.name for c in self.columns)))}


def drawn_sizes(count: int) -> Array:
    """Return sizes (count, groups) of departures, evenly over their half-normal priors.

    Points of an additive recurrence whose steps are powers of the root of ``x^(d + 1) = x + 1`` (Niederreiter, Random Number Generation and
    Quasi-Monte Carlo Methods, SIAM 1992, chapter 3): as even as those of Sobol, at the cost of a sum.
    """
    from scipy.special import ndtri

    root = 1.0
    for _ in range(ROOT_STEPS):
        root = (1.0 + root) ** (1.0 / (len(GROUPS) + 1))
    points = (0.5 + np.arange(1, count + 1)[:, None] * root ** -np.arange(1.0, len(GROUPS) + 1)) % 1.0
    return np.asarray(ndtri(0.5 + 0.5 * points) * [SIZES[g].value for g in GROUPS])


def deviations(columns: Sequence[UnknownColumn], sizes: Array) -> Array:
    """Return the prior's standard deviations (members, columns) of unknowns at sizes (members, groups)."""
    out = np.empty((len(sizes), len(columns)))
    for k, c in enumerate(columns):
        out[:, k] = c.size * (sizes[:, GROUPS.index(c.group)] if c.group else 1.0)
    return out


def reach(u: Unknown) -> float:
    """Return how far an unknown of a fit may lie that has no prior: by its bounds, else far; fitted form."""
    low, high = u.fitted_bounds()
    whole = float(high) - float(low)
    if np.isfinite(whole):
        return whole / float(12.0**0.5)
    return UNBOUNDED if u.log else UNBOUNDED * float(u.scale)


@dataclass(frozen=True, eq=False)
class RunsOfFit:
    """All runs of a fit at some values, as straight lines in everything that is not known.

    Parameters
    ----------
    problem : Problem           The fit's.
    fitted : array (unknowns,)  Where.
    values : list               Which of its unknowns several runs share.
    departures : Departures
    columns : tuple of UnknownColumn   What all runs share beside the values.
    own : tuple                 What each run has for itself, per run.
    traces : tuple              Sensors, per run; unknowns are values, columns and own columns.
    spans : tuple of float      Durations. [s]
    """

    problem: Problem
    fitted: Array
    values: list[int]
    departures: Departures
    columns: tuple[UnknownColumn, ...]
    own: tuple[tuple[UnknownColumn, ...], ...]
    traces: tuple[tuple[SensorRows, ...], ...]
    spans: tuple[float, ...]

    @classmethod
    def of(
        cls,
        problem: Problem,
        fitted: Array,
        way: Way,
        laws: Mapping[str, ElementLaw],
        points: Mapping[str, OperatingPoint],
        departures: Departures | None,
    ) -> RunsOfFit:
        """Return the runs at some values and laws; departures are laid over these runs where none are known yet."""
        networks = [with_laws(e.network, laws) for e in problem.experiments]
        courses = [course_in_fit(problem, i, n, fitted) for i, n in enumerate(networks)]
        spans = tuple(float(c.times[-1]) for c in courses)
        known = departures or departures_of(networks, courses, points, tuple(part * max(spans) for part in SHARES_OF_RUN))
        parts = [(known.shared(n, c, way, laws), known.own(n, c)) for n, c in zip(networks, courses, strict=True)]
        columns = {c.name: c for shared, _ in parts for c, _ in shared}
        alone = [alone_in(problem, i) for i in range(len(courses))]
        values = [k for k in range(len(problem.unknowns)) if not any(k in own for own in alone)]
        traces = []
        for i, (network, (shared, single)) in enumerate(zip(networks, parts, strict=True)):
            by_name = {c.name: h for c, h in shared}
            heats = [*(by_name.get(n, DepartureHeat(n, ())) for n in columns), *(h for _, h in single)]
            fitted_rows = traces_of(problem, i, network, heats, fitted)
            size = len(problem.unknowns)
            order = [*values, *range(size, size + len(columns)), *alone[i], *range(size + len(columns), size + len(heats))]
            far = np.array([prior_mean(problem.unknowns[k], fitted[k]) - fitted[k] for k in alone[i]])
            traces.append(tuple(t.averaged().about(alone[i], far).taken(order) for t in fitted_rows))
        own = tuple((*own_columns(problem, i), *(c for c, _ in run)) for i, (_, run) in enumerate(parts))
        return cls(problem, fitted, values, known, tuple(columns.values()), own, tuple(traces), spans)

    def posterior(self, centre: Array, sizes: Array, left: tuple[float, float]) -> Members:
        """Return values and columns given the readings, at sizes (members, groups) and a size and time of what no element explains."""
        values = len(self.values)
        shared = values + len(self.columns)
        size, part = SIZES["left"].value * left[0], left[1]
        rows = [run_rows(t, Wander(size, part * span), shared) for t, span in zip(self.traces, self.spans, strict=True)]
        wide = np.array([reach(self.problem.unknowns[k]) for k in self.values])
        every = np.column_stack([np.broadcast_to(wide, (len(sizes), values)), deviations(self.columns, sizes)])
        own = [deviations(c, sizes) for c in self.own]
        return members_of([self._priors(), *rows], centre, every, [np.zeros((len(sizes), 0)), *own])

    def _priors(self) -> RunRows:
        """Return the priors of the fit as rows about its values."""
        left, rows = prior_rows(self.problem.unknowns, self.problem.coupled, self.fitted)
        kept = rows[:, self.values].any(axis=1)
        joined = np.column_stack([rows[kept][:, self.values], np.zeros((int(kept.sum()), len(self.columns))), -left[kept]])
        return RunRows(joined.T @ joined, len(self.values) + len(self.columns), 0.0, 0)


def alone_in(problem: Problem, i: int) -> list[int]:
    """Return the unknowns that act in one run of a fit alone: its room, its start, an error of the mean of an input."""
    return [k for k, u in enumerate(problem.unknowns) if u.kind == "local" and {t.experiment for t in u.targets} == {i}]


def own_columns(problem: Problem, i: int) -> list[UnknownColumn]:
    """Return the same as columns about the means of their priors."""
    several = [problem.unknowns[k] for k in alone_in(problem, i)]
    return [UnknownColumn(u.name, "", u.prior.sd if u.prior is not None else reach(u), u.name) for u in several]


def prior_mean(u: Unknown, fitted: float) -> float:
    """Return the mean of the prior of an unknown; where it was fitted if it has none."""
    return u.prior.mean if u.prior is not None else float(fitted)


def course_in_fit(problem: Problem, i: int, network: Network, fitted: Array) -> ElementCourse:
    """Return the course of a run of a fit with another network."""
    bare = widened(problem, i, network, problem.experiments[i].scenario, ())
    bench = bare.bench(0, fitted)
    return course_of(bench.wiring, bench.engine, bare.inputs(0, fitted)[0], problem.options)


def traces_of(problem: Problem, i: int, network: Network, heats: Sequence[DepartureHeat], fitted: Array) -> tuple[SensorRows, ...]:
    """Return the sensors of a run, with derivatives by every unknown and heat."""
    wide = widened(problem, i, *with_heats(network, problem.experiments[i].scenario, heats), heats)
    at = np.concatenate([fitted, np.zeros(len(heats))])
    slopes = wide.slopes(0, at)
    out = []
    for k, (o, block) in enumerate(zip(wide.experiments[0].observations, wide.blocks_of(0, at), strict=True)):
        noise = np.full(block.times.size, noise_of(wide.experiments[0], o))
        out.append(SensorRows(block.times, block.residuals, noise, -slopes[o.index, k, :] * block.noise))
    return tuple(out)


def noise_of(e: Experiment, o: Observation) -> float:
    """Return the noise of a reading: as stated, else as neighbouring readings scatter; whatever weight the fit gave them. [K]"""
    seen = o.noise or noise_seen(e.record.channels[o.sensor])
    return (seen if seen > LEAST_NOISE else USUAL_NOISE) / float(np.sqrt(o.effective_share))


def fitted_way(problem: Problem, fitted: Array, way: Way, points: Mapping[str, OperatingPoint]) -> FittedWay:
    """Return the posterior where the heat is carried in one way: Newton steps in values and laws at usual sizes, then at all sizes."""
    usual = np.array([[SIZES[g].value for g in GROUPS]])
    bounds = np.array([u.fitted_bounds() for u in problem.unknowns]).reshape(fitted.size, 2)
    at, laws, departures = fitted.copy(), dict(way.laws), None
    for step in range(NEWTON_STEPS + 1):
        runs = RunsOfFit.of(problem, at, way, laws, points, departures)
        departures, values = runs.departures, runs.values
        place = {c.name: len(values) + k for k, c in enumerate(runs.columns)}
        # the prior's means, as seen from where the derivatives were taken
        centre = np.concatenate([(fitted - at)[values], np.zeros(len(runs.columns))])
        for path, law in way.laws.items():
            for what, mean in law.shape.items():
                if (name := f"{what} of {path}") in place:
                    centre[place[name]] = mean - laws[path].shape[what]
        posterior = runs.posterior(centre, usual, USUAL_LEFT)
        found = posterior.mean[0]
        bent = [*range(len(values)), *(place[n] for p, law in way.laws.items() for w in law.shape if (n := f"{w} of {p}") in place)]
        if step == NEWTON_STEPS or (np.abs(found[bent]) < ARRIVED * np.linalg.norm(posterior.root[0][bent], axis=1)).all():
            break
        at[values] += found[: len(values)]
        at = np.clip(at, bounds[:, 0], bounds[:, 1])
        for path, law in laws.items():
            steps = {what: float(found[place[n]]) for what in law.shape if (n := f"{what} of {path}") in place}
            laws = laws | {path: law.moved(steps)}
    return _averaged(runs, way, laws, centre)


def _averaged(runs: RunsOfFit, way: Way, laws: Mapping[str, ElementLaw], centre: Array) -> FittedWay:
    """Return the posterior at all sizes that count."""
    most = SETS_COST / (len(runs.values) + len(runs.columns)) ** 3
    sets = int(np.clip(most, FEWEST_SETS, SETS))
    prior, sizes = left_prior(), drawn_sizes(sets)
    few = drawn_sizes(max(sets * FIRST_SETS // SETS, 1))
    first = {left: runs.posterior(centre, few, left).log_evidence for left in prior}
    logs = {left: log + log_sum(first[left]) - float(np.log(len(few))) for left, log in prior.items()}
    likely = [left for left, share in zip(logs, weights_of(list(logs.values())), strict=True) if share > LIKELY]
    parts = [runs.posterior(centre, sizes, left) for left in likely]
    parts = [replace(p, log_evidence=p.log_evidence + prior[left] - np.log(sets)) for p, left in zip(parts, likely, strict=True)]
    members = Members(*(np.concatenate([getattr(p, name) for p in parts]) for name in ("log_evidence", "mean", "root", "square")))
    sizes_left = np.repeat([(SIZES["left"].value * size, time) for size, time in likely], sets, axis=0)
    values = {runs.problem.unknowns[k].name: float(runs.fitted[k]) for k in runs.values}
    return FittedWay(way, laws, values, runs.departures, runs.columns, members, np.tile(sizes, (len(parts), 1)), sizes_left)


def evidence_of_structure(problem: Problem, fitted: Array) -> float:
    """Return ln of the evidence of the readings where nothing departs from the structure of a fit, with what no element explains."""
    runs, nothing = RunsOfFit.of(problem, fitted, Way(""), {}, {}, Departures({}, ())), np.zeros((1, len(GROUPS)))
    centre = np.zeros(len(runs.values))
    return log_sum([runs.posterior(centre, nothing, left).log_evidence[0] + log for left, log in left_prior().items()])


def log_sum(logs: Sequence[float] | Array) -> float:
    """Return ln of the sum of numbers by their logarithms."""
    most = float(np.max(logs))
    return most + float(np.log(np.sum(np.exp(np.asarray(logs) - most))))


def left_prior() -> dict[tuple[float, float], float]:
    """Return (size, time) of what no element explains, in parts of its scale and of the run -> ln of its probability."""
    from scipy.special import ndtr

    edges = np.r_[0.0, 0.5 * (np.array(LEFT_SIZES[1:]) + LEFT_SIZES[:-1]), np.inf]
    mass = 2.0 * np.diff(ndtr(edges))
    out = {(0.0, LEFT_TIMES[0]): float(np.log(mass[0]))}
    return out | {(s, t): float(np.log(m / len(LEFT_TIMES))) for s, m in zip(LEFT_SIZES[1:], mass[1:], strict=True) for t in LEFT_TIMES}


def points_of(problem: Problem, fitted: Array) -> dict[str, OperatingPoint]:
    """Return conductor -> where it was found over the runs of a fit, with the fit's own structure."""
    courses = [course_in_fit(problem, i, e.network, fitted) for i, e in enumerate(problem.experiments)]
    every: dict[str, Any] = {}
    for e, course in zip(problem.experiments, courses, strict=True):
        every |= conductors_of(e.network, course)
    return {p: at for p, c in every.items() if (at := point_of(courses, c)) is not None}


def before(u: Unknown) -> tuple[float, float]:
    """Return mean and standard deviation of a value before any reading; fitted form."""
    if u.prior is not None:
        return u.prior.mean, u.prior.sd
    low, high = (float(x) for x in u.fitted_bounds())
    return (0.5 * (low + high) if np.isfinite(low + high) else u.to_fitted(u.start)), reach(u)
