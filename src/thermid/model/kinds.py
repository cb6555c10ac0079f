"""The kinds of conductor: each one a recipe from the parameters of a deck to rows of the kernel's law table.

To add a kind: write one recipe below, add one line to KINDS, one test, and one line to docs/nomenclature.md. CONTRIBUTING.md shows it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from thermid.dual import Number, value_of
from thermid.errors import DeckError
from thermid.model.curves import Curve, evaluate
from thermid.physics import conduction, contact, convection, radiation

__all__ = ["KINDS", "Kind", "Law", "law_conductance"]

SMOOTHING: Final = 0.01
"""Temperature difference below which a power law is smoothed, so that its derivative stays finite at zero. [K]"""


@dataclass(frozen=True, eq=False)
class Law:
    """One row of the kernel's law table.

    Parameters
    ----------
    form : str                      linear, power, radiation, flow, or table.
    coefficients : tuple of Number  What the form needs, the conductance-like one first.
    medium : str                    'solid', 'radiation' or 'gas' (falls with pressure) or 'mixed' (an effective value, gas and radiation).
    curve : Curve or None           For tables.
    """

    form: str
    coefficients: tuple[Number, ...]
    medium: str = "solid"
    curve: Curve | None = None


Fields = Mapping[str, Number]


@dataclass(frozen=True)
class Kind:
    """A kind of conductor.

    Parameters
    ----------
    recipe : callable           Field values (float or Dual, SI) -> Law.
    alternatives : tuple        Sets of fields, one of which must be given in full.
    slots : dict                Field -> unit text of its slot.
    needs_curve : bool          Whether a table must be given.
    """

    recipe: Callable[[Fields], Law]
    alternatives: tuple[frozenset[str], ...]
    slots: Mapping[str, str]
    needs_curve: bool = False


def _from_resistance(resistance: Number) -> Number:
    """Return 1/R; infinite resistance is no conductance, zero resistance is refused."""
    if value_of(resistance) == 0.0:
        raise DeckError("a zero resistance would make two nodes one. Merge them, or give a small resistance above zero.")
    return 1.0 / resistance


def _conduction(f: Fields) -> Law:
    if "resistance" in f:
        return Law("linear", (_from_resistance(f["resistance"]),))
    if "conductance" in f:
        return Law("linear", (f["conductance"],))
    if value_of(f["thickness"]) == 0.0:
        raise DeckError(
            "a zero thickness is a zero resistance, which would make two nodes one. Merge them, or give a thickness above zero."
        )
    return Law("linear", (conduction.slab_conductance(f["conductivity"], f["area"], f["thickness"]),))


def _contact(f: Fields) -> Law:
    return Law("linear", (contact.joint_conductance(f["contact_conductance"], f["area"]),))


def _convection(f: Fields) -> Law:
    if "htc" in f:
        return Law("linear", (convection.convection_conductance(f["htc"], f["area"]),), "gas")
    return Law("power", (convection.convection_conductance(f["htc.coefficient"], f["area"]), f["htc.exponent"]), "gas")


def _effective(f: Fields) -> Law:
    return Law("linear", (convection.convection_conductance(f["effective_htc"], f["area"]),), "mixed")


def _radiation(f: Fields) -> Law:
    factor = f["exchange_factor"] if "exchange_factor" in f else f["emissivity"]
    return Law("radiation", (radiation.radiation_coefficient(factor, f["area"]),), "radiation")


def _flow(f: Fields) -> Law:
    return Law("flow", (f["mass_flow"] * f["specific_heat"],))


def _table(f: Fields) -> Law:
    return Law("table", (f.get("scale", 1.0),))


_AREA = {"area": "m^2"}
_ALL = frozenset

KINDS: Final[Mapping[str, Kind]] = {
    "conduction": Kind(
        _conduction,
        (_ALL({"conductivity", "area", "thickness"}), _ALL({"conductance"}), _ALL({"resistance"})),
        {"conductivity": "W/(m K)", **_AREA, "thickness": "m", "conductance": "W/K", "resistance": "K/W"},
    ),
    "contact": Kind(_contact, (_ALL({"contact_conductance", "area"}),), {"contact_conductance": "W/(m^2 K)", **_AREA}),
    "convection": Kind(
        _convection,
        (_ALL({"htc", "area"}), _ALL({"htc.coefficient", "htc.exponent", "area"})),
        {"htc": "W/(m^2 K)", "htc.coefficient": "W/(m^2 K)", "htc.exponent": "1", **_AREA},
    ),
    "effective": Kind(_effective, (_ALL({"effective_htc", "area"}),), {"effective_htc": "W/(m^2 K)", **_AREA}),
    "radiation": Kind(
        _radiation, (_ALL({"emissivity", "area"}), _ALL({"exchange_factor", "area"})), {"emissivity": "1", "exchange_factor": "1", **_AREA}
    ),
    "flow": Kind(_flow, (_ALL({"mass_flow", "specific_heat"}),), {"mass_flow": "kg/s", "specific_heat": "J/(kg K)"}),
    "table": Kind(_table, (_ALL({"scale"}), _ALL()), {"scale": "1"}, needs_curve=True),
}


def law_conductance(
    form: str, c: Sequence[Any], curve: Curve | None, hot: NDArray[np.float64], cold: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the conductance of a law at given end temperatures; heat flow is always ``G (T_a - T_b)``. [W/K]

    Parameters
    ----------
    form : str                  As in `Law`.
    c : sequence                Its coefficients, floats or arrays (times,).
    curve : Curve or None       For tables.
    hot, cold : array (times,)  Temperatures of the ends a and b. [K]
    """
    difference = hot - cold
    if form == "power":
        return np.asarray(c[0] * (difference**2 + SMOOTHING**2) ** (0.5 * c[1]))
    if form == "radiation":
        return np.asarray(c[0] * (hot**2 + cold**2) * (hot + cold))
    if form == "table" and curve is not None:
        return np.asarray(c[0] * evaluate(curve, difference if curve.over == "difference" else 0.5 * (hot + cold)))
    return np.broadcast_to(np.asarray(c[0], dtype=float), np.shape(hot))
