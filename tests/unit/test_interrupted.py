"""Kills and full disks at every call that writes: each file is the old one or the new one, and the next run leaves no stray."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from collections import Counter
from pathlib import Path

import pytest

from unit.interrupted import JOBS, contents, judged, prepare, renew

HERE = Path(__file__).with_name("interrupted.py")
ENVIRONMENT = {**os.environ, "OMP_NUM_THREADS": "1", "PYTHONDONTWRITEBYTECODE": "1", "PYTHONHASHSEED": "0"}
SYSTEM_CALLS = "write,writev,pwrite64,fsync,rename,renameat,renameat2,unlink,unlinkat,mkdir,ftruncate,chmod,fchmodat"

pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="children are forked")


def disturbed(job: str, how: str, folder: Path, every: int) -> dict[str, object]:
    run = subprocess.run(
        [sys.executable, str(HERE), job, str(folder), how, str(every)], capture_output=True, text=True, env=ENVIRONMENT, check=False
    )
    assert run.returncode == 0, run.stderr
    found: dict[str, object] = json.loads(run.stdout.splitlines()[-1])
    return found


@pytest.mark.parametrize(("job", "how", "every"), [("decks", "kill", 7), ("plan", "full", 4), ("values", "kill", 3)])
def test_a_sample_of_kills_and_full_disks(job: str, how: str, every: int, tmp_path: Path) -> None:
    found = disturbed(job, how, tmp_path, every)
    assert found["runs"] >= 2  # type: ignore[operator]
    assert found["wrong"] == []


@pytest.mark.campaign
@pytest.mark.parametrize("how", ["kill", "full"])
@pytest.mark.parametrize("job", JOBS)
def test_every_call_that_writes(job: str, how: str, tmp_path: Path) -> None:
    found = disturbed(job, how, tmp_path, 1)
    assert found["runs"] == found["calls"]
    assert found["wrong"] == []


def run(job: str, folder: Path, *before: str) -> int:
    command = [*before, sys.executable, str(HERE), job, str(folder)]
    return subprocess.run(command, capture_output=True, env=ENVIRONMENT, check=False).returncode


@pytest.mark.campaign
@pytest.mark.skipif(shutil.which("strace") is None, reason="strace disturbs the calls of the system")
@pytest.mark.parametrize("how", ["signal=KILL", "error=ENOSPC"])
@pytest.mark.parametrize("job", JOBS)
def test_every_call_of_the_system(job: str, how: str, tmp_path: Path) -> None:
    """The same below Python: each single `write` of numpy, HDF5 and the interpreter, counted and disturbed by strace."""
    base, fresh = tmp_path / "base", tmp_path / "fresh"
    base.mkdir()
    prepare(base)
    assert run(job, base) == 0
    renew(base)
    shutil.copytree(base, fresh)
    log = tmp_path / "calls"
    assert run(job, fresh, "strace", "-f", "-qq", "-o", str(log), "-e", f"trace={SYSTEM_CALLS}") == 0
    calls = Counter(re.findall(r"^\d+ +(\w+)\(", log.read_text(), re.MULTILINE))
    old, new = contents(base), contents(fresh)
    wrong: list[str] = []
    for name, many in calls.items():
        if "ENOSPC" in how and name.startswith("unlink"):
            continue  # a full disk can always remove
        for at in range(1, many + 1):
            place = tmp_path / "place"
            shutil.copytree(base, place)
            run(job, place, "strace", "-f", "-qq", "-o", os.devnull, "-e", f"inject={name}:{how}:when={at}")
            left = contents(place)
            if run(job, place) != 0:
                wrong.append(f"{name} {at}: the next run failed")
            wrong += [f"{name} {at}: {each}" for each in judged(job, left, contents(place), old, new)]
            shutil.rmtree(place)
    assert sum(calls.values()) >= 5
    assert wrong == []
