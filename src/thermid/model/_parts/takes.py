"""What joints take from a surface, and what they leave of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from thermid.base.dual import Number, value_of
from thermid.base.errors import DeckError

SUM_ROUNDING = 1e-12


@dataclass(frozen=True)
class Take:
    """Area that a joint takes from a surface: `count` times the parameter at `path`."""

    joint: str
    path: str
    use: str


def exposed_area(surface: str, total: Number, takes: tuple[Take, ...], values: Mapping[str, Number], where: str = "") -> Number:
    """Return the area of a surface less what joints take of it: total - sum of takes, not below zero. [m^2]

    Raises
    ------
    DeckError   When they take more than there is; the message names every joint.
    """
    remaining = total
    for take in takes:
        remaining = remaining - values[take.path]
    if value_of(remaining) < -SUM_ROUNDING * value_of(total):
        parts = " and ".join(f"'{t.joint}' takes {value_of(values[t.path]) * 1e4:.6g} cm^2 ({t.use})" for t in takes)
        raise DeckError(
            f"the surface '{surface}' has {value_of(total) * 1e4:.6g} cm^2, but {parts}. Reduce the area of a joint, or enlarge the "
            "surface.",
            where,
            code="value.contradicts",
        )
    return remaining if value_of(remaining) > 0 else 0.0 * remaining
