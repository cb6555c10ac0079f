"""Conductivity, specific heat and enthalpy over temperature: heat is conducted and stored exactly."""

from __future__ import annotations

import re
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp

import thermid as td
from by_code import raises_code
from thermid.base.errors import DeckError, ScenarioError, SolverError
from thermid.base.units import STEFAN_BOLTZMANN
from thermid.model._laws.stores import HeatStore, curve, store
from thermid.model._tree.identity import to_dict

HEAT = [["0 [degC]", "400 [J/(kg K)]"], ["100 [degC]", "500 [J/(kg K)]"], ["300 [degC]", "800 [J/(kg K)]"]]
SHAPE = curve("temperature", [(273.15, 400.0), (373.15, 500.0), (573.15, 800.0)])
K = [["0 [degC]", "400 [W/(m K)]"], ["50 [degC]", "300 [W/(m K)]"], ["200 [degC]", "120 [W/(m K)]"]]
BAR = curve("temperature", [(273.15, 400.0), (323.15, 300.0), (473.15, 120.0)])


def block(node: dict[str, Any], power: str = "60 [W]", **skin: Any) -> td.Model:
    surface = {"of": "body", "to": "air", "area": "0.05 [m^2]", "htc": "8 [W/(m^2 K)]", "emissivity": 0.5} | skin
    return td.model_from_dict(
        {
            "title": "block",
            "needs": ["air"],
            "nodes": {"body": {"mass": "0.5 [kg]"} | node},
            "surfaces": {"skin": surface},
            "loads": {"heat": {"into": "body", "power": power}},
        }
    )


def bench(**more: Any) -> td.Scenario:
    return td.Scenario("bench", **({"boundaries": {"air": "20 [degC]"}, "duration": "2 [h]"} | more))


def bar(cells: int, kind: dict[str, Any] | None = None) -> td.Model:
    names = ["hot", *(f"x{k}" for k in range(1, cells)), "cold"]
    law = kind or {"kind": "conduction", "conductivity": {"points": K}, "area": "2 [cm^2]", "thickness": f"{0.1 / cells!r} [m]"}
    links = {f"c{k}": law | {"between": [a, b]} for k, (a, b) in enumerate(pairwise(names))}
    inner = {n: {"capacitance": "20 [J/K]"} for n in names[1:-1]}
    return td.model_from_dict(
        {"title": "bar", "needs": ["hot", "cold"], "nodes": inner or {"x": {"capacitance": "1 [J/K]"}}, "conductors": links}
    )


ENDS = td.Scenario("ends", boundaries={"hot": "180 [degC]", "cold": "10 [degC]"}, start="cold", duration="10 [min]")


# conductivity --------------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("cells", [2, 3, 7])
def test_heat_through_a_bar_is_the_integral_of_its_conductivity(cells: int) -> None:
    """Kirchhoff's transform: q L / A is the integral of k from end to end, however the bar is cut."""
    model = bar(cells)
    exact = 2e-4 / 0.1 * quad(lambda t: float(BAR.evaluate(np.array([t]))[0]), 283.15, 453.15, epsabs=1e-10, points=[323.15])[0]
    run = td.simulate(model, ENDS.with_(start="steady"))
    flows = [float(q[-1]) for q in run.heat_flows.values()]
    assert flows == pytest.approx([exact] * cells, rel=1e-8)


def test_a_constant_table_is_a_constant() -> None:
    flat = {"kind": "conduction", "conductivity": {"points": [["0 [degC]", "200 [W/(m K)]"], ["90 [degC]", "200 [W/(m K)]"]]}}
    plain = {"kind": "conduction", "conductivity": "200 [W/(m K)]"}
    runs = [
        td.simulate(bar(4, k | {"area": "2 [cm^2]", "thickness": "25 [mm]"}), ENDS, options=td.Options(error=4e-7))["x2"].kelvin
        for k in (flat, plain)
    ]
    assert np.abs(runs[0] - runs[1]).max() < 1e-5


def test_balance_and_derivatives_of_a_bar() -> None:
    model = bar(5)
    run = td.prepare(model, ENDS, ["c2.area"]).run(sensitivities=True)
    assert run.heat_balance().relative < 1e-6
    up, down = (td.simulate(model.with_values({"c2.area": f"{2 * s!r} [cm^2]"}), ENDS)["x2"].kelvin for s in (1.001, 0.999))
    assert np.abs(run.sensitivity("x2", "c2.area") - (up - down) / 4e-7).max() < 1e-3 * np.abs(up - down).max() / 4e-7


def test_heat_flow_of_equal_ends_is_zero() -> None:
    run = td.simulate(bar(2), ENDS.with_(boundaries={"hot": "10 [degC]"}))
    assert np.abs(run.heat_flow("c0")).max() < 1e-12


def test_a_bar_of_many_cells_runs_as_a_large_network() -> None:
    run = td.simulate(bar(8), ENDS, options=td.Options(error=9e-4, method="large"))
    assert np.abs(run["x4"].kelvin - td.simulate(bar(8), ENDS)["x4"].kelvin).max() < 5e-3


# specific heat -------------------------------------------------------------------------------------------------------------------


def test_a_block_against_an_integrator_of_its_own() -> None:
    run = td.simulate(block({"specific_heat": {"points": HEAT}}), bench())

    def rate(_: float, t: np.ndarray) -> np.ndarray:
        out = 0.4 * (t - 293.15) + 0.025 * STEFAN_BOLTZMANN * (t**4 - 293.15**4)
        return (60.0 - out) / (0.5 * SHAPE.evaluate(t))

    exact = solve_ivp(rate, (0.0, 7200.0), [293.15], rtol=1e-11, atol=1e-10, method="DOP853", t_eval=run.times)
    assert np.abs(run["body"].kelvin - exact.y[0]).max() < 5e-5
    balance = run.heat_balance()
    assert balance.relative < 1e-8
    stored = 0.5 * quad(lambda t: float(SHAPE.evaluate(np.array([t]))[0]), 293.15, run["body"].kelvin[-1], points=[373.15], epsrel=1e-12)[0]
    assert balance.stored == pytest.approx(stored, rel=1e-8)


def test_adiabatic_heating_is_the_closed_form() -> None:
    """c = a + b T: the enthalpy is a parabola, and P t = m (a T + b T^2 / 2) can be solved for T."""
    line = {"specific_heat": {"points": [[f"{t} [K]", f"{2.0 * t} [J/(kg K)]", "2 [J/(kg K^2)]"] for t in (250.0, 700.0)]}}
    run = td.simulate(block(line, htc="0 [W/(m^2 K)]", emissivity=0), bench(start="20 [degC]", duration="30 [min]"))
    exact = np.sqrt(293.15**2 + 60.0 * run.times / 0.5)
    assert np.abs(run["body"].kelvin - exact).max() < 5e-5


def test_a_constant_table_of_specific_heat_is_a_constant() -> None:
    flat = {"specific_heat": {"points": [["0 [degC]", "450 [J/(kg K)]"], ["90 [degC]", "450 [J/(kg K)]"]]}}
    runs = [td.simulate(block(n), bench())["body"].kelvin for n in (flat, {"specific_heat": "450 [J/(kg K)]"})]
    assert np.abs(runs[0] - runs[1]).max() < 5e-5


def test_sensitivities_and_time_constant_of_a_block() -> None:
    model, half = block({"specific_heat": {"points": HEAT}}), bench(duration="10 [min]")
    run = td.prepare(model, half, ["body.mass", "skin.htc", "initial.body"]).run(sensitivities=True)
    steps = {"body.mass": (0.5, "kg", 5e-4), "skin.htc": (8.0, "W/(m^2 K)", 8e-3)}
    for name, (value, unit, step) in steps.items():
        up, down = (td.simulate(model.with_values({name: f"{value + s!r} [{unit}]"}), half)["body"].kelvin for s in (step, -step))
        slope = (up - down) / (2 * step)
        assert np.abs(run.sensitivity("body", name) - slope).max() < 2e-4 * np.abs(slope).max()
    up, down = (td.simulate(model, half.with_(initial={"body": td.celsius(20.0 + s)}))["body"].kelvin for s in (0.1, -0.1))
    assert np.abs(run.sensitivity("body", "initial.body") - (up - down) / 0.2).max() < 1e-3
    hot = float(run["body"].kelvin[-1])
    conductance = 0.05 * 8.0 + 0.025 * 4 * STEFAN_BOLTZMANN * hot**3
    assert run.time_constants[0] == pytest.approx(0.5 * float(SHAPE.evaluate(np.array([hot]))[0]) / conductance, rel=1e-4)


def test_steady_start_and_members_of_an_ensemble() -> None:
    model = block({"specific_heat": {"points": HEAT}})
    rest = td.steady(model, bench())["body"]
    assert rest == pytest.approx(td.steady(block({"specific_heat": "450 [J/(kg K)]"}), bench())["body"], abs=1e-8)
    assert np.ptp(td.simulate(model, bench(start="steady"))["body"].kelvin) < 1e-6
    many = td.ensemble(model, bench(), {"skin.htc": [7.0, 8.0, 9.0], "initial.body": td.quantity([293.15, 300.0, 310.0], unit="K")})
    alone = td.simulate(model, bench(initial={"body": "300 [K]"}))["body"].kelvin
    assert np.abs(many.temperatures("body")[:, 1] - alone).max() < 5e-5


# enthalpy ------------------------------------------------------------------------------------------------------------------------

WAX = {
    "enthalpy": {
        "points": [["0 [degC]", "0 [kJ/kg]"], ["27 [degC]", "54 [kJ/kg]"], ["29 [degC]", "244 [kJ/kg]"], ["80 [degC]", "346 [kJ/kg]"]]
    }
}


def test_melting_takes_the_latent_heat() -> None:
    """Half a kilogram of wax at 20 degC under 50 W without losses: 102 J/g to 29 degC and 190 J/g of them at the melt."""
    run = td.simulate(block(WAX, "50 [W]", htc="0 [W/(m^2 K)]", emissivity=0), bench(start="0 [degC]", duration="2 [h]"), every=10.0)
    reached = {t: float(np.interp(t, run["body"].celsius, run.times)) for t in (27.0, 29.0, 80.0)}
    assert reached[27.0] == pytest.approx(0.5 * 54e3 / 50.0, abs=0.2)
    assert reached[29.0] == pytest.approx(0.5 * 244e3 / 50.0, abs=0.2)
    assert reached[80.0] == pytest.approx(0.5 * 346e3 / 50.0, abs=0.2)
    assert run.heat_balance().relative < 1e-6


def test_freezing_gives_it_back() -> None:
    warm = bench(start="60 [degC]", boundaries={"air": "10 [degC]"}, duration="20 [h]")
    run = td.simulate(block(WAX, "0 [W]"), warm)
    assert run["body"].final == pytest.approx(10.0, abs=0.05)
    assert run.heat_balance().relative < 1e-6


# tables ----------------------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["specific_heat", "enthalpy"])
def test_levels_are_inverse_to_temperatures(name: str) -> None:
    given = SHAPE if name == "specific_heat" else curve("temperature", [(273.15, 0.0), (300.0, 5.4e4), (302.0, 2.4e5), (350.0, 3.5e5)])
    held: HeatStore = store(name, given)
    at = np.linspace(200.0, 700.0, 1001)
    assert np.abs(held.curve.evaluate(held.level(at)) - at).max() < 1e-8


def test_a_run_beyond_its_table_says_so() -> None:
    run = td.simulate(block({"specific_heat": {"points": HEAT[:2]}}, "90 [W]"), bench())
    assert any(re.search(r"'body' .* 273\.15 to 373\.15 K", w) for w in run.warnings)
    run = td.simulate(bar(2), ENDS.with_(boundaries={"hot": "250 [degC]"}))
    assert any(re.search(r"^'c0' .* 273\.15 to 473\.15 K", w) for w in run.warnings)


def test_decks_are_written_back() -> None:
    for model in (block({"specific_heat": {"points": HEAT}}), block(WAX), bar(3)):
        assert td.model_from_dict(to_dict(model)).identity() == model.identity()


@pytest.mark.parametrize(
    ("node", "code", "match"),
    [
        (
            {"specific_heat": {"points": [["0 [degC]", "400 [J/(kg K)]"], ["9 [degC]", "0 [J/(kg K)]"]]}},
            "model.law-refused",
            r"specific_heat.*0.*282\.15",
        ),
        (
            {"enthalpy": {"points": [["0 [degC]", "4 [J/kg]"], ["9 [degC]", "3 [J/kg]"]]}},
            "model.law-refused",
            r"273\.15.*282\.15",
        ),
        (
            {"specific_heat": {"points": HEAT}, **WAX},
            "value.excludes-another",
            r"nodes\.body",
        ),
        (
            {"specific_heat": {"points": [["0 [degC]", "400 [J/K]"], ["9 [degC]", "3 [J/K]"]]}},
            "unit.wrong-dimension",
            r"nodes\.body\.specific_heat.*'\[J/K\]'.*\[J/\(kg K\)\]",
        ),
        (
            {"specific_heat": {"points": [["-400 [degC]", "4 [J/(kg K)]"], ["9 [degC]", "3 [J/(kg K)]"]]}},
            "value.outside-range",
            r"nodes\.body\.specific_heat",
        ),
    ],
)
def test_tables_that_cannot_be(node: dict[str, Any], code: str, match: str) -> None:
    with raises_code(code, (DeckError, td.ThermidError), match=match):
        block(node)


def test_specific_heats_many_decades_apart_are_refused() -> None:
    """Two points of one enthalpy, once the pieces are divided, were an error of the kernel."""
    node = {"mass": "80 [g]", "specific_heat": {"points": [["0 [degC]", "5e-12 [J/(kg K)]"], ["80 [degC]", "900 [J/(kg K)]"]]}}
    links = {"strap": {"kind": "conduction", "between": ["body", "air"], "conductance": "1 [W/K]"}}
    model = td.model_from_dict({"title": "lump", "needs": ["air"], "nodes": {"body": node}, "conductors": links})
    with raises_code("model.law-refused", DeckError):
        td.simulate(model, td.Scenario("bench", boundaries={"air": "20 [degC]"}, start="30 [degC]", duration=60.0))


def test_what_cannot_take_such_a_model_says_so() -> None:
    model = block({"specific_heat": {"points": HEAT}}, emissivity=0)
    with raises_code("model.element-not-supported", ScenarioError):
        td.simulate(model, bench(), options=td.Options(method="modal"))
    link = {"kind": "conduction", "between": ["body", "air"], "conductance": "1 [W/K]"}
    node = {"mass": "1 [kg]", "specific_heat": {"points": HEAT}}
    linked = td.model_from_dict({"title": "block", "needs": ["air"], "nodes": {"body": node}, "conductors": {"c": link}})
    with raises_code("model.element-not-supported", SolverError, match="'body'"):
        td.simulation.state_space(td.simulation.compile_network(linked))
    with raises_code("output.not-expressible", DeckError, match="'body'"):
        td.interop.to_octave(block({"specific_heat": {"points": HEAT}}, emissivity=0), bench())
    with raises_code("value.without-effect", DeckError):
        bar(2, {"kind": "contact", "conductivity": {"points": K}, "area": "2 [cm^2]"})
