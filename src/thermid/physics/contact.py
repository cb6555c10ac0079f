"""Joints between parts, as conductances."""

from __future__ import annotations

from thermid.physics._number import Number

__all__ = ["half_contact_conductance", "joint_conductance", "series_conductance"]


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
