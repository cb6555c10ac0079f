"""The logger against a board on a pseudo-terminal: every fault a mark, none averaged in, the run goes on."""

from __future__ import annotations

import errno
import os
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from python_board import Board, made_up_rom

import thermid as td
from by_code import of_code, raises_code
from pseudo_terminal import Terminal
from thermid.base.errors import RecordError
from thermid.bench import benchlog as stores
from thermid.bench._wire import sealed
from thermid.bench.bench_files import MappedSensor, Programme
from thermid.bench.logger import Logger, Settings

from .bench import cycles, marks, until

pytest.importorskip("serial", reason="pyserial is not installed: thermid[log]")
pytestmark = pytest.mark.skipif(os.name != "posix", reason="a board without hardware needs pseudo-terminals")


class Bench:
    """A board that shows 21 and 22 degC, and a logger on it."""

    def __init__(self, folder: Path, **settings: float) -> None:
        self.board = Board(lambda t, d: [21.0, 22.0 + 10 * d[0]], 2)
        self.path = folder / "bench.log"
        self.terminal = Terminal(self.board, speed=50.0, link=folder / "port")
        self.folder = folder
        self.log = self.logger(**settings)

    def logger(self, **settings: float) -> Logger:
        names = {rom: MappedSensor(f"T{k}", rom) for k, rom in enumerate(self.board.roms, 1)}
        return Logger(self.path, lambda: str(self.folder / "port"), names, Settings(silence=60.0, **settings), sync=False)

    def record(self) -> td.Record:
        return td.read_record(self.path, {"T1": "T1", "T2": "T2"})


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    made = Bench(tmp_path)
    with made.terminal:
        yield made
        made.log.close()


def sent_and_logged(bench: Bench) -> tuple[list[str], list[str]]:
    """What the board sent since the first line that the port saw open, and what stands in the log."""
    logged = [line.split(" ", 2)[2].rpartition(" ")[0] for line in bench.path.read_text().splitlines() if line[0] != "#"]
    sent = list(bench.terminal.lines)
    return sent[sent.index(logged[0]) :], logged


def test_what_is_logged_is_what_was_sent(bench: Bench) -> None:
    cycles(bench.log, 20)
    sent, logged = sent_and_logged(bench)
    assert logged == sent[: len(logged)]
    record = bench.record()
    np.testing.assert_array_equal(record["T1"].values[record["T1"].valid], 294.15)


@pytest.mark.parametrize("fault", ["crc", "lost", "short", "power", "-2032", "2400", "1360"])
def test_a_sensor_fault_is_marked_and_masked(bench: Bench, fault: str) -> None:
    cycles(bench.log, 4)
    bench.board.faults[0] = fault
    until(bench.log, lambda: bool(bench.log.watch.faults))
    cycles(bench.log, 3)
    bench.board.faults.clear()
    until(bench.log, lambda: not bench.log.watch.faults)
    cycles(bench.log, 3)
    found = marks(bench.path)
    assert (found.count("fault"), found.count("good")) == (1, 1)
    record = bench.record()
    assert (record["T1"].values[record["T1"].valid] == 294.15).all()
    assert sum(record["T1"].flags.values()) >= 3
    assert record["T2"].valid[np.isfinite(record["T2"].values)].all()


def test_a_reset_is_marked_and_the_settings_said_again(bench: Bench) -> None:
    cycles(bench.log, 3)
    with bench.terminal.lock:
        bench.board.reset("watchdog")
    until(bench.log, lambda: "reset" in marks(bench.path))
    cycles(bench.log, 5)
    assert bench.board.settings["silence"] == 60_000
    assert of_code(bench.record().steps, "bench.resets", ": 1$")


def test_garbage_and_a_cut_line_are_kept_as_marks(bench: Bench) -> None:
    cycles(bench.log, 3)
    bench.terminal.inject(b"\x00\xff\x1a\r garbage \n")
    bench.terminal.cut_next()
    until(bench.log, lambda: marks(bench.path).count("garbled") >= 2)
    cycles(bench.log, 3)
    text = bench.path.read_text()
    assert "garbage" in text
    assert "missing" in marks(bench.path)
    assert of_code(bench.record().steps, "bench.missing-lines", ": 1$")


def test_garbage_without_an_end_does_not_fill_the_memory(bench: Bench) -> None:
    cycles(bench.log, 3)
    bench.terminal.inject(b"x" * 3000)
    until(bench.log, lambda: marks(bench.path).count("garbled") >= 7)
    cycles(bench.log, 3)
    assert bench.record()["T1"].valid.sum() > 4


def test_a_pulled_cable_is_marked_and_the_log_goes_on(bench: Bench) -> None:
    cycles(bench.log, 3)
    bench.terminal.unplug()
    until(bench.log, lambda: "port-gone" in marks(bench.path))
    bench.terminal.plug()
    until(bench.log, lambda: marks(bench.path).count("port") == 2)
    before = bench.log.state.lines
    until(bench.log, lambda: bench.log.state.lines > before + 50)
    assert "missing" in marks(bench.path)
    first = next(line for line in bench.path.read_text().splitlines() if line[0] != "#")  # what came before the port was open is not known
    assert bench.log.state.missing + bench.log.state.lines == bench.log.state.number + 1 - int(first.split(",")[1])
    assert bench.record()["T2"].valid.sum() > 5


def test_a_full_disk_waits_in_memory_and_loses_nothing(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    cycles(bench.log, 3)
    real, full = os.write, [True]

    def write(file: int, data: bytes) -> int:
        if full[0] and file == bench.log.store._file:
            if len(data) > 20:
                return real(file, data[:7])  # a disk that fills takes a part first
            raise OSError(errno.ENOSPC, "no space left on device")
        return real(file, data)

    monkeypatch.setattr(stores.os, "write", write)
    taken = bench.log.state.lines
    while bench.log.state.lines < taken + 30:
        bench.log.step(0.05)
        if bench.log.store.waiting > 200:
            monkeypatch.setattr(stores.os, "write", lambda f, d: write(f, d[:10]) if f == bench.log.store._file else real(f, d))
    full[0] = False
    monkeypatch.setattr(stores.os, "write", real)
    until(bench.log, lambda: not bench.log.store.waiting)
    cycles(bench.log, 3)
    sent, logged = sent_and_logged(bench)
    assert logged == sent[: len(logged)]
    assert {"disk-full", "disk-back"} <= set(marks(bench.path))


def test_a_jump_of_the_hosts_clock_is_marked_and_stamps_do_not_follow(tmp_path: Path) -> None:
    import time

    ahead = [0.0]
    board = Board(lambda t, d: [20.0], 1)
    with Terminal(board, speed=50.0) as terminal:
        log = Logger(tmp_path / "b.log", lambda: terminal.port, sync=False, wall=lambda: time.time() + ahead[0])
        cycles(log, 3)
        ahead[0] = 3600.0
        cycles(log, 3)
        ahead[0] = -10.0
        cycles(log, 3)
        log.close()
    assert marks(tmp_path / "b.log").count("clock") == 2
    record = td.read_record(tmp_path / "b.log", {"a": board.roms[0]})
    assert record.duration < 60.0


def test_a_silent_board_is_marked(tmp_path: Path) -> None:
    now = [0.0]
    board = Board(lambda t, d: [20.0], 1)
    board.hear = lambda text: None
    board.take()  # not even what it is
    with Terminal(board, speed=0.0) as terminal:
        log = Logger(tmp_path / "b.log", lambda: terminal.port, sync=False, clock=lambda: now[0], wall=lambda: 1e9 + now[0])
        for _ in range(20):
            now[0] += 1.0
            log.step(0.001)
        log.close()
    assert marks(tmp_path / "b.log").count("quiet") == 1


def test_the_heater_follows_its_programme(tmp_path: Path) -> None:
    board = Board(lambda t, d: [20.0 + 10 * d[0]], 1)
    with Terminal(board, speed=50.0) as terminal:
        programme = Programme((0.0, 5.0, 12.0), ((0, 0), (400, 100), (800, 0)), 20.0)
        log = Logger(tmp_path / "b.log", lambda: terminal.port, None, Settings(silence=60.0), programme, sync=False)
        until(log, lambda: log.done)
        log.close()
    record = td.read_record(tmp_path / "b.log", {"heater1": {"command": "h"}})
    duties = record["heater1"]
    for time, duty in ((3.0, 0.0), (10.0, 0.4), (18.0, 0.8)):
        at = np.searchsorted(record.times[duties.valid], time)
        assert duties.values[duties.valid][at] == pytest.approx(duty)
    assert board.duty == [0, 0]


def test_heaters_are_off_when_the_logger_ends(bench: Bench) -> None:
    bench.log.programme = Programme((0.0,), ((500, 0),))
    until(bench.log, lambda: bench.board.duty[0] == 500)
    bench.log.close()
    assert bench.board.duty == [0, 0]
    bench.log = bench.logger()


def test_a_second_start_continues_the_log(bench: Bench) -> None:
    cycles(bench.log, 5)
    bench.log.close()
    with bench.path.open("a") as file:
        file.write("1 99.0 D,half a li")
    bench.log = bench.logger()
    cycles(bench.log, 5)
    assert bench.log.store.session == 2
    assert "cut" in marks(bench.path)
    (starts,) = of_code(bench.record().steps, "bench.starts")
    assert starts.endswith(": 2")


def test_two_loggers_do_not_write_to_one_file(bench: Bench) -> None:
    with raises_code("bench.log", RecordError):
        bench.logger()


def test_another_file_is_not_written_to(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("my notes\n")
    with raises_code("output.over-another-file", RecordError):
        Logger(tmp_path / "notes.txt", lambda: "nowhere")
    assert (tmp_path / "notes.txt").read_text() == "my notes\n"


def test_a_line_that_the_board_refuses_is_marked(bench: Bench) -> None:
    bench.log.ask("resolution,7")
    until(bench.log, lambda: "refused" in marks(bench.path))


@pytest.mark.parametrize("word", ["interval", "bits", "limit", "silence"])
def test_settings_that_no_board_takes_are_refused(word: str) -> None:
    with pytest.raises(RecordError, match=word):
        Settings(**{word: -300.0})


def test_the_map_is_held_against_what_answers(tmp_path: Path) -> None:
    board = Board(lambda t, d: [21.0, 22.0], 2)
    names = {rom: MappedSensor(name, rom) for rom, name in ((board.roms[0], "plate"), (made_up_rom(9), "ghost"))}
    with Terminal(board, speed=50.0) as terminal:
        log = Logger(tmp_path / "b.log", lambda: terminal.port, names, Settings(silence=60.0), sync=False)
        until(log, lambda: log.state.seconds > 5.0)
        log.ask("identify")
        cycles(log, 3)
        log.close()
    assert (log.marks["absent"], log.marks["unnamed"]) == (1, 1)  # said once, however often the board is asked
    assert log.watch.faults == {made_up_rom(9): "absent"}
    assert f"ghost (ROM {made_up_rom(9)})" in (tmp_path / "b.log").read_text()


def test_heaters_that_were_cut_off_need_a_word_before_they_are_on_again(tmp_path: Path) -> None:
    board, path = Board(lambda t, d: [50.0], 1), tmp_path / "b.log"
    names, heats = {board.roms[0]: MappedSensor("plate", board.roms[0])}, Programme((0.0,), ((300, 0),))
    with Terminal(board, speed=50.0, link=tmp_path / "port") as terminal:

        def logger(programme: Programme | None, **more: bool) -> Logger:
            return Logger(path, lambda: str(tmp_path / "port"), names, Settings(silence=60.0), programme, sync=False, **more)

        log = logger(heats)
        until(log, lambda: board.duty[0] == 300)
        with terminal.lock:
            board._cut_off_heaters("overtemp", board.roms[0])
        until(log, lambda: "overtemp" in log.marks)
        terminal.unplug()
        until(log, lambda: "port-gone" in log.marks)
        terminal.plug()
        until(log, lambda: "latched" in log.marks)  # a cable that comes back allows nothing, and ends nothing
        cycles(log, 2)
        log.close()
        before = path.read_text()
        why = r"1 and 2 off: .*, \d+ s .* 1 of .* \(20.*--clear-latch"
        with raises_code("bench.sensor", RecordError, match=why):
            logger(heats)
        assert path.read_text() == before  # nothing was begun
        log = logger(None)  # temperatures may be logged
        until(log, lambda: "latched" in log.marks)
        log.close()
        assert board.refuses == "overtemp"
        log = logger(heats, clear_latch=True)
        until(log, lambda: board.duty[0] == 300)
        log.close()
        log = logger(heats)  # it was allowed once
        until(log, lambda: board.duty[0] == 300)
        log.close()
    assert marks(path).count("cleared") == 1
    assert board.duty == [0, 0]


@pytest.mark.parametrize("word", ["overtemp", "blind"])
def test_a_board_that_was_cut_off_without_this_log_says_so_at_the_start(tmp_path: Path, word: str) -> None:
    board = Board(lambda t, d: [50.0], 1)
    board.refuses = word
    with Terminal(board, speed=50.0) as terminal:
        log = Logger(tmp_path / "b.log", lambda: terminal.port, None, Settings(silence=60.0), Programme((1800.0,), ((300, 0),)), sync=False)
        with raises_code("bench.sensor", RecordError, match="1 .* 2 off: .*--clear-latch"):
            until(log, lambda: False)
        log.close()
    assert board.refuses == word
    assert board.duty == [0, 0]


def test_the_first_piece_of_an_open_port_is_no_alarm(tmp_path: Path) -> None:
    log = Logger(tmp_path / "b.log", lambda: "none", sync=False)
    log._fresh = True
    log._store_line(b"5,ok*1234\n")
    log._store_line(b"5,ok*1234\n")
    log.close()
    first, second = [line for line in (tmp_path / "b.log").read_text().splitlines() if " garbled " in line]
    assert "CRC" not in first
    assert "its CRC is" in second


def test_what_a_full_disk_never_took_is_kept_elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    monkeypatch.setattr(stores.tempfile, "gettempdir", lambda: str(elsewhere))
    log = Logger(tmp_path / "b.log", lambda: "none", sync=False)
    whole, real = tmp_path / "b.log", os.write

    def write(file: int, data: bytes) -> int:
        if file != log.store._file:
            return real(file, data)
        if len(data) > 30:
            return real(file, data[:9])
        raise OSError(errno.ENOSPC, "no space left on device")

    monkeypatch.setattr(stores.os, "write", write)
    for k in range(5):
        log._store_line(sealed(f"D,{k},{1000 * k},{made_up_rom(0)},320,ok").encode() + b"\n")
    log.close()
    assert log.store.rest is not None
    assert log.store.rest.parent == elsewhere
    whole.write_bytes(whole.read_bytes() + log.store.rest.read_bytes())
    record = td.read_record(whole, {"a": made_up_rom(0)})
    assert record["a"].valid.sum() == 5
    assert not any("damaged" in step or "cut" in step for step in record.steps)


def test_a_place_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    with raises_code("bench.log", RecordError):
        Logger(tmp_path / "no" / "b.log", lambda: "none")
    with raises_code("bench.log", RecordError):
        Logger(tmp_path, lambda: "none")
