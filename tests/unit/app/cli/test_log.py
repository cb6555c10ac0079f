"""``thermid log``: what a user types, also wrongly."""

from __future__ import annotations

import os
import re
import signal
import threading
import time
from pathlib import Path

import pytest
from python_board import made_up_rom

import thermid as td
from unit.app.cli.conftest import Call

pytest.importorskip("serial", reason="pyserial is not installed: thermid[log]")

PROGRAMME = 'end = "40 [s]"\nsteps = [{ at = "5 [s]", heater1 = "50 [%]" }]\n'


@pytest.mark.usefixtures("board")
def test_a_step_test_without_hardware(call: Call, tmp_path: Path) -> None:
    (tmp_path / "sensors.toml").write_text(f'[sensors.plate]\nrom = "{made_up_rom(0)}"\n')
    (tmp_path / "step.toml").write_text(PROGRAMME)
    log = tmp_path / "bench.log"
    said = call("log", log, "--sensors", tmp_path / "sensors.toml", "--programme", tmp_path / "step.toml")
    assert said.code == 0
    record = td.read_record(log, {"plate": "plate", "heater1": {"command": "heater"}})
    plate = record["plate"]
    assert plate.valid[1:].all()
    assert plate.values[plate.valid][-1] - plate.values[plate.valid][0] > 0.5
    assert record["heater1"].values[record["heater1"].valid].max() == 0.5


@pytest.mark.usefixtures("board")
def test_what_was_too_hot_is_heated_again_only_if_somebody_says_so(call: Call, tmp_path: Path) -> None:
    (tmp_path / "step.toml").write_text('end = "25 [s]"\nsteps = [{ at = "2 [s]", heater1 = "100 [%]" }]\n')
    asked = ("log", tmp_path / "bench.log", "--programme", tmp_path / "step.toml")
    assert "Marks: overtemp 1." in call(*asked, "--limit", "21.5 [degC]").out
    said = call(*asked)
    assert said.code == 2
    assert "bench.sensor" in said.codes
    assert made_up_rom(0) in said.err
    assert "--clear-latch" in said.err
    assert "cleared 1" in call(*asked, "--clear-latch").out


@pytest.mark.parametrize(
    ("options", "code", "match"),
    [
        (("--interval", "1 [K]"), "unit.wrong-dimension", "--interval"),
        (("--limit", "400 [degC]"), "bench.sensor", "400.* -55 .* 125"),
        (("--sensors", "none.toml"), "record.log-missing", "none.toml: .*`thermid log --identify`"),
        (("--programme", "none.toml"), "file.not-found", "'none.toml'"),
        (("--identify",), "value.incomplete", "--sensors sensors.toml"),
    ],
)
def test_a_mistake_is_named(call: Call, tmp_path: Path, options: tuple[str, ...], code: str, match: str) -> None:
    said = call("log", tmp_path / "bench.log", *options)
    assert (said.code, said.codes) == (2, (code,))
    assert re.search(match, said.err)
    assert not (tmp_path / "bench.log").exists()


def test_no_board_is_an_error_and_not_a_wait(call: Call, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from serial.tools import list_ports

    monkeypatch.setattr(list_ports, "comports", list)
    said = call("log", tmp_path / "bench.log")
    assert said.code == 2
    assert "bench.no-board" in said.codes
    named = call("log", tmp_path / "bench.log", "--port", tmp_path / "ttyUSB9")
    assert named.code == 2
    assert named.codes == ("bench.no-board",)
    assert "ttyUSB9" in named.err
    assert not (tmp_path / "bench.log").exists()


def test_several_boards_are_asked_about(call: Call, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from serial.tools import list_ports
    from serial.tools.list_ports_common import ListPortInfo

    found = [ListPortInfo("ttyA"), ListPortInfo("ttyB")]
    for each in found:
        each.vid = 0x2341
    monkeypatch.setattr(list_ports, "comports", lambda: found)
    assert "bench.no-board" in call("log", tmp_path / "bench.log").codes


@pytest.mark.skipif(os.name != "posix", reason="devices of posix")
def test_a_port_that_is_none_is_an_error_and_not_a_wait(call: Call, tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("no port")
    said = call("log", tmp_path / "bench.log", "--port", tmp_path / "notes.txt")
    assert said.code == 2
    assert said.codes == ("bench.no-board",)
    assert "notes.txt: " in said.err
    assert not (tmp_path / "bench.log").exists()
    missing = call("log", tmp_path / "bench.log", "--port", "ttyX")
    assert missing.code == 2
    assert missing.codes == ("bench.no-board",)
    assert "ttyX" in missing.err


@pytest.mark.skipif(os.name != "posix", reason="a board without hardware needs pseudo-terminals")
def test_a_port_that_is_in_use_is_named(call: Call, tmp_path: Path) -> None:
    from python_board import Board

    from pseudo_terminal import Terminal
    from thermid.bench.port import Port

    with Terminal(Board(lambda t, d: [20.0], 1)) as terminal:
        held = Port(terminal.port)
        said = call("log", tmp_path / "bench.log", "--port", terminal.port)
        held.close()
    assert said.code == 2
    assert said.codes == ("bench.no-board",)
    assert f"{terminal.port}: " in said.err


@pytest.mark.usefixtures("board")
def test_a_log_that_exists_is_continued_and_that_is_said(call: Call, tmp_path: Path) -> None:
    for _ in range(2):
        said = call("log", tmp_path / "bench.log", "--for", "5 [s]")
    assert said.code == 0
    assert re.search(r"bench\.log .* 2 ", said.err)
    assert re.search(r"bench\.log: \d+ \w+, 0 \w+, 0 \w+ \w+\. \w+: none\.", said.out)


@pytest.mark.skipif(os.name != "posix", reason="a board without hardware needs pseudo-terminals")
@pytest.mark.usefixtures("board")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_ends_the_log_between_two_lines(call: Call, tmp_path: Path, number: signal.Signals) -> None:
    (tmp_path / "step.toml").write_text('steps = [{ at = "1 [s]", heater1 = "50 [%]" }]\n')

    def late(number: int, frame: object) -> None:
        """Take a signal that comes when the command is over."""

    own = signal.signal(number, late)
    log = tmp_path / "bench.log"

    def ask() -> None:
        until = time.monotonic() + 60.0
        while time.monotonic() < until and not (log.exists() and ",H1,500,ok" in log.read_text()):
            time.sleep(0.02)
        for _ in range(2):
            os.kill(os.getpid(), number)
            time.sleep(0.02)

    asker = threading.Thread(target=ask)
    asker.start()
    said = call("log", log, "--programme", tmp_path / "step.toml")
    asker.join()
    after = signal.signal(number, own)
    assert after is late
    assert said.code == 0
    assert "stopped; heaters off" in said.out
    text = log.read_text()
    assert " 0 missing" in text.splitlines()[-1]
    assert ",H1,0,ok" in text.rpartition(",H1,500,ok")[2]


def test_several_boards_want_a_choice(call: Call, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from serial.tools import list_ports
    from serial.tools.list_ports_common import ListPortInfo

    boards = []
    for name, maker in (("/dev/ttyACM0", 0x2341), ("/dev/ttyUSB0", 0x1A86), ("/dev/ttyS0", None)):
        boards.append(ListPortInfo(name, skip_link_detection=True))
        boards[-1].vid = maker
    monkeypatch.setattr(list_ports, "comports", lambda: boards)
    said = call("log", tmp_path / "bench.log")
    assert said.code == 2
    assert "bench.no-board" in said.codes
    assert "/dev/ttyACM0 (Arduino), /dev/ttyUSB0 (CH340). Give one" in said.err
