"""Fleets: the population of the units of one design."""

from thermid.inference._fleet.fleet import (
    Covariates as Covariates,
    Effect as Effect,
    Fleet as Fleet,
    OddUnit as OddUnit,
    PopulationValue as PopulationValue,
    SharedVariation as SharedVariation,
    fleet as fleet,
    fleet_of as fleet_of,
)
