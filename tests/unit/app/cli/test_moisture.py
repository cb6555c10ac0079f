"""``thermid moisture``: margins and minutes, from options or from a scenario."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import thermid as td
from unit.app.cli.conftest import Call

DECK = """title = "cold box"
needs = ["air"]
[nodes]
case = { capacitance = "700 [J/K]" }
[surfaces]
skin = { of = "case", to = "air", area = "0.08 [m^2]", htc = "5 [W/(m^2 K)]" }
"""
TRANSFER = """title = "from the cold store"
boundaries = { air = "30 [degC]" }
start = "-10 [degC]"
duration = "3 [h]"
[environment.air]
humidity = "60 [%]"
"""


@pytest.fixture
def deck(tmp_path: Path) -> Path:
    (tmp_path / "box.toml").write_text(DECK)
    (tmp_path / "transfer.toml").write_text(TRANSFER)
    return tmp_path / "box.toml"


def test_the_object_and_the_words(call: Call, deck: Path) -> None:
    said = call("moisture", deck, "--scenario", deck.parent / "transfer.toml", "--json")
    assert said.code == 0
    skin = said.object["surfaces"]["skin"]
    assert skin["condensing_s"] / 60 == pytest.approx(26.3, abs=0.1)
    assert skin["wet_s"] / 60 == pytest.approx(93.35, abs=0.5)  # 93.35 min with outputs every 3 s
    assert (skin["least_margin_K"], skin["dew_point_C"]) == (pytest.approx(-31.39, abs=0.01), pytest.approx(21.39, abs=0.01))
    assert skin["film_kg_m2"] == pytest.approx(0.0485, abs=1e-4)
    assert 0.0 < skin["latent_J"] < 3.34e5 * 0.0485 * 0.08  # all dries again; what settled as frost gave its heat of melting, and keeps it
    assert said.object["water"]["relative"] < 1e-9
    assert said.object["water"]["settled_kg"] == pytest.approx(0.08 * skin["film_kg_m2"], rel=1e-3)
    words = call("moisture", deck, "--boundary", "air=30", "--start", "-10", "--for", "3 [h]", "--humidity", "air=60 [%]")
    assert "26.3 min" in words.out


def test_an_option_wins_over_the_scenario(call: Call, deck: Path) -> None:
    said = call("moisture", deck, "--scenario", deck.parent / "transfer.toml", "--humidity", "air=0.02", "--json")
    assert said.object["surfaces"]["skin"]["condensing_s"] == 0.0


@pytest.mark.parametrize(
    ("options", "code", "match"),
    [
        (["--humidity", "air=1.2"], "value.outside-range", r" 1\.2\. .*'60 \[%\]'"),
        (["--humidity", "aire=0.5"], "name.unknown", "'aire'.* 'air'"),
        (["--humidity", "air"], "value.wrong-kind", "PATH=VALUE"),
        ([], "value.incomplete", "{'air': 0.6}"),
    ],
)
def test_refusals(call: Call, deck: Path, options: list[str], code: str, match: str) -> None:
    said = call("moisture", deck, "--boundary", "air=30", "--start", "-10", "--for", "3 [h]", *options, "--json")
    assert (said.code, said.object["status"], said.object["code"]) == (2, "error", code)
    assert re.search(match, said.object["message"])


def test_latent_heat_closes_the_balance(deck: Path) -> None:
    box = td.load_model(deck)
    transfer = td.Scenario("transfer", boundaries={"air": "30 [degC]"}, start="-10 [degC]", duration="30 [min]")
    found = td.site.moisture(box, transfer, {"air": 0.6})
    balance = found.solution.heat_balance()
    assert balance.relative < 1e-6
    assert balance.loads == pytest.approx(found["skin"].heat, rel=1e-4)  # water that settles is the only load
    assert found["skin"].heat == pytest.approx(2.5e6 * 0.08 * float(found["skin"].film[-1]), rel=0.15)  # frost gives more than dew


def test_a_run_without_the_heat_of_condensation_is_not_credible(call: Call, deck: Path) -> None:
    """A humid gas above its dew point everywhere changes nothing; where water settles, the first line says so and names the command."""
    said = call("simulate", deck, "--scenario", deck.parent / "transfer.toml")
    assert said.code == 1
    assert all(part in said.out for part in ("NOT CREDIBLE", "'skin'"))
    assert "`thermid moisture`" in said.out.splitlines()[0]
    course = td.load_scenario(deck.parent / "transfer.toml")
    prediction = td.predict(td.design.Knowledge(td.load_model(deck)), course)
    assert (prediction.standing.state, "NOT CREDIBLE" in str(prediction)) == ("not credible", True)
    dry = td.simulate(td.load_model(deck), course.with_(start="25 [degC]"))
    assert (dry.doubts, dry.warnings) == ((), ())
    wet = call("moisture", deck, "--scenario", deck.parent / "transfer.toml", "--at", "20 [min]", "--json").object
    run = td.site.moisture(td.load_model(deck), course, {"air": 0.6})
    assert wet["nodes"]["case"]["at_C"] == [pytest.approx(float(run.solution["case"].at(1200.0)))]
    assert wet["nodes"]["case"]["at_C"][0] > float(td.simulate(td.load_model(deck), course)["case"].at(1200.0)) + 3.0
    assert wet["warnings"] == []
    assert re.search(r"case  end +[\d.]+ degC", str(run)), "temperatures with the heat of settling and drying water"
