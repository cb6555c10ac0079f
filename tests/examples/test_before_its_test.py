"""A stage of the stack before its own test: what its parts found, and stated ranges of its joints, predict the held-out log."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import thermid as td
from thermid.base.errors import DeckError
from thermid.campaign.stages import Campaign
from thermid.prediction.bands import RecordPrediction, predict_record

EXAMPLES = Path(__file__).parents[2] / "examples"
PRIORS = """[stages.priors]
"stack.contact_conductance" = { sd = "80 [W/(m^2 K)]" }
"stack.gap.htc"             = { sd = "1.2 [W/(m^2 K)]" }
"ele.skin.effective_htc"    = { sd = "0.4 [W/(m^2 K)]" }
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("blind")
    for name in ("02_stack", "04_campaign"):
        shutil.copytree(EXAMPLES / name, folder / name)
    (folder / "thermid.toml").touch()
    subprocess.run([sys.executable, str(folder / "04_campaign" / "make_logs.py")], check=True, capture_output=True)
    return folder / "04_campaign"


def campaign(folder: Path, name: str, more: str = "", free: bool = True) -> Campaign:
    """Return the campaign whose last stage has no records yet."""
    text = (folder / "campaign.toml").read_text(encoding="utf-8").partition("[[verdicts]]")[0]
    text = text.replace('records  = ["stack_bench", "stack_proc_only"]\n', "")
    text = text if free else re.sub(r"free     = .*\n", "", text)
    (folder / name).write_text(text + more, encoding="utf-8")
    return td.run_stages(folder / name)


def held_out(folder: Path, run: Campaign) -> RecordPrediction:
    source = run.source
    assert source is not None
    stage = next(s for s in source.content.stages if s.name == "m_PrE")
    return predict_record(run["m_PrE"], source.bound("stack_held_out", stage))


def test_the_parts_and_ranges_of_the_joints_predict_the_test(folder: Path) -> None:
    run = campaign(folder, "blind.toml", PRIORS)
    blind = held_out(folder, run)
    assert all(b.inside() >= 0.95 for b in blind.bands.values())
    assert all(1.0 < float(b.half_width().mean()) / b.rmse < 8.0 for b in blind.bands.values())
    assert {"values", "instrument", "noise of a reading"} <= {*blind.bands["T_ELE"].parts}
    assert [w for w in run["m_PrE"].warnings if "no log of this stage is fitted" in w]


def test_a_free_value_without_a_range_counts_as_exact_and_is_named_first(folder: Path) -> None:
    run = campaign(folder, "exact.toml")
    blind = held_out(folder, run)
    assert "stack.gap.htc" in run["m_PrE"].warnings[0]
    assert str(blind).startswith("not counted: ")
    assert "stack.gap.htc" in str(blind).partition("\n")[0]
    wide = held_out(folder, campaign(folder, "blind.toml", PRIORS)).bands["T_PROC"].half_width().mean()
    assert blind.bands["T_PROC"].half_width().mean() < wide


def test_a_scenario_is_predicted_by_the_same_stage(folder: Path) -> None:
    run = campaign(folder, "blind.toml", PRIORS)
    power = {"proc.electronics": "4 [W]", "ele.electronics": "2 [W]"}
    hot = td.Scenario("hot", boundaries={"cv": "40 [degC]"}, loads=power, start="cv", duration="6 [h]")
    assert 0.3 < td.predict(run["m_PrE"], hot)["proc.case"].error[-1] < 3.0


def test_a_stage_with_nothing_below_and_no_records_is_refused(folder: Path) -> None:
    text = (folder / "campaign.toml").read_text(encoding="utf-8").replace('records = ["proc_bench"]\n', "")
    (folder / "nothing.toml").write_text(text, encoding="utf-8")
    with pytest.raises(DeckError) as refused:
        td.run_stages(folder / "nothing.toml")
    assert refused.value.code == "campaign.refused"
