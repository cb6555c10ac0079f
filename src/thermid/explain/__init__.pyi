"""The public names with their types; written by scripts/write_stub.py from the tables in `thermid/__init__.py`."""

from thermid.campaign.credibility import CredibilityRecord as CredibilityRecord
from thermid.campaign.credibility import credibility as credibility
from thermid.explain.balance import EnergyBalance as EnergyBalance
from thermid.explain.balance import energy_balance as energy_balance
from thermid.explain.criticism import Criticism as Criticism
from thermid.explain.criticism import criticise as criticise
from thermid.explain.diagnosis import Diagnosis as Diagnosis
from thermid.explain.diagnosis import diagnose as diagnose
from thermid.explain.plausibility import Plausibility as Plausibility
from thermid.explain.plausibility import plausibility as plausibility
from thermid.fit.discrepancy import Discrepancy as Discrepancy
from thermid.fit.discrepancy import discrepancy as discrepancy
from thermid.judge.difference import Difference as Difference
from thermid.judge.difference import difference as difference
from thermid.physics.htc import HtcComparison as HtcComparison
from thermid.physics.htc import compare_htc as compare_htc
from thermid.prediction.split import Split as Split
from thermid.prediction.split import split as split
