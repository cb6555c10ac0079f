"""Row W4 of the acceptance sheet: computational intelligence reaches the least-squares optimum on m_PrE, and what it costs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import thermid as td
from recovery.cases import draw, stack_interfaces

pytestmark = pytest.mark.recovery
BENCH = replace(stack_interfaces(), accuracy=0.0, meter=0.0)
FREE = list(BENCH.ranges)


@pytest.fixture(scope="module")
def records() -> list[td.Record]:
    return draw(BENCH, np.random.default_rng(3))[1]


def test_w4_a_multistart_ends_where_least_squares_ends(records: list[td.Record]) -> None:
    local = td.calibrate(BENCH.model, records, FREE, search="local")
    found = td.calibrate(BENCH.model, records, FREE, search="multistart")
    assert found.chi_square == pytest.approx(local.chi_square, rel=1e-6)
    assert found.evaluations > 10 * local.evaluations
    for path in FREE:
        assert found[path].value == pytest.approx(local[path].value, abs=0.01 * local[path].error)
    assert "multistart" in str(found)
