"""`Calibration`: what a fit found, how well it is known, and what a reader must be told."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Self

import numpy as np
from numpy.typing import NDArray

from thermid.fit.contradicted import BLAME, FIRST, LOUD, contradicted
from thermid.fit.inputs import InputTable, input_lines, inputs_of
from thermid.fit.problem.residuals import Block, Predictions, Problem
from thermid.fit.problem.statistics import SensorStatistics, Sums, pooled
from thermid.fit.sensors import instrument_shares, sensor_shares
from thermid.fit.uncertainty.moves import Moves
from thermid.knowledge.store import State, Store
from thermid.knowledge.values import FittedValue, FittedValues, save_store
from thermid.measure.amounts import digits, short
from thermid.model.parts.standing import UNJUDGED, Standing, worst
from thermid.model.tree.identity import cuts_of
from thermid.model.tree.model import Model
from thermid.units import counted, unit

if TYPE_CHECKING:
    from thermid.fit.problem.experiment import Experiment
    from thermid.fit.problem.request import Request
    from thermid.fit.problem.residuals import Problem
    from thermid.fit.uncertainty.wander import Wander

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Local:
    """A value fitted for one record alone."""

    record: str
    name: str
    value: float
    error: float
    unit: str = "K"


@dataclass(frozen=True, eq=False)
class Calibration:
    """The result of a fit; it changed nothing.

    Parameters
    ----------
    stage : str                 Name of the stage, or of the model.
    model : Model               The model as it was given.
    values : FittedValues       Parameters and sensors' constant errors, with their joint covariance.
    local : tuple of Local      What was fitted per record.
    blocks : sequence of Block  Measured and predicted readings, per record and sensor; predicted when they are first looked at.
    bias : dict                 Sensor -> constant error used. [K]
    records : dict              Record -> checksum of its samples.
    correlations : dict         (path, path) -> correlation, those above 0.1.
    chi_square : float          Weighted sum of squares of the data. [-]
    freedom : int               Samples less unknowns.
    evaluations : int           How often the records were simulated.
    loss : str                  The loss.
    warnings : tuple of str     What a reader must know.
    synthetic : bool            Whether any record was made and not measured.
    experiments : tuple         The records bound to the model.
    fitted : dict               Unknown -> its fitted form at the end.
    converged : bool            Whether the minimisation ended by its own tolerances.
    request : Request           What was asked; None for a calibration that no fit of this session made.
    problem : Problem           Its weighted residuals, with the noise that was used.
    moved : Moves               What the logs say of values of the stages below: moved, not rejected, or that they cannot decide.
    search : str                What was looked at beyond one descent; empty for nothing.
    seen : dict                 Checksum -> who used it: this stage's records and those of the stages below.
    wander : Wander or None     How the residuals wander.
    own : Standing              How far the fit may be trusted by itself.
    rests : dict                Who gave values that the fit rests on (``stage 'name'``) -> their standing.
    verdict : Standing or None  What failed verdicts on it make of it.
    store : Store               Everything known of the model's values, at every depth.
    """

    stage: str
    model: Model
    values: FittedValues
    local: tuple[Local, ...]
    blocks: Sequence[Block]
    bias: Mapping[str, float]
    records: Mapping[str, str]
    correlations: Mapping[tuple[str, str], float]
    chi_square: float
    freedom: int
    evaluations: int
    loss: str
    warnings: tuple[str, ...]
    synthetic: bool = False
    seen: Mapping[str, str] = field(default_factory=dict)
    experiments: tuple[Experiment, ...] = field(default=(), repr=False)
    fitted: Mapping[str, float] = field(default_factory=dict, repr=False)
    converged: bool = True
    request: Request | None = field(default=None, repr=False)
    problem: Problem | None = field(default=None, repr=False)
    moved: Moves = field(default_factory=Moves)
    wander: Wander | None = field(default=None, repr=False)
    search: str = ""
    store: Store = field(default_factory=Store, repr=False)
    own: Standing = UNJUDGED
    rests: Mapping[str, Standing] = field(default_factory=dict)
    verdict: Standing | None = None

    @property
    def standing(self) -> Standing:
        """How far the fit may be trusted: by itself, by the worst of the values that it rests on, and by verdicts."""
        return worst([self.own, *self.rests.values(), *([self.verdict] if self.verdict is not None else [])])

    def judged(self, rests: Mapping[str, Standing], verdict: Standing | None) -> Self:
        """Return the fit with what verdicts made of it and of what it rests on; its values say the same."""
        made = replace(self, rests=rests, verdict=verdict)
        now = {**rests, f"stage '{self.stage}'": made.standing}
        return replace(made, values=self.values.judged(made.standing), store=self.store.judged(now))

    @property
    def fitted_model(self) -> Model:
        """The model with the fitted values laid over it."""
        return self.model.with_values(self.values.assignments, f"stage '{self.stage}'")

    @property
    def instrument_errors(self) -> dict[str, float]:
        """Channel -> constant error that was found for a logged boundary (added to it [K]) or power (a factor)."""
        return {p.removesuffix(" error"): v.value for p, v in self.values.items() if v.kind == "shared"}

    @property
    def reduced_chi_square(self) -> float:
        """Weighted sum of squares per degree of freedom; 1 when model and noise are right. [-]"""
        return self.chi_square / max(self.freedom, 1)

    @property
    def contradicted(self) -> Mapping[str, str]:
        """Value -> what would have to be wrong, of those over ten deviations from an accuracy or prior: do not use the fit then."""
        return contradicted(self.values)

    @property
    def inputs(self) -> InputTable:
        """Every boundary, load and start of every record with its source, what is assumed first; empty where no log was fitted."""
        if self.request is None or self.problem is None:
            return InputTable()
        return inputs_of(self.request, self.experiments, self.problem.unknowns)

    def _sums(self) -> list[tuple[str, str, Sums]]:
        """Return record, sensor and the sums of its residuals; of blocks that were not predicted yet, as the fit left them."""
        if isinstance(self.blocks, Predictions):
            return list(self.blocks.sums)
        return [(b.record, b.sensor, Sums.of(b.residuals)) for b in self.blocks]

    @property
    def effective(self) -> Mapping[tuple[str, str], float]:
        """(record, sensor) -> independent samples that its readings are worth."""
        return self.wander.effective if self.wander is not None else {}

    @property
    def statistics(self) -> dict[str, dict[str, SensorStatistics]]:
        """Record -> sensor -> statistics."""
        out: dict[str, dict[str, SensorStatistics]] = {}
        for record, sensor, sums in self._sums():
            out.setdefault(record, {})[sensor] = sums.statistics(self.bias.get(sensor, 0.0), self.effective.get((record, sensor)))
        return out

    @property
    def sensors(self) -> dict[str, SensorStatistics]:
        """Sensor -> statistics over all records together."""
        parts: dict[str, list[Sums]] = {}
        worth: dict[str, float] = {}
        for record, sensor, sums in self._sums():
            parts.setdefault(sensor, []).append(sums)
            worth[sensor] = worth.get(sensor, 0.0) + self.effective.get((record, sensor), sums.count)
        return {n: pooled(several).statistics(self.bias.get(n, 0.0), worth[n]) for n, several in parts.items()}

    def median_rmse(self, sensor: str) -> float:
        """Return the median over records of a sensor's RMSE. [K]"""
        return float(np.median([s[sensor].rmse for s in self.statistics.values() if sensor in s]))

    def __getitem__(self, path: str) -> FittedValue:
        """Return one fitted value."""
        return self.values[path]

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
        told = self.standing.line(self.stage) + (f". {BLAME}" if self.contradicted else "")
        lines = [f"{self.stage}: {counts}"] if self.standing.fair else [f"{self.stage}: {told}", f"  {counts}"]
        lines += [f"  {w}" for w in self.warnings if w.startswith(FIRST)]
        lines += [f"  {line}" for line in input_lines(self.inputs.assumed)]
        width = max((len(p) for p in fitted), default=0)
        lines += [f"  {_value_line(v, width)}" for v in fitted.values()]
        lines += [f"  {v.path}: one value with {', '.join(v.also)}" for v in fitted.values() if v.also]
        lines += [f"  cut from its twins: {place}" for place in cuts_of(self.model)]
        lines += _known_lines(self.store, {*self.values.assignments}, width)
        for name, s in self.sensors.items():
            white = "yes" if s.white else f"no (lag-1 {s.lag_one:.2f})"
            worth = f", worth {short(s.effective_samples)} independent samples" if s.wanders else ""
            lines.append(
                f"  {name}: RMSE {short(s.rmse, 3)} K   largest {short(abs(s.largest), 3)} K   residuals white: {white}{worth}"
                + _bias_text(name, self)
            )
        lines += [f"  {share}" for share in (*sensor_shares(self), *instrument_shares(self))]
        if self.local:
            lines.append("  per record:")
            lines += [f"    {i.record}: {i.name} {_local_text(i)}" for i in self.local]
        if self.correlations:
            pairs = sorted(self.correlations.items(), key=lambda item: -abs(item[1]))[:10]
            lines.append("  correlations: " + "; ".join(f"{a} ~ {b} {c:+.2f}" for (a, b), c in pairs))
        lines += self.moved.lines()
        lines.append(f"  reduced chi-square {short(self.reduced_chi_square, 3)}; {counted(self.evaluations, 'evaluation')}")
        lines += [f"  search: {self.search}"] if self.search else []
        lines += [f"  warning: {w}" for w in self.warnings if not w.startswith((LOUD, FIRST))]
        return "\n".join(lines)


def _value_line(v: FittedValue, width: int) -> str:
    total, random = v.shown(v.error), v.shown(v.error_random)
    low, high = (v.converted(b) if np.isfinite(b) else b for b in v.bounds)
    bounds = f", bounds {low:.4g} .. {high:.4g}" if np.isfinite(low) or np.isfinite(high) else ""
    what = " (constant errors, priors)" if total > 1.05 * random else ""
    text = f"{v.path:<{width}}  {digits(v.in_unit, random):>12} {v.unit:<10}  random +- {short(random)}   total +- {short(total)}{what}"
    return f"{text}   start {v.converted(v.start):.5g}{bounds}"


def _by_hand(fit: Calibration) -> str:
    """Return a stage without records as text."""
    width = max((len(p) for p in fit.store.parameters), default=0)
    lines = [f"{fit.stage}: {counted(len(fit.values), 'value')} tuned by hand", *_known_lines(fit.store, set(), width)]
    return "\n".join([*lines, *(f"  warning: {w}" for w in fit.warnings)])


def _known_lines(store: Store, own: set[str], width: int) -> list[str]:
    """Return a line for each value of another stage."""
    return [f"  {_known_line(s, store, width)}" for s in store.parameters.values() if not own & {*s.paths}]


def _known_line(s: State, store: Store, width: int) -> str:
    """Return a value of another stage, who gave it, and where it does not act."""
    of = unit(s.unit)
    value, error = (s.value - float(of.offset)) / float(of.factor), store.error(s.path) / float(of.factor)
    sure = f"   total +- {short(error)}" if np.isfinite(error) and error > 0 else ""
    where = f", hidden at {', '.join(s.hidden)}" if s.hidden else ""
    how = "tuned by hand" if s.origin.kind == "hand" else "fixed"
    return f"{s.path:<{width}}  {digits(value, error):>12} {s.unit:<10}{sure} ({s.origin}, {how}{where})"


def _bias_text(sensor: str, fit: Calibration) -> str:
    found = fit.values.sensors.get(sensor)
    if found is None:
        held = fit.bias.get(sensor, 0.0)
        return f"   bias {held:+.2f} K (held)" if held else ""
    return f"   bias {found.value:+.2f} +- {short(found.error)} K"


def _local_text(i: Local) -> str:
    if i.unit == "degC":
        return f"{i.value - 273.15:.2f} +- {short(i.error)} degC"
    return f"{digits(i.value, i.error)} +- {short(i.error)} {i.unit if i.unit != '1' else ''}".rstrip()
