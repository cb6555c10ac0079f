"""Scenarios, and how they are read from files, which may name columns of logs: apart, so that a first result loads no reader of logs."""

from thermid.simulation._scenarios.scenario import Scenario as Scenario
from thermid.simulation._scenarios.scenario_file import (
    LogColumns as LogColumns,
    environments_of as environments_of,
    load_scenario as load_scenario,
)
