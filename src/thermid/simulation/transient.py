"""Transient runs: a model and a scenario in, a `Solution` out."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from thermid.dual import value_of
from thermid.errors import ScenarioError
from thermid.model.model import Model
from thermid.model.signal import literal
from thermid.network.network import Network, compile_network
from thermid.network.reach import unreached
from thermid.simulation.engine import Engine, Options
from thermid.simulation.run import Run, expand
from thermid.simulation.scenario import Scenario
from thermid.simulation.solution import Solution
from thermid.simulation.wiring import Wiring

__all__ = ["network_for", "output_times", "simulate"]

Array = NDArray[np.float64]
DEFAULT_SAMPLES = 301


def network_for(model: Model, scenario: Scenario) -> Network:
    """Return the model compiled for a scenario: its gases, and the nodes it drives."""
    return compile_network(model, media=scenario.media(), prescribed=tuple(scenario.prescribed))


def output_times(scenario: Scenario, every: str | float | None, times: Any) -> Array:
    """Return the times at which a solution is stored. [s]

    Raises
    ------
    ScenarioError   When the scenario has no duration, or times lie outside it or do not increase.
    """
    if scenario.seconds <= 0:
        raise ScenarioError('a run needs a duration above zero: duration = "5 [h]", or --for "5 [h]".', f"{scenario.title}, duration")
    if times is not None:
        wanted = np.asarray(times, dtype=float)
        if (
            wanted.ndim != 1
            or wanted.size == 0
            or (np.diff(wanted) <= 0).any()
            or wanted[0] < 0
            or wanted[-1] > scenario.seconds * (1 + 1e-12)
        ):
            raise ScenarioError("output times must increase and lie within the duration.", scenario.title)
        return wanted
    if every is None:
        return np.linspace(0.0, scenario.seconds, DEFAULT_SAMPLES)
    step = literal(every, "s", f"{scenario.title}, every") if isinstance(every, str) else float(every)
    if step <= 0:
        raise ScenarioError("the interval of output must be above zero.", scenario.title)
    grid = np.arange(0.0, scenario.seconds * (1 + 1e-12), step)
    return grid if np.isclose(grid[-1], scenario.seconds) else np.append(grid, scenario.seconds)


def simulate(
    model: Model,
    scenario: Scenario,
    *,
    every: str | float | None = None,
    times: Any = None,
    options: Options | None = None,
) -> Solution:
    """Return the temperatures of a model in a scenario.

    Parameters
    ----------
    model : Model           What the hardware is.
    scenario : Scenario     What is done to it.
    every : str or float    Interval at which the solution is stored; 301 samples when neither this nor `times` is given. [s]
    times : array           Times at which it is stored. [s]
    options : Options       Tolerances and limits of the integrator.

    Raises
    ------
    ScenarioError   When the scenario does not fit the model, or vacuum is asked of a coefficient that contains radiation.
    SolverError     When the run ends before its time; the message says at what time, at which node and what to change.
    """
    wanted = output_times(scenario, every, times)
    wiring = Wiring(network_for(model, scenario), scenario)
    engine = Engine(wiring)
    assembled = engine.started(wiring.assemble())
    nodes = assembled.reduced.nodes
    answer = engine.integrate(assembled, wanted, nodes, scenario.seconds, options or Options())
    kept = {n: answer.temperatures[:, k] for k, n in enumerate(nodes)}
    by_node = expand(wiring, assembled, wanted, kept)
    run = Run(wiring, engine, assembled, answer)
    names = run.all_nodes()
    table = np.column_stack([by_node[n] for n in names])
    return Solution(model.title, scenario.title, wanted, names, table, "ok", answer.statistics, _warnings(wiring, scenario), run)


def _warnings(wiring: Wiring, scenario: Scenario) -> tuple[str, ...]:
    """Return what a reader of a solution must know: parts that warm without limit, bounds that are no predictions."""
    numbers = wiring.assemble().numbers
    powers = {}
    for load in wiring.network.flat.loads:
        signal = wiring.signals[f"load {load.path}"]
        first = next(r for r in numbers.loads if r.name == load.path)
        mean = float(np.mean(signal.at(np.linspace(0.0, scenario.seconds, 101))))
        powers[load.path] = mean * (1.0 if f"watts {load.path}" in wiring.signals else value_of(first.coefficients[0]))
    out = [part.message() for part in unreached(wiring.network, numbers, powers)]
    if scenario.as_printed:
        out.append("vacuum as printed: every coefficient is zero, radiation in it included; the temperatures are an upper bound")
    return tuple(out)
