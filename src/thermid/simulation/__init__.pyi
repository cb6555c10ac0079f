"""The public names with their types; written by scripts/write_stub.py from the tables in `thermid/__init__.py`."""

from thermid.simulation.network import (
    Environment as Environment,
    Irradiation as Irradiation,
    compile_network as compile_network,
    modes as modes,
    state_space as state_space,
)
from thermid.simulation.runs import (
    BlockSolution as BlockSolution,
    Ensemble as Ensemble,
    KeptTasks as KeptTasks,
    Simulator as Simulator,
    Steady as Steady,
    draw as draw,
    steady_levels as steady_levels,
)
