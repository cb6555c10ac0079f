"""The unit of B1 and B2 as plain numbers, for the reference and the peers: twelve masses, the massless interface eliminated by hand.

Its heat flows are C dT/dt = Q(T) - K T + g u - c d (d^2 + 0.01^2)^((n)/2) - s (T^4 - u^4), with d = T - u and u the room; nothing of
`thermid` takes part.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from network import AREA, BETA, CAPACITANCE, DURATION, EMISSIVITY, FIXED, GAP, HTC, LINKS, NATURAL, NODES, POWER, T0, room
from numpy.typing import NDArray

Array = NDArray[Any]
STEFAN_BOLTZMANN = 5.670374419e-8
SMOOTH = 0.01
"""Difference below which |d|^n is smoothed. [K]"""
FREE = len(NODES) + len(LINKS)


@dataclass(frozen=True)
class Plain:
    """Numbers of the unit; `log` (..., 20) are logarithms of what convections and links are multiplied by.

    Parameters
    ----------
    capacity : array (12,)          [J/K]
    power : array (12,)             [W]
    conduction : array (..., 12, 12)    Between masses, with what leaves to the room through the interface on the diagonal. [W/K]
    through : array (..., 12)       Conductance to the room through the interface. [W/K]
    convection : array (..., 12)    Conductance to the room at a difference of 1 K. [W/K^(1+n)]
    radiation : array (12,)         [W/K^4]
    exponent : float                n: 0 for B1, 0.25 for B2. [-]
    growth : float                  Exponential growth of the power of Ele. [1/K]
    weights : array (..., 12)       Share of each mass in the interface's temperature; the room has the rest. [-]
    """

    capacity: Array
    power: Array
    conduction: Array
    through: Array
    convection: Array
    radiation: Array
    exponent: float
    growth: float
    weights: Array

    def heat(self, T: Array, u: Any) -> Array:  # noqa: N803
        """Net heat (..., 12) into the masses at temperatures (..., 12) [K] and a room [K]. [W]"""
        d = T - u
        out = self.power + self.through * u - (self.conduction @ T[..., None])[..., 0]
        if not self.exponent:
            return out - self.convection * d
        out = out - self.convection * d * (d * d + SMOOTH**2) ** (self.exponent / 2) - self.radiation * (T**4 - u**4)
        ele = self.power[1] * (np.exp(self.growth * (T[..., 1] - T0)) - 1)
        out[..., 1] += ele
        return out

    def slope(self, T: Array, u: float) -> Array:  # noqa: N803
        """Derivative (12, 12) of the heat with respect to the temperatures (12,). [W/K]"""
        d = T - u
        if not self.exponent:
            return -self.conduction - np.diag(self.convection)
        e, half = d * d + SMOOTH**2, self.exponent / 2
        own = self.convection * e**half * (1 + self.exponent * d * d / e) + 4 * self.radiation * T**3
        own[1] -= self.growth * self.power[1] * np.exp(self.growth * (T[1] - T0))
        return -self.conduction - np.diag(own)

    def interface(self, T: Array, u: Array) -> Array:  # noqa: N803
        """Temperature (times,) of the interface from those of the masses (times, 12) and the room (times,). [K]"""
        return T @ self.weights + (1 - self.weights.sum()) * u


def plain(nonlinear: bool, log: Array | None = None) -> Plain:
    """Return the unit with its convections and links multiplied by exp(log), shape (..., 20)."""
    factor = np.exp(np.zeros(FREE) if log is None else log)
    skin, link = factor[..., : len(NODES)], factor[..., len(NODES) :]
    g = [link[..., k] * value for k, (_, _, value) in enumerate(LINKS)]
    place = {n: k for k, n in enumerate(NODES)}
    total = g[0] + g[1] + GAP
    k = np.zeros((*total.shape, 12, 12), factor.dtype)
    through, weights = np.zeros((2, *total.shape, 12), factor.dtype)
    pairs = [("Proc", "Ele", g[0] * g[1] / total), *((a, b, g[n + 2]) for n, (a, b, _) in enumerate(LINKS[2:])), *FIXED]
    for a, b, value in pairs:
        i, j = place[a], place[b]
        k[..., i, i] += value
        k[..., j, j] += value
        k[..., i, j] -= value
        k[..., j, i] -= value
    for row, value in ((0, g[0]), (1, g[1])):
        through[..., row] = value * GAP / total
        weights[..., row] = value / total
        k[..., row, row] += through[..., row]
    area = np.array(AREA)
    return Plain(
        np.array(CAPACITANCE),
        np.array(POWER),
        k,
        through,
        skin * np.array(NATURAL if nonlinear else HTC) * area,
        np.array(EMISSIVITY) * STEFAN_BOLTZMANN * area if nonlinear else np.zeros(12),
        0.25 if nonlinear else 0.0,
        BETA if nonlinear else 0.0,
        weights,
    )


@dataclass(frozen=True, eq=False)
class Task:
    """What every contestant does.

    Parameters
    ----------
    case, part : str            As in ``run.py CASE --part PART``.
    nonlinear, noisy : bool     Which unit, which room.
    every : float               Interval of output. [s]
    limit : float               Largest error of a temperature that counts as right. [K]
    slope_limit : float         The same of a sensitivity. [K per unit log-parameter]
    """

    case: str
    part: str
    nonlinear: bool
    noisy: bool
    every: float
    limit: float
    slope_limit: float = 1e-4

    @property
    def sensitivities(self) -> bool:
        """Whether the derivatives with respect to the 20 log-parameters are wanted too."""
        return self.part == "sens"

    @cached_property
    def unit(self) -> Plain:
        """The unit at its nominal values."""
        return plain(self.nonlinear)

    @cached_property
    def samples(self) -> Array:
        """The room's temperature every second (18001,). [K]"""
        return room(self.noisy)

    @cached_property
    def outputs(self) -> Array:
        """Times of output. [s]"""
        return np.arange(0.0, DURATION + 1e-9, self.every)


def by_log(nonlinear: bool) -> Callable[[Array, float], Array]:
    """Return the derivative (12, 20) of the heat with respect to the log-parameters, as a function of temperatures (12,) and room. [W]"""
    displaced, unit = plain(nonlinear, 1e-20j * np.eye(FREE)), plain(nonlinear)
    links = displaced.conduction.imag[12:] / 1e-20
    through = displaced.through.imag[12:] / 1e-20

    def slope(T: Array, u: float) -> Array:  # noqa: N803
        d = T - u
        out = np.zeros((12, FREE))
        np.fill_diagonal(out, -unit.convection * d * (d * d + SMOOTH**2) ** (unit.exponent / 2))
        out[:, 12:] = (through * u - links @ T).T
        return out

    return slope
