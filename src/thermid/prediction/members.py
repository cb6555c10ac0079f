"""Many runs with drawn inputs: hold times, bands, drivers."""

from thermid.prediction._monte_carlo.hold import (
    Hold as Hold,
    HoldQuestion as HoldQuestion,
    clock as clock,
    hold as hold,
    load_hold as load_hold,
)
from thermid.prediction._monte_carlo.sobol import sobol_of as sobol_of
from thermid.prediction._monte_carlo.uncertain import UncertainRuns as UncertainRuns, uncertain_runs as uncertain_runs
