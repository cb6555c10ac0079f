"""Stages of a campaign in the studio: new, done, stale, and what a run, a fit and a swap make of them."""

from __future__ import annotations

import runpy
import shutil
import sys
from pathlib import Path

import pytest

import thermid as td
from by_code import raises_code
from planted import campaign
from thermid.app.studio.project import Project
from thermid.base.errors import DeckError, IdentificationError, NameNotFoundError

pytestmark = pytest.mark.usefixtures("values_alone")

EXAMPLES = Path(__file__).parents[4] / "examples"


def laid(root: Path) -> Path:
    """The campaign of example 04 with its decks and logs."""
    for name in ("02_stack", "04_campaign"):
        shutil.copytree(EXAMPLES / name, root / name, ignore=shutil.ignore_patterns("logs", "results", "__pycache__"))
    shutil.copy(EXAMPLES / "thermid.toml", root)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["make_logs.py", str(root / "04_campaign" / "logs")])
        runpy.run_path(str(root / "04_campaign" / "make_logs.py"), run_name="__main__")
    return root / "04_campaign"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The campaign with its stages run."""
    made = laid(tmp_path_factory.mktemp("studio"))
    project = opened(made)
    for name in project.stages:
        project.run(name)
    return made


def opened(folder: Path) -> Project:
    project = Project(folder / "campaign.toml")
    for name in project.stages:
        project.look(name)
    return project


def states(project: Project) -> list[str]:
    return [project.states[n].state for n in project.stages]


def test_a_campaign_is_run_kept_and_found_again(tmp_path: Path) -> None:
    folder = laid(tmp_path)
    project = opened(folder)
    assert states(project) == ["new", "new", "waiting"]
    with raises_code("campaign.not-run", DeckError, match="m_PrE.*'ProcSISNAV'"):
        project.run("m_PrE")
    for name in project.stages:
        assert project.run(name).state == "done"
    again = opened(folder)
    assert states(again) == ["done", "done", "done"]
    whole = td.run_stages(folder / "campaign.toml", cache=folder / "results")
    for name in again.stages:
        assert {p: v.value for p, v in again.done[name].values.items()} == {p: v.value for p, v in whole[name].values.items()}
    table = again.table()
    shown = {row[1].text: dict(zip((c.title for c in table.columns[3:]), row[3:], strict=True)) for row in table.rows}
    for part, values in whole.table("effective_htc").items():
        if (last := values.get("m_PrE")) is not None:
            assert float(shown[f"{part}.effective_htc"]["stage m_PrE"].text.split(" ±")[0]) == pytest.approx(last, rel=2e-3)


def test_a_folder_is_answered_with_what_lies_in_it(folder: Path, tmp_path: Path) -> None:
    with raises_code("file.not-a-file", DeckError, match=r".*campaign\.toml"):
        Project(folder)
    with raises_code("file.not-a-file", DeckError):
        Project(tmp_path)


def test_curves_show_the_residuals_of_the_fit(folder: Path) -> None:
    project = opened(folder)
    fitted = project.done["m_PrE"].statistics
    for run in project.desk("m_PrE").curves({}):
        for curve in run.curves:
            assert curve.rmse == fitted[run.name][curve.name].rmse
            assert curve.largest == abs(fitted[run.name][curve.name].largest)
            assert curve.measured.size > 100


def test_a_fit_from_moved_sliders_comes_back(folder: Path) -> None:
    project = opened(folder)
    desk = project.desk("EleGFO")
    free = tuple(s.path for s in desk.sliders if s.free)
    moved = {s.path: 1.3 * s.value for s in desk.sliders if s.free}
    worse = desk.curves(moved)[0].curves[0].rmse
    found = project.fit("EleGFO", moved, free)
    for path in free:
        kept = project.done["EleGFO"].values[path]
        assert found.values[path].value == pytest.approx(kept.value, abs=0.05 * kept.error)
    assert worse > 5 * desk.curves({})[0].curves[0].rmse
    with raises_code("fit.nothing-free", IdentificationError):
        project.fit("EleGFO", {}, ())


def test_a_changed_deck_makes_its_stage_and_those_above_stale(folder: Path) -> None:
    deck = folder.parent / "02_stack" / "EleGFO.toml"
    before = deck.read_text(encoding="utf-8")
    assert "960" in before
    deck.write_text(before.replace("960", "961", 1), encoding="utf-8")
    project = opened(folder)
    deck.write_text(before, encoding="utf-8")
    assert states(project) == ["done", "stale", "waiting"]
    assert project.states["EleGFO"].why.endswith(": deck")


def test_running_a_lower_stage_again_makes_the_upper_one_stale(folder: Path) -> None:
    project = opened(folder)
    project.run("EleGFO")
    assert states(project) == ["done", "done", "stale"]
    project.look("m_PrE")
    assert states(project) == ["done", "done", "done"]  # the same values came out, so its key holds


def test_a_swap_lists_stages_and_stays_in_the_project(folder: Path) -> None:
    project = opened(folder)
    with raises_code("file.outside-project", match=r"'\.\./\.\./\.\./\.\./etc/passwd'"):
        project.swap("ele", "../../../../etc/passwd")
    with raises_code("name.unknown", NameNotFoundError, match="'m_PrF'"):
        project.desk("m_PrF")


def test_a_stage_tuned_by_hand_needs_no_run_and_shows_its_values(tmp_path: Path) -> None:
    file = campaign(tmp_path)
    (tmp_path / "bench.toml").write_text('"foot_x.conductance" = "0.9 [W/K]"\n', encoding="utf-8")
    hand = '[[stages]]\nname = "by hand"\nmodel = "pair.toml"\nvalues = "bench.toml"\n\n[[stages]]\nname = "whole"'
    text = file.read_text(encoding="utf-8").replace('[[stages]]\nname = "whole"', hand)
    file.write_text(text, encoding="utf-8")
    project = opened(tmp_path)
    assert dict(zip(project.stages, states(project), strict=True))["by hand"] == "done"
    desk = project.desk("by hand")
    assert next(s.value for s in desk.sliders if s.path == "foot_x.conductance") == pytest.approx(0.9)
    (run,) = desk.curves({})
    model = td.load_model(tmp_path / "pair.toml").with_values({"foot_x.conductance": "0.9 [W/K]"})
    there = td.simulate(model, desk.scenarios[0])
    assert {c.name: c.simulated[-1] for c in run.curves} == pytest.approx({n: there[n].final for n in desk.nodes}, abs=1e-9)
    assert "foot_x" in desk.moment({}, 0, 100.0).drawn()
