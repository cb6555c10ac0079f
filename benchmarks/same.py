"""How far the same work differs from run to run, with threads, between instruction sets, and from one state of the code to another.

``python benchmarks/same.py`` prints a line for each work, a largest difference: of temperatures and of sensitivities to logarithms in
kelvin, of fitted parameters relative to the truth. Ensembles name their instructions (`simd`). Single runs take those of the processor,
which nothing switches off.

``--keep FILE`` keeps what every work gives, and ``--against FILE`` compares bit for bit with what was kept: by other code, on another
machine, or under valgrind, which knows no AVX-512. Works come in groups, all of them by default: those above (benchmarks), and those of
`answers.py`: 200 random networks (rows, decks), FMUs (which need FMPy), 50 predictions, the shipped studies, the other examples. A line
for each group tells how many of its answers are equal and by how much the others differ; those that differ most follow, with the first
place where they do. Numbers in texts are compared as well, so that a difference of words alone is seen as one. Texts come without what two
runs need not share: the list is `REMOVED` in `answers.py`. The exit code is 1 when anything differs.
"""

from __future__ import annotations

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_name] = "1"  # before the first import that reads it: sums of matrices differ by the last bit with the number of threads

import argparse
import re
import sys
import warnings
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import answers
import block
import calibration
import network
import numpy as np
from numpy.typing import NDArray

import thermid as td
from thermid import _kernel

Array = NDArray[np.float64]
MEMBERS, ALONE = 205, 24
NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e[+-]?\d+)?")
AROUND = 40
"""Characters of a text on either side of the first that differs."""
LISTED = 20
"""Answers of a group that are listed, those that differ most."""


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


def ensemble() -> tuple[td.simulation.Simulator, dict[str, Array], Callable[..., Array]]:
    """Return B4: what runs it, its draws, and its temperatures (nodes, times, members) by the instructions that are asked for. [K]"""
    simulator = td.prepare(network.model(True), network.scenario(True), network.FREE_NONLINEAR, every=60.0)
    rng = np.random.default_rng(5)
    draws = {name: simulator.nominal[name] * np.exp(0.2 * rng.standard_normal(MEMBERS)) for name in simulator.free}

    def members(**how: Any) -> Array:
        found = simulator.ensemble(draws, nodes=network.NODES, **how)
        return np.stack([found.temperatures(n) for n in network.NODES])

    return simulator, draws, members


def ensembles() -> None:
    """Print how ensembles differ: run to run, with two threads, between instruction sets, and from single runs."""
    simulator, draws, members = ensemble()
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


def benchmarks() -> answers.Answers:
    """The benchmarks: single runs, a calibration, and ensembles by every instruction set of this machine."""
    for name, work in singles().items():
        yield name, work()
    _, _, members = ensemble()
    for simd in _kernel.instruction_sets():
        yield f"B4, {simd}", members(simd=simd)


GROUPS = {"benchmarks": benchmarks, **answers.GROUPS}


@dataclass(frozen=True)
class Difference:
    """How an answer differs from the one that was kept.

    Parameters
    ----------
    size : float    Largest difference of its numbers; 0 of words alone and of signs of zero, infinite where there are more or fewer.
    where : str     The first place.
    """

    size: float
    where: str


def difference(now: Array | str, kept: Array | str) -> Difference | None:
    """Return how an answer differs from the one that was kept; None where every bit is equal."""
    if isinstance(now, str) or isinstance(kept, str):
        return None if isinstance(now, str) and isinstance(kept, str) and now == kept else _of_texts(str(now), str(kept))
    if (now.shape, now.dtype) != (kept.shape, kept.dtype):
        return Difference(np.inf, f"{now.dtype} {now.shape} in place of {kept.dtype} {kept.shape}")
    if now.tobytes() == kept.tobytes():
        return None
    places = np.argwhere((now != kept) & ~(np.isnan(now) & np.isnan(kept)))
    return Difference(_largest(now, kept), f"first at {tuple(places[0].tolist())}" if len(places) else "signs of zeros")


def _largest(now: Array, kept: Array) -> float:
    """Return the largest difference; infinite where one is no number and the other is."""
    with np.errstate(invalid="ignore"):
        off = np.where((now == kept) | (np.isnan(now) & np.isnan(kept)), 0.0, np.abs(now - kept))
    return float(np.where(np.isnan(off), np.inf, off).max(initial=0.0))


def _of_texts(now: str, kept: str) -> Difference:
    """Return how texts differ that do."""
    first = next((i for i, (a, b) in enumerate(zip(now, kept, strict=False)) if a != b), min(len(now), len(kept)))
    one, other = (np.array([float(x) for x in NUMBER.findall(text)]) for text in (now, kept))
    begin, end = max(first - AROUND, 0), first + AROUND
    return Difference(_largest(one, other) if one.size == other.size else np.inf, f"{now[begin:end]!r} in place of {kept[begin:end]!r}")


def differences(now: Mapping[str, Array | str], kept: Mapping[str, Array | str]) -> dict[str, Difference]:
    """Return name -> how an answer differs; those that were not kept, or are no longer given, differ as well."""
    out = {name: difference(answer, kept[name]) for name, answer in now.items() if name in kept}
    out |= {name: Difference(np.inf, "was not kept") for name in now if name not in kept}
    out |= {name: Difference(np.inf, "is no longer given") for name in kept if name not in now}
    return {name: how for name, how in out.items() if how is not None}


def given(group: str) -> dict[str, Array | str]:
    """Return the answers of a group, and print what they cost."""
    begun = sum(os.times()[:4])  # of this process and of those that it has started
    found = dict(GROUPS[group]())
    print(f"{group}: {len(found)} answers, {sum(os.times()[:4]) - begun:.0f} s of processor time", flush=True)
    return found


def load(file: str) -> dict[str, dict[str, Array | str]]:
    """Return group -> name -> what was kept in a file."""
    out: dict[str, dict[str, Array | str]] = {}
    with np.load(file) as kept:
        for key in kept.files:
            group, _, name = key.partition("/")
            out.setdefault(group, {})[name] = str(kept[key]) if kept[key].dtype.kind == "U" else kept[key]
    return out


def compared(kept: Mapping[str, Mapping[str, Array | str]], groups: Sequence[str]) -> int:
    """Print how groups differ from what was kept; return the exit code."""
    code = 0
    for group in groups:
        now = given(group)
        found = differences(now, kept.get(group, {}))
        whole, words = len(now.keys() | kept.get(group, {}).keys()), sum(how.size == 0.0 for how in found.values())
        line = f"{group:12} {whole - len(found)} of {whole} equal"
        largest = sorted(found, key=lambda name: -found[name].size)
        if found:
            code = 1
            line += f"; the others differ by up to {found[largest[0]].size:.1e}, {words} of them in words or signs of zero alone"
        print(line, flush=True)
        for name in largest[:LISTED]:
            print(f"  {name}: {found[name].size:.1e}, {found[name].where}", flush=True)
    return code


def repeated() -> None:
    """Print how single runs differ from run to run and beside others, and how ensembles do."""
    for name, work in singles().items():
        one = work()
        with ThreadPoolExecutor(2) as pool:
            beside = list(pool.map(lambda _, work=work: work(), range(2)))  # type: ignore[misc]
        largest = max(apart(one, other) for other in beside)
        print(f"{name:22} run to run {apart(one, work()):.1e}  two at once {largest:.1e}", flush=True)
    ensembles()


def main() -> int:
    """Print the differences, keep answers, or compare them; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    way = parser.add_mutually_exclusive_group()
    way.add_argument("--keep", metavar="FILE", help="keep what every work gives, as a file .npz")
    way.add_argument("--against", metavar="FILE", help="compare with what was kept, bit for bit")
    parser.add_argument("groups", nargs="*", metavar="GROUP", help=f"some of {', '.join(GROUPS)}")
    asked = parser.parse_args()
    if unknown := set(asked.groups) - set(GROUPS):
        parser.error(f"there is no group {', '.join(sorted(unknown))}; there are {', '.join(GROUPS)}")
    warnings.simplefilter("ignore", td.ThermidWarning)
    if asked.keep:
        found = {f"{group}/{name}": answer for group in asked.groups or GROUPS for name, answer in given(group).items()}
        np.savez_compressed(asked.keep, **{name: np.asarray(answer) for name, answer in found.items()})  # type: ignore[arg-type]
        return 0
    if asked.against:
        kept = load(asked.against)
        return compared(kept, asked.groups or list(kept))
    repeated()
    return 0


if __name__ == "__main__":
    sys.exit(main())
