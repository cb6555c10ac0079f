"""What a run asked of correlations beyond the Rayleigh numbers between which they were found."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from thermid.dual import value_of
from thermid.model.curves import evaluate
from thermid.physics.correlations import correlation

if TYPE_CHECKING:
    from thermid.simulation.run import Run

__all__ = ["outside"]


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
    return tuple(out)
