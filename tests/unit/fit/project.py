"""A small project on disk: a part, a pair, logs of both, and the text of a campaign that the tests change in one place."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from thermid.measure.records import Record
from thermid.model.tree import save_model
from unit.fit.bench import HTC, MASS, box, log, pair

PAIR_DECK = """
title  = "Pair"
needs  = ["room"]
offers = ["mid", "a.case", "b.case"]

[submodels]
a = { use = "box.toml", bind = { air = "room" } }
b = { use = "cool.toml", bind = { air = "room" } }

[joints.stack]
between = ["a.skin", "b.skin"]
area = "20 [cm^2]"
contact_conductance = { value = "200 [W/(m^2 K)]", min = 20, max = 2000 }
mid = "mid"
"""

CAMPAIGN = """
title = "Two levels"
note  = "made in a test"

[records.box_bench]
file     = "logs/box_bench.csv"
time     = "time_s"
channels = { T_A = { node = "case", noise = "0.05 [K]", accuracy = "0.3 [K]" }, ROOM = { boundary = "air" } }
get      = "Run the test."

[records.pairs]
files    = "logs/pair_*.csv"
time     = "time_s"

[records.pairs.channels]
T_A  = { node = "a.case", noise = "0.05 [K]", accuracy = "0.3 [K]" }
T_B  = { node = "b.case", noise = "0.05 [K]" }
ROOM = { boundary = "room" }

[[stages]]
name    = "box"
model   = "box.toml"
records = ["box_bench"]
free    = ["skin.effective_htc", "case.mass"]

[[stages]]
name    = "pair"
model   = "pair.toml"
records = ["pair_one"]
free    = ["stack.contact_conductance"]
inherit = { a = { stage = "box", as = "fixed" } }

[[verdicts]]
model    = "pair"
record   = "pair_two"
criteria = { rmse = "0.5 [K]" }
"""

TRUTH = {HTC: "5 [W/(m^2 K)]", MASS: "1.7 [kg]"}
COOL = {"parameters/power/value": "1 [W]", "title": "Cool"}


def write_log(record: Record, path: Path) -> None:
    """Write a record as a log in degrees Celsius."""
    names = list(record.channels)
    rows = np.column_stack([record.times, *(record[n].values - 273.15 for n in names)])
    path.parent.mkdir(exist_ok=True)
    np.savetxt(path, rows, delimiter=",", header=",".join(["time_s", *names]), comments="", fmt="%.4f")


def make_project(folder: Path, campaign: str = CAMPAIGN) -> Path:
    """Write the project and return the path of its campaign."""
    (folder / "thermid.toml").write_text("")
    save_model(box(), folder / "box.toml")
    save_model(box(COOL), folder / "cool.toml")
    (folder / "pair.toml").write_text(PAIR_DECK)
    stack = pair(second=box(COOL))
    hidden = {f"a.{p}": v for p, v in TRUTH.items()} | {"stack.contact_conductance": "150 [W/(m^2 K)]"}
    bias = {"T_A": 0.2}
    write_log(log(box(), TRUTH, {"T_A": "case"}, bias=bias, samples=61), folder / "logs" / "box_bench.csv")
    nodes = {"T_A": "a.case", "T_B": "b.case"}
    for k, name in enumerate(("one", "two")):
        data = log(stack, hidden, nodes, boundary="room", bias=bias, samples=61, seed=5 + k, start=f"{24 + 12 * k} [degC]")
        write_log(data, folder / "logs" / f"pair_{name}.csv")
    path = folder / "campaign.toml"
    path.write_text(campaign)
    return path
