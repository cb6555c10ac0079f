"""The grammar of scenario files as pydantic models: what is done to the hardware, and the tables that make its surroundings."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal, TypeAlias

from pydantic import Field

from thermid.base.errors import ScenarioError, ThermidError
from thermid.base.grammar import Amount, ColumnTable, Finite, Flag, SineTable, StrictTable, TimesTable, Whole, in_form

SignalField: TypeAlias = Annotated[
    Any, in_form(Amount, (ColumnTable, ("file", "column")), (SineTable, ("mean", "amplitude")), (TimesTable, ()))
]
"""What may change with time in a scenario file: as `CourseField`, or a column of a log."""


Share = Annotated[float, Field(strict=True, ge=0.0, le=1.0)]


class GasTable(StrictTable):
    """The state of one gas."""

    pressure: SignalField = None
    humidity: Amount = None
    gravity: Amount = None
    gas: str | None = None
    wind: SignalField = None
    sealed: Flag | None = None
    vented: str | None = None
    time_constant: Amount = None


class FallingTable(StrictTable):
    """What falls on one surface."""

    direct: SignalField = None
    diffuse: SignalField = None
    albedo: SignalField = None
    total: SignalField = None
    infrared: SignalField = None
    sky: SignalField = None
    sky_view: Share | None = None
    stream: SignalField = None


class SiteTable(StrictTable):
    """A place on earth."""

    latitude: Amount
    longitude: Amount
    altitude: Amount = None
    timezone: Finite | None = None
    name: str | None = None


class WeatherTable(StrictTable):
    """A weather file, and the stretch of it that is taken."""

    file: str | None = None
    columns: dict[str, str] | None = None
    begin: str | None = None
    starts: str | None = None
    max_gap: Amount = None
    year: Annotated[Whole, Field(ge=1, le=9999)] | None = None
    time: str | None = None
    averaged: Flag | None = None
    air: str | None = None
    air_temperature: SignalField = None


class SunTable(StrictTable):
    """Sun and sky."""

    shines: Flag | None = None
    sky: Flag | dict[str, Finite] | None = None
    albedo: Share | None = None
    turbidity: Finite | None = None


class WindTable(StrictTable):
    """A coefficient that follows the wind."""

    length: Amount
    calm: Amount
    rain: Literal["roof", "wall", ""] = ""


class AscentTable(StrictTable):
    """The ascent of a launcher."""

    file: str | None = None
    columns: dict[str, str] | None = None
    time: str | None = None
    pressure: SignalField = None
    air: str | None = None
    air_temperature: SignalField = None
    walls: dict[str, SignalField] = {}
    separation: Amount = None
    flow: dict[str, Share] | None = None
    accommodation: Finite | None = None
    upper: str | None = None


class PlanetTable(StrictTable):
    """A planet by its figures."""

    radius: Amount
    attraction: Amount
    solar: Amount


class OrbitTable(StrictTable):
    """An orbit: what falls on the faces of a box."""

    perigee: Amount
    albedo: Share
    infrared: Amount
    apogee: Amount = None
    planet: Annotated[Any, in_form(Amount, (PlanetTable, ()))] = "earth"
    solar: Amount = None
    beta: Amount = None
    argument: Amount = None
    begin: Amount = None
    attitude: str | None = None
    faces: dict[str, str | list[str]] | None = None
    orbits: Annotated[float, Field(strict=True, gt=0.0)] | None = None


class ScenarioFile(StrictTable):
    """What is done to a model."""

    fault: ClassVar[type[ThermidError]] = ScenarioError

    title: str = ""
    boundaries: dict[str, SignalField] = {}
    loads: dict[str, SignalField] = {}
    commands: dict[str, SignalField] = {}
    gains: dict[str, str] = {}
    schedule: dict[str, SignalField] = {}
    prescribed: dict[str, SignalField] = {}
    environment: dict[str, GasTable] = {}
    irradiation: dict[str, FallingTable] = {}
    start: Amount = ""
    initial: dict[str, Amount] = {}
    duration: Amount = 0.0
    as_printed: Flag = False
    site: SiteTable | None = None
    weather: WeatherTable | None = None
    sun: SunTable | None = None
    wind: dict[str, WindTable] | None = None
    ascent: AscentTable | None = None
    orbit: OrbitTable | None = None
