"""A small table of materials, each with its source: first guesses, not truths. Emissivities are in `finishes`.

A model should take its values from a certificate or a fit; these are where a fit starts.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from thermid.base.errors import NameNotFoundError, nearest

_INCROPERA = "handbook: Incropera, DeWitt, Bergman, Lavine, Fundamentals of Heat and Mass Transfer, 6th ed."
_CRAWFORD = "handbook: Crawford, Plastics Engineering, 3rd ed., Table 1.8"


@dataclass(frozen=True)
class Material:
    """One material near 300 K.

    Parameters
    ----------
    density : float         Density. [kg/m^3]
    specific_heat : float   Specific heat. [J/(kg K)]
    conductivity : float    Conductivity. [W/(m K)]
    source : str            Where the values are from, and how sure they are.
    """

    density: float
    specific_heat: float
    conductivity: float
    source: str


MATERIALS: Mapping[str, Material] = MappingProxyType(
    {
        "aluminium 7075-T6": Material(2810.0, 960.0, 130.0, "handbook: ASM typical values, as in the FreeCAD card Aluminum-7075-T6"),
        "aluminium 6061-T6": Material(2700.0, 896.0, 167.0, "handbook: Aluminum Association typical values"),
        "stainless steel 304": Material(7900.0, 477.0, 14.9, f"{_INCROPERA}, Table A.1"),
        "copper": Material(8933.0, 385.0, 401.0, f"{_INCROPERA}, Table A.1, pure"),
        "FR4": Material(
            1850.0,
            1000.0,
            0.3,
            "handbook: density and conductivity (through the board, no copper; 0.25 to 0.6 in use) of laminate data sheets; specific "
            "heat of G-10 CR at 300 K, NIST cryogenic material properties",
        ),
        "ABS": Material(1040.0, 1300.0, 0.25, f"{_CRAWFORD}; other tables have 0.17 to 0.25 W/(m K)"),
        "PETG": Material(1270.0, 1200.0, 0.29, "handbook: MakeItFrom.com, glycol-modified PET; PET itself is given as 0.2 to 0.24 W/(m K)"),
        "acrylic": Material(1180.0, 1500.0, 0.2, _CRAWFORD),
        "air": Material(1.1614, 1007.0, 0.0263, f"{_INCROPERA}, Table A.4, 300 K, 1 atm"),
    }
)
"""Materials by name."""


def material(name: str) -> Material:
    """Properties of the material of that name.

    Raises
    ------
    NameNotFoundError   The table does not have it; the message offers the nearest.

    Examples
    --------
    >>> material("aluminium 7075-T6").conductivity
    130.0
    """
    if name not in MATERIALS:
        names = ", ".join(MATERIALS)
        raise NameNotFoundError(f"no material '{name}' in the table.{nearest(name, MATERIALS)} Known: {names}. Or give its values.")
    return MATERIALS[name]
