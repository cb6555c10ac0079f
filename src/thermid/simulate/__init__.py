"""Running a model in a scenario: transient and steady, with names put back on the results."""

from thermid.simulate.engine import Options
from thermid.simulate.scenario import Scenario, load_scenario
from thermid.simulate.solution import Solution, Trace
from thermid.simulate.steady import steady
from thermid.simulate.transient import simulate

__all__ = ["Options", "Scenario", "Solution", "Trace", "load_scenario", "simulate", "steady"]
