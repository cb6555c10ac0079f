"""The U.S. Standard Atmosphere 1976: its equations up to 86 km, its table above."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from thermid.base.errors import ScenarioError
from thermid.base.units import ATMOSPHERE, STANDARD_GRAVITY, Array

HIGHEST_ALTITUDE = 86e3
"""Above it the standard's air is no longer mixed, and depends on the sun's activity. [m]"""
EARTH_RADIUS = 6356766.0
"""Of the standard, for geopotential altitude. [m]"""
STANDARD_AIR_GAS_CONSTANT = 8314.32 / 28.9644
"""Of the standard's dry air. [J/(kg K)]"""
BASES = np.array([0.0, 11e3, 20e3, 32e3, 47e3, 51e3, 71e3])
LAPSES = np.array([-6.5e-3, 0.0, 1.0e-3, 2.8e-3, 0.0, -2.8e-3, -2.0e-3])


UPPER = np.array(
    [
        (86.0, 186.87, 3.7338e-1, 6.958e-6),
        (90.0, 186.87, 1.8359e-1, 3.416e-6),
        (95.0, 188.42, 7.5966e-2, 1.393e-6),
        (100.0, 195.08, 3.2011e-2, 5.604e-7),
        (105.0, 208.84, 1.4477e-2, 2.325e-7),
        (110.0, 240.00, 7.1042e-3, 9.708e-8),
        (115.0, 300.00, 4.0096e-3, 4.289e-8),
        (120.0, 360.00, 2.5382e-3, 2.222e-8),
        (130.0, 469.27, 1.2505e-3, 8.152e-9),
        (140.0, 559.63, 7.2028e-4, 3.831e-9),
        (150.0, 634.39, 4.5422e-4, 2.076e-9),
        (160.0, 696.29, 3.0395e-4, 1.233e-9),
        (180.0, 790.07, 1.5271e-4, 5.194e-10),
        (200.0, 854.56, 8.4736e-5, 2.541e-10),
    ]
)
"""Of the standard's Table I: altitude [km], temperature [K], pressure [Pa], density [kg/m^3]."""


class Air(NamedTuple):
    """State of the air: temperature [K], pressure [Pa], density [kg/m^3]."""

    temperature: Array
    pressure: Array
    density: Array


def _layers() -> tuple[Array, Array]:
    """Return temperature [K] and pressure [Pa] at the base of every layer (layers,), upwards from 288.15 K and one atmosphere at sea level.

    T rises by lapse times height, p as `_ratio`: US Standard Atmosphere, 1976.
    """
    temperature, pressure = [288.15], [ATMOSPHERE]
    for base, top, lapse in zip(BASES[:-1], BASES[1:], LAPSES[:-1], strict=True):
        t, p = temperature[-1], pressure[-1]
        temperature.append(t + lapse * (top - base))
        pressure.append(p * _ratio(np.float64(top - base), np.float64(t), float(lapse)))
    return np.array(temperature), np.array(pressure)


def _ratio(height: Any, base: Any, lapse: float) -> Any:
    """Return the pressure over that at the base of a layer."""
    if lapse == 0.0:
        return np.exp(-STANDARD_GRAVITY * height / (STANDARD_AIR_GAS_CONSTANT * base))
    return (1.0 + lapse * height / base) ** (-STANDARD_GRAVITY / (STANDARD_AIR_GAS_CONSTANT * lapse))


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
            f"the equations of the standard atmosphere end at {HIGHEST_ALTITUDE / 1e3:g} km, and {worst / 1e3:.4g} km was requested. "
            "Above it give pressure and density of the day as columns, or use the standard's mean table (upper = 'standard').",
            "atmosphere",
            code="physics.not-possible",
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
    return Air(t, p, p / (STANDARD_AIR_GAS_CONSTANT * t))


def upper_atmosphere(altitude: Any) -> Air:
    """Return the standard atmosphere up to 200 km, above 86 km by its table, straight lines of the logarithm between its points.

    Parameters
    ----------
    altitude : float or array   Above the sea, -5 to 200 km. [m]

    Raises
    ------
    ScenarioError   Beyond its limits.

    References
    ----------
    U.S. Standard Atmosphere, 1976, Table I. It is a mean over the cycle of the sun: at 120 km the air of a day may be some tens of per cent
    thicker or thinner, at 200 km by a factor of two.

    Examples
    --------
    >>> round(float(upper_atmosphere(112e3).density) * 1e8, 2)
    7.0
    """
    z = np.asarray(altitude, dtype=float)
    top = 1e3 * float(UPPER[-1, 0])
    if z.size and not z.max() <= top:
        raise ScenarioError(
            f"the table of the standard atmosphere ends at {top / 1e3:g} km here, and {z.max() / 1e3:.4g} km was requested.",
            "atmosphere",
            code="physics.not-possible",
        )
    low = standard_atmosphere(np.minimum(z, HIGHEST_ALTITUDE))
    high = [np.interp(z, 1e3 * UPPER[:, 0], column) for column in (UPPER[:, 1], np.log(UPPER[:, 2]), np.log(UPPER[:, 3]))]
    above = z > HIGHEST_ALTITUDE
    tabled = (high[0], np.exp(high[1]), np.exp(high[2]))
    return Air(*(np.where(above, h, mixed) for h, mixed in zip(tabled, low, strict=True)))
