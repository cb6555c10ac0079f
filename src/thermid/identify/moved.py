"""Whether what a level below found had to move at the level above: by how much, and how surely."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from thermid.identify.moves import Group, Move, Moves

if TYPE_CHECKING:
    from thermid.identify.residuals import Problem
    from thermid.identify.solve import Fit
    from thermid.identify.values import FittedValues
    from thermid.identify.wander import Wander
    from thermid.model.model import Model

__all__ = ["moves_above", "moves_from"]

Array = NDArray[np.float64]
DECIDED = 0.3
"""Root of the share that a level's own data have in what is known of a direction, from which they can be asked alone."""
INFORMED = 1e-6
"""Part of what is known of a direction that must come from below, for below to have said anything of it."""


def part_of(model: Model, path: str) -> str:
    """Return the path of the deepest submodel that a parameter belongs to; empty for the model itself."""
    head, _, rest = path.partition(".")
    if not rest or head not in model.submodels:
        return ""
    inner = part_of(model.submodels[head].model, rest)
    return f"{head}.{inner}" if inner else head


def moves_above(
    handed: Sequence[FittedValues], model: Model, problem: Problem, found: Fit, total: Array, wandering: Wander | None = None
) -> Moves:
    """Return how far this level's data moved what stages below handed on as priors.

    With P the information of all priors, A that of this level's data and x0 where the priors alone would stand, the fit ends at
    x = x0 + (A + P)^-1 J'(y - J x0). Its shift x - x0 has the covariance P^-1 - (A + P)^-1 when the priors hold (J. A. Hausman,
    Econometrica 46 (1978) 1251, lemma 2.1); where residuals are larger than the noise, or wander, the shift scatters more, by what the
    errors of the fit were widened with, and that is counted.
    """
    names = [u.name for u in problem.unknowns]
    stages = {p: v.stage for v in handed for p in v.parameters}
    errors = {p: one.error for v in handed for p, one in v.parameters.items()}
    members = [k for k, u in enumerate(problem.unknowns) if u.kind == "parameter" and u.name in stages]
    if not members:
        return Moves()
    if wandering is not None and wandering.excess.any():
        wandering = _let_go(problem, found, total)
    shift, spread, known = _shift(problem, found, total, wandering)
    means = {k: problem.unknowns[k].to_value(float(found.fitted[k] - shift[k])) for k in members}
    values = []
    for k in members:
        u = problem.unknowns[k]
        sd = math.sqrt(max(spread[k, k], 0.0))
        tested = known[k] and sd > math.sqrt(INFORMED * total[k, k])
        far = float(shift[k]) / sd if tested else math.nan
        here = u.to_value(float(found.fitted[k]))
        values.append(Move(u.name, part_of(model, u.name), stages[u.name], means[k], here, u.unit, far, _normal(far), errors[u.name]))
    tested_rows = {names[k]: k for k, m in zip(members, values, strict=True) if math.isfinite(m.deviations)}
    together = lambda paths: _together([tested_rows[p] for p in paths if p in tested_rows], shift, spread)  # noqa: E731
    return Moves(tuple(values), _groups(values, together))


def _let_go(problem: Problem, found: Fit, total: Array) -> Wander:
    """Return how the residuals wander where this level's data alone would put what they decide.

    Where the priors hold values back, residuals wander by that, and it is what the test is to see.
    """
    from thermid.identify.wander import wander

    sizes = np.sqrt(np.where(np.isfinite(np.diag(total)), np.maximum(np.diag(total), 0.0), 0.0))
    here = problem.compressed(found.fitted)
    vectors, s, basis = np.linalg.svd(here.slopes * sizes, full_matrices=False)
    own = s > DECIDED
    step = sizes * (basis[own].T @ (vectors[:, own].T @ -here.rows / s[own]))
    low, high = (np.array(b) for b in zip(*(u.fitted_bounds() for u in problem.unknowns), strict=True))
    at = np.clip(found.fitted + step, low, high)
    return wander(problem, replace(found, fitted=at))


def _shift(problem: Problem, found: Fit, total: Array, wandering: Wander | None) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Return fitted less what the priors alone say, its covariance, and of which unknowns the priors say anything."""
    finite = np.isfinite(np.diag(total)) & (np.diag(total) > 0)
    scale = np.where(finite, np.sqrt(np.where(finite, np.diag(total), 1.0)), 1.0)
    data, priors = found.jacobian * scale, found.priors * scale
    rows = problem.prior_rows(found.fitted)[0]
    seen, prior = data.T @ data, priors.T @ priors
    sizes, vectors = np.linalg.eigh(prior)
    own, free = vectors[:, sizes > INFORMED], vectors[:, sizes <= INFORMED]
    size = sizes[sizes > INFORMED]
    # what the data say of the directions that have priors, those without marginalised
    cross = own.T @ seen @ free
    taken = cross @ np.linalg.pinv(free.T @ seen @ free, hermitian=True)
    left = own.T @ seen @ own - taken @ cross.T
    gain = np.linalg.inv(left + np.diag(size))
    # by how much the scores J'r of the data scatter: in squares of the noise, and along the ways in which residuals wander
    level = _widened(found, problem) if wandering is None else wandering.level
    scores = level * left
    if wandering is not None:
        seen_along = own - free @ taken.T
        scores = scores + seen_along.T @ (scale[:, None] * wandering.excess * scale) @ seen_along
    moved = own @ (own.T @ (priors.T @ rows) / size)
    spread = own @ (gain @ (scores + left @ (left / size[:, None])) @ gain) @ own.T
    known = finite & (np.linalg.norm(free, axis=1) < 1e-3)
    return scale * moved, spread * np.outer(scale, scale), known


def _widened(found: Fit, problem: Problem) -> float:
    """Return the factor by which the residuals exceed the noise, in squares."""
    return max(1.0, found.chi_square / max(problem.worth - len(problem.unknowns), 1))


def moves_from(staged: Sequence[tuple[FittedValues, Mapping[str, str]]], found: FittedValues, place: Callable[[str], str]) -> Moves:
    """Return how far a joint fit moved what the stages found.

    Parameters
    ----------
    staged : sequence       Per stage its values, and path there -> path in the joint fit.
    found : FittedValues    The joint fit's.
    place : callable        Path in the joint fit -> the part that it belongs to.

    The covariance of a shift is that of the stage less that of the joint fit, which holds the stage's data too (Hausman, as above). In
    directions where the joint fit knows little more than the stage (which took other values for exact, or met smaller residuals) the
    stage's own covariance is the measure.
    """
    order = list(found)
    values, shift, spread = [], np.zeros(len(order)), np.zeros((len(order), len(order)))
    for stage, names in staged:
        own = list(stage)
        at, rows = [own.index(p) for p in names], [order.index(q) for q in names.values()]
        below = stage.covariance[np.ix_(at, at)]
        spread[np.ix_(rows, rows)] = _less(below, found.covariance[np.ix_(rows, rows)])
        for path, q in names.items():
            k, before, here = order.index(q), stage[path], found[q]
            shift[k] = math.log(here.value / before.value) if here.log else here.value - before.value
            sd = math.sqrt(spread[k, k])
            far = float(shift[k]) / sd if sd > 0 and math.isfinite(sd) else math.nan
            values.append(Move(q, place(q), stage.stage, before.value, here.value, here.unit, far, _normal(far), before.error))
    rows_of = {m.path: order.index(m.path) for m in values if math.isfinite(m.deviations)}
    return Moves(tuple(values), _groups(values, lambda paths: _together([rows_of[p] for p in paths if p in rows_of], shift, spread)))


def _less(below: Array, here: Array) -> Array:
    """Return one covariance less another, and the first alone in directions where less than a tenth would be left."""
    root = np.linalg.cholesky(below)
    half = np.linalg.solve(root, here)
    sizes, vectors = np.linalg.eigh(np.linalg.solve(root, half.T))
    along = root @ vectors
    return np.asarray((along * np.where(sizes < 0.9, 1.0 - sizes, 1.0)) @ along.T)


def _normal(far: float) -> float:
    """Return the chance of a standard normal number at least so far from zero."""
    return math.erfc(abs(far) / math.sqrt(2.0)) if math.isfinite(far) else math.nan


def _together(rows: Sequence[int], shift: Array, spread: Array) -> tuple[float, int, float]:
    """Return chi-square, directions and chance of several shifts together."""
    from scipy.stats import chi2

    if not rows:
        return 0.0, 0, math.nan
    sd = np.sqrt(np.diag(spread)[list(rows)])
    sizes, vectors = np.linalg.eigh(spread[np.ix_(rows, rows)] / np.outer(sd, sd))
    kept = sizes > 1e-6 * sizes.max()
    along = vectors[:, kept].T @ (shift[list(rows)] / sd)
    square, count = float(np.sum(along**2 / sizes[kept])), int(kept.sum())
    return square, count, float(chi2.sf(square, count))


def _groups(values: Sequence[Move], test: Callable[[Sequence[str]], tuple[float, int, float]]) -> tuple[Group, ...]:
    """Return one group per part, and one of all together."""
    parts: dict[str, list[str]] = {}
    for m in values:
        parts.setdefault(m.part, []).append(m.path)
    out = [
        Group(f"part '{part}'" if part else "the model's own", tuple(paths), *test(paths))
        for part, paths in parts.items()
        if len(parts) > 1
    ]
    every = [m.path for m in values]
    return (*out, Group("all together", tuple(every), *test(every)))
