"""Run-level conformal calibration: a second opinion on bands, from runs that no fit saw and nothing but their number.

Of n runs, exchangeable with the next, the ``ceil(level (n + 1))`` smallest of the factors by which their bands would have had to be wider
holds that of the next with the probability `level` (Vovk, Gammerman and Shafer, Algorithmic Learning in a Random World, 2005). There is
none where that place lies beyond n: at 95 % below 19 runs.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from thermid.measure.amounts import short
from thermid.prediction._records import RecordPrediction

LEVEL: Final = 0.95
NEEDED: Final = math.ceil(LEVEL / (1.0 - LEVEL) - 1e-9)
"""Runs below which no factor holds."""


@dataclass(frozen=True)
class SecondOpinion:
    """What held-out runs alone say of the 95 % bands.

    Parameters
    ----------
    runs : int      Runs that no fit saw.
    factor : float  By which their bands are to be widened to hold 95 % of the readings of a further such run with a probability of 95 %;
                    infinite for fewer runs than needed. [-]
    """

    runs: int
    factor: float

    def __str__(self) -> str:
        """Return it in words."""
        counted = f"{self.runs} run{'s' if self.runs > 1 else ''}"
        if math.isinf(self.factor):
            return f"second opinion, from {counted} alone (run-level conformal): the 95 % band is infinite, since it needs {NEEDED} runs"
        return f"second opinion, from {counted} alone (run-level conformal): {short(self.factor)} times these 95 % bands"

    def to_dict(self) -> dict[str, Any]:
        """Return it as JSON holds it; no factor where it is infinite."""
        return {"runs": self.runs, "needed": NEEDED, "factor": self.factor if math.isfinite(self.factor) else None}


def factor_of(run: RecordPrediction) -> float:
    """Return by which factor the bands of a run would hold 95 % of its readings, each sensor weighing the same. [-]"""
    apart = [np.abs(b.measured - b.predicted) / b.half_width(LEVEL) for b in run.bands.values()]
    every, weights = np.concatenate(apart), np.concatenate([np.full(a.size, 1.0 / a.size) for a in apart])
    order = np.argsort(every)
    held = np.cumsum(weights[order]) / weights.sum()
    return float(every[order][np.searchsorted(held, LEVEL - 1e-12)])


def second_opinion(runs: Sequence[RecordPrediction]) -> SecondOpinion | None:
    """Return what runs that no fit saw say of the bands; None without a run."""
    known = sorted(factor_of(r) for r in runs if r.bands)
    place = math.ceil(LEVEL * (len(known) + 1) - 1e-9)
    return SecondOpinion(len(known), known[place - 1] if place <= len(known) else math.inf) if known else None
