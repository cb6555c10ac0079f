"""What is known of a model once a part was replaced: nothing of the old part, the place's values with a wide start, all else as it was."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from thermid.knowledge.graft import graft
from thermid.knowledge.sources import Normal, Source
from thermid.knowledge.store import Origin, State, Store
from thermid.model.tree.identity import inside
from thermid.model.tree.model import Model
from thermid.model.tree.replacement import PlaceStart, Replacement
from thermid.model.tree.tree import ParameterSet

STEP = 1e-4
"""Relative change by which the response of a joint to the number behind it is found."""


def placed(before: Store, old: Model, new: Model, what: Replacement, below: Store, stage: str) -> Store:
    """Return what is known of a model after a replacement.

    Parameters
    ----------
    before : Store          What was known of the model with the old part.
    old, new : Model        The model before, and after with every value of the place at its start.
    what : Replacement      What became of the values.
    below : Store           What stages below found of the new part and its place; its values win over starts.
    stage : str             The stage whose model it is; it hands on the starts as what it knows.
    """
    told = known_below(below, what)
    starts = starts_of(before, old, new, [s for s in what.starts if s.path not in told.states], stage)
    rest = before.drop(what.path)
    for one in what.starts:
        rest = rest.drop(one.path)
    whole = graft(new, [(".", rest), (".", starts), (".", told)])[0]
    return replace(whole, dropped=(*whole.dropped, *what.dropped))


def known_below(below: Store, what: Replacement) -> Store:
    """Return what stages below found of the new part and its place.

    What a test of the part alone says of a coefficient is that of its bench; where it is installed it starts from what the place had.
    """
    place = {s.path for s in what.starts}
    bench = {s.path for s in what.starts if s.of_part}

    def of_place(s: State) -> bool:
        own = all(inside(p, what.path) or p in place for p in s.paths)
        return s.kind == "parameter" and own and not (s.path in bench and s.at == what.path)

    return below.only(of_place)


def starts_of(before: Store, old: Model, new: Model, starts: Sequence[PlaceStart], stage: str) -> Store:
    """Return the starts of values of a place as states.

    A joint has the error of the joint that it is taken from and, besides, what joints of one kind differ by. A coefficient inside the
    part has the stated error, of which what the fit before left open is a part, or that alone where it is more.
    """
    values, table = ParameterSet(old), ParameterSet(new).table
    columns = len(before.sources)
    own, states = [], {}
    root = np.zeros((len(starts), columns + len(starts)))
    for k, one in enumerate(starts):
        given = table[one.path].parameter
        literal = given.expression.literal
        assert literal is not None
        row = _response(before, values, one.path)
        known = float(np.linalg.norm(row)) if one.of_part else 0.0
        root[k, :columns], root[k, columns + k] = row, math.sqrt(max(one.log_sd**2 - known**2, 0.0))
        own.append(Source(f"start of {one.path} after a replacement", "stated", Normal(), str(one)))
        low = given.minimum if given.minimum is not None else 0.0
        high = given.maximum if given.maximum is not None else math.inf
        at, origin = literal.value, Origin("twin", stage)
        ends = (low, high)
        states[one.path] = State(one.path, at, True, given.unit, ends, origin, paths=(one.path,), deck=given.text, start=at)
    return Store(states, (*before.sources, *own), root)


def _response(before: Store, values: ParameterSet, path: str) -> NDArray[np.float64]:
    """Return how the logarithm of a value responds to the sources of what was known of the numbers behind it."""
    out = np.zeros(len(before.sources))
    at = float(values.evaluate({})[path])
    for state in before.parameters.values():
        if not state.known or path not in values.downstream(state.acts):
            continue
        moved = float(values.evaluate(dict.fromkeys(state.acts, state.value * (1.0 + STEP)))[path])
        share = math.log(moved / at) / (math.log1p(STEP) if state.log else STEP * state.value)
        out += share * before.rows([state.path])[0]
    return out
