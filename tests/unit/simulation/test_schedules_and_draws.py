"""A scheduled parameter and one that changes from run to run: as a product they serve one wiring, otherwise they are refused."""

from __future__ import annotations

import numpy as np
import pytest

import thermid as td
from thermid.errors import ScenarioError


def model(conductance: str) -> td.Model:
    return td.model_from_dict(
        {
            "title": "x",
            "needs": ["air"],
            "parameters": {"a": "0.5 [W/K]", "b": "0.2 [W/K]", "c": 1.0},
            "nodes": {"n": {"capacitance": "100 [J/K]"}},
            "conductors": {"g": {"kind": "conduction", "between": ["n", "air"], "conductance": conductance}},
            "loads": {"h": {"into": "n", "power": "2 [W]"}},
        }
    )


STEPS = {"times": ["0 [s]", "1800 [s]"], "values": ["0.5 [W/K]", "0.1 [W/K]"], "hold": True}
SCENARIO = td.Scenario("s", boundaries={"air": "20 [degC]"}, start="air", duration="1 [h]", schedule={"a": STEPS})


def alone(conductance: str, **values: str) -> np.ndarray:
    return td.simulate(model(conductance).with_values(values), SCENARIO)["n"].kelvin


def test_a_product_is_the_run_that_it_would_be_alone() -> None:
    found = td.ensemble(model("a*c"), SCENARIO, {"c": [1.0, 2.0, 0.0]})
    for member, factor in enumerate((1.0, 2.0, 0.0)):
        assert found.temperatures("n")[:, member] == pytest.approx(alone("a*c", c=f"{factor}"), abs=1e-6)


def test_a_sum_is_refused_member_by_member() -> None:
    """It was run with the schedule of the deck's own values, in silence: 1.4 K off at the end."""
    found = td.ensemble(model("a + b"), SCENARIO, {"b": [0.2, 0.6]})
    assert found.temperatures("n")[:, 0] == pytest.approx(alone("a + b"), abs=1e-6)
    assert list(found.failed) == [1]
    assert "in 'g' a parameter that differs between runs and a scheduled one do not" in found.failed[1]


def test_a_sum_is_refused_in_a_run_at_other_values() -> None:
    ready = td.prepare(model("a + b"), SCENARIO, ["b"])
    assert ready.run()["n"].kelvin == pytest.approx(alone("a + b"), abs=1e-6)
    with pytest.raises(ScenarioError, match="in 'g' a parameter that differs between runs and a scheduled one do not"):
        ready.run({"b": 0.6})
