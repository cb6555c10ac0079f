"""What drove the readings of a record, and what the whole model did beside them: temperatures, heat flows and powers over time."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import numpy as np

from thermid.base.errors import ThermidError
from thermid.base.linear_algebra import Array
from thermid.fit.calibration import Calibration, SensorTrace
from thermid.model.tree import Model, flatten
from thermid.reporting._pictures.figures import RecordDrive
from thermid.simulation.runs import Scenario, Solution, simulate

Course = Solution
"""The run of a record, as other files of the package name it."""
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
    return bench.experiment.as_fitted(c.model, inputs)


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


def without_error(c: Calibration, block: SensorTrace) -> SensorTrace:
    """Return a trace without its sensor's constant error: temperatures of the node, as those of corrected boundaries beside it are."""
    error = c.bias.get(block.sensor, 0.0)
    return replace(block, measured=block.measured - error, predicted=block.predicted - error)


def hottest_moment(run: Solution, nodes: Collection[str]) -> int:
    """Return the sample at which the hottest of some nodes is near its peak (2 % of its rise), and powers are on where they ever are."""
    columns = [k for k, n in enumerate(run.nodes) if n in nodes]
    peak = run.temperatures[:, columns].max(axis=1)
    at_peak = peak >= peak.max() - 0.02 * np.ptp(peak)
    heat = total_power(run)
    if heat is not None:
        at_peak &= heat >= 0.9 * heat[at_peak].max()
    return int(np.where(at_peak, peak, -np.inf).argmax())


def total_power(run: Solution) -> Array | None:
    """Return the sum of all powers (times,); None where the model has no load. [W]"""
    powers = [np.broadcast_to(p, run.times.shape) for p in run.load_powers.values()]
    return np.sum(powers, axis=0) if powers else None


def drives(c: Calibration, run: Solution | None) -> RecordDrive | None:
    """Return ambient temperatures and the sum of all powers over the run of a record."""
    if run is None:
        return None
    ambient = {b: run[b].kelvin for b in flatten(c.given_model).names.boundaries if b in run.nodes}
    return RecordDrive(run.times, ambient, total_power(run))
