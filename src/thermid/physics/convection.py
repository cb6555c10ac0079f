"""Convection: the conductance h A, power laws, the effective coefficient of a test; the correlations of `plates` are offered here too."""

from __future__ import annotations

import math

import numpy as np

from thermid.physics._number import Number, plain

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
    """Standard error of `effective_htc` h from independent errors of its inputs, |h| sqrt((dQ/Q)^2 + (dA/A)^2 + (dT/T)^2) [W/(m^2 K)].

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


LAMINAR, TURBULENT = 2300.0, 4000.0
"""Reynolds numbers between which a duct's stream is blended from laminar to turbulent (Gnielinski 2013). [-]"""


def rectangle_nusselt(aspect: Number) -> Number:
    """Nusselt number of developed laminar flow in a rectangular duct, walls at one temperature, on the hydraulic diameter [-].

    7.541 (1 - 2.610 a + 4.970 a^2 - 5.119 a^3 + 2.702 a^4 - 0.548 a^5) with the aspect a.

    Parameters
    ----------
    aspect : float or array     Shorter side over the longer one; 0 for parallel plates. [-]

    References
    ----------
    Shah, London, Laminar Flow Forced Convection in Ducts, Academic Press 1978, Eq. 347, within 0.1 % of their table.

    Examples
    --------
    >>> [round(rectangle_nusselt(a), 2) for a in (1.0, 0.5, 0.125, 0.0)]
    [2.98, 3.39, 5.6, 7.54]
    """
    a = aspect
    return 7.541 * (1.0 + a * (-2.610 + a * (4.970 + a * (-5.119 + a * (2.702 - 0.548 * a)))))


def duct_nusselt(reynolds: Number, prandtl: Number, slenderness: Number, developed: Number = 3.66) -> Number:
    """Mean Nusselt number of a stream in a duct with walls at one temperature, on the hydraulic diameter [-].

    With s the slenderness: laminar up to Re = 2300, (Nu_d^3 + 0.7^3 + max(1.615 (Re Pr s)^(1/3) - 0.7, 0)^3)^(1/3); turbulent from 4000,
    0.0214 (Re^0.8 - 100) Pr^0.4 (1 + s^(2/3)), above Pr = 1.5 with 0.012 (Re^0.87 - 280) in front; a straight line in Re between them.

    Parameters
    ----------
    reynolds : float        On the hydraulic diameter, up to 1e6. [-]
    prandtl : float         0.5 to 500. [-]
    slenderness : float     Hydraulic diameter over length, up to 1. [-]
    developed : float       Nu_d, laminar and far from the entrance: 3.66 of a circle, `rectangle_nusselt`. [-]

    References
    ----------
    Gnielinski, VDI Heat Atlas, 2nd ed. 2010, section G1, Eqs. 1 to 5 (laminar); Gnielinski, Int. Chem. Eng. 16 (1976) 359, the two
    simplified equations (turbulent, within 10 % of his full one); Gnielinski, Int. J. Heat Mass Transfer 63 (2013) 134 (between).

    Examples
    --------
    Air in a long pipe, and in one 50 diameters long at Re = 1e4.

    >>> round(duct_nusselt(1000.0, 0.7, 1e-6), 2), round(duct_nusselt(1e4, 0.7, 0.02), 1)
    (3.67, 29.6)
    """

    def laminar(re: Number) -> Number:
        """Return the mean Nusselt number of laminar flow with its entrance."""
        entrance = 1.615 * (re * prandtl * slenderness) ** (1.0 / 3.0)
        return (developed**3 + 0.7**3 + np.maximum(entrance - 0.7, 0.0) ** 3) ** (1.0 / 3.0)

    def turbulent(re: Number) -> Number:
        """Return the mean Nusselt number of turbulent flow (Gnielinski)."""
        gas = 0.0214 * (re**0.8 - 100.0) if prandtl <= 1.5 else 0.012 * (re**0.87 - 280.0)
        return gas * prandtl**0.4 * (1.0 + slenderness ** (2.0 / 3.0))

    # one formula for all three, which written models hold too; each part stays within its own range
    share = np.minimum(np.maximum((reynolds - LAMINAR) / (TURBULENT - LAMINAR), 0.0), 1.0)
    return plain((1.0 - share) * laminar(np.minimum(reynolds, LAMINAR)) + share * turbulent(np.maximum(reynolds, TURBULENT)))


def fin_efficiency(length_parameter: Number) -> Number:
    """Efficiency of a straight fin with an insulated tip, tanh(m L) / (m L) [-].

    Parameters
    ----------
    length_parameter : float    m L with m = sqrt(2 h / (k t)). [-]

    References
    ----------
    Incropera, 6th ed., Eq. 3.87 (adiabatic tip).

    Examples
    --------
    >>> round(fin_efficiency(1.0), 4)
    0.7616
    """
    decay = math.e ** (-2.0 * length_parameter)
    return (1.0 - decay) / (1.0 + decay) / length_parameter
