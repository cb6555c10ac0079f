"""Free convection at isothermal plates, and at bodies known by their area alone: Rayleigh and Nusselt numbers, and their coefficients."""

from __future__ import annotations

import warnings

import numpy as np

from thermid.base.errors import ThermidWarning
from thermid.base.units import STANDARD_GRAVITY
from thermid.physics._number import Number, plain
from thermid.physics.air import AIR_300K, Gas

# The source document and the textbooks use 9.81. The standard 9.80665 changes a coefficient by 0.01 %, far below what a correlation can
# promise, but it turns the document's printed 6.798 into 6.797.
DOCUMENT_GRAVITY = 9.81
"""Acceleration of gravity. [m/s^2]"""


def grashof_number(difference: Number, length: Number, mean: Number, air: Gas = AIR_300K, gravity: float = DOCUMENT_GRAVITY) -> Number:
    """Grashof number, g beta |dT| L^3 / nu^2 [-].

    Parameters
    ----------
    difference : float or array   Surface less ambient. [K]
    length : float or array       Characteristic length. [m]
    mean : float or array         Mean of surface and ambient temperature. [K]
    air : Gas                     Properties of the gas.
    gravity : float               Acceleration of gravity. [m/s^2]

    References
    ----------
    Incropera, 6th ed., Section 9.2.

    Examples
    --------
    The EleGFO box of the source document:

    >>> round(grashof_number(11.938, 0.02492, 303.119, Gas(0.026, 1.6e-5, 0.71)), 1)
    23355.6
    """
    return gravity * air.expansion_at(mean) * abs(difference) * length**3 / air.kinematic_viscosity**2


def rayleigh_number(difference: Number, length: Number, mean: Number, air: Gas = AIR_300K, gravity: float = DOCUMENT_GRAVITY) -> Number:
    """Rayleigh number, g beta |dT| L^3 / (nu alpha) [-].

    Parameters
    ----------
    difference, length, mean, air, gravity   As in `grashof_number`.

    References
    ----------
    Incropera, 6th ed., Section 9.2.

    Examples
    --------
    Fire screen, Incropera Example 9.2 (0.71 m, 232 C in 23 C, g 9.8): 1.813e9.

    >>> screen = Gas(0.0338, 26.4e-6, 0.690, expansion=0.0025, diffusivity=38.3e-6)
    >>> round(rayleigh_number(209.0, 0.71, 400.65, screen, gravity=9.8) / 1e9, 3)
    1.813
    """
    return gravity * air.expansion_at(mean) * abs(difference) * length**3 / (air.kinematic_viscosity * air.thermal_diffusivity())


def _prandtl_factor(prandtl: Number) -> Number:
    """Churchill and Chu's dependence on the Prandtl number, 1 + (0.492/Pr)^(9/16) [-]."""
    return 1 + (0.492 / prandtl) ** (9 / 16)


def vertical_plate_nusselt(rayleigh: Number, prandtl: Number) -> Number:
    """Mean Nusselt number of an isothermal vertical plate, laminar: 0.68 + 0.670 Ra^(1/4) / (1 + (0.492/Pr)^(9/16))^(4/9) [-].

    Parameters
    ----------
    rayleigh : float or array   Rayleigh number on the height, at most 1e9. [-]
    prandtl : float or array    Prandtl number. [-]

    References
    ----------
    Churchill and Chu, Int. J. Heat Mass Transfer 18 (1975) 1323, DOI 10.1016/0017-9310(75)90243-4; Eq. 7 of the source document.

    Examples
    --------
    >>> round(vertical_plate_nusselt(16582.4967, 0.71), 5)
    6.51556
    """
    return 0.68 + 0.670 * rayleigh**0.25 / _prandtl_factor(prandtl) ** (4 / 9)


def vertical_plate_nusselt_all(rayleigh: Number, prandtl: Number) -> Number:
    """Mean Nusselt number of an isothermal vertical plate, laminar and turbulent [-].

    (0.825 + 0.387 Ra^(1/6) / (1 + (0.492/Pr)^(9/16))^(8/27))^2: in air within 7 % of the laminar law below Ra = 1e7, and 33 % above it
    at 1e9, where the laminar law gives way.

    Parameters
    ----------
    rayleigh : float or array   Rayleigh number on the height, up to 1e12. [-]
    prandtl : float or array    Prandtl number. [-]

    References
    ----------
    Churchill and Chu, Int. J. Heat Mass Transfer 18 (1975) 1323, DOI 10.1016/0017-9310(75)90243-4.

    Examples
    --------
    Incropera Example 9.2: 147.

    >>> round(vertical_plate_nusselt_all(1.813e9, 0.690))
    147
    """
    return (0.825 + 0.387 * rayleigh ** (1 / 6) / _prandtl_factor(prandtl) ** (8 / 27)) ** 2


def horizontal_plate_up_nusselt(rayleigh: Number) -> Number:
    """Mean Nusselt number of a hot plate facing up or a cold one facing down [-].

    `0.54 Ra^(1/4)` up to 1e7, `0.15 Ra^(1/3)` above; at 1e7 the second is 6 % higher.

    Parameters
    ----------
    rayleigh : float or array   Rayleigh number on area over perimeter, 1e4 to 1e11. [-]

    References
    ----------
    McAdams; Lloyd and Moran; Incropera, 6th ed., Section 9.6.2.

    Examples
    --------
    Top of a plate, Cengel, Heat Transfer, 2nd ed., Problem 9-41: 13.68.

    >>> round(horizontal_plate_up_nusselt(411500.0), 2)
    13.68
    """
    return plain(np.where(np.asarray(rayleigh) <= 1e7, 0.54 * rayleigh**0.25, 0.15 * rayleigh ** (1 / 3)))


def horizontal_plate_down_nusselt(rayleigh: Number) -> Number:
    """Mean Nusselt number of a hot plate facing down or a cold one facing up, 0.27 Ra^(1/4) [-].

    Parameters
    ----------
    rayleigh : float or array   Rayleigh number on area over perimeter, 1e5 to 1e10. [-]

    References
    ----------
    McAdams; Incropera, 6th ed., Section 9.6.2.

    Examples
    --------
    Bottom of the same plate, Cengel, Problem 9-41: 6.838.

    >>> round(horizontal_plate_down_nusselt(411500.0), 3)
    6.838
    """
    return 0.27 * rayleigh**0.25


def _warn_outside(rayleigh: Number, lowest: float, highest: float, what: str, instead: str = "") -> None:
    """Warn with the limits if any Rayleigh number lies outside the range of a correlation."""
    outside = np.asarray(rayleigh)[(np.asarray(rayleigh) < lowest) | (np.asarray(rayleigh) > highest)]
    if outside.size:
        extreme = outside.max() if outside.max() > highest else outside.min()
        text = f"{what}: Rayleigh number {extreme:.3g} is outside {lowest:g} to {highest:g}, the validity of the correlation.{instead}"
        warnings.warn(ThermidWarning(text, code="physics.outside-range"), stacklevel=3)


def vertical_plate_htc(surface: Number, ambient: Number, height: Number, air: Gas = AIR_300K, gravity: float = DOCUMENT_GRAVITY) -> Number:
    """Free-convection coefficient of an isothermal vertical plate, laminar, Nu k / H by `vertical_plate_nusselt` [W/(m^2 K)].

    Parameters
    ----------
    surface, ambient : float or array   Absolute temperatures. [K]
    height : float or array             Height of the plate. [m]
    air : Gas                           Properties of the gas; `dry_air` at the mean temperature is the textbook's choice.
    gravity : float                     9.81 as in the source document, which prints the last digit of the example. [m/s^2]

    Warns
    -----
    ThermidWarning   Above Ra = 1e9, where the flow turns turbulent; `vertical_plate_htc_all` goes on.

    Notes
    -----
    The expansion is that of an ideal gas at the mean of both temperatures unless the gas brings its own.

    References
    ----------
    Churchill and Chu, DOI 10.1016/0017-9310(75)90243-4; Eq. 7 of the source document.

    Examples
    --------
    The EleGFO box of the source document:

    >>> round(vertical_plate_htc(309.088, 297.15, 0.02492, Gas(0.026, 1.6e-5, 0.71)), 3)
    6.798
    """
    rayleigh = rayleigh_number(surface - ambient, height, (surface + ambient) / 2, air, gravity)
    _warn_outside(rayleigh, 0.0, 1e9, "Vertical plate, laminar", " Use vertical_plate_htc_all.")
    return vertical_plate_nusselt(rayleigh, air.prandtl) * air.conductivity / height


def vertical_plate_htc_all(
    surface: Number, ambient: Number, height: Number, air: Gas = AIR_300K, gravity: float = DOCUMENT_GRAVITY
) -> Number:
    """Free-convection coefficient of an isothermal vertical plate, laminar and turbulent, Nu k / H [W/(m^2 K)].

    Nu of `vertical_plate_nusselt_all`, at the Rayleigh number on the height H.

    Parameters
    ----------
    surface, ambient, height, air, gravity   As in `vertical_plate_htc`.

    Warns
    -----
    ThermidWarning   Above Ra = 1e12.

    References
    ----------
    Churchill and Chu, DOI 10.1016/0017-9310(75)90243-4.

    Examples
    --------
    Fire screen, Incropera Example 9.2 (0.71 m by 1.02 m, 232 C in 23 C): h 7.0, 1060 W.

    >>> screen = Gas(0.0338, 26.4e-6, 0.690, expansion=0.0025, diffusivity=38.3e-6)
    >>> htc = vertical_plate_htc_all(505.15, 296.15, 0.71, screen)
    >>> round(htc, 1), round(htc * 0.71 * 1.02 * 209)
    (7.0, 1060)
    """
    rayleigh = rayleigh_number(surface - ambient, height, (surface + ambient) / 2, air, gravity)
    _warn_outside(rayleigh, 0.0, 1e12, "Vertical plate")
    return vertical_plate_nusselt_all(rayleigh, air.prandtl) * air.conductivity / height


def horizontal_plate_up_htc(
    surface: Number, ambient: Number, length: Number, air: Gas = AIR_300K, gravity: float = DOCUMENT_GRAVITY
) -> Number:
    """Free-convection coefficient of a hot plate facing up, or a cold one facing down: Nu k / L [W/(m^2 K)].

    Parameters
    ----------
    surface, ambient, air, gravity   As in `vertical_plate_htc`.
    length : float or array          Area over perimeter. [m]

    Warns
    -----
    ThermidWarning   Outside Ra = 1e4 to 1e11.

    References
    ----------
    As in `horizontal_plate_up_nusselt`.

    Examples
    --------
    Cengel, Problem 9-41 (24 cm by 20 cm, 50 C in 20 C): 6.581.

    >>> air = Gas(0.02625, 1.655e-5, 0.7268)
    >>> round(horizontal_plate_up_htc(323.0, 293.0, 0.24 * 0.20 / (2 * (0.24 + 0.20)), air), 2)
    6.58
    """
    rayleigh = rayleigh_number(surface - ambient, length, (surface + ambient) / 2, air, gravity)
    _warn_outside(rayleigh, 1e4, 1e11, "Horizontal plate, hot side up")
    return horizontal_plate_up_nusselt(rayleigh) * air.conductivity / length


def horizontal_plate_down_htc(
    surface: Number, ambient: Number, length: Number, air: Gas = AIR_300K, gravity: float = DOCUMENT_GRAVITY
) -> Number:
    """Free-convection coefficient of a hot plate facing down, or a cold one facing up, 0.27 Ra^(1/4) k / L [W/(m^2 K)].

    Parameters
    ----------
    surface, ambient, length, air, gravity   As in `horizontal_plate_up_htc`.

    Warns
    -----
    ThermidWarning   Outside Ra = 1e5 to 1e10.

    References
    ----------
    As in `horizontal_plate_down_nusselt`.

    Examples
    --------
    Cengel, Problem 9-41 (24 cm by 20 cm, 50 C in 20 C): 3.291.

    >>> air = Gas(0.02625, 1.655e-5, 0.7268)
    >>> round(horizontal_plate_down_htc(323.0, 293.0, 0.24 * 0.20 / (2 * (0.24 + 0.20)), air), 2)
    3.29
    """
    rayleigh = rayleigh_number(surface - ambient, length, (surface + ambient) / 2, air, gravity)
    _warn_outside(rayleigh, 1e5, 1e10, "Horizontal plate, hot side down")
    return horizontal_plate_down_nusselt(rayleigh) * air.conductivity / length


CONVEX_SHAPE_FACTOR = 3.47
"""Conduction from a convex body into gas at rest without end, S / sqrt(A): 3.39 a cube, 3.54 a sphere. [-]"""
DISC_SHAPE_FACTOR = 3.19
"""The same of a thin disc, the least of all convex bodies: 8 r over sqrt(2 pi r^2). [-]"""


def body_nusselt(rayleigh: Number, prandtl: Number) -> Number:
    """Mean Nusselt number of an isothermal convex body of any shape in still gas, laminar, on the root of its area [-].

    3.47 + 0.670 Ra^(1/4) / (1 + (0.5/Pr)^(9/16))^(4/9).

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
    return CONVEX_SHAPE_FACTOR + 0.670 / (1 + (0.5 / prandtl) ** (9 / 16)) ** (4 / 9) * rayleigh**0.25


def body_htc(surface: Number, ambient: Number, area: Number, air: Gas = AIR_300K, gravity: float = STANDARD_GRAVITY) -> Number:
    """Natural-convection coefficient of a body in still gas, mean over its area: Nu k / sqrt(A) by `body_nusselt` [W/(m^2 K)].

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
    """Least coefficient of a convex body in a gas that fills a large space, conduction alone: 3.19 k / sqrt(A) [W/(m^2 K)].

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
    return DISC_SHAPE_FACTOR * conductivity / area**0.5
