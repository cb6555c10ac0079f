"""What a stage hands on: exactly what its data said, with constant errors of sensors, and each prior once."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from by_code import raises_code
from thermid.base.errors import NameNotFoundError
from thermid.fit._calibrate import calibrate
from thermid.fit._error_model.sizes import SIZES
from thermid.fit._problem.request import counted_twice, known_before
from thermid.fit.calibration import Calibration, Request, fit
from thermid.measure.records import Record
from thermid.model.tree import Model, model_from_dict
from thermid.values.store import graft
from unit.fit.bench import HTC, MASS, box, log, pair

LINEAR = {"parameters/power/min": 0}
"""With zero as its minimum a power is fitted as it is, and every temperature is linear in all that is looked for."""


@pytest.fixture(scope="module")
def stack() -> Model:
    return pair(first=box(LINEAR), second=box({**LINEAR, "parameters/power/value": "2 [W]", "nodes/case/mass/value": "0.8 [kg]"}))


def bench(stack: Model, name: str, seed: int, start: str) -> Record:
    data = log(
        stack,
        {"a.power": "4.4 [W]", "b.power": "1.8 [W]"},
        {"A": "a.case", "B": "b.case"},
        name=name,
        boundary="room",
        noise=0.3,
        accuracy=0.4,
        bias={"A": 0.5, "B": -0.3},
        seed=seed,
        start=start,
        samples=61,
        hours=3.0,
    )
    # less scatter than stated, so that nothing is widened and the problem stays Gaussian
    return data.with_channels(*(replace(data[s], noise=0.4) for s in "AB"))


@pytest.fixture(scope="module")
def records(stack: Model) -> tuple[Record, Record]:
    return bench(stack, "below", 1, "24 [degC]"), bench(stack, "above", 2, "40 [degC]")


FREE = ("a.power", "b.power")


@pytest.fixture(scope="module")
def below(stack: Model, records: tuple[Record, Record]) -> Calibration:
    return fit(Request(stack, records[:1], FREE, name="below"))


@pytest.fixture(scope="module")
def joint(stack: Model, records: tuple[Record, Record]) -> Calibration:
    found = fit(Request(stack, records, FREE, name="joint"))
    assert found.reduced_chi_square < 1
    return found


def test_two_steps_with_a_prior_are_one_fit_of_all_data(
    stack: Model, records: tuple[Record, Record], below: Calibration, joint: Calibration
) -> None:
    two = fit(Request(stack, records[1:], FREE, store=below.store, prior=FREE, name="above"))
    assert list(two.values) == list(joint.values)
    spread = np.sqrt(np.diag(joint.values.covariance))
    for k, path in enumerate(joint.values):
        assert abs(two[path].value - joint[path].value) < 1e-3 * spread[k]
        assert two[path].error == pytest.approx(joint[path].error, rel=1e-4)
    np.testing.assert_allclose(two.values.covariance, joint.values.covariance, rtol=0, atol=1e-4 * spread.max() ** 2)


def test_the_step_above_learns_more_than_either_alone(
    stack: Model, records: tuple[Record, Record], below: Calibration, joint: Calibration
) -> None:
    alone = fit(Request(stack, records[1:], FREE, name="above"))
    for path in FREE:
        assert joint[path].error < min(alone[path].error, below[path].error)


def test_priors_of_sensors_count_once(stack: Model, records: tuple[Record, Record], below: Calibration, joint: Calibration) -> None:
    # the accuracy is one source of both stages
    two = fit(Request(stack, records[1:], FREE, store=below.store, prior=FREE))
    assert [s.name for s in two.store.sources if s.kind == "instrument"] == ["accuracy: sensor A", "accuracy: sensor B"]
    assert two["sensor A"].error == pytest.approx(joint["sensor A"].error, rel=1e-4)


def test_a_prior_of_a_parameter_below_is_handed_on(stack: Model, records: tuple[Record, Record]) -> None:
    # the stage above knows of it only through what the stage below hands on
    known = {"a.power": ("4.2 [W]", "0.05 [W]")}
    below = fit(Request(stack, records[:1], FREE, priors=known))
    two = fit(Request(stack, records[1:], FREE, store=below.store, prior=FREE))
    joint = fit(Request(stack, records, FREE, priors=known))
    for path in joint.values:
        assert abs(two[path].value - joint[path].value) < 1e-3 * joint[path].error
        assert two[path].error == pytest.approx(joint[path].error, rel=1e-4)


def test_fixed_values_are_not_that(stack: Model, records: tuple[Record, Record], below: Calibration, joint: Calibration) -> None:
    model = stack.with_values({"a.power": below["a.power"]}, "below")
    fixed = fit(Request(model, records[1:], ("b.power",), held_bias=below.bias))
    assert fixed.model.at("a.power").expression.literal.value == below["a.power"].value != joint["a.power"].value
    assert fixed["b.power"].error < 0.9 * joint["b.power"].error, "what is held is taken for known"


def test_some_of_the_values_are_marginal_not_conditional(stack: Model, records: tuple[Record, Record], below: Calibration) -> None:
    kept = below.values.only(["b.power"])
    assert list(kept) == ["b.power", "sensor A", "sensor B"]
    rows = [1, 2, 3]
    np.testing.assert_array_equal(kept.covariance, below.values.covariance[np.ix_(rows, rows)])
    with raises_code("name.unknown", NameNotFoundError, match=r"'b\.powr'.*'b\.power'"):
        below.values.only(["b.powr"])


def test_parameters_alone(below: Calibration) -> None:
    bare = below.values.bare()
    assert list(bare) == list(FREE)
    np.testing.assert_array_equal(bare.covariance, below.values.covariance[:2, :2])


def test_nothing_in_common_hands_nothing_on(stack: Model, records: tuple[Record, Record], below: Calibration) -> None:
    before = known_before(Request(stack, (), store=below.store, prior=FREE), ())
    assert (before.at.size, before.mean.size, before.rows.shape[0]) == (0, 0, 0)


def test_a_record_that_is_in_the_prior_already(records: tuple[Record, Record], below: Calibration) -> None:
    (remark,) = counted_twice(below.store, FREE, (records[0].trim(600.0), records[1]))
    assert all(part in remark for part in ("'below'", "'below' too"))


def test_what_moved_is_said(stack: Model, below: Calibration) -> None:
    # in the assembly the first part gives 8 W, far from what it gave alone
    data = log(stack, {"a.power": "7 [W]"}, {"A": "a.case", "B": "b.case"}, boundary="room", accuracy=0.4, noise=0.3, seed=4)
    moved = fit(Request(stack, (data,), FREE, store=below.store, prior=FREE))
    far = re.compile(r"\b[ab]\.[\w.]+ \([+-]\d")
    assert any((named := far.search(w)) and named[0].startswith("a.power (+") for w in moved.warnings)
    same = fit(Request(stack, (bench(stack, "x", 9, "30 [degC]"),), FREE, store=below.store, prior=FREE))
    assert not any(map(far.search, same.warnings))


def housed(air: str) -> Model:
    """A box in a housing: its air is a node of the whole, or its room."""
    film = {"value": "2 [W/(m^2 K)]", "min": 1, "max": 20}
    walls = {"inner": {"of": "wall", "to": "inside"}, "outer": {"of": "wall", "to": "room"}}
    return model_from_dict(
        {
            "title": "Housed",
            "needs": ["room"],
            "submodels": {"unit": {"use": box(), "bind": {"air": air}}},
            "nodes": {"inside": {"capacitance": "12 [J/K]"}, "wall": {"capacitance": "1800 [J/K]"}},
            "surfaces": {n: {**at, "area": "0.2 [m^2]", "effective_htc": film} for n, at in walls.items()},
        }
    )


def test_a_coefficient_that_meets_a_node_and_met_a_boundary_may_be_another() -> None:
    """Gas in a housing carries 20 % less than that of the room in which the part was fitted, with an error of 1 %."""
    alone = calibrate(box(), log(box(), {HTC: "6.3 [W/(m^2 K)]"}, {"T": "case"}), [HTC, MASS])
    path, error = f"unit.{HTC}", alone.store.error(HTC) / alone.store[HTC].value
    carried = {air: graft(housed(air), [("unit", alone.store)])[0] for air in ("inside", "room")}
    size = {air: np.sqrt(store.covariance([path])[0, 0]) for air, store in carried.items()}
    assert size["room"] == pytest.approx(error, rel=1e-9)
    assert size["inside"] == pytest.approx(np.hypot(error, SIZES["surface"].value), rel=1e-9)
    assert carried["inside"].error(f"unit.{MASS}") == pytest.approx(alone.store.error(MASS), rel=1e-9), "masses stay what they are"
    rack = model_from_dict({"title": "Rack", "needs": ["room"], "submodels": {"a": {"use": housed("inside"), "bind": {"room": "room"}}}})
    again = graft(rack, [("a", carried["inside"])])[0]
    assert again.error(f"a.{path}") == pytest.approx(carried["inside"].error(path), rel=1e-9), "counted once, where it happened"
    truth = {path: "5.04 [W/(m^2 K)]"}
    data = log(housed("inside"), truth, {"T": "unit.case", "W": "wall"}, boundary="room", hours=12.0)
    found = calibrate(housed("inside"), data, [path, f"unit.{MASS}", "inner.effective_htc", "outer.effective_htc"], inherit={"unit": alone})
    assert abs(found[path].value - 5.04) < 2.0 * found[path].error
    assert found[path].error < 0.15 * found[path].value
