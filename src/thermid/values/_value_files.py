"""Values from files: tuned by hand as a stage without records, or laid over a model as its decks are now."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from thermid.base.errors import DeckError, errors_at
from thermid.base.files import Places, refuse_another_kind
from thermid.base.units import TEMPERATURE
from thermid.model.tree import Model, ParameterSet, literal
from thermid.values._fitted import FittedValues, load_store, read_values, values_of
from thermid.values._spreads import read_spread
from thermid.values._store import LeftOut, LogNormal, Normal, Source, State, Store, Uniform, ValueOrigin, graft

UNIT = Uniform(-math.sqrt(3.0), math.sqrt(3.0))
"""As likely anywhere between its ends, of variance one."""


def hand_values(path: Path, model: Model, stage: str, where: str) -> Store:
    """Return the store of a values file as values tuned by hand at a stage.

    Parameters
    ----------
    path : Path     A file that thermid wrote, or one with rows ``"path" = "0.21 [W/K]"``, ``{ value, sd }`` or ``{ low, high }``.
    model : Model   What the values are of.
    stage : str     The stage.
    where : str     For messages.

    Raises
    ------
    DeckError   When a row names no value of the model, or gives none.
    """
    data = read_values(path)
    if "schema" in data:
        store = load_store(path)[0].in_decks(model)[0].matching(model)
        key = hashlib.sha256(repr([*store.states.values(), store.root.tolist()]).encode()).hexdigest()
        mine = ValueOrigin("hand", stage, (), key)
        return replace(store, states={p: replace(s, origin=mine) if s.origin.kind == "hand" else s for p, s in store.states.items()})
    rows = data.get("values", {k: v for k, v in data.items() if k not in ("title", "note")})
    if not rows:
        raise DeckError(
            f'\'{path.name}\' holds no value. Write rows like "lid.conductance" = "0.21 [W/K]".', where, code="file.key-missing"
        )
    key = hashlib.sha256(json.dumps([stage, data], sort_keys=True, default=str).encode()).hexdigest()
    with errors_at(f"{where}, {path.name}"):
        try:
            tables = {k: _as_table(k, v, where) for k, v in rows.items()}
        except DeckError:
            refuse_another_kind("values", data, Places(path.name))
            raise
        return _store(tables, model, ValueOrigin("hand", stage, (), key))


def stated_values(rows: Mapping[str, Mapping[str, Any]], model: Model, stage: str) -> Store:
    """Return the store of values that a stage states in its own table, path -> { value, sd } or { low, high }."""
    key = hashlib.sha256(json.dumps([stage, rows], sort_keys=True, default=str).encode()).hexdigest()
    return _store(rows, model, ValueOrigin("hand", stage, (), key))


def _as_table(name: str, row: Any, where: str) -> Mapping[str, Any]:
    """Return a row of a hand-written file as a table with `value`, or with `low` and `high`; refuse any other row."""
    table = {"value": row} if isinstance(row, str) else row
    if not isinstance(table, Mapping) or not ({"value"} <= set(table) or {"low", "high"} <= set(table)):
        raise DeckError(f"'{name}' needs a text with a unit, {{ value, sd }} or {{ low, high }}.", where, code="value.wrong-kind")
    return table


def _store(rows: Mapping[str, Mapping[str, Any]], model: Model, origin: ValueOrigin) -> Store:
    """Return the store of hand-written rows, path -> table: each value with an error has a source of its own."""
    values = ParameterSet(model)
    states, sources, sizes = {}, [], []
    for raw, table in rows.items():
        path = values.freeable(raw, model.canonical)
        state, source, size = _state(path, table, values, origin)
        states[path] = state
        sizes.append(size)
        sources.append(source)
    words = "was tuned by hand at stage '{}' without an error, so the errors here are too small. Give {{ value, sd }} there"
    left_out = tuple(LeftOut(f"'{p}' {words.format(origin.stage)}") for p, s in states.items() if not s.known)
    return Store(states, tuple(sources), np.diag(np.array(sizes)), left_out=left_out).trimmed()


def _state(path: str, table: Mapping[str, Any], values: ParameterSet, origin: ValueOrigin) -> tuple[State, Source, float]:
    """Return the state of a hand-written row, its source of error, and its standard deviation in the fitted form; zero without an error."""
    entry = values.table[path]
    old = entry.parameter
    slot = TEMPERATURE if old.unit in ("degC", "degF") else old.unit or "1"
    spread = {("mean" if k == "value" else k): v for k, v in table.items()}
    law = read_spread(spread, slot, 0.0, path) if set(spread) - {"mean"} else None
    value = law.mean if isinstance(law, Uniform) else literal(table["value"], slot, path)
    parameter = values.bounded(path)
    log, low, high = parameter.form(path, values.dimension(path), value)
    size = math.sqrt(law.variance) / (value if log else 1.0) if law is not None else 0.0
    size = law.log_sd if isinstance(law, LogNormal) and log else size
    shape = UNIT if isinstance(law, Uniform) else Normal()
    words = f"{path}, tuned by hand at stage '{origin.stage}'"
    deck, start = entry.deck_text, float(values.evaluate({}, [path])[path])
    unit, bounds = parameter.unit or "1", (low, high)
    state = State(path, value, log, unit, bounds, origin, "parameter", (path,), deck=deck, start=start, known=law is not None)
    return state, Source(f"{origin.key[:16]}:{path}", "stated", shape, words), size


@dataclass(frozen=True, eq=False)
class Filed:
    """A model with a values file laid over it, and what is to be said of the file.

    Parameters
    ----------
    model : Model           With the values laid over it; what a [set] above says still wins.
    values : FittedValues   What still applies, by the paths of the part that the file is of.
    gone : tuple of str     Values that are left out, since the decks give them otherwise by now.
    hidden : tuple of str   Values of logs, and places where a [set] or another value hides one of the file.
    at : str                The submodel that the file is of; empty for the model itself.
    """

    model: Model
    values: FittedValues
    gone: tuple[str, ...] = ()
    hidden: tuple[str, ...] = ()
    at: str = ""

    @property
    def lines(self) -> tuple[str, ...]:
        """All remarks on the file, in the order of importance."""
        return (*self.gone, *self.hidden)

    @staticmethod
    def read(path: Path, model: Model, *, at: str = "", keep: bool = False) -> Filed:
        """Return a model with a values file laid over it, whoever wrote the file.

        Parameters
        ----------
        path : Path     A file of a stage, of the studio, or one written by hand.
        model : Model   As its decks are now.
        at : str        The submodel that the file is of; empty for the model itself.
        keep : bool     Whether to keep states of values that the decks give otherwise by now.

        Raises
        ------
        ThermidError   When it is no values file, or is of another model.
        """
        part = model.submodel(at) if at else model
        by_hand = "schema" not in read_values(path)
        store, stage = (hand_values(path, part, path.name, path.name), path.name) if by_hand else load_store(path)
        store, of_logs = store.in_decks(part)
        matching = store if keep else store.matching(part)
        gone = tuple(f"{d.path} = {d.text} of {d.origin} was ignored: {d.why}." for d in matching.dropped[len(store.dropped) :])
        placed, twins = graft(model, [(at, matching)]) if at else (matching, ())
        model_with_values = placed.laid_over(model)
        hidden = (*of_logs, *twins, *placed.acting_in(model_with_values)[1])
        return Filed(model_with_values, values_of(matching, stage), gone, hidden, at)
