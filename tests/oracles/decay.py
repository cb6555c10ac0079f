"""One node that cools or settles by radiation or by free convection: the nonlinear closed forms."""

from __future__ import annotations

import numpy as np

from thermid.base.errors import ThermidError
from thermid.physics._number import Number, plain


def radiative_steady(power: Number, coefficient: Number, surroundings: Number) -> Number:
    """Settled temperature of a node that only radiates, (T_s^4 + Q / (F sigma A))^(1/4) [K].

    Parameters
    ----------
    power : float or array          Power. [W]
    coefficient : float or array    `radiation_coefficient` of the node. [W/K^4]
    surroundings : float or array   Absolute temperature of the surroundings. [K]

    References
    ----------
    Heat balance of Incropera, DeWitt, Bergman, Lavine, Fundamentals of Heat and Mass Transfer, 6th ed., Section 1.2.3.

    Examples
    --------
    The accelerometer of the source document in vacuum, emissivity 0.3, walls of 24 C: it settles 26.274 K above them.

    >>> round(radiative_steady(0.225, 0.3 * 5.670374419e-8 * 0.00420536, 297.15) - 297.15, 3)
    26.274
    """
    return (surroundings**4 + power / coefficient) ** 0.25


def radiative_decay(time: Number, start: Number, coefficient: Number, capacitance: Number) -> Number:
    """Temperature of a node that radiates to 0 K, T_0 (1 + 3 F sigma A T_0^3 t / C)^(-1/3) [K].

    Parameters
    ----------
    time : float or array          Time since the start. [s]
    start : float or array         Initial absolute temperature. [K]
    coefficient : float or array   `radiation_coefficient` of the node. [W/K^4]
    capacitance : float or array   Mass times specific heat. [J/K]

    References
    ----------
    Bejan and Kraus (eds.), Heat Transfer Handbook, Wiley 2003, Section 3.8 (radiative cooling); Incropera, 6th ed., Section 5.3.

    Examples
    --------
    Aluminium sphere of 0.1 m, emissivity 0.8, from 400 K, after an hour:

    >>> round(radiative_decay(3600.0, 400.0, 0.8 * 5.670374419e-8 * 3.14159265 * 0.1**2, 1272.345), 3)
    330.415
    """
    return start * (1 + 3 * coefficient * start**3 * time / capacitance) ** (-1 / 3)


def radiative_cooling_time(start: Number, end: Number, surroundings: Number, coefficient: Number, capacitance: Number) -> Number:
    """Time in which a node that only radiates goes from one temperature to another [s].

    `4 F sigma A T_s^3 t / C = ln|(T_s + T)/(T_s - T)| + 2 atan(T/T_s)`, taken from start to end.

    Parameters
    ----------
    start, end : float or array     Absolute temperatures, both above or both below the surroundings. [K]
    surroundings : float or array   Absolute temperature of the surroundings. [K]
    coefficient : float or array    `radiation_coefficient` of the node. [W/K^4]
    capacitance : float or array    Mass times specific heat. [J/K]

    Raises
    ------
    ThermidError   The end does not lie between the start and the surroundings.

    References
    ----------
    Bejan and Kraus (eds.), Heat Transfer Handbook, Wiley 2003, Eq. 3.283.

    Examples
    --------
    The sphere of `radiative_decay` in a room of 300 K, from 400 K to 350 K:

    >>> round(radiative_cooling_time(400.0, 350.0, 300.0, 0.8 * 5.670374419e-8 * 3.14159265 * 0.1**2, 1272.345), 1)
    4040.6
    """
    left, first = np.asarray(end) - surroundings, np.asarray(start) - surroundings
    if np.any((left * first <= 0) | (np.abs(left) > np.abs(first))):
        raise ThermidError(
            f"{end} K does not lie between the start, {start} K, and the surroundings, {surroundings} K; it is never reached by radiation."
        )
    logarithm = np.log((surroundings + end) / (surroundings + start) * (first / left))
    angle = 2 * (np.arctan(end / surroundings) - np.arctan(start / surroundings))
    return plain(capacitance * (logarithm + angle) / (4 * coefficient * surroundings**3))


def natural_convection_decay(
    time: Number, start: Number, coefficient: Number, area: Number, capacitance: Number, exponent: Number = 0.25
) -> Number:
    """Rise above the ambient of a node that cools with h = K dT^n, dT_0 (1 + n h_0 A t / C)^(-1/n) [K].

    Parameters
    ----------
    time : float or array          Time since the start. [s]
    start : float or array         Initial rise, above 0. [K]
    coefficient : float or array   K, the htc at a rise of 1 K. [W/(m^2 K)]
    area : float or array          Area. [m^2]
    capacitance : float or array   Mass times specific heat. [J/K]
    exponent : float or array      n, not zero. [-]

    References
    ----------
    Bejan and Kraus (eds.), Heat Transfer Handbook, Wiley 2003, Eq. 3.286.

    Examples
    --------
    >>> round(natural_convection_decay(3600.0, 40.0, 2.5251568, 0.05, 500.0), 4)
    6.5578
    """
    return start * (1 + exponent * coefficient * start**exponent * area * time / capacitance) ** (-1 / exponent)
