"""Noise of traces as white noise plus an exponentially autocorrelated deviation: not one estimate, but all that the residuals allow."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from thermid.fit.uncertainty.wander import FEWEST, Binned, correlation

Array = NDArray[np.float64]

TIMES, RATIOS, SIZES = 9, 16, 7
"""Nodes of the grid: correlation times, ratios of the variances of both parts, variances of the white part."""
LARGEST, SMALLEST = 1e4, 0.05
"""Ratios of the variance of the autocorrelated part to that of the white part of the mean of a stretch."""
FLAT = 1e-9
"""Information, in parts of what white noise would give, that stands for none."""
SWEEPS, DRAWS = 1, 128
"""How often each trace is asked again given the others, and noise models that are drawn where there are several traces."""
NEGLIGIBLE, UNLIKELY, SMALL = 1e-3, 1e-5, 0.03
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
class _Trace:
    """A trace in the bases in which its covariance is diagonal, one basis per correlation time.

    `shrunk` (times, ratios, stretches) are the inverses of its variances, white noise alone being 1; `residuals` (times, stretches) and
    `slopes` (times, stretches, acting) stand in these bases, divided by the white error of the mean of a stretch, with a column for each
    unknown that acts on the trace at all; `acting` are their positions.
    """

    shrunk: Array
    residuals: Array
    slopes: Array
    acting: NDArray[np.intp]

    @classmethod
    def of(cls, b: Binned, scale: Array) -> _Trace:
        root = np.sqrt(b.count)
        sizes, vectors = _bases(b.times.tobytes(), b.count.tobytes())
        turned = np.swapaxes(vectors, 1, 2)
        shrunk = 1.0 / (1.0 + np.geomspace(SMALLEST, LARGEST, RATIOS)[:, None] * sizes[:, None, :])
        acting = np.flatnonzero(b.slopes.any(axis=0))
        slopes = root[:, None] * -b.slopes[:, acting] * scale[acting]
        return cls(shrunk, turned @ (root * b.mean), turned @ slopes, acting)


@dataclass(frozen=True, eq=False)
class _Grid:
    """Probability (nodes, sizes) of the noise of a trace at some nodes (time and ratio in one), and the white variances there."""

    nodes: NDArray[np.intp]
    chance: Array
    variances: Array


@lru_cache(maxsize=8)
def _bases(given: bytes, counts: bytes) -> tuple[Array, Array]:
    """Return eigenvalues (times, stretches) and eigenvectors of the correlations of a trace, for every correlation time.

    `given` are the times of its stretches and `counts` their samples: sensors of one log share them, and so do logs of one kind.
    """
    times, count = np.frombuffer(given), np.frombuffer(counts)
    spacing, span = float(np.median(np.diff(times))), float(times[-1] - times[0])
    tried = np.geomspace(spacing, max(span, 2.0 * spacing), TIMES)
    typical = float(np.median(count))
    root = np.sqrt(count / typical)
    ties = [correlation_of_means(times, max(round(typical), 1), spacing, time) for time in tried]
    sizes, vectors = np.linalg.eigh(np.array([root[:, None] * tie * root for tie in ties]))
    return np.maximum(sizes, 0.0), vectors


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
    long = [b for b in pieces if b.count.size >= FEWEST]
    traces = [_Trace.of(b, scale) for b in long]
    known, start = priors * np.outer(scale, scale), pulls * scale
    for b in (b for b in pieces if b.count.size < FEWEST):
        turned = b.slopes * scale
        known = known + turned.T @ (b.count[:, None] * turned) / level
        start = start - turned.T @ (b.count * b.mean) / level
    back = 1.0 / np.outer(scale, scale)
    if not traces:
        return Weighed(np.ones(1), (known * back - priors)[None], (start / scale - pulls)[None])
    weights, information, scores = _averaged(traces, known, start)
    return Weighed(weights, information * back - priors, scores / scale - pulls)


def _scales(pieces: Sequence[Binned], priors: Array) -> Array:
    """Return the standard error of every unknown alone, by white noise; of what nothing is said 1."""
    square = np.diag(priors) + sum((b.count @ b.slopes**2 for b in pieces), np.zeros(priors.shape[0]))
    return np.asarray(1.0 / np.sqrt(np.where(square > 0, square, 1.0)))


def _averaged(traces: Sequence[_Trace], known: Array, start: Array) -> tuple[Array, Array, Array]:
    """Return weights, information and scores of noise models of several traces."""
    grids = [_likely(t, known, start, np.arange(TIMES * RATIOS)) for t in traces]
    if len(traces) == 1:
        chance = grids[0].chance.ravel()
        kept = np.flatnonzero(chance > NEGLIGIBLE * chance.max())
        information, scores = np.repeat(known[None], kept.size, axis=0), np.repeat(start[None], kept.size, axis=0)
        _add(traces[0], information, scores, *_sums(traces[0], grids[0], kept))
        return chance[kept] / chance[kept].sum(), information, scores
    whole, vector = known.copy(), start.copy()
    likeliest = [_sums(t, g, np.array([g.chance.argmax()])) for t, g in zip(traces, grids, strict=True)]
    for t, (m, v) in zip(traces, likeliest, strict=True):
        _add(t, whole, vector, m[0], v[0])
    for _ in range(SWEEPS):
        for k, t in enumerate(traces):
            m, v = likeliest[k]
            _add(t, whole, vector, -m[0], -v[0])
            most = grids[k].chance.sum(axis=1)
            grids[k] = _likely(t, whole, vector, grids[k].nodes[most > UNLIKELY * most.max()])
            likeliest[k] = _sums(t, grids[k], np.array([grids[k].chance.argmax()]))
            _add(t, whole, vector, likeliest[k][0][0], likeliest[k][1][0])
    rng = np.random.default_rng(17)
    information, scores = np.repeat(known[None], DRAWS, axis=0), np.repeat(start[None], DRAWS, axis=0)
    for t, g in zip(traces, grids, strict=True):
        drawn = np.searchsorted(np.cumsum(g.chance.ravel()), (rng.permutation(DRAWS) + 0.5) / DRAWS)
        kept, place = np.unique(np.minimum(drawn, g.chance.size - 1), return_inverse=True)
        m, v = _sums(t, g, kept)
        _add(t, information, scores, m[place], v[place])
    return np.full(DRAWS, 1.0 / DRAWS), information, scores


def _add(t: _Trace, information: Array, scores: Array, more: Array, pushed: Array) -> None:
    """Add what a trace says of the unknowns that act on it to information and scores of all of them, in place."""
    information[..., t.acting[:, None], t.acting] += more
    scores[..., t.acting] += pushed


def _sums(t: _Trace, grid: _Grid, flat: NDArray[np.intp]) -> tuple[Array, Array]:
    """Return X'V^-1 X and X'V^-1 z of what acts on a trace at some nodes and sizes of its grid, counted in one."""
    of_node, of_size = np.divmod(flat, SIZES)
    used, place = np.unique(of_node, return_inverse=True)
    information, scores = [], []
    for node in grid.nodes[used]:
        at, ratio = divmod(int(node), RATIOS)
        taken = t.slopes[at].T * t.shrunk[at, ratio]
        information.append(taken @ t.slopes[at])
        scores.append(taken @ t.residuals[at])
    size = grid.variances[of_node, of_size]
    return np.array(information)[place] / size[:, None, None], np.array(scores)[place] / size[:, None]


def _likely(t: _Trace, others: Array, vector: Array, nodes: NDArray[np.intp]) -> _Grid:
    """Return the probability of the noise of a trace at some nodes.

    `others` and `vector` are information and scores of all that is known beside this trace: they say where the unknowns may stand.
    """
    sizes, vectors = np.linalg.eigh(others + FLAT * np.eye(others.shape[0]))
    root = vectors / np.sqrt(np.maximum(sizes, FLAT))
    middle, root = (root @ (root.T @ vector))[t.acting], root[t.acting]
    _, s, turn = np.linalg.svd(t.slopes[0] @ root, full_matrices=False)
    of_time, of_ratio = np.divmod(nodes, RATIOS)
    shrunk = t.shrunk[of_time, of_ratio]
    z = (t.residuals - t.slopes @ middle)[of_time]
    f = (t.slopes @ (root @ turn[s > SMALL].T))[of_time]
    taken = shrunk[..., None] * f
    square = np.sum(shrunk * z**2, axis=1)
    spread, axes = np.linalg.eigh(np.swapaxes(f, 1, 2) @ taken)
    spread = np.maximum(spread, 0.0)
    part = (np.swapaxes(axes, 1, 2) @ (np.swapaxes(taken, 1, 2) @ z[..., None]))[..., 0] ** 2
    count = z.shape[1]
    variance = square / count
    for _ in range(6):  # the likeliest white variance of each node, by its own equation
        free = count - np.sum(spread / (spread + variance[:, None]), axis=1)
        left = square - np.sum(part / (spread + variance[:, None]), axis=1)
        variance = np.maximum(left, 1e-12 * square + 1e-300) / free
    width = np.sqrt(2.0 / max(float(free.mean()), 4.0))
    grid = variance[:, None] * np.exp(width * np.linspace(-2.4, 2.4, SIZES))
    beside = spread[:, None, :] + grid[..., None]
    quadratic = (square[:, None] - np.sum(part[:, None, :] / beside, axis=-1)) / grid
    volume = np.log(grid) * (count - spread.shape[1]) + np.log(beside).sum(axis=-1) - np.log(shrunk).sum(axis=1)[:, None]
    twice = -(quadratic + volume)
    chance = np.exp(0.5 * (twice - twice.max()))
    return _Grid(nodes, chance / chance.sum(), grid)
