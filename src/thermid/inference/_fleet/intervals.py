"""Intervals of spreads and correlations by profiles of the restricted likelihood, and units that do not belong to the population.

All of it on the last linearisation: no log is simulated again.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.special import stdtrit

from thermid.base.linear_algebra import HALF_WIDTH_95, Array, square_root
from thermid.inference._fleet.population import Population, weigh

VANISHED = 1e-3
"""Growth of 2 ln R from a spread to zero, up to which it is said to be zero."""
TRIES, NEAR_ENOUGH = 10, 0.01
"""Fits on the way to one end, and how near its height must come, in standard errors."""
AT_MOST_ODD, MOST_REFITS = 0.05, 10
"""Probability of naming any unit of a fleet without odd ones; and how many units are left out in turn."""
EXTREME = 5.0
"""Farthest correlation tried, as its inverse hyperbolic tangent."""


class Interval(NamedTuple):
    """A 95 % interval in the fitted form, with its degrees of freedom."""

    low: float
    high: float
    freedom: float


class Odd(NamedTuple):
    """A unit that is apart from the others in one value.

    Parameters
    ----------
    unit, value : int       Positions.
    distance : float        Its deviation in standard deviations that it should have, the population fitted without it. [-]
    threshold : float       Which one unit of the whole fleet exceeds by chance in 5 % of fleets. [-]
    """

    unit: int
    value: int
    distance: float
    threshold: float


def interval_of_mean(population: Population, c: Array) -> Interval:
    """Return the interval of a combination c of coefficients, by Student's distribution."""
    freedom = population.freedom_of_mean(c)
    half = float(stdtrit(freedom, 0.975)) * math.sqrt(float(c @ population.at.spread @ c))
    middle = float(c @ population.at.beta)
    return Interval(middle - half, middle + half, freedom)


def interval_of_spread(population: Population, k: int) -> Interval:
    """Return the interval of a spread by its profile; from zero where zero is not rejected."""
    size, goal = float(population.sizes[k]), HALF_WIDTH_95**2
    to_zero = population.rise((k,), 0.0)[0]
    freedom = population.freedom_of_spread(k)
    if to_zero < VANISHED:
        step = math.sqrt(2.0 * goal) / np.sqrt(max(float(np.sum(population.at.weights[:, k, k] ** 2)), 1e-300))
        high = _end(lambda x, near: population.rise((k,), math.sqrt(x), near), step, goal**0.5)
        return Interval(0.0, math.sqrt(high), freedom)
    step = HALF_WIDTH_95 / math.sqrt(2.0 * max(freedom, 1.0))
    high = _end(lambda x, near: population.rise((k,), size * math.exp(x), near), step, goal**0.5)
    if to_zero <= goal:
        return Interval(0.0, size * math.exp(high), freedom)
    low = _end(lambda x, near: population.rise((k,), size * math.exp(-x), near), step, goal**0.5)
    return Interval(size * math.exp(-low), size * math.exp(high), freedom)


def interval_of_correlation(population: Population, j: int, k: int) -> Interval:
    """Return the interval of a correlation by its profile; all of -1 to 1 where a spread is zero."""
    sizes, goal = population.sizes, HALF_WIDTH_95
    freedom = min(population.freedom_of_spread(j), population.freedom_of_spread(k))
    if not (sizes[[j, k]] > 0.0).all() or abs(ratio := float(population.omega[j, k] / (sizes[j] * sizes[k]))) >= 1.0 - 1e-9:
        return Interval(-1.0, 1.0, freedom)
    middle = math.atanh(math.copysign(ratio, population.omega[j, k]))
    step = goal / math.sqrt(max(freedom - 2.0, 1.0))
    ends = [
        math.tanh(middle + sign * _end(_along(population, j, k, middle, sign), step, goal, EXTREME - sign * middle)) for sign in (-1.0, 1.0)
    ]
    return Interval(ends[0], ends[1], freedom)


def _along(population: Population, j: int, k: int, middle: float, sign: float) -> Callable[[float, Array | None], tuple[float, Array]]:
    return lambda x, near: population.rise((j, k), math.tanh(middle + sign * x), near)


def _end(rise: Callable[[float, Array | None], tuple[float, Array]], step: float, goal: float, most: float = 1e3) -> float:
    """Return the distance at which the root of a rise reaches a goal: secants, within what encloses it; at most `most`."""
    low, high, near = (0.0, 0.0), (math.inf, math.inf), None
    x = min(step, most)
    for _ in range(TRIES):
        rose, near = rise(x, near)
        there = x, math.sqrt(max(rose, 0.0))
        if abs(there[1] - goal) < NEAR_ENOUGH:
            break
        low, high = (there, high) if there[1] < goal else (low, there)
        if x >= most and there[1] < goal:
            return most
        if math.isinf(high[0]):
            x = min(x * min(max(goal / max(there[1], 1e-9), 1.05), 2.5), most)
        else:
            part = (goal - low[1]) / (high[1] - low[1])
            x = low[0] + (high[0] - low[0]) * min(max(part, 0.05), 0.95)
    return x


def distances(population: Population) -> Array:
    """Return how far each unit is from its mean in each value (units, values), in standard deviations, the other values considered.

    The score of a shift of one value of one unit: ``W_i (d_i - X_i beta)`` over its standard deviation.
    """
    errors = population.errors_of_pushes()
    return np.divide(population.at.pushes, errors, out=np.zeros_like(errors), where=errors > 1e-9 * errors.max(axis=0))


def odd_units(population: Population) -> list[Odd]:
    """Return the units that do not belong to the population, the farthest first.

    The farthest unit is left out, the population fitted without it, and the unit compared with that, in turn up to a tenth of the fleet
    (generalised extreme Studentised deviate: Rosner, Technometrics 25 (1983) 165). The last that exceeds the threshold and all before it
    are odd. The threshold is Student's with the degrees of freedom of the spread, for units times values tries (Bonferroni).
    """
    said, (count, size) = population.said, population.said.score.shape
    gone: list[int] = []
    tried: list[Odd] = []
    now = population
    while len(gone) < min(MOST_REFITS, max(count // 10, 1)) and count - len(gone) > 3:
        left = np.setdiff1d(np.arange(count), gone)
        place = np.unravel_index(int(np.argmax(np.abs(distances(now)))), (left.size, size))
        unit, k = int(left[place[0]]), int(place[1])
        gone.append(unit)
        now = population.without(gone)
        _, _, weights, pushed = weigh(said.information[[unit]], said.score[[unit]], square_root(now.omega))
        carried = weights[0] @ said.design[unit]
        push = pushed[0] - carried @ now.at.beta
        wide = weights[0] + carried @ now.at.spread @ carried.T
        freedom = max(now.freedom_of_spread(k) - (now.together[k].sum() - 1.0), 1.0)
        threshold = -float(stdtrit(freedom, AT_MOST_ODD / (2.0 * left.size * size)))
        tried.append(Odd(unit, k, float(push[k] / math.sqrt(wide[k, k])), threshold))
        if len(tried) > 1 and not any(abs(t.distance) > t.threshold for t in tried[-2:]):
            break
    last = max((n for n, t in enumerate(tried, 1) if abs(t.distance) > t.threshold), default=0)
    return sorted(tried[:last], key=lambda t: -abs(t.distance) / t.threshold)

