"""The public names with their types; written by scripts/write_stub.py from the tables in `thermid/__init__.py`."""

from thermid.simulation.runs import (
    BlockSolution as BlockSolution,
    Ensemble as Ensemble,
    Environment as Environment,
    Irradiation as Irradiation,
    KeptTasks as KeptTasks,
    Simulator as Simulator,
    Steady as Steady,
    compile_network as compile_network,
    draw as draw,
    modes as modes,
    state_space as state_space,
    steady_levels as steady_levels,
)
