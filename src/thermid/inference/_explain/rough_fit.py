"""Fits of thinned readings with weak priors about the deck: rough and quick, they end also where a fit to a wrong log runs away."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from thermid.base.errors import SolverError
from thermid.base.units import Array, unit
from thermid.fit.calibration import Observation, Prior, Problem, Request, Unknown, build_problem, descend
from thermid.model.tree import Model

STRETCHES_PER_RECORD, INSTANTS_PER_STRETCH = 40, 32
"""Stretches into which every record is thinned, and most readings in each at which the model is looked at."""
HONEST_MISFIT_SHARE = 0.015
"""Standard deviation of what an honest model leaves, wandering over a fifth of a log, as a share of what the sensor ranged over. [-]"""
MAX_FIRST_STEP, STEP_AHEAD = 1.5, 0.02
"""Root mean square of a first step at most, in typical changes (a factor of 4.5 of a logarithm), and the step ahead that ends a descent, in
standard errors."""
MAX_DESCENT_STEPS, MAX_RANKING_STEPS = 25, 4
"""Most steps of a descent, and of one that only ranks."""
HEAT_DIMENSIONS = tuple(unit(u).dimension for u in ("kg", "J/K", "J/(kg K)"))


def weak_spread(model: Model, path: str, unit_text: str) -> float:
    """Return the standard deviation of the logarithm of a deck's value, by its source and its quantity. [-]

    Values of data sheets and measurements are good to a third, heat capacities to a half, coefficients to a factor of two.
    """
    table = model.parameter_table()
    source = table[path].parameter.source if path in table else ""
    if source and source != "assumed":
        return 0.35
    return 0.5 if unit(unit_text).dimension in HEAT_DIMENSIONS else 0.8


@dataclass(frozen=True, eq=False)
class ThinTrace:
    """Thinned readings of one sensor in one record.

    Parameters
    ----------
    experiment, place : int     Of the record among the experiments, of the sensor among its observations.
    record, sensor, node : str
    centres : array (bins,)     [s]
    measured : array (bins,)    Means of the readings. [K]
    whiten : array (bins, bins) What it multiplies has independent errors of size one. [1/K]
    """

    experiment: int
    place: int
    record: str
    sensor: str
    node: str
    centres: Array
    measured: Array
    whiten: Array


@dataclass(frozen=True, eq=False)
class Extra:
    """Something that acts on the readings of one trace, beside the model: it adds ``amount * shape(predicted, air)`` after an instant.

    Parameters
    ----------
    trace : int         Its place among the traces.
    since : int         The first stretch in which it acts.
    loose : bool        Whether the reading leans to its surroundings by that share; else a constant is added. [-] or [K]
    """

    trace: int
    since: int
    loose: bool

    def acting(self, centres: Array) -> Array:
        """Return how much of it acts in every stretch, 0 or 1; `centres` are their middles. [s]"""
        return (np.arange(centres.size) >= self.since).astype(float)


@dataclass(frozen=True, eq=False)
class RoughEnd:
    """The end of a rough fit.

    Parameters
    ----------
    x : array (unknowns,)       In the fitted form; the amount of an `Extra` last.
    square : float              Sum of squares of the thinned readings in units of their errors. [-]
    prior : float               Sum of squares of all priors. [-]
    left : tuple of arrays      Measured less predicted of every trace. [K]
    slopes : array (rows, unknowns)     Of all weighted residuals, priors below the readings.
    rows : array (rows,)        The weighted residuals themselves.
    """

    x: Array
    square: float
    prior: float
    left: tuple[Array, ...]
    slopes: Array
    rows: Array

    @property
    def cost(self) -> float:
        """Half of all squares: the logarithm of the posterior's height, with the other sign. [-]"""
        return 0.5 * (self.square + self.prior)

    @property
    def rms(self) -> float:
        """Root mean square of what is left. [K]"""
        return float(np.sqrt(np.mean(np.concatenate(self.left) ** 2)))


@dataclass(frozen=True, eq=False)
class RoughFit:
    """A request over thinned readings.

    Parameters
    ----------
    request : Request
    problem : Problem           With what it looks for; weak priors included.
    traces : tuple of ThinTrace
    meshes : tuple of (times, bins)     Per experiment: instants at which it is simulated [s], and the stretch of each.
    airs : tuple of arrays      Per experiment: temperature of its surroundings in every stretch. [K]
    extra : Extra or None
    """

    request: Request
    problem: Problem
    traces: tuple[ThinTrace, ...]
    meshes: tuple[tuple[Array, NDArray[np.int64]], ...]
    airs: tuple[Array, ...]
    extra: Extra | None = None

    @classmethod
    def of_request(
        cls,
        request: Request,
        like: RoughFit | None = None,
        amounts: Sequence[tuple[Unknown, float]] = (),
        read: Mapping[str, tuple[str, float]] | None = None,
    ) -> RoughFit:
        """Return the rough fit of a request, by readings thinned to at most `STRETCHES_PER_RECORD` means per record.

        Parameters
        ----------
        request : Request
        like : RoughFit     Another one whose errors of the readings are taken, so that both can be compared.
        amounts : sequence  Further unknowns, with the standard deviation of each about zero.
        read : dict         Sensor whose readings are others than in `like` -> the sensor whose they are there, and by what factor they
                            are scaled. The errors go with the readings: a factor alone makes nothing likelier.
        """
        full_problem = build_problem(request)
        unknowns = tuple(_with_weak_prior(request.model, u) for u in full_problem.unknowns)
        problem = replace(full_problem, unknowns=(*unknowns, *(replace(u, prior=Prior(0.0, sd)) for u, sd in amounts)))
        errors = {(t.record, t.sensor): t for t in like.traces} if like is not None else {}
        traces, meshes, airs = [], [], []
        for i, e in enumerate(problem.experiments):
            centres, edges = _stretches(e.times)
            # where it was read, for a heater that pulses is seen otherwise elsewhere
            of_stretch = np.split(e.times, np.searchsorted(e.times, edges[1:-1]))
            read_at = [t[np.linspace(0, t.size - 1, min(t.size, INSTANTS_PER_STRETCH)).round().astype(int)] for t in of_stretch]
            meshes.append((np.concatenate(read_at), np.repeat(np.arange(len(read_at)), [t.size for t in read_at])))
            air = next(iter(e.scenario.boundaries.values()))
            airs.append(np.broadcast_to(np.asarray(air.at(centres), dtype=float), centres.shape))
            for k, o in enumerate(e.observations):
                measured, counts = _means(e.times[o.index], o.measured, edges)
                name = (e.record.name, o.sensor)
                source, factor = (read or {}).get(o.sensor, (o.sensor, 1.0))
                error_of_trace = errors.get((e.record.name, source))
                whiten = error_of_trace.whiten / factor if error_of_trace is not None else _whitener(o, centres, counts, edges)
                if whiten.shape[0] != centres.size:
                    whiten = _whitener(o, centres, counts, edges)
                traces.append(ThinTrace(i, k, *name, o.seat, centres, measured, whiten))
        return cls(request, problem, tuple(traces), tuple(meshes), tuple(airs))

    @property
    def size(self) -> int:
        """Number of thinned readings of all traces."""
        return sum(t.measured.size for t in self.traces)

    def at(self, x: Array) -> RoughEnd:
        """Return residuals W r and slopes -W dT/dx at `x` (unknowns,), fitted form, priors below; the amount of the extra is last. [-]

        W whitens the means of each trace in stretches, r is measured less simulated [K].

        Raises
        ------
        SolverError   When a record cannot be run.
        """
        count = len(self.problem.unknowns)
        simulated = [self._simulated_readings(i, x[:count]) for i in range(len(self.problem.experiments))]
        residuals_of_trace, rows, slopes = [], [], []
        for n, t in enumerate(self.traces):
            predicted, slope = simulated[t.experiment][0][:, t.place], simulated[t.experiment][1][:, t.place, :]
            if self.extra is not None:
                predicted, slope = self._add_extra(n, predicted, slope, float(x[-1]))
            residuals_of_trace.append(t.measured - predicted)
            rows.append(t.whiten @ residuals_of_trace[-1])
            slopes.append(-(t.whiten @ slope))
        values, prior = self.problem.prior_rows(x[:count])
        if self.extra is not None:
            prior = np.column_stack([prior, np.zeros(values.size)])
        residuals = np.concatenate(rows)
        if not np.isfinite(residuals).all() or not np.isfinite(np.concatenate(slopes)).all():
            raise SolverError("the run gives numbers that are not finite.", "rough fit", code="run.did-not-finish")
        square, spent = float(residuals @ residuals), float(values @ values)
        return RoughEnd(x, square, spent, tuple(residuals_of_trace), np.concatenate([*slopes, prior]), np.concatenate([residuals, values]))

    def _simulated_readings(self, i: int, x: Array) -> tuple[Array, Array]:
        """Return what the sensors of an experiment would show in every stretch (bins, sensors) [K], and its slopes to the unknowns."""
        bench, (mesh, bins) = self.problem.bench(i, x), self.meshes[i]
        values, chain = self.problem.inputs(i, x)
        columns, derivatives = bench.temperatures(values, bool(values.size), self.problem.options, mesh)
        slopes = derivatives @ chain if values.size else np.zeros((*columns.shape, len(self.problem.unknowns)))
        count = np.bincount(bins)
        columns = np.array([np.bincount(bins, c) / count for c in columns.T]).T
        first = np.concatenate([[0], np.cumsum(count)[:-1]])
        slopes = np.add.reduceat(slopes, first, axis=0) / count[:, None, None]
        place = {u.name: k for k, u in enumerate(self.problem.unknowns) if u.kind == "sensor"}
        for k, o in enumerate(bench.experiment.observations):
            at = place.get(f"sensor {o.sensor}")
            columns[:, k] += self.problem.fixed_bias.get(o.sensor, 0.0) if at is None else x[at]
            if at is not None:
                slopes[:, k, at] += 1.0
        return columns, slopes

    def _add_extra(self, n: int, predicted: Array, slope: Array, amount: float) -> tuple[Array, Array]:
        """Return readings (bins,) [K] and slopes (bins, unknowns + 1) of the n-th trace, with `amount` of the extra where it acts.

        The extra adds amount a(t), or amount a(t) (T_air - T) where it is loose, a(t) from `Extra.acting`; then slopes to other unknowns
        are multiplied by 1 - amount a(t). The last column is the derivative to `amount`, zero on every other trace.
        """
        assert self.extra is not None
        if n != self.extra.trace:
            return predicted, np.column_stack([slope, np.zeros(predicted.size)])
        acts = self.extra.acting(self.traces[n].centres)
        shape = (self.airs[self.traces[n].experiment] - predicted if self.extra.loose else np.ones(predicted.size)) * acts
        scale = 1.0 - amount * acts if self.extra.loose else np.ones(predicted.size)
        return predicted + amount * shape, np.column_stack([slope * scale[:, None], shape])

    def start(self, values_before: Mapping[str, float] | None = None) -> Array:
        """Return where a descent begins (unknowns,), in the fitted form: at `values_before` where these have the name, else at the deck."""
        begun = [(values_before or {}).get(u.name, u.to_fitted(u.start)) for u in self.problem.unknowns]
        return np.array([*begun, *([0.0] if self.extra is not None else [])])

    def best(self, *starts: Mapping[str, float] | None, rounds: int = MAX_DESCENT_STEPS) -> RoughEnd:
        """Return the best end of descents from several starts: the deck's, or those of another end by name.

        Raises
        ------
        SolverError   When no start can be run.
        """
        ends, refused = [], None
        for one in starts:
            try:
                ends.append(self.solve(self.start(one), rounds))
            except SolverError as error:
                refused = error
        if not ends:
            raise refused or SolverError("the start is missing.", "rough fit", code="run.input-missing")
        return min(ends, key=lambda e: e.cost)

    def named(self, end: RoughEnd) -> dict[str, float]:
        """Return name of an unknown -> its fitted form at the end of a descent."""
        return {u.name: float(v) for u, v in zip(self.problem.unknowns, end.x, strict=False)}

    def best_since(self, end: RoughEnd, trace: int, loose: bool, sd: float) -> int:
        """Return the stretch from which an `Extra` on a trace would take most squares away, by one step from an end without it.

        A column c, cleared of what the slopes span, takes (c'r)^2 / (c'c + 1 / s^2). `sd` s is the standard deviation of its amount about
        zero, [-] of a `loose` sensor (air less predicted), else [K].
        """
        sizes = [t.measured.size for t in self.traces]
        first, size = sum(sizes[:trace]), sizes[trace]
        basis = np.linalg.qr(end.slopes)[0]
        residuals = end.rows - basis @ (basis.T @ end.rows)
        t = self.traces[trace]
        predicted = t.measured - end.left[trace]
        shape = self.airs[t.experiment] - predicted if loose else np.ones(size)
        columns = np.zeros((end.rows.size, size - 2))
        columns[first : first + size] = t.whiten @ (shape[:, None] * (np.arange(size)[:, None] >= np.arange(size - 2)[None, :]))
        columns -= basis @ (basis.T @ columns)
        # a further column c, cleared of what the slopes span, takes (c'r)^2 / (c'c + 1 / sd^2) off the squares
        return int(np.argmax((columns.T @ residuals) ** 2 / (np.sum(columns**2, axis=0) + 1.0 / sd**2)))

    def solve(self, start: Array, rounds: int = MAX_DESCENT_STEPS) -> RoughEnd:
        """Return the end of a descent of at most some steps.

        Raises
        ------
        SolverError   When the start cannot be run.
        """
        unknowns = self.problem.unknowns
        bounds, scale = [u.fitted_bounds() for u in unknowns], [u.scale for u in unknowns]
        if self.extra is not None:
            bounds, scale = [*bounds, (0.0, 1.1) if self.extra.loose else (-np.inf, np.inf)], [*scale, 1.0]
        low, high = np.array(bounds).reshape(-1, 2).T
        ends: dict[bytes, RoughEnd] = {}

        def local(x: Array) -> tuple[float, Array, Array]:
            """Return cost, residuals and slopes at a point, kept for later."""
            end = ends[x.tobytes()] = self.at(x)
            return end.cost, end.rows, end.slopes

        reach = MAX_FIRST_STEP * math.sqrt(len(scale))
        descent = descend(local, start, (low, high), np.array(scale), done=STEP_AHEAD, relative=1e-4, rounds=rounds + 1, reach=reach)
        return ends[descent.x.tobytes()]


def _with_weak_prior(model: Model, u: Unknown) -> Unknown:
    """Return an unknown with a weak prior about its deck's value, where it has no prior."""
    if u.kind != "parameter" or u.prior is not None:
        return u
    sd = weak_spread(model, u.name, u.unit) if u.log else max(abs(u.start), u.scale)
    return replace(u, prior=Prior(u.to_fitted(u.start), sd))


def _stretches(times: Array) -> tuple[Array, Array]:
    """Return the middle of every stretch of a record (stretches,), and the edges between them (stretches + 1,); each holds readings. [s]

    At most `STRETCHES_PER_RECORD`, of equal counts where samples are evenly spaced in `times` (samples,), else of equal length.
    """
    if times.size <= STRETCHES_PER_RECORD:
        parts = list(times[:, None])
    elif np.ptp(np.diff(times)) < 0.5 * float(np.median(np.diff(times))):
        parts = np.array_split(times, STRETCHES_PER_RECORD)
    else:
        place = np.searchsorted(np.linspace(times[0], times[-1], STRETCHES_PER_RECORD + 1)[1:-1], times, side="right")
        parts = [times[place == k] for k in np.unique(place)]
    between = [0.5 * (before[-1] + right[0]) for before, right in pairwise(parts)]
    return np.array([p.mean() for p in parts]), np.array([times[0], *between, times[-1]])


def _means(times: Array, values: Array, edges: Array) -> tuple[Array, NDArray[np.int64]]:
    """Return the mean reading [K] of every stretch (stretches,) and how many there are; between neighbours where there is none.

    `times` and `values` (readings,) [s, K]; `edges` (stretches + 1,) [s].
    """
    count = edges.size - 1
    place = np.clip(np.searchsorted(edges, times, side="right") - 1, 0, count - 1)
    counts = np.bincount(place, minlength=count)
    sums = np.bincount(place, values, minlength=count)
    filled = np.flatnonzero(counts)
    means = np.interp(np.arange(count), filled, sums[filled] / counts[filled])
    return means, counts


def _whitener(o: Observation, centres: Array, counts: NDArray[np.int64], edges: Array) -> Array:
    """Return W (bins, bins) with ``W' W = C^-1``, C the covariance of the means of a sensor's readings in stretches. [1/K]

    ``C_ij = f^2 exp(-|t_i - t_j| / (span / 5)) + (noise^2 / n_i + (0.3 f)^2) [i = j]``, f the misfit of an honest model, n_i the number of
    readings in a stretch; one without readings has ten times the range of the sensor as noise.
    """
    values = o.measured
    steps = np.diff(values)
    noise = o.noise or max(1.4826 * float(np.median(np.abs(steps - np.median(steps)))) / math.sqrt(2.0), 0.02) if steps.size else 0.1
    spread = float(np.quantile(values, 0.98) - np.quantile(values, 0.02)) if values.size else 1.0
    floor = max(HONEST_MISFIT_SHARE * spread, noise)
    span = max(float(edges[-1] - edges[0]), 1e-9)
    wander = floor**2 * np.exp(-np.abs(centres[:, None] - centres[None, :]) / (0.2 * span))
    own_noise = np.where(counts > 0, noise / np.sqrt(np.maximum(counts, 1)), 10.0 * max(spread, 1.0))
    # steps of powers inside a stretch: the mean of a stretch is known to a fraction of what changes in it
    return np.asarray(np.linalg.inv(np.linalg.cholesky(np.diag(own_noise**2 + (0.3 * floor) ** 2) + wander)))
