"""Models with every law that is exported, and scenarios with every signal."""

from __future__ import annotations

from typing import Any

import thermid as td

HOT: dict[str, Any] = {
    "title": "hot box",
    "needs": ["air", "wall"],
    "parameters": {"area": "0.1 [m^2]", "paint": "0.8", "share": "0.25", "_gain": "28 [W]"},
    "nodes": {"box": {"mass": "2 [kg]", "specific_heat": "900 [J/(kg K)]"}, "lid": {"capacitance": "300 [J/K]"}, "seam": {}, "glue": {}},
    "conductors": {
        "free": {
            "kind": "convection",
            "between": ["box", "air"],
            "htc": {"coefficient": "1.4 [W/(m^2 K)]", "exponent": 0.25},
            "area": "area",
        },
        "glow": {"kind": "radiation", "between": ["lid", "wall"], "emissivity": "paint", "area": "share*area"},
        "first": {"kind": "conduction", "between": ["box", "seam"], "conductance": "2 [W/K]"},
        "second": {"kind": "conduction", "between": ["seam", "glue"], "resistance": "0.5 [K/W]"},
        "third": {"kind": "contact", "between": ["glue", "lid"], "contact_conductance": "40 [W/(m^2 K)]", "area": "share*area"},
        "leak": {"kind": "conduction", "between": ["glue", "air"], "conductance": "0.05 [W/K]"},
        "blow": {"kind": "flow", "between": ["air", "lid"], "mass_flow": "1e-4 [kg/s]", "specific_heat": "1006 [J/(kg K)]"},
    },
    "loads": {"heater": {"into": "box", "power": "30 [W]"}, "seam_heater": {"into": "seam", "power": "2 [W]"}},
}


def hot_box(**conductors: dict[str, Any]) -> td.Model:
    """A box with natural convection, radiation, a one-way flow and two massless nodes in a row, one of them heated; loads that change."""
    loads = {
        **HOT["loads"],
        "breath": {"into": "lid", "power": "3 [W]", "sine": {"amplitude": "1 [W]", "period": "1 [h]"}},
        "pulse": {"into": "box", "power": "4 [W]", "periodic": {"period": "1 [h]", "duty": 0.3}},
    }
    return td.model_from_dict({**HOT, "loads": loads, "conductors": {**HOT["conductors"], **conductors}})


GAP = {
    "kind": "contact",
    "between": ["box", "lid"],
    "contact_conductance": "20 [W/(m^2 K)]",
    "gap": "0.4 [mm]",
    "area": "0.05 [m^2]",
}
"""A joint with a gap, whose gas is a law of its own."""
SIGNALS = td.Scenario(
    "signals",
    boundaries={
        "air": {"mean": "20 [degC]", "amplitude": "5 [K]", "period": "2 [h]", "phase": 0.5},
        "wall": {"times": ["0 [s]", "1 [h]", "3 [h]"], "values": ["15 [degC]", "35 [degC]", "25 [degC]"]},
    },
    commands={"heater": {"times": ["0 [s]", "0.5 [h]", "2 [h]"], "values": ["1", "0.2", "0.7"], "hold": True}},
    initial={"lid": "40 [degC]"},
    start="20 [degC]",
    duration="3 [h]",
)
TIGHT = td.Options(error=4e-8)
