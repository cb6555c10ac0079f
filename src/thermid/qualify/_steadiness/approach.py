"""How readings approach their end: every pair of time constants that explains them, weighed by how well it does, and what each says next.

The response of a thermal network under constant conditions is a sum of exponentials. Two of them, the fast beginning left out, describe
what is left; which two is what short readings do not say. So none is chosen: all are kept with their weights, and the spread of what they
predict is the error. The weights are those of Bayesian model averaging with amplitudes of the size of the change that was seen
(J. A. Hoeting et al., Statistical Science 14 (1999) 382-417, DOI 10.1214/ss/1009212519).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Final

import numpy as np

from thermid.base.memo import Memo
from thermid.measure.records import FloatArray
from thermid.measure.steadiness import effective_samples

MEDIANS_OF_READINGS: Final = 120
"""Medians that stand for the readings."""
SKIPPED_SHARE: Final = 0.3
"""Share of the stretch whose beginning is left to the fast parts, which two exponentials do not describe; decision 067 has the figures."""
MIN_TIME_CONSTANT_SHARE_TRIED: Final = 1.0 / 12.0
"""Shortest time constant tried, over the stretch."""
TIME_CONSTANTS_PER_DECADE: Final = 12
"""Time constants tried in each factor of ten."""
CURVATURE_ERROR_SHARE: Final = 0.1
"""Error of the change that is still to come, as a share of it: coefficients that grow with differences bend the exponentials. A natural
convection with an exponent of 1/4 changes by a tenth over the last third of an approach. [-]"""
CURVATURE_SHARE_OF_READINGS: Final = 0.005
"""The same within the readings, as a share of the change in them: what cannot be told from noise. [-]"""
SCALES: Final = np.exp(0.2 * np.linspace(-2.0, 2.0, 9))
"""Factors on time constants that a model gives: it is trusted to 20 %."""


@dataclass(frozen=True)
class Mixture:
    """A weighted sum of normal distributions.

    Parameters
    ----------
    weights, means, spreads : array (parts,)   [-], [K], [K]
    """

    weights: FloatArray
    means: FloatArray
    spreads: FloatArray

    @property
    def mean(self) -> float:
        """Mean: sum of weights times means. [K]"""
        return float(self.weights @ self.means)

    def below(self, value: float) -> float:
        """Return the probability of a value below `value` [K]: sum of weights Phi((value - mean) / spread)."""
        from scipy.special import ndtr

        return float(self.weights @ ndtr((value - self.means) / self.spreads))

    def quantile(self, share: float) -> float:
        """Return the value with the probability `share` below it, by bisection. [K]"""
        keep = self.weights > 1e-6 * self.weights.max()
        part = Mixture(self.weights[keep] / self.weights[keep].sum(), self.means[keep], self.spreads[keep])
        low, high = float((part.means - 9.0 * part.spreads).min()), float((part.means + 9.0 * part.spreads).max())
        for _ in range(60):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if part.below(middle) < share else (low, middle)
        return 0.5 * (low + high)


@dataclass(frozen=True, eq=False)
class Approach:
    """Approach of readings to their end, as a weighted mixture of curves.

    A curve is T(t) = c + sum a_k exp(-(t - now) / tau_k), plus gains times the reference behind each tau_k.

    Parameters
    ----------
    start, now : float          Begin and end of the readings. [s]
    taus : array (parts, modes) Time constants tau_k of each curve. [s]
    weights : array (parts,)    Posterior probability of each curve.
    means : array (parts, terms)                Posterior mean of c, the amplitudes a_k at `now`, and gains of the reference. [K, -]
    covariances : array (parts, terms, terms)   Posterior covariance of these.
    noise : float               Standard deviation of a median about the best curve. [K]
    scatter : float             Standard deviation of a reading about its median. [K]
    worth : float               Effective number of medians.
    room : Reference or None    A temperature that the readings follow, such as the air.
    """

    start: float
    now: float
    taus: FloatArray
    weights: FloatArray
    means: FloatArray
    covariances: FloatArray
    noise: float
    scatter: float
    worth: float
    room: Reference | None

    @cached_property
    def _spread_factor(self) -> float:
        """Factor sqrt(f / (f - 2)) on standard deviations, f = max(worth - 5, 3): Student's distribution for few readings."""
        free = max(self.worth - 5.0, 3.0)
        return float(np.sqrt(free / (free - 2.0)))

    def _factors(self, at: float) -> FloatArray:
        """Return what multiplies each term (parts, terms) at t = `at` [s]: 1, exp(-(t - now) / tau_k) [-], and terms of the reference [K].

        At infinity only the constant is left. Terms of the reference are as in `Reference.later`.
        """
        fall = np.zeros(self.taus.shape) if np.isinf(at) else np.exp(-(at - self.now) / self.taus)
        columns = [np.ones((self.taus.shape[0], 1)), fall]
        if self.room is not None:
            columns.append(self.room.later(self.taus, fall))
        return np.hstack(columns)

    def at(self, time: float, reading: bool = False) -> Mixture:
        """Return the distribution of the temperature at a time [s], infinity for the end. [K]

        The variance of each curve is that of its terms, of exponentials that bend (`CURVATURE_ERROR_SHARE` of the change to come), of the
        noise
        of medians and, for a single `reading`, of its scatter.
        """
        terms = self._factors(time)
        means = np.einsum("pt,pt->p", terms, self.means)
        variances = np.einsum("pt,ptu,pu->p", terms, self.covariances, terms) * self._spread_factor**2
        stands = np.einsum("pt,pt->p", self._factors(self.now), self.means)
        variances = variances + (CURVATURE_ERROR_SHARE * (means - stands)) ** 2
        # the wander that the fit leaves is there at any later time too
        variances = variances + self.noise**2 + (self.scatter**2 if reading else 0.0)
        return Mixture(self.weights, means, np.sqrt(variances))

    def rate(self, time: float) -> FloatArray:
        """Return dT/dt = -sum a_k exp(-(t - now) / tau_k) / tau_k of each curve at a time (parts,). [K/s]"""
        fall = np.exp(-(time - self.now) / self.taus) / self.taus
        return np.asarray(-np.einsum("pm,pm->p", fall, self.means[:, 1 : 1 + self.taus.shape[1]]))

    def slowest(self, share: float) -> float:
        """Return the longest time constant t with P(tau >= t) >= `share`, tau the slowest of a curve. [s]"""
        order = np.argsort(self.taus[:, -1])
        tail = np.cumsum(self.weights[order][::-1])[::-1]
        above = np.flatnonzero(tail >= share)
        return float(self.taus[order[above[-1]], -1])


@dataclass(frozen=True, eq=False)
class Reference:
    """A temperature that the readings follow through first-order lags.

    Parameters
    ----------
    times, values : array (samples,)    Temperature less its last level. [s], [K]
    last : float                        Its last level, taken to hold. [K]
    memo : Memo                         Lagged temperatures by time constant.
    """

    times: FloatArray
    values: FloatArray
    last: float
    memo: Memo = field(init=False, default_factory=Memo, compare=False, repr=False)

    def filtered(self, tau: float) -> FloatArray:
        """Return it behind a first-order lag, tau dy/dt = u - y, u straight between samples and y(0) = u(0) (samples,). [K]"""
        return self.memo.value(tau, lambda: self._filter(tau))

    def _filter(self, tau: float) -> FloatArray:
        """Compute `filtered` sample by sample, exactly for straight lines."""
        out = np.empty(self.values.size)
        out[0] = self.values[0]
        for k in range(1, self.values.size):
            dt = self.times[k] - self.times[k - 1]
            slope = (self.values[k] - self.values[k - 1]) / dt
            keep = np.exp(-dt / tau)
            out[k] = self.values[k] - slope * tau + (out[k - 1] - self.values[k - 1] + slope * tau) * keep
        return out

    def later(self, taus: FloatArray, fall: FloatArray) -> FloatArray:
        """Return its terms at a later time (parts, modes): the last lagged values times `fall`, which is exp(-(t - now) / tau). [K]"""
        ends = np.vectorize(lambda tau: self.filtered(float(tau))[-1])(taus) * fall
        return _mean_and_differences(ends)


def approach(
    times: FloatArray,
    kelvin: FloatArray,
    slowest: float,
    time_constants: Sequence[float] = (),
    room: tuple[FloatArray, FloatArray] | None = None,
    bent: float = CURVATURE_SHARE_OF_READINGS,
) -> Approach:
    """Fit sums of exponentials to readings under constant conditions, and weigh them by their evidence.

    Readings are reduced to medians without the first `SKIPPED_SHARE`. Each pair of time constants of a grid is one curve, linear in its
    amplitudes; its weight is prior times evidence (Bayesian model averaging).

    Parameters
    ----------
    times, kelvin : array (samples,)    Readings. [s], [K]
    slowest : float                     Longest time constant that is possible. [s]
    time_constants : sequence of float  Time constants of a model, in place of the grid; trusted to 20 %. [s]
    room : (times, kelvin)              A temperature that the readings follow, such as the air. [s], [K]
    bent : float                        Share of the change in the readings by which exponentials may miss them. [-]
    """
    span = float(times[-1] - times[0])
    axis, medians, scatter = _medians(times, kelvin, times[0] + SKIPPED_SHARE * span)
    now = float(times[-1])
    reference = None if room is None else _reference(*room, axis)
    scale = max(float(np.ptp(_medians(times, kelvin, float(times[0]))[1])), 1e-3)
    middle = float(medians[-1])
    if time_constants:
        slow_constants = sorted(t for t in time_constants if np.isfinite(t) and t > span * MIN_TIME_CONSTANT_SHARE_TRIED / 3.0)[-3:] or [
            max(time_constants)
        ]
        taus = SCALES[:, None] * np.array(slow_constants)[None, :]
        prior = np.exp(-0.5 * np.linspace(-2.0, 2.0, SCALES.size) ** 2)
    else:
        taus = _time_constant_pairs(span, slowest)
        prior = np.ones(taus.shape[0])
    designs = np.stack([_design(axis, now, row, reference) for row in taus])
    terms = designs.shape[2]
    _, _, residuals_of_each, _ = _bayesian_regression(designs, medians - middle, scale, taus.shape[1], 1e-6 * scale)
    residuals = residuals_of_each[int(np.argmin(np.einsum("pb,pb->p", residuals_of_each, residuals_of_each)))]
    worth = effective_samples(residuals, terms + 2)
    factor = medians.size / worth
    noise = float(np.sqrt(residuals @ residuals / max(medians.size - factor * (terms + 2), medians.size / 4.0)))
    noise = max(noise, scatter / 12.0, 1e-6 * scale)
    size = float(np.hypot(noise, bent * np.ptp(medians)) * factor**0.5)
    means, covariances, _, evidence = _bayesian_regression(designs, medians - middle, scale, taus.shape[1], size)
    means[:, 0] += middle
    weights = prior * np.exp(evidence - evidence.max())
    return Approach(float(times[0]), now, taus, weights / weights.sum(), means, covariances, noise, scatter, worth, reference)


def _medians(times: FloatArray, kelvin: FloatArray, begin: float) -> tuple[FloatArray, FloatArray, float]:
    """Return times [s] and medians [K] of bins from `begin` on, and the standard deviation of readings about them. [K]

    It is the median absolute deviation over 0.6745. Up to `MEDIANS_OF_READINGS` readings are taken as they are, with that of successive
    differences over sqrt(2).
    """
    late = times >= begin
    t, y = times[late], kelvin[late]
    if t.size <= MEDIANS_OF_READINGS:
        steps = np.diff(y)
        return t, y, float(np.median(np.abs(steps)) / 0.6745 / 2.0**0.5) if steps.size else 0.0
    edges = np.linspace(t[0], t[-1], MEDIANS_OF_READINGS + 1)
    index = np.clip(np.searchsorted(edges, t, side="right") - 1, 0, MEDIANS_OF_READINGS - 1)
    groups = [index == k for k in range(MEDIANS_OF_READINGS)]
    filled = [g for g in groups if g.any()]
    axis = np.array([t[g].mean() for g in filled])
    # a mean of the middle half resists spikes as a median does, and is not bound to the steps of a sensor
    medians = np.array([_interquartile_mean(y[g]) for g in filled])
    off = np.concatenate([y[g] - m for g, m in zip(filled, medians, strict=True)])
    return axis, medians, float(np.median(np.abs(off)) / 0.6745)


def _interquartile_mean(values: FloatArray) -> float:
    """Return the mean of the middle half of some values."""
    cut = values.size // 4
    return float(np.sort(values)[cut : values.size - cut].mean())


def _reference(times: FloatArray, kelvin: FloatArray, axis: FloatArray) -> Reference:
    """Return a reference of (times [s], kelvin) on the times of the medians, less the mean of its last tenth."""
    _, smooth, _ = _medians(times, kelvin, float(times[0]))
    points, _, _ = _medians(times, times, float(times[0]))
    last = float(smooth[-max(smooth.size // 10, 1) :].mean())
    grid = np.union1d(points, axis)
    return Reference(grid, np.interp(grid, points, smooth) - last, last)


def _time_constant_pairs(span: float, slowest: float) -> FloatArray:
    """Return pairs of time constants (pairs, 2) of a logarithmic grid up to `slowest`, the slower second, two steps apart at least. [s]"""
    fast = span * MIN_TIME_CONSTANT_SHARE_TRIED
    top = max(slowest, 3.0 * fast)
    count = max(3, round(TIME_CONSTANTS_PER_DECADE * np.log10(top / fast)) + 1)
    grid = np.geomspace(fast, top, count)
    return np.array([(a, b) for i, a in enumerate(grid) for b in grid[i + 2 :]])


def _design(axis: FloatArray, now: float, taus: FloatArray, room: Reference | None) -> FloatArray:
    """Return the terms of a curve at times `axis` (bins, terms): 1, exp(-(t - now) / tau) for each tau, the reference behind each."""
    columns = [np.ones(axis.size), *(np.exp(-(axis - now) / tau) for tau in taus)]
    if room is not None:
        where = np.searchsorted(room.times, axis)
        columns += list(_mean_and_differences(np.column_stack([room.filtered(float(tau))[where] for tau in taus])).T)
    return np.column_stack(columns)


def _mean_and_differences(behind: FloatArray) -> FloatArray:
    """Return columns (rows, modes) as their mean and, but for the first column, their differences from it."""
    mean = behind.mean(axis=1)
    return np.column_stack([mean, *(behind[:, k] - mean for k in range(1, behind.shape[1]))])


def _bayesian_regression(
    x: FloatArray, y: FloatArray, scale: float, modes: int, size: float
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return posterior means (parts, terms), covariances, residuals (parts, bins) and log evidence (parts,) of linear models.

    With terms X of a part, prior mean m and standard deviations S = diag(s), noise `size` and A = 1 + S X'X S / size^2: covariance S A^-1
    S,
    mean m + S A^-1 S X'(y - X m) / size^2, log evidence -(r'r / size^2 - b'A^-1 b) / 2 - log det(A) / 2 with r = y - X m, b = S X'r /
    size^2.

    Parameters
    ----------
    x : array (parts, bins, terms)  Terms: 1, `modes` exponentials, the reference.
    y : array (bins,)               Readings less their last. [K]
    scale : float                   Change that was seen: the prior of the end is 3 times it, that of an amplitude at the first bin once.
                                    [K]
    modes : int                     Number of exponentials; prior of the reference's gain is 1 +- 0.1, of differences 0 +- 0.5.
    size : float                    Standard deviation of a median. [K]
    """
    parts, _, terms = x.shape
    begin = np.maximum(np.abs(x[:, 0, 1 : 1 + modes]), 1e-12)
    follows = terms - 1 - modes
    gains = np.tile([0.1, *[0.5] * (follows - 1)][:follows], (parts, 1)).reshape(parts, follows)
    spread = np.concatenate([np.full((parts, 1), 3.0 * scale), scale / begin, gains], axis=1)
    expected = np.concatenate([np.zeros(1 + modes), [1.0, *[0.0] * (follows - 1)][:follows]])
    rest = y - x @ expected
    scaled = x * (spread / size)[:, None, :]
    precision = scaled.transpose(0, 2, 1) @ scaled + np.eye(terms)
    lower = np.linalg.cholesky(precision)
    drive = scaled.transpose(0, 2, 1) @ (rest / size)[:, :, None]
    half = np.linalg.solve(lower, drive)[:, :, 0]
    inverse = np.linalg.inv(precision)
    mean = expected + spread * (inverse @ drive)[:, :, 0]
    covariance = inverse * (spread[:, :, None] * spread[:, None, :])
    fit = np.einsum("pb,pb->p", rest, rest) / size**2 - np.einsum("pt,pt->p", half, half)
    weight = -0.5 * fit - np.log(np.diagonal(lower, axis1=1, axis2=2)).sum(axis=1)
    return mean, covariance, y - (x @ mean[:, :, None])[:, :, 0], weight
