"""What the errors of its sensors mean for a fit: how large they are beside the rise that a sensor saw, and what they make uncertain."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from thermid.fit.calibration import Calibration

WORTH = 0.05
"""Share of a variance from which it is worth a word."""


@dataclass(frozen=True)
class SensorShare:
    """The constant error of a sensor beside what it measured.

    Parameters
    ----------
    sensor : str
    accuracy : float    Standard deviation of its constant error before the fit. [K]
    rise : float        Between its lowest and highest reading in a record, the largest of all records. [K]
    parameter : str     The parameter whose error it sets most; empty for none worth a word.
    share : float       Of the variance of that parameter, what would be gone if the constant error were known. [-]
    """

    sensor: str
    accuracy: float
    rise: float
    parameter: str
    share: float

    def __str__(self) -> str:
        """Return it as a sentence."""
        part = f"is {100 * self.accuracy / self.rise:.2g} % of its rise of {self.rise:.2g} K" if self.rise > 0 else "met no rise"
        sets = f", and sets {100 * self.share:.0f} % of the variance of {self.parameter}" if self.parameter else ""
        return f"constant error of {self.sensor}: {self.accuracy:.2g} K (accuracy) {part}{sets}"


def sensor_shares(fit: Calibration) -> tuple[SensorShare, ...]:
    """Return what the constant error of every sensor that has an accuracy means for a fit.

    The share is the squared correlation of parameter and constant error in their joint covariance.
    """
    seen: dict[str, float] = {}
    accuracy: dict[str, float] = {}
    for e in fit.experiments:
        for o in e.observations:
            seen[o.sensor] = max(seen.get(o.sensor, 0.0), float(np.ptp(o.measured)) if o.measured.size else 0.0)
            accuracy[o.sensor] = o.accuracy or 0.0
    order = list(fit.values)
    out = []
    for sensor in fit.values.sensors:
        best, share = _most(fit, order.index(f"sensor {sensor}"))
        if accuracy.get(sensor):
            out.append(SensorShare(sensor, accuracy[sensor], seen[sensor], best, share))
    return tuple(out)


def _most(fit: Calibration, j: int) -> tuple[str, float]:
    """Return the parameter whose error an unknown at position `j` sets most, and its share of the variance; nothing below `WORTH`."""
    order, best, share = list(fit.values), "", WORTH
    for path in fit.values.parameters:
        k = order.index(path)
        size = fit.values.covariance[k, k] * fit.values.covariance[j, j]
        found = float(fit.values.covariance[k, j] ** 2 / size) if size > 0 and np.isfinite(size) else 0.0
        best, share = (path, found) if found > share else (best, share)
    return best, share if best else 0.0


@dataclass(frozen=True)
class InstrumentShare:
    """The error of a sensor's scale, or its lag, as it was stated and as the fit found it.

    Parameters
    ----------
    name : str              ``scale of T1``, ``lag of T1``.
    unit : str              Of the numbers: 1 for a scale, s for a lag.
    stated : (float, float) Mean and standard deviation before the fit.
    found : (float, float)  After it.
    parameter : str         The parameter whose error it sets most; empty for none worth a word.
    share : float           Of the variance of that parameter, what would be gone if it were known. [-]
    """

    name: str
    unit: str
    stated: tuple[float, float]
    found: tuple[float, float]
    parameter: str
    share: float

    def __str__(self) -> str:
        """Return it as a sentence."""
        factor, unit = (100.0, "%") if self.unit == "1" else (1.0, self.unit)
        before, after = (f"{factor * mean:.3g} +- {factor * sd:.2g} {unit}" for mean, sd in (self.stated, self.found))
        sets = f", and sets {100 * self.share:.0f} % of the variance of {self.parameter}" if self.parameter else ""
        return f"{self.name}: {before} as stated, {after} found{sets}"


def instrument_shares(fit: Calibration) -> tuple[InstrumentShare, ...]:
    """Return what the scales and lags that were looked for mean for a fit; shares as in `sensor_shares`."""
    out = []
    for j, (name, v) in enumerate(fit.values.items()):
        if v.kind == "instrument" and v.prior is not None:
            mean, sd = v.prior
            stated = (float(np.exp(mean)), float(np.exp(mean)) * sd) if v.log else (mean, sd)
            out.append(InstrumentShare(name, v.unit, stated, (v.value, v.error), *_most(fit, j)))
    return tuple(out)
