"""How steady readings are, with the error of that."""

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
    channel_drift as channel_drift,
    channel_stability as channel_stability,
    effective_samples as effective_samples,
    rule_of as rule_of,
    since_when as since_when,
    spans as spans,
    verdict_of as verdict_of,
)
