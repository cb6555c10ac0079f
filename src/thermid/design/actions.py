"""What could be tested next: scenarios with their sensors, made from one that was run before."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from thermid.design.planned import Sensor
from thermid.dual import value_of
from thermid.model.laws.signal import Constant, Signal, Table
from thermid.model.tree.model import Model
from thermid.simulation.scenarios.scenario import Scenario
from thermid.simulation.simulator import network_for

CHAMBER_STEP = 20.0
"""Step of a chamber that costs little and is far from what most parts fear. [K]"""


@dataclass(frozen=True)
class Aim:
    """A temperature that is to be known better.

    Parameters
    ----------
    scenario : Scenario     Where.
    node : str              Of what.
    at : str or float       When; the end when empty. [s]
    """

    scenario: Scenario
    node: str
    at: str | float = ""

    def __str__(self) -> str:
        """It in words."""
        when = f" at {self.at}" if self.at else " at the end"
        return f"'{self.node}' in '{self.scenario.title}'{when}"


@dataclass(frozen=True, eq=False)
class Action:
    """A test that could be made.

    Parameters
    ----------
    name : str                  In words.
    scenario : Scenario         What is done; its duration is the longest that is thought of.
    sensors : tuple of Sensor   What is logged; empty for the sensors there are.
    """

    name: str
    scenario: Scenario
    sensors: tuple[Sensor, ...] = ()


def usual_actions(model: Model, scenario: Scenario, sensors: Sequence[Sensor]) -> tuple[Action, ...]:
    """Return the tests that are usually at hand: the same for longer, power and chamber steps, other powers, another sensor, a pump-down.

    Parameters
    ----------
    model : Model
    scenario : Scenario             A test as it was made; its duration holds for all.
    sensors : sequence of Sensor    What is logged.
    """
    network = network_for(model, scenario)
    half = 0.5 * scenario.seconds
    out = [Action("the same test again", scenario)]
    powers = {row.name: float(value_of(row.coefficients[0])) for row in network.numbers().loads if row.fixed}
    metered = {s.target for s in sensors if s.role == "load"} | set(scenario.loads)
    for load, own in powers.items():
        watts = _level(scenario.loads.get(load), own)
        if watts > 0 and load not in scenario.commands:
            # a power that nobody meters is as unknown at twice its level as it is now: then the command changes, not the power
            table, unit = ("loads", watts) if load in metered else ("commands", 1.0)
            words = f"from {watts:.3g} to {2 * watts:.3g} W" if load in metered else "to twice its power"
            up, off = (Table(np.array([0.0, half]), unit * np.array([1.0, end]), True) for end in (2.0, 0.0))
            out.append(Action(f"'{load}' {words} after half the time", scenario.with_(**{table: {load: up}})))
            twice = f"at {2 * watts:.3g} W" if load in metered else "at twice its power"
            out.append(Action(f"'{load}' {twice}", scenario.with_(**{table: {load: Constant(2.0 * unit)}})))
            out.append(Action(f"'{load}' off after half the time", scenario.with_(**{table: {load: off}})))
    for boundary, signal in scenario.boundaries.items():
        level = _level(signal, 0.0)
        ramp = Table(
            np.array([0.0, half, half + 600.0, max(2.0 * half, half + 601.0)]), level + np.array([0.0, 0.0, 1.0, 1.0]) * CHAMBER_STEP
        )
        made = scenario.with_(boundaries={boundary: ramp})
        out.append(Action(f"'{boundary}' {CHAMBER_STEP:g} K warmer after half the time", made))
    seen = {s.target for s in sensors if s.role == "node"}
    noise = min((s.noise for s in sensors if s.role == "node" and s.noise), default=0.1)
    accuracy = next((s.accuracy for s in sensors if s.role == "node" and s.accuracy), None)
    for node in (n for n in network.nodes if n not in seen):
        more = Sensor(f"new sensor at {node}", node, "node", noise, accuracy)
        out.append(Action(f"the same with a sensor at '{node}'", scenario, (*sensors, more)))
    out.append(Action("the same, pumped down", scenario.vacuum()))
    return tuple(out)


def _level(signal: Signal | None, own: float) -> float:
    """Return where a signal begins."""
    return own if signal is None else float(signal.at(np.zeros(1))[0])
