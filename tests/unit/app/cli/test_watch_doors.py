"""The Bench of the studio and `thermid watch --look once --json`: the same log, the same answer."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from recovery.watch_cases import planted
from thermid.app.studio.follow import Follower, LiveWatch
from thermid.model.tree import load_model, save_model
from unit.fit.estimation.rig import rig

ICE = 273.15


def written(folder: Path, seed: int) -> tuple[Path, str]:
    """Write a log with a planted fault, in every other one with room and heater, and return it with the boundary that it lacks."""
    record = planted(seed)[1]
    columns = {f"{n} [degC]": record[n].values - ICE for n in ("chip", "case")}
    if logged := seed % 2 == 1:
        columns |= {"air [degC]": np.full(record.times.size, 22.0), "heater [W]": np.full(record.times.size, 12.0)}
    cells = [[f"{t:.0f}" for t in record.times], *(["" if np.isnan(v) else f"{v:.3f}" for v in column] for column in columns.values())]
    path = folder / "run.csv"
    path.write_text("\n".join([",".join(["time_s", *columns]), *(",".join(row) for row in zip(*cells, strict=True))]) + "\n")
    return path, "" if logged else "air=22"


@pytest.mark.parametrize("seed", [3, *(pytest.param(k, marks=pytest.mark.campaign) for k in range(20) if k != 3)])
def test_the_bench_says_what_the_command_says(call: Callable[..., Any], tmp_path: Path, seed: int) -> None:
    path, boundary = written(tmp_path, seed)
    save_model(rig(), tmp_path / "rig.toml")
    said = call(
        "watch", path, "--model", tmp_path / "rig.toml", "--look", "once", "--json", *(["--boundary", boundary] if boundary else [])
    ).object
    model = load_model(tmp_path / "rig.toml")
    follower = Follower(tmp_path, None, LiveWatch(lambda: model))
    whole = path.read_text()
    path.write_text(whole[: whole.rindex("\n", 0, len(whole) // 2) + 1])
    follower.look({"file": "run.csv", "boundaries": boundary})
    path.write_text(whole)
    told = follower.look({"file": "run.csv", "boundaries": boundary})["watch"]
    assert (told.pop("model"), told.pop("like"), told.pop("unused")) == ("rig", "", "")
    assert told.pop("bound").keys() == {"chip", "case"} | (set() if boundary else {"air", "heater"})
    assert told == {k: v for k, v in said.items() if k != "schema"}
