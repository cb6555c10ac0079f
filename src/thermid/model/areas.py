"""The area ledger: what a surface has, what joints take from it, and what is left to convect and radiate."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from thermid.dual import Number, value_of
from thermid.errors import DeckError
from thermid.model.flat import Take, flatten
from thermid.model.model import Model

__all__ = ["LedgerLine", "exposed_area", "ledger"]

ROUNDING = 1e-12


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


def exposed_area(surface: str, total: Number, takes: tuple[Take, ...], values: Mapping[str, Number], where: str = "") -> Number:
    """Return what joints leave of a surface. [m^2]

    Raises
    ------
    DeckError   When they take more than there is; the message names every joint.
    """
    left = total
    for take in takes:
        left = left - values[take.path]
    if value_of(left) < -ROUNDING * value_of(total):
        parts = " and ".join(f"'{t.joint}' takes {value_of(values[t.path]) * 1e4:.6g} cm^2 ({t.use})" for t in takes)
        raise DeckError(
            f"the surface '{surface}' has {value_of(total) * 1e4:.6g} cm^2, but {parts}. Make a joint smaller or the surface larger.", where
        )
    return left if value_of(left) > 0 else 0.0 * left


def ledger(model: Model) -> tuple[LedgerLine, ...]:
    """Return the areas of every surface of a model, at every depth.

    Raises
    ------
    DeckError   When joints take more than a surface has.
    """
    flat = flatten(model)
    values = flat.parameters.evaluate({})
    lines = []
    for surface, (path, takes) in flat.surfaces.items():
        joints: dict[str, float] = {}
        for take in takes:
            joints[take.joint] = joints.get(take.joint, 0.0) + values[take.path]
        contact = sum(values[t.path] for t in takes if t.use == "contact")
        gap = sum(values[t.path] for t in takes if t.use == "gap")
        left = exposed_area(surface, values[path], takes, values, flat.parameters.table[path].where)
        lines.append(LedgerLine(surface, values[path], value_of(left), contact, gap, joints))
    return tuple(lines)
