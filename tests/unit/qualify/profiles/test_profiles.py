"""Profiles of the standards: numbers, marks, levels, files, remarks, cycles."""

from __future__ import annotations

import re

import pytest

import thermid as td
from by_code import raises_code
from thermid.base.errors import ScenarioError
from thermid.base.results import MARKS
from thermid.qualify._profiles.profile import EQUIVALENCE

PREDICTED = ("-5 [degC]", "45 [degC]")


def unit_cycle(**changes):
    return td.qualify.profile_of("SMC-S-016", "unit thermal cycle", level="qualification", predicted=PREDICTED, **changes)


def test_levels_of_smc_are_the_wider_of_margin_and_least_range():
    assert unit_cycle()["hot"].text == "71 [degC]"
    wide = unit_cycle().with_(predicted=("-40 [degC]", "70 [degC]"))
    assert (wide["cold"].text, wide["hot"].text) == ("-50 [degC]", "80 [degC]")
    acceptance = td.qualify.profile_of("smc", "unit thermal cycle", level="acceptance", predicted=("-40 [degC]", "70 [degC]"))
    assert (acceptance["cold"].text, acceptance["hot"].text) == ("-40 [degC]", "70 [degC]")


@pytest.mark.parametrize(("level", "count"), [("qualification", 23), ("protoqualification", 16), ("acceptance", 10)])
def test_counts_of_smc(level, count):
    profile = td.qualify.profile_of("SMC-S-016", "unit thermal cycle", level=level)
    assert max(s.cycle for s in profile.steps) == count


def test_soaks_off_times_and_starts():
    first = [s for s in unit_cycle().steps if s.cycle == 1]
    assert [s.name for s in first[:4]] == ["to hot", "hot dwell", "hot, off", "hot start"]
    assert [s.dwell for s in first[1:4]] == [3600.0, 1800.0, 16200.0]  # 6 h of soak in all
    assert [s.power for s in first[:4]] == [True, None, False, True]
    second = [s for s in unit_cycle().steps if s.cycle == 2]
    assert [s.dwell for s in second[1:4]] == [3600.0, 1800.0, 3600.0]  # the soak of 1 h is over; 1 h of hot operation is not


def test_first_and_last_half_cycles_are_hot_and_a_cold_one_is_remarked():
    usual, last, first = (set(unit_cycle(**ends).check()) for ends in ({}, {"last": "cold"}, {"first": "cold"}))
    (remark,) = last - usual
    assert "last" in remark
    assert any("6.3.8.3" in r for r in first - usual)


def test_marks_are_carried_and_memory_decides_nothing():
    smc = unit_cycle()
    heard = smc.with_(dwell={"value": "2 [h]", "mark": "memory"}, ramp={"value": "2 [K/min]", "mark": "secondary"})
    assert (smc.mark, smc.decides, smc.from_memory) == ("project", True, ())
    assert (heard.mark, heard.decides, heard.from_memory) == ("memory", False, ("dwell",))
    assert re.search(r"\bdwell\b", heard.trust)
    assert heard.trust in str(heard)
    read = heard.with_(dwell={"value": "2 [h]", "mark": "read", "clause": "5.1"})
    assert (read.from_memory, read.decides, read.mark) == ((), True, "secondary")


def test_a_rule_from_memory_makes_a_profile_from_memory():
    profile = unit_cycle().with_(stable="1 K/h")
    assert profile["stable"].mark == "project"  # chosen by the project, so it is the project's number
    assert profile.decides


def test_every_profile_of_the_library_expands_and_every_number_has_a_mark():
    seen = 0
    for standard, profiles in td.qualify.profile_names().items():
        for name, levels in profiles.items():
            for level in levels or ("",):
                profile = td.qualify.profile_of(standard, name, level=level, predicted=PREDICTED)
                assert profile.steps
                assert {n.mark for n in profile.numbers.values()} <= set(MARKS)
                assert all(n.clause for n in profile.numbers.values() if n.mark in ("read", "secondary"))
                assert profile.decides, f"{profile.title}: read it in its source, or take it out"
                seen += 1
    assert seen == 18


def test_a_file_is_like_a_standard_with_other_numbers(tmp_path):
    file = tmp_path / "own.toml"
    file.write_text(
        '[profile]\nlike = "SMC-S-016 unit thermal cycle"\nlevel = "acceptance"\ncycles = 2\nhot = "55 [degC]"\n'
        'predicted = ["-5 [degC]", "45 [degC]"]\ndwell = { value = "2 [h]", note = "by analysis" }\n',
        encoding="utf-8",
    )
    profile = td.qualify.load_profile(file)
    assert (profile["cycles"].value, profile["hot"].text, profile["cold"].text) == (2.0, "55 [degC]", "-24 [degC]")
    assert (profile["dwell"].mark, profile["dwell"].note, profile["soak"].mark) == ("project", "by analysis", "read")
    profile.save(tmp_path / "saved.toml")
    again = td.qualify.load_profile(tmp_path / "saved.toml")
    assert again.numbers == profile.numbers
    assert (again.steps, again.mark) == (profile.steps, profile.mark)


def test_written_steps_are_saved_and_read(tmp_path):
    step = {"name": "warm up", "to": "60 [degC]", "humidity": 0.95, "over": "2 [h]", "power": "off", "mark": "memory"}
    profile = td.qualify.profile_of("SMC-S-016", "unit humidity").with_(steps=[step, {"name": "hot and humid", "dwell": "6 [h]"}])
    profile.save(tmp_path / "p.toml")
    again = td.qualify.load_profile(tmp_path / "p.toml")
    assert again.steps == profile.steps
    assert again.decides is False


@pytest.mark.parametrize(
    ("made", "code", "match"),
    [
        (lambda: td.qualify.profile_of("DO-160G"), "name.unknown", "'DO-160G'.* NAVMAT P-9492, SMC-S-016"),
        (lambda: td.qualify.profile_of("SMS-S-016"), "name.unknown", "'smc-s-016'"),
        (lambda: td.qualify.profile_of("SMC-S-016", "unit thermal cycles"), "name.unknown", "'unit thermal cycle'"),
        (
            lambda: td.qualify.profile_of("SMC-S-016", "unit thermal cycle", level="flight"),
            "name.unknown",
            "qualification, protoqualification, acceptance",
        ),
        (lambda: unit_cycle(dwel="1 [h]"), "name.unknown", "'dwell'"),
        (lambda: unit_cycle(dwell="1 [K]"), "unit.wrong-dimension", r"dwell: '\[K\]'"),
        (lambda: unit_cycle(dwell="-1 [h]"), "value.outside-range", "dwell"),
        (lambda: unit_cycle(stable="3 C"), "value.wrong-kind", "'3 C' .*'3 C/h'"),
        (lambda: unit_cycle(starts="often"), "value.wrong-kind", "each, first and last, never"),
        (lambda: unit_cycle(cycles=2.5).steps, "value.outside-range", "cycle, qualification: .* 2\\.5"),
        (lambda: unit_cycle(hot="-40 [degC]").check(), "value.outside-range", r"-34 \[degC\].*-40 \[degC\]"),
        (lambda: td.qualify.profile_of("SMC-S-016", "vehicle thermal vacuum").steps, "value.incomplete", " hot, .*predicted="),
        (
            lambda: td.qualify.profile_of("SMC-S-016", "unit thermal cycle", predicted=("45 [degC]", "-5 [degC]")),
            "value.outside-range",
            r"45 degC.*-5 degC",
        ),
        (lambda: unit_cycle(dwell={"value": "1 [h]", "mark": "heard"}), "name.unknown", "dwell: 'heard' .*'read'"),
        (lambda: unit_cycle().with_(steps=[{"nam": "x"}]).steps, "file.unknown-key", "'name'"),
        (lambda: unit_cycle().with_(steps=[{"power": "half"}]).steps, "file.wrong-value", "power: .*'on' or 'off'"),
    ],
)
def test_mistakes_are_named(made, code, match):
    with raises_code(code, match=match):
        made()


def test_a_file_with_a_wrong_key_or_nothing_in_it(tmp_path):
    file = tmp_path / "p.toml"
    file.write_text('[profile]\nlike = "SMC-S-016 unit thermal cycle"\ncycle = 2\n', encoding="utf-8")
    with raises_code("file.unknown-key", ScenarioError, match="'cycles'"):
        td.qualify.load_profile(file)
    file.write_text('[profile]\nlike = "XYZ unit"\n', encoding="utf-8")
    with raises_code("name.unknown", ScenarioError):
        td.qualify.load_profile(file)
    file.write_text("", encoding="utf-8")
    with raises_code("value.incomplete", ScenarioError, match=r"\[profile\]"):
        td.qualify.load_profile(file)


@pytest.mark.parametrize(
    ("level", "exact", "rounded"), [("qualification", 39.51, 40), ("protoqualification", 25.44, 26), ("acceptance", 15.24, 16)]
)
def test_cycles_over_80_kelvin(level, exact, rounded):
    assert EQUIVALENCE[level].exact(80.0) == pytest.approx(exact, abs=0.005)
    assert td.qualify.equivalent_cycles("-30 [degC]", "50 [degC]", level) == rounded


def test_cycles_over_the_range_of_the_standard_are_its_own():
    assert td.qualify.equivalent_cycles("-34 [degC]", "71 [degC]") == 27
    assert td.qualify.equivalent_cycles("-24 [degC]", "61 [degC]", "acceptance") == 14


def test_cycles_with_levels_in_the_wrong_order_or_of_no_level():
    with raises_code("value.outside-range", ScenarioError, match="50 degC.*-30 degC"):
        td.qualify.equivalent_cycles("50 [degC]", "-30 [degC]")
    with raises_code("name.unknown", ScenarioError, match="'acceptance'"):
        td.qualify.equivalent_cycles("-30 [degC]", "50 [degC]", "aceptance")


def test_a_smaller_range_is_remarked_with_the_count_it_asks_for():
    (remark,) = [r for r in unit_cycle(hot="50 [degC]", cold="-30 [degC]").check() if "39.51" in r]
    assert " 40 " in remark


def test_cycles_in_other_tests_of_the_plan_count_and_those_that_are_missing_are_named():
    own = unit_cycle(cycles=2)
    said = [unit.check(beside=n) for unit, n in ((own, 0), (own, 4), (unit_cycle(), 4))]
    alone, both, whole = ([int(n) for n in re.findall(r" (\d+)\b", remark.partition(";")[2])] for (remark,) in said)
    need = alone[-1] + 2
    assert alone == [2, need - 2]
    assert both == [2, 4, need - 6]
    assert whole == [need - 4, 4]
