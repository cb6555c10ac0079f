"""One test of a plan: its course, what is expected of it, its limits, and its log where one has come back."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from thermid.identify.compare import compare
from thermid.measure import Record, read_record
from thermid.model.modelfile import resolve_inside
from thermid.model.signal import literal
from thermid.qualify.assumptions import extrapolations
from thermid.qualify.conduct import run_profile
from thermid.qualify.correlation import Correlation, Exclusions, correlate, overlays, paired
from thermid.qualify.diagnosis import Diagnosis, diagnose
from thermid.qualify.foresight import Foresight, Known, foresee
from thermid.qualify.limits import LimitCheck, Limits, check_limits
from thermid.qualify.margins import HeaterDuty, heater_duty
from thermid.qualify.plan import Plan
from thermid.qualify.profile_run import ProfileRun
from thermid.qualify.profiles import profile_from
from thermid.simulation.scenario import Scenario, load_scenario

if TYPE_CHECKING:
    from thermid.identify.calibration import Calibration
    from thermid.qualify.plan_schema import TestTable

__all__ = ["Trial", "sensors_of", "tried"]

LONG = 3600.0
"""Stays of at least so long end settled. [s]"""
STORED = 1500
"""At most so many stored times of a run: two minutes over two days."""


@dataclass(frozen=True, eq=False)
class Trial:
    """One test of a plan.

    Parameters
    ----------
    test : TestTable                As planned.
    known : Known                   The model that it was predicted with.
    foresight : Foresight           What is expected of it.
    limits : tuple of Limits        Under their paths in that model.
    checks : tuple of LimitCheck    What is expected, against the limits.
    course : ProfileRun or None     Where a profile says the course: its phases.
    heaters : tuple of HeaterDuty
    outside : tuple of str          Where it leaves the conditions of the calibration.
    told : Calibration or None      Readings beside the model in what was done, where a log has come back.
    correlation : Correlation or None
    diagnosis : Diagnosis or None   What would explain the deviations, where a criterion is not met.
    log_sha256 : str                Hash of the log.
    synthetic : bool                Whether the log was made and not measured.
    """

    test: TestTable
    known: Known
    foresight: Foresight
    limits: tuple[Limits, ...]
    checks: tuple[LimitCheck, ...]
    course: ProfileRun | None = None
    heaters: tuple[HeaterDuty, ...] = ()
    outside: tuple[str, ...] = ()
    told: Calibration | None = field(default=None, repr=False)
    correlation: Correlation | None = None
    diagnosis: Diagnosis | None = None
    log_sha256: str = ""
    synthetic: bool = False

    @property
    def within(self) -> bool | None:
        """Whether no limit is passed by what is expected; None where a limit, or the course, is from memory and none that decides is."""
        found = [c.passed for c in self.checks] + [h.passed for h in self.heaters]
        if self.course is not None and not self.course.decides:
            found.append(None)
        return False if False in found else None if None in found else True

    @property
    def correlated(self) -> bool | None:
        """Whether every set of criteria is met; None without a log, or where no set may decide."""
        if self.correlation is None:
            return None
        found = list(self.correlation.verdicts.values())
        return False if False in found else None if None in found else True

    @property
    def passed(self) -> bool | None:
        """Whether limits and criteria are met; without a log the limits alone."""
        found = [self.within] + ([self.correlated] if self.correlation is not None else [])
        return False if False in found else None if None in found else True

    @property
    def worst(self) -> LimitCheck | None:
        """The check that comes nearest to a limit."""
        return min((c for c in self.checks if np.isfinite(c.room)), key=lambda c: c.room, default=None)

    def to_dict(self) -> dict[str, Any]:
        """Return it as plain numbers."""
        checks = [
            {
                "point": c.point,
                "state": c.state,
                "lowest_C": c.lowest - 273.15,
                "highest_C": c.highest - 273.15,
                "room_K": c.room if np.isfinite(c.room) else None,
                "passed": c.passed,
                "crossings": [{"side": x.side, "time_s": x.time, "worst_C": x.worst - 273.15, "outside_s": x.outside} for x in c.crossings],
            }
            for c in self.checks
        ]
        out: dict[str, Any] = {"name": self.test.name, "kind": self.test.kind, "state": self.test.state, "passed": self.passed}
        out |= {"within_limits": self.within, "limits": checks, "outside_calibration": list(self.outside), "correlation": None}
        if self.correlation is not None:
            out["correlation"] = self.correlation.to_dict()
            out["diagnosis"] = None if self.diagnosis is None else {"group": self.diagnosis.group, "groups": dict(self.diagnosis.groups)}
        return out

    def __str__(self) -> str:
        """Return it as text."""
        words = {True: "met", False: "NOT met", None: "not decided"}
        lines = [f"{self.test.name} ({self.test.kind}, {self.test.state}): limits {words[self.within]}"]
        if self.course is not None:
            lines[0] += (
                f"; {self.course.duration / 3600:.1f} h, of it {self.course.waited / 3600:.1f} h waiting; profile: {self.course.trust}"
            )
        if self.worst is not None:
            lines.append(f"  nearest: {self.worst}")
        lines += [f"  {c}" for c in self.checks if c.crossings and c is not self.worst]
        for h in self.heaters:
            lines.append(f"  heater {h.load}: duty {100 * h.duty:.0f} %, at most {100 * h.most:.0f} %: {words[h.passed]}")
        lines += [f"  outside the calibration: {o}" for o in self.outside]
        if self.correlation is not None:
            for name, passed in self.correlation.verdicts.items():
                failed = [str(g) for g in self.correlation.failed if g.criteria == name]
                lines.append(f"  {name}: {words[passed]}" + (f" ({'; '.join(failed)})" if failed else ""))
            if self.diagnosis is not None:
                lines += [f"  {line}" for line in str(self.diagnosis).splitlines()]
        return "\n".join(lines)


def tried(plan: Plan, test: TestTable) -> Trial:
    """Return a test of a plan: predicted, held against limits, and judged where its log is there."""
    known, limits = plan.hosted(test.host), plan.limits_on(test.host)
    scenario, course = _course(plan, test, known)
    sensors = sensors_of(plan, test)
    points = list(dict.fromkeys([x.node for x in limits] + [n for n, _ in sensors.values()]))
    step = max(literal(test.every, "s", f"{test.name}, every"), scenario.seconds / STORED)
    times = np.linspace(0.0, scenario.seconds, int(np.ceil(scenario.seconds / step)) + 1)
    told = foresee(known, scenario, nodes=points, spread=test.spread, times=times)
    checks = check_limits(told.solution, limits, state="operating" if test.operating else "non-operating")
    heaters = tuple(
        heater_duty(told, load, literal(power, "W", f"{test.name}, heaters.{load}"), name=test.name, policy=plan.content.margins.policy)
        for load, power in test.heaters.items()
    )
    ahead = f"{known.at}." if known.at else ""
    outside = extrapolations(test, told, plan.content.validity, [x.node for x in limits], ahead)
    trial = Trial(test, known, told, limits, checks, course, heaters, outside)
    return trial if test.log is None else _judged(plan, trial, scenario, sensors)


def _course(plan: Plan, test: TestTable, known: Known) -> tuple[Scenario, ProfileRun | None]:
    """Return what is done to the model, and the phases where a profile says so."""
    if test.profile is not None:
        run = run_profile(
            known.model,
            profile_from(test.profile, plan.path.name, test.name),
            chamber=test.chamber,
            base=test.base,
            watch=test.watch,
            equipment=test.equipment,
            every=literal(test.every, "s", f"{test.name}, every"),
        )
        return replace(run.scenario, title=test.name), run
    if isinstance(test.scenario, str):
        return load_scenario(resolve_inside(plan.path.parent, test.scenario, f"{plan.path.name}, {test.name}")), None
    return Scenario(**({"title": test.name} | dict(test.scenario or {}))), None


def sensors_of(plan: Plan, test: TestTable) -> dict[str, tuple[str, Any]]:
    """Return sensor -> its node in the model of the test, and its table."""
    at = f"{plan.content.hosts[test.host].unit}." if test.host else ""
    wanted = test.sensors or list(plan.content.sensors)
    return {s: (at + plan.content.sensors[s].node, plan.content.sensors[s]) for s in wanted}


def _judged(plan: Plan, trial: Trial, scenario: Scenario, sensors: Mapping[str, tuple[str, Any]]) -> Trial:
    """Return a test with its log beside what the model, or another simulation, says of what was done."""
    test = trial.test
    log = test.log
    assert log is not None
    record = _record(plan, test, log.file, sensors, log.boundaries, log.loads)
    windows = [(literal(a, "s", f"{test.name}, steady"), literal(b, "s", f"{test.name}, steady")) for a, b in test.steady]
    windows = windows or _dwells(trial.course, record.duration)
    told: Calibration | None = None
    if log.simulated:
        other = _record(plan, test, log.simulated, sensors, {}, {})
        seen = paired(record, other, test.name)
    else:
        base = replace(scenario, start=log.start) if log.start else scenario
        told = compare(trial.known.model, record, scenario=_without(base, log.boundaries.values(), log.loads.values()))
        seen = overlays(told, test.name)
    excluded = plan.content.exclusions
    left_out = Exclusions({s: r for s, r in excluded.reasons.items() if s in {o.sensor for o in seen}}, excluded.cap)
    found = correlate(
        seen,
        [plan.criteria[n] for n in test.criteria],
        steady={test.name: windows} if windows else None,
        weights=test.weights,
        exclusions=left_out,
        title=test.name,
    )
    diagnosis = diagnose(told) if told is not None and found.failed and len({o.sensor for o in seen}) > 1 else None
    made = record.origin
    return replace(trial, told=told, correlation=found, diagnosis=diagnosis, log_sha256=made.sha256, synthetic=made.synthetic)


def _dwells(course: ProfileRun | None, end: float) -> list[tuple[float, float]]:
    """Return the last quarter of every long stay of a course, where its unit is settled; a log must have followed it."""
    stays = [p for p in course.phases if p.kind == "stay" and p.duration >= LONG] if course is not None else []
    return [(p.end - 0.25 * p.duration, p.end) for p in stays if p.end <= end]


def _without(scenario: Scenario, boundaries: Any, loads: Any) -> Scenario:
    """Return a scenario without what the log gives itself."""
    kept = {k: v for k, v in scenario.boundaries.items() if k not in set(boundaries)}
    logged = set(loads)
    return replace(
        scenario,
        boundaries=kept,
        loads={k: v for k, v in scenario.loads.items() if k not in logged},
        commands={k: v for k, v in scenario.commands.items() if k not in logged},
    )


def _record(
    plan: Plan, test: TestTable, file: str, sensors: Mapping[str, tuple[str, Any]], boundaries: Mapping[str, str], loads: Mapping[str, str]
) -> Record:
    """Return a log with what its columns are.

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
    found = next((f for root in roots if (f := root / file).is_file()), None) or resolve_inside(plan.path.parent, file, f"{test.name}, log")
    log = test.log
    time = log.time or None if log is not None else None
    record = read_record(found, channels, time=time, name=test.name)
    return record.prepare(log.prepare) if log is not None and log.prepare else record
