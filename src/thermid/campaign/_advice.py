"""What to do about a bad fit of a campaign: mistakes that would explain it, and the one next command to try."""

from __future__ import annotations

from collections.abc import Sequence

from thermid.base.errors import IdentificationError, SolverError, ThermidError
from thermid.fit.calibration import Calibration, Request
from thermid.inference.criticism import Mistakes, find_mistakes
from thermid.measure.records import stray_readings


def mistakes_of(fit: Calibration) -> Mistakes:
    """Return the mistakes that would explain what a fit misses; none where nothing was fitted to logs, or nothing is missed."""
    if fit.given_model.runner is not None:  # the heat inside somebody's FMU is not known
        return Mistakes(fit.stage)
    if fit.request is None or not fit.request.records or not fit.values.parameters or any(e.ticks is not None for e in fit.experiments):
        return Mistakes(fit.stage)
    if stray_readings(fit.request.records):  # said first: what looks like another mistake may be their doing
        return Mistakes(fit.stage)
    return find_mistakes(fit.request, fit.stage)


def next_command(campaign: str, fit: Calibration, mistakes: Mistakes) -> str:
    """Return the next command to try on a bad fit, after the change that a mistake asks for; empty where a fit is good.

    Parameters
    ----------
    campaign : str      The campaign's file, as the user knows it.
    fit : Calibration   A stage.
    mistakes : Mistakes  What would explain it.
    """
    if fit.request is not None and stray_readings(fit.request.records):
        return f"thermid check {campaign}"
    mistake = mistakes.first
    if mistake is not None and mistake.kind == "load":
        return f"thermid criticise {campaign} --stage '{fit.stage}'"
    if mistake is not None:
        return f"thermid calibrate {campaign}"
    if fit.own.fair and not mistakes.bad:
        return ""
    if fit.contradicted or (not fit.own.fair and "bound" in fit.own.because):
        return f"thermid plausibility {campaign} --stage '{fit.stage}'"
    return f"thermid criticise {campaign} --stage '{fit.stage}'"


def in_words(command: str) -> str:
    """Return a next command with what comes before it: the same fit again only makes sense after what a likely mistake asks to change."""
    return f"make that change, then {command}" if command.startswith("thermid calibrate") else command


def refused(error: ThermidError, request: Request, stage: str, campaign: str) -> ThermidError:
    """Return a refusal of a fit with the mistakes that would explain it, and the next command to try."""
    if not isinstance(error, IdentificationError | SolverError):
        return error
    explanations: Sequence[str] = stray_readings(request.records)
    command = f"thermid check {campaign}"
    if not explanations:
        explanations = find_mistakes(request, stage).lines() if request.model.runner is None else ()
        command = f"thermid calibrate {campaign}" if explanations else f"thermid identify {campaign} --stage '{stage}'"
    words = [f"{line.strip()[0].upper()}{line.strip()[1:]}" for line in explanations]
    return error.reworded(" ".join([error.message, *words, f"Next: {in_words(command)}"]))
