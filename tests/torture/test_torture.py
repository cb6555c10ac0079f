"""The short form of `make torture`: some hundred mutants of every kind, in a process of its own with a limit of memory."""

from __future__ import annotations

import importlib.util
import json
import os
import subprocess
import sys
from functools import cache
from pathlib import Path
from typing import Any

import pytest

import thermid as td
from torture import elements, hostile, logs, outputs, physical, values

TESTS = Path(__file__).parents[1]


MANY = {"python": (30, 300), "logs": (15, 150), "commands": (10, 46), "calls": (30, 300)}
"""Kind of mutants -> how many, and how many in the campaign."""
ALL = """
import json, sys
from torture import files
files._limit()
json.dump({how: files.campaign(how, 36000.0, 1, most) for how, most in json.loads(sys.argv[1]).items()}, sys.stdout)
"""


@cache
def mutants(**many: int) -> dict[str, Any]:
    """So many mutants of kinds, in one process of their own: kind -> counts and findings."""
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "PYTHONPATH": str(TESTS)}
    command = [sys.executable, "-c", ALL, json.dumps(many)]
    run = subprocess.run(command, capture_output=True, text=True, cwd=TESTS, env=environment, check=False)
    assert run.returncode == 0, run.stderr
    answer: dict[str, Any] = json.loads(run.stdout)
    return answer


@pytest.mark.parametrize("whole", [False, pytest.param(True, marks=pytest.mark.campaign)], ids=["sample", "whole"])
@pytest.mark.parametrize("how", MANY)
def test_mutants_end_in_an_answer_or_an_error_of_the_library(how: str, whole: bool) -> None:
    found = mutants(**{kind: many[whole] for kind, many in MANY.items()})[how]
    assert found["findings"] == {}
    assert len(found["counts"]) >= 10


def test_a_sample_of_hostile_numbers_by_every_way_in() -> None:
    found = values.campaign(150, 1)
    assert found["findings"] == {}
    assert {f"{route}, {how}" for route in values.ROUTES for how in ("ran", "refused")} <= {*found["counts"]}


def test_a_number_that_is_accepted_by_mistake_is_found() -> None:
    """What finds nothing could find something."""
    deck = values.DECKS[8]
    case = values.Case("x.emissivity", "python", td.model_from_dict(deck), values.SCENARIO, {"x.emissivity": 1.5})
    assert values.faults(case) == ["x.emissivity = 1.5 is accepted"]


def test_every_number_of_the_decks_has_a_row_and_is_allowed_as_it_stands() -> None:
    """The judge's table has no row that nothing asks for, and none is missing."""
    rows = set()
    for deck in values.DECKS:
        for place in values.leaves(deck):
            now: Any = deck
            for step in place:
                now = now[step]
            number = values.read(now)
            assert number is not None
            assert physical.forbidden(deck, place, number, values.read) == "", place
            rows.add(physical.row_of(deck, place)[0])
        table = td.model_from_dict(deck).parameter_table()
        rows |= {physical.row_of(deck, path.split("."))[0] for path in table if table[path].parameter.is_literal}
    assert rows == {*physical.ROWS}


@pytest.mark.parametrize(
    ("path", "text"),
    [
        ("conductors.x.diameter", "0 [mm]"),
        ("controls.c.sample", "5e-12 [s]"),
        ("conductors.x.htc", "-1000 [W/(m^2 K)]"),
        ("conductors.x.emissivity", "1.5"),
        ("conductors.x.exchange_factor", "400"),
        ("packages.u.psi_JT", "-1 [K/W]"),
        ("nodes.b.enthalpy.points.1.1", "1 [MJ/kg]"),
        ("fans.fan.curve.1.1", "40 [Pa]"),
    ],
)
def test_the_judge_forbids_what_physics_forbids(path: str, text: str) -> None:
    place = tuple(int(w) if w.isdigit() else w for w in path.split("."))
    decks = [deck for deck in values.DECKS if place in [*values.leaves(deck)]]
    assert decks
    number = values.read(text)
    assert number is not None
    seen = [physical.forbidden(deck, place, number, values.read) for deck in decks]
    assert any(seen) or text == "5e-12 [s]"  # a sample of that time is slow, and possible


def test_a_sample_of_every_kind_of_element_beside_radau() -> None:
    found = elements.campaign(4, 1164)  # the last one has most kinds
    assert found["findings"] == []
    assert found["counts"]["right"] == 4
    assert elements.judged(424)[:2] == ("right", "")  # its balance was open by 1.2e-9 of the heat
    assert elements.judged(1169)[:2] == ("refused", "")  # wrong on purpose
    assert {"Peltier", "supercooling", "duct", "thermostat of a load", "control by table", "carried_by", "orbit"} <= {*found["kinds"]}


def test_an_error_in_a_network_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """An oracle whose radiation is off by a hundredth does not agree: what finds nothing could find something."""
    monkeypatch.setattr(elements, "SIGMA", 1.01 * elements.SIGMA)
    for seed in (1161, 1166):
        how, said, _ = elements.judged(seed)
        assert (how, "K off at" in said) == ("wrong", True)


def test_a_sample_of_hostile_requests() -> None:
    pytest.importorskip("uvicorn", reason="the studio's extra is not installed")
    pytest.importorskip("starlette", reason="the studio's extra is not installed")
    found = hostile.campaign(30, 3)
    assert found["findings"] == {}
    assert found["counts"][200] >= 10


@pytest.fixture(scope="module")
def script() -> Any:
    spec = importlib.util.spec_from_file_location("torture_script", TESTS.parent / "scripts/torture.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # its data classes look their module up
    spec.loader.exec_module(module)
    return module


def test_a_short_run_loses_no_row_and_a_finding_is_kept(script: Any) -> None:
    large = {"counts": {"right": 500}, "findings": [], "notes": ["mended"]}
    short = {"counts": {"right": 4}, "findings": []}
    assert script.merged(large, short) == large
    wrong = {"counts": {"right": 3, "wrong": 1}, "findings": ["seed 4"]}
    assert script.merged(large, wrong) == wrong | {"notes": ["mended"]}
    assert script.merged(None, short) == short


def test_the_page_is_written_from_what_is_kept(script: Any) -> None:
    kept = json.loads((TESTS.parent / "scripts/torture.json").read_text(encoding="utf-8"))
    assert {*kept} == {*script.PARTS}
    assert script.page(kept) == (TESTS.parent / "docs/torture.md").read_text(encoding="utf-8")


@pytest.mark.campaign
def test_twenty_thousand_hostile_numbers() -> None:
    found = values.campaign(20_000, 1)
    assert found["findings"] == {}
    assert sum(found["counts"].values()) == 20_000


@pytest.mark.campaign
def test_five_hundred_networks_of_every_kind_of_element() -> None:
    assert elements.campaign(500, 2000)["findings"] == []


@pytest.mark.campaign
def test_ten_thousand_hostile_requests() -> None:
    found = hostile.campaign(10_000, 4)
    assert found["findings"] == {}


@pytest.mark.campaign
def test_every_output_aimed_at_every_input() -> None:
    found = outputs.campaign(3600.0)
    assert found["findings"] == []
    assert found["counts"]["aimed"] >= 4 * 17 * found["counts"]["outputs"]


@pytest.mark.campaign
def test_logs_and_signals() -> None:
    found = logs.campaign(60.0, 1)
    assert found["findings"] == []
    assert sum(found["counts"].values()) > 40


@pytest.mark.campaign
def test_fifty_thousand_mutants_of_logs() -> None:
    found = mutants(logs=50_000)["logs"]
    assert found["findings"] == {}
    assert sum(found["counts"].values()) == 50_000
