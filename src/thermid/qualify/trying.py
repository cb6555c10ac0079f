"""A test of a plan worked through: predicted, held against its limits, and judged where its log has come back."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from thermid.errors import NameNotFoundError, RecordError, ScenarioError, nearest
from thermid.explain.diagnosis import diagnose
from thermid.judge.correlation import Exclusions, Overlay, correlate, overlays, paired
from thermid.judge.limits import LimitCheck, Limits, check_limits, check_readings
from thermid.judge.margins import heater_duty
from thermid.judge.verdict import compare
from thermid.measure import Record, read_record
from thermid.measure.amounts import duration_text
from thermid.measure.record.steadiness import rule_of
from thermid.model.laws.signal import literal
from thermid.model.tree.flat import flatten
from thermid.physics.constants import ICE_POINT
from thermid.prediction.foresight import foresee
from thermid.prediction.known import Known
from thermid.profile_runs.conduct import run_profile
from thermid.profile_runs.profile_run import ProfileRun, in_short
from thermid.profiles.profile import ThermalProfile
from thermid.profiles.standards import profile_from
from thermid.qualify.assumptions import extrapolations
from thermid.qualify.plan import Plan
from thermid.qualify.trial import Trial
from thermid.simulation.scenario_file import load_scenario
from thermid.simulation.scenarios.scenario import Scenario
from thermid.simulation.solution import Solution
from thermid.steadiness.stabilisation import Stability, stability
from thermid.toml_files import resolve_inside

if TYPE_CHECKING:
    from thermid.fit.calibration import Calibration
    from thermid.qualify.plan_schema import TestTable

STORED = 6000
"""At most so many stored times of a run: two minutes over eight days."""
ENVIRONMENTAL = ("thermal cycling", "thermal vacuum", "thermal balance", "humidity")
"""Kinds of test whose levels somebody applies."""


def tried(plan: Plan, test: TestTable, told: Callable[[int, int, float], None] | None = None) -> Trial:
    """Return a test of a plan: predicted, held against limits, and judged where its log is there; `told` as in `run_profile`."""
    known, limits = plan.hosted(test.host), plan.limits_on(test.host)
    scenario, course = _course(plan, test, known, told)
    sensors = sensors_of(plan, test)
    _known_nodes(plan, known, limits, sensors)
    points = list(dict.fromkeys([x.node for x in limits] + [n for n, _ in sensors.values()]))
    step = max(literal(test.every, "s", f"{test.name}, every"), scenario.seconds / STORED)
    times = np.linspace(0.0, scenario.seconds, int(np.ceil(scenario.seconds / step)) + 1)
    seen = foresee(known, scenario, nodes=points, spread=test.spread, times=times)
    checks = check_limits(seen.solution, limits, state=_state(test))
    heaters = tuple(
        heater_duty(seen, load, literal(power, "W", f"{test.name}, heaters.{load}"), name=test.name, policy=plan.content.margins.policy)
        for load, power in test.heaters.items()
    )
    ahead = f"{known.at}." if known.at else ""
    outside = extrapolations(test, seen, plan.content.validity, [x.node for x in limits], ahead)
    remarks = in_short(course) if course is not None else ()
    trial = Trial(test, known, seen, limits, checks, course, heaters, outside, remarks=remarks)
    return trial if test.log is None else _judged(plan, trial, scenario, sensors)


def _known_nodes(plan: Plan, known: Known, limits: Sequence[Limits], sensors: Mapping[str, tuple[str, Any]]) -> None:
    """Refuse sensors and reference points at nodes that the model does not have.

    Raises
    ------
    NameNotFoundError   Which, and the nearest.
    """
    nodes = [n.path for n in flatten(known.model).nodes]
    asked = [(f"limits.{x.point}.node", x.node) for x in limits] + [(f"sensors.{s}.node", n) for s, (n, _) in sensors.items()]
    for key, node in asked:
        if known.model.canonical(node) not in nodes:
            raise NameNotFoundError(f"no node '{node}'.{nearest(node, nodes)}", f"{plan.path.name}, {key}")


def _course(
    plan: Plan, test: TestTable, known: Known, told: Callable[[int, int, float], None] | None
) -> tuple[Scenario, ProfileRun | None]:
    """Return what is done to the model, and the phases where a profile says so."""
    given: Scenario | None = None
    if isinstance(test.scenario, str):
        given = load_scenario(resolve_inside(plan.path.parent, test.scenario, f"{plan.path.name}, {test.name}"))
    elif test.scenario is not None or test.profile is None:
        given = Scenario(**({"title": test.name} | dict(test.scenario or {})))
    if test.profile is not None:
        run = run_profile(
            known.model,
            profile_from(test.profile, plan.path.name, test.name),
            chamber=test.chamber,
            base=test.base,
            watch=test.watch,
            equipment=test.equipment,
            scenario=_beside(given, test, known),
            every=literal(test.every, "s", f"{test.name}, every"),
            told=told,
        )
        return replace(run.scenario, title=test.name), replace(run, cycles_beside=_cycles_beside(plan, test, run.profile))
    assert given is not None
    return given, None


def _beside(given: Scenario | None, test: TestTable, known: Known) -> Scenario | None:
    """Return what is done beside a profile: loads, commands, other boundaries.

    Raises
    ------
    ScenarioError   When it says what the profile says: a time, or the temperature of the chamber.
    """
    if given is None:
        return None
    chamber = {known.model.canonical(n) for n in ([test.chamber] if isinstance(test.chamber, str) else test.chamber)}
    both = [n for n in given.boundaries if known.model.canonical(n) in chamber]
    if both or given.seconds > 0.0:
        what = f"boundary '{both[0]}' is the chamber" if both else "its duration follows from the unit"
        raise ScenarioError(
            f"{what}: the profile says it. A scenario beside a profile gives what else is done. Leave it out there.", "scenario"
        )
    return given


def _cycles_beside(plan: Plan, test: TestTable, profile: ThermalProfile) -> float:
    """Return how many cycles over at least the range of a profile the other tests of the plan run."""
    if not profile.has("base_cycles"):
        return 0.0
    others = [profile_from(t.profile, plan.path.name, t.name) for t in plan.tests if t.profile is not None and t.name != test.name]
    cycling = [p for p in others if p.kind in ("thermal cycling", "thermal vacuum") and not p.plan]
    least = profile.value("hot") - profile.value("cold") - 0.1
    return sum(p.value("cycles") for p in cycling if p.value("hot") - p.value("cold") >= least)


def sensors_of(plan: Plan, test: TestTable) -> dict[str, tuple[str, Any]]:
    """Return sensor -> its node in the model of the test, and its table."""
    at = f"{plan.content.hosts[test.host].unit}." if test.host else ""
    wanted = test.sensors or list(plan.content.sensors)
    return {s: (at + plan.content.sensors[s].node, plan.content.sensors[s]) for s in wanted}


def _state(test: TestTable) -> str:
    """Return the state of points whose limits name no loads."""
    return "operating" if test.operating else "non-operating"


def _judged(plan: Plan, trial: Trial, scenario: Scenario, sensors: Mapping[str, tuple[str, Any]]) -> Trial:
    """Return a test with its log beside what the model, or another simulation, says of what was done."""
    test = trial.test
    log = test.log
    assert log is not None
    record = _record(plan, test, log.file, sensors, log.boundaries, log.loads)
    windows = [(literal(a, "s", f"{test.name}, steady"), literal(b, "s", f"{test.name}, steady")) for a, b in test.steady]
    windows = windows or dwells(trial, [n for n, _ in sensors.values()], record.duration)
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
    counted = [o for o in seen if o.sensor not in left_out.reasons]
    settled, unsure = settled_by(trial, record, windows, [o.sensor for o in counted])
    steady = any("steady" in plan.criteria[n].kinds for n in test.criteria)
    made = record.origin
    return replace(
        trial,
        told=told,
        correlation=found,
        diagnosis=diagnosis,
        log_sha256=made.sha256,
        synthetic=made.synthetic,
        checks=(*trial.checks, *_measured(trial, counted, sensors)),
        doubts=(*_doubts(trial, record, counted, windows), *(unsettled(settled) if steady else ())),
        remarks=(*trial.remarks, *_state_remarks(test), *exchanged(counted), *unsure),
        settled=settled,
        as_logged={c: _ends(record, c) for c in log.boundaries},
    )


def _ends(record: Record, column: str) -> tuple[float, float]:
    """Return the lowest and highest valid reading of a column. [degC]"""
    channel = record[column]
    seen = channel.values[channel.valid] - ICE_POINT
    return (float(seen.min()), float(seen.max())) if seen.size else (np.nan, np.nan)


def _state_remarks(test: TestTable) -> list[str]:
    """Return what the state of a test with a log leaves to mend."""
    return [f"its state is '{test.state}', and a log has come back: write state = \"run\""] if test.state == "planned" else []


def _measured(trial: Trial, counted: Sequence[Overlay], sensors: Mapping[str, tuple[str, Any]]) -> tuple[LimitCheck, ...]:
    """Return the readings held against the limits of the reference points that their sensors sat at."""
    find = trial.known.model.canonical
    limits = [replace(x, node=find(x.node)) for x in trial.limits]
    readings = [(find(sensors[o.sensor][0]), o.times, o.measured) for o in counted]
    return check_readings(readings, limits, trial.foresight.solution, state=_state(trial.test))


def _doubts(trial: Trial, record: Record, counted: Sequence[Overlay], windows: Sequence[tuple[float, float]]) -> Iterator[str]:
    """Yield what the log does not show of the test."""
    test, run = trial.test, trial.foresight.solution
    log = test.log
    assert log is not None
    # a chamber that follows the unit takes its own time; settled stretches that are stated then belong to the log
    own_pace = trial.course is not None and test.steady
    yield from not_covered(counted, 0.0, record.duration if own_pace else float(run.times[-1]), windows)
    yield from not_reached(record, run, log.boundaries)
    if test.kind in ENVIRONMENTAL:
        missing = sorted({*trial.foresight.scenario.boundaries} - {*log.boundaries.values()})
        if missing and not log.simulated:
            listed = ", ".join(f"'{n}'" for n in missing)
            yield f"no column of the log gives {listed}: that its levels were applied is not measured"


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


LONG = 3600.0
"""Stays of at least so long end settled. [s]"""


def settled_by(
    trial: Trial, record: Record, windows: Sequence[tuple[float, float]], sensors: Sequence[str]
) -> tuple[tuple[Stability, ...], tuple[str, ...]]:
    """Return what the readings say about every settled stretch by the test's rule, and where they say nothing."""
    out: list[Stability] = []
    unsure: dict[str, list[str]] = {}
    for begin, end in windows if sensors else ():
        try:
            found = stability(record, trial.test.stable, sensors, since=begin, at=end, run=trial.foresight.solution, unit=trial.known.at)
        except RecordError as error:
            unsure.setdefault(f"that it is settled cannot be told: {error}", []).append(_span(begin, end))
            continue
        out.append(found)
        if found.verdict == "cannot tell":
            unsure.setdefault(f"the readings cannot tell whether '{found.rule.name}' holds at {found.slowest}", []).append(
                _span(begin, end)
            )
    more = {why: f" and {len(spans) - 1} more" if len(spans) > 1 else "" for why, spans in unsure.items()}
    return tuple(out), tuple(f"{spans[0]}{more[why]}: {why}" for why, spans in unsure.items())


def unsettled(settled: Sequence[Stability]) -> Iterator[str]:
    """Yield the stretches that count as settled and are not."""
    for s in settled:
        worst = s.channels[s.slowest]
        if s.verdict == "not stable" and s.decides and s.stored is not None:
            yield f"{_span(worst.start, worst.end)} counts as settled and is not: {s.stored} by '{s.rule.name}' [{s.rule.mark}]"
        elif s.verdict == "not stable" and s.decides:
            yield (
                f"{_span(worst.start, worst.end)} counts as settled and is not: {s.slowest} drifts by {3600.0 * worst.rate:+.2f} K/h, "
                f"the rule is '{s.rule.name}' [{s.rule.mark}]"
            )


def _span(begin: float, end: float) -> str:
    return f"the stretch {begin / 3600.0:.4g} .. {end / 3600.0:.4g} h"


def dwells(trial: Trial, nodes: Sequence[str], end: float) -> list[tuple[float, float]]:
    """Return the last part of every long stay of a course in which its unit is expected to be settled; a log must have followed it.

    Stays that nothing waited for, such as those of humidity tests, may begin and end while the unit still drifts: those are left out.
    """
    rule, run = rule_of(trial.test.stable), trial.foresight.solution
    stays = [p for p in trial.course.phases if p.kind == "stay" and p.duration >= LONG] if trial.course is not None else []
    out = []
    for p in (p for p in stays if p.end <= end):
        window = (p.end - max(0.25 * p.duration, 0.5 * LONG), p.end)
        moved = (run[n].at(window) for n in nodes)
        drift = max(abs(float(end - begin)) for begin, end in moved) / (window[1] - window[0])
        if rule.stored or drift <= rule.rate:
            out.append(window)
    return out


Array = NDArray[np.float64]
Window = tuple[float, float]
LEVEL = 3.0
"""How far a test's temperature may be off its level: SMC-S-016, 4.7 (read). [K]"""
MISSING = 0.02
"""Share of a test without readings from which it counts as not covered. [-]"""
GAP = 5.0
"""A pause is a gap from so many usual intervals on."""
THERE = 0.9
"""Share of the planned time at a level that must have been spent there. [-]"""
CLEAR = 1.0
"""Deviation from which it is asked whether two sensors were exchanged. [K]"""


def not_covered(seen: Sequence[Overlay], begin: float, end: float, windows: Sequence[Window] = ()) -> Iterator[str]:
    """Yield which part of a test, or of a settled stretch of it, no valid reading covers; sensors with the same lack together.

    Parameters
    ----------
    seen : sequence of Overlay  Readings that count.
    begin, end : float          Of the test as it is simulated. [s]
    windows : sequence          Settled stretches. [s]
    """
    lacks: dict[str, list[str]] = {}
    for o in seen:
        missing, longest, at = _missing(o.times, begin, end)
        if missing > MISSING * (end - begin):
            text = f"for {duration_text(missing)} of {duration_text(end - begin)}; the longest gap, {duration_text(longest)}, is at "
            lacks.setdefault(f"{text}{at / 3600.0:.2f} h", []).append(o.sensor)
        for a, b in windows:
            lost, _, _ = _missing(o.times, a, b)
            if lost > (1.0 - THERE) * (b - a):
                text = f"for {duration_text(lost)} of the settled stretch {a / 3600.0:.4g} .. {b / 3600.0:.4g} h"
                lacks.setdefault(text, []).append(o.sensor)
    for text, sensors in lacks.items():
        yield f"there is no reading of {', '.join(sensors)} {text}"


def _missing(times: Array, begin: float, end: float) -> tuple[float, float, float]:
    """Return the time without readings between two instants, the longest gap and its begin. [s]"""
    inside = times[(times >= begin) & (times <= end)]
    if inside.size < 2:
        return end - begin, end - begin, begin
    usual = float(np.median(np.diff(inside)))
    points = np.concatenate([[begin], inside, [end]])
    gaps = [(b - a, a) for a, b in pairwise(points.tolist()) if b - a > GAP * usual]
    longest, at = max(gaps, default=(0.0, begin))
    return float(sum(g for g, _ in gaps)), float(longest), float(at)


def not_reached(record: Record, planned: Solution, boundaries: Mapping[str, str], tolerance: float = LEVEL) -> Iterator[str]:
    """Yield which planned level of a boundary the log does not show, on either side.

    What counts is the time spent within the tolerance of the planned extreme, or beyond it.

    Parameters
    ----------
    record : Record         The log.
    planned : Solution      The test as it was planned.
    boundaries : dict       Column -> boundary that it drives.
    tolerance : float       [K]
    """
    for column, boundary in boundaries.items():
        channel, trace = record[column], planned[boundary]
        times, values = record.times[channel.valid], channel.values[channel.valid]
        inside = times <= trace.times[-1]
        for word, sign in (("hot", 1.0), ("cold", -1.0)):
            level = float((sign * trace.kelvin).max())
            wanted = _time_above(trace.times, sign * trace.kelvin, level - tolerance)
            found = _time_above(times[inside], sign * values[inside], level - tolerance)
            if found < THERE * wanted:
                furthest = sign * float((sign * values).max()) - ICE_POINT
                yield (
                    f"the {word} level of '{boundary}', {sign * level - ICE_POINT:.1f} degC for {duration_text(wanted)}, was not applied: "
                    f"{column} goes to {furthest:.1f} degC and is within {tolerance:g} K of it for {duration_text(found)}"
                )


def _time_above(times: Array, values: Array, level: float) -> float:
    """Return how long a trace is at or above a level, by the nearer of its samples. [s]"""
    if times.size < 2:
        return 0.0
    width = np.gradient(times)
    width[[0, -1]] *= 0.5
    return float(width[values >= level].sum())


def exchanged(seen: Sequence[Overlay]) -> Iterator[str]:
    """Yield pairs of sensors whose readings fit far better when they change places."""
    for k, a in enumerate(seen):
        for b in seen[k + 1 :]:
            if a.times.size != b.times.size or not np.array_equal(a.times, b.times):
                continue
            own = float(np.sqrt(np.mean((a.measured - a.simulated) ** 2 + (b.measured - b.simulated) ** 2)))
            other = float(np.sqrt(np.mean((a.measured - b.simulated) ** 2 + (b.measured - a.simulated) ** 2)))
            if own > CLEAR and other < own / 3.0:
                yield (
                    f"{a.sensor} and {b.sensor} look exchanged: their readings lie {own:.1f} K from the model, and {other:.1f} K with the "
                    "columns changed over. Check the wiring and the header of the log"
                )
