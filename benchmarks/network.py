"""Cases B1 and B2: a unit of twelve thermal masses and one massless interface in a measured room, linear and nonlinear.

Capacitances, areas, powers and conductances are assumed, of the size that a navigation unit has; the room drifts by half a kelvin and is
logged every second by a sensor with noise and steps of 1/16 K.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

import thermid as td
from thermid.model.tree import TableSignal

Array = NDArray[np.float64]
T0 = 297.15
DURATION = 18000.0
NODES = ("Proc", "Ele", "VFC", "FOGx", "FOGy", "FOGz", "Accx", "Accy", "Accz", "AccS", "IMUsup", "Disk")
CAPACITANCE = (1710.0, 675.0, 540.0, 855.0, 720.0, 720.0, 25.92, 25.92, 25.92, 315.0, 1980.0, 2700.0)
AREA = (0.105, 0.0822, 0.035, 0.062, 0.055, 0.055, 0.0042, 0.0042, 0.0042, 0.02, 0.09, 0.14)
HTC = (3.5, 2.1, 4.0, 3.8, 3.0, 3.0, 6.0, 6.0, 6.0, 6.0, 3.5, 5.0)
POWER = (6.8 * 0.8, 2.168, 0.9, 2.6, 2.2, 2.2, 0.225, 0.225, 0.225, 0.0, 0.0, 0.0)
EMISSIVITY = (0.85, 0.85, 0.8, 0.1, 0.1, 0.1, 0.3, 0.3, 0.3, 0.1, 0.1, 0.15)
NATURAL = tuple(0.55 * h / 10**0.25 for h in HTC)
"""Coefficient of natural convection: 0.55 of `HTC` at a difference of 10 K; the rest is radiation. [W/(m^2 K^1.25)]"""
BETA = 0.012
"""Exponential growth of the power of Ele with its temperature. [1/K]"""
LINKS = (
    ("Proc", "interface", 2.6),
    ("interface", "Ele", 2.2),
    ("VFC", "Disk", 0.9),
    ("FOGx", "IMUsup", 1.6),
    ("FOGy", "IMUsup", 1.4),
    ("FOGz", "IMUsup", 1.4),
    ("AccS", "IMUsup", 0.8),
    ("IMUsup", "Disk", 2.4),
)
FIXED = (("Accx", "AccS", 0.30), ("Accy", "AccS", 0.28), ("Accz", "AccS", 0.31), ("Ele", "Disk", 1.1))
GAP = 0.02
"""Conductance from the interface to the room. [W/K]"""
FREE_LINEAR = (*(f"{n}_skin.htc" for n in NODES), *(f"link{k}.conductance" for k in range(len(LINKS))))
FREE_NONLINEAR = (*(f"{n}_skin.htc.coefficient" for n in NODES), *(f"link{k}.conductance" for k in range(len(LINKS))))
"""The twenty parameters of sensitivities and calibrations: convection of every node, conductance of every link."""


def model(nonlinear: bool) -> td.Model:
    """Return the unit: B1, or B2 with natural convection, radiation and a power that grows with temperature."""
    nodes: dict[str, Any] = {n: {"capacitance": f"{c!r} [J/K]"} for n, c in zip(NODES, CAPACITANCE, strict=True)}
    surfaces: dict[str, Any] = {}
    loads: dict[str, Any] = {}
    for k, n in enumerate(NODES):
        surfaces[f"{n}_skin"] = {"of": n, "to": "air", "area": f"{AREA[k]!r} [m^2]", "htc": f"{HTC[k]!r} [W/(m^2 K)]"}
        if nonlinear:
            surfaces[f"{n}_skin"] |= {
                "htc": {"coefficient": f"{NATURAL[k]!r} [W/(m^2 K)]", "exponent": 0.25},
                "emissivity": EMISSIVITY[k],
            }
        if POWER[k]:
            loads[f"{n}_power"] = {"into": n, "power": f"{POWER[k]!r} [W]"}
    if nonlinear:
        loads["Ele_power"] |= {"exponential_coefficient": f"{BETA} [1/K]", "reference_temperature": f"{T0} [K]"}
    conductors: dict[str, Any] = {f"link{k}": _link(a, b, g) for k, (a, b, g) in enumerate(LINKS)}
    conductors |= {f"fixed{k}": _link(a, b, g) for k, (a, b, g) in enumerate(FIXED)}
    conductors["gap"] = _link("interface", "air", GAP)
    title = "B2" if nonlinear else "B1"
    return td.model_from_dict(
        {
            "title": title,
            "needs": ["air"],
            "nodes": nodes | {"interface": {}},
            "surfaces": surfaces,
            "loads": loads,
            "conductors": conductors,
        }
    )


def _link(a: str, b: str, conductance: float) -> dict[str, Any]:
    return {"kind": "conduction", "between": [a, b], "conductance": f"{conductance!r} [W/K]"}


def room(noisy: bool = True, seed: int = 1, samples: int = 18001) -> Array:
    """Return the room's temperature every second (samples,). [K]"""
    t = np.arange(samples, dtype=float)
    drift = T0 + 0.35 * np.sin(2 * np.pi * t / 15000.0) + 0.15 * np.sin(2 * np.pi * t / 3700.0 + 1.0)
    if not noisy:
        return drift
    rng = np.random.default_rng(seed)
    steps = rng.standard_normal(samples)
    wander, keep = np.zeros(samples), np.exp(-1 / 150.0)
    for k in range(1, samples):
        wander[k] = keep * wander[k - 1] + 0.06 * np.sqrt(1 - keep * keep) * steps[k]
    return np.asarray(np.round((drift + wander + 0.02 * rng.standard_normal(samples)) / 0.0625) * 0.0625)


def scenario(noisy: bool = True) -> td.Scenario:
    """Return five hours in that room, from rest at 24 degC."""
    values = room(noisy)
    return td.Scenario(
        "room",
        boundaries={"air": TableSignal(np.arange(values.size, dtype=float), values)},
        start=td.quantity(T0, unit="K"),
        duration=DURATION,
    )
