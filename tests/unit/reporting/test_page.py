"""The page: complete, self-contained, well-formed; hostile names stay text; a missing extra is told in words."""

from __future__ import annotations

import math
import re
import sys
import time
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.campaign.stages import Campaign
from thermid.fit.calibration import MovedGroup, Moves
from thermid.model.tree import Standing
from thermid.reporting._blocks import content as extras
from thermid.reporting._pages import campaign as page_module
from thermid.reporting._pages.campaign import report
from webpage import without_script

VOID = {"meta", "br", "img", "hr", "input", "link"}
EVIL = '"><script>alert(1)</script><img src=x onerror=alert(2)>{{ 7*7 }}'


class Page(HTMLParser):
    """A page as a tree of open elements: refuses what is not closed in order."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.open: list[str] = []
        self.elements: list[tuple[str, dict[str, str]]] = []
        self.words: list[str] = []
        self.source = path.read_text(encoding="utf-8")
        self.feed(self.source.replace("<wbr>", ""))  # where a long name may break: no part of the words
        self.close()
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, {k: v or "" for k, v in attrs}))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, {k: v or "" for k, v in attrs}))

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self.open[-1:] not in (["style"], ["script"]):
            self.words.append(data)

    @property
    def text(self) -> str:
        return " ".join(" ".join(self.words).split())

    def all(self, tag: str) -> list[dict[str, str]]:
        return [a for t, a in self.elements if t == tag]


@pytest.fixture(scope="module")
def page(campaign: Campaign, tmp_path_factory: pytest.TempPathFactory) -> Page:
    bench = td.Scenario("hot bench", boundaries={"room": "45 [degC]"}, start="24 [degC]", duration="5 [h]")
    model = campaign["submodel"].model
    runs = [("Hot", td.simulate(model, bench)), ("Vacuum", td.simulate(model, bench.vacuum(as_printed=True)))]
    target = tmp_path_factory.mktemp("out") / "new" / "report.html"
    assert report(campaign, to=target, scenarios=runs, notes="First thought.\n\nSecond thought.") == target
    return Page(target)


def test_sections_stand_in_order(page: Page) -> None:
    ids = [a["id"] for t, a in page.elements if t == "section"]
    named = [i for i in ids if i != "warnings"]
    assert named == ["verdicts", "levels", "overview", "stage-1", "stage-2", "predictions", "provenance"]
    for title in (
        "Two boxes",
        "Made in Python.",
        "First thought.",
        "Second thought.",
        "Stage 1: component",
        "Stage 2: submodel",
        "Hot",
        "Vacuum",
    ):
        assert title in page.text
    assert len(page.all("h1")) == 1


def test_synthetic_data_raise_a_banner_and_measured_ones_do_not(page: Page, measured: Campaign, tmp_path: Path) -> None:
    assert "SYNTHETIC DATA" in page.text
    assert "All 3 records are synthetic: alone, together, held out. Results from them are not evidence about real hardware." in page.text
    assert page.source.index("SYNTHETIC DATA") < page.source.index('id="verdicts"')
    clean = Page(report(measured, to=tmp_path / "m.html"))
    assert "SYNTHETIC" not in clean.text
    shown = measured.verdicts[0].prediction
    made = replace(shown.values, provenance={**shown.values.provenance, "synthetic": True})
    half = replace(
        measured,
        verdicts=(replace(measured.verdicts[0], prediction=replace(shown, experiments=(), values=made)),),
    )
    assert "1 of 3" in Page(report(half, to=tmp_path / "h.html")).text


def test_the_verdict_comes_first_and_says_what_failed(page: Page, campaign: Campaign, tmp_path: Path) -> None:
    assert "✗ 1 of 1" in page.text
    assert page.text.index("1 of 1 verdict failed") < page.text.index("Stage 1")
    good = replace(campaign.verdicts[0], checks=tuple(c for c in campaign.verdicts[0].checks if c.passed))
    assert "✓ The only verdict passed" in Page(report(replace(campaign, verdicts=(good,)), to=tmp_path / "g.html")).text
    doubted = replace(campaign, verdicts=(replace(good, standing=Standing("not adequate", "why", "submodel")),))
    assert "? 1 of 1 " in " ".join(Page(report(doubted, to=tmp_path / "d.html")).text.split())
    assert re.fullmatch("2 stages, 0 of 1 verdict.*, 1 .* not adequate", doubted.counts)
    assert "submodel on held out" in page.text  # which verdict failed stands in the head
    assert 'class="sum good"' in Page(report(replace(campaign, verdicts=(good,)), to=tmp_path / "g.html")).source
    off = replace(campaign["submodel"], moved=Moves((), (MovedGroup("all together", ("a.power",), 11.6, 1, 0.0007),)))
    shifted = Page(report(replace(campaign, stages={**campaign.stages, "submodel": off}, verdicts=(good,)), to=tmp_path / "s.html"))
    assert "moved in submodel" in shifted.text
    assert 'class="sum good"' not in shifted.source
    none = Page(report(replace(campaign, verdicts=()), to=tmp_path / "n.html")).text
    assert "a fit alone does not validate the model" in none


def test_every_parameter_stands_with_unit_and_both_errors(page: Page, campaign: Campaign) -> None:
    cells = [re.sub(r"<[^>]+>", "", c) for c in re.findall(r"<t[dh](?: [^>]*)?>(.*?)</t[dh]>", page.source)]
    for stage in campaign:
        for path in campaign[stage].values.parameters:
            at = cells.index(path)
            assert "W/(m² K)" in cells[at : at + 11]
    for heading in ("± random", "± total", "unit", "bounds", "source before", "state"):
        assert heading in page.text


def test_the_page_loads_nothing_and_runs_nothing(page: Page) -> None:
    assert "://" not in page.source
    without_script(page.source)
    assert not page.all("link")
    assert not page.all("iframe")
    assert "@import" not in page.source
    assert all(a["src"].startswith("data:") for t, a in page.elements if "src" in a)
    assert all(ref.startswith("#") for ref in re.findall(r"url\(([^)]*)\)", page.source))


@pytest.mark.parametrize("audience", ["all", "agency", "summary"])
def test_identifiers_are_unique_and_every_reference_has_its_end(campaign: Campaign, tmp_path: Path, audience: str) -> None:
    values = campaign["component"].values
    vague = {p: replace(v, error=math.inf) for p, v in values.items()}
    told = replace(campaign["component"], values=replace(values, items_=vague))
    page = Page(report(replace(campaign, stages={**campaign.stages, "component": told}), to=tmp_path / "r.html", audience=audience))
    assert any(f"{path}: " in page.text for path in values.parameters), "what no log determines is named for every reader"
    ids = [a["id"] for _, a in page.elements if "id" in a]
    assert len(set(ids)) == len(ids)
    ends = re.findall(r'href="#([^"]+)"|url\(#([^)]+)\)', page.source)
    assert ends
    assert {a or b for a, b in ends} <= set(ids)


def test_diagrams_traces_and_predictions_are_drawn(page: Page, campaign: Campaign) -> None:
    """Which sensor decides is what the verdict says, not the test: the centre of its band follows every change of the model of error."""
    worst = max((c for v in campaign.verdicts for c in v.checks), key=lambda c: c.used).sensor
    pictures = [a for a in page.all("svg")]
    assert sum(a.get("class") == "thermid-map" for a in pictures) == 5  # the one that decides, two stages, two ends of a prediction
    plots = [a["aria-label"] for a in pictures if a.get("class") == "plot"]
    for name in ("T box in alone", "T a in together", "T b in together", "T a in held out", "T b in held out"):
        assert sum(p.startswith(name) for p in plots) == 1 + (name == f"{worst} in held out")  # what decides stands at the top too
    assert sum(p.startswith("Hot: predicted temperatures. Time 0 to 5 h") for p in plots) == 1
    assert "without limit" in page.text  # the warning of the run in vacuum
    assert "heat into case: as logged" in page.source  # the fit used the log's power, and the picture does not show the deck's 4 W
    assert "heat into case: 4 W" not in page.source


def test_warnings_are_told_at_the_top_and_at_the_stage(campaign: Campaign, tmp_path: Path) -> None:
    told = replace(campaign["component"], warnings=("the moon was full.",))
    text = Page(report(replace(campaign, stages={**campaign.stages, "component": told}), to=tmp_path / "w.html")).text
    assert text.count("the moon was full.") == 3  # what to do next, all warnings, the stage
    assert text.index("Warnings component : the moon was full.") < text.index("Stage 1")


def hostile(campaign: Campaign) -> Campaign:
    """The campaign with every name that a stranger may choose turned into an attack."""

    def soil(fit: td.Calibration) -> td.Calibration:
        names = {b.sensor: f"{b.sensor}{EVIL}" for b in fit.blocks}
        blocks = tuple(replace(b, sensor=names[b.sensor], record=b.record + EVIL, node=b.node + EVIL) for b in fit.blocks)
        local = tuple(replace(i, record=i.record + EVIL, name=i.name + EVIL) for i in fit.local)
        model = replace(fit.given_model, title=fit.given_model.title + EVIL, use=EVIL)
        records = {r + EVIL: sha for r, sha in fit.records.items()}
        values = replace(fit.values, provenance={**fit.values.provenance, "records": records})
        return replace(fit, stage=fit.stage + EVIL, given_model=model, blocks=blocks, local=local, values=values, warnings=(EVIL,))

    verdicts = tuple(
        replace(v, model=EVIL, record=EVIL, title=EVIL, fitted_locally=(EVIL,), prediction=soil(v.prediction)) for v in campaign.verdicts
    )
    stages = {name + EVIL: soil(c) for name, c in campaign.stages.items()}
    return Campaign(EVIL, stages, verdicts, {name: EVIL for name in stages}, EVIL)


def test_hostile_names_never_become_markup(campaign: Campaign, tmp_path: Path) -> None:
    model = campaign["component"].model
    run = td.simulate(model, td.Scenario(EVIL, boundaries={"air": "24 [degC]"}, start="24 [degC]", duration="1 [h]"))
    soiled = Page(report(hostile(campaign), to=tmp_path / "evil.html", scenarios=[(EVIL, run)], notes=[EVIL]))
    assert not any(name.startswith("on") for _, attributes in soiled.elements for name in attributes)
    assert all(a["src"].startswith("data:") for a in soiled.all("img"))
    without_script(soiled.source)
    assert soiled.text.count("<script>alert(1)</script>") > 20
    assert "{{ 7*7 }}" in soiled.text


@pytest.mark.slow
def test_sixty_records_make_a_small_page_soon(campaign: Campaign, tmp_path: Path) -> None:
    fit = campaign["submodel"]
    rng = np.random.default_rng(5)
    times = np.arange(1540.0)
    blocks = []
    for k in range(60):
        for sensor in ("T a", "T b"):
            predicted = 300.0 + 5.0 * np.sin(times / (50.0 + k))
            blocks.append(
                replace(
                    fit.blocks[0],
                    record=f"run {k}",
                    sensor=sensor,
                    times=times,
                    measured=predicted + 0.1 * rng.standard_normal(1540),
                    predicted=predicted,
                )
            )
    values = replace(fit.values, provenance={**fit.values.provenance, "records": {f"run {k}": f"{k:064x}" for k in range(60)}})
    many = replace(fit, blocks=tuple(blocks), values=values, experiments=())
    stages = {f"level {n}": replace(many, stage=f"level {n}") for n in range(4)}
    begun = time.process_time()
    target = report(Campaign("Many", stages, (), dict.fromkeys(stages, "0")), to=tmp_path / "many.html")
    assert time.process_time() - begun < 30.0
    assert target.stat().st_size < 6e6
    big = Page(target)
    plots = [a["aria-label"] for a in big.all("svg") if a.get("class") == "plot"]
    assert len(plots) == 4 * 12 + 1 + 3  # the worst trace, all readings and all residuals at the top
    assert big.text.count("12 of 120 ") == 4
    assert "worst of T a" in big.text
    rows = re.findall(r"<tr><td>run 59</td>", big.source)
    assert len(rows) == 4 * 2  # every record is in the tables


def test_a_missing_extra_is_told_in_words(campaign: Campaign, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "jinja2", None)
    with raises_code("extra.not-installed", match="'jinja2'.*jinja2"):
        report(campaign, to=tmp_path / "x.html")
    assert not (tmp_path / "x.html").exists()


def test_a_name_that_ends_in_pdf_is_a_pdf_or_refused(campaign: Campaign, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The program in place of a browser writes the words PDF and the page's size where it is told to print."""
    printer = tmp_path / "chromium"
    printer.write_text(
        '#!/bin/sh\nfor a; do case "$a" in --print-to-pdf=*) to="${a#--print-to-pdf=}";; file:*) of="${a#file://}";; esac; done\n'
        'printf "%%PDF-1.4 " > "$to"; grep -c "</html>" "$of" >> "$to"\n',
        encoding="utf-8",
    )
    printer.chmod(0o755)
    monkeypatch.setattr(extras, "browser", lambda: str(printer))
    made = td.report(campaign, to=tmp_path / "out" / "x.PDF")
    assert made == tmp_path / "out" / "x.PDF"
    assert made.read_bytes().startswith(b"%PDF-1.4 1\n")
    assert [p.name for p in made.parent.iterdir() if p.suffix.lower() in (".html", ".pdf")] == ["x.PDF"]
    with raises_code("output.wrong-ending", td.errors.OutputError, match=r"'\.docx'"):
        td.report(campaign, to=tmp_path / "x.docx")

    def none() -> str:
        raise extras.NoBrowserError("no browser here")

    monkeypatch.setattr(extras, "browser", none)
    monkeypatch.setattr(page_module, "front", lambda campaign: pytest.fail("the page was begun"))
    with pytest.raises(extras.NoBrowserError):
        td.report(campaign, to=tmp_path / "y.pdf")
    assert not (tmp_path / "y.pdf").exists()


def test_report_is_public() -> None:
    import thermid

    found: Any = thermid.report
    assert found.__wrapped__ is report


@pytest.mark.parametrize(
    ("written", "printed"),
    [
        ("Their 6010 samples are worth 5.6e+02 independent ones", "Their 6010 samples are worth 560 independent ones"),
        ("1.414e+04 W, up to 1.7e+02 g/m^2", "14140 W, up to 170 g/m²"),
        ("what does not add up: 3.9e-12 of it", "what does not add up: 3.9·10⁻¹² of it"),
        ("9.81 [m/s^2], 22 [degC] .. 50 [degC], ± 0.1 [K], 40 [1]", "9.81 m/s², 22 °C .. 50 °C, ± 0.1 K, 40"),
        ("0 [read], -40 [project]", "0 (read), -40 (project)"),
        ("goal of +-3 C, within +- 2 K", "goal of ± 3 C, within ± 2 K"),
        ("-0.00 K, -0.004, 1-0.0", "0.00 K, -0.004, 1-0.0"),
        ("61e6c3878e9265 log1e-2.csv [set] T1 [degC] 20 (95/95)^1.4", "61e6c3878e9265 log1e-2.csv [set] T1 [°C] 20 (95/95)^1.4"),
    ],
)
def test_words_of_terminals_are_printed_as_a_page_does(written: str, printed: str) -> None:
    from thermid.reporting._blocks.content import typeset

    assert typeset(written) == printed
    assert typeset(printed) == printed


def test_nominal_against_observed_coverage_is_a_figure_where_a_verdict_has_bands(page: Page, campaign: Campaign, tmp_path: Path) -> None:
    (verdict,) = campaign.verdicts
    assert verdict.bands is not None
    assert "a hold-out record a line" in page.text
    assert f'data-n="{verdict.record}"' in page.source[page.source.index('id="coverage') :]
    assert "95 %" in page.text
    for words in verdict.bands.warnings:
        assert f"warning: {words}" in str(verdict)
        assert words[:40] in page.text
    bare = Page(report(replace(campaign, verdicts=(replace(verdict, bands=None),)), to=tmp_path / "b.html"))
    assert "a hold-out record a line" not in bare.text
