"""Records of measured readings and their channels."""

from thermid.measure._record.channel import (
    COLUMN_UNITS as COLUMN_UNITS,
    ROLES as ROLES,
    SENSOR_FAULT_CODES as SENSOR_FAULT_CODES,
    BoolArray as BoolArray,
    Channel as Channel,
    FloatArray as FloatArray,
    Origin as Origin,
    SecondClock as SecondClock,
    even_step as even_step,
    gap_from as gap_from,
    open_questions as open_questions,
    stray_readings as stray_readings,
    stretch as stretch,
    unrounded as unrounded,
    usual_step as usual_step,
    within_log as within_log,
)
from thermid.measure._record.record import (
    Record as Record,
    clock_range as clock_range,
    thinned as thinned,
    thinned_step as thinned_step,
    without_strays as without_strays,
)
from thermid.measure._record.rounding import blur_of as blur_of, shared_rounding as shared_rounding
