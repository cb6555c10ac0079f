"""B1: the linear unit, a run at 1 s outputs, or a run with twenty sensitivities, all stored."""

from __future__ import annotations

from argparse import Namespace
from typing import Any

from plain import Task
from small import contest

PARTS = ("run", "sens")
TARGETS = {"run": 1.0e-3, "sens": 8e-3}


def run(options: Namespace) -> list[dict[str, Any]]:
    """Return the contests of the parts asked for."""
    parts = [options.part] if options.part else PARTS
    return [
        contest(Task("B1", part, False, True, 1.0, 3e-4, slope_limit=3e-4), options.peers, options.rounds, TARGETS[part]) | {"part": part}
        for part in parts
    ]
