"""Section 2.1 of the acceptance sheet: the accelerometer of Fig. 16 as one mass. Rows B2, B3, B17, V1, V2, A7, H1."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from strategies import TIGHTER
from thermid.base.errors import ScenarioError, code_of

pytestmark = pytest.mark.document
EXAMPLE = Path(__file__).parents[2] / "examples" / "01_accelerometer" / "accelerometer.toml"
DATA = Path(__file__).parents[3] / "shared" / "seed" / "data"
BENCH = td.Scenario("bench", boundaries={"air": "24 [degC]"}, start="24 [degC]", duration="5 [h]")
PRINTED = BENCH.vacuum(as_printed=True)


def _accelerometer(**values: Any) -> td.Model:
    model = td.load_model(EXAMPLE)
    return model.with_values(values) if values else model


def _with_emissivity(emissivity: float) -> td.Model:
    """Return the same box with convection and radiation apart; its coefficient of 6 is convection alone then."""
    return td.model_from_dict(
        {
            "title": "Accelerometer",
            "needs": ["air"],
            "nodes": {"case": {"mass": "0.054 [kg]", "specific_heat": "480 [J/(kg K)]"}},
            "surfaces": {"skin": {"of": "case", "to": "air", "area": "0.00420536 [m^2]", "htc": "6 [W/(m^2 K)]", "emissivity": emissivity}},
            "loads": {"electronics": {"into": "case", "power": "0.225 [W]"}},
        }
    )


def test_inputs_of_fig_16() -> None:
    numbers = td.simulation.compile_network(_accelerometer()).numbers()
    assert numbers.values["power"] == 0.225
    assert numbers.values["area"] == 0.00420536
    assert numbers.capacitances["case"] == pytest.approx(25.92, rel=1e-15)
    assert numbers.conductors[0].coefficients[0] == pytest.approx(0.02523216, rel=1e-6)
    assert 1 / numbers.conductors[0].coefficients[0] == pytest.approx(39.63196, rel=1e-6)


def test_steady_rise() -> None:
    assert td.steady(_accelerometer(), BENCH)["case"] - 273.15 == pytest.approx(32.917191, abs=1e-6)
    bare = td.steady(_accelerometer(area="0.001406 + 0.002592 [m^2]"), BENCH)
    assert bare["case"] - 297.15 == pytest.approx(9.379690, abs=1e-6)


def test_time_constant_and_settling_times() -> None:
    solution = td.simulate(_accelerometer(), BENCH, every="5 [s]", options=TIGHTER)
    assert solution.time_constants == pytest.approx([1027.2604], abs=1e-3)
    top = td.steady(_accelerometer(), BENCH)["case"] - 273.15
    rise = top - 24.0
    for below, hours in (
        (0.02 * rise, 1.1163),
        (0.01 * rise, 1.3141),
        (0.001 * rise, 1.9711),
        (0.5, 0.822),
        (0.0625, 1.4155),
        (0.01, 1.938),
    ):
        crossed = solution["case"].crossing(td.celsius(top - below))
        assert crossed is not None
        assert crossed / 3600 == pytest.approx(hours, abs=1e-3)
    assert top - solution["case"].at(4 * 3600.0) == pytest.approx(7.3e-6, abs=0.1e-6)


def test_curve_of_fig_17() -> None:
    """Against the sheet's table where it is at hand, and the closed form always."""
    solution = td.simulate(_accelerometer(), BENCH, every="60 [s]", options=TIGHTER)
    tau = 25.92 / 0.02523216
    exact = 24 + 0.225 / 0.02523216 * (1 - np.exp(-solution.times / tau))
    assert np.abs(solution["case"].celsius - exact).max() < 1e-6
    ramp = td.simulate(_accelerometer(), PRINTED, every="60 [s]", options=TIGHTER)
    assert np.abs(ramp["case"].celsius - (24 + 0.225 / 25.92 * ramp.times)).max() < 1e-6
    if (DATA / "accelerometer_reference.csv").is_file():
        t, warm, vacuum = np.loadtxt(DATA / "accelerometer_reference.csv", delimiter=",", skiprows=1).T
        assert np.array_equal(t, solution.times)
        assert np.abs(solution["case"].celsius - warm).max() < 1e-6
        assert np.abs(ramp["case"].celsius - vacuum).max() < 1e-6


def test_B2_electrical_analogue() -> None:  # noqa: N802
    """A resistor to a voltage V, a capacitor and a current I: v_inf = V + R I, tau = R C, v = v_inf + (v0 - v_inf) exp(-t/tau)."""
    volts, ohms, farads, amperes, start = 310.0, 12.0, 40.0, 0.75, 280.0
    circuit = td.model_from_dict(
        {
            "title": "RC",
            "needs": ["source"],
            "nodes": {"v": {"capacitance": f"{farads} [J/K]"}},
            "conductors": {"r": {"kind": "conduction", "between": ["v", "source"], "resistance": f"{ohms} [K/W]"}},
            "loads": {"i": {"into": "v", "power": f"{amperes} [W]"}},
        }
    )
    scenario = td.Scenario("on", boundaries={"source": f"{volts} [K]"}, start=td.quantity(start, unit="K"), duration=2000.0)
    solution = td.simulate(circuit, scenario, options=TIGHTER)
    final = volts + ohms * amperes
    assert td.steady(circuit, scenario)["v"] == pytest.approx(final, rel=1e-12)
    assert solution.time_constants == pytest.approx([ohms * farads], rel=1e-12)
    assert solution["v"].kelvin == pytest.approx(final + (start - final) * np.exp(-solution.times / (ohms * farads)), abs=1e-7)


@pytest.mark.parametrize("start", [24.0, 15.5, 60.0])
def test_B3_initial_temperature_is_a_parameter(start: float) -> None:  # noqa: N802
    """E1: the third line of Eq. 3 as it must be, T_inf + (T_0 - T_inf) exp(-t/tau); as printed it starts at zero."""
    scenario = BENCH.with_(start=f"{start} [degC]")
    solution = td.simulate(_accelerometer(), scenario, options=TIGHTER)
    assert solution["case"].celsius[0] == start
    final = 24 + 0.225 / 0.02523216
    exact = final + (start - final) * np.exp(-solution.times * 0.02523216 / 25.92)
    assert np.abs(solution["case"].celsius - exact).max() < 1e-6


def test_vacuum_is_refused_for_an_effective_coefficient() -> None:
    with raises_code("model.needs-gas-law", ScenarioError, match="'skin'"):
        td.simulate(_accelerometer(), BENCH.vacuum())


def test_V1_vacuum_ramp_as_printed() -> None:  # noqa: N802
    solution = td.simulate(_accelerometer(), PRINTED, options=TIGHTER)
    case = solution["case"]
    assert np.diff(case.kelvin) / np.diff(solution.times) == pytest.approx(0.225 / 25.92, rel=1e-9)
    assert 0.225 / 25.92 == pytest.approx(8.680556e-3, abs=5e-10)
    assert case.final == pytest.approx(180.25, abs=1e-6)
    assert any("upper bound" in w for w in solution.warnings)
    assert any(code_of(w) == "model.no-path-to-boundary" and "'case'" in w and "31.25 K/h" in w for w in solution.warnings)
    assert solution.time_constants[0] == math.inf


def test_B17_crossing_of_limits_in_vacuum() -> None:  # noqa: N802
    case = td.simulate(_accelerometer(), PRINTED)["case"]
    assert [case.crossing(td.celsius(limit)) / 3600 for limit in (96.0, 125.0)] == pytest.approx([2.304, 3.232], abs=1e-6)  # type: ignore[operator]
    assert case.crossing(td.celsius(200.0)) is None


@pytest.mark.parametrize(("htc", "short"), [(1e-3, 0.228), (1e-6, 0.000228), (1e-9, 2.3e-7)])
def test_V1_small_coefficients_in_place_of_zero(htc: float, short: float) -> None:  # noqa: N802
    model = _accelerometer(**{"skin.effective_htc": {"value": f"{htc} [W/(m^2 K)]", "min": 0}})
    final = td.simulate(model, BENCH, options=td.Options(error=4e-12))["case"].final
    exact = 24 + 0.225 / (htc * 0.00420536) * -math.expm1(-18000 * htc * 0.00420536 / 25.92)
    assert final == pytest.approx(exact, abs=1e-9)
    assert 180.25 - final == pytest.approx(short, rel=0.01)


def test_V1_exact_zero_is_allowed() -> None:  # noqa: N802
    model = _accelerometer(**{"skin.effective_htc": {"value": "0 [W/(m^2 K)]", "min": 0}})
    assert td.simulate(model, BENCH)["case"].final == pytest.approx(180.25, abs=1e-9)


@pytest.mark.parametrize(("emissivity", "celsius"), [(0.1, 89.2), (0.3, 50.27), (0.85, 34.1)])
def test_V2_radiation_bounds_the_ramp(emissivity: float, celsius: float) -> None:  # noqa: N802
    """The ramp is an upper bound: with radiation alone the box settles; the sheet prints one or two decimals."""
    decimals = len(f"{celsius}".partition(".")[2])
    assert td.steady(_with_emissivity(emissivity), BENCH.vacuum())["case"] - 273.15 == pytest.approx(
        celsius, abs=0.5 * 10**-decimals + 1e-9
    )


def test_A7_ambient_step_shifts_steady_values() -> None:  # noqa: N802
    warm = td.steady(_accelerometer(), BENCH.with_(boundaries={"air": "34 [degC]"}))
    assert warm["case"] - td.steady(_accelerometer(), BENCH)["case"] == pytest.approx(10.0, abs=1e-10)


def test_H1_humidity_does_not_enter_the_classical_equations() -> None:  # noqa: N802
    runs = [
        td.simulate(_accelerometer(), BENCH.with_(environment={"air": td.simulation.Environment(humidity=h)})).temperatures
        for h in (0.1, 0.9)
    ]
    assert np.array_equal(*runs)
