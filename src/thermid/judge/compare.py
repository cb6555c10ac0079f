"""`compare`: a model as it stands against a record, nothing fitted."""

from __future__ import annotations

from thermid.arguments import takes_objects
from thermid.fit.calibrate import fit
from thermid.fit.calibration import Calibration
from thermid.fit.problem.request import Request
from thermid.measure import Record
from thermid.model.tree.model import Model
from thermid.simulation.scenarios.scenario import Scenario


@takes_objects
def compare(model: Model, record: Record, *, scenario: Scenario | None = None, window: float = 0.0) -> Calibration:
    """Return measured and predicted readings of a record, with statistics per sensor; no value is changed.

    Parameters
    ----------
    model : Model           What the hardware is.
    record : Record         The log.
    scenario : Scenario     What the log does not say.
    window : float          First readings, at which observed nodes start, are medians over this time. [s]

    Raises
    ------
    ThermidError   When the record does not fit the model.
    """
    request = Request(model, (record,), scenarios={"*": scenario} if scenario else {}, held_errors={}, window=window, fit_start=False)
    return fit(request)
