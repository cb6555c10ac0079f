"""Every modifier of a load with every other one: law over temperature, course in time, control by a sensor."""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
import pytest

import thermid as td
from oracle import Oracle

TIGHT = td.Options(error=4e-10, method="integrator")
TIMES = np.linspace(1.3, 1790.7, 41)
ZERO = "300 [K]"
SAMPLED = 6.0 * (2.0 * np.pi / 400.0) ** 2 / 8.0
"""A sine that is switched is a table of 400 samples a period, joined by straight lines. [W]"""
LAWS: dict[str, dict[str, Any]] = {
    "constant": {"power": "30 [W]"},
    "table": {"table": {"points": [["250 [K]", "40 [W]"], ["300 [K]", "30 [W]"], ["350 [K]", "12 [W]"]]}, "scale": 1.1},
    "polynomial": {
        "power": "30 [W]",
        "temperature_coefficient": "-0.006 [1/K]",
        "quadratic_coefficient": "-2e-5 [1/K^2]",
        "reference_temperature": ZERO,
    },
    "exponential": {"power": "30 [W]", "exponential_coefficient": "-0.008 [1/K]", "reference_temperature": ZERO},
}
COURSES: dict[str, dict[str, Any]] = {
    "steady": {},
    "duty": {"periodic": {"period": "400 [s]", "duty": 0.6}},
    "sine": {"sine": {"amplitude": "6 [W]", "period": "500 [s]"}},
    "duty and sine": {"periodic": {"period": "400 [s]", "duty": 0.6}, "sine": {"amplitude": "6 [W]", "period": "500 [s]"}},
}
CONTROLS: dict[str, dict[str, Any]] = {
    "none": {},
    "thermostat": {"thermostat": {"sensor": "block", "on_below": "24 [degC]", "off_above": "27 [degC]"}},
    "gain": {"proportional": {"sensor": "block", "gain": "4 [W/K]", "setpoint": "30 [degC]"}},
    "band": {"proportional": {"sensor": "block", "band": "9 [K]", "setpoint": "30 [degC]"}},
}
PAIRS = [(a, b, c) for a, b, c in product(LAWS, COURSES, CONTROLS) if not (a == "table" and c == "gain")]


def deck(law: str, course: str, control: str) -> dict[str, Any]:
    return {
        "title": "plate",
        "needs": ["air"],
        "nodes": {"plate": {"capacitance": "150 [J/K]"}, "block": {"capacitance": "500 [J/K]"}},
        "conductors": {
            "join": {"kind": "conduction", "between": ["plate", "block"], "conductance": "1.5 [W/K]"},
            "loss": {"kind": "conduction", "between": ["block", "air"], "conductance": "0.8 [W/K]"},
        },
        "loads": {"heater": {"into": "plate", **LAWS[law], **COURSES[course], **CONTROLS[control]}},
    }


SCENARIO = td.Scenario("cold", boundaries={"air": "15 [degC]"}, start="18 [degC]", duration="1800 [s]")


@pytest.mark.parametrize(("law", "course", "control"), PAIRS)
def test_power_balance_derivatives_and_members(law: str, course: str, control: str) -> None:
    """At the stored times the power is the formula's; energy closes; derivatives are differences; members are single runs."""
    written = deck(law, course, control)
    model = td.model_from_dict(written)
    free = ["heater.scale" if law == "table" else "heater.power", "join.conductance"]
    free += [f"heater.{k}" for k in ("temperature_coefficient", "exponential_coefficient") if k in LAWS[law]]
    free += ["heater.sine.amplitude"] if "sine" in course else []
    free += [f"heater.{c}.{k}" for c, fields in CONTROLS[control].items() for k in fields if k != "sensor"]
    simulator = td.prepare(model, SCENARIO, free, times=TIMES, options=TIGHT)
    run = simulator.run(sensitivities=True)
    oracle = Oracle(written, {"boundaries": {"air": "15 [degC]"}, "start": "18 [degC]", "duration": "1800 [s]"})
    oracle.on, switched = {"heater": True}, [t for t, _ in run.statistics["switchings"]]
    for k, t in enumerate(TIMES):
        oracle.middle = t
        oracle.on["heater"] = sum(s <= t for s in switched) % 2 == 0
        every = np.array([run[n].kelvin[k] for n in oracle.names])
        heat = oracle.loads[0][3](t, every)
        assert run.load_powers["heater"][k] == pytest.approx(heat, rel=1e-9, abs=SAMPLED if "duty and" in course else 1e-9)
    assert run.heat_balance().relative < 1e-9
    assert (control == "thermostat") == bool(switched)
    # every free name moves the plate; differences of runs that tight are right to about 1e-6 of it
    for name in free:
        value = simulator.nominal[name]
        step = 3e-5 if value > 250.0 else 1e-5 * abs(value)  # a threshold moves an instant: by less than to the next stored time
        sides = [simulator.run(simulator.with_units({name: value + s * step}))["plate"].kelvin for s in (1.0, -1.0)]
        difference = (sides[0] - sides[1]) / (2.0 * step)
        size = np.abs(difference).max()
        assert size > 0.0 or name == "heater.power"
        assert np.abs(run.sensitivity("plate", name) - difference).max() < 2e-4 * size + 1e-12
    members = simulator.ensemble({name: simulator.nominal[name] * np.array([1.0, 1.001]) for name in free[:2]}, nodes=("plate",))
    for k, factor in enumerate((1.0, 1.001)):
        alone = simulator.run({name: simulator.nominal[name] * factor for name in free[:2]})["plate"].kelvin
        assert np.abs(members.temperatures("plate")[:, k] - alone).max() < 1e-6
