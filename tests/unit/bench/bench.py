"""Logs for the tests: written by the logger from a board on a pseudo-terminal, or line by line."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from pathlib import Path

from thermid.bench._wire import MAGIC, sealed
from thermid.bench.benchlog import log_line
from thermid.bench.logger import Logger


def until(log: Logger, what: Callable[[], bool], limit: float = 20.0) -> None:
    """Let a logger run until something has happened."""
    begun = time.monotonic()
    while not what():
        assert time.monotonic() - begun < limit, "it did not happen"
        log.step(0.05)


def cycles(log: Logger, count: int) -> None:
    """Let a logger run for some cycles of the board."""
    begun, end = time.monotonic(), log.state.seconds + count
    while log.state.seconds < end:
        assert time.monotonic() - begun < 30.0
        log.step(0.05)


def marks(path: Path) -> list[str]:
    """The words of the marks in a log, in order."""
    return [line.split(" ")[4] for line in path.read_text().splitlines() if line.startswith("# mark ")]


class Sheet:
    """A log made line by line."""

    def __init__(self) -> None:
        self.text = MAGIC + "\n"
        self.session = 0
        self.number = 0

    def start(self, wall: str = "2026-03-01T10:00:00+00:00") -> Sheet:
        self.session += 1
        self.text += log_line("# session " + json.dumps({"number": self.session, "wall": wall}))
        return self

    def sensor(self, **content: object) -> Sheet:
        self.text += log_line("# sensor " + json.dumps(content))
        return self

    def say(self, elapsed: float, ms: int, body: str, kind: str = "D") -> Sheet:
        self.text += log_line(f"{self.session} {elapsed:.6f} " + sealed(f"{kind},{self.number},{ms},{body}"))
        self.number += 1
        return self

    def reset(self) -> Sheet:
        self.number = 0
        return self

    def save(self, path: Path) -> Path:
        path.write_text(self.text)
        return path
