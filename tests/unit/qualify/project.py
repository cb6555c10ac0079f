"""A small plan with logs that were made, for the tests of plans."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import thermid as td
from unit.qualify.things import unit

PLAN = """
title = "unit, qualified"
objectives = ["limits kept"]
success = ["every verdict met"]

[model]
deck = "unit.toml"

[limits.processor]
node = "proc"
operating = ["-20 [degC]", "70 [degC]"]
loads = ["cpu"]

[sensors]
T_PROC = { node = "proc", reason = "hottest", accuracy = "0.3 [K]", noise = "0.1 [K]" }
T_ELE  = { node = "ele", reason = "second", accuracy = "0.3 [K]", noise = "0.1 [K]" }

[criteria.ours]
mean = "1 [K]"
each = "2 [K]"
kinds = ["steady", "transient"]

[exclusions]
cap = 0.5

[[tests]]
name = "hot"
kind = "thermal cycling"
scenario = { boundaries = { air = "40 [degC]" }, start = "20 [degC]", duration = "6 [h]" }
criteria = ["ECSS", "ours"]
steady = [["5 [h]", "6 [h]"]]

[[tests]]
name = "experiment on board"
kind = "on-board"
scenario = { boundaries = { air = "10 [degC]" }, start = "20 [degC]", duration = "2 [h]" }
sensors = ["T_PROC"]
criteria = ["MIL-HDBK-340, transient"]
"""
LOG = 'log = { file = "hot.csv", boundaries = { ROOM = "air" } }\n'
"""What the table of the hot test gains when its log is there."""


def project(folder: Path, text: str = PLAN) -> Path:
    """Return the plan's file, its deck beside it."""
    (folder / "thermid.toml").touch()
    td.save_model(unit(), folder / "unit.toml")
    (folder / "plan.toml").write_text(text, encoding="utf-8")
    return folder / "plan.toml"


def with_log(text: str, **more: str) -> str:
    """Return the plan with the log of its hot test."""
    end = '\n[[tests]]\nname = "experiment'
    return text.replace(end, LOG + "".join(f"{k} = {v}\n" for k, v in more.items()) + end)


def measured(folder: Path, model: td.Model | None = None, offset: float = 0.0, name: str = "hot.csv") -> None:
    """Write the log of the hot test, of the unit or of another one, all its sensors off by so much."""
    times = np.arange(0.0, 6 * 3600.1, 120.0)
    course = td.Scenario("hot", boundaries={"air": "40 [degC]"}, start="20 [degC]", duration="6 [h]")
    run = td.simulate(model or unit(), course, times=times)
    rng = np.random.default_rng(5)
    columns = [run[n].celsius + offset + 0.1 * rng.standard_normal(times.size) for n in ("proc", "ele")]
    table = np.column_stack([times, *columns, np.full(times.size, 40.0)])
    header = "# SYNTHETIC\ntime_s,T_PROC,T_ELE,ROOM"
    np.savetxt(folder / name, table, delimiter=",", header=header, comments="", fmt="%.3f")


__all__ = ["LOG", "PLAN", "measured", "project", "with_log"]
