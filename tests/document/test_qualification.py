"""Rows A8, A12, H1 and W2 of the acceptance sheet: tests against simulation, and the validation programme."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import thermid as td
from thermid.app.cli.app import app
from thermid.qualify.plans import load_plan
from unit.qualify.project import PLAN, measured, project, with_log
from unit.qualify.things import unit

pytestmark = pytest.mark.document


def test_A8_two_logs_in_metrics_and_overlay_out(tmp_path: Path) -> None:  # noqa: N802
    """A log of readings and one of a simulation: metrics per sensor, and a page with the sensor's band."""
    measured(tmp_path, name="measured.csv", offset=0.5)
    measured(tmp_path, name="simulated.csv")
    page = tmp_path / "page.html"
    told = CliRunner().invoke(
        app,
        [
            "correlate",
            str(tmp_path / "measured.csv"),
            str(tmp_path / "simulated.csv"),
            "--accuracy",
            "0.4 [K]",
            "--to",
            str(page),
            "--json",
        ],
    )
    assert told.exit_code == 0, told.output
    found = json.loads(told.stdout)
    assert [s["mean_K"] for s in found["sensors"] if s["sensor"] == "T_PROC"] == [pytest.approx(0.5, abs=1e-3)]
    assert found["verdicts"] == {"MIL-HDBK-340, transient": True}
    text = page.read_text(encoding="utf-8")
    assert "sensor, 95 %" in text
    assert text.count('<svg class="plot"') == 2 + 3
    for figure in ('id="fig-scatter"', 'id="fig-histogram"'):  # of all readings, above one overlay for each of three sensors
        assert text.count(figure) == 1
    assert "SYNTHETIC DATA" in text


@pytest.mark.parametrize("course", ["thermal cycling", "thermal vacuum", pytest.param("humidity", marks=pytest.mark.campaign)])
def test_W2_a_log_of_every_kind_of_profile_is_judged(tmp_path: Path, course: str) -> None:  # noqa: N802
    """A8 on thermal, vacuum and humidity profiles: the same plan, its course by a profile, its log by another unit's sensors."""
    names = {"thermal cycling": "unit thermal cycle", "thermal vacuum": "unit thermal vacuum", "humidity": "unit humidity"}
    cycles = ", cycles = 1" if course != "humidity" else ""
    surfaces = '{ proc = { of = "proc", to = "air", area = "0.02 [m^2]", htc = "5 [W/(m^2 K)]", emissivity = 0.8 } }'
    profile = f'profile = {{ like = "SMC-S-016 {names[course]}"{cycles} }}'
    text = PLAN.replace('scenario = { boundaries = { air = "40 [degC]" }, start = "20 [degC]", duration = "6 [h]" }', profile)
    text = text.replace('kind = "thermal cycling"', f'kind = "{course}"').replace('steady = [["5 [h]", "6 [h]"]]\n', "")
    text = text.replace('"-20 [degC]", "70 [degC]"', '"-60 [degC]", "120 [degC]"')
    file = project(tmp_path, text)
    (tmp_path / "unit.toml").write_text(
        (tmp_path / "unit.toml").read_text() + f"\n[surfaces]\nskin2 = {surfaces[9:-2]}\n", encoding="utf-8"
    )
    scenario = td.qualify.run_plan(file)["hot"].foresight.scenario
    times = np.arange(0.0, scenario.seconds, 300.0)
    run = td.simulate(load_plan(file).knowledge.model, scenario, times=times)
    columns = [times, run["proc"].celsius + 0.3, run["ele"].celsius + 0.3, run["air"].celsius]
    np.savetxt(tmp_path / "hot.csv", np.column_stack(columns), delimiter=",", header="time_s,T_PROC,T_ELE,ROOM", comments="")
    project_text = with_log(text)
    (tmp_path / "plan.toml").write_text(project_text, encoding="utf-8")
    trial = td.qualify.run_plan(file)["hot"]
    assert trial.course is not None
    assert trial.correlation is not None
    assert set(trial.correlation.verdicts) == {"ECSS", "ours"}
    steady = [d for d in trial.correlation.deviations if d.kind == "steady"]
    assert steady
    assert all(d["mean"] == pytest.approx(0.3, abs=0.15) for d in steady)


def test_A12_a_plan_lists_its_tests_and_turns_into_verdicts_as_logs_come_back(tmp_path: Path) -> None:  # noqa: N802
    """Environmental tests and the experiment on board, each with sensors, criteria and pass or fail."""
    file = project(tmp_path)
    ahead = td.qualify.run_plan(file)
    assert [(t.test.name, t.test.kind, t.correlation) for t in ahead.trials] == [
        ("hot", "thermal cycling", None),
        ("experiment on board", "on-board", None),
    ]
    assert all(t.within for t in ahead.trials)
    td.qualify.load_plan(file).lock()
    measured(tmp_path)
    (tmp_path / "plan.toml").write_text(with_log(PLAN, state='"run"'), encoding="utf-8")
    good = td.qualify.run_plan(file)
    assert good["hot"].correlation is not None
    assert good["hot"].correlation.verdicts == {"ECSS": True, "ours": True}
    assert good.lock.state == "locked"
    assert good["hot"].passed
    assert good.passed is None
    assert any(re.match(r"experiment on board: .* MIL-HDBK-340, transient ", why) for why in good.open)


def test_A12_a_failed_log_names_its_gate_and_what_would_explain_it(tmp_path: Path) -> None:  # noqa: N802
    measured(tmp_path, offset=4.0)
    file = project(tmp_path, with_log(PLAN))
    page = tmp_path / "page.html"
    told = CliRunner().invoke(app, ["qualify", str(file), "--to", str(page), "--json"])
    assert told.exit_code == 1, told.output
    (hot, _) = json.loads(told.stdout)["tests"]
    assert hot["correlation"]["verdicts"] == {"ECSS": False, "ours": False}
    assert {g["name"] for g in hot["correlation"]["gates"] if g["passed"] is False} == {"mean", "each"}
    assert hot["diagnosis"]["group"] == "boundary or reference"
    text = page.read_text(encoding="utf-8")
    titles = [
        "Objectives and success criteria",
        "Sensors",
        "Test cases as run",
        "Stabilisation",
        "Heat flows",
        "Deviations after correlation",
    ]
    places = [text.index(f"<h2>{t}") for t in titles]
    assert places == sorted(places)
    assert "SYNTHETIC" in text
    assert not re.search(r"<script[^>]+src=|https?://(?!www\.w3\.org)", text)


def test_A12_the_plan_command_predicts_and_locks(tmp_path: Path) -> None:  # noqa: N802
    file = project(tmp_path)
    told = CliRunner().invoke(app, ["plan", str(file), "--lock", "--json"])
    assert told.exit_code == 0, told.output
    found = json.loads(told.stdout)
    assert found["plan"]["state"] == "locked"
    run = td.simulate(unit(), td.Scenario("hot", boundaries={"air": "40 [degC]"}, start="20 [degC]", duration="6 [h]"))
    assert found["predictions"]["hot"]["T_PROC"]["last_C"] == pytest.approx(run["proc"].final, abs=2e-3)
    assert file.with_suffix(".lock.json").is_file()


def test_H1_relative_humidity_alone_moves_no_verdict(tmp_path: Path) -> None:  # noqa: N802
    """10 % and 90 %: identical results, and nothing is said where no surface is below the dew point."""
    found = []
    for humidity in (0.1, 0.9):
        course = td.Scenario(
            "x",
            boundaries={"air": "40 [degC]"},
            duration="2 [h]",
            start="20 [degC]",
            environment={"air": td.simulation.Environment(humidity=humidity)},
        )
        found.append(td.design.foresee(td.design.Knowledge(unit()), course))
    assert np.array_equal(found[0].prediction["proc"].kelvin, found[1].prediction["proc"].kelvin)
    assert not any("humid" in w for f in found for w in f.prediction.warnings)
    assert all(f.standing.fair for f in found)
