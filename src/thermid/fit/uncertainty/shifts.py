"""Whether data contradict values that are known from elsewhere: a test on matrices that states which shift it would find."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thermid.fit.uncertainty.trace_noise import Weighed

Array = NDArray[np.float64]

ALPHA, POWER = 0.05, 0.9
"""Chance of calling a value moved that did not, and of finding the shift that is stated as detectable."""
SILENT = 1e-10
"""Information, in parts of what the value was known with or of white noise, that counts as none."""


@dataclass(frozen=True)
class Shift:
    """One value by the data alone, against what was known of it; in the fitted form.

    Parameters
    ----------
    size : float            Value by the data alone less that known; NaN where the data say nothing of it.
    error : float           Standard error of `size`.
    chance : float          Of a shift at least so large either way when nothing moved, over all values tested (Holm).
    detectable : float      Shift that is found with 90 % power.
    """

    size: float
    error: float
    chance: float
    detectable: float


@dataclass(frozen=True)
class Together:
    """Several values opened at once: chi-square, directions of which the data say anything, chance when nothing moved."""

    chi_square: float
    directions: int
    chance: float


@dataclass(frozen=True, eq=False)
class Test:
    """What data say of values that are known from elsewhere, everything else that is free marginalised.

    Parameters
    ----------
    weights : array (models,)                       Probability of each noise model.
    information : array (models, known, known)      Of the known values, by the data alone.
    scores : array (models, known)                  Where they stand as known.
    root : array (known, columns)                   A root of the covariance with which they are known, with as few columns as it has.
    """

    weights: Array
    information: Array
    scores: Array
    root: Array

    @classmethod
    def of(cls, data: Weighed, priors: Array, pulls: Array, known: Sequence[int], root: Array) -> Test:
        """Return the test of some of the unknowns of a fit.

        Parameters
        ----------
        data : Weighed                          What the data say of all unknowns, where the known ones stand as they are known.
        priors : array (unknowns, unknowns)     Information that there is beside the data, of the other unknowns.
        pulls : array (unknowns,)               Its scores there.
        known : sequence of int                 Positions of the known values among the unknowns.
        root : array (known, sources)           Root of the covariance with which they are known.
        """
        at = list(known)
        rest = [k for k in range(priors.shape[0]) if k not in set(at)]
        whole, vector = data.information + priors, data.scores + pulls
        size = np.sqrt(np.maximum(np.diagonal(whole, axis1=1, axis2=2).max(axis=0), 1e-300))[rest]
        inner = whole[:, rest][:, :, rest] / np.outer(size, size) + 1e-12 * np.eye(len(rest))
        across = whole[:, rest][:, :, at] / size[:, None]
        solved = np.linalg.solve(inner, np.concatenate([across, (vector[:, rest] / size)[..., None]], axis=2))
        turned = np.swapaxes(across, 1, 2)
        information = whole[:, at][:, :, at] - turned @ solved[..., :-1]
        sizes, vectors = np.linalg.eigh(root @ root.T)
        short = vectors * np.sqrt(np.maximum(sizes, 0.0))
        return cls(data.weights, information, vector[:, at] - (turned @ solved[..., -1:])[..., 0], short[:, sizes > 0])


def _opened(a: Test, chosen: Sequence[int], loose: Sequence[int]) -> tuple[Array, Array, Array]:
    """Return scores T, information I and covariance of T, of values opened together; those in `loose` are free besides.

    The other values stand where they were known, with their covariance ``root root'``. The data alone put the opened values I^-1 T off.
    What the values were known with adds ``I root root' I``, less what the errors of the others, through the data, have in common with it.
    """
    others = [k for k in range(len(a.root)) if k not in {*chosen, *loose}]
    inside, sources = list(chosen), a.root.shape[1]
    known_with = np.zeros_like(a.root)
    known_with[others] = a.root[others]
    columns = np.concatenate([known_with, np.eye(len(a.root))[:, list(loose)]], axis=1)
    known = np.diag([1.0] * sources + [0.0] * len(loose))
    inner = columns.T @ a.information @ columns + known
    inner = inner + 1e-12 * np.eye(len(known)) * np.trace(inner, axis1=1, axis2=2)[:, None, None]
    across = columns.T @ a.information[:, :, inside]
    pushed = (a.scores @ columns)[..., None]
    solved = np.linalg.solve(inner, np.concatenate([across, pushed], axis=2))
    turned = np.swapaxes(across, 1, 2)
    information = a.information[:, inside][:, :, inside] - turned @ solved[..., :-1]
    scores = a.scores[:, inside] - (turned @ solved[..., -1:])[..., 0]
    own = a.root[inside]
    common = information @ own @ solved[:, :sources, :-1]
    spread = information + information @ own @ own.T @ information + common + np.swapaxes(common, 1, 2)
    return scores, information, spread


def _one(a: Test, k: int, loose: Sequence[int]) -> tuple[Array, Array]:
    """Return the shift of one value and its standard error, by each noise model."""
    scores, information, spread = _opened(a, [k], loose)
    seen = information[:, 0, 0]
    told = seen > SILENT * np.maximum(a.information[:, k, k], 1e-300)
    safe = np.where(told, seen, 1.0)
    return np.where(told, scores[:, 0] / safe, 0.0), np.where(told, np.sqrt(np.maximum(spread[:, 0, 0], 0.0)) / safe, np.inf)


def _chance(weights: Array, sizes: Array, errors: Array) -> float:
    """Return 2 min(P(d > 0), P(d < 0)) of a shift d that has a normal distribution by each noise model."""
    from scipy.special import ndtr

    above = float(weights @ ndtr(sizes / errors))
    return min(1.0, 2.0 * min(above, 1.0 - above))


def _quantile(weights: Array, errors: Array, chance: float) -> float:
    """Return what a sum of centred normal distributions exceeds with a chance."""
    from scipy.special import ndtr

    if not np.isfinite(errors[weights > 0]).all():
        return math.inf
    low, high = 0.0, 40.0 * float(errors.max())
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if float(weights @ ndtr(-middle / errors)) > chance else (low, middle)
    return high


def _found_with(weights: Array, errors: Array, tests: int) -> float:
    """Return the shift that the first of so many tests finds with 90 % power."""
    return _quantile(weights, errors, 0.5 * ALPHA / max(tests, 1)) + _quantile(weights, errors, 1.0 - POWER)


def holm(chances: Sequence[float]) -> list[float]:
    """Return chances corrected for how many there are (S. Holm, Scandinavian Journal of Statistics 6 (1979) 65)."""
    out, worst = [math.nan] * len(chances), 0.0
    order = sorted((k for k, p in enumerate(chances) if math.isfinite(p)), key=lambda k: chances[k])
    for rank, k in enumerate(order):
        worst = max(worst, min(1.0, (len(order) - rank) * chances[k]))
        out[k] = worst
    return out


def shifts(a: Test, asked: Sequence[int]) -> list[Shift]:
    """Return how far data move values that are known from elsewhere, one by one; `asked` are their positions in the test.

    Each value is opened alone, and the other known values stand as known, with their covariance. Once a value has moved it is opened too,
    and the rest is asked again: else what it did would be found in its neighbours.
    """
    left = list(asked)
    count, moved = len(left), list[int]()
    out: dict[int, Shift] = {}
    while left:
        found = {k: _one(a, k, moved) for k in left}
        chances = {k: _chance(a.weights, *one) for k, one in found.items()}
        corrected = dict(zip(left, holm(list(chances.values())), strict=True))
        first = min(left, key=chances.__getitem__)
        leave = [first] if corrected[first] < ALPHA else left
        out |= {k: _shift(a.weights, *found[k], corrected[k], count) for k in leave}
        moved, left = [*moved, first], [k for k in left if k not in leave]
    return [out[k] for k in asked]


def _shift(weights: Array, sizes: Array, errors: Array, chance: float, tests: int) -> Shift:
    if not np.isfinite(errors[weights > 0]).all():
        return Shift(math.nan, math.inf, math.nan, math.inf)
    size = float(weights @ sizes)
    wide = np.sqrt(errors**2 + (sizes - size) ** 2)
    return Shift(size, float(np.sqrt(weights @ wide**2)), chance, _found_with(weights, wide, tests))


def estimate(data: Weighed, priors: Array, pulls: Array, known: Sequence[int], root: Array, moved: Sequence[int]) -> Array:
    """Return how far all unknowns are from where the data were taken, on average over the noise; values that `moved` are free."""
    held = np.zeros((priors.shape[0], root.shape[1]))
    kept = [k for k in range(len(known)) if k not in moved]
    held[[known[k] for k in kept]] = root[kept]
    free = [k for k in range(priors.shape[0]) if k not in set(known)] + [known[k] for k in moved]
    columns = np.concatenate([held, np.eye(priors.shape[0])[:, free]], axis=1)
    whole = np.einsum("m,mij->ij", data.weights, data.information) + priors
    inner = columns.T @ whole @ columns + np.diag([1.0] * root.shape[1] + [0.0] * len(free))
    scale = 1.0 / np.sqrt(np.maximum(np.diag(inner), 1e-300))
    vector = columns.T @ (data.weights @ data.scores + pulls)
    solved = np.linalg.lstsq(inner * np.outer(scale, scale), scale * vector, rcond=1e-12)[0]
    return np.asarray(columns @ (scale * solved))


def normal_shifts(sizes: Array, errors: Array) -> list[Shift]:
    """Return the same of shifts whose standard errors are known already."""
    one = np.ones(1)
    told = [math.isfinite(e) and e > 0 for e in errors]
    chances = holm([_chance(one, np.array([d]), np.array([e])) if t else math.nan for d, e, t in zip(sizes, errors, told, strict=True)])
    rows = zip(sizes, errors, chances, told, strict=True)
    return [
        Shift(float(d), float(e), p, _found_with(one, np.array([e]), len(told))) if t else Shift(math.nan, math.inf, math.nan, math.inf)
        for d, e, p, t in rows
    ]


def together(a: Test, groups: Sequence[Sequence[int]], moved: Sequence[int] = ()) -> list[Together]:
    """Return the same of groups of values opened at once; others that `moved` are free besides."""
    return [_chi_square(a.weights, *_opened(a, group, [k for k in moved if k not in group])[::2]) for group in groups]


def normal_together(sizes: Array, covariance: Array) -> Together:
    """Return the same of shifts whose covariance is known already."""
    return _chi_square(np.ones(1), sizes[None], covariance[None])


def _chi_square(weights: Array, scores: Array, spread: Array) -> Together:
    """Return the test of scores (models, values) that have these covariances by each noise model."""
    from scipy.stats import chi2

    size = np.sqrt(np.maximum(np.diagonal(spread, axis1=1, axis2=2), 1e-300))
    sizes, vectors = np.linalg.eigh(spread / size[:, :, None] / size[:, None, :])
    kept = (sizes > 1e-6 * sizes[:, -1:]) & (sizes > 0)
    along = np.einsum("mgr,mg->mr", vectors, scores / size) ** 2
    square = np.sum(np.where(kept, along / np.where(kept, sizes, 1.0), 0.0), axis=1)
    directions = int(np.median(kept.sum(axis=1)))
    chance = float(weights @ chi2.sf(square, kept.sum(axis=1)))
    return Together(float(chi2.isf(max(chance, 1e-300), directions)), directions, chance)
