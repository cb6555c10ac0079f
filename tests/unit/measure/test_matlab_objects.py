"""`timeseries` objects of MATLAB: tables of names, classes and objects as files have them, and the originals of a public data set."""

from __future__ import annotations

import hashlib
import os
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from by_code import raises_code
from thermid.base.errors import RecordError
from thermid.measure._readers import binary, matlab_objects
from thermid.measure._readers.log_reader import read_record
from thermid.measure._readers.matlab_objects import objects_of, series_of

ORIGINAL = "TiagoPrata/TCLabSP/Simulink (MATLAB R2016a)/Resultados/Random/H1H2/ens_IdentificationH1H2_Random_01.mat"
SHA256 = "da4e04cd72e07ea0434b0c1af661e474d133900500bc25cb678667def560ab44"


def table(names: list[str], classes: list[int], objects: list[tuple[int, int]], blocks: list[list[tuple[int, int, int]]]) -> bytes:
    """The first cell of a subsystem; an object is its class and its block, a block rows of (name, kind, value)."""
    text = b"".join(n.encode() + b"\0" for n in names)
    text += b"\0" * (-len(text) % 8)
    regions = [
        np.array([[0, 0, 0, 0], *([0, c, 0, 0] for c in classes)], dtype="<u4").tobytes(),
        np.zeros(2, dtype="<u4").tobytes(),
        np.array([[0] * 6, *([c, 0, 0, 0, b, k] for k, (c, b) in enumerate(objects, 1))], dtype="<u4").tobytes(),
        b"",
    ]
    for block in [[], *blocks]:
        row = struct.pack("<I", len(block)) + b"".join(struct.pack("<III", *each) for each in block)
        regions[3] += row + b"\0" * (-len(row) % 8)
    ends = np.cumsum([40 + len(text), *map(len, regions)])
    return struct.pack("<II6I", 4, len(names), *map(int, [*ends, ends[-1]])) + b"\0" * 8 + text + b"".join(regions)


def reference(number: int, of: int) -> np.ndarray:
    """What stands for an object."""
    return np.array([[0xDD000000], [2], [1], [1], [number], [of]], dtype=np.uint32)


def test_an_object_within_an_object_is_opened() -> None:
    names = ["timeseries", "timemetadata", "TimeInfo", "Data_", "Start_", "on", "unit", "seconds"]
    info = [(5, 1, 1), (6, 2, 1), (7, 0, 8)]
    tables = matlab_objects._Subsystem.read(
        table(names, [1, 2], [(1, 1), (2, 2)], [[(3, 1, 0), (4, 1, 2)], info]),
        [None, None, reference(2, 2), np.array([[7.0]]), np.ones((3, 1))],
    )
    of, found = tables.fields(1)
    assert of == "timeseries"
    assert found["TimeInfo"] == {"Start_": np.array([[7.0]]), "on": True, "unit": "seconds"}
    assert found["Data_"].shape == (3, 1)


@pytest.mark.parametrize(
    ("info", "times"),
    [
        ({"Time_": np.array([[0.0], [2.0], [5.0]])}, [0.0, 2.0, 5.0]),
        (
            {"Time_": np.zeros((0, 0)), "Start_": np.array([[1.0]]), "Increment_": np.array([[0.5]]), "Length": np.array([[3.0]])},
            [1.0, 1.5, 2.0],
        ),
    ],
    ids=["times of their own", "start, increment and length"],
)
def test_times_as_matlab_stores_them(info: dict[str, Any], times: list[float]) -> None:
    found = series_of({"TimeInfo": info, "Data_": np.arange(6.0).reshape(3, 2)})
    assert found is not None
    np.testing.assert_array_equal(found["Time"], times)
    np.testing.assert_array_equal(found["Data"], [[0.0, 1.0], [2.0, 3.0], [4.0, 5.0]])


def test_an_object_without_numbers_over_time_is_no_series() -> None:
    assert series_of({"Rows": np.zeros(3)}) is None
    assert series_of({"TimeInfo": {"Time_": np.arange(4.0)}, "Data_": np.zeros((3, 1))}) is None


def test_series_of_two_clocks_are_refused_by_name() -> None:
    def series(times: list[float]) -> dict[str, Any]:
        return {"TimeInfo": {"Time_": np.array(times)}, "Data_": np.arange(3.0)[:, None]}

    with raises_code("record.times-differ", RecordError, match="'u'.*'y'"):
        binary._of_series({"u": series([0.0, 1.0, 2.0]), "y": series([0.0, 1.0, 3.0])}, "x.mat")


def test_a_file_that_is_cut_is_refused_with_the_lines_that_save_it(monkeypatch: pytest.MonkeyPatch) -> None:
    path = public()
    data = path.read_bytes()
    monkeypatch.setattr(matlab_objects, "_cells", lambda subsystem: [np.zeros(16, dtype=np.uint8)])
    with pytest.raises(RecordError, match=r"u1u2.*not known.*save\('log.mat'"):
        objects_of(data, path.name)


def public() -> Path:
    root = os.environ.get("THERMID_PUBLIC")
    path = Path(root or "") / ORIGINAL
    if not root or not path.is_file():
        pytest.skip(f"THERMID_PUBLIC has no {ORIGINAL}")
    assert hashlib.sha256(path.read_bytes()).hexdigest() == SHA256
    return path


def test_an_original_is_read_without_matlab() -> None:
    """Values printed by the author's own export, two decimals."""
    record = read_record(public(), {"y1y2_1": {"node": "a", "unit": "degC"}, "u1u2_1": {"load": "h", "full_scale": "1.23 [W]"}})
    assert record.times.size == 30801  # three samples of one stamp are one
    assert record["y1y2_1"].values[2] - 273.15 == pytest.approx(23.31, abs=0.005)
    assert record["u1u2_1"].values[-1] / 1.23 == pytest.approx(0.3856, abs=1e-4)
