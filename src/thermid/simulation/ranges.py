"""What a run asked of correlations beyond the Rayleigh numbers between which they were found."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from thermid.dual import Number, value_of
from thermid.model.laws.curves import evaluate
from thermid.physics.correlations import correlation

if TYPE_CHECKING:
    from thermid.simulation.run import Run


def outside(run: Run) -> tuple[str, ...]:
    """Return a sentence for each correlation whose largest Rayleigh number at a stored time lies outside its range."""
    out = []
    words = {c.path: c.words for c in run.network.flat.conductors}
    for row in run.assembled.numbers.conductors:
        if row.form != "natural" or row.curve is None:
            continue
        hot, cold = (run.traces.temperature(end) for end in row.ends)
        strength = run.wiring.signals[row.second].at(run.times) if row.second else 1.0
        root = value_of(row.coefficients[1]) * strength * evaluate(row.curve.film[1], 0.5 * (hot + cold))
        highest = float(np.max(root**4 * np.abs(hot - cold), initial=0.0))
        given = words[row.name]
        law = correlation(given.get("htc.correlation", ""), given.get("htc.orientation", "vertical"))
        if highest > law.high or 0.0 < highest < law.low:
            out.append(
                f"{law.name} of '{row.name}' was found between Rayleigh numbers of {law.low:g} and {law.high:g};"
                f" here they reach {highest:.3g}"
            )
    return (*dict.fromkeys(out), *_convecting_gaps(run))


CONVECTS: Final = 1708.0
"""Rayleigh number of a layer that is heated from below, above which its gas moves (Incropera, 6th ed., Section 9.8). [-]"""


def _convecting_gaps(run: Run) -> tuple[str, ...]:
    """Return a sentence for each gap so wide that its gas would not stay at rest."""
    out, values = [], run.assembled.numbers.values
    for c in run.network.flat.conductors:
        if "gap" not in c.fields:
            continue
        hot, cold = (run.traces.temperature(end) for end in c.ends)
        distance: Number = values[c.fields["gap"]]
        highest = float(np.max(run.network.media.buoyancy(c, 0.5 * (hot + cold), run.times) * np.abs(hot - cold), initial=0.0))
        highest *= value_of(distance) ** 3
        if highest > CONVECTS:
            width = 1e3 * value_of(distance)
            out.append(
                f"the gap of '{c.path}', {width:.4g} mm, reaches a Rayleigh number of {highest:.3g}: gas at rest is taken, and above"
                f" {CONVECTS:.0f} it convects where the lower plate is the warmer one, between upright plates from some 1e4"
            )
    return tuple(out)
