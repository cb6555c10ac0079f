"""`Site`: a place on earth, its sun and its clear sky.

Weather of a place from an EPW or TMY3 file or a plain table, checked for holes and for values that do not exist.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from datetime import (
    datetime,
    timedelta,
    timezone as Zone,  # noqa: N812
)
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from thermid.base.errors import (
    MissingDataError,
    NameNotFoundError,
    RecordError,
    ScenarioError,
    ThermidError,
    optional,
    refuse_first,
    refuse_unknown,
)
from thermid.base.files import was_read
from thermid.base.results import Named
from thermid.base.units import HOUR, TEMPERATURE, Array, amount, from_si, seconds, unit
from thermid.measure.readers import read_plain
from thermid.model.tree import degrees
from thermid.site._atmosphere import standard_atmosphere
from thermid.site._constants import EPW, TMY3

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
        refuse_first(
            self.name,
            (not -450.0 <= self.altitude <= 9000.0, f"a site at {self.altitude:g} m is not on the ground.", "value.outside-range"),
            (
                self.timezone is not None and not -12.0 <= self.timezone <= 14.0,
                f"a time zone of {self.timezone or 0.0:g} h does not exist.",
                "value.outside-range",
            ),
            error=ScenarioError,
        )

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


RADIATION: Final = ("direct_normal", "diffuse", "global", "infrared")
RANGES: Final = {
    "dry_bulb": (183.15, 343.15, "degC"),
    "dew_point": (173.15, 343.15, "degC"),
    "humidity": (0.0, 1.0, "%"),
    "pressure": (3.0e4, 1.2e5, "Pa"),
    "wind": (0.0, 113.0, "m/s"),
    "wind_direction": (0.0, 360.0, "degrees"),
    "direct_normal": (0.0, 1500.0, "W/m^2"),
    "diffuse": (0.0, 1500.0, "W/m^2"),
    "global": (0.0, 1700.0, "W/m^2"),
    "infrared": (0.0, 800.0, "W/m^2"),
    "cloud": (0.0, 1.0, "%"),
    "rain": (0.0, 5.6e-4, "mm/h"),
}
"""Values beyond the records of the World Meteorological Organization, or that do not exist. [SI]"""
MIN_NIGHT_READING: Final = -15.0
"""A radiometer at night reads down to this; what is below zero and above it is taken as zero. [W/m^2]"""
QUANTITIES: Final = {
    "dry_bulb": TEMPERATURE,
    "dew_point": TEMPERATURE,
    "humidity": "1",
    "pressure": "Pa",
    "wind": "m/s",
    "wind_direction": "1",
    "direct_normal": "W/m^2",
    "diffuse": "W/m^2",
    "global": "W/m^2",
    "infrared": "W/m^2",
    "cloud": "1",
    "rain": "m/s",
}
"""Quantity -> its unit: air, wind, radiation on the horizontal (`direct_normal` on a plane that follows the sun)."""
USUAL: Final = {"dry_bulb": "degC", "dew_point": "degC", "humidity": "%", "cloud": "%", "rain": "mm/h"}
"""Units of a table's columns whose header names none; SI otherwise."""


class WeatherSeries(NamedTuple):
    """One quantity over time: times (samples,) from its beginning [s], and values (samples,) [SI]."""

    times: Array
    values: Array


@dataclass(frozen=True, eq=False)
class Weather(Named[WeatherSeries]):
    """What the weather was, or in a typical year is.

    Parameters
    ----------
    name : str              The file's, or what made it.
    begin : datetime        The instant of time zero; without time zone it is the site's standard time. None where only seconds are known.
    series : dict           Quantity -> times and values; see `QUANTITIES`.
    place : dict            latitude and longitude [deg], altitude [m], timezone [h], as far as the file says.
    filled : tuple of str   Holes that straight lines bridge, in words.
    notes : tuple of str    What else a reader must know.
    """

    name: str
    begin: datetime | None
    series: Mapping[str, WeatherSeries]
    place: Mapping[str, float]
    filled: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    _refusal = "no '{}'. It has {known}."

    def _entries(self) -> Mapping[str, WeatherSeries]:
        """Return quantity -> its times and values."""
        return self.series

    @property
    def duration(self) -> float:
        """Time that every quantity covers, from time zero. [s]"""
        return float(min(s.times[-1] for s in self.series.values()))

    def window(self, begin: str | datetime | None = None, duration: str | float | None = None) -> Weather:
        """Return a stretch of the weather with times from its beginning.

        Parameters
        ----------
        begin : str             ``2026-03-21 06:00``, ``03-21 06:00`` in the year of the file, or ``3600 [s]`` from its beginning.
        duration : str, float   To the end of the file by default. [s]

        Raises
        ------
        RecordError   When the weather does not cover it.
        """
        later, length = self.begun(begin, duration)
        cut = {}
        for name, s in later.series.items():
            times = np.concatenate(([0.0], s.times[(s.times > 0.0) & (s.times < length)], [length]))
            cut[name] = WeatherSeries(times, np.interp(times, s.times, s.values))
        return replace(later, series=cut)

    def begun(self, begin: str | float | datetime | None = None, duration: str | float | None = None) -> tuple[Weather, float]:
        """Return the weather with times from an instant, nothing of it cut, and the time that is asked for from there. [s]

        Parameters
        ----------
        begin : str, float      As in `window`; a number is in seconds from its beginning.
        duration : str, float   To the end of the file by default. [s]

        Raises
        ------
        RecordError   When the weather does not cover it.
        """
        first = 0.0 if begin is None else float(begin) if isinstance(begin, int | float) else self._seconds(begin)
        covered = max(float(s.times[0]) for s in self.series.values()), self.duration
        length = covered[1] - first if duration is None else amount(duration, "s", self.name)
        if not (covered[0] - 1.0 <= first and first + length <= covered[1] + 1.0 and length > 0.0):
            raise RecordError(
                f"it covers {self._stamp(covered[0])} to {self._stamp(covered[1])}, "
                f"not {self._stamp(first)} and {length / 3600:.4g} h more.",
                self.name,
                code="record.not-overlapping",
            )
        moved = {name: WeatherSeries(s.times - first, s.values) for name, s in self.series.items()}
        # instants are written to the second
        length = min(length, covered[1] - first)
        return replace(self, begin=None if self.begin is None else self.begin + timedelta(seconds=first), series=moved), length

    def _seconds(self, begin: str | datetime) -> float:
        """Return an instant as seconds from the weather's beginning; a time of day without a zone is in the zone of the weather. [s]

        Raises
        ------
        RecordError   When the weather has no date, or no zone for an instant that has one.
        """
        if isinstance(begin, str) and "[" in begin:
            return amount(begin, "s", self.name)
        if self.begin is None:
            raise RecordError(
                "its times are seconds, without a date. Give begin as '6 [h]', or read the weather with its beginning.",
                self.name,
                code="value.incomplete",
            )
        instant = begin if isinstance(begin, datetime) else self._read_stamp(begin)
        if instant.tzinfo is not None and self.begin.tzinfo is None:
            raise RecordError("its times have no time zone. Leave the zone of the instant out.", self.name, code="value.excludes-another")
        if instant.tzinfo is None:
            # a time of day without zone is meant in the zone of the weather
            instant = instant.replace(tzinfo=self.begin.tzinfo)
        return (instant - self.begin).total_seconds()

    def _read_stamp(self, text: str) -> datetime:
        """Return the date and time of a text, with or without a year."""
        year = self.begin.year if self.begin is not None else 0
        for candidate in (text, f"{year}-{text}"):
            try:
                return datetime.fromisoformat(candidate)
            except ValueError:
                continue
        raise RecordError(
            f"'{text}' is not a date and time. Write it as 2026-03-21 06:00, or 03-21 06:00.", self.name, code="value.wrong-kind"
        )

    def _stamp(self, seconds: float) -> str:
        """Return the instant `seconds` after the beginning as date and clock, or as seconds where that has no date."""
        return _stamp(self.begin, seconds)

    def __str__(self) -> str:
        """Return what there is, hole by hole."""
        lines = [f"{self.name}: {self._stamp(0.0)}, {self.duration / 3600:.4g} h"]
        for name, s in self.series.items():
            unit_text = RANGES[name][2]
            shown = [_in_usual_unit(v, unit_text) for v in (s.values.min(), s.values.mean(), s.values.max())]
            lines.append(f"  {name:<14} {shown[0]:>7} .. {shown[2]:>7}   mean {shown[1]:>7} {unit_text}")
        lines += [f"  filled: {one}" for one in self.filled]
        lines += [f"  note: {one}" for one in self.notes]
        return "\n".join(lines)

    def _summary(self) -> str:
        """Return its name and quantities."""
        return f"{self.name}: {', '.join(self.series) or 'no quantities'}"


def read_weather(
    path: str | Path,
    columns: Mapping[str, str] | None = None,
    *,
    max_gap: str | float = 0.0,
    begin: str | None = None,
    year: int = 2025,
    time: str | None = None,
    averaged: bool = False,
) -> Weather:
    """Return the weather of a file.

    Parameters
    ----------
    path : path         ``*.epw``, a TMY3 file, or a table with a header: ``time``, ``dry_bulb [degC]``, ``humidity [%]``, ...
    columns : dict      Quantity -> column of a table, where the header has other names. Quantities: dry_bulb, dew_point, humidity,
                        pressure, wind, wind_direction, direct_normal, diffuse, global, infrared, cloud, rain.
    max_gap : str       Holes up to this are bridged by straight lines, and listed; longer ones are refused. [s]
    begin : str         The instant of time zero of a table in seconds: ``2026-03-21 06:00-03:00``.
    year : int          The year that a typical year, whose months come from several, is put into; the sun's path hardly depends on it.
    time : str          The time column of a table, where it is not called time.
    averaged : bool     Whether radiation in a table is a mean over the interval that ends at its stamp, as it is in EPW and TMY3 files.

    Raises
    ------
    MissingDataError    When there is no such file.
    RecordError         When there is a hole longer than `max_gap`, or a value that does not exist.
    """
    target = Path(path)
    if not target.is_file():
        raise MissingDataError(f"there is no file '{target.name}'.", target.name)
    table = read_columns(target, columns, begin, year, time)
    longest = amount(max_gap, "s", target.name)
    series: dict[str, WeatherSeries] = {}
    filled: list[str] = []
    notes = list(table.notes)
    for name, values in table.values.items():
        if not np.isfinite(values).any():
            notes.append(f"{name} is missing throughout")
            continue
        series_of_column = _finite_samples(table, name, values, longest, target.name, filled)
        checked = _physical_values(table, name, series_of_column, target.name)
        shift = 0.5 * table.step if name in RADIATION and (averaged or table.averaged) else 0.0
        series[name] = WeatherSeries(series_of_column.times - shift, checked)
    if "dry_bulb" not in series and not (set(RADIATION) & set(series)):
        raise RecordError(
            f"it has no weather: none of {', '.join(QUANTITIES)} is a column. Name the columns with columns=.",
            target.name,
            code="record.layout-unclear",
        )
    return Weather(target.name, table.begin, series, table.place, tuple(filled), tuple(notes))


def _finite_samples(columns: Columns, name: str, values: Array, longest: float, file: str, filled: list[str]) -> WeatherSeries:
    """Return the finite samples of a column `values` (samples,); each gap up to `longest` [s] adds a remark to `filled`.

    A gap is where samples are more than one and a half steps of the file apart.

    Raises
    ------
    RecordError   When samples are missing at an end, or a gap is longer than `longest`.
    """
    valid = np.isfinite(values)
    times = columns.times[valid]
    edges: Sequence[tuple[float, float]] = [(float(columns.times[0]), float(times[0])), (float(times[-1]), float(columns.times[-1]))]
    if edges[0][1] > edges[0][0] or edges[1][1] > edges[1][0]:
        at = edges[0] if edges[0][1] > edges[0][0] else edges[1]
        raise RecordError(
            f"{name} is missing from {_stamp(columns.begin, at[0])} to {_stamp(columns.begin, at[1])}, at an end of the file, so it "
            "cannot be interpolated. Cut the file, or leave the column out.",
            file,
            code="record.time-unclear",
        )
    steps = np.diff(times)
    for k in np.flatnonzero(steps > 1.5 * columns.step):
        hole = (
            f"{name} has a gap of {steps[k] / 3600:.3g} h from {_stamp(columns.begin, times[k])} to {_stamp(columns.begin, times[k + 1])}"
        )
        if steps[k] > longest * (1 + 1e-9):
            say = "give max_gap = '6 [h]' or similar to interpolate gaps linearly" if longest == 0.0 else "it is longer than max_gap"
            raise RecordError(f"{hole}: {say}, or correct the file.", file, code="record.time-unclear")
        filled.append(f"{hole}, interpolated linearly")
    return WeatherSeries(times, values[valid])


def _in_usual_unit(value: float, unit_text: str) -> str:
    """Return a value in the unit in which it is usual; directions are kept in degrees."""
    return f"{from_si(float(value), '' if unit_text == 'degrees' else unit_text):.4g}"


def _physical_values(columns: Columns, name: str, series: WeatherSeries, file: str) -> Array:
    """Return the values (samples,) in SI, radiation just below zero at night as zero; values outside `RANGES` are refused.

    Raises
    ------
    RecordError   Names the first such value and when it was.
    """
    low, high, unit_text = RANGES[name]
    values = (
        np.where((series.values < 0.0) & (series.values > MIN_NIGHT_READING), 0.0, series.values) if name in RADIATION else series.values
    )
    slack = 1e-9 * max(abs(high), 1.0)
    wrong = np.flatnonzero((values < low - slack) | (values > high + slack))
    if wrong.size:
        k = int(wrong[0])
        shown = [_in_usual_unit(v, unit_text) for v in (values[k], low, high)]
        raise RecordError(
            f"{name} is {shown[0]} {unit_text} at {_stamp(columns.begin, series.times[k])}, outside {shown[1]} .. {shown[2]} {unit_text}. "
            "Check the column's unit, or leave the value empty.",
            file,
            code="value.outside-range",
        )
    return np.clip(values, low, high)


def _stamp(begin: datetime | None, seconds: float) -> str:
    """Return the instant `seconds` after the beginning as date and clock, or as seconds where that has no date."""
    return f"{seconds:g} s" if begin is None else (begin + timedelta(seconds=float(seconds))).strftime("%Y-%m-%d %H:%M")


@dataclass(frozen=True, eq=False)
class Columns:
    """Columns of a weather file on one time axis, NaN where a value is missing.

    Parameters
    ----------
    times : array (samples,)    From `begin`. [s]
    values : dict               Quantity -> values (samples,). [SI]
    begin : datetime or None    The instant of time zero.
    step : float                The usual interval. [s]
    averaged : bool             Whether radiation is a mean over the interval that ends at its stamp.
    place : dict                latitude, longitude [deg], altitude [m], timezone [h].
    """

    times: Array
    values: Mapping[str, Array]
    begin: datetime | None
    step: float
    averaged: bool
    place: Mapping[str, float]
    notes: tuple[str, ...] = ()


def read_columns(path: Path, columns: Mapping[str, str] | None, begin: str | None, year: int, time: str | None) -> Columns:
    """Return the columns of a weather file, an EPW, a TMY3 or a plain table by its name and first lines.

    `columns`, `begin` and `time` apply to a plain table, `year` to the other two; all are those of `read_weather`.

    Raises
    ------
    RecordError   When `columns` is given for an EPW or TMY3 file.
    """
    with path.open("rb") as file:
        head = file.read(400)
    was_read(path)
    epw = path.suffix.lower() == ".epw" or head.startswith(b"LOCATION,")
    if not epw and b"Date (MM/DD/YYYY)" not in head:
        return _table(path, columns, begin, time)
    if columns:
        raise RecordError(
            "columns= applies to a plain table only; the columns of EPW and TMY3 files are fixed. Leave it out.",
            path.name,
            code="value.without-effect",
        )
    return _read_typical_year(path, year, epw)


def _read_typical_year(path: Path, year: int, epw: bool) -> Columns:
    """Return an EPW or TMY3 file as columns; pvlib reads it. Rows of several years are dated in `year`.

    Raises
    ------
    RecordError   When it is not such a file, or time does not go on.
    """
    iotools = optional("pvlib.iotools", "an EPW or TMY3 file", path.name)
    try:
        data, meta = iotools.read_epw(path) if epw else iotools.read_tmy3(path, map_variables=True)
        mixed = len(set(data.index.year[:-1])) > 1
        if mixed:
            data, meta = iotools.read_epw(path, coerce_year=year) if epw else iotools.read_tmy3(path, coerce_year=year, map_variables=True)
    except (ValueError, KeyError, IndexError, TypeError, UnicodeDecodeError) as error:
        raise RecordError(
            f"this is not a readable {'EPW' if epw else 'TMY3'} file: {error}.", path.name, code="file.another-kind"
        ) from None
    stamps = data.index
    seconds = np.asarray((stamps - stamps[0]).total_seconds(), dtype=np.float64)
    # EPW stamps of pvlib stand at the beginning of their hour; its values belong to the end, as those of TMY3 do
    ahead = HOUR if epw else 0.0
    first = (stamps[0] + timedelta(seconds=ahead)).to_pydatetime()
    place = {"latitude": "latitude", "longitude": "longitude", "altitude": "altitude", "timezone": "TZ"}
    notes = (f"a typical year, dated {year}",) if mixed else ()
    if (np.diff(seconds) <= 0).any():
        raise RecordError(
            f"time does not go on after line {int(np.argmax(np.diff(seconds) <= 0)) + 1} of the data.", path.name, code="record.time-order"
        )
    values = _converted(data, EPW if epw else TMY3)
    where = {k: float(meta[v]) for k, v in place.items() if v in meta}
    return Columns(seconds, values, first, _step(seconds), True, where, notes)


def _converted(data: pandas.DataFrame, table: Mapping[str, tuple[str, str, float]]) -> dict[str, Array]:
    """Return name -> values (samples,) in SI, NaN where they are missing; of columns that the data have.

    `table`: column -> (name, unit of the file, code): what is at the code, or beyond it, is missing.
    """
    out = {}
    for column, (name, text, absent) in table.items():
        if column in data:
            raw = np.asarray(data[column], dtype=np.float64)
            # codes for a missing value stand at, or beyond, the format's own
            gone = raw <= absent if absent < 0 else raw >= absent
            written = unit(text)
            out[name] = np.where(gone, np.nan, raw * float(written.factor) + float(written.offset))
    return out


def _table(path: Path, columns: Mapping[str, str] | None, begin: str | None, time: str | None) -> Columns:
    """Return a plain table as columns; a quantity that the table is asked for by name must be there."""
    table = read_plain(path, time)
    refuse_unknown(columns or {}, QUANTITIES, table.file, "no quantity '{}'.", NameNotFoundError)
    wanted = dict(columns or {n: n for n in table.names if n in QUANTITIES})
    series = {q: table.column(column, QUANTITIES[q], USUAL.get(q, "")) for q, column in wanted.items()}
    return Columns(table.times - table.times[0], series, _time_zero(table.stamp, begin, table.file), _step(table.times), False, {})


def _time_zero(stamp: str | None, begin: str | None, file: str) -> datetime | None:
    """Return the instant of time zero: the first stamp, or what the caller says."""
    if stamp is not None and begin is not None:
        raise RecordError("its times are stamps with a date. Leave begin out.", file, code="value.excludes-another")
    text = stamp or begin
    if text is None:
        return None
    try:
        return datetime.fromisoformat(text)
    except ValueError:
        raise RecordError(f"'{text}' is not a date and time. Write it as 2026-03-21 06:00-03:00.", file, code="value.wrong-kind") from None


def _step(seconds: Array) -> float:
    """Return the usual time between two rows. [s]"""
    return float(np.median(np.diff(seconds)))
