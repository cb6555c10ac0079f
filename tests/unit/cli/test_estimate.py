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
    assert "predicts left-out readings over 10 min" in said.out
    told = json.loads(call(*asked, "--json").out)
    assert set(told["estimators"]) == {"process noise", "output error"}
    assert told["horizon_s"] == 600.0
    assert "noise of case" in told["estimators"]["process noise"]["values"]


def test_a_noise_that_names_nothing(call: Call, tmp_path: Path) -> None:
    said = call("estimate", make_project(tmp_path), "--noise", "cass=free")
    assert said.code == 4
    assert "is not a node, load or boundary." in said.err
