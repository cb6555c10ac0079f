"""Figures of a qualification report: readings with their sensor's band and the simulation; a worst part and its limits."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from thermid.judge.correlation import Overlay
from thermid.judge.limits import Limits, spans
from thermid.physics.constants import ICE_POINT
from thermid.qualify.trial import Trial
from thermid.reporting.blocks.sections import Graphic
from thermid.reporting.pictures.figures import DrawnCurve, ShadedBand, compared, curves


def overlay(o: Overlay, key: str, label: str) -> Graphic:
    """Return readings with the band of their sensor's error (95 %), the simulation over them, and the difference below."""
    wide = 1.96 * float(np.hypot(o.accuracy, o.noise))
    return compared(o.times, o.measured, o.simulated, key, label, below="difference", wide=wide)


LOOKS = {"operating": "bound", "non-operating": "bound off", "start-up": "bound start"}


def course(t: Trial, key: str) -> Graphic | None:
    """Return the worst part of a test over time with its 95 % interval, and its limits where their state holds; None without a limit.

    The line is what was held against the limits: the run with the best values, or the readings.
    """
    worst = t.worst
    if worst is None:
        return None
    band = t.foresight.prediction[worst.node]
    low, high = band.interval()
    lines = [DrawnCurve("simulated", "simulated", band.times, band.simulated - ICE_POINT)]
    read = [o for o in t.correlation.overlays if o.node == worst.node] if t.correlation is not None and worst.by == "measured" else []
    lines += [DrawnCurve("measured", "measured", o.times, o.measured - ICE_POINT) for o in read]
    lines += [line for one in t.limits if one.point == worst.point for line in _limits(t, one)]
    return curves(lines, key, f"{worst.point} in {t.test.name}", band=ShadedBand("95 % interval", band.times, low, high), size=(440, 240))


def _limits(t: Trial, one: Limits) -> Iterator[DrawnCurve]:
    """Yield the limits of a point as lines over the stretches in which their state holds."""
    for s in spans(t.foresight.solution, one, "operating" if t.test.operating else "non-operating"):
        ends = np.array([s.start, s.end])
        for limit in (x for x in s.limits if np.isfinite(x)):
            yield DrawnCurve(f"limit, {s.state}", LOOKS[s.state], ends, np.full(2, limit - ICE_POINT))
