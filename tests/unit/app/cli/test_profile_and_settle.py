"""``thermid profile`` and ``thermid settle``, as a user would call them."""

from __future__ import annotations

import json

import numpy as np
import pytest
from typer.testing import CliRunner

import thermid as td
from by_code import raises_code
from thermid.app.cli.app import app

DECK = """
title = "box"
needs = ["air"]
[nodes]
case = { capacitance = "900 [J/K]" }
[surfaces]
skin = { of = "case", to = "air", area = "0.1 [m^2]", htc = "8 [W/(m^2 K)]", emissivity = 0.8 }
[loads]
chips = { into = "case", power = "5 [W]" }
"""
RANGE = ["--lowest", "-5", "--highest", "45"]


@pytest.fixture
def deck(tmp_path):
    file = tmp_path / "box.toml"
    file.write_text(DECK, encoding="utf-8")
    return str(file)


def call(*arguments):
    return CliRunner().invoke(app, [str(a) for a in arguments])


def test_profiles_are_listed_and_printed():
    assert "unit thermal cycle: qualification, protoqualification, acceptance" in call("profile").output
    text = call("profile", "SMC-S-016", "unit thermal cycle", "--level", "acceptance", *RANGE, "--set", "cycles=2").output
    assert "cycles          2" in text
    assert "trust:" in text
    assert json.loads(call("profile", "--json").output)["standards"]["NAVMAT P-9492"]


def test_a_profile_is_saved_edited_and_run(tmp_path, deck):
    own = tmp_path / "own.toml"
    assert call("profile", "SMC", "unit thermal cycle", *RANGE, "--set", "cycles=1", "--set", "dwell=2", "--save", own).exit_code == 0
    assert td.qualify.load_profile(own)["dwell"].value == 7200.0
    picture, csv = tmp_path / "run.png", tmp_path / "run.csv"
    done = call("profile", own, "--on", deck, "--base", "case", "--picture", picture, "--csv", csv, "--json")
    assert done.exit_code == 0, done.output
    found = json.loads(done.output)
    assert found["decides"] is True
    assert [p["kind"] for p in found["phases"]][:3] == ["way", "wait", "stay"]
    assert picture.stat().st_size > 10_000
    assert csv.read_text(encoding="utf-8").startswith('"time_s",')


@pytest.mark.parametrize(
    ("arguments", "code", "match"),
    [
        (["SMC", "unit thermal cycle", "--lowest", "-5"], "value.incomplete", ""),
        (["SMC", "unit thermal cycle", "--picture", "x.png"], "value.incomplete", ""),
        (["SMC", "unit thermal cycle", "--set", "cycle=2"], "name.unknown", "'cycles'"),
    ],
)
def test_mistakes_of_profile(arguments, code: str, match: str):
    with raises_code(code, td.ThermidError, match=match):
        CliRunner().invoke(app, ["profile", *arguments], catch_exceptions=False)


def log(tmp_path, hours, tau=1500.0):
    times = np.arange(0.0, hours * 3600.0, 10.0)
    rng = np.random.default_rng(1)
    warm = 45.0 - 20.0 * np.exp(-times / tau) + 0.05 * rng.standard_normal(times.size)
    file = tmp_path / "log.csv"
    np.savetxt(
        file, np.column_stack([times, warm, np.full(times.size, 5.0)]), delimiter=",", header="time_s,T_CASE,P [W]", comments="", fmt="%.4f"
    )
    return file


def test_settle_says_stable_or_not_by_its_exit_code(tmp_path):
    early = call("settle", log(tmp_path, 1.0))
    assert early.exit_code == 1
    assert "'3 C/h'" in early.output
    late = call("settle", log(tmp_path, 6.0), "--slowest", "1 [h]", "--json")
    assert late.exit_code == 0
    found = json.loads(late.output)
    assert found["verdict"] == "stable"
    assert found["forecasts"]["T_CASE"]["interval_C"][0] < 45.0 < found["forecasts"]["T_CASE"]["interval_C"][1]


def test_settle_without_a_temperature_or_with_a_wrong_rule(tmp_path):
    file = tmp_path / "power.csv"
    file.write_text("time_s,P [W]\n0,1\n10,1\n", encoding="utf-8")
    with raises_code("record.nothing-there"):
        CliRunner().invoke(app, ["settle", str(file)], catch_exceptions=False)
    with raises_code("value.wrong-kind"):
        CliRunner().invoke(app, ["settle", str(log(tmp_path, 1.0)), "--rule", "slow"], catch_exceptions=False)


@pytest.mark.parametrize(
    ("asked", "match"),
    [
        (["--within", "-1 [K]"], r"'-1 \[K\]'"),
        (["--within", "0"], "'0'"),
    ],
)
def test_settle_refuses_what_no_log_can_answer(tmp_path, asked, match):
    with raises_code("value.outside-range", match=match):
        CliRunner().invoke(app, ["settle", str(log(tmp_path, 1.0)), *asked], catch_exceptions=False)


def test_a_forecast_needs_a_stretch_that_was_logged_and_a_width(tmp_path):
    record = td.read_record(log(tmp_path, 1.0), {"T_CASE": {"node": "case"}})
    with raises_code("record.nothing-there", match="2"):
        td.bench.forecast(record, until="2 [h]")
    with raises_code("value.outside-range", match="0"):
        td.bench.forecast(record, within="0 [K]")


def test_stored_heat_is_judged_with_a_model_and_refused_without(tmp_path, deck):
    scenario = tmp_path / "bench.toml"
    scenario.write_text('duration = "4 [h]"\nstart = "20 [degC]"\n[boundaries]\nair = "20 [degC]"\n', encoding="utf-8")
    run = td.simulate(td.load_model(deck), td.load_scenario(scenario), every=20.0)
    log, noise = tmp_path / "log.csv", 0.02 * np.random.default_rng(1).standard_normal(run.times.size)
    table = np.column_stack([run.times, run["case"].celsius + noise])
    np.savetxt(log, table, delimiter=",", header="time_s,T_CASE [degC]", comments="", fmt="%.3f")
    column = "T_CASE [degC]=case"
    asked = ["settle", log, "--channel", column, "--rule", "stored 3 %"]
    done = call(*asked, "--model", deck, "--scenario", scenario)
    assert done.exit_code == 0, done.output
    assert " 5 W, " in done.output
    with pytest.raises(td.ThermidError, match="--model and --scenario"):
        CliRunner().invoke(app, [str(a) for a in asked], catch_exceptions=False)
