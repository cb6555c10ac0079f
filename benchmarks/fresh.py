"""A contestant in a process of its own, so that its peak of memory is its own."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any


def as_installed(cache: str) -> dict[str, str]:
    """Return the environment of a process that reads compiled files, as an installed package has them; `cache` is where they go."""
    return {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"} | {"PYTHONPYCACHEPREFIX": cache}


def fresh(script: str, *words: object) -> dict[str, Any]:
    """Return what a script prints as JSON in its last line, run with some words in a process of its own."""
    command = [sys.executable, script, *map(str, words)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=os.environ)
    if done.returncode:
        raise RuntimeError(f"{' '.join(command[1:])} ended with {done.returncode}:\n{done.stderr[-2000:]}")
    return dict(json.loads(done.stdout.splitlines()[-1]))


def peak() -> float:
    """Return the most memory that this process has held. [MB]"""
    status = Path("/proc/self/status")
    if status.is_file():  # what getrusage says includes the parent's
        return next(float(line.split()[1]) for line in status.read_text(encoding="utf-8").splitlines() if line.startswith("VmHWM")) / 1e3
    import resource

    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (1e6 if sys.platform == "darwin" else 1e3)
