"""The problem of a fit: records attached to a model, unknowns, priors, residuals."""

from thermid.fit._inputs import Input as Input, InputTable as InputTable, input_lines as input_lines, inputs_of as inputs_of
from thermid.fit._problem.experiment import (
    MEASURED as MEASURED,
    SCALE as SCALE,
    Experiment as Experiment,
    Observation as Observation,
    as_found as as_found,
    at_their_seats as at_their_seats,
    attached as attached,
    bind as bind,
    first_reading as first_reading,
    power_while_on as power_while_on,
    role_and_target as role_and_target,
)
from thermid.fit._problem.gather import build_problem as build_problem, prior_of as prior_of, wired as wired
from thermid.fit._problem.request import (
    LocalSpec as LocalSpec,
    Reading as Reading,
    Request as Request,
    digest as digest,
    freed as freed,
    ingredients_of as ingredients_of,
    is_glob as is_glob,
    key_of as key_of,
    matching as matching,
    priors_of as priors_of,
    shared_paths as shared_paths,
    weighing as weighing,
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
    parameter_unknown as parameter_unknown,
    prior_rows as prior_rows,
    starting_point as starting_point,
    wanders as wanders,
)
