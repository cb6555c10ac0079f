"""The likeliest powers at the knots of a history: as smooth as the readings allow."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from thermid.fit.problem.residuals import Problem

Array = NDArray[np.float64]
ROUNDS = 12


@dataclass(frozen=True, eq=False)
class Pins:
    """Knots whose power is known: positions, powers [W], standard deviations [W]; and where the sections between jumps begin and end."""

    at: NDArray[np.int64]
    power: Array
    sd: Array
    sections: NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Solved:
    """The end: values of all unknowns, their covariance, what the data see of them, and the prior that was taken."""

    x: Array
    covariance: Array
    seen: Array
    prior: str
    converged: bool


def solved(problem: Problem, knots: Array, pins: Pins, base: float, priors: Sequence[str]) -> Solved:
    """Return the unknowns of a problem whose last are the powers at the knots."""
    count = knots.size
    x = np.array([u.to_fitted(u.start) for u in problem.unknowns])
    low, high = (np.array(b) for b in zip(*(u.fitted_bounds() for u in problem.unknowns), strict=True))
    size, first = x.size, x.size - count
    pinned = np.zeros((pins.at.size, size))
    pinned[np.arange(pins.at.size), first + pins.at] = 1.0 / pins.sd
    stated = all(o.noise is not None for o in problem.observations())
    theta = [k for k, u in enumerate(problem.unknowns) if u.kind == "parameter"]
    force = np.zeros(size)
    for _ in range(ROUNDS):
        found = problem.compressed(x)
        rows, slopes = problem.prior_rows(x)
        # linearised: |A z - g|^2 of the data, of the priors of all other unknowns, and of the stretches of known power
        sides = [(found.slopes, found.slopes @ x - found.rows), (slopes, slopes @ x - rows), (pinned, pins.power / pins.sd)]
        level = 1.0
        for _ in range(1 if stated else 4):
            scaled = [(a / np.sqrt(level), g / np.sqrt(level)) if k == 0 else (a, g) for k, (a, g) in enumerate(sides)]
            best = max((_likeliest(scaled, force, knots, pins, base, p) for p in priors), key=lambda f: f[0])
            _, taken, z, h = best
            if not stated:
                left = sides[0][0] @ z - sides[0][1]
                data = scaled[0][0].T @ scaled[0][0]
                worth = float(np.trace(np.linalg.solve(h, data)))
                level = float(left @ left) / max(problem.samples - worth, 1.0)
        z = np.clip(z, low, high)
        force = _margin(problem, x, found.slopes / np.sqrt(level), h, theta, level)
        step, x = z - x, z
        sd = np.sqrt(np.diag(np.linalg.inv(h)))
        if (np.abs(step) < 0.01 * sd + 1e-9 * np.abs(x)).all():
            break
    else:
        return Solved(x, np.asarray(np.linalg.inv(h)), np.asarray(scaled[0][0].T @ scaled[0][0]), taken, False)
    return Solved(x, np.asarray(np.linalg.inv(h)), np.asarray(scaled[0][0].T @ scaled[0][0]), taken, True)


def _margin(problem: Problem, x: Array, slopes: Array, h: Array, theta: Sequence[int], level: float) -> Array:
    """Return what the logarithm of the margin over the history adds to the derivatives (unknowns,) of the parameters.

    The mode of history and parameters together is not that of the parameters alone: a smaller capacitance makes a smoother history, which
    its prior likes, though the readings then say more of it. The margin holds the one against the other: ``-1/2 d log|H| / d parameter``,
    H the information on all else.
    """
    out = np.zeros(x.size)
    others = np.setdiff1d(np.arange(x.size), theta)
    inverse = np.linalg.inv(h[np.ix_(others, others)])
    here = slopes[:, others].T @ slopes[:, others]
    for k in theta:
        moved = x.copy()
        moved[k] += 1e-3 * problem.unknowns[k].scale
        there = problem.compressed(moved).slopes[:, others]
        out[k] = -0.5 * float(np.sum(inverse * (there.T @ there / level - here))) / (moved[k] - x[k])
    return out


def _likeliest(
    sides: Sequence[tuple[Array, Array]], force: Array, knots: Array, pins: Pins, base: float, prior: str
) -> tuple[float, str, Array, Array]:
    """Return the largest logarithm of the marginal likelihood over a prior's strength, its name, the unknowns, and their information."""
    size, count = sides[0][0].shape[1], knots.size
    first = size - count
    data = sum((a.T @ a for a, _ in sides), np.zeros((size, size)))
    right = sum((a.T @ g for a, g in sides), force.copy())
    square = float(sum(g @ g for _, g in sides))
    rough = _roughness(knots, pins, 1 if prior == "walk" else 2)
    held = np.eye(count) / base**2
    scale = float(np.trace(sides[0][0][:, first:].T @ sides[0][0][:, first:])) / max(float(np.trace(rough)), 1e-300)

    def at(strength: float) -> tuple[float, Array, Array]:
        smooth = scale * 10.0**strength * rough + held
        h = data.copy()
        h[first:, first:] += smooth
        z = np.linalg.solve(h, right)
        logs = np.linalg.slogdet(smooth)[1] - np.linalg.slogdet(h)[1] - (square - float(right @ z))
        return 0.5 * float(logs), np.asarray(z), np.asarray(h)

    grid = np.arange(-8.0, 8.01, 0.5)
    found = [(at(s)[0], s) for s in grid]
    _, middle = max(found)
    _, strength = max((at(s)[0], s) for s in middle + np.arange(-0.5, 0.51, 0.05))
    value, z, h = at(strength)
    return value, prior, z, np.asarray(h)


def _roughness(knots: Array, pins: Pins, order: int) -> Array:
    """Return D'D of differences between knots, of the first or second order; none reach across a jump."""
    out = np.zeros((knots.size, knots.size))
    for first, last in pairwise(pins.sections.tolist()):
        if last - first > order:
            rows = np.diff(np.eye(last - first), n=order, axis=0) / float(np.diff(knots[first:last]).mean()) ** (order - 0.5)
            out[first:last, first:last] = rows.T @ rows
    return out
