"""The SI unit of a parameter, as text."""

from __future__ import annotations

from thermid.model.tree.resolve import ParameterSet
from thermid.units import NAMES, describe, unit


def si_unit(parameters: ParameterSet, path: str) -> str:
    """Return the SI unit of a parameter: ``W/(m^2 K)``, ``-`` for a plain number."""
    dimension = parameters.dimension(path)
    text = next((t for t in NAMES if unit(t).dimension == dimension), "")
    return {"1": "-", "": describe(dimension).removeprefix("a quantity in ")}.get(text, text)
