"""`identifiability`: which parameters a log can tell, which only together, and what would help where it cannot.

`profile`: how far a parameter can go before the readings object, all others following.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thermid.base.errors import IdentificationError, NameNotFoundError, SolverError, foretell, quoted, refuse_unknown, spoken
from thermid.base.linear_algebra import covariance
from thermid.base.results import Named, PlottedTrace, Result
from thermid.base.units import HOUR, Array, counted, from_si
from thermid.fit.calibration import (
    Calibration,
    Compressed,
    Experiment,
    Group,
    Information,
    InputTable,
    LocalSpec,
    Problem,
    Request,
    Unknown,
    build_problem,
    input_lines,
    minimise,
    percent,
    priors_of,
    starting_point,
)
from thermid.inference.planned_records import Sensor, planned_record
from thermid.measure.records import Record
from thermid.model.tree import HeatLoad, Model, Parameter, TableSignal
from thermid.simulation.runs import Scenario, Workers, compile_network, in_tasks

EASY_PRIOR = 0.05
"""A prior that is easily had: 5 %."""
MAX_CURES = 4
HEATER = "heater_of_known_power"
MAX_ERROR_SHARE_LEFT = 0.7
"""A cure is named when it leaves less than this part of the worst error."""


@dataclass(frozen=True)
class Cure:
    """Something that would help.

    Parameters
    ----------
    action : str        What to do.
    errors : dict       Parameter -> relative error that would be left. [-]
    """

    action: str
    errors: Mapping[str, float]

    def __str__(self) -> str:
        """What to do, and what would be known then."""
        return f"{self.action}; expected errors: {', '.join(f'{n} {percent(e)}' for n, e in self.errors.items())}"


def cures(problem: Problem, info: Information, groups: Sequence[Group], doubtful: Sequence[str]) -> tuple[Cure, ...]:
    """Return what would help, the best first: to fix a member of a group or know it to 5 %, or to add a step of known power.

    Parameters
    ----------
    problem : Problem
    info : Information              At the values where it is to be judged.
    groups : sequence of Group      What cannot be separated.
    doubtful : sequence of str      Parameters that are hardly known.
    """
    names = info.names
    wanted = [names.index(p) for p in doubtful]
    before = info.errors()
    out: list[tuple[float, Cure]] = []
    members = dict.fromkeys(n for g in groups for n in g.names if len(g.names) > 1 and n in names)
    for name in members:
        k = names.index(name)
        touched = [j for j in wanted if j != k]
        if info.unknowns[k].kind != "parameter" or not touched:
            continue
        fixed, loose = info.errors(held=[k]), info.errors(more=info.prior_row(k, EASY_PRIOR))
        if _worst(loose, touched) < MAX_ERROR_SHARE_LEFT * _worst(before, touched):
            exact = ", ".join(percent(float(fixed[j])) for j in touched)
            cure = Cure(f"measure '{name}' to 5 % (if it were exact: {exact})", {names[j]: float(loose[j]) for j in touched})
            out.append((_worst(loose, touched), cure))
    out += _pairs(info, list(members), wanted) if not out and len(members) > 2 else []
    step = _known_step(problem, info)
    if step is not None:
        row, words = step
        errors_left = info.errors(more=row)
        if _worst(errors_left, wanted) < MAX_ERROR_SHARE_LEFT * _worst(before, wanted):
            out.append((_worst(errors_left, wanted), Cure(words, {names[j]: float(errors_left[j]) for j in wanted})))
    return tuple(cure for _, cure in sorted(out, key=lambda item: item[0])[:MAX_CURES])


def _worst(errors: Array, at: Sequence[int]) -> float:
    """Return the largest of the relative errors at some places; 0 without places. [-]"""
    return float(np.max(errors[list(at)], initial=0.0))


def _pairs(info: Information, members: Sequence[str], wanted: Sequence[int]) -> list[tuple[float, Cure]]:
    """Return the worst error left [-] and the cure of each pair of `members` that would help if known to 5 %; `wanted` are places."""
    out = []
    places = [info.names.index(n) for n in members if info.unknowns[info.names.index(n)].kind == "parameter"]
    before = info.errors()
    for n, i in enumerate(places):
        for j in places[n + 1 :]:
            touched = [k for k in wanted if k not in (i, j)]
            errors_left = info.errors(more=np.concatenate([info.prior_row(i, EASY_PRIOR), info.prior_row(j, EASY_PRIOR)]))
            if touched and _worst(errors_left, touched) < MAX_ERROR_SHARE_LEFT * _worst(before, touched):
                action = f"measure both {quoted([info.names[i], info.names[j]])} to 5 %"
                out.append((_worst(errors_left, touched), Cure(action, {info.names[k]: float(errors_left[k]) for k in touched})))
    return out


def _known_step(problem: Problem, info: Information) -> tuple[Array, str] | None:
    """Return the derivatives (rows, unknowns) of a repetition of the longest log with an extra known power, and what to do in words.

    None where no load has a power, or the repetition cannot be run.
    """
    lengths = [e.scenario.seconds for e in problem.experiments]
    i = int(np.argmax(lengths))
    step = _stepped(problem.experiments[i])
    if step is None:
        return None
    experiment, load, watts = step
    unknowns = tuple(replace(u, targets=tuple(replace(t, experiment=0) for t in u.targets if t.experiment == i)) for u in problem.unknowns)
    again = replace(problem, experiments=(experiment,), unknowns=unknowns)
    try:
        rows = Information.of_problem(again, info.at, exact=False).data
    except SolverError:
        return None
    hours = lengths[i] / HOUR
    return rows, f"repeat the test of {hours:.3g} h with an extra, known {watts:.3g} W at '{load}' in its second half"


def _stepped(experiment: Experiment) -> tuple[Experiment, str, float] | None:
    """Return an experiment with a heater that gives the power of its largest load once more, known exactly, in the second half."""
    network = experiment.network
    powers = {load.path: (load.node, _power(experiment, load.path)) for load in network.flat.loads if "power" in load.fields}
    name = max(powers, key=lambda path: powers[path][1], default="")
    if not name or not powers[name][1] > 0:
        return None
    node, watts = powers[name]
    model = network.flat.names.model
    assert isinstance(model, Model)  # laid flat was one
    heater = HeatLoad(node, {"power": Parameter.read("1 [W]", HEATER)})
    grown = replace(model, loads={**model.loads, HEATER: heater})
    half = 0.5 * experiment.scenario.seconds
    scenario = experiment.scenario.with_(loads={HEATER: TableSignal(np.array([0.0, half]), np.array([0.0, watts]), True)})
    again = compile_network(grown, media=scenario.media(), prescribed=network.prescribed)
    return replace(experiment, network=again, scenario=scenario), name, watts


def _power(experiment: Experiment, load: str) -> float:
    """Return the largest power of a load over an experiment. [W]"""
    signal = experiment.scenario.loads.get(load)
    if signal is not None:
        return float(np.max(signal.at(np.linspace(0.0, experiment.scenario.seconds, 101))))
    flat = experiment.network.flat
    field = next(row.fields["power"] for row in flat.loads if row.path == load)
    return float(flat.parameters.evaluate({})[field])


MAX_KNOWN_ERROR = 0.1


@dataclass(frozen=True)
class KnownParameter:
    """How well one parameter is known.

    Parameters
    ----------
    name : str              Its path.
    value, error : float    Value and standard error; infinite where nothing is known. [SI]
    relative : float        Error over value. [-]
    alone : float           The same if all others were known. [-]
    limit : str             The other unknown that most of the error comes from; empty where none stands out.
    without : float         Relative error if that one were known. [-]
    unit : str              For people.
    """

    name: str
    value: float
    error: float
    relative: float
    alone: float
    limit: str
    without: float
    unit: str

    def __str__(self) -> str:
        """Value, error, and what limits it."""
        text = f"{self.name} = {from_si(self.value, self.unit):.5g} {self.unit} +- {percent(self.relative)}"
        return f"{text}, mainly from {cause(self.limit)} (without it: {percent(self.without)})" if self.limit else text


def cause(unknown: str) -> str:
    """Return an unknown as the cause of an error.

    >>> cause("sensor T1"), cause("METER error"), cause("skin.area")
    ('the constant error of T1', 'the accuracy of METER', "'skin.area'")
    """
    if unknown.startswith("sensor "):
        return f"the constant error of {unknown.removeprefix('sensor ')}"
    return f"the accuracy of {unknown.removesuffix(' error')}" if unknown.endswith(" error") else f"'{unknown}'"


@dataclass(frozen=True, eq=False)
class Identifiability(Named[KnownParameter]):
    """What readings determine of parameters.

    Parameters
    ----------
    title : str                 Model or stage.
    stage : str                 'planned' (a test that was not made), 'before' or 'after' the fit.
    samples : int               Readings.
    rank : int                  Independent facts about the parameters in the readings, priors of parameters left out.
    parameters : dict           Path -> `KnownParameter`, priors counted.
    groups : tuple of Group     What cannot be separated: structural ones first.
    cures : tuple of Cure       What would help, the best first.
    inputs : InputTable             Every boundary, load and start of every record, with its source.
    """

    title: str
    stage: str
    samples: int
    rank: int
    parameters: Mapping[str, KnownParameter]
    groups: tuple[Group, ...]
    cures: tuple[Cure, ...]
    information: Information = field(repr=False)
    problem: Problem = field(repr=False)
    inputs: InputTable = field(default=InputTable(), repr=False)

    _refusal = "no free parameter '{}'."

    def _entries(self) -> Mapping[str, KnownParameter]:
        """Return parameter -> what is known of it."""
        return self.parameters

    @property
    def structural(self) -> tuple[Group, ...]:
        """Groups that no log of this kind can separate."""
        return tuple(g for g in self.groups if g.structural)

    @property
    def practical(self) -> tuple[Group, ...]:
        """Groups that this log hardly separates, and others could."""
        return tuple(g for g in self.groups if not g.structural)

    def _split_by(self, group: Group) -> str:
        """Return a sentence that names the priors which alone separate the members of a group; empty where none does."""
        info = self.information
        own_priors = [u.name for u in info.unknowns if u.prior is not None and u.kind == "parameter" and u.name in group.names]
        if own_priors:
            return f" Only the prior of {quoted(own_priors)} separates them."
        handed = {info.names[k] for at, _, _ in self.problem.coupled for k in at} & set(group.names)
        return " Only the inherited values of a stage below separate them." if handed else ""

    def to_dict(self) -> dict[str, Any]:
        """Return everything as plain data; infinite errors stay infinite."""
        return {
            "title": self.title,
            "stage": self.stage,
            "samples": self.samples,
            "rank": self.rank,
            "free": len(self.parameters),
            "parameters": {
                p: {k: getattr(v, k) for k in ("value", "error", "relative", "alone", "limit", "without", "unit")}
                for p, v in self.parameters.items()
            },
            "groups": [
                {
                    "names": list(g.names),
                    "structural": g.structural,
                    "form": g.form,
                    "moves": list(g.moves),
                    "known": [{"formula": c.text, "value": c.value, "error": c.error, "unit": c.unit} for c in g.known],
                    "text": str(g),
                }
                for g in self.groups
            ],
            "inputs": self.inputs.to_dict(),
            "cures": [{"action": c.action, "errors": dict(c.errors)} for c in self.cures],
        }

    def __str__(self) -> str:
        """Return the findings as text."""
        when = {
            "planned": "information expected from this test",
            "before": "information expected from these readings",
            "after": "information in these readings",
        }
        free = len(self.parameters)
        lines = [f"{self.title}: {when[self.stage]} on {counted(free, 'parameter')} ({self.samples} readings)"]
        lines += [f"  {line}" for line in input_lines(self.inputs.assumed)]
        if self.rank < free:
            lines.append(f"  The readings determine {counted(self.rank, 'combination')} of {free} parameters.")
        lines += [f"  By measurements of this kind {g}.{self._split_by(g)}" for g in self.structural if g.form != "unseen"]
        lines += [f"  No reading depends on {quoted(g.names)}." for g in self.structural if g.form == "unseen"]
        lines += [f"  With this log {g}." for g in self.practical]
        lines.append("  expected errors:" if self.stage != "after" else "  errors:")
        lines += [f"    {k}" for k in self.parameters.values()]
        if self.cures:
            lines.append("  to improve this:")
            lines += [f"    {c}" for c in self.cures]
        elif not self.groups:
            lines.append("  All parameters can be separated.")
        return "\n".join(lines)

    @staticmethod
    def of_problem(request: Request, stage: str = "before") -> Identifiability:
        """Return what the records of a request tell, at the values where its fit would start; see `identifiability`."""
        problem = build_problem(request)
        start = starting_point(problem.unknowns)
        result = _identifiability_at(request.name or request.model.title, stage, problem, start, 1.0)
        return replace(
            result, inputs=InputTable() if stage == "planned" else InputTable.of_request(request, problem.experiments, problem.unknowns)
        )


def identifiability(
    model: Model | Calibration,
    records: Record | Sequence[Record] = (),
    free: Sequence[str] = (),
    *,
    scenario: Scenario | Mapping[str, Scenario] | None = None,
    sensors: Mapping[str, Any] | None = None,
    every: str | float | None = None,
    local: Mapping[str, Any] | None = None,
    priors: Mapping[str, Any] | None = None,
) -> Identifiability:
    """Return what readings tell of parameters: of a fit that was made, of logs before a fit, or of a test before any log exists.

    Parameters
    ----------
    model : Model or Calibration    A calibration is asked about itself, and nothing else is given.
    records : Record(s)             Logs; none for a planned test.
    free : sequence of str          Paths of the parameters to fit.
    scenario : Scenario(s)          What the logs do not say; of a planned test, all that is done.
    sensors : dict                  Of a planned test: node, boundary or load -> noise as text, or ``{noise, accuracy, name}``.
    every : str or float            Interval of a planned test's readings. [s]
    local, priors                   As in `calibrate`.

    Raises
    ------
    IdentificationError   When nothing is free, or there are neither records nor sensors.
    """
    if isinstance(model, Calibration):
        return _after(model)
    if not free:
        raise IdentificationError("no parameter is free. Name the parameters to fit.", model.title, code="fit.nothing-free")
    many = (records,) if isinstance(records, Record) else tuple(records)
    planned = not many
    if planned:
        if not isinstance(scenario, Scenario) or not sensors:
            raise IdentificationError(
                "give the logs of a test, or a scenario and sensors of a planned test.", model.title, code="value.incomplete"
            )
        many = (planned_record(model, scenario, Sensor.of_model(model, scenario, sensors), every, scenario.title),)
    scenarios = dict(scenario) if isinstance(scenario, Mapping) else {"*": scenario} if scenario else {}
    specs = {k: LocalSpec.read(v, f"local.{k}") for k, v in (local or {}).items()}
    request = Request(model, many, tuple(free), scenarios, specs, priors=priors_of(model, priors or {}, model.title))
    return Identifiability.of_problem(request, "planned" if planned else "before")


def _after(fit: Calibration) -> Identifiability:
    """Return what the records of a fit showed of its parameters, at its end.

    Errors are those by Fisher information, times sqrt(chi^2 per degree of freedom) where that is above 1; then every one, the relative one
    and that without the main cause times (error of the fit / error), since the fit counts residuals that wander.

    Raises
    ------
    IdentificationError   When the calibration was read from a file: its problem is needed.
    """
    if fit.problem is None:
        raise IdentificationError(
            "this calibration was not made by a fit in this session; repeat the fit.", fit.stage, code="fit.needs-session"
        )
    at = np.array([fit.fitted[u.name] for u in fit.problem.unknowns])
    result = _identifiability_at(fit.stage, "after", fit.problem, at, max(1.0, fit.reduced_chi_square) ** 0.5)
    # where residuals wander, the fit's own errors count it
    grown = {p: fit.values[p].error / k.error if k.error > 0 else 1.0 for p, k in result.parameters.items()}
    return replace(
        result,
        inputs=fit.inputs,
        parameters={
            p: replace(k, error=k.error * grown[p], relative=k.relative * grown[p], without=k.without * grown[p])
            for p, k in result.parameters.items()
        },
    )


def _identifiability_at(title: str, stage: str, problem: Problem, at: Array, spread: float) -> Identifiability:
    """Return what the readings of a problem determine at `at` (unknowns,), in the fitted form, with `spread` times their noise. [-]"""
    info = Information.of_problem(problem, at, spread)
    if not info.parameters:
        raise IdentificationError("no parameter is free. Name the parameters to fit.", title, code="fit.nothing-free")
    bound = Group.all_structural(info, info.elsewhere(problem, spread))
    # what a prior alone splits is said once
    groups = [*bound, *(g for g in Group.all_practical(info, MAX_KNOWN_ERROR) if not any(set(g.names) <= set(b.names) for b in bound))]
    parameters = _known_parameters(info)
    doubtful = [p for p, k in parameters.items() if not k.relative <= MAX_KNOWN_ERROR]
    helps = cures(problem, info, groups, doubtful) if doubtful else ()
    return Identifiability(title, stage, problem.samples, info.rank(), parameters, tuple(groups), helps, info, problem)


def _known_parameters(info: Information) -> dict[str, KnownParameter]:
    """Return path -> value and error, with the unknown j that most of the error of k comes from.

    The share of j is C_kj^2 / (C_kk C_jj), C the covariance: what the variance of k would lose if j were known. One is named above 0.5.
    """
    covariance = info.covariance()
    variance = np.diag(covariance)
    out = {}
    for k in info.parameters:
        u: Unknown = info.unknowns[k]
        share = np.zeros(len(variance))
        others = np.isfinite(variance) & (variance > 0)
        others[k] = False
        if np.isfinite(variance[k]):
            share[others] = covariance[k, others] ** 2 / (variance[k] * variance[others])
        # where an instrument is behind an error that two parameters share, it is the instrument that can be bettered
        outer = np.where([v.kind == "parameter" for v in info.unknowns], 0.0, share)
        worst = int(outer.argmax() if outer.max() > 0.5 else share.argmax())
        limit = info.names[worst] if share[worst] > 0.5 else ""
        relative = float(np.sqrt(variance[k]) / info.sizes[k])
        error = float(np.sqrt(variance[k]) * info.slopes[k])
        without = relative * float(np.sqrt(max(0.0, 1.0 - share[worst]))) if limit else relative
        out[u.name] = KnownParameter(u.name, float(info.values[k]), error, relative, float(info.alone[k]), limit, without, u.unit)
    return out


MAX_POINTS_PER_SIDE, FIRST_LOG_STEP, MAX_LOG_STEP = 14, 0.7, 7.0
"""Points on one side; how far a logarithm goes at first, and at most (a factor of 1100)."""


USUAL_EVALUATIONS = 64
"""Evaluations that a profile takes: some 16 points, each fitted anew in four."""


@dataclass(frozen=True, eq=False)
class PartlyFixed(Problem):
    """A problem with some unknowns fixed, whose readings scatter `spread` times as much as their noise states.

    Parameters
    ----------
    whole : Problem                 The problem with all unknowns.
    values : array (unknowns,)      All unknowns of `whole`, in the fitted form; those that are not fixed are ignored.
    free_places : array (free,)     Positions in `whole` of the unknowns that are fitted.
    spread : float                  Factor on the noise; priors keep their widths. [-]
    """

    whole: Problem = field(default=None, repr=False)  # type: ignore[assignment]
    values: Array = field(default_factory=lambda: np.zeros(0), repr=False)
    free_places: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, dtype=np.int64), repr=False)
    spread: float = 1.0

    @classmethod
    def with_fixed(cls, whole: Problem, values: Array, fixed: tuple[int, ...], spread: float) -> PartlyFixed:
        """Return a problem whose unknowns at the places `fixed` keep their `values` (unknowns,), in the fitted form."""
        free_places = np.array([k for k in range(len(whole.unknowns)) if k not in fixed], dtype=np.int64)
        unknowns = tuple(whole.unknowns[k] for k in free_places)
        return cls(
            whole.experiments, unknowns, whole.noise, whole.options, whole=whole, values=values, free_places=free_places, spread=spread
        )

    def full(self, fitted: Array) -> Array:
        """Return all unknowns of `whole` (unknowns,), from those that are fitted (free,)."""
        out = self.values.copy()
        out[self.free_places] = fitted
        return out

    def compressed(self, fitted: Array, loss: str = "linear", loss_scale: float = 1.0, meshes: object = ()) -> Compressed:
        """Return residuals [-] and derivatives of `whole` over `spread`, the latter by the fitted unknowns alone; `fitted` (unknowns,)."""
        whole_compressed = self.whole.compressed(self.full(fitted), loss, loss_scale, meshes)  # type: ignore[arg-type]
        rows, slopes = whole_compressed.rows / self.spread, whole_compressed.slopes[:, self.free_places] / self.spread
        return replace(whole_compressed, rows=rows, slopes=slopes, chi_square=whole_compressed.chi_square / self.spread**2)

    def prior_rows(self, fitted: Array) -> tuple[Array, Array]:
        """Return the residuals of all priors (rows,) and their derivatives with respect to the fitted unknowns (rows, free)."""
        rows, slopes = self.whole.prior_rows(self.full(fitted))
        return rows, slopes[:, self.free_places]


@dataclass(frozen=True, eq=False)
class Profile(Result):
    """How far a parameter can go before the readings object.

    Parameters
    ----------
    path, unit : str            The parameter, and the unit for people.
    best : float                Where the fit is best. [SI]
    low, high : float           The interval; infinite, or the bound, where the readings set no limit. [SI]
    limited : (bool, bool)      Whether the readings set the lower and the upper limit.
    level : float               Probability that the interval stands for. [-]
    error : float               Standard error of the fit, for comparison. [SI]
    bounds : (float, float)     [SI]
    values : array (points,)    Where it was tried. [SI]
    rise : array (points,)      Growth of the weighted sum of squares there, all other unknowns fitted anew. [-]
    threshold : float           Growth at the ends of the interval. [-]
    """

    path: str
    unit: str
    best: float
    low: float
    high: float
    limited: tuple[bool, bool]
    level: float
    error: float
    bounds: tuple[float, float]
    values: Array
    rise: Array
    threshold: float

    def shown(self, value: float) -> str:
        """Return a value in its unit."""
        return f"{from_si(value, self.unit):.4g}"

    def __str__(self) -> str:
        """Return the interval in words."""
        head = f"{self.path} = {self.shown(self.best)} {self.unit}"
        sure = f"{100 * self.level:.3g} %"
        ends = [self.shown(v) if ok else "" for v, ok in zip((self.low, self.high), self.limited, strict=True)]
        if all(self.limited):
            text = f"{head}: {sure} confidence interval from {ends[0]} to {ends[1]} {self.unit}"
        elif any(self.limited):
            text = f"{head}: {sure} sure {'above' if self.limited[0] else 'below'} {ends[0] or ends[1]} {self.unit}"
        else:
            text = head
        for ok, side, end in zip(self.limited, ("lower", "upper"), (self.low, self.high), strict=True):
            if not ok:
                bound = self.bounds[side == "upper"]
                to = f"the bound {self.shown(bound)}" if np.isfinite(bound) else f"{self.shown(end)}, the farthest tried"
                text += f"; no {side} limit down to {to}" if side == "lower" else f"; no {side} limit up to {to}"
        plain = [self.shown(self.best + side * self.threshold**0.5 * self.error) for side in (-1.0, 1.0)]
        return f"{text}. By the standard error alone: {plain[0]} to {plain[1]}."

    def _as_traces(self) -> Sequence[PlottedTrace]:
        """Return the growth of the sum of squares, and the growth at the ends of the interval."""
        x = np.asarray([from_si(float(v), self.unit) for v in self.values])
        return [PlottedTrace("growth", x, self.rise), PlottedTrace(f"{100 * self.level:g} %", x, np.full(x.size, self.threshold))]

    @property
    def _axes_titles(self) -> tuple[str, str]:  # type: ignore[override]
        """Titles of the axes."""
        return (f"{self.path} [{self.unit}]", "growth of the weighted sum of squares [-]")


def problem_and_place(fit: Calibration, path: str) -> tuple[Problem, int]:
    """Return the problem of a fit and the position of an unknown."""
    if fit.problem is None:
        raise IdentificationError(
            "this calibration was not made by a fit in this session; repeat the fit.", fit.stage, code="fit.needs-session"
        )
    names = [u.name for u in fit.problem.unknowns]
    name = fit.given_model.canonical(path)
    refuse_unknown([name], names, fit.stage, f"'{path}' was not free in this fit.", NameNotFoundError)
    return fit.problem, names.index(name)


def spread_of(problem: Problem, at: Array, k: int, error: float) -> float:
    """Return the factor s on the noise with which the information of the readings gives the standard error of the fit. [-]

    It solves ``((J'J / s^2 + P)^-1)_kk = error^2``, P the information of the priors; 1 where no s from exp(-3) to exp(8) does.
    Residuals that wander widen the errors of a fit by more than their size does, and each parameter by its own amount.
    """
    from scipy.optimize import brentq

    data, priors = problem.compressed(at).slopes, problem.prior_rows(at)[1]

    def excess(log_spread: float) -> float:
        """Return ln of the standard error at a spread exp(`log_spread`) of the residuals, over that of the fit. [-]"""
        # ln of the standard error from (J'J / s^2 + P)^-1, over that of the fit
        rows = np.concatenate([data / np.exp(log_spread), priors])
        return float(0.5 * np.log(covariance(rows)[k, k]) - np.log(error))

    low, high = -3.0, 8.0
    return float(np.exp(brentq(excess, low, high, xtol=1e-4))) if excess(low) < 0 < excess(high) else 1.0


def profile(fit: Calibration, path: str, level: float = 0.95, *, executor: Workers = None) -> Profile:
    """Return the interval of a parameter from its profile: it is moved step by step, and everything else is fitted anew each time.

    Parameters
    ----------
    fit : Calibration   The fit.
    path : str          Path of a fitted parameter.
    level : float       Probability of the interval. [-]
    executor            As in `ensemble`: who walks to the two ends.

    Raises
    ------
    NameNotFoundError   When the parameter was not free.

    Notes
    -----
    The interval ends where the weighted sum of squares, priors included, has grown by the quantile of chi-square with one degree of freedom
    (Venzon and Moolgavkar, Applied Statistics 37 (1988) 87-94, DOI 10.2307/2347496). Readings weigh as they do in the errors of the fit.
    """
    from scipy.special import gammaincinv

    if not 0.0 < level < 1.0:
        raise IdentificationError(
            f"a level of {level:g} is not a probability. Give one between 0 and 1, such as 0.95.", "profile", code="value.outside-range"
        )
    problem, k = problem_and_place(fit, path)
    threshold = float(2.0 * gammaincinv(0.5, level))
    at = np.array([fit.fitted[u.name] for u in problem.unknowns])
    u, value = problem.unknowns[k], fit.values[problem.unknowns[k].name]
    spread = spread_of(problem, at, k, value.error / u.slope(float(at[k])))
    walk = _Walk(fit, problem, k, at, spread, threshold)
    ends = dict(
        in_tasks(_Walk.side, [(f"the {way} end of '{u.name}'", (walk, sign)) for way, sign in (("lower", -1.0), ("upper", 1.0))], executor)
    )
    sides = [ends[0], ends[1]]
    for end, points, _ in sides:  # a smooth curve needs points on the way
        points += [(x, walk.rise(x, walk.at)[0]) for x in walk.best + np.array([0.33, 0.66]) * (end - walk.best)]
    line = sorted([*sides[0][1], *sides[1][1], (walk.best, 0.0)])
    low, high = (u.to_value(end) for end, _, _ in sides)
    limited = (sides[0][2], sides[1][2])
    tried, rise = np.array([u.to_value(x) for x, _ in line]), np.array([r for _, r in line])
    return Profile(u.name, u.unit, u.to_value(walk.best), low, high, limited, level, value.error, (u.low, u.high), tried, rise, threshold)


class _Walk:
    """Steps of one parameter away from the best fit, all others fitted anew at each; distances are in the fitted form."""

    def __init__(self, fit: Calibration, problem: Problem, k: int, at: Array, spread: float, threshold: float) -> None:
        """Find the best fit at this spread of the readings, from where steps begin."""
        request = fit.request
        self.loss, self.loss_scale = (request.loss, request.loss_scale) if request is not None else ("linear", 1.0)
        self.problem, self.k, self.spread, self.threshold = problem, k, spread, threshold
        begun = time.perf_counter()
        whole = minimise(PartlyFixed.with_fixed(problem, at, (), spread), self.loss, self.loss_scale, at)
        seconds = USUAL_EVALUATIONS * (time.perf_counter() - begun) / max(whole.evaluations, 1)
        foretell(f"profile goes on with some {USUAL_EVALUATIONS} evaluations: about {spoken(seconds)} left.", seconds)
        self.at, self.cost, self.best = whole.fitted, whole.cost, float(whole.fitted[k])
        u: Unknown = problem.unknowns[k]
        self.step = fit.values[u.name].error / u.slope(self.best)
        self.bounds = u.fitted_bounds()
        self.log = u.log
        self.farthest = MAX_LOG_STEP if u.log else 1e3 * self.step

    def rise(self, x: float, start: Array) -> tuple[float, Array]:
        """Return the growth of the sum of squares with the parameter fixed at `x` [-], and all unknowns (unknowns,) there."""
        values = start.copy()
        values[self.k] = x
        fixed = PartlyFixed.with_fixed(self.problem, values, (self.k,), self.spread)
        minimum = minimise(fixed, self.loss, self.loss_scale, values[fixed.free_places])
        return max(0.0, 2.0 * (minimum.cost - self.cost)), fixed.full(minimum.fitted)

    def side(self, sign: float) -> tuple[float, list[tuple[float, float]], bool]:
        """Return the end of the lower (`sign` -1) or upper side (1), its points (value, growth), and whether the readings limit it.

        The side ends where the growth of twice the cost reaches the threshold; else at the bound, or at the farthest distance that is
        tried. From a distance d with growth r the next is d 1.05 sqrt(threshold / r), 1.15 to 3 times as far. Values are in the fitted
        form.
        """
        limit = self.bounds[0] if sign < 0 else self.bounds[1]
        most = min(abs(limit - self.best), self.farthest)
        # a logarithm with a large error knows little of where the limit is
        far, points = min(self.threshold**0.5 * self.step, FIRST_LOG_STEP if self.log else np.inf, most), list[tuple[float, float]]()
        before, start = 0.0, self.at
        for _ in range(MAX_POINTS_PER_SIDE):
            try:
                rise, place = self.rise(self.best + sign * far, start)
            except SolverError:
                break  # as far as the model can be run
            points.append((self.best + sign * far, rise))
            if rise >= self.threshold:
                return self._crossing(sign, before, abs(points[-1][0] - self.best), start, points)
            start = place
            if far >= most * (1 - 1e-9):
                break
            before = abs(points[-1][0] - self.best)
            far = min(far * float(np.clip((self.threshold / max(rise, 1e-12)) ** 0.5 * 1.05, 1.15, 3.0)), most)
        return self.best + sign * most, points, False

    def _crossing(
        self, sign: float, low: float, high: float, place: Array, points: list[tuple[float, float]]
    ) -> tuple[float, list[tuple[float, float]], bool]:
        """Return the value between the distances `low` and `high` where the growth reaches the threshold, the points, and True.

        By Brent's method on the root of the growth; the value is best + `sign` times the distance, in the fitted form. `place` are the
        unknowns from which the others are fitted anew; new points are added to `points`.
        """
        from scipy.optimize import brentq

        goal = self.threshold**0.5
        rise_at = {distance: rise**0.5 for distance, rise in ((abs(x - self.best), r) for x, r in points)}

        def beyond(distance: float) -> float:
            """Return the root of the rise of the sum of squares [-] at a `distance` [fitted form] from the best value, less the goal."""
            if distance not in rise_at:
                rise, _ = self.rise(self.best + sign * distance, place)
                points.append((self.best + sign * distance, rise))
                rise_at[distance] = rise**0.5
            return float(rise_at[distance] - goal)

        rise_at |= {low: rise_at.get(low, 0.0), high: rise_at[high]}
        at = float(brentq(beyond, low, high, xtol=0.01 * self.step, rtol=1e-3, maxiter=30, disp=False))
        return self.best + sign * at, points, True
