"""Extremes of a course of temperature: turning points between stored samples, the highest and the lowest, and when."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thermid.model.signal import Constant, Signal, Sine
from thermid.physics.constants import ICE_POINT

__all__ = ["Dense", "Extreme", "Turnings", "by_column", "first_above", "signal_turnings"]

Array = NDArray[np.float64]
POINTS = 65
"""Points at which a course is looked at again between two that enclose a crossing."""
ROUNDS = 3
"""How often: an interval is divided by 64 each time."""


@dataclass(frozen=True)
class Extreme:
    """The highest or the lowest temperature of a course.

    Parameters
    ----------
    kelvin : float      [K]
    time : float        When it is reached first. [s]
    tracked : bool      Whether the integrator followed the course between samples; otherwise it is the extreme of the samples.
    """

    kelvin: float
    time: float
    tracked: bool

    @property
    def celsius(self) -> float:
        """The temperature. [degC]"""
        return self.kelvin - ICE_POINT


@dataclass(frozen=True, eq=False)
class Turnings:
    """Turning points of one course: of every interval between two samples the highest and the lowest.

    Parameters
    ----------
    times : array (points,)     In order. [s]
    kelvin : array (points,)    [K]
    """

    times: Array
    kelvin: Array

    def beside(self, times: Array, kelvin: Array) -> tuple[Array, Array]:
        """Return samples (times,) with the turning points among them: times [s] and temperatures [K]."""
        if not self.times.size:
            return times, kelvin
        new = ~np.isin(self.times, times)
        joined = np.concatenate((times, self.times[new])), np.concatenate((kelvin, self.kelvin[new]))
        order = np.argsort(joined[0], kind="stable")
        return joined[0][order], joined[1][order]


@dataclass(frozen=True, eq=False)
class Dense:
    """The course of one node at any time of a run, by the integrator's own dense output.

    Parameters
    ----------
    kelvin : callable           Increasing times (times,) [s] -> temperatures (times,) [K]; the run is made again for them.
    switches : array (n,)       When inputs jump and thermostats switch. [s]
    """

    kelvin: Callable[[Array], Array]
    switches: Array


def first_above(times: Array, above: Array, dense: Callable[[Array], Array] | None = None, switches: Array | None = None) -> float | None:
    """Return when a course is above zero first; None where never. [s]

    Parameters
    ----------
    times, above : array (points,)  Samples and turning points, in order.
    dense : callable                Increasing times -> the course, where it can be had; straight lines between points otherwise.
    switches : array                Instants at which the course may bend.
    """
    over = np.flatnonzero(above > 0.0)
    if not over.size:
        return None
    k = int(over[0])
    if k == 0:
        return float(times[0])
    for _ in range(ROUNDS if dense is not None else 0):
        low, high = float(times[k - 1]), float(times[k])
        grid = np.linspace(low, high, POINTS)
        if switches is not None:
            grid = np.unique(np.concatenate((grid, switches[(switches > low) & (switches < high)])))
        if dense is None or grid.size < 3 or high - low <= 1e-9 * max(1.0, high):
            break
        again = np.concatenate((above[k - 1 : k], dense(grid[1:-1]), above[k : k + 1]))
        times, above, k = grid, again, int(np.flatnonzero(again > 0.0)[0])
        if k == 0:
            return float(times[0])
    low, high = above[k - 1], above[k]
    return float(times[k - 1] - low / (high - low) * (times[k] - times[k - 1]))


def by_column(columns: NDArray[np.int32], times: Array, kelvin: Array, count: int) -> tuple[Turnings, ...]:
    """Return the turning points of each of `count` columns, from those of all (points,): column, time [s] and temperature [K]."""
    order = np.lexsort((times, columns))
    ends = np.searchsorted(columns[order], np.arange(count + 1))
    times, kelvin = times[order], kelvin[order]
    return tuple(Turnings(times[i:j], kelvin[i:j]) for i, j in zip(ends[:-1], ends[1:], strict=True))


def signal_turnings(given: Signal, end: float, offset: float) -> Turnings:
    """Return the turning points of a boundary from zero to `end` [s]: knots where its signal turns, and those of a sine.

    Parameters
    ----------
    given : Signal      [K]
    end : float         [s]
    offset : float      A constant beside it. [K]
    """
    if isinstance(given, Constant):
        return Turnings(np.zeros(0), np.zeros(0))
    if isinstance(given, Sine):
        first = (0.25 - given.phase / (2.0 * np.pi)) % 0.5
        times = given.period * np.arange(first, end / given.period, 0.5)
    else:
        steps = np.sign(np.diff(given.values))
        turns = np.concatenate(([True], steps[1:] * steps[:-1] <= 0.0, [True])) if steps.size else np.ones(1, dtype=bool)
        times = given.times[turns]
        times = times[(times >= 0.0) & (times <= end)]
    return Turnings(times, given.at(times) + offset)
