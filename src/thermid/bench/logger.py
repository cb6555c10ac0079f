"""The logger: every line of the board on disk before the next is read; whatever goes wrong is a mark in the log, and it goes on.

What the board is told (`Settings`, `Link`), what of its lines is a fault (`FaultWatch`), and what is kept of its readings (`History`).
"""

from __future__ import annotations

import json
import threading
import time
from collections import Counter
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from thermid.base.errors import RecordError
from thermid.base.units import Array
from thermid.bench._wire import BoardLine, parse_line, sealed
from thermid.bench.bench_files import MappedSensor, Programme
from thermid.bench.benchlog import MAX_CURRENT, RANGE, LogFile
from thermid.bench.port import LinePort, Port

_MIN_CLOCK_JUMP = 1.0
_WALL_EVERY = 600.0
_REPLY_TIME = 1.0
_MAX_SENDS = 5
_WORDS = {
    "crc": "three readings with a wrong CRC",
    "lost": "nothing answers",
    "short": "the bus is stuck low",
    "power": "it was without supply and may read 85 degC",
    "range": "its value is outside -55 to 125 degC",
    "over": f"{MAX_CURRENT:g} A, its full scale, is reached",
    "absent": "it is in the sensor map but does not respond",
    "85": "it reads 85 degC, its value after power-up",
}
_UNREPORTED_ERRORS = ("count",)
_RAW_READINGS = 900
_MAX_BINS = 600


@dataclass(frozen=True)
class Settings:
    """Settings that the board is sent.

    Parameters
    ----------
    interval : float          Time between cycles. [s]
    bits : int                Resolution of the sensors.
    limit : float             Temperature of any sensor at which the board cuts the heaters off. [degC]
    silence : float           Time without a command after which the board cuts the heaters off. [s]

    Raises
    ------
    RecordError   When one is outside the range that the board takes.
    """

    interval: float = 1.0
    bits: int = 12
    limit: float = 100.0
    silence: float = 2.0

    def __post_init__(self) -> None:
        """Refuse values outside the ranges that the board takes."""
        for word, value, low, high in (
            ("interval", self.interval, 0.1, 3600.0),
            ("bits", self.bits, 9, 12),
            ("limit", self.limit, -55.0, 125.0),
            ("silence", self.silence, 0.2, 3600.0),
        ):
            if not low <= value <= high:
                raise RecordError(f"{word} = {value:g} is outside {low:g} to {high:g}.", "settings", code="bench.sensor")

    def commands(self) -> list[str]:
        """Return the commands that a board needs after a reset."""
        return [
            f"limit,{round(self.limit * 16)}",
            f"silence,{round(self.silence * 1000)}",
            f"resolution,{self.bits}",
            f"interval,{round(self.interval * 1000)}",
        ]


class Link:
    """Commands to the board until they are answered.

    Parameters
    ----------
    settings : Settings   Settings that a board is sent when it begins.
    clears : bool         Whether heaters that were cut off are allowed again at the start.
    """

    def __init__(self, settings: Settings, clears: bool = False) -> None:
        self._settings = settings
        self._next = 1
        self._open: dict[int, tuple[str, float, int]] = {}
        self._duties: tuple[int, int] | None = None
        self._alive = -1e9
        self.failed: list[str] = []
        self._clears = clears

    def connected(self) -> None:
        """Begin again with a board after a reset: settings first, then commands that were not sent yet."""
        setup = [*self._settings.commands(), "identify"]
        if self._clears:
            setup.insert(0, "clear")  # somebody has asked for it at this start; a cable that comes back clears nothing
            self._clears = False
        unsent = [command for command, _, tries in self._open.values() if not tries and command not in setup and "heater," not in command]
        self._open.clear()
        self._duties = None
        for command in [*setup, *unsent]:
            self.add(command)

    def add(self, command: str) -> None:
        """Add a command to those that wait."""
        self._open[self._next] = (command, -1e9, 0)
        self._next += 1

    @property
    def idle(self) -> bool:
        """Whether every command is answered."""
        return not self._open

    def due(self, now: float, seconds: float, programme: Programme | None) -> list[str]:
        """Return the lines to send now: new commands, repeats of those unanswered for `_REPLY_TIME`, a sign of life.

        Parameters
        ----------
        now : float             Time by the host's clock. [s]
        seconds : float         Time of the programme. [s]
        programme : Programme or None   Its duties become commands when they change.
        """
        if programme is not None and (duties := programme.at(seconds)) != self._duties:
            before = self._duties or (-1, -1)
            for k, duty in enumerate(duties):
                if duty != before[k]:
                    self._open = {
                        n: c for n, c in self._open.items() if not c[0].startswith(f"heater,{k + 1},")
                    }  # a newer one replaces them
                    self.add(f"heater,{k + 1},{duty}")
            self._duties = duties
        out = []
        for number, (command, sent, tries) in list(self._open.items()):
            if now - sent < _REPLY_TIME:
                continue
            if tries >= _MAX_SENDS:
                self.failed.append(command)
                del self._open[number]
                continue
            self._open[number] = (command, now, tries + 1)
            out.append(sealed(f"{number},{command}"))
        if out:
            self._alive = now
        elif now - self._alive >= self._settings.silence / 4.0:
            self._alive = now
            out.append(sealed("0,alive"))
        return out

    def off(self) -> list[str]:
        """Return the lines that turn both heaters off; none where they are off."""
        self._open.clear()
        if not self._duties or not any(self._duties):
            return []
        self._duties = (0, 0)
        numbers = range(self._next, self._next + 2)
        self._next += 2
        for k, number in enumerate(numbers, 1):
            self._open[number] = (f"heater,{k},0", 1e9, 1)
        return [sealed(f"{number},{self._open[number][0]}") for number in numbers]

    def answered(self, fields: tuple[str, ...]) -> str:
        """Take in the fields of a reply; return the command and why it was refused, or an empty text."""
        number, word = fields
        command = self._open.pop(int(number), None) if number.isdigit() else None
        return f"{command[0]}: {word}" if command is not None and word != "ok" else ""


class FaultWatch:
    """Last value and fault of each source.

    Parameters
    ----------
    name_of : callable   ROM or channel -> name.
    roms : collection    Sensors of the map.

    Attributes
    ----------
    values : dict        Source -> last good value: degC, heater share of one, V, A.
    faults : dict        Source -> its fault, a key of `_WORDS`.
    counts : dict        Source -> how many of its values were faulty.
    """

    def __init__(self, name_of: Callable[[str], str], roms: Collection[str] = ()) -> None:
        self._name, self._mapped = name_of, set(roms)
        self._answering: set[str] = set()
        self._reported: set[str] = set()
        self.values: dict[str, float] = {}
        """Last good value of each source: degC, heater share of one, V, A."""
        self.faults: dict[str, str] = {}
        self.counts: dict[str, int] = {}

    def look(self, line: BoardLine) -> list[tuple[str, str]]:
        """Take in a line; return the marks (word, text) that it gives rise to: new faults, their end, events of the board."""
        if line.kind == "E" and line.fields[0] not in _UNREPORTED_ERRORS:
            if line.fields[0] == "latched":
                return [("latched", f"heaters stay off after the cut-off ({line.fields[1]}) until --clear-latch")]
            detail = self._name(line.fields[1]) if len(line.fields) > 1 else ""
            return [(line.fields[0], f"reported by the board{' of ' + detail if detail else ''}")]
        if line.kind in "BSC":
            return self._absent_and_unnamed(line)
        if line.kind != "D":
            return []
        source, _, status = line.fields
        value = None if line.raw is None else line.raw * (1 / 16 if len(source) == 16 else {"H": 1e-3, "V": 1e-3, "I": 1e-4}[source[0]])
        fault = "" if status == "ok" else status
        if not fault and len(source) == 16 and value is not None:
            if not RANGE[0] <= value <= RANGE[1]:
                fault = "range"
            elif value == 85.0 and abs(self.values.get(source, 0.0) - 85.0) > 2.0:
                fault = "85"
        elif not fault and source[0] == "I" and value is not None and abs(value) >= MAX_CURRENT:
            fault = "over"
        before = self.faults.get(source, "")
        if fault:
            self.faults[source] = fault
            self.counts[source] = self.counts.get(source, 0) + 1
        else:
            self.faults.pop(source, None)
            if value is not None:
                self.values[source] = value
        if fault == before:
            return []
        return (
            [("fault", f"{self._name(source)} {fault}: {_WORDS[fault]}")] if fault else [("good", f"{self._name(source)} after {before}")]
        )

    def _absent_and_unnamed(self, line: BoardLine) -> list[tuple[str, str]]:
        """Return marks for sensors of the map that do not answer, and for those that answer and are not in it."""
        if line.kind == "B":
            self._answering = set()
        if line.kind == "S":
            self._answering.add(line.fields[0])
        absent, unnamed = self._mapped - self._answering, self._answering - self._mapped
        if line.kind != "C" or not self._mapped or self._reported == absent | unnamed:
            return []
        self._reported = absent | unnamed
        self.faults |= dict.fromkeys(absent, "absent")
        return [("absent", f"{self._name(rom)} (ROM {rom}): {_WORDS['absent']}") for rom in sorted(absent)] + [
            ("unnamed", f"{rom} responds but is not in the sensor map. Add it to the map to record it by name") for rom in sorted(unnamed)
        ]


class History:
    """Readings of one channel since conditions changed, older ones averaged so that their number stays bounded. Thread-safe."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self.clear()

    def clear(self) -> None:
        """Forget all readings."""
        with self._lock:
            self._late: list[tuple[float, float]] = []
            self._early = np.empty((3, 0))  # time, value and how many readings they stand for
            self._width = 0.0

    def add(self, seconds: float, value: float) -> None:
        """Add a reading at a time, seconds [s] and value [degC].

        The last readings are kept one by one; older ones move to bins, whose width is doubled where there are more than `_MAX_BINS`.
        """
        with self._lock:
            self._late.append((seconds, value))
            if len(self._late) < 2 * _RAW_READINGS:
                return
            moved = np.array([(t, v, 1.0) for t, v in self._late[:_RAW_READINGS]]).T
            del self._late[:_RAW_READINGS]
            self._width = self._width or 2.0 * float(moved[0, -1] - moved[0, 0]) / _RAW_READINGS
            self._early = _binned(np.hstack([self._early, moved]), self._width)
            while self._early.shape[1] > _MAX_BINS:
                self._width *= 2.0
                self._early = _binned(self._early, self._width)

    def arrays(self) -> tuple[Array, Array]:
        """Return times (readings,) [s] and values (readings,) [degC]."""
        with self._lock:
            early, late = self._early, np.array(self._late).reshape(-1, 2).T
        return np.hstack([early[0], late[0]]), np.hstack([early[1], late[1]])


def _binned(points: Array, width: float) -> Array:
    """Return time, value and weight (3, bins) of points (3, n), as weighted means over bins of a width [s]."""
    starts = np.flatnonzero(np.diff(np.floor(points[0] / width), prepend=-np.inf))
    count = np.add.reduceat(points[2], starts)
    return np.vstack([np.add.reduceat(row * points[2], starts) / count for row in points[:2]] + [count])


@dataclass
class _State:
    """State of a running log: the board's last number and time, what was heard and is missing, resolutions by ROM."""

    number: int = -1
    ms: int = 0
    seconds: float = 0.0  # of the board since the first line, resets bridged by the host's clock
    changed: float = 0.0  # when a heater last changed, on that clock
    heard: float = 0.0
    lines: int = 0
    missing: int = 0
    bits: dict[str, int] = field(default_factory=dict)


class Logger:
    """A log that is being written from a board.

    Parameters
    ----------
    path : str or Path           The log; continued where it exists.
    port : callable              Returns the name of the port, or a simulated board; called again after the port was lost.
    sensors : mapping            ROM -> sensor, the sensor map.
    settings : Settings          Settings that the board is sent.
    programme : Programme        Duties of the heaters, or None.
    sync : bool                  Whether each line is forced onto the disk itself.
    clear_latch : bool           Whether heaters that the board has cut off (over-temperature, no sensor) are allowed again.
    clock, wall : callable       A monotonic clock, and the host's wall clock. [s]

    Raises
    ------
    RecordError   When the file is no log of the bench, another logger writes to it, or heaters are to be turned on that were cut off;
                  the latter also from `step`, when the board reports a cut-off.
    """

    def __init__(
        self,
        path: str | Path,
        port: Callable[[], str | LinePort],
        sensors: Mapping[str, MappedSensor] | None = None,
        settings: Settings | None = None,
        programme: Programme | None = None,
        *,
        sync: bool = True,
        clear_latch: bool = False,
        clock: Callable[[], float] = time.monotonic,
        wall: Callable[[], float] = time.time,
    ) -> None:
        self.sensors = dict(sensors or {})
        self.settings = settings or Settings()
        self.programme = programme
        self.store = LogFile(path, sync=sync)
        if self.store.trip and not clear_latch and programme is not None and programme.heats:
            trip = self.store.trip
            self.store.close()
            raise _cut_off(trip, str(path))
        self._clock, self._wall, self._find = clock, wall, port
        self._begun, self._offset, self._walled = clock(), wall() - clock(), 0.0
        self._port: LinePort | None = None
        self._tried = self._gone = -1e9
        self._quiet = self._full = self._fresh = False
        self._link = Link(self.settings, clear_latch)
        self.watch = FaultWatch(self.name_of, self.sensors)
        self.history: dict[str, History] = {}
        """Readings of each sensor since a heater last changed. [s of the board, degC]"""
        self.state = _State()
        self._duties: dict[str, float] = {}
        self.last_mark = ""
        self.marks: Counter[str] = Counter()
        head = {"number": self.store.session, "wall": self._stamp(), "settings": vars(self.settings)}
        self.store.write("# session " + json.dumps(head))
        for sensor in self.sensors.values():
            self.store.write("# sensor " + json.dumps(sensor.as_header()))
        if clear_latch:
            self.mark("cleared", f"heaters are allowed again by --clear-latch; cut off before: {self.store.trip or 'nothing in this log'}")
        if self.store.was_cut:
            self.mark("cut", "the last line of the previous session was incomplete")

    def name_of(self, source: str) -> str:
        """Return the name of a source: that of the map for a sensor, else the source itself."""
        return self.sensors[source].name if source in self.sensors else source

    @property
    def elapsed(self) -> float:
        """Time since the start. [s]"""
        return self._clock() - self._begun

    def _stamp(self) -> str:
        """Return the wall time as an ISO 8601 stamp in UTC."""
        return datetime.fromtimestamp(self._wall(), UTC).isoformat(timespec="milliseconds")

    def mark(self, word: str, text: str) -> None:
        """Write a mark with its word and text into the log."""
        self.last_mark = f"{word}: {text}"
        self.marks[word] += 1
        self.store.write(f"# mark {self.store.session} {self.elapsed:.6f} {word} {text}")

    def step(self, timeout: float = 0.2) -> BoardLine | None:
        """Wait up to `timeout` seconds for one line, write it to disk, and return it; None where none came or it was damaged.

        Raises
        ------
        RecordError   When the board reports a cut-off and the programme heats.
        """
        self._check_clock()
        self._check_disk()
        if self._port is None and not self._open(timeout):
            return None
        assert self._port is not None
        try:
            data = self._port.read_line(timeout)
            line = self._store_line(data) if data else None
            for command in self._link.due(self.elapsed, self.state.seconds, self.programme):
                self._port.write(command)
        except OSError as error:
            self._drop_port(error)
            return None
        if self._link.failed:
            self.mark("unanswered", ", ".join(self._link.failed))
            self._link.failed.clear()
        quiet = self.elapsed - self.state.heard > max(5.0, 3.0 * self.settings.interval)
        if quiet and not self._quiet:
            self.mark("quiet", "no data from the board")
        self._quiet = quiet
        return line

    def ask(self, command: str) -> None:
        """Send a command, such as ``identify``, with the next step."""
        self._link.add(command)

    @property
    def done(self) -> bool:
        """Whether the programme has ended and every command is answered."""
        end = self.programme.end if self.programme is not None else None
        return end is not None and self.state.seconds >= end and self._link.idle

    def close(self) -> None:
        """Turn the heaters off, and close the log."""
        if self._port is not None:
            try:
                for command in self._link.off():
                    self._port.write(command)
                until = self._clock() + 0.5
                while self._clock() < until and not self._link.idle:
                    data = self._port.read_line(0.1)
                    if data:
                        self._store_line(data)
            except OSError as error:
                self._drop_port(error)
            else:
                self._port.close()
        self.mark("end", f"{self.state.lines} lines, {self.state.missing} missing")
        self.store.close()

    def _open(self, timeout: float) -> bool:
        """Open the port, at most every half second; return whether it is open."""
        if self._clock() - self._tried < 0.5:
            time.sleep(min(timeout, 0.1))
            return False
        self._tried = self._clock()
        try:
            port = self._find()
            self._port = Port(port) if isinstance(port, str) else port
        except (OSError, RecordError) as error:
            if not self._gone > -1e9:
                self._gone = self.elapsed
                self.mark("port-gone", f"cannot be opened: {error}")
            return False
        back = f"back after {self.elapsed - self._gone:.1f} s: " if self._gone > -1e9 else ""
        self._gone = -1e9
        self.mark("port", f"{back}{port if isinstance(port, str) else 'a simulated board'}")
        self._link.connected()
        self.state.heard, self._fresh = self.elapsed, True
        return True

    def _drop_port(self, error: OSError) -> None:
        """Close a port that was disconnected, and mark it."""
        assert self._port is not None
        if self._port.begun:
            self.mark("garbled", json.dumps(self._port.begun.decode("latin-1")))
        self._port.close()
        self._port = None
        self._gone = self.elapsed
        self.mark("port-gone", str(error) or "the port was disconnected")

    def _store_line(self, data: bytes) -> BoardLine | None:
        """Write a line that was read to disk, then parse it and update faults, replies and history; None where it is damaged."""
        text = data.decode("latin-1").rstrip("\r\n")
        try:
            line = parse_line(text)
        except RecordError as error:
            why = "the port was opened in the middle of this line." if self._fresh else error.message
            self._fresh = False
            self.mark("garbled", f"{json.dumps(text)}: {why}")
            return None
        self._fresh = False
        elapsed = self.elapsed
        self.store.write(f"{self.store.session} {elapsed:.6f} {text}")
        self._follow_counters(line, elapsed)
        if line.kind == "R":
            refused = self._link.answered(line.fields)
            if refused:
                self.mark("refused", refused)
        for word, detail in self.watch.look(line):
            self.mark(word, detail)
        tripped_here = self.marks["overtemp"] + self.marks["blind"] > 0  # it is marked then, and the run goes on without heaters
        if line.kind == "E" and line.fields[0] == "latched" and not tripped_here and self.programme is not None and self.programme.heats:
            why = "over-temperature" if line.fields[1] == "overtemp" else "no sensor could be read"
            raise _cut_off(f"{why}, when is not known, it is not in this log", self.store.path.name)
        if line.kind == "S":
            self.state.bits[line.fields[0]] = int(line.fields[1])
        if line.kind == "D" and line.fields[0] not in self.watch.faults:
            self._keep_reading(line.fields[0])
        return line

    def _keep_reading(self, source: str) -> None:
        """Keep a good reading; a change of a heater clears the history of all sensors."""
        value = self.watch.values[source]
        if len(source) == 16:
            self.history.setdefault(source, History()).add(self.state.seconds, value)
        elif source[0] == "H" and self._duties.setdefault(source, value) != value:
            self._duties[source], self.state.changed = value, self.state.seconds
            for readings in self.history.values():
                readings.clear()

    def _follow_counters(self, line: BoardLine, elapsed: float) -> None:
        """Follow the board's number and time; mark missing lines and resets."""
        state = self.state
        if state.number >= 0:
            steps, passed = (line.number - state.number) % (1 << 32), (line.ms - state.ms) % (1 << 32)
            if 0 < steps < 1 << 31 and passed < 1 << 31:
                state.seconds += passed / 1000.0
                if steps > 1:
                    state.missing += steps - 1
                    self.mark("missing", f"{steps - 1} lines of the board, after its number {state.number}")
            else:
                cause = line.fields[2] if line.kind == "B" else "unknown"
                state.seconds += max(0.0, elapsed - state.heard)
                state.missing += line.number
                self.mark("reset", f"the board restarted (cause: {cause})")
                self._link.connected()
        state.number, state.ms, state.heard, state.lines = line.number, line.ms, elapsed, state.lines + 1

    def _check_clock(self) -> None:
        """Mark a jump of the host's wall clock, and its time every `_WALL_EVERY` seconds."""
        offset = self._wall() - self._clock()
        if abs(offset - self._offset) > _MIN_CLOCK_JUMP:
            self.mark(
                "clock",
                f"the host's clock jumped by {offset - self._offset:+.1f} s to {self._stamp()}. The time stamps do not include this jump",
            )
            self._offset = offset
        if self.elapsed - self._walled >= _WALL_EVERY:
            self._walled, self._offset = self.elapsed, offset
            self.mark("wall", self._stamp())

    def _check_disk(self) -> None:
        """Write again after the disk was full, and mark when it became full and when it has room again."""
        if not self.store.full:
            return
        if not self._full:
            self._full = True
            self.mark("disk-full", "lines wait in memory")
        self.store.retry()
        if not self.store.full:
            self._full = False
            self.mark("disk-back", f"the waiting lines are written; {self.store.dropped} lines were lost for lack of memory")


def _cut_off(why: str, where: str) -> RecordError:
    """Return the error for heaters that the board has cut off."""
    return RecordError(
        f"the board has cut heaters 1 and 2 off: {why}. They stay off. Find the cause and check the hardware; then allow them again "
        "with --clear-latch (clear_latch=True), or log without a heater programme.",
        where,
        code="bench.sensor",
    )
