"""The public names with their types; written by scripts/write_stub.py from the tables in `thermid/__init__.py`."""

from thermid.simulation.block import BlockSolution as BlockSolution
from thermid.simulation.draws import draw as draw
from thermid.simulation.ensemble import Ensemble as Ensemble
from thermid.simulation.simulator import Simulator as Simulator
from thermid.simulation.steady import Steady as Steady
from thermid.simulation.steady import steady_levels as steady_levels
