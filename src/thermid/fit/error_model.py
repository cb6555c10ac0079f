"""The model of error of a fit: what it leaves open of its values and of its elements, and how a run follows that."""

from thermid.fit._error_model.courses import (
    FREE_AIR as FREE_AIR,
    OperatingPoint as OperatingPoint,
    constant_coefficients as constant_coefficients,
    course_of as course_of,
)
from thermid.fit._error_model.discrepancy import (
    MAX_GAS_CONDUCTANCE as MAX_GAS_CONDUCTANCE,
    STRUCTURAL_KEY as STRUCTURAL_KEY,
    Discrepancy as Discrepancy,
    contacts_in_other_gas as contacts_in_other_gas,
    discrepancy as discrepancy,
    discrepancy_kept as discrepancy_kept,
    kept_in as kept_in,
    told_first as told_first,
)
from thermid.fit._error_model.elements import (
    AS_BUILT as AS_BUILT,
    DepartureHeat as DepartureHeat,
    with_heats as with_heats,
    with_laws as with_laws,
)
from thermid.fit._error_model.gaussian import NormalMixture as NormalMixture
from thermid.fit._error_model.kept import (
    ERRORS_KEY as ERRORS_KEY,
    ErrorModel as ErrorModel,
    Keeping as Keeping,
    KeptWay as KeptWay,
    SeenValue as SeenValue,
    deviations_of_run as deviations_of_run,
    errors_after as errors_after,
    errors_of_values as errors_of_values,
    errors_without as errors_without,
)
from thermid.fit._error_model.model import course_in_fit as course_in_fit
from thermid.fit._error_model.own_values import (
    BALANCE as BALANCE,
    OwnValue as OwnValue,
    own_value as own_value,
    own_values_kept as own_values_kept,
)
from thermid.fit._error_model.records import (
    BandCause as BandCause,
    BesideRow as BesideRow,
    RecordRun as RecordRun,
    problem_of_record as problem_of_record,
    shared_with as shared_with,
    split as split,
)
from thermid.fit._error_model.runs import widened as widened
from thermid.fit._error_model.sizes import LACK_ODDS as LACK_ODDS, SIZES as SIZES
