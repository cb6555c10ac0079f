"""What a user writes for the bench: the sensor map and the heater programme.

The map says which ROM is which channel, and what its certificate says: sensors answer in the order of their ROM, not of the wire. The
programme holds the duties of the heaters over time.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from thermid.base.errors import MissingDataError, RecordError, refuse_first
from thermid.base.files import FileKinds, Places, by_grammar, command, read_toml
from thermid.base.units import amount
from thermid.bench._wire import rom_is_good
from thermid.measure.records import ICE, SensorCertificate

_BROKEN = 5.0


@dataclass(frozen=True)
class MappedSensor:
    """One sensor of a map.

    Parameters
    ----------
    name : str                          Name of its channel.
    rom : str                           Its ROM, 16 hexadecimal digits, family first.
    certificate : SensorCertificate or None   Its offset by a comparison.
    note : str                          Where it is glued.
    """

    name: str
    rom: str
    certificate: SensorCertificate | None = None
    note: str = ""

    def as_header(self) -> dict[str, Any]:
        """Return it as the JSON object in the header of a log. [K]"""
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
    DeckError          When it is no TOML.
    RecordError        When a ROM is mistyped or stands twice, or a key is unknown.
    """
    place = Path(path)
    if not place.is_file():
        raise MissingDataError("there is no such sensor map. Make one with `thermid log --identify`.", str(place))
    with command():  # the command that names sensors writes it too, so it is no input
        content, lines = read_toml(place)
    tables = by_grammar("thermid.bench._schema.SensorMapFile", content, Places(place.name, lines)).sensors
    out: dict[str, MappedSensor] = {}
    for name, table in tables.items():
        sensor = _sensor(name, table, f"{place.name}, sensors.{name}")
        if sensor.rom in out:
            raise RecordError(
                f"ROM {sensor.rom} is also given for '{out[sensor.rom].name}'. Correct one of them.",
                f"{place.name}, sensors.{name}",
                code="name.taken",
            )
        out[sensor.rom] = sensor
    return out


def _sensor(name: str, table: Any, where: str) -> MappedSensor:
    """Return one sensor of a map from its table.

    Raises
    ------
    RecordError   When its ROM is mistyped, or its certificate states an offset that only a broken sensor has.
    """
    rom = table.rom.strip().upper()
    refuse_first(
        where,
        (
            len(rom) != 16 or any(digit not in "0123456789ABCDEF" for digit in rom),
            f"ROM '{table.rom}' is not 16 hexadecimal digits.",
            "bench.sensor",
        ),
        (not rom_is_good(rom), f"ROM {rom} does not carry its own CRC: a digit is mistyped.", "bench.sensor"),
        error=RecordError,
    )
    certificate = SensorCertificate.read(table.certificate.written, f"{where}.certificate") if table.certificate else None
    if certificate is not None and abs(certificate.offset) > _BROKEN:
        raise RecordError(
            f"its offset is {certificate.offset:g} K; a sensor with an offset above {_BROKEN:g} K is defective. Replace it.",
            f"{where}.certificate",
            code="value.outside-range",
        )
    return MappedSensor(name, rom, certificate, table.note)


def save_sensor(path: str | Path, sensor: MappedSensor) -> None:
    """Write a sensor into a map file, in place of one of its name or ROM; comments and other sensors stay."""
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
    for name in [name for name, sensor_table in tables.items() if sensor_table.get("rom") == sensor.rom and name != sensor.name]:
        del tables[name]  # the sensor has a new name
    tables[sensor.name] = table
    FileKinds.RESULTS_FILE.save_text(place, tomlkit.dumps(content))


@dataclass(frozen=True)
class Programme:
    """Duties of the heaters over time; each holds until the next time.

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
        """Whether any step turns a heater on."""
        return any(any(pair) for pair in self.duties)

    def at(self, seconds: float) -> tuple[int, int]:
        """Return both duties at a time [s]: those of the last step begun, zero before the first and from the end on. [0.1 %]"""
        if self.end is not None and seconds >= self.end:
            return (0, 0)
        now = [duty for time, duty in zip(self.times, self.duties, strict=True) if time <= seconds]
        return now[-1] if now else (0, 0)


def load_programme(path: str | Path) -> Programme:
    """Return the heater programme of a file.

    Raises
    ------
    DeckError     When there is no such file, or it is no TOML.
    RecordError   When times do not increase, a duty is not 0 to 100 %, or a key is unknown.
    """
    place = Path(path)
    content, lines = read_toml(place)
    read = by_grammar("thermid.bench._schema.ProgrammeFile", content, Places(place.name, lines))
    times: list[float] = []
    duties: list[tuple[int, int]] = []
    held = (0, 0)
    for k, step in enumerate(read.steps):
        where = f"{place.name}, steps[{k}]"
        times.append(amount(step.at, "s", f"{where}, at"))
        if times[-1] < 0 or (k and times[-1] <= times[-2]):
            raise RecordError(f"its time {times[-1]:g} s is not after {times[-2] if k else 0:g} s.", where, code="value.outside-range")
        held = (_duty(step.heater1, held[0], f"{where}, heater1"), _duty(step.heater2, held[1], f"{where}, heater2"))
        duties.append(held)
    end = None if read.end is None else amount(read.end, "s", f"{place.name}, end")
    if end is not None and end <= times[-1]:
        raise RecordError(f"its end, {end:g} s, is not after its last step, {times[-1]:g} s.", place.name, code="value.outside-range")
    return Programme(tuple(times), tuple(duties), end)


def _duty(written: object, held: int, where: str) -> int:
    """Return a duty; that of the step before where none is written. [0.1 %]

    Raises
    ------
    RecordError   When it is not from 0 to 100 %.
    """
    if written is None:
        return held
    share = amount(written, "1", where)
    if not 0 <= share <= 1:
        hint = f" Write '{written} [%]'." if isinstance(written, (int, float)) and 1 < written <= 100 else ""
        raise RecordError(f"{written!r} is not from 0 to 100 %.{hint}", where, code="value.outside-range")
    return round(share * 1000)
