"""What the errors of values that a fit held add to the errors of those that it looked for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from thermid.identify.calibration import Calibration, Local
from thermid.identify.opened import opened_at, opened_jacobian
from thermid.identify.solve import covariances, ended
from thermid.identify.summary import correlations_of
from thermid.identify.unknowns import Unknown
from thermid.identify.values import FittedValue, FittedValues

__all__ = ["considered"]

Array = NDArray[np.float64]


def considered(fit: Calibration, before: Calibration, held: tuple[str, ...]) -> Calibration:
    """Return a fit whose total errors count those of what it held: parameters `held` and constant errors of instruments.

    An error dq of what is held moves the fitted values by ``S dq``, ``S = -C A'B / level``: A and B are the derivatives of the residuals by
    what was looked for and by what was held, C the covariance that the weights stand for. The held values come from other tests than those
    fitted here, so ``S Q S'`` adds to the covariance, Q being theirs from the fit `before` (Tapley, Schutz, Born, Statistical Orbit
    Determination, 2004, ch. 6: consider covariance).
    """
    request, problem = fit.request, fit.problem
    if request is None or problem is None or not problem.unknowns:
        return fit
    names = [u.name for u in problem.unknowns]
    fitted = np.array([fit.fitted[n] for n in names])
    known = {p: v.value for p, v in before.values.items()}
    groups = [(p, *before.values[p].also) for p in held]
    opened = opened_at(request, problem, fitted, groups, instruments=True, known=known)
    if not opened.names:
        return fit
    mine, fixed = opened_jacobian(opened, request.loss, request.knee)
    own = ended(problem, fitted, request.loss, request.knee)
    level, excess = (fit.wander.level, fit.wander.excess) if fit.wander is not None else (1.0, None)
    total, _, weights = covariances(own, level, excess)
    finite = np.where(np.isfinite(weights), weights, 0.0)
    moves = -finite @ mine.T @ fixed / level
    return _wider(fit, names, total + moves @ _covariance(opened.problem.unknowns[opened.own :], before) @ moves.T)


def _covariance(fixed: Sequence[Unknown], before: Calibration) -> Array:
    """Return the covariance of what is held, as the fit before found it; an instrument that it did not know counts with its accuracy."""
    order = {name: k for k, name in enumerate(before.values)}
    out = np.zeros((len(fixed), len(fixed)))
    for i, u in enumerate(fixed):
        if u.name not in order:
            out[i, i] = u.prior.sd**2 if u.prior is not None else 0.0
            continue
        for j, other in enumerate(fixed):
            if other.name in order:
                out[i, j] = before.values.covariance[order[u.name], order[other.name]]
    return np.where(np.isfinite(out), out, 0.0)


def _wider(fit: Calibration, names: list[str], total: Array) -> Calibration:
    """Return a fit with another covariance of all its unknowns."""
    at = {name: k for k, name in enumerate(names)}
    kept = [at[name] for name in fit.values]

    def own(v: FittedValue) -> FittedValue:
        error = float(np.sqrt(total[at[v.path], at[v.path]]))
        return replace(v, error=v.value * error if v.log else error)

    items = {name: own(v) for name, v in fit.values.items()}
    values = FittedValues(fit.values.stage, items, total[np.ix_(kept, kept)], fit.values.provenance, fit.values.weights)
    local = tuple(_own_error(i, total, at) for i in fit.local)
    assert fit.problem is not None
    return replace(fit, values=values, local=local, correlations=correlations_of(fit.problem, total))


def _own_error(i: Local, total: Array, at: dict[str, int]) -> Local:
    k = at[f"{i.record}: {i.name}"]
    return replace(i, error=float(np.sqrt(total[k, k])))
