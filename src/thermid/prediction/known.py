"""`Known`: a model with what is known of its values, and the rows that say how these respond to the sources of their errors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thermid.arguments import takes_objects
from thermid.errors import IdentificationError
from thermid.identify.calibration import Calibration
from thermid.identify.discrepancy import KEY, Discrepancy, kept_in
from thermid.identify.values import FittedValues, view
from thermid.knowledge.sources import KNOWN, Kind, Normal, Source
from thermid.knowledge.standing import Standing, of_model, worst
from thermid.knowledge.store import Store, graft, structural_under
from thermid.model.model import Model

__all__ = ["Known", "Rows", "known_of", "rows_of"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Known:
    """A model with what is known of its values.

    Parameters
    ----------
    model : Model                       With its best values.
    values : tuple of FittedValues      What was fitted, each with its covariance; of two that hold a value the later counts.
    fit : Calibration or None           The fit itself, where it is at hand.
    synthetic : bool                    Whether any record behind the values was made and not measured.
    at : str                            The submodel that the values belong to; empty for the model itself.
    """

    model: Model
    values: tuple[FittedValues, ...] = ()
    fit: Calibration | None = None
    synthetic: bool = False
    at: str = ""

    @classmethod
    @takes_objects
    def of(cls, source: Model | Calibration) -> Known:
        """Return what a fit knows; of a model that nobody fitted, nothing but its values."""
        if isinstance(source, Model):
            return cls(source)
        return cls(source.fitted_model, (source.values,), source, source.synthetic)

    def on(self, model: Model) -> Known:
        """Return the same knowledge of another model that holds the fitted paths."""
        base = model
        for store in self.stores:
            base = store.on(base)
        for values in self.alone:
            base = base.with_values(values.assignments, f"stage '{values.stage}'") if values.assignments else base
        return replace(self, model=base)

    @property
    def standing(self) -> Standing:
        """Of the values of the model, and of the fit where it is at hand."""
        return worst([of_model(self.model), *([self.fit.standing] if self.fit is not None else [])])

    @property
    def stores(self) -> tuple[Store, ...]:
        """What fits know at every depth, by the paths of the model; none where only their own values are at hand."""
        if self.fit is None:
            return ()
        return (graft(self.model, [(self.at or ".", self.fit.store)])[0],) if self.at else (self.fit.store,)

    @property
    def alone(self) -> tuple[FittedValues, ...]:
        """Values under the paths of the model that no store holds."""
        return () if self.fit is not None else self.placed

    @property
    def placed(self) -> tuple[FittedValues, ...]:
        """The values by the paths of the model."""
        return tuple(values_at(v, self.at) for v in self.values)

    @property
    def provenances(self) -> tuple[Mapping[str, Any], ...]:
        """What is kept of every fit behind the values, the first one first, by the paths of the model."""
        return (*(known for s in self.stores for known in s.provenance.values()), *(v.provenance for v in self.alone))

    @property
    def kept(self) -> tuple[Discrepancy, ...]:
        """What the fits leave open in the structure of their models, the first one first, as far as they say it."""
        return tuple(k for known in self.provenances if (k := kept_in(known)) is not None)

    @property
    def assigned(self) -> tuple[str, ...]:
        """Every parameter of the model that a fit gave its value."""
        inner = (p for s in self.stores for state in s.parameters.values() for p in state.acts)
        return (*inner, *(p for v in self.alone for p in v.assignments))


def values_at(values: FittedValues, at: str) -> FittedValues:
    """Return fitted values under the paths that they have in a model that has theirs as a part."""
    if not at:
        return values
    ahead = f"{at}."
    items = {
        ahead + p if v.kind == "parameter" else p: replace(v, path=ahead + v.path, also=tuple(ahead + q for q in v.also))
        if v.kind == "parameter"
        else v
        for p, v in values.items()
    }
    moved = {n: {ahead + p: x for p, x in values.provenance[n].items()} for n in ("conditions", "misfit") if n in values.provenance}
    kept = {KEY: structural_under(values.provenance[KEY], ahead)} if KEY in values.provenance else {}
    return replace(values, items_=items, provenance={**values.provenance, **moved, **kept})


def known_of(source: Known | Model | Calibration | FittedValues | Sequence[Any], model: Model | None = None, at: str = "") -> Known:
    """Return what is known, its values laid over the model.

    Parameters
    ----------
    source : Known, Model, Calibration, FittedValues, or several of the last two
    model : Model       What values are laid over; a fit's own where it is not given.
    at : str            The submodel that the values belong to.
    """
    if isinstance(source, Known):
        return source.on(source.model) if source.fit is None else source
    if model is None and isinstance(source, Model | Calibration):
        return Known.of(source)
    many = [source] if isinstance(source, Calibration | FittedValues) else [] if isinstance(source, Model) else list(source)
    base = model if model is not None else source
    assert isinstance(base, Model)
    if len(many) == 1 and isinstance(many[0], Calibration):
        return Known(base, (many[0].values,), many[0], many[0].synthetic, at).on(base)
    # several: the values of each, and what its stages below knew
    values = tuple(x for v in many for x in (_views(v) if isinstance(v, Calibration) else (v,)))
    made = any(isinstance(v, Calibration) and v.synthetic for v in many)
    return Known(base, values, None, made, at).on(base)


def _views(fit: Calibration) -> tuple[FittedValues, ...]:
    """Return everything that a fit knows of parameters, as fitted values of one stage."""
    return (replace(view(fit.store, _sure(fit.store), fit.stage), provenance=fit.values.provenance),)


def _sure(store: Store) -> list[str]:
    """Return the parameters of a store that act and have an error that is known."""
    return [p for p, s in store.parameters.items() if s.acts and s.known and store.error(p) > 0]


@dataclass(frozen=True, eq=False)
class Rows:
    """How values respond to the sources of their errors.

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

    @property
    def covariance(self) -> Array:
        """Of the names, in the form of `log`."""
        return np.asarray(self.matrix @ self.matrix.T)

    def beside(self, other: Rows) -> Rows:
        """Return these rows and others that have no source in common with them; a source's name is made another where it is taken."""
        taken = {s.name for s in self.sources}
        apart = f" of {other.names[0]}" if other.names else ""
        own = tuple(replace(s, name=s.name + apart) if s.name in taken else s for s in other.sources)
        matrix = np.zeros((len(self.names) + len(other.names), len(self.sources) + len(other.sources)))
        matrix[: len(self.names), : len(self.sources)] = self.matrix
        matrix[len(self.names) :, len(self.sources) :] = other.matrix
        names, log = (*self.names, *other.names), (*self.log, *other.log)
        return Rows(names, log, {**self.also, **other.also}, (*self.sources, *own), (*self.causes, *other.causes), matrix)


def rows_of(known: Known) -> Rows:
    """Return how the fitted values of a model respond to the noise of the fits that found them.

    This is the one place that turns stored values into sources. A value that several fits hold is that of the last.
    """
    out, taken = Rows(), set[str]()
    for store in known.stores:
        loose = next((p for p, s in store.parameters.items() if s.acts and not s.known), None)
        if loose is not None:
            raise IdentificationError(f"'{loose}' has no finite error. Leave it out, or give it a spread of its own.", known.model.title)
        paths = _sure(store)
        states = [store[p] for p in paths]
        names = tuple(s.acts[0] for s in states)
        also = {s.acts[0]: s.acts[1:] for s in states if len(s.acts) > 1}
        matrix = store.rows(paths, KNOWN).reshape(len(paths), len(store.sources))
        used = np.flatnonzero(matrix.any(axis=0))
        sources = tuple(store.sources[k] for k in used)
        out = out.beside(Rows(names, tuple(s.log for s in states), also, sources, ("fit",) * len(sources), matrix[:, used]))
        taken |= {p for s in states for p in s.acts}
    for values in reversed(known.alone):
        left = values.bare()
        left = left.only([p for p, v in left.items() if not taken & {p, *v.also}])
        taken |= {*left.assignments}
        if left:
            out = out.beside(_rows(left, f"fit of {values.stage}"))
    return out


def _rows(values: FittedValues, cause: str) -> Rows:
    """Return the rows of one fit: the eigenvectors of its covariance, scaled."""
    covariance = values.covariance
    loose = [n for n, v in zip(values, np.diag(covariance), strict=True) if not np.isfinite(v)]
    if loose:
        raise IdentificationError(f"'{loose[0]}' has no finite error. Leave it out, or give it a spread of its own.", cause)
    sources, matrix = normal_sources(values.stage, covariance, "data")
    also = {p: v.also for p, v in values.items() if v.also}
    return Rows(tuple(values), tuple(v.log for v in values.values()), also, sources, (cause,) * len(sources), matrix)


def normal_sources(name: str, covariance: Array, kind: Kind) -> tuple[tuple[Source, ...], Array]:
    """Return standard normal sources, by number, and a root (names, sources) of a covariance, by the eigenvectors of its correlations."""
    scale = np.sqrt(np.diag(covariance))
    shape = np.divide(covariance, np.outer(scale, scale), out=np.zeros_like(covariance), where=np.outer(scale, scale) > 0.0)
    sizes, vectors = np.linalg.eigh(0.5 * (shape + shape.T)) if len(covariance) else (np.zeros(0), np.zeros((0, 0)))
    kept = sizes > 1e-12 * max(1, len(covariance))
    matrix = scale[:, None] * vectors[:, kept] * np.sqrt(sizes[kept])
    words = f"noise of fit '{name}'" if kind == "data" else name
    return tuple(Source(f"{name}: {k + 1}", kind, Normal(), words) for k in range(matrix.shape[1])), np.asarray(matrix)
