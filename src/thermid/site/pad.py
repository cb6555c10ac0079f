"""A day on the pad as a scenario: weather as the open air, sun and sky on every outer surface, wind and rain as coefficients.

Sun and sky over a site for a time: beam and diffuse radiation, the sun's path, what the sky sends down.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from typing import Any

import numpy as np

from thermid.base.arguments import guard_methods
from thermid.base.errors import ScenarioError
from thermid.base.results import Shown
from thermid.base.units import STEFAN_BOLTZMANN, TEMPERATURE, Array, amount
from thermid.model.tree import Constant, Facing, MeanOf, Mixed, Signal, TableSignal, degrees, literal, signal
from thermid.physics.air import dew_point, dry_air, vapour_pressure
from thermid.physics.correlations import forced_plate_nusselt
from thermid.simulation.runs import Environment, Scenario, Sky
from thermid.site.exposure import cloudless_sky, driving_rain, on_plane, sky_share
from thermid.site.site import Site, Weather, ignore_future_warnings

SUN_INTERVAL = 600.0
"""Interval at which the sun's path is worked out: it moves by 2.5 degrees. [s]"""
LOW_SUN = 87.0
"""Beyond this zenith a beam is not divided out of a horizontal reading. [deg]"""
NIGHT_ZENITH, TWILIGHT_RADIATION = 95.0, 20.0
"""Zenith of the sun from which it is night, and radiation that nobody reads then. [deg], [W/m^2]"""
BRIGHTEST = 1412.0
"""Of the sun above the air, in January; no beam that is worked out from other readings is brighter. [W/m^2]"""


@guard_methods
@dataclass(frozen=True, eq=False)
class OpenSky(Shown, Sky):
    """Sun and sky over a place: falls on every surface outdoors as the surface faces it.

    Parameters
    ----------
    times : array (samples,)                            From the start of the scenario. [s]
    direct_normal, diffuse, total : array (samples,)    Beam, and diffuse and global on the horizontal. [W/m^2]
    zenith, azimuth : array (samples,)                  Of the sun. [deg]
    downward : Signal or None                           Long-wave radiation on the horizontal; None where none is counted. [W/m^2]
    air : str                                           The boundary that is the open air; the ground is as warm as it.
    albedo : float                                      Of the ground. [-]
    path : Overhead or None                             What works the same sky out for a run that begins at another time.
    """

    times: Array
    direct_normal: Array
    diffuse: Array
    total: Array
    zenith: Array
    azimuth: Array
    downward: Signal | None
    air: str
    albedo: float = 0.2
    path: Overhead | None = None

    def __post_init__(self) -> None:
        """Refuse a ground that does not exist."""
        if not 0.0 <= self.albedo <= 1.0:
            raise ScenarioError(f"the albedo is {self.albedo:g}. Give 0 to 1.", "sun", code="value.outside-range")

    @property
    def radiates(self) -> bool:
        """Whether its long-wave radiation is counted."""
        return self.downward is not None

    def signals(self) -> dict[str, Signal]:
        """Return what changes, or may change, by name."""
        beam = TableSignal(self.times, self.direct_normal)
        return {"sun": beam} | ({"downward": self.downward} if self.downward is not None else {})

    def mapped(self, law: Callable[[Signal], Signal]) -> OpenSky:
        """Return the sky with what a law makes of its signals; the sun keeps its path."""
        return replace(self, downward=None if self.downward is None else law(self.downward))

    def shifted(self, seconds: float) -> OpenSky:
        """Return the sky from a time on: worked out anew where its path is known, else moved in time."""
        if self.path is not None:
            return self.path.sky(seconds)
        return replace(self.mapped(lambda s: s.shifted(seconds)), times=self.times - seconds)

    def sun(self, facing: Facing | None) -> Signal | None:
        """Return the solar radiation on a surface. [W/m^2]"""
        where = facing or Facing(0.0)
        parts = (self.zenith, self.azimuth, self.direct_normal, self.diffuse, self.total)
        return TableSignal(self.times, on_plane(where.tilt, where.azimuth, *parts, self.albedo))

    def longwave(self, facing: Facing | None, around: Signal | None) -> Signal | None:
        """Return what the sky sends less than surroundings as warm as the air. [W/m^2]"""
        if self.downward is None or around is None:
            return None
        return Mixed(Received(sky_share((facing or Facing(0.0)).tilt)), (self.downward, around))


@dataclass(frozen=True)
class Received:
    """What the sky sends a surface less than surroundings as warm as the air; `share` of the view is sky. [-]"""

    share: float

    def __call__(self, downward: Array, around: Array) -> Array:
        """Return share (downward - sigma T^4) (times,). [W/m^2]"""
        return self.share * (downward - STEFAN_BOLTZMANN * around**4)


def open_sky(
    site: Site,
    begin: str | datetime | None,
    duration: float,
    weather: Weather | None = None,
    downward: Signal | None = None,
    air: str = "ambient",
    albedo: float = 0.2,
    turbidity: float | None = None,
    sun: bool = True,
) -> OpenSky:
    """Return sun and sky over a site for a time; without radiation in the weather, a sky without clouds.

    Parameters
    ----------
    site, begin, weather, air, albedo, turbidity, sun    As in `pad_scenario`.
    duration : float    [s]
    downward : Signal   Long-wave radiation from the sky on the horizontal; None where none is counted. [W/m^2]

    Raises
    ------
    ScenarioError   When nothing says the instant, or the weather has no radiation although it is weather: half a day of clouds is not to
                    be guessed.
    """
    if begin is None:
        text = "the sun needs a date and time. Give begin = '2026-03-21 06:00', or read the weather with its beginning."
        raise ScenarioError(text, "pad", code="value.incomplete")
    times = np.linspace(0.0, duration, max(int(np.ceil(duration / SUN_INTERVAL)), 1) + 1)
    path = site.sun(begin, times)
    again = Overhead(site, site.instant(begin), duration, weather, downward, air, albedo, turbidity, sun)
    if not sun:
        none = np.zeros(times.shape)
        return OpenSky(times, none, none, none, path.zenith, path.azimuth, downward, air, albedo, again)
    if weather is None:
        clear = site.clear_sky(begin, times, turbidity)
        beam, diffuse, total = clear["direct_normal"], clear["diffuse"], clear["global"]
    else:
        beam, diffuse, total = _radiation(weather, site, begin, times, path.zenith)
    return OpenSky(times, beam, diffuse, total, path.zenith, path.azimuth, downward, air, albedo, again)


@dataclass(frozen=True, eq=False)
class Overhead:
    """What an open sky was made of, so that it can be worked out for a run that begins later; fields as in `open_sky`."""

    site: Site
    begin: datetime
    duration: float
    weather: Weather | None
    downward: Signal | None
    air: str
    albedo: float
    turbidity: float | None
    sun: bool

    def sky(self, seconds: float) -> OpenSky:
        """Return the sky of a run that begins later. [s]

        Raises
        ------
        RecordError   When the weather does not cover it.
        """
        weather = None if self.weather is None else self.weather.begun(seconds, self.duration)[0]
        downward = None if self.downward is None else self.downward.shifted(seconds)
        later = self.begin + timedelta(seconds=seconds)
        return open_sky(self.site, later, self.duration, weather, downward, self.air, self.albedo, self.turbidity, self.sun)


def _radiation(weather: Weather, site: Site, begin: Any, times: Array, zenith: Array) -> tuple[Array, Array, Array]:
    """Return direct normal, diffuse and global irradiance (samples,) from any two, or from global alone. [W/m^2]

    global = direct cos(zenith) + diffuse. From global alone by Erbs' model (pvlib). `zenith` in degrees.

    Raises
    ------
    ScenarioError   When the weather has neither global nor both direct and diffuse, or sun at night.
    """
    _check_night(weather, site, begin, float(times[-1]))
    have = {
        k: TableSignal(*weather[k]).within(times, f"{weather.name}, {k}") for k in ("direct_normal", "diffuse", "global") if k in weather
    }
    up = np.maximum(np.cos(np.radians(zenith)), 0.0)
    if {"direct_normal", "diffuse"} <= set(have):
        return have["direct_normal"], have["diffuse"], have.get("global", have["diffuse"] + have["direct_normal"] * up)
    if {"global", "diffuse"} <= set(have):
        beam = np.maximum(have["global"] - have["diffuse"], 0.0) / np.maximum(up, np.cos(np.radians(LOW_SUN)))
        return np.where(zenith < 90.0, np.minimum(beam, BRIGHTEST), 0.0), have["diffuse"], have["global"]
    if {"global", "direct_normal"} <= set(have):
        return have["direct_normal"], np.maximum(have["global"] - have["direct_normal"] * up, 0.0), have["global"]
    if "global" in have:
        from pvlib import irradiance

        with ignore_future_warnings():
            parts = irradiance.erbs(have["global"], zenith, site.instants(begin, times), max_zenith=LOW_SUN)
        return np.minimum(np.asarray(parts["dni"], dtype=float), BRIGHTEST), np.asarray(parts["dhi"], dtype=float), have["global"]
    raise ScenarioError(
        "the weather has no global radiation, nor beam and diffuse: give such a column, or sun = false.",
        weather.name,
        code="value.incomplete",
    )


def _check_night(weather: Weather, site: Site, begin: Any, duration: float) -> None:
    """Refuse weather with more sun than there is, at night above all: its clock, or the site, is another.

    Above the horizon 1.3 cos(zenith) `BRIGHTEST` at most (of direct sun without the cosine), since clouds at the sun's rim may throw a
    third more on a place, and five times `TWILIGHT_RADIATION`; once below `NIGHT_ZENITH` that. [W/m^2] Samples between 0 and `duration`
    [s] count.

    Raises
    ------
    ScenarioError   Names the first hour with more, and how high the sun stands then.
    """
    for name in ("direct_normal", "diffuse", "global"):
        if name in weather:
            inside = (weather[name].times > 0.0) & (weather[name].times < duration)
            times, values = (column[inside] for column in weather[name])
            zenith = site.sun(begin, times).zenith
            above = np.maximum(np.cos(np.radians(zenith)), 0.0) if name != "direct_normal" else np.ones(zenith.shape)
            # clouds at the sun's rim may throw a third more on a place than comes from above the air
            most = np.where(zenith > NIGHT_ZENITH, TWILIGHT_RADIATION, 5.0 * TWILIGHT_RADIATION + 1.3 * BRIGHTEST * above)
            wrong = np.flatnonzero(values > most)
            if wrong.size:
                k = wrong[0]
                height = 90.0 - zenith[k]
                stands = f"{abs(height):.0f} degrees {'above' if height > 0 else 'below'} the horizon"
                raise ScenarioError(
                    f"{name} is {values[k]:.0f} W/m^2 {times[k] / 3600:.4g} h after {begin}, when the sun stands {stands}. "
                    "Check the time zone, latitude and longitude.",
                    weather.name,
                    code="value.contradicts",
                )


WIND = ("length", "calm", "rain")
"""What a coefficient in wind is given by."""
WATER = 1000.0 * 4186.0
"""Heat that a cubic metre of rain takes up per kelvin. [J/(m^3 K)]"""


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
    others                  Fields of `Scenario`: title (pad), start (the air), loads, boundaries, schedule, environment, irradiation.

    Raises
    ------
    ScenarioError   When there is no site, no instant or no temperature of the air.
    RecordError     When the weather does not cover the time.
    """
    title = others.pop("title", "pad")
    place = site or _place(weather, title)
    weather, seconds, instant = _begun(place, weather, begin, duration, title)
    temperature = _temperature(weather, air_temperature, title, air)
    radiation = _downward(weather, temperature) if sky else None
    downward = None if isinstance(sky, Mapping) else radiation
    boundaries = {air: temperature, **others.pop("boundaries", {}), **_seen_by_tilts(sky, radiation, temperature, title)}
    above = {"*": open_sky(place, instant, seconds, weather, downward, air, albedo, turbidity, sun)} if sun or downward is not None else {}
    coefficients = {p: _coefficient(weather, temperature, t, place.pressure, f"{title}, wind.{p}") for p, t in (wind or {}).items()}
    return Scenario(
        title=title,
        duration=seconds,
        start=others.pop("start", air),
        boundaries=boundaries,
        environment={air: _environment(place, weather, seconds), **others.pop("environment", {})},
        irradiation=above | others.pop("irradiation", {}),
        schedule=coefficients | others.pop("schedule", {}),
        **others,
    )


def _seen_by_tilts(tilts: bool | Mapping[str, float], radiation: Signal | None, air: Signal, title: str) -> dict[str, Mixed]:
    """Return boundary -> the temperature of what a surface of its tilt [deg] sees, sky and ground; nothing without tilts."""
    if not isinstance(tilts, Mapping) or radiation is None:
        return {}
    views = {name: SkyAndAir(float(sky_share(Facing(degrees(tilt, f"{title}, sky")).tilt))) for name, tilt in tilts.items()}
    return {name: Mixed(view, (radiation, air)) for name, view in views.items()}


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
    """Return the convection coefficient of a surface in wind, (h_forced^3 + h_calm^3)^(1/3), of the arguments' common shape. [W/(m^2 K)]

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
