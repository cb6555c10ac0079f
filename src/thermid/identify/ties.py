"""Instances of one definition share fitted values."""

from __future__ import annotations

from collections.abc import Iterator

from thermid.model.model import Model
from thermid.model.resolve import ParameterSet

__all__ = ["instances", "tied"]


def instances(model: Model, prefix: str = "") -> Iterator[tuple[str, str]]:
    """Yield prefix and definition of every submodel, at every depth."""
    for name, part in model.submodels.items():
        yield f"{prefix}{name}.", part.definition
        yield from instances(part.model, f"{prefix}{name}.")


def tied(model: Model, parameters: ParameterSet, path: str) -> tuple[str, ...]:
    """Return the paths that share the value of `path`: the same parameter in every instance of its part's definition.

    An instance whose value was set otherwise keeps its own.
    """
    every = list(instances(model))
    own = max((i for i in every if path.startswith(i[0])), key=lambda i: len(i[0]), default=None)
    if own is None or not own[1]:
        return (path,)
    rest = path.removeprefix(own[0])
    mine = parameters.table[path].parameter
    same = [
        prefix + rest
        for prefix, definition in every
        if definition == own[1] and prefix != own[0] and parameters.table[prefix + rest].parameter.text == mine.text
    ]
    return (path, *(p for p in same if parameters.table[p].parameter.is_literal))
