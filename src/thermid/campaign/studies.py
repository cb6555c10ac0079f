"""Replaced parts, whole studies, and the record of credibility."""

from thermid.campaign._credibility import CredibilityRecord as CredibilityRecord, credibility as credibility
from thermid.campaign._methodology import Study as Study, load_study as load_study
from thermid.campaign._retune import (
    RetunePlan as RetunePlan,
    check_replacement as check_replacement,
    new_logs as new_logs,
    plan_retune as plan_retune,
)
