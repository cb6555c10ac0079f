"""Properties that change with temperature, integrated: heat is then conducted and stored exactly, whatever the swing.

A conductivity becomes its integral over temperature (Kirchhoff's transform; Carslaw and Jaeger, Conduction of Heat in Solids, 2nd ed.,
section 1.6), a specific heat the temperature that a mass of constant specific heat would have with the same enthalpy.

Tables: straight lines between their points, the same here and in the kernel; smooth where that is asked for.

A smooth table is a monotone cubic: slopes after Fritsch and Butland, SIAM J. Sci. Stat. Comput. 5 (1984) 300, as SciPy computes them, add
no new extremes. A curve made from a function has the function's own slopes. Outside its points a table keeps its last value, or goes on as
a straight line, or is refused.

Rules of an element as a table: what may not be, and what is said of it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise
from typing import Any, Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from thermid.base.errors import DeckError, refuse_first
from thermid.base.units import AMBIENT_DEFAULT, Array

Where = Callable[[str], str]
"""Key below an element, or none for the element itself -> its place in the deck."""
Rule: TypeAlias = tuple[object, str, str, str]
"""Whether it is broken, the message for that, the key that the message is about, and the code of the cause."""


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


TABULATED: Final = {"conductivity": "W/(m K)", "specific_heat": "J/(kg K)", "enthalpy": "J/kg"}
"""Fields that may be a table over temperature, with the unit of their values."""
SLOPES: Final = {"1": "1/K", "W/K": "W/K^2", "W": "W/K", "W/(m K)": "W/(m K^2)", "J/(kg K)": "J/(kg K^2)", "J/kg": "J/(kg K)"}
"""Unit of the values of a table -> unit of its slopes over temperature."""
MIN_PROPERTY_TEMPERATURE, MAX_PROPERTY_TEMPERATURE = 1.0, 6000.0
"""Temperatures to which a property is held constant beyond its table. [K]"""
MAX_INVERSE_ERROR: Final = 1e-12
"""Error of an inverse table between its points, over rounding. [K]"""
MIN_PIECE_WIDTH: Final = 1e-3
"""Pieces of an inverse table are divided no further than this. [K]"""
PARTS_PER_PIECE: Final = 32
"""Parts of each piece of a smooth table that is integrated."""
ROUNDING: Final = 8.0 * float(np.finfo(float).eps)
"""Relative error that rounding leaves of a temperature."""


@dataclass(frozen=True)
class Supercooling:
    """How far a melt cools before it freezes.

    Parameters
    ----------
    liquidus : float    Temperature from which on everything is liquid; freezing would begin here. [K]
    degree : float      By how much the melt cools below it until crystals form. [K]
    starts : str        'solid' or 'liquid': what a node is that starts between the two temperatures.
    """

    liquidus: float
    degree: float
    starts: str = "solid"

    @property
    def nucleation(self) -> float:
        """Temperature at which crystals form. [K]"""
        return self.liquidus - self.degree


@dataclass(frozen=True, eq=False)
class Melt:
    """The liquid branch of a store that supercools.

    Parameters
    ----------
    given : Supercooling
    rise, curve : Curve     As those of `HeatStore`, of the melt without crystals.
    molten, freezes : float Levels at which the last crystal melts and at which crystals form. [K]
    """

    given: Supercooling
    rise: Curve
    curve: Curve
    molten: float
    freezes: float


@dataclass(frozen=True, eq=False)
class HeatStore:
    """How a node stores heat: H = capacitance * level(T), with the capacitance at a reference.

    Parameters
    ----------
    reference : float   Specific heat that the capacitance is made with. [J/(kg K)]
    given : Curve       As written: specific heat or enthalpy over temperature.
    rise : Curve        Level over temperature. [K]
    curve : Curve       Temperature over level, for the kernel; its second table is the identity. [K]
    melt : Melt or None     Its liquid branch where it supercools.
    """

    reference: float
    given: Curve
    rise: Curve
    curve: Curve
    melt: Melt | None = None

    def level(self, kelvin: Any, liquid: bool = False) -> Array:
        """Return the level at temperatures `kelvin`: (enthalpy over `reference`) as a temperature; NaN stays, solid at a melting point. [K]

        `liquid`: on the branch of the supercooled melt, if there is one.
        """
        at = np.asarray(kelvin, dtype=float)
        return np.where(np.isnan(at), np.nan, self._at(np.where(np.isnan(at), AMBIENT_DEFAULT, at), liquid)[0])

    def share(self, kelvin: Any, liquid: bool = False) -> Array:
        """Return c(T) / `reference`, the slope of the level, at temperatures `kelvin` (nodes,); `liquid` as in `level`. [-]"""
        return self._at(np.asarray(kelvin, dtype=float), liquid)[1]

    def begins(self, kelvin: Any) -> tuple[Array, Array]:
        """Return `level` [K] and `share` [-] at start temperatures; on the melt's branch above nucleation where it starts liquid."""
        at = np.asarray(kelvin, dtype=float)
        solid = self.level(at), self.share(at)
        if self.melt is None or self.melt.given.starts != "liquid":
            return solid
        melt = at > self.melt.given.nucleation
        return np.where(melt, self.level(at, True), solid[0]), np.where(melt, self.share(at, True), solid[1])

    def _at(self, kelvin: Array, liquid: bool) -> tuple[Array, Array]:
        """Return level [K] and its slope [-] (times,) at temperatures `kelvin` (times,), clipped to where properties are known.

        On the curve of melting, or with `liquid` of the melt: cubic through points, or straight between them, where of two points at one
        temperature the slope is that below.
        """
        rise = self.melt.rise if liquid and self.melt is not None else self.rise
        inside = np.clip(kelvin, MIN_PROPERTY_TEMPERATURE, MAX_PROPERTY_TEMPERATURE)
        if not rise.straight:
            return hermite(rise.x, rise.y, rise.slopes, inside)
        x, y = rise.x, rise.y
        k = np.clip(np.searchsorted(x, inside, side="left") - 1, 0, x.size - 2)  # of two points at one temperature the first
        slope = (y[k + 1] - y[k]) / (x[k + 1] - x[k])
        return y[k] + slope * (inside - x[k]), slope


def tabulated(name: str, curve: Curve, where: str) -> Curve:
    """Return the table of the property `name` with its `limits`, after checking its points and values.

    Raises
    ------
    DeckError   When it is not over temperature, or holds values that no material has.
    """
    refuse_first(
        where,
        (curve.over != "temperature", f"{name} must be a table over temperature.", "model.law-refused"),
        (
            curve.x[0] <= MIN_PROPERTY_TEMPERATURE or curve.x[-1] >= MAX_PROPERTY_TEMPERATURE,
            f"the points of {name} must lie between {MIN_PROPERTY_TEMPERATURE:g} and {MAX_PROPERTY_TEMPERATURE:g} K.",
            "value.outside-range",
        ),
    )
    if name == "enthalpy" and (np.diff(curve.y) <= 0.0).any():
        k = int(np.argmax(np.diff(curve.y) <= 0.0))
        raise DeckError(
            f"an enthalpy must increase with temperature; it does not from {curve.x[k]:.6g} to {curve.x[k + 1]:.6g} K.",
            where,
            code="model.law-refused",
        )
    if name == "enthalpy" and (np.diff(curve.x)[[0, -1]] == 0.0).any():
        raise DeckError(
            "an enthalpy needs a point below and a point above the temperature at which it melts.", where, code="model.law-refused"
        )
    if name != "enthalpy" and (curve.y <= 0.0).any():
        k = int(np.argmax(curve.y <= 0.0))
        raise DeckError(
            f"{name} must be above zero; it is {curve.y[k]:g} {TABULATED[name]} at {curve.x[k]:.6g} K.", where, code="model.law-refused"
        )
    return limited(curve, positive=name != "enthalpy")


def melting(heat: float, liquid: float, latent: float, begins: float, ends: float, where: str) -> Curve:
    """Return the enthalpy over temperature of a material that melts: one straight line each for solid, melting and liquid.

    Between `begins` and `ends` it takes up its latent heat beside the mean of both specific heats.

    Parameters
    ----------
    heat, liquid : float    Specific heat of the solid and of the liquid, above zero. [J/(kg K)]
    latent : float          Latent heat, above zero. [J/kg]
    begins, ends : float    Temperatures at which melting begins and ends; equal ones melt at one temperature. [K]
    where : str             The node, for messages.

    Raises
    ------
    DeckError   When melting ends below where it begins.
    """
    low, high = 1.5 * MIN_PROPERTY_TEMPERATURE, MAX_PROPERTY_TEMPERATURE - 1.0
    if not low < begins <= ends < high:
        raise DeckError(
            f"melting from {begins:.6g} to {ends:.6g} K is not possible. Give melts_to at or above melts_from.",
            where,
            code="value.outside-range",
        )
    solid = heat * (begins - low)
    molten = solid + latent + 0.5 * (heat + liquid) * (ends - begins)
    return curve("temperature", [(low, 0.0), (begins, solid), (ends, molten), (high, molten + liquid * (high - ends))], where, steps=True)


def _extended(x: Array, y: Array, d: Array, curve: Curve) -> tuple[Array, Array, Array]:
    """Return points x [K], integral y and integrand d = dy/dx (points,), carried on to the coldest and hottest temperature of properties.

    Linear outside: d on its line to the curve's limits, y by the trapezoid of d. Beyond those, and outside others, d is held.
    """
    if curve.outside == "linear":
        low, high = curve.limits or (MIN_PROPERTY_TEMPERATURE, MAX_PROPERTY_TEMPERATURE)
        for k, far, slope in zip(
            (0, -1), (max(low, MIN_PROPERTY_TEMPERATURE), min(high, MAX_PROPERTY_TEMPERATURE)), ends(curve), strict=True
        ):
            step = far - x[k]
            last = d[k] + slope * step
            x, y, d = (
                np.r_[(new, old) if k == 0 else (old, new)] for new, old in ((far, x), (y[k] + 0.5 * (d[k] + last) * step, y), (last, d))
            )
    below, above = x[0] > MIN_PROPERTY_TEMPERATURE, x[-1] < MAX_PROPERTY_TEMPERATURE
    if below:
        x, y, d = np.r_[MIN_PROPERTY_TEMPERATURE, x], np.r_[y[0] - d[0] * (x[0] - MIN_PROPERTY_TEMPERATURE), y], np.r_[d[0], d]
    if above:
        x, y, d = np.r_[x, MAX_PROPERTY_TEMPERATURE], np.r_[y, y[-1] + d[-1] * (MAX_PROPERTY_TEMPERATURE - x[-1])], np.r_[d, d[-1]]
    return x, y, d


def _integral(curve: Curve) -> tuple[Array, Array, Array]:
    """Return points x [K], the integral of the curve from the first point to x [unit K], and the curve at x (points,).

    The integral of a straight line is a parabola, which is the cubic through its ends with the integrand as slopes. Of a cubic over a
    width h it is h (y0 + y1) / 2 + h^2 (d0 - d1) / 12, by values y and slopes d.
    """
    if curve.straight:
        area = 0.5 * np.diff(curve.x) * (curve.y[1:] + curve.y[:-1])
        return curve.x, np.concatenate(([0.0], np.cumsum(area))), curve.y
    x = np.unique(np.concatenate([np.linspace(a, b, PARTS_PER_PIECE + 1) for a, b in zip(curve.x[:-1], curve.x[1:], strict=True)]))
    value, slope = hermite(curve.x, curve.y, curve.slopes, x)
    width = np.diff(x)
    area = width * (0.5 * (value[1:] + value[:-1]) + width / 12.0 * (slope[:-1] - slope[1:]))  # of a cubic, by values and slopes
    return x, np.concatenate(([0.0], np.cumsum(area))), value


def _inverse(curve: Curve, x: Array, y: Array, d: Array | None) -> Curve:
    """Return the temperatures x over the levels y (points,) [K], and behind them the identity and the table as written.

    `d` (points,) are the slopes dx/dy of a smooth table; None for straight lines. Limits of the table [K] become limits of the levels.
    """
    identity = Curve(
        "temperature",
        np.array([0.5 * MIN_PROPERTY_TEMPERATURE, 2.0 * MAX_PROPERTY_TEMPERATURE]),
        np.array([0.5 * MIN_PROPERTY_TEMPERATURE, 2.0 * MAX_PROPERTY_TEMPERATURE]),
        np.ones(2),
    )
    limits = None
    if curve.limits is not None:
        low, high = max(curve.limits[0], MIN_PROPERTY_TEMPERATURE), min(curve.limits[1], MAX_PROPERTY_TEMPERATURE)
        limits = (float(y[np.searchsorted(x, low)]), float(y[np.searchsorted(x, high, side="right") - 1]))
    return Curve("temperature", y, x, d, (identity, curve), limits=limits)


@lru_cache(maxsize=64)
def potential(curve: Curve) -> Curve:
    """Return the integral of a property over temperature, for both ends of a conductor; the property itself stands behind. [W/m]"""
    x, y, d = _extended(*_integral(curve), curve)
    plain = Curve("temperature", x, y, d, limits=curve.limits)
    return replace(plain, film=(plain, curve))


@lru_cache(maxsize=64)
def store(name: str, curve: Curve, supercooling: Supercooling | None = None) -> HeatStore:
    """Return the `HeatStore` of a node with the table `curve` of 'specific_heat' or 'enthalpy' (`name`).

    Its level is  y(T) = T_min + integral of c from T_min to T over c_ref,  c_ref = c at 20 degC, or that of an enthalpy's first piece.

    Raises
    ------
    DeckError   When a specific heat falls to zero or is out of proportion, or a melt cannot supercool as asked.
    """
    if name == "enthalpy" and curve.straight:
        reference = ends(curve)[0]
        x, y, _ = _extended(curve.x, curve.y, np.array(ends(curve)), replace(curve, outside="hold"))
        y = MIN_PROPERTY_TEMPERATURE + (y - y[0]) / reference
        melt = _melt(curve, x, y, supercooling) if supercooling is not None else None
        return HeatStore(reference, curve, Curve("temperature", x, y), _inverse(curve, x, y, None), melt)
    if supercooling is not None:
        raise DeckError(
            "supercooling needs an enthalpy of straight lines, or latent_heat, melts_from and melts_to.", code="model.law-refused"
        )
    if name == "enthalpy":
        parts = [np.linspace(a, b, PARTS_PER_PIECE + 1) for a, b in zip(curve.x[:-1], curve.x[1:], strict=True)]
        x = np.unique(np.concatenate(parts))
        y, d = hermite(curve.x, curve.y, _rising(curve), x)
        reference = float(d[0])
    else:
        x, y, d = _integral(curve)
        reference = float(curve.value_and_slope(np.clip([AMBIENT_DEFAULT], x[0], x[-1]))[0][0])
    if not (d > 0.0).all():
        raise DeckError(
            f"the specific heat falls to zero at {x[np.argmin(d)]:.6g} K; it must be above zero everywhere. Correct the "
            "table or its slopes there.",
            code="model.law-refused",
        )
    x, y, d = _extended(x, y, d, replace(curve, outside="hold") if name == "enthalpy" else curve)
    y, d = MIN_PROPERTY_TEMPERATURE + (y - y[0]) / reference, d / reference
    rise = Curve("temperature", x, y, d)
    if (np.diff(y) > 0.0).all():
        x, y, d = _divided(x, y, d)
    if not (np.diff(y) > 0.0).all():
        raise DeckError(
            "the specific heats of the table lie too many decades apart to be integrated. Correct the table.", code="model.law-refused"
        )
    return HeatStore(reference, curve, rise, _inverse(curve, x, y, 1.0 / d))


def _melt(curve: Curve, x: Array, y: Array, supercooling: Supercooling) -> Melt:
    """Return the liquid branch of temperatures x [K] over levels y [K] (points,): the line above the liquidus, carried on below it.

    Freezing begins at the level y_liquidus - r degree, r = dy/dx of the liquid: there the melt has its nucleation temperature. The heat
    that it holds then belongs to the table, so that its temperature rises at once to the one that the table gives (recalescence, in no
    time and without a loss; Günther, Mehling and Hiebler, Modelling Simul. Mater. Sci. Eng. 15 (2007) 879).

    Raises
    ------
    DeckError   When the liquidus is no point of the table, the degree is not possible, or the melt has lost more than its latent heat.
    """
    liquidus, nucleation = supercooling.liquidus, supercooling.nucleation
    k = int(np.searchsorted(x, liquidus, side="right")) - 1
    refuse_first(
        "",
        (
            not (0 < k < x.size - 1 and x[k] == liquidus),
            f"melts_to = {liquidus:.6g} K is not a point of the enthalpy table. Add that point; supercooling is counted from it.",
            "model.law-refused",
        ),
        (
            not (supercooling.degree > 0.0 and nucleation > MIN_PROPERTY_TEMPERATURE),
            f"supercooling of {supercooling.degree:.6g} K below {liquidus:.6g} K cannot be; give some kelvin.",
            "value.outside-range",
        ),
    )
    rate = (y[k + 1] - y[k]) / (x[k + 1] - x[k])
    xs, ys = np.r_[MIN_PROPERTY_TEMPERATURE, x[k:]], np.r_[y[k] - rate * (liquidus - MIN_PROPERTY_TEMPERATURE), y[k:]]
    freezes = float(y[k] - rate * supercooling.degree)
    after = float(np.interp(freezes, y, x))
    if not after > nucleation:
        raise DeckError(
            f"a melt that cools by {supercooling.degree:.6g} K has given off more than its latent heat: with crystals it would be at"
            f" {after:.6g} K, below the {nucleation:.6g} K at which they form. Give less supercooling.",
            code="value.outside-range",
        )
    return Melt(supercooling, Curve("temperature", xs, ys), _inverse(curve, xs, ys, None), float(y[k]), freezes)


def _divided(x: Array, y: Array, d: Array) -> tuple[Array, Array, Array]:
    """Return points x, values y and slopes d = dy/dx (points,) of a rising cubic, its pieces halved until their inverse is the cubic too.

    That is where the cubic through (y, x, 1/d) leads from y(x) in the middle of a piece back to x, to `MAX_INVERSE_ERROR`. [K]
    """
    rise = (x, y, d)
    while True:
        middle = 0.5 * (x[1:] + x[:-1])
        back = hermite(y, x, 1.0 / d, hermite(*rise, middle)[0])[0]
        coarse = (np.abs(back - middle) > MAX_INVERSE_ERROR + ROUNDING * middle) & (np.diff(x) > MIN_PIECE_WIDTH)
        if not coarse.any():
            return x, y, d
        x = np.sort(np.r_[x, middle[coarse]])
        y, d = hermite(*rise, x)


def _rising(curve: Curve) -> Array:
    """Return the slopes (points,) of a smooth enthalpy: its own, or Fritsch-Butland ones with the outer pieces' slopes at both ends."""
    if curve.d is not None:
        return curve.d
    d = curve.slopes.copy()
    jump = np.diff(curve.y) / np.diff(curve.x)
    d[0], d[-1] = jump[0], jump[-1]
    return d
