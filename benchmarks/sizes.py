"""Processor time of large networks with a stream or thermostats, and of fits with many parameters: ``python benchmarks/sizes.py``.

A cube of equal nodes joined to their neighbours, its outer face to the air, in one process; the smallest of some runs, compilation apart.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from typing import Any

import numpy as np

import thermid as td

DAY = td.Scenario("day", boundaries={"air": "20 [degC]"}, start="20 [degC]", duration="24 [h]")


def cube(side: tuple[int, int, int], heaters: int = 0, stream: int = 0, groups: int = 0) -> dict[str, Any]:
    """Return the deck of a cube: heaters with thermostats, a stream through a row of nodes, conductances in groups that share a factor."""
    rng = np.random.default_rng(4)
    places = [(x, y, z) for x in range(side[0]) for y in range(side[1]) for z in range(side[2])]
    name = {p: f"n{k}" for k, p in enumerate(places)}
    conductors: dict[str, Any] = {}
    for p in places:
        for axis in range(3):
            q = (p[0] + (axis == 0), p[1] + (axis == 1), p[2] + (axis == 2))
            if q in name:
                factor = f"g{len(conductors) % groups}*" if groups else ""
                value = f"{factor}{float(rng.uniform(0.3, 0.8))!r} [W/K]"
                conductors[f"c{len(conductors)}"] = {"kind": "conduction", "between": [name[p], name[q]], "conductance": value}
        if p[0] == 0:
            conductors[f"s{name[p]}"] = {"kind": "conduction", "between": [name[p], "air"], "conductance": "0.2 [W/K]"}
    deck: dict[str, Any] = {
        "title": f"cube of {len(places)}",
        "needs": ["air"],
        "nodes": {n: {"capacitance": f"{float(rng.uniform(5.0, 15.0))!r} [J/K]"} for n in name.values()},
        "conductors": conductors,
        "loads": {f"q{k}": {"into": f"n{n}", "power": "3 [W]"} for k, n in enumerate(rng.permutation(len(places))[:20])},
        "parameters": {f"g{k}": {"value": 1.0, "min": 0.3, "max": 3.0} for k in range(groups)},
    }
    for k, n in enumerate(rng.permutation(len(places))[:heaters]):
        limits = {"on_below": f"{25.0 + 0.2 * k} [degC]", "off_above": f"{29.0 + 0.2 * k} [degC]"}
        deck["loads"][f"h{k}"] = {"into": f"n{n}", "power": "6 [W]", "thermostat": limits}
    if stream:
        row = [f"n{k}" for k in range(0, stream)]
        deck["nodes"] |= {f"w{k}": {"capacitance": "4 [J/K]"} for k in range(stream)}
        for k, n in enumerate(row):
            conductors[f"film{k}"] = {"kind": "conduction", "between": [f"w{k}", n], "conductance": "0.5 [W/K]"}
            conductors[f"flow{k}"] = {
                "kind": "flow",
                "between": [f"w{k - 1}" if k else "air", f"w{k}"],
                "mass_flow": "4 [g/s]",
                "fluid": "air",
            }
    return deck


def cpu(work: Callable[[], Any], runs: int) -> tuple[float, Any]:
    """Return the least processor time of some runs [s], and what the last gave."""
    taken = []
    for _ in range(runs):
        begun = time.process_time()
        out = work()
        taken.append(time.process_time() - begun)
    return min(taken), out


def run_of(deck: dict[str, Any], runs: int = 3) -> None:
    """Print what a run over a day takes."""
    ready = td.prepare(td.model_from_dict(deck), DAY, every="10 [min]")
    seconds, run = cpu(ready.run, runs)
    told = run.statistics
    print(f"{deck['title']}: {seconds:.3f} s, {told['method']}, {told['steps']} steps, {len(told['switchings'])} switchings", flush=True)


def fit_of(side: tuple[int, int, int], groups: int, sensors: int) -> None:
    """Print what a fit of factors to logs of some nodes takes, and how far it ends from the truth, in standard errors."""
    model, rng = td.model_from_dict(cube(side, groups=groups)), np.random.default_rng(2)
    truth = {f"g{k}": float(v) for k, v in enumerate(rng.uniform(0.7, 1.4, groups))}
    times = np.arange(0.0, 7200.0, 60.0)
    lab = DAY.with_(duration="7140 [s]")
    run = td.simulate(model.with_values({n: f"{v!r}" for n, v in truth.items()}), lab, times=times)
    chosen = [f"n{k}" for k in rng.permutation(int(np.prod(side)))[:sensors]]
    noise = {n: rng.normal(0.0, 0.02, times.size) for n in chosen}
    channels = {n: td.Channel.from_array(n, run[n].celsius + noise[n], unit="degC", target=n, noise="0.02 [K]") for n in chosen}
    channels["air"] = td.Channel.from_array("air", td.celsius(np.full(times.size, 20.0)), role="boundary", target="air")
    record = td.Record.from_arrays("lab", times, channels)
    seconds, fit = cpu(lambda: td.calibrate(model, record, list(truth)), 1)
    off = [(fit.values[n].value - v) / fit.values[n].error for n, v in truth.items()]
    words = f"RMS of errors over standard errors {np.sqrt(np.mean(np.square(off))):.2f}, largest {np.abs(off).max():.2f}"
    print(f"fit of {np.prod(side)} nodes, {groups} factors, {sensors} sensors: {seconds:.2f} s, {fit.evaluations} evaluations, {words}")


if __name__ == "__main__":
    wanted = sys.argv[1:] or ["stream", "thermostats", "fit343", "fit1000"]
    if "stream" in wanted:
        run_of(cube((10, 10, 10)))
        run_of(cube((10, 10, 10), stream=20))
    if "thermostats" in wanted:
        run_of(cube((16, 8, 8), heaters=20))
    if "fit343" in wanted:
        fit_of((7, 7, 7), 10, 10)
    if "fit1000" in wanted:
        fit_of((10, 10, 10), 30, 20)
