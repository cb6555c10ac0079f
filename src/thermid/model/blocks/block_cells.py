"""Geometry of a block: conductances between its cells, and the areas of those at faces."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thermid.model.blocks.block import Block, Exchange

Array = NDArray[np.float64]
Ints = NDArray[np.int32]


def links(block: Block) -> tuple[Array, Array, Array]:
    """Return the conductance (cells,) from every cell to the next in x, y, z, by the harmonic mean of conductivities; last ones 0. [W/K]"""
    out = []
    for axis in range(3):
        found = np.zeros(block.cells)
        low: Any = tuple(slice(None, -1) if k == axis else slice(None) for k in range(3))
        high: Any = tuple(slice(1, None) if k == axis else slice(None) for k in range(3))
        k = block.conductivity
        mean = 2.0 * k[low] * k[high] / (k[low] + k[high]) if isinstance(k, np.ndarray) else k
        found[low] = mean * _face_area(block, axis) / block.steps[axis]
        if block.link_factors is not None:
            found[low] *= block.link_factors[axis]
        out.append(found.ravel())
    return out[0], out[1], out[2]


def exchange_cells(block: Block, exchange: Exchange) -> tuple[Ints, Array, Array]:
    """Return the cells of an exchange, each once: places, area over all its faces [m^2], conductance if the faces are held [W/K]."""
    cells, areas, conductances = [], [], []
    for face in exchange.faces:
        axis, at = "xyz".index(face[1]), block.face_cells(face)
        area = _face_area(block, axis)
        k = block.conductivity.ravel()[at] if isinstance(block.conductivity, np.ndarray) else block.conductivity
        cells.append(at)
        areas.append(np.full(at.size, area))
        conductances.append(np.broadcast_to(area / (0.5 * block.steps[axis] / k + 1.0 / exchange.contact), at.shape))
    places, index = np.unique(np.concatenate(cells), return_inverse=True)
    area_of, conductance_of = (np.bincount(index, np.concatenate(v)).astype(np.float64) for v in (areas, conductances))
    return places, area_of, conductance_of


def _face_area(block: Block, axis: int) -> float:
    return math.prod(s for k, s in enumerate(block.steps) if k != axis)
