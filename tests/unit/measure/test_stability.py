"""Rules of stability and rates of noisy readings."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.base.errors import RecordError
from thermid.measure._record.channel import Channel
from thermid.measure._record.steadiness import RULES, StabilityRule

HOUR = 3600.0


def record(rate, noise=0.05, step=0.0, span=4.0, every=10.0, seed=1, name="T"):
    times = np.arange(0.0, span * HOUR, every)
    values = 300.0 + rate / HOUR * times + noise * np.random.default_rng(seed).standard_normal(times.size)
    if step:
        values = np.round(values / step) * step
    return td.Record.from_arrays("log", times, {name: Channel.from_array(name, values, unit="K", resolution=step or None)})


@pytest.mark.parametrize(
    ("text", "rate", "window", "mark"),
    [
        ("3 C/h", 3.0, 0.0, "read"),
        ("0.2 C/h over 5 h", 0.2, 5.0, "read"),
        ("1 C over 5 h", 0.2, 5.0, "read"),
        ("0.05 C/h over 6 h", 0.05, 6.0, "secondary"),
        ("1 K/h", 1.0, 0.0, "memory"),
        ("2 C/h", 2.0, 0.0, "memory"),
        ("0.5 K/h over 30 min", 0.5, 0.5, "project"),
        ("0.1 K/min", 6.0, 0.0, "project"),
    ],
)
def test_rules_by_name_and_in_words(text, rate, window, mark):
    rule = StabilityRule.named(text)
    assert (rule.rate * HOUR, rule.window / HOUR, rule.mark) == (pytest.approx(rate), pytest.approx(window), mark)


def test_rules_on_stored_heat():
    assert StabilityRule.named("stored 5 %").mark == "memory"
    assert StabilityRule.named("stored 3 %").rate == pytest.approx(0.03)
    with raises_code("record.does-not-apply", RecordError, match="'stored 5 %'"):
        StabilityRule.named("stored 5 %").of_channel(record(0.0), "T")


@pytest.mark.parametrize(
    "text", ["3 C", "fast", "0 K/h", "1 K over 0 h", "stored 0 %", "1.2.3 K/h", ". K/h", "1 K over 1.2.3 h", "stored 1.2.3 %"]
)
def test_what_is_no_rule(text):
    with raises_code("value.outside-range" if "over 0" in text else "value.wrong-kind", RecordError):
        StabilityRule.named(text)


def test_every_rule_has_a_source_and_a_mark():
    assert all(r.source and r.mark in ("read", "secondary", "memory") for r in RULES.values())


@pytest.mark.parametrize(("rate", "verdict"), [(0.0, "stable"), (2.0, "stable"), (5.0, "not stable"), (-5.0, "not stable")])
def test_verdicts_of_clear_rates(rate, verdict):
    assert StabilityRule.named("3 C/h").of_channel(record(rate), "T").verdict == verdict


def test_the_error_of_a_rate_holds_as_often_as_stated():
    rule = StabilityRule.named("1 K/h over 1 h")
    z = [(c.rate - 0.4 / HOUR) / c.error for c in (rule.of_channel(record(0.4, seed=s), "T") for s in range(200))]
    assert 0.9 <= np.mean(np.abs(z) < 2.0) <= 1.0


def test_noise_asks_for_a_longer_window_and_a_short_log_cannot_tell():
    quiet, loud = record(1.0, noise=0.01), record(1.0, noise=1.0)
    rule = StabilityRule.named("3 C/h")
    a, b = (rule.of_channel(r, "T") for r in (quiet, loud))
    assert a.verdict == b.verdict == "stable"
    assert b.end - b.start > 2.0 * (a.end - a.start)
    assert rule.of_channel(record(1.0, noise=1.0, span=0.1), "T").verdict == "cannot tell"


def test_a_window_does_not_reach_back_into_an_approach_that_is_over():
    """22 K that approach with 10 min, read each 30 s: after 65 min the rate is 0.2 K/h. A window of 32 min had 3 K/h and more."""
    settled = []
    for seed in range(20):
        log = record(0.0, every=30.0, span=65.0 / 60.0, seed=seed)
        approach = log.with_channels(replace(log["T"], values=log["T"].values - 22.0 * np.exp(-log.times / 600.0)))
        settled.append(StabilityRule.named("3 C/h").of_channel(approach, "T").verdict)
    assert settled.count("stable") >= 19


def test_a_plateau_that_is_left_early_is_not_stable():
    """20 min at rest, then 28 K down in 10 min: no line fits, and that is no noise of a rate."""
    log = record(0.0, every=30.0, span=0.5)
    left = log.with_channels(replace(log["T"], values=log["T"].values - 28.0 * np.clip(log.times / 600.0 - 2.0, 0.0, None)))
    assert StabilityRule.named("3 C/h").of_channel(left, "T").verdict == "not stable"


def test_a_coarse_sensor_that_stands_still_is_not_called_stable():
    coarse = record(1.0, noise=0.0, step=0.5, span=0.2)
    found = StabilityRule.named("0.5 K/h").of_channel(coarse, "T")
    assert found.error * HOUR > 0.5
    assert found.verdict == "cannot tell"


def test_the_step_of_a_sensor_is_seen_in_its_readings():
    r = record(1.0, noise=0.2, step=0.0625)
    bare = Channel.from_array("T", r["T"].values, unit="K")
    assert bare.step == pytest.approx(0.0625)
    assert Channel.from_array("T", np.random.default_rng(1).standard_normal(100) + 300, unit="K").step == 0.0


def test_since_when_an_approach_is_stable():
    times = np.arange(0.0, 6 * HOUR, 10.0)
    values = 320.0 - 20.0 * np.exp(-times / 2000.0) + 0.02 * np.random.default_rng(2).standard_normal(times.size)
    log = td.Record.from_arrays("log", times, {"T": values}, unit="K")
    when = 2000.0 * np.log(20.0 / 2000.0 / (3.0 / HOUR))
    assert StabilityRule.named("3 C/h").since_when(log, "T") == pytest.approx(when, abs=700.0)
    assert StabilityRule.named("3 C/h").since_when(record(5.0), "T") is None


def test_a_window_longer_than_the_log_and_a_power_are_refused():
    with raises_code("record.too-short", RecordError, match="5"):
        StabilityRule.named("0.2 C/h over 5 h").of_channel(record(0.0), "T")
    power = td.Record.from_arrays("log", np.arange(100.0), {"P": Channel.from_array("P", np.ones(100), quantity="power", role="load")})
    with raises_code("record.does-not-apply", RecordError, match="log, P: "):
        StabilityRule.named("3 C/h").of_channel(power, "P")
