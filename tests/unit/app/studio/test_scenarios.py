"""Scenarios of the studio: the library's own profiles and limits, the worst part named, an end to a run, names that are no script."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.app.studio.courses import outcome_object, profile_for, profile_object
from thermid.app.studio.desk import window_of
from thermid.app.studio.project import Project
from thermid.app.studio.room import as_json, shelf_object
from thermid.app.studio.work import Work
from thermid.base.errors import DeckError, NameNotFoundError, RecordError, ScenarioError
from thermid.campaign.stages import check_limits, load_limits

EVIL = '"><script>alert(1)</script>'
DECK = """
title = "unit"
needs = ["air"]

[nodes]
plate = { capacitance = "900 [J/K]" }
core  = { capacitance = "1500 [J/K]", reference_point = true }

[surfaces]
skin = { of = "plate", to = "air", area = "0.12 [m^2]", htc = "8 [W/(m^2 K)]", emissivity = 0.8 }

[conductors]
foot = { kind = "conduction", between = ["core", "plate"], conductance = "1.2 [W/K]" }

[loads]
chips = { into = "core", power = "6 [W]" }
"""
LIMITS = """
[core]
node          = "core"
operating     = ["-30 [degC]", "60 [degC]"]
non_operating = ["-50 [degC]", "90 [degC]"]
start_up      = ["-30 [degC]", "50 [degC]"]
loads         = ["chips"]

[elsewhere]
node      = "no.such.node"
operating = ["0 [degC]", "1 [degC]"]
"""
CYCLE: dict[str, Any] = {"lowest": -5, "highest": 45, "numbers": {"cycles": "1"}, "base": "plate"}
KEY = "SMC-S-016 unit thermal cycle, acceptance"


@pytest.fixture(scope="module")
def work(tmp_path_factory: pytest.TempPathFactory) -> Work:
    root = tmp_path_factory.mktemp("scenarios")
    (root / "unit.toml").write_text(DECK, encoding="utf-8")
    (root / "limits.toml").write_text(LIMITS, encoding="utf-8")
    own = f"[profile]\nlike = 'SMC-S-016 unit thermal cycle'\nlevel = 'acceptance'\ntitle = '''{EVIL}'''\ncycles = 1\n"
    (root / "own.toml").write_text(own, encoding="utf-8")
    made = Work(Project(root / "unit.toml"))
    ended(made)
    return made


def ended(work: Work) -> dict[str, Any]:
    for _ in range(2000):
        state = work.state()
        if state["ended"]:
            return state
        time.sleep(0.01)
    pytest.fail(f"it never ended: {state}")


def ran(work: Work, key: str, asked: dict[str, Any], values: dict[str, float] | None = None) -> dict[str, Any]:
    work.scenario("unit", key, values or {}, asked)
    state = ended(work)
    assert state["error"] == ""
    assert work.outcome is not None
    return outcome_object(work.outcome)


def test_a_profile_runs_as_the_library_runs_it(work: Work) -> None:
    found = ran(work, KEY, CYCLE)
    model = td.load_model(work.shelf.folder / "unit.toml")
    profile = td.qualify.profile_of("SMC-S-016", "unit thermal cycle", level="acceptance", predicted=("-5 [degC]", "45 [degC]"), cycles=1)
    run = td.qualify.run_profile(model, profile, base="plate")
    assert found["duration"] == run.duration
    assert found["waited"] == run.waited
    assert [p["name"] for p in found["phases"]] == [p.name for p in run.phases]
    core = next(c for c in found["curves"] if c["name"] == "core")
    assert max(core["values"]) == run["core"].highest
    limits = [one for one in load_limits(work.shelf.folder / "limits.toml") if one.node == "core"]
    checks = check_limits(run.solution, limits)
    assert [(c["state"], c["room"]) for c in found["checks"]] == [(c.state, c.room) for c in checks]
    assert found["worst"]["room"] == min(c.room for c in checks)


def test_the_worst_part_state_and_time_are_said(work: Work) -> None:
    found = ran(work, KEY, CYCLE)
    assert found["verdict"]["word"] == "passed a limit"
    assert "core (core), start-up" in found["verdict"]["text"]
    assert "50 °C" in found["verdict"]["text"]
    (point,) = found["points"]  # a point of another model is no point of this one
    assert {s["state"] for s in point["spans"]} == {"operating", "non-operating", "start-up"}
    off = [s for s in point["spans"] if s["state"] == "non-operating"]
    assert len(off) == sum(p["kind"] == "off" and p["name"].endswith("off") for p in found["phases"])


def passed_limits(found: dict[str, Any]) -> set[tuple[str, str]]:
    """Return point and state of every drawn limit that its curve passes, from the numbers that the chart draws."""
    out = set()
    for point in found["points"]:
        times, values = next((np.array(c["times"]), np.array(c["values"])) for c in found["curves"] if c["name"] == point["node"])
        for span in point["spans"]:
            at = np.unique([span["from"], span["to"], *times[(times >= span["from"]) & (times <= span["to"])]])
            curve, (low, high) = np.interp(at, times, values), span["limits"]
            if (low is not None and curve.min() < low - 1e-6) or (high is not None and curve.max() > high + 1e-6):
                out.add((point["point"], span["state"]))
    return out


@pytest.mark.parametrize(
    ("key", "asked", "word"),
    [("scenario 0", {}, "kept"), (KEY, CYCLE, "passed a limit"), (KEY, {**CYCLE, "highest": 75}, "passed a limit")],
)
def test_no_curve_passes_a_drawn_limit_unless_its_check_says_so(work: Work, key: str, asked: dict[str, Any], word: str) -> None:
    found = ran(work, key, asked)
    said = {(c["point"], c["state"]): c["passed"] for c in found["checks"]}
    assert passed_limits(found) == {state for state, passed in said.items() if passed is False}
    assert bool(passed_limits(found)) is (word == "passed a limit")
    assert found["verdict"]["word"] == word
    assert found["points"]


def test_sliders_reach_the_run(work: Work) -> None:
    cooler = ran(work, "scenario 0", {}, {"skin.area": 0.3})
    warmer = ran(work, "scenario 0", {})
    ends = [next(c for c in found["curves"] if c["name"] == "core")["values"][-1] for found in (cooler, warmer)]
    assert ends[0] < ends[1] - 1.0
    assert warmer["verdict"]["word"] == "kept"


def test_vacuum_is_run(work: Work) -> None:
    thin = ran(work, "scenario 0", {"gas": "vacuum"})
    thick = ran(work, "scenario 0", {})
    assert thin["worst"]["highest"] > thick["worst"]["highest"] + 1.0


@pytest.mark.campaign
def test_humidity_is_run(work: Work) -> None:
    wet = ran(work, "SMC-S-016 unit humidity", {})
    assert wet["moisture"]["dew"][0]["name"] == "dew point of air"
    (skin,) = wet["moisture"]["surfaces"]
    assert ("Water condenses: worst skin" in wet["verdict"]["text"]) == (skin["margin"] < 0.0)
    assert "skin" in wet["verdict"]["text"]


def test_a_profile_tells_how_far_it_is() -> None:
    said: list[tuple[int, int, float]] = []
    deck = {"title": "block", "needs": ["air"], "nodes": {"block": {"capacitance": "50 [J/K]"}}}
    deck["conductors"] = {"film": {"kind": "conduction", "between": ["block", "air"], "conductance": "2 [W/K]"}}
    profile = td.qualify.profile_of("SMC-S-016", "unit thermal cycle", level="acceptance", cycles=1)
    run = td.qualify.run_profile(td.model_from_dict(deck), profile, progress=lambda *so_far: said.append(so_far))
    assert [k for k, _, _ in said] == list(range(1, len(profile.steps) + 1))
    assert said[-1][2] == run.duration


def test_a_window_is_shown_with_every_sample_in_it(work: Work) -> None:
    ran(work, KEY, CYCLE)
    assert work.outcome is not None
    whole = outcome_object(work.outcome)["curves"][0]
    part = outcome_object(work.outcome, (3600.0, 7200.0))["curves"][0]
    stored = work.outcome.solution.times
    assert set(stored[(stored >= 3600.0) & (stored <= 7200.0)]) <= set(part["times"])
    assert whole["times"].size <= 1202


def test_a_run_can_be_stopped_and_another_begun(work: Work) -> None:
    before = work.outcome
    work.scenario("unit", "SMC-S-016 unit thermal cycle, qualification", {}, {"base": "plate", "numbers": {"cycles": "200"}})
    state = work.stop()
    assert state["ended"]
    assert "was stopped" in state["error"]
    assert work.outcome is before
    assert ran(work, "scenario 0", {})["verdict"]["word"] == "kept"


def test_every_profile_of_the_library_is_offered_and_described(work: Work) -> None:
    desk = work._project.desk("unit")
    offered = shelf_object(work.shelf, desk)
    keys = {c["key"] for c in offered["courses"]}
    for standard, profiles in td.qualify.profile_names().items():
        for name, levels in profiles.items():
            assert {f"{standard} {name}{f', {v}' if v else ''}" for v in levels or ("",)} <= keys
    for c in offered["courses"]:
        if c["kind"] == "profile":
            told = profile_object(profile_for(work.shelf.course(desk, c["key"]), {"lowest": -5, "highest": 45}))
            assert told["numbers"], c["key"]
    assert offered["limits"] == ["core"]
    assert offered["source"] == "limits.toml"


def test_a_hostile_title_stays_text(work: Work) -> None:
    desk = work._project.desk("unit")
    text = as_json(shelf_object(work.shelf, desk))
    assert "alert(1)" in text
    assert "<script" not in text
    found = ran(work, "profile own.toml", {"lowest": -5, "highest": 45})
    assert found["title"].startswith(EVIL)


@pytest.mark.parametrize(
    ("key", "asked", "error", "code", "match"),
    [
        ("SMC-S-016 unit thermal cycel", {}, NameNotFoundError, "name.unknown", "run '"),
        ("profile ../../secret.toml", {}, NameNotFoundError, "name.unknown", "run '"),
        (KEY, {"lowest": -5}, ScenarioError, "value.incomplete", ""),
        (KEY, {"numbers": {"cycles": 3}}, ScenarioError, "value.wrong-kind", ""),
        (KEY, {"numbers": {"cicles": "3"}}, ScenarioError, "name.unknown", "'cicles'"),
        (KEY, {"numbers": {"stable": "soon"}}, RecordError, "value.wrong-kind", ""),
        (KEY, {"chamber": ["engine"]}, ScenarioError, "name.unknown", "'engine' is not a boundary"),
        ("scenario 0", {"gas": "soup"}, ScenarioError, "name.unknown", "'soup' is not one of air"),
        ("scenario 0", {"uncertain": True}, ScenarioError, "studio.not-now", ""),
    ],
)
def test_what_cannot_be_run_is_said(work: Work, key: str, asked: dict[str, Any], error: type[Exception], code: str, match: str) -> None:
    from thermid.app.studio.courses import run_course

    desk = work._project.desk("unit")
    with raises_code(code, error, match=match):
        run_course(work.shelf, desk, work.shelf.course(desk, key), {}, asked, lambda *_: None)


def test_a_window_is_two_times() -> None:
    assert window_of({}) is None
    assert window_of({"window": [0, 5]}) == (0.0, 5.0)
    for bad in ([5, 0], [1], "all", ["a", "b"]):
        with raises_code("value.wrong-kind", DeckError):
            window_of({"window": bad})
    assert np.isfinite(window_of({"window": [0, 5]}) or ()).all()


@pytest.mark.campaign
def test_a_plans_test_is_predicted_with_margins() -> None:
    plan = Path(__file__).parents[4] / "examples" / "sisnav" / "qualification"
    work = Work(Project(plan / "decks" / "m_Sd.toml"))
    ended(work)
    key = "test sisnav/qualification/plan.toml ascent"
    work.scenario("m_Sd", key, {}, {})
    assert ended(work)["error"] == ""
    assert work.outcome is not None
    found = outcome_object(work.outcome)
    assert found["source"] == "plan.toml"
    assert {m["point"] for m in found["margins"]} == {"ProcSISNAV", "EleGFO", "FOG_x", "FOG_y", "Acc_x"}
    assert any(m["uncertainty"] > 0.0 for m in found["margins"])
    assert {len(c["band"]) for c in found["curves"] if "band" in c} == {len(found["curves"][0]["band_times"])}
    assert found["worst"]["point"] in {c["point"] for c in found["checks"]}
