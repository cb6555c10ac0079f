"""The values file: a whole store as TOML, bit for bit; files of schema 1 are read too."""

from __future__ import annotations

import json
import math
import os
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thermid.errors import DeckError
from thermid.files import VALUES, parse_toml, read_text, write_text
from thermid.knowledge import laws
from thermid.knowledge.sources import LeftOut, Source
from thermid.knowledge.standing import UNJUDGED, Standing
from thermid.knowledge.store import Origin, State, Store
from thermid.linear_algebra import square_root
from thermid.model.tree.replacement import Dropped
from thermid.units import unit

Array = NDArray[np.float64]
SCHEMA = 2
AGREES = 1e-6
"""Relative difference between an error and its row beyond which a file was changed by hand. [-]"""
OLD = (
    "the values file is of the old format (schema 1): values that stage '{stage}' inherited are not in it, the response of its values to "
    "convection exponents is taken as zero, and whether the decks changed since cannot be told. Run the campaign again to have all of it."
)


def save_store(store: Store, path: str | os.PathLike[str], stage: str) -> None:
    """Write everything that a stage knows.

    Parameters
    ----------
    store : Store   What is known.
    path : path     The file.
    stage : str     The stage whose store it is.
    """
    head = {
        "schema": SCHEMA,
        "stage": stage,
        "seen": dict(store.seen),
        "cuts": list(store.cuts),
        "dropped": [_plain(d) for d in store.dropped],
        "left_out": [{"what": x.what, "kelvin": x.kelvin} for x in store.left_out],
    }
    lines = ["# Values with their errors and origins. Written by thermid; the decks stay as their authors wrote them."]
    lines += [f"{name} = {_toml(x)}" for name, x in head.items()]
    for name, known in store.provenance.items():
        lines += ["", f"[provenance.{_toml(name)}]", *(f"{_toml(k)} = {_toml(v)}" for k, v in known.items())]
    for name, state in store.states.items():
        lines += ["", f"[values.{_toml(name)}]", *(f"{k} = {_toml(v)}" for k, v in _kept(state, store).items())]
    for source in store.sources:
        lines += ["", "[[sources]]", f"name = {_toml(source.name)}", f"kind = {_toml(source.kind)}"]
        lines += [f"law = {_toml(_law_kept(source.law))}", f"words = {_toml(source.words)}"]
    for group in _groups(store):
        rows = {p: row for p, row in zip(store.states, store.root[:, group].tolist(), strict=True) if any(row)}
        lines += ["", "[[root]]", f"sources = {_toml(group)}", *(f"{_toml(p)} = {_toml(row)}" for p, row in rows.items())]
    write_text(path, "\n".join([*lines, ""]), VALUES.of(stage))


def _groups(store: Store) -> Iterable[list[int]]:
    """Yield the positions of sources of one stage, or of one kind."""
    out: dict[str, list[int]] = {}
    for k, source in enumerate(store.sources):
        out.setdefault(source.name.partition(":")[0] if source.kind == "data" else source.kind, []).append(k)
    return out.values()


def _kept(state: State, store: Store) -> dict[str, Any]:
    """Return a state as the file holds it; text and error are for people."""
    of = unit(state.unit)
    out = {
        "value": state.value,
        "text": f"{(state.value - float(of.offset)) / float(of.factor):.9g} [{state.unit}]",
        "error": store.error(state.path),
        "error_random": state.random,
        "transform": "log" if state.log else "linear",
        "unit": state.unit,
        "start": state.start,
        "bounds": list(state.bounds),
        "kind": state.kind,
        "acts": list(state.paths),
        "hidden": list(state.hidden),
        "at": state.at,
        "deck": state.deck,
        "known": state.known,
        "origin": _plain(state.origin),
        "history": [_plain(o) for o in state.history],
        "standing": state.standing.kept(),
    }
    return out | ({"prior": list(state.prior)} if state.prior is not None else {})


def _plain(thing: Any) -> dict[str, Any]:
    """Return a frozen dataclass of plain values as a table."""
    return {f.name: list(x) if isinstance(x := getattr(thing, f.name), tuple) else x for f in fields(thing)}


def _law_kept(law: Any) -> dict[str, Any]:
    own = {f.name: getattr(law, f.name) for f in fields(law)}
    return {"form": type(law).__name__} | {n: _law_kept(x) if is_dataclass(x) else x for n, x in own.items()}


def _law_read(table: Mapping[str, Any]) -> Any:
    own = {n: _law_read(x) if isinstance(x, Mapping) else x for n, x in table.items() if n != "form"}
    return getattr(laws, table["form"])(**own)


def _toml(value: Any) -> str:
    """Return a value on one line; every digit of a number is kept."""
    if isinstance(value, bool | np.bool_):
        return "true" if value else "false"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, int):
        return str(value)
    if isinstance(value, float | np.floating):
        return repr(float(value))
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{_toml(str(k))} = {_toml(v)}" for k, v in value.items()) + " }" if value else "{}"
    return "[" + ", ".join(_toml(x) for x in value) + "]"


def read_values(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Return the content of a values file, whoever wrote it.

    Raises
    ------
    DeckError   When it is missing or is no TOML.
    """
    target = Path(path)
    if not target.is_file():
        raise DeckError(f"there is no values file '{target.name}'. Run the calibration first.")
    try:
        return parse_toml(read_text(target))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise DeckError(f"this is no values file of thermid: {error}.", target.name) from None


def load_store(path: str | os.PathLike[str]) -> tuple[Store, str]:
    """Return what a values file holds, and the stage whose store it is.

    Raises
    ------
    DeckError   When it is missing, is no values file, or was changed by hand.
    """
    target, data = Path(path), read_values(path)
    if not data:
        raise DeckError("this is no values file of thermid: it is empty.", target.name)
    if "schema" not in data:
        raise DeckError(
            "this file was written by hand: its units and bounds are those of a deck. Lay it over one by --values, or give it to a stage "
            "of a campaign as `values`.",
            target.name,
        )
    try:
        store = _read(data) if data["schema"] != 1 else _read_old(data)
        stage = str(data["stage"])
    except (KeyError, TypeError, ValueError, AttributeError, IndexError) as error:
        raise DeckError(f"this is no values file of thermid: {error}.", target.name) from None
    for name, v in data["values"].items():
        own, said = store.error(name), float(v["error"])
        if data["schema"] != 1 and own != said and not math.isclose(own, said, rel_tol=AGREES):
            raise DeckError(
                f"the error of '{name}' is {said:g} in its table and {own:g} by its row: the file was changed by hand.", target.name
            )
    return store, stage


def _read(data: Mapping[str, Any]) -> Store:
    states = {name: _state(name, v) for name, v in data["values"].items()}
    given = data.get("sources", [])
    sources = tuple(Source(s["name"], s["kind"], _law_read(s["law"]), s["words"]) for s in given)
    root, order = np.zeros((len(states), len(sources))), {name: k for k, name in enumerate(states)}
    for group in data.get("root", []):
        columns = group["sources"]
        for name, row in group.items():
            if name != "sources":
                root[order[name], columns] = row
    return Store(
        states,
        sources,
        root,
        data["seen"],
        data.get("provenance", {}),
        tuple(data["cuts"]),
        tuple(Dropped(**d) for d in data["dropped"]),
        tuple(LeftOut(**x) for x in data["left_out"]),
    )


def _origin(table: Mapping[str, Any]) -> Origin:
    return Origin(**{**table, "records": tuple(table["records"])})


def _state(name: str, v: Mapping[str, Any]) -> State:
    low, high = v["bounds"]
    return State(
        name,
        float(v["value"]),
        v["transform"] == "log",
        v["unit"],
        (float(low), float(high)),
        _origin(v["origin"]),
        v["kind"],
        tuple(v["acts"]),
        tuple(v["hidden"]),
        v["at"],
        v["deck"],
        tuple(_origin(o) for o in v["history"]),
        Standing.read(v["standing"]),
        float(v["start"]),
        float(v["error_random"]),
        (float(v["prior"][0]), float(v["prior"][1])) if "prior" in v else None,
        v["known"],
    )


def _read_old(data: Mapping[str, Any]) -> Store:
    """Return the store of a file of schema 1: one group of columns, and what it cannot say as left out."""
    stage, made = data["stage"], data["provenance"]
    standing = Standing.read(data["standing"]) if "standing" in data else UNJUDGED
    records = made.get("records", {})
    origin = Origin("fit", stage, tuple(records), "", str(made.get("date", "")))
    covariance = np.array(data["covariance"], dtype=float).reshape(len(data["values"]), len(data["values"]))
    states = {}
    for k, (name, v) in enumerate(data["values"].items()):
        paths = (name, *v.get("also", ())) if v["kind"] == "parameter" else ()
        prior = (float(v["prior"][0]), float(v["prior"][1])) if "prior" in v else None
        numbers = (float(v["value"]), v["transform"] == "log", v["unit"], (float(v["bounds"][0]), float(v["bounds"][1])))
        more = {"standing": standing, "start": float(v["start"]), "random": float(v["error_random"]), "prior": prior}
        states[name] = State(name, *numbers, origin, v["kind"], paths, known=bool(np.isfinite(covariance[k, k])), **more)  # type: ignore[arg-type]
    root, sources = rooted(covariance, f"file of {stage}", f"errors of stage '{stage}', from its values file")
    seen = {sha: f"stage '{stage}' as '{name}'" for name, sha in records.items()}
    return Store(states, sources, root, seen, {stage: made}, left_out=(LeftOut(OLD.format(stage=stage)),))


def rooted(covariance: Array, key: str, words: str) -> tuple[Array, tuple[Source, ...]]:
    """Return a root of a covariance and its columns as sources; a value without a finite error gets a row of zeros."""
    known = np.isfinite(np.diag(covariance))
    whole = np.where(np.outer(known, known) & np.isfinite(covariance), covariance, 0.0)
    return square_root(whole), tuple(Source(f"{key}:{k}", "data", laws.Normal(), words) for k in range(len(whole)))
