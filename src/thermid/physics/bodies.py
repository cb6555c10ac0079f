"""A body in still gas, known by its area alone: its natural convection and the least that a gas at rest conducts away from it."""

from __future__ import annotations

from thermid.physics._number import Number
from thermid.physics.air import AIR_300K, Gas
from thermid.physics.constants import STANDARD_GRAVITY
from thermid.physics.plates import rayleigh_number

SHAPE = 3.47
"""Conduction from a convex body into gas at rest without end, S / sqrt(A): 3.39 a cube, 3.54 a sphere. [-]"""
THINNEST = 3.19
"""The same of a thin disc, the least of all convex bodies: 8 r over sqrt(2 pi r^2). [-]"""


def body_nusselt(rayleigh: Number, prandtl: Number) -> Number:
    """Mean Nusselt number of an isothermal convex body of any shape in still gas, laminar, on the root of its area [-].

    Parameters
    ----------
    rayleigh : float or array   Rayleigh number on the root of the area, at most about 1e9. [-]
    prandtl : float or array    Prandtl number. [-]

    References
    ----------
    Lee, Yovanovich, Jafarpur, J. Thermophysics 5 (1991) 208, DOI 10.2514/3.249: shapes from discs to spheres lie within about 10 %.

    Examples
    --------
    Without buoyancy a sphere of diameter D has Nu_D = 2, which on the root of its area is 3.545; bodies in general 3.47.

    >>> body_nusselt(0.0, 0.71)
    3.47
    """
    return SHAPE + 0.670 / (1 + (0.5 / prandtl) ** (9 / 16)) ** (4 / 9) * rayleigh**0.25


def body_htc(surface: Number, ambient: Number, area: Number, air: Gas = AIR_300K, gravity: float = STANDARD_GRAVITY) -> Number:
    """Natural-convection coefficient of a body in still gas, mean over its area [W/(m^2 K)].

    Parameters
    ----------
    surface, ambient : float or array   Absolute temperatures. [K]
    area : float or array               All of its outer surface. [m^2]
    air : Gas                           Properties at the mean of both temperatures.
    gravity : float                     [m/s^2]

    References
    ----------
    As in `body_nusselt`.

    Examples
    --------
    The accelerometer of the source document, 42 cm^2 at 33 C in 24 C:

    >>> round(body_htc(306.15, 297.15, 0.00420536), 1)
    5.9
    """
    size = area**0.5
    rayleigh = rayleigh_number(surface - ambient, size, (surface + ambient) / 2, air, gravity)
    return body_nusselt(rayleigh, air.prandtl) * air.conductivity / size


def conduction_floor(area: Number, conductivity: Number) -> Number:
    """The least coefficient of a convex body in a gas that fills a large space: conduction alone [W/(m^2 K)].

    Parameters
    ----------
    area : float or array           All of its outer surface. [m^2]
    conductivity : float or array   Of the gas. [W/(m K)]

    References
    ----------
    Incropera, 6th ed., Section 4.3, dimensionless conduction heat rates: disc 0.900, sphere 1 on the length (A / 4 pi)^(1/2).

    Examples
    --------
    A disc of 0.1 m radius, both sides: 8 r k over 2 pi r^2.

    >>> round(conduction_floor(2 * 3.14159265 * 0.01, 0.026), 3), round(8 * 0.1 * 0.026 / (2 * 3.14159265 * 0.01), 3)
    (0.331, 0.331)
    """
    return THINNEST * conductivity / area**0.5
