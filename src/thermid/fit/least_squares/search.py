"""Search beyond one valley: several starts, differential evolution, covariance matrix adaptation; least squares always ends it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thermid.errors import IdentificationError, SolverError, nearest
from thermid.fit.least_squares.extras import package
from thermid.fit.least_squares.population import Population
from thermid.fit.least_squares.solve import Fit, minimise
from thermid.fit.problem.residuals import Problem

Array = NDArray[np.float64]
Progress = Callable[[int, float], None]

SEARCHES = ("auto", "local", "multistart", "differential evolution", "cma")
SCREENED, DESCENTS = 64, 5
"""How many points of the box are looked at without derivatives, and from how many of the best of them least squares descends."""
APART = 0.15
"""Two starts lie apart when they differ by this part of the box in some parameter."""
TWICE = 4.0
"""Residuals of twice the stated noise, as a reduced chi-square, make one valley doubtful."""
GENERATIONS = 300


def searched(problem: Problem, how: str, loss: str, knee: float, progress: Progress | None = None) -> Fit:
    """Return the best fit that a search finds, all of its evaluations counted.

    Parameters
    ----------
    problem : Problem
    how : str               ``local``: one descent from the start. ``multistart``: further descents from the best of 64 points of the box.
                            ``auto``: these only where the first descent ends at a bound, unfinished, or with residuals of more than twice
                            the stated noise. ``differential evolution`` and ``cma``: a population over the box, then one descent.
    loss, knee, progress    As in `minimise`.

    Raises
    ------
    IdentificationError     When there is no such search.
    SolverError             When the model cannot be run at the start.
    """
    if how not in SEARCHES:
        raise IdentificationError(f"there is no search '{how}'; there are {', '.join(SEARCHES)}.{nearest(how, SEARCHES)}")
    population = Population.of(problem, loss, knee)
    if not population.at.size or how == "local":
        return minimise(problem, loss, knee, progress=progress)
    if how in ("differential evolution", "cma"):
        found = evolved(population, how)
        end = minimise(problem, loss, knee, population.placed(found.share[None, :])[0], progress)
        words = f"{how}: {found.evaluations} members, cost {found.cost:.6g}; polished by {end.evaluations} evaluations to {end.cost:.6g}"
        return replace(end, evaluations=end.evaluations + found.evaluations, search=words)
    first = minimise(problem, loss, knee, progress=progress)
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
    return found.chi_square / max(problem.worth - len(problem.unknowns), 1)


def _errors(problem: Problem, found: Fit) -> Array:
    """Return the standard errors (unknowns,) in the fitted form, widened by residuals that exceed the noise."""
    rows = np.concatenate([found.jacobian / np.sqrt(max(1.0, _level(problem, found))), found.priors])
    # rounding may leave a variance of nothing just below zero
    return np.asarray(np.sqrt(np.maximum(np.diag(np.linalg.pinv(rows.T @ rows)), 0.0)))


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
            ends.append(minimise(problem, population.loss, population.knee, population.placed(shares[k : k + 1])[0], progress))
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
            f"other values fit as well: '{u.name}' could also be {there / here:.3g} times what is reported. "
            "Give it a prior or tighter bounds."
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
    cma = package("cma", "covariance matrix adaptation", "search")
    size = population.at.size
    if size == 1:
        raise IdentificationError("covariance matrix adaptation needs two parameters or more. Use search = 'multistart'.")
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
