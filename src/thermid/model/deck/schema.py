"""The grammar of a deck as pydantic models: what an editor checks (JSON Schema) and what a file is checked against.

Loaded only when a file is read: pydantic takes a tenth of a second.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal, TypeAlias

from pydantic import BaseModel, Field, create_model

from thermid.grammar import StrictTable
from thermid.model.laws.options import Box, Source, StandsFor
from thermid.model.parts.elements import LOAD_SLOTS
from thermid.model.parts.kinds import KINDS
from thermid.physics.view_factors import SHAPES

Real: TypeAlias = Annotated[float, Field(strict=True)]
"""A number; true and false are none."""


class ValueTable(StrictTable):
    """A value with its bounds and where it comes from."""

    value: str | Real
    min: str | Real | None = None
    max: str | Real | None = None
    source: Source | None = None
    note: str = ""
    basis: str = ""


Value: TypeAlias = str | Real | ValueTable


class PowerLaw(StrictTable):
    """h = coefficient |dT / 1 K|^exponent."""

    coefficient: Value
    exponent: Value


class Correlated(StrictTable):
    """h by a correlation, from the properties of the gas at film temperature, its pressure, gravity and wind."""

    correlation: str = ""
    length: Value
    orientation: Literal["vertical", "up", "down"] = "vertical"


class Points(StrictTable):
    """A table over a temperature or a temperature difference: straight lines; a third text of a point is its slope and makes it smooth."""

    over: Annotated[str, Field(pattern="^(temperature|difference)$")] = "temperature"
    points: list[Annotated[list[str], Field(min_length=2, max_length=3)]]
    interpolation: Literal["linear", "smooth"] = "linear"
    outside: Literal["hold", "linear", "refuse"] = "hold"
    source: Source | None = None
    basis: str = ""


class Property(StrictTable):
    """A property over temperature: straight lines; a third text of a point is its slope and makes it smooth."""

    points: list[Annotated[list[str], Field(min_length=2, max_length=3)]]
    interpolation: Literal["linear", "smooth"] = "linear"
    outside: Literal["hold", "linear", "refuse"] = "hold"
    source: Source | None = None
    basis: str = ""


class NodeTable(StrictTable):
    """A node: mass and specific_heat or enthalpy, or capacitance, or nothing."""

    mass: Value | None = None
    specific_heat: Value | Property | None = None
    enthalpy: Property | None = None
    latent_heat: str | None = None
    melts_from: str | None = None
    melts_to: str | None = None
    liquid_specific_heat: str | None = None
    capacitance: Value | None = None
    stands_for: StandsFor | None = None
    reference_point: bool = False
    test_only: bool = False


class FacingTable(StrictTable):
    """Where a surface looks: tilt from looking up, azimuth from north over east; without azimuth it goes all around."""

    tilt: str | Real
    azimuth: str | Real | None = None


class SurfaceTable(StrictTable):
    """The outer surface of a node."""

    of: str
    to: str
    area: Value
    htc: Value | PowerLaw | Correlated | None = None
    effective_htc: Value | None = None
    emissivity: Value | None = None
    finish: str = ""
    absorptance: Value | None = None
    facing: FacingTable | None = None
    sees: str = ""
    radiates_to: Annotated[str, Field(description="Older name of `sees`.")] = ""
    test_only: bool = False


class Gap(StrictTable):
    """An air gap beside a contact: area of each face."""

    area: Value
    htc: Value
    to: str


class JointTable(StrictTable):
    """Two surfaces pressed together."""

    between: tuple[str, str]
    area: Value
    contact_conductance: Value | None = None
    conductivity: Value | None = None
    thickness: Value | None = None
    gap: Gap | None = None
    mid: str = ""
    test_only: bool = False


Rows: TypeAlias = list[list[Real]]


class EnclosureTable(StrictTable):
    """Surfaces that radiate to one another: view factors of a shape, given ones, or exchange factors."""

    faces: Annotated[dict[str, str], Field(min_length=2)]
    shape: Annotated[str, Field(pattern=f"^({'|'.join(SHAPES)})$")] | None = None
    dimensions: dict[str, str | Real] = {}
    view_factors: Rows | None = None
    exchange_factors: Rows | None = None
    rest: str = ""
    test_only: bool = False


class Periodic(StrictTable):
    """On for `duty` of every `period`."""

    period: Value
    duty: Value


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


class LoadTable(StrictTable):
    """Heat put into a node."""

    into: str
    power: Value | None = None
    table: Points | None = None
    scale: Value | None = None
    command_curve: Value | None = None
    temperature_coefficient: Value | None = None
    quadratic_coefficient: Value | None = None
    exponential_coefficient: Value | None = None
    reference_temperature: Value | None = None
    periodic: Periodic | None = None
    sine: SinePower | None = None
    thermostat: Thermostat | None = None
    proportional: Proportional | None = None
    test_only: bool = False


class AirAndSees(StrictTable):
    """A need bound to two nodes: what its surfaces convect to, and what they see."""

    to: str
    sees: str


class MadeInTable(StrictTable):
    """The state of a gas in which a reduced deck was made; it runs in no other."""

    pressure: str
    gravity: str = "9.80665 [m/s^2]"
    gas: str = "air"
    wind: str = "0 [m/s]"


class SubmodelTable(StrictTable):
    """A deck used inside this one."""

    use: str
    bind: dict[str, str | AirAndSees] = {}


def _conductor_table() -> type[BaseModel]:
    """Return the conductor's table with the fields of every kind, so that a new kind needs no line here."""
    names = {slot.partition(".")[0] for kind in KINDS.values() for slot in kind.slots}
    fields: dict[str, Any] = {"kind": (Annotated[str, Field(pattern=f"^({'|'.join(KINDS)})$")], ...), "between": (tuple[str, str], ...)}
    shaped: dict[str, Any] = {"htc": Value | PowerLaw | Correlated | None, "conductivity": Value | Property | None}
    fields |= {name: (shaped.get(name, Value | None), None) for name in sorted(names)}
    return create_model(
        "ConductorTable",
        __base__=StrictTable,
        __doc__="A path of heat between two nodes.",
        table=(Points | None, None),
        takes=(list[str], []),
        gas=(str, ""),
        fluid=(str, ""),
        to=(str, ""),
        test_only=(bool, False),
        **fields,
    )


ConductorTable = _conductor_table()


class Deck(StrictTable):
    """What the hardware is."""

    title: str
    box: Box = "light grey"
    use: str = ""
    needs: list[str] = []
    offers: list[str] = []
    parameters: dict[str, Value] = {}
    nodes: dict[str, NodeTable] = {}
    surfaces: dict[str, SurfaceTable] = {}
    conductors: dict[str, ConductorTable] = {}  # type: ignore[valid-type]  # made above
    joints: dict[str, JointTable] = {}
    enclosures: dict[str, EnclosureTable] = {}
    loads: dict[str, LoadTable] = {}
    submodels: dict[str, SubmodelTable] = {}
    set: dict[str, Value] = {}
    cuts: list[str] = []
    aliases: dict[str, str] = {}
    made_in: dict[str, MadeInTable] = {}


def json_schema() -> dict[str, Any]:
    """Return the JSON Schema of a deck, for editors."""
    return Deck.model_json_schema()


assert set(LoadTable.model_fields) >= {slot.partition(".")[0] for slot in LOAD_SLOTS}
