"""Conduction through slabs, shells and fins, as conductances."""

from __future__ import annotations

import math

import numpy as np

from thermid.physics._number import Number, plain


def slab_conductance(conductivity: Number, area: Number, thickness: Number) -> Number:
    """Conductance of a slab, k A / L [W/K].

    Parameters
    ----------
    conductivity : float or array   Conductivity. [W/(m K)]
    area : float or array           Area across which the heat flows. [m^2]
    thickness : float or array      Length along which it flows. [m]

    References
    ----------
    Incropera, DeWitt, Bergman, Lavine, Fundamentals of Heat and Mass Transfer, 6th ed., Section 3.1; Table 1 of the source document.

    Examples
    --------
    Furnace wall, Incropera Example 1.1: 0.15 m of fireclay brick (k 1.7), 0.5 m by 1.2 m, 1400 K to 1150 K. The book has 1700 W.

    >>> round(slab_conductance(1.7, 0.5 * 1.2, 0.15) * (1400 - 1150), 6)
    1700.0
    """
    return conductivity * area / thickness


def cylinder_conductance(conductivity: Number, length: Number, inner_radius: Number, outer_radius: Number) -> Number:
    """Radial conductance of a cylindrical shell, 2 pi k L / ln(r2/r1) [W/K].

    Parameters
    ----------
    conductivity : float or array                 Conductivity. [W/(m K)]
    length : float or array                       Length of the cylinder. [m]
    inner_radius, outer_radius : float or array   Radii of the shell. [m]

    References
    ----------
    Incropera, 6th ed., Section 3.3.

    Examples
    --------
    Insulated steam pipe, Cengel, Heat Transfer, 2nd ed., Example 3-8 (k 0.05, radii 2.75 and 5.75 cm, 1 m): 2.35 K/W.

    >>> round(1 / cylinder_conductance(0.05, 1.0, 0.0275, 0.0575), 2)
    2.35
    """
    return 2 * math.pi * conductivity * length / plain(np.log(outer_radius / inner_radius))


def sphere_conductance(conductivity: Number, inner_radius: Number, outer_radius: Number) -> Number:
    """Radial conductance of a spherical shell, 4 pi k r1 r2 / (r2 - r1) [W/K].

    Parameters
    ----------
    conductivity : float or array                 Conductivity. [W/(m K)]
    inner_radius, outer_radius : float or array   Radii of the shell. [m]

    References
    ----------
    Incropera, 6th ed., Section 3.3.

    Examples
    --------
    Nitrogen tank, Cengel and Turner, Fundamentals of Thermal-Fluid Sciences, Problem 10-85: 5 cm of glass fibre (k 0.035) on a
    radius of 1.5 m has 0.0489 K/W.

    >>> round(1 / sphere_conductance(0.035, 1.5, 1.55), 4)
    0.0489
    """
    return 4 * math.pi * conductivity * inner_radius * outer_radius / (outer_radius - inner_radius)


def fin_parameter(htc: Number, perimeter: Number, conductivity: Number, cross_section: Number) -> Number:
    """Inverse decay length of a fin, m = sqrt(h P / (k A)) [1/m].

    Parameters
    ----------
    htc : float or array             Coefficient along the fin. [W/(m^2 K)]
    perimeter : float or array       Perimeter of the cross-section. [m]
    conductivity : float or array    Conductivity. [W/(m K)]
    cross_section : float or array   Area of the cross-section. [m^2]

    References
    ----------
    Incropera, 6th ed., Section 3.6.

    Examples
    --------
    Copper rod of Incropera Example 3.9; 99 % of the heat of an endless fin leaves within 2.65/m, there 0.19 m.

    >>> round(2.65 / fin_parameter(100.0, 3.14159 * 0.005, 398.0, 3.14159 * 0.005**2 / 4), 2)
    0.19
    """
    return (htc * perimeter / (conductivity * cross_section)) ** 0.5


def infinite_fin_conductance(htc: Number, perimeter: Number, conductivity: Number, cross_section: Number) -> Number:
    """Conductance from the base of an endless fin to the air, sqrt(h P k A) [W/K].

    Parameters
    ----------
    htc, perimeter, conductivity, cross_section : float or array   As in `fin_parameter`.

    References
    ----------
    Incropera, 6th ed., Section 3.6, Table 3.4, case D.

    Examples
    --------
    Incropera Example 3.9 (rods of 5 mm, 100 to 25 C, h 100): 8.3 W in copper, 5.6 W in aluminium alloy, 1.6 W in stainless steel.

    >>> perimeter, section = 3.14159 * 0.005, 3.14159 * 0.005**2 / 4
    >>> [round(75 * infinite_fin_conductance(100.0, perimeter, k, section), 1) for k in (398.0, 180.0, 14.0)]
    [8.3, 5.6, 1.6]
    """
    return (htc * perimeter * conductivity * cross_section) ** 0.5


def adiabatic_fin_conductance(htc: Number, perimeter: Number, conductivity: Number, cross_section: Number, length: Number) -> Number:
    """Conductance from the base of a fin whose tip loses nothing, sqrt(h P k A) tanh(m L) [W/K].

    Parameters
    ----------
    htc, perimeter, conductivity, cross_section : float or array   As in `fin_parameter`.
    length : float or array                                        Length of the fin. [m]

    References
    ----------
    Incropera, 6th ed., Section 3.6, Table 3.4, case B.

    Examples
    --------
    Incropera Example 3.9: the copper rod cut at 0.19 m gives 99 % of the heat of the endless one.

    >>> rod = (100.0, 3.14159 * 0.005, 398.0, 3.14159 * 0.005**2 / 4)
    >>> round(adiabatic_fin_conductance(*rod, 0.19) / infinite_fin_conductance(*rod), 2)
    0.99
    """
    decay = fin_parameter(htc, perimeter, conductivity, cross_section)
    return infinite_fin_conductance(htc, perimeter, conductivity, cross_section) * plain(np.tanh(decay * length))


MAX_SERIES_ARGUMENT = 0.02
"""(m L)^2 below which the two-port of a fin is taken from its series, which is right to 1e-13 there and has no root in it. [-]"""


def fin_conductances(htc: Number, perimeter: Number, conductivity: Number, cross_section: Number, length: Number) -> tuple[Number, Number]:
    """Fin between two given temperatures: conductance from end to end, and from each end to the air [W/K].

    Both ends of a fin of length L see k A m / sinh(m L) to each other and k A m tanh(m L / 2) to the air, exactly, whatever
    the temperatures of ends and air. Written in powers alone, so that numbers with derivatives pass.

    Parameters
    ----------
    htc, perimeter, conductivity, cross_section : float   As in `fin_parameter`.
    length : float                                        Length of the fin. [m]

    References
    ----------
    Incropera, 6th ed., Section 3.6, Table 3.4, case C (given temperature at the tip), Eq. 3.77.

    Examples
    --------
    The copper rod of Incropera Example 3.9, 1 m long and with its tip at the air's temperature: 8.3 W as the endless one.

    >>> through, side = fin_conductances(100.0, 3.14159 * 0.005, 398.0, 3.14159 * 0.005**2 / 4, 1.0)
    >>> round(75 * (through + side), 1)
    8.3
    """
    slab = slab_conductance(conductivity, cross_section, length)
    square = htc * perimeter * length**2 / (conductivity * cross_section)
    if getattr(square, "value", square) < MAX_SERIES_ARGUMENT:
        through = 1.0 - square * (1 / 6 - square * (7 / 360 - square * (31 / 15120 - square * (127 / 604800))))
        side = square * (1 / 2 - square * (1 / 24 - square * (1 / 240 - square * (17 / 40320 - square * (31 / 725760)))))
        return slab * through, slab * side
    root = square**0.5
    decay = math.e ** (-root)
    return slab * (2.0 * root * decay / (1.0 - decay * decay)), slab * (root * (1.0 - decay) / (1.0 + decay))


def spreading_resistance(
    conductivity: Number, source_area: Number, plate_area: Number, thickness: Number, htc: Number | None = None
) -> Number:
    """Spreading resistance of a small source in the middle of a plate, to the mean temperature of the source [K/W].

    Add the slab t / (k A) of the whole plate for the resistance to its far side. Areas of any compact shape count as discs of that area.

    Parameters
    ----------
    conductivity : float             Of the plate. [W/(m K)]
    source_area, plate_area : float  [m^2]
    thickness : float                [m]
    htc : float                      Coefficient of the far side; None where that has one temperature. [W/(m^2 K)]

    Returns
    -------
    float   (1 - e)^1.5 / (2 k sqrt(A_s)) (tanh(l t) + l / Bi) / (1 + l tanh(l t) / Bi), with the radii a and b of the discs, e = a / b,
            l = pi + 1 / (sqrt(pi) e), t in radii b and Bi = h b / k. Within 10 % of the series solution where e is at most 0.5 and
            the thickness at least 0.1 b; up to 30 % off elsewhere.

    References
    ----------
    Lee, Song, Au, Moran, Constriction/spreading resistance model for electronics packaging, ASME/JSME Thermal Engineering Conference 4
    (1995) 199.

    Examples
    --------
    A source of 1 cm^2 on 5 mm of aluminium of 25 cm^2, 1000 W/(m^2 K) below:

    >>> round(spreading_resistance(180.0, 1e-4, 25e-4, 5e-3, 1000.0), 3)
    0.25
    """
    ratio = (source_area / plate_area) ** 0.5
    radius = (plate_area / math.pi) ** 0.5
    decay = math.pi + 1.0 / (math.pi**0.5 * ratio)
    depth = math.e ** (-2.0 * decay * thickness / radius)
    through = (1.0 - depth) / (1.0 + depth)
    if htc is not None:
        back = decay * conductivity / (htc * radius)
        through = (through + back) / (1.0 + back * through)
    return 0.5 * (1.0 - ratio) ** 1.5 * through / (conductivity * source_area**0.5)
