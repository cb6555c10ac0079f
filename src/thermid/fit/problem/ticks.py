"""A second clock in a record: its signals where the fit puts them, and the derivatives of the residuals by differences."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from thermid.fit.problem.statistics import Sums, loss_of
from thermid.fit.problem.unknowns import Target, Unknown
from thermid.measure.record.join import SecondClock
from thermid.model.laws.signal import Signal, Table

if TYPE_CHECKING:
    from thermid.fit.problem.blocks import Block
    from thermid.fit.problem.experiment import Experiment
    from thermid.fit.problem.residuals import Problem

Array = NDArray[np.float64]
OFFSET, RATE = "clock.offset", "clock.rate"
SHIFT = 0.3
"""Shift over which differences are taken, in samples of the second log: smaller ones drown in the integrator's own error."""


@dataclass(frozen=True)
class Ticks:
    """What follows a second clock in an experiment.

    Parameters
    ----------
    clock : SecondClock             Where its offset and rate are looked for.
    driven : tuple of (str, str)    Table of the scenario and path of every signal that was logged on it.
    zero : float                    Time on the record's own clock at which the experiment begins. [s]
    at : (offset, rate)             Those at which the scenario holds these signals. [s, -]
    """

    clock: SecondClock
    driven: tuple[tuple[str, str], ...]
    zero: float
    at: tuple[float, float]

    def moved(self, experiment: Experiment, at: tuple[float, float]) -> Experiment:
        """Return an experiment with these signals at another offset and rate."""
        tables = {name: dict(getattr(experiment.scenario, name)) for name in {name for name, _ in self.driven}}
        for name, path in self.driven:
            tables[name][path] = self._moved(tables[name][path], at)
        return replace(experiment, scenario=experiment.scenario.with_(**tables), ticks=replace(self, at=at))

    def _moved(self, signal: Signal, at: tuple[float, float]) -> Signal:
        if not isinstance(signal, Table):
            return signal

        def law(times: Array) -> Array:
            own = (times + self.zero - self.at[0]) / self.at[1]
            # to the nanosecond, so that rounding does not part an instant from the start of the run or from a reading
            return np.round(at[0] + at[1] * own - self.zero, 9)

        return signal.retimed(law)

    @property
    def span(self) -> float:
        """Longest time that the second clock shows while the first log lasts. [s]"""
        return max(abs(t - self.at[0]) for t in self.clock.times) / self.at[1]


def clock_unknowns(experiments: Sequence[Experiment]) -> list[Unknown]:
    """Return offset and rate of every second clock that is known within a range only."""
    out = []
    for i, e in enumerate(experiments):
        if e.ticks is not None:
            c = e.ticks.clock
            for name, target, (low, high), at, unit in (
                ("clock offset", OFFSET, c.offset, c.at[0], "s"),
                ("clock rate", RATE, c.rate, c.at[1], "1"),
            ):
                if low < high:
                    out.append(Unknown(f"{e.record.name}: {name}", "local", (Target(i, target),), at, low=low, high=high, unit=unit))
    return out


def clock_at(problem: Problem, i: int, fitted: Array) -> tuple[float, float]:
    """Return offset and rate of the second clock of an experiment at some values of the unknowns."""
    ticks = problem.experiments[i].ticks
    assert ticks is not None
    at = dict(zip((OFFSET, RATE), ticks.at, strict=True))
    return tuple((at | {name: float(fitted[k]) for k, name in problem.ticking(i)}).values())  # type: ignore[return-value]


def slopes_of_clock(problem: Problem, i: int, fitted: Array, times: Array | None = None) -> dict[int, Array]:
    """Return position of an unknown -> derivatives (times, sensors) of the readings with respect to an offset or rate, by differences.

    A switched power has no derivative with respect to its instant that a run could carry, so two runs are taken on either side.
    """
    ticks = problem.experiments[i].ticks
    out: dict[int, Array] = {}
    if ticks is None:
        return out
    shift = SHIFT * ticks.clock.step * ticks.at[1]
    for k, name in problem.ticking(i):
        step = shift if name == OFFSET else shift / max(ticks.span, ticks.clock.step)
        sides = []
        for side in (-step, step):
            there = fitted.copy()
            there[k] += side
            x, _ = problem.inputs(i, there)
            sides.append(problem.bench(i, there).temperatures(x, False, problem.options, times)[0])
        out[k] = (sides[1] - sides[0]) / (2.0 * step)
    return out


def compressed_in_full(
    problem: Problem, i: int, fitted: Array, loss: str, knee: float
) -> tuple[Array, Array, float, list[tuple[str, str, Sums]]]:
    """Return what `Problem.compressed` takes of one experiment, from all of its residuals: rows, slopes, chi-square, sums."""
    experiment = problem.experiments[i]
    blocks, slopes = problem.blocks_of(i, fitted), problem.slopes(i, fitted)
    full = np.concatenate([slopes[o.index, k, :] for k, o in enumerate(experiment.observations)])
    return as_triangle(blocks, full, loss, knee)


def as_triangle(blocks: Sequence[Block], full: Array, loss: str, knee: float) -> tuple[Array, Array, float, list[tuple[str, str, Sums]]]:
    """Return rows, slopes, chi-square and sums of weighted residuals, whose derivatives (samples, unknowns) are made into a triangle."""
    z = np.concatenate([b.residuals / b.noise for b in blocks])
    size, weight = loss_of(z**2, loss, knee)
    root = np.sqrt(weight)
    basis, triangle = np.linalg.qr(root[:, None] * full)
    rotated = basis.T @ (root * z)
    rest = float(size.sum() - rotated @ rotated)
    rows = np.concatenate([rotated, np.sqrt(np.maximum([rest], 0.0))])
    sums = [(b.record, b.sensor, Sums.of(b.residuals)) for b in blocks]
    return rows, np.concatenate([triangle, np.zeros((1, triangle.shape[1]))]), float(weight @ z**2), sums
