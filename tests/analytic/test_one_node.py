"""One node: sensitivities, decays by radiation and by natural convection, an oscillating and a ramped ambient."""

from __future__ import annotations

import math

import numpy as np
import pytest

import thermid as td
from strategies import TIGHT
from thermid.simulation.runs import Engine, Options, Wiring

pytestmark = pytest.mark.analytic
SIGMA = 5.670374419e-8


def _one(link: dict, capacitance: str, loads: dict | None = None) -> td.Model:
    deck = {
        "title": "One",
        "needs": ["air"],
        "nodes": {"mass": {"capacitance": capacitance}},
        "conductors": {"link": {"between": ["mass", "air"], **link}},
    }
    return td.model_from_dict(deck | ({"loads": loads} if loads else {}))


def test_parameter_sensitivities_of_one_node() -> None:
    """The Jacobian test of pycanha-core: k = C = Q = 1, environment one kelvin above the start; T = 2 (1 - exp(-t))."""
    model = _one({"kind": "conduction", "conductance": "1 [W/K]"}, "1 [J/K]", {"heat": {"into": "mass", "power": "1 [W]"}})
    zero = 300.0  # of the published 0 K; the equation is linear
    scenario = td.Scenario("step", boundaries={"air": "301 [K]"}, start=td.quantity(zero, unit="K"), duration=5.0)
    names = ("link.conductance", "mass.capacitance", "heat.power", "air", "initial.mass", "scale.heat")
    wiring = Wiring(td.simulation.compile_network(model), scenario, names)
    engine = Engine(wiring)
    t = np.array([1.0, 2.0, 5.0])
    answer = engine.integrate(
        wiring.assemble(np.array([1.0, 1.0, 1.0, zero + 1.0, zero, 1.0])), t, ("mass",), 5.0, Options(error=4e-10), True
    )
    e = np.exp(-t)
    assert answer.temperatures[:, 0] - zero == pytest.approx((1.2642411, 1.7293294, 1.9865241), abs=5e-8)
    found = answer.sensitivities[:, 0, :]
    assert found[:, 0] == pytest.approx((0.1036383, -0.3233236, -0.9258826), abs=1e-7)
    assert found[:, 1] == pytest.approx((-0.7357589, -0.5413411, -0.0673795), abs=1e-7)
    assert found[:, 2] == pytest.approx(1 - e, abs=1e-7)
    assert found[:, 3] == pytest.approx(1 - e, abs=1e-7)
    assert found[:, 4] == pytest.approx(e, abs=1e-7)
    assert found[:, 5] == pytest.approx(found[:, 2], abs=1e-12)


AREA = math.pi * 0.1**2
SPHERE = {"kind": "radiation", "emissivity": 0.8, "area": f"{AREA!r} [m^2]"}


def test_sphere_radiating_to_nothing() -> None:
    """Bejan's handbook, Eq. 3.283: T = T0 (1 + 3 eps sigma A T0^3 t / mc)^(-1/3), surroundings a thousandth above absolute zero."""
    model = _one(SPHERE, "1272.345 [J/K]")
    scenario = td.Scenario("space", boundaries={"air": "0.001 [K]"}, start="400 [K]", duration=36000.0)
    t = np.array([600.0, 3600.0, 36000.0])
    found = td.simulate(model, scenario, times=t, options=TIGHT)["mass"].kelvin
    assert found == pytest.approx((384.1415, 330.4148, 194.1738), abs=1e-4)
    assert found == pytest.approx(400 * (1 + 3 * 0.8 * SIGMA * AREA * 400**3 * t / 1272.345) ** (-1 / 3), abs=1e-6)


@pytest.mark.parametrize(("seconds", "kelvin"), [(4040.65, 350.0), (15821.98, 310.0)])
def test_sphere_radiating_to_walls(seconds: float, kelvin: float) -> None:
    """400 K to walls at 300 K: t = mc/(4 eps sigma A Tw^3) [ln((x+1)/(x-1)) + 2 atan(x)] between both x = T/Tw."""
    model = _one(SPHERE, "1272.345 [J/K]")
    scenario = td.Scenario("walls", boundaries={"air": "300 [K]"}, start="400 [K]", duration=20000.0)
    place = lambda x: math.log((x + 1) / (x - 1)) + 2 * math.atan(x)  # noqa: E731
    exact = 1272.345 / (4 * 0.8 * SIGMA * AREA * 300**3) * (place(kelvin / 300) - place(400 / 300))
    assert exact == pytest.approx(seconds, abs=0.01)
    assert td.simulate(model, scenario, times=[exact], options=TIGHT)["mass"].kelvin[0] == pytest.approx(kelvin, abs=1e-6)


def test_natural_convection_decay() -> None:
    """Bejan's handbook, Eq. 3.286, h = K dT^0.25: dT = (dT0^-n + n K A t / mc)^(-1/n); the law is smoothed below 0.01 K only."""
    law = {"kind": "convection", "htc": {"coefficient": "2.5251568 [W/(m^2 K)]", "exponent": 0.25}, "area": "0.05 [m^2]"}
    scenario = td.Scenario("still air", boundaries={"air": "300 [K]"}, start="340 [K]", duration=14400.0)
    t = np.array([600.0, 3600.0, 14400.0])
    found = td.simulate(_one(law, "500 [J/K]"), scenario, times=t, options=TIGHT)["mass"].kelvin - 300
    exact = (40**-0.25 + 0.25 * 2.5251568 * 0.05 * t / 500) ** -4
    assert exact == pytest.approx((27.796918, 6.557818, 0.343010), abs=1e-6)
    assert found == pytest.approx(exact, abs=1e-4)
    assert found[:2] == pytest.approx(exact[:2], abs=2e-6)


ACCELEROMETER = {
    "title": "Accelerometer",
    "needs": ["air"],
    "nodes": {"case": {"mass": "0.054 [kg]", "specific_heat": "480 [J/(kg K)]"}},
    "surfaces": {"skin": {"of": "case", "to": "air", "area": "0.00420536 [m^2]", "htc": "6 [W/(m^2 K)]"}},
    "loads": {"electronics": {"into": "case", "power": "0.225 [W]"}},
}


@pytest.mark.parametrize(("hours", "gain", "delay"), [(2.0, 0.744606, 837.495), (24.0, 0.997221, 1025.36)])
def test_gain_and_delay_under_a_sinusoidal_ambient(hours: float, gain: float, delay: float) -> None:
    period = 3600 * hours
    air = {"mean": "24 [degC]", "amplitude": "3 [K]", "period": f"{period} [s]"}
    scenario = td.Scenario("day", boundaries={"air": air}, loads={"electronics": "0 [W]"}, start="24 [degC]", duration=40000 + 2 * period)
    t = np.linspace(40000 + period, 40000 + 2 * period, 721)
    found = td.simulate(td.model_from_dict(ACCELEROMETER), scenario, times=t, options=TIGHT)["case"].celsius - 24
    angle = 2 * np.pi * t / period
    (sine, cosine), *_ = np.linalg.lstsq(np.column_stack((np.sin(angle), np.cos(angle))), found, rcond=None)
    assert math.hypot(sine, cosine) / 3 == pytest.approx(gain, abs=1e-6)
    assert math.atan2(-cosine, sine) * period / (2 * np.pi) == pytest.approx(delay, abs=0.01)


def test_lag_behind_a_chamber_ramp() -> None:
    """3 K/min: the lag settles at the rate times the time constant."""
    air = {"times": ["0 [s]", "20000 [s]"], "values": ["24 [degC]", "1024 [degC]"]}
    scenario = td.Scenario("chamber", boundaries={"air": air}, loads={"electronics": "0 [W]"}, start="24 [degC]", duration=20000.0)
    solution = td.simulate(td.model_from_dict(ACCELEROMETER), scenario, options=TIGHT)
    assert solution["air"].kelvin[-1] - solution["case"].kelvin[-1] == pytest.approx(51.363, abs=5e-4)
    tau = 0.054 * 480 / (6 * 0.00420536)
    assert 51.363 == pytest.approx(0.05 * tau, abs=5e-4)


@pytest.mark.parametrize(("emissivity", "rise"), [(0.3, 26.2736), (0.85, 10.0550)])
def test_radiation_in_vacuum(emissivity: float, rise: float) -> None:
    deck = {**ACCELEROMETER, "surfaces": {"skin": {**ACCELEROMETER["surfaces"]["skin"], "emissivity": emissivity}}}
    air = td.Scenario("bench", boundaries={"air": "24 [degC]"}, start="24 [degC]", duration="60 [h]")
    found = td.steady(td.model_from_dict(deck), air.vacuum())["case"] - 297.15
    assert found == pytest.approx(rise, abs=5e-5)
    late = td.simulate(td.model_from_dict(deck), air.vacuum(), options=TIGHT)["case"]
    assert late.rise == pytest.approx(rise, abs=5e-5)


def test_three_parameters_of_one_node_have_rank_two() -> None:
    """Power, capacitance and conductance act as two ratios; with the power known the errors are 0.561 % and 0.073 %."""
    names = ("electronics.power", "case.mass", "skin.htc")
    x = np.array([0.225, 0.054, 6.0])
    scenario = td.Scenario("bench", boundaries={"air": "24 [degC]"}, start="24 [degC]", duration=18000.0)
    wiring = Wiring(td.simulation.compile_network(td.model_from_dict(ACCELEROMETER)), scenario, names)
    times = np.linspace(0, 18000, 301)
    answer = Engine(wiring).integrate(wiring.assemble(x), times, ("case",), 18000.0, TIGHT, True)
    slopes = answer.sensitivities[:, 0, :] * x
    values = np.linalg.svd(slopes, compute_uv=False)
    assert values[1] / values[0] > 1e-2
    assert values[2] / values[0] < 1e-7
    errors = 0.1 * np.sqrt(np.diag(np.linalg.inv(slopes[:, 1:].T @ slopes[:, 1:])))
    assert 100 * errors == pytest.approx((0.561, 0.073), abs=5e-4)
