"""What a fit is worth by itself, and what it rests on."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from thermid.fit.contradicted import contradicted
from thermid.fit.least_squares.solve import Fit
from thermid.fit.problem.unknowns import Unknown
from thermid.knowledge.values import FittedValues
from thermid.measure.amounts import short
from thermid.model.parts.standing import CREDIBLE, Standing, worst
from thermid.model.tree.resolve import parameter_table
from thermid.units import counted

if TYPE_CHECKING:
    from thermid.fit.problem.request import Request
    from thermid.fit.problem.residuals import Problem
    from thermid.fit.uncertainty.wander import Wander

Array = NDArray[np.float64]
NOISES, SHARE = 3.0, 0.02
"""What the autocorrelated part of residuals may be, as a standard deviation: so many noises of the sensor, or so much of what the sensor
ranged over in the record, whichever is more. [-]"""


def own_standing(request: Request, problem: Problem, found: Fit, values: FittedValues, total: Array, spread: Wander | None) -> Standing:
    """Return the standing of a fit by itself, whatever it rests on."""
    wrong = [*contradicted(values).values(), *([] if found.converged else [f"the fit did not converge: {found.message}"])]
    if wrong:
        return Standing("not credible", "; ".join(wrong), values.stage, request.accepted)
    short_of = [f"'{u.name}' ended at its {side} bound" for u, side, _ in at_bounds(problem, found, total) if u.kind == "parameter"]
    short_of += _missed(request, problem, spread) if spread is not None else []
    if short_of:
        return Standing("not adequate", "; ".join(short_of), values.stage, request.accepted)
    return replace(CREDIBLE, stage=values.stage)


def at_bounds(problem: Problem, found: Fit, total: Array) -> list[tuple[Unknown, str, float]]:
    """Return the unknowns that ended at a bound, which one, and the bound in the fitted form."""
    out = []
    for k, u in enumerate(problem.unknowns):
        error = float(np.sqrt(total[k, k]))
        for bound, side in zip(u.fitted_bounds(), ("lower", "upper"), strict=True):
            if np.isfinite(bound) and abs(found.fitted[k] - bound) < max(1e-4 * max(abs(bound), u.scale), 0.02 * error):
                out.append((u, side, bound))
    return out


def _missed(request: Request, problem: Problem, spread: Wander) -> list[str]:
    """Return in words which traces the model misses by more than it may, the worst first; one reason for all of them."""
    seen = {(e.record.name, o.sensor): o for e in problem.experiments for o in e.observations}
    found: list[tuple[float, str]] = []
    for t in spread.traces:
        o = seen[t.record, t.sensor]
        sigma = o.sigma(problem.noise)
        noise = o.noise if o.noise is not None else float(np.sqrt(t.own)) * sigma
        limit = request.adequate or max(NOISES * noise, SHARE * float(np.ptp(o.measured)))
        size = float(np.sqrt(t.slow)) * sigma
        if size > limit:
            what = "'adequate'" if request.adequate else f"{NOISES:g} noises and {100 * SHARE:g} % of its range"
            found.append((size / limit, f"{t.sensor} in {t.record} is missed by {short(size)} K (limit {short(limit)} K: {what})"))
    if not found:
        return []
    first = max(found)[1]
    return [f"{first}, and {counted(len(found) - 1, 'further trace')}" if len(found) > 1 else first]


def rests_on(request: Request, values: FittedValues) -> dict[str, Standing]:
    """Return who gave the values that a fit rests on -> their standing.

    It rests on every value that was laid over its model and acts there, but for those that it freed without a prior of them, and on the
    errors of its own instruments that a stage below found.
    """
    given = {q for p in request.prior for q in request.store.states[p].acts}
    given |= {p for p, (mean, _) in request.priors.items() if not mean}  # a prior about the value that was there
    freed = {q for p, v in values.parameters.items() if p not in given for q in (p, *v.also)}
    out: dict[str, list[Standing]] = {}
    for path, entry in parameter_table(request.model).items():
        if path not in freed and entry.parameter.standing is not None:
            out.setdefault(entry.origin, []).append(entry.parameter.standing)
    for s in request.store.states.values():
        if s.kind != "parameter" and s.path in values:
            out.setdefault(str(s.origin), []).append(s.standing)
    return {who: worst(several) for who, several in out.items()}
