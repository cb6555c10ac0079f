"""Smooth tables: monotone cubic Hermite curves, constant beyond their ends, the same here and in the kernel.

Slopes after Fritsch and Butland, SIAM J. Sci. Stat. Comput. 5 (1984) 300, as SciPy computes them: they add no new extremes. A curve made
from a function has the function's own slopes.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thermid.errors import DeckError

__all__ = ["Curve", "curve", "evaluate", "hermite", "slopes", "value_and_slope"]


@dataclass(frozen=True, eq=False)
class Curve:
    """A tabulated function of one temperature or one difference.

    Parameters
    ----------
    over : str              'temperature' (the mean of both ends', or a load's own) or 'difference'.
    x : array (points,)     Temperatures or differences, increasing. [K]
    y : array (points,)     Values. [SI]
    d : array (points,)     Slopes; None where they follow from the points. [SI/K]
    film : tuple of Curve   Tables that stand behind it: properties over film temperature, for a law of natural convection; that of the
                            second end, for a potential.
    source, basis : str     Of a table that an author gives: kind of source, and what it rests on.
    """

    over: str
    x: NDArray[np.float64]
    y: NDArray[np.float64]
    d: NDArray[np.float64] | None = None
    film: tuple[Curve, ...] = ()
    source: str = ""
    basis: str = ""

    def __eq__(self, other: object) -> bool:
        """Whether two curves have the same points from the same source."""
        return isinstance(other, Curve) and self._bytes() == other._bytes()

    def __hash__(self) -> int:
        """Hash of the points."""
        return hash(self._bytes())

    def _bytes(self) -> tuple[Any, ...]:
        return (
            self.over,
            self.x.tobytes(),
            self.y.tobytes(),
            b"" if self.d is None else self.d.tobytes(),
            self.film,
            self.source,
            self.basis,
        )


def curve(over: str, points: Sequence[tuple[float, ...]], where: str = "", source: str = "", basis: str = "") -> Curve:
    """Return a curve through points: abscissa and value, or abscissa, value and slope; source and basis as in `Curve`.

    Raises
    ------
    DeckError   With fewer than two points, abscissae that do not increase, a number that is not finite, or slopes for some points only.
    """
    if len(points) < 2 or any(b[0] <= a[0] for a, b in pairwise(points)):
        raise DeckError("a table needs at least two points, with increasing temperatures.", where)
    if len({len(p) for p in points}) > 1:
        raise DeckError("some points of the table have slopes and some have none; give all or none.", where)
    if not all(math.isfinite(v) for p in points for v in p):
        raise DeckError("a table holds a number that is not finite.", where)
    columns = np.array(points).T
    x, y, *slope = (np.ascontiguousarray(c) for c in columns)
    return Curve(over, x, y, slope[0] if slope else None, source=source, basis=basis)


def slopes(given: Curve) -> NDArray[np.float64]:
    """Return the slope at each point (points,); zero at both ends where they follow from the points, so that it ends smoothly."""
    if given.d is not None:
        return given.d
    from scipy.interpolate import PchipInterpolator

    out = np.asarray(PchipInterpolator(given.x, given.y).derivative()(given.x), dtype=float)
    out[[0, -1]] = 0.0
    return out


def hermite(
    x: NDArray[np.float64], y: NDArray[np.float64], d: NDArray[np.float64], at: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return values and slopes (places,) of the cubic pieces through points with slopes, at places within them, as the kernel has them."""
    k = np.clip(np.searchsorted(x, at, side="right") - 1, 0, x.size - 2)
    width, t = x[k + 1] - x[k], at - x[k]
    jump = (y[k + 1] - y[k]) / width
    c2, c3 = (3.0 * jump - 2.0 * d[k] - d[k + 1]) / width, (d[k] + d[k + 1] - 2.0 * jump) / width**2
    return y[k] + t * (d[k] + t * (c2 + t * c3)), d[k] + t * (2.0 * c2 + 3.0 * t * c3)


def evaluate(given: Curve, at: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the curve's values (times,) at temperatures or differences `at`. [SI]"""
    return value_and_slope(given, at)[0]


def value_and_slope(given: Curve, at: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the curve's values and slopes (times,) at temperatures or differences `at`, those of the ends beyond them. [SI], [SI/K]"""
    return hermite(given.x, given.y, slopes(given), np.clip(at, given.x[0], given.x[-1]))
