"""Figures of a qualification report: readings with their sensor's band and the simulation; a worst part and its limits."""

from __future__ import annotations

import numpy as np

from thermid.physics.constants import ICE_POINT
from thermid.qualify.correlation import Overlay
from thermid.qualify.trial import Trial
from thermid.reporting.curves import Band, Curve, curves
from thermid.reporting.figures import MEASURED, RESIDUAL, SIMULATED, SOFT, Drawn, Entry, canvas, draw_line, markup_of, thinned, time_unit

__all__ = ["course", "overlay"]


def overlay(o: Overlay, key: str, label: str) -> Drawn:
    """Return readings with the band of their sensor's error (95 %), the simulation over them, and the difference below."""
    length, unit = time_unit(float(o.times[-1] - o.times[0]))
    wide = 1.96 * float(np.hypot(o.accuracy, o.noise))
    measured, simulated = o.measured - ICE_POINT, o.simulated - ICE_POINT
    with canvas(440, 290, 2, (2.2, 1)) as (figure, (top, low)):
        keep = thinned(measured)
        top.fill_between(o.times[keep] / length, measured[keep] - wide, measured[keep] + wide, color=MEASURED, alpha=0.5, linewidth=0)
        points = 2 * int(keep.size) + draw_line(top, o.times / length, measured, color=MEASURED, linewidth=2.6, solid_capstyle="round")
        points += draw_line(top, o.times / length, simulated, color=SIMULATED, linewidth=1.3)
        low.axhspan(-wide, wide, color=MEASURED, alpha=0.5, linewidth=0)
        low.axhline(0.0, color=SOFT, linewidth=0.8)
        points += draw_line(low, o.times / length, o.residuals, color=RESIDUAL, linewidth=0.9)
        top.set_ylabel("temperature, °C")
        low.set_ylabel("difference, K")
        low.set_xlabel(f"time, {unit}")
        top.margins(x=0.01)
        top.tick_params(labelbottom=False)
        figure.subplots_adjust(left=0.13, right=0.985, top=0.97, bottom=0.15, hspace=0.12)
        figure.align_ylabels([top, low])
        markup = markup_of(figure, label, key, points)
    entries = [Entry("measured", "--f-measured"), Entry("simulated", "--f-simulated"), Entry("measured less simulated", "--f-residual")]
    entries += [Entry("sensor, 95 %", "--f-measured", "band")] if wide else []
    return Drawn(markup, tuple(entries), points)


def course(t: Trial, key: str) -> Drawn | None:
    """Return the worst part of a test over time with its 95 % interval and its limits; None without a limit."""
    worst = t.worst
    if worst is None:
        return None
    band = t.foresight.prediction[worst.node]
    low, high = band.interval()
    lines = [Curve("expected", "simulated", band.times, band.celsius)]
    ends = np.array([band.times[0], band.times[-1]])
    lines += [Curve("limit", "bound", ends, np.full(2, limit - ICE_POINT)) for limit in worst.limits if np.isfinite(limit)]
    return curves(lines, key, f"{worst.point} in {t.test.name}", band=Band("95 % interval", band.times, low, high), size=(440, 240))
