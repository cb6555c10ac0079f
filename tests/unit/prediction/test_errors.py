"""Predictions by the model of error of a fit: scenarios and records, what is counted beside it, and what is refused."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import thermid as td
from thermid.base.errors import IdentificationError, code_of
from thermid.fit.error_model import BandCause, ErrorModel, course_of
from thermid.model.tree import TableSignal
from thermid.prediction.advice import AGAIN
from thermid.prediction.bands import predict_record
from thermid.simulation.runs import Engine, Options, Wiring, network_for
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


@pytest.mark.parametrize("power", [3.0, 6.0, 8.0])
def test_it_holds_the_truth_of_a_law_that_no_deck_has(fit: td.Calibration, power: float) -> None:
    told = td.predict(fit, _asked(power), times=TIMES[::4])["case"]
    true = td.simulate(_truth(), _asked(power), times=TIMES[::4])["case"].kelvin
    assert np.mean(np.abs(told.kelvin - true) <= told.half_width) > 0.95
    assert told.half_width.max() < 2.0  # at twice the power, ends of a mixture of free air and fan
    assert np.abs(told.simulated - true).max() > np.abs(told.kelvin - true).max()


def test_where_it_settles_is_where_a_long_run_ends(fit: td.Calibration) -> None:
    short, long = td.predict(fit, _asked(6.0)), td.predict(fit, _asked(6.0).with_(duration="60 [h]"))
    assert short.settled["case"].celsius == pytest.approx(long.final["case"].celsius, abs=0.02)
    assert short.settled["case"].error == pytest.approx(long.final["case"].error, rel=0.05)


def test_a_record_is_predicted_with_its_band(fit: td.Calibration) -> None:
    """At one and a half times the power, with its room logged: the centre is nearer than the run with the best values."""
    record = _log(6.0, 2)
    told = predict_record(fit, record)
    band, run = told.bands["T"], td.compare(fit.model, record).sensors["T"]
    assert band.inside() > 0.9
    assert band.rmse < 0.7 * run.rmse
    assert band.half_width().mean() < 1.0
    assert {"values", "extrapolation", BandCause.RUN, "noise of a reading"} <= {*band.parts}


def test_a_room_that_is_fitted_to_a_record_takes_up_what_it_can(fit: td.Calibration) -> None:
    bare = _log(3.0, 4, swing=0.1).select("T", "METER")
    own = predict_record(fit, bare, local={"air": {"start": "T", "sd": "2 [K]"}})
    stated = predict_record(fit, bare, scenario=td.Scenario("s", boundaries={"air": "25 [degC]"}))
    assert "air" in " ".join(own.fitted_locally)
    assert own.bands["T"].inside() > 0.9
    assert own.rmse < stated.rmse


def test_no_number_depends_on_whether_logs_are_called_synthetic(fit: td.Calibration) -> None:
    own, other = (
        td.predict(fit, _asked(6.0))["case"],
        td.predict(_fit(synthetic=True), _asked(6.0))["case"],
    )
    assert other.kelvin == pytest.approx(own.kelvin, abs=1e-5)
    assert other.half_width == pytest.approx(own.half_width, rel=1e-4)


def test_what_is_stated_counts_beside_it(fit: td.Calibration) -> None:
    plain, wide = (
        td.predict(fit, _asked(6.0))["case"].final,
        td.predict(fit, _asked(6.0), spread={"air": "1 [K]"})["case"].final,
    )
    # a room 1 K warmer is a case 0.94 K warmer: its coefficient grows with the level
    assert wide.error**2 - plain.error**2 == pytest.approx(0.94**2, rel=0.05)
    assert wide.shares["stated"] > 0.5


def test_values_of_a_file_say_what_their_fit_says(fit: td.Calibration, tmp_path: Path) -> None:
    fit.save(tmp_path / "fit.values.toml")
    own = td.predict(fit, _asked(6.0))["case"]
    read = td.predict(td.design.Knowledge(fit.model, (td.load_values(tmp_path / "fit.values.toml"),)), _asked(6.0))["case"]
    assert read.kelvin == pytest.approx(own.kelvin, abs=1e-4)
    assert read.half_width == pytest.approx(own.half_width, rel=1e-4, abs=1e-6)


def test_a_fit_whose_elements_cannot_be_followed_counts_its_values_and_says_why(
    fit: td.Calibration, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(*_: Any) -> None:
        raise IdentificationError("nobody knows its elements.")

    monkeypatch.setattr("thermid.fit._error_model.kept.ways_of", refused)
    told = td.predict(_fit(), _asked(6.0), nodes=["case"])
    assert "nobody knows its elements" in told.not_counted
    assert told["case"].parts["values"][-1] > 0.0
    assert BandCause.RUN not in told["case"].parts


def test_power_of_a_deck_departs_as_that_of_a_scenario_does(fit: td.Calibration) -> None:
    """A scenario that does not give the power of 4 W is as unsure of it as a log that does not: 1.4 % from run to run."""
    silent = replace(_asked(4.0), loads={})
    wiring = Wiring(network_for(fit.model, silent), silent)
    (course,) = [course_of(wiring, Engine(wiring), None, Options())]
    assert {load: watts.value for load, (_, watts) in course.powers.items()} == {"heat": 4.0}
    given, open_ = (td.predict(fit, s)["case"].parts[BandCause.RUN][-1] for s in (_asked(4.0), silent))
    assert open_ > given  # a stated power is exact


@pytest.mark.parametrize(
    "given",
    [
        {"loads": {"heat": "8 [W]"}, "gains": {"heat": "part"}},
        {"commands": {"heat": 0.5}},
        {"commands": {"heat": 2.0}, "gains": {"heat": "supply"}},
    ],
)
def test_power_that_departs_is_what_a_load_puts_in(given: dict[str, Any]) -> None:
    asked = td.Scenario("asked", boundaries={"air": "34 [degC]"}, start="34 [degC]", duration="5 [h]", **given)
    made: dict[str, Any] = deck(base=BOX)
    model = td.model_from_dict(
        {**made, "parameters": {"part": 0.5, "supply": "2 [W]"}, "loads": {"heat": {"into": "case", "power": "8 [W]"}}}
    )
    wiring = Wiring(network_for(model, asked), asked)
    course = course_of(wiring, Engine(wiring), None, Options())
    assert course.powers["heat"][1].at(TIMES) == pytest.approx(4.0)


def test_logs_that_no_departure_explains_are_said_first() -> None:
    """The deck's power of 4 W throughout, in logs that switch it off and halve it."""
    unmetered = [_log(p, k).select("T", "ROOM") for k, p in enumerate((4.0, 2.0))]
    wrong = td.calibrate(box(), unmetered, [HTC, MASS], search="local")
    told = td.predict(wrong, _asked(6.0))
    assert told.not_counted in str(told).splitlines()[:2]  # behind the standing of the fit
    (coded,) = (x.what for x in told.left_out if code_of(x.what) == "prediction.readings-contradict")
    assert coded in told.not_counted
    assert str(told).count(coded) == 1
    assert coded in [x.what for x in predict_record(wrong, unmetered[0]).left_out]


def test_readings_that_a_model_follows_are_not_said_to_contradict_it(fit: td.Calibration) -> None:
    told = td.predict(fit, _asked(6.0))
    assert not any(code_of(x.what) for x in told.left_out)


@pytest.mark.parametrize(("misfit", "said"), [(1.9, False), (2.1, True)])
def test_readings_outside_of_what_noise_and_departures_allow_contradict(misfit: float, said: bool) -> None:
    assert bool(ErrorModel("box", misfit=misfit).contradiction) is said


def _with_core(prior: str) -> td.Calibration:
    """A fit with a core that no power goes into, so that nothing but a prior says how it is joined."""
    made: dict[str, Any] = deck(base=BOX)
    made["nodes"]["core"] = {"capacitance": "0.1 [J/K]"}
    joint = {"value": "0.5 [W/K]", "min": 0.1, "max": 2.5}
    made["conductors"] = {"joint": {"kind": "conduction", "between": ["core", "case"], "conductance": joint}}
    made["loads"]["inside"] = {"into": "core", "power": "0 [W]"}
    priors = {"joint.conductance": ("0.5 [W/K]", prior)}
    return td.calibrate(td.model_from_dict(made), _log(4.0, 0), [HTC, "joint.conductance"], priors=priors, search="local")


def _into_core(watts: float) -> td.Scenario:
    return _asked(6.0).with_(loads={"heat": "2 [W]", "inside": f"{watts} [W]"})


def test_a_value_that_no_reading_determines_is_named_and_its_band_is_what_the_network_can_reach() -> None:
    told = td.predict(_with_core("150 [%]"), _into_core(1.0))
    assert any("'joint.conductance'" in w and "'core'" in w for w in told.warnings)
    assert not any("'case'" in w and "no reading determines" in w for w in told.warnings)
    core, case = told["core"].final, told["case"].final
    # 1 W through 0.1 to 2.5 W/K
    assert case.low < core.low
    assert core.high < case.high + 10.0


def test_a_value_that_is_stated_better_than_joints_depart_is_predicted() -> None:
    """No reading is needed of what was measured elsewhere; the band holds what the prior does."""
    band = td.predict(_with_core("10 [%]"), _into_core(1.0))["core"].final
    case = td.predict(_with_core("10 [%]"), _into_core(1.0))["case"].final
    assert band.low < case.celsius + 1.0 / (0.5 * 1.2) < case.celsius + 1.0 / (0.5 / 1.2) < band.high


def test_a_fitted_value_that_the_scenario_schedules_is_not_among_those_that_vary(fit: td.Calibration) -> None:
    """It was refused as one that cannot be fitted, though a prediction fits nothing; its error is not counted, and that is said."""
    value = fit.values[HTC]
    same = {HTC: f"{value.value!r} [W/(m^2 K)]"}
    free, driven = (td.predict(fit, _asked(3.0).with_(schedule=s), times=TIMES[::8]) for s in ({}, same))
    assert driven["case"].simulated == pytest.approx(free["case"].simulated, abs=1e-3)
    assert driven["case"].error[-1] < free["case"].error[-1]
    assert any(HTC in w and "schedule" in w for w in driven.warnings)
    assert (
        td.predict(fit, _asked(3.0).with_(schedule={HTC: "20 [W/(m^2 K)]"}), times=TIMES[::8])["case"].celsius[-1]
        < free["case"].celsius[-1]
    )


@pytest.mark.parametrize("draws", [0, 100])
def test_without_power_all_settles_at_its_room_whatever_is_unsure(fit: td.Calibration, draws: int) -> None:
    """Departures are heat that flows: where none does at rest, the end of a run that has not settled says nothing of it."""
    passive = _asked(0.0).with_(start="-10 [degC]", duration="1 [h]")
    told = td.predict(fit, passive, draws=draws)
    assert told.final["case"].error > 0.1
    rest = told.settled["case"]
    of_elements = rest.error**2 * (1.0 - rest.shares[BandCause.UNEXPLAINED])  # which stands at the sensor, heat or not
    assert (rest.celsius, of_elements) == (pytest.approx(34.0, abs=3e-3), pytest.approx(0.0, abs=1e-9))


def test_a_test_more_tells_as_much_as_the_tests_before(fit: td.Calibration) -> None:
    """Elements differ from test to test, so that three tests are hardly more than sqrt(3/2) times better than two."""
    for target in (MASS, td.design.Aim(_asked(3.0), "case")):
        advice = td.design.next_test(fit, target, scenario=fit.experiments[0].scenario)
        (again,) = [o for o in advice.options if o.name == AGAIN]
        assert 1.0 < advice.now / again.error < 1.6
    told = td.design.next_test(fit, HTC, scenario=fit.experiments[0].scenario)
    assert told.now / told.value == pytest.approx(fit[HTC].relative, rel=0.01)
