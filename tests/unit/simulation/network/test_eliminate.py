"""Star to mesh against the dense Schur complement, with derivatives; chains, loops and undefined nodes."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from numpy.typing import NDArray

from by_code import raises_code
from thermid.base.errors import DeckError
from thermid.base.units import Dual, gradient_of, value_of
from thermid.model.tree import Model, model_from_dict
from thermid.simulation._network.network import Network, Numbers, Reduced, compile_network, eliminable, reduce_network

Array = NDArray[np.float64]


def random_model(seed: int, states: int, massless: int) -> Model:
    """A connected network: a chain through every node and the boundary, and random links besides."""
    rng = np.random.default_rng(seed)
    names = [f"c{k}" for k in range(states)] + [f"m{k}" for k in range(massless)]
    order = [*rng.permutation(names).tolist(), "air"]
    links = list(pairwise(order))
    links += [tuple(rng.choice([*order, "walls"], 2, replace=False).tolist()) for _ in range(2 * len(order))]
    return model_from_dict(
        {
            "title": f"seed {seed}",
            "needs": ["air", "walls"],
            "nodes": {n: {"capacitance": f"{rng.uniform(10, 1000)!r} [J/K]"} if n[0] == "c" else {} for n in names},
            "conductors": {
                f"g{k}": {"kind": "conduction", "between": list(ends), "conductance": f"{10 ** rng.uniform(-2, 1)!r} [W/K]"}
                for k, ends in enumerate(links)
            },
        }
    )


def laplacian(names: tuple[str, ...], rows: Any, free: int = 0) -> tuple[Array, Array]:
    """Return the conductance matrix (all, all) and its derivatives (free, all, all)."""
    index = {n: k for k, n in enumerate(names)}
    matrix, slope = np.zeros((len(names),) * 2), np.zeros((free, len(names), len(names)))
    for row in rows:
        i, j = (index[e] for e in row.ends)
        for a, b, sign in ((i, i, 1), (j, j, 1), (i, j, -1), (j, i, -1)):
            matrix[a, b] += sign * value_of(row.coefficients[0])
            slope[:, a, b] += sign * gradient_of(row.coefficients[0], free)
    return matrix, slope


def reduced(network: Network, numbers: Numbers) -> Reduced:
    return reduce_network(network, numbers, eliminable(numbers))


@settings(deadline=None, max_examples=40)
@given(seed=st.integers(0, 10**6), states=st.integers(1, 5), massless=st.integers(1, 6))
def test_against_the_schur_complement(seed: int, states: int, massless: int) -> None:
    network = compile_network(random_model(seed, states, massless))
    paths = tuple(p for p in network.flat.parameters.order if p.endswith("conductance"))[:4]
    base = network.numbers()
    numbers = network.numbers({p: Dual(base.values[p], unit) for p, unit in zip(paths, np.eye(len(paths)), strict=True)})
    gone = eliminable(numbers)
    assert sorted(gone) == sorted(n for n in network.nodes if n.startswith("m"))
    kept = tuple(n for n in (*network.nodes, *network.boundaries) if n not in gone)
    full, d_full = laplacian((*kept, *gone), numbers.conductors, len(paths))
    k = len(kept)
    a, b, c = full[:k, :k], full[:k, k:], full[k:, k:]
    solved = np.linalg.solve(c, b.T)
    wanted = a - b @ solved
    d_wanted = np.array([d[:k, :k] - d[:k, k:] @ solved - solved.T @ d[k:, :k] + solved.T @ d[k:, k:] @ solved for d in d_full])
    small = reduce_network(network, numbers, gone)
    got, d_got = laplacian(kept, small.conductors, len(paths))
    rows = [n in small.nodes for n in kept]  # conductors between two boundaries are dropped: compare the rows of unknown nodes
    scale = np.abs(full).max()
    np.testing.assert_allclose(
        got[rows][:, rows] - np.diag(np.diag(got)[rows]), wanted[rows][:, rows] - np.diag(np.diag(wanted)[rows]), atol=1e-13 * scale
    )
    np.testing.assert_allclose(got[rows], wanted[rows], atol=1e-13 * scale)
    np.testing.assert_allclose(d_got[:, rows], d_wanted[:, rows], atol=1e-11 * (1 + np.abs(d_wanted).max()))
    # massless temperatures from the rest, in the order in which they can be computed
    temperatures = dict(zip(kept, np.random.default_rng(seed).uniform(250, 350, k), strict=True))
    for node, weights in small.recover:
        temperatures[node] = sum(value_of(w) * temperatures[n] for n, w in weights.items())
    np.testing.assert_allclose([temperatures[n] for n in gone], -solved @ [temperatures[n] for n in kept], rtol=1e-12)


def chain(*conductances: str, **more: Any) -> Model:
    """case - m1 - m2 - ... - air, massless between."""
    names = ["case", *(f"m{k}" for k in range(1, len(conductances))), "air"]
    return model_from_dict(
        {
            "title": "Chain",
            "needs": ["air"],
            "nodes": {"case": {"capacitance": "10 [J/K]"}} | {n: {} for n in names[1:-1]},
            "conductors": {
                f"g{k}": {"kind": "conduction", "between": [a, b], "conductance": g}
                for k, (a, b, g) in enumerate(zip(names, names[1:], conductances, strict=False))
            },
        }
        | more
    )


def test_chain_of_massless_nodes_is_resistances_in_series() -> None:
    network = compile_network(chain("1 [W/K]", "2 [W/K]", "4 [W/K]", "8 [W/K]"))
    small = reduced(network, network.numbers())
    assert small.nodes == ("case",)
    (row,) = small.conductors
    assert row.ends == ("case", "air")
    assert value_of(row.coefficients[0]) == pytest.approx(1 / (1 + 0.5 + 0.25 + 0.125), rel=1e-15)
    temperatures = {"case": 330.0, "air": 300.0}
    for node, weights in small.recover:
        temperatures[node] = sum(value_of(w) * temperatures[n] for n, w in weights.items())
    flow = 30.0 * value_of(row.coefficients[0])
    assert temperatures["m1"] == pytest.approx(330 - flow, rel=1e-14)
    assert temperatures["m3"] == pytest.approx(300 + flow / 8, rel=1e-14)


def test_a_cut_chain_carries_nothing_in_finite_numbers() -> None:
    network = compile_network(chain("1 [W/K]", "0 [W/K]", "4 [W/K]"))
    (row,) = reduced(network, network.numbers()).conductors
    assert value_of(row.coefficients[0]) == 0.0


def test_a_massless_node_without_conductance() -> None:
    network = compile_network(chain("1 [W/K]", "0 [W/K]", "0 [W/K]", "1 [W/K]"))
    with raises_code("model.massless-undefined", DeckError, match=r"nodes\.m2.*'m2'"):
        reduced(network, network.numbers())


def test_two_massless_nodes_joined_to_each_other_only() -> None:
    network = compile_network(chain("0 [W/K]", "1 [W/K]", "0 [W/K]"))
    with raises_code("model.massless-undefined", DeckError, match="'m2'"):
        reduced(network, network.numbers())


def test_what_is_left_to_the_kernel() -> None:
    model = chain(
        "1 [W/K]",
        "1 [W/K]",
        "1 [W/K]",
        "1 [W/K]",
        loads={"q": {"into": "m1", "power": "1 [W]"}},
    )
    curved = {"kind": "radiation", "between": ["m3", "air"], "emissivity": 0.1, "area": "1 [m^2]"}
    model = model_from_dict(_with(model, curved))
    numbers = compile_network(model).numbers()
    assert eliminable(numbers) == ("m2",)
    assert eliminable(numbers, frozenset({"m2"})) == ()


def _with(model: Model, conductor: dict[str, Any]) -> dict[str, Any]:
    from thermid.model._tree.identity import to_dict

    data = to_dict(model)
    data["conductors"]["curved"] = conductor
    return data


def test_two_needs_bound_to_one_massless_node() -> None:
    """A conductor of the part then has both ends at one node; it carries nothing."""
    part = model_from_dict(
        {
            "title": "Part",
            "needs": ["left", "right"],
            "nodes": {"case": {"capacitance": "1 [J/K]"}},
            "conductors": {
                "across": {"kind": "conduction", "between": ["left", "right"], "conductance": "9 [W/K]"},
                "out": {"kind": "conduction", "between": ["case", "left"], "conductance": "2 [W/K]"},
            },
        }
    )
    whole = model_from_dict(
        {
            "title": "Whole",
            "needs": ["air"],
            "nodes": {"star": {}},
            "submodels": {"p": {"use": part, "bind": {"left": "star", "right": "star"}}},
            "conductors": {"c": {"kind": "conduction", "between": ["star", "air"], "conductance": "2 [W/K]"}},
        }
    )
    network = compile_network(whole)
    (row,) = reduced(network, network.numbers()).conductors
    assert value_of(row.coefficients[0]) == 1.0


def test_nothing_to_eliminate() -> None:
    network = compile_network(chain("1 [W/K]"))
    numbers = network.numbers()
    small = reduced(network, numbers)
    assert small.conductors is numbers.conductors
    assert small.recover == ()
