"""The logger killed, run for a day, and fed with damage. The long counts are campaigns; short ones of the same tests run always."""

from __future__ import annotations

import os
import random
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from python_board import Board

import thermid as td
from pseudo_terminal import Terminal
from thermid.base.errors import ThermidError
from thermid.bench._wire import parse_line
from thermid.bench.logger import Logger, Settings
from thermid.bench.port import MAX_GARBAGE_BYTES

pytestmark = pytest.mark.skipif(os.name != "posix", reason="a board without hardware needs pseudo-terminals")

LOGGER = """
import sys
from thermid.bench.logger import Logger, Settings
log = Logger(sys.argv[1], lambda: sys.argv[2], None, Settings(silence=600.0))
while log.state.lines < 3:
    log.step()
print("logs", flush=True)
while True:
    log.step()
"""


FOLDERS = Path(__file__).parents[1], Path(__file__).parents[2] / "examples" / "bench"
BOARD = """
import math, sys
sys.path[:0] = sys.argv[1:]
from pseudo_terminal import Terminal
from python_board import Board
board = Board(lambda t, d: [20.0 + k + math.sin(t / 5000) for k in range(10)], 10)
with Terminal(board, speed=1e6, waits=True, keep=False) as terminal:
    print(terminal.port, board.roms[0], flush=True)
    sys.stdin.read()
"""


def logged(path: Path, session: int) -> list[str]:
    """Lines of the board in one session of a log; a last line that was cut is none."""
    whole = path.read_text().rpartition("\n")[0].splitlines()
    return [line.split(" ", 2)[2].rpartition(" ")[0] for line in whole if line.startswith(f"{session} ")]


@pytest.mark.parametrize("kills", [pytest.param(4, id="4"), pytest.param(200, id="200", marks=pytest.mark.campaign)])
def test_killed_at_any_moment_at_most_the_line_in_flight_is_missing(kills: int, tmp_path: Path) -> None:
    rng = random.Random(8)
    path = tmp_path / "bench.log"
    board = Board(lambda t, d: [20.0 + t / 1000, 21.0, 22.0], 3)
    in_flight = 0
    with Terminal(board, speed=100.0, waits=True) as terminal:  # a slow disk must not make it overflow
        for session in range(1, kills + 1):
            logger = subprocess.Popen([sys.executable, "-c", LOGGER, str(path), terminal.port], stdout=subprocess.PIPE, text=True)
            assert logger.stdout is not None
            assert logger.stdout.readline() == "logs\n"
            time.sleep(rng.uniform(0.0, 0.25))
            with terminal.lock:  # the board stands still: what nobody reads would overflow on a busy machine
                logger.kill()
                logger.wait()
                logger.stdout.close()
                sent, unread = list(terminal.lines), terminal.unread().decode()
            found = logged(path, session)
            start = sent.index(found[0])  # a port that is opened begins with what comes after
            assert found == sent[start : start + len(found)]
            rest = "".join(line + "\n" for line in sent[start + len(found) :])
            assert rest.endswith(unread)
            missing = rest[: len(rest) - len(unread)]
            assert missing.count("\n") + (not missing.endswith("\n") and missing != "") <= 1
            in_flight += missing != ""
    record = td.read_record(path, {rom: rom for rom in board.roms[1:]})
    for rom, value in zip(board.roms[1:], (21.0, 22.0), strict=True):
        np.testing.assert_array_equal(record[rom].values[record[rom].valid], value + 273.15)
    print(f"{kills} kills: in {in_flight} of them one line was in flight; all others lost nothing")


def resident() -> float:
    """Memory of this process [MB]."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="memory is read from /proc")
@pytest.mark.parametrize("hours", [pytest.param(0.1, id="6 min"), pytest.param(24.0, id="24 h", marks=pytest.mark.campaign)])
def test_a_day_at_ten_sensors_keeps_its_memory_and_loses_nothing(hours: float, tmp_path: Path) -> None:
    path = tmp_path / "bench.log"
    # in a process of its own: two threads that pass single bytes to each other wait for the interpreter's lock
    board = subprocess.Popen([sys.executable, "-c", BOARD, *map(str, FOLDERS)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert board.stdout is not None
    port, rom = board.stdout.readline().split()
    begun = time.monotonic()
    log = Logger(path, lambda: port, None, Settings(silence=3600.0), sync=False)
    while log.state.seconds < hours * 360.0:
        log.step()
    early = resident()
    while log.state.seconds < hours * 3600.0:
        log.step()
    late = resident()
    missing, lines = log.state.missing, log.state.lines
    log.store.close()
    board.communicate()
    size = path.stat().st_size / 1e6
    print(f"{hours} h in {time.monotonic() - begun:.0f} s: {lines} lines, {missing} missing, {size:.1f} MB")
    print(f"memory {early:.1f} -> {late:.1f} MB")
    assert missing == 0
    assert late - early < 3.0
    begun = time.monotonic()
    record = td.read_record(path, {rom: rom})
    print(f"read in {time.monotonic() - begun:.1f} s")
    assert record.duration == pytest.approx(hours * 3600.0, abs=5.0)
    assert record[rom].valid.sum() >= hours * 3600 - 3


def damaged(data: bytes, rng: random.Random) -> bytes:
    """Some bytes with one to five accidents."""
    out = bytearray(data)
    for _ in range(rng.randint(1, 5)):
        at, size = rng.randrange(len(out) + 1), rng.randint(1, 40)
        accident = rng.randrange(7)
        if accident == 0 and at < len(out):
            out[at] ^= 1 << rng.randrange(8)
        elif accident == 1 and at < len(out):
            out[at] = rng.randrange(256)
        elif accident == 2:
            del out[at : at + size]
        elif accident == 3:
            out[at:at] = bytes(rng.randrange(256) for _ in range(size))
        elif accident == 4:
            out[at:at] = out[at : at + size]
        elif accident == 5:
            lines = bytes(out).split(b"\n")
            a, b = rng.randrange(len(lines)), rng.randrange(len(lines))
            lines[a], lines[b] = lines[b], lines[a]
            out = bytearray(b"\n".join(lines))
        elif at > len(out) // 2:
            del out[at:]
    return bytes(out)


def stream(seconds: int) -> tuple[Board, list[str]]:
    """What a board with two sensors sends; every value of it is there once."""
    board = Board(lambda t, d: [10.0 + t / 16, 60.0 + t / 16], 2)
    board.advance(seconds * 1000)
    return board, board.take()


@pytest.mark.parametrize("count", [pytest.param(300, id="300"), pytest.param(10_000, id="10000", marks=pytest.mark.campaign)])
def test_no_damaged_stream_is_believed(count: int, tmp_path: Path) -> None:
    rng = random.Random(10)
    _, lines = stream(4)
    known, data = set(lines), ("\n".join(lines) + "\n").encode()
    log = Logger(tmp_path / "bench.log", lambda: "none", sync=False)
    begun, slowest, believed = time.monotonic(), 0.0, 0
    for _ in range(count):
        one = time.monotonic()
        for piece in damaged(data, rng).split(b"\n"):
            for at in range(0, len(piece) + 1, MAX_GARBAGE_BYTES):
                part = piece[at : at + MAX_GARBAGE_BYTES]
                line = log._store_line(part + b"\n")
                if line is not None:
                    assert part.decode("latin-1").rstrip("\r") in known
                    believed += 1
        slowest = max(slowest, time.monotonic() - one)
    log.store.close()
    print(
        f"{count} streams in {time.monotonic() - begun:.1f} s, the slowest {slowest * 1e3:.0f} ms; {believed} lines believed, all as sent"
    )
    for line in (tmp_path / "bench.log").read_text().splitlines():
        if not line.startswith("#"):
            parse_line(line.split(" ", 2)[2].rpartition(" ")[0])


@pytest.mark.parametrize("count", [pytest.param(300, id="300"), pytest.param(10_000, id="10000", marks=pytest.mark.campaign)])
def test_no_damaged_log_is_believed(count: int, tmp_path: Path) -> None:
    rng = random.Random(11)
    board, lines = stream(12)
    path = tmp_path / "bench.log"
    now = [0.0]
    log = Logger(path, lambda: "none", sync=False, clock=lambda: now[0], wall=lambda: 1.7e9 + now[0])
    for line in lines:
        now[0] = parse_line(line).ms / 1000.0 + 0.01 + 1e-5 * len(line)
        log._store_line(line.encode() + b"\n")
    log.store.close()
    names = {"a": board.roms[0], "b": board.roms[1]}
    whole = td.read_record(path, names)
    when = {name: dict(zip(whole[name].values.tolist(), whole.times.tolist(), strict=True)) for name in names}
    data = path.read_bytes()
    begun, slowest, read, refused = time.monotonic(), 0.0, 0, 0
    for _ in range(count):
        path.write_bytes(damaged(data, rng))
        one = time.monotonic()
        try:
            record = td.read_record(path, names)
        except ThermidError as error:
            refused += bool(error.message)
        else:
            read += 1
            for name in names:
                channel = record[name]
                shifts = [t - when[name][v] for t, v, ok in zip(record.times, channel.values.tolist(), channel.valid, strict=True) if ok]
                assert max(shifts) - min(shifts) < 0.1, record.steps
        slowest = max(slowest, time.monotonic() - one)
    print(f"{count} logs in {time.monotonic() - begun:.1f} s, slowest {slowest * 1e3:.0f} ms; {read} opened, others refused with a reason")
    assert read > 0.8 * count
