"""Random pulsed, switched and scheduled decks with scenarios, by seed: what lies between stored samples is the point of them."""

from __future__ import annotations

from typing import Any

import numpy as np


def _signal(rng: np.random.Generator, low: float, high: float, unit: str, duration: float) -> Any:
    """Return a constant, a sine or a table of a few points, held or joined."""
    difference = "K" if unit == "degC" else unit
    kind = rng.integers(4)
    level, other = rng.uniform(low, high, 2)
    if kind == 0:
        return f"{level} [{unit}]" if unit != "1" else float(level)
    if kind == 1:
        amplitude = min(abs(other - level), level - low, high - level)
        return {
            "mean": f"{level} [{unit}]",
            "amplitude": f"{amplitude} [{difference}]",
            "period": f"{rng.uniform(0.05, 1.5) * duration} [s]",
        }
    times = np.sort(rng.uniform(0.0, duration, rng.integers(2, 9)))
    times[0] = 0.0
    values = rng.uniform(low, high, times.size)
    texts = {"times": [f"{t} [s]" for t in times], "values": [f"{v} [{unit}]" for v in values]}
    return texts | {"hold": bool(kind == 3)}


def _load(rng: np.random.Generator, into: str, nodes: list[str], power: float, duration: float) -> dict[str, Any]:
    """Return a pulsed, switched or plain load."""
    load: dict[str, Any] = {"into": into, "power": f"{power} [W]"}
    kind = rng.integers(5)
    if kind <= 1:
        period = float(rng.uniform(duration / 80.0, duration / 4.0))
        return load | {"periodic": {"period": f"{period} [s]", "duty": float(rng.uniform(0.02, 0.9))}}
    if kind == 2:
        low = float(rng.uniform(24.0, 30.0))
        limits = {"on_below": f"{low} [degC]", "off_above": f"{low + rng.uniform(1.0, 5.0)} [degC]"}
        return load | {"thermostat": {"sensor": str(rng.choice(nodes)), **limits}}
    if kind == 3:
        return load | {"sine": {"amplitude": f"{power} [W]", "period": f"{rng.uniform(0.03, 1.0) * duration} [s]"}}
    return load


def switched(seed: int) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return a deck and a scenario: 1 to 5 nodes of time constants from seconds to an hour, linear and curved paths, 1 to 3 loads."""
    rng = np.random.default_rng(seed)
    duration = float(rng.choice([600.0, 1800.0, 5400.0]))
    names = [f"n{k}" for k in range(rng.integers(1, 6))]
    nodes: dict[str, Any] = {n: {"capacitance": f"{10 ** rng.uniform(0.3, 3.0)} [J/K]"} for n in names}
    curved = rng.random() < 0.5
    ends = [("air", n) for n in names[:1]] + [(names[int(rng.integers(k))], names[k]) for k in range(1, len(names))]
    if rng.random() < 0.4:  # a joint in a lead: a node without mass
        nodes["mid"] = {}
        ends = [("mid", ends[0][1]), ("air", "mid"), *ends[1:]]
    conductors: dict[str, Any] = {}
    for k, pair in enumerate(ends):
        law: dict[str, Any] = {"kind": "conduction", "conductance": f"{10 ** rng.uniform(-1.0, 0.7)} [W/K]"}
        conductors[f"c{k}"] = {"between": list(pair)} | law
    if curved:
        area = f"{rng.uniform(0.005, 0.1)} [m^2]"
        conductors["r"] = {"kind": "radiation", "between": [names[-1], "air"], "emissivity": float(rng.uniform(0.2, 0.9)), "area": area}
    loads = {}
    for k in range(rng.integers(1, 4)):
        into = str(rng.choice(names))
        loads[f"q{k}"] = _load(rng, into, names, float(10 ** rng.uniform(0.0, 1.6)), duration)
    plain = [n for n, q in loads.items() if set(q) == {"into", "power"}]
    commands = {n: _signal(rng, 0.0, 1.0, "1", duration) for n in plain}
    deck = {"title": f"switched {seed}", "needs": ["air"], "nodes": nodes, "conductors": conductors, "loads": loads}
    air = _signal(rng, 0.0, 30.0, "degC", duration)
    return deck, {"title": "course", "duration": f"{duration} [s]", "start": "20 [degC]", "boundaries": {"air": air}, "commands": commands}
