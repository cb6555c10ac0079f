"""What a stage is given of the stages below: their stores, which of their values it may move, and the joint prior of those."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from thermid.errors import DeckError, nearest
from thermid.identify.unknowns import Unknown
from thermid.knowledge.sources import Source
from thermid.knowledge.store import State, Store

if TYPE_CHECKING:
    from thermid.identify.calibration import Calibration
    from thermid.identify.campaign_schema import InheritTable
    from thermid.identify.request import Request
    from thermid.measure import Record

__all__ = ["KnownBefore", "counted_twice", "handed_on", "known_before", "may_move"]

Array = NDArray[np.float64]
STIFF = 1e-10
"""Variance of a direction, beside the largest, below which values count as known exactly against one another."""


def handed_on(below: Calibration, inherit: InheritTable, where: str) -> Store:
    """Return what a stage hands on of its store, at every depth: all of it, less what `only` and `without` keep back.

    Raises
    ------
    DeckError   When either names a value that the stage does not have.
    """
    store, own = below.store, set(below.values.parameters)
    _known(inherit.only, own, f"{where}.only", f"was not fitted by stage '{below.stage}'")
    _known(inherit.without, store.parameters, f"{where}.without", f"is not known to stage '{below.stage}'")
    back = {p for p in own if inherit.only and p not in inherit.only} | set(inherit.without)
    return store.only(lambda s: s.path not in back) if back else store


def may_move(store: Store, inherit: InheritTable, where: str) -> set[str]:
    """Return the values handed on, by their paths in the stage below, that are free in the stage above.

    Raises
    ------
    DeckError   When `move` names what is not handed on, or values are fixed.
    """
    if inherit.move and inherit.as_ != "prior":
        raise DeckError('`move` says which values of a prior may move; with as = "fixed" none does.', f"{where}.move")
    _known(inherit.move, store.parameters, f"{where}.move", "is not handed on")
    return set(inherit.move or store.parameters) if inherit.as_ == "prior" else set()


def _known(names: Sequence[str], among: Mapping[str, object] | set[str], where: str, words: str) -> None:
    for name in names:
        if name not in among:
            raise DeckError(f"'{name}' {words}.{nearest(name, among)}", where)


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


def counted_twice(store: Store, prior: Sequence[str], records: Sequence[Record]) -> list[str]:
    """Return a remark for every record whose readings reach a stage as samples and, through a stage below, as prior too.

    Parameters
    ----------
    store : Store       What the stages below know.
    prior : sequence    Which of it may move.
    records : tuple     The stage's own.
    """
    origins = {o.stage for p in prior for s in (store.states[p],) for o in (s.origin, *s.history)}
    used = {sha: stage for stage in origins for sha in store.provenance.get(stage, {}).get("records", {}).values()}
    return [
        f"record '{r.name}' was fitted by stage '{used[r.origin.sha256]}' too, whose result is a prior here: its readings count twice, and "
        "the errors are too small. Hand the values on as fixed, or use another record."
        for r in records
        if r.origin.sha256 in used
    ]
