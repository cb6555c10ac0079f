"""Logs of lumped plates with autocorrelated deviations, as matrices: what the test of inherited values is measured on.

Plates in a chain, each with a sensor, the first one heated by a power that switches; unknown are all capacities, all couplings and the
starts of every record. Inherited, with an error of 1.2 %, are the capacity of the first plate and, where two or three values are tested,
its coupling to the air and the next capacity. Readings each minute over eight hours have white noise of 0.05 K and, on each sensor in each
record, an autocorrelated deviation of its own.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from thermid.fit._uncertainty.moved import Shift, Test, shifts
from thermid.fit._uncertainty.noise import Binned, Weighed, correlation, weighed
from thermid.fit.calibration import Move

__all__ = ["CELLS", "Cell", "Count", "counted"]

Array = NDArray[np.float64]
WHITE, STATED, STEP, HOURS, STRETCHES = 0.05, 0.012, 60.0, 8.0, 160


@dataclass(frozen=True)
class Cell:
    """A kind of case: sensors, records, values tested; standard deviation [K] and correlation time [s] of the deviation."""

    sensors: int
    records: int
    values: int
    slow: float
    time: float


CELLS = tuple(
    Cell(*layout, slow, 60.0 * minutes)
    for layout in ((1, 1, 1), (2, 1, 2), (3, 1, 3), (1, 3, 1), (2, 2, 2))
    for slow in (0.1, 0.3, 0.6)
    for minutes in (10, 30, 90)
)


@dataclass(frozen=True)
class Count:
    """What was said in some cases of a cell, as shares.

    Parameters
    ----------
    false : float       Any value was called moved when none had moved.
    found : float       A shift of the first value by 4.5 true standard errors was called moved.
    quiet : float       The first value was called not rejected when none had moved.
    missed : float      It was called not rejected when it had moved by 11 %.
    error : float       Its true standard error, by generalised least squares with the noise known. [-]
    largest : float     Largest detectable shift of any value that was called not rejected. [-]
    """

    false: float
    found: float
    quiet: float
    missed: float
    error: float
    largest: float


def _rates(x: Array, n: int) -> Array:
    """Return d temperature / dt per kelvin of plates with these logarithms of capacities, couplings to the air and to one another."""
    rates = np.diag(-np.exp(x[n : 2 * n]))
    for i, g in enumerate(np.exp(x[2 * n : 3 * n - 1])):
        rates[i : i + 2, i : i + 2] += g * np.array([[-1.0, 1.0], [1.0, -1.0]])
    return rates / np.exp(x[:n])[:, None]


def _temperatures(x: Array, n: int, on: Array) -> Array:
    """Return temperatures above the air (times, plates) [K]; `x` ends with the starts."""
    rates = _rates(x, n)
    sizes, vectors = np.linalg.eig(rates)
    step = (vectors * np.exp(sizes * STEP) @ np.linalg.inv(vectors)).real
    heat = np.zeros(n)
    heat[0] = 6.0 / math.exp(x[0])
    push = np.linalg.solve(rates, (step - np.eye(n)) @ heat)
    out = np.empty((on.size, n))
    out[0] = x[3 * n - 1 :]
    for k in range(1, on.size):
        out[k] = step @ out[k - 1] + push * on[k - 1]
    return out


def _designs(cell: Cell) -> list[Array]:
    """Return derivatives (times, sensors, unknowns) of every record."""
    n, count = cell.sensors, int(HOURS * 3600.0 / STEP)
    shared = np.log([*(700.0, 1000.0, 1400.0)[:n], *(0.2, 0.3, 0.35)[:n], *(0.5, 0.4)[: n - 1]])
    size = shared.size + n * cell.records
    out = []
    for record in range(cell.records):
        on = (np.arange(count) / count * (2 + record) % 1 < 0.5).astype(float)
        x = np.concatenate([shared, np.zeros(n)])
        base, full = _temperatures(x, n, on), np.zeros((count, n, size))
        place = [*range(shared.size), *range(shared.size + n * record, shared.size + n * (record + 1))]
        for k, at in enumerate(place):
            aside = x.copy()
            aside[k] += 1e-5
            full[:, :, at] = (_temperatures(aside, n, on) - base) / 1e-5
        out.append(full)
    return out


def _known(cell: Cell) -> list[int]:
    return [0, cell.sensors, 1][: cell.values]


def _standard_errors(cell: Cell, designs: list[Array]) -> list[float]:
    """Return the true standard errors of the shifts, from all readings with the covariance of their noise."""
    times = STEP * np.arange(designs[0].shape[0])
    root = np.linalg.cholesky(cell.slow**2 * correlation(times, cell.time) + WHITE**2 * np.eye(times.size))
    size = designs[0].shape[2]
    information = np.zeros((size, size))
    for full in designs:
        for k in range(cell.sensors):
            white = np.linalg.solve(root, full[:, k])
            information += white.T @ white
    exact = Weighed(np.ones(1), information[None], np.zeros((1, size)))
    return [s.error for s in shifts(_test(exact, cell, size), range(cell.values))]


def _test(data: Weighed, cell: Cell, size: int) -> Test:
    return Test.of_unknowns(data, np.zeros((size, size)), np.zeros(size), _known(cell), STATED * np.eye(cell.values))


def _binned(full: Array, residuals: Array) -> Binned:
    """Return a trace in stretches of equal numbers of samples."""
    samples = residuals.size // STRETCHES
    mean, slopes = (a.reshape(STRETCHES, samples, -1).mean(axis=1) for a in (residuals, full))
    times = STEP * samples * (np.arange(STRETCHES) + 0.5)
    return Binned(mean[:, 0] / WHITE, np.full(STRETCHES, float(samples)), times, -slopes / WHITE, 0.0, 0, 0.0)


def _noise(rng: np.random.Generator, cell: Cell, count: int) -> Array:
    tie, draws = math.exp(-STEP / cell.time), rng.standard_normal(count)
    slow = np.empty(count)
    slow[0] = draws[0]
    for k in range(1, count):
        slow[k] = tie * slow[k - 1] + math.sqrt(1.0 - tie**2) * draws[k]
    return np.asarray(cell.slow * slow + WHITE * rng.standard_normal(count))


def _cases(cell: Cell, designs: list[Array], shifted: list[float], cases: int, seed: int) -> Iterator[list[list[Move]]]:
    """Yield what is said of the inherited values when the first one has moved by so much of its value, up or down, for each such shift.

    Where all values are open, noise models do not depend on where they stand, so one average serves all shifts: X'V^-1 (z + X d).
    """
    rng = np.random.default_rng([seed, cell.sensors, cell.records, cell.values, int(100 * cell.slow), int(cell.time)])
    known, size = _known(cell), designs[0].shape[2]
    for _ in range(cases):
        truth = np.zeros(size)
        truth[known] = STATED * rng.standard_normal(cell.values)
        sign = rng.choice([-1.0, 1.0])
        pieces = [
            _binned(full[:, k], full[:, k] @ truth + _noise(rng, cell, full.shape[0])) for full in designs for k in range(cell.sensors)
        ]
        data = weighed(pieces, np.zeros((size, size)), np.zeros(size))
        yield [[_move(s) for s in shifts(_test(_shifted(data, sign * d), cell, size), range(cell.values))] for d in shifted]


def _shifted(data: Weighed, shift: float) -> Weighed:
    return replace(data, scores=data.scores + shift * data.information[:, :, 0])


def _move(s: Shift) -> Move:
    far = s.size / s.error
    return Move("x", "", "below", 1.0, math.exp(s.size), 1.0, "W", far, s.chance, math.expm1(s.detectable), STATED, STATED)


def counted(cell: Cell, cases: int, seed: int) -> Count:
    """Return what is said in so many cases each without a shift, with one of 4.5 standard errors, and with one of 11 %."""
    designs = _designs(cell)
    error = _standard_errors(cell, designs)[0]
    said = list(_cases(cell, designs, [0.0, 4.5 * error, math.log(1.11)], cases, seed))
    still, moved, tenth = ([one[k] for one in said] for k in range(3))
    quiet = [m for several in (*still, *moved, *tenth) for m in several if m.verdict == "not rejected"]
    return Count(
        float(np.mean([any(m.verdict == "moved" for m in several) for several in still])),
        float(np.mean([several[0].verdict == "moved" for several in moved])),
        float(np.mean([several[0].verdict == "not rejected" for several in still])),
        float(np.mean([several[0].verdict == "not rejected" for several in tenth])),
        error,
        max((m.detectable_share for m in quiet), default=0.0),
    )
