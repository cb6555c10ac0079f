"""Verdicts: limits met or not, on data that no fit has seen, with nothing fitted to them unless it is said."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from by_code import raises_code
from thermid.base.errors import IdentificationError, ScenarioError, UnitError
from thermid.campaign._judge.verdict import Criteria, compare, validate
from thermid.fit.calibration import Calibration, Request, build_problem, calibrate
from thermid.measure.records import Record
from thermid.model.tree import Standing
from unit.fit.bench import HTC, MASS, box, log, metered

pytestmark = pytest.mark.usefixtures("errors_in_turn")


def run(name: str, seed: int, **more: object) -> Record:
    bias = {"T": 0.6}
    data = log(box(), {HTC: "5 [W/(m^2 K)]"}, {"T": "case"}, name=name, seed=seed, accuracy=0.5, bias=bias, noise=0.02, **more)  # type: ignore[arg-type]
    return data.with_channels(replace(data["ROOM"], accuracy=0.3))


@pytest.fixture(scope="module")
def found(errors_in_turn: str) -> Calibration:
    return calibrate(
        box(), [run("a", 1), run("b", 2, loads={"heat": 4.0}, start="45 [degC]")], [HTC, MASS], priors={MASS: ("1.5 [kg]", "1 [%]")}
    )


WIDE = Criteria(rmse="1 [K]")


def test_it_passes_and_fails_by_its_limits(found: Calibration) -> None:
    held = run("held", 3)
    good = validate(found, held, Criteria(rmse="0.5 [K]", max_error="2 [K]", mean_error="0.5 [K]"))
    assert good.passed
    assert [c.criterion for c in good.checks] == ["rmse", "max_error", "mean_error"]
    for check in good.checks:
        own = Criteria(**{check.criterion: f"{check.found * 0.999!r} [K]"})
        assert not validate(found, held, own).passed
        own = Criteria(**{check.criterion: f"{check.found!r} [K]"})
        assert validate(found, held, own).passed, "a limit that is just met is met"


def test_found_is_what_the_residuals_are(found: Calibration) -> None:
    verdict = validate(found, run("held", 3), Criteria(rmse="1 [K]", max_error="2 [K]", mean_error="1 [K]"))
    (block,) = verdict.prediction.blocks
    left = block.measured - block.predicted
    expected = {"rmse": np.sqrt(np.mean(left**2)), "max_error": np.abs(left).max(), "mean_error": abs(left.mean())}
    assert {c.criterion: c.found for c in verdict.checks} == pytest.approx(expected, rel=1e-12)


def test_nothing_is_fitted_to_the_record_that_is_judged(found: Calibration) -> None:
    # a room sensor that has gone wrong since, and a meter that was not there: neither is explained away
    held = run("held", 3)
    wrong = held.with_channels(replace(held["ROOM"], values=held["ROOM"].values + 1.0))
    verdict = validate(found, metered(wrong, "heat", 4.0, accuracy=0.4), WIDE)
    assert dict(verdict.prediction.values) == {}
    assert verdict.prediction.fitted == {}
    assert verdict.statistics["T"].mean == pytest.approx(-1.0, abs=0.4)
    assert not verdict.conditional


def test_constant_errors_that_the_fit_found_are_held(found: Calibration) -> None:
    verdict = validate(found, run("held", 3), WIDE)
    assert verdict.statistics["T"].bias == found.bias["T"]
    room = verdict.prediction.experiments[0].scenario.boundaries["air"].values
    np.testing.assert_allclose(room, run("held", 3)["ROOM"].values - found["ROOM error"].value, rtol=1e-15)


def test_an_instrument_of_another_accuracy_is_another_instrument(found: Calibration) -> None:
    held = run("held", 3)
    narrow = held.with_channels(replace(held["T"], accuracy=0.01))
    same, other = validate(found, held, WIDE), validate(found, narrow, WIDE)
    assert found.bias["T"] > 0.4
    assert abs(same.statistics["T"].mean) < 0.1
    assert other.statistics["T"].mean > 0.2  # beside a room and a first reading that keep their errors


def test_the_start_is_the_first_reading_less_the_held_error() -> None:
    # a sensor 3 K off: a start that forgot it would be 3 K out at once
    data = log(box(), {}, {"T": "case"}, accuracy=3.0, bias={"T": 3.0}, noise=0.01, swing=0.0)
    priors = {HTC: ("6 [W/(m^2 K)]", "0.001 [W/(m^2 K)]"), MASS: ("1.5 [kg]", "0.1 [%]")}
    fitted = calibrate(box(), data, [HTC, MASS], priors=priors)
    assert fitted.bias["T"] == pytest.approx(3.0, abs=0.05)
    held = log(box(), {}, {"T": "case"}, name="held", accuracy=3.0, bias={"T": 3.0}, noise=0.01, swing=0.0, seed=5)
    assert abs(validate(fitted, held, WIDE).statistics["T"].largest) < 0.15


def test_a_used_record_is_refused_however_it_was_cut(found: Calibration) -> None:
    used = run("a", 1)
    for cut in (used, replace(used, name="other"), used.trim(3600.0, 7200.0), used.resample("2 [min]"), used.mask("T", 0.0, 600.0)):
        with raises_code("campaign.record-used", IdentificationError, match="'Box'.*'a'"):
            validate(found, cut, WIDE)


def test_a_local_value_makes_a_verdict_conditional_where_it_decides(found: Calibration) -> None:
    held, local = run("held", 3, swing=0.0).select("T"), {"air": {"start": "24 [degC]", "sd": "2 [K]"}}
    wide = validate(found, held, WIDE, local=local)
    assert wide.fitted_locally == ("air",)
    assert not wide.conditional
    assert wide.head == "Box on held: PASSED"
    doubted = replace(wide, standing=Standing("not adequate", "its residuals", "Box"))
    assert re.fullmatch("Box on held: NOT PASSED: .* not adequate", doubted.head)
    accepted = replace(doubted, standing=replace(doubted.standing, accepted=True))
    assert accepted.head.startswith(wide.head)
    assert accepted.head.endswith(" not adequate")
    least = Criteria(rmse=f"{1.0001 * wide.statistics['T'].rmse:.6f} [K]")
    verdict = validate(found, held, least, local=local)
    assert verdict.deciding == ("air",)
    assert verdict.passed
    assert re.match("Box on held: PASSED, .*; ", verdict.head)


def test_criteria_of_a_sensor_stand_in_place_of_the_common_ones(found: Calibration) -> None:
    strict = Criteria(rmse="1 [K]", sensors={"T": {"rmse": "0.0001 [K]", "max_error": "9 [K]"}})
    verdict = validate(found, run("held", 3), strict)
    assert {c.criterion: c.limit for c in verdict.checks} == {"rmse": 1e-4, "max_error": 9.0}
    assert not verdict.passed


@pytest.mark.parametrize(
    ("table", "error", "code", "match"),
    [
        ({}, IdentificationError, "value.incomplete", "'T' .*max_error or mean_error"),
        ({"rms": "1 [K]"}, ScenarioError, "name.unknown", "'rms'.*'rmse'"),
        ({"sensors": {"T": {"rms": "1 [K]"}}}, ScenarioError, "name.unknown", r"here\.sensors\.T.*'rms'.*'rmse'"),
        ({"sensors": {"T": "1 [K]"}}, ScenarioError, "file.wrong-kind", r"sensors\.T.*'1 \[K\]'"),
        ({"rmse": "1 [K]", "sensors": {"TT": {"rmse": "1 [K]"}}}, IdentificationError, "name.unknown", "'TT'.*'T'"),
        ({"rmse": 0.8}, UnitError, "unit.wrong-dimension", r"here\.rmse"),
        ({"rmse": "0 [K]"}, ScenarioError, "value.outside-range", ""),
        ({"rmse": "inf [K]"}, ScenarioError, "value.outside-range", ""),
        ({"rmse": "1 [degC]"}, UnitError, "unit.scale-for-difference", r"here\.rmse"),
    ],
)
def test_refused_criteria(found: Calibration, table: dict[str, object], error: type[Exception], code: str, match: str) -> None:
    with raises_code(code, error, match=match):
        validate(found, run("held", 3), Criteria.read(table, "here"))


def test_a_sensor_that_misses_by_a_constant_is_asked_about_its_place(found: Calibration) -> None:
    """A thermometer was taken off the body and glued to the lid: 2.5 K, and nobody was asked."""
    held = run("held", 3)
    moved = held.with_channels(replace(held["T"], values=held["T"].values + np.where(held.times > 600.0, 2.5, 0.0)))
    verdict = validate(found, moved, WIDE)
    (question,) = verdict.questions
    assert re.match(r"check: T .* 2\.\d* K ", question)
    assert validate(found, moved, Criteria(rmse="5 [K]")).questions == ()
    both = tuple(replace(c, sensor=n) for c in verdict.checks for n in ("T", "U"))
    (question,) = replace(verdict, statistics=dict.fromkeys(("T", "U"), verdict.statistics["T"]), checks=both).questions
    assert re.match(r"check: T, U .* 2\.\d* K ", question)


def test_the_text_says_the_word_and_every_criterion(found: Calibration) -> None:
    text = str(validate(found, run("held", 3), Criteria(rmse="1 [K]", max_error="0.0001 [K]"), title="bench"))
    first, second, third, *bands = text.splitlines()
    assert first == "Box on held (bench): FAILED"
    assert "1 K: met" in second
    assert "0.0001 K: NOT met" in third
    assert any("95 %" in line for line in bands)
    assert bands[-1].lstrip().startswith("worst stretch: ")


def test_a_second_sensor_that_begins_later_does_not_move_the_start(found: Calibration) -> None:
    held = run("held", 3, loads={"heat": 4.0})
    begun = held.times >= 7200.0
    both = held.with_channels(replace(held["T"], name="T2", valid=begun))  # an Arduino that started again, its two files joined
    assert both["T2"].values[begun][0] > both["T"].values[0] + 8.0
    limit = Criteria(max_error="0.2 [K]")
    (alone,) = validate(found, held, limit).checks
    judged = {c.sensor: c for c in validate(found, both, limit).checks}
    assert alone.met
    assert judged["T"].found == pytest.approx(alone.found, abs=1e-6)


def test_two_sensors_that_begin_together_start_a_judged_run_at_their_mean(found: Calibration) -> None:
    """A second sensor 0.8 K above the first: the verdict starts at the mean of both, as the fit does, and not at the last one."""
    held = run("held", 3, loads={"heat": 4.0})
    above = replace(held["T"], name="T2", values=held["T"].values + 0.8)
    judged = compare(found.model, held.with_channels(above))
    assert judged.problem is not None
    (e,) = judged.problem.experiments
    assert float(e.scenario.initial["case"]) == pytest.approx(float(held["T"].values[0]) + 0.4, abs=1e-9)
    assert e.first_readings() == pytest.approx({"T": held["T"].values[0], "T2": held["T"].values[0] + 0.8})
    late = held.with_channels(replace(above, valid=held.times >= 7200.0))
    (e,) = build_problem(Request(found.model, (late,), held_errors={}, fit_start=False)).experiments
    assert set(e.first_readings()) == {"T"}


def test_a_verdict_asks_about_its_record_below_its_head(found: Calibration) -> None:
    """Exchanged sensors of a hold-out record were found, and said nowhere."""
    verdict = validate(found, run("held", 3), WIDE)
    assert verdict.prediction is not None
    asked = replace(verdict, prediction=replace(verdict.prediction, warnings=("check: T and U", "else")))
    assert str(asked).splitlines()[1] == "  check: T and U"
