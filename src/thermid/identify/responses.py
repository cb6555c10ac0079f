"""Responses of what a fit found to all sources of error: noise, priors, and the errors of values that the fit kept fixed."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from thermid.identify.clock_search import at_clocks
from thermid.identify.inherit import form, known_before
from thermid.identify.request import Request
from thermid.identify.residuals import Problem
from thermid.identify.solve import Fit, ended
from thermid.identify.unknowns import Unknown
from thermid.knowledge.sources import Normal, Source
from thermid.knowledge.store import State, Store

__all__ = ["Responses", "covering", "responses"]

Array = NDArray[np.float64]
STANDARD = Normal()


@dataclass(frozen=True, eq=False)
class Responses:
    """What the errors of a fit come from.

    Parameters
    ----------
    rows : array (unknowns, sources)    Responses to what was known before, in the fitted form.
    sources : tuple of Source           What they respond to.
    noise : array (unknowns, unknowns)  Covariance by the noise of the readings, and by what is known of single records.
    unlimited : array (unknowns,)       Which unknowns the data say nothing of.
    """

    rows: Array
    sources: tuple[Source, ...]
    noise: Array
    unlimited: NDArray[np.bool_]

    @property
    def total(self) -> Array:
        """The covariance of the unknowns: the consider covariance of all that was fixed is part of it."""
        out = self.rows @ self.rows.T + self.noise
        out[self.unlimited, :] = out[:, self.unlimited] = 0.0
        out[self.unlimited, self.unlimited] = np.inf
        return np.asarray(out)

    def of(self, kept: list[int], key: str, words: str) -> tuple[Array, tuple[Source, ...]]:
        """Return the rows of some unknowns with columns for their noise, named by the key of the stage and a number."""
        inner = self.noise[np.ix_(kept, kept)]
        scale = np.sqrt(np.where(np.diag(inner) > 0, np.diag(inner), 1.0))
        sizes, vectors = np.linalg.eigh(inner / np.outer(scale, scale))
        own = scale[:, None] * vectors * np.sqrt(np.maximum(sizes, 0.0))
        sources = tuple(Source(f"{key}:{k}", "data", STANDARD, words) for k in range(len(kept)))
        return np.concatenate([self.rows[kept], own], axis=1), (*self.sources, *sources)


def responses(request: Request, problem: Problem, found: Fit, level: float, random: Array, weights: Array) -> Responses:
    """Return what the errors of a fit come from.

    With A and B the derivatives of the weighted residuals with respect to what was looked for and what was fixed, P the covariance of the
    priors and ``C = (A'A / level + P^-1)^-1``, an error of the priors moves the result by ``C P^-1`` times itself, one of what was fixed
    by ``-C A'B / level`` (consider covariance: Tapley, Schutz, Born, Statistical Orbit Determination, 2004, ch. 6).

    Parameters
    ----------
    level : float       Variance of residuals that do not wander, in squares of the noise.
    random : array      Covariance by the scatter of the residuals; see `covariances`.
    weights : array     C.
    """
    unknowns = problem.unknowns
    unlimited = ~np.isfinite(np.diag(weights))
    finite = np.where(np.isfinite(weights), weights, 0.0)
    before = known_before(request, unknowns)
    root = before.root if before.at.size else np.zeros((0, 0))
    parts = [finite[:, before.at] @ (root.T @ root) @ before.rows]
    noise = np.where(np.isfinite(random), random, 0.0)
    sources, below = list(before.sources), set(before.at.tolist())
    for k, u in enumerate(unknowns):
        if u.prior is None or (k in below and u.kind != "parameter"):
            continue
        own = finite[:, k] / u.prior.sd
        if u.kind == "local":
            noise = noise + np.outer(own, own)
        else:
            sources.append(_stated(request, u))
            parts.append(own[:, None])
    rows = np.concatenate(parts, axis=1)
    wide = np.zeros((len(unknowns), len(sources)))
    wide[:, : rows.shape[1]] = rows
    held = _fixed(request, unknowns)
    if held and unknowns:
        moves, fixed = _moves(request, problem, found, held)
        wide[:, : len(request.store.sources)] -= finite @ moves / level @ fixed
    return Responses(wide, tuple(sources), noise, unlimited)


def _stated(request: Request, u: Unknown) -> Source:
    """Return the source that the stated prior of an unknown is; that of an instrument is one and the same in every stage."""
    if u.kind == "parameter":
        return Source(f"prior of {u.name}, {_name(request)}", "stated", STANDARD, f"prior of {u.name}, stated in {_name(request)}")
    return Source(f"accuracy: {u.name}", "instrument", STANDARD, f"stated accuracy, {u.name}")


def _name(request: Request) -> str:
    return request.name or request.model.title


def covering(unknowns: tuple[Unknown, ...] | list[Unknown]) -> set[str]:
    """Return every path and instrument that a fit looks for, instances that share a value among them."""
    return {n for u in unknowns if u.kind != "local" for n in (u.name, *u.also)}


def _fixed(request: Request, unknowns: tuple[Unknown, ...]) -> list[State]:
    """Return what is known with an error and was not looked for."""
    here, store = covering(unknowns), request.store
    return [
        s
        for s in store.states.values()
        if s.known and store.rows([s.path]).any() and (set(s.acts) - here if s.kind == "parameter" else s.path not in here)
    ]


def _moves(request: Request, problem: Problem, found: Fit, fixed: list[State]) -> tuple[Array, Array]:
    """Return A'B (unknowns, fixed values) and the rows of the fixed values, of those that act in the records."""
    here = covering(problem.unknowns)
    paths = [p for u in problem.unknowns if u.kind == "parameter" for p in (u.name, *u.also)]
    more = [p for s in fixed if s.kind == "parameter" for p in s.acts if p not in here]
    known = {p: s for s in fixed for p in (s.acts if s.kind == "parameter" else (s.path,)) if p not in here}
    # each path by itself, so that an instance can be fixed beside one that is free
    opened = _opened(request, problem, (*paths, *more))
    owner = {n: k for k, u in enumerate(problem.unknowns) for n in (u.name, *u.also)}
    at = [
        float(found.fitted[owner[u.name]]) if u.name in owner else u.to_fitted(known[u.name].value if u.name in known else u.start)
        for u in opened.unknowns
    ]
    jacobian = ended(at_clocks(opened, np.array(at)), np.array(at), request.loss, request.knee).jacobian
    own = np.zeros((jacobian.shape[0], len(problem.unknowns)))
    for k, u in enumerate(opened.unknowns):
        if u.name in owner:
            own[:, owner[u.name]] += jacobian[:, k]
    rest = [k for k, u in enumerate(opened.unknowns) if u.name not in owner and u.name in known]
    rows = [request.store.rows([known[u.name].path])[0] * form(known[u.name], u) for k in rest for u in (opened.unknowns[k],)]
    return own.T @ jacobian[:, rest], np.array(rows).reshape(len(rest), len(request.store.sources))


def _opened(request: Request, problem: Problem, paths: tuple[str, ...]) -> Problem:
    """Return the problem with other paths free, and every instrument looked for."""
    from thermid.identify.gather import problem_for

    opened = replace(request, free=paths, untie=True, store=Store(), prior=(), priors={}, bias_priors={}, held_bias={}, held_errors=None)
    return replace(problem_for(opened), noise=problem.noise)
