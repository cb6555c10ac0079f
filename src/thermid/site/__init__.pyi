"""The public names with their types; written by scripts/write_stub.py from the tables in `thermid/__init__.py`."""

from thermid.site.ascent import (
    AscentCheck as AscentCheck,
    Trajectory as Trajectory,
    ascent_checks as ascent_checks,
    ascent_scenario as ascent_scenario,
    read_trajectory as read_trajectory,
)
from thermid.site.moisture import Moisture as Moisture, moisture as moisture
from thermid.site.orbit import orbit_fluxes as orbit_fluxes
from thermid.site.pad import OpenSky as OpenSky, pad_scenario as pad_scenario
from thermid.site.site import Site as Site, Weather as Weather, read_weather as read_weather
from thermid.site.vapour import Volume as Volume, WaterBalance as WaterBalance
