"""Fleets: the population of the units of one design."""

from thermid.inference._fleet.units import Fleet as Fleet, fleet as fleet, fleet_of as fleet_of
