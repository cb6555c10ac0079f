"""One written spread has one meaning: every public place that takes one draws the same numbers from it."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.base.errors import ThermidError
from thermid.fit.calibration import Unknown, prior_of
from thermid.prediction._predict import foresee
from thermid.values.store import read_spread

DECK = """
title = "part"
needs = ["air"]
aliases = { P = "body" }

[nodes]
body = { capacitance = "100 [J/K]", reference_point = true }

[conductors]
loss = { kind = "conduction", between = ["body", "air"], conductance = "0.5 [W/K]" }

[loads]
heat = { into = "body", power = { value = "5 [W]", min = 0, max = 20 } }
"""
SCENARIO = td.Scenario("soak", boundaries={"air": "20 [degC]"}, start="air", duration="2 [h]")
MEMBERS, SEED = 400, 3
TEXTS: list[tuple[str, Any]] = [
    ("heat.power", "0.5 [W]"),
    ("heat.power", "300 [mW]"),
    ("heat.power", "10 [%]"),
    ("heat.power", {"sd": "10 [%]", "mean": "6 [W]"}),
    ("heat.power", {"log_sd": 0.2}),
    ("heat.power", {"low": "4 [W]", "high": "10000 [mW]"}),
    ("heat.power", "range"),
    ("air", "2 [K]"),
    ("air", {"low": "-5 [K]", "high": "5 [K]"}),
    ("air", {"low": "15 [degC]", "high": "77 [degF]"}),
    ("air", {"sd": "1 [K]", "mean": "25 [degC]"}),
    ("scale.heat", "5 [%]"),
    ("scale.heat", {"low": 0.9, "high": 1.3}),
    ("initial.body", {"low": "-1 [K]", "high": "3 [K]"}),
]


@pytest.fixture(scope="module")
def model() -> td.Model:
    return td.model_from_dict(tomllib.loads(DECK))


def shifted(name: str) -> float:
    """What public draws of runs are counted from."""
    return 293.15 if name in ("air", "initial.body") else 0.0


@pytest.mark.parametrize(("name", "text"), TEXTS, ids=str)
def test_every_place_draws_the_same_numbers(model: td.Model, name: str, text: Any, tmp_path: Path) -> None:
    drawn = td.simulation.draw(model, SCENARIO, {name: text}, MEMBERS, seed=SEED)[name]
    runs = td.qualify.uncertain_runs(model, SCENARIO, spread={name: text}, n=MEMBERS, seed=SEED, nodes=["body"])
    assert runs.draws[name] + shifted(name) == pytest.approx(drawn, abs=1e-9)
    # a hold file
    (tmp_path / "part.toml").write_text(DECK, encoding="utf-8")
    (tmp_path / "soak.toml").write_text('duration = "2 [h]"\nstart = "air"\n[boundaries]\nair = "20 [degC]"\n', encoding="utf-8")
    inline = text if isinstance(text, dict) else {"": text}
    written = ", ".join(f'{k} = "{v}"' if isinstance(v, str) else f"{k} = {v}" for k, v in inline.items())
    spread = f'"{text}"' if isinstance(text, str) else f"{{ {written} }}"
    hold = f'model = "part.toml"\nscenario = "soak.toml"\n[limits]\nP = "90 [degC]"\n[spread]\n"{name}" = {spread}\n'
    (tmp_path / "hold.toml").write_text(hold, encoding="utf-8")
    question = td.qualify.load_hold(tmp_path / "hold.toml")
    assert question.spread == {name: text}
    # predictions, by derivatives or by members: those of the runs
    runs_end = runs.node_temperatures("body")[:, -1] - 273.15
    told = td.predict(td.design.Knowledge(model), SCENARIO, spread={name: text}, draws=MEMBERS, seed=SEED)["body"]
    assert told.members[-1] - 273.15 == pytest.approx(runs_end, abs=1e-4)
    band = foresee(td.design.Knowledge(model), SCENARIO, spread={name: text}).prediction["body"]
    noise = runs_end.std() / MEMBERS**0.5
    assert band.celsius[-1] == pytest.approx(runs_end.mean(), abs=4 * noise + 1e-4)
    assert band.error[-1] == pytest.approx(runs_end.std(), rel=0.15, abs=1e-4)


@pytest.mark.parametrize(("mean", "sd"), [("", "10 [%]"), ("6 [W]", "500 [mW]"), ("6 [W]", "10 [%]")])
def test_a_prior_is_the_same_law(mean: str, sd: str) -> None:
    power = Unknown("heat.power", "parameter", (), 5.0, low=-np.inf, high=np.inf, unit="W")
    law = read_spread(({"mean": mean} if mean else {}) | {"sd": sd}, "W", 5.0, "here")
    prior = prior_of(power, (mean, sd))
    assert (prior.mean, prior.sd) == pytest.approx((law.mean, law.variance**0.5))


@pytest.mark.parametrize(
    ("text", "other"),
    [
        ("0.5 [W]", "500 [mW]"),
        ({"low": "4 [W]", "high": "6 [W]"}, {"low": "4000 [mW]", "high": "0.006 [kW]"}),
        ({"sd": "1 [W]", "mean": "6 [W]"}, {"sd": "1000 [mW]", "mean": "0.006 [kW]"}),
    ],
)
def test_another_unit_changes_nothing(model: td.Model, text: Any, other: Any) -> None:
    one, two = (td.simulation.draw(model, SCENARIO, {"heat.power": t}, 50, seed=1)["heat.power"] for t in (text, other))
    assert one == pytest.approx(two, rel=1e-12)


WRONG: list[tuple[str, Any]] = [
    ("air", {"low": "15 [degC]", "high": "5 [K]"}),
    ("air", {"low": "288 [K]", "high": "298 [K]"}),
    ("air", "1 [%]"),
    ("heat.power", {"low": "4 [W]", "high": "30 [W]"}),
    ("heat.power", {"lowest": "4 [W]"}),
    ("scale.heat", {"sd": "1 [W]"}),
]


@pytest.mark.parametrize(("name", "text"), WRONG, ids=str)
def test_every_place_refuses_the_same(model: td.Model, name: str, text: Any) -> None:
    said = set()
    places = [
        lambda: td.simulation.draw(model, SCENARIO, {name: text}, 5, seed=1),
        lambda: td.qualify.uncertain_runs(model, SCENARIO, spread={name: text}, n=5),
        lambda: td.predict(td.design.Knowledge(model), SCENARIO, spread={name: text}),
        lambda: foresee(td.design.Knowledge(model), SCENARIO, spread={name: text}),
    ]
    for place in places:
        with pytest.raises(ThermidError) as refused:
            place()
        said.add(refused.value.message)
    assert len(said) == 1


def test_a_boundary_that_varies_takes_shifts_alone(model: td.Model) -> None:
    day = SCENARIO.with_(boundaries={"air": {"mean": "20 [degC]", "amplitude": "5 [K]", "period": "24 [h]"}})
    assert np.ptp(td.qualify.uncertain_runs(model, day, spread={"air": {"low": "-1 [K]", "high": "1 [K]"}}, n=50).draws["air"]) < 2.0
    with raises_code("value.without-effect"):
        td.qualify.uncertain_runs(model, day, spread={"air": {"low": "15 [degC]", "high": "25 [degC]"}}, n=5)


def test_scenarios_of_different_temperature_take_shifts_alone(model: td.Model) -> None:
    warm = SCENARIO.with_(boundaries={"air": "30 [degC]"})
    both = [SCENARIO, warm]
    assert td.qualify.uncertain_runs(model, both, spread={"air": "1 [K]"}, n=20).draws["air"].std() < 2.0
    with raises_code("value.contradicts", match="'air'"):
        td.qualify.uncertain_runs(model, both, spread={"air": {"low": "15 [degC]", "high": "25 [degC]"}}, n=5)
