"""What was once read wrongly without a word: each is now read rightly, or refused with the option that decides."""

from __future__ import annotations

import re
import tomllib

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.base.errors import RecordError, ThermidError, UnitError, code_of
from thermid.measure._readers.formats import log_cells
from thermid.measure._readers.guess import columns_of
from thermid.measure._readers.headers import name_and_unit
from thermid.measure._readers.log_reader import read_record
from thermid.measure._record.channel import open_questions, stray_readings
from thermid.measure._record.record import Record

ICE = 273.15


def first(log, header: str, cell: str, **binding: object) -> float:
    path = log(f"time [s];{header}\n0;{cell}\n10;{cell}\n")
    record = read_record(path, {name_and_unit(header)[0]: {"node": "a", **binding}}, separator=";")
    return float(next(iter(record.channels.values())).values[0])


@pytest.mark.parametrize(
    "header",
    ["T1 (°F)", "T1 [degF]", "T1 {F}", "T1 <°F>", "T1, °F", "T1 / °F", "T1/degF", "T1 (Deg F)", "T1 (Fahrenheit)", "T1_degF", "1 (F)- T1"],
)
def test_degrees_fahrenheit_are_not_read_as_celsius(log, header):
    assert first(log, header, "75") == pytest.approx(75 / 1.8 + 459.67 / 1.8)


@pytest.mark.parametrize("header", ["P (mW)", "P [mW]", "P, mW", "P/mW", "P_mW"])
def test_milliwatts_are_not_read_as_watts(log, header):
    path = log(f"time [s];{header}\n0;2000\n10;2000\n")
    name = name_and_unit(header)[0]
    assert read_record(path, {name: {"load": "q"}}, separator=";")[name].values.tolist() == [2.0, 2.0]


@pytest.mark.parametrize("header", ["T1 (left)", "T1 [grd]", "T1 {x}", "T1 <spare>", "T1, °X"])
def test_a_unit_that_nobody_knows_is_refused_and_never_dropped(log, header):
    with raises_code("unit.unknown", UnitError):
        first(log, header, "75")
    assert first(log, header, "75", unit="degC") == pytest.approx(75 + ICE)


@pytest.mark.parametrize("name", ["T1_F", "case_K"])
def test_a_letter_that_may_be_a_unit_is_asked_about(log, name):
    with raises_code("record.unit-unclear", RecordError, match=f"'_{name[-1]}', so its"):
        first(log, name, "75")
    assert first(log, name, "75", unit="degC") == pytest.approx(75 + ICE)


@pytest.mark.parametrize("header", ["Q1 (%)", "Q1 [%]", "Q1_pct", "duty", "PWM", "Q1, %"])
def test_per_cent_are_never_taken_as_watts(log, header):
    path = log(f"time [s];{header}\n0;80\n10;80\n")
    name = name_and_unit(header)[0]
    with raises_code("record.unit-unclear", ThermidError):
        read_record(path, {name: {"load": "q"}}, separator=";")
    record = read_record(path, {name: {"load": "q", "full_scale": "5 [W]"}}, separator=";")
    assert (record[name].values.tolist(), record[name].quantity, record[name].unit) == ([4.0, 4.0], "power", "W")
    assert record[name].held


def test_levels_up_to_100_without_a_unit_are_asked_about(log):
    path = log("t,Q1\n0,0\n10,100\n20,40\n")
    with raises_code("record.unit-unclear", RecordError, match="full_scale"):
        read_record(path, {"Q1": {"load": "q"}})
    assert read_record(path, {"Q1": {"load": "q", "unit": "W"}})["Q1"].values.tolist() == [0, 100, 40]
    assert read_record(path, {"Q1": {"load": "q", "full_scale": "10 [W]"}})["Q1"].values.tolist() == [0, 10, 4]


@pytest.mark.parametrize(
    ("binding", "code", "match"),
    [
        ({"load": "q", "gain": "a", "full_scale": "5 [W]"}, "value.incomplete", r"bench\.csv.*channels\.Q1.*full_scale"),
        ({"node": "q", "full_scale": "5 [W]"}, "value.incomplete", r"bench\.csv.*channels\.Q1.*full_scale"),
        ({"load": "q", "full_scale": "5 [K]"}, "unit.wrong-dimension", r"bench\.csv.*'Q1'.*full_scale"),
        ({"load": "q", "full_scale": "0 [W]"}, "value.outside-range", r"bench\.csv.*'Q1'.*full_scale"),
        ({"load": "q", "unit": "W", "full_scale": "5 [W]"}, "record.unit-contradicts", "full_scale"),
    ],
)
def test_a_full_scale_is_the_power_of_a_load_in_per_cent(log, binding, code, match):
    with raises_code(code, match=match):
        read_record(log("t,Q1\n0,10\n10,20\n"), {"Q1": binding})


@pytest.mark.parametrize(("factor", "name"), [(1, "s"), (1000, "ms"), (1_000_000, "us"), (1_000_000_000, "ns")])
def test_times_since_1970_are_told_by_their_size(log, factor, name):
    rows = "".join(f"{(1_700_000_000 + 10 * k) * factor},{20 + k}\n" for k in range(5))
    record = read_record(log("timestamp,T1\n" + rows), {"T1": "T1"})
    assert record.times.tolist() == [0, 10, 20, 30, 40]
    assert record.origin.start == "2023-11-14T22:13:20+00:00"
    assert any("1970" in step for step in record.steps) == (name != "s")


def test_a_unit_that_puts_times_since_1970_elsewhere_is_asked_about(log):
    path = log("time [s],T1\n1700000000000,20\n1700000010000,21\n")
    with raises_code("record.time-unclear", RecordError, match="1970.*'time'.*'ms'"):
        read_record(path, {"T1": "T1"})
    assert read_record(path, {"T1": "T1"}, units={"time": "ms"}).times.tolist() == [0, 10]
    assert read_record(path, {"T1": "T1"}, units={"time": "s"}).times[0] == 1.7e12


def test_a_step_that_no_test_of_heat_has_is_asked_about(log):
    path = log("time,T1\n0,20\n100000,21\n200000,22\n")
    with raises_code("record.time-unclear", RecordError):
        read_record(path, {"T1": "T1"})
    assert read_record(path, {"T1": "T1"}, units={"time": "ms"}).times.tolist() == [0, 100, 200]
    assert read_record(path, {"T1": "T1"}, units={"time": "s"}).times[-1] == 200000
    # readings ten minutes apart are as slow as a bench takes them: minutes or hours that name no unit are likelier beyond
    usual, slow = (read_record(log(f"time,T1\n0,20\n{step},21\n{2 * step},22\n"), {"T1": "T1"}) for step in (600, 650))
    assert usual.steps == ()
    assert "'time'" in slow.steps[0]
    fast = read_record(log("time [s],T1\n0,20\n0.0001,21\n0.0002,22\n"), {"T1": "T1"})
    assert "0.0001 s" in fast.steps[0]


def test_a_long_table_is_not_one_channel(log):
    rows = "".join(f"{s},{20 + n + k},2024-01-01T00:0{k}:00Z\n" for n, s in enumerate(("sensor.case", "sensor.air")) for k in range(3))
    path = log("entity_id,state,last_changed\n" + rows)
    with raises_code("name.unknown", ThermidError, match="'state'.*sensor.case.*sensor.air"):
        read_record(path, {"case": "state"})
    record = read_record(path, {"case": "sensor.case", "air": "sensor.air"})
    assert record["air"].values.round(9).tolist() == [21 + ICE, 22 + ICE, 23 + ICE]
    assert any(re.search(r"\b6 \w+ .*\b2 ", step) for step in record.steps)


def test_a_series_with_two_readings_at_one_time_is_refused(log):
    text = "sensor,time,value\n" + "a,0,20\na,10,21\na,10,25\nb,0,20\nb,10,21\n"
    with raises_code("record.two-readings-at-one-time", RecordError, match="bench.csv:4.*'a'.*10.*21.*25"):
        read_record(log(text), {"x": "a"})


def test_rows_of_several_things_are_remarked_on(log):
    record = read_record(log("t,sensor,T1,T2\n0,a,20,1\n1,b,21,1\n2,a,22,1\n3,b,23,1\n"), {"x": "T1"})
    assert any("'sensor'" in words for words in record.steps)


@pytest.mark.parametrize(
    ("rows", "times"),
    [
        (["13/02/2024 10:00:00", "13/02/2024 10:00:10"], [0, 10]),
        (["02/13/2024 10:00:00", "02/14/2024 10:00:00"], [0, 86400]),
        (["05/06/2024 10:00:00", "05/06/2024 10:00:10"], [0, 10]),
        (["11/06/2024 23:59:50", "12/06/2024 00:00:00", "12/06/2024 00:00:10"], [0, 10, 20]),
        (["24/07/20 21:00", "24/08/01 21:00"], [0, 12 * 86400]),
        (["1/2/2024 1:59:00 PM", "1/2/2024 2:00:00 PM"], [0, 60]),
        (["1/2/2024 11:59:00 AM", "1/2/2024 12:00:00 PM", "1/2/2024 1:00:00 PM"], [0, 60, 3660]),
        (["12:59:59 AM", "1:00:00 AM"], [0, 1]),
        (["09:03", "21:18", "00:00"], [0, 44100, 53820]),
        (["29.02.2024 10:00:00,500", "01.03.2024 10:00:00,750"], [0, 86400.25]),
        (["21-Apr-2026 13:39:54", "21-Apr-2026 13:40:54"], [0, 60]),
        (["3 mai 2024 10:00:00", "4 mai 2024 10:00:00"], [0, 86400]),
        (["Mar 1, 2024 1:00 PM", "Mar 1, 2024 1:05 PM"], [0, 300]),
        (["01/26/2009 08:07:12:237", "01/26/2009 08:07:22:237"], [0, 10]),
    ],
)
def test_order_of_day_and_month_is_that_of_the_whole_column(log, rows, times):
    record = read_record(log("time;T\n" + "".join(f"{row};20\n" for row in rows)), {"T": "T"})
    assert record.times.tolist() == times
    assert record.origin.start == rows[0]


def test_times_from_zero_of_two_numbers_may_be_a_stopwatch_and_are_asked_about(log):
    path = log("time;T\n0:00;20\n0:10;21\n0:20;22\n")
    with raises_code("record.time-not-read", RecordError, match="'%H:%M' or '%M:%S'"):
        read_record(path, {"T": "T"})
    assert read_record(path, {"T": "T"}, clock="%M:%S").times.tolist() == [0, 10, 20]


def test_day_and_month_that_the_column_leaves_open_are_asked_about(log):
    path = log("time,T1\n05/06/2024 10:00,20\n06/06/2024 10:00,21\n08/06/2024 10:00,22\n")
    with raises_code("record.time-unclear", RecordError, match="'%d/%m/%Y %H:%M'.*'%m/%d/%Y %H:%M'"):
        read_record(path, {"T1": "T1"})
    assert read_record(path, {"T1": "T1"}, clock="%d/%m/%Y %H:%M").times.tolist() == [0, 86400, 3 * 86400]
    assert read_record(path, {"T1": "T1"}, clock="%m/%d/%Y %H:%M").times[1] == 31 * 86400


def test_the_clock_that_a_refusal_offers_reads_the_file(log):
    for stamp in ("{}/06/2024 10:00:00 PM", "{}-06-24 10:00:00.125", "{}/06/2024 1:05:07,5"):
        rows = [stamp.format(f"{d:02d}") for d in (5, 6, 8)]
        path = log("time;T1\n" + "".join(f"{row};20\n" for row in rows))
        with raises_code("record.time-unclear", RecordError) as caught:
            read_record(path, {"T1": "T1"})
        clock = str(caught.value).split("clock='")[1].split("'")[0]
        assert read_record(path, {"T1": "T1"}, clock=clock).times.tolist() == [0, 86400, 3 * 86400]


def test_a_day_without_rows_is_not_lost_between_date_and_time(log):
    path = log("Date,Time,T1\n2024-05-01,10:00:00,20\n2024-05-04,10:00:00,21\n")
    for option in ({}, {"time": "Time"}, {"time": "Date"}):
        assert read_record(path, {"T1": "T1"}, **option).times.tolist() == [0, 3 * 86400]


def test_cells_with_units_of_their_own(log):
    path = log("time,T1,P\n0,24.0 °C,950 mW\n10,24.5 °C,1.2 W\n20,,1.1 W\n")
    record = read_record(path, {"T1": {"node": "a"}, "P": {"load": "q"}})
    assert record["P"].values.round(12).tolist() == [0.95, 1.2, 1.1]
    assert record["T1"].valid.tolist() == [True, True, False]
    with raises_code("record.unit-contradicts", RecordError, match="'24.5 °F'"):
        read_record(log("time,T1\n0,24.0 °C\n10,24.5 °F\n"), {"T1": {"node": "a"}})
    with raises_code("record.unit-contradicts", RecordError, match=r"'24\.5'"):
        read_record(log("time,T1\n0,24.0 °C\n10,24.5\n"), {"T1": {"node": "a"}})


def test_a_preamble_and_a_row_of_units_are_said(log):
    text = "Logger;X1\nSerial;4711\n\nTime;T1;P\nHH:MM:SS;°F;mW\n10:00:00;75;2000\n10:00:10;75;2000\n10:00:20;75;2000\n"
    record = read_record(log(text), {"T1": {"node": "a"}, "P": {"load": "q"}})
    assert record["T1"].values[0] == pytest.approx((75 + 459.67) / 1.8)
    assert record["P"].values.tolist() == [2, 2, 2]
    assert [re.findall(r"\d+", s) for s in record.steps[:2]] == [["3", "4"], ["5"]]


def test_what_no_unit_says_is_said(log):
    record = read_record(log("t,T1,P [W]\n0,20,1\n10,21,1\n"), {"T1": {"node": "a"}, "P": {"load": "q"}})
    assert [(c.unit, c.assumed) for c in record.channels.values()] == [("degC", True), ("W", False)]


def test_sensors_with_numbers_for_names_are_not_one_channel(log):
    rows = "".join(f"{10 * k},{s},{20 + s + k}\n" for k in range(4) for s in (1, 2))
    record = read_record(log("time,sensor_id,value\n" + rows), {"2": {"node": "b"}})
    assert record["2"].values.round(9).tolist() == [22 + ICE, 23 + ICE, 24 + ICE, 25 + ICE]


@pytest.mark.parametrize("name", ["Ts", "temps", "data", "mS", "hora"])
def test_a_column_of_readings_is_not_taken_for_the_time(log, name):
    with raises_code("record.time-unclear"):
        read_record(log(f"{name},T1\n20,21\n22,23\n24,25\n"), {"T1": {"node": "a"}})


def test_the_overload_of_an_instrument_is_no_reading(log):
    record = read_record(log("time,T1 (C)\n0,20\n1,9.90000000E+37\n2,-9.90000000E+37\n3,21\n"), {"T1": {"node": "a"}})
    assert record["T1"].flags == {"infinite": 2}


def test_stamps_of_one_day_leave_the_order_open_and_say_so(log):
    record = read_record(log("time,T1\n1/2/2024 10:00,20\n1/2/2024 10:01,21\n"), {"T1": {"node": "a"}})
    assert record.times.tolist() == [0, 60]
    (step,) = record.steps
    assert code_of(step) == "record.time-unclear"
    assert "(day/month/year or month/day/year)" in step


def test_errors_of_a_load_in_per_cent_are_shares_of_its_full_scale(log):
    table = {"Q1": {"load": "q", "full_scale": "5 [W]", "accuracy": "2 [%]", "noise": "1 [%]"}}
    channel = read_record(log("t,Q1\n0,10\n10,20\n"), table)["Q1"]
    assert (channel.accuracy, channel.noise) == (pytest.approx(0.1), pytest.approx(0.05))
    with raises_code("unit.wrong-dimension", UnitError):
        read_record(log("t,Q1\n0,10\n10,20\n"), {"Q1": table["Q1"] | {"accuracy": "0.1 [W]"}})


RISE = [20.0 + k / 4 for k in range(20)]


def coded(log, cells: list[object], unit: str = "degC") -> Record:
    return read_record(log(f"time [s],T [{unit}]\n" + "".join(f"{10 * k},{cell}\n" for k, cell in enumerate(cells))), {"T": {"node": "a"}})


@pytest.mark.parametrize(
    ("code", "named"),
    [
        ("-127", "(-127)"),
        ("85", "DS18B20 (85)"),
        ("-999.9", "(-999.9)"),
        ("9999", "(9999)"),
        ("850", "(850)"),
        ("0", "(0)"),
        ("3276.7", "(3276.7)"),
        ("1e9", "'T'"),
        ("1e8", "(1e+08)"),
    ],
)
def test_codes_of_loggers_are_named_and_masked_by_the_step_that_is_offered(log, code, named):
    cells: list[object] = [*RISE]
    cells[5] = cells[11] = code
    record = coded(log, cells)
    said = stray_readings([record])
    assert len(said) == 1
    assert code_of(said[0]) == "record.stray-readings"
    assert named in said[0]
    steps = tomllib.loads(re.search(r"prepare = \[.*\]", said[0])[0])["prepare"]
    cleaned = record.prepare(steps)
    assert np.flatnonzero(~cleaned["T"].valid).tolist() == [5, 11]
    assert stray_readings([cleaned]) == ()
    same, told = record.drop_strays()
    assert (same["T"].valid == cleaned["T"].valid).all()
    (line,) = told
    assert line.startswith("T: 2 ")
    assert named in line or named == "'T'"


def test_codes_in_fahrenheit_and_at_the_end_of_a_log(log):
    record = coded(log, [*(f"{1.8 * t + 32:.2f}" for t in RISE), "-9999", "-9999"], "degF")
    assert "(-9999)" in stray_readings([record])[0]
    assert record.drop_strays()[0]["T"].valid.sum() == len(RISE)


@pytest.mark.parametrize(
    "cells",
    [
        RISE,
        [20.0] * 12 + [90.0] * 12,  # from a bath into another
        [20.0] * 10 + [60.0] * 4 + [20.0] * 10,  # in a bath for a while
        [84.0 + k / 10 for k in range(20)],  # passes 85
        [30.0 + 5 * k for k in range(20)],  # passes it from far away
        [95.0, *RISE],  # the first reading, before the probe was put in place
        [-126.0, -127.0, -128.0] * 5,  # in the cold
    ],
    ids=["rise", "step", "while", "85", "85 at once", "first", "cold"],
)
def test_what_a_temperature_can_do_is_no_code(log, cells):
    assert stray_readings([coded(log, cells)]) == ()


def chamber(**readings):
    """A record of a cold soak: sensors of a housing that cools from 20 to -10 degC, and the shroud at -70 degC."""
    times = np.arange(0.0, 3600.0, 60.0)
    housing, shroud = 293.15 - 30.0 * times / 3600.0, np.full(times.size, 203.15)
    parts = {n: share * shroud + (1.0 - share) * housing for n, share in readings.items()}
    cold = td.Channel.from_array("S", shroud, unit="K", role="boundary", target="shroud")
    warm = [td.Channel.from_array(n, v, unit="K", role="node", target="housing") for n, v in parts.items()]
    return td.Record.from_arrays("soak", times, {c.name: c for c in (*warm, cold)})


def test_a_loose_thermocouple_reads_the_shroud_and_is_named():
    """Three sensors of the housing agree; the fourth is 59 K from them and 15 K from the shroud."""
    said = open_questions([chamber(A=0.0, B=0.01, C=0.02, D=0.8)])
    assert [code_of(text) for text in said] == ["record.loose-sensor"]
    assert all(word in said[0] for word in ("'D'", "59 K", "'housing'", "15 K", "'S'"))


@pytest.mark.parametrize(
    "readings",
    [
        {"A": 0.0, "B": 0.0, "C": 0.4},  # the cold end of a part that has a gradient
        {"A": 0.0, "B": 0.8},  # two cannot show which of them is loose
        {"A": 0.0, "B": 0.5, "C": 0.9},  # no two agree
        {"A": 0.97, "B": 0.97, "C": 1.0},  # all are at the shroud
    ],
    ids=["gradient", "two", "apart", "cold"],
)
def test_sensors_of_one_part_that_differ_need_not_be_loose(readings):
    assert open_questions([chamber(**readings)]) == ()


def test_a_header_that_stands_again_loses_no_samples(log):
    rows = [f"2026-03-05 10:00:{k:02d}\t2{k % 10},5" for k in range(40)]
    head = ["Logger 7", "time\tT [degC]"]
    record = read_record(log("\n".join([*head, *rows[:15], *head, *rows[15:]]) + "\n"), {"T": {"node": "a"}})
    assert record.times.tolist() == [float(k) for k in range(40)]
    again = "\n".join([*head, *rows[:15], *head, *rows[:15]]) + "\n"
    with raises_code("record.time-order", RecordError):
        read_record(log(again), {"T": {"node": "a"}})


def test_the_notes_name_a_header_that_stands_again(log):
    text = "time [s],T [degC]\n0,20\n10,21\ntime [s],T [degC]\n20,22\n30,23\n"
    cells = log_cells(log(text))
    assert re.search(r"\(\w+ 4\)", *cells.notes)
    assert cells.lines == [2, 3, 5, 6]


def test_stamps_of_fourteen_digits_are_no_seconds(log):
    record = read_record(log("time,T [degC]\n20260305095950,20\n20260305100000,21\n20260305100010,21\n"), {"T": {"node": "a"}})
    assert record.times.tolist() == [0.0, 10.0, 20.0]
    assert record.origin.start == "20260305095950"


def test_samples_that_end_with_a_separator(log):
    for mark in ",;":
        text = f"time [s]{mark}T [degC]\n0{mark}20{mark}\n10{mark}21{mark}\n"
        assert read_record(log(text), {"T": {"node": "a"}})["T"].values.tolist() == [20 + ICE, 21 + ICE]


@pytest.mark.parametrize("encoding", ["utf-16-le", "utf-16-be", "utf-16"])
def test_two_bytes_a_letter_with_and_without_a_mark(log, encoding):
    record = read_record(log("time [s],T [°C]\n0,20\n10,21\n".encode(encoding)), {"T": {"node": "a"}})
    assert record["T"].values.tolist() == [20 + ICE, 21 + ICE]


@pytest.mark.parametrize("word", ["OL", "O.L.", "OVLD", "Open", "#N/A", "1.#QNAN", "none"])
def test_words_of_instruments_for_an_overload_are_no_readings(log, word):
    assert coded(log, [20, word, 21])["T"].valid.tolist() == [True, False, True]
    commas = f"time [s];T [degC]\n0;20,5\n10;{word}\n20;21,5\n"
    assert read_record(log(commas), {"T": {"node": "a"}})["T"].valid.tolist() == [True, False, True]


def guesses(log, header: str, *rows: str) -> dict[str, tuple[str, str]]:
    cells = log_cells(log("\n".join((header, *rows)) + "\n"))
    return {c.name: (c.guess, c.why) for c in columns_of(cells, ".", (0,))}


def test_a_unit_letter_counts_whatever_the_case_before_it(log):
    """`base_C` was a thermometer, and `housingA_C` was dropped."""
    found = guesses(log, "time_s,base_C,housingA_C,CASE_C,HEATER_W,BOARD_A,BOARD_B,BOARD_C", "0,22,22,22,5,1,1,1", "9,23,24,22,5,1,2,1")
    kinds = ["temperature", "temperature", "temperature", "power", "ignored", "ignored", "ignored"]
    assert [guess for guess, _ in found.values()] == ["time", *kinds]


def test_a_display_of_dashes_is_a_missing_reading_and_a_column_with_words_says_where(log):
    path = log("time [s];T [degC];U [degC]\n0;22;20\n10;---;21\n20;23;-.-\n")
    record = read_record(path, {"T": {"node": "t"}, "U": {"node": "u"}}, separator=";")
    assert [record[c].valid.tolist() for c in "TU"] == [[True, False, True], [True, True, False]]
    (guess, why) = guesses(log, "time_s,T_C", "0,22", "10,23", "20,-", "30,24")["T_C"]
    assert guess == "ignored"
    assert re.search(r"'-' \(bench\.csv:4\).* 1 of 4 .*NaN, NA", why)


def test_a_formula_of_columns_with_blanks_says_the_rule_of_backticks(log):
    path = log("time [s],CH1 Voltage [V],CH1 Current [A]\n0,5,1\n10,5,1\n")
    with raises_code("expression.not-arithmetic", ThermidError, match="`CH1 Voltage` \\* `CH1 Current`"):
        read_record(path, {"P": {"load": "q", "power": "CH1 Voltage * CH1 Current"}})
    power = read_record(path, {"P": {"load": "q", "power": "`CH1 Voltage` * `CH1 Current`"}})["P"]
    assert power.values.tolist() == [5.0, 5.0]
