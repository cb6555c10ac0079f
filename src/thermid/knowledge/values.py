"""Fitted values: their own file, with errors, covariance and origin; never written back into the author's deck."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thermid.arguments import takes_objects
from thermid.errors import DeckError, NameNotFoundError, nearest
from thermid.knowledge.sources import KNOWN
from thermid.knowledge.standing import UNJUDGED, Standing, worst
from thermid.knowledge.store import Origin, State, Store
from thermid.knowledge.values_file import load_store, rooted, save_store
from thermid.measure.amounts import some
from thermid.model.parts.parameter import Parameter, exact
from thermid.units import unit

Array = NDArray[np.float64]


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
    kind : str              'parameter', 'sensor' (a sensor's constant error), 'instrument' (the error of its scale, its lag), 'shared'
                            (the constant error of a logged boundary or power), or 'level' (of a joint fit: a parameter of a level below,
                            which the uppermost model sets otherwise).
    also : tuple of str     Paths of other instances that share the value.
    standing : Standing     How far it may be trusted: that of its fit.
    prior : (float, float)  Mean and standard deviation, fitted form, of the prior that its error already holds; None without.
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

    def as_parameter(self) -> Parameter:
        """Return it as a parameter of a model."""
        return exact(self.value, self.unit, self.origin)

    def shown(self, difference: float) -> float:
        """Return an SI difference, such as an error, in the value's unit."""
        return difference / float(unit(self.unit).factor)

    def converted(self, number: float) -> float:
        """Return an SI number, such as a bound, in the value's unit."""
        of = unit(self.unit)
        return (number - float(of.offset)) / float(of.factor)

    @property
    def in_unit(self) -> float:
        """The value in its unit."""
        return self.converted(self.value)


@dataclass(frozen=True, eq=False)
class FittedValues(Mapping[str, FittedValue]):
    """The fitted values of a stage, by path, with their joint covariance.

    Parameters
    ----------
    stage : str                     Name of the stage.
    items_ : dict                   Path -> FittedValue.
    covariance : array              Of the fitted forms, in the order of `items_`.
    provenance : dict               Records with checksums, version, date.
    store : Store or None           What they are a view of, where it is at hand.
    """

    stage: str
    items_: Mapping[str, FittedValue]
    covariance: Array
    provenance: Mapping[str, Any] = field(default_factory=dict)
    store: Store | None = field(default=None, repr=False)

    def __getitem__(self, path: str) -> FittedValue:
        """Return one value.

        Raises
        ------
        NameNotFoundError   With the nearest path.
        """
        if path not in self.items_:
            raise NameNotFoundError(f"'{path}' was not fitted.{nearest(path, self.items_)}", self.stage)
        return self.items_[path]

    def __contains__(self, path: object) -> bool:
        """Whether a path was fitted."""
        return path in self.items_

    def __iter__(self) -> Iterator[str]:
        """Yield the paths."""
        return iter(self.items_)

    def __len__(self) -> int:
        """How many there are."""
        return len(self.items_)

    def only(self, paths: Sequence[str]) -> FittedValues:
        """Return some of the parameters, with all constant errors; what is left out is marginalised.

        Raises
        ------
        NameNotFoundError   When a path was not fitted.
        """
        for path in paths:
            self[path]
        kept = [k for k, (p, v) in enumerate(self.items_.items()) if v.kind != "parameter" or p in paths]
        items = {p: v for k, (p, v) in enumerate(self.items_.items()) if k in kept}
        return self._some(kept, items)

    def bare(self) -> FittedValues:
        """Return the parameters without the constant errors of instruments, which are marginalised."""
        kept = [k for k, v in enumerate(self.items_.values()) if v.kind == "parameter"]
        return self._some(kept, self.parameters)

    def _some(self, kept: Sequence[int], items: Mapping[str, FittedValue]) -> FittedValues:
        """Return the values at some positions."""
        own = np.ix_(kept, kept)
        return FittedValues(self.stage, items, self.covariance[own], self.provenance)

    def draws(self, members: int, seed: int) -> dict[str, Array]:
        """Return path -> value of every member (members,) for `ensemble`, normal in the fitted forms with their covariance.

        Paths of instances that share a value get the same draws; constant errors of instruments are left out. [SI]

        Raises
        ------
        DeckError   When there is no member, or a value has no finite error.
        """
        found = self.bare()
        if members < 1:
            raise DeckError("an ensemble needs at least one member.", self.stage)
        loose = [p for p, c in zip(found, np.diag(found.covariance), strict=True) if not np.isfinite(c)]
        if loose:
            raise DeckError(f"'{loose[0]}' has no finite error, so there is nothing to draw from. Leave it out with only().", self.stage)
        sizes, vectors = np.linalg.eigh(found.covariance)
        root = vectors * np.sqrt(np.clip(sizes, 0.0, None))
        deviations = root @ np.random.default_rng(seed).standard_normal((len(found), members))
        out: dict[str, Array] = {}
        for row, (path, v) in zip(deviations, found.items(), strict=True):
            values = v.value * np.exp(row) if v.log else v.value + row
            out |= dict.fromkeys((path, *v.also), values)
        return out

    @property
    def standing(self) -> Standing:
        """The worst standing among them; unjudged where there is none."""
        return worst(v.standing for v in self.items_.values()) if self.items_ else UNJUDGED

    def judged(self, standing: Standing) -> FittedValues:
        """Return the values with another standing."""
        return replace(self, items_={p: replace(v, standing=standing) for p, v in self.items_.items()})

    @property
    def parameters(self) -> dict[str, FittedValue]:
        """Those that are parameters of a model."""
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
        """Return who set a value."""
        return self[path].origin

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the values as TOML, with all that is known of the model where they are a view of it."""
        save_store(self.store if self.store is not None else as_store(self), path, self.stage)


def as_store(values: FittedValues) -> Store:
    """Return fitted values as a store of their own."""
    records = values.provenance.get("records", {})
    origin = Origin("fit", values.stage, tuple(records), "", str(values.provenance.get("date", "")))
    states = {}
    for v in values.values():
        paths = (v.path, *v.also) if v.kind == "parameter" else ()
        states[v.path] = State(
            v.path, v.value, v.log, v.unit, v.bounds, origin, v.kind, paths,
            standing=v.standing, start=v.start, random=v.error_random, prior=v.prior, known=bool(np.isfinite(v.error)),
        )  # fmt: skip
    root, sources = rooted(values.covariance, values.stage, f"errors of stage '{values.stage}'")
    seen = {sha: f"stage '{values.stage}' as '{name}'" for name, sha in records.items()}
    return Store(states, sources, root, seen, {values.stage: values.provenance})


def view(store: Store, paths: Sequence[str], stage: str) -> FittedValues:
    """Return some states of a store as fitted values, with their covariance."""
    states = [store[p] for p in paths]
    covariance = store.covariance(paths, KNOWN)
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
    """Return stage and records of a state, for people."""
    if state.origin.kind == "hand":
        return f"tuned by hand, {state.origin}"
    records = list(state.origin.records)
    shown = some(records, "records")
    return f"{state.origin.stage}: {shown}" if shown else str(state.origin)


@takes_objects
def load_values(path: str | os.PathLike[str]) -> FittedValues:
    """Return the values of a file that a stage or `FittedValues.save` wrote: all that the stage knew, at every depth.

    Raises
    ------
    DeckError   When it is missing or is no values file.
    """
    return values_of(*load_store(path))


def values_of(store: Store, stage: str) -> FittedValues:
    """Return all that a stage knew, at every depth, by its store."""
    paths = [p for p, x in store.states.items() if x.kind != "parameter" or x.acts]
    found = view(store, paths, stage)
    every = [known for known in store.provenance.values() if "conditions" in known]
    conditions = {p: at for known in every for p, at in known["conditions"].items()}
    provenance = {**found.provenance, **({"conditions": conditions} if conditions else {})}
    return replace(found, provenance=provenance, store=store)
