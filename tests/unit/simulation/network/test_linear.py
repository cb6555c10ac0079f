"""State space and modes: section 2.2 of the acceptance sheet, and random networks."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from by_code import raises_code
from oracles.two_nodes import TwoNodes
from thermid.base.errors import SolverError
from thermid.model.tree import Constant, load_model, model_from_dict
from thermid.simulation._network.environment import Environment
from thermid.simulation._network.linear import modes, state_space
from thermid.simulation._network.medium import Media
from thermid.simulation._network.network import compile_network

STACK = Path(__file__).parents[4] / "examples/02_stack/m_PrE.toml"
ACC = Path(__file__).parents[4] / "examples/01_accelerometer/accelerometer.toml"
VACUUM = Media({"*": Environment(Constant(0.0))}, as_printed=True)


def test_numbers_of_the_stack() -> None:
    """Resistances and capacitances of the reference case, from the deck."""
    numbers = compile_network(load_model(STACK)).numbers()
    found = {row.name: float(row.coefficients[0]) for row in numbers.conductors}  # type: ignore[arg-type]
    wanted = {
        "proc.skin": 3.593502947,
        "ele.skin": 7.223653710,
        "stack.gap": 9.328358209,
        "stack.first": 1.390410959,
        "stack.second": 1.390410959,
    }
    assert {name: 1 / g for name, g in found.items()} == pytest.approx(wanted, rel=1e-9)
    assert numbers.capacitances["proc.case"] == pytest.approx(1468.8, rel=1e-12)
    assert numbers.capacitances["ele.case"] == pytest.approx(707.52, rel=1e-12)
    assert numbers.capacitances["cd"] is None


def test_state_space_of_the_stack() -> None:
    """Eq. 5: the matrix of the closed form, the eigenvalues and the time constants that section 2.2 states."""
    space = state_space(compile_network(load_model(STACK)))
    assert (space.nodes, space.boundaries) == (("proc.case", "ele.case"), ("cv",))
    r1, r2, r3, rd = 3.593502946672416, 7.223653709599008, 9.328358208955224, 1.3904109589041098
    closed = TwoNodes.from_resistances((1468.8, 707.52), (4.11, 2.168), (r1, r2), (rd, rd), r3)
    np.testing.assert_allclose(space.A, closed.matrix(), rtol=1e-12)
    # the closed form is shared; the same matrix by Delta of Eq. 4, spelled out here
    delta = rd * rd + 2 * rd * r3
    off = r3 / delta
    diagonal = (1 / r1 + (rd + r3) / delta, 1 / r2 + (rd + r3) / delta)
    np.testing.assert_allclose(space.A, [[-diagonal[0] / 1468.8, off / 1468.8], [off / 707.52, -diagonal[1] / 707.52]], rtol=1e-12)
    np.testing.assert_allclose(space.A.sum(axis=1) + space.B_boundary[:, 0], 0.0, atol=1e-18)
    np.testing.assert_allclose(sorted(np.linalg.eigvals(space.A)), [-9.5368836e-4, -2.3675805e-4], rtol=5e-8)
    assert modes(space).time_constants == pytest.approx((4223.721, 1048.561), abs=1e-3)


def test_steady_state_of_the_stack() -> None:
    """36.252540 and 35.986075 degC, T_cd 35.278747 degC."""
    network = compile_network(load_model(STACK))
    space = state_space(network)
    power = np.array([4.11, 2.168]) / space.capacitances
    steady = np.linalg.solve(space.A, -(space.B_boundary[:, 0] * 24.0 + power))
    assert steady == pytest.approx((36.252540, 35.986075), abs=1e-6)
    ((name, weights),) = space.recover
    known = {"proc.case": steady[0], "ele.case": steady[1], "cv": 24.0}
    assert name == "cd"
    assert sum(w * known[n] for n, w in weights.items()) == pytest.approx(35.278747, abs=1e-6)


def test_vacuum_has_an_infinite_time_constant() -> None:
    space = state_space(compile_network(load_model(STACK), media=VACUUM))
    found = modes(space)
    assert found.time_constants[0] == math.inf
    assert found.time_constants[1] == pytest.approx(1327.859, abs=1e-3)
    np.testing.assert_allclose(found.shapes[:, 0], [1.0, 1.0], rtol=1e-12)


def test_accelerometer_has_one_mode() -> None:
    found = modes(state_space(compile_network(load_model(ACC))))
    assert found.time_constants == pytest.approx([1027.2604], abs=1e-4)
    assert modes(state_space(compile_network(load_model(ACC), media=VACUUM))).time_constants.tolist() == [math.inf]


def random_deck(rng: np.random.Generator) -> dict[str, Any]:
    n = int(rng.integers(2, 8))
    links = [(f"n{a}", f"n{b}") for a in range(n) for b in range(a) if b == a - 1 or rng.random() < 0.4] + [("n0", "air")]
    return {
        "title": "random",
        "needs": ["air"],
        "nodes": {f"n{k}": {"capacitance": f"{10 ** rng.uniform(0, 4)!r} [J/K]"} for k in range(n)},
        "conductors": {
            f"g{k}": {"kind": "conduction", "between": list(e), "conductance": f"{10 ** rng.uniform(-3, 2)!r} [W/K]"}
            for k, e in enumerate(links)
        },
    }


def test_eigenvalues_are_real_and_negative() -> None:
    """Acceptance sheet, B8, for random networks of two to seven nodes."""
    rng = np.random.default_rng(20240917)
    for _ in range(200):
        space = state_space(compile_network(model_from_dict(random_deck(rng))))
        found = modes(space)
        values = np.linalg.eigvals(space.A)
        assert np.abs(values.imag).max() <= 1e-12 * np.abs(values).max()
        assert (values.real < 0).all()
        assert (found.time_constants > 0).all()
        assert (np.diff(found.time_constants) <= 0).all()
        np.testing.assert_allclose(sorted(-1 / found.time_constants), sorted(values.real), rtol=1e-6)
        # a shape decays as a whole
        np.testing.assert_allclose(space.A @ found.shapes, found.shapes * (-1 / found.time_constants), atol=1e-9 * np.abs(space.A).max())
        np.testing.assert_allclose(np.abs(found.shapes).max(axis=0), 1.0, rtol=1e-12)


def test_flow_is_one_way() -> None:
    deck = {
        "title": "duct",
        "needs": ["air"],
        "nodes": {"up": {"capacitance": "10 [J/K]"}, "down": {"capacitance": "10 [J/K]"}},
        "conductors": {
            "entry": {"kind": "flow", "between": ["air", "up"], "mass_flow": "1 [g/s]", "specific_heat": "1000 [J/(kg K)]"},
            "on": {"kind": "flow", "between": ["up", "down"], "mass_flow": "1 [g/s]", "specific_heat": "1000 [J/(kg K)]"},
        },
    }
    space = state_space(compile_network(model_from_dict(deck)))
    np.testing.assert_allclose(space.A, [[-0.1, 0.0], [0.1, -0.1]], rtol=1e-14)
    np.testing.assert_allclose(space.B_boundary[:, 0], [0.1, 0.0], rtol=1e-14)


@pytest.mark.parametrize(
    ("extra", "name"),
    [
        ({"conductors": {"glow": {"kind": "radiation", "between": ["a", "air"], "emissivity": 0.3, "area": "1 [m^2]"}}}, "glow"),
        (
            {
                "loads": {
                    "hot": {"into": "a", "power": "1 [W]", "temperature_coefficient": "0.01 [1/K]", "reference_temperature": "300 [K]"}
                }
            },
            "hot",
        ),
    ],
)
def test_what_is_not_linear_has_no_one_matrix(extra: dict[str, Any], name: str) -> None:
    network = compile_network(model_from_dict({"title": "bent", "needs": ["air"], "nodes": {"a": {"capacitance": "1 [J/K]"}}} | extra))
    with raises_code("model.element-not-supported", SolverError, match=f"^bent: '{name}' "):
        state_space(network)
