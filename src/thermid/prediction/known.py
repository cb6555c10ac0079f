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
from thermid.identify.discrepancy import Discrepancy, discrepancy_kept
from thermid.identify.staging import _prefixed
from thermid.identify.values import FittedValues
from thermid.knowledge.sources import Kind, Normal, Source
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
        return cls(source.fitted_model, (*source.held, source.values), source, source.synthetic)

    def on(self, model: Model) -> Known:
        """Return the same knowledge of another model that holds the fitted paths."""
        base = model
        for values in self.placed[-1:]:
            base = base.with_values(values.assignments, f"stage '{values.stage}'")
        return replace(self, model=base)

    @property
    def placed(self) -> tuple[FittedValues, ...]:
        """The values under the paths that they have in the model."""
        return tuple(_prefixed(v, f"{self.at}.") for v in self.values) if self.at else self.values

    @property
    def kept(self) -> tuple[Discrepancy, ...]:
        """What the fits leave open in the structure of their models, in the order of their values, as far as these say it."""
        return tuple(k for v in self.placed if (k := discrepancy_kept(v)) is not None)


def known_of(source: Known | Model | Calibration | FittedValues | Sequence[Any], model: Model | None = None, at: str = "") -> Known:
    """Return what is known, its values laid over the model.

    Parameters
    ----------
    source : Known, Model, Calibration, FittedValues, or several of the last two
    model : Model       What values are laid over; a fit's own where it is not given.
    at : str            The submodel that the values belong to.
    """
    if isinstance(source, Known):
        known = source
    elif model is None and isinstance(source, Model | Calibration):
        return Known.of(source)
    else:
        many = [source] if isinstance(source, Calibration | FittedValues) else list(source) if not isinstance(source, Model) else []
        values = tuple(x for v in many for x in ((*v.held, v.values) if isinstance(v, Calibration) else (v,)))
        assert model is not None
        known = Known(model, values, None, any(isinstance(v, Calibration) and v.synthetic for v in many), at)
    if known.fit is not None:
        return known
    base = known.model
    for v in known.placed:
        base = base.with_values(v.assignments, f"stage '{v.stage}'") if v.assignments else base
    return replace(known, model=base)


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
    for k, values in enumerate(reversed(known.placed)):
        last = k == 0
        left = values.bare() if last else values.only([p for p, v in values.parameters.items() if not taken & {p, *v.also} and v.error > 0])
        left = left.bare()
        taken |= {*left.assignments}
        if left:
            cause = "fit" if last and known.fit is not None else f"held from {values.stage}" if known.fit is not None else ""
            out = out.beside(_rows(left, cause or f"fit of {values.stage}"))
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
