"""Synthetic houses with noise on the wall: 95 % intervals hold each truth as often as they say, and innovations are white."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from recovery.process_cases import NAMES, SHARE, Fitted, fitted, rejected, shares

CASES, SAMPLES = 1000, 1000
PAGE = Path(__file__).parents[2] / "docs" / "coverage.md"


def test_a_few_cases() -> None:
    """Six values of ten houses: their errors in units of what is said have a size of one, by the 99.9 % range of chi-square."""
    found = [fitted(seed, 300) for seed in range(2000, 2010)]
    assert all(f.converged for f in found)
    apart = np.array([f.off for f in found])
    assert 0.4 < float(np.mean(apart**2)) < 1.9
    assert rejected(found) <= 0.1


def test_the_page_shows_each_value_of_a_thousand_cases() -> None:
    """Each row of the page lies within the range that the campaign asserts."""
    section = PAGE.read_text(encoding="utf-8").partition("<!-- process noise: begin -->")[2].partition("<!-- process noise: end -->")[0]
    assert f"{CASES} logs of {SAMPLES}" in section
    for name in NAMES:
        row = re.search(rf"^\| {name} \| ([0-9.]+) % \|", section, re.MULTILINE)
        assert row is not None, name
        assert SHARE[0] < float(row[1]) / 100 < SHARE[1], name


@pytest.fixture(scope="module")
def thousand() -> list[Fitted]:
    """Fits of a thousand logs."""
    return [fitted(seed, SAMPLES) for seed in range(CASES)]


@pytest.mark.campaign
def test_coverage_of_a_thousand_cases(thousand: list[Fitted]) -> None:
    assert all(f.converged for f in thousand)
    for name, share in shares(thousand).items():
        assert SHARE[0] < share < SHARE[1], (name, share)


@pytest.mark.campaign
def test_whiteness_fails_as_often_as_its_level(thousand: list[Fitted]) -> None:
    """1 %, by the 99 % range of a thousand; a test that never failed would see nothing."""
    assert 0.003 <= rejected(thousand) <= 0.019
