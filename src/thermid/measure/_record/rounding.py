"""Rounding to steps of a sensor: readings on one plateau share one error.

Where a signal stands between two steps is not known beforehand (a random phase), so that the errors of two samples at p and q of a signal
have the covariance ``step^2 sum cos(2 pi m (p - q) / step) / (2 pi^2 m^2)`` over m, the Fourier series of ``step^2 (1/12 - f (1 - f) / 2)``
with f the fraction of (p - q) / step; white noise of standard deviation s before rounding blurs each term by ``exp(-(2 pi m s / step)^2)``
(Widrow and Kollar, Quantization Noise, Cambridge University Press 2008, chapters 4 and 9). Samples of one plateau share their error whole;
those of a signal that runs through many steps have errors that cancel.
"""

from __future__ import annotations

import numpy as np

from thermid.base.units import Array, Indices

TERMS = 32
"""Terms of the series; what is left of it is no more than a fiftieth of the variance and counts as white."""
NEGLIGIBLE_TERM_SHARE = 1e-4
"""Part of the first term below which further ones do not count."""
BLURS = 61
"""Values of the blur that are tried, up to one step."""


def _terms(step: float, blur: float) -> Array:
    """Return the variances of the terms m = 1, 2, ...: step^2 / (2 pi^2 m^2) exp(-(2 pi m blur / step)^2) (terms,). [K^2]"""
    m = np.arange(1, TERMS + 1)
    return np.asarray(step**2 / (2.0 * np.pi**2 * m**2) * np.exp(-((2.0 * np.pi * m * blur / step) ** 2)))


def shared_rounding(path: Array, step: float, blur: float, place: Indices, size: int) -> tuple[Array, float]:
    """Return what the rounding errors of neighbours have in common, summed over stretches.

    Parameters
    ----------
    path : array (samples,)     The signal without noise. [K]
    step, blur : float          Of the sensor, and of the noise before rounding. [K]
    place : array (samples,)    Stretch of each sample.
    size : int                  How many stretches there are.

    Returns
    -------
    columns : array (stretches, terms)      The covariance of the sums of the errors over stretches is ``columns columns'``, the variance
                                            of each sample by itself counted with it. [K]
    own : float                             That variance. [K^2]
    """
    sizes = _terms(step, blur)
    terms = np.flatnonzero(sizes > NEGLIGIBLE_TERM_SHARE * step**2 / (2.0 * np.pi**2))
    columns = []
    for m in terms:
        phase = 2.0 * np.pi * (m + 1) / step * (path - path[0])
        columns += [np.sqrt(sizes[m]) * np.bincount(place, wave, minlength=size) for wave in (np.cos(phase), np.sin(phase))]
    return np.array(columns).reshape(len(columns), size).T, float(sizes[terms].sum())


def blur_of(path: Array, readings: Array, step: float) -> float:
    """Return the noise before rounding that explains how often readings jump between neighbours. [K]

    Parameters
    ----------
    path : array (samples,)         The signal without noise. [K]
    readings : array (samples,)     What was read of it. [K]
    step : float                    Of the sensor. [K]

    Notes
    -----
    Neighbours at a distance d differ by ``d^2 + 2 s^2 + 2 (step^2 / 12 - c)`` in the mean square, c the covariance of their errors.
    """
    if path.size < 3:
        return 0.0
    away = np.diff(path)
    jump_variance = float(np.mean(np.diff(readings) ** 2))
    m = np.arange(1, TERMS + 1)
    waves = np.cos(2.0 * np.pi * np.outer(away, m) / step).mean(axis=0)
    blurs = np.linspace(0.0, step, BLURS)
    uncounted = step**2 / 12.0 - float(np.sum(step**2 / (2.0 * np.pi**2 * m**2)))  # of the terms that are not counted
    expected = np.array(
        [np.mean(away**2) + 2.0 * (s**2 + step**2 / 12.0 - uncounted - float(_terms(step, s) @ waves)) for s in blurs.tolist()]
    )
    return float(np.interp(jump_variance, np.maximum.accumulate(expected), blurs))


def rounding_of_line(times: Array, readings: Array, at: float, rate: float, step: float, noise: float | None) -> Array:
    """Return what rounding does to a straight line through readings: causes (2, causes) of the errors of level and slope. [K], [K/s]

    Parameters
    ----------
    times, readings : array (samples,)      [s], [K]
    at : float                              Where the level is taken. [s]
    rate : float                            Slope of the line. [K/s]
    step : float                            Of the sensor. [K]
    noise : float or None                   Before rounding, where it is stated. Else it is found, from readings on three levels at least or
                                            a signal that passes a step: jumps between two levels alone say as much of the signal. [K]

    Notes
    -----
    With weights W of the samples the errors have the covariance ``W C W'``, C that of the rounding errors along the line. A signal that
    moves by less than a step may also have moved up or down behind one reading: by the difference of two even errors, ``step / sqrt(6)``,
    less what noise before rounding shows of it.
    """
    x = times - times.mean()
    path = rate * x
    moves = abs(rate) * float(np.ptp(times)) >= step
    shows_noise = moves or np.unique(np.round(readings / step)).size > 2
    blur = noise if noise is not None else blur_of(path, readings, step) if shows_noise else 0.0
    columns, own_variance = shared_rounding(path, step, blur, np.arange(times.size), times.size)
    slope = x / float(x @ x)
    weights = np.vstack([1.0 / times.size + (at - times.mean()) * slope, slope])
    hidden = 0.0 if moves else np.sqrt(2.0 * own_variance) / float(np.ptp(times))
    return np.hstack([weights @ columns, [[0.0], [hidden]]])
