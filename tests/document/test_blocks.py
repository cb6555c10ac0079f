"""Rows B1, B14 and B16: one test per block, the Biot number, and power that follows temperature."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest

import thermid as td
from by_code import raises_code, warns_code
from strategies import TIGHTER
from thermid.base.errors import SolverError
from thermid.physics.htc import biot_number

pytestmark = pytest.mark.document
HOT, COLD = 309.088, 297.15


def _block(law: dict[str, Any]) -> np.ndarray:
    """Return the heat flow of one conductor between two temperature sources. [W]"""
    deck = {
        "title": "Block",
        "needs": ["hot", "cold"],
        "nodes": {"by": {"capacitance": "1 [J/K]"}},
        "conductors": {"x": {"between": ["hot", "cold"], **law}},
    }
    sources = {"hot": f"{HOT} [K]", "cold": f"{COLD} [K]"}
    return td.simulate(td.model_from_dict(deck), td.Scenario("on", boundaries=sources, start="cold", duration=1.0)).heat_flow("x")


def test_B1_conduction() -> None:  # noqa: N802
    """R = L/(k A)."""
    flow = _block({"kind": "conduction", "conductivity": "130 [W/(m K)]", "area": "29.2 [cm^2]", "thickness": "5 [mm]"})
    assert flow == pytest.approx((HOT - COLD) / (0.005 / (130 * 0.00292)), rel=1e-12)


def test_B1_convection() -> None:  # noqa: N802
    """R = 1/(h A)."""
    flow = _block({"kind": "convection", "htc": "6 [W/(m^2 K)]", "area": "0.0627 [m^2]"})
    assert flow == pytest.approx((HOT - COLD) * 6 * 0.0627, rel=1e-12)


def test_B1_radiation() -> None:  # noqa: N802
    """Q = eps sigma A (Ts^4 - Tsurr^4); at 309.088 and 297.15 K and emissivity 0.3 as a coefficient 1.896 W/(m^2 K)."""
    flow = _block({"kind": "radiation", "emissivity": 0.3, "area": "0.082241 [m^2]"})
    assert flow == pytest.approx(0.3 * 5.670374419e-8 * 0.082241 * (HOT**4 - COLD**4), rel=1e-12)
    assert flow / (0.082241 * (HOT - COLD)) == pytest.approx(1.896, abs=5e-4)


def test_B1_thermal_mass_and_heat_source() -> None:  # noqa: N802
    """Q = dU/dt = m c dT/dt."""
    deck = {
        "title": "Mass",
        "nodes": {"m": {"mass": "54 [g]", "specific_heat": "480 [J/(kg K)]"}},
        "loads": {"q": {"into": "m", "power": "225 [mW]"}},
    }
    solution = td.simulate(td.model_from_dict(deck), td.Scenario("on", start="24 [degC]", duration="1 [h]"))
    assert solution["m"].rise == pytest.approx(0.225 * 3600 / (0.054 * 480), rel=1e-12)
    assert solution.heat_balance().stored == pytest.approx(0.225 * 3600, rel=1e-12)


def test_B1_temperature_source() -> None:  # noqa: N802
    """Ideal: the heat that it takes changes nothing, neither as a boundary nor as a node that is driven."""
    deck = {
        "title": "Source",
        "needs": ["air"],
        "nodes": {"a": {"capacitance": "10 [J/K]"}, "b": {"capacitance": "10 [J/K]"}},
        "conductors": {
            "g": {"kind": "conduction", "between": ["a", "b"], "conductance": "1 [W/K]"},
            "h": {"kind": "conduction", "between": ["a", "air"], "conductance": "1 [W/K]"},
        },
        "loads": {"q": {"into": "a", "power": "1000 [W]"}},
    }
    given = {"times": ["0 [s]", "100 [s]"], "values": ["20 [degC]", "30 [degC]"]}
    scenario = td.Scenario("driven", boundaries={"air": "20 [degC]"}, prescribed={"a": given}, start="20 [degC]", duration=100.0)
    solution = td.simulate(td.model_from_dict(deck), scenario, options=TIGHTER)
    assert solution["a"].celsius == pytest.approx(20 + solution.times / 10, abs=1e-12)
    lag = 0.1 * 10 * (1 - np.exp(-solution.times / 10))  # of one mass behind a ramp
    assert solution["a"].kelvin - solution["b"].kelvin == pytest.approx(lag, abs=1e-7)
    assert solution["air"].celsius == pytest.approx(20.0, abs=1e-12)


def test_B1_reference_sensor_and_conversion() -> None:  # noqa: N802
    """A sensor reads kelvin or Celsius; a start may refer to a boundary."""
    deck = {
        "title": "Sensor",
        "needs": ["air"],
        "nodes": {"m": {"capacitance": "10 [J/K]"}},
        "conductors": {"g": {"kind": "conduction", "between": ["m", "air"], "conductance": "1 [W/K]"}},
    }
    solution = td.simulate(td.model_from_dict(deck), td.Scenario("still", boundaries={"air": "75.2 [degF]"}, start="air", duration=10.0))
    assert solution["m"].kelvin == pytest.approx(297.15, abs=1e-9)
    assert solution["m"].celsius == pytest.approx(24.0, abs=1e-9)
    assert solution["m"].final == pytest.approx(float(solution["m"].at(10.0)))


@pytest.mark.parametrize(
    ("htc", "length", "conductivity", "printed", "rel"),
    [(6.8, 0.02492, 130, 1.3e-3, 0.04), (2.2, 0.02492, 130, 4.2e-4, 0.012), (6, 0.025, 15, 1.0e-2, 0.005), (6, 0.0008, 0.3, 0.016, 1e-9)],
)
def test_B14_biot_of_cases(htc: float, length: float, conductivity: float, printed: float, rel: float) -> None:  # noqa: N802
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert biot_number(htc, length, conductivity) == pytest.approx(printed, rel=rel)


def test_B14_biot_of_a_fibre_coil_warns() -> None:  # noqa: N802
    with warns_code("physics.not-one-temperature"):
        assert biot_number(5.0, 0.020, 0.25) == pytest.approx(0.4)


def _gyro(coefficient: float, power: float = 2.74) -> td.Model:
    """Return FOG_l of section 3 with P = P0 (1 + a (T - T0)) at T0 = 24 degC."""
    return td.model_from_dict(
        {
            "title": "FOG_l",
            "needs": ["air"],
            "nodes": {"case": {"mass": "0.743 [kg]", "specific_heat": "960 [J/(kg K)]"}},
            "surfaces": {"skin": {"of": "case", "to": "air", "area": "0.0365 [m^2]", "effective_htc": "5 [W/(m^2 K)]"}},
            "loads": {
                "gyro": {
                    "into": "case",
                    "power": f"{power} [W]",
                    "temperature_coefficient": f"{coefficient} [1/K]",
                    "reference_temperature": "24 [degC]",
                }
            },
        }
    )


@pytest.mark.parametrize("a", [-0.01, 0.0, 0.01, 0.05])
def test_B16_power_that_follows_temperature(a: float) -> None:  # noqa: N802
    """Rise P0/(h A - a P0), reached with the time constant m c/(h A - a P0)."""
    bench = td.Scenario("bench", boundaries={"air": "24 [degC]"}, start="24 [degC]", duration="40 [h]")
    conductance, capacity = 5 * 0.0365 - a * 2.74, 0.743 * 960
    assert td.steady(_gyro(a), bench)["case"] - 297.15 == pytest.approx(2.74 / conductance, abs=1e-8)
    solution = td.simulate(_gyro(a), bench, options=TIGHTER)
    exact = 2.74 / conductance * (1 - np.exp(-solution.times * conductance / capacity))
    assert np.abs(solution["case"].kelvin - 297.15 - exact).max() < 1e-6
    assert solution.time_constants == pytest.approx([capacity / conductance], rel=1e-9)


def test_B16_runaway_is_detected() -> None:  # noqa: N802
    """a P0 above h A: no steady state, and a run that says so."""
    bench = td.Scenario("bench", boundaries={"air": "24 [degC]"}, start="24 [degC]", duration="500 [h]")
    with raises_code("run.did-not-finish", SolverError, match=r" \S+ s of \S+ s at 'case': "):
        td.simulate(_gyro(0.1), bench)
    with raises_code("run.no-steady-state", SolverError):
        td.steady(_gyro(0.1), bench)
