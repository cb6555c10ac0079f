"""The public names with their types; written by scripts/write_stub.py from the tables in `thermid/__init__.py`."""

from thermid.campaign.stages import joint as joint
from thermid.estimation.estimate import estimate as estimate
from thermid.estimation.estimation import Estimation as Estimation
from thermid.fit.second_clocks import Alignment as Alignment
from thermid.fit.second_clocks import align as align
from thermid.inference.identifiability import Identifiability as Identifiability
from thermid.inference.posterior import Evidence as Evidence
from thermid.inference.posterior import Posterior as Posterior
from thermid.inference.posterior import evidence as evidence
from thermid.inference.posterior import posterior as posterior
from thermid.inference.profile import Profile as Profile
from thermid.inference.profile import Valley as Valley
from thermid.inference.profile import profile as profile
from thermid.inference.profile import valley as valley
from thermid.power.history import PowerHistory as PowerHistory
from thermid.power.history import PowerLaw as PowerLaw
from thermid.power.history import power_history as power_history
