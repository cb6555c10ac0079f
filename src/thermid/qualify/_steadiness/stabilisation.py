"""Is it stable by a rule, which part is the slowest, and what does the rule leave unfinished: for logs and for simulated runs.

Rules on the heat that a unit still takes up are asked of a run, or of measured temperatures with the capacitances and powers of a run: the
sum over all nodes of capacitance times rate. A node that is not measured could take up any.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from thermid.base.errors import RecordError, quoted
from thermid.base.results import Result
from thermid.base.units import duration_text, positive_seconds, value_of
from thermid.measure.records import DOUBT_IN_ERRORS, TAU_ERROR, ChannelStability, Record, StabilityRule, spans
from thermid.qualify._profile_runs.conduct import SIMULATED_WINDOW
from thermid.qualify._profile_runs.profile_run import ProfileRun
from thermid.qualify._steadiness.forecast import GUARD, MAX_UNSEEN_SLOWNESS, MIN_FORECAST_READINGS, approach
from thermid.simulation.runs import Solution


@dataclass(frozen=True)
class Stored:
    """Heat that a unit still takes up, compared with its power.

    Parameters
    ----------
    watts, error : float    Heat that it takes up, negative where it gives heat off; its standard error. [W]
    power : float           Mean power of its loads over the window. [W]
    start, end : float      The window. [s]
    verdict : str           ``stable``, ``not stable``, or ``cannot tell``.
    nodes : dict            Node -> heat that it takes up. [W]
    """

    watts: float
    error: float
    power: float
    start: float
    end: float
    verdict: str
    nodes: Mapping[str, float]

    def __str__(self) -> str:
        """The heat, its share of the power, and the verdict."""
        share, sure = 100.0 * self.watts / self.power, 100.0 * self.error / self.power
        size = f"{self.watts:+.3g} +- {self.error:.2g} W" if self.error else f"{self.watts:+.3g} W"
        part = f"{share:+.2g} +- {sure:.1g} %" if self.error else f"{share:+.2g} %"
        most = max(self.nodes, key=lambda n: abs(self.nodes[n]))
        return (
            f"heat taken up: {size}, {part} of {self.power:.3g} W, over the last {duration_text(self.end - self.start)}, "
            f"most of it in '{most}': {self.verdict}"
        )


@dataclass(frozen=True)
class Remaining:
    """Change of a temperature that is still to come.

    Parameters
    ----------
    value, low, high : float    The change, with its 95 % interval. [K]
    basis : str                 How it was found: rate times time constant, or from the readings alone.
    """

    value: float
    low: float
    high: float
    basis: str

    def __str__(self) -> str:
        """The change with its interval."""
        return f"{self.value:+.2f} K to go ({self.low:+.2f} to {self.high:+.2f}, {self.basis})"


@dataclass(frozen=True)
class Stability(Result):
    """Verdict of a rule of stability on a record or a run.

    Parameters
    ----------
    title : str                 The record or run.
    rule : StabilityRule
    at : float                  Time of the question. [s]
    channels : dict             Name -> rate, error and verdict of one channel or node.
    remaining : dict            Name -> change that is still to come.
    since : dict                Name -> time from which it is stable; None where it is not. [s]
    tau : float or None         Time constant by which the remaining change was computed. [s]
    stored : Stored or None     Heat that the unit takes up, for a rule on stored heat.
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
        """The channel with the largest |rate| + 2 standard errors."""
        return max(self.channels, key=lambda n: abs(self.channels[n].rate) + DOUBT_IN_ERRORS * self.channels[n].error)

    @property
    def verdict(self) -> str:
        """``stable``, ``not stable`` or ``cannot tell``: the worst of the channels', or that of the stored heat."""
        if self.stored is not None:
            return self.stored.verdict
        verdicts = {c.verdict for c in self.channels.values()}
        return next(v for v in ("not stable", "cannot tell", "stable") if v in verdicts)

    @property
    def stable(self) -> bool:
        """Whether every channel is stable beyond two standard errors."""
        return self.verdict == "stable"

    @property
    def decides(self) -> bool:
        """Whether a verdict may use the rule: its number does not come from memory."""
        return self.rule.mark != "memory"

    def as_object(self) -> dict[str, Any]:
        """Return it as plain numbers for JSON. [SI]"""
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
        """The verdict, and every channel with the change that is still to come."""
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
            lines.append("  the number of this rule is quoted from memory. Check it in the standard before any verdict uses it")
        return "\n".join(lines)


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
    """Judge whether temperatures are stable by a rule: the verdict, the slowest channel, and the change still to come.

    Parameters
    ----------
    of : Record, Solution or ProfileRun     A log, or a simulated run.
    rule : str              A named rule, or one of the project's own: ``0.5 K/h``, ``0.3 C/h over 2 h``.
    channels : iterable     Channels of a log, nodes of a run; every measured temperature, every node without a given temperature.
    since, at : str, float  When conditions last changed, and the time of the question. [s]
    tau : str or float      Slowest time constant, for the remaining change; by default a run's own, or what the readings of a log show. [s]
    reference : str         Channel of a log that the temperatures follow, such as the air.
    run : Solution          For a rule on stored heat (``stored 3 %``) and a log: a run of the model under the same conditions, which gives
                            capacitances and powers. Every node that stores heat must be measured.
    unit : str              For such a rule: the submodel that is the unit; all of the model by default.

    Raises
    ------
    RecordError   When a rule or a name does not fit, readings are too few, or a rule on stored heat cannot be asked.
    """
    wanted = StabilityRule.named(rule)
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
    """Judge a log up to `at`; arguments as of `stability`, times in s. Without `tau` the change still to come is forecast from readings.

    Raises
    ------
    RecordError   When `at` lies beyond the log, or the log has no temperature.
    """
    record.refuse_beyond(at, f"{record.name}, stability")
    inside, _ = record.stretch(since, at, f"{record.name}, stability")
    times = record.times[inside]
    wanted = names or tuple(record.measured)
    if not wanted:
        raise RecordError("it has no temperature. Give a log or run with one.", record.name, code="record.does-not-apply")
    begin, end = float(times[0]), float(times[-1])
    cut = record.trim(begin, end)
    stored = None
    if rule.stored:
        stored, states = _stored_in_log(cut, wanted, rule, end, run, unit)
    else:
        states = {n: rule.of_channel(cut, n, end, begin) for n in wanted}
    stable_since = {n: rule.since_when(cut, n, begin) if c.verdict == "stable" else None for n, c in states.items()}
    air = cut.channel(reference) if reference else None
    room = None if air is None else (cut.times[air.valid], air.values[air.valid])
    remaining = {}
    for name, c in states.items():
        valid = cut.channel(name).valid
        if tau is not None:
            remaining[name] = _rate_times_tau(c, tau)
        elif np.count_nonzero(valid) >= MIN_FORECAST_READINGS:
            moments = cut.times[valid]
            longest = MAX_UNSEEN_SLOWNESS * float(moments[-1] - moments[0])
            curve = approach(moments, cut.channel(name).values[valid], longest, room=room, bent=GUARD)
            mean, last = curve.at(curve.now).mean, curve.at(float("inf"))
            change, low, high = (last.quantile(p) - mean for p in (0.5, 0.025, 0.975))
            remaining[name] = Remaining(change, low, high, "by the readings alone")
    return Stability(record.name, rule, end, states, remaining, stable_since, tau, stored)


def _rate_times_tau(c: ChannelStability, tau: float) -> Remaining:
    """Return the remaining change rate tau, with twice the standard error sqrt((error tau)^2 + (0.2 rate tau)^2). [K]"""
    value = c.rate * tau
    error = 2.0 * float(np.hypot(c.error * tau, TAU_ERROR * value))
    return Remaining(value, value - error, value + error, f"rate times a time constant of {duration_text(tau)}")


def _of_solution(
    run: Solution, rule: StabilityRule, names: tuple[str, ...], since: str | float, at: str | float, tau: float | None, unit: str
) -> Stability:
    """Judge a run over the rule's window before `at`; arguments as of `stability`, times in s.

    `tau` [s], or the slowest time constant of the run, gives the change still to come, rate times tau. `unit` is the path of the part
    whose stored heat counts, where the rule is one of stored heat.

    Raises
    ------
    RecordError   When the rule's window is not within the run.
    """
    begin = 0.0 if since == "start" else positive_seconds(since, "since")
    end = float(run.times[-1]) if at == "end" else positive_seconds(at, "at")
    slow = tau if tau is not None else next((float(t) for t in run.time_constants if np.isfinite(t)), None)
    window = rule.window or SIMULATED_WINDOW
    if end - window < begin - 1e-9 or end > run.times[-1] * (1 + 1e-12):
        raise RecordError(
            f"'{rule.name}' needs {duration_text(window)} before {end:g} s, but the run does not include that time.",
            run.title,
            code="record.too-short",
        )
    stored = None
    if rule.stored:
        stored, states = _stored_in_run(run, rule, end - window, end, unit)
    else:
        nodes = names or tuple(n for n in run.nodes if n not in run._run.network.boundaries)
        states = {n: _node_stability(run, n, rule, end - window, end) for n in nodes}
    remaining = {n: _rate_times_tau(c, slow) for n, c in states.items()} if slow is not None else {}
    return Stability(f"{run.title}, {run.scenario}", rule, end, states, remaining, {}, slow, stored)


def _node_stability(run: Solution, node: str, rule: StabilityRule, start: float, end: float) -> ChannelStability:
    """Judge a simulated node by the range of its temperature over the window, (T_max - T_min) / window. [K/s]"""
    trace, window = run[node], end - start
    inside = (trace.times >= start) & (trace.times <= end)
    course = np.concatenate([trace.at(np.array([start, end])), trace.celsius[inside]])
    rate, span = float(course[1] - course[0]) / window, float(np.ptp(course)) / window
    verdict = "stable" if span <= rule.rate * (1.0 + 1e-9) else "not stable"
    return ChannelStability(node, rate if rule.window == 0.0 or abs(rate) >= span else span, 0.0, start, end, course.size - 2, verdict)


def _capacities(run: Solution, unit: str) -> dict[str, float]:
    """Return node -> capacitance at the end of a run, of the nodes of a unit that store heat. [J/K]"""
    network = run._run.network
    ahead = f"{unit}." if unit else ""
    out = {}
    for node, capacitance in network.numbers().capacitances.items():
        if not node.startswith(ahead) or capacitance is None or value_of(capacitance) <= 0.0:
            continue
        store = network.stores.get(node)
        end = float(run[node].kelvin[-1])
        out[node] = float(value_of(capacitance)) * (1.0 if store is None else float(store.share(end)))
    return out


def _mean_power(run: Solution, unit: str, start: float, end: float) -> float:
    """Return the mean of the sum of |power| of a unit's loads between two times. [W]

    Raises
    ------
    RecordError   When it is zero.
    """
    ahead = f"{unit}." if unit else ""
    axis = np.linspace(start, end, 61)
    powers = [np.broadcast_to(w, run.times.shape) for load, w in run.load_powers.items() if load.startswith(ahead)]
    power = float(sum(np.abs(np.interp(axis, run.times, w)).mean() for w in powers))
    if power <= 0.0:
        raise RecordError(
            "the unit has no power, so a rule on stored heat does not apply. Give a rule on the rate.",
            run.title,
            code="record.does-not-apply",
        )
    return power


def _stored_in_run(run: Solution, rule: StabilityRule, start: float, end: float, unit: str) -> tuple[Stored, dict[str, ChannelStability]]:
    """Return the heat [W] that a simulated unit takes up, sum of C (T(end) - T(start)) / (end - start), and the rate of each node [K/s].

    C [J/K] is that at the end of the run. The heat is stable at or below the share `rule.rate` [-] of the unit's mean power; the rates of
    single nodes are not judged.

    Raises
    ------
    RecordError   When the unit has no power.
    """
    capacities = _capacities(run, unit)
    rates = {n: float(np.diff(run[n].at(np.array([start, end])))[0]) / (end - start) for n in capacities}
    nodes = {n: c * rates[n] for n, c in capacities.items()}
    watts, power = sum(nodes.values()), _mean_power(run, unit, start, end)
    stored = Stored(watts, 0.0, power, start, end, StabilityRule.verdict(watts, 0.0, rule.rate * power), nodes)
    return stored, {n: ChannelStability(n, rate, 0.0, start, end, 2, "") for n, rate in rates.items()}


def _stored_in_log(
    record: Record, channels: Sequence[str], rule: StabilityRule, end: float, run: Solution | None, unit: str = ""
) -> tuple[Stored, dict[str, ChannelStability]]:
    """Return the heat that a unit takes up by its readings, sum of C dT/dt over nodes, and the rate of every channel.

    The window is the shortest one up to the end whose error lets the question be answered, from 5 minutes on. A node with several sensors
    has
    the mean of their rates.

    Parameters
    ----------
    record : Record         The readings since conditions last changed.
    channels : sequence     Channels at nodes of the unit.
    rule : StabilityRule    A rule on stored heat.
    end : float             Time of the question. [s]
    run : Solution          A run of the model under the conditions of the log, for capacitances and powers.
    unit : str              The submodel that is the unit; all of the model where none is named.

    Raises
    ------
    RecordError   When there is no run, or a node that stores heat is not measured; with the nodes.
    """
    if run is None:
        raise RecordError(
            f"'{rule.name}' is a rule on stored heat, which cannot be found from readings alone. Give a rule on the rate, or a run of "
            "a model under the same conditions (run=; on the command line --model and --scenario).",
            record.name,
            code="record.does-not-apply",
        )
    find = run._run.network.find
    capacities = _capacities(run, unit)
    sits: dict[str, list[str]] = {}
    for name in channels:
        sits.setdefault(find(record.channel(name).target or name), []).append(name)
    hidden = {n: c for n, c in capacities.items() if n not in sits}
    if hidden:
        listed = quoted(sorted(hidden, key=lambda n: -hidden[n]))
        share = 100.0 * sum(hidden.values()) / sum(capacities.values())
        raise RecordError(
            f"'{rule.name}' needs the temperature of every node that stores heat; {listed} "
            f"{'are' if len(hidden) > 1 else 'is'} not measured ({share:.2g} % of the capacitance). "
            "Put sensors there, or use a rule on the rate.",
            record.name,
            code="record.does-not-apply",
        )
    first, measured = float(record.times[0]), [name for n, names in sits.items() if n in capacities for name in names]
    judged: list[tuple[Stored, dict[str, ChannelStability]]] = []
    for span in spans(record, first, end):
        drift = {name: ChannelStability.drift(record, name, end - span, end) for name in measured}
        nodes = {n: c * float(np.mean([drift[name].rate for name in sits[n]])) for n, c in capacities.items()}
        errors = [c * drift[name].error / len(sits[n]) ** 0.5 for n, c in capacities.items() for name in sits[n]]
        watts, error = sum(nodes.values()), float(np.sqrt(np.sum(np.square(errors))))
        power = _mean_power(run, unit, end - span, end)
        verdict = StabilityRule.verdict(watts, error, rule.rate * power)
        judged.append((Stored(watts, error, power, end - span, end, verdict, nodes), drift))
        if verdict != "cannot tell":
            return judged[-1]
    return min(judged, key=lambda one: one[0].error)
