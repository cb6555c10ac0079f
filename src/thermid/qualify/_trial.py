"""A test of a plan: predicted, checked against its limits, and judged where its log has come back."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from thermid.base.errors import CodedText, NameNotFoundError, RecordError, ScenarioError, errors_at, refuse_unknown
from thermid.base.files import resolve_inside
from thermid.base.results import VERDICTS, weigh
from thermid.base.units import ATMOSPHERE, HOUR, ICE_POINT, TEMPERATURE, Array, duration_text
from thermid.campaign.stages import (
    Correlation,
    Exclusions,
    HeaterDuty,
    LimitCheck,
    Limits,
    Overlay,
    check_limits,
    check_readings,
    compare,
    correlate,
    heater_duty,
    overlays,
    paired,
)
from thermid.fit.calibration import Calibration
from thermid.inference.criticism import Diagnosis, diagnose
from thermid.measure.readers import read_record
from thermid.measure.records import Record, StabilityRule
from thermid.model.tree import Flat, literal
from thermid.prediction.bands import Foresight, Knowledge, foresee
from thermid.qualify._plan import Plan
from thermid.qualify._profile_runs.conduct import run_profile
from thermid.qualify._profile_runs.profile_run import ProfileRun, verdict_remarks
from thermid.qualify._profiles.profile import ThermalProfile, profile_from
from thermid.qualify._steadiness.stabilisation import Stability, stability
from thermid.simulation.runs import Scenario, Solution, load_scenario, scenario_from_table

if TYPE_CHECKING:
    from thermid.qualify._plan_schema import TestTable, ValidityTable

Window = tuple[float, float]
LOGGED_TABLES = ("boundaries", "loads", "commands")
"""Tables of a scenario whose inputs a log may give."""
MAX_STORED_TIMES = 6000
"""At most so many stored times of a run: two minutes over eight days."""
ENVIRONMENTAL = ("thermal cycling", "thermal vacuum", "thermal balance", "humidity")
"""Kinds of test whose levels somebody applies."""
MIN_SETTLED_STAY = HOUR
"""Stays of at least so long end settled. [s]"""
LEVEL_TOLERANCE = 3.0
"""How far a test's temperature may be off its level: SMC-S-016, 4.7 (read). [K]"""
MAX_UNCOVERED_SHARE = 0.02
"""Share of a test without readings from which it counts as not covered. [-]"""
GAP_INTERVALS = 5.0
"""A pause is a gap from so many usual intervals on."""
MIN_SHARE_AT_LEVEL = 0.9
"""Share of the planned time at a level that must have been spent there. [-]"""
MIN_EXCHANGE_DEVIATION = 1.0
"""Deviation from which it is asked whether two sensors were exchanged. [K]"""


@dataclass(frozen=True, eq=False)
class Trial:
    """One test of a plan: predicted, checked against its limits, and compared with its log where there is one.

    Parameters
    ----------
    test : TestTable                As planned.
    knowledge : Knowledge           The model that it was predicted with.
    foresight : Foresight           Prediction before any log of the plan was read.
    limits : tuple of Limits        Under their paths in that model.
    checks : tuple of LimitCheck    Predicted and measured temperatures against the limits.
    course : ProfileRun or None     The run of its profile, with its phases; None for a scenario.
    heaters : tuple of HeaterDuty   Duties of its heaters against the margin of their power.
    outside : tuple of str          Where it leaves the conditions of the calibration, in words.
    correlation : Correlation or None   The criteria on the residuals; None without a log.
    diagnosis : Diagnosis or None   What would explain the deviations, where a criterion is not met.
    log_sha256 : str                Hash of the log.
    synthetic : bool                Whether the log was made and not measured.
    not_shown : tuple of str        What the log does not show: stretches without readings, levels that were not applied.
    remarks : tuple of str          What else a reader must know of the log.
    settled : tuple of Stability    For each settled window, whether the readings are stable in it.
    as_logged : dict                Column of a logged boundary -> its lowest and highest reading. [degC]
    after : Foresight or None       Prediction widened by the misfit that the logs of the plan have shown.
    """

    test: TestTable
    knowledge: Knowledge
    foresight: Foresight
    limits: tuple[Limits, ...]
    checks: tuple[LimitCheck, ...]
    course: ProfileRun | None = None
    heaters: tuple[HeaterDuty, ...] = ()
    outside: tuple[str, ...] = ()
    correlation: Correlation | None = None
    diagnosis: Diagnosis | None = None
    log_sha256: str = ""
    synthetic: bool = False
    not_shown: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()
    settled: tuple[Stability, ...] = ()
    as_logged: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    after: Foresight | None = field(default=None, repr=False)

    @property
    def expected(self) -> Foresight:
        """The prediction with all that is known: `after` once a log of the plan was read, before that `foresight`."""
        return self.after or self.foresight

    @property
    def within(self) -> bool | None:
        """Whether no limit is passed, as predicted and as measured; None where that is not decided."""
        outcomes = [c.passed for c in self.checks] + [h.passed for h in self.heaters]
        if not self.checks or (self.course is not None and not self.course.profile.decides):
            outcomes.append(None)
        return weigh(outcomes)

    @property
    def correlated(self) -> bool | None:
        """Whether every set of criteria is met; None without a log or criteria, or where the log does not show all of the test."""
        if self.correlation is None:
            return None
        outcomes = list(self.correlation.verdicts.values())
        return weigh([*outcomes, *([None] if self.not_shown or not outcomes else [])])

    @property
    def passed(self) -> bool | None:
        """Whether limits and criteria are met; None where that is not decided, for the reasons of `open`.

        A test without criteria and log is an analysis, judged by its limits alone.
        """
        return weigh([self.within, *([self.correlated] if self._judged else []), *([None] if self.open else [])])

    @property
    def _judged(self) -> bool:
        """Whether criteria count: there is a log, or criteria wait for one; those of a waived test do not."""
        return self.correlation is not None or (bool(self.test.criteria) and self.test.state != "waived")

    @property
    def open(self) -> tuple[str, ...]:
        """Reasons why the verdict is not decided; empty where it is."""
        out = list(dict.fromkeys(c.undecided for c in self.checks if c.undecided))
        if not self.checks:
            out.append("no limit was checked in this test")
        if self.course is not None and not self.course.profile.decides:
            out.append(f"the course uses numbers {self.course.profile.trust}")
        out += [f"the power margin of heater {h.load} is quoted from memory" for h in self.heaters if h.passed is None]
        if self._judged and self.correlation is None:
            out.append(CodedText(f"there is no log yet, so {', '.join(self.test.criteria)} could not be judged", "verdict.no-log"))
        if self.correlation is not None:
            verdicts = self.correlation.verdicts
            out += [] if verdicts else [CodedText("there is a log, but no criteria for it", "verdict.no-criteria")]
            out += [f"the criteria {name} are quoted from memory" for name, passed in verdicts.items() if passed is None]
        return (*out, *self.not_shown)

    @property
    def worst(self) -> LimitCheck | None:
        """The check with the smallest distance to a limit, or furthest beyond it; None without a finite one."""
        return min((c for c in self.checks if np.isfinite(c.room)), key=lambda c: c.room, default=None)

    def to_dict(self) -> dict[str, Any]:
        """Return verdicts, limits and correlation as plain numbers for JSON: [degC], [K], [s], as the ends of keys say."""
        checks = [
            {
                "point": c.point,
                "state": c.state,
                "lowest_C": c.lowest - 273.15,
                "highest_C": c.highest - 273.15,
                "room_K": c.room if np.isfinite(c.room) else None,
                "by": c.by,
                "passed": c.passed,
                "crossings": [{"side": x.side, "time_s": x.time, "worst_C": x.worst - 273.15, "outside_s": x.outside} for x in c.crossings],
            }
            for c in self.checks
        ]
        out: dict[str, Any] = {"name": self.test.name, "kind": self.test.kind, "state": self.test.state, "passed": self.passed}
        out |= {"waived": self.test.state == "waived", "open": list(self.open), "remarks": list(self.remarks)}
        out |= {"within_limits": self.within, "limits": checks, "outside_calibration": list(self.outside), "correlation": None}
        if self.correlation is not None:
            out["correlation"] = self.correlation.to_dict()
            out["diagnosis"] = None if self.diagnosis is None else {"group": self.diagnosis.group, "groups": dict(self.diagnosis.groups)}
        return out

    def __str__(self) -> str:
        """Verdicts, the nearest limit, criteria that failed and open points, a line for each."""
        lines = [f"{self.test.name} ({self.test.kind}, {self.test.state}): limits {VERDICTS[self.within]}"]
        if self.course is not None:
            lines[0] += f"; {self.course.duration / 3600:.1f} h, of it {self.course.waited / 3600:.1f} h waiting"
            lines[0] += f"; profile: {self.course.profile.trust}"
        if self.worst is not None:
            lines.append(f"  nearest: {self.worst}")
        lines += [f"  {c}" for c in self.checks if c.crossings and c is not self.worst]
        for h in self.heaters:
            lines.append(f"  heater {h.load}: duty {100 * h.duty:.0f} %, at most {100 * h.max_duty:.0f} %: {VERDICTS[h.passed]}")
        lines += [f"  outside the calibration: {o}" for o in self.outside]
        if self.correlation is not None:
            for name, passed in self.correlation.verdicts.items():
                failed = [str(g) for g in self.correlation.failed if g.criteria == name]
                lines.append(f"  {name}: {VERDICTS[passed]}" + (f" ({'; '.join(failed)})" if failed else ""))
            if self.diagnosis is not None:
                lines += [f"  {line}" for line in str(self.diagnosis).splitlines()]
        lines += [f"  not decided: {o}" for o in self.open]
        lines += [f"  remark: {r}" for r in self.remarks]
        return "\n".join(lines)


def run_test(plan: Plan, test: TestTable) -> Trial:
    """Return a test of a plan, predicted and checked against its limits, and compared with its log where the plan names one.

    Raises
    ------
    NameNotFoundError   When a limit or a sensor is at a node that the model does not have.
    ThermidError        When scenario, profile or log cannot be read or run.
    """
    knowledge, limits = plan.on_host(test.host)
    scenario, course = _scenario_and_course(plan, test, knowledge)
    sensors = sensors_of(plan, test)
    # refuse sensors and reference points at nodes that the model does not have
    nodes = [n.path for n in Flat.of_model(knowledge.model).nodes]
    places = [(f"limits.{x.point}.node", x.node) for x in limits] + [(f"sensors.{s}.node", n) for s, (n, _) in sensors.items()]
    for key, node in places:
        refuse_unknown([knowledge.model.canonical(node)], nodes, f"{plan.path.name}, {key}", f"no node '{node}'.", NameNotFoundError)
    points = list(dict.fromkeys([x.node for x in limits] + [n for n, _ in sensors.values()]))
    step = max(literal(test.every, "s", f"{test.name}, every"), scenario.seconds / MAX_STORED_TIMES)
    times = np.linspace(0.0, scenario.seconds, int(np.ceil(scenario.seconds / step)) + 1)
    foresight = foresee(knowledge, scenario, nodes=points, spread=test.spread, times=times)
    checks = check_limits(foresight.solution, limits, state=test.state_without_loads)
    heaters = tuple(
        heater_duty(
            foresight, load, literal(power, "W", f"{test.name}, heaters.{load}"), name=test.name, policy=plan.content.margins.policy
        )
        for load, power in test.heaters.items()
    )
    ahead = f"{knowledge.at}." if knowledge.at else ""
    outside = extrapolations(test, foresight, plan.content.validity, [x.node for x in limits], ahead)
    remarks = verdict_remarks(course) if course is not None else ()
    trial = Trial(test, knowledge, foresight, limits, checks, course, heaters, outside, remarks=remarks)
    return trial if test.log is None else _judged(plan, trial, scenario, sensors)


def _scenario_and_course(plan: Plan, test: TestTable, knowledge: Knowledge) -> tuple[Scenario, ProfileRun | None]:
    """Return the scenario of a test, and the run of its profile where it has one (else None)."""
    scenario: Scenario | None = None
    where = f"{plan.path.name}, {test.name}"
    if isinstance(test.scenario, str):
        with errors_at(where):
            scenario = load_scenario(resolve_inside(plan.path.parent, test.scenario, where))
    elif test.scenario is not None or test.profile is None:
        scenario = scenario_from_table({"title": test.name} | dict(test.scenario or {}), plan.path.parent, where)
    if test.profile is not None:
        run = run_profile(
            knowledge.model,
            profile_from(test.profile, plan.path.name, test.name),
            chamber=test.chamber,
            base=test.base,
            watch=test.watch,
            equipment=test.equipment,
            scenario=_scenario_beside_profile(scenario, test, knowledge),
            every=literal(test.every, "s", f"{test.name}, every"),
        )
        return replace(run.scenario, title=test.name), replace(run, cycles_beside=_cycles_beside(plan, test, run.profile))
    assert scenario is not None
    return scenario, None


def _scenario_beside_profile(scenario: Scenario | None, test: TestTable, knowledge: Knowledge) -> Scenario | None:
    """Return the scenario that gives loads, commands and other boundaries beside a profile; None where there is none.

    Raises
    ------
    ScenarioError   When it gives what the profile gives: a duration, or the temperature of the chamber.
    """
    if scenario is None:
        return None
    chamber = {knowledge.model.canonical(n) for n in ([test.chamber] if isinstance(test.chamber, str) else test.chamber)}
    both = [n for n in scenario.boundaries if knowledge.model.canonical(n) in chamber]
    if both or scenario.seconds > 0.0:
        what = f"boundary '{both[0]}' is the chamber" if both else "its duration follows from the unit"
        raise ScenarioError(
            f"{what}: the profile gives it already. A scenario beside a profile may give other inputs only. Leave it out there.",
            "scenario",
            code="value.excludes-another",
        )
    return scenario


def _cycles_beside(plan: Plan, test: TestTable, profile: ThermalProfile) -> float:
    """Return how many thermal cycles the other tests of the plan add to a profile whose clause requires a number (`base_cycles`).

    Cycling and vacuum tests over at least its range (hot - cold), to 0.1 K, count; tests with steps of their own do not.
    """
    if not profile.has("base_cycles"):
        return 0.0
    others = [profile_from(t.profile, plan.path.name, t.name) for t in plan.tests if t.profile is not None and t.name != test.name]
    cycling = [p for p in others if p.kind in ("thermal cycling", "thermal vacuum") and not p.plan]
    least = profile.value("hot") - profile.value("cold") - 0.1
    return sum(p.value("cycles") for p in cycling if p.value("hot") - p.value("cold") >= least)


def sensors_of(plan: Plan, test: TestTable) -> dict[str, tuple[str, Any]]:
    """Return sensor -> (its node in the model of the test, its table of the plan)."""
    ahead = f"{plan.content.hosts[test.host].unit}." if test.host else ""
    wanted = test.sensors or list(plan.content.sensors)
    return {s: (ahead + plan.content.sensors[s].node, plan.content.sensors[s]) for s in wanted}


def _judged(plan: Plan, trial: Trial, scenario: Scenario, sensors: Mapping[str, tuple[str, Any]]) -> Trial:
    """Return a test with its log compared with the model under the logged inputs, or with another simulation (`simulated` of the log).

    Parameters
    ----------
    plan, trial : Plan, Trial   The test as predicted.
    scenario : Scenario         What was planned.
    sensors : dict              Sensor -> (node, table), as `sensors_of` returns it.
    """
    test, log = trial.test, trial.test.log
    assert log is not None
    record = _record(plan, test, log.file, sensors, log.boundaries, log.loads)
    windows = [(literal(a, "s", f"{test.name}, steady"), literal(b, "s", f"{test.name}, steady")) for a, b in test.steady]
    windows = windows or settled_windows(trial, [n for n, _ in sensors.values()], record.duration)
    comparison: Calibration | None = None
    if log.simulated:
        overlaid = paired(record, _record(plan, test, log.simulated, sensors, {}, {}), test.name)
    else:
        base = replace(scenario, start=log.start) if log.start else scenario
        logged = {*log.boundaries.values(), *log.loads.values()}
        tables: dict[str, Any] = {k: {n: v for n, v in getattr(base, k).items() if n not in logged} for k in LOGGED_TABLES}
        comparison = compare(trial.knowledge.model, record, scenario=replace(base, **tables))
        overlaid = overlays(comparison, test.name)
    stated, there = plan.content.exclusions, {o.sensor for o in overlaid}
    left_out = Exclusions({s: r for s, r in stated.reasons.items() if s in there}, stated.cap)
    correlation = correlate(
        overlaid,
        [plan.criteria[n] for n in test.criteria],
        steady={test.name: windows} if windows else None,
        weights=test.weights,
        exclusions=left_out,
        title=test.name,
    )
    diagnosis = diagnose(comparison) if comparison is not None and correlation.failed and len(there) > 1 else None
    counted = [o for o in overlaid if o.sensor not in left_out.reasons]
    settled, unsure = stability_in_windows(trial, record, windows, [o.sensor for o in counted])
    steady = any("steady" in plan.criteria[n].kinds for n in test.criteria)
    find = trial.knowledge.model.canonical
    limits = [replace(x, node=find(x.node)) for x in trial.limits]
    readings = [(find(sensors[o.sensor][0]), o.times, o.measured) for o in counted]
    return replace(
        trial,
        correlation=correlation,
        diagnosis=diagnosis,
        log_sha256=record.origin.sha256,
        synthetic=record.origin.synthetic,
        checks=(*trial.checks, *check_readings(readings, limits, trial.foresight.solution, state=test.state_without_loads)),
        not_shown=(*_not_shown(trial, record, counted, windows), *((*windows_not_stable(settled), *unsure) if steady else ())),
        remarks=(
            *trial.remarks,
            *([f"its state is '{test.state}', but there is a log. Write state = \"run\""] if test.state == "planned" else []),
            *exchanged_sensors(counted),
            *(() if steady else unsure),
        ),
        settled=settled,
        as_logged={
            c: (float(v.min()), float(v.max())) if (v := record[c].values[record[c].valid] - ICE_POINT).size else (np.nan, np.nan)
            for c in log.boundaries
        },
    )


def _not_shown(trial: Trial, record: Record, counted: Sequence[Overlay], windows: Sequence[tuple[float, float]]) -> Iterator[str]:
    """Yield what a log does not show of its test: parts without readings, levels that were not applied, boundaries that were not logged.

    Parameters
    ----------
    counted : sequence of Overlay   Sensors that count.
    windows : sequence              Settled periods (begin, end). [s]
    """
    test, run = trial.test, trial.foresight.solution
    log = test.log
    assert log is not None
    # a chamber that follows the unit takes its own time; settled stretches that are stated then belong to the log
    own_pace = trial.course is not None and test.steady
    yield from uncovered_parts(counted, 0.0, record.duration if own_pace else float(run.times[-1]), windows)
    yield from levels_not_applied(record, run, log.boundaries)
    if test.kind in ENVIRONMENTAL:
        missing = sorted({*trial.foresight.scenario.boundaries} - {*log.boundaries.values()})
        if missing and not log.simulated:
            listed = ", ".join(f"'{n}'" for n in missing)
            yield f"no column of the log gives {listed}, so there is no measurement that its levels were applied"


def _record(
    plan: Plan, test: TestTable, file: str, sensors: Mapping[str, tuple[str, Any]], boundaries: Mapping[str, str], loads: Mapping[str, str]
) -> Record:
    """Return a log as a record, its columns bound to sensors' nodes, boundaries and loads, with the plan's `prepare` steps done.

    Raises
    ------
    RecordError   When a planned sensor has no column.
    """
    channels: dict[str, dict[str, object]] = {}
    for sensor, (node, table) in sensors.items():
        channels[sensor] = {"node": node} | {k: getattr(table, k) for k in ("accuracy", "noise") if getattr(table, k)}
    for role, columns in (("boundary", boundaries), ("load", loads)):
        channels |= {column: {role: path} for column, path in columns.items()}
    roots = [plan.data] if plan.data is not None else []
    place = next((f for root in roots if (f := root / file).is_file()), None) or resolve_inside(plan.path.parent, file, f"{test.name}, log")
    log = test.log
    time = log.time or None if log is not None else None
    record = read_record(place, channels, time=time, name=test.name)
    return record.prepare(log.prepare) if log is not None and log.prepare else record


def stability_in_windows(
    trial: Trial, record: Record, windows: Sequence[tuple[float, float]], sensors: Sequence[str]
) -> tuple[tuple[Stability, ...], tuple[str, ...]]:
    """Return the stability of every settled window by the test's rule, and what the readings leave open, in words.

    Parameters
    ----------
    windows : sequence              Settled periods (begin, end). [s]
    sensors : sequence of str       Channels that are judged.
    """
    out: list[Stability] = []
    unsure: dict[str, list[str]] = {}
    for begin, end in windows if sensors else ():
        try:
            verdict = stability(
                record, trial.test.stable, sensors, since=begin, at=end, run=trial.foresight.solution, unit=trial.knowledge.at
            )
        except RecordError as error:
            unsure.setdefault(f"its steadiness cannot be judged: {error}", []).append(_window_text(begin, end))
            continue
        out.append(verdict)
        if verdict.verdict == "cannot tell":
            unsure.setdefault(f"the readings do not decide whether '{verdict.rule.name}' is met at {verdict.slowest}", []).append(
                _window_text(begin, end)
            )
    more = {why: f" and {len(spans) - 1} more" if len(spans) > 1 else "" for why, spans in unsure.items()}
    return tuple(out), tuple(f"{spans[0]}{more[why]}: {why}" for why, spans in unsure.items())


def windows_not_stable(settled: Sequence[Stability]) -> Iterator[str]:
    """Yield a sentence for each window that is stated as steady and is not, by a rule that decides."""
    for s in settled:
        worst = s.channels[s.slowest]
        if s.verdict == "not stable" and s.decides and s.stored is not None:
            yield f"{_window_text(worst.start, worst.end)} is stated as steady but is not: {s.stored} by '{s.rule.name}' [{s.rule.mark}]"
        elif s.verdict == "not stable" and s.decides:
            yield (
                f"{_window_text(worst.start, worst.end)} is stated as steady but is not: {s.slowest} drifts by {3600.0 * worst.rate:+.2f} "
                f"K/h, the rule is '{s.rule.name}' [{s.rule.mark}]"
            )


def _window_text(begin: float, end: float) -> str:
    """Return a period in words: ``the stretch 4 .. 5 h``."""
    return f"the stretch {begin / 3600.0:.4g} .. {end / 3600.0:.4g} h"


def settled_windows(trial: Trial, nodes: Sequence[str], end: float) -> list[tuple[float, float]]:
    """Return (begin, end) of the end of every long stay of a profile, where the unit is expected to be stable. [s]

    It is the last quarter of a stay, and at least half of `MIN_SETTLED_STAY`. A stay is left out where the prediction drifts faster than
    the
    test's rule allows, as in humidity tests, which wait for nothing; under a rule on stored heat none is.

    Parameters
    ----------
    trial : Trial       The test, with its profile and prediction.
    nodes : sequence    Nodes whose drift counts.
    end : float         End of the log; later stays are left out. [s]
    """
    rule, run = StabilityRule.named(trial.test.stable), trial.foresight.solution
    stays = [p for p in trial.course.phases if p.kind == "stay" and p.duration >= MIN_SETTLED_STAY] if trial.course is not None else []
    out = []
    for p in (p for p in stays if p.end <= end):
        window = (p.end - max(0.25 * p.duration, 0.5 * MIN_SETTLED_STAY), p.end)
        moved = (run[n].at(window) for n in nodes)
        drift = max(abs(float(end - begin)) for begin, end in moved) / (window[1] - window[0])
        if rule.stored or drift <= rule.rate:
            out.append(window)
    return out


def uncovered_parts(overlaid: Sequence[Overlay], begin: float, end: float, windows: Sequence[Window] = ()) -> Iterator[str]:
    """Yield which part of a test, or of a settled window of it, no valid reading covers; sensors with the same gap together.

    Parameters
    ----------
    overlaid : sequence of Overlay  Sensors that count.
    begin, end : float              Of the test as it is simulated. [s]
    windows : sequence              Settled periods (begin, end). [s]
    """
    lacks: dict[str, list[str]] = {}
    for o in overlaid:
        missing, longest, start = _time_without_readings(o.times, begin, end)
        if missing > MAX_UNCOVERED_SHARE * (end - begin):
            text = f"for {duration_text(missing)} of {duration_text(end - begin)}; the longest gap, {duration_text(longest)}, is at "
            lacks.setdefault(f"{text}{start / 3600.0:.2f} h", []).append(o.sensor)
        for a, b in windows:
            lost, _, _ = _time_without_readings(o.times, a, b)
            if lost > (1.0 - MIN_SHARE_AT_LEVEL) * (b - a):
                text = f"for {duration_text(lost)} of the steady period {a / 3600.0:.4g} .. {b / 3600.0:.4g} h"
                lacks.setdefault(text, []).append(o.sensor)
    for text, sensors in lacks.items():
        yield f"no reading of {', '.join(sensors)} {text}"


def _time_without_readings(times: Array, begin: float, end: float) -> tuple[float, float, float]:
    """Return the time without readings at `times` (readings,) from `begin` to `end`, the longest gap, and where that begins. [s]

    A gap is longer than `GAP_INTERVALS` median intervals. With fewer than two readings all of it is one gap.
    """
    inside = times[(times >= begin) & (times <= end)]
    if inside.size < 2:
        return end - begin, end - begin, begin
    usual = float(np.median(np.diff(inside)))
    points = np.concatenate([[begin], inside, [end]])
    gaps = [(b - a, a) for a, b in pairwise(points.tolist()) if b - a > GAP_INTERVALS * usual]
    longest, start = max(gaps, default=(0.0, begin))
    return float(sum(g for g, _ in gaps)), float(longest), float(start)


def levels_not_applied(record: Record, planned: Solution, boundaries: Mapping[str, str]) -> Iterator[str]:
    """Yield which planned hot or cold level of a boundary the log does not show for long enough.

    The time within `LEVEL_TOLERANCE` of the planned extreme, or beyond it, must reach `MIN_SHARE_AT_LEVEL` of the planned one.

    Parameters
    ----------
    record : Record         The log.
    planned : Solution      The test as it was planned.
    boundaries : dict       Column -> boundary that it drives.
    """
    for column, boundary in boundaries.items():
        channel, trace = record[column], planned[boundary]
        times, values = record.times[channel.valid], channel.values[channel.valid]
        inside = times <= trace.times[-1]
        for word, sign in (("hot", 1.0), ("cold", -1.0)):
            level = float((sign * trace.kelvin).max())
            wanted = _time_above(trace.times, sign * trace.kelvin, level - LEVEL_TOLERANCE)
            spent = _time_above(times[inside], sign * values[inside], level - LEVEL_TOLERANCE)
            if spent < MIN_SHARE_AT_LEVEL * wanted:
                furthest = sign * float((sign * values).max()) - ICE_POINT
                yield (
                    f"the {word} level of '{boundary}', {sign * level - ICE_POINT:.1f} degC for {duration_text(wanted)}, was not applied: "
                    f"{column} goes to {furthest:.1f} degC and is within {LEVEL_TOLERANCE:g} K of it for {duration_text(spent)}"
                )


def _time_above(times: Array, values: Array, level: float) -> float:
    """Return how long a trace is at or above a level: the sum of the half-intervals about the samples that are. [s]"""
    if times.size < 2:
        return 0.0
    width = np.gradient(times)
    width[[0, -1]] *= 0.5
    return float(width[values >= level].sum())


def exchanged_sensors(overlays_: Sequence[Overlay]) -> Iterator[str]:
    """Yield pairs of sensors whose readings fit three times better when they change places.

    By the root mean square of (a - A)^2 + (b - B)^2 beside that of (a - B)^2 + (b - A)^2, read in small and simulated in capital letters;
    the first is above `MIN_EXCHANGE_DEVIATION`. [K]
    """
    for k, a in enumerate(overlays_):
        for b in overlays_[k + 1 :]:
            if a.times.size != b.times.size or not np.array_equal(a.times, b.times):
                continue
            as_wired = float(np.sqrt(np.mean((a.measured - a.simulated) ** 2 + (b.measured - b.simulated) ** 2)))
            other = float(np.sqrt(np.mean((a.measured - b.simulated) ** 2 + (b.measured - a.simulated) ** 2)))
            if as_wired > MIN_EXCHANGE_DEVIATION and other < as_wired / 3.0:
                yield CodedText(
                    f"{a.sensor} and {b.sensor} look exchanged: their readings lie {as_wired:.1f} K from the model, but {other:.1f} K "
                    "with the columns exchanged. Check the wiring and the header of the log",
                    "record.sensors-exchanged",
                )


def extrapolations(test: TestTable, run: Foresight, validity: ValidityTable, nodes: Sequence[str], ahead: str = "") -> tuple[str, ...]:
    """Return in words where a run leaves the conditions of the calibration; conditions that the plan does not state are named too.

    Parameters
    ----------
    test : TestTable            The test, with its gravity and orientation.
    run : Foresight             Its prediction.
    validity : ValidityTable    Temperature, pressure, power of the whole unit, gravity and orientation of the calibration.
    nodes : sequence of str     Nodes whose temperature counts.
    ahead : str                 Prefix of the paths of the unit's loads.
    """
    out = []
    unsaid = [k for k in ("temperature", "pressure", "power", "gravity", "orientation") if not getattr(validity, k)]
    if unsaid:
        out.append(f"{', '.join(unsaid)}: the plan does not give the range of the calibration")
    unsaid = [k for k in ("gravity", "orientation") if getattr(validity, k) and not getattr(test, k)]
    if unsaid:
        out.append(f"{', '.join(unsaid)}: not given for this test")
    times, media = run.solution.times, run.scenario.environment.values()
    powers = [np.broadcast_to(w, times.shape) for load, w in run.solution.load_powers.items() if load.startswith(ahead)]
    courses: dict[str, tuple[str, list[Any]]] = {
        "temperature": ("degC", [run.prediction[n].celsius for n in nodes]),
        "pressure": ("Pa", [e.pressure.at(times) for e in media] or [ATMOSPHERE]),
        "power": ("W", [np.sum(powers, axis=0) if powers else 0.0]),
        "gravity": ("m/s^2", [literal(test.gravity, "m/s^2", f"{test.name}, gravity")] if test.gravity else []),
    }
    for key, (name, values) in courses.items():
        ends = getattr(validity, key) if values else ()
        if not ends:
            continue
        slot, zero, digits = (TEMPERATURE, ICE_POINT, ".0f") if key == "temperature" else (name, 0.0, ".3g")
        low, high = (literal(ends[k], slot, f"validity.{key}") - zero for k in (0, -1))
        least, most = min(float(np.min(x)) for x in values), max(float(np.max(x)) for x in values)
        # how far beyond an end counts as inside: rounding of what is stated and computed
        slack = {"temperature": (0.05, 0.05), "pressure": (0.001 * low, 0.001 * high), "gravity": (1e-6, 1e-6)}
        below, above = slack.get(key, (0.001 * high, 0.001 * high))
        if least < low - below or most > high + above:
            here = f"{least:{digits}}" if key == "gravity" else f"{least:{digits}} .. {most:{digits}}"
            out.append(f"{key} {here} {name}; calibrated {low:{digits}} .. {high:{digits}} {name}")
    if validity.orientation and test.orientation and test.orientation not in validity.orientation:
        out.append(f"orientation {test.orientation}; calibrated {', '.join(validity.orientation)}")
    return tuple(out)


def pre_test(plan: Plan) -> dict[str, dict[str, dict[str, Any]]]:
    """Return test -> sensor -> lowest, highest and last predicted temperature, each with its standard error; no log is read. [degC, K]"""
    out: dict[str, dict[str, dict[str, Any]]] = {}
    for test in plan.tests:
        prediction = run_test(plan, test.model_copy(update={"log": None})).foresight.prediction
        out[test.name] = {}
        for sensor, (node, _) in sensors_of(plan, test).items():
            band = prediction[node]
            error, kelvin = band.error, band.kelvin
            places = {"lowest": int(kelvin.argmin()), "highest": int(kelvin.argmax()), "last": -1}
            out[test.name][sensor] = {f"{word}_C": round(float(kelvin[k]) - ICE_POINT, 3) for word, k in places.items()}
            out[test.name][sensor] |= {f"{word}_error_K": round(float(error[k]), 4) for word, k in places.items()}
    return out
