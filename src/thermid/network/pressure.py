"""Pressures in time: a signal sampled so finely that its root is straight between samples, and that of a volume which is vented."""

from __future__ import annotations

import numpy as np

from thermid.errors import ScenarioError
from thermid.model.signal import Constant, Signal, Sine, Table

__all__ = ["sampled", "vented"]

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
