"""`Watcher`: a log looked at again and again; every `WatchLook` says what is advised, what nobody measures, and what went wrong.

A sensor that is off shows in its readings alone. By the model, a suspect is a value that changes some minutes before now. A filter that
knows of it would have had other innovations; the difference is its signature d, and what the innovations e hold of it raises the
log-likelihood by ``(sum d e / S)^2 / (2 sum d^2 / S)`` (generalised likelihood ratio: Willsky and Jones, IEEE Trans. Autom. Control 21
(1976) 108). The largest names the suspect; others that do as well are named with it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np

from thermid.base.errors import RecordError, SolverError
from thermid.base.units import HALF_WIDTH_95, ICE_POINT, Array, Bools, duration_text, short, value_of
from thermid.fit.calibration import Bench, Experiment
from thermid.fit.estimation import WIENER, At, Belief, Dynamics, Passing, ProcessNoise
from thermid.measure.records import Channel, Record
from thermid.model.tree import Constant, Model
from thermid.qualify._watch.growing import (
    FIRST_READINGS,
    MIN_NOISE,
    LogClock,
    after_gaps_left_out,
    block_means,
    min_gap,
    plateau_starts,
    raw_readings,
    reading_noise,
    switches,
    with_smooth_powers,
    without_spikes,
)
from thermid.qualify._watch.stopping import (
    CAPACITANCE_SPREAD,
    CONDUCTANCE_SPREAD,
    WAIT,
    StopAdvice,
    Stopping,
    SuspectValue,
    suspect_values,
    unknowns_with_priors,
    unlogged_ambients,
)
from thermid.simulation.runs import Network, Scenario, Traces, compile_network, settle

MIN_JUMP_CHANGES: Final = 8.0
"""Usual changes between neighbours by which a reading that jumps exceeds them, all at once, while what it measures cannot."""
LEAST_JUMP: Final = 3.0
"""The same at least. [K]"""
MISSING_READINGS: Final = 3
"""Readings in a row that are missing."""
JUMP_STAYS_TIME: Final = 60.0
"""How long readings must stay where they jumped to; sensors of simple boards are off by some kelvin for seconds. [s]"""
STUCK_READINGS: Final = 60
"""Readings in a row without any change, of a sensor that changed before."""
MIN_MOVING_SHARE: Final = 0.05
"""Share of neighbours that noise had apart by two steps before, from which a sensor that does not change is stuck."""


@dataclass(frozen=True)
class Alarm:
    """A fault of a sensor or of the unit.

    Parameters
    ----------
    kind : str          ``sensor``, ``joint``, ``air``, ``power``, ``heat path`` or ``ambient``.
    suspect : str       Channel or path.
    since : float       When it began, about. [s]
    because : str       In words.
    gain : float        Increase of the log-likelihood; infinite for what readings alone show. [-]
    """

    kind: str
    suspect: str
    since: float
    because: str
    gain: float

    def __str__(self) -> str:
        """Kind, suspect and reason on one line."""
        return f"{self.kind}: {self.suspect}: {self.because}"


def sensor_alarms(record: Record, names: Sequence[str], changed: Sequence[float] | Array = ()) -> list[Alarm]:
    """Return an alarm for each sensor whose readings are missing, stuck, or jumped further than a temperature can.

    Parameters
    ----------
    record : Record
    names : sequence        Channels.
    changed : sequence      When a known power was switched; a jump just after that is no alarm. [s]
    """
    return [a for c in map(record.channel, names) if (a := _sensor_alarm(c, record.times, np.asarray(changed))) is not None]


def jump_undecided(record: Record, names: Sequence[str]) -> bool:
    """Whether the last readings of a sensor jumped or are missing, and too few came since to say whether it is faulty."""
    for name in names:
        channel = record.channel(name)
        if not channel.valid[-1]:
            return True
        times, steps = record.times[channel.valid], np.diff(channel.values[channel.valid])
        late = times[1:] > record.times[-1] - 1.5 * JUMP_STAYS_TIME
        if late.any() and np.abs(steps[late]).max() > _min_jump(steps):
            return True
    return False


def _min_jump(steps: Array) -> float:
    """Return the smallest step between neighbours that is a jump: 8 usual steps, at least `LEAST_JUMP`. [K]

    The usual step is the larger of the median over 0.6745 and the 90 % quantile over 1.645, of |steps|.
    """
    usual = max(float(np.median(np.abs(steps))) / 0.6745, float(np.quantile(np.abs(steps), 0.9)) / 1.645, 1e-3)
    return max(MIN_JUMP_CHANGES * usual, LEAST_JUMP)


def _sensor_alarm(channel: Channel, times: Array, changed: Array) -> Alarm | None:
    """Return the alarm of a temperature channel by its readings alone; None without a cause.

    No reading among the last `MISSING_READINGS`; a jump beyond `_min_jump` [K] that stays for `JUMP_STAYS_TIME` [s] with no change of
    conditions about it; the same value `STUCK_READINGS` times in readings that scatter by more than their steps.

    Parameters
    ----------
    times : array (samples,)        [s]
    changed : array (changes,)      When conditions changed. [s]
    """
    name, valid = channel.name, channel.valid
    if valid.size >= MISSING_READINGS and not valid[-MISSING_READINGS:].any():
        last = np.flatnonzero(valid)
        since = float(times[last[-1] + 1]) if last.size else float(times[0])
        return Alarm("sensor", name, since, f"no reading since {since:.0f} s", float("inf"))
    t, y = times[valid], channel.values[valid]
    if y.size < 2 * MISSING_READINGS + 2:
        return None
    steps = np.diff(y)
    far = np.flatnonzero(np.abs(steps) > _min_jump(steps))
    usual = float(np.median(np.diff(t)))
    for k in far[::-1]:  # a spike comes back, a sensor that is off stays
        if np.any((changed <= t[k + 1]) & (changed > t[k] - JUMP_STAYS_TIME)):
            continue
        before, after = y[(t > t[k] - JUMP_STAYS_TIME) & (t <= t[k])], y[(t > t[k]) & (t <= t[k + 1] + JUMP_STAYS_TIME)]
        enough = (
            min(before.size, after.size) >= 2 * MISSING_READINGS
            and t[-1] >= t[k + 1] + JUMP_STAYS_TIME
            and t[k + 1] - t[k] < MISSING_READINGS * usual
        )
        if not enough or abs(float(np.median(after) - np.median(before))) < 0.7 * abs(steps[k]):
            continue
        if max(np.ptp(before), np.ptp(after)) < 0.5 * abs(steps[k]):  # else it jumps about, and what it reads is its noise
            words = f"jumped by {short(float(steps[k]))} K between two readings at {t[k + 1]:.0f} s and stayed there"
            return Alarm("sensor", name, float(t[k + 1]), words, float("inf"))
    if y.size > 3 * STUCK_READINGS and not steps[-STUCK_READINGS:].any():
        begin = int(np.flatnonzero(steps)[-1]) + 1 if steps.any() else 0
        earlier = steps[max(begin - 2 * STUCK_READINGS, 0) : begin]
        if earlier.size >= STUCK_READINGS and earlier.any():
            # noise moved readings by two of their smallest steps or more, so that as many equal ones in a row are no chance
            smallest = float(np.abs(earlier[earlier != 0.0]).min())
            if np.mean(np.abs(earlier - np.median(earlier)) > 1.5 * smallest) > MIN_MOVING_SHARE:
                return Alarm("sensor", name, float(t[begin]), f"has not changed since {t[begin]:.0f} s", float("inf"))
    return None


MODEL_NOISE: Final = 1e-3
"""Wiener noise on every node where nobody says how far the model can be trusted: 0.06 K in an hour. [K/s^0.5]"""
WINDOW: Final = 2400.0
"""How far back a fault is looked for. [s]"""
BEGINNINGS: Final = (60.0, 120.0, 180.0, 300.0, 480.0, 780.0, 1260.0, 2100.0)
"""Before now, when a fault may have begun. [s]"""
TRIED_AGAIN: Final = 12
"""Further beginnings that are tried about the best one."""
CLOSE_LOOK_BLOCK: Final = 10.0
"""Over what a closer look averages readings, where no node is faster than five times that. [s]"""
MIN_GAIN: Final = 20.0
"""Rise of the log-likelihood from which a fault is named: chance makes one in 2e8 of a single question, and a day of looks asks 1e5."""
MIN_GAIN_LEAD: Final = 2.0
"""By how much the named one must exceed that of every other kind; closer ones are named together."""
OFF: Final = 10.0
"""Times its noise that a logged power must have to be a candidate."""
TRIED_CHANGE: Final = 1.0
"""By which a suspected value is changed either way for its signature, of its logarithm."""
FITTED: Final = (
    f"the structure of the deck; its conductances, coefficients and powers to {100 * CONDUCTANCE_SPREAD:g} %, "
    f"its capacitances to {100 * CAPACITANCE_SPREAD:g} %"
)
"""What a fit to the readings takes as given."""
MIN_CAUSE_DEVIATIONS: Final = 4.0
"""Mean of neighbouring innovations, in its standard deviations, from which a cause is looked for: a gain of `MIN_GAIN` is a mean of 6."""
BELIEF_SPACING: Final = 300.0
"""Between the beliefs from which a closer look can begin. [s]"""
SPREAD_AFTER_GAP: Final = 10.0
"""Spread of every node after a gap. [K]"""
MIN_GROWTH_OF_MEAN: Final = 0.5
"""By how much such a mean must exceed that of the last closer look, where that found no cause, before the next one."""
CONFIRMATION_TIME: Final = 90.0
"""How long what the model's suspects explain must last before it is named: a sensor that jumps looks like anything at first. [s]"""


@dataclass(frozen=True)
class NodeBand:
    """Temperature of a node by the filter: value and 95 % half-width [K], and whether a sensor reads it."""

    name: str
    value: float
    half: float
    measured: bool


@dataclass(frozen=True)
class WatchLook:
    """Result of one look at a running test.

    Parameters
    ----------
    at : float                  Time of the last reading. [s]
    advice : StopAdvice         Stop, wait or declined.
    alarms : tuple of Alarm     Faults.
    nodes : tuple of NodeBand   Temperatures of the model's nodes; empty without a model.
    assumed : tuple of str      Assumptions, in words.
    """

    at: float
    advice: StopAdvice
    alarms: tuple[Alarm, ...]
    nodes: tuple[NodeBand, ...]
    assumed: tuple[str, ...] = ()

    def as_object(self) -> dict[str, Any]:
        """Return it as one JSON line holds it."""
        a = self.advice
        return {
            "at_s": self.at,
            "advice": a.word,
            "because": a.because,
            "decisions": a.decisions,
            "level": a.level,
            "rule_holds_at_s": a.holds,
            "remaining_s": None if a.holds is None else max(a.holds - self.at, 0.0),
            "ends": {n: f.as_object() for n, f in a.ends.items()},
            "nodes": {n.name: {"value_C": n.value - ICE_POINT, "half_K": n.half, "measured": n.measured} for n in self.nodes},
            "alarms": [{"kind": m.kind, "suspect": m.suspect, "since_s": m.since, "because": m.because} for m in self.alarms],
            "assumed": list(self.assumed),
        }

    def __str__(self) -> str:
        """Alarms, advice, forecasts, nodes without a sensor, and assumptions."""
        return "\n".join([self.without_inputs(), *(f"  assumed: {a}" for a in self.assumed)])

    def without_inputs(self) -> str:
        """Return it in words without the assumptions, which stay the same from look to look."""
        lines = [f"ALARM {m}" for m in self.alarms]
        word = {"stop": "stop now", "wait": "wait", "declined": "declined"}[self.advice.word]
        lines.append(f"after {duration_text(self.at)}: {word}: {self.advice.because}")
        for f in self.advice.ends.values():
            end = "declined" if f.declined else f"ends at {f.final}"
            ahead = 0.0 if f.holds is None else f.holds - self.at
            rule_text = "" if f.holds is None else f"; rule '{f.rule.name}' {f'in {duration_text(ahead)}' if ahead > 0.0 else 'met'}"
            decision_text = "" if f.now >= self.at else f" (decision after {duration_text(f.now)})"
            lines.append(f"  {f.channel} {f.latest - ICE_POINT:.2f} degC, {end}{rule_text}{decision_text}")
        for n in self.nodes:
            if not n.measured:
                lines.append(f"  {n.name} (not measured) {n.value - ICE_POINT:.2f} +- {short(n.half)} degC")
        return "\n".join(lines)


@dataclass
class _Filter:
    """State of the Kalman filter from look to look, of the last window only.

    Parameters
    ----------
    time : float            Up to which readings were taken. [s]
    belief : Belief         Mean and covariance of the nodes then; None before the first reading.
    stands : list           Earlier times and beliefs within the window, from which a closer look can begin.
    errors : dict           Sensor -> times and innovations in units of their standard deviations.
    fastest : float         Shortest time constant. [s]
    """

    time: float
    belief: Belief | None = None
    stands: list[tuple[float, Belief | None]] = field(default_factory=list)
    errors: dict[str, tuple[Array, Array]] = field(default_factory=dict)
    fastest: float = 0.0

    def take(self, window: _Window, now: float) -> None:
        """Take in the beliefs and innovations of a filtered stretch that ends at `now` [s]; forget those before the window."""
        grid = window.dynamics.grid
        between = [int(np.searchsorted(grid, at)) for at in np.arange(BELIEF_SPACING, float(grid[-1]), BELIEF_SPACING)]
        self.stands += [(self.time, self.belief), *((self.time + float(grid[k]), window.beliefs[k]) for k in between)]
        while len(self.stands) > 1 and self.stands[1][0] <= now - WINDOW:
            del self.stands[0]
        for k, o in enumerate(window.dynamics.experiment.observations):
            of_sensor = window.sensors == k
            old = self.errors.get(o.sensor, (np.zeros(0), np.zeros(0)))
            times = np.concatenate([old[0], self.time + window.times[of_sensor]])
            standard = np.concatenate([old[1], window.errors[of_sensor] / np.sqrt(window.variances[of_sensor])])
            late = times > now - WINDOW
            self.errors[o.sensor] = (times[late], standard[late])
        self.time, self.belief, self.fastest = now, window.beliefs[-1], window.fastest

    @property
    def largest(self) -> float:
        """The largest standardised mean of neighbouring innovations over all sensors. [-]"""
        return max((_largest_mean(standard) for _, standard in self.errors.values()), default=0.0)


def _largest_mean(standard: Array) -> float:
    """Return the largest |sum of n neighbours| / sqrt(n) over n = 1, 2, 4, ... of standardised innovations (samples,). [-]"""
    sums = np.concatenate([[0.0], np.cumsum(standard)])
    lengths = 2 ** np.arange(int(np.log2(max(standard.size, 1))) + 1)
    return max((float(np.abs(sums[n:] - sums[:-n]).max()) / n**0.5 for n in lengths if n < sums.size), default=0.0)


def roles_of_paths(network: Network) -> dict[str, str]:
    """Return path -> what a column can be bound to there: node, boundary or load."""
    return {
        **dict.fromkeys(network.nodes, "node"),
        **dict.fromkeys(network.boundaries, "boundary"),
        **{load.path: "load" for load in network.flat.loads},
    }


@dataclass
class Watcher:
    """A running test that is watched: advice when to stop, and alarms.

    Parameters
    ----------
    stopping : Stopping     Decides when to stop.
    channels : tuple        Temperatures that must end.
    model : Model or None   Of the unit; without one, nodes without sensors and faults of the unit are not known.
    scenario : Scenario     Inputs that the log does not have: constant boundaries, powers, starts.
    driven : float          Wiener noise on every node. [K/s^0.5]
    remarks : tuple of str  Further assumptions, stated with every look.
    """

    stopping: Stopping
    channels: tuple[str, ...]
    model: Model | None = None
    scenario: Scenario | None = None
    driven: float = MODEL_NOISE
    remarks: tuple[str, ...] = ()
    _filter: _Filter | None = field(default=None, init=False, repr=False)
    _nodes: tuple[NodeBand, ...] = field(default=(), init=False, repr=False)
    _since: float | None = field(default=None, init=False, repr=False)
    _wander: Mapping[str, float] = field(default_factory=dict, init=False, repr=False)
    _wander_next: Mapping[str, float] = field(default_factory=dict, init=False, repr=False)
    _cleared: float = field(default=0.0, init=False, repr=False)
    _clock: LogClock = field(default_factory=LogClock, init=False, repr=False)
    _last: WatchLook | None = field(default=None, init=False, repr=False)
    _roles: Mapping[str, str] | None = field(default=None, init=False, repr=False)
    _named: dict[str, Alarm] = field(default_factory=dict, init=False, repr=False)

    def look(self, record: Record) -> WatchLook:
        """Return the advice and alarms at the last moment of the log's own clock, so that they do not depend on when one looks.

        Parameters
        ----------
        record : Record     The log from when conditions last changed, its channels bound to the model's nodes; what came since the last
                            look is as it was read.
        """
        for moment in self._clock.moments(record):
            self._last = self._judge(moment)
        if self._last is not None:
            return self._last
        few = StopAdvice(
            WAIT, f"a log is judged from {FIRST_READINGS} readings on; {record.times.size} are there.", 0, 0.0, {}, None, record.times[-1]
        )
        return WatchLook(float(record.times[-1]), few, (), (), self._assumed(record))

    def _judge(self, record: Record) -> WatchLook:
        """Return the look at one moment: sensor alarms, then the model's fit and filter, then the decision."""
        recent, record = raw_readings(record), with_smooth_powers(without_spikes(record))
        blocks = block_means(record)
        calm = after_gaps_left_out(blocks)
        changed = plateau_starts(record, self.scenario)
        self.stopping.changed = max(changed, default=self.stopping.changed)
        off = sensor_alarms(recent, self.channels, np.append(changed, recent.times[switches(recent)]))
        broken = {a.suspect for a in off}
        names = tuple(n for n in self.channels if n not in broken)
        fitted = self.stopping.due(blocks) and self._refit(calm, names, True)
        nodes, alarms = self._nodes_and_alarms(record, blocks, names, fitted) if self.model is not None and names else ((), [])
        for a in (*off, *self._confirmed(alarms, recent, names)):
            self._named.setdefault(f"{a.kind} {a.suspect}", a)
        doubt = f"there is an alarm: {next(iter(self._named.values()))}" if self._named else ""
        doubt = doubt or ("readings differ from the model's forecast; the cause is not known yet." if alarms else "")
        settles = self._steady_temperatures(blocks) if self.model is not None and names and not doubt and self.stopping.due(blocks) else {}
        advice = (
            self.stopping.decide(calm, names, settles, doubt)
            if names
            else StopAdvice("declined", "no sensor gives readings any more. Check the logger.", 0, 0.0, {}, None, float(record.times[-1]))
        )
        return WatchLook(float(record.times[-1]), advice, tuple(self._named.values()), nodes, self._assumed(recent))

    def _assumed(self, record: Record) -> tuple[str, ...]:
        """Return the assumptions in words: the model's error, fitted values, noise that nobody stated."""
        if self.model is None:
            return ("no model is given, so faults of the unit and nodes without a sensor cannot be detected",)
        silent = [f"{n} {short(reading_noise(record, n))} K" for n in self.channels if not record.channel(n).noise]
        noise = [f"noise as the latest readings show it, because none is stated: {', '.join(silent)}"] if silent else []
        fitted = () if self.stopping.settling is None else (FITTED,)
        error = f"error of the model: {self.driven * 60.0:.2g} K per root of an hour on every node"
        return (error, *fitted, *noise, *self._unlogged(record), *self.remarks)

    def _unlogged(self, record: Record) -> tuple[str, ...]:
        """Return in words which powers are the deck's, and which inputs are held as last logged."""
        assert self.model is not None
        if self._roles is None:
            self._roles = roles_of_paths(compile_network(self.model))
        bound = {c.target or c.name for c in record.channels.values()}
        driven = bound | {*(self.scenario.loads if self.scenario is not None else ())}
        unlogged = [p for p, role in self._roles.items() if role == "load" and p not in driven]
        last = [p for p, role in self._roles.items() if role != "node" and p in bound]
        deck = (f"power of {', '.join(unlogged)}: the deck's, because no column gives it",) if unlogged else ()
        return (*deck, *((f"forecasts hold with {', '.join(last)} as last logged",) if last else ()))

    def _confirmed(self, alarms: list[Alarm], record: Record, names: Sequence[str]) -> list[Alarm]:
        """Return the alarms once they last `CONFIRMATION_TIME` and no sensor's jump is undecided; none after a fault was named."""
        now = float(record.times[-1])
        if not alarms or self._named:
            self._since = None
            return []
        if self._since is None:
            self._since = now
        return alarms if now - self._since >= CONFIRMATION_TIME and not jump_undecided(record, names) else []

    def _steady_temperatures(self, record: Record) -> dict[str, float]:
        """Return channel -> steady temperature of the model with the inputs as they are now. [K]"""
        assert self.model is not None
        experiment = Experiment.bind(self.model, record, self.scenario, errors={})
        engine = Bench.of_experiment(experiment, ()).engine
        a = engine.started(engine.wiring.assemble(gradients=False))
        last = float(experiment.times[-1])
        settled, _ = settle(engine, a, last)
        traces = Traces(engine.wiring, a, np.array([last]), engine.nodes, settled[None, :], np.zeros((1, settled.size, 0)))
        return {o.sensor: float(traces.temperature(o.node)[0]) for o in experiment.observations if o.sensor in self.channels}

    def _refit(self, record: Record, names: Sequence[str], due: bool) -> bool:
        """Fit the model's values; return whether they moved. The filter then passes the last window again with them."""
        settling = self.stopping.settling
        if settling is None or not names or self._named:
            return False
        before = settling.values
        try:
            settling.fit(record, names)
        except (RecordError, SolverError):
            return False  # the decision states why
        if due:  # a fault of the last minutes leaves residuals that wander: it must not count as noise of the readings that show it
            self._wander, self._wander_next = self._wander_next, settling.wander
        if settling.values is not before and self._filter is not None:
            self._filter = _Filter(*self._filter.stands[0])
        return settling.values is not before

    def _nodes_and_alarms(
        self, whole: Record, record: Record, names: Sequence[str], fitted: bool
    ) -> tuple[tuple[NodeBand, ...], list[Alarm]]:
        """Return the nodes now, and the suspects of the model that explain innovations which no fit of its values does.

        Parameters
        ----------
        whole, record : Record  The record, and its block means.
        names : sequence        Channels without an alarm.
        fitted : bool           Whether the model was fitted at this moment already.
        """
        f = self._advance_filter(record, names)
        self._cleared = min(self._cleared, f.largest)
        if self._named or f.largest <= max(MIN_CAUSE_DEVIATIONS, self._cleared + MIN_GROWTH_OF_MEAN):
            return self._nodes, []
        if not fitted and self._refit(after_gaps_left_out(record), names, False):
            f = self._advance_filter(record, names)
        settling = self.stopping.settling
        alarms = []
        if f.largest > MIN_CAUSE_DEVIATIONS and (settling is None or settling.values):
            begin, belief = f.stands[0]
            alarms = self._window(
                self._without_broken(block_means(whole, min(CLOSE_LOOK_BLOCK, f.fastest / 5.0)), names).trim(begin, "end"), belief
            ).alarms()
        self._cleared = 0.0 if alarms else f.largest
        return self._nodes, alarms

    def _advance_filter(self, record: Record, names: Sequence[str]) -> _Filter:
        """Return the filter after the readings that are new to it; `_nodes` are then those of now."""
        now = float(record.times[-1])
        if self._filter is None:
            self._filter = _Filter(float(record.times[0]))
        f = self._filter = self._after_gap(self._filter, record)
        if now > f.time:
            new = record.times >= f.time
            # all new readings of a channel may be masked, as after a jump at the very end
            read = [n for n in names if record[n].valid[new].any()]
            if not read:
                return f
            window = self._window(self._without_broken(record, read).trim(f.time, "end"), f.belief)
            f.take(window, now)
            self._nodes = window.nodes({} if self.stopping.settling is None else self.stopping.settling.variances)
        return f

    def _after_gap(self, f: _Filter, record: Record) -> _Filter:
        """Return the filter, begun anew with `SPREAD_AFTER_GAP` [K] after the last gap: unlogged inputs may have moved every node."""
        times = record.times[np.searchsorted(record.times, f.time) :]
        gaps = np.flatnonzero(np.diff(times, prepend=f.time) > min_gap(record))
        if not gaps.size or f.belief is None:
            return f
        mean = f.belief.mean
        return _Filter(float(times[gaps[-1]]), Belief(mean, SPREAD_AFTER_GAP * np.eye(mean.shape[1])[None]))

    def _without_broken(self, record: Record, names: Sequence[str]) -> Record:
        """Return a record without the channels that have an alarm."""
        others = {c.name for c in record.channels.values() if c.name in self.channels and c.name not in names}
        return record.select(*(c for c in record.channels if c not in others)) if others else record

    def _window(self, record: Record, belief: Belief | None) -> _Window:
        """Return a stretch of the log passed by the filter, from a belief, or from the start of the log where it is None."""
        assert self.model is not None
        settling = self.stopping.settling
        later = None if self.scenario is None else self.scenario.begun(float(record.times[0]) - self._clock.begin)
        return _Window.of_stretch(self.model, record, later, self.driven, belief, {} if settling is None else settling.values, self._wander)


@dataclass(frozen=True, eq=False)
class _FilterValues:
    """Values at which the filter runs.

    Parameters
    ----------
    names : tuple of str        Free values.
    x : array (names,)          Their numbers.
    bias : array (sensors,)     Constant errors of the sensors. [K]
    sigma : array (sensors,)    Noise of the sensors. [K]
    driven : array (nodes,)     Wiener noise of the nodes. [K/s^0.5]
    added : array (names,)      Whether a change is added to a value (temperatures) instead of multiplying it.
    """

    names: tuple[str, ...]
    x: Array
    bias: Array
    sigma: Array
    driven: Array
    added: Bools

    def at(self, dynamics: Dynamics, changed: tuple[str, float] = ("", 0.0)) -> At:
        """Return the dynamics at these values, one changed: by the factor exp(sign * `TRIED_CHANGE`), by `sign` K where it adds.

        `changed` is (name, sign); ``sensor k`` is the constant error of that sensor [K], an empty name changes nothing.
        """
        way, sign = changed
        is_changed = np.array([n == way for n in self.names])
        x = np.where(is_changed, np.where(self.added, self.x + sign, self.x * np.exp(sign * TRIED_CHANGE)), self.x)
        bias = self.bias.copy()
        if way.startswith("sensor "):
            bias[int(way.removeprefix("sensor "))] += sign
        count = len(dynamics.noises)
        return dynamics.at(x, self.driven, np.full(count, np.inf), self.sigma, bias)


@dataclass(frozen=True, eq=False)
class _Window:
    """A stretch of a log passed by the filter.

    Parameters
    ----------
    dynamics : Dynamics             The model with its sensors and noises.
    suspects : tuple                Values that a fault would change.
    values : _FilterValues          Values at which it ran.
    passing : Passing               The filter.
    beliefs : tuple of Belief       Mean and covariance of the nodes at the times of the grid.
    errors, variances : array (innovations,)    Innovations and their variances. [K], [K^2]
    times, sensors : array (innovations,)       Their times [s] and indices of sensors.
    """

    dynamics: Dynamics
    suspects: tuple[SuspectValue, ...]
    values: _FilterValues
    passing: Passing
    beliefs: tuple[Belief, ...]
    errors: Array
    variances: Array
    times: Array
    sensors: Array

    @classmethod
    def of_stretch(
        cls,
        model: Model,
        record: Record,
        scenario: Scenario | None,
        driven: float,
        start: Belief | None,
        values: Mapping[str, float],
        wander: Mapping[str, float],
    ) -> _Window:
        """Return a stretch passed by the filter at the values that a fit found.

        Parameters
        ----------
        model, record, scenario     The stretch and its inputs.
        driven : float              Wiener noise on every node. [K/s^0.5]
        start : Belief or None      Where it begins; the scenario's start where it is None.
        values : dict               Deviations of values from the model, as `LiveFit.values`.
        wander : dict               Sensor -> factor on its noise, because its residuals are correlated.
        """
        experiment = Experiment.bind(model, record, scenario, errors={})
        free, base, _, relative = unknowns_with_priors(experiment)
        keep = np.array([not n.startswith("initial.") for n in free])
        names = tuple(n for n, keeps in zip(free, keep, strict=True) if keeps)
        moved = np.array([values.get(n, 0.0) for n in names])
        x = np.where(relative[keep], base[keep] * np.exp(moved), base[keep] + moved)
        bias = np.array([values.get(f"sensor {o.sensor}", 0.0) for o in experiment.observations])
        boundaries = experiment.scenario.boundaries
        ambients = unlogged_ambients(experiment.network, {c.target or c.name for c in record.channels.values()})
        # the free value of an ambient is its temperature where that is constant, else what is added to it [K]
        free_ambients = [s.value if isinstance(s := boundaries[a.path], Constant) else 0.0 for a in ambients]
        names, x = (*names, *(a.path for a in ambients)), np.append(x, free_ambients)
        bench = Bench.of_experiment(experiment, names)
        massive = [n for n, c in experiment.network.numbers().capacitances.items() if c is not None]
        noises = [ProcessNoise(n, "node", WIENER, driven, False) for n in massive]
        sizes = np.hypot(driven, [_noise_by_powers(experiment, n) for n in massive])
        dynamics = Dynamics(bench, noises, {})
        sigma = np.array([o.sigma({o.sensor: MIN_NOISE}) * wander.get(o.sensor, 1.0) for o in experiment.observations])
        values_of = _FilterValues(names, x, bias, sigma, sizes, np.arange(len(names)) >= len(names) - len(ambients))
        passing = Passing(dynamics, [values_of.at(dynamics)])
        passed = passing.run(keep=True, begin=None if start is None else (0, start))
        i = passed.innovations
        off = {
            c.target or c.name for c in record.channels.values() if c.held and not (np.abs(c.values[c.valid]) > OFF * c.white_noise).any()
        }
        suspects = (*(s for s in suspect_values(experiment.network) if s.kind != "power" or s.whose not in off), *ambients)
        return cls(dynamics, suspects, values_of, passing, passed.beliefs, i.errors[:, 0], i.variances[:, 0], i.times, i.sensors)

    def nodes(self, of_values: Mapping[str, float]) -> tuple[NodeBand, ...]:
        """Return every node at the end with its 95 % half-width.

        The variance is the filter's at the fitted values, and `of_values`, node -> that by the errors of these values [K^2] (law of total
        variance): what the readings leave open of a contact or film moves a node that no sensor reads.
        """
        last = self.beliefs[-1]
        read = {o.seat for o in self.dynamics.experiment.observations}
        sd = np.sqrt(last.variance[0] + [of_values.get(n, 0.0) for n in self.dynamics.states])
        return tuple(
            NodeBand(n, float(m), HALF_WIDTH_95 * float(s), n in read)
            for n, m, s in zip(self.dynamics.states, last.mean[0], sd, strict=True)
        )

    @property
    def fastest(self) -> float:
        """Shortest time constant at the end, 1 / max |eigenvalue| of the linearised model. [s]"""
        local = self.dynamics.local(self.values.at(self.dynamics), self.beliefs[-1].mean[0], float(self.dynamics.grid[-1]))
        return float(1.0 / max(np.abs(np.linalg.eigvals(local.jacobian)).max(), 1e-12))

    def alarms(self) -> list[Alarm]:
        """Return the suspect that explains the innovations with the largest gain in log likelihood [-]; none below a gain of `MIN_GAIN`.

        Others within `MIN_GAIN_LEAD` of it are named in its sentence. Tried beginnings are `BEGINNINGS` [s] back, and `TRIED_AGAIN` more
        about the best.
        """
        end = float(self.dynamics.grid[-1])
        backs = [0.0, *(back for back in BEGINNINGS if back < end)]
        alarms = [a for back in backs[1:] for a in self._alarms_since(end - back)]
        best = max(alarms, key=lambda a: a.gain, default=None)
        if best is None or best.gain < MIN_GAIN:
            return []
        # a beginning that is wrong blames what acts later or sooner: look closer about the best
        k = int(np.argmin(np.abs(np.array(backs) - (end - best.since))))
        for back in np.linspace(backs[max(k - 1, 0)], backs[min(k + 1, len(backs) - 1)], TRIED_AGAIN + 2)[1:-1]:
            alarms += self._alarms_since(end - float(back))
        best = max(alarms, key=lambda a: a.gain)
        alike = {a.suspect: a for a in alarms if a.gain > best.gain - MIN_GAIN_LEAD}
        if len(alike) == 1:
            return [best]
        others = ", ".join(f"{a.kind} {a.suspect}" for a in alike.values() if a.suspect != best.suspect)
        return [Alarm(best.kind, best.suspect, best.since, f"{best.because}; {others} would explain it as well", best.gain)]

    def _alarms_since(self, since: float) -> list[Alarm]:
        """Return an alarm for each suspect and each sensor's constant error, up and down, of size a > 0 had it changed at `since` [s].

        With innovations e (instants, sensors) [K], their variances S [K^2] and the signature d of a unit change [K], the difference that it
        makes to the innovations: a = sum(d e / S) / sum(d^2 / S), gain a^2 sum(d^2 / S) / 2. None with fewer than four innovations.
        """
        place = max(int(np.searchsorted(self.dynamics.grid, since)) - 1, 0)
        names = [*(s.path for s in self.suspects), *(f"sensor {k}" for k in range(self.values.sigma.size))]
        ways = [(name, sign) for name in names for sign in (-1.0, 1.0)]
        members = [self.values.at(self.dynamics, way) for way in (("", 0.0), *ways)]
        belief = self.beliefs[place]
        count = len(members)
        several = Belief(np.repeat(belief.mean, count, axis=0), np.repeat(belief.root, count, axis=0))
        run = Passing(self.dynamics, members).run(begin=(place, several))
        errors, variances = run.innovations.errors, run.innovations.variances[:, 0]
        if errors.shape[0] < 4:
            return []
        out = []
        for k, way in enumerate(ways):
            signature = errors[:, 0] - errors[:, 1 + k]
            size = float(np.sum(signature**2 / variances))
            if size < 1e-12:
                continue
            share = float(np.sum(signature * errors[:, 0] / variances)) / size
            if share > 0.0:
                out.append(self._alarm(way[0], way[1] * share, 0.5 * share**2 * size, since))
        return out

    def _alarm(self, way: str, share: float, gain: float, since: float) -> Alarm:
        """Return the alarm of a suspect or sensor changed by `share` of the tried change."""
        if way.startswith("sensor "):
            o = self.dynamics.experiment.observations[int(way.removeprefix("sensor "))]
            return Alarm(
                "sensor", o.sensor, since, f"reads {short(abs(share))} K too {'high' if share > 0 else 'low'}, or has slipped", gain
            )
        s = next(s for s in self.suspects if s.path == way)
        return Alarm(s.kind, s.whose, since, s.lower if share < 0 else s.higher, gain)


def _noise_by_powers(experiment: Experiment, node: str) -> float:
    """Return the Wiener noise of a node by the noise of its logged powers: sigma sqrt(interval) / C. [K/s^0.5]"""
    loads = {load.path for load in experiment.network.flat.loads if load.node == node}
    capacity = experiment.network.numbers().capacitances[node]
    record = experiment.record
    noises = [c.white_noise for c in record.channels.values() if c.quantity == "power" and (c.target or c.name) in loads]
    return float(np.linalg.norm(noises)) * record.step**0.5 / value_of(capacity or 1.0) if noises else 0.0
