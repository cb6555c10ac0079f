"""B10: correlation of a network of 127 nodes and 2,520 conductors: fits of 12 factors to 20 logged nodes.

The network is drawn to the size of a public deck. The peers are methods of the literature, a genetic algorithm and a particle swarm of
pymoo, stopped after `RUNS` runs of the network. See `correlation.py`.
"""

from __future__ import annotations

import time
from argparse import Namespace
from importlib.util import find_spec
from typing import Any

import correlation
import numpy as np
from machine import versions

import thermid as td

LOGS, RUNS = 3, 50
TARGET = 60.0
"""Time of a fit. [s]"""
FARTHEST = 4.0
"""Largest miss of a factor, in its standard errors. [-]"""


def run(options: Namespace) -> list[dict[str, Any]]:
    """Return what fits of several logs took, and what other methods reach on the first of them."""
    model = td.model_from_dict(correlation.network())
    begun = time.perf_counter()
    errors, times, runs = correlation.fits(model, 1 if options.quick else LOGS)
    wall = (time.perf_counter() - begun) / len(times)
    size, best = np.abs(errors), correlation.best(model)
    words = f"{np.mean(size < 1.96):.1%} of {size.size} factors within 1.96 errors, largest {size.max():.2f}"
    own = {
        "name": "thermid",
        "setting": f"with derivatives, median of {len(times)} logs",
        "seconds": wall,
        "cpu_seconds": float(np.median(times)),
        "right": bool(size.max() < FARTHEST),
        "ratio": 1.0,
        "target_seconds": TARGET,
        "columns": {"runs of the network": int(np.median(runs)), "sum of squares, over that of the fit": "1"},
    }
    rows, missing = [own], {} if find_spec("pymoo") else {"pymoo": "not installed"}
    for kind in () if missing or options.quick else ("GA", "PSO"):
        begun = time.perf_counter()
        reached, count, cpu = correlation.swarm(model, kind, RUNS)
        columns = {"runs of the network": count, "sum of squares, over that of the fit": f"{reached / best:.1f}"}
        row = {"name": f"pymoo {kind}", "setting": f"stopped after {RUNS} runs", "seconds": time.perf_counter() - begun, "cpu_seconds": cpu}
        rows.append(row | {"ratio": cpu / own["cpu_seconds"], "right": False, "columns": columns})
    work = "B10, correlation of 127 nodes and 2,520 conductors: 12 factors, 20 logged nodes"
    return [{"work": work, "results": rows, "missing": missing, "versions": versions(), "remarks": [words]}]
