"""What B1 and B2 share: a run, or a run with twenty sensitivities, of the unit of twelve masses."""

from __future__ import annotations

from typing import Any

import ours
import peers
from contest import choose, errors, is_right, race
from plain import Task
from reference import reference


def contest(task: Task, chosen: tuple[str, ...], rounds: int, target: float) -> dict[str, Any]:
    """Return the results of one task: `thermid` and every peer that is present, on their cheapest right settings, in turns.

    Parameters
    ----------
    task : Task
    chosen : tuple of str   Peers that may take part.
    rounds : int            Turns.
    target : float          What `thermid` is to reach on the machine of the project's design. [s]
    """
    right = reference(task)
    present, missing = peers.present(chosen)

    def judge(answer: Any) -> tuple[dict[str, float], bool]:
        found = errors(task, answer, right)
        return found, is_right(task, found)

    attempts = [*ours.attempts(task), *(a for module in present for a in module.attempts(task))]
    entries = list(choose(attempts, judge))
    race(entries, rounds)
    rows = [entry.result() for entry in entries]
    own = next(row for row in rows if row["name"] == ours.NAME)
    own |= ours.further(task) | {"target_seconds": target}
    for row in rows:
        row["ratio"] = row["cpu_seconds"] / own["cpu_seconds"]
    silent = {m.NAME: "has no sensitivities" for m in present if not any(a.name.startswith(m.NAME) for a in attempts)}
    return {
        "work": _words(task),
        "limits": {"temperature_K": task.limit} | ({"sensitivity_K": task.slope_limit} if task.sensitivities else {}),
        "reference_checked_K": right.checked,
        "results": rows,
        "missing": missing | silent,
        "versions": {m.NAME: m.version() for m in present},
    }


def _words(task: Task) -> str:
    room = "noisy" if task.noisy else "smooth"
    slopes = " with 20 sensitivities" if task.sensitivities else ""
    return f"{task.case}, {room} room, 5 h{slopes}, outputs every {task.every:g} s, all 13 nodes"
