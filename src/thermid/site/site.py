"""`Site`: a place on earth, its sun and its clear sky."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import (
    datetime,
    timedelta,
    timezone as Zone,  # noqa: N812
)
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from thermid.base.errors import ScenarioError, ThermidError
from thermid.base.expression import amount, seconds
from thermid.base.extensions import optional
from thermid.base.linear_algebra import Array
from thermid.model.tree import degrees
from thermid.site._atmosphere import standard_atmosphere

if TYPE_CHECKING:
    import pandas


class SunPath(NamedTuple):
    """The sun over a site: times (samples,) [s], zenith and azimuth from north over east (samples,) [deg]."""

    times: Array
    zenith: Array
    azimuth: Array


@dataclass(frozen=True)
class Site:
    """A place on earth.

    Parameters
    ----------
    latitude : float    North is positive. [deg]
    longitude : float   East is positive. [deg]
    altitude : float    Above the sea; a number or a text with unit. [m]
    timezone : float    Standard time less universal time; None where every instant names its own zone. [h]
    name : str          What it is called.

    Raises
    ------
    ScenarioError   When there is no such place.
    """

    latitude: float
    longitude: float
    altitude: Any = 0.0
    timezone: float | None = None
    name: str = "site"

    def __post_init__(self) -> None:
        """Turn texts into numbers, and refuse places that are not on earth."""
        for field, limit in (("latitude", 90.0), ("longitude", 180.0)):
            try:
                value = degrees(getattr(self, field))
            except ThermidError as error:
                raise ScenarioError(error.message, f"{self.name}, {field}") from None
            object.__setattr__(self, field, value)
            if not -limit <= value <= limit:
                raise ScenarioError(
                    f"a {field} of {value:g} degrees is not on earth; give -{limit:g} to {limit:g}.", self.name, code="value.outside-range"
                )
        object.__setattr__(self, "altitude", amount(self.altitude, "m", f"{self.name}, altitude"))
        if self.timezone is not None:
            object.__setattr__(self, "timezone", amount(self.timezone, "1", f"{self.name}, timezone"))
        if not -450.0 <= self.altitude <= 9000.0:
            raise ScenarioError(f"a site at {self.altitude:g} m is not on the ground.", self.name, code="value.outside-range")
        if self.timezone is not None and not -12.0 <= self.timezone <= 14.0:
            raise ScenarioError(f"a time zone of {self.timezone:g} h does not exist.", self.name, code="value.outside-range")

    @property
    def zone(self) -> Zone:
        """Its standard time.

        Raises
        ------
        ScenarioError   When nobody said which it is.
        """
        if self.timezone is None:
            raise ScenarioError(
                "the time zone is missing. Give the site's timezone in hours, or instants with a zone: 2026-03-21 06:00-03:00.",
                self.name,
                code="value.incomplete",
            )
        return Zone(timedelta(hours=self.timezone))

    @property
    def pressure(self) -> float:
        """Pressure of the standard atmosphere at its altitude. [Pa]"""
        return float(standard_atmosphere(self.altitude).pressure)

    def instant(self, begin: str | datetime) -> datetime:
        """Return an instant with its time zone; the site's standard time where the text names none.

        Raises
        ------
        ScenarioError   When the text is no instant.
        """
        try:
            instant = begin if isinstance(begin, datetime) else datetime.fromisoformat(begin)
        except (TypeError, ValueError):
            raise ScenarioError(
                f"'{begin!s:.60}' is not a date and time. Write it as 2026-03-21 06:00.", self.name, code="value.wrong-kind"
            ) from None
        return instant if instant.tzinfo is not None else instant.replace(tzinfo=self.zone)

    def sun(self, begin: str | datetime, times: Any) -> SunPath:
        """Return where the sun stands.

        Parameters
        ----------
        begin : str, datetime       The instant of time zero.
        times : array (samples,)    [s]

        References
        ----------
        The algorithm of Reda and Andreas, Solar Energy 76 (2004) 577, as pvlib has it, with refraction.
        """
        pvlib = optional("pvlib", "the path of the sun", "site")
        clock = np.atleast_1d(seconds(times))
        with ignore_future_warnings():
            position = pvlib.solarposition.get_solarposition(
                self.instants(begin, clock), self.latitude, self.longitude, altitude=self.altitude, method="nrel_numpy"
            )
        return SunPath(clock, position["apparent_zenith"].to_numpy(float), position["azimuth"].to_numpy(float))

    def clear_sky(self, begin: str | datetime, times: Any, turbidity: float | None = None) -> dict[str, Array]:
        """Return direct_normal, diffuse and global (samples,) of a sky without clouds. [W/m^2]

        Parameters
        ----------
        begin, times        As in `sun`.
        turbidity : float   Linke's; by default the monthly map that pvlib brings. [-]

        References
        ----------
        Ineichen and Perez, Solar Energy 73 (2002) 151, by pvlib.
        """
        pvlib = optional("pvlib", "the path of the sun", "site")
        place = pvlib.location.Location(self.latitude, self.longitude, altitude=self.altitude)
        index = self.instants(begin, np.atleast_1d(seconds(times)))
        options = {} if turbidity is None else {"linke_turbidity": turbidity}
        try:
            with ignore_future_warnings():
                sky = place.get_clearsky(index, **options)
        except ImportError:
            raise ScenarioError(
                "the map of turbidity needs h5py; install it, or give turbidity = 3.", self.name, code="extra.not-installed"
            ) from None
        return {
            "direct_normal": sky["dni"].to_numpy(float),
            "diffuse": sky["dhi"].to_numpy(float),
            "global": sky["ghi"].to_numpy(float),
        }

    def instants(self, begin: str | datetime, seconds: Array) -> pandas.DatetimeIndex:
        """Return times from an instant as universal time."""
        import pandas

        first = pandas.Timestamp(self.instant(begin)).tz_convert("UTC")
        return pandas.DatetimeIndex(first + pandas.to_timedelta(seconds, unit="s"))


@contextmanager
def ignore_future_warnings() -> Iterator[None]:
    """Keep to itself what pvlib should hear about the future of pandas: a user can do nothing about it."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        warnings.simplefilter("ignore", FutureWarning)
        yield
