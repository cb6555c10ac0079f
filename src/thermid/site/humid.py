"""Humidity along a profile: dew points, margins and films, with the heat of settling water where that finds a balance."""

from __future__ import annotations

from collections.abc import Callable

from thermid.errors import ScenarioError, SolverError
from thermid.model.laws.signal import Signal
from thermid.model.tree.model import Model
from thermid.network.network import compile_network
from thermid.simulation.scenarios.scenario import Scenario
from thermid.simulation.solution import Solution
from thermid.site.moisture import Moisture, moisture
from thermid.site.vapour import follow

LEFT_OUT = (
    "the heat of settling and drying water found no balance with the temperatures and was left out: while water settles the "
    "margins are too small and the films too thick, and they dry sooner than they would"
)


def humid(
    model: Model,
    scenario: Scenario,
    humidity: Signal,
    gases: tuple[str, ...],
    solution: Solution,
    every: float,
    told: Callable[[int, float], None] | None = None,
) -> tuple[Moisture, str]:
    """Return what humidity does along a run, and a remark where its latent heat was left out.

    Parameters
    ----------
    model, scenario : Model, Scenario   The whole run.
    humidity : Signal                   Relative humidity of the chamber. [-]
    gases : tuple of str                Boundaries that are the chamber.
    solution : Solution                 The same run without moisture.
    every : float                       Time between outputs. [s]
    told : callable                     Told after each pass of the balance, as in `moisture`.

    Raises
    ------
    ScenarioError   When no surface exchanges heat with the chamber as with a gas.
    """
    flat = compile_network(model, media=scenario.media()).flat
    parts = [c for c in flat.conductors if c.kind in ("convection", "effective") and c.path in flat.surfaces and c.gas in gases]
    if not parts:
        raise ScenarioError(
            f"no surface exchanges heat with {' or '.join(gases)} by convection, so humidity has nothing to settle on. "
            "Give the deck surfaces, or run the profile without humidity.",
            scenario.title,
        )
    air = {c.gas: humidity for c in parts}
    try:
        return moisture(model, scenario, air, every=every, told=told), ""
    except (ScenarioError, SolverError):
        return Moisture.of(solution, parts, follow(solution, parts, air, {})), LEFT_OUT
