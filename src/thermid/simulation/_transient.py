"""Transient runs: a model and a scenario in, a `Solution` out."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, overload

from thermid.base.errors import ScenarioError
from thermid.model.tree import Block, Model
from thermid.simulation._block import BlockSolution, simulate_block
from thermid.simulation._scenarios.scenario import Scenario
from thermid.simulation._simulator import prepare
from thermid.simulation._solution import Solution
from thermid.simulation._solver.problem import Options


@overload
def simulate(
    model: Model, scenario: Scenario, *, every: str | float | None = None, times: Any = None, options: Options | None = None
) -> Solution: ...


@overload
def simulate(
    model: Block,
    scenario: Scenario,
    *,
    every: str | float | None = None,
    times: Any = None,
    options: Options | None = None,
    watch: Iterable[str] | None = None,
    fields: Iterable[float] = (),
) -> BlockSolution: ...


def simulate(
    model: Model | Block,
    scenario: Scenario,
    *,
    every: str | float | None = None,
    times: Any = None,
    options: Options | None = None,
    watch: Iterable[str] | None = None,
    fields: Iterable[float] = (),
) -> Solution:
    """Simulate a model in a scenario: temperatures of all nodes over time, heat flows and the heat balance.

    Parameters
    ----------
    model : Model or Block  What the hardware is.
    scenario : Scenario     What is done to it.
    every : str or float    Interval at which the solution is stored; 301 samples when neither this nor `times` is given. [s]
    times : array           Times at which it is stored. [s]
    options : Options       Tolerances and limits of the integrator.
    watch : iterable        Of a block, what is stored: ``mean``, ``hottest``, ``coldest``, a face (``+x``: its mean), a heater (its mean),
                            a cell (``cell[0,0,0]``); by default the first three and the heaters.
    fields : iterable       Of a block, times at which all temperatures are stored. [s]

    Raises
    ------
    ScenarioError   When the scenario does not fit the model, or vacuum is asked of a coefficient that contains radiation.
    SolverError     When the run ends before its time; the message says at what time, at which node and what to change.
    """
    if isinstance(model, Block):
        return simulate_block(model, scenario, every=every, times=times, options=options, watch=watch, fields=fields)
    if watch is not None or tuple(fields):
        raise ScenarioError(
            "'watch' and 'fields' apply to blocks only; the solution of a model has every node. Leave them out.",
            model.title,
            code="value.without-effect",
        )
    return prepare(model, scenario, every=every, times=times, options=options).run()
