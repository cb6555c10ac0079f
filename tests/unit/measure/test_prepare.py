from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from by_code import raises_code
from thermid.base.errors import NameNotFoundError, RecordError, UnitError
from thermid.measure._record.channel import Channel
from thermid.measure._record.record import Record
from thermid.measure._record.windows import hampel, low_pass, moving_median


def made(times, **channels) -> Record:
    return Record.from_arrays("bench", times, channels, unit="K")


def ramp(count=41, step=0.5) -> Record:
    times = step * np.arange(count)
    power = Channel.from_array("heater", np.where(times < 5, 2.0, 0.0), quantity="power", role="load", target="heater")
    return made(times, case=300 + 0.1 * times, heater=power)


def test_trim_keeps_times_and_origin():
    record = ramp()
    cut = record.trim("2 [s]", "end")
    assert (cut.times[0], cut.times[-1], cut.times.size) == (2, 20, 37)
    assert cut.origin is record.origin
    assert re.match(r"\w+: 2 \[s\] to 20 \[s\], 37 of 41 ", *cut.steps)
    assert cut.trim(3.0, "10 [s]").times[[0, -1]].tolist() == [3, 10]
    assert record.times.size == 41
    assert record.steps == ()
    assert cut.shift_start().times[[0, -1]].tolist() == [0, 18]


def test_trim_meets_a_time_written_with_few_digits():
    record = made(np.arange(7) * 0.1, case=np.full(7, 300.0))
    assert record.trim("0.3 [s]").times.size == 4  # 3 * 0.1 is a little above 0.3, 6 * 0.1 above 0.6
    assert record.trim("start", "0.6 [s]").times.size == 7


def test_trim_counts_masks_of_what_is_left():
    record = ramp().mask("case", 0, 3, "bad").mask("case", 10, 11, "worse")
    assert record["case"].flags == {"bad": 7, "worse": 3}
    assert record.trim(2, 10)["case"].flags == {"bad": 3, "worse": 1}


@pytest.mark.parametrize(
    ("action", "code", "match"),
    [
        (lambda r: r.trim(3, 2), "value.outside-range", r"3.*\[s\].*2.*\[s\]"),
        (lambda r: r.trim(30, 40), "record.nothing-there", "30.*40.*'bench'.*0.*20"),
        (lambda r: r.trim(3, 3), "record.too-short", r"1.*3.*\[s\].*3.*\[s\]"),
        (
            lambda r: r.trim("fin"),
            "value.wrong-kind",
            r"'fin'.*'5 \[s\]'.*'start'.*'end'",
        ),
        (lambda r: r.median("0 [s]"), "value.outside-range", r"0.*\[s\]"),
        (lambda r: r.filter(-1), "value.outside-range", r"-1.*\[s\]"),
        (lambda r: r.median("21 [s]"), "record.too-short", "21.*'bench'.*20"),
        (lambda r: r.resample("1 [min]"), "record.too-short", "60.*'bench'.*20"),
        (lambda r: r.resample(0), "value.outside-range", r"0.*\[s\]"),
        (lambda r: r.resample(1, max_gap=0), "value.outside-range", r"max_gap.*0.*\[s\]"),
        (lambda r: r.flag_spikes(3, "1 [h]"), "record.too-short", "3600.*'bench'.*20"),
        (lambda r: r.flag_spikes(0, 2), "value.outside-range", "0"),
        (lambda r: r.flag_spikes("0 [K]", 2), "value.outside-range", r"'0 \[K\]'"),
        (lambda r: r.flag_spikes(3, 2, ["heater"]), "record.does-not-apply", "'heater'"),
        (
            lambda r: r.filter("1 [s]"),
            "value.outside-range",
            r"1.*0\.5",
        ),
        (
            lambda r: r.select("heater").median(2),
            "record.does-not-apply",
            "'bench'",
        ),
        (lambda r: r.flag_faults(low="30 [degC]", high="20 [degC]"), "value.outside-range", r"30.*\[degC\].*20.*\[degC\]"),
        (
            lambda r: r.mask("case", 0, 20, "bad"),
            "record.nothing-there",
            "'case'.*41.*41",
        ),
        (
            lambda r: r.mask("case", 2, 20, "bad").trim(3, 9),
            "record.nothing-there",
            "'case'.*13.*13",
        ),
        (
            lambda r: made([0, 1, 2.5, 3], case=[300.0] * 4).filter(3),
            "record.uneven-times",
            r"'bench'.*0\.5.*1\.5.*'1 \[s\]'",
        ),
    ],
)
def test_messages(action, code, match):
    with raises_code(code, RecordError, match=match):
        action(ramp())


@pytest.mark.parametrize(
    ("action", "code", "match"),
    [
        (lambda r: r.median("4 [K]"), "unit.wrong-dimension", r"'\[K\]'.*\[s\]"),
        (lambda r: r.trim("4 [m]"), "unit.wrong-dimension", r"'\[m\]'.*\[s\]"),
        (
            lambda r: r.flag_spikes("3 [degC]", 2),
            "unit.scale-for-difference",
            r"'\[degC\]'.*\[K\]",
        ),
        (lambda r: r.flag_faults(low="3 [W]"), "unit.wrong-dimension", r"'\[W\]'.*\[degC\].*\[K\]"),
    ],
)
def test_units(action, code, match):
    with raises_code(code, UnitError, match=match):
        action(ramp())


def test_median_removes_a_single_spike_and_keeps_a_slope():
    record = ramp()
    values = record["case"].values.copy()
    values[[0, 20, 40]] += [40, -30, 25]
    smooth = record.with_channels(Channel.from_array("case", values, unit="K")).median("4 [s]")
    assert smooth["case"].values[4:-4] == pytest.approx(record["case"].values[4:-4], abs=0.05 + 1e-9)  # at most one sample of the slope
    # at the ends the window is cut to half: a quarter of the window times the slope, and the spike moves it by one sample of the slope
    assert abs(smooth["case"].values - record["case"].values).max() <= 0.1 * 4 / 4 + 0.1 * 0.5 + 1e-9
    assert np.array_equal(smooth["heater"].values, record["heater"].values)
    assert re.match(r"\w+: .* 4 s .*case$", *smooth.steps)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.data())
def test_moving_median_is_the_median_of_the_valid_samples_of_each_window(data):
    steps = data.draw(st.lists(st.sampled_from([1, 1, 1, 2, 7, 30]), min_size=1, max_size=60))
    times = np.cumsum([0, *steps]).astype(float)
    values = np.array(data.draw(st.lists(st.integers(-9, 9), min_size=times.size, max_size=times.size)), float)
    valid = np.array(data.draw(st.lists(st.booleans(), min_size=times.size, max_size=times.size)))
    window = data.draw(st.sampled_from([0.5, 2, 3, 8, 1000]))
    expected = []
    for t in times:
        near = values[valid & (np.abs(times - t) <= window / 2)]
        expected.append(np.median(near) if near.size else np.nan)
    assert np.array_equal(moving_median(times, values, valid, window), expected, equal_nan=True)


def test_median_leaves_masked_samples_out_and_masked():
    values = np.full(21, 300.0)
    values[5:8] = 400
    record = made(np.arange(21.0), case=values).mask("case", 5, 7, "fault").median(4)
    assert record["case"].values[record["case"].valid].tolist() == [300.0] * 18
    assert record["case"].values[5:8].tolist() == [400.0] * 3
    assert record["case"].flags == {"fault": 3}


def test_powers_are_filtered_only_when_asked_and_commands_never():
    record = ramp().with_channels(Channel.from_array("u", (np.arange(41) % 2).astype(float), quantity="command"))
    for name in ("median", "filter"):
        plain, asked = getattr(record, name)("4 [s]"), getattr(record, name)("4 [s]", powers=True)
        assert np.array_equal(plain["heater"].values, record["heater"].values)
        assert np.array_equal(asked["u"].values, record["u"].values)
        assert np.array_equal(plain["u"].values, record["u"].values)
    assert not np.array_equal(asked["heater"].values, record["heater"].values)


def test_filter_halves_its_period_and_does_not_shift():
    times = 0.5 * np.arange(4001)
    for period, left in ((20.0, 0.5), (400.0, 1.0), (2.0, 0.0)):
        wave = np.sin(2 * np.pi * times / period)
        smooth = made(times, case=300 + wave).filter("20 [s]")["case"].values - 300
        inside = slice(500, -500)
        gain = smooth[inside] @ wave[inside] / (wave[inside] @ wave[inside])
        # the bilinear transform, prewarped at the cut-off, leaves the gain there exact
        assert gain == pytest.approx(left, abs=1e-3)
        quadrature = np.cos(2 * np.pi * times / period)[inside]
        assert smooth[inside] @ quadrature / (quadrature @ quadrature) == pytest.approx(0, abs=1e-3)


def test_filter_keeps_a_slope_and_bridges_masked_samples():
    plain = ramp(201)
    record = plain.with_channels(plain["case"].masked(np.arange(201) % 40 == 7, "bad"))
    smooth = record.filter("6 [s]")
    good = smooth["case"].valid
    assert smooth["case"].values[good] == pytest.approx(record["case"].values[good], abs=1e-7)
    assert smooth["case"].flags == {"bad": 5}
    assert re.match(r"\w+: .* 6 s, .*case", smooth.steps[-1])


def test_filter_is_split_by_a_long_masked_stretch():
    values = np.where(np.arange(200) < 100, 300.0, 350.0)
    valid = (np.arange(200) < 90) | (np.arange(200) > 110)
    out = low_pass(values, valid, 1.0, 8.0)
    assert out[valid] == pytest.approx(values[valid], abs=1e-9)


def test_an_even_grid_holds_commands_and_joins_temperatures():
    record = ramp().resample("0.7 [s]", switches=False)  # 4.9 s lies between the last sample of 2 W and the first of 0 W
    assert record.times == pytest.approx(0.7 * np.arange(29))
    assert record["case"].values == pytest.approx(300 + 0.1 * record.times)
    assert record["heater"].values.tolist() == [2.0 if t < 5 else 0.0 for t in record.times]
    assert re.match(r"\w+: 41 .* 29 .* 0\.7 s;", record.steps[0])
    coarse, filtered = (r.resample(5, switches=False).steps[-1].split(", ") for r in (ramp(), ramp().median(2)))
    assert len(coarse) == len(filtered) + 1  # single samples were taken, for want of a filter


def test_resample_keeps_the_switches_of_a_power_and_not_the_noise_of_its_meter():
    """Of 36000 rows with volts times amperes 35337 were kept as switches, and a search for a structure did not end.

    Not kept by default, on a grid of 120 s steps of a power moved, a coefficient was 3.1 for 1.75, and "the model lacks some physics".
    """
    times = 2.0 * np.arange(3000)
    watts = np.where((times >= 901) & (times < 4000), 20.0, 5.0)
    noisy = watts + np.random.default_rng(3).normal(0.0, 0.05, times.size)
    power = Channel.from_array("p", noisy, quantity="power", role="load")
    out = made(times, case=300 + times, p=power).prepare([{"resample": "130 [s]"}])
    assert np.setdiff1d(out.times, 130.0 * np.arange(47)).tolist() == [902.0, 4000.0]
    assert out["p"].values[:-1] == pytest.approx(np.where((out.times >= 902) & (out.times < 4000), 20.0, 5.0)[:-1], abs=0.03)
    heat = np.sum(np.diff(out.times) * out["p"].values[:-1])
    assert heat == pytest.approx(2.0 * noisy[: int(out.times[-1] / 2)].sum(), rel=1e-9)


def test_a_power_that_switches_more_often_than_the_grid_is_a_mean():
    times = np.arange(6001.0)
    power = Channel.from_array("p", np.where(times.astype(int) // 15 % 2, 24.0, 0.0), quantity="power", role="load")
    out = made(times, case=300 + times, p=power).resample("60 [s]")
    assert out.times.size == 101
    assert out["p"].values[:-1].tolist() == [12.0] * 100
    assert out.steps[-1].count("; ") >= 2, "what outnumbers the grid is averaged, and that is written"


def test_resample_does_not_cross_a_gap():
    times = np.array([0, 1, 2, 3, 4, 20, 21, 22, 23, 24, 25.0])
    power = Channel.from_array("p", np.arange(11.0), quantity="power")
    record = made(times, case=300 + times, p=power).resample(1)
    inside = (record.times > 4) & (record.times < 20)
    assert (~record["case"].valid).tolist() == inside.tolist()
    assert (~record["p"].valid).tolist() == inside.tolist()
    assert record["case"].flags == {"gap": 15}
    assert record.steps[-1].endswith(": case 15, p 15")
    across = made(times, case=300 + times).resample(1, max_gap="16 [s]")
    assert across["case"].values == pytest.approx(300 + across.times)
    short = made(times, case=300 + times).resample(1, max_gap="15.9 [s]")
    assert short["case"].flags == {"gap": 15}


def test_resample_leaves_out_masked_samples_and_does_not_go_beyond_valid_ones():
    record = ramp().mask("case", 0, 1, "bad").mask("case", 7, 7, "bad").mask("heater", 0, 2, "off")
    out = record.resample("0.5 [s]")
    assert np.flatnonzero(~out["case"].valid).tolist() == [0, 1, 2]
    assert out["case"].values[14] == pytest.approx(300.7)
    assert np.flatnonzero(~out["heater"].valid).tolist() == [0, 1, 2, 3, 4]


def test_a_log_that_changes_its_rate_has_no_gap_for_that():
    times = np.concatenate([np.arange(0, 10, 0.1), np.arange(10, 60, 1.0)])
    record = made(times, case=300 + times).resample("0.5 [s]")
    assert record["case"].flags == {}


def test_spikes_of_a_quantised_sensor():
    rng = np.random.default_rng(11)
    step = 0.48876
    truth = 320 + 10 * np.sin(np.arange(2000) / 400)
    values = np.round((truth + rng.normal(0, 0.25, 2000)) / step) * step
    at = np.array([3, 500, 501, 900, 1999])
    values[at] += [9, -30, 12, 5, 8]
    record = made(0.25 * np.arange(2000), case=values).flag_spikes(5, "10 [s]")
    assert np.flatnonzero(~record["case"].valid).tolist() == at.tolist()
    assert record["case"].values[500] < 300  # a masked sample keeps its number
    assert record["case"].flags == {"spike": 5}
    assert re.match(r"\w+: \w+ case 5; .* 5 .* 10 s$", *record.steps)


def test_robust_standard_deviation_is_that_of_normal_samples():
    values = np.random.default_rng(5).normal(300, 0.4, 2001)
    centre, spread = hampel(np.arange(2001.0), values, np.ones(2001, bool), 4000.0)
    # the standard error of a median of n normal samples is 1.25 sd / sqrt(n), of a scaled median deviation 1.17 sd / sqrt(n)
    assert centre[1000] == pytest.approx(300, abs=4 * 1.25 * 0.4 / np.sqrt(2001))
    assert spread[1000] == pytest.approx(0.4, abs=4 * 1.17 * 0.4 / np.sqrt(2001))


def test_spikes_further_than_a_difference():
    values = 300 + 0.01 * np.arange(100)
    values[[10, 50]] += [2.9, 3.1]
    record = made(np.arange(100.0), case=values).flag_spikes("3 [K]", "20 [s]")
    assert np.flatnonzero(~record["case"].valid).tolist() == [50]


def test_a_quiet_channel_has_no_spike_of_one_level():
    values = np.full(100, 300.0)
    values[[20, 60]] += [0.0625, 0.5]
    for channel in (values, Channel.from_array("case", values, unit="K", resolution=0.0625)):
        flagged = made(np.arange(100.0), case=channel).flag_spikes(3, 20)
        assert np.flatnonzero(~flagged["case"].valid).tolist() == [60]
    coarse = made(np.arange(100.0), case=Channel.from_array("case", values, unit="K", resolution=0.5)).flag_spikes(3, 20)
    assert coarse["case"].valid.all()


def test_fault_codes_of_a_one_wire_sensor():
    celsius = np.array([85, 20, 20.5, -127, 21, 85, 21.5, 22, 140, 22])
    record = made(np.arange(10.0), case=celsius + 273.15).flag_faults(high="125 [degC]")
    assert np.flatnonzero(~record["case"].valid).tolist() == [0, 3, 5, 8]
    assert record["case"].flags == {"fault": 4}
    assert re.match(r"\w+: \w+ case 4; \w+ 85 \[degC\], -127 \[degC\], \w+ 125 \[degC\]$", *record.steps)


def test_85_degrees_on_the_way_is_no_fault():
    celsius = np.array([83, 84, 84.5, 85, 85, 85.5, 87, 86, 85, 84])
    record = made(np.arange(10.0), case=celsius + 273.15).flag_faults()
    assert record["case"].valid.all()
    assert made(np.arange(4.0), case=[358.15, 293.15, 293.15, 300.0]).flag_faults(codes=())["case"].valid.all()


def test_mask_by_hand():
    record = ramp().mask("case", "5 [s]", "6 [s]", "door open")
    assert np.flatnonzero(~record["case"].valid).tolist() == [10, 11, 12]
    assert re.match(r"\w+: case .* 5 \[s\] .* 6 \[s\] \(3 .*\), door open$", *record.steps)
    with raises_code("name.unknown", NameNotFoundError, match="'bench'.*'cas'.*'case'"):
        ramp().mask("cas", 0, 1)


def test_campaign_steps():
    steps = [
        {"trim": ["2 [s]", "end"]},
        {"faults": {"codes": ["85 [degC]"]}},
        {"spikes": {"threshold": 5, "window": "5 [s]"}},
        {"mask": {"channel": "case", "start": "3 [s]", "end": "4 [s]", "reason": "door"}},
        {"median": "4 [s]"},
        {"filter": {"window": "3 [s]", "powers": True}},
        {"resample": ["1 [s]", "5 [s]"]},
        {"shift_start": True},
    ]
    record = ramp()
    one = record.prepare(steps)
    two = record.trim("2 [s]").flag_faults(["85 [degC]"]).flag_spikes(5, "5 [s]").mask("case", 3, 4, "door").median(4)
    two = two.filter(3, powers=True).resample(1, 5).shift_start()
    assert one.steps == two.steps
    assert [step.split(":")[0] for step in one.steps] == [next(iter(step)) for step in steps]
    assert np.array_equal(one["case"].values, two["case"].values)
    assert one.origin == record.origin
    assert record.prepare([]) is record


@pytest.mark.parametrize(
    ("step", "code", "match"),
    [
        (
            {"medain": 3},
            "name.unknown",
            r"'bench'.*\[2\].*'medain'.*shift_start.*'median'",
        ),
        (
            {"spikes": {"treshold": 3, "window": 2}},
            "name.unknown",
            r"'bench'.*\[2\].*'treshold'.*'threshold'",
        ),
        ({"spikes": 5}, "value.incomplete", r"'bench'.*\[2\]"),
        ({"spikes": {}}, "value.incomplete", r"'bench'.*\[2\]"),
        ({"trim": ["1 [s]", "2 [s]", "3 [s]"]}, "value.wrong-kind", r"'bench'.*\[2\].*3"),
        ({"shift_start": "now"}, "value.wrong-kind", r"'bench'.*\[2\].*shift_start.*1"),
        ({"median": True}, "value.not-an-amount", r"'bench'.*\[2\].*'4 \[s\]'"),
        ({"median": "4 [m]"}, "unit.wrong-dimension", r"'bench'.*\[2\].*'\[m\]'.*\[s\]"),
        (
            {"median": 1, "trim": 2},
            "value.wrong-kind",
            r"'bench'.*\[2\].*'median'.*1.*'trim'.*2.*'4 \[s\]'",
        ),
        ("median", "value.wrong-kind", r"'bench'.*\[2\].*'median'.*'4 \[s\]'"),
    ],
)
def test_campaign_step_messages(step, code, match):
    with raises_code(code, match=match):
        ramp().prepare([{"trim": "1 [s]"}, step])


def test_readings_that_hold_until_the_next_are_thinned_to_readings_and_not_to_means() -> None:
    """They were means of the step after each instant, half a step early."""
    times = np.arange(0.0, 1000.0, 2.0)
    slope = Channel.from_array("T", 20.0 + times / 100.0, unit="degC", role="node", interpolation="previous")
    power = Channel.from_array("P", np.where(times > 351.0, 5.0, 0.0), unit="W", quantity="power", role="load")
    thin = Record.from_arrays("r", times, {"T": slope, "P": power}).resample("100 [s]")
    assert np.asarray(thin["T"]) == pytest.approx(20.0 + thin.times / 100.0)
