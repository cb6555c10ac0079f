"""Residuals that wander: how many independent samples a trace is worth, and how much its readings then say."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from thermid.fit.least_squares.solve import Fit, covariances
from thermid.fit.problem.residuals import Problem
from thermid.fit.problem.statistics import loss_of
from thermid.fit.uncertainty.noisy_inputs import excess_of_inputs

Array = NDArray[np.float64]

BINS = 80
"""A trace of more than twice as many samples is looked at in so many equal stretches of time; what ties neighbours within one together
shows as a larger scatter of their means."""
TIMES = 7
"""Correlation times that are tried, from one stretch to half the record."""
SURE = 5.0
"""Twice the logarithm of the likelihood ratio from which a trace is held to wander: a few white traces in a hundred would."""
OWN = 0.5
"""Share of what is known of a direction from which a trace is held to decide it alone."""
FEWEST = 12
"""Stretches beyond the unknowns, below which nothing can be said."""


@dataclass(frozen=True)
class Trace:
    """The residuals of one sensor in one record, as an independent part and one that wanders.

    Parameters
    ----------
    record, sensor : str
    samples : int
    own : float         Variance of the independent part, in squares of the noise; 0 where nothing wanders. [-]
    slow : float        Variance of the part that wanders, in squares of the noise. [-]
    time : float        Its correlation time. [s]
    effective : float   Independent samples that would say as much about a mean. [-]
    """

    record: str
    sensor: str
    samples: int
    own: float
    slow: float
    time: float
    effective: float


@dataclass(frozen=True, eq=False)
class Wander:
    """What the residuals of a fit say about themselves.

    Parameters
    ----------
    traces : tuple of Trace                 One per record and sensor.
    level : float                           Variance of the traces that do not wander, in squares of the noise, never below 1. [-]
    excess : array (unknowns, unknowns)     What wandering, and the noise of logged signals, adds to the covariance of J'r, over
                                            `level` times J'J; zeros where there is none.
    """

    traces: tuple[Trace, ...]
    level: float
    excess: Array

    @property
    def effective(self) -> dict[tuple[str, str], float]:
        """(record, sensor) -> effective samples."""
        return {(t.record, t.sensor): t.effective for t in self.traces}


@dataclass(frozen=True, eq=False)
class Binned:
    """A trace in stretches of time: means of the residuals, samples and derivatives in each, the variance inside them and its freedom.

    `share` is what a sample is worth by what is said of its noise.
    """

    mean: Array
    count: Array
    times: Array
    slopes: Array
    within: float
    inner: int
    squares: float
    share: float = 1.0


def wander(problem: Problem, found: Fit, loss: str = "linear", knee: float = 1.0) -> Wander:
    """Return how the residuals of a fit wander, and what that does to J'r.

    Each trace is split into equal stretches of time. The means of its residuals there are held to be the sum of what the unknowns can
    change, independent errors, and a part with correlations ``exp(-|t1 - t2| / time)``; the variances and the time have the largest
    restricted likelihood (Patterson and Thompson, Biometrika 58 (1971) 545), which does not take for quietness what the fit has removed:
    along directions in which this trace alone decides, its residuals say nothing; where other records or priors decide they do.
    Gaps need no care, since the times of the stretches are what they are. A trace that wanders no more than chance would adds nothing.
    """
    pieces = binned(problem, found.fitted, loss, knee)
    spread = wandering(pieces, found, problem.worth)
    return replace(spread, excess=spread.excess + excess_of_inputs(problem, found.fitted, pieces))


def wandering(pieces: Mapping[tuple[str, str], Binned], found: Fit, worth: float) -> Wander:
    """Return the same of traces in stretches of time, which are worth so many independent samples by what is said of their noise."""
    size = found.fitted.size
    weights = covariances(found)[2]
    root = _root(weights)
    # what a prior has decided already takes no freedom from the residuals: E(r'r) = n - tr(C J'J)
    taken = float(np.trace(np.where(np.isfinite(weights), weights, 0.0) @ found.jacobian.T @ found.jacobian))
    alike: dict[bytes, list[Array]] = {}  # sensors of one log share their stretches, and with them what is tried there
    parts = {key: _parts(b, root, alike) for key, b in pieces.items()}
    calm = [key for key, (own, _, _) in parts.items() if own == 0.0]
    level = 1.0
    if calm:
        squares, samples = sum(pieces[k].squares for k in calm), sum(float(pieces[k].count.sum()) * pieces[k].share for k in calm)
        if len(calm) == len(parts):
            squares = found.chi_square
        level = max(1.0, squares / max(samples * (1.0 - taken / max(worth, 1.0)), 1.0))
    traces, excess = [], np.zeros((size, size))
    for (record, sensor), (own, slow, time) in parts.items():
        b = pieces[record, sensor]
        total = float(b.count.sum())
        effective = total
        if own > 0.0:
            weighed = b.count[:, None] * b.slopes
            like = correlation(b.times, time)
            wandering = slow * weighed.T @ like @ weighed
            if b.share < 1.0:
                # the weights stand for correlated noise already; what residuals wander beyond that is added
                excess += _not_below_zero((own - level) * b.slopes.T @ weighed + wandering)
            else:
                excess += max(own - level, 0.0) * b.slopes.T @ weighed + wandering
            one = own if slow > 0.0 else b.within
            effective = total * min((one + slow) / (own + slow * float(b.count @ like @ b.count) / total), 1.0)
        traces.append(Trace(record, sensor, int(total), own, slow, time, effective))
    return Wander(tuple(traces), level, excess)


def binned(problem: Problem, fitted: Array, loss: str = "linear", knee: float = 1.0, bins: int = BINS) -> dict[tuple[str, str], Binned]:
    """Return (record, sensor) -> its residuals in so many stretches of time at most; a trace of up to 160 samples as it is."""
    out: dict[tuple[str, str], Binned] = {}
    blocks = iter(problem.blocks(fitted))
    for i, experiment in enumerate(problem.experiments):
        times = experiment.times
        own, count = times.size <= 2 * BINS, min(bins, times.size // 2)
        edges = times if own else np.linspace(times[0], times[-1], count + 1)[:-1]
        centres = times if own else edges + 0.5 * (times[-1] - times[0]) / count
        slopes = problem.slopes(i, fitted, centres)
        for k, o in enumerate(experiment.observations):
            block = next(blocks)
            z = block.residuals / o.sigma(problem.noise)
            counts = np.diff(np.append(np.searchsorted(times[o.index], edges), z.size))  # times rise
            place, held = np.repeat(np.arange(edges.size), counts), counts.astype(float)
            weighed = z if loss == "linear" else loss_of(z**2, loss, knee)[1] * z
            mean = np.bincount(place, weighed, minlength=edges.size) / np.maximum(held, 1.0)
            inside = weighed - np.repeat(mean, counts)
            full = held > 0
            spare = z.size - int(full.sum())
            within = float(inside @ inside) / max(spare, 1)
            squares = float(weighed @ z)
            out[block.record, o.sensor] = Binned(mean[full], held[full], centres[full], slopes[full, k, :], within, spare, squares, o.share)
    return out


def _not_below_zero(matrix: Array) -> Array:
    """Return a symmetric matrix without its negative directions."""
    sizes, vectors = np.linalg.eigh(0.5 * (matrix + matrix.T))
    return np.asarray((vectors * np.maximum(sizes, 0.0)) @ vectors.T)


def correlation(times: Array, time: float) -> Array:
    """Return the correlations (times, times) of what wanders with a correlation time [s]."""
    return np.asarray(np.exp(-np.abs(times[:, None] - times[None, :]) / time)) if time > 0 else np.eye(times.size)


def _root(covariance: Array) -> Array:
    """Return a root L of a covariance, ``L L'``; directions without information count as decided by each trace alone."""
    known = np.where(np.isfinite(covariance), covariance, 0.0)
    sizes, vectors = np.linalg.eigh(known) if known.size else (np.zeros(0), known)
    return np.asarray(vectors * np.sqrt(np.maximum(sizes, 0.0)))


def _parts(b: Binned, known: Array, alike: dict[bytes, list[Array]]) -> tuple[float, float, float]:
    """Return the variances of the independent and the wandering part of a trace, and the time of the latter; zeros where it is white.

    `alike` keeps the correlations that were tried on some stretches, for the next trace on the same ones.
    """
    root = np.sqrt(b.count)
    decided, free = _beside(root[:, None] * b.slopes @ known)
    spare = free.shape[1]
    if spare < FEWEST:
        return 0.0, 0.0, 0.0
    y = free.T @ (root * b.mean)
    calm = float(y @ y) / spare
    if not calm > 0:
        return 0.0, 0.0, 0.0
    spacing, span = float(np.median(np.diff(b.times))), float(b.times[-1] - b.times[0])
    times = np.geomspace(spacing, max(0.5 * span, 2.0 * spacing), TIMES)
    key = b.times.tobytes()
    if key not in alike:
        alike[key] = [correlation(b.times, time) for time in times]
    likes = [root[:, None] * like * root for like in alike[key]]
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
    gain, own, slow = tried.get(at, (0.0, 0.0, 0.0))
    time = float(times[at])
    if gain <= SURE:
        own, slow, time = calm, 0.0, 0.0
    # a filter, or steps of the sensor, tie neighbours within a stretch together: the means of stretches then scatter more than they should
    quick = b.inner > spare and own > b.within * (1.0 + 3.0 * np.sqrt(2.0 / spare + 2.0 / b.inner))
    return (own, slow, time) if slow > 0 or quick else (0.0, 0.0, 0.0)


def _likeliest(within: Array, y: Array, calm: float) -> tuple[float, float, float]:
    """Return twice the gain in log-likelihood of a wandering part with some correlations, and the variances of both parts."""
    sizes, vectors = np.linalg.eigh(within)
    sizes, parts = np.maximum(sizes, 0.0), (vectors.T @ y) ** 2
    ratios = np.geomspace(0.01 / sizes[-1], 1e4 / sizes.mean(), 60)
    variances = 1.0 + ratios[:, None] * sizes
    own = (parts / variances).mean(axis=1)
    gain = y.size * np.log(calm) - y.size * np.log(own) - np.log(variances).sum(axis=1)
    k = int(gain.argmax())
    return float(gain[k]), float(own[k]), float(ratios[k] * own[k])


def _leaning(likes: Sequence[Array], decided: Array, residuals: Array, calm: float) -> Array:
    """Return by how many standard deviations of chance residuals lean towards each of some correlations (score test for no wandering).

    `decided` (stretches, directions) is what the trace alone decides; correlations count beside it, and `residuals` have none of it.
    """
    out = np.zeros(len(likes))
    spare = decided.shape[0] - decided.shape[1]
    for k, like in enumerate(likes):
        across = like @ decided
        inside = decided.T @ across
        mean = (float(np.trace(like)) - float(np.trace(inside))) / spare
        square = float(np.sum(like**2)) - 2.0 * float(np.sum(across**2)) + float(np.sum(inside**2))
        spread = 2.0 * (square - spare * mean**2)
        excess = float(residuals @ like @ residuals) / calm - spare * mean
        out[k] = excess / np.sqrt(spread) if spread > 0 else np.inf * np.sign(excess)
    return out


def _beside(slopes: Array) -> tuple[Array, Array]:
    """Return orthonormal bases (stretches, directions) of what a trace alone decides, and of all that it does not.

    With `slopes` in units of standard errors of the whole fit, a singular value is the root of the trace's share in a direction.
    """
    if not slopes.size:
        return np.zeros((slopes.shape[0], 0)), np.eye(slopes.shape[0])
    basis, s, _ = np.linalg.svd(slopes, full_matrices=True)
    count = int((s**2 > OWN).sum())
    return np.asarray(basis[:, :count]), np.asarray(basis[:, count:])
