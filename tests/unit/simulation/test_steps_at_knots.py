"""A step that ends at a sample of a power, just before the run must stop for another change."""

from __future__ import annotations

import numpy as np
import pytest

import thermid as td

DECK = {
    "title": "box with a fan",
    "needs": ["air"],
    "parameters": {"fan": "0"},
    "nodes": {"case": {"capacitance": "40 [J/K]"}, "lid": {"capacitance": "2 [J/K]"}},
    "conductors": {
        "skin": {
            "kind": "convection",
            "between": ["case", "air"],
            "area": "100 [cm^2]",
            "htc": {"coefficient": "3 [W/(m^2 K)]", "exponent": 0.25},
        },
        "blown": {"kind": "conduction", "between": ["lid", "air"], "conductance": "0.2 [W/K] * fan"},
        "seat": {"kind": "conduction", "between": ["case", "lid"], "conductance": "0.3 [W/K]"},
    },
    "loads": {"heat": {"into": "case", "power": "1 [W]"}},
}


@pytest.mark.parametrize("late", [0.01, 0.05, 0.09])
def test_a_jump_between_the_sample_and_the_stop_has_a_step_of_its_own(late: float) -> None:
    """A power that jumps, and a fan that is switched a moment later: the same step was tried a million times."""
    rng, edges = np.random.default_rng(3), 10.0 * np.arange(1.0, 601.0)
    watts = 2.0 + rng.normal(0.0, 0.8, edges.size + 1)
    times = np.ravel(np.column_stack((edges - 1e-6, edges)))
    power = (np.append(0.0, times), np.repeat(watts, 2)[:-1])
    fan = (edges[::37] + late, np.arange(edges[::37].size) % 2.0)
    scenario = td.Scenario(
        "switched",
        boundaries={"air": "22 [degC]"},
        loads={"heat": (power[0], td.quantity(power[1], unit="W"))},
        schedule={"fan": (np.append(0.0, fan[0]), np.append(0.0, fan[1]))},
        start="22 [degC]",
        duration=6000.0,
    )
    model = td.model_from_dict(DECK)
    ends = [3000.0, 6000.0]
    run = td.simulate(model, scenario, times=ends, options=td.Options(error=1e-4, max_steps=30_000))
    finer = td.simulate(model, scenario, times=ends, options=td.Options(error=1e-6, max_step=2.0))
    assert run["case"].kelvin == pytest.approx(finer["case"].kelvin, abs=2e-4)
