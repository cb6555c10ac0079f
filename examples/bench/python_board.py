"""A board made of Python alone: it speaks the protocol of `docs/bench.md` about sensors that a function drives, with faults on order.

As a port within this program its time passes only while somebody waits for a line, so that no host is too slow for it. `simulated` is a
bench to try the logger with; tests of the logger use it too.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence

from thermid.base.errors import RecordError
from thermid.bench._wire import COUNTER_RANGE, crc8, sealed, unsealed

FIRMWARE = "thermid-bench 1"

World = Callable[[float, tuple[float, float]], Sequence[float]]
"""Temperatures of the sensors [degC], from the time [s] and the duties of the heaters since the call before [-]."""

_LIMITS = {"resolution": (9, 12), "interval": (100, 3_600_000), "limit": (-880, 2000), "silence": (200, 3_600_000)}
_STEP = 100
"""Short enough that the silence of the host is seen when it is. [ms]"""


def made_up_rom(number: int) -> str:
    """Return a ROM with a valid CRC; the same number gives the same ROM."""
    body = bytes([0x28]) + (0x0F1A0B3C0000 + number).to_bytes(6, "little")
    return (body + bytes([crc8(body)])).hex().upper()


class Board:
    """A simulated board: it behaves as the firmware does.

    Parameters
    ----------
    world : callable        Temperatures of the sensors, see `World`.
    sensors : int           Number of sensors.
    """

    def __init__(self, world: World, sensors: int) -> None:
        self.world = world
        self.roms = [made_up_rom(k) for k in range(sensors)]
        self.faults: dict[int, str] = {}
        """Sensor -> crc, lost, short, power, or a raw value as text, which is sent as if it were good."""
        self.seconds = 0.0  # of the world; a reset does not stop it
        self.sent = 0
        self.out: list[str] = []
        self._boot("power")

    def _boot(self, cause: str) -> None:
        """Start as after a reset for a `cause`."""
        self.cause = cause
        self.number = self.ms = self.heard = 0
        self.duty = [0, 0]
        self.refuses = ""
        self.settings = {"resolution": 12, "interval": 1000, "limit": 1600, "silence": 2000}
        self.cycle = self.report = 1000
        self._send_description()

    def reset(self, cause: str = "external") -> None:
        """Reset the board; settings and duties are lost."""
        self._boot(cause)

    def take(self) -> list[str]:
        """Return the lines sent since the last call, without line feeds."""
        lines, self.out = self.out, []
        return lines

    def advance(self, ms: int) -> None:
        """Let some time pass [ms], with measurements when they are due and heaters off when the host is silent."""
        end = self.ms + ms
        while True:
            silent = self.heard + self.settings["silence"] if any(self.duty) else end + 1
            due = min(self.cycle, silent)
            if due > end:
                break
            self._set_time(due)
            if due == silent:
                self._cut_off_heaters("silent", "")
            else:
                self._measure()
        self._set_time(end)

    def _set_time(self, to: int) -> None:
        """Set the clocks to a time. [ms]"""
        self.seconds += (to - self.ms) / 1000.0
        self.ms = to

    def _send(self, kind: str, *fields: object) -> None:
        """Send one line of a kind with its fields."""
        self.out.append(sealed(",".join([kind, str(self.number % COUNTER_RANGE), str(self.ms % COUNTER_RANGE), *map(str, fields)])))
        self.number += 1
        self.sent += 1

    def _send_description(self) -> None:
        """Send the lines that describe the board: firmware, sensors, settings, and a latched cut-off."""
        self._send("B", "python", FIRMWARE, self.cause)
        for rom in self.roms:
            self._send("S", rom, self.settings["resolution"])
        if not self.roms:
            self._send("E", "none")
        self._send("C", self.settings["interval"], self.settings["limit"], self.settings["silence"])
        if self.refuses:
            self._send("E", "latched", self.refuses)

    def _send_duties(self) -> None:
        """Send the duties of both heaters."""
        for k, duty in enumerate(self.duty, 1):
            self._send("D", f"H{k}", duty, "ok")

    def _cut_off_heaters(self, word: str, detail: str) -> None:
        """Turn the heaters off and send the event `word`; after overtemp or blind they stay off until `clear`."""
        self._world_now()
        self.duty = [0, 0]
        if word in ("overtemp", "blind"):
            self.refuses = word
        self._send("E", word, *([detail] if detail else []))
        self._send_duties()

    def _world_now(self) -> Sequence[float]:
        """Return the temperatures of the world now, with the duties since the last call. [degC]"""
        return self.world(self.seconds, (self.duty[0] / 1000.0, self.duty[1] / 1000.0))

    def _measure(self) -> None:
        """Measure all sensors; send the values when they are due; cut heaters off when one is too hot or none answers."""
        temperatures = self._world_now()
        step = 1 << (12 - self.settings["resolution"])
        send = self.ms >= self.report
        hot, answered = "", not self.roms
        for k, (rom, celsius) in enumerate(zip(self.roms, temperatures, strict=True)):
            fault = self.faults.get(k, "")
            raw: int | str = max(-880, min(2000, round(celsius * 16 / step) * step))
            status = "ok"
            if fault in ("crc", "lost", "short"):
                raw, status = "", fault
            elif fault == "power":
                raw, status = 1360, "power"
            elif fault:
                raw = int(fault)
            if isinstance(raw, int) and status == "ok":
                answered = True
                hot = hot or (rom if raw >= self.settings["limit"] else "")
            if send:
                self._send("D", rom, raw, status)
        if send:
            self._send_duties()
        if any(self.duty) and (hot or not answered):
            self._cut_off_heaters("overtemp" if hot else "blind", hot)
        interval = max(self.settings["interval"], 750 >> (12 - self.settings["resolution"]))
        if send:
            self.report = self.ms + interval
        self.cycle = min(self.report, self.ms + 1000) if any(self.duty) else self.report

    def hear(self, text: str) -> None:
        """Take in one line of the host, and answer it."""
        try:
            body = unsealed(text)
        except RecordError:
            self._send("E", "garbled")
            return
        number, _, rest = body.partition(",")
        word, *arguments = rest.split(",")
        self.heard = self.ms
        if not number.isdigit():
            self._send("E", "garbled")
            return
        answer = self._obey(word, arguments)
        if number != "0":
            self._send("R", number, answer)
        if word in ("identify", "search"):
            self._send_description()
        elif word == "count":
            self._send("E", "count", self.number)
        elif word == "heater":
            self._send_duties()

    def _obey(self, word: str, arguments: list[str]) -> str:
        """Carry out a command; return ``ok``, or why not."""
        try:
            values = [int(number) for number in arguments]
        except ValueError:
            return "not a number"
        if word in ("identify", "search", "count", "alive"):
            return "ok" if not values else "too many arguments"
        if word == "clear":
            self.refuses = ""
            return "ok"
        if word in _LIMITS and len(values) == 1:
            low, high = _LIMITS[word]
            if not low <= values[0] <= high:
                return "out of range"
            self.settings[word] = values[0]
            self.report = min(self.report, self.ms + self.settings["interval"])
            self.cycle = min(self.cycle, self.report)
            return "ok"
        if word == "heater" and len(values) == 2 and values[0] in (1, 2) and 0 <= values[1] <= 1000:
            if self.refuses and values[1]:
                return self.refuses
            self._world_now()
            self.duty[values[0] - 1] = values[1]
            if any(self.duty):
                self.cycle = min(self.cycle, self.ms + 1000)
            return "ok"
        return "unknown"


class BoardPort:
    """A port to a simulated board in this process. Time is the board's, so that a log is the same on every machine.

    Parameters
    ----------
    board : Board   The board.
    speed : float   Largest ratio of the board's time to real time; infinite for as fast as it is read.
    """

    def __init__(self, board: Board, speed: float = math.inf) -> None:
        if not speed > 0.0:
            raise RecordError(f"the speed of a board must be above zero, not {speed:g}.", "simulated board", code="value.outside-range")
        self.board, self._speed = board, speed
        self._sent: list[str] = []
        self._free = 0.0  # when its next step may be taken, by the host's clock
        self._zero = time.time()

    def clock(self) -> float:
        """Return the time of the board's world, which a reset does not stop. [s]"""
        return self.board.seconds

    def wall(self) -> float:
        """Return a wall time that passes as the board's does, from when this was made. [s]"""
        return self._zero + self.board.seconds

    def read_line(self, timeout: float) -> bytes:
        """Return the next line with its line feed; empty where the board sends none within `timeout` seconds of its own time."""
        until = self.board.seconds + timeout
        while not self._sent:
            self._sent += self.board.take()
            if self._sent or self.board.seconds >= until - 5e-4:
                break
            passed = max(1, min(_STEP, round(1000.0 * (until - self.board.seconds))))
            self._pace(passed / 1000.0)
            self.board.advance(passed)
        return self._sent.pop(0).encode() + b"\n" if self._sent else b""

    def _pace(self, seconds: float) -> None:
        """Wait so that `seconds` of the board do not pass faster than `speed`; time in which nobody read is not caught up."""
        if math.isinf(self._speed):
            return
        now = time.monotonic()
        self._free = max(self._free, now - 0.05) + seconds / self._speed
        if self._free > now:
            time.sleep(self._free - now)

    def write(self, text: str) -> None:
        """Send the board one line."""
        self.board.hear(text)

    @property
    def begun(self) -> bytes:
        """Empty, because every line is whole."""
        return b""

    def close(self) -> None:
        """Do nothing."""


class Plate:
    """A world of two bodies between a heater and a room that varies by half a kelvin; sensors on both and in the room.

    C dT/dt = P - G (T - T_neighbour) - G_room (T - T_room): plate 110 J/K, cover 60 J/K, 0.4 W/K between them, 0.05 and 0.15 W/K to the
    room.
    """

    def __init__(self) -> None:
        self.plate = self.cover = 21.0
        self.seconds = 0.0

    def __call__(self, seconds: float, duties: tuple[float, float]) -> Sequence[float]:
        """Return the temperatures of plate, cover and room at a time [s], with the duties since the last call [-]. [degC]"""
        room = 21.0 + 0.5 * math.sin(2.0 * math.pi * seconds / 3600.0)
        power = 6.0 * duties[0]
        remaining = seconds - self.seconds
        while remaining > 0.0:
            step = min(remaining, 1.0)
            across = 0.4 * (self.plate - self.cover)
            self.plate += step * (power - across - 0.05 * (self.plate - room)) / 110.0
            self.cover += step * (across - 0.15 * (self.cover - room)) / 60.0
            remaining -= step
        self.seconds = seconds
        return (self.plate, self.cover, room)


def simulated(speed: float = 60.0) -> BoardPort:
    """Return a port to a simulated board with three sensors, `speed` times as fast as real time."""
    return BoardPort(Board(Plate(), 3), speed)
