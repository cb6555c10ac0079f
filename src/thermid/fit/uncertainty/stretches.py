"""Traces in stretches of time: means of residuals, their derivatives, and what rounding to steps of the sensor adds to them."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from thermid.fit.problem.experiment import Observation
from thermid.fit.problem.residuals import Problem, SensorTrace, loss_of
from thermid.fit.uncertainty.rounding import blur_of, shared_rounding
from thermid.linear_algebra import Array, Indices

BINS = 80
"""A trace of more than twice as many samples is looked at in so many equal stretches of time; what ties neighbours within one together
shows as a larger scatter of their means."""

FELT = 0.02
"""Part of the variance of a reading from which rounding errors that neighbours share count."""


@dataclass(frozen=True, eq=False)
class Binned:
    """A trace in stretches of time: means of the residuals, samples and derivatives in each, the variance inside them and its freedom.

    `effective_share` is what a sample is worth by what is said of its noise. Rounding errors that samples share have the covariance
    ``rounding rounding'`` of their sums over stretches (stretches, terms), `rounded` of it the variance of each sample by itself; both in
    units of the noise.
    """

    mean: Array
    count: Array
    times: Array
    slopes: Array
    within: float
    inner: int
    squares: float
    effective_share: float = 1.0
    rounding: Array = field(default_factory=lambda: np.zeros((0, 0)))
    rounded: float = 0.0

    @property
    def shares_rounding(self) -> bool:
        """Whether readings are rounded so that neighbours share an error worth counting."""
        return self.rounded > FELT and self.rounding.size > 0

    def before(self, end: float) -> Binned:
        """Return the stretches up to a time [s]."""
        kept = self.times <= end
        rounding = self.rounding[kept] if self.rounding.size else self.rounding
        return replace(
            self, mean=self.mean[kept], count=self.count[kept], times=self.times[kept], slopes=self.slopes[kept], rounding=rounding
        )


def stretch_means(values: Array, place: Indices, size: int) -> Array:
    """Return the means of samples over each of so many stretches, `place` saying in which one a sample lies; zero of an empty one."""
    return np.asarray(np.bincount(place, values, minlength=size) / np.maximum(np.bincount(place, minlength=size), 1))


def binned_trace(
    z: Array,
    weighed: Array,
    place: Indices,
    centres: Array,
    slopes: Array,
    effective_share: float,
    rounding: tuple[Array, float] | None = None,
) -> Binned:
    """Return a trace in the stretches that hold samples.

    Parameters
    ----------
    z, weighed : array (samples,)           Residuals in units of the noise, and times the weight of a robust loss.
    place : array (samples,)                Stretch of each sample.
    centres : array (stretches,)            Times. [s]
    slopes : array (stretches, unknowns)    Derivatives of the residuals.
    rounding : (array, float)               See `shared_rounding`, in units of the noise; none where readings are not rounded.
    """
    count = np.bincount(place, minlength=centres.size).astype(float)
    mean, full = stretch_means(weighed, place, centres.size), count > 0
    inside, spare = weighed - mean[place], z.size - int(full.sum())
    within = float(inside @ inside) / max(spare, 1)
    columns, own = (rounding[0][full], rounding[1]) if rounding is not None else (np.zeros((0, 0)), 0.0)
    return Binned(mean[full], count[full], centres[full], slopes[full], within, spare, float(weighed @ z), effective_share, columns, own)


def rounding_of(block: SensorTrace, o: Observation, place: Indices, size: int) -> tuple[Array, float] | None:
    """Return what the rounding errors of a trace have in common over stretches, in units of the noise; None where it has no steps."""
    if not o.step:
        return None
    path = block.predicted
    blur = o.blur if o.blur is not None else blur_of(path, block.measured, o.step)
    columns, own = shared_rounding(path, o.step, blur, place, size)
    return columns / block.noise, own / block.noise**2


def binned(
    problem: Problem, fitted: Array, loss: str = "linear", loss_scale: float = 1.0, bins: int = BINS
) -> dict[tuple[str, str], Binned]:
    """Return (record, sensor) -> its residuals in so many stretches of time at most; a trace of up to 160 samples as it is."""
    out: dict[tuple[str, str], Binned] = {}
    blocks = iter(problem.blocks(fitted))
    for i, experiment in enumerate(problem.experiments):
        times = experiment.times
        own, count = times.size <= 2 * BINS, min(bins, times.size // 2)
        edges = times if own else np.linspace(times[0], times[-1], count + 1)[:-1]
        centres = times if own else edges + 0.5 * (times[-1] - times[0]) / count
        slopes = problem.slopes(i, fitted, centres)
        for k, o in enumerate(experiment.observations):
            block = next(blocks)
            z = block.weighted
            weighed = z if loss == "linear" else loss_of(z**2, loss, loss_scale)[1] * z
            place = np.searchsorted(edges, times[o.index], side="right") - 1
            rounding = rounding_of(block, o, place, centres.size)
            out[block.record, o.sensor] = binned_trace(z, weighed, place, centres, slopes[:, k, :], o.effective_share, rounding)
    return out
