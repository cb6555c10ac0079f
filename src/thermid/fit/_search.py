"""Beyond one descent: whether its end may be the wrong valley, what further starts cost, and the best of them.

In: a `Problem`, a loss, a way of searching. Out: the best `Fit`, all evaluations counted, and in words what was looked at.
Several starts and differential evolution look at members run side by side; least squares always ends it. Powers that switch on a second
clock make many valleys, so that its offset and rate are looked for on a grid first.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from itertools import islice, product
from operator import itemgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thermid.base.errors import IdentificationError, ScenarioError, SolverError, foretell, refuse_unknown, spoken
from thermid.base.linear_algebra import NOTHING, pseudo_inverse
from thermid.base.units import Array, counted, format_value
from thermid.fit._minimisation import MOST_EVALUATIONS, Fit, minimise
from thermid.fit._problem.experiment import OFFSET, SCALE, Experiment
from thermid.fit._problem.residuals import Problem, Unknown, clock_at, loss_of, starting_point
from thermid.fit._uncertainty.noise import autocorrelation
from thermid.model.tree import TableSignal
from thermid.simulation.runs import Ensemble, Workers, in_tasks

Progress = Callable[[int, float], None]

DECADE = math.log(10.0)
SEARCHES = ("auto", "local", "multistart", "differential evolution")
SCREENED, DESCENTS = 64, 5
"""How many points of the box are looked at without derivatives, and from how many of the best of them least squares descends."""
MIN_START_DISTANCE = 0.15
"""Two starts lie apart when they differ by this part of the box in some parameter."""
TWICE = 4.0
"""Residuals of twice the stated noise, as a reduced chi-square, make one valley doubtful."""
CHANCE, MIN_READINGS_OF_TRACE = 0.01, 16
"""Chance that noise alone makes a trace look as if it contradicted its noise, over all traces; shorter traces are not asked."""
PROVED = 9.0
"""Gain in chi-square, in independent samples, from which another valley is better than that of the given start: three standard errors."""
GENERATIONS = 300
BATCH = 16
"""Members that run at once; the interrupt key acts between batches."""
UNASKED = 6e8
"""What further descents may take that nobody asked for, in temperatures and derivatives of integrator steps: some minute of a processor,
whichever computes."""
USUAL = 12
"""Evaluations of a descent, as most need. Further ones that nobody asked for end after so many in each of their two parts, and the best
goes on: in twelve chains whose deck lacks something, and in a drive whose deck lacks a path, whole ones gained nothing."""


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
    def of_problem(cls, problem: Problem, loss: str, loss_scale: float) -> Population:
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
        """Return where values of all unknowns (unknowns,), fitted form, lie in the unit cube (parameters,). [-]"""
        return np.asarray(np.clip((fitted[self.at] - self.low) / (self.high - self.low), 0.0, 1.0))

    def costs(self, shares: Array) -> Array:
        """Return half the sum of losses of weighted residuals and of squared priors (members,) [-]; infinite where a run fails.

        Parameters
        ----------
        shares : array (members, parameters)    Points of the unit cube, as of `placed`. [-]
        """
        points = self.placed(shares)
        cost = np.array([float(r @ r) for r in (self.problem.prior_rows(p)[0] for p in points)])
        for i, bench in enumerate(self.problem.benches()):
            observations = bench.experiment.observations
            inputs = np.array([self.problem.inputs(i, p)[0] for p in points])
            draws = dict(zip(bench.free, inputs.T, strict=True))
            nodes = list(dict.fromkeys(o.node for o in observations))
            (times, rows), options = bench.read_at(bench.experiment.times), self.problem.options
            members = Ensemble.of_members(bench.engine, draws, times, options, nodes, None, 1, "auto", ())
            for k, o in enumerate(observations):
                at = rows[o.index, k] if rows.size else o.index
                bias, _ = self.problem._bias(o.sensor, points[0])
                residuals = (o.measured[:, None] - members.temperatures(o.node)[at] - bias) / o.sigma(self.problem.noise)
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


def searched(
    problem: Problem,
    how: str,
    loss: str,
    loss_scale: float,
    progress: Progress | None = None,
    stoppable: bool = False,
    executor: Workers = None,
) -> Fit:
    """Return the best fit that a search finds, all of its evaluations counted.

    Parameters
    ----------
    problem : Problem
    how : str               ``local``: one descent from the start. ``multistart``: further descents from the best of 64 points of the box.
                            ``auto``: these only where the first descent ends unfinished, with residuals of more than twice the stated
                            noise, or at a bound without a noise or beside it; one further descent, from the other side of the start, for
                            another end at a bound, or where residuals contradict the stated noise at all. ``differential evolution``: a
                            population over the box, then one descent.
    loss, loss_scale, progress    As in `minimise`. What further starts will cost is told before they are made: to ``progress.ahead(words,
                            seconds)`` where there is one, else as a warning, see `foretell`.
    stoppable : bool        Whether the interrupt key ends it with the best fit so far: `Fit.stopped`, not converged.
    executor : see `Workers`    Who makes the descents from several starts; one process for few seconds.

    Raises
    ------
    IdentificationError     When there is no such search.
    SolverError             When the model cannot be run at the start.
    """
    refuse_unknown([how], SEARCHES, "", "unknown search '{}'. Use one of {known}.", IdentificationError)
    search = Search(Population.of_problem(problem, loss, loss_scale), progress, stoppable, executor)
    if not search.population.at.size or how == "local":
        return search.descent(None)
    if how == "differential evolution":
        return search.evolved()
    first = search.descent(None)
    if first.stopped:
        return first
    if how == "multistart":
        return search.descents([first], "as asked", DESCENTS)
    why, beside = doubts(problem, first), contradictions(problem, first)
    bound = at_bound(problem, first) if first.converged else ""
    if why or (bound and (beside or not _noise_is_stated(problem))):
        return search.affordable(first, ", and ".join(x for x in (bound, why) if x))
    # where all readings are met within their noise, a value ends at its bound by noise alone: one descent settles it
    return search.confirmed(first, bound or beside) if bound or beside else first


def doubts(problem: Problem, minimum: Fit) -> str:
    """Return why one descent may have ended in the wrong valley, or an empty text."""
    if not minimum.converged or not _noise_is_stated(problem) or (times := _level(problem, minimum)) <= TWICE:
        return "" if minimum.converged else "the first search did not converge"
    noise = {(e.record.name, o.sensor): o.sigma(problem.noise) for e in problem.experiments for o in e.observations}
    record, sensor, sums = max(minimum.sums, key=lambda of: of[2].mean_square / noise[of[:2]] ** 2)
    return (
        f"the residuals are {math.sqrt(times):.2g} times the stated noise, most at '{sensor}' in {record} "
        f"({math.sqrt(sums.mean_square):.2g} K RMS)"
    )


def at_bound(problem: Problem, minimum: Fit) -> str:
    """Return which value ended at its bound, or an empty text."""
    error = _errors(problem, minimum)
    for k, u in enumerate(problem.unknowns):
        if u.kind == "parameter" and u.bounds_met(float(minimum.fitted[k]), float(error[k])):
            return f"'{u.name}' ended at its bound{'' if _noise_is_stated(problem) else ', and no noise is stated'}"
    return ""


def _noise_is_stated(problem: Problem) -> bool:
    """Return whether every sensor states its noise."""
    return all(o.noise is not None for o in problem.observations())


def contradictions(problem: Problem, minimum: Fit) -> str:
    """Return which trace contradicts its stated noise at the end of a descent, or an empty text.

    Where values are right and nothing is missing, the mean of a trace of n residuals, in units of the noise, lies within a few 1/sqrt(n) of
    zero, and so does the product of neighbours. The sums of a descent hold both. A valley that is not the right one can meet readings
    within 1.05 times their noise, but its traces lie beside zero by many of these. Where all are short, nothing is.
    """
    at = dict(zip((e.record.name for e in problem.experiments), problem.experiments, strict=True))
    worst, where, count = 0.0, "", 0
    for record, sensor, sums in minimum.sums:
        observation = next(o for o in at[record].observations if o.sensor == sensor)
        if observation.noise is None:
            return ""
        if sums.count < MIN_READINGS_OF_TRACE:
            continue
        statistics, sigma = sums.statistics(0.0), observation.sigma(problem.noise)
        for size in (abs(statistics.mean) / sigma, abs(statistics.lag_one)):
            count += 1
            if size * math.sqrt(sums.count) > worst:
                worst, where = size * math.sqrt(sums.count), f"'{sensor}' in {record}"
    beyond = math.erfc(worst / math.sqrt(2.0)) * count
    return f"residuals of {where} are not noise" if where and beyond < CHANCE else ""


def preferred(population: Population, first: Fit, others: list[Fit]) -> Fit:
    """Return the cheapest end that is proved to be better than that from the given start, else the latter.

    Autocorrelated residuals at the cheaper end are worth fewer samples, see `autocorrelation`, and those above the noise less by its
    square: a gain in chi-square, so weighed, of less than `PROVED` says nothing. Among values that fit as well those that the given start
    leads to stand, and an end that did not converge does not replace one that did.
    """
    best = min((f for f in others if f.converged or not first.converged), key=lambda f: f.cost, default=first)
    if best.cost >= first.cost:
        return first
    traces = autocorrelation(population.problem, best, population.loss, population.loss_scale).traces
    share = sum(t.effective_samples for t in traces) / max(sum(t.samples for t in traces), 1)
    return best if 2.0 * (first.cost - best.cost) * share > PROVED * max(1.0, _level(population.problem, best)) else first


def _level(problem: Problem, minimum: Fit) -> float:
    """Return the weighted sum of squares per degree of freedom. [-]"""
    return minimum.chi_square / max(problem.freedom, 1.0)


def _errors(problem: Problem, minimum: Fit) -> Array:
    """Return the standard errors (unknowns,), fitted form, widened by the root of chi^2 per degree of freedom where that is above 1."""
    rows = np.concatenate([minimum.jacobian / np.sqrt(max(1.0, _level(problem, minimum))), minimum.priors])
    return np.asarray(np.sqrt(np.diag(pseudo_inverse(rows, NOTHING))))


@dataclass(frozen=True, eq=False)
class Search:
    """Descents of one problem from several starts, what they cost, and the best of them.

    Parameters
    ----------
    population : Population
    progress : callable         As in `minimise`; with a method ``ahead(words, seconds)`` it is told what follows.
    stoppable : bool            Whether the interrupt key ends it with the best fit so far.
    executor : see `Workers`
    spent : list of float       What each descent took, to say what is ahead. [s]
    """

    population: Population
    progress: Progress | None
    stoppable: bool
    executor: Workers = None
    spent: list[float] = field(default_factory=list)

    def descent(self, start: Array | None, rounds: int = MOST_EVALUATIONS) -> Fit:
        """Return the end of one descent from `start` (unknowns,), fitted form, and note its time [s] in `spent`.

        Without a start, from the problem's own. `rounds` evaluations at most in each of its two parts, the first to a relative change of
        the cost of 1e-3, the second to the end (`minimise`).
        """
        p, begun = self.population, time.perf_counter()

        def priced(count: int, rms: float) -> None:
            """Report how long a descent will take, once its first evaluation was timed; then every evaluation."""
            if count == 1 and not self.spent:
                one = time.perf_counter() - begun
                self.tell(f"a search of some {USUAL} evaluations", (USUAL - 1) * one, loud=False)
            if self.progress is not None:
                self.progress(count, rms)

        end = minimise(p.problem, p.loss, p.loss_scale, start, priced, rounds=rounds, stoppable=self.stoppable)
        self.spent.append(time.perf_counter() - begun)
        return end

    def tell(self, words: str, seconds: float, loud: bool = True) -> None:
        """Say what follows and what it takes [s], before it begins."""
        ahead = getattr(self.progress, "ahead", None)
        words += (
            f", about {spoken(seconds)}. The interrupt key ends it {'with the best values so far' if self.stoppable else 'without values'}."
        )
        if ahead is not None:
            ahead(words, seconds)
        elif loud:
            foretell(f"a fit goes on with {words}", seconds)

    def affordable(self, first: Fit, why: str) -> Fit:
        """Return the best of as many descents as an automatic search makes; a first one that took long is said to stand alone."""
        many = min(DESCENTS, self._further(first))
        best = self.descents([first], why, many, USUAL) if many else first
        if many == DESCENTS or best.stopped:
            return best
        words = (
            f"{why}, so the search may have ended in a local minimum. One takes {USUAL} evaluations or "
            f"twice as many, so only {many} of {DESCENTS} were made unasked. search = 'multistart' makes all."
        )
        return replace(best, remarks=(*best.remarks, words))

    def _further(self, first: Fit) -> int:
        """Return how many descents may be made unasked; no clock is asked, so that answers are the same everywhere."""
        problem = self.population.problem
        meshes = problem.compressed(first.fitted, self.population.loss, self.population.loss_scale).meshes
        steps = sum(len(e.network.nodes) * (m.size or e.times.size) for e, m in zip(problem.experiments, meshes, strict=True))
        return int(UNASKED / (USUAL * steps * (1 + len(problem.unknowns))))

    def confirmed(self, first: Fit, why: str) -> Fit:
        """Return the better of a descent and one from the other side of its start; the best of several where these two differ.

        The other start is the mirror of the end at the start, in the unit cube at least `MIN_START_DISTANCE` away; to differ is to be more
        than half a standard error apart in some value. `why` is the reason, in words.
        """
        population = self.population
        if not self._further(first):
            return self.affordable(first, why)
        start, end = population.share(population.start), population.share(first.fitted)
        way = end - start
        if not way.any():
            return first
        opposite = np.clip(start - way * max(1.0, MIN_START_DISTANCE / float(np.abs(way).max())), 0.0, 1.0)
        self.tell(f"a second search from the other side of the start, because {why}", self.spent[0])
        second = self.descent(population.placed(opposite[None, :])[0])
        best = preferred(population, first, [second])
        total = first.evaluations + second.evaluations
        if second.stopped:
            return _stopped(first, [first, second], total)
        # whether two descents ended at the same values, within half a standard error of the better one
        error = _errors(population.problem, min((first, second), key=lambda f: f.cost))
        if (np.abs(first.fitted - second.fitted) <= 0.5 * np.where(error > 0.0, error, np.inf)).all():
            return replace(
                first, evaluations=total, search=f"{why}: a second search, from the other side of the start, ended at the same values"
            )
        if contradictions(population.problem, best):
            return self.descents([first, second], why, DESCENTS - 1, USUAL, proved=True)
        words, remarks = _valleys(population.problem, best, [first, second], first)
        return replace(best, evaluations=total, search=f"{why}: {words}", remarks=(*best.remarks, *remarks))

    def descents(self, ends: list[Fit], why: str, many: int, rounds: int = MOST_EVALUATIONS, proved: bool = False) -> Fit:
        """Return the best of the descents so far and of so many more, from the best points of the box; see `preferred` for `proved`.

        Those of few `rounds` that have not ended by then are left, but the best of all.
        """
        population, first = self.population, ends[0]
        count = sum(end.evaluations for end in ends)
        ends, taken = [*ends], [population.share(population.start), *(population.share(end.fitted) for end in ends)]
        wanted = len(ends) + many
        try:
            shares, costs = self._screened(why, many)
            count += costs.size
            ranked = iter(shares[np.argsort(costs)[: int(np.isfinite(costs).sum())]])
            while len(ends) < wanted and (starts := list(islice(_apart(ranked, taken), wanted - len(ends)))):
                for end in self.from_all(population.placed(np.array(starts)), rounds):
                    ends.append(end)
                    count += end.evaluations
                    if end.stopped:
                        return _stopped(first, ends, count)
            whole = [first]
            while True:
                best = preferred(population, first, ends) if proved else min(ends, key=lambda f: (round(f.cost, 6), f is not first))
                if rounds == MOST_EVALUATIONS or best.converged or any(best is end for end in whole):
                    break
                whole.append(self.descent(best.fitted))
                count += whole[-1].evaluations
                ends[next(k for k, end in enumerate(ends) if end is best)] = whole[-1]
        except KeyboardInterrupt:
            if not self.stoppable:
                raise
            return _stopped(first, ends, count)
        words, remarks = _valleys(population.problem, best, ends, first)
        return replace(
            best, evaluations=count, search=f"multistart, {why}: {costs.size} points, {words}", remarks=(*best.remarks, *remarks)
        )

    def from_all(self, starts: Array, rounds: int) -> Iterator[Fit]:
        """Yield the ends of descents from starts (starts, unknowns), fitted form, in their order; none where the model cannot be run.

        The executor's workers share them; the time announced is that of the descents in `spent`, of which one at least must be. `rounds` as
        of `descent`.
        """
        alone = self.executor is None
        worker = self if alone else replace(self, progress=None, stoppable=False, executor=None, spent=[])
        tasks = [(f"the search from start {k + 1}", (worker, start, rounds)) for k, start in enumerate(starts)]
        numbered_ends = in_tasks(_end_of, tasks, self.executor, seconds=len(tasks) * float(np.mean(self.spent)))
        for _, end in numbered_ends if alone else sorted(numbered_ends, key=itemgetter(0)):
            if end is not None:
                yield end

    def _screened(self, why: str, many: int) -> tuple[Array, Array]:
        """Return points of the unit cube (`SCREENED`, parameters), a scrambled Sobol sequence, and their costs (`SCREENED`,). [-]

        `why` in words; `many` is the number of descents that the announced time includes.
        """
        from scipy.stats import qmc

        begun = time.perf_counter()
        # points of the unit cube (SCREENED, parameters), spread evenly (Sobol, scrambled)
        shares = np.asarray(qmc.Sobol(self.population.at.size, rng=np.random.default_rng(1)).random(SCREENED))
        costs = [self.population.costs(shares[:BATCH])]
        seconds = (time.perf_counter() - begun) * (SCREENED / BATCH - 1.0) + many * float(np.mean(self.spent))
        lacks = ". Where the deck lacks a part or a path further starts rarely help: `thermid criticise` looks for it" * (
            "noise, most" in why
        )
        self.tell(f"up to {counted(many, 'further start')}, the best of {SCREENED} points ({why}){lacks}", seconds)
        costs += [self.population.costs(shares[at : at + BATCH]) for at in range(BATCH, SCREENED, BATCH)]
        return shares, np.concatenate(costs)

    def evolved(self) -> Fit:
        """Return the end of the descent from the best member of a population that evolved over the box."""
        p, best = self.population, evolved(self.population, self.stoppable)
        at = p.placed(best.share[None, :])[0]
        if best.stopped:
            message = f"stopped by the user after {best.evaluations} members, at the best of them"
            return replace(Fit.ended(p.problem, at, p.loss, p.loss_scale, best.evaluations, message, False), stopped=True)
        end = self.descent(at)
        words = (
            f"differential evolution: {best.evaluations} members, cost {best.cost:.6g}; polished by {end.evaluations} evaluations to "
            f"{end.cost:.6g}"
        )
        return replace(end, evaluations=end.evaluations + best.evaluations, search=words)


def _stopped(first: Fit, ends: list[Fit], count: int) -> Fit:
    """Return the best end so far of a search that the interrupt key ended."""
    best = min(ends, key=lambda f: (round(f.cost, 6), f is not first))
    whole = sum(not end.stopped for end in ends)
    message = f"stopped by the user after {counted(whole, 'start')}, at the best values so far"
    return replace(best, evaluations=count, message=message, converged=False, stopped=True, search="")


def _end_of(search: Search, start: Array, rounds: int) -> Fit | None:
    """Return the end of a descent, None where the model cannot be run at its start."""
    try:
        return search.descent(start, rounds)
    except SolverError:
        return None


def _apart(ranked: Iterator[Array], taken: list[Array]) -> Iterator[Array]:
    """Yield points (parameters,) of the unit cube that lie `MIN_START_DISTANCE` apart from all that were taken, and take them.

    Apart in one parameter at least. `ranked` are the points (parameters,), the best first.
    """
    for share in ranked:
        if min(np.abs(share - t).max() for t in taken) >= MIN_START_DISTANCE:
            taken.append(share)
            yield share


def _valleys(problem: Problem, best: Fit, ends: list[Fit], first: Fit) -> tuple[str, tuple[str, ...]]:
    """Return what the ends of all descents show: in words, and a remark on each other set of values that fits as well.

    The same are ends within half a standard error in every parameter; as well means a cost within 2 times the level of the residuals.
    """
    error = _errors(problem, best)
    # starts, offsets and what has no error, at a bound, do not separate ends
    error = np.where((error > 0.0) & np.array([u.kind == "parameter" for u in problem.unknowns]), error, np.inf)
    same = [bool((np.abs(f.fitted - best.fitted) <= 0.5 * error).all()) for f in ends]
    words = f"{len(ends)} searches, {sum(same)} of which ended at the same values"
    others = [f for f, s in zip(ends, same, strict=True) if not s]
    if others:
        least = min(f.cost for f in others) / best.cost
        words += f"; the next best costs {least:.4g} times as much"
        words += "" if least >= 1.0 else ", which is no proof that they are better, because the residuals are autocorrelated"
    if first.cost > best.cost * (1 + 1e-6) and not same[ends.index(first)]:
        words += f"; the search from the given start ended at {first.cost / best.cost:.4g} times the best cost"
    remarks = []
    for other in (f for f in others if f.cost - best.cost < 2.0 * max(1.0, _level(problem, best))):
        k = int(np.argmax(np.abs(other.fitted - best.fitted) / error))
        u = problem.unknowns[k]
        there = format_value(u.to_value(float(other.fitted[k])), u.unit, 3)
        remarks.append(f"other values fit equally well: '{u.name}' could also be {there}. Give it a prior or tighter bounds.")
    return words, tuple(dict.fromkeys(remarks))


@dataclass(frozen=True, eq=False)
class Evolved:
    """The end of a population: the best point of the unit cube (parameters,), its cost, how many members ran, whether it was stopped."""

    share: Array
    cost: float
    evaluations: int
    stopped: bool


def evolved(population: Population, stoppable: bool = False) -> Evolved:
    """Return the best member of a population that evolved over the box.

    Differential evolution: Storn and Price, J. Global Optim. 11 (1997) 341, in scipy. Where it is `stoppable`, the interrupt key ends it
    with the best member so far.
    """
    from scipy.optimize import Bounds, differential_evolution

    best, cost, count, stopped = np.zeros(0), np.inf, 0, False

    def costs(points: Array, /) -> Any:  # one cost per member, which the stubs of scipy do not know of
        """Return the cost of each member of a generation, and note the best so far."""
        nonlocal best, cost, count
        shares = np.atleast_2d(points.T)
        of_members = population.costs(shares)
        of_members = np.where(np.isfinite(of_members), of_members, 1e30)
        count += of_members.size
        k = int(of_members.argmin())
        if of_members[k] < cost:
            best, cost = shares[k].copy(), float(of_members[k])
        return of_members

    try:
        differential_evolution(
            costs,
            Bounds(np.zeros(population.at.size), np.ones(population.at.size)),
            vectorized=True,
            updating="deferred",
            polish=False,
            init="sobol",
            tol=1e-4,
            atol=1e-3,
            maxiter=GENERATIONS,
            rng=np.random.default_rng(1),
            x0=population.share(population.start),
        )
    except KeyboardInterrupt:
        if not stoppable or not count:
            raise
        stopped = True
    return Evolved(best, cost, count, stopped)


GRID_OFFSETS, GRID_RATES, GRID_ROUNDS = 25, 5, 5
"""Offsets and rates of a second clock that are tried, and rounds of trying and fitting at most. [-]"""


def with_clocks(problem: Problem, loss: str, loss_scale: float, fitted: Array | None = None) -> Problem:
    """Return a problem whose second clocks start where a grid over their ranges fits best, all other unknowns as they are.

    Raises
    ------
    IdentificationError   When the model runs at no offset.
    """
    at = starting_point(problem.unknowns) if fitted is None else fitted.copy()
    for i, number in ((i, number) for i, e in enumerate(problem.experiments) for number in range(len(e.ticks))):
        experiment = problem.experiments[i]
        costs = [(_cost(problem, i, there, loss, loss_scale), there) for there in _grid(problem, i, at, number)]
        if fitted is not None:
            costs.append((_cost(problem, i, at, loss, loss_scale), at))
        cost, at = min(costs, key=lambda pair: pair[0])
        if not np.isfinite(cost):
            raise IdentificationError(
                "the model fails at every offset of the second clock in the given range. Widen the range of offsets.",
                f"record '{experiment.record.name}'",
                code="fit.model-fails",
            )
    return at_clocks(problem, at)


def in_turns(
    problem: Problem, minimum: Fit, loss: str, loss_scale: float, progress: Callable[[int, float], None] | None
) -> tuple[Problem, Fit]:
    """Return the problem and the end of its fit after the grid was looked at again with the fitted values, as long as that gains."""
    for _ in range(GRID_ROUNDS):
        moved = with_clocks(problem, loss, loss_scale, minimum.fitted)
        at = minimum.fitted.copy()
        for i in range(len(problem.experiments)):
            for k, _, _ in moved.ticking(i):
                at[k] = moved.unknowns[k].start
        if np.array_equal(at, minimum.fitted):
            return problem, minimum
        again = minimise(moved, loss, loss_scale, at, progress)
        again = replace(again, evaluations=minimum.evaluations + again.evaluations, search=minimum.search, remarks=minimum.remarks)
        if again.cost >= minimum.cost:
            return problem, minimum
        problem, minimum = moved, again
    return problem, minimum


def at_clocks(problem: Problem, fitted: Array) -> Problem:
    """Return a problem whose experiments hold their second clocks where the unknowns put them."""
    experiments, unknowns = list(problem.experiments), list(problem.unknowns)
    for i, experiment in enumerate(problem.experiments):
        if experiment.ticks:
            experiments[i] = experiment.on_clocks(*[clock_at(problem, i, fitted)] * 2)
            for k, _, _ in problem.ticking(i):
                unknowns[k] = replace(unknowns[k], start=float(fitted[k]))
    return replace(problem, experiments=tuple(experiments), unknowns=tuple(unknowns))


CHANGED = 3.5
"""Standard deviations of the difference of two samples of a power from which it changed, and was not only noise. [-]"""


MAX_ERROR_GROWTH = 1e3
"""Most times that an error grows: without a true change of the power nothing is known of its clock. [-]"""


def widened_by_noise_of_powers(problem: Problem, fitted: Array) -> Array:
    """Return how many times larger errors of the unknowns (unknowns,) are because noise of sampled powers adds to derivatives by clocks.

    A shift moves the noise of a meter with its power. The derivatives of readings by an offset then hold two parts, of true changes and of
    noise, J = J_0 + N, and J'J counts N'N as information. It is none: about the best offset the sum of squares curves by J_0'J_0 alone,
    because residuals answer to the same noise (errors in variables: Fuller, Measurement Error Models, 1987, 1.1). With the covariance of
    J'r as it is, errors grow by J'J / J_0'J_0, each beside what the other unknowns explain, at most `MAX_ERROR_GROWTH` times. J_0 is that
    of a power that stays at its mean between its true changes. `fitted` (unknowns,) is in the fitted form.
    """
    out = np.ones(len(problem.unknowns))
    for i, e in enumerate(problem.experiments):
        calm = _calm(e)
        ticking = [k for k, _, _ in problem.ticking(i)]
        if calm is None or not ticking:
            continue
        quiet = replace(problem, experiments=tuple(calm if j == i else other for j, other in enumerate(problem.experiments)))
        full, true = (p.slopes(i, fitted).reshape(-1, out.size) for p in (problem, quiet))
        others, _ = np.linalg.qr(full[:, [k for k, u in enumerate(problem.unknowns) if k not in ticking and not u.is_instant]])
        for k in ticking:
            sizes = [float(np.sum((c - others @ (others.T @ c)) ** 2)) for c in (full[:, k], true[:, k])]
            out[k] = min(max(sizes[0] / max(sizes[1], 1e-300), 1.0), MAX_ERROR_GROWTH)
    return out


def _calm(experiment: Experiment) -> Experiment | None:
    """Return an experiment whose sampled powers on a second clock stay at their means between true changes; None where none has noise."""
    tables: dict[str, dict[str, Any]] = {}
    for name, path in (of for ticks in experiment.ticks for of in ticks.driven):
        table = getattr(experiment.scenario, name)[path]
        noise = experiment.noisy.get(SCALE + path)
        if noise is None or not noise.white > 0.0 or not isinstance(table, TableSignal):
            continue
        calm = table.levelled(CHANGED * math.sqrt(2.0) * noise.white)
        tables.setdefault(name, dict(getattr(experiment.scenario, name)))[path] = calm
    return replace(experiment, scenario=experiment.scenario.with_(**tables)) if tables else None


def _grid(problem: Problem, i: int, fitted: Array, number: int) -> Iterator[Array]:
    """Yield values of all unknowns (unknowns,), fitted form, with the clock `number` of record `i` on a grid, the others as in `fitted`.

    `GRID_OFFSETS` offsets [s] from end to end of their range, `GRID_RATES` rates [-] in the middles of equal parts of theirs; one where a
    range is a point.
    """
    clock = problem.experiments[i].ticks[number].clock
    (first, last), (slowest, fastest) = clock.offset, clock.rate
    offsets = np.linspace(first, last, GRID_OFFSETS if first < last else 1)
    rates = slowest + (fastest - slowest) * (np.arange(GRID_RATES if slowest < fastest else 1) + 0.5) / GRID_RATES
    for offset, rate in product(offsets, rates):
        point = fitted.copy()
        for k, of, place in problem.ticking(i):
            if of == number:
                point[k] = offset if place == OFFSET else rate
        yield point


def _cost(problem: Problem, i: int, fitted: Array, loss: str, loss_scale: float) -> float:
    """Return the loss sum c^2 rho(z^2 / c^2) of one record's residuals at `fitted` (unknowns,), c the `loss_scale`. [-]

    z is in units of the noise; infinite where the record cannot be run.
    """
    try:
        z = np.concatenate([b.weighted for b in problem.blocks_of(i, fitted)])
    except (ScenarioError, SolverError):
        return float("inf")
    return float(loss_of(z**2, loss, loss_scale)[0].sum())
