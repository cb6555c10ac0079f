"""Steady states: the temperatures at which every node's heat balances."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import overload

import numpy as np
from numpy.typing import NDArray

from thermid.base.errors import NameNotFoundError, nearest
from thermid.base.results import Result, Row
from thermid.base.units import ICE_POINT, Array, Kelvin, amount
from thermid.model.tree import Block, Model, Names
from thermid.simulation._block import BlockSolution, steady_block, steady_levels_of_block
from thermid.simulation._heat_map import HeatMap
from thermid.simulation._network.network import without_gas
from thermid.simulation._scenarios.scenario import MEAN, PERIODIC, Scenario
from thermid.simulation._simulator import network_for, remark_on_empty
from thermid.simulation._solver.engine import at_rest
from thermid.simulation._solver.problem import KernelProblem, Traces
from thermid.simulation._solver.wiring import Assembled, Wiring, held_inputs, held_means, level_instants
from thermid.simulation._transient import simulate

PERIOD_SAMPLES = 2001
"""Samples of a period that its means are taken over."""
MOST_LEVELS = 50
"""Combinations of levels of inputs that are looked at."""


class Steady(Result, dict[str, float]):
    """A steady state: a dictionary node -> temperature [K], with the inputs that it holds for.

    Parameters
    ----------
    held : str          Which inputs, in words.
    remarks : tuple     What a reader must know: inputs that change in time, and what else could be asked for.
    lowest, highest     Of a periodic state: node -> lowest and highest temperature of a period [K]; otherwise the temperature itself.
    heat : HeatMap      Where the heat goes; of a periodic state by the means over the period. None where nobody computed it.
    names : Names       Finds the node that an alias stands for. None where keys are nodes alone.
    """

    def __init__(
        self,
        temperatures: Mapping[str, float],
        held: str = "",
        remarks: tuple[str, ...] = (),
        lowest: Mapping[str, float] | None = None,
        highest: Mapping[str, float] | None = None,
        heat: HeatMap | None = None,
        names: Names | None = None,
    ) -> None:
        self.heat = heat
        self._names = names
        super().__init__(temperatures)
        self.held = held
        self.remarks = remarks
        self.lowest: Mapping[str, float] = dict(lowest if lowest is not None else temperatures)
        self.highest: Mapping[str, float] = dict(highest if highest is not None else temperatures)

    @property
    def celsius(self) -> dict[str, float]:
        """Node -> steady temperature. [degC]"""
        return {n: t - ICE_POINT for n, t in self.items()}

    def __missing__(self, name: str) -> float:
        """Return the temperature of what an alias stands for. [K]

        Raises
        ------
        NameNotFoundError   With the nearest name.
        """
        if self._names is None:
            raise NameNotFoundError(f"no node '{name}'.{nearest(name, self)}", "steady")
        if (path := self._names.find(name)) not in self:
            raise NameNotFoundError(f"'{name}' has no gas in this scenario, so it has no temperature.", "steady")
        return self[path]

    def __str__(self) -> str:
        """Return which inputs were held, what a reader must know, and the temperatures."""
        lines = [f"steady, {self.held}", *(f"  warning: {r}" for r in self.remarks)]
        return "\n".join([*lines, *(f"  {n}: {t - ICE_POINT:.3f} degC" for n, t in self.items())])

    def _as_rows(self) -> list[Row]:
        """Return every node with its temperature."""
        return [{"node": n, "temperature_C": t - ICE_POINT} for n, t in self.items()]


@overload
def steady(model: Model, scenario: Scenario, time: float | str = 0.0) -> Steady: ...


@overload
def steady(model: Block, scenario: Scenario, time: float | str = 0.0) -> BlockSolution: ...


def steady(model: Model | Block, scenario: Scenario, time: float | str = 0.0) -> Steady | BlockSolution:
    """Return node -> steady temperature with the inputs of one time held, boundaries and massless nodes included. [K]

    Of a block, return a solution of that one time; for ``periodic`` one of a whole period that comes back.

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
    kind = time if isinstance(time, str) and time in (MEAN, PERIODIC) else ""
    instant = 0.0 if kind else amount(time, "s", f"{scenario.title}, steady")
    # a run sees what is before its end; the inputs of an instant are those from it on
    lasting = scenario.seconds if scenario.seconds > instant else instant * (1.0 + 1e-9)
    held_scenario = scenario.with_(duration=lasting, start=scenario.start or Kelvin(ICE_POINT))
    if isinstance(model, Block):
        return steady_block(model, held_scenario, instant, kind)
    held_scenario, wiring = _wired(model, held_scenario, bool(kind))
    if kind == PERIODIC:
        return _over_a_period(model, held_scenario, wiring.cycle)
    problem = KernelProblem(wiring.stilled() if kind else wiring)
    a = wiring.assemble()
    state, _, on = at_rest(problem, a, instant)
    traces = Traces(problem.wiring, a, np.array([instant]), problem.nodes, state[None, :], np.zeros((1, state.size, 0)))
    temperatures = {n: float(traces.temperature(n)[0]) for n in (*wiring.network.boundaries, *wiring.network.nodes)}
    heat = _heat(problem, a, state, on, temperatures, instant)
    if kind:
        span, remark = held_means(wiring.changing, wiring.cycle, held_scenario)
        held = f"mean inputs over {span}"
    else:
        held, remark = f"inputs at {instant:g} s", held_inputs(wiring.changing, instant)
    empty = without_gas(wiring.network, a.numbers)
    remarks = [*(f"INCOMPLETE: {what}" for what in model.missing_parts()), remark, remark_on_empty(empty) if empty else ""]
    return Steady(
        {n: t for n, t in temperatures.items() if n not in empty},
        held,
        tuple(filter(None, remarks)),
        heat=heat,
        names=wiring.network.flat.names,
    )


def _heat(
    problem: KernelProblem, a: Assembled, state: Array, on: NDArray[np.int32], temperatures: Mapping[str, float], instant: float
) -> HeatMap:
    """Return the heat map at steady temperatures by node [K] and kernel states (nodes,) with the inputs of one instant [s]."""
    wiring, times = problem.wiring, np.array([instant])
    traces = {n: np.array([t]) for n, t in temperatures.items()}
    every = {**traces, **{n: state[[problem.nodes.index(n)]] for n in a.reduced.controllers}}
    modes = dict(zip(problem.control_names, on[:, None].astype(float), strict=True))
    flows = wiring.conductor_flows(a.numbers, traces, times, wiring.shares(a.numbers, every.__getitem__, times, modes.__getitem__))
    # a store has a state of its own, its enthalpy, beside the temperatures
    columns = [*state.tolist(), *(temperatures[n] for n in wiring.network.boundaries)]
    powers = problem.powers(a, np.array([columns]), times, on[None, :] if (on >= 0).any() else None)
    return HeatMap.of_network(
        wiring.network, temperatures, {n: float(w[0]) for n, w in flows.items()}, {n: float(w[0]) for n, w in powers.items()}
    )


def _over_a_period(model: Model, scenario: Scenario, cycle: float | None) -> Steady:
    """Return the periodic state of a model: means over one period, with lowest and highest temperatures. [K]"""
    length = cycle or scenario.seconds or 1.0
    run = simulate(model, replace(scenario, start=PERIODIC, duration=length), times=np.linspace(0.0, length, PERIOD_SAMPLES))
    mean = {n: float(np.trapezoid(run[n].kelvin, run.times)) / length for n in run.nodes}
    low, high = ({n: float(pick(run[n].kelvin)) for n in run.nodes} for pick in (np.min, np.max))
    flows, powers = (
        {n: float(np.trapezoid(w, run.times)) / length for n, w in traces.items()} for traces in (run.heat_flows, run.load_powers)
    )
    network = network_for(model, scenario)
    missing = tuple(f"INCOMPLETE: {what}" for what in model.missing_parts())
    held = f"the mean over a period of {length:g} s of the periodic state"
    return Steady(mean, held, missing, low, high, HeatMap.of_network(network, mean, flows, powers), network.flat.names)


@overload
def steady_levels(model: Model, scenario: Scenario) -> tuple[Steady, ...]: ...


@overload
def steady_levels(model: Block, scenario: Scenario) -> tuple[BlockSolution, ...]: ...


def steady_levels(model: Model | Block, scenario: Scenario) -> tuple[Steady, ...] | tuple[BlockSolution, ...]:
    """Return the steady state under each combination of levels that the inputs take, in the order in which they come up. [K]

    Every input changes by jumps alone; the run is looked through, and the period of the inputs where they repeat. Of a block, solutions of
    one time each.

    Parameters
    ----------
    model : Model or Block  What the hardware is.
    scenario : Scenario     What is done to it.

    Raises
    ------
    ScenarioError   When an input does not stay on levels, or there are more than `MOST_LEVELS`.
    SolverError     As in `steady`.
    """
    if isinstance(model, Block):
        return steady_levels_of_block(model, scenario, MOST_LEVELS)
    plain_scenario, wiring = _wired(model, scenario, True)
    instants = level_instants(wiring.signals, plain_scenario.seconds, scenario.title, MOST_LEVELS)
    return tuple(steady(model, plain_scenario, t) for t in instants)


def _wired(model: Model, scenario: Scenario, whole: bool) -> tuple[Scenario, Wiring]:
    """Return a scenario without its start, which plays no part, and its wiring; with `whole` it lasts a period of its inputs at least."""
    scenario = replace(scenario, start=Kelvin(ICE_POINT), initial={})
    wiring = Wiring(network_for(model, scenario), scenario)
    if whole and wiring.cycle and wiring.cycle > scenario.seconds:
        return _wired(model, scenario.with_(duration=wiring.cycle), False)
    return scenario, wiring
