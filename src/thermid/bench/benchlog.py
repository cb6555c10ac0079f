"""The log of a bench: its file, appended to line by line; its times, by two clocks; and its cells, as a reader takes them.

Of a log that is read the board's clock tells durations, the host's says when. Lines are checked, put in order, and made one row for each
cycle; faults are masked by their name, damage is named.
"""

from __future__ import annotations

import errno
import json
import os
import re
import tempfile
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from thermid.base.errors import CodedText, OutputError, RecordError
from thermid.base.files import FileKinds
from thermid.base.units import Kelvin
from thermid.bench._wire import COUNTER_RANGE, MAGIC, BoardLine, parse_line, sealed, unsealed
from thermid.measure.readers import UNFINISHED, Cells, is_bench_log
from thermid.measure.records import SensorCertificate

RANGE: Final = (-55.0, 125.0)
"""What a DS18B20 can measure, by its data sheet; -127, which its usual driver gives for a lost one, lies outside. [degC]"""
MAX_CURRENT: Final = 3.2
"""What an INA219 can measure with 0.1 ohm; at that it shows the limit itself. [A]"""

_BODY: Final = re.compile(r"(\d{1,6}) (\d{1,9}\.\d{6}) (.+)\Z", re.ASCII)
_FAULTS: Final = {"crc": "wrong CRC", "lost": "sensor lost", "short": "bus shorted", "power": "sensor without supply"}
_NAMES: Final = {"H": ("heater{}", "%", 0.1), "V": ("voltage{}", "V", 1e-3), "I": ("current{}", "A", 1e-4)}
_MAX_LISTED_LINES: Final = 8
_UNPRINTABLE: Final = re.compile(r"[^ -~]")
_NEAR_WRAP: Final = COUNTER_RANGE - (1 << 24)
"""Counters above it are about to wrap: within 2^24 of 2^32, 4.7 hours of milliseconds."""
_MIN_DRIFT_TIME: Final = 600.0
_MAX_CLOCK_DRIFT: Final = 0.02
"""No quartz or resonator is off by 2 %; a simulated board, run faster than time, is."""
_SESSION = re.compile(rb'^# session \{"number": (\d{1,6})', re.MULTILINE)
_WALL = re.compile(rb'^# session \{"number": (\d{1,6}), "wall": "([^"]*)"', re.MULTILINE)
_TRIP = re.compile(rb"^# mark (\d{1,6}) (\d{1,9}\.\d{6}) (overtemp|blind|cleared) (.*) [0-9A-F]{4}$", re.MULTILINE)
_MAX_WAITING_BYTES = 64 << 20


def log_line(body: str) -> str:
    """Return a line of the log with its own CRC and line feed, unprintable characters as ``?``; the CRC also covers the host's stamp."""
    return sealed(_UNPRINTABLE.sub("?", body), " ") + "\n"


class LogFile:
    """A log that lines are appended to, made new or continued; a lock keeps other loggers out.

    Parameters
    ----------
    path : str or Path   The file.
    sync : bool          Whether each line is forced onto the disk itself, so that it outlives a power cut.

    Raises
    ------
    RecordError   When it cannot be written, is another kind of file, or another logger writes to it.
    """

    def __init__(self, path: str | Path, *, sync: bool = True) -> None:
        self.path = Path(path)
        self._sync = sync
        self._waiting = bytearray()
        self.full = False
        self.dropped = 0
        self.rest: Path | None = None
        """Where the end of the log is, when its own disk was full to the last."""
        self.trip = ""
        """When and why the log so far says that heaters were cut off, and nobody has allowed them again."""
        self._file = self._open_file()
        try:
            self.session, self.was_cut = self._lock_and_check()
        except BaseException:
            os.close(self._file)
            raise
        if self._sync and os.name == "posix":
            folder = os.open(self.path.absolute().parent, os.O_RDONLY)
            try:
                os.fsync(folder)
            finally:
                os.close(folder)

    def _open_file(self) -> int:
        """Return the descriptor of the file, opened to append.

        Raises
        ------
        RecordError   When its folder is missing, it may be a project's file, or it cannot be written.
        """
        if not self.path.absolute().parent.is_dir():
            raise RecordError(f"there is no folder '{self.path.parent}'. Create it first.", str(self.path), code="bench.log")
        # an empty file is taken for a new log; thermid.toml, which marks the root of a project, may be empty too, under any name
        linked = self.path.exists() and self.path.stat().st_size == 0 and self.path.stat().st_nlink > 1
        if self.path.resolve().suffix == ".toml" or linked:
            why = "the file has another link, so it is not a new log" if linked else "a log cannot be a TOML file"
            raise RecordError(f"{why}. Give another name, such as bench.csv; nothing was written.", str(self.path), code="bench.log")
        try:
            return os.open(self.path, os.O_RDWR | os.O_APPEND | os.O_CREAT, 0o644)
        except OSError as error:
            raise RecordError(f"it cannot be written: {error.strerror}. Give another place.", str(self.path), code="bench.log") from None

    def _lock_and_check(self) -> tuple[int, bool]:
        """Lock the file; return the number of this session, and whether the last line of the one before was cut.

        Raises
        ------
        RecordError   When another logger holds the lock, or the file is no log of the bench.
        """
        if os.name == "posix":
            import fcntl

            try:
                fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                raise RecordError(
                    "another logger is writing to it. Stop that one, or give another file.", self.path.name, code="bench.log"
                ) from None
        data = self.path.read_bytes()
        if not data:
            self._queue(f"{MAGIC}\n".encode())
            return 1, False
        if not is_bench_log(data) and not f"{MAGIC}\n".encode().startswith(data):
            raise RecordError(
                "it is not empty and not a log of the bench. Give another file; nothing was written.",
                self.path.name,
                code="output.over-another-file",
            )
        self.trip = _last_cut_off(data)
        cut = not data.endswith(b"\n")
        if cut:
            self._queue(b"\n" if is_bench_log(data) else f"\n{MAGIC}\n".encode())
        return max((int(number) for number in _SESSION.findall(data)), default=0) + 1, cut

    def write(self, body: str) -> None:
        """Append one line with its CRC; what a full disk does not take waits in memory, up to 64 MB."""
        self._queue(log_line(body).encode())

    def _queue(self, data: bytes) -> None:
        """Queue bytes and write what waits; beyond 64 MB they are dropped and counted."""
        if len(self._waiting) + len(data) > _MAX_WAITING_BYTES:
            self.dropped += 1
            return
        self._waiting += data
        self.retry()

    def retry(self) -> None:
        """Write the bytes that wait; `full` is then whether the disk refused some.

        Raises
        ------
        OSError   For a reason other than a full or failing disk.
        """
        wrote = False
        while self._waiting:
            try:
                done = os.write(self._file, self._waiting)
            except OSError as error:
                if error.errno not in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO):
                    raise
                self.full = True
                return
            del self._waiting[:done]
            wrote = True
        self.full = False
        if wrote and self._sync:
            getattr(os, "fdatasync", os.fsync)(self._file)

    @property
    def waiting(self) -> int:
        """Number of bytes that a full disk did not take."""
        return len(self._waiting)

    def close(self) -> None:
        """Write the bytes that wait and close the file; those that its disk still refuses go to another folder, `rest`."""
        self.retry()
        os.close(self._file)
        for folder in (Path(tempfile.gettempdir()), Path.home()) if self._waiting else ():
            place = folder / f"{self.path.name}.{os.getpid()}.rest"
            try:
                FileKinds.COPY.save_bytes(place, bytes(self._waiting))
            except (OSError, OutputError):
                continue
            self.rest = place
            return


def _last_cut_off(data: bytes) -> str:
    """Return when and why the log says that heaters were cut off last; empty where they were not, or were allowed again."""
    marks = _TRIP.findall(data)
    if not marks or marks[-1][2] == b"cleared":
        return ""
    session, elapsed, word, text = (field.decode("latin-1") for field in marks[-1])
    walls = {number.decode(): wall.decode("latin-1") for number, wall in _WALL.findall(data)}
    of = re.sub(r"^(reported by the board|the board says so)( of )?", "", text)  # the second in logs of earlier versions
    why = f"over-temperature{' of ' + of if of else ''}" if word == "overtemp" else "no sensor could be read"
    return f"{why}, {float(elapsed):.0f} s after the start {session} of this log ({walls.get(session, 'at an unknown time')})"


class HeardLine(NamedTuple):
    """A line of the board and when it was heard.

    Parameters
    ----------
    session : int     Number of the start of the logger.
    elapsed : float   Time since that start, by the host's monotonic clock. [s]
    at : int          Line of the file.
    line : BoardLine  The line.
    """

    session: int
    elapsed: float
    at: int
    line: BoardLine


class _Run(NamedTuple):
    """Lines from one reset of the board to the next: places among the lines, host times [s], board times [s], sessions."""

    places: list[int]
    host: np.ndarray
    board: np.ndarray
    sessions: np.ndarray


def clocks(heard: Sequence[HeardLine], walls: Mapping[int, str]) -> tuple[list[float], list[str]]:
    """Return the time of each line from the first one [s], and remarks on the clocks.

    Within one run of the board its own clock counts: t = begin + rate (board - board[0]). The rate is its drift against the host where ten
    minutes or more show it (`_clock_rate`), else 1; also 1 for a board that runs more than 2 % fast or slow, which is a simulated one.

    Parameters
    ----------
    heard : sequence of HeardLine   Lines in the order in which they were heard.
    walls : dict                    Session -> wall time of its start, ISO 8601.
    """
    starts, notes = _session_starts(heard, walls)
    runs, lost = _runs_of_board(heard, starts)
    moments = [0.0] * len(heard)
    rate = 1.0  # host seconds in a board second, of the last run that showed it
    origin = end = last_host = 0.0
    drifts = []
    for k, run in enumerate(runs):
        measured_rate = _clock_rate(run)
        if measured_rate is not None:
            rate = measured_rate
            drifts.append(measured_rate)
        simulated = abs(rate - 1.0) > _MAX_CLOCK_DRIFT
        board_time = (run.board - run.board[0]) * (1.0 if simulated else rate)
        # the median forgives lines that a busy host stamped late
        mine = run.sessions == run.sessions[0]
        begun = float(run.host[0] if simulated else np.median(run.host[mine] - board_time[mine]))
        origin = origin if k else begun
        begin = end + (float(run.host[0]) - last_host) / rate if simulated else begun - origin
        begin = max(begin, end + 1e-3) if k else 0.0
        for place, moment in zip(run.places, (board_time + begin).tolist(), strict=True):
            moments[place] = round(moment, 6)
        end, last_host = float(board_time[-1]) + begin, float(run.host[-1])
    if len(runs) > 1:
        notes.append(CodedText(f"resets of the board: {len(runs) - 1}", "bench.resets"))
    if lost:
        notes.append(CodedText(f"missing lines of the board: {lost}", "bench.missing-lines"))
    if drifts and abs(drifts[-1] - 1.0) > _MAX_CLOCK_DRIFT:
        notes.append(
            CodedText(
                f"the board's clock runs {1.0 / drifts[-1]:.3g} times as fast as the host's, so it is a simulated board; "
                "its own times are used",
                "bench.simulated-clock",
            )
        )
    elif drifts:
        notes.append(
            CodedText(
                f"the board's clock is {(drifts[-1] - 1.0) * 1e6:+.0f} ppm slow against the host's; times are corrected",
                "bench.board-clock",
            )
        )
    return moments, notes


def _session_starts(heard: Sequence[HeardLine], walls: Mapping[int, str]) -> tuple[dict[int, float], list[str]]:
    """Return session -> its start from the first one [s], and remarks; a start that is unknown or too early follows the session before."""
    starts: dict[int, float] = {}
    notes: list[str] = []
    last: dict[int, float] = {}
    for line in heard:
        last[line.session] = max(last.get(line.session, 0.0), line.elapsed)
    end, origin = 0.0, None
    for session in sorted(last):
        wall = _wall_seconds(walls.get(session))
        origin = wall if origin is None else origin
        start = wall - origin if wall is not None and origin is not None else None
        if start is None or start < end:
            if starts:
                why = (
                    "is not in the log"
                    if wall is None
                    else ("is before the end of the previous session, because the host's clock was set back")
                )
                notes.append(CodedText(f"the start of session {session} {why}; it is placed directly after it", "bench.start-placed"))
            start = end
        starts[session] = start
        end = start + last[session]
    if len(starts) > 1:
        notes.append(CodedText(f"starts of the logger: {len(starts)}", "bench.starts"))
    return starts, notes


def _wall_seconds(wall: str | None) -> float | None:
    """Return a wall time as seconds since 1970; None where it is no ISO 8601 stamp."""
    try:
        return datetime.fromisoformat(wall).timestamp() if wall else None
    except (ValueError, OverflowError):
        return None


def _runs_of_board(heard: Sequence[HeardLine], starts: Mapping[int, float]) -> tuple[list[_Run], int]:
    """Return the runs of the board between its resets, and how many of its lines are missing.

    A reset shows as a number or time that falls back; both counters may also wrap at 2^32. Lines are numbered from 0 at a reset, so the
    number of the first line after it is how many are missing; those before the first line of all are not counted.
    """
    groups: list[list[tuple[int, float, float, int]]] = []
    lost = 0
    number = ms = turns = 0
    for place, (session, elapsed, _, line) in enumerate(heard):
        wrapped = ms > _NEAR_WRAP and line.ms < COUNTER_RANGE - _NEAR_WRAP and line.number >= number
        again = line.number <= number or (line.ms < ms and not wrapped)
        if number > _NEAR_WRAP and line.number < COUNTER_RANGE - _NEAR_WRAP:
            again = False
        if not groups or again:
            groups.append([])
            turns = 0
            lost += line.number if len(groups) > 1 else 0
        else:
            lost += (line.number - number - 1) % COUNTER_RANGE
            turns += wrapped
        number, ms = line.number, line.ms
        groups[-1].append((place, starts[session] + elapsed, (ms + turns * COUNTER_RANGE) / 1000.0, session))
    runs = []
    for group in groups:
        places, host, board, sessions = zip(*group, strict=True)
        runs.append(_Run(list(places), np.array(host), np.array(board), np.array(sessions)))
    return runs, lost


def _clock_rate(run: _Run) -> float | None:
    """Return seconds of the host per second of the board [s/s], by the session of a run with most lines; None where it is too short to say.

    Where first and last line differ from 1 by more than `_MAX_CLOCK_DRIFT`, it is that ratio: a simulated board. Otherwise it is the slope
    of a least-squares line, made three times without lines more than four median absolute deviations (1 ms at least) off: a busy host
    stamps late.
    """
    best = max(set(run.sessions.tolist()), key=lambda s: int(np.count_nonzero(run.sessions == s)))
    mine = run.sessions == best
    host, board = run.host[mine], run.board[mine]
    if host.size < 20 or board[-1] - board[0] < 5.0 or host[-1] <= host[0]:
        return None
    keep = np.ones(host.size, dtype=bool)
    slope = float(host[-1] - host[0]) / float(board[-1] - board[0])
    if abs(slope - 1.0) > _MAX_CLOCK_DRIFT:
        return slope
    if board[-1] - board[0] < _MIN_DRIFT_TIME:
        return None
    for _ in range(3):  # a stalled host stamps late, never early
        slope, start = np.polyfit(board[keep] - board[0], host[keep], 1)
        off = host - (start + slope * (board - board[0]))
        keep = np.abs(off - np.median(off)) <= 4.0 * max(1e-3, float(np.median(np.abs(off - np.median(off)))))
    return float(slope)


@dataclass
class _Log:
    """Content of a log before it is put in rows: lines, wall times by session, sensors by ROM, damaged lines, marks, a cut last line."""

    heard: list[HeardLine] = field(default_factory=list)
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
    log = _parse_log(data.decode("latin-1"))
    values = [line for line in log.heard if line.line.kind == "D"]
    if not values:
        lost = f"; {len(log.damaged)} lines are damaged" if log.damaged else ""
        raise RecordError(f"the log has no values yet{lost}.", file, code="record.nothing-there")
    notes = _sorted_with_remarks(log)
    moments, of_clock = clocks(log.heard, log.walls)
    rows = {moment: row for row, moment in enumerate(sorted({moments[at] for at, line in enumerate(log.heard) if line.line.kind == "D"}))}
    table: dict[str, dict[int, BoardLine]] = {}
    lines = [0] * len(rows)
    for at, line in enumerate(log.heard):
        if line.line.kind == "D":
            row = rows[moments[at]]
            of_source = table.setdefault(line.line.fields[0], {})
            if row not in of_source or line.line.fields[0] in (
                "H1",
                "H2",
            ):  # a heater that changes in the moment of a cycle: the new duty holds
                of_source[row] = line.line
            lines[row] = lines[row] or line.at
    bits = {line.line.fields[0]: int(line.line.fields[1]) for line in log.heard if line.line.kind == "S"}
    columns = _Columns(len(rows))
    columns.add("time", "s", np.array([moment for moment in rows]), {})
    for source in sorted(table, key=lambda name: (len(name) != 16, list(log.sensors).index(name) if name in log.sensors else 99, name)):
        notes += columns.source(source, table[source], log.sensors.get(source, {}), bits.get(source))
    columns.power()
    header = tuple(columns.header)
    return Cells(
        file,
        header,
        columns.texts,
        lines,
        (*of_clock, *notes),
        reasons=columns.reasons,
        resolution=columns.resolution,
        certificates=columns.certificates,
        prompt=frozenset({"heater1", "heater2"}),  # the board says a change at once, beside what each cycle says
    )


def _parse_log(text: str) -> _Log:
    """Return the content of a log; a line without its CRC is damaged."""
    log = _Log()
    *whole, rest = text.split("\n")
    log.cut = bool(rest)
    for at, line in enumerate(whole, 1):
        try:
            if line.startswith(("# session ", "# sensor ", "# mark ")):
                _take_comment(log, unsealed(line, " "))
            elif line and not line.startswith("#"):
                match = _BODY.match(unsealed(line, " "))
                if match is None:
                    raise RecordError("it is not a line of a log.", code="bench.protocol")
                log.heard.append(HeardLine(int(match[1]), float(match[2]), at, parse_line(match[3])))
        except (RecordError, ValueError, KeyError, TypeError):
            log.damaged.append(at)
    return log


def _take_comment(log: _Log, body: str) -> None:
    """Take in a line of the logger itself: a session, a sensor or a mark."""
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


def _sorted_with_remarks(log: _Log) -> list[str]:
    """Sort lines by the time they were heard and drop repeats; return remarks on what was wrong."""
    notes = []
    if log.cut:
        notes.append(f"the last line {UNFINISHED}")
    if log.damaged:
        shown = ", ".join(map(str, log.damaged[:_MAX_LISTED_LINES])) + (", ..." if len(log.damaged) > _MAX_LISTED_LINES else "")
        notes.append(CodedText(f"damaged lines that were dropped: {len(log.damaged)} (lines {shown})", "bench.damaged-lines"))
    ordered = sorted(log.heard, key=lambda line: (line.session, line.elapsed))
    moved = sum(one is not other for one, other in zip(ordered, log.heard, strict=True))
    unique = [line for k, line in enumerate(ordered) if not k or line[:2] != ordered[k - 1][:2] or line.line != ordered[k - 1].line]
    if moved:
        notes.append(CodedText(f"lines out of order that were sorted: {moved}", "bench.sorted-lines"))
    if len(unique) < len(ordered):
        notes.append(CodedText(f"duplicate lines: {len(ordered) - len(unique)}", "bench.duplicate-lines"))
    log.heard[:] = unique
    if log.marks:
        notes.append("marks of the logger: " + ", ".join(f"{word} {count}" for word, count in sorted(log.marks.items())))
    return notes


class _Columns:
    """The columns of a bench log while they are made."""

    def __init__(self, rows: int) -> None:
        self.rows = rows
        self.header: list[str] = []
        self.texts: list[tuple[str, ...]] = []
        self.numbers: dict[str, np.ndarray] = {}
        self.reasons: dict[str, dict[str, list[int]]] = {}
        self.resolution: dict[str, str] = {}
        self.certificates: dict[str, SensorCertificate] = {}

    def add(self, name: str, unit: str, values: np.ndarray, reasons: dict[str, list[int]]) -> None:
        """Add a column of `values` (rows,); NaN is an empty cell, `reasons` are masked rows by reason."""
        self.header.append(f"{name} [{unit}]")
        self.texts.append(tuple("" if value != value else repr(value) for value in values.tolist()))
        self.numbers[name] = values.copy()
        self.numbers[name][[row for rows in reasons.values() for row in rows]] = np.nan
        self.reasons[name] = reasons

    def source(self, source: str, lines: dict[int, BoardLine], description: dict[str, Any], bits: int | None) -> list[str]:
        """Add the column of one source, a sensor, heater, voltage or current; return remarks on it.

        Parameters
        ----------
        source : str            ROM, or H, V or I with a number.
        lines : dict            Row -> line with its value.
        description : dict      The sensor's entry in the header of the log.
        bits : int or None      Resolution of the sensor; its step is 2^(8 - bits) K.
        """
        is_sensor = len(source) == 16
        name, unit, step = (str(description.get("name", source)), "degC", 1 / 16) if is_sensor else _NAMES[source[0]]
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
        if source[0] == "I" and not is_sensor and (over := np.flatnonzero(np.abs(values) >= MAX_CURRENT).tolist()):
            reasons["outside its range"] = over
        if is_sensor:
            reasons |= _unreal_readings(values, np.array(sorted({row for rows in reasons.values() for row in rows}), dtype=int))
            if bits is not None:
                self.resolution[name] = f"{2.0 ** (8 - bits)} [K]"
            if "offset_K" in description:
                paper = {key: float(description[f"{key}_K"]) for key in ("offset", "uncertainty", "at")}
                self.certificates[name] = SensorCertificate(
                    paper["offset"], paper["uncertainty"], Kelvin(paper["at"]), str(description["date"])
                )
                notes.append(f"{name}: its certificate in the log, of {description['date']}, states {paper['offset']:+g} K")
        absent = sorted(set(range(self.rows)) - set(lines))
        if absent:
            reasons["no sample here"] = absent
        faults = ", ".join(f"{reason} {len(rows)}" for reason, rows in reasons.items() if reason != "no sample here")
        if faults:
            notes.append(f"{name}: masked {faults}")
        self.add(name, unit, values, reasons)
        return notes

    def power(self) -> None:
        """Add power = voltage * current of each supply channel that has both. [W]"""
        for k in "123456789":
            if f"voltage{k}" in self.numbers and f"current{k}" in self.numbers:
                self.add(f"power{k}", "W", np.round(self.numbers[f"voltage{k}"] * self.numbers[f"current{k}"], 9), {})


def _unreal_readings(values: np.ndarray, bad: np.ndarray) -> dict[str, list[int]]:
    """Return reason -> rows whose value [degC] is outside the sensor's range, or is 85 degC and 2 K off the line between its neighbours.

    `bad` are rows that are masked already.
    """
    inside = np.isfinite(values)
    inside[bad] = False
    outside = inside & ((values < RANGE[0]) | (values > RANGE[1]))
    code = inside & (values == 85.0)
    good = inside & ~outside & ~code
    at = np.arange(values.size)
    if good.any():
        code &= np.abs(values - np.interp(at, at[good], values[good])) > 2.0
    unreal = {"outside its range": np.flatnonzero(outside).tolist(), "85 degC of power-up": np.flatnonzero(code).tolist()}
    return {reason: rows for reason, rows in unreal.items() if rows}
