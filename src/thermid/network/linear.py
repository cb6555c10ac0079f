"""Linear networks in matrix form: state space, steady solution, modes and time constants.

``C dT/dt = -K T + B T_b + Q``. After scaling with C^(-1/2) the matrix is symmetric, so its eigenvalues are real and negative
(the document's Eq. 5 in general form).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thermid.dual import value_of
from thermid.errors import SolverError
from thermid.network.eliminate import Reduced, reduce_network
from thermid.network.network import Network, Numbers

__all__ = ["Modes", "StateSpace", "modes", "state_space"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class StateSpace:
    """dT/dt = A T + B_boundary T_b + B_load Q, massless nodes eliminated.

    Parameters
    ----------
    nodes : tuple of str            States, in order.
    boundaries : tuple of str       Given temperatures, in order.
    A : array (nodes, nodes)                [1/s]
    B_boundary : array (nodes, boundaries)  [1/s]
    capacitances : array (nodes,)           [J/K]
    recover : tuple                         As in `Reduced`: massless nodes from the states and boundaries.
    """

    nodes: tuple[str, ...]
    boundaries: tuple[str, ...]
    A: Array
    B_boundary: Array
    capacitances: Array
    recover: tuple[tuple[str, dict[str, float]], ...]


@dataclass(frozen=True, eq=False)
class Modes:
    """How a linear network relaxes.

    Parameters
    ----------
    time_constants : array (modes,)     Longest first; infinite for a part without a path to a boundary. [s]
    shapes : array (nodes, modes)       Columns: the pattern of temperatures that decays with it; largest entry 1.
    nodes : tuple of str                Rows of `shapes`.
    """

    time_constants: Array
    shapes: Array
    nodes: tuple[str, ...]


def state_space(network: Network, numbers: Numbers | None = None) -> StateSpace:
    """Return the matrices of a linear network.

    Raises
    ------
    SolverError   When a conductor is not linear or a load depends on temperature; linearise about a steady state instead.
    """
    numbers = numbers or network.numbers()
    crooked = [row.name for row in numbers.conductors if row.form not in ("linear", "flow")]
    crooked += [row.name for row in numbers.loads if row.form != "signal"]
    if crooked:
        raise SolverError(
            f"'{crooked[0]}' is not linear, so there is no one matrix. Ask for the time constants at a temperature instead.", network.title
        )
    reduced = reduce_network(network, numbers, tuple(n for n, c in numbers.capacitances.items() if c is None))
    return _matrices(network, reduced)


def _matrices(network: Network, reduced: Reduced) -> StateSpace:
    index = {name: k for k, name in enumerate(reduced.nodes)}
    outer = {name: k for k, name in enumerate(network.boundaries)}
    heat, given = np.zeros((len(index), len(index))), np.zeros((len(index), len(outer)))
    for row in reduced.conductors:
        g = value_of(row.coefficients[0])
        for here, there in (row.ends, row.ends[::-1]):
            if here not in index or (row.form == "flow" and here == row.ends[0]):
                continue
            heat[index[here], index[here]] -= g
            if there in index:
                heat[index[here], index[there]] += g
            else:
                given[index[here], outer[there]] += g
    capacity = np.array([value_of(c) for c in reduced.capacitances.values() if c is not None])
    recover = tuple((n, {k: value_of(w) for k, w in weights.items()}) for n, weights in reduced.recover)
    scale = 1.0 / capacity[:, None]
    return StateSpace(reduced.nodes, network.boundaries, heat * scale, given * scale, capacity, recover)


def modes(space: StateSpace) -> Modes:
    """Return the modes of a linear network, slowest first."""
    root = np.sqrt(space.capacitances)
    scaled = space.A * root[:, None] / root[None, :]
    if np.allclose(scaled, scaled.T, rtol=1e-12, atol=1e-300):
        rates, vectors = np.linalg.eigh(scaled)
    else:  # one-way flow links make it unsymmetric
        complex_rates, complex_vectors = np.linalg.eig(scaled)
        rates, vectors = complex_rates.real, complex_vectors.real
    shapes = vectors / root[:, None]
    shapes = shapes / np.take_along_axis(shapes, np.abs(shapes).argmax(axis=0)[None, :], axis=0)
    slow = np.abs(rates) < 1e-14 * max(np.abs(rates).max(), 1e-300)
    with np.errstate(divide="ignore"):
        constants = np.where(slow, np.inf, -1.0 / np.where(slow, -1.0, rates))
    order = np.argsort(-constants)
    return Modes(constants[order], shapes[:, order], space.nodes)
