"""A `Board` as a port within this program: its time passes only while somebody waits for a line, so that no host is too slow for it."""

from __future__ import annotations

import math
import time

from thermid.acquire.board import Board
from thermid.errors import RecordError

_STEP = 100
"""Short enough that the silence of the host is seen when it is. [ms]"""


class BoardPort:
    """A board that a logger reads without a cable; its clock is the board's, and what is logged is the same on every machine.

    Parameters
    ----------
    board : Board   What answers.
    speed : float   Seconds of the board in one second, at most; infinite for as fast as it can be read.
    """

    def __init__(self, board: Board, speed: float = math.inf) -> None:
        if not speed > 0.0:
            raise RecordError(f"a board runs forward; its speed {speed:g} must be above zero.", "simulated board")
        self.board, self._speed = board, speed
        self._sent: list[str] = []
        self._free = 0.0  # when its next step may be taken, by the host's clock
        self._zero = time.time()

    def clock(self) -> float:
        """Return the time of the board's world, which a reset does not stop. [s]"""
        return self.board.seconds

    def wall(self) -> float:
        """Return the time of a day that began when this was made and passes as the board's does. [s]"""
        return self._zero + self.board.seconds

    def read_line(self, timeout: float) -> bytes:
        """Return the next line with its line feed, empty where the board says none in a time of its own. [s]"""
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
        """Wait until a step may be taken; a board that was not read for a while does not hurry after."""
        if math.isinf(self._speed):
            return
        now = time.monotonic()
        self._free = max(self._free, now - 0.05) + seconds / self._speed
        if self._free > now:
            time.sleep(self._free - now)

    def write(self, text: str) -> None:
        """Tell the board one line."""
        self.board.hear(text)

    @property
    def begun(self) -> bytes:
        """Nothing: lines are whole here."""
        return b""

    def close(self) -> None:
        """Leave the board as it is."""
