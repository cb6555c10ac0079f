"""Exit codes and first lines of every command whose answer rests on a planted stage that is not credible."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import thermid as td
from thermid.app.cli.options import PRECEDENCE, leave
from thermid.model.tree import CREDIBLE, UNJUDGED, Standing
from unit.app.cli.conftest import Call, Said
from unit.fit.planted import planted

pytestmark = pytest.mark.usefixtures("values_alone")

STUDY = Path(__file__).parents[4] / "examples" / "sisnav" / "study.toml"
TOLD = re.compile(r"NOT CREDIBLE: [^'\n]*'box' \(T_BOX .*\+0\.")
TAKEN = re.compile(r"NOT CREDIBLE \(accepted\): [^'\n]*'box' \(T_BOX .*\+0\.")
HOLD = """
model = "whole.toml"
scenario = "scenario.toml"
values = "results/whole.values.toml"
members = 24
confidence = 0.5

[limits]
"c.case" = "60 [degC]"
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The planted project with its results."""
    from thermid.campaign.stages import run_stages

    root = tmp_path_factory.mktemp("planted")
    path = planted(root)
    (root / "hold.toml").write_text(HOLD)
    run_stages(path, cache=root / "results").save(root / "results")
    return root


COMMANDS = {
    "predict": ("predict", "campaign.toml", "--stage", "whole", "--scenario", "scenario.toml"),
    "simulate": ("simulate", "whole.toml", "--scenario", "scenario.toml", "--values", "results/whole.values.toml"),
    "hold": ("hold", "hold.toml"),
    "swap": ("swap", "campaign.toml", "p", "pair.toml"),
    "watch": ("watch", "logs/whole_two.csv", "--campaign", "campaign.toml", "--record", "whole_one", "--look", "once"),
    "fmu": ("export", "whole.toml", "--values", "results/whole.values.toml", "--scenario", "scenario.toml", "--as", "fmu", "--to"),
    "deliver": ("deliver", "whole.toml", "--scenario", "scenario.toml", "--values", "results/whole.values.toml", "--to"),
}


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_says_it_first_and_in_its_exit_code(
    folder: Path, tmp_path: Path, call: Call, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    monkeypatch.chdir(folder)

    def said_with(*more: str) -> Said:
        written = tmp_path / f"written{len(list(tmp_path.iterdir()))}"
        to = {"deliver": [str(written)], "fmu": [f"{written}.fmu"]}.get(name, [])
        return call(*COMMANDS[name], *to, *more)

    said = said_with()
    assert TOLD.match(said.out)
    assert said.code == 1
    standing = said_with("--json").object["standing"]
    assert (standing["state"], standing["stage"]) == ("not credible", "box")
    assert standing["because"] in said.out
    if name != "watch":  # which takes `accept` of the campaign alone
        taken = said_with("--accept", "box")
        assert (taken.code, bool(TAKEN.match(taken.out))) == (0, True)


def test_calibrate_and_report(folder: Path, call: Call, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    said = call("calibrate", "campaign.toml")
    assert all(part in said.out for part in ("NOT CREDIBLE", "'box' (T_BOX"))
    assert said.code == 1
    taken = call("calibrate", "campaign.toml", "--accept", "box", "--json")
    assert taken.code == 0
    found = taken.object
    assert [s["standing"]["stage"] for s in found["stages"]] == ["box"] * 3
    assert found["verdicts"][0]["passed"] is None
    assert "'box'" in found["standing"]["because"]
    shown = call("report", "campaign.toml", "--to", "page.html")
    assert (shown.code, ("NOT CREDIBLE" in shown.out and "'box'" in shown.out)) == (1, True)
    page = Path("page.html").read_text(encoding="utf-8")
    assert re.search(r'<p class="sum bad">\? 1 of 1 ', page)
    assert call("calibrate", "campaign.toml", "--accept", "boks").code == 2


def test_the_page_of_a_study_does_not_count_it_as_failed(folder: Path, tmp_path: Path) -> None:
    run = td.run_stages(folder / "campaign.toml", cache=folder / "results")
    page = td.reporting.study_report(td.design.load_study(STUDY), run, to=tmp_path / "page.html").read_text(encoding="utf-8")
    assert '<p class="sum bad">? 1 of 1 verdict not judged' in page


@pytest.mark.parametrize("own", PRECEDENCE)
@pytest.mark.parametrize("state", ["credible", "unjudged", "not adequate", "not credible", "failed"])
def test_bad_input_wins_over_a_failure_and_a_failure_over_inadequacy(own: int, state: str) -> None:
    standing = Standing(state, "why", "s")  # type: ignore[arg-type]
    by_values = {"not adequate": 5, "not credible": 1, "failed": 1}.get(state, 0)
    with pytest.raises(SystemExit) as left:
        leave(standing, own)
    expected = own if own in (2, 3, 4) else 1 if 1 in (own, by_values) else max(own, by_values)
    assert left.value.code == expected


def test_plan_and_qualify(tmp_path: Path, call: Call) -> None:
    """Values of a fit whose verdict failed: the plan and its verdicts are given, and say it; so does every margin."""
    import numpy as np

    import thermid as td
    from thermid.values.store import FittedValue, FittedValues
    from unit.qualify.project import PLAN, project
    from unit.qualify.things import unit

    failed = Standing("failed", "verdict on soak: T_PROC max error 3 K, limit 1 K", "unit")
    path = next(p for p in td.simulation.compile_network(unit()).numbers().values if p.endswith("capacitance"))
    value = float(td.simulation.compile_network(unit()).numbers().values[path])
    fitted = FittedValue(
        path, value, 0.01 * value, 0.01 * value, True, "J/K", value, (0.5 * value, 2 * value), "unit: soak", standing=failed
    )
    FittedValues("unit", {path: fitted}, np.diag([1e-4]), {"records": {}, "synthetic": True}).save(tmp_path / "fit.values.toml")
    file = project(tmp_path, PLAN.replace('deck = "unit.toml"', 'deck = "unit.toml"\nvalues = "fit.values.toml"'))
    found = td.qualify.run_plan(file)
    assert found.standing == failed
    assert {m.standing.state for m in found.margins} == {"failed"}
    line = "FAILED: rests on stage 'unit' (verdict on soak: T_PROC max error 3 K, limit 1 K)"
    for command, own in (("plan", 0), ("qualify", 0 if found.passed else 4)):
        said = call(command, file)
        assert said.out.startswith(line)
        assert said.code == (own or 1), "4 wins over 1"
        taken = call(command, file, "--accept", "unit", "--json")
        assert taken.object["standing"] == {**failed.to_dict(), "accepted": True}
        assert taken.code == own


def test_nothing_is_said_where_there_is_nothing_to_tell() -> None:
    for standing in (CREDIBLE, UNJUDGED):
        assert standing.over("text") == "text"
        assert standing.exit_code == 0


def test_a_plan_alone_has_no_values_to_write(folder: Path, tmp_path: Path, call: Call, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    said = call(*COMMANDS["swap"], "--to", str(tmp_path / "values"))
    assert said.code == 2
    assert "--new-data" in said.err
    assert not (tmp_path / "values").exists()


def test_predictions_that_a_campaign_names_say_it_once(folder: Path, call: Call, monkeypatch: pytest.MonkeyPatch) -> None:
    """It stood above each prediction and above each of its tables."""
    monkeypatch.chdir(folder)
    asked = "".join(f'\n[predictions.{n}]\nscenario = "scenario.toml"\nstage = "whole"\n' for n in ("one", "two"))
    (folder / "named.toml").write_text((folder / "campaign.toml").read_text() + asked)
    said = call("predict", "named.toml")
    first = said.out.splitlines()[0]
    assert "rests on stage" in first
    assert said.out.count(first) == 1
    assert said.code == call(*COMMANDS["predict"]).code
