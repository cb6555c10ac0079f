"""Posterior of a fit under the model of error: Newton steps in values and laws, then all sizes that count."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from thermid.base.linear_algebra import Array
from thermid.fit.discrepancy import OperatingPoint
from thermid.fit.problem import Problem, Unknown, prior_rows
from thermid.inference._error_model.elements import (
    DepartureHeat,
    ElementCourse,
    ElementLaw,
    Way,
    conductors_of,
    course_of,
    point_of,
    with_heats,
    with_laws,
)
from thermid.inference._error_model.gaussian import Members, RunRows, Wander, members_of, weights_of
from thermid.inference._error_model.runs import Departures, SensorRows, UnknownColumn, departures_of, white_rows, widened
from thermid.inference._error_model.sizes import (
    FIRST_SETS,
    LEFT_SIZES,
    LEFT_TIMES,
    LIKELY,
    NEWTON_STEPS,
    SETS,
    SHARES_OF_RUN,
    SIZES,
    UNBOUNDED,
    USUAL_LEFT,
)
from thermid.simulation.network import Network

GROUPS = tuple(name for name in SIZES if name != "left")
"""Sizes that are drawn, in order."""


@dataclass(frozen=True, eq=False)
class FittedWay:
    """The posterior where the heat is carried in one way.

    Parameters
    ----------
    way : Way
    laws : dict                 Conductor -> its law where the derivatives were taken.
    fitted : array (values,)    Values of the fit there, in the fitted form.
    departures : Departures
    columns : tuple of UnknownColumn   Unknowns beside the values.
    members : Members           Of values, less `fitted`, and of columns.
    sizes : array (members, groups)     Of each member, in the order of `GROUPS`.
    left : array (members,)     Size of what no element explains. [K]
    """

    way: Way
    laws: Mapping[str, ElementLaw]
    fitted: Array
    departures: Departures
    columns: tuple[UnknownColumn, ...]
    members: Members
    sizes: Array
    left: Array


def drawn_sizes(count: int) -> Array:
    """Return sizes (count, groups) of departures, evenly over their half-normal priors: points of Sobol's sequence (a power of two)."""
    from scipy.special import ndtri
    from scipy.stats import qmc

    points = qmc.Sobol(len(GROUPS), scramble=True, seed=0).random(count)
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
    fitted : array (values,)    Where.
    departures : Departures
    columns : tuple of UnknownColumn   What all runs share beside the values.
    own : tuple                 What each run has for itself, per run.
    traces : tuple              Sensors, per run; unknowns are values, columns and own columns.
    spans : tuple of float      Durations. [s]
    """

    problem: Problem
    fitted: Array
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
        known = departures or departures_of(networks[0], courses, points, tuple(part * max(spans) for part in SHARES_OF_RUN))
        parts = [(known.shared(n, c, way, laws), known.own(n, c)) for n, c in zip(networks, courses, strict=True)]
        columns = {c.name: c for shared, _ in parts for c, _ in shared}
        own = tuple(tuple(c for c, _ in alone) for _, alone in parts)
        traces = []
        for i, (network, (shared, alone)) in enumerate(zip(networks, parts, strict=True)):
            by_name = {c.name: h for c, h in shared}
            heats = [*(by_name.get(n, DepartureHeat(n, ())) for n in columns), *(h for _, h in alone)]
            traces.append(_traces(problem, i, network, heats, fitted))
        return cls(problem, fitted, known, tuple(columns.values()), own, tuple(traces), spans)

    def posterior(self, centre: Array, sizes: Array, left: tuple[float, float]) -> Members:
        """Return values and columns given the readings, at sizes (members, groups) and a size and time of what no element explains."""
        values = self.fitted.size
        shared = values + len(self.columns)
        size, part = SIZES["left"].value * left[0], left[1]
        rows = [RunRows.of(white_rows(t, Wander(size, part * span)), shared) for t, span in zip(self.traces, self.spans, strict=True)]
        wide = np.array([reach(u) for u in self.problem.unknowns])
        every = np.column_stack([np.broadcast_to(wide, (len(sizes), values)), deviations(self.columns, sizes)])
        own = [deviations(c, sizes) for c in self.own]
        return members_of([self._priors(), *rows], centre, every, [np.zeros((len(sizes), 0)), *own])

    def _priors(self) -> RunRows:
        """Return the priors of the fit as rows about its values."""
        left, rows = prior_rows(self.problem.unknowns, self.problem.coupled, self.fitted)
        joined = np.column_stack([rows, np.zeros((len(left), len(self.columns))), -left])
        return RunRows(joined.T @ joined, rows.shape[1] + len(self.columns), 0.0, 0)


def course_in_fit(problem: Problem, i: int, network: Network, fitted: Array) -> ElementCourse:
    """Return the course of a run of a fit with another network."""
    bare = widened(problem, i, network, problem.experiments[i].scenario, ())
    bench = bare.benches()[0]
    return course_of(bench.wiring, bench.engine, bare.inputs(0, fitted)[0], problem.options)


def _traces(problem: Problem, i: int, network: Network, heats: Sequence[DepartureHeat], fitted: Array) -> tuple[SensorRows, ...]:
    """Return the sensors of a run, with derivatives by every value and heat."""
    wide = widened(problem, i, *with_heats(network, problem.experiments[i].scenario, heats), heats)
    at = np.concatenate([fitted, np.zeros(len(heats))])
    slopes = wide.slopes(0, at)
    out = []
    for k, (o, block) in enumerate(zip(wide.experiments[0].observations, wide.blocks_of(0, at), strict=True)):
        noise = np.full(block.times.size, block.noise)
        out.append(SensorRows(block.times, block.residuals, noise, -slopes[o.index, k, :] * block.noise).averaged())
    return tuple(out)


def fitted_way(problem: Problem, fitted: Array, way: Way, points: Mapping[str, OperatingPoint]) -> FittedWay:
    """Return the posterior where the heat is carried in one way: Newton steps in values and laws at usual sizes, then at all sizes."""
    values, usual = fitted.size, np.array([[SIZES[g].value for g in GROUPS]])
    bounds = np.array([u.fitted_bounds() for u in problem.unknowns]).reshape(values, 2)
    at, laws, departures = fitted.copy(), dict(way.laws), None
    for step in range(NEWTON_STEPS + 1):
        runs = RunsOfFit.of(problem, at, way, laws, points, departures)
        departures = runs.departures
        place = {c.name: values + k for k, c in enumerate(runs.columns)}
        # the prior's means, as seen from where the derivatives were taken
        centre = np.concatenate([fitted - at, np.zeros(len(runs.columns))])
        for path, law in way.laws.items():
            for what, mean in law.shape.items():
                if (name := f"{what} of {path}") in place:
                    centre[place[name]] = mean - laws[path].shape[what]
        if step == NEWTON_STEPS:
            break
        found = runs.posterior(centre, usual, USUAL_LEFT).mean[0]
        at = np.clip(at + found[:values], bounds[:, 0], bounds[:, 1])
        for path, law in laws.items():
            steps = {what: float(found[place[n]]) for what in law.shape if (n := f"{what} of {path}") in place}
            laws = laws | {path: law.moved(steps)}
    return _averaged(runs, way, laws, centre)


def _averaged(runs: RunsOfFit, way: Way, laws: Mapping[str, ElementLaw], centre: Array) -> FittedWay:
    """Return the posterior at all sizes that count."""
    prior, sizes = left_prior(), drawn_sizes(SETS)
    first = {left: runs.posterior(centre, drawn_sizes(FIRST_SETS), left).log_evidence for left in prior}
    logs = {left: log + first[left].max() + float(np.log(np.mean(np.exp(first[left] - first[left].max())))) for left, log in prior.items()}
    likely = [left for left, share in zip(logs, weights_of(list(logs.values())), strict=True) if share > LIKELY]
    parts = [runs.posterior(centre, sizes, left) for left in likely]
    parts = [replace(p, log_evidence=p.log_evidence + prior[left]) for p, left in zip(parts, likely, strict=True)]
    members = Members(*(np.concatenate([getattr(p, name) for p in parts]) for name in ("log_evidence", "mean", "root", "square")))
    sizes_left = np.repeat([SIZES["left"].value * size for size, _ in likely], SETS)
    return FittedWay(way, laws, runs.fitted, runs.departures, runs.columns, members, np.tile(sizes, (len(parts), 1)), sizes_left)


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
