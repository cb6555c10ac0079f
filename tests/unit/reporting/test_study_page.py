"""The page of a study: its steps, its parts, what its author adds, and nothing that runs or loads; curves in the document's manner."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import thermid as td
from thermid.campaign.stages import Campaign
from thermid.reporting._blocks.content import (
    Code,
    Facts,
    Figures,
    Formulas,
    Head,
    Heading,
    Notes,
    Picture,
    Plot,
    Section,
    Table,
    Words,
    folded,
)
from thermid.reporting._pictures.chart import Area
from thermid.reporting._pictures.figures import curve, curves
from unit.reporting.conftest import points_in
from webpage import without_script

STUDY = Path(__file__).parents[3] / "examples" / "sisnav" / "study.toml"
EVIL = '"><script>alert(1)</script>{{ 7*7 }}'
TIMES = np.linspace(0.0, 18000.0, 101)


@pytest.fixture(scope="module")
def drawn() -> Plot:
    rise = 24.0 + 10.0 * (1.0 - np.exp(-TIMES / 3600.0))
    lines = [curve("measured", "measured", TIMES, rise), curve("a bound", "bound", TIMES, 24.0 + TIMES / 300.0)]
    return Plot(curves(lines, "one", "a rise", band=Area("95 %", TIMES, rise - 1, rise + 1), top=40.0), "a caption", "synthetic")


@pytest.fixture(scope="module")
def page(drawn: Plot, tmp_path_factory: pytest.TempPathFactory) -> str:
    blocks = [
        *(Words(EVIL), Heading("heading"), Notes((EVIL,), "note"), Facts((("name", "value"),)), Code("a = 1 < 2", "code")),
        *(Picture("<svg></svg>", "picture"), Formulas((("<math></math>", "(1)"),)), Figures((drawn,), drawn.drawn.legend)),
        folded("more", [Table.of_rows([Head("a")], [[EVIL]])]),
    ]
    section = Section.of_blocks("own", "What the author adds", blocks)
    target = tmp_path_factory.mktemp("page") / "deep" / "page.html"
    empty = Campaign("nothing run", {}, (), {})
    made = td.reporting.study_report(td.design.load_study(STUDY), empty, to=target, sections=[section], watermark="A trial & no more")
    assert made == target
    return target.read_text(encoding="utf-8")


def test_it_holds_the_four_steps_the_parts_and_where_values_come_from(page: str) -> None:
    for words in ("1  Knowledge and intended use", "2  Box colour", "3  Theoretical and experimental set-up", "4  Procedure"):
        assert words in page
    for item in td.design.load_study(STUDY).components:
        assert item in page
    assert page.count("with qualification") == 5
    assert "39 assumed, 5 derived, 27 published" in page
    assert "tau h A / c with tau = 5 h / ln 100" in page  # a formula, on record


def test_sections_come_between_the_parts_and_the_record(page: str) -> None:
    assert re.findall(r'<section id="([\w-]+)"', page) == ["steps", "parts", "own", "record"]
    assert "No verdict" in page


def test_texts_are_escaped_and_nothing_runs_or_loads(page: str) -> None:
    assert page.count("&lt;script&gt;") == 3
    assert "49" not in re.findall(r"alert\(1\)&lt;/script&gt;(\S*)", page)
    assert not re.search(r"\son\w+=|(?:src|href)=\"(?!#|data:)", without_script(page))


def test_the_watermark_stands_on_every_sheet_and_on_the_banner(page: str) -> None:
    assert "A TRIAL &amp; NO MORE" in page
    assert '@bottom-left{content:"A trial \\26  no more"}' in page


def test_curves_have_their_looks_and_say_where_they_leave(drawn: Plot) -> None:
    assert [(e.label, e.variable, e.dash) for e in drawn.drawn.legend] == [
        ("measured", "--f-measured", ""),
        ("a bound", "--f-residual", "1.5 2.5"),
        ("95 %", "--f-simulated", "band"),
    ]
    assert "84 °C at the end" in drawn.drawn.markup
    assert 0 < points_in(drawn.drawn.markup) < 1000
