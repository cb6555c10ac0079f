"""When limits are passed first, and what the number of members leaves open of a time or a share; times in words."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from thermid.simulation.solver.extremes import MemberTurnings

Array = NDArray[np.float64]
MONTE_CARLO = 0.95
"""Two-sided probability of the intervals that say what the number of members leaves open. [-]"""


def first_crossings(times: Array, above: Array, turnings: MemberTurnings | None = None) -> Array:
    """Return when each member is above zero first, on straight lines between what is known; infinite where never. [s]

    Parameters
    ----------
    times : array (times,)              [s]
    above : array (members, times)      Samples.
    turnings : MemberTurnings           Turning points between them, in the same measure; a peak between two samples counts.
    """
    over = above > 0.0
    k = over.argmax(axis=1)
    out = np.where(over.any(axis=1), times[k], np.inf)
    rows = np.flatnonzero(np.isfinite(out) & (k > 0))
    before, after = above[rows, k[rows] - 1], above[rows, k[rows]]
    out[rows] = times[k[rows] - 1] + (times[k[rows]] - times[k[rows] - 1]) * (-before) / (after - before)
    if turnings is None:
        return np.asarray(out)
    peaks = np.flatnonzero(turnings.kelvin > 0.0)
    members, first = np.unique(turnings.members[peaks], return_index=True)
    first = peaks[first]  # the first turning point above zero of each member that has one
    last = np.where(over[members].any(axis=1), times[k[members]], np.inf)
    early = turnings.times[first] < last
    for member, point in zip(members[early].tolist(), first[early].tolist(), strict=True):
        time, high = float(turnings.times[point]), float(turnings.kelvin[point])
        sample = int(np.searchsorted(times, time)) - 1  # all samples before are below
        known = [(float(times[sample]), float(above[member, sample]))] if sample >= 0 else []
        if point and turnings.members[point - 1] == member:
            known.append((float(turnings.times[point - 1]), float(turnings.kelvin[point - 1])))
        start, low = max(known, default=(time, high))
        out[member] = time if low >= high else start + (time - start) * (-low) / (high - low)
    return np.asarray(out)


def hold_time(crossings: Array, confidence: float) -> tuple[float, tuple[float, float]]:
    """Return the time until which a share of the members keeps its limit, and its interval from order statistics. [s]"""
    from scipy.special import bdtr

    ordered, n, p = np.sort(crossings), crossings.size, 1.0 - confidence
    rank = max(math.floor(p * n + 1e-9), 1)
    below = bdtr(np.arange(n + 1, dtype=float), n, p)  # chance that at most so many members are before the true quantile
    low, high = (int(np.searchsorted(below, 0.5 * (1.0 + side * MONTE_CARLO))) for side in (-1.0, 1.0))
    return float(ordered[rank - 1]), (float(ordered[max(low, 1) - 1]), float(ordered[min(high + 1, n) - 1]))


def proportion(hits: int, members: int) -> tuple[float, float]:
    """Return the interval of a probability of which so many hits were seen (Clopper and Pearson). [-]"""
    from scipy.special import betaincinv

    tail = (1.0 - MONTE_CARLO) / 2.0
    low = float(betaincinv(hits, members - hits + 1, tail)) if hits else 0.0
    high = float(betaincinv(hits + 1, members - hits, 1.0 - tail)) if hits < members else 1.0
    return low, high


def clock(seconds: float) -> str:
    """Return a time in hours and whole minutes, rounded down: 3 h 10 min.

    >>> clock(11459.0), clock(540.0)
    ('3 h 10 min', '9 min')
    """
    if math.isinf(seconds):
        return "beyond the scenario"
    minutes = int(seconds // 60)
    hours, rest = divmod(minutes, 60)
    return f"{hours} h {rest} min" if hours else f"{rest} min"
