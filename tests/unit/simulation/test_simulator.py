"""One simulator, many runs: values, sensitivities and names."""

from __future__ import annotations

import re

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.base.errors import DeckError, NameNotFoundError, ScenarioError
from thermid.model.tree import TableSignal

DECK = {
    "title": "pair",
    "needs": ["room"],
    "nodes": {"hot": {"capacitance": "200 [J/K]"}, "cold": {"capacitance": "300 [J/K]"}, "seam": {}},
    "conductors": {
        "left": {"kind": "conduction", "between": ["hot", "seam"], "conductance": "2 [W/K]"},
        "right": {"kind": "conduction", "between": ["seam", "cold"], "conductance": "3 [W/K]"},
        "gap": {"kind": "conduction", "between": ["seam", "room"], "conductance": "0.1 [W/K]"},
    },
    "surfaces": {"skin": {"of": "cold", "to": "room", "area": "0.05 [m^2]", "htc": "8 [W/(m^2 K)]", "emissivity": 0.8}},
    "loads": {"heater": {"into": "hot", "power": "5 [W]"}},
    "aliases": {"warm": "hot"},
}
ROOM = td.Scenario("room", boundaries={"room": "20 [degC]"}, start="room", duration="1 [h]")
FREE = ("left.conductance", "skin.htc", "room", "initial.hot", "scale.heater")


@pytest.fixture(scope="module")
def simulator() -> td.simulation.Simulator:
    return td.prepare(td.model_from_dict(DECK), ROOM, FREE, every=600.0)


def test_without_values_it_is_a_plain_run(simulator: td.simulation.Simulator) -> None:
    plain = td.simulate(td.model_from_dict(DECK), ROOM, every=600.0)
    assert np.array_equal(simulator.run().temperatures, plain.temperatures)
    assert dict(simulator.nominal) == {
        "left.conductance": 2.0,
        "skin.htc": 8.0,
        "room": pytest.approx(293.15),
        "initial.hot": pytest.approx(293.15),
        "scale.heater": 1.0,
    }


def test_values_act_as_in_a_changed_model(simulator: td.simulation.Simulator) -> None:
    changed = {**DECK, "loads": {"heater": {"into": "hot", "power": "10 [W]"}}}
    changed["surfaces"] = {"skin": {**DECK["surfaces"]["skin"], "htc": "11 [W/(m^2 K)]"}}
    expected = td.simulate(td.model_from_dict(changed), ROOM.with_(initial={"hot": "30 [degC]"}), every=600.0)
    found = simulator.run(simulator.with_units({"skin.htc": 11.0, "scale.heater": 2.0, "initial.warm": 303.15}))
    assert np.abs(found.temperatures - expected.temperatures).max() < 1e-9


@pytest.mark.parametrize("node", ["hot", "cold", "seam", "room"])
@pytest.mark.parametrize("name", FREE)
def test_sensitivities_are_slopes(simulator: td.simulation.Simulator, node: str, name: str) -> None:
    found = simulator.run(sensitivities=True).sensitivity(node, name)
    here, step = simulator.nominal[name], 1e-3 * max(abs(simulator.nominal[name]), 1.0)
    low, high = (simulator.run(simulator.with_units({name: here + sign * step}))[node].kelvin for sign in (-1.0, 1.0))
    assert found == pytest.approx((high - low) / (2 * step), rel=2e-4, abs=2e-4)


def test_a_solution_without_sensitivities_says_how_to_get_them(simulator: td.simulation.Simulator) -> None:
    with raises_code("name.unknown", NameNotFoundError):
        simulator.run().sensitivity("hot", "skin.htc")
    with raises_code("name.unknown", NameNotFoundError, match=r"'gap\.conductance'.*left\.conductance"):
        simulator.run(sensitivities=True).sensitivity("hot", "gap.conductance")


def test_only_free_names_take_values(simulator: td.simulation.Simulator) -> None:
    with raises_code("name.unknown", NameNotFoundError, match=r"'right\.conductance'"):
        simulator.run({"right.conductance": 1.0})
    with raises_code("name.unknown", NameNotFoundError, match=r"'skin\.htc'"):
        simulator.run({"skin.hct": 1.0})


def test_names_are_checked_when_it_is_prepared() -> None:
    with raises_code("name.unknown", NameNotFoundError, match=r"'skin\.hct'"):
        td.prepare(td.model_from_dict(DECK), ROOM, ["skin.hct"])
    derived = {**DECK, "parameters": {"side": "0.2 [m]", "face": "side**2"}}
    with raises_code("model.refused", DeckError, match="'face'"):
        td.prepare(td.model_from_dict(derived), ROOM, ["face"])


def test_a_network_of_massless_nodes_alone_can_be_run() -> None:
    links = {
        f"to_{n}": {"kind": "conduction", "between": ["tap", n], "conductance": f"{g} [W/K]"} for n, g in (("warm", 3.0), ("cool", 1.0))
    }
    divider = td.model_from_dict({"title": "divider", "needs": ["warm", "cool"], "nodes": {"tap": {}}, "conductors": links})
    scenario = td.Scenario("held", boundaries={"warm": "40 [degC]", "cool": "20 [degC]"}, start="warm", duration="1 [min]")
    assert td.simulate(divider, scenario)["tap"].celsius == pytest.approx(35.0, abs=1e-9)


def test_models_and_traces_print_as_one_line() -> None:
    model = td.model_from_dict(DECK)
    assert re.fullmatch(r"pair: 3 \w+, 3 \w+, 1 \w+, 1 \w+; \w+ room", str(model))
    trace = td.simulate(model, ROOM)["room"]
    assert str(trace).startswith("room: 20.000 degC at 3600 s, 20.000 .. 20.000 degC at 301 ")


def test_a_trace_is_asked_with_a_unit_and_within_its_run() -> None:
    trace = td.simulate(td.model_from_dict(DECK), ROOM, every=60.0)["hot"]
    assert trace.at("10 [min]") == trace.at(600.0)
    assert trace.at([0.0, 3600.0]).tolist() == [trace.celsius[0], trace.celsius[-1]]
    for wrong in (3601.0, -1.0, "2 [h]", [60.0, 7200.0]):
        with raises_code("run.outside-times", ScenarioError, match="0.*3600"):
            trace.at(wrong)
    with pytest.raises(td.ThermidError, match="min"):
        trace.at("10 min")


def test_a_run_ends_outside_a_table_only_where_the_table_says_so() -> None:
    def run(outside: str) -> td.Solution:
        points = {"outside": outside, "points": [["0 [degC]", "10 [W]"], ["25 [degC]", "10 [W]"]]}
        deck = {**DECK, "loads": {"heater": {"into": "hot", "table": points}}}
        return td.simulate(td.model_from_dict(deck), ROOM, every=600.0)

    assert run("hold")["hot"].celsius.max() > 25.0
    with pytest.raises(td.ThermidError, match="'heater'"):  # the table is named, and not the solver
        run("refuse")


def test_a_run_draws_the_rows_of_its_time_alone() -> None:
    """A log of weeks before it costs nothing."""
    signal = TableSignal(np.array([-20.0, -10.0, 0.0, 10.0, 20.0]), np.arange(5.0))
    assert signal.drawn(15.0).times.tolist() == [0.0, 10.0, 20.0]
    assert signal.shifted(-20.0).drawn(40.0).times.size == 5
