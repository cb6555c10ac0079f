"""How steady readings are, with the error of that."""

from thermid.measure._record.steadiness import (
    CORRELATED as CORRELATED,
    DOUBT_IN_ERRORS as DOUBT_IN_ERRORS,
    RULES as RULES,
    SHORTEST as SHORTEST,
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
