"""Emissivity by finish: what books say of surfaces of equipment near room temperature, with the range that they span."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from thermid.base.errors import DeckError, nearest


@dataclass(frozen=True)
class Finish:
    """Total hemispherical emissivity of a finish between about 250 and 400 K.

    Parameters
    ----------
    name : str              What the surface is.
    typical : float         The value to start from. [-]
    low, high : float       The range of the sources, read as holding 95 % of parts. [-]
    source : str            Books and tables, from memory.
    read : str              What public pages say that were read for it; empty where none was found, and all is from memory.
    """

    name: str
    typical: float
    low: float
    high: float
    source: str
    read: str = ""

    @property
    def basis(self) -> str:
        """Text of the range and its sources, as a deck's value quotes it."""
        return (
            f"finish '{self.name}', {self.low:g} to {self.high:g}: {self.source}; "
            f"{f'read: {self.read}' if self.read else 'not checked again'}"
        )


_INCROPERA = "Incropera, 6th ed., Tables A.11 and A.12"
_GILMORE = "Gilmore, Spacecraft Thermal Control Handbook, 2nd ed., Appendix A"
_HENNINGER = "Henninger, NASA RP-1121 (1984)"
_MANUALS = "FLIR manuals T10xx, T8xx, T5xx"
_FLIR = "FLIR manuals, emissivity tables, after Bramson, Wolfe and Madding"
_FORTESCUE = "Fortescue, Swinerd, Stark, Spacecraft Systems Engineering, 4th ed., Table 11.3"

FINISHES: Final = {
    f.name: f
    for f in (
        Finish("aluminium, polished", 0.045, 0.03, 0.07, f"{_INCROPERA}; {_FLIR}", f"{_MANUALS}, 0.04 to 0.06 at 50 to 100 degC"),
        Finish("aluminium, foil", 0.05, 0.03, 0.08, _INCROPERA, f"{_MANUALS}, 0.04 at 10 um"),
        Finish(
            "aluminium, machined",
            0.09,
            0.05,
            0.15,
            f"{_FLIR} (as received 0.09, rough 0.06 to 0.07); {_GILMORE}",
            f"{_MANUALS}, as received 0.09, rough 0.06 to 0.07",
        ),
        Finish(
            "aluminium, oxidised",
            0.25,
            0.18,
            0.33,
            f"{_FLIR} (0.20 to 0.31); {_HENNINGER}",
            f"{_MANUALS}, strongly 0.2 to 0.3; Omega OS100, 0.20 to 0.31",
        ),
        Finish("aluminium, chromated", 0.12, 0.06, 0.2, f"{_GILMORE}, alodine"),
        Finish(
            "aluminium, anodised clear",
            0.78,
            0.7,
            0.86,
            f"{_INCROPERA} (0.82); {_GILMORE}",
            f"{_MANUALS}, 0.55 for a sheet by chromic acid, thinner than this range means; 0.97 (8 to 14 um) grey and dull",
        ),
        Finish(
            "aluminium, anodised black", 0.84, 0.78, 0.9, f"{_GILMORE}; {_HENNINGER}", f"{_MANUALS}, 0.95 (8 to 14 um, where it is highest)"
        ),
        Finish(
            "aluminium, blasted",
            0.3,
            0.18,
            0.47,
            f"{_FLIR} (roughened 0.18 to 0.28, cast and blasted 0.46)",
            f"{_MANUALS}, cast and blasted 0.46 (8 to 14 um), roughened 0.18 (10 um)",
        ),
        Finish(
            "stainless steel, polished",
            0.14,
            0.1,
            0.19,
            f"{_HENNINGER} (0.11); {_INCROPERA} (0.17)",
            "Trotec IC 120, 18-8 0.16 at 25 degC; wenglor TIF352, 0.07 (8 to 14 um)",
        ),
        Finish(
            "stainless steel, machined",
            0.22,
            0.14,
            0.36,
            f"{_HENNINGER} (0.14); {_INCROPERA} (cleaned 0.22); {_FLIR} (sheet 0.28)",
            "wenglor TIF352, sheet 0.28 (8 to 14 um)",
        ),
        Finish("stainless steel, blasted", 0.4, 0.32, 0.5, f"{_HENNINGER} (0.38)"),
        Finish("stainless steel, oxidised", 0.7, 0.5, 0.87, f"{_INCROPERA}; {_FLIR}", "Ideal HeatSeeker 160, 0.85 after 800 degC"),
        Finish(
            "steel, machined",
            0.24,
            0.14,
            0.38,
            f"{_FLIR} (freshly worked or rolled 0.24)",
            f"{_MANUALS}, freshly worked or rolled 0.24 at 20 degC",
        ),
        Finish("steel, oxidised", 0.78, 0.68, 0.88, _FLIR, f"{_MANUALS}, 0.74 at 100 degC, 0.78 to 0.82, strongly 0.88"),
        Finish("copper, polished", 0.03, 0.02, 0.05, f"{_INCROPERA}; {_FLIR}", f"{_MANUALS}, 0.02 at 50 to 100 degC, 0.03 at 100 degC"),
        Finish("copper, oxidised", 0.7, 0.55, 0.87, _FLIR, f"{_MANUALS}, 0.6 to 0.7 at 50 degC, heavily 0.78, black 0.88"),
        Finish("brass, dull", 0.22, 0.17, 0.28, _FLIR, f"{_MANUALS}, 0.22 at 20 to 350 degC"),
        Finish("gold, plated", 0.03, 0.02, 0.05, f"{_INCROPERA}; {_GILMORE}", f"{_MANUALS}, polished 0.018 to 0.03; {_FORTESCUE}, 0.04"),
        Finish("silver, polished", 0.02, 0.01, 0.04, f"{_INCROPERA}; {_HENNINGER}", "Raytek MI3, 0.02"),
        Finish(
            "nickel, plated",
            0.08,
            0.05,
            0.12,
            f"{_INCROPERA}; {_FLIR}",
            "Raytek MI3, electrolytic 0.05 to 0.15 (8 to 14 um); Trotec IC 120, polished 0.05",
        ),
        Finish(
            "chromium, plated", 0.1, 0.07, 0.15, f"{_INCROPERA}; {_FLIR}", f"{_MANUALS}, polished 0.10 at 50 degC; testo, 0.08 at 40 degC"
        ),
        Finish("titanium, machined", 0.2, 0.12, 0.35, _GILMORE, f"{_FORTESCUE}, polished 0.60, which is not in this range: measure it"),
        Finish(
            "paint, black",
            0.89,
            0.84,
            0.94,
            f"{_GILMORE}, Aeroglaze Z302 to Z307; {_HENNINGER}",
            f"{_FORTESCUE}, 0.85 and 0.90; {_MANUALS}, shiny 0.87, dull 0.96 to 0.98",
        ),
        Finish(
            "paint, white",
            0.89,
            0.84,
            0.93,
            f"{_GILMORE}, Aeroglaze A276, Z93; {_HENNINGER}",
            f"{_FORTESCUE}, silicone 0.83, silicate 0.90; {_MANUALS}, 0.8 to 0.95",
        ),
        Finish(
            "paint, any non-metallic",
            0.9,
            0.8,
            0.96,
            f"{_INCROPERA}; {_FLIR} (lacquers 0.80 to 0.96)",
            f"{_MANUALS}, 0.8 to 0.98; testo, oil paints 0.92 to 0.96",
        ),
        Finish("paint, aluminium", 0.4, 0.25, 0.6, _FLIR, f"{_MANUALS}, on a rough surface 0.4"),
        Finish(
            "circuit board",
            0.88,
            0.8,
            0.94,
            f"{_FLIR}, epoxy laminate and solder resist",
            "wenglor TIF352, glass fibre laminate 0.91 (8 to 14 um)",
        ),
        Finish("plastic", 0.9, 0.84, 0.95, f"{_FLIR}; {_INCROPERA}", "wenglor TIF352, PVC 0.93 (8 to 14 um); testo, PE, PP and PVC 0.94"),
        Finish("glass", 0.9, 0.86, 0.95, _INCROPERA, "testo, 0.94 at 90 degC; Ideal HeatSeeker 160, polished plate 0.94"),
    )
}
"""Finishes by name. Values were put together from memory of the sources, and then held against the public pages named under `read`: their
tables are for cameras, at one wavelength where that is said, and were no reason to change any but the range of blasted aluminium. Two of 29
are from memory alone. Check a value before it decides anything."""


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
        raise DeckError(f"unknown finish '{name}'.{hint} For any other surface give its emissivity.", where, code="name.unknown")
    return FINISHES[name]
