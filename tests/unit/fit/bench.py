"""A box on a bench and a stack of two, with logs made from a hidden truth: what the tests of this folder fit."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from thermid.base.units import quantity
from thermid.measure.records import Channel, Record
from thermid.model.tree import Model, Signal, model_from_dict
from thermid.simulation.runs import Scenario, simulate

ICE = 273.15
HTC, MASS, AREA = "skin.effective_htc", "case.mass", "skin.area"

BOX: dict[str, Any] = {
    "title": "Box",
    "needs": ["air"],
    "offers": ["case", "skin"],
    "parameters": {"power": {"value": "4 [W]", "min": 1, "max": 8}},
    "nodes": {"case": {"mass": {"value": "1.5 [kg]", "min": 0.5, "max": 4}, "specific_heat": "900 [J/(kg K)]"}},
    "surfaces": {
        "skin": {"of": "case", "to": "air", "area": "0.05 [m^2]", "effective_htc": {"value": "6 [W/(m^2 K)]", "min": 1, "max": 20}}
    },
    "loads": {"heat": {"into": "case", "power": "power"}},
}

PAIR: dict[str, Any] = {
    "title": "Pair",
    "needs": ["room"],
    "offers": ["mid", "a.case", "b.case"],
    "joints": {
        "stack": {
            "between": ["a.skin", "b.skin"],
            "area": "20 [cm^2]",
            "contact_conductance": {"value": "200 [W/(m^2 K)]", "min": 20, "max": 2000},
            "mid": "mid",
        }
    },
    "aliases": {"first": "a"},
}


def deck(changes: Mapping[str, Any] | None = None, base: Mapping[str, Any] = BOX) -> dict[str, Any]:
    """Return a deck with the values at ``table/name/field`` changed."""
    out = copy.deepcopy(dict(base))
    for path, value in (changes or {}).items():
        *steps, last = path.split("/")
        here = out
        for step in steps:
            here = here.setdefault(step, {})
        here[last] = value
    return out


def box(changes: Mapping[str, Any] | None = None) -> Model:
    """A box that convects; ``box({"loads/heat/power": "2 [W]"})``."""
    return model_from_dict(deck(changes))


def pair(changes: Mapping[str, Any] | None = None, first: Model | None = None, second: Model | None = None) -> Model:
    """Two boxes of one definition, `a` and `b`, joined at the massless node `mid`."""
    parts = {"a": {"use": first or box(), "bind": {"air": "room"}}, "b": {"use": second or box(), "bind": {"air": "room"}}}
    return model_from_dict(deck({"submodels": parts, **(changes or {})}, PAIR))


def room(times: np.ndarray, mean: float = 24.0, swing: float = 0.5) -> np.ndarray:
    """A room that wanders. [K]"""
    return ICE + mean + swing * np.sin(times / 3000.0)


def log(
    model: Model,
    truth: Mapping[str, str],
    nodes: Mapping[str, str],
    *,
    name: str = "bench",
    loads: Mapping[str, float | Signal] | None = None,
    noise: float | None = 0.05,
    accuracy: float | None = None,
    bias: Mapping[str, float] | None = None,
    start: str = "24 [degC]",
    boundary: str = "air",
    hours: float = 5.0,
    samples: int = 301,
    seed: int = 1,
    stated: bool = True,
    swing: float = 0.5,
) -> Record:
    """Return what sensors would have logged of a model with other values than its own; sensor -> node in `nodes`."""
    times, rng = np.linspace(0.0, 3600.0 * hours, samples), np.random.default_rng(seed)
    air = room(times, swing=swing)
    watts = {k: f"{v!r} [W]" if isinstance(v, float) else v for k, v in (loads or {}).items()}
    given = Scenario(name, boundaries={boundary: (times, quantity(air, unit="K"))}, loads=watts, start=start, duration=float(times[-1]))
    run = simulate(model.with_values(truth) if truth else model, given, times=times)
    size = noise or 0.0
    channels = {}
    for sensor, node in nodes.items():
        reading = run[node].kelvin + (bias or {}).get(sensor, 0.0) + size * rng.standard_normal(samples)
        channels[sensor] = Channel.from_array(
            sensor, reading, unit="K", role="node", target=node, noise=(noise or 1e-3) if stated else None, accuracy=accuracy
        )
    channels["ROOM"] = Channel.from_array("ROOM", air, unit="K", role="boundary", target=boundary)
    return Record.from_arrays(name, times, channels)


def metered(record: Record, load: str, watts: float | Sequence[float], accuracy: float | None = None, name: str = "METER") -> Record:
    """Return a record with a power meter."""
    values = np.broadcast_to(np.asarray(watts, dtype=float), record.times.shape)
    return record.with_channels(Channel.from_array(name, values, quantity="power", role="load", target=load, accuracy=accuracy))
