"""What may be freed, in which form it is fitted, and its bounds and priors."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from by_code import raises_code
from thermid.base.errors import DeckError, IdentificationError, NameNotFoundError, ThermidError, UnitError
from thermid.base.units import unit
from thermid.fit._calibrate import calibrate, fit
from thermid.fit._calibration import contradicted
from thermid.fit._problem.gather import build_problem
from thermid.fit._problem.request import LocalSpec, Reading, Request
from thermid.fit._problem.residuals import Prior, Unknown
from thermid.measure.records import Record
from thermid.model.tree import Parameter, model_from_dict
from thermid.prediction.bands import predict
from thermid.simulation.runs import Scenario
from thermid.values.store import FittedValue, FittedValues, Normal, Source, State, Store, ValueOrigin
from unit.fit.bench import AREA, HTC, MASS, PAIR, box, log, metered, pair

pytestmark = pytest.mark.usefixtures("errors_in_turn")


def unknown(value: Any, text: str) -> Unknown:
    given = Parameter.read(value)
    value = given.expression.literal.value
    return Unknown("x", "parameter", (), value, *given.form("x", unit(text).dimension, value), unit=given.unit or "1")


@pytest.fixture(scope="module")
def record() -> Record:
    return log(box(), {HTC: "5 [W/(m^2 K)]"}, {"T": "case"}, samples=61)


class TestForm:
    @pytest.mark.parametrize(
        "text", ["2 [W]", "2 [kg]", "2 [mm]", "2 [K/W]", "2 [ohm]", "2 [W/K^4]", "2 [W/(m^2 K^1.2)]", "2 [kg/m^3]", "2 [l/min]", "2 [s]"]
    )
    def test_what_is_above_zero_keeps_its_sign(self, text: str) -> None:
        u = unknown(text, Parameter.read(text).unit)
        assert u.log
        assert u.to_fitted(u.start) == math.log(u.start)
        assert u.fitted_bounds() == (-math.inf, math.inf)

    @pytest.mark.parametrize(
        "value",
        [
            {"value": "2 [W]", "min": 0},  # a logarithm could not reach its bound
            {"value": "2 [W]", "min": -3},  # the deck says that it may be negative
            {"value": "20 [degC]"},
            {"value": "0.004 [1/K]"},
            {"value": "-0.3"},
            {"value": "0.3"},
            {"value": "0 [K]"},
        ],
    )
    def test_what_may_be_zero_or_negative_is_fitted_as_it_is(self, value: dict[str, Any]) -> None:
        u = unknown(value, Parameter.read(value).unit or "1")
        assert not u.log
        assert u.to_fitted(u.start) == u.start

    def test_bounds_are_in_the_fitted_form(self) -> None:
        u = unknown({"value": "2 [W]", "min": 1, "max": 8}, "W")
        assert u.fitted_bounds() == (0.0, math.log(8.0))
        assert unknown({"value": "0.3", "min": -1, "max": 1}, "1").fitted_bounds() == (-1.0, 1.0)
        assert unknown({"value": "2 [W]", "min": -3, "max": 8}, "W").fitted_bounds() == (-3.0, 8.0)

    def test_form_and_slope_agree(self) -> None:
        u = unknown({"value": "2 [W]", "min": 1, "max": 8}, "W")
        at, step = math.log(3.0), 1e-6
        assert u.to_value(at) == pytest.approx(3.0, rel=1e-15)
        assert u.slope(at) == pytest.approx((u.to_value(at + step) - u.to_value(at - step)) / (2 * step), rel=1e-9)

    def test_typical_change(self) -> None:
        assert unknown("2 [W]", "W").scale == 1.0
        assert unknown({"value": "0.3", "min": 0.1, "max": 0.9}, "1").scale == 1.0  # by its logarithm, for its minimum is above zero
        assert unknown({"value": "0.3", "min": -0.1, "max": 0.7}, "1").scale == pytest.approx(0.2)
        assert Unknown("x", "local", (), 300.0, prior=Prior(300.0, 2.0)).scale == 2.0

    def test_a_start_outside_its_bounds_is_refused(self) -> None:
        with raises_code("value.outside-range", DeckError, match="9.*'x'.*1.*8"):
            unknown({"value": "9 [W]", "min": 1, "max": 8}, "W")
        with raises_code("value.outside-range", DeckError, match="12.*8"):
            calibrate(box({"parameters/power/value": "12 [W]"}), log(box(), {}, {"T": "case"}, samples=11), ["power"])


class TestNames:
    def test_an_unknown_name(self, record: Record) -> None:
        with raises_code("name.unknown", NameNotFoundError, match=r"'case\.mas'.*'case\.mass'"):
            calibrate(box(), record, ["case.mas"])

    def test_a_derived_value_names_what_to_free_instead(self, record: Record) -> None:
        with raises_code("model.refused", DeckError, match=r"'heat\.power'"):
            calibrate(box({"loads/heat/power": "2*power"}), record, ["heat.power"])

    def test_a_bare_name_is_followed_to_its_value(self, record: Record) -> None:
        found = calibrate(box(), record, ["heat.power"])
        assert list(found.values.parameters) == ["power"]

    def test_a_name_given_twice_is_one_unknown(self, record: Record) -> None:
        assert list(calibrate(box(), record, [HTC, HTC]).values.parameters) == [HTC]


class TestPriors:
    def test_a_prior_is_met_in_the_fitted_form(self, record: Record) -> None:
        problem = build_problem(Request(box(), (record,), (HTC,), priors={HTC: ("5 [W/(m^2 K)]", "0.5 [W/(m^2 K)]")}))
        assert problem.unknowns[0].prior == Prior(math.log(5.0), 0.1)

    def test_without_a_mean_the_start_stands_and_per_cent_are_relative(self, record: Record) -> None:
        problem = build_problem(Request(box(), (record,), (HTC, MASS), priors={HTC: ("", "5 [%]"), MASS: ("2 [kg]", "10 [%]")}))
        assert problem.unknowns[0].prior == Prior(math.log(6.0), pytest.approx(0.05))
        assert problem.unknowns[1].prior == Prior(math.log(2.0), pytest.approx(0.1))

    def test_a_prior_draws_the_value_by_its_weight(self) -> None:
        # linear in the power when its minimum is zero: the mean of prior and data, each with its weight
        model = box({"parameters/power/min": 0})
        data = log(model, {"power": "3 [W]"}, {"T": "case"}, noise=0.5)
        data = data.with_channels(replace(data["T"], noise=0.6))  # less scatter than stated, so that nothing is widened
        start = {"initial.case": {"start": "24 [degC]", "sd": "0.001 [K]"}}
        free = calibrate(model, data, ["power"], local=start)
        sd = free["power"].error
        both = calibrate(model, data, ["power"], local=start, priors={"power": ("3.1 [W]", f"{sd!r} [W]")})
        assert both["power"].value == pytest.approx((free["power"].value + 3.1) / 2, rel=1e-6)
        assert both["power"].error == pytest.approx(sd / math.sqrt(2), rel=1e-5)

    @pytest.mark.parametrize(
        ("priors", "error", "code", "match"),
        [
            ({AREA: ("0.05 [m^2]", "0.01 [m^2]")}, IdentificationError, "fit.nothing-free", r"'skin\.area'"),
            ({"case.mas": ("1 [kg]", "1 [kg]")}, NameNotFoundError, "name.unknown", r"'case\.mass'"),
            ({MASS: ("1 [m]", "0.1 [m]")}, UnitError, "unit.wrong-dimension", r"priors\.case\.mass: '\[m\]'"),
            ({MASS: ("1 [kg]", "0.1 [W]")}, UnitError, "unit.wrong-dimension", ""),
            ({MASS: ("1 [kg]", "0 [kg]")}, IdentificationError, "value.outside-range", ""),
            ({MASS: ("-1 [kg]", "1 [kg]")}, IdentificationError, "value.outside-range", ""),
            ({MASS: ("1 [kg]", "nan [kg]")}, ThermidError, "expression.unit-misplaced", ""),
        ],
    )
    def test_refusals(self, record: Record, priors: dict[str, tuple[str, str]], error: type[Exception], code: str, match: str) -> None:
        with raises_code(code, error, match=match):
            calibrate(box(), record, [MASS], priors=priors)


class TestTies:
    def test_instances_of_one_definition_share_a_value(self) -> None:
        stack = pair()
        data = log(stack, {"a.case.mass": "1.2 [kg]", "b.case.mass": "1.2 [kg]"}, {"A": "a.case"}, boundary="room")
        found = calibrate(stack, data, ["a.case.mass"])
        assert found["a.case.mass"].value == pytest.approx(1.2, abs=4 * found["a.case.mass"].error)
        fitted = found.model
        assert fitted.at("a.case.mass").text == fitted.at("b.case.mass").text

    def test_untie(self) -> None:
        stack = pair()
        data = log(stack, {"a.case.mass": "1.2 [kg]", "b.case.mass": "1.8 [kg]"}, {"A": "a.case", "B": "b.case"}, boundary="room")
        free = ("a.case.mass", "b.case.mass")
        tied = build_problem(Request(stack, (data,), free))
        assert [u.name for u in tied.unknowns if u.kind == "parameter"] == ["a.case.mass"]
        found = fit(Request(stack, (data,), free, untie=True))
        for path, truth in zip(free, (1.2, 1.8), strict=True):
            assert found[path].value == pytest.approx(truth, abs=4 * found[path].error)

    def test_one_instance_is_cut(self) -> None:
        stack = pair().cut("b")
        data = log(stack, {"a.case.mass": "1.2 [kg]"}, {"A": "a.case", "B": "b.case"}, boundary="room", samples=61)
        found = calibrate(stack, data, ["a.case.mass", "a.skin.effective_htc"])
        assert found["a.case.mass"].also == ()
        assert found["a.case.mass"].value == pytest.approx(1.2, abs=4 * found["a.case.mass"].error)
        both = calibrate(pair(), data, ["a.case.mass"])
        assert both["a.case.mass"].also == ("b.case.mass",)
        assert any("a.case.mass" in line and "b.case.mass" in line for line in str(both).splitlines())
        assert not any("a.case.mass" in line and "b.case.mass" in line for line in str(found).splitlines())

    def test_an_instance_with_a_value_of_its_own_is_left_alone(self) -> None:
        stack = model_from_dict({**_pair_deck(), "set": {"b.case.mass": "2 [kg]"}})
        data = log(stack, {"a.case.mass": "1.2 [kg]"}, {"A": "a.case"}, boundary="room", samples=61)
        problem = build_problem(Request(stack, (data,), ("a.case.mass",)))
        assert [t.name for t in problem.unknowns[0].targets] == ["a.case.mass"]

    def test_parts_of_two_definitions_are_apart(self) -> None:
        stack = pair(second=box({"parameters/power/value": "1 [W]"}))
        data = log(stack, {}, {"A": "a.case"}, boundary="room", samples=11)
        problem = build_problem(Request(stack, (data,), ("a.case.mass",)))
        assert [t.name for t in problem.unknowns[0].targets] == ["a.case.mass"]


def _pair_deck() -> dict[str, Any]:
    parts = {"a": {"use": box(), "bind": {"air": "room"}}, "b": {"use": box(), "bind": {"air": "room"}}}
    return {**PAIR, "submodels": parts}


class TestLocal:
    def test_one_per_record(self) -> None:
        model = box()
        data = [log(model, {}, {"T": "case"}, name=n, seed=k, swing=0.0).select("T") for k, n in enumerate("ab")]
        local = {"air": {"start": "23 [degC]", "sd": "2 [K]"}}
        found = calibrate(model, data, [HTC], local=local)
        rooms = {i.record: i for i in found.local if i.name == "air"}
        assert set(rooms) == {"a", "b"}
        for i in rooms.values():
            assert i.value == pytest.approx(297.15, abs=4 * i.error)

    @pytest.mark.parametrize(("sd", "state"), [("2 [K]", "credible"), ("1.1 [K]", "credible"), ("0.5 [K]", "not adequate")])
    def test_a_room_far_from_its_prior_has_a_consequence(self, sd: str, state: str) -> None:
        """The room is at 24 C, said is 20 C: from five deviations on the fit is not adequate, and so is what rests on it."""
        model = box()
        data = log(model, {}, {"T": "case"}, swing=0.0).select("T")
        found = calibrate(model, data, [HTC], local={"air": {"start": "20 [degC]", "sd": sd}})
        assert found.standing.state == state
        assert any("bench: air" in w for w in found.warnings) == (sd != "2 [K]")
        if state != "credible":
            assert "'bench: air'" in found.standing.because
            assert "5)" in found.standing.because
            told = predict(found, Scenario("next", boundaries={"air": "20 [degC]"}, start="20 [degC]", duration=3600.0))
            assert told.standing.exit_code == 5

    @pytest.mark.parametrize(("sd", "state"), [("0.5", "credible"), ("0.2", "not adequate"), ("0.1", "not credible")])
    def test_a_value_far_from_its_prior_has_the_same_consequence(self, record: Record, sd: str, state: str) -> None:
        """A value of all records counted from ten deviations on, where nobody believes a fit; one of a single record from five."""
        found = calibrate(box(), record, [HTC], priors={HTC: ("6 [W/(m^2 K)]", f"{sd} [W/(m^2 K)]")})
        assert found.standing.state == state
        assert (f"'{HTC}'" in found.standing.because and " 5.5" in found.standing.because) == (state == "not adequate")

    def test_a_channel_may_give_the_start(self, record: Record) -> None:
        problem = build_problem(Request(box(), (record,), (HTC,), local={"initial.case": LocalSpec("T", 1.0)}))
        first = float(record["T"].values[0])
        (start,) = (u for u in problem.unknowns if u.kind == "local")
        assert (start.start, start.prior) == (first, Prior(first, 1.0))

    def test_a_start_read_from_a_thermometer_has_the_error_of_that(self) -> None:
        """Thermometers are known relative to the one of the room; its own error was forgotten, and all were off by it."""
        truth = {HTC: "5 [W/(m^2 K)]"}
        run = log(box(), truth, {"T": "case"}, samples=301, bias={"T": 0.7}, accuracy=0.8, swing=0.0)
        room = run["ROOM"]
        off = replace(room, values=room.values - 0.45, target=room.target, accuracy=0.4)
        known = {"initial.case": LocalSpec("ROOM", 0.05)}
        found = fit(Request(box(), (run.with_channels(off),), (HTC, "case.mass"), local=known))
        errors = found.store.states
        apart = errors["sensor T"].value - errors["ROOM error"].value
        assert abs(apart - (0.7 + 0.45)) < 0.1
        spread = float(np.sqrt(found.store.covariance(["ROOM error"])[0, 0]))
        assert abs(errors["ROOM error"].value + 0.45) < 2 * spread
        assert 0.3 < spread <= 0.4
        (start,) = (v for v in found.local if v.name == "initial.case")
        assert abs(start.value - 297.15) < 2 * start.error
        assert 0.3 < start.error < 0.45

    def test_the_records_own_value_wins(self, record: Record) -> None:
        stage, own = {"initial.case": LocalSpec("20 [degC]")}, {"bench": {"initial.case": LocalSpec("25 [degC]")}}
        problem = build_problem(Request(box(), (record,), (HTC,), local=stage, record_local=own))
        assert [u.start for u in problem.unknowns if u.kind == "local"] == [298.15]

    @pytest.mark.parametrize(
        ("local", "error", "code", "match"),
        [
            ({"aire": "24 [degC]"}, NameNotFoundError, "name.unknown", "'aire'.*'air'"),
            ({"initial.cas": "24 [degC]"}, NameNotFoundError, "name.unknown", "'cas'.*'case'"),
            (
                {"air": {"start": "24 [degC]", "spread": "1 [K]"}},
                IdentificationError,
                "name.unknown",
                r"local\.air",
            ),
            ({"air": {"sd": "1 [K]"}}, IdentificationError, "value.incomplete", r"local\.air"),
            (
                {"air": {"start": "24 [degC]", "sd": "0 [K]"}},
                IdentificationError,
                "value.outside-range",
                r"0 \[K\]",
            ),
            ({"air": {"start": "24 [degC]", "sd": "-1 [K]"}}, IdentificationError, "value.outside-range", ""),
            ({"air": {"start": "24 [degC]", "sd": "1 [W]"}}, UnitError, "unit.wrong-dimension", r"local\.air"),
            (
                {"air": {"start": "TT"}},
                IdentificationError,
                "value.wrong-kind",
                r"local\.air: 'TT'.*'T'",
            ),
        ],
    )
    def test_refusals(self, record: Record, local: dict[str, Any], error: type[Exception], code: str, match: str) -> None:
        with raises_code(code, error, match=match):
            calibrate(box(), record.select("T"), [HTC], local=local)


class TestReadings:
    """A temperature that stands on a channel's first reading, less the sensor's constant error, with an offset added."""

    def test_offset_parameter(self) -> None:
        model = box({"parameters/lift": {"value": "0 [K]", "min": -5, "max": 5}})
        data = log(model, {}, {"T": "case"}, noise=None, start="26 [degC]", swing=0.0).select("T")
        request = Request(
            model, (data,), ("lift",), readings={"air": Reading("T", "lift"), "initial.case": Reading("T")}, window=0.0, name="r"
        )
        found = fit(request)
        assert found["lift"].value == pytest.approx(-2.0, abs=0.01)

    def test_bias_is_taken_off(self) -> None:
        # with the bias known to 1 mK from a stage below the start is what it was, and not what the sensor said
        model = box()
        data = log(model, {}, {"T": "case"}, noise=1e-3, bias={"T": 1.0}, accuracy=0.5, swing=0.0)
        state = State("sensor T", 1.0, False, "K", (-5.0, 5.0), ValueOrigin("fit", "below"), "sensor")
        below = Store({"sensor T": state}, (Source("below:0", "data", Normal()),), np.array([[1e-3]]))
        request = Request(model, (data,), (MASS,), readings={"initial.case": Reading("T")}, store=below)
        found = fit(request)
        assert found[MASS].value == pytest.approx(1.5, rel=2e-3)
        assert found.sensors["T"].bias == pytest.approx(1.0, abs=3e-3)

    def test_an_offset_is_added_to_a_reading_less_its_held_bias(self) -> None:
        model = box({"parameters/lift": {"value": "0 [K]", "min": -5, "max": 5}})
        data = log(model, {}, {"T": "case"}, noise=None, start="26 [degC]", bias={"T": 1.0}, swing=0.0).select("T")
        readings = {"air": Reading("T", "lift"), "initial.case": Reading("T")}
        found = fit(Request(model, (data,), ("lift",), readings=readings, held_bias={"T": 1.0}))
        assert found["lift"].value == pytest.approx(-2.0, abs=0.01)

    def test_held_bias_is_taken_off(self) -> None:
        model = box()
        data = log(model, {}, {"T": "case"}, noise=1e-3, bias={"T": 1.0}, swing=0.0)
        held = fit(Request(model, (data,), (MASS,), readings={"initial.case": Reading("T")}, held_bias={"T": 1.0}))
        assert held[MASS].value == pytest.approx(1.5, rel=2e-3)

    def test_an_unknown_offset_or_one_of_another_dimension(self, record: Record) -> None:
        with raises_code("name.unknown", NameNotFoundError, match="'lift'"):
            build_problem(Request(box(), (record,), (HTC,), readings={"initial.case": Reading("T", "lift")}))
        with raises_code("unit.wrong-dimension", UnitError):
            build_problem(Request(box(), (record,), (HTC,), readings={"initial.case": Reading("T", "power")}))


class TestWeights:
    def test_a_weight_divides_the_noise(self) -> None:
        stack = pair()
        data = log(stack, {}, {"A": "a.case", "B": "b.case"}, boundary="room", samples=11)
        plain = build_problem(Request(stack, (data,), ("stack.contact_conductance",)))
        half = build_problem(Request(stack, (data,), ("stack.contact_conductance",), weights={"B": 0.5}))
        at = np.array([u.to_fitted(u.start) for u in plain.unknowns])
        np.testing.assert_allclose(half.residuals(at), plain.residuals(at) * np.repeat([1.0, 0.5], 11), rtol=1e-12)

    @pytest.mark.parametrize(
        ("weights", "code", "match"),
        [
            ({"TT": 1.0}, "name.unknown", "'TT'.*'T'"),
            ({"T": 0.0}, "value.outside-range", "'T'"),
            ({"T": math.nan}, "value.outside-range", "'T'"),
        ],
    )
    def test_refusals(self, record: Record, weights: dict[str, float], code: str, match: str) -> None:
        with raises_code(code, IdentificationError, match=match):
            build_problem(Request(box(), (record,), (HTC,), weights=weights))


def test_a_meters_error_scales_the_load() -> None:
    # 2 % too much on the meter, known to 1e-5: the coefficient comes out right
    model = box()
    data = metered(log(model, {HTC: "5 [W/(m^2 K)]"}, {"T": "case"}, noise=1e-3), "heat", 4.0 * 1.02, accuracy=1.0)
    found = calibrate(model, data, [MASS, HTC], priors={MASS: ("1.5 [kg]", "0.00001 [kg]")})
    assert found["METER error"].value == pytest.approx(1.0 - 1.0 / 1.02, abs=1e-3)
    assert found[HTC].value == pytest.approx(5.0, rel=1e-3)


@pytest.mark.parametrize(("name", "off"), [("sensor T", 0.4), ("ROOM error", 0.4), ("METER error", 0.02)])
def test_every_error_of_an_instrument_is_reading_minus_truth(name: str, off: float) -> None:
    """A compared sensor, a logged boundary and a power that read high have an error above zero."""
    truth = log(box(), {HTC: "5 [W/(m^2 K)]"}, {"T": "case"}, samples=61, noise=1e-3)
    is_meter, wrong = name == "METER error", {"sensor T": "T", "ROOM error": "ROOM"}.get(name, "")
    record = metered(truth, "heat", 4.0 / (1.0 - off if is_meter else 1.0), **({"accuracy": 0.4} if is_meter else {}))
    if wrong:
        record = record.with_channels(replace(record[wrong], values=record[wrong].values + off, accuracy=1.0))
    fitted = calibrate(box().with_values({HTC: "5 [W/(m^2 K)]"}), record, [MASS])
    assert fitted[name].value == pytest.approx(off, rel=0.05)
    assert re.search(rf"\b{name.removeprefix('sensor ').removesuffix(' error')} .* \+\d", contradicted_words(fitted[name]))


def contradicted_words(value: FittedValue) -> str:
    """Return what is said of an instrument whose accuracy is far below its error."""
    sure = replace(value, prior=(0.0, abs(value.value) / 100.0))
    return contradicted(FittedValues("s", {value.path: sure}, np.eye(1)))[value.path]
