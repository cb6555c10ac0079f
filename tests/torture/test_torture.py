"""The short form of `make torture`: some hundred mutants of every kind, in a process of its own with a limit of memory."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

TESTS = Path(__file__).parents[1]


@pytest.mark.parametrize(("how", "seconds"), [("python", 4), ("commands", 4), ("calls", 3)])
def test_a_sample_of_mutants_ends_in_an_answer_or_an_error_of_the_library(how: str, seconds: int) -> None:
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "PYTHONPATH": str(TESTS)}
    command = [sys.executable, "-m", "torture.files", how, str(seconds), "1"]
    run = subprocess.run(command, capture_output=True, text=True, cwd=TESTS, env=environment, check=False)
    assert run.returncode == 0, run.stderr
    found = json.loads(run.stdout)
    assert found["findings"] == {}
    assert len(found["counts"]) >= 10
