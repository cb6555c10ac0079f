"""Ordinary models with many nodes: which method runs them, and what is left to the small integrator."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.base.errors import SolverError
from thermid.model.tree import TableSignal
from thermid.simulation._simulator import prepare
from thermid.simulation._solver import large_steady, problem

from .large_cases import CELLS, NODES, warm_block, warming_room

LARGE = ("RKC2", "TR-BDF2 + CG")
TIE = {"kind": "conduction", "conductance": "1e6 [W/K]"}


def chain(count: int, **more: Any) -> td.Model:
    """Nodes in a row between two boundaries, with radiation between some of them and a load."""
    names = [f"n{k}" for k in range(count)]
    ends = ["left", *names, "right"]
    conductors: dict[str, Any] = {
        f"g{k}": {"kind": "conduction", "between": [a, b], "conductance": "2 [W/K]"} for k, (a, b) in enumerate(pairwise(ends))
    }
    conductors["far"] = {"kind": "radiation", "between": ["n0", names[-1]], "area": "0.1 [m^2]", "emissivity": 0.9}
    deck = {
        "title": "chain",
        "needs": ["left", "right"],
        "nodes": {n: {"capacitance": "50 [J/K]"} for n in names},
        "conductors": conductors,
        "loads": {"heater": {"into": names[count // 3], "power": "5 [W]"}},
    }
    for table, entries in more.items():
        deck[table] = {**deck.get(table, {}), **entries}
    return td.model_from_dict(deck)


def ends(**more: Any) -> td.Scenario:
    right = {"mean": "310 [K]", "amplitude": "10 [K]", "period": "1 [h]"}
    return td.Scenario("ends", boundaries={"left": "300 [K]", "right": right}, start="300 [K]", duration="1 [h]").with_(**more)


def test_many_nodes_are_run_as_a_large_network_and_it_is_said() -> None:
    assert td.simulate(chain(40), ends()).statistics["method"] not in LARGE
    small = td.simulate(chain(600), ends(), options=td.Options(method="integrator"))
    run = td.simulate(chain(600), ends(), options=td.Options(error=1e-3))
    assert run.statistics["method"] in LARGE
    np.testing.assert_allclose(run.temperatures, small.temperatures, atol=1e-3)
    assert run.heat_balance().relative < 1e-7
    np.testing.assert_allclose(run.heat_flow("g3"), small.heat_flow("g3"), atol=1e-3)


def enclosure(faces: int, held: str) -> tuple[td.Model, td.Scenario]:
    """Faces of 250 to 700 K that all see each other; the first ones are tied to a room."""
    rng = np.random.default_rng(7)
    sees = {"kind": "radiation", "exchange_factor": 1.0, "area": f"{0.5 / faces!r} [m^2]"}
    pairs = [(f"n{i}", f"n{j}") for i in range(faces) for j in range(i)]
    conductors: dict[str, Any] = {f"r{k}": {**sees, "between": list(pair)} for k, pair in enumerate(pairs)}
    conductors |= {f"g{k}": {"kind": "conduction", "between": [f"n{k}", "room"], "conductance": "0.05 [W/K]"} for k in range(faces // 4)}
    nodes = {f"n{k}": {"capacitance": f"{c!r} [J/K]"} for k, c in enumerate(rng.uniform(20.0, 80.0, faces).tolist())}
    model = td.model_from_dict({"title": "faces", "needs": ["room"], "nodes": nodes, "conductors": conductors})
    initial = {f"n{k}": td.quantity(t, unit="K") for k, t in enumerate(rng.uniform(250.0, 700.0, faces).tolist())}
    return model, td.Scenario("cooling", boundaries={"room": held}, start="290 [K]", initial=initial, duration="1 [h]")


@pytest.mark.parametrize("method", ["RKC2", "TR-BDF2"])
@pytest.mark.parametrize("error", [3e-3, 1e-4])
def test_far_from_rest_a_large_network_keeps_the_error_that_is_stated(method: str, error: float) -> None:
    """Steps of second order for a change of 50 K erred by 1.3 to 1.7 times as much here."""
    model, scenario = enclosure(24, "290 [K]")
    right = td.simulate(model, scenario, options=td.Options(error=1e-7, method="integrator"), every="1 [min]")
    run = td.simulate(model, scenario, options=td.Options(error=error, method=method), every="1 [min]")
    assert float(np.abs(run.temperatures - right.temperatures).max()) < error


def test_the_way_of_least_work_depends_on_the_error_and_on_noise() -> None:
    """What benchmarks/b7.py measured: of second order while the error is loose, the integrator for a tight one, and for noise."""
    model = (
        td.Block(
            size=("50 [mm]", "50 [mm]", "50 [mm]"),
            cells=(5, 5, 5),
            conductivity="20 [W/(m K)]",
            density="2700 [kg/m^3]",
            specific_heat="900 [J/(kg K)]",
        )
        .exchanging("all", "air", htc="10 [W/(m^2 K)]", emissivity=0.9)
        .model()
    )
    calm = td.Scenario("room", boundaries={"air": "290 [K]"}, start="320 [K]", duration="1 [h]")
    samples = np.linspace(0.0, 3600.0, 3601)
    log = TableSignal(samples, 290.0 + 0.05 * np.random.default_rng(1).standard_normal(3601))

    def way(scenario: td.Scenario, error: float) -> str:
        return str(td.simulate(model, scenario, options=td.Options(error=error)).statistics["method"])

    assert way(calm, 3e-3) in LARGE
    assert way(calm, 1e-6) == "integrator"
    assert way(calm.with_(boundaries={"air": log}), 3e-3) == "integrator"


@pytest.mark.parametrize("method", ["RKC2", "TR-BDF2"])
def test_a_method_can_be_forced(method: str) -> None:
    small = td.simulate(chain(12), ends())
    run = td.simulate(chain(12), ends(), options=td.Options(error=4e-5, method=method))
    assert run.statistics["method"].startswith(method)
    np.testing.assert_allclose(run.temperatures, small.temperatures, atol=1e-4)


def test_several_conductors_from_one_node_to_one_boundary_all_count() -> None:
    """Nodes 0, 1 and 1 radiate to one boundary: as many rows as the kernel counts nodes from the first to the last of them."""
    radiation = {"kind": "radiation", "area": "0.05 [m^2]", "emissivity": 0.8}
    ends_of = {"r0": ["n0", "left"], "r1": ["n1", "left"], "r2": ["n1", "left"]}
    more = {name: {**radiation, "between": pair} for name, pair in ends_of.items()}
    model = chain(3, conductors={"z": {"kind": "conduction", "between": ["n1", "right"], "conductance": "1 [W/K]"}, **more})
    scenario = ends(start="350 [K]")
    run = td.simulate(model, scenario, options=td.Options(error=4e-5, method="RKC2", max_steps=2000))
    np.testing.assert_allclose(run.temperatures, td.simulate(model, scenario).temperatures, atol=1e-4)


def test_rates_of_very_different_size_take_the_implicit_method() -> None:
    even = td.simulate(chain(20), ends(), options=td.Options(method="large"))
    tiny = chain(20, nodes={"n5": {"capacitance": "0.01 [J/K]"}})
    uneven = td.simulate(tiny, ends(), options=td.Options(error=4e-5, method="large"))
    assert even.statistics["method"] == "RKC2"
    assert uneven.statistics["method"] == "TR-BDF2 + CG"
    np.testing.assert_allclose(uneven.temperatures, td.simulate(tiny, ends()).temperatures, atol=1e-4)


def massless() -> td.Model:
    """A chain with a massless node that no star and mesh can remove: it radiates and is heated by a load that jumps."""
    return chain(
        8,
        nodes={"skin": {}},
        conductors={
            "to_skin": {"kind": "conduction", "between": ["n2", "skin"], "conductance": "0.5 [W/K]"},
            "skin_out": {"kind": "radiation", "between": ["skin", "left"], "area": "0.05 [m^2]", "emissivity": 0.9},
        },
        loads={"lamp": {"into": "skin", "power": "3 [W]"}},
    )


def test_massless_nodes_are_solved_with_the_others() -> None:
    lamp = {"times": ["0 [s]", "1000 [s]"], "values": ["0 [W]", "6 [W]"], "hold": True}
    scenario, times = ends(loads={"lamp": lamp}), np.array([0.0, 500.0, 999.0, 1500.0, 3600.0])
    small = td.simulate(massless(), scenario, times=times)
    run = td.simulate(massless(), scenario, times=times, options=td.Options(error=4e-5, method="large"))
    assert run.statistics["method"] == "TR-BDF2 + CG"
    np.testing.assert_allclose(run.temperatures, small.temperatures, atol=1e-4)
    with raises_code("run.did-not-finish", td.ThermidError):
        td.simulate(massless(), scenario, options=td.Options(method="RKC2"))


@pytest.mark.parametrize(
    ("more", "match"),
    [
        (
            {"loads": {"heater": {"into": "n1", "power": "5 [W]", "thermostat": {"on_below": "300 [K]", "off_above": "310 [K]"}}}},
            "'large'.*'heater'",
        ),
        (
            {"conductors": {"pipe": {"kind": "flow", "between": ["n1", "n3"], "mass_flow": "1 [g/s]", "specific_heat": "4000 [J/(kg K)]"}}},
            "'large'.*'pipe'",
        ),
        (
            {
                "loads": {
                    "heater": {"into": "n1", "power": "5 [W]", "proportional": {"gain": "1 [W/K]", "setpoint": "310 [K]", "sensor": "n4"}},
                }
            },
            "'large'.*'heater'",
        ),
    ],
)
def test_what_large_networks_cannot_do_is_left_or_refused(monkeypatch: pytest.MonkeyPatch, more: dict[str, Any], match: str) -> None:
    monkeypatch.setattr(problem, "LARGE_FROM", 5)
    model = chain(6, **more)
    assert td.simulate(model, ends()).statistics["method"] not in LARGE
    with raises_code("model.element-not-supported", match=match):
        td.simulate(model, ends(), options=td.Options(method="large"))


def test_sensitivities_are_left_or_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(problem, "LARGE_FROM", 5)
    run = prepare(chain(6), ends(), ["g0.conductance"]).run(sensitivities=True)
    assert np.abs(run.sensitivity("n0", "g0.conductance")).max() > 0
    with raises_code("model.element-not-supported"):
        prepare(chain(6), ends(), ["g0.conductance"], options=td.Options(method="RKC2")).run(sensitivities=True)


def test_an_unknown_method_is_refused() -> None:
    with raises_code("name.unknown", match="RKC2"):
        td.simulate(chain(3), ends(), options=td.Options(method="RKC"))


@pytest.mark.parametrize("multigrid", [True, False])
def test_steady_states_of_a_block_and_its_model_agree(monkeypatch: pytest.MonkeyPatch, multigrid: bool) -> None:
    if multigrid:
        pytest.importorskip("pyamg")
    else:
        monkeypatch.setitem(__import__("sys").modules, "pyamg", None)
    monkeypatch.setattr(large_steady, "MOST_DIRECT", 0)
    found = td.steady(warm_block(), warming_room(), time=1800.0)
    model = td.steady(warm_block().model(), warming_room(), time=1800.0)
    np.testing.assert_allclose(found.final_field, np.array([model[n] for n in NODES]).reshape(CELLS), atol=1e-6)
    assert ("multigrid" in found.statistics["method"]) == multigrid
    assert found["hottest"].kelvin[0] == found.final_field.max()


def test_steady_states_of_a_thousand_nodes_are_eliminated(monkeypatch: pytest.MonkeyPatch) -> None:
    direct = td.steady(warm_block(), warming_room(), time=1800.0)
    assert direct.statistics["method"] == "Newton, Cholesky"
    monkeypatch.setattr(large_steady, "MOST_DIRECT", 0)
    np.testing.assert_allclose(td.steady(warm_block(), warming_room(), time=1800.0).final_field, direct.final_field, atol=1e-6)


def test_steady_states_of_many_nodes_take_the_sparse_way(monkeypatch: pytest.MonkeyPatch) -> None:
    dense = td.steady(massless(), ends())
    monkeypatch.setattr(problem, "LARGE_FROM", 5)
    sparse = td.steady(massless(), ends())
    assert sparse == pytest.approx(dense, abs=1e-6)


def test_without_multigrid_very_large_steady_states_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "pyamg", None)
    monkeypatch.setattr(large_steady, "WITHOUT_MULTIGRID", 50)
    monkeypatch.setattr(large_steady, "MOST_DIRECT", 0)
    with pytest.raises(td.ThermidError, match=r"pip install pyamg"):
        td.steady(warm_block(), warming_room())


def test_a_block_that_nothing_holds_has_no_steady_state() -> None:
    block = td.Block(("1 [m]",) * 3, (3, 3, 3), "15 [W/(m K)]", "3900 [kg/m^3]", "1000 [J/(kg K)]").heated(
        "h", "1 [W]", cells=np.s_[:1, :1, :1]
    )
    with raises_code("run.no-steady-state", td.ThermidError):
        td.steady(block, td.Scenario())
    cut = (np.zeros((2, 3, 3)), np.ones((3, 2, 3)), np.ones((3, 3, 2)))
    apart = td.Block(("1 [m]",) * 3, (3, 3, 3), "15 [W/(m K)]", "3900 [kg/m^3]", "1000 [J/(kg K)]", link_factors=cut)
    with raises_code("run.no-steady-state", td.ThermidError):
        td.steady(apart.exchanging("-x", "air", htc="5 [W/(m^2 K)]"), td.Scenario(boundaries={"air": "300 [K]"}))


def test_a_node_far_faster_than_the_step_is_right_between_steps() -> None:
    """It follows a room whose temperature has kinks; what it did before a kink must not be drawn into the step after it."""
    room = TableSignal(np.array([0.0, 500.0, 1000.0, 3600.0]), np.array([290.0, 310.0, 300.0, 290.0]))
    deck = {
        "title": "lid",
        "needs": ["room"],
        "nodes": {"case": {"capacitance": "2000 [J/K]"}, "lid": {"capacitance": "0.01 [J/K]"}},
        "conductors": {
            "air": {"kind": "conduction", "between": ["lid", "room"], "conductance": "40 [W/K]"},
            "rim": {"kind": "conduction", "between": ["case", "lid"], "conductance": "0.5 [W/K]"},
            "sky": {"kind": "radiation", "between": ["case", "room"], "area": "0.01 [m^2]", "emissivity": 0.9},
        },
    }
    model, times = td.model_from_dict(deck), np.arange(0.0, 3601.0, 10.0)
    scenario = td.Scenario("kinks", boundaries={"room": room}, start="300 [K]", duration="1 [h]")
    small, large = (td.simulate(model, scenario, times=times, options=td.Options(error=1e-3, method=m)) for m in ("integrator", "TR-BDF2"))
    assert large.statistics["steps"] < 100
    np.testing.assert_allclose(large["lid"].kelvin[1:], small["lid"].kelvin[1:], atol=1e-3)


def test_explicit_steps_that_one_fast_node_makes_too_short_are_refused_at_once() -> None:
    stiff = chain(3, nodes={"n1": {"capacitance": "1e-9 [J/K]"}}, conductors={"g1": {**TIE, "between": ["n0", "n1"]}})
    with raises_code("run.did-not-finish", SolverError, match="1000.*0 s .* RKC2"):
        td.simulate(stiff, ends(), options=td.Options(method="RKC2", max_steps=1000))
    assert td.simulate(stiff, ends(), options=td.Options(method="large")).statistics["method"] == "TR-BDF2 + CG"


def test_many_nodes_that_are_joined_to_a_boundary_alone_have_a_steady_state() -> None:
    nodes = {f"n{k}": {"capacitance": "5 [J/K]"} for k in range(600)}
    links = {f"c{k}": {"kind": "conduction", "between": [f"n{k}", "air"], "conductance": "2 [W/K]"} for k in range(600)}
    star = td.model_from_dict(
        {"title": "star", "needs": ["air"], "nodes": nodes, "conductors": links, "loads": {"q": {"into": "n7", "power": "1 [W]"}}}
    )
    settled = td.steady(star, td.Scenario("s", boundaries={"air": "20 [degC]"}))
    assert settled["n7"] == pytest.approx(293.65, abs=1e-6)
    assert settled["n8"] == pytest.approx(293.15, abs=1e-6)


@pytest.mark.parametrize("asked", ["thermostat", "members", "derivatives"])
def test_more_nodes_than_the_integrator_takes_are_refused_in_a_sentence(asked: str) -> None:
    count = 5001
    nodes = {f"n{k}": {"capacitance": "5 [J/K]"} for k in range(count)}
    links = {f"c{k}": {"kind": "conduction", "between": [f"n{k}", "air"], "conductance": "1 [W/K]"} for k in range(count)}
    heater = {"into": "n0", "power": "1 [W]"}
    if asked == "thermostat":
        heater["thermostat"] = {"sensor": "n0", "on_below": "25 [degC]", "off_above": "27 [degC]"}
    chain = td.model_from_dict({"title": "many", "needs": ["air"], "nodes": nodes, "conductors": links, "loads": {"heater": heater}})
    ready = td.prepare(chain, td.Scenario("s", boundaries={"air": "20 [degC]"}, start="20 [degC]", duration="1 [min]"), ["scale.heater"])
    with raises_code("run.too-many-nodes", SolverError, match="5001.*5000"):
        ready.ensemble({"scale.heater": [1.0, 1.1]}) if asked == "members" else ready.run(sensitivities=asked == "derivatives")
