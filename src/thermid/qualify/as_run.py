"""What a log shows of how its test was made: whether it covers the test and reached the levels, whether sensors were exchanged."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from thermid.judge.overlay import Overlay
from thermid.measure import Record
from thermid.measure.amounts import duration_text
from thermid.physics.constants import ICE_POINT
from thermid.simulation.solution import Solution

__all__ = ["LEVEL", "exchanged", "not_covered", "not_reached"]

Array = NDArray[np.float64]
Window = tuple[float, float]
LEVEL = 3.0
"""How far a test's temperature may be off its level: SMC-S-016, 4.7 (read). [K]"""
MISSING = 0.02
"""Share of a test without readings from which it counts as not covered. [-]"""
GAP = 5.0
"""A pause is a gap from so many usual intervals on."""
THERE = 0.9
"""Share of the planned time at a level that must have been spent there. [-]"""
CLEAR = 1.0
"""Deviation from which it is asked whether two sensors were exchanged. [K]"""


def not_covered(seen: Sequence[Overlay], begin: float, end: float, windows: Sequence[Window] = ()) -> Iterator[str]:
    """Yield which part of a test, or of a settled stretch of it, no valid reading covers; sensors with the same lack together.

    Parameters
    ----------
    seen : sequence of Overlay  Readings that count.
    begin, end : float          Of the test as it is simulated. [s]
    windows : sequence          Settled stretches. [s]
    """
    lacks: dict[str, list[str]] = {}
    for o in seen:
        missing, longest, at = _missing(o.times, begin, end)
        if missing > MISSING * (end - begin):
            text = f"for {duration_text(missing)} of {duration_text(end - begin)}; the longest gap, {duration_text(longest)}, is at "
            lacks.setdefault(f"{text}{at / 3600.0:.2f} h", []).append(o.sensor)
        for a, b in windows:
            lost, _, _ = _missing(o.times, a, b)
            if lost > (1.0 - THERE) * (b - a):
                text = f"for {duration_text(lost)} of the settled stretch {a / 3600.0:.4g} .. {b / 3600.0:.4g} h"
                lacks.setdefault(text, []).append(o.sensor)
    for text, sensors in lacks.items():
        yield f"there is no reading of {', '.join(sensors)} {text}"


def _missing(times: Array, begin: float, end: float) -> tuple[float, float, float]:
    """Return the time without readings between two instants, the longest gap and its begin. [s]"""
    inside = times[(times >= begin) & (times <= end)]
    if inside.size < 2:
        return end - begin, end - begin, begin
    usual = float(np.median(np.diff(inside)))
    points = np.concatenate([[begin], inside, [end]])
    gaps = [(b - a, a) for a, b in pairwise(points.tolist()) if b - a > GAP * usual]
    longest, at = max(gaps, default=(0.0, begin))
    return float(sum(g for g, _ in gaps)), float(longest), float(at)


def not_reached(record: Record, planned: Solution, boundaries: Mapping[str, str], tolerance: float = LEVEL) -> Iterator[str]:
    """Yield which planned level of a boundary the log does not show, on either side.

    What counts is the time spent within the tolerance of the planned extreme, or beyond it.

    Parameters
    ----------
    record : Record         The log.
    planned : Solution      The test as it was planned.
    boundaries : dict       Column -> boundary that it drives.
    tolerance : float       [K]
    """
    for column, boundary in boundaries.items():
        channel, trace = record[column], planned[boundary]
        times, values = record.times[channel.valid], channel.values[channel.valid]
        inside = times <= trace.times[-1]
        for word, sign in (("hot", 1.0), ("cold", -1.0)):
            level = float((sign * trace.kelvin).max())
            wanted = _time_above(trace.times, sign * trace.kelvin, level - tolerance)
            found = _time_above(times[inside], sign * values[inside], level - tolerance)
            if found < THERE * wanted:
                furthest = sign * float((sign * values).max()) - ICE_POINT
                yield (
                    f"the {word} level of '{boundary}', {sign * level - ICE_POINT:.1f} degC for {duration_text(wanted)}, was not applied: "
                    f"{column} goes to {furthest:.1f} degC and is within {tolerance:g} K of it for {duration_text(found)}"
                )


def _time_above(times: Array, values: Array, level: float) -> float:
    """Return how long a trace is at or above a level, by the nearer of its samples. [s]"""
    if times.size < 2:
        return 0.0
    width = np.gradient(times)
    width[[0, -1]] *= 0.5
    return float(width[values >= level].sum())


def exchanged(seen: Sequence[Overlay]) -> Iterator[str]:
    """Yield pairs of sensors whose readings fit far better when they change places."""
    for k, a in enumerate(seen):
        for b in seen[k + 1 :]:
            if a.times.size != b.times.size or not np.array_equal(a.times, b.times):
                continue
            own = float(np.sqrt(np.mean((a.measured - a.simulated) ** 2 + (b.measured - b.simulated) ** 2)))
            other = float(np.sqrt(np.mean((a.measured - b.simulated) ** 2 + (b.measured - a.simulated) ** 2)))
            if own > CLEAR and other < own / 3.0:
                yield (
                    f"{a.sensor} and {b.sensor} look exchanged: their readings lie {own:.1f} K from the model, and {other:.1f} K with the "
                    "columns changed over. Check the wiring and the header of the log"
                )
