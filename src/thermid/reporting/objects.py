"""Results as JSON objects."""

from thermid.reporting._pages.views import (
    calibration_object as calibration_object,
    campaign_object as campaign_object,
    campaign_standing as campaign_standing,
    fit_object as fit_object,
    retune_object as retune_object,
    swap_object as swap_object,
)
