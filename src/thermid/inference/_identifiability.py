"""`identifiability`: which parameters a log can tell, which only together, and what would help where it cannot."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from thermid.base.errors import IdentificationError, SolverError, quoted
from thermid.base.linear_algebra import Array
from thermid.base.results import Named
from thermid.base.units import counted, from_si
from thermid.fit.calibration import (
    Calibration,
    Experiment,
    Group,
    Information,
    InputTable,
    LocalSpec,
    Problem,
    Request,
    Unknown,
    build_problem,
    elsewhere,
    input_lines,
    inputs_of,
    percent,
    practical_groups,
    priors_of,
    starting_point,
    structural_groups,
)
from thermid.inference.planned_records import planned_record, sensors_of
from thermid.measure.records import Record
from thermid.model.tree import HeatLoad, Model, TableSignal, parameter
from thermid.simulation.runs import Scenario, compile_network

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
    hours = lengths[i] / 3600.0
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
    heater = HeatLoad(node, {"power": parameter("1 [W]", HEATER)})
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
        many = (planned_record(model, scenario, sensors_of(model, scenario, sensors), every, scenario.title),)
    scenarios = dict(scenario) if isinstance(scenario, Mapping) else {"*": scenario} if scenario else {}
    specs = {k: LocalSpec.read(v, f"local.{k}") for k, v in (local or {}).items()}
    request = Request(model, many, tuple(free), scenarios, specs, priors=priors_of(model, priors or {}, model.title))
    return identifiability_of(request, "planned" if planned else "before")


def identifiability_of(request: Request, stage: str = "before") -> Identifiability:
    """Return what the records of a request tell, at the values where its fit would start; see `identifiability`."""
    problem = build_problem(request)
    start = starting_point(problem.unknowns)
    result = _identifiability_at(request.name or request.model.title, stage, problem, start, 1.0)
    return replace(result, inputs=InputTable() if stage == "planned" else inputs_of(request, problem.experiments, problem.unknowns))


def _after(fit: Calibration) -> Identifiability:
    """Return what the records of a fit told, at its end."""
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
    bound = structural_groups(info, elsewhere(problem, info, spread))
    # what a prior alone splits is said once
    groups = [*bound, *(g for g in practical_groups(info, MAX_KNOWN_ERROR) if not any(set(g.names) <= set(b.names) for b in bound))]
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
