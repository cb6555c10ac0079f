"""A day on the pad as a scenario: weather as the open air, sun and sky on every outer surface, wind and rain as coefficients."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from datetime import datetime
from typing import Any

import numpy as np

from thermid.base.arguments import takes_objects
from thermid.base.errors import ScenarioError
from thermid.base.expression import amount
from thermid.base.linear_algebra import Array
from thermid.base.units import TEMPERATURE
from thermid.model.elements import Constant, Facing, MeanOf, Mixed, Signal, TableSignal, degrees, literal, signal
from thermid.physics.air import dew_point, dry_air, vapour_pressure
from thermid.physics.constants import STEFAN_BOLTZMANN
from thermid.physics.correlations import forced_plate_nusselt
from thermid.simulation.network import Environment
from thermid.simulation.runs import Scenario
from thermid.site.exposure import cloudless_sky, driving_rain, sky_share
from thermid.site.site import Site
from thermid.site.sky import open_sky
from thermid.site.weather import Weather

WIND = ("length", "calm", "rain")
"""What a coefficient in wind is given by."""
WATER = 1000.0 * 4186.0
"""Heat that a cubic metre of rain takes up per kelvin. [J/(m^3 K)]"""


@takes_objects
def pad_scenario(
    site: Site | None = None,
    weather: Weather | None = None,
    *,
    begin: str | datetime | None = None,
    duration: str | float | None = None,
    air: str = "ambient",
    air_temperature: Any = None,
    sun: bool = True,
    sky: bool | Mapping[str, float] = True,
    albedo: float = 0.2,
    turbidity: float | None = None,
    wind: Mapping[str, Mapping[str, Any]] | None = None,
    **others: Any,
) -> Scenario:
    """Return the scenario of a time on the pad.

    Parameters
    ----------
    site : Site             The place; by default what the weather file says of it.
    weather : Weather       By default a sky without clouds; the air then has `air_temperature`.
    begin : str             An instant, in the site's standard time where it names no zone; the weather's beginning by default.
    duration : str, float   The weather's by default. [s]
    air : str               The boundary that is the open air.
    air_temperature : Signal   In place of the weather's dry bulb. [K]
    sun : bool              Whether surfaces outdoors meet the sun.
    sky : bool or dict      Whether they meet a sky colder than the air. For surfaces that radiate to a boundary of their own: boundary ->
                            tilt; it gets the temperature of what a surface of that tilt sees, sky and ground. [deg]
    albedo : float          Of the ground. [-]
    turbidity : float       Of a sky without clouds, as in `Site.clear_sky`. [-]
    wind : dict             A coefficient from a correlation feels the weather's wind; a fixed one follows it if it stands here, with
                            ``length`` of its surface along the wind [m], ``calm`` value [W/(m^2 K)], and ``rain``: roof or wall, as
                            `wind_htc` says.
    others                  Fields of `Scenario`: title (pad by default), start (the air by default), loads, boundaries, schedule,
                            environment, irradiation.

    Raises
    ------
    ScenarioError   When there is no site, no instant or no temperature of the air.
    RecordError     When the weather does not cover the time.
    """
    title = others.pop("title", "pad")
    place = site or _place(weather, title)
    weather, seconds, instant = _begun(place, weather, begin, duration, title)
    temperature = _temperature(weather, air_temperature, title, air)
    downward = _downward(weather, temperature) if sky else None
    boundaries = {air: temperature, **others.pop("boundaries", {})}
    if isinstance(sky, Mapping) and downward is not None:
        for name, tilt in sky.items():
            view = SkyAndAir(float(sky_share(Facing(degrees(tilt, f"{title}, sky")).tilt)))
            boundaries[name] = Mixed(view, (downward, temperature))
        downward = None
    falling: dict[str, Any] = {}
    if sun or downward is not None:
        if instant is None:
            raise ScenarioError(
                "the sun needs a date and time. Give begin = '2026-03-21 06:00', or read the weather with its beginning.",
                title,
                code="value.incomplete",
            )
        falling["*"] = open_sky(place, instant, seconds, weather, downward, air, albedo, turbidity, sun)
    coefficients = {p: _coefficient(weather, temperature, t, place.pressure, f"{title}, wind.{p}") for p, t in (wind or {}).items()}
    return Scenario(
        title=title,
        duration=seconds,
        start=others.pop("start", air),
        boundaries=boundaries,
        environment={air: _environment(place, weather, seconds), **others.pop("environment", {})},
        irradiation=falling | others.pop("irradiation", {}),
        schedule=coefficients | others.pop("schedule", {}),
        **others,
    )


def _downward(weather: Weather | None, air: Signal) -> Signal:
    """Return the long-wave radiation of the sky: measured, or from dew point and clouds. [W/m^2]"""
    if weather is not None and "infrared" in weather:
        return TableSignal(*weather["infrared"])
    if weather is None or not {"dew_point", "humidity"} & set(weather.series):
        raise ScenarioError(
            "the sky temperature needs infrared, dew_point or humidity, but the weather has none of them. Give one, or sky = false.",
            weather.name if weather is not None else "pad",
            code="value.incomplete",
        )
    wet = "dew_point" if "dew_point" in weather else "humidity"
    cloud = TableSignal(*weather["cloud"]) if "cloud" in weather else Constant(0.0)
    return Mixed(Glow(wet == "humidity"), (TableSignal(*weather[wet]), cloud, air))


@dataclass(frozen=True)
class Glow:
    """Long-wave radiation of the sky from dew point, or `relative` humidity, clouds and the temperature of the air."""

    relative: bool

    def __call__(self, wet: Array, cloud: Array, kelvin: Array) -> Array:
        """Return the radiation on the horizontal (times,). [W/m^2]"""
        dew = dew_point(vapour_pressure(kelvin, np.maximum(wet, 0.01))) if self.relative else wet
        return np.asarray(cloudless_sky(dew, cloud) * STEFAN_BOLTZMANN * kelvin**4)


@dataclass(frozen=True)
class SkyAndAir:
    """The temperature that a surface sees, a `share` of sky and the rest as warm as the air. [-]"""

    share: float

    def __call__(self, downward: Array, kelvin: Array) -> Array:
        """Return the temperature (times,). [K]"""
        return np.asarray((self.share * downward / STEFAN_BOLTZMANN + (1.0 - self.share) * kelvin**4) ** 0.25)


def wind_htc(speed: Any, length: float, temperature: Any, pressure: float, calm: float = 0.0) -> Array:
    """Return the convection coefficient of a surface in wind, joined to that of calm air by cubes [W/(m^2 K)].

    Parameters
    ----------
    speed : array           Along the surface. [m/s]
    length : float          Along the wind. [m]
    temperature : array     Of the air. [K]
    pressure : float        [Pa]
    calm : float            Coefficient without wind. [W/(m^2 K)]

    References
    ----------
    `forced_plate_nusselt` (Incropera, 6th ed., Eqs. 7.30 and 7.38), Churchill's third power for assisting streams.

    Examples
    --------
    >>> float(wind_htc(5.0, 1.0, 300.0, 101325.0).round(1))
    8.8
    """
    speeds, kelvin = np.broadcast_arrays(np.asarray(speed, dtype=float), np.asarray(temperature, dtype=float))
    out = np.empty(speeds.shape)
    for k in np.ndindex(speeds.shape):
        gas = dry_air(float(kelvin[k]), pressure)
        reynolds = float(speeds[k]) * length / float(gas.kinematic_viscosity)
        forced = float(forced_plate_nusselt(reynolds, float(gas.prandtl))) * float(gas.conductivity) / length
        out[k] = (forced**3 + calm**3) ** (1.0 / 3.0)
    return out


def _coefficient(weather: Weather | None, air: Signal, table: Mapping[str, Any], pressure: float, where: str) -> Signal:
    """Return a coefficient that follows wind, and rain that leaves as warm as the wall. [W/(m^2 K)]"""
    if weather is None or "wind" not in weather:
        raise ScenarioError(
            "coefficients follow the wind, but the weather has no wind. Give a column of it, or fixed coefficients.",
            where,
            code="value.incomplete",
        )
    unknown = set(table) - set(WIND)
    if unknown or not {"length", "calm"} <= set(table):
        raise ScenarioError(
            "give a coefficient in wind length and calm, and rain = 'roof' or 'wall' if it gets wet.", where, code="value.incomplete"
        )
    length, calm = literal(table["length"], "m", where), literal(table["calm"], "W/(m^2 K)", where)
    if not (length > 0.0 and calm >= 0.0):
        raise ScenarioError(
            "the length along the wind must be above zero, and the calm coefficient zero or more.", where, code="value.outside-range"
        )
    wet = table.get("rain", "")
    if wet not in ("", "roof", "wall"):
        raise ScenarioError(f"rain falls on a 'roof' or is driven on a 'wall', not on a '{wet}'.", where, code="value.wrong-kind")
    fall = TableSignal(*weather["rain"]) if wet else Constant(0.0)
    # straight between the rows of the weather: a correlation is no better than that
    return Mixed(Swept(length, pressure, calm, wet), (TableSignal(*weather["wind"]), air, fall), math.inf)


@dataclass(frozen=True)
class Swept:
    """A coefficient that follows wind, and rain on a roof or a wall; as in `wind_htc`."""

    length: float
    pressure: float
    calm: float
    wet: str

    def __call__(self, speed: Array, kelvin: Array, fall: Array) -> Array:
        """Return the coefficient (times,). [W/(m^2 K)]"""
        values = wind_htc(speed, self.length, kelvin, self.pressure, self.calm)
        if not self.wet:
            return values
        return np.asarray(values + WATER * (fall if self.wet == "roof" else driving_rain(fall, speed)))


def _place(weather: Weather | None, title: str) -> Site:
    """Return the site that a weather file names."""
    place = weather.place if weather is not None else {}
    if not {"latitude", "longitude"} <= set(place):
        raise ScenarioError(
            "the place is missing. Give a Site with latitude and longitude; only EPW and TMY3 files contain them.",
            title,
            code="value.incomplete",
        )
    return Site(
        place["latitude"],
        place["longitude"],
        place.get("altitude", 0.0),
        place.get("timezone"),
        weather.name if weather is not None else title,
    )


def _temperature(weather: Weather | None, temperature: Any, title: str, air: str) -> Signal:
    """Return the temperature of the air: as given, or the weather's dry bulb. [K]"""
    if temperature is not None:
        return signal(temperature, TEMPERATURE, f"{title}, air_temperature")
    if weather is None or "dry_bulb" not in weather:
        raise ScenarioError(
            f"the temperature of the air '{air}' is missing. Give weather with dry_bulb, or air_temperature.",
            title,
            code="value.incomplete",
        )
    return TableSignal(*weather["dry_bulb"])


def _environment(site: Site, weather: Weather | None, seconds: float) -> Environment:
    """Return the state of the open air: its wind, and pressure and humidity as means, since no coefficient feels how weather moves them."""
    if weather is None:
        return Environment(Constant(site.pressure))
    means = {k: MeanOf(TableSignal(*weather[k]), seconds) for k in ("pressure", "humidity") if k in weather}
    wind = TableSignal(*weather["wind"]) if "wind" in weather else Constant(0.0)
    humidity = means["humidity"].value if "humidity" in means else None
    return Environment(means.get("pressure", Constant(site.pressure)), humidity, wind=wind)


def _begun(place: Site, weather: Weather | None, begin: Any, duration: Any, title: str) -> tuple[Weather | None, float, Any]:
    """Return the weather from an instant on, how long the run lasts [s], which must be given without weather, and the instant."""
    if weather is None:
        if duration is None:
            raise ScenarioError("the duration is missing. Give one, such as duration = '12 [h]'.", title, code="value.incomplete")
        return None, amount(duration, "s", f"{title}, duration"), begin
    # a time of day without zone is meant in the site's
    zoned = None if weather.begin is None else place.instant(weather.begin)
    if zoned is not None and place.timezone is not None:
        zoned = zoned.astimezone(place.zone)
    cut, seconds = replace(weather, begin=zoned).begun(begin, duration)
    return cut, seconds, begin if cut.begin is None else cut.begin
