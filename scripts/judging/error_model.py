"""The rule ``error-model``: the band of `thermid.inference.error_model.ErrorModel`."""

from __future__ import annotations

from dataclasses import replace
from unittest.mock import patch

from thermid.base.errors import ThermidError
from thermid.inference.error_model import SIZES, ErrorModel

from .rules import fitted
from .tasks import Answer, Question, Refusal, Task

ABLATIONS = {"trend": ("trend",), "room": ("room",), "run": ("run",), "departures": ("surface", "joint", "law"), "hidden": ("hidden",)}
"""Part that may be left out -> the sizes that are then nothing."""
NOTHING = 1e-9


def error_model(task: Task, question: Question, without: tuple[str, ...] = ()) -> Answer | Refusal:
    """Return the band of the model of error; ``~trend``, ``~room``, ``~run``, ``~departures``, ``~hidden`` leave a part out."""
    fit = fitted(task)
    if isinstance(fit, ThermidError):
        return Refusal(str(fit))
    none = {g: replace(SIZES[g], value=NOTHING) for part in without for g in ABLATIONS[part]}
    try:
        with patch.dict(SIZES, none):
            of = task.once(("error model", without), lambda: ErrorModel.of(fit))  # type: ignore[arg-type]
            told = of.band(question.scenario, question.nodes, times=question.times, as_logged=True)
    except ThermidError as error:
        return Refusal(str(error))
    return Answer({n: told[n].kelvin for n in question.nodes}, {n: told[n].half_width for n in question.nodes})
