"""B7: networks of 27 to 10,000 nodes at a stated error, beside CVODE (BDF, sparse direct) on the same equations written in numpy.

Three families: grids of similar nodes; the same with every tenth heat capacity 1e-3 or 1e-5 of the others; and dense radiation from 250 to
700 K, of a grid, of an enclosure of 60 faces, and of a unit of the size of a public deck. thermid is told the error and nothing else; a
method of its own that is forced, and CVODE, have their cheapest setting that is right. ``python benchmarks/run.py B7 --sizes 343 512``.
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
PLOT = (
    ("similar", 27),
    ("similar", 343),
    ("similar, a plate", 10_000),
    ("unequal", 125),
    ("unequal", 1000),
    ("radiating", 343),
    ("radiating, an enclosure", 60),
    ("radiating, as a public deck", 127),
)
QUICK = (("similar", 64), ("unequal", 64), ("radiating, an enclosure", 60))
ERRORS = (3e-3, 3e-4, 1e-5)
TIMES = np.linspace(0.0, 3600.0, 61)
AIR = 290.0
FORCED = ("integrator", "RKC2", "TR-BDF2")
LOOSER = tuple(2.0**k for k in range(5, -7, -1))
"""Settings that are tried, from cheap to tight, in parts of the error."""
SLOW = 3.0
"""A way that takes so many times as long as thermid at a setting that is not right yet is left out. [-]"""
PATIENCE = 1.0
"""Time after which a way is not repeated. [s]"""
MOST_INTEGRATED = 5000
"""Nodes that thermid's integrator takes. [-]"""
LINKS, PAIRS = 303, 2217
"""Rows of the public deck (bpar907/APSS-2-Thermal-TXRX) whose size the last network has."""


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
    rng, shape = np.random.default_rng(7), family.partition(", ")[2]
    k = round(nodes ** (1 / 2 if shape == "a plate" else 1 / 3))
    place = np.arange(k**2).reshape(k, k, 1) if shape == "a plate" else np.arange(k**3).reshape(k, k, k)
    if shape.endswith(("enclosure", "deck")):
        place = np.arange(nodes).reshape(nodes, 1, 1)
    n = air = place.size
    inner = [(place[:-1], place[1:]), (place[:, :-1], place[:, 1:]), (place[..., :-1], place[..., 1:])]
    faces = np.concatenate((place[0].ravel(), place[-1].ravel()))
    links = np.concatenate(
        [np.column_stack((p.ravel(), q.ravel())) for p, q in inner] + [np.column_stack((faces, np.full(faces.size, air)))]
    )
    if shape == "as a public deck":
        links = np.concatenate((links, rng.permuted(np.tile(np.arange(n), (LINKS - len(links), 1)), axis=1)[:, :2]))
    conductance = np.where(links[:, 1] < n, rng.uniform(0.5, 2.0, len(links)), rng.uniform(0.05, 0.2, len(links)))
    capacity = rng.uniform(20.0, 80.0, n)
    if family == "unequal":
        capacity[::20] *= 1e-3
        capacity[10::20] *= 1e-5
    power = np.zeros(n)
    power[rng.choice(n, max(2, n // 40), replace=False)] = rng.uniform(2.0, 8.0, max(2, n // 40))
    top = place[..., 0].ravel()
    seen = np.column_stack((top, np.full(top.size, air)))
    hot = family.startswith("radiating")
    if hot:
        every = np.column_stack(np.triu_indices(n, 1))
        few = {"": 6 * n, "as a public deck": PAIRS - len(seen)}
        seen = np.concatenate((seen, rng.permutation(every)[: few.get(shape)]))
    start = rng.uniform(250.0, 700.0, n) if hot else np.full(n, 300.0)
    exchange = STEFAN_BOLTZMANN * rng.uniform(1e-3, 8e-3, len(seen))
    return Grid(capacity, power, start, links, conductance, seen, exchange)


def run(options: Namespace) -> list[dict[str, Any]]:
    """Return what each network took at each error."""
    sizes = options.sizes and [(family, n) for family in ("similar", "unequal", "radiating") for n in options.sizes]
    found, ratios = [], []
    for family, nodes in sizes or (QUICK if options.quick else PLOT):
        case = grid(family, nodes)
        right = case.cvode(1e-12)()
        rows = [row for error in ERRORS for row in at_error(case, error, right, options.rounds)]
        told = [row["ratio"] for row in rows if row["name"] == "thermid"]
        ratios += told
        doubt = float(np.abs(case.cvode(1e-11)() - right).max())
        words = [f"stating the error costs {max(told):.3g} times the best way at most", f"reference within about {doubt:.0e} K"]
        part = f"{family}, {case.capacity.size} nodes"
        found.append({"work": f"B7, {part}", "part": part, "results": rows, "remarks": words, "missing": {}, "versions": versions()})
    found[-1]["remarks"] += [
        f"of all {len(ratios)}: {np.median(ratios):.3g} times the best way in the median, {max(ratios):.3g} at most (asked: 1.5 and 2.5)"
    ]
    return found


def at_error(case: Grid, error: float, right: Array, rounds: int) -> list[dict[str, Any]]:
    """Return a row of each contestant at one error; `ratio` is to the best of all that are right."""
    ways: dict[str, tuple[tuple[float, ...], Callable[[float], Callable[[], Array]]]] = {
        "thermid": ((1.0,), lambda part: _own(case, "auto", part * error)),
        **{f"thermid, {way}": (LOOSER, lambda part, way=way: _own(case, way, part * error)) for way in FORCED},  # type: ignore[misc]
        "CVODE": (LOOSER, lambda part: case.cvode(part * error / 300.0)),
    }
    entries: list[dict[str, Any]] = []
    for name, (parts, make) in ways.items():
        if "integrator" in name and case.capacity.size > MOST_INTEGRATED:
            continue
        entry = _cheapest(parts, make, error, right, SLOW * entries[0]["cpu_seconds"] if entries else np.inf)
        entries.append({"name": name, **entry})
    racing = [e for e in entries if e["right"] or e["name"] == "thermid"]
    for _ in range(rounds):
        for entry in racing:
            if entry["spent"] > PATIENCE:
                continue
            wall, cpu, _ = timed(entry["solve"])
            entry["seconds"], entry["cpu_seconds"] = min(wall, entry["seconds"]), min(cpu, entry["cpu_seconds"])
            entry["spent"] += cpu
    best = min((e["cpu_seconds"] for e in racing if e["right"]), default=np.nan)
    return [
        {k: v for k, v in e.items() if k not in ("solve", "spent", "part")}
        | {"setting": f"{e['part']:g} of {error:g} K", "ratio": e["cpu_seconds"] / best}
        for e in entries
    ]


def _own(case: Grid, method: str, error: float) -> Callable[[], Array]:
    names = [f"n{i}" for i in range(case.capacity.size)]
    ready = td.prepare(case.model, case.scenario, times=TIMES, options=td.Options(error=error, method=method, extremes=False))
    answer = ready.run()
    columns = [answer.nodes.index(n) for n in names]
    return lambda: np.asarray(ready.run().temperatures)[:, columns]


def _cheapest(
    parts: tuple[float, ...], make: Callable[[float], Callable[[], Array]], error: float, right: Array, most: float
) -> dict[str, Any]:
    """Return the first setting that is right, from cheap to tight, with its first time; of those tried the last where none is."""
    for part in parts:
        solve = make(part)
        wall, cpu, kelvin = timed(solve)
        off = float(np.abs(kelvin - right).max())
        if off <= error or cpu > most:
            break
    return {"part": part, "solve": solve, "spent": cpu, "seconds": wall, "cpu_seconds": cpu, "max_error_K": off, "right": off <= error}
