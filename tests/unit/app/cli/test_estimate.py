"""`thermid estimate`: a stage of a campaign with process noise beside output error."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from unit.fit.project import make_project

Call = Callable[..., Any]


def test_a_stage_with_noise_on_a_node(call: Call, tmp_path: Path) -> None:
    campaign = make_project(tmp_path)
    asked = ("estimate", campaign, "--stage", "box", "--noise", "case=free", "--horizon", "10 [min]")
    said = call(*asked)
    assert (said.code, said.err) == (0, "")
    assert "box: " in said.out.splitlines()[0]
    assert "10 min" in said.out
    told = json.loads(call(*asked, "--json").out)
    assert set(told["estimators"]) == {"process noise", "output error"}
    assert told["horizon_s"] == 600.0
    assert "noise of case" in told["estimators"]["process noise"]["values"]


def test_a_noise_that_names_nothing(call: Call, tmp_path: Path) -> None:
    said = call("estimate", make_project(tmp_path), "--noise", "cass=free")
    assert said.code == 4
    assert "name.unknown" in said.codes


def test_a_run_with_a_noise_that_forgets(call: Call, tmp_path: Path) -> None:
    campaign = make_project(tmp_path)
    run = tmp_path / "next.toml"
    run.write_text('start = "20 [degC]"\nduration = "30 [min]"\n[boundaries]\nair = "20 [degC]"\n', encoding="utf-8")
    asked = ("estimate", campaign, "--stage", "box", "--noise", "case=free over 5 [min]", "--horizon", "10 [min]", "--scenario", run)
    said = call(*asked)
    assert said.code == 0
    assert "prediction by process noise:" in said.out
    assert "prediction by output error:" in said.out
    told = json.loads(call(*asked, "--json").out)["predictions"]["process noise"]
    assert told["names"] == ["case", "unlogged heat into case"]
    assert told["units"] == ["K", "W"]
    assert told["times_s"][-1] == 1800.0
