"""Macro models: the unit on its host. Every value of the host has a source, or there is no macro model."""

from __future__ import annotations

import os
from dataclasses import dataclass

from thermid.base.errors import DeckError, NameNotFoundError, quoted, refuse_unknown
from thermid.model.tree import Entry, Model, load_model

UNIT = "unit"
"""Name of the submodel that a macro model calls its unit."""


@dataclass(frozen=True)
class HostValue:
    """A value of the host, with where it comes from.

    Parameters
    ----------
    path, text : str        Its path in the macro model; as written, with its unit.
    source, basis : str     Kind of source; what it rests on.
    origin : str            The deck, or who laid the value over it.
    """

    path: str
    text: str
    source: str
    basis: str
    origin: str


def macro_model(host: Model | str | os.PathLike[str], unit: Model | str | os.PathLike[str] | None = None, at: str = UNIT) -> Model:
    """Return a host with a unit in it, once every value of the host is known to have a source.

    Parameters
    ----------
    host : Model or path    The deck of base plate, bay, fairing, ...; the unit is one of its submodels.
    unit : Model or path    Takes the place of that submodel; the deck's own when not given.
    at : str                Name of the submodel.

    Raises
    ------
    NameNotFoundError   When the host has no such submodel.
    DeckError           When values of the host have no source (all of them are named), or the unit's ports do not fit.
    """
    model = host if isinstance(host, Model) else load_model(host)
    refuse_unknown(
        [at], model.submodels, model.title, "no submodel '{}' for the unit.{near} A macro model must contain its unit.", NameNotFoundError
    )
    if unit is not None:
        set_here = [p for p in map(model.canonical, model.settings) if p.startswith(f"{at}.")]  # what the host says of any unit in it
        model = model.replace(at, unit if isinstance(unit, Model) else load_model(unit), set_here)
    shapes = model.own_tables()
    bare = [v.path for v in host_values(model, at) if not v.source]
    if bare:
        have = "one value of the host has" if len(bare) == 1 else f"{len(bare)} values of the host have"
        raise DeckError(
            f"{have} no source: {quoted(bare)}. Give the source of each: "
            '{ value = ..., source = "measured", "datasheet", "published", "derived" or "assumed", basis = "..." }'
            f"{', with source and basis beside the points of a table' if any(p in shapes for p in bare) else ''}.",
            model.file or model.title,
            code="value.incomplete",
        )
    return model


def host_values(model: Model, at: str = UNIT) -> tuple[HostValue, ...]:
    """Return every number and every table of a macro model that is not the unit's own, numbers that the host sets inside it too.

    Parameters
    ----------
    model : Model   The macro model.
    at : str        Name of its unit.
    """
    table = model.parameter_table()
    laid_paths = {model.canonical(p) for p in model.settings} | {p for layer in model.layers for p in layer.values}
    host_entries = {p: e for p, e in table.items() if e.parameter.is_literal and (not p.startswith(f"{at}.") or p in laid_paths)}
    values = [HostValue(p, e.parameter.text, _source(e, model), e.parameter.basis, e.origin) for p, e in host_entries.items()]
    shapes = {p: shape for p, (shape, _) in model.own_tables().items() if not p.startswith(f"{at}.")}
    return (*values, *(HostValue(p, f"a table of {c.x.size} points", c.source, c.basis, model.title) for p, c in shapes.items()))


def _source(entry: Entry, model: Model) -> str:
    """Return the source of a value; what a fit laid over the host carries its stage and records as a note."""
    fitted = any(entry.origin == layer.origin for layer in model.layers) and entry.parameter.note
    return entry.parameter.source or ("calibrated" if fitted else "")


def assumed(model: Model) -> tuple[str, ...]:
    """Return the assumed values and tables of a model, each place in a deck once, by the path of its first instance."""
    first: dict[str, str] = {}
    for path, entry in model.parameter_table().items():
        if entry.parameter.source == "assumed":
            first.setdefault(entry.where, path)
    for path, (shape, where) in model.own_tables().items():
        if shape.source == "assumed":
            first.setdefault(where, path)
    return tuple(first.values())
