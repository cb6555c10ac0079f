"""`fleet`: one design, many units, each with its logs; the outer loop and its result."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from thermid.base.arguments import takes_objects
from thermid.base.errors import IdentificationError, quoted, refuse_unknown
from thermid.base.linear_algebra import Array, Bools, inverse_square_root, square_root
from thermid.base.results import PlottedTrace, Result, Row
from thermid.base.units import counted, from_si, unit as unit_of
from thermid.fit.calibration import requested
from thermid.fit.problem import Request, Unknown
from thermid.inference._fleet.intervals import (
    Interval,
    distances,
    interval_of_correlation,
    interval_of_mean,
    interval_of_spread,
    odd_units,
)
from thermid.inference._fleet.population import Population, Summaries, weigh
from thermid.inference._fleet.units import WIDE, Said, Unit, read_unit
from thermid.measure.amounts import short
from thermid.measure.records import Record
from thermid.model.tree import Model
from thermid.simulation.runs import Ensemble, Workers, ensemble, in_tasks
from thermid.simulation.scenarios import Scenario

ROUNDS = 12
"""Linearisations at most."""
SETTLED = 0.02
"""Move of the means, in standard errors, and of spreads, relative, below which the linearisation is the last."""
FLOOR = 1e-3
"""Spread that a prior of a unit has at least, in typical changes of a value: one that is zero would stop a descent."""
FEWEST_UNITS = 3
"""Units per number of Omega from which correlations are estimated."""
UNSEEN = 1e-8
"""Information about a combination of means, beside the largest, below which no log of the fleet tells it."""
HOUR = 3600.0

Covariates = Mapping[str, Mapping[str, float | str]]
"""Unit -> name -> number, such as its mass, or text, such as its batch."""


@dataclass(frozen=True)
class PopulationValue:
    """One value of a design over its fleet.

    Parameters
    ----------
    path, unit : str
    mean, low, high : float         The mean, of values whose logarithm is fitted the geometric one, and its 95 % interval. [SI]
    freedom : float                 Degrees of freedom of the mean.
    spread, spread_low, spread_high : float     Standard deviation of units: relative where `relative` [-], else [SI].
    spread_freedom : float          Degrees of freedom of the spread.
    relative : bool                 Whether its logarithm is fitted.
    vanished : bool                 Whether the likeliest spread is zero: the logs do not show that units differ.
    one_more_unit, one_more_hour : float    Standard error of the mean then, over that of now. [-]
    best_unit : str                 Whose log the hour is worth most on.
    """

    path: str
    unit: str
    mean: float
    low: float
    high: float
    freedom: float
    spread: float
    spread_low: float
    spread_high: float
    spread_freedom: float
    relative: bool
    vanished: bool
    one_more_unit: float
    one_more_hour: float
    best_unit: str


@dataclass(frozen=True)
class Effect:
    """What a covariate does to a value: its change per unit of a number, or of a text beside the fleet's mean; relative where `relative`."""

    covariate: str
    path: str
    size: float
    low: float
    high: float
    freedom: float
    relative: bool


@dataclass(frozen=True)
class SharedVariation:
    """Correlation of two values over units, with its 95 % interval."""

    path: str
    other: str
    correlation: float
    low: float
    high: float


@dataclass(frozen=True)
class OddUnit:
    """A unit that is apart in one value: its distance in standard deviations, and the threshold that any of a clean fleet exceeds in 5 %."""

    unit: str
    path: str
    value: float
    distance: float
    threshold: float


@dataclass(frozen=True, eq=False)
class Fleet(Result):
    """The population of a design's units.

    Parameters
    ----------
    title : str
    values : dict           Path -> `PopulationValue`.
    effects : tuple         Of covariates.
    correlations : tuple    Of values over units; empty where they were left out.
    odd : tuple             Units that do not belong to the population, the farthest first.
    units : dict            Unit -> path -> (value, standard error) with the population as prior. [SI]
    remarks : tuple of str  What is assumed or left out.
    population : Population The likelihood, in the fitted form, about `reference`.
    """

    title: str
    values: Mapping[str, PopulationValue]
    effects: tuple[Effect, ...]
    correlations: tuple[SharedVariation, ...]
    odd: tuple[OddUnit, ...]
    units: Mapping[str, Mapping[str, tuple[float, float]]]
    remarks: tuple[str, ...]
    population: Population = field(repr=False)
    reference: Array = field(repr=False)
    unknowns: tuple[Unknown, ...] = field(repr=False)
    covariates: _Design = field(repr=False)
    model: Model = field(repr=False)

    def next_unit(self, covariates: Mapping[str, float | str] | None = None) -> tuple[Array, Array]:
        """Return mean (values,) and covariance of the values of a unit not built yet, in the fitted form, the error of the means counted.

        Raises
        ------
        IdentificationError   When a covariate is none of the fleet's.
        """
        x = self.covariates.row(covariates or {})
        spread = self.population.at.spread
        return self.reference + x @ self.population.at.beta, self.population.omega + x @ spread @ x.T

    def draws(self, count: int = 1000, *, covariates: Mapping[str, float | str] | None = None, seed: int = 1) -> dict[str, Array]:
        """Return path -> values (count,) of units not built yet [SI], as `ensemble` takes them.

        Raises
        ------
        IdentificationError   When a covariate is none of the fleet's.
        """
        mean, wide = self.next_unit(covariates)
        points = mean + np.random.default_rng(seed).standard_normal((count, mean.size)) @ square_root(wide).T
        return {u.name: np.array([u.to_value(x) for x in points[:, k]]) for k, u in enumerate(self.unknowns)}

    def predict(
        self,
        scenario: Scenario,
        count: int = 1000,
        *,
        covariates: Mapping[str, float | str] | None = None,
        seed: int = 1,
        executor: Workers = None,
    ) -> Ensemble:
        """Return the runs of drawn units not built yet; `plot` shows their 95 % bands.

        Raises
        ------
        IdentificationError   When a covariate is none of the fleet's.
        """
        return ensemble(self.model, scenario, self.draws(count, covariates=covariates, seed=seed), executor=executor)

    def priors(self, covariates: Mapping[str, float | str] | None = None) -> str:
        """Return the prior of the next unit as the lines of a campaign's stage; correlations are not in them.

        Raises
        ------
        IdentificationError   When a covariate is none of the fleet's.
        """
        mean, wide = self.next_unit(covariates)
        lines = ["[stages.priors]"]
        for u, x, sd in zip(self.unknowns, mean, np.sqrt(np.diag(wide)), strict=True):
            value, error = u.to_value(float(x)), abs(u.slope(float(x))) * float(sd)
            there = f"{from_si(value, u.unit):.6g} [{u.unit}]"
            lines.append(f'"{u.name}" = {{ mean = "{there}", sd = "{_difference(error, u.unit)}" }}')
        return "\n".join(lines)

    def __str__(self) -> str:
        """Return the population as tables, what is remarkable first."""
        named = ", ".join(f"{o.unit} ({o.path}, {o.distance:+.1f} standard deviations, limit {o.threshold:.1f})" for o in self.odd)
        lines = [f"{self.title}: {counted(len(self.units), 'unit')}, {counted(len(self.values), 'value')} of each. Odd units: {named or 'none'}."]
        lines += [f"  {r}." for r in self.remarks]
        width = max(map(len, self.values))
        for v in self.values.values():
            mean = f"{_shown(v.mean, v.unit)} ({_shown(v.low, v.unit)} .. {_shown(v.high, v.unit)}) {v.unit}"
            ends = [_spread(s, v) for s in (v.spread, v.spread_low, v.spread_high)]
            size = f"spread {ends[0]} ({ends[1]} .. {ends[2]})" if not v.vanished else f"spread reaches zero (at most {ends[2]})"
            lines.append(
                f"  {v.path:<{width}}  mean {mean}, {v.freedom:.0f} degrees of freedom; {size}, {v.spread_freedom:.0f} degrees of freedom"
            )
        for e in self.effects:
            lines.append(f"  effect of {e.covariate} on {e.path}: {_percent(e.size, e)} ({_percent(e.low, e)} .. {_percent(e.high, e)})")
        lines += [f"  {c.path} and {c.other}: correlation {c.correlation:.2f} ({c.low:.2f} .. {c.high:.2f})" for c in self.correlations]
        lines.append("Standard error of a mean with one more unit, or one more hour of log, over that of now:")
        lines += [
            f"  {v.path:<{width}}  unit {v.one_more_unit:.2f}, hour {v.one_more_hour:.2f} (on {v.best_unit})" for v in self.values.values()
        ]
        return "\n".join([*lines, "Prior of the next unit, for a stage of its campaign:", self.priors()])

    def _as_rows(self) -> list[Row]:
        """Return every value with its mean and spread."""
        return [dict(vars(v)) for v in self.values.values()]

    def _as_traces(self) -> Sequence[PlottedTrace]:
        """Return how far every unit is from its mean in each value."""
        far = distances(self.population)
        x = np.arange(1.0, len(self.units) + 1.0)
        return [PlottedTrace(u.name, x, far[:, k], measured=True) for k, u in enumerate(self.unknowns)]

    @property
    def _axes_titles(self) -> tuple[str, str]:  # type: ignore[override]
        return ("unit [-]", "distance from the mean [standard deviations]")

    _frame_of_rows = True

    def to_dict(self) -> dict[str, Any]:
        """Return it as JSON holds it: values in SI units."""
        return {
            "title": self.title,
            "values": {p: dict(vars(v)) for p, v in self.values.items()},
            "effects": [dict(vars(e)) for e in self.effects],
            "correlations": [dict(vars(c)) for c in self.correlations],
            "odd": [dict(vars(o)) for o in self.odd],
            "units": {n: {p: {"value": v, "error": e} for p, (v, e) in of.items()} for n, of in self.units.items()},
            "remarks": list(self.remarks),
            "priors": self.priors(),
        }


def _difference(size: float, text: str) -> str:
    return f"{size / float(unit_of(text).factor):.6g} [{'K' if text in ('degC', 'degF') else text}]"


def _shown(value: float, text: str) -> str:
    return f"{from_si(value, text):.4g}"


def _spread(size: float, v: PopulationValue) -> str:
    return f"{100.0 * size:.3g} %" if v.relative else f"{size / float(unit_of(v.unit).factor):.3g} {v.unit}"


def _percent(size: float, e: Effect) -> str:
    return f"{100.0 * size:+.3g} %" if e.relative else f"{size:+.3g} [SI]"


@dataclass(frozen=True, eq=False)
class _Design:
    """How means depend on covariates: columns about the fleet's mean, so that the first coefficients are the mean of the fleet.

    Parameters
    ----------
    columns : tuple         (covariate, text or "", mean, scale) of each column beside the first.
    size : int              Values.
    table : array (units, columns + 1)
    """

    columns: tuple[tuple[str, str, float], ...]
    size: int
    table: Array

    @classmethod
    def of(cls, units: Sequence[str], covariates: Covariates, size: int) -> _Design:
        """Return it.

        Raises
        ------
        IdentificationError   When a unit lacks a covariate, there are none of the unit's name, or all units have the same value.
        """
        refuse_unknown(covariates, units, "fleet", "covariates are given for '{}', which is no unit of this fleet.", IdentificationError)
        names = list(dict.fromkeys(n for of in covariates.values() for n in of))
        columns, values = list[tuple[str, str, float]](), [np.ones(len(units))]
        for name in names:
            lacking = [u for u in units if name not in covariates.get(u, {})]
            if lacking:
                raise IdentificationError(f"the covariate '{name}' is not given for {quoted(lacking[:3])}. Give it for every unit.", "fleet")
            given = [covariates[u][name] for u in units]
            texts = sorted({g for g in given if isinstance(g, str)})
            if len(set(given)) < 2:
                raise IdentificationError(f"the covariate '{name}' is the same for all units. Leave it out.", "fleet")
            if texts and not all(isinstance(g, str) for g in given):
                raise IdentificationError(f"the covariate '{name}' is a text for some units and a number for others.", "fleet")
            for text in texts[1:] or [""]:
                column = np.array([float(g == text) if text else float(g) for g in given])
                columns.append((name, text, float(column.mean())))
                values.append(column - column.mean())
        return cls(tuple(columns), size, np.column_stack(values))

    def row(self, given: Mapping[str, float | str]) -> Array:
        """Return X (values, coefficients) of a unit; what is not given is the fleet's mean."""
        refuse_unknown(given, [n for n, _, _ in self.columns], "fleet", "'{}' is no covariate of this fleet.", IdentificationError)
        of = [
            (float(given[name] == text) if text else float(given[name])) - mean if name in given else 0.0 for name, text, mean in self.columns
        ]
        return np.kron(np.array([1.0, *of]), np.eye(self.size))

    def rows(self) -> Array:
        """Return X of all units (units, values, coefficients)."""
        return np.einsum("nc,ij->nicj", self.table, np.eye(self.size)).reshape(len(self.table), self.size, -1)


@takes_objects
def fleet(
    model: Model,
    units: Mapping[str, Record | Sequence[Record]],
    free: Sequence[str],
    *,
    covariates: Covariates | None = None,
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
        own = scenario
        if isinstance(scenario, Mapping):
            own = {k: s for k, s in scenario.items() if k == "*" or k in {r.name for r in records}}
        requests[unit] = requested(model, records, free, scenario=own, local=local, loss=loss, name=unit)
    return fleet_of(requests, covariates or {}, name or model.title, executor)


def fleet_of(requests: Mapping[str, Request], covariates: Covariates, title: str, executor: Workers = None) -> Fleet:
    """Return the population of units whose fits are asked for, one request each; see `fleet`.

    Raises
    ------
    IdentificationError   As `fleet`.
    """
    from threadpoolctl import threadpool_limits

    if len(requests) < 3:
        raise IdentificationError(f"a fleet needs at least three units, and there are {len(requests)}.", title)
    with threadpool_limits(limits=1):
        units = [Unit.of(name, request) for name, request in requests.items()]
        unknowns = _same(units, title)
        design = _Design.of([u.name for u in units], covariates, len(unknowns))
        count, numbers = len(units), len(unknowns) * (len(unknowns) + 1) // 2
        full = count >= FEWEST_UNITS * numbers or len(unknowns) == 1
        together = np.ones((len(unknowns),) * 2, dtype=bool) if full else np.eye(len(unknowns), dtype=bool)
        reference, population, said, settled = _iterated(units, unknowns, design, together, title, executor)
        remarks = _remarks(units, together, numbers, said, settled)
        model = next(iter(requests.values())).model
        return _summed(title, units, unknowns, design, reference, population, remarks, model)


def _same(units: Sequence[Unit], title: str) -> tuple[Unknown, ...]:
    """Return the values that all units have.

    Raises
    ------
    IdentificationError   When two units differ in them.
    """
    first = units[0].unknowns
    for unit in units[1:]:
        if [(u.name, u.log) for u in unit.unknowns] != [(u.name, u.log) for u in first]:
            raise IdentificationError(f"'{unit.name}' has other free values than '{units[0].name}'.", title)
    return tuple(first)


def _iterated(
    units: Sequence[Unit], unknowns: Sequence[Unknown], design: _Design, together: Bools, title: str, executor: Workers
) -> tuple[Array, Population, list[Said], bool]:
    """Return reference, population, what units say, and whether the last linearisation is the last one needed."""
    scale = np.array([u.scale for u in unknowns])
    begin = np.array([u.to_fitted(u.start) for u in unknowns])
    means, omega = np.repeat(begin[None], len(units), axis=0), np.diag((WIDE * scale) ** 2)
    starts: list[Array | None] = [None] * len(units)
    noise, level, before = dict[str, float](), 1.0, None
    said: list[Said] = []
    settled = False
    for turn in range(ROUNDS):
        root = inverse_square_root(omega + np.diag((FLOOR * scale) ** 2))
        tasks = [(f"unit '{u.name}'", (u, s, m, root, noise, level)) for u, s, m in zip(units, starts, means, strict=True)]
        said = [s for _, s in sorted(in_tasks(read_unit, tasks, executor), key=lambda found: found[0])]
        starts = [s.at for s in said]
        noise, level = _noise(units, said), _level(said)
        modes = np.array([s.at[list(u.values)] for u, s in zip(units, said, strict=True)])
        reference = np.median(modes, axis=0)
        information = np.array([s.information for s in said])
        score = np.array([s.score for s in said]) + np.einsum("nij,nj->ni", information, modes - reference)
        summaries = Summaries(information, score, design.rows())
        if not turn:
            _refuse_unseen(summaries, design, unknowns, title)
        population = Population.fitted(summaries, together)
        omega = population.omega
        means = reference + np.einsum("nij,j->ni", summaries.design, population.at.beta)
        now = (means.mean(axis=0), population.sizes)
        if before is not None:
            error = np.sqrt(np.diag(population.at.spread)[: len(unknowns)])
            moved = np.abs(now[0] - before[0]) / error
            grown = np.abs(now[1] - before[1]) / np.maximum(now[1], error)
            if moved.max() < SETTLED and grown.max() < SETTLED:
                settled = True
                break
        before = now
    return reference, population, said, settled


def _noise(units: Sequence[Unit], said: Sequence[Said]) -> dict[str, float]:
    """Return sensor -> RMS of its residuals over the fleet, where its noise is not stated. [K]"""
    wanted = set().union(*(u.unstated for u in units))
    out = {}
    for sensor in wanted:
        sums = [s for one in said for _, name, s in one.sums if name == sensor]
        out[sensor] = max(float(np.sqrt(sum(s.count * s.mean_square for s in sums) / sum(s.count for s in sums))), 1e-6)
    return out


def _level(said: Sequence[Said]) -> float:
    """Return the variance of readings of units whose residuals do not wander, in squares of their noise; never below 1."""
    white = [s for s in said if s.white]
    return max(1.0, sum(s.chi_square for s in white) / max(sum(s.freedom for s in white), 1.0)) if white else 1.0


def _refuse_unseen(said: Summaries, design: _Design, unknowns: Sequence[Unknown], title: str) -> None:
    """Refuse a fleet whose logs together do not tell the means.

    Raises
    ------
    IdentificationError   Names the values.
    """
    total = np.einsum("nia,nij,njb->ab", said.design, said.information, said.design, optimize=True)
    length = np.sqrt(np.maximum(np.diag(total), 1e-300))
    sizes, vectors = np.linalg.eigh(total / np.outer(length, length))
    if sizes[0] > UNSEEN * sizes[-1]:
        return
    weak = np.abs(vectors[:, 0]) > 0.3
    names = [u.name for u in unknowns] * (len(design.columns) + 1)
    lost = quoted(list(dict.fromkeys(n for n, w in zip(names, weak, strict=True) if w)))
    raise IdentificationError(f"the logs of all units together do not determine {lost}. Fix one of them, or add a record.", title)


def _remarks(units: Sequence[Unit], together: Bools, numbers: int, said: Sequence[Said], settled: bool) -> tuple[str, ...]:
    """Return what a reader must know."""
    out = list(dict.fromkeys(r for u in units for r in u.remarks))
    if not together.all():
        out.append(
            f"correlations were left out: they need {FEWEST_UNITS} units per number of the covariance, {FEWEST_UNITS * numbers}, and there "
            f"are {len(units)}"
        )
    if any(u.kind == "sensor" for one in units for u in one.problem.unknowns):
        out.append("constant errors of sensors count as each unit's own; those of one bench are a common error of all means, not counted here")
    if unstated := sorted(set().union(*(u.unstated for u in units))):
        out.append(f"the noise of {quoted(unstated)} is the RMS of residuals over the fleet")
    if slow := sum(not s.white for s in said):
        out.append(f"residuals of {counted(slow, 'unit')} are autocorrelated; their logs count for less")
    if lost := [u.name for u, s in zip(units, said, strict=True) if not s.converged]:
        out.append(f"the fits of {quoted(lost[:3])} did not converge")
    if not settled:
        out.append(f"the means still moved after {ROUNDS} linearisations")
    return tuple(out)


def _summed(
    title: str,
    units: Sequence[Unit],
    unknowns: tuple[Unknown, ...],
    design: _Design,
    reference: Array,
    population: Population,
    remarks: tuple[str, ...],
    model: Model,
) -> Fleet:
    """Return the result."""
    size, at = len(unknowns), population.at
    worth = _worth(population, units)
    values = {u.name: _value(u, k, population, reference, worth, units) for k, u in enumerate(unknowns)}
    effects = []
    for c, (name, text, _) in enumerate(design.columns, 1):
        for k, u in enumerate(unknowns):
            interval = interval_of_mean(population, np.eye(at.beta.size)[c * size + k])
            label = f"{name} {text}".rstrip()
            effects.append(Effect(label, u.name, float(at.beta[c * size + k]), *interval, u.log))
    correlations = []
    for j, k in zip(*np.tril_indices(size, -1), strict=True):
        if population.together[j, k]:
            interval = interval_of_correlation(population, int(j), int(k))
            ratio = population.omega[j, k] / max(float(population.sizes[j] * population.sizes[k]), 1e-300)
            correlations.append(SharedVariation(unknowns[k].name, unknowns[j].name, float(ratio), interval.low, interval.high))
    own = _own_values(units, unknowns, reference, population)
    odd = tuple(
        OddUnit(units[o.unit].name, unknowns[o.value].name, own[units[o.unit].name][unknowns[o.value].name][0], o.distance, o.threshold)
        for o in odd_units(population)
    )
    return Fleet(title, values, tuple(effects), tuple(correlations), odd, own, remarks, population, reference, unknowns, design, model)


def _value(
    u: Unknown, k: int, population: Population, reference: Array, worth: tuple[Array, Array, Array], units: Sequence[Unit]
) -> PopulationValue:
    """Return one value of the population."""
    mean = interval_of_mean(population, np.eye(population.at.beta.size)[k])
    spread = interval_of_spread(population, k)
    middle = float(reference[k] + population.at.beta[k])
    vanished = spread.low == 0.0 and population.rise((k,), 0.0)[0] < 1e-3
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


def _worth(population: Population, units: Sequence[Unit]) -> tuple[Array, Array, Array]:
    """Return the standard errors of means with one more unit like the median one, and with one more hour of one log, over those of now;
    and which unit's. Information grows with the length of a log.
    """
    said, at, size = population.said, population.at, len(population.omega)
    now = np.diag(at.spread)[:size]
    total = np.einsum("nia,nib->ab", said.design, at.carried)
    middle = int(np.argsort(np.trace(at.weights @ population.omega, axis1=1, axis2=2))[len(units) // 2])
    first = np.eye(size, total.shape[0])
    with_unit = np.diag(np.linalg.inv(total + first.T @ at.weights[middle] @ first))[:size]
    seconds = np.array([max(u.seconds, 1.0) for u in units])
    longer = said.information * (1.0 + HOUR / seconds)[:, None, None]
    _, _, weights, _ = weigh(longer, said.score, square_root(population.omega))
    added = np.einsum("nia,nij,njb->nab", said.design, weights - at.weights, said.design, optimize=True)
    with_hour = np.diagonal(np.linalg.inv(total + added), axis1=1, axis2=2)[:, :size]
    best = with_hour.argmin(axis=0)
    return np.sqrt(with_unit / now), np.sqrt(with_hour[best, np.arange(size)] / now), best


def _own_values(
    units: Sequence[Unit], unknowns: Sequence[Unknown], reference: Array, population: Population
) -> dict[str, dict[str, tuple[float, float]]]:
    """Return the values of every unit with the population as prior, and their standard errors. [SI]"""
    at, omega = population.at, population.omega
    fitted = np.einsum("nij,j->ni", population.said.design, at.beta)
    middle = reference + fitted + at.pushes @ omega
    kept = population.said.design - omega @ at.carried
    wide = omega - omega @ at.weights @ omega + kept @ at.spread @ np.swapaxes(kept, 1, 2)
    errors = np.sqrt(np.maximum(np.diagonal(wide, axis1=1, axis2=2), 0.0))
    return {
        unit.name: {
            u.name: (u.to_value(float(middle[n, k])), abs(u.slope(float(middle[n, k]))) * float(errors[n, k])) for k, u in enumerate(unknowns)
        }
        for n, unit in enumerate(units)
    }
