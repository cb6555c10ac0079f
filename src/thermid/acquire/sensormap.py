"""The sensor map: which ROM is which channel, and what its certificate says. Sensors answer in the order of their ROM, not of the wire."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from thermid.acquire.wire import rom_is_good
from thermid.errors import MissingDataError, RecordError, nearest
from thermid.files import OWN, parse_toml, write_text
from thermid.measure.record.sensor import ICE, SensorCertificate

_KEYS = ("rom", "note", "certificate")
_BROKEN = 5.0


@dataclass(frozen=True)
class MappedSensor:
    """One line of the map.

    Parameters
    ----------
    name : str                          Name of its channel.
    rom : str                           Its ROM, 16 hexadecimal digits, family first.
    certificate : SensorCertificate or None   What is known of its offset.
    note : str                          Where it is glued.
    """

    name: str
    rom: str
    certificate: SensorCertificate | None = None
    note: str = ""

    def as_header(self) -> dict[str, Any]:
        """Return what the header of a log says of it."""
        out: dict[str, Any] = {"rom": self.rom, "name": self.name}
        if self.note:
            out["note"] = self.note
        if self.certificate is not None:
            c = self.certificate
            out |= {"offset_K": c.offset, "uncertainty_K": c.uncertainty, "at_K": c.at, "date": c.date}
        return out


def load_sensors(path: str | Path) -> dict[str, MappedSensor]:
    """Return the sensors of a map file by their ROM.

    Raises
    ------
    MissingDataError   When there is no such file.
    RecordError        When it is no TOML, a ROM is mistyped or stands twice, or a key is unknown.
    """
    place = Path(path)
    if not place.is_file():
        raise MissingDataError("there is no such sensor map. `thermid log --identify` makes one.", str(place))
    try:
        content = parse_toml(place.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise RecordError(f"it is no TOML: {error}.", place.name) from None
    tables = content.get("sensors")
    if not isinstance(tables, Mapping) or not tables or set(content) != {"sensors"}:
        raise RecordError('a sensor map has tables such as [sensors.T1] with rom = "28...", and nothing else.', place.name)
    out: dict[str, MappedSensor] = {}
    for name, table in tables.items():
        sensor = _sensor(name, table, f"{place.name}, sensors.{name}")
        if sensor.rom in out:
            raise RecordError(f"ROM {sensor.rom} is that of '{out[sensor.rom].name}' too.", f"{place.name}, sensors.{name}")
        out[sensor.rom] = sensor
    return out


def _sensor(name: str, table: object, where: str) -> MappedSensor:
    """Return one sensor of the file."""
    if not isinstance(table, Mapping) or not isinstance(table.get("rom"), str):
        raise RecordError('it needs rom = "28...", 16 hexadecimal digits as the board sends them.', where)
    for key in table:
        if key not in _KEYS:
            raise RecordError(f"no key '{key}'; there are {', '.join(_KEYS)}.{nearest(key, _KEYS)}", where)
    rom = table["rom"].strip().upper()
    if len(rom) != 16 or any(digit not in "0123456789ABCDEF" for digit in rom):
        raise RecordError(f"ROM '{table['rom']}' is not 16 hexadecimal digits.", where)
    if not rom_is_good(rom):
        raise RecordError(f"ROM {rom} does not carry its own CRC: a digit is mistyped.", where)
    certificate = SensorCertificate.read(table["certificate"], f"{where}.certificate") if "certificate" in table else None
    if certificate is not None and abs(certificate.offset) > _BROKEN:
        raise RecordError(
            f"its offset is {certificate.offset:g} K; a sensor that is off by more than {_BROKEN:g} K is broken.", f"{where}.certificate"
        )
    return MappedSensor(name, rom, certificate, str(table.get("note", "")))


def save_sensor(path: str | Path, sensor: MappedSensor) -> None:
    """Write a sensor into a map file, in place of the one of its name; comments and the other sensors stay."""
    import tomlkit

    place = Path(path)
    content = tomlkit.parse(place.read_text(encoding="utf-8")) if place.is_file() else tomlkit.document()
    if "sensors" not in content:
        content["sensors"] = tomlkit.table(is_super_table=True)
    table = tomlkit.table()
    table["rom"] = sensor.rom
    if sensor.note:
        table["note"] = sensor.note
    if sensor.certificate is not None:
        c = sensor.certificate
        made = tomlkit.table()
        made |= {
            "offset": f"{c.offset:.4g} [K]",
            "uncertainty": f"{c.uncertainty:.3g} [K]",
            "at": f"{c.at - ICE:.4g} [degC]",
            "date": c.date,
        }
        table["certificate"] = made
    tables: Any = content["sensors"]
    for name in [name for name, each in tables.items() if each.get("rom") == sensor.rom and name != sensor.name]:
        del tables[name]  # the sensor has a new name
    tables[sensor.name] = table
    write_text(place, tomlkit.dumps(content), OWN)
