"""Fits: calibrate, its result, the solver and the search for a start."""

from thermid.fit._calibrate import (
    calibrate as calibrate,
    fit as fit,
    fit_problem as fit_problem,
    in_place as in_place,
    requested as requested,
)
from thermid.fit._calibration import (
    BLAME as BLAME,
    FIRST as FIRST,
    LOUD as LOUD,
    Calibration as Calibration,
    instrument_shares as instrument_shares,
    sensor_shares as sensor_shares,
)
from thermid.fit._minimisation import (
    Fit as Fit,
    KeptFit as KeptFit,
    covariances as covariances,
    descend as descend,
    minimise as minimise,
)
from thermid.fit._search import box_of as box_of
from thermid.fit._second_clocks import Alignment as Alignment, align as align
