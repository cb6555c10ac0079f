"""A log looked at before anything is made of it: how it is laid out, its clock, gaps and faults, and what each column seems to be."""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from io import StringIO
from itertools import count, islice
from pathlib import Path
from typing import Any, Final

import numpy as np

from thermid.base.errors import RecordError, ThermidError, code_of
from thermid.base.results import Result
from thermid.base.units import DAY, HOUR, MINUTE, Array, counted, duration_text, in_si, short, unit
from thermid.measure._readers.columns import decimal_sign
from thermid.measure._readers.common_step import CLOCKS_APART, MIN_EXPLAINED_SHARE, CommonStep, LogCourse, common_step
from thermid.measure._readers.formats import log_cells
from thermid.measure._readers.guess import Column, columns_of
from thermid.measure._readers.headers import name_and_unit
from thermid.measure._readers.questions import board_restarts, hidden_switches, lost_hour, repeated_stamps, unit_question
from thermid.measure._readers.stamps import Clock, Times, clock_column, day_seconds, read_times, zone_offset
from thermid.measure._readers.textfile import Cells
from thermid.measure._record.channel import (
    MOST_PULSES,
    SENSOR_FAULT_CODES,
    Channel,
    even_step,
    gap_from,
    single_pulses,
    unseen_pulses,
    usual_step,
)
from thermid.measure._record.record import thinned_step

ACCURACY: Final = 'add accuracy = "0.5 [K]" to each thermometer, half of the +-1 K of its data sheet; no log shows it'
SUPPLY: Final = "P_supply"
LEAST_POWER_FACTOR = 0.5
"""Part of volts times amperes from which a column of watts may be of the same meter; a driver of lamps has 0.6 to 1. [-]"""
_ELECTRIC: Final = re.compile(r"\A([vuia]|volts?|voltage|spannung|tens[aã]o|amp(ere)?s?|current|strom|corrente)(?=\d*\Z)", re.IGNORECASE)
"""A word that tells a voltage from a current, a number after it apart: `proc V` and `proc A`, `U1` and `I1` are of one supply each."""
_BLOCKS: Final = "▁▂▃▄▅▆▇█"
_SHOWN: Final = ("temperature", "boundary", "power", "duty")
MANY_READINGS: Final = 6000
"""Readings of a log from which its lines for a campaign thin it as `init` does: fits of 18,000 take minutes, and means lose nothing."""
_STAMP: Final = re.compile(r"\d{4}-\d{2}-\d{2}[T ]\d{2}:\d{2}(:\d{2})?")
_BARE: Final = re.compile(r"[A-Za-z0-9_-]+\Z")


@dataclass(frozen=True, eq=False)
class Look(Result):
    """What stands in a log.

    Parameters
    ----------
    path : Path              The file.
    cells : Cells            Its cells and layout.
    decimal : str            Its decimal sign.
    clock : Clock or None    Its time column, or None where it cannot be told.
    times : Times or None    Its times, or None where they cannot be read. [s]
    columns : tuple          Every column with a guess.
    problem : str            Why times cannot be read, with what to do; empty where they can.
    again : dict             Channel -> its name in the lines for a campaign, where another log of the test has one of that name.
    """

    path: Path
    cells: Cells
    decimal: str
    clock: Clock | None
    times: Times | None
    columns: tuple[Column, ...]
    problem: str = ""
    again: Mapping[str, str] = field(default_factory=dict)

    @property
    def gaps(self) -> list[tuple[float, float]]:
        """Starts and lengths of intervals far longer than the usual one [s]."""
        if self.times is None or self.times.values.size < 3:
            return []
        values = np.unique(self.times.values)
        steps = np.diff(values)
        return [(float(values[k]), float(steps[k])) for k in np.flatnonzero(steps > gap_from(values))]

    def __str__(self) -> str:
        """Lines for a terminal."""
        return "\n".join(self.lines())

    def lines(self, width: int = 110) -> list[str]:
        """Return what is in the log, its columns as a table with a small picture of each, and the lines for a campaign."""
        rows = counted(len(self.cells.lines), "row")
        synthetic = ", SYNTHETIC" if self.cells.synthetic else ""
        kinds = [f"{sum(c.guess == kind for c in self.columns)} {kind}" for kind in _SHOWN if any(c.guess == kind for c in self.columns)]
        columns = f"{counted(len(self.columns), 'column')} ({', '.join(kinds) or 'none known'})"
        out = [
            f"{self.path.name}: {self.cells.layout.format}{synthetic}, {rows}, {columns}",
            *(f"  check: {question}" for question in self.questions),
        ]
        if self.problem:
            out.append(f"  NOT READABLE YET: {self.problem}")
        out += [f"  to fill in: {ACCURACY}"] if any(c.guess == "temperature" for c in self.columns) else []
        at = self.cells.layout
        parts = [f"separator {at.separator}"] if at.separator else []
        parts += [f"encoding {at.encoding}"] if at.encoding else []
        parts.append(f"preamble {counted(at.preamble, 'line')}" if at.preamble else "no preamble")
        parts += ["row of units" if at.units_row else "no row of units", f"decimal sign {self.decimal!r}"]
        out += [f"  {line}" for line in (f"layout: {', '.join(parts)}", *self._clock())]
        out += [f"  note: {note}" for note in (*self.cells.notes, *(self.times.notes if self.times else ()))]
        out += ["", *self._table(width), "", *self._remarks(), "For a campaign (insert the nodes and loads of your deck):", ""]
        return [*out, *(f"    {line}".rstrip() for line in self.campaign().splitlines())]

    @property
    def questions(self) -> tuple[str, ...]:
        """What the log leaves open and its owner can answer."""
        columns = {c.name: np.where(np.isfinite(c.values), c.values, np.nan) for c in self.columns if c.guess in _SHOWN and c.values.size}
        warm = {c.name: columns[c.name] for c in self.columns if c.guess in ("temperature", "boundary") and c.name in columns}
        out = [*unit_question({c.name: warm[c.name] for c in self.columns if c.name in warm and c.assumed and c.unit == "degC"})]
        out += [
            f'{c.name}: {c.why}. It is not read as a temperature; unit = "degC" says that it is one.'
            for c in self.columns
            if c.guess == "unclear"
        ]
        if self.times is not None and self.clock is not None:
            times = self.times.values
            out += board_restarts(times, {c.name: c.values for c in self.columns if c.guess == "ignored" and not c.unit and c.values.size})
            # a column that is ignored here may still be bound by a campaign, if it counts neither rows nor milliseconds
            out += repeated_stamps(times, columns | {c.name: c.values for c in self.columns if code_of(c.why) != "record.counter"})
            out += () if self.times.zone else lost_hour(times, self.clock.texts, warm)
            powers = {n: v for n, v in columns.items() if n not in warm}
            powers |= {n: of[0].values * of[1].values for n, of in self.supplies.items() if len(of) == 2}
            out += hidden_switches(times, powers)
            out += unseen_pulses(times, {n: v for n, v in powers.items() if n not in self.cells.prompt})
        return tuple(out)

    def _clock(self) -> list[str]:
        """Return the clock, the sampling and the gaps in words."""
        if self.clock is None or self.times is None:
            return []
        times = self.times.values
        zone = f", zone {self.times.zone}" if self.times.zone else ", no time zone"
        start = self.times.start or self.cells.start
        since = f", from {start}{zone}" if start else ""
        out = [f"clock: '{self.clock.name}' ({self.times.kind}){since}"]
        with self.path.open(encoding="latin-1") as file:
            head = list(islice(file, 0 if start else self.cells.layout.preamble))
        for number, found in ((n, found) for n, line in enumerate(head, 1) if (found := _STAMP.search(line))):
            out.append(f"not used: {found[0]} in line {number} (nothing says that the first sample is of that time)")
        even = "even" if even_step(times) is not None else "uneven"
        if times.size > 1 and times[-1] > times[0]:
            step = usual_step(np.unique(times))
            out.append(f"sampling: every {step:.4g} s ({even}) for {duration_text(float(times[-1] - times[0]))}")
        if gaps := self.gaps:
            longest = max(gaps, key=lambda g: g[1])
            out.append(f"gaps: {len(gaps)}, the longest {duration_text(longest[1])} at {duration_text(longest[0] - float(times[0]))}")
        return out

    def _table(self, width: int) -> list[str]:
        """Return one line for each column: name, unit, guess, range, picture."""
        rows = [("column", "unit", "guess", "from", "to")]
        for c in self.columns:
            good = c.values[c.good] if c.values.size else c.values
            ends = (f"{good.min():.4g}", f"{good.max():.4g}") if good.size else ("", "")
            guess = "supply" if c in self._of_supplies else c.guess
            rows.append((_short(c.name, 28), f"{_short(c.unit, 12)}{'?' if c.assumed else ''}", guess, *ends))
        widths = [max(len(row[k]) for row in rows) for k in range(5)]
        room = max(12, min(40, width - sum(widths) - 12))
        out = []
        for k, row in enumerate(rows):
            drawn = "" if k == 0 else _drawn(self.columns[k - 1], room)
            text = "  ".join([*(row[j].ljust(widths[j]) for j in range(3)), *(row[j].rjust(widths[j]) for j in (3, 4))])
            out.append(f"  {text}  {drawn}".rstrip())
        return out

    def _remarks(self) -> list[str]:
        """Return faults, jumps and what was assumed, column by column."""
        out = []
        for c in self.columns:
            remarks = [f"{count} x {reason}" for reason, count in c.faults.items()]
            remarks += [f"{c.missing} of {c.values.size} missing"] if c.missing else []
            if c.jumps.size and self.times is not None:
                at = duration_text(float(self.times.values[c.jumps[0]] - self.times.values[0]))
                remarks.append(f"{counted(c.jumps.size, 'jump')}, the first at {at}")
            remarks += [f"no unit in the log, {c.unit} assumed"] if c.assumed else []
            if (c.guess == "ignored" and c not in self._of_supplies) or remarks:
                out.append(f"  {c.name}: {'; '.join([c.why, *remarks] if c.guess == 'ignored' else remarks)}")
        return ["Remarks:", *out, ""] if out else []

    @property
    def name(self) -> str:
        """What the record is called in the lines for a campaign."""
        return re.sub(r"\W+", "_", self.path.name.partition(".")[0]).strip("_") or "log"

    def campaign(self) -> str:
        """Return the lines of a campaign for this log (TOML); what is a guess stands behind a comment sign or is marked."""
        name = self.name
        out = [f"[records.{name}]", f"file     = {json.dumps(self.path.name, ensure_ascii=False)}"]
        if self.clock is not None:
            out.append(f"time     = {json.dumps(self.clock.header, ensure_ascii=False)}")
        codes = [f'"{v:.10g} [{c.unit}]"' for c in self.columns for v in c.codes]
        if any(v not in SENSOR_FAULT_CODES or c.unit != "degC" for c in self.columns for v in c.codes):
            steps = [f"{{ faults = {{ codes = [{', '.join(dict.fromkeys(codes))}] }} }}"]
        else:
            steps = ["{ faults = true }"] if any(c.faults for c in self.columns) else []
        if self.times is not None and self.times.values.size > MANY_READINGS:
            steps.append(f'{{ resample = {{ step = "{thinned_step(float(np.ptp(self.times.values))):g} [s]" }} }}')
        out += [f"prepare  = [{', '.join(steps)}]"] if steps else []
        out += ["", f"[records.{name}.channels]"]
        out += [f"# {ACCURACY}"] if any(c.guess == "temperature" for c in self.columns) else []
        for c in self.columns:
            if c.guess in _SHOWN:
                out += self._channel(c)
        for supply, columns in self.supplies.items():
            keys = ("volts", "amperes") if len(columns) == 2 else ("energy",)
            power = ", ".join(f"{key} = {json.dumps(c.name, ensure_ascii=False)}" for key, c in zip(keys, columns, strict=True))
            common = "common " if sum(other[0] is columns[0] for other in self.supplies.values()) > 1 else ""
            what = f"a {common}voltage and a current" if len(columns) == 2 else "a counter of energy"
            out.append(f'{self.again.get(supply, supply)} = {{ load = "{supply}", power = {{ {power} }} }}  # {what}')
        return "\n".join(out) + "\n"

    def _channel(self, c: Column) -> list[str]:
        """Return the line of a campaign that binds a column to what its name and unit look like; of a duty as a comment.

        With what the readings themselves show: their unit where the log has none, the noise of a temperature [K], and ``prompt = false``
        where few pulses of a power have a single reading.
        """
        name = self.again.get(c.name, c.name)
        key = name if _BARE.match(name) else json.dumps(name, ensure_ascii=False)
        column = f"column = {json.dumps(c.name, ensure_ascii=False)}, " if name != c.name else ""
        target = re.sub(r"\W+", "_", name_and_unit(c.header)[0]).strip("_") or "node"
        role = {"temperature": "node", "boundary": "boundary"}.get(c.guess, "load")
        by_name = c.unit not in ("degC", "W") and code_of(c.why) == "record.unit-by-name"
        options = f', unit = "{c.unit}"' if c.assumed or by_name else ""
        if (
            role == "node"
            and c.good.any()
            and (noise := round(Channel.from_array(c.name, in_si(c.values[c.good], c.unit), unit="K").noise_seen, 6))
        ):
            options += f', noise = "{short(noise, 2)} [K]"'
        times = self.times.values if self.times is not None and role == "load" and c.name not in self.cells.prompt else c.values[:0]
        if times.size and single_pulses(times, c.values) < MOST_PULSES:
            options += ", prompt = false"
        why = f"  # {c.why}{'; no unit in the log' if c.assumed else ''}"
        if c.guess == "duty":
            return [f'# {key} = {{ {column}load = "{target}", full_scale = "... [W]"{options} }}{why}']
        return [f'{key} = {{ {column}{role} = "{target}"{options} }}{why}']

    def courses(self) -> list[LogCourse]:
        """Return temperatures [K], powers and duties [W] over the clock of the log [s], with powers of supplies and counters of energy.

        A counter E gives dE/dt up to its next reading, a supply voltage times current; a duty that goes with a power is left out.
        """
        if self.times is None:
            return []
        times = self.times.values - self.times.values[0]
        powers = {c.name: np.where(c.good, in_si(c.values, c.unit or "W"), np.nan) for c in self._shown("power")}
        for columns in self.supplies.values():
            sizes = [in_si(c.values, c.unit) for c in columns]
            if len(columns) == 1:  # the mean power until the next reading
                slopes = np.append(np.diff(sizes[0]) / np.diff(times), np.nan)
                watts = np.where(slopes >= 0.0, slopes, np.nan)
            else:
                watts = sizes[0] * sizes[1]
            powers[" * ".join(c.name for c in columns)] = watts
        duties = {c.name: np.where(c.good, in_si(c.values, c.unit or "W"), np.nan) for c in self._shown("duty")}
        powers |= {n: v for n, v in duties.items() if not any(_alike(v, watts) for watts in powers.values())}
        warm = self._shown("temperature", "boundary")
        out = [LogCourse(c.name, False, times[c.good], in_si(c.values[c.good], c.unit or "degC"), c.guess != "boundary") for c in warm]
        return out + [LogCourse(n, True, times[good], v[good]) for n, v in powers.items() if (good := np.isfinite(v)).any()]

    def _shown(self, *guesses: str) -> list[Column]:
        """Return the columns with readings that seem to be one of these."""
        return [c for c in self.columns if c.guess in guesses and c.good.any()]

    @property
    def unjoined(self) -> list[str]:
        """Names of columns that a joined log does not take: neither a time, nor of a known quantity, nor numbers with a unit."""
        return [c.name for c in self.columns if c.guess not in (*_SHOWN, "time") and not (c.unit and c.good.any())]

    def joined(self, others: Sequence[Look], offsets: Sequence[float | None]) -> str:
        """Return this log and others of one test as one (CSV) on its clock, at the times of all: where a log has no reading, none stands.

        Parameters
        ----------
        others : sequence of Look   Each with columns of its own, from `named_apart`.
        offsets : sequence          When each begins on this clock; None where nothing tells it. [s]

        Raises
        ------
        RecordError   When it is not known when a log begins, or its times cannot be read.
        """
        rows: dict[float, dict[str, str]] = {}
        names = ["time [s]"]
        for one, late in zip((self, *others), (0.0, *offsets), strict=True):
            if one.times is None or late is None:
                raise RecordError(
                    one.problem
                    or f"when does it begin? Give --offset SECONDS after {self.path.name}, for each further log in their order.",
                    one.path.name,
                    code="record.time-unclear",
                )
            times = np.round(one.times.values - one.times.values[0] + late, 6)
            for c in (c for c in one.columns if c.guess != "time" and c.name not in one.unjoined):
                names.append(one.again.get(c.name, c.name) + (f" [{c.unit}]" if c.unit else ""))
                for time, value in zip(times[c.good].tolist(), c.values[c.good].tolist(), strict=True):
                    rows.setdefault(time, {"time [s]": f"{time:.10g}"})[names[-1]] = f"{value:.10g}"
        writer = csv.DictWriter(file := StringIO(), names, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows[time] for time in sorted(rows))
        return f'"{names[0]}"{file.getvalue().removeprefix(names[0])}'  # by which a log of its own is known, as of `Record.to_csv`

    @property
    def supplies(self) -> dict[str, tuple[Column, ...]]:
        """Name of a power -> its columns in volts and in amperes, or that of a counter of energy where the log has no other power."""
        powers = [in_si(c.values, c.unit or "W") for c in self.columns if c.guess == "power"]
        pairs: dict[str, tuple[Column, ...]] = {
            n: (u, i) for n, (u, i) in self._pairs().items() if not any(_metered(watts, u, i) for watts in powers)
        }
        if pairs or powers:
            return pairs
        counters = [c for c in self.columns if c.unit and _is(c.unit, "J") and c.values.size]
        return {SUPPLY + (f"_{k}" if k > 1 else ""): (c,) for k, c in enumerate(counters, 1)}

    def _pairs(self) -> dict[str, tuple[Column, Column]]:
        """Return a power for the only voltage and current, the only ones with the same other words, or every current of one voltage."""
        volts, amperes = ([c for c in self.columns if c.unit and _is(c.unit, slot) and c.values.size] for slot in ("V", "A"))
        if len(volts) == len(amperes) == 1:
            return {SUPPLY: (volts[0], amperes[0])}
        # what names of voltages and currents say beside that, in the characters of a bare key
        names = [[[_ELECTRIC.sub("", w) for w in re.split(r"[\W_]+", c.name)] for c in columns] for columns in (volts, amperes)]
        words, others = (["_".join(filter(None, name)) for name in several] for several in names)
        if len(volts) == 1 and len({*others}) == len(others):
            return {f"P_{w}" if w else SUPPLY: (volts[0], current) for w, current in zip(others, amperes, strict=True)}
        shared = [w for w in words if words.count(w) == others.count(w) == 1]
        return {f"P_{w}" if w else SUPPLY: (volts[words.index(w)], amperes[others.index(w)]) for w in shared}

    @property
    def _of_supplies(self) -> list[Column]:
        """The columns that powers follow from."""
        return [c for columns in self.supplies.values() for c in columns]

    def as_object(self) -> dict[str, Any]:
        """Return the same as JSON holds it; values in the units of the columns, times in seconds."""
        times = self.times.values if self.times is not None else np.zeros(0)
        columns = [
            {"name": c.name, "unit": c.unit, "assumed": c.assumed, "guess": c.guess, "why": c.why}
            | {"missing": c.missing, "faults": c.faults, "jumps": int(c.jumps.size)}
            | ({"low": float(c.values[c.good].min()), "high": float(c.values[c.good].max())} if c.values.size and c.good.any() else {})
            for c in self.columns
        ]
        clock = {"column": self.clock.name, "kind": self.times.kind, "zone": self.times.zone} if self.clock and self.times else None
        sampling = {"step": float(usual_step(np.unique(times))), "length": float(times[-1] - times[0])} if times.size > 1 else None
        start = None if self.times is None else self.times.start or self.cells.start
        return {
            "file": self.path.name,
            "problem": self.problem,
            "rows": len(self.cells.lines),
            **asdict(self.cells.layout),
            "decimal": self.decimal,
            "clock": clock,
            "start": start,
            "sampling": sampling,
            "gaps": [{"at": a - float(times[0]), "length": b} for a, b in self.gaps],
            "columns": columns,
            "questions": list(self.questions),
            "notes": list(self.cells.notes),
            "campaign": self.campaign(),
        }


WHICH_ZONE: Final = "Stamps alone leave whole hours open, and no common step decides. "
_OF_DAY = re.compile(r"(\d{1,2}):(\d{2})(?::(\d{2}(?:[.,]\d+)?))?(?:\s*([AaPp])\.?[Mm])?")


def _metered(watts: Array, volts: Column, amperes: Column) -> bool:
    """Return whether a power is that of a meter's volts and amperes, by its size and its course."""
    product = in_si(volts.values, volts.unit) * in_si(amperes.values, amperes.unit)
    good = np.isfinite(watts) & np.isfinite(product)
    return _alike(watts, product) and bool(LEAST_POWER_FACTOR < watts[good].sum() / product[good].sum() < 1.05)


def _alike(one: Array, other: Array) -> bool:
    """Return whether two powers (samples,), NaN where there is none, have one course: what one explains of the other, scaled."""
    good = np.isfinite(one) & np.isfinite(other)
    a, b = one[good], other[good]
    return bool(a.size and np.ptp(a) and np.ptp(b) and np.corrcoef(a, b)[0, 1] ** 2 > MIN_EXPLAINED_SHARE[False])


def _time_of_day(look: Look) -> float | None:
    """Return the time of day at which a log begins, by its first stamp, in UTC where that has a zone; None where it has none. [s]"""
    text = None if look.times is None else look.times.start or look.cells.start
    match = _OF_DAY.search(text or "")
    if match is None:
        return None
    return day_seconds(*match.groups()) - zone_offset(_zone(look))


def _zone(look: Look) -> str:
    """Return the time zone that a log states; empty for none."""
    return look.times.zone if look.times is not None else ""


def _starts(looks: Sequence[Look], steps: Mapping[tuple[int, int], CommonStep]) -> tuple[list[float | None], str]:
    """Return the times of day at which logs begin, on one clock [s], and what is to be checked where only some state their zone.

    The zone of the others, taken as one, is the half hours that common steps leave between the stamps. Where none does, their stamps do
    not count beside those of the rest.
    """
    starts = [_time_of_day(one) for one in looks]
    stamped = [k for k, start in enumerate(starts) if start is not None]
    local, stated = ([k for k in stamped if bool(_zone(looks[k])) is has] for has in (False, True))
    if not local or not stated:
        return starts, ""
    names, zones = (
        ", ".join(texts) for texts in ([looks[k].path.name for k in local], [f"{looks[k].path.name} {_zone(looks[k])}" for k in stated])
    )
    said = f"check: no time zone is stated in {names}, but in {zones}. "
    shown = [(steps[j, k], _late(starts[j], starts[k]) or 0.0) for j in local for k in stated if (j, k) in steps]
    step, late = min((pair for pair in shown if not pair[0].candidate), key=lambda pair: pair[0].error, default=(None, 0.0))
    ahead = 0.5 * HOUR * round((step.offset - late) / (0.5 * HOUR)) if step is not None else 0.0
    if step is not None and abs(step.offset - late - ahead) < CLOCKS_APART > step.error:
        sign = "ahead of" if ahead >= 0.0 else "behind"
        starts = [start - ahead if start is not None and k in local else start for k, start in enumerate(starts)]
        said += f"Common steps fit if {names} is {abs(ahead) / HOUR:g} h {sign} UTC, and the offsets below count that"
        return starts, said
    kept, others, sign = (local, stated, "+") if stamped[0] in local else (stated, local, "-")
    late = (starts[others[0]] or 0.0) - (starts[stamped[0]] or 0.0)
    asked = f"If {names} is h hours ahead of UTC, the offset is {late:.6g} {sign} 3600 h s: which zone is it?"
    said += "The common steps below give the offsets, so no zone is needed" if step is not None else WHICH_ZONE + asked
    return [start if k in kept else None for k, start in enumerate(starts)], said


def clocks_of(looks: Sequence[Look]) -> list[dict[str, Any]]:
    """Return of each further log how it may be joined with the first one, by the times of day of their first stamps and by common steps.

    `offset` is by how much its first sample is late on the first one, if both clocks are right; None where one has no stamps. [s]
    `step` has by how much it is late on another log, `after`, by a step of a power or temperature that both show, with its standard
    error [s]; `stamps` is the same by their stamps, and `contradicted` whether that is further away than the error allows. `at` is the
    offset from the first log by the steps and stamps between them, with the error of both. [s] `step` is left out where stamps alone give
    the place, and `at` too where nothing does, or where they are of temperatures, whose offset by stamps is stated. `zone` is what is to
    be checked where only some logs state their time zone.

    Notes
    -----
    From the first log on, the log that is placed best comes next: by a step with a power, by two temperatures that stamps contradict, by
    stamps, by two temperatures. Stamps of another log than the first one count where that has none. So two
    loggers of temperatures meet by way of the supply that both follow.
    """
    courses = [one.courses() for one in looks]
    steps = {(j, k): f for k in range(len(looks)) for j in range(k) if (f := common_step(courses[j], courses[k])) is not None}
    steps |= {(k, j): replace(f, offset=-f.offset, first=f.second, second=f.first) for (j, k), f in steps.items()}
    starts, said = _starts(looks, steps)
    places = {0: _OffsetSoFar(0.0)}
    entries: dict[int, dict[str, Any]] = {
        k: {"file": further.path.name, "record": further.name, "offset": _late(starts[0], starts[k])} | ({"zone": said} if said else {})
        for k, further in enumerate(looks)
    }
    while len(places) < len(looks):
        ways = [
            _Way(places[j], j, k, steps.get((j, k)), _late(starts[j], starts[k]), any(c.guess == "temperature" for c in looks[k].columns))
            for j in places
            for k in entries
            if k not in places
        ]
        best = min(ways, key=lambda way: way.rank)
        entry, place, step = entries[best.to], best.place, best.by_step
        places[best.to] = place
        after = {"after": looks[best.after].path.name}
        if step is not None:
            entry["step"] = {"offset": step.offset, "error": step.error, "columns": [step.first, step.second], "candidate": step.candidate}
            entry["step"] |= after | {"stamps": best.stamps, "contradicted": bool(best.contradicted)}
        if place.at is not None and (step is not None or said or best.after or not best.warm):
            away = np.inf if entry["offset"] is None else abs(place.at - entry["offset"])
            reach = MAX_OFFSET_ERRORS if place.error > STAMPS_APART else 1.0
            entry["at"] = {"offset": place.at, "error": place.error, "stamps": place.stamped} | (after if step is None else {})
            entry["at"] |= {"candidate": place.candidate, "by_stamps": step is None or bool(away <= reach * place.error)}
    return [entries[k] for k in range(1, len(looks))]


@dataclass(frozen=True)
class _OffsetSoFar:
    """Where a log begins on the clock of the first one, with the error of the steps and stamps that it is from [s].

    `stamped` says whether stamps are used, `candidate` whether one of the steps is of two places, of which one may lag the other.
    """

    at: float | None
    error: float = 0.0
    stamped: bool = False
    candidate: bool = False


@dataclass(frozen=True)
class _Way:
    """From a log that has its place to one that has none yet: by the step that both show, or by their stamps [s].

    A log of temperatures (`warm`) is placed by stamps before one of powers, whose clock a fit can find.
    """

    before: _OffsetSoFar
    after: int
    to: int
    step: CommonStep | None
    stamps: float | None
    warm: bool

    @property
    def contradicted(self) -> bool | None:
        """Return whether stamps are further from the step than that may be off; None without one of them."""
        if self.step is None or self.stamps is None:
            return None
        return abs(self.step.offset - self.stamps) > MAX_OFFSET_ERRORS * self.step.error

    @property
    def by_step(self) -> CommonStep | None:
        """Return the step, unless it says nothing beside stamps that agree with it: where one of two places may lag the other."""
        return None if self.step is not None and self.step.candidate and self.contradicted is False else self.step

    @property
    def rank(self) -> tuple[bool, bool, bool, bool, bool, float]:
        """Return what orders ways, the best one first."""
        place = self.place
        return place.at is None, place.candidate, place.stamped, self.by_step is None, not self.warm, place.error

    @property
    def place(self) -> _OffsetSoFar:
        """Return where this way puts the log; two clocks that nobody set by each other are minutes apart at most."""
        step, before = self.by_step, self.before
        if before.at is None or (step is None and self.stamps is None):
            return _OffsetSoFar(None, stamped=True)
        if step is None:
            error = float(np.hypot(before.error, CLOCKS_APART / MAX_OFFSET_ERRORS))
            return _OffsetSoFar(before.at + (self.stamps or 0.0), error, True, before.candidate)
        error = float(np.hypot(before.error, step.error))
        return _OffsetSoFar(before.at + step.offset, error, before.stamped, before.candidate or (step.candidate and not self.contradicted))


def _late(first: float | None, second: float | None) -> float | None:
    """Return by how much one time of day is later than another, by half a day at most; None where one is not known. [s]"""
    return None if first is None or second is None else (second - first + 0.5 * DAY) % DAY - 0.5 * DAY


def named_apart(looks: Sequence[Look]) -> list[Look]:
    """Return logs of one test whose channels have different names in the lines for a campaign, so that they can be joined."""
    taken: set[str] = set()
    out = []
    for look in looks:
        names = [c.name for c in look.columns if c.guess in _SHOWN] + [*look.supplies]
        again = {name: next(n for k in count(2) if (n := f"{name}_{k}") not in taken.union(names)) for name in taken.intersection(names)}
        taken.update(again.get(name, name) for name in names)
        out.append(replace(look, again=again))
    return out


def clock_lines(looks: Sequence[Look], clocks: Sequence[dict[str, Any]]) -> list[str]:
    """Return how several logs of one test are joined, `clocks_of` them in words and as lines for a campaign; nothing for one log."""
    if not clocks:
        return []
    with_stamp = [f for f in clocks if f["offset"] is not None]
    lines = [clocks[0]["zone"]] if "zone" in clocks[0] else []
    lines += [f"{counted(len(looks), 'clock')} of one test, compared by the time of day of their first stamps"] if with_stamp else []
    lines += [
        f"  {f['file']} begins {abs(f['offset']):.6g} s {'after' if f['offset'] >= 0 else 'before'} {looks[0].path.name}"
        for f in with_stamp
    ]
    for f, other in zip(clocks, looks[1:], strict=True):
        lines += _by_step(f, looks[0], other)
    compared = {f["record"] for f, other in zip(clocks, looks[1:], strict=True) if any(c.guess == "temperature" for c in other.columns)}
    for f in (f for f in with_stamp if "at" not in f or "step" not in f):
        advice = ALIGNED if f["record"] in compared else "a range has it fitted" if "at" in f else "give a range to have it fitted"
        lines.append(f"  {f['file']} is placed by time stamps; two loggers' clocks may differ by minutes: {advice}")
    by_stamps = [f for f in with_stamp if f["record"] in compared and "at" in f and f["at"]["by_stamps"]]
    fitted = [f for f in clocks if "at" in f and not f["at"]["candidate"] and f not in by_stamps]
    pairs = ", ".join(f'{{ record = "{f["record"]}", offset = {_offset(f, f in fitted)} }}' for f in clocks)
    return [
        *lines,
        f"Join them in [records.{looks[0].name}]" + ("; a pair as offset is a range in which the fit finds it:" if fitted else ":"),
        "",
        f"    joined   = [{pairs}]",
    ]


def _by_step(clock: dict[str, Any], first: Look, other: Look) -> list[str]:
    """Return what a common step says of a clock, and whether the stamps agree with it."""
    if "step" not in clock and "at" in clock and clock["offset"] is None:
        at = clock["at"]
        begins = f"{_digits(abs(at['offset']), 4)} s {'after' if at['offset'] >= 0 else 'before'} {first.path.name}"
        return [f"  by its stamps and those of {at['after']}, {clock['file']} begins {begins}, +- {_digits(at['error'], 2)} s"]
    if "step" not in clock:
        bare = [f"{look.path.name} {_bare(look)}" for look in (first, other) if _time_of_day(look) is None]
        return [f"  {', '.join(bare)}, and {UNDECIDED}"] if bare else []
    step = clock["step"]
    late, error = round(step["offset"], 3), step["error"]
    a, b = step["columns"]
    side = "after" if late >= 0 else "before"
    begins = f"{clock['file']} begins {_digits(abs(late), 4)} s {side} {step['after']}, +- {_digits(error, 2)} s"
    text = f"  by a common step of {a} and {b}, {begins}"
    if step["candidate"]:
        text += f" (a candidate, because one of two places may lag the other: {ALIGNED})"
    away = abs(late - (step["stamps"] or 0.0))
    if not step["contradicted"]:
        better = " and tell more than a step known no better" if error > STAMPS_APART and away > error else ""
        used = f"{better}, and are used where no fit finds the offset" if clock.get("at", {}).get("by_stamps") else ""
        near = f"; its stamps are {away:.3g} s from that, within {MAX_OFFSET_ERRORS:g} errors{used}"
        return [text if step["stamps"] is None else text + near]
    by_stamps = clock["at"]["offset"] - late + step["stamps"] if clock["offset"] is None and "at" in clock else clock["offset"]
    both_right = "" if by_stamps is None else f" If both clocks are right, heat arrives late: write {by_stamps:.6g} s"
    follows = " The line below follows the step." if "at" in clock else ""
    check = f"    check: its stamps are {away:.3g} s from that, {away / error:.0f} errors, so a clock is wrong.{follows}{both_right}"
    return [text, check]


def _digits(value: float, count: int) -> str:
    """Return a number with some digits, or all before its point."""
    return f"{value:.{count}g}" if abs(value) < 10.0**count else f"{value:.0f}"


def _bare(look: Look) -> str:
    """Return why a log has no clock."""
    return "is not readable yet" if look.times is None else "has no time stamps"


def _offset(clock: dict[str, Any], fitted: bool) -> str:
    """Return the offset of a further log as a campaign writes it: a range that the errors leave, one number, or a gap to fill.

    Stamps of two computers may be minutes apart, so that a fit looks for the offset. A log of temperatures whose stamps no step
    contradicts is taken at these. A candidate is a gap to fill: nothing tells by how much one place is later than the other.
    """
    if fitted:
        low, high = offset_range(clock)
        return f'["{low} [s]", "{high} [s]"]'
    late = stated_offset(clock)
    return '"... [s]"' if late is None else f'"{late:.6g} [s]"'


def stated_offset(clock: dict[str, Any]) -> float | None:
    """Return the offset of a further log where no fit finds it: by its stamps or by common steps; None where neither tells it. [s]"""
    at, by_stamps = clock.get("at"), clock["offset"]
    late: float | None = by_stamps if at is None or at["by_stamps"] else None if at["candidate"] else at["offset"]
    return late


def offset_range(clock: dict[str, Any]) -> tuple[str, str]:
    """Return the ends of the range that errors of steps leave for an offset, as written. [s]"""
    late, reach = round(clock["at"]["offset"], 3), MAX_OFFSET_ERRORS * clock["at"]["error"]
    return _digits(late - reach, 4), _digits(late + reach, 4)


UNDECIDED = (
    "no step of a power decides it, by the way that the temperatures answer: give the offset, or a range in which the fit finds it: "
    "offset = ['-300 [s]', '300 [s]']"
)
ALIGNED = "give a range to have it fitted by the model"
STAMPS_APART = MINUTE
"""By how much stamps of two computers are usually apart: a step with a larger error that agrees with them tells less than they do. [s]"""
MAX_OFFSET_ERRORS = 3.0
"""Standard errors of an offset that a fit may look for it in, and beyond which stamps disagree with it. [-]"""


def _drawn(column: Column, width: int) -> str:
    """Return readings as a line of at most `width` blocks, means of equal parts from lowest to highest; a part without any is blank."""
    if column.guess not in _SHOWN or not column.good.any():
        return ""
    values = np.where(column.good, column.values, np.nan)
    low, high = np.nanmin(values), np.nanmax(values)
    out = ""
    for part in np.array_split(values, min(width, values.size)):
        finite = part[np.isfinite(part)]
        level = 0.0 if not finite.size or high == low else (float(finite.mean()) - low) / (high - low)
        out += _BLOCKS[min(7, int(level * 8))] if finite.size else " "
    return out


def _short(text: str, width: int) -> str:
    """Return a text cut to a width, its last four characters kept."""
    return text if len(text) <= width else f"{text[: width - 6]}..{text[-4:]}"


def look(
    path: str | Path,
    *,
    time: str | None = None,
    separator: str | None = None,
    decimal: str | None = None,
    clock: str | None = None,
    unit: str | None = None,
) -> Look:
    """Return what stands in a log: layout, clock, sampling, gaps, faults, and what each column seems to be.

    Nothing is decided by it: what `read_record` would refuse for its times is shown as the problem, with what to do.

    Parameters
    ----------
    path : str or Path         A log in any format that `read_record` reads.
    time : str or None         The time column, where it cannot be told.
    separator, decimal : str   Separator of the columns and decimal sign, where the file leaves them open.
    clock : str or None        Form of the stamps for `datetime.strptime`.
    unit : str or None         Unit of the times, where they are numbers.

    Raises
    ------
    MissingDataError   When there is no such file.
    RecordError        When its columns cannot be told.
    """
    place = Path(path)
    cells = log_cells(place, separator)
    sign = decimal_sign(cells, decimal)
    at: Clock | None = None
    times: Times | None = None
    problem = ""
    try:
        at = clock_column(cells, time)
        times = read_times(cells, at, sign, clock, unit or at.unit, unit is not None)
    except ThermidError as error:
        problem = str(error)
    columns = columns_of(cells, sign, at.places if at else ())
    return Look(place, cells, sign, at, times, tuple(columns), problem)


def _is(text: str, slot: str) -> bool:
    """Whether a text is a unit of a slot's dimension."""
    try:
        return unit(text).dimension == unit(slot).dimension
    except ThermidError:
        return False
