"""Emissivity by finish: what books say of surfaces of equipment near room temperature, with the range that they span."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from thermid.errors import DeckError, nearest

__all__ = ["FINISHES", "Finish", "finish"]

SPAN: Final = 2 * 1.959964
"""Width of the range of a finish in standard deviations of the logarithm: it is read as holding 95 %. [-]"""


@dataclass(frozen=True)
class Finish:
    """Total hemispherical emissivity of a finish between about 250 and 400 K.

    Parameters
    ----------
    name : str              What the surface is.
    typical : float         The value to start from. [-]
    low, high : float       The range of the sources, read as holding 95 % of parts. [-]
    source : str            Books and tables.
    """

    name: str
    typical: float
    low: float
    high: float
    source: str

    @property
    def log_sd(self) -> float:
        """Standard deviation of the logarithm of the emissivity. [-]"""
        return math.log(self.high / self.low) / SPAN


_INCROPERA = "Incropera, 6th ed., Tables A.11 and A.12"
_GILMORE = "Gilmore, Spacecraft Thermal Control Handbook, 2nd ed., Appendix A"
_HENNINGER = "Henninger, NASA RP-1121 (1984)"
_FLIR = "FLIR manuals, emissivity tables, after Bramson, Mikaelyan and the VDI"

FINISHES: Final = {
    f.name: f
    for f in (
        Finish("aluminium, polished", 0.045, 0.03, 0.07, f"{_INCROPERA}; {_FLIR}"),
        Finish("aluminium, foil", 0.05, 0.03, 0.08, _INCROPERA),
        Finish("aluminium, machined", 0.09, 0.05, 0.15, f"{_FLIR} (as received 0.09, rough 0.06 to 0.07); {_GILMORE}"),
        Finish("aluminium, oxidised", 0.25, 0.18, 0.33, f"{_FLIR} (0.20 to 0.31); {_HENNINGER}"),
        Finish("aluminium, chromated", 0.12, 0.06, 0.2, f"{_GILMORE}, alodine"),
        Finish("aluminium, anodised clear", 0.78, 0.7, 0.86, f"{_INCROPERA} (0.82); {_GILMORE}"),
        Finish("aluminium, anodised black", 0.84, 0.78, 0.9, f"{_GILMORE}; {_HENNINGER}"),
        Finish("aluminium, blasted", 0.3, 0.18, 0.45, f"{_FLIR} (roughened 0.18 to 0.28, cast and blasted 0.46)"),
        Finish("stainless steel, polished", 0.14, 0.1, 0.19, f"{_HENNINGER} (0.11); {_INCROPERA} (0.17)"),
        Finish("stainless steel, machined", 0.22, 0.14, 0.36, f"{_HENNINGER} (0.14); {_INCROPERA} (cleaned 0.22); {_FLIR} (sheet 0.28)"),
        Finish("stainless steel, blasted", 0.4, 0.32, 0.5, f"{_HENNINGER} (0.38)"),
        Finish("stainless steel, oxidised", 0.7, 0.5, 0.87, f"{_INCROPERA}; {_FLIR}"),
        Finish("steel, machined", 0.24, 0.14, 0.38, f"{_FLIR} (freshly worked or rolled 0.24)"),
        Finish("steel, oxidised", 0.78, 0.68, 0.88, _FLIR),
        Finish("copper, polished", 0.03, 0.02, 0.05, f"{_INCROPERA}; {_FLIR}"),
        Finish("copper, oxidised", 0.7, 0.55, 0.87, _FLIR),
        Finish("brass, dull", 0.22, 0.17, 0.28, _FLIR),
        Finish("gold, plated", 0.03, 0.02, 0.05, f"{_INCROPERA}; {_GILMORE}"),
        Finish("silver, polished", 0.02, 0.01, 0.04, f"{_INCROPERA}; {_HENNINGER}"),
        Finish("nickel, plated", 0.08, 0.05, 0.12, f"{_INCROPERA}; {_FLIR}"),
        Finish("chromium, plated", 0.1, 0.07, 0.15, f"{_INCROPERA}; {_FLIR}"),
        Finish("titanium, machined", 0.2, 0.12, 0.35, _GILMORE),
        Finish("paint, black", 0.89, 0.84, 0.94, f"{_GILMORE}, Aeroglaze Z302 to Z307; {_HENNINGER}"),
        Finish("paint, white", 0.89, 0.84, 0.93, f"{_GILMORE}, Aeroglaze A276, Z93; {_HENNINGER}"),
        Finish("paint, any non-metallic", 0.9, 0.8, 0.96, f"{_INCROPERA}; {_FLIR} (lacquers 0.80 to 0.96)"),
        Finish("paint, aluminium", 0.4, 0.25, 0.6, _FLIR),
        Finish("circuit board", 0.88, 0.8, 0.94, f"{_FLIR}, epoxy laminate and solder resist"),
        Finish("plastic", 0.9, 0.84, 0.95, f"{_FLIR}; {_INCROPERA}"),
        Finish("glass", 0.9, 0.86, 0.95, _INCROPERA),
    )
}
"""Finishes by name. The values were put together from the tables named, most of them from memory: check one before it decides anything."""


def finish(name: str, where: str = "") -> Finish:
    """Return a finish by its name.

    Raises
    ------
    DeckError   When there is none of that name; the message has the nearest one.

    Examples
    --------
    >>> finish("paint, white").typical
    0.89
    """
    if name not in FINISHES:
        first = name.partition(",")[0].strip().lower()
        same = [f"'{n}'" for n in FINISHES if n.partition(",")[0] == first]
        hint = f" There are {', '.join(same)}." if same and "," not in name else nearest(name, FINISHES)
        raise DeckError(f"no finish is called '{name}'.{hint} For any other surface give its emissivity.", where)
    return FINISHES[name]
