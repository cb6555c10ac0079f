from __future__ import annotations

import gzip
import re

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.base.errors import DeckError, MissingDataError, NameNotFoundError, RecordError, ThermidError, UnitError
from thermid.measure._readers.log_reader import read_plain, read_record

ANY = {"case": "T1"}
TEXT = "is not a number. Write missing samples as empty, NaN, NA or ---; for decimal commas give decimal=','."
BACK = "Sort the log, or read its parts as separate records."


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "bench.csv: the file is empty."),
        (" \n\n", "bench.csv: the file is empty."),
        ("# a\n# b\n", "bench.csv: the file has only comments."),
        ("time_s,T1\n", "bench.csv: the file has a header but no samples below it. Export the log again, with its data."),
        ("time_s,T1\n0,20\n", "bench.csv: the log has one sample; a record needs at least two times."),
        ("0,20\n1,21\n", "bench.csv:1: the first line holds numbers. Add a header line with the names of the columns above it."),
        ("time_s T1\n0 20\n1 21\n", "bench.csv:1: no comma, semicolon or tab divides the header 'time_s T1'. Give separator='...'."),
        (
            "a;b,c\n0;1,5\n1;2,5\n",
            "bench.csv: the separator is ambiguous: comma (2 columns) and semicolon (2 columns) are both possible. Give "
            "separator=',' or the other.",
        ),
        (
            "t;T1;T2\n0;1,5;20.5\n1;2,5;21\n",
            "bench.csv: the decimal sign is ambiguous: '1,5' (line 2) and '20.5' (line 2). Give decimal=',' or decimal='.'.",
        ),
        (
            "t,T1,T2\n0,20,1\n1,21\n2,22,3\n3,23,4\n",
            "bench.csv:3: 2 cells in this line, 3 columns in the header. Correct the line, put '#' before it, or give the separator.",
        ),
        (
            "t,T1,T2\n0,20,1\n# x\n\n1,21,2,9\n2,22,3\n3,22,3\n",
            "bench.csv:5: 4 cells in this line, 3 columns in the header. Correct the line, put '#' before it, or give the separator.",
        ),
        (
            "t,T1\n0,20\n\n1,ERR\n2,22\n",
            f"bench.csv:4, column 'T1': 'ERR' {TEXT}",
        ),
        (
            "t,T1\n0,20\n1,2_1\n2,22\n",
            f"bench.csv:3, column 'T1': '2_1' {TEXT}",
        ),
        (
            "t,T1\n0,20\n1,NA\n2,-\n3,1\n",
            f"bench.csv:4, column 'T1': '-' {TEXT}",
        ),
        (
            "t,T1\n0,\n1,NaN\n",
            "bench.csv, column 'T1': all 2 samples are masked (not a number 2). Leave the channel out, or keep a part where it works.",
        ),
        (
            "t,T1\n0,20\n2,21\n1,22\n3,23\n",
            f"bench.csv:4, column 't': time decreases here, from 2 to 1. {BACK}",
        ),
        (
            "time,T1\n10:00:00,20\n09:59:00,21\n",
            f"bench.csv:3, column 'time': time decreases here, from 10:00:00 to 09:59:00. {BACK}",
        ),
        ("t,T1\n0,20\n,21\n2,22\n", "bench.csv:3, column 't': this line has no time. Remove it, or correct the log."),
        ("t,T1\n0,20\nx,21\n2,22\n", "bench.csv:3, column 't': 'x' is text; the lines above it have times in numbers."),
        ("t,T1\n0,20\ninf,21\n", "bench.csv:3, column 't': 'inf' is not a time."),
        ("t,T1\n0,20\n0,21\n", "bench.csv: the log has 2 samples with one time stamp; a record needs at least two times."),
        (
            "time,T1\nday 24 10:00,20\nday 24 10:01,21\n",
            "bench.csv:2, column 'time': 'day 24 10:00' is not a known time (seconds, an ISO 8601 stamp, HH:MM:SS, or HH:MM after 0:00). "
            "Give its form, for example clock='%d.%m.%Y %H:%M:%S', '%H:%M' or '%M:%S'.",
        ),
        (
            "time,T1\n10:00:00,20\n10:61:00,21\n",
            "bench.csv:3, column 'time': '10:61:00' is not a clock time HH:MM:SS, the form of the first line.",
        ),
        (
            "time,T1\n2024-01-01T00:00:00Z,20\n2024-01-01T00:00:01,21\n",
            "bench.csv:3, column 'time': '2024-01-01T00:00:01' and the first stamp differ: only one has a time zone. "
            "Write all with a time zone, or none.",
        ),
        ("time,t,T1\n0,0,20\n1,1,21\n", "bench.csv: time and t could both be the time column. Give time='...' with the right one."),
        ('t,T1\n0,20\n1,"21\n2,22\n3,23\n', "bench.csv:3: a quotation mark is misplaced (unexpected end of data). Correct the line."),
        ("t,T1,T1\n0,1,2\n1,1,2\n", "bench.csv, channels.case: 2 columns have the name 'T1'. Rename all but one."),
    ],
)
def test_message(log, text, message):
    with pytest.raises(RecordError, match=re.escape(message) + r"\Z"):
        read_record(log(text), ANY)


@pytest.mark.parametrize(
    ("text", "arguments", "message"),
    [
        (
            "u,T1\n0,20\n1,21\n",
            {},
            "bench.csv: no time column found: none of u, T1 has one of the names time, time_s, t, t_s, timestamp, datetime, seconds. "
            "Give time='...' with the name of the column.",
        ),
        (
            "time_s,T1\n0,20\n1,21\n",
            {"time": "times_s"},
            "bench.csv, time: no column 'times_s'; there are time_s, T1. Did you mean 'time_s'?",
        ),
        ("t,T1_C\n0,20\n1,21\n", {}, "bench.csv, channels.case: no column 'T1'; there are t, T1_C. Did you mean 'T1_C'?"),
        (
            "t,T1\n0,20\n1,21\n",
            {"noise": {"cas": 0.1}},
            "bench.csv: noise is given for 'cas', which is not a channel. Channels: case. Did you mean 'case'?",
        ),
    ],
)
def test_unknown_name_offers_the_nearest(log, text, arguments, message):
    with pytest.raises(NameNotFoundError, match=re.escape(message) + r"\Z"):
        read_record(log(text), ANY, **arguments)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"clock": "%H:%M"}, "bench.csv:2, column 't': '0' does not have the form clock='%H:%M'"),
        ({"separator": "ab"}, "bench.csv: separator 'ab' is not a single character. Give ',' or ';' or '\\t'."),
        ({"decimal": "x"}, "bench.csv: decimal='x' is neither '.' nor ','."),
        ({"decimal": ","}, "bench.csv:2, column 'T1': '20.5' is not a number. Write"),
        ({"noise": {"case": "x"}}, "noise: 'x' must be a number with a unit"),
        ({"noise": {"case": 0}}, "channel 'case': its noise is 0; a finite number above zero is needed."),
        ({"accuracy": {"case": -1}}, "channel 'case': its accuracy is -1; a finite number not below zero is needed."),
        ({"noise": {"case": float("nan")}}, "bench.csv, column 'T1', noise: nan is not finite."),
        ({"noise": {"case": True}}, "bench.csv, column 'T1', noise: True is neither a number nor a text with a unit, such as '4 [K]'."),
    ],
)
def test_arguments(log, arguments, message):
    with pytest.raises(ThermidError, match=re.escape(message)):
        read_record(log("t,T1\n0,20.5\n1,21\n"), ANY, **arguments)


@pytest.mark.parametrize(
    ("channels", "message"),
    [
        ({}, "bench.csv: no channel is requested. Give channels={'node': 'column'}."),
        ({"T1": 3}, "bench.csv, channels.T1: 3 is neither the name of a column nor a table. Write 'column' or { column = 'column' }."),
        (
            {"T1": {"nod": "a"}},
            "bench.csv, channels.T1: no key 'nod'; there are column, node, boundary, load, command, prescribed, schedule, "
            "gain, full_scale, noise, accuracy, resolution, unit, prompt, samples, interpolation, power, gain_accuracy, "
            "gain_about, correlation_time, lag, lag_accuracy, capacitance, mass, specific_heat, lead, certificate, range. "
            "Did you mean 'node'?",
        ),
        ({"T1": {"node": "a", "boundary": "b"}}, "bench.csv, channels.T1: it has the roles node and boundary. Give a channel one role."),
        ({"T1": {"load": "a", "prompt": "yes"}}, "bench.csv, channels.T1: prompt = 'yes' is neither true nor false."),
        (
            {"T1": {"node": "a", "prompt": True}},
            "bench.csv, channels.T1: prompt states that a power or command was logged at every change, so it applies to a load or "
            "command only.",
        ),
        ({"T1": {"node": ""}}, "bench.csv, channels.T1: node = '' is not a text."),
        (
            {"T1": {"node": "a", "gain": "b"}},
            "bench.csv, channels.T1: a gain converts a command into a power, so it needs load = '...' or command = '...' too.",
        ),
        (
            {"T1": {"boundary": "a"}, "T2": {"boundary": "a"}},
            "record 'bench': channels 'T1' and 'T2' are both bound to boundary 'a'. "
            "Bind one of them. For several sensors on one node use the role 'node'.",
        ),
        (
            {"T1": {"load": "a", "unit": "W"}, "T2": {"command": "a"}},
            "record 'bench': channels 'T1' and 'T2' are both bound to load 'a'. "
            "Bind one of them. For several sensors on one node use the role 'node'.",
        ),
    ],
)
def test_bindings(log, channels, message):
    with pytest.raises(RecordError, match=re.escape(message) + r"\Z"):
        read_record(log("t,T1,T2\n0,20,1\n1,21,2\n"), channels)


def test_noise_given_twice(log):
    with raises_code("value.incomplete", RecordError, match="bench.csv.*channels.T1"):
        read_record(log("t,T1\n0,20\n1,21\n"), {"T1": {"node": "a", "noise": "1 [K]"}}, noise={"T1": "1 [K]"})


@pytest.mark.parametrize(
    ("header", "channel", "arguments", "message"),
    [
        ("T1 [W]", {"node": "a"}, {}, "bench.csv, column 'T1': '[W]' is a power; a temperature [degC] or [K] is needed here."),
        (
            "T1",
            {"load": "a", "unit": "degC"},
            {},
            "bench.csv, column 'T1': '[degC]' is a temperature difference; a power [W] is needed here.",
        ),
        ("T1 [grad]", {"node": "a"}, {}, "bench.csv, column 'T1': '[grad]' is a plain number; a temperature [degC] or [K] is needed here."),
        ("T1 [left]", {"node": "a"}, {}, "bench.csv, column 'T1': '[left]' is not a known unit."),
        (
            "T1",
            {"node": "a"},
            {"noise": {"T1": "0.3 [degC]"}},
            "bench.csv, column 'T1', noise: '[degC]' is a temperature in degC or degF; a temperature difference is needed here. "
            "Write it in [K].",
        ),
        (
            "T1",
            {"node": "a"},
            {"noise": {"T1": "0.3 [W]"}},
            "bench.csv, column 'T1', noise: '[W]' is a power; a temperature difference [K] is needed here.",
        ),
        (
            "T1",
            {"node": "a"},
            {"units": {"t": "K"}},
            "bench.csv, column 't': '[K]' is a temperature difference; a time [s] is needed here.",
        ),
    ],
)
def test_units(log, header, channel, arguments, message):
    with pytest.raises(UnitError, match=re.escape(message)):
        read_record(log(f"t,{header}\n0,20\n1,21\n"), {"T1": channel}, **arguments)


def test_unit_given_must_agree_with_the_header(log):
    path = log("t,T1 [K]\n0,20\n1,21\n")
    with raises_code("record.unit-contradicts", RecordError, match=r"\[K\].*'degC'"):
        read_record(path, {"T1": {"node": "a", "unit": "degC"}})
    named = log("t,T1 [left]\n0,20\n1,21\n")
    assert read_record(named, {"T1": {"node": "a"}}, units={"T1": "K"})["T1"].values.tolist() == [20, 21]


def test_times_in_minutes_are_not_read_as_seconds(log):
    with raises_code("record.time-unclear", RecordError, match="'min'"):
        read_record(log("t_min,T1\n0,20\n1,21\n"), ANY, time="t_min")
    assert read_record(log("t_ms,T1\n0,20\n500,21\n"), ANY).times.tolist() == [0, 0.5]


def test_missing_file(log):
    path = log("t,T1\n0,20\n1,21\n")
    with raises_code("record.log-missing", MissingDataError, match=r"'bench\.csv'"):
        read_record(path.with_name("benhc.csv"), ANY)
    with raises_code("record.log-missing", MissingDataError):
        read_record(path.parent / "x" / "bench.csv", ANY)
    with raises_code("file.not-a-file", RecordError):
        read_record(path.parent, ANY)


@pytest.mark.parametrize("data", [b"\x89PNG\r\n\x1a\n\0\0\0", b"t,T1\n0,20\n1,\x00\n", bytes(range(256))])
def test_binary_file(log, data):
    with raises_code("record.damaged", RecordError, match="bench.csv"):
        read_record(log(data), ANY)


def test_workbook(log):
    with raises_code("record.damaged", RecordError):
        read_record(log(b"PK\x03\x04\x14\0\x06\0"), ANY)


def test_damaged_gzip(log):
    whole = gzip.compress(b"t,T1\n0,20\n1,21\n" * 50)
    with raises_code("record.damaged", RecordError):
        read_record(log(whole[: len(whole) // 2]), ANY)


def test_readings_that_look_like_kelvin(log):
    path = log("t,T1\n0,295.1\n1,\n2,301\n")
    with raises_code("record.unit-unclear", RecordError, match="bench.csv.*'T1'.*295.1.*301.0"):
        read_record(path, {"T1": {"node": "a"}})
    assert read_record(path, {"T1": {"node": "a", "unit": "K"}})["T1"].values[0] == pytest.approx(295.1)
    assert read_record(path, {"T1": {"node": "a"}}, units={"T1": "degC"})["T1"].values[0] == pytest.approx(295.1 + 273.15)
    assert read_record(log("t,T1\n0,20\n1,301\n"), {"T1": {"node": "a"}})["T1"].values[1] == pytest.approx(301 + 273.15)


def test_times_that_look_like_days_of_a_spreadsheet(log):
    path = log("t,T1\n46083.375,20\n46083.3754,21\n46083.3758,22\n")
    with raises_code("record.time-unclear", RecordError, match=r"bench.csv:2.*'t'.*46083.4.*'s day \(2026-03-02 09:00\).*'.*\[d\]"):
        read_record(path, {"T1": {"node": "a"}})
    assert read_record(path, {"T1": {"node": "a"}}, units={"t": "d"}).times[-1] - 46083.375 * 86400 == pytest.approx(69.12, abs=1e-3)
    assert read_record(path, {"T1": {"node": "a"}}, units={"t": "s"}).times[-1] == 46083.3758
    assert read_record(log("t,T1\n46083,20\n46093,21\n"), {"T1": {"node": "a"}}).times[0] == 46083.0


def test_commas_as_separator_and_as_decimal_sign(log):
    with raises_code("record.layout-unclear", RecordError, match=r"bench\.csv:2.*4.*2"):
        read_record(log("t,T1\n0,0,20,5\n1,0,21,5\n2,0,22,5\n"), {"T1": {"node": "a"}})


def test_a_table_in_memory_is_no_log():
    with raises_code("value.wrong-kind", DeckError, match="path of a file"):
        td.read_record(np.array([20.0, 21.0]), {"T1": {"node": "a"}})


LABVIEW = "LabVIEW Measurement\t\nSeparator\tTab\nX_Columns\tOne\n***End_of_Header***\t\n"


@pytest.mark.parametrize("clock", ["99999999999999:00:00", "10:00:1e400", "10:00"])
def test_a_start_of_labview_that_cannot_be_is_left_out(log, clock):
    text = f"{LABVIEW}Date\t2024/03/05\nTime\t{clock}\n***End_of_Header***\t\nX_Value\tcase\n0\t21.5\n1\t21.6\n"
    cells = read_plain(log(text.encode(), "x.lvm")).cells
    assert (cells.start, cells.columns[1]) == (None, ("21.5", "21.6"))


def test_a_labview_file_that_dates_its_whole_alone_begins_there(log):
    head = LABVIEW.replace("***End", "Date\t2024/03/05\nTime\t09:58:00.25\n***End")
    text = f"{head}Channels\t1\n***End_of_Header***\t\nX_Value\tcase\n0\t21.5\n1\t21.6\n"
    assert read_plain(log(text.encode(), "x.lvm")).cells.start == "2024-03-05T09:58:00.250000"


def test_a_labview_file_that_ends_behind_a_header_is_refused(log):
    with raises_code("record.no-samples", RecordError):
        read_record(log(f"{LABVIEW}Channels\t1\n***End_of_Header***".encode(), "x.lvm"), {"case": "case"})
