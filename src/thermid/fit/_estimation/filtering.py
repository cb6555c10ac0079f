"""Kalman filter and Rauch-Tung-Striebel smoother in square-root form, over several members (sets of values) at once.

Covariances are held as roots, ``P = L L'``, so that none can lose its sign: the time step is one QR of [F L, root of Q] (Kailath, Sayed
and Hassibi, Linear Estimation, 2000, chapter 12), a reading is one Potter update (Bierman, Factorization Methods, 1977, chapter 2), and the
smoother is the square-root form of Rauch, Tung and Striebel (AIAA J. 3 (1965) 1445).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from thermid.base.units import Array
from thermid.fit._estimation.steps import lower
from thermid.fit._problem.residuals import SensorStatistics, Sums
from thermid.measure.records import effective_samples


class ReadingRow(NamedTuple):
    """One reading y = H x + v: column of its sensor, y less known inputs (members,) [K], H (members, states), sd of v (members,) [K]."""

    sensor: int
    value: Array
    row: Array
    noise: Array


class Belief(NamedTuple):
    """Mean x (members, states) [K] and root L of the covariance P = L L' (members, states, states) of the state."""

    mean: Array
    root: Array

    @property
    def variance(self) -> Array:
        """Diagonal of the covariance (members, states). [K^2]"""
        return np.asarray(np.sum(self.root**2, axis=2))


@dataclass(frozen=True, eq=False)
class Innovations:
    """Innovations of a filter: readings less their one-step forecasts, in order.

    Parameters
    ----------
    sensors : array (readings,)             Column of the sensor.
    times : array (readings,)               [s]
    errors : array (readings, members)      Reading less its forecast. [K]
    variances : array (readings, members)   Variance of the innovation, forecast and noise together. [K^2]
    """

    sensors: Array
    times: Array
    errors: Array
    variances: Array

    @property
    def loss(self) -> Array:
        """Minus the logarithm of the likelihood (members,). [-]"""
        return np.asarray(0.5 * np.sum(self.errors**2 / self.variances + np.log(math.tau * self.variances), axis=0))

    @property
    def standard(self) -> Array:
        """Innovations in units of their standard deviations (readings, members). [-]"""
        return np.asarray(self.errors / np.sqrt(self.variances))


def time_update(belief: Belief, transition: Array, mean: Array, noise: Array) -> Belief:
    """Return the belief after a time step, its new mean given: P+ = F P F' + Q, the root by one QR of [F L, root of Q].

    `transition` is F and `noise` the root of Q, both (members, states, states).
    """
    return Belief(mean, lower(np.concatenate([transition @ belief.root, noise], axis=2)))


class Gain(NamedTuple):
    """Kalman gain K (members, states) [-] and variance S of the innovation (members,) [K^2]."""

    gain: Array
    variance: Array


def measurement_update(belief: Belief, reading: ReadingRow) -> tuple[Belief, Array, Gain]:
    """Return the belief after one reading, the innovation (members,) [K] and the gain, by Potter's update.

    With f = L' H' and S = f' f + r^2, r the noise: K = L f / S, x+ = x + K (y - H x), L+ = L - K f' / (1 + r / sqrt(S)).
    """
    spread_of_reading = np.einsum("mij,mi->mj", belief.root, reading.row)
    variance = np.einsum("mj,mj->m", spread_of_reading, spread_of_reading) + reading.noise**2
    gain = np.einsum("mij,mj->mi", belief.root, spread_of_reading) / variance[:, None]
    share = 1.0 / (1.0 + reading.noise / np.sqrt(variance))
    root = belief.root - share[:, None, None] * gain[:, :, None] * spread_of_reading[:, None, :]
    error = reading.value - np.einsum("mi,mi->m", reading.row, belief.mean)
    return Belief(belief.mean + gain * error[:, None], root), error, Gain(gain, variance)


class FilterStep(NamedTuple):
    """A time step that the filter took: transition F, root of the noise Q, the belief before and the mean after it."""

    transition: Array
    noise: Array
    before: Belief
    after: Array


def smoothed(last: Belief, legs: Sequence[FilterStep]) -> list[Belief]:
    """Return the smoothed beliefs before every step and at the end, in order of time, from the last filtered one backwards.

    Per step: C = P F' (F P F' + Q)^-1, x_s = x + C (x_s+ - F x) and P_s = P + C (P_s+ - (F P F' + Q)) C' (Rauch, Tung and Striebel).
    """
    out = [last]
    for leg in reversed(legs):
        out.append(_smoothing_step(leg, out[-1]))
    return out[::-1]


def _smoothing_step(leg: FilterStep, later: Belief) -> Belief:
    """Return the smoothed belief before a step from the smoothed one after it: temperatures [K] with a root of their covariance.

    Square-root form of Rauch, Tung and Striebel: gain G = P F' (F P F' + Q)^-1, mean + G (later - foreseen), by one triangular factor.
    """
    n = later.mean.shape[1]
    carried = np.concatenate([leg.transition @ leg.before.root, leg.noise], axis=2)
    here = np.concatenate([leg.before.root, np.zeros_like(leg.noise)], axis=2)
    joint = lower(np.concatenate([carried, here], axis=1))
    forecast, cross, rest = joint[:, :n, :n], joint[:, n:, :n], joint[:, n:, n:]
    gain = cross @ np.linalg.pinv(forecast, rcond=1e-13)
    mean = leg.before.mean + np.einsum("mij,mj->mi", gain, later.mean - leg.after)
    return Belief(mean, lower(np.concatenate([rest, gain @ later.root], axis=2)))


LOUD: Final = 3.0
"""Standard deviations by which the size of innovations may exceed one before it widens errors. [-]"""


@dataclass(frozen=True)
class Whiteness:
    """Whether the innovations of one sensor, in units of what the filter foresaw, are white: by the criterion of a fit's residuals.

    Parameters
    ----------
    sensor : str
    statistics : SensorStatistics   Of the innovations; their RMS is one where noises are right. [-]
    effective : float               Independent innovations that would say as much about a mean. [-]
    """

    sensor: str
    statistics: SensorStatistics
    effective: float

    @property
    def white(self) -> bool:
        """Whether neighbours are uncorrelated, as `SensorStatistics.white` says."""
        return self.statistics.white

    @property
    def size(self) -> float:
        """RMS of the innovations in units of what the filter foresaw. [-]"""
        return self.statistics.rmse

    @property
    def loud(self) -> bool:
        """Whether the innovations are larger than the stated noise allows."""
        return self.size > 1.0 + LOUD / math.sqrt(2.0 * self.effective)

    @property
    def widening(self) -> float:
        """How much wider than the likelihood's the errors of values are: by size where they are loud, by correlation where not white."""
        correlated = 1.0 if self.white else math.sqrt(self.statistics.samples / self.effective)
        return max(1.0, (self.size if self.loud else 1.0) * correlated)

    def __str__(self) -> str:
        """The test in one line."""
        word = "white" if self.white else "not white"
        return f"{self.sensor}: innovations {word} (lag one {self.statistics.lag_one:+.2f}), {self.size:.3g} times the expected size"


def whiteness(sensor: str, standard: Array) -> Whiteness:
    """Return whether standardised innovations (readings,) are white."""
    return Whiteness(sensor, Sums.of_residuals(standard).statistics(0.0), effective_samples(standard))
