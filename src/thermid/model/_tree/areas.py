"""The area ledger: what a surface has, what joints take from it, and what is left to convect and radiate."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from thermid.base.units import value_of
from thermid.model._parts.elements import exposed_area
from thermid.model._tree.flat import Flat
from thermid.model._tree.model import Model


@dataclass(frozen=True)
class LedgerLine:
    """The areas of one surface; exposed + contact + gap = total.

    Parameters
    ----------
    surface : str                           Path.
    total, exposed, contact, gap : float    [m^2]
    joints : dict                           Joint -> area it takes, contact and gap together. [m^2]
    """

    surface: str
    total: float
    exposed: float
    contact: float
    gap: float
    joints: Mapping[str, float]


def ledger(model: Model) -> tuple[LedgerLine, ...]:
    """Return the area ledger of a model: for every surface, at every depth, its total and what is exposed, in contact and in gaps.

    Raises
    ------
    DeckError   When joints take more than a surface has.
    """
    flat = Flat.of_model(model)
    values = flat.parameters.evaluate({})
    lines = []
    for surface, (path, takes) in flat.surfaces.items():
        joints: dict[str, float] = {}
        for take in takes:
            joints[take.joint] = joints.get(take.joint, 0.0) + values[take.path]
        contact = sum(values[t.path] for t in takes if t.use == "contact")
        gap = sum(values[t.path] for t in takes if t.use == "gap")
        exposed = exposed_area(surface, values[path], takes, values, flat.parameters.table[path].where)
        lines.append(LedgerLine(surface, values[path], value_of(exposed), contact, gap, joints))
    return tuple(lines)
