"""The machine, its programs, and its own floor: measured copy bandwidth and multiply-add rate of one core."""

from __future__ import annotations

import os
import platform
import time
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np

PACKAGES = ("numpy", "scipy", "pydantic", "casadi", "diffrax", "jax", "pathsim", "pycanha-core", "scikit-sundae", "pandas", "pymoo")


def processor() -> str:
    """Return what the processor calls itself."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    return next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), platform.machine())


def versions() -> dict[str, str]:
    """Return the version of every package that takes part and is installed."""
    found = {}
    for package in ("thermid", *PACKAGES):
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            continue
    return found


def machine() -> dict[str, Any]:
    """Return what a reader of times must know of the machine."""
    return {
        "cpu": processor(),
        "cores": os.cpu_count(),
        "memory_GB": round(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 1e9, 1) if hasattr(os, "sysconf") else None,
        "system": f"{platform.system()} {platform.machine()}",
        "python": platform.python_version(),
        "versions": versions(),
        "load": os.getloadavg()[0] if hasattr(os, "getloadavg") else None,
    }


def floor() -> dict[str, float]:
    """Return the copy bandwidth out of cache [GB/s] and the double multiply-add rate [GFLOP/s] of one core, the best of several."""
    large, target = np.ones(20_000_000), np.empty(20_000_000)
    a, b, c = np.random.default_rng(0).random((3, 768, 768))

    def rate(work: Any, amount: float) -> float:
        best = np.inf
        for _ in range(5):
            begun = time.perf_counter()
            work()
            best = min(best, time.perf_counter() - begun)
        return round(float(amount / best / 1e9), 2)

    return {
        "copy_GB_s": rate(lambda: np.copyto(target, large), 2 * large.nbytes),
        "fma_GFLOP_s": rate(lambda: np.matmul(a, b, out=c), 2 * 768.0**3),
    }
