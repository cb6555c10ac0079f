"""What one step of a slider costs: processor time of the page and the server and of the whole browser, and the longest task of the page.

    python scripts/slider_cost.py [--steps 100]

Eleven sensors of two thousand readings, and a network of 60 nodes with 465 values. Processor times are those of the operating system,
so other work on the machine counts little; a browser at rest is taken off. The longest task of the page's main thread is that of the
browser's own trace, by the thread's clock.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

import thermid as td

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from studio.browser import Page, page, studio
from studio.large import dense_campaign, values_campaign

FEW = 10_000
"""Entries of the log below which no further part waits; while a page is traced, some always come."""
TICK = os.sysconf("SC_CLK_TCK")
STEP = """
const s = document.getElementById(arguments[0]); s.value = arguments[1]; s.dispatchEvent(new Event('input', { bubbles: true }));
"""


def processes() -> dict[int, tuple[int, float, str]]:
    """Return process -> its parent, processor time [s] and command line."""
    found = {}
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            fields = (folder / "stat").read_text().rpartition(")")[2].split()
            line = (folder / "cmdline").read_text().replace("\0", " ")
        except OSError:
            continue
        found[int(folder.name)] = int(fields[1]), (int(fields[11]) + int(fields[12])) / TICK, line
    return found


def spent(driver: int) -> np.ndarray:
    """Return processor times of page, server and whole browser. [s]"""
    all_, inside = processes(), {driver}
    for _ in range(6):
        inside |= {pid for pid, (parent, _, _) in all_.items() if parent in inside}
    browser = [v for pid, v in all_.items() if pid in inside and pid != driver]
    pages = sum(t for _, t, line in browser if "--type=renderer" in line)
    server = sum(t for parent, t, line in all_.values() if "-m thermid studio" in line and parent == os.getpid())
    return np.array([pages, server, sum(t for _, t, _ in browser)])


def measure(shown: Page, slider: str, low: float, high: float, steps: int) -> dict[str, float]:
    """Return milliseconds a step, and of the longest task of the page's main thread."""
    driver = shown.driver.service.process.pid

    def run(moved: bool) -> np.ndarray:
        before = spent(driver)
        for k in range(steps):
            if moved:
                shown.run(STEP, slider, low + (high - low) * k / steps)
            time.sleep(0.35)
        return (spent(driver) - before) / steps

    run(True)  # what is made once
    begun = time.monotonic()
    moved = run(True)
    ended = time.monotonic()
    own = 1e3 * (moved - run(False))
    return {"page": own[0], "server": own[1], "browser": own[2], "longest": max(tasks(shown, begun, ended), default=float("nan"))}


def tasks(shown: Page, begun: float, ended: float) -> list[float]:
    """Return how long the tasks of the page's main thread took between two times of the system's clock, by the thread's own clock. [ms]"""
    entries: list[dict[str, str]] = []
    while len(batch := shown.driver.get_log("performance")) > FEW:  # the driver hands out a part at a time, the oldest first
        entries += batch
    told = (json.loads(entry["message"])["message"] for entry in (*entries, *batch))
    trace = [m["params"] for m in told if m["method"] == "Tracing.dataCollected"]
    main = {(e["pid"], e["tid"]) for e in trace if e["name"] == "thread_name" and e["args"]["name"] == "CrRendererMain"}
    runs = (e for e in trace if (e["pid"], e["tid"]) in main and e["name"].endswith("RunTask") and "tdur" in e)
    return [1e-3 * e["tdur"] for e in runs if begun <= 1e-6 * e["ts"] <= ended]


def main() -> None:
    """Measure both pages and print a row for each."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--steps", type=int, default=100)
    steps = parser.parse_args().steps
    cases = [("11 sensors", lambda f: dense_campaign(f, 11, 2000), "s-skin.effective_htc", 0.2, 0.8)]
    cases += [("60 nodes, 465 values", values_campaign, "s-s0.effective_htc", 0.2, 0.8)]
    for name, make, slider, low, high in cases:
        with tempfile.TemporaryDirectory() as folder, studio(str(make(Path(folder)))) as address, page(address, traced=True) as shown:
            shown.until(f"document.getElementById('{slider}') && document.querySelector('#picture svg')")
            count = shown.run("return document.querySelectorAll('#sliders .slider').length")
            print(f"{name}: {count} sliders", flush=True)
            found = measure(shown, slider, low, high, steps)
            print(name, td.__version__, {k: round(v, 1) for k, v in found.items()}, "ms", flush=True)


if __name__ == "__main__":
    main()
