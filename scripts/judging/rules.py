"""The bands that are judged, by name: today's code, persistence, an oracle; others by ``module:function``.

A name may be followed by ``~part`` for what is left out (an ablation): ``today~kinds of run`` or ``error-model~trend``.
"""

from __future__ import annotations

import importlib
from functools import partial

import numpy as np

import thermid as td
from thermid.base.errors import ThermidError
from thermid.prediction.bands import predict

from . import benches as b
from .oracle import oracle_bands
from .tasks import Answer, Array, Predictor, Question, Refusal, Task


def fitted(task: Task) -> object:
    """Return the fit of a task, made once: the calibration, or its error."""

    def made() -> object:
        try:
            return td.calibrate(task.model, task.records, task.free, priors=task.priors)
        except ThermidError as error:
            return error

    return task.once("fit", made)


def today(task: Task, question: Question, without: tuple[str, ...] = ()) -> Answer | Refusal:
    """Return the band of `thermid.predict`; what it would call something else than credible is scored all the same."""
    fit = fitted(task)
    if isinstance(fit, ThermidError):
        return Refusal(str(fit))
    spread = (dict(question.spread),) if question.spread else ()
    try:
        told = predict(
            fit,  # type: ignore[arg-type]
            question.scenario,
            times=question.times,
            spread=spread,
            nodes=list(question.nodes),
            without=without,
        )
    except ThermidError as error:
        return Refusal(str(error))
    return Answer({n: told[n].kelvin for n in question.nodes}, {n: told[n].half_width for n in question.nodes})


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
        if base not in RULES and base == "error-model":
            RULES[base] = importlib.import_module("judging.error_model").error_model
        found = RULES[base]
    return partial(found, without=tuple(left_out)) if left_out else found


__all__ = ["RULES", "Array", "fitted", "rule"]
