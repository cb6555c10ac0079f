"""Case B3: a block of 0.2 m edge, random conductances between its cells, natural convection and radiation around it, eight heaters.

Conductivity, density times specific heat, coefficients and powers are assumed, of the size that alloys and equipment have. The factors on
the conductances are lognormal with a standard deviation of 0.5 and a mean of 1; the ambient rises by 10 K within the hour.
"""

from __future__ import annotations

import numpy as np

import thermid as td
from thermid.model.tree import Sine

CELLS = {1_000: (10, 10, 10), 10_000: (20, 20, 25), 100_000: (40, 50, 50), 1_000_000: (100, 100, 100)}
EDGE = 0.2
"""Edge of the cube with the block's volume. [m]"""
HOUR = 3600.0


def build(nodes: int, seed: int = 3) -> td.Block:
    """Return the block of 1e3, 1e4, 1e5 or 1e6 cells, all of them cubes."""
    cells = CELLS[nodes]
    step = (EDGE**3 / nodes) ** (1 / 3)
    rng = np.random.default_rng(seed)
    shapes = [tuple(n - (k == axis) for k, n in enumerate(cells)) for axis in range(3)]
    draws = rng.standard_normal(sum(int(np.prod(s)) for s in shapes))
    factors, done = [], 0
    for shape in shapes:
        size = int(np.prod(shape))
        factors.append(np.exp(0.5 * draws[done : done + size] - 0.125).reshape(shape))
        done += size
    block = td.Block(
        size=tuple(n * step for n in cells),  # type: ignore[arg-type]
        cells=cells,
        conductivity="15 [W/(m K)]",
        density="3900 [kg/m^3]",
        specific_heat="1000 [J/(kg K)]",
        link_factors=tuple(factors),  # type: ignore[arg-type]
        title=f"B3, {nodes} cells",
    ).exchanging("all", "air", htc={"coefficient": "1.5 [W/(m^2 K)]", "exponent": 0.25}, emissivity=0.8)
    corners = [(x, y, z) for x in (0.1, 0.6) for y in (0.1, 0.6) for z in (0.1, 0.6)]
    for k, corner in enumerate(corners):
        box = tuple(slice(int(a * n), max(int(a * n) + 1, int((a + 0.2) * n))) for a, n in zip(corner, cells, strict=True))
        block = block.heated(f"heater{k}", f"{5.0 + 2.142857 * k!r} [W]", cells=box)  # type: ignore[arg-type]
    return block


def scenario() -> td.Scenario:
    """Return one hour from 290 K in an ambient of 290 K + 5 K (1 - cos(pi t / 1 h))."""
    ambient = Sine(295.0, 5.0, 2.0 * HOUR, -np.pi / 2)
    return td.Scenario("one hour", boundaries={"air": ambient}, start="290 [K]", duration=HOUR)
