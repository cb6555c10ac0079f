"""A processor on a case with a lid, on a bench in air: logs of it with a fault planted, drawn from runs of the model and noise."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

import thermid as td
from thermid.measure.records import Channel, Record
from thermid.model.tree import model_from_dict

Array = NDArray[np.float64]
ICE, NOISE = 273.15, 0.05
AIR = {"air": "22 [degC]"}


def deck_of(**changes: str) -> dict[str, Any]:
    """Return the deck; `changes` are parameters, such as ``joint="0.1 [W/K]"``."""
    parameters = {"joint": "2.5 [W/K]", "seam": "0.8 [W/K]", "htc": "14 [W/(m^2 K)]", "top": "6 [W/(m^2 K)]", "watts": "12 [W]"} | changes
    return {
        "title": "rig",
        "needs": ["air"],
        "parameters": parameters,
        "nodes": {"chip": {"capacitance": "60 [J/K]"}, "case": {"capacitance": "450 [J/K]"}, "lid": {"capacitance": "250 [J/K]"}},
        "conductors": {
            "pad": {"kind": "conduction", "between": ["chip", "case"], "conductance": "joint"},
            "screws": {"kind": "conduction", "between": ["case", "lid"], "conductance": "seam"},
            "fins": {"kind": "convection", "between": ["case", "air"], "htc": "htc", "area": "0.04 [m^2]"},
            "lid_air": {"kind": "convection", "between": ["lid", "air"], "htc": "top", "area": "0.02 [m^2]"},
        },
        "loads": {"heater": {"into": "chip", "power": "watts"}},
    }


def rig(**changes: str) -> td.Model:
    """Return the model."""
    return model_from_dict(deck_of(**changes))


def run(model: td.Model, seconds: float, start: Any, every: float) -> dict[str, Array]:
    times = np.arange(0.0, seconds + 1e-9, every)
    scenario = td.Scenario("run", boundaries=AIR, duration=float(times[-1]), **start)
    solved = td.simulate(model, scenario, times=times)
    return {n: solved[n].kelvin for n in ("chip", "case", "lid")}


def with_fault(at: float, seconds: float, every: float = 10.0, **changes: str) -> dict[str, Array]:
    """Return the courses of all nodes [K]: as the model says up to a time [s], with parameters changed from there on."""
    before = run(rig(), at, {"start": "22 [degC]"}, every)
    after = run(rig(**changes), seconds - at, {"start": "22 [degC]", "initial": {n: f"{v[-1]} [K]" for n, v in before.items()}}, every)
    return {n: np.concatenate([before[n], after[n][1:]]) for n in before}


def logged(courses: dict[str, Array], seed: int, every: float = 10.0, nodes: tuple[str, ...] = ("chip", "case")) -> Record:
    """Return a synthetic log of some nodes."""
    r = np.random.default_rng(seed)
    size = courses["chip"].size
    channels = {n: Channel.from_array(n, courses[n] + r.normal(0.0, NOISE, size), unit="K", column=n, noise=NOISE) for n in nodes}
    return Record.from_arrays("rig", every * np.arange(size), channels)


def scenario() -> td.Scenario:
    return td.Scenario("rig", boundaries=AIR, start="22 [degC]")
