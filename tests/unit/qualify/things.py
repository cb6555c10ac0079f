"""A small unit for the tests of this folder: two boxes on a plate, each with a heater."""

from __future__ import annotations

import thermid as td

UNIT = {
    "title": "unit",
    "needs": ["air"],
    "nodes": {
        "proc": {"capacitance": "600 [J/K]"},
        "ele": {"capacitance": "400 [J/K]"},
        "plate": {"capacitance": "1500 [J/K]"},
    },
    "conductors": {
        "p": {"kind": "conduction", "between": ["proc", "plate"], "conductance": "0.8 [W/K]"},
        "e": {"kind": "conduction", "between": ["ele", "plate"], "conductance": "0.5 [W/K]"},
        "out": {"kind": "conduction", "between": ["plate", "air"], "conductance": {"value": "0.9 [W/K]", "min": 0.3, "max": 2}},
        "skin": {"kind": "conduction", "between": ["proc", "air"], "conductance": "0.1 [W/K]"},
    },
    "loads": {"cpu": {"into": "proc", "power": "6 [W]"}, "psu": {"into": "ele", "power": "3 [W]"}},
}


def unit() -> td.Model:
    return td.model_from_dict(UNIT)


def soak(celsius: float = 40.0, hours: float = 6.0, **more: object) -> td.Scenario:
    return td.Scenario("soak", boundaries={"air": f"{celsius} [degC]"}, start="20 [degC]", duration=f"{hours} [h]", **more)
