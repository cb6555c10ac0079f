"""The U.S. Standard Atmosphere 1976 up to 86 km."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from thermid.errors import ScenarioError
from thermid.physics.constants import ATMOSPHERE, STANDARD_GRAVITY

__all__ = ["HIGHEST_ALTITUDE", "Air", "standard_atmosphere"]

Array = NDArray[np.float64]

HIGHEST_ALTITUDE = 86e3
"""Above it the standard's air is no longer mixed, and depends on the sun's activity. [m]"""
EARTH_RADIUS = 6356766.0
"""Of the standard, for geopotential altitude. [m]"""
GAS_CONSTANT = 8314.32 / 28.9644
"""Of the standard's dry air. [J/(kg K)]"""
BASES = np.array([0.0, 11e3, 20e3, 32e3, 47e3, 51e3, 71e3])
LAPSES = np.array([-6.5e-3, 0.0, 1.0e-3, 2.8e-3, 0.0, -2.8e-3, -2.0e-3])


class Air(NamedTuple):
    """State of the air: temperature [K], pressure [Pa], density [kg/m^3]."""

    temperature: Array
    pressure: Array
    density: Array


def _layers() -> tuple[Array, Array]:
    """Return temperature and pressure at the base of every layer."""
    temperature, pressure = [288.15], [ATMOSPHERE]
    for base, top, lapse in zip(BASES[:-1], BASES[1:], LAPSES[:-1], strict=True):
        t, p = temperature[-1], pressure[-1]
        temperature.append(t + lapse * (top - base))
        pressure.append(p * _ratio(np.float64(top - base), np.float64(t), float(lapse)))
    return np.array(temperature), np.array(pressure)


def _ratio(height: Any, base: Any, lapse: float) -> Any:
    """Return the pressure over that at the base of a layer."""
    if lapse == 0.0:
        return np.exp(-STANDARD_GRAVITY * height / (GAS_CONSTANT * base))
    return (1.0 + lapse * height / base) ** (-STANDARD_GRAVITY / (GAS_CONSTANT * lapse))


def standard_atmosphere(altitude: Any) -> Air:
    """Return the state of the standard atmosphere at geometric altitudes.

    Parameters
    ----------
    altitude : float or array   Above the sea, -5 to 86 km. [m]

    Raises
    ------
    ScenarioError   Above 86 km, where a table with the sun's activity of the day is needed, and below -5 km.

    References
    ----------
    U.S. Standard Atmosphere, 1976, NOAA-S/T 76-1562, Eqs. 18, 23, 33; molecular weight is taken as constant, which is within 0.04 % up
    to 86 km.

    Examples
    --------
    >>> air = standard_atmosphere(11019.0)
    >>> round(float(air.temperature), 2), round(float(air.pressure))
    (216.65, 22632)
    """
    z = np.asarray(altitude, dtype=float)
    if z.size and (not np.isfinite(z).all() or z.max() > HIGHEST_ALTITUDE or z.min() < -5e3):
        worst = float(z.max()) if z.max() > HIGHEST_ALTITUDE else float(z.min())
        raise ScenarioError(
            f"the standard atmosphere ends at {HIGHEST_ALTITUDE / 1e3:g} km, and {worst / 1e3:.4g} km was asked for. Above it give density "
            "and pressure as a table, or f107 and ap for MSIS.",
            "atmosphere",
        )
    h = EARTH_RADIUS * z / (EARTH_RADIUS + z)
    temperatures, pressures = _layers()
    layer = np.clip(np.searchsorted(BASES, h, side="right") - 1, 0, BASES.size - 1)
    above = h - BASES[layer]
    t = temperatures[layer] + LAPSES[layer] * above
    p = np.empty_like(h)
    for k, lapse in enumerate(LAPSES):
        here = layer == k
        p[here] = pressures[k] * _ratio(above[here], temperatures[k], float(lapse))
    return Air(t, p, p / (GAS_CONSTANT * t))
