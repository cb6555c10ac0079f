"""Row W4 of the acceptance sheet: computational intelligence reaches the least-squares optimum on m_PrE, and what it costs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import thermid as td
from recovery.cases import draw, stack_interfaces
from thermid.fit._search import Population, evolved
from thermid.fit.calibration import Request, build_problem

pytestmark = pytest.mark.recovery
BENCH = replace(stack_interfaces(), accuracy=0.0, meter=0.0)
FREE = list(BENCH.ranges)


@pytest.fixture(scope="module")
def records() -> list[td.Record]:
    return draw(BENCH, np.random.default_rng(3))[1]


def test_w4_evolution_alone_reaches_the_optimum_within_one_per_cent(records: list[td.Record]) -> None:
    # without polishing, so over everything that the fit looks for: the start of each node stands at what the fit found for it
    local = td.calibrate(BENCH.model, records, FREE, search="local")
    scenarios = {
        r.name: td.Scenario(
            r.name, initial={i.name.removeprefix("initial."): td.quantity(i.value, unit="K") for i in local.local if i.record == r.name}
        )
        for r in records
    }
    problem = build_problem(Request(BENCH.model, tuple(records), tuple(FREE), scenarios, fit_start=False))
    found = evolved(Population.of_problem(problem, "linear", 1.0))
    assert 2.0 * found.cost == pytest.approx(local.chi_square, rel=0.01)


@pytest.mark.parametrize("how", ["differential evolution", "multistart"])
def test_w4_polished_it_ends_where_least_squares_ends(how: str, records: list[td.Record]) -> None:
    local = td.calibrate(BENCH.model, records, FREE, search="local")
    found = td.calibrate(BENCH.model, records, FREE, search=how)
    assert found.chi_square == pytest.approx(local.chi_square, rel=1e-6)
    assert found.evaluations > 10 * local.evaluations
    for path in FREE:
        assert found[path].value == pytest.approx(local[path].value, abs=0.01 * local[path].error)
    assert how in str(found)
