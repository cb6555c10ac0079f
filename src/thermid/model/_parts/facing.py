"""Direction of a surface's outward normal, for sun and sky."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

from thermid.base.errors import DeckError

_DEGREES = re.compile(r"\s*([+-]?\d+(?:\.\d*)?)\s*(?:\[\s*(?:deg|°)\s*\])?\s*\Z")


@dataclass(frozen=True)
class Facing:
    """The direction of a surface's outward normal.

    Parameters
    ----------
    tilt : float        From looking up: 0 a roof, 90 a wall, 180 a floor seen from below. [deg]
    azimuth : float     From north over east: 0 north, 90 east; None goes all around, as the skin of an upright cylinder or cone. [deg]

    Raises
    ------
    DeckError   When the tilt is outside 0 to 180, or the azimuth outside -180 to 360.
    """

    tilt: float
    azimuth: float | None = None

    def __post_init__(self) -> None:
        """Refuse a tilt outside 0 .. 180 degrees or an azimuth outside -180 .. 360 degrees."""
        if not 0.0 <= self.tilt <= 180.0:
            raise DeckError(f"the tilt is {self.tilt:g} degrees. Give 0 (facing up) to 180 (facing down).", code="value.outside-range")
        if self.azimuth is not None and not -180.0 <= self.azimuth <= 360.0:
            raise DeckError(f"the azimuth is {self.azimuth:g} degrees. Give 0 to 360, from north through east.", code="value.outside-range")


def degrees(value: Any, where: str = "") -> float:
    """Return an angle that is written as a number of degrees, or as a text such as ``90 [deg]``. [deg]

    Raises
    ------
    DeckError   When it is neither.
    """
    if isinstance(value, int | float) and not isinstance(value, bool):
        return float(value)
    match = _DEGREES.match(value) if isinstance(value, str) else None
    if match is None:
        raise DeckError(f"'{value}' is not an angle. Write a number of degrees, such as 90 or '90 [deg]'.", where, code="value.wrong-kind")
    return float(match[1])


def facing_to(facing: Facing) -> dict[str, float]:
    """Return tilt and azimuth as the table of a deck. [deg]"""
    return {"tilt": facing.tilt} | ({} if facing.azimuth is None else {"azimuth": facing.azimuth})
