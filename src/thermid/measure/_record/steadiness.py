"""Steadiness of readings: the rules of the standards, how fast a channel drifts, and what the mean of a settled stretch is worth.

All of it rests on one straight line through the readings of a stretch, whose errors count correlated noise, few readings and the steps of
the sensor.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Final, Generic, NamedTuple, TypeVar

import numpy as np

from thermid.base.errors import RecordError, look_up, nearest, refuse_first
from thermid.base.units import HOUR, MINUTE, amount, duration_text, format_value, positive_seconds
from thermid.measure._record._constants import STABILITY
from thermid.measure._record.channel import Channel, FloatArray, Samples
from thermid.measure._record.rounding import rounding_of_line

R = TypeVar("R", bound=Samples)

MIN_JUDGED_WINDOW: Final = 300.0
"""Shortest window over which a rule without one of its own is judged on readings. [s]"""
MIN_READINGS_OF_STRETCH: Final = 8
"""Readings below which a stretch has no rate and no mean with an error."""
MIN_INDEPENDENT_READINGS: Final = 30.0
"""Independent readings in a window from which their own correlation gives the error of a mean; with fewer, longer times may hide in it."""
MIN_INDEPENDENT_SHARE: Final = 0.5
"""Share of the readings that they must be worth as independent ones to count as white."""
DOUBT_IN_ERRORS: Final = 2.0
"""Standard errors that count as beyond doubt."""
SETTLED: Final = "1 [K/h]"
"""Drift above which the mean of a stretch is no steady point."""
TAU_ERROR: Final = 0.2
"""How far a time constant may be off, as a share of it."""


@dataclass(frozen=True)
class StabilityRule:
    """A rule by which a temperature counts as stable.

    Parameters
    ----------
    name : str          As it is written: ``3 C/h``.
    rate : float        Rate that is allowed; of a rule on stored heat, the share of the power that may be stored. [K/s or -]
    window : float      Time over which the change is taken; zero where the rule states none. [s]
    source : str        Standard and clause.
    mark : str          How the number is known: read, secondary, memory or project.
    stored : bool       Whether it is a rule on the heat that is still being stored.
    """

    name: str
    rate: float
    window: float
    source: str
    mark: str
    stored: bool = False

    def __str__(self) -> str:
        """The rule with its source and mark."""
        return f"{self.name} ({self.source}; {self.mark})"

    @staticmethod
    def named(rule: str | StabilityRule) -> StabilityRule:
        """Return a rule by its name, or one of the project's own: ``0.5 K/h``, ``0.3 C/h over 2 h``, ``1 K over 3 h``, ``stored 3 %``.

        Raises
        ------
        RecordError   When it is neither.
        """
        if isinstance(rule, StabilityRule):
            return rule
        text = " ".join(str(rule).split())
        if text in RULES:
            return RULES[text]
        stored = _STORED.match(text)
        if stored is not None and 0.0 < float(stored["share"]) < 100.0:
            return StabilityRule(text, float(stored["share"]) / 100.0, 0.0, "the project's own", "project", True)
        rate = _RATE.match(text)
        if rate is None or float(rate["size"]) <= 0.0 or not (rate["per"] or rate["span"]):
            raise RecordError(
                f"'{text}' is not a rule of stability. Known rules: {', '.join(RULES)}. Write another one like '0.5 K/h', "
                f"'0.3 C/h over 2 h', '1 K over 3 h' or 'stored 3 %'.{nearest(text, RULES)}",
                "stability",
                code="value.wrong-kind",
            )
        span = float(rate["span"]) * (HOUR if rate["unit"] == "h" else MINUTE) if rate["span"] else 0.0
        if rate["span"] and span <= 0.0:
            raise RecordError(f"'{text}': the window has no length. Give one above zero.", "stability", code="value.outside-range")
        per = span if not rate["per"] else HOUR if "h" in rate["per"] else MINUTE
        same = next(
            (r for r in RULES.values() if not r.stored and np.isclose(r.rate, float(rate["size"]) / per) and r.window == span), None
        )
        return same or StabilityRule(text, float(rate["size"]) / per, span, "the project's own", "project")

    @staticmethod
    def verdict(size: float, error: float, allowed: float) -> str:
        """Return ``stable`` where |size| + 2 error <= allowed, ``not stable`` where |size| - 2 error > allowed, else ``cannot tell``."""
        if abs(size) + DOUBT_IN_ERRORS * error <= allowed:
            return "stable"
        return "not stable" if abs(size) - DOUBT_IN_ERRORS * error > allowed else "cannot tell"

    def of_channel(self, record: Samples, name: str, at: float | None = None, since: float = -np.inf) -> ChannelStability:
        """Judge whether one channel is stable at a time by a rule on its rate.

        A rule with a window takes the readings of that window. A rule without one takes the shortest window whose error lets the question
        be answered, from 5 minutes and 32 readings on; where none does, a shorter one may still deny it, else that of the smallest error.

        Parameters
        ----------
        record : Samples
        name : str                  The channel.
        at : float                  Time of the question; the last reading when None. [s]
        since : float               Time at which conditions last changed; nothing before it counts. [s]

        Raises
        ------
        RecordError   When the rule is one on stored heat, the channel is no temperature, or the window holds fewer than 8 readings.
        """
        channel, end = record.channel(name), float(record.times[-1] if at is None else at)
        where = f"{record.name}, {name}"
        refuse_first(
            where,
            (
                self.stored,
                f"'{self.name}' is a rule on stored heat, which cannot be found from readings alone. Give a rule on the rate, or a model.",
                "record.does-not-apply",
            ),
            (
                channel.quantity != "temperature",
                f"it is a {channel.quantity}; a rule of stability applies to temperatures only.",
                "record.does-not-apply",
            ),
            error=RecordError,
        )
        first = max(since, float(record.times[0]))
        if self.window:
            if end - self.window < first - 0.5 * record.step:
                raise RecordError(
                    f"'{self.name}' needs readings over {duration_text(self.window)}, but the log has {duration_text(end - first)}. Wait, "
                    "or use a rule without a window.",
                    where,
                    code="record.too-short",
                )
            return _stability(record, name, self, end - self.window, end)
        judged: list[ChannelStability] = []
        for span in spans(record, first, end):
            judged.append(_stability(record, name, self, end - span, end))
            if judged[-1].verdict != "cannot tell":
                return judged[-1]
        # a course that no line fits: its last readings alone may show that it moves
        for span in spans(record, first, end, MIN_READINGS_OF_STRETCH):
            latest = _stability(record, name, self, end - span, end)
            if latest.verdict == "not stable":
                return latest
        # a window that reaches back into an approach says less of the present rate than a shorter one
        return min(judged, key=lambda one: one.error)

    def since_when(self, record: Samples, name: str, since: float = -np.inf) -> float | None:
        """Return the earliest time from which a channel stays stable to the end of the record; None where it is not stable. [s]

        It is found to a 120th of the record, looking back from its end.

        Parameters
        ----------
        record, name, since   As in `of_channel`.
        """
        begin = max(since, float(record.times[0]))
        first = begin + max(self.window, MIN_JUDGED_WINDOW, MIN_READINGS_OF_STRETCH * record.step)
        if first > record.times[-1]:
            return None
        earliest: float | None = None
        looks = min(120, int((record.times[-1] - first) / record.step) + 2)  # more often than there are readings says nothing more
        for at in np.linspace(first, float(record.times[-1]), looks)[::-1]:
            try:
                verdict = self.of_channel(record, name, float(at), begin).verdict
            except RecordError:
                break
            if verdict != "stable":
                break
            earliest = float(at)
        return earliest


RULES: Final[Mapping[str, StabilityRule]] = {row[0]: StabilityRule(*row) for row in STABILITY}
"""Rules by name."""

_DIGITS = r"\d+\.?\d*|\.\d+"
_RATE = re.compile(
    rf"(?P<size>(?:{_DIGITS})(?:e-?\d+)?)\s*(?:C|K|degC)\s*(?P<per>/\s*h|/\s*min)?(?:\s+over\s+(?P<span>{_DIGITS})\s*(?P<unit>h|min))?\Z"
)
_STORED = re.compile(rf"stored\s+(?P<share>{_DIGITS})\s*%\Z")


def effective_samples(residuals: FloatArray, fitted: int = 2) -> float:
    """Effective sample size: how many independent readings would say as much of a mean or a line.

    It is n / (1 + 2 sum of the autocorrelations), over pairs of lags while their sum is above zero; of the residuals of a fit, whose
    derivatives say what the fit took, see `fit.uncertainty.noise`.

    Residuals about a mean or a line look less correlated than the noise is: each of the `fitted` numbers takes one share of the whole sum
    off every lag, and is given back here.

    References
    ----------
    C. J. Geyer, Practical Markov chain Monte Carlo, Statistical Science 7 (1992) 473-483, DOI 10.1214/ss/1177011137; for the bias,
    F. H. C. Marriott and J. A. Pope, Biometrika 41 (1954) 390-402, DOI 10.1093/biomet/41.3-4.390.
    """
    n = residuals.size
    power = float(residuals @ residuals)
    if n < 4 or power <= 0:
        return float(n)
    size = 1 << (2 * n - 1).bit_length()
    spectrum = np.abs(np.fft.rfft(residuals, size)) ** 2
    rho = np.fft.irfft(spectrum, size)[:n] / power * (n / np.arange(n, 0, -1))
    factor = 1.0
    for _ in range(5):
        share = fitted * factor / n
        pairs = (rho * (1.0 - share) + share)[: n - n % 2].reshape(-1, 2).sum(axis=1)
        ends = np.flatnonzero(pairs <= 2.0 * share)
        positive_pairs = pairs[: int(ends[0])] if ends.size else pairs
        factor = float(min(max(1.0, 2.0 * positive_pairs.sum() - 1.0), n / 4.0))
    return n / factor


def spans(record: Samples, first: float, end: float, readings: int = 4 * MIN_READINGS_OF_STRETCH) -> Iterator[float]:
    """Yield ever longer windows up to a time `end`, from 5 minutes and so many readings on and at most back to `first`. [s]

    A rule without a window of its own is judged on the shortest one whose error lets the question be answered.
    """
    span = min(max(MIN_JUDGED_WINDOW, readings * record.step), end - first)
    while span < end - first:
        yield span
        span = min(1.5 * span, end - first)
    yield span


class _Line(NamedTuple):
    """A straight line through readings: level + rate (t - at), with the errors of both.

    Parameters
    ----------
    rate, level : float                 Slope, and level at the time `at`. [SI/s], [SI]
    noise_of_rate, noise : float        Their standard errors by scatter. [SI/s], [SI]
    rounding : array (2, causes)        Effects of independent causes of rounding on level and rate. [SI], [SI/s]
    scatter : float                     Standard deviation about the line. [SI]
    worth : float                       Effective number of readings.
    """

    rate: float
    noise_of_rate: float
    level: float
    noise: float
    rounding: FloatArray
    scatter: float
    worth: float

    @property
    def rate_error(self) -> float:
        """Standard error of the slope: sqrt(noise_of_rate^2 + sum of squared rounding effects). [SI/s]"""
        return float(np.hypot(self.noise_of_rate, np.linalg.norm(self.rounding[1])))

    def error(self, ahead: float) -> float:
        """Return the standard error of level + `ahead` rate, a time ahead [s]. [SI]

        ``sqrt(noise^2 + (ahead noise_of_rate)^2 + sum (r_k + ahead s_k)^2)`` with the errors r, s that rounding gives to level and rate.
        """
        return float(np.linalg.norm([self.noise, ahead * self.noise_of_rate, *(self.rounding[0] + ahead * self.rounding[1])]))


def _line(t: FloatArray, y: FloatArray, at: float, step: float, noise: float | None, where: str, what: str) -> _Line:
    """Return the least-squares line through readings.

    With n' effective readings of scatter s the errors are s / sqrt(n') of the level and that over std(t) of the rate, both times Student's
    sqrt(f / (f - 2)), f = max(n' - 2, 3).

    Parameters
    ----------
    t, y : array (samples,)   Readings. [s], [SI]
    at : float                Time at which its level is taken. [s]
    step : float              Smallest step of the sensor. [SI]
    noise : float or None     Before rounding, where it is stated. [SI]
    where, what : str         For the refusal: whose readings, and what they are needed for.

    Raises
    ------
    RecordError   When there are fewer than 8.
    """
    if y.size < MIN_READINGS_OF_STRETCH or np.ptp(t) <= 0:
        raise RecordError(
            f"{y.size} readings lie in the window; {MIN_READINGS_OF_STRETCH} are needed for a {what} with its error.",
            where,
            code="record.too-short",
        )
    x = t - t.mean()
    moved = y - y[0]  # exactly zero where nothing moves: rounding of a mean is no scatter
    rate = float(x @ moved / (x @ x))
    residuals = moved - moved.mean() - rate * x
    worth = effective_samples(residuals)
    factor = y.size / worth
    scatter = float(np.sqrt(residuals @ residuals / (y.size - 2.0 * factor)))
    # few readings do not know their own spread: Student's distribution of n degrees of freedom is wider by sqrt(n / (n - 2))
    free = max(worth - 2.0, 3.0)
    error = scatter / worth**0.5 * (free / (free - 2.0)) ** 0.5
    level = float(y[0] + moved.mean() + rate * (at - t.mean()))
    rounding = rounding_of_line(t, y, at, rate, step, noise) if step else np.zeros((2, 0))
    return _Line(rate, error / float(np.std(t)), level, error, rounding, scatter, worth)


TRIED_MEANS, TRIED_CORRELATION_TIMES, TRIED_VARIANCE_RATIOS = 60, 8, 10
"""Means of readings, correlation times and variances over that of white noise by which the noise of a stretch is looked for."""


def _with_autocorrelation(t: FloatArray, y: FloatArray, line: _Line, at: float) -> _Line:
    """Return a line with errors averaged over models of its autocorrelated noise; never smaller than before.

    A stretch of a few correlation times does not show its own autocorrelation, so each of a grid of models, with a covariance s^2 (1 + k
    R) of the means of bins, R = exp(-|dt| / time), counts by its restricted likelihood (Patterson and Thompson, Biometrika 58 (1971) 545):
    k of 0 and 0.05 to 1000, times from a bin to a quarter of the stretch. The mean is of ln(variance), so that an unlikely time of hours
    does not decide. `t` [s] and `y` (samples,) are the readings, `at` [s] is where the line's value is asked for.
    """
    edges = np.linspace(t[0], t[-1], min(TRIED_MEANS, t.size) + 1)
    place = np.clip(np.searchsorted(edges, t, side="right") - 1, 0, edges.size - 2)
    count = np.bincount(place)
    full = count > 0
    centre, mean = (np.bincount(place, v)[full] / count[full] for v in (t, y))
    x = np.column_stack([np.ones(centre.size), centre - at])
    taken = np.linalg.solve(x.T @ (count[full, None] * x), (count[full, None] * x).T)
    free, span = centre.size - 2, float(t[-1] - t[0])
    likely, errors, root = list[FloatArray](), list[FloatArray](), np.sqrt(count[full])
    for time in np.geomspace(span / centre.size, 0.25 * span, TRIED_CORRELATION_TIMES):
        # in the axes of the correlations all ratios are diagonal: C = R^-1 U (1 + ratio L) U' R^-1
        like, axes = np.linalg.eigh(root[:, None] * np.exp(-np.abs(centre[:, None] - centre) / time) * root)
        # the first of all is white noise alone
        variance = 1.0 + np.outer(np.append([] if likely else 0.0, np.geomspace(0.05, 1e3, TRIED_VARIANCE_RATIOS)), np.maximum(like, 0.0))
        rows, read = axes.T @ (root[:, None] * x), axes.T @ (root * mean)
        weighed = rows.T / variance[:, None, :]
        inner = weighed @ rows
        residuals = read - np.linalg.solve(inner, weighed @ read[:, None])[:, :, 0] @ rows.T
        square = np.maximum(np.sum(residuals**2 / variance, axis=1), np.finfo(float).tiny)
        likely.append(-0.5 * (np.log(variance).sum(axis=1) + np.linalg.slogdet(inner)[1] + free * np.log(square)))
        # Student's distribution is wider than the normal one
        errors.append(variance @ (taken / root @ axes).T ** 2 * square[:, None] / max(free - 2.0, 1.0))
    weight = np.exp(np.concatenate(likely) - max(map(np.max, likely)))
    # of logarithms, so that an unlikely time of hours does not decide
    level, rate = np.exp(0.5 * (weight @ np.log(np.maximum(np.concatenate(errors), np.finfo(float).tiny))) / weight.sum())
    return line._replace(noise=max(float(level), line.noise), noise_of_rate=max(float(rate), line.noise_of_rate))


@dataclass(frozen=True)
class ChannelStability:
    """Stability of one channel at one time.

    Parameters
    ----------
    name : str              The channel.
    rate : float            Drift over the window, by regression. [K/s]
    error : float           Its standard error: correlated noise, and the steps of the sensor. [K/s]
    start, end : float      The window. [s]
    samples : int           Number of readings in it.
    verdict : str           ``stable``, ``not stable``, or ``cannot tell``; empty where a rule judges all channels together.
    """

    name: str
    rate: float
    error: float
    start: float
    end: float
    samples: int
    verdict: str

    def __str__(self) -> str:
        """The drift in K/h, and what it means."""
        span = duration_text(self.end - self.start)
        return f"{self.name}: {HOUR * self.rate:+.3g} +- {HOUR * self.error:.2g} K/h over the last {span}" + (
            f": {self.verdict}" if self.verdict else ""
        )

    @staticmethod
    def drift(record: Samples, name: str, start: float, end: float) -> ChannelStability:
        """Return how fast one channel drifts over a window, with its error, judged by no rule.

        Raises
        ------
        RecordError   When the window holds fewer than 8 readings.
        """
        channel = record.channel(name)
        inside = (record.times >= start - 1e-9) & (record.times <= end + 1e-9) & channel.valid
        t, y = record.times[inside], channel.values[inside]
        line = _line(t, y, 0.0, channel.step, channel.noise, f"{record.name}, {channel.name}", "rate")
        return ChannelStability(channel.name, line.rate, line.rate_error, float(t[0]), float(t[-1]), int(y.size), "")


def _stability(record: Samples, name: str, rule: StabilityRule, start: float, end: float) -> ChannelStability:
    """Return the stability of one channel over one window by a rule on the rate."""
    drift = ChannelStability.drift(record, name, start, end)
    return replace(drift, verdict=StabilityRule.verdict(drift.rate, drift.error, rule.rate))


@dataclass(frozen=True)
class SteadyValue:
    """One channel at a steady point.

    Parameters
    ----------
    name : str                  The channel.
    value : float               Where it would have settled, or its mean where nothing was corrected. [SI]
    error : float               Standard error: correlated noise, steps of the sensor, drift. [SI]
    accuracy : float or None    Of the instrument, not part of the error. [SI]
    rate, rate_error : float    Drift and its standard error. [SI per s]
    correction : float          Added to the mean for stored heat and drift: rate tau. [SI]
    samples : int               Number of readings.
    independent : float         Effective number of readings.
    quantity : str              Quantity of the channel.
    """

    name: str
    value: float
    error: float
    accuracy: float | None
    rate: float
    rate_error: float
    correction: float
    samples: int
    independent: float
    quantity: str

    def __str__(self) -> str:
        """Value and error of a channel; of a temperature also drift, correction, and readings with the independent ones they are worth."""
        if self.quantity != "temperature":
            return f"{self.name} {self.value:.5g} +- {self.error:.2g}"
        text = f"{self.name} {format_value(self.value, 'degC', 6)} +- {self.error:.2g} K   drift {HOUR * self.rate:+.2g} K/h"
        corrected = f", {self.correction:+.2g} K added for it" if self.correction else ""
        return f"{text}{corrected}   {self.samples} readings worth {self.independent:.3g}"


@dataclass(frozen=True, eq=False)
class SteadyPoint(Generic[R]):
    """A settled stretch of a record: mean values that count as a steady state.

    Parameters
    ----------
    name : str              Name of the record, and the stretch.
    start, end : float      On the record's own axis. [s]
    values : dict           Channel -> `SteadyValue`.
    source : Record         The record that it was taken from.
    corrected : bool        Whether a time constant was given for the correction.
    """

    name: str
    start: float
    end: float
    values: Mapping[str, SteadyValue]
    source: R
    corrected: bool

    def __getitem__(self, name: str) -> SteadyValue:
        """Return one channel.

        Raises
        ------
        NameNotFoundError   With the nearest name.
        """
        return look_up(name, self.values, "no channel '{}'.", self.name)

    @property
    def record(self) -> R:
        """The point as a record of two equal readings, for `calibrate` beside others, in a scenario that starts steady.

        Two readings of noise sqrt(2) times the point's error weigh as one of that error. The error of a mean boundary or power is one that
        both samples share. The accuracy of each instrument stays.
        """
        channels = {}
        for name, v in self.values.items():
            channel = self.source.channel(name)
            read = channel.quantity == "temperature" and channel.role != "boundary"
            values, valid = np.full(2, v.value), np.ones(2, dtype=bool)
            noise = max(v.error, 1e-9) * 2.0**0.5 if read else None
            channels[name] = replace(channel, values=values, valid=valid, masks={}, noise=noise, resolution=None, common=v.error)
        steps, origin, zero = (
            (*self.source.steps, f"steady point of {self.start:g} to {self.end:g} s"),
            self.source.origin,
            self.source.zero,
        )
        if zero is not None:
            origin = replace(origin, start=zero._replace(seconds=zero.seconds + self.start).text)
        times = np.array([0.0, self.end - self.start])
        return replace(self.source, name=self.name, times=times, channels=channels, origin=origin, steps=steps, clocks=())

    def __str__(self) -> str:
        """Every channel with its error, and what was not corrected."""
        lines = [f"{self.name}: mean of {duration_text(self.end - self.start)}", *(f"  {v}" for v in self.values.values())]
        if not self.corrected:
            lines.append(
                "  no time constant is given, so nothing was corrected. The errors include the drift over the window; a slow "
                "approach can hide a larger one"
            )
        return "\n".join(lines)


def steady_point(
    record: R, start: object, end: object, tau: object | None = None, limit: str | float = SETTLED, name: str = ""
) -> SteadyPoint[R]:
    """Return the steady point of a stretch of a record.

    Parameters
    ----------
    record : Samples
    start, end : str or float   The stretch, as in `trim`.
    tau : str, float or dict    Slowest time constant of the parts, or channel -> its own, for the correction. [s]
    limit : str or float        Drift above which a temperature is not settled. [K/s]
    name : str                  Name of the point; the record's with the stretch when empty.

    Raises
    ------
    RecordError   When a channel drifts faster than the limit beyond doubt, or has fewer than 8 readings; the message states the rate.

    Notes
    -----
    A part with one time constant follows its steady temperature T_s by ``T + tau dT/dt = T_s`` (C dT/dt = P - G (T - T_room) and
    tau = C/G), for heat that is still being stored as for a room that drifts. The correction is taken as good to 20 %. Without a time
    constant half the drift over the window is added to the error.
    """
    inside, _ = record.stretch(start, end, f"{record.name}, steady")
    times = record.times[inside]
    most = amount(limit, "K/s", "limit")
    if most <= 0:
        raise RecordError("the limit of the drift must be above zero.", "limit", code="value.outside-range")
    values = {}
    for channel in record.channels.values():
        constant = tau.get(channel.name) if isinstance(tau, Mapping) else tau
        seconds = positive_seconds(constant, "tau") if constant is not None and channel.role != "boundary" else 0.0
        values[channel.name] = _value(record.name, channel, times, inside, seconds, most, tau is not None)
    label = name or f"{record.name} {times[0]:g} to {times[-1]:g} s"
    return SteadyPoint(label, float(times[0]), float(times[-1]), values, record, tau is not None)


def _value(where: str, channel: Channel, times: FloatArray, inside: np.ndarray, tau: float, most: float, corrected: bool) -> SteadyValue:
    """Return one channel over the stretch: level + tau rate, with its error: the root of the sum of squares of its parts.

    Parts are the line's error tau ahead, `TAU_ERROR` of the correction and, where nothing is corrected, |rate| times half the stretch.

    Parameters
    ----------
    where : str             Name of the record.
    times : array (n,)      Times of the stretch. [s]
    inside : array (samples,)   Which samples of the record these are.
    tau : float             Time constant; zero for none. [s]
    most : float            Drift above which a temperature is not settled. [K/s]
    corrected : bool        Whether any channel is corrected; else half the drift is added to the error.

    Raises
    ------
    RecordError   When it drifts faster than `most` beyond doubt, or has fewer than 8 readings.
    """
    valid = channel.valid[inside]
    y, t = channel.values[inside][valid], times[valid]
    place = f"{where}, {channel.name}"
    thermal = channel.quantity == "temperature"
    # a boundary that never moves was set, as a fit takes it too; its last digit is no step of a sensor
    was_set = channel.role == "boundary" and channel.resolution is None and not np.ptp(y)
    step = channel.step if thermal and not was_set else channel.resolution or 0.0
    line = _line(t, y, 0.5 * (times[0] + times[-1]), step, channel.noise, place, "mean")
    if line.worth < min(MIN_INDEPENDENT_SHARE * y.size, MIN_INDEPENDENT_READINGS) and line.scatter > 0.5 * step and line.scatter > 0.0:
        line = _with_autocorrelation(t, y, line, 0.5 * (times[0] + times[-1]))
    if thermal and abs(line.rate) - DOUBT_IN_ERRORS * line.rate_error > most:
        raise RecordError(
            f"it drifts by {HOUR * line.rate:+.3g} +- {HOUR * line.rate_error:.2g} K/h, more than the {HOUR * most:.3g} K/h allowed "
            "for a steady point. Use a later window, or raise the limit if the test needs no better steadiness.",
            place,
            code="record.not-steady",
        )
    ahead = tau if thermal else 0.0
    correction = ahead * line.rate
    parts = [line.error(ahead), TAU_ERROR * correction]
    if thermal and not ahead and not corrected:
        parts.append(abs(line.rate) * float(times[-1] - times[0]) / 2.0)
    return SteadyValue(
        name=channel.name,
        value=line.level + correction,
        error=float(np.linalg.norm(parts)),
        accuracy=channel.accuracy,
        rate=line.rate,
        rate_error=line.rate_error,
        correction=correction,
        samples=int(y.size),
        independent=line.worth,
        quantity=channel.quantity,
    )
