"""Stability of logs and runs: the slowest, what is left to go, marks."""

from __future__ import annotations

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.base.errors import RecordError

HOUR = 3600.0


def log(hours, taus=(1500.0, 5000.0)):
    rng = np.random.default_rng(3)
    times = np.arange(0.0, hours * HOUR, 10.0)
    made = {f"T{k}": 320.0 - 15.0 * np.exp(-times / tau) + 0.03 * rng.standard_normal(times.size) for k, tau in enumerate(taus, 1)}
    return td.Record.from_arrays("warm-up", times, made, unit="K")


def test_the_slowest_is_named_and_decides():
    found = td.bench.stability(log(1.8), "3 C/h")
    assert found.slowest == "T2"
    assert found.channels["T1"].verdict == "stable"
    assert found.verdict == "not stable"
    assert not found.stable


def test_what_is_left_is_rate_times_time_constant():
    found = td.bench.stability(log(3.0), "3 C/h", ["T2"], tau="5000 [s]")
    truth = 15.0 * np.exp(-3.0 * HOUR / 5000.0)
    left = found.remaining["T2"]
    assert left.low < truth < left.high
    assert found.stable
    # twice the standard error, of the rate and of a time constant that is good to a fifth
    rate = found.channels["T2"]
    assert left.high - left.value == pytest.approx(2.0 * np.hypot(5000.0 * rate.error, 0.2 * left.value), rel=1e-9)
    assert "4.2 K to go" in str(found)  # 3 K/h times 1.39 h: stable by the rule, and not there yet


def test_what_is_left_by_the_readings_alone():
    truth = 15.0 * np.exp(-3.0 * HOUR / 5000.0)
    left = td.bench.stability(log(3.0), "3 C/h", ["T2"]).remaining["T2"]
    assert left.low < truth < left.high
    assert left.basis != td.bench.stability(log(3.0), "3 C/h", ["T2"], tau="5000 [s]").remaining["T2"].basis


def test_a_rule_from_memory_decides_nothing_and_says_so():
    found = td.bench.stability(log(6.0), "1 K/h")
    assert found.stable
    assert not found.decides
    assert len(str(found).splitlines()) == 1 + len(str(td.bench.stability(log(6.0), "3 C/h")).splitlines()), "a line of its source"
    assert td.bench.stability(log(6.0), "3 C/h").decides


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
    found = td.bench.stability(run, "3 C/h")
    assert set(found.channels) == {"plate", "core"}
    left = found.remaining["core"]
    steady = td.steady(box(), td.Scenario("s", boundaries={"air": "20 [degC]"}))["core"]
    assert left.value == pytest.approx(steady - run["core"].kelvin[-1], rel=0.05)
    early = td.bench.stability(run, "3 C/h", at=1200.0)
    assert early.slowest == "core"
    assert not early.stable
    assert early.as_object()["verdict"] == "not stable"


def test_of_a_profile_run_at_the_beginning_of_a_dwell():
    profile = td.qualify.profile_of("SMC-S-016", "unit thermal cycle", predicted=("-5 [degC]", "45 [degC]"), cycles=1)
    run = td.qualify.run_profile(box(), profile)
    (wait,) = [p for p in run if p.kind == "wait" and p.name == "to cold"]
    assert td.bench.stability(run, "3 C/h", at=wait.end).channels["core"].rate == pytest.approx(wait.rate, rel=0.03)
    with raises_code("record.too-short", RecordError):
        td.bench.stability(run, "0.2 C/h over 5 h", at=3600.0)


COURSE = td.Scenario("s", boundaries={"air": "20 [degC]"}, duration="5 [h]")


def warming(seed=2, noise=0.02, nodes=("plate", "core")):
    """Return a run of the box and a log of it, synthetic."""
    run = td.simulate(box(), COURSE, every=10.0)
    rng = np.random.default_rng(seed)
    readings = {n: run[n].kelvin + noise * rng.standard_normal(run.times.size) for n in nodes}
    return run, td.Record.from_arrays("warm-up", run.times, readings, unit="K")


@pytest.mark.parametrize("at", [3600.0, 2.5 * HOUR, 4.0 * HOUR])
def test_heat_taken_up_by_readings_is_that_of_the_heat_balance(at):
    """What the box takes up is its power less what leaves through the skin; the readings say so within two of their errors."""
    run, record = warming()
    found = td.bench.stability(record, "stored 3 %", at=at, run=run)
    middle = 0.5 * (found.stored.start + found.stored.end)
    leaves = 0.8 * (float(run["plate"].at(middle)) - 20.0)
    assert found.stored.watts == pytest.approx(5.0 - leaves, abs=2.0 * found.stored.error)
    assert found.stored.power == pytest.approx(5.0)
    simulated = td.bench.stability(run, "stored 3 %", at=at).stored
    assert simulated.watts == pytest.approx(5.0 - 0.8 * (float(run["plate"].at(at - 30.0)) - 20.0), rel=1e-3)


def test_a_rule_on_stored_heat_is_judged_for_all_nodes_together():
    run, record = warming()
    early, late = (td.bench.stability(record, "stored 3 %", at=at, run=run) for at in (3600.0, 4.5 * HOUR))
    assert (early.verdict, late.verdict) == ("not stable", "stable")
    assert "'core'" in str(early)
    assert early.as_object()["stored"]["power_W"] == pytest.approx(5.0)
    assert td.bench.stability(record, "stored 2 %", at=4.5 * HOUR, run=run).decides is False  # that number is from memory
    loud = warming(noise=3.0)[1]
    assert td.bench.stability(loud, "stored 3 %", since=4.4 * HOUR, run=run).verdict == "cannot tell"


def test_a_rule_on_stored_heat_is_refused_with_the_reason():
    run, record = warming()
    with raises_code("record.does-not-apply", RecordError, match="'stored 3 %'"):
        td.bench.stability(record, "stored 3 %")
    with raises_code("record.does-not-apply", RecordError, match=r"'plate'.*\(25"):
        td.bench.stability(warming(nodes=("core",))[1], "stored 3 %", run=run)
    off = td.simulate(box(), COURSE.with_(loads={"chips": "0 [W]"}), every=60.0)
    with raises_code("record.does-not-apply", RecordError):
        td.bench.stability(record, "stored 3 %", run=off)
