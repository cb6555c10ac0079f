"""Steady states of large networks: Newton's method, each step by conjugate gradients under algebraic multigrid."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

import numpy as np

from thermid.base.errors import SolverError, missing
from thermid.base.linear_algebra import one_thread
from thermid.base.units import ICE_POINT, Array
from thermid.simulation._solver.problem import unsettled
from thermid.simulation._solver.sparse import NONE, SparseNetwork

MOST_NEWTON = 60
LARGEST_MOVE = 100.0
LAST_STEP: Final = 1e-5
"""Largest change of the last step of Newton's method. [K]"""
MOST_DIRECT: Final = 1500
"""Nodes up to which a step is solved by elimination, which takes less than the search for multigrid's levels."""
LOOSE: Final = 1e-2
"""Heat left over by the gradients of one step of Newton's method, relative to that before it: the next step corrects the rest."""
WITHOUT_MULTIGRID = 200_000
"""Nodes above which Jacobi's preconditioner would take minutes."""


def settle_large(network: SparseNetwork, time: float, where: str) -> tuple[Array, dict[str, Any]]:
    """Return the steady temperatures (nodes,) [K] with the inputs of one time [s] held, and method -> how they were found.

    Newton's method J s = -q on the net heat q, from the mean of the boundaries on, each step `LARGEST_MOVE` at most and halved by
    `_moved`; solved directly up to `MOST_DIRECT` nodes, else by conjugate gradients behind a multigrid step, to `LOOSE`. The last changes
    nothing by `LAST_STEP`. [K]

    Raises
    ------
    SolverError   When a part has no path to a boundary, a power runs away, or the network needs pyamg, which is not installed.
    """
    from scipy.sparse.linalg import cg

    problem, nodes = network.problem, network.capacities.size
    matrix = _Matrix(network)
    outside = [float(network.boundary(k, np.array([time]))[0]) for k in range(len(network.boundaries))]
    # a small offset keeps the conductance of natural convection above zero at the start
    temperatures = np.full(nodes, (float(np.mean(outside)) if outside else ICE_POINT + 20.0) + 1.0)
    precondition, made_by = None, ""
    iterations = 0

    def count(_: Any) -> None:
        """Count an iteration of the conjugate gradients."""
        nonlocal iterations
        iterations += 1

    for k in range(MOST_NEWTON):
        heat, slope, pair, *_ = problem.heat(temperatures, float(time))
        jacobian = matrix.at(slope, pair)
        if not (jacobian.diagonal() > 0).all() or (k == 0 and not _held(jacobian, slope)):
            raise SolverError(_no_steady(network), where, code="run.no-steady-state")
        # laws change by far in the first step from a guess that is uniform: the hierarchy is made anew once
        with one_thread():
            if nodes <= MOST_DIRECT:
                change, failed, made_by = _eliminated(jacobian, heat)
            else:
                if precondition is None or k == 1:
                    precondition, made_by = _preconditioner(jacobian, where)
                change, info = cg(jacobian, heat, rtol=LOOSE, maxiter=2000, M=precondition, callback=count)
                failed = bool(info)
        size = float(np.abs(change).max())
        if failed or not np.isfinite(size):
            raise SolverError(_no_steady(network), where, code="run.no-steady-state")
        temperatures = _moved(problem, time, temperatures, change * min(1.0, LARGEST_MOVE / max(size, 1e-300)), heat)
        if size < LAST_STEP:
            method = f"Newton, {made_by}" if precondition is None else f"Newton + CG, {made_by}"
            return temperatures, {"method": method, "newton": k + 1, "iterations": iterations, "last_change": size}
    raise SolverError(unsettled(any(not g.fixed for g in network.loads)), where, code="run.no-steady-state")


def _eliminated(matrix: Any, heat: Array) -> tuple[Array, bool, str]:
    """Return x (nodes,) [K] with `matrix` x = heat [W] by Cholesky's method, whether it failed, and the name of the method."""
    from scipy.linalg import cho_factor, cho_solve

    try:
        factor = cho_factor(matrix.toarray(), lower=True, overwrite_a=True, check_finite=False)
    except np.linalg.LinAlgError:
        return np.zeros(heat.size), True, ""
    return np.asarray(cho_solve(factor, heat, check_finite=False)), False, "Cholesky"


def conductances(network: SparseNetwork, temperatures: Array, where: str) -> Callable[[Array], Array]:
    """Return a function heats (nodes,) [W] -> rises (nodes,) [K] of a network linearised at temperatures [K], inputs at time zero.

    Raises
    ------
    SolverError   When a part has no path to a boundary, or the network needs pyamg, which is not installed.
    """
    from scipy.sparse.linalg import cg

    _, slope, pair, *_ = network.problem.heat(temperatures, 0.0)
    matrix = _Matrix(network).at(slope, pair)
    if not (matrix.diagonal() > 0).all() or not _held(matrix, slope):
        raise SolverError(_no_steady(network), where, code="run.no-steady-state")
    with one_thread():
        precondition, _ = _preconditioner(matrix, where)

    def solve(heat: Array) -> Array:
        """Solve the linear system by preconditioned conjugate gradients, to 1e-6 of the right-hand side."""
        with one_thread():
            return np.asarray(cg(matrix, heat, rtol=1e-6, maxiter=2000, M=precondition)[0])

    return solve


class _Matrix:
    """The sparse matrix -dF/dT of Newton's method, with F the net heat of the nodes; its pattern is made once. [W/K]"""

    def __init__(self, network: SparseNetwork) -> None:
        from scipy.sparse import coo_array

        first, second, values = network.links.pairs()
        self.size = network.capacities.size
        between = [g for g in network.rows if g.boundary == NONE]
        self.between = np.concatenate([np.zeros(0, dtype=bool), *(np.full(g.first.size, g.boundary == NONE) for g in network.rows)])
        self.ends = tuple(np.concatenate([np.zeros(0, dtype=np.int32), *(getattr(g, e) for g in between)]) for e in ("first", "second"))
        total = np.bincount(first, values, self.size) + np.bincount(second, values, self.size)
        every = np.arange(self.size)
        # the diagonal is there for a node without links too: the slopes of its rows are added to it
        both: Any = np.concatenate((first, second, every)), np.concatenate((second, first, every))
        self.links = coo_array((np.concatenate((-values, -values, total)), both), shape=(self.size, self.size)).tocsr()
        self.links.sort_indices()
        rows = np.repeat(np.arange(self.links.shape[0], dtype=np.int32), np.diff(self.links.indptr))
        self.where = np.flatnonzero(self.links.indices == rows)

    def at(self, slope: Array, pair: Array) -> Any:
        """Return the matrix in CSR form: the links, `slope` (nodes,) on the diagonal, and rows of slope `pair` between two nodes. [W/K]"""
        from scipy.sparse import coo_array, csr_array

        data = self.links.data.copy()
        data[self.where] += slope
        jacobian = csr_array((data, self.links.indices, self.links.indptr), shape=self.links.shape)
        g = pair[self.between]
        if g.size:
            a, b = self.ends
            # a row of slope g between a and b adds g (e_a - e_b)(e_a - e_b)'
            rows, columns = np.concatenate((a, b, a, b)), np.concatenate((b, a, a, b))
            jacobian = (jacobian + coo_array((np.concatenate((-g, -g, g, g)), (rows, columns)), shape=jacobian.shape)).tocsr()
        return jacobian


def _held(matrix: Any, slope: Array) -> bool:
    """Return whether every connected part of the network is tied to a given temperature.

    `slope` is what each node gives to such [W/K]: its sum over a part is above zero.
    """
    from scipy.sparse.csgraph import connected_components

    parts, label = connected_components(matrix, directed=False)
    return bool((np.bincount(label, slope, parts) > 0).all())


def _preconditioner(matrix: Any, where: str) -> tuple[Any, str]:
    """Return an approximate inverse and its name: algebraic multigrid where pyamg is installed and pays, else Jacobi's."""
    from scipy.sparse import diags_array

    try:
        import pyamg
    except ImportError:
        if matrix.shape[0] > WITHOUT_MULTIGRID:
            raise SolverError(
                missing(["pyamg"], f"the steady state of {matrix.shape[0]} nodes"),
                where,
            ) from None
        return diags_array(1.0 / matrix.diagonal()), "Jacobi (pyamg is not installed)"
    from scipy.sparse import csr_matrix

    # weights from the rows: pyamg's own come from a random start, and no two answers would agree in their last digits
    smooth = ("jacobi", {"weighting": "local"})
    levels = pyamg.smoothed_aggregation_solver(csr_matrix(matrix), symmetry="symmetric", smooth=smooth, max_coarse=500)
    return levels.aspreconditioner(cycle="V"), "algebraic multigrid"


def _moved(problem: Any, time: float, temperatures: Array, change: Array, heat: Array) -> Array:
    """Return the temperatures (nodes,) [K] after a change, halved until the norm of the net heat q falls below that of `heat`.

    T + change / 2^k with the first k of 0 .. 11 for which ``|q(T + change / 2^k)| < |q(T)|``, and T + change where none is; 0.1 K at
    least. q [W] (nodes,) is taken with the inputs at `time` [s].
    """
    before = float(np.linalg.norm(heat))
    for halving in range(12):
        moved: Array = np.maximum(temperatures + 0.5**halving * change, 0.1)
        if float(np.linalg.norm(problem.heat(moved, float(time))[0])) < before:
            return moved
    return np.maximum(temperatures + change, 0.1)


def _no_steady(network: SparseNetwork) -> str:
    """Return why there is no steady state, in words: no boundary, a part without a path to one, or a power that runs away."""
    if not network.boundaries:
        return "no steady state exists: no face exchanges heat with a boundary. Give one of them a boundary."
    grows = ", or a power grows faster with temperature than the heat removed" if any(not g.fixed for g in network.loads) else ""
    return f"no steady state was found: a part has no path to a boundary{grows}."
