"""Values that physics forbids and that were accepted: found by decks with a hostile number each."""

from __future__ import annotations

from typing import Any

import pytest

import thermid as td
from by_code import raises_code

GROUPS: dict[str, dict[str, Any]] = {
    "x.exchange_factor": {
        "conductors": {"x": {"kind": "radiation", "between": ["a", "air"], "area": "20 [cm^2]", "exchange_factor": "p"}},
    },
    "u.psi_JT": {
        "conductors": {"x": {"kind": "conduction", "between": ["a", "air"], "conductance": "1 [W/K]"}},
        "packages": {
            "u": {
                "board": "a",
                "theta_JC": "14 [K/W]",
                "theta_JB": "9 [K/W]",
                "psi_JT": "p",
                "top": {"to": "air", "area": "1 [cm^2]", "htc": 0},
            }
        },
    },
}


@pytest.mark.parametrize(("path", "good", "bad"), [("x.exchange_factor", 0.7, 400.0), ("u.psi_JT", "1 [K/W]", "-1 [K/W]")])
def test_what_physics_forbids_is_refused_whatever_way_it_comes_in(path: str, good: object, bad: object) -> None:
    deck = {"title": "x", "needs": ["air"], "nodes": {"a": {"capacitance": "50 [J/K]"}}, **GROUPS[path]}
    scenario = td.Scenario("x", {"air": "20 [degC]"}, start="30 [degC]", duration="1 [min]")
    right = td.model_from_dict({**deck, "parameters": {"p": good}})
    td.simulate(right, scenario)
    with pytest.raises(td.ThermidError, match=path.rpartition(".")[2]):
        td.simulate(td.model_from_dict({**deck, "parameters": {"p": bad}}), scenario)


def passed(flow: str) -> td.Model:
    stream = {"kind": "flow", "fluid": "air", "volume_flow": "fan.flow"}
    return td.model_from_dict(
        {
            "title": "x",
            "needs": ["air"],
            "nodes": {"gas": {"capacitance": "2 [J/K]", "stands_for": "air"}},
            "conductors": {"in": {"between": ["air", "gas"], **stream}, "out": {"between": ["gas", "air"], **stream}},
            "fans": {"fan": {"curve": [["0 [m^3/h]", "38 [Pa]"], ["95 [m^3/h]", "0 [Pa]"]], "passes": [flow, "12 [Pa]"]}},
        }
    )


@pytest.mark.parametrize("flow", ["1e-300 [m^3/h]", "1e-160 [m^3/h]"])
def test_a_point_of_a_system_that_makes_no_resistance_is_refused(flow: str) -> None:
    """The square of a flow below 1e-154 is zero: a ZeroDivisionError."""
    with raises_code("value.outside-range", td.ThermidError):
        passed(flow)


def test_a_point_of_a_system_at_an_endless_flow_leaves_no_resistance() -> None:
    """The square of a flow above 1e154 was an OverflowError."""
    assert passed("1e300 [m^3/h]").at("fan.resistance").expression.literal.value == 0.0
