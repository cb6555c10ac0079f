"""How contestants are chosen and judged, and that plain numbers, reference and page are what they say."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import table
from contest import Answer, Attempt, Entry, choose, errors, is_right, race, timed
from plain import FREE, Task, by_log, plain
from reference import Reference, _exponential, _runge_kutta, _scipy
from report import duration

from scripts_here import script

RUN = Path(__file__).parents[2] / "benchmarks" / "run.py"
TASK = Task("B2", "run", True, True, 1.0, 3e-4)


def _attempts(*settings: tuple[str, str, float]) -> list[Attempt]:
    return [Attempt(name, way, f"{value:g}", lambda value=value: value) for name, way, value in settings]


def _judge(value: float) -> tuple[dict[str, float], bool]:
    return {"max_error_K": value}, value <= 1.0


def test_the_first_right_setting_takes_part() -> None:
    found = list(choose(_attempts(("a x", "forced", 3.0), ("a x", "forced", 0.9), ("a x", "forced", 0.1)), _judge))
    assert [(e.attempt.setting, e.right) for e in found] == [("0.9", True)]


def test_without_a_right_one_the_most_accurate_takes_part() -> None:
    settings = _attempts(("a x", "tolerance", 3.0), ("a x", "tolerance", 2.0), ("a x", "tolerance", float("nan")), ("a x", "forced", 0.5))
    assert [(e.attempt.setting, e.right) for e in choose(settings, _judge)] == [("2", False), ("0.5", True)]


def test_who_is_right_by_tolerance_is_not_forced() -> None:
    settings = _attempts(("a x", "tolerance", 0.5), ("a y", "forced", 0.1), ("a y", "fixed", 0.1), ("b", "forced", 0.2))
    assert [(e.attempt.name, e.attempt.way) for e in choose(settings, _judge)] == [("a x", "tolerance"), ("a y", "fixed"), ("b", "forced")]


def test_a_number_that_is_none_is_not_right() -> None:
    assert not is_right(TASK, {"max_error_K": float("nan")})
    assert not is_right(Task("B2", "sens", True, True, 60.0, 3e-4), {"max_error_K": 0.0})
    assert is_right(TASK, {"max_error_K": 3e-4})


def test_errors_are_the_largest_of_all_outputs() -> None:
    masses = np.full((18001, 12), 300.0)
    right = Reference(masses, TASK.unit.interface(masses, TASK.samples), np.zeros((0, 12, 20)), 0.0)
    wrong = masses.copy()
    wrong[60, 3] += 1e-3
    assert errors(TASK, Answer(wrong), right)["max_error_K"] == pytest.approx(1e-3)
    assert errors(TASK, Answer(masses[::60], stride=60), right)["max_error_K"] == 0.0
    assert errors(TASK, Answer(masses, interface=right.interface + 2e-3), right)["max_error_K"] == pytest.approx(2e-3)


def test_turns_and_own_clocks() -> None:
    entries = [Entry(Attempt(n, "", "", lambda n=n: Answer(np.zeros(0), seconds=(float(n), 0.5))), {}, True, 1.0) for n in "12"]
    race(entries, rounds=3, most=100.0)
    assert [(e.result()["seconds"], e.result()["runs"]) for e in entries] == [(1.0, 3), (2.0, 3)]
    wall, cpu, answer = timed(lambda: 7)
    assert answer == 7
    assert wall >= 0 <= cpu


@pytest.mark.parametrize("nonlinear", [False, True])
def test_derivatives_of_the_plain_unit(nonlinear: bool) -> None:
    unit, rng = plain(nonlinear), np.random.default_rng(3)
    T, u, tiny = 300.0 + 10 * rng.random(12), 298.0, 1e-20  # noqa: N806
    by_node = np.array([unit.heat(T + 1j * tiny * e, u).imag / tiny for e in np.eye(12)]).T
    np.testing.assert_allclose(unit.slope(T, u), by_node, rtol=1e-12, atol=1e-14)
    displaced = plain(nonlinear, 1j * tiny * np.eye(FREE)).heat(np.tile(T, (FREE, 1)), u).imag.T / tiny
    np.testing.assert_allclose(by_log(nonlinear)(T, u), displaced, rtol=1e-9, atol=1e-11)


def test_the_plain_unit_exchanges_nothing_at_zero_difference() -> None:
    unit, even = plain(True), np.full(12, 297.15)
    np.testing.assert_allclose(unit.heat(even, 297.15), unit.power, atol=1e-9)


@pytest.mark.parametrize(("nonlinear", "march", "atol"), [(False, _exponential, 1e-10), (True, _runge_kutta, 1e-8)])
def test_references_agree_with_scipy_on_the_sample_grid(nonlinear: bool, march: Any, atol: float) -> None:
    room = TASK.samples[:61]
    np.testing.assert_allclose(march(plain(nonlinear), room, 1), _scipy(plain(nonlinear), room), atol=atol, rtol=0)


def test_the_page_shows_the_newest_results() -> None:
    page = table.PAGE.read_text(encoding="utf-8")
    assert page.count(table.BEGIN) == page.count(table.END) == 1
    assert page.partition(table.BEGIN)[2].partition(table.END)[0].strip() == table.rendered().strip()


def test_durations() -> None:
    assert [duration(s) for s in (2.0, 0.0035, 5e-6)] == ["2 s", "3.5 ms", "5 us"]


def test_the_program_prints_json() -> None:
    done = subprocess.run([sys.executable, RUN, "B1", "--part", "run", "--quick", "--json", "--peers"], capture_output=True, check=False)
    assert done.returncode == 0, done.stderr.decode()
    document = json.loads(done.stdout)
    own = next(row for row in document["results"] if row["name"] == "thermid")
    assert document["case"] == "B1"
    assert 0 < own["seconds"] < 10
    assert own["max_error_K"] <= 3e-4
    assert {"cpu", "cores", "python", "versions"} <= document["machine"].keys()


@pytest.mark.parametrize("arguments", [["B12"], ["B3", "--part", "sens"], ["B1", "--part", "calibrate"]])
def test_what_does_not_exist_is_refused(arguments: list[str]) -> None:
    code, _, err = script(RUN, arguments, RUN.parent)
    assert code == 2
    assert arguments[-1] in err
