"""Errors of fitted values that count how elements depart from their laws, where residuals refute the structure of a fit.

A value stays where its fit found it. Its error is the root of the sum of its variance by the model of error and of the square of what that
would move it by; none becomes smaller.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from thermid.base.errors import ThermidError
from thermid.fit._calibration import FIRST, Calibration
from thermid.fit._error_model.kept import ErrorModel
from thermid.fit._error_model.sizes import BEYOND_WIDENING, LARGE_MOVE, STRONG, SURE_MOVE
from thermid.measure.amounts import short
from thermid.model.parameters import Standing


def with_structural_errors(fit: Calibration) -> tuple[Calibration, ErrorModel | None]:
    """Return a fit with these errors, and the model of error behind them; where there is none a warning of the fit says why."""
    asked = fit.request is not None and fit.request.structural_errors
    try:
        errors = ErrorModel.of(fit)
    except (ThermidError, np.linalg.LinAlgError) as error:
        why = getattr(error, "message", "the readings and the bounds together leave the sizes of departures open")
        words = f"the errors do not count what the structure may lack ({why.rstrip('.')}). Look for it with `thermid criticise`."
        return replace(fit, warnings=(*fit.warnings, words)), None
    if not asked and errors.gain < STRONG:
        return fit, errors  # what wanders is as likely noise
    moved = {n: float(x - fit.fitted[n]) for n, x in zip(errors.unknowns, errors.mean, strict=True)}
    variances = dict(zip(errors.unknowns, np.diag(errors.covariance).tolist(), strict=True))
    return _widened(fit, moved, variances), errors


def _widened(fit: Calibration, moved: Mapping[str, float], variances: Mapping[str, float]) -> Calibration:
    """Return a fit with wider errors, by what its values would move by and their variances; fitted form."""
    assert fit.problem is not None
    slopes = {u.name: u.slope(fit.fitted[u.name]) for u in fit.problem.unknowns}
    sizes = {n: math.hypot(x, math.sqrt(max(variances[n], 0.0))) for n, x in moved.items()}
    items = {p: replace(v, error=max(v.error, float(sizes[p] * slopes[p]))) if p in sizes else v for p, v in fit.values.items()}
    asked, stated = fit.request is not None and fit.request.structural_errors, fit.request is not None and fit.request.adequate > 0.0
    logs = {u.name for u in fit.problem.unknowns if u.kind == "parameter" and u.log}
    far = {p: x for p, x in moved.items() if p in logs and abs(x) > BEYOND_WIDENING and x**2 > SURE_MOVE**2 * variances[p]}
    # with a stated `adequate` it is the user's to say what residuals may be
    if far and not (asked or stated) and fit.own.fair:
        fit = _inadequate(fit, max(far, key=lambda p: abs(far[p])), far)
        items = {p: replace(v, standing=fit.values[p].standing) for p, v in items.items()}
    grown = {p: v.error / fit.values[p].error for p, v in items.items() if v.kind == "parameter" and fit.values[p].error > 0.0}
    said = (*fit.warnings, _words(grown, asked))
    return replace(fit, values=replace(fit.values, items_=items), structural_errors=True, warnings=said)


def _inadequate(fit: Calibration, worst: str, far: Mapping[str, float]) -> Calibration:
    """Return a fit whose values the readings ask to move so far that a wider error does not do."""
    size = far[worst]
    by = f"{short(100.0 * math.expm1(size), 2)} %" if abs(size) < math.log(LARGE_MOVE) else f"more than a factor of {LARGE_MOVE:g}"
    because = f"what the structure may lack would move '{worst}' by {by}, and the residuals ask for it"
    accepted = fit.request is not None and fit.request.accepted
    return replace(fit, own=Standing("not adequate", because, fit.stage, accepted)).judged(fit.rests, fit.verdict)


def _words(grown: Mapping[str, float], asked: bool) -> str:
    """Return what a reader must know; `grown` is by what factor the error of each value grew."""
    most = max(grown, key=grown.__getitem__, default="")
    times = f", most of '{most}': {short(grown[most], 2)} times the error of the fit itself" if most else ""
    why = "the structure is a proposal" if asked else "the residuals refute the structure"
    return f"{FIRST}{why}, so the errors of the values count how its elements may depart from their laws{times}."
