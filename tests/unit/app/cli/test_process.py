"""The command line as a process of its own: entry points, pipes that close early, and Ctrl-C."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

COMMAND = [sys.executable, "-m", "thermid"]
ENVIRONMENT = {**os.environ, "OMP_NUM_THREADS": "1", "COLUMNS": "120", "NO_COLOR": "1"}


def run(*arguments: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run([*COMMAND, *map(str, arguments)], capture_output=True, text=True, env=ENVIRONMENT, timeout=120, check=False)


def test_help_names_every_command() -> None:
    said = run("--help")
    assert said.returncode == 0
    assert said.stderr == ""
    for command in ("check", "simulate", "calibrate", "report", "schema"):
        assert command in said.stdout
    options = run("simulate", "--help").stdout
    for option in ("--scenario", "--boundary", "--param", "--load", "--start", "--for", "--at", "--vacuum", "--as-printed", "--json"):
        assert option in options


def test_nothing_heavy_is_imported_for_help() -> None:
    code = (
        "import sys\nfrom thermid.app.cli import main\nsys.argv = ['thermid', '--help']\n"
        "try:\n    main()\nexcept SystemExit:\n    pass\n"
        "heavy = {'numpy', 'scipy', 'pandas', 'pydantic', 'pint', 'xarray', 'matplotlib'}\n"
        "print(sorted({m.partition('.')[0] for m in sys.modules} & heavy), file=sys.stderr)"
    )
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=ENVIRONMENT, timeout=60, check=False)
    assert said.stderr.strip() == "[]"


def test_exit_code_and_streams_of_a_refusal(accelerometer: Path) -> None:
    said = run("simulate", accelerometer, "--boundary", "air=24", "--for", "60", "--vacuum")
    assert said.returncode == 2
    assert said.stdout == ""
    assert "accelerometer.toml:15, surfaces.skin" in said.stderr
    assert "\x1b[" not in said.stderr
    assert "Traceback" not in said.stderr


@pytest.mark.parametrize("tail", [["schema", "deck"], ["simulate", "DECK", "--boundary", "air=24", "--for", "1 [h]"], ["--help"]])
def test_a_pipe_that_closes_early_is_no_traceback(tail: list[str], accelerometer: Path) -> None:
    arguments = [str(accelerometer) if a == "DECK" else a for a in tail]
    with subprocess.Popen([*COMMAND, *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=ENVIRONMENT) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.close()  # as `| head -0` does, before anything is written
        errors = process.stderr.read().decode()
        process.wait(timeout=60)
    assert "Traceback" not in errors
    assert "BrokenPipe" not in errors
    assert "Exception ignored" not in errors


def test_ctrl_c_is_no_traceback(made: Path, tmp_path: Path) -> None:
    # the stage is stopped at its first notice, so that the signal comes while a fit runs
    code = (
        # a process started in the background of a script ignores the interrupt key; one at a terminal does not
        "import os, sys, signal\nsignal.signal(signal.SIGINT, signal.default_int_handler)\nimport thermid.app.cli as app\n"
        "from thermid.app.cli.summary import CampaignProgress\n"
        "def stop(self, stage, count, rms):\n    os.kill(os.getpid(), signal.SIGINT)\n"
        "CampaignProgress.__call__ = stop\n"
        f"sys.argv = ['thermid', 'calibrate', {str(made)!r}, '--fresh', '--to', {str(tmp_path)!r}]\napp.main()"
    )
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=ENVIRONMENT, timeout=120, check=False)
    assert said.returncode == 130
    assert "Traceback" not in said.stderr
    assert len([line for line in said.stderr.splitlines() if line.strip()]) == 2  # one at the key, one at the end
    assert said.stdout == ""
