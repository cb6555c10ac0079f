"""Predictions by the model of error of a fit: what is counted beside it, and what the parts of a band stand for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np

from thermid.base.linear_algebra import Array
from thermid.fit.calibration import Calibration
from thermid.inference.error_model import NARROWS, STRUCTURE, VALUES, BesideRow, ErrorBand, ErrorModel
from thermid.prediction._budget import GAS_IN_JOINTS, Budget, Groups, Spread, Target, expanded, open_contacts
from thermid.prediction._known import Known, Rows, rows_of
from thermid.simulation.runs import prepare

MEANING = {
    VALUES: "noise, instruments and priors leave the fitted values this uncertain",
    STRUCTURE: "elements depart from their laws, the more the further the run is from those that were fitted",
    "this run": "coefficients, masses and powers differ from run to run",
    "room": "a room drifts about what is logged of it",
    "what no element explains": "residuals that no departure of an element follows",
    "sizes, and what carries the heat": "how large departures are, and whether free air or a fan carries the heat of surfaces",
}
"""Source of a band -> what it stands for."""


@lru_cache(maxsize=16)
def error_model_of(fit: Calibration) -> ErrorModel:
    """Return the model of error of a fit, made once."""
    return ErrorModel.of(fit)


@dataclass(frozen=True, eq=False)
class CountedBeside:
    """What a band counts beside the model of error: values that stages below found, gas in joints, and what is stated.

    Parameters
    ----------
    budget : Budget     Of these alone.
    rows : dict         Name in the wiring -> how it follows the sources.
    remark : str        What a reader must know of joints; empty for nothing.
    """

    budget: Budget
    rows: Mapping[str, BesideRow]
    remark: str = ""

    @classmethod
    def of(cls, known: Known, whole: Budget, stated: Sequence[Any]) -> CountedBeside:
        """Return what is counted beside the model of error of a fit in the scenario of its whole budget."""
        rows = rows_of(known)
        made = Budget.of_rows(rows_below(known, rows), known.model, whole.scenario)
        made = replace(made, followed=whole.followed, said=whole.said)
        contacts, remark = open_contacts(known, rows, whole.scenario)
        for path, gas in contacts.items():
            made = made.with_one(gas, GAS_IN_JOINTS, Target(path, "factor", rows.also.get(path, ())))
        plain: list[Spread | Groups] = [expanded(s, known.model) if isinstance(s, Mapping) else s for s in stated]
        made = made.with_stated(plain)
        return cls(made, beside_rows(made), remark)


def beside_rows(budget: Budget) -> dict[str, BesideRow]:
    """Return name in the wiring -> how it follows the sources of a budget."""
    ready = prepare(budget.model, budget.scenario if budget.scenario.seconds else budget.scenario.with_(duration=1.0), ())
    out: dict[str, BesideRow] = {}
    for t, gain in zip(budget.targets, budget.gain, strict=True):
        relative = t.form in ("log", "factor")
        for name in dict.fromkeys(map(ready.canonical, (t.name, *t.also))):
            known = out.get(name)
            out[name] = BesideRow(gain if known is None else known.gain + gain, relative)
    return out


def rows_below(known: Known, rows: Rows) -> Rows:
    """Return how values follow those errors of stages below that act on what this fit held; fitted values follow them too."""
    assert known.fit is not None
    assert known.fit.problem is not None
    own = {u.name for u in known.fit.problem.unknowns}
    held = [k for k, n in enumerate(rows.names) if n not in own]
    used = np.flatnonzero(rows.matrix[held].any(axis=0)) if held else np.zeros(0, dtype=int)
    sources, causes = tuple(rows.sources[k] for k in used), tuple(rows.causes[k] for k in used)
    return replace(rows, sources=sources, causes=causes, matrix=rows.matrix[:, used])


def with_beside(band: ErrorBand, beside: CountedBeside) -> tuple[dict[str, Array], dict[str, Array], Array]:
    """Return source -> variance (times,) [K^2], and what moves the centre (times,): by cause, and together [K]."""
    parts = dict(band.parts)
    if band.beside.shape[1]:
        own = beside.budget.parts(band.beside)
        # errors of stages below are errors of values as well
        for cause, v in own.items():
            name = VALUES if cause.startswith("fit") else cause
            parts[name] = parts.get(name, 0.0) + v
    shifts = beside.budget.shifts(band.beside) if band.beside.shape[1] else {}
    return parts, shifts, band.kelvin + np.sum([np.zeros(band.times.size), *shifts.values()], axis=0)


def meaning(shares: Mapping[str, float], least: float) -> dict[str, str]:
    """Return cause -> what it stands for; of the largest also what would narrow a band that comes from it.

    Parameters
    ----------
    shares : dict   Cause -> its share of the variance of the widest band. [-]
    least : float   Share from which a cause is told. [-]
    """
    largest = max(shares, key=shares.__getitem__, default="")
    told = {c: MEANING[c] for c, share in shares.items() if c in MEANING and share >= least}
    return {c: f"{text}; narrower by {NARROWS[c]}" if c == largest else text for c, text in told.items()}
