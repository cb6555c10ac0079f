"""What a law of the user costs beside the built-in one: ``python benchmarks/laws.py [--rounds 100] [--members 400]``.

The unit of B2 in the noisy room, once with the built-in natural convection of its twelve surfaces and the exponential power of its Ele,
once with both as Python functions, tabulated by `td.model.law`. A run with outputs every second, one with twenty sensitivities every minute
and an ensemble take turns, and the least processor time of each counts. ``apart`` is the largest difference of the results: they take
other steps, each within its tolerance.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from typing import Any

import network
import numpy as np
from numpy.typing import NDArray

import thermid as td

Array = NDArray[np.float64]
SMOOTH = 1e-4
"""The kernel rounds natural convection at zero over a hundredth of a kelvin; the function here does as much. [K^2]"""


def convection(difference: Array) -> Array:
    """Return natural convection of unit size at a difference. [W/K]"""
    return np.asarray((difference * difference + SMOOTH) ** 0.125)


def power(temperature: Array) -> Array:
    """Return the power of Ele at its temperature. [W]"""
    return np.asarray(network.POWER[1] * np.exp(network.BETA * (temperature - network.T0)))


def model(own: bool) -> td.Model:
    """Return the unit with built-in laws, or with functions in their places."""
    film = td.model.law(convection, over="difference", between=("-40 [K]", "80 [K]"))
    grown = td.model.law(power, between=("0 [degC]", "120 [degC]"))
    conductors: dict[str, Any] = {}
    for k, node in enumerate(network.NODES):
        ends, size = [node, "air"], network.NATURAL[k] * network.AREA[k]
        htc = {"coefficient": f"{size!r} [W/(m^2 K)]", "exponent": 0.25}
        built_in = {"kind": "convection", "htc": htc, "area": "1 [m^2]"}
        conductors[f"{node}_film"] = {"between": ends} | ({"kind": "table", "scale": size, "table": film} if own else built_in)
        radiates = {"kind": "radiation", "exchange_factor": network.EMISSIVITY[k], "area": f"{network.AREA[k]!r} [m^2]"}
        conductors[f"{node}_rays"] = {"between": ends} | radiates
    for k, (a, b, g) in enumerate((*network.LINKS, *network.FIXED, ("interface", "air", network.GAP))):
        conductors[f"link{k}"] = {"kind": "conduction", "between": [a, b], "conductance": f"{g!r} [W/K]"}
    powers = {n: q for n, q in zip(network.NODES, network.POWER, strict=True) if q}
    loads: dict[str, Any] = {f"{n}_power": {"into": n, "power": f"{q!r} [W]"} for n, q in powers.items()}
    grows = {"exponential_coefficient": f"{network.BETA} [1/K]", "reference_temperature": f"{network.T0} [K]"}
    loads["Ele_power"] = {"into": "Ele", "table": grown} if own else loads["Ele_power"] | grows
    nodes = {n: {"capacitance": f"{c!r} [J/K]"} for n, c in zip(network.NODES, network.CAPACITANCE, strict=True)}
    deck = {"title": "laws", "needs": ["air"], "nodes": nodes | {"interface": {}}, "conductors": conductors, "loads": loads}
    return td.model_from_dict(deck)


def free(own: bool) -> list[str]:
    """Return the twenty parameters: size of every convection, conductance of every link."""
    sizes = [f"{n}_film.{'scale' if own else 'htc.coefficient'}" for n in network.NODES]
    return [*sizes, *(f"link{k}.conductance" for k in range(len(network.LINKS)))]


def works(own: bool, members: int) -> dict[str, tuple[Callable[[], Any], Callable[[Any], Array]]]:
    """Return what is timed, and the numbers of what it gives."""
    unit, room = model(own), network.scenario(True)
    plain = td.prepare(unit, room)
    slopes = td.prepare(unit, room, free(own), every=60.0)
    factors = np.exp(0.2 * np.random.default_rng(5).standard_normal((members, 20)))
    draws = {name: slopes.nominal[name] * factors[:, k] for k, name in enumerate(free(own))}

    def by_logarithms(found: td.Solution) -> Array:
        return np.stack([slopes.nominal[p] * found.sensitivity(n, p) for n in network.NODES for p in free(own)])

    return {
        "run": (plain.run, lambda found: found.temperatures),
        "sensitivities": (lambda: slopes.run(sensitivities=True), by_logarithms),
        "ensemble": (lambda: slopes.ensemble(draws), lambda found: np.stack([found.temperatures(n) for n in network.NODES])),
    }


def compare(rounds: int, members: int) -> dict[str, dict[str, float]]:
    """Return of each work the seconds with built-in laws and with functions, their ratio, and how far apart the results are."""
    ways = {own: works(own, members) for own in (False, True)}
    out = {}
    for name in ways[False]:
        best, found = dict.fromkeys(ways, np.inf), {}
        for _ in range(max(3, rounds // 10) if name == "ensemble" else rounds):
            for own, work in ways.items():
                begun = time.process_time()
                found[own] = work[name][0]()
                best[own] = min(best[own], time.process_time() - begun)
        numbers = [work[name][1](found[own]) for own, work in ways.items()]
        apart = float(np.abs(numbers[1] - numbers[0]).max())
        out[name] = {"built in": best[False], "function": best[True], "ratio": best[True] / best[False], "apart": apart}
    return out


def main() -> None:
    """Print one line a work."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--rounds", type=int, default=100)
    parser.add_argument("--members", type=int, default=400)
    asked = parser.parse_args()
    print(f"{'':13}  {'built in':>10}  {'function':>10}  ratio  apart")
    for name, found in compare(asked.rounds, asked.members).items():
        times = "  ".join(f"{1e3 * found[way]:7.2f} ms" for way in ("built in", "function"))
        print(f"{name:13}  {times}  {found['ratio']:5.2f}  {found['apart']:.1e} K", flush=True)


if __name__ == "__main__":
    main()
