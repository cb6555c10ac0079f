"""Steady points in a campaign: fitted beside a transient, refused where a stretch would count twice, balanced on the page."""

from __future__ import annotations

from pathlib import Path

import pytest

import thermid as td
from by_code import raises_code
from thermid.base.errors import RecordError
from unit.fit.bench import HTC, MASS, box, log
from unit.fit.project import make_project, write_log

CAMPAIGN = """
title = "Ends of logs"

[records.warm]
file     = "logs/long.csv"
time     = "time_s"
channels = { T_A = { node = "case", noise = "0.05 [K]" }, ROOM = { boundary = "air" } }
prepare  = [{ trim = ["start", "2 [h]"] }]

[records.long]
file     = "logs/long.csv"
time     = "time_s"
channels = { T_A = { node = "case", noise = "0.05 [K]" }, ROOM = { boundary = "air" } }

[[stages]]
name    = "box"
model   = "box.toml"
records = ["RECORDS"]
steady  = { settled = { record = "long", start = "28 [h]", end = "30 [h]" } }
free    = ["skin.effective_htc", "case.mass"]
"""


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = make_project(tmp_path_factory.mktemp("steady"))
    truth = {HTC: "7 [W/(m^2 K)]", MASS: "1.2 [kg]"}
    write_log(log(box(), truth, {"T_A": "case"}, hours=30.0, samples=601, swing=0.0), path.parent / "logs" / "long.csv")
    path.write_text(CAMPAIGN.replace("RECORDS", "warm"))
    return path


def test_a_settled_end_is_fitted_beside_the_beginning(project: Path, tmp_path: Path) -> None:
    campaign = td.run_stages(project)
    both = campaign["box"]
    assert set(both.records) == {"warm", "settled"}
    assert both[HTC].value == pytest.approx(7.0, rel=0.01)
    assert both[MASS].value == pytest.approx(1.2, rel=0.01)
    alone = project.with_name("alone.toml")
    alone.write_text("\n".join(x for x in CAMPAIGN.replace("RECORDS", "warm").splitlines() if not x.startswith("steady")))
    # two hours do not show where it would settle; the end of the log does
    assert both[HTC].error < 0.7 * td.run_stages(alone)["box"][HTC].error
    page = td.report(campaign, to=tmp_path / "page.html").read_text(encoding="utf-8")
    for words in ("settled: Box", "unexplained"):
        assert words in page


def test_a_stretch_that_a_transient_holds_too_is_refused(project: Path) -> None:
    twice = project.with_name("twice.toml")
    twice.write_text(CAMPAIGN.replace("RECORDS", "long"))
    with raises_code("campaign.refused", RecordError, match="'settled'.*100800.*108000.*'long'"):
        td.run_stages(twice)


def test_a_stretch_that_drifts_is_refused(project: Path) -> None:
    drifts = project.with_name("drifts.toml")
    drifts.write_text(
        CAMPAIGN.replace("RECORDS", "warm").replace("28 [h]", "2.1 [h]").replace('"30 [h]"', '"2.8 [h]", limit = "0.1 [K/h]"')
    )
    with pytest.raises(RecordError, match=r"drifts"):
        td.run_stages(drifts)
