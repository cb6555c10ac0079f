"""`Forecast`: what a channel will do under conditions that stay as they are, with its error, what that saves and what it risks."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np

from thermid.errors import RecordError
from thermid.measure.amounts import duration_text, seconds
from thermid.measure.record.stability import StabilityRule
from thermid.physics.constants import ICE_POINT
from thermid.steadiness.approach import Approach
from thermid.steadiness.mixture import Mixture

REACH: Final = 10.0
"""Without better knowledge a part may be this many times slower than the time that was watched."""


@dataclass(frozen=True)
class IntervalEstimate:
    """A temperature with its interval. [K]"""

    value: float
    low: float
    high: float

    @property
    def error(self) -> float:
        """Half of the interval. [K]"""
        return 0.5 * (self.high - self.low)

    def __str__(self) -> str:
        """In Celsius."""
        return f"{self.value - ICE_POINT:.2f} degC ({self.low - ICE_POINT:.2f} to {self.high - ICE_POINT:.2f})"


@dataclass(frozen=True, eq=False)
class Forecast:
    """What a channel will do under conditions that stay as they are.

    Parameters
    ----------
    record, channel : str       Where the readings came from.
    start, now : float          Begin and end of the readings that were used. [s]
    latest : float              Where it stands now. [K]
    final : IntervalEstimate            Where it ends, with its interval, whether declined or not.
    declined : str              Why the final temperature is not forecast; empty where it is.
    within : float              Half of the interval that was asked for, at most. [K]
    level : float               Probability of the interval.
    slow : float                Time constant that the readings cannot exclude. [s]
    rule : StabilityRule        Rule of stability.
    holds : float or None       Time at which that rule will hold, as likely earlier as later; None where it is not to be seen. [s]
    holds_late : float or None  The same with a probability of 95 %. [s]
    by_model : bool             Whether time constants came from a model.
    reference : float or None   Level of the reference at which all this holds. [K]
    """

    record: str
    channel: str
    start: float
    now: float
    latest: float
    final: IntervalEstimate
    declined: str
    within: float
    level: float
    slow: float
    rule: StabilityRule
    holds: float | None
    holds_late: float | None
    by_model: bool
    reference: float | None
    _approach: Approach = field(repr=False)
    _step: float = field(repr=False)

    def reading(self, time: str | float, level: float | None = None) -> IntervalEstimate:
        """Return what one reading at a later time will say, with the same probability or another.

        Raises
        ------
        RecordError   When the time lies before the last reading that was used.
        """
        at = seconds(time, "time")
        if at < self.now:
            raise RecordError(f"{at:g} s lies before the last reading that was used, at {self.now:g} s.", f"{self.record}, {self.channel}")
        return estimate(with_step(self._approach.at(at, reading=True), self._step), level or self.level)

    @property
    def saved(self) -> float | None:
        """Time that need not be waited until the rule holds; None where that is not to be seen. [s]"""
        return None if self.holds is None else max(self.holds - self.now, 0.0)

    @property
    def drift(self) -> float:
        """Drift that the readings cannot tell from none. [K/s]"""
        rates = self._approach.rate(self.now)
        mean = float(self._approach.weights @ rates)
        spread = float(np.sqrt(self._approach.weights @ (rates - mean) ** 2))
        return 2.0 * max(spread, self._approach.noise / max(self.now - self.start, 1.0))

    def as_object(self) -> dict[str, Any]:
        """Return it as JSON holds it."""
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
            "slow": self.slow,
            "rule": self.rule.name,
            "holds": self.holds,
            "holds_late": self.holds_late,
            "saved": self.saved,
            "by_model": self.by_model,
        }

    def _risk(self) -> str:
        """Return what may be wrong with the final temperature."""
        often = f"{100 * (1 - self.level):.3g} of 100 such forecasts end outside"
        if self.by_model:
            return f"{often}, if the model has every slow part"
        far = duration_text(REACH * (self.now - self.start))
        return (
            f"{often}. A part slower than {far} that drifts by less than {3600.0 * self.drift:.2g} K/h cannot be seen; it would add "
            "that drift times its time constant"
        )

    def __str__(self) -> str:
        """The forecast in words, with what it saves and risks."""
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
            lines.append(f"  rule '{self.rule.name}': it is not to be seen when it will hold")
        elif self.holds <= self.now:
            lines.append(f"  rule '{self.rule.name}': holds by now")
        else:
            late = "" if self.holds_late is None else f", with 95 % by {duration_text(self.holds_late - self.start)}"
            saved = "" if self.declined else f"; stopping now saves {duration_text(self.saved or 0.0)}"
            lines.append(
                f"  rule '{self.rule.name}': holds about {duration_text(self.holds - self.start)} after the beginning{late}{saved}"
            )
        return "\n".join(lines)


def with_step(mixture: Mixture, step: float) -> Mixture:
    """Return a mixture with the steps of the sensor in its spreads."""
    return Mixture(mixture.weights, mixture.means, np.sqrt(mixture.spreads**2 + step**2 / 12.0))


def estimate(mixture: Mixture, level: float) -> IntervalEstimate:
    """Return the median of a mixture with its interval."""
    return IntervalEstimate(mixture.quantile(0.5), mixture.quantile(0.5 - level / 2.0), mixture.quantile(0.5 + level / 2.0))
