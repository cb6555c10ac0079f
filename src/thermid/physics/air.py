"""Dry air: properties for the convection correlations, and the `Gas` they take."""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np

from thermid.base.errors import ThermidWarning
from thermid.physics._number import Number
from thermid.physics.constants import ATMOSPHERE

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
