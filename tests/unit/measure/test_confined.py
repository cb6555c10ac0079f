"""Binary logs in a process of their own: what ends it, what it refuses, and that it ends with the one that asks."""

from __future__ import annotations

import io
import os
import signal
import subprocess
import sys
import zlib
from pathlib import Path

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.base.errors import RecordError
from thermid.measure._readers import confined
from thermid.measure._readers.log_reader import read_plain

CRASH = zlib.decompress(
    bytes.fromhex(
        "78daf3750cf171745230d53350f0750cd14dcbcc495508c8492c49cb2fcab55228c82fceacd051702e4a4d2c494d51c8cfb352f0cdcf53f0cb2f5330"
        "32563032b43236b03200320c8ccc18c8008c9ebe7c402a0288d98098034a83002b94cf08653302610990e604620d4c931c209400949680d20a0e20f3"
        "1388321f2217129f8c668709d42c53286d06a5cda1b405d88e063c76806826a81f42a07e08809b6f0735c71e4a3b40e80628cde008a55da0e2509ac1"
        "15ca87d20c6e60775810f02b23d41dd9507770c0ddc1e1000039292598"
    )
)
"""A file of MATLAB of 524 bytes over which scipy 1.17.1 ends with a segmentation fault."""


def matlab() -> bytes:
    from scipy.io import savemat

    out = io.BytesIO()
    savemat(out, {"time": np.arange(10.0), "T": np.arange(10.0) + 20.0})
    return out.getvalue()


def hdf5(folder: Path, how: str) -> Path:
    """A log whose temperatures stand in another file, which may be missing."""
    h5py = pytest.importorskip("h5py")
    (folder / "secret.txt").write_bytes(np.full(10, 36.6).tobytes())
    with h5py.File(folder / "log.h5", "w") as file:
        file["time"] = np.arange(10.0)
        file["U"] = np.arange(10.0)
        if how == "link":
            file["run/T"] = h5py.ExternalLink(str(folder / "secret.h5"), "T")
        elif how == "external":
            file.create_dataset("T", (10,), "f8", external=[(str(folder / "secret.txt"), 0, 80)])
        else:
            layout = h5py.VirtualLayout((10,), "f8")
            layout[:] = h5py.VirtualSource(folder / "missing.h5", "T", (10,))
            file.create_virtual_dataset("T", layout)
    return folder / "log.h5"


def test_a_library_that_ends_its_process_ends_not_this_one(tmp_path: Path) -> None:
    (tmp_path / "crash.mat").write_bytes(CRASH)
    (tmp_path / "log.mat").write_bytes(matlab())
    first = read_plain(tmp_path / "log.mat").cells
    with raises_code("record.damaged", match=r"crash\.mat"):
        read_plain(tmp_path / "crash.mat")
    again = read_plain(tmp_path / "log.mat").cells
    assert (first.header, first.columns) == (again.header, again.columns) == (("time", "T"), again.columns)


@pytest.mark.parametrize("how", ["external", "virtual", "link"])
def test_values_in_other_files_are_refused(tmp_path: Path, how: str) -> None:
    """A linked data set was left out without a word."""
    with raises_code("record.values-elsewhere", RecordError, match=f"T' is .*{how}"):
        read_plain(hdf5(tmp_path, how))


def test_memory_is_limited_and_a_cap_raises_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "log.mat").write_bytes(matlab())
    monkeypatch.setenv("THERMID_CAPS", "unpacked=100")
    with pytest.raises(RecordError, match="The cap 'unpacked' is 100"):
        read_plain(tmp_path / "log.mat")
    monkeypatch.delenv("THERMID_CAPS")
    assert len(read_plain(tmp_path / "log.mat").cells.lines) == 10


def test_a_reader_that_takes_too_long_is_given_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "log.mat").write_bytes(matlab())
    read_plain(tmp_path / "log.mat")
    process = confined._CHILD._process
    assert process is not None
    monkeypatch.setattr(confined, "READING_TIME_LIMIT", 0.5)
    os.kill(process.pid, signal.SIGSTOP)
    with raises_code("record.damaged", RecordError):
        read_plain(tmp_path / "log.mat")
    assert process.poll() is not None
    monkeypatch.undo()
    assert read_plain(tmp_path / "log.mat").cells.header == ("time", "T")


def test_the_process_ends_with_the_one_that_asks(tmp_path: Path) -> None:
    (tmp_path / "log.mat").write_bytes(matlab())
    program = (
        f"import sys; from thermid.measure.readers import read_plain; from {confined.__name__} import _CHILD; read_plain(sys.argv[1]);"
        "print(_CHILD._process.pid)"
    )
    for end in ("", "; import os; sys.stdout.flush(); os._exit(0)"):
        ran = subprocess.run([sys.executable, "-c", program + end, str(tmp_path / "log.mat")], capture_output=True, text=True, check=True)
        pid = int(ran.stdout)
        for _ in range(100):
            if not Path(f"/proc/{pid}/cmdline").exists() or not Path(f"/proc/{pid}/cmdline").read_bytes():
                break
            signal.sigtimedwait([], 0.05)
        else:
            raise AssertionError(f"process {pid} is still there")


def test_a_record_is_the_same_as_read_here(tmp_path: Path) -> None:
    from thermid.measure._readers.binary import matlab as here

    (tmp_path / "log.mat").write_bytes(matlab())
    assert read_plain(tmp_path / "log.mat").cells == here(matlab(), "log.mat", None)
    record = td.read_record(tmp_path / "log.mat", {"T": {"node": "case", "unit": "degC"}})
    assert record["T"].values[0] == pytest.approx(293.15)
