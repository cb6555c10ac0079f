"""The picture of a hold question: the probability of having passed a limit against time."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from thermid.monte_carlo.hold import Hold, HoldPoint, clock, driven_by
from thermid.reporting.pictures.figures import DASHES, INK, SERIES, SOFT, time_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MOST = 6
"""Limits drawn; those that are passed first."""


def draw_hold(figure: Figure, found: Hold) -> None:
    """Draw the curves of the limits that are passed first, with the hold time of the first, and what drives it."""
    axis: Axes = figure.subplots()
    length, name = time_unit(float(found.times[-1]))
    passed = [p for p in found.points[:MOST] if p.exceedance[-1] > 0.0] or [found.points[0]]
    if found.watermark:
        figure.text(
            0.5, 0.5, found.watermark.upper(), color=SOFT, alpha=0.16, fontsize=20, rotation=24, ha="center", va="center", weight="bold"
        )
    for k, p in enumerate(passed):
        dash = DASHES[k % len(DASHES)]
        label, colour = f"{p.name}, {p.limit:g} degC", SERIES[k % len(SERIES)]
        (line,) = axis.plot(*_steps(p, found, length), color=colour, linewidth=1.8, label=label, drawstyle="steps-post")
        if dash:
            line.set_dashes(dash)
    top = min(105.0, max(115.0 * max(float(p.exceedance[-1]) for p in passed), 400.0 * (1.0 - found.confidence)))
    share = 100.0 * (1.0 - found.confidence)
    axis.axhline(share, color=SOFT, linewidth=1.0, linestyle=":")
    axis.text(found.times[-1] / length, share, f"{share:g} % ", color=SOFT, va="bottom", ha="right")
    until, (low, high) = found.together.hold, found.together.between
    if math.isfinite(until):
        axis.axvspan(low / length, min(high, found.times[-1]) / length, color=INK, alpha=0.12, linewidth=0)
        axis.axvline(until / length, color=INK, linewidth=1.2)
        axis.annotate(f"{clock(until)} ", (until / length, 0.62 * top), ha="right", color=INK, weight="bold")
    axis.set_xlim(found.times[0] / length, found.times[-1] / length)
    axis.set_ylim(0.0, top)
    axis.set_xlabel(f"time, {name}")
    axis.set_ylabel("probability of having passed the limit, %")
    driven = ", ".join(driven_by(found.together).split(", ")[:3])
    axis.set_title(found.sentence + (f"\ndriven by {driven}" if driven else ""), loc="left")
    axis.legend(loc="best")


def _steps(p: HoldPoint, found: Hold, length: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the curve through every crossing, up to the end of the scenario. [time unit, %]"""
    ordered = np.sort(p.crossings[np.isfinite(p.crossings)])
    times = np.concatenate(([found.times[0]], ordered, [found.times[-1]]))
    passed = np.concatenate(([0.0], np.arange(1.0, ordered.size + 1.0), [float(ordered.size)]))
    return times / length, 100.0 * passed / p.crossings.size
