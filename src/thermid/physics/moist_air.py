"""Moist air: saturation, dew point, vapour density, and the properties that humidity changes a little.

Relative humidity is that over liquid water at every temperature, as weather services and humidity sensors have it (WMO No. 8, annex 4.A);
below 0 degC vapour settles as frost, so the dew point given there is the frost point.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from thermid.base.linear_algebra import Array
from thermid.physics.air import air_conductivity, air_density, air_specific_heat
from thermid.physics.constants import ATMOSPHERE, ICE_POINT

VAPOUR_CONSTANT: Final = 461.523
"""Specific gas constant of water vapour: 8.31446262 J/(mol K) over 18.015268 g/mol. [J/(kg K)]"""
LIQUID = ((1.0, -7.85951783), (1.5, 1.84408259), (3.0, -11.7866497), (3.5, 22.6807411), (4.0, -15.9618719), (7.5, 1.80122502))
ICE = ((0.00333333333, -21.2144006), (1.20666667, 27.3203819), (1.70333333, -6.10598130))
CRITICAL, CRITICAL_PRESSURE = 647.096, 22.064e6
TRIPLE, TRIPLE_PRESSURE = 273.16, 611.657


def saturation_pressure(temperature: Any, over: str = "liquid") -> Array:
    """Pressure of saturated vapour [Pa].

    Parameters
    ----------
    temperature : float or array   [K]
    over : str                     'liquid', also below 0 degC; 'ice'; or 'surface': ice below the triple point, liquid above.

    References
    ----------
    Wagner and Pruss, J. Phys. Chem. Ref. Data 22 (1993) 783, eq. 1; Wagner et al., J. Phys. Chem. Ref. Data 40 (2011) 043103, eq. 4.

    Examples
    --------
    The table of the first reference, 300 K: 3536.7 Pa (3.5368 kPa in IAPWS-95).

    >>> round(float(saturation_pressure(300.0)), -1)
    3540.0
    """
    t = np.asarray(temperature, dtype=float)
    below = 1.0 - t / CRITICAL
    liquid = CRITICAL_PRESSURE * np.exp(CRITICAL / t * sum(a * np.abs(below) ** n for n, a in LIQUID))
    if over == "liquid":
        return np.asarray(liquid)
    share = t / TRIPLE
    ice = TRIPLE_PRESSURE * np.exp(sum(a * share**n for n, a in ICE) / share)
    return np.asarray(ice if over == "ice" else np.where(t < TRIPLE, ice, liquid))


def vapour_pressure(temperature: Any, humidity: Any) -> Array:
    """Pressure of the vapour in air of some relative humidity over liquid water [Pa].

    Parameters
    ----------
    temperature : float or array   Of the air. [K]
    humidity : float or array      Relative, 0 to 1. [-]
    """
    return np.asarray(np.asarray(humidity, dtype=float) * saturation_pressure(temperature))


def dew_point(pressure: Any) -> Array:
    """Temperature below which vapour settles on a surface: dew, or frost below 0 degC [K].

    Parameters
    ----------
    pressure : float or array   Of the vapour; none gives zero. [Pa]

    References
    ----------
    `saturation_pressure` over a surface, inverted by Newton's method on its logarithm.

    Examples
    --------
    Air at 24 degC and 55 %: 14.41 degC by Magnus' formula too.

    >>> round(float(dew_point(vapour_pressure(297.15, 0.55))) - 273.15, 2)
    14.41
    """
    p = np.asarray(pressure, dtype=float)
    wet = np.maximum(p, 1e-6)
    logarithm = np.log(wet / 611.2)
    t = 243.12 * logarithm / (17.62 - logarithm) + ICE_POINT  # Magnus, WMO No. 8: a start
    for _ in range(20):
        step = 1e-4 * t
        here = np.log(saturation_pressure(t, "surface"))
        slope = (np.log(saturation_pressure(t + step, "surface")) - here) / step
        t = t - np.clip((here - np.log(wet)) / slope, -30.0, 30.0)
    return np.asarray(np.where(p > 0.0, t, 0.0))


def vapour_density(pressure: Any, temperature: Any) -> Array:
    """Density of vapour as an ideal gas [kg/m^3].

    Parameters
    ----------
    pressure : float or array      Of the vapour. [Pa]
    temperature : float or array   [K]
    """
    return np.asarray(np.asarray(pressure, dtype=float) / (VAPOUR_CONSTANT * np.asarray(temperature, dtype=float)))


def latent_heat(temperature: Any) -> Array:
    """Heat that vapour gives when it settles: as dew, or as frost below 0 degC [J/kg].

    Parameters
    ----------
    temperature : float or array   [K]

    References
    ----------
    Rogers and Yau, A Short Course in Cloud Physics, 3rd ed., table 2.1, by a straight line (liquid) and at 0 degC (ice).

    Examples
    --------
    >>> round(float(latent_heat(293.15)) / 1e6, 3)
    2.454
    """
    t = np.asarray(temperature, dtype=float)
    return np.asarray(np.where(t < ICE_POINT, 2.834e6, 2.501e6 - 2361.0 * (t - ICE_POINT)))


def vapour_diffusivity(temperature: Any, pressure: Any = ATMOSPHERE) -> Array:
    """Diffusivity of vapour in air [m^2/s].

    Parameters
    ----------
    temperature, pressure : float or array   [K], [Pa]

    References
    ----------
    Pruppacher and Klett, Microphysics of Clouds and Precipitation, 2nd ed., eq. 13-3.
    """
    t, p = np.asarray(temperature, dtype=float), np.asarray(pressure, dtype=float)
    return np.asarray(2.11e-5 * (t / 273.15) ** 1.94 * (ATMOSPHERE / p))


def mass_transfer_coefficient(htc: Any, temperature: Any, pressure: Any = ATMOSPHERE) -> Array:
    """Speed at which vapour reaches a surface for each unit of difference in vapour density [m/s].

    Heat and vapour cross the same boundary layer: h_m = h / (rho c_p) Le^(-2/3), with Le the thermal diffusivity over that of vapour.

    Parameters
    ----------
    htc : float or array                     Coefficient of convection alone. [W/(m^2 K)]
    temperature, pressure : float or array   Of the film. [K], [Pa]

    References
    ----------
    Chilton and Colburn; Incropera, 6th ed., eq. 6.60.
    """
    t, p = np.asarray(temperature, dtype=float), np.asarray(pressure, dtype=float)
    storing = air_density(t, p) * air_specific_heat(t)
    lewis = air_conductivity(t) / storing / vapour_diffusivity(t, p)
    return np.asarray(np.asarray(htc, dtype=float) / storing * lewis ** (-2.0 / 3.0))
