"""B2: the nonlinear unit in a smooth and a noisy room, run, sensitivities at 60 s outputs, and the calibration of twenty parameters."""

from __future__ import annotations

from argparse import Namespace
from typing import Any

from plain import Task
from small import contest

PARTS = ("run", "sens", "calibrate")
TARGETS = {"run": 1.5e-3, "sens": 3.5e-3}


def run(options: Namespace) -> list[dict[str, Any]]:
    """Return the contests of the parts asked for."""
    found = []
    for part in [options.part] if options.part else PARTS:
        if part == "calibrate":
            from fits import calibrate

            found.append(calibrate(options) | {"part": part})
            continue
        for noisy in (True, False) if part == "run" else (True,):
            task = Task("B2", part, True, noisy, 1.0 if part == "run" else 60.0, 3e-4)
            found.append(
                contest(task, options.peers, options.rounds, TARGETS[part]) | {"part": part, "room": "noisy" if noisy else "smooth"}
            )
    return found
