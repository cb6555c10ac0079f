"""Mistakes planted in synthetic campaigns are named first, by `thermid calibrate` or in its refusal; clean campaigns name none."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest.mock import patch

import pytest

import thermid as td
from recovery.mistaken import Planted, clean, planted, swapped
from thermid.base.errors import ThermidError
from thermid.campaign import _stages
from thermid.inference.criticism import Mistakes, find_mistakes

SEED = 20261122
pytestmark = [
    pytest.mark.filterwarnings("ignore:.*a fit goes on:thermid.base.errors.ThermidWarning"),
    pytest.mark.usefixtures("values_alone"),
]
"""What is said where the machine is slow; and mistakes of logs are named without the model of error."""


def named(path: Path) -> tuple[str, str]:
    """Return kind and name of the first mistake that a campaign names, in its result or in its refusal; empty where it names none."""
    sought: list[Mistakes] = []

    def keep(*asked: Any) -> Mistakes:
        sought.append(find_mistakes(*asked))
        return sought[-1]

    with patch.object(_stages, "find_mistakes", keep):
        try:
            found = td.run_stages(path).mistakes["plant"].first
        except ThermidError as refusal:
            found = next((m for asked in sought for m in asked.named[:1] if f"Likely mistake: {m}. {m.remedy}" in refusal.message), None)
    return ("", "") if found is None else (found.kind, found.name)


def from_the_deck_alone(path: Path) -> Path:
    """Let the stages of a campaign descend from the deck's values alone, which takes half the time; the campaign's forms search."""
    path.write_text(path.read_text().replace("[[stages]]\n", '[[stages]]\nsearch = "local"\n'))
    return path


def judged(case: Planted, found: tuple[str, str]) -> str:
    """Return 'named', or what was said in place of the planted mistake."""
    kind, name = found
    same = kind == case.kind and set(name.split(", ")) == set(case.name.split(", "))
    return "named" if same else f"{case.kind} {case.name}: {kind or 'nothing'} {name}"


@pytest.mark.parametrize("k", [pytest.param(1, marks=pytest.mark.campaign), 11])
def test_a_planted_mistake_is_named_first(k: int, tmp_path: Path) -> None:
    """A power in per cent under [W]; a sensor on another part, by a refusal. Another name than the planted one does not count."""
    case = planted(k, SEED, tmp_path)
    found = named(from_the_deck_alone(case.path))
    assert judged(case, found) == "named"
    assert judged(replace(case, name="T_AIR"), found) == f"{case.kind} T_AIR: {case.kind} {case.name}"


def test_clean_campaigns_name_nothing(tmp_path: Path) -> None:
    """With a hidden mass and a lagging sensor, and with noise that wanders, which the deck does not know; 100 more in the campaign."""
    assert [named(clean(k, SEED, tmp_path / str(k))) for k in (1, 2)] == [("", "")] * 2


@pytest.mark.campaign
def test_every_planted_mistake_is_named_first(tmp_path: Path) -> None:
    cases = [planted(k, SEED, tmp_path / str(k)) for k in range(24)]
    assert [judged(case, named(case.path)) for case in cases] == ["named"] * 24


@pytest.mark.campaign
def test_at_most_3_of_100_clean_campaigns_name_a_mistake(tmp_path: Path) -> None:
    said = [named(clean(k, SEED, tmp_path / str(k))) for k in range(100)]
    assert sum(s != ("", "") for s in said) <= 3, said


def test_exchanged_temperatures_are_named_where_the_clock_of_a_joined_log_is_left_to_the_fit(tmp_path: Path) -> None:
    case = swapped(0, SEED, tmp_path)
    assert judged(case, named(from_the_deck_alone(case.path))) == "named"


@pytest.mark.campaign
def test_of_20_exchanges_18_are_named_first_and_of_20_clean_benches_at_most_1(tmp_path: Path) -> None:
    cases = [swapped(k, SEED, tmp_path / str(k)) for k in range(20)]
    said = [judged(case, named(case.path)) for case in cases]
    assert said.count("named") >= 18, said
    clear = [named(swapped(k, SEED, tmp_path / f"clean{k}", exchange=False).path) for k in range(20)]
    assert sum(s != ("", "") for s in clear) <= 1, clear
