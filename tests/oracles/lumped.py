"""One node: its closed forms.

C dT/dt = Q - G (T - T_ambient), with G in W/K. A conductance of exactly zero is allowed: the vacuum of the source document.
"""

from __future__ import annotations

import math

import numpy as np

from thermid.base.errors import ThermidError
from thermid.physics._number import Number, plain


def time_constant(capacitance: Number, conductance: Number) -> Number:
    """Time constant C / G; infinite without a conductance [s].

    Parameters
    ----------
    capacitance : float or array   Mass times specific heat. [J/K]
    conductance : float or array   Conductance to the ambient. [W/K]

    References
    ----------
    Incropera, DeWitt, Bergman, Lavine, Fundamentals of Heat and Mass Transfer, 6th ed., Section 5.1; Eq. 2 of the source document.

    Examples
    --------
    The accelerometer of Fig. 16:

    >>> round(time_constant(0.054 * 480, 6 * 0.00420536), 2)
    1027.26
    """
    with np.errstate(divide="ignore"):
        return plain(np.divide(capacitance, conductance))


def steady_rise(power: Number, conductance: Number) -> Number:
    """Settled rise above the ambient, Q / G; infinite without a conductance [K].

    Parameters
    ----------
    power : float or array         Power. [W]
    conductance : float or array   Conductance to the ambient. [W/K]

    References
    ----------
    Eq. 3 of the source document.

    Examples
    --------
    The accelerometer of Fig. 16, "around 9 C":

    >>> round(steady_rise(0.225, 6 * 0.00420536), 6)
    8.917191
    """
    with np.errstate(divide="ignore"):
        return plain(np.divide(power, conductance))


def response(time: Number, power: Number, conductance: Number, capacitance: Number, ambient: Number, start: Number | None = None) -> Number:
    """Temperature of one node under constant power and ambient, from any start, T_a + R Q + (T_0 - T_a - R Q) e^(-t/RC).

    Eq. 3 of the source document holds this only for rises; its last line starts at zero instead of at the initial temperature. Here
    a conductance of zero gives the vacuum ramp, and a tiny one no cancellation.

    Parameters
    ----------
    time : float or array              Time since the start. [s]
    power : float or array             Power. [W]
    conductance : float or array       Conductance to the ambient, zero allowed. [W/K]
    capacitance : float or array       Mass times specific heat. [J/K]
    ambient : float or array           Temperature of the ambient. [K] or [degC]
    start : float or array, optional   Initial temperature; the ambient if not given. Same scale as the ambient.

    Returns
    -------
    float or array   Temperature, on the scale of the ambient.

    References
    ----------
    Incropera, 6th ed., Section 5.3 (constant coefficient and source).

    Examples
    --------
    The accelerometer of Fig. 16 after one hour:

    >>> round(response(3600.0, 0.225, 6 * 0.00420536, 0.054 * 480, 24.0), 6)
    32.649116
    """
    initial = ambient if start is None else start
    turns = np.multiply(conductance, time) / capacitance
    done = -np.expm1(-turns)
    # (1 - e^-x)/x, whose limit at x = 0 is 1: the same formula serves air and vacuum.
    shape = np.where(turns == 0, 1.0, done / np.where(turns == 0, 1.0, turns))
    return plain(initial + (ambient - initial) * done + np.multiply(power, time) / capacitance * shape)


def vacuum_slope(power: Number, capacitance: Number) -> Number:
    """Slope of the temperature when nothing leaves, Q / C [K/s].

    Parameters
    ----------
    power : float or array         Power. [W]
    capacitance : float or array   Mass times specific heat. [J/K]

    References
    ----------
    Source document, model behaviour under vacuum (R to infinity; the printed R = 0 is a slip). Radiation is left out: an upper bound.

    Examples
    --------
    >>> round(vacuum_slope(0.225, 0.054 * 480) * 3600, 9)
    31.25
    """
    return power / capacitance


def vacuum_ramp(time: Number, power: Number, capacitance: Number, start: Number) -> Number:
    """Temperature when nothing leaves, T_0 + Q t / C [K] or [degC].

    Parameters
    ----------
    time : float or array                 Time since the start. [s]
    power, capacitance : float or array   As in `vacuum_slope`.
    start : float or array                Initial temperature. [K] or [degC]

    References
    ----------
    As in `vacuum_slope`.

    Examples
    --------
    The accelerometer after five hours:

    >>> round(vacuum_ramp(18000.0, 0.225, 0.054 * 480, 24.0), 6)
    180.25
    """
    return start + vacuum_slope(power, capacitance) * time


def time_to_fraction(fraction: Number, time_constant: Number) -> Number:
    """Time until a fraction of the final change is done, -tau ln(1 - f) [s].

    Parameters
    ----------
    fraction : float or array        Fraction from 0 to below 1. [-]
    time_constant : float or array   Time constant. [s]

    Raises
    ------
    ThermidError   The fraction is not in the range.

    References
    ----------
    Inverse of Eq. 3 of the source document.

    Examples
    --------
    >>> round(time_to_fraction(0.99, 1027.2604) / 3600, 4)
    1.3141
    """
    if np.any((np.asarray(fraction) < 0) | (np.asarray(fraction) >= 1)):
        raise ThermidError(f"A fraction of {fraction} is never reached; give one from 0 to below 1.")
    return plain(-np.multiply(time_constant, np.log1p(-np.asarray(fraction))))


def time_to_within(band: Number, change: Number, time_constant: Number) -> Number:
    """Time until the temperature is within a band of its final value, tau ln(|change| / band); zero if it starts there [s].

    Parameters
    ----------
    band : float or array            Half width of the band, above 0. [K]
    change : float or array          Final less initial temperature. [K]
    time_constant : float or array   Time constant. [s]

    Raises
    ------
    ThermidError   The band is not above 0.

    References
    ----------
    Inverse of Eq. 3 of the source document.

    Examples
    --------
    Within one step of a 12-bit sensor:

    >>> round(time_to_within(0.0625, 8.917191, 1027.2604) / 3600, 4)
    1.4155
    """
    if np.any(np.asarray(band) <= 0):
        raise ThermidError(f"A band of {band} K is never reached; give one above 0.")
    return plain(np.multiply(time_constant, np.log(np.maximum(np.abs(change) / np.asarray(band), 1.0))))


def ramp_lag(rate: Number, time_constant: Number, time: Number = math.inf) -> Number:
    """Lag behind an ambient that rises at a constant rate, r tau (1 - e^(-t/tau)) [K].

    Parameters
    ----------
    rate : float or array            Rate of the ambient. [K/s]
    time_constant : float or array   Time constant. [s]
    time : float or array            Time since the ramp began; settled if not given. [s]

    References
    ----------
    Response of a first-order system to a ramp, Bentley, Principles of Measurement Systems, 4th ed., Section 4.3.

    Examples
    --------
    A chamber at 3 C/min leaves the accelerometer 51 K behind:

    >>> round(ramp_lag(3 / 60, 1027.2604), 3)
    51.363
    """
    return plain(-np.multiply(rate, time_constant) * np.expm1(-np.divide(time, time_constant)))


def sine_gain(period: Number, time_constant: Number) -> Number:
    """Part of a sinusoidal ambient swing that the node follows, 1 / sqrt(1 + (2 pi tau / P)^2) [-].

    Parameters
    ----------
    period : float or array          Period of the ambient. [s]
    time_constant : float or array   Time constant. [s]

    References
    ----------
    As in `ramp_lag` (response to a sine).

    Examples
    --------
    The accelerometer in a two-hour cycle:

    >>> round(sine_gain(7200.0, 1027.2604), 4)
    0.7446
    """
    return (1 + (2 * math.pi * time_constant / period) ** 2) ** -0.5


def sine_delay(period: Number, time_constant: Number) -> Number:
    """Delay behind a sinusoidal ambient, P / (2 pi) atan(2 pi tau / P) [s].

    Parameters
    ----------
    period, time_constant : float or array   As in `sine_gain`.

    References
    ----------
    As in `sine_gain`.

    Examples
    --------
    >>> round(sine_delay(7200.0, 1027.2604), 1)
    837.5
    """
    return period / (2 * math.pi) * plain(np.arctan(2 * math.pi * time_constant / period))
