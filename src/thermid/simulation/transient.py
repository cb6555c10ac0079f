"""Transient runs: a model and a scenario in, a `Solution` out."""

from __future__ import annotations

from typing import Any

from thermid.model.model import Model
from thermid.simulation.engine import Options
from thermid.simulation.scenario import Scenario
from thermid.simulation.simulator import prepare
from thermid.simulation.solution import Solution

__all__ = ["simulate"]


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
    return prepare(model, scenario, every=every, times=times, options=options).run()
