"""What following extremes between samples costs: processor time of runs with and without, in turns, in one process.

`python benchmarks/extremes.py [rounds [work ...]]`; without names every work. Ratios are those of the least times of the rounds.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

import thermid as td

HERE = Path(__file__).parent
SEEDS, MEMBERS, SD = 50, 1000, 0.2
ON, OFF = td.Options(), td.Options(extremes=False)
Runs = Callable[[td.Options], Callable[[], Any]]


def least(build: Runs, rounds: int) -> tuple[float, float]:
    """Return the least processor times of a run with extremes and of one without. [s]"""
    runs, best = (build(ON), build(OFF)), [np.inf, np.inf]
    for k in range(rounds + 1):
        for which in (0, 1):
            begin = time.process_time()
            runs[which]()
            if k:
                best[which] = min(best[which], time.process_time() - begin)
    return best[0], best[1]


def unit(nonlinear: bool, noisy: bool, every: float | None) -> Runs:
    """Return a run of B1 or B2, prepared beforehand."""
    import network

    def build(options: td.Options) -> Callable[[], Any]:
        return td.prepare(network.model(nonlinear), network.scenario(noisy), every=every, options=options).run

    return build


def whole(nonlinear: bool) -> Runs:
    """Return a call of `simulate` in the noisy room with stored times by default."""
    import network

    model, scenario = network.model(nonlinear), network.scenario(True)
    return lambda options: lambda: td.simulate(model, scenario, options=options)


def members(noisy: bool) -> Runs:
    """Return B4: members of B2, outputs every 60 s."""
    import network

    logs = SD * np.random.default_rng(5).standard_normal((MEMBERS, len(network.FREE_NONLINEAR)))

    def build(options: td.Options) -> Callable[[], Any]:
        simulator = td.prepare(network.model(True), network.scenario(noisy), network.FREE_NONLINEAR, every=60.0, options=options)
        draws = {name: simulator.nominal[name] * np.exp(logs[:, k]) for k, name in enumerate(simulator.free)}
        return lambda: simulator.ensemble(draws, nodes=network.NODES)

    return build


def block(options: td.Options) -> Callable[[], Any]:
    """Return B3 with 1e4 cells."""
    import block as b3
    from plain_block import FIELDS

    built, scenario = b3.build(10_000), b3.scenario()
    return lambda: td.simulate(built, scenario, fields=FIELDS, options=options)


def pulsed(rounds: int) -> Iterator[tuple[float, float]]:
    """Yield the times of random pulsed, switched and scheduled models."""
    sys.path.insert(0, str(HERE.parent / "tests"))
    from switched import switched

    for seed in range(SEEDS):
        deck, course = switched(seed)
        model, scenario = td.model_from_dict(deck), td.Scenario(**course)
        yield least(lambda options, m=model, s=scenario: lambda: td.simulate(m, s, options=options), rounds)  # type: ignore[misc]


WORKS: dict[str, tuple[Runs, int]] = {
    "B1 smooth, 60 s": (unit(False, False, 60.0), 1),
    "B1 noisy, 60 s": (unit(False, True, 60.0), 1),
    "B1 noisy, 1 s": (unit(False, True, 1.0), 1),
    "B2 smooth, 60 s": (unit(True, False, 60.0), 1),
    "B2 smooth, 1 s": (unit(True, False, 1.0), 1),
    "B2 noisy, 60 s": (unit(True, True, 60.0), 1),
    "B2 noisy, 1 s": (unit(True, True, 1.0), 1),
    "B1 noisy, simulate": (whole(False), 1),
    "B2 noisy, simulate": (whole(True), 1),
    "B3 1e4 cells": (block, 5),
    "B4 smooth, 1000 members": (members(False), 5),
    "B4 noisy, 1000 members": (members(True), 5),
}
"""Each work, and by how much fewer rounds it has."""


def main(rounds: int, names: list[str]) -> None:
    """Print a table."""
    sys.path.insert(0, str(HERE))
    print(f"{'':28}{'on [ms]':>10}{'off [ms]':>10}{'ratio':>8}")
    for name, (build, fewer) in WORKS.items():
        if not names or any(n in name for n in names):
            on, off = least(build, max(rounds // fewer, 2))
            print(f"{name:28}{1e3 * on:10.3f}{1e3 * off:10.3f}{on / off:8.3f}", flush=True)
    if not names or "pulsed" in names:
        ratios = np.array([on / off for on, off in pulsed(max(rounds // 3, 3))])
        print(f"{f'pulsed, median of {SEEDS}':48}{np.median(ratios):8.3f}   largest {ratios.max():.3f}")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 15, sys.argv[2:])
