"""Scenarios: what is done to a model."""

from thermid.simulation._scenarios.scenario import STEADY as STEADY, Scenario as Scenario, Start as Start
