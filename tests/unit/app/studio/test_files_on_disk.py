"""A file that its author changes is noticed and used, one that is broken is said, and a mended one works, without a new start."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import pytest

import thermid as td
from by_code import raises_code
from planted import campaign
from thermid.app.studio.project import Project, Watch
from thermid.app.studio.work import Work
from thermid.base.errors import ThermidError

pytestmark = pytest.mark.usefixtures("values_alone")


@pytest.fixture(scope="module")
def made(run_before: Callable[[], Project]) -> tuple[Project, Work]:
    """Three levels, all of them run, in a studio without its page."""
    project = run_before()
    work = Work(project)
    idle(work)
    assert states(project) == ["done", "done", "done"]
    return project, work


def idle(work: Work) -> None:
    end = time.monotonic() + 600.0
    while not work.state()["ended"] or (work._thread is not None and work._thread.is_alive()):
        assert time.monotonic() < end
        time.sleep(0.005)


def states(project: Project) -> list[str]:
    return [project.states[n].state for n in project.stages]


def changed(file: Path, old: str, new: str) -> None:
    text = file.read_text(encoding="utf-8")
    assert old in text
    file.write_text(text.replace(old, new), encoding="utf-8")


def test_a_changed_deck_is_stale_and_used(made: tuple[Project, Work]) -> None:
    project, work = made
    deck, before = project.path.parent / "pair.toml", work.fresh()
    assert work.fresh() == before  # nothing was written, so nothing moves
    changed(deck, '"1200 [J/K]"', '"1300 [J/K]"')
    after = work.fresh()  # at the next look, and the page looks every second
    assert states(project) == ["done", "stale", "waiting"]
    assert after["part"] == before["part"]  # a page that shows it need not draw it anew
    assert after["pair"] != before["pair"]
    slider = next(s for s in project.desk("pair").sliders if s.path == "plate.capacitance")
    assert slider.value == pytest.approx(1300.0)
    changed(deck, '"1300 [J/K]"', '"1200.5 [J/K]"')
    work.run("whole", below=True)  # without a look in between: what runs is what lies on the disk
    idle(work)
    assert states(project) == ["done", "done", "done"]
    for model in (project.done["pair"].model, project.done["whole"].model.submodels["pair"].model):
        assert model.nodes["plate"] == td.load_model(deck).nodes["plate"]


def test_a_broken_deck_is_said_and_a_mended_one_works(made: tuple[Project, Work]) -> None:
    project, work = made
    deck = project.path.parent / "pair.toml"
    changed(deck, "[nodes]", "[nodess]")
    work.fresh()
    assert states(project) == ["done", "failed", "waiting"]
    assert "nodess: 'nodess' " in project.states["pair"].why
    with pytest.raises(ThermidError, match="nodess"):
        project.desk("pair")
    changed(deck, "[nodess]", "[nodes]")
    work.fresh()
    assert states(project) == ["done", "done", "done"]
    assert project.desk("pair").curves({})


def test_a_broken_campaign_is_said_and_a_mended_one_works(made: tuple[Project, Work]) -> None:
    project, work = made
    changed(project.path, 'title = "three levels"', 'title = "three levels')
    work.fresh()
    assert states(project) == ["failed", "failed", "failed"]
    assert "campaign.toml" in project.states["part"].why
    changed(project.path, 'title = "three levels', 'title = "three levels"')
    work.fresh()
    assert states(project) == ["done", "done", "done"]


def test_a_wrong_unit_is_said_before_the_stage_is_run_and_by_those_above(made: tuple[Project, Work]) -> None:
    """Its stage was called stale, and the one above said to run a stage that cannot run."""
    project, work = made
    deck = project.path.parent / "pair.toml"
    changed(deck, '"1200.5 [J/K]"', '"1200 [W]"')
    work.fresh()
    assert states(project) == ["done", "failed", "waiting"]
    assert "'[W]' " in project.states["pair"].why
    with raises_code("campaign.not-run", match=r"'\[W\]' "):
        project.desk("whole")
    changed(deck, '"1200 [W]"', '"1200.5 [J/K]"')
    work.fresh()
    assert states(project) == ["done", "done", "done"]


def test_a_deck_that_is_missing_for_a_while_is_found_again(made: tuple[Project, Work]) -> None:
    project, work = made
    deck = project.path.parent / "part.toml"
    text = deck.read_text(encoding="utf-8")
    deck.unlink()
    work.fresh()
    assert project.states["part"].state == "failed"
    deck.write_text(text, encoding="utf-8")
    work.fresh()
    assert states(project) == ["done", "done", "done"]


def test_a_changed_log_and_a_new_stage_are_noticed(made: tuple[Project, Work]) -> None:
    project, work = made
    log = project.path.parent / "whole.csv"
    text = log.read_text(encoding="utf-8")
    log.write_text("\n".join(text.splitlines()[:-5]) + "\n", encoding="utf-8")
    work.fresh()
    assert states(project) == ["done", "done", "stale"]
    log.write_text(text, encoding="utf-8")
    changed(project.path, 'name = "whole"', 'name = "all"')
    work.fresh()
    assert project.stages == ("part", "pair", "all")
    changed(project.path, 'name = "all"', 'name = "whole"')
    work.fresh()
    assert states(project) == ["done", "done", "done"]


def test_a_deck_alone_is_followed_too(tmp_path: Path) -> None:
    file = campaign(tmp_path).parent / "part.toml"
    project = Project(file)
    work = Work(project)
    idle(work)
    first = project.desk("part").curves({})[0].curves[0].simulated[-1]
    changed(file, '"6 [W]"', '"7 [W]"')
    work.fresh()
    assert project.desk("part").curves({})[0].curves[0].simulated[-1] > first + 0.5
    changed(file, "[loads]", "[loadss]")
    work.fresh()
    assert project.states["part"].state == "failed"
    changed(file, "[loadss]", "[loads]")
    changed(file, 'title  = "part"', 'title  = "piece"')
    work.fresh()
    assert project.desk("piece").curves({})[0].curves[0].simulated[-1] > first + 0.5


def test_what_a_named_deck_names_is_watched_and_every_log_of_a_pattern(tmp_path: Path) -> None:
    """A part two folders down is found through the deck that uses it alone."""
    unit, part = tmp_path / "decks" / "units" / "unit.toml", tmp_path / "decks" / "units" / "parts" / "part.toml"
    part.parent.mkdir(parents=True)
    (tmp_path / "logs").mkdir()
    (tmp_path / "campaign.toml").write_text('model = "decks/units/unit.toml"\nfile = "logs/*.csv"\n')
    unit.write_text('use = "parts/part.toml"\n')
    part.write_text('title = "part"\n')
    watch = Watch(tmp_path / "campaign.toml", (), tmp_path / "out")
    assert watch.changed() == frozenset()
    part.write_text('title = "another part"\n')
    (tmp_path / "logs" / "new.csv").write_text("1\n")
    assert watch.changed() == {part, tmp_path / "logs" / "new.csv"}
