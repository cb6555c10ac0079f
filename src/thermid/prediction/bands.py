"""Predictions with bands: of scenarios, of records, before any test; their sources of uncertainty."""

from thermid.prediction._budget import (
    SILENT as SILENT,
    UNFITTED as UNFITTED,
    Spread as Spread,
)
from thermid.prediction._known import Knowledge as Knowledge, known_of as known_of
from thermid.prediction._predict import (
    IN_TESTS as IN_TESTS,
    Band as Band,
    Foresight as Foresight,
    Prediction as Prediction,
    foresee as foresee,
    predict as predict,
)
from thermid.prediction._records import (
    RecordPrediction as RecordPrediction,
    predict_record as predict_record,
    record_bands as record_bands,
    record_request as record_request,
)
from thermid.prediction._setting import assumed_effects as assumed_effects
from thermid.prediction._split import Split as Split, split as split
