"""Real log files from public repositories, read where they lie: ``THERMID_PUBLIC/OWNER/REPOSITORY/PATH``, each known by its SHA-256.

The expected values were written down from the raw files before the reader saw them. None of the files is part of this repository.
"""

from __future__ import annotations

import hashlib
import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from thermid.measure._readers.log_reader import read_record

ICE = 273.15
FIELD = "soilwater/example-projects-agron-845/Nathan_Hein_2019/Data"


@dataclass(frozen=True)
class Public:
    """One file: rows, first times and the last, and (first, last) readings of columns in SI."""

    file: str
    sha256: str
    rows: int
    times: tuple[float, float, float]
    expected: dict[str, tuple[float, float]]
    units: dict[str, str] = field(default_factory=dict)


HOBO_AMBIENT = Public(
    f"{FIELD}/Ambient_HNT_Field.csv",
    "75b2884a4fe34ea5bfff668db2d89f8499c392fa8637a4017b9da3ad4bdb621d",
    7526,
    (0, 300, 2238830),
    {"Temp": (27.265 + ICE, 26.946 + ICE), "RH": (0.59348, 0.15)},
)
HOBO_36 = Public(
    f"{FIELD}/Ch5-36C.csv",
    "a97baa23be671e0fb35faf7ca24d46c2dcf4263c424d9f5f5b4a75a73e4f8255",
    4517,
    (0, 900, 4063006),
    {"Temp": (21.680 + ICE, 23.429 + ICE)},
)
HOBO_28 = Public(
    f"{FIELD}/Ch6-28C.csv",
    "61e4b38ad779ddecb6c48edaf0695c0773d808f1fdada110ce5bb9cc562f9b7b",
    4517,
    (0, 900, 4063314),
    {"Temp": (22.373 + ICE, 23.597 + ICE)},
)
HOBO_YEAR_FIRST = Public(
    "gsc-permafrost/parseFiles/example_data/20750528-SHSC.SSM.SGT.240720_240913readout.csv",
    "0a7b65debb471622900da61b729cd960e5f76e8958600ca18c6f28f3a1ec563c",
    2640,
    (0, 1800, 4741254),
    {"Temp 5": (11.589 + ICE, 4.921 + ICE), "Temp 100": (-1.584 + ICE, -0.845 + ICE)},
)
TOA5 = Public(
    "gsc-permafrost/parseFiles/example_data/TOA5_BBS.FLUX_2023_08_01_1530.dat",
    "0e369582a872bf0a3afe77e5eff4cc8ab2b21ca299b53e05da03b4201b7ad259",
    18000,
    (0, 0.1, 1799.9),
    {"Ts": (26.94525 + ICE, 29.35068 + ICE), "press": (102182.4, 102093.6), "Ux": (1.016, 0.54425)},
)
PICOLOG = Public(
    "mattleung10/PicoLog_Thermocouple_Converter/sample/sample_June3.csv",
    "5efb9c421a6e3fb79c492458a9e05cdde9ea900ac59a4720f598ec651c0b4ef2",
    309,
    (0, 1, 308),
    {"Single-ended 12 Ave.": (0.029847, 0.029809), "Differential 15 - 16 Max.": (-0.000027, -0.000008)},
)
LVM_COMMENTS = Public(
    "ladisk/lvm_read/data/with_comments.lvm",
    "d9854d4462104416b4cbb2758f4a475cb0866c3185751ffe92d4ce60b53b596a",
    9,
    (0, 0.328878, 9.723275),
    {"Temperatura": (5.479238 + ICE, 5.407475 + ICE), "Pressão ABS.": (1.833787e6, 1.717152e6)},
)
LVM_NO_X = Public(
    "ladisk/lvm_read/data/short.lvm",
    "6f77c6b9d83d60e5123f211949a2b419785dd3f9760e1ff25312f1bf8b66cc7e",
    10,
    (0, 3.90625e-5, 3.515625e-4),
    {"Excitation (Trigger)": (0.914018, 0.680572), "Response (Trigger)": (1.204792, 1.212775)},
)
LVM_LONG = Public(
    "ladisk/lvm_read/data/long_single_header_multi_ch.lvm",
    "ab5674430fbd20e46f34cf1217defc98cd2e05558b8c7d785a435a2e5b3ddd76",
    16384,
    (0, 0.000977, 16.006191),
    {"m_1": (0.234571, 0.235689), "m_2": (0.244440, 0.263686)},
)
LVM_TWO_CLOCKS = Public(
    "ladisk/lvm_read/data/multi_time_column.lvm",
    "1a5a47a87d43cfb9b5e4a8fa36f02cf1dea407e5bf97900a12634fb0ea4fa697",
    3,
    (0, 1.953125e-5, 3.90625e-5),
    {"Voltage": (-0.035229, -0.034191)},
)
LVM_EMPTY = Public(
    "ladisk/lvm_read/data/with_empty_fields.lvm",
    "65271938f7b942a66b8da9bd8d34deafafdbe43fc399f5bb83ca982e40dbccbe",
    7,
    (0, 0.001, 0.006),
    {"Dev0/Ai0": (-0.011923, -0.020074), "Dev0/Ai2": (7.254639, 7.254639)},
    {"Dev0/Ai0": "V", "Dev0/Ai2": "V"},
)
FILES = [v for v in list(globals().values()) if isinstance(v, Public)]


def opened(public: Public) -> Path:
    folder = os.environ.get("THERMID_PUBLIC")
    if not folder:
        pytest.skip(f"THERMID_PUBLIC is not set; this test reads {public.file} there")
    path = Path(folder) / public.file
    if not path.is_file():
        pytest.skip(f"{public.file} is not below THERMID_PUBLIC")
    assert hashlib.sha256(path.read_bytes()).hexdigest() == public.sha256
    return path


@pytest.mark.parametrize("public", FILES, ids=[each.file.rpartition("/")[2] for each in FILES])
def test_real_log(public: Public) -> None:
    channels: dict[str, Any] = {name: {"node": name} if name.startswith(("T", "Temp")) else name for name in public.expected}
    record = read_record(opened(public), channels, units=public.units)
    assert record.origin.rows == public.rows
    assert [record.times[k] for k in (0, 1, -1)] == pytest.approx(public.times, abs=1e-9)
    for name, ends in public.expected.items():
        valid = record[name].values[record[name].valid]
        assert (valid[0], valid[-1]) == pytest.approx(ends, rel=1e-12, abs=1e-12), name


def test_at_least_ten_real_logs() -> None:
    assert len({each.sha256 for each in FILES}) >= 10
