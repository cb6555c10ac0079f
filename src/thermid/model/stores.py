"""Properties that change with temperature, integrated: heat is then conducted and stored exactly, whatever the swing.

A conductivity becomes its integral over temperature (Kirchhoff's transform; Carslaw and Jaeger, Conduction of Heat in Solids, 2nd ed.,
section 1.6), a specific heat the temperature that a mass of constant specific heat would have with the same enthalpy.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from thermid.errors import DeckError
from thermid.model.curves import Curve, hermite, slopes

__all__ = ["TABULATED", "Store", "potential", "store", "tabulated"]

Array = NDArray[np.float64]

TABULATED: Final = {"conductivity": "W/(m K)", "specific_heat": "J/(kg K)", "enthalpy": "J/kg"}
"""Fields that may be a table over temperature, with the unit of their values."""
COLDEST, HOTTEST = 1.0, 6000.0
"""Temperatures to which a property is held constant beyond its table. [K]"""
CLOSE: Final = 1e-9
"""Error of an inverse table between its points. [K]"""
FINEST: Final = 4096
"""Parts into which the pieces of a table are divided at most."""
ROOM: Final = 293.15
"""Temperature at which the capacitance of a node with a table of specific heat is quoted. [K]"""


@dataclass(frozen=True, eq=False)
class Store:
    """How a node stores heat: H = capacitance * level(T), with the capacitance at a reference.

    Parameters
    ----------
    reference : float   Specific heat that the capacitance is made with. [J/(kg K)]
    given : Curve       As written: specific heat or enthalpy over temperature.
    rise : Curve        Level over temperature. [K]
    curve : Curve       Temperature over level, for the kernel; its second table is the identity. [K]
    """

    reference: float
    given: Curve
    rise: Curve
    curve: Curve

    def level(self, kelvin: Any) -> Array:
        """Return the temperature that a constant specific heat would show at temperatures, by enthalpy. [K]"""
        at = np.asarray(kelvin, dtype=float)
        return np.where(np.isnan(at), np.nan, self._at(np.where(np.isnan(at), ROOM, at))[0])

    def share(self, kelvin: Any) -> Array:
        """Return the specific heat at temperatures over that at the reference. [-]"""
        return self._at(np.asarray(kelvin, dtype=float))[1]

    def _at(self, kelvin: Array) -> tuple[Array, Array]:
        return hermite(self.rise.x, self.rise.y, slopes(self.rise), np.clip(kelvin, COLDEST, HOTTEST))


def tabulated(name: str, given: Curve, where: str) -> Curve:
    """Return the table of a property after a look at it.

    Raises
    ------
    DeckError   When it is not over temperature, or holds values that no material has.
    """
    if given.over != "temperature":
        raise DeckError(f"{name} is a table over temperature.", where)
    if given.x[0] <= COLDEST or given.x[-1] >= HOTTEST:
        raise DeckError(f"{name} is a table between {COLDEST:g} and {HOTTEST:g} K.", where)
    if name == "enthalpy" and (np.diff(given.y) <= 0.0).any():
        k = int(np.argmax(np.diff(given.y) <= 0.0))
        raise DeckError(f"an enthalpy grows with temperature; it does not from {given.x[k]:.6g} to {given.x[k + 1]:.6g} K.", where)
    if name != "enthalpy" and (given.y <= 0.0).any():
        k = int(np.argmax(given.y <= 0.0))
        raise DeckError(f"{name} must be above zero; it is {given.y[k]:g} {TABULATED[name]} at {given.x[k]:.6g} K.", where)
    return given


def _extended(x: Array, y: Array, d: Array) -> tuple[Array, Array, Array]:
    """Return points, values and slopes with the end slopes carried on to the coldest and hottest temperature."""
    low, high = y[0] - d[0] * (x[0] - COLDEST), y[-1] + d[-1] * (HOTTEST - x[-1])
    return np.r_[COLDEST, x, HOTTEST], np.r_[low, y, high], np.r_[d[0], d, d[-1]]


def _integral(given: Curve, parts: int) -> tuple[Array, Array, Array]:
    """Return points, integral and integrand of a table, each piece divided; exact at the points, since pieces are cubic."""
    d = slopes(given)
    x = np.unique(np.concatenate([np.linspace(a, b, parts + 1) for a, b in zip(given.x[:-1], given.x[1:], strict=True)]))
    value, slope = hermite(given.x, given.y, d, x)
    width = np.diff(x)
    area = width * (0.5 * (value[1:] + value[:-1]) + width / 12.0 * (slope[:-1] - slope[1:]))  # of a cubic, by values and slopes
    return x, np.concatenate(([0.0], np.cumsum(area))), value


@lru_cache(maxsize=64)
def potential(given: Curve) -> Curve:
    """Return the integral of a property over temperature, for both ends of a conductor; the property itself stands behind. [W/m]"""
    x, y, d = _extended(*_integral(given, 32))
    plain = Curve("temperature", x, y, d)
    return replace(plain, film=(plain, given))


@lru_cache(maxsize=64)
def store(name: str, given: Curve) -> Store:
    """Return how a node with a table of specific heat or of enthalpy stores heat."""
    parts = 8
    while True:
        x, y, d = _enthalpy(given, parts) if name == "enthalpy" else _integral(given, parts)
        reference = float(d[0] if name == "enthalpy" else hermite(given.x, given.y, slopes(given), np.clip([ROOM], x[0], x[-1]))[0][0])
        if not (d > 0.0).all():
            raise DeckError(f"the specific heat falls to zero at {x[np.argmin(d)]:.6g} K; a temperature has no enthalpy of its own there.")
        x, y, d = _extended(x, y, d)
        y, d = COLDEST + (y - y[0]) / reference, d / reference
        middle = 0.5 * (x[1:] + x[:-1])
        back = hermite(y, x, 1.0 / d, hermite(x, y, d, middle)[0])[0]
        if float(np.abs(back - middle).max()) < CLOSE or parts >= FINEST:
            break
        parts *= 2
    identity = Curve("temperature", np.array([0.5 * COLDEST, 2.0 * HOTTEST]), np.array([0.5 * COLDEST, 2.0 * HOTTEST]), np.ones(2))
    inverse = Curve("temperature", y, x, 1.0 / d, (identity, given))
    return Store(reference, given, Curve("temperature", x, y, d), inverse)


def _enthalpy(given: Curve, parts: int) -> tuple[Array, Array, Array]:
    """Return points, enthalpies and specific heats of a table of enthalpy, each piece divided. [J/kg]"""
    d = _rising(given)
    x = np.unique(np.concatenate([np.linspace(a, b, parts + 1) for a, b in zip(given.x[:-1], given.x[1:], strict=True)]))
    value, slope = hermite(given.x, given.y, d, x)
    return x, value, slope


def _rising(given: Curve) -> Array:
    """Return the slopes of a table of enthalpy: its own, or monotone ones, those of its outer pieces at both ends."""
    if given.d is not None:
        return given.d
    d = slopes(given).copy()
    jump = np.diff(given.y) / np.diff(given.x)
    d[0], d[-1] = jump[0], jump[-1]
    return d
