"""A small campaign of three levels. Its first stage can be planted wrong: a sensor reads 4 K too much and is said to be good to 0.1 K."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import thermid as td
from thermid.model.tree import TableSignal

PART = """
title  = "part"
needs  = ["air"]
offers = ["case"]
[nodes]
case = { capacitance = { value = "900 [J/K]", min = 300, max = 3000 } }
[surfaces]
skin = { of = "case", to = "air", area = "0.08 [m^2]", effective_htc = { value = "5 [W/(m^2 K)]", min = 1, max = 20 } }
[loads]
electronics = { into = "case", power = "6 [W]" }
"""
PAIR = """
title  = "pair"
needs  = ["air"]
offers = ["x.case", "plate"]
[submodels]
x = { use = "part.toml", bind = { air = "air" } }
y = { use = "part.toml", bind = { air = "air" } }
[nodes]
plate = { capacitance = "1200 [J/K]" }
[conductors]
foot_x = { kind = "conduction", between = ["x.case", "plate"], conductance = { value = "0.8 [W/K]", min = 0.1, max = 5 } }
foot_y = { kind = "conduction", between = ["y.case", "plate"], conductance = "0.8 [W/K]" }
"""
WHOLE = """
title = "whole"
needs = ["air"]
[submodels]
pair = { use = "pair.toml", bind = { air = "air" } }
[nodes]
base = { capacitance = "2500 [J/K]" }
[conductors]
bolts = { kind = "conduction", between = ["pair.plate", "base"], conductance = { value = "0.5 [W/K]", min = 0.05, max = 5 } }
[surfaces]
under = { of = "base", to = "air", area = "0.1 [m^2]", effective_htc = "4 [W/(m^2 K)]" }
"""
CAMPAIGN = """
title = "three levels"
note  = "Synthetic."
[records.part]
file = "part.csv"
time = "time_s"
[records.part.channels]
T1 = { node = "case", noise = "0.05 [K]", accuracy = "ACCURACY [K]" }
T_LAB = { boundary = "air", accuracy = "0.2 [K]" }
P = { load = "electronics", accuracy = "0.1 [W]" }
[records.pair]
files = "pair_*.csv"
time = "time_s"
[records.pair.channels]
T_X = { node = "x.case", noise = "0.05 [K]", accuracy = "2 [K]" }
T_PLATE = { node = "plate", noise = "0.05 [K]", accuracy = "0.2 [K]" }
T_ROOM = { boundary = "air", accuracy = "0.2 [K]" }
P_X = { load = "x.electronics", accuracy = "0.1 [W]" }
P_Y = { load = "y.electronics", accuracy = "0.1 [W]" }
[records.whole]
file = "whole.csv"
time = "time_s"
[records.whole.channels]
T_BASE = { node = "base", noise = "0.05 [K]", accuracy = "0.2 [K]" }
T_ROOM = { boundary = "air", accuracy = "0.2 [K]" }
P_X = { load = "pair.x.electronics" }
P_Y = { load = "pair.y.electronics" }
[[stages]]
name = "part"
model = "part.toml"
records = ["part"]
scenario = { start = "air" }
free = ["skin.effective_htc", "case.capacitance"]
[[stages]]
name = "pair"
model = "pair.toml"
records = ["pair_both", "pair_one"]
scenario = { start = "air" }
inherit = { x = { stage = "part" } }
free = ["foot_x.conductance", "x.skin.effective_htc"]
priors = { "foot_x.conductance" = { sd = "30 [%]" } }
[[stages]]
name = "whole"
model = "whole.toml"
records = ["whole"]
scenario = { start = "air" }
inherit = { pair = { stage = "pair", only = ["foot_x.conductance"] } }
free = ["bolts.conductance"]
"""
_TWIN = {"skin.effective_htc": "5.6 [W/(m^2 K)]", "case.capacitance": "1040 [J/K]"}
TRUTH = {
    "part": {"skin.effective_htc": "6.3 [W/(m^2 K)]", "case.capacitance": "1040 [J/K]"},
    "pair": {f"{part}.{name}": text for part in "xy" for name, text in _TWIN.items()} | {"foot_x.conductance": "1.1 [W/K]"},
    "whole": {"pair.x.case.capacitance": "1040 [J/K]", "pair.y.case.capacitance": "1040 [J/K]", "pair.foot_x.conductance": "1.1 [W/K]"}
    | {"bolts.conductance": "0.35 [W/K]"},
}
OFFSETS = {"T1": 4.0, "T_X": 1.7, "T_PLATE": 0.1, "T_BASE": 0.1, "T_ROOM": 0.15}
"""Constant error of each sensor. [K]"""
GAIN = 1.012
"""What the meters read over what is there. [-]"""
STEP, END = 60.0, 9000.0


def switched(times: np.ndarray, watts: float, spans: tuple[tuple[float, float], ...]) -> np.ndarray:
    """Return a power that is 0 W outside some spans of time. [W]"""
    on = np.any([(times >= a) & (times < b) for a, b in spans], axis=0)
    return np.where(on, watts, 0.0)


def _log(folder: Path, name: str, deck: str, sensors: dict[str, str], powers: dict[str, tuple[str, np.ndarray]], seed: int) -> None:
    rng = np.random.default_rng(seed)
    times = np.arange(0.0, END + 1.0, STEP)
    model = td.load_model(folder / f"{deck}.toml").with_values(TRUTH[deck])
    room = 295.15 + 0.8 * np.sin(times / 2500.0)
    loads = {load: TableSignal(times, watts, hold=True) for load, watts in powers.values()}
    run = td.simulate(
        model,
        td.Scenario(name, boundaries={"air": (times, td.quantity(room, unit="K"))}, loads=loads, start="air", duration=END),
        times=times,
    )
    columns = {s: run[n].celsius + OFFSETS[s] + 0.03 * rng.standard_normal(times.size) for s, n in sensors.items()}
    columns["T_LAB" if deck == "part" else "T_ROOM"] = room - 273.15 + OFFSETS["T_ROOM"]
    heads = [f"{s} [degC]" for s in columns] + [f"{meter} [W]" for meter in powers]
    table = np.column_stack([times, *columns.values(), *(GAIN * watts for _, watts in powers.values())])
    text = "# SYNTHETIC\n" + ",".join(["time_s", *heads]) + "\n" + "\n".join(",".join(f"{v:.4f}" for v in row) for row in table)
    (folder / f"{name}.csv").write_text(text + "\n", encoding="utf-8")


def campaign(folder: Path, planted: bool = False) -> Path:
    """Write decks, logs and campaign; the first stage is not credible where `planted`: its sensor is said to be good to 0.1 K."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "thermid.toml").write_text("", encoding="utf-8")
    for name, deck in (("part", PART), ("pair", PAIR), ("whole", WHOLE)):
        (folder / f"{name}.toml").write_text(deck, encoding="utf-8")
    times = np.arange(0.0, END + 1.0, STEP)
    pulse, late, always = ((600.0, 4200.0),), ((3000.0, 6000.0),), ((0.0, END + 1.0),)
    _log(folder, "part", "part", {"T1": "case"}, {"P": ("electronics", switched(times, 7.0, pulse))}, 1)
    seen = {"T_X": "x.case", "T_PLATE": "plate"}
    for k, (name, y) in enumerate((("both", late), ("one", ()))):
        spans = {"P_X": ("x.electronics", pulse), "P_Y": ("y.electronics", y)}
        powers = {m: (load, switched(times, 7.0, s) if s else np.zeros(times.size)) for m, (load, s) in spans.items()}
        _log(folder, f"pair_{name}", "pair", seen, powers, 2 + k)
    powers = {"P_X": ("pair.x.electronics", switched(times, 7.0, always)), "P_Y": ("pair.y.electronics", switched(times, 7.0, late))}
    _log(folder, "whole", "whole", {"T_BASE": "base"}, powers, 5)
    file = folder / "campaign.toml"
    file.write_text(CAMPAIGN.replace("ACCURACY", "0.1" if planted else "3"), encoding="utf-8")
    return file
