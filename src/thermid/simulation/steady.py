"""Steady states: the temperatures at which every node's heat balances."""

from __future__ import annotations

from typing import TYPE_CHECKING, overload

import numpy as np
from numpy.typing import NDArray

from thermid.arguments import takes_objects
from thermid.errors import SolverError
from thermid.model.block import Block
from thermid.model.model import Model
from thermid.physics.constants import ICE_POINT
from thermid.simulation.scenario import Scenario

if TYPE_CHECKING:
    from thermid.simulation.block_solution import BlockSolution
    from thermid.simulation.engine import Engine
    from thermid.simulation.wiring import Assembled

__all__ = ["settle", "steady"]

Array = NDArray[np.float64]
MOST_ITERATIONS = 200
CLOSE = 1e-10
LARGEST_MOVE = 100.0


def settle(engine: Engine, a: Assembled, time: float, gradients: bool = False) -> tuple[Array, Array]:
    """Return the steady temperatures (nodes,) [K] with the inputs of one time held, and their derivatives (nodes, free).

    Newton's method with steps of at most 100 K, shortened where they would leave more heat over.

    Raises
    ------
    SolverError   When there is no steady state: a part without a path to a boundary, or a power that runs away.
    """
    from thermid.simulation.large_model import settle_model

    found = None if gradients else settle_model(engine, a, time)
    if found is not None:
        return found, np.zeros((found.size, 0))
    network = engine.wiring.network
    where = f"{network.title}, {engine.wiring.scenario.title}"
    given = [float(engine.wiring.boundary(b, np.array([time]), a.offsets)[0]) for b in network.boundaries]
    base = float(np.mean(given)) if given else ICE_POINT + 20.0
    # a small offset keeps the conductance of natural convection above zero at the start
    temperatures = np.full(len(engine.nodes), base + 1.0)
    for _ in range(MOST_ITERATIONS):
        heat, jacobian, slopes = engine.rhs(a, temperatures, time, gradients)
        try:
            step = np.asarray(np.linalg.solve(jacobian, -heat), dtype=np.float64)
        except np.linalg.LinAlgError:
            step = np.full(temperatures.shape, np.nan)
        if not np.isfinite(step).all() or np.linalg.cond(jacobian) > 1e15:
            raise SolverError(_no_steady(engine, a), where)
        close = float(np.abs(step).max()) < CLOSE * max(1.0, float(np.abs(temperatures).max()))
        temperatures = _moved(engine, a, time, temperatures, step, float(np.linalg.norm(heat)))
        if close:
            unstable = np.linalg.eigvals(jacobian).real.max() > 0
            if unstable:
                raise SolverError("the balance found is not stable: a power grows faster with temperature than the heat can leave.", where)
            _, jacobian, slopes = engine.rhs(a, temperatures, time, gradients)
            if left := engine.left(a, time, temperatures):
                raise SolverError(f"in the steady state {left}", where)
            moves: Array = -np.linalg.solve(jacobian, slopes).astype(float) if slopes is not None else np.zeros((temperatures.size, 0))
            return temperatures, moves
    if any(row.control == "thermostat" for row in a.numbers.loads):
        raise SolverError("no steady state was found: a thermostat keeps switching. Simulate, and take the mean of a late period.", where)
    raise SolverError(unsettled(any(load.follows_temperature for load in engine.wiring.network.flat.loads)), where)


def unsettled(follows: bool) -> str:
    """Return why Newton's method came to no end; `follows` says whether a power follows a temperature at all."""
    if follows:
        return "no steady state was found; a power may run away with temperature."
    return (
        "no steady state was found above 0 K. Look for a negative power that takes more than can flow in; a body without heat that sees"
        " 0 K alone cools without end."
    )


def _moved(engine: Engine, a: Assembled, time: float, temperatures: Array, step: Array, imbalance: float) -> Array:
    """Return the temperatures after a step, shortened until less heat is left over: heaters with a knee would make whole steps cycle."""
    whole = step * min(1.0, LARGEST_MOVE / max(float(np.abs(step).max()), 1e-300))
    for halving in range(20):
        moved: Array = np.maximum(temperatures + 0.5**halving * whole, 0.1)
        if np.linalg.norm(engine.rhs(a, moved, time)[0]) < imbalance:
            return moved
    return np.maximum(temperatures + whole, 0.1)


def _no_steady(engine: Engine, a: Assembled) -> str:
    from thermid.network.reach import unreached

    powers = {name: float(p[0]) for name, p in engine.powers(a, _columns(engine, a), np.zeros(1)).items()}
    parts = unreached(engine.wiring.network, a.numbers, powers)
    if parts:
        return f"there is no steady state: {parts[0].message()}."
    follows = any(load.follows_temperature for load in engine.wiring.network.flat.loads)
    look = "power that grows with temperature" if follows else "node whose heat cannot leave"
    return f"there is no steady state: the equations are singular. Look for a {look}."


def _columns(engine: Engine, a: Assembled) -> Array:
    outer = [engine.wiring.boundary(b, np.zeros(1), a.offsets)[0] for b in engine.wiring.network.boundaries]
    return np.array([[outer[0] if outer else ICE_POINT] * len(engine.nodes) + outer])


@overload
def steady(model: Model, scenario: Scenario, time: float = 0.0) -> dict[str, float]: ...


@overload
def steady(model: Block, scenario: Scenario, time: float = 0.0) -> BlockSolution: ...


@takes_objects
def steady(model: Model | Block, scenario: Scenario, time: float = 0.0) -> dict[str, float] | BlockSolution:
    """Return node -> steady temperature with the inputs of one time held, boundaries and massless nodes included. [K]

    Of a block, return a solution of that one time.

    Parameters
    ----------
    model : Model or Block  What the hardware is.
    scenario : Scenario     What is done to it.
    time : float            Time whose inputs are held. [s]

    Raises
    ------
    SolverError   When there is no steady state; the message names the part and its rate.
    """
    if isinstance(model, Block):
        from thermid.simulation.block import steady_block

        return steady_block(model, scenario, time)
    from thermid.simulation.engine import Engine
    from thermid.simulation.simulator import network_for
    from thermid.simulation.traces import Traces
    from thermid.simulation.wiring import Wiring

    wiring = Wiring(network_for(model, scenario), scenario.with_(start=scenario.start or ICE_POINT))
    engine = Engine(wiring)
    a = wiring.assemble()
    found, _ = settle(engine, a, time)
    traces = Traces(wiring, a, np.array([float(time)]), engine.nodes, found[None, :], np.zeros((1, found.size, 0)))
    return {n: float(traces.temperature(n)[0]) for n in (*wiring.network.boundaries, *wiring.network.nodes)}
