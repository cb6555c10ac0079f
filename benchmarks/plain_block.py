"""The block of B3 as a sparse system, for the reference and the peers: dT/dt = (q - K T - surface losses) / C, written down again."""

from __future__ import annotations

from typing import Any

import block
import numpy as np
from numpy.typing import NDArray
from plain import STEFAN_BOLTZMANN

Array = NDArray[Any]
CONDUCTIVITY, HEAT_CAPACITY, COEFFICIENT, EXPONENT, EMISSIVITY, SMOOTH = 15.0, 3.9e6, 1.5, 0.25, 0.8, 0.01
"""[W/(m K)], [J/(m^3 K)], [W/(m^2 K^1.25)], [-], [-], [K]"""
FIELDS = (60.0, 600.0, 3600.0)
"""Times at which all temperatures are compared. [s]"""


def ambient(t: float) -> float:
    """Return the ambient. [K]"""
    return 290.0 + 5.0 * (1.0 - float(np.cos(np.pi * t / block.HOUR)))


class PlainBlock:
    """Matrix, heats and areas of a block of so many cells."""

    def __init__(self, nodes: int) -> None:
        from scipy.sparse import coo_array, diags_array

        shape = block.CELLS[nodes]
        step = (block.EDGE**3 / nodes) ** (1 / 3)
        cell = np.arange(nodes).reshape(shape)
        first = np.concatenate([np.delete(cell, -1, axis).ravel() for axis in range(3)])
        second = np.concatenate([np.delete(cell, 0, axis).ravel() for axis in range(3)])
        factors = block.build(nodes).link_factors
        assert factors is not None
        g = CONDUCTIVITY * step * np.concatenate([f.ravel() for f in factors])
        both = (np.concatenate((first, second)), np.concatenate((second, first)))
        links = coo_array((np.concatenate((g, g)), both), shape=(nodes, nodes)).tocsr()
        self.nodes = nodes
        self.matrix = (diags_array(links.sum(axis=1)) - links).tocsr()
        index = np.indices(shape)
        outer = sum((at == 0).astype(float) + (at == n - 1) for at, n in zip(index, shape, strict=True))
        self.area = outer.ravel() * step**2
        self.capacity = HEAT_CAPACITY * step**3
        heat = np.zeros(shape)
        corners = [(x, y, z) for x in (0.1, 0.6) for y in (0.1, 0.6) for z in (0.1, 0.6)]
        for k, corner in enumerate(corners):
            box = tuple(slice(int(a * n), max(int(a * n) + 1, int((a + 0.2) * n))) for a, n in zip(corner, shape, strict=True))
            heat[box] += (5.0 + 2.142857 * k) / heat[box].size
        self.heat = heat.ravel()

    def net(self, T: Array, u: float) -> Array:  # noqa: N803
        """Net heat (cells,). [W]"""
        d = T - u
        lost = COEFFICIENT * d * (d * d + SMOOTH**2) ** (EXPONENT / 2) + EMISSIVITY * STEFAN_BOLTZMANN * (T**4 - u**4)
        return self.heat - self.matrix @ T - self.area * lost

    def slope(self, T: Array, u: float) -> Any:  # noqa: N803
        """Derivative (cells, cells) of the net heat. [W/K]"""
        from scipy.sparse import diags_array

        d = T - u
        e = d * d + SMOOTH**2
        own = COEFFICIENT * e ** (EXPONENT / 2) * (1 + EXPONENT * d * d / e) + 4.0 * EMISSIVITY * STEFAN_BOLTZMANN * T**3
        return (-(self.matrix + diags_array(self.area * own))).tocsc()

    def transient(self, tol: float) -> Array:
        """Return the fields (times, cells) by scipy's BDF with the sparse Jacobian. [K]"""
        from scipy.integrate import solve_ivp

        found = solve_ivp(
            lambda t, T: self.net(T, ambient(t)) / self.capacity,  # noqa: N803
            (0.0, block.HOUR),
            np.full(self.nodes, 290.0),
            "BDF",
            FIELDS,
            rtol=tol,
            atol=tol * 10,
            jac=lambda t, T: self.slope(T, ambient(t)) / self.capacity,  # noqa: N803
        )
        return np.asarray(found.y.T)

    def steady(self) -> Array:
        """Return the steady temperatures (1, cells) in the ambient of the last instant, by Newton's method and sparse elimination. [K]"""
        from scipy.sparse.linalg import spsolve

        T, u = np.full(self.nodes, 320.0), ambient(block.HOUR)  # noqa: N806
        for _ in range(30):
            change = spsolve(self.slope(T, u), self.net(T, u))
            T = T - change  # noqa: N806
            if np.abs(change).max() < 1e-9:
                break
        return T[None]

    def correction(self, T: Array) -> Array:  # noqa: N803
        """Return the Newton step (cells,) from temperatures that ought to be steady, by conjugate gradients. [K]"""
        from scipy.sparse import diags_array
        from scipy.sparse.linalg import cg

        u = ambient(block.HOUR)
        matrix = -self.slope(T, u)
        found, failed = cg(matrix, self.net(T, u), rtol=1e-4, maxiter=20_000, M=diags_array(1.0 / matrix.diagonal()))
        if failed:
            raise RuntimeError("conjugate gradients did not converge")
        return found
