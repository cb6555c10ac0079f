"""A board within the program: its own clock, no line lost however slow the host is, the same log every time."""

from __future__ import annotations

import time
from pathlib import Path

import pytest
from python_board import Board, BoardPort, simulated

import thermid as td
from by_code import raises_code
from thermid.base.errors import RecordError
from thermid.bench.bench_files import Programme
from thermid.bench.logger import Logger, Settings


def log_of(path: Path, port: BoardPort, programme: Programme, settings: Settings, hinder: float = 0.0) -> Logger:
    """Log a board; a host that is hindered sleeps now and then."""
    log = Logger(path, lambda: port, None, settings, programme, sync=False, clock=port.clock, wall=port.wall)
    steps = 0
    while not log.done:
        steps += 1
        if hinder and steps % 40 == 0:
            time.sleep(hinder)
        log.step()
    log.close()
    return log


PROGRAMME = Programme((5.0, 30.0), ((500, 0), (0, 0)), 60.0)


def test_a_slow_host_changes_nothing(tmp_path: Path) -> None:
    texts = []
    for name, hinder in (("idle", 0.0), ("busy", 0.02)):
        log = log_of(tmp_path / name, BoardPort(Board(lambda t, d: [20.0 + d[0], 21.0], 2)), PROGRAMME, Settings(), hinder)
        assert log.state.missing == 0
        texts.append([line for line in (tmp_path / name).read_text().splitlines() if not line.startswith("# session")])
    assert texts[0] == texts[1]
    assert set(log.marks) == {"port", "end"}  # its clock and that of its day are one: no jump is seen
    # signs of life follow the board's clock, so that two seconds of silence are never reached
    record = td.read_record(tmp_path / "busy", {"heater1": {"command": "h"}})
    heater = record["heater1"]
    on = record.times[heater.valid][heater.values[heater.valid] > 0]
    assert on[0] == pytest.approx(5.0, abs=1.1)
    assert on[-1] == pytest.approx(30.0, abs=1.1)


def test_a_host_that_says_nothing_finds_the_heaters_off() -> None:
    port = BoardPort(Board(lambda t, d: [20.0], 1))
    port.board.duty[0], port.board.heard = 500, 0
    while port.clock() < 2.5:
        port.read_line(0.2)
    assert port.board.duty == [0, 0]


def test_a_speed_is_a_limit_and_nobody_hurries_after_a_pause() -> None:
    port = simulated(speed=100.0)
    begun = time.monotonic()
    while port.clock() < 10.0:
        port.read_line(0.5)
    assert time.monotonic() - begun > 0.04  # 0.1 s, less what it may be ahead
    time.sleep(0.1)
    before = port.clock()
    begun = time.monotonic()
    while port.clock() < before + 9.0:
        port.read_line(0.5)
    assert time.monotonic() - begun > 0.03


def test_a_wait_without_a_line_ends_in_the_boards_time() -> None:
    port = BoardPort(Board(lambda t, d: [20.0], 1))
    while port.read_line(0.2):
        pass
    before = port.clock()
    assert port.read_line(0.25) == b""
    assert port.clock() == pytest.approx(before + 0.25, abs=2e-3)
    assert (port.begun, port.wall() - port.clock() > 1e9) == (b"", True)


def test_a_speed_that_is_none_is_refused() -> None:
    with raises_code("value.outside-range", RecordError, match=r"0\."):
        BoardPort(Board(lambda t, d: [20.0], 1), 0.0)
