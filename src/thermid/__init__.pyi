"""The public names with their types; written by scripts/write_stub.py from the tables in `thermid/__init__.py`."""

from thermid import bench as bench
from thermid import design as design
from thermid import errors as errors
from thermid import explain as explain
from thermid import inference as inference
from thermid import interop as interop
from thermid import model as model
from thermid import network as network
from thermid import qualify as qualify
from thermid import reporting as reporting
from thermid import simulation as simulation
from thermid import site as site
from thermid.campaign.stages import Campaign as Campaign
from thermid.campaign.stages import run_stages as run_stages
from thermid.errors import ThermidError as ThermidError
from thermid.errors import ThermidWarning as ThermidWarning
from thermid.expression import celsius as celsius
from thermid.expression import quantity as quantity
from thermid.fit.calibrate import calibrate as calibrate
from thermid.fit.calibration import Calibration as Calibration
from thermid.inference.identifiability import identifiability as identifiability
from thermid.judge.criteria import Criteria as Criteria
from thermid.judge.verdict import Verdict as Verdict
from thermid.judge.verdict import compare as compare
from thermid.judge.verdict import validate as validate
from thermid.knowledge.values import load_values as load_values
from thermid.measure import Channel as Channel
from thermid.measure import Record as Record
from thermid.measure import read_record as read_record
from thermid.model.blocks.block import Block as Block
from thermid.model.deck.modelfile import load_model as load_model
from thermid.model.deck.modelfile import model_from_dict as model_from_dict
from thermid.model.deck.save import save_model as save_model
from thermid.model.tree.model import Model as Model
from thermid.prediction.predict import Prediction as Prediction
from thermid.prediction.predict import predict as predict
from thermid.reporting.pages.campaign import report as report
from thermid.reporting.pictures.look import look as look
from thermid.simulation.scenario_file import load_scenario as load_scenario
from thermid.simulation.scenarios.scenario import Scenario as Scenario
from thermid.simulation.simulator import ensemble as ensemble
from thermid.simulation.simulator import prepare as prepare
from thermid.simulation.solution import Solution as Solution
from thermid.simulation.solver.problem import Options as Options
from thermid.simulation.steady import steady as steady
from thermid.simulation.transient import simulate as simulate

__version__: str
__all__: list[str]
