"""Probability laws of one number, each by its quantiles, and the numbers that members of a run are drawn by."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Law(Protocol):
    """A probability law of one number."""

    @property
    def mean(self) -> float:
        """Its mean."""

    @property
    def variance(self) -> float:
        """Its variance."""

    def at(self, share: Array) -> Array:
        """Return the values below which shares (members,) of all lie."""


@dataclass(frozen=True)
class Normal:
    """A normal law; the standard one by default."""

    mean: float = 0.0
    sd: float = 1.0

    @property
    def variance(self) -> float:
        """Its variance."""
        return self.sd**2

    def at(self, share: Array) -> Array:
        """Return the quantiles (members,) of shares (members,)."""
        from scipy.special import ndtri

        return np.asarray(self.mean + self.sd * ndtri(share))

    def below(self, value: float) -> float:
        """Return the probability of less than a value. [-]"""
        from scipy.special import ndtr

        return float(ndtr((value - self.mean) / self.sd)) if self.sd > 0.0 else float(value > self.mean)

    def moments(self, low: float, high: float) -> tuple[float, float]:
        """Return mean and mean square between two ends, weighted by the law and not divided by its share there."""
        a, b = (low - self.mean) / self.sd, (high - self.mean) / self.sd
        share = self.below(high) - self.below(low)
        # integrals of z and z^2 with the normal density: -density and share - z density, between the ends
        first = _density(a) - _density(b)
        second = share + _times_density(a) - _times_density(b)
        return self.mean * share + self.sd * first, self.mean**2 * share + 2.0 * self.mean * self.sd * first + self.sd**2 * second


@dataclass(frozen=True)
class LogNormal:
    """A law whose logarithm is normal."""

    median: float
    log_sd: float

    @property
    def mean(self) -> float:
        """Its mean."""
        return float(self.median * np.exp(0.5 * self.log_sd**2))

    @property
    def variance(self) -> float:
        """Its variance."""
        return float(self.mean**2 * np.expm1(self.log_sd**2))

    def at(self, share: Array) -> Array:
        """Return the quantiles (members,) of shares (members,)."""
        from scipy.special import ndtri

        return np.asarray(self.median * np.exp(self.log_sd * ndtri(share)))

    def below(self, value: float) -> float:
        """Return the probability of less than a value. [-]"""
        return 0.0 if value <= 0.0 else Normal(0.0, self.log_sd).below(float(np.log(value / self.median)))

    def moments(self, low: float, high: float) -> tuple[float, float]:
        """Return mean and mean square between two ends, weighted by the law and not divided by its share there."""
        ends = [-np.inf if x <= 0.0 else float(np.log(x / self.median)) for x in (low, high)]
        out = []
        for k in (1, 2):
            # exp(k z) times a normal density is that density about k log_sd^2, times exp(k^2 log_sd^2 / 2)
            below, above = (Normal(k * self.log_sd**2, self.log_sd).below(x) for x in ends)
            out.append(float(self.median**k * np.exp(0.5 * (k * self.log_sd) ** 2) * (above - below)))
        return out[0], out[1]


@dataclass(frozen=True)
class Uniform:
    """Anything between two ends, as likely."""

    low: float
    high: float

    @property
    def mean(self) -> float:
        """Its mean."""
        return 0.5 * (self.low + self.high)

    @property
    def variance(self) -> float:
        """Its variance."""
        return (self.high - self.low) ** 2 / 12.0

    def at(self, share: Array) -> Array:
        """Return the quantiles (members,) of shares (members,)."""
        return np.asarray(self.low + (self.high - self.low) * share)


@dataclass(frozen=True)
class Choice:
    """One of several things, all as likely, by its number."""

    count: int

    @property
    def mean(self) -> float:
        """Its mean."""
        return 0.5 * (self.count - 1)

    @property
    def variance(self) -> float:
        """Its variance."""
        return (self.count**2 - 1) / 12.0

    def at(self, share: Array) -> Array:
        """Return the numbers (members,) of shares (members,)."""
        return np.minimum(np.floor(share * self.count), self.count - 1.0)


@dataclass(frozen=True)
class Cut:
    """A law without what lies beyond two ends: the bounds of a deck."""

    law: Normal | LogNormal
    low: float
    high: float

    @property
    def share(self) -> float:
        """Probability between the ends. [-]"""
        below, above = self._ends
        return above - below

    @property
    def _ends(self) -> tuple[float, float]:
        return self.law.below(self.low), self.law.below(self.high)

    @property
    def mean(self) -> float:
        """Its mean."""
        return self.law.moments(self.low, self.high)[0] / self.share

    @property
    def variance(self) -> float:
        """Its variance."""
        first, second = (m / self.share for m in self.law.moments(self.low, self.high))
        return max(second - first**2, 0.0)

    def at(self, share: Array) -> Array:
        """Return the quantiles (members,) of shares (members,)."""
        below, above = self._ends
        return np.clip(self.law.at(below + share * (above - below)), self.low, self.high)


@dataclass(frozen=True)
class Shifted:
    """A law moved by a number: of a deviation in place of a value."""

    law: Law
    by: float

    @property
    def mean(self) -> float:
        """Its mean."""
        return self.law.mean + self.by

    @property
    def variance(self) -> float:
        """Its variance."""
        return self.law.variance

    def at(self, share: Array) -> Array:
        """Return the quantiles (members,) of shares (members,)."""
        return self.law.at(share) + self.by


def _density(z: float) -> float:
    return float(np.exp(-0.5 * z * z) / np.sqrt(2.0 * np.pi))


def _times_density(z: float) -> float:
    return z * _density(z) if np.isfinite(z) else 0.0


def uniforms(seed: int, name: str, first: int, members: int) -> Array:
    """Return numbers (members,) between 0 and 1 of the members from `first` on, of the stream of a name. [-]

    The generator counts (Philox: Salmon et al., Parallel random numbers: as easy as 1, 2, 3, SC11, 2011), one stream per name, one count
    per member. A draw depends on the seed, the name and the member's index alone: not on how many members there are, what else is drawn, or
    which process draws it.
    """
    key = int.from_bytes(hashlib.sha256(f"{seed} {name}".encode()).digest()[:16], "big")
    raw = np.random.Philox(key=key, counter=first).random_raw(4 * members)[::4]
    out: Array = ((raw >> np.uint64(11)).astype(float) + 0.5) * 2.0**-53
    return out
