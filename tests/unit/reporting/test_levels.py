"""What a page says of values that were handed on."""

from __future__ import annotations

import math
from types import SimpleNamespace

import pytest

from thermid.identify.moves import Group, Move, Moves
from thermid.reporting.levels import moved


@pytest.fixture
def moves() -> Moves:
    far = Move("a.power", "a", "box", 4.0, 4.4, "W", 3.4, 0.0007)
    still = Move("t", "", "box", 293.15, 294.15, "degC", math.nan, math.nan)
    return Moves((far, still), (Group("all together", ("a.power", "t"), 11.6, 1, 0.0007), Group("part 'x'", (), 0.0, 0, math.nan)))


def test_every_value_and_group_has_a_line(moves: Moves) -> None:
    table = moved(SimpleNamespace(moved=moves, values={}))  # type: ignore[arg-type]
    text = [[cell.text if hasattr(cell, "text") else cell for cell in row] for row in table.rows]
    assert text[0] == ["a.power", "box", "4", "4.4", "W", "10", "+3.4", "0.00070", "had to move"]
    assert text[1][2:4] == ["20", "21"]
    assert text[1][-1] == "not tested"
    assert text[2][6:] == ["χ² 11.6 of 1", "0.00070", "had to move"]
    assert text[3][-1] == "not tested"


def test_lines_of_text(moves: Moves) -> None:
    assert list(moves.lines()) == [
        "  against the stages below:",
        "    a.power  4 -> 4.4 W (+10 %): had to move, 3.4 standard deviations",
        "    t  20 -> 21 degC (+5 %): not tested, this level says nothing of it",
        "    all together: had to move, chi-square 11.6 in 1 direction (chance 0.0007)",
        "    part 'x': not tested",
    ]
