"""Powers that act later than they were logged: the delay stated, or found by the fit."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.base.errors import RecordError, ThermidError, code_of
from thermid.fit._search import widened_by_noise_of_powers
from thermid.model.tree import TableSignal
from unit.fit.test_clocks import AIR, BOX, FREE

TIMES = np.arange(0.0, 1801.0, 5.0)
SWITCHES = np.array([100.0, 503.0, 702.0, 1101.0])
LEVELS = np.array([3.0, 20.0, 3.0, 12.0, 3.0])
CAMPAIGN = """
title = "late"

[records.bench]
file     = "bench.csv"
channels = { T = { node = "case", noise = "0.05 [K]" }, P = { load = "heat" } }
prepare  = [{ delay = { by = ["0 [s]", "1 [min]"] } }]

[[stages]]
name     = "box"
model    = "box.toml"
records  = ["bench"]
free     = ["case.capacitance", "out.conductance"]
scenario = { boundaries = { air = "20 [degC]" }, start = "20 [degC]" }
"""


def power(times: np.ndarray) -> np.ndarray:
    return LEVELS[np.searchsorted(SWITCHES, times, side="right")]


def late(delay: float, seed: int = 3) -> td.Record:
    """A synthetic log whose power acts some seconds after it was logged."""
    instants = np.r_[0.0, np.repeat(SWITCHES + delay, 2) + np.tile([-1e-6, 0.0], 4), TIMES[-1]]
    act = (instants, np.repeat(LEVELS, 2))
    made = td.Scenario("s", {"air": "20 [degC]"}, {"heat": act}, start="20 [degC]", duration=float(TIMES[-1]))
    readings = td.simulate(BOX, made, times=TIMES)["case"].kelvin + 0.05 * np.random.default_rng(seed).standard_normal(TIMES.size)
    channels = {
        "T": td.Channel.from_array("T", readings, unit="K", role="node", target="case", noise=0.05),
        "P": td.Channel.from_array("P", power(TIMES), quantity="power", role="load", target="heat"),
    }
    return td.Record.from_arrays("bench", TIMES, channels)


def delay_of(found: td.Calibration):
    return next(one for one in found.local if one.name == "delay")


@pytest.mark.parametrize("delay", [7.3, 33.3])
def test_a_delay_is_found(delay: float) -> None:
    found = td.calibrate(BOX, late(delay).delayed(("0 [s]", "1 [min]")), FREE, scenario=AIR)
    one = delay_of(found)
    assert one.value == pytest.approx(delay, abs=2.5 * one.error)
    assert 0.2 < one.error < 2.5  # four changes, each known to 5 s over the root of 12
    assert found["case.capacitance"].value == pytest.approx(300.0, abs=3.0 * found["case.capacitance"].error)
    assert found["out.conductance"].value == pytest.approx(0.5, abs=3.0 * found["out.conductance"].error)


def test_a_stated_delay_is_that_shift_of_the_power() -> None:
    record = late(10.0)
    same = td.Record.from_arrays(
        "bench",
        TIMES,
        dict(record.channels) | {"P": td.Channel.from_array("P", power(TIMES - 10.0), quantity="power", role="load", target="heat")},
    )
    one, other = (td.calibrate(BOX, r, FREE, scenario=AIR) for r in (record.delayed(10.0), same))
    for name in FREE:
        assert one[name].value == pytest.approx(other[name].value, rel=1e-6)  # tolerance of the solver
    assert record.delayed(10.0).steps[-1] == "delay: P, 10 s"
    assert re.search(r" 10 s: ", str(one))


def test_a_delay_that_is_no_multiple_of_the_step_makes_no_double_times() -> None:
    fine = td.Record.from_arrays("fine", 0.1 * np.arange(200), dict(late(0.0).trim(0, 995.0).channels))
    moved = fine.delayed(0.3)
    assert moved.times.size == 203
    assert np.diff(moved.times).min() > 0.09


def test_a_campaign_finds_a_delay(tmp_path: Path) -> None:
    late(21.0).to_csv(tmp_path / "bench.csv")
    td.save_model(BOX, tmp_path / "box.toml")
    (tmp_path / "late.toml").write_text(CAMPAIGN)
    found = td.run_stages(tmp_path / "late.toml")["box"]
    assert delay_of(found).value == pytest.approx(21.0, abs=2.5 * delay_of(found).error)


@pytest.mark.parametrize(
    ("by", "channels", "code", "data"),
    [
        (5.0, ["T"], "record.does-not-apply", "'T'"),
        (5.0, [], "record.does-not-apply", ""),
        ((5.0, 2.0), None, "value.outside-range", "5 .. 2"),
        ((1.0, 2.0, 3.0), None, "value.wrong-kind", "3"),
        ("1 [h]", None, "record.too-short", "up to 3600 s"),
        (5.0, ["Q"], "name.unknown", ""),
    ],
)
def test_what_cannot_be_delayed(by, channels, code: str, data: str) -> None:
    with pytest.raises(ThermidError) as refused:
        late(0.0).delayed(by, channels)
    assert code_of(str(refused.value)) == code
    assert data in str(refused.value)


def test_only_one_clock_is_left_to_the_fit() -> None:
    with raises_code("record.second-clock", RecordError):
        late(0.0).delayed((0.0, 60.0)).delayed((0.0, 60.0))


@pytest.mark.campaign
def test_intervals_of_delays_hold() -> None:
    rng = np.random.default_rng(21)
    inside = 0
    for seed in range(200):
        delay = rng.uniform(5.0, 55.0)
        one = delay_of(td.calibrate(BOX, late(delay, seed).delayed((0.0, 60.0)), FREE, scenario=AIR))
        inside += abs(one.value - delay) < 1.96 * one.error
    assert inside >= 181  # 99 % binomial range about 95 % of 200, below


def test_a_signal_stays_at_its_mean_between_its_changes() -> None:
    noisy = TableSignal(np.arange(7.0), np.array([1.0, 1.2, 0.8, 5.0, 5.2, 3.9, 4.1]), True)
    assert noisy.levelled(1.1).values == pytest.approx([1.0, 1.0, 1.0, 5.1, 5.1, 4.0, 4.0])
    assert noisy.levelled(10.0).values == pytest.approx(np.full(7, noisy.values.mean()))


def test_noise_of_the_power_is_no_information_of_its_delay() -> None:
    """The derivative by a delay moves the noise along; the sum of squares does not curve by it, see decision 237."""
    record = late(21.0)
    noise = 0.1 * np.ptp(LEVELS) * np.random.default_rng(8).standard_normal(TIMES.size)
    noisy = replace(record["P"], values=record["P"].values + noise)
    found = td.calibrate(BOX, record.with_channels(noisy).delayed(("0 [s]", "1 [min]")), FREE, scenario=AIR, search="local")
    one = delay_of(found)
    assert one.value == pytest.approx(21.0, abs=2.5 * one.error)
    at = np.array([found.fitted[u.name] for u in found.problem.unknowns])
    wider = dict(zip([u.name for u in found.problem.unknowns], widened_by_noise_of_powers(found.problem, at), strict=True))
    assert 1.1 < wider.pop("bench: delay") < 5.0
    assert set(wider.values()) == {1.0}
