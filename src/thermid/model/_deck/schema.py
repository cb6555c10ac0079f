"""The grammar of a deck as pydantic models, which read the elements: what an editor checks (JSON Schema) and what a file becomes.

A field that is a value holds its `Parameter` once it is checked; a table gives its element, or says what is wrong with the whole of it.
Loaded only when a file is read: pydantic takes a tenth of a second.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Annotated, Any, TypeAlias, get_args

import numpy as np
from pydantic import ConfigDict, Field, create_model

from thermid.base.errors import DeckError, errors_at, nearest, refuse_first, refuse_unknown
from thermid.base.grammar import Real, StrictTable, reads
from thermid.model._deck.assemblies import CoolerTable, FanTable, LadderTable, PackageTable
from thermid.model._deck.fields import (
    Coefficient,
    CurveTable,
    ElementTable,
    Points,
    Property,
    Tabulated,
    UsedTable,
    Value,
    curve_of,
    plain,
)
from thermid.model._laws.options import Box, CarriedBy, StandsFor
from thermid.model._laws.signal import literal
from thermid.model._laws.stores import Curve, Rule, Supercooling, Where, limited, melting, tabulated
from thermid.model._parts.controls import CONTROL_SLOTS, KINDS_OF_CONTROL, Control, ModeChange, check_modes, followed, of_difference
from thermid.model._parts.elements import (
    CARRIED_BY,
    CONTROLS,
    KINDS,
    LOAD_SLOTS,
    NODE_SLOTS,
    Conductor,
    Cycle,
    Enclosure,
    Facing,
    HeatLoad,
    Joint,
    MadeIn,
    Node,
    Surface,
    degrees,
    finish_emissivity,
    gap_scatter,
)
from thermid.model._parts.parameter import Parameter
from thermid.physics.gas import GASES, MolecularGas
from thermid.physics.view_factors import SHAPES, PlacedFace, placed_factors

LIQUID = "liquid"
"""What a stream names that no pressure touches."""
MELTING = {"latent_heat": "J/kg", "melts_from": "temperature", "melts_to": "temperature", "liquid_specific_heat": "J/(kg K)"}
"""Fields of a node that melts, beside its mass and specific heat, with their units."""


Controlled: TypeAlias = str | list[str]
"""Names of controls by which something is multiplied; ``1 - name`` takes the rest of one."""


def control_names(written: str | list[str] | None) -> tuple[str, ...]:
    """Return one name, a list of names or None as a tuple of names."""
    return () if written is None else (written,) if isinstance(written, str) else tuple(written)


class NodeTable(ElementTable):
    """A node: mass and specific_heat, material or enthalpy, or capacitance, or nothing."""

    mass: Value | None = None
    material: str = ""
    specific_heat: Tabulated | None = None
    enthalpy: Property | None = None
    latent_heat: str | None = None
    melts_from: str | None = None
    melts_to: str | None = None
    liquid_specific_heat: str | None = None
    supercooling: str | None = None
    starts: str | None = None
    capacitance: Value | None = None
    stands_for: StandsFor | None = None
    reference_point: bool = False

    def element(self, where: Where) -> Node:
        """Return the node of a deck; `where` gives the place of a field for messages. A DeckError names fields that do not fit."""
        if self.material:
            return self.made_of(self.material, "specific_heat", where("material")).element(where)
        melts = {key: plain(text, key, MELTING[key], where(key)) for key, text in self._plain_melting(where).items()}
        fields = self.parameters(NODE_SLOTS)
        tables: dict[str, Curve] = {}
        if melts:
            # the enthalpy in place of a specific heat and a latent heat
            assert isinstance(self.specific_heat, Parameter)
            heat = plain(self.specific_heat.text, "specific_heat", "J/(kg K)", where("specific_heat"))
            begins, place = melts["melts_from"], where("")
            shape = melting(
                heat, melts.get("liquid_specific_heat", heat), melts["latent_heat"], begins, melts.get("melts_to", begins), place
            )
            tables["enthalpy"] = tabulated("enthalpy", shape, where("enthalpy"))
            del fields["specific_heat"]
        if isinstance(self.specific_heat, Property):
            tables["specific_heat"] = self.specific_heat.curve_of("specific_heat", where("specific_heat"))
        if self.enthalpy is not None:
            tables["enthalpy"] = self.enthalpy.curve_of("enthalpy", where("enthalpy"))
        refuse_first(
            where,
            (
                tables and (set(fields) != {"mass"} or len(tables) > 1),
                "a table of specific heat or of enthalpy needs a mass, and excludes all other heat capacities.",
                "",
                "value.excludes-another",
            ),
            (
                not tables and set(fields) not in (set(), {"capacitance"}, {"mass", "specific_heat"}),
                "give a node mass and specific_heat, or capacitance, or neither (a massless node).",
                "",
                "value.incomplete",
            ),
        )
        cools = self._supercooling(melts, where)
        return Node(fields, self.reference_point, self.test_only, next(iter(tables.items()), None), self.stands_for or "", cools)

    def _supercooling(self, melts: Mapping[str, float], where: Where) -> Supercooling | None:
        """Return liquidus [K], degree of supercooling [K] and start ("solid" or "liquid") of a node that supercools, None of any other.

        `melts` holds the temperatures of melting as the keys of the table name them: "melts_from" and, where it was given, "melts_to". [K]
        """
        cools = self.supercooling is not None
        refuse_first(
            where,
            (
                not cools and self.starts is not None,
                "starts = 'liquid' belongs to a node with supercooling; any other melts where it is warm.",
                "starts",
                "value.without-effect",
            ),
            (
                cools and self.enthalpy is None and not melts,
                "supercooling belongs to a node that melts: latent_heat and melts_from, or an enthalpy and melts_to.",
                "",
                "model.law-refused",
            ),
            (
                self.starts not in (None, "solid", "liquid"),
                f"starts = '{self.starts}' is neither 'solid' nor 'liquid'.",
                "starts",
                "value.wrong-kind",
            ),
            (
                cools and not melts and self.melts_to is None,
                "supercooling beside an enthalpy counts from melts_to, where everything is liquid.",
                "melts_to",
                "value.contradicts",
            ),
        )
        if self.supercooling is None:
            return None
        degree = plain(self.supercooling, "supercooling", "K", where("supercooling"))
        liquidus = (
            melts.get("melts_to", melts.get("melts_from", 0.0))
            if melts
            else plain(self.melts_to or "", "melts_to", "temperature", where("melts_to"))
        )
        return Supercooling(liquidus, degree, self.starts or "solid")

    def _plain_melting(self, where: Where) -> dict[str, str]:
        """Return the fields of `MELTING` that a node gives as texts; empty where it does not melt, refused where they are not complete."""
        texts = {key: text for key in MELTING if (text := getattr(self, key))}
        if self.enthalpy is not None and self.supercooling is not None and set(texts) == {"melts_to"}:
            return {}
        heat = self.specific_heat
        plain = isinstance(heat, Parameter) and bool(heat.unit) and heat == Parameter(heat.expression)
        if texts and (self.enthalpy is not None or not {"latent_heat", "melts_from"} <= set(texts) or not plain):
            raise DeckError(
                "for a node that melts give mass, specific_heat, latent_heat and melts_from as plain quantities, and melts_to and "
                "liquid_specific_heat if needed; or give a table of enthalpy.",
                where(""),
                code="value.incomplete",
            )
        return texts


class FacingTable(StrictTable):
    """Where a surface looks: tilt from looking up, azimuth from north over east; without azimuth it goes all around."""

    tilt: str | Real
    azimuth: str | Real | None = None

    def facing(self) -> Facing:
        """Return the direction of a surface, angles in degrees."""
        return Facing(degrees(self.tilt), None if self.azimuth is None else degrees(self.azimuth))


class SurfaceTable(ElementTable):
    """The outer surface of a node."""

    of: str
    to: str
    area: Value
    htc: Coefficient | None = None
    effective_htc: Value | None = None
    emissivity: Value | None = None
    finish: str = ""
    absorptance: Value | None = None
    facing: Annotated[Facing, reads(FacingTable, FacingTable.facing)] | None = None
    sees: str = ""
    radiates_to: Annotated[str, Field(description="Older name of `sees`.")] = ""
    carried_by: CarriedBy | None = None
    htc_control: Controlled | None = None
    emissivity_control: Controlled | None = None

    def element(self, where: Where) -> Surface:
        """Return the surface of a deck; `where` gives the place of a field for messages. A DeckError names fields that do not fit."""
        fields = self.parameters(("area", "htc", "effective_htc", "emissivity", "absorptance"))
        if self.finish:
            fields.setdefault("emissivity", finish_emissivity(self.finish, where("finish")))
        words = self.words(KINDS["convection"].words)
        controls = {what: control_names(names) for what in ("htc", "emissivity") if (names := getattr(self, f"{what}_control"))}
        refuse_first(
            where,
            (
                self.effective_htc is not None and self.htc is not None,
                "give a surface either htc (convection alone) or effective_htc (convection and radiation together, as fitted in "
                "air), not both.",
                "",
                "value.excludes-another",
            ),
            (
                self.htc is None and not {"effective_htc", "emissivity"} & set(fields),
                "the surface exchanges no heat. Give htc, effective_htc, emissivity or finish.",
                "",
                "value.incomplete",
            ),
            (self.sees and self.radiates_to, "sees and radiates_to have the same meaning. Give sees only.", "", "value.excludes-another"),
            _carrier_of_law(fields, words),
            (
                "emissivity" in controls and ("emissivity" not in fields or self.effective_htc is not None),
                "emissivity_control has nothing to control. Give an emissivity or a finish, and htc for the convection.",
                "emissivity_control",
                "value.without-effect",
            ),
            (
                "htc" in controls and self.htc is None and self.effective_htc is None,
                "htc_control has nothing to control. Give htc or effective_htc.",
                "htc_control",
                "value.without-effect",
            ),
        )
        return Surface(self.of, self.to, fields, self.sees or self.radiates_to, self.test_only, self.finish, words, self.facing, controls)


def _carrier_of_law(fields: Mapping[str, Parameter], words: Mapping[str, str]) -> Rule:
    """Return the rule that nobody names what carries the heat beside a coefficient that has a law of its own, or without one."""
    return (
        CARRIED_BY in words and not {"htc", "effective_htc"} & set(fields),
        f"{CARRIED_BY} states what carries the heat behind a constant coefficient: effective_htc, or htc as a number. Here the law "
        "is given, or nothing convects; leave it out.",
        "",
        "value.excludes-another",
    )


class Gap(StrictTable):
    """An air gap beside a contact: area of each face."""

    area: Value
    htc: Value
    to: str


class JointTable(ElementTable):
    """Two surfaces pressed together."""

    between: tuple[str, str]
    area: Value
    contact_conductance: Value | None = None
    conductivity: Value | None = None
    thickness: Value | None = None
    gap: Gap | None = None
    mid: str = ""

    def element(self, where: Where) -> Joint:
        """Return the joint of a deck; `where` gives the place of a field for messages. A DeckError names fields that do not fit."""
        fields = self.parameters(("area", "contact_conductance", "conductivity", "thickness", "gap"))
        plain_fields = {f for f in fields if not f.startswith("gap.")}
        refuse_first(
            where,
            (
                plain_fields not in ({"area", "contact_conductance"}, {"area", "conductivity", "thickness"}),
                "give a joint area and contact_conductance; or area, conductivity and thickness of each half.",
                "",
                "value.incomplete",
            ),
            (
                self.between[0] == self.between[1],
                "both ends of the joint are the same surface. Name two different surfaces.",
                "",
                "model.self-reference",
            ),
        )
        return Joint(self.between, fields, self.mid, self.gap.to if self.gap is not None else "", self.test_only)


Rows: TypeAlias = list[list[Real]]


Corner: TypeAlias = Annotated[list[str | Real], Field(min_length=3, max_length=3)]


class PlaceTable(StrictTable):
    """Where a face of an enclosure lies: a rectangle by corner and two sides, a disc, or the side of a cylinder."""

    corner: Corner | None = None
    sides: Annotated[list[Corner], Field(min_length=2, max_length=2)] | None = None
    centre: Corner | None = None
    normal: Annotated[list[Real], Field(min_length=3, max_length=3)] | None = None
    axis: Corner | None = None
    radius: str | Real | None = None
    inside: bool = False

    def placed(self, where: str) -> PlacedFace:
        """Return the face as a rectangle, disc or cylinder in space, lengths in metres."""
        fields_given = {key for key, value in self if value not in (None, False)}
        radius = literal(self.radius, "m", where) if self.radius is not None else 0.0
        centre, axis = _metres(self.centre, where), _metres(self.axis, where)
        if fields_given == {"corner", "sides"} and self.sides:
            face = PlacedFace("rectangle", _metres(self.corner, where), _metres(self.sides[0], where), _metres(self.sides[1], where))
        elif fields_given == {"centre", "normal", "radius"} and self.normal:
            x, y, z = self.normal
            face = PlacedFace("disc", centre, (x, y, z), radius=radius)
        elif fields_given in ({"centre", "axis", "radius"}, {"centre", "axis", "radius", "inside"}):
            face = PlacedFace("cylinder", centre, axis, radius=radius, inside=self.inside)
        else:
            raise DeckError(
                "give a place as corner and sides; or centre, normal and radius; or centre, axis and radius, and inside.",
                where,
                code="value.incomplete",
            )
        if not (0.0 < face.area < float("inf") and any(face.first)):
            raise DeckError("sides, radius, normal and axis of a place must not be zero.", where, code="value.outside-range")
        return face


def _metres(corner: list[str | Real] | None, where: str) -> tuple[float, float, float]:
    """Return three lengths in metres; a plain 0 needs no unit, and no list is the origin."""
    x, y, z = (0.0 if v in (0, "0") else literal(v, "m", where) for v in corner or (0, 0, 0))
    return x, y, z


class EnclosureTable(ElementTable):
    """Surfaces that radiate to one another: view factors of a shape, given ones, or exchange factors."""

    faces: Annotated[dict[str, str], Field(min_length=2)]
    shape: Annotated[str, Field(pattern=f"^({'|'.join(SHAPES)})$")] | None = None
    dimensions: dict[str, str | Real] = {}
    view_factors: Rows | None = None
    exchange_factors: Rows | None = None
    places: dict[str, PlaceTable] = {}
    rest: str = ""

    def element(self, where: Where) -> Enclosure:
        """Return the enclosure of a deck; `where` gives the place of a field for messages. A DeckError names fields that do not fit."""
        ways = [w for w in ("shape", "view_factors", "exchange_factors", "places") if getattr(self, w)]
        refuse_first(
            where,
            (
                len(ways) != 1,
                "give an enclosure exactly one of places, shape, view_factors and exchange_factors; given: "
                f"{' and '.join(ways) or 'none of them'}.",
                "",
                "value.incomplete",
            ),
            (
                self.rest and self.exchange_factors,
                "exchange factors include everything that a face sees, so rest does not apply. Add the rest as a face, or leave it out.",
                "",
                "value.excludes-another",
            ),
            (
                self.dimensions and not self.shape,
                "dimensions are given, but no shape. Give shape, or leave dimensions out.",
                "",
                "value.excludes-another",
            ),
        )
        size = len(self.faces)
        views, exchanges = (tuple(tuple(row) for row in matrix or ()) for matrix in (self.view_factors, self.exchange_factors))
        views = self._placed_view_factors(where) if self.places else views
        for name, matrix in (("view factors", views), ("exchange factors", exchanges)):
            if matrix and {len(matrix), *map(len, matrix)} != {size}:
                raise DeckError(f"{size} faces need {size} rows of {size} {name}.", where(""), code="value.shape")
        dimensions = {n: plain(v, "dimensions", "m", where(f"dimensions.{n}")) for n, v in self.dimensions.items()}
        if self.shape:
            _check_shape(self.shape, self.faces, dimensions, bool(self.rest), where)
        return Enclosure(self.faces, self.shape or "", dimensions, views, exchanges, self.rest, self.test_only)

    def _placed_view_factors(self, where: Where) -> tuple[tuple[float, ...], ...]:
        """Return the view factors (faces, faces) of faces that all have a place in space. [-]"""
        if set(self.places) != set(self.faces):
            odd = sorted(set(self.places) ^ set(self.faces))[0]
            raise DeckError(
                f"faces and places must have the same names; '{odd}' is only one of them.", where("places"), code="model.law-refused"
            )
        placed = [self.places[name].placed(where(f"places.{name}")) for name in self.faces]
        _, factors, _ = placed_factors(tuple(placed), tuple(self.faces), where=where("places"))
        return tuple(map(tuple, factors.tolist()))


def _check_shape(name: str, faces: Mapping[str, str], dimensions: Mapping[str, float], rest: bool, where: Where) -> None:
    """Refuse faces and dimensions that are not those of a shape, and a shape without all faces where nothing takes the rest."""
    shape = SHAPES[name]
    for what, named, allowed in (("faces", faces, shape.faces), ("dimensions", dimensions, shape.dimensions)):
        refuse_unknown(named, allowed, where(""), f"'{name}' has no '{{}}' among its {what}: {{known}}.", DeckError)
    lacking, left_out = [d for d in shape.dimensions if d not in dimensions], [f for f in shape.faces if f not in faces]
    also = f" ({', '.join(left_out)} left out)" if left_out else ""
    refuse_first(
        where,
        (lacking, f"'{name}' needs {', '.join(lacking)}.", "", "value.incomplete"),
        (
            name == "cylinder in cylinder" and dimensions.get("inner_radius", 0.0) >= dimensions.get("outer_radius", 0.0),
            "the inner radius must be smaller than the outer one.",
            "",
            "value.outside-range",
        ),
        (
            (left_out or len(shape.faces) == 2) and not rest,
            f"the faces of '{name}'{also} do not close it: their view factors sum to less than 1. Name the node that "
            "fills the rest of the view: rest = a node.",
            "",
            "value.contradicts",
        ),
    )


class Periodic(StrictTable):
    """On for `duty` of every `period`."""

    period: Value
    duty: Value


class CycleTable(StrictTable):
    """A factor on the power that repeats: straight lines between rows, or steps."""

    times: Annotated[list[str], Field(min_length=2)]
    values: Annotated[list[str | Real], Field(min_length=2)]
    hold: bool = False
    period: str | None = None

    def cycle(self, where: str) -> Cycle:
        """Return times [s] and factors [-] of one period; the last row ends it where no period is given."""
        times = [literal(t, "s", where) for t in self.times]
        values = [literal(v, "1", where) for v in self.values]
        if self.period is not None:
            end = literal(self.period, "s", where)
            if not end > times[-1]:
                raise DeckError(
                    "the period ends before the last row. Give a longer period, or leave it out if the last row is its end.",
                    where,
                    code="value.outside-range",
                )
            times, values = [*times, end], [*values, values[0]]
        if times[0] != 0.0:
            raise DeckError("the first row of a cycle must be at 0 s.", where, code="value.outside-range")
        cycle = Cycle(tuple(times), tuple(values), self.hold)
        with errors_at(where):
            cycle.signal()
        return cycle


class SinePower(StrictTable):
    """A sine on top of the power."""

    amplitude: Value
    period: Value


class Thermostat(StrictTable):
    """On below one temperature, off above another."""

    sensor: str = ""
    on_below: Value
    off_above: Value


class Proportional(StrictTable):
    """A control that lets through a share of the load: what is missing to the set point over the band, between zero and one.

    The band is `power` over `gain`, or given itself.
    """

    sensor: str = ""
    gain: Value | None = None
    band: Value | None = None
    setpoint: Value


class LoadTable(ElementTable):
    """Heat put into a node."""

    into: str
    power: Value | None = None
    table: CurveTable | None = None
    scale: Value | None = None
    command_curve: Value | None = None
    temperature_coefficient: Value | None = None
    quadratic_coefficient: Value | None = None
    exponential_coefficient: Value | None = None
    reference_temperature: Value | None = None
    periodic: Periodic | None = None
    cycle: CycleTable | None = None
    sine: SinePower | None = None
    thermostat: Thermostat | None = None
    proportional: Proportional | None = None
    control: Controlled | None = None

    def element(self, where: Where) -> HeatLoad:
        """Return the heat load of a deck; `where` gives the place of a field for messages. A DeckError names fields that do not fit."""
        fields = self.parameters(dict.fromkeys(slot.partition(".")[0] for slot in LOAD_SLOTS))
        shape = curve_of(self.table, "W", where(""))
        controls = [c for c in CONTROLS if getattr(self, c) is not None]
        curved = [f for f in fields if f.endswith("_coefficient")]
        first = next(iter(curved), "")
        refuse_first(
            where,
            (
                (self.power is None) == (shape is None),
                "give a load either power, or a table of power over temperature.",
                "",
                "value.incomplete",
            ),
            (len(controls) > 1, f"{' and '.join(controls)} cannot both control one load. Define two loads.", "", "value.excludes-another"),
            (
                curved and shape is not None,
                f"{first} and a table are both laws of the same temperature. Put both into the table.",
                "",
                "value.excludes-another",
            ),
            (
                self.proportional is not None and (self.proportional.gain is None) == (self.proportional.band is None),
                "give proportional either gain [W/K] or band [K].",
                "proportional",
                "value.incomplete",
            ),
            (
                "proportional.gain" in fields and (self.control is not None or shape is not None),
                f"a gain in W/K needs a fixed power, but {'this power is a table' if shape is not None else 'the control changes it'}. "
                "Give band in K.",
                "proportional",
                "value.incomplete",
            ),
            (
                curved and self.reference_temperature is None,
                f"{first} needs reference_temperature: the temperature at which `power` holds.",
                "",
                "value.incomplete",
            ),
            (
                self.exponential_coefficient is not None and len(curved) > 1,
                "give either exponential_coefficient or the polynomial coefficients.",
                "",
                "value.incomplete",
            ),
            (
                self.scale is not None and shape is None,
                "scale applies to a table of power only. For a constant power change power itself.",
                "",
                "value.without-effect",
            ),
        )
        sensor = getattr(self, controls[0]).sensor if controls else ""
        cycle = self.cycle.cycle(where("cycle")) if self.cycle is not None else None
        by = control_names(self.control)
        return HeatLoad(self.into, fields, sensor, shape and limited(shape, positive=False), self.test_only, by, cycle)


class ThermostatControl(StrictTable):
    """A heater's thermostat, on below and off above; a cooler's, on above and off below."""

    on_below: Value | None = None
    off_above: Value | None = None
    on_above: Value | None = None
    off_below: Value | None = None


class ProportionalControl(StrictTable):
    """A share that rises from zero at the set point to one a band below it; a negative band cools: one a band above it."""

    setpoint: Value
    band: Value
    lowest: Value | None = None
    highest: Value | None = None


class PidControl(StrictTable):
    """A PID controller in series form, between two limits; its integral part stops at them."""

    setpoint: Value
    band: Value
    integral_time: Value
    derivative_time: Value | None = None
    filter_time: Value | None = None
    lowest: Value | None = None
    highest: Value | None = None
    begins: Value | None = None


class TransitionTable(StrictTable):
    """A way from one mode to another: above or below a temperature, or after a time in the mode."""

    model_config = ConfigDict(extra="forbid", populate_by_name=True)

    before: Annotated[str, Field(alias="from")]
    after_mode: Annotated[str, Field(alias="to")]
    above: Value | None = None
    below: Value | None = None
    after: Value | None = None
    follows: str | list[str] | dict[str, Real] | None = None


class ControlTable(ElementTable):
    """A share that follows temperatures, by which loads, conductors, surfaces and boundaries are multiplied."""

    follows: str | list[str] | dict[str, Real] | None = None
    thermostat: ThermostatControl | None = None
    proportional: ProportionalControl | None = None
    pid: PidControl | None = None
    table: CurveTable | None = None
    modes: dict[str, Value] | None = None
    starts: str = ""
    transitions: Annotated[dict[str, TransitionTable], Field(default_factory=dict)]
    sample: str | None = None

    def element(self, where: Where) -> Control:
        """Return the control of a deck; `where` gives the place of a field for messages. A DeckError names fields that do not fit."""
        kinds = [k for k in KINDS_OF_CONTROL if getattr(self, k) is not None]
        kinds_given, kind = f"; given: {' and '.join(kinds)}" if kinds else "", "".join(kinds[:1])
        sample = plain(self.sample, "sample", "s", where("sample")) if self.sample is not None else 0.0
        refuse_first(
            where,
            (len(kinds) != 1, f"give a control exactly one of {', '.join(KINDS_OF_CONTROL)}{kinds_given}.", "", "value.incomplete"),
            (
                self.follows is None and (kind != "modes" or any(t.follows is None and t.after is None for t in self.transitions.values())),
                'a control follows a node: follows = "plate", a list of nodes (their mean) or nodes with weights.',
                "",
                "value.incomplete",
            ),
            (
                sample and kind not in ("proportional", "pid", "table"),
                f"a sample time applies to proportional, pid or table. {kind} switches at the exact instant; leave sample out.",
                "sample",
                "value.without-effect",
            ),
        )
        follows = followed(self.follows, where("follows")) if self.follows is not None else {}
        fields = self.parameters(dict.fromkeys(slot.partition(".")[0] for slot in CONTROL_SLOTS))
        fields |= {f"modes.{name}": value for name, value in (self.modes or {}).items()}
        self._check(kind, follows, fields, where)
        shape = curve_of(self.table, "1", where("table"))
        ways = {name: self._transition(t, where(f"transitions.{name}")) for name, t in self.transitions.items()}
        fields |= {f"transitions.{name}.{t.sense}": getattr(self.transitions[name], t.sense) for name, t in ways.items()}
        out = Control(kind, follows, fields, shape, self.starts, ways, sample, self.test_only)
        if kind == "modes":
            check_modes(out, where(""))
        return out

    def _check(self, kind: str, follows: Mapping[str, float], fields: Mapping[str, Parameter], where: Where) -> None:
        """Refuse fields that do not go together in one control."""
        ends = {name.partition(".")[2] for name in fields}
        derived = {"pid.derivative_time", "pid.filter_time"} & set(fields)
        points = self.table if isinstance(self.table, Points) else None
        refuse_first(
            where,
            (
                kind != "modes" and (self.transitions or self.starts),
                "starts and transitions apply to modes only.",
                "",
                "value.without-effect",
            ),
            (
                kind == "modes" and not (self.starts and self.transitions),
                "modes need starts (the mode at the start) and transitions.",
                "",
                "value.incomplete",
            ),
            (
                kind == "thermostat" and ends not in ({"on_below", "off_above"}, {"on_above", "off_below"}),
                "give a thermostat on_below and off_above (heating), or on_above and off_below (cooling).",
                "thermostat",
                "value.incomplete",
            ),
            (
                len(derived) == 1,
                "the derivative part of a PID control needs both derivative_time and filter_time.",
                "pid",
                "value.incomplete",
            ),
            (
                kind == "pid" and len(follows) > (1 if derived else 2),
                f"a PID control may follow one node with a derivative part, two without; {len(follows)} are given.",
                "pid",
                "model.law-refused",
            ),
            (
                points is not None and points.over == "difference" and not of_difference(follows),
                "a table over a difference needs a difference: follows = { hot = 1, cold = -1 }.",
                "table",
                "model.law-refused",
            ),
            (
                points is not None and points.outside == "refuse",
                "outside = 'refuse' is not possible for a control's table. Leave it out, or use 'hold'.",
                "table",
                "model.law-refused",
            ),
        )

    def _transition(self, t: TransitionTable, where: str) -> ModeChange:
        """Return a change of mode, which gives exactly one of above, below and after."""
        senses = [s for s in ("above", "below", "after") if getattr(t, s) is not None]
        if len(senses) != 1:
            raise DeckError(
                "give a transition exactly one of above, below (a temperature) and after (a time in its mode).",
                where,
                code="value.incomplete",
            )
        return ModeChange(t.before, t.after_mode, senses[0], followed(t.follows, where) if t.follows is not None else {})


class MadeInTable(StrictTable):
    """The state of a gas in which a reduced deck was made; it runs in no other."""

    pressure: str
    gravity: str = "9.80665 [m/s^2]"
    gas: str = "air"
    wind: str = "0 [m/s]"

    def element(self, where: Where) -> MadeIn:
        """Return pressure, gravity, wind and gas in which a reduced deck was made. [SI]"""
        slots = {"pressure": "Pa", "gravity": "m/s^2", "wind": "m/s"}
        numbers = {name: plain(getattr(self, name), f"made_in.{name}", slot, where(name)) for name, slot in slots.items()}
        return MadeIn(gas=MolecularGas.named(self.gas, where("")).name, **numbers)


def _check_stream(fields: set[str], fluid: str, where: Where) -> None:
    """Refuse a stream whose fluid is unknown, a gas with a density of its own, and another fluid without its properties."""
    what = f"of {fluid}" if fluid else "without a fluid"
    cure = "" if fluid else '. For a gas give fluid = "air"; density and specific heat then follow'
    refuse_first(
        where,
        (
            fluid in GASES and "density" in fields,
            f"the density of {fluid} follows from its pressure and temperature: leave density out.",
            "",
            "value.excludes-another",
        ),
        (
            fluid not in ("", LIQUID, *GASES),
            f"'{fluid}' is not a known fluid.{nearest(fluid, (*GASES, LIQUID))} There are {', '.join(GASES)} and {LIQUID}.",
            "",
            "name.unknown",
        ),
        (
            fluid not in GASES and fields not in ({"mass_flow", "specific_heat"}, {"volume_flow", "density", "specific_heat"}),
            f"a stream {what} needs volume_flow and density and specific_heat, or mass_flow and specific_heat{cure}. "
            f"Given: {', '.join(sorted(fields))}.",
            "",
            "value.incomplete",
        ),
    )


def _check_gap(fields: dict[str, Parameter], words: Mapping[str, str], where: Where) -> None:
    """Refuse a gap that says half of how it lies; give one that convects the scatter of its correlation."""
    lies, place = {"tilt", "aspect"} & set(words), where("")
    refuse_first(
        where,
        (
            not lies and "convection_factor" in fields,
            "convection_factor applies to a gap that convects only. Give tilt and aspect too.",
            "",
            "value.without-effect",
        ),
        (
            len(lies) == 1,
            'a gap that convects needs both tilt ("0 [deg]": first end below) and aspect (height over thickness).',
            "",
            "value.incomplete",
        ),
    )
    if lies:
        plain(words["aspect"], "aspect", "1", place)
        if not 0.0 <= (tilt := degrees(words["tilt"], place)) <= 180.0:
            raise DeckError(f"the tilt of a gap is {tilt:g} degrees. Give 0 (first end below) to 180.", place, code="value.outside-range")
        fields.setdefault("convection_factor", gap_scatter(words, place))


class _ConductorTable(ElementTable):
    """A path of heat between two nodes."""

    kind: Annotated[str, Field(pattern=f"^({'|'.join(KINDS)})$")]
    between: tuple[str, str]
    material: str = ""
    table: CurveTable | None = None
    takes: list[str] = []
    gas: str = ""
    fluid: str = ""
    to: str = ""
    tilt: str = ""
    aspect: str = ""
    control: Controlled | None = None
    reversible: bool = False
    carried_by: CarriedBy | None = None

    def element(self, where: Where) -> Conductor:
        """Return the conductor of a deck; `where` gives the place of a field for messages. A DeckError names fields that do not fit."""
        kind = KINDS[self.kind]
        if self.material and "conductivity" not in kind.slots:
            text = f"a conductor of kind '{self.kind}' has no conductivity. Leave material out."
            raise DeckError(text, where("material"), code="value.without-effect")
        if self.material:
            return self.made_of(self.material, "conductivity", where("material")).element(where)
        name = kind.tabulated or "conductivity"
        written = getattr(self, name, None)
        shape = written.curve_of(name, where(name)) if isinstance(written, Property) else None
        fields, words = self._of_kind({name} if shape is not None else set(), where)
        if self.kind == "gas":
            _check_gap(fields, words, where)
        if self.kind == "flow":
            _check_stream(set(fields), words.get("fluid", ""), where)
        points = curve_of(self.table, "W/K", where(""))
        least = int(np.argmax(points.y < 0)) if points is not None else 0
        refuse_first(
            where,
            _carrier_of_law(fields, words),
            (
                self.kind == "contact" and self.gas and ("gap" in fields) == (self.gas == "none"),
                'the gas of a contact is that in its gap: give both. Where a pad or grease fills the contact, gas = "none" stands alone.',
                "gas",
                "value.contradicts",
            ),
            (
                self.reversible and (self.kind != "flow" or (words.get("fluid") in GASES and "volume_flow" in fields)),
                "reversible applies to a flow only; for a gas the flow must be a mass_flow.",
                "reversible",
                "value.without-effect",
            ),
            (
                (points is not None) != kind.needs_curve,
                f"a conductor of kind '{self.kind}' {'needs' if kind.needs_curve else 'has no'} table of points.",
                "",
                "value.without-effect",
            ),
            (
                points is not None and points.y[least] < 0,
                f"the table gives {points.y[least]:g} W/K at {points.x[least]:.9g} K. A conductance must not be negative: heat would flow "
                "from cold to hot."
                if points is not None
                else "",
                "",
                "model.negative-conductance",
            ),
            (self.between[0] == self.between[1], "both ends are the same node.", "", "model.self-reference"),
            (
                self.takes and "area" not in fields,
                "it takes area from a surface but gives no area. Give area.",
                "takes",
                "value.incomplete",
            ),
        )
        law = shape if points is None else limited(points)
        by = control_names(self.control)
        return Conductor(self.kind, self.between, fields, law, tuple(self.takes), self.test_only, words, by, self.reversible)

    def _of_kind(self, tables: set[str], where: Where) -> tuple[dict[str, Parameter], dict[str, str]]:
        """Return the parameters and words of a conductor, which must be those of its kind; `tables` are fields over temperature."""
        kind = KINDS[self.kind]
        fields = self.parameters(name for name in _SLOTS if name in self.model_fields_set)
        words = self.words(_WORDS)
        whose, odd, strange = f"a conductor of kind '{self.kind}'", sorted(set(words) - kind.words), sorted(set(fields) - set(kind.slots))
        wanted = ", or ".join(" and ".join(s for s in kind.slots if s in a) for a in kind.alternatives if a)
        also = (
            f" It has no {', '.join(strange)}.{nearest(strange[0], kind.slots)}"
            if strange
            else f" Given: {', '.join(fields) or 'nothing'}."
        )
        refuse_first(
            where,
            (tables and not kind.tabulated, f"{whose} takes no table of conductivity.", "", "value.without-effect"),
            (
                odd,
                f"{whose} has no {''.join(odd[:1])}; one of kind {' or '.join(k for k in KINDS if {*odd[:1]} <= KINDS[k].words)} has it.",
                "",
                "value.without-effect",
            ),
            (
                {*fields, *tables} - kind.optional not in [set(a) for a in kind.alternatives],
                f"{whose} needs {wanted}.{also}",
                "",
                "value.incomplete",
            ),
        )
        return fields, words


_SLOTS = tuple(dict.fromkeys(slot.partition(".")[0] for kind in KINDS.values() for slot in kind.slots))
_WORDS = frozenset[str]().union(*(kind.words for kind in KINDS.values()))
"""Fields and words of all kinds of conductors."""


_SHAPED: dict[str, Any] = {"htc": Coefficient | None, "conductivity": Tabulated | None}
_OF_KINDS: dict[str, Any] = {name: (_SHAPED.get(name, Value | None), None) for name in sorted(_SLOTS)}
ConductorTable = create_model("ConductorTable", __base__=_ConductorTable, __doc__=_ConductorTable.__doc__, **_OF_KINDS)
"""The conductor's table with the fields of every kind, so that a new kind needs no line here."""


class SubmodelTable(UsedTable):
    """A deck used inside this one: once, or as an array with conductors between neighbours."""

    links: dict[str, ConductorTable] = {}  # type: ignore[valid-type]  # made above

    def joined(self, where: Where) -> dict[str, Conductor]:
        """Return link -> conductor between an instance and its next neighbour, its ends named as inside the two instances."""
        out = {}
        for name, table in self.links.items():
            between = tuple(f"{side}.{end}" for side, end in zip(("here", "next"), table.between, strict=True))  # type: ignore[attr-defined]
            link = table.model_copy(update={"between": between}).element(lambda key, name=name: where(f"links.{name}.{key}".rstrip(".")))  # type: ignore[attr-defined]
            out[name] = replace(link, between=(between[0].partition(".")[2], between[1].partition(".")[2]))
        return out


class RowsTable(StrictTable):
    """A table that makes elements: one row, one element."""

    makes: str
    file: str = ""
    rows: list[dict[str, Any]] = []
    each: dict[str, Any] = {}


class Deck(StrictTable):
    """What the hardware is."""

    title: str
    box: Box = "light grey"
    use: str = ""
    incomplete: str = ""
    needs: list[str] = []
    offers: list[str] = []
    parameters: dict[str, Value] = {}
    nodes: dict[str, NodeTable] = {}
    surfaces: dict[str, SurfaceTable] = {}
    conductors: dict[str, ConductorTable] = {}  # type: ignore[valid-type]  # made above
    joints: dict[str, JointTable] = {}
    enclosures: dict[str, EnclosureTable] = {}
    loads: dict[str, LoadTable] = {}
    controls: dict[str, ControlTable] = {}
    submodels: dict[str, SubmodelTable] = {}
    packages: dict[str, PackageTable] = {}
    ladders: dict[str, LadderTable] = {}
    coolers: dict[str, CoolerTable] = {}
    fans: dict[str, FanTable] = {}
    tables: dict[str, RowsTable] = {}
    set: dict[str, Value] = {}
    cuts: list[str] = []
    aliases: dict[str, str] = {}
    made_in: dict[str, MadeInTable] = {}


GROUPS = (
    "nodes",
    "surfaces",
    "conductors",
    "joints",
    "enclosures",
    "loads",
    "controls",
    "submodels",
    "packages",
    "ladders",
    "coolers",
    "fans",
)
"""Groups of a deck whose elements a table of rows may make."""


def fields_of_groups() -> dict[str, dict[str, Any]]:
    """Return group of a deck -> the fields of its elements."""
    return {group: get_args(Deck.model_fields[group].annotation)[1].model_fields for group in GROUPS}


def tables_of(written: Mapping[str, Any], where: Where) -> dict[str, RowsTable]:
    """Return the tables that make elements, checked against their grammar."""
    return {
        name: RowsTable.from_file(raw, lambda inner, name=name: where(f"tables.{name}.{inner}".rstrip(".")))  # type: ignore[misc]
        for name, raw in written.items()
    }


assert set(LoadTable.model_fields) >= {slot.partition(".")[0] for slot in LOAD_SLOTS}
