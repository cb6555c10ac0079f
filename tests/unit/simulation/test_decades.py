"""Networks whose conductances and capacities span sixteen decades: no refusal for a false reason, no open balance without a word."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.base.errors import SolverError
from thermid.simulation._solver.engine import solve_conserving

ROOM = 22.0


def network(seed: int, power: bool = False) -> td.Model:
    """A tree with further conductors and some radiation; one node is tied to the room."""
    rng = np.random.default_rng(seed)
    size = int(rng.integers(2, 9))

    def draw(middle: float) -> float:
        return float(10.0 ** (middle + rng.uniform(-8.0, 8.0)))

    ends = [(f"n{i}", f"n{int(rng.integers(0, i))}" if i else "room") for i in range(size)]
    conductors: dict[str, Any] = {
        f"g{k}": {"kind": "conduction", "between": list(pair), "conductance": f"{draw(0.0)!r} [W/K]"} for k, pair in enumerate(ends)
    }
    for k in range(int(rng.integers(0, size))):
        a, b = (f"n{i}" for i in rng.choice(size, 2, replace=False))
        conductors[f"r{k}"] = {"kind": "radiation", "between": [a, b], "area": f"{draw(-2.0)!r} [m^2]", "exchange_factor": 1}
    return td.model_from_dict(
        {
            "title": f"network {seed}",
            "needs": ["room"],
            "nodes": {f"n{i}": {"capacitance": f"{draw(1.0)!r} [J/K]"} if rng.random() < 0.8 else {} for i in range(size)},
            "conductors": conductors,
            "loads": {"q": {"into": "n0", "power": "1 [W]"}} if power else {},
        }
    )


def case(start: str = "60 [degC]") -> td.Scenario:
    return td.Scenario("rest", boundaries={"room": f"{ROOM} [degC]"}, start=start, duration="1 [h]")


@pytest.mark.parametrize("seed", range(40))
def test_a_passive_network_comes_to_rest_at_the_temperature_of_its_boundary(seed: int) -> None:
    found = td.steady(network(seed), case())
    assert np.array([found[n] for n in found]) == pytest.approx(ROOM + 273.15, abs=1e-6)


@pytest.mark.parametrize("seed", [3, 5, 8, 13])
def test_it_starts_there_too(seed: int) -> None:
    run = td.simulate(network(seed), case("steady"), every="600 [s]")
    assert run.temperatures == pytest.approx(ROOM + 273.15, abs=1e-6)


def test_a_rise_far_beyond_the_first_guess_is_found() -> None:
    """1 W through 1e-4 W/K is 10,000 K: more than 200 moves of 100 K less halvings reached before."""
    deck = {
        "title": "insulated",
        "needs": ["room"],
        "nodes": {"a": {"capacitance": "1 [J/K]"}, "b": {}},
        "conductors": {
            "tie": {"kind": "conduction", "between": ["a", "b"], "conductance": "1e8 [W/K]"},
            "leak": {"kind": "conduction", "between": ["b", "room"], "conductance": "4e-5 [W/K]"},
        },
        "loads": {"q": {"into": "a", "power": "1 [W]"}},
    }
    assert td.steady(td.model_from_dict(deck), case())["a"] == pytest.approx(ROOM + 273.15 + 25000.0, rel=1e-9)


def alone(power: float, radiates: bool) -> td.Model:
    """A massless node with a load, tied by 1 mW/K; and it may radiate."""
    conductors: dict[str, Any] = {
        "tie": {"kind": "conduction", "between": ["m", "a"], "conductance": "1e-3 [W/K]"},
        "out": {"kind": "conduction", "between": ["a", "room"], "conductance": "1 [W/K]"},
    }
    if radiates:
        conductors["r"] = {"kind": "radiation", "between": ["m", "a"], "area": "1e-6 [m^2]", "exchange_factor": 1}
    nodes = {"a": {"capacitance": "1e9 [J/K]"}, "m": {}}
    loads = {"q": {"into": "m", "power": f"{power!r} [W]"}}
    return td.model_from_dict({"title": "alone", "needs": ["room"], "nodes": nodes, "conductors": conductors, "loads": loads})


@pytest.mark.parametrize("power", [2.0, 90.0, 1000.0])
def test_a_massless_node_far_above_its_neighbours_is_found_in_a_run(power: float) -> None:
    """At 11,000 K above them the heat that goes is 1 kW; where Newton's method would start at their temperature."""
    run = td.simulate(alone(power, True), case("22 [degC]"), every="600 [s]")
    hot, cold = run["m"].kelvin[-1], run["a"].kelvin[-1]
    assert 1e-3 * (hot - cold) + 1e-6 * 5.670374419e-8 * (hot**4 - cold**4) == pytest.approx(power, rel=1e-9)


@pytest.mark.parametrize("power", [150.0, 1e6])
def test_a_massless_node_beyond_every_range_is_refused_for_that(power: float) -> None:
    with raises_code("run.did-not-finish", SolverError, match=r"100,000 K.* 0 s .*'m'"):
        td.simulate(alone(power, False), case(), every="600 [s]")


@pytest.mark.parametrize("seed", range(30))
def test_a_passive_network_stays_between_its_start_and_its_boundary(seed: int) -> None:
    run = td.simulate(network(seed), case(), every="600 [s]")
    assert run.temperatures.min() > ROOM + 273.15 - 1e-6
    assert run.temperatures.max() < 60.0 + 273.15 + 1e-6


@pytest.mark.parametrize("seed", [0, 2, 4, 10])
def test_what_would_be_hotter_than_anything_is_refused_for_that(seed: int) -> None:
    with raises_code("run.no-steady-state", SolverError, match=r"'n\d'.*100,000"):
        td.steady(network(seed, power=True), case())


class TestElimination:
    def test_every_entry_keeps_its_digits(self) -> None:
        """A pair tied by 1e8 W/K to each other and by 1e-8 W/K to the outside: both rise by 1 W / 1e-8 W/K."""
        gains = np.array([[0.0, 1e8], [1e8, 0.0]])
        found = solve_conserving(gains, np.array([0.0, 1e-8]), np.array([1.0, 0.0]))
        assert found == pytest.approx([1e8, 1e8], rel=1e-14)

    def test_it_is_the_inverse_where_that_is_harmless(self) -> None:
        rng = np.random.default_rng(2)
        gains = rng.uniform(0.0, 1.0, (7, 7))
        np.fill_diagonal(gains, 0.0)
        leaving, right = rng.uniform(0.1, 1.0, 7), rng.normal(size=(7, 3))
        matrix = np.diag(leaving + gains.sum(axis=0)) - gains
        assert solve_conserving(gains, leaving, right) == pytest.approx(np.linalg.solve(matrix, right), rel=1e-12)

    def test_a_part_without_a_way_out_has_no_answer(self) -> None:
        gains = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
        assert solve_conserving(gains, np.array([0.0, 0.0, 1.0]), np.ones(3)) is None


class TestStores:
    def run(self, capacitance: str) -> td.Solution:
        deck = {
            "title": "store",
            "needs": ["room"],
            "nodes": {"tank": {"capacitance": f"{capacitance} [J/K]"}, "plate": {"capacitance": "10 [J/K]"}},
            "conductors": {
                "in": {"kind": "conduction", "between": ["tank", "plate"], "conductance": "1 [W/K]"},
                "out": {"kind": "conduction", "between": ["plate", "room"], "conductance": "1 [W/K]"},
            },
        }
        return td.simulate(td.model_from_dict(deck), case(), every="60 [s]")

    @pytest.mark.parametrize("capacitance", ["1e16", "1e30", "1e300"])
    def test_heat_that_a_temperature_has_no_digits_for_is_told(self, capacitance: str) -> None:
        run = self.run(capacitance)
        assert run.heat_balance().relative > 1e-3
        (told,) = run.warnings
        balance = run.heat_balance()
        assert all(part in told for part in ("'tank'", f"{float(capacitance):.3g} J/K", f"{100 * balance.relative:.2g} %"))
        assert told in str(run)

    @pytest.mark.parametrize("capacitance", ["10", "1e6", "1e9"])
    def test_what_closes_is_not(self, capacitance: str) -> None:
        assert self.run(capacitance).warnings == ()
