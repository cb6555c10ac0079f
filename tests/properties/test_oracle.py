"""Random models against equations written in the tests themselves and integrated by scipy."""

from __future__ import annotations

import numpy as np
import pytest

import thermid as td
from oracle import Oracle, flatten
from strategies import DURATION, LOADS, SMOOTH, SWITCHED, TIGHT, WITHOUT_KNEES, Case, cases, random_models

TIMES = np.linspace(1.7, DURATION - 1.1, 61)  # never at a jump, where a massless node has two temperatures
BEGINNER = 1e-3  # knees, as of natural convection that reverses, cost the default tolerances up to half of it, in kelvin


def _run(case: Case, options: td.Options, accuracy: float) -> tuple[float, int]:
    """Return the largest error [K] and the number of switchings."""
    flat, names = flatten(case.deck)
    scenario = {**case.scenario, "initial": {names[n]: v for n, v in case.scenario["initial"].items()}}
    expected = Oracle(flat, scenario).temperatures(TIMES, rtol=accuracy, atol=10 * accuracy)
    found = td.simulate(case.model, case.run(), times=TIMES, options=options)
    error = max(float(np.abs(found[path].kelvin - expected[name]).max()) for path, name in names.items() if name in expected)
    return error, len(found.statistics["switchings"])


def _largest_error(case: Case, options: td.Options, accuracy: float) -> float:
    return _run(case, options, accuracy)[0]


def _switches(case: Case) -> bool:
    return "thermostat" in str(case.deck)


@random_models(20, case=cases(loads=SMOOTH))
def test_random_models_at_the_tolerance_of_a_beginner(case: Case) -> None:
    # at 1e-7 scipy itself once stepped over a knee and was 1.2e-3 K off where thermid was 1.3e-5 K
    assert _largest_error(case, td.Options(), 1e-9) < BEGINNER


@random_models(20, case=cases(loads=LOADS))
def test_random_models_at_a_tight_tolerance(case: Case) -> None:
    assert _largest_error(case, TIGHT, 1e-9) < 1e-4


@random_models(20, case=cases(kinds=WITHOUT_KNEES, loads=SMOOTH))
def test_random_models_without_knees_at_a_tight_tolerance(case: Case) -> None:
    assert _largest_error(case, TIGHT, 1e-9) < 1e-5


@random_models(
    15, case=cases(kinds=("gap", "conductance", "radiation"), loads=SMOOTH, nodes=4, depth=1).filter(lambda c: "'gas'" in str(c.deck))
)
def test_random_models_with_gas_in_gaps(case: Case) -> None:
    assert _largest_error(case, TIGHT, 1e-9) < 1e-5


# The oracle finds switching instants on its own dense output: at 1e-8 it errs by 1e-5 K itself. The phase of a thermostat's cycle has
# nothing that pulls it back, so that errors of the instants add up: 130 switchings at a tolerance of 1e-8 K end 1e-5 K off, 7.6e-8 K each.
# The bound is twenty tolerances a switching, since about as many steps lie between two of them and each may err by one.
@random_models(10, case=cases(kinds=WITHOUT_KNEES, loads=(*SMOOTH, "thermostat"), nodes=4, depth=1).filter(_switches))
def test_random_models_with_thermostats(case: Case) -> None:
    error, switchings = _run(case, TIGHT, 1e-10)
    assert error < max(1e-5, 2e-7 * switchings)


@random_models(10, case=cases(loads=SWITCHED, nodes=4, depth=1).filter(_switches))
def test_random_models_with_thermostats_and_knees(case: Case) -> None:
    error, switchings = _run(case, TIGHT, 1e-10)
    assert error < max(1e-4, 2e-7 * switchings)


@pytest.mark.properties
def test_a_controlled_heater_on_a_massless_node_that_only_radiates() -> None:
    """0.02 (290 - T) = 0.1 sigma 0.005 (T^4 - 255^4): between the knee at 280 K and the set point, where Newton's steps overshoot."""
    model = td.model_from_dict(
        {
            "title": "Foil",
            "needs": ["walls"],
            "nodes": {"mass": {"capacitance": "20 [J/K]"}, "foil": {}},
            "conductors": {
                "link": {"kind": "conduction", "conductance": "1 [W/K]", "between": ["mass", "walls"]},
                "rad": {"kind": "radiation", "emissivity": 0.1, "area": "0.005 [m^2]", "between": ["foil", "walls"]},
            },
            "loads": {"q": {"into": "foil", "power": "0.2 [W]", "proportional": {"gain": "0.02 [W/K]", "setpoint": "290 [K]"}}},
        }
    )
    scenario = td.Scenario("cold walls", boundaries={"walls": "255 [K]"}, start="255 [K]", duration=3600.0)
    coefficient = 0.1 * 5.670374419e-8 * 0.005
    low, high = 280.0, 290.0
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if 0.02 * (290 - middle) > coefficient * (middle**4 - 255**4) else (low, middle)
    assert td.simulate(model, scenario)["foil"].kelvin[-1] == pytest.approx(low, abs=1e-6)
