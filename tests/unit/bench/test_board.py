"""The board of Python: what the firmware must do too."""

from __future__ import annotations

import pytest
from python_board import Board

from thermid.bench._wire import BoardLine, parse_line, sealed


def lines(board: Board) -> list[BoardLine]:
    return [parse_line(each) for each in board.take()]


def heated(hot: float = 20.0) -> Board:
    board = Board(lambda t, d: [hot, 20.0], 2)
    board.hear(sealed("1,heater,1,500"))
    board.take()
    return board


def duties(found: list[BoardLine]) -> list[tuple[int, int]]:
    return [(each.ms, int(each.fields[1])) for each in found if each.kind == "D" and each.fields[0] == "H1"]


def test_heaters_go_off_when_the_host_falls_silent() -> None:
    board = heated()
    board.advance(10_000)
    found = lines(board)
    assert [each.ms for each in found if each.fields[0] == "silent"] == [2000]
    assert duties(found)[-1][1] == 0
    board.hear(sealed("2,heater,1,500"))  # silence is no fault: a host that is back may heat again
    assert [each.fields for each in lines(board) if each.kind == "R"] == [("2", "ok")]


def test_heaters_go_off_at_the_limit_and_stay_off() -> None:
    board = Board(lambda t, d: [90.0 + t], 1)
    for command in ("1,interval,60000", "2,silence,3600000", "3,heater,1,1000"):
        board.hear(sealed(command))
    board.take()
    board.advance(30_000)
    found = lines(board)
    off = [each.ms for each in found if each.fields[0] == "overtemp"]
    assert len(off) == 1
    assert 10_000 <= off[0] <= 12_000  # the limit of 100 degC is reached at 10 s
    board.hear(sealed("4,heater,1,10"))
    board.hear(sealed("5,clear"))
    board.hear(sealed("6,heater,1,10"))
    assert [each.fields[1] for each in lines(board) if each.kind == "R"] == ["overtemp", "ok", "ok"]


def test_heaters_go_off_when_no_sensor_can_be_read() -> None:
    board = heated()
    board.hear(sealed("2,silence,60000"))
    board.faults = {0: "lost", 1: "short"}
    board.advance(5000)
    assert "blind" in [each.fields[0] for each in lines(board) if each.kind == "E"]
    assert board.duty == [0, 0]


@pytest.mark.parametrize(
    ("command", "answer"),
    [
        ("1,resolution,8", "out of range"),
        ("1,resolution,12,4", "unknown"),
        ("1,heater,3,100", "unknown"),
        ("1,heater,1,x", "not a number"),
        ("1,sing", "unknown"),
        ("1,identify,3", "too many arguments"),
    ],
)
def test_a_command_that_makes_no_sense_is_refused(command: str, answer: str) -> None:
    board = heated()
    board.hear(sealed(command))
    assert [each.fields[1] for each in lines(board) if each.kind == "R"] == [answer]


def test_a_garbled_command_is_said_to_be_one() -> None:
    board = heated()
    board.hear("1,heater,1,1000*0000")
    assert [each.fields[0] for each in lines(board)] == ["garbled"]
    assert board.duty == [500, 0]


def test_the_board_counts_what_it_sent() -> None:
    board = heated()
    board.advance(5000)
    sent = board.number
    board.hear(sealed("7,count"))
    assert lines(board)[-1].fields == ("count", str(sent + 1))


def test_resolution_sets_the_step() -> None:
    board = Board(lambda t, d: [20.3], 1)
    board.hear(sealed("1,resolution,9"))
    board.advance(1000)
    assert [each.raw for each in lines(board) if each.kind == "D" and len(each.fields[0]) == 16] == [328]  # 20.5 degC
