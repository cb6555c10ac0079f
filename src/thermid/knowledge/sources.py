"""`Source`: one named cause of uncertainty with its probability law; the error of a value is its response to the sources."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

__all__ = ["KNOWN", "Kind", "Law", "LeftOut", "Normal", "Source", "Uniform"]

Array = NDArray[np.float64]
Kind = Literal["data", "instrument", "stated", "structural", "misfit", "variant"]
KNOWN: tuple[Kind, ...] = ("data", "instrument", "stated")
"""Kinds that a covariance of fitted values holds; structural ones enter budgets besides."""


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
class Source:
    """A named cause of uncertainty.

    Parameters
    ----------
    name : str      Unique; that of a fit's noise holds the key of its stage, so that branches above one component share it.
    kind : str      data (noise of one fit), instrument (a constant error), stated, structural, misfit or variant.
    law : Law       Of a standard normal law where values respond to it by their standard deviation.
    words : str     What it is, for people.
    """

    name: str
    kind: Kind
    law: Law
    words: str = ""


@dataclass(frozen=True)
class LeftOut:
    """Something uncertain that an answer does not count.

    Parameters
    ----------
    what : str      What is left out, for people.
    kelvin : float  The standard deviation that it might add, where that is known; NaN otherwise. [K]
    """

    what: str
    kelvin: float = float("nan")
