"""Three levels on disk with a fault planted at the lowest: a box, a pair that holds it, a whole that holds the pair."""

from __future__ import annotations

from pathlib import Path

from thermid.model.tree import load_model, save_model
from unit.fit.bench import HTC, MASS, box, log
from unit.fit.project import COOL, PAIR_DECK, TRUTH, write_log

WHOLE_DECK = """
title = "Whole"
needs = ["room"]

[parameters]
link = { value = "0.3 [W/K]", min = 0.01, max = 5 }

[submodels]
p = { use = "pair.toml", bind = { room = "room" } }
c = { use = "cool.toml", bind = { air = "room" } }

[conductors]
strap = { kind = "conduction", between = ["p.b.case", "c.case"], conductance = "link" }
"""

CAMPAIGN = """
title = "Three levels"

[records.box_bench]
file     = "logs/box_bench.csv"
time     = "time_s"
channels = { T_BOX = { node = "case", noise = "0.05 [K]", accuracy = "0.05 [K]" }, ROOM = { boundary = "air" } }

[records.pairs]
files    = "logs/pair_*.csv"
time     = "time_s"
channels = { T_A = { node = "a.case", noise = "0.05 [K]" }, T_B = { node = "b.case", noise = "0.05 [K]" }, ROOM = { boundary = "room" } }

[records.wholes]
files    = "logs/whole_*.csv"
time     = "time_s"
channels = { T_PB = { node = "p.b.case", noise = "0.05 [K]" }, T_C = { node = "c.case", noise = "0.05 [K]" }, ROOM = { boundary = "room" } }

[[stages]]
name     = "box"
model    = "box.toml"
records  = ["box_bench"]
scenario = { start = "24 [degC]" }
search   = "local"
free     = ["skin.effective_htc", "case.mass"]

[[stages]]
name     = "pair"
model    = "pair.toml"
records  = ["pair_one"]
scenario = { start = "24 [degC]" }
search   = "local"
free     = ["stack.contact_conductance"]
inherit  = { a = { stage = "box" } }

[[stages]]
name     = "whole"
model    = "whole.toml"
records  = ["whole_one"]
scenario = { start = "24 [degC]" }
search   = "local"
free     = ["link"]
inherit  = { p = { stage = "pair" } }

[[verdicts]]
model    = "whole"
record   = "whole_two"
criteria = { rmse = "0.5 [K]" }
"""

SCENARIO = """
title = "bench"
duration = "1 [h]"
start = "24 [degC]"

[boundaries]
room = "24 [degC]"
"""


def planted(folder: Path, bias: float = 0.9, campaign: str = CAMPAIGN) -> Path:
    """Write the project; the sensor of the box is wrong by `bias` [K], its accuracy is 0.05 K. Return the path of the campaign."""
    (folder / "thermid.toml").write_text("")
    save_model(box(), folder / "box.toml")
    save_model(box(COOL), folder / "cool.toml")
    (folder / "pair.toml").write_text(PAIR_DECK)
    (folder / "whole.toml").write_text(WHOLE_DECK)
    (folder / "scenario.toml").write_text(SCENARIO)
    hidden = {f"a.{p}": v for p, v in TRUTH.items()} | {"stack.contact_conductance": "150 [W/(m^2 K)]"}
    logs = folder / "logs"
    write_log(log(box(), TRUTH, {"T_BOX": "case"}, bias={"T_BOX": bias}, samples=61), logs / "box_bench.csv")
    pair = load_model(folder / "pair.toml")
    write_log(log(pair, hidden, {"T_A": "a.case", "T_B": "b.case"}, boundary="room", samples=61, seed=5), logs / "pair_one.csv")
    whole = load_model(folder / "whole.toml")
    above = {f"p.{p}": v for p, v in hidden.items()} | {"link": "0.6 [W/K]"}
    for k, name in enumerate(("one", "two")):
        data = log(whole, above, {"T_PB": "p.b.case", "T_C": "c.case"}, boundary="room", samples=61, seed=7 + k)
        write_log(data, logs / f"whole_{name}.csv")
    path = folder / "campaign.toml"
    path.write_text(campaign)
    return path


BOX_VALUES = (HTC, MASS)
