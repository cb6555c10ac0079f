"""Mistakes planted in synthetic campaigns are named first, by `thermid calibrate` or in its refusal; clean campaigns name none."""

from __future__ import annotations

from pathlib import Path

import pytest

import thermid as td
from recovery.mistaken import Planted, clean, planted
from thermid.base.errors import ThermidError

SEED = 20261122
pytestmark = pytest.mark.filterwarnings("ignore:.*a fit goes on:thermid.base.errors.ThermidWarning")
"""Said where the machine is slow."""


def named(path: Path) -> tuple[tuple[str, str], str]:
    """Return kind and name of the first mistake that a campaign names, and a refusal."""
    try:
        found = td.run_stages(path).mistakes["plant"].first
    except ThermidError as refusal:
        return ("", ""), refusal.message
    return (("", "") if found is None else (found.kind, found.name)), ""


def right(case: Planted) -> str:
    """Return 'named', 'refused' (with a refusal that names it too, or without), or what was said."""
    (kind, name), refusal = named(case.path)
    if refusal:
        return f"refused: {refusal}"
    same = kind == case.kind and set(name.split(", ")) == set(case.name.split(", "))
    return "named" if same else f"{case.kind} {case.name}: {kind or 'nothing'} {name}"


@pytest.mark.parametrize("k", [1, 10])
def test_a_planted_mistake_is_named_first(k: int, tmp_path: Path) -> None:
    """A power in per cent under [W], a sensor on another part."""
    found = right(planted(k, SEED, tmp_path))
    assert found == "named" or "ikely mistake" in found


def test_clean_campaigns_name_nothing(tmp_path: Path) -> None:
    """The model as it is; with natural convection, a lagging sensor and noise that wanders which the deck does not know."""
    assert [named(clean(k, SEED, tmp_path / str(k)))[0] for k in (0, 1, 2)] == [("", "")] * 3


@pytest.mark.campaign
def test_22_of_24_planted_mistakes_are_named_first_or_refused(tmp_path: Path) -> None:
    said = [right(planted(k, SEED, tmp_path / str(k))) for k in range(24)]
    good = [s == "named" or s.startswith("refused") for s in said]
    print("\n".join(said), sum(s == "named" for s in said), "named of 24")
    assert sum(good) >= 22, said


@pytest.mark.campaign
def test_at_most_3_of_100_clean_campaigns_name_a_mistake(tmp_path: Path) -> None:
    said = [named(clean(k, SEED, tmp_path / str(k)))[0] for k in range(100)]
    assert sum(s != ("", "") for s in said) <= 3, said
