"""Running a model in a scenario: transient and steady, with names put back on the results."""

from thermid.simulation.engine import Options
from thermid.simulation.scenario import Scenario, load_scenario
from thermid.simulation.solution import Solution, Trace
from thermid.simulation.steady import steady
from thermid.simulation.transient import simulate

__all__ = ["Options", "Scenario", "Solution", "Trace", "load_scenario", "simulate", "steady"]
