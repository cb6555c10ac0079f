"""A spread of an assumed value widens a band in the fit's own conditions by at most a tenth, where what is free takes its place. Synthetic.

Area, emissivity, mass and contact, of one body, of two behind one another, and of a part one level down; and by the command.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import thermid as td
from thermid.fit.calibration import Calibration
from thermid.measure.records import Channel, Record

START = {"boundaries": {"air": "22 [degC]"}, "start": "22 [degC]"}
CASE: dict[str, Any] = {
    "title": "Case",
    "needs": ["air"],
    "offers": ["case"],
    "nodes": {
        "case": {"mass": {"value": "0.7 [kg]", "source": "assumed"}, "specific_heat": {"value": "900 [J/(kg K)]", "min": 300, "max": 3000}}
    },
    "surfaces": {
        "skin": {
            "of": "case",
            "to": "air",
            "area": {"value": "0.05 [m^2]", "source": "assumed"},
            "emissivity": {"value": "0.8", "min": 0.3, "max": 1, "source": "assumed"},
            "htc": {"value": "5 [W/(m^2 K)]", "min": 0.5, "max": 40},
        }
    },
    "loads": {"heat": {"into": "case", "power": "6 [W]"}},
}
BOARD: dict[str, Any] = {
    "title": "Board in a case",
    "needs": ["air"],
    "submodels": {"shell": {"use": td.model_from_dict(CASE), "bind": {"air": "air"}}},
    "nodes": {"board": {"capacitance": {"value": "120 [J/K]", "min": 20, "max": 600}}},
    "conductors": {
        "pad": {
            "kind": "contact",
            "between": ["board", "shell.case"],
            "area": {"value": "8 [cm^2]", "source": "assumed"},
            "contact_conductance": {"value": "600 [W/(m^2 K)]", "min": 50, "max": 5000, "source": "assumed"},
        }
    },
    "loads": {"chip": {"into": "board", "power": "3 [W]"}},
}
WIDENED = 1.1


def fitted(deck: dict[str, Any], truth: dict[str, str], free: list[str], sensors: tuple[str, ...]) -> Calibration:
    model, times = td.model_from_dict(deck), np.linspace(0.0, 10800.0, 181)
    run = td.simulate(model.with_values(truth), td.Scenario("bench", duration="3 [h]", **START), times=times)
    rng = np.random.default_rng(5)
    channels = {
        n: Channel.from_array(n, run[n].kelvin + 0.05 * rng.standard_normal(times.size), unit="K", role="node", target=n, noise=0.05)
        for n in sensors
    }
    return td.calibrate(model, Record.from_arrays("bench", times, channels, synthetic=True), free, scenario=td.Scenario("bench", **START))


@pytest.fixture(scope="module")
def case() -> Calibration:
    truth = {"skin.htc": "6.5 [W/(m^2 K)]", "case.specific_heat": "1000 [J/(kg K)]"}
    return fitted(CASE, truth, ["skin.htc", "case.specific_heat"], ("case",))


@pytest.fixture(scope="module")
def board() -> Calibration:
    free = ["shell.skin.htc", "shell.case.specific_heat", "board.capacitance", "pad.contact_conductance"]
    return fitted(BOARD, {"pad.contact_conductance": "450 [W/(m^2 K)]"}, free, ("board", "shell.case"))


def half_widths(fit: Calibration, node: str, spread: dict[str, str]) -> tuple[np.ndarray, np.ndarray]:
    own = td.Scenario("own", duration="3 [h]", **START)
    bare, wide = (td.predict(fit, own, spread=s)[node].half_width for s in ({}, spread))
    return bare, wide


def holds(fit: Calibration, node: str, spread: dict[str, str]) -> None:
    """The widest place of the band, and its mean."""
    bare, wide = half_widths(fit, node, spread)
    assert wide.max() <= WIDENED * bare.max()
    assert wide.mean() <= WIDENED * bare.mean()


@pytest.mark.parametrize(
    "spread",
    [{"skin.area": "0.006 [m^2]"}, {"skin.emissivity": "0.1"}, {"case.mass": "0.07 [kg]"}],
    ids=["area", "emissivity", "mass"],
)
def test_of_a_body(case: Calibration, spread: dict[str, str]) -> None:
    holds(case, "case", spread)


@pytest.mark.parametrize("node", ["board", "shell.case"])
@pytest.mark.parametrize(
    "spread",
    [{"pad.area": "1 [cm^2]"}, {"shell.skin.area": "0.006 [m^2]"}, {"shell.skin.emissivity": "0.1"}, {"shell.case.mass": "0.07 [kg]"}],
    ids=["contact", "area", "emissivity", "mass"],
)
def test_of_a_part_inside(board: Calibration, spread: dict[str, str], node: str) -> None:
    """A coefficient follows an area along a line of logarithms, and radiation beside it does not: bands of members were 4 times as wide."""
    holds(board, node, spread)


def test_what_nothing_free_can_stand_for_is_held_by_the_readings() -> None:
    """With the specific heat held, no other value can stand for another mass; the readings themselves determine it."""
    held = fitted(CASE, {"skin.htc": "6.5 [W/(m^2 K)]"}, ["skin.htc"], ("case",))
    holds(held, "case", {"case.mass": "0.07 [kg]"})
    holds(held, "case", {"skin.area": "0.006 [m^2]"})


def test_the_fit_made_again_with_another_area_predicts_the_same(board: Calibration) -> None:
    """What the band says of an area of two standard deviations less, by a fit of the same log."""
    model = td.model_from_dict(BOARD).with_values({"shell.skin.area": "0.0392 [m^2]"})
    again = td.calibrate(model, board.experiments[0].record, list(board.values.parameters), scenario=td.Scenario("bench", **START))
    own = td.Scenario("own", duration="3 [h]", **START)
    one, other = (td.predict(f, own)["board"] for f in (board, again))
    assert np.abs(one.kelvin - other.kelvin).max() < one.half_width.max()
