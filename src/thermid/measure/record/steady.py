"""Steady points: the mean of a settled stretch of a record, with what drift and correlated noise leave of its certainty."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from thermid.errors import NameNotFoundError, RecordError, nearest
from thermid.measure.amounts import amount, duration_text, positive_seconds
from thermid.measure.record.channel import Channel, FloatArray, Origin
from thermid.measure.record.prepare import stretch
from thermid.units import format_value

if TYPE_CHECKING:
    from thermid.measure.record.record import Record

SETTLED = "1 [K/h]"
FEWEST = 8
TAU_ERROR = 0.2
"""How far a time constant may be off, as a share of it."""


@dataclass(frozen=True)
class SteadyValue:
    """One channel at a steady point.

    Parameters
    ----------
    name : str                  The channel.
    value : float               Where it would have settled, or its mean where nothing was corrected. [SI]
    error : float               Standard error: noise with its correlation, steps of the sensor, drift. [SI]
    accuracy : float or None    Of the instrument, not part of the error. [SI]
    rate, rate_error : float    Drift. [SI per s]
    correction : float          What was added to the mean for stored heat and drift. [SI]
    samples : int               Readings.
    independent : float         As many readings without correlation would say as much.
    quantity : str
    """

    name: str
    value: float
    error: float
    accuracy: float | None
    rate: float
    rate_error: float
    correction: float
    samples: int
    independent: float
    quantity: str

    def __str__(self) -> str:
        """Value, error, drift."""
        if self.quantity != "temperature":
            return f"{self.name} {self.value:.5g} +- {self.error:.2g}"
        text = f"{self.name} {format_value(self.value, 'degC', 6)} +- {self.error:.2g} K   drift {3600 * self.rate:+.2g} K/h"
        corrected = f", {self.correction:+.2g} K added for it" if self.correction else ""
        return f"{text}{corrected}   {self.samples} readings worth {self.independent:.3g}"


@dataclass(frozen=True, eq=False)
class SteadyPoint:
    """A settled stretch of a record.

    Parameters
    ----------
    name : str              Name of the record, and the stretch.
    start, end : float      On the record's own axis. [s]
    values : dict           Channel -> `SteadyValue`.
    source : Record         The record that it was taken from.
    corrected : bool        Whether a time constant was given to correct by.
    """

    name: str
    start: float
    end: float
    values: Mapping[str, SteadyValue]
    source: Record
    corrected: bool

    def __getitem__(self, name: str) -> SteadyValue:
        """Return one channel.

        Raises
        ------
        NameNotFoundError   With the nearest name.
        """
        if name not in self.values:
            raise NameNotFoundError(f"no channel '{name}'.{nearest(name, self.values)}", self.name)
        return self.values[name]

    @property
    def record(self) -> Record:
        """The point as a record of two equal readings, for `calibrate` beside others, in a scenario that starts steady.

        Two readings of noise sqrt(2) times the point's error weigh as one of that error; the accuracy of each instrument stays.
        """
        channels = {}
        for name, v in self.values.items():
            given = self.source.channel(name)
            size = max(v.error, 1e-9) * 2.0**0.5
            noise = size if given.quantity == "temperature" else given.noise
            values, valid = np.full(2, v.value), np.ones(2, dtype=bool)
            channels[name] = replace(given, values=values, valid=valid, masks={}, noise=noise)
        origin: Origin = self.source.origin
        made = type(self.source)(self.name, np.array([0.0, self.end - self.start]), channels, origin)
        return replace(made, steps=(*self.source.steps, f"steady point of {self.start:g} to {self.end:g} s"))

    def __str__(self) -> str:
        """Every channel, and what was not corrected."""
        lines = [f"{self.name}: mean of {duration_text(self.end - self.start)}", *(f"  {v}" for v in self.values.values())]
        if not self.corrected:
            lines.append(
                "  without a time constant nothing is corrected: the errors hold the drift over the window; a slow approach can hide more"
            )
        return "\n".join(lines)


def correlation_factor(residuals: FloatArray, fitted: int = 2) -> float:
    """Return how many readings are worth one: 1 + 2 times the sum of autocorrelations, over pairs of lags while their sum is above zero.

    Residuals about a mean or a line look less correlated than the noise is: each of the `fitted` numbers takes one share of the whole sum
    off every lag, and is given back here.

    References
    ----------
    C. J. Geyer, Practical Markov chain Monte Carlo, Statistical Science 7 (1992) 473-483, DOI 10.1214/ss/1177011137; for the bias,
    F. H. C. Marriott and J. A. Pope, Biometrika 41 (1954) 390-402, DOI 10.1093/biomet/41.3-4.390.
    """
    n = residuals.size
    power = float(residuals @ residuals)
    if n < 4 or power <= 0:
        return 1.0
    size = 1 << (2 * n - 1).bit_length()
    spectrum = np.abs(np.fft.rfft(residuals, size)) ** 2
    rho = np.fft.irfft(spectrum, size)[:n] / power * (n / np.arange(n, 0, -1))
    factor = 1.0
    for _ in range(5):
        share = fitted * factor / n
        pairs = (rho * (1.0 - share) + share)[: n - n % 2].reshape(-1, 2).sum(axis=1)
        ends = np.flatnonzero(pairs <= 2.0 * share)
        kept = pairs[: int(ends[0])] if ends.size else pairs
        factor = float(min(max(1.0, 2.0 * kept.sum() - 1.0), n / 4.0))
    return factor


def steady_point(
    record: Record, start: object, end: object, tau: object | None = None, limit: str | float = SETTLED, name: str = ""
) -> SteadyPoint:
    """Return the steady point of a stretch of a record.

    Parameters
    ----------
    record : Record
    start, end : str or float   The stretch, as in `trim`.
    tau : str, float or dict    Slowest time constant of the parts, or channel -> its own: what is stored is then taken off. [s]
    limit : str or float        Drift above which a temperature is not settled. [K/s]
    name : str                  Name of the point; the record's with the stretch when empty.

    Raises
    ------
    RecordError   When a channel drifts faster than the limit beyond doubt, or has fewer than 8 readings; the message says the rate.

    Notes
    -----
    A part with one time constant follows its steady temperature T_s by ``T + tau dT/dt = T_s`` (C dT/dt = P - G (T - T_room) and
    tau = C/G), for heat that is still being stored as for a room that drifts. The correction is taken as good to 20 %. Without a time
    constant half the drift over the window is added to the error.
    """
    inside, _ = stretch(record, start, end, f"{record.name}, steady")
    times = record.times[inside]
    most = amount(limit, "K/s", "limit")
    if most <= 0:
        raise RecordError("the drift that counts as settled must be above zero.", "limit")
    values = {}
    for each in record.channels.values():
        constant = tau.get(each.name) if isinstance(tau, Mapping) else tau
        seconds = positive_seconds(constant, "tau") if constant is not None and each.role != "boundary" else 0.0
        values[each.name] = _value(record.name, each, times, inside, seconds, most, tau is not None)
    label = name or f"{record.name} {times[0]:g} to {times[-1]:g} s"
    return SteadyPoint(label, float(times[0]), float(times[-1]), values, record, tau is not None)


def _value(where: str, channel: Channel, times: FloatArray, inside: np.ndarray, tau: float, most: float, corrected: bool) -> SteadyValue:
    """Return one channel over the stretch."""
    valid = channel.valid[inside]
    y, t = channel.values[inside][valid], times[valid]
    place = f"{where}, {channel.name}"
    if y.size < FEWEST:
        raise RecordError(f"{y.size} readings lie in the window; {FEWEST} are needed for a mean with its error.", place)
    middle = 0.5 * (times[0] + times[-1])
    slope, mean, spread, factor = _line(t - middle, y)
    worth = y.size / factor
    free = max(worth - 2.0, 3.0)
    error = spread / worth**0.5 * (free / (free - 2.0)) ** 0.5  # Student's distribution: few readings do not know their own spread
    rate_error = error / float(np.std(t))
    thermal = channel.quantity == "temperature"
    if thermal and abs(slope) - 2.0 * rate_error > most:
        raise RecordError(
            f"it drifts by {3600 * slope:+.3g} +- {3600 * rate_error:.2g} K/h, more than the {3600 * most:.3g} K/h that count as settled. "
            "Take a later window, or set the limit if that drift is what the test is about.",
            place,
        )
    step = channel.resolution or 0.0
    parts = [error, step / 12**0.5 if spread < step else 0.0]  # without dither a mean keeps the sensor's step
    correction = tau * slope if thermal else 0.0
    if tau:
        parts += [TAU_ERROR * correction, tau * rate_error]
    elif thermal and not corrected:
        parts.append(abs(slope) * float(times[-1] - times[0]) / 2.0)
    total = float(np.linalg.norm(parts))
    return SteadyValue(
        channel.name, mean + correction, total, channel.accuracy, slope, rate_error, correction, int(y.size), worth, channel.quantity
    )


def _line(t: FloatArray, y: FloatArray) -> tuple[float, float, float, float]:
    """Return slope, value at zero, spread about the line, and how many readings are worth one."""
    design = np.column_stack([t, np.ones(t.size)])
    slope, mean = np.linalg.lstsq(design, y, rcond=None)[0]
    left = y - design @ np.array([slope, mean])
    factor = correlation_factor(left)
    return float(slope), float(mean), float(np.sqrt(left @ left / (y.size - 2.0 * min(factor, y.size / 4.0)))), factor
