"""How far the same work differs from run to run, with threads, and between instruction sets: ``python benchmarks/same.py``.

Each line is a largest difference: of temperatures and of sensitivities to logarithms in kelvin, of fitted parameters relative to the truth.
Ensembles name their instructions (`simd`). Single runs take those of the processor, which nothing switches off; ``--keep FILE`` keeps
what they give, and ``--against FILE`` compares with what was kept elsewhere: on another machine, or under valgrind, which knows no
AVX-512.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import block
import calibration
import network
import numpy as np
from numpy.typing import NDArray

import thermid as td
from thermid import _kernel

Array = NDArray[np.float64]
MEMBERS, ALONE = 205, 24


def apart(one: Array, other: Array) -> float:
    """Return the largest difference."""
    return float(np.abs(one - other).max())


def singles() -> dict[str, Callable[[], Array]]:
    """Return what is run: B1 and B2, alone and with sensitivities, the fit of B2, and B3 of a thousand cells by each method."""
    out: dict[str, Callable[[], Array]] = {}
    for nonlinear, free in ((False, network.FREE_LINEAR), (True, network.FREE_NONLINEAR)):
        simulator = td.prepare(network.model(nonlinear), network.scenario(True), free, every=60.0)

        def run(simulator: Any = simulator) -> Array:
            return np.asarray(simulator.run().temperatures)

        def slopes(simulator: Any = simulator) -> Array:
            found = simulator.run(sensitivities=True)
            return np.stack([simulator.nominal[p] * found.sensitivity(n, p) for n in network.NODES for p in simulator.free])

        out |= {f"B{1 + nonlinear}": run, f"B{1 + nonlinear}, sensitivities": slopes}
    fit = calibration.problem(every=10.0)
    out["B2, calibration"] = lambda: _values(fit)
    cells, hour = block.build(1000), block.scenario()
    for method in ("RKC2", "TR-BDF2"):
        out[f"B3, {method}"] = lambda method=method: td.simulate(cells, hour, options=td.Options(method=method)).temperatures  # type: ignore[misc]
    out["B3, steady"] = lambda: td.steady(cells, hour).temperatures
    return out


def _values(fit: calibration.Calibration) -> Array:
    found = fit.run()
    return np.array([found[p].value / true for p, true in fit.truth.items()])


def ensembles() -> None:
    """Print how ensembles differ: run to run, with two threads, between instruction sets, and from single runs."""
    simulator = td.prepare(network.model(True), network.scenario(True), network.FREE_NONLINEAR, every=60.0)
    rng = np.random.default_rng(5)
    draws = {name: simulator.nominal[name] * np.exp(0.2 * rng.standard_normal(MEMBERS)) for name in simulator.free}

    def members(**how: Any) -> Array:
        found = simulator.ensemble(draws, nodes=network.NODES, **how)
        return np.stack([found.temperatures(n) for n in network.NODES])

    widest = members()
    for simd in _kernel.instruction_sets():
        one = members(simd=simd)
        again, threads = apart(one, members(simd=simd)), apart(one, members(simd=simd, threads=2))
        print(
            f"{'B4, ' + simd:22} run to run {again:.1e}  two threads {threads:.1e}  against the widest {apart(one, widest):.1e}", flush=True
        )
    alone = [simulator.run({name: float(v[k]) for name, v in draws.items()}) for k in range(ALONE)]
    near = max(apart(run[n].kelvin, widest[j, :, k]) for j, n in enumerate(network.NODES) for k, run in enumerate(alone))
    print(f"{'B4, members':22} against single runs {near:.1e}", flush=True)


def main() -> None:
    """Print the differences, a line for each work."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--keep", metavar="FILE", help="keep what single runs give, and do no more")
    parser.add_argument("--against", metavar="FILE", help="compare single runs with what was kept")
    asked = parser.parse_args()
    works = singles()
    if asked.keep:
        np.savez(asked.keep, **{name: work() for name, work in works.items()})  # type: ignore[arg-type]
        return
    kept = np.load(asked.against) if asked.against else {}
    for name, work in works.items():
        one = work()
        with ThreadPoolExecutor(2) as pool:
            beside = list(pool.map(lambda _, work=work: work(), range(2)))  # type: ignore[misc]
        line = f"{name:22} run to run {apart(one, work()):.1e}  two at once {max(apart(one, other) for other in beside):.1e}"
        print(line + (f"  against {asked.against} {apart(one, kept[name]):.1e}" if asked.against else ""), flush=True)
    ensembles()


if __name__ == "__main__":
    main()
