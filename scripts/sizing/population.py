"""The population over sets: for each size the scale of a half-t with four degrees of freedom from which the sets' sizes came.

Why so: (1) most sets bound a size from above only, and a half-t has its mode at zero, where a distribution of logarithms needs a floor
that no reading gives; (2) its tail lets an odd set be odd, whose size the model of error would refuse by `FAR_SIZE`, without moving the
others; (3) its scale has a log-t prior about the first prior, so that few sets move it little; (4) classes of conductors share what they
have in common, each with an offset known to a factor of two; (5) what ships is the median of the scale, as the scale of the half-normal
that the model averages over, with its limits beside it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp
from scipy.stats import t

from .likelihood import FIRST, GRID

Array = np.ndarray
SCALES = np.linspace(np.log(0.02), np.log(50.0), 161)
"""Logarithms of the scale over the first prior."""
FREEDOM, SPREAD, OFFSET = 4.0, np.log(3.0), np.log(2.0)
"""Degrees of freedom of the population and of the prior of its scale, scale of the latter, standard deviation of a class about it."""
POOLED = ("surface", "joint", "law")
"""Classes that share a departure."""
Likelihoods = Mapping[str, Mapping[str, Sequence[float]]]
"""Set -> size -> ln of its likelihood over the grid."""


@dataclass(frozen=True)
class Scale:
    """What sets say of a size.

    Parameters
    ----------
    value : float       Median of the scale.
    low, high : float   Ends of the 90 % interval of the scale.
    sets : int          Sets that have it.
    """

    value: float
    low: float
    high: float
    sets: int


def of_scales(logs: Sequence[float]) -> Array:
    """Return ln of the likelihood (scales,) of the scale of the population, from that of one set's size over the grid."""
    fine, scale = np.linspace(np.log(GRID[0]), np.log(GRID[-1]), 301), np.exp(SCALES)
    told, size = np.exp(np.interp(fine, np.log(GRID), logs)), np.exp(fine)
    inside = 2.0 * t.pdf(size / scale[:, None], FREEDOM) * size / scale[:, None]
    least = 2.0 * t.cdf(GRID[0] / scale, FREEDOM) - 1.0  # whatever lies below the grid is as likely as its least
    return np.asarray(np.log(inside @ told * (fine[1] - fine[0]) + least * told[0]))


def _t(x: Array) -> Array:
    """Return ln of the prior (scales,) of what all sets have, but for a constant."""
    return -0.5 * (FREEDOM + 1.0) * np.log1p((x / SPREAD) ** 2 / FREEDOM)


def scales(found: Likelihoods) -> dict[str, Scale]:
    """Return size -> what sets say of it."""
    own = {g: [of_scales(of[g]) for of in found.values() if g in of] for g in FIRST}
    told = {g: np.sum(several, axis=0) if several else np.zeros(SCALES.size) for g, several in own.items()}
    out = {}
    offset = -0.5 * ((SCALES[:, None] - SCALES) / OFFSET) ** 2  # (common, class)
    offset -= logsumexp(offset, axis=1, keepdims=True)
    classes = {g: logsumexp(offset + told[g], axis=1) for g in POOLED}
    for g in FIRST:
        if g in POOLED:
            common = _t(SCALES) + sum(classes[other] for other in POOLED if other != g)
            logs = logsumexp(common[:, None] + offset, axis=0) + told[g]
        else:
            logs = _t(SCALES) + told[g]
        out[g] = _scale(FIRST[g], logs, len(own[g]))
    return out


def _scale(first: float, logs: Array, sets: int) -> Scale:
    shares = np.exp(logs - logsumexp(logs))
    low, middle, high = first * np.exp(np.interp([0.05, 0.5, 0.95], shares.cumsum(), SCALES))
    return Scale(float(middle), float(low), float(high), sets)


def rounded(number: float) -> float:
    """Return a number to two digits."""
    return float(f"{number:.2g}")
