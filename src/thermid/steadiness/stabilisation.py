"""Is it stable by a rule, which part is the slowest, and what does the rule leave unfinished: for logs and for simulated runs."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from thermid.arguments import takes_objects
from thermid.errors import RecordError
from thermid.measure.amounts import duration_text, positive_seconds
from thermid.measure.record.prepare import stretch, within_log
from thermid.measure.record.record import Record
from thermid.measure.record.stability import SURE, ChannelStability, StabilityRule, channel_stability, rule_of, since_when
from thermid.profile_runs.profile_run import ProfileRun
from thermid.simulation.solution import Solution
from thermid.steadiness.approach import approach
from thermid.steadiness.forecast import FEWEST, GUARD
from thermid.steadiness.foretold import REACH
from thermid.steadiness.stored import Stored, stored_in_log, stored_in_run

Array = NDArray[np.float64]
TAU_ERROR: Final = 0.2
"""How far a time constant may be off, as a share of it."""
SHORT: Final = 60.0
"""Window of a rule that names none, on a simulated trace. [s]"""


@dataclass(frozen=True)
class Remaining:
    """How far a temperature still has to go.

    Parameters
    ----------
    value, low, high : float    The change to come, with its 95 % interval. [K]
    basis : str                 What it rests on: rate times time constant, or the readings themselves.
    """

    value: float
    low: float
    high: float
    basis: str

    def __str__(self) -> str:
        """The change with its interval."""
        return f"{self.value:+.2f} K to go ({self.low:+.2f} to {self.high:+.2f}, {self.basis})"


@dataclass(frozen=True)
class Stability:
    """Whether temperatures are stable by a rule.

    Parameters
    ----------
    title : str                 The record or run.
    rule : StabilityRule
    at : float                  Time of the question. [s]
    channels : dict             Name -> what its readings, or its trace, say.
    remaining : dict            Name -> how far it still has to go.
    since : dict                Name -> time from which it is stable; None where it is not. [s]
    tau : float or None         Time constant that the remaining change stands on. [s]
    stored : Stored or None     Of a rule on stored heat: what all of the unit takes up.
    """

    title: str
    rule: StabilityRule
    at: float
    channels: Mapping[str, ChannelStability]
    remaining: Mapping[str, Remaining]
    since: Mapping[str, float | None]
    tau: float | None
    stored: Stored | None = None

    @property
    def slowest(self) -> str:
        """The channel that is furthest from stable."""
        return max(self.channels, key=lambda n: abs(self.channels[n].rate) + SURE * self.channels[n].error)

    @property
    def verdict(self) -> str:
        """``stable``, ``not stable``, or ``cannot tell``: that of the worst channel, or of the heat that all take up together."""
        if self.stored is not None:
            return self.stored.verdict
        seen = {c.verdict for c in self.channels.values()}
        return next(v for v in ("not stable", "cannot tell", "stable") if v in seen)

    @property
    def stable(self) -> bool:
        """Whether every channel is stable beyond doubt."""
        return self.verdict == "stable"

    @property
    def decides(self) -> bool:
        """Whether a verdict may rest on the rule: it was not written down from memory."""
        return self.rule.mark != "memory"

    def as_object(self) -> dict[str, Any]:
        """Return it as JSON holds it."""
        return {
            "rule": self.rule.name,
            "source": self.rule.source,
            "mark": self.rule.mark,
            "verdict": self.verdict,
            "slowest": self.slowest,
            "at": self.at,
            "stored": None
            if (s := self.stored) is None
            else {"heat_W": s.watts, "error_W": s.error, "power_W": s.power, "nodes_W": {**s.nodes}},
            "channels": {
                n: {
                    "rate": c.rate,
                    "rate_error": c.error,
                    "window": c.end - c.start,
                    "verdict": c.verdict,
                    "since": self.since.get(n),
                    "remaining": None
                    if n not in self.remaining
                    else {"value": self.remaining[n].value, "low": self.remaining[n].low, "high": self.remaining[n].high},
                }
                for n, c in self.channels.items()
            },
        }

    def __str__(self) -> str:
        """The verdict, every channel, what is left to go."""
        lines = [f"{self.title}: {self.verdict} by '{self.rule.name}' ({self.rule.source}; {self.rule.mark}); slowest: {self.slowest}"]
        lines += [] if self.stored is None else [f"  {self.stored}"]
        for name, c in self.channels.items():
            text = f"  {c}"
            if self.since.get(name) is not None:
                text += f", since {duration_text(self.since[name] or 0.0)}"
            if name in self.remaining:
                text += f"; {self.remaining[name]}"
            lines.append(text)
        if self.tau is not None and not self.rule.stored:
            hidden = self.rule.rate * self.tau
            lines.append(
                f"  at the limit of the rule a part with a time constant of {duration_text(self.tau)} still has {hidden:.2g} K to go"
            )
        if not self.decides:
            lines.append("  the number of this rule is from memory: no verdict may rest on it before it was read in the standard")
        return "\n".join(lines)


@takes_objects
def stability(
    of: Record | Solution | ProfileRun,
    rule: str | StabilityRule = "3 C/h",
    channels: Iterable[str] = (),
    *,
    since: str | float = "start",
    at: str | float = "end",
    tau: str | float | None = None,
    reference: str = "",
    run: Solution | None = None,
    unit: str = "",
) -> Stability:
    """Return whether temperatures are stable by a rule, which is the slowest, and what the rule leaves unfinished.

    Parameters
    ----------
    of : Record, Solution or ProfileRun     A log, or a simulated run.
    rule : str              A named rule, or one of the project's own: ``0.5 K/h``, ``0.3 C/h over 2 h``.
    channels : iterable     Channels of a log, nodes of a run; every measured temperature, every node without a given temperature.
    since, at : str, float  When conditions last changed, and the time of the question.
    tau : str or float      Slowest time constant, for what is left to go; of a run its own, of a log what its readings say. [s]
    reference : str         Channel of a log that the temperatures follow, such as the air.
    run : Solution          For a rule on stored heat (``stored 3 %``) and a log: a run of the model under the same conditions, which gives
                            capacitances and powers. Every node that stores heat must be measured.
    unit : str              For such a rule: the submodel that is the unit; all of the model where none is named.

    Raises
    ------
    RecordError   When a rule or a name does not fit, readings are too few, or a rule on stored heat cannot be asked.
    """
    wanted = rule_of(rule)
    slow = None if tau is None else positive_seconds(tau, "tau")
    if isinstance(of, Record):
        return _of_record(of, wanted, tuple(channels), since, at, slow, reference, run, unit)
    return _of_solution(of.solution if isinstance(of, ProfileRun) else of, wanted, tuple(channels), since, at, slow, unit)


def _of_record(
    record: Record,
    rule: StabilityRule,
    names: tuple[str, ...],
    since: str | float,
    at: str | float,
    tau: float | None,
    reference: str,
    run: Solution | None,
    unit: str,
) -> Stability:
    within_log(record, at, f"{record.name}, stability")
    inside, _ = stretch(record, since, at, f"{record.name}, stability")
    times = record.times[inside]
    asked = names or tuple(c.name for c in record.channels.values() if c.quantity == "temperature" and c.role != "boundary")
    if not asked:
        raise RecordError("it has no temperature to ask about.", record.name)
    begin, end = float(times[0]), float(times[-1])
    cut = record.trim(begin, end)
    stored = None
    if rule.stored:
        stored, found = stored_in_log(cut, asked, rule, end, run, unit)
    else:
        found = {n: channel_stability(cut, n, rule, end, begin) for n in asked}
    known = {n: since_when(cut, n, rule, begin) if c.verdict == "stable" else None for n, c in found.items()}
    air = cut.channel(reference) if reference else None
    room = None if air is None else (cut.times[air.valid], air.values[air.valid])
    left = {}
    for name, c in found.items():
        valid = cut.channel(name).valid
        if tau is not None:
            left[name] = _rate_times(c, tau)
        elif np.count_nonzero(valid) >= FEWEST:
            left[name] = _by_readings(cut.times[valid], cut.channel(name).values[valid], room)
    return Stability(record.name, rule, end, found, left, known, tau, stored)


def _rate_times(c: ChannelStability, tau: float) -> Remaining:
    """Return rate times time constant, with the errors of both. [K]"""
    value = c.rate * tau
    error = 2.0 * float(np.hypot(c.error * tau, TAU_ERROR * value))
    return Remaining(value, value - error, value + error, f"rate times a time constant of {duration_text(tau)}")


def _by_readings(times: Array, kelvin: Array, room: tuple[Array, Array] | None) -> Remaining:
    """Return what the readings themselves say of the change to come. [K]"""
    found = approach(times, kelvin, REACH * float(times[-1] - times[0]), room=room, bent=GUARD)
    now, end = found.at(found.now).mean, found.at(float("inf"))
    return Remaining(end.quantile(0.5) - now, end.quantile(0.025) - now, end.quantile(0.975) - now, "by the readings alone")


def _of_solution(
    run: Solution, rule: StabilityRule, names: tuple[str, ...], since: str | float, at: str | float, tau: float | None, unit: str
) -> Stability:
    begin = 0.0 if since == "start" else positive_seconds(since, "since")
    end = float(run.times[-1]) if at == "end" else positive_seconds(at, "at")
    slow = tau if tau is not None else next((float(t) for t in run.time_constants if np.isfinite(t)), None)
    if rule.stored:
        stored, found = stored_in_run(run, rule, begin, end, unit)
        left = {n: _rate_times(c, slow) for n, c in found.items()} if slow is not None else {}
        return Stability(f"{run.title}, {run.scenario}", rule, end, found, left, {}, slow, stored)
    window = rule.window or SHORT
    if end - window < begin - 1e-9 or end > run.times[-1] * (1 + 1e-12):
        raise RecordError(
            f"'{rule.name}' looks back over {duration_text(window)} from {end:g} s, and the run does not hold that.", run.title
        )
    boundaries = {n for n in run.nodes if n in run._run.network.boundaries}
    asked = names or tuple(n for n in run.nodes if n not in boundaries)
    found = {}
    for name in asked:
        trace = run[name]
        inside = (trace.times >= end - window) & (trace.times <= end)
        seen = np.concatenate([trace.at(np.array([end - window, end])), trace.celsius[inside]])
        rate = float(seen[1] - seen[0]) / window
        moved = float(seen.max() - seen.min()) / window
        verdict = "stable" if moved <= rule.rate * (1.0 + 1e-9) else "not stable"
        found[name] = ChannelStability(
            name, rate if rule.window == 0.0 or abs(rate) >= moved else moved, 0.0, end - window, end, seen.size - 2, verdict
        )
    left = {n: _rate_times(c, slow) for n, c in found.items()} if slow is not None else {}
    return Stability(f"{run.title}, {run.scenario}", rule, end, found, left, {}, slow)
