"""The three forms in which weather comes, EPW, TMY3 and a plain table, as columns in SI."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from thermid.errors import NameNotFoundError, RecordError, nearest
from thermid.files import was_read
from thermid.measure.readers.plain import read_plain
from thermid.measure.record.channel import FloatArray
from thermid.units import TEMPERATURE

if TYPE_CHECKING:
    import pandas

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

# column of pvlib -> quantity, factor, shift, and what the format writes where a value is missing
_EPW: Final = {
    "temp_air": ("dry_bulb", 1.0, 273.15, 99.9),
    "temp_dew": ("dew_point", 1.0, 273.15, 99.9),
    "relative_humidity": ("humidity", 0.01, 0.0, 999.0),
    "atmospheric_pressure": ("pressure", 1.0, 0.0, 999999.0),
    "wind_speed": ("wind", 1.0, 0.0, 999.0),
    "wind_direction": ("wind_direction", 1.0, 0.0, 999.0),
    "dni": ("direct_normal", 1.0, 0.0, 9999.0),
    "dhi": ("diffuse", 1.0, 0.0, 9999.0),
    "ghi": ("global", 1.0, 0.0, 9999.0),
    "ghi_infrared": ("infrared", 1.0, 0.0, 9999.0),
    "total_sky_cover": ("cloud", 0.1, 0.0, 99.0),
    "liquid_precipitation_depth": ("rain", 1 / 3.6e6, 0.0, 999.0),
}
_TMY3: Final = {
    "temp_air": ("dry_bulb", 1.0, 273.15, -9900.0),
    "temp_dew": ("dew_point", 1.0, 273.15, -9900.0),
    "relative_humidity": ("humidity", 0.01, 0.0, -9900.0),
    "pressure": ("pressure", 100.0, 0.0, -9900.0),
    "wind_speed": ("wind", 1.0, 0.0, -9900.0),
    "wind_direction": ("wind_direction", 1.0, 0.0, -9900.0),
    "dni": ("direct_normal", 1.0, 0.0, -9900.0),
    "dhi": ("diffuse", 1.0, 0.0, -9900.0),
    "ghi": ("global", 1.0, 0.0, -9900.0),
    "TotCld (tenths)": ("cloud", 0.1, 0.0, -9900.0),
    "Lprecip depth (mm)": ("rain", 1 / 3.6e6, 0.0, -9900.0),
}


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

    times: FloatArray
    values: Mapping[str, FloatArray]
    begin: datetime | None
    step: float
    averaged: bool
    place: Mapping[str, float]
    notes: tuple[str, ...] = ()


def read_columns(path: Path, columns: Mapping[str, str] | None, begin: str | None, year: int, time: str | None) -> Columns:
    """Return the columns of a weather file; its form is told by its name and first lines."""
    with path.open("rb") as file:
        head = file.read(400)
    was_read(path)
    epw = path.suffix.lower() == ".epw" or head.startswith(b"LOCATION,")
    if not epw and b"Date (MM/DD/YYYY)" not in head:
        return _table(path, columns, begin, time)
    if columns:
        raise RecordError("an EPW or TMY3 file has its own columns; columns= belongs to a plain table.", path.name)
    return _typical(path, year, epw)


def _typical(path: Path, year: int, epw: bool) -> Columns:
    """Return an EPW or TMY3 file as columns; pvlib reads it."""
    try:
        from pvlib import iotools
    except ImportError:
        raise RecordError("EPW and TMY3 files are read by pvlib: pip install 'thermid[site]'.", path.name) from None
    try:
        data, meta = iotools.read_epw(path) if epw else iotools.read_tmy3(path, map_variables=True)
        mixed = len(set(data.index.year[:-1])) > 1
        if mixed:
            data, meta = iotools.read_epw(path, coerce_year=year) if epw else iotools.read_tmy3(path, coerce_year=year, map_variables=True)
    except (ValueError, KeyError, IndexError, TypeError, UnicodeDecodeError) as error:
        raise RecordError(f"this is no {'EPW' if epw else 'TMY3'} file that can be read: {error}.", path.name) from None
    stamps = data.index
    seconds = np.asarray((stamps - stamps[0]).total_seconds(), dtype=np.float64)
    # EPW stamps of pvlib stand at the beginning of their hour; its values belong to the end, as those of TMY3 do
    ahead = 3600.0 if epw else 0.0
    first = (stamps[0] + _delta(ahead)).to_pydatetime()
    place = {"latitude": "latitude", "longitude": "longitude", "altitude": "altitude", "timezone": "TZ"}
    notes = (f"a typical year, put into {year}",) if mixed else ()
    if (np.diff(seconds) <= 0).any():
        raise RecordError(f"time does not go on after line {int(np.argmax(np.diff(seconds) <= 0)) + 1} of the data.", path.name)
    values = _converted(data, _EPW if epw else _TMY3)
    where = {k: float(meta[v]) for k, v in place.items() if v in meta}
    return Columns(seconds, values, first, _step(seconds), True, where, notes)


def _delta(seconds: float) -> Any:
    import pandas

    return pandas.Timedelta(seconds=seconds)


def _converted(data: pandas.DataFrame, table: Mapping[str, tuple[str, float, float, float]]) -> dict[str, FloatArray]:
    """Return quantities in SI, missing ones as NaN."""
    out = {}
    for column, (name, factor, shift, missing) in table.items():
        if column in data:
            raw = np.asarray(data[column], dtype=np.float64)
            # codes for a missing value stand at, or beyond, the format's own
            gone = raw <= missing if missing < 0 else raw >= missing
            out[name] = np.where(gone, np.nan, raw * factor + shift)
    return out


def _table(path: Path, columns: Mapping[str, str] | None, begin: str | None, time: str | None) -> Columns:
    """Return a plain table as columns; a quantity that the table is asked for by name must be there."""
    table = read_plain(path, time)
    for quantity in columns or {}:
        if quantity not in QUANTITIES:
            raise NameNotFoundError(f"no quantity '{quantity}'.{nearest(quantity, QUANTITIES)}", table.file)
    wanted = dict(columns or {n: n for n in table.names if n in QUANTITIES})
    found = {q: table.column(column, QUANTITIES[q], USUAL.get(q, "")) for q, column in wanted.items()}
    return Columns(table.times - table.times[0], found, _instant(table.stamp, begin, table.file), _step(table.times), False, {})


def _instant(stamp: str | None, begin: str | None, file: str) -> datetime | None:
    """Return the instant of time zero: the first stamp, or what the caller says."""
    if stamp is not None and begin is not None:
        raise RecordError("its times are stamps, so its beginning is known; leave begin out.", file)
    text = stamp or begin
    if text is None:
        return None
    try:
        return datetime.fromisoformat(text)
    except ValueError:
        raise RecordError(f"'{text}' is no instant with a date; write it as 2026-03-21 06:00-03:00.", file) from None


def _step(seconds: FloatArray) -> float:
    return float(np.median(np.diff(seconds)))
