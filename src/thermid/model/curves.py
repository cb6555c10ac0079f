"""Smooth tables: monotone cubic Hermite curves, constant beyond their ends, the same here and in the kernel.

Slopes after Fritsch and Butland, SIAM J. Sci. Stat. Comput. 5 (1984) 300, as SciPy computes them: they add no new extremes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from thermid.errors import DeckError

__all__ = ["Curve", "curve", "evaluate", "slopes"]


@dataclass(frozen=True, eq=False)
class Curve:
    """A tabulated function of one temperature or one difference.

    Parameters
    ----------
    over : str              'temperature' (the mean of both ends', or a load's own) or 'difference'.
    x : array (points,)     Temperatures or differences, increasing. [K]
    y : array (points,)     Values. [SI]
    """

    over: str
    x: NDArray[np.float64]
    y: NDArray[np.float64]

    def __eq__(self, other: object) -> bool:
        """Whether two curves have the same points."""
        return isinstance(other, Curve) and self.over == other.over and np.array_equal(self.x, other.x) and np.array_equal(self.y, other.y)

    def __hash__(self) -> int:
        """Hash of the points."""
        return hash((self.over, self.x.tobytes(), self.y.tobytes()))


def curve(over: str, points: Sequence[tuple[float, float]], where: str = "") -> Curve:
    """Return a curve through points.

    Raises
    ------
    DeckError   With fewer than two points, or abscissae that do not increase.
    """
    if len(points) < 2 or any(b[0] <= a[0] for a, b in pairwise(points)):
        raise DeckError("a table needs at least two points, with increasing temperatures.", where)
    return Curve(over, np.array([p[0] for p in points]), np.array([p[1] for p in points]))


def slopes(given: Curve) -> NDArray[np.float64]:
    """Return the slope at each point (points,), zero at both ends so that the curve continues smoothly as a constant."""
    from scipy.interpolate import PchipInterpolator

    out = np.asarray(PchipInterpolator(given.x, given.y).derivative()(given.x), dtype=float)
    out[[0, -1]] = 0.0
    return out


def evaluate(given: Curve, at: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the curve's values (times,) at temperatures or differences `at`. [SI]"""
    from scipy.interpolate import CubicHermiteSpline

    return np.asarray(CubicHermiteSpline(given.x, given.y, slopes(given))(np.clip(at, given.x[0], given.x[-1])), dtype=float)
