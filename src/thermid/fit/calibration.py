"""Fits: what is compared and what is free, calibrate and its result, the errors of fitted values."""

from thermid.fit._calibrate import (
    calibrate as calibrate,
    fit as fit,
    fit_problem as fit_problem,
    in_place as in_place,
    requested as requested,
    strange_powers as strange_powers,
)
from thermid.fit._calibration import (
    FIRST as FIRST,
    LOUD as LOUD,
    Calibration as Calibration,
    blame_of as blame_of,
    fitted_values as fitted_values,
)
from thermid.fit._inputs import Input as Input, InputTable as InputTable, input_lines as input_lines
from thermid.fit._minimisation import (
    MOST_EVALUATIONS as MOST_EVALUATIONS,
    Fit as Fit,
    KeptFit as KeptFit,
    covariances as covariances,
    descend as descend,
    minimise as minimise,
)
from thermid.fit._problem.experiment import (
    MEASURED as MEASURED,
    SCALE as SCALE,
    Experiment as Experiment,
    Observation as Observation,
    as_found as as_found,
    attached as attached,
    first_reading as first_reading,
    role_and_target as role_and_target,
)
from thermid.fit._problem.gather import build_problem as build_problem, clock_suffix as clock_suffix, prior_of as prior_of
from thermid.fit._problem.request import (
    LocalSpec as LocalSpec,
    Reading as Reading,
    Request as Request,
    counted_twice as counted_twice,
    digest as digest,
    freed as freed,
    is_glob as is_glob,
    matching as matching,
    priors_of as priors_of,
    shared_paths as shared_paths,
)
from thermid.fit._problem.residuals import (
    Bench as Bench,
    Compressed as Compressed,
    Influence as Influence,
    Prior as Prior,
    Problem as Problem,
    SensorStatistics as SensorStatistics,
    SensorTrace as SensorTrace,
    Sums as Sums,
    Unknown as Unknown,
    starting_point as starting_point,
)
from thermid.fit._search import box_of as box_of
from thermid.fit._uncertainty.groups import Group as Group, percent as percent
from thermid.fit._uncertainty.information import Information as Information
from thermid.fit._uncertainty.moved import (
    MOVED as MOVED,
    NOT_REJECTED as NOT_REJECTED,
    UNDECIDED as UNDECIDED,
    Move as Move,
    MovedGroup as MovedGroup,
    Moves as Moves,
    moved_instruments as moved_instruments,
    moves_from as moves_from,
    part_of as part_of,
)
from thermid.fit._uncertainty.noise import (
    Binned as Binned,
    TraceNoise as TraceNoise,
    answers_to_inputs as answers_to_inputs,
    autocorrelation as autocorrelation,
    evidences as evidences,
    score_excess as score_excess,
    wander_times as wander_times,
    white_rows as white_rows,
)
