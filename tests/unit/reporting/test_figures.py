"""Figures: drawing is thinned, statistics are not; which traces are drawn; texts stay texts."""

from __future__ import annotations

import re

import numpy as np
import pytest

import thermid as td
from thermid.fit.calibration import SensorTrace
from thermid.reporting._pictures import chart, figures
from thermid.reporting._pictures.chart import DASHES, SERIES, Panel, Stroke, series_look, thinned
from thermid.reporting._pictures.figures import Dots, choose, coverage, overview, prediction, time_unit, trace
from unit.reporting.conftest import points_in


def block(record: str = "r", sensor: str = "T", size: int = 500, rmse: float = 0.1, seed: int = 0) -> SensorTrace:
    rng = np.random.default_rng(seed)
    times = np.linspace(0.0, 3600.0, size)
    predicted = 300.0 + 10.0 * (1.0 - np.exp(-times / 900.0))
    noise = rng.standard_normal(size)
    return SensorTrace(record, sensor, "case", times, predicted + rmse * noise / np.sqrt(np.mean(noise**2)), predicted, rmse)


def test_thinning_keeps_the_ends_and_every_spike() -> None:
    values = np.sin(np.linspace(0.0, 20.0, 50_000))
    values[31_234], values[7] = 9.0, -9.0
    kept = thinned(values, 300)
    assert kept.size <= 300
    assert {0, 7, 31_234, 49_999} <= set(kept.tolist())
    assert (np.diff(kept) > 0).all()
    assert thinned(values[:200], 300).size == 200


def test_thinning_keeps_two_samples_of_each_stretch_and_both_ends() -> None:
    values = np.sin(np.arange(1000.0))  # 50 stretches of 20, none with its extremes at an end of the trace
    assert [thinned(values, most).size for most in (102, 4)] == [102, 4]


def test_a_long_trace_is_thinned_in_the_drawing_alone() -> None:
    long = block(size=40_000)
    drawn = trace(long, "k", "label")
    assert points_in(drawn.markup) < 3 * chart.POINTS_PER_LINE + 10
    assert len(drawn.markup) < 20_000
    assert long.residuals.size == 40_000


def test_ticks_keep_their_decimals() -> None:
    drawn = overview(
        [Dots("stage", {"T": [0.011, 0.032]})],
    )
    ticks = re.findall(r">(\d+\.\d+)</text>", drawn.markup)
    assert "0.005" in ticks
    assert len(set(ticks)) == len(ticks)


def test_time_axis_reads_in_the_unit_of_the_duration() -> None:
    assert time_unit(120.0)[1] == "s"
    assert time_unit(1540.0)[1] == "min"
    assert time_unit(18_000.0)[1] == "h"
    assert "time, min" in trace(block(), "k", "l").markup
    assert "temperature, °C" in trace(block(), "k", "l").markup


def test_a_gap_in_the_samples_breaks_the_line() -> None:
    whole = block()
    keep = (whole.times < 1000.0) | (whole.times > 2500.0)
    torn = SensorTrace("r", "T", "case", whole.times[keep], whole.measured[keep], whole.predicted[keep], 0.1)

    def moves(b: SensorTrace) -> int:
        return max(path.count("M") for path in re.findall(r'class="line"[^>]* d="([^"]*)"', trace(b, "k", "l").markup))

    assert moves(whole) == 1
    assert moves(torn) == 2


def test_few_traces_are_all_drawn_and_many_are_chosen_from() -> None:
    few = [block(f"r{k}", rmse=0.1 + 0.01 * k, seed=k) for k in range(5)]
    assert [b for b, _ in choose(few)] == few
    many = [block(f"r{k:02d}", s, 50, 0.1 + 0.01 * ((7 * k) % 60), k) for k in range(60) for s in ("T1", "T2")]
    chosen = choose(many)
    assert len(chosen) == figures.MOST_TRACES
    marks = {mark: b for b, mark in chosen if mark}
    assert set(marks) == {f"{word} of {s}" for word in ("best", "median", "worst") for s in ("T1", "T2")}
    for sensor in ("T1", "T2"):
        own = sorted(float(np.sqrt(np.mean(b.residuals**2))) for b in many if b.sensor == sensor)
        for word, value in (("best", own[0]), ("median", own[30]), ("worst", own[-1])):
            assert float(np.sqrt(np.mean(marks[f"{word} of {sensor}"].residuals ** 2))) == value


def test_many_sensors_do_not_crowd_out_the_limit() -> None:
    many = [block(f"r{k}", f"T{s}", 30, 0.1 + 0.01 * k, k) for k in range(4) for s in range(9)]
    chosen = choose(many)
    assert len(chosen) == figures.MOST_TRACES
    assert sum(mark.startswith("worst") for _, mark in chosen) == 9


def test_figures_of_one_page_do_not_share_identifiers() -> None:
    first, second = (trace(block(), key, "l").markup for key in ("one", "two"))
    ids = [set(re.findall(r'\bid="([^"]+)"', m)) for m in (first, second)]
    assert ids[0]
    assert not ids[0] & ids[1]
    for markup, known in zip((first, second), ids, strict=True):
        assert set(re.findall(r'url\(#([^)]+)\)|href="#([^"]+)"', markup)) <= {(i, "") for i in known} | {("", i) for i in known}


def test_figures_load_nothing_and_style_nothing_else() -> None:
    markup = trace(block(), "k", "l").markup
    assert "://" not in markup
    assert "<style" not in markup
    assert "var(--f-simulated,#0072b2)" in markup


@pytest.mark.parametrize("name", ["<script>alert(1)</script>", "$x", "_hidden", "温度"])
def test_strange_names_stay_text(name: str) -> None:
    drawn = overview(
        [Dots(name, {name: [0.1, 0.2]})],
    )
    assert "<script" not in drawn.markup
    assert drawn.legend[0].label == name
    assert "<script" not in trace(block(), "k", name).markup


def test_a_prediction_shows_every_node_and_stays_small_with_many(box: td.Model) -> None:
    solution = td.simulate(box, td.Scenario("s", boundaries={"air": "24 [degC]"}, start="24 [degC]", duration="5 [h]"))
    drawn = prediction(solution, "p", "label")
    assert drawn.markup.startswith("<svg")
    assert [e.label.split()[0] for e in drawn.legend] == list(solution.nodes)
    assert f"{solution['case'].final:.1f} °C" in drawn.legend[0].label
    x = np.linspace(0.0, 1.0, 5000)
    many = [Stroke(f"node {k}", x, np.sin(9 * x + k), ("--s0", "#000000")) for k in range(500)]
    markup = chart.chart([Panel("temperature", "°C", many)], key="k", label="l", x_name=("time", "h"), size=(760, 330))
    # a point takes some ten characters in a path, so that half of a megabyte holds them twice over
    assert 0 < points_in(markup) <= 24_000
    assert len(markup) < 500_000


def test_a_line_is_read_back_from_its_path_to_a_hundredth_of_a_per_cent() -> None:
    """What the script of a page does with it: whole numbers, differences, the ends of the axes."""
    b = block(size=300)
    markup = trace(b, "k", "l").markup
    panels = re.findall(r'data-ends="([^"]*)"', markup)
    x0, x1, y0, y1 = (float(v) for v in panels[0].split())
    path = re.search(r'class="line" data-n="measured" d="M(-?\d+) (-?\d+)l([^"]*)"', markup)
    assert path is not None
    steps = np.array([int(n) for n in re.findall(r"-?\d+", path[3])]).reshape(-1, 2)
    grid = np.vstack([[int(path[1]), int(path[2])], steps]).cumsum(axis=0)
    times, celsius = x0 + (x1 - x0) * grid[:, 0] / chart.PANEL_GRID_STEPS, y1 - (y1 - y0) * grid[:, 1] / chart.PANEL_GRID_STEPS
    assert np.abs(times - b.times / 60.0).max() <= 0.51e-4 * (x1 - x0)
    assert np.abs(celsius - (b.measured - 273.15)).max() <= 0.51e-4 * (y1 - y0)


def test_no_two_lines_of_a_figure_differ_by_colour_alone() -> None:
    assert len(set(DASHES)) == len(DASHES) == len(SERIES) == len(figures.SHAPES) == len(figures.MARKS)
    looks = [series_look(k) for k in range(64)]
    assert len(set(looks)) == 64
    for colours in (looks[:8], looks[8:16]):
        assert len({colour for colour, _ in colours}) == len({dash for _, dash in colours}) == 8


def test_lines_have_their_names_at_their_ends_and_none_on_another() -> None:
    x = np.linspace(0.0, 1.0, 5)
    lines = [Stroke(f"node {k}", x, 20.0 + 0.01 * k * x, *series_look(k)[:1]) for k in range(14)]
    size = {"key": "k", "label": "l", "x_name": ("time", "h"), "size": (760.0, 260.0)}
    drawn = chart.chart([Panel("temperature", "°C", lines)], named=True, **size)
    names = re.findall(r'<text class="ends" x="([\d.]+)" y="([\d.]+)"[^>]*>(node \d+)<', drawn)
    heights = sorted(float(y) for _, y, _ in names)
    assert {name for *_, name in names} == {line.label for line in lines}
    assert min(np.diff(heights)) > 11.9
    assert 0.0 < heights[0] and heights[-1] < 260.0 - 34.0  # noqa: PT018
    assert all(float(at) + 6.4 * len(name) <= 760.0 for at, _, name in names)
    crowd = [Panel("temperature", "°C", [*lines, *lines])]
    assert 'class="ends"' not in chart.chart(crowd, named=True, **size)


def test_a_figure_says_in_words_what_is_seen() -> None:
    markup = trace(block(), "k", "T in r").markup
    said = re.search(r'aria-label="([^"]*)"', markup)
    assert said is not None
    assert said[1].startswith("T in r, RMSE 0.1 K. Time 0 to 60 min; measured: from 26.9 to 36.7 °C")
    assert "; simulated: from 26.9 to 36.7 °C, range 26.9 to 36.7; measured less simulated: from" in said[1]


def drawn_at(markup: str, label: str) -> np.ndarray:
    """Points of a line, read back from its markup as a page's script does."""
    low_x, high_x, low_y, high_y = (float(v) for v in re.search(r'data-ends="([^"]+)"', markup)[1].split())
    path = re.search(rf'data-n="{re.escape(label)}"[^>]* d="([^"]*)"', markup)[1]
    steps = np.array([float(v) for v in re.findall(r"-?\d+", path)]).reshape(-1, 2).cumsum(axis=0) / 10_000
    return np.column_stack([low_x + steps[:, 0] * (high_x - low_x), high_y - steps[:, 1] * (high_y - low_y)])


def test_nominal_and_observed_shares_stand_where_they_are() -> None:
    levels = (0.5, 0.8, 0.9, 0.95, 0.99)
    narrow, wide = dict(zip(levels, (0.2, 0.4, 0.5, 0.55, 0.7), strict=True)), dict.fromkeys(levels, 1.0)
    drawn = coverage({"narrow": narrow, "wide": wide}, "c", "label")
    assert [e.label for e in drawn.legend] == ["as promised", "narrow", "wide"]
    for name, found in (("as promised", {v: v for v in levels}), ("narrow", narrow), ("wide", wide)):
        assert drawn_at(drawn.markup, name) == pytest.approx(100.0 * np.array([[k, v] for k, v in found.items()]), abs=0.02), name
    many = coverage({f"r{k}": {v: v * (0.8 + 0.01 * k) for v in levels} for k in range(20)}, "c", "label")
    assert [e.label for e in many.legend] == ["as promised", "mean of 20 records", "lowest to highest"]
    assert drawn_at(many.markup, "mean of 20 records")[:, 1] == pytest.approx(100.0 * 0.895 * np.array(levels), abs=0.02)
