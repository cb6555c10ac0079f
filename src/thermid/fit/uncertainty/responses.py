"""Responses of what a fit found to all sources of error: noise, priors, and the errors of values that the fit kept fixed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from thermid.fit.least_squares.solve import Fit
from thermid.fit.problem.keys import key_for
from thermid.fit.problem.known_before import form, known_before
from thermid.fit.problem.request import Request
from thermid.fit.problem.residuals import Problem
from thermid.fit.problem.unknowns import Unknown
from thermid.fit.uncertainty.opened import opened_at, opened_jacobian
from thermid.knowledge.sources import Normal, Source
from thermid.knowledge.store import State
from thermid.knowledge.values import rooted

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
        own, sources = rooted(self.noise[np.ix_(kept, kept)], key, words)
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
    noise = np.where(np.isfinite(random), random, 0.0)
    before = known_before(request, unknowns)
    table = _Table()
    if before.at.size:
        root = before.root
        table.add(before.sources, finite[:, before.at] @ (root.T @ root) @ before.rows)
    below = set(before.at.tolist())
    for k, u in enumerate(unknowns):
        if u.prior is None or (k in below and u.kind != "parameter"):
            continue
        own = finite[:, [k]] / u.prior.sd
        if u.kind == "local":
            noise = noise + own @ own.T
        else:
            table.add((_stated(request, u),), own)
    held = _fixed(request, unknowns)
    if held and unknowns:
        _consider(table, request, problem, found, held, finite / level)
    rows = np.array(list(table.columns.values())).reshape(len(table.columns), len(unknowns)).T
    return Responses(rows, tuple(table.sources.values()), noise, unlimited)


@dataclass
class _Table:
    """Columns of responses by the name of their source; what answers to one source twice is added."""

    sources: dict[str, Source] = field(default_factory=dict)
    columns: dict[str, Array] = field(default_factory=dict)

    def add(self, sources: Sequence[Source], rows: Array) -> None:
        """Add responses (unknowns, sources)."""
        for source, column in zip(sources, rows.T, strict=True):
            self.sources[source.name] = source
            self.columns[source.name] = self.columns.get(source.name, 0.0) + column


def _stated(request: Request, u: Unknown) -> Source:
    """Return the source that the stated prior of an unknown is; that of an instrument is one and the same in every stage."""
    if u.kind == "parameter":
        words = f"prior of {u.name}, stated in {request.name or request.model.title}"
        return Source(f"{key_for(request)[:16]}:prior of {u.name}", "stated", STANDARD, words)
    return Source(f"accuracy: {u.name}", "instrument", STANDARD, f"stated accuracy, {u.name}")


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


def _consider(table: _Table, request: Request, problem: Problem, found: Fit, fixed: list[State], gain: Array) -> None:
    """Add the responses to the errors of what was fixed; an instrument of which nothing is known counts with its accuracy."""
    here = covering(problem.unknowns)
    groups = {s.path: tuple(p for p in s.acts if p not in here) for s in fixed if s.kind == "parameter"}
    named = {group[0]: request.store[path] for path, group in groups.items()} | {s.path: s for s in fixed if s.kind != "parameter"}
    instruments = bool(request.held_bias) or request.held_errors is not None
    opened = opened_at(request, problem, found.fitted, list(groups.values()), instruments=instruments)
    own, other = opened_jacobian(opened, request.loss, request.knee)
    moves = -gain @ own.T @ other
    for k, u in enumerate(opened.problem.unknowns[opened.own :]):
        if u.name in named:
            row = request.store.rows([named[u.name].path])[0] * form(named[u.name], u)
            table.add(request.store.sources, np.outer(moves[:, k], row))
        elif u.prior is not None:
            table.add((_stated(request, u),), moves[:, [k]] * u.prior.sd)
