"""Where a network settles: steady, at the mean of its inputs, or in the state that comes back after a period."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thermid.errors import SolverError
from thermid.linear_algebra import Array
from thermid.network.network import unreached
from thermid.physics.constants import ICE_POINT
from thermid.simulation.scenarios.scenario import MEAN, STEADY
from thermid.simulation.solver.large_model import settle_model
from thermid.simulation.solver.problem import Answer, KernelProblem, Options, unsettled
from thermid.simulation.solver.wiring import Assembled

MOST_ITERATIONS = 200
DIRECT = 40
"""Steps of Newton's method before its search is taken for stuck at the knee of a table."""
DRIFT = 1.12
"""By how much each step of the search in time is longer than the one before."""
CLOSE = 1e-10
LARGEST_MOVE = 100.0
MOST_PERIODS = 40
"""Periods that are run until a state comes back."""
CLOSED = 2e-6
"""How far a state that comes back may miss itself. [K]"""


def settle(problem: KernelProblem, a: Assembled, time: float, gradients: bool = False) -> tuple[Array, Array]:
    """Return the steady temperatures (nodes,) [K] with the inputs of one time held, and their derivatives (nodes, free).

    Newton's method with steps of at most 100 K, shortened where they would leave more heat over.

    Raises
    ------
    SolverError   When there is no steady state: a part without a path to a boundary, or a power that runs away.
    """
    found = None if gradients else settle_model(problem, a, time)
    if found is not None:
        return found, np.zeros((found.size, 0))
    network, where = problem.wiring.network, problem.title
    given = [float(problem.wiring.boundary(b, np.array([time]), a.offsets)[0]) for b in network.boundaries]
    base = float(np.mean(given)) if given else ICE_POINT + 20.0
    # a small offset keeps the conductance of natural convection above zero at the start
    balance = _Balance(problem, a, time)
    temperatures = np.full(balance.size, base + 1.0)
    for k in range(MOST_ITERATIONS):
        heat, jacobian, slopes = balance(temperatures, gradients)
        try:
            step = np.asarray(np.linalg.solve(jacobian, -heat), dtype=np.float64)
        except np.linalg.LinAlgError:
            step = np.full(temperatures.shape, np.nan)
        if not np.isfinite(step).all() or np.linalg.cond(jacobian) > 1e15:
            raise SolverError(_no_steady(problem, a), where)
        close = float(np.abs(step).max()) < CLOSE * max(1.0, float(np.abs(temperatures).max()))
        if k < DIRECT or close:
            temperatures = _moved(balance, temperatures, step, float(np.linalg.norm(heat)))
        else:
            temperatures = _drifted(temperatures, heat, jacobian, k - DIRECT)
        if close:
            unstable = np.linalg.eigvals(jacobian).real.max() > 0
            if unstable:
                raise SolverError("the balance found is not stable: a power grows faster with temperature than the heat can leave.", where)
            _, jacobian, slopes = balance(temperatures, gradients)
            if left := problem.left(a, time, balance.states(temperatures)):
                raise SolverError(f"in the steady state {left}", where)
            moves: Array = -np.linalg.solve(jacobian, slopes).astype(float) if slopes is not None else np.zeros((temperatures.size, 0))
            return balance.states(temperatures), balance.moves(temperatures, moves)
    if any(row.control == "thermostat" for row in a.numbers.loads):
        raise SolverError("no steady state was found: a thermostat keeps switching. Simulate, and take the mean of a late period.", where)
    raise SolverError(unsettled(any(load.follows_temperature for load in problem.wiring.network.flat.loads)), where)


class _Balance:
    """Heat of every node at its temperature, inputs held.

    What stores heat by a table is one with its node: at rest it holds what belongs to that temperature, and a melting point, where
    temperature does not move with heat, is no obstacle.
    """

    def __init__(self, problem: KernelProblem, a: Assembled, time: float) -> None:
        self.problem, self.a, self.time = problem, a, time
        place = {n: k for k, n in enumerate(n for n in problem.nodes if n not in a.reduced.stored)}
        self.size = len(place)
        self.place = np.array([place[a.reduced.stored[n][0] if n in a.reduced.stored else n] for n in problem.nodes], dtype=np.intp)
        self.own = np.array([n not in a.reduced.stored for n in problem.nodes], dtype=bool)
        self.held = [(k, a.reduced.stored[n][1]) for k, n in enumerate(problem.nodes) if n in a.reduced.stored]

    def __call__(self, temperatures: Array, gradients: bool = False) -> tuple[Array, Array, Array | None]:
        """Return net heat (nodes,) [W], its Jacobian [W/K] and its derivatives (nodes, free) at temperatures (nodes,) [K]."""
        heat, jacobian, slopes = self.problem.rhs(self.a, self.states(temperatures), self.time, gradients)
        if not self.held:
            return heat, jacobian, slopes
        return self._sum(heat), self._sum(jacobian)[:, self.own], None if slopes is None else self._sum(slopes)

    def _sum(self, rows: Array) -> Array:
        """Return rows of all states summed over each node and what it holds."""
        out: Array = rows[self.own].copy()
        for k, _ in self.held:
            out[self.place[k]] += rows[k]
        return out

    def states(self, temperatures: Array) -> Array:
        """Return what the kernel solves for at rest, from temperatures (nodes,). [K]"""
        found = temperatures[self.place]
        for k, store in self.held:
            found[k] = float(store.level(found[k]))
        return found

    def moves(self, temperatures: Array, moves: Array) -> Array:
        """Return the derivatives of those (states, free) from the derivatives of the temperatures (nodes, free)."""
        found = moves[self.place]
        for k, store in self.held:
            found[k] *= float(store.share(temperatures[self.place[k]]))
        return found


def _moved(balance: _Balance, temperatures: Array, step: Array, imbalance: float) -> Array:
    """Return the temperatures after a step, shortened until less heat is left over: heaters with a knee would make whole steps cycle."""
    whole = step * min(1.0, LARGEST_MOVE / max(float(np.abs(step).max()), 1e-300))
    for halving in range(20):
        moved: Array = np.maximum(temperatures + 0.5**halving * whole, 0.1)
        if np.linalg.norm(balance(moved)[0]) < imbalance:
            return moved
    return np.maximum(temperatures + whole, 0.1)


def _drifted(temperatures: Array, heat: Array, jacobian: Array, k: int) -> Array:
    """Return the temperatures after step k in time of a network whose nodes all have a time constant of one, steps getting longer.

    Each step is one of Newton's method for the implicit Euler method, which passes knees where the way of less heat left over ends before
    any balance.
    """
    pace = np.abs(np.diag(jacobian)) / (0.5 * DRIFT**k)
    step = np.asarray(np.linalg.solve(jacobian - np.diag(np.maximum(pace, 1e-300)), -heat), dtype=np.float64)
    return np.maximum(temperatures + step * min(1.0, LARGEST_MOVE / max(float(np.abs(step).max()), 1e-300)), 0.1)


def _no_steady(problem: KernelProblem, a: Assembled) -> str:
    powers = {name: float(p[0]) for name, p in problem.powers(a, _columns(problem, a), np.zeros(1)).items()}
    parts = unreached(problem.wiring.network, a.numbers, powers)
    if parts:
        return f"there is no steady state: {parts[0].message()}."
    follows = any(load.follows_temperature for load in problem.wiring.network.flat.loads)
    look = "power that grows with temperature" if follows else "node whose heat cannot leave"
    return f"there is no steady state: the equations are singular. Look for a {look}."


def _columns(problem: KernelProblem, a: Assembled) -> Array:
    outer = [problem.wiring.boundary(b, np.zeros(1), a.offsets)[0] for b in problem.wiring.network.boundaries]
    return np.array([[outer[0] if outer else ICE_POINT] * len(problem.nodes) + outer])


def beginning(problem: KernelProblem, integrate: Callable[..., Answer], a: Assembled, gradients: bool = False) -> tuple[Array, Array]:
    """Return the temperatures (nodes,) that a scenario asks to start from [K], and their derivatives (nodes, free).

    Parameters
    ----------
    integrate : callable    As `Engine.integrate`: runs the periods of a state that comes back.

    Raises
    ------
    SolverError   When there is no such state.
    """
    start = problem.wiring.start
    if start is None or start.kind == STEADY:
        return settle(problem, a, start.time if start is not None else 0.0, gradients)
    found, slopes = settle(problem.still, a, 0.0, gradients)
    return (found, slopes) if start.kind == MEAN else _periodic(problem, integrate, a, found, slopes, gradients)


def _periodic(
    problem: KernelProblem, integrate: Callable[..., Answer], a: Assembled, guess: Array, slopes: Array, gradients: bool
) -> tuple[Array, Array]:
    """Return the state (nodes,) that comes back after every period of the inputs [K], and its derivatives (nodes, free).

    Newton's method on T(P) - T(0) with the monodromy matrix exp(P C^-1 J) of the network linearised at the mean, mended after Broyden
    (Math. Comp. 19 (1965) 577) where it is not linear. A linear network takes one step, and one more that shows it.
    """
    from scipy.linalg import expm

    period, where = problem.wiring.cycle or 0.0, problem.title
    if any(row.control == "thermostat" for row in a.numbers.loads):
        raise SolverError(
            "a thermostat has a rhythm of its own, so no state comes back with the inputs. Simulate, and take a late stretch.", where
        )
    capacity = problem.capacities(a)
    massive = capacity > 0.0
    _, jacobian, _ = problem.still.rhs(a, guess, 0.0)
    flow = jacobian[np.ix_(massive, massive)]
    if not massive.all():
        rest = np.linalg.solve(jacobian[np.ix_(~massive, ~massive)], jacobian[np.ix_(~massive, massive)])
        flow = flow - jacobian[np.ix_(massive, ~massive)] @ rest
    inverse: NDArray[Any] = np.linalg.inv(np.eye(int(massive.sum())) - expm(period * flow / capacity[massive][:, None]))

    def after(state: Array, moves: Array) -> tuple[Array, Array]:
        run = replace(a, initial=state, initial_gradient=moves)
        answer = integrate(run, np.array([period]), problem.nodes, period, Options(), gradients)
        return answer.temperatures[0], answer.sensitivities[0] if gradients else moves

    state, step, before = guess.copy(), np.zeros(0), np.zeros(0)
    for _ in range(MOST_PERIODS):
        end, _ = after(state, slopes)
        missed = (end - state)[massive]
        if step.size:
            inverse = _mended(inverse, step, before - missed)
        if float(np.abs(missed).max(initial=0.0)) < CLOSED:
            break
        step, before = inverse @ missed, missed
        held = state[massive]
        state = end.copy()
        state[massive] = np.maximum(held + step, 0.1)
    else:
        raise SolverError(f"no state was found that comes back after {period:g} s; it missed by {np.abs(missed).max():.3g} K.", where)
    for _ in range(MOST_PERIODS if gradients else 0):
        _, moved = after(state, slopes)
        change = inverse @ (moved - slopes)[massive]
        held = slopes[massive]
        slopes = moved.copy()
        slopes[massive] = held + change
        if float(np.abs(change).max(initial=0.0)) <= 1e-9 * float(np.abs(slopes).max(initial=1e-300)):
            break
    return state, slopes


def _mended(inverse: NDArray[Any], step: Array, fell: Array) -> Array:
    """Return the inverse of a slope that takes a step (nodes,) to what a residual fell by (nodes,): Broyden's first method."""
    moved = inverse @ fell
    size = float(step @ moved)
    return inverse if abs(size) < 1e-300 else inverse + np.outer(step - moved, step @ inverse) / size
