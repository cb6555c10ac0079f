"""Property 10: the error falls with the order of the method, and with the tolerance."""

from __future__ import annotations

import numpy as np
import pytest

import thermid as td

LOOSE = 1e9
END = 3600.0
TIMES = np.linspace(0.0, END, 5)


def _pair(radiating: bool) -> td.Model:
    link = (
        {"kind": "radiation", "emissivity": 0.8, "area": "0.2 [m^2]"} if radiating else {"kind": "conduction", "conductance": "1.2 [W/K]"}
    )
    return td.model_from_dict(
        {
            "title": "Pair",
            "needs": ["room"],
            "nodes": {"a": {"capacitance": "900 [J/K]"}, "b": {"capacitance": "600 [J/K]"}},
            "conductors": {
                "ab": {"between": ["a", "b"], **link},
                "out": {"kind": "conduction", "conductance": "0.5 [W/K]", "between": ["b", "room"]},
            },
            "loads": {"q": {"into": "a", "power": "9 [W]", "exponential_coefficient": "-0.01 [1/K]", "reference_temperature": "300 [K]"}},
        }
    )


@pytest.mark.properties
@pytest.mark.parametrize("radiating", [False, True])
@pytest.mark.parametrize("room", ["280 [K]", {"mean": "280 [K]", "amplitude": "20 [K]", "period": "7200 [s]"}])
def test_error_falls_with_the_fourth_power_of_the_step(radiating: bool, room: object) -> None:
    model = _pair(radiating)
    scenario = td.Scenario("fall", boundaries={"room": room}, start="400 [K]", duration=END)

    def end(**options: float) -> np.ndarray:
        return td.simulate(model, scenario, times=TIMES, options=td.Options(**options)).temperatures[:, :2]

    exact = end(error=1e-11)
    errors = np.array([np.abs(end(error=LOOSE, max_step=END / n) - exact).max() for n in (8, 16, 32, 64)])
    orders = np.log2(errors[:-1] / errors[1:])
    assert np.all(orders > 3.5), (errors, orders)


@pytest.mark.properties
def test_error_falls_with_the_tolerance() -> None:
    model = _pair(radiating=True)
    scenario = td.Scenario("fall", boundaries={"room": "280 [K]"}, start="400 [K]", duration=END)
    times = np.linspace(0, END, 61)

    def run(tolerance: float) -> np.ndarray:
        return td.simulate(model, scenario, times=times, options=td.Options(error=4.0 * tolerance)).temperatures

    exact = run(1e-12)
    tolerances = np.array([1e-3, 1e-5, 1e-7])
    errors = np.array([np.abs(run(t) - exact).max() for t in tolerances])
    assert np.all(errors < 100 * tolerances), errors
    assert np.all(errors[1:] < 0.1 * errors[:-1]), errors
