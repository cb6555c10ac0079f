"""Noise and steps of a channel as its own samples show them, for what nobody stated."""

from __future__ import annotations

from math import comb
from typing import Final

import numpy as np

from thermid.measure.record.channel import Channel, FloatArray
from thermid.units import unit

LEVELS: Final = 2
"""Samples a level must have on average for readings to count as ones of steps."""
ON_GRID: Final = 0.05
"""Part of a step by which the distance of two levels may miss a whole number of steps; one in ten may miss it by more, as spikes do."""
DIGITS: Final = 6
"""Decimals down to which the last digit of a constant reading is looked for."""
ORDERS: Final = (2, 4, 6)
"""Orders of the differences by which noise is told from what a signal does."""
SWITCHED: Final = 8
"""Samples a level of a power has on average from which it is switched between levels and does not scatter; fewer samples show no noise."""


def step_of(channel: Channel) -> float:
    """Return the smallest step of a sensor: as stated, or as its readings show it; zero where they show none. [SI]

    Readings that are all one number have the step of its last digit, in the unit of the file.
    """
    if channel.resolution is not None:
        return channel.resolution
    seen = channel.values[channel.valid]
    levels, count = np.unique(np.round(seen, 6), return_counts=True)
    if levels.size == 1 and channel.quantity == "temperature" and seen.size >= SWITCHED:
        return _last_digit(float(seen[0]), channel.unit)
    if not 1 < levels.size <= seen.size / LEVELS:
        return 0.0
    apart, weight = np.diff(levels), np.minimum(count[1:], count[:-1])
    # the lower quarter, because spikes leave wide gaps between levels, and fillers a few narrow ones
    for step in (float(np.quantile(apart, 0.25, method="lower")), float(apart.min())):
        away = np.abs(apart / step - np.round(apart / step))
        if step > 2e-6 and float(weight @ (away <= ON_GRID)) > 0.9 * float(weight.sum()):
            return step
    return 0.0


def _last_digit(value: float, text: str) -> float:
    """Return the step of the last decimal digit of a value in a unit; zero where it has more than six. [SI]"""
    of = unit(text)
    shown = (value - float(of.offset)) / float(of.factor)
    for digits in range(DIGITS + 1):
        if abs(shown * 10.0**digits - round(shown * 10.0**digits)) < 1e-6 * 10.0**digits:
            return float(of.factor) * 10.0**-digits
    return 0.0


def found_noise(channel: Channel) -> float:
    """Return the standard deviation of white noise that the samples of a channel show: how far each lies from its neighbours' course. [SI]

    Differences of order k of white noise have binomial(2 k, k) times its variance, and those of anything slow next to nothing, less the
    higher the order: the smallest of three estimates counts. The median size stands for the root mean square, so that jumps do not count. A
    power that is switched between few levels has no noise.
    """
    seen = channel.values[channel.valid]
    if seen.size < SWITCHED or (channel.quantity != "temperature" and np.unique(np.round(seen, 9)).size * SWITCHED <= seen.size):
        return 0.0
    sizes = [1.4826 * np.median(np.abs(np.diff(seen, k))) / np.sqrt(comb(2 * k, k)) for k in ORDERS if seen.size >= SWITCHED + k]
    return float(min(sizes, default=0.0))


def unrounded(times: FloatArray, values: FloatArray) -> FloatArray:
    """Return a slow signal behind readings in steps: straight lines between the middles of its changes.

    A reading changes where the signal passes the middle between two steps.
    """
    change = np.flatnonzero(np.diff(values))
    if not change.size:
        return values
    at = 0.5 * (times[change] + times[change + 1])
    return np.interp(times, at, 0.5 * (values[change] + values[change + 1]))
