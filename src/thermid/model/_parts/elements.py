"""What a model is made of: nodes, conductors, surfaces, joints, heat loads. Every value is a `Parameter` under its field's name.

The kinds of conductor: each one a recipe from the parameters of a deck to rows of the kernel's law table.

To add a kind: write one recipe below, add one line to KINDS, one test, and one line to docs/nomenclature.md. docs/recipes.md shows it.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import pairwise
from typing import Any, Final

import numpy as np

from thermid.base.errors import DeckError
from thermid.base.units import AMBIENT_DEFAULT, STANDARD_GRAVITY, STEFAN_BOLTZMANN, TEMPERATURE, Number, value_of
from thermid.model._laws.signal import Signal, TableSignal, literal
from thermid.model._laws.stores import Curve, Supercooling
from thermid.model._parts.parameter import Parameter
from thermid.physics import conduction, contact, convection, radiation
from thermid.physics.correlations import GapLaw
from thermid.physics.finishes import finish

Fields = Mapping[str, Parameter]

NODE_SLOTS: Mapping[str, str] = {"mass": "kg", "specific_heat": "J/(kg K)", "capacitance": "J/K"}
LOAD_SLOTS: Mapping[str, str] = {
    "power": "W",
    "scale": "1",
    "command_curve": "1",
    "temperature_coefficient": "1/K",
    "quadratic_coefficient": "1/K^2",
    "exponential_coefficient": "1/K",
    "reference_temperature": "temperature",
    "periodic.period": "s",
    "periodic.duty": "1",
    "sine.amplitude": "W",
    "sine.period": "s",
    "thermostat.on_below": "temperature",
    "thermostat.off_above": "temperature",
    "proportional.gain": "W/K",
    "proportional.band": "K",
    "proportional.setpoint": "temperature",
}
CONTROLS = ("thermostat", "proportional")
"""What may control a load: let its power through, or a share of it, by the temperature of a sensor."""

_DEGREES = re.compile(r"\s*([+-]?\d+(?:\.\d*)?)\s*(?:\[\s*(?:deg|°)\s*\])?\s*\Z")
SUM_ROUNDING = 1e-12
"""Share of a surface's area by which joints may take more than it has. [-]"""


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


@dataclass(frozen=True)
class Node:
    """A thermal mass; without mass and capacitance it is arithmetic (massless).

    Parameters
    ----------
    fields : dict           mass [kg] and specific_heat [J/(kg K)], or capacitance [J/K], or nothing.
    reference_point : bool  Whether limits apply here.
    test_only : bool        Whether it exists on the bench only (a sensor, a lead).
    table : tuple           ('specific_heat' or 'enthalpy', Curve) over temperature beside a mass; None without.
    stands_for : str        air, walls, or air and walls; what its surroundings show where empty, see `Flat.gas_nodes`.
    supercooling : Supercooling or None     How far its melt cools before it freezes.
    """

    fields: Fields = field(default_factory=dict)
    reference_point: bool = False
    test_only: bool = False
    table: tuple[str, Curve] | None = None
    stands_for: str = ""
    supercooling: Supercooling | None = None


@dataclass(frozen=True)
class Conductor:
    """A path of heat between two nodes; positive from the first to the second.

    Parameters
    ----------
    kind : str              One of `kinds.KINDS`.
    between : (str, str)    Paths of the two nodes.
    fields : dict           What the kind needs.
    curve : Curve or None   For the kind `table`; of kind `conduction`, a conductivity over temperature.
    takes : tuple of str    Surfaces that its area is taken from, in the ledger.
    test_only : bool        Whether it exists on the bench only.
    words : dict            What the kind needs that is no number: a gas, a correlation.
    controls : tuple        Controls whose shares its heat flow is multiplied by; ``1 - name`` takes the rest of one.
    reversible : bool       Whether a stream may turn: a flow below zero goes from the second node to the first.
    """

    kind: str
    between: tuple[str, str]
    fields: Fields
    curve: Curve | None = None
    takes: tuple[str, ...] = ()
    test_only: bool = False
    words: Mapping[str, str] = field(default_factory=dict)
    controls: tuple[str, ...] = ()
    reversible: bool = False


@dataclass(frozen=True)
class Surface:
    """The outer surface of a node, declared once; joints take area from it and what is left exchanges with `to`.

    Parameters
    ----------
    of : str            The node it belongs to.
    to : str            The gas node or surroundings.
    fields : dict       area [m^2]; htc (or htc.coefficient and htc.exponent) or effective_htc; emissivity and absorptance [-].
    sees : str          What it radiates to; `to` when empty.
    finish : str        Finish that the emissivity comes from; empty where it is given itself.
    words : dict        Correlation and orientation, where the coefficient comes from one; what carries the heat behind a constant one.
    facing : Facing     Where it looks, for sun and sky; None where nobody said.
    controls : dict     htc or emissivity -> controls whose shares it is multiplied by; what an emissivity absorbs goes with it.
    """

    of: str
    to: str
    fields: Fields
    sees: str = ""
    test_only: bool = False
    finish: str = ""
    words: Mapping[str, str] = field(default_factory=dict)
    facing: Facing | None = None
    controls: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    @property
    def is_effective(self) -> bool:
        """Whether its coefficient holds convection and radiation together."""
        return "effective_htc" in self.fields


def finish_emissivity(name: str, where: str) -> Parameter:
    """Return the emissivity of a named finish as a parameter: its typical value with low and high as range. [-]"""
    surface = finish(name, where)
    table = {"value": surface.typical, "min": surface.low, "max": surface.high}
    return Parameter.read(table | {"source": "assumed", "basis": surface.basis}, where)


def gap_scatter(words: Mapping[str, str], where: str) -> Parameter:
    """Return the factor on the convection of a closed gap: one, with the scatter of its correlation as bounds."""
    law = GapLaw(degrees(words["tilt"], where), literal(words["aspect"], "1", where))
    table = {"value": 1, "min": 1.0 - law.scatter, "max": 1.0 + law.scatter, "source": "published"}
    return Parameter.read(table | {"basis": f"scatter of {law.name} about their correlation"}, where)


@dataclass(frozen=True)
class Joint:
    """Two surfaces pressed together: half-contacts that meet at a massless node, and a gap that loses heat from there.

    Parameters
    ----------
    between : (str, str)    Paths of two surfaces.
    fields : dict           area [m^2] and contact_conductance of each half [W/(m^2 K)], or conductivity and thickness of each half;
                            gap.area [m^2] of each face and gap.htc [W/(m^2 K)].
    mid : str               The name of the massless node; ``<joint>.mid`` when empty.
    gap_to : str            The node that the gap loses heat to; empty without a gap.
    """

    between: tuple[str, str]
    fields: Fields
    mid: str = ""
    gap_to: str = ""
    test_only: bool = False


@dataclass(frozen=True)
class Enclosure:
    """Surfaces that see one another and radiate to one another, with every reflection between them.

    Parameters
    ----------
    faces : dict                Name of a face -> path of its surface, which has an emissivity; it radiates here and nowhere else.
    shape : str                 One of `physics.view_factors.SHAPES`; empty where factors are given.
    dimensions : dict           Lengths of the shape. [m]
    view_factors : tuple        Rows (faces, faces) in the order of the faces; empty with a shape. [-]
    exchange_factors : tuple    Rows of script-F, reflections counted, in place of view factors; zero on the diagonal. [-]
    rest : str                  The node that takes what the view factors leave, as a black surface; empty where they sum to one.
    """

    faces: Mapping[str, str]
    shape: str = ""
    dimensions: Mapping[str, float] = field(default_factory=dict)
    view_factors: tuple[tuple[float, ...], ...] = ()
    exchange_factors: tuple[tuple[float, ...], ...] = ()
    rest: str = ""
    test_only: bool = False

    @property
    def fields(self) -> Fields:
        """No parameters of its own; its surfaces have them."""
        return {}


@dataclass(frozen=True)
class Cycle:
    """A factor on a load that repeats, over time from 0.

    Parameters
    ----------
    times : tuple of float      From 0; the last one is the period. [s]
    values : tuple of float     At these times; the last is the first again, unless they are steps. [-]
    hold : bool                 Steps in place of straight lines.
    """

    times: tuple[float, ...]
    values: tuple[float, ...]
    hold: bool = False

    def signal(self) -> Signal:
        """Return it as a table that repeats. [s, -]"""
        return TableSignal(np.array(self.times), np.array(self.values), hold=self.hold, after="repeat")


@dataclass(frozen=True)
class HeatLoad:
    """Heat put into a node.

    Parameters
    ----------
    into : str              The node.
    fields : dict           power [W] and what changes it: see `LOAD_SLOTS`.
    sensor : str            The node whose temperature a thermostat or proportional control follows; `into` when empty. What the load would
                            give without control follows `into`.
    curve : Curve or None   Power over the node's temperature. [W]
    controls : tuple        Controls whose shares its power is multiplied by, beside its own; ``1 - name`` takes the rest of one.
    cycle : Cycle or None   What its power is multiplied with, over and over; None for a steady load. [-]
    """

    into: str
    fields: Fields
    sensor: str = ""
    curve: Curve | None = None
    test_only: bool = False
    controls: tuple[str, ...] = ()
    cycle: Cycle | None = None


@dataclass(frozen=True)
class MadeIn:
    """The state of a gas in which a reduced model was made.

    Parameters
    ----------
    pressure, gravity, wind : float     [Pa], [m/s^2], [m/s]
    gas : str                           Its kind.
    """

    pressure: float
    gravity: float
    gas: str
    wind: float = 0.0

    def __str__(self) -> str:
        """`air at 101325 Pa`, with what is not as on the ground; `vacuum` without gas."""
        if self.pressure == 0.0:
            return "vacuum"
        weight = "" if abs(self.gravity / STANDARD_GRAVITY - 1.0) < 0.01 else f", {self.gravity:.4g} m/s^2"
        wind = f", {self.wind:.3g} m/s" if self.wind else ""
        return f"{self.gas} at {self.pressure:.6g} Pa{weight}{wind}"

    def written(self) -> dict[str, str]:
        """Return the table of the state of a gas in which a reduced model was made."""
        numbers = {"pressure": f"{self.pressure!r} [Pa]", "gravity": f"{self.gravity!r} [m/s^2]", "wind": f"{self.wind!r} [m/s]"}
        return numbers | {"gas": self.gas}


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


FieldNumbers = Mapping[str, Number]


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

    recipe: Callable[[FieldNumbers], Law | tuple[Law, ...]]
    alternatives: tuple[frozenset[str], ...]
    slots: Mapping[str, str]
    needs_curve: bool = False
    optional: frozenset[str] = frozenset()
    words: frozenset[str] = frozenset()
    loss: Callable[[FieldNumbers], Law] | None = None
    tabulated: str = ""


def _conduction(f: FieldNumbers) -> Law:
    """Return a conductance, given, as 1 / resistance or as k A / thickness [W/K]; of a table k(T), A / thickness [m]."""
    if "resistance" in f:
        return Law("linear", (1.0 / f["resistance"],))
    if "conductance" in f:
        return Law("linear", (f["conductance"],))
    if "conductivity" not in f:  # a table over temperature, integrated: the area over the length is left
        return Law("potential", (f["area"] / f["thickness"],))
    return Law("linear", (conduction.slab_conductance(f["conductivity"], f["area"], f["thickness"]),))


def _contact(f: FieldNumbers) -> tuple[Law, ...]:
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


def _gas(f: FieldNumbers) -> Law:
    """Return gas at rest in a gap: area [m^2], gap [m], accommodation [-] and factor on convection [-], for the medium to fill in."""
    return Law("gas", (f["area"], f["gap"], f.get("accommodation", ACCOMMODATION), f.get("convection_factor", 1.0)), "rest")


def _convection(f: FieldNumbers) -> Law:
    """Return htc A [W/K], or (coefficient A) |dT|^exponent, or area and length for a correlation."""
    if "htc.length" in f:
        return Law("natural", (f["area"], f["htc.length"]), "correlation")
    if "htc" in f:
        return Law("linear", (f["htc"] * f["area"],), "gas")
    return Law("power", (f["htc.coefficient"] * f["area"], f["htc.exponent"]), "gas")


def _radiation(f: FieldNumbers) -> Law:
    """Return sigma F A [W/K^4] with the exchange factor F, or with the emissivity in its place."""
    factor = f["exchange_factor"] if "exchange_factor" in f else f["emissivity"]
    return Law("radiation", (radiation.radiation_coefficient(factor, f["area"]),), "radiation")


def _flow(f: FieldNumbers) -> Law:
    """Return flow * density * specific_heat [W/K], one in place of what is not given: a gas named by word adds its own later."""
    flow = f["mass_flow"] if "mass_flow" in f else f["volume_flow"]
    return Law("flow", (flow * f.get("density", 1.0) * f.get("specific_heat", 1.0),))


def _duct(f: FieldNumbers) -> Law:
    """Return the numbers of ducts side by side, of given diameter or width and height, see `_in_duct`; Nu is 3.66 in a round one."""
    count = f.get("count", 1.0)
    if "diameter" in f:
        diameter, section, wet = f["diameter"], 0.25 * math.pi * f["diameter"] ** 2, math.pi * f["diameter"] * f["length"]
        return _in_duct(f, count * wet, 0.0, 0.0, diameter, count * section, 3.66)
    width, height = f["width"], f["height"]
    wet = 2.0 * (width + height) * f["length"]
    return _in_duct(f, count * wet, 0.0, 0.0, 2.0 * width * height / (width + height), count * width * height, _rectangle(width, height))


def _heat_sink(f: FieldNumbers) -> Law:
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


def _in_duct(f: FieldNumbers, base: Number, fins: Number, slope: Number, diameter: Number, section: Number, developed: Number) -> Law:
    """Return the row from which the medium, which knows its gas, makes the conductance between a stream and its walls.

    Wetted area [m^2] of `base` and `fins`, slope = m L / sqrt(h) of a fin, hydraulic diameter [m], length [m], flow over `section`
    [kg/(s m^2), or m/s where the last number is 1], and the Nusselt number of developed laminar flow [-].
    """
    flow, by_volume = (f["mass_flow"], 0.0) if "mass_flow" in f else (f["volume_flow"], 1.0)
    return Law("linear", (base, fins, slope, diameter, f["length"], flow / section, developed, by_volume), "duct")


def _fin(f: FieldNumbers, which: int) -> Law:
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


def _table(f: FieldNumbers) -> Law:
    """Return the factor on a deck's table, `scale` or one. [-]"""
    return Law("table", (f.get("scale", 1.0),))


def _heat_pipe(f: FieldNumbers) -> Law:
    """Return a conductance that rises on a line from off to on over `transition` [K], half-way at `start_temperature`, the ends' mean."""
    first = f["start_temperature"] - 0.5 * f["transition"]
    return Law("table", (1.0,), points=((first, f["off_conductance"]), (first + f["transition"], f["on_conductance"])))


def _bolted(f: FieldNumbers) -> tuple[Law, ...]:
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


def _wedge_lock(f: FieldNumbers) -> tuple[Law, ...]:
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


def _spreading(f: FieldNumbers) -> Law:
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
