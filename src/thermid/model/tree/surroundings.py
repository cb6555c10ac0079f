"""What surfaces exchange with: which nodes are gas, what radiates into a gas, and what a surface leaves unsaid of gas and of vacuum."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from thermid.errors import quoted
from thermid.model.tree.flat import Flat, FlatSurface

WALLS = ("walls", "air and walls")
"""What a node stands for that radiation can reach."""


def gas_nodes(flat: Flat) -> frozenset[str]:
    """Return the inner nodes that are gas: declared as air, or convected to without being a solid.

    Surfaces, gaps of joints and leads name the gas that takes their convection. A node that has a surface of its own is a solid. A boundary
    is none of these: it is the air of a large room and its walls alike.
    """
    around = surrounding(flat)
    return frozenset(n.path for n in flat.nodes if n.stands_for == "air" or (n.path in around and n.stands_for not in WALLS))


def into_gas(flat: Flat, values: Mapping[str, Any]) -> dict[str, list[str]]:
    """Return gas node -> what radiates to it with an emissivity above zero: surfaces, leads, conductors, enclosures by their rest.

    Parameters
    ----------
    values : dict   Parameter path -> value. [SI]
    """
    gases = gas_nodes(flat)
    out: dict[str, dict[str, None]] = {}
    if not gases:
        return {}
    faces = {path: (face.sees, face.fields.get("emissivity", "")) for path, face in flat.faces.items()}
    leads = {_lead(c.path): (c.gas, c.fields["emissivity"]) for c in flat.conductors if c.kind == "lead" and "emissivity" in c.fields}
    for path, (node, emissivity) in (faces | leads).items():
        if node in gases and emissivity and values[emissivity] != 0.0:
            out.setdefault(node, {})[path] = None
    for c in flat.conductors:
        path = c.path.removesuffix(".radiation")
        if c.kind == "radiation" and path not in flat.faces:
            factor = next((values[c.fields[f]] for f in ("emissivity", "exchange_factor") if f in c.fields), 1.0)
            enclosure = path.rpartition(".")[0].rpartition(".")[0] if c.recipe is not None else path
            for node in gases & set(c.ends) if factor != 0.0 else ():
                out.setdefault(node, {})[enclosure] = None
    return {node: list(paths) for node, paths in out.items()}


def radiates_into(gas: str, radiating: list[str]) -> str:
    """Return what is said of what radiates into a gas."""
    radiates, sees = ("radiate", "they see") if len(radiating) > 1 else ("radiates", "it sees")
    return (
        f"{quoted(radiating)} {radiates} to '{gas}', which is gas, and gas takes no radiation from a wall. Name the wall that {sees}, "
        "sees = ...; make an enclosure; bind a part's need apart, "
        f'bind = {{ need = {{ to = "{gas}", sees = "..." }} }}; or, where \'{gas}\' is one node for the air and the walls around it, '
        'stands_for = "air and walls" (a solid: stands_for = "walls").'
    )


def bare(flat: Flat) -> dict[str, str]:
    """Return surface or lead -> its gas, of those with a convection and without a word on radiation."""
    faces = {path: face.to for path, face in flat.faces.items() if face.exchange == "htc" and "emissivity" not in face.fields}
    leads = {_lead(c.path): c.gas for c in flat.conductors if c.kind == "lead" and "htc" in c.fields and "emissivity" not in c.fields}
    return faces | leads


def _lead(path: str) -> str:
    """Return the lead of one of its losses."""
    return path.removesuffix(".first").removesuffix(".second")


def still(flat: Flat) -> dict[str, str]:
    """Return surface -> its gas, of those with an emissivity, in no enclosure, and without a word on convection."""

    def silent(face: FlatSurface) -> bool:
        return not face.exchange and bool(face.sees) and "emissivity" in face.fields

    return {path: face.to for path, face in flat.faces.items() if silent(face)}


def surrounding(flat: Flat) -> frozenset[str]:
    """Return the nodes, boundaries among them, that surfaces, gaps and leads convect to, and that have no surface of their own."""
    return frozenset(_convected(flat)) - {face.node for face in flat.faces.values()}


def _convected(flat: Flat) -> set[str]:
    found = {face.to for face in flat.faces.values() if face.exchange}
    found |= {c.gas for c in flat.conductors if c.path.endswith(".gap") and c.kind == "convection"}
    return found | {c.gas for c in flat.conductors if c.kind == "lead" and {"htc", "effective_htc"} & set(c.fields)}
