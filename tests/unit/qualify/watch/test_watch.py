"""Watching a running test: when a stop is advised or declined, and what is said of sensors."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from thermid.base.errors import ThermidError
from thermid.measure.records import Record, StabilityRule
from thermid.qualify._watch.request import BoundColumns, WatchRequest
from thermid.qualify._watch.stopping import DECISIONS, Stopping, TemperatureLimit, _time_of_stability
from thermid.qualify._watch.watcher import Watcher, sensor_alarms, suspect_values
from unit.fit.estimation.rig import logged, rig, run, scenario

ICE = 273.15
RULE = StabilityRule.named("3 C/h")


def rising(size: int = 400, tau: float = 900.0, seed: int = 1, end: float = 20.0) -> Record:
    """Return a synthetic approach with one time constant, 10 s apart."""
    t = 10.0 * np.arange(size)
    r = np.random.default_rng(seed)
    return Record.from_arrays("rising", t, {"T": ICE + 22.0 + end * (1.0 - np.exp(-t / tau)) + r.normal(0.0, 0.05, size)}, unit="K")


@pytest.mark.parametrize("now", [3700.0, 9000.0, 12000.0])
def test_a_rule_holds_once_the_change_over_its_window_is_small(now: float) -> None:
    """T = 10 exp(-t / tau) changes by 10 (exp(w / tau) - 1) exp(-t / tau) over a window w: before now, too, where it began there."""
    tau, rule = 3600.0, StabilityRule.named("1 K over 1 h")
    times = np.concatenate([np.linspace(now - rule.window, now, 400), now + np.geomspace(10.0, 1e5, 400)])
    small = tau * np.log(10.0 * (np.exp(rule.window / tau) - 1.0))
    assert _time_of_stability(times, 10.0 * np.exp(-times / tau), rule, now) == pytest.approx(max(now, small), rel=0.03)


class TestSensors:
    def values(self, change: Callable[[np.ndarray], None]) -> list[str]:
        record = rising(300)
        values = record["T"].values.copy()
        change(values)
        return [
            f"{a.suspect}: {a.because}" for a in sensor_alarms(Record.from_arrays("rising", record.times, {"T": values}, unit="K"), ["T"])
        ]

    def test_a_sensor_that_is_right_says_nothing(self) -> None:
        assert self.values(lambda v: None) == []

    def test_one_that_is_off_stays_off(self) -> None:
        def off(v: np.ndarray) -> None:
            v[200:] = ICE

        assert re.search(r"^T: .* -[34]\d(\.\d+)? K .* 2000 s ", self.values(off)[0])

    def test_a_spike_comes_back(self) -> None:
        def spike(v: np.ndarray) -> None:
            v[200] += 30.0

        assert self.values(spike) == []

    def test_missing_and_stuck(self) -> None:
        def gone(v: np.ndarray) -> None:
            v[290:] = np.nan

        def stuck(v: np.ndarray) -> None:
            v[200:] = v[200]

        assert "2900 s" in self.values(gone)[0]
        assert "2000 s" in self.values(stuck)[0]


class TestConfirmation:
    """Looks come at the first reading of each minute; what one alone says is not named, what the next but one still says is."""

    @pytest.mark.parametrize(("step", "looks"), [(60.0, 2), (50.0, 2), (45.0, 2), (100.0, 1)])
    def test_a_fault_is_named_at_the_second_look_after_it_was_first_seen(self, step: float, looks: int) -> None:
        """Of readings 45 to 60 s apart two intervals are at least a minute and a half, one is not; a single one of 100 s is enough."""
        watching = SimpleNamespace(_named=False, _since=None)
        named = [
            bool(Watcher._confirmed(watching, ["leak"], SimpleNamespace(times=np.array([0.0, k * step])), []))  # type: ignore[arg-type, list-item]
            for k in range(looks + 1)
        ]
        assert named == [False] * looks + [True]


class TestStopping:
    def decided(self, record: Record, **more: Any) -> Any:
        return Stopping(RULE, more.pop("within", 1.0), more.pop("limits", ()), slowest="30 [min]", **more).decide(record, ("T",))

    def test_stop_is_right_and_leaves_the_rule_to_the_plan(self) -> None:
        advice = self.decided(rising(200), within=2.5)
        assert advice.word == "stop"
        assert advice.ends["T"].final.value == pytest.approx(ICE + 42.0, abs=2.5)
        assert re.search(r" 2\.5 K .*'3 C/h' .*min", advice.because), "the rule that is not met, and when it will be"
        assert advice.level == pytest.approx(1.0 - 0.01 / DECISIONS)

    def test_early_readings_are_declined(self) -> None:
        advice = self.decided(rising(60))
        assert advice.word == "declined"
        assert "+- 1 K" in advice.because

    def test_a_limit_on_both_sides_is_declined(self) -> None:
        limits = (TemperatureLimit("T", False, ICE + 42.0),)
        assert "T<42 degC" in self.decided(rising(200), within=2.5, limits=limits).because
        assert self.decided(rising(200), within=2.5, limits=(TemperatureLimit("T", False, ICE + 60.0),)).word == "stop"

    def test_few_readings_wait(self) -> None:
        assert self.decided(rising(20)).word == "wait"

    def test_looking_again_spends_nothing(self) -> None:
        """Between decisions the last one stands, however often one looks."""
        s = Stopping(RULE, 1.0, slowest="30 [min]")
        first = s.decide(rising(100), ("T",))
        for size in range(101, 114):
            assert s.decide(rising(size), ("T",)) is first
        assert s.decide(rising(120), ("T",)).decisions == 2

    def test_the_time_watched_doubles_between_early_decisions(self) -> None:
        """A log of a reading a second has decisions left after four hours, though it is judged from its tenth reading on."""
        s = Stopping(RULE, 1.0, slowest="30 [min]")
        at = [9.0, 15.0, 30.0, *np.arange(60.0, 4.0 * 3600.0, 60.0)]
        watched = []
        for t in at:
            short = Record.from_arrays("t", np.array([0.0, t]), {"T": np.array([ICE, ICE])}, unit="K")
            if s.due(short):
                s._watched = t
                watched.append(t)
        assert watched[:8] == [9.0, 30.0, 60.0, 120.0, 240.0, 480.0, 600.0, 720.0]
        assert len(watched) <= DECISIONS

    def test_spent_risk_stops_nothing(self) -> None:
        s = Stopping(RULE, 2.5, slowest="30 [min]")
        s.count = DECISIONS
        advice = s.decide(rising(200), ("T",))
        assert advice.word == "declined"
        assert str(DECISIONS) in advice.because

    def test_a_model_that_settles_elsewhere_declines_until_the_readings_meet_the_rule(self) -> None:
        s = Stopping(RULE, 1.0, slowest="30 [min]")
        advice = s.decide(rising(300), ("T",), {"T": ICE + 45.0})
        assert advice.word == "declined"
        assert re.search(r"^T: .* degC .* K ", advice.because)
        assert advice.ends["T"].final.value + 1.0 < ICE + 45.0
        advice = s.decide(rising(600), ("T",), {"T": ICE + 45.0})
        assert advice.word == "stop"
        assert "'s rule '3 C/h'. Where" in advice.because

    def test_a_limit_that_is_not_decided_is_no_stop_where_the_rule_is_met(self) -> None:
        s = Stopping(RULE, 1.0, (TemperatureLimit("T", False, ICE + 42.0),), slowest="30 [min]")
        assert s.decide(rising(600), ("T",), {"T": ICE + 45.0}).word == "declined"

    def test_a_doubt_withdraws_a_stop_before_the_next_decision(self) -> None:
        s = Stopping(RULE, 2.5, slowest="30 [min]")
        assert s.decide(rising(200), ("T",)).word == "stop"
        advice = s.decide(rising(201), ("T",), doubt="there is an alarm")
        assert (advice.word, advice.because, advice.decisions) == ("declined", "there is an alarm", 1)


class TestModel:
    def test_a_node_without_a_sensor_is_inside_its_band(self) -> None:
        courses = run(rig(), 2400.0, {"start": "22 [degC]"}, 10.0)
        look = Watcher(Stopping(RULE, 1.0), ("chip", "case"), rig(), scenario()).look(logged(courses, 3))
        lid = next(n for n in look.nodes if n.name == "lid")
        assert not lid.measured
        assert abs(lid.value - courses["lid"][-1]) < 2.0 * lid.half
        assert look.alarms == ()
        assert "lid (not measured)" in str(look)
        assert json.loads(json.dumps(look.as_object()))["nodes"]["lid"]["measured"] is False

    def test_a_log_that_is_judged_from_later_on_does_not_begin_at_the_start_of_its_test(self) -> None:
        courses = run(rig(), 3600.0, {"start": "22 [degC]"}, 10.0)
        log = logged(courses, 3)
        late = log.with_channels(*(replace(log[n], role="node", target=n) for n in ("chip", "case"))).trim(1200.0, "end")
        look = WatchRequest(BoundColumns(model=rig()), RULE, 1.0, since=1200.0, scenario=scenario()).watcher(late).look(late)
        lid = next(n for n in look.nodes if n.name == "lid")
        assert look.alarms == ()
        assert abs(lid.value - courses["lid"][-1]) < 0.2  # the start of the test left it 7.8 K too cold

    def test_a_stretch_without_a_valid_reading_of_a_channel_ends_no_look(self) -> None:
        courses = run(rig(), 2400.0, {"start": "22 [degC]"}, 10.0)
        record = logged(courses, 3)
        masked = np.arange(record.times.size)
        gone = record.with_channels(record["case"].masked((masked > 80) & (masked < 160), "spike"))
        look = Watcher(Stopping(RULE, 1.0), ("chip", "case"), rig(), scenario()).look(gone)
        lid = next(n for n in look.nodes if n.name == "lid")
        assert abs(lid.value - courses["lid"][-1]) < 2.0 * lid.half

    def test_suspects_are_values_of_the_deck(self) -> None:
        import thermid as td

        found = {s.whose: s.kind for s in suspect_values(td.simulation.compile_network(rig()))}
        assert found == {"pad": "joint", "screws": "joint", "fins": "air", "lid_air": "air", "heater": "power"}

    def test_an_alarm_ends_advice_to_stop(self) -> None:
        courses = run(rig(), 4800.0, {"start": "22 [degC]"}, 10.0)
        courses["case"][300:] = ICE
        look = Watcher(Stopping(RULE, 1.0), ("chip", "case"), rig(), scenario()).look(logged(courses, 3))
        assert look.alarms[0].suspect == "case"
        assert look.advice.word == "declined"
        assert str(look.alarms[0]) in look.advice.because
        assert "ALARM" in str(look)


def test_errors_are_thermids() -> None:
    with pytest.raises(ThermidError):
        Stopping(StabilityRule.named("never"), 1.0)
