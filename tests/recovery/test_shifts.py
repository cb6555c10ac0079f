"""How often the test of inherited values is right on autocorrelated deviations; docs/levels.md has the table of 200 cases a cell."""

from __future__ import annotations

import numpy as np
import pytest

from recovery.shift_cases import CELLS, Cell, counted

pytestmark = pytest.mark.recovery

SEED = 20261122


def test_a_sample_of_cells() -> None:
    some = [counted(cell, 10, SEED) for cell in (Cell(1, 1, 1, 0.3, 600.0), Cell(2, 1, 2, 0.1, 5400.0), Cell(1, 3, 1, 0.6, 1800.0))]
    print(some)
    assert np.mean([c.false for c in some]) <= 0.15  # nominally 0.05 of 30 cases: more than 4 have a chance of 1.6 %
    assert np.mean([c.found for c in some]) >= 0.85
    assert max(c.missed for c in some) <= 0.2
    assert max(c.largest for c in some) <= 0.1


@pytest.mark.campaign
def test_every_cell_two_hundred_times() -> None:
    every = {cell: counted(cell, 200, SEED) for cell in CELLS}
    for cell, c in every.items():
        print(cell, c)
    assert np.mean([c.false for c in every.values()]) <= 0.07
    assert max(c.false for c in every.values()) <= 0.10
    assert np.mean([c.found for c in every.values()]) >= 0.90
    assert min(c.found for c in every.values()) >= 0.85
    assert max(c.missed for c in every.values()) <= 0.12
    assert max(c.largest for c in every.values()) <= 0.10
