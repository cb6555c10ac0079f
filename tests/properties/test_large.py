"""Random models by the methods of large networks against the small integrator."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume

import thermid as td
from strategies import DURATION, LOADS, TIGHT, Case, cases, random_models

TIMES = np.linspace(1.7, DURATION - 1.1, 61)  # never at a jump, where a massless node has two temperatures
FINE = td.Options(error=4e-5, inputs=1e-5, method="large")


def _differ(case: Case, options: td.Options) -> float:
    """Return the largest difference [K] between the two integrators; cases that one of them leaves to the other are passed over."""
    try:
        run = td.simulate(case.model, case.run(), times=TIMES, options=options)
    except td.ThermidError as error:
        assume("cannot run this model" not in str(error))
        raise
    return float(np.abs(run.temperatures - td.simulate(case.model, case.run(), times=TIMES, options=TIGHT).temperatures).max())


@pytest.mark.properties
@random_models(40, case=cases(loads=LOADS))
def test_random_models_by_the_methods_of_large_networks(case: Case) -> None:
    assert _differ(case, FINE) < 1e-3


@pytest.mark.properties
@random_models(20, case=cases(loads=LOADS))
def test_random_models_by_the_implicit_method(case: Case) -> None:
    assert _differ(case, td.Options(error=4e-5, inputs=1e-5, method="TR-BDF2")) < 1e-3
