"""`calibrate`: records and free names in, a `Calibration` out, or a refusal that says why."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thermid.errors import IdentificationError, RecordError, ThermidError, nearest
from thermid.identify.calibration import Calibration
from thermid.identify.experiment import Experiment, first_reading, meet
from thermid.identify.inherit import handed_on
from thermid.identify.refusals import refuse_after, refuse_before
from thermid.identify.residuals import Problem
from thermid.identify.solve import covariances, ended, minimise
from thermid.identify.summary import summarise
from thermid.identify.ties import tied
from thermid.identify.unknowns import Prior, Target, Unknown, parameter_unknown
from thermid.identify.values import FittedValues
from thermid.measure import Record
from thermid.model.model import Model
from thermid.model.signal import Constant, literal
from thermid.simulation.engine import Options
from thermid.simulation.scenario import Scenario
from thermid.units import TEMPERATURE

__all__ = ["LocalSpec", "Request", "calibrate", "fit", "problem_for"]

Array = NDArray[np.float64]
Progress = Callable[[int, float], None]
FITTING = Options(tolerance=1e-4, relative=1e-6, input_tolerance=1e-3)
"""A fit needs no more than a fraction of the noise of a sensor; final figures are computed with the same."""


@dataclass(frozen=True)
class LocalSpec:
    """A value that each record has for itself.

    Parameters
    ----------
    start : str     A temperature, or the name of a channel whose first reading stands for it.
    sd : float      Standard deviation of its prior about the start; infinite for none. [K]
    """

    start: str
    sd: float = math.inf

    @classmethod
    def read(cls, given: Any, where: str) -> LocalSpec:
        """Return it from a text or a table with `start` and `sd`."""
        table = given if isinstance(given, Mapping) else {"start": given}
        unknown = set(table) - {"start", "sd"}
        if unknown:
            raise IdentificationError(f"a local value has start and sd, not {', '.join(sorted(unknown))}.", where)
        if "start" not in table:
            raise IdentificationError("a local value needs a start.", where)
        return cls(str(table["start"]), literal(table["sd"], "K", where) if "sd" in table else math.inf)


@dataclass(frozen=True, eq=False)
class Request:
    """Everything that a fit is asked.

    Parameters
    ----------
    model : Model
    records : tuple of Record
    free : tuple of str             Parameter paths.
    scenarios : dict                Record name -> Scenario, for what the logs do not say; key ``*`` for all others.
    local : dict                    Boundary or ``initial.<node>`` -> LocalSpec.
    priors : dict                   Parameter path -> (mean, sd) as texts with units.
    inherited : tuple               FittedValues whose members are free here too, with their covariance as prior.
    held_bias : dict                Sensor -> constant error that is not looked for. [K]
    bias_priors : dict              Sensor -> (mean, sd) of its constant error, from a stage below. [K]
    untie : bool                    Whether instances of one definition get values of their own.
    loss : str
    window : float                  First readings are medians over this time. [s]
    name : str                      Name of the stage.
    readings : dict                 Boundary or node -> channel whose first reading, less its constant error, stands there.
    seen : dict                     Checksum -> who used it, in the stages below.
    remarks : tuple of str          What a reader of the result must know before the fit has begun.
    fit_start : bool                Whether observed nodes' initial temperatures are looked for; else their first readings stand.
    """

    model: Model
    records: tuple[Record, ...]
    free: tuple[str, ...] = ()
    scenarios: Mapping[str, Scenario] = field(default_factory=dict)
    local: Mapping[str, LocalSpec] = field(default_factory=dict)
    priors: Mapping[str, tuple[str, str]] = field(default_factory=dict)
    inherited: tuple[FittedValues, ...] = ()
    held_bias: Mapping[str, float] = field(default_factory=dict)
    bias_priors: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    untie: bool = False
    loss: str = "linear"
    window: float = 0.0
    name: str = ""
    fit_start: bool = True
    remarks: tuple[str, ...] = ()
    seen: Mapping[str, str] = field(default_factory=dict)
    readings: Mapping[str, str] = field(default_factory=dict)
    options: Options = FITTING

    def scenario(self, record: Record) -> Scenario:
        """Return the scenario of a record, with a place for every local boundary."""
        base = self.scenarios.get(record.name, self.scenarios.get("*", Scenario(record.name)))
        boundaries = {n: Constant(self.local_start(record, n)) for n in self.local if not n.startswith("initial.")}
        boundaries |= {n: Constant(first_reading(record, c, self.window)) for n, c in self.readings.items()}
        return base.with_(boundaries=boundaries) if boundaries else base

    def local_start(self, record: Record, name: str) -> float:
        """Return the start of a local value for a record. [K]"""
        text = self.local[name].start
        if text in record.channels:
            return first_reading(record, text, self.window)
        try:
            return literal(text, TEMPERATURE)
        except ThermidError as error:
            hint = nearest(text, record.channels)
            raise IdentificationError(f"'{text}' is no temperature and no channel of {record.name}.{hint} ({error.message})", f"local.{name}") from None


def calibrate(
    model: Model,
    records: Record | Sequence[Record],
    free: Sequence[str],
    *,
    scenario: Scenario | Mapping[str, Scenario] | None = None,
    local: Mapping[str, Any] | None = None,
    priors: Mapping[str, tuple[str, str]] | None = None,
    loss: str = "linear",
    name: str = "",
    progress: Progress | None = None,
) -> Calibration:
    """Return the fit of some parameters of a model to one or several records.

    Parameters
    ----------
    model : Model               What the hardware is.
    records : Record(s)         Logs whose channels are bound to nodes, boundaries, loads or commands.
    free : sequence of str      Paths of the parameters to fit; all others stay as they are.
    scenario : Scenario(s)      What the logs do not say; one for all, or one by record name.
    local : dict                Values that each record has for itself: boundary or ``initial.<node>`` -> ``{start, sd}``.
    priors : dict               Path -> (mean, standard deviation), texts with units.
    loss : str                  linear, soft_l1, huber or cauchy.
    progress : callable         Called with the number of evaluations and the RMS of the weighted residuals.

    Raises
    ------
    IdentificationError   When parameters act only as a product, or a standard error is wider than the bounds; the message says what to do.
    """
    many = (records,) if isinstance(records, Record) else tuple(records)
    scenarios = dict(scenario) if isinstance(scenario, Mapping) else {"*": scenario} if scenario else {}
    specs = {k: LocalSpec.read(v, f"local.{k}") for k, v in (local or {}).items()}
    request = Request(model, many, tuple(free), scenarios, specs, dict(priors or {}), loss=loss, name=name)
    return fit(request, progress)


def fit(request: Request, progress: Progress | None = None, known: Mapping[str, float] | None = None) -> Calibration:
    """Return the calibration that a request asks for; see `calibrate`.

    `known` is the end of the same fit from before, unknown -> fitted form; it is then evaluated and not searched again.
    """
    from threadpoolctl import threadpool_limits

    # the matrices are tall and narrow: more threads only wait for one another
    with threadpool_limits(limits=1):
        return _fit(request, progress, known)


def _fit(request: Request, progress: Progress | None, known: Mapping[str, float] | None) -> Calibration:
    problem = problem_for(request)
    stated = all(o.noise is not None for o in problem.observations())
    if known is not None and list(known) == [u.name for u in problem.unknowns]:
        at = np.array(list(known.values()))
        problem = problem if stated else replace(problem, noise=_measured_noise(problem, at))
        found = ended(problem, at, request.loss)
    else:
        refuse_before(request, problem, lambda r: fit(r))
        found = minimise(problem, request.loss, progress=progress)
        if not stated:
            problem = replace(problem, noise=_measured_noise(problem, found.fitted))
            found = minimise(problem, request.loss, found.fitted, progress)
    total, random = covariances(found, problem)
    refuse_after(request, problem, found, total)
    return summarise(request, problem, found, total, random)


def _measured_noise(problem: Problem, fitted: Array) -> dict[str, float]:
    """Return sensor -> noise: as stated, or the RMS of its residuals where nothing was stated. [K]"""
    stated = {o.sensor: o.noise for o in problem.observations()}
    out: dict[str, float] = {}
    blocks = problem.blocks(fitted)
    for sensor, noise in stated.items():
        if noise is not None:
            out[sensor] = noise
        else:
            left = np.concatenate([b.residuals for b in blocks if b.sensor == sensor])
            out[sensor] = max(float(np.sqrt(np.mean(left**2))), 1e-6)
    return out


def problem_for(request: Request) -> Problem:
    """Return the residuals of a request."""
    if not request.records:
        raise RecordError("a calibration needs at least one record.", request.name or request.model.title)
    names = [r.name for r in request.records]
    twice = sorted({n for n in names if names.count(n) > 1})
    if twice:
        raise RecordError(f"two records are named '{twice[0]}'.", request.name or request.model.title)
    experiments = tuple(meet(request.model, r, request.scenario(r), request.window) for r in request.records)
    unknowns = [*_parameters(request, experiments), *_locals(request, experiments), *_nuisances(request, experiments)]
    coupled = tuple(handed_on(v, unknowns) for v in request.inherited)
    noise = {o.sensor: o.noise or 1.0 for e in experiments for o in e.observations}
    return Problem(experiments, tuple(unknowns), noise, request.options, dict(request.held_bias), coupled)


def _parameters(request: Request, experiments: tuple[Experiment, ...]) -> list[Unknown]:
    """Return the freed parameters, those that come from a stage below with their covariance among them."""
    flat = experiments[0].network.flat
    values = flat.parameters.evaluate({})
    wanted = [*request.free, *(p for v in request.inherited for p in v.parameters)]
    priors = {flat.parameters.freeable(k, request.model.canonical): v for k, v in request.priors.items()}
    unknowns: dict[str, Unknown] = {}
    taken: set[str] = set()
    for raw in wanted:
        path = flat.parameters.freeable(raw, request.model.canonical)
        if path in taken:
            continue
        group = (path,) if request.untie else tied(request.model, flat.parameters, path)
        taken |= set(group)
        targets = [Target(i, p) for i in range(len(experiments)) for p in group]
        given = flat.parameters.table[path].parameter
        unknown = parameter_unknown(path, given, flat.parameters.dimension(path), values[path], targets, None)
        unknowns[path] = replace(unknown, prior=_prior(unknown, priors.pop(path))) if path in priors else unknown
    for path in priors:
        raise IdentificationError(f"a prior is given for '{path}', which is not free.{nearest(path, unknowns)}", request.name)
    return list(unknowns.values())


def _prior(unknown: Unknown, texts: tuple[str, str]) -> Prior:
    """Return a prior in the fitted form of an unknown."""
    slot = TEMPERATURE if unknown.unit in ("degC", "degF") else unknown.unit
    mean = literal(texts[0], slot, f"priors.{unknown.name}")
    sd = literal(texts[1], "K" if slot == TEMPERATURE else slot, f"priors.{unknown.name}")
    if sd <= 0 or (unknown.log and mean <= 0):
        raise IdentificationError("a prior needs a standard deviation above zero, and a mean above zero for a positive quantity.", f"priors.{unknown.name}")
    return Prior(math.log(mean), sd / mean) if unknown.log else Prior(mean, sd)


def _locals(request: Request, experiments: tuple[Experiment, ...]) -> list[Unknown]:
    """Return one unknown per record and local name, and one per node that starts at its own reading."""
    out = []
    for i, experiment in enumerate(experiments):
        named = set()
        for raw, spec in request.local.items():
            head, _, node = raw.partition(".")
            name = f"initial.{experiment.network.find(node)}" if head == "initial" and node else experiment.network.find(raw)
            named.add(name)
            start = request.local_start(experiment.record, raw)
            prior = Prior(start, spec.sd) if math.isfinite(spec.sd) else None
            out.append(Unknown(f"{experiment.record.name}: {name}", "local", (Target(i, name),), start, prior=prior, unit="degC"))
        for node in experiment.loose if request.fit_start else ():
            name, start = f"initial.{node}", float(experiment.scenario.initial[node])
            if name not in named:
                out.append(Unknown(f"{experiment.record.name}: {name}", "local", (Target(i, name),), start, unit="degC"))
    return out


def _nuisances(request: Request, experiments: tuple[Experiment, ...]) -> list[Unknown]:
    """Return the constant errors of sensors, and those of logged boundaries and powers, one per instrument."""
    sensors: dict[str, float] = {}
    starts: dict[str, list[Target]] = {}
    shared: dict[str, tuple[float, list[Target]]] = {}
    for i, experiment in enumerate(experiments):
        for o in experiment.observations:
            if o.accuracy and o.sensor not in request.held_bias:
                sensors[o.sensor] = o.accuracy
        for name, sensor in _starts_by_sensor(request, experiment).items():
            starts.setdefault(sensor, []).append(Target(i, name, first_reading(experiment.record, sensor, request.window), -1.0))
        for sensor, (target, sd) in experiment.shared.items():
            shared.setdefault(sensor, (sd, []))[1].append(Target(i, target))
    out = []
    for sensor, sd in sensors.items():
        mean, spread = request.bias_priors.get(sensor, (0.0, sd))
        out.append(Unknown(f"sensor {sensor}", "sensor", tuple(starts.get(sensor, ())), mean, prior=Prior(mean, spread), unit="K"))
    for sensor, (sd, targets) in shared.items():
        start = 1.0 if targets[0].name.startswith("scale.") else 0.0
        out.append(Unknown(f"{sensor} error", "shared", tuple(targets), start, prior=Prior(start, sd), unit="1" if start else "K"))
    return out


def _starts_by_sensor(request: Request, experiment: Experiment) -> dict[str, str]:
    """Return name in the wiring -> sensor whose first reading, less its constant error, stands there."""
    out = {f"initial.{node}": sensor for node, sensor in experiment.readings.items()}
    out |= {experiment.network.find(name): sensor for name, sensor in request.readings.items()}
    if not request.fit_start:
        own = {o.node: o.sensor for o in experiment.observations}
        out |= {f"initial.{node}": own[node] for node in experiment.loose}
    return out
