"""What a page says of inherited values."""

from __future__ import annotations

import math
import re
from types import SimpleNamespace

import pytest

from thermid.fit._uncertainty.moved import UNDECIDED
from thermid.fit.calibration import Move, MovedGroup, Moves
from thermid.reporting._blocks.content import DASH
from thermid.reporting._pages.campaign import moved


@pytest.fixture
def moves() -> Moves:
    far = Move("a.power", "a", "box", 4.0, 4.4, 4.3, "W", 3.4, 0.0007, 0.48, 0.05, 0.05)
    still = Move("t", "", "box", 293.15, 294.15, 293.15, "degC", math.nan, math.nan, math.inf)
    groups = (MovedGroup("all together", ("a.power", "t"), 11.6, 1, 0.0007), MovedGroup("part 'x'", (), 0.0, 0, math.nan))
    return Moves((far, still), groups)


def test_every_value_and_group_has_a_line(moves: Moves) -> None:
    table = moved(SimpleNamespace(moved=moves))  # type: ignore[arg-type]
    text = [[cell.text if hasattr(cell, "text") else cell for cell in row] for row in table.rows]
    assert text[0] == ["a.power", "box", "4.000 ± 0.050", "4.4", "W", "10", "+3.4", "0.00070", "12", "moved"]
    assert text[1] == ["t", "box", "20", DASH, "°C", *[DASH] * 4, UNDECIDED]
    assert text[2][6:] == ["χ² 11.6 of 1", "0.00070", "", "moved"]
    assert text[3][-1] == UNDECIDED


def test_lines_of_text(moves: Moves) -> None:
    _, power, still, together, part = moves.lines()
    assert re.match(r"    a\.power  4\.000 -> 4\.4 W \(\+10 %\): moved, 3\.4 .* 12 % .* 90 % ", power)
    assert still.startswith(f"    t  20 degC: {UNDECIDED}; ")
    assert re.match(r"    all together: moved, .* 11\.6 for 1 .* 0\.0007\)", together)
    assert part == f"    part 'x': {UNDECIDED}"
