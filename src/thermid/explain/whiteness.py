"""Are residuals noise: tests for correlations, and the likelihood of residuals that wander."""

from __future__ import annotations

import numpy as np

from thermid.linear_algebra import Array

MOST_LAGS, STRETCHES, FEWEST = 20, 150, 12


def ljung_box(residuals: Array) -> tuple[float, float]:
    """Return the autocorrelation of neighbours, and the probability of correlations as large by chance."""
    from scipy.special import gammaincc

    z, n = residuals - residuals.mean(), residuals.size
    lags = min(MOST_LAGS, n // 5)
    power = float(z @ z)
    if lags < 1 or power <= 0:
        return 0.0, 1.0
    rho = np.array([float(z[k:] @ z[:-k]) / power for k in range(1, lags + 1)])
    statistic = n * (n + 2) * float(np.sum(rho**2 / (n - np.arange(1, lags + 1))))
    return float(rho[0]), float(gammaincc(0.5 * lags, 0.5 * statistic))


def cumulated_periodogram(residuals: Array) -> Array:
    """Return the share of the variance below each frequency (frequencies,), a straight line for white noise. [-]"""
    z = residuals - residuals.mean()
    power = np.abs(np.fft.rfft(z))[1 : (z.size + 1) // 2] ** 2
    total = float(power.sum())
    return np.cumsum(power) / total if total > 0 else np.linspace(0.0, 1.0, power.size)


def periodogram(residuals: Array) -> tuple[float, float]:
    """Return the largest distance from the straight line, and the distance that chance allows at 95 %."""
    share = cumulated_periodogram(residuals)
    if share.size < 3:
        return 0.0, 1.0
    line = np.arange(1, share.size + 1) / share.size
    # noise that changes sign too often lies below the line, and no element is missing for that
    return max(0.0, float((share - line).max())), float(1.36 / np.sqrt(share.size - 1))


def stretches(residuals: Array, times: Array) -> tuple[Array, Array]:
    """Return residuals as means over at most `STRETCHES` stretches of equally many readings."""
    parts = np.array_split(np.arange(residuals.size), min(STRETCHES, residuals.size))
    return np.array([residuals[p].mean() for p in parts]), np.array([times[p].mean() for p in parts])


def modes_of(times: Array) -> list[tuple[Array, Array]]:
    """Return sizes and vectors of the correlations exp(-dt / time), for times from one stretch to the whole."""
    if times.size < FEWEST:
        return []
    apart = np.abs(times[:, None] - times[None, :])
    spacing, span = float(np.median(np.diff(times))), float(times[-1] - times[0])
    found = (np.linalg.eigh(np.exp(-apart / time)) for time in np.geomspace(spacing, max(span, 2.0 * spacing), 8))
    return [(np.maximum(sizes, 0.0), vectors) for sizes, vectors in found]


def trace_likelihood(z: Array, modes: list[tuple[Array, Array]], least: float) -> float:
    """Return the largest log-likelihood of residuals as the sum of independent errors and of a part with correlations exp(-dt / time).

    Independent errors are not made smaller than `least`, or a perfect fit would be infinitely likely. [K]
    """
    n = z.size
    calm = max(float(z @ z) / n, least**2)
    best = -0.5 * n * float(np.log(calm)) - 0.5 * float(z @ z) / calm
    for sizes, vectors in modes:
        variances = 1.0 + np.geomspace(1e-2 / sizes[-1], 1e3, 40)[:, None] * sizes
        squares = ((vectors.T @ z) ** 2 / variances).sum(axis=1)
        own = np.maximum(squares / n, least**2)
        best = max(best, float(np.max(-0.5 * (n * np.log(own) + np.log(variances).sum(axis=1) + squares / own))))
    return best
