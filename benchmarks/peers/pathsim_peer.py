"""PathSim: one ODE block with numpy right-hand side and analytic Jacobian, a source for the room, a scope at 60 s."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from importlib.metadata import version as version_of

import numpy as np
from contest import Answer, Attempt
from network import DURATION, T0
from plain import Task

from . import forced, installed
from .scipy_peer import right_hand_side

NAME = "PathSim"
EVERY = 60.0


def missing() -> str:
    """Return why it cannot run, or nothing."""
    return installed("pathsim")


def version() -> str:
    """Return its version."""
    return version_of("pathsim")


def attempts(task: Task) -> Iterator[Attempt]:
    """Yield its settings from cheap to tight; it has no sensitivities."""
    if task.sensitivities:
        return
    for tol in (1e-5, 1e-6):
        yield Attempt("PathSim ESDIRK43", "tolerance", f"rtol = atol = {tol:g}, 60 s outputs", _masses(task, "ESDIRK43", tol, None))
    for limit, words in forced(2, 1):
        yield Attempt("PathSim RKBS32", "forced", f"rtol 1e-6, {words}, 60 s outputs", _masses(task, "RKBS32", 1e-6, limit))


def _masses(task: Task, solver: str, tol: float, limit: float | None) -> Callable[[], Answer]:
    import pathsim.solvers
    from pathsim import Simulation
    from pathsim.blocks import ODE, Scope

    rate, jacobian = right_hand_side(task.unit, task.samples)
    stride = round(EVERY / task.every) if task.every < EVERY else 1

    def solve() -> Answer:
        # the block takes time itself, so that the room needs no connection
        block = ODE(lambda x, _, t: rate(x, t), np.full(12, T0), lambda x, _, t: jacobian(x, t))
        scope = Scope(sampling_period=max(EVERY, task.every))
        wires = _wires(block, scope)
        simulation = Simulation(
            [block, scope],
            wires,
            dt=1.0,
            dt_max=limit,
            Solver=getattr(pathsim.solvers, solver),
            tolerance_lte_abs=tol,
            tolerance_lte_rel=tol,
            log=False,
        )
        simulation.run(DURATION + 0.5)
        times, found = scope.read()
        wanted = task.outputs[::stride]
        at = np.searchsorted(np.asarray(times), wanted - 1e-6)
        return Answer(np.asarray(found).T[at], stride=stride)

    return solve


def _wires(block: object, scope: object) -> list[object]:
    from pathsim import Connection

    return [Connection(block[:12], scope[:12])]  # type: ignore[index]
