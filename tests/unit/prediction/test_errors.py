"""Predictions by the model of error of a fit: scenarios and records, what is counted beside it, and what is refused."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import thermid as td
from thermid.base.errors import IdentificationError
from thermid.inference.error_model import ErrorModel
from thermid.model.laws import TableSignal
from thermid.prediction._errors import error_model_of
from thermid.prediction.bands import predict_record
from unit.fit.bench import BOX, HTC, MASS, box, deck, log, metered

TIMES = np.linspace(0.0, 18000.0, 121)


def _truth() -> td.Model:
    """A box in free air with a dull skin, which no constant coefficient follows."""
    made: dict[str, Any] = deck(base=BOX)
    made["nodes"]["case"]["mass"] = "1.5 [kg]"
    htc = {"coefficient": "1.5 [W/(m^2 K)]", "exponent": 0.25}
    skin = {"of": "case", "to": "air", "area": "0.05 [m^2]", "emissivity": 0.8, "htc": htc}
    return td.model_from_dict({**made, "surfaces": {"skin": skin}})


def _log(power: float, seed: int, synthetic: bool = False, swing: float = 0.5) -> td.Record:
    watts = np.where(np.arange(121) < 73, power, 0.0)
    on = TableSignal(TIMES, watts, hold=True)
    noises: dict[str, Any] = {"noise": 0.05, "accuracy": 0.1, "samples": 121, "seed": seed, "swing": swing}
    bare = log(_truth(), {}, {"T": "case"}, name=f"{power:g} W", loads={"heat": on}, **noises)
    one = metered(bare, "heat", watts.tolist(), 0.01 * power)
    return replace(one, origin=replace(one.origin, synthetic=synthetic))


def _fit(synthetic: bool = False) -> td.Calibration:
    return td.calibrate(box(), [_log(4.0, 0, synthetic), _log(2.0, 1, synthetic)], [HTC, MASS], search="local")


@pytest.fixture(scope="module")
def fit() -> td.Calibration:
    return _fit()


def _asked(power: float, room: float = 34.0) -> td.Scenario:
    at = f"{room} [degC]"
    return td.Scenario("asked", boundaries={"air": at}, loads={"heat": f"{power} [W]"}, start=at, duration="5 [h]")


def test_a_prediction_is_the_band_of_the_model_of_error(fit: td.Calibration) -> None:
    errors = error_model_of(fit)
    assert isinstance(errors, ErrorModel)
    own, told = errors.band(_asked(6.0), ["case"])["case"], td.predict(fit, _asked(6.0), error_model=True)["case"]
    assert told.kelvin == pytest.approx(own.kelvin, abs=1e-9)
    # one is normal, the other a mixture of normal answers; at the start nearly nothing is unknown
    assert told.half_width[1:] == pytest.approx(own.half_width[1:], rel=0.05, abs=0.01)
    assert sum(told.final.shares.values()) == pytest.approx(1.0)


@pytest.mark.parametrize("power", [3.0, 6.0, 8.0])
def test_it_holds_the_truth_of_a_law_that_no_deck_has(fit: td.Calibration, power: float) -> None:
    told = td.predict(fit, _asked(power), times=TIMES[::4], error_model=True)["case"]
    true = td.simulate(_truth(), _asked(power), times=TIMES[::4])["case"].kelvin
    assert np.mean(np.abs(told.kelvin - true) <= told.half_width) > 0.95
    assert told.half_width.max() < 1.8  # at twice the power; below 1.5 with the first priors of sizes
    assert np.abs(told.simulated - true).max() > np.abs(told.kelvin - true).max()


def test_where_it_settles_is_where_a_long_run_ends(fit: td.Calibration) -> None:
    short, long = td.predict(fit, _asked(6.0), error_model=True), td.predict(fit, _asked(6.0).with_(duration="60 [h]"), error_model=True)
    assert short.settled["case"].celsius == pytest.approx(long.final["case"].celsius, abs=0.02)
    assert short.settled["case"].error == pytest.approx(long.final["case"].error, rel=0.05)


def test_a_record_is_predicted_with_its_band(fit: td.Calibration) -> None:
    """At one and a half times the power, with its room logged: the centre is nearer than the run with the best values."""
    told = predict_record(fit, _log(6.0, 2), error_model=True)
    band = told.bands["T"]
    assert band.inside() > 0.9
    assert band.rmse < 0.7 * band.rmse_of_run
    assert band.half_width().mean() < 1.0
    assert {"values", "structure at this distance", "this run", "noise of a reading"} <= {*band.parts}


def test_a_room_that_is_fitted_to_a_record_takes_up_what_it_can(fit: td.Calibration) -> None:
    bare = _log(3.0, 4, swing=0.1).select("T", "METER")
    own = predict_record(fit, bare, local={"air": {"start": "T", "sd": "2 [K]"}}, error_model=True)
    stated = predict_record(fit, bare, scenario=td.Scenario("s", boundaries={"air": "25 [degC]"}), error_model=True)
    assert "air" in " ".join(own.fitted_locally)
    assert own.bands["T"].inside() > 0.9
    assert own.rmse < stated.rmse


def test_no_number_depends_on_whether_logs_are_called_synthetic(fit: td.Calibration) -> None:
    own, other = (
        td.predict(fit, _asked(6.0), error_model=True)["case"],
        td.predict(_fit(synthetic=True), _asked(6.0), error_model=True)["case"],
    )
    assert other.kelvin == pytest.approx(own.kelvin, abs=1e-5)
    assert other.half_width == pytest.approx(own.half_width, rel=1e-4)


def test_what_is_stated_counts_beside_it(fit: td.Calibration) -> None:
    plain, wide = (
        td.predict(fit, _asked(6.0), error_model=True)["case"].final,
        td.predict(fit, _asked(6.0), error_model=True, spread={"air": "1 [K]"})["case"].final,
    )
    # a room 1 K warmer is a case 0.94 K warmer: its coefficient grows with the level
    assert wide.error**2 - plain.error**2 == pytest.approx(0.94**2, rel=0.05)
    assert wide.shares["stated"] > 0.5


def test_what_the_model_of_error_does_not_follow_is_refused_by_name(fit: td.Calibration, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("thermid.inference.error_model.NODES_FOLLOWED", 0)
    with pytest.raises(IdentificationError, match="at most 0 nodes, not 1"):
        ErrorModel.of(fit)
    with pytest.raises(IdentificationError, match="no draws"):
        td.predict(fit, _asked(6.0), error_model=True, draws=20)
    with pytest.raises(IdentificationError, match="values of a file"):
        td.predict(td.design.Known(fit.fitted_model, (fit.values,)), _asked(6.0), error_model=True)


def test_a_value_that_no_reading_determines_is_named_and_nothing_is_predicted() -> None:
    """No power goes into the core, so nothing says how it is joined; its prior is all that is said of it."""
    made: dict[str, Any] = deck(base=BOX)
    made["nodes"]["core"] = {"capacitance": "0.1 [J/K]"}
    joint = {"value": "0.5 [W/K]", "min": 0.1, "max": 2.5}
    made["conductors"] = {"joint": {"kind": "conduction", "between": ["core", "case"], "conductance": joint}}
    made["loads"]["inside"] = {"into": "core", "power": "0 [W]"}
    model = td.model_from_dict(made)
    record = _log(4.0, 0)
    fit = td.calibrate(model, record, [HTC, "joint.conductance"], priors={"joint.conductance": ("0.5 [W/K]", "45 [%]")}, search="local")
    asked = _asked(6.0).with_(loads={"heat": "2 [W]", "inside": "1 [W]"})
    with pytest.raises(IdentificationError, match=r"no reading determines 'joint.conductance', and the band of 'core'") as refused:
        td.predict(fit, asked, error_model=True)
    assert refused.value.code == "prediction.value-undetermined"
    td.predict(fit, _asked(6.0), nodes=["case"], error_model=True)
