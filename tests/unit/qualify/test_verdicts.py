"""Nothing that was not checked may read as passed: what each lack does to the verdict, and the words for it."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import thermid as td
from by_code import of_code
from thermid.app.cli.app import app
from thermid.base.errors import code_of
from thermid.base.results import MARKS
from thermid.campaign.stages import CRITERIA, POLICIES, Criteria, Limits, check_limits, correlate
from thermid.qualify._trial import Trial
from thermid.reporting._qualification import tables
from unit.qualify.project import LOG, PLAN, measured, project
from unit.qualify.things import UNIT, soak, unit

ONE = PLAN[: PLAN.index('\n[[tests]]\nname = "experiment')]
"""The plan with its hot test alone."""


def tried(folder: Path, text: str = ONE + LOG, lock: bool = True) -> tuple[Trial, td.qualify.Qualification]:
    """Return the hot test and the whole, its plan locked before the log is looked at."""
    file = project(folder, text)
    if lock:
        td.qualify.load_plan(file).lock()
    found = td.qualify.run_plan(file)
    return found["hot"], found


def rewrite(folder: Path, change: str) -> None:
    """Change the log of the hot test."""
    lines = (folder / "hot.csv").read_text(encoding="utf-8").splitlines()
    head, rows = lines[:2], np.array([[float(x) for x in line.split(",")] for line in lines[2:]])
    if change == "short":
        rows = rows[rows[:, 0] <= 3 * 3600.0]
    if change == "gap":
        rows = rows[(rows[:, 0] < 3600.0) | (rows[:, 0] > 2 * 3600.0)]
    if change == "cool":
        rows[:, 3] = 33.0
    if change == "warm":
        rows[100:110, 1] = 75.0
    table = [",".join(f"{x:.3f}" for x in row) for row in rows]
    (folder / "hot.csv").write_text("\n".join([*head, *table]), encoding="utf-8")


def test_a_whole_log_that_meets_everything_passes(tmp_path: Path) -> None:
    """The other tests of this file take one thing away each."""
    measured(tmp_path)
    hot, whole = tried(tmp_path)
    assert (hot.passed, hot.open) == (True, ())
    assert whole.passed is True
    asked = min(m.margin for m in whole.margins)
    assert asked < min(c.room for t in whole.trials for c in t.checks)
    assert whole.worst is not None
    assert whole.worst.left == asked  # the headline counts what is asked, not the bare distance
    assert str(whole.worst) in str(whole)
    assert whole.smallest("hot") == whole.worst
    (row,) = (r for r in tables.tests(whole).rows if r[0].text == "hot")
    assert f"{asked:.1f}" in [cell.text for cell in row], "the first table had the bare distance"


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ("gap", r"T_PROC, T_ELE .* 64 min .* 6 h; .* 64 min,.* 0\.97 h"),
        ("cool", r"'air', 40\.0 degC .* 6 h.*: ROOM .* 33\.0 degC"),
    ],
)
def test_what_a_log_does_not_show_is_not_passed(tmp_path: Path, change: str, words: str) -> None:
    measured(tmp_path)
    rewrite(tmp_path, change)
    loose = ONE.replace('mean = "1 [K]"\neach = "2 [K]"', 'mean = "20 [K]"\neach = "20 [K]"').replace('["ECSS", "ours"]', '["ours"]')
    hot, whole = tried(tmp_path, loose + LOG)
    assert hot.correlation is not None
    assert hot.correlation.verdicts == {"ours": True}
    assert hot.passed is None
    assert whole.passed is not True
    assert any(re.search(words, line) for line in hot.open), hot.open


def test_a_log_that_ends_early_is_not_passed(tmp_path: Path) -> None:
    measured(tmp_path)
    rewrite(tmp_path, "short")
    text = ONE.replace('"5 [h]", "6 [h]"', '"2 [h]", "3 [h]"').replace('["ECSS", "ours"]', '["MIL-HDBK-340, transient"]')
    hot, _ = tried(tmp_path, text + LOG)
    assert hot.correlation is not None
    assert hot.correlation.verdicts == {"MIL-HDBK-340, transient": True}
    assert hot.passed is None
    assert any("for 3 h of 6 h" in line for line in hot.open)


def test_a_reading_beyond_its_limit_fails_whatever_the_prediction_says(tmp_path: Path) -> None:
    measured(tmp_path)
    rewrite(tmp_path, "warm")
    loose = ONE.replace('mean = "1 [K]"\neach = "2 [K]"', 'mean = "50 [K]"\neach = "50 [K]"').replace('["ECSS", "ours"]', '["ours"]')
    hot, _ = tried(tmp_path, loose + LOG)
    assert hot.correlated is True
    assert [(c.by, c.passed) for c in hot.checks] == [("predicted", True), ("measured", False)]
    assert hot.within is False
    assert "processor operating, measured" in str(hot)


def test_criteria_without_a_log_and_a_log_without_criteria_decide_nothing(tmp_path: Path) -> None:
    hot, whole = tried(tmp_path, ONE)
    assert (hot.within, hot.passed, whole.passed) == (True, None, None)
    assert [code_of(line) for line in hot.open] == ["verdict.no-log"]
    assert "ECSS, ours" in hot.open[0]
    measured(tmp_path)
    hot, _ = tried(tmp_path, ONE.replace('criteria = ["ECSS", "ours"]\n', "") + LOG)
    assert hot.passed is None
    assert of_code(hot.open, "verdict.no-criteria")


def test_a_chamber_that_nobody_logged_is_not_passed(tmp_path: Path) -> None:
    measured(tmp_path)
    hot, _ = tried(tmp_path, ONE + 'log = { file = "hot.csv" }\n')
    assert hot.passed is None
    assert any("'air'" in words for words in hot.open)


def test_a_stretch_that_is_called_settled_and_drifts(tmp_path: Path) -> None:
    measured(tmp_path)
    hot, _ = tried(tmp_path, ONE.replace('"5 [h]", "6 [h]"', '"0.5 [h]", "1.5 [h]"') + LOG)
    assert hot.correlation is not None
    assert set(hot.correlation.verdicts.values()) == {True}
    assert hot.passed is None
    assert any("not: T_" in line and "'3 C/h' [read]" in line for line in hot.open)


def test_a_rule_from_memory_raises_no_doubt(tmp_path: Path) -> None:
    """And it settles none: what it says is shown."""
    measured(tmp_path)
    hot, _ = tried(
        tmp_path,
        ONE.replace('"5 [h]", "6 [h]"', '"0.5 [h]", "1.5 [h]"').replace('kind = "thermal', 'stable = "1 K/h"\nkind = "thermal') + LOG,
    )
    assert [s.decides for s in hot.settled] == [False]
    assert not any("'1 K/h'" in line for line in hot.open)


def test_two_tests_with_one_log(tmp_path: Path) -> None:
    measured(tmp_path)
    twice = ONE + LOG + ONE[ONE.index("[[tests]]") :].replace('name = "hot"', 'name = "hot again"') + LOG
    hot, whole = tried(tmp_path, twice)
    assert hot.passed is None
    assert [code_of(line) for line in whole["hot again"].open] == ["verdict.log-of-another-test"]


def test_exchanged_sensors_are_named(tmp_path: Path) -> None:
    measured(tmp_path)
    log = tmp_path / "hot.csv"
    log.write_text(log.read_text(encoding="utf-8").replace("T_PROC,T_ELE", "T_ELE,T_PROC"), encoding="utf-8")
    hot, _ = tried(tmp_path)
    assert hot.passed is False
    assert of_code(hot.remarks, "record.sensors-exchanged", "^(T_PROC and T_ELE|T_ELE and T_PROC) ")


def test_a_plan_that_was_not_locked_first_is_not_passed(tmp_path: Path) -> None:
    measured(tmp_path)
    hot, whole = tried(tmp_path, lock=False)
    assert (hot.passed, whole.passed) == (True, None)
    assert whole.lock.state == "open"
    assert str(whole.lock) in whole.open


def test_the_command_leaves_with_4_when_something_is_open(tmp_path: Path) -> None:
    file = project(tmp_path, ONE)
    told = CliRunner().invoke(app, ["qualify", str(file), "--json"])
    assert told.exit_code == 4, told.output
    found = json.loads(told.stdout)
    assert found["passed"] is None
    assert any("ECSS, ours" in line for line in found["open"])


def test_a_waived_test_is_held_against_its_limits_and_named(tmp_path: Path) -> None:
    file = project(tmp_path, ONE.replace('kind = "thermal', 'state = "waived"\nnote = "not for a spare"\nkind = "thermal'))
    found = td.qualify.run_plan(file)
    assert found["hot"].passed is True
    assert found.waived == ("hot",)
    assert "waived: hot" in str(found)


def test_a_unit_switched_off_without_limits_of_its_own() -> None:
    """Within its operating limits it bears that; beyond them nobody said, and that is not passed."""
    point = Limits("processor", "proc", td.quantity((263.15, 343.15), unit="K"), loads=("cpu",))
    off = soak(20.0, loads={"cpu": "0 [W]"})
    (good,) = check_limits(td.simulate(unit(), off), [point])
    assert (good.state, good.passed, good.stand_in) == ("non-operating", True, True)
    (open_,) = check_limits(td.simulate(unit(), soak(-40.0, loads={"cpu": "0 [W]"})), [point])
    assert open_.passed is None
    assert code_of(open_.undecided) == "verdict.no-limits-of-this-state"


def test_no_number_from_memory_decides_whatever_it_is(tmp_path: Path) -> None:
    """Every set of criteria, margin policy, limit and profile that rests on memory, made to be met by far and missed by far."""
    measured(tmp_path)
    file = project(tmp_path, ONE + LOG)
    seen = td.qualify.run_plan(file)["hot"].correlation
    assert seen is not None
    for size in (1e-6, 1e6):
        for name in ("mean", "spread", "each", "rmse"):
            for kinds in (("steady",), ("transient",)):
                own = Criteria("own", kinds=kinds, mark="memory", **{name: size})
                found = correlate(seen.overlays, [own], steady=seen.windows)
                assert found.verdicts == {"own": None}
                assert not found.failed
    for mark in MARKS:
        for kelvin in (400.0, 290.0):
            (check,) = check_limits(td.simulate(unit(), soak()), [Limits("p", "proc", td.quantity((250.0, kelvin), unit="K"), mark=mark)])
            assert check.passed is (None if mark == "memory" else kelvin > 350.0)
    for name, policy in POLICIES.items():
        for celsius in (10.0, 90.0):
            seen_at = td.design.foresee(td.design.Knowledge(unit()), soak(celsius), spread={"air": "1 [K]"})
            hot = td.qualify.margins({"run": seen_at}, [Limits("p", "proc", td.quantity((200.0, 350.0), unit="K"))], name)[1]
            from_memory = "memory" in (policy.acceptance.mark, policy.qualification.mark)
            assert (hot.passed is None) is from_memory
    assert {c.mark for c in CRITERIA.values()} <= {*MARKS} - {"memory"}


def test_a_margin_over_a_course_from_memory_is_not_decided(tmp_path: Path) -> None:
    text = ONE.replace(
        'scenario = { boundaries = { air = "40 [degC]" }, start = "20 [degC]", duration = "6 [h]" }',
        'profile = { like = "SMC-S-016 vehicle thermal vacuum", cycles = 1, hot = { value = "40 [degC]", mark = "memory" }, '
        'cold = "0 [degC]" }\n'
        'spread = { air = "1 [K]" }',
    ).replace('steady = [["5 [h]", "6 [h]"]]\n', "")
    found = td.qualify.run_plan(project(tmp_path, text))
    assert found["hot"].within is None
    assert {m.passed for m in found.margins} == {None}
    assert {code_of(m.undecided) for m in found.margins} == {"verdict.from-memory"}


def test_a_rule_on_stored_heat_needs_every_node_measured(tmp_path: Path) -> None:
    """The plate has no sensor: that the stretch is settled cannot be told, with the reason; with one it is told."""
    measured(tmp_path)
    hot, _ = tried(tmp_path, ONE + LOG + 'stable = "stored 3 %"\n')
    assert [r for r in hot.not_shown if "'stored 3 %'" in r and "'plate'" in r and "60 %" in r]
    deck = td.model_from_dict({**UNIT, "nodes": {k: v for k, v in UNIT["nodes"].items() if k != "plate"}, "conductors": BARE})
    measured(tmp_path, deck)
    file = project(tmp_path, ONE + LOG + 'stable = "stored 3 %"\n')
    td.save_model(deck, tmp_path / "unit.toml")
    (found,) = td.qualify.run_plan(file)["hot"].settled
    assert found.stored is not None
    assert found.stored.power == pytest.approx(9.0)
    assert found.verdict == "stable"


BARE = {
    "p": {"kind": "conduction", "between": ["proc", "ele"], "conductance": "0.8 [W/K]"},
    "out": {"kind": "conduction", "between": ["ele", "air"], "conductance": "0.9 [W/K]"},
}
