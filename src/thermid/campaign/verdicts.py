"""Verdicts on hold-out records, correlation, limits, margins, metrics."""

from thermid.campaign._judge.changes import Changes as Changes, compare_models as compare_models
from thermid.campaign._judge.correlation import (
    Correlation as Correlation,
    Difference as Difference,
    Exclusions as Exclusions,
    Overlay as Overlay,
    correlate as correlate,
    difference as difference,
    overlays as overlays,
    paired as paired,
)
from thermid.campaign._judge.criteria import (
    CRITERIA as CRITERIA,
    Check as Check,
    Criteria as Criteria,
    CriteriaSet as CriteriaSet,
    heading as heading,
    metric as metric,
)
from thermid.campaign._judge.limits import (
    LimitCheck as LimitCheck,
    Limits as Limits,
    check_limits as check_limits,
    check_readings as check_readings,
    load_limits as load_limits,
    read_limits as read_limits,
    spans as spans,
)
from thermid.campaign._judge.margins import (
    POLICIES as POLICIES,
    HeaterDuty as HeaterDuty,
    Margin as Margin,
    heater_duty as heater_duty,
    margins as margins,
)
from thermid.campaign._judge.predictions import CampaignPrediction as CampaignPrediction
from thermid.campaign._judge.sizing import Sizing as Sizing, size as size
from thermid.campaign._judge.verdict import Verdict as Verdict, compare as compare, validate as validate
from thermid.campaign._judge.worst import WorstCases as WorstCases, worst_case as worst_case
