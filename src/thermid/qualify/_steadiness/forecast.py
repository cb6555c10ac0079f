"""Where a temperature will end, and when a rule of stability will hold, said while the test is still running - or declined.

How readings approach their end: the response of a thermal network under constant conditions is a sum of exponentials. Two of them, the
fast beginning left out, describe what is left; which two is what short readings do not say. So none is chosen: every pair of time constants
that explains the readings is kept, weighed by how well it does, and the spread of what they predict is the error. The weights are those of
Bayesian model averaging with amplitudes of the size of the change that was seen (J. A. Hoeting et al., Statistical Science 14 (1999)
382-417, DOI 10.1214/ss/1009212519).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Final

import numpy as np

from thermid.base.errors import CodedText, RecordError, ScenarioError
from thermid.base.results import Result, Row
from thermid.base.units import HOUR, ICE_POINT, Array, Bools, Memo, amount, duration_text, positive_seconds, short
from thermid.measure.records import Record, StabilityRule, effective_samples
from thermid.model.tree import Model
from thermid.simulation.runs import Scenario, simulate

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

    weights: Array
    means: Array
    spreads: Array

    @property
    def mean(self) -> float:
        """Mean: sum of weights times means. [K]"""
        return float(self.weights @ self.means)

    def below(self, value: float) -> float:
        """Return the probability of a value below `value` [K]: sum of weights Phi((value - mean) / spread)."""
        from scipy.special import ndtr

        return float(self.weights @ ndtr((value - self.means) / self.spreads))

    def quantile(self, share: float) -> float:
        """Return the value with the probability `share` below it, by Brent's method. [K]"""
        from scipy.optimize import brentq

        keep = self.weights > 1e-6 * self.weights.max()
        part = Mixture(self.weights[keep] / self.weights[keep].sum(), self.means[keep], self.spreads[keep])
        low, high = float((part.means - 9.0 * part.spreads).min()), float((part.means + 9.0 * part.spreads).max())
        return float(brentq(lambda value: part.below(value) - share, low, high))


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
    taus: Array
    weights: Array
    means: Array
    covariances: Array
    noise: float
    scatter: float
    worth: float
    room: Reference | None

    @cached_property
    def _spread_factor(self) -> float:
        """Factor sqrt(f / (f - 2)) on standard deviations, f = max(worth - 5, 3): Student's distribution for few readings. [-]

        Five are taken off for a constant, two amplitudes and two time constants.
        """
        free = max(self.worth - 5.0, 3.0)
        return float(np.sqrt(free / (free - 2.0)))

    def _factors(self, at: float) -> Array:
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
        noise of medians and, for a single `reading`, of its scatter.
        """
        terms = self._factors(time)
        means = np.einsum("pt,pt->p", terms, self.means)
        variances = np.einsum("pt,ptu,pu->p", terms, self.covariances, terms) * self._spread_factor**2
        stands = np.einsum("pt,pt->p", self._factors(self.now), self.means)
        variances = variances + (CURVATURE_ERROR_SHARE * (means - stands)) ** 2
        # the wander that the fit leaves is there at any later time too
        variances = variances + self.noise**2 + (self.scatter**2 if reading else 0.0)
        return Mixture(self.weights, means, np.sqrt(variances))

    def rate(self, time: float) -> Array:
        """Return dT/dt = -sum a_k exp(-(t - now) / tau_k) / tau_k of each curve at a time (parts,). [K/s]"""
        fall = np.exp(-(time - self.now) / self.taus) / self.taus
        return np.asarray(-np.einsum("pm,pm->p", fall, self.means[:, 1 : 1 + self.taus.shape[1]]))

    def slowest(self, share: float) -> float:
        """Return the longest time constant t with P(tau >= t) >= `share`, tau the slowest of a curve. [s]"""
        order = np.argsort(self.taus[:, -1])
        above = np.flatnonzero(np.cumsum(self.weights[order][::-1])[::-1] >= share)
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

    times: Array
    values: Array
    last: float
    memo: Memo = field(init=False, default_factory=Memo, compare=False, repr=False)

    def filtered(self, tau: float) -> Array:
        """Return it behind a first-order lag, tau dy/dt = u - y, u straight between samples and y(0) = u(0) (samples,). [K]"""
        return self.memo.value(tau, lambda: self._filter(tau))

    def _filter(self, tau: float) -> Array:
        """Return the values (samples,) [K] behind a lag of `tau` [s]: tau dy/dt = x - y, y = x at first, exact for straight x."""
        out = np.empty(self.values.size)
        out[0] = self.values[0]
        for k in range(1, self.values.size):
            dt = self.times[k] - self.times[k - 1]
            slope = (self.values[k] - self.values[k - 1]) / dt
            keep = np.exp(-dt / tau)
            out[k] = self.values[k] - slope * tau + (out[k - 1] - self.values[k - 1] + slope * tau) * keep
        return out

    def later(self, taus: Array, fall: Array) -> Array:
        """Return its terms at a later time (parts, modes): the last lagged values times `fall`, which is exp(-(t - now) / tau). [K]"""
        ends = np.vectorize(lambda tau: self.filtered(float(tau))[-1])(taus) * fall
        return _mean_and_differences(ends)


def approach(
    times: Array,
    kelvin: Array,
    slowest: float,
    time_constants: Sequence[float] = (),
    room: tuple[Array, Array] | None = None,
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
    reference = None
    if room is not None:  # on the times of the medians, less the mean of its last tenth
        _, smooth, _ = _medians(*room, float(room[0][0]))
        points, _, _ = _medians(room[0], room[0], float(room[0][0]))
        last = float(smooth[-max(smooth.size // 10, 1) :].mean())
        grid = np.union1d(points, axis)
        reference = Reference(grid, np.interp(grid, points, smooth) - last, last)
    scale = max(float(np.ptp(_medians(times, kelvin, float(times[0]))[1])), 1e-3)
    middle = float(medians[-1])
    if time_constants:
        slow_constants = sorted(t for t in time_constants if np.isfinite(t) and t > span * MIN_TIME_CONSTANT_SHARE_TRIED / 3.0)[-3:] or [
            max(time_constants)
        ]
        taus = SCALES[:, None] * np.array(slow_constants)[None, :]
        prior = np.exp(-0.5 * np.linspace(-2.0, 2.0, SCALES.size) ** 2)
    else:
        # pairs of a logarithmic grid up to `slowest`, the slower second, two steps apart at least (pairs, 2) [s]
        fast = span * MIN_TIME_CONSTANT_SHARE_TRIED
        top = max(slowest, 3.0 * fast)
        grid = np.geomspace(fast, top, max(3, round(TIME_CONSTANTS_PER_DECADE * np.log10(top / fast)) + 1))
        taus = np.array([(a, b) for i, a in enumerate(grid) for b in grid[i + 2 :]])
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


def _medians(times: Array, kelvin: Array, begin: float) -> tuple[Array, Array, float]:
    """Return times [s] and middles [K] of at most `MEDIANS_OF_READINGS` bins of equal length from `begin` [s] on, and the noise. [K]

    The middle of a bin is the mean of the middle half of its readings. The noise is median |reading - middle| / 0.6745, that of a normal
    law. Fewer readings are taken as they are, with median |successive difference| / (0.6745 sqrt(2)).

    Parameters
    ----------
    times, kelvin : array (readings,)   [s], [K]
    """
    late = times >= begin
    t, y = times[late], kelvin[late]
    if t.size <= MEDIANS_OF_READINGS:
        steps = np.diff(y)
        return t, y, float(np.median(np.abs(steps)) / 0.6745 / 2.0**0.5) if steps.size else 0.0
    edges = np.linspace(t[0], t[-1], MEDIANS_OF_READINGS + 1)
    index = np.clip(np.searchsorted(edges, t, side="right") - 1, 0, MEDIANS_OF_READINGS - 1)
    filled = [g for g in [index == k for k in range(MEDIANS_OF_READINGS)] if g.any()]
    axis = np.array([t[g].mean() for g in filled])
    # a mean of the middle half resists spikes as a median does, and is not bound to the steps of a sensor
    ordered = [np.sort(y[g]) for g in filled]
    medians = np.array([o[o.size // 4 : o.size - o.size // 4].mean() for o in ordered])
    off = np.concatenate([y[g] - m for g, m in zip(filled, medians, strict=True)])
    return axis, medians, float(np.median(np.abs(off)) / 0.6745)


def _design(axis: Array, now: float, taus: Array, room: Reference | None) -> Array:
    """Return the terms (bins, terms) at times `axis` (bins,) [s]: 1 and exp(-(t - now) / tau) [-], the reference behind each tau [K]."""
    columns = [np.ones(axis.size), *(np.exp(-(axis - now) / tau) for tau in taus)]
    if room is not None:
        where = np.searchsorted(room.times, axis)
        columns += list(_mean_and_differences(np.column_stack([room.filtered(float(tau))[where] for tau in taus])).T)
    return np.column_stack(columns)


def _mean_and_differences(behind: Array) -> Array:
    """Return columns (rows, modes) as their mean and, but for the first column, their differences from it."""
    mean = behind.mean(axis=1)
    return np.column_stack([mean, *(behind[:, k] - mean for k in range(1, behind.shape[1]))])


def _bayesian_regression(x: Array, y: Array, scale: float, modes: int, size: float) -> tuple[Array, Array, Array, Array]:
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


MIN_FORECAST_READINGS: Final = 40
"""Readings below which nothing is forecast."""
MIN_TIME_CONSTANT_SHARE: Final = 0.1
"""A longest time constant below this share of the stretch is a mistake."""
MAX_TIME_CONSTANT_RATIO: Final = 1e6
"""The same above this many times the stretch: pairs of time constants up to it fill the memory, and no reading depends on them."""
GUARD: Final = 0.02
"""Share of the change in the readings by which exponentials may miss them, where a slow part is to be excluded by them alone: a drift below
that may be coefficients that grow with differences, or a hidden mass. [-]"""
RATE_WINDOW: Final = 60.0
"""Over which the change is taken where a rule states no window; the curves bend little within it. [s]"""
SLOW_SHARE: Final = 0.05
"""Probability with which a slow part counts as not excluded."""
MAX_UNSEEN_SLOWNESS: Final = 10.0
"""Without better knowledge a part may be this many times slower than the time that was watched."""


@dataclass(frozen=True)
class IntervalEstimate:
    """A temperature with the ends of its interval. [K]"""

    value: float
    low: float
    high: float

    @property
    def error(self) -> float:
        """Half-width of the interval. [K]"""
        return 0.5 * (self.high - self.low)

    def __str__(self) -> str:
        """Value and interval in Celsius."""
        return f"{self.value - ICE_POINT:.2f} degC ({self.low - ICE_POINT:.2f} to {self.high - ICE_POINT:.2f})"


@dataclass(frozen=True, eq=False, kw_only=True)
class EndForecast:
    """Forecast of where a channel ends, common to `Forecast` and `ModelForecast`.

    Parameters
    ----------
    channel : str               The channel.
    start, now : float          Begin and end of the readings that were used. [s]
    latest : float              Its temperature now. [K]
    final : IntervalEstimate    Final temperature with its interval, also where it is declined. [K]
    declined : str              Why the final temperature is not forecast; empty where it is.
    within : float              Largest half-width of an interval that is accepted. [K]
    level : float               Probability of the interval.
    rule : StabilityRule        Rule of stability.
    holds : float or None       Time at which that rule will hold, with a probability of one half; None where it is not to be seen. [s]
    """

    channel: str
    start: float
    now: float
    latest: float
    final: IntervalEstimate
    declined: str
    within: float
    level: float
    rule: StabilityRule
    holds: float | None

    @property
    def saved(self) -> float | None:
        """max(holds - now, 0): time that need not be waited until the rule holds; None where that is not to be seen. [s]"""
        return None if self.holds is None else max(self.holds - self.now, 0.0)

    def _object(self, slow: float | None, holds_late: float | None, by_model: bool) -> dict[str, Any]:
        """Return it as JSON holds it; numbers that a kind of forecast does not have are null."""
        final = self.final
        return {
            "channel": self.channel,
            "from": self.start,
            "now": self.now,
            "latest_C": self.latest - ICE_POINT,
            "final_C": None if self.declined else final.value - ICE_POINT,
            "interval_C": [final.low - ICE_POINT, final.high - ICE_POINT],
            "level": self.level,
            "declined": self.declined or None,
            "slow": slow,
            "rule": self.rule.name,
            "holds": self.holds,
            "holds_late": holds_late,
            "saved": self.saved,
            "by_model": by_model,
        }


@dataclass(frozen=True, eq=False, kw_only=True)
class Forecast(EndForecast, Result):
    """Forecast of a channel under conditions that stay as they are; further fields are those of `EndForecast`.

    Parameters
    ----------
    record : str                Name of the record.
    slow : float                Longest time constant that the readings do not exclude. [s]
    holds_late : float or None  Time at which the rule will hold with a probability of 95 %. [s]
    by_model : bool             Whether time constants came from a model.
    reference : float or None   Level of the reference at which all this holds. [K]
    """

    record: str
    slow: float
    holds_late: float | None
    by_model: bool
    reference: float | None
    _approach: Approach = field(repr=False)
    _step: float = field(repr=False)

    def reading(self, time: str | float, level: float | None = None) -> IntervalEstimate:
        """Return what one reading at a later time will be, with its interval.

        Parameters
        ----------
        time : str or float     The time. [s]
        level : float           Probability of the interval; that of the forecast by default.

        Raises
        ------
        RecordError   When the time lies before the last reading that was used.
        """
        at = amount(time, "s", "time")
        if at < self.now:
            raise RecordError(
                f"{at:g} s is before the last reading used, at {self.now:g} s.",
                f"{self.record}, {self.channel}",
                code="value.outside-range",
            )
        return median_and_interval(with_rounding(self._approach.at(at, reading=True), self._step), level or self.level)

    @property
    def drift(self) -> float:
        """The smallest drift that the readings can show: twice the spread of the curves' rates, at least 2 noise / duration. [K/s]"""
        rates = self._approach.rate(self.now)
        mean = float(self._approach.weights @ rates)
        spread = float(np.sqrt(self._approach.weights @ (rates - mean) ** 2))
        return 2.0 * max(spread, self._approach.noise / max(self.now - self.start, 1.0))

    def as_object(self) -> dict[str, Any]:
        """Return it as JSON holds it."""
        return self._object(self.slow, self.holds_late, self.by_model)

    def __str__(self) -> str:
        """The forecast in words, with the time that it saves and its risk."""
        watched = duration_text(self.now - self.start)
        lines = [f"{self.channel} of {self.record}: {self.latest - ICE_POINT:.2f} degC after {watched}"]
        if self.declined:
            lines.append(f"  final temperature: declined. {self.declined}")
        else:
            at = "" if self.reference is None else f" with the reference at {self.reference - ICE_POINT:.2f} degC"
            lines.append(f"  final temperature: {self.final}{at}, {100 * self.level:g} % interval")
            often = f"{100 * (1 - self.level):.3g} of 100 such forecasts are wrong"
            far = duration_text(MAX_UNSEEN_SLOWNESS * (self.now - self.start))
            unseen = (
                f". A part slower than {far} that drifts by less than {3600.0 * self.drift:.2g} K/h cannot be detected; it would "
                "add that drift times its time constant"
            )
            lines.append(f"  risk: {often}{', if the model includes every slow part' if self.by_model else unseen}")
        if self.holds is None:
            lines.append(f"  rule '{self.rule.name}': the time at which it will be met cannot be predicted")
        elif self.holds <= self.now:
            lines.append(f"  rule '{self.rule.name}': met now")
        else:
            late = "" if self.holds_late is None else f", with 95 % by {duration_text(self.holds_late - self.start)}"
            saved = "" if self.declined else f"; stopping now saves {duration_text(self.saved or 0.0)}"
            lines.append(
                f"  rule '{self.rule.name}': holds about {duration_text(self.holds - self.start)} after the beginning{late}{saved}"
            )
        return "\n".join(lines)

    def _as_rows(self) -> list[Row]:
        """Return the final temperature, None where it is declined, with its interval. [degC]"""
        e, final = self.final, None if self.declined else self.final.value - ICE_POINT
        return [{"channel": self.channel, "final_C": final, "low_C": e.low - ICE_POINT, "high_C": e.high - ICE_POINT}]


def with_rounding(mixture: Mixture, step: float) -> Mixture:
    """Return a mixture whose variances include step^2 / 12, those of readings rounded to a step. [K]"""
    return Mixture(mixture.weights, mixture.means, np.sqrt(mixture.spreads**2 + step**2 / 12.0))


def median_and_interval(mixture: Mixture, level: float) -> IntervalEstimate:
    """Return the median of a mixture, with the interval of a probability `level` about it. [K]"""
    return IntervalEstimate(mixture.quantile(0.5), mixture.quantile(0.5 - level / 2.0), mixture.quantile(0.5 + level / 2.0))


def _longest_time_constant(slowest: str | float | None, span: float, where: str) -> float:
    """Return the longest time constant that is possible: as given, or `MAX_UNSEEN_SLOWNESS` times the duration `span` of the readings. [s]

    Raises
    ------
    RecordError   When it is below a tenth of the duration or above 1e6 times it.
    """
    limit = positive_seconds(slowest, "slowest") if slowest is not None else MAX_UNSEEN_SLOWNESS * span
    if limit < MIN_TIME_CONSTANT_SHARE * span:
        raise RecordError(
            f"a slowest time constant of {duration_text(limit)} is far below the {duration_text(span)} of readings. Give the longest "
            "time constant that the unit can have, with its unit.",
            where,
            code="value.outside-range",
        )
    if limit > MAX_TIME_CONSTANT_RATIO * span:
        raise RecordError(
            f"a slowest time constant of {short(limit, 3)} s is {short(limit / span, 3)} times the {duration_text(span)} of readings, "
            f"above {MAX_TIME_CONSTANT_RATIO:.0e} times. Give the longest time constant that the unit can have, with its unit.",
            where,
            code="value.outside-range",
        )
    return limit


def _half_width(within: str | float, record: str) -> float:
    """Return the largest half-width that an interval may have. [K]"""
    half = amount(within, "K", "within")
    if not half > 0.0:
        raise RecordError(f"half of an interval is above zero, not {half:g} K.", f"{record}, within", code="value.outside-range")
    return half


def forecast(
    record: Record,
    channel: str = "",
    *,
    since: str | float = "start",
    until: str | float = "end",
    rule: str | StabilityRule = "3 C/h",
    within: str | float = "1 [K]",
    level: float = 0.95,
    reference: str = "",
    slowest: str | float | None = None,
    model: Model | None = None,
    scenario: Scenario | None = None,
) -> Forecast:
    """Forecast where a channel ends if conditions stay as they are, or state why that cannot be said.

    Parameters
    ----------
    record, channel : Record, str   The channel may be left out where the record has one temperature.
    since, until : str or float The stretch to use, from the last change of conditions on, as in `Record.trim`.
    rule : str                  Rule of stability that the test waits for.
    within : str or float       Largest half-width of the interval; a wider forecast is declined. [K]
    level : float               Probability of the interval.
    reference : str             Channel that the temperature follows, such as the air; its last level is taken to hold.
    slowest : str or float      Longest time constant that the unit can have, where that is known; ten times the stretch otherwise. [s]
    model, scenario             A model and the conditions of the stretch: its time constants in place of a search, trusted to 20 %.

    Raises
    ------
    RecordError     When readings are too few, or a name does not fit.
    ScenarioError   When a model comes without a scenario.
    """
    name, inside, times, kelvin = _readings(record, channel, since, until, level)
    span, step = float(times[-1] - times[0]), record.channel(name).step
    constants, half, wanted = _model_time_constants(model, scenario), _half_width(within, record.name), StabilityRule.named(rule)
    air = record.channel(reference) if reference else None
    room = None if air is None else (record.times[inside & air.valid], air.values[inside & air.valid])
    limit = _longest_time_constant(slowest, span, f"{record.name}, {name}, slowest")
    curve = approach(times, kelvin, limit, constants, room)
    guard = curve if constants or slowest is not None else approach(times, kelvin, limit, constants, room, GUARD)
    final, slow = median_and_interval(with_rounding(guard.at(float("inf")), step), level), guard.slowest(SLOW_SHARE)
    return Forecast(
        record=record.name,
        channel=name,
        start=float(times[0]),
        now=curve.now,
        latest=curve.at(curve.now).mean,
        final=final,
        declined="" if final.error <= half else _why_declined(final, half, slow, span, bool(constants), slowest is not None, level),
        within=half,
        level=level,
        slow=slow,
        rule=wanted,
        holds=None if wanted.stored else _time_rule_holds(curve, wanted, 0.5, span),
        holds_late=None if wanted.stored else _time_rule_holds(curve, wanted, 0.95, span),
        by_model=bool(constants),
        reference=None if curve.room is None else curve.room.last,
        _approach=curve,
        _step=step,
    )


def _readings(record: Record, channel: str, since: str | float, until: str | float, level: float) -> tuple[str, Bools, Array, Array]:
    """Return the name of a temperature, the only one by default, the samples of a stretch (samples,), times [s] and valid readings [K].

    The stretch is from `since` to `until` [s or text]; times and readings are (readings,), `level` is that of a band [-].

    Raises
    ------
    RecordError   When it is no temperature or not named, has fewer than `MIN_FORECAST_READINGS`, or `level` is not from 0.5 to 1.
    """
    if not channel and len(record.measured) != 1:
        words = f"name the channel: {', '.join(record.measured) or 'there is no temperature'}."
        raise RecordError(words, record.name, code="value.incomplete")
    name = channel or record.measured[0]
    record.refuse_beyond(until, f"{record.name}, forecast")
    inside, _ = record.stretch(since, until, f"{record.name}, forecast")
    measured, where = record.channel(name), f"{record.name}, {name}"
    if measured.quantity != "temperature":
        raise RecordError(f"it is a {measured.quantity}; temperatures are forecast.", where, code="record.does-not-apply")
    keep = inside & measured.valid
    if np.count_nonzero(keep) < MIN_FORECAST_READINGS:
        raise RecordError(
            f"{np.count_nonzero(keep)} readings are in the period; a forecast needs {MIN_FORECAST_READINGS}.",
            where,
            code="record.too-short",
        )
    if not 0.5 <= level < 1.0:
        raise RecordError(f"a level of {level:g} is not possible. Give 0.5 to 0.99.", where, code="value.outside-range")
    return name, inside, record.times[keep], measured.values[keep]


def _model_time_constants(model: Model | None, scenario: Scenario | None) -> Sequence[float]:
    """Return the time constants of a model under conditions; empty without a model. [s]

    Raises
    ------
    ScenarioError   When there is no scenario.
    """
    if model is None:
        return ()
    if scenario is None:
        raise ScenarioError(
            "the time constants of a model depend on the conditions. Give the scenario of the period with the model.",
            model.title,
            code="value.incomplete",
        )
    constants = simulate(model, scenario if scenario.seconds > 0 else scenario.with_(duration=HOUR)).time_constants
    return tuple(float(t) for t in constants if np.isfinite(t))


def _why_declined(final: IntervalEstimate, within: float, slow: float, span: float, by_model: bool, limited: bool, level: float) -> str:
    """Return why a final temperature is declined, in words: slow parts, or noise."""
    text = (
        f"The final temperature could be from {final.low - ICE_POINT:.1f} to {final.high - ICE_POINT:.1f} degC ({100 * level:g} %), "
        "wider than the "
        f"+- {within:.3g} K requested"
    )
    if by_model:
        return f"{text}: the slow parts of the model have not changed enough for a forecast. Wait longer."
    if slow > span:
        return CodedText(
            f"{text}: the readings of {duration_text(span)} cannot exclude a slow part with a time constant of {duration_text(slow)}, "
            "such as a heavy mass behind a weak link, that has only begun to change. Wait longer, or give a model"
            f"{'' if limited else ', or the longest time constant that the unit can have (slowest)'}.",
            "result.slow-part-possible",
        )
    return f"{text}: the readings are too few or too noisy for {duration_text(span)} of readings. Wait longer."


def _time_rule_holds(curve: Approach, rule: StabilityRule, probability: float, span: float) -> float | None:
    """Return the time at which the rule will hold with a probability; None beyond a hundred times `span` from now. [s]

    It holds where |T(t) - T(t - window)| <= rate times window for curves of that weight together; doubled steps ahead, then bisection.
    """
    window = rule.window or RATE_WINDOW

    def holds(at: float) -> bool:
        """Whether the change over the window that ends at a time is within the rule, with that probability over the curves."""
        begin = max(at - window, curve.start)
        moved = np.einsum("pt,pt->p", curve._factors(at) - curve._factors(begin), curve.means)
        return float(curve.weights @ (np.abs(moved) <= rule.rate * window)) >= probability

    low = max(curve.now, curve.start + rule.window)
    if holds(low):
        return low
    high = low + span
    while not holds(high):
        high = low + 2.0 * (high - low)
        if high - low > 100.0 * span:
            return None
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if holds(middle) else (middle, high)
    return high
