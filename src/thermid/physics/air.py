"""Air: properties of dry air for the convection correlations, the `Gas` they take, and of moist air saturation, dew point and vapour.

Relative humidity is that over liquid water at every temperature, as weather services and humidity sensors have it (WMO No. 8, annex 4.A);
below 0 degC vapour settles as frost, so the dew point given there is the frost point.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from thermid.base.errors import ThermidWarning
from thermid.base.units import ATMOSPHERE, ICE_POINT, Array
from thermid.physics._number import Number

DRY_AIR_GAS_CONSTANT = 287.052874
"""Specific gas constant of dry air: 8.31446262 J/(mol K) over 28.96492 g/mol. [J/(kg K)]"""

LOWEST, HIGHEST = 200.0, 450.0


@dataclass(frozen=True)
class Gas:
    """Properties of a gas at one state, or arrays of them.

    Parameters
    ----------
    conductivity : float or array          Conductivity. [W/(m K)]
    kinematic_viscosity : float or array   Kinematic viscosity. [m^2/s]
    prandtl : float or array               Prandtl number. [-]
    expansion : float or array, optional   Volumetric expansion; an ideal gas at the mean temperature if not given. [1/K]
    diffusivity : float or array, optional Thermal diffusivity; viscosity over Prandtl number if not given. [m^2/s]
    """

    conductivity: Number
    kinematic_viscosity: Number
    prandtl: Number
    expansion: Number = None
    diffusivity: Number = None

    def expansion_at(self, mean: Number) -> Number:
        """Volumetric expansion: the given one, else 1/T of an ideal gas at the mean temperature T in kelvin [1/K]."""
        return 1 / mean if self.expansion is None else self.expansion

    def thermal_diffusivity(self) -> Number:
        """Thermal diffusivity: the given one, else nu / Pr of kinematic viscosity and Prandtl number [m^2/s]."""
        return self.kinematic_viscosity / self.prandtl if self.diffusivity is None else self.diffusivity


AIR_300K = Gas(0.0263, 15.89e-6, 0.707)
"""Air at 300 K and 1 atm, Incropera, 6th ed., Table A.4."""


def air_viscosity(temperature: Number) -> Number:
    """Dynamic viscosity of dry air, Sutherland's law 1.458e-6 T^1.5 / (T + 110.4) with T in kelvin [Pa s].

    Parameters
    ----------
    temperature : float or array   Absolute temperature. [K]

    References
    ----------
    U.S. Standard Atmosphere 1976 (NOAA-S/T 76-1562), Eq. 51. Within 1.2 % of CoolProp 8 from 200 to 450 K, 0.7 % from 250 to 350 K.

    Examples
    --------
    At sea level, 288.15 K, the standard tabulates 1.7894e-5 Pa s.

    >>> round(air_viscosity(288.15) * 1e5, 4)
    1.7894
    """
    return 1.458e-6 * temperature**1.5 / (temperature + 110.4)


def air_conductivity(temperature: Number) -> Number:
    """Conductivity of dry air, 2.64638e-3 T^1.5 / (T + 245.4 * 10^(-12 / T)) with T in kelvin [W/(m K)].

    Parameters
    ----------
    temperature : float or array   Absolute temperature. [K]

    References
    ----------
    U.S. Standard Atmosphere 1976, Eq. 53. Within 2.3 % of CoolProp 8 from 200 to 450 K, 1.4 % from 250 to 350 K.

    Examples
    --------
    At sea level, 288.15 K, the standard tabulates 2.5326e-2 W/(m K).

    >>> round(air_conductivity(288.15) * 1e2, 4)
    2.5326
    """
    return 2.64638e-3 * temperature**1.5 / (temperature + 245.4 * 10.0 ** (-12.0 / temperature))


def air_specific_heat(temperature: Number) -> Number:
    """Specific heat of dry air at constant pressure, a polynomial of fourth degree in t = T / 1000 K [J/(kg K)].

    1034.09 - 284.887 t + 781.6818 t^2 - 497.0786 t^3 + 107.7024 t^4.

    Parameters
    ----------
    temperature : float or array   Absolute temperature. [K]

    References
    ----------
    Irvine and Liley, Steam and Gas Tables with Computer Equations, Academic Press 1984. Within 0.3 % of CoolProp 8 from 200 to 450 K.

    Examples
    --------
    Incropera, Table A.4 has 1007 J/(kg K) at 300 K.

    >>> abs(air_specific_heat(300.0) - 1007) < 1
    True
    """
    kilo = temperature / 1000
    return 1034.09 + kilo * (-284.887 + kilo * (781.6818 + kilo * (-497.0786 + kilo * 107.7024)))


def air_density(temperature: Number, pressure: Number = ATMOSPHERE) -> Number:
    """Density of dry air as an ideal gas, p / (R T) with R = `DRY_AIR_GAS_CONSTANT` [kg/m^3].

    Parameters
    ----------
    temperature : float or array   Absolute temperature. [K]
    pressure : float or array      Pressure. [Pa]

    References
    ----------
    Incropera, 6th ed., Section 6.2. Within 0.3 % of CoolProp 8 from 200 to 450 K at 1 atm.

    Examples
    --------
    At sea level, 288.15 K, the U.S. Standard Atmosphere 1976 tabulates 1.2250 kg/m^3.

    >>> round(air_density(288.15), 3)
    1.225
    """
    return pressure / (DRY_AIR_GAS_CONSTANT * temperature)


def dry_air(temperature: Number, pressure: Number = ATMOSPHERE) -> Gas:
    """Properties of dry air for the convection correlations: k, nu = mu / rho, Pr = mu cp / k and the expansion 1/T.

    Parameters
    ----------
    temperature : float or array   Absolute temperature, usually the mean of surface and ambient. [K]
    pressure : float or array      Pressure, in the continuum range. [Pa]

    Warns
    -----
    ThermidWarning   Outside 200 to 450 K, where the fits were compared with CoolProp.

    Notes
    -----
    Measured largest deviation from CoolProp 8.0.0 over 200 to 450 K at 1 atm: conductivity 2.3 %, kinematic viscosity 1.2 %, Prandtl
    number 1.9 %. Far inside the 10 to 20 % of any natural-convection correlation.

    Examples
    --------
    Incropera, Table A.4 at 300 K: k 0.0263, nu 15.89e-6, Pr 0.707.

    >>> air = dry_air(300.0)
    >>> round(air.conductivity, 4), round(air.kinematic_viscosity * 1e6, 1), round(air.prandtl, 2)
    (0.0263, 15.7, 0.71)
    """
    if np.any((np.asarray(temperature) < LOWEST) | (np.asarray(temperature) > HIGHEST)):
        text = f"Dry air at {temperature} K: the property fits are verified from {LOWEST:g} to {HIGHEST:g} K only. Stay within this range."
        warnings.warn(ThermidWarning(text, code="physics.outside-range"), stacklevel=2)
    conductivity, viscosity = air_conductivity(temperature), air_viscosity(temperature)
    return Gas(
        conductivity=conductivity,
        kinematic_viscosity=viscosity / air_density(temperature, pressure),
        prandtl=viscosity * air_specific_heat(temperature) / conductivity,
        expansion=1 / temperature,
    )


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
    """Return the temperature below which vapour settles on a surface: dew, or frost below 0 degC. Any shape. [K]

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
    """Return the density p / (R_v T) of vapour as an ideal gas, of the arguments' common shape. [kg/m^3]

    Parameters
    ----------
    pressure : float or array      Of the vapour. [Pa]
    temperature : float or array   [K]
    """
    return np.asarray(np.asarray(pressure, dtype=float) / (VAPOUR_CONSTANT * np.asarray(temperature, dtype=float)))


def latent_heat(temperature: Any) -> Array:
    """Return the heat that vapour gives when it settles, as dew, or as frost below 0 degC; of the temperature's shape. [J/kg]

    2.501e6 - 2361 (T - 273.15 K) for dew, 2.834e6 for frost.

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
    """Return the speed at which vapour reaches a surface for each unit of difference in vapour density, shaped as the arguments. [m/s]

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
