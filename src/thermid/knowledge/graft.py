"""Stores of parts become the store of the whole."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thermid.errors import DeckError
from thermid.knowledge.store import State, Store
from thermid.model.tree.identity import depth
from thermid.model.tree.model import Model

Array = NDArray[np.float64]


def graft(model: Model, below: Sequence[tuple[str, Store]]) -> tuple[Store, tuple[str, ...]]:
    """Return the stores of parts as one store of the whole, and remarks on values of which two states arrive.

    Parameters
    ----------
    model : Model       The whole.
    below : sequence    Part (``.`` for the model itself) and store, in any order.

    Of two states of one value the one nearer the root of the assembly holds, or the one that was found with the other known. What several
    stages say of one instrument is combined by generalised least squares.

    Raises
    ------
    DeckError   When two stages give one value at the same depth, and neither knew of the other.
    """
    parts = [("" if part == "." else model.canonical(part), store) for part, store in below]
    sources = tuple({s.name: s for _, store in parts for s in store.sources}.values())
    place = {s.name: k for k, s in enumerate(sources)}
    offered: dict[str, list[tuple[str, State, Array]]] = {}
    for part, store in sorted(parts, key=lambda item: (depth(item[0]), item[0])):
        columns = [place[s.name] for s in store.sources]
        for state, own in zip(store.states.values(), store.root, strict=True):
            row = np.zeros(len(sources))
            row[columns] = own
            moved = state.under(part) if part else state
            offered.setdefault(moved.path, []).append((part, moved, row))
    chosen, remarks = {}, []
    for path, several in offered.items():
        state, row, remark = _chosen(path, several)
        chosen[path] = (state, row)
        remarks += remark
    whole = Store(
        {p: s for p, (s, _) in chosen.items()},
        sources,
        np.array([row for _, row in chosen.values()]).reshape(len(chosen), len(sources)),
        {sha: who for _, store in parts for sha, who in store.seen.items()},
        {stage: _provenance(known, part) for part, store in parts for stage, known in store.provenance.items()},
        tuple(dict.fromkeys(_under(c, part) for part, store in parts for c in store.cuts)),
        tuple(dict.fromkeys(replace(d, path=_under(d.path, part)) for part, store in parts for d in store.dropped)),
        tuple(dict.fromkeys(x for _, store in parts for x in store.left_out)),
    )
    return whole.trimmed(), tuple(remarks)


def _chosen(path: str, several: Sequence[tuple[str, State, Array]]) -> tuple[State, Array, list[str]]:
    """Return the state of a value of which several arrive, its row, and a remark where another was set aside."""
    kept: list[tuple[str, State, Array]] = []
    for part, state, row in several:
        if any(s.same(state) or s.replaces(state) for _, s, _ in kept):
            continue
        kept = [k for k in kept if not state.replaces(k[1])] + [(part, state, row)]
    if kept[0][1].kind != "parameter":
        return *_combined([s for _, s, _ in kept], np.array([r for _, _, r in kept])), []
    nearest_root = [k for k in kept if depth(k[0]) == depth(kept[0][0])]
    if len(nearest_root) > 1:
        one, two = nearest_root[0][1].origin, nearest_root[1][1].origin
        raise DeckError(
            f"{one} and {two} both give '{path}', and neither knew of the other. Inherit one of them, or leave the value out of one by "
            f'without = ["{path}"].'
        )
    _, state, row = kept[0]
    return state, row, [f"'{path}': {state.origin} wins over {s.origin}, which is further from the root." for _, s, _ in kept[1:]]


def _combined(states: Sequence[State], rows: Array) -> tuple[State, Array]:
    """Return what several stages say of one instrument as one state: the best linear unbiased estimate, and its row."""
    if len(states) == 1:
        return states[0], rows[0]
    order = sorted(range(len(states)), key=lambda k: states[k].origin.stage)
    states, rows = [states[k] for k in order], rows[order]
    scores = np.linalg.pinv(rows @ rows.T, hermitian=True).sum(axis=0)
    shares = scores / scores.sum() if scores.sum() > 0 else np.full(len(states), 1.0 / len(states))
    fitted = float(shares @ [s.fitted for s in states])
    history = tuple(dict.fromkeys(o for s in states for o in (*s.history, s.origin)))
    value = float(np.exp(fitted)) if states[0].log else fitted
    return replace(states[0], value=value, history=history), shares @ rows


def _under(path: str, part: str) -> str:
    return f"{part}.{path}" if part else path


def _provenance(known: Mapping[str, Any], part: str) -> Mapping[str, Any]:
    """Return what is known of a fit, its places by their paths in the model above."""
    moved = {n: {_under(p, part): x for p, x in known[n].items()} for n in ("conditions", "misfit") if n in known}
    structural = {"structural": structural_under(known["structural"], f"{part}.")} if part and "structural" in known else {}
    return {**known, **moved, **structural}


def structural_under(kept: Mapping[str, Any], ahead: str) -> dict[str, Any]:
    """Return what a fit keeps of structural errors (`Discrepancy.to_dict`), its places by their paths in the model above.

    Parameters
    ----------
    kept : dict
    ahead : str     What paths begin with there, such as ``unit.``; names of instruments hold a space and stay.
    """
    placed = {n: {ahead + p: x for p, x in kept[n].items()} for n in ("conditions", "misfit", "surfaces")}
    modes = [{**m, "path": ahead + m["path"]} for m in kept["modes"]]
    names = [n if " " in n else ahead + n for n in kept["names"]]
    return {**kept, **placed, "modes": modes, "names": names, "separated": [ahead + p for p in kept["separated"]]}
