"""What Correlate and Watch are told: a stopped fit's best values, what a value moves, what a record is given, kept states, a fan."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from by_code import raises_code
from thermid.app.studio.desk import curves_object
from thermid.app.studio.follow import Follower
from thermid.app.studio.project import Project
from thermid.app.studio.room import picture
from thermid.app.studio.work import JobState, Work
from thermid.base.errors import DeckError, NameNotFoundError
from thermid.base.units import from_si, unit
from unit.app.studio.test_live import warm, write

pytestmark = pytest.mark.usefixtures("values_alone")


@pytest.fixture(scope="module")
def project(run_before: Callable[[], Project]) -> Project:
    made = run_before()
    made.judge(write=True)
    return made


def test_a_fit_that_is_stopped_keeps_the_best_values(project: Project, monkeypatch: pytest.MonkeyPatch) -> None:
    work = Work(project)
    work.wait()
    plain = JobState.tell

    def stopped(job: JobState, count: int, rms: float) -> None:
        if len(job.path) == 3:
            work.stop()
        plain(job, count, rms)

    monkeypatch.setattr(JobState, "tell", stopped)
    free = tuple(s.path for s in project.desk("whole").sliders if s.free)
    work.fit("whole", {p: 0.5 * s.value for s in project.desk("whole").sliders for p in free if p == s.path}, free)
    work.wait()
    state = work.state()
    assert (state["error"], state["ended"]) == ("", True)
    assert set(state["result"]["values"]) >= set(free)
    assert "stopped by the user" in " ".join([*state["result"]["warnings"], state["result"]["text"]])
    assert [count for count, _ in state["path"]] == sorted(count for count, _ in state["path"])


def test_a_fit_goes_on_to_its_end_once_it_was_stopped() -> None:
    job = JobState("fit", "whole", keeps=True, stopped=True)
    with pytest.raises(KeyboardInterrupt):
        job.tell(3, 1.0)
    job.tell(4, 1.0)  # what is told of the errors of its values
    assert job.path == [(3, 1.0), (4, 1.0)]


def test_what_a_value_moves_is_its_slope(project: Project) -> None:
    desk = project.desk("whole")
    path = next(s for s in desk.sliders if s.free)
    moved = desk.moves(path.path, {}, 0)
    before, after = (desk.curves({path.path: path.value * f})[0].curves[0] for f in (1.0, 1.02))
    largest = 0.5 * np.max(np.abs(after.simulated - before.simulated))
    assert set(moved) == {c.name for c in desk.curves({})[0].curves}
    assert abs(moved[before.name]) == pytest.approx(largest, rel=0.05)


def test_a_record_is_shown_with_what_it_was_given(project: Project) -> None:
    desk = project.desk("whole")
    given = {c.node: c for c in desk.inputs_of(0)}
    scenario = desk.problem.experiments[0].scenario  # type: ignore[union-attr]
    assert {f"W {n}" for n in scenario.loads} <= set(given)
    for name, signal in scenario.loads.items():
        course = given[f"W {name}"]
        assert np.ptp(course.simulated) == pytest.approx(np.ptp(signal.at(course.times)), rel=0.05)
    for name in desk.boundaries:
        assert np.isfinite(given[name].simulated).all()


def test_one_run_and_few_points_are_the_same_curves(project: Project) -> None:
    """The page asks for the record that it shows, in as many points as a tile has."""
    desk = project.desk("pair")
    whole = desk.curves({})
    (one,) = desk.curves({}, None, (1,), 60)
    assert one.name == whole[1].name
    for few, many in zip(one.curves, whole[1].curves, strict=True):
        assert few.rmse == many.rmse
        assert few.sigma == many.sigma > 0.0
        assert few.times.size <= 60
        assert np.isin(few.times, many.times).all()
        assert (np.min(few.left), np.max(few.left)) == (np.min(many.left), np.max(many.left))
    assert len(curves_object(desk, {}, runs=(0,))["runs"]) == 1


def test_a_kept_file_is_a_state_to_compare_with(project: Project) -> None:
    assert "whole.values.toml" in project.kept_files()
    kept = project.kept_values("whole", "whole.values.toml")
    fit = project.done["whole"].values
    free = [s.path for s in project.desk("whole").sliders if s.free]
    assert {p: kept[p] for p in free} == pytest.approx({p: fit[p].value for p in free}, rel=1e-6)
    with raises_code("name.unknown", NameNotFoundError):
        project.kept_values("whole", "../whole.toml")


def test_a_row_knows_its_prior_and_its_deck(project: Project) -> None:
    found = 0
    for name in project.stages:
        desk = project.desk(name)
        unknowns = {u.name: u for u in desk.problem.unknowns}  # type: ignore[union-attr]
        for s in desk.sliders:
            u = unknowns.get(s.path)
            assert np.isfinite(s.deck)
            if u is None or u.prior is None:
                assert s.prior == ()
                continue
            found += 1
            assert from_si(u.to_value(u.prior.mean), unit(s.unit)) == pytest.approx(
                float(np.sqrt(np.prod(s.prior))) if u.log else np.mean(s.prior)
            )
    assert found


def test_the_map_is_a_table_too(project: Project) -> None:
    desk = project.desk("whole")
    table = picture(desk, {}, {"time": 3000.0})["table"]
    now = desk.moment({}, 0, 3000.0)
    assert table["temperatures"] == pytest.approx({n: v - 273.15 for n, v in now.temperatures.items()})
    assert table["flows"] == now.flows
    with pytest.raises(DeckError):
        picture(desk, {}, {"time": 3000.0, "run": 9})


def test_a_forecast_has_a_fan_that_ends_at_it(tmp_path: Path) -> None:
    (tmp_path / "thermid.toml").write_text("", encoding="utf-8")
    write(tmp_path / "run.csv", warm(2700.0), 3)
    asked: dict[str, Any] = {"file": "run.csv", "slowest": 0.3}
    for channel in Follower(tmp_path).look(asked)["channels"]:
        told, fan = channel["forecast"], channel["forecast"]["fan"]
        assert fan["times"][0] == pytest.approx(2700.0)
        assert 0.2 * 2700.0 < fan["times"][-1] - 2700.0 <= 2.0 * 2700.0
        assert np.all(fan["low"] < fan["value"])
        assert np.all(fan["value"] < fan["high"])
        assert abs(told["final"] - fan["value"][-1]) < abs(told["final"] - fan["value"][0])
    declined = Follower(tmp_path).look({"file": "run.csv", "slowest": 1.0})["channels"][0]["forecast"]
    assert declined["final"] is None
    assert declined["fan"] == {}


def test_a_limit_that_is_not_decided_keeps_a_test_going(tmp_path: Path) -> None:
    (tmp_path / "thermid.toml").write_text("", encoding="utf-8")
    write(tmp_path / "run.csv", warm(2700.0), 3)
    free = Follower(tmp_path).look({"file": "run.csv", "slowest": 0.3})
    end = free["watch"]["ends"]["chip"]["final_C"]
    held = Follower(tmp_path).look({"file": "run.csv", "slowest": 0.3, "limits": f"chip={end:.2f}"})
    assert (free["watch"]["advice"], held["watch"]["advice"]) == ("stop", "declined")
    assert re.search(rf"^chip .* chip<{end:.0f} degC: ", held["watch"]["because"])
