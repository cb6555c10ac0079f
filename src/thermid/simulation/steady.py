"""Steady states: the temperatures at which every node's heat balances."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any, overload

import numpy as np
from numpy.typing import NDArray

from thermid.arguments import takes_objects
from thermid.errors import ScenarioError, SolverError
from thermid.model.block import Block
from thermid.model.model import Model
from thermid.model.signal import literal
from thermid.physics.constants import ICE_POINT
from thermid.simulation.scenario import MEAN, PERIODIC, STEADY, Scenario

if TYPE_CHECKING:
    from thermid.simulation.block_solution import BlockSolution
    from thermid.simulation.engine import Engine
    from thermid.simulation.wiring import Assembled, Wiring

__all__ = ["Steady", "beginning", "held_inputs", "settle", "steady", "steady_levels"]

Array = NDArray[np.float64]
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
PERIOD_SAMPLES = 2001
"""Samples of a period that its means are taken over."""
MOST_LEVELS = 50
"""Combinations of levels of inputs that are looked at."""


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
    balance = _Balance(engine, a, time)
    temperatures = np.full(balance.size, base + 1.0)
    for k in range(MOST_ITERATIONS):
        heat, jacobian, slopes = balance(temperatures, gradients)
        try:
            step = np.asarray(np.linalg.solve(jacobian, -heat), dtype=np.float64)
        except np.linalg.LinAlgError:
            step = np.full(temperatures.shape, np.nan)
        if not np.isfinite(step).all() or np.linalg.cond(jacobian) > 1e15:
            raise SolverError(_no_steady(engine, a), where)
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
            if left := engine.left(a, time, balance.states(temperatures)):
                raise SolverError(f"in the steady state {left}", where)
            moves: Array = -np.linalg.solve(jacobian, slopes).astype(float) if slopes is not None else np.zeros((temperatures.size, 0))
            return balance.states(temperatures), balance.moves(temperatures, moves)
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


class _Balance:
    """Heat of every node at its temperature, inputs held.

    What stores heat by a table is one with its node: at rest it holds what belongs to that temperature, and a melting point, where
    temperature does not move with heat, is no obstacle.
    """

    def __init__(self, engine: Engine, a: Assembled, time: float) -> None:
        self.engine, self.a, self.time = engine, a, time
        place = {n: k for k, n in enumerate(n for n in engine.nodes if n not in a.reduced.stored)}
        self.size = len(place)
        self.place = np.array([place[a.reduced.stored[n][0] if n in a.reduced.stored else n] for n in engine.nodes], dtype=np.intp)
        self.own = np.array([n not in a.reduced.stored for n in engine.nodes], dtype=bool)
        self.held = [(k, a.reduced.stored[n][1]) for k, n in enumerate(engine.nodes) if n in a.reduced.stored]

    def __call__(self, temperatures: Array, gradients: bool = False) -> tuple[Array, Array, Array | None]:
        """Return net heat (nodes,) [W], its Jacobian [W/K] and its derivatives (nodes, free) at temperatures (nodes,) [K]."""
        heat, jacobian, slopes = self.engine.rhs(self.a, self.states(temperatures), self.time, gradients)
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


def beginning(engine: Engine, a: Assembled, gradients: bool = False) -> tuple[Array, Array]:
    """Return the temperatures (nodes,) that a scenario asks to start from [K], and their derivatives (nodes, free).

    Raises
    ------
    SolverError   When there is no such state.
    """
    start = engine.wiring.start
    if start is None or start.kind == STEADY:
        return settle(engine, a, start.time if start is not None else 0.0, gradients)
    found, slopes = settle(engine.still, a, 0.0, gradients)
    return (found, slopes) if start.kind == MEAN else _periodic(engine, a, found, slopes, gradients)


def _periodic(engine: Engine, a: Assembled, guess: Array, slopes: Array, gradients: bool) -> tuple[Array, Array]:
    """Return the state (nodes,) that comes back after every period of the inputs [K], and its derivatives (nodes, free).

    Newton's method on T(P) - T(0) with the monodromy matrix exp(P C^-1 J) of the network linearised at the mean, mended after Broyden
    (Math. Comp. 19 (1965) 577) where it is not linear. A linear network takes one step, and one more that shows it.
    """
    from scipy.linalg import expm

    from thermid.simulation.engine import Options

    wiring, period = engine.wiring, engine.wiring.cycle or 0.0
    where = f"{wiring.network.title}, {wiring.scenario.title}"
    if any(row.control == "thermostat" for row in a.numbers.loads):
        raise SolverError(
            "a thermostat has a rhythm of its own, so no state comes back with the inputs. Simulate, and take a late stretch.", where
        )
    capacity = engine.capacities(a)
    massive = capacity > 0.0
    _, jacobian, _ = engine.still.rhs(a, guess, 0.0)
    flow = jacobian[np.ix_(massive, massive)]
    if not massive.all():
        rest = np.linalg.solve(jacobian[np.ix_(~massive, ~massive)], jacobian[np.ix_(~massive, massive)])
        flow = flow - jacobian[np.ix_(massive, ~massive)] @ rest
    inverse: NDArray[Any] = np.linalg.inv(np.eye(int(massive.sum())) - expm(period * flow / capacity[massive][:, None]))

    def after(state: Array, moves: Array) -> tuple[Array, Array]:
        run = replace(a, initial=state, initial_gradient=moves)
        answer = engine.integrate(run, np.array([period]), engine.nodes, period, Options(), gradients)
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


class Steady(dict[str, float]):
    """Node -> steady temperature, and which inputs were held. [K]

    Parameters
    ----------
    held : str          Which inputs, in words.
    remarks : tuple     What a reader must know: inputs that change in time, and what else could be asked for.
    lowest, highest     Of a periodic state: node -> lowest and highest temperature of a period [K]; otherwise the temperature itself.
    """

    def __init__(
        self,
        temperatures: Mapping[str, float],
        held: str = "",
        remarks: tuple[str, ...] = (),
        lowest: Mapping[str, float] | None = None,
        highest: Mapping[str, float] | None = None,
    ) -> None:
        super().__init__(temperatures)
        self.held = held
        self.remarks = remarks
        self.lowest: Mapping[str, float] = dict(lowest if lowest is not None else temperatures)
        self.highest: Mapping[str, float] = dict(highest if highest is not None else temperatures)

    def __str__(self) -> str:
        """Return which inputs were held, what a reader must know, and the temperatures."""
        lines = [f"steady, {self.held}", *(f"  warning: {r}" for r in self.remarks)]
        return "\n".join([*lines, *(f"  {n}: {t - ICE_POINT:.3f} degC" for n, t in self.items())])


def held_inputs(wiring: Wiring, time: float) -> str:
    """Return what must be said of a steady state under the inputs of one time, where they change; empty where they do not."""
    if not wiring.changing:
        return ""
    several = ", ".join(wiring.changing)
    return (
        f"steady with the inputs of {time:g} s held, while {several} change{'s' if len(wiring.changing) == 1 else ''} in time; "
        "their mean ('mean'), another time or the state that comes back ('periodic') can be asked for"
    )


@overload
def steady(model: Model, scenario: Scenario, time: float | str = 0.0) -> Steady: ...


@overload
def steady(model: Block, scenario: Scenario, time: float | str = 0.0) -> BlockSolution: ...


@takes_objects
def steady(model: Model | Block, scenario: Scenario, time: float | str = 0.0) -> Steady | BlockSolution:
    """Return node -> steady temperature with the inputs of one time held, boundaries and massless nodes included. [K]

    Of a block, return a solution of that one time.

    Parameters
    ----------
    model : Model or Block  What the hardware is.
    scenario : Scenario     What is done to it.
    time : float or str     Time whose inputs are held, a number [s] or a text with unit; ``mean`` holds the mean of every input, over the
                            period of all or over the run; ``periodic`` returns the means over a period of the state that comes back
                            after it, with `lowest` and `highest`.

    Raises
    ------
    SolverError     When there is no steady state; the message names the part and its rate.
    ScenarioError   When a signal ends before the time, or inputs do not repeat.
    """
    from thermid.simulation.engine import Engine
    from thermid.simulation.simulator import network_for
    from thermid.simulation.traces import Traces
    from thermid.simulation.wiring import Wiring

    kind = time if time in (MEAN, PERIODIC) else ""
    instant = 0.0 if kind else literal(time, "s", f"{scenario.title}, steady") if isinstance(time, str) else float(time)
    asked = scenario.with_(duration=max(scenario.seconds, instant), start=scenario.start or ICE_POINT)
    if isinstance(model, Block):
        from thermid.simulation.block import steady_block

        if kind:
            raise ScenarioError("of a block, the inputs of one time are held; turn it into a model with model().", scenario.title)
        return steady_block(model, asked, instant)
    # the start plays no part
    asked = replace(asked, start=ICE_POINT, initial={})
    wiring = Wiring(network_for(model, asked), asked)
    if kind and wiring.cycle and wiring.cycle > asked.seconds:
        asked = asked.with_(duration=wiring.cycle)
        wiring = Wiring(network_for(model, asked), asked)
    if kind == PERIODIC:
        return _over_a_period(model, asked, wiring.cycle)
    engine = Engine(wiring)
    engine = engine.still if kind else engine
    a = wiring.assemble()
    found, _ = settle(engine, a, instant)
    traces = Traces(engine.wiring, a, np.array([instant]), engine.nodes, found[None, :], np.zeros((1, found.size, 0)))
    temperatures = {n: float(traces.temperature(n)[0]) for n in (*wiring.network.boundaries, *wiring.network.nodes)}
    if kind:
        span = f"a period of {wiring.cycle:g} s" if wiring.cycle else f"{asked.seconds:g} s"
        bent = f"the means over {span} of {', '.join(wiring.changing)} are held; where laws bend, that is not the mean of the temperatures"
        return Steady(temperatures, f"mean inputs over {span}", (bent,) if wiring.changing else ())
    said = held_inputs(wiring, instant)
    return Steady(temperatures, f"inputs at {instant:g} s", (said,) if said else ())


def _over_a_period(model: Model, scenario: Scenario, cycle: float | None) -> Steady:
    """Return means, lowest and highest temperatures over a period of the state that comes back after it. [K]"""
    from thermid.simulation.transient import simulate

    length = cycle or scenario.seconds or 1.0
    run = simulate(model, replace(scenario, start=PERIODIC, duration=length), times=np.linspace(0.0, length, PERIOD_SAMPLES))
    mean = {n: float(np.trapezoid(run[n].kelvin, run.times)) / length for n in run.nodes}
    low, high = ({n: float(pick(run[n].kelvin)) for n in run.nodes} for pick in (np.min, np.max))
    return Steady(mean, f"the mean of a period of {length:g} s that comes back", (), low, high)


@takes_objects
def steady_levels(model: Model, scenario: Scenario) -> tuple[Steady, ...]:
    """Return the steady state under each combination of levels that the inputs take, in the order in which they come up. [K]

    Every input changes by jumps alone; the run is looked through, and the period of the inputs where they repeat.

    Parameters
    ----------
    model : Model           What the hardware is.
    scenario : Scenario     What is done to it.

    Raises
    ------
    ScenarioError   When an input does not stay on levels, or there are more than `MOST_LEVELS`.
    SolverError     As in `steady`.
    """
    from thermid.simulation.simulator import network_for
    from thermid.simulation.wiring import Wiring

    asked = replace(scenario, start=ICE_POINT, initial={})
    wiring = Wiring(network_for(model, asked), asked)
    length = max(asked.seconds, wiring.cycle or 0.0)
    if length > asked.seconds:
        asked = asked.with_(duration=length)
        wiring = Wiring(network_for(model, asked), asked)
    moving = [name for name, s in wiring.signals.items() if not s.held]
    if moving:
        raise ScenarioError(f"'{moving[0]}' does not stay on levels; ask for its mean, a time or the periodic state.", scenario.title)
    knots = np.unique(np.concatenate([[0.0, length], *(s.knots(0.0, length) for s in wiring.signals.values())]))
    knots = knots[(knots >= 0.0) & (knots <= length)]
    middles = 0.5 * (knots[1:] + knots[:-1])[np.diff(knots) > 1e-5 * length / max(knots.size, 1)] if length else np.zeros(1)
    rows = np.column_stack([s.at(middles) for s in wiring.signals.values()])
    _, first = np.unique(rows, axis=0, return_index=True)
    if first.size > MOST_LEVELS:
        raise ScenarioError(f"the inputs take {first.size} combinations of levels; {MOST_LEVELS} at most are looked at.", scenario.title)
    return tuple(steady(model, asked, float(middles[k])) for k in np.sort(first))
