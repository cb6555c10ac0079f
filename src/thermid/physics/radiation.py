"""Radiation between grey, diffuse surfaces, as a conductance.

`q = F sigma A (T_a^4 - T_b^4)` is written `G (T_a - T_b)` with `G = F sigma A (T_a^2 + T_b^2)(T_a + T_b)`: exact, and finite at
equal temperatures. F is the exchange factor of the pair, referred to the area A.
"""

from __future__ import annotations

from thermid.base.units import STEFAN_BOLTZMANN
from thermid.physics._number import Number


def surroundings_exchange_factor(emissivity: Number) -> Number:
    """Exchange factor of a surface that sees only large surroundings: its emissivity [-].

    Parameters
    ----------
    emissivity : float or array   Emissivity of the small surface. [-]

    References
    ----------
    Incropera, 6th ed., Section 13.3, Table 13.3.

    Examples
    --------
    >>> surroundings_exchange_factor(0.85)
    0.85
    """
    return emissivity


def parallel_exchange_factor(emissivity: Number, other_emissivity: Number) -> Number:
    """Exchange factor of two large parallel plates, 1 / (1/e1 + 1/e2 - 1) [-].

    Parameters
    ----------
    emissivity, other_emissivity : float or array   Emissivities of the two plates. [-]

    References
    ----------
    Incropera, 6th ed., Section 13.3, Table 13.3.

    Examples
    --------
    Cengel, Heat Transfer, 2nd ed., Example 12-7 (0.2 at 800 K, 0.7 at 500 K): 3625 W/m^2 with sigma 5.67e-8.

    >>> coefficient = radiation_coefficient(parallel_exchange_factor(0.2, 0.7), 1.0)
    >>> round(radiation_conductance(coefficient, 800.0, 500.0) * (800.0 - 500.0))
    3626
    """
    return 1 / (1 / emissivity + 1 / other_emissivity - 1)


def concentric_exchange_factor(inner_emissivity: Number, outer_emissivity: Number, area_ratio: Number) -> Number:
    """Exchange factor of concentric cylinders or spheres, referred to the inner area [-].

    `1 / (1/e1 + (A1/A2)(1/e2 - 1))`; an area ratio of zero is large surroundings, of one is parallel plates.

    Parameters
    ----------
    inner_emissivity, outer_emissivity : float or array   Emissivities. [-]
    area_ratio : float or array                           Inner area over outer area. [-]

    References
    ----------
    Incropera, 6th ed., Section 13.3, Table 13.3.

    Examples
    --------
    Cryogenic tube, example in Incropera's Section 13.3 (20 mm in 50 mm, e 0.02 at 77 K in 0.05 at 300 K): a gain of 0.50 W/m.

    >>> coefficient = radiation_coefficient(concentric_exchange_factor(0.02, 0.05, 0.020 / 0.050), 3.14159 * 0.020)
    >>> round(radiation_conductance(coefficient, 300.0, 77.0) * (300.0 - 77.0), 2)
    0.5
    """
    return 1 / (1 / inner_emissivity + area_ratio * (1 / outer_emissivity - 1))


def radiation_coefficient(exchange_factor: Number, area: Number) -> Number:
    """Radiative coefficient of a pair, F sigma A [W/K^4].

    Parameters
    ----------
    exchange_factor : float or array   Exchange factor of the pair. [-]
    area : float or array              Area to which the factor refers. [m^2]

    References
    ----------
    Table 1 of the source document; sigma of CODATA 2018.

    Examples
    --------
    A test of ModelingToolkit's library, 0.04 m^2 between 1000 K and 10 K, black: 2268.1 W.

    >>> round(radiation_coefficient(1.0, 0.04) * (1000.0**4 - 10.0**4), 1)
    2268.1
    """
    return exchange_factor * STEFAN_BOLTZMANN * area


def radiation_conductance(coefficient: Number, temperature: Number, other_temperature: Number) -> Number:
    """Conductance of a radiating pair, F sigma A (T_a^2 + T_b^2)(T_a + T_b) [W/K].

    Parameters
    ----------
    coefficient : float or array                      `radiation_coefficient` of the pair. [W/K^4]
    temperature, other_temperature : float or array   Absolute temperatures of its two ends. [K]

    References
    ----------
    Incropera, 6th ed., Section 1.2.3.

    Examples
    --------
    Steam pipe, Incropera Example 1.2 (70 mm, e 0.8, 473 K to 298 K): 421 W/m.

    >>> round(radiation_conductance(radiation_coefficient(0.8, 3.14159 * 0.07), 473.0, 298.0) * (473.0 - 298.0))
    421
    """
    return coefficient * (temperature**2 + other_temperature**2) * (temperature + other_temperature)


def linearised_htc(emissivity: Number, temperature: Number, other_temperature: Number) -> Number:
    """Radiation to large surroundings as a coefficient, e sigma (T_a^2 + T_b^2)(T_a + T_b) [W/(m^2 K)].

    Parameters
    ----------
    emissivity : float or array                       Emissivity, or the exchange factor of the pair. [-]
    temperature, other_temperature : float or array   Absolute temperatures. [K]

    References
    ----------
    Incropera, 6th ed., Section 1.2.3.

    Examples
    --------
    The EleGFO box of the source document at 35.938 C in 24 C, were its emissivity 0.3 (acceptance row B1):

    >>> round(linearised_htc(0.3, 309.088, 297.15), 3)
    1.896
    """
    return radiation_conductance(emissivity * STEFAN_BOLTZMANN, temperature, other_temperature)


def surface_resistance(emissivity: Number, area: Number) -> Number:
    """Radiative surface resistance between emissive power and radiosity, (1 - e) / (e A) [1/m^2].

    The unit is m^-2, not m^2 and not K/W: it divides a difference of emissive powers sigma T^4. The source document's Table 1 calls it
    a thermal resistance, but alone it gives Q / (1 - e); with `space_resistance` 1/A behind it, the printed law
    Q = e sigma A (T^4 - T^4) follows.

    Parameters
    ----------
    emissivity : float or array   Emissivity. [-]
    area : float or array         Area. [m^2]

    References
    ----------
    Incropera, 6th ed., Section 13.3.

    Examples
    --------
    Surface and space in series are the exchange factor of large surroundings:

    >>> 1 / (surface_resistance(0.3, 2.0) + space_resistance(2.0)) == 0.3 * 2.0
    True
    """
    return (1 - emissivity) / (emissivity * area)


def space_resistance(area: Number, view_factor: Number = 1.0) -> Number:
    """Radiative resistance of the space between two surfaces, 1 / (A F) [1/m^2].

    Parameters
    ----------
    area : float or array          Area of the first surface. [m^2]
    view_factor : float or array   View factor from the first to the second. [-]

    References
    ----------
    Incropera, 6th ed., Section 13.3.

    Examples
    --------
    >>> space_resistance(0.5)
    2.0
    """
    return 1 / (area * view_factor)
