"""`Knowledge`: a model with what is known of its values, and the rows that say how these respond to the sources of their errors."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from os import PathLike
from typing import Any

import numpy as np

from thermid.base.errors import DeckError, IdentificationError
from thermid.base.linear_algebra import square_root
from thermid.base.results import Result, Row
from thermid.base.units import Array
from thermid.fit.calibration import Calibration, fitted_values
from thermid.fit.error_model import ERRORS_KEY, STRUCTURAL_KEY, BandCause, Discrepancy, ErrorModel, kept_in
from thermid.model.tree import Flat, Model, Standing
from thermid.values.store import (
    Filed,
    FittedValue,
    FittedValues,
    Kind,
    Normal,
    Source,
    State,
    Store,
    graft,
    structural_under,
)


@dataclass(frozen=True, eq=False)
class Knowledge(Result):
    """A model with what is known of its values.

    Parameters
    ----------
    model : Model                       With its best values.
    values : tuple of FittedValues      What was fitted, each with its covariance, as such or as the path of its file; of two
                                        that hold a value the later counts. One alone needs no tuple.
    fit : Calibration or None           The fit itself, where it is at hand; its values are those where none are given.
    synthetic : bool                    Whether any record behind the values was made and not measured.
    at : str                            The submodel that the values belong to; empty for the model itself.
    remarks : tuple of str              What a reader must know first: values of a file that no longer apply, and what it cannot say.
    """

    model: Model
    values: tuple[FittedValues, ...] = ()
    fit: Calibration | None = None
    synthetic: bool = False
    at: str = ""
    remarks: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Take values in every way that they are given."""
        for name, kind in (("model", Model), ("fit", Calibration | None), ("at", str)):
            if not isinstance(value := getattr(self, name), kind):
                takes = getattr(kind, "__name__", "Calibration")
                raise DeckError(f"`{name}` takes {takes}, not {value!r:.60}.", "Knowledge", code="value.wrong-kind")
        values = self.values if self.values or self.fit is None else (self.fit.values,)
        object.__setattr__(self, "values", fitted_values(values, self.model.title))
        object.__setattr__(self, "synthetic", self.synthetic or (self.fit is not None and self.fit.synthetic))

    @classmethod
    def of_source(cls, source: Model | Calibration) -> Knowledge:
        """Return what a fit knows; of a model that nobody fitted, nothing but its values."""
        if isinstance(source, Model):
            return cls(source)
        return cls(source.model, fit=source)

    @classmethod
    def of_file(cls, filled: Filed) -> Knowledge:
        """Return what a values file says of a model or of a part of it."""
        synthetic = bool(filled.values.provenance.get("synthetic", False))
        return cls(filled.model, (filled.values,), synthetic=synthetic, at=filled.at, remarks=filled.lines)

    def for_model(self, model: Model) -> Knowledge:
        """Return the same knowledge of another model that holds the fitted paths."""
        base = model
        for store in self.stores:
            base = store.laid_over(base)
        return replace(self, model=base)

    def replaced_values(self, model: Model) -> str:
        """Return a warning that names values of another model which the fit's replace; empty where they equal the fit's or its deck's."""
        laid, given = (Flat.of_model(m).parameters.table for m in (self.for_model(model).model, model))
        known = [laid, *([Flat.of_model(self.fit.given_model).parameters.table] if self.fit is not None else [])]
        told = [p for v in self.placed for p in v.parameters if p in given]
        own = {p: given[p].parameter.text for p in told if all(p not in t or t[p].parameter.text != given[p].parameter.text for t in known)}
        if not own:
            return ""
        shown = ", ".join(f"'{p}' is {laid[p].parameter.text}, not {text}" for p, text in list(own.items())[:3])
        return f"values of the fit replace those of the given model: {shown}. Simulate the model for its own values, or fit it"

    @property
    def standing(self) -> Standing:
        """Of the values of the model, and of the fit where it is at hand."""
        return Standing.worst([self.model.standing, *([self.fit.standing] if self.fit is not None else [])])

    @cached_property
    def stores(self) -> tuple[Store, ...]:
        """What is known at every depth behind each of `values`, by the paths of the model."""
        stores = [self.fit.store] if self.fit is not None else [v.store if v.store is not None else v.as_store() for v in self.values]
        return tuple(graft(self.model, [(self.at, s)])[0] if self.at else s.in_decks(self.model)[0] for s in stores)

    @cached_property
    def placed(self) -> tuple[FittedValues, ...]:
        """The values by the paths of the model."""
        if not self.at:
            return self.values
        return tuple(_with_twins(values_at(v, self.at), store) for v, store in zip(self.values, self.stores, strict=True))

    @cached_property
    def provenances(self) -> tuple[Mapping[str, Any], ...]:
        """What is kept of every fit behind the values, the first one first, by the paths of the model."""
        return tuple(provenance for s in self.stores for provenance in s.provenance.values())

    @cached_property
    def discrepancies(self) -> tuple[Discrepancy, ...]:
        """What the fits leave open in the structure of their models, the first one first, as far as they say it."""
        return tuple(k for provenance in self.provenances if (k := kept_in(provenance)) is not None)

    @cached_property
    def errors(self) -> tuple[ErrorModel, ...]:
        """The models of error that speak of the elements of the model, each element once, by the last stage that saw it.

        A part that was replaced since is not among what a stage saw.
        """
        out: list[ErrorModel] = []
        taken: list[tuple[str, tuple[str, ...]]] = []
        for of_fit in (of_fit for s in reversed(self.stores) for of_fit in reversed([*s.provenance.values()]) if ERRORS_KEY in of_fit):
            errors = of_fit[ERRORS_KEY]
            if not any(errors.at.startswith(at) and not errors.at.startswith(gone) for at, gone in taken):
                taken.append((errors.at, tuple(f"{errors.at}{place}." for place in errors.without)))
                out.append(ErrorModel.from_dict(errors.table))
        return tuple(out)

    @property
    def assigned(self) -> tuple[str, ...]:
        """Every parameter of the model that a fit gave its value."""
        return tuple(p for s in self.stores for state in s.parameters.values() for p in state.acts)

    def _as_rows(self) -> list[Row]:
        """Return the fitted values with their standard errors, in their units."""
        return [
            {"path": v.path, "value": v.in_unit, "error": v.shown(v.error), "unit": v.unit} for one in self.values for v in one.values()
        ]

    def _summary(self) -> str:
        """Return the model's title and how many values are known."""
        return f"{self.model.title}, {sum(map(len, self.values))} fitted values{', synthetic data' if self.synthetic else ''}"


def _with_twins(values: FittedValues, store: Store) -> FittedValues:
    """Return fitted values that act wherever the states behind them do."""
    items = {p: replace(v, also=tuple(q for q in store[p].acts if q != p)) if v.kind == "parameter" else v for p, v in values.items()}
    return replace(values, items_=items)


def values_at(values: FittedValues, at: str) -> FittedValues:
    """Return fitted values under the paths that they have in a model that has theirs as a part."""
    if not at:
        return values
    ahead = f"{at}."

    def moved(v: FittedValue) -> FittedValue:
        """Return a fitted value under the path that it has in the larger model."""
        return replace(v, path=ahead + v.path, also=tuple(ahead + q for q in v.also)) if v.kind == "parameter" else v

    provenance = values.provenance
    items = {v.path: v for v in map(moved, values.values())}
    places = {n: {ahead + p: x for p, x in provenance[n].items()} for n in ("conditions", "misfit") if n in provenance}
    structural = {STRUCTURAL_KEY: structural_under(provenance[STRUCTURAL_KEY], ahead)} if STRUCTURAL_KEY in provenance else {}
    structural |= {ERRORS_KEY: provenance[ERRORS_KEY].under(ahead)} if ERRORS_KEY in provenance else {}
    return replace(values, items_=items, provenance={**provenance, **places, **structural}, store=None)


def known_of(source: Knowledge | Model | Calibration | FittedValues | Sequence[Any], model: Model | None = None, at: str = "") -> Knowledge:
    """Return what is known, its values laid over the model.

    Parameters
    ----------
    source : Knowledge, Model, Calibration, FittedValues, or several of the last two
    model : Model       What values are laid over; a fit's own where it is not given.
    at : str            The submodel that the values belong to.
    """
    if isinstance(source, Knowledge):
        return source.for_model(source.model) if source.fit is None else source
    if model is None and isinstance(source, Model | Calibration):
        return Knowledge.of_source(source)
    many = (
        [] if isinstance(source, Model) else [source] if isinstance(source, Calibration | FittedValues | str | PathLike) else list(source)
    )
    base = model if model is not None else source
    assert isinstance(base, Model)
    if len(many) == 1 and isinstance(many[0], Calibration):
        return Knowledge(base, fit=many[0], at=at).for_model(base)
    values = fitted_values(many, base.title)
    is_synthetic = any(isinstance(v, Calibration) and v.synthetic for v in many)
    return Knowledge(base, values, None, is_synthetic, at).for_model(base)


@dataclass(frozen=True, eq=False)
class Rows:
    """How values respond to the sources of their errors: a change of the values is ``matrix @ sources``.

    Parameters
    ----------
    names : tuple of str        Parameters of the model.
    log : tuple of bool         Which are spread by their logarithm.
    also : dict                 Name -> other parameters that share its value.
    sources : tuple of Source   Standard normal, each by a number.
    causes : tuple of str       Of each source: what a reader is told.
    matrix : array              (names, sources), a standard deviation of the source each; SI, or of the logarithm.
    """

    names: tuple[str, ...] = ()
    log: tuple[bool, ...] = ()
    also: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    sources: tuple[Source, ...] = ()
    causes: tuple[str, ...] = ()
    matrix: Array = field(default_factory=lambda: np.zeros((0, 0)))

    @classmethod
    def of_states(cls, store: Store, states: Mapping[str, State], cause: str) -> Rows:
        """Return the rows of some states of a store, by the names that they act under; structural sources have a cause of their own."""
        matrix = store.rows([s.path for s in states.values()]).reshape(len(states), len(store.sources))
        used = np.flatnonzero(matrix.any(axis=0))
        also = {name: s.acts[1:] for name, s in states.items() if len(s.acts) > 1}
        sources = tuple(store.sources[k] for k in used)
        causes = tuple(BandCause.STRUCTURE if s.kind == "structural" else cause for s in sources)
        return cls(tuple(states), tuple(s.log for s in states.values()), also, sources, causes, matrix[:, used])

    @property
    def covariance(self) -> Array:
        """Covariance (names, names), matrix matrix', of logarithms where `log`, else of values. [SI]"""
        return np.asarray(self.matrix @ self.matrix.T)

    def without(self, driven: Collection[str]) -> tuple[Rows, tuple[str, ...]]:
        """Return the rows without values that a scenario drives, and the paths of these; a twin that it does not drive keeps its row."""
        paths = [[p for p in (n, *self.also.get(n, ())) if p not in driven] for n in self.names]
        kept = [k for k, left in enumerate(paths) if left]
        idle = tuple(n for n, left in zip(self.names, paths, strict=True) if not left)
        also = {paths[k][0]: tuple(paths[k][1:]) for k in kept if len(paths[k]) > 1}
        names, log = tuple(paths[k][0] for k in kept), tuple(self.log[k] for k in kept)
        return replace(self, names=names, log=log, also=also, matrix=self.matrix[kept]), idle

    def beside(self, other: Rows) -> Rows:
        """Return these rows and others; sources of one name are one source."""
        place = {s.name: k for k, s in enumerate(self.sources)}
        fresh = [k for k, s in enumerate(other.sources) if s.name not in place]
        place |= {other.sources[k].name: len(self.sources) + i for i, k in enumerate(fresh)}
        matrix = np.zeros((len(self.names) + len(other.names), len(place)))
        matrix[: len(self.names), : len(self.sources)] = self.matrix
        matrix[len(self.names) :, [place[s.name] for s in other.sources]] = other.matrix
        sources = (*self.sources, *(other.sources[k] for k in fresh))
        causes = (*self.causes, *(other.causes[k] for k in fresh))
        return Rows((*self.names, *other.names), (*self.log, *other.log), {**self.also, **other.also}, sources, causes, matrix)


def rows_of(knowledge: Knowledge) -> Rows:
    """Return how the fitted values of a model respond to the noise of the fits that found them.

    This is the one place that turns stored values into sources. A value that several fits hold is that of the last.
    """
    out, taken = Rows(), set[str]()
    for store, values in zip(reversed(knowledge.stores), reversed(knowledge.values), strict=True):
        acting = {p: s for p, s in store.parameters.items() if s.acts and not taken & {*s.acts}}
        taken |= {p for s in acting.values() for p in s.acts}
        loose = next((p for p, s in acting.items() if not s.known and s.origin.kind == "fit"), None)
        if loose is not None:
            raise IdentificationError(
                f"'{loose}' has no finite error. Leave it out, or give it a spread of its own.",
                knowledge.model.title,
                code="fit.not-determined",
            )
        states = {s.acts[0]: s for p, s in acting.items() if s.known and store.error(p) > 0}
        out = out.beside(Rows.of_states(store, states, "fit" if knowledge.fit is not None else f"fit of {values.stage}"))
    return out


def normal_sources(name: str, covariance: Array, kind: Kind) -> tuple[tuple[Source, ...], Array]:
    """Return numbered standard normal sources, and R (names, sources) with R R' = `covariance`; directions of no size are left out."""
    matrix = square_root(0.5 * (covariance + covariance.T), drop=True)
    words = f"noise of fit '{name}'" if kind == "data" else name
    return tuple(Source(f"{name}: {k + 1}", kind, Normal(), words) for k in range(matrix.shape[1])), np.asarray(matrix)
