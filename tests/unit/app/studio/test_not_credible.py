"""A stage that is not credible says so, and so does whatever rests on it: stages above at any depth, and what is run on them."""

from __future__ import annotations

import html
import re
import time
from pathlib import Path

import pytest

from planted import campaign
from thermid.app.studio.courses import outcome_object
from thermid.app.studio.project import Project
from thermid.app.studio.work import Work
from thermid.campaign.stages import Campaign
from thermid.reporting.pages import report

pytestmark = pytest.mark.usefixtures("values_alone")

NOT_CREDIBLE = "not credible"


def idle(work: Work) -> None:
    while not work.state()["ended"]:
        time.sleep(0.005)


@pytest.fixture(scope="module")
def work(tmp_path_factory: pytest.TempPathFactory) -> Work:
    """Three levels whose first one is planted wrong: its sensor reads 4 K too much and is said to be good to 0.1 K."""
    made = Work(Project(campaign(tmp_path_factory.mktemp("doubt"), planted=True)))
    idle(made)
    made.run("whole", below=True)
    idle(made)
    return made


def test_a_stage_that_is_not_credible_says_so_and_whatever_rests_on_it(work: Work) -> None:
    states = work._project.states
    assert [s.state for s in states.values()] == ["done", "done", "done"]
    assert [s.standing for s in states.values()] == ["not credible"] * 3
    assert not any(s.usable for s in states.values())
    assert re.search(r"NOT CREDIBLE: T_LAB .* -3\.07 K, 15 .* 0\.2 K", states["part"].because)
    for above in ("pair", "whole"):  # 'whole' takes a value of 'pair' alone, and rests on 'part' two levels below
        assert all(part in states[above].because for part in ("NOT CREDIBLE", "'part' (T_LAB", "-3.07 K, 15", "0.2 K"))
        assert not work._project.done[above].contradicted


def test_what_is_run_on_such_values_decides_nothing(work: Work) -> None:
    work.scenario("whole", "record 0", {}, {})
    idle(work)
    assert work.outcome is not None
    verdict = outcome_object(work.outcome)["verdict"]
    assert verdict["word"] == "not decided"
    assert all(part in verdict["text"] for part in ("NOT CREDIBLE, so do not use", "'part' (T_LAB"))


def test_a_report_of_them_says_so_at_every_place_that_would_recommend_them(work: Work, tmp_path: Path) -> None:
    """At its head, under the stage's name beside its small RMSE, over its column of the levels, and in what to do next."""
    project = work._project
    made = Campaign(project.title, dict(project.done), (), {n: n for n in project.stages})
    page = html.unescape(report(made, to=tmp_path / "page.html").read_text(encoding="utf-8"))
    for stage in project.stages:
        assert f"✗ {stage} is not credible" in page
        assert f"Do not use {stage}: " in page
        assert f"{stage} (not credible)</th>" in page
    assert page.count(">not credible</tspan>") == 3
    assert re.search(r"Do not use whole: [^'<]*'part' \(T_LAB .*-3\.07 K", page)


def test_its_mending_is_seen_by_whatever_rests_on_it(work: Work) -> None:
    project = work._project
    text = project.path.read_text(encoding="utf-8")
    project.path.write_text(text.replace('"0.1 [K]"', '"3 [K]"'), encoding="utf-8")
    work.fresh()
    assert [s.state for s in project.states.values()] == ["stale", "waiting", "waiting"]
    work.run("pair", below=True)
    idle(work)
    assert [(s.state, s.usable) for s in project.states.values()][:2] == [("done", True)] * 2
    assert project.states["whole"].state != "done"
    project.path.write_text(text, encoding="utf-8")
