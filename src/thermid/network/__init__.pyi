"""The public names with their types; written by scripts/write_stub.py from the tables in `thermid/__init__.py`."""

from thermid.network.environment import Environment as Environment
from thermid.network.irradiation import Irradiation as Irradiation
from thermid.network.linear import modes as modes
from thermid.network.linear import state_space as state_space
from thermid.network.network import compile_network as compile_network
