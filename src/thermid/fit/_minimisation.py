"""Bounded weighted least squares on exact derivatives: one descent, and the covariance at its end.

In: a `Problem`, a loss, a start. Out: a `Fit`: where it ended, its derivatives there, and how it got there; and covariances. The interrupt
key ends a descent with the best values so far. Starts beyond one: `fit.search`.

Steps s of a descent stay within a region of trust, |s / scale| <= reach, and promise most in there (Levenberg and Marquardt's: More,
Lecture Notes in Mathematics 630 (1978) 105). It shrinks where a step gains less than a quarter of what it promises, and grows where it
gains three quarters. What meets a bound stops there, and the others go on. A SolverError turns back, but of the start. Where a step
misses what J'J promised by more than a quarter, and the curvature that J'J lacks would have told it better, that counts in the next: as
much of it as the gradients along the way have shown.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, Protocol

import numpy as np

from thermid.base.errors import IdentificationError, SolverError, refuse_unknown
from thermid.base.linear_algebra import NOTHING, covariance
from thermid.base.units import Array, counted
from thermid.fit._problem.residuals import Compressed, Sums, Unknown, refuse_not_finite, starting_point

NEW_STEPS_SHARE, DONE = 0.02, 1e-4
"""A search goes on with new steps once the step ahead is below this part of every unknown's typical change, and ends once it is below this
part of a standard error."""
MOST_EVALUATIONS = 200
"""Of a descent at most."""
MISJUDGED = 0.25
"""Part of a promised gain by which a step misses it, from which the curvature that J'J lacks counts. [-]"""
LOSSES = ("linear", "soft_l1", "huber", "cauchy")


class LeastSquares(Protocol):
    """What can be minimised: the records of a fit (`Problem`), or a plain function of its unknowns."""

    @property
    def unknowns(self) -> tuple[Unknown, ...]:
        """What is looked for."""
        ...

    @property
    def samples(self) -> int:
        """How many readings there are."""
        ...

    def compressed(self, fitted: Array, loss: str = "linear", loss_scale: float = 1.0, meshes: Sequence[Array] = ()) -> Compressed:
        """Return the weighted residuals of all data with their derivatives."""
        ...

    def prior_rows(self, fitted: Array) -> tuple[Array, Array]:
        """Return the residuals of the priors and their derivatives."""
        ...

    def square(self, compressed: Compressed) -> float:
        """Return the sum of the squares of the residuals in units of the noise, whatever the loss."""
        ...


@dataclass(frozen=True, eq=False)
class Fit:
    """The end of a minimisation.

    Parameters
    ----------
    fitted : array (unknowns,)              In the fitted form.
    jacobian : array (rows, unknowns)       Of the data, weights of a robust loss included, in as few rows as hold the same information.
    priors : array (rows, unknowns)         Of the priors.
    cost : float                            Half the weighted sum of squares, priors included. [-]
    chi_square : float                      Weighted sum of squares of the data alone. [-]
    sums : tuple of (str, str, Sums)        Record, sensor, and the sums of its residuals.
    evaluations : int                       How often the records were simulated.
    message : str                           How it ended.
    converged : bool
    search : str                            What was looked at beyond one descent; empty for nothing.
    remarks : tuple of str                  What a reader must know of it.
    stopped : bool                          Whether the interrupt key ended it; it then stands at the best values so far.
    """

    fitted: Array
    jacobian: Array
    priors: Array
    cost: float
    chi_square: float
    sums: tuple[tuple[str, str, Sums], ...]
    evaluations: int
    message: str
    converged: bool
    search: str = ""
    remarks: tuple[str, ...] = ()
    stopped: bool = False

    @staticmethod
    def ended(
        problem: LeastSquares,
        fitted: Array,
        loss: str = "linear",
        loss_scale: float = 1.0,
        evaluations: int = 1,
        message: str = "kept as it was",
        converged: bool = True,
    ) -> Fit:
        """Return the fit that ended at some values of the unknowns, with its derivatives."""
        return _fit_at(problem, fitted, problem.compressed(fitted, loss, loss_scale), evaluations, message, converged)


@dataclass(frozen=True)
class KeptFit:
    """What is kept of a fit that ended: enough to take it again without a search, and to say the same of it.

    Parameters
    ----------
    fitted : dict               Unknown -> its value, in the fitted form.
    evaluations : int           How often the records were simulated.
    search : str                What was looked at beyond one descent; empty for nothing.
    remarks : tuple of str      What a reader must know of the search.
    """

    fitted: Mapping[str, float]
    evaluations: int
    search: str = ""
    remarks: tuple[str, ...] = ()


LocalCost = tuple[float, Array, Array]
"""Of a cost at some values: itself, rows r and slopes J, such that a step s away it is ``cost + r'J s + |J s|^2 / 2``. [-]"""


class Descent(NamedTuple):
    """Where a descent ended: the values, the gain that a full step would still promise, how it ended, whether it came to an end."""

    x: Array
    ahead: float
    message: str
    converged: bool


def descend(
    local: Callable[[Array], LocalCost],
    start: Array,
    bounds: tuple[Array, Array],
    scale: Array,
    *,
    near: float = 0.0,
    done: float = DONE,
    relative: float = 1e-10,
    samples: float = np.inf,
    rounds: int = MOST_EVALUATIONS,
    reach: float | None = None,
) -> Descent:
    """Return where a damped descent of Gauss and Newton from a start (unknowns,) ends, within bounds.

    Parameters
    ----------
    local : callable    Values -> half the sum of squares of rows, or another cost of gradient J'r and information J'J.
    scale : array       Typical changes of the unknowns.
    near, done : float  It ends when the full step ahead is below this part of every typical change, or of a standard error; [-]
    relative : float    when a step lowers the cost by less than this part of it; [-]
    samples : float     how many readings tell what a standard error is worth, where rows are larger than their noise;
    rounds : int        after so many evaluations in any case: it then did not converge.
    reach : float       Of the region of trust at first; by default as far as the start is from zero.

    Raises
    ------
    SolverError   Of the start; and where derivatives are not finite.
    """
    here = local(x := np.clip(start, *bounds))
    reach = reach or max(float(np.linalg.norm(x / scale)), 1.0)
    count, gained, bend, bent = 1, np.inf, np.zeros((x.size, x.size)), False
    while True:
        cost, plain = here[0], here[1:]
        rows, slopes = _with_bend(*plain, bend, scale) if bent else plain
        full = _step(rows, slopes, x, bounds, scale, np.inf)
        ahead = _promised(rows, slopes, full)
        if (np.abs(full) < near * scale).all():
            return Descent(x, ahead, f"the step ahead is below {near:g} of every typical change", True)
        if 2.0 * ahead <= done**2 * max(2.0 * cost / samples, 1.0):
            return Descent(x, ahead, f"the step ahead is below {done:g} standard errors", True)
        if gained < relative * abs(cost):
            return Descent(x, ahead, f"a step gained less than {relative:g} of the sum of squares", True)
        while True:
            if count >= rounds:
                return Descent(x, ahead, f"no end after {counted(count, 'evaluation')}", False)
            step = full if np.linalg.norm(full / scale) <= reach else _step(rows, slopes, x, bounds, scale, reach)
            promised, size = _promised(rows, slopes, step), float(np.linalg.norm(step / scale))
            there = _tried(local, new := np.clip(x + step, *bounds))
            count, gained = count + 1, cost - there[0]
            if np.isfinite(there[0]):
                straight, more = _promised(*plain, new - x), 0.5 * float((new - x) @ bend @ (new - x))
                bent = abs(gained - straight) > max(MISJUDGED * straight, abs(gained - straight + more))
                bend = _bend_after(bend, new - x, plain, there[1:])
            reach = 0.25 * size if gained < 0.25 * promised else 2.0 * reach if gained > 0.75 * promised and size > 0.95 * reach else reach
            if gained > 0.0:
                break
            if promised < relative * abs(cost) or size < 1e-10:
                return Descent(x, ahead, "no step gains any more", True)
        x, here = new, there


def _tried(local: Callable[[Array], LocalCost], x: Array) -> LocalCost:
    """Return cost, residuals (rows,) and slopes (rows, unknowns) at `x` (unknowns,), fitted form; an infinite cost where the run fails."""
    try:
        cost, rows, slopes = local(x)
    except SolverError:
        return np.inf, x, x
    return cost if np.isfinite(cost) else np.inf, rows, slopes


def _bend_after(bend: Array, step: Array, before: tuple[Array, Array], after: tuple[Array, Array]) -> Array:
    """Return S (unknowns, unknowns), what the curvature of the cost has beside J'J, by how a step s (unknowns,) changed the gradient.

    `before` and `after` are rows r (rows,) and slopes J (rows, unknowns). With y = J'r after - before and u = y - J'J s the update is S +
    (v y' + y v') / y's - (v's) y y' / (y's)^2, v = u - S s, S times min(1, |s'u| / |s'S s|) first. It keeps what is known of other
    directions: Dennis, Gay and Welsch, ACM Trans. Math. Softw. 7 (1981) 348.
    """
    with np.errstate(over="ignore", invalid="ignore"):  # far off, slopes may be so large that their products are no floats
        turned = after[1].T @ after[0] - before[1].T @ before[0]
        along = float(turned @ step)
        if not along > 0.0:
            return bend
        remaining_turn = turned - after[1].T @ (after[1] @ step)
        size = abs(float(step @ bend @ step))
        kept = bend * min(1.0, abs(float(step @ remaining_turn)) / size) if size > 0.0 else bend
        off = remaining_turn - kept @ step
        way = turned / along
        secant = np.outer(off, way) + np.outer(way, off) - (off @ step) * np.outer(way, way)
        return np.asarray(kept + secant) if np.isfinite(kept + secant).all() else bend


def _with_bend(rows: Array, slopes: Array, bend: Array, scale: Array) -> tuple[Array, Array]:
    """Return rows g (unknowns,) and slopes S (unknowns, unknowns) with S'g the gradient J'r and S'S the curvature J'J + bend. [-]

    S'S is made positive: its eigenvalues in units of `scale` (unknowns,), fitted form, count by their size.
    """
    sizes, ways = np.linalg.eigh((slopes.T @ slopes + bend) * np.outer(scale, scale))
    sizes = np.maximum(np.abs(sizes), np.finfo(float).eps * np.abs(sizes).max() + np.finfo(float).tiny)
    gradient = ways.T @ (scale * (slopes.T @ rows))
    return gradient / np.sqrt(sizes), np.sqrt(sizes)[:, None] * ways.T / scale


def _promised(rows: Array, slopes: Array, step: Array) -> float:
    """Return by how much a step (unknowns,) lowers the cost |r|^2 / 2 by rows r and slopes J: ``-r'J s - |J s|^2 / 2``. [-]"""
    change = slopes @ step
    return -float(rows @ change + 0.5 * change @ change)


def _step(rows: Array, slopes: Array, x: Array, bounds: tuple[Array, Array], scale: Array, reach: float) -> Array:
    """Return the step (unknowns,) within a region of trust that promises most, as far as the first bound, and on from there along it.

    In units of `scale` the s that makes |r + J s| least with |s| <= reach (`_within`); what a bound stops stays there while the others go
    on from r + J s. What stands on a bound and would leave it by the gradient J'r is not moved.

    Parameters
    ----------
    rows : array (rows,)                Weighted residuals r and priors. [-]
    slopes : array (rows, unknowns)     J, their derivatives, fitted form.
    x : array (unknowns,)               Where the step begins, fitted form.
    bounds : pair of array (unknowns,)  Lowest and highest x.
    scale : array (unknowns,)           Unit in which a step is measured.
    reach : float                       Its greatest length in those. [-]

    Raises
    ------
    SolverError   When a derivative is not finite.
    """
    refuse_not_finite(slopes, rows)
    low, high = bounds
    slopes = slopes * scale
    gradient = slopes.T @ rows
    free = ~(((x <= low) & (gradient > 0.0)) | ((x >= high) & (gradient < 0.0)))
    step = np.zeros(x.size)
    while free.any():
        way = np.zeros(x.size)
        way[free] = _within(slopes[:, free], rows + slopes[:, ~free] @ step[~free], reach) - step[free]
        ends, move = np.where(way > 0.0, high - x, low - x), way * scale
        room = ends - step * scale
        beyond = free & np.where(way > 0.0, move > room, move < room)  # what stands on a bound is there but for rounding
        if not beyond.any():
            step = step + way
            break
        part = np.divide(room, move, out=np.full(x.size, np.inf), where=beyond)
        met = part <= part.min()
        step = step + part.min() * way
        step[met] = ends[met] / scale[met]
        free &= ~met
    return step * scale


def _within(slopes: Array, rows: Array, reach: float) -> Array:
    """Return the step s (unknowns,) that makes |r + J s| least with |s| <= reach, of rows r (rows,) and slopes J (rows, unknowns). [-]

    (J'J + damping) s = -J'r; the damping is found to 1 % of the length by Newton's method on 1 / reach - 1 / |s| (More, Lecture Notes in
    Mathematics 630 (1978) 105).
    """
    left_vectors, sizes, right = np.linalg.svd(slopes, full_matrices=False)
    force = left_vectors.T @ rows
    is_nonzero = sizes > np.finfo(float).eps * max(slopes.shape) * sizes.max(initial=0.0)
    force, sizes, right = force[is_nonzero], sizes[is_nonzero], right[is_nonzero]
    part = force / sizes
    damping = 0.0
    # Newton's method on 1 / reach - 1 / |s|, which is nearly straight in the damping (More 1978); it comes from below
    for _ in range(20):
        length = float(np.linalg.norm(part))
        if length <= 1.01 * reach:
            break
        bend = float(np.sum(part**2 / (sizes**2 + damping)))
        damping += (length / reach - 1.0) * length**2 / bend
        part = sizes * force / (sizes**2 + damping)
    length = float(np.linalg.norm(part))
    return np.asarray(-(part * min(1.0, reach / length) if length > 0.0 else part) @ right)


class _CountedRuns:
    """A problem as `descend` asks for it; residuals and derivatives come from one run, all runs on the steps of one among them."""

    def __init__(self, problem: LeastSquares, loss: str, loss_scale: float, progress: Callable[[int, float], None] | None) -> None:
        """Begin without a run."""
        self.problem, self.loss, self.loss_scale, self.progress = problem, loss, loss_scale, progress
        self.count = 0
        self.best: tuple[float, Array, Compressed] | None = None
        self.scale = np.array([u.scale for u in problem.unknowns])
        self._settled: Array | None = None
        self._latest: tuple[Array, Compressed] | None = None
        self._meshes: tuple[Array, ...] = ()

    def settle(self, x: Array) -> None:
        """Let the integrator choose its steps at some values, unless it did so near by; these hold until the next call.

        Raises
        ------
        SolverError   When a record cannot be run.
        """
        if self._settled is None or not (np.abs(x - self._settled) < NEW_STEPS_SHARE * self.scale).all():
            compressed = self.problem.compressed(x, self.loss, self.loss_scale)
            self._meshes, self._settled, self._latest, self.best = compressed.meshes, x, (x, compressed), None

    def at(self, x: Array) -> Compressed:
        """Return the residuals at some values; the latest and the best are remembered."""
        for remembered in (self._latest, self.best and self.best[1:]):
            if remembered is not None and np.array_equal(remembered[0], x):
                return remembered[1]
        compressed = self.problem.compressed(x, self.loss, self.loss_scale, self._meshes)
        self._latest = x, compressed
        return compressed

    def local(self, x: Array) -> LocalCost:
        """Return the cost r'r / 2, residuals r (rows,) and slopes (rows, unknowns) at `x` (unknowns,), fitted form, priors below. [-]

        Raises
        ------
        SolverError   When a record cannot be run.
        """
        self.count += 1
        priors, prior_slopes = self.problem.prior_rows(x)
        compressed = self.at(x)
        rows = np.concatenate([compressed.rows, priors])
        cost = 0.5 * float(rows @ rows)
        if self.best is None or cost < self.best[0]:
            self.best = cost, x.copy(), compressed
        if self.progress is not None:
            self.progress(self.count, float(np.sqrt(self.problem.square(compressed) / self.problem.samples)))
        return cost, rows, np.concatenate([compressed.slopes, prior_slopes])


def minimise(
    problem: LeastSquares,
    loss: str = "linear",
    loss_scale: float = 1.0,
    start: Array | None = None,
    progress: Callable[[int, float], None] | None = None,
    done: float = DONE,
    rounds: int = MOST_EVALUATIONS,
    stoppable: bool = False,
) -> Fit:
    """Return the least-squares fit of a problem.

    Parameters
    ----------
    problem : LeastSquares
    loss : str              linear, soft_l1, huber or cauchy, on residuals in units of the noise; priors stay quadratic.
    loss_scale : float      Residual, in units of the noise, from which the loss bends.
    start : array           In the fitted form; the unknowns' own start by default.
    progress : callable     Called with the number of evaluations and the RMS of the weighted residuals.
    done : float            The descent ends once the step ahead is below this part of a standard error. [-]
    rounds : int            Each of its two parts, to a relative 1e-3 of the cost and to the end, has at most so many evaluations.
    stoppable : bool        Whether the interrupt key ends it with the best values so far, once there are any: `Fit.stopped`, not converged.

    Raises
    ------
    SolverError             When the model cannot be run at the start.
    IdentificationError     When there is no such loss.
    """
    refuse_unknown([loss], LOSSES, "", "unknown loss '{}'. Use one of {known}.", IdentificationError)
    unknowns = problem.unknowns
    at = starting_point(unknowns) if start is None else np.asarray(start, dtype=float)
    if not unknowns:
        return Fit.ended(problem, at, loss, loss_scale, message="no parameter was free")
    low, high = (np.array(b) for b in zip(*(u.fitted_bounds() for u in unknowns), strict=True))
    bounds = np.nextafter(low, np.inf), np.nextafter(high, -np.inf)
    runs = _CountedRuns(problem, loss, loss_scale, progress)
    at = np.clip(at, *bounds)
    try:
        runs.settle(at)  # a model that cannot be run at the start says why, in the integrator's words
        at = descend(runs.local, at, bounds, runs.scale, near=NEW_STEPS_SHARE, done=0.0, relative=1e-3, rounds=rounds).x
        runs.settle(at)
        relative = min(1e-10, max(done**2, 1e-15))
        count = problem.samples
        end = descend(runs.local, at, bounds, runs.scale, done=done, relative=relative, samples=count, rounds=rounds)
    except KeyboardInterrupt:
        if runs.best is None or not stoppable:
            raise
        _, at, data = runs.best
        message = f"stopped by the user after {counted(runs.count, 'evaluation')}, at the best values so far"
        return replace(_fit_at(problem, at, data, runs.count, message, False), stopped=True)
    return _fit_at(problem, end.x, runs.at(end.x), runs.count, end.message, end.converged)


def _fit_at(problem: LeastSquares, fitted: Array, data: Compressed, evaluations: int, message: str, converged: bool) -> Fit:
    """Return the end of a minimisation: half of chi-square and the priors' squares is its cost."""
    rows, slopes = problem.prior_rows(fitted)
    cost = 0.5 * (data.chi_square + float(rows @ rows))
    return Fit(fitted, data.slopes, slopes, cost, data.chi_square, data.sums, evaluations, message, converged)


def covariances(fit: Fit, level: float = 1.0, excess: Array | None = None) -> tuple[Array, Array, Array]:
    """Return three covariances of the fitted form: total, random, and the one that the weights of the fit stand for.

    The weights stand for ``C = (J'J / level + priors)^-1``, J the weighted derivatives of the data and `level` the variance of residuals
    that do not wander, in squares of the noise. Residuals that wander add ``C E C / level^2``, with E (unknowns, unknowns) the `excess` of
    the covariance of J'r over ``level J'J``: the sandwich of Huber, Proc. 5th Berkeley Symposium 1 (1967) 221, which widens the directions
    along which they wander and leaves the others. The random part is the scatter of a repeat of the same tests with the same instruments;
    what is left is what the priors hold of constant errors. A combination that the data depend on, however weakly, has a finite error.
    """
    data = fit.jacobian / np.sqrt(level)
    weights = covariance(np.concatenate([data, fit.priors]), NOTHING)
    weight_covariance = finite(weights)
    spread = data @ weight_covariance
    added = weight_covariance @ excess @ weight_covariance / level**2 if excess is not None else np.zeros_like(weight_covariance)
    return weights + added, np.where(np.isinf(weights), np.inf, spread.T @ spread + added), weights


def finite(matrix: Array) -> Array:
    """Return a covariance with zeros in place of what is not known at all."""
    return np.where(np.isfinite(matrix), matrix, 0.0)
