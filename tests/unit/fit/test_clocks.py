"""Two logs on two clocks: joined, and their clocks found by a model."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.app.cli.summary import show_campaign
from thermid.base.errors import DeckError, RecordError
from thermid.fit._problem.gather import build_problem
from thermid.fit._problem.request import Request
from thermid.fit.calibration import blame_of
from thermid.model.tree import TableSignal

pytestmark = pytest.mark.usefixtures("errors_in_turn")

DECK = {
    "title": "Box",
    "needs": ["air"],
    "nodes": {"case": {"capacitance": "300 [J/K]"}},
    "conductors": {"out": {"kind": "conduction", "between": ["case", "air"], "conductance": "0.5 [W/K]"}},
    "loads": {"heat": {"into": "case", "power": "10 [W]"}},
}
BOX = td.model_from_dict(DECK)
SLOW = np.arange(0.0, 1801.0, 5.0)
FAST = np.arange(0.0, 1201.0, 2.0)
POWER = np.where((FAST > 100) & (FAST < 500), 20.0, np.where((FAST > 700) & (FAST < 1100), 12.0, 0.0))
CAMPAIGN = """
title = "clocks"

[records.bench]
file     = "bench.csv"
channels = { T = { node = "case", noise = "0.05 [K]" } }
joined   = { record = "meter", offset = ["0 [s]", "5 [min]"], rate = [0.9, 1.2] }

[records.meter]
file     = "meter.csv"
channels = { P = { load = "heat", prompt = true } }

[[stages]]
name     = "box"
model    = "box.toml"
records  = ["bench"]
free     = ["case.capacitance", "out.conductance"]
scenario = { boundaries = { air = "20 [degC]" }, start = "20 [degC]" }
"""
AIR = td.Scenario("s", {"air": "20 [degC]"}, start="20 [degC]")


def logs(offset: float, rate: float) -> tuple[td.Record, td.Record]:
    """Return temperatures, and powers on a clock that runs otherwise."""
    there = offset + rate * FAST
    power = (np.concatenate([[0.0], there, [SLOW[-1]]]), np.concatenate([[0.0], POWER, [0.0]]))
    made = td.Scenario("s", {"air": "20 [degC]"}, {"heat": power}, start="20 [degC]", duration=float(SLOW[-1]))
    readings = td.simulate(BOX, made, times=SLOW)["case"].kelvin + 0.05 * np.random.default_rng(3).standard_normal(SLOW.size)
    first = td.Record.from_arrays(
        "bench", SLOW, {"T": td.Channel.from_array("T", readings, unit="K", role="node", target="case", noise=0.05)}
    )
    second = td.Record.from_arrays("meter", FAST, {"P": td.Channel.from_array("P", POWER, quantity="power", role="load", target="heat")})
    return first, second


def clock_of(first: td.Record, second: td.Record, rate: tuple[float, float] = (0.9, 1.2)) -> dict[str, td.fit.calibration.Local]:
    """Return offset and rate that a fit finds with the model's values held."""
    fit = td.calibrate(BOX, first.joined(second, (0.0, 300.0), rate), [], scenario=AIR)
    return {i.name.removeprefix("clock "): i for i in fit.local}


def test_offset_and_rate_come_back_with_the_values_held() -> None:
    # powers that changed somewhere between two samples: in the middle of an interval of 2 s, where these ramps have their mean
    first, second = logs(130.0, 1.08)
    found = clock_of(first, second.with_channels(replace(second["P"], prompt=False)))
    assert found["offset"].value == pytest.approx(130.0, abs=0.5)
    assert found["rate"].value == pytest.approx(1.08, abs=0.0007)
    # one change is known to 2 s over the root of 12; four of them tell offset and rate
    assert 0.3 < found["offset"].error < 1.2
    assert 5e-4 < found["rate"].error < 2e-3


def test_a_record_that_is_cut_or_begun_anew_keeps_its_further_clocks() -> None:
    """Trimmed, "the model fails at every offset"; begun anew, the range of the offset counted from the old zero."""
    first, second = logs(130.0, 1.0)
    joint = first.joined(second, (0.0, 300.0))
    cut = joint.trim("100 [s]", f"{SLOW[-1] - 60.0} [s]")
    found = [td.calibrate(BOX, record, [], scenario=AIR).local[-1] for record in (cut, cut.shift_start())]
    assert [local.name for local in found] == ["clock offset"] * 2
    assert [found[0].value, found[1].value + cut.times[0]] == pytest.approx([130.0, 130.0], abs=2.0)


def test_a_constant_error_of_the_sensor_is_not_taken_for_a_clock() -> None:
    first, second = logs(130.0, 1.08)
    off = first.with_channels(replace(first["T"], values=first["T"].values + 0.5, accuracy=0.5))
    plain, found = clock_of(first, second), clock_of(off, second)
    assert found["offset"].value == pytest.approx(plain["offset"].value, abs=0.4)


def test_compared_temperatures_of_the_second_log_join_at_the_clock_that_a_fit_found() -> None:
    rng, (_, second) = np.random.default_rng(5), stepped(130.0, 1.08, np.zeros(4), seed=1)
    done, there = switched(130.0, 1.08, np.zeros(4)), 130.0 + 1.08 * second.times
    noisy = {
        node: td.simulate(PAIR, done, times=times)[node].kelvin + 0.05 * rng.standard_normal(times.size)
        for node, times in (("case", SLOW), ("lid", there))
    }
    first = td.Record.from_arrays(
        "bench", SLOW, {"T": td.Channel.from_array("T", noisy["case"], unit="K", role="node", target="case", noise=0.05)}
    )
    beside = td.Channel.from_array("S", noisy["lid"], unit="K", role="node", target="lid", noise=0.05)
    clock = {i.name: i for i in td.calibrate(PAIR, first.joined(second, (0.0, 300.0), (0.9, 1.2)), [], scenario=AIR).local}
    offset, rate = clock["clock offset"], clock["clock rate"]
    assert abs(offset.value - 130.0) < 2.0 * offset.error < 0.8
    assert abs(rate.value - 1.08) < 2.0 * rate.error
    whole = first.joined(second.with_channels(beside), offset.value, rate.value)
    found = td.calibrate(PAIR, whole, [], scenario=AIR).sensors
    assert {n: s.rmse for n, s in found.items()} == pytest.approx({"T": 0.05, "S": 0.05}, rel=0.2)


SWITCHES = ((110.0, 20.0), (500.0, 0.0), (700.0, 12.0), (1100.0, 0.0))
GRID = 10.0


def switched(offset: float, rate: float, phases: np.ndarray) -> td.Scenario:
    """Return what was done: powers that changed so long after the samples of a meter. [s]"""
    times = [0.0, *(offset + rate * (t + p) for (t, _), p in zip(SWITCHES, phases, strict=True)), 2 * SLOW[-1]]
    power = TableSignal(np.array(times), np.array([0.0, *(w for _, w in SWITCHES), 0.0]), hold=True)
    return td.Scenario("s", {"air": "20 [degC]"}, {"heat": power}, start="20 [degC]", duration=float(SLOW[-1]))


def stepped(
    offset: float, rate: float, phases: np.ndarray, seed: int, wander: float = 0.0, stated: bool = True
) -> tuple[td.Record, td.Record]:
    """Return temperatures, and the log of a meter every 10 s, with a row at each change or none."""
    rng = np.random.default_rng(seed)
    noise, slow, keep = 0.05 * rng.standard_normal(SLOW.size), 0.0, np.exp(-5.0 / 60.0)
    for k in range(SLOW.size if wander else 0):
        slow = keep * slow + wander * np.sqrt(1.0 - keep**2 if k else 1.0) * rng.standard_normal()
        noise[k] += slow
    readings = td.simulate(BOX, switched(offset, rate, phases), times=SLOW)["case"].kelvin + noise
    when = np.array([t + p for (t, _), p in zip(SWITCHES, phases, strict=True)])
    meter = np.arange(0.0, 1201.0, GRID)
    meter = np.union1d(meter, when) if stated else meter
    power = np.array([0.0, *(w for _, w in SWITCHES)])[np.searchsorted(when, meter, side="right")]
    first = td.Record.from_arrays(
        "bench", SLOW, {"T": td.Channel.from_array("T", readings, unit="K", role="node", target="case", noise=0.05)}
    )
    of = td.Channel.from_array("P", power, quantity="power", role="load", target="heat", prompt=stated)
    return first, td.Record.from_arrays("meter", meter, {"P": of})


def test_the_moment_of_a_change_is_worth_what_the_log_says_of_it() -> None:
    phases = np.array([3.0, 8.0, 1.0, 6.0])
    errors = []
    for stated in (True, False):
        found = clock_of(*stepped(130.0, 1.08, phases, 2, stated=stated))
        assert abs(found["offset"].value - 130.0) < 2.0 * found["offset"].error
        assert abs(found["rate"].value - 1.08) < 2.0 * found["rate"].error
        errors.append(found["offset"].error)
    assert errors[0] < 0.3  # 20 W into 300 J/K warm it by 0.07 K/s, and a reading is good to 0.05 K
    assert 1.0 < errors[1] < 6.0  # 10 s over the root of 12 is 3 s for one change


@pytest.mark.campaign
@pytest.mark.parametrize(("stated", "wander"), [(True, 0.0), (False, 0.0), (True, 0.05)])
def test_errors_of_a_clock_hold_the_truth_with_the_values_held(stated: bool, wander: float) -> None:
    pulls = []
    for seed in range(60):
        rng = np.random.default_rng(1000 + seed)
        offset, rate, phases = rng.uniform(80.0, 200.0), rng.uniform(0.95, 1.1), rng.uniform(0.0, GRID, 4)
        given = stepped(offset, rate, phases, seed, wander, stated)
        found = clock_of(*given)
        pulls.append([(found[n].value - truth) / found[n].error for n, truth in (("offset", offset), ("rate", rate))])
    mean, inside, square = np.mean(pulls, axis=0), np.mean(np.abs(pulls) < 2.0, axis=0), np.mean(np.square(pulls), axis=0)
    print(f"stated {stated}, wandering {wander:g} K: mean pull {mean}, mean square {square}, within two errors {inside}")
    assert (np.abs(mean) < 3.0 / np.sqrt(60.0)).all()
    assert (inside > 0.86).all()  # three standard deviations of chance below 95 % of 60
    assert (square > 0.5).all()


def test_joined_records_keep_every_sample() -> None:
    first, second = logs(130.0, 1.0)
    both = first.joined(second, 130.0, 1.0)
    assert both["T"].valid.sum() == SLOW.size
    assert both["P"].valid.sum() == FAST.size
    at = both.times[both["P"].valid]
    assert at == pytest.approx(130.0 + FAST)
    assert both["P"].values[both["P"].valid] == pytest.approx(POWER)
    assert both.origin.sha256 not in (first.origin.sha256, second.origin.sha256)
    assert "130 s" in both.steps[-1]


def test_records_that_cannot_be_joined() -> None:
    first, second = logs(130.0, 1.0)
    with raises_code("value.outside-range", RecordError):
        first.joined(second, 0.0, 0.0)
    with raises_code("record.name-twice", RecordError, match="'T'"):
        first.joined(first)
    with raises_code("record.not-overlapping", RecordError):
        first.joined(second, 5000.0)


def held(offset: float, rate: float, seed: int = 3) -> tuple[td.Record, td.Record]:
    """Return the same logs where the meter has a sample at every change, and its readings hold until the next one."""
    first, second = logs(offset, rate)
    second = second.with_channels(replace(second["P"], prompt=True))
    power = TableSignal(offset + rate * FAST, POWER, hold=True, before="hold")
    made = td.Scenario("s", {"air": "20 [degC]"}, {"heat": power}, start="20 [degC]", duration=float(SLOW[-1]))
    noise = 0.05 * np.random.default_rng(seed).standard_normal(SLOW.size)
    read = first.channels["T"]
    return first.with_channels(replace(read, values=td.simulate(BOX, made, times=SLOW)["case"].kelvin + noise)), second


def open_clock(offset: float, rate: float, seed: int = 3) -> td.Record:
    first, second = held(offset, rate, seed)
    return first.joined(second, (0.0, 300.0), (0.9, 1.2))


FREE = ["case.capacitance", "out.conductance"]


@pytest.mark.usefixtures("errors_in_full_here")
def test_a_fit_finds_a_clock_beside_its_values() -> None:
    fit = td.calibrate(BOX, open_clock(130.0, 1.08), FREE, scenario=AIR)
    clock = {i.name: i for i in fit.local}
    for name, truth, sure in (("clock offset", 130.0, 0.3), ("clock rate", 1.08, 6e-4)):
        assert abs(clock[name].value - truth) < 3.0 * clock[name].error
        assert 0.0 < clock[name].error < sure
    for path, truth in zip(FREE, (300.0, 0.5), strict=True):
        assert abs(fit[path].value - truth) < 3.0 * fit[path].error
    assert fit.sensors["T"].rmse < 0.055
    assert "bench: clock offset 130." in str(fit)
    assert fit.request is not None
    assert "by the fit" in fit.request.records[0].steps[-1]
    # the errors of the values count that the clock is not known
    known = td.calibrate(BOX, held(130.0, 1.08)[0].joined(held(130.0, 1.08)[1], 130.0, 1.08), FREE, scenario=AIR)
    assert fit["case.capacitance"].error > 1.05 * known["case.capacitance"].error
    # where a fit is not credible, an offset that was stated is one of the things to doubt
    assert len(blame_of(known.experiments)) > len(blame_of(fit.experiments))
    # what is asked of the fit afterwards is what it says with the clock known
    hot = td.Scenario("hot", boundaries={"air": "40 [degC]"}, start="air", duration="30 [min]")
    one, other = (td.predict(f, hot)["case"].final for f in (fit, known))
    # centres move with the mean of what elements depart by: by what an open clock leaves, a part of the standard error
    assert abs(one.celsius - other.celsius) < 0.3 * other.error
    assert 0.9 * other.error < one.error < 2.0 * other.error  # it counts that the clock is not known


def offsets_of_a_sampled_power(seeds: int, sampled: bool, prompt: bool | None, changes: int = 4) -> tuple[np.ndarray, np.ndarray]:
    """Return errors of offsets, found less true, and their standard errors (seeds,): changes at samples every 10 s or before these. [s]"""
    out = []
    for seed in range(seeds):
        rng = np.random.default_rng(seed)
        rows = GRID * np.floor(np.linspace(120.0, 1000.0, changes) / GRID + rng.uniform(0.0, 3.0, changes))
        ends, offset = rows - GRID * rng.uniform(0.0, 1.0, changes) * sampled, 40.0 + rng.uniform(-3.0, 3.0)
        watts = np.where(np.arange(changes) % 2 == 0, rng.uniform(8.0, 20.0, changes), 0.0)
        power = TableSignal(np.array([0.0, *(offset + ends)]), np.array([0.0, *watts]), hold=True, before="hold")
        made = AIR.with_(loads={"heat": power}, duration=float(SLOW[-1]))
        read = td.simulate(BOX, made, times=SLOW)["case"].kelvin + 0.05 * rng.standard_normal(SLOW.size)
        meter = np.arange(-60.0, 1740.0, GRID)
        shown = np.array([0.0, *watts])[np.searchsorted(rows, meter, side="right")]
        driving = td.Channel.from_array("P", shown, quantity="power", role="load", target="heat", prompt=prompt)
        second = td.Record.from_arrays("meter", meter, {"P": driving})
        first, _ = logs(130.0, 1.0)
        joined = first.with_channels(replace(first["T"], values=read)).joined(second, (0.0, 100.0))
        (clock,) = td.calibrate(BOX, joined, FREE, scenario=AIR).local
        out.append((clock.value - offset, clock.error))
    return tuple(np.transpose(out))


def test_an_offset_counts_that_nobody_said_whether_powers_were_logged_as_they_changed() -> None:
    """45.4 +- 0.5 s was found for 40 s where the meter had a row at every change: half an interval of 10 s, without a word."""
    off, error = offsets_of_a_sampled_power(2, sampled=False, prompt=None)
    assert np.all(np.abs(off) < 1.5 * error)
    assert np.all((error > 2.0) & (error < 4.0))  # a quarter of 10 s is what all changes have in common
    off, error = offsets_of_a_sampled_power(1, sampled=False, prompt=True)
    assert abs(off[0]) < 3.0 * error[0] < 0.9


@pytest.mark.campaign
@pytest.mark.parametrize("changes", [4, 24])
@pytest.mark.parametrize(("sampled", "prompt"), [(False, None), (True, None), (False, True), (True, False)])
def test_errors_of_an_offset_hold_whatever_is_said_of_its_powers(sampled: bool, prompt: bool | None, changes: int) -> None:
    off, error = offsets_of_a_sampled_power(30, sampled, prompt, changes)
    print(f"mean {off.mean():.2f}, RMS {np.sqrt(np.mean(off**2)):.2f}, stated {error.mean():.2f} s")
    assert np.mean(np.abs(off) < 2.0 * error) > 0.83  # three standard deviations of chance below 95 % of 30


def test_a_sampled_power_changed_somewhere_in_the_interval_before() -> None:
    """Offsets from a meter that samples every 40 s do not lean by half of that, and their errors say how little it tells."""
    scores = []
    for seed in range(6):
        rng = np.random.default_rng(seed)
        first, _ = logs(130.0, 1.0)
        ends = 130.0 + np.array([100.0, 500.0, 700.0, 1100.0]) + rng.uniform(0.0, 40.0, 4)
        power = TableSignal(np.array([0.0, *ends]), np.array([0.0, 20.0, 0.0, 12.0, 0.0]), hold=True, before="hold")
        made = td.Scenario("s", {"air": "20 [degC]"}, {"heat": power}, start="20 [degC]", duration=float(SLOW[-1]))
        read = td.simulate(BOX, made, times=SLOW)["case"].kelvin + 0.05 * rng.standard_normal(SLOW.size)
        coarse = np.arange(-140.0, 1700.0, 40.0)
        meter = td.Channel.from_array("P", power.at(np.maximum(coarse + 130.0, 0.0)), quantity="power", role="load", target="heat")
        second = td.Record.from_arrays("meter", coarse, {"P": meter})
        joined = first.with_channels(replace(first["T"], values=read)).joined(second, (0.0, 300.0))
        (clock,) = td.calibrate(BOX, joined, FREE, scenario=AIR).local
        assert 2.0 < clock.error < 40.0 / np.sqrt(12.0)
        scores.append((clock.value - 130.0) / clock.error)
    assert abs(np.mean(scores)) < 1.3  # half the interval would be three errors
    assert np.abs(scores).max() < 3.5


def test_a_meter_with_two_samples_at_every_change_tells_its_moment() -> None:
    """A sample was moved by a share of the usual interval, here past its neighbour, and the fit ended in an error."""
    first, _ = logs(130.0, 1.0)
    ends = np.array([100.0, 500.0, 700.0, 1100.0])
    own = TableSignal(np.array([0.0, *ends]), np.array([0.0, 20.0, 0.0, 12.0, 0.0]), hold=True, before="hold")
    made = AIR.with_(loads={"heat": replace(own, times=own.times + 130.0)}, duration=float(SLOW[-1]))
    read = td.simulate(BOX, made, times=SLOW)["case"].kelvin + 0.05 * np.random.default_rng(4).standard_normal(SLOW.size)
    uneven = np.unique(np.concatenate([np.arange(-140.0, 1700.0, 90.0), ends - 1.0, ends + 1.0]))
    meter = td.Channel.from_array("P", own.at(np.maximum(uneven, 0.0)), quantity="power", role="load", target="heat")
    second = td.Record.from_arrays("meter", uneven, {"P": meter})
    joined = first.with_channels(replace(first["T"], values=read)).joined(second, (0.0, 300.0))
    (clock,) = td.calibrate(BOX, joined, FREE, scenario=AIR).local
    assert abs(clock.value - 130.0) < 3.0 * clock.error < 3.0


def test_a_fast_mass_does_not_hide_that_the_moments_of_changes_are_unknown() -> None:
    """Four changes, each somewhere in 40 s, leave an offset at least 40 s / (12 x 4)^(1/2) uncertain, however exact the readings are."""
    times, coarse = np.arange(0.0, 5000.0, 5.0), np.arange(-140.0, 5000.0, 40.0)
    fast = td.model_from_dict({**DECK, "nodes": {"case": {"capacitance": "8 [J/K]"}}})
    changes = np.array([0.0, *(130.0 + 2.7 * np.array([117.0, 503.0, 731.0, 1109.0]))])
    power = TableSignal(changes, np.array([0.0, 20.0, 0.0, 12.0, 0.0]), hold=True, before="hold")
    made = AIR.with_(loads={"heat": power}, duration=float(times[-1]))
    read = td.simulate(fast, made, times=times)["case"].kelvin + 0.05 * np.random.default_rng(2).standard_normal(times.size)
    thermometer = td.Channel.from_array("T", read, unit="K", role="node", target="case", noise=0.05)
    meter = td.Channel.from_array("P", power.at(np.maximum(coarse + 130.0, 0.0)), quantity="power", role="load", target="heat")
    first, second = (td.Record.from_arrays(n, t, {c.name: c}) for n, t, c in (("bench", times, thermometer), ("meter", coarse, meter)))
    (clock,) = (i for i in td.calibrate(fast, first.joined(second, (60.0, 200.0)), FREE, scenario=AIR).local if i.unit == "s")
    assert clock.error > 0.97 * 40.0 / np.sqrt(12.0 * 4.0)
    assert abs(clock.value - 130.0) < 2.5 * clock.error


def test_a_held_rate_and_a_robust_loss() -> None:
    first, second = held(130.0, 1.0)
    readings = first.channels["T"]
    wild = readings.values.copy()
    wild[::40] += 30.0
    record = first.with_channels(replace(readings, values=wild)).joined(second, (0.0, 300.0))
    fit = td.calibrate(BOX, record, FREE, scenario=AIR, loss="cauchy")
    (clock,) = fit.local
    assert abs(clock.value - 130.0) < max(3.0 * clock.error, 1.0)
    assert fit["out.conductance"].value == pytest.approx(0.5, rel=0.005)


def test_errors_of_powers_that_are_held_do_not_change_which_instants_are_open() -> None:
    """Of more changes than have an instant of their own: a verdict asked for one that its bands did not have, and ended in a KeyError."""
    model = td.model_from_dict({**DECK, "loads": {n: {"into": "case", "power": "10 [W]"} for n in ("heat", "more")}})
    on = 10.0 * (np.arange(FAST.size) // 2 % 2)
    powers = {
        n: td.Channel.from_array(n, on, quantity="power", role="load", target=n, accuracy=0.1, prompt=False) for n in ("heat", "more")
    }
    joint = logs(130.0, 1.0)[0].joined(td.Record.from_arrays("meter", FAST, powers), (0.0, 300.0))
    held = (None, {"heat": -0.05, "more": 0.05}, {"heat": 0.05, "more": -0.05})
    names = [
        {u.name for u in build_problem(Request(model, (joint,), (), {"*": AIR}, held_errors=h)).unknowns if "switch" in u.name}
        for h in held
    ]
    assert len(names[0]) == 201  # what all have in common is one more
    assert names[0] == names[1] == names[2]


def test_a_verdict_finds_the_clock_of_its_record() -> None:
    fit = td.calibrate(BOX, open_clock(130.0, 1.08), FREE, scenario=AIR)
    verdict = td.validate(fit, open_clock(60.0, 1.0, seed=5), td.Criteria(rmse="0.1 [K]"), scenario=AIR)
    assert verdict.passed
    assert verdict.fitted_locally == ("clock offset", "clock rate")
    assert verdict.prediction.local[0].value == pytest.approx(60.0, abs=1.0)


def test_derivatives_of_a_clock_are_those_of_the_residuals() -> None:
    request = Request(BOX, (open_clock(130.0, 1.08),), ("out.conductance",), {"*": AIR})
    problem = build_problem(request)
    at = np.array([u.to_fitted(u.start) for u in problem.unknowns])
    found = problem.compressed(at)
    # rows and slopes hold all that the full residuals say
    full, slopes = problem.residuals(at), problem.jacobian(at)
    assert found.rows @ found.rows == pytest.approx(full @ full)
    assert found.slopes.T @ found.slopes == pytest.approx(slopes.T @ slopes, rel=1e-6)
    assert found.slopes.T @ found.rows == pytest.approx(slopes.T @ full, rel=1e-5)
    step = np.zeros(at.size)
    step[1] = 0.5
    # a reading at the instant of a change has two derivatives, before it and after
    changes = 150.0 + 1.05 * FAST[1:][np.diff(POWER) != 0.0]
    apart = np.abs(SLOW[:, None] - changes).min(axis=1) > 0.5
    difference = problem.residuals(at + step) - problem.residuals(at - step)
    assert difference[apart] == pytest.approx(slopes[apart, 1], abs=0.02 * np.abs(slopes[:, 1]).max())


PAIR = td.model_from_dict(
    {
        "title": "Box with a lid",
        "needs": ["air"],
        "nodes": {"case": {"capacitance": "300 [J/K]"}, "lid": {"capacitance": "100 [J/K]"}},
        "conductors": {
            "out": {"kind": "conduction", "between": ["case", "air"], "conductance": "0.5 [W/K]"},
            "up": {"kind": "conduction", "between": ["case", "lid"], "conductance": "1 [W/K]"},
        },
        "loads": {"heat": {"into": "case", "power": "10 [W]"}},
    }
)


def three_logs(meter_late: float, lid_late: float) -> list[td.Record]:
    """Return temperatures of the box, those of its lid and powers, each on a clock of its own."""
    rng, (_, meter) = np.random.default_rng(5), held(meter_late, 1.0)
    power = TableSignal(meter_late + FAST, POWER, hold=True, before="hold")
    made = td.Scenario("s", {"air": "20 [degC]"}, {"heat": power}, start="20 [degC]", duration=float(SLOW[-1]))
    logs = []
    for name, node, times, late in (("T", "case", SLOW, 0.0), ("S", "lid", np.arange(0.0, 1750.0, 7.0), lid_late)):
        readings = td.simulate(PAIR, made, times=times + late)[node].kelvin + 0.05 * rng.standard_normal(times.size)
        channel = td.Channel.from_array(name, readings, unit="K", role="node", target=node, noise=0.05)
        logs.append(td.Record.from_arrays(f"log_{node}", times, {name: channel}))
    return [*logs, meter]


def test_a_fit_finds_the_clocks_of_several_logs_also_one_of_compared_temperatures() -> None:
    case, lid, meter = three_logs(130.0, 37.0)
    open_record = case.joined(lid, (-100.0, 100.0)).joined(meter, (0.0, 300.0))
    fit = td.calibrate(PAIR, open_record, ["case.capacitance", "up.conductance"], scenario=AIR)
    clocks = {i.name: i for i in fit.local}
    assert sorted(clocks) == ["clock offset of log_lid", "clock offset of meter"]
    for name, truth in (("clock offset of log_lid", 37.0), ("clock offset of meter", 130.0)):
        assert abs(clocks[name].value - truth) < 3.0 * clocks[name].error < 6.0
    assert {n: s.rmse for n, s in fit.sensors.items()} == pytest.approx({"T": 0.05, "S": 0.05}, rel=0.1)
    for path, truth in (("case.capacitance", 300.0), ("up.conductance", 1.0)):
        assert abs(fit[path].value - truth) < 3.0 * fit[path].error < 0.1 * truth
    # the same where the power is on the clock of the record, and one log has all of the temperatures
    other = td.calibrate(BOX, held(130.0, 1.0)[1].joined(held(130.0, 1.0)[0], (-300.0, 0.0)), FREE, scenario=AIR)
    assert other.local[0].value == pytest.approx(-130.0, abs=1.0)


def test_clocks_that_cannot_be_left_open() -> None:
    first, second = held(130.0, 1.0)
    with raises_code("value.outside-range", RecordError):
        first.joined(second, (300.0, 0.0))
    third = td.Record.from_arrays(
        "third", FAST, {"Q": td.Channel.from_array("Q", 293.15 + 0 * FAST, unit="K", role="boundary", target="air")}
    )
    with raises_code("record.second-clock", RecordError):
        third.joined(first.joined(second, (0.0, 300.0)), 0.0)
    with raises_code("record.not-overlapping", RecordError, match="T: "):
        td.calibrate(BOX, second.joined(first, (-1700.0, 1700.0)), FREE, scenario=AIR)


def test_a_campaign_says_which_log_has_another_clock(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    first, second = held(130.0, 1.08)
    first.to_csv(tmp_path / "bench.csv")
    second.to_csv(tmp_path / "meter.csv")
    td.save_model(BOX, tmp_path / "box.toml")
    campaign = tmp_path / "campaign.toml"
    campaign.write_text(CAMPAIGN)
    found = td.run_stages(campaign, cache=tmp_path / "results")
    clock = {i.name: i.value for i in found["box"].local}
    assert clock == pytest.approx({"clock offset": 130.0, "clock rate": 1.08}, abs=0.6)
    show_campaign(found, ["box.values.toml"])
    assert "box: bench: clock offset 130" in capsys.readouterr().out
    again = td.run_stages(campaign, cache=tmp_path / "results")
    assert again["box"].fitted == found["box"].fitted
    assert again["box"]["out.conductance"].error == pytest.approx(found["box"]["out.conductance"].error, rel=1e-5)
    campaign.write_text(CAMPAIGN.replace('record = "meter"', 'record = "metre"'))
    with raises_code("campaign.refused", RecordError, match="'metre'"):
        td.run_stages(campaign)
    campaign.write_text(CAMPAIGN.replace('file     = "bench.csv"', 'files = "ben*.csv"'))
    with raises_code("value.excludes-another", DeckError):
        td.run_stages(campaign)


@pytest.mark.campaign
def test_intervals_of_clocks_hold_the_truth() -> None:
    pulls = []
    for seed in range(60):
        fit = td.calibrate(BOX, open_clock(130.0, 1.08, seed), FREE, scenario=AIR)
        clock = {i.name: i for i in fit.local}
        pulls.append(
            [(clock[n].value - t) / clock[n].error for n, t in (("clock offset", 130.0), ("clock rate", 1.08))]
            + [(fit[p].value - t) / fit[p].error for p, t in zip(FREE, (300.0, 0.5), strict=True)]
        )
    held_in = np.mean(np.abs(pulls) < 1.96, axis=0)
    assert (held_in > 0.86).all(), held_in
    assert (np.mean(np.square(pulls), axis=0) > 0.5).all()


def test_a_clock_that_no_part_shows_is_said_not_to_be_determined() -> None:
    """A supply clock was read as 331 +- 158 s for a truth of -60, where only a slow battery answered, without a word."""
    first, second = held(130.0, 1.0)
    noise = 6.0 * np.random.default_rng(4).standard_normal(SLOW.size)
    dull = first.with_channels(replace(first["T"], values=first["T"].values + noise, noise=6.0))
    fit = td.calibrate(BOX, dull.joined(second, (100.0, 160.0)), FREE[1:], scenario=AIR)
    assert any(re.search(r"'bench: clock offset' .* 95 % ", w) for w in fit.warnings)
    sharp = td.calibrate(BOX, first.joined(second, (100.0, 160.0)), FREE[1:], scenario=AIR)
    assert not any("clock offset" in w for w in sharp.warnings)


def test_a_clock_at_the_end_of_its_range_is_flagged_with_its_value() -> None:
    """The true offset is 130 s, the range ends at 60 s: the fit must not count as adequate for it, a verdict says where it ended."""
    first, second = held(130.0, 1.0)
    narrow = first.joined(second, (0.0, 60.0))
    fit = td.calibrate(BOX, narrow, FREE, scenario=AIR)
    assert fit.own.state == "not adequate"
    assert "'bench: clock offset'" in fit.own.because
    right = td.calibrate(BOX, open_clock(130.0, 1.08), FREE, scenario=AIR)
    said = str(td.validate(right, narrow, td.Criteria(rmse="9 [K]"), scenario=AIR))
    assert re.search(r": clock offset 60\b", said)
    assert "'bench: clock offset'" in said


def test_a_stage_that_ignores_channels_of_a_joined_log_has_no_clock_of_them() -> None:
    """A campaign of levels over one test ended in an error after all its fits: the clock still named the channels of another level."""
    first, second = logs(130.0, 1.0)
    joint = first.joined(second.with_channels(replace(second["P"], name="Q", target="")), (0.0, 300.0))
    assert joint.clocks[0].channels == ("P", "Q")
    assert joint.select("T").clocks == ()
    assert joint.select("T", "Q").clocks[0].channels == ("Q",)
