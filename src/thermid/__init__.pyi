"""The public names with their types; written by scripts/write_stub.py from the tables in `thermid/__init__.py`."""

from thermid import (
    bench as bench,
    design as design,
    inference as inference,
    interop as interop,
    model as model,
    qualify as qualify,
    reporting as reporting,
    simulation as simulation,
    site as site,
)
from thermid.base import errors as errors
from thermid.base.errors import ThermidError as ThermidError, ThermidWarning as ThermidWarning
from thermid.base.units import celsius as celsius, quantity as quantity
from thermid.campaign.stages import (
    Campaign as Campaign,
    Criteria as Criteria,
    Verdict as Verdict,
    compare as compare,
    run_stages as run_stages,
    validate as validate,
)
from thermid.fit.calibration import Calibration as Calibration, calibrate as calibrate
from thermid.inference.intervals import identifiability as identifiability
from thermid.measure.looks import look as look
from thermid.measure.readers import read_record as read_record
from thermid.measure.records import Channel as Channel, Record as Record
from thermid.model.tree import (
    Block as Block,
    Model as Model,
    load_model as load_model,
    model_from_dict as model_from_dict,
    save_model as save_model,
)
from thermid.prediction.bands import Prediction as Prediction, predict as predict
from thermid.reporting.pages import report as report
from thermid.simulation.runs import (
    Options as Options,
    Scenario as Scenario,
    Solution as Solution,
    ensemble as ensemble,
    load_scenario as load_scenario,
    prepare as prepare,
    simulate as simulate,
    steady as steady,
)
from thermid.values.store import load_values as load_values

__version__: str
__all__: list[str]
