"""Two masses: the star of the source document's Eqs. 4 to 6 and the two masses of the Modelica Standard Library."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from strategies import TIGHT

pytestmark = pytest.mark.analytic


def _star(mid: bool = True) -> td.Model:
    """Rcn1 2, Rcn2 3, Rcn3 10, Rcd1 0.5, Rcd2 0.8 K/W; C1 900, C2 600 J/K; Q 6.8, 2.168 W (design page on the field, section 4)."""
    links = {
        "rcn1": ("one", "air", 2.0),
        "rcn2": ("two", "air", 3.0),
        "rcn3": ("mid", "air", 10.0),
        "rcd1": ("one", "mid", 0.5),
        "rcd2": ("two", "mid", 0.8),
    }
    return td.model_from_dict(
        {
            "title": "Star",
            "needs": ["air"],
            "nodes": {"one": {"capacitance": "900 [J/K]"}, "two": {"capacitance": "600 [J/K]"}, "mid": {}},
            "conductors": {n: {"kind": "conduction", "between": [a, b], "resistance": f"{r} [K/W]"} for n, (a, b, r) in links.items()},
            "loads": {"q1": {"into": "one", "power": "6.8 [W]"}, "q2": {"into": "two", "power": "2.168 [W]"}},
        }
    )


BENCH = td.Scenario("bench", boundaries={"air": "24 [degC]"}, start="24 [degC]", duration="1 [h]")


def test_star_steady() -> None:
    found = td.steady(_star(), BENCH)
    assert found["one"] - 273.15 == pytest.approx(34.21682759, abs=1e-8)
    assert found["two"] - 273.15 == pytest.approx(32.76744828, abs=1e-8)


def test_star_time_constants() -> None:
    modes = td.simulation.modes(td.simulation.state_space(td.simulation.compile_network(_star())))
    assert modes.time_constants == pytest.approx((1612.305, 371.4195), rel=1e-6)
    assert -1 / modes.time_constants == pytest.approx((-6.20230e-4, -1 / 371.4195), rel=1e-6)


def test_star_transient() -> None:
    solution = td.simulate(_star(), BENCH, times=[600.0, 1800.0, 3600.0], options=TIGHT)
    assert solution["one"].celsius == pytest.approx((27.46325592, 31.05928418, 33.18436127), abs=1e-6)
    assert solution["two"].celsius == pytest.approx((26.29256627, 29.61513161, 31.73300529), abs=1e-6)
    # the massless node is the mean of its neighbours weighted by their conductances
    weights = {"one": 1 / 0.5, "two": 1 / 0.8, "air": 1 / 10.0}
    mean = sum(g * solution[n].kelvin for n, g in weights.items()) / sum(weights.values())
    assert solution["mid"].kelvin == pytest.approx(mean, rel=1e-14)


def test_two_masses_of_the_modelica_library() -> None:
    """C 15 J/K each, G 10 W/K between, 100 and 0 degC, no boundary at all: T1(1 s) = 50 + 50 exp(-4/3)."""
    model = td.model_from_dict(
        {
            "title": "TwoMasses",
            "nodes": {"a": {"capacitance": "15 [J/K]"}, "b": {"capacitance": "15 [J/K]"}},
            "conductors": {"link": {"kind": "conduction", "between": ["a", "b"], "conductance": "10 [W/K]"}},
        }
    )
    scenario = td.Scenario("relax", start="0 [degC]", initial={"a": "100 [degC]"}, duration=60.0)
    solution = td.simulate(model, scenario, times=[1.0, 60.0], options=TIGHT)
    assert solution["a"].celsius[0] == pytest.approx(63.17985691, abs=1e-6)
    assert solution["b"].celsius[0] == pytest.approx(36.82014309, abs=1e-6)
    assert solution.temperatures[1] - 273.15 == pytest.approx((50.0, 50.0), abs=1e-6)
    assert solution.heat_balance().relative < 1e-9
    assert solution.time_constants[0] == math.inf
    assert solution.time_constants[1] == pytest.approx(0.75, rel=1e-9)


def test_an_island_without_a_boundary_is_named_and_warms_at_its_rate() -> None:
    model = td.model_from_dict(
        {"title": "Lone", "nodes": {"a": {"capacitance": "100 [J/K]"}}, "loads": {"q": {"into": "a", "power": "2 [W]"}}}
    )
    solution = td.simulate(model, td.Scenario("on", start="20 [degC]", duration=1000.0))
    assert solution["a"].rise == pytest.approx(20.0, abs=1e-9)
    assert any(re.search(r"'a' .* 72 K/h ", w) for w in solution.warnings)
    with raises_code("model.no-path-to-boundary", match="'a'.*72"):
        td.steady(model, td.Scenario("on", start="20 [degC]"))


def test_dense_output_is_as_good_as_the_steps() -> None:
    """Twenty thousand outputs of one exponential."""
    model = td.model_from_dict(
        {
            "title": "One",
            "needs": ["air"],
            "nodes": {"a": {"capacitance": "100 [J/K]"}},
            "conductors": {"g": {"kind": "conduction", "between": ["a", "air"], "conductance": "0.1 [W/K]"}},
        }
    )
    times = np.linspace(0, 5000, 20001)
    solution = td.simulate(model, td.Scenario("cool", boundaries={"air": "300 [K]"}, start="400 [K]", duration=5000.0), times=times)
    assert solution["a"].kelvin == pytest.approx(300 + 100 * np.exp(-times / 1000), abs=2e-5)
