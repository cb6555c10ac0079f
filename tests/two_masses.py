"""Synthetic logs with headings as a person writes them: a board in a case, a pair, two heaters on a board, a part with a fan."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from thermid.model.tree import model_from_dict
from thermid.simulation.runs import Scenario, simulate

TRUTH = {"contact_conductance": 640.0, "effective_htc": 9.3}
DECK = {
    "title": "box",
    "needs": ["room"],
    "nodes": {"board": {"capacitance": "120 [J/K]"}, "case": {"capacitance": "450 [J/K]"}},
    "conductors": {
        "joint": {"kind": "contact", "between": ["board", "case"], "contact_conductance": "640 [W/(m^2 K)]", "area": "10 [cm^2]"}
    },
    "surfaces": {"skin": {"of": "case", "to": "room", "area": "600 [cm^2]", "effective_htc": "9.3 [W/(m^2 K)]"}},
    "loads": {"heater": {"into": "board", "power": "5 [W]"}},
}
HEATING = 9000.0
"""Time for which the heater is on. [s]"""


PAIR = {
    "title": "pair",
    "needs": ["air"],
    "nodes": {
        "proc": {"mass": "1.53 [kg]", "specific_heat": "960 [J/(kg K)]"},
        "supply": {"mass": "0.78 [kg]", "specific_heat": "960 [J/(kg K)]"},
    },
    "conductors": {
        "joint": {"kind": "contact", "between": ["proc", "supply"], "contact_conductance": "420 [W/(m^2 K)]", "area": "25 [cm^2]"}
    },
    "surfaces": {
        "top": {"of": "proc", "to": "air", "area": "627 [cm^2]", "effective_htc": "5.4 [W/(m^2 K)]"},
        "rim": {"of": "supply", "to": "air", "area": "200 [cm^2]", "effective_htc": "3.1 [W/(m^2 K)]"},
    },
    "loads": {"electronics": {"into": "proc", "power": "4.11 [W]"}, "converter": {"into": "supply", "power": "2.2 [W]"}},
}
"""The processor of the source document over the power supply of its gyros; values of contact and air are made up."""


def write_pair_log(path: Path) -> Path:
    """Write eight hours of the pair, the processor alone in the second half, with noise of 0.05 K; return the file."""
    times, rng = np.arange(0.0, 28801.0, 120.0), np.random.default_rng(5)
    power = {"times": ["0 [s]", "14400 [s]"], "values": ["2.2 [W]", "0 [W]"], "hold": True}
    scenario = Scenario("pair", boundaries={"air": "24 [degC]"}, loads={"converter": power}, start="24 [degC]", duration="8 [h]")
    solution = simulate(model_from_dict(PAIR), scenario, times=times)
    proc, supply = (solution[n].celsius + rng.normal(0.0, 0.05, times.size) for n in ("proc", "supply"))
    rows = [f"{t:.0f},{a:.3f},{b:.3f},24.0,4.11,{2.2 * (t < 14400.0):.2f}" for t, a, b in zip(times, proc, supply, strict=True)]
    path.write_text("\n".join(["# SYNTHETIC", "time_s,proc C,supply C,air C,electronics W,converter W", *rows, ""]), encoding="utf-8")
    return path


def write_log(path: Path, seed: int = 3) -> Path:
    """Write four hours of readings with noise of 0.05 K and return the file."""
    times = np.arange(0.0, 14401.0, 60.0)
    power = {"times": ["0 [s]", f"{HEATING} [s]"], "values": ["5 [W]", "0 [W]"], "hold": True}
    scenario = Scenario("test", boundaries={"room": "23 [degC]"}, loads={"heater": power}, start="23 [degC]", duration="4 [h]")
    solution, rng = simulate(model_from_dict(DECK), scenario, times=times), np.random.default_rng(seed)
    board, case = (solution[n].celsius + rng.normal(0.0, 0.05, times.size) for n in ("board", "case"))
    rows = [f"{t:.0f},{a:.3f},{b:.3f},23.000,{5.0 * (t < HEATING):.3f}" for t, a, b in zip(times, board, case, strict=True)]
    path.write_text("\n".join(["time_s,board C,case C,room C,heater W", *rows, ""]), encoding="utf-8")
    return path


BOX = """title = "box"
needs = ["room"]

[nodes]
board = { capacitance = { value = "120 [J/K]", min = "1 [J/K]", max = "1e5 [J/K]" } }
case = { capacitance = "450 [J/K]" }

[conductors]
joint = { kind = "contact", between = ["board", "case"], contact_conductance = "500 [W/(m^2 K)]", area = "10 [cm^2]" }

[surfaces]
skin = { of = "case", to = "room", area = "600 [cm^2]", effective_htc = "8 [W/(m^2 K)]" }

[loads]
heater = { into = "board", power = "5 [W]" }
"""

PLAN = """title = "plan"

[records.run]
file = "logs/run.csv"
channels = { "board C" = { node = "board", unit = "degC" }, "case C" = { node = "case", unit = "degC" }, "room C" = { boundary = "room", unit = "degC" }, "heater W" = { load = "heater", unit = "W" } }

[[stages]]
name = "both"
model = "box.toml"
records = ["run"]
free = ["joint.contact_conductance", "skin.effective_htc"]
"""  # noqa: E501


def write_plan(folder: Path) -> Path:
    """Write the box as a person guesses it, its log, and a plan of one stage that fits it; return the plan."""
    (folder / "logs").mkdir()
    write_log(folder / "logs" / "run.csv")
    (folder / "box.toml").write_text(BOX, encoding="utf-8")
    (folder / "plan.toml").write_text(PLAN, encoding="utf-8")
    return folder / "plan.toml"


HEATERS = {
    "title": "lab",
    "needs": ["room"],
    "nodes": {"T1": {"capacitance": "2 [J/K]"}, "T2": {"capacitance": "2 [J/K]"}, "board": {"capacitance": "15 [J/K]"}},
    "conductors": {
        "T1_board": {"kind": "conduction", "between": ["T1", "board"], "conductance": "0.0052 [W/K]"},
        "T2_board": {"kind": "conduction", "between": ["T2", "board"], "conductance": "0.0041 [W/K]"},
        "board_room": {"kind": "conduction", "between": ["board", "room"], "conductance": "0.02 [W/K]"},
    },
    "surfaces": {
        "T1_room": {"of": "T1", "to": "room", "area": "10 [cm^2]", "effective_htc": "12.5 [W/(m^2 K)]"},
        "T2_room": {"of": "T2", "to": "room", "area": "10 [cm^2]", "effective_htc": "9.1 [W/(m^2 K)]"},
    },
    "loads": {"Q1": {"into": "T1", "power": "1.2 [W]"}, "Q2": {"into": "T2", "power": "0.6 [W]"}},
}
"""Two heaters on a board in the way of TCLab: commands in per cent, and no column of the room."""


def write_heaters_log(path: Path) -> Path:
    """Write twenty minutes of both heaters in the columns of TCLab, with noise of 0.1 K; return the file."""
    times, rng = np.arange(0.0, 1201.0, 4.0), np.random.default_rng(7)
    first, second = np.where(times < 700.0, 60.0, 0.0), np.where((times >= 240.0) & (times < 960.0), 80.0, 0.0)
    steps = {"Q1": (["0 [s]", "700 [s]"], ["0.6", "0"]), "Q2": (["0 [s]", "240 [s]", "960 [s]"], ["0", "0.8", "0"])}
    commands = {name: {"times": t, "values": v, "hold": True} for name, (t, v) in steps.items()}
    scenario = Scenario("lab", boundaries={"room": "23 [degC]"}, commands=commands, start="23 [degC]", duration="20 [min]")
    solution = simulate(model_from_dict(HEATERS), scenario, times=times)
    read = [solution[n].celsius + rng.normal(0.0, 0.1, times.size) for n in ("T1", "T2")]
    rows = [f"{t:.0f},{p:.0f},{q:.0f},{a:.2f},{b:.2f}" for t, p, q, a, b in zip(times, first, second, *read, strict=True)]
    path.write_text("\n".join(["# SYNTHETIC", "time_s,Q1_pct,Q2_pct,T1_C,T2_C", *rows, ""]), encoding="utf-8")
    return path


def _turns(on: str, off: str, share: str) -> dict[str, object]:
    turns = {"ends": {"from": "on", "to": "off", "after": on}, "begins": {"from": "off", "to": "on", "after": off}}
    return {"modes": {"on": 1, "off": share}, "starts": "on", "transitions": turns}


COOLED = {
    "title": "cooled",
    "needs": ["air"],
    "nodes": {"chip": {"capacitance": "300 [J/K]"}, "sink": {"capacitance": "200 [J/K]"}},
    "conductors": {"pad": {"kind": "conduction", "between": ["chip", "sink"], "conductance": "0.9 [W/K]"}},
    "surfaces": {"fins": {"of": "sink", "to": "air", "area": "400 [cm^2]", "effective_htc": "24 [W/(m^2 K)]", "htc_control": "fan"}},
    "loads": {"work": {"into": "chip", "power": "9 [W]", "control": "shift"}},
    "controls": {"fan": _turns("40 [min]", "20 [min]", "0.3"), "shift": _turns("30 [min]", "15 [min]", "0")},
}
"""A part that works by a schedule on a sink whose fan runs by another."""


def write_cooled_log(path: Path) -> Path:
    """Write four hours of the part with its fan, with noise of 0.05 K and no column of power; return the file."""
    times, rng = np.arange(0.0, 14401.0, 60.0), np.random.default_rng(9)
    scenario = Scenario("cooled", boundaries={"air": "23 [degC]"}, start="23 [degC]", duration="4 [h]")
    solution = simulate(model_from_dict(COOLED), scenario, times=times)
    chip, sink = (solution[n].celsius + rng.normal(0.0, 0.05, times.size) for n in ("chip", "sink"))
    rows = [f"{t:.0f},{a:.3f},{b:.3f},23.0" for t, a, b in zip(times, chip, sink, strict=True)]
    path.write_text("\n".join(["# SYNTHETIC", "time_s,chip C,sink C,air C", *rows, ""]), encoding="utf-8")
    return path
