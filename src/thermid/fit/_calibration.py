"""`Calibration`: what a fit found, its uncertainty, what it contradicts, and which sensors set its errors."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from os import PathLike
from typing import Any, Self

import numpy as np

from thermid.base.errors import DeckError
from thermid.base.results import Named, PlottedTrace, Row
from thermid.base.units import ICE_POINT, counted, digits, from_si, short, unit
from thermid.fit._inputs import InputTable, input_lines
from thermid.fit._minimisation import KeptFit
from thermid.fit._problem.experiment import Experiment
from thermid.fit._problem.request import Request
from thermid.fit._problem.residuals import Predictions, Problem, SensorStatistics, SensorTrace, Sums, Unknown, pooled
from thermid.fit._uncertainty.moved import MOVED, Moves
from thermid.fit._uncertainty.noise import Autocorrelation
from thermid.model.tree import UNJUDGED, Model, Standing, cuts_of
from thermid.values.store import (
    AS_FITTED,
    EXPECTED,
    INPUT,
    FittedValue,
    FittedValues,
    State,
    Store,
    bracketed,
    load_values,
    range_shares,
    save_store,
    without_spread,
)

LOUD = "NOT CREDIBLE: "


def blame_of(experiments: Sequence[Experiment]) -> str:
    """Return what may be wrong where a fit would need an error that is not credible, and what to do."""
    stated = any(step.startswith("joined with") and " between " not in step for e in experiments for step in e.record.steps)
    joined = ", the stated offset of a joined log (give a range, and the fit finds it)" if stated else ""
    return f"A column, a unit, a node, an accuracy{joined} or the model is wrong. Do not use these values."


FIRST = "check: "
"""Begins what stands in the first lines of a fit: a question that its user can answer and the fit cannot."""
QUESTIONED_FACTOR = 5.0
"""Factor from the deck's value from which a fitted value with a source is questioned. [-]"""
UNSOURCED = tuple(unit(u).dimension for u in ("kg", "J/K", "J/(kg K)"))
"""Quantities that are questioned also where the deck gives no source: nobody is wrong about a mass by so much."""

MISFIT = 1.5
"""Chi-square per degree of freedom from which residuals are said to be larger than the stated noise. [-]"""
MIN_RANGE_SHARE = 0.05
"""Part of the variance of a value from which a line says that stated ranges make it. [-]"""
CONTRADICTION_DEVIATIONS = 10.0
"""Standard deviations from what was stated beyond which a fit is not believed; chance and a careless accuracy do not reach so far. [-]"""
BETWEEN_RUNS = 0.027
"""Relative standard deviation of a coefficient, mass or power from run to run, learned from public test sets: one of `SIZES`. [-]"""


def contradicted(values: Mapping[str, FittedValue]) -> dict[str, str]:
    """Return name -> what would have to be wrong, of fitted values that lie more than ten deviations from what was stated of them."""
    far = {name: _deviations(v) for name, v in values.items()}
    return {name: _words(values[name], d) for name, d in sorted(far.items(), key=lambda item: -item[1]) if d > CONTRADICTION_DEVIATIONS}


def contradicted_powers(unknowns: Sequence[Unknown], at: Sequence[float]) -> dict[str, str]:
    """Return record and power -> what would have to be wrong of it there, where the error of its mean is above ten standard deviations.

    A power of one record that was sampled, and not logged as it changed, has an error x of its mean, the heat less what was logged over
    that, among the unknowns `at` (unknowns,). It counts as |x| / sqrt(stated^2 + `BETWEEN_RUNS`^2), with its stated standard deviation. [-]
    """
    means = [(u.name, x, u.prior.sd) for u, x in zip(unknowns, at, strict=True) if u.prior is not None and u.is_mean_of_power]
    far = [(name, x, abs(x) / math.hypot(sd, BETWEEN_RUNS)) for name, x, sd in means]
    return {
        name: f"{name} ({100 * x:+.3g} % of the logged power) would be {short(times)} times what is stated of it and what powers differ by "
        "from run to run"
        for name, x, times in sorted(far, key=lambda item: -item[2])
        if times > CONTRADICTION_DEVIATIONS
    }


def _bracketed(fit: Calibration) -> list[str]:
    """Return what a fit held and has no spread: set points of thermostats, assumed and measured values whose deck has min and max."""
    given = {p for s in fit.store.states.values() for p in s.acts}
    given |= {p for e in fit.experiments for p in e.scenario.driven(e.network.flat)}
    held = {p: e.parameter for p, e in fit.given_model.parameter_table().items() if p not in given}
    bare = [p for p, x in held.items() if x.is_literal and x.stated_range is None]
    # a set point is known to some tenths of a kelvin at best, and offsets of sensors take up what it is wrong by
    points = [p for p in bare if ".thermostat." in p or p.endswith(".setpoint")]
    return points + [p for p in bracketed(held, ("assumed", "measured")) if p not in points]


def far_from_sheet(model: Model, values: FittedValues) -> tuple[str, ...]:
    """Return a question about each fitted value that is five times the deck's, or a fifth of it.

    Asked of values whose source is a data sheet, a publication, a measurement or a derivation, and of masses and heat capacities unless
    they are assumed.
    """
    table, out = model.parameter_table(), []
    for path, v in values.parameters.items():
        if path not in table or not (v.log and v.start > 0.0 and v.value > 0.0):
            continue
        ratio, source = v.value / v.start, table[path].parameter.source
        is_questionable = source != "assumed" if source else unit(v.unit).dimension in UNSOURCED
        if is_questionable and not 1.0 / QUESTIONED_FACTOR < ratio < QUESTIONED_FACTOR:
            of = f"{short(v.converted(v.start), 3)} {v.unit} ({source})" if source else f"{short(v.converted(v.start), 3)} {v.unit}"
            times = f"{short(ratio, 3)} times" if ratio > 1.0 else f"{short(1.0 / ratio, 3)} times less than"
            out.append(
                f"{FIRST}{path} is {short(v.in_unit, 3)} {v.unit}, {times} the deck's {of}. A unit of time, power or temperature in the "
                "log, or the deck's value, may be wrong. Check them."
            )
    return tuple(out)


def _deviations(v: FittedValue) -> float:
    """Return how many standard deviations a value lies from its prior; zero where it has none. [-]"""
    if v.prior is None or (v.log and not v.value > 0.0):
        return 0.0
    mean, sd = v.prior
    return abs((math.log(v.value) if v.log else v.value) - mean) / sd


def _words(v: FittedValue, deviations: float) -> str:
    """Return what would have to be wrong for a value to lie so many standard deviations from what was stated."""
    times = short(deviations)
    if v.kind == "sensor" or (v.kind == INPUT and v.unit == "K"):
        sd = v.prior[1] if v.prior is not None else 0.0
        name = v.path.removeprefix("sensor ").removesuffix(" error")
        return f"{name} would need an error of {v.value:+.3g} K, {times} times its accuracy of {short(sd)} K"
    if v.kind == INPUT:
        sd = v.prior[1] if v.prior is not None else 0.0
        error = f"{100 * v.value:+.3g} %, {times} times its accuracy of {short(100 * sd)} %"
        if sd > 1.0:
            error = f"{abs(v.value):.3g} times its readings, and its accuracy is {short(sd)} times these"
        return f"{v.path.removesuffix(' error')} would need an error of {error}"
    from_what = "the stated value" if v.kind == "instrument" else "its prior"
    return f"{v.path} would have to be {short(v.in_unit, 3)} {v.unit} to meet the readings, {times} standard deviations from {from_what}"


@dataclass(frozen=True)
class Local:
    """A value fitted for one record alone.

    Parameters
    ----------
    record : str    The record.
    name : str      What of it: ``initial.<node>``, a boundary, a clock offset.
    value : float   Its value, in `unit`.
    error : float   Its standard error, values that all records share counted.
    unit : str      Its unit.
    slopes : dict   Shared value -> what the readings would move this one by, if that one moved by one in fitted form.
    """

    record: str
    name: str
    value: float
    error: float
    unit: str = "K"
    slopes: Mapping[str, float] = field(default_factory=dict)

    @property
    def words(self) -> str:
        """The value with its error."""
        if self.unit == "degC":
            return f"{self.value - 273.15:.2f} +- {short(self.error)} degC"
        return f"{digits(self.value, self.error)} +- {short(self.error)} {self.unit if self.unit != '1' else ''}".rstrip()


@dataclass(frozen=True)
class FitEnd:
    """How the search of a fit ended.

    Parameters
    ----------
    place : KeptFit     Where: what a results folder keeps, so that the fit can be taken again.
    chi_square : float  Weighted sum of squares of the data. [-]
    freedom : int       Samples less unknowns.
    converged : bool    Whether the minimisation ended by its own tolerances.
    stopped : bool      Whether the interrupt key ended the search; the values are then the best so far, and not credible.
    """

    place: KeptFit
    chi_square: float
    freedom: int
    converged: bool = True
    stopped: bool = False


@dataclass(frozen=True, eq=False)
class Calibration(Named[FittedValue]):
    """The result of a fit; it changed nothing.

    Parameters
    ----------
    stage : str                 Name of the stage, or of the model.
    given_model : Model         The model as it was given, without the fitted values; `model` has them.
    values : FittedValues       Parameters and sensors' constant errors, with their joint covariance, as fitted: they draw the curves.
                                Indexing, `to_frame` and `covariance` give `estimates`, the ones to quote.
    local : tuple of Local      What was fitted per record.
    blocks : sequence of Block  Measured and predicted readings, per record and sensor; predicted when they are first looked at.
    correlations : dict         (path, path) -> correlation, those above 0.1.
    warnings : tuple of str     What a reader must know.
    experiments : tuple         The records bound to the model.
    request : Request           What was asked; None for a calibration that no fit of this session made.
    problem : Problem           Its weighted residuals, with the noise that was used.
    moved : Moves               What the logs say of values of the stages below: moved, not rejected, or that they cannot decide.
    autocorrelation : Autocorrelation or None   Of the residuals.
    own : Standing              How far the fit may be trusted by itself.
    rests : dict                Who gave values that the fit rests on (``stage 'name'``) -> their standing.
    verdict : Standing or None  What failed verdicts on it make of it.
    store : Store               Everything known of the model's values, at every depth.
    end : FitEnd or None        How its search ended; None where values are set by hand.
    expected : dict             Value -> (value, standard error) if elements depart from their laws, by the model of error; nothing where
                                the residuals ask for no departures, or none explains them. `estimates` puts them before the fitted
                                values. [SI]
    unexplained : str           What of the readings no departure of a possible size explains, in words; then the fitted values stand,
                                with errors by what departures would move them.
    """

    stage: str
    given_model: Model
    values: FittedValues
    local: tuple[Local, ...]
    blocks: Sequence[SensorTrace]
    correlations: Mapping[tuple[str, str], float]
    warnings: tuple[str, ...]
    experiments: tuple[Experiment, ...] = field(default=(), repr=False)
    request: Request | None = field(default=None, repr=False)
    problem: Problem | None = field(default=None, repr=False)
    moved: Moves = field(default_factory=Moves)
    autocorrelation: Autocorrelation | None = field(default=None, repr=False)
    store: Store = field(default_factory=Store, repr=False)
    own: Standing = UNJUDGED
    rests: Mapping[str, Standing] = field(default_factory=dict)
    verdict: Standing | None = None
    end: FitEnd | None = field(default=None, repr=False)
    expected: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    unexplained: str = ""

    @property
    def bias(self) -> dict[str, float]:
        """Sensor -> constant error used. [K]"""
        held = self.problem.fixed_bias if self.problem is not None else {}
        return {**held, **{sensor: v.value for sensor, v in self.values.sensors.items()}}

    @property
    def records(self) -> Mapping[str, str]:
        """Record -> checksum of its samples."""
        records: Mapping[str, str] = self.values.provenance.get("records", {})
        return records

    @property
    def synthetic(self) -> bool:
        """Whether any record was made and not measured."""
        return bool(self.values.provenance.get("synthetic", False))

    @property
    def used_records(self) -> Mapping[str, str]:
        """Checksum -> who used it: this stage's records and those of the stages below."""
        return {**(self.request.seen if self.request is not None else {}), **self.store.seen}

    @property
    def loss(self) -> str:
        """The loss."""
        return self.request.loss if self.request is not None else "linear"

    @property
    def fitted(self) -> Mapping[str, float]:
        """Unknown -> its fitted form at the end."""
        return self.end.place.fitted if self.end is not None else {}

    @property
    def evaluations(self) -> int:
        """How often the records were simulated."""
        return self.end.place.evaluations if self.end is not None else 0

    @property
    def search(self) -> str:
        """What was looked at beyond one descent; empty for nothing."""
        return self.end.place.search if self.end is not None else ""

    @property
    def chi_square(self) -> float:
        """Weighted sum of squares of the data. [-]"""
        return self.end.chi_square if self.end is not None else 0.0

    @property
    def freedom(self) -> int:
        """Samples less unknowns. [-]"""
        return self.end.freedom if self.end is not None else 0

    @property
    def converged(self) -> bool:
        """Whether the minimisation ended by its own tolerances."""
        return self.end is None or self.end.converged

    @property
    def stopped(self) -> bool:
        """Whether the interrupt key ended the search; the values are then the best so far, and not credible."""
        return self.end is not None and self.end.stopped

    @property
    def structural_errors(self) -> bool:
        """Whether the errors of its values count what the structure may lack."""
        return bool(self.expected or self.unexplained)

    @property
    def structure_key(self) -> str:
        """What the names of the sources begin with by which its errors count departures of elements."""
        return f"{self.request.fit_key[:16] if self.request else self.stage}:structure"

    @property
    def standing(self) -> Standing:
        """How far the fit may be trusted: by itself, by the worst of the values that it rests on, and by verdicts."""
        return Standing.worst([self.own, *self.rests.values(), *([self.verdict] if self.verdict is not None else [])])

    def judged(self, rests: Mapping[str, Standing], verdict: Standing | None) -> Self:
        """Return the fit with what verdicts made of it and of what it rests on; its values say the same."""
        judged_fit = replace(self, rests=rests, verdict=verdict)
        now = {**rests, f"stage '{self.stage}'": judged_fit.standing}
        return replace(judged_fit, values=self.values.judged(judged_fit.standing), store=self.store.judged(now))

    @cached_property
    def model(self) -> Model:
        """The model with the fitted values laid over it."""
        return self.given_model.with_values(self.values.assignments, f"stage '{self.stage}'")

    @property
    def exact(self) -> str:
        """What the fit held and has no spread, in words; empty for nothing."""
        return f"counted as exact: {without_spread(bare, '')}; min and max only bound a search" if (bare := _bracketed(self)) else ""

    @property
    def clocks(self) -> dict[str, str]:
        """Record and name -> value with its error in words, of offsets and rates of clocks that were found."""
        return {f"{i.record}: {i.name}": i.words for i in self.local if i.unit == "s" or i.name.startswith("clock rate")}

    @property
    def instrument_errors(self) -> dict[str, float]:
        """Channel -> constant error that was found for a logged boundary [K] or power (a share of it): reading minus truth."""
        return {p.removesuffix(" error"): v.value for p, v in self.values.items() if v.kind == INPUT}

    @property
    def reduced_chi_square(self) -> float:
        """Weighted sum of squares per degree of freedom; 1 when model and noise are right. [-]"""
        return self.chi_square / max(self.freedom, 1)

    @property
    def contradicted(self) -> Mapping[str, str]:
        """Value -> what would have to be wrong, of those over ten deviations from an accuracy or prior: do not use the fit then.

        A power counts as it was fitted too: where elements depart it may agree, since heat that comes late or a film that is another makes
        up for it, at the cost of the values that are expected. Sensors take up what a structure lacks, so they do not.
        """
        unknowns = self.problem.unknowns if self.problem is not None and self.end is not None else ()
        return (
            contradicted({n: v for n, v in self.values.items() if v.kind == INPUT and v.unit != "K"})
            | contradicted(self.estimates)
            | contradicted_powers(unknowns, [self.fitted[u.name] for u in unknowns])
        )

    @property
    def contradicts_held(self) -> bool:
        """Whether its logs put a value of a stage below, which it held, more than ten standard errors from what that stage found."""
        far = (m for m in self.moved.values if m.verdict == MOVED and abs(m.deviations) > CONTRADICTION_DEVIATIONS)
        return any(m.path not in self.values for m in far)

    @property
    def blame(self) -> str:
        """What to look for where the fit contradicts what was stated; empty where it does not."""
        return blame_of(self.experiments) if self.contradicted else ""

    @cached_property
    def estimates(self) -> FittedValues:
        """Values and errors to quote, with covariance: as the model of error expects them where the readings ask for it, else as fitted.

        What only a fitted value errs by, `EXPECTED` and `AS_FITTED`, is no part of that covariance.
        """
        at = self.expected
        if not at:
            return self.values
        items = {
            p: replace(v, value=at[p][0], error=at[p][1], error_random=min(v.error_random, at[p][1]), uncut=0.0) if p in at else v
            for p, v in self.values.items()
        }
        rows = self.store.rows(items)[:, [EXPECTED not in s.name and AS_FITTED not in s.name for s in self.store.sources]]
        covariance = np.where(np.isfinite(self.values.covariance), rows @ rows.T, self.values.covariance)
        return replace(self.values, items_=items, covariance=covariance, sense="to quote")

    @property
    def inputs(self) -> InputTable:
        """Every boundary, load and start of every record with its source, what is assumed first; empty where no log was fitted."""
        if self.request is None or self.problem is None:
            return InputTable()
        return InputTable.of_request(self.request, self.experiments, self.problem.unknowns)

    def _sums(self) -> list[tuple[str, str, Sums]]:
        """Return record, sensor and the sums of its residuals; of blocks that were not predicted yet, as the fit left them."""
        if isinstance(self.blocks, Predictions):
            return list(self.blocks.sums)
        return [(b.record, b.sensor, Sums.of_residuals(b.residuals)) for b in self.blocks]

    @property
    def effective_samples(self) -> Mapping[tuple[str, str], float]:
        """(record, sensor) -> independent samples that its readings are worth."""
        return self.autocorrelation.effective_samples if self.autocorrelation is not None else {}

    @property
    def statistics(self) -> dict[str, dict[str, SensorStatistics]]:
        """Record -> sensor -> statistics."""
        out: dict[str, dict[str, SensorStatistics]] = {}
        for record, sensor, sums in self._sums():
            out.setdefault(record, {})[sensor] = sums.statistics(self.bias.get(sensor, 0.0), self.effective_samples.get((record, sensor)))
        return out

    @property
    def sensors(self) -> dict[str, SensorStatistics]:
        """Sensor -> statistics over all records together."""
        parts: dict[str, list[Sums]] = {}
        effective: dict[str, float] = {}
        for record, sensor, sums in self._sums():
            parts.setdefault(sensor, []).append(sums)
            effective[sensor] = effective.get(sensor, 0.0) + self.effective_samples.get((record, sensor), sums.count)
        return {n: pooled(several).statistics(self.bias.get(n, 0.0), effective[n]) for n, several in parts.items()}

    def sensor_bias(self, sensor: str) -> tuple[float, float | None]:
        """Return the constant error of a sensor, fitted or held, and the standard error of a fitted one. [K]"""
        fitted = self.values.sensors.get(sensor)
        return (self.sensors[sensor].bias, None) if fitted is None else (fitted.value, fitted.error)

    def median_rmse(self, sensor: str) -> float:
        """Return the median over records of a sensor's RMSE. [K]"""
        return float(np.median([s[sensor].rmse for s in self.statistics.values() if sensor in s]))

    _refusal = "'{}' was not fitted."

    def _entries(self) -> Mapping[str, FittedValue]:
        """Return every value as it is to be quoted, see `estimates`; `values` has it as fitted."""
        return self.estimates

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write all that is known of the model's values, at every depth, with errors and origins, to a file of its own."""
        save_store(self.store, path, self.stage)

    def report(self) -> str:
        """Return the fit as text."""
        return str(self)

    def __str__(self) -> str:
        """Return values with random and total errors, statistics per sensor, correlations and warnings."""
        if not self.records:
            return _by_hand(self)
        fitted = {p: v for p, v in self.values.items() if v.kind in ("parameter", "level")}
        samples = sum(s.samples for s in self.sensors.values())
        kind = " (synthetic data)" if self.synthetic else ""
        free, channels = counted(len(fitted), "free parameter"), counted(len(self.sensors), "channel")
        records = f" in {len(self.records)} records" if len(self.records) > 1 else ""
        counts = f"{free}, {samples} samples of {channels}{records}{kind}"
        standing_text = self.standing.line(self.stage) + (f". {self.blame}" if self.contradicted else "")
        lines = [f"{self.stage}: {counts}"] if self.standing.fair else [f"{self.stage}: {standing_text}", f"  {counts}"]
        lines += [f"  {w}" for w in self.warnings if w.startswith(FIRST)]
        lines += [f"  {line}" for line in input_lines(self.inputs.assumed)]
        width = max((len(p) for p in fitted), default=0)
        why = "the structure" if any(s.name.startswith(self.structure_key) for s in self.store.sources) else "constant errors, priors"
        lines += [f"  {_value_line(v, width, self.estimates[v.path], self.range_shares(v.path), why)}" for v in fitted.values()]
        lines += [f"  {v.path}: shares its value with {', '.join(v.also)}" for v in fitted.values() if v.also]
        lines += [f"  cut from the other instances of its deck: {place}" for place in cuts_of(self.given_model)]
        lines += _known_lines(self.store, {*self.values.assignments}, width)
        lines += [f"  {self.exact}"] if self.exact else []
        for name, s in self.sensors.items():
            white = "yes" if s.white else f"no (lag-1 {s.lag_one:.2f})"
            worth = f", effective sample size {short(s.effective_samples)}" if s.wanders else ""
            held = f"   bias {s.bias:+.2f} K (held)" if s.bias else ""
            bias = f"   bias {v.value:+.2f} +- {short(v.error)} K" if (v := self.estimates.sensors.get(name)) is not None else held
            sizes = f"RMSE {short(s.rmse, 3)} K   largest {short(abs(s.largest), 3)} K"
            lines.append(f"  {name}: {sizes}   residuals white: {white}{worth}{bias}")
        lines += [f"  {share}" for share in (*self.sensor_shares, *self.instrument_shares)]
        if self.local:
            lines.append("  per record:")
            lines += [f"    {i.record}: {i.name} {i.words}" for i in self.local]
        if self.correlations:
            pairs = sorted(self.correlations.items(), key=lambda item: -abs(item[1]))[:10]
            lines.append("  correlations: " + "; ".join(f"{a} ~ {b} {c:+.2f}" for (a, b), c in pairs))
        lines += self.moved.lines()
        lines.append(f"  reduced chi-square {short(self.reduced_chi_square, 3)}; {counted(self.evaluations, 'evaluation')}")
        lines += [f"  search: {self.search}"] if self.search else []
        lines += [f"  warning: {w}" for w in self.warnings if not w.startswith((LOUD, FIRST))]
        return "\n".join(lines)

    _frame_of_rows = True

    def _summary(self) -> str:
        """Return stage, standing, and the sensor that is met worst."""
        worst = max(self.sensors.items(), key=lambda item: item[1].rmse, default=None)
        worst_text = f", worst sensor {worst[0]}, RMSE {short(worst[1].rmse, 2)} K" if worst is not None else ""
        kind = ", synthetic data" if self.synthetic else ""
        return f"{self.stage}: {self.standing.state}, {counted(len(self.values.parameters), 'value')} fitted{worst_text}{kind}"

    def range_shares(self, path: str) -> dict[str, float]:
        """Return what only a stated range tells -> its part of the variance of a fitted value, the largest first. [-]"""
        return range_shares(self.store, path) if path in self.store.states else {}

    @property
    def covariance(self) -> dict[str, dict[str, float]]:
        """Path -> path -> covariance of the values (not logarithms) of parameters to quote; constant errors are left out. [SI]"""
        items = self.estimates.items_
        slopes = [v.value if v.log else 1.0 for v in items.values()]
        table = self.estimates.covariance * np.outer(slopes, slopes)
        positions = [(k, p) for k, p in enumerate(items) if items[p].kind == "parameter"]
        return {p: {q: float(table[k, m]) for m, q in positions} for k, p in positions}

    def _as_rows(self) -> list[Row]:
        """Return the values to quote with their standard errors, in their units, and as fitted where that differs."""
        return [
            {"path": v.path, "value": v.in_unit, "error": v.shown(v.error), "unit": v.unit, "start": v.converted(v.start), "kind": v.kind}
            | ({"fitted": self.values[v.path].in_unit, "fitted error": v.shown(self.values[v.path].error)} if self.expected else {})
            for v in self.estimates.values()
        ]

    def _as_traces(self) -> Sequence[PlottedTrace]:
        """Return measured readings of every sensor as points, and what the model says of them."""
        out = []
        for b in self.blocks:
            name = f"{b.sensor}, {b.record}" if len(self.records) > 1 else b.sensor
            out.append(PlottedTrace(f"{name} measured", b.times, b.measured - ICE_POINT, measured=True, channel=name))
            out.append(PlottedTrace(f"{name} simulated", b.times, b.predicted - ICE_POINT, channel=name))
        return out

    @property
    def sensor_shares(self) -> tuple[SensorShare, ...]:
        """Return what the constant error of every sensor that has an accuracy does: to which parameter most, and its share of that one.

        The parameter is that whose error it sets most. The share is C_pb^2 / (C_pp C_bb) [-] of parameter p and constant error b in their
        joint covariance C, fitted form; below `WORTH` there is no parameter. With it the accuracy and the largest range of readings of a
        record. [K]
        """
        swings: dict[str, float] = {}
        accuracy: dict[str, float] = {}
        for e in self.experiments:
            for o in e.observations:
                swings[o.sensor] = max(swings.get(o.sensor, 0.0), float(np.ptp(o.measured)) if o.measured.size else 0.0)
                accuracy[o.sensor] = o.accuracy or 0.0
        order = list(self.values)
        out = []
        for sensor in self.values.sensors:
            best, share = _largest_contributor(self, order.index(f"sensor {sensor}"))
            if accuracy.get(sensor):
                out.append(SensorShare(sensor, accuracy[sensor], swings[sensor], best, share))
        return tuple(out)

    @property
    def instrument_shares(self) -> tuple[InstrumentShare, ...]:
        """Return what the scales and lags that were looked for mean for a fit; shares as in `sensor_shares`."""
        out = []
        for j, (name, v) in enumerate(self.values.items()):
            if v.kind == "instrument" and v.prior is not None:
                mean, sd = v.prior
                stated = (float(np.exp(mean)), float(np.exp(mean)) * sd) if v.log else (mean, sd)
                out.append(InstrumentShare(name, v.unit, stated, (v.value, v.error), *_largest_contributor(self, j)))
        return tuple(out)


def _value_line(v: FittedValue, width: int, estimate: FittedValue, ranges: Mapping[str, float], why: str) -> str:
    """Return the line of a fitted value: the estimate to quote, number and errors of the fit, bounds, and `why` its error is wide."""
    total, random = v.shown(v.error), v.shown(v.error_random)
    low, high = (v.converted(b) if np.isfinite(b) else b for b in v.bounds)
    bounds = f", bounds {low:.4g} .. {high:.4g}" if np.isfinite(low) or np.isfinite(high) else ""
    wider = f" ({why})"
    share, first = sum(ranges.values()), next(iter(ranges), "")
    if share >= MIN_RANGE_SHARE:
        more = f" and {len(ranges) - 1} more" if len(ranges) > 1 else ""
        wider = f" ({100 * share:.0f} % of its variance from uncertain values of the deck: {first}{more})"
    what = wider if total > 1.05 * random else ""
    fitted, errors = digits(v.in_unit, random), f"random +- {short(random)}   total +- {short(total)}{what}"
    if estimate is not v:
        error = v.shown(estimate.error)
        fitted, errors = digits(estimate.in_unit, error), f"+- {short(error)}   (the curves have {fitted}, {errors.replace('   ', ', ')})"
    return f"{v.path:<{width}}  {fitted:>12} {v.unit:<10}  {errors}   start {v.converted(v.start):.5g}{bounds}"


def _by_hand(fit: Calibration) -> str:
    """Return a stage without records as text."""
    width = max((len(p) for p in fit.store.parameters), default=0)
    lines = [f"{fit.stage}: {counted(len(fit.values), 'value')} tuned by hand", *_known_lines(fit.store, set(), width)]
    return "\n".join([*lines, *(f"  warning: {w}" for w in fit.warnings)])


def _known_lines(store: Store, own_paths: set[str], width: int) -> list[str]:
    """Return a line for each value of another stage."""
    return [f"  {_known_line(s, store, width)}" for s in store.parameters.values() if not own_paths & {*s.paths}]


def _known_line(s: State, store: Store, width: int) -> str:
    """Return a value of another stage, who gave it, and where it does not act."""
    value, error = from_si(s.value, s.unit), store.error(s.path) / float(unit(s.unit).factor)
    sure = f"   total +- {short(error)}" if np.isfinite(error) and error > 0 else ""
    where = f", hidden at {', '.join(s.hidden)}" if s.hidden else ""
    how = "tuned by hand" if s.origin.kind == "hand" else "fixed"
    twins = f"; acts at {', '.join(s.acts[1:])} too" if len(s.acts) > 1 else ""
    return f"{s.path:<{width}}  {digits(value, error):>12} {s.unit:<10}{sure} ({s.origin}, {how}{where}{twins})"


WORTH = 0.05
"""Share of a variance from which it is worth a word."""


@dataclass(frozen=True)
class SensorShare:
    """The constant error of a sensor beside what it measured.

    Parameters
    ----------
    sensor : str
    accuracy : float    Standard deviation of its constant error before the fit. [K]
    rise : float        Between its lowest and highest reading in a record, the largest of all records. [K]
    parameter : str     The parameter whose error it sets most; empty for none worth a word.
    share : float       Of the variance of that parameter, what would be gone if the constant error were known. [-]
    """

    sensor: str
    accuracy: float
    rise: float
    parameter: str
    share: float

    def __str__(self) -> str:
        """Return it as a sentence."""
        part = f"is {100 * self.accuracy / self.rise:.2g} % of its rise of {self.rise:.2g} K" if self.rise > 0 else "met no rise"
        sets = f", and sets {100 * self.share:.0f} % of the variance of {self.parameter}" if self.parameter else ""
        return f"constant error of {self.sensor}: {self.accuracy:.2g} K (accuracy) {part}{sets}"


def _largest_contributor(fit: Calibration, j: int) -> tuple[str, float]:
    """Return the parameter whose error an unknown at position `j` sets most, and its share of the variance; nothing below `WORTH`."""
    order, best, share = list(fit.values), "", WORTH
    for path in fit.values.parameters:
        k = order.index(path)
        size = fit.values.covariance[k, k] * fit.values.covariance[j, j]
        share_of_path = float(fit.values.covariance[k, j] ** 2 / size) if size > 0 and np.isfinite(size) else 0.0
        best, share = (path, share_of_path) if share_of_path > share else (best, share)
    return best, share if best else 0.0


@dataclass(frozen=True)
class InstrumentShare:
    """The error of a sensor's scale, or its lag, as it was stated and as the fit found it.

    Parameters
    ----------
    name : str              ``scale of T1``, ``lag of T1``.
    unit : str              Of the numbers: 1 for a scale, s for a lag.
    stated : (float, float) Mean and standard deviation before the fit.
    found : (float, float)  After it.
    parameter : str         The parameter whose error it sets most; empty for none worth a word.
    share : float           Of the variance of that parameter, what would be gone if it were known. [-]
    """

    name: str
    unit: str
    stated: tuple[float, float]
    found: tuple[float, float]
    parameter: str
    share: float

    def __str__(self) -> str:
        """Return it as a sentence."""
        factor, unit = (100.0, "%") if self.unit == "1" else (1.0, self.unit)
        before, after = (f"{factor * mean:.3g} +- {factor * sd:.2g} {unit}" for mean, sd in (self.stated, self.found))
        sets = f", and sets {100 * self.share:.0f} % of the variance of {self.parameter}" if self.parameter else ""
        return f"{self.name}: {before} as stated, {after} found{sets}"


def fitted_values(fits: Any, where: str) -> tuple[FittedValues, ...]:
    """Return what one or several fits found: as they are, of a `Calibration`, or from the paths of files.

    Raises
    ------
    DeckError   When one is neither, or its file is no values file.
    """
    out = []
    for v in fits if isinstance(fits, Sequence) and not isinstance(fits, str) else [fits]:
        if isinstance(v, str | PathLike):
            v = load_values(v)
        elif isinstance(v, Calibration):
            v = replace(v.values, store=v.store)
        if not isinstance(v, FittedValues):
            raise DeckError(
                f"values of a fit are needed, not {v!r:.60}. Give a Calibration, or the path of a values file.",
                where,
                code="value.wrong-kind",
            )
        out.append(v)
    return tuple(out)
