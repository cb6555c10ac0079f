"""A joint that is half gas: recognised as uncertain from a log in air, told apart by a second one at low pressure."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.base.errors import DeckError, IdentificationError
from thermid.measure.records import Channel, Record

AREA = "4 [cm^2]"
HALF: dict[str, Any] = {"contact_conductance": "260 [W/(m^2 K)]", "gap": "100 [um]"}
"""Spots that touch, and 0.1 mm of air that carries as much."""


def stack(joint: dict[str, Any]) -> td.Model:
    """A heated block on a base of known temperature."""
    return td.model_from_dict(
        {
            "title": "stack",
            "needs": ["air", "base"],
            "nodes": {"block": {"capacitance": "60 [J/K]"}},
            "surfaces": {"skin": {"of": "block", "to": "air", "area": "20 [cm^2]", "htc": "5 [W/(m^2 K)]", "emissivity": 0.05}},
            "conductors": {
                "joint": {"between": ["block", "base"]} | (joint if "kind" in joint else {"kind": "contact", "area": AREA} | joint)
            },
            "loads": {"heat": {"into": "block", "power": "4 [W]"}},
        }
    )


BENCH = td.Scenario("bench", boundaries={"air": "24 [degC]", "base": "20 [degC]"}, start="base", duration="1 [h]")
EMPTY = BENCH.vacuum().with_(title="pumped")


def log_of(scenario: td.Scenario, seed: int) -> Record:
    run = td.simulate(stack(HALF), scenario, every=30.0)
    noisy = run["block"].kelvin + 0.05 * np.random.default_rng(seed).standard_normal(run.times.size)
    return Record.from_arrays(
        scenario.title, run.times, {"T": Channel.from_array("T", noisy, unit="K", role="node", target="block", noise=0.05)}
    )


def test_fitted_in_air_the_joint_is_doubtful_without() -> None:
    plain = stack({"contact_conductance": {"value": "300 [W/(m^2 K)]", "min": 20, "max": 3000}})
    fit = td.calibrate(plain, log_of(BENCH, 1), ["joint.contact_conductance", "block.capacitance"], scenario=BENCH)
    assert fit["joint.contact_conductance"].value == pytest.approx(520.0, rel=0.02)
    found = td.predict(fit, EMPTY)
    truth = td.simulate(stack(HALF), EMPTY)["block"].kelvin[-1] - 273.15
    last = found["block"].final
    assert last.low < truth < last.high
    alone = td.simulate(fit.model, EMPTY)["block"].final
    assert alone + 5.0 < truth  # by itself the fitted joint carries twice as much as what is left of it
    assert any("'joint.contact_conductance'" in w for w in found.warnings)
    assert any("gas in joints" in cause for cause in found.causes)
    in_air = td.predict(fit, BENCH)
    assert not any("gas in joints" in cause for cause in in_air.causes)
    assert in_air["block"].final.error < 0.1 * last.error


def test_a_joint_filled_by_a_pad_loses_nothing_without_gas() -> None:
    """A pad took its heat conductance for gas between faces: in vacuum a band of 9 K about a joint that had not changed."""
    bands = []
    for words in ({}, {"gas": "none"}):
        model = stack({"contact_conductance": {"value": "300 [W/(m^2 K)]", "min": 20, "max": 3000}} | words)
        fit = td.calibrate(model, log_of(BENCH, 1), ["joint.contact_conductance", "block.capacitance"], scenario=BENCH)
        bands.append(td.predict(fit, EMPTY))
    bare, padded = (found["block"].final for found in bands)
    assert padded.error < 0.3 * bare.error
    assert bare.celsius > padded.celsius + 5.0
    assert not any("gas in joints" in cause for cause in bands[1].causes)
    assert not any("gas between the faces" in w for w in bands[1].warnings)


@pytest.mark.parametrize("words", [{"gas": "none", "gap": "100 [um]"}, {"gas": "He"}])
def test_a_gas_of_a_joint_needs_a_gap_and_none_excludes_it(words: dict[str, str]) -> None:
    with raises_code("value.contradicts", DeckError, match="gap"):
        stack({"contact_conductance": "300 [W/(m^2 K)]"} | words)


def test_a_second_record_at_low_pressure_tells_spots_and_gas_apart() -> None:
    both = stack(
        {"contact_conductance": {"value": "400 [W/(m^2 K)]", "min": 20, "max": 3000}, "gap": {"value": "200 [um]", "min": 10, "max": 2000}}
    )
    free = ["joint.contact_conductance", "joint.gap", "block.capacitance"]
    with raises_code("fit.not-determined", IdentificationError, match=r"'joint\.gap'"):
        td.calibrate(both, log_of(BENCH, 1), free, scenario=BENCH)
    fit = td.calibrate(both, [log_of(BENCH, 1), log_of(EMPTY, 2)], free, scenario={"bench": BENCH, "pumped": EMPTY})
    assert fit["joint.contact_conductance"].value == pytest.approx(260.0, rel=0.02)
    assert fit["joint.gap"].value == pytest.approx(1e-4, rel=0.03)
    found = td.predict(fit, EMPTY)
    assert not any("gas in joints" in cause for cause in found.causes)
    rise = found["block"].final.celsius - 20.0
    assert 1.96 * found["block"].final.error < 0.1 * rise
