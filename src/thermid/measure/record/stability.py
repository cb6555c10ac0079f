"""When a temperature counts as stable: the named rules of the standards, and how fast a channel of a record drifts, with its error."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

import numpy as np

from thermid.errors import RecordError, nearest
from thermid.measure.amounts import duration_text
from thermid.measure.record.channel import Channel, FloatArray
from thermid.measure.record.steady import FEWEST, correlation_factor

if TYPE_CHECKING:
    from thermid.measure.record.record import Record

HOUR: Final = 3600.0
SHORTEST: Final = 300.0
"""Shortest window over which a rule without one of its own is judged on readings. [s]"""
SURE: Final = 2.0
"""Standard errors that count as beyond doubt."""


@dataclass(frozen=True)
class StabilityRule:
    """A rule that says when a temperature counts as stable.

    Parameters
    ----------
    name : str          As it is written: ``3 C/h``.
    rate : float        Change per time that is allowed; of a rule on stored energy, the share of the power that may be stored. [K/s or -]
    window : float      Time over which the change is taken; zero where the rule says none. [s]
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

    @property
    def change(self) -> float:
        """Change that the window allows; zero for a rule without a window. [K]"""
        return 0.0 if self.stored else self.rate * self.window

    def __str__(self) -> str:
        """The rule with its source and mark."""
        return f"{self.name} ({self.source}; {self.mark})"


RULES: Final[Mapping[str, StabilityRule]] = {
    r.name: r
    for r in (
        StabilityRule("3 C/h", 3.0 / HOUR, 0.0, "SMC-S-016, 6.3.8.3 and 8.3.8.3", "read"),
        StabilityRule("0.2 C/h over 5 h", 0.2 / HOUR, 5.0 * HOUR, "SMC-S-016, 8.3.7: less than 1 C over 5 h", "read"),
        StabilityRule("0.05 C/h over 6 h", 0.05 / HOUR, 6.0 * HOUR, "GEVS, thermal balance", "secondary"),
        StabilityRule("1 K/h", 1.0 / HOUR, 0.0, "ECSS-E-ST-10-03C", "memory"),
        StabilityRule("1 K over 4 h", 0.25 / HOUR, 4.0 * HOUR, "ECSS-E-ST-10-03C, thermal balance", "memory"),
        StabilityRule("2 C/h", 2.0 / HOUR, 0.0, "MIL-STD-810H, part one", "memory"),
        StabilityRule("stored 2 %", 0.02, 0.0, "GSFC-STD-7000B, thermal balance", "memory", True),
        StabilityRule("stored 5 %", 0.05, 0.0, "GSFC-STD-7000B, thermal balance", "memory", True),
    )
}
"""Rules by name."""

_RATE = re.compile(
    r"(?P<size>[\d.]+(?:e-?\d+)?)\s*(?:C|K|degC)\s*(?P<per>/\s*h|/\s*min)?(?:\s+over\s+(?P<span>[\d.]+)\s*(?P<unit>h|min))?\Z"
)
_STORED = re.compile(r"stored\s+(?P<share>[\d.]+)\s*%\Z")


def rule_of(rule: str | StabilityRule) -> StabilityRule:
    """Return a rule by its name, or a rule of the project's own: ``0.5 K/h``, ``0.3 C/h over 2 h``, ``1 K over 3 h``, ``stored 3 %``.

    Raises
    ------
    RecordError   When it is neither.
    """
    if isinstance(rule, StabilityRule):
        return rule
    text = " ".join(str(rule).split())
    if text in RULES:
        return RULES[text]
    share = _STORED.match(text)
    if share is not None and 0.0 < float(share["share"]) < 100.0:
        return StabilityRule(text, float(share["share"]) / 100.0, 0.0, "the project's own", "project", True)
    found = _RATE.match(text)
    if found is None or float(found["size"]) <= 0.0 or not (found["per"] or found["span"]):
        raise RecordError(
            f"'{text}' is no rule of stability. There are {', '.join(RULES)}; one of your own is written like '0.5 K/h', "
            f"'0.3 C/h over 2 h', '1 K over 3 h' or 'stored 3 %'.{nearest(text, RULES)}",
            "stability",
        )
    span = float(found["span"]) * (HOUR if found["unit"] == "h" else 60.0) if found["span"] else 0.0
    if found["span"] and span <= 0.0:
        raise RecordError(f"'{text}': a window of no length shows no change.", "stability")
    per = span if not found["per"] else HOUR if "h" in found["per"] else 60.0
    same = next((r for r in RULES.values() if not r.stored and np.isclose(r.rate, float(found["size"]) / per) and r.window == span), None)
    return same or StabilityRule(text, float(found["size"]) / per, span, "the project's own", "project")


@dataclass(frozen=True)
class ChannelStability:
    """What readings say about one channel at one time.

    Parameters
    ----------
    name : str              The channel.
    rate : float            Drift over the window, by regression. [K/s]
    error : float           Its standard error: noise with its correlation, and the steps of the sensor. [K/s]
    start, end : float      The window. [s]
    samples : int           Readings in it.
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


def channel_stability(record: Record, name: str, rule: StabilityRule, at: float | None = None, since: float = -np.inf) -> ChannelStability:
    """Return whether one channel is stable at a time by a rule on its rate.

    A rule with a window takes the readings of that window. A rule without one takes the shortest stretch up to that time whose error lets
    the question be answered, from 5 minutes on.

    Parameters
    ----------
    record : Record
    name : str                  The channel.
    rule : StabilityRule        A rule on the rate.
    at : float                  Time of the question; the last reading when None. [s]
    since : float               Nothing before this time is looked at: when the conditions last changed. [s]

    Raises
    ------
    RecordError   When the rule is on stored heat, the channel is no temperature, or the window holds fewer than 8 readings.
    """
    channel, end = record.channel(name), float(record.times[-1] if at is None else at)
    where = f"{record.name}, {name}"
    if rule.stored:
        raise RecordError(
            f"'{rule.name}' is about stored heat, which readings alone do not show. Give a rule on the rate, or a model.",
            where,
        )
    if channel.quantity != "temperature":
        raise RecordError(f"it is a {channel.quantity}; a rule of stability holds for temperatures.", where)
    first = max(since, float(record.times[0]))
    if rule.window:
        if end - rule.window < first - 0.5 * record.step:
            raise RecordError(
                f"'{rule.name}' looks back over {duration_text(rule.window)}, and the readings go back {duration_text(end - first)}. "
                "Wait, or take a rule without a window.",
                where,
            )
        return _over(record, channel, rule, end - rule.window, end)
    span = min(max(SHORTEST, 8.0 * FEWEST * record.step), end - first)
    while True:
        found = _over(record, channel, rule, end - span, end)
        if found.verdict != "cannot tell" or span >= end - first:
            return found
        span = min(1.5 * span, end - first)


def channel_drift(record: Record, name: str, start: float, end: float) -> ChannelStability:
    """Return how fast one channel drifts over a window, with its error, judged by no rule.

    Raises
    ------
    RecordError   When the window holds fewer than 8 readings.
    """
    channel = record.channel(name)
    inside = (record.times >= start - 1e-9) & (record.times <= end + 1e-9) & channel.valid
    t, y = record.times[inside], channel.values[inside]
    if y.size < FEWEST or np.ptp(t) <= 0:
        raise RecordError(
            f"{y.size} readings lie in the window; {FEWEST} are needed for a rate with its error.", f"{record.name}, {channel.name}"
        )
    rate, error = _slope(t, y, resolution_of(channel))
    return ChannelStability(channel.name, rate, error, float(t[0]), float(t[-1]), int(y.size), "")


def _over(record: Record, channel: Channel, rule: StabilityRule, start: float, end: float) -> ChannelStability:
    """Return what the readings of one window say."""
    found = channel_drift(record, channel.name, start, end)
    sure = abs(found.rate) + SURE * found.error <= rule.rate
    verdict = "stable" if sure else "not stable" if abs(found.rate) - SURE * found.error > rule.rate else "cannot tell"
    return replace(found, verdict=verdict)


def _slope(t: FloatArray, y: FloatArray, step: float) -> tuple[float, float]:
    """Return the slope and its standard error. [K/s]"""
    x = t - t.mean()
    slope = float(x @ y / (x @ x))
    left = y - y.mean() - slope * x
    worth = y.size / correlation_factor(left)
    free = max(worth - 2.0, 1.0)
    spread = float(np.sqrt(left @ left / y.size * worth / free))
    error = spread / (worth**0.5 * float(np.std(t)))
    # steps of a sensor that noise does not blur hide a change of up to one step between both ends of the window
    hidden = step / 6.0**0.5 / float(np.ptp(t)) if spread < 0.5 * step else 0.0
    return slope, float(np.hypot(error, hidden))


def resolution_of(channel: Channel) -> float:
    """Return the smallest step of a sensor: as given, or as its readings show it; zero where they show none. [K]"""
    if channel.resolution is not None:
        return channel.resolution
    seen = channel.values[channel.valid]
    levels = np.unique(np.round(seen, 6))
    if levels.size < 2 or levels.size > seen.size / 8:
        return 0.0
    return float(np.median(np.diff(levels)))


def since_when(record: Record, name: str, rule: StabilityRule, since: float = -np.inf, looks: int = 120) -> float | None:
    """Return the earliest time from which a channel stays stable to the end of the record, or None. [s]

    Parameters
    ----------
    record, name, rule, since   As in `channel_stability`.
    looks : int                 Times at which the question is asked, at most.
    """
    begin = max(since, float(record.times[0]))
    first = begin + max(rule.window, SHORTEST, FEWEST * record.step)
    if first > record.times[-1]:
        return None
    earliest: float | None = None
    looks = min(looks, int((record.times[-1] - first) / record.step) + 2)  # more often than there are readings says nothing more
    for at in np.linspace(first, float(record.times[-1]), looks)[::-1]:
        try:
            verdict = channel_stability(record, name, rule, float(at), begin).verdict
        except RecordError:
            break
        if verdict != "stable":
            break
        earliest = float(at)
    return earliest
