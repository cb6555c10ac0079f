"""Figures of a qualification report: readings with their sensor's band and the simulation; a worst part and its limits."""

from __future__ import annotations

import numpy as np

from thermid.physics.constants import ICE_POINT
from thermid.qualify.overlay import Overlay
from thermid.qualify.trial import Trial
from thermid.reporting.curves import Band, Curve, curves
from thermid.reporting.figures import Drawn, compared

__all__ = ["course", "overlay"]


def overlay(o: Overlay, key: str, label: str) -> Drawn:
    """Return readings with the band of their sensor's error (95 %), the simulation over them, and the difference below."""
    wide = 1.96 * float(np.hypot(o.accuracy, o.noise))
    return compared(o.times, o.measured, o.simulated, key, label, below="difference", wide=wide)


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
