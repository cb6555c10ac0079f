"""Whether the logs of a level contradict what the levels below found: by how much, and what these logs would find."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from thermid.errors import ScenarioError, SolverError
from thermid.fit.problem.known_before import form, known_before
from thermid.fit.problem.unknowns import Unknown
from thermid.fit.uncertainty.moves import MOVED, NOT_REJECTED, Group, Move, Moves
from thermid.fit.uncertainty.opened import Opened, opened_at
from thermid.fit.uncertainty.responses import covering
from thermid.fit.uncertainty.shifts import Shift, Test, Together, estimate, holm, normal_shifts, normal_together, shifts, together
from thermid.fit.uncertainty.trace_noise import weighed
from thermid.fit.uncertainty.wander import binned
from thermid.knowledge.store import State
from thermid.knowledge.values import FittedValue

if TYPE_CHECKING:
    from thermid.fit.least_squares.solve import Fit
    from thermid.fit.problem.request import Request
    from thermid.fit.problem.residuals import Problem
    from thermid.knowledge.values import FittedValues
    from thermid.model.tree.model import Model

Array = NDArray[np.float64]


FARTHEST = 1.5
"""Logarithm of the factor by which a value changes at most before derivatives are taken again."""
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
class _Inherited:
    """What stages below found of a fit's unknowns, those opened for the test among them.

    Parameters
    ----------
    at : tuple of int               Their positions among the unknowns; instruments that were found with them too.
    states : tuple of State         As their stages printed them; None for an instrument.
    root : array (at, sources)      Root of their covariance, in the fitted form of the unknowns.
    """

    at: tuple[int, ...]
    states: tuple[State | None, ...]
    root: Array


def _fixed(request: Request, problem: Problem) -> dict[tuple[str, ...], State]:
    """Return what was inherited and is no unknown of a fit, by the paths where it acts; instances of one part have one value."""
    here, shared = covering(problem.unknowns), request.shared
    groups: dict[tuple[frozenset[str], float], tuple[State, list[str]]] = {}
    for s in request.store.parameters.values():
        acts = [p for p in s.acts if p not in here]
        if s.known and acts and s.path not in request.prior:
            one = frozenset(shared.get(acts[0], (acts[0],)))
            groups.setdefault((one, s.value), (s, []))[1].extend(acts)
    return {tuple(dict.fromkeys(acts)): s for s, acts in groups.values()}


def _inherited(request: Request, opened: Opened, fixed: Mapping[tuple[str, ...], State]) -> _Inherited:
    unknowns, store = opened.problem.unknowns, request.store
    before = known_before(request, unknowns[: opened.own])
    moving = {q: store.states[p] for p in request.prior for q in store.states[p].acts}
    own = [unknowns[k] for k in before.at]
    states = [next((moving[n] for n in (u.name, *u.also) if n in moving), None) if u.kind == "parameter" else None for u in own]
    named = {group[0]: s for group, s in fixed.items()}
    at, rows = [int(k) for k in before.at], list(before.rows)
    for k, u in enumerate(unknowns[opened.own :], start=opened.own):
        state = named[u.name]
        row = store.rows([state.path])[0] * form(state, u)
        at.append(k)
        states.append(state)
        rows.append(np.concatenate([row, np.zeros(before.rows.shape[1] - row.size)]))
    return _Inherited(tuple(at), tuple(states), np.array(rows).reshape(len(at), before.rows.shape[1]))


def moves_above(request: Request, problem: Problem, found: Fit, level: float = 1.0) -> Moves:
    """Return what the logs of a fit say of the values that it inherited, fixed or as priors.

    Each value is opened without its prior in one step of Gauss and Newton from the end of the fit, by generalised least squares: traces
    are white noise plus an autocorrelated deviation, averaged over what their residuals allow (`weighed`). Unknowns of the fit that were
    not inherited stay free; the other inherited values count with their errors. Where a value moved, the step is taken again from where
    it led, since the model is not a straight line over so long a way. `level` is the variance of the noise of traces that are too short
    to show it, in squares of what was stated.
    """
    fixed = _fixed(request, problem)
    if not (fixed or request.prior):
        return Moves()
    opened = opened_at(request, problem, found.fitted, list(fixed))
    known = _inherited(request, opened, fixed)
    first, ahead = _tested(request, opened, known, opened.fitted, level)
    if MOVED not in [m.verdict for m in first.values]:
        return first
    try:
        return _tested(request, opened, known, ahead, level)[0]
    except (ScenarioError, SolverError):
        return first


def _tested(request: Request, opened: Opened, known: _Inherited, at: Array, level: float) -> tuple[Moves, Array]:
    """Return what the logs say with the derivatives at some values of all unknowns, and where these lead with the moved values free."""
    unknowns = opened.problem.unknowns
    start = opened.fitted.copy()
    for k, state in zip(known.at, known.states, strict=True):
        start[k] = unknowns[k].to_fitted(state.value if state is not None else request.store[unknowns[k].name].value)
    pieces = binned(opened.problem, at, request.loss, request.knee, STRETCHES)
    here = [replace(b, mean=b.mean + b.slopes @ (start - at)) for b in pieces.values()]
    priors, pulls = _beside(opened.problem, start, known.at)
    data = weighed(here, priors, pulls, level)
    test = Test.of(data, priors, pulls, known.at, known.root)
    asked = {k: s for k, s in enumerate(known.states) if s is not None}
    values = []
    for (k, state), s in zip(asked.items(), shifts(test, list(asked)), strict=True):
        u, there = unknowns[known.at[k]], known.at[k]
        alone, used = u.to_value(start[there] + s.size), u.to_value(opened.fitted[there])
        below = (state.value, request.store.error(state.path), state.random)
        values.append(_move(u.name, part_of(request.model, u.name), state.origin.stage or state.origin.kind, below, alone, used, u, s))
    rows = {m.path: k for m, k in zip(values, asked, strict=True)}
    far = [rows[m.path] for m in values if m.verdict == MOVED]
    groups = _groups(values, lambda several: together(test, [[rows[p] for p in g] for g in several], far))
    step = estimate(data, priors, pulls, known.at, known.root, far)
    low, high = (np.array(b) for b in zip(*(u.fitted_bounds() for u in unknowns), strict=True))
    inside = np.array([FARTHEST if u.log else math.inf for u in unknowns])
    return Moves(tuple(values), groups), np.clip(start + np.clip(step, -inside, inside), low, high)


def _beside(problem: Problem, start: Array, known: Sequence[int]) -> tuple[Array, Array]:
    """Return information and scores of the priors of unknowns that no stage below found."""
    info, pulls = np.zeros((start.size, start.size)), np.zeros(start.size)
    for k, u in enumerate(problem.unknowns):
        if u.prior is not None and k not in known:
            info[k, k] = u.prior.sd**-2
            pulls[k] = (u.prior.mean - start[k]) * u.prior.sd**-2
    return info, pulls


def _move(
    path: str, part: str, stage: str, below: tuple[float, float, float], alone: float, here: float, of: Unknown | FittedValue, s: Shift
) -> Move:
    """Return the move of a value; `below` is it with its error and random error; a detectable shift of a logarithm is one upward."""
    value, error, random = below
    detectable = (abs(value) * math.expm1(min(s.detectable, 50.0)) if of.log else s.detectable) if math.isfinite(s.size) else math.inf
    far = s.size / s.error if s.error > 0 else math.nan
    return Move(path, part, stage, value, alone, here, of.unit, far, s.chance, detectable, error, random)


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
        at, there = [own.index(p) for p in names], [order.index(q) for q in names.values()]
        below = stage.covariance[np.ix_(at, at)]
        spread[np.ix_(there, there)] = _less(below, found.covariance[np.ix_(there, there)])
    for _, before, q in pairs:
        here = found[q]
        shift[order.index(q)] = math.log(here.value / before.value) if here.log else here.value - before.value
    rows = [order.index(q) for *_, q in pairs]
    values = []
    for (stage, before, q), s in zip(pairs, normal_shifts(shift[rows], np.sqrt(np.diag(spread))[rows]), strict=True):
        known, here = (before.value, before.error, before.error_random), found[q]
        values.append(_move(q, place(q), stage.stage, known, here.value, here.value, here, s))

    def asked(groups: Sequence[Sequence[str]]) -> list[Together]:
        several = [[order.index(p) for p in g] for g in groups]
        return [normal_together(shift[r], spread[np.ix_(r, r)]) for r in several]

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
