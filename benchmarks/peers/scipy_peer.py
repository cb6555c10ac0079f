"""scipy: LSODA through `odeint` (compiled loop, analytic Jacobian, right-hand side in numpy), and `lsim` where the unit is linear."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from importlib.metadata import version as version_of
from typing import Any

import numpy as np
from contest import Answer, Attempt
from network import T0
from numpy.typing import NDArray
from plain import FREE, Plain, Task, by_log, plain

from . import forced, installed

Array = NDArray[Any]
NAME = "scipy"


def missing() -> str:
    """Return why it cannot run, or nothing."""
    return installed("scipy")


def version() -> str:
    """Return its version."""
    return version_of("scipy")


def attempts(task: Task) -> Iterator[Attempt]:
    """Yield its settings from cheap to tight."""
    if task.sensitivities:
        for limit, words in forced(4, 2, 1):
            yield Attempt("scipy odeint, variational equations", "forced", f"rtol 1e-6, {words}", _with_slopes(task, 1e-6, limit))
        return
    for tol in (1e-6, 1e-7, 1e-8, 1e-9):
        yield Attempt("scipy LSODA", "tolerance", f"rtol = atol = {tol:g}", _masses(task, tol, 0.0))
    for limit, words in forced(4, 2, 1):
        yield Attempt("scipy LSODA", "forced", f"rtol 1e-6, {words}", _masses(task, 1e-6, limit))
    if not task.nonlinear:
        yield Attempt("scipy lsim", "exact", "first-order hold on the samples", _lsim(task))


def fits(task: Task) -> Iterator[tuple[str, str, Callable[[Array], tuple[Array, None]]]]:
    """Yield name, setting and a function from log-parameters to temperatures; the derivatives are differences."""
    from scipy.integrate import odeint

    times, start = task.outputs, np.full(12, T0)
    for setting, tol, limit in (("rtol = atol = 1e-6", 1e-6, 0.0), ("rtol 1e-6, step at most 2 s", 1e-6, 2.0)):

        def evaluate(log: Array, tol: float = tol, limit: float = limit) -> tuple[Array, None]:
            rate, jacobian = right_hand_side(plain(task.nonlinear, log), task.samples)
            return odeint(rate, start, times, Dfun=jacobian, rtol=tol, atol=tol, hmax=limit, mxstep=10_000_000), None

        if task.every > 1:
            yield "scipy LSODA, finite differences", setting, evaluate


def members(task: Task) -> Iterator[tuple[str, str, int, Callable[[Array], Array]]]:
    """Yield name, setting, how many members, and a function from their log-parameters to temperatures (times, members, 12)."""
    from scipy.integrate import odeint

    start, times = np.full(12, T0), task.outputs

    def solve(logs: Array) -> Array:
        found = []
        for log in logs:
            rate, jacobian = right_hand_side(plain(task.nonlinear, log), task.samples)
            found.append(odeint(rate, start, times, Dfun=jacobian, rtol=1e-6, atol=1e-6, hmax=1.0, mxstep=10_000_000))
        return np.stack(found, axis=1)

    yield "scipy LSODA, one by one", "rtol 1e-6, step at most 1 s", 4, solve


def right_hand_side(unit: Plain, u: Array) -> tuple[Callable[..., Array], Callable[..., Array]]:
    """Return dT/dt [K/s] and its Jacobian [1/s] of (T, t), as few array operations as possible."""
    last = u.size - 2
    samples, slopes = u.tolist(), np.diff(u).tolist()
    matrix = -unit.conduction / unit.capacity[:, None]
    power, through, conv = unit.power / unit.capacity, unit.through / unit.capacity, unit.convection / unit.capacity
    rad, half = unit.radiation / unit.capacity, unit.exponent / 2
    ele, growth = power[1], unit.growth
    linear = not unit.exponent
    whole, gain = matrix - np.diag(conv), through + conv

    def room(t: float) -> float:
        k = min(int(t), last)
        return samples[k] + (t - k) * slopes[k]

    def rate(T: Array, t: float) -> Array:  # noqa: N803
        a = room(t)
        if linear:
            return power + gain * a + whole @ T
        d = T - a
        square = T * T
        out = power + through * a + matrix @ T - conv * d * (d * d + 1e-4) ** half - rad * (square * square - a**4)
        out[1] += ele * (np.exp(growth * (T[1] - T0)) - 1.0)
        return out

    def jacobian(T: Array, t: float) -> Array:  # noqa: N803
        return whole if linear else unit.slope(T, room(t)) / unit.capacity[:, None]

    return rate, jacobian


def _masses(task: Task, tol: float, limit: float) -> Callable[[], Answer]:
    from scipy.integrate import odeint

    rate, jacobian = right_hand_side(task.unit, task.samples)
    times, start = task.outputs, np.full(12, T0)
    return lambda: Answer(odeint(rate, start, times, Dfun=jacobian, rtol=tol, atol=tol, hmax=limit, mxstep=10_000_000))


def _with_slopes(task: Task, tol: float, limit: float) -> Callable[[], Answer]:
    from scipy.integrate import odeint

    unit, u = task.unit, task.samples
    rate, jacobian = right_hand_side(unit, u)
    by = by_log(task.nonlinear)
    grid = np.arange(u.size, dtype=float)

    def both(y: Array, t: float) -> Array:
        T, slopes = y[:12], y[12:].reshape(12, FREE)  # noqa: N806
        out = np.empty_like(y)
        out[:12] = rate(T, t)
        out[12:] = (jacobian(T, t) @ slopes + by(T, np.interp(t, grid, u)) / unit.capacity[:, None]).ravel()
        return out

    start = np.concatenate((np.full(12, T0), np.zeros(12 * FREE)))

    def solve() -> Answer:
        y = odeint(both, start, task.outputs, rtol=tol, atol=tol, hmax=limit, mxstep=10_000_000)
        return Answer(y[:, :12], y[:, 12:].reshape(-1, 12, FREE))

    return solve


def _lsim(task: Task) -> Callable[[], Answer]:
    from scipy.signal import StateSpace, lsim

    unit, u = task.unit, task.samples
    matrix = -(unit.conduction + np.diag(unit.convection)) / unit.capacity[:, None]
    gain = np.column_stack(((unit.through + unit.convection), unit.power)) / unit.capacity[:, None]
    system = StateSpace(matrix, gain, np.eye(12), np.zeros((12, 2)))
    times = np.arange(u.size, dtype=float)
    inputs = np.column_stack((u - T0, np.ones(u.size)))
    return lambda: Answer(T0 + lsim(system, inputs, times)[1][:: round(task.every)])
