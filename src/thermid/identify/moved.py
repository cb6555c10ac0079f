"""Whether what a level below found had to move at the level above: by how much, and how surely."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from thermid.identify.moves import MOVED, NOT_REJECTED, Group, Move, Moves
from thermid.identify.opened import opened_at
from thermid.identify.shifts import Shift, Test, Together, holm, normal_shifts, normal_together, shifts, together
from thermid.identify.trace_noise import weighed
from thermid.identify.values import FittedValue
from thermid.identify.wander import binned

if TYPE_CHECKING:
    from thermid.identify.request import Request
    from thermid.identify.residuals import Problem
    from thermid.identify.solve import Fit
    from thermid.identify.values import FittedValues
    from thermid.model.model import Model

__all__ = ["moves_above", "moves_from"]

Array = NDArray[np.float64]


STRETCHES = 160
"""Stretches of a trace, whose errors count what happens within minutes."""


def part_of(model: Model, path: str) -> str:
    """Return the path of the deepest submodel that a parameter belongs to; empty for the model itself."""
    head, _, rest = path.partition(".")
    if not rest or head not in model.submodels:
        return ""
    inner = part_of(model.submodels[head].model, rest)
    return f"{head}.{inner}" if inner else head


@dataclass(frozen=True, eq=False)
class _Known:
    """What stages below found, as far as it acts here.

    Parameters
    ----------
    groups : tuple                      Where each value acts; the first path names it. Of a constant error of a sensor its name alone.
    values : tuple of FittedValue       As their stages printed them.
    stages : tuple of str               The stages.
    root : array (values, sources)      Root of their covariance, fitted form.
    """

    groups: tuple[tuple[str, ...], ...]
    values: tuple[FittedValue, ...]
    stages: tuple[str, ...]
    root: Array


def _known(request: Request, problem: Problem) -> _Known:
    """Return what was inherited, fixed or as a prior, each value of a stage once; of two states of one path that which was laid last."""
    inherited = {p for v in request.inherited for p in v.parameters}
    free = {u.name for u in problem.unknowns if u.kind == "parameter"} - inherited
    errors = {u.name for u in problem.unknowns if u.kind != "parameter"}
    found: dict[tuple[str, str], list[str]] = {}
    roots, values = list[Array](), list[FittedValue]()
    blocks = (*request.inherited, *request.held)
    last = {p: i for i, block in enumerate(blocks) for p in block}
    for i, block in enumerate(blocks):
        finite, items = np.isfinite(np.diag(block.covariance)), list(block.items())
        acts = [p not in free if v.kind == "parameter" else p in errors for p, v in items]
        here = [k for k, (p, _) in enumerate(items) if finite[k] and acts[k] and last[p] == i]
        new = [k for k in here if (block.stage, items[k][1].path) not in found]
        for k in here:  # one part in several places has one value
            found.setdefault((block.stage, items[k][1].path), []).extend((items[k][0], *items[k][1].also))
        values += [items[k][1] for k in new]
        roots.append(_root(block.covariance[np.ix_(new, new)]))
    groups = tuple(tuple(dict.fromkeys(g)) for g in found.values())
    return _Known(groups, tuple(values), tuple(stage for stage, _ in found), _diagonal(roots))


def _root(covariance: Array) -> Array:
    """Return L of a covariance ``L L'``."""
    if not covariance.size:
        return np.zeros((0, 0))
    sizes, vectors = np.linalg.eigh(covariance)
    return np.asarray(vectors * np.sqrt(np.maximum(sizes, 0.0)))


def _diagonal(blocks: Sequence[Array]) -> Array:
    """Return a matrix with square blocks on its diagonal."""
    out = np.zeros((sum(map(len, blocks)),) * 2)
    at = 0
    for b in blocks:
        out[at : at + len(b), at : at + len(b)] = b
        at += len(b)
    return out


def moves_above(request: Request, problem: Problem, found: Fit, level: float = 1.0) -> Moves:
    """Return what the logs of a fit say of the values that it inherited, fixed or as priors.

    Each value is opened without its prior in one step of Gauss and Newton from the end of the fit, by generalised least squares: traces
    are white noise plus an autocorrelated deviation, averaged over what their residuals allow (`weighed`). Unknowns of the fit that were
    not inherited stay free; the other inherited values count with their errors. `level` is the variance of the noise of traces that are
    too short to show it, in squares of what was stated.
    """
    known = _known(request, problem)
    if not any(v.kind == "parameter" for v in known.values):
        return Moves()
    names = {u.name for u in problem.unknowns}
    opened = opened_at(request, problem, found.fitted, [g for g in known.groups if not names.intersection(g)])
    place = {u.name: k for k, u in enumerate(opened.problem.unknowns)}
    named = [next((p for p in g if p in place), "") for g in known.groups]
    kept = [k for k, name in enumerate(named) if name]
    at = [place[named[k]] for k in kept]
    start = opened.fitted.copy()
    start[at] = [opened.problem.unknowns[m].to_fitted(known.values[k].value) for k, m in zip(kept, at, strict=True)]
    pieces = binned(opened.problem, opened.fitted, request.loss, request.knee, STRETCHES)
    here = [replace(b, mean=b.mean + b.slopes @ (start - opened.fitted)) for b in pieces.values()]
    priors, pulls = _beside(opened.problem, start, at)
    test = Test.of(weighed(here, priors, pulls, level), priors, pulls, at, known.root[kept])
    asked = [k for k, m in enumerate(kept) if known.values[m].kind == "parameter"]
    values = []
    for k, s in zip(asked, shifts(test, asked), strict=True):
        u, m = opened.problem.unknowns[at[k]], kept[k]
        alone, used = u.to_value(start[at[k]] + s.size), u.to_value(opened.fitted[at[k]])
        values.append(_move(u.name, part_of(request.model, u.name), known.stages[m], known.values[m], alone, used, s))
    rows = {m.path: k for m, k in zip(values, asked, strict=True)}
    far = [rows[m.path] for m in values if m.verdict == MOVED]
    return Moves(tuple(values), _groups(values, lambda groups: together(test, [[rows[p] for p in g] for g in groups], far)))


def _beside(problem: Problem, start: Array, known: Sequence[int]) -> tuple[Array, Array]:
    """Return information and scores of the priors of unknowns that no stage below found."""
    info, pulls = np.zeros((start.size, start.size)), np.zeros(start.size)
    for k, u in enumerate(problem.unknowns):
        if u.prior is not None and k not in known:
            info[k, k] = u.prior.sd**-2
            pulls[k] = (u.prior.mean - start[k]) * u.prior.sd**-2
    return info, pulls


def _move(path: str, part: str, stage: str, v: FittedValue, alone: float, here: float, s: Shift) -> Move:
    """Return the move of a value; a detectable shift of a logarithm is one upward."""
    detectable = (abs(v.value) * math.expm1(min(s.detectable, 50.0)) if v.log else s.detectable) if math.isfinite(s.size) else math.inf
    far = s.size / s.error if s.error > 0 else math.nan
    return Move(path, part, stage, v.value, alone, here, v.unit, far, s.chance, detectable, v.error, v.error_random)


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
    shift, spread = np.zeros(len(order)), np.zeros((len(order), len(order)))
    pairs = [(stage, stage[path], q) for stage, names in staged for path, q in names.items()]
    for stage, names in staged:
        own = list(stage)
        at, rows = [own.index(p) for p in names], [order.index(q) for q in names.values()]
        below = stage.covariance[np.ix_(at, at)]
        spread[np.ix_(rows, rows)] = _less(below, found.covariance[np.ix_(rows, rows)])
    for _, before, q in pairs:
        here = found[q]
        shift[order.index(q)] = math.log(here.value / before.value) if here.log else here.value - before.value
    sizes = normal_shifts(
        np.array([shift[order.index(q)] for *_, q in pairs]), [math.sqrt(spread[k, k]) for k in (order.index(q) for *_, q in pairs)]
    )
    values = [
        _move(q, place(q), stage.stage, before, found[q].value, found[q].value, s)
        for (stage, before, q), s in zip(pairs, sizes, strict=True)
    ]

    def asked(groups: Sequence[Sequence[str]]) -> list[Together]:
        rows = [[order.index(p) for p in g] for g in groups]
        return [normal_together(shift[r], spread[np.ix_(r, r)]) for r in rows]

    return Moves(tuple(values), _groups(values, asked), "the joint fit")


def _less(below: Array, here: Array) -> Array:
    """Return one covariance less another, and the first alone in directions where less than a tenth would be left."""
    root = np.linalg.cholesky(below)
    half = np.linalg.solve(root, here)
    sizes, vectors = np.linalg.eigh(np.linalg.solve(root, half.T))
    along = root @ vectors
    return np.asarray((along * np.where(sizes < 0.9, 1.0 - sizes, 1.0)) @ along.T)


def _groups(values: Sequence[Move], test: Callable[[Sequence[Sequence[str]]], list[Together]]) -> tuple[Group, ...]:
    """Return one group per part with several values, and one of all; values of which the logs say nothing are left out of the tests."""
    parts: dict[str, list[Move]] = {}
    for m in values:
        parts.setdefault(m.part, []).append(m)
    several = {part: moves for part, moves in parts.items() if 1 < len(moves) < len(values)}
    named = [(f"part '{part}'" if part else "the model's own", moves) for part, moves in several.items()]
    every = [*named, *([("all together", list(values))] if len(values) > 1 else [])]
    told = [[m.path for m in moves if math.isfinite(m.deviations)] for _, moves in every]
    tests = iter(test([paths for paths in told if paths]))
    found = [next(tests) if paths else Together(0.0, 0, math.nan) for paths in told]
    chances = [*holm([t.chance for t in found[:-1]]), *(t.chance for t in found[-1:])]
    return tuple(
        Group(name, tuple(m.path for m in moves), t.chi_square, t.directions, p, all(m.verdict == NOT_REJECTED for m in moves))
        for (name, moves), t, p in zip(every, found, chances, strict=True)
    )
