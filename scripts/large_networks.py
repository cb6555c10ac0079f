"""What the integrator of small models takes for networks of thousands of nodes: ``python scripts/large_networks.py``, two minutes.

Plates and a cube of nodes joined by 1 W/K, one side to the air, for an hour; with derivatives, or with thermostats that keep 2 K.
"""

from __future__ import annotations

import time
from itertools import product
from typing import Any

import numpy as np

import thermid as td

CASES = (((32, 32), 10, 0), ((70, 70), 30, 0), ((32, 32), 0, 20), ((70, 70), 0, 50), ((10, 10, 10), 0, 1))
"""Nodes along each side, free conductances, thermostats."""


def network(shape: tuple[int, ...], free: int, thermostats: int) -> td.Model:
    """Return a block of nodes, whose links have the free conductances in turn."""
    rng = np.random.default_rng(0)
    places = list(product(*map(range, shape)))
    names = {place: "n" + "_".join(map(str, place)) for place in places}
    pairs = [(a, b) for a in places for k in range(len(shape)) if (b := (*a[:k], a[k] + 1, *a[k + 1 :])) in names]
    values = {f"p{k}": {"value": f"{0.5 + 0.1 * k} [W/K]", "min": 0.01, "max": 10, "source": "measured"} for k in range(free)}
    links = [(names[a], names[b], f"p{k % free}" if free else "1 [W/K]") for k, (a, b) in enumerate(pairs)]
    links += [(names[place], "air", "0.1 [W/K]") for place in places if place[0] == 0]
    hot = [names[place] for place in places[:: -(len(places) // max(thermostats, 1))]][: max(thermostats, 1)]
    loads: dict[str, dict[str, Any]] = {f"q{k}": {"into": node, "power": "20 [W]"} for k, node in enumerate(hot)}
    for load in loads.values() if thermostats else ():
        load["thermostat"] = {"sensor": load["into"], "on_below": "30 [degC]", "off_above": "32 [degC]"}
    conductors = {f"c{k}": {"kind": "conduction", "between": [a, b], "conductance": g} for k, (a, b, g) in enumerate(links)}
    nodes = {name: {"capacitance": f"{rng.uniform(5, 15):.3f} [J/K]"} for name in names.values()}
    return td.model_from_dict(
        {"title": "block", "needs": ["air"], "parameters": values, "nodes": nodes, "conductors": conductors, "loads": loads}
    )


def main() -> None:
    """Print a line a case: processor time [s], and that of a switching [ms]."""
    for shape, free, thermostats in CASES:
        length = "4 [min]" if thermostats else "1 [h]"
        scenario = td.Scenario("hour", boundaries={"air": "20 [degC]"}, start="20 [degC]", duration=length)
        ready = td.prepare(network(shape, free, thermostats), scenario, [f"p{k}" for k in range(free)])
        begun = time.process_time()
        run = ready.run(sensitivities=free > 0)
        seconds, switchings = time.process_time() - begun, len(run.statistics["switchings"])
        each = f", {switchings} switchings, {1e3 * seconds / switchings:.2g} ms each" if switchings else ""
        print(f"{np.prod(shape)} nodes {shape}, {free} derivatives, {thermostats} thermostats, {length}: {seconds:.2g} s{each}", flush=True)


if __name__ == "__main__":
    main()
