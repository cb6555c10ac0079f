"""Random networks: members run side by side are the runs made one by one."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest
from hypothesis import assume

import thermid as td
from strategies import GASES, SWITCHED, TIGHTER, Case, cases, random_models
from thermid import _kernel
from thermid.base.errors import SolverError

NEAR = 2e-7
"""Ten times what two runs at the tolerances TIGHTER differ by in practice, laws with a knee among them. [K]"""


def _draws(case: Case) -> dict[str, np.ndarray[Any, Any]]:
    """Eleven members: the capacitance, power and temperature of what the case has, ten per cent or some kelvin about their values."""
    loads = {f"scale.{name}": 1.0 for name in case.deck.get("loads", {})}
    massive = {f"initial.{n}": 300.0 for n, fields in case.deck["nodes"].items() if fields}
    generator = np.random.default_rng(1)
    out = {name: one * (1.0 + 0.1 * generator.standard_normal(11)) for name, one in loads.items()}
    out |= {name: one + 10.0 * generator.standard_normal(11) for name, one in massive.items()}
    return out | {name: temperature * (1.0 + 0.1 * generator.standard_normal(11)) for name, temperature in _capacitances(case).items()}


def _capacitances(case: Case) -> dict[str, float]:
    numbers = td.prepare(case.model, case.run()).wiring.network.numbers().values
    return {f"{n}.capacitance": float(numbers[f"{n}.capacitance"]) for n, fields in case.deck["nodes"].items() if "capacitance" in fields}


@random_models(40, case=cases(kinds=GASES, loads=SWITCHED))
def test_members_are_single_runs(case: Case) -> None:
    draws = _draws(case)
    assume(draws)
    ready = td.prepare(case.model, case.run(), tuple(draws), every=300.0, options=TIGHTER)
    found = ready.ensemble(ready.with_units(draws))
    for k in range(found.members):
        values = {name: float(v[k]) for name, v in draws.items()}
        if k in found.failed:
            with pytest.raises(SolverError, match=re.escape(found.failed[k])):
                ready.run(ready.with_units(values))
            continue
        single = ready.run(ready.with_units(values))
        for node in found.nodes:
            assert np.abs(found.trace(k, node).kelvin - single[node].kelvin).max() < NEAR, (k, node)


@random_models(15, case=cases(kinds=GASES, massless=False))
def test_instruction_sets_and_threads_agree(case: Case) -> None:
    draws = _draws(case)
    assume(draws)
    ready = td.prepare(case.model, case.run(), tuple(draws), every=300.0)
    plain = ready.ensemble(ready.with_units(draws), simd="baseline")
    assert plain.members == 11
    for simd in _kernel.instruction_sets()[1:]:
        wide, again = ready.ensemble(ready.with_units(draws), simd=simd), ready.ensemble(ready.with_units(draws), simd=simd, threads=2)
        for node in plain.nodes:
            assert np.array_equal(wide.temperatures(node), again.temperatures(node), equal_nan=True)
            assert np.nanmax(np.abs(wide.temperatures(node) - plain.temperatures(node))) < 1e-5
