"""Guided work at the bench: which sensor is which, and what each shows in ice water."""

from __future__ import annotations

from collections.abc import Callable
from datetime import date
from math import sqrt
from pathlib import Path

import numpy as np

from thermid.base.errors import RecordError
from thermid.bench.bench_files import MappedSensor, save_sensor
from thermid.bench.logger import Logger
from thermid.measure.records import ICE, SensorCertificate

_MIN_RISE = 2.0
"""Rise that a hand gives a sensor within seconds, and no draught does. [K]"""

_BATH_ERROR = 0.02
"""Standard deviation of the temperature of stirred ice and water that the procedure of docs/bench.md gives. [K]"""

_LEAST_READINGS, _READINGS = 60, 120
"""Readings of a sensor in ice water that a certificate needs, and that are taken."""
_MAX_OFFSET = 2.0
"""Largest offset in ice water of a sensor that is in it. [K]"""


def name_sensors(
    log: Logger, path: Path, say: Callable[[str], object], ask: Callable[[str], str], patience: float = 120.0
) -> list[MappedSensor]:
    """Find out which sensor is which: ask for each to be warmed, and write its name to the map. Return the sensors that were named.

    Parameters
    ----------
    log : Logger          A running log.
    path : Path           The map that is written.
    say, ask : callable   Print a text; ask for a text.
    patience : float      Time after which a warmed sensor is no longer waited for. [s]

    Raises
    ------
    RecordError   When no sensor answers.
    """
    roms = _answering_roms(log)
    say(f"{len(roms)} sensors respond. Warm one of them between two fingers.")
    mapped: list[MappedSensor] = []
    while len(mapped) < len(roms):
        unmapped = [rom for rom in roms if rom not in {sensor.rom for sensor in mapped}]
        rom = unmapped[0] if len(unmapped) == 1 else _warmed_sensor(log, unmapped, patience)
        if rom is None:
            say(
                f"no sensor became warmer by {_MIN_RISE:g} K within {patience:g} s, so {len(unmapped)} sensors have no name. Run the "
                "command again to name them."
            )
            break
        if rom in log.sensors:
            say(f"this is '{log.sensors[rom].name}' so far.")
        name = ask(f"{rom}: name of its channel").strip()
        if not name or any(sensor.name == name for sensor in mapped):
            say("give each sensor a different name.")
            continue
        old = log.sensors.get(rom)
        mapped.append(MappedSensor(name, rom, old.certificate if old is not None else None, old.note if old is not None else ""))
        save_sensor(path, mapped[-1])
        if len(mapped) < len(roms):
            say(f"'{name}' is saved. Warm the next one." if len(unmapped) > 2 else f"'{name}' is saved. One sensor is left.")
    return mapped


def _answering_roms(log: Logger) -> list[str]:
    """Return the sorted ROMs that answer, once the whole list has come and each has sent a value or a fault, or after 15 s.

    Raises
    ------
    RecordError   When none answers.
    """
    log.ask("search")
    roms: set[str] = set()
    begun = listed = False
    while log.elapsed < 15.0 and not (listed and roms and roms <= set(log.watch.values) | set(log.watch.faults)):
        line = log.step()
        begun |= line is not None and line.kind == "B"
        listed |= begun and line is not None and line.kind == "C"
        roms = set(log.state.bits)
    if not roms:
        raise RecordError(
            "no sensor responds. Check the wire, the 4.7 kohm pull-up and the supply; docs/bench.md has a drawing.",
            "bench",
            code="bench.no-board",
        )
    return sorted(roms)


def _warmed_sensor(log: Logger, roms: list[str], patience: float) -> str | None:
    """Return the ROM whose temperature rises by `_MIN_RISE`, twice as far as any other; None where none does within `patience` seconds."""
    start = {rom: log.watch.values.get(rom) for rom in roms}
    begun = log.state.seconds
    while log.state.seconds - begun < patience:
        log.step()
        for rom in roms:
            if start[rom] is None:
                start[rom] = log.watch.values.get(rom)
        rises = {rom: log.watch.values[rom] - base for rom, base in start.items() if base is not None and rom in log.watch.values}
        best = sorted(rises, key=lambda rom: rises[rom], reverse=True)
        if best and rises[best[0]] > _MIN_RISE and (len(best) == 1 or rises[best[1]] < 0.5 * rises[best[0]]):
            return best[0]
    return None


def certificate_of(values: np.ndarray, resolution: float, when: str) -> SensorCertificate:
    """Return the certificate of readings in ice water: offset = mean, uncertainty = sqrt(bath^2 + resolution^2 / 12 + variance / n).

    Parameters
    ----------
    values : array (samples,)   Readings. [degC]
    resolution : float          Step of the sensor. [K]
    when : str                  Date of the test.

    Raises
    ------
    RecordError   When there are too few, their halves differ by more than a step, or their mean is not near 0 degC.
    """
    if values.size < _LEAST_READINGS:
        raise RecordError(f"{values.size} readings; {_LEAST_READINGS} are needed.", "ice point", code="record.too-short")
    half = values.size // 2
    drift = float(values[half:].mean() - values[:half].mean())
    if abs(drift) > resolution:
        raise RecordError(
            f"it still drifts, by {drift:+.3f} K between both halves. Wait until it is steady, and stir.",
            "ice point",
            code="record.not-steady",
        )
    mean = float(values.mean())
    if abs(mean) > _MAX_OFFSET:
        raise RecordError(
            f"it shows {mean:.2f} degC. A good sensor reads within {_MAX_OFFSET:g} K of zero. Check that it is in the ice water.",
            "ice point",
            code="bench.sensor",
        )
    # a quantised reading that does not move is uncertain by its step over sqrt(12), however long it is read
    error = sqrt(_BATH_ERROR**2 + resolution**2 / 12.0 + (values.std() ** 2) / values.size)
    return SensorCertificate(mean, error, ICE, when)


def ice_point(log: Logger, path: Path, say: Callable[[str], object], confirm: Callable[[str], bool]) -> list[MappedSensor]:
    """Read all sensors in ice water and write their certificates to the map; return the sensors that got one.

    Of each the last `_READINGS`, in sixteenths of a kelvin as sensors send them; up to 50 lines are read for each.

    Parameters
    ----------
    log : Logger              A running log.
    path : Path               The map that is written.
    say, confirm : callable   Print a text; ask whether all is ready.

    Raises
    ------
    RecordError   When no sensor answers.
    """
    roms = _answering_roms(log)
    say(
        "Fill a vessel with crushed ice of clean water, add water up to the top of the ice, and stir. Put the sensors in the middle "
        "and wait at least ten minutes."
    )
    if not confirm(f"Are all {len(roms)} sensors in it?"):
        return []
    taken: dict[str, list[float]] = {rom: [] for rom in roms}
    tried = 0
    while min(map(len, taken.values())) < _READINGS and tried < 50 * _READINGS * len(roms):
        line = log.step()
        tried += 1
        if (
            line is not None
            and line.kind == "D"
            and line.fields[0] in taken
            and line.fields[0] not in log.watch.faults
            and line.raw is not None
        ):
            taken[line.fields[0]].append(line.raw / 16.0)
    sensors = []
    for rom, values in taken.items():
        step = 2.0 ** (8 - log.state.bits.get(rom, 12))
        try:
            certificate = certificate_of(np.array(values[-_READINGS:]), step, date.today().isoformat())
        except RecordError as error:
            say(f"{log.name_of(rom)}: no certificate: {error.message}")
            continue
        old = log.sensors.get(rom, MappedSensor(rom, rom))
        sensors.append(MappedSensor(old.name, rom, certificate, old.note))
        save_sensor(path, sensors[-1])
        say(f"{old.name}: it shows {certificate.offset:+.3f} K too high, +- {certificate.uncertainty:.3f} K; written")
    return sensors
