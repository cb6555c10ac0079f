"""Pressures and winds in time: sampled so finely that what follows from them is straight between samples; volumes that are vented."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thermid.errors import ScenarioError
from thermid.model.signal import Constant, Signal, Sine, Table
from thermid.physics.constants import ATMOSPHERE

__all__ = ["combined", "levels_of", "sampled", "shares", "stream", "vented"]

Array = NDArray[np.float64]

PARTS = 40
"""Samples put into each stretch of a pressure, equally spaced in its root. [-]"""
PERIODS = 200
"""Periods of a sine that are sampled. [-]"""


def sampled(pressure: Table | Sine) -> Table:
    """Return a pressure as a table whose root is straight between samples to within a thousandth of its change."""
    if isinstance(pressure, Sine):
        swing = np.linspace(0.0, PERIODS * pressure.period, PERIODS * PARTS + 1)
        return Table(swing, np.maximum(pressure.at(swing), 0.0))
    if pressure.hold:
        return pressure
    times, values = [np.asarray(pressure.times[:1])], [np.asarray(pressure.values[:1])]
    for (t0, t1), (p0, p1) in zip(_pairs(pressure.times), _pairs(pressure.values), strict=True):
        root = np.linspace(np.sqrt(p0), np.sqrt(p1), PARTS + 1)[1:]
        part = root**2
        times.append(t0 + (t1 - t0) * (part - p0) / (p1 - p0) if p1 != p0 else np.array([t1]))
        values.append(part if p1 != p0 else np.array([p1]))
    return Table(np.concatenate(times), np.concatenate(values))


LEVELS = 12
"""Streams between which a wind that changes is interpolated, denser where it is light: within 2 % of a blend at its own speed. [-]"""


def stream(wind: Signal, pressure: Signal) -> Table:
    """Return a wind in time, as fast as one at one atmosphere with its Reynolds number. [m/s]"""
    found = combined(lambda w, p: np.maximum(w * p / ATMOSPHERE, 0.0), wind, pressure)
    return Table(np.zeros(1), np.array([found.value]), hold=True) if isinstance(found, Constant) else found


def combined(law: Callable[..., Any], *given: Signal) -> Constant | Table:
    """Return what follows from several signals, sampled so finely that it is nearly straight between samples; jumps stay jumps.

    Parameters
    ----------
    law : callable      Values of the signals, each (times,) -> values (times,).
    given : Signal      What it follows from.
    """
    if all(isinstance(each, Constant) for each in given):
        return Constant(float(np.asarray(law(*(each.at(np.zeros(1)) for each in given))).ravel()[0]))
    knots = np.unique(np.concatenate([_instants(each) for each in given]))
    if all(isinstance(each, Constant) or (isinstance(each, Table) and each.hold) for each in given):
        return Table(knots, np.asarray(law(*(each.at(knots) for each in given))), hold=True)
    parts = PARTS if knots.size < 2000 else 4
    at = np.unique(np.concatenate([np.linspace(a, b, parts + 1) for a, b in _pairs(knots)])) if knots.size > 1 else knots
    jumps = np.concatenate([g.times[1:] for g in given if isinstance(g, Table) and g.hold] or [np.zeros(0)])
    at = np.union1d(at, jumps - 1e-6)  # a held value that jumps beside one that does not
    return Table(at, np.asarray(law(*(each.at(at) for each in given))))


def levels_of(given: Table) -> Array:
    """Return speeds from nothing to the fastest (levels,). [m/s]"""
    root = np.sqrt(given.values.max()) * np.linspace(0.0, 1.0, LEVELS) ** 1.5
    return np.asarray(root**2)


def shares(given: Table, levels: Array) -> list[Table]:
    """Return how much of each level a wind has in time; a laminar stream goes with the root of its speed. [-]"""
    root, at = np.sqrt(levels), np.sqrt(given.values)
    return [Table(given.times, np.interp(at, root, hat), given.hold) for hat in np.eye(levels.size)]


def _instants(given: Signal) -> Array:
    """Return times between which a signal is straight, or nearly so. [s]"""
    if isinstance(given, Table):
        return given.times
    return np.linspace(0.0, PERIODS * given.period, PERIODS * 4 + 1) if isinstance(given, Sine) else np.zeros(1)


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
    given = outside if isinstance(outside, Table) else Table(np.array([0.0, 1.0]), np.full(2, outside.value))
    # a stretch of constant slope has the exact solution below; fine steps keep straight lines between samples right to a thousandth
    tail = given.times[-1] + tau * np.concatenate((np.linspace(0.05, 3.0, 60), np.linspace(3.1, 25.0, 220)))
    knots = np.union1d(given.times[given.times >= 0.0], [0.0])
    fine = [np.linspace(a, b, max(2, min(400, int(np.ceil((b - a) / (0.05 * tau))) + 1))) for a, b in _pairs(knots)]
    times = np.unique(np.concatenate([*fine, knots, tail]))
    p, values = inside.value, [inside.value]
    for a, b in _pairs(times):
        start = float(given.at(np.array([a]))[0])
        end = start if given.hold else float(given.at(np.array([b]))[0])
        slope, h = (end - start) / (b - a), b - a
        settled = start - slope * tau  # of the particular solution at a
        p = settled + slope * h + (p - settled) * np.exp(-h / tau)
        values.append(float(p))
    return Table(times, np.maximum(np.array(values), 0.0))
