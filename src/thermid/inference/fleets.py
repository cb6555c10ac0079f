"""Fleets: the population of the units of one design."""

from thermid.inference._fleet.fleet import Fleet as Fleet
from thermid.inference._fleet.units import fleet as fleet, fleet_of as fleet_of
