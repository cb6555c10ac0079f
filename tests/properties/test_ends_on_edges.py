"""Runs that end exactly on the edge of a pulse: last sample and extremes are those before the edge, as by an independent solution."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import thermid as td

STEFAN = 5.670374419e-8
PERIOD = 600.0
NEAR = 1e-3
"""What is allowed beside Radau. [K]"""
SPACED = np.linspace(0.0, 1.0, 250) ** 3
"""Instants at which the oracle looks for extremes, as shares of a piece: dense where fast nodes turn."""


class Network:
    """A random network of masses and nodes without mass, with a pulsed power and a boundary that is held in steps, up to an edge of both.

    Parameters
    ----------
    seed : int
    """

    def __init__(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        self.masses = rng.uniform(5.0, 200.0, int(rng.integers(1, 4)))
        self.size = self.masses.size + int(rng.integers(1, 4))
        ends = [(i, int(rng.integers(0, i))) for i in range(1, self.size)] + [(int(rng.integers(0, self.size)), -1) for _ in range(2)]
        self.links = [(a, b, float(rng.uniform(0.1, 2.0)), bool(rng.random() < 0.3)) for a, b in ends]
        self.duty, self.watts = float(rng.uniform(0.1, 0.9)), float(rng.uniform(2.0, 20.0))
        self.into = int(rng.integers(0, self.size))
        edges = [k * PERIOD + share for k in range(3) for share in (0.0, self.duty * PERIOD)]
        self.end = float(rng.choice(edges[2:]))
        self.levels = rng.uniform(270.0, 320.0, 8)
        self.steps = np.array([e for e in edges if e <= self.end])  # the boundary changes at every edge, the last one too

    def power(self, time: float) -> float:
        return self.watts if (time % PERIOD) < self.duty * PERIOD else 0.0

    def air(self, time: float) -> float:
        return float(self.levels[np.searchsorted(self.steps, time, side="right") - 1])

    def heat(self, t: np.ndarray, watts: float, air: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the heat into every node (nodes,) [W], and its derivatives (nodes, nodes). [W/K]"""
        out, moves = np.zeros(self.size), np.zeros((self.size, self.size))
        out[self.into] += watts
        for a, b, g, radiates in self.links:
            other = air if b < 0 else t[b]
            k = 0.05 * g * STEFAN
            flow = k * (other**4 - t[a] ** 4) if radiates else g * (other - t[a])
            of_a, of_b = (4.0 * k * t[a] ** 3, 4.0 * k * other**3) if radiates else (g, g)
            out[a] += flow
            moves[a, a] -= of_a
            if b >= 0:
                out[b] -= flow
                moves[a, b] += of_b
                moves[b, a] += of_a
                moves[b, b] -= of_b
        return out, moves

    def whole(self, massive: np.ndarray, watts: float, air: float) -> np.ndarray:
        """Return all temperatures, those without mass balanced by Newton's method. [K]"""
        n = self.masses.size
        t = np.concatenate([massive, np.full(self.size - n, 300.0)])
        for _ in range(50):
            out, moves = self.heat(t, watts, air)
            step = np.linalg.solve(moves[n:, n:], out[n:])
            t[n:] -= step
            if np.abs(step).max() < 1e-11:
                return t
        raise RuntimeError("the balance of nodes without mass was not found")

    def oracle(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the last temperatures (nodes,), before the edge at the end, and the lowest and highest of the run. [K]"""
        n, state = self.masses.size, np.full(self.masses.size, 300.0)
        cuts = np.unique([0.0, *self.steps, self.end])
        seen = []
        for begin, stop in pairwise(cuts.tolist()):
            watts, air = self.power(0.5 * (begin + stop)), self.air(0.5 * (begin + stop))

            def rate(_: float, y: np.ndarray, watts: float = watts, air: float = air) -> np.ndarray:
                return self.heat(self.whole(y, watts, air), watts, air)[0][:n] / self.masses

            done = solve_ivp(rate, (begin, stop), state, "Radau", begin + (stop - begin) * SPACED, rtol=1e-9, atol=1e-8)
            seen += [self.whole(y, watts, air) for y in done.y.T]
            state = done.y[:, -1]
        every = np.array(seen)
        return every[-1], every.min(axis=0), every.max(axis=0)

    def model(self) -> td.Model:
        name = [f"n{i}" for i in range(self.size)]
        conductors: dict[str, Any] = {}
        for k, (a, b, g, radiates) in enumerate(self.links):
            kind = {"kind": "radiation", "area": f"{0.05 * g!r} [m^2]", "exchange_factor": 1} if radiates else {"kind": "conduction"}
            more = {} if radiates else {"conductance": f"{g!r} [W/K]"}
            conductors[f"c{k}"] = {**kind, **more, "between": [name[a], name[b] if b >= 0 else "air"]}
        return td.model_from_dict(
            {
                "title": "edges",
                "needs": ["air"],
                "nodes": {
                    name[i]: {"capacitance": f"{float(self.masses[i])!r} [J/K]"} if i < self.masses.size else {} for i in range(self.size)
                },
                "conductors": conductors,
                "loads": {
                    "pulsed": {
                        "into": name[self.into],
                        "power": f"{self.watts!r} [W]",
                        "periodic": {"period": f"{PERIOD!r} [s]", "duty": self.duty},
                    }
                },
            }
        )

    def scenario(self) -> td.Scenario:
        values = self.levels[: self.steps.size]
        table = {"times": [f"{t!r} [s]" for t in self.steps.tolist()], "values": [f"{v!r} [K]" for v in values.tolist()], "hold": True}
        return td.Scenario("ends on an edge", boundaries={"air": table}, start="300 [K]", duration=self.end)


def check(seed: int) -> None:
    """Compare single runs by every method, and members of an ensemble, with the oracle."""
    net = Network(seed)
    last, lowest, highest = net.oracle()
    for method in ("auto", "integrator", "TR-BDF2"):
        run = td.simulate(net.model(), net.scenario(), options=td.Options(error=2e-4, method=method))
        for i in range(net.size):
            trace = run[f"n{i}"]
            assert trace.kelvin[-1] == pytest.approx(last[i], abs=NEAR), (seed, method, i)
            assert trace.lowest + 273.15 == pytest.approx(lowest[i], abs=NEAR), (seed, method, i, "lowest")
            assert trace.highest + 273.15 == pytest.approx(highest[i], abs=NEAR), (seed, method, i, "highest")
        before = net.air(0.5 * (net.steps[-1] + net.steps[-2]))
        assert run["air"].kelvin[-1] == pytest.approx(before)
    names = [f"n{i}" for i in range(net.size)]
    many = td.ensemble(net.model(), net.scenario(), {"pulsed.power": [net.watts, net.watts]}, every=net.end / 7.0, nodes=names)
    for i in range(net.size):
        assert many.temperatures(f"n{i}")[-1] == pytest.approx(last[i], abs=NEAR), (seed, "ensemble", i)
        ends = np.column_stack([many.lowest(f"n{i}"), many.highest(f"n{i}")]) + 273.15
        assert ends == pytest.approx(np.tile([lowest[i], highest[i]], (2, 1)), abs=NEAR), (seed, "ensemble", i, "extremes")


@pytest.mark.parametrize("seed", [*range(4), 33427])
def test_the_last_sample_is_the_one_before_the_edge(seed: int) -> None:
    check(seed)


@pytest.mark.campaign
def test_five_hundred_networks_that_end_on_an_edge() -> None:
    for seed in range(500):
        check(seed)


def test_a_block_ends_before_the_edge() -> None:
    block = td.Block(("0.1 [m]",) * 3, (3, 3, 3), "15 [W/(m K)]", "3900 [kg/m^3]", "1000 [J/(kg K)]")
    block = block.exchanging("all", "air", htc="5 [W/(m^2 K)]").heated("pad", "0 [W]", box=(("0 [m]", "0.04 [m]"),) * 3)
    pulse = {"times": ["0 [s]", "600 [s]"], "values": ["3 [W]", "0 [W]"], "hold": True}
    bench = td.Scenario("edge", boundaries={"air": "300 [K]"}, loads={"pad": pulse}, start="300 [K]", duration=600.0)
    assert td.simulate(block, bench).load_powers["pad"][-1] == 3.0


@pytest.mark.parametrize("method", ["RKC2", "TR-BDF2"])
def test_a_node_without_mass_follows_every_knot_of_a_log(method: str) -> None:
    """Eliminated, it is a share of a room that is logged with noise: its extremes are those of the integrator of small networks."""
    rng = np.random.default_rng(3)
    times = np.arange(0.0, 3600.0, 2.0)
    air = (times, td.quantity(295.0 + rng.normal(0.0, 1.0, times.size), unit="K"))
    links = {"in": ["mass", "film"], "out": ["film", "air"]}
    deck = {
        "title": "film",
        "needs": ["air"],
        "nodes": {"mass": {"capacitance": "300 [J/K]"}, "film": {}},
        "conductors": {name: {"kind": "conduction", "between": ends, "conductance": "1 [W/K]"} for name, ends in links.items()},
    }
    bench = td.Scenario("noisy", boundaries={"air": air}, start="310 [K]", duration=3598.0)
    small, large = (td.simulate(td.model_from_dict(deck), bench, options=td.Options(method=m))["film"] for m in ("integrator", method))
    assert large.turnings is not None
    assert (large.lowest, large.highest) == pytest.approx((small.lowest, small.highest), abs=NEAR)
