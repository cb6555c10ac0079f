"""B3: a block of 1e3 to 1e6 cells, one hour and steady state; every run in a fresh process, so that its peak of memory is its own.

At 1e3 and 1e4 cells the reference is scipy's BDF at rtol 1e-8, and scipy takes part; above, thermid at a hundredth of its tolerance, and
for steady states a Newton step by scipy from where thermid has ended.
"""

from __future__ import annotations

import json
import sys
import tempfile
from argparse import Namespace
from pathlib import Path
from typing import Any

import numpy as np
import peers
from fresh import fresh, peak

SIZES = (1_000, 10_000, 100_000, 1_000_000)
ELIMINATED = 10_000
"""Cells up to which scipy takes part; sparse elimination grows steeply on a 3-D grid."""
LIMIT = 5e-3
TOLERANCE = 3e-3
"""Error that is asked of a run. [K]"""
AGAINST = {"reference": "scipy", "tighter": "itself, tighter", "corrected": "Newton step by scipy"}
"""Who gives the reference: the last solves the equations written down again once more, from where thermid has ended."""
TARGETS = {("transient", 1_000_000): 50.0, ("steady", 1_000_000): 30.0}
BYTES = 96
"""What an evaluation with the update of its stage must move for one cell: seven arrays in or out, five for the recurrence. [B]"""


def run(options: Namespace) -> list[dict[str, Any]]:
    """Return what a transient and a steady state of every size took."""
    from machine import floor, versions

    sizes = options.sizes or (SIZES[:2] if options.quick else SIZES)
    speed = floor()["copy_GB_s"] * 1e9
    present, missing = peers.present(options.peers)
    missing |= {m.NAME: "not set up for sparse networks, as scipy is up to 1e4 cells" for m in present if m.NAME != "scipy"}
    found = []
    for work in ("transient", "steady"):
        rows = [row for nodes in sizes for row in _of_size(work, nodes, options, speed)]
        found.append(
            {"work": f"B3, {work}", "part": work, "results": rows, "remarks": [_growth(rows)], "missing": missing, "versions": versions()}
        )
    if options.plot:
        from growth import plot

        plot(found, options.plot)
    return found


def _of_size(work: str, nodes: int, options: Namespace, speed: float) -> list[dict[str, Any]]:
    with tempfile.TemporaryDirectory() as folder:
        own = fresh(__file__, "thermid", work, nodes, folder, 1 if nodes >= 100_000 or options.quick else 3)
        by_scipy = nodes <= ELIMINATED
        judge = "reference" if by_scipy else "tighter" if work == "transient" else "corrected"
        right = fresh(__file__, judge, work, nodes, folder, 1)["fields"]
        rows = [own]
        if by_scipy and "scipy" in options.peers:
            for tol in (1e-3, 1e-4, 1e-5, 1e-6) if work == "transient" else (0.0,):
                peer = fresh(__file__, "scipy", work, nodes, folder, 1, tol)
                if _error(peer, right) <= LIMIT:
                    break
            rows.append(peer)
        for row in rows:
            error = _error(row, right)
            row.pop("fields")
            row |= {"max_error_K": error, "right": error <= LIMIT, "ratio": row["cpu_seconds"] / own["cpu_seconds"]}
            row["columns"] = {
                "cells": f"{nodes:.0e}",
                "peak [MB]": f"{row['peak_MB']:.0f}",
                "against": AGAINST[judge],
            }
        if (evaluations := own.get("statistics", {}).get("evaluations")) and work == "transient":
            own["floor_seconds"] = evaluations * nodes * BYTES / speed
            own["columns"]["floor"] = f"{own['floor_seconds']:.3g} s"
        if target := TARGETS.get((work, nodes)):
            own["target_seconds"] = target
    return rows


def _error(row: dict[str, Any], right: str) -> float:
    return float(np.abs(np.load(row["fields"]) - np.load(right)).max())


def _growth(rows: list[dict[str, Any]]) -> str:
    own = [r for r in rows if r["name"] == "thermid"]
    if len(own) < 2:
        return ""
    size, time = (np.log([r[k] for r in own]) for k in ("nodes", "cpu_seconds"))
    power = np.polyfit(size, time, 1)[0]
    return f"processor time grows with cells to the power {power:.2f} from {own[0]['nodes']:.0e} to {own[-1]['nodes']:.0e}"


def _worker(who: str, work: str, nodes: int, folder: Path, runs: int, tol: float) -> dict[str, Any]:
    from contest import timed

    solve, setting = _contestant(who, work, nodes, tol, folder)
    times = []
    for _ in range(runs):
        wall, cpu, (fields, statistics) = timed(solve)
        times.append((wall, cpu))
    path = _path(folder, who, work, nodes, tol)
    np.save(path, fields)
    return {
        "name": "scipy" if who == "scipy" else "thermid",
        "setting": setting,
        "nodes": nodes,
        "seconds": min(t[0] for t in times),
        "cpu_seconds": min(t[1] for t in times),
        "runs": runs,
        "peak_MB": peak(),
        "statistics": statistics,
        "fields": str(path),
    }


def _path(folder: Path, who: str, work: str, nodes: int, tol: float = 0.0) -> Path:
    return folder / f"{who}-{work}-{nodes}-{tol:g}.npy"


def _contestant(who: str, work: str, nodes: int, tol: float, folder: Path) -> tuple[Any, str]:
    """Return what is timed: a function that gives fields (times, cells) and statistics, its problem built beforehand."""
    import block
    from plain_block import FIELDS, PlainBlock

    if who == "corrected":
        plain, ended = PlainBlock(nodes), np.load(_path(folder, "thermid", work, nodes))
        return lambda: (ended + plain.correction(ended[0]), {}), "one Newton step"
    if who in ("scipy", "reference"):
        plain = PlainBlock(nodes)
        if work == "steady":
            return lambda: (plain.steady(), {}), "Newton, sparse elimination"
        rtol = tol or 1e-8
        return lambda: (plain.transient(rtol), {}), f"BDF, sparse Jacobian, rtol {rtol:g}"
    import thermid as td

    built, scenario = block.build(nodes), block.scenario()
    options = td.Options(error=TOLERANCE / 20 if who == "tighter" else TOLERANCE)

    def transient() -> tuple[Any, dict[str, Any]]:
        found = td.simulate(built, scenario, fields=FIELDS, options=options)
        return found.fields.reshape(len(FIELDS), -1), _plainly(found.statistics)

    def steady() -> tuple[Any, dict[str, Any]]:
        found = td.steady(built, scenario, block.HOUR)
        return found.final_field.reshape(1, -1), _plainly(found.statistics)

    return (steady if work == "steady" else transient), "default options"


def _plainly(statistics: Any) -> dict[str, Any]:
    return {k: v for k, v in statistics.items() if isinstance(v, int | float | str)}


if __name__ == "__main__":
    _who, _work, _nodes, _folder, _runs, *_tol = sys.argv[1:]
    print(json.dumps(_worker(_who, _work, int(_nodes), Path(_folder), int(_runs), float(_tol[0]) if _tol else 0.0)))
