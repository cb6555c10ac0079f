"""Identify mode and the ice point, with a board whose sensors are warmed and iced by the test."""

from __future__ import annotations

import re
from pathlib import Path

from python_board import Board, BoardPort

from thermid.bench.bench_files import load_sensors
from thermid.bench.guide import ice_point, name_sensors
from thermid.bench.logger import Logger, Settings


class Hand:
    """A hand that warms one sensor after the other."""

    def __init__(self, order: list[int]) -> None:
        self.order, self.warm = order, [20.0, 20.0, 20.0]

    def __call__(self, seconds: float, duties: tuple[float, float]) -> list[float]:
        for k in range(3):
            goal = 33.0 if self.order and k == self.order[0] else 20.0
            self.warm[k] += 0.2 * (goal - self.warm[k])
        return self.warm


def logger(folder: Path, board: Board) -> Logger:
    port = BoardPort(board)
    return Logger(folder / "b.log", lambda: port, None, Settings(), sync=False, clock=port.clock, wall=port.wall)


def test_the_sensor_that_is_warmed_gets_the_name(tmp_path: Path) -> None:
    hand = Hand([2, 0, 1])
    board = Board(hand, 3)
    said: list[str] = []

    def name(question: str) -> str:
        k = hand.order.pop(0)
        assert board.roms[k] in question
        return f"T{k}"

    log = logger(tmp_path, board)
    made = name_sensors(log, tmp_path / "sensors.toml", said.append, name)
    log.close()
    assert [each.name for each in made] == ["T2", "T0", "T1"]
    assert {rom: each.name for rom, each in load_sensors(tmp_path / "sensors.toml").items()} == {board.roms[k]: f"T{k}" for k in range(3)}


def test_nothing_warmed_is_said(tmp_path: Path) -> None:
    said: list[str] = []
    log = logger(tmp_path, Board(Hand([]), 3))
    assert name_sensors(log, tmp_path / "sensors.toml", said.append, lambda text: "x", patience=10.0) == []
    log.close()
    assert re.search(r" 2 K .* 10 s, .* 3 ", said[-1])


def test_the_ice_point_writes_certificates(tmp_path: Path) -> None:
    board = Board(lambda t, d: [0.25, -0.125, 21.0], 3)
    board.faults[1] = ""
    said: list[str] = []
    log = logger(tmp_path, board)
    made = ice_point(log, tmp_path / "sensors.toml", said.append, lambda text: True)
    log.close()
    assert [each.certificate.offset for each in made if each.certificate] == [0.25, -0.125]
    assert re.search(rf"^{board.roms[2]}: .* 21\.00 degC\. .* 2 K ", said[-1])
    assert set(load_sensors(tmp_path / "sensors.toml")) == {board.roms[0], board.roms[1]}
