"""When to stop a test: forecasts at set moments, each with a share of the risk, so that looking on does not add to it.

A decision is taken only when the time watched has doubled since the last one, after ten minutes when it has grown by a seventh, or when a
known power was switched, which begins another plateau; each of the first `DECISIONS` on a plateau takes the same part of its risk, and
later ones none: they forecast, and stop nothing (alpha spending: Lan and DeMets, Biometrika 70 (1983) 659; by the union bound for any
dependence between looks). Channels share each part alike. Within a decision the forecast is that of the model fitted to the readings
(`LiveFit`), or without a model that of `thermid.qualify._steadiness`. Where the readings meet the plan's rule, a stop is advised between
decisions too: its risk is the plan's.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Final

from thermid.base.errors import RecordError, SolverError
from thermid.measure.amounts import duration_text, short
from thermid.measure.records import Record
from thermid.measure.steadiness import StabilityRule, channel_stability
from thermid.model.tree import Model
from thermid.physics.constants import ICE_POINT
from thermid.qualify._steadiness.forecast import MIN_FORECAST_READINGS, Forecast, forecast
from thermid.qualify._watch.live_fit import LiveFit, ModelForecast
from thermid.simulation.runs import Scenario

RISK: Final = 0.01
"""Probability of one wrong stop on a plateau, at most: in a whole test where no known power is switched."""
DECISION_GROWTH: Final = 1.15
"""By how much the time watched grows from one decision to the next."""
MAX_DOUBLING_TIME: Final = 600.0
"""Up to which the time watched doubles from one decision to the next. [s]"""
DECISIONS: Final = 30
"""Decisions that share the risk: the time watched grows to sixty times that of the first one."""

AnyForecast = Forecast | ModelForecast
"""Where a channel ends, by its readings or by the model fitted to them."""

STOP, WAIT, DECLINED = "stop", "wait", "declined"


@dataclass(frozen=True)
class TemperatureLimit:
    """A limit on the final temperature of a channel. [K]"""

    channel: str
    above: bool
    value: float

    def undecided(self, low: float, high: float) -> bool:
        """Whether an interval low .. high [K] contains the limit."""
        return low <= self.value <= high

    def __str__(self) -> str:
        """Channel, sign and limit in Celsius."""
        return f"{self.channel}{'>' if self.above else '<'}{short(self.value - ICE_POINT)} degC"


@dataclass(frozen=True)
class StopAdvice:
    """Advice at one moment.

    Parameters
    ----------
    word : str                  ``stop``, ``wait`` or ``declined``.
    because : str               The reason, in words.
    decisions : int             Number of decisions so far.
    level : float               Probability of the intervals at the last one. [-]
    ends : dict                 Channel -> its `Forecast` or `ModelForecast` at the last one.
    holds : float or None       When the rule of stability will hold for all channels, with a probability of one half. [s]
    at : float                  Time of the decision. [s]
    """

    word: str
    because: str
    decisions: int
    level: float
    ends: Mapping[str, AnyForecast] = field(repr=False)
    holds: float | None
    at: float


class Stopping:
    """The decisions of one test on when to stop.

    Parameters
    ----------
    rule : StabilityRule    The plan's own rule of stability.
    within : float          Largest half-width of the interval of a final temperature. [K]
    limits : sequence       Limits on final temperatures; a stop needs each decided.
    risk : float            Probability of one wrong stop on a plateau, shared by `DECISIONS` decisions and all channels. [-]
    model, scenario         A model that is fitted to the readings, and the inputs that the log does not have.
    more                    Without a model, further arguments of `forecast`: reference, slowest.
    """

    def __init__(
        self,
        rule: StabilityRule,
        within: float,
        limits: tuple[TemperatureLimit, ...] = (),
        risk: float = RISK,
        model: Model | None = None,
        scenario: Scenario | None = None,
        **more: Any,
    ) -> None:
        self.rule, self.within, self.limits, self.risk, self.more = rule, within, limits, risk, more
        self.settling = None if model is None else LiveFit(model, scenario)
        self.count, self._watched, self.changed = 0, 0.0, float("-inf")
        self.last: StopAdvice | None = None

    def due(self, record: Record) -> bool:
        """Whether the next decision is due: the time watched has grown enough, or a power was switched since the last one."""
        if self.last is not None and record.times[-1] > self.changed >= self.last.at:
            return True
        return self._time_watched(record) >= min(2.0 * self._watched, max(DECISION_GROWTH * self._watched, MAX_DOUBLING_TIME))

    def _time_watched(self, record: Record) -> float:
        """Return the time since the beginning, or since a known power was switched. [s]"""
        return float(record.times[-1]) - max(float(record.times[0]), self.changed)

    def decide(self, record: Record, names: tuple[str, ...], settles: Mapping[str, float] | None = None, doubt: str = "") -> StopAdvice:
        """Return the advice on a record: a new decision where one is due, else the last one.

        Parameters
        ----------
        record : Record     All readings since conditions last changed.
        names : tuple       Channels that must end.
        settles : dict      Channel -> steady temperature of the model; a forecast that ends elsewhere is declined. [K]
        doubt : str         What is wrong with the test or its model; nothing is stopped then.
        """
        if self.last is None or self.due(record):
            self._forecast(record, names, settles or {}, doubt)
        assert self.last is not None
        return self._advice_now(record, names, self.last, doubt)

    def _forecast(self, record: Record, names: tuple[str, ...], settles: Mapping[str, float], doubt: str) -> None:
        """Make the next decision; `last` is then its advice."""
        anew = self.last is not None and self.changed >= self.last.at
        self.count = 1 if anew else self.count + 1
        self._watched = self._time_watched(record)
        level = 1.0 - self.risk / (DECISIONS * len(names))
        ends, why = ({}, "") if doubt else self._ends(record, names, level)
        holds = [f.holds for f in ends.values()]
        late = None if not ends or any(h is None for h in holds) else max(h for h in holds if h is not None)
        self.last = self._advice(record, ends, why or self._model_contradicts(ends, settles), late, level, doubt)

    def _advice_now(self, record: Record, names: tuple[str, ...], last: StopAdvice, doubt: str) -> StopAdvice:
        """Return the last decision as it holds now: declined by a doubt, or a stop where the readings meet the plan's rule."""
        now = float(record.times[-1])
        if doubt:
            return replace(last, word=DECLINED, because=doubt)
        expected = last.holds is not None and last.holds <= now
        if last.word == STOP or not expected or self._undecided_limits(last.ends) or not self._rule_is_met(record, names):
            return last
        open_ = "" if last.word == WAIT else f" Where the channels end is not known: {last.because}"
        return replace(last, word=STOP, because=f"the readings meet the plan's rule '{self.rule.name}'.{open_}", at=now)

    def _rule_is_met(self, record: Record, names: tuple[str, ...]) -> bool:
        """Whether the readings of every channel meet the plan's rule beyond two standard errors."""
        try:
            return all(channel_stability(record, n, self.rule, since=self.changed).verdict == "stable" for n in names)
        except RecordError:
            return False

    def _undecided_limits(self, ends: Mapping[str, AnyForecast]) -> list[TemperatureLimit]:
        """Return the limits that lie within the interval of their channel's final temperature."""
        return [m for m in self.limits if m.channel in ends and m.undecided(ends[m.channel].final.low, ends[m.channel].final.high)]

    def _ends(self, record: Record, names: tuple[str, ...], level: float) -> tuple[dict[str, AnyForecast], str]:
        """Return channel -> forecast at a probability `level`, and why there is none, in words."""
        ends: dict[str, AnyForecast] = {}
        why = ""
        if self.settling is not None:
            try:
                ends |= self.settling.ends(record, names, self.rule, self.within, level)
            except (RecordError, SolverError) as error:
                return {}, error.message
            return ends, "" if ends else f"a forecast needs {MIN_FORECAST_READINGS} readings of every channel."
        for name in names:
            try:
                ends[name] = forecast(record, name, rule=self.rule, within=self.within, level=level, **self.more)
            except RecordError as error:
                why = why or error.message
        return ends, why

    def _model_contradicts(self, ends: Mapping[str, AnyForecast], settles: Mapping[str, float]) -> str:
        """Return a sentence where readings end further than `within` from where the model settles; empty where they do not."""
        apart = {n: ends[n].final.value - t for n, t in settles.items() if n in ends and not ends[n].declined}
        far = max(apart, key=lambda n: abs(apart[n]), default="")
        if not far or abs(apart[far]) <= self.within:
            return ""
        return (
            f"{far}: the readings end at {ends[far].final}, the model settles {short(abs(apart[far]))} K "
            f"{'below' if apart[far] > 0 else 'above'} that. The model lacks a slow mass, or one of its values is wrong."
        )

    def _advice(
        self, record: Record, ends: Mapping[str, AnyForecast], why: str, late: float | None, level: float, doubt: str
    ) -> StopAdvice:
        """Return the advice of a decision: declined for a doubt or a wide interval, wait for the plan's rule, or stop."""
        now = float(record.times[-1])

        def advice_of(word: str, because: str) -> StopAdvice:
            """Return this advice at the time of the decision."""
            return StopAdvice(word, because, self.count, level, ends, late, now)

        if doubt or why:
            return advice_of(DECLINED if doubt or ends else WAIT, doubt or why)
        if self.count > DECISIONS:
            return advice_of(DECLINED, f"{DECISIONS} decisions were made, which uses up the stated risk. Apply the plan's rule instead.")
        open_ = [f for f in ends.values() if f.declined]
        if open_:
            worst = max(open_, key=lambda f: f.final.error)
            return advice_of(DECLINED, f"{worst.channel}: {worst.declined}")
        undecided = self._undecided_limits(ends)
        if undecided:
            m = undecided[0]
            f = ends[m.channel].final
            span = f"{short(f.low - ICE_POINT)} to {short(f.high - ICE_POINT)} degC"
            return advice_of(DECLINED, f"{m.channel} may end on either side of its limit {m}: {span}. Wait longer.")
        holds = late is not None and late <= now
        when = "" if late is None else f" (expected at {duration_text(late)})"
        rule = "" if holds else f" The plan's rule '{self.rule.name}' is not met yet{when}. Check in the plan whether the test may end."
        return advice_of(
            STOP, f"waiting longer does not change the verdict: every channel ends within +- {short(self.within)} K of its forecast.{rule}"
        )
