"""The next structure of a campaign: written beside it, accepted by the other commands, side by side with the one before."""

from __future__ import annotations

from pathlib import Path

import pytest

import thermid as td
from thermid.errors import DeckError, OutputError
from thermid.start.improve import improve

from .test_init import bench

DECK = """
title = "plate"
needs = ["room"]
[nodes]
plate = { capacitance = { value = "300 [J/K]", min = 10, max = 5000 } }
[conductors]
loss = { kind = "conduction", between = ["plate", "room"], conductance = { value = "0.3 [W/K]", min = 0.01, max = 10 } }
[loads]
heater = { into = "plate", power = "0 [W]" }
"""
CAMPAIGN = """
title = "plate"  # a comment that stays
[records.test]
file = "test.csv"
channels = { T_plate_C = { node = "plate", noise = "0.05 [K]" }, T_room_C = { boundary = "room" }, P_heater_W = { load = "heater" } }
[[stages]]
name = "plate"
model = "plate.toml"
records = ["test"]
free = ["plate.capacitance", "loss.conductance"]
"""


def project(folder: Path, hidden: float) -> Path:
    bench(folder / "test.csv", hidden=hidden)
    (folder / "thermid.toml").write_text("")
    (folder / "plate.toml").write_text(DECK)
    (folder / "campaign.toml").write_text(CAMPAIGN)
    return folder / "campaign.toml"


def test_what_is_proved_becomes_the_next_structure(tmp_path: Path) -> None:
    path = project(tmp_path, 260.0)
    made = improve(path, seconds=20.0)
    assert [f.name for f in made.files] == ["plate.toml", "campaign_next.toml"]
    (row,) = made.rows()
    assert row["before_K"] > 1.0
    assert row["after_K"] == pytest.approx(0.05, rel=0.15)
    assert "before" in str(made)
    assert "# a comment that stays" in made.files[1].read_text()
    assert path.read_text() == CAMPAIGN
    again = td.run_stages(made.files[1])
    assert again.stages["plate"].sensors["T_plate_C"].rmse == pytest.approx(row["after_K"], rel=0.01)
    made.files[1].write_text("mine = 1\n")
    with pytest.raises(OutputError):
        improve(path, seconds=20.0)


def test_nothing_is_written_where_nothing_is_proved(tmp_path: Path) -> None:
    made = improve(project(tmp_path, 0.0), seconds=20.0)
    assert made.files == ()
    assert not (tmp_path / "campaign_next.toml").exists()
    assert "No change of the structure is supported" in str(made)


def test_a_stage_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(DeckError, match="no stage 'plane'"):
        improve(project(tmp_path, 0.0), "plane")
