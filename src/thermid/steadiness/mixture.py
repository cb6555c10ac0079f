"""A sum of normal distributions: what several explanations say of one temperature."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Mixture:
    """A sum of normal distributions.

    Parameters
    ----------
    weights, means, spreads : array (parts,)   [-], [K], [K]
    """

    weights: Array
    means: Array
    spreads: Array

    @property
    def mean(self) -> float:
        """[K]"""
        return float(self.weights @ self.means)

    def below(self, value: float) -> float:
        """Return the probability of lying below a value."""
        from scipy.special import ndtr

        return float(self.weights @ ndtr((value - self.means) / self.spreads))

    def quantile(self, share: float) -> float:
        """Return the value with that share below it. [K]"""
        keep = self.weights > 1e-6 * self.weights.max()
        part = Mixture(self.weights[keep] / self.weights[keep].sum(), self.means[keep], self.spreads[keep])
        low, high = float((part.means - 9.0 * part.spreads).min()), float((part.means + 9.0 * part.spreads).max())
        for _ in range(60):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if part.below(middle) < share else (low, middle)
        return 0.5 * (low + high)
