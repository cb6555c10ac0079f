"""What a run errs by beside the error that it was asked for: half of random networks far below it, few above."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import thermid as td
from fuzz.contestants import TIGHT
from fuzz.judge import truth
from fuzz.networks import Case, draw
from thermid import _kernel as k
from unit.kernel.reference import THERMOSTAT

FAMILIES = ("plain", "stiff", "driven", "repeated", "switching")
MOST = 2.0
"""Errors that 97 of a hundred may make, in parts of what was asked."""
HOTTEST = 2000.0
SENSES = 0.01
"""A thermostat with less hysteresis than that switches thousands of times a day, and each instant errs. [K]"""


def _asked(seed: int, family: str) -> Case:
    """Return a case with 61 evenly spaced outputs."""
    case = draw(seed, family)
    case.times = np.linspace(case.times[0], case.times[-1], 61)
    return case


def _narrow(case: Case) -> bool:
    limits = [row[2] for row in case.net.loads if row[0] == THERMOSTAT]
    return any(abs(case.net.coefs[c[2]][0] - case.net.coefs[c[1]][0]) < SENSES for c in limits)


def _parts(case: Case, real: np.ndarray, error: float) -> float:
    """Return the largest error of a run at nodes with mass, in parts of what is asked; a massless one may have several balances."""
    asked: dict[str, Any] = {"atol": td.Options(error=error).of_step, "rtol": 0.0, "input_atol": error, "max_steps": 200_000}
    found = case.net.run(case.times, **asked)
    assert found.status == k.OK
    return float(np.abs(found.traces - real)[:, case.net.capacities() > 0.0].max(initial=0.0)) / error


@pytest.mark.properties
@pytest.mark.parametrize("error", [1e-2, 1e-3, 1e-4])
def test_a_run_errs_by_what_it_was_asked_for(error: float) -> None:
    parts = []
    for seed in range(10_000, 10_025):
        for family in FAMILIES:
            case = _asked(seed, family)
            tight = case.net.run(case.times, **(TIGHT | {"rtol": 0.0, "max_steps": 200_000}))
            if tight.status == k.OK and np.abs(tight.traces).max() < HOTTEST and not _narrow(case):
                parts.append(_parts(case, tight.traces, error))
    assert len(parts) > 100
    assert np.median(parts) < 0.2
    assert np.quantile(parts, 0.97) < MOST


@pytest.mark.properties
@pytest.mark.campaign
@pytest.mark.parametrize("error", [1e-2, 1e-3, 1e-4])
def test_beside_solutions_that_are_not_of_the_kernel(error: float) -> None:
    parts = []
    for seed in range(20_000, 20_100):
        for family in FAMILIES:
            case = _asked(seed, family)
            _, real = truth(case)
            if real is not None and np.abs(real).max() < HOTTEST and not _narrow(case):
                parts.append(_parts(case, real, error))
    assert len(parts) > 200
    assert np.median(parts) < 0.2
    assert np.quantile(parts, 0.97) < MOST
