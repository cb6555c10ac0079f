"""Property 9: the Jacobian and the sensitivities are those of finite differences."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import strategies as st

import thermid as td
from oracle import si
from strategies import DURATION, SMOOTH, WITHOUT_KNEES, Case, cases, random_models
from thermid.simulation.runs import Engine, Options, Wiring

VERY_TIGHT = Options(error=8e-11, max_step=30.0)
TIMES = np.array([60.0, 900.0, DURATION])
STEPS, RANGE, MOVE = 30, 200.0, 0.01
"""Steps of a run whose errors are still felt at its end; temperatures of a case, from the coldest to the hottest [K]; by how much a
difference moves them at most, lest powers that grow with temperature make it crooked [K]."""


def _free(case: Case) -> tuple[td.Model, list[str], np.ndarray]:
    """Return every name that can be freed, one of each sort at least where there is one, and its value."""
    model = case.model
    network = td.simulation.compile_network(model)
    values = network.numbers().values
    table = network.flat.parameters.table
    names = [p for p in table if table[p].parameter.is_literal and not p.endswith((".period", ".duty"))]
    x = [float(values[p]) for p in names]
    for b in network.boundaries:
        given = case.scenario["boundaries"][b]
        names.append(b)
        x.append(0.0 if isinstance(given, dict) else si(given))
    for n, c in network.numbers().capacitances.items():
        if c is not None:
            names.append(f"initial.{n}")
            x.append(si(case.scenario["initial"].get(n, case.scenario["start"])))
    for load in network.flat.loads:
        names.append(f"scale.{load.path}")
        x.append(1.0)
    return model, names, np.array(x)


def _step(name: str, value: float) -> float:
    if "coefficient" in name:  # a quadratic one is some 1e-6, and a small part of that moves nothing
        return max(1e-4 * abs(value), 1e-6)
    if value == 0:
        return 1e-3
    return 1e-5 * abs(value) if abs(value) > 200 else 1e-4 * abs(value)


@random_models(50, case=cases(loads=SMOOTH), at=st.tuples(st.integers(0, 2**31), st.floats(0, 3599)))
def test_jacobian_and_parameter_derivatives_of_the_right_hand_side(case: Case, at: tuple[int, float]) -> None:
    model, names, x = _free(case)
    wiring = Wiring(td.simulation.compile_network(model), case.run(), names)
    engine = Engine(wiring)
    a = wiring.assemble(x)
    temperatures = np.random.default_rng(at[0]).uniform(270, 340, len(engine.nodes))
    _, jacobian, slopes = engine.rhs(a, temperatures, at[1], gradients=True)
    assert slopes is not None
    for k in range(temperatures.size):
        move = np.zeros(temperatures.size)
        move[k] = 1e-3
        above, below = (engine.rhs(a, temperatures + s * move, at[1])[0] for s in (1, -1))
        np.testing.assert_allclose(jacobian[:, k], (above - below) / 2e-3, rtol=0, atol=1e-6 * (1 + np.abs(jacobian).max()))
    for k in np.random.default_rng(at[0]).permutation(len(names))[:12]:
        name, h = names[k], _step(names[k], x[k])
        move = np.zeros(x.size)
        move[k] = h
        # a value of zero, such as a coefficient, may not be negative: forward, of second order too
        points = (0, 1, 2) if x[k] == 0.0 else (-1, 1)
        rates = [engine.rhs(wiring.assemble(x + s * move), temperatures, at[1])[0] for s in points]
        difference = np.tensordot((-3.0, 4.0, -1.0) if x[k] == 0.0 else (-1.0, 1.0), rates, 1) / (2 * h)
        scale = max(abs(x[k]), 1.0)  # compared as watts per relative change
        np.testing.assert_allclose(
            scale * slopes[:, k], scale * difference, rtol=0, atol=1e-5 * (1 + np.abs(scale * difference).max()), err_msg=name
        )


@random_models(
    25,
    case=cases(kinds=WITHOUT_KNEES, loads=SMOOTH, nodes=5, depth=1),
    pick=st.lists(st.integers(0, 200), min_size=3, max_size=3, unique=True),
)
def test_sensitivities_of_temperatures(case: Case, pick: list[int]) -> None:
    model, names, x = _free(case)
    keep = sorted({k % len(names) for k in pick})
    names, x = [names[k] for k in keep], x[keep]
    wiring = Wiring(td.simulation.compile_network(model), case.run(), names)
    engine = Engine(wiring)

    def run(values: np.ndarray, gradients: bool = False) -> tuple[np.ndarray, np.ndarray]:
        answer = engine.integrate(wiring.assemble(values), TIMES, engine.nodes, DURATION, VERY_TIGHT, gradients)
        return answer.temperatures, answer.sensitivities

    temperatures, slopes = run(x, gradients=True)
    # Two runs take different steps, each of which may err by the tolerance of VERY_TIGHT; by how much they differ in the end. [K]
    apart = STEPS * VERY_TIGHT.of_step
    assert np.ptp(temperatures) < RANGE
    for k, name in enumerate(names):
        h = min(10 * _step(name, x[k]), MOVE / max(float(np.abs(slopes[:, :, k]).max()), 1e-9))
        move = np.zeros(x.size)
        move[k] = h
        difference = (run(x + move)[0] - run(x - move)[0]) / (2 * h)
        np.testing.assert_allclose(slopes[:, :, k], difference, rtol=0, atol=1e-4 * np.abs(difference).max() + apart / h, err_msg=name)


@pytest.mark.properties
def test_sensitivities_of_a_network_at_rest() -> None:
    """Nothing moves, so a step may be long; the effect of the air on the node is 1 - exp(-t/tau) all the same."""
    deck = {
        "title": "Rest",
        "needs": ["air"],
        "nodes": {"n": {"capacitance": "20 [J/K]"}},
        "conductors": {"g": {"kind": "conduction", "conductance": "0.07 [W/K]", "between": ["n", "air"]}},
    }
    scenario = td.Scenario("rest", boundaries={"air": "255 [K]"}, start="255 [K]", duration=DURATION)
    wiring = Wiring(td.simulation.compile_network(td.model_from_dict(deck)), scenario, ["air", "initial.n"])
    engine = Engine(wiring)
    answer = engine.integrate(wiring.assemble(np.array([255.0, 255.0])), TIMES, engine.nodes, DURATION, Options(), True)
    left = np.exp(-TIMES * 0.07 / 20)
    np.testing.assert_allclose(answer.sensitivities[:, 0, :], np.column_stack((1 - left, left)), rtol=0, atol=1e-4)
