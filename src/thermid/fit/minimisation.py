"""Bounded weighted least squares on exact derivatives, beyond one valley where that is asked, and the covariance at the end.

In: a `Problem`, a loss, a way of searching. Out: a `Fit`: where it ended, its derivatives there, and how it got there; and covariances.
Several starts, differential evolution and covariance matrix adaptation look at members run side by side; least squares always ends it.
May import: `fit.problem` and the rooms below a fit.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from thermid.errors import IdentificationError, SolverError, refuse_unknown
from thermid.extensions import optional
from thermid.fit.problem.residuals import FAILED, Compressed, Problem, Sums, loss_of
from thermid.fit.problem.unknowns import Unknown, starting_point
from thermid.linear_algebra import NOTHING, Array, covariance, finite, pseudo_inverse, sandwich
from thermid.simulation.ensemble import run_members

NEAR, DONE = 0.02, 1e-4
"""A search goes on with new steps once the step ahead is below this part of every unknown's typical change, and ends once it is below this
part of a standard error."""
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

    def square(self, found: Compressed) -> float:
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


class _Arrived(Exception):  # noqa: N818 - it ends a search, nothing went wrong
    """The step ahead is so small that it is not worth a run."""

    def __init__(self, x: Array, step: str) -> None:
        super().__init__(f"the step ahead is below {step}")
        self.x = x


class _Search:
    """What `least_squares` asks for; residuals and derivatives come from one run, all runs on the steps of one among them."""

    def __init__(
        self, problem: LeastSquares, loss: str, loss_scale: float, progress: Callable[[int, float], None] | None, done: float = DONE
    ) -> None:
        self.problem, self.loss, self.loss_scale, self.progress, self.done = problem, loss, loss_scale, progress, done
        self.count = 0
        self.fine = False
        self.scale = np.array([u.scale for u in problem.unknowns])
        self._settled: Array | None = None
        self._known: dict[bytes, Compressed] = {}
        self._meshes: tuple[Array, ...] = ()

    def settle(self, x: Array) -> None:
        """Let the integrator choose its steps at some values, unless it did so near by; these hold until the next call.

        Raises
        ------
        SolverError   When a record cannot be run.
        """
        if self._settled is not None and (np.abs(x - self._settled) < NEAR * self.scale).all():
            return
        found = self.problem.compressed(x, self.loss, self.loss_scale)
        self._known, self._meshes, self._settled = {x.tobytes(): found}, found.meshes, x

    def at(self, x: Array) -> Compressed:
        """Return the residuals at some values; the latest two sets of values are remembered."""
        key = x.tobytes()
        if key not in self._known:
            found = self.problem.compressed(x, self.loss, self.loss_scale, self._meshes)
            self._known = dict([*self._known.items()][-1:]) | {key: found}
        return self._known[key]

    def residuals(self, x: Array) -> Array:
        """Return the residuals; of a run that the integrator could not finish very large ones, so that the optimiser turns back."""
        self.count += 1
        samples = self.problem.samples
        try:
            found = self.at(x)
            rows, square = found.rows, self.problem.square(found)
        except SolverError:
            square = samples * FAILED**2
            rows = np.zeros(next(iter(self._known.values())).rows.size)
            rows[-1] = np.sqrt(square)
        if self.progress is not None:
            self.progress(self.count, float(np.sqrt(square / samples)))
        return np.concatenate([rows, self.problem.prior_rows(x)[0]])

    def slopes(self, x: Array) -> Array:
        """Return their derivatives, unless the step of Gauss and Newton from here is not worth a run."""
        priors, prior_slopes = self.problem.prior_rows(x)
        found = self.at(x)
        slopes, rows = np.concatenate([found.slopes, prior_slopes]), np.concatenate([found.rows, priors])
        step = np.linalg.lstsq(slopes / self.scale, -rows, rcond=None)[0]
        if not self.fine and (np.abs(step) < NEAR).all():
            raise _Arrived(x, f"{NEAR} of every typical change")
        gain = float(np.sum(((slopes / self.scale) @ step) ** 2))  # in squares of a standard error, where the noise is what is stated
        if self.fine and gain < self.done**2 * max(1.0, self.problem.square(found) / self.problem.samples):
            raise _Arrived(x, f"{self.done:g} standard errors")
        return slopes


def minimise(
    problem: LeastSquares,
    loss: str = "linear",
    loss_scale: float = 1.0,
    start: Array | None = None,
    progress: Callable[[int, float], None] | None = None,
    done: float = DONE,
) -> Fit:
    """Return the least-squares fit of a problem.

    Parameters
    ----------
    problem : LeastSquares
    loss : str              linear, soft_l1, huber or cauchy, on residuals in units of the noise; priors stay quadratic.
    loss_scale : float      Residual, in units of the noise, from which the loss bends.
    start : array           In the fitted form; the unknowns' own start by default.
    progress : callable     Called with the number of evaluations and the RMS of the weighted residuals.
    done : float            The search ends once the step ahead is below this part of a standard error. [-]

    Raises
    ------
    SolverError             When the model cannot be run at the start.
    IdentificationError     When there is no such loss.
    """
    refuse_unknown([loss], LOSSES, "", "unknown loss '{}'. Use one of {known}.", IdentificationError)
    unknowns = problem.unknowns
    at = starting_point(unknowns) if start is None else np.asarray(start, dtype=float)
    if not unknowns:
        return ended(problem, at, loss, loss_scale, message="no parameter was free")
    low, high = (np.array(b) for b in zip(*(u.fitted_bounds() for u in unknowns), strict=True))
    at = np.clip(at, np.nextafter(low, np.inf), np.nextafter(high, -np.inf))
    search = _Search(problem, loss, loss_scale, progress, done)
    for fine in (False, True):
        search.fine = fine
        search.settle(at)  # a model that cannot be run at the start says why, in the integrator's words
        at, message, converged = _searched(search, at, (low, high))
    return _fit_at(problem, at, search.at(at), search.count, message, converged)


def _searched(search: _Search, at: Array, bounds: tuple[Array, Array]) -> tuple[Array, str, bool]:
    """Return where a search from some values ends, how, and whether it converged."""
    from scipy.optimize import least_squares

    tolerance = min(1e-10, max(search.done**2, 1e-15)) if search.fine else 1e-3
    try:
        with np.errstate(over="ignore", invalid="ignore"):  # where a log contradicts its model a search may run very far
            found = least_squares(
                search.residuals,
                at,
                jac=search.slopes,
                bounds=bounds,
                x_scale=search.scale,
                method="trf",
                ftol=tolerance,
                xtol=min(1e-10, max(search.done**2, 1e-15)),
                gtol=1e-10,
                max_nfev=200,
            )
    except _Arrived as arrived:
        return arrived.x, str(arrived), True
    except np.linalg.LinAlgError:
        raise SolverError(
            "the fit diverged: its derivatives are not finite. Give its parameters min and max, or priors. Check the log too: a "
            "column, a unit or a node may be wrong.",
            "fit",
        ) from None
    return found.x, found.message, bool(found.success)


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


def _fit_at(problem: LeastSquares, fitted: Array, data: Compressed, evaluations: int, message: str, converged: bool) -> Fit:
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
    known = finite(weights)
    spread = data @ known
    added = sandwich(known, excess) / level**2 if excess is not None else np.zeros_like(known)
    return weights + added, np.where(np.isinf(weights), np.inf, spread.T @ spread + added), weights


Progress = Callable[[int, float], None]

DECADE = math.log(10.0)
SEARCHES = ("auto", "local", "multistart", "differential evolution", "cma")
SCREENED, DESCENTS = 64, 5
"""How many points of the box are looked at without derivatives, and from how many of the best of them least squares descends."""
APART = 0.15
"""Two starts lie apart when they differ by this part of the box in some parameter."""
TWICE = 4.0
"""Residuals of twice the stated noise, as a reduced chi-square, make one valley doubtful."""
GENERATIONS = 300


@dataclass(frozen=True, eq=False)
class Population:
    """The parameters of a problem over a box; all other unknowns (constant errors, temperatures of single records) stay at their start.

    Parameters
    ----------
    problem : Problem
    loss : str                  linear, soft_l1, huber or cauchy.
    loss_scale : float          Residual, in units of the noise, from which the loss bends.
    at : array (parameters,)    Positions of the parameters among the unknowns.
    low, high : array           Corners of the box, in the fitted form.
    """

    problem: Problem
    loss: str
    loss_scale: float
    at: NDArray[np.int64]
    low: Array
    high: Array

    @classmethod
    def of(cls, problem: Problem, loss: str, loss_scale: float) -> Population:
        """Return the population of a problem."""
        at = np.array([k for k, u in enumerate(problem.unknowns) if u.kind == "parameter"], dtype=np.int64)
        corners = np.array([box_of(problem.unknowns[k]) for k in at]).reshape(-1, 2)
        return cls(problem, loss, loss_scale, at, corners[:, 0], corners[:, 1])

    @property
    def start(self) -> Array:
        """The start of all unknowns (unknowns,), in the fitted form."""
        return starting_point(self.problem.unknowns)

    def placed(self, shares: Array) -> Array:
        """Return points of the unit cube (members, parameters) as values of all unknowns (members, unknowns), in the fitted form."""
        out = np.tile(self.start, (shares.shape[0], 1))
        out[:, self.at] = self.low + shares * (self.high - self.low)
        return out

    def share(self, fitted: Array) -> Array:
        """Return where values of all unknowns lie in the unit cube (parameters,)."""
        return np.asarray(np.clip((fitted[self.at] - self.low) / (self.high - self.low), 0.0, 1.0))

    def costs(self, shares: Array) -> Array:
        """Return half the weighted sum of squares (members,) at points of the unit cube, priors included; infinite where a run fails."""
        points = self.placed(shares)
        cost = np.array([float(r @ r) for r in (self.problem.prior_rows(p)[0] for p in points)])
        for i, bench in enumerate(self.problem.benches()):
            seen = bench.experiment.observations
            inputs = np.array([self.problem.inputs(i, p)[0] for p in points])
            draws = dict(zip(bench.free, inputs.T, strict=True))
            nodes = list(dict.fromkeys(o.node for o in seen))
            times, options = bench.experiment.times, self.problem.options
            found = run_members(bench.engine, draws, times, options, nodes, None, 1, "auto", ())
            for o in seen:
                bias, _ = self.problem._bias(o.sensor, points[0])
                residuals = (o.measured[:, None] - found.temperatures(o.node)[o.index] - bias) / o.sigma(self.problem.noise)
                cost += loss_of(residuals**2, self.loss, self.loss_scale)[0].sum(axis=0)
        return np.where(np.isfinite(cost), 0.5 * cost, np.inf)


def box_of(unknown: Unknown) -> tuple[float, float]:
    """Return where an unknown is looked for, in its fitted form.

    Its bounds, cut at four standard deviations of its prior; where it has neither, a factor of ten either way of the start of a positive
    quantity, and twice a typical change of any other.
    """
    low, high = unknown.fitted_bounds()
    middle, reach = unknown.to_fitted(unknown.start), DECADE if unknown.log else 2.0 * unknown.scale
    if unknown.prior is not None:
        middle, reach = unknown.prior.mean, 4.0 * unknown.prior.sd
        low, high = max(low, middle - reach), min(high, middle + reach)
    low = low if math.isfinite(low) else min(middle - reach, high - reach)
    return low, high if math.isfinite(high) else max(middle + reach, low + reach)


def searched(problem: Problem, how: str, loss: str, loss_scale: float, progress: Progress | None = None) -> Fit:
    """Return the best fit that a search finds, all of its evaluations counted.

    Parameters
    ----------
    problem : Problem
    how : str               ``local``: one descent from the start. ``multistart``: further descents from the best of 64 points of the box.
                            ``auto``: these only where the first descent ends at a bound, unfinished, or with residuals of more than twice
                            the stated noise. ``differential evolution`` and ``cma``: a population over the box, then one descent.
    loss, loss_scale, progress    As in `minimise`.

    Raises
    ------
    IdentificationError     When there is no such search.
    SolverError             When the model cannot be run at the start.
    """
    refuse_unknown([how], SEARCHES, "", "unknown search '{}'. Use one of {known}.", IdentificationError)
    population = Population.of(problem, loss, loss_scale)
    if not population.at.size or how == "local":
        return minimise(problem, loss, loss_scale, progress=progress)
    if how in ("differential evolution", "cma"):
        found = evolved(population, how)
        end = minimise(problem, loss, loss_scale, population.placed(found.share[None, :])[0], progress)
        words = f"{how}: {found.evaluations} members, cost {found.cost:.6g}; polished by {end.evaluations} evaluations to {end.cost:.6g}"
        return replace(end, evaluations=end.evaluations + found.evaluations, search=words)
    first = minimise(problem, loss, loss_scale, progress=progress)
    why = doubts(problem, first) if how == "auto" else "as asked"
    return _descended(population, first, why, progress) if why else first


def doubts(problem: Problem, found: Fit) -> str:
    """Return why one descent may have ended in the wrong valley, or an empty text."""
    if not found.converged:
        return "the first descent did not converge"
    error = _errors(problem, found)
    for k, u in enumerate(problem.unknowns):
        near = max(1e-4 * u.scale, 0.02 * float(error[k]))
        if u.kind == "parameter" and any(abs(found.fitted[k] - b) < near for b in u.fitted_bounds()):
            return f"'{u.name}' ended at its bound"
    stated = all(o.noise is not None for o in problem.observations())
    times = _level(problem, found)
    return f"the residuals are {np.sqrt(times):.2g} times the stated noise" if stated and times > TWICE else ""


def _level(problem: Problem, found: Fit) -> float:
    """Return the weighted sum of squares per degree of freedom. [-]"""
    return found.chi_square / max(problem.freedom, 1.0)


def _errors(problem: Problem, found: Fit) -> Array:
    """Return the standard errors (unknowns,) in the fitted form, widened by residuals that exceed the noise."""
    rows = np.concatenate([found.jacobian / np.sqrt(max(1.0, _level(problem, found))), found.priors])
    return np.asarray(np.sqrt(np.diag(pseudo_inverse(rows, NOTHING))))


def _descended(population: Population, first: Fit, why: str, progress: Progress | None) -> Fit:
    """Return the best of the first descent and of those from the best points of the box."""
    problem = population.problem
    shares = _spread_out(population)
    costs = population.costs(shares)
    ends, count = [first], SCREENED + first.evaluations
    taken = [population.share(first.fitted), population.share(population.start)]
    for k in np.argsort(costs):
        if len(ends) > DESCENTS or not np.isfinite(costs[k]):
            break
        if min(np.abs(shares[k] - t).max() for t in taken) < APART:
            continue
        taken.append(shares[k])
        try:
            ends.append(minimise(problem, population.loss, population.loss_scale, population.placed(shares[k : k + 1])[0], progress))
        except SolverError:
            continue
        count += ends[-1].evaluations
    best = min(ends, key=lambda f: (round(f.cost, 6), f is not first))
    words, remarks = _valleys(problem, best, ends, first)
    return replace(best, evaluations=count, search=f"multistart, {why}: {SCREENED} points, {words}", remarks=remarks)


def _spread_out(population: Population) -> Array:
    """Return points of the unit cube (SCREENED, parameters), spread evenly (Sobol, scrambled)."""
    from scipy.stats import qmc

    return np.asarray(qmc.Sobol(population.at.size, rng=np.random.default_rng(1)).random(SCREENED))


def _valleys(problem: Problem, best: Fit, ends: list[Fit], first: Fit) -> tuple[str, tuple[str, ...]]:
    """Return what the ends of all descents say: in words, and remarks on other values that fit as well."""
    error = _errors(problem, best)
    error = np.where(error > 0.0, error, np.inf)  # a value without an error, at a bound, does not separate ends
    same = [bool((np.abs(f.fitted - best.fitted) <= 0.5 * error).all()) for f in ends]
    words = f"{len(ends)} descents, {sum(same)} of which ended at the same values"
    others = [f for f, s in zip(ends, same, strict=True) if not s]
    if others:
        words += f"; the next best costs {min(f.cost for f in others) / best.cost:.4g} times as much"
    if first.cost > best.cost * (1 + 1e-6) and not same[ends.index(first)]:
        words += f"; the descent from the given start ended at {first.cost / best.cost:.4g} times the best cost"
    remarks = []
    for other in (f for f in others if f.cost - best.cost < 2.0 * max(1.0, _level(problem, best))):
        k = int(
            np.argmax(
                [
                    abs(d) if u.kind == "parameter" else 0.0
                    for u, d in zip(problem.unknowns, (other.fitted - best.fitted) / error, strict=True)
                ]
            )
        )
        u = problem.unknowns[k]
        there, here = u.to_value(float(other.fitted[k])), u.to_value(float(best.fitted[k]))
        remarks.append(
            f"other values fit equally well: '{u.name}' could also be {there / here:.3g} times the reported value. Give it a prior or "
            "tighter bounds."
        )
    return words, tuple(dict.fromkeys(remarks))


@dataclass(frozen=True, eq=False)
class Evolved:
    """The end of a population: the best point of the unit cube (parameters,), its cost, and how many members were run."""

    share: Array
    cost: float
    evaluations: int


def evolved(population: Population, how: str, seed: int = 1) -> Evolved:
    """Return the best member of a population that evolved over the box.

    Differential evolution: Storn and Price, J. Global Optim. 11 (1997) 341, in scipy. Covariance matrix adaptation: Hansen, arXiv
    1604.00772, in the package cma.
    """
    return _differential(population, seed) if how == "differential evolution" else _adapted(population, seed)


def _differential(population: Population, seed: int) -> Evolved:
    from scipy.optimize import Bounds, differential_evolution

    count = 0

    def costs(points: Array, /) -> Any:  # one cost per member, which the stubs of scipy do not know of
        nonlocal count
        shares = np.atleast_2d(points.T)
        count += shares.shape[0]
        return _finite(population.costs(shares))

    found = differential_evolution(
        costs,
        Bounds(np.zeros(population.at.size), np.ones(population.at.size)),
        vectorized=True,
        updating="deferred",
        polish=False,
        init="sobol",
        tol=1e-4,
        atol=1e-3,
        maxiter=GENERATIONS,
        rng=np.random.default_rng(seed),
        x0=population.share(population.start),
    )
    return Evolved(np.asarray(found.x), float(found.fun), count)


def _adapted(population: Population, seed: int) -> Evolved:
    cma = optional("cma", "covariance matrix adaptation")
    size = population.at.size
    if size == 1:
        raise IdentificationError("covariance matrix adaptation needs at least two parameters. Use search = 'multistart'.")
    # from the middle of the box, wide, and more members than its rule asks for: else it stays in the valley that it starts in
    options = {"bounds": [0.0, 1.0], "seed": seed, "verbose": -9, "tolfun": 1e-3, "maxiter": GENERATIONS, "popsize": max(16, 4 * size)}
    strategy = cma.CMAEvolutionStrategy(np.full(size, 0.5), 0.5, options)
    while not strategy.stop():
        members = strategy.ask()
        strategy.tell(members, _finite(population.costs(np.array(members))).tolist())
    return Evolved(np.asarray(strategy.result.xbest), float(strategy.result.fbest), int(strategy.result.evaluations))


def _finite(costs: Array) -> Array:
    """Return costs with a very large one for members that could not be run."""
    return np.where(np.isfinite(costs), costs, 1e30)
