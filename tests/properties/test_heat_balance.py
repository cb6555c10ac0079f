"""Property 1: the heat balance closes, by the integrator's own weights and by a quadrature of its own."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

import thermid as td
from oracle import Oracle, flatten
from strategies import DURATION, SWITCHED, Case, cases, random_models


@random_models(70, case=cases(loads=SWITCHED))
def test_balance_by_the_integrators_own_weights(case: Case) -> None:
    assert td.simulate(case.model, case.run()).heat_balance().relative < 1e-6


@pytest.mark.properties
def test_balance_about_a_knee() -> None:
    """Two nodes relax towards air through a power law whose difference grows from zero."""
    law = {"coefficient": "1 [W/(m^2 K)]", "exponent": 0.25}
    deck = {
        "title": "Knee",
        "needs": ["air"],
        "nodes": {"a": {"capacitance": "21.6 [J/K]"}, "b": {"capacitance": "20 [J/K]"}},
        "conductors": {
            "still": {"kind": "convection", "htc": law, "area": "0.01 [m^2]", "between": ["a", "air"]},
            "foot": {"kind": "conduction", "conductance": "0.05 [W/K]", "between": ["a", "air"]},
            "link": {"kind": "conduction", "resistance": "0.2 [K/W]", "between": ["a", "b"]},
            "loss": {"kind": "conduction", "conductance": "0.02 [W/K]", "between": ["b", "air"]},
        },
    }
    scenario = td.Scenario("relax", boundaries={"air": "255 [K]"}, start="255 [K]", initial={"b": "256.5 [K]"}, duration=DURATION)
    assert td.simulate(td.model_from_dict(deck), scenario).heat_balance().relative < 1e-6


@random_models(40, case=cases(loads=SWITCHED))
def test_balance_of_every_node_by_quadrature(case: Case) -> None:
    """Flows and powers of the solution, integrated over six Gauss points a stretch, against the heat each node has taken up."""
    model, scenario = case.model, case.run()
    first = td.simulate(model, scenario)
    flat, _ = flatten(case.deck)
    switched = [t for t, _ in first.statistics["switchings"]]
    edges = sorted({*Oracle(flat, {**case.scenario, "initial": {}}).breaks(DURATION), *(t for t in switched if t < DURATION)})
    times, weights = _gauss([0.0, *(b for a, b in pairwise(edges) if b - a > 1e-6)])
    solution = td.simulate(model, scenario, times=np.concatenate(([0.0], times, [DURATION])))
    network = td.simulation.compile_network(model)
    ends = {c.path: (c.ends, c.kind == "flow") for c in network.flat.conductors}
    gained = dict.fromkeys(solution.nodes, 0.0)
    for path, flow in solution.heat_flows.items():
        (a, b), one_way = ends[path]
        heat = float(weights @ flow[1:-1])
        gained[b] += heat
        gained[a] -= 0.0 if one_way else heat
    powers = {path: float(weights @ p[1:-1]) for path, p in solution.load_powers.items()}
    for load in network.flat.loads:
        gained[load.node] += powers[load.path]
    capacity = {n: float(c or 0.0) for n, c in network.numbers().capacitances.items()}
    stored = {n: c * solution[n].rise for n, c in capacity.items()}
    reach = sum(c * float(np.ptp(solution[n].kelvin)) for n, c in capacity.items())
    scale = max(sum(map(abs, powers.values())), sum(abs(gained[b]) for b in network.boundaries), reach, 1e-3)
    assert max(abs(gained[n] - stored[n]) for n in capacity) < 1e-4 * scale


def _gauss(edges: list[float]) -> tuple[np.ndarray, np.ndarray]:
    """Return points and weights between the edges, dense behind each of them where fast nodes still move."""
    fractions = np.array([0.0, 1e-6, 1e-5, 1e-4, 1e-3, 3e-3, 0.01, 0.03, 0.1, 0.2, 0.4, 0.6, 0.8, 1.0])
    point, weight = np.polynomial.legendre.leggauss(6)
    times, weights = [], []
    for a, b in pairwise(edges):
        grid = np.unique(np.round(np.concatenate((a + (b - a) * fractions, np.linspace(a, b, 2 + int((b - a) / 60)))), 6))
        for low, high in pairwise(grid):
            times.append(low + (high - low) * (point + 1) / 2)
            weights.append(weight * (high - low) / 2)
    return np.concatenate(times), np.concatenate(weights)
