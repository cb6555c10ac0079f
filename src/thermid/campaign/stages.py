"""Campaigns: stages of fits, their values and state; verdicts, correlation and limits; studies and replaced parts."""

from thermid.campaign._cache import KeptStage as KeptStage, file_name as file_name
from thermid.campaign._credibility import CredibilityRecord as CredibilityRecord, credibility as credibility
from thermid.campaign._file import CampaignSource as CampaignSource, plain_tables as plain_tables, scenario_of as scenario_of
from thermid.campaign._joint import JointFit as JointFit
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
from thermid.campaign._methodology import Study as Study, load_study as load_study
from thermid.campaign._retune import (
    RetunePlan as RetunePlan,
    check_replacement as check_replacement,
    new_logs as new_logs,
    plan_retune as plan_retune,
)
from thermid.campaign._stages import (
    Campaign as Campaign,
    joint as joint,
    keyed as keyed,
    next_command as next_command,
    request_of as request_of,
    run_stages as run_stages,
)
from thermid.campaign._survey import (
    RunningTest as RunningTest,
    campaign_predictions as campaign_predictions,
    check_campaign as check_campaign,
    fleet_in as fleet_in,
    survey as survey,
)
