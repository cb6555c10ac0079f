"""Scenarios, and runs of a model in them: transient, steady and many at once, with their solutions.

The equations of a model that they solve: rows of conductors, controls, streams, and the surroundings.
"""

from thermid.simulation._block import BlockSolution as BlockSolution
from thermid.simulation._condensation import surfaces_in_gas as surfaces_in_gas
from thermid.simulation._duty import DutyCycle as DutyCycle
from thermid.simulation._ensemble import Ensemble as Ensemble, shares_of as shares_of
from thermid.simulation._heat_map import margin_lines as margin_lines, margins as margins
from thermid.simulation._many.kept import JobFolder as JobFolder, digest as digest
from thermid.simulation._many.tally import PILOT as PILOT, Counted as Counted
from thermid.simulation._many.tasks import KeptTasks as KeptTasks, Workers as Workers, in_tasks as in_tasks
from thermid.simulation._network.controls import control_names as control_names
from thermid.simulation._network.environment import Environment as Environment
from thermid.simulation._network.irradiation import MAX_IRRADIATION as MAX_IRRADIATION, Irradiation as Irradiation, Sky as Sky
from thermid.simulation._network.linear import modes as modes, state_space as state_space
from thermid.simulation._network.medium import VACUUM_LIMIT as VACUUM_LIMIT, Media as Media
from thermid.simulation._network.network import Network as Network, Numbers as Numbers, compile_network as compile_network
from thermid.simulation._network.rows import (
    SMOOTHING as SMOOTHING,
    ConductorRow as ConductorRow,
    conductance as conductance,
    curve_arrays as curve_arrays,
    tables_behind as tables_behind,
)
from thermid.simulation._network.streams import signal_of as signal_of
from thermid.simulation._scenarios.scenario import STEADY as STEADY, Scenario as Scenario, Start as Start
from thermid.simulation._scenarios.scenario_file import (
    LogColumns as LogColumns,
    environments_of as environments_of,
    load_scenario as load_scenario,
    scenario_from_table as scenario_from_table,
)
from thermid.simulation._simulator import (
    Simulator as Simulator,
    draw as draw,
    ensemble as ensemble,
    network_for as network_for,
    output_times as output_times,
    prepare as prepare,
)
from thermid.simulation._solution import Solution as Solution, Trace as Trace
from thermid.simulation._solver.engine import Engine as Engine, Squares as Squares, Weighing as Weighing, settle as settle
from thermid.simulation._solver.extremes import Dense as Dense, MemberTurnings as MemberTurnings, resolved as resolved
from thermid.simulation._solver.problem import (
    Answer as Answer,
    Options as Options,
    Traces as Traces,
    kept_for as kept_for,
    refuse_unseen as refuse_unseen,
)
from thermid.simulation._solver.wiring import (
    Assembled as Assembled,
    Jump as Jump,
    Wiring as Wiring,
    read_schedule as read_schedule,
)
from thermid.simulation._steady import Steady as Steady, steady as steady, steady_levels as steady_levels
from thermid.simulation._transient import simulate as simulate
