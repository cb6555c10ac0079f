"""The firmware in the simulator: sensors, faults, cut-offs, and the logger on it."""

from __future__ import annotations

import re
import shutil
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from python_board import made_up_rom
from simulated import Simulated

import thermid as td
from thermid.bench.bench_files import MappedSensor, Programme
from thermid.bench.logger import Logger, Settings

NAMES = {made_up_rom(k): MappedSensor(f"T{k}", made_up_rom(k)) for k in range(3)}


def marks(path: Path) -> list[str]:
    return [line.split(" ")[4] for line in path.read_text().splitlines() if line.startswith("# mark ")]


class Run:
    """A simulated board and a logger on it."""

    def __init__(self, tools: Path, folder: Path) -> None:
        self.tools, self.path = tools, folder / "bench.log"

    def __call__(
        self,
        world: Callable[[float, tuple[float, float]], list[float]],
        script: dict[float, str],
        seconds: float,
        programme: Programme | None = None,
        options: tuple[str, ...] = (),
        **settings: float,
    ) -> Simulated:
        """Log for some time of the board, with orders to the simulator at theirs."""
        left = sorted(script.items())
        with Simulated(world, 3, self.tools, options=options, step=0.25) as board:
            log = Logger(self.path, lambda: board, NAMES, Settings(**settings), programme, sync=False, clock=board.clock)
            while log.state.seconds < seconds:
                log.step(0.25)
                while left and board.seconds >= left[0][0]:
                    board.tell(left.pop(0)[1])
            log.close()
        return board


@pytest.fixture
def run(tools: Path, tmp_path: Path) -> Iterator[Run]:
    return Run(tools, tmp_path)


def steady(t: float, d: tuple[float, float]) -> list[float]:
    return [21.0, -12.375, 125.0]


def test_it_fits_the_board(tools: Path) -> None:
    if shutil.which("avr-size") is None:
        pytest.skip("avr-size is missing")
    said = subprocess.run(["avr-size", str(tools / "thermid_bench.elf")], capture_output=True, text=True, check=True).stdout
    text, data, bss = map(int, re.findall(r"\d+", said.splitlines()[1])[:3])
    assert text + data < 32256 / 2
    assert data + bss < 2048 / 2


def test_every_fault_is_marked_and_none_is_averaged_in(run: Run) -> None:
    script = {
        4.0: "fault 0 crc",
        7.0: "fault 0 good",
        9.0: "fault 1 lost",
        12.0: "fault 1 good",
        15.0: "fault 2 power",
        18.0: "fault 2 good",
        21.0: "short 1",
        24.0: "short 0",
        27.0: "reset",
    }
    run(steady, script, 33.0, limit=125.0)
    record = td.read_record(run.path, {name: name for name in ("T0", "T1", "T2")})
    for name, value in (("T0", 21.0), ("T1", -12.375), ("T2", 125.0)):
        channel = record[name]
        np.testing.assert_allclose(channel.values[channel.valid] - 273.15, value)
        assert channel.valid.sum() > 10
    assert record["T0"].flags["wrong CRC"] >= 2
    assert record["T1"].flags["sensor lost"] >= 2
    assert record["T1"].flags["sensor without supply"] == 1  # back, it shows 85 degC once
    assert record["T2"].flags["sensor without supply"] >= 2
    assert min(record[name].flags["bus shorted"] for name in ("T0", "T1", "T2")) >= 2
    found = marks(run.path)
    assert "reset" in found
    assert found.count("fault") >= 6
    assert found.count("good") >= 6
    assert "missing" not in found


def test_resolution_interval_and_supply(run: Run) -> None:
    run(lambda t, d: [20.3, 20.3, -20.3], {0.0: "supply 12000 -5000"}, 12.0, options=("--supply",), bits=9, interval=0.5)
    record = td.read_record(run.path, {"T0": "T0", "T2": "T2"})
    values = record["T0"].values[record["T0"].valid] - 273.15
    assert values[-1] == pytest.approx(20.5)
    assert record["T2"].values[record["T2"].valid][-1] - 273.15 == pytest.approx(-20.5)
    assert np.median(np.diff(record.times[record["T0"].valid])) == pytest.approx(0.5, abs=0.01)
    power = td.read_record(run.path, {"power1": {"load": "heater"}})["power1"]
    np.testing.assert_allclose(power.values[power.valid][1:], 12.0 * -0.5)


def test_the_supply_is_averaged_over_the_pwm_also_after_it_was_gone(run: Run) -> None:
    run(steady, {0.0: "supply 12000 5000", 6.0: "supply 0 0", 9.0: "supply 12000 5000"}, 15.0, options=("--supply",), limit=125.0)
    current = td.read_record(run.path, {"current1": {"command": "i"}})["current1"]
    # the simulator gives a reading that is not averaged as caught on (1 A) or off
    assert set(np.round(current.values[current.valid], 4)) == {0.0, 0.5}
    assert current.flags["sensor lost"] >= 1
    assert (current.values[current.valid][-4:] == 0.5).all()


def test_a_sensor_that_lives_on_the_bus_is_refused(run: Run) -> None:
    run(steady, {}, 4.0, options=("--parasite",), limit=125.0)
    assert "parasite" in marks(run.path)
    sources = {line.split(",")[3] for line in run.path.read_text().splitlines() if " D," in line}
    assert made_up_rom(0) not in sources
    assert {made_up_rom(1), made_up_rom(2)} <= sources


def off_after(board: Simulated, since: float) -> float:
    """Time from `since` until the pin of heater 1 rests, by the simulator."""
    on = [at for at, first, _ in board.history if first > 0.0]
    assert on
    return max(on) - since


def test_the_heater_is_off_two_seconds_after_the_limit(run: Run) -> None:
    crossed: list[float] = []

    def rising(t: float, d: tuple[float, float]) -> list[float]:
        hot = 60.0 + t
        if hot >= 70.0 and not crossed:
            crossed.append(t)
        return [20.0, hot, 20.0]

    board = run(rising, {}, 18.0, Programme((0.0,), ((700, 0),)), limit=70.0, interval=30.0)
    print(f"off {off_after(board, crossed[0]):.2f} s after the limit")
    assert 0.0 < off_after(board, crossed[0]) <= 2.0
    assert "overtemp" in marks(run.path)
    assert max(first for _, first, _ in board.history) == pytest.approx(0.7, abs=0.01)


def test_the_heater_is_off_when_the_host_falls_silent(tools: Path, tmp_path: Path) -> None:
    with Simulated(lambda t, d: [20.0] * 3, 3, tools, step=0.25) as board:
        programme = Programme((0.0,), ((500, 0),))
        log = Logger(tmp_path / "b.log", lambda: board, NAMES, Settings(silence=10.0), programme, sync=False, clock=board.clock)
        while not any(first for _, first, _ in board.history):
            assert board.seconds < 60.0
            log.step(0.25)
        log._link._settings = Settings(silence=3600.0)  # says nothing any more, and goes on to listen
        log._link.add("silence,2000")
        heard = board.seconds
        while board.seconds < heard + 8.0:
            log.step(0.25)
        log.store.close()
    told = [line for line in (tmp_path / "b.log").read_text().splitlines() if ",silent*" in line]
    assert len(told) == 1
    print(f"off {off_after(board, heard):.2f} s after the host's last word but one, silence set to 2 s")
    assert off_after(board, heard) <= 4.0  # 2 s of silence, after the command that set them
    assert board.history[-1][1] == 0.0


def test_the_heater_is_off_when_no_sensor_can_be_read(run: Run) -> None:
    board = run(lambda t, d: [20.0] * 3, {6.0: "short 1"}, 12.0, Programme((0.0,), ((500, 0),)))
    assert "blind" in marks(run.path)
    assert board.history[-1][1] == 0.0
