"""How a model meets a sensor, from a few sums over its residuals that records and the kernel can be added up in."""

from __future__ import annotations

from dataclasses import dataclass
from functools import reduce

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
WHITE = 0.9
"""Share of the samples that residuals must be worth as independent ones to count as white."""


def wanders(effective: float, samples: float) -> bool:
    """Whether residuals are worth so many fewer independent samples than there are that they are not white."""
    return effective < WHITE * samples


@dataclass(frozen=True)
class SensorStatistics:
    """How a model meets one sensor.

    Parameters
    ----------
    rmse, mean, largest : float     Of measured less predicted, the sensor's constant error taken off; largest by size. [K]
    samples : int
    bias : float                    The sensor's constant error as fitted or given. [K]
    lag_one : float                 Autocorrelation of neighbouring residuals. [-]
    effective_samples : float       Independent samples that would say as much; all of them where the residuals do not wander.
    """

    rmse: float
    mean: float
    largest: float
    samples: int
    bias: float
    lag_one: float
    effective_samples: float = 0.0

    @property
    def white(self) -> bool:
        """Whether residuals are uncorrelated: neighbours at the 95 % level (1.96 / sqrt n), and none that wander over longer times."""
        return bool(abs(self.lag_one) < 1.96 / np.sqrt(self.samples)) and not self.wanders

    @property
    def wanders(self) -> bool:
        """Whether the residuals are worth fewer independent samples than there are."""
        return wanders(self.effective_samples, self.samples)


@dataclass(frozen=True)
class Sums:
    """Sums over the residuals of one sensor, in the order of the kernel.

    Parameters
    ----------
    count, first, last : float      How many residuals, the first and the last of them. [K]
    total, squares, lagged : float  Sum, sum of squares, and of products of neighbours, of what each exceeds the first by; a mean far from
                                    zero then costs no digits. [K, K^2]
    largest : float                 By size, with its sign. [K]
    """

    count: float
    first: float
    last: float
    total: float
    squares: float
    lagged: float
    largest: float

    @classmethod
    def of(cls, residuals: Array) -> Sums:
        """Return the sums of residuals (samples,). [K]"""
        more = residuals - residuals[0]
        largest = float(residuals[np.abs(residuals).argmax()])
        sums = float(more.sum()), float(more @ more), float(more[1:] @ more[:-1])
        return cls(residuals.size, float(residuals[0]), float(residuals[-1]), *sums, largest)

    def _about(self, zero: float) -> tuple[float, float, float]:
        """Return total, squares and lagged of what each residual exceeds `zero` by."""
        d, n = self.first - zero, self.count
        ends = self.last - self.first  # the first exceeds itself by nothing
        lagged = self.lagged + d * (2.0 * self.total - ends) + (n - 1) * d * d
        return self.total + n * d, self.squares + 2.0 * d * self.total + n * d * d, lagged

    def followed_by(self, other: Sums) -> Sums:
        """Return the sums of these residuals with others after them."""
        if not self.count or not other.count:
            return self if self.count else other
        total, squares, lagged = other._about(self.first)
        join = (self.last - self.first) * (other.first - self.first)
        largest = max(self.largest, other.largest, key=abs)
        sums = self.total + total, self.squares + squares, self.lagged + join + lagged
        return Sums(self.count + other.count, self.first, other.last, *sums, largest)

    @property
    def mean_square(self) -> float:
        """The mean of the squared residuals. [K^2]"""
        return max(self._about(0.0)[1], 0.0) / self.count

    def statistics(self, bias: float, effective: float | None = None) -> SensorStatistics:
        """Return what they say of a sensor with a constant error [K], worth `effective` samples; all of them where nothing is given."""
        mean = self.first + self.total / self.count
        _, power, lagged = self._about(mean)
        lag = lagged / power if self.count > 2 and power > 0 else 0.0
        count = int(self.count)
        worth = float(count) if effective is None else effective
        return SensorStatistics(float(np.sqrt(self.mean_square)), mean, self.largest, count, bias, lag, worth)


def pooled(parts: list[Sums]) -> Sums:
    """Return the sums of several stretches, one after the other."""
    return reduce(Sums.followed_by, parts)


def loss_of(squares: Array, loss: str, knee: float) -> tuple[Array, Array]:
    """Return the loss of squared residuals in units of the noise, as the kernel counts it, and its derivative. [-]"""
    z = squares / knee**2
    if loss == "soft_l1":
        return 2.0 * knee**2 * (np.sqrt(1.0 + z) - 1.0), 1.0 / np.sqrt(1.0 + z)
    if loss == "huber":
        root = np.sqrt(np.maximum(z, 1.0))
        return knee**2 * np.where(z > 1.0, 2.0 * root - 1.0, z), 1.0 / root
    if loss == "cauchy":
        return knee**2 * np.log1p(z), 1.0 / (1.0 + z)
    return squares, np.ones_like(squares)
