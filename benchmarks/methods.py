"""Whether linear networks go the cheaper way by themselves: ``python benchmarks/methods.py [--rounds 20] [--sizes 2 12 60] [--far]``.

Each case is run by modes and by steps in turns, and the least processor time of each kept: single times hang on what else the machine
does, their ratio hardly. With ``--far`` also units a hundred times slower or three times faster, over ten hours, with noises from 2 mK
to 0.5 K. ``loss`` is what the automatic choice costs beyond the better of the two (docs/design/simulation.md).
"""

from __future__ import annotations

import argparse
import time
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

import thermid as td
from thermid.model.tree import TableSignal

Array = NDArray[np.float64]
HOUR = 3600.0
SIZES = (2, 5, 12, 20, 30, 45, 60, 100)
WAYS = ("modal", "integrator")


def model(size: int, slowness: float = 1.0) -> td.Model:
    """Return a chain of so many nodes with links across and to the room, of drawn values; `slowness` is a factor on the capacitances."""
    rng = np.random.default_rng(size)
    capacitances = slowness * np.exp(rng.uniform(np.log(30.0), np.log(2000.0), size))
    nodes = {f"n{k}": {"capacitance": f"{c!r} [J/K]"} for k, c in enumerate(capacitances.tolist())}
    pairs = [(f"n{k}", f"n{k + 1}") for k in range(size - 1)] + [(f"n{k}", f"n{(7 * k + 3) % size}") for k in range(0, size, 3)]
    pairs = [(a, b) for a, b in pairs if a != b] + [(f"n{k}", "air") for k in range(size)]
    links = {
        f"c{k}": {"kind": "conduction", "between": list(p), "conductance": f"{rng.uniform(0.05, 2.0)!r} [W/K]"} for k, p in enumerate(pairs)
    }
    loads = {f"q{k}": {"into": f"n{k}", "power": f"{rng.uniform(0.5, 5.0)!r} [W]"} for k in range(0, size, 3)}
    return td.model_from_dict({"title": f"chain of {size}", "needs": ["air"], "nodes": nodes, "conductors": links, "loads": loads})


def room(kind: str, noise: float = 0.05, duration: float = HOUR) -> Any:
    """Return the room's temperature: constant, 300 smooth samples, or a log at 1 s with noise [K]."""
    if kind == "constant":
        return "295 [K]"
    times = np.linspace(0.0, duration, 300 if kind == "smooth" else int(duration) + 1)
    scatter = np.random.default_rng(1).standard_normal(times.size) * (noise if kind == "noisy" else 0.0)
    return TableSignal(times, 295.0 + np.sin(2.0 * np.pi * times / HOUR) + scatter)


def outputs(kind: str, duration: float = HOUR) -> Array:
    """Return output times: every second, every minute, or 200 that were drawn. [s]"""
    if kind == "drawn":
        return np.sort(np.random.default_rng(2).uniform(0.0, duration, 200))
    return np.arange(0.0, duration + 0.5, 1.0 if kind == "1 s" else 60.0)


def compare(unit: td.Model, air: Any, times: Array, duration: float, rounds: int) -> dict[str, Any]:
    """Return the seconds of both ways, which one the automatic choice takes, and what it loses by it."""
    scenario = td.Scenario("room", boundaries={"air": air}, start="300 [K]", duration=duration)
    runs = {way: td.prepare(unit, scenario, times=times, options=td.Options(method=way)) for way in (*WAYS, "auto")}
    chosen = runs["auto"].run().statistics["method"]
    best = dict.fromkeys(WAYS, np.inf)
    for _, way in product(range(rounds), WAYS):
        begun = time.process_time()
        runs[way].run()
        best[way] = min(best[way], time.process_time() - begun)
    return {**best, "chosen": chosen, "loss": best[chosen] / min(best.values()) - 1.0}


def main() -> None:
    """Print one line a case, and the largest loss."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--rounds", type=int, default=20)
    parser.add_argument("--sizes", type=int, nargs="+", default=SIZES)
    parser.add_argument("--far", action="store_true", help="also slower and faster units, long runs, other noises")
    asked = parser.parse_args()
    cases = [
        (n, kind, every, 1.0, 0.05, HOUR)
        for n, kind, every in product(asked.sizes, ("constant", "smooth", "noisy"), ("1 s", "60 s", "drawn"))
    ]
    if asked.far:
        further = product((3, 12, 40, 80), ("noisy",), ("60 s", "drawn"), (0.3, 10.0, 100.0), (0.002, 0.05, 0.5), (HOUR, 10.0 * HOUR))
        cases += further
    print(f"nodes  {'room':8}  outputs  slowness    noise  hours      modes      steps  {'chosen':10}  loss")
    worst = 0.0
    for size, kind, every, slowness, noise, duration in cases:
        c = compare(model(size, slowness), room(kind, noise, duration), outputs(every, duration), duration, asked.rounds)
        worst = max(worst, c["loss"])
        ran = "  ".join(f"{1e3 * c[way]:6.2f} ms" for way in WAYS)
        scatter = f"{noise:5g} K" if kind == "noisy" else f"{'-':>7}"
        print(
            f"{size:5d}  {kind:8}  {every:7}  {slowness:8g}  {scatter}  {duration / HOUR:5g}  {ran}  {c['chosen']:10}  {c['loss']:4.0%}",
            flush=True,
        )
    print(f"The automatic choice costs at most {worst:.0%} more than the better way.")


if __name__ == "__main__":
    main()
