"""Scenarios, and runs of a model in them: transient, steady and many at once, with their solutions."""

from thermid.simulation._block import BlockSolution as BlockSolution
from thermid.simulation._ensemble import Ensemble as Ensemble, run_members as run_members, shares_of as shares_of
from thermid.simulation._heat_map import margin_lines as margin_lines, margins as margins
from thermid.simulation._many.kept import JobFolder as JobFolder, digest as digest
from thermid.simulation._many.tally import PILOT as PILOT, Counted as Counted
from thermid.simulation._many.tasks import KeptTasks as KeptTasks, Workers as Workers, in_tasks as in_tasks
from thermid.simulation._scenarios.scenario import STEADY as STEADY, Scenario as Scenario, Start as Start
from thermid.simulation._simulator import (
    Simulator as Simulator,
    draw as draw,
    ensemble as ensemble,
    network_for as network_for,
    output_times as output_times,
    prepare as prepare,
)
from thermid.simulation._solution import Solution as Solution, Trace as Trace
from thermid.simulation._steady import Steady as Steady, steady as steady, steady_levels as steady_levels
from thermid.simulation._transient import simulate as simulate
