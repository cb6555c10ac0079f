"""Sun and sky over a site for a time: beam and diffuse radiation, the sun's path, what the sky sends down."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from typing import Any

import numpy as np

from thermid.base.arguments import guard_methods
from thermid.base.errors import ScenarioError
from thermid.base.linear_algebra import Array
from thermid.base.results import Shown
from thermid.model.tree import Facing, Mixed, Signal, TableSignal
from thermid.physics.constants import STEFAN_BOLTZMANN
from thermid.simulation.runs import Sky
from thermid.site.exposure import on_plane, sky_share
from thermid.site.site import Site, ignore_future_warnings
from thermid.site.weather import Weather

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
        share = sky_share((facing or Facing(0.0)).tilt)
        return Mixed(Received(share), (self.downward, around))


@dataclass(frozen=True)
class Received:
    """What the sky sends a surface less than surroundings as warm as the air; `share` of the view is sky. [-]"""

    share: float

    def __call__(self, downward: Array, around: Array) -> Array:
        """Return share (downward - sigma T^4) (times,). [W/m^2]"""
        return self.share * (downward - STEFAN_BOLTZMANN * around**4)


def open_sky(
    site: Site,
    begin: str | datetime,
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
    ScenarioError   When the weather has no radiation although it is weather: half a day of clouds is not to be guessed.
    """
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
    """Refuse weather with more sun than there is, at night above all: its clock, or the site, is another."""
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
