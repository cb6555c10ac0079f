"""Nodes that settle within the first step: members of an ensemble and large networks are right inside it too."""

from __future__ import annotations

import numpy as np
import pytest

import thermid as td

TIGHT = td.Options(error=8e-10)
LAYERS = [(1.0, 1.0, 2e4), (1.0, 0.3, 2e4), (10.0, 10.0, 2e4), (500.0, 1000.0, 1e4), (0.1, 1.0, 2e4), (0.01, 1.0, 2e4)]
"""Capacitance of the quick node [J/K], its tie to the heavy one [W/K], duration [s]: time constants from milliseconds to seconds."""


def _case(capacitance: float, tie: float, duration: float) -> tuple[td.Model, td.Scenario, np.ndarray]:
    model = td.model_from_dict(
        {
            "title": "layer",
            "needs": ["room"],
            "nodes": {"heavy": {"capacitance": "100 [J/K]"}, "quick": {"capacitance": f"{capacitance} [J/K]"}},
            "conductors": {
                "tie": {"kind": "conduction", "between": ["heavy", "quick"], "conductance": f"{tie} [W/K]"},
                "loss": {"kind": "conduction", "between": ["heavy", "room"], "conductance": "0.5 [W/K]"},
                "glow": {"kind": "radiation", "between": ["quick", "room"], "emissivity": 0.5, "area": "0.01 [m^2]"},
            },
        }
    )
    scenario = td.Scenario("apart", boundaries={"room": "300 [K]"}, start="300 [K]", initial={"quick": "320 [K]"}, duration=duration)
    return model, scenario, np.concatenate([[0.0], np.geomspace(1e-2, 0.999 * duration, 80)])


@pytest.mark.parametrize(("capacitance", "tie", "duration"), LAYERS)
def test_members_are_right_while_a_node_settles(capacitance: float, tie: float, duration: float) -> None:
    model, scenario, times = _case(capacitance, tie, duration)
    exact = td.simulate(model, scenario, times=times, options=TIGHT)
    members = td.ensemble(model, scenario, {"tie.conductance": np.full(9, tie)}, times=times, options=td.Options(error=4e-6))
    for node in ("heavy", "quick"):
        assert np.abs(members.trace(3, node).kelvin - exact[node].kelvin).max() < 5e-6


@pytest.mark.parametrize("method", ["RKC2", "TR-BDF2"])
@pytest.mark.parametrize(("capacitance", "tie", "duration", "most"), [*((*layer, 5e-3) for layer in LAYERS), (500.0, 1e6, 1e3, 0.02)])
def test_large_networks_are_right_while_a_node_settles(capacitance: float, tie: float, duration: float, most: float, method: str) -> None:
    """Heavy nodes tied by 1e6 W/K are right at the ends of steps only; between them the slope is a difference of two large heats."""
    model, scenario, times = _case(capacitance, tie, duration)
    exact = td.simulate(model, scenario, times=times, options=TIGHT)
    options = td.Options(error=2e-3, method=method)
    found = td.simulate(model, scenario, times=times, options=options)
    assert np.abs(found.temperatures - exact.temperatures).max() < most
