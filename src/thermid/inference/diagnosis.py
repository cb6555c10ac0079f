"""Checks of a fit: energy balance, causes of residuals, plausible values."""

from thermid.inference._explain.balance import EnergyBalance as EnergyBalance, energy_balance as energy_balance
from thermid.inference._explain.diagnosis import Diagnosis as Diagnosis, diagnose as diagnose
from thermid.inference._explain.plausibility import (
    Plausibility as Plausibility,
    RangeCheck as RangeCheck,
    plausibility as plausibility,
)
from thermid.inference._explain.thresholds import SPECIFIC_HEAT as SPECIFIC_HEAT, WATCHED as WATCHED
