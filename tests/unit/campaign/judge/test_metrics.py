"""A metric is one function and one row: verdicts, correlations, plans and studies ask for it by its key and print it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.base.errors import ScenarioError
from thermid.campaign._judge.correlation import correlate
from thermid.campaign._judge.verdict import METRICS, Criteria, Metric, Residuals
from thermid.reporting._pages.study import step_log
from thermid.reporting._pages.tables import verdicts
from thermid.reporting._qualification.tables import gates
from unit.qualify.project import PLAN, measured, project, with_log

TIMES = np.arange(0.0, 7201.0, 60.0)
DECK = """
title = "plate"
needs = ["air"]

[nodes.plate]
capacitance = "600 [J/K]"

[conductors.film]
kind    = "conduction"
between = ["plate", "air"]
conductance = "1 [W/K]"

[loads.heater]
into  = "plate"
power = "10 [W]"
"""
CAMPAIGN = """
title = "one plate"
{records}
[[stages]]
name     = "plate"
model    = "plate.toml"
records  = ["one"]
free     = ["film.conductance"]
scenario = {{ boundaries = {{ air = "20 [degC]" }}, start = "20 [degC]" }}

[[verdicts]]
model    = "plate"
record   = "two"
criteria = {{ swing = "0.01 [K]" }}
"""
RECORD = '[records.{0}]\nfile = "{0}.csv"\ntime = "t"\nchannels = {{ T = {{ node = "plate", noise = "0.05 [K]" }} }}\n'
STUDY = """
title = "one plate"

[knowledge]
use   = "temperatures on the bench"
model = "plate.toml"

[components]
plate = { at = "plate" }

[sensors.thermistor]
accuracy = "0.3 [K]"
channels = ["T"]

[procedure]
campaign = "campaign.toml"
metrics  = ["swing", "p95"]
"""


def swing(r: Residuals) -> float:
    return float(np.ptp(r.kelvin))


@pytest.fixture
def row(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(METRICS, "swing", Metric(swing, "swing of the residuals"))


@pytest.fixture
def study(tmp_path: Path, row: None) -> Path:
    (tmp_path / "thermid.toml").touch()
    (tmp_path / "plate.toml").write_text(DECK, encoding="utf-8")
    rng = np.random.default_rng(1)
    for name in ("one", "two"):
        truth = 20.0 + 8.0 * (1 - np.exp(-TIMES / 480.0)) + 0.05 * rng.standard_normal(TIMES.size)
        np.savetxt(tmp_path / f"{name}.csv", np.column_stack([TIMES, truth]), delimiter=",", header="t,T", comments="")
    records = RECORD.format("one") + RECORD.format("two")
    (tmp_path / "campaign.toml").write_text(CAMPAIGN.format(records=records), encoding="utf-8")
    (tmp_path / "study.toml").write_text(STUDY, encoding="utf-8")
    return tmp_path


def test_what_each_metric_is() -> None:
    z = np.array([0.3, -0.1, 0.2, -2.0, 0.4, 0.5])
    r = Residuals.equally_weighted(np.array([0.0, 10.0, 20.0, 30.0, 96.0, 100.0]), z)
    sizes = {"rmse": np.sqrt(np.mean(z**2)), "mean": z.mean(), "largest": -2.0, "spread": z.std(), "final": 0.45}
    sizes["p95"] = 0.75 * 2.0 + 0.25 * 0.5
    assert {key: row.of(r) for key, row in METRICS.items()} == pytest.approx(sizes)


def test_a_row_more_is_known_to_a_verdict_and_a_study(study: Path) -> None:
    campaign = td.run_stages(study / "campaign.toml")
    (verdict,) = campaign.verdicts
    (check,) = verdict.checks
    (block,) = verdict.blocks
    assert check.found == pytest.approx(np.ptp(block.residuals))
    assert not verdict.passed
    assert "T: swing" in str(verdict)
    assert "swing of the residuals" in str(verdicts(campaign).rows)
    asked = td.design.load_study(study / "study.toml")
    assert asked.log(campaign)[-1]["swing"] == pytest.approx(check.found)
    table = step_log(asked, campaign)
    assert [c.title.rpartition(",")[2] for c in table.columns][-2:] == [" K", " K"]
    assert table.columns[-1].title.startswith("95")


def test_a_row_more_is_known_to_a_correlation_and_a_plan(tmp_path: Path, row: None) -> None:
    measured(tmp_path)
    plan = project(tmp_path, with_log(PLAN.replace('each = "2 [K]"', 'swing = "0.001 [K]"')))
    found = td.qualify.run_plan(plan)
    trial = found["hot"]
    assert trial.correlation is not None
    (gate,) = [g for g in trial.correlation.failed if g.kind == "transient"]
    worst = next(o for o in trial.correlation.overlays if o.sensor == gate.sensor)
    assert (gate.criterion, gate.found) == ("swing", pytest.approx(np.ptp(worst.residuals)))
    assert "largest swing of the residuals" in str(trial.correlation)
    assert "swing of the residuals of every sensor" in str(gates(trial.correlation).rows)
    assert "swing of the residuals, K" in td.reporting.qualification_report(found, to=tmp_path / "page.html").read_text(encoding="utf-8")
    again = correlate(trial.correlation.overlays, [Criteria("ours", swing=0.001, kinds=("transient",))])
    assert again.passed("ours") is False


def test_the_three_vocabularies_are_one() -> None:
    """Names of verdicts, of plans and of studies mean the same row, wherever they are asked for."""
    base = 300.0 + TIMES * 0
    found = correlate(
        (
            td.Record.from_arrays("m", TIMES, {"T": base + 0.5 - (TIMES > 7000.0)}, unit="K"),
            td.Record.from_arrays("s", TIMES, {"T": base}, unit="K"),
        ),
        [Criteria("ours", largest=9.0, max_error=9.0, mean_error=9.0, final=9.0, final_error=9.0, each=9.0, kinds=("transient",))],
    )
    sizes = {g.criterion: g.found for g in found.gates}
    assert sizes["largest"] == sizes["max_error"] == sizes["each"] == 0.5
    assert sizes["final"] == sizes["final_error"] == pytest.approx(0.5 / 7)  # three samples at 0.5, four at -0.5
    assert sizes["mean_error"] == pytest.approx(0.5, abs=0.05)


def test_a_metric_that_is_none_is_refused(study: Path) -> None:
    with raises_code("name.unknown", ScenarioError, match="'swnig'.*'swing'"):
        Criteria(swnig="1 [K]")
    text = (study / "study.toml").read_text(encoding="utf-8").replace('"p95"', '"p59"')
    (study / "study.toml").write_text(text, encoding="utf-8")
    with raises_code("name.unknown", ScenarioError, match=r"study\.toml:\d+.*procedure\.metrics\.1.*'p59'.*'p95'"):
        td.design.load_study(study / "study.toml")
