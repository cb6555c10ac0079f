"""Autocorrelated residuals and noisy inputs: how many independent samples a trace is worth, and what its readings then say.

White noise plus an exponentially autocorrelated deviation, by restricted likelihood: one estimate for the errors of a fit
(`autocorrelation`), and all that the residuals allow for tests of values known before (`weighed`).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from thermid.base.linear_algebra import square_root
from thermid.base.units import Array, Indices
from thermid.fit._minimisation import Fit, covariances, finite
from thermid.fit._problem.experiment import SCALE, Experiment, InputNoise, Observation
from thermid.fit._problem.residuals import Bench, Problem, SensorTrace, loss_of
from thermid.measure.records import blur_of, shared_rounding, unrounded
from thermid.model.tree import Constant, FlatLoad, Signal, TableSignal

MAX_STRETCHES = 80
"""A trace of more than twice as many samples is looked at in so many equal stretches of time; what ties neighbours within one together
shows as a larger scatter of their means."""

TIMES_PER_STRETCH = 6
"""Times within a stretch at which the answer to a signal is taken, at most: a mean is not the value in the middle."""

MIN_SHARED_ROUNDING = 0.02
"""Part of the variance of a reading from which rounding errors that neighbours share count."""


@dataclass(frozen=True, eq=False)
class Binned:
    """A trace in stretches of time: means of the residuals, samples and derivatives in each, the variance inside them and its freedom.

    `effective_share` is what a sample is worth by what is said of its noise. Rounding errors that samples share have the covariance
    ``rounding rounding'`` of their sums over stretches (stretches, terms), `rounded` of it the variance of each sample by itself; both in
    units of the noise; `path` (stretches,) is where the signal stands, in steps. `width` is how long a stretch is, zero where each holds
    one sample. [s]
    """

    mean: Array
    count: Array
    times: Array
    slopes: Array
    within: float
    inner: int
    squares: float
    effective_share: float = 1.0
    rounding: Array = field(default_factory=lambda: np.zeros((0, 0)))
    rounded: float = 0.0
    path: Array = field(default_factory=lambda: np.zeros(0))
    width: float = 0.0

    @property
    def sampled(self) -> Array:
        """Times at which its samples lie, to a few a stretch (stretches, points). [s]"""
        points = min(TIMES_PER_STRETCH, max(round(float(np.median(self.count))), 1)) if self.width else 1
        return np.asarray(self.times[:, None] + self.width * ((np.arange(points) + 0.5) / points - 0.5))

    @property
    def shares_rounding(self) -> bool:
        """Whether readings are rounded so that neighbours share an error worth counting."""
        return self.rounded > MIN_SHARED_ROUNDING and self.rounding.size > 0

    def before(self, end: float) -> Binned:
        """Return the stretches up to a time [s]."""
        is_before = self.times <= end
        cut = {name: values[is_before] for name in ("rounding", "path") if (values := getattr(self, name)).size}
        return replace(
            self, mean=self.mean[is_before], count=self.count[is_before], times=self.times[is_before], slopes=self.slopes[is_before], **cut
        )

    @staticmethod
    def of_problem(
        problem: Problem, fitted: Array, loss: str = "linear", loss_scale: float = 1.0, bins: int = MAX_STRETCHES
    ) -> dict[tuple[str, str], Binned]:
        """Return (record, sensor) -> its residuals as means over at most `bins` stretches of time, weighted and in units of the noise. [-]

        A trace of up to twice `MAX_STRETCHES` samples stays as it is. With a loss each residual z counts as rho'(z^2) z, its derivative;
        `loss_scale` is in units of the noise. `fitted` (unknowns,) is in the fitted form.
        """
        out: dict[tuple[str, str], Binned] = {}
        blocks = iter(problem.blocks(fitted))
        for i, experiment in enumerate(problem.experiments):
            times = experiment.times
            each_sample, count = times.size <= 2 * MAX_STRETCHES, min(bins, times.size // 2)
            edges = times if each_sample else np.linspace(times[0], times[-1], count + 1)[:-1]
            centres = times if each_sample else edges + 0.5 * (times[-1] - times[0]) / count
            slopes = problem.slopes(i, fitted, centres)
            for k, o in enumerate(experiment.observations):
                block = next(blocks)
                z = block.weighted
                weighed = z if loss == "linear" else loss_of(z**2, loss, loss_scale)[1] * z
                place = np.searchsorted(edges, times[o.index], side="right") - 1
                rounding = rounding_of(block, o, place, centres.size)
                trace = binned_trace(z, weighed, place, centres, slopes[:, k, :], o.effective_share, rounding)
                out[block.record, o.sensor] = trace if each_sample else replace(trace, width=float(times[-1] - times[0]) / count)
        return out


def stretch_means(values: Array, place: Indices, size: int) -> Array:
    """Return the means (stretches,) of `values` (samples,), `place` (samples,) the stretch of each; zero of an empty stretch."""
    return np.asarray(np.bincount(place, values, minlength=size) / np.maximum(np.bincount(place, minlength=size), 1))


def binned_trace(
    z: Array,
    weighed: Array,
    place: Indices,
    centres: Array,
    slopes: Array,
    effective_share: float,
    rounding: tuple[Array, float, Array] | None = None,
) -> Binned:
    """Return a trace in the stretches that hold samples.

    Parameters
    ----------
    z, weighed : array (samples,)           Residuals in units of the noise, and times the weight of a robust loss.
    place : array (samples,)                Stretch of each sample.
    centres : array (stretches,)            Times. [s]
    slopes : array (stretches, unknowns)    Derivatives of the residuals.
    rounding : (array, float, array)        See `rounding_of`; none where readings are not rounded.
    """
    count = np.bincount(place, minlength=centres.size).astype(float)
    mean, full = stretch_means(weighed, place, centres.size), count > 0
    inside, spare = weighed - mean[place], z.size - int(full.sum())
    within = float(inside @ inside) / max(spare, 1)
    bare = Binned(mean[full], count[full], centres[full], slopes[full], within, spare, float(weighed @ z), effective_share)
    return bare if rounding is None else replace(bare, rounding=rounding[0][full], rounded=rounding[1], path=rounding[2][full])


def rounding_of(block: SensorTrace, o: Observation, place: Indices, size: int) -> tuple[Array, float, Array] | None:
    """Return what the rounding errors of a trace have in common over stretches, in units of the noise; None where it has no steps.

    These are columns (stretches, causes), each reading's own variance, and where the signal stands in each stretch, in steps (stretches,).
    See `shared_rounding`; `place` (samples,) is each sample's stretch of `size`.
    """
    if not o.step:
        return None
    path = block.predicted
    blur = o.blur if o.blur is not None else blur_of(path, block.measured, o.step)
    columns, own_variance = shared_rounding(path, o.step, blur, place, size)
    return columns / block.noise, own_variance / block.noise**2, stretch_means((path - path[0]) / o.step, place, size)


ROUNDING_DECAY = 0.5
"""How fast the covariance of rounding errors ends along a predicted signal. [1/step]"""

STRETCHES = 4 * MAX_STRETCHES
"""A logged signal is looked at in so many stretches of time at most, in which its noise averages out as in independent samples: in several
for each stretch of the readings, or what it does within one would look like wandering."""


def answers_to_inputs(problem: Problem, fitted: Array, pieces: Mapping[tuple[str, str], Binned]) -> dict[tuple[str, str], Array]:
    """Return (record, sensor) -> what a standard deviation of each independent cause does to its residuals (stretches, causes).

    Noise n_k of sample k of a signal moves the predicted readings by h_k n_k, all of one cause. The h of a stretch of samples is the
    difference of two answers of the readings to a step of the signal, one begun where the stretch begins and one where it ends; the answer
    to a step is taken from the sensitivity to a constant shift of the signal, with the start held: one run for all stretches, exact where
    coefficients do not change. The shift of a power is a further load of zero size. The causes of the sensors of one record are the same.

    Parameters
    ----------
    problem : Problem
    fitted : array (unknowns,)    The end of the fit, in the fitted form.
    pieces : dict                 (record, sensor) -> its derivatives in stretches of time, see `autocorrelation`.

    Raises
    ------
    SolverError   When a record cannot be run.
    """
    out: dict[tuple[str, str], Array] = {}
    for i, experiment in enumerate(problem.experiments):
        noisy = {p: sd for p, sd in experiment.noisy.items() if isinstance(_signal(experiment, p), TableSignal)}
        if not problem.unknowns or not noisy:
            continue
        keys = [(experiment.record.name, o.sensor) for o in experiment.observations]
        causes: dict[tuple[str, str], list[Array]] = {key: [] for key in keys}
        for path, signal, answers in _answers(problem, i, fitted, list(noisy), [pieces[key].sampled.ravel() for key in keys]):
            begin, end = float(experiment.times[0]), float(experiment.times[-1])
            within = (signal.instants >= begin) & (signal.instants <= end)
            times = signal.instants[within]
            if times.size < 2:
                continue
            edges = np.maximum(_borders(times, signal.hold), begin)
            place = np.clip(np.searchsorted(edges, times + 1e-9 * (end - begin), side="right") - 1, 0, edges.size - 2)
            errors = _errors_of_means(noisy[path], times, np.asarray(signal.levels)[within], place, edges.size - 1)
            for key, o, step in zip(keys, experiment.observations, answers, strict=True):
                at = pieces[key].sampled
                after = step(at[None] - edges[:, None, None]).mean(axis=2)
                causes[key].append((after[:-1] - after[1:]).T @ errors / o.sigma(problem.noise))
        out |= {key: np.concatenate(several, axis=1) for key, several in causes.items() if several}
    return out


def _borders(times: Array, held: bool) -> Array:
    """Return the borders (stretches + 1,) of at most `STRETCHES` stretches of a signal's samples at `times` (samples,). [s]

    A stretch begins at its sample where a signal holds its value (`held`); else the borders lie amid the samples, (t_k + t_k+1) / 2.
    """
    before, after = times[1] - times[0], times[-1] - times[-2]
    middles = np.concatenate([[times[0] - 0.5 * before], 0.5 * (times[1:] + times[:-1]), [times[-1] + 0.5 * after]])
    borders = np.append(times, times[-1] + after) if held else middles
    if times.size <= STRETCHES:
        return np.asarray(borders)
    return np.asarray(borders[np.unique(np.linspace(0, times.size, STRETCHES + 1).round().astype(int))])


CHANGES = 20
"""The largest changes of a sampled power whose instants are followed; what small ones do is small."""


class OwnSwitches(NamedTuple):
    """What the unknown instants of one power do: its channel, the longest interval in which it changed [s], shift of each unknown."""

    channel: str
    interval: float
    shifts: Array


def own_switches(problem: Problem, minimum: Fit) -> Iterator[OwnSwitches]:
    """Yield, of every power that was sampled on its record's clock, by how much its unknown instants may shift the unknowns (RMS).

    A power is held from the sample that shows it, but changed somewhere in the interval before, anywhere as likely: all its changes are
    late by half an interval on average, and each by the interval over the root of 12 about that. An earlier change is the difference of
    two answers to a step, see `answers_to_inputs`.
    """
    weights = covariances(minimum)[2]
    for i, e in enumerate(problem.experiments if any(u.kind == "parameter" for u in problem.unknowns) else ()):
        powers = {SCALE + p: c.name for p, (c, table) in e.promptly.items() if c.role == "load" and np.ptp(table.levels) > 0.0}
        slopes = problem.slopes(i, minimum.fitted) if powers else np.zeros(0)
        for path, table, answers in _answers(problem, i, minimum.fitted, list(powers), [e.times]) if powers else ():
            gradients, longest = [], 0.0
            for k in table.largest_changes(CHANGES):
                interval, since, pulse = table.gaps(k)[0], e.times - float(table.times[k]), float(table.levels[k] - table.levels[k - 1])
                longest = max(longest, interval)
                gradients.append(
                    sum(
                        slopes[o.index, s, :].T @ (step(since + interval) - step(since))[o.index] * pulse / o.sigma(problem.noise)
                        for s, (o, step) in enumerate(zip(e.observations, answers, strict=True))
                    )
                )
            shifts = np.array(gradients) @ weights
            yield OwnSwitches(powers[path], longest, np.hypot(0.5 * shifts.sum(axis=0), np.linalg.norm(shifts, axis=0) / np.sqrt(12.0)))


def shifts_by_lags(problem: Problem, minimum: Fit, sd: float) -> tuple[list[str], float, Array]:
    """Return the sensors without a stated lag, the lag that all may have, and by how much it would shift the unknowns (unknowns,).

    To first order a sensor that lags by L reads its node less L times its rate of change, so that weighted residuals r (measured less
    model) become r + c L, c the rate of change over the noise. The readings say L = -c'r / I, with the information I = c'c - c'J C J'c
    that is not in the unknowns, J their derivatives and C their covariance; `sd` [s] is what is known of it before. With v = 1 / (1 / sd^2
    + I / level), level chi^2 per degree of freedom, 1 at least, the lag is the root of its mean square, sqrt((v c'r / level)^2 + v) [s];
    the unknowns shift by C J'c times it, fitted form.
    """
    names, gradient, score, square = dict[str, None](), np.zeros(len(problem.unknowns)), 0.0, 0.0
    for i, e in enumerate(problem.experiments):
        bare = [s for s, o in enumerate(e.observations) if e.record.channels[o.sensor].part is None and o.index.size > 1]
        blocks, slopes = problem.blocks_and_slopes(i, minimum.fitted) if bare else ([], np.zeros(0))
        for s in bare:
            b, o = blocks[s], e.observations[s]
            names[b.sensor] = None
            column = np.gradient(b.predicted, b.times) / b.noise
            gradient += slopes[o.index, s, :].T @ column
            score, square = score + float(column @ b.weighted), square + float(column @ column)
    moves = covariances(minimum)[2] @ gradient
    level = max(minimum.chi_square / max(problem.freedom, 1.0), 1.0)
    variance = 1.0 / (sd**-2.0 + max(square - float(gradient @ moves), 0.0) / level)
    lag = float(np.hypot(variance * score / level, variance**0.5))
    return list(names), lag, lag * moves


def _errors_of_means(noise: InputNoise, times: Array, values: Array, place: Indices, size: int) -> Array:
    """Return a root (stretches, causes) of the covariance of the errors of a signal's means over stretches. [K, W]"""
    count = np.bincount(place, minlength=size)
    full = np.flatnonzero(count)
    white = np.zeros((size, full.size))
    white[full, np.arange(full.size)] = noise.white / np.sqrt(count[full])
    if not noise.step or noise.white >= noise.step:
        return white
    shared, _ = shared_rounding(unrounded(times, values), noise.step, noise.white, place, size)
    return np.concatenate([white, shared / np.maximum(count, 1)[:, None]], axis=1)


def score_of_inputs(pieces: Mapping[tuple[str, str], Binned], inputs: Mapping[tuple[str, str], Array]) -> Array:
    """Return what the noise of logged boundaries and powers adds to the covariance of J'r (unknowns, unknowns). [-]

    A cause that moves the residuals by h moves J'r by J'h, summed over the sensors of its record: covariance ``sum (J'h) (J'h)'``.
    `inputs` is (record, sensor) -> h (stretches, causes), in units of the noise.
    """
    size = next((b.slopes.shape[1] for b in pieces.values()), 0)
    moved: dict[str, Array] = {}
    for (record, sensor), causes in inputs.items():
        b = pieces[record, sensor]
        moved[record] = moved.get(record, 0.0) + (b.count[:, None] * b.slopes).T @ causes
    return sum((m @ m.T for m in moved.values()), np.zeros((size, size)))


def _signal(experiment: Experiment, path: str) -> Signal | None:
    """Return the signal of a boundary, or of a power by the name of its scale."""
    load = path.removeprefix(SCALE)
    return experiment.scenario.loads.get(load) if load != path else experiment.scenario.boundaries.get(path)


class _Step:
    """The answer of a reading to a step of a boundary by 1 K or of a power by 1 W, at times since the step; zero before it. [K/K, K/W]"""

    def __init__(self, times: Array, answer: Array) -> None:
        """Keep the answer (times,) at times since the step, zero at the step. [s]"""
        self.times, self.answer = np.concatenate([[0.0], times]), np.concatenate([[0.0], answer])

    def __call__(self, since: Array) -> Array:
        """Return the answer at times since the step; zero before it. [s]"""
        return np.where(since > 0.0, np.interp(since, self.times, self.answer), 0.0)


def _answers(
    problem: Problem, i: int, fitted: Array, paths: Sequence[str], centres: Sequence[Array]
) -> Iterator[tuple[str, TableSignal, list[_Step]]]:
    """Yield every signal by its path with the answer of each sensor to a step of it: (times [s], K per unit of the signal), from rest.

    Parameters
    ----------
    i : int                     Position of the record.
    fitted : array (unknowns,)  Fitted form.
    centres : sequence          Instants at which each sensor's answer is needed. [s]
    """
    bench_of_fit = problem.bench(i, fitted)
    values, _ = problem.inputs(i, fitted)
    experiment, named = _shifted(bench_of_fit.experiment, paths)
    more = [p for p in named if p not in bench_of_fit.free]
    bench = Bench.of_experiment(experiment, (*bench_of_fit.free, *more)) if more else bench_of_fit
    x = np.concatenate([values, np.zeros(len(more))])
    times = np.unique(np.concatenate(centres))
    _, slopes = bench.temperatures(x, True, problem.options, times, from_rest=True)
    since = times - float(bench_of_fit.experiment.times[0])
    late = since > 0.0
    for path, name in zip(paths, named, strict=True):
        signal = _signal(bench_of_fit.experiment, path)
        assert isinstance(signal, TableSignal)
        place = bench.free.index(name)
        yield path, signal, [_Step(since[late], slopes[late, k, place]) for k in range(slopes.shape[1])]


def _shifted(experiment: Experiment, paths: Sequence[str]) -> tuple[Experiment, list[str]]:
    """Return an experiment with a load of 1 W beside every logged power among some signals, and what is free to shift each signal."""
    network, scenario = experiment.network, experiment.scenario
    nodes = {load.path: load.node for load in network.flat.loads}
    beside = {p: f"noise {p.removeprefix(SCALE)}" for p in paths if p.startswith(SCALE)}
    if not beside:
        return experiment, list(paths)
    loads = [FlatLoad(name, node := nodes[p.removeprefix(SCALE)], node, {}) for p, name in beside.items()]
    flat = replace(network.flat, loads=(*network.flat.loads, *loads))
    scenario = scenario.with_(loads=dict.fromkeys(beside.values(), Constant(1.0)))
    shifted_experiment = replace(experiment, network=replace(network, flat=flat), scenario=scenario)
    return shifted_experiment, [SCALE + beside[p] if p in beside else p for p in paths]


TRIED_TIMES = 7
"""Correlation times that are tried, from one stretch to half the record."""
MIN_LIKELIHOOD_GAIN = 5.0
"""Twice the logarithm of the likelihood ratio from which a trace is held to wander: a few white traces in a hundred would."""
DECIDING_SHARE = 0.5
"""Share of what is known of a direction from which a trace is held to decide it alone."""
PART, MIN_SINGULAR_VALUE = 0.02, 1e-9
"""Share from which a trace with noisy inputs has a part in a direction; singular value over the largest from which that is one at all."""
MIN_EXPLAINED_BY_INPUTS = 0.05
"""Part of the squares of a trace's residuals from which what noise of inputs makes of it is separated by whitening."""
ROUNDED = 2.0
"""What wanders by no more than so many times the variance of rounding is rounding."""
MIN_SPARE_STRETCHES = 12
"""Stretches beyond the unknowns, below which nothing can be said."""


@dataclass(frozen=True)
class TraceNoise:
    """The residuals of one sensor in one record, as an independent part and one that wanders.

    Parameters
    ----------
    record, sensor : str
    samples : int
    white_variance : float      Variance of the independent part, in squares of the noise; 0 where nothing wanders. [-]
    correlated_variance : float     Variance of the autocorrelated part, in squares of the noise. [-]
    correlation_time : float    Its correlation time. [s]
    effective_samples : float   Independent samples that would say as much about a mean. [-]
    """

    record: str
    sensor: str
    samples: int
    white_variance: float
    correlated_variance: float
    correlation_time: float
    effective_samples: float


@dataclass(frozen=True, eq=False)
class Autocorrelation:
    """Autocorrelation of the residuals of a fit, trace by trace, and what it does to the errors.

    Parameters
    ----------
    traces : tuple of TraceNoise                 One per record and sensor.
    variance_factor : float                 Variance of the white traces, in squares of the noise, never below 1. [-]
    score_excess : array (unknowns, unknowns)   What autocorrelation, and the noise of logged signals, adds to the covariance of J'r, over
                                            `variance_factor` times J'J; zeros where there is none.
    """

    traces: tuple[TraceNoise, ...]
    variance_factor: float
    score_excess: Array

    @property
    def effective_samples(self) -> dict[tuple[str, str], float]:
        """(record, sensor) -> effective samples."""
        return {(t.record, t.sensor): t.effective_samples for t in self.traces}


def autocorrelation(problem: Problem, minimum: Fit, loss: str = "linear", loss_scale: float = 1.0) -> Autocorrelation:
    """Autocorrelation of the residuals of a fit by restricted likelihood, and what it adds to the covariance of J'r.

    Each trace is split into equal stretches of time. The means of its residuals there are held to be the sum of what the unknowns can
    change, independent errors, and a part with correlations ``exp(-|t1 - t2| / time)``; the variances and the time have the largest
    restricted likelihood (Patterson and Thompson, Biometrika 58 (1971) 545), which does not take for quietness what the fit has removed:
    along directions in which this trace alone decides, its residuals say nothing; where other records or priors decide they do.
    Gaps need no care, since the times of the stretches are what they are. A trace that wanders no more than chance would adds nothing.
    """
    pieces = Binned.of_problem(problem, minimum.fitted, loss, loss_scale)
    inputs = answers_to_inputs(problem, minimum.fitted, pieces)
    weights = finite(covariances(minimum)[2])
    # directions without information count as decided by each trace alone
    root_of_weights = square_root(weights)
    # what a prior has decided already takes no freedom from the residuals: E(r'r) = n - tr(C J'J)
    taken = float(np.trace(weights @ minimum.jacobian.T @ minimum.jacobian))
    alike: dict[bytes, list[Array]] = {}  # sensors of one log share their stretches, and with them what is tried there
    calm_of_trace = {key: _Calm.of_trace(b, root_of_weights, inputs.get(key)) for key, b in pieces.items()}
    parts = {key: _parts(b, calm_of_trace[key], alike) for key, b in pieces.items()}
    calm = [key for key, (white, _, _) in parts.items() if white == 0.0]
    variance_factor = 1.0
    if calm:
        # of a trace with noisy inputs only what they do not explain
        still = [key for key in calm if not (calm_of_trace[key].noisy and calm_of_trace[key].tells)]
        others = [calm_of_trace[key].left for key in calm if key not in still]
        squares = minimum.chi_square if len(still) == len(parts) else sum(pieces[k].squares for k in still)
        squares += sum(float(residuals @ residuals) for residuals in others)
        squares -= sum(float(pieces[k].count @ np.sum(inputs[k] ** 2, axis=1)) for k in still if k in inputs)
        samples = sum(float(pieces[k].count.sum()) * pieces[k].effective_share for k in still)
        freedom = samples * (1.0 - taken / max(problem.effective_samples, 1.0)) + sum(residuals.size for residuals in others)
        variance_factor = max(1.0, squares / max(freedom, 1.0))
    traces = tuple(_trace_noise(key, pieces[key], *part) for key, part in parts.items())
    return Autocorrelation(traces, variance_factor, score_excess(pieces, traces, variance_factor, inputs))


def _trace_noise(key: tuple[str, str], b: Binned, white: float, correlated: float, time: float) -> TraceNoise:
    """Return the noise of a trace with its effective number of readings.

    n_eff = n (white + s) / (white + s c'Rc / n), n at most: R the correlation exp(-|dt| / time) of the bins, c their counts, s
    `correlated`; n within / white without an s, `within` the variance inside the bins. A rounding shared by readings lowers it to n / (1 +
    x), x the variance of the sum of rounding errors over n less that of each by itself.

    Parameters
    ----------
    key : tuple                     (record, sensor).
    white, correlated : float       Variances of single readings, and of what wanders, in squares of the noise; 0 for no such part. [-]
    time : float                    Of the correlation. [s]
    """
    total = float(b.count.sum())
    effective = total
    if white > 0.0:
        one = white if correlated > 0.0 else b.within
        mean = float(b.count @ correlation(b.times, time) @ b.count) / total
        effective = total * min((one + correlated) / (white + correlated * mean), 1.0)
    if b.shares_rounding:
        shared = float(np.sum(b.rounding.sum(axis=0) ** 2)) / total - b.rounded
        effective = min(effective, total / max(1.0 + shared, 1.0))
    return TraceNoise(*key, int(total), white, correlated, time, effective)


def score_excess(
    pieces: Mapping[tuple[str, str], Binned],
    traces: Sequence[TraceNoise],
    variance_factor: float,
    inputs: Mapping[tuple[str, str], Array],
) -> Array:
    """Return what noise adds to the covariance of J'r over ``variance_factor J'J`` (unknowns, unknowns), the same for fits and plans.

    Parameters
    ----------
    pieces : dict               (record, sensor) -> its derivatives in stretches of time, and its rounding errors.
    traces : sequence           The white and the autocorrelated part of each.
    variance_factor : float     Variance of the white traces, in squares of the noise.
    inputs : dict               (record, sensor) -> what a standard deviation of each independent cause does to it (stretches, causes).
    """
    size = next((b.slopes.shape[1] for b in pieces.values()), 0)
    out = np.zeros((size, size))
    for t in traces:
        b = pieces[t.record, t.sensor]
        weighed = b.count[:, None] * b.slopes
        if t.white_variance > 0.0:
            added = t.correlated_variance * weighed.T @ correlation(b.times, t.correlation_time) @ weighed
            if b.effective_share < 1.0:
                # the weights stand for correlated noise already; what residuals wander beyond that is added
                out += _not_below_zero((t.white_variance - variance_factor) * b.slopes.T @ weighed + added)
            else:
                out += max(t.white_variance - variance_factor, 0.0) * b.slopes.T @ weighed + added
        if b.shares_rounding:
            moved = b.slopes.T @ b.rounding
            out += _not_below_zero(moved @ moved.T - b.rounded * b.slopes.T @ weighed)
    return out + score_of_inputs(pieces, inputs)


def covariance_of_means(
    pieces: Mapping[tuple[str, str], Binned], traces: Sequence[TraceNoise], inputs: Mapping[tuple[str, str], Array]
) -> Array:
    """Return the covariance (stretches, stretches) of the means of several traces, one after the other, in squares of their noise. [-]

    A trace has white variance over the count of readings, plus s^2 exp(-|t - t'| / tau), plus rounding R R' that fades with the distance
    in steps; `inputs` H (stretches, inputs) of a sensor adds H H', shared by all sensors of a record. It is the noise of `score_excess`,
    for who weighs readings by it. Weights would make rounding errors of distant plateaus cancel, as they do about the true signal; the
    predicted one is not it, so that their covariance ends over some steps.
    """
    size = sum(b.count.size for b in pieces.values())
    out, begin = np.zeros((size, size)), 0
    causes: dict[str, Array] = {}
    for t in traces:
        b, here = pieces[t.record, t.sensor], slice(begin, begin + pieces[t.record, t.sensor].count.size)
        begin = here.stop
        white = t.white_variance or 1.0
        block = np.diag((white - min(b.rounded, 0.95 * white) * b.shares_rounding) / b.count)
        block += t.correlated_variance * correlation(b.times, t.correlation_time)
        if b.shares_rounding:
            means = b.rounding / b.count[:, None]
            block += means @ means.T * np.exp(-ROUNDING_DECAY * np.abs(b.path[:, None] - b.path))
        out[here, here] = block
        if (h := inputs.get((t.record, t.sensor))) is not None:
            causes.setdefault(t.record, np.zeros((size, h.shape[1])))[here] = h
    return sum((h @ h.T for h in causes.values()), out)


def _not_below_zero(matrix: Array) -> Array:
    """Return a symmetric matrix (n, n) with its negative eigenvalues at zero."""
    sizes, vectors = np.linalg.eigh(0.5 * (matrix + matrix.T))
    return np.asarray((vectors * np.maximum(sizes, 0.0)) @ vectors.T)


def correlation(times: Array, time: float) -> Array:
    """Exponential correlations (times, times) with a correlation time [s]."""
    return np.asarray(np.exp(-np.abs(times[:, None] - times[None, :]) / time)) if time > 0 else np.eye(times.size)


@dataclass(frozen=True, eq=False)
class _Calm:
    """A trace without what noise of logged inputs explains.

    Parameters
    ----------
    weights : array (stretches, stretches)  That makes the means of stretches independent and of size 1.
    decided, free : array (stretches, directions)   What this trace alone decides, and all that it does not.
    left : array (directions,)              Its residuals in the latter.
    noisy : bool                            Whether noise of inputs is a part of the residuals worth separating.
    """

    weights: Array
    decided: Array
    free: Array
    left: Array
    noisy: bool

    @classmethod
    def of_trace(cls, b: Binned, unknown_root: Array, inputs: Array | None = None) -> _Calm:
        """Return a trace whitened by white noise and the noise of its inputs.

        Weights are (I + M M')^-1/2 N, with N = diag(sqrt(counts)) and M = N inputs; N without inputs.

        Parameters
        ----------
        b : Binned                                  Means of its residuals (bins,) [K], their slopes (bins, unknowns), counts (bins,).
        unknown_root : array (unknowns, unknowns)   R, R R' the covariance of the unknowns, fitted form.
        inputs : array (bins, inputs)               Answers of the means to the noise of inputs, in units of the white noise.
        """
        root = np.sqrt(b.count)
        weights, plain = np.diag(root), None
        if inputs is not None and inputs.size:
            moved = root[:, None] * inputs
            sizes, vectors = np.linalg.eigh(np.eye(root.size) + moved @ moved.T)
            weights = (vectors / np.sqrt(np.maximum(sizes, 1.0))) @ vectors.T * root
            if float(np.sum(moved**2)) > MIN_EXPLAINED_BY_INPUTS * b.squares:
                plain = root[:, None] * b.slopes @ unknown_root
        decided, free = _beside(weights @ b.slopes @ unknown_root, plain)
        return cls(weights, decided, free, free.T @ (weights @ b.mean), plain is not None)

    @property
    def tells(self) -> bool:
        """Whether enough is left to tell what the noise is."""
        return self.left.size >= MIN_SPARE_STRETCHES and float(self.left @ self.left) > 0.0


def _parts(b: Binned, trace: _Calm, alike: dict[bytes, list[Array]]) -> tuple[float, float, float]:
    """Return the variances of the white and the autocorrelated part of a trace, and the time of the latter [s]; zeros where it is white.

    Variances in squares of the noise. Of `TRIED_TIMES` correlation times, from the spacing of stretches to half of the trace, that with
    the largest restricted likelihood, near the one of the largest score (`_leaning`). `alike` keeps the correlations that were tried on
    some stretches, for the next trace on the same ones. What noise of logged inputs explains, and what rounding to steps does, is no
    wandering. A trace whose neighbours are tied within stretches, s^2 > within (1 + 3 sqrt(2 / spare + 2 / inner)), has a white part
    alone.
    """
    if not trace.tells:
        return 0.0, 0.0, 0.0
    calmed, decided, free, y = trace.weights, trace.decided, trace.free, trace.left
    spare = y.size
    calm = float(y @ y) / spare
    spacing, span = float(np.median(np.diff(b.times))), float(b.times[-1] - b.times[0])
    times = np.geomspace(spacing, max(0.5 * span, 2.0 * spacing), TRIED_TIMES)
    key = b.times.tobytes()
    if key not in alike:
        alike[key] = [correlation(b.times, time) for time in times]
    likes = [calmed @ like @ calmed.T for like in alike[key]]
    lean = _leaning(likes, decided, free @ y, calm)
    tried: dict[int, tuple[float, float, float]] = {}
    at = int(lean.argmax())
    while lean[at] > 1.0:  # uphill from the time towards which they lean most, by more than a standard deviation of chance
        near = [k for k in (at - 1, at, at + 1) if 0 <= k < times.size and lean[k] > 1.0]
        tried |= {k: _likeliest(free.T @ likes[k] @ free, y, calm) for k in near if k not in tried}
        best = max(near, key=lambda k: tried[k][0])
        if best == at:
            break
        at = best
    gain, white, correlated = tried.get(at, (0.0, 0.0, 0.0))
    time = float(times[at])
    if gain <= MIN_LIKELIHOOD_GAIN:
        white, correlated, time = calm, 0.0, 0.0
    # a filter, or steps of the sensor, tie neighbours within a stretch together: the means of stretches then scatter more than they should
    if b.shares_rounding and correlated <= ROUNDED * b.rounded:
        return 0.0, 0.0, 0.0
    quick = b.inner > spare and white > b.within * (1.0 + 3.0 * np.sqrt(2.0 / spare + 2.0 / b.inner))
    return (white, correlated, time) if correlated > 0 or quick else (0.0, 0.0, 0.0)


def _likeliest(within: Array, y: Array, calm: float) -> tuple[float, float, float]:
    """Return twice the gain in log-likelihood of a wandering part [-], and the variances of the white and the wandering part [K^2].

    In the eigenbasis of its correlation, y_i^2 has the expectation white (1 + ratio size_i); ratios are tried at 60 values, and 2 ln L1 /
    L0 = n ln calm - n ln white - sum ln(1 + ratio size_i).

    Parameters
    ----------
    within : array (n, n)   Correlation of the wandering part.
    y : array (n,)          Residuals with a white part of one variance. [K]
    calm : float            Their variance if they were white. [K^2]
    """
    sizes, vectors = np.linalg.eigh(within)
    sizes, parts = np.maximum(sizes, 0.0), (vectors.T @ y) ** 2
    ratios = np.geomspace(0.01 / sizes[-1], 1e4 / sizes.mean(), 60)
    # in the eigenbasis y_i^2 has the expectation w (1 + ratio size_i); the w of the largest likelihood is the mean of y_i^2 / (1 + ...)
    variances = 1.0 + ratios[:, None] * sizes
    white = (parts / variances).mean(axis=1)
    # 2 ln L1 / L0 = n ln calm - n ln w - sum ln(1 + ratio size_i)
    gain = y.size * np.log(calm) - y.size * np.log(white) - np.log(variances).sum(axis=1)
    k = int(gain.argmax())
    return float(gain[k]), float(white[k]), float(ratios[k] * white[k])


def _leaning(likes: Sequence[Array], decided: Array, residuals: Array, variance: float) -> Array:
    """Return by how many standard deviations of chance residuals lean towards each of some correlations (score test for no wandering). [-]

    Parameters
    ----------
    likes : sequence of array (stretches, stretches)    Correlations L, whitened.
    decided : array (stretches, directions)             What the trace alone decides, D; correlations count beside it.
    residuals : array (stretches,)                      Whitened, with no part in D.
    variance : float                                    Of residuals in the directions left, s^2.
    """
    out = np.zeros(len(likes))
    spare = decided.shape[0] - decided.shape[1]
    for k, like in enumerate(likes):
        across = like @ decided
        inside = decided.T @ across
        # Rao's score test (Proc. Camb. Phil. Soc. 44 (1948) 50) of a variance component L, P = 1 - D D' the residual space: r'L r / s^2 has
        # the mean tr(P L) and, s^2 estimated from the same r, the variance 2 (tr(P L P L) - tr(P L)^2 / n) where it is none;
        # tr(P L P L) = |L|^2 - 2 |L D|^2 + |D'L D|^2
        mean = (float(np.trace(like)) - float(np.trace(inside))) / spare
        square = float(np.sum(like**2)) - 2.0 * float(np.sum(across**2)) + float(np.sum(inside**2))
        spread = 2.0 * (square - spare * mean**2)
        excess = float(residuals @ like @ residuals) / variance - spare * mean
        out[k] = excess / np.sqrt(spread) if spread > 0 else np.inf * np.sign(excess)
    return out


def _beside(slopes: Array, plain: Array | None = None) -> tuple[Array, Array]:
    """Return orthonormal bases (stretches, directions) of what a trace alone decides, and of all that it does not.

    With `slopes` in units of standard errors of the whole fit, a singular value is the root of the trace's share in a direction. Where they
    are calmed by noise of inputs, `plain` are those by which the fit weighed: what it removed is then no share of the calmed residuals, as
    the noise of an input moves all traces at once, so that every direction that the trace has a part in is left out.
    """
    if not slopes.size:
        return np.zeros((slopes.shape[0], 0)), np.eye(slopes.shape[0])
    if plain is not None:
        _, s, turned = np.linalg.svd(plain, full_matrices=False)
        slopes = slopes @ turned[s**2 > PART].T
        if not slopes.shape[1]:
            return np.zeros((slopes.shape[0], 0)), np.eye(slopes.shape[0])
    basis, s, _ = np.linalg.svd(slopes, full_matrices=True)
    count = int((s**2 > DECIDING_SHARE).sum()) if plain is None else int((s > MIN_SINGULAR_VALUE * s[0]).sum())
    return np.asarray(basis[:, :count]), np.asarray(basis[:, count:])


GRID_TIMES, GRID_RATIOS, GRID_SIZES = 9, 16, 7
"""Nodes of the grid: correlation times, ratios of the variances of both parts, variances of the white part."""
MAX_VARIANCE_RATIO, MIN_VARIANCE_RATIO = 1e4, 0.05
"""Ratios of the variance of the autocorrelated part to that of the white part of the mean of a stretch."""
ZERO_INFORMATION = 1e-9
"""Information, in parts of what white noise would give, that stands for none."""
DRAWS = 128
"""Noise models that are drawn where there are several traces."""
NEGLIGIBLE, UNLIKELY, MIN_SHIFT = 1e-3, 1e-5, 0.03
"""Chance of a noise model, and of a node given the trace alone, beside the likeliest, and shift of readings in units of their white noise,
below which they do not count."""


@dataclass(frozen=True, eq=False)
class Weighed:
    """What the data say of the unknowns under noise models that their residuals allow.

    Parameters
    ----------
    weights : array (models,)                           Probability of each noise model.
    information : array (models, unknowns, unknowns)    X' V^-1 X, X the derivatives of the readings and V the covariance of their noise.
    scores : array (models, unknowns)                   X' V^-1 z, z the residuals.
    """

    weights: Array
    information: Array
    scores: Array


@dataclass(frozen=True, eq=False)
class _TraceBasis:
    """A trace in the bases in which its covariance is diagonal, one basis per correlation time.

    `shrunk` (times, ratios, stretches) are the inverses of its variances, white noise alone being 1; `residuals` (times, stretches) and
    `slopes` (times, stretches, acting) stand in these bases, divided by the white error of the mean of a stretch, with a column for each
    unknown that acts on the trace at all; `acting` are their positions.
    """

    shrunk: Array
    residuals: Array
    slopes: Array
    acting: Indices

    @classmethod
    def of_trace(cls, b: Binned, scale: Array) -> _TraceBasis:
        """Return a trace in the eigenbases of its correlations, one for each time of the grid; slopes in units of `scale` (unknowns,).

        With N the counts of stretches, sqrt(N) R sqrt(N) = U L U' for R = exp(-|dt| / time); kept are 1 / (1 + ratio L) (times, ratios,
        stretches), U' sqrt(N) r and U' sqrt(N) J. [-]
        """
        root = np.sqrt(b.count)
        sizes, vectors = _bases(b.times.tobytes(), b.count.tobytes())
        turned = np.swapaxes(vectors, 1, 2)
        shrunk = 1.0 / (1.0 + np.geomspace(MIN_VARIANCE_RATIO, MAX_VARIANCE_RATIO, GRID_RATIOS)[:, None] * sizes[:, None, :])
        acting = np.flatnonzero(b.slopes.any(axis=0))
        slopes = root[:, None] * -b.slopes[:, acting] * scale[acting]
        return cls(shrunk, turned @ (root * b.mean), turned @ slopes, acting)


@dataclass(frozen=True, eq=False)
class _Grid:
    """Probability (nodes, sizes) of the noise of a trace at some nodes (time and ratio in one), and the white variances there."""

    nodes: Indices
    chance: Array
    variances: Array


@lru_cache(maxsize=8)
def _bases(time_bytes: bytes, counts: bytes) -> tuple[Array, Array]:
    """Return eigenvalues (times, stretches) and eigenvectors of the correlations of a trace, for every correlation time.

    Of the matrices R^1/2 K R^1/2 with the correlations K of the means of stretches (`correlation_of_means`) and R, their samples over the
    median. `time_bytes` are the times of its stretches and `counts` their samples: sensors of one log share them, and so do logs of one
    kind.
    """
    times, count = np.frombuffer(time_bytes), np.frombuffer(counts)
    spacing, typical = float(np.median(np.diff(times))), float(np.median(count))
    root = np.sqrt(count / typical)
    ties = [
        correlation_of_means(times, max(round(typical), 1), spacing, time) for time in wander_times(times)[GRID_RATIOS - 1 :: GRID_RATIOS]
    ]
    sizes, vectors = np.linalg.eigh(np.array([root[:, None] * tie * root for tie in ties]))
    return np.maximum(sizes, 0.0), vectors


def wander_times(times: Array) -> Array:
    """Return the correlation time of what wanders in each noise of the grid of `evidences` (noises,), zero in the calmest ones. [s]"""
    spacing, span = float(np.median(np.diff(times))), float(times[-1] - times[0])
    tried = np.geomspace(spacing, max(span, 2.0 * spacing), GRID_TIMES)
    return (tried[:, None] * (np.arange(GRID_RATIOS) > 0)).ravel()


def correlation_of_means(times: Array, samples: int, spacing: float, time: float) -> Array:
    """Return the covariances (times, times) of means over stretches of what has the variance 1 and correlations ``exp(-t / time)``.

    A stretch holds `samples` at equal distances, each x = spacing / samples / time of a correlation time. Means at different times have
    the covariance ``exp(-t / time) (sinh(samples x / 2) / (samples sinh(x / 2)))^2``, and one mean the variance
    ``(samples + 2 sum (samples - k) exp(-k x)) / samples^2``. Means are smoother than readings: taken for readings, they give errors a
    tenth too small.
    """
    x = spacing / samples / time
    k = np.arange(1, samples)
    across = (np.sinh(0.5 * samples * x) / (samples * np.sinh(0.5 * x))) ** 2
    out = np.asarray(across * correlation(times, time))
    np.fill_diagonal(out, (samples + 2.0 * float((samples - k) @ np.exp(-k * x))) / samples**2)
    return out


def weighed(pieces: Sequence[Binned], priors: Array, pulls: Array, level: float = 1.0) -> Weighed:
    """Return what traces say of the unknowns, averaged over what their noise may be.

    Parameters
    ----------
    pieces : sequence of Binned             The traces in stretches of time, at any values of the unknowns.
    priors : array (unknowns, unknowns)     Information that is known beside the data, of unknowns that are not tested.
    pulls : array (unknowns,)               Its scores there.
    level : float                           Variance of the noise of traces too short to show theirs, in squares of the noise stated.

    Notes
    -----
    The means over stretches of a trace have the covariance ``s (1/count + ratio exp(-|t1 - t2| / time))``. The three numbers have the
    restricted likelihood of Patterson and Thompson (Biometrika 58 (1971) 545) times a prior flat in their logarithms, with every unknown
    open but for `priors`, so that a shift of a value is not taken for noise. One trace is averaged over its grid. Of several, each has its
    distribution given the others at their likeliest, and noise models are drawn from these (Latin hypercube, always the same).
    """
    scale = _scales(pieces, priors)
    long = [b for b in pieces if b.count.size >= MIN_SPARE_STRETCHES]
    traces = [_TraceBasis.of_trace(b, scale) for b in long]
    prior_information, start = priors * np.outer(scale, scale), pulls * scale
    for b in (b for b in pieces if b.count.size < MIN_SPARE_STRETCHES):
        turned = b.slopes * scale
        prior_information = prior_information + turned.T @ (b.count[:, None] * turned) / level
        start = start - turned.T @ (b.count * b.mean) / level
    back = 1.0 / np.outer(scale, scale)
    if not traces:
        return Weighed(np.ones(1), (prior_information * back - priors)[None], (start / scale - pulls)[None])
    weights, information, scores = _averaged(traces, prior_information, start)
    return Weighed(weights, information * back - priors, scores / scale - pulls)


def evidences(pieces: Sequence[Binned], priors: Array, pulls: Array) -> tuple[Array, Array, Array, Array, Array]:
    """Return the log-likelihood of traces, but for a constant of their readings alone, with all unknowns integrated out (several, noises).

    Beside it stand how far each unknown would move, and its standard error (several, noises, unknowns), what of the log-likelihood is
    promised by that way (several, noises), and the mean square of the residuals in units of the stated noise, weighed by the inverse of
    their covariance (noises,). White noise of each trace is as stated, or as large as it is inside its stretches;
    what wanders has one ratio to it and one time in all traces, those of each noise on a grid. Models of the same readings are
    compared with the same unknowns first, those of `priors` zero flat, and more behind them.

    Parameters
    ----------
    pieces : sequence of Binned                     The traces in stretches of time, at any values of the unknowns.
    priors : array (several, unknowns, unknowns)    Information that is known beside the data.
    pulls : array (several, unknowns)               Its scores where the unknowns stand.
    """
    of_time, of_ratio = np.divmod(np.arange(GRID_TIMES * GRID_RATIOS), GRID_RATIOS)
    scaled = [(b, max(1.0, b.within)) for b in pieces if b.count.size >= MIN_SPARE_STRETCHES]
    calm = [replace(b, mean=b.mean / size**0.5, slopes=b.slopes / size**0.5) for b, size in scaled]
    count = priors.shape[-1]
    scale = _scales(calm, priors[0])
    prior_information = priors * np.outer(scale, scale) + ZERO_INFORMATION * np.eye(count)
    information, scores = np.zeros((of_time.size, count, count)), np.zeros((of_time.size, count))
    alone, squares, weights = np.zeros((3, of_time.size))
    for (b, size), trace in zip(scaled, calm, strict=True):
        t = _TraceBasis.of_trace(trace, scale)
        shrunk, residuals, slopes = t.shrunk[of_time, of_ratio], t.residuals[of_time], t.slopes[of_time]
        taken = np.swapaxes(shrunk[..., None] * slopes, 1, 2)
        information[:, t.acting[:, None], t.acting] += taken @ slopes
        scores[:, t.acting] += (taken @ residuals[..., None])[..., 0]
        square = np.sum(shrunk * residuals**2, axis=1)
        alone += 0.5 * (np.log(shrunk).sum(axis=1) - square)
        squares += size * square + b.inner * b.within
        weights += shrunk.sum(axis=1) + b.inner
    logs, moves, errors, gains = [], [], [], []
    for prior_of_member, pull in zip(prior_information, pulls * scale, strict=True):
        # integral of a normal likelihood over normal unknowns: |P|^(1/2) |A|^(-1/2) exp(b'A^-1 b / 2)
        covariances_of = np.linalg.inv(information + prior_of_member)
        move = (covariances_of @ (scores + pull)[..., None])[..., 0]
        gain = 0.5 * np.sum((scores + pull) * move, axis=-1)
        gains.append(gain)
        logs.append(alone + gain + 0.5 * np.linalg.slogdet(covariances_of)[1] + 0.5 * float(np.linalg.slogdet(prior_of_member)[1]))
        moves.append(scale * move)
        errors.append(scale * np.sqrt(np.diagonal(covariances_of, axis1=-2, axis2=-1)))
    return np.array(logs), np.array(moves), np.array(errors), np.array(gains), squares / np.maximum(weights, 1.0)


def white_rows(pieces: Sequence[Binned], noise: int, like: Sequence[Binned]) -> tuple[Array, Array]:
    """Return residuals (rows,) of traces, and derivatives (rows, unknowns), made white in one noise of the grid of `evidences`.

    White noise is as stated, or as large as it is inside the stretches of `like`, the same traces at other values.
    """
    rows, slopes = [np.zeros(0)], [np.zeros((0, pieces[0].slopes.shape[1]))]
    for b, other in zip(pieces, like, strict=True):
        if b.count.size >= MIN_SPARE_STRETCHES:
            t = _TraceBasis.of_trace(b, np.ones(b.slopes.shape[1]))
            of_time, of_ratio = divmod(noise, GRID_RATIOS)
            root = np.sqrt(t.shrunk[of_time, of_ratio] / max(1.0, other.within))
            rows.append(root * t.residuals[of_time])
            slopes.append(np.zeros(b.slopes.shape))
            slopes[-1][:, t.acting] = -root[:, None] * t.slopes[of_time]
    return np.concatenate(rows), np.concatenate(slopes)


def _scales(pieces: Sequence[Binned], priors: Array) -> Array:
    """Return the standard error (unknowns,), fitted form, of each unknown if all others were known, by white noise; 1 if unseen."""
    square = np.diag(priors) + sum((b.count @ b.slopes**2 for b in pieces), np.zeros(priors.shape[0]))
    return np.asarray(1.0 / np.sqrt(np.where(square > 0, square, 1.0)))


def _averaged(traces: Sequence[_TraceBasis], prior_information: Array, start: Array) -> tuple[Array, Array, Array]:
    """Return weights (models,) [-], information (models, values, values) and scores (models, values) of noise models of several traces.

    One trace has a model for each node of its grid that is not negligible, by its probability; several have `DRAWS` models of equal weight,
    each trace's nodes drawn by their probabilities given the likeliest nodes of the others.

    Parameters
    ----------
    prior_information, start : array    Information (values, values) and score (values,) of the priors.
    """
    grids = [_likely(t, prior_information, start, np.arange(GRID_TIMES * GRID_RATIOS)) for t in traces]
    if len(traces) == 1:
        chance = grids[0].chance.ravel()
        chosen = np.flatnonzero(chance > NEGLIGIBLE * chance.max())
        information, scores = np.repeat(prior_information[None], chosen.size, axis=0), np.repeat(start[None], chosen.size, axis=0)
        _add(traces[0], information, scores, *_sums(traces[0], grids[0], chosen))
        return chance[chosen] / chance[chosen].sum(), information, scores
    whole, vector = prior_information.copy(), start.copy()
    likeliest = [_sums(t, g, np.array([g.chance.argmax()])) for t, g in zip(traces, grids, strict=True)]
    for t, (m, v) in zip(traces, likeliest, strict=True):
        _add(t, whole, vector, m[0], v[0])
    for k, t in enumerate(traces):  # each is asked again given the others
        m, v = likeliest[k]
        _add(t, whole, vector, -m[0], -v[0])
        most = grids[k].chance.sum(axis=1)
        grids[k] = _likely(t, whole, vector, grids[k].nodes[most > UNLIKELY * most.max()])
        m, v = _sums(t, grids[k], np.array([grids[k].chance.argmax()]))
        _add(t, whole, vector, m[0], v[0])
    rng = np.random.default_rng(17)
    information, scores = np.repeat(prior_information[None], DRAWS, axis=0), np.repeat(start[None], DRAWS, axis=0)
    for t, g in zip(traces, grids, strict=True):
        drawn = np.searchsorted(np.cumsum(g.chance.ravel()), (rng.permutation(DRAWS) + 0.5) / DRAWS)
        chosen, place = np.unique(np.minimum(drawn, g.chance.size - 1), return_inverse=True)
        m, v = _sums(t, g, chosen)
        _add(t, information, scores, m[place], v[place])
    return np.full(DRAWS, 1.0 / DRAWS), information, scores


def _add(t: _TraceBasis, information: Array, scores: Array, more: Array, pushed: Array) -> None:
    """Add what a trace says of the unknowns that act on it to information and scores of all of them, in place."""
    information[..., t.acting[:, None], t.acting] += more
    scores[..., t.acting] += pushed


def _sums(t: _TraceBasis, grid: _Grid, flat: Indices) -> tuple[Array, Array]:
    """Return X'V^-1 X (chosen, unknowns, unknowns) and X'V^-1 z (chosen, unknowns) of a trace at nodes and sizes of its grid.

    X are the slopes of what acts on it, z its residuals, V = variance (1 + ratio R). `flat` (chosen,) counts nodes and sizes in one.
    """
    of_node, of_size = np.divmod(flat, GRID_SIZES)
    used, place = np.unique(of_node, return_inverse=True)
    information, scores = [], []
    for node in grid.nodes[used]:
        at, ratio = divmod(int(node), GRID_RATIOS)
        taken = t.slopes[at].T * t.shrunk[at, ratio]
        information.append(taken @ t.slopes[at])
        scores.append(taken @ t.residuals[at])
    size = grid.variances[of_node, of_size]
    return np.array(information)[place] / size[:, None, None], np.array(scores)[place] / size[:, None]


def _likely(t: _TraceBasis, others: Array, vector: Array, nodes: Indices) -> _Grid:
    """Return the probability of the noise of a trace at the `nodes` of a grid of correlation times and ratios of correlated noise.

    For each node the white variance v runs over `GRID_SIZES` places about its likeliest, and the unknowns are integrated out, which gives
    ``-2 ln p = (q - sum c_k / (l_k + v)) / v + (n - m) ln v + sum ln(l_k + v) - ln|W|``. W whitens the n stretches, q = z'W z, l_k and c_k
    are the m eigenvalues of the information of the slopes and the squared scores along them. `others` and `vector` are information and
    scores of all that is known beside this trace: they say where the unknowns may stand.
    """
    sizes, vectors = np.linalg.eigh(others + ZERO_INFORMATION * np.eye(others.shape[0]))
    root = vectors / np.sqrt(np.maximum(sizes, ZERO_INFORMATION))
    middle, root = (root @ (root.T @ vector))[t.acting], root[t.acting]
    _, s, turn = np.linalg.svd(t.slopes[0] @ root, full_matrices=False)
    of_time, of_ratio = np.divmod(nodes, GRID_RATIOS)
    shrunk = t.shrunk[of_time, of_ratio]
    z = (t.residuals - t.slopes @ middle)[of_time]
    f = (t.slopes @ (root @ turn[s > MIN_SHIFT].T))[of_time]
    taken = shrunk[..., None] * f
    square = np.sum(shrunk * z**2, axis=1)
    spread, axes = np.linalg.eigh(np.swapaxes(f, 1, 2) @ taken)
    spread = np.maximum(spread, 0.0)
    part = (np.swapaxes(axes, 1, 2) @ (np.swapaxes(taken, 1, 2) @ z[..., None]))[..., 0] ** 2
    count = z.shape[1]
    variance = square / count
    for _ in range(6):  # the likeliest white variance of each node, by its own equation
        free = count - np.sum(spread / (spread + variance[:, None]), axis=1)
        squares_left = square - np.sum(part / (spread + variance[:, None]), axis=1)
        variance = np.maximum(squares_left, 1e-12 * square + 1e-300) / free
    width = np.sqrt(2.0 / max(float(free.mean()), 4.0))
    grid = variance[:, None] * np.exp(width * np.linspace(-2.4, 2.4, GRID_SIZES))
    beside = spread[:, None, :] + grid[..., None]
    quadratic = (square[:, None] - np.sum(part[:, None, :] / beside, axis=-1)) / grid
    volume = np.log(grid) * (count - spread.shape[1]) + np.log(beside).sum(axis=-1) - np.log(shrunk).sum(axis=1)[:, None]
    twice = -(quadratic + volume)
    chance = np.exp(0.5 * (twice - twice.max()))
    return _Grid(nodes, chance / chance.sum(), grid)
