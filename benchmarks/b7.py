"""B7: networks of 100 to 1,000 nodes at a stated error, beside CVODE (BDF, sparse direct) on the same equations written in numpy.

Three families: a grid of similar nodes; the same with every tenth heat capacity 1e-3 or 1e-5 of the others; a grid whose nodes see many
others by radiation, from 250 to 700 K. thermid is told the error and nothing else; a method of its own that is forced, and CVODE, have
their cheapest setting that is right. ``python benchmarks/run.py B7 --sizes 343 512``.
"""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from contest import timed
from machine import versions
from numpy.typing import NDArray
from scipy import sparse

import thermid as td

Array = NDArray[Any]
STEFAN_BOLTZMANN = 5.670374419e-8
FAMILIES = ("similar", "unequal", "radiating")
SIZES, QUICK = (125, 343, 1000), (64,)
ERRORS = (3e-3, 3e-4, 1e-5)
TIMES = np.linspace(0.0, 3600.0, 61)
AIR = 290.0
FORCED = ("integrator", "RKC2", "TR-BDF2")
LOOSER = (30.0, 10.0, 3.0, 1.0, 0.3, 0.1)
"""Settings that are tried, from cheap to tight, in parts of the error."""
SLOW = 5.0
"""A forced method whose first setting takes longer is left out. [s]"""


@dataclass(frozen=True, eq=False)
class Grid:
    """A network as arrays; the last node of a link may be the room, whose place is the number of nodes.

    Parameters
    ----------
    capacity, power : array (nodes,)        [J/K], [W]
    start : array (nodes,)                  [K]
    links : array (links, 2), conductance : array (links,)      [W/K]
    seen : array (pairs, 2), exchange : array (pairs,)          Radiation: heat is exchange (Ta^4 - Tb^4). [W/K^4]
    """

    capacity: Array
    power: Array
    start: Array
    links: Array
    conductance: Array
    seen: Array
    exchange: Array

    @cached_property
    def model(self) -> td.Model:
        """The same as a deck."""
        n = self.capacity.size

        def name(i: int) -> str:
            return f"n{i}" if i < n else "air"

        conductors: dict[str, Any] = {
            f"c{k}": {"kind": "conduction", "between": [name(a), name(b)], "conductance": f"{g!r} [W/K]"}
            for k, ((a, b), g) in enumerate(zip(self.links.tolist(), self.conductance.tolist(), strict=True))
        }
        for k, ((a, b), e) in enumerate(zip(self.seen.tolist(), self.exchange.tolist(), strict=True)):
            area = f"{e / STEFAN_BOLTZMANN!r} [m^2]"
            conductors[f"r{k}"] = {"kind": "radiation", "between": [name(a), name(b)], "exchange_factor": 1.0, "area": area}
        nodes = {f"n{i}": {"capacitance": f"{c!r} [J/K]"} for i, c in enumerate(self.capacity.tolist())}
        loads = {f"q{i}": {"into": f"n{i}", "power": f"{p!r} [W]"} for i, p in enumerate(self.power.tolist()) if p}
        return td.model_from_dict({"title": "grid", "needs": ["air"], "nodes": nodes, "conductors": conductors, "loads": loads})

    @cached_property
    def scenario(self) -> td.Scenario:
        """An hour in a constant room."""
        initial = {f"n{i}": td.quantity(t, unit="K") for i, t in enumerate(self.start.tolist())}
        return td.Scenario("hour", boundaries={"air": f"{AIR} [K]"}, start=f"{AIR} [K]", initial=initial, duration=float(TIMES[-1]))

    def cvode(self, rtol: float) -> Callable[[], Array]:
        """Return what solves it by CVODE: temperatures (times, nodes). [K]"""
        from sksundae.cvode import CVODE

        n, (a, b), (ra, rb) = self.capacity.size, self.links.T, self.seen.T
        rows = np.concatenate((a, b, a, b, ra, rb, ra, rb))
        columns = np.concatenate((a, b, b, a, ra, rb, rb, ra))
        inside = (rows < n) & (columns < n)
        pattern = sparse.csc_matrix((np.ones(int(inside.sum())), (rows[inside], columns[inside])), shape=(n, n))
        pattern.sort_indices()
        order = sparse.csc_matrix((np.arange(1, pattern.nnz + 1), pattern.indices, pattern.indptr), shape=(n, n))
        place = np.asarray(order[rows[inside], columns[inside]]).ravel() - 1
        inverse, extended = 1.0 / self.capacity, np.full(n + 1, AIR)

        def rate(_: float, y: Array, out: Array) -> None:
            extended[:n] = y
            q = self.conductance * (extended[a] - extended[b])
            r = self.exchange * (extended[ra] ** 4 - extended[rb] ** 4)
            ends, heat = np.concatenate((b, a, rb, ra)), np.concatenate((q, -q, r, -r))
            out[:] = (self.power + np.bincount(ends, heat, n + 1)[:n]) * inverse

        def jacobian(_: float, y: Array, __: Array, out: Array) -> None:
            extended[:n] = y
            g, da, db = self.conductance, 4.0 * self.exchange * extended[ra] ** 3, 4.0 * self.exchange * extended[rb] ** 3
            values = np.concatenate((-g, -g, g, g, -da, -db, db, da))[inside] * inverse[rows[inside]]
            out[:] = np.bincount(place, values, pattern.nnz)

        solver = CVODE(
            rate, rtol=rtol, atol=rtol, linsolver="sparse", sparsity=pattern, jacfn=jacobian, max_num_steps=100_000, method="BDF"
        )
        return lambda: np.asarray(solver.solve(TIMES, self.start).y)


def grid(family: str, nodes: int) -> Grid:
    """Return a member of a family with about so many nodes."""
    rng, k = np.random.default_rng(7), round(nodes ** (1 / 3))
    place = np.arange(k**3).reshape(k, k, k)
    n, air = k**3, k**3
    inner = [(place[:-1], place[1:]), (place[:, :-1], place[:, 1:]), (place[..., :-1], place[..., 1:])]
    faces = np.concatenate((place[0].ravel(), place[-1].ravel()))
    links = np.concatenate(
        [np.column_stack((p.ravel(), q.ravel())) for p, q in inner] + [np.column_stack((faces, np.full(faces.size, air)))]
    )
    conductance = np.where(links[:, 1] < n, rng.uniform(0.5, 2.0, len(links)), rng.uniform(0.05, 0.2, len(links)))
    capacity = rng.uniform(20.0, 80.0, n)
    if family == "unequal":
        capacity[::20] *= 1e-3
        capacity[10::20] *= 1e-5
    power = np.zeros(n)
    power[rng.choice(n, max(2, n // 40), replace=False)] = rng.uniform(2.0, 8.0, max(2, n // 40))
    top = place[..., 0].ravel()
    seen = np.column_stack((top, np.full(top.size, air)))
    if family == "radiating":
        pairs = rng.integers(0, n, (6 * n, 2))
        seen = np.concatenate((seen, pairs[pairs[:, 0] != pairs[:, 1]]))
    start = rng.uniform(250.0, 700.0, n) if family == "radiating" else np.full(n, 300.0)
    exchange = STEFAN_BOLTZMANN * rng.uniform(1e-3, 8e-3, len(seen))
    return Grid(capacity, power, start, links, conductance, seen, exchange)


def run(options: Namespace) -> list[dict[str, Any]]:
    """Return what each family took at each size and error."""
    found = []
    for family in FAMILIES:
        for nodes in options.sizes or (QUICK if options.quick else SIZES):
            case = grid(family, nodes)
            right = case.cvode(1e-11)()
            rows = [row for error in ERRORS for row in _at(case, error, right, options.rounds)]
            told = [row["ratio"] for row in rows if row["name"] == "thermid"]
            words = f"stating the error costs {np.median(told):.2g} times the cheapest other way in the median, {max(told):.2g} at most"
            part = f"{family}, {case.capacity.size} nodes"
            found.append({"work": f"B7, {part}", "part": part, "results": rows, "remarks": [words], "missing": {}, "versions": versions()})
    return found


def _at(case: Grid, error: float, right: Array, rounds: int) -> list[dict[str, Any]]:
    """Return a row of each contestant at one error."""
    rows = [_cheapest("thermid", error, (1.0,), lambda e: _own(case, "auto", e), right, rounds)]
    rows += [_cheapest(f"thermid, {way}", error, LOOSER, lambda e, way=way: _own(case, way, e), right, rounds) for way in FORCED]  # type: ignore[misc]
    rows.append(_cheapest("CVODE", error, LOOSER, lambda e: case.cvode(e / 300.0), right, rounds))
    others = [row["cpu_seconds"] for row in rows[1:] if row["right"]]
    for row in rows:
        row["ratio"] = row["cpu_seconds"] / min(others, default=np.nan)
    return rows


def _own(case: Grid, method: str, error: float) -> Callable[[], Array]:
    names = [f"n{i}" for i in range(case.capacity.size)]
    ready = td.prepare(case.model, case.scenario, times=TIMES, options=td.Options(error=error, method=method, extremes=False))

    def solve() -> Array:
        answer = ready.run()
        return np.asarray(answer.temperatures)[:, [answer.nodes.index(n) for n in names]]

    return solve


def _cheapest(
    name: str, error: float, parts: tuple[float, ...], make: Callable[[float], Callable[[], Array]], right: Array, rounds: int
) -> dict[str, Any]:
    """Return the row of the first setting that is right, from cheap to tight; of the last one where none is."""
    for part in parts:
        solve = make(part * error)
        solve()
        wall, cpu, kelvin = timed(solve)
        off = float(np.abs(kelvin - right).max())
        if off <= error or cpu > SLOW:
            break
    times = [(wall, cpu), *(timed(solve)[:2] for _ in range(min(rounds, 5) if cpu < SLOW else 0))]
    return {
        "name": name,
        "setting": f"{part:g} of {error:g} K",
        "seconds": min(t[0] for t in times),
        "cpu_seconds": float(np.median([t[1] for t in times])),
        "max_error_K": off,
        "right": off <= error,
    }
