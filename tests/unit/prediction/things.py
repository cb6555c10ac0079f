"""Three fitted models, each with a scenario near the conditions of its fit and one far from them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

import thermid as td


@dataclass(frozen=True, eq=False)
class Case:
    """A fit, the node that is asked about, and scenarios in and out of the fit's conditions."""

    fit: td.Calibration
    node: str
    inside: td.Scenario
    outside: td.Scenario


def plate(surface: dict[str, Any], **more: Any) -> td.Model:
    """A heated plate in a room, with the surface asked for."""
    return td.model_from_dict(
        {
            "title": "plate",
            "needs": ["air"],
            "nodes": {"plate": {"capacitance": {"value": "600 [J/K]", "min": 100, "max": 3000}}},
            "surfaces": {"skin": {"of": "plate", "to": "air", "area": "0.05 [m^2]", **surface}},
            "loads": {"heat": {"into": "plate", "power": "2.5 [W]"}},
            **more,
        }
    )


HTC = {"value": "5 [W/(m^2 K)]", "min": 1, "max": 30}
BENCH = td.Scenario("bench", boundaries={"air": "24 [degC]"}, start="24 [degC]", duration="2 [h]", loads={"heat": "2.5 [W]"})
HOT = BENCH.with_(title="hot", boundaries={"air": "40 [degC]"}, start="40 [degC]", loads={"heat": "9 [W]"}, duration="1 [h]")
"""It ends while it still warms up, so that its highest temperature is its last, as a hold time looks at it."""


def _log(model: td.Model, scenario: td.Scenario, node: str, noise: float, seed: int) -> td.Record:
    times = np.arange(0.0, scenario.seconds + 1.0, 60.0)
    kelvin = td.simulate(model, scenario, times=times)[node].kelvin + noise * np.random.default_rng(seed).standard_normal(times.size)
    return td.Record.from_arrays(
        "log", times, {"T": td.Channel.from_array("T", kelvin, unit="K", role="node", target=node, noise=noise, accuracy=0.2)}
    )


@cache
def constant() -> Case:
    """Convection by a constant coefficient, while that of the truth grows with the difference."""
    truth = plate({"htc": {"coefficient": "2.8 [W/(m^2 K)]", "exponent": 0.25}})
    model = plate({"htc": HTC})
    fit = td.calibrate(model, _log(truth, BENCH, "plate", 0.05, 1), ["skin.htc", "plate.capacitance"], scenario=BENCH)
    return Case(fit, "plate", BENCH, HOT)


@cache
def natural() -> Case:
    """Convection by a law of the difference, and an emissivity that nobody measured."""
    law = {"coefficient": {"value": "2.8 [W/(m^2 K)]", "min": 0.5, "max": 9}, "exponent": 0.25}
    model = plate({"htc": law, "emissivity": {"value": "0.5", "min": 0, "max": 1}})
    free = ["skin.htc.coefficient", "plate.capacitance"]
    fit = td.calibrate(model, _log(model, BENCH, "plate", 0.3, 2), free, scenario=BENCH)
    return Case(fit, "plate", BENCH, HOT)


@cache
def joint() -> Case:
    """A joint of spots and gas in parallel, fitted in air and asked about without."""
    half = {"contact_conductance": "260 [W/(m^2 K)]", "gap": "100 [um]"}
    plain = {"contact_conductance": {"value": "300 [W/(m^2 K)]", "min": 20, "max": 3000}}

    def stack(own: dict[str, Any]) -> td.Model:
        return td.model_from_dict(
            {
                "title": "stack",
                "needs": ["air", "base"],
                "nodes": {"block": {"capacitance": "60 [J/K]"}},
                "surfaces": {"skin": {"of": "block", "to": "air", "area": "20 [cm^2]", "htc": "5 [W/(m^2 K)]", "emissivity": 0.05}},
                "conductors": {"joint": {"kind": "contact", "between": ["block", "base"], "area": "4 [cm^2]"} | own},
                "loads": {"heat": {"into": "block", "power": "4 [W]"}},
            }
        )

    bench = td.Scenario("bench", boundaries={"air": "24 [degC]", "base": "20 [degC]"}, start="base", duration="1 [h]")
    fit = td.calibrate(
        stack(plain), _log(stack(half), bench, "block", 0.05, 1), ["joint.contact_conductance", "block.capacitance"], scenario=bench
    )
    return Case(fit, "block", bench, bench.vacuum().with_(title="pumped"))


CASES = {"constant": constant, "natural": natural, "joint": joint}
