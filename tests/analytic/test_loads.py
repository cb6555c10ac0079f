"""Loads with a closed form: thermostat, proportional heater, power that follows temperature, periodic power."""

from __future__ import annotations

import math

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from strategies import TIGHT
from thermid.base.errors import SolverError

pytestmark = pytest.mark.analytic
G, C, AIR = 0.5, 200.0, 290.0
TAU = C / G


def _box(load: dict, **more: object) -> td.Model:
    return td.model_from_dict(
        {
            "title": "Box",
            "needs": ["air"],
            "nodes": {"n": {"capacitance": f"{C} [J/K]"}},
            "conductors": {"g": {"kind": "conduction", "between": ["n", "air"], "conductance": f"{G} [W/K]"}},
            "loads": {"q": {"into": "n", **load}},
            **more,
        }
    )


def _air(duration: float, start: str = "290 [K]") -> td.Scenario:
    return td.Scenario("air", boundaries={"air": f"{AIR} [K]"}, start=start, duration=duration)


def test_thermostat_duty() -> None:
    """On for tau ln((P/G + Ta - T_on)/(P/G + Ta - T_off)), off for tau ln((T_off - Ta)/(T_on - Ta))."""
    power, low, high = 20.0, 300.0, 303.0
    model = _box({"power": f"{power} [W]", "thermostat": {"on_below": f"{low} [K]", "off_above": f"{high} [K]"}})
    solution = td.simulate(model, _air(8000.0), times=np.linspace(0, 8000, 9), options=TIGHT)
    on = TAU * math.log((power / G + AIR - low) / (power / G + AIR - high))
    off = TAU * math.log((high - AIR) / (low - AIR))
    first = TAU * math.log((power / G) / (power / G + AIR - high))
    switchings = [t for t, _ in solution.statistics["switchings"]]
    assert switchings[0] == pytest.approx(first, abs=1e-5)
    assert np.diff(switchings)[:20:2] == pytest.approx(off, abs=1e-5)
    assert np.diff(switchings)[1:20:2] == pytest.approx(on, abs=1e-5)
    # the powers of a solution know the state between the samples, however far apart these are
    expected = [power if sum(s < t for s in switchings) % 2 == 0 else 0.0 for t in solution.times]
    assert solution.load_powers["q"].tolist() == expected
    # between two switchings off, whole cycles: the mean power is the duty's
    one, other = switchings[0], switchings[20]
    times = np.linspace(one, other, 200001)
    mean = np.mean(td.simulate(model, _air(8000.0), times=times, options=TIGHT).load_powers["q"])
    assert mean == pytest.approx(power * on / (on + off), rel=1e-3)
    assert solution.heat_balance().relative < 1e-9
    with raises_code("run.no-steady-state", SolverError):
        td.steady(model, _air(8000.0))


@pytest.mark.parametrize(("setpoint", "expected"), [(310.0, (G * AIR + 2.0 * 310.0) / (G + 2.0)), (280.0, AIR), (400.0, AIR + 30.0 / G)])
def test_proportional_heater(setpoint: float, expected: float) -> None:
    """Inside its band the balance of both conductances, below it nothing, above it full power."""
    model = _box({"power": "30 [W]", "proportional": {"gain": "2 [W/K]", "setpoint": f"{setpoint} [K]"}})
    assert td.steady(model, _air(1.0))["n"] == pytest.approx(expected, abs=1e-8)
    solution = td.simulate(model, _air(20000.0), options=TIGHT)
    assert solution["n"].kelvin[-1] == pytest.approx(expected, abs=1e-6)
    assert solution.load_powers["q"][-1] == pytest.approx(G * (expected - AIR), abs=1e-5)


def test_linear_power_of_temperature() -> None:
    """P0 (1 + a (T - T0)): steady at Ta + P0 (1 + a (Ta - T0))/(G - a P0), with the time constant C/(G - a P0)."""
    power, a, zero = 10.0, 0.02, 300.0
    model = _box({"power": f"{power} [W]", "temperature_coefficient": f"{a} [1/K]", "reference_temperature": f"{zero} [K]"})
    steady = AIR + power * (1 + a * (AIR - zero)) / (G - a * power)
    assert td.steady(model, _air(1.0))["n"] == pytest.approx(steady, abs=1e-9)
    t = np.linspace(0, 3000, 31)
    solution = td.simulate(model, _air(3000.0), times=t, options=TIGHT)
    tau = C / (G - a * power)
    assert solution["n"].kelvin == pytest.approx(steady + (AIR - steady) * np.exp(-t / tau), abs=1e-6)
    assert solution.time_constants == pytest.approx([tau], rel=1e-9)


def test_quadratic_power_of_temperature() -> None:
    """The lower root of c + b x + a x^2 = 0 for x = T - T0 is stable."""
    power, a, b, zero = 5.0, 0.01, 2e-4, 300.0
    model = _box(
        {
            "power": f"{power} [W]",
            "temperature_coefficient": f"{a} [1/K]",
            "quadratic_coefficient": f"{b} [1/K^2]",
            "reference_temperature": f"{zero} [K]",
        }
    )
    p, q, r = power * b, power * a - G, power + G * (AIR - zero)
    root = (-q - math.sqrt(q * q - 4 * p * r)) / (2 * p)
    assert td.steady(model, _air(1.0))["n"] == pytest.approx(zero + root, abs=1e-8)
    assert td.simulate(model, _air(20000.0), options=TIGHT)["n"].kelvin[-1] == pytest.approx(zero + root, abs=1e-6)


RUNAWAYS = {
    "linear": {"power": "30 [W]", "temperature_coefficient": "0.02 [1/K]", "reference_temperature": "290 [K]"},
    "quadratic": {
        "power": "30 [W]",
        "temperature_coefficient": "0.01 [1/K]",
        "quadratic_coefficient": "1e-3 [1/K^2]",
        "reference_temperature": "290 [K]",
    },
    "exponential": {"power": "30 [W]", "exponential_coefficient": "0.03 [1/K]", "reference_temperature": "290 [K]"},
}


@pytest.mark.parametrize("kind", RUNAWAYS)
def test_runaway_is_detected_and_named(kind: str) -> None:
    """Power that grows faster with temperature than the heat can leave: an error in words, not a number."""
    model = _box(RUNAWAYS[kind])
    with raises_code("run.did-not-finish", SolverError, match=r" \S+ s of \S+ s at 'n': "):
        td.simulate(model, _air(1e6))
    with raises_code("run.no-steady-state", SolverError):
        td.steady(model, _air(1e6))


def test_linear_runaway_until_it_is_one() -> None:
    """Before the end is reached the growth is the closed form's: x' = (a P0 - G) x / C + P0 / C."""
    model = _box(RUNAWAYS["linear"])
    t = np.linspace(0, 3000, 7)
    rate = (0.02 * 30 - G) / C
    exact = AIR + 30 / C / rate * (np.exp(rate * t) - 1)
    assert td.simulate(model, _air(3000.0), times=t, options=TIGHT)["n"].kelvin == pytest.approx(exact, rel=1e-8)


def test_exponential_power_of_temperature() -> None:
    """P0 exp(a (T - T0)): the stable branch of Lambert's function, x = -W(-a P0/G exp(a (Ta - T0)))/a above the air."""
    from scipy.special import lambertw

    power, a, zero = 5.0, 0.02, 300.0
    model = _box({"power": f"{power} [W]", "exponential_coefficient": f"{a} [1/K]", "reference_temperature": f"{zero} [K]"})
    rise = -lambertw(-a * power / G * math.exp(a * (AIR - zero))).real / a
    assert td.steady(model, _air(1.0))["n"] == pytest.approx(AIR + rise, abs=1e-8)


def test_periodic_load() -> None:
    """On first, for 30 % of 500 s: late, T swings between two closed forms about the mean Ta + duty P/G."""
    power, period, duty = 12.0, 500.0, 0.3
    model = _box({"power": f"{power} [W]", "periodic": {"period": f"{period} [s]", "duty": duty}})
    end = 30 * period
    times = np.concatenate((np.linspace(28 * period, 29 * period, 2001), [end]))
    solution = td.simulate(model, _air(end), times=times, options=TIGHT)
    x, y = math.exp(-duty * period / TAU), math.exp(-(1 - duty) * period / TAU)
    top = power / G * (1 - x) / (1 - x * y)
    found = solution["n"].kelvin - AIR
    assert found[0] == pytest.approx(top * y, abs=1e-6)
    assert found[:-1].max() == pytest.approx(top, abs=1e-6)
    assert np.trapezoid(found[:-1], times[:-1]) / period == pytest.approx(duty * power / G, abs=1e-3)
    assert solution.heat_balance().loads == pytest.approx(30 * duty * power * period, rel=1e-12)


def test_sinusoidal_load() -> None:
    """A sine on top of a power: gain and delay of one node, in watts over G."""
    model = _box({"power": "5 [W]", "sine": {"amplitude": "3 [W]", "period": "1000 [s]"}})
    t = np.linspace(9000, 10000, 501)
    found = td.simulate(model, _air(10000.0), times=t, options=TIGHT)["n"].kelvin - AIR
    w = 2 * np.pi / 1000
    exact = 10 + 6 / math.hypot(1, w * TAU) * np.sin(w * t - math.atan(w * TAU)) + _decay(w) * np.exp(-t / TAU)
    assert found == pytest.approx(exact, abs=1e-6)


def _decay(w: float) -> float:
    """Return what the start leaves behind: the node starts at the temperature of the air."""
    return -(10 + 6 / math.hypot(1, w * TAU) * math.sin(-math.atan(w * TAU)))


def test_command_and_schedule_scale_a_load_and_a_coefficient() -> None:
    """A command halves the power at 1000 s, a schedule doubles the conductance at 2000 s: three exponentials in a row."""
    model = _box({"power": "10 [W]"})
    scenario = _air(3000.0).with_(
        commands={"q": {"times": ["0 [s]", "1000 [s]"], "values": [1.0, 0.5], "hold": True}},
        schedule={"g.conductance": {"times": ["0 [s]", "2000 [s]"], "values": ["0.5 [W/K]", "1 [W/K]"], "hold": True}},
    )
    found = td.simulate(model, scenario, times=[1000.0, 2000.0, 3000.0], options=TIGHT)["n"].kelvin - AIR
    first = 20 * (1 - math.exp(-1000 / TAU))
    second = 10 + (first - 10) * math.exp(-1000 / TAU)
    third = 5 + (second - 5) * math.exp(-1000 * 1.0 / C)
    assert found == pytest.approx((first, second, third), abs=1e-6)


def test_command_curve() -> None:
    """P (s + k s (s - 1)) at a command of one half: 10 (0.5 - 0.25 * 0.2) W."""
    model = _box({"power": "10 [W]", "command_curve": 0.2})
    scenario = _air(20000.0).with_(commands={"q": 0.5})
    assert td.simulate(model, scenario, options=TIGHT)["n"].kelvin[-1] - AIR == pytest.approx(10 * (0.5 - 0.05) / G, abs=1e-6)


def test_tabulated_power() -> None:
    """Where the table's point and the balance meet: 10 W at 310 K through 0.5 W/K from 290 K."""
    points = [["280 [K]", "14 [W]"], ["310 [K]", "10 [W]"], ["350 [K]", "2 [W]"]]
    model = _box({"table": {"points": points}})
    assert td.steady(model, _air(1.0))["n"] == pytest.approx(310.0, abs=1e-8)
