"""Tables: straight lines between their points, the same here and in the kernel; smooth where that is asked for.

A smooth table is a monotone cubic: slopes after Fritsch and Butland, SIAM J. Sci. Stat. Comput. 5 (1984) 300, as SciPy computes them, add
no new extremes. A curve made from a function has the function's own slopes. Outside its points a table keeps its last value, or goes on as
a straight line, or is refused.

Rules of an element as a table: what may not be, and what is said of it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from thermid.base.errors import DeckError

Where = Callable[[str], str]
"""Key below an element, or none for the element itself -> its place in the deck."""
Rule: TypeAlias = tuple[object, str, str, str]
"""Whether it is broken, the message for that, the key that the message is about, and the code of the cause."""


def refuse_first(where: Where, *rules: Rule) -> None:
    """Refuse an element for the first of some rules that it breaks.

    Raises
    ------
    DeckError   At the rule's key, with its message and code.
    """
    for broken, message, key, code in rules:
        if broken:
            raise DeckError(message, where(key), code=code)


INTERPOLATIONS: Final = ("linear", "smooth")
"""How a table runs between its points; the first is the default."""
OUTSIDE: Final = ("hold", "linear", "refuse")
"""What a table is outside its points; the first is the default."""
MIN_SHARE_OF_LAST: Final = 0.01
"""Part of its last value down to which a quantity above zero is extended as a straight line; beyond, the run is refused. [-]"""
EXTENSION_REACH: Final = 1e5
"""How far a table is extended as a straight line; no temperature of a run is that high. [K]"""


@dataclass(frozen=True, eq=False)
class Curve:
    """A tabulated function of one temperature or one difference.

    Parameters
    ----------
    over : str              'temperature' (the mean of both ends', or a load's own) or 'difference'.
    x : array (points,)     Temperatures or differences, increasing. [K]
    y : array (points,)     Values. [SI]
    d : array (points,)     Slopes of a smooth table; None where they follow from the points. [SI/K]
    film : tuple of Curve   Tables that stand behind it: properties over film temperature, for a law of natural convection; that of the
                            second end, for a potential.
    source, basis : str     Of a table that an author gives: kind of source, and what it rests on.
    interpolation : str     'linear', straight lines, or 'smooth', a monotone cubic; a table with slopes is smooth.
    outside : str           Outside the points: 'hold' the last value, go on as a straight line ('linear'), or 'refuse' the run.
    limits : (low, high)    Outside these a run is refused; see `limited`. [K]
    """

    over: str
    x: NDArray[np.float64]
    y: NDArray[np.float64]
    d: NDArray[np.float64] | None = None
    film: tuple[Curve, ...] = ()
    source: str = ""
    basis: str = ""
    interpolation: str = "linear"
    outside: str = "hold"
    limits: tuple[float, float] | None = None

    @property
    def straight(self) -> bool:
        """Whether it consists of straight lines."""
        return self.d is None and self.interpolation == "linear"

    def __eq__(self, other: object) -> bool:
        """Whether two curves have the same points from the same source."""
        return isinstance(other, Curve) and self._bytes() == other._bytes()

    def __hash__(self) -> int:
        """Hash of the points."""
        return hash(self._bytes())

    def _bytes(self) -> tuple[Any, ...]:
        """Return all fields, arrays as bytes, so that curves compare and hash by value."""
        return (
            self.over,
            self.x.tobytes(),
            self.y.tobytes(),
            b"" if self.d is None else self.d.tobytes(),
            self.film,
            self.source,
            self.basis,
            self.interpolation,
            self.outside,
            self.limits,
        )

    @property
    def slopes(self) -> NDArray[np.float64]:
        """Return the slope of a smooth table at each point (points,); zero at both ends where they follow from the points."""
        if self.d is not None:
            return self.d
        from scipy.interpolate import PchipInterpolator

        out = np.asarray(PchipInterpolator(self.x, self.y).derivative()(self.x), dtype=float)
        out[[0, -1]] = 0.0
        return out

    @property
    def table(self) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64] | None]:
        """Return points, values and slopes (points,), slopes None for straight lines; if outside = 'linear', far points at both ends."""
        x, y, d = self.x, self.y, None if self.straight else self.slopes
        if self.outside != "linear":
            return x, y, d
        first, last = ends(self)
        low, high = self.limits or (-math.inf, math.inf)
        low, high = max(low, x[0] - EXTENSION_REACH), min(high, x[-1] + EXTENSION_REACH)
        y = np.r_[y[0] - (x[0] - low) * first, y, y[-1] + (high - x[-1]) * last]
        on = np.r_[low < x[0], np.full(x.size, True), high > x[-1]]  # a quantity that is zero at its last point ends there
        return np.r_[low, x, high][on], y[on], None if d is None else np.r_[d[0], d, d[-1]][on]

    def evaluate(self, at: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the curve's values (times,) at temperatures or differences `at`. [SI]"""
        return self.value_and_slope(at)[0]

    def value_and_slope(self, at: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the curve's values and slopes (times,) at temperatures or differences `at`. [SI], [SI/K]

        Piecewise linear, or cubic Hermite where the table has slopes. Beyond its ends `at` is clipped: the value is that of the end
        point and the slope that of the last piece, also where a run would refuse the table.
        """
        x, y, d = self.table
        inside = np.clip(at, x[0], x[-1])
        if d is not None:
            return hermite(x, y, d, inside)
        k = np.clip(np.searchsorted(x, inside, side="right") - 1, 0, x.size - 2)
        width = x[k + 1] - x[k]
        slope = (y[k + 1] - y[k]) / np.where(width > 0.0, width, 1.0)
        return y[k] + slope * (inside - x[k]), slope


def curve(
    over: str,
    points: Sequence[tuple[float, ...]],
    where: str = "",
    source: str = "",
    basis: str = "",
    interpolation: str = "linear",
    outside: str = "hold",
    steps: bool = False,
) -> Curve:
    """Return a curve through points: abscissa and value, or abscissa, value and slope; the rest as in `Curve`.

    `steps` says whether two points may lie at one abscissa, as those of an enthalpy at a melting point.

    Raises
    ------
    DeckError   With fewer than two points, abscissae that do not increase, a number that is not finite, or slopes for some points only.
    """
    falls = [b[0] < a[0] or (b[0] == a[0] and not steps) for a, b in pairwise(points)]
    refuse_first(
        lambda _: where,
        (len(points) < 2 or any(falls), "a table needs at least two points, with increasing temperatures.", "", "model.law-refused"),
        (
            len({len(p) for p in points}) > 1,
            "some points of the table have slopes and some have none; give all or none.",
            "",
            "model.law-refused",
        ),
        (
            not all(math.isfinite(v) for p in points for v in p),
            "a table holds a number that is not finite.",
            "",
            "model.law-refused",
        ),
    )
    x, y, *slope = (np.ascontiguousarray(c) for c in np.array(points).T)
    if (interpolation == "smooth" or slope) and (np.diff(x) == 0.0).any():
        raise DeckError(
            "the table has a step (two points at one temperature), so it cannot have slopes. Leave out the slopes.",
            where,
            code="model.law-refused",
        )
    return Curve(over, x, y, slope[0] if slope else None, (), source, basis, interpolation, outside)


def ends(curve: Curve) -> tuple[float, float]:
    """Return the slopes at the first and the last point, along which a table with outside = 'linear' goes on. [SI/K]"""
    if curve.straight:
        first, last = ((curve.y[k + 1] - curve.y[k]) / (curve.x[k + 1] - curve.x[k]) for k in (0, curve.x.size - 2))
        return float(first), float(last)
    d = curve.slopes
    return float(d[0]), float(d[-1])


def limited(curve: Curve, positive: bool = True) -> Curve:
    """Return the curve with `limits`: its outer points where outside = 'refuse', or where a line that goes on nears zero; else as it is.

    A quantity that must be above zero (`positive`) goes on down to `MIN_SHARE_OF_LAST` of the value at its last point.
    """
    low, high = -math.inf, math.inf
    if curve.outside == "refuse":
        low, high = float(curve.x[0]), float(curve.x[-1])
    elif curve.outside == "linear" and positive:
        first, last = ends(curve)
        low = float(curve.x[0] - (1.0 - MIN_SHARE_OF_LAST) * curve.y[0] / first) if first > 0.0 else low
        high = float(curve.x[-1] - (1.0 - MIN_SHARE_OF_LAST) * curve.y[-1] / last) if last < 0.0 else high
    return curve if low == -math.inf and high == math.inf else replace(curve, limits=(low, high))


def hermite(
    x: NDArray[np.float64], y: NDArray[np.float64], d: NDArray[np.float64], at: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return values and slopes (places,) at `at` of the cubic Hermite pieces through points x with values y and slopes d (points,).

    With h = x[k+1] - x[k], t = at - x[k] and j = (y[k+1] - y[k]) / h:  y = y[k] + d[k] t + c2 t^2 + c3 t^3  with
    c2 = (3 j - 2 d[k] - d[k+1]) / h  and  c3 = (d[k] + d[k+1] - 2 j) / h^2, as in the kernel.
    """
    k = np.clip(np.searchsorted(x, at, side="right") - 1, 0, x.size - 2)
    width, t = x[k + 1] - x[k], at - x[k]
    jump = (y[k + 1] - y[k]) / width
    c2, c3 = (3.0 * jump - 2.0 * d[k] - d[k + 1]) / width, (d[k] + d[k + 1] - 2.0 * jump) / width**2
    return y[k] + t * (d[k] + t * (c2 + t * c3)), d[k] + t * (2.0 * c2 + 3.0 * t * c3)
