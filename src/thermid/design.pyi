"""The public names with their types; written by scripts/write_stub.py from the tables in `thermid/__init__.py`."""

from thermid.campaign.stages import (
    RetunePlan as RetunePlan,
    Sizing as Sizing,
    Study as Study,
    WorstCases as WorstCases,
    load_study as load_study,
    plan_retune as plan_retune,
    size as size,
    worst_case as worst_case,
)
from thermid.prediction.advice import Action as Action, Advice as Advice, Aim as Aim, next_test as next_test
from thermid.prediction.bands import Foresight as Foresight, Knowledge as Knowledge, Spread as Spread, foresee as foresee
