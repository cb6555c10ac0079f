"""The bands that are judged, by name: today's code, persistence, an oracle; others by ``module:function``.

A name may be followed by ``~part`` for what is left out (an ablation): ``today~room`` or ``today~trend``.
"""

from __future__ import annotations

import importlib
from dataclasses import replace
from functools import partial
from unittest.mock import patch

import numpy as np

import thermid as td
from thermid.base.errors import ThermidError
from thermid.fit.error_model import SIZES
from thermid.prediction.bands import predict

from . import benches as b
from .oracle import oracle_bands
from .tasks import Answer, Array, Predictor, Question, Refusal, Task

PARTS = {**{g: (g,) for g in SIZES}, "departures": ("surface", "joint", "law")}
"""Part of the model of error that may be left out -> the sizes that are then nothing."""
NOTHING = 1e-9


def fitted(task: Task, without: tuple[str, ...] = ()) -> object:
    """Return the fit of a task, made once: the calibration, or its error."""

    def made() -> object:
        try:
            return td.calibrate(task.model, task.records, task.free, priors=task.priors)
        except ThermidError as error:
            return error

    return task.once(("fit", without), made)


def today(task: Task, question: Question, without: tuple[str, ...] = ()) -> Answer | Refusal:
    """Return the band of `thermid.predict`; what it would call something else than credible is scored all the same.

    ``~trend`` and the other sizes by their names, and ``~departures`` leave a part of the model of error out, other names a cause.
    """
    none = {g: replace(SIZES[g], value=NOTHING) for part in without if part in PARTS for g in PARTS[part]}
    with patch.dict(SIZES, none):  # of the fit too, which keeps its model of error
        fit = fitted(task, tuple(p for p in without if p in PARTS))
        if isinstance(fit, ThermidError):
            return Refusal(str(fit))
        try:
            told = predict(
                fit,  # type: ignore[arg-type]
                question.scenario,
                times=question.times,
                nodes=list(question.nodes),
                without=tuple(p for p in without if p not in PARTS),
                as_logged=True,
            )
        except ThermidError as error:
            return Refusal(str(error))
    bands = {n: told[n] for n in question.nodes}
    aside = {n: np.mean(band.interval(), axis=0) - band.celsius for n, band in bands.items()}
    return Answer({n: band.kelvin for n, band in bands.items()}, {n: band.half_width for n, band in bands.items()}, aside)


def persistence(task: Task, question: Question, without: tuple[str, ...] = ()) -> Answer:
    """Return the first temperature, held; half-widths hold 95 % of the readings of the fitted runs about their own first ones."""
    start = float(task.made.runs[question.name].room[0, task.index])
    moved = [np.abs(task.made.runs[n].readings[:, task.index] - task.made.runs[n].readings[0, task.index]) for n in b.FITTED]
    half = np.quantile(np.concatenate(moved), 0.95, axis=0)
    flat = np.ones(question.times.size)
    return Answer({n: start * flat for n in question.nodes}, {n: float(h) * flat for n, h in zip(question.nodes, half, strict=True)})


def oracle(task: Task, question: Question, without: tuple[str, ...] = ()) -> Answer:
    """Return the band of the true law with the true distributions of everything that was drawn; made for all benches at once."""
    centre, half = oracle_bands(task.made, question.name)
    at = (slice(None, None, b.THIN), task.index)
    return Answer(*({n: x[at][:, i] for i, n in enumerate(question.nodes)} for x in (centre, half)))


RULES: dict[str, Predictor] = {"today": today, "persistence": persistence, "oracle": oracle}


def rule(name: str) -> Predictor:
    """Return a predictor by its name, ``module:function`` included.

    Raises
    ------
    KeyError    When there is none of that name.
    """
    base, *left_out = name.split("~")
    if ":" in base:
        module, _, function = base.partition(":")
        found: Predictor = getattr(importlib.import_module(module), function)
    else:
        found = RULES[base]
    return partial(found, without=tuple(left_out)) if left_out else found


__all__ = ["RULES", "Array", "fitted", "rule"]
