"""Blocks and scenarios that the tests of large networks share."""

from __future__ import annotations

import numpy as np

import thermid as td

CELLS = (6, 5, 4)
NODES = tuple(f"c{i}_{j}_{k}" for i, j, k in np.ndindex(*CELLS))


def warm_block(seed: int = 5) -> td.Block:
    """A block of 120 cells with random links, natural convection and radiation, and a heater."""
    rng = np.random.default_rng(seed)
    shapes = [tuple(n - (k == axis) for k, n in enumerate(CELLS)) for axis in range(3)]
    block = td.Block(
        ("60 [mm]", "50 [mm]", "40 [mm]"),
        CELLS,
        "15 [W/(m K)]",
        "3900 [kg/m^3]",
        "1000 [J/(kg K)]",
        link_factors=tuple(np.exp(0.5 * rng.standard_normal(s)) for s in shapes),  # type: ignore[arg-type]
    )
    natural = {"coefficient": "1.5 [W/(m^2 K)]", "exponent": 0.25}
    return block.exchanging("all", "air", htc=natural, emissivity=0.8).heated("heater", "5 [W]", cells=np.s_[1:3, 1:3, 1:3])


def warming_room() -> td.Scenario:
    """One hour in a room that warms smoothly by 10 K."""
    air = {"mean": "295 [K]", "amplitude": "5 [K]", "period": "2 [h]", "phase": -np.pi / 2}
    return td.Scenario("room", boundaries={"air": air}, start="290 [K]", duration="1 [h]")
