"""A synthetic log of a board in a case, with headings as a person writes them."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from thermid.model.deck import model_from_dict
from thermid.simulation.runs import simulate
from thermid.simulation.scenarios import Scenario

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
