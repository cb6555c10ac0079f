"""Correlation of an imported network: 127 nodes, 2,520 conductors, 12 factors of contacts, 20 logged nodes, 0.1 K of noise.

The network is synthetic, drawn by this script to the size of a public deck of Thermal Desktop. Twenty logs with noise of their own are
fitted; for the first, a genetic algorithm and a particle swarm of pymoo minimise the same sum of squares, and every run of the network that
they ask for is counted. `python benchmarks/correlation.py [SEEDS] [EVALUATIONS]` prints the figures of docs/benchmarks.md.
"""

from __future__ import annotations

import sys
import time
from typing import Any

import numpy as np

import thermid as td
from thermid.simulation.runs import prepare

NODES, LINEAR, RADIATION, FACTORS, SENSORS, NOISE = 127, 303, 2217, 12, 20, 0.1
BOUNDS = (0.05, 20.0)
TWINS = ("twin_a", "twin_b")
"""Two factors side by side between the same nodes: no log tells them apart."""


def network(seed: int = 1) -> dict[str, Any]:
    """Return the deck: nodes in a cube, neighbours joined, contacts between slabs of it, everything radiates to everything and to space."""
    rng = np.random.default_rng(seed)
    place = rng.uniform(0.0, 1.0, (NODES - 1, 3))
    place = place[np.argsort(place[:, 0])]
    slab = np.minimum((place[:, 0] * (FACTORS + 1)).astype(int), FACTORS)
    names = [f"n{k}" for k in range(NODES - 1)]
    rows = np.triu_indices(NODES - 1, 1)
    nearest = np.argsort(np.linalg.norm(place[rows[0]] - place[rows[1]], axis=1))
    pairs = dict.fromkeys((k, k + 1) for k in range(NODES - 2))
    for k in nearest:
        if len(pairs) == LINEAR:
            break
        pairs.setdefault((int(rows[0][k]), int(rows[1][k])))
    conductors: dict[str, Any] = {}
    for k, (a, b) in enumerate(pairs):
        value = float(rng.lognormal(np.log(0.3), 0.7))
        factor = f"contact_{min(slab[a], slab[b])}*" if slab[a] != slab[b] else ""
        if k == 0:
            factor = "(twin_a + twin_b)/2*"
        conductors[f"G{k}"] = {"kind": "conduction", "between": [names[a], names[b]], "conductance": f"{factor}{value!r} [W/K]"}
    chosen = rng.permutation(rows[0].size)[: RADIATION - (NODES - 1)]
    ends = [(names[rows[0][k]], names[rows[1][k]], 2e-5) for k in chosen] + [(name, "space", 4e-4) for name in names]
    for k, (a, b, area) in enumerate(ends):
        size = float(rng.lognormal(np.log(area), 0.8))
        conductors[f"R{k}"] = {"kind": "radiation", "between": [a, b], "exchange_factor": 1, "area": f"{size!r} [m^2]"}
    powers = {
        f"q{k}": {"into": names[n], "power": f"{float(rng.uniform(0.5, 4.0))!r} [W]"} for k, n in enumerate(rng.permutation(NODES - 1)[:10])
    }
    factors = [f"contact_{k}" for k in range(FACTORS)]
    return {
        "title": "box",
        "needs": ["space"],
        "parameters": {name: {"value": 1.0, "min": BOUNDS[0], "max": BOUNDS[1]} for name in (*factors, *TWINS)},
        "nodes": {
            name: {"capacitance": f"{float(c)!r} [J/K]"} for name, c in zip(names, rng.lognormal(np.log(2.0), 1.0, NODES - 1), strict=True)
        },
        "conductors": conductors,
        "loads": powers,
    }


FREE = [f"contact_{k}" for k in range(FACTORS)]
CASE = td.Scenario("thermal vacuum", boundaries={"space": "-180 [degC]"}, start="20 [degC]", duration="2 [h]")
LOGGED = [f"n{k}" for k in np.linspace(0, NODES - 2, SENSORS).astype(int)]


def truth(seed: int) -> dict[str, float]:
    """Return the factors that made a log."""
    rng = np.random.default_rng([7, seed])
    return {name: float(np.exp(rng.normal(0.0, 0.5))) for name in FREE}


def log(model: td.Model, seed: int) -> td.Record:
    """Return the readings of a test, with noise."""
    rng = np.random.default_rng([8, seed])
    run = td.simulate(model.with_values(truth(seed)), CASE, every="60 [s]")
    channels = {
        name: td.Channel.from_array(
            name, run[name].kelvin + rng.normal(0.0, NOISE, run.times.size), unit="K", role="node", target=name, noise=NOISE
        )
        for name in LOGGED
    }
    return td.Record.from_arrays(f"log {seed}", run.times, channels)


def fits(model: td.Model, seeds: int) -> tuple[list[float], list[float], list[int]]:
    """Return errors of the factors in units of the stated ones, processor times [s] and runs of the network of every fit."""
    errors, times, runs = [], [], []
    for seed in range(seeds):
        record = log(model, seed)
        start = time.process_time()
        fit = td.calibrate(model, record, FREE, scenario=CASE)
        times.append(time.process_time() - start)
        runs.append(fit.evaluations)
        known = truth(seed)
        errors += [np.log(v.value / known[name]) * v.value / v.error for name, v in ((name, fit.values[name]) for name in FREE)]
    return errors, times, runs


def best(model: td.Model) -> float:
    """Return the sum of squares of the fit of the first log."""
    record = log(model, 0)
    return td.calibrate(model, record, FREE, scenario=CASE).reduced_chi_square * (record.times.size * SENSORS - FACTORS)


def swarm(model: td.Model, kind: str, most: int) -> tuple[float, int, float]:
    """Return the sum of squares that a search without derivatives reaches, its runs of the network, and its processor time [s]."""
    from pymoo.algorithms.soo.nonconvex.ga import GA
    from pymoo.algorithms.soo.nonconvex.pso import PSO
    from pymoo.core.problem import ElementwiseProblem
    from pymoo.optimize import minimize

    record = log(model, 0)
    readings = np.array([record[name].values for name in LOGGED])
    ready = prepare(model, CASE, tuple(FREE), every="60 [s]")

    class Fit(ElementwiseProblem):  # type: ignore[misc]
        def __init__(self) -> None:
            super().__init__(n_var=FACTORS, n_obj=1, xl=np.log(BOUNDS[0]), xu=np.log(BOUNDS[1]))

        def _evaluate(self, x: np.ndarray, out: dict[str, Any], *_: Any, **__: Any) -> None:
            run = ready.run(dict(zip(FREE, np.exp(x).tolist(), strict=True)))
            out["F"] = float((((np.array([run[name].kelvin for name in LOGGED]) - readings) / NOISE) ** 2).sum())

    start = time.process_time()
    algorithm = GA(pop_size=40) if kind == "GA" else PSO(pop_size=25)
    found = minimize(Fit(), algorithm, ("n_eval", most), seed=1, verbose=False)
    return float(found.F[0]), int(found.algorithm.evaluator.n_eval), time.process_time() - start


def main() -> None:
    """Print the table."""
    seeds, most = (int(word) for word in (*sys.argv[1:], *("20", "1000")[len(sys.argv) - 1 :]))
    model = td.model_from_dict(network())
    told = td.identifiability(model, log(model, 0), [*FREE, *TWINS], scenario=CASE)
    print("named before the fit:", *(line.strip() for line in str(told).splitlines() if any(name in line for name in TWINS)), sep="\n  ")
    errors, times, runs = fits(model, seeds)
    size = np.abs(errors)
    print(f"{seeds} logs, {size.size} factors: {np.mean(size < 1.96):.1%} within 1.96 errors, largest {size.max():.2f}")
    print(f"processor time of a fit: median {np.median(times):.1f} s, most {max(times):.1f} s")
    print(f"runs of the network in a fit: median {np.median(runs):.0f}")
    lowest = best(model)
    print(f"sum of squares of the fit: {lowest:.0f}")
    for kind in ("GA", "PSO") if most else ():
        reached, n, seconds = swarm(model, kind, most)
        print(f"{kind}: {reached:.0f} after {n} runs of the network, {seconds:.0f} s; {reached / lowest:.1f} times the fit's")


if __name__ == "__main__":
    main()
