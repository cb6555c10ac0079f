"""States of large networks that come back after a period of the inputs, and their inputs at rest."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from thermid.errors import SolverError
from thermid.linear_algebra import Array
from thermid.simulation.solver.large import Watched, integrate
from thermid.simulation.solver.large_steady import conductances
from thermid.simulation.solver.problem import Options
from thermid.simulation.solver.sparse import SparseNetwork
from thermid.simulation.solver.wiring import mean_of

MOST_PERIODS = 30
"""Periods that are run until a state comes back."""
CLOSED = 1e-3
"""How far a state that comes back may miss itself, below what the runs err by. [K]"""
FINE = 1e-4
"""Local error of the runs of the search at most. [K]"""
QUICK = 0.75
"""What a mode that dies out within a period takes of what is missed: between a half, for slow ones, and one. [-]"""
REMEMBERED = 6
"""Earlier steps from which the next one is made."""


def stilled(network: SparseNetwork, span: float) -> SparseNetwork:
    """Return a network with every input at its mean over a span from zero [s]."""
    return replace(network, inputs=tuple(mean_of(given, span) for given in network.inputs))


def periodic_large(
    network: SparseNetwork, still: SparseNetwork, guess: Array, period: float, options: Options, where: str, name: Callable[[int], str]
) -> tuple[Array, dict[str, Any]]:
    """Return the state (nodes,) that comes back after every period of the inputs [K], and how it was found.

    The zero of T(P) - T(0): with the network linearised at the mean of its inputs a mode of rate k misses (1 - exp(-k P)) of its error,
    whose inverse is close to 3/4 + 1 / (k P), a sparse solution with the conductances; what that leaves is brought down by Anderson's
    method (J. ACM 12 (1965) 547).

    Parameters
    ----------
    still : SparseNetwork       The same with its inputs at their means.
    guess : array (nodes,)      Its steady temperatures. [K]
    period : float              [s]

    Raises
    ------
    SolverError   When no such state is found.
    """
    solve = conductances(still, guess, where)
    fine = replace(options, large_tolerance=min(options.large_tolerance or FINE, FINE), extremes=False)
    watched, none = (Watched("mean", np.zeros(1, dtype=np.int32), np.ones(1)),), np.zeros(0)

    def after(state: Array) -> Array:
        return integrate(network, state, period, np.array([period]), watched, none, fine, where, name).final

    state, states, steps = guess.copy(), [], []  # type: Array, list[Array], list[Array]
    for run in range(MOST_PERIODS):
        end = after(state)
        missed = end - state
        size = float(np.abs(missed).max())
        if size < CLOSED:
            return end, {"method": "Anderson", "periods": run + 1, "missed": size}
        states.append(state)
        steps.append(QUICK * missed + solve(network.capacities * missed / period))
        state = np.maximum(_mixed(states[-REMEMBERED:], steps[-REMEMBERED:]), 0.1)
    raise SolverError(f"no state was found that comes back after {period:g} s; it missed by {size:.3g} K.", where)


def _mixed(states: list[Array], steps: list[Array]) -> Array:
    """Return the next state: the combination of earlier ones whose steps cancel best, and its step."""
    if len(states) < 2:
        return np.asarray(states[-1] + steps[-1])
    moved, changed = (np.column_stack([b - a for a, b in pairwise(each)]) for each in (states, steps))
    share = np.linalg.lstsq(changed, steps[-1], rcond=1e-12)[0]
    return np.asarray(states[-1] + steps[-1] - (moved + changed) @ share)
