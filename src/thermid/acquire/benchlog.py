"""A log of the bench as cells: lines checked, put in order, one row for each cycle, faults masked by their name, damage named."""

from __future__ import annotations

import json
import re
from collections import Counter
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np

from thermid.acquire.benchclock import Heard, clocks
from thermid.acquire.wire import Line, crc16, parse_line
from thermid.errors import RecordError
from thermid.measure.readers.textfile import Cells
from thermid.measure.record.sensor import SensorCertificate

RANGE: Final = (-55.0, 125.0)
"""What a DS18B20 can measure, by its data sheet; -127, which its usual driver gives for a lost one, lies outside. [degC]"""
MOST_CURRENT: Final = 3.2
"""What an INA219 can measure with 0.1 ohm; at that it shows the limit itself. [A]"""

_BODY: Final = re.compile(r"(\d{1,6}) (\d{1,9}\.\d{6}) (.+)\Z", re.ASCII)
_FAULTS: Final = {"crc": "wrong CRC", "lost": "sensor lost", "short": "bus shorted", "power": "sensor without supply"}
_NAMES: Final = {"H": ("heater{}", "%", 0.1), "V": ("voltage{}", "V", 1e-3), "I": ("current{}", "A", 1e-4)}
_SHOWN: Final = 8
_UNPRINTABLE: Final = re.compile(r"[^ -~]")


def log_line(body: str) -> str:
    """Return a line of the log, with its own CRC and its line feed: the stamp of the host must be as sure as the value."""
    plain = _UNPRINTABLE.sub("?", body)
    return f"{plain} {crc16(plain)}\n"


def opened(text: str) -> str:
    """Return the body of a line of the log.

    Raises
    ------
    RecordError   When its CRC is wrong or missing.
    """
    body, _, crc = text.rpartition(" ")
    if crc != crc16(body):
        raise RecordError("its CRC is wrong.")
    return body


@dataclass
class _Log:
    """What the lines of a log say, before they are put in rows."""

    heard: list[Heard] = field(default_factory=list)
    walls: dict[int, str] = field(default_factory=dict)
    sensors: dict[str, dict[str, Any]] = field(default_factory=dict)
    damaged: list[int] = field(default_factory=list)
    marks: Counter[str] = field(default_factory=Counter)
    cut: bool = False


def bench_cells(data: bytes, file: str) -> Cells:
    """Return the cells of a bench log: time, one column for each sensor, heater and supply channel.

    Raises
    ------
    RecordError   When it holds no value.
    """
    log = _read(data.decode("latin-1"))
    values = [each for each in log.heard if each.line.kind == "D"]
    if not values:
        lost = f"; {len(log.damaged)} lines are damaged" if log.damaged else ""
        raise RecordError(f"the log holds no value yet{lost}.", file)
    notes = _damage(log)
    moments, of_clock = clocks(log.heard, log.walls)
    rows = {moment: row for row, moment in enumerate(sorted({moments[at] for at, each in enumerate(log.heard) if each.line.kind == "D"}))}
    table: dict[str, dict[int, Line]] = {}
    lines = [0] * len(rows)
    for at, each in enumerate(log.heard):
        if each.line.kind == "D":
            row = rows[moments[at]]
            of_source = table.setdefault(each.line.fields[0], {})
            if row not in of_source or each.line.fields[0] in (
                "H1",
                "H2",
            ):  # a heater that changes in the moment of a cycle: the new duty holds
                of_source[row] = each.line
            lines[row] = lines[row] or each.at
    bits = {each.line.fields[0]: int(each.line.fields[1]) for each in log.heard if each.line.kind == "S"}
    made = _Columns(len(rows))
    made.add("time", "s", np.array([moment for moment in rows]), {})
    for source in sorted(table, key=lambda name: (len(name) != 16, list(log.sensors).index(name) if name in log.sensors else 99, name)):
        notes += made.source(source, table[source], log.sensors.get(source, {}), bits.get(source))
    made.power()
    header = tuple(made.header)
    return Cells(
        file,
        header,
        made.texts,
        lines,
        (*of_clock, *notes),
        reasons=made.reasons,
        resolution=made.resolution,
        certificates=made.certificates,
        prompt=frozenset({"heater1", "heater2"}),  # the board says a change at once, beside what each cycle says
    )


def _read(text: str) -> _Log:
    """Return what the lines say; a line that does not carry its CRC is damaged."""
    log = _Log()
    *whole, rest = text.split("\n")
    log.cut = bool(rest)
    for at, line in enumerate(whole, 1):
        try:
            if line.startswith(("# session ", "# sensor ", "# mark ")):
                _comment(log, opened(line))
            elif line and not line.startswith("#"):
                match = _BODY.match(opened(line))
                if match is None:
                    raise RecordError("it is no line of a log.")
                log.heard.append(Heard(int(match[1]), float(match[2]), at, parse_line(match[3])))
        except (RecordError, ValueError, KeyError, TypeError):
            log.damaged.append(at)
    return log


def _comment(log: _Log, body: str) -> None:
    """Take in a line of the logger's own."""
    _, word, rest = body.split(" ", 2)
    if word == "mark":
        log.marks[rest.split(" ")[2]] += 1
        return
    content = json.loads(rest)
    if word == "session":
        log.walls[int(content["number"])] = str(content["wall"])
    else:
        if "offset_K" in content:
            content |= {key: float(content[key]) for key in ("offset_K", "uncertainty_K", "at_K")} | {"date": str(content["date"])}
        log.sensors[str(content["rom"])] = content


def _damage(log: _Log) -> list[str]:
    """Put lines in the order in which they were heard, drop repeats, and return what was wrong."""
    notes = []
    if log.cut:
        notes.append("the last line is cut short and was dropped")
    if log.damaged:
        shown = ", ".join(map(str, log.damaged[:_SHOWN])) + (", ..." if len(log.damaged) > _SHOWN else "")
        notes.append(f"damaged lines that were dropped: {len(log.damaged)} (lines {shown})")
    ordered = sorted(log.heard, key=lambda each: (each.session, each.elapsed))
    moved = sum(one is not other for one, other in zip(ordered, log.heard, strict=True))
    kept = [each for k, each in enumerate(ordered) if not k or each[:2] != ordered[k - 1][:2] or each.line != ordered[k - 1].line]
    if moved:
        notes.append(f"lines that stood out of order and were put back: {moved}")
    if len(kept) < len(ordered):
        notes.append(f"lines that stood twice: {len(ordered) - len(kept)}")
    log.heard[:] = kept
    if log.marks:
        notes.append("marks of the logger: " + ", ".join(f"{word} {count}" for word, count in sorted(log.marks.items())))
    return notes


class _Columns:
    """Columns of a bench log as they grow."""

    def __init__(self, rows: int) -> None:
        self.rows = rows
        self.header: list[str] = []
        self.texts: list[tuple[str, ...]] = []
        self.numbers: dict[str, np.ndarray] = {}
        self.reasons: dict[str, dict[str, list[int]]] = {}
        self.resolution: dict[str, str] = {}
        self.certificates: dict[str, SensorCertificate] = {}

    def add(self, name: str, unit: str, values: np.ndarray, reasons: dict[str, list[int]]) -> None:
        """Add a column; NaN is an empty cell."""
        self.header.append(f"{name} [{unit}]")
        self.texts.append(tuple("" if value != value else repr(value) for value in values.tolist()))
        self.numbers[name] = values.copy()
        self.numbers[name][[row for rows in reasons.values() for row in rows]] = np.nan
        self.reasons[name] = reasons

    def source(self, source: str, lines: dict[int, Line], known: dict[str, Any], bits: int | None) -> list[str]:
        """Add the column of one source, and return what a reader must know of it."""
        is_sensor = len(source) == 16
        name, unit, step = (str(known.get("name", source)), "degC", 1 / 16) if is_sensor else _NAMES[source[0]]
        name = name if is_sensor else name.format(source[1])
        while name in self.numbers:
            name += "'"  # two sensors of one name in the map: both stay
        values = np.full(self.rows, np.nan)
        reasons: dict[str, list[int]] = {}
        for row, line in lines.items():
            if line.fields[1]:
                values[row] = int(line.fields[1]) * step
            if line.fields[2] != "ok":
                reasons.setdefault(_FAULTS[line.fields[2]], []).append(row)
        values = np.round(values, 9)
        notes = []
        if source[0] == "I" and not is_sensor and (over := np.flatnonzero(np.abs(values) >= MOST_CURRENT).tolist()):
            reasons["outside its range"] = over
        if is_sensor:
            reasons |= _not_real(values, np.array(sorted({row for rows in reasons.values() for row in rows}), dtype=int))
            if bits is not None:
                self.resolution[name] = f"{2.0 ** (8 - bits)} [K]"
            if "offset_K" in known:
                paper = {key: float(known[f"{key}_K"]) for key in ("offset", "uncertainty", "at")}
                self.certificates[name] = SensorCertificate(**paper, date=str(known["date"]))
                notes.append(f"{name}: its certificate in the log, of {known['date']}, says {paper['offset']:+g} K")
        absent = sorted(set(range(self.rows)) - set(lines))
        if absent:
            reasons["no sample here"] = absent
        faults = ", ".join(f"{reason} {len(rows)}" for reason, rows in reasons.items() if reason != "no sample here")
        if faults:
            notes.append(f"{name}: masked {faults}")
        self.add(name, unit, values, reasons)
        return notes

    def power(self) -> None:
        """Add the product of voltage and current where both are there."""
        for k in "123456789":
            if f"voltage{k}" in self.numbers and f"current{k}" in self.numbers:
                self.add(f"power{k}", "W", np.round(self.numbers[f"voltage{k}"] * self.numbers[f"current{k}"], 9), {})


def _not_real(values: np.ndarray, bad: np.ndarray) -> dict[str, list[int]]:
    """Return the rows whose value no sensor can measure, and those with 85 degC where the neighbours say otherwise."""
    inside = np.isfinite(values)
    inside[bad] = False
    outside = inside & ((values < RANGE[0]) | (values > RANGE[1]))
    code = inside & (values == 85.0)
    good = inside & ~outside & ~code
    at = np.arange(values.size)
    if good.any():
        code &= np.abs(values - np.interp(at, at[good], values[good])) > 2.0
    found = {"outside its range": np.flatnonzero(outside).tolist(), "85 degC of power-up": np.flatnonzero(code).tolist()}
    return {reason: rows for reason, rows in found.items() if rows}
