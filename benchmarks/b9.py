"""B9: a log of 1e6 rows and 12 columns of text becomes numbers: thermid's reader beside numpy.loadtxt and pandas.

Each has a process of its own. Memory is beside what the process held before it read, in parts of the numbers themselves (8 bytes each).
``python benchmarks/run.py B9 --sizes 100000``.
"""

from __future__ import annotations

import json
import sys
import tempfile
from argparse import Namespace
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from fresh import fresh, peak
from machine import versions

SIZES, QUICK, COLUMNS = (1_000_000,), (20_000,), 12
WAYS = {
    "thermid": "layout, clock, units and faults found, all rows checked",
    "numpy": "loadtxt, layout known",
    "pandas": "read_csv, layout known",
}
TARGET = 0.8
"""Time of a million rows. [s]"""
RELATIVE_TARGET = 2.5
"""Peak of memory in parts of the numbers."""
AGREE = 1e-9
"""Largest difference of a reading between the readers. [-]"""


def run(options: Namespace) -> list[dict[str, Any]]:
    """Return what each reader took for logs of several lengths."""
    ways = [way for way in WAYS if find_spec(way)]
    found = []
    for rows in options.sizes or (QUICK if options.quick else SIZES):
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "log.csv"
            _write(path, rows)
            table = [_row(way, rows, [fresh(__file__, way, path) for _ in range(1 if options.quick else 3)]) for way in ways]
        plain = next(row for row in table if row["name"] == "numpy")
        for row in table:
            row["ratio"] = row["cpu_seconds"] / plain["cpu_seconds"]
            row["right"] = abs(row["sum"] / plain["sum"] - 1.0) < AGREE
        missing = {way: "not installed" for way in WAYS if way not in ways}
        work = f"B9, {rows} rows of {COLUMNS} columns, {path.name}"
        found.append({"work": work, "part": str(rows), "results": table, "missing": missing, "versions": versions()})
    return found


def _write(path: Path, rows: int) -> None:
    """Write a log: seconds, eight temperatures that wander, a room, two powers."""
    rng = np.random.default_rng(9)
    values = 300.0 + np.cumsum(rng.normal(0.0, 0.01, (rows, COLUMNS - 1)), axis=0)
    heads = ["time_s", *(f"T{k}_K" for k in range(COLUMNS - 4)), "room_K", "P1_W", "P2_W"]
    with path.open("w", encoding="utf-8") as file:
        file.write(",".join(heads) + "\n")
        np.savetxt(file, np.column_stack([np.arange(rows, dtype=float), values]), fmt="%.4f", delimiter=",")


def _row(way: str, rows: int, runs: list[dict[str, Any]]) -> dict[str, Any]:
    best = min(runs, key=lambda r: r["cpu_seconds"])
    parts = best["MB"] * 1e6 / (8.0 * rows * COLUMNS)
    row = {"name": way, "setting": WAYS[way], **best, "columns": {"peak of memory": f"{best['MB']:.0f} MB, {parts:.1f} times the numbers"}}
    return row | ({"target_seconds": TARGET * rows / 1e6} if way == "thermid" else {})


def _worker(way: str, path: Path) -> dict[str, Any]:
    """Return time, memory, and the sum of what a reader found in the second column."""
    from contest import timed

    if way == "thermid":
        from thermid.measure.readers import read_record

        channels = {f"T{k}_K": {"node": f"n{k}", "unit": "K"} for k in range(COLUMNS - 4)} | {"room_K": {"boundary": "room", "unit": "K"}}
        channels |= {f"P{k}_W": {"load": f"p{k}", "unit": "W"} for k in (1, 2)}

        def read() -> float:
            return float(read_record(path, channels, time="time_s").channels["T0_K"].values.sum())

    elif way == "numpy":

        def read() -> float:
            return float(np.loadtxt(path, delimiter=",", skiprows=1)[:, 1].sum())

    else:
        import pandas as pd

        def read() -> float:
            return float(pd.read_csv(path)["T0_K"].sum())

    before = peak()
    wall, cpu, total = timed(read)
    return {"seconds": wall, "cpu_seconds": cpu, "MB": peak() - before, "sum": total}


if __name__ == "__main__":
    print(json.dumps(_worker(sys.argv[1], Path(sys.argv[2]))))
