"""What a user writes for the bench: the sensor map and the heater programme.

The map says which ROM is which channel, and what its certificate says: sensors answer in the order of their ROM, not of the wire. The
programme holds the duties of the heaters over time.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from thermid.acquire.wire import rom_is_good
from thermid.errors import MissingDataError, RecordError, refuse_unknown
from thermid.files import OWN, parse_toml, was_read, write_text
from thermid.measure.amounts import amount
from thermid.measure.record.sensor import ICE, SensorCertificate

_SENSOR_KEYS = ("rom", "note", "certificate")
_STEP_KEYS = ("at", "heater1", "heater2")
_TOP = ("steps", "end", "title")
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


def _content(place: Path, missing: str) -> dict[str, Any]:
    """Return the content of a TOML file, or say what is missing."""
    if not place.is_file():
        raise MissingDataError(missing, str(place))
    try:
        return parse_toml(place.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise RecordError(f"it is not valid TOML: {error}.", place.name) from None


def load_sensors(path: str | Path) -> dict[str, MappedSensor]:
    """Return the sensors of a map file by their ROM.

    Raises
    ------
    MissingDataError   When there is no such file.
    RecordError        When it is no TOML, a ROM is mistyped or stands twice, or a key is unknown.
    """
    place = Path(path)
    content = _content(place, "the sensor map does not exist. Make one with `thermid log --identify`.")
    tables = content.get("sensors")
    if not isinstance(tables, Mapping) or not tables or set(content) != {"sensors"}:
        raise RecordError('a sensor map may hold only tables such as [sensors.T1] with rom = "28...".', place.name)
    out: dict[str, MappedSensor] = {}
    for name, table in tables.items():
        sensor = _sensor(name, table, f"{place.name}, sensors.{name}")
        if sensor.rom in out:
            raise RecordError(
                f"ROM {sensor.rom} is also given for '{out[sensor.rom].name}'. Correct one of them.", f"{place.name}, sensors.{name}"
            )
        out[sensor.rom] = sensor
    return out


def _sensor(name: str, table: object, where: str) -> MappedSensor:
    """Return one sensor of the file."""
    if not isinstance(table, Mapping) or not isinstance(table.get("rom"), str):
        raise RecordError('it needs rom = "28...", 16 hexadecimal digits as the board sends them.', where)
    refuse_unknown(table, _SENSOR_KEYS, where)
    rom = table["rom"].strip().upper()
    if len(rom) != 16 or any(digit not in "0123456789ABCDEF" for digit in rom):
        raise RecordError(f"ROM '{table['rom']}' is not 16 hexadecimal digits.", where)
    if not rom_is_good(rom):
        raise RecordError(f"ROM {rom} has a wrong CRC, so a digit is mistyped. Correct it.", where)
    certificate = SensorCertificate.read(table["certificate"], f"{where}.certificate") if "certificate" in table else None
    if certificate is not None and abs(certificate.offset) > _BROKEN:
        raise RecordError(
            f"its offset is {certificate.offset:g} K; a sensor with an offset above {_BROKEN:g} K is defective. Replace it.",
            f"{where}.certificate",
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
        certificate = tomlkit.table()
        certificate |= {
            "offset": f"{c.offset:.4g} [K]",
            "uncertainty": f"{c.uncertainty:.3g} [K]",
            "at": f"{c.at - ICE:.4g} [degC]",
            "date": c.date,
        }
        table["certificate"] = certificate
    tables: Any = content["sensors"]
    for name in [name for name, each in tables.items() if each.get("rom") == sensor.rom and name != sensor.name]:
        del tables[name]  # the sensor has a new name
    tables[sensor.name] = table
    write_text(place, tomlkit.dumps(content), OWN)


@dataclass(frozen=True)
class Programme:
    """Duties that hold from one time to the next.

    Parameters
    ----------
    times : tuple of float            When each step begins. [s]
    duties : tuple of pairs of int    Duties of both heaters. [0.1 %]
    end : float or None               When heaters go off and the log ends. [s]
    """

    times: tuple[float, ...]
    duties: tuple[tuple[int, int], ...]
    end: float | None = None

    @property
    def heats(self) -> bool:
        """Whether any of its steps turns a heater on."""
        return any(any(pair) for pair in self.duties)

    def at(self, seconds: float) -> tuple[int, int]:
        """Return both duties at a time. [0.1 %]"""
        if self.end is not None and seconds >= self.end:
            return (0, 0)
        now = [duty for time, duty in zip(self.times, self.duties, strict=True) if time <= seconds]
        return now[-1] if now else (0, 0)


def load_programme(path: str | Path) -> Programme:
    """Return the programme of a file.

    Raises
    ------
    MissingDataError   When there is no such file.
    RecordError        When it is no TOML, times do not increase, a duty is not 0 to 100 %, or a key is unknown.
    """
    place = Path(path)
    content = _content(place, "the heater programme does not exist. Check the path.")
    was_read(place)
    refuse_unknown(content, _TOP, place.name)
    steps = content.get("steps")
    if not isinstance(steps, list) or not steps:
        raise RecordError('a heater programme needs steps = [{ at = "0 [s]", heater1 = "40 [%]" }, ...].', place.name)
    times: list[float] = []
    duties: list[tuple[int, int]] = []
    held = (0, 0)
    for k, step in enumerate(steps):
        where = f"{place.name}, steps[{k}]"
        if not isinstance(step, Mapping) or "at" not in step:
            raise RecordError('a step needs a time: at = "10 [min]".', where)
        refuse_unknown(step, _STEP_KEYS, where)
        times.append(amount(step["at"], "s", f"{where}, at"))
        if times[-1] < 0 or (k and times[-1] <= times[-2]):
            raise RecordError(f"its time {times[-1]:g} s is not after {times[-2] if k else 0:g} s.", where)
        held = (_duty(step.get("heater1"), held[0], f"{where}, heater1"), _duty(step.get("heater2"), held[1], f"{where}, heater2"))
        duties.append(held)
    end = None if "end" not in content else amount(content["end"], "s", f"{place.name}, end")
    if end is not None and end <= times[-1]:
        raise RecordError(f"its end, {end:g} s, is not after its last step, {times[-1]:g} s.", place.name)
    return Programme(tuple(times), tuple(duties), end)


def _duty(given: object, held: int, where: str) -> int:
    """Return a duty, or the one before where none is given. [0.1 %]"""
    if given is None:
        return held
    share = amount(given, "1", where)
    if not 0 <= share <= 1:
        hint = f" Write '{given} [%]'." if isinstance(given, (int, float)) and 1 < given <= 100 else ""
        raise RecordError(f"{given!r} is not from 0 to 100 %.{hint}", where)
    return round(share * 1000)
