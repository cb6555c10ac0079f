"""The study of the source document on its virtual laboratory: nine models, level by level, and logs that no stage has seen."""

from __future__ import annotations

import csv
import io
import runpy
import sys
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import thermid as td
from plain_errors import errors_in_full
from webpage import crossings, faults, limited, without_script

STUDY = Path(__file__).parents[2] / "examples" / "sisnav"


@dataclass(frozen=True)
class Demonstration:
    """What ``python demo.py FOLDER`` wrote, said, and had in hand."""

    folder: Path
    said: str
    complained: str
    work: Any


@pytest.fixture(scope="module")
def demonstration(tmp_path_factory: pytest.TempPathFactory) -> Demonstration:
    """The demonstration as a script, in this process."""
    for package in ("matplotlib", "jinja2", "sympy"):
        pytest.importorskip(package)
    folder, said, complained, done = tmp_path_factory.mktemp("demo") / "out", io.StringIO(), io.StringIO(), []
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(said), redirect_stderr(complained):
        patch.syspath_prepend(STUDY)
        work = import_module("work")
        run = work.run
        patch.setattr(work, "run", lambda *given: done.append(run(*given)) or done[-1])
        # an eighth of the members where derivatives do not do: no test looks at the width of a band
        patch.setattr("thermid.prediction._predict.DRAWN_MEMBERS", (250, 250))
        patch.setattr(sys, "argv", ["demo.py", str(folder)])
        runpy.run_path(str(STUDY.parent / "demo.py"), run_name="__main__")
    return Demonstration(folder, said.getvalue(), complained.getvalue(), done[0])


@pytest.fixture(scope="module")
def laboratory(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Logs of all tests, and what is hidden."""
    folder = tmp_path_factory.mktemp("laboratory")
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(STUDY)
        import_module("laboratory").main(folder)
    return folder


@pytest.fixture(scope="module")
def campaign(laboratory: Path, errors_in_turn: str) -> td.Campaign:
    """The document's campaign: one constant coefficient a surface."""
    return td.run_stages(STUDY / "campaign.toml", data=laboratory)


@pytest.mark.campaign
def test_demo(demonstration: Demonstration) -> None:
    """The whole study, from logs to its page."""
    said, folder = demonstration.said, demonstration.folder
    assert demonstration.complained == ""
    page = Path(said.splitlines()[-1].removeprefix("report page: "))
    assert page == folder / "report.html"
    text = page.read_text(encoding="utf-8")
    for words in ("DEMONSTRATION", "synthetic", "Table 2", "light grey", "Eq. 4", "E25", "95 % interval"):
        assert words in text, words
    assert said.count("natural: ") == 9 + 3 + 3  # every level, every verdict while it is made and as it ends
    assert "FAILED" not in " ".join(line for line in said.splitlines() if "natural: " in line)
    for structure in ("constant", "natural"):
        assert (folder / "results" / structure / "m_Sd.values.toml").is_file()


def test_the_page_writes_the_equations_of_the_document(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fig. 20 is a program, Fig. 21 runs one beside the network: what the demonstration draws before any fit."""
    for package in ("matplotlib", "jinja2", "sympy"):
        pytest.importorskip(package)
    monkeypatch.syspath_prepend(STUDY)
    assert "dTdt = thermal_two_node(" in repr(import_module("page").equations())
    _, worst = import_module("drawings").fig_21()
    assert worst < 1e-8  # [K], two integrations of one model


def test_every_log_says_that_it_is_synthetic(laboratory: Path) -> None:
    logs = sorted((laboratory / "logs").glob("*.csv"))
    assert len(logs) == 13
    for log in logs:
        assert log.read_text(encoding="utf-8").startswith("# SYNTHETIC")
        assert td.read_record(log, {"room": "T_ROOM"}).origin.synthetic


def test_nine_levels_run_from_one_campaign(campaign: td.Campaign) -> None:
    assert list(campaign) == ["Acc", "FOG_h", "FOG_l", "EleGFO", "ProcSISNAV", "m_PrE", "m_AccS", "m_IMU", "m_Sd"]
    assert all(campaign[stage].converged for stage in campaign)


def test_A6_only_coefficients_and_joints_of_the_full_model_are_tuned(campaign: td.Campaign) -> None:  # noqa: N802
    """What the stages below found stays bit for bit; free are Table 2's column Sd, the disk's coefficient and the disk's joints."""
    full = campaign["m_Sd"]
    own = {"imu_foot_conductivity", "cd_conductivity"}
    assert {p for p in full.values.parameters if not p.endswith("effective_htc")} == own
    before, after = (td.simulation.compile_network(m).numbers().values for m in (full.given_model, full.model))
    tuned = {q for p, v in full.values.parameters.items() for q in (p, *v.also)}
    moved = {p for p, v in before.items() if float(after[p]) != float(v)}
    assert moved - tuned == {"foot.contact_conductance", "pillar.conductivity"}  # by the two joints' own expressions


def test_levels_differ_as_in_table_2(campaign: td.Campaign) -> None:
    """The full model convects less than the parts alone: the document's observation, which the hidden unit has too."""
    table = campaign.table("effective_htc")
    assert set(table["pre.proc.skin"]) >= {"m_Sd"}
    assert (
        campaign["m_Sd"].values.parameters["pre.proc.skin.effective_htc"].value
        < 0.8 * campaign["m_PrE"].values.parameters["proc.skin.effective_htc"].value
    )


def test_the_full_model_predicts_a_log_that_no_stage_has_seen(campaign: td.Campaign) -> None:
    verdict = next(v for v in campaign.verdicts if v.record == "sd_held_out")
    assert verdict.passed


def test_a_constant_coefficient_misses_what_follows_a_pause(campaign: td.Campaign) -> None:
    """Where a unit is switched off and on again, the measurement unit misses 0.5 K for a while; the report says so."""
    failed = {v.record for v in campaign.verdicts if not v.passed}
    assert failed == {"imu_held_out"}


def test_the_pair_has_a_pause_among_its_records_and_the_centre_of_its_band_is_near(laboratory: Path) -> None:
    """With its model of error, whose centre it is."""
    with errors_in_full():
        (verdict,) = td.run_stages(STUDY / "campaign.toml", data=laboratory, only={"m_PrE"}).verdicts
    assert verdict.record == "pre_held_out"
    assert max(c.found for c in verdict.checks) < 0.2


def test_no_stage_contradicts_what_was_stated(campaign: td.Campaign) -> None:
    """No sensor, meter or prior would have to be wrong by more than ten times what is stated; at the pair not by half of that."""
    assert {stage: campaign[stage].contradicted for stage in campaign if campaign[stage].contradicted} == {}
    assert [s for s in campaign if not campaign[s].standing.fair] == ["m_IMU", "m_Sd"]
    assert campaign["m_Sd"].standing.line("m_Sd").startswith("FAILED: rests on stage 'm_IMU' (verdict on imu_held_out")
    stated = [v for v in campaign["m_PrE"].values.values() if v.kind == "input" and v.prior is not None]
    assert max(abs(v.value - v.prior[0]) / v.prior[1] for v in stated if v.prior is not None) < 5


@pytest.mark.campaign
def test_without_a_pause_the_pair_blames_its_power_meter(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """A warm-up alone with fixed masses: the convection's exponent goes into the meter, and with exponent 0 nothing does."""
    monkeypatch.syspath_prepend(str(STUDY))
    meter, world = import_module("warm_up").meter, import_module("laboratory").World
    alone = meter(tmp_path / "alone", False, world.make())
    assert alone.times > 10
    assert meter(tmp_path / "flat", False, world.make(exponent=0.0)).times < 1.0


def test_the_report_is_one_light_page_whose_numbers_have_units(campaign: td.Campaign, tmp_path: Path) -> None:
    text = td.report(campaign, to=tmp_path / "page.html").read_text(encoding="utf-8")
    without_script(text)
    assert [c for c, figure in limited(text) if crossings(figure) and "NOT met" not in c] == []
    assert len(limited(text)) > 3
    assert faults(text) == []
    print(f"page of the campaign: {len(text.encode()) / 1e6:.2f} MB")
    assert len(text.encode()) < 1_500_000


def test_true_temperatures_lie_near_the_fitted_model(campaign: td.Campaign, laboratory: Path) -> None:
    """Against the hidden temperatures, not the readings: the calibration does not follow the sensors' offsets."""
    with (laboratory / "hidden" / "sd_all.csv").open(encoding="utf-8") as file:
        rows = list(csv.reader(line for line in file if not line.startswith("#")))
    names, table = rows[0], np.array(rows[1:], dtype=float)
    for block in campaign["m_Sd"].blocks:
        predicted = np.interp(table[:, 0], block.times, block.predicted) - campaign["m_Sd"].bias.get(block.sensor, 0.0) - 273.15
        assert np.abs(predicted - table[:, names.index(block.sensor)]).max() < 0.5
