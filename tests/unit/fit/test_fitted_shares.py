"""One measured power that two loads share: its parts are fitted and sum to one, because the deck says so."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import thermid as td
from by_code import raises_code

DECK = {
    "title": "box",
    "needs": ["air"],
    "parameters": {"to_board": {"value": "0.6", "min": 0.1, "max": 1.0}, "to_supply": "1 - to_board"},
    "nodes": {"board": {"capacitance": "130 [J/K]"}, "supply": {"capacitance": "60 [J/K]"}},
    "conductors": {
        "link": {"kind": "conduction", "between": ["board", "supply"], "conductance": "0.3 [W/K]"},
        "out": {"kind": "conduction", "between": ["board", "air"], "conductance": "0.5 [W/K]"},
        "side": {"kind": "conduction", "between": ["supply", "air"], "conductance": "0.2 [W/K]"},
    },
    "loads": {"board_heat": {"into": "board", "power": "8 [W]"}, "supply_heat": {"into": "supply", "power": "2 [W]"}},
}
SHARED = {"volts": "V", "amperes": "I"}
AIR = td.Scenario("air", boundaries={"air": "22 [degC]"})


def log(path: Path) -> Path:
    """Write a log of both parts, with 82 % of 10 W in the board."""
    rng, state = np.random.default_rng(1), np.zeros(2)
    matrix = np.array([[-0.8 / 130.0, 0.3 / 130.0], [0.3 / 60.0, -0.5 / 60.0]])
    rows = ["time [s],B [degC],S [degC],V [V],I [A]"]
    for t in np.arange(0.0, 3600.0, 1.0):
        watts = 10.0 if 300.0 <= t < 2400.0 else 0.0
        if t % 10.0 == 0.0:
            board, supply = 22.0 + state + 0.05 * rng.standard_normal(2)
            rows.append(f"{t:g},{board:.3f},{supply:.3f},24,{watts / 24.0:.5f}")
        state = state + matrix @ state + watts * np.array([0.82 / 130.0, 0.18 / 60.0])
    path.write_text("\n".join(rows) + "\n")
    return path


def channels(**power: object) -> dict[str, object]:
    return {
        "B": {"node": "board", "noise": "0.05 [K]"},
        "S": {"node": "supply", "noise": "0.05 [K]"},
        "P_B": {"load": "board_heat", "power": SHARED, "gain": "to_board", **power},
        "P_S": {"load": "supply_heat", "power": SHARED, "gain": "to_supply", **power},
    }


@pytest.mark.parametrize("power", [{}, {"accuracy": "0.1 [W]"}])
def test_shares_that_sum_to_one_are_fitted(tmp_path: Path, power: dict[str, object]) -> None:
    record = td.read_record(log(tmp_path / "log.csv"), channels(**power))
    fit = td.calibrate(td.model_from_dict(DECK), record, ["to_board", "board.capacitance"], scenario=AIR)
    assert fit["to_board"].value == pytest.approx(0.82, abs=3.0 * fit["to_board"].error + 0.002)
    assert fit["board.capacitance"].value == pytest.approx(130.0, rel=0.02)
    assert fit["to_board"].error < 0.02


def test_a_share_is_a_plain_number(tmp_path: Path) -> None:
    deck = DECK | {"parameters": DECK["parameters"] | {"to_board": "6 [W]", "to_supply": "4 [W]"}}
    record = td.read_record(log(tmp_path / "log.csv"), channels())
    with raises_code("unit.wrong-dimension"):
        td.calibrate(td.model_from_dict(deck), record, ["board.capacitance"], scenario=AIR)
