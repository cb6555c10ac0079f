"""A scheduled parameter and one that changes from run to run: as a product they serve one wiring, otherwise they are refused."""

from __future__ import annotations

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.base.errors import ScenarioError, ThermidError, code_of


def model(conductance: str) -> td.Model:
    return td.model_from_dict(
        {
            "title": "x",
            "needs": ["air"],
            "parameters": {"a": "0.5 [W/K]", "b": "0.2 [W/K]", "c": 1.0},
            "nodes": {"n": {"capacitance": "100 [J/K]"}},
            "conductors": {"g": {"kind": "conduction", "between": ["n", "air"], "conductance": conductance}},
            "loads": {"h": {"into": "n", "power": "2 [W]"}},
        }
    )


STEPS = {"times": ["0 [s]", "1800 [s]"], "values": ["0.5 [W/K]", "0.1 [W/K]"], "hold": True}
FINE = td.Options(error=1e-6)
SCENARIO = td.Scenario("s", boundaries={"air": "20 [degC]"}, start="air", duration="1 [h]", schedule={"a": STEPS})


def alone(conductance: str, **values: str) -> np.ndarray:
    return td.simulate(model(conductance).with_values(values), SCENARIO, options=FINE)["n"].kelvin


def test_a_product_is_the_run_that_it_would_be_alone() -> None:
    found = td.ensemble(model("a*c"), SCENARIO, {"c": [1.0, 2.0, 0.0]}, options=FINE)
    for member, factor in enumerate((1.0, 2.0, 0.0)):
        assert found.temperatures("n")[:, member] == pytest.approx(alone("a*c", c=f"{factor}"), abs=1e-6)


def test_a_sum_is_refused_member_by_member() -> None:
    """It was run with the schedule of the deck's own values, in silence: 1.4 K off at the end."""
    found = td.ensemble(model("a + b"), SCENARIO, {"b": [0.2, 0.6]}, options=FINE)
    assert found.temperatures("n")[:, 0] == pytest.approx(alone("a + b"), abs=1e-6)
    assert list(found.failed) == [1]
    assert code_of(found.failed[1]) == "model.element-not-supported"
    assert "'g'" in found.failed[1]


def test_a_sum_is_refused_in_a_run_at_other_values() -> None:
    ready = td.prepare(model("a + b"), SCENARIO, ["b"], options=FINE)
    assert ready.run()["n"].kelvin == pytest.approx(alone("a + b"), abs=1e-6)
    with raises_code("model.element-not-supported", ScenarioError, match="'g'"):
        ready.run({"b": 0.6})


def two_ways() -> td.Model:
    return td.model_from_dict(
        {
            "title": "x",
            "needs": ["air"],
            "parameters": {"a": "0.5 [W/K]", "b": "0.2 [W/K]", "c": 1.0, "d": 1.0, "bend": 0.5},
            "nodes": {"n": {"capacitance": "100 [J/K]"}, "m": {"capacitance": "50 [J/K]"}},
            "conductors": {
                "g": {"kind": "conduction", "between": ["n", "air"], "conductance": "a*c"},
                "k": {"kind": "conduction", "between": ["m", "n"], "conductance": "b*d**bend"},
                "still": {"kind": "conduction", "between": ["m", "air"], "conductance": "0.05 [W/K]"},
            },
            "loads": {"h": {"into": "n", "power": "2 [W]"}},
        }
    )


def falling_and_rising() -> td.Scenario:
    """One value falls while the other rises, so the sample at which everything is largest hangs on the factors."""
    times = [f"{600 * k} [s]" for k in range(7)]
    down = {"times": times, "values": [f"{0.5 - 0.06 * k} [W/K]" for k in range(7)]}
    up = {"times": times, "values": [f"{0.02 + 0.08 * k} [W/K]" for k in range(7)]}
    return td.Scenario("s", boundaries={"air": "20 [degC]"}, start="air", duration="1 [h]", schedule={"a": down, "b": up})


def test_members_of_a_schedule_are_those_of_single_runs() -> None:
    """Members were refused where other factors made another sample the largest: 'do not act as a product'."""
    rng = np.random.default_rng(1)
    draws = {"c": rng.uniform(0.2, 3.0, 40), "d": rng.uniform(0.2, 30.0, 40)}
    found = td.ensemble(two_ways(), falling_and_rising(), draws, every=60.0)
    assert not found.failed
    for member in range(0, 40, 7):
        own = {k: float(v[member]) for k, v in draws.items()}
        single = td.simulate(two_ways().with_values({k: repr(v) for k, v in own.items()}), falling_and_rising(), every=60.0)
        for node in ("n", "m"):
            assert found.temperatures(node)[:, member] == pytest.approx(single[node].kelvin, abs=2e-4)


def test_a_value_whose_effect_is_no_factor_of_what_is_scheduled_is_named() -> None:
    """The exponent of a logged speed, in a fit; the message named neither it nor what to do."""
    times = np.arange(0.0, 1800.0, 60.0)
    warmer = td.Channel.from_array("n", 20.0 + 2.0 * (1.0 - np.exp(-times / 600.0)), unit="degC", role="node", target="n", noise=0.1)
    speed = td.Channel.from_array("d", np.linspace(0.5, 1.0, times.size), quantity="command", unit="1", role="schedule", target="d")
    record = td.Record.from_arrays("log", times, {"n": warmer, "d": speed})
    scenario = td.Scenario("s", boundaries={"air": "20 [degC]"}, start="air", duration="30 [min]")
    with raises_code("model.element-not-supported", ThermidError, match="'bend'"):
        td.calibrate(two_ways(), record, ["b", "bend"], scenario=scenario)


def test_a_schedule_is_evaluated_for_all_members_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """It was evaluated for every member: 2,000 members of a scheduled run took minutes."""
    from thermid.simulation._network.network import Network

    calls = []
    whole = Network.varied
    monkeypatch.setattr(Network, "varied", lambda *given: (calls.append(1), whole(*given))[1])

    def counted(members: int) -> int:
        calls.clear()
        td.ensemble(two_ways(), falling_and_rising(), {"c": np.linspace(0.5, 1.5, members)}, every=600.0)
        return len(calls)

    assert counted(300) == counted(3)


def test_only_members_that_are_no_product_are_refused() -> None:
    found = td.ensemble(model("a*c + b"), SCENARIO, {"c": [1.0, 2.0, 1.0], "b": [0.2, 0.2, 0.2]}, options=FINE)
    assert list(found.failed) == [1]
    for member in (0, 2):
        assert found.temperatures("n")[:, member] == pytest.approx(alone("a*c + b"), abs=1e-6)
