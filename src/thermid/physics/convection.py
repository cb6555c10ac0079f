"""Convection: the conductance h A, power laws, the effective coefficient of a test; the correlations of `plates` are offered here too."""

from __future__ import annotations

import math

from thermid.physics._number import Number

SMOOTHING = 0.01
"""Temperature difference below which a power law is rounded off. [K]"""


def convection_conductance(htc: Number, area: Number) -> Number:
    """Conductance of a convecting surface, h A [W/K].

    Parameters
    ----------
    htc : float or array    Coefficient. [W/(m^2 K)]
    area : float or array   Area. [m^2]

    References
    ----------
    Incropera, DeWitt, Bergman, Lavine, Fundamentals of Heat and Mass Transfer, 6th ed., Section 1.2.2; Table 1 of the source document.

    Examples
    --------
    The accelerometer of the source document's Fig. 16: R = 39.632 K/W.

    >>> round(1 / convection_conductance(6.0, 0.00420536), 3)
    39.632
    """
    return htc * area


def power_law_htc(coefficient: Number, difference: Number, exponent: Number, smoothing: float = SMOOTHING) -> Number:
    """Coefficient as a power of the temperature difference, c (dT^2 + s^2)^(n/2) [W/(m^2 K)].

    The rounding s keeps the derivative finite at dT = 0, where runs start; at 10 K it changes the result by 1e-7.

    Parameters
    ----------
    coefficient : float or array   Value at a difference of 1 K. [W/(m^2 K)]
    difference : float or array    Surface less ambient, of either sign. [K]
    exponent : float or array      1/4 laminar, 1/3 turbulent. [-]
    smoothing : float              Rounding s; zero for the textbook's law. [K]

    References
    ----------
    Simplified laws for air, Holman, Heat Transfer, 10th ed., Table 7-2: vertical plane, laminar, h = 1.42 (dT/L)^(1/4).

    Examples
    --------
    >>> round(power_law_htc(1.42, 16.0, 0.25, smoothing=0.0), 2)
    2.84
    """
    return coefficient * (difference**2 + smoothing**2) ** (exponent / 2)


def effective_htc(power: Number, area: Number, rise: Number) -> Number:
    """Coefficient that a settled test in air shows, Q / (A dT): convection and radiation together [W/(m^2 K)].

    Parameters
    ----------
    power : float or array   Power that leaves through the area. [W]
    area : float or array    Area. [m^2]
    rise : float or array    Surface less ambient. [K]

    References
    ----------
    Source document, section on theoretical and effective HTC.

    Examples
    --------
    The EleGFO box of the source document:

    >>> round(effective_htc(2.168, 0.082241, 11.938), 3)
    2.208
    """
    return power / (area * rise)


def effective_htc_error(
    power: float, area: float, rise: float, *, power_error: float = 0.0, area_error: float = 0.0, rise_error: float = 0.0
) -> float:
    """Error of `effective_htc`, one sigma, from independent errors of its three inputs [W/(m^2 K)].

    Parameters
    ----------
    power, area, rise : float                     As in `effective_htc`.
    power_error, area_error, rise_error : float   Standard errors; of two sensors with s each, the rise has s sqrt(2). [W], [m^2], [K]

    References
    ----------
    JCGM 100:2008 (GUM), Eq. 12, relative form.

    Examples
    --------
    Two sensors of 0.5 K leave two digits of the 2.208 of the source document:

    >>> round(effective_htc_error(2.168, 0.082241, 11.938, rise_error=0.5 * 2**0.5), 2)
    0.13
    """
    relative = math.hypot(power_error / power, area_error / area, rise_error / rise)
    return abs(power / (area * rise)) * relative
