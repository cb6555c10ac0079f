"""Verdicts on hold-out records, correlation, limits, margins, metrics."""

from thermid.campaign._judge.changes import Changes as Changes, compare_models as compare_models
from thermid.campaign._judge.correlation import (
    Correlation as Correlation,
    Exclusions as Exclusions,
    Overlay as Overlay,
    correlate as correlate,
    overlays as overlays,
    paired as paired,
)
from thermid.campaign._judge.limits import (
    POLICIES as POLICIES,
    HeaterDuty as HeaterDuty,
    LimitCheck as LimitCheck,
    Limits as Limits,
    Margin as Margin,
    check_limits as check_limits,
    check_readings as check_readings,
    heater_duty as heater_duty,
    load_limits as load_limits,
    margins as margins,
    read_limits as read_limits,
    spans as spans,
)
from thermid.campaign._judge.predictions import CampaignPrediction as CampaignPrediction
from thermid.campaign._judge.verdict import (
    CRITERIA as CRITERIA,
    Check as Check,
    Criteria as Criteria,
    CriteriaSet as CriteriaSet,
    Verdict as Verdict,
    compare as compare,
    heading as heading,
    metric as metric,
    validate as validate,
)
from thermid.campaign._judge.worst import Sizing as Sizing, WorstCases as WorstCases, size as size, worst_case as worst_case
