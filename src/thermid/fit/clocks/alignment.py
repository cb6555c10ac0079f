"""Two logs on two clocks, aligned by a model: the offset and the rate with which the temperatures follow the power."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thermid.arguments import takes_objects
from thermid.errors import IdentificationError, RecordError, ScenarioError, SolverError
from thermid.fit.clocks.clocked import Clocked
from thermid.fit.least_squares.solve import Fit, covariances, minimise
from thermid.fit.problem.blocks import Block
from thermid.fit.uncertainty.wander import wandering
from thermid.measure import Record
from thermid.model.tree.model import Model
from thermid.simulation.scenarios.scenario import Scenario

Array = NDArray[np.float64]
OFFSETS, RATES, STARTS = 25, 5, 4
"""Points of the grid, and how many of the best of them a descent starts from."""
ROUGH = 0.1
"""Part of a standard error that tells the ends of these descents apart; the best goes on."""


@dataclass(frozen=True, eq=False)
class Alignment:
    """How a second clock runs beside the first one: a time t on it is ``offset + rate t``.

    Parameters
    ----------
    offset, rate : float            [s, -]
    offset_error, rate_error : float    Standard errors, at the model's values and its start. [s, -]
    record : Record                 Both logs on the first clock.
    rmse : dict                     Sensor -> RMS of measured less predicted. [K]
    largest : dict                  Sensor -> (largest of it by size [K], when [s]).
    at_end : tuple of str           Which of both lie at an end of their range, and might lie beyond it: 'offset', 'rate'.
    """

    offset: float
    rate: float
    offset_error: float
    rate_error: float
    record: Record
    rmse: Mapping[str, float]
    largest: Mapping[str, tuple[float, float]]
    at_end: tuple[str, ...] = ()

    def __str__(self) -> str:
        """Return offset and rate with their errors."""
        left = ", ".join(
            f"{s} RMSE {v:.3g} K, largest {w:+.3g} K at {t:.0f} s" for s, v in self.rmse.items() for w, t in (self.largest[s],)
        )
        end = {name: ", the end of its range" for name in self.at_end}
        return (
            f"{self.record.name}: offset {self.offset:.2f} +- {self.offset_error:.2g} s{end.get('offset', '')}, "
            f"rate {self.rate:.4f} +- {self.rate_error:.2g}{end.get('rate', '')}; left: {left}"
        )


@takes_objects
def align(
    model: Model,
    first: Record,
    second: Record,
    *,
    offset: tuple[float, float],
    rate: tuple[float, float] = (1.0, 1.0),
    scenario: Scenario | None = None,
    local: Mapping[str, Any] | None = None,
) -> Alignment:
    """Return offset and rate of a second record's clock at which a model follows both logs best.

    Values and start of the model stay as they are, as if they were exact; fitting them and aligning take turns. Constant errors of
    instruments within their stated accuracy are looked for beside the clock. Powers that switch make many valleys: a grid is looked at
    first, and a descent started from its best places. A power or command is held from sample to sample; one that was sampled, not logged
    when it changed (`Channel.prompt`), changed somewhere in the interval before, is taken to have changed in its middle, and the
    error counts the interval over the root of 12 for each change, beside noise and residuals that wander.

    Parameters
    ----------
    model : Model           What the hardware is.
    first, second : Record  Temperatures on one clock; powers or commands on the other.
    offset : (low, high)    Where the offset is looked for. [s]
    rate : (low, high)      Where the rate is looked for; equal values hold it. [-]
    scenario, local         As in `calibrate`.

    Raises
    ------
    IdentificationError     When no offset lets the model run over both logs, or they do not tell it within its range.
    """
    starts, noise = _nearest(Clocked(model, first, second, scenario, dict(local or {}), (offset, rate)))
    if not starts[0].ticking:
        return _at(starts[0], np.array([u.to_fitted(u.start) for u in starts[0].unknowns]), (0.0, 0.0))
    ends = [(sides, minimise(sides, done=ROUGH)) for sides in (replace(each, noise=noise) for each in starts)]
    sides, found = min(ends, key=lambda end: end[1].cost)
    # the noise of sensors that state none is that of what is left at the end
    sides = replace(sides, noise={s: _rms([b for b in sides.blocks(found.fitted) if b.sensor == s]) for s in noise})
    found = minimise(sides, start=found.fitted)
    errors = [0.0, 0.0]
    for place, k in enumerate(sides.ticking):
        errors[k] = float(_errors(sides, found)[place])
    for k in sides.ticking:
        _told(sides, k, errors[k])
    return _at(sides, found.fitted, (errors[0], errors[1]))


def _nearest(sides: Clocked) -> tuple[list[Clocked], dict[str, float]]:
    """Return the best places of a grid, none beside a better one, and the noise of sensors that state none at the best of them. [K]

    Raises
    ------
    IdentificationError   When the model runs at none.
    """
    (first, last), (low, high) = sides.ranges
    offsets = np.linspace(first, last, OFFSETS) if first < last else [first]
    rates = low + (high - low) * (np.arange(RATES) + 0.5) / RATES if low < high else [low]
    tried: list[tuple[float, tuple[int, int], Clocked, dict[str, float]]] = []
    for i, offset in enumerate(offsets):
        for j, rate in enumerate(rates):
            try:
                here = sides.opened((float(offset), float(rate)))
                cost, noise = _cost(here)
            except (RecordError, ScenarioError, SolverError):
                continue
            tried.append((cost, (i, j), here, noise))
    if not tried:
        raise IdentificationError(
            "no offset lets the model run over both logs. Widen the range of offsets.", f"{sides.first.name}, {sides.second.name}"
        )
    tried.sort(key=lambda each: each[0])
    taken: dict[tuple[int, int], Clocked] = {}
    for _, (i, j), here, _ in tried:
        if len(taken) < STARTS and not any(abs(i - k) <= 1 and abs(j - n) <= 1 for k, n in taken):
            taken[i, j] = here
    return list(taken.values()), tried[0][3]


def _cost(sides: Clocked) -> tuple[float, dict[str, float]]:
    """Return the least sum of squares at the start of a clock, and what is left of each sensor that states no noise. [K]"""
    at = np.array([u.to_fitted(u.start) for u in sides.unknowns])
    rest = at[len(sides.ticking) :]
    problem = sides.problem(sides.clock(at))
    left = sides.weighted(problem, rest)
    size = left.size
    if rest.size:
        priors, slopes = problem.prior_rows(rest)
        whole, rows = np.concatenate([left, priors]), np.concatenate([problem.jacobian(rest), slopes])
        whole = whole - rows @ np.linalg.lstsq(rows, whole, rcond=None)[0]
        left = whole[:size]
        cost = float(whole @ whole)
    else:
        cost = float(left @ left)
    noise, begin = {}, 0
    for o in problem.observations():
        part = left[begin : begin + o.index.size] * o.sigma(problem.noise)
        begin += part.size
        if o.noise is None:
            noise[o.sensor] = max(math.sqrt(float(np.mean(part**2))), 1e-6)
    return cost, noise


def _errors(sides: Clocked, found: Fit) -> Array:
    """Return the standard errors of the unknowns: noise and wandering residuals, constant errors, instants of sampled changes."""
    if not found.jacobian.any(axis=0).all():
        return np.full(found.fitted.size, np.inf)  # nothing answers to one of them
    spread = wandering(sides.pieces(found.fitted), found, sides.problem(sides.clock(found.fitted)).worth)
    total, _, weights = covariances(found, spread.level, spread.excess)
    changes = sides.changes(sides.clock(found.fitted))
    if changes and np.isfinite(weights).all():
        slopes = sides.slopes(found.fitted)
        for width, delayed in changes:
            moved = weights @ (slopes.T @ delayed) / spread.level
            total = total + width**2 / 12.0 * np.outer(moved, moved)
    return np.sqrt(np.diag(total))


def _told(sides: Clocked, k: int, error: float) -> None:
    """Refuse an offset or rate that the logs do not tell within its range."""
    (low, high), name, unit = sides.ranges[k], ("offset", "rate")[k], (" s", "")[k]
    if not error < high - low:
        raise IdentificationError(
            f"the logs do not tell the {name}: its error is wider than its range of {high - low:.3g}{unit}. "
            "A power that changes while temperatures are logged tells it, twice or more for the rate; a rate that is known can be held.",
            f"{sides.first.name}, {sides.second.name}",
        )


def _at(sides: Clocked, fitted: Array, errors: tuple[float, float]) -> Alignment:
    """Return the alignment at some values of the unknowns."""
    blocks, at = sides.blocks(fitted), sides.clock(fitted)
    largest = {}
    for b in blocks:
        k = int(np.argmax(np.abs(b.residuals)))
        largest[b.sensor] = (float(b.residuals[k]), float(b.times[k]))
    ends = tuple(
        ("offset", "rate")[k]
        for k in sides.ticking
        if min(at[k] - sides.ranges[k][0], sides.ranges[k][1] - at[k]) < 1e-6 * (sides.ranges[k][1] - sides.ranges[k][0])
    )
    return Alignment(*at, *errors, sides.first.joined(sides.second, *at), {b.sensor: _rms([b]) for b in blocks}, largest, ends)


def _rms(blocks: Sequence[Block]) -> float:
    """Return the RMS of measured less predicted. [K]"""
    return max(math.sqrt(float(np.mean(np.concatenate([b.residuals for b in blocks]) ** 2))), 1e-6)
