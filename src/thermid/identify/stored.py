"""From the end of a fit to the store of its model: what was known before, with what the fit found in its place."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from thermid.identify.keys import key_for
from thermid.identify.request import Request
from thermid.identify.residuals import Problem
from thermid.identify.responses import Responses, covering
from thermid.identify.values import FittedValue, FittedValues
from thermid.knowledge.store import Origin, State, Store
from thermid.model.model import Model
from thermid.model.resolve import deck_text, parameter_table

__all__ = ["state_of", "stored"]

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
    rows, own = found.of(kept, key[:16], f"noise of stage '{values.stage}'")
    sources = tuple({s.name: s for s in (*request.store.sources, *own)}.values())
    place = {s.name: k for k, s in enumerate(sources)}
    rows = _placed(rows, [place[s.name] for s in own], len(sources))
    known = [not found.unlimited[k] for k in kept]
    origin = Origin("fit", values.stage, tuple(values.provenance["records"]), key, values.provenance["date"])
    before = request.store
    states: dict[str, State] = {}
    root: list[np.ndarray] = []
    for state, row in zip(before.states.values(), before.root, strict=True):
        rest = _left(state, covering(problem.unknowns))
        if rest is not None:
            states[rest.path] = rest
            root.append(np.concatenate([row, np.zeros(len(sources) - row.size)]))  # the sources of what was known before come first
    for v, row, sure in zip(values.values(), rows, known, strict=True):
        states[v.path] = replace(state_of(v, origin, request.model, before), known=sure)
        root.append(row)
    whole = replace(
        before,
        states=states,
        sources=sources,
        root=np.array(root).reshape(len(root), len(sources)),
        seen={**before.seen, **{sha: f"stage '{values.stage}' as '{name}'" for name, sha in values.provenance["records"].items()}},
        provenance={**before.provenance, values.stage: values.provenance},
    )
    return whole.trimmed()


def _placed(rows: Array, columns: list[int], count: int) -> Array:
    """Return responses (values, sources) with each column at its place among `count` sources."""
    out = np.zeros((rows.shape[0], count))
    out[:, columns] = rows
    return out


def _left(state: State, here: set[str]) -> State | None:
    """Return what is left of a state once a fit has looked for some paths; None for nothing."""
    if state.kind != "parameter":
        return None if state.path in here else state
    paths = tuple(p for p in state.paths if p not in here)
    return replace(state, path=paths[0], paths=paths, hidden=tuple(p for p in state.hidden if p in paths)) if paths else None


def state_of(v: FittedValue, origin: Origin, model: Model, before: Store) -> State:
    """Return the state that a value of a stage is; it takes the place of those known before."""
    paths = (v.path, *v.also) if v.kind == "parameter" else ()
    old = [s for s in before.states.values() if s.path == v.path or set(s.paths) & set(paths)]
    history = tuple(dict.fromkeys(o for s in old for o in (*s.history, s.origin)))
    deck = _deck(model, v.path) if v.kind == "parameter" else ""
    return State(
        v.path, v.value, v.log, v.unit, v.bounds, origin, v.kind, paths, (), "", deck, history,
        standing=v.standing, start=v.start, random=v.error_random, prior=v.prior,
    )  # fmt: skip


def _deck(model: Model, path: str) -> str:
    table = parameter_table(model)
    return deck_text(table[path]) if path in table else ""
