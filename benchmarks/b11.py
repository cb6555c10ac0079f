"""B11: memory of 1e4 and 1e5 members of 20 nodes over a day (145 times, three quantiles), counted and, as the peer, with every trace kept.

Each in a process of its own; memory is beside what the process held before. ``python benchmarks/run.py B11 --sizes 1000 10000``.
"""

from __future__ import annotations

import json
import sys
from argparse import Namespace
from typing import Any

from fresh import fresh, peak
from machine import versions

SIZES, QUICK, NODES = (10_000, 100_000), (2_000,), 20
SHARES = (0.05, 0.5, 0.95)
WAYS = {
    "thermid": "ensemble, counted",
    "thermid, traces": "ensemble, every trace kept",
    "thermid, runs": "uncertain_runs and hold, counted",
}
KEPT = 20_000
"""Members up to which every trace is kept: more need tens of gigabytes."""
MOST = 300.0
"""Memory of a million members. [MB]"""


def run(options: Namespace) -> list[dict[str, Any]]:
    """Return time and memory of many members, in each way."""
    found = []
    for members in options.sizes or (QUICK if options.quick else SIZES):
        rows = [_row(way, fresh(__file__, members, place)) for place, way in enumerate(WAYS) if way != "thermid, traces" or members <= KEPT]
        for row in rows:
            row["ratio"] = row["cpu_seconds"] / rows[0]["cpu_seconds"]
        if len(rows) == len(WAYS):
            half_a_bin, apart = rows[0].pop("half_a_bin"), abs(rows[0]["quantile"] - rows[1]["quantile"])
            rows[0]["right"] = apart <= half_a_bin * (1.0 + 1e-9)
            rows[0]["columns"]["quantile from that of traces"] = f"{1e3 * apart:.2f} mK, half a bin {1e3 * half_a_bin:.2f} mK"
        work = f"B11, {members} members of {NODES} nodes, 145 times"
        found.append({"work": work, "part": str(members), "results": rows, "missing": {}, "versions": versions()})
    return found


def _row(way: str, found: dict[str, Any]) -> dict[str, Any]:
    right = {"right": found["MB"] <= MOST} if way != "thermid, traces" else {}
    return {"name": way, "setting": WAYS[way], **found, **right, "columns": {"memory": f"{found['MB']:.0f} MB"}}


def _worker(members: int, way: int) -> dict[str, Any]:
    """Return time, memory and a quantile."""
    from contest import timed

    import thermid as td

    ties = {f"link{k}": {"kind": "conduction", "between": [f"n{k}", f"n{k + 1}"], "conductance": "0.5 [W/K]"} for k in range(NODES - 1)}
    skin = {"skin": {"kind": "conduction", "between": ["n0", "air"], "conductance": "0.3 [W/K]"}}
    model = td.model_from_dict(
        {
            "title": "chain",
            "needs": ["air"],
            "nodes": {f"n{k}": {"capacitance": "100 [J/K]"} for k in range(NODES)},
            "conductors": ties | skin,
            "loads": {"heat": {"into": f"n{NODES - 1}", "power": "2 [W]"}},
        }
    )
    day = td.Scenario("day", boundaries={"air": "293 [K]"}, start="293 [K]", duration="24 [h]")
    spread = {"skin.conductance": "10 [%]", "n0.capacitance": "5 [%]", "air": {"sd": "1 [K]"}}
    last = f"n{NODES - 1}"
    draws = td.simulation.draw(model, day, spread, members, seed=1)
    small = {name: values[:64] for name, values in draws.items()}
    td.ensemble(model, day, small, every="10 [min]", quantiles=SHARES)  # what is loaded once
    before = peak()

    def solve() -> tuple[float, float]:
        if way == 2:
            limits = {name: None for name in model.nodes} | {last: "330 [K]"}
            runs = td.qualify.uncertain_runs(model, day, spread=spread, n=members, seed=1, nodes=limits, every="10 [min]")
            return float(runs.quantile(last, 0.95)[-1]), 0.0
        out = td.ensemble(model, day, draws, every="10 [min]", quantiles=SHARES if way == 0 else None)
        return float(out.quantile(last, 0.95)[-1]), float(out.quantile_error(last, 0.95)[-1])

    wall, cpu, (quantile, error) = timed(solve)
    return {"seconds": wall, "cpu_seconds": cpu, "MB": peak() - before, "quantile": quantile, "half_a_bin": error}


if __name__ == "__main__":
    print(json.dumps(_worker(int(sys.argv[1]), int(sys.argv[2]))))
