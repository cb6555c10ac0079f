"""Laws between boundaries and at one unknown node: NAFEMS T2, radiation, tables, one-way flow links and heat exchangers."""

from __future__ import annotations

import numpy as np
import pytest

import thermid as td
from strategies import TIGHT

pytestmark = pytest.mark.analytic
SIGMA = 5.670374419e-8


@pytest.mark.parametrize(("conductivity", "published"), [(55.6, 927.008), (55.563, 926.971)])
@pytest.mark.parametrize("massless", [True, False])
def test_nafems_t2(conductivity: float, published: float, massless: bool) -> None:
    """A bar of 0.1 m from 1000 K radiating into 300 K at emissivity 0.98; NAFEMS prints 927.0 K, with 5.67e-8 for Stefan's constant."""
    emissivity = 0.98 * 5.67e-8 / SIGMA
    model = td.model_from_dict(
        {
            "title": "T2",
            "needs": ["hot", "room"],
            "nodes": {"tip": {} if massless else {"capacitance": "100 [J/K]"}},
            "conductors": {
                "bar": {
                    "kind": "conduction",
                    "between": ["hot", "tip"],
                    "conductivity": f"{conductivity} [W/(m K)]",
                    "area": "1 [m^2]",
                    "thickness": "0.1 [m]",
                },
                "sky": {"kind": "radiation", "between": ["tip", "room"], "emissivity": emissivity, "area": "1 [m^2]"},
            },
        }
    )
    scenario = td.Scenario("T2", boundaries={"hot": "1000 [K]", "room": "300 [K]"}, start="300 [K]", duration=100.0)
    assert td.steady(model, scenario)["tip"] == pytest.approx(published, abs=1e-3)
    assert td.simulate(model, scenario, options=TIGHT)["tip"].kelvin[-1] == pytest.approx(published, abs=1e-3)
    assert published == pytest.approx(927.0, abs=0.05)


def _between(links: dict, **more: object) -> td.Model:
    """Return conductors between two boundaries, with a bystander, since a model has at least one unknown."""
    return td.model_from_dict(
        {"title": "Links", "needs": ["a", "b"], "nodes": {"by": {"capacitance": "1 [J/K]"}}, "conductors": links, **more}
    )


def test_radiation_between_boundaries() -> None:
    """The test of ModelingToolkit's thermal library: 0.04 m^2 between 1000 K and 10 K carries 2268.1 W."""
    model = _between({"rad": {"kind": "radiation", "between": ["a", "b"], "exchange_factor": 1, "area": "0.04 [m^2]"}})
    solution = td.simulate(model, td.Scenario("x", boundaries={"a": "1000 [K]", "b": "10 [K]"}, start="300 [K]", duration=1.0))
    assert solution.heat_flow("rad") == pytest.approx(2268.1, abs=0.05)
    assert solution.heat_flow("rad") == pytest.approx(SIGMA * 0.04 * (1000**4 - 10**4), rel=1e-12)


def test_sign_of_heat_flow() -> None:
    model = _between(
        {
            "out": {"kind": "conduction", "between": ["a", "b"], "conductance": "2 [W/K]"},
            "back": {"kind": "conduction", "between": ["b", "a"], "conductance": "2 [W/K]"},
        }
    )
    solution = td.simulate(model, td.Scenario("x", boundaries={"a": "310 [K]", "b": "300 [K]"}, start="300 [K]", duration=1.0))
    assert solution.heat_flow("out") == pytest.approx(20.0, rel=1e-12)
    assert solution.heat_flow("back") == pytest.approx(-20.0, rel=1e-12)


def _tabled(over: str, points: list[list[str]], power: float) -> td.Model:
    return td.model_from_dict(
        {
            "title": "Table",
            "needs": ["air"],
            "nodes": {"n": {"capacitance": "10 [J/K]"}},
            "conductors": {"g": {"kind": "table", "between": ["n", "air"], "table": {"over": over, "points": points}, "scale": 2}},
            "loads": {"q": {"into": "n", "power": f"{power} [W]"}},
        }
    )


def test_table_over_a_difference() -> None:
    """At a point of the table the conductance is the point's: 2 * 0.5 W/K at 40 K needs 40 W. Beyond the ends it is constant."""
    points = [["0 [K]", "0.2 [W/K]"], ["40 [K]", "0.5 [W/K]"], ["60 [K]", "0.8 [W/K]"]]
    air = td.Scenario("x", boundaries={"air": "300 [K]"}, start="300 [K]", duration=5000.0)
    assert td.steady(_tabled("difference", points, 40.0), air)["n"] == pytest.approx(340.0, abs=1e-8)
    assert td.steady(_tabled("difference", points, 1.6 * 100), air)["n"] == pytest.approx(400.0, abs=1e-8)
    assert td.steady(_tabled("difference", points, -0.4 * 10), air)["n"] == pytest.approx(290.0, abs=1e-8)
    assert td.simulate(_tabled("difference", points, 40.0), air, options=TIGHT)["n"].kelvin[-1] == pytest.approx(340.0, abs=1e-6)


def test_table_over_the_mean_temperature() -> None:
    """Both ends at 300 and 360 K have the mean 330 K, where the table says 0.5 W/K; the scale doubles it."""
    points = [["300 [K]", "0.2 [W/K]"], ["330 [K]", "0.5 [W/K]"], ["400 [K]", "0.6 [W/K]"]]
    air = td.Scenario("x", boundaries={"air": "300 [K]"}, start="300 [K]", duration=5000.0)
    assert td.steady(_tabled("temperature", points, 2 * 0.5 * 60), air)["n"] == pytest.approx(360.0, abs=1e-8)


def test_flat_table_is_a_constant_conductance() -> None:
    points = [["0 [K]", "0.25 [W/K]"], ["50 [K]", "0.25 [W/K]"]]
    air = td.Scenario("x", boundaries={"air": "300 [K]"}, start="300 [K]", duration=60.0)
    t = np.linspace(0, 60, 13)
    found = td.simulate(_tabled("difference", points, 10.0), air, times=t, options=TIGHT)["n"].kelvin
    assert found == pytest.approx(300 + 20 * (1 - np.exp(-t * 0.5 / 10)), abs=1e-6)


def _flow(a: str, b: str) -> dict[str, object]:
    return {"kind": "flow", "between": [a, b], "mass_flow": "0.002 [kg/s]", "specific_heat": "1000 [J/(kg K)]"}


@pytest.mark.parametrize("massless", [True, False])
def test_stream_past_a_wall(massless: bool) -> None:
    """N well-mixed cells of one stream at a wall: T_out = T_w + (T_in - T_w) (1 + NTU/N)^-N."""
    cells, ua, heat = 6, 1.5, 2.0
    names = [f"c{k}" for k in range(cells)]
    links: dict[str, object] = {f"f{k}": _flow(a, b) for k, (a, b) in enumerate(zip(["inlet", *names], names, strict=False))}
    links |= {f"w{k}": {"kind": "conduction", "between": [n, "wall"], "conductance": f"{ua / cells!r} [W/K]"} for k, n in enumerate(names)}
    node: dict[str, object] = {} if massless else {"capacitance": "5 [J/K]"}
    model = td.model_from_dict(
        {
            "title": "Stream",
            "needs": ["inlet", "wall"],
            "nodes": {n: node for n in names} | {"by": {"capacitance": "1 [J/K]"}},
            "conductors": links | {"b": {"kind": "conduction", "between": ["by", "wall"], "conductance": "1 [W/K]"}},
        }
    )
    scenario = td.Scenario("on", boundaries={"inlet": "350 [K]", "wall": "300 [K]"}, start="300 [K]", duration=500.0)
    expected = 300 + 50 * (1 + ua / heat / cells) ** -cells
    assert td.steady(model, scenario)[names[-1]] == pytest.approx(expected, abs=1e-9)
    solution = td.simulate(model, scenario, options=TIGHT)
    assert solution[names[-1]].kelvin[-1] == pytest.approx(expected, abs=1e-6)
    assert solution.heat_balance().relative < 1e-9


def test_balanced_counterflow_exchanger() -> None:
    """Two equal streams in N cells each: effectiveness x/(1 + x) with x = N n/(1 + n), n = NTU/N; NTU/(1 + NTU) for many cells."""
    cells, ua, heat = 8, 3.0, 2.0
    hot, cold = [f"h{k}" for k in range(cells)], [f"k{k}" for k in range(cells)]
    links: dict[str, object] = {f"fh{k}": _flow(a, b) for k, (a, b) in enumerate(zip(["hot_in", *hot], hot, strict=False))}
    links |= {f"fk{k}": _flow(a, b) for k, (a, b) in enumerate(zip(["cold_in", *cold[::-1]], cold[::-1], strict=False))}
    links |= {
        f"w{k}": {"kind": "conduction", "between": [a, b], "conductance": f"{ua / cells!r} [W/K]"}
        for k, (a, b) in enumerate(zip(hot, cold, strict=True))
    }
    model = td.model_from_dict(
        {
            "title": "Exchanger",
            "needs": ["hot_in", "cold_in"],
            "nodes": {n: {"capacitance": "3 [J/K]"} for n in (*hot, *cold)},
            "conductors": links,
        }
    )
    scenario = td.Scenario("on", boundaries={"hot_in": "360 [K]", "cold_in": "300 [K]"}, start="300 [K]", duration=2000.0)
    x = cells * (ua / heat / cells) / (1 + ua / heat / cells)
    found = td.steady(model, scenario)
    assert (360 - found[hot[-1]]) / 60 == pytest.approx(x / (1 + x), abs=1e-10)
    assert (found[cold[0]] - 300) / 60 == pytest.approx(x / (1 + x), abs=1e-10)
    assert td.simulate(model, scenario, options=TIGHT)[hot[-1]].kelvin[-1] == pytest.approx(found[hot[-1]], abs=1e-6)


def test_matrices_of_a_flow_through_a_massless_node() -> None:
    """Heat reaches the massless node by the stream but does not leave it that way: T_b = (g T_a + mc T_in)/(g + mc)."""
    model = td.model_from_dict(
        {
            "title": "Mixer",
            "needs": ["inlet", "sink"],
            "nodes": {"a": {"capacitance": "100 [J/K]"}, "b": {}},
            "conductors": {
                "g": {"kind": "conduction", "between": ["a", "b"], "conductance": "1 [W/K]"},
                "feed": _flow("inlet", "b"),
                "drain": _flow("b", "sink"),
            },
            "loads": {"q": {"into": "b", "power": "6 [W]"}},
        }
    )
    space = td.simulation.state_space(td.simulation.compile_network(model))
    g, mc = 1.0, 2.0
    assert space.A == pytest.approx(np.array([[-g * mc / (g + mc) / 100]]), rel=1e-14)
    assert space.B_boundary == pytest.approx(np.array([[g * mc / (g + mc) / 100, 0.0]]), rel=1e-14)
    assert space.B_load == pytest.approx(np.array([[g / (g + mc) / 100]]), rel=1e-14)
    assert space.recover == (("b", pytest.approx({"a": 1 / 3, "inlet": 2 / 3})),)
    found = td.steady(model, td.Scenario("on", boundaries={"inlet": "300 [K]", "sink": "250 [K]"}))
    assert found["a"] == found["b"] == pytest.approx(303.0, abs=1e-9)
