from __future__ import annotations

import gzip
import tempfile
from decimal import Decimal
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from thermid.base.errors import OutputError
from thermid.measure._readers.log_reader import read_record
from thermid.measure._record.record import Record

DIGITS = st.decimals(Decimal(-200), Decimal(2000), places=4)


@st.composite
def samples(draw: st.DrawFn) -> tuple[list[Decimal], list[list[Decimal | None]]]:
    """Times and columns of numbers with four decimals, some missing."""
    steps = draw(st.lists(st.decimals(Decimal("0.001"), Decimal(900), places=3), min_size=2, max_size=12))
    start = draw(st.decimals(Decimal(-5), Decimal(5), places=2))
    times = [start + sum(steps[:n], Decimal(0)) for n in range(len(steps))]
    column = st.lists(st.one_of(DIGITS, DIGITS, st.none()), min_size=len(times), max_size=len(times))
    columns = draw(st.lists(column.filter(_read_in_degrees), min_size=1, max_size=3))
    return times, columns


def _read_in_degrees(cells: list[Decimal | None]) -> bool:
    """Whether a column without a unit is read in degC: one that would be usual in kelvin is refused."""
    known = [cell for cell in cells if cell is not None]
    return bool(known) and not (min(known) >= 223 and max(known) <= 400)


@st.composite
def written(draw: st.DrawFn, times: list[Decimal], columns: list[list[Decimal | None]]) -> tuple[bytes, dict[str, str]]:
    """One way to write these samples, with the arguments that it needs."""
    separator, decimal = draw(st.sampled_from([(",", "."), (";", "."), (";", ","), ("\t", "."), ("\t", ",")]))
    missing = draw(st.sampled_from(["", "NaN", "nan", "NA"]))
    end = draw(st.sampled_from(["\n", "\r\n"]))
    forms = [lambda d: str(d), lambda d: f"{d:f}", lambda d: f"{d:+.6f}", lambda d: f"{d:.12e}", lambda d: f" {d:f} "]
    if decimal == ".":
        forms.append(lambda d: f'"{d:f}"')

    def cell(value: Decimal | None) -> str:
        return missing if value is None else draw(st.sampled_from(forms))(value).replace(".", decimal)

    lines = [separator.join(["time_s", *(f"T{n}" for n in range(len(columns)))])]
    for row, time in enumerate(times):
        lines.append(separator.join(map(cell, [time, *(column[row] for column in columns)])))
        lines += draw(st.lists(st.sampled_from(["", "# note, 1;2", "   "]), max_size=1))
    data = (draw(st.sampled_from(["", "\ufeff"])) + end.join(lines) + end).encode()
    return (gzip.compress(data) if draw(st.booleans()) else data), {"separator": separator, "decimal": decimal}


@settings(max_examples=75, deadline=None, derandomize=True)
@given(st.data())
def test_every_way_to_write_a_log_is_the_same_record(data):
    times, columns = data.draw(samples())
    text, arguments = data.draw(written(times, columns))
    channels = {f"T{n}": {"node": f"n{n}"} for n in range(len(columns))}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.csv"
        path.write_bytes(text)
        record = read_record(path, channels, **arguments)
        again = Path(folder) / "b.csv"
        record.to_csv(again)
        copy = read_record(again, channels)
    assert record.times.tolist() == [float(time) for time in times]
    for n, cells in enumerate(columns):
        expected = [np.nan if cell is None else float(cell) + 273.15 for cell in cells]
        assert np.array_equal(record[f"T{n}"].values, expected, equal_nan=True)
        assert np.array_equal(copy[f"T{n}"].values, expected, equal_nan=True)
        assert np.array_equal(copy[f"T{n}"].valid, record[f"T{n}"].valid)
    assert np.array_equal(copy.times, record.times)
    assert copy.origin.sha256 == record.origin.sha256


@settings(max_examples=50, deadline=None, derandomize=True)
@given(st.data())
def test_what_the_reader_finds_out_alone_is_right(data):
    times, columns = data.draw(samples())
    text, _ = data.draw(written(times, columns))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.csv"
        path.write_bytes(text)
        record = read_record(path, {"T0": {"node": "n"}})
    assert record.times.tolist() == [float(time) for time in times]
    expected = [np.nan if cell is None else float(cell) + 273.15 for cell in columns[0]]
    assert np.array_equal(record["T0"].values, expected, equal_nan=True)


@settings(max_examples=50, deadline=None, derandomize=True)
@given(st.lists(st.floats(1.0, 5000.0), min_size=2, max_size=20))
def test_synthetic_kelvins_come_back_bit_for_bit(values):
    record = Record.from_arrays("made", 0.1 * np.arange(len(values)), {"case": values}, unit="K")
    with tempfile.TemporaryDirectory() as folder:
        record.to_csv(Path(folder) / "made.csv")
        copy = read_record(Path(folder) / "made.csv", {"case": "case"})
    assert np.array_equal(copy["case"].values, values)
    assert np.array_equal(copy.times, record.times)
    assert copy.origin.sha256 == record.origin.sha256
    assert not copy.origin.synthetic


def test_masked_samples_are_written_empty():
    record = Record.from_arrays("made", [0, 1, 2], {"case": [300.0, 301, 302]}, unit="K").mask("case", 1, 1)
    with tempfile.TemporaryDirectory() as folder:
        record.to_csv(Path(folder) / "made.csv")
        assert (Path(folder) / "made.csv").read_text() == '"time [s]",case [K]\n0,300\n1,\n2,302\n'


def test_one_column_for_two_channels_is_written_under_their_names():
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.csv"
        path.write_text("t,T\n0,20\n1,21\n")
        record = read_record(path, {"case": "T", "skin": "T"})
        with pytest.raises(OutputError):
            record.to_csv(path)
        record.to_csv(path.with_name("b.csv"))
        assert path.with_name("b.csv").read_text() == '"t [s]",case [degC],skin [degC]\n0,20,20\n1,21,21\n'
