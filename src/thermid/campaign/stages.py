"""Campaigns: stages of fits, the values that they pass on, their state."""

from thermid.campaign._cache import (
    changed_since as changed_since,
    errors_kept as errors_kept,
    file_name as file_name,
    recall as recall,
    remember as remember,
)
from thermid.campaign._file import (
    CampaignSource as CampaignSource,
    campaign_of as campaign_of,
    local_of as local_of,
    read_campaign as read_campaign,
    scenario_of as scenario_of,
)
from thermid.campaign._joint import JointFit as JointFit
from thermid.campaign._stages import (
    Campaign as Campaign,
    joint as joint,
    judge as judge,
    keyed as keyed,
    next_command as next_command,
    plain_readings as plain_readings,
    request_of as request_of,
    run_stages as run_stages,
)
from thermid.campaign._survey import (
    RunningTest as RunningTest,
    campaign_predictions as campaign_predictions,
    check_campaign as check_campaign,
    fleet_in as fleet_in,
    running_test as running_test,
    survey as survey,
)
