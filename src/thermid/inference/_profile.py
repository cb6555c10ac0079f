"""`profile`: how far a parameter can go before the readings object, all others following."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from thermid.base.arguments import takes_objects
from thermid.base.errors import IdentificationError, NameNotFoundError, SolverError, foretell, refuse_unknown, spoken
from thermid.base.linear_algebra import Array, covariance
from thermid.base.results import PlottedTrace, Result
from thermid.base.units import from_si
from thermid.fit.calibration import Calibration, Compressed, Problem, Unknown, minimise
from thermid.simulation.runs import Workers, in_tasks

MAX_POINTS_PER_SIDE, FIRST_LOG_STEP, MAX_LOG_STEP = 14, 0.7, 7.0
"""Points on one side; how far a logarithm goes at first, and at most (a factor of 1100)."""

USUAL_EVALUATIONS = 64
"""Evaluations that a profile takes: some 16 points, each fitted anew in four."""


@dataclass(frozen=True, eq=False)
class PartlyFixed(Problem):
    """A problem with some unknowns fixed, whose readings scatter `spread` times as much as their noise states.

    Parameters
    ----------
    whole : Problem                 The problem with all unknowns.
    values : array (unknowns,)      All unknowns of `whole`, in the fitted form; those that are not fixed are ignored.
    free_places : array (free,)     Positions in `whole` of the unknowns that are fitted.
    spread : float                  Factor on the noise; priors keep their widths. [-]
    """

    whole: Problem = field(default=None, repr=False)  # type: ignore[assignment]
    values: Array = field(default_factory=lambda: np.zeros(0), repr=False)
    free_places: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, dtype=np.int64), repr=False)
    spread: float = 1.0

    @classmethod
    def with_fixed(cls, whole: Problem, values: Array, fixed: tuple[int, ...], spread: float) -> PartlyFixed:
        """Return a problem whose unknowns at the places `fixed` keep their `values` (unknowns,), in the fitted form."""
        free_places = np.array([k for k in range(len(whole.unknowns)) if k not in fixed], dtype=np.int64)
        unknowns = tuple(whole.unknowns[k] for k in free_places)
        return cls(
            whole.experiments, unknowns, whole.noise, whole.options, whole=whole, values=values, free_places=free_places, spread=spread
        )

    def full(self, fitted: Array) -> Array:
        """Return all unknowns of `whole` (unknowns,), from those that are fitted (free,)."""
        out = self.values.copy()
        out[self.free_places] = fitted
        return out

    def compressed(self, fitted: Array, loss: str = "linear", loss_scale: float = 1.0, meshes: object = ()) -> Compressed:
        """Return the residuals of `whole` over `spread`, with their derivatives with respect to the fitted unknowns."""
        whole_compressed = self.whole.compressed(self.full(fitted), loss, loss_scale, meshes)  # type: ignore[arg-type]
        rows, slopes = whole_compressed.rows / self.spread, whole_compressed.slopes[:, self.free_places] / self.spread
        return replace(whole_compressed, rows=rows, slopes=slopes, chi_square=whole_compressed.chi_square / self.spread**2)

    def prior_rows(self, fitted: Array) -> tuple[Array, Array]:
        """Return the residuals of all priors (rows,) and their derivatives with respect to the fitted unknowns (rows, free)."""
        rows, slopes = self.whole.prior_rows(self.full(fitted))
        return rows, slopes[:, self.free_places]


@dataclass(frozen=True, eq=False)
class Profile(Result):
    """How far a parameter can go before the readings object.

    Parameters
    ----------
    path, unit : str            The parameter, and the unit for people.
    best : float                Where the fit is best. [SI]
    low, high : float           The interval; infinite, or the bound, where the readings set no limit. [SI]
    limited : (bool, bool)      Whether the readings set the lower and the upper limit.
    level : float               Probability that the interval stands for. [-]
    error : float               Standard error of the fit, for comparison. [SI]
    bounds : (float, float)     [SI]
    values : array (points,)    Where it was tried. [SI]
    rise : array (points,)      Growth of the weighted sum of squares there, all other unknowns fitted anew. [-]
    threshold : float           Growth at the ends of the interval. [-]
    """

    path: str
    unit: str
    best: float
    low: float
    high: float
    limited: tuple[bool, bool]
    level: float
    error: float
    bounds: tuple[float, float]
    values: Array
    rise: Array
    threshold: float

    def shown(self, value: float) -> str:
        """Return a value in its unit."""
        return f"{from_si(value, self.unit):.4g}"

    def __str__(self) -> str:
        """Return the interval in words."""
        head = f"{self.path} = {self.shown(self.best)} {self.unit}"
        sure = f"{100 * self.level:.3g} %"
        ends = [self.shown(v) if ok else "" for v, ok in zip((self.low, self.high), self.limited, strict=True)]
        if all(self.limited):
            text = f"{head}: {sure} confidence interval from {ends[0]} to {ends[1]} {self.unit}"
        elif any(self.limited):
            text = f"{head}: {sure} sure {'above' if self.limited[0] else 'below'} {ends[0] or ends[1]} {self.unit}"
        else:
            text = head
        for ok, side, end in zip(self.limited, ("lower", "upper"), (self.low, self.high), strict=True):
            if not ok:
                bound = self.bounds[side == "upper"]
                to = f"the bound {self.shown(bound)}" if np.isfinite(bound) else f"{self.shown(end)}, the farthest tried"
                text += f"; no {side} limit down to {to}" if side == "lower" else f"; no {side} limit up to {to}"
        plain = [self.shown(self.best + side * self.threshold**0.5 * self.error) for side in (-1.0, 1.0)]
        return f"{text}. By the standard error alone: {plain[0]} to {plain[1]}."

    def _as_traces(self) -> Sequence[PlottedTrace]:
        """Return the growth of the sum of squares, and the growth at the ends of the interval."""
        x = np.asarray([from_si(float(v), self.unit) for v in self.values])
        return [PlottedTrace("growth", x, self.rise), PlottedTrace(f"{100 * self.level:g} %", x, np.full(x.size, self.threshold))]

    @property
    def _axes_titles(self) -> tuple[str, str]:  # type: ignore[override]
        """Titles of the axes."""
        return (f"{self.path} [{self.unit}]", "growth of the weighted sum of squares [-]")


def problem_and_place(fit: Calibration, path: str) -> tuple[Problem, int]:
    """Return the problem of a fit and the position of an unknown."""
    if fit.problem is None:
        raise IdentificationError(
            "this calibration was not made by a fit in this session; repeat the fit.", fit.stage, code="fit.needs-session"
        )
    names = [u.name for u in fit.problem.unknowns]
    name = fit.given_model.canonical(path)
    refuse_unknown([name], names, fit.stage, f"'{path}' was not free in this fit.", NameNotFoundError)
    return fit.problem, names.index(name)


def spread_of(problem: Problem, at: Array, k: int, error: float) -> float:
    """Return the factor s on the noise with which the information of the readings gives the standard error of the fit. [-]

    It solves ``((J'J / s^2 + P)^-1)_kk = error^2``, P the information of the priors; 1 where no s from exp(-3) to exp(8) does.
    Residuals that wander widen the errors of a fit by more than their size does, and each parameter by its own amount.
    """
    from scipy.optimize import brentq

    data, priors = problem.compressed(at).slopes, problem.prior_rows(at)[1]

    def excess(log_spread: float) -> float:
        """Return ln of the standard error at this spread of the residuals, less that of the fit."""
        # ln of the standard error from (J'J / s^2 + P)^-1, over that of the fit
        rows = np.concatenate([data / np.exp(log_spread), priors])
        return float(0.5 * np.log(covariance(rows)[k, k]) - np.log(error))

    low, high = -3.0, 8.0
    return float(np.exp(brentq(excess, low, high, xtol=1e-4))) if excess(low) < 0 < excess(high) else 1.0


@takes_objects
def profile(fit: Calibration, path: str, level: float = 0.95, *, executor: Workers = None) -> Profile:
    """Return the interval of a parameter from its profile: it is moved step by step, and everything else is fitted anew each time.

    Parameters
    ----------
    fit : Calibration   The fit.
    path : str          Path of a fitted parameter.
    level : float       Probability of the interval. [-]
    executor            As in `ensemble`: who walks to the two ends.

    Raises
    ------
    NameNotFoundError   When the parameter was not free.

    Notes
    -----
    The interval ends where the weighted sum of squares, priors included, has grown by the quantile of chi-square with one degree of freedom
    (Venzon and Moolgavkar, Applied Statistics 37 (1988) 87-94, DOI 10.2307/2347496). Readings weigh as they do in the errors of the fit.
    """
    from scipy.special import gammaincinv

    if not 0.0 < level < 1.0:
        raise IdentificationError(
            f"a level of {level:g} is not a probability. Give one between 0 and 1, such as 0.95.", "profile", code="value.outside-range"
        )
    problem, k = problem_and_place(fit, path)
    threshold = float(2.0 * gammaincinv(0.5, level))
    at = np.array([fit.fitted[u.name] for u in problem.unknowns])
    u, value = problem.unknowns[k], fit.values[problem.unknowns[k].name]
    spread = spread_of(problem, at, k, value.error / u.slope(float(at[k])))
    walk = _Walk(fit, problem, k, at, spread, threshold)
    ends = dict(
        in_tasks(_Walk.side, [(f"the {way} end of '{u.name}'", (walk, sign)) for way, sign in (("lower", -1.0), ("upper", 1.0))], executor)
    )
    sides = [ends[0], ends[1]]
    for end, points, _ in sides:  # a smooth curve needs points on the way
        points += [(x, walk.rise(x, walk.at)[0]) for x in walk.best + np.array([0.33, 0.66]) * (end - walk.best)]
    line = sorted([*sides[0][1], *sides[1][1], (walk.best, 0.0)])
    low, high = (u.to_value(end) for end, _, _ in sides)
    limited = (sides[0][2], sides[1][2])
    tried, rise = np.array([u.to_value(x) for x, _ in line]), np.array([r for _, r in line])
    return Profile(u.name, u.unit, u.to_value(walk.best), low, high, limited, level, value.error, (u.low, u.high), tried, rise, threshold)


class _Walk:
    """Steps of one parameter away from the best fit, all others fitted anew at each; distances are in the fitted form."""

    def __init__(self, fit: Calibration, problem: Problem, k: int, at: Array, spread: float, threshold: float) -> None:
        """Find the best fit at this spread of the readings, from where steps begin."""
        request = fit.request
        self.loss, self.loss_scale = (request.loss, request.loss_scale) if request is not None else ("linear", 1.0)
        self.problem, self.k, self.spread, self.threshold = problem, k, spread, threshold
        begun = time.perf_counter()
        whole = minimise(PartlyFixed.with_fixed(problem, at, (), spread), self.loss, self.loss_scale, at)
        seconds = USUAL_EVALUATIONS * (time.perf_counter() - begun) / max(whole.evaluations, 1)
        foretell(f"profile goes on with some {USUAL_EVALUATIONS} evaluations, about {spoken(seconds)}.", seconds)
        self.at, self.cost, self.best = whole.fitted, whole.cost, float(whole.fitted[k])
        u: Unknown = problem.unknowns[k]
        self.step = fit.values[u.name].error / u.slope(self.best)
        self.bounds = u.fitted_bounds()
        self.log = u.log
        self.farthest = MAX_LOG_STEP if u.log else 1e3 * self.step

    def rise(self, x: float, start: Array) -> tuple[float, Array]:
        """Return the growth of the sum of squares with the parameter fixed at `x` [-], and all unknowns (unknowns,) there."""
        values = start.copy()
        values[self.k] = x
        fixed = PartlyFixed.with_fixed(self.problem, values, (self.k,), self.spread)
        minimum = minimise(fixed, self.loss, self.loss_scale, values[fixed.free_places])
        return max(0.0, 2.0 * (minimum.cost - self.cost)), fixed.full(minimum.fitted)

    def side(self, sign: float) -> tuple[float, list[tuple[float, float]], bool]:
        """Return the end of the lower (`sign` -1) or upper side (1), its points (value, growth), and whether the readings limit it.

        The side ends at the threshold; else at the bound, or at the farthest distance that is tried. Values are in the fitted form.
        """
        limit = self.bounds[0] if sign < 0 else self.bounds[1]
        most = min(abs(limit - self.best), self.farthest)
        # a logarithm with a large error knows little of where the limit is
        far, points = min(self.threshold**0.5 * self.step, FIRST_LOG_STEP if self.log else np.inf, most), list[tuple[float, float]]()
        before, start = 0.0, self.at
        for _ in range(MAX_POINTS_PER_SIDE):
            try:
                rise, place = self.rise(self.best + sign * far, start)
            except SolverError:
                break  # as far as the model can be run
            points.append((self.best + sign * far, rise))
            if rise >= self.threshold:
                return self._crossing(sign, before, abs(points[-1][0] - self.best), start, points)
            start = place
            if far >= most * (1 - 1e-9):
                break
            before = abs(points[-1][0] - self.best)
            far = min(far * float(np.clip((self.threshold / max(rise, 1e-12)) ** 0.5 * 1.05, 1.15, 3.0)), most)
        return self.best + sign * most, points, False

    def _crossing(
        self, sign: float, low: float, high: float, place: Array, points: list[tuple[float, float]]
    ) -> tuple[float, list[tuple[float, float]], bool]:
        """Return the value between the distances `low` and `high` where the growth reaches the threshold, the points, and True.

        `place` are the unknowns from which the others are fitted anew; new points are added to `points`.
        """
        from scipy.optimize import brentq

        goal = self.threshold**0.5
        rise_at = {distance: rise**0.5 for distance, rise in ((abs(x - self.best), r) for x, r in points)}

        def beyond(distance: float) -> float:
            """Return the root of the rise of the sum of squares at a distance from the best value, kept for later."""
            if distance not in rise_at:
                rise, _ = self.rise(self.best + sign * distance, place)
                points.append((self.best + sign * distance, rise))
                rise_at[distance] = rise**0.5
            return float(rise_at[distance] - goal)

        rise_at |= {low: rise_at.get(low, 0.0), high: rise_at[high]}
        at = float(brentq(beyond, low, high, xtol=0.01 * self.step, rtol=1e-3, maxiter=30, disp=False))
        return self.best + sign * at, points, True
