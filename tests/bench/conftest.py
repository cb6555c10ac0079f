"""What tests of the bench need: pyserial, and for the simulated ones simulator and firmware, built now where their packages are."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.fixture(autouse=True, scope="session")
def _serial() -> None:
    """Skip where no port can be opened."""
    pytest.importorskip("serial", reason="pyserial is not installed: thermid[log]")


@pytest.fixture(scope="session")
def tools() -> Path:
    """Folder of the simulator and the firmware."""
    if shutil.which("make") is None:
        pytest.skip("make is missing")
    done = subprocess.run(["make", "bench-tools"], cwd=ROOT, capture_output=True, text=True)
    if "is missing" in done.stderr:
        pytest.skip(done.stderr.strip().splitlines()[0])
    assert done.returncode == 0, done.stderr
    return ROOT / "build" / "bench"
