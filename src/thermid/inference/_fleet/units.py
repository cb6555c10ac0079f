"""`fleet`: what the logs of each unit say at its conditional mode, the population of that, and so on until neither moves.

The mode of a unit is its fit with the population as prior (Lindstrom and Bates, Biometrics 46 (1990) 673). There its residuals are made
linear, values of single records and constant errors of sensors are integrated out, and noise counts as in the errors of any fit: what
wanders widens the score J'r from B to M, and the quadratic is that of Godambe's information, ``B M^-1 B`` with the score ``B M^-1 g``.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from operator import itemgetter
from typing import Any

import numpy as np

from thermid.base.errors import IdentificationError, quoted
from thermid.base.linear_algebra import inverse_square_root, one_thread, square_root, symmetric_inverse
from thermid.base.units import HOUR, Array, Bools, counted
from thermid.fit.calibration import (
    FIRST,
    KeptFit,
    Problem,
    Request,
    Sums,
    Unknown,
    autocorrelation,
    build_problem,
    fit_problem,
    minimise,
    requested,
)
from thermid.inference._fleet.fleet import CovariateDesign, Covariates, Effect, Fleet, OddUnit, PopulationValue, SharedVariation
from thermid.inference._fleet.population import (
    ZERO_SPREAD_RISE,
    PopulationFit,
    Summaries,
    interval_of_correlation,
    interval_of_mean,
    interval_of_spread,
    odd_units,
    weigh,
)
from thermid.measure.records import Record
from thermid.model.tree import Model, Standing
from thermid.simulation.runs import Scenario, Workers, in_tasks
from thermid.values.store import RANGE_OF

LINEARISATIONS = 12
"""Linearisations at most."""
MEANS_MOVE = 0.02
"""Move of the means, in standard errors, and of spreads, relative, below which the linearisation is the last."""
LEAST_PRIOR_SPREAD = 1e-3
"""Spread that a prior of a unit has at least, in typical changes of a value: one that is zero would stop a descent."""
FEWEST_UNITS = 3
"""Units per number of Omega from which correlations are estimated."""
LEAST_MEAN_INFORMATION = 1e-8
"""Information about a combination of means, beside the largest, below which no log of the fleet tells it."""

FIRST_PRIOR_SD = 1.0
"""Standard deviation of the first prior, in typical changes of a value: before there is a population."""


@dataclass(frozen=True, eq=False)
class FleetUnit:
    """One unit of a fleet: its fit problem and which of its unknowns the fleet has.

    Parameters
    ----------
    name : str
    request : Request   Without priors of the values of the fleet.
    problem : Problem   Its residuals, without these priors either.
    values : tuple      Positions of these among the unknowns.
    remarks : tuple of str
    """

    name: str
    request: Request
    problem: Problem
    values: tuple[int, ...]
    remarks: tuple[str, ...] = ()

    @classmethod
    def from_request(cls, name: str, request: Request) -> FleetUnit:
        """Return the unit of a request; priors of its free parameters are left out, since the fleet gives them.

        Raises
        ------
        IdentificationError   When nothing is free, or a second clock is.
        """
        problem = build_problem(request)
        values = tuple(k for k, u in enumerate(problem.unknowns) if u.kind == "parameter")
        if not values:
            raise IdentificationError(
                "no parameter is free. Name those that differ between units in `free`.", name, code="fleet.nothing-free"
            )
        if problem.clocked:
            raise IdentificationError(
                "a record has a second clock, whose offset and rate are looked for. Give them.",
                name,
                code="fleet.second-clock",
            )
        dropped = [problem.unknowns[k].name for k in values if problem.unknowns[k].prior is not None]
        remarks = [f"priors of {', '.join(dropped)} were left out: the fleet gives them"] if dropped else []
        if problem.coupled:
            remarks.append("priors from stages below were left out: the fleet gives them")
        unknowns = tuple(replace(u, prior=None) if u.kind == "parameter" else u for u in problem.unknowns)
        alone = replace(request, priors={}, prior=())
        return cls(name, alone, replace(problem, unknowns=unknowns, coupled=()), values, tuple(remarks))

    @property
    def unknowns(self) -> list[Unknown]:
        """The values of the fleet."""
        return [self.problem.unknowns[k] for k in self.values]

    @property
    def seconds(self) -> float:
        """Total duration of its records. [s]"""
        return sum(float(np.ptp(e.times)) for e in self.problem.experiments)

    @property
    def unstated(self) -> set[str]:
        """Sensors whose noise is not stated."""
        return {o.sensor for o in self.problem.observations() if o.noise is None}

    def beside(self, mean: Array, root: Array, noise: Mapping[str, float]) -> Problem:
        """Return its residuals with a population as prior; see `read_unit`."""
        at = np.array(self.values, dtype=np.int64)
        return replace(self.problem, noise={**self.problem.noise, **noise}, coupled=((at, mean, root),))


@dataclass(frozen=True, eq=False)
class UnitSummary:
    """Marginal likelihood of one unit about its conditional mode, as a quadratic in the values of the fleet.

    Parameters
    ----------
    at : array (unknowns,)                      The mode, in the fitted form.
    information : array (values, values)        Minus the second derivative of the log-likelihood, other unknowns marginalised.
    score : array (values,)                     Derivative of its log-likelihood there.
    chi_square, freedom : float                 Of its readings, in units of their noise.
    white : bool                                Whether no residual is autocorrelated.
    sums : tuple                                Record, sensor, sums of residuals.
    converged : bool
    """

    at: Array
    information: Array
    score: Array
    chi_square: float
    freedom: float
    white: bool
    sums: tuple[tuple[str, str, Sums], ...]
    converged: bool


def read_unit(unit: FleetUnit, start: Array | None, mean: Array, root: Array, noise: dict[str, float], level: float) -> UnitSummary:
    """Return the marginal likelihood of a unit about its mode, with the population as prior.

    Parameters
    ----------
    start : array (unknowns,)           Where to begin, in the fitted form.
    mean, root : array                  Of the population (values,), and a root R of its information, ``R'R = Omega^-1``.
    noise : dict                        Sensor -> noise where none is stated. [K]
    level : float                       Variance of readings that do not wander, in squares of their noise, over the fleet.
    """
    at = np.array(unit.values, dtype=np.int64)
    problem = unit.beside(mean, root, noise)
    bare, loss, knee = replace(problem, coupled=()), unit.request.loss, unit.request.loss_scale
    end = minimise(problem, loss, knee, start)
    here = bare.compressed(end.fitted, loss, knee)
    spread = autocorrelation(problem, end, loss, knee)
    white = not spread.score_excess.any()
    factor = level if white else spread.variance_factor
    information, score = here.slopes.T @ here.slopes / factor, -here.slopes.T @ here.rows / factor
    whole = information + end.priors.T @ end.priors
    taken = float(np.trace(symmetric_inverse(whole) @ information))
    if not white:
        share = information @ symmetric_inverse(information + spread.score_excess / factor**2)
        information, score = share @ information, share @ score
    rows, slopes = bare.prior_rows(end.fitted)
    information, score = information + slopes.T @ slopes, score - slopes.T @ rows
    others = np.setdiff1d(np.arange(len(score)), at)
    across = information[np.ix_(at, others)] @ symmetric_inverse(information[np.ix_(others, others)])
    marginal = information[np.ix_(at, at)] - across @ information[np.ix_(others, at)]
    freedom = problem.effective_samples - taken
    # a symmetric matrix without negative directions
    sizes, vectors = np.linalg.eigh(0.5 * (marginal + marginal.T))
    return UnitSummary(
        end.fitted,
        np.asarray((vectors * np.maximum(sizes, 0.0)) @ vectors.T),
        score[at] - across @ score[others],
        here.chi_square,
        freedom,
        white,
        here.sums,
        end.converged,
    )


@dataclass(frozen=True, eq=False)
class UnitJudgement:
    """Standing and checks of the fit of one unit at its mode.

    Parameters
    ----------
    standing : Standing
    checks : tuple of str   What a reader must know first.
    exact : str             What was held and has no spread.
    shared : array (values, values)     Covariance by what all units of a design share: stated ranges, and its structure. Fitted form.
    """

    standing: Standing
    checks: tuple[str, ...]
    exact: str
    shared: Array


def judge_unit(unit: FleetUnit, at: Array, noise: dict[str, float]) -> UnitJudgement:
    """Return standing and checks of the fit of a unit at its mode `at` (unknowns,); `noise` as of `read_unit`.

    Its prior lies there and is as wide as the first: a narrow one would answer for the readings to what the unit shares with others.
    """
    sizes = np.array([FIRST_PRIOR_SD * u.scale for u in unit.unknowns])
    problem = unit.beside(at[list(unit.values)], np.diag(1.0 / sizes), noise)
    place = KeptFit({u.name: float(x) for u, x in zip(problem.unknowns, at, strict=True)}, 1)
    found = fit_problem(unit.request, problem, recalled=place)
    common = [s.name.startswith(RANGE_OF) or s.kind == "structural" for s in found.store.sources]
    rows = found.store.rows([u.name for u in unit.unknowns])[:, common]
    checks = tuple(w for w in found.warnings if w.startswith(FIRST))
    return UnitJudgement(found.standing, checks, found.exact, np.asarray(rows @ rows.T))


def fleet(
    model: Model,
    units: Mapping[str, Record | Sequence[Record]],
    free: Sequence[str],
    *,
    covariates: Mapping[str, Mapping[str, float | str]] | None = None,
    scenario: Scenario | Mapping[str, Scenario] | None = None,
    local: Mapping[str, Any] | None = None,
    loss: str = "linear",
    name: str = "",
    executor: Workers = None,
) -> Fleet:
    """Return the population of the units of one design: means, spreads, correlations, odd units, the prior of the next one.

    The values of a unit are those of its mean, which may depend on covariates, and a normal deviation, in the fitted form of each value
    (its logarithm where it cannot be negative). All logs count at once, so a unit with a short log counts for what it says.

    Parameters
    ----------
    model : Model           The design.
    units : dict            Unit -> its log or logs, as in `calibrate`.
    free : sequence of str  Paths of the values in which units differ.
    covariates : dict       Unit -> name -> number or text, for every unit.
    scenario, local, loss   As in `calibrate`, for all units; scenarios may be by record.
    name : str              Title.
    executor                As in `ensemble`: who simulates the units.

    Raises
    ------
    IdentificationError   With fewer than three units, when no log tells a mean, or a covariate is wrong.

    Notes
    -----
    Conditional linearisation (Lindstrom and Bates, Biometrics 46 (1990) 673; FOCE: Wang, J. Pharmacokinet. Pharmacodyn. 34 (2007) 575),
    restricted likelihood. Intervals are profiles on the last linearisation; those of means are Student's.
    """
    requests = {}
    for unit, logs in units.items():
        records = (logs,) if isinstance(logs, Record) else tuple(logs)
        scenarios = scenario
        if isinstance(scenario, Mapping):
            scenarios = {k: s for k, s in scenario.items() if k == "*" or k in {r.name for r in records}}
        requests[unit] = requested(model, records, free, scenario=scenarios, local=local, loss=loss, name=unit)
    return fleet_of(requests, covariates or {}, name or model.title, executor)


def fleet_of(requests: Mapping[str, Request], covariates: Covariates, title: str, executor: Workers = None) -> Fleet:
    """Return the population of units from one fit request each; result as of `fleet`.

    A linear mixed model by restricted maximum likelihood: values of a unit are normal about means that depend on the covariates, and
    each unit is linearised at its mode again until means and spreads settle. Spreads are uncorrelated where there are few units.

    Raises
    ------
    IdentificationError   As `fleet`.
    """
    if len(requests) < 3:
        raise IdentificationError(f"a fleet needs at least three units, and there are {len(requests)}.", title, code="fleet.too-small")
    with one_thread():
        units = [FleetUnit.from_request(name, request) for name, request in requests.items()]
        unknowns = tuple(units[0].unknowns)
        for unit in units[1:]:
            if [(u.name, u.log) for u in unit.unknowns] != [(u.name, u.log) for u in unknowns]:
                raise IdentificationError(f"'{unit.name}' has other free values than '{units[0].name}'.", title, code="fleet.units-differ")
        design = CovariateDesign.from_covariates([u.name for u in units], covariates, len(unknowns))
        count, numbers = len(units), len(unknowns) * (len(unknowns) + 1) // 2
        full = count >= FEWEST_UNITS * numbers or len(unknowns) == 1
        together = np.ones((len(unknowns),) * 2, dtype=bool) if full else np.eye(len(unknowns), dtype=bool)
        reference, population, answers, settled = _iterated(units, unknowns, design, together, title, executor)
        judged = _judged(units, answers, executor)
        remarks = (*checks_of(judged), *_remarks(units, together, numbers, answers, settled))
        model = next(iter(requests.values())).model
        return _summed(title, units, unknowns, design, reference, population, remarks, model, judged)


def _judged(units: Sequence[FleetUnit], answers: Sequence[UnitSummary], executor: Workers) -> dict[str, UnitJudgement]:
    """Return unit -> standing and checks of its fit."""
    noise = _noise(units, answers)
    tasks = [(f"unit '{u.name}'", (u, s.at, noise)) for u, s in zip(units, answers, strict=True)]
    judged = dict(in_tasks(judge_unit, tasks, executor))
    return {u.name: judged[k] for k, u in enumerate(units)}


def checks_of(judged: Mapping[str, UnitJudgement]) -> tuple[str, ...]:
    """Return what a reader must know first of the fits of all units: each kind of check once, with the words of the first unit."""
    kinds: dict[str, list[tuple[str, str]]] = {}
    for name, unit in judged.items():
        for text in unit.checks:
            kinds.setdefault(re.split(r"[\d']", text)[0], []).append((name, text.rstrip(".")))
    out = [f"{several[0][1]} ({counted(len(several), 'unit')} of {len(judged)}, '{several[0][0]}' shown)" for several in kinds.values()]
    return (*out, *dict.fromkeys(unit.exact for unit in judged.values() if unit.exact))


def standing_of(judged: Mapping[str, UnitJudgement]) -> Standing:
    """Return the worst standing of the fits of units, with how many have it."""
    first = Standing.worst(unit.standing for unit in judged.values())
    if first.fair:
        return first
    of_state = [name for name, unit in judged.items() if unit.standing.state == first.state]
    reason = judged[of_state[0]].standing.because
    return Standing(first.state, f"{len(of_state)} of {counted(len(judged), 'unit')}, such as '{of_state[0]}': {reason}")


def _shared(judged: Mapping[str, UnitJudgement]) -> Array:
    """Return the covariance (values, values) of means by what all units share: that of the median unit, since their logs differ."""
    tables = sorted((unit.shared for unit in judged.values()), key=np.trace)
    return tables[len(tables) // 2]


def _iterated(
    units: Sequence[FleetUnit], unknowns: Sequence[Unknown], design: CovariateDesign, together: Bools, title: str, executor: Workers
) -> tuple[Array, PopulationFit, list[UnitSummary], bool]:
    """Return the reference (values,), population, unit summaries, and whether the linearisations converged; all in the fitted form.

    At most `LINEARISATIONS` turns: each unit is fitted with the population as its prior, the population to the units' scores and
    information. Converged is a mean and a spread that move by less than `MEANS_MOVE` standard errors.
    """
    scale = np.array([u.scale for u in unknowns])
    begin = np.array([u.to_fitted(u.start) for u in unknowns])
    means, omega = np.repeat(begin[None], len(units), axis=0), np.diag((FIRST_PRIOR_SD * scale) ** 2)
    starts: list[Array | None] = [None] * len(units)
    noise, level, before = dict[str, float](), 1.0, None
    answers: list[UnitSummary] = []
    settled = False
    for turn in range(LINEARISATIONS):
        root = inverse_square_root(omega + np.diag((LEAST_PRIOR_SPREAD * scale) ** 2))
        tasks = [(f"unit '{u.name}'", (u, s, m, root, noise, level)) for u, s, m in zip(units, starts, means, strict=True)]
        answers = [s for _, s in sorted(in_tasks(read_unit, tasks, executor), key=itemgetter(0))]
        starts = [s.at for s in answers]
        noise, level = _noise(units, answers), _level(answers)
        modes = np.array([s.at[list(u.values)] for u, s in zip(units, answers, strict=True)])
        reference = np.median(modes, axis=0)
        information = np.array([s.information for s in answers])
        score = np.array([s.score for s in answers]) + np.einsum("nij,nj->ni", information, modes - reference)
        summaries = Summaries(information, score, design.rows())
        if not turn:
            _refuse_unseen(summaries, design, unknowns, title)
        population = PopulationFit.fitted(summaries, together)
        omega = population.omega
        means = reference + np.einsum("nij,j->ni", summaries.design, population.at.beta)
        now = (means.mean(axis=0), population.sizes)
        if before is not None:
            error = np.sqrt(np.diag(population.at.spread)[: len(unknowns)])
            moved = np.abs(now[0] - before[0]) / error
            grown = np.abs(now[1] - before[1]) / np.maximum(now[1], error)
            if moved.max() < MEANS_MOVE and grown.max() < MEANS_MOVE:
                settled = True
                break
        before = now
    return reference, population, answers, settled


def _noise(units: Sequence[FleetUnit], answers: Sequence[UnitSummary]) -> dict[str, float]:
    """Return sensor -> RMS of its residuals over the fleet, where its noise is not stated. [K]"""
    wanted = set().union(*(u.unstated for u in units))
    out = {}
    for sensor in wanted:
        sums = [s for one in answers for _, name, s in one.sums if name == sensor]
        out[sensor] = max(float(np.sqrt(sum(s.count * s.mean_square for s in sums) / sum(s.count for s in sums))), 1e-6)
    return out


def _level(answers: Sequence[UnitSummary]) -> float:
    """Return the variance of readings of units whose residuals do not wander, in squares of their noise; never below 1."""
    white = [s for s in answers if s.white]
    return max(1.0, sum(s.chi_square for s in white) / max(sum(s.freedom for s in white), 1.0)) if white else 1.0


def _refuse_unseen(summaries: Summaries, design: CovariateDesign, unknowns: Sequence[Unknown], title: str) -> None:
    """Refuse a fleet whose logs together do not determine the means.

    That is where sum over units A'J A, its diagonal scaled to one, has a smallest eigenvalue below `LEAST_MEAN_INFORMATION` of the
    largest: J (values, values) is the information of a unit, A (values, means) its design, both in the fitted form.

    Raises
    ------
    IdentificationError   Names the values that the eigenvector of that smallest one holds.
    """
    total = np.einsum("nia,nij,njb->ab", summaries.design, summaries.information, summaries.design, optimize=True)
    length = np.sqrt(np.maximum(np.diag(total), 1e-300))
    sizes, vectors = np.linalg.eigh(total / np.outer(length, length))
    if sizes[0] > LEAST_MEAN_INFORMATION * sizes[-1]:
        return
    weak = np.abs(vectors[:, 0]) > 0.3
    names = [u.name for u in unknowns] * (len(design.columns) + 1)
    lost = quoted(list(dict.fromkeys(n for n, w in zip(names, weak, strict=True) if w)))
    raise IdentificationError(
        f"the logs of all units together do not determine {lost}. Fix one of them, or add a record.", title, code="fleet.not-identifiable"
    )


def _remarks(units: Sequence[FleetUnit], together: Bools, numbers: int, answers: Sequence[UnitSummary], settled: bool) -> tuple[str, ...]:
    """Return remarks on the result, such as dropped priors, too few units for correlations, and fits that did not converge."""
    out = list(dict.fromkeys(r for u in units for r in u.remarks))
    if not together.all():
        out.append(
            f"correlations were left out: they need {FEWEST_UNITS} units per number of the covariance, {FEWEST_UNITS * numbers}, and there "
            f"are {len(units)}"
        )
    if any(u.kind == "sensor" for one in units for u in one.problem.unknowns):
        out.append(
            "constant errors of sensors count as each unit's own; those of one bench are a common error of all means, not counted here"
        )
    if unstated := sorted(set().union(*(u.unstated for u in units))):
        out.append(f"the noise of {quoted(unstated)} is the RMS of residuals over the fleet")
    if slow := sum(not s.white for s in answers):
        out.append(f"residuals of {counted(slow, 'unit')} are autocorrelated; their logs count for less")
    if lost := [u.name for u, s in zip(units, answers, strict=True) if not s.converged]:
        out.append(f"the fits of {quoted(lost[:3])} did not converge")
    if not settled:
        out.append(f"the means still moved after {LINEARISATIONS} linearisations")
    return tuple(out)


def _summed(
    title: str,
    units: Sequence[FleetUnit],
    unknowns: tuple[Unknown, ...],
    design: CovariateDesign,
    reference: Array,
    population: PopulationFit,
    remarks: tuple[str, ...],
    model: Model,
    judged: Mapping[str, UnitJudgement],
) -> Fleet:
    """Return the result: values and intervals [SI] from the population about `reference` (values,), fitted form, and what is said of units.

    Effects of covariates (entries of beta, fitted form) and correlations Omega_jk / (s_j s_k) between values, s their standard deviations
    between units, have 95 % intervals; odd units are those beyond a threshold distance.
    """
    size, at, shared = len(unknowns), population.at, _shared(judged)
    worth = _worth(population, units)
    values = {u.name: _value(u, k, population, reference, worth, units, shared[k, k]) for k, u in enumerate(unknowns)}
    effects = []
    for c, (name, text, _) in enumerate(design.columns, 1):
        for k, u in enumerate(unknowns):
            interval = interval_of_mean(population, np.eye(at.beta.size)[c * size + k])
            label = f"{name} {text}".rstrip()
            effects.append(Effect(label, u.name, float(at.beta[c * size + k]), *interval, u.log))
    correlations = []
    for j, k in np.argwhere(np.tril(population.together, -1)).tolist():
        interval = interval_of_correlation(population, j, k)
        ratio = population.omega[j, k] / max(float(population.sizes[j] * population.sizes[k]), 1e-300)
        correlations.append(SharedVariation(unknowns[k].name, unknowns[j].name, float(ratio), interval.low, interval.high))
    of_units = _own_values(units, unknowns, reference, population)
    odd = tuple(
        OddUnit(
            units[o.unit].name, unknowns[o.value].name, of_units[units[o.unit].name][unknowns[o.value].name][0], o.distance, o.threshold
        )
        for o in odd_units(population)
    )
    return Fleet(
        title,
        values,
        tuple(effects),
        tuple(correlations),
        odd,
        of_units,
        remarks,
        population,
        reference,
        unknowns,
        design,
        model,
        shared,
        standing_of(judged),
    )


def _value(
    u: Unknown,
    k: int,
    population: PopulationFit,
    reference: Array,
    worth: tuple[Array, Array, Array],
    units: Sequence[FleetUnit],
    shared: float,
) -> PopulationValue:
    """Return one value of the population [SI], its mean and interval, and its spread [fitted form]; 0 where that is not seen.

    Parameters
    ----------
    k : int                     Position of the value.
    reference : array (values,) About which the population was fitted, fitted form.
    worth : tuple               Change of its error by one more unit and by one more hour of a log (values,) [-], and of which unit.
    shared : float              Variance of its mean by what all units share, fitted form.
    """
    mean = interval_of_mean(population, np.eye(population.at.beta.size)[k], shared)
    spread = interval_of_spread(population, k)
    middle = float(reference[k] + population.at.beta[k])
    vanished = spread.low == 0.0 and population.rise((k,), 0.0)[0] < ZERO_SPREAD_RISE
    return PopulationValue(
        u.name,
        u.unit,
        u.to_value(middle),
        u.to_value(float(reference[k] + mean.low)),
        u.to_value(float(reference[k] + mean.high)),
        mean.freedom,
        0.0 if vanished else float(population.sizes[k]),
        spread.low,
        spread.high,
        spread.freedom,
        u.log,
        vanished,
        float(worth[0][k]),
        float(worth[1][k]),
        units[int(worth[2][k])].name,
    )


def _worth(population: PopulationFit, units: Sequence[FleetUnit]) -> tuple[Array, Array, Array]:
    """Return by which factors [-] the standard errors of means (values,) change with one more unit, and an hour more of one log; and which.

    The new unit is like the one whose tr(W Omega) is the median. Of unit n the information grows by 1 + 3600 s / length of its log; the
    third array has the place of the unit whose log helps each mean most.
    """
    summaries, at, size = population.summaries, population.at, len(population.omega)
    now = np.diag(at.spread)[:size]
    total = np.einsum("nia,nib->ab", summaries.design, at.carried)
    middle = int(np.argsort(np.trace(at.weights @ population.omega, axis1=1, axis2=2))[len(units) // 2])
    first = np.eye(size, total.shape[0])
    with_unit = np.diag(np.linalg.inv(total + first.T @ at.weights[middle] @ first))[:size]
    seconds = np.array([max(u.seconds, 1.0) for u in units])
    longer = summaries.information * (1.0 + HOUR / seconds)[:, None, None]
    _, _, weights, _ = weigh(longer, summaries.score, square_root(population.omega))
    added = np.einsum("nia,nij,njb->nab", summaries.design, weights - at.weights, summaries.design, optimize=True)
    with_hour = np.diagonal(np.linalg.inv(total + added), axis1=1, axis2=2)[:, :size]
    best = with_hour.argmin(axis=0)
    return np.sqrt(with_unit / now), np.sqrt(with_hour[best, np.arange(size)] / now), best


def _own_values(
    units: Sequence[FleetUnit], unknowns: Sequence[Unknown], reference: Array, population: PopulationFit
) -> dict[str, dict[str, tuple[float, float]]]:
    """Return unit -> parameter -> (value, standard error) with the population as prior. [SI]

    The best linear prediction X b + Omega X_push, with its mean squared error Omega - Omega W Omega + (X - Omega C) S (X - Omega C)'
    (Henderson, Biometrics 31 (1975) 423); that Omega was estimated is not counted. `reference` (values,) is where fitted forms count from.
    """
    at, omega = population.at, population.omega
    fitted = np.einsum("nij,j->ni", population.summaries.design, at.beta)
    middle = reference + fitted + at.pushes @ omega
    lag = population.summaries.design - omega @ at.carried
    wide = omega - omega @ at.weights @ omega + lag @ at.spread @ np.swapaxes(lag, 1, 2)
    errors = np.sqrt(np.maximum(np.diagonal(wide, axis1=1, axis2=2), 0.0))
    return {
        unit.name: {
            u.name: (u.to_value(float(middle[n, k])), abs(u.slope(float(middle[n, k]))) * float(errors[n, k]))
            for k, u in enumerate(unknowns)
        }
        for n, unit in enumerate(units)
    }
