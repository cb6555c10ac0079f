"""Speed, guarded by ratios to a loop in numpy that runs in the same test: a slower machine slows both.

The bounds are about twice the processor times measured once, on a busy machine; who makes something faster lowers its bound.
"""

from __future__ import annotations

import subprocess
import sys
import time
from typing import Any

import network
import numpy as np
import pytest
from plain import plain

import thermid as td


def reference_loop() -> float:
    """Best processor time of 500 evaluations of the unit's heat flows in numpy, about 7 ms. [s]"""
    unit, T, best = plain(True), np.full(12, 300.0), np.inf  # noqa: N806
    for _ in range(7):
        begun = time.process_time()
        for _ in range(500):
            unit.heat(T, 298.0)
        best = min(best, time.process_time() - begun)
    return best


@pytest.mark.benchmark(timer=time.process_time)
@pytest.mark.parametrize(
    ("nonlinear", "every", "slopes", "bound"),
    [(False, 1.0, False, 0.4), (True, 1.0, False, 1.1), (True, 60.0, True, 1.8)],
    ids=["B1 run", "B2 run", "B2 sensitivities"],
)
def test_runs(benchmark: Any, nonlinear: bool, every: float, slopes: bool, bound: float) -> None:
    free = network.FREE_NONLINEAR if nonlinear else network.FREE_LINEAR
    simulator = td.prepare(network.model(nonlinear), network.scenario(), free, every=every)
    benchmark.pedantic(simulator.run, kwargs={"sensitivities": slopes}, rounds=15, iterations=3, warmup_rounds=2)
    assert benchmark.stats.stats.min < bound * reference_loop()


@pytest.mark.parametrize(
    ("code", "bound"),
    [
        ("import thermid", 2.0),
        ("import sys; from thermid.cli import main; sys.argv = ['thermid', '--help']; main()", 3.0),
        (
            "import thermid as td; m = td.model_from_dict({'title': 'x', 'needs': ['air'], 'nodes': {'a': {'capacitance': '9 [J/K]'}},"
            "'conductors': {'g': {'kind': 'conduction', 'between': ['a', 'air'], 'conductance': '1 [W/K]'}}});"
            "td.simulate(m, td.Scenario('s', boundaries={'air': '20 [degC]'}, start='30 [degC]', duration=60.0))",
            5.0,
        ),
    ],
    ids=["import", "help", "first result"],
)
def test_cold_start(benchmark: Any, code: str, bound: float) -> None:
    def start(code: str) -> None:
        subprocess.run([sys.executable, "-c", code], check=True, capture_output=True)

    def seconds(code: str) -> float:
        begun = time.perf_counter()
        start(code)
        return time.perf_counter() - begun

    benchmark.pedantic(start, args=(code,), rounds=5, warmup_rounds=1)
    assert benchmark.stats.stats.min < bound * min(seconds("import numpy") for _ in range(5))
