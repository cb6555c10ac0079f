"""Random networks like boards: a mesh of copper, components on it as case and junction, frames, a lid that radiates, air and a shroud."""

from __future__ import annotations

import random
from typing import Any

import thermid as td


def board(seed: int, count: int) -> td.Model:
    """Return a board of so many nodes."""
    rng = random.Random(seed)
    nodes: dict[str, Any] = {}
    links: dict[str, Any] = {}
    loads: dict[str, Any] = {}

    def add(name: str, joined: list[str], capacitance: str = "20 [J/K]") -> None:
        nodes[name] = {"capacitance": capacitance}
        for other in joined:
            links[f"g{len(links)}"] = {
                "kind": "conduction",
                "between": [name, other],
                "conductance": f"{rng.uniform(0.05, 3.0):.2f} [W/K]",
            }

    cells = max(2, int(count * rng.uniform(0.2, 0.45)))
    width = max(1, int(cells**0.5 * rng.uniform(0.8, 1.5)))
    for k in range(cells):
        add(f"board_{k}", [f"board_{k - d}" for d in (1, width) if k >= d and (d > 1 or k % width)])
    frames = [f"frame_{k}" for k in range(rng.randint(1, 4))]
    for k, frame in enumerate(frames):
        cell = sorted({f"board_{rng.randrange(cells)}" for _ in range(rng.randint(1, 4))})
        add(frame, [*frames[max(k - 1, 0) : k], *cell], "300 [J/K]")
    lid = rng.random() < 0.6 and len(nodes) < count
    if lid:
        add("lid", frames, "200 [J/K]")
    part = 0
    while len(nodes) < count:
        part, kind, cell = part + 1, rng.random(), f"board_{rng.randrange(cells)}"
        name = f"{rng.choice('UQRLJ')}{part}"
        top = f"{name}_case" if kind < 0.5 else name
        more = [rng.choice(frames)] if kind < 0.15 else [f"board_{rng.randrange(cells)}"] if kind > 0.9 else []
        add(top, sorted({cell, *more}), "4 [J/K]")
        if lid and kind < 0.3:
            links[f"r{part}"] = {"kind": "radiation", "between": [top, "lid"], "area": "0.01 [m^2]", "emissivity": 0.8}
        if kind < 0.5 and len(nodes) < count:
            add(f"{name}_junction", [top], "1 [J/K]")
            loads[f"p{part}"] = {"into": f"{name}_junction", "power": f"{rng.uniform(0.05, 4.0):.2f} [W]"}
    seen = dict.fromkeys([*list(nodes)[::3], "board_0"])
    cooled = {n: "shroud" if rng.random() < 0.2 else "air" for n in seen}
    surfaces = {f"s_{n}": {"of": n, "to": to, "area": "0.002 [m^2]", "effective_htc": "8 [W/(m^2 K)]"} for n, to in cooled.items()}
    deck = {"title": f"board {seed} of {count}", "needs": sorted(set(cooled.values())), "nodes": nodes, "conductors": links}
    return td.model_from_dict({**deck, "loads": loads, "surfaces": surfaces})


def boards(count: int) -> list[td.Model]:
    """Return boards of 5, 12, 25, 60 and 250 nodes, and so many of 20 to 250."""
    sizes = random.Random(77)
    return [
        *(board(901 + k, n) for k, n in enumerate((5, 12, 25, 60, 250))),
        *(board(7000 + k, sizes.randint(20, 250)) for k in range(count)),
    ]


def warmed(model: td.Model, **boundaries: float) -> dict[str, dict[str, float]]:
    """Return temperatures [K], heat flows and powers [W] of a model two hours after it was switched on, as `network_map` takes them."""
    given = boundaries or {"air": 20.0, "shroud": 30.0}
    known = {b: f"{given[b]} [degC]" for b in model.needs}
    run = td.simulate(model, td.Scenario("on", boundaries=known, start="20 [degC]", duration="2 [h]"))
    at_end = {n: float(run[n].kelvin[-1]) for n in run.nodes} | {b: given[b] + 273.15 for b in model.needs}
    flows, powers = ({k: float(w[-1]) for k, w in table.items()} for table in (run.heat_flows, run.load_powers))
    return {"temperatures": at_end, "flows": flows, "powers": powers}
