"""CasADi: CVODES on the expression graph (exact Jacobian, linear look-up of the room), and its own fixed steps in compiled C."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from importlib.metadata import version as version_of
from shutil import which
from typing import Any

import numpy as np
from contest import Answer, Attempt
from network import GAP, LINKS, NODES, T0
from numpy.typing import NDArray
from plain import FREE, Plain, Task

from . import forced, installed

Array = NDArray[Any]
Evaluate = Callable[[Array], tuple[Array, Array]]
NAME = "CasADi"


def missing() -> str:
    """Return why it cannot run, or nothing."""
    return installed("casadi")


def version() -> str:
    """Return its version."""
    return version_of("casadi")


def attempts(task: Task) -> Iterator[Attempt]:
    """Yield its settings from cheap to tight."""
    name = "CasADi CVODES"
    solve = _with_slopes if task.sensitivities else _masses
    for tol in (1e-6, 1e-8) if task.sensitivities else (1e-6, 1e-7, 1e-8, 1e-9):
        yield Attempt(name, "tolerance", f"reltol = abstol = {tol:g}", solve(task, {"reltol": tol, "abstol": tol}))
    plainly = {"reltol": 1e-6, "abstol": 1e-6, "linear_multistep_method": "adams", "nonlinear_solver_iteration": "functional"}
    for limit, words in forced(4, 2, 1):
        yield Attempt(name, "forced", f"Adams, reltol 1e-6, {words}", solve(task, plainly | {"max_step_size": limit}))
    for step in (4, 2, 1):
        yield Attempt("CasADi RK4", "fixed", f"steps of {step} s, {_how()}", _runge_kutta(task, step))


def fits(task: Task) -> Iterator[tuple[str, str, Evaluate]]:
    """Yield name, setting and a function from log-parameters to temperatures and their derivatives."""
    held = {"reltol": 1e-6, "abstol": 1e-6, "linear_multistep_method": "adams", "nonlinear_solver_iteration": "functional"}
    if task.every > 1:
        yield "CasADi CVODES, forward sensitivities", "step at most 2 s", _by_log(task, held | {"max_step_size": 2})
    yield "CasADi RK4, forward sensitivities", f"steps of 2 s, {_how()}", _marched_by_log(task, 2)


def members(task: Task) -> Iterator[tuple[str, str, int, Callable[[Array], Array]]]:
    """Yield name, setting, how many members, and a function from their log-parameters to temperatures (times, members, 12)."""
    import casadi as ca

    step, count = 2, 16
    grid, inputs = _grid(task, step)
    x, room, log = ca.SX.sym("x", 12), [ca.SX.sym(name) for name in "abc"], ca.SX.sym("log", FREE)
    one = ca.Function("one", [x, *room, log], [_stepped(task, step, x, room, log)], {"cse": True, **_compiler()})
    march = one.mapaccum(grid.size - 1)
    start = np.full(12, T0)

    def solve(logs: Array) -> Array:
        found = [np.array(march(start, *inputs, np.tile(row[:, None], grid.size - 1))).T for row in logs]
        return np.stack([_at_outputs(task, grid, np.vstack((start, rows))) for rows in found], axis=1)

    yield "CasADi RK4", f"steps of {step} s, {_how()}", count, solve


def _compiler() -> dict[str, Any]:
    return {"jit": True, "compiler": "shell", "jit_options": {"flags": ["-O3", "-march=native"]}} if which("gcc") else {}


def _how() -> str:
    return "compiled C" if _compiler() else "its virtual machine"


def heat(unit: Plain, T: Any, a: Any, log: Any = None) -> Any:  # noqa: N803
    """Return the expression of dT/dt (12,) at temperatures and a room; with `log` (20,), of a unit with those log-parameters. [K/s]"""
    import casadi as ca

    d = T - a
    convection, conduction, through = ca.DM(unit.convection), ca.sparsify(ca.DM(unit.conduction)), ca.DM(unit.through)
    if log is not None:
        convection = convection * ca.exp(log[: len(NODES)])
        conduction, through = _links(unit, log)
    out = ca.DM(unit.power) + through * a - conduction @ T
    if unit.exponent:
        out += -convection * d * (d * d + 1e-4) ** (unit.exponent / 2) - ca.DM(unit.radiation) * (T**4 - a**4)
        out[1] += unit.power[1] * (ca.exp(unit.growth * (T[1] - T0)) - 1)
    else:
        out += -convection * d
    return out / ca.DM(unit.capacity)


def _links(unit: Plain, log: Any) -> tuple[Any, Any]:
    """Return conduction and conductance through the interface with links multiplied by exp(log): those of `plain`, as expressions."""
    import casadi as ca

    g = [ca.exp(log[len(NODES) + k]) * value for k, (_, _, value) in enumerate(LINKS)]
    total = g[0] + g[1] + GAP
    k = ca.SX(ca.sparsify(ca.DM(unit.conduction)))
    pairs = [(0, 1, g[0] * g[1] / total)]
    pairs += [(NODES.index(a), NODES.index(b), value) for (a, b, _), value in zip(LINKS[2:], g[2:], strict=True)]
    for i, j, new in pairs:
        more = new + k[i, j]
        k[i, i] += more
        k[j, j] += more
        k[i, j] -= more
        k[j, i] -= more
    through = ca.SX.zeros(12)
    for row in (0, 1):
        through[row] = g[row] * GAP / total
        k[row, row] += through[row] - unit.through[row]
    return k, through


def equation(task: Task, with_log: bool) -> dict[str, Any]:
    """Return the differential equation as CasADi takes it; the room is looked up linearly in its samples."""
    import casadi as ca

    x, a, log = ca.SX.sym("x", 12), ca.SX.sym("a"), ca.SX.sym("log", FREE)
    arguments = [x, a, log] if with_log else [x, a]
    rate = ca.Function("rate", arguments, [heat(task.unit, x, a, log if with_log else None)], {"cse": True})
    t, masses, log_mx = ca.MX.sym("t"), ca.MX.sym("T", 12), ca.MX.sym("p", FREE)
    room = ca.interpolant("room", "linear", [np.arange(task.samples.size, dtype=float)], task.samples, {"lookup_mode": ["exact"]})
    found = {"x": masses, "t": t, "ode": rate(masses, room(t), *([log_mx] if with_log else []))}
    return found | ({"p": log_mx} if with_log else {})


def _masses(task: Task, options: dict[str, Any]) -> Callable[[], Answer]:
    import casadi as ca

    march = ca.integrator("march", "cvodes", equation(task, False), 0.0, task.outputs[1:], {"max_num_steps": 10_000_000, **options})
    start = np.full(12, T0)
    return lambda: Answer(np.vstack((start, np.array(march(x0=start)["xf"]).T)))


def forward(task: Task, options: dict[str, Any]) -> Any:
    """Return a function of the log-parameters: temperatures (12, times) and their derivatives, by CVODES' forward sensitivities."""
    import casadi as ca

    march = ca.integrator("march", "cvodes", equation(task, True), 0.0, task.outputs[1:], {"max_num_steps": 10_000_000, **options})
    log = ca.MX.sym("log", FREE)
    found = march(x0=np.full(12, T0), p=log)["xf"]
    slopes = ca.jacobian(found, log, {"helper_options": {"enable_reverse": False, "enable_jacobian": False}})
    return ca.Function("both", [log], [found, slopes])


def _by_log(task: Task, options: dict[str, Any]) -> Evaluate:
    both = forward(task, options)
    start = np.full(12, T0)

    def evaluate(log: Array) -> tuple[Array, Array]:
        masses, slopes = (np.array(part) for part in both(log))
        later = slopes.reshape(-1, 12, FREE)  # column by column: time by time
        return np.vstack((start, masses.T)), np.concatenate((np.zeros((1, 12, FREE)), later))

    return evaluate


def _with_slopes(task: Task, options: dict[str, Any]) -> Callable[[], Answer]:
    evaluate = _by_log(task, options)
    return lambda: Answer(*evaluate(np.zeros(FREE)))


def _runge_kutta(task: Task, step: int) -> Callable[[], Answer]:
    if task.sensitivities:
        evaluate = _marched_by_log(task, step)
        return lambda: Answer(*evaluate(np.zeros(FREE)))
    grid, inputs = _grid(task, step)
    march = _step(task, step).mapaccum(grid.size - 1)
    start = np.full(12, T0)
    return lambda: Answer(_at_outputs(task, grid, np.vstack((start, np.array(march(start, *inputs)).T))))


def _marched_by_log(task: Task, step: int) -> Evaluate:
    grid, inputs = _grid(task, step)
    march = _step_with_slopes(task, step).mapaccum(grid.size - 1)
    start = np.concatenate((np.full(12, T0), np.zeros(12 * FREE)))

    def evaluate(log: Array) -> tuple[Array, Array]:
        rows = np.vstack((start, np.array(march(start, *inputs, np.tile(log[:, None], grid.size - 1))).T))
        found = _at_outputs(task, grid, rows)
        return found[:, :12], found[:, 12:].reshape(-1, FREE, 12).transpose(0, 2, 1)

    return evaluate


def _grid(task: Task, step: int) -> tuple[Array, list[Array]]:
    """Return the times of the steps, and the room at the begin, middle and end of each."""
    u = task.samples
    grid = np.arange(0.0, u.size, step)
    middle = np.interp(grid[:-1] + step / 2, np.arange(u.size), u)
    return grid, [v[None] for v in (u[::step][:-1], middle, u[::step][1:])]


def _at_outputs(task: Task, grid: Array, found: Array) -> Array:
    if task.every % (grid[1] - grid[0]):
        return np.column_stack([np.interp(task.outputs, grid, column) for column in found.T])
    return found[:: round(task.every / (grid[1] - grid[0]))]


def _step(task: Task, step: int) -> Any:
    """Return one classical step as a compiled function of the masses and the room at its begin, middle and end."""
    import casadi as ca

    x, room = ca.SX.sym("x", 12), [ca.SX.sym(name) for name in "abc"]
    return ca.Function("one", [x, *room], [_stepped(task, step, x, room)], {"cse": True, **_compiler()})


def _step_with_slopes(task: Task, step: int) -> Any:
    """Return the same, of the masses and their 20 derivatives column by column."""
    import casadi as ca

    x, room, log, seeds = ca.SX.sym("x", 12), [ca.SX.sym(name) for name in "abc"], ca.SX.sym("log", FREE), ca.SX.sym("s", 12, FREE)
    last = _stepped(task, step, x, room, log)
    moved = ca.jtimes(last, ca.vertcat(x, log), ca.vertcat(seeds, ca.SX.eye(FREE)))
    every = ca.vertcat(last, ca.vec(moved))
    return ca.Function("one", [ca.vertcat(x, ca.vec(seeds)), *room, log], [every], {"cse": True, **_compiler()})


def _stepped(task: Task, step: int, x: Any, room: list[Any], log: Any = None) -> Any:
    unit, (a, m, b) = task.unit, room
    k1 = heat(unit, x, a, log)
    k2 = heat(unit, x + step / 2 * k1, m, log)
    k3 = heat(unit, x + step / 2 * k2, m, log)
    return x + step / 6 * (k1 + 2 * k2 + 2 * k3 + heat(unit, x + step * k3, b, log))
