"""Logs in every format that laboratories have: right times, values and units with no option, or refused with the remedy that works."""

from __future__ import annotations

import contextlib
import random
import sys
from pathlib import Path

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.base.errors import ThermidError
from thermid.measure._readers.formats import FORMATS, log_cells
from thermid.measure._readers.log_reader import read_record
from thermid.measure._record.record import Record

from .samples import SAMPLES, Sample


def made(make) -> Sample:
    try:
        return make()
    except ImportError as error:
        pytest.skip(f"not installed: {error.name}")


def read(path: Path, sample: Sample, **options: object) -> Record:
    channels = {name: sample.roles.get(name, {"node": name}) if "T" in name or name in sample.roles else name for name in sample.expected}
    channels = {name: dict(each) if isinstance(each, dict) else each for name, each in channels.items()}
    scale = options.pop("full_scale", None)
    for name, role in sample.roles.items():
        channels[name] = role | ({"full_scale": scale} if scale else {})
    return read_record(path, channels, **options)


@pytest.mark.parametrize("make", SAMPLES, ids=[make.__name__ for make in SAMPLES])
def test_right_times_values_and_units_with_no_option_or_refused_with_a_remedy_that_works(log, make):
    sample = made(make)
    if sample.needs:
        pytest.importorskip(sample.needs)
    path = log(sample.data, sample.file)
    if sample.refused:
        with pytest.raises(ThermidError, match=sample.refused):
            read(path, sample)
    record = read(path, sample, **sample.remedy)
    assert log_cells(path).layout.format == sample.format
    assert [record.times[k] for k in (0, 1, -1)] == pytest.approx(sample.times, abs=1e-6)
    if sample.start is not None:
        assert record.origin.start == sample.start
    for name, ends in sample.expected.items():
        valid = record[name].values[record[name].valid]
        assert (valid[0], valid[-1]) == pytest.approx(ends, abs=1e-9), name


def test_every_format_has_a_sample() -> None:
    heads = [made(make).data[:8192] for make in SAMPLES]
    shown = {next(each.name for each in FORMATS if each.recognised(head)) for head in heads}
    missing = {each.name for each in FORMATS} - shown
    assert not missing, f"add to tests/unit/measure/samples.py a log in: {', '.join(sorted(missing))}"


def test_thirty_logs_of_which_three_are_refused() -> None:
    samples = [make() for make in SAMPLES if make.__name__ not in ("tdms", "hdf5", "excel", "matlab_7_3", "old_excel")]
    assert len({make.__name__ for make in SAMPLES}) == len(SAMPLES) >= 30
    assert [sample.file for sample in samples if sample.refused] == ["dates.csv", "left.csv", "duty.csv"]
    assert all(sample.remedy for sample in samples if sample.refused)
    assert all(not sample.remedy for sample in samples if not sample.refused)


def test_every_sample_of_a_binary_format_is_refused_when_it_is_cut_short(log):
    for make in SAMPLES:
        sample = made(make)
        if sample.format in ("NI TDMS", "MATLAB", "HDF5", "netCDF classic", "workbook", "MATLAB 7.3"):
            with pytest.raises(ThermidError):
                read(log(sample.data[: len(sample.data) // 3], sample.file), sample)


def test_a_package_that_is_missing_is_named_with_its_extra(log, monkeypatch):
    monkeypatch.setitem(sys.modules, "nptdms", None)
    with raises_code("extra.not-installed", match="'npTDMS'"):
        read_record(log(b"TDSm" + bytes(40), "x.tdms"), {"a": "b"})


def test_a_matlab_object_is_refused_with_the_lines_that_save_it(log):
    from scipy.io.matlab import MatlabOpaque

    from thermid.measure._readers import binary

    held = {"ts": MatlabOpaque(np.zeros((), dtype=[("s0", "O")]))}
    with raises_code("record.layout-unclear", match=r"ts\.Time.*ts\.Data.*'log\.mat'"):
        binary.of_variables(held, "x.mat")


def test_the_page_has_the_table_of_the_formats() -> None:
    text = (Path(__file__).parents[3] / "docs" / "logs.md").read_text(encoding="utf-8")
    rows = [line.strip("| ").split(" | ") for line in text.partition("## Formats")[2].partition("\n\nBinary")[0].splitlines()[4:]]
    assert rows == [[each.name, each.known_by, each.needs or "-"] for each in FORMATS]
    extra = (Path(__file__).parents[3] / "pyproject.toml").read_text(encoding="utf-8").partition("readers = [")[2].partition("]")[0]
    assert {each.needs for each in FORMATS} - {""} == {name.strip('" ') for name in extra.split(",")}


@pytest.mark.parametrize("make", SAMPLES, ids=[make.__name__ for make in SAMPLES])
def test_a_damaged_file_is_read_or_refused_in_words(log, make):
    sample = made(make)
    if sample.needs:
        pytest.importorskip(sample.needs)
    rng = random.Random(sample.file)
    marks = (b",", b"\n", b'"', b"-127", b"abc", b"1e400", b"\xff")
    for count in (1, 3, 20):
        data = bytearray(sample.data)
        for _ in range(count):
            at = rng.randrange(len(data))
            data[at : at + rng.choice((0, 1, 1, 30))] = rng.choice(marks)
        path = log(bytes(data), sample.file)
        with contextlib.suppress(ThermidError):
            assert str(td.look(path)).startswith(sample.file)
