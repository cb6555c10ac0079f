"""The kinds of conductor: each one a recipe from the parameters of a deck to rows of the kernel's law table.

To add a kind: write one recipe below, add one line to KINDS, one test, and one line to docs/nomenclature.md. docs/recipes.md shows it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from typing import Any, Final

import numpy as np

from thermid.base.errors import DeckError
from thermid.base.linear_algebra import Number, value_of
from thermid.base.units import TEMPERATURE
from thermid.physics import conduction, contact, convection, radiation
from thermid.physics.constants import AMBIENT_DEFAULT, STEFAN_BOLTZMANN

ACCOMMODATION: Final = 0.9
"""Thermal accommodation of air and heavier gases at surfaces of equipment, where none is given: Springer, Advances in Heat Transfer 7
(1971) 163, has 0.87 to 0.97. Helium and hydrogen need their own, 0.3 to 0.5. [-]"""
HINGES: Final = {"temperature": "hinge", "difference": "hinge of difference"}
"""Form of a hinge by what it is over."""


@dataclass(frozen=True, eq=False)
class Law:
    """One row of the kernel's law table.

    Parameters
    ----------
    form : str                      A row of `CONDUCTORS` of the network: linear, power, radiation, flow, table, gas (at rest,
                                    rarefied), natural (convection by tables), potential (conduction by the integral of a
                                    conductivity), hinge (part of a table that moves), and whatever the kernel has besides.
    coefficients : tuple of Number  What the form needs, the conductance-like one first.
    medium : str                    'solid', 'radiation' or 'gas' (falls with pressure) or 'mixed' (an effective value, gas and radiation);
                                    'rest' (gas in a gap), 'correlation' and 'duct' are written out where the gas is known; 'fin' has
                                    conductances in air, bare, and with radiation alone where that is known; 'left' is the radiation that
                                    an effective coefficient holds and that is on its own only where its gas is gone.
    points : tuple                  Of a table that follows values: temperature [K] and conductance [W/K] of each point, joined by straight
                                    lines, constant beyond both ends. A table that an author gives stands in the deck.
    over : str                      What such a table is over: 'temperature', the mean of both ends, or 'difference'.
    """

    form: str
    coefficients: tuple[Number, ...]
    medium: str = "solid"
    points: tuple[tuple[Number, Number], ...] = ()
    over: str = "temperature"

    def scaled(self, factor: Number) -> Law:
        """Return the law with its first coefficient, the conductance-like one, multiplied by `factor`."""
        return replace(self, coefficients=(factor * self.coefficients[0], *self.coefficients[1:]))

    def pieces(self) -> tuple[Law, ...]:
        """Return laws of the kernel whose heat flows add up to this one: itself, or of a table with `points` a constant and hinges.

        A table of straight lines through (x, y) is ``y_0 + sum_k (s_k - s_(k-1)) (u - x_k)+`` with the slopes s between its points and none
        beyond: a constant and one hinge for each point, all of whose numbers may move, with their derivatives.

        Raises
        ------
        DeckError   When temperatures do not increase, a conductance is negative, or the table is in a gas.
        """
        if not self.points:
            return (self,)
        x, y = zip(*self.points, strict=True)
        if self.form != "table" or self.over not in HINGES or self.medium != "solid":
            raise DeckError(
                f"a table of points applies to a solid over {' or '.join(HINGES)}; this law is '{self.form}' over {self.over}.",
                code="model.law-refused",
            )
        if any(not value_of(b) > value_of(a) for a, b in pairwise(x)):
            shown = ", ".join(f"{value_of(coefficient):.6g}" for coefficient in x)
            raise DeckError(f"a table needs increasing temperatures; its points lie at {shown} K.", code="model.law-refused")
        if any(value_of(coefficient) < 0.0 for coefficient in y):
            raise DeckError(
                "the table has a negative conductance; heat would flow from cold to hot. Correct the table.",
                code="model.negative-conductance",
            )
        scale = self.coefficients[0]
        lines = [0.0, *((d - c) / (b - a) for (a, c), (b, d) in pairwise(self.points)), 0.0]
        hinges = [Law(HINGES[self.over], (scale * (after - before), at)) for (before, after), at in zip(pairwise(lines), x, strict=True)]
        return Law("linear", (scale * y[0],)), *hinges


Fields = Mapping[str, Number]


CARRIED_BY = "carried_by"
"""Word of an element: what carries the heat behind its constant coefficient."""


@dataclass(frozen=True)
class Kind:
    """A kind of conductor.

    Parameters
    ----------
    recipe : callable           Field values (float or Dual, SI) -> Law, or the laws that act side by side.
    alternatives : tuple        Sets of fields, one of which must be given in full.
    slots : dict                Field -> unit text of its slot.
    needs_curve : bool          Whether a table must be given.
    optional : frozenset        Fields that may be given beside an alternative.
    words : frozenset           Fields that are names and no numbers.
    loss : callable or None     Recipe of what each end loses to the node named by ``to``.
    tabulated : str             Field that may be a table over temperature.
    """

    recipe: Callable[[Fields], Law | tuple[Law, ...]]
    alternatives: tuple[frozenset[str], ...]
    slots: Mapping[str, str]
    needs_curve: bool = False
    optional: frozenset[str] = frozenset()
    words: frozenset[str] = frozenset()
    loss: Callable[[Fields], Law] | None = None
    tabulated: str = ""


def _conduction(f: Fields) -> Law:
    """Return a conductance, given, as 1 / resistance or as k A / thickness [W/K]; of a table k(T), A / thickness [m]."""
    if "resistance" in f:
        return Law("linear", (1.0 / f["resistance"],))
    if "conductance" in f:
        return Law("linear", (f["conductance"],))
    if "conductivity" not in f:  # a table over temperature, integrated: the area over the length is left
        return Law("potential", (f["area"] / f["thickness"],))
    return Law("linear", (conduction.slab_conductance(f["conductivity"], f["area"], f["thickness"]),))


def _contact(f: Fields) -> tuple[Law, ...]:
    """Return solid contact, gas in the gap and facing radiation, as far as they are given."""
    if "contact_pressure" in f:
        solid = contact.plastic_contact_conductance(f["conductivity"], f["slope"], f["roughness"], f["contact_pressure"], f["hardness"])
    else:
        solid = f["contact_conductance"]
    out = [Law("linear", (contact.joint_conductance(solid, f["area"]),))]
    if "gap" in f:
        out.append(_gas(f))
    if "exchange_factor" in f:
        out.append(Law("radiation", (radiation.radiation_coefficient(f["exchange_factor"], f["area"]),), "radiation"))
    return tuple(out)


def _gas(f: Fields) -> Law:
    """Return gas at rest in a gap: area [m^2], gap [m], accommodation [-] and factor on convection [-], for the medium to fill in."""
    return Law("gas", (f["area"], f["gap"], f.get("accommodation", ACCOMMODATION), f.get("convection_factor", 1.0)), "rest")


def _convection(f: Fields) -> Law:
    """Return htc A [W/K], or (coefficient A) |dT|^exponent, or area and length for a correlation."""
    if "htc.length" in f:
        return Law("natural", (f["area"], f["htc.length"]), "correlation")
    if "htc" in f:
        return Law("linear", (f["htc"] * f["area"],), "gas")
    return Law("power", (f["htc.coefficient"] * f["area"], f["htc.exponent"]), "gas")


def _radiation(f: Fields) -> Law:
    """Return sigma F A [W/K^4] with the exchange factor F, or with the emissivity in its place."""
    factor = f["exchange_factor"] if "exchange_factor" in f else f["emissivity"]
    return Law("radiation", (radiation.radiation_coefficient(factor, f["area"]),), "radiation")


def _flow(f: Fields) -> Law:
    """Return flow * density * specific_heat [W/K], one in place of what is not given: a gas named by word adds its own later."""
    flow = f["mass_flow"] if "mass_flow" in f else f["volume_flow"]
    return Law("flow", (flow * f.get("density", 1.0) * f.get("specific_heat", 1.0),))


def _duct(f: Fields) -> Law:
    """Return the numbers of ducts side by side, of given diameter or width and height, see `_in_duct`; Nu is 3.66 in a round one."""
    count = f.get("count", 1.0)
    if "diameter" in f:
        diameter, section, wet = f["diameter"], 0.25 * math.pi * f["diameter"] ** 2, math.pi * f["diameter"] * f["length"]
        return _in_duct(f, count * wet, 0.0, 0.0, diameter, count * section, 3.66)
    width, height = f["width"], f["height"]
    wet = 2.0 * (width + height) * f["length"]
    return _in_duct(f, count * wet, 0.0, 0.0, 2.0 * width * height / (width + height), count * width * height, _rectangle(width, height))


def _heat_sink(f: Fields) -> Law:
    """Return the numbers of `_in_duct` for a heat sink with a shroud: `count` channels width x height between fins."""
    width, height, count = f["width"], f["height"], f["count"]
    base, fins = count * width * f["length"], 2.0 * count * height * f["length"]
    slope = height * (2.0 / (f["fin_conductivity"] * f["fin_thickness"])) ** 0.5  # times the root of h: m L of a fin
    section = count * width * height
    return _in_duct(f, base, fins, slope, 2.0 * width * height / (width + height), section, _rectangle(width, height))


def _rectangle(width: Any, height: Any) -> Number:
    """Return the Nusselt number of developed laminar flow in a rectangular channel, by its aspect ratio. [-]"""
    nusselt: Number = convection.rectangle_nusselt(np.minimum(width, height) / np.maximum(width, height))
    return nusselt


def _in_duct(f: Fields, base: Number, fins: Number, slope: Number, diameter: Number, section: Number, developed: Number) -> Law:
    """Return the row from which the medium, which knows its gas, makes the conductance between a stream and its walls.

    Wetted area [m^2] of `base` and `fins`, slope = m L / sqrt(h) of a fin, hydraulic diameter [m], length [m], flow over `section`
    [kg/(s m^2), or m/s where the last number is 1], and the Nusselt number of developed laminar flow [-].
    """
    flow, by_volume = (f["mass_flow"], 0.0) if "mass_flow" in f else (f["volume_flow"], 1.0)
    return Law("linear", (base, fins, slope, diameter, f["length"], flow / section, developed, by_volume), "duct")


def _fin(f: Fields, which: int) -> Law:
    """Return one conductance of a lead as a fin, from end to end (`which` = 0) or from an end outwards (1). [W/K]

    Three numbers: in air, bare, and with radiation alone where the emissivity is known, 4 sigma emissivity T^3 at 20 degC.
    """
    section = 0.25 * math.pi * f["diameter"] ** 2 if "diameter" in f else f["cross_section"]
    round_ = math.pi * f["diameter"] if "diameter" in f else 2.0 * (math.pi * section) ** 0.5
    shine = 4.0 * STEFAN_BOLTZMANN * AMBIENT_DEFAULT**3 * f["emissivity"] if "emissivity" in f else 0.0

    def port(htc: Number) -> Number:
        """Return the conductance of all fins at a coefficient. [W/K]"""
        conductances = conduction.fin_conductances(htc, f.get("perimeter", round_), f["conductivity"], section, f["length"])
        out: Number = f.get("count", 1.0) * conductances[which]
        return out

    bare = port(0.0)
    if "effective_htc" in f:
        return Law("linear", (port(f["effective_htc"]), bare, *((port(shine),) if "emissivity" in f else ())), "fin")
    return Law("linear", (port(f.get("htc", 0.0) + shine), bare, port(shine)), "fin")


def _table(f: Fields) -> Law:
    """Return the factor on a deck's table, `scale` or one. [-]"""
    return Law("table", (f.get("scale", 1.0),))


def _heat_pipe(f: Fields) -> Law:
    """Return a conductance that rises on a line from off to on over `transition` [K], half-way at `start_temperature`, the ends' mean."""
    first = f["start_temperature"] - 0.5 * f["transition"]
    return Law("table", (1.0,), points=((first, f["off_conductance"]), (first + f["transition"], f["on_conductance"])))


def _bolted(f: Fields) -> tuple[Law, ...]:
    """Return screws, count * conductance_each or plastic contact under their preload [W/K], and a filler k (A - zone) / t beside them."""
    if "conductance_each" in f:
        zone: Number = 0.0
        screws = f["count"] * f["conductance_each"]
    else:
        zone = f["count"] * contact.bolt_zone(f["washer"], f["diameter"], f["thickness"])
        if value_of(zone) <= 0.0:
            raise DeckError("a washer must be wider than the screw's hole.", code="value.outside-range")
        force = contact.bolt_preload(*(f[name] for name in ("torque", "diameter", "nut_factor") if name in f))
        pressure = f["count"] * force / zone
        screws = zone * contact.plastic_contact_conductance(f["conductivity"], f["slope"], f["roughness"], pressure, f["hardness"])
    filler = {"area", "filler_conductivity", "filler_thickness"} & set(f)
    if not filler:
        return (Law("linear", (screws,)),)
    if len(filler) < 3:
        raise DeckError("a filler needs area (of the whole joint), filler_conductivity and filler_thickness.", code="value.incomplete")
    rest = f["area"] - zone
    if value_of(rest) < 0.0:
        raise DeckError(
            "the contact area under the screws is larger than the joint. Give a larger area, or smaller washers.", code="value.contradicts"
        )
    return Law("linear", (screws,)), Law("linear", (conduction.slab_conductance(f["filler_conductivity"], rest, f["filler_thickness"]),))


def _wedge_lock(f: Fields) -> tuple[Law, ...]:
    """Return count * length / resistance_length [W/K]; with a figure in vacuum that as solid and the difference as carried by gas."""
    edges = f["count"] * f["length"]
    whole = edges / f["resistance_length"]
    if "vacuum_resistance_length" not in f:
        return (Law("linear", (whole,)),)
    solid = edges / f["vacuum_resistance_length"]
    if value_of(solid) > value_of(whole):
        raise DeckError(
            "the resistance in vacuum is below that in air. Give a vacuum_resistance_length at or above resistance_length.",
            code="value.contradicts",
        )
    return Law("linear", (solid,)), Law("linear", (whole - solid,), "gas")


def _spreading(f: Fields) -> Law:
    """Return 1 / (R_spread + t / (k A_plate)) [W/K], from the mean of a small source to the far side of its plate."""
    if not value_of(f["source_area"]) < value_of(f["plate_area"]):
        raise DeckError(
            'the source must be smaller than its plate. If it covers the plate, use kind = "conduction".', code="value.outside-range"
        )
    spread = conduction.spreading_resistance(f["conductivity"], f["source_area"], f["plate_area"], f["thickness"], f.get("htc"))
    return Law("linear", (1.0 / (spread + f["thickness"] / (f["conductivity"] * f["plate_area"])),))


_AREA = {"area": "m^2"}
_ALL = frozenset
_SINK = {"width": "m", "height": "m", "length": "m", "count": "1", "fin_thickness": "m", "fin_conductivity": "W/(m K)"}

KINDS: Final[Mapping[str, Kind]] = {
    "conduction": Kind(
        _conduction,
        (_ALL({"conductivity", "area", "thickness"}), _ALL({"conductance"}), _ALL({"resistance"})),
        {"conductivity": "W/(m K)", **_AREA, "thickness": "m", "conductance": "W/K", "resistance": "K/W"},
        tabulated="conductivity",
    ),
    "contact": Kind(
        _contact,
        (_ALL({"contact_conductance", "area"}), _ALL({"contact_pressure", "hardness", "roughness", "slope", "conductivity", "area"})),
        {"contact_conductance": "W/(m^2 K)", "contact_pressure": "Pa", "hardness": "Pa", "roughness": "m", "slope": "1"}
        | {"conductivity": "W/(m K)", **_AREA, "gap": "m", "accommodation": "1", "exchange_factor": "1"},
        optional=_ALL({"gap", "accommodation", "exchange_factor"}),
        words=_ALL({"gas"}),
    ),
    "convection": Kind(
        _convection,
        (_ALL({"htc", "area"}), _ALL({"htc.coefficient", "htc.exponent", "area"}), _ALL({"htc.length", "area"})),
        {"htc": "W/(m^2 K)", "htc.coefficient": "W/(m^2 K)", "htc.exponent": "1", "htc.length": "m", **_AREA},
        words=_ALL({"htc.correlation", "htc.orientation", CARRIED_BY}),
    ),
    "gas": Kind(
        _gas,
        (_ALL({"area", "gap"}),),
        {**_AREA, "gap": "m", "accommodation": "1", "convection_factor": "1"},
        optional=_ALL({"accommodation", "convection_factor"}),
        words=_ALL({"gas", "tilt", "aspect"}),
    ),
    "effective": Kind(
        lambda f: Law("linear", (f["effective_htc"] * f["area"],), "mixed"),  # convection and radiation together
        (_ALL({"effective_htc", "area"}),),
        {"effective_htc": "W/(m^2 K)", **_AREA},
        words=_ALL({CARRIED_BY}),
    ),
    "radiation": Kind(
        _radiation, (_ALL({"emissivity", "area"}), _ALL({"exchange_factor", "area"})), {"emissivity": "1", "exchange_factor": "1", **_AREA}
    ),
    "flow": Kind(
        _flow,
        (_ALL({"mass_flow"}), _ALL({"volume_flow"})),
        {"mass_flow": "kg/s", "specific_heat": "J/(kg K)", "volume_flow": "m^3/s", "density": "kg/m^3"},
        optional=_ALL({"density", "specific_heat"}),
        words=_ALL({"fluid"}),
    ),
    "duct": Kind(
        _duct,
        tuple(_ALL({*shape, "length", flow}) for shape in (("diameter",), ("width", "height")) for flow in ("mass_flow", "volume_flow")),
        {"diameter": "m", "width": "m", "height": "m", "length": "m", "mass_flow": "kg/s", "volume_flow": "m^3/s", "count": "1"},
        optional=_ALL({"count"}),
    ),
    "heat_sink": Kind(
        _heat_sink,
        tuple(_ALL({*_SINK, flow}) for flow in ("mass_flow", "volume_flow")),
        _SINK | {"mass_flow": "kg/s", "volume_flow": "m^3/s"},
    ),
    "lead": Kind(
        partial(_fin, which=0),
        (_ALL({"conductivity", "length", "diameter"}), _ALL({"conductivity", "length", "cross_section"})),
        {"conductivity": "W/(m K)", "length": "m", "diameter": "m", "cross_section": "m^2", "perimeter": "m", "count": "1"}
        | {"htc": "W/(m^2 K)", "effective_htc": "W/(m^2 K)", "emissivity": "1"},
        optional=_ALL({"perimeter", "count", "htc", "effective_htc", "emissivity"}),
        words=_ALL({"to"}),
        loss=partial(_fin, which=1),
    ),
    "heat_pipe": Kind(
        _heat_pipe,
        (_ALL({"on_conductance", "off_conductance", "start_temperature", "transition"}),),
        {"on_conductance": "W/K", "off_conductance": "W/K", "start_temperature": TEMPERATURE, "transition": "K"},
    ),
    "bolted": Kind(
        _bolted,
        (
            _ALL({"count", "conductance_each"}),
            _ALL({"count", "torque", "diameter", "washer", "thickness", "hardness", "roughness", "slope", "conductivity"}),
        ),
        {"count": "1", "conductance_each": "W/K", "torque": "J", "diameter": "m", "washer": "m", "thickness": "m", "hardness": "Pa"}
        | {"roughness": "m", "slope": "1", "conductivity": "W/(m K)", "nut_factor": "1", **_AREA}
        | {"filler_conductivity": "W/(m K)", "filler_thickness": "m"},
        optional=_ALL({"nut_factor", "area", "filler_conductivity", "filler_thickness"}),
    ),
    "wedge_lock": Kind(
        _wedge_lock,
        (_ALL({"count", "length", "resistance_length"}),),
        {"count": "1", "length": "m", "resistance_length": "m K/W", "vacuum_resistance_length": "m K/W"},
        optional=_ALL({"vacuum_resistance_length"}),
    ),
    "spreading": Kind(
        _spreading,
        (_ALL({"conductivity", "source_area", "plate_area", "thickness"}),),
        {"conductivity": "W/(m K)", "source_area": "m^2", "plate_area": "m^2", "thickness": "m", "htc": "W/(m^2 K)"},
        optional=_ALL({"htc"}),
    ),
    "table": Kind(_table, (_ALL({"scale"}), _ALL()), {"scale": "1"}, needs_curve=True),
}
