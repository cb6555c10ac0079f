"""The population over sets: for each size the half-normal from which the sets' sizes came, as the model of error takes its sizes.

Why half-normals, and not log-t: (1) the model averages sizes over half-normals, so what is learned is what predicts; (2) most sets bound a
size from above only, and a half-normal has its mode at zero, where a distribution of logarithms needs a floor that no reading gives; (3)
its scale has a log-t prior of four degrees of freedom about the first prior, so few sets move it little and one odd set cannot move it
alone; (4) classes of conductors share what they have in common, each with an offset that is known to a factor of two; (5) what ships is
the median of the scale, which a class without a set of its own has from the others, with its limits beside it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import erf, logsumexp

from .likelihood import FIRST, GRID

Array = np.ndarray
SCALES = np.linspace(np.log(0.02), np.log(50.0), 161)
"""Logarithms of the scale of a half-normal over its first prior."""
FREEDOM, SPREAD, OFFSET = 4.0, np.log(3.0), np.log(2.0)
"""Degrees of freedom and scale of the prior of what all sets have, and standard deviation of a class about it."""
POOLED = ("surface", "joint", "law")
"""Classes that share a departure."""
Likelihoods = Mapping[str, Mapping[str, Sequence[float]]]
"""Set -> size -> ln of its likelihood over the grid."""


@dataclass(frozen=True)
class Scale:
    """What sets say of a size.

    Parameters
    ----------
    value : float       Median of the scale of the half-normal.
    low, high : float   Ends of the 90 % interval of the scale.
    sets : int          Sets that have it.
    """

    value: float
    low: float
    high: float
    sets: int


def of_scales(logs: Sequence[float]) -> Array:
    """Return ln of the likelihood (scales,) of the scale of a half-normal, from that of one set's size over the grid."""
    fine = np.linspace(np.log(GRID[0]), np.log(GRID[-1]), 301)
    told, size = np.interp(fine, np.log(GRID), logs), np.exp(fine)
    inside = np.sqrt(2.0 / np.pi) * size / np.exp(SCALES)[:, None] * np.exp(-0.5 * (size / np.exp(SCALES)[:, None]) ** 2)
    least = erf(GRID[0] / np.exp(SCALES) / np.sqrt(2.0))  # whatever lies below the grid is as likely as its least
    return np.asarray(np.log(inside @ np.exp(told) * (fine[1] - fine[0]) + least * np.exp(told[0])))


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
