"""Readings of one sensor and what a simulation says in their place: from a comparison, or from two logs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thermid.errors import RecordError
from thermid.fit.calibration import Calibration
from thermid.measure import Record
from thermid.measure.record.windows import gap_from

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Overlay:
    """Readings of one sensor and what a simulation says in their place, at the same times.

    Parameters
    ----------
    case, sensor : str          The test, and the channel.
    node : str                  Where it sits in the model; empty where only two logs are compared.
    times : array (times,)      [s]
    measured, simulated : array (times,)    [K]
    accuracy : float            Standard deviation of the sensor's constant error; 0 where nobody stated one. [K]
    noise : float               Standard deviation of one reading. [K]
    """

    case: str
    sensor: str
    node: str
    times: Array
    measured: Array
    simulated: Array
    accuracy: float = 0.0
    noise: float = 0.0

    @property
    def residuals(self) -> Array:
        """Measured less simulated (times,). [K]"""
        return self.measured - self.simulated


def overlays(fit: Calibration, case: str = "") -> tuple[Overlay, ...]:
    """Return the readings of a fit, or of `compare`, beside what its model says."""
    noted = {(e.record.name, o.sensor): o for e in fit.experiments for o in e.observations}
    out = []
    for b in fit.blocks:
        o = noted[b.record, b.sensor]
        errors = (float(o.accuracy or 0.0), float(o.noise or 0.0))
        out.append(Overlay(case or b.record, b.sensor, b.node, b.times, b.measured, b.predicted, *errors))
    return tuple(out)


def paired(measured: Record, simulated: Record, case: str = "") -> tuple[Overlay, ...]:
    """Return the channels that two logs have in common, the second at the times of the first.

    Raises
    ------
    RecordError   When they share no channel, or the simulation has no numbers where there are readings.
    """
    common = [n for n in measured.channels if n in simulated.channels]
    if not common:
        known = ", ".join(simulated.channels)
        raise RecordError(
            f"'{measured.name}' and '{simulated.name}' have no column of one name; the second has {known}. "
            "Give the columns of the simulation the names of the sensors.",
            "two logs",
        )
    out = []
    for name in common:
        channel, other = measured[name], simulated[name]
        times, run = measured.times[channel.valid], simulated.times[other.valid]
        _refuse_blank(name, times, simulated.times, other.valid)
        at_readings = np.interp(times, run, other.values[other.valid])
        accuracy, noise = float(channel.accuracy or 0.0), float(channel.noise or 0.0)
        out.append(Overlay(case or measured.name, name, "", times, channel.values[channel.valid], at_readings, accuracy, noise))
    return tuple(out)


def _refuse_blank(name: str, times: Array, rows: Array, valid: NDArray[np.bool_]) -> None:
    """Refuse readings (times,) at times at which the simulated column (rows,) has no number: nothing can be compared with them.

    Blank rows between two numbers are passed over where these are no further apart than samples of a log without gaps.
    """
    run, places, where = rows[valid], np.flatnonzero(valid), "two logs"
    if not times.size or not run.size:
        raise RecordError(f"'{name}' has no {'simulated number' if times.size else 'reading'} at all. Leave the column out.", where)
    if times[0] < run[0] - 1e-9 or times[-1] > run[-1] + 1e-9:
        raise RecordError(
            f"the simulated numbers of '{name}' run from {run[0]:g} s to {run[-1]:g} s, its readings from {times[0]:g} s to "
            f"{times[-1]:g} s. Cut the readings or simulate longer.",
            where,
        )
    gaps = np.flatnonzero((np.diff(places) > 1) & (np.diff(run) >= gap_from(run)))
    for a, b in zip(run[gaps], run[gaps + 1], strict=True):
        if ((times > a + 1e-9) & (times < b - 1e-9)).any():
            raise RecordError(
                f"the simulation has no numbers for '{name}' between {a:g} s and {b:g} s, where there are readings. Mask these.", where
            )
