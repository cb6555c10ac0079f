"""Transients of large networks: the kernel's stabilised explicit or implicit steps, and what is stored of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from thermid import _kernel
from thermid.errors import SolverError
from thermid.linear_algebra import Array, Ints
from thermid.simulation.solver.extremes import Turnings, by_column
from thermid.simulation.solver.problem import MAY_HAVE_LEFT, UNSOLVED, Options, limits, runs_away, unsolved
from thermid.simulation.solver.sparse import SparseNetwork

METHODS: Final[Mapping[str, int]] = {
    "auto": _kernel.LARGE_AUTO,
    "large": _kernel.LARGE_AUTO,
    "RKC2": _kernel.LARGE_RKC2,
    "TR-BDF2": _kernel.LARGE_TRBDF2,
}
"""Methods of large networks by the name that `Options.method` gives them."""
NAMES: Final = {_kernel.LARGE_AUTO: "", _kernel.LARGE_RKC2: "RKC2", _kernel.LARGE_TRBDF2: "TR-BDF2 + CG"}
TOLERANCE: Final = 3e-3
"""Local error of a step where `Options.large_tolerance` is left out. [K]"""
TABULATED: Final = 3e-5
"""The same where a table is read: steps of second order with it make errors below 1 mK over tens of kelvins. [K]"""
KINDS: Final = {"mean": 0, "highest": 1, "lowest": 2}


@dataclass(frozen=True, eq=False)
class Watched:
    """One thing that is stored at every output time.

    Parameters
    ----------
    kind : str                  mean, highest or lowest.
    nodes : array (nodes,)      Over which nodes; empty for all. Beyond their number: the level of one that stores heat by a table.
    weights : array (nodes,)    Of a mean; equal ones where empty. [-]
    """

    kind: str
    nodes: Ints
    weights: Array


@dataclass(frozen=True, eq=False)
class LargeAnswer:
    """What the kernel answered for a large network.

    Parameters
    ----------
    watched : array (times, watched)        [K]
    fields : array (field times, nodes)     [K]
    initial, final : array (nodes,)         [K]
    levels : array (nodes,)                 At the end; temperatures where a node's specific heat is constant. [K]
    load_energy, boundary_energy            Per load and boundary. [J]
    statistics : dict
    turnings : tuple or None                Of each watched, turning points between the times; None where not followed.
    """

    watched: Array
    fields: Array
    initial: Array
    final: Array
    levels: Array
    load_energy: Array
    boundary_energy: Array
    statistics: Mapping[str, Any]
    turnings: tuple[Turnings, ...] | None = None


def integrate(
    network: SparseNetwork,
    initial: Array,
    end: float,
    times: Array,
    watched: Sequence[Watched],
    field_times: Array,
    options: Options,
    where: str,
    name: Any,
    extremes: bool = False,
    left: Callable[[float, Array], str] | None = None,
) -> LargeAnswer:
    """Return temperatures of a large network from zero to `end` [s]; with `extremes` turning points of what is watched too.

    Parameters
    ----------
    initial : array (nodes,)    Massless nodes are solved for; levels of nodes that store heat by a table. [K]
    where : str                 Title of the model and the scenario, for messages.
    name : callable             Place of a node -> its name, for messages.
    left : callable             Time [s] and temperatures (nodes,) [K] -> which tables end there, empty where none does; None where none
                                is refused outside its points.

    Raises
    ------
    SolverError   When the run ends before its time.
    """
    sizes = [w.nodes.size for w in watched]
    weights = [w.weights if w.weights.size == w.nodes.size else np.full(w.nodes.size, 1.0 / max(w.nodes.size, 1)) for w in watched]
    found = network.problem.integrate(
        np.ascontiguousarray(initial),
        0.0,
        float(end),
        np.ascontiguousarray(times, dtype=float),
        np.array([KINDS[w.kind] for w in watched], dtype=np.int32),
        np.concatenate(([0], np.cumsum(sizes))).astype(np.int32),
        np.concatenate([np.zeros(0, dtype=np.int32), *(w.nodes for w in watched)]),
        np.concatenate([np.zeros(0), *weights]),
        np.ascontiguousarray(field_times, dtype=float),
        method=METHODS[options.method],
        tolerance=tolerance_of(network, options),
        turnings=extremes,
        **limits(options, network.inputs, end),
    )
    if found.status != _kernel.OK:
        message = _message(found, options, end, name, any(not g.fixed for g in network.loads))
        if left is not None and found.status in UNSOLVED:
            beyond = left(found.time, found.final_temperatures)
            message = f"at {found.time:.6g} s of {end:.6g} s {beyond}" if beyond else message + MAY_HAVE_LEFT
        raise SolverError(message, where)
    statistics = {
        "method": NAMES[found.method],
        "reason": "",
        "steps": found.steps,
        "rejected": found.rejected,
        "evaluations": found.evaluations,
        "iterations": found.iterations,
        "longest_step": found.longest,
        "largest_rate": found.rate,
        "switchings": [],
    }
    energies = (found.load_energy, found.boundary_energy)
    turnings = by_column(found.turnings, len(watched)) if extremes else None
    return LargeAnswer(found.traces, found.fields, initial, found.final_temperatures, found.final_states, *energies, statistics, turnings)


def tolerance_of(network: SparseNetwork, options: Options) -> float:
    """Return the local error that a step may make. [K]"""
    if options.large_tolerance is not None:
        return options.large_tolerance
    return TABULATED if network.tabulated else TOLERANCE


def _message(found: Any, options: Options, end: float, name: Any, follows: bool) -> str:
    """Return what ran out, when, where and what to change; `follows` as in `runs_away`."""
    node = f" at '{name(found.node)}'" if found.node >= 0 else ""
    when = f"at {found.time:.6g} s of {end:.6g} s{node}"
    instead = " RKC2 takes short steps where one node is fast: leave the method out." if options.method == "RKC2" else ""
    words = {
        _kernel.MAX_STEPS: f"{options.max_steps} steps were not enough, {when}. Allow more max_steps, or a larger large_tolerance."
        + instead,
        _kernel.STEP_UNDERFLOW: f"the step became too small {when}. Look for a law that jumps there, or raise large_tolerance.",
        _kernel.NON_FINITE: unsolved(when, follows),
        _kernel.RUN_AWAY: runs_away(when, follows),
        _kernel.SINGULAR_NODE: f"a massless node has no conductance to anything {when}, so its temperature is undefined;"
        " RKC2 takes no massless nodes at all, TR-BDF2 does.",
        _kernel.BAD_INPUT: f"a temperature must lie between 0 K and 1e6 K, which does not hold {when}. Look there.",
    }
    return words.get(found.status, f"the run stopped {when}.")
