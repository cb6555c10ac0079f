"""`predict_record`: what fitted values say of a logged run, with the band of every reading: how far off, how much inside, where worst.

The band is that of a reading: what the prediction does not know, what the run's own fitted values (its room, its start, its clock) have
followed of that, the constant error of the sensor, and the noise of one reading.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from statistics import NormalDist
from typing import Any

import numpy as np

from thermid.base.results import PlottedTrace, Result
from thermid.base.units import TEMPERATURE, Array, from_si
from thermid.fit.calibration import Calibration, Experiment, LocalSpec, Reading, Request, as_found, fit as fitted_to
from thermid.fit.error_model import (
    BALANCE,
    BandCause,
    BesideRow,
    ErrorModel,
    OwnValue,
    RecordRun,
    errors_of_values,
    own_value,
    own_values_kept,
    problem_of_record,
    shared_with,
    split,
)
from thermid.measure.records import Record
from thermid.model.tree import UNJUDGED, Constant, Standing, literal
from thermid.prediction._budget import AVERAGED, Budget, as_built, budget_of, first_line, in_order
from thermid.prediction._known import Knowledge, rows_of
from thermid.prediction._predict import Prediction, between_ways, parted, predicted, shares
from thermid.prediction._setting import Setting, prepared
from thermid.simulation.runs import Scenario
from thermid.values.store import LeftOut, error_table_of

WORST_STRETCH_SHARE = 0.1
"""Length of the stretch that is named as the worst, in lengths of the record. [-]"""
SAME_TEMPERATURE = 1e-6
"""Difference below which two given temperatures are one. [K]"""
LEVELS = (0.5, 0.8, 0.9, 0.95, 0.99)
"""Nominal shares that are compared with those observed."""
READING = "noise of a reading"
"""Cause, as a reader is told it."""


@dataclass(frozen=True)
class WorstStretch:
    """The tenth of a record that lies furthest outside its band.

    Parameters
    ----------
    sensor : str
    begin, end : float  [s]
    inside : float      Share of its readings that lie inside. [-]
    rmse : float        [K]
    """

    sensor: str
    begin: float
    end: float
    inside: float
    rmse: float

    def __str__(self) -> str:
        """Return it in words."""
        span = f"{self.begin / 60:.3g} to {self.end / 60:.3g} min"
        return f"{self.sensor} from {span}: {100 * self.inside:.0f} % inside, centre off by {self.rmse:.2g} K RMS"


@dataclass(frozen=True, eq=False)
class SensorBand:
    """The readings of a sensor beside what was predicted of them.

    Parameters
    ----------
    sensor, node : str
    times : array (readings,)               [s]
    measured, predicted : array (readings,) Predicted holds the sensor's constant error, and what is expected of the run's room. [K]
    parts : dict                            Cause -> variance (readings,). [K^2]
    """

    sensor: str
    node: str
    times: Array
    measured: Array
    predicted: Array
    parts: Mapping[str, Array]

    @property
    def error(self) -> Array:
        """Standard error (readings,) of one reading about its prediction. [K]"""
        return np.asarray(np.sqrt(np.sum([np.zeros(self.times.size), *self.parts.values()], axis=0)))

    def half_width(self, level: float = 0.95) -> Array:
        """Return half the width (readings,) of the band that holds a reading with a probability. [K]"""
        return NormalDist().inv_cdf(0.5 + level / 2) * self.error

    def inside(self, level: float = 0.95) -> float:
        """Return the share of readings inside the band of a level. [-]"""
        return float(np.mean(np.abs(self.measured - self.predicted) <= self.half_width(level)))

    @property
    def rmse(self) -> float:
        """Root mean square of measured less predicted: of the centre of the band. [K]"""
        return float(np.sqrt(np.mean((self.measured - self.predicted) ** 2)))

    @property
    def interval_score(self) -> float:
        """Mean width of the 95 % band and 40 times what lies outside; smaller is better (Gneiting and Raftery 2007, eq. 43). [K]"""
        half = self.half_width()
        return float(np.mean(2.0 * half + 2.0 / 0.05 * np.maximum(np.abs(self.measured - self.predicted) - half, 0.0)))

    @property
    def worst(self) -> WorstStretch:
        """The stretch [s] of `WORST_STRETCH_SHARE` of the record with the fewest readings inside; of several that of largest RMSE [K]."""
        off, half = self.measured - self.predicted, self.half_width()
        span = max(WORST_STRETCH_SHARE * float(self.times[-1] - self.times[0]), 0.0)
        edges = np.arange(float(self.times[0]), float(self.times[-1]) - 0.5 * span + 1e-9, 0.5 * span) if span > 0 else self.times[:1]
        stretches = []
        for begin in edges:
            at = (self.times >= begin) & (self.times <= begin + span)
            if at.any():
                share, size = float(np.mean(np.abs(off[at]) <= half[at])), float(np.sqrt(np.mean(off[at] ** 2)))
                stretches.append(WorstStretch(self.sensor, float(begin), float(begin + span), share, size))
        return min(stretches, key=lambda s: (s.inside, -s.rmse))


@dataclass(frozen=True, eq=False)
class RecordPrediction(Result):
    """A logged run as it was predicted.

    Parameters
    ----------
    title, record : str             What was predicted, and the record.
    bands : dict                    Sensor -> SensorBand.
    fitted_locally : tuple of str   What was fitted to this record.
    warnings : tuple of str         What a reader must know.
    left_out : tuple of LeftOut     What the bands do not count.
    standing : Standing             Of the values that it rests on.
    """

    title: str
    record: str
    bands: Mapping[str, SensorBand]
    fitted_locally: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    left_out: tuple[LeftOut, ...] = ()
    standing: Standing = UNJUDGED

    @property
    def rmse(self) -> float:
        """Root mean square of measured less predicted, each sensor weighing the same. [K]"""
        return float(np.sqrt(np.mean([b.rmse**2 for b in self.bands.values()])))

    def inside(self, level: float = 0.95) -> float:
        """Return the share of readings inside the band of a level, each sensor weighing the same. [-]"""
        return float(np.mean([b.inside(level) for b in self.bands.values()]))

    @property
    def coverage(self) -> dict[float, float]:
        """Nominal share -> the share observed. [-]"""
        return {level: self.inside(level) for level in LEVELS}

    @property
    def worst(self) -> WorstStretch:
        """The worst stretch of all sensors."""
        return min((b.worst for b in self.bands.values()), key=lambda s: (s.inside, -s.rmse))

    def _as_traces(self) -> list[PlottedTrace]:
        """Return predicted and measured readings of every sensor, with the 95 % band. [degC]"""
        shown = [(n, b.times, from_si(b.predicted, "degC"), from_si(b.measured, "degC"), b.half_width()) for n, b in self.bands.items()]
        predicted = [PlottedTrace(f"{n} predicted", t, mean, mean - half, mean + half, channel=n) for n, t, mean, _, half in shown]
        return predicted + [PlottedTrace(n, t, readings, measured=True, channel=n) for n, t, _, readings, _ in shown]

    def to_dict(self) -> dict[str, Any]:
        """Return everything but the traces as plain numbers."""

        def plain(b: SensorBand) -> dict[str, Any]:
            """Return the band of a sensor as JSON holds it."""
            return {
                "node": b.node,
                "rmse_K": b.rmse,
                "inside": b.inside(),
                "half_width_K": float(b.half_width().mean()),
                "interval_score_K": b.interval_score,
                "shares": _shares(b),
            }

        worst = self.worst
        return {
            "title": self.title,
            "record": self.record,
            "standing": self.standing.to_dict(),
            "rmse_K": self.rmse,
            "inside": self.inside(),
            "coverage": {f"{level:g}": share for level, share in self.coverage.items()},
            "worst": {"sensor": worst.sensor, "begin_s": worst.begin, "end_s": worst.end, "inside": worst.inside, "rmse_K": worst.rmse},
            "sensors": {s: plain(b) for s, b in self.bands.items()},
            "fitted_locally": list(self.fitted_locally),
            "left_out": [{"what": x.what, "kelvin": x.kelvin if np.isfinite(x.kelvin) else None} for x in self.left_out],
            "warnings": list(self.warnings),
        }

    @property
    def lines(self) -> tuple[str, ...]:
        """A line per sensor, and the worst stretch."""
        width = max(len(s) for s in self.bands)
        out = []
        for name, b in self.bands.items():
            causes = ", ".join(f"{c} {100 * s:.0f} %" for c, s in sorted(_shares(b).items(), key=lambda x: -x[1]) if s >= 0.05)
            out.append(
                f"{name:<{width}}  RMSE {b.rmse:.3g} K, {100 * b.inside():.0f} % of the readings inside the 95 % band of "
                f"+- {float(b.half_width().mean()):.2g} K, from {causes}"
            )
        return (*out, f"worst stretch: {self.worst}")

    def __str__(self) -> str:
        """Return it as text."""
        error = float(np.mean([b.error.mean() for b in self.bands.values()]))
        missing = first_line(self.left_out, error)
        condition = f", with {', '.join(self.fitted_locally)} fitted to this record" if self.fitted_locally else ""
        shares = ", ".join(f"{100 * level:g} % band {100 * share:.0f} %" for level, share in self.coverage.items())
        lines = [*([missing] if missing else []), f"{self.title} on {self.record}: predicted{condition}", *(f"  {x}" for x in self.lines)]
        return self.standing.over("\n".join([*lines, f"  readings inside: {shares}", *(f"  warning: {w}" for w in self.warnings)]))


def _shares(b: SensorBand) -> dict[str, float]:
    """Return cause -> share of the mean variance of a band; zeros where that is zero. [-]"""
    return shares({c: float(v.mean()) for c, v in b.parts.items()})


def record_request(
    calibration: Calibration,
    record: Record,
    scenario: Scenario | None = None,
    local: Mapping[str, Any] | None = None,
    readings: Mapping[str, Any] | None = None,
    window: float = 0.0,
) -> Request:
    """Return the request that runs a record with all values fixed where they are to be quoted; arguments as in `predict_record`."""
    quoted = replace(calibration, values=calibration.estimates)
    return Request(
        quoted.model,
        (as_found(record, quoted.values, quoted.bias),),
        scenarios={"*": scenario} if scenario else {},
        local={k: LocalSpec.read(v, f"local.{k}") for k, v in (local or {}).items()},
        held_bias=quoted.bias,
        held_errors=quoted.instrument_errors,
        window=window,
        name=calibration.stage,
        fit_start=False,
        readings={n: Reading.read(r, f"readings.{n}") for n, r in (readings or {}).items()},
    )


def predict_record(
    calibration: Calibration,
    record: Record,
    *,
    scenario: Scenario | None = None,
    local: Mapping[str, Any] | None = None,
    readings: Mapping[str, Any] | None = None,
    window: float = 0.0,
    without: Sequence[str] = (),
) -> RecordPrediction:
    """Prediction of a logged run, with its readings beside the bands.

    Parameters
    ----------
    calibration : Calibration   The fit; its values and its instruments' constant errors are held.
    record : Record             The log.
    scenario : Scenario         What the log does not say.
    local : dict                Values fitted to this record, as in `calibrate`; the bands count what they follow.
    readings : dict             Boundary or ``initial.<node>`` -> channel whose first reading stands there, or ``{channel, offset}``.
    window : float              First readings are medians over this time. [s]
    without : sequence          Sources that are not counted, as in `predict`.
    """
    shown = fitted_to(record_request(calibration, record, scenario, local, readings, window))
    return record_bands(calibration, shown, without)


def record_bands(calibration: Calibration, shown: Calibration, without: Sequence[str] = ()) -> RecordPrediction:
    """Return the bands of a record that was run at the values of a fit.

    Parameters
    ----------
    calibration : Calibration   The fit.
    shown : Calibration         The run of the record at its values; what was fitted to it are values of its own.
    without : sequence          Sources that are not counted, as in `predict`.
    """
    assert shown.problem is not None
    assert shown.request is not None
    e, knowledge = shown.problem.experiments[0], Knowledge(shown.request.model, fit=calibration)
    budget = budget_of(knowledge, e.bare, without=without)
    values_of_run, open_ = own_values(shown, e, own_values_kept(knowledge.provenances))
    local = {u.name: float(shown.fitted[u.name]) for u in shown.problem.unknowns}
    below = Budget.of_rows(rows_of(knowledge), knowledge.model, e.bare).below(knowledge.errors)
    laws = {n: (mean, sd) for n, (mean, sd, _) in values_of_run.items()}
    # value -> how it follows the sources of a budget
    used = np.flatnonzero(below.gain.any(axis=0))
    named = ((n, t, row[used]) for t, row in zip(below.targets, below.gain, strict=True) for n in (t.name, *t.also))
    run = {b.sensor: b.predicted for b in shown.blocks}
    left_out = tuple(x for x in budget.omitted if not x.listed)
    if calibration.problem is None:
        as_scenario = predicted(budget, [b.node for b in shown.blocks], times=np.unique(np.concatenate([b.times for b in shown.blocks])))
        bands, left_out = _untested(calibration, as_scenario, shown), as_scenario.left_out
    else:
        bands = _banded(calibration, shown, local, laws, {n: BesideRow(row, t.form == "log") for n, t, row in named if row.any()}, without)
        bands = _switched(bands, budget, run) if e.network.switches else bands
    listed = (
        [LeftOut(f"the temperature of {', '.join(open_)}, which is assumed: no fit shows how it differs between runs")] if open_ else []
    )
    omitted = in_order((*left_out, *listed))
    locally = tuple(dict.fromkeys(i.name for i in shown.local))
    return RecordPrediction(calibration.stage, e.record.name, bands, locally, budget.remarks, omitted, calibration.standing)


def _untested(calibration: Calibration, as_scenario: Prediction, shown: Calibration) -> dict[str, SensorBand]:
    """Return the bands of readings of a run by a stage without a fit: its scenario's prediction, noise and error of each instrument."""
    out = {}
    assert shown.problem is not None
    observed = {o.sensor: o for o in shown.problem.experiments[0].observations}
    for b in shown.blocks:
        of_node, o, name = as_scenario[b.node], observed[b.sensor], f"sensor {b.sensor}"
        moved = np.interp(b.times, of_node.times, of_node.kelvin - of_node.simulated)
        parts = {c: np.interp(b.times, of_node.times, v) for c, v in of_node.parted.parts.items() if v.any()}
        instrument = calibration.store.error(name) if name in calibration.store.states else o.accuracy or 0.0
        of_reading = {READING: o.sigma(shown.problem.noise) ** 2, BandCause.INSTRUMENT: instrument**2}
        for cause, variance in of_reading.items():
            parts[cause] = parts.get(cause, 0.0) + np.full(b.times.size, variance)
        out[b.sensor] = SensorBand(b.sensor, b.node, b.times, b.predicted + b.residuals, b.predicted + moved, parts)
    return out


def _switched(bands: dict[str, SensorBand], budget: Budget, run: Mapping[str, Array]) -> dict[str, SensorBand]:
    """Return the bands of readings of a run that temperatures switch: mean and variance of members; as they are where nothing switches.

    What the run's own room and start follow is then not taken off. `run` has what sensors read at the values to quote. [K]
    """
    times = np.unique(np.concatenate([b.times for b in bands.values()]))
    if not Setting.of_budget(budget.weighted_ways[0][1], prepared(budget, times=times)).switches:
        return bands
    by_node, out = predicted(budget, [b.node for b in bands.values()], times=times), {}
    for name, b in bands.items():
        of_node = by_node[b.node]
        moved, variance = (np.interp(b.times, times, v) for v in (of_node.kelvin - of_node.simulated, of_node.error**2))
        parts = parted({c: v for c, v in b.parts.items() if c != READING}, variance) | {READING: b.parts[READING]}
        out[name] = replace(b, predicted=run[name] + moved, parts=parts)
    return out


def _banded(
    calibration: Calibration,
    shown: Calibration,
    local: Mapping[str, float],
    values_of_run: Mapping[str, tuple[float, float]],
    below: Mapping[str, BesideRow],
    without: Sequence[str],
) -> dict[str, SensorBand]:
    """Return the band of every sensor of a record that was run at the values of a fit.

    Parameters
    ----------
    local : dict        What was fitted to the record, by the names of its unknowns -> its value. [K]
    values_of_run : dict  Boundary or ``initial.<node>`` -> mean and standard deviation of what it is off by in a further run. [K]
    below : dict        Value -> how it follows sources of unit variance that the fit does not know.
    """
    assert shown.request is not None
    error_table = error_table_of(calibration.values.provenance)
    errors = ErrorModel.from_dict(error_table) if error_table is not None else errors_of_values(calibration)
    problem = problem_of_record(calibration, shown.request, values_of_run, below)
    shared = shared_with(calibration, problem) & {*errors.seen}
    ways = [(w, RecordRun.of_record(w, problem, shared, local)) for w in errors.ways]
    weights = np.array([w.weight for w, _ in ways])
    centres_and_parts = [run.parts(w) for w, run in ways]
    centres = np.array([centre for centre, _ in centres_and_parts])
    variances = {
        source: sum(w * parts.get(source, 0.0) for w, (_, parts) in zip(weights, centres_and_parts, strict=True))
        for source in centres_and_parts[0][1]
    }
    for cause, variance in between_ways(weights, centres, [(as_built(w),) for w in errors.ways]).items():
        variances[cause] = variances.get(cause, 0.0) + variance
    sensors = [run.centres(w.mean, run.traces) for w, run in ways]
    off = {
        READING,
        *({BandCause.UNEXPLAINED} if "misfit" in without else ()),
        *({BandCause.STRUCTURE, BandCause.RUN, BandCause.ROOM, BandCause.START, AVERAGED} if "structural" in without else ()),
        *without,
    }
    out = {}
    for i, o in enumerate(problem.experiments[0].observations):
        trace, rows = ways[0][1].traces[i], ways[0][1].means[i]
        at = {s: np.interp(trace.times, rows.times, split(v, ways[0][1].means)[i]) for s, v in variances.items() if s not in off}
        centre = o.measured + weights @ np.array([c[i] for c in sensors])
        parts = {s: v for s, v in at.items() if v.any()} | {READING: trace.noise**2}
        out[o.sensor] = SensorBand(o.sensor, o.seat, trace.times, o.measured, centre, parts)
    return out


def own_values(
    shown: Calibration, e: Experiment, values_of_runs: Sequence[OwnValue]
) -> tuple[dict[str, tuple[float, float, int]], list[str]]:
    """Return room or start of a run -> mean and sd of what it is off by [K], and from how many runs; and rooms of which no fit says it.

    Those that were fitted or logged are left out.
    """
    request = shown.request
    assert request is not None
    find = e.network.find
    taken = {i.name for i in shown.local} | {find(c.target or c.name) for c in e.record.channels.values() if c.role == "boundary"}
    rules = {e.wired(n): r for n, r in request.readings.items()}
    scenario = request.scenario(e.record)
    texts = {f"initial.{find(n)}": str(t) for n, t in scenario.initial.items() if isinstance(t, str)}
    open_ = []
    out: dict[str, tuple[float, float, int]] = {}
    rooms = [b for b in e.scenario.boundaries if b in e.network.boundaries and isinstance(e.scenario.boundaries[b], Constant)]
    hidden = {f"initial.{n}" for n in e.hidden}
    first = e.first_readings(request.window)
    for name in dict.fromkeys([*rooms, *(n for n in (*texts, *rules, *sorted(hidden)) if n.startswith("initial."))]):
        rule = rules.get(name)
        start = rule.channel if rule is not None else texts.get(name, "") or _assumed(values_of_runs, name, e.scenario)
        start = BALANCE if name in hidden else start
        value_of_run = own_value(values_of_runs, name, start) if name not in taken else None
        if value_of_run is None:
            if name in rooms and name not in taken:
                open_.append(f"'{name}'")
            continue
        if rule is not None and rule.offset:  # how far the first reading stands from the room is known already
            value_of_run = OwnValue(name, start, 0.0, value_of_run.sd, value_of_run.runs)
        out[name] = (*value_of_run.expected_from(first), value_of_run.runs)
    return out, open_


def _assumed(values_of_runs: Sequence[OwnValue], name: str, scenario: Scenario) -> str:
    """Return the text of the temperature that a scenario gives a boundary, where the runs of a fit were assumed to have the same."""
    boundary = scenario.boundaries.get(name)
    for text in dict.fromkeys(o.start for o in values_of_runs if o.name == name and "[" in o.start):
        if isinstance(boundary, Constant) and abs(literal(text, TEMPERATURE) - boundary.value) < SAME_TEMPERATURE:
            return text
    return ""
