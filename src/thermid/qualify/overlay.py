"""Readings of one sensor and what a simulation says in their place: from a comparison, or from two logs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thermid.errors import RecordError
from thermid.identify.calibration import Calibration
from thermid.measure import Record

__all__ = ["Overlay", "overlays", "paired"]

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
    RecordError   When they share no channel, or the simulation does not cover the readings.
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
        channel = measured[name]
        times = measured.times[channel.valid]
        if times[0] < simulated.times[0] - 1e-9 or times[-1] > simulated.times[-1] + 1e-9:
            raise RecordError(
                f"the simulation runs from {simulated.times[0]:g} s to {simulated.times[-1]:g} s, the readings of '{name}' from "
                f"{times[0]:g} s to {times[-1]:g} s. Cut the readings or simulate longer.",
                "two logs",
            )
        other = np.interp(times, simulated.times[simulated[name].valid], simulated[name].values[simulated[name].valid])
        accuracy, noise = float(channel.accuracy or 0.0), float(channel.noise or 0.0)
        out.append(Overlay(case or measured.name, name, "", times, channel.values[channel.valid], other, accuracy, noise))
    return tuple(out)
