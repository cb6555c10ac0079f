"""Margins: what is added up, beside the fixed margin of a standard."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.base.errors import NameNotFoundError, ScenarioError
from thermid.campaign._judge.limits import POLICIES, Limits, fixed_margin, heater_duty, margins
from thermid.prediction.bands import Knowledge, foresee
from unit.qualify.things import soak, unit

PROC = Limits("processor", "proc", td.quantity((253.15, 343.15), unit="K"), loads=("cpu",))


@pytest.fixture(scope="module")
def fit() -> td.Calibration:
    """One conductance of the unit fitted to a log made with another one."""
    rng = np.random.default_rng(4)
    times = np.arange(0.0, 6 * 3600.0, 120.0)
    run = td.simulate(unit().with_values({"out.conductance": "1.1 [W/K]"}), soak(25.0), times=times)
    made = {
        n: td.Channel.from_array(
            n, run[n].kelvin + 0.1 * rng.standard_normal(times.size), unit="K", role="node", target=n, noise=0.1, accuracy=0.3
        )
        for n in ("proc", "ele", "plate")
    }
    return td.calibrate(unit(), td.Record.from_arrays("log", times, made), ["out.conductance"], scenario=soak(25.0))


def test_the_sum_is_that_of_its_parts_and_the_error_is_the_prediction_s(fit: td.Calibration) -> None:
    seen = foresee(Knowledge.of_source(fit), soak(55.0))
    told = td.predict(fit, soak(55.0))
    hot = margins({"hot soak": seen}, [PROC], tested=True)[1]
    assert (hot.side, hot.run, hot.state) == ("hot", "hot soak", "operating")
    assert hot.predicted == pytest.approx(told["proc"].kelvin[-1], abs=1e-6)
    # of a mixture of ways the band holds 95 %, which 1.96 standard deviations do not where a way in a hundred is ten times as wide
    assert hot.predicted + hot.uncertainty == pytest.approx(told["proc"].interval()[1][-1] + 273.15, abs=1e-6)
    assert hot.uncertainty == pytest.approx(1.959964 * hot.error)
    assert hot.margin == pytest.approx(343.15 - hot.predicted - hot.uncertainty - 10.0)
    assert hot.left_with_fixed == pytest.approx(343.15 - hot.predicted - 11.0 - 10.0)
    assert sum(hot.shares.values()) == pytest.approx(1.0)  # of the variance of the prediction, whatever its interval
    assert hot.passed == (hot.margin >= 0)


def test_values_whose_records_are_gone_still_carry_their_covariance(fit: td.Calibration) -> None:
    whole = foresee(Knowledge.of_source(fit), soak(55.0))
    bare = foresee(Knowledge(fit.model, (fit.values,)), soak(55.0))
    own = whole.prediction["proc"].parts["values"][-1]
    assert bare.prediction["proc"].parts["values"][-1] == pytest.approx(own, rel=1e-6)


def test_a_stated_spread_adds_to_the_variance() -> None:
    seen = foresee(Knowledge(unit()), soak(55.0), spread={"air": "2 [K]", "scale.cpu": "5 [%]"})
    one, other = (foresee(Knowledge(unit()), soak(55.0), spread={n: s}) for n, s in (("air", "2 [K]"), ("scale.cpu", "5 [%]")))
    assert seen.prediction["proc"].error[-1] ** 2 == pytest.approx(sum(f.prediction["proc"].error[-1] ** 2 for f in (one, other)))
    assert one.prediction["proc"].error[-1] == pytest.approx(2.0, rel=0.01)


def test_the_worst_run_of_several_is_taken() -> None:
    runs = {f"at {c} degC": foresee(Knowledge(unit()), soak(c)) for c in (-30.0, 20.0, 60.0)}
    cold, hot = margins(runs, [PROC])
    assert (cold.run, hot.run) == ("at -30.0 degC", "at 60.0 degC")
    assert cold.sign == -1.0
    assert cold.room == pytest.approx(cold.predicted - 253.15)


def test_a_margin_from_memory_decides_nothing() -> None:
    hot = margins({"hot": foresee(Knowledge(unit()), soak(55.0))}, [PROC], "ECSS")[1]
    assert hot.passed is None
    assert hot.mark == "memory"
    assert "not decided" in str(hot)


@pytest.mark.parametrize(
    ("celsius", "tested", "expected"),
    [(20.0, True, 11), (20.0, False, 17), (-70.0, True, 11), (-71.0, True, 10), (-100.0, True, 9), (-230.0, True, 2), (-240.0, True, 1)],
)
def test_the_fixed_margin_of_colder_hardware(celsius: float, tested: bool, expected: float) -> None:
    """SMC-S-016, Table 4.4-2."""
    assert fixed_margin(celsius + 273.15, tested).value == expected


def test_every_number_of_a_policy_has_a_mark() -> None:
    for policy in POLICIES.values():
        for figure in (policy.acceptance, policy.qualification, policy.heater):
            assert figure.source
    assert POLICIES["ECSS"].qualification.mark == "memory"
    assert not POLICIES["ECSS"].qualification.decides


def test_the_duty_of_a_heater_and_its_power_margin() -> None:
    """A thermostat that holds a box 50 K above its room of 1 W/K: 50 of 100 W, a margin of 100 %; 50 of 60 W leaves 20 %, too little."""
    for full, passed in ((100.0, True), (60.0, False)):
        heater = {"into": "box", "power": f"{full} [W]", "thermostat": {"on_below": "19.5 [degC]", "off_above": "20.5 [degC]"}}
        box = td.model_from_dict(
            {
                "title": "box",
                "needs": ["air"],
                "nodes": {"box": {"capacitance": "500 [J/K]"}},
                "conductors": {"g": {"kind": "conduction", "between": ["box", "air"], "conductance": "1 [W/K]"}},
                "loads": {"heater": heater},
            }
        )
        cold = td.Scenario("cold", boundaries={"air": "-30 [degC]"}, start="20 [degC]", duration="3 [h]")
        seen = foresee(Knowledge(box), cold, times=np.arange(0.0, 10800.1, 1.0))
        duty = heater_duty(seen, "heater", full)
        assert duty.duty == pytest.approx(50.0 / full, abs=0.02)
        assert duty.max_duty == 0.8
        assert duty.passed is passed
        assert duty.rule.mark == "read"
        with raises_code("name.unknown", NameNotFoundError, match="'heater'"):
            heater_duty(seen, "heatr", full)
        with raises_code("value.outside-range", ScenarioError, match="'heater'"):
            heater_duty(seen, "heater", 0.0)
        with raises_code("record.too-short", ScenarioError):
            heater_duty(seen, "heater", full, window=(9e9, 9.1e9))


def test_what_cannot_be_asked() -> None:
    with raises_code("name.unknown", NameNotFoundError, match="'ECSS'"):
        margins({"hot": foresee(Knowledge(unit()), soak())}, [PROC], "ECS")
    with raises_code("value.outside-range", ScenarioError):
        margins({}, [PROC])


def test_the_printed_terms_add_up_to_the_printed_margin(fit: td.Calibration) -> None:
    """Each rounded by itself, they would miss it by up to two tenths; the margin itself stays as it is."""
    rng, apart = np.random.default_rng(8), 0
    seen = margins({"hot soak": foresee(Knowledge.of_source(fit), soak(55.0))}, [PROC], tested=True)[1]
    for predicted, error, limit in zip(rng.uniform(250, 350, 400), rng.uniform(0, 3, 400), rng.integers(-400, 1000, 400), strict=True):
        m = replace(seen, predicted=float(predicted), error=float(error), limit=float(limit) / 10 + 273.15)
        terms = (m.policy.acceptance.value, m.policy.qualification.value)
        room = m.sign * (float(limit) / 10 - round(m.predicted - 273.15, 1))
        assert room - m.printed - sum(terms) == pytest.approx(round(m.margin, 1), abs=1e-9)
        assert m.printed == pytest.approx(m.uncertainty, abs=0.101)
        apart += abs(room - round(m.uncertainty, 1) - sum(terms) - round(m.margin, 1)) > 0.05
    assert apart > 50
