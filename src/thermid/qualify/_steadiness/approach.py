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

BINS: Final = 120
"""Medians that stand for the readings."""
SKIP: Final = 0.3
"""Share of the stretch whose beginning is left to the fast parts, which two exponentials do not describe; decision 067 has the figures."""
FASTEST: Final = 1.0 / 12.0
"""Shortest time constant tried, over the stretch."""
STEPS: Final = 12
"""Time constants tried in each factor of ten."""
BEND: Final = 0.1
"""Error of the change that is still to come, as a share of it: coefficients that grow with differences bend the exponentials. A natural
convection with an exponent of 1/4 changes by a tenth over the last third of an approach. [-]"""
BENT: Final = 0.005
"""The same within the readings, as a share of the change in them: what cannot be told from noise. [-]"""
SCALES: Final = np.exp(0.2 * np.linspace(-2.0, 2.0, 9))
"""Factors on time constants that a model gives: it is trusted to 20 %."""


@dataclass(frozen=True)
class Mixture:
    """A sum of normal distributions.

    Parameters
    ----------
    weights, means, spreads : array (parts,)   [-], [K], [K]
    """

    weights: FloatArray
    means: FloatArray
    spreads: FloatArray

    @property
    def mean(self) -> float:
        """[K]"""
        return float(self.weights @ self.means)

    def below(self, value: float) -> float:
        """Return the probability of lying below a value."""
        from scipy.special import ndtr

        return float(self.weights @ ndtr((value - self.means) / self.spreads))

    def quantile(self, share: float) -> float:
        """Return the value with that share below it. [K]"""
        keep = self.weights > 1e-6 * self.weights.max()
        part = Mixture(self.weights[keep] / self.weights[keep].sum(), self.means[keep], self.spreads[keep])
        low, high = float((part.means - 9.0 * part.spreads).min()), float((part.means + 9.0 * part.spreads).max())
        for _ in range(60):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if part.below(middle) < share else (low, middle)
        return 0.5 * (low + high)


@dataclass(frozen=True, eq=False)
class Approach:
    """What the readings of a stretch say about where they go.

    Parameters
    ----------
    start, now : float          Begin and end of the stretch. [s]
    taus : array (parts, modes) Time constants of every part. [s]
    weights : array (parts,)    How well each explains the readings.
    means : array (parts, terms)                Constant, amplitudes at `now`, and gains of the reference.
    covariances : array (parts, terms, terms)
    noise : float               Standard deviation of one median about the fit. [K]
    scatter : float             Standard deviation of one reading about its median. [K]
    worth : float               As many medians without correlation would say as much.
    room : Reference or None    The temperature that the readings follow beside their own approach.
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
        """Factor on spreads: few readings do not know their own noise (Student's distribution)."""
        free = max(self.worth - 5.0, 3.0)
        return float(np.sqrt(free / (free - 2.0)))

    def _terms(self, at: float) -> FloatArray:
        """Return what multiplies the terms (parts, terms) at a time; infinity for the end. [K per term]"""
        fall = np.zeros(self.taus.shape) if np.isinf(at) else np.exp(-(at - self.now) / self.taus)
        columns = [np.ones((self.taus.shape[0], 1)), fall]
        if self.room is not None:
            columns.append(self.room.later(self.taus, fall))
        return np.hstack(columns)

    def at(self, time: float, reading: bool = False) -> Mixture:
        """Return the temperature at a later time, infinity for the end; `reading` adds the scatter of one reading. [K]"""
        terms = self._terms(time)
        means = np.einsum("pt,pt->p", terms, self.means)
        variances = np.einsum("pt,ptu,pu->p", terms, self.covariances, terms) * self._spread_factor**2
        stands = np.einsum("pt,pt->p", self._terms(self.now), self.means)
        variances = variances + (BEND * (means - stands)) ** 2
        # the wander that the fit leaves is there at any later time too
        variances = variances + self.noise**2 + (self.scatter**2 if reading else 0.0)
        return Mixture(self.weights, means, np.sqrt(variances))

    def rate(self, time: float) -> FloatArray:
        """Return the drift that each part expects at a later time (parts,). [K/s]"""
        fall = np.exp(-(time - self.now) / self.taus) / self.taus
        return np.asarray(-np.einsum("pm,pm->p", fall, self.means[:, 1 : 1 + self.taus.shape[1]]))

    def slowest(self, share: float) -> float:
        """Return the time constant that the slowest part lies above with a probability. [s]"""
        order = np.argsort(self.taus[:, -1])
        tail = np.cumsum(self.weights[order][::-1])[::-1]
        above = np.flatnonzero(tail >= share)
        return float(self.taus[order[above[-1]], -1])


@dataclass(frozen=True, eq=False)
class Reference:
    """A temperature that the readings follow, seen through every time constant.

    Parameters
    ----------
    times, values : array (samples,)    Temperature less its last level. [s], [K]
    last : float                        Its last level, which is taken to hold. [K]
    memo : Memo                         It behind time constants.
    """

    times: FloatArray
    values: FloatArray
    last: float
    memo: Memo = field(init=False, default_factory=Memo, compare=False, repr=False)

    def filtered(self, tau: float) -> FloatArray:
        """Return it behind one time constant (samples,), straight between samples. [K]"""
        return self.memo.value(tau, lambda: self._filter(tau))

    def _filter(self, tau: float) -> FloatArray:
        out = np.empty(self.values.size)
        out[0] = self.values[0]
        for k in range(1, self.values.size):
            dt = self.times[k] - self.times[k - 1]
            slope = (self.values[k] - self.values[k - 1]) / dt
            keep = np.exp(-dt / tau)
            out[k] = self.values[k] - slope * tau + (out[k - 1] - self.values[k - 1] + slope * tau) * keep
        return out

    def later(self, taus: FloatArray, fall: FloatArray) -> FloatArray:
        """Return what it still gives at a later time (parts, modes), its last level held. [K]"""
        ends = np.vectorize(lambda tau: self.filtered(float(tau))[-1])(taus) * fall
        return _gains(ends)


def approach(
    times: FloatArray,
    kelvin: FloatArray,
    slowest: float,
    time_constants: Sequence[float] = (),
    room: tuple[FloatArray, FloatArray] | None = None,
    bent: float = BENT,
) -> Approach:
    """Return what readings under constant conditions say about their end.

    Parameters
    ----------
    times, kelvin : array (samples,)    Readings of the stretch. [s], [K]
    slowest : float                     Longest time constant that is thought possible. [s]
    time_constants : sequence of float  Time constants by a model, in place of the search; trusted to 20 %. [s]
    room : (times, kelvin)              A temperature that the readings follow, such as the air around. [s], [K]
    bent : float                        Share of the change in the readings by which exponentials may miss them. [-]
    """
    span = float(times[-1] - times[0])
    axis, medians, scatter = _medians(times, kelvin, times[0] + SKIP * span)
    now = float(times[-1])
    reference = None if room is None else _reference(*room, axis)
    scale = max(float(np.ptp(_medians(times, kelvin, float(times[0]))[1])), 1e-3)
    middle = float(medians[-1])
    if time_constants:
        slow_constants = sorted(t for t in time_constants if np.isfinite(t) and t > span * FASTEST / 3.0)[-3:] or [max(time_constants)]
        taus = SCALES[:, None] * np.array(slow_constants)[None, :]
        prior = np.exp(-0.5 * np.linspace(-2.0, 2.0, SCALES.size) ** 2)
    else:
        taus = _pairs(span, slowest)
        prior = np.ones(taus.shape[0])
    designs = np.stack([_design(axis, now, row, reference) for row in taus])
    terms = designs.shape[2]
    _, _, residuals_of_each, _ = _ridge(designs, medians - middle, scale, taus.shape[1], 1e-6 * scale)
    residuals = residuals_of_each[int(np.argmin(np.einsum("pb,pb->p", residuals_of_each, residuals_of_each)))]
    worth = effective_samples(residuals, terms + 2)
    factor = medians.size / worth
    noise = float(np.sqrt(residuals @ residuals / max(medians.size - factor * (terms + 2), medians.size / 4.0)))
    noise = max(noise, scatter / 12.0, 1e-6 * scale)
    size = float(np.hypot(noise, bent * np.ptp(medians)) * factor**0.5)
    means, covariances, _, evidence = _ridge(designs, medians - middle, scale, taus.shape[1], size)
    means[:, 0] += middle
    weights = prior * np.exp(evidence - evidence.max())
    return Approach(float(times[0]), now, taus, weights / weights.sum(), means, covariances, noise, scatter, worth, reference)


def _medians(times: FloatArray, kelvin: FloatArray, begin: float) -> tuple[FloatArray, FloatArray, float]:
    """Return times and medians of bins, and the scatter of readings about them (by their median deviation). [s], [K], [K]"""
    late = times >= begin
    t, y = times[late], kelvin[late]
    if t.size <= BINS:
        steps = np.diff(y)
        return t, y, float(np.median(np.abs(steps)) / 0.6745 / 2.0**0.5) if steps.size else 0.0
    edges = np.linspace(t[0], t[-1], BINS + 1)
    index = np.clip(np.searchsorted(edges, t, side="right") - 1, 0, BINS - 1)
    groups = [index == k for k in range(BINS)]
    filled = [g for g in groups if g.any()]
    axis = np.array([t[g].mean() for g in filled])
    # a mean of the middle half resists spikes as a median does, and is not bound to the steps of a sensor
    medians = np.array([_middle(y[g]) for g in filled])
    off = np.concatenate([y[g] - m for g, m in zip(filled, medians, strict=True)])
    return axis, medians, float(np.median(np.abs(off)) / 0.6745)


def _middle(values: FloatArray) -> float:
    """Return the mean of the middle half."""
    cut = values.size // 4
    return float(np.sort(values)[cut : values.size - cut].mean())


def _reference(times: FloatArray, kelvin: FloatArray, axis: FloatArray) -> Reference:
    """Return a reference on the axis of the medians, less its last level."""
    _, smooth, _ = _medians(times, kelvin, float(times[0]))
    points, _, _ = _medians(times, times, float(times[0]))
    last = float(smooth[-max(smooth.size // 10, 1) :].mean())
    grid = np.union1d(points, axis)
    return Reference(grid, np.interp(grid, points, smooth) - last, last)


def _pairs(span: float, slowest: float) -> FloatArray:
    """Return pairs of time constants (pairs, 2), the slower one second. [s]"""
    fast = span * FASTEST
    top = max(slowest, 3.0 * fast)
    count = max(3, round(STEPS * np.log10(top / fast)) + 1)
    grid = np.geomspace(fast, top, count)
    return np.array([(a, b) for i, a in enumerate(grid) for b in grid[i + 2 :]])


def _design(axis: FloatArray, now: float, taus: FloatArray, room: Reference | None) -> FloatArray:
    """Return the terms (bins, terms): a constant, the exponentials, the reference behind each time constant."""
    columns = [np.ones(axis.size), *(np.exp(-(axis - now) / tau) for tau in taus)]
    if room is not None:
        where = np.searchsorted(room.times, axis)
        columns += list(_gains(np.column_stack([room.filtered(float(tau))[where] for tau in taus])).T)
    return np.column_stack(columns)


def _gains(behind: FloatArray) -> FloatArray:
    """Return what gains multiply (..., modes): the mean of the reference behind all time constants, and each other's difference from it."""
    mean = behind.mean(axis=1)
    return np.column_stack([mean, *(behind[:, k] - mean for k in range(1, behind.shape[1]))])


def _ridge(x: FloatArray, y: FloatArray, scale: float, modes: int, size: float) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return means (parts, terms) and covariances of the terms of every part, what is left of the readings, and the log of its evidence.

    `x` are the terms (parts, bins, terms), `y` the readings (bins,). Before any reading, the end lies within a few times the change seen,
    each amplitude (at the beginning of the readings) within once that change, and the reference is followed with a gain of one.
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
