"""The public names with their types; written by scripts/write_stub.py from the tables in `thermid/__init__.py`."""

from thermid.campaign.stages import (
    Changes as Changes,
    CredibilityRecord as CredibilityRecord,
    compare_models as compare_models,
    credibility as credibility,
    joint as joint,
)
from thermid.fit.error_model import Discrepancy as Discrepancy, ErrorModel as ErrorModel, discrepancy as discrepancy
from thermid.fit.estimation import Estimation as Estimation, estimate as estimate
from thermid.fit.power import PowerHistory as PowerHistory, PowerLaw as PowerLaw, power_history as power_history
from thermid.inference.criticism import (
    Criticism as Criticism,
    Diagnosis as Diagnosis,
    EnergyBalance as EnergyBalance,
    Plausibility as Plausibility,
    criticise as criticise,
    diagnose as diagnose,
    energy_balance as energy_balance,
    mistakes_of as mistakes_of,
    plausibility as plausibility,
)
from thermid.inference.fleets import Fleet as Fleet, fleet as fleet
from thermid.inference.intervals import (
    Identifiability as Identifiability,
    Posterior as Posterior,
    Profile as Profile,
    posterior as posterior,
    profile as profile,
)
from thermid.physics.htc import HtcComparison as HtcComparison, compare_htc as compare_htc
from thermid.prediction.bands import Split as Split, predict_record as predict_record, split as split
