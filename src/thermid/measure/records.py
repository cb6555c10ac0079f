"""Records of measured readings and their channels."""

from thermid.measure._record.channel import (
    COLUMN_UNITS as COLUMN_UNITS,
    ROLES as ROLES,
    UNSEEN_PULSES as UNSEEN_PULSES,
    Channel as Channel,
    Origin as Origin,
    SecondClock as SecondClock,
    gap_from as gap_from,
    open_questions as open_questions,
    single_pulses as single_pulses,
    stray_readings as stray_readings,
    unrounded as unrounded,
    usual_step as usual_step,
)
from thermid.measure._record.record import Record as Record, thinned_step as thinned_step
from thermid.measure._record.rounding import blur_of as blur_of, shared_rounding as shared_rounding
from thermid.measure._record.sensor import (
    ICE as ICE,
    TEMPERATURES as TEMPERATURES,
    SensorCertificate as SensorCertificate,
    SensorPart as SensorPart,
)
from thermid.measure._record.steadiness import (
    DOUBT_IN_ERRORS as DOUBT_IN_ERRORS,
    MIN_INDEPENDENT_SHARE as MIN_INDEPENDENT_SHARE,
    MIN_JUDGED_WINDOW as MIN_JUDGED_WINDOW,
    RULES as RULES,
    TAU_ERROR as TAU_ERROR,
    ChannelStability as ChannelStability,
    StabilityRule as StabilityRule,
    SteadyPoint as SteadyPoint,
    SteadyValue as SteadyValue,
    effective_samples as effective_samples,
    spans as spans,
)
