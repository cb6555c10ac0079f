"""B6: the document's whole procedure. Nine models on four levels, logs of hours at 1 s, deck files to report page in one command."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from argparse import Namespace
from pathlib import Path
from typing import Any

from fresh import as_installed

STUDY = Path(__file__).parents[1] / "examples" / "sisnav"


def run(options: Namespace) -> list[dict[str, Any]]:
    """Return how long the report takes, everything computed anew; the logs are made beforehand."""
    runs = 1 if options.quick else 3
    with tempfile.TemporaryDirectory() as folder:
        data, results = Path(folder), Path(folder) / "results"
        subprocess.run([sys.executable, str(STUDY / "laboratory.py"), folder], check=True, capture_output=True)
        where = [str(STUDY / "campaign.toml"), "--data", folder]
        report = ["report", *where, "--results", str(results), "--to", str(data / "report.html"), "--fresh"]
        times = [_thermid(report, folder)[:2] for _ in range(runs + 1)][1:]  # the first writes compiled files
        said = json.loads(_thermid(["calibrate", *where, "--to", str(results), "--json"], folder)[2])
        page, logs = (data / "report.html").stat().st_size, sum(p.stat().st_size for p in (data / "logs").iterdir())
    verdicts = said["verdicts"]
    whole = next(v for v in verdicts if v["model"] == "m_Sd")
    row = {
        "name": "thermid",
        "setting": "thermid report campaign.toml --fresh",
        "seconds": min(t[0] for t in times),
        "cpu_seconds": min(t[1] for t in times),
        "runs": runs,
        "max_error_K": max(s["max_K"] for s in whole["sensors"].values()),
        "right": whole["passed"],
    }
    words = "error: largest of the full model at a reading of a log that no stage has seen, noise included; right: its verdict. "
    words += f"Logs of {logs / 1e6:.1f} MB read, page of {page / 1e6:.1f} MB written"
    section = {"work": "B6, examples/sisnav from decks and logs to the report, one command", "results": [row]}
    return [section | {"missing": {"every peer": "none has a procedure of levels to compare"}, "remarks": [words]}]


def _thermid(arguments: list[str], cache: str) -> tuple[float, float, str]:
    """Return wall and processor time of a command [s], and what it printed; 1 says that a verdict was not passed."""
    before, begun = os.times(), time.perf_counter()
    done = subprocess.run(
        [sys.executable, "-m", "thermid", *arguments], capture_output=True, text=True, check=False, env=as_installed(cache)
    )
    wall, after = time.perf_counter() - begun, os.times()
    if done.returncode not in (0, 1):
        raise RuntimeError(f"thermid {arguments[0]} ended with {done.returncode}:\n{done.stderr[-2000:]}")
    cpu = after.children_user + after.children_system - before.children_user - before.children_system
    return wall, cpu, done.stdout
