"""Where the heat of a steady state goes: by conductor, by node, between groups, and readings by psi."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import thermid as td
from thermid.simulation._heat_map import margins

DECK: dict[str, Any] = {
    "title": "x",
    "needs": ["air", "inlet"],
    "nodes": {"a": {"capacitance": "10 [J/K]"}, "b": {"capacitance": "10 [J/K]"}, "gas": {"capacitance": "1 [J/K]", "stands_for": "air"}},
    "conductors": {
        "ab": {"kind": "conduction", "between": ["a", "b"], "conductance": "0.5 [W/K]"},
        "out": {"kind": "radiation", "between": ["b", "air"], "emissivity": 0.9, "area": "0.05 [m^2]"},
        "wet": {"kind": "convection", "between": ["a", "gas"], "htc": "20 [W/(m^2 K)]", "area": "0.02 [m^2]"},
        "blow": {"kind": "flow", "between": ["inlet", "gas"], "mass_flow": "0.5 [g/s]", "specific_heat": "1006 [J/(kg K)]"},
    },
    "loads": {"q": {"into": "a", "power": "8 [W]"}},
}
ROOM = td.Scenario("room", boundaries={"air": "20 [degC]", "inlet": "18 [degC]"})


def heat(**more: Any) -> Any:
    return td.steady(td.model_from_dict(DECK | more), ROOM).heat


def test_every_node_balances_and_a_stream_takes_nothing_from_where_it_comes() -> None:
    found = heat()
    assert found.worst() < 1e-9
    by_node = {b.node: b for b in found.balances()}
    assert by_node["inlet"].residual == 0.0
    assert by_node["gas"].residual == pytest.approx(0.0, abs=1e-9)
    assert by_node["a"].loads == 8.0
    gained = 0.5e-3 * 1006 * (found.temperatures["gas"] - 291.15)
    assert by_node["air"].residual + gained == pytest.approx(8.0, rel=1e-9)
    assert [b.kelvin for b in found.balances()] == sorted((b.kelvin for b in found.balances()), reverse=True)


def test_groups_by_pattern_by_part_and_alone() -> None:
    found = heat()
    groups = found.grouped({"solids": "a,b"})
    assert groups == {"solids": ("a", "b"), "air": ("air",), "inlet": ("inlet",), "gas": ("gas",)}
    matrix = found.between(groups)
    assert matrix[0, 0] == 8.0
    assert matrix[0, 1:].sum() == pytest.approx(8.0, rel=1e-9)
    off = matrix - np.diag(np.diag(matrix))
    assert off[0, 3] == -off[3, 0]
    package = {"board": "b", "theta_JB": "5 [K/W]", "power": "1 [W]"}
    made = heat(packages={"u1": package, "u2": package}).grouped()
    assert made["packages"] == ("u1.junction", "u2.junction")


def test_columns_are_as_wide_as_their_widest_number() -> None:
    """A heat of -1e-5 W has ten characters and pushed its row out of the columns."""
    found = heat(loads={"q": {"into": "a", "power": "-12.347 [uW]"}})
    _, names, *rows = found.lines(found.grouped({"solids": "a,b"}))[:6]
    assert "1.235e-05" in rows[0]
    assert max(len(text) for row in rows for text in row.split()) > 8
    assert {len(row) for row in rows} == {len(names)}


def test_mean_and_periodic_states_have_their_heat() -> None:
    pulsed = DECK | {"loads": {"q": {"into": "a", "power": "8 [W]", "periodic": {"period": "10 [s]", "duty": 0.25}}}}
    model = td.model_from_dict(pulsed)
    for kind in ("mean", "periodic"):
        found = td.steady(model, ROOM, kind).heat
        assert found is not None
        assert found.loads["q"][1] == pytest.approx(2.0, rel=2e-3)
        assert found.worst() < 2e-3


def test_readings_by_psi() -> None:
    top = {"to": "air", "area": "1 [cm^2]", "htc": "10 [W/(m^2 K)]", "emissivity": 0}
    package = {
        "board": "b",
        "theta_JB": "5 [K/W]",
        "theta_JC": "8 [K/W]",
        "psi_JT": "0.4 [K/W]",
        "psi_JB": "4.5 [K/W]",
        "power": "2 [W]",
        "top": top,
    }
    found = heat(packages={"u1": package})
    psi, kelvin = found.readings["u1.junction"]
    assert psi == "psi_JB"
    assert kelvin == pytest.approx(found.temperatures["b"] + 9.0)
    alone = heat(packages={"u1": {k: v for k, v in package.items() if k != "psi_JB"}})
    assert alone.readings["u1.junction"] == ("psi_JT", pytest.approx(alone.temperatures["u1.case"] + 0.8))
    assert any("by psi_JT" in line for line in alone.lines(alone.grouped()))


def test_margins_are_sorted_by_what_is_left() -> None:
    low, high = {"a": 300.0, "b": 290.0, "c": 310.0}, {"a": 320.0, "b": 330.0, "c": 312.0}
    rows = margins(low, high, {"b": (280.0, 335.0), "*": (295.0, np.inf)})
    assert [(m.node, m.margin) for m in rows] == [("b", 5.0), ("a", 5.0), ("c", 15.0)]
    assert [m.node for m in margins(low, high, {})] == ["b", "a", "c"]
