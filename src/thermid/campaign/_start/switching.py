"""When powers changed: a log has a change at its next sample; the temperatures say where it was in between.

A power of 18 W that changes half a minute before its sample gives 540 J that the log does not have, which is 0.4 K of a box of 1300 J/K.
A search of a structure would answer such a step with a mass.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from thermid.base.errors import ThermidError
from thermid.fit.calibration import Request
from thermid.inference.criticism import EvaluationBudget, FittedStructure, fitted_structure
from thermid.measure.records import Record

PROVES_INSTANT = 4.0
"""Log-likelihood that each instant has to gain, those that do nothing gain a half. [-]"""


def between_samples(begun: FittedStructure, found: FittedStructure, budget: EvaluationBudget) -> Request | None:
    """Return the request in which powers changed between their samples, where the readings prove that they did; else None.

    The instants are unknowns of a fit. A mass would answer a delay too, and a delay a mass, so instants have to fit better beside what a
    search found with powers as logged, or better than that beside nothing.

    Parameters
    ----------
    begun : FittedStructure     The structure at the beginning.
    found : FittedStructure     That which a search proposes for powers as logged.
    budget : EvaluationBudget   What the evaluations of its fits are taken from.
    """
    records = tuple(_sampled(r) for r in begun.request.records)
    for one in (begun, found):
        try:
            moved = fitted_structure(one.changes, replace(one.request, records=records), one.fitted, None, budget)
        except (ThermidError, np.linalg.LinAlgError):
            continue
        count = sum(len(e.instants) for e in moved.problem.experiments)
        reduced = max(moved.end.chi_square / max(moved.problem.freedom, 1.0), 1e-12)
        if count and found.end.cost - moved.end.cost > PROVES_INSTANT * reduced * count:
            return replace(begun.request, records=records)
    return None


def _sampled(record: Record) -> Record:
    """Return a record whose powers and commands changed between their samples, where nobody says that they were logged as they changed."""
    driven = (c for c in record.channels.values() if c.role in ("load", "command") and c.held and c.prompt is None)
    return record.with_channels(*(replace(c, prompt=False) for c in driven))
