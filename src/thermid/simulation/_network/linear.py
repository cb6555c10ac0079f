"""Linear networks in matrix form: state space, steady solution, modes and time constants.

``C dT/dt = -K T + B T_b + Q``. After scaling with C^(-1/2) the matrix is symmetric, so its eigenvalues are real and negative
(the document's Eq. 5 in general form).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from thermid.base.errors import DeckError, SolverError
from thermid.base.units import Array, value_of, values_of
from thermid.simulation._network.network import Network, Numbers


@dataclass(frozen=True, eq=False)
class StateSpace:
    """State space of a linear network, dT/dt = A T + B_boundary T_b + B_load Q, massless nodes eliminated.

    Q is the power of each load; heat into a massless node is shared among its neighbours.

    Parameters
    ----------
    nodes : tuple of str            States, in order.
    boundaries : tuple of str       Given temperatures, in order.
    A : array (nodes, nodes)                [1/s]
    B_boundary : array (nodes, boundaries)  [1/s]
    loads : tuple of str            Loads, in order.
    B_load : array (nodes, loads)           [K/J]
    capacitances : array (nodes,)           [J/K]
    recover : tuple                         Massless node -> node or boundary -> weight of its temperature, where no load heats it.
    """

    nodes: tuple[str, ...]
    boundaries: tuple[str, ...]
    A: Array
    B_boundary: Array
    loads: tuple[str, ...]
    B_load: Array
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
    """Return the state-space matrices of a linear network: dT/dt = A T + B T_boundary + C P, P the powers of loads [W].

    A is -K / C per node with massless nodes eliminated: their temperatures are weights times states, boundaries and loads.

    Parameters
    ----------
    network : Network   The compiled model.
    numbers : Numbers   Its rows at other values than the model's own.

    Raises
    ------
    SolverError   When a conductor is not linear or changes in time, or a load depends on temperature.
    DeckError     When a massless node has no conductance to anything, so that its temperature is undefined.
    """
    numbers = numbers or network.numbers()
    crooked = [row.name for row in numbers.conductors if not row.kernel.linear or row.signal]
    crooked += [row.name for row in numbers.loads if not row.fixed] + list(network.stores)
    if crooked:
        raise SolverError(
            f"'{crooked[0]}' is not linear, so the network has no constant matrix. Request the time constants at a temperature instead.",
            network.title,
            code="model.element-not-supported",
        )
    massive = [k for k, n in enumerate(network.nodes) if numbers.capacitances[n] is not None]
    massless = [k for k, n in enumerate(network.nodes) if numbers.capacitances[n] is None]
    capacity = values_of(numbers.capacitances[network.nodes[k]] or 0.0 for k in massive)
    heat, driven = _conductances(network, numbers)
    loads = tuple(load.path for load in network.flat.loads)
    into = np.zeros((len(network.nodes), len(loads)))
    for k, load in enumerate(network.flat.loads):
        if load.node in network.nodes:
            into[network.nodes.index(load.node), k] = 1.0
    everything = np.hstack((heat[:, massive], driven, into))
    weights = _weights(network, heat, everything, massless)
    reduced = (everything[massive] + heat[np.ix_(massive, massless)] @ weights) / capacity[:, None]
    nodes = tuple(network.nodes[k] for k in massive)
    a, b, c = np.split(reduced, (len(nodes), len(nodes) + len(network.boundaries)), axis=1)
    sources = (*nodes, *network.boundaries)
    recover = tuple(
        (network.nodes[k], {n: float(w) for n, w in zip(sources, row, strict=False) if w}) for k, row in zip(massless, weights, strict=True)
    )
    return StateSpace(nodes, network.boundaries, a, b, loads, c, capacity, recover)


def _conductances(network: Network, numbers: Numbers) -> tuple[Array, Array]:
    """Return K (nodes, nodes) and B (nodes, boundaries) with the heat into the nodes Q = K T + B T_b; K has -sum(g) on its diagonal. [W/K]

    A flow counts at its second end alone.
    """
    index = {name: k for k, name in enumerate(network.nodes)}
    outer = {name: k for k, name in enumerate(network.boundaries)}
    heat, driven = np.zeros((len(index), len(index))), np.zeros((len(index), len(outer)))
    for row in numbers.conductors:
        g = value_of(row.coefficients[0])
        for node, neighbour in (row.ends, row.ends[::-1]):
            if node not in index or node == neighbour or (row.form == "flow" and node == row.ends[0]):
                continue
            heat[index[node], index[node]] -= g
            if neighbour in index:
                heat[index[node], index[neighbour]] += g
            else:
                driven[index[node], outer[neighbour]] += g
    return heat, driven


def _weights(network: Network, heat: Array, everything: Array, massless: list[int]) -> Array:
    """Return the weights W (massless, columns of `everything`) of states, boundaries and loads in the temperature of each massless node.

    They solve -K_mm W = E_m, with the rows m of the massless nodes in `heat` K (nodes, nodes) [W/K], the heat into a node per kelvin, and
    in `everything` E. [-], of loads [K/W]

    Raises
    ------
    DeckError   When the temperature of a massless node is undefined.
    """
    inner = -heat[np.ix_(massless, massless)]
    temperatures = everything.shape[1] - len(network.flat.loads)
    try:
        weights = np.asarray(np.linalg.solve(inner, everything[massless]), dtype=np.float64)
    except np.linalg.LinAlgError:
        weights = np.zeros((len(massless), everything.shape[1]))
    # the weights of temperatures add up to one wherever a temperature is defined
    lost = [k for k, total in zip(massless, weights[:, :temperatures].sum(axis=1), strict=True) if not abs(total - 1.0) < 1e-6]
    if lost:
        name = network.nodes[lost[0]]
        where = next((n.where for n in network.flat.nodes if n.path == name), network.title)
        raise DeckError(
            f"the massless node '{name}' has no conductance to any node, so its temperature is undefined. Connect it.",
            where,
            code="model.massless-undefined",
        )
    return weights


def modes(space: StateSpace) -> Modes:
    """Return the modes of a linear network, slowest first: time constants -1 / k of the eigenvalues k of A, and its eigenvectors.

    With one-way flows A is not symmetric; of complex eigenvalues and vectors the real part is returned.
    """
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
