"""Where a temperature will end, and when a rule of stability will hold, said while the test is still running - or declined."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np

from thermid.base.arguments import takes_objects
from thermid.base.errors import RecordError, ScenarioError
from thermid.base.expression import amount
from thermid.base.linear_algebra import Bools
from thermid.base.results import Result, Row
from thermid.measure.amounts import duration_text, positive_seconds, short
from thermid.measure.records import FloatArray, Record, stretch, within_log
from thermid.measure.steadiness import StabilityRule, rule_of
from thermid.model.tree import Model
from thermid.physics.constants import ICE_POINT
from thermid.qualify._steadiness.approach import Approach, Mixture, approach
from thermid.simulation.runs import Scenario, simulate

MIN_FORECAST_READINGS: Final = 40
"""Readings below which nothing is forecast."""
MIN_TIME_CONSTANT_SHARE: Final = 0.1
"""A longest time constant below this share of the stretch is a mistake."""
MAX_TIME_CONSTANT_RATIO: Final = 1e6
"""The same above this many times the stretch: pairs of time constants up to it fill the memory, and no reading depends on them."""
GUARD: Final = 0.02
"""Share of the change in the readings by which exponentials may miss them, where a slow part is to be excluded by them alone: a drift below
that may be coefficients that grow with differences, or a hidden mass. [-]"""
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

    def _risk(self) -> str:
        """Return what may be wrong with the final temperature, in words."""
        often = f"{100 * (1 - self.level):.3g} of 100 such forecasts are wrong"
        if self.by_model:
            return f"{often}, if the model includes every slow part"
        far = duration_text(MAX_UNSEEN_SLOWNESS * (self.now - self.start))
        return (
            f"{often}. A part slower than {far} that drifts by less than {3600.0 * self.drift:.2g} K/h cannot be detected; it would "
            "add that drift times its time constant"
        )

    def __str__(self) -> str:
        """The forecast in words, with the time that it saves and its risk."""
        watched = duration_text(self.now - self.start)
        head = f"{self.channel} of {self.record}: {self.latest - ICE_POINT:.2f} degC after {watched}"
        lines = [head]
        if self.declined:
            lines.append(f"  final temperature: declined. {self.declined}")
        else:
            at = "" if self.reference is None else f" with the reference at {self.reference - ICE_POINT:.2f} degC"
            lines.append(f"  final temperature: {self.final}{at}, {100 * self.level:g} % interval")
            lines.append(f"  risk: {self._risk()}")
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


@takes_objects
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
    record : Record
    channel : str               The channel; may be left out where the record has one temperature.
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
    name = channel or _only_temperature(record)
    within_log(record, until, f"{record.name}, forecast")
    inside, _ = stretch(record, since, until, f"{record.name}, forecast")
    times, kelvin = _readings(record, name, inside, level)
    span = float(times[-1] - times[0])
    limit = _longest_time_constant(slowest, span, f"{record.name}, {name}, slowest")
    constants = _model_time_constants(model, scenario)
    room = None
    if reference:
        air = record.channel(reference)
        room = (record.times[inside & air.valid], air.values[inside & air.valid])
    curve = approach(times, kelvin, limit, constants, room)
    trusted = bool(constants) or slowest is not None
    guard = curve if trusted else approach(times, kelvin, limit, constants, room, GUARD)
    half, wanted = amount(within, "K", "within"), rule_of(rule)
    if not half > 0.0:
        raise RecordError(f"half of an interval is above zero, not {half:g} K.", f"{record.name}, within", code="value.outside-range")
    step = record.channel(name).step
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


def _readings(record: Record, name: str, inside: Bools, level: float) -> tuple[FloatArray, FloatArray]:
    """Return times and valid readings of a temperature in a stretch. [s], [K]

    Raises
    ------
    RecordError   When it is no temperature, has fewer than `MIN_FORECAST_READINGS`, or `level` is not from 0.5 to 1.
    """
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
    return record.times[keep], measured.values[keep]


def _only_temperature(record: Record) -> str:
    """Return the name of the only temperature of a record.

    Raises
    ------
    RecordError   When there are several, or none.
    """
    if len(record.measured) != 1:
        raise RecordError(
            f"name the channel: {', '.join(record.measured) or 'there is no temperature'}.", record.name, code="value.incomplete"
        )
    return record.measured[0]


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
    constants = simulate(model, scenario if scenario.seconds > 0 else scenario.with_(duration=3600.0)).time_constants
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
        return (
            f"{text}: the readings of {duration_text(span)} cannot exclude a slow part with a time constant of {duration_text(slow)}, "
            "such as a heavy mass behind a weak link, that has only begun to change. Wait longer, or give a model"
            f"{'' if limited else ', or the longest time constant that the unit can have (slowest)'}."
        )
    return f"{text}: the readings are too few or too noisy for {duration_text(span)} of readings. Wait longer."


def _time_rule_holds(curve: Approach, rule: StabilityRule, probability: float, span: float) -> float | None:
    """Return the time at which the rule will hold with a probability; None beyond a hundred times `span` from now. [s]"""
    window = rule.window or 60.0

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
