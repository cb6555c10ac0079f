"""Results as JSON objects."""

from thermid.reporting._pages.views import (
    VIEW_SCHEMA as VIEW_SCHEMA,
    calibration_object as calibration_object,
    campaign_object as campaign_object,
    campaign_standing as campaign_standing,
    clean as clean,
    comparison_object as comparison_object,
    fit_object as fit_object,
    retune_object as retune_object,
    solution_object as solution_object,
    swap_object as swap_object,
)
