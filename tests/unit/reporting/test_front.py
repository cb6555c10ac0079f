"""The top of a report: the answer, the figure that decides, the coloured network, all tests at one look; numbers, files, audiences."""

from __future__ import annotations

import csv
import html
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import thermid as td
from thermid.base.errors import ScenarioError
from thermid.campaign.stages import Campaign, CampaignPrediction
from thermid.reporting._blocks.content import LONG, SHOWN, Cell, Figures, Head, Section, Sheets, Table, csv_of, folded, numbered, oversized
from thermid.reporting._diagrams.map import MIN_LETTER_SIZE, fitting_map
from thermid.reporting._pages import campaign as campaign_pages
from thermid.reporting._pages.campaign import NETWORK_SIZE, _decides, _named, _network, course_of, decisive, front, hottest_moment, report
from thermid.reporting._pages.tables import glance
from thermid.reporting._pictures import figures
from webpage import crossings, limited


@pytest.fixture(scope="module")
def page(campaign: Campaign, tmp_path_factory: pytest.TempPathFactory) -> str:
    return report(campaign, to=tmp_path_factory.mktemp("front") / "page.html").read_text(encoding="utf-8")


def test_the_sensor_that_takes_most_of_its_limit_decides(campaign: Campaign) -> None:
    found = decisive(campaign)
    assert found is not None
    (verdict,) = campaign.verdicts
    ratios = {(c.sensor, c.criterion): abs(c.found) / c.limit for c in verdict.checks}
    assert found.check is not None
    assert ratios[found.check.sensor, found.check.criterion] == max(ratios.values())
    k = int(np.abs(found.block.residuals).argmax())
    assert verdict.prediction is not None
    (read,) = [b for b in verdict.blocks if b.sensor == found.block.sensor]
    error = verdict.prediction.bias[read.sensor]
    said = found.sentence()
    assert f"residual {read.measured[k] - read.predicted[k]:+.2f} K" in said
    assert f"measured {read.measured[k] - error - 273.15:.2f} °C" in said
    assert f"simulated {read.predicted[k] - error - 273.15:.2f} °C" in said
    assert "0.0001 K" in said
    assert said.endswith("NOT met.")


def test_without_a_verdict_the_worst_fitted_sensor_stands_there_and_no_limit(campaign: Campaign) -> None:
    alone = replace(campaign, verdicts=())
    found = decisive(alone)
    assert found is not None
    assert found.limit is None
    assert not re.search("limit of [0-9]|NOT met", found.sentence())
    assert "T b" in found.sentence()
    assert decisive(Campaign("nothing", {}, (), {})) is None
    assert front(Campaign("nothing", {}, (), {})) == []


def test_a_curve_beside_the_corrected_air_is_that_of_its_node(campaign: Campaign) -> None:
    """Seen by a reader: a plate that read 0.6 K low began 0.9 K below the air about it. Readings lose their sensor's constant error."""
    fit = campaign.stages["component"]
    (read,) = [b for b in fit.blocks if b.sensor == "T box"]
    off = {"T box": fit.bias["T box"] - 0.6}
    moved = {"sensor T box": replace(fit.values["sensor T box"], value=off["T box"])}
    values = replace(fit.values, items_={**fit.values.items_, **moved})
    low = replace(fit, values=values, blocks=(replace(read, measured=read.measured - 0.6, predicted=read.predicted - 0.6),))
    found = decisive(Campaign("one", {"component": low}, (), {}))
    assert found is not None
    course = course_of(fit, read.record, read.times)
    assert course is not None
    assert np.abs(found.block.predicted - course[read.node].kelvin).max() < 0.01
    assert f"{off['T box']:+.2f} K" in _decides(found, course).caption
    assert f"{off['T box']:+.2f} K" not in _decides(replace(found, error=0.0), course).caption


def test_the_network_shows_the_hottest_moment_with_power_and_says_which(campaign: Campaign) -> None:
    """Seen by a reader: the map of a test that ended without power, at the moment of the worst error, carried 0.05 W."""
    found = decisive(campaign)
    assert found is not None
    course = course_of(found.fit, found.block.record)
    assert course is not None
    heat = np.where(np.arange(course.times.size) < 0.7 * course.times.size, 4.0, 0.0)
    cooling = np.where(heat > 0.0, course.temperatures.T, 297.0 + np.zeros_like(course.temperatures.T)).T
    cooling[-1] = cooling[int(np.flatnonzero(heat).max())] + 0.01  # hotter by a hair, without power
    run = SimpleNamespace(nodes=course.nodes, times=course.times, temperatures=cooling, load_powers={"heat": heat})
    moment = hottest_moment(run, ("a.case", "b.case"))  # type: ignore[arg-type]
    assert moment == int(np.flatnonzero(heat).max())
    alone = replace(found, fit=replace(found.fit, model=campaign["component"].model))
    assert (_network(alone, course) is None) == (len(campaign["component"].model.nodes) == 1)  # one node is no picture
    network = _network(found, course)
    assert network is not None
    assert MOMENT.search(network.caption)


def test_a_small_residual_is_seen_beside_a_wide_limit() -> None:
    times = np.arange(0.0, 3600.0, 60.0)
    residual = 0.02 * np.sin(times / 200.0)
    heights = {}
    for limit in (0.05, 2.0):
        figure = figures.compared(times, 300.0 + residual, np.full(times.size, 300.0), "k", "T", limit=limit)
        ends = [[float(v) for v in e.split()] for e in re.findall(r'data-ends="([^"]*)"', figure.markup)]
        heights[limit] = ends[1][3] - ends[1][2]
        assert ("limit" in " ".join(e.label for e in figure.legend)) == (limit == 0.05)
    assert heights[2.0] < 0.1 < heights[0.05]


def test_the_next_steps_name_a_broken_limit_and_the_warnings(campaign: Campaign) -> None:
    warned = replace(campaign.stages["submodel"], warnings=("the residuals a ... b are large. Look for missing physics.", "another."))
    told = replace(campaign, stages={**campaign.stages, "submodel": warned}, verdicts=())
    said = [r.text for r in glance(told, {}).next]
    words = "2 warnings of submodel. The first: the residuals a ... b are large."
    assert words in said
    loads = {"a.heat": "4 [W]", "b.heat": "0.5 [W]"}
    hot = td.Scenario("hot", boundaries={"room": "40 [degC]"}, loads=loads, start="40 [degC]", duration=7200.0)
    band = td.predict(campaign.stages["submodel"], hot)
    end = band["a.case"].final
    advice = []
    for limit in (end.celsius - 3.0, end.high - 0.01):
        broken = CampaignPrediction("hot", "submodel", band, {"a.case": (0.0, limit + 273.15)})
        (line,) = [r for r in glance(told, {"predictions": "there"}, [broken]).next if r.place == "there"]
        assert broken.head[1:] in line.text
        advice.append(line.text.partition(broken.head[1:])[2])
    assert advice[0] != advice[1], "less power where the best values exceed the limit, a narrower band where it alone does"
    wide = CampaignPrediction("cold", "submodel", band, {"a.case": (0.0, 400.0)})
    table, drawn, *_ = _named([wide, broken], brief=True)  # seen in a summary: the broken limit was beyond its first five lines
    assert isinstance(table, Table)
    assert [row[0].text for row in table.rows] == ["hot", "cold"]
    assert isinstance(drawn, Figures)
    assert drawn.plots[0].caption.startswith("hot (")


def test_answer_figure_and_network_come_before_all_else(page: str) -> None:
    marks = ('class="sum', r" K, \w+ [\d.]+ K \(\d+ %\): ", 'id="fig-decides"', 'id="fig-network"', 'class="glance"')
    order = [found.start() for mark in marks if (found := re.search(mark, page))]
    assert len(order) == len(marks)
    assert order == sorted(order)
    decides = page[page.index('id="fig-decides"') : page.index('id="fig-network"')]
    for name in ("measured", "simulated", "measured less simulated", "ambient room", "power", "limit, residual"):
        assert f'data-n="{name}"' in decides, name
    assert "NOT met" in decides


def test_room_and_power_are_drawn_in_every_transient(page: str) -> None:
    transients = [f for f in re.findall(r'<svg class="plot".*?</svg>', page, re.DOTALL) if 'data-n="measured"' in f]
    assert len(transients) == 6  # the one that decides, two held out, three fitted
    for figure in transients:
        assert re.search(r'data-n="ambient (air|room)"', figure)
        assert 'data-n="power"' in figure


def test_no_curve_passes_a_drawn_limit_unless_the_verdict_says_so(campaign: Campaign, page: str, tmp_path: Path) -> None:
    drawn = limited(page)
    assert len(drawn) == 3
    for caption, figure in drawn:
        assert crossings(figure)
        assert "NOT met" in caption
    (verdict,) = campaign.verdicts
    kept = tuple(replace(c, limit=5.0, met=True) for c in verdict.checks)
    good = report(replace(campaign, verdicts=(replace(verdict, checks=kept),)), to=tmp_path / "good.html").read_text(encoding="utf-8")
    for caption, figure in limited(good):
        assert crossings(figure) == []
        assert "NOT met" not in caption


def test_figures_and_tables_are_numbered_and_references_say_their_numbers(page: str) -> None:
    for word in ("Fig.", "Table"):
        found = [int(n) for n in re.findall(rf'<b class="no">{re.escape(word)}\u00a0(\d+)</b>', page)]
        assert found == list(range(1, len(found) + 1))
        assert len(found) > 4
    assert len(re.findall("<figure", page)) == len(re.findall(r'<b class="no">Fig', page))
    assert len(re.findall("<table", page)) == len(re.findall(r'<b class="no">Table', page))
    refs = dict(re.findall(r'<a href="#((?:fig|table)-\w+)">([^<]+)</a>', page))
    assert refs == {
        "fig-decides": "Fig.\u00a01",
        "fig-network": "Fig.\u00a02",
        "fig-matrix": "Fig.\u00a03",
        "table-verdicts": "Table\u00a02",
    }
    for key, number in refs.items():
        at = page.index(f'id="{key}"')
        assert re.search(r'<b class="no">([^<]+)</b>', page[at:])[1] == number  # type: ignore[index]


def test_a_reference_to_what_is_not_there_is_left_out() -> None:
    figures = '<figure id="a"><i class="no"></i>one</figure><figure><i class="no"></i>two</figure>'
    text = figures + '<a class="ref" href="#a"></a><a class="ref" href="#b"></a>'
    out = numbered(text)
    assert out.count("Fig.\u00a02") == 1
    assert out.endswith('<a href="#a">Fig.\u00a01</a>')
    fold = f"<details><summary>all</summary><details><summary>some</summary>{figures}</details>{figures}</details>"
    summaries = re.findall(r"<summary>([a-z]+) <span class=.soft.>Fig.\u00a0([^<]+)<", numbered(figures + fold))
    assert summaries == [("all", "3 to 6"), ("some", "3 to 4")]


def test_a_long_table_is_a_file_too_and_its_page_says_where(tmp_path: Path) -> None:
    lines = [[Cell("part" if k % 2 == 0 else "", "", "same" if k % 2 else "main"), f"{k} [W]"] for k in range(40)]
    table = Table.of_rows([Head("what"), Head("power", True)], lines, title="Every value")
    for audience, shown in SHOWN.items():
        sheets = Sheets(tmp_path / f"{audience}.tables", audience)
        assert sheets.place_of(table, "") == (min(shown, 40), f"{audience}.tables/every_value.csv")
        assert sheets.place_of(replace(table, rows=table.rows[: LONG[audience] - 1]), "") == (LONG[audience] - 1, "")
        sheets.write()
        rows = list(csv.reader((tmp_path / f"{audience}.tables" / "every_value.csv").read_text(encoding="utf-8").splitlines()))
        assert rows[0] == ["what", "power"]
        assert rows[1:3] == [["part", "0 W"], ["part", "1 W"]]  # a blank cell says what stands above it
        assert len(rows) == 41


def test_two_tables_of_one_name_are_two_files(tmp_path: Path) -> None:
    one = Table.of_rows([Head("a")], [["1"]], title="Values")
    sheets = Sheets(tmp_path / "x.tables")
    names = [sheets.keep(t) for t in (one, Table.of_rows([Head("a")], [["2"]], title="Values"), one)]
    assert names == ["x.tables/values.csv", "x.tables/values_2.csv", "x.tables/values.csv"]
    assert csv_of(one) == "a\n1\n"


def test_what_opens_on_demand_is_in_files_alone_unless_everything_is_asked_for(tmp_path: Path) -> None:
    section = Section.of_blocks("s", "Title", [folded("More", [Table.of_rows([Head("a")], [["1"]])])])
    whole, brief = Sheets(tmp_path, "all"), Sheets(tmp_path, "agency")
    assert whole.shortened([section]) == [section]
    assert brief.shortened([section])[0].blocks == ()
    assert list(brief.files) == ["more.csv"]


def test_a_report_is_as_long_as_its_audience_reads(campaign: Campaign, tmp_path: Path) -> None:
    pages = {a: report(campaign, to=tmp_path / f"{a}.html", audience=a).read_text(encoding="utf-8") for a in ("summary", "agency", "all")}
    assert len(pages["summary"]) < len(pages["agency"]) < len(pages["all"])
    for text in pages.values():
        assert 'id="fig-decides"' in text
        assert 'id="table-verdicts"' in text
        assert "✗ 1 of 1" in html.unescape(re.search(r'<p class="sum[^>]*>([^<]*)', text)[1])  # type: ignore[index]
    assert "Stage 1" not in pages["summary"]
    assert "<details" not in re.sub(r'<details class="menu">', "", pages["summary"])
    with pytest.raises(ScenarioError, match="not for 'everyone'"):
        report(campaign, to=tmp_path / "no.html", audience="everyone")


def _chain(count: int) -> td.Model:
    nodes = {f"n{k}": {"capacitance": "100 [J/K]"} for k in range(count)}
    joints = {f"j{k}": {"kind": "conduction", "between": [f"n{k}", f"n{k + 1}"], "conductance": "1 [W/K]"} for k in range(count - 1)}
    out = {"out": {"kind": "conduction", "between": ["n0", "air"], "conductance": "1 [W/K]"}}
    heater = {"heater": {"into": f"n{count - 1}", "power": "2 [W]"}}
    return td.model_from_dict({"title": "chain", "needs": ["air"], "nodes": nodes, "conductors": joints | out, "loads": heater})


MOMENT = re.compile(r"[\d.]+ (s|min|h) of held out, .*\b[ab]\.case ")
CARD = re.compile(r'<rect class="card[^"]*" x="([\d.]+)" y="([\d.]+)" width="([\d.]+)" height="([\d.]+)"')


@pytest.mark.parametrize("count", [1, 2, 5, 25])
def test_the_coloured_network_says_temperatures_and_heat(count: int) -> None:
    model = _chain(count)
    temperatures = {f"n{k}": 300.0 + 2.0 * k for k in range(count)} | {"air": 298.0}
    flows = {f"j{k}": -2.0 for k in range(count - 1)} | {"out": 2.0}
    told = {"temperatures": temperatures, "flows": flows, "powers": {"heater": 2.0}}
    picture = fitting_map(model, NETWORK_SIZE, **told)
    assert picture == fitting_map(model, NETWORK_SIZE, **told)
    boxes = [tuple(map(float, c)) for c in CARD.findall(picture)]
    for k, (x, y, w, h) in enumerate(boxes):
        for u, v, s, t in boxes[:k]:
            assert x + w <= u or u + s <= x or y + h <= v or v + t <= y
    assert "26.9 °C" in picture
    assert "+2 W" in picture.replace("\u2009", " ")
    assert "→ air 2 W" in picture.replace("\u2009", " ")


def test_the_smallest_letters_of_the_network_have_six_and_a_half_points_on_paper() -> None:
    """As wide as figures at the top of a sheet are: the smallest letters that a referee reads without a lens."""
    style = Path(campaign_pages.__file__).parents[1] / "_blocks" / "page.css.jinja"
    width = re.search(r"\.lead figure\{width:(\d+)mm", style.read_text(encoding="utf-8"))
    assert width is not None
    points = float(width[1]) / 25.4 * 72.0
    assert MIN_LETTER_SIZE * points / NETWORK_SIZE[0] == pytest.approx(6.5, abs=0.05)


def test_parts_are_folded_until_the_network_fits() -> None:
    """From the innermost out, and no more than needed: those of the measurement unit before the unit itself."""
    model = td.load_model(Path(__file__).parents[3] / "examples" / "sisnav" / "m_Sd.toml")
    cards = {}
    for name, size in (("whole", (3000.0, 3000.0)), ("inner", (900.0, 700.0)), ("outer", (10.0, 10.0))):
        picture = fitting_map(model, size)
        assert oversized(picture, size) == (name == "outer")
        cards[name] = len(CARD.findall(picture))
    assert cards["whole"] >= cards["inner"] > cards["outer"] >= 3


def test_the_matrix_frames_and_marks_what_is_not_met() -> None:
    cells = {("one", "a"): (0.4, True), ("one", "b"): (1.3, False), ("two", "a"): (0.9, True)}
    drawn = figures.matrix(cells).markup
    assert drawn.count("<rect") == 3
    assert drawn.count("✗ 1.30") == 1
    assert len({figures.shade(r) for r in (0.0, 0.5, 1.0, 1.01, 2.0)}) == 5
    assert figures.shade(7.0) == figures.shade(2.0)


def test_scatter_and_histogram_say_how_many_readings_lie_within_2_3_and_5_kelvin() -> None:
    measured = [np.array([300.0, 301.0, 302.0, 303.0])]
    predicted = [measured[0] - np.array([0.5, -2.5, 4.0, -6.0])]
    words = "25 % within 2 K, 50 % within 3 K, 75 % within 5 K"
    assert words in figures.scatter(measured, predicted).markup
    assert words in figures.against_measured(measured, predicted, "Predicted")[1].caption
    drawn = figures.scatter(measured, predicted).markup
    assert len(set(re.findall(r"stroke-dasharray:([^\"]+)", drawn))) == 3
    heights = sorted({float(y) for y in re.findall(r'<path d="M[\d.]+ ([\d.]+)L[\d.]+ \1"', drawn)})
    assert len(heights) == 7
    assert min(np.diff(heights)) > 8.0  # px: lines that merge tell nothing
    nearly = figures.against_measured([np.full(1000, 300.0)], [np.append(np.full(999, 300.0), 303.68)], "simulated")
    assert all(part in nearly[1].caption for part in ("99.9 %", "3 K (1 of 1,000", ", 100 %", "5 K"))
    close = [measured[0] - np.array([0.05, -0.04, 0.02, 0.0])]
    assert "stroke-dasharray:6" not in figures.scatter(measured, close).markup  # lines at kelvins would make one line of the dots
    assert not re.search(r"[235] K", " ".join(plot.caption for plot in figures.against_measured(measured, close, "simulated")))
    assert "4 " in figures.histogram([measured[0] - predicted[0]]).markup
