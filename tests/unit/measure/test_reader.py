from __future__ import annotations

import gzip
import re
import subprocess
import sys
import time

import numpy as np
import pytest

from by_code import raises_code
from thermid.base.errors import RecordError
from thermid.measure._readers.log_reader import read_record
from thermid.measure._record.record import Record
from thermid.measure.readers import UNFINISHED

PLAIN = "time_s,T1,Q1\n0,20.5,50\n1,21.25,50\n2,22,0\n"
BOTH = {"T1": {"node": "h1.sensor"}, "Q1": {"load": "h1.heater", "gain": "h1.alpha"}}


def kelvin(record: Record, name: str = "T1") -> list[float]:
    return np.round(record[name].values, 9).tolist()


def test_target_to_column(log):
    record = read_record(log(PLAIN), {"case": "T1"}, noise={"case": "0.1 [K]"}, accuracy={"case": "0.5 [K]"})
    channel = record["case"]
    assert record.name == "bench"
    assert record.times.tolist() == [0, 1, 2]
    assert kelvin(record, "case") == [293.65, 294.4, 295.15]
    assert (channel.role, channel.target, channel.column, channel.quantity) == ("auto", "case", "T1", "temperature")
    assert (channel.noise, channel.accuracy) == (0.1, 0.5)


def test_column_to_table(log):
    table = {
        "T1": {"node": "h1.sensor", "noise": "0.3 [K]", "accuracy": "1 [K]", "resolution": "0.0625 [K]", "unit": "K"},
        "Q1": {"load": "h1.heater", "gain": "h1.alpha", "noise": "1 [%]"},
    }
    record = read_record(log(PLAIN), table, name="bench_1")
    assert record.name == "bench_1"
    assert record["T1"].values.tolist() == [20.5, 21.25, 22.0]
    assert (record["T1"].role, record["T1"].target, record["T1"].resolution) == ("node", "h1.sensor", 0.0625)
    # a load with a gain is in percent by default, and a percentage is a fraction in SI
    assert record["Q1"].values.tolist() == [0.5, 0.5, 0.0]
    assert (record["Q1"].quantity, record["Q1"].gain, record["Q1"].noise) == ("command", "h1.alpha", 0.01)


def test_default_units(log):
    text = "t,T,P,U\n0,20,5,40\n1,20,6,50\n"
    record = read_record(log(text), {"T": {"boundary": "room"}, "P": {"load": "box"}, "U": {"command": "heater"}})
    assert kelvin(record, "T") == [293.15, 293.15]
    assert record["P"].values.tolist() == [5, 6]
    assert record["U"].values.tolist() == [0.4, 0.5]
    assert [each.quantity for each in record.channels.values()] == ["temperature", "power", "command"]


@pytest.mark.parametrize(
    ("header", "unit", "expected", "quantity"),
    [("P [mW]", None, 0.02, "power"), ("P [hPa]", None, 2000.0, "pressure"), ("P", "degF", 266.4833333333333, "temperature")],
)
def test_unit_of_header_or_argument_tells_the_quantity(log, header, unit, expected, quantity):
    record = read_record(log(f"t,{header}\n0,20\n1,20\n"), {"x": "P"}, units={"x": unit} if unit else {})
    assert record["x"].values[0] == pytest.approx(expected, rel=1e-14)
    assert record["x"].quantity == quantity


def test_a_suffix_is_part_of_the_name(log):
    path = log("time_s,T1_C\n0,20\n1,21\n")
    assert kelvin(read_record(path, {"case": "T1_C"}), "case") == [293.15, 294.15]
    with raises_code("name.unknown", Exception, match="'T1'.*'T1_C'"):
        read_record(path, {"case": "T1"})


@pytest.mark.parametrize(
    "text",
    [
        PLAIN,
        PLAIN.replace(",", ";"),
        PLAIN.replace(",", "\t"),
        PLAIN.replace(",", ";").replace(".", ","),
        PLAIN.replace(",", "\t").replace(".", ","),
        PLAIN.replace("\n", "\r\n"),
        "\ufeff" + PLAIN,
        "# logger 7; v1,2\n\n" + PLAIN.replace("1,21", "# note\n\n1,21"),
        '"time_s","T1","Q1"\n"0","20.5","50"\n1,"21.25",50\n2,22,0\n',
        '"time_s","T1","Q1"\n0,"20,5",50\n1,"21,25",50\n2,22,0\n',
        "time_s , T1, Q1\n0 , 20.5, 50\n1 , 2.125e1, 50\n2, +22., 0\n",
        "time_s,T1,Q1\n0,20.5,50\n1,21.25,50\n2,22,0",
        PLAIN.replace(",", "\t").encode("utf-16"),
    ],
    ids="comma semicolon tab semicolon-comma tab-comma crlf bom comments quoted quoted-comma spaces no-end utf-16".split(),
)
def test_forms_of_one_log_are_one_record(log, text):
    plain = read_record(log(PLAIN, "plain.csv"), BOTH)
    data = text if isinstance(text, bytes) else text.encode()
    for each in (log(data), log(gzip.compress(data), "bench.csv.gz")):
        record = read_record(each, BOTH)
        assert record.origin.sha256 == plain.origin.sha256
        assert kelvin(record) == kelvin(plain)
        assert record.name == "bench"


def test_hash_is_of_all_numbers_and_not_of_what_is_asked_for(log):
    text = "time_s,T1,phase,Q1\n0,20.5,idle,50\n1,21.25,run,\n"
    one = read_record(log(text), {"case": "T1"})
    assert one.origin.sha256 == read_record(log(text), {"Q1": {"command": "y"}}).origin.sha256
    assert one.origin.sha256 == read_record(log(text.replace("idle", "boot")), {"case": "T1"}).origin.sha256
    for change in (("20.5", "20.6"), ("T1", "T2"), ("Q1", "Q2"), ("1,21.25", "2,21.25"), (",50", ",51")):
        other = read_record(log(text.replace(*change)), {"case": "T2" if change[0] == "T1" else "T1"})
        assert other.origin.sha256 != one.origin.sha256
    assert one.origin.columns == ("time_s", "T1", "phase", "Q1")
    assert (one.origin.file, one.origin.rows, one.origin.start, one.origin.synthetic) == ("bench.csv", 2, None, False)


def test_latin_1_degree_sign_is_read_and_noted(log):
    record = read_record(log("t;T [°C]\n0;20,5\n1;21\n".encode("latin-1")), {"case": "T"})
    assert kelvin(record, "case") == [293.65, 294.15]
    assert [bool(re.search(w, s)) for w, s in zip(("Latin-1, .*UTF-8", "','"), record.steps, strict=True)] == [True, True]


@pytest.mark.parametrize(
    ("stamps", "clock", "times"),
    [
        (["2024-03-30T23:59:59Z", "2024-03-31T00:00:00.500Z", "2024-03-31T02:00:01+02:00"], None, [0, 1.5, 2]),
        (["2024-03-30 23:59:59", "2024-03-31 00:00:01", "2024-03-31 00:01"], None, [0, 2, 61]),
        (["23:59:58", "23:59:59.5", "00:00:01"], None, [0, 1.5, 3]),
        (["00:00:00", "12:00:00", "23:59:59", "00:00:01", "23:00:00", "01:00:00"], None, [0, 43200, 86399, 86401, 169200, 176400]),
        (["22:00:00", "23:59:59", "24:00:01", "101:00:00"], None, [0, 7199, 7201, 284400]),
        (["24.12.2024 23:59", "25.12.2024 00:01"], "%d.%m.%Y %H:%M", [0, 120]),
        (["23:59", "00:01"], "%H:%M", [0, 120]),
        (["-0.5", "0", "1e1"], None, [-0.5, 0, 10]),
    ],
)
def test_times(log, stamps, clock, times):
    record = read_record(log("time;T\n" + "".join(f"{stamp};20\n" for stamp in stamps)), {"T": "T"}, clock=clock)
    assert record.times.tolist() == times
    assert record.origin.start == (None if stamps[0] == "-0.5" else stamps[0])


@pytest.mark.parametrize("name", ["min", "t_h", "elapsed_hours", "time_minutes", "hours", "t_days", "run time h"])
def test_a_time_column_named_by_minutes_or_hours_needs_its_unit(log, name):
    """`elapsed_hours` was read in seconds without a word, where `elapsed_h` was refused."""
    with raises_code("record.time-unclear"):
        read_record(log(f"{name},T\n0.0,20\n0.5,21\n1.0,22\n"), {"n": "T"}, time=name)


@pytest.mark.parametrize(
    ("name", "factor"), [("elapsed_ms", 1e-3), ("milliseconds", 1e-3), ("millis()", 1e-3), ("t_micros", 1e-6), ("microseconds", 1e-6)]
)
def test_a_time_column_named_by_parts_of_a_second_is_read_in_them(log, name, factor):
    assert read_record(log(f"{name},T\n0,20\n5000,21\n10000,22\n"), {"n": "T"}, time=name).times[-1] == pytest.approx(1e4 * factor)


@pytest.mark.parametrize("header", ["T ()", "T []"])
def test_an_empty_bracket_is_no_unit(log, header):
    """The usual unit is assumed then, and said to be; `millis()` of an Arduino was refused as a plain number."""
    record = read_record(log(f"millis(),{header}\n0,20\n5000,21\n"), {"n": "T"})
    assert record.times[-1] == pytest.approx(5.0)
    assert (record["n"].unit, record["n"].assumed) == ("degC", True)


def test_unit_of_the_time_column(log):
    assert read_record(log("time [min],T\n0,20\n1,20\n"), {"T": "T"}).times.tolist() == [0, 60]
    assert read_record(log("time_ms,T\n0,20\n500,20\n"), {"T": "T"}, time="time_ms", units={"time_ms": "ms"}).times.tolist() == [0, 0.5]


def test_missing_cells_are_masked(log):
    record = read_record(log("t,T\n0,20\n1,\n2,NaN\n3,nan\n4,NA\n5,n/a\n6, \n7,inf\n8,21\n"), {"T": "T"})
    assert record["T"].valid.tolist() == [True] + 7 * [False] + [True]
    assert record["T"].flags == {"not a number": 6, "infinite": 1}


def test_samples_of_one_stamp_become_one(log):
    text = "t,T,U\n0,20,10\n1,21,10\n1,23,90\n1,,\n2,24,20\n2,25,\n"
    record = read_record(log(text), {"T": {"node": "a"}, "U": {"command": "b"}})
    assert record.times.tolist() == [0, 1, 2]
    assert kelvin(record, "T") == [293.15, 295.15, 297.65]
    assert np.round(record["U"].values, 9).tolist() == [0.1, 0.9, 0.2]
    assert record.origin.rows == 6
    assert re.match("3 of 6 rows ", *record.steps)


@pytest.mark.parametrize("end", ["3,2", "3,22,", "3,22,5e-", "3"])
def test_a_cut_last_line(log, end):
    path = log(PLAIN.replace("2,22,0", "2,22.5,0.5") + end)
    record = read_record(path, BOTH)
    if end == "3,22,":  # all columns are there; the last sample is missing
        assert record.times.size == 4
        assert record["Q1"].flags == {"not a number": 1}
    else:
        assert record.times.tolist() == [0, 1, 2]
        assert re.match(rf"\w+ 5, .*{UNFINISHED}$", *record.steps)


@pytest.mark.parametrize(("cut", "dropped"), [((50,), "1 line with"), ((50, 51, 80), "3 lines with"), (range(50, 54), "")])
def test_a_few_lines_that_were_cut_are_dropped_with_one_remark_and_many_refused(log, cut, dropped):
    """A capture of a board that restarts: sixteen logs were edited by hand."""
    lines = [f"{k},{22 + 0.01 * k:.2f},0.5" if k not in cut else f"{k},2" for k in range(100)]
    path = log("\n".join([PLAIN.splitlines()[0], *lines]) + "\n")
    if not dropped:
        with raises_code("record.layout-unclear", RecordError, match="52.*2.*3"):
            read_record(path, BOTH)
        return
    record = read_record(path, BOTH)
    assert record.times.tolist() == [k for k in range(100) if k not in cut]
    (step,) = record.steps
    assert step.startswith(f"{dropped} ")
    assert "52" in step


def test_unnamed_index_column(log):
    assert kelvin(read_record(log(",t,T\n0,0,20\n1,1,21\n"), {"T": "T"}), "T") == [293.15, 294.15]


def test_explicit_arguments_decide(log):
    path = log("a;b,c\n0;1,5\n1;2,5\n")
    assert kelvin(read_record(path, {"x": "b,c"}, time="a", separator=";"), "x") == [274.65, 275.65]


def test_18000_rows_of_10_columns_within_half_a_second(log):
    rng = np.random.default_rng(7)
    samples = np.round(rng.normal(50, 10, (18000, 9)), 3)
    head = "time_s," + ",".join(f"c{i}" for i in range(9)) + "\n"
    path = log(head + "".join(f"{0.25 * i}," + ",".join(map(str, row)) + "\n" for i, row in enumerate(samples.tolist())))
    spent = []
    for _ in range(5):
        # time on the processor, so that a busy machine does not decide
        start = time.process_time()
        record = read_record(path, {f"c{i}": f"c{i}" for i in range(9)})
        spent.append(time.process_time() - start)
    assert np.array_equal(np.round(record["c8"].values - 273.15, 3), samples[:, 8])
    assert min(spent) < 0.5


def test_reading_loads_no_heavy_package(log):
    read = f"from thermid.measure.readers import read_record; read_record({str(log(PLAIN))!r}, {{'case': 'T1'}})"
    code = f"import sys; {read}; print(sorted(sys.modules))"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, env={"PYTHONPATH": ":".join(sys.path)})
    assert not {"'pandas'", "'scipy'", "'pint'", "'xarray'"} & set(found.stdout.strip("[]\n").split(", "))


def test_a_packed_file_that_would_fill_the_memory(tmp_path):
    path = tmp_path / "bomb.csv.gz"
    path.write_bytes(gzip.compress(bytes(300_000_000), 1))
    assert path.stat().st_size < 2_000_000
    with raises_code("cap.exceeded", RecordError, match=r"bomb\.csv\.gz.*200"):
        read_record(path, {"case": "T"})
