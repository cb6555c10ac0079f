"""What a model is made of: nodes, conductors, surfaces, joints, heat loads. Every value is a `Parameter` under its field's name."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from thermid.base.errors import DeckError
from thermid.base.linear_algebra import Number, value_of
from thermid.model._laws.curves import Curve
from thermid.model._laws.signal import Signal, TableSignal, literal
from thermid.model._laws.stores import Supercooling
from thermid.model._parts.parameter import Parameter, parameter
from thermid.physics.constants import STANDARD_GRAVITY
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
    return parameter(table | {"source": "assumed", "basis": surface.basis}, where)


def gap_scatter(words: Mapping[str, str], where: str) -> Parameter:
    """Return the factor on the convection of a closed gap: one, with the scatter of its correlation as bounds."""
    law = GapLaw(degrees(words["tilt"], where), literal(words["aspect"], "1", where))
    table = {"value": 1, "min": 1.0 - law.scatter, "max": 1.0 + law.scatter, "source": "published"}
    return parameter(table | {"basis": f"scatter of {law.name} about their correlation"}, where)


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
