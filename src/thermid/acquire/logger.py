"""The logger: every line of the board on disk before the next is read; whatever goes wrong is a mark in the log, and it goes on."""

from __future__ import annotations

import json
import time
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path

from thermid.acquire.boardport import BoardPort
from thermid.acquire.history import History
from thermid.acquire.link import Link
from thermid.acquire.port import Port
from thermid.acquire.programme import Programme
from thermid.acquire.sensormap import Sensor
from thermid.acquire.settings import Settings as Settings
from thermid.acquire.store import Store
from thermid.acquire.watch import Watch
from thermid.acquire.wire import Line, parse_line
from thermid.errors import RecordError

_JUMP = 1.0
_WALL_EVERY = 600.0


@dataclass
class _State:
    """What the logger knows while it runs."""

    number: int = -1
    ms: int = 0
    seconds: float = 0.0  # of the board since the first line, resets bridged by the host's clock
    changed: float = 0.0  # when a heater last changed, on that clock
    heard: float = 0.0
    lines: int = 0
    missing: int = 0
    bits: dict[str, int] = field(default_factory=dict)


class Logger:
    """A log in the making.

    Parameters
    ----------
    path : str or Path           The log; continued where it exists.
    port : callable              Returns the name of the port, or a board within this program; called again after the port was lost.
    sensors : mapping            The sensor map by ROM.
    settings : Settings          What the board is told.
    programme : Programme        What the heaters do, or None.
    sync : bool                  Whether each line is forced onto the disk itself.
    clear_latch : bool           Whether heaters that the board has cut off (over-temperature, no sensor) are allowed again.
    clock, wall : callable       A clock that nobody sets, and the host's clock. [s]

    Raises
    ------
    RecordError   When the file is no log of the bench, another logger writes to it, or heaters are to be turned on that were cut off;
                  the latter also from `step`, where the board says so.
    """

    def __init__(
        self,
        path: str | Path,
        port: Callable[[], str | BoardPort],
        sensors: Mapping[str, Sensor] | None = None,
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
        self.store = Store(path, sync=sync)
        if self.store.trip and not clear_latch and programme is not None and programme.heats:
            trip = self.store.trip
            self.store.close()
            raise _cut_off(trip, str(path))
        self._clock, self._wall, self._find = clock, wall, port
        self._begun, self._offset, self._walled = clock(), wall() - clock(), 0.0
        self._port: Port | BoardPort | None = None
        self._tried = self._gone = -1e9
        self._quiet = self._full = self._fresh = False
        self._link = Link(self.settings, clear_latch)
        self.watch = Watch(self.name_of, self.sensors)
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
            self.mark("cut", "the last line of the session before was not finished")

    def name_of(self, source: str) -> str:
        """Return the name of a channel."""
        return self.sensors[source].name if source in self.sensors else source

    @property
    def elapsed(self) -> float:
        """Time since the start. [s]"""
        return self._clock() - self._begun

    def _stamp(self) -> str:
        """Return the host's time as text."""
        return datetime.fromtimestamp(self._wall(), UTC).isoformat(timespec="milliseconds")

    def mark(self, word: str, text: str) -> None:
        """Write a mark into the log."""
        self.last_mark = f"{word}: {text}"
        self.marks[word] += 1
        self.store.write(f"# mark {self.store.session} {self.elapsed:.6f} {word} {text}")

    def step(self, timeout: float = 0.2) -> Line | None:
        """Wait for one line, put it on disk, and return it; None when none came or it was no good line. [s]"""
        self._check_clock()
        self._check_disk()
        if self._port is None and not self._open(timeout):
            return None
        assert self._port is not None
        try:
            data = self._port.read_line(timeout)
            line = self._take(data) if data else None
            for command in self._link.due(self.elapsed, self.state.seconds, self.programme):
                self._port.write(command)
        except OSError as error:
            self._lose(error)
            return None
        if self._link.failed:
            self.mark("unanswered", ", ".join(self._link.failed))
            self._link.failed.clear()
        quiet = self.elapsed - self.state.heard > max(5.0, 3.0 * self.settings.interval)
        if quiet and not self._quiet:
            self.mark("quiet", "nothing comes from the board")
        self._quiet = quiet
        return line

    def ask(self, command: str) -> None:
        """Send a command with the next step, such as ``identify``."""
        self._link.add(command)

    @property
    def done(self) -> bool:
        """Whether the programme has ended and the board has been told."""
        end = self.programme.end if self.programme is not None else None
        return end is not None and self.state.seconds >= end and self._link.idle

    def close(self) -> None:
        """Turn the heaters off, and end the log."""
        if self._port is not None:
            try:
                for command in self._link.off():
                    self._port.write(command)
                until = self._clock() + 0.5
                while self._clock() < until and not self._link.idle:
                    data = self._port.read_line(0.1)
                    if data:
                        self._take(data)
            except OSError as error:
                self._lose(error)
            else:
                self._port.close()
        self.mark("end", f"{self.state.lines} lines, {self.state.missing} missing")
        self.store.close()

    def _open(self, timeout: float) -> bool:
        """Open the port where it is time to try again; return whether it is open."""
        if self._clock() - self._tried < 0.5:
            time.sleep(min(timeout, 0.1))
            return False
        self._tried = self._clock()
        try:
            found = self._find()
            self._port = Port(found) if isinstance(found, str) else found
        except (OSError, RecordError) as error:
            if not self._gone > -1e9:
                self._gone = self.elapsed
                self.mark("port-gone", f"cannot be opened: {error}")
            return False
        back = f"back after {self.elapsed - self._gone:.1f} s: " if self._gone > -1e9 else ""
        self._gone = -1e9
        self.mark("port", f"{back}{found if isinstance(found, str) else 'a simulated board'}")
        self._link.connected()
        self.state.heard, self._fresh = self.elapsed, True
        return True

    def _lose(self, error: OSError) -> None:
        """Give a port up that is gone."""
        assert self._port is not None
        if self._port.begun:
            self.mark("garbled", json.dumps(self._port.begun.decode("latin-1")))
        self._port.close()
        self._port = None
        self._gone = self.elapsed
        self.mark("port-gone", str(error) or "the port is gone")

    def _take(self, data: bytes) -> Line | None:
        """Put what was read on disk, then look at it."""
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
        self._count(line, elapsed)
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
            self._remember(line.fields[0])
        return line

    def _remember(self, source: str) -> None:
        """Keep a good reading; where a heater changes, what came before tells no longer where it goes."""
        value = self.watch.values[source]
        if len(source) == 16:
            self.history.setdefault(source, History()).add(self.state.seconds, value)
        elif source[0] == "H" and self._duties.setdefault(source, value) != value:
            self._duties[source], self.state.changed = value, self.state.seconds
            for each in self.history.values():
                each.clear()

    def _count(self, line: Line, elapsed: float) -> None:
        """Follow the board's number and time: what is missing, what was a reset."""
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
                self.mark("reset", f"the board began again (cause: {cause})")
                self._link.connected()
        state.number, state.ms, state.heard, state.lines = line.number, line.ms, elapsed, state.lines + 1

    def _check_clock(self) -> None:
        """Mark a jump of the host's clock, and its time now and then."""
        offset = self._wall() - self._clock()
        if abs(offset - self._offset) > _JUMP:
            self.mark("clock", f"the host's clock jumped by {offset - self._offset:+.1f} s to {self._stamp()}; stamps do not follow")
            self._offset = offset
        if self.elapsed - self._walled >= _WALL_EVERY:
            self._walled, self._offset = self.elapsed, offset
            self.mark("wall", self._stamp())

    def _check_disk(self) -> None:
        """Try a full disk again."""
        if not self.store.full:
            return
        if not self._full:
            self._full = True
            self.mark("disk-full", "lines wait in memory")
        self.store.retry()
        if not self.store.full:
            self._full = False
            self.mark("disk-back", f"what waited is written, {self.store.dropped} lines had no room")


def _cut_off(why: str, where: str) -> RecordError:
    """Return the refusal to heat what was cut off."""
    return RecordError(
        f"the board has cut heaters 1 and 2 off: {why}. They stay off. Find out why and look at the hardware; then allow them again with "
        "--clear-latch (clear_latch=True), or log without a heater programme.",
        where,
    )
