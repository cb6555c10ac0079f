from __future__ import annotations

import gzip
import re

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.base.errors import DeckError, MissingDataError, NameNotFoundError, RecordError, UnitError
from thermid.measure._readers.log_reader import read_plain, read_record
from thermid.measure.looks import look

ANY = {"case": "T1"}


@pytest.mark.parametrize(
    ("text", "code", "match"),
    [
        ("", "record.no-samples", r"bench\.csv"),
        (" \n\n", "record.no-samples", r"bench\.csv"),
        ("# a\n# b\n", "record.no-samples", r"bench\.csv"),
        ("time_s,T1\n", "record.no-samples", r"bench\.csv"),
        ("time_s,T1\n0,20\n", "record.too-short", r"bench\.csv"),
        ("0,20\n1,21\n", "record.layout-unclear", r"bench\.csv:1"),
        ("time_s T1\n0 20\n1 21\n", "record.layout-unclear", r"bench\.csv:1.*'time_s T1'"),
        (
            "a;b,c\n0;1,5\n1;2,5\n",
            "record.layout-unclear",
            r"bench\.csv.*2.*2.*separator=','",
        ),
        (
            "t;T1;T2\n0;1,5;20.5\n1;2,5;21\n",
            "record.number-unclear",
            r"bench\.csv.*'1,5'.*2.*'20\.5'.*2",
        ),
        (
            "t,T1,T2\n0,20,1\n1,21\n2,22,3\n3,23,4\n",
            "record.layout-unclear",
            r"bench\.csv:3.*2.*3.*'#'",
        ),
        (
            "t,T1,T2\n0,20,1\n# x\n\n1,21,2,9\n2,22,3\n3,22,3\n",
            "record.layout-unclear",
            r"bench\.csv:5.*4.*3.*'#'",
        ),
        (
            "t,T1\n0,20\n\n1,ERR\n2,22\n",
            "record.not-a-number",
            r"bench\.csv:4.*'T1'.*'ERR'.*decimal=','",
        ),
        (
            "t,T1\n0,20\n1,2_1\n2,22\n",
            "record.not-a-number",
            r"bench\.csv:3.*'T1'.*'2_1'.*decimal=','",
        ),
        (
            "t,T1\n0,20\n1,NA\n2,-\n3,1\n",
            "record.not-a-number",
            r"bench\.csv:4.*'T1'.*'-'.*decimal=','",
        ),
        (
            "t,T1\n0,\n1,NaN\n",
            "record.nothing-there",
            r"bench\.csv.*'T1'.*2.*2",
        ),
        (
            "t,T1\n0,20\n2,21\n1,22\n3,23\n",
            "record.time-order",
            r"bench\.csv:4.*'t'.*2.*1",
        ),
        (
            "time,T1\n10:00:00,20\n09:59:00,21\n",
            "record.time-order",
            r"bench\.csv:3.*'time'.*10:00:00.*09:59:00",
        ),
        ("t,T1\n0,20\n,21\n2,22\n", "record.time-not-read", r"bench\.csv:3.*'t'"),
        ("t,T1\n0,20\nx,21\n2,22\n", "record.time-not-read", r"bench\.csv:3.*'t'.*'x'"),
        ("t,T1\n0,20\ninf,21\n", "record.time-not-read", r"bench\.csv:3.*'t'.*'inf'"),
        ("t,T1\n0,20\n0,21\n", "record.too-short", r"bench\.csv.*2"),
        (
            "time,T1\nday 24 10:00,20\nday 24 10:01,21\n",
            "record.time-not-read",
            r"bench\.csv:2.*'time'.*'day 24 10:00'.*8601.*clock='%d\.%m\.%Y.*', '%H:%M' or '%M:%S'",
        ),
        (
            "time,T1\n10:00:00,20\n10:61:00,21\n",
            "record.time-not-read",
            r"bench\.csv:3.*'time'.*'10:61:00'",
        ),
        (
            "time,T1\n2024-01-01T00:00:00Z,20\n2024-01-01T00:00:01,21\n",
            "record.time-not-read",
            r"bench\.csv:3.*'time'.*'2024-01-01T00:00:01'",
        ),
        ("time,t,T1\n0,0,20\n1,1,21\n", "record.time-unclear", r"bench\.csv"),
        ('t,T1\n0,20\n1,"21\n2,22\n3,23\n', "record.layout-unclear", r"bench\.csv:3"),
        ("t,T1,T1\n0,1,2\n1,1,2\n", "record.name-twice", r"bench\.csv.*channels\.case.*2.*'T1'"),
    ],
)
def test_message(log, text, code, match):
    with raises_code(code, RecordError, match=match):
        read_record(log(text), ANY)


@pytest.mark.parametrize(
    ("text", "arguments", "code", "match"),
    [
        (
            "u,T1\n0,20\n1,21\n",
            {},
            "record.time-unclear",
            r"bench\.csv.*T1.*time_s.*t_s",
        ),
        (
            "time_s,T1\n0,20\n1,21\n",
            {"time": "times_s"},
            "name.unknown",
            r"bench\.csv.*'times_s'.*time_s.*T1.*'time_s'",
        ),
        ("t,T1_C\n0,20\n1,21\n", {}, "name.unknown", r"bench\.csv.*channels\.case.*'T1'.*T1_C.*'T1_C'"),
        (
            "t,T1\n0,20\n1,21\n",
            {"noise": {"cas": 0.1}},
            "name.unknown",
            r"bench\.csv.*'cas'.*'case'",
        ),
    ],
)
def test_unknown_name_offers_the_nearest(log, text, arguments, code, match):
    with raises_code(code, NameNotFoundError, match=match):
        read_record(log(text), ANY, **arguments)


@pytest.mark.parametrize(
    ("arguments", "code", "match"),
    [
        ({"clock": "%H:%M"}, "record.time-not-read", r"bench\.csv:2.*'t'.*'0'.*clock='%H:%M'"),
        ({"separator": "ab"}, "value.wrong-kind", r"bench\.csv.*'ab'.*','.*';'.*'\\t'"),
        ({"decimal": "x"}, "value.wrong-kind", r"bench\.csv.*decimal='x'.*'\.'.*','"),
        ({"decimal": ","}, "record.not-a-number", r"bench\.csv:2.*'T1'.*'20\.5'"),
        ({"noise": {"case": "x"}}, "value.wrong-kind", "'x'"),
        ({"noise": {"case": 0}}, "value.outside-range", "'case'.*0"),
        ({"accuracy": {"case": -1}}, "value.outside-range", "'case'.*-1"),
        ({"noise": {"case": float("nan")}}, "value.outside-range", r"bench\.csv.*'T1'"),
        ({"noise": {"case": True}}, "value.not-an-amount", r"bench\.csv.*'T1'.*'4 \[K\]'"),
    ],
)
def test_arguments(log, arguments, code, match):
    with raises_code(code, match=match):
        read_record(log("t,T1\n0,20.5\n1,21\n"), ANY, **arguments)


@pytest.mark.parametrize(
    ("channels", "code", "match"),
    [
        ({}, "value.incomplete", r"bench\.csv.*channels=\{'node'.*'column'"),
        ({"T1": 3}, "value.wrong-kind", r"bench\.csv.*channels\.T1.*3.*'column'.*'column'"),
        (
            {"T1": {"nod": "a"}},
            "name.unknown",
            r"bench\.csv.*channels\.T1.*'nod'.*'node'",
        ),
        ({"T1": {"node": "a", "boundary": "b"}}, "value.incomplete", r"bench\.csv.*channels\.T1"),
        ({"T1": {"load": "a", "prompt": "yes"}}, "value.wrong-kind", r"bench\.csv.*channels\.T1.*'yes'"),
        (
            {"T1": {"node": "a", "prompt": True}},
            "record.does-not-apply",
            r"bench\.csv.*channels\.T1",
        ),
        ({"T1": {"node": ""}}, "value.wrong-kind", r"bench\.csv.*channels\.T1.*''"),
        (
            {"T1": {"node": "a", "gain": "b"}},
            "value.incomplete",
            r"bench\.csv.*channels\.T1",
        ),
        (
            {"T1": {"boundary": "a"}, "T2": {"boundary": "a"}},
            "record.name-twice",
            "'bench'.*'T1'.*'T2'.*'a'.*'node'",
        ),
        (
            {"T1": {"load": "a", "unit": "W"}, "T2": {"command": "a"}},
            "record.name-twice",
            "'bench'.*'T1'.*'T2'.*'a'.*'node'",
        ),
    ],
)
def test_bindings(log, channels, code, match):
    with raises_code(code, RecordError, match=match):
        read_record(log("t,T1,T2\n0,20,1\n1,21,2\n"), channels)


def test_noise_given_twice(log):
    with raises_code("value.incomplete", RecordError, match="bench.csv.*channels.T1"):
        read_record(log("t,T1\n0,20\n1,21\n"), {"T1": {"node": "a", "noise": "1 [K]"}}, noise={"T1": "1 [K]"})


@pytest.mark.parametrize(
    ("header", "channel", "arguments", "code", "match"),
    [
        ("T1 [W]", {"node": "a"}, {}, "unit.wrong-dimension", r"bench\.csv.*'T1'.*'\[W\]'.*\[degC\].*\[K\]"),
        (
            "T1",
            {"load": "a", "unit": "degC"},
            {},
            "unit.wrong-dimension",
            r"bench\.csv.*'T1'.*'\[degC\]'.*\[W\]",
        ),
        ("T1 [grad]", {"node": "a"}, {}, "unit.wrong-dimension", r"bench\.csv.*'T1'.*'\[grad\]'.*\[degC\].*\[K\]"),
        ("T1 [left]", {"node": "a"}, {}, "unit.unknown", r"bench\.csv.*'T1'.*'\[left\]'"),
        (
            "T1",
            {"node": "a"},
            {"noise": {"T1": "0.3 [degC]"}},
            "unit.scale-for-difference",
            r"bench\.csv.*'T1'.*'\[degC\]'.*\[K\]",
        ),
        (
            "T1",
            {"node": "a"},
            {"noise": {"T1": "0.3 [W]"}},
            "unit.wrong-dimension",
            r"bench\.csv.*'T1'.*'\[W\]'.*\[K\]",
        ),
        (
            "T1",
            {"node": "a"},
            {"units": {"t": "K"}},
            "unit.wrong-dimension",
            r"bench\.csv.*'t'.*'\[K\]'.*\[s\]",
        ),
    ],
)
def test_units(log, header, channel, arguments, code, match):
    with raises_code(code, UnitError, match=match):
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


def test_a_line_that_a_transmission_broke_is_left_out_and_named(log):
    """A board's restart left one zero byte in a capture of hours, which was called a binary file."""
    rows = "".join(f"{k},{20 + k / 100}\n" for k in range(300))
    look_at = look(log(f"t,T1\n{rows}\x00t\nt,T1\n300,23\n".encode()))
    assert any(re.search(r"\b302\b", n) for n in look_at.cells.notes)
    assert look_at.columns[1].values.size == 301
    damaged = log(f"t,T1\n{rows}300,2\x014.5\n".encode())  # a sign in a number is no digit less
    assert not any(c.values[-1] == 24.5 for c in look(damaged).columns if c.values.size)


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
    with raises_code("value.wrong-kind", DeckError, match="read_record.*`path`"):
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
