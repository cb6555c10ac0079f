"""Tight references for B1 and B2, by means that share nothing with `thermid` or the peers.

B1 is linear and its room piecewise linear, so the matrix exponential of one sample carries it exactly from sample to sample. B2 goes
by the classical Runge-Kutta method in steps of a quarter of a sample, in which the room is a straight line: good to some 1e-9 K, the most
where a node crosses the room's temperature and its convection bends within 0.01 K. Sensitivities are the imaginary parts of runs with
parameters displaced by 1e-20 i: exact to rounding.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from network import T0
from numpy.typing import NDArray
from plain import FREE, Plain, Task, plain

Array = NDArray[Any]
HERE = Path(__file__).parent
STORE = HERE.parent / ".benchmarks"
FINER = 4
CHECKED = 600
"""Samples over which the reference is compared with scipy's DOP853, restarted at every sample."""


@dataclass(frozen=True, eq=False)
class Reference:
    """The right answer of a task.

    Parameters
    ----------
    masses : array (times, 12)              [K]
    interface : array (times,)              [K]
    sensitivities : array (times, 12, 20)   Empty where not asked for. [K per unit log-parameter]
    checked : float                         Largest difference from scipy on the sample grid in the first samples. [K]
    """

    masses: Array
    interface: Array
    sensitivities: Array
    checked: float


def reference(task: Task) -> Reference:
    """Return the right answer of a task, from the store when the same was computed before."""
    made_of = b"".join((HERE / name).read_bytes() for name in ("network.py", "plain.py", "reference.py"))
    path = STORE / f"{task.case}-{hashlib.sha256(made_of + repr(task).encode()).hexdigest()[:16]}.npz"
    if path.is_file():
        with np.load(path) as held:
            return Reference(held["masses"], held["interface"], held["sensitivities"], float(held["checked"]))
    found = _computed(task)
    path.parent.mkdir(exist_ok=True)
    np.savez(path, **vars(found))
    return found


def _computed(task: Task) -> Reference:
    u, stride = task.samples, round(task.every)
    exact = _runge_kutta if task.nonlinear else _exponential
    every = exact(task.unit, u, 1)
    checked = float(np.abs(_scipy(task.unit, u[: CHECKED + 1]) - every[: CHECKED + 1]).max())
    slopes = np.zeros((task.outputs.size, 12, 0))
    if task.sensitivities:
        displaced = exact(plain(task.nonlinear, 1e-20j * np.eye(FREE)), u, stride)
        slopes = np.moveaxis(displaced.imag / 1e-20, 1, 2)
    masses = every[::stride]
    return Reference(masses, task.unit.interface(masses, u[::stride]), slopes, checked)


def _runge_kutta(unit: Plain, u: Array, stride: int) -> Array:
    """Temperatures (samples / stride, ..., 12) by the classical method, `FINER` steps a sample."""
    h = 1.0 / FINER
    T = np.full(unit.through.shape, T0, unit.through.dtype)  # noqa: N806
    out = np.empty(((u.size - 1) // stride + 1, *T.shape), T.dtype)
    out[0] = T
    inverse = h / unit.capacity
    for n in range(u.size - 1):
        rise = (u[n + 1] - u[n]) * h
        for m in range(FINER):
            a = u[n] + m * rise
            k1 = unit.heat(T, a) * inverse
            k2 = unit.heat(T + 0.5 * k1, a + 0.5 * rise) * inverse
            k3 = unit.heat(T + 0.5 * k2, a + 0.5 * rise) * inverse
            T = T + (k1 + 2 * (k2 + k3) + unit.heat(T + k3, a + rise) * inverse) / 6  # noqa: N806
        if (n + 1) % stride == 0:
            out[(n + 1) // stride] = T
    return out


def _exponential(unit: Plain, u: Array, stride: int) -> Array:
    """Temperatures (samples / stride, ..., 12) by the exponential of one sample, input and its slope as further states."""
    from scipy.linalg import expm

    shape = unit.through.shape
    grown = np.zeros((*shape[:-1], 14, 14), unit.through.dtype)
    grown[..., :12, :12] = -(unit.conduction + unit.convection[..., None] * np.eye(12)) / unit.capacity[:, None]
    grown[..., :12, 12] = (unit.through + unit.convection) / unit.capacity
    grown[..., 12, 13] = 1.0
    step = expm(grown)
    # temperatures over the start, so that the power is a constant of the sum below
    lift = np.zeros((*shape[:-1], 13, 13), unit.through.dtype)
    lift[..., :12, :12] = grown[..., :12, :12]
    lift[..., :12, 12] = unit.power / unit.capacity
    constant = expm(lift)[..., :12, 12]
    T = np.zeros(shape, unit.through.dtype)  # noqa: N806
    out = np.empty(((u.size - 1) // stride + 1, *shape), T.dtype)
    out[0] = T0
    v = u - T0
    for n in range(u.size - 1):
        T = (step[..., :12, :12] @ T[..., None])[..., 0] + step[..., :12, 12] * v[n] + step[..., :12, 13] * (v[n + 1] - v[n]) + constant  # noqa: N806
        if (n + 1) % stride == 0:
            out[(n + 1) // stride] = T0 + T
    return out


def _scipy(unit: Plain, u: Array) -> Array:
    from scipy.integrate import solve_ivp

    out = np.empty((u.size, 12))
    out[0] = T0
    for n in range(u.size - 1):
        found = solve_ivp(
            lambda t, T, n=n: unit.heat(T, u[n] + t * (u[n + 1] - u[n])) / unit.capacity,  # noqa: N803
            (0.0, 1.0),
            out[n],
            "DOP853",
            rtol=3e-14,
            atol=1e-12,
        )
        out[n + 1] = found.y[:, -1]
    return out


def march(logs: Array, task: Task) -> Array:
    """Return the temperatures (times, units, 12) of several units with log-parameters (units, 20), as exactly as the reference. [K]"""
    exact = _runge_kutta if task.nonlinear else _exponential
    return exact(plain(task.nonlinear, logs), task.samples, round(task.every))
