"""Pressures and winds in time: sampled so finely that what follows from them is straight between samples; volumes that are vented."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from thermid.errors import ScenarioError
from thermid.model.laws.signal import Constant, Mixed, Signal, Sine, Table
from thermid.physics.constants import ATMOSPHERE

Array = NDArray[np.float64]

PARTS = 40
"""Samples put into each stretch of a pressure, equally spaced in its root. [-]"""


MARKS = ATMOSPHERE * (np.arange(1, 870) / 400.0) ** 3
"""Pressures at which one that changes is sampled, closer where it is low: the same ones wherever a run begins. [Pa]"""


def sampled(pressure: Signal, end: float) -> Table:
    """Return a pressure up to `end` [s] as a table whose root is straight between samples to within a thousandth of its change."""
    drawn = pressure.drawn(end)
    if isinstance(drawn, Table) and drawn.held:
        return drawn
    at = drawn.knots(0.0, end)
    level = np.maximum(drawn.at(at), 0.0)
    if isinstance(drawn, Sine):
        return Table(at, level)
    times, values = [at[:1]], [level[:1]]
    for (t0, t1), (p0, p1) in zip(_pairs(at), _pairs(level), strict=True):
        low, high = np.searchsorted(MARKS, [min(p0, p1), max(p0, p1)], side="right")
        part = MARKS[low:high] if p1 > p0 else MARKS[low:high][::-1]
        part = part[(part != p0) & (part != p1)]
        times += [t0 + (t1 - t0) * (part - p0) / (p1 - p0), np.array([t1])] if part.size else [np.array([t1])]
        values += [part, np.array([p1])] if part.size else [np.array([p1])]
    return Table(np.concatenate(times), np.concatenate(values))


LEVELS = 12
"""Streams between which a wind that changes is interpolated, denser where it is light: within 2 % of a blend at its own speed. [-]"""


def stream(wind: Signal, pressure: Signal, end: float) -> Table:
    """Return a wind up to `end` [s], as fast as one at one atmosphere with its Reynolds number. [m/s]"""
    thin = Mixed(Thinned(), (wind, pressure))
    if thin.held:
        steps = thin.drawn(end)
        return steps if isinstance(steps, Table) else Table(np.zeros(1), steps.at(np.zeros(1)), hold=True)
    parts = [given.drawn(end) for given in (wind, pressure)]
    knots = np.unique(np.concatenate([given.knots(0.0, end) for given in parts]))
    each = 1 if any(isinstance(given, Sine) for given in parts) else PARTS if knots.size < 2000 else 4
    at = np.unique(np.concatenate([np.linspace(a, b, each + 1) for a, b in _pairs(knots)])) if knots.size > 1 else knots
    return Table(at, thin.at(at))


@dataclass(frozen=True)
class Thinned:
    """A wind as fast as one at one atmosphere with its Reynolds number."""

    def __call__(self, wind: Array, pressure: Array) -> Array:
        """Return the speed (times,) from wind [m/s] and pressure [Pa]. [m/s]"""
        return np.maximum(wind * pressure / ATMOSPHERE, 0.0)


def levels_of(given: Table) -> Array:
    """Return speeds from nothing to the fastest (levels,). [m/s]"""
    root = np.sqrt(given.bounds[1]) * np.linspace(0.0, 1.0, LEVELS) ** 1.5
    return np.asarray(root**2)


def shares(given: Table, levels: Array) -> list[Table]:
    """Return how much of each level a wind has in time; a laminar stream goes with the root of its speed. [-]"""
    root = np.sqrt(levels)
    return [given.mapped(partial(_share, root, hat)) for hat in np.eye(levels.size)]


def _share(root: Array, hat: Array, speed: Array) -> Array:
    return np.interp(np.sqrt(speed), root, hat)


def _pairs(x: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> list[tuple[float, float]]:
    return list(zip(x[:-1].tolist(), x[1:].tolist(), strict=True))


def vented(inside: Signal, outside: Signal, time_constant: float, where: str) -> Signal:
    """Return the pressure of a volume that follows another: tau dp/dt = p_outside - p.

    Parameters
    ----------
    inside, outside : Signal    At the start, constant; and of the surroundings. [Pa]
    time_constant : float       [s]

    Raises
    ------
    ScenarioError   When the pressure at the start is no constant, or that outside swings without end.
    """
    if not isinstance(inside, Constant):
        raise ScenarioError("the pressure of a vented volume is that at its start, a constant.", where)
    if isinstance(outside, Sine):
        raise ScenarioError("a volume cannot be vented to a pressure that swings without end; give a table.", where)
    tau = time_constant
    last = max(outside.extent, 1.0)
    # a stretch of constant slope has the exact solution below; fine steps keep straight lines between samples right to a thousandth
    tail = last + tau * np.concatenate((np.linspace(0.05, 3.0, 60), np.linspace(3.1, 25.0, 220)))
    own = outside.knots(0.0, last)
    knots = np.union1d(own[own >= 0.0], [0.0, last])
    fine = [np.linspace(a, b, max(2, min(400, int(np.ceil((b - a) / (0.05 * tau))) + 1))) for a, b in _pairs(knots)]
    times = np.unique(np.concatenate([*fine, knots, tail]))
    p, values = inside.value, [inside.value]
    for a, b in _pairs(times):
        start = float(outside.at(np.array([a]))[0])
        end = start if outside.held else float(outside.at(np.array([b]))[0])
        slope, h = (end - start) / (b - a), b - a
        settled = start - slope * tau  # of the particular solution at a
        p = settled + slope * h + (p - settled) * np.exp(-h / tau)
        values.append(float(p))
    return Table(times, np.maximum(np.array(values), 0.0), after="hold")
