"""A fleet of synthetic boxes: logs of a case with a board, whose values differ from unit to unit by known spreads."""

from __future__ import annotations

import numpy as np

import thermid as td
from thermid.model.tree import model_from_dict
from two_masses import DECK

MODEL = model_from_dict(DECK)
FREE = ("joint.contact_conductance", "skin.effective_htc")
UNITS = {"joint.contact_conductance": "W/(m^2 K)", "skin.effective_htc": "W/(m^2 K)", "case.capacitance": "J/K"}
MEANS = {"joint.contact_conductance": 640.0, "skin.effective_htc": 9.3}
SPREADS = {"joint.contact_conductance": 0.2, "skin.effective_htc": 0.1}
NOISE = 0.05
"""[K]"""


def log(name: str, values: dict[str, float], seconds: float, rng: np.random.Generator) -> td.Record:
    """Return the log of a unit that is switched on, a reading a minute."""
    model = MODEL.with_values({p: f"{v!r} [{UNITS[p]}]" for p, v in values.items()})
    times = np.arange(0.0, seconds + 1.0, 60.0)
    bench = td.Scenario(name, boundaries={"room": "23 [degC]"}, loads={"heater": "5 [W]"}, start="23 [degC]", duration=f"{times[-1]} [s]")
    run = td.simulate(model, bench, times=times)
    channels = {
        n: td.Channel.from_array(n, run[n].kelvin + rng.normal(0.0, NOISE, times.size), unit="K", role="node", target=n, noise=NOISE)
        for n in ("board", "case")
    }
    channels["room"] = td.Channel.from_array("room", np.full(times.size, 296.15), unit="K", role="boundary", target="room")
    channels["heater"] = td.Channel.from_array("heater", np.full(times.size, 5.0), unit="W", quantity="power", role="load", target="heater")
    return td.Record.from_arrays(name, times, channels)


def boxes(count: int, seed: int, weak: float = 0.0, spreads: dict[str, float] = SPREADS) -> tuple[dict[str, td.Record], np.ndarray]:
    """Return unit -> log, of two hours or with a chance of `weak` of four minutes, and the logarithms (units, values) of the values."""
    rng = np.random.default_rng(seed)
    true = np.array([[np.log(MEANS[p]) + spreads[p] * rng.normal() for p in FREE] for _ in range(count)])
    short = rng.random(count) < weak
    names = [f"b{k:03}" for k in range(count)]
    logs = {
        n: log(n, dict(zip(FREE, np.exp(t).tolist(), strict=True)), 240.0 if s else 7200.0, rng)
        for n, t, s in zip(names, true, short, strict=True)
    }
    return logs, true
