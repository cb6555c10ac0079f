"""From a request to the residuals over its unknowns: parameters, local values, constant errors, and where each of them acts."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from numbers import Real
from typing import Any

import numpy as np

from thermid.base.errors import IdentificationError, RecordError, nearest, refuse_unknown
from thermid.base.units import TEMPERATURE, Kelvin, require
from thermid.fit._problem.experiment import (
    BETWEEN_SAMPLES,
    CLOCK,
    LAST_INSTANT,
    OFFSET,
    RATE,
    SCALE,
    SOME_SAMPLE,
    SWITCH,
    UNKNOWN_START_SD,
    Experiment,
    first_reading,
    gain_of,
    lag_of,
)
from thermid.fit._problem.request import Request, known_before, mean_of
from thermid.fit._problem.residuals import Influence, Prior, Problem, Unknown, starting_point
from thermid.measure.records import Record, SecondClock, SensorPart
from thermid.model.tree import Constant, ParameterSet, StatedRange, TableSignal
from thermid.values.store import INPUT, RangedValue, read_spread

MAX_SEPARATE_STARTS = 10
"""Nodes without a sensor in a record up to which each has a start of its own; of more, those with the same neighbours move together."""


def build_problem(request: Request) -> Problem:
    """Return the residuals of a request.

    Raises
    ------
    RecordError             Without records, or with two of one name.
    IdentificationError     When a prior, a weight or a reading names nothing.
    """
    where = request.name or request.model.title
    if not request.records:
        raise RecordError("a calibration needs at least one record.", where, code="record.nothing-there")
    names = [r.name for r in request.records]
    twice = sorted({n for n in names if names.count(n) > 1})
    if twice:
        raise RecordError(f"two records are named '{twice[0]}'.", where, code="name.taken")
    refuse_unknown(request.scenarios, (*names, "*"), where, "a scenario is given for '{}', which is not a record of this fit.")
    experiments = tuple(
        Experiment.bind(request.model, r, request.scenario(r), request.window, request.weights, request.held_errors)
        for r in request.records
    )
    sensors = {o.sensor for e in experiments for o in e.observations}
    for sensor, weight in request.weights.items():
        refuse_unknown([sensor], sensors, where, "a weight is given for '{}', which is not a sensor of this fit.", IdentificationError)
        if not (isinstance(weight, Real) and math.isfinite(weight) and weight > 0):
            raise IdentificationError(
                f"the weight of '{sensor}' must be above zero. To leave a sensor out, ignore it.", where, code="value.outside-range"
            )
    return problem_of(request, experiments)


def with_idle_ranges(request: Request) -> Request:
    """Return a request that names the stated ranges on which no reading depends, of those that the stages below found values beside.

    A joint that was found in air beside the gap of a deck is known in air to a few per cent, and in vacuum as badly as the gap. So a prior
    holds a value beside an input only where the fit has that input too: where one standard deviation of it moves all readings together by
    less than that of their noise, |J s| < 1 with J the derivatives of the weighted residuals at the start, it has not.

    Raises
    ------
    RecordError, IdentificationError    As `build_problem`.
    SolverError                         When a record cannot be run.
    """
    if not request.prior:
        return request
    problem = build_problem(request)
    before = known_before(request, problem.unknowns)
    names = {s.name for s, rows, held in zip(before.sources, before.rows.T, before.held, strict=True) if held and rows.any()}
    free = {t.name for u in problem.unknowns for t in u.targets}
    ranges = RangedValue.of_fit(request.model, ParameterSet(request.model), free) if names else ()
    ranges = [r for r in ranges if names & {s.name for s, _ in r.columns}]
    if not ranges:
        return request
    opened = [_parameter((r.path, *r.also), problem.experiments) for r in ranges]
    wide = replace(problem, unknowns=(*problem.unknowns, *opened), coupled=())
    slopes = wide.compressed(starting_point(wide.unknowns)).slopes[:, len(problem.unknowns) :]
    sizes = [r.law(u.start).variance ** 0.5 / u.slope(u.to_fitted(u.start)) for r, u in zip(ranges, opened, strict=True)]
    idle = np.linalg.norm(slopes * sizes, axis=0) < 1.0
    return replace(request, idle_ranges=tuple(s.name for r, unmoved in zip(ranges, idle, strict=True) if unmoved for s, _ in r.columns))


def problem_of(request: Request, experiments: Sequence[Experiment], opened: Sequence[Sequence[str]] = ()) -> Problem:
    """Return the residuals of a request whose records are bound to its model already.

    `opened` are fixed values that become unknowns too, each as the paths where it acts; the first one names it.
    """
    unknowns = [
        *_parameters(request, experiments),
        *(_parameter(group, experiments) for group in opened),
        *_locals(request, experiments),
        *clock_unknowns(experiments),
        *_nuisances(request, experiments),
        *instant_unknowns(experiments),
    ]
    starts = [_starts(request, e) for e in experiments]
    unknowns = _read_starts(request, experiments, _reaching(unknowns, starts, request.held_bias))
    settled = tuple(_settled(request, e, s) for e, s in zip(experiments, starts, strict=True))
    below = known_before(request, unknowns)
    coupled = ((below.at, below.mean, below.root),) if below.at.size else ()
    noise = {o.sensor: 1.0 for e in experiments for o in e.observations}
    return Problem(settled, tuple(unknowns), noise, request.options, dict(request.held_bias), coupled)


def _parameters(request: Request, experiments: Sequence[Experiment]) -> list[Unknown]:
    """Return the freed parameters, those that come from a stage below with their covariance among them."""
    flat = experiments[0].network.flat
    wanted = [*request.free, *(q for p in request.prior for q in request.store.states[p].acts)]
    priors = {flat.parameters.freeable(k, request.model.canonical): v for k, v in request.priors.items()}
    ranges, inherited = flat.parameters.stated_ranges, {q for p in request.prior for q in request.store.states[p].acts}
    shared = request.shared
    unknowns: dict[str, Unknown] = {}
    taken: set[str] = set()
    for raw in wanted:
        path = flat.parameters.freeable(raw, request.model.canonical)
        if path in taken:
            continue
        group = tuple(p for p in shared.get(path, (path,)) if flat.parameters.table[p].parameter.is_literal)
        taken |= set(group)
        unknown = _parameter(group, experiments)
        if path in priors:
            unknown = replace(unknown, prior=prior_of(unknown, priors.pop(path)))
        elif path in ranges and not inherited & {*group}:
            unknown = replace(unknown, prior=prior_of(unknown, ("", ranges[path])))
        unknowns[path] = unknown
    for path in priors:
        raise IdentificationError(
            f"a prior is given for '{path}', which is not free.{nearest(path, unknowns)}", request.name, code="fit.nothing-free"
        )
    return list(unknowns.values())


def _parameter(group: Sequence[str], experiments: Sequence[Experiment]) -> Unknown:
    """Return the unknown that the value of one or several paths is; the first path names it."""
    path, *also = group
    parameters = experiments[0].network.flat.parameters
    targets = tuple(Influence(i, p) for i in range(len(experiments)) for p in group)
    value, of = parameters.evaluate({}, [path])[path], parameters.bounded(path)
    form = of.form(path, parameters.dimension(path), value)
    return Unknown(path, "parameter", targets, value, *form, unit=of.unit or "1", also=tuple(also))


def prior_of(unknown: Unknown, prior: tuple[Any, Any] | Mapping[str, Any]) -> Prior:
    """Return a prior in the fitted form of an unknown.

    Stated is a mean (none: the start) with a deviation, as texts with units, or a range about the start, or what `read_spread` takes.
    """
    if not isinstance(prior, Mapping) and isinstance(prior[1], StatedRange):
        return Prior(unknown.to_fitted(unknown.start), prior[1].log_sd(unknown.start) if unknown.log else prior[1].sd)
    where = f"priors.{unknown.name}"
    slot = TEMPERATURE if unknown.unit in ("degC", "degF") else unknown.unit
    table = prior if isinstance(prior, Mapping) else ({"mean": prior[0]} if mean_of(prior) else {}) | {"sd": prior[1]}
    law = read_spread(table, slot, unknown.start, where)
    if law.variance <= 0 or (unknown.log and law.mean <= 0):
        raise IdentificationError(
            "a prior needs a standard deviation above zero, and a mean above zero for a positive quantity.",
            where,
            code="value.outside-range",
        )
    sd = math.sqrt(law.variance)
    return Prior(math.log(law.mean), sd / law.mean) if unknown.log else Prior(law.mean, sd)


def _locals(request: Request, experiments: Sequence[Experiment]) -> list[Unknown]:
    """Return one unknown per record and local name, and one per node that starts at its own reading."""
    out = []
    for i, experiment in enumerate(experiments):
        named = set()
        for raw, spec in request.locals_of(experiment.record).items():
            name = experiment.wired(raw)
            if isinstance(experiment.scenario.boundaries.get(name), TableSignal):
                raise IdentificationError(
                    f"'{raw}' follows a channel of {experiment.record.name}, so it has no local value. "
                    "Ignore the channel, or give it an accuracy.",
                    f"local.{raw}",
                    code="fit.nothing-free",
                )
            named.add(name)
            start = request.local_start(experiment.record, raw)
            prior = Prior(start, spec.sd) if math.isfinite(spec.sd) else None
            targets = (Influence(i, name), *(Influence(i, tip) for tip in _tips(experiment, name)))
            out.append(Unknown(f"{experiment.record.name}: {name}", "local", targets, start, prior=prior, unit="degC"))
        for node in experiment.loose if request.fit_start else ():
            name, start = f"initial.{node}", float(experiment.scenario.initial[node])
            if name not in named:
                targets = (Influence(i, name), *(Influence(i, tip) for tip in _tips(experiment, name)))
                prior = Prior(start, UNKNOWN_START_SD)
                out.append(Unknown(f"{experiment.record.name}: {name}", "local", targets, start, prior=prior, unit="degC"))
        out += _hidden(i, experiment, named) if request.fit_start else []
        sought = {target for target, _ in experiment.shared.values()} if request.held_errors is None else set()
        out += [_mean(i, experiment, name, sd, name in sought) for name, sd in experiment.means.items() if name not in named]
    return out


def _mean(i: int, experiment: Experiment, name: str, sd: float, instrument: bool) -> Unknown:
    """Return the error of the mean of a boundary [K] or power (relative) in one record; that of an `instrument` may act there too.

    `sd` is its standard deviation, in the same unit.
    """
    power = name.startswith(SCALE)
    target = Influence(i, name, 1.0 if power and not instrument else 0.0, 1.0)
    label = f"{experiment.record.name}: error of the mean of {name.removeprefix(SCALE)}"
    return Unknown(label, "local", (target,), 0.0, prior=Prior(0.0, sd), unit="1" if power else "K")


def _hidden(i: int, experiment: Experiment, named: Collection[str]) -> list[Unknown]:
    """Return one unknown per node without a sensor, about the balance of its neighbours; of many, one per group of neighbours.

    The starts of a group are ``mean + z sd`` with one standard normal z.
    """
    starts = {n: h for n, h in experiment.hidden.items() if f"initial.{n}" not in named}
    record = experiment.record.name
    if len(starts) <= MAX_SEPARATE_STARTS:
        return [
            Unknown(f"{record}: initial.{n}", "local", (Influence(i, f"initial.{n}"),), h.mean, prior=Prior(h.mean, h.sd), unit="degC")
            for n, h in starts.items()
        ]
    groups: dict[tuple[str, ...], list[str]] = {}
    for n, h in starts.items():
        groups.setdefault(h.neighbours, []).append(n)
    return [
        Unknown(
            f"{record}: initial.{nodes[0]} and {len(nodes) - 1} more, in standard deviations",
            "local",
            tuple(Influence(i, f"initial.{n}", starts[n].mean, starts[n].sd) for n in nodes),
            0.0,
            prior=Prior(0.0, 1.0),
        )
        for nodes in groups.values()
    ]


def _tips(experiment: Experiment, name: str) -> list[str]:
    """Return the starts of the sensors that sit on the node of a start."""
    return [f"initial.{tip}" for tip, seat in experiment.tips.items() if name == f"initial.{seat}"]


def _nuisances(request: Request, experiments: Sequence[Experiment]) -> list[Unknown]:
    """Return the constant errors of sensors, and those of logged boundaries and powers, one per instrument: reading minus truth.

    A meter's accuracy is in watts and its error is looked for as a share of the reading, so the record with the largest power says its
    uncertainty.
    """
    if request.held_errors is not None:
        return []
    sensors: dict[str, float] = {}
    shared: dict[str, tuple[float, list[Influence]]] = {}
    for i, experiment in enumerate(experiments):
        sensors |= {o.sensor: o.accuracy for o in experiment.observations if o.accuracy and o.sensor not in request.held_bias}
        for sensor, (target, sd) in experiment.shared.items():
            smallest_sd, targets = shared.get(sensor, (math.inf, []))
            shared[sensor] = (min(sd, smallest_sd), [*targets, Influence(i, target, 1.0 if target.startswith(SCALE) else 0.0, -1.0)])
    out = []
    for sensor, sd in sensors.items():
        out.append(Unknown(f"sensor {sensor}", "sensor", (), 0.0, prior=Prior(0.0, sd), unit="K"))
    for sensor, (sd, targets) in shared.items():
        unit_of_error = "1" if targets[0].name.startswith(SCALE) else "K"
        out.append(Unknown(f"{sensor} error", INPUT, tuple(targets), 0.0, prior=Prior(0.0, sd), unit=unit_of_error))
    return out + instruments(experiments)


@dataclass(frozen=True)
class _Start:
    """A temperature that stands on first readings: sensors with reading and turn of their scale, and what is added to the mean."""

    readings: tuple[tuple[str, float, float], ...]
    offset: str
    shift: float

    def mean(self, errors: Mapping[str, float]) -> float:
        """Return the mean of the readings less the known errors of their sensors. [K]"""
        return sum(reading - errors.get(sensor, 0.0) for sensor, reading, _ in self.readings) / len(self.readings)


def _starts(request: Request, experiment: Experiment) -> dict[str, _Start]:
    """Return name in the wiring -> the first readings that stand there."""
    readings: dict[str, tuple[tuple[str, ...], str]] = {f"initial.{node}": ((sensor,), "") for node, sensor in experiment.readings.items()}
    if not request.fit_start:
        readings |= {f"initial.{node}": (sensors, "") for node, sensors in experiment.loose.items()}
    readings |= {experiment.wired(raw): ((r.channel,), r.offset) for raw, r in request.readings.items()}
    readings |= {tip: readings[name] for name in tuple(readings) for tip in _tips(experiment, name)}
    for raw in request.locals_of(experiment.record):
        for name in (experiment.wired(raw), *_tips(experiment, experiment.wired(raw))):
            readings.pop(name, None)
    out = {}
    parameters = experiment.network.flat.parameters
    for name, (sensors, offset) in readings.items():
        shift, path = 0.0, ""
        if offset:
            path = parameters.freeable(offset, request.model.canonical)
            require(parameters.dimension(path), "K", parameters.table[path].parameter.unit)
            shift = float(parameters.evaluate({})[path])
        parts = [experiment.record.channels[sensor].part for sensor in sensors]
        read = [
            (sensor, first_reading(experiment.record, sensor, request.window), part.gain_about if part is not None else 0.0)
            for sensor, part in zip(sensors, parts, strict=True)
        ]
        out[name] = _Start(tuple(read), path, shift)
    return out


def _reaching(unknowns: Sequence[Unknown], starts: Sequence[Mapping[str, _Start]], held: Mapping[str, float]) -> list[Unknown]:
    """Return the unknowns, each acting also on the temperatures that stand on its sensor's first reading, or that it is added to.

    The value is the mean of reading - constant error, + offset; what is not looked for stands in the first target's constant.
    """
    sensors = {u.name.removeprefix("sensor "): k for k, u in enumerate(unknowns) if u.kind == "sensor"}
    parameters = {u.name: k for k, u in enumerate(unknowns) if u.kind == "parameter"}
    scales = {u.name: k for k, u in enumerate(unknowns) if u.kind == "instrument" and not u.log}
    more: dict[int, list[Influence]] = {}
    for i, named in enumerate(starts):
        for name, s in named.items():
            count = len(s.readings)
            acts = [(sensors.get(sensor), -1.0 / count) for sensor, _, _ in s.readings]
            acts += [(parameters.get(s.offset), 1.0)]
            acts += [(scales.get(gain_of(sensor)), (about - reading) / count) for sensor, reading, about in s.readings]
            acting = [(k, factor) for k, factor in acts if k is not None]
            constant = s.mean({n: e for n, e in held.items() if n not in sensors}) + (0.0 if s.offset in parameters else s.shift)
            for k, factor in acting:
                more.setdefault(k, []).append(Influence(i, name, constant, factor))
                constant = 0.0
    return [replace(u, targets=(*u.targets, *more.get(k, ()))) for k, u in enumerate(unknowns)]


def _read_starts(request: Request, experiments: Sequence[Experiment], unknowns: Sequence[Unknown]) -> list[Unknown]:
    """Return the unknowns, constant errors of instruments acting also on starts that are known from their readings.

    The unknown of such a start is what the instrument would read there: the temperature is that less the instrument's error, one for all
    starts that are read from it.
    """
    more: dict[str, list[Influence]] = {}
    for i, e in enumerate(experiments):
        for raw, spec in request.locals_of(e.record).items():
            if math.isfinite(spec.sd):
                names = (e.wired(raw), *_tips(e, e.wired(raw)))
                acts = more.setdefault(spec.start, [])
                acts += [Influence(i, n, 0.0, -1.0) for n in names]
    acting = {name: acts for channel, acts in more.items() for name in (f"sensor {channel}", f"{channel} error")}
    return [replace(u, targets=(*u.targets, *acting.get(u.name, ()))) for u in unknowns]


def _settled(request: Request, experiment: Experiment, starts: Mapping[str, _Start]) -> Experiment:
    """Return the experiment with every temperature that stands on a reading corrected by what is known."""
    boundaries, initial = {}, {}
    for name, start in starts.items():
        value = start.mean(request.held_bias) + start.shift
        if name.startswith("initial."):
            initial[name.removeprefix("initial.")] = Kelvin(value)
        else:
            boundaries[name] = Constant(value)
    return replace(experiment, scenario=experiment.scenario.with_(boundaries=boundaries, initial=initial))


def instruments(experiments: Sequence[Experiment]) -> list[Unknown]:
    """Return one unknown per scale and per lag that is not known exactly, acting in every record that its sensor reads.

    Parameters
    ----------
    experiments : sequence  The records, bound to the model.
    """
    parts: dict[str, tuple[SensorPart, list[Influence]]] = {}
    for i, experiment in enumerate(experiments):
        for o in experiment.observations:
            if o.part is not None and o.part.gain_accuracy:
                parts.setdefault(gain_of(o.sensor), (o.part, []))[1].append(Influence(i, f"reading.{o.sensor}"))
            if o.part is not None and o.part.lag_accuracy and o.lag:
                parts.setdefault(lag_of(o.sensor), (o.part, []))[1].append(Influence(i, o.lag))
    out = []
    for name, (part, targets) in parts.items():
        scale = targets[0].name.startswith("reading.")
        mean, sd = (0.0, part.gain_accuracy) if scale else (part.lag, part.lag_accuracy)
        prior = Prior(mean, sd) if scale else Prior(math.log(mean), sd / mean)
        out.append(Unknown(name, "instrument", tuple(targets), mean, log=not scale, prior=prior, unit="1" if scale else "s"))
    return out


def clock_suffix(record: Record, clock: SecondClock) -> str:
    """Return the end of the names of a clock's unknowns: its log, where a record has several clocks."""
    return f" of {clock.log}" if len(record.clocks) > 1 and clock.log != record.name else ""


def clock_unknowns(experiments: Sequence[Experiment]) -> list[Unknown]:
    """Return offset and rate of every second clock that is known within a range only."""
    out = []
    for i, e in enumerate(experiments):
        for n, ticks in enumerate(e.ticks):
            c, of = ticks.clock, clock_suffix(e.record, ticks.clock)
            for name, place, (low, high), at, unit in (
                (c.offset_is, OFFSET, c.offset, c.at[0], "s"),
                ("clock rate", RATE, c.rate, c.at[1], "1"),
            ):
                if low < high:
                    acts = (Influence(i, f"{CLOCK} {n} {place}"),)
                    out.append(Unknown(f"{e.record.name}: {name}{of}", "local", acts, at, low=low, high=high, unit=unit))
    return out


def instant_unknowns(experiments: Sequence[Experiment]) -> list[Unknown]:
    """Return when held inputs changed, in intervals from their middles: what all changes of a logger have in common, and each beside it."""
    out, last = [], LAST_INSTANT
    for i, e in enumerate(experiments):
        suffixes = {n: clock_suffix(e.record, clock) for clock in e.record.clocks for n in clock.channels}
        groups: dict[tuple[str, bool], list[tuple[str, Influence]]] = {}
        for x in e.instants:
            alike = groups.setdefault((suffixes.get(x.channel, ""), x.stated), [])
            alike.append((f"{x.row} of {x.path}", Influence(i, x.name)))
        for (of, stated), alike in groups.items():
            every, (common, single) = ("all", BETWEEN_SAMPLES) if stated else ("every", SOME_SAMPLE)
            parts = [(every, tuple(act for _, act in alike), common), *((name, (act,), single) for name, act in alike)]
            for name, acts, law in parts:
                label = f"{e.record.name}: {SWITCH} {name}{of}"
                out.append(Unknown(label, "local", acts, 0.0, low=-last, high=last, prior=Prior(*law)))
    return out
