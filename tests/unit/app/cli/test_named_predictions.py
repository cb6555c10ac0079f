"""Predictions that a campaign names: bands first, margins to limits, on the command line, in the check and on the report."""

from __future__ import annotations

import re
import shutil
from html import unescape
from pathlib import Path

import numpy as np
import pytest

from thermid.campaign._judge.predictions import BandMargin
from unit.app.cli.conftest import Call

NAMED = """
[predictions.hot]
scenario = "hot.toml"
limits   = { "a.case" = ["-20 [degC]", "LIMIT [degC]"] }

[predictions.cold]
scenario = "hot.toml"
stage    = "box"
limits   = { case = ["30 [degC]", ""] }
"""
HOT = 'title = "hot case"\nboundaries = { ROOM = "40 [degC]" }\nduration = "1 [h]"\nstart = "40 [degC]"\n'


def asked(campaign: Path, limit: str) -> Path:
    """Return a campaign that asks for a hot case of its last stage, and of its first one, whose surroundings have another name."""
    text = NAMED.replace("LIMIT", limit)
    campaign.write_text(campaign.read_text() + text.replace('scenario = "hot.toml"\nstage', 'scenario = "box.scenario.toml"\nstage'))
    (campaign.parent / "hot.toml").write_text(HOT.replace("ROOM", "room"))
    (campaign.parent / "box.scenario.toml").write_text(HOT.replace("ROOM", "air"))
    return campaign


def test_every_prediction_is_made_and_its_margin_counts_from_the_band(call: Call, fitted_campaign: Path, tmp_path: Path) -> None:
    asked(fitted_campaign, "90")
    assert call("check", fitted_campaign).code == 0
    said = call("predict", fitted_campaign, "--json")
    hot, cold = said.object["hot"], said.object["cold"]
    assert (said.code, hot["stage"], cold["stage"]) == (0, "pair", "box")
    assert hot["within"]
    margin = hot["margins"]["a.case"]
    assert margin["margin_K"] == pytest.approx(90.0 - margin["high_C"])
    assert margin["high_C"] >= hot["nodes"]["a.case"]["final"]["high_C"] > hot["nodes"]["a.case"]["final"]["C"]
    alone = call("predict", fitted_campaign, "--scenario", fitted_campaign.parent / "hot.toml", "--json").object
    assert alone["nodes"] == hot["nodes"]
    page = tmp_path / "page.html"
    assert call("report", fitted_campaign, "--to", page, "--for", "summary").code == 0
    text = unescape(page.read_text())
    assert text.index(f"{margin['margin_K']:.2f}") < text.index('id="predictions"')
    assert f"{margin['margin_K']:.2f}" in text
    assert 'id="predictions"' in text


@pytest.mark.campaign
def test_a_summary_with_two_predictions_has_two_sheets(call: Call, fitted_campaign: Path, tmp_path: Path) -> None:
    """It had three: a heading that said a line of the top again, and a section for verdicts that there are none of."""
    if shutil.which("chromium") is None:
        pytest.skip("no Chromium to print with")
    assert call("report", asked(fitted_campaign, "90"), "--to", tmp_path / "page.pdf", "--for", "summary").code == 0
    assert re.findall(rb"/Type /Pages\s*/Count (\d+)", (tmp_path / "page.pdf").read_bytes()) == [b"2"]


def test_what_bands_come_from_is_told_once_below_all_predictions(call: Call, fitted_campaign: Path) -> None:
    said = call("predict", asked(fitted_campaign, "90"))
    lines = said.out.splitlines()
    head = max(k for k, line in enumerate(lines) if line.endswith(":") and not line.startswith(" "))
    causes = [line.partition(":")[0] for line in lines[head + 1 :]]
    known = {cause for p in call("predict", fitted_campaign, "--json").object.values() if isinstance(p, dict) for cause in p["causes"]}
    assert {f"  {cause}" for cause in known} == set(causes)
    assert len(causes) > 1
    for cause in causes:
        assert sum(line.startswith(f"{cause}:") for line in lines) == 1


def test_a_limit_that_a_band_exceeds_is_exit_code_1(call: Call, fitted_campaign: Path) -> None:
    """The numbers are the prediction's own, and its band holds what the project's hidden values give: 46.51 degC."""
    said = call("predict", asked(fitted_campaign, "41"))
    assert said.code == 1
    margin = call("predict", fitted_campaign, "--json").object["hot"]["margins"]["a.case"]
    high, centre = 41.0 - margin["margin_K"], 41.0 - margin["expected_margin_K"]
    assert abs(46.51 - centre) < high - centre < 1.0
    parts = (f"41 degC by {centre - 41.0:.2f} K; 95 %", f"up to {high:.2f} degC, {high - 41.0:.2f} K")
    assert all(part in said.out.splitlines()[0] for part in parts)
    page = fitted_campaign.parent / "page.html"
    call("report", fitted_campaign, "--to", page, "--for", "summary")
    heads = re.findall(r'<p class="sum (\w+)">', page.read_text())
    assert heads == sorted(heads)  # bad before good: what is worst stands first
    assert set(heads) == {"bad", "good"}


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('"a.case" = [', '"a.cas" = [', "no node 'a.cas'"),
        ('stage    = "box"\nlimits', 'stage    = "bax"\nlimits', "no stage 'bax'"),
        ('"hot.toml"', '"hut.toml"', "hut.toml"),
    ],
)
def test_what_a_prediction_names_wrongly_is_found_by_check(call: Call, campaign: Path, old: str, new: str, words: str) -> None:
    asked(campaign, "90").write_text(campaign.read_text().replace(old, new))
    said = call("check", campaign, "--json")
    assert said.code == 2
    assert words in said.out


def test_one_that_fails_is_named_and_the_others_are_made(call: Call, fitted_campaign: Path, tmp_path: Path) -> None:
    """One of three could not be run, and none was told."""
    asked(fitted_campaign, "90")
    (fitted_campaign.parent / "box.scenario.toml").unlink()
    said = call("predict", fitted_campaign)
    assert said.code == 2
    assert "NOT PREDICTED: 'cold': " in said.out
    assert "\nhot: " in said.out
    assert set(call("predict", fitted_campaign, "--json").object) >= {"hot", "cold"}
    page = tmp_path / "page.html"
    assert call("report", fitted_campaign, "--to", page, "--for", "summary").code == 0
    assert "NOT PREDICTED: 'cold'" in unescape(page.read_text())


def test_a_campaign_without_predictions_says_how_to_ask(call: Call, fitted_campaign: Path) -> None:
    said = call("predict", fitted_campaign, "--json")
    assert said.code == 2
    assert "[predictions.hot]" in said.object["message"]


@pytest.mark.parametrize(
    ("limits", "words"),
    [
        ((253.15, 343.15), "-20 .. 70 degC"),
        ((253.15, np.inf), "above -20 degC"),
        ((-np.inf, 343.15), "below 70 degC"),
        ((-np.inf, np.inf), ""),
    ],
)
def test_limits_of_one_side_are_told_as_such(limits: tuple[float, float], words: str) -> None:
    assert BandMargin("case", (300.0, 310.0), (304.0, 306.0), limits).words[1] == words
