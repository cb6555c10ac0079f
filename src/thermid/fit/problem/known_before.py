"""What stages below found of the unknowns of a fit: values, and responses to named sources, in the fitted form."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from thermid.fit.problem.request import Request
from thermid.fit.problem.unknowns import Unknown
from thermid.knowledge.sources import Source
from thermid.knowledge.store import State, Store

Array = NDArray[np.float64]
STIFF = 1e-10
"""Variance of a direction, beside the largest, below which values count as known exactly against one another."""


@dataclass(frozen=True, eq=False)
class KnownBefore:
    """What stages below found of the unknowns of a fit.

    Parameters
    ----------
    at : array (n,)             Positions of those among the unknowns that they know.
    mean : array (n,)           Their values, in the fitted form of the unknowns.
    rows : array (n, sources)   Their responses, in that form.
    sources : tuple of Source   What they respond to.
    """

    at: NDArray[np.int64]
    mean: Array
    rows: Array
    sources: tuple[Source, ...]

    @property
    def root(self) -> Array:
        """A root R of their information, ``R'R = (rows rows')^-1``: the residual of the joint prior is ``R (fitted - mean)``."""
        covariance = self.rows @ self.rows.T
        scale = np.sqrt(np.diag(covariance))
        sizes, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
        return np.asarray((vectors / np.sqrt(np.maximum(sizes, STIFF * sizes.max(initial=0.0)))).T / scale)


def known_before(request: Request, unknowns: Sequence[Unknown]) -> KnownBefore:
    """Return what the stages below found of the values that a fit may move, and of its instruments.

    The accuracy of an instrument is part of what they found of it, so it counts once. Instances that a fit unties start from the same
    value; each has its error for itself.
    """
    store = request.store
    at, mean, sources = [], [], list(store.sources)
    rows: list[Array] = []
    taken: list[State] = []
    moving = {q: store.states[p] for p in request.prior for q in store.states[p].acts}
    for k, u in enumerate(unknowns):
        state = _state_of(store, moving, u)
        if state is None:
            continue
        row = store.rows([state.path])[0] * form(state, u)
        if any(s.same(state) for s in taken):
            sources += [replace(s, name=f"{s.name} at {u.name}") for s in store.sources]
            rows = [np.concatenate([r, np.zeros(len(store.sources))]) for r in rows]
            row = np.concatenate([np.zeros(len(sources) - len(store.sources)), row])
        taken.append(state)
        at.append(k)
        mean.append(u.to_fitted(state.value))
        rows.append(np.concatenate([row, np.zeros(len(sources) - row.size)]))
    return KnownBefore(np.array(at, dtype=np.int64), np.array(mean), np.array(rows).reshape(len(at), len(sources)), tuple(sources))


def form(state: State, unknown: Unknown) -> float:
    """Return d unknown / d state, both in their fitted forms."""
    return (state.value if state.log else 1.0) / (state.value if unknown.log else 1.0)


def _state_of(store: Store, moving: Mapping[str, State], unknown: Unknown) -> State | None:
    """Return what is known of an unknown below; None for nothing, or where the fit is not to rest on it."""
    if unknown.kind == "parameter":
        found = next((moving[n] for n in (unknown.name, *unknown.also) if n in moving), None)
    else:
        found = store.states.get(unknown.name)
    return found if found is not None and found.known and store.rows([found.path]).any() else None
