"""From the end of a fit to the store of its model: what was known before, with what the fit found in its place."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from thermid.fit.problem.keys import key_for
from thermid.fit.problem.request import Request
from thermid.fit.problem.residuals import Problem
from thermid.fit.uncertainty.responses import Responses
from thermid.knowledge.store import State, Store, ValueOrigin
from thermid.knowledge.values import FittedValue, FittedValues
from thermid.model.tree.resolve import deck_text, parameter_table

Array = NDArray[np.float64]


def stored(request: Request, problem: Problem, values: FittedValues, found: Responses) -> Store:
    """Return what is known once a fit is done.

    Parameters
    ----------
    request, problem    The fit's.
    values : FittedValues   What it found.
    found : Responses       What its errors come from.
    """
    kept = [k for k, u in enumerate(problem.unknowns) if u.kind != "local"]
    key = key_for(request)
    rows, sources = found.of(kept, key[:16], f"noise of stage '{values.stage}'")
    known = [not found.unlimited[k] for k in kept]
    origin = ValueOrigin("fit", values.stage, tuple(values.provenance["records"]), key, values.provenance["date"])
    decks = {p: deck_text(entry) for p, entry in parameter_table(request.model).items()}
    states = {v.path: replace(state_of(v, origin, decks), known=sure) for v, sure in zip(values.values(), known, strict=True)}
    seen = {sha: f"stage '{values.stage}' as '{name}'" for name, sha in values.provenance["records"].items()}
    return in_place(request.store, Store(states, sources, rows, seen, {values.stage: values.provenance}))


def in_place(before: Store, new: Store) -> Store:
    """Return what was known before with new states in the place of those that they stand for."""
    here = {n for s in new.states.values() for n in (s.path, *s.paths)}
    sources = tuple({s.name: s for s in (*before.sources, *new.sources)}.values())
    place = {s.name: k for k, s in enumerate(sources)}
    states: dict[str, State] = {}
    root = []
    for store in (before, new):
        columns = [place[s.name] for s in store.sources]
        for state, own in zip(store.states.values(), store.root, strict=True):
            kept = _left(state, here) if store is before else _after(state, before)
            if kept is not None:
                row = np.zeros(len(sources))
                row[columns] = own
                states[kept.path] = kept
                root.append(row)
    whole = replace(
        before,
        states=states,
        sources=sources,
        root=np.array(root).reshape(len(root), len(sources)),
        seen={**before.seen, **new.seen},
        provenance={**before.provenance, **new.provenance},
        left_out=tuple(dict.fromkeys((*before.left_out, *new.left_out))),
    )
    return whole.trimmed()


def _after(state: State, before: Store) -> State:
    """Return a state that knows whom it replaces."""
    old = [s for s in before.states.values() if s.path == state.path or set(s.paths) & set(state.paths)]
    return replace(state, history=tuple(dict.fromkeys(o for s in old for o in (*s.history, s.origin))))


def _left(state: State, here: set[str]) -> State | None:
    """Return what is left of a state once a fit has looked for some paths; None for nothing."""
    if state.kind != "parameter":
        return None if state.path in here else state
    paths = tuple(p for p in state.paths if p not in here)
    return replace(state, path=paths[0], paths=paths, hidden=tuple(p for p in state.hidden if p in paths)) if paths else None


def state_of(v: FittedValue, origin: ValueOrigin, decks: Mapping[str, str]) -> State:
    """Return the state that a value of a stage is; `decks` has the texts of the decks' values by path."""
    parameter = v.kind == "parameter"
    return State(
        v.path,
        v.value,
        v.log,
        v.unit,
        v.bounds,
        origin,
        v.kind,
        (v.path, *v.also) if parameter else (),
        deck=decks.get(v.path, ""),
        standing=v.standing,
        start=v.start,
        random=v.error_random,
        prior=v.prior,
    )
