"""A prior is one thing in every form in which it is written, and at every door that takes one."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.base.errors import ThermidError
from unit.fit.bench import HTC, MASS, box, log

Q = td.quantity
FORMS: dict[str, Any] = {
    "texts": ("1.5 [kg]", "0.03 [kg]"),
    "grams": ("1500 [g]", "30 [g]"),
    "per cent": ("1.5 [kg]", "2 [%]"),
    "about the start": ("", "2 [%]"),
    "no mean": (None, "2 [%]"),
    "quantities": (Q(1.5, unit="kg"), Q(0.03, unit="kg")),
    "quantity of per cent": (Q(1.5, unit="kg"), Q(2, unit="%")),
    "table": {"mean": "1.5 [kg]", "sd": "0.03 [kg]"},
    "table of quantities": {"mean": Q(1.5, unit="kg"), "sd": Q(30, unit="g")},
}
WRONG = {
    "one text": "0.03 [kg]",
    "one quantity": Q(0.03, unit="kg"),
    "array": np.array([1.5, 0.03]),
    "numbers": (1.5, 0.03),
    "three": (1, 2, 3),
}
BENCH = td.Scenario("bench", boundaries={"air": "24 [degC]"}, start="24 [degC]", duration="1 [h]")


def record() -> td.Record:
    return log(box(), {MASS: "1.4 [kg]"}, {"T": "case"}, samples=31, hours=1.0, noise=0.2, seed=3)


def fitted(prior: Any) -> float:
    return td.calibrate(box(), record(), [MASS], priors=prior)[MASS].value


def known(prior: Any) -> float:
    return td.identifiability(box(), record(), [MASS, HTC], priors=prior).parameters[MASS].error


def advised(prior: Any) -> float:
    return td.design.next_test(box(), MASS, scenario=BENCH, sensors={"case": "0.1 [K]"}, priors=prior).now


def beside_a_power(prior: Any) -> float:
    return td.inference.power_history(box(), record(), "heat", free=[MASS], priors=prior, every="15 [min]").values[MASS][0]


@pytest.mark.parametrize("door", [fitted, known, advised])
def test_a_prior_is_one_thing_in_every_form_and_by_every_name(door: Callable[[Any], float]) -> None:
    plain = door({MASS: FORMS["texts"]})
    for form, prior in FORMS.items():
        assert door({MASS: prior}) == pytest.approx(plain, rel=1e-6), form
    assert door({"case.m*": FORMS["texts"]}) == pytest.approx(plain, rel=1e-6)
    for form, prior in WRONG.items():
        with pytest.raises(ThermidError) as refused:
            door({MASS: prior})
        assert "priors.case.mass" in str(refused.value), form


def test_a_prior_beside_a_power_is_one_thing_in_two_forms() -> None:
    assert beside_a_power({MASS: FORMS["table of quantities"]}) == pytest.approx(beside_a_power({MASS: FORMS["texts"]}), rel=1e-6)


@pytest.mark.parametrize("door", [fitted, known, advised])
def test_the_range_of_a_data_sheet_is_a_prior_at_every_door(door: Callable[[Any], float]) -> None:
    with raises_code("value.without-effect"):
        door({MASS: "range"})


def test_a_known_power_is_one_thing_in_every_form() -> None:
    def found(stretch: Any, accuracy: Any) -> Any:
        return td.inference.power_history(box(), record(), "heat", known=[stretch], accuracy=accuracy, every=Q(15, unit="min")).power

    texts = found(("0 [min]", "30 [min]", "4 [W]"), "2 [%]")
    for accuracy in (Q(2, unit="%"), Q(80, unit="mW")):
        assert found((Q(0, unit="s"), Q(0.5, unit="h"), Q(4000, unit="mW")), accuracy) == pytest.approx(texts, rel=1e-9)


def test_a_spread_is_a_text_or_a_quantity() -> None:
    def ends(spread: Any) -> Any:
        runs = td.qualify.uncertain_runs(box(), BENCH, spread={MASS: spread, "air": Q(1, unit="K")}, n=8, seed=3)
        return runs.node_temperatures("case")[:, -1]

    assert ends(Q(2, unit="%")) == pytest.approx(ends("2 [%]"), rel=1e-12)
    assert ends(Q(30, unit="g")) == pytest.approx(ends({"sd": "30 [g]"}), rel=1e-12)
