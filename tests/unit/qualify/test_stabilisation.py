"""Stability of logs and runs: the slowest, what is left to go, marks."""

from __future__ import annotations

import numpy as np
import pytest

import thermid as td
from thermid.errors import RecordError

HOUR = 3600.0


def log(hours, taus=(1500.0, 5000.0)):
    rng = np.random.default_rng(3)
    times = np.arange(0.0, hours * HOUR, 10.0)
    made = {f"T{k}": 320.0 - 15.0 * np.exp(-times / tau) + 0.03 * rng.standard_normal(times.size) for k, tau in enumerate(taus, 1)}
    return td.Record.from_arrays("warm-up", times, made)


def test_the_slowest_is_named_and_decides():
    found = td.stability(log(1.8), "3 C/h")
    assert found.slowest == "T2"
    assert found.channels["T1"].verdict == "stable"
    assert found.verdict == "not stable"
    assert not found.stable


def test_what_is_left_is_rate_times_time_constant():
    found = td.stability(log(3.0), "3 C/h", ["T2"], tau="5000 [s]")
    truth = 15.0 * np.exp(-3.0 * HOUR / 5000.0)
    left = found.remaining["T2"]
    assert left.low < truth < left.high
    assert found.stable
    assert "still has 4.2 K to go" in str(found)  # 3 K/h times 1.39 h: stable by the rule, and not there yet


def test_what_is_left_by_the_readings_alone():
    truth = 15.0 * np.exp(-3.0 * HOUR / 5000.0)
    left = td.stability(log(3.0), "3 C/h", ["T2"]).remaining["T2"]
    assert left.low < truth < left.high
    assert left.basis == "by the readings alone"


def test_a_rule_from_memory_decides_nothing_and_says_so():
    found = td.stability(log(6.0), "1 K/h")
    assert found.stable
    assert not found.decides
    assert "no verdict may rest on it" in str(found)
    assert td.stability(log(6.0), "3 C/h").decides


def box():
    return td.model_from_dict(
        {
            "title": "box",
            "needs": ["air"],
            "nodes": {"plate": {"capacitance": "300 [J/K]"}, "core": {"capacitance": "900 [J/K]"}},
            "conductors": {
                "skin": {"kind": "conduction", "between": ["plate", "air"], "conductance": "0.8 [W/K]"},
                "foot": {"kind": "conduction", "between": ["plate", "core"], "conductance": "0.5 [W/K]"},
            },
            "loads": {"chips": {"into": "core", "power": "5 [W]"}},
        }
    )


def test_of_a_simulated_run():
    run = td.simulate(box(), td.Scenario("s", boundaries={"air": "20 [degC]"}, duration="3 [h]"), every=60.0)
    found = td.stability(run, "3 C/h")
    assert set(found.channels) == {"plate", "core"}
    left = found.remaining["core"]
    steady = td.steady(box(), td.Scenario("s", boundaries={"air": "20 [degC]"}))["core"]
    assert left.value == pytest.approx(steady - run["core"].kelvin[-1], rel=0.05)
    early = td.stability(run, "3 C/h", at=1200.0)
    assert early.slowest == "core"
    assert not early.stable
    assert early.as_object()["verdict"] == "not stable"


def test_of_a_profile_run_at_the_beginning_of_a_dwell():
    profile = td.profile_of("SMC-S-016", "unit thermal cycle", predicted=("-5 [degC]", "45 [degC]"), cycles=1)
    run = td.run_profile(box(), profile)
    (wait,) = [p for p in run if p.kind == "wait" and p.name == "to cold"]
    assert td.stability(run, "3 C/h", at=wait.end).channels["core"].rate == pytest.approx(wait.rate, rel=0.03)
    with pytest.raises(RecordError, match="stored heat"):
        td.stability(run, "stored 5 %")
    with pytest.raises(RecordError, match="does not hold that"):
        td.stability(run, "0.2 C/h over 5 h", at=3600.0)
