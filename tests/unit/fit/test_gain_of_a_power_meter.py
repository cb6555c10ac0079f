"""A power meter whose error is stated in per cent of its reading: one factor of all its records, in the errors of all values."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import thermid as td
from thermid.base.errors import RecordError, UnitError
from thermid.fit.calibration import Calibration
from unit.fit.estimation.rig import Array

STATED = 0.02
TRUTH = {"body.capacitance": 400.0, "skin.conductance": 0.5}
DECK = {
    "title": "box",
    "needs": ["air"],
    "nodes": {"body": {"capacitance": {"value": "360 [J/K]", "min": "100 [J/K]", "max": "900 [J/K]"}}},
    "conductors": {"skin": {"kind": "conduction", "between": ["body", "air"], "conductance": {"value": "0.4 [W/K]", "min": "0.1 [W/K]"}}},
    "loads": {"heater": {"into": "body", "power": "5 [W]"}},
}


def logs(gain: float, seed: int) -> list[td.Record]:
    """Return two records of the true box, at 5 and 1 W, by a meter that reads too much by a share."""
    random, out = np.random.default_rng(seed), []
    for name, watts in (("high", 5.0), ("low", 1.0)):
        times: Array = np.arange(0.0, 5400.0, 20.0)
        over = TRUTH["body.capacitance"] / TRUTH["skin.conductance"]
        body = 293.15 + watts / TRUTH["skin.conductance"] * (1.0 - np.exp(-times / over))
        channels = {
            "body": td.Channel.from_array("body", body + random.normal(0.0, 0.02, times.size), unit="K", noise=0.02, role="node"),
            "air": td.Channel.from_array("air", np.full(times.size, 293.15), unit="K", role="boundary", target="air"),
            "P": td.Channel.from_array(
                "P", np.full(times.size, watts * (1.0 + gain)), unit="W", quantity="power", role="load", target="heater", prompt=True
            ),
        }
        out.append(td.Record.from_arrays(name, times, channels))
    return out


def fitted(gain: float, seed: int, stated: bool) -> Calibration:
    records = logs(gain, seed)
    if stated:
        records = [r.with_sensor("P", gain_accuracy=f"{100 * STATED} [%]") for r in records]
    return td.calibrate(td.model_from_dict(DECK), records, [*TRUTH])


def scores(found: Calibration) -> list[float]:
    """Return how many of its errors each value is off."""
    return [(found[n].value - true) / found[n].error for n, true in TRUTH.items()]


def test_without_a_stated_error_every_value_is_off_by_more_than_its_error() -> None:
    assert min(abs(z) for z in scores(fitted(STATED, 1, False))) > 5.0


def test_the_stated_share_is_in_the_errors_of_all_values_once() -> None:
    """Both records have one meter, so that a second one, at a fifth of the power, narrows nothing."""
    found = fitted(STATED, 1, True)
    assert [found[n].error / found[n].value for n in TRUTH] == pytest.approx([STATED, STATED], rel=0.1)
    assert max(abs(z) for z in scores(found)) < 1.5


def test_values_by_meters_drawn_from_the_stated_share_lie_inside() -> None:
    gains = STATED * np.random.default_rng(5).normal(size=8)
    z = np.array([scores(fitted(float(g), k, True)) for k, g in enumerate(gains)])
    assert np.abs(z).max() < 2.5
    assert 0.5 < np.sqrt(np.mean(z**2)) < 1.6


def test_it_is_read_from_a_table_and_an_accuracy_in_per_cent_names_it(tmp_path: Path) -> None:
    log = tmp_path / "p.csv"
    log.write_text("time_s,T [degC],P [W]\n0,20,5\n10,21,5\n20,22,5\n", encoding="utf-8")
    of = {"load": "heater", "column": "P"}
    read = td.read_record(log, {"T": "T", "P": {**of, "gain_accuracy": "2 [%]", "accuracy": "0.1 [W]"}}, time="time_s")
    assert read["P"].part is not None
    assert (read["P"].part.gain_accuracy, read["P"].accuracy) == (0.02, 0.1)
    with pytest.raises(UnitError, match="gain_accuracy"):
        td.read_record(log, {"T": "T", "P": {**of, "accuracy": "2 [%]"}}, time="time_s")
    with pytest.raises(RecordError) as refused:
        td.read_record(log, {"T": "T", "P": {**of, "gain_accuracy": "2 [%]", "lag": "3 [s]"}}, time="time_s")
    assert refused.value.code == "record.does-not-apply"
    assert replace(read["P"], part=None).accuracy == 0.1
