"""Numbers on pages: each with its unit, fitted ones with their error, no more digits than they are worth."""

from __future__ import annotations

from pathlib import Path

import pytest

import thermid as td
from thermid.campaign.stages import Campaign
from thermid.reporting._pages.campaign import report
from webpage import faults

TABLE = "<table><caption>x.</caption><thead><tr>{}</tr></thead><tbody><tr>{}</tr></tbody></table>"


def test_every_number_of_a_page_has_unit_and_error(campaign: Campaign, tmp_path: Path) -> None:
    run = td.simulate(
        campaign["submodel"].model,
        td.Scenario("hot", boundaries={"room": "45 [degC]"}, start="24 [degC]", duration="5 [h]"),
    )
    page = report(campaign, to=tmp_path / "page.html", scenarios=[("Hot", run)])
    assert faults(page.read_text(encoding="utf-8")) == []


@pytest.mark.parametrize(
    ("heads", "cells", "fault"),
    [
        ('<th scope="col" class="n">rise</th>', '<td class="n">8.9</td>', "has no unit"),
        ('<th scope="col" class="n">found</th><th scope="col">unit</th>', '<td class="n">8.9</td><td>K</td>', "has no ±"),
        ('<th scope="col" class="n">rise, K</th>', '<td class="n">8.912345678</td>', "too many digits"),
        ('<th scope="col" class="n">rise, K</th>', '<th class="n">8.9</th>', "no scope"),
    ],
)
def test_the_walk_over_tables_finds_what_is_wrong(heads: str, cells: str, fault: str) -> None:
    assert any(fault in f for f in faults(TABLE.format(heads, cells)))


def test_the_walk_over_tables_accepts_what_is_right() -> None:
    heads = '<th scope="col">value</th><th scope="col" class="n">found</th><th scope="col">unit</th>'
    assert faults(TABLE.format(heads, '<th scope="row">x</th><td class="n">8.91 ± 0.02</td><td>K</td>')) == []
