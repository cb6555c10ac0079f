"""Random synthetic plants for `thermid init`: how often the number of masses is found, and how well the proposal predicts another log.

Run it as ``python scripts/init_plants.py --count 200``; ``--json`` prints one object, ``--first N`` begins at another plant. Each plant
has 1 to 4 masses in a tree, neighbouring time constants 2 to 30 times apart, at least one mass without a sensor in half of those with two
or more, noise of 0.05 to 0.3 K, and a log of 1 to 5 slowest time constants. The error is judged on a second log of the same plant, with
other powers, that neither the proposal nor the known structure has seen. With ``--offset 0.5`` every instrument, that of the surroundings
among them, has a constant error of this standard deviation [K], the same in both logs. Everything here is synthetic.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

import thermid as td
from thermid.base.errors import ThermidError
from thermid.campaign._start.proposal import Proposal
from thermid.campaign._start.roles import SURROUNDINGS, Power, with_noise
from thermid.campaign.start import Roles, propose
from thermid.fit.calibration import Request, build_problem, starting_point
from thermid.inference._explain.structures import TIE
from thermid.inference.criticism import FittedStructure, fitted_structure

RATIO, NOISE, LENGTH = (2.0, 30.0), (0.05, 0.3), (1.0, 5.0)
SLOWEST, RISE, SAMPLES = (600.0, 14400.0), (20.0, 60.0), (300, 600)


@dataclass(frozen=True, eq=False)
class Plant:
    """A synthetic plant with two logs.

    Parameters
    ----------
    model : Model           The truth.
    measured : tuple        Nodes with a sensor.
    taus : array            Time constants, the slowest first. [s]
    noise : float           [K]
    log, other : Record     The log for `init`, and the one that judges.
    roles : Roles           What its columns are.
    """

    model: td.Model
    measured: tuple[str, ...]
    taus: np.ndarray
    noise: float
    log: td.Record
    other: td.Record
    roles: Roles

    @property
    def order(self) -> int:
        """Number of masses."""
        return len(self.model.nodes)


def drawn(seed: int, offset: float = 0.0) -> Plant:
    """Return the plant of a seed, its instruments with constant errors of a standard deviation. [K]"""
    rng = np.random.default_rng([20, seed])
    count = int(rng.integers(1, 5))
    hidden = int(rng.integers(1, count)) if count > 1 and rng.random() < 2.0 / 3.0 else 0
    while True:
        capacities = np.exp(rng.uniform(0.0, np.log(300.0), count))
        parents = [int(rng.integers(0, k)) for k in range(1, count)]
        links = np.exp(rng.uniform(np.log(0.05), np.log(5.0), count - 1))
        losses = np.exp(rng.uniform(np.log(0.02), np.log(1.0), count)) * (rng.random(count) < 0.6)
        if not losses.any():
            continue
        matrix = np.diag(losses)
        for k, (parent, link) in enumerate(zip(parents, links, strict=True), start=1):
            matrix[[k, parent], [k, parent]] += link
            matrix[k, parent] -= link
            matrix[parent, k] -= link
        root = np.sqrt(capacities)
        taus = np.sort(1.0 / np.linalg.eigvalsh(matrix / np.outer(root, root)))[::-1]
        ratios = taus[:-1] / taus[1:]
        if np.all((ratios >= RATIO[0]) & (ratios <= RATIO[1])):
            break
    slowest = float(np.exp(rng.uniform(*np.log(SLOWEST))))
    capacities = capacities * slowest / taus[0]
    taus = taus * slowest / taus[0]
    order = rng.permutation(count)
    measured = tuple(f"n{k}" for k in sorted(order[hidden:].tolist()))
    heated = f"n{int(rng.integers(0, count))}"
    deck: dict[str, Any] = {
        "title": f"Plant {seed}",
        "needs": [SURROUNDINGS],
        "nodes": {f"n{k}": {"capacitance": f"{c!r} [J/K]"} for k, c in enumerate(capacities.tolist())},
        "conductors": {
            f"n{k}_n{p}": {"kind": "conduction", "between": [f"n{k}", f"n{p}"], "conductance": f"{g!r} [W/K]"}
            for k, (p, g) in enumerate(zip(parents, links.tolist(), strict=True), start=1)
        }
        | {
            f"n{k}_out": {"kind": "conduction", "between": [f"n{k}", SURROUNDINGS], "conductance": f"{g!r} [W/K]"}
            for k, g in enumerate(losses.tolist())
            if g > 0
        },
        "loads": {"heat_p": {"into": heated, "power": "0 [W]"}},
    }
    model = td.model_from_dict(deck)
    noise, span = float(rng.uniform(*NOISE)), float(rng.uniform(*LENGTH)) * slowest
    size = int(rng.integers(*SAMPLES))
    gain = max(np.linalg.solve(matrix, np.eye(count))[[int(m[1:]) for m in measured], int(heated[1:])])
    top = float(rng.uniform(*RISE)) / gain / max(1.0 - np.exp(-span / slowest), 0.3)
    roles = Roles({f"T_{m}": m for m in measured}, "Tamb", (Power("P", heated if heated in measured else ""),))
    logs = [_log(model, roles, rng, span, size, top, noise, name) for name in ("log", "other")]
    errors = offset * np.random.default_rng([38, seed]).standard_normal(len(roles.parts) + 1)
    off = dict(zip([*roles.parts, roles.surroundings], errors.tolist(), strict=True))
    logs = [r.with_channels(*(replace(r[c], values=r[c].values + size) for c, size in off.items())) for r in logs]
    return Plant(model, measured, taus, noise, logs[0], logs[1], roles)


def _log(model: td.Model, roles: Roles, rng: np.random.Generator, span: float, size: int, top: float, noise: float, name: str) -> td.Record:
    times = np.linspace(0.0, span, size)
    edges = np.sort(rng.uniform(0.0, span, int(rng.integers(2, 6))))
    levels = rng.uniform(0.0, top, edges.size + 1)
    levels[int(rng.integers(0, levels.size))] = top
    watts = levels[np.searchsorted(edges, times, side="right")]
    ambient = 295.0 + rng.uniform(0.0, 1.5) * np.sin(2.0 * np.pi * times / span * rng.uniform(0.3, 1.5))
    inputs = {
        "Tamb": td.Channel.from_array("Tamb", ambient, unit="K", role="boundary", target=SURROUNDINGS),
        "P": td.Channel.from_array("P", watts, quantity="power", role="load", target="heat_p"),
    }
    still = {
        c: td.Channel.from_array(c, np.full(size, 295.0), unit="K", role="node", target=n, noise=noise) for c, n in roles.parts.items()
    }
    bare = td.Record.from_arrays(name, times, {**still, **inputs})
    request = Request(model, (bare,), scenarios={"*": td.Scenario("log", start=f"{float(ambient[0])!r} [K]")})
    problem = build_problem(request)
    blocks = problem.blocks(starting_point(problem.unknowns))
    noisy = {b.sensor: replace(still[b.sensor], values=b.predicted + noise * rng.standard_normal(size)) for b in blocks}
    return td.Record.from_arrays(name, times, {**noisy, **inputs})


def error_on(one: FittedStructure, other: td.Record) -> float:
    """Return the RMSE of a structure on another log: its parameters fixed, its starts and the errors of instruments fitted. [K]"""
    asked = one.full_request
    seats = {c.name: c.target for c in asked.records[0].channels.values()}
    moved = replace(other, name=asked.records[0].name)
    known = asked.records[0].channels
    moved = moved.with_channels(*(replace(moved[c], target=seats[c], noise=known[c].noise, accuracy=known[c].accuracy) for c in seats))
    return fitted_structure((), replace(asked, records=(moved,), free=()), {}).rmse


def known(plant: Plant, noise: Mapping[str, float]) -> FittedStructure:
    """Return the true structure fitted to the log, from the true values, with the noise that the proposal found. [K]"""
    free = (*(f"{n}.capacitance" for n in plant.model.nodes), *(f"{c}.conductance" for c in plant.model.conductors))
    record, _ = with_noise(plant.log, noise)
    return fitted_structure((), Request(plant.model, (record,), free, {"*": td.Scenario("log")}), {})


def judged(seed: int, offset: float = 0.0) -> dict[str, Any]:
    """Return what `init` finds of a plant."""
    plant = drawn(seed, offset)
    begun = time.perf_counter()
    row: dict[str, Any] = {"seed": seed, "order": plant.order, "measured": len(plant.measured)}
    try:
        found: Proposal = propose(plant.roles, [plant.log])
    except ThermidError as error:
        return row | {"refused": error.message, "seconds": time.perf_counter() - begun}
    row |= {"seconds": time.perf_counter() - begun, "found": found.chosen.masses, "orders": list(found.search.orders)}
    truth = known(plant, found.noise)
    row["likelihood"] = found.search.likelihood(found.chosen)
    row["known_likelihood"] = found.search.likelihood(truth)
    own = [found.search.likelihood(s) for s in found.search.structures if s.masses == plant.order and s.possible]
    row["apart"] = max(own) - row["likelihood"] if own else None
    best: dict[int, float] = {}
    for one in (s for s in found.search.structures if s.possible):
        best[one.masses] = max(best.get(one.masses, -np.inf), found.search.likelihood(one) - row["likelihood"])
    row["by_order"] = best
    row["changes"] = [c.name for c in found.chosen.changes]
    row["error_K"], row["known_error_K"] = error_on(found.chosen, plant.other), error_on(truth, plant.other)
    row["noise_K"], row["taus_s"] = plant.noise, [round(float(t), 1) for t in plant.taus]
    row["length"] = plant.log.duration / float(plant.taus[0])
    return row


def summary(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Return shares and ratios over plants."""
    able = [r for r in rows if "found" in r]
    exact = [r["found"] == r["order"] for r in able]
    # "cannot tell" counts where the truth is among what was named, and logarithms of Bayes factors differ by less than `TIE`
    open_ = [r["found"] == r["order"] or (r["order"] in r["orders"] and abs(r["apart"]) < TIE) for r in able]
    near = [abs(r["found"] - r["order"]) <= 1 for r in able]
    near_open = [min(abs(o - r["order"]) for o in r["orders"]) <= 1 for r in able]
    ratio = np.array([r["error_K"] / r["known_error_K"] for r in able])
    return {
        "plants": len(rows),
        "refused": len(rows) - len(able),
        "order named first": float(np.mean(exact)),
        "order found or open": float(np.mean(open_)),
        "within one": float(np.mean(near)),
        "within one, or open to one": float(np.mean(near_open)),
        "error at most 1.1 times that of the known structure": float(np.mean(ratio <= 1.1)),
        "error over that of the known structure, median": float(np.median(ratio)),
        "error over that of the known structure, all plants together": float(
            np.sqrt(np.mean([r["error_K"] ** 2 for r in able]) / np.mean([r["known_error_K"] ** 2 for r in able]))
        ),
        "error at most 1.15 times that of the known structure": float(np.mean(ratio <= 1.15)),
        "orders named, most": max(len(r["orders"]) for r in able),
        "seconds, largest": max(r["seconds"] for r in rows),
        "seconds, mean": float(np.mean([r["seconds"] for r in rows])),
    }


def main() -> int:
    """Print a row for each plant and the summary."""
    parser = argparse.ArgumentParser(description="Propose a structure for random synthetic plants.")
    parser.add_argument("--count", type=int, default=20, help="how many plants")
    parser.add_argument("--first", type=int, default=0, help="seed of the first")
    parser.add_argument("--offset", type=float, default=0.0, help="standard deviation of the constant error of an instrument [K]")
    parser.add_argument("--json", action="store_true", help="print one JSON object on standard output")
    given = parser.parse_args()
    rows = []
    for seed in range(given.first, given.first + given.count):
        rows.append(judged(seed, given.offset))
        if not given.json:
            print(json.dumps(rows[-1]), flush=True)
    if given.json:
        print(json.dumps({"schema": 1, "status": "ok", "summary": summary(rows), "plants": rows}))
    else:
        print(json.dumps(summary(rows), indent=2))
    return 0


if __name__ == "__main__":
    sys.exit(main())
