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
