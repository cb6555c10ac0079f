"""The equations of a model: rows of conductors, controls, streams, and the surroundings."""

from thermid.simulation._condensation import surfaces_in_gas as surfaces_in_gas
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
