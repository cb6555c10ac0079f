"""Plans: what is refused, what is hashed, and what is said when a plan changes after a log was looked at."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

import thermid as td
from by_code import raises_code
from thermid.base.errors import DeckError, NameNotFoundError, ScenarioError
from thermid.qualify._plan import load_plan, note_look
from thermid.qualify._programme import run_plan
from unit.qualify.project import PLAN, measured, project, with_log


@pytest.mark.parametrize(
    ("text", "error", "code", "match"),
    [
        ("", DeckError, "plan.incomplete", r"plan\.toml.*\[model\].*\[limits\]"),
        ('title = "x"\n', DeckError, "plan.incomplete", r"plan\.toml"),
        (PLAN.replace('kind = "on-board"', 'kind = "onboard"'), DeckError, "file.wrong-value", "'on-board'.*'other'"),
        (PLAN.replace('criteria = ["ECSS", "ours"]', 'criteria = ["ECS"]'), NameNotFoundError, "name.unknown", "'ECSS'"),
        (PLAN.replace('sensors = ["T_PROC"]', 'sensors = ["T_PROK"]'), NameNotFoundError, "name.unknown", "'T_PROC'"),
        (
            PLAN.replace('scenario = { boundaries = { air = "10', 'host = "bus"\nscenario = { boundaries = { air = "10'),
            NameNotFoundError,
            "name.unknown",
            "'bus'",
        ),
        (
            PLAN.replace('["-20 [degC]", "70 [degC]"]', '["70 [degC]", "-20 [degC]"]'),
            ScenarioError,
            "value.outside-range",
            r"'processor'.*-20\.0",
        ),
        (PLAN.replace('deck = "unit.toml"', 'deck = "unit.toml"\nstage = "x"'), DeckError, "value.incomplete", r"plan\.toml:6"),
        (PLAN.replace('name = "experiment on board"', 'name = "hot"'), DeckError, "name.taken", r"plan\.toml:27.*tests\.0\.name.*'hot'"),
        (
            with_log(PLAN).replace('steady = [["5 [h]", "6 [h]"]]\n', ""),
            DeckError,
            "value.without-effect",
            "'ECSS'.*'hot'",
        ),
        (PLAN.replace('reason = "hottest"', 'reason = " "'), DeckError, "value.incomplete", "'T_PROC'"),
        (
            PLAN.replace("cap = 0.5", 'cap = 0.5\nreasons = { T_PROX = "?" }'),
            NameNotFoundError,
            "name.unknown",
            "'T_PROX'",
        ),
        (
            PLAN.replace('"5 [h]", "6 [h]"', '"6 [h]", "5 [h]"'),
            DeckError,
            "value.outside-range",
            r'plan\.toml:31.*tests\.0\.steady.*\["4 \[h\]',
        ),
        (
            PLAN.replace("[exclusions]", '[validity]\npower = ["3 [W]"]\n[exclusions]'),
            DeckError,
            "value.outside-range",
            r"plan\.toml:24.*validity\.power.*\['3 \[W\]",
        ),
        (
            PLAN.replace("[exclusions]", '[validity]\npower = ["3 [W]", "1 [W]"]\n[exclusions]'),
            DeckError,
            "value.outside-range",
            r"plan\.toml:24.*validity\.power.*\['3 \[W\]",
        ),
        (
            PLAN.replace('kind = "on-board"', 'kind = "on-board"\nstate = "waived"'),
            DeckError,
            "value.incomplete",
            r"plan\.toml:36.*tests\.1\.state.*'experiment on board'",
        ),
        (PLAN.replace("[exclusions]", '[margins]\npolicy = "SMC"\n[exclusions]'), NameNotFoundError, "name.unknown", "'SMC'"),
    ],
)
def test_what_is_no_plan_is_refused(tmp_path: Path, text: str, error: type[Exception], code: str, match: str) -> None:
    with raises_code(code, error, match=match):
        load_plan(project(tmp_path, text))


def test_a_test_without_a_course_is_refused(tmp_path: Path) -> None:
    text = PLAN.replace('scenario = { boundaries = { air = "10 [degC]" }, start = "20 [degC]", duration = "2 [h]" }', "")
    with raises_code("value.incomplete", DeckError, match="'experiment on board'"):
        load_plan(project(tmp_path, text))


def test_what_is_added_as_tests_are_made_is_no_change_of_plan(tmp_path: Path) -> None:
    before = load_plan(project(tmp_path)).sha256
    after = load_plan(project(tmp_path, with_log(PLAN, state='"run"', deviations='["door opened"]'))).sha256
    assert before == after


def test_a_change_of_plan_or_deck_changes_the_hash(tmp_path: Path) -> None:
    before = load_plan(project(tmp_path)).sha256
    assert load_plan(project(tmp_path, PLAN.replace('each = "2 [K]"', 'each = "3 [K]"'))).sha256 != before
    file = project(tmp_path)
    (tmp_path / "unit.toml").write_text((tmp_path / "unit.toml").read_text().replace("600", "601"), encoding="utf-8")
    assert load_plan(file).sha256 != before


def test_the_life_of_a_lock(tmp_path: Path) -> None:
    """Open; locked; changed before a look; locked again; looked at; changed after it, and no new lock makes that good."""
    file = project(tmp_path)
    assert load_plan(file).lock_status().state == "open"
    load_plan(file).lock(date="2026-01-01")
    assert load_plan(file).lock_status().state == "locked"
    project(tmp_path, PLAN.replace('mean = "1 [K]"', 'mean = "1.5 [K]"'))
    changed = load_plan(file).lock_status()
    assert (changed.state, changed.changed) == ("changed", ("criteria.ours.mean",))
    load_plan(file).lock(date="2026-01-02")
    note_look(load_plan(file), "hot", "abc", date="2026-02-01")
    good = load_plan(file).lock_status()
    assert good.state == "locked"
    assert "2026-01-02" in str(good)
    project(tmp_path, PLAN.replace('mean = "1 [K]"', 'mean = "4 [K]"'))
    load_plan(file).lock(date="2026-02-02")
    moved = load_plan(file).lock_status()
    assert moved.state == "moved"
    assert str(moved).startswith("THE PLAN WAS CHANGED AFTER LOGS WERE READ on 2026-02-01: 'criteria.ours.mean'")


def test_a_lock_that_comes_after_the_look_is_late(tmp_path: Path) -> None:
    file = project(tmp_path)
    note_look(load_plan(file), "hot", "abc", date="2026-02-01")
    load_plan(file).lock(date="2026-02-02")
    late = load_plan(file).lock_status()
    assert late.state == "late"
    assert "2026-02-01" in str(late)


def test_a_plan_that_was_never_locked_is_not_called_late(tmp_path: Path) -> None:
    plan = load_plan(project(tmp_path))
    note_look(plan, "hot", "abc", date="2026-02-01")
    never = plan.lock_status()
    assert (never.state, never.looked) == ("open", "2026-02-01")
    assert "2026-02-01" in str(never)


def test_a_damaged_lock_is_no_fresh_start(tmp_path: Path) -> None:
    file = project(tmp_path)
    file.with_suffix(".lock.json").write_text("{", encoding="utf-8")
    with raises_code("file.not-valid", DeckError):
        load_plan(file).lock_status()


def test_reading_a_log_is_noted_as_a_look(tmp_path: Path) -> None:
    measured(tmp_path)
    file = project(tmp_path, with_log(PLAN))
    load_plan(file).lock()
    assert run_plan(file).lock.state == "locked"
    project(tmp_path, with_log(PLAN).replace('each = "2 [K]"', 'each = "9 [K]"'))
    assert run_plan(file).lock.state == "moved"


def test_a_node_that_the_model_does_not_have_is_named_with_its_place(tmp_path: Path) -> None:
    text = PLAN.replace('T_ELE  = { node = "ele"', 'T_ELE  = { node = "eel"')
    with raises_code("name.unknown", NameNotFoundError, match="plan.toml.*sensors.T_ELE.node.*'eel'.*'ele'"):
        run_plan(project(tmp_path, text))


def test_an_error_inside_a_test_says_which(tmp_path: Path) -> None:
    text = PLAN.replace('criteria = ["ECSS", "ours"]', 'criteria = ["ECSS", "ours"]\nspread = { aer = "1 [K]" }')
    with raises_code("name.unknown", NameNotFoundError, match="plan.toml.*'hot'.*'aer'"):
        run_plan(project(tmp_path, text))


def test_a_copy_of_a_plan_does_not_unsee_its_logs(tmp_path: Path) -> None:
    """Looked at through one plan, copied under another name, locked there: late."""
    measured(tmp_path)
    file = project(tmp_path, with_log(PLAN))
    load_plan(file).lock()
    assert run_plan(file).lock.state == "locked"
    other = tmp_path / "fresh.toml"
    other.write_text(file.read_text(encoding="utf-8").replace('each = "2 [K]"', 'each = "9 [K]"'), encoding="utf-8")
    load_plan(other).lock()
    late = run_plan(other).lock
    assert late.state == "late"
    assert str(late) != str(run_plan(file).lock)


def test_a_part_of_a_host_s_deck_changes_the_hash_too(tmp_path: Path) -> None:
    text = PLAN.replace("[limits.processor]", '[hosts]\nbench = { deck = "host.toml" }\n\n[limits.processor]')
    file = project(tmp_path, text)
    part = tmp_path / "part.toml"
    part.write_text((tmp_path / "unit.toml").read_text(encoding="utf-8"), encoding="utf-8")
    host = 'title = "host"\nneeds = ["air"]\n[submodels]\npart = { use = "part.toml", bind = { air = "air" } }\n'
    (tmp_path / "host.toml").write_text(host, encoding="utf-8")
    before = load_plan(file).sha256
    part.write_text(part.read_text(encoding="utf-8").replace("600", "601"), encoding="utf-8")
    assert load_plan(file).sha256 != before


SCENARIO = """
start = "20 [degC]"
duration = "2 [h]"

[boundaries]
air = { file = "weather/room.csv", column = "T", time = "time_s" }
"""


def weathered(folder: Path) -> Path:
    """Return a plan one of whose tests takes the air from a table that its scenario names."""
    inline = '{ boundaries = { air = "10 [degC]" }, start = "20 [degC]", duration = "2 [h]" }'
    (folder / "weather").mkdir(exist_ok=True)
    (folder / "course.toml").write_text(SCENARIO, encoding="utf-8")
    (folder / "weather" / "room.csv").write_text("time_s,T\n0,10\n7200,12\n", encoding="utf-8")
    return project(folder, PLAN.replace(inline, '"course.toml"'))


def test_a_weather_file_that_changes_after_the_lock_is_noticed_and_named(tmp_path: Path) -> None:
    file = weathered(tmp_path)
    load_plan(file).lock()
    assert load_plan(file).lock_status().state == "locked"
    (tmp_path / "weather" / "room.csv").write_text("time_s,T\n0,10\n7200,8\n", encoding="utf-8")
    changed = load_plan(file).lock_status()
    assert (changed.state, changed.changed) == ("changed", ("file weather/room.csv",))
    assert "file weather/room.csv" in str(changed)
    (tmp_path / "weather" / "room.csv").unlink()
    assert load_plan(file).lock_status().changed == ("file weather/room.csv",)


def test_what_a_campaign_rests_on_is_hashed_logs_in_another_folder_among_it(tmp_path: Path) -> None:
    """Decks, logs by name and by pattern, one of them in a folder of data; a loop of names ends."""
    home, data = tmp_path / "home", tmp_path / "data"
    (home / "logs").mkdir(parents=True)
    data.mkdir()
    for file in (home / "logs" / "a_1.csv", home / "logs" / "a_2.csv", data / "b.csv"):
        file.write_text("time_s,T\n0,1\n", encoding="utf-8")
    (home / "part.toml").write_text('title = "part"\nback = "campaign.toml"\n', encoding="utf-8")
    records = '[records.a]\nfiles = "logs/a_*.csv"\n[records.b]\nfile = "b.csv"\n'
    (home / "campaign.toml").write_text('title = "c"\nnote = "*"\n' + records + '[[stages]]\nmodel = "part.toml"\n', encoding="utf-8")
    file = project(home, PLAN.replace('deck = "unit.toml"', 'campaign = "campaign.toml"\nstage = "s"'))
    found = load_plan(file, data).files
    assert set(found) == {"campaign.toml", "part.toml", "logs/a_1.csv", "logs/a_2.csv", "data: b.csv"}
    (data / "b.csv").write_text("time_s,T\n0,2\n", encoding="utf-8")
    assert load_plan(file, data).files["data: b.csv"] != found["data: b.csv"]


def test_a_file_outside_of_the_project_is_not_read_for_its_hash(tmp_path: Path) -> None:
    home = tmp_path / "home"
    home.mkdir()
    (tmp_path / "secret.csv").write_text("1", encoding="utf-8")
    file = weathered(home)
    (home / "course.toml").write_text(SCENARIO + 'note = "../secret.csv"\n', encoding="utf-8")
    assert not [name for name in load_plan(file).files if "secret" in name]


def test_a_log_that_is_exchanged_after_it_was_looked_at_is_remarked(tmp_path: Path) -> None:
    measured(tmp_path)
    file = project(tmp_path, with_log(PLAN))
    load_plan(file).lock()
    usual = set(run_plan(file)["hot"].remarks)
    measured(tmp_path, offset=0.2)
    (told,) = set(run_plan(file)["hot"].remarks) - usual
    assert re.search(r"\d{4}-\d\d-\d\d", told)
    project(tmp_path, with_log(PLAN, deviations='["calibration of the logger applied"]'))
    (stated,) = set(run_plan(file)["hot"].remarks) - usual
    assert stated != told


def test_a_scenario_in_a_plan_is_read_as_one_in_a_file(tmp_path: Path) -> None:
    """Gases, and columns of logs beside the plan."""
    (tmp_path / "room.csv").write_text("time_s,AIR_degC\n0,40\n21600,40\n", encoding="utf-8")
    table = """boundaries = { air = { file = "room.csv", column = "AIR_degC", unit = "degC" } }
start = "20 [degC]"
duration = "6 [h]"
environment = { "*" = { pressure = "20 [kPa]" } }
"""
    (tmp_path / "hot.toml").write_text(table, encoding="utf-8")
    old = 'scenario = { boundaries = { air = "40 [degC]" }, start = "20 [degC]", duration = "6 [h]" }'
    inline = f"scenario = {{ {', '.join(table.splitlines())} }}"
    from_file, from_plan = (
        run_plan(project(tmp_path, PLAN.replace(old, new)))["hot"].foresight for new in ('scenario = "hot.toml"', inline)
    )
    assert from_plan.solution["proc"].final == from_file.solution["proc"].final
    assert [f.scenario.environment["*"].pressure.bounds for f in (from_file, from_plan)] == [(2e4, 2e4)] * 2


def beside(folder: Path, scenario: str) -> Path:
    """Return a plan whose hot test has a profile, and a scenario beside it."""
    old = 'scenario = { boundaries = { air = "40 [degC]" }, start = "20 [degC]", duration = "6 [h]" }\n'
    one = PLAN[: PLAN.index('\n[[tests]]\nname = "experiment')]
    profile = (
        'profile = { like = "SMC-S-016 unit thermal cycle", cycles = 1, hot = "50 [degC]", cold = "0 [degC]", average = "30 [min]" }\n'
    )
    return project(
        folder, one.replace(old, f'{profile}chamber = "air"\nscenario = {scenario}\n').replace('steady = [["5 [h]", "6 [h]"]]\n', "")
    )


def test_a_scenario_beside_a_profile_gives_what_else_is_done(tmp_path: Path) -> None:
    swing = '{ loads = { cpu = { mean = "6 [W]", amplitude = "3 [W]", period = "30 [min]" } } }'
    (trial,) = run_plan(beside(tmp_path, swing)).trials
    power = trial.foresight.solution.load_powers["cpu"]
    assert power.max() == pytest.approx(9.0, rel=0.02)
    assert trial.course is not None
    assert trial.course.waited > 0.0


@pytest.mark.parametrize(
    ("scenario", "match"),
    [
        ('{ boundaries = { air = "40 [degC]" } }', "'air'"),
        ('{ duration = "2 [h]" }', r"plan\.toml.*'hot'"),
    ],
)
def test_a_scenario_beside_a_profile_does_not_say_what_the_profile_says(tmp_path: Path, scenario: str, match: str) -> None:
    with raises_code("value.excludes-another", ScenarioError, match=match):
        run_plan(beside(tmp_path, scenario))


def test_errors_of_a_plan_s_limits_and_model_name_the_plan(tmp_path: Path) -> None:
    limits = PLAN[PLAN.index("[limits.processor]") : PLAN.index("[sensors]")]
    text = PLAN.replace(limits, "").replace("objectives", 'limits = "limits.toml"\nobjectives')
    file = project(tmp_path, text)
    (tmp_path / "limits.toml").write_text('[processor]\nnode = "proc"\noperating = ["-20 [degC]"]\n', encoding="utf-8")
    with raises_code("value.wrong-kind", match="^plan.toml:3.*limits.toml:3.*processor.operating"):
        td.qualify.load_plan(file)
    (tmp_path / "limits.toml").unlink()
    with raises_code("file.not-found", match="^plan.toml:3"):
        td.qualify.load_plan(file)
    gone = project(tmp_path, PLAN.replace('deck = "unit.toml"', 'deck = "unit.toml"\nvalues = "none.toml"'))
    with pytest.raises(td.ThermidError, match=r"^plan.toml.*none.toml"):
        assert td.qualify.load_plan(gone).knowledge


def test_a_stage_that_a_campaign_does_not_have_is_named_with_the_plan(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from thermid.campaign import _stages as stages

    plan = td.qualify.load_plan(project(tmp_path))
    source = plan.content.model.model_copy(update={"deck": "", "campaign": "unit.toml", "stage": "unti"})
    other = replace(plan, content=plan.content.model_copy(update={"model": source}))
    monkeypatch.setattr("thermid.qualify._plan.run_stages", lambda *a, **k: stages.Campaign("c", {"unit": None}, (), {}))  # type: ignore[dict-item]
    with raises_code("name.unknown", match="^plan.toml.*model.stage.*'unti'.*'unit'"):
        assert other.knowledge


def test_criteria_are_listed_in_quotes(tmp_path: Path) -> None:
    file = project(tmp_path, PLAN.replace('criteria = ["ECSS", "ours"]', 'criteria = ["ECS"]'))
    with raises_code("name.unknown", match="'MIL-HDBK-340, transient'.*'ours'.*'ECSS'"):
        td.qualify.load_plan(file)


def test_what_margins_leave_out_is_said_once_below(tmp_path: Path) -> None:
    text = str(td.qualify.run_plan(project(tmp_path)))
    said = [line for line in text.splitlines() if "'s own" in line]
    assert len(said) == 1
    assert not [line for line in text.splitlines() if "'s own" in line and "K" in line.split()]
    assert text.index(said[0]) > max(m.start() for m in re.finditer(r"^  \w+: .*\d K\b", text, re.MULTILINE))


@pytest.mark.parametrize("read", [td.qualify.load_plan, td.load_scenario, td.qualify.load_hold])
@pytest.mark.parametrize(("text", "kind"), [("[nodes]\na = {}\n", "deck"), ("stages = []\n[records]\n", "campaign")])
def test_a_file_of_another_kind_is_told_by_what_it_is(tmp_path: Path, read: Callable[[Path], object], text: str, kind: str) -> None:
    (tmp_path / "x.toml").write_text(text, encoding="utf-8")
    with pytest.raises(td.ThermidError, match=rf"^x.toml: this is a {kind}, not a (qualification plan|scenario|hold question)"):
        read(tmp_path / "x.toml")
