"""Convection by a named correlation: Nusselt numbers of surfaces in a gas, with the range in which each holds and where it comes from.

Names are those of the library `ht`; the first four need no library. Any other function of `ht` for free convection of immersed bodies
that takes a Prandtl and a Grashof number serves too, where that library is installed.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Final

import numpy as np

from thermid.base.errors import DeckError, missing, nearest, refuse_first, refuse_unknown
from thermid.base.units import Array
from thermid.physics._number import Number
from thermid.physics.plates import (
    CONVEX_SHAPE_FACTOR,
    DISC_SHAPE_FACTOR,
    body_nusselt,
    horizontal_plate_down_nusselt,
    vertical_plate_nusselt,
    vertical_plate_nusselt_all,
)

ORIENTATIONS: Final = ("vertical", "up", "down")
BLEND: Final = 8
"""Exponent with which conduction and convection are joined: 1 % above the larger one at a ratio of 1.5. [-]"""
SQUARE: Final = DISC_SHAPE_FACTOR / math.sqrt(2.0)
"""Nusselt number of gas at rest around a thin square plate, on its side; on area over perimeter a quarter of it. [-]"""
RAYLEIGH_AT_REST: Final = 1e-10
"""Rayleigh number that stands for gas at rest. [-]"""
DEFAULTS: Final = {"vertical": "Nu_vertical_plate_Churchill", "up": "Nu_horizontal_plate_McAdams", "down": "Nu_horizontal_plate_McAdams"}


@dataclass(frozen=True)
class NusseltLaw:
    """A law of free convection.

    Parameters
    ----------
    name : str              As decks write it; a function of `ht`, or one of this package.
    nusselt : callable      Rayleigh number, Prandtl number, whether buoyancy carries the gas away from the surface -> Nusselt number.
    low, high : float       Rayleigh numbers between which it was found. [-]
    facing : bool           Whether it needs to know which way the surface faces.
    still : float           Nusselt number of gas at rest on its length, the least: of a square plate with both its faces, 3.19 k / sqrt(A)
                            (Incropera, 6th ed., Section 4.3), or what the correlation itself ends at. [-]
    source : str            Book or paper.
    """

    name: str
    nusselt: Callable[[float, float, bool], float]
    low: float
    high: float
    facing: bool
    still: float
    source: str


def _mcadams(rayleigh: float, prandtl: float, away: bool) -> float:
    """Nusselt number of a horizontal plate: max(0.54 Ra^(1/4), 0.15 Ra^(1/3)) where gas leaves it freely (`away`), else 0.27 Ra^(1/4)."""
    return float(max(0.54 * rayleigh**0.25, 0.15 * rayleigh ** (1.0 / 3.0)) if away else horizontal_plate_down_nusselt(rayleigh))


_CHURCHILL = "Churchill and Chu, Int. J. Heat Mass Transfer 18 (1975) 1323; Incropera, 6th ed., Eqs. 9.26 and 9.27"
CORRELATIONS: Final = {
    c.name: c
    for c in (
        NusseltLaw(
            "Nu_vertical_plate_Churchill",
            lambda rayleigh, prandtl, away: float(vertical_plate_nusselt_all(rayleigh, prandtl)),
            *(0.0, 1e12, False, SQUARE, _CHURCHILL),
        ),
        NusseltLaw(
            "Nu_vertical_plate_laminar",
            lambda rayleigh, prandtl, away: float(vertical_plate_nusselt(rayleigh, prandtl)),
            0.0,
            1e9,
            False,
            SQUARE,
            f"{_CHURCHILL}; Eq. 7 of the source document",
        ),
        NusseltLaw(
            "Nu_horizontal_plate_McAdams", _mcadams, 1e4, 1e11, True, SQUARE / 4.0, "McAdams; Incropera, 6th ed., Eqs. 9.30 to 9.32"
        ),
        NusseltLaw(
            "Nu_body",
            lambda rayleigh, prandtl, away: float(body_nusselt(rayleigh, prandtl)),
            *(0.0, 1e9, False, CONVEX_SHAPE_FACTOR, "Lee, Yovanovich, Jafarpur, J. Thermophysics 5 (1991) 208"),
        ),
    )
}


def correlation(name: str, orientation: str = "vertical", where: str = "") -> NusseltLaw:
    """Return a correlation by its name; for an empty name the usual one of an orientation ('vertical', 'up' or 'down').

    `where` is the place in the deck, for messages.

    Raises
    ------
    DeckError   When there is none of that name, its library is missing, or the orientation does not fit.
    """
    refuse_unknown([orientation], ORIENTATIONS, where, "the orientation '{}' is not one of {known}.", DeckError)
    row = CORRELATIONS.get(name or DEFAULTS[orientation]) or _ht_correlation(name, where)
    refuse_first(
        where,
        (
            "vertical_plate" in row.name and orientation != "vertical",
            f"'{row.name}' is for vertical plates, but the orientation is '{orientation}'. Change one of them.",
            "value.excludes-another",
        ),
        (
            row.facing and orientation == "vertical",
            f"'{row.name}' is for horizontal plates. Give orientation = 'up' or 'down', the direction that the surface faces.",
            "value.incomplete",
        ),
    )
    return row


def _ht_correlation(name: str, where: str) -> NusseltLaw:
    """Return the function `name` of the library `ht` as a correlation without limits; refuse one that is missing or not Nu(Pr, Gr)."""
    hint = nearest(name, CORRELATIONS)
    if not name.startswith("Nu_"):
        raise DeckError(
            f"unknown correlation '{name}'.{hint} There are {', '.join(CORRELATIONS)}, and the functions of the library ht.",
            where,
            code="name.unknown",
        )
    try:
        from ht import conv_free_immersed as library
    except ImportError:
        raise DeckError(
            f"{missing(['ht'], f'the correlation {name!r}')}. Without it there are {', '.join(CORRELATIONS)}.",
            where,
            code="extra.not-installed",
        ) from None
    function: Any = getattr(library, name, None)
    if function is None:
        library_names = [n for n in library.__all__ if n.startswith("Nu_")]
        raise DeckError(
            f"the library ht has no '{name}' for free convection.{nearest(name, [*CORRELATIONS, *library_names])}",
            where,
            code="name.unknown",
        )
    from inspect import signature

    arguments = signature(function).parameters
    names = [n for n, p in arguments.items() if p.default is p.empty and n != "buoyancy"]
    if names != ["Pr", "Gr"] or name.endswith("_methods"):
        raise DeckError(
            f"'{name}' takes {', '.join(names)}; only functions of Pr and Gr are supported.", where, code="model.element-not-supported"
        )
    facing = "buoyancy" in arguments and arguments["buoyancy"].default is not None  # None: of a vertical plate, which has it for its form

    def nusselt(ra: float, pr: float, away: bool) -> float:
        """Return the Nusselt number of the correlation at a Rayleigh and a Prandtl number."""
        return float(function(pr, ra / pr, buoyancy=away) if facing else function(pr, ra / pr))

    return NusseltLaw(name, nusselt, 0.0, math.inf, facing, 0.0, f"ht.{name}")


def forced_plate_nusselt(reynolds: Number, prandtl: Number) -> Number:
    """Mean Nusselt number of a plate in a stream along it, on its length [-].

    0.664 Re^(1/2) Pr^(1/3) up to Re = 5e5, laminar; (0.037 Re^0.8 - 871) Pr^(1/3) above, where it turns turbulent.

    Parameters
    ----------
    reynolds : float    On the length of the plate, up to 1e8. [-]
    prandtl : float     [-]

    References
    ----------
    Incropera, 6th ed., Eqs. 7.30 and 7.38.

    Examples
    --------
    >>> round(forced_plate_nusselt(1e4, 0.71), 1), round(forced_plate_nusselt(1e6, 0.71))
    (59.2, 1306)
    """
    if reynolds <= 5e5:
        return 0.664 * reynolds**0.5 * prandtl ** (1.0 / 3.0)
    return (0.037 * reynolds**0.8 - 871.0) * prandtl ** (1.0 / 3.0)


@lru_cache(maxsize=256)
def nusselt_table(name: str, orientation: str, prandtl: float, forced: float = 0.0, where: str = "") -> tuple[Array, Array, float]:
    """Return x, y and Nu_rest: the table y(x) of Nu - Nu_rest over x = sign(dT) Ra^(1/4), and Nu_rest of gas at rest [-].

    x > 0 is a surface warmer than its gas. For each sign Nu^3 = N^3 + forced^3, N^8 = max(Nu_law(Ra), s)^8 + Nu_rest^8 - s^8, where s is
    what the law gives at rest and Nu_rest the largest of s and the law's least value: conduction and convection are joined smoothly.

    Parameters
    ----------
    name, orientation : str     As in `correlation`.
    prandtl : float             [-]
    forced : float              Nusselt number of a stream. [-]

    References
    ----------
    Churchill, AIChE J. 23 (1977) 10, for the third power of assisting streams; Incropera, 6th ed., Eq. 9.64.
    """
    law = correlation(name, orientation, where)
    root = np.geomspace(0.05, 3000.0, 280)
    sides = []
    least = max(law.still, law.nusselt(RAYLEIGH_AT_REST, prandtl, True), law.nusselt(RAYLEIGH_AT_REST, prandtl, False))
    for warm in (False, True):
        away = warm if orientation != "down" else not warm
        still = law.nusselt(RAYLEIGH_AT_REST, prandtl, away)
        bare = np.array([law.nusselt(float(u) ** 4, prandtl, away) for u in root])
        joined = (np.maximum(bare, still) ** BLEND + least**BLEND - still**BLEND) ** (1.0 / BLEND)
        sides.append((joined**3 + forced**3) ** (1.0 / 3.0) - least)
    middle = (least**3 + forced**3) ** (1.0 / 3.0) - least
    x = np.concatenate((-root[::-1], [0.0], root))
    return x, np.concatenate((sides[0][::-1], [middle], sides[1])), least


WIDE_GAP_ASPECT: Final = 12.0
"""Height over thickness from which a gap is wide: Hollands' and ElSherbiny's measurements. [-]"""
CRITICAL_ANGLES: Final = ((1.0, 25.0), (3.0, 53.0), (6.0, 60.0), (12.0, 67.0))
"""Height over thickness of a gap, and the tilt between both of Catton's forms. [-, deg]"""
SCATTER: Final = {True: 0.05, False: 0.10}
"""Largest deviation of measurements from the correlation of a gap, wide or not, as a share of Nu - 1. [-]"""


@dataclass(frozen=True)
class GapLaw:
    """Free convection in a closed gap between two plates, one warmer than the other.

    Parameters
    ----------
    tilt : float    Of the gap from lying flat, the first plate below: 0, the first plate below; 90, upright; 180, above. [deg]
    aspect : float  Height (the side along which it is tilted) over thickness. [-]
    """

    tilt: float
    aspect: float

    @property
    def name(self) -> str:
        """Authors of the correlation that holds for its aspect."""
        return "Hollands, ElSherbiny, Raithby" if self.aspect >= WIDE_GAP_ASPECT else "Hollands, Catton"

    @property
    def high(self) -> float:
        """Largest Rayleigh number for which the correlation holds. [-]"""
        return 1e8 if self.tilt in (0.0, 180.0) else 2e7 if self.aspect >= WIDE_GAP_ASPECT or self.tilt == 90.0 else 1e7

    @property
    def scatter(self) -> float:
        """Largest deviation of measurements from the correlation, as a share of Nu - 1. [-]"""
        return SCATTER[self.aspect >= WIDE_GAP_ASPECT]

    def nusselt(self, rayleigh: float, prandtl: float, first_warm: bool = True) -> float:
        """Return `gap_nusselt` on the thickness; with the second plate warmer (`first_warm` False) the tilt counts as 180 - tilt."""
        return gap_nusselt(rayleigh, self.tilt if first_warm else 180.0 - self.tilt, self.aspect, prandtl)


def gap_nusselt(rayleigh: float, tilt: float, aspect: float, prandtl: float = 0.71) -> float:
    """Nusselt number of free convection in a closed gap between plates, on its thickness; 1 for gas at rest [-].

    Parameters
    ----------
    rayleigh : float    On the thickness and the difference of the plates. [-]
    tilt : float        0 with the warm plate below, 90 upright, 180 with the warm plate above. [deg]
    aspect : float      Height over thickness. [-]
    prandtl : float     [-]

    References
    ----------
    Wide gaps up to 60 degrees: Hollands, Unny, Raithby, Konicek, J. Heat Transfer 98 (1976) 189; upright: ElSherbiny, Raithby, Hollands,
    J. Heat Transfer 104 (1982) 96; between both on a straight line. Others: Catton, 6th Int. Heat Transfer Conf. 6 (1978) 13. Warm above:
    Arnold, Catton, Edwards, J. Heat Transfer 98 (1976) 67. Incropera, 6th ed., Eqs. 9.49 to 9.54.

    Examples
    --------
    Flat and heated from below, at 1e5; upright, 40 times as high as thick; heated from above:

    >>> [round(gap_nusselt(1e5, tilt, 40.0), 3) for tilt in (0.0, 90.0, 180.0)]
    [3.994, 3.002, 1.0]
    """
    if rayleigh <= 0.0 or tilt >= 180.0:
        return 1.0
    if tilt > 90.0:
        return 1.0 + (gap_nusselt(rayleigh, 90.0, aspect, prandtl) - 1.0) * math.sin(math.radians(tilt))
    upright = _upright_gap(rayleigh, aspect, prandtl)
    if aspect >= WIDE_GAP_ASPECT:
        if tilt <= 60.0:
            return _lying_gap(rayleigh, tilt)
        return ((90.0 - tilt) * _lying_gap(rayleigh, 60.0) + (tilt - 60.0) * upright) / 30.0
    sides, angles = np.array(CRITICAL_ANGLES).T
    change = math.radians(float(np.interp(aspect, sides, angles)))
    angle = math.radians(tilt)
    if angle > change:
        return float(max(1.0, upright * math.sin(angle) ** 0.25))
    flat, share = _lying_gap(rayleigh, 0.0), angle / change
    return float(max(1.0, flat * (upright / flat) ** share * math.sin(change) ** (share / 4.0)))


def _lying_gap(rayleigh: float, tilt: float) -> float:
    """Hollands' law of a wide gap at a tilt p up to 60 degrees, with R = Ra cos p and (x)+ = max(x, 0) [-].

    Nu = 1 + 1.44 (1 - 1708 / R)+ (1 - 1708 sin(1.8 p)^1.6 / R)+ + ((R / 5830)^(1/3) - 1)+.
    """
    tall = rayleigh * math.cos(math.radians(tilt))
    cell = max(0.0, 1.0 - 1708.0 / tall)
    turned = 1.0 - 1708.0 * math.sin(1.8 * math.radians(tilt)) ** 1.6 / tall
    return float(1.0 + 1.44 * cell * max(0.0, turned) + max(0.0, (tall / 5830.0) ** (1.0 / 3.0) - 1.0))


def _upright_gap(rayleigh: float, aspect: float, prandtl: float) -> float:
    """Nusselt number of an upright gap: ElSherbiny's law of a wide one, Catton's of one with an aspect A below 12 [-].

    Wide: the largest of 0.0605 Ra^(1/3), (1 + (0.104 Ra^0.293 / (1 + (6310 / Ra)^1.36))^3)^(1/3) and 0.242 (Ra / A)^0.272. Others, with
    D = Ra Pr / (0.2 + Pr): 0.18 D^0.29 below A = 2, else 0.22 D^0.28 A^(-1/4). Never below 1.
    """
    if aspect >= WIDE_GAP_ASPECT:
        turning = (1.0 + (0.104 * rayleigh**0.293 / (1.0 + (6310.0 / rayleigh) ** 1.36)) ** 3) ** (1.0 / 3.0)
        return float(max(0.0605 * rayleigh ** (1.0 / 3.0), turning, 0.242 * (rayleigh / aspect) ** 0.272, 1.0))
    driven = prandtl / (0.2 + prandtl) * rayleigh
    return float(max(1.0, 0.18 * driven**0.29 if aspect < 2.0 else 0.22 * driven**0.28 * aspect**-0.25))


@lru_cache(maxsize=256)
def gap_nusselt_table(tilt: float, aspect: float, prandtl: float) -> tuple[Array, Array]:
    """Return the table of Nu - 1 of a closed gap: x = sign(T_first - T_second) Ra^(1/4) (points,), and values (points,) at it. [-]

    `tilt` [deg] and `aspect` [-] as in `GapLaw`, which has the formulas; `prandtl` [-] of the gas; Ra on the thickness.
    """
    law = GapLaw(tilt, aspect)
    root = np.unique(np.concatenate((np.geomspace(0.05, 2.0, 12), np.geomspace(2.0, 120.0, 500), np.geomspace(120.0, 3000.0, 60))))
    warm, cold = ([law.nusselt(float(u) ** 4, prandtl, side) - 1.0 for u in root] for side in (True, False))
    return np.concatenate((-root[::-1], [0.0], root)), np.concatenate((cold[::-1], [0.0], warm))
