"""Joints between parts, as conductances."""

from __future__ import annotations

import math
from typing import Final

from thermid.base.errors import DeckError, refuse_unknown
from thermid.physics._number import Number

BOLTS: Final = {
    "2-56": (0.21, 0.105),
    "4-40": (0.26, 0.132),
    "6-32": (0.42, 0.176),
    "8-32": (0.80, 0.264),
    "10-32": (1.32, 0.527),
    "1/4-28": (3.51, 1.054),
}
"""Conductance of one bolted joint, small stiff and large thin surfaces. From memory of Gilmore, Spacecraft Thermal Control Handbook, 2nd
ed., chapter 8: check before quoting. [W/K]"""


def joint_conductance(contact_conductance: Number, area: Number) -> Number:
    """Conductance of a joint, h_c A [W/K].

    Parameters
    ----------
    contact_conductance : float or array   Contact conductance of the pair of surfaces. [W/(m^2 K)]
    area : float or array                  Area in contact. [m^2]

    References
    ----------
    Cengel, Heat Transfer, 2nd ed., Section 3-2.

    Examples
    --------
    Transistor on a plate, Cengel Example 3-5 (h_c 42000, 8 cm^2): 0.030 K/W.

    >>> round(1 / joint_conductance(42000.0, 8e-4), 3)
    0.03
    """
    return contact_conductance * area


def half_contact_conductance(contact_conductance: Number, area: Number) -> Number:
    """Conductance of each half of a joint with a node in its middle, 2 h_c A [W/K].

    The two equal halves in series are the joint again. The source document's Fig. 19 has such halves (Rcd1 and Rcd2).

    Parameters
    ----------
    contact_conductance : float or array   Contact conductance of the whole joint. [W/(m^2 K)]
    area : float or array                  Area in contact. [m^2]

    Examples
    --------
    >>> half = half_contact_conductance(42000.0, 8e-4)
    >>> series_conductance(half, half) == joint_conductance(42000.0, 8e-4)
    True
    """
    return 2 * (contact_conductance * area)


def series_conductance(first: Number, second: Number) -> Number:
    """Conductance of two finite conductances one behind the other, g1 g2 / (g1 + g2) [W/K].

    One of them may be zero (the result is zero); two zeros are no joint and raise ZeroDivisionError, or give nan in arrays.

    Parameters
    ----------
    first, second : float or array   Conductances. [W/K]

    References
    ----------
    Incropera, 6th ed., Section 3.1 (resistances in series add).

    Examples
    --------
    The joint of the pair PrE in the acceptance case, 1.390410959 K/W on each side:

    >>> round(1 / series_conductance(1 / 1.390410959, 1 / 1.390410959), 6)
    2.780822
    """
    return first * second / (first + second)


def plastic_contact_conductance(conductivity: Number, slope: Number, roughness: Number, pressure: Number, hardness: Number) -> Number:
    """Contact conductance of two rough, flat surfaces in vacuum, 1.25 k m / s (P / H)^0.95 [W/(m^2 K)].

    Parameters
    ----------
    conductivity : float    Harmonic mean of both, 2 k1 k2 / (k1 + k2). [W/(m K)]
    slope : float           Root mean square of the asperities' slopes, of both surfaces together. [-]
    roughness : float       Root mean square of their heights, of both surfaces together. [m]
    pressure : float        Contact pressure. [Pa]
    hardness : float        Of the softer surface, of its outermost layer. [Pa]

    References
    ----------
    Cooper, Mikic, Yovanovich, Int. J. Heat Mass Transfer 12 (1969) 279, DOI 10.1016/0017-9310(69)90011-8, with the constants of Yovanovich,
    IEEE Trans. Components Packag. Technol. 28 (2005) 182, Eq. 8.

    Examples
    --------
    Aluminium on aluminium, k 180, 1 um and 0.1, at 1 MPa on 1.1 GPa:

    >>> round(plastic_contact_conductance(180.0, 0.1, 1e-6, 1e6, 1.1e9))
    29031
    """
    return 1.25 * conductivity * slope / roughness * (pressure / hardness) ** 0.95


def bolt_conductance(thread: str, count: Number = 1, *, stiff: bool = True) -> Number:
    """Conductance of `count` bolted joints of one thread: `count` times the value of one in `BOLTS` [W/K].

    Parameters
    ----------
    thread : str        As in `BOLTS`.
    count : float       How many. [-]
    stiff : bool        Small and stiff surfaces; large and thin ones conduct less.

    Raises
    ------
    DeckError   When the table has no such thread.

    References
    ----------
    As in `BOLTS`.

    Examples
    --------
    >>> bolt_conductance("8-32", 4)
    3.2
    """
    refuse_unknown([thread], BOLTS, "", "the table of bolts has no '{}'.{near} It has {known}.", DeckError)
    return BOLTS[thread][0 if stiff else 1] * count


NUT_FACTOR: Final = 0.2
"""Torque over preload and diameter of dry steel screws: Bickford, Introduction to the Design and Behavior of Bolted Joints, 4th ed., 2008,
chapter 7, has 0.2 +- 30 % between one screw and the next. [-]"""
CONE: Final = 0.577350269189626
"""Tangent of 30 degrees, by which the pressed zone widens from washer to joint: Madhusudana, Thermal Contact Conductance, 2nd ed., 2014,
chapter 6. [-]"""


def bolt_preload(torque: Number, diameter: Number, nut_factor: Number = NUT_FACTOR) -> Number:
    """Clamping force of a tightened screw, T / (K d) [N].

    Parameters
    ----------
    torque : float      [N m]
    diameter : float    Of the thread. [m]
    nut_factor : float  K. [-]

    References
    ----------
    As in `NUT_FACTOR`.

    Examples
    --------
    M4 at 2 N m:

    >>> round(bolt_preload(2.0, 4e-3))
    2500
    """
    return torque / (nut_factor * diameter)


def bolt_zone(washer: Number, diameter: Number, thickness: Number) -> Number:
    """Area of a joint that one screw presses together, a ring around its hole: pi (r^2 - (d/2)^2) with r = D/2 + `CONE` t [m^2].

    Parameters
    ----------
    washer : float      Outer diameter D of washer or head. [m]
    diameter : float    Diameter d of the hole. [m]
    thickness : float   Thickness t of the plate under the washer. [m]

    References
    ----------
    As in `CONE`.

    Examples
    --------
    >>> round(bolt_zone(9e-3, 4e-3, 3e-3) * 1e6, 1)
    109.4
    """
    outer = 0.5 * washer + CONE * thickness
    return math.pi * (outer**2 - (0.5 * diameter) ** 2)
