"""Biot numbers of nodes from the geometry of the deck: which node is not at one temperature, and into how many to split it."""

from __future__ import annotations

import re

import numpy as np
import pytest

import thermid as td


def wall(conductivity: float, htc: str | dict[str, object] = "20 [W/(m^2 K)]") -> td.Model:
    """A wall of 10 mm before a board: one node, a film on it, conduction through it."""
    return td.model_from_dict(
        {
            "title": "wall",
            "needs": ["air"],
            "nodes": {"wall": {"capacitance": "400 [J/K]"}, "board": {"capacitance": "50 [J/K]"}},
            "conductors": {
                "film": {"kind": "convection", "between": ["wall", "air"], "htc": htc, "area": "0.02 [m^2]"},
                "through": {
                    "kind": "conduction",
                    "between": ["wall", "board"],
                    "conductivity": f"{conductivity} [W/(m K)]",
                    "area": "0.02 [m^2]",
                    "thickness": "10 [mm]",
                },
                "bolts": {"kind": "conduction", "between": ["wall", "board"], "conductance": "0.1 [W/K]"},
            },
            "loads": {"heat": {"into": "board", "power": "3 [W]"}},
        }
    )


def found(model: td.Model) -> list[str]:
    return [f.message for f in model.check() if f.code == "physics.not-one-temperature"]


def test_a_plastic_wall_is_named_with_its_number_and_pieces() -> None:
    (message,) = found(wall(0.2))
    assert re.search(r"'wall' is 1, .* 0\.1: .* 4 \w+ ", message)  # 20 * 0.01 / 0.2


def test_a_metal_wall_is_one_node() -> None:
    assert found(wall(130.0)) == []


def test_natural_convection_counts_at_ten_kelvin() -> None:
    law = {"coefficient": "2 [W/(m^2 K)]", "exponent": 0.25}
    assert found(wall(0.36, law)) == []  # 2 * 10^0.25 = 3.56 W/(m^2 K)
    assert len(found(wall(0.35, law))) == 1


def test_a_fit_that_finds_another_coefficient_remarks_on_it() -> None:
    bench = td.Scenario("b", {"air": "20 [degC]"}, start="20 [degC]", duration="3 [h]")
    true = td.simulate(wall(2.0, "40 [W/(m^2 K)]"), bench, times=np.arange(0.0, 10801.0, 60.0))
    data = td.Record.from_arrays(
        "log", true.times, {"T": td.Channel.from_array("T", true["wall"].kelvin, unit="K", role="node", target="wall", noise=0.05)}
    )
    first = wall(2.0, "10 [W/(m^2 K)]")
    assert found(first) == []
    fit = td.calibrate(first, data, ["film.htc"], scenario=bench)
    (remark,) = [w for w in fit.warnings if "Biot" in w]
    assert re.search(r"'wall' is 0\.2, .* 0\.1", remark)
    assert fit["film.htc"].value == pytest.approx(40.0, rel=0.01)
