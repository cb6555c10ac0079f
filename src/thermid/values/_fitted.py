"""Fitted values, and their own file: a whole store as TOML, bit for bit; never written back into the author's deck."""

from __future__ import annotations

import math
import os
import tomllib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from thermid.base.errors import DeckError, refuse_first
from thermid.base.files import FileKinds, Places, by_grammar, parse_toml, read_text, toml_key, toml_value
from thermid.base.linear_algebra import square_root
from thermid.base.results import Named, Row
from thermid.base.units import Array, counted, from_si, unit
from thermid.model.tree import UNJUDGED, Parameter, Standing
from thermid.values._store import LaterTable, Normal, Source, State, Store, ValueOrigin, deviated, domain, error_table_of

VALUES_SCHEMA = 2
AGREES = 1e-6
"""Relative difference between an error and its row beyond which a file was changed by hand. [-]"""


@dataclass(frozen=True)
class FittedValue:
    """One fitted number.

    Parameters
    ----------
    path : str              Parameter path, or ``sensor <name>`` for a constant error.
    value : float           [SI]
    error : float           Standard error, constant errors of sensors and powers included. [SI]
    error_random : float    Scatter that the noise of the readings alone would give in a repeat with the same instruments. [SI]
    log : bool              Whether it was fitted by its logarithm.
    unit : str              For people.
    start : float           [SI]
    bounds : (float, float) [SI]
    origin : str            Stage and records.
    kind : str              'parameter', 'sensor' (a sensor's constant error), 'instrument' (the error of its scale, its lag), 'input'
                            (the constant error of a logged boundary or power), or 'level' (of a joint fit: a parameter of a level below,
                            which the uppermost model sets otherwise).
    also : tuple of str     Paths of other instances that share the value.
    standing : Standing     How far it may be trusted: that of its fit.
    prior : (float, float)  Mean and standard deviation, fitted form, of the prior that its error already holds; None without.
    uncut : float           Its standard error as it would be without its bounds, where these cut it; else zero. [SI]
    """

    path: str
    value: float
    error: float
    error_random: float
    log: bool
    unit: str
    start: float
    bounds: tuple[float, float]
    origin: str = ""
    kind: str = "parameter"
    prior: tuple[float, float] | None = None
    also: tuple[str, ...] = ()
    standing: Standing = UNJUDGED
    uncut: float = 0.0

    def as_parameter(self) -> Parameter:
        """Return the value as a parameter that can be laid over a model; its float is kept exactly."""
        return Parameter.exact(self.value, self.unit, self.origin)

    def shown(self, difference: float) -> float:
        """Return an SI difference, such as an error, in the value's unit: divided by its factor, without the offset of a scale."""
        return difference / float(unit(self.unit).factor)

    def converted(self, number: float) -> float:
        """Return an SI number on the value's own scale, such as a bound, in its unit: 297.15 K is 24 in degC."""
        return from_si(number, self.unit)

    @property
    def relative(self) -> float:
        """Standard error over the value; infinite of zero, and of a temperature in degrees, whose zero is that of its scale. [-]"""
        return self.error / abs(self.value) if self.value and not unit(self.unit).absolute else math.inf

    @property
    def in_unit(self) -> float:
        """The value in its unit."""
        return self.converted(self.value)


class Draws(dict[str, Array]):
    """Path -> value of every member (members,) [SI], as `ensemble` takes them, with the standing of the fits that they were drawn from."""

    def __init__(self, values: Mapping[str, Array], standing: Standing) -> None:
        super().__init__(values)
        self.standing = standing

    def __or__(self, other: Mapping[str, Any]) -> Draws:  # type: ignore[override]
        """Return these and others beside them."""
        return Draws({**self, **other}, Standing.worst([self.standing, other.standing]) if isinstance(other, Draws) else self.standing)

    def __ror__(self, other: Mapping[str, Any]) -> Draws:  # type: ignore[override]
        """Return others and these beside them."""
        return Draws({**other, **self}, self.standing)


@dataclass(frozen=True, eq=False)
class FittedValues(Named[FittedValue], Mapping[str, FittedValue]):
    """The fitted values of a stage, by path, with their joint covariance.

    Parameters
    ----------
    stage : str                     Name of the stage.
    items_ : dict                   Path -> FittedValue.
    covariance : array              Of the fitted forms, in the order of `items_`.
    provenance : dict               Records with checksums, version, date.
    store : Store or None           What they are a view of, where it is at hand.
    sense : str                     'as fitted', which draws the curves, or 'to quote', where the readings refute the structure.
    """

    stage: str
    items_: Mapping[str, FittedValue]
    covariance: Array
    provenance: Mapping[str, Any] = field(default_factory=dict)
    store: Store | None = field(default=None, repr=False)
    sense: str = "as fitted"

    def _summary(self) -> str:
        """Return the stage, how many values it fitted and in what sense."""
        return f"{self.stage}: {counted(len(self.items_), 'value')} {self.sense}"

    def _as_rows(self) -> list[Row]:
        """Return every value with its error, in its unit."""
        return [{"path": p, "value": v.in_unit, "error": v.shown(v.error), "unit": v.unit} for p, v in self.items_.items()]

    _refusal = "'{}' was not fitted."

    def _entries(self) -> Mapping[str, FittedValue]:
        """Return path -> its value."""
        return self.items_

    def only(self, paths: Sequence[str]) -> FittedValues:
        """Return some of the parameters and all constant errors with their covariance; the others are marginalised (left out).

        Raises
        ------
        NameNotFoundError   When a path was not fitted.
        """
        for path in paths:
            self[path]
        return self._where(lambda path, v: v.kind != "parameter" or path in paths)

    def bare(self) -> FittedValues:
        """Return the parameters without the constant errors of instruments, which are marginalised."""
        return self._where(lambda _, v: v.kind == "parameter")

    def _where(self, chosen: Callable[[str, FittedValue], bool]) -> FittedValues:
        """Return the values for which `chosen` holds, with their block of the covariance."""
        kept = [chosen(path, v) for path, v in self.items_.items()]
        items = {p: v for (p, v), stays in zip(self.items_.items(), kept, strict=True) if stays}
        store = self.store.only(lambda s: (s.acts or (s.path,))[0] in items) if self.store is not None else None
        return FittedValues(self.stage, items, self.covariance[np.ix_(kept, kept)], self.provenance, store)

    def draws(self, members: int, seed: int) -> Draws:
        """Return path -> value of every member (members,) for `ensemble`, normal in the fitted forms with their covariance.

        With L L' the covariance and z standard normal from `seed`, values are v exp(L z) where fitted by the logarithm, else v + L z.
        No value passes the limits that physics sets, see `deviated`: 1 of an emissivity, zero of what cannot be negative.
        Paths of instances that share a value get the same draws; constant errors of instruments are left out. [SI]

        Raises
        ------
        DeckError   When there is no member, or a value has no finite error.
        """
        bare_values = self.bare()
        if members < 1:
            raise DeckError("an ensemble needs at least one member.", self.stage, code="value.outside-range")
        loose = [p for p, c in zip(bare_values, np.diag(bare_values.covariance), strict=True) if not np.isfinite(c)]
        if loose:
            raise DeckError(
                f"'{loose[0]}' has no finite error, so it cannot be drawn. Leave it out with only().", self.stage, code="fit.not-determined"
            )
        sizes, vectors = np.linalg.eigh(bare_values.covariance)
        root = vectors * np.sqrt(np.clip(sizes, 0.0, None))
        deviations = root @ np.random.default_rng(seed).standard_normal((len(bare_values), members))
        out: dict[str, Array] = {}
        for row, (path, v) in zip(deviations, bare_values.items(), strict=True):
            ends = domain(*v.bounds, v.unit == "1")
            values = deviated(v.value, v.value * np.expm1(row) if v.log else row, (-np.inf if v.log else ends[0], ends[1]))
            out |= dict.fromkeys((path, *v.also), values)
        return Draws(out, self.standing)

    @property
    def standing(self) -> Standing:
        """The worst standing among them; unjudged where there is none."""
        return Standing.worst(v.standing for v in self.items_.values()) if self.items_ else UNJUDGED

    def judged(self, standing: Standing) -> FittedValues:
        """Return the values with one and the same standing for all of them."""
        return replace(self, items_={p: replace(v, standing=standing) for p, v in self.items_.items()})

    @property
    def parameters(self) -> dict[str, FittedValue]:
        """Path -> value, of those that are parameters of a model: without the constant errors of instruments."""
        return {p: v for p, v in self.items_.items() if v.kind == "parameter"}

    @property
    def assignments(self) -> dict[str, FittedValue]:
        """Every path of a model that gets a value, instances that share one among them."""
        return {path: v for p, v in self.parameters.items() for path in (p, *v.also)}

    @property
    def sensors(self) -> dict[str, FittedValue]:
        """Sensor -> its constant error."""
        return {p.removeprefix("sensor "): v for p, v in self.items_.items() if v.kind == "sensor"}

    def origin(self, path: str) -> str:
        """Return stage and records that a value comes from, as text."""
        return self[path].origin

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the values as TOML, with all that is known of the model where they are a view of it."""
        save_store(self.store if self.store is not None else self.as_store(), path, self.stage)

    def as_store(self) -> Store:
        """Return fitted values as a `Store` whose sources are the columns of a root of their covariance."""
        records = self.provenance.get("records", {})
        origin = ValueOrigin("fit", self.stage, tuple(records), "", str(self.provenance.get("date", "")))
        states = {}
        for v in self.values():
            paths = (v.path, *v.also) if v.kind == "parameter" else ()
            states[v.path] = State(
                v.path, v.value, v.log, v.unit, v.bounds, origin, v.kind, paths,
                standing=v.standing, start=v.start, random=v.error_random, prior=v.prior, known=bool(np.isfinite(v.error)),
            )  # fmt: skip
        root, sources = rooted(self.covariance, self.stage, f"errors of stage '{self.stage}'")
        fitted_records = {sha: f"stage '{self.stage}' as '{name}'" for name, sha in records.items()}
        return Store(states, sources, root, fitted_records, {self.stage: self.provenance})

    @staticmethod
    def of_store(store: Store, paths: Sequence[str], stage: str) -> FittedValues:
        """Return some states of a store as fitted values of a stage, with their covariance; an unknown error has an infinite variance."""
        states = [store[p] for p in paths]
        covariance = store.covariance(paths)
        for k, s in enumerate(states):
            if not s.known:
                covariance[k, k] = np.inf
        items = {}
        for s in states:
            name, *also = s.acts or (s.path,)
            numbers = (s.value, store.error(s.path), s.random, s.log, s.unit, s.start, s.bounds)
            items[name] = FittedValue(name, *numbers, _words(s), s.kind, s.prior, tuple(also), s.standing)
        return FittedValues(stage, items, covariance, store.provenance.get(stage, {}))


def _words(state: State) -> str:
    """Return stage and records of a state as text, of more than four records the first and the last."""
    if state.origin.kind == "hand":
        return f"tuned by hand, {state.origin}"
    records = list(state.origin.records)
    shown = ", ".join(records) if len(records) <= 4 else f"{records[0]} ... {records[-1]} ({len(records)} records)"
    return f"{state.origin.stage}: {shown}" if shown else str(state.origin)


def load_values(path: str | os.PathLike[str]) -> FittedValues:
    """Return the values of a file that a stage or `FittedValues.save` wrote: all that the stage knew, at every depth.

    Raises
    ------
    DeckError   When it is missing or is no values file.
    """
    return values_of(*load_store(path))


def values_of(store: Store, stage: str) -> FittedValues:
    """Return all that a stage knew, at every depth, as `FittedValues` with their store; values that a [set] hides everywhere are left out.

    The provenance has the test conditions of all fits in the store under `conditions`.
    """
    values = FittedValues.of_store(store, [p for p, x in store.states.items() if x.kind != "parameter" or x.acts], stage)
    conditions = {p: at for of_fit in store.provenance.values() for p, at in of_fit.get("conditions", {}).items()}
    return replace(values, provenance={**values.provenance, **({"conditions": conditions} if conditions else {})}, store=store)


def save_store(store: Store, path: str | os.PathLike[str], stage: str) -> None:
    """Write everything that a stage knows as a TOML file: its states, their sources, the root of their covariance, its provenance.

    Parameters
    ----------
    store : Store   What is known.
    path : path     The file.
    stage : str     The stage whose store it is.
    """
    head = {
        "schema": VALUES_SCHEMA,
        "stage": stage,
        "seen": dict(store.seen),
        "cuts": list(store.cuts),
        "dropped": [_plain(d) for d in store.dropped],
        "left_out": [_plain(x) for x in store.left_out],
    }
    lines = ["# Values with their errors and origins. Written by thermid; the decks stay as their authors wrote them."]
    lines += [f"{name} = {toml_value(x)}" for name, x in head.items()]
    for name, provenance in store.provenance.items():
        table = {**provenance, "errors": error_table_of(provenance)} if "errors" in provenance else provenance
        lines += ["", f"[provenance.{toml_key(name)}]", *(f"{toml_key(k)} = {toml_value(v)}" for k, v in table.items())]
    for name, state in store.states.items():
        lines += ["", f"[values.{toml_key(name)}]", *(f"{k} = {toml_value(v)}" for k, v in _as_table(state, store).items())]
    for source in store.sources:
        lines += ["", "[[sources]]", f"name = {toml_value(source.name)}", f"kind = {toml_value(source.kind)}"]
        lines += [f"law = {toml_value(_law_table(source.law))}", f"words = {toml_value(source.words)}"]
    for group in _groups(store):
        rows = {p: row for p, row in zip(store.states, store.root[:, group].tolist(), strict=True) if any(row)}
        lines += ["", "[[root]]", f"sources = {toml_value(group)}", *(f"{toml_key(p)} = {toml_value(row)}" for p, row in rows.items())]
    FileKinds.VALUES.titled(stage).save_text(path, "\n".join([*lines, ""]))


def _groups(store: Store) -> Iterable[list[int]]:
    """Return groups of positions of a store's sources: those of the data of one fit together, all others by their kind."""
    out: dict[str, list[int]] = {}
    for k, source in enumerate(store.sources):
        out.setdefault(source.name.partition(":")[0] if source.kind == "data" else source.kind, []).append(k)
    return out.values()


def _as_table(state: State, store: Store) -> dict[str, Any]:
    """Return a state as the table of a values file; `text` and `error` repeat value and standard error for people."""
    out = {
        "value": state.value,
        "text": f"{from_si(state.value, state.unit):.9g} [{state.unit}]",
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
        "standing": state.standing.as_table(),
    }
    return out | ({"of_logs": True} if state.of_logs else {}) | ({"prior": list(state.prior)} if state.prior is not None else {})


def _plain(thing: Any) -> dict[str, Any]:
    """Return a frozen dataclass of plain values as a table, tuples as lists."""
    return {f.name: list(x) if isinstance(x := getattr(thing, f.name), tuple) else x for f in fields(thing)}


def _law_table(law: Any) -> dict[str, Any]:
    """Return a distribution as a table: its class as `form`, and its fields; a distribution inside it likewise."""
    by_field = ((f.name, getattr(law, f.name)) for f in fields(law))
    return {"form": type(law).__name__} | {n: _law_table(x) if is_dataclass(x) else x for n, x in by_field}


def read_values(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Return the content of a values file as a dictionary, written by thermid or by hand; its grammar is not checked here.

    Raises
    ------
    DeckError   When it is missing or is no TOML.
    """
    target = Path(path)
    if not target.is_file():
        raise DeckError(f"there is no values file '{target.name}'. Run the calibration first.", code="file.not-found")
    try:
        return parse_toml(read_text(target))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise DeckError(f"this is not a values file of thermid: {error}.", target.name, code="file.another-kind") from None


def load_store(path: str | os.PathLike[str]) -> tuple[Store, str]:
    """Return the store that a values file holds, and the name of its stage.

    Raises
    ------
    DeckError   When it is missing, is no values file, or was changed by hand.
    """
    target, data = Path(path), read_values(path)
    refuse_first(
        target.name,
        (
            not data,
            "this is not a values file of thermid, because it is empty. Run the calibration again to write it.",
            "file.another-kind",
        ),
        (
            "schema" not in data,
            "this file was written by hand, so it needs the units and bounds of a deck. Use it with a deck by --values, or as "
            "`values` of a campaign's stage.",
            "file.another-kind",
        ),
    )
    checked = by_grammar("thermid.values._schema.ValuesFile", data, Places(target.name))
    store = _read(data, checked)
    for name, v in data["values"].items():
        from_row, in_table = store.error(name), float(v["error"])
        if from_row != in_table and not math.isclose(from_row, in_table, rel_tol=AGREES):
            raise DeckError(
                f"the error of '{name}' is {in_table:g} in its table and {from_row:g} in its row, so the file was changed by hand. Run the "
                "calibration again.",
                target.name,
                code="file.changed-by-hand",
            )
    return store, checked.stage


def _read(data: Mapping[str, Any], content: Any) -> Store:
    """Return the store of a file of schema 2, as it is written and as its grammar has it."""
    states, sources = {name: _state(name, table) for name, table in content.values.items()}, tuple(content.sources)
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
        {
            stage: {**of_stage, "errors": LaterTable.of_table(of_stage["errors"])} if "errors" in of_stage else of_stage
            for stage, of_stage in data.get("provenance", {}).items()
        },
        tuple(content.cuts),
        tuple(content.dropped),
        tuple(content.left_out),
    )


def _state(name: str, v: Any) -> State:
    """Return the state that the table [values.<name>] of a values file holds; the inverse of `_as_table`."""
    return State(
        name,
        v.value,
        v.transform == "log",
        v.unit,
        (v.bounds[0], v.bounds[1]),
        v.origin,
        v.kind,
        tuple(v.acts),
        tuple(v.hidden),
        v.at,
        v.deck,
        tuple(v.history),
        v.standing,
        v.start,
        v.error_random,
        (v.prior[0], v.prior[1]) if v.prior else None,
        v.known,
        v.of_logs,
    )


def rooted(covariance: Array, key: str, words: str) -> tuple[Array, tuple[Source, ...]]:
    """Return a root L of a covariance L L' and a standard normal source for each of its columns, named ``key:0``, ``key:1`` and so on.

    A value without a finite error gets a row of zeros. `words` says what the sources are, for people.
    """
    is_finite = np.isfinite(np.diag(covariance))
    whole = np.where(np.outer(is_finite, is_finite) & np.isfinite(covariance), covariance, 0.0)
    return square_root(whole), tuple(Source(f"{key}:{k}", "data", Normal(), words) for k in range(len(whole)))
