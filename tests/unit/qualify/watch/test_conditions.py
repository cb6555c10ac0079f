"""Tests that go on with nothing failing: powers switched by log and plan, a logged ambient, gaps, coarse and wandering readings, spikes."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import thermid as td
from thermid.measure.records import Channel, Record, StabilityRule
from thermid.model.tree import TableSignal, model_from_dict
from thermid.qualify._watch import growing
from thermid.qualify._watch.growing import (
    after_gaps_left_out,
    block_means,
    plateau_starts,
    raw_readings,
    replayed,
    switches,
    with_smooth_powers,
    without_spikes,
)
from thermid.qualify._watch.stopping import Stopping, unlogged_ambients
from thermid.qualify._watch.watcher import Watcher, WatchLook
from unit.fit.estimation.rig import NOISE, deck_of, rig, scenario

ICE, HOURS, EVERY = 273.15, 3.0, 20.0
PLAN = {"times": ["0 [s]", "4800 [s]", "8400 [s]"], "values": ["12 [W]", "8 [W]", "0 [W]"], "hold": True, "after": "hold"}


def log_of(kind: str, every: float = EVERY) -> tuple[td.Model, td.Scenario, Record]:
    """Return model, scenario and synthetic log of a test where nothing fails."""
    r = np.random.default_rng(5)
    t = np.arange(0.0, 3600.0 * HOURS, every)
    deck = deck_of()
    if kind == "fast":
        deck["nodes"]["chip"]["capacitance"], deck["parameters"]["joint"] = "2 [J/K]", "0.3 [W/K]"
    air = 22.0 + (2.0 * np.sin(2.0 * np.pi * t / 86400.0) + 0.5 * np.sin(2.0 * np.pi * t / 3600.0)) * kind.startswith("ambient")
    switched = np.select([t < 4800.0, t < 8400.0], [12.0, 8.0], 0.0)
    watts = switched if kind in ("power", "plan", "fast") else np.full(t.size, 12.0)
    model = model_from_dict(deck)
    given: dict[str, Any] = {"boundaries": {"air": TableSignal(t, air + ICE)}, "loads": {"heater": TableSignal(t, watts, hold=True)}}
    run = td.simulate(model, td.Scenario("run", start="22 [degC]", duration=float(t[-1]), **given), times=t)
    noise, channels = 0.02 if kind == "coarse" else NOISE, {}
    for n in ("chip", "case"):
        values = run[n].kelvin + r.normal(0.0, noise, t.size)
        if kind == "coarse":
            values = np.round((values - ICE) / 0.5) * 0.5 + ICE
        if kind == "spikes":
            values[r.choice(t.size, 20, replace=False)] += r.normal(0.0, 10.0, 20)
        channels[n] = Channel.from_array(n, values, unit="K", column=n, noise=None if kind in ("coarse", "spikes") else noise)
    said = {} if kind.startswith("ambient") else {"air": "22 [degC]"}
    if not said:
        channels["air"] = Channel.from_array("air", air + ICE + r.normal(0.0, 0.05, t.size), unit="K", role="boundary", column="air")
    if kind in ("power", "fast"):
        channels["heater"] = Channel.from_array("heater", watts + r.normal(0.0, 0.02, t.size), role="load", quantity="power", column="P")
    record = Record.from_arrays("rig", t, channels)
    if kind.endswith("gap"):
        kept = (t < 4800.0) | (t > 7200.0)
        record = replace(record, times=t[kept], channels={n: c.taken(kept) for n, c in record.channels.items()})
    loads = {"heater": PLAN} if kind == "plan" else {}
    return model, td.Scenario("rig", boundaries=said, start="22 [degC]", loads=loads), record


def looks(kind: str, every: float) -> list[WatchLook]:
    """Return the looks at a test, one in so many seconds from the tenth minute on."""
    model, said, record = log_of(kind)
    twin = Watcher(Stopping(StabilityRule.named("3 C/h"), 1.0, model=model, scenario=said), ("chip", "case"), model, said)
    return [twin.look(r) for r in replayed(record, every) if r.duration >= 600.0]


LONG = [pytest.param(k, 600.0, marks=pytest.mark.campaign) for k in ("power", "plan", "fast", "ambient", "coarse", "spikes")]


@pytest.mark.parametrize(("kind", "every"), [("power", 3600.0), ("ambient with a gap", 600.0), *LONG])
def test_nothing_fails_and_nothing_is_said_to(kind: str, every: float) -> None:
    assert [a for look in looks(kind, every) for a in look.alarms] == []


def test_a_switch_withdraws_the_advice_at_once() -> None:
    model, said, record = log_of("plan")
    twin = Watcher(Stopping(StabilityRule.named("3 C/h"), 1.0, model=model, scenario=said), ("chip", "case"), model, said)
    before, at_once, after = (twin.look(record.trim(0.0, at)).advice for at in (8400.0, 8460.0, 9000.0))
    assert before.word == "stop"
    assert (at_once.word, at_once.decisions) == ("declined", 1)
    assert after.ends["case"].final.value == pytest.approx(ICE + 22.0, abs=3.0)


def test_an_ambient_that_nobody_logs_is_a_candidate() -> None:
    network = td.simulation.compile_network(rig())
    assert [(a.kind, a.path) for a in unlogged_ambients(network, ())] == [("ambient", "air")]
    assert unlogged_ambients(network, ["air"]) == ()


class TestRows:
    def record(self, watts: np.ndarray, every: float = 1.0) -> Record:
        t = every * np.arange(watts.size)
        r = np.random.default_rng(1)
        power = Channel.from_array("P", watts + r.normal(0.0, 0.02, t.size), role="load", quantity="power")
        return Record.from_arrays(
            "long", t, {"T": Channel.from_array("T", ICE + 20.0 + r.normal(0.0, 0.1, t.size), unit="K", noise=0.1), "P": power}
        )

    def test_noise_of_a_power_meter_is_no_switch(self) -> None:
        watts = np.where(np.arange(20000) < 9000, 12.0, 8.0)
        record = self.record(watts)
        assert np.flatnonzero(switches(record)).tolist() == [9000]
        assert plateau_starts(record, None).tolist() == [9000.0]
        assert growing.with_block_means(record).times.size < 5000

    def test_a_heater_that_cycles_does_not_fill_the_memory(self) -> None:
        watts = np.where(np.arange(200000) // 30 % 2 == 0, 24.0, 0.0)
        assert growing.with_block_means(self.record(watts)).times.size < growing.MAX_ROWS + growing.RAW_TIME
        assert plateau_starts(self.record(watts), None).size == 0

    def test_a_mean_has_less_noise(self) -> None:
        kept = block_means(self.record(np.full(6000, 12.0)))
        assert np.median(np.diff(kept.times)) == growing.MAX_BLOCK
        assert kept["T"].noise == pytest.approx(0.1 / 2.0**0.5, rel=0.02)

    def test_what_stays_as_it_was_read(self) -> None:
        record = self.record(np.full(6000, 12.0))
        np.testing.assert_allclose(raw_readings(growing.with_block_means(record)).times, record.times[-1201:], atol=2.0)

    def test_powers_between_switches_lose_their_noise(self) -> None:
        watts = np.where(np.arange(3000) < 1000, 12.0, 8.0)
        kept = with_smooth_powers(self.record(watts))["P"].values
        assert np.abs(kept - watts).max() < 0.015

    def test_spikes_go_and_a_step_stays(self) -> None:
        record = self.record(np.full(400, 12.0))
        values = record["T"].values.copy()
        values[100] += 5.0
        values[200:202] += [15.0, 18.0]
        values[300:] += 5.0
        made = without_spikes(record.with_channels(replace(record["T"], values=values)))
        assert np.flatnonzero(~made["T"].valid).tolist() == [100, 200, 201]

    def test_a_node_that_jumps_with_its_power_has_no_spikes(self) -> None:
        record = self.record(np.full(400, 12.0))
        values = record["T"].values + 5.0 * (np.arange(400) % 10 == 0)
        assert without_spikes(record.with_channels(replace(record["T"], values=values)))["T"].valid.all()

    def test_readings_after_a_gap_are_left_out_of_the_fit(self) -> None:
        record = self.record(np.full(4000, 12.0))
        kept = (record.times < 1000.0) | (record.times >= 2000.0)
        gap = replace(record, times=record.times[kept], channels={n: c.taken(kept) for n, c in record.channels.items()})
        left = after_gaps_left_out(gap)
        assert left["T"].valid[left.times >= 3005.0].all()
        assert not left["T"].valid[(left.times >= 2000.0) & (left.times < 2995.0)].any()
        assert after_gaps_left_out(gap.select("T")) is not left


def test_a_rig_without_noise_stated_takes_that_of_the_readings() -> None:
    model, said, record = rig(), scenario(), log_of("spikes", 10.0)[2]
    twin = Watcher(Stopping(StabilityRule.named("3 C/h"), 1.0, model=model, scenario=said), ("chip", "case"), model, said)
    look = twin.look(record.trim(0.0, 1800.0))
    assert any(re.search(r"chip 0\.05 K, case \d", a) for a in look.assumed)
