"""What drove the readings of a record, and what the whole model did beside them: temperatures, heat flows and powers over time."""

from __future__ import annotations

import numpy as np

from thermid.base.errors import ThermidError
from thermid.base.linear_algebra import Array
from thermid.fit.calibration import Calibration
from thermid.model.tree import Model, flatten
from thermid.reporting._pictures.figures import RecordDrive
from thermid.simulation.runs import Scenario, Solution, simulate

SHOWN_TIMES = 400
"""Times of a run."""


def run_of(c: Calibration, record: str) -> tuple[Model, Scenario] | None:
    """Return the model and the scenario of one record with the starts, boundaries and meter factors that the fit found.

    None where the fit does not keep its logs, as one that was read from a file.
    """
    place = next((k for k, e in enumerate(c.experiments) if e.record.name == record), None)
    if place is None or c.problem is None or any(u.name not in c.fitted for u in c.problem.unknowns):
        return None
    fitted = np.array([c.fitted[u.name] for u in c.problem.unknowns])
    bench = c.problem.bench(place, fitted)
    inputs = dict(zip(c.problem.benches()[place].free, c.problem.inputs(place, fitted)[0].tolist(), strict=True))
    return bench.experiment.as_fitted(c.fitted_model, inputs)


def course_of(c: Calibration, record: str, times: Array | None = None) -> Solution | None:
    """Return the run of the whole model under the inputs of a record; None where it cannot be made again.

    Parameters
    ----------
    times : array (times,)      Where it is wanted; `SHOWN_TIMES` times over the record by default. [s]
    """
    try:
        inputs = run_of(c, record)
        if inputs is None:
            return None
        model, scenario = inputs
        return simulate(model, scenario, times=np.linspace(0.0, scenario.seconds, SHOWN_TIMES) if times is None else times)
    except ThermidError:
        return None


def drives(c: Calibration, record: str) -> RecordDrive | None:
    """Return ambient temperatures and the sum of all powers over a record."""
    run = course_of(c, record)
    if run is None:
        return None
    ambient = {b: run[b].kelvin for b in flatten(c.model).names.boundaries if b in run.nodes}
    powers = list(run.load_powers.values())
    total = np.sum([np.broadcast_to(p, run.times.shape) for p in powers], axis=0) if powers else None
    return RecordDrive(run.times, ambient, total)
