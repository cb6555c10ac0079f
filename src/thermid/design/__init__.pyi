"""The public names with their types; written by scripts/write_stub.py from the tables in `thermid/__init__.py`."""

from thermid.campaign.methodology import Study as Study
from thermid.campaign.methodology import load_study as load_study
from thermid.campaign.retune import RetunePlan as RetunePlan
from thermid.campaign.retune import plan_retune as plan_retune
from thermid.design.next_test import Action as Action
from thermid.design.next_test import Advice as Advice
from thermid.design.next_test import Aim as Aim
from thermid.design.next_test import next_test as next_test
from thermid.prediction.budget import Spread as Spread
from thermid.prediction.known import Known as Known
from thermid.prediction.predict import Foresight as Foresight
from thermid.prediction.predict import foresee as foresee
