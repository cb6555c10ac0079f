"""Scenarios: what is done to a model, from Python and from files."""

from thermid.simulation._scenario_file import load_scenario as load_scenario
from thermid.simulation._scenarios.columns import LogColumns as LogColumns
from thermid.simulation._scenarios.scenario import SLOTS as SLOTS, STEADY as STEADY, Scenario as Scenario, Start as Start
