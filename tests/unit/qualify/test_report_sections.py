"""The page of a qualification: every section of a correlation report, in order, with what a reader looks for in it."""

from __future__ import annotations

import html
import re
from pathlib import Path

import numpy as np
import pytest

import thermid as td
from unit.qualify.project import PLAN, measured, project, with_log
from unit.qualify.things import unit
from webpage import crossings, limited, lines_of

MORE = """
discrepancies = ["the lid was not modelled"]

[document]
number   = "TR-017"
issue    = "B"
date     = "2026-02-03"
prepared = "A. Author"
checked  = "B. Checker"
approved = "C. Chief"

[configuration]
as_tested   = "on a chamber plate"
as_flown    = "on the panel"
differences = [{ what = "harness of the test", effect = "0.02 W/K" }]

[validity]
temperature = ["15 [degC]", "60 [degC]"]
pressure    = ["100 [kPa]", "102 [kPa]"]
power       = ["0 [W]", "5 [W]"]
gravity     = ["9.81 [m/s^2]"]
orientation = ["upright"]
basis       = "bench"

[model]
"""
AS_RUN = {
    "state": '"run"',
    "deviations": '["door opened at 2 h"]',
    "heat_leaks": '["cable, 0.1 W"]',
    "date": '"2026-02-01"',
    "orientation": '"on its side"',
    "gravity": '"9.81 [m/s^2]"',
    "spread": '{ air = "1 [K]", "scale.cpu" = "3 [%]" }',
}
SECTIONS = {
    "Objectives and success criteria": ["limits kept", "every verdict met", "secondary", "project"],
    "Article and model configuration": ["on a chamber plate", "on the panel", "harness of the test", "0.02 W/K"],
    "Sensors": ["T_PROC", "hottest", "0.3 K", "ice point, 2026-01", "under the lid"],
    "Test cases as run": ["door opened at 2 h", "2026-02-01", "on its side", "SYNTHETIC"],
    "Boundaries, power, heater duty, heat leaks": ["40.0 .. 40.0", "ROOM", "scale.cpu ± 3 %", "cable, 0.1 W", "cpu"],
    "Stabilisation": ["as measured", "3 C/h", "read", "drift, K/h"],
    "Pre-test predictions and measurements": ["T_ELE", "±", "outside 95 %"],
    "Heat flows and energy balance": ["residual: ", "of it", "kJ", "out"],
    "Parameter changes": ["Nothing was fitted."],
    "Deviations after correlation": ["mean, K", "spread, K", "largest, K", "outside", "2 of 2"],
    "Transient overlays": ["measured less simulated", "sensor, 95 %"],
    "Excluded sensors": ["None."],
    "Remaining discrepancies": ["the lid was not modelled", "would explain"],
    "Uncertainty, limits and margins": ["fixed margin", "Predictions of the service cases", "processor", "measured"],
    "Validity envelope": [
        "EXTRAPOLATION",
        "power 9 .. 9 W; calibrated 0 .. 5 W",
        "orientation on its side",
        "bench",
    ],
    "Assumed values by their effect": ["out.conductance", "four screws", "moves by, K"],
    "Model delivery": [
        "identity",
        "nodes, conductors, loads",
        "plan",
        "lock",
        "thermid",
        "hot, experiment on board",
        "unit.toml",
        "log of hot",
    ],
}


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Section -> its words, in the order of the page, and the head under an empty name."""
    folder = tmp_path_factory.mktemp("page")
    text = with_log(PLAN, **AS_RUN).replace("\n[model]\n", MORE, 1)
    text = text.replace(
        'noise = "0.1 [K]" }\nT_ELE', 'noise = "0.1 [K]", certificate = "ice point, 2026-01", location = "under the lid" }\nT_ELE'
    )
    file = project(folder, text)
    deck = folder / "unit.toml"
    deck.write_text(deck.read_text().replace("max = 2.0", 'max = 2, source = "assumed", basis = "four screws"'), encoding="utf-8")
    measured(folder, offset=4.0)
    whole = td.reporting.qualification_report(td.qualify.run_plan(file), to=folder / "page.html").read_text(encoding="utf-8")
    head, *parts = re.split(r"<h2[^>]*>", whole)
    plain = [html.unescape(re.sub(r"\s+", " ", re.sub(r"<[^>]+>", " ", p.replace("<wbr>", "")))) for p in (f"</h2>{head}", *parts)]
    return {"" if k == 0 else parts[k - 1].partition("</h2>")[0].strip(): p for k, p in enumerate(plain)}


@pytest.mark.parametrize("section", SECTIONS)
def test_a_section_holds_what_a_reader_looks_for_and_stands_in_the_order_of_a_correlation_report(
    page: dict[str, str], section: str
) -> None:
    text = list(page.values())[1 + list(SECTIONS).index(section)]
    missing = [word for word in SECTIONS[section] if word not in text]
    assert not missing, text[:1500]


def test_the_head_names_the_document_and_who_signed_and_what_is_open(page: dict[str, str]) -> None:
    for word in ("TR-017", "B", "2026-02-03", "A. Author", "B. Checker", "C. Chief", "verdicts failed", "Not decided"):
        assert word in page[""]
    assert re.search("[^.]*MIL-HDBK-340, transient", page[""])
    assert re.search(r"verdicts failed hot[,;]", page[""])  # which failed


def test_readings_stand_over_what_is_simulated_from_the_logged_chamber(tmp_path: Path) -> None:
    """Seen by a reader: a chamber that left its level early stood 40 K from the planned one's curve, under "met"."""
    file = project(tmp_path, with_log(PLAN, state='"run"'))
    times = np.arange(0.0, 6 * 3600.1, 120.0)
    room = {"times": ["0 [h]", "2 [h]", "2.1 [h]", "6 [h]"], "values": [40.0, 40.0, 52.0, 52.0], "unit": "degC"}
    as_run = td.Scenario("as run", boundaries={"air": room}, start="20 [degC]", duration="6 [h]")
    run = td.simulate(unit(), as_run, times=times)
    table = np.column_stack([times, *(run[n].celsius for n in ("proc", "ele", "air"))])
    np.savetxt(tmp_path / "hot.csv", table, delimiter=",", header="time_s,T_PROC,T_ELE,ROOM", comments="", fmt="%.3f")
    found = td.qualify.run_plan(file)
    assert found["hot"].worst is not None
    assert found["hot"].worst.by == "measured"
    page = td.reporting.qualification_report(found, to=tmp_path / "page.html").read_text(encoding="utf-8")
    drawn = {name: dict(points) for _, name, points in lines_of(limited(page)[0][1])}
    assert "simulated" not in drawn
    pairs = [(drawn["measured"][t], y) for t, y in drawn["simulated, inputs as logged"].items() if t in drawn["measured"]]
    assert len(pairs) > 50
    assert max(abs(a - b) for a, b in pairs) < 1.0


STATES = """loads = ["cpu"]
non_operating = ["-40 [degC]", "90 [degC]"]
start_up = ["-10 [degC]", "25 [degC]"]
"""
SWITCHED = """
[[tests]]
name = "switched off"
kind = "on-board"
criteria = ["MIL-HDBK-340, transient"]

[tests.scenario]
boundaries = { air = "HOT [degC]" }
start = "20 [degC]"
duration = "6 [h]"
commands = { cpu = { times = ["0 [h]", "3 [h]"], values = [1, 0], hold = true } }
"""


@pytest.mark.parametrize(("air", "verdict"), [(45, "met"), (79, "NOT met")])
def test_no_curve_passes_a_drawn_limit_whose_verdict_says_met(tmp_path: Path, air: int, verdict: str) -> None:
    """The start-up limit of 25 degC is the nearest at the first instant; the unit is far above it later, when it does not hold."""
    text = PLAN.replace('loads = ["cpu"]\n', STATES) + SWITCHED.replace("HOT", str(air))
    found = td.qualify.run_plan(project(tmp_path, text))
    page = td.reporting.qualification_report(found, to=tmp_path / "page.html").read_text(encoding="utf-8")
    shown = limited(page)
    assert len(shown) == 3
    for caption, figure in shown:
        assert crossings(figure) == [] or caption.endswith("NOT met")
    caption, figure = shown[-1]
    assert caption.endswith(f": {verdict}")
    assert bool(crossings(figure)) is (verdict == "NOT met")
    names = {name for _, name, _ in lines_of(figure)}
    assert names == {"simulated", "limit, operating", "limit, non-operating", "limit, start-up"}
    spans = {name: [p[0] for p in points] for _, name, points in lines_of(figure)}
    assert max(spans["limit, operating"]) <= min(spans["limit, non-operating"])  # each where its state holds, to the switching
    assert max(spans["limit, start-up"]) - min(spans["limit, start-up"]) < 0.01
