"""Posterior of a fit under the model of error: Newton steps in values and laws, then all sizes that count."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from thermid.base.units import Array, Memo
from thermid.fit._error_model.courses import ElementCourse, OperatingPoint, course_of, point_of
from thermid.fit._error_model.elements import (
    AS_BUILT,
    DepartureHeat,
    ElementLaw,
    PathLaw,
    Way,
    conductors_of,
    paths_of,
    with_heats,
    with_laws,
)
from thermid.fit._error_model.gaussian import (
    Members,
    RunRows,
    Wander,
    even_points,
    log_sum,
    members_of,
    sampled,
    step_to_mode,
    weights_of,
)
from thermid.fit._error_model.runs import Departures, SensorRows, UnknownColumn, departures_of, run_rows, widened
from thermid.fit._error_model.sizes import (
    ARRIVED,
    FEWEST_SETS,
    FIRST_SETS,
    LEFT_SIZES,
    LEFT_TIMES,
    LIKELY,
    NEWTON_POINTS,
    NO_SAY,
    SETS,
    SETS_COST,
    SHARES_OF_RUN,
    SIZE_ROUNDS,
    SIZES,
    UNBOUNDED,
    WORTH_A_POINT,
)
from thermid.fit._problem.experiment import LEAST_NOISE, UNSAID_NOISE, Experiment, Observation
from thermid.fit._problem.residuals import Problem, Unknown, prior_rows
from thermid.simulation.runs import Network

GROUPS = tuple(name for name in SIZES if name != "left")
"""Sizes that are drawn, in order."""


@dataclass(frozen=True, eq=False)
class FittedWay:
    """The posterior where the heat is carried in one way.

    Parameters
    ----------
    way : Way
    laws : dict                 Conductor -> its law where the derivatives were taken.
    runs : RunsOfFit            At the values where the derivatives were taken.
    members : Members           Of values, less where the derivatives were taken, and of columns.
    sizes : array (members, groups)     Of each member, in the order of `GROUPS`.
    left : array (members, 2)   Size of what no element explains [K], and its time constant in parts of a run.
    """

    way: Way
    laws: Mapping[str, ElementLaw]
    runs: RunsOfFit
    members: Members
    sizes: Array
    left: Array

    def nonlinearity(self) -> float:
        """Return how far a network in which the expected departures act ends from their straight lines, over what is allowed. [-]

        Root mean square over the readings of all records. A line is what heats along the run without departures add to it; the network
        has the heats that departures move along the run with them. Both have the values and laws that are expected. Allowed are noise
        and what no element explains.
        """
        runs, weights = self.runs, weights_of(self.members.log_evidence)
        step, unexplained = weights @ self.members.mean, weights @ self.left[:, 0] ** 2
        problem, at, count = runs.problem, runs.moved(step[: len(runs.values)]), len(runs.problem.unknowns)
        sizes = {c.name: x for c, x in zip(runs.columns, step[len(runs.values) :].tolist(), strict=True)}
        laws = {p: law.moved({w: sizes.pop(f"{w} of {p}", 0.0) for w in law.shape}) for p, law in self.laws.items()}
        apart, acting = [], (np.zeros(len(sizes)), np.array([*sizes.values()]))
        for i, e in enumerate(problem.experiments):
            network, heats, traces = with_laws(e.network, laws), [DepartureHeat(n, ()) for n in sizes], list[Sequence[SensorRows]]()
            for amounts in acting:
                course = course_in_fit(problem, i, network, at, heats, amounts)
                heat_of_column = {c.name: h for c, h in runs.departures.shared(network, course, self.way, laws)}
                heats = [heat_of_column.get(n, DepartureHeat(n, ())) for n in sizes]
                traces.append([t.averaged() for t in traces_of(problem, i, network, heats, at, amounts)])
            for straight, acted in zip(*traces, strict=True):
                promised = straight.residuals - straight.rows[:, count:] @ acting[1]
                apart.append((acted.residuals - promised) / np.sqrt(straight.noise**2 + unexplained))
        return float(np.sqrt(np.mean(np.concatenate(apart) ** 2)))


def sizes_at(points: Array) -> Array:
    """Return sizes (count, groups) of departures at points of a standard normal prior: half-normal, each with its own scale."""
    from scipy.special import ndtr, ndtri

    return np.asarray(-ndtri(0.5 * ndtr(-points)) * [SIZES[g].value for g in GROUPS])


def deviations(columns: Sequence[UnknownColumn], sizes: Array) -> Array:
    """Return the prior's standard deviations (members, columns) of unknowns at sizes (members, groups); each column's own size times it."""
    places = np.array([GROUPS.index(c.group) if c.group else len(GROUPS) for c in columns], dtype=int)
    return np.asarray(np.take(np.column_stack([sizes, np.ones(len(sizes))]), places, axis=1) * np.array([c.size for c in columns]))


def reach(u: Unknown) -> float:
    """Return a standard deviation for an unknown without a prior: (high - low) / sqrt(12) of its bounds, else a wide one; fitted form."""
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
    courses : tuple             What elements do along each run.
    """

    problem: Problem
    fitted: Array
    values: list[int]
    departures: Departures
    columns: tuple[UnknownColumn, ...]
    own: tuple[tuple[UnknownColumn, ...], ...]
    traces: tuple[tuple[SensorRows, ...], ...]
    courses: tuple[ElementCourse, ...]
    memo: Memo = field(init=False, default_factory=Memo, repr=False, compare=False)

    @classmethod
    def of_problem(
        cls,
        problem: Problem,
        fitted: Array,
        way: Way,
        laws: Mapping[str, ElementLaw],
        points: Mapping[str, OperatingPoint],
        departures: Departures | None,
    ) -> RunsOfFit:
        """Return the runs at values `fitted` (unknowns,), fitted form, and laws; departures are laid over them where none are yet.

        Columns of their rows are the values of all records, the departures that records share, then those of each record: values where
        priors expect them, departures in standard deviations of their prior.

        Parameters
        ----------
        laws : dict         Path -> law of an element that replaces its own.
        points : dict       Path -> where an element was over the runs: difference and level. [K]
        """
        networks = [with_laws(e.network, laws) for e in problem.experiments]
        courses = [course_in_fit(problem, i, n, fitted) for i, n in enumerate(networks)]
        departures_used = departures or departures_in_fit(problem, networks, courses, points)
        if way.name == AS_BUILT:
            departures_used = departures_used.of_runs_alone
        parts = [(departures_used.shared(n, c, way, laws), departures_used.of_run(n, c)) for n, c in zip(networks, courses, strict=True)]
        columns = {c.name: c for shared, _ in parts for c, _ in shared}
        alone = [alone_in(problem, i) for i in range(len(courses))]
        values = [k for k in range(len(problem.unknowns)) if not any(k in places for places in alone)]
        traces = []
        for i, (network, (shared, single)) in enumerate(zip(networks, parts, strict=True)):
            by_name = {c.name: h for c, h in shared}
            heats = [*(by_name.get(n, DepartureHeat(n, ())) for n in columns), *(h for _, h in single)]
            first, last = len(problem.unknowns), len(problem.unknowns) + len(columns)
            order = [*values, *range(first, last), *alone[i], *range(last, last + len(single))]
            apart = np.array([prior_mean(problem.unknowns[k], fitted[k]) - fitted[k] for k in alone[i]])
            means = (t.averaged() for t in traces_of(problem, i, network, heats, fitted))
            traces.append(tuple(replace(t, residuals=t.residuals - t.rows[:, alone[i]] @ apart).taken(order) for t in means))
        own_columns_of_runs = tuple((*own_columns(problem, i), *(c for c, _ in run)) for i, (_, run) in enumerate(parts))
        return cls(problem, fitted, values, departures_used, tuple(columns.values()), own_columns_of_runs, tuple(traces), tuple(courses))

    def in_way(self, way: Way, laws: Mapping[str, ElementLaw]) -> RunsOfFit:
        """Return the runs at the same values and laws with the columns of another way: those that both have are not run again."""
        networks, count = [with_laws(e.network, laws) for e in self.problem.experiments], len(self.problem.unknowns)
        parts = [dict(self.departures.shared(n, c, way, laws)) for n, c in zip(networks, self.courses, strict=True)]
        columns = dict.fromkeys(c for part in parts for c in part)
        new = [c for c in columns if c not in self.columns]
        first, last = len(self.values), len(self.values) + len(self.columns)
        traces = []
        for i, (network, part, known) in enumerate(zip(networks, parts, self.traces, strict=True)):
            width = known[0].rows.shape[1]
            places = dict(zip((*self.columns, *new), (*range(first, last), *range(width, width + len(new))), strict=True))
            order = [*range(first), *(places[c] for c in columns), *range(last, width)]
            more = traces_of(self.problem, i, network, [part.get(c, DepartureHeat(c.name, ())) for c in new], self.fitted)
            pairs = zip(known, (t.averaged().rows[:, count:] for t in more), strict=True)
            traces.append(tuple(replace(t, rows=np.column_stack([t.rows, rows])).taken(order) for t, rows in pairs))
        return replace(self, columns=tuple(columns), traces=tuple(traces))

    def moved(self, step: Array) -> Array:
        """Return the unknowns of the fit (unknowns,) after a step (values,) of the values that runs share; none goes beyond its bound."""
        out = self.fitted.copy()
        low, high = np.array([self.problem.unknowns[k].fitted_bounds() for k in self.values]).reshape(step.size, 2).T
        out[self.values] = np.clip(out[self.values] + step, low, high)
        return out

    def rows(self, size: float) -> dict[tuple[float, float], list[RunRows]]:
        """Return (size, time) -> rows of the priors of the fit and then of each run, white under a wander of that size and time.

        The wander is the deviation that no element explains: `size` is in parts of the scale of `SIZES["left"]`, and the times, in parts
        of a run, are those of `left_prior`. The rows of the priors are [R, 0, -r], kept as their product with themselves.
        """
        shared = len(self.values) + len(self.columns)
        prior_residuals, rows = prior_rows(self.problem.unknowns, self.problem.coupled, self.fitted)
        acting = rows[:, self.values].any(axis=1)
        joined = np.column_stack([rows[acting][:, self.values], np.zeros((int(acting.sum()), len(self.columns))), -prior_residuals[acting]])
        priors = RunRows(joined.T @ joined, shared, 0.0, 0)
        remainders = [r for r in left_prior() if r[0] == size]
        spans = [float(c.times[-1]) for c in self.courses]
        wanders = [[Wander(SIZES["left"].value * size, part * span) for _, part in remainders] for span in spans]
        by_run = [run_rows(t, w, shared) for t, w in zip(self.traces, wanders, strict=True)]
        return {remainder: [priors, *(several[k] for several in by_run)] for k, remainder in enumerate(remainders)}

    def posterior(self, centre: Array, sizes: Array, remainder: tuple[float, float]) -> Members:
        """Return the posterior of values and columns at sizes (members, groups) of departures, and (size, time) of the wander."""
        wide = np.array([reach(self.problem.unknowns[k]) for k in self.values])
        every = np.column_stack([np.broadcast_to(wide, (len(sizes), len(self.values))), deviations(self.columns, sizes)])
        own_deviations = [np.zeros((len(sizes), 0)), *(deviations(c, sizes) for c in self.own)]  # the priors of the fit have none
        rows = self.memo.value(remainder[0], lambda: self.rows(remainder[0]))[remainder]
        return members_of(rows, centre, every, own_deviations)

    def posteriors(self, centre: Array, sizes: Array) -> dict[tuple[float, float], Members]:
        """Return (size, time) of the wander -> `posterior`, for sizes that carry weight.

        Sizes grow until the evidence falls to less than a share of `NO_SAY` of the best: a larger process costs more and explains no more.
        """
        prior, logs = left_prior(), [-np.inf]
        out: dict[tuple[float, float], Members] = {}
        for size in LEFT_SIZES:
            several = {r: self.posterior(centre, sizes, r) for r in prior if r[0] == size}
            out |= several
            logs.append(max(prior[r] + log_sum(members.log_evidence) for r, members in several.items()))
            if logs[-1] < min(logs[-2], max(logs) + float(np.log(NO_SAY))):
                break
        return out

    def likeliest(self, bent: Sequence[int], centre: Array) -> tuple[float, Array, Array]:
        """Return `step_to_mode` of the unknowns `bent`: cost at these values, step (bent,) to the mode, standard errors (bent,).

        All else is integrated out at usual sizes, and at every size and time of what no element explains.
        """
        prior, posteriors = left_prior(), self.posteriors(centre, np.array([[SIZES[g].value for g in GROUPS]]))
        logs = [prior[remainder] + float(f.log_evidence[0]) for remainder, f in posteriors.items()]
        return step_to_mode(logs, [f.mean[0][bent] for f in posteriors.values()], [f.root[0][bent] for f in posteriors.values()])


def departures_in_fit(
    problem: Problem, networks: Sequence[Network], courses: Sequence[ElementCourse], points: Mapping[str, OperatingPoint]
) -> Departures:
    """Return what may depart of a model by the runs of a fit, in these networks and along these courses."""
    longest = max(float(c.times[-1]) for c in courses)
    names = {n for u in problem.unknowns for n in (u.name, *u.also)}
    return departures_of(networks, courses, points, tuple(part * longest for part in SHARES_OF_RUN), names)


def alone_in(problem: Problem, i: int) -> list[int]:
    """Return the unknowns that act in one run of a fit alone: its room, its start, an error of the mean of an input."""
    return [k for k, u in enumerate(problem.unknowns) if u.kind == "local" and {t.experiment for t in u.targets} == {i}]


def own_columns(problem: Problem, i: int) -> list[UnknownColumn]:
    """Return the unknowns of `alone_in` as columns about the means of their priors."""
    several = [problem.unknowns[k] for k in alone_in(problem, i)]
    return [UnknownColumn(u.name, "", u.prior.sd if u.prior is not None else reach(u), u.name) for u in several]


def prior_mean(u: Unknown, fitted: float) -> float:
    """Return the mean of the prior of an unknown; where it was fitted if it has none."""
    return u.prior.mean if u.prior is not None else float(fitted)


def course_in_fit(
    problem: Problem, i: int, network: Network, fitted: Array, heats: Sequence[DepartureHeat] = (), amounts: Sequence[float] | Array = ()
) -> ElementCourse:
    """Return the course of a run of a fit with another network, in which heats act by their amounts."""
    wide, at = widened(problem, i, *with_heats(network, problem.experiments[i].scenario, heats), heats), np.append(fitted, amounts)
    bench = wide.bench(0, at)
    return course_of(bench.wiring, bench.engine, wide.inputs(0, at)[0], problem.options)


def traces_of(
    problem: Problem, i: int, network: Network, heats: Sequence[DepartureHeat], fitted: Array, amounts: Array | None = None
) -> tuple[SensorRows, ...]:
    """Return the sensors of a run, with derivatives by every unknown and heat; `amounts` of the heats act in it, none of them without."""
    wide = widened(problem, i, *with_heats(network, problem.experiments[i].scenario, heats), heats)
    at = np.append(fitted, np.zeros(len(heats)) if amounts is None else amounts)
    blocks, slopes = wide.blocks_and_slopes(0, at)
    out = []
    for k, (o, block) in enumerate(zip(wide.experiments[0].observations, blocks, strict=True)):
        noise = np.full(block.times.size, noise_of(wide.experiments[0], o))
        out.append(SensorRows(block.times, block.residuals, noise, -slopes[o.index, k, :] * block.noise))
    return tuple(out)


def noise_of(e: Experiment, o: Observation) -> float:
    """Return the noise of a reading: as stated, else or where they refute that as neighbouring readings scatter; at any weight. [K]"""
    noise = o.noise_shown(e.record.channels[o.sensor])
    return (noise if noise > LEAST_NOISE else UNSAID_NOISE) / float(np.sqrt(o.effective_share))


def fitted_way(problem: Problem, fitted: Array, way: Way, points: Mapping[str, OperatingPoint], near: FittedWay | None = None) -> FittedWay:
    """Return the posterior where the heat is carried in one way: about the likeliest values and laws at usual sizes, then at all sizes.

    What no element explains has every size and time while they are looked for: fixed, a small one would bend values until they follow what
    they do not explain, and a large one would leave them where they began. The search begins at the values of the fit, `fitted`
    (unknowns,), fitted form, or where that of another way ended, `near`: with the same laws it has most of the rows there already. A
    Gauss-Newton step that gains nothing is tried anew, a quarter as long; the share doubles after one that gains. It ends below
    `WORTH_A_POINT` of gain, or steps below `ARRIVED` of their spread.
    """
    at, laws, departures = fitted, dict(way.laws), None
    if near is not None and near.way.laws == way.laws:
        at, laws, departures = near.runs.fitted, dict(near.laws), near.runs.departures
    elif near is not None:
        networks = [with_laws(e.network, laws) for e in problem.experiments]
        departures = departures_in_fit(problem, networks, [course_in_fit(problem, i, n, fitted) for i, n in enumerate(networks)], points)
        at = near.runs.fitted
    share, costs = 1.0, list[float]()
    for k in range(NEWTON_POINTS):
        if k == 0 and near is not None and departures is near.runs.departures:
            runs = near.runs.in_way(way, laws)
        else:
            runs = RunsOfFit.of_problem(problem, at, way, laws, points, departures)
        departures, values = runs.departures, runs.values
        place = {c.name: len(values) + k for k, c in enumerate(runs.columns)}
        shapes = {(p, w): place[n] for p, law in way.laws.items() for w in law.shape if (n := f"{w} of {p}") in place}
        # the prior's means, as seen from where the derivatives were taken
        centre = np.concatenate([(fitted - at)[values], [c.mean for c in runs.columns]])
        for (path, what), k in shapes.items():
            centre[k] = way.laws[path].shape[what] - laws[path].shape[what]
        cost, step, spread = runs.likeliest([*range(len(values)), *shapes.values()], centre)
        step[: len(values)] = (runs.moved(step[: len(values)]) - at)[values]
        gain = min(costs, default=np.inf) - cost
        costs.append(cost)
        if gain > 0.0:
            best, share = (runs, laws, centre, step), min(2.0 * share, 1.0)
            if gain < WORTH_A_POINT or (np.abs(step) < ARRIVED * spread).all():
                break
        else:
            share *= 0.25
            if min(costs[:-2], default=np.inf) - min(costs) < WORTH_A_POINT:
                break
        runs, laws, _, step = best
        at = runs.moved(share * step[: len(values)])
        moved = dict(zip(shapes, share * step[len(values) :], strict=True))
        laws = {p: law.moved({w: float(x) for (q, w), x in moved.items() if q == p}) for p, law in laws.items()}
    runs, laws, centre, _ = best
    return _averaged(runs, way, laws, centre)


def _averaged(runs: RunsOfFit, way: Way, laws: Mapping[str, ElementLaw], centre: Array) -> FittedWay:
    """Return the posterior of a way averaged over the sizes of its departures that count, as members with their log evidence.

    Quasi-random points of the prior of the sizes, fewer where the unknowns are many (cost n^3), then moved to where the evidence is large;
    remainders of readings below `LIKELY` in a first look are left out.

    Parameters
    ----------
    laws : dict                 Path -> law of an element at its operating point.
    centre : array (columns,)   Where the runs are linearised, in standard deviations of the prior.
    """
    most = SETS_COST / (len(runs.values) + len(runs.columns)) ** 3
    sets = int(np.clip(most, FEWEST_SETS, SETS))
    prior, few = left_prior(), sizes_at(even_points(max(sets * FIRST_SETS // SETS, 1), len(GROUPS)))
    first = {r: prior[r] + log_sum(several.log_evidence) for r, several in runs.posteriors(centre, few).items()}
    likely = [remainder for remainder, share in zip(first, weights_of(list(first.values())), strict=True) if share > LIKELY]
    members, logs_of, sizes = list[Members](), [], []
    for remainder in likely:

        def evidence(points: Array, remainder: tuple[float, float] = remainder) -> Array:
            """Return the log evidence at points (points, sizes) of the hyperparameters."""
            members.append(runs.posterior(centre, sizes_at(points), remainder))
            return members[-1].log_evidence

        points, logs = sampled(evidence, sets, len(GROUPS), max(min(SIZE_ROUNDS, sets // (2 * len(GROUPS))), 1))
        logs_of.append(logs + prior[remainder] - float(np.log(sets)))
        sizes.append(sizes_at(points))
    sizes_left = np.repeat([(SIZES["left"].value * size, time) for size, time in likely], sets, axis=0)
    joined = replace(Members.joined(members), log_evidence=np.concatenate(logs_of))
    return FittedWay(way, laws, runs, joined, np.concatenate(sizes), sizes_left)


def left_prior() -> dict[tuple[float, float], float]:
    """Return (size, time) of what no element explains, in parts of its scale and of the run -> ln of its probability. [-]

    Sizes `LEFT_SIZES` have the mass of half a normal law between their middles; the times `LEFT_TIMES` are equally likely.
    """
    from scipy.special import ndtr

    edges = np.r_[0.0, 0.5 * (np.array(LEFT_SIZES[1:]) + LEFT_SIZES[:-1]), np.inf]
    mass = 2.0 * np.diff(ndtr(edges))
    others = [(s, t, m / len(LEFT_TIMES)) for s, m in zip(LEFT_SIZES[1:], mass[1:], strict=True) for t in LEFT_TIMES]
    return {(s, t): float(np.log(m)) for s, t, m in [(0.0, LEFT_TIMES[0], mass[0]), *others]}


def points_of(problem: Problem, courses: Sequence[ElementCourse]) -> tuple[dict[str, OperatingPoint], dict[str, tuple[PathLaw, float]]]:
    """Return conductor -> where it was found over the runs of a fit, by its courses, and what `paths_of` says of them."""
    several = zip(problem.experiments, courses, strict=True)
    every = {p: c for e, course in several for p, c in conductors_of(e.network, course).items()}
    points = {p: at for p, c in every.items() if (at := point_of(courses, c)) is not None}
    return points, paths_of(problem.experiments[0].network, courses)


def before(u: Unknown) -> tuple[float, float]:
    """Return prior mean and standard deviation of an unknown; without a prior, of a uniform one over its bounds; fitted form."""
    if u.prior is not None:
        return u.prior.mean, u.prior.sd
    low, high = (float(x) for x in u.fitted_bounds())
    return (0.5 * (low + high) if np.isfinite(low + high) else u.to_fitted(u.start)), reach(u)
