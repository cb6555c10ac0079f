"""Contestants and how they are measured: each on its cheapest right setting, then all in turns.

A contestant offers settings from cheap to tight, in several ways (``tolerance``: as asked by its own tolerances; ``forced``: held to the
sample grid by a step limit or by fixed steps). Of each way the first setting within the limit takes part; where none is, the most
accurate one does and is marked as not right.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from itertools import groupby
from typing import Any

import numpy as np
from numpy.typing import NDArray
from plain import Task
from reference import Reference

Array = NDArray[Any]
PATIENCE = 40.0
"""Time after which a contestant's further settings of one way are left out. [s]"""


@dataclass(frozen=True, eq=False)
class Answer:
    """What a contestant found.

    Parameters
    ----------
    masses : array (times, 12)              [K]
    sensitivities : array (times, 12, 20)   Where asked for. [K per unit log-parameter]
    interface : array (times,)              Where the contestant has it; else it follows from the masses. [K]
    stride : int                            Of the outputs asked for, every how many are here. [-]
    seconds : (float, float)                Wall and processor time where the contestant takes them itself. [s]
    """

    masses: Array
    sensitivities: Array | None = None
    interface: Array | None = None
    stride: int = 1
    seconds: tuple[float, float] | None = None


def _as_it_is(raw: Any) -> Any:
    return raw


@dataclass(frozen=True)
class Attempt:
    """One setting of a contestant: `solve` is timed, `read` makes an `Answer` of what it returns."""

    name: str
    way: str
    setting: str
    solve: Callable[[], Any]
    read: Callable[[Any], Answer] = _as_it_is


@dataclass
class Entry:
    """An attempt that takes part, its errors, and its times so far."""

    attempt: Attempt
    errors: dict[str, float]
    right: bool
    first: float
    wall: list[float] = field(default_factory=list)
    cpu: list[float] = field(default_factory=list)

    def result(self) -> dict[str, Any]:
        """Return the entry as a row of the report."""
        return {
            "name": self.attempt.name,
            "way": self.attempt.way,
            "setting": self.attempt.setting,
            "seconds": min(self.wall),
            "cpu_seconds": min(self.cpu),
            "median_seconds": statistics.median(self.wall),
            "runs": len(self.wall),
            "first_seconds": self.first,
            **self.errors,
            "right": self.right,
        }


def errors(task: Task, answer: Answer, right: Reference) -> dict[str, float]:
    """Return the largest differences from the reference: of all temperatures [K], and of sensitivities [K per unit log-parameter]."""
    at = slice(None, None, answer.stride)
    room = task.samples[:: round(task.every)][at]
    between = answer.interface if answer.interface is not None else task.unit.interface(answer.masses, room)
    out = {"max_error_K": max(float(np.abs(answer.masses - right.masses[at]).max()), float(np.abs(between - right.interface[at]).max()))}
    if task.sensitivities and answer.sensitivities is not None:
        out["max_error_sensitivity"] = float(np.abs(answer.sensitivities - right.sensitivities[at]).max())
    return out


def is_right(task: Task, found: dict[str, float]) -> bool:
    """Whether errors are within the limits; NaN is not."""
    within = found["max_error_K"] <= task.limit
    return within and (not task.sensitivities or found.get("max_error_sensitivity", np.inf) <= task.slope_limit)


def choose(attempts: Iterable[Attempt], judge: Callable[[Any], tuple[dict[str, float], bool]]) -> Iterator[Entry]:
    """Yield, for each way of a contestant, the cheapest setting that is right, or else the most accurate.

    Who is right by tolerance alone need not be forced.
    """
    enough: set[str] = set()
    for (name, way), settings in groupby(attempts, key=lambda a: (a.name, a.way)):
        library = name.split()[0]
        if way == "forced" and library in enough:
            continue
        best: Entry | None = None
        begun = time.perf_counter()
        for attempt in settings:
            first, _, raw = timed(attempt.solve)
            found, right = judge(attempt.read(raw))
            entry = Entry(attempt, found, right, first)
            if best is None or right or np.isnan(best.errors["max_error_K"]) or found["max_error_K"] < best.errors["max_error_K"]:
                best = entry
            if right or time.perf_counter() - begun > PATIENCE:
                break
        if best is not None:
            if best.right and way == "tolerance":
                enough.add(library)
            yield best


def timed(solve: Callable[[], Any]) -> tuple[float, float, Any]:
    """Return wall time, processor time and the answer of a call. [s]"""
    wall, cpu = time.perf_counter(), time.process_time()
    raw = solve()
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    own = getattr(raw, "seconds", None)
    return (*(own or (wall, cpu)), raw)


def race(entries: list[Entry], rounds: int = 15, most: float = 5.0) -> None:
    """Let the entries run in turns; one that has used up its share of time [s] stands aside after its third run."""
    for entry in entries:
        if entry.first < 0.5:
            entry.attempt.solve()
    for n in range(rounds):
        for entry in entries:
            if (n >= 3 and sum(entry.wall) > most) or (n >= 1 and sum(entry.wall) > 4 * most):
                continue
            for _ in range(5 if entry.first < 0.05 else 1):
                wall, cpu, _ = timed(entry.attempt.solve)
                entry.wall.append(wall)
                entry.cpu.append(cpu)
