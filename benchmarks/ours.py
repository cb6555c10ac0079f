"""thermid on the same work, through its public names."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import network
import numpy as np
from contest import Answer, Attempt
from plain import Task

import thermid as td

NAME = "thermid"


def attempts(task: Task) -> Iterator[Attempt]:
    """Yield its default setting."""
    free = network.FREE_NONLINEAR if task.nonlinear else network.FREE_LINEAR
    simulator = td.prepare(network.model(task.nonlinear), network.scenario(task.noisy), free, every=task.every)

    def solve() -> Any:
        return simulator.run(sensitivities=task.sensitivities)

    def read(solution: Any) -> Answer:
        slopes = None
        if task.sensitivities:
            columns = [[solution.sensitivity(n, p) * simulator.nominal[p] for p in free] for n in network.NODES]
            slopes = np.array(columns).transpose(2, 0, 1)
        masses = np.column_stack([solution[n].kelvin for n in network.NODES])
        return Answer(masses, slopes, solution["interface"].kelvin)

    yield Attempt(NAME, "default", "default options", solve, read)


def further(task: Task) -> dict[str, Any]:
    """Return what else a user pays: preparation once, and one call of `simulate` from model to table of temperatures. [s]"""
    from contest import timed

    model, scenario = network.model(task.nonlinear), network.scenario(task.noisy)
    free = network.FREE_NONLINEAR if task.nonlinear else network.FREE_LINEAR
    simulator = td.prepare(model, scenario, free, every=task.every)
    solution = simulator.run(sensitivities=task.sensitivities)
    return {
        "prepare_seconds": min(timed(lambda: td.prepare(model, scenario, free, every=task.every))[0] for _ in range(5)),
        "simulate_seconds": min(timed(lambda: td.simulate(model, scenario, every=task.every).temperatures)[0] for _ in range(5)),
        "steps": solution.statistics["steps"],
        "statistics": {k: v for k, v in solution.statistics.items() if isinstance(v, int | float | str)},
    }
