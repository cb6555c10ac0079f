"""Property 6 and the modal solution: superposition, reciprocity and the matrix exponential of linear networks."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st
from scipy.linalg import expm

import thermid as td
from oracle import si
from strategies import DURATION, LINEAR, TIGHT, Case, Deck, build, cases, decks, random_models

TIMES = np.linspace(0.0, DURATION, 13)


def _with_power(deck: Deck, node: str, watts: float) -> Deck:
    loads = {**deck.get("loads", {}), "probe": {"into": node, "power": f"{watts!r} [W]"}}
    return {**deck, "loads": loads}


def _run(deck: Deck, case: Case) -> np.ndarray:
    return td.simulate(build(deck), case.run(), times=TIMES, options=TIGHT).temperatures


@random_models(40, case=cases(kinds=(*LINEAR, "flow"), loads=("constant", "sine")), watts=st.tuples(st.floats(0, 9), st.floats(0, 9)))
def test_loads_add_up(case: Case, watts: tuple[float, float]) -> None:
    """The effect of two powers together is the sum of the effects of each, one-way flow links among them."""
    node = list(case.deck["nodes"])[-1]
    none, one, other, both = (_run(_with_power(case.deck, node, w), case) for w in (0.0, watts[0], watts[1], sum(watts)))
    np.testing.assert_allclose((one - none) + (other - none), both - none, rtol=0, atol=1e-5 * (1 + np.abs(both - none).max()))


@random_models(40, case=cases(kinds=LINEAR, loads=("constant",), flat=True), pick=st.tuples(st.integers(0, 7), st.integers(0, 7)))
def test_heat_here_read_there_is_heat_there_read_here(case: Case, pick: tuple[int, int]) -> None:
    nodes = list(case.deck["nodes"])
    a, b = (nodes[k % len(nodes)] for k in pick)
    options = TIGHT
    runs = [
        td.simulate(build(_with_power(case.deck, n, w)), case.run(), times=TIMES, options=options)
        for n, w in ((a, 0.0), (a, 5.0), (b, 5.0))
    ]
    there, here = runs[1][b].kelvin - runs[0][b].kelvin, runs[2][a].kelvin - runs[0][a].kelvin
    np.testing.assert_allclose(there, here, rtol=0, atol=1e-6 * (1 + np.abs(here).max()))


@random_models(60, case=cases(kinds=(*LINEAR, "flow"), loads=("constant",), constant=True))
def test_simulation_equals_the_matrix_exponential(case: Case) -> None:
    network = td.simulation.compile_network(case.model)
    space = td.simulation.state_space(network)
    outer = np.array([si(case.scenario["boundaries"][b]) for b in space.boundaries])
    watts = np.array([network.numbers().values[f"{path}.power"] for path in space.loads])
    push = space.B_boundary @ outer + space.B_load @ watts
    start = np.array([si(case.scenario["initial"].get(n, case.scenario["start"])) for n in space.nodes])
    size = len(space.nodes)
    block = np.zeros((size + 1, size + 1))
    block[:size, :size], block[:size, size] = space.A, push
    found = td.simulate(case.model, case.run(), times=TIMES, options=TIGHT)
    index = [found.nodes.index(n) for n in space.nodes]
    for k, t in enumerate(TIMES):
        exact = (expm(block * t) @ np.append(start, 1.0))[:size]
        assert np.abs(found.temperatures[k, index] - exact).max() < 1e-5


@random_models(60, deck=decks(kinds=LINEAR, loads=()))
def test_modes_are_real_and_decay(deck: Deck) -> None:
    """The slowest pattern, left to itself, keeps its shape and falls by e in its time constant."""
    space = td.simulation.state_space(td.simulation.compile_network(build(deck)))
    modes = td.simulation.modes(space)
    assert np.all(modes.time_constants > 0)
    assert np.all(np.diff(modes.time_constants) <= 0)
    for constant, shape in zip(modes.time_constants, modes.shapes.T, strict=True):
        assert np.abs(shape).max() == 1.0
        np.testing.assert_allclose(space.A @ shape, -shape / constant, rtol=0, atol=1e-9 * np.abs(space.A).max())


@random_models(40, deck=decks(kinds=(*LINEAR, "flow"), loads=()))
def test_time_constants_of_a_solution_are_those_of_the_modes(deck: Deck) -> None:
    model = build(deck)
    scenario = td.Scenario("still", boundaries=dict.fromkeys(deck["needs"], "300 [K]"), start="300 [K]", duration=10.0)
    found = td.simulate(model, scenario).time_constants
    expected = td.simulation.modes(td.simulation.state_space(td.simulation.compile_network(model))).time_constants
    np.testing.assert_allclose(found, expected, rtol=1e-6)
