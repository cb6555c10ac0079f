"""What can be run in the studio - profiles, scenarios, conditions of logs, tests of plans - and what it came to, held against limits."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from thermid.app.studio.desk import Desk, Window, texts_of, thinned_curve
from thermid.base.errors import ScenarioError, ThermidError, look_up, refuse_unknown
from thermid.base.files import project_root, read_toml
from thermid.base.results import weigh
from thermid.base.units import ICE_POINT, duration_text
from thermid.campaign.stages import LimitCheck, Limits, Margin, check_limits, margins, read_limits, spans
from thermid.model.tree import UNJUDGED, Standing
from thermid.prediction.bands import Band, Knowledge, foresee
from thermid.qualify.plans import Qualification, Trial, load_plan, run_plan
from thermid.qualify.profiles import ProfileRun, ThermalProfile, load_profile, profile_names, profile_of, run_profile, typed
from thermid.simulation.runs import Solution, compile_network, simulate


@dataclass(frozen=True)
class Course:
    """Something that can be run.

    Parameters
    ----------
    key : str       By which a page names it.
    title, group    What it is called, and what it belongs to.
    kind : str      'profile', 'scenario', 'record' or 'test'.
    of : tuple      Standard, profile and level; or file and name.
    """

    key: str
    title: str
    group: str
    kind: str
    of: tuple[Any, ...] = field(repr=False)


class Shelf:
    """All that can be run with one deck or campaign, and the limits that are kept beside it.

    Parameters
    ----------
    path : Path     The deck or campaign; its folder, the folders in it, and the one above within the project are looked at.
    """

    def __init__(self, path: Path) -> None:
        self.folder = path.parent
        self._tables = {f: content for f in _files(self.folder) if (content := _read(f))}
        self._qualified: dict[Path, tuple[Qualification, tuple[str, ...]]] = {}

    def courses(self, desk: Desk) -> dict[str, Course]:
        """Return key -> what can be run on a desk's model, or on a plan's own."""
        kind, group = ("record", "As in its logs") if desk.problem is not None else ("scenario", "Scenarios")
        courses = [Course(f"{kind} {k}", title, group, kind, (k,)) for k, title in enumerate(desk.runs)]
        courses += self._written()
        for standard, profiles in profile_names().items():
            for name, level in ((name, level) for name, levels in profiles.items() for level in levels or ("",)):
                title = f"{name}, {level}" if level else name
                courses.append(Course(f"{standard} {title}", title, standard, "profile", (standard, name, level)))
        return {c.key: c for c in courses}

    def course(self, desk: Desk, key: str) -> Course:
        """Return one of them.

        Raises
        ------
        NameNotFoundError   When there is none of that key.
        """
        return look_up(key, self.courses(desk), "unknown run '{}'.", desk.title)

    def limits(self, desk: Desk) -> tuple[tuple[Limits, ...], str]:
        """Return the limits beside the deck whose nodes its model has, and the files that hold them."""
        network = compile_network(desk.model)
        nodes, loads = set(network.nodes), {load.path for load in network.flat.loads}
        out: dict[str, Limits] = {}
        files: dict[str, None] = {}
        for file, content in self._tables.items():
            if not content or not all(isinstance(t, Mapping) and {"node", "operating"} <= set(t) for t in content.values()):
                continue
            try:
                fitting = [one for one in read_limits(content, file.name) if one.node in nodes and set(one.loads) <= loads]
            except ThermidError:
                continue  # a plan or a check that reads them says why
            out |= {one.point: one for one in fitting if one.point not in out}
            if fitting:
                files[file.name] = None
        return tuple(out.values()), ", ".join(files)

    def _written(self) -> Iterator[Course]:
        """Yield the profiles and the tests of plans that stand in the files."""
        for file, content in self._tables.items():
            name = file.name
            if isinstance(content.get("profile"), Mapping):
                yield Course(
                    f"profile {self._at(file)}", str(content["profile"].get("title", name)), "Profiles of files", "profile", (file,)
                )
            tests = content.get("tests")
            if isinstance(content.get("model"), Mapping) and isinstance(tests, list):
                for test in tests:
                    if isinstance(test, Mapping) and "name" in test:
                        group = f"Plan {name}, on its own model"
                        yield Course(f"test {self._at(file)} {test['name']}", str(test["name"]), group, "test", (file, str(test["name"])))

    def qualified(self, file: Path, progress: Told) -> tuple[Qualification, tuple[str, ...]]:
        """Return what `thermid qualify` says of a plan, worked out once, and a remark where its logs are not read.

        Reading them before the plan is locked would spoil the lock, so the tests are then as they were before their logs.
        """
        if file not in self._qualified:
            plan, begun = load_plan(file), 0
            unread = plan.lock_status().state == "open" and any(t.log is not None for t in plan.tests)
            if unread:
                tests = [t.model_copy(update={"log": None}) for t in plan.tests]
                plan = replace(plan, content=plan.content.model_copy(update={"tests": tests}))

            def notice(name: str) -> None:
                """Tell that another test begins."""
                nonlocal begun
                progress(begun, len(plan.tests), 0.0)
                begun += 1

            words = "The logs of the plan are not read, because the plan is not locked. Lock it by thermid plan --lock."
            self._qualified[file] = run_plan(plan, notice=notice), (words,) if unread else ()
        return self._qualified[file]

    def _at(self, file: Path) -> str:
        """Return the name of a file, from the root of its project where it lies in it."""
        return file.relative_to(project_root(self.folder)).as_posix() if file.is_relative_to(project_root(self.folder)) else file.name


def profile_for(course: Course, changes: Mapping[str, Any]) -> ThermalProfile:
    """Return a profile with what was changed on the page.

    Parameters
    ----------
    course : Course     Of kind 'profile'.
    changes : dict      ``lowest`` and ``highest`` predicted [degC], ``numbers``: name -> text, in its usual unit where it has none.

    Raises
    ------
    ScenarioError   When a number is none, or one of the two predicted temperatures is missing.
    """
    profile = load_profile(course.of[0]) if len(course.of) == 1 else profile_of(course.of[0], course.of[1], level=course.of[2])
    ends = [changes.get("lowest"), changes.get("highest")]
    if (ends[0] is None) != (ends[1] is None):
        raise ScenarioError(
            "give both the lowest and the highest predicted temperature, or neither.", course.title, code="value.incomplete"
        )
    numbers = changes.get("numbers", {})
    if not isinstance(numbers, Mapping) or not all(isinstance(v, str) for v in numbers.values()):
        raise ScenarioError("give numbers as texts by name.", course.title, code="value.wrong-kind")
    try:
        predicted = None if ends[0] is None else [f"{float(str(v))!r} [degC]" for v in ends]
    except ValueError:
        raise ScenarioError(
            f"give the predicted temperatures as numbers, not {ends[0]!r} and {ends[1]!r}.", course.title, code="value.wrong-kind"
        ) from None
    changed: dict[str, Any] = {str(k): typed(str(k), v) for k, v in numbers.items() if v.strip()}
    return profile.with_(predicted=predicted, **changed)


def profile_object(profile: ThermalProfile) -> dict[str, Any]:
    """Return a profile's numbers with clauses and marks, as a page lists them; those not known yet with the reason."""
    try:
        steps, remarks, trust, lacking = len(profile.steps), list(profile.check()), profile.trust, ""
    except ScenarioError as error:
        steps, remarks, trust, lacking = 0, [], "", error.message
    numbers = profile.numbers if lacking else profile.used
    return {
        "title": profile.title,
        "kind": profile.kind,
        "note": profile.note,
        "numbers": {k: n.to_dict() for k, n in numbers.items()},
        "steps": steps,
        "remarks": remarks,
        "trust": trust,
        "lacking": lacking,
    }


def _files(folder: Path) -> list[Path]:
    """Return the decks, plans and tables that may belong to a file of a folder."""
    root = project_root(folder)
    near = sorted(folder.glob("*.toml")) + sorted(folder.glob("*/*.toml"))
    above = sorted(folder.parent.glob("*.toml")) if folder.parent.is_relative_to(root) else []
    return [f for f in dict.fromkeys([*near, *above]) if f.resolve().is_relative_to(root)]


def _read(file: Path) -> dict[str, Any]:
    """Return the content of a file; empty where it does not read."""
    try:
        return read_toml(file)[0]
    except ThermidError:
        return {}


Told = Callable[[int, int, float], None]
STORED_TIMES = 3000
"""Stored times of a scenario."""
SHOWN_NODES = 12
"""Nodes shown beside those that have limits: the widest swings."""


@dataclass(frozen=True, eq=False)
class Outcome:
    """A run held against limits.

    Parameters
    ----------
    title : str                     What was run, on what.
    solution : Solution
    limits : tuple of Limits        Under the paths of the run's model.
    checks : tuple of LimitCheck    Every point in every state that it was in.
    course : ProfileRun or None     The phases, where a profile says the course.
    margins : tuple of Margin       Where the uncertainty of a fit is known.
    bands : dict                    Node -> what is expected of it with its error, likewise.
    state : str                     Of points whose limits name no loads.
    source : str                    Where the limits stand.
    remarks : tuple of str          What a reader must know.
    standing : Standing             Of the values that it was run with.
    trial : Trial                   Of a plan, where it is a test of one.
    open : tuple of str             Why it decides nothing, beside what the run itself says.
    """

    title: str
    solution: Solution
    limits: tuple[Limits, ...]
    checks: tuple[LimitCheck, ...]
    course: ProfileRun | None = None
    margins: tuple[Margin, ...] = ()
    bands: Mapping[str, Band] | None = None
    state: str = "operating"
    source: str = ""
    remarks: tuple[str, ...] = ()
    standing: Standing = UNJUDGED
    trial: Trial | None = None
    open: tuple[str, ...] = ()

    @property
    def passed(self) -> bool | None:
        """Whether limits and margins are met, and what a plan asks of its test; None where that is not decided, see `undecided`."""
        decisions = [c.passed for c in self.checks] if self.trial is None else [self.trial.passed]
        return weigh([*decisions, *(m.passed for m in self.margins), *([None] if self.undecided else [])])

    @property
    def undecided(self) -> tuple[str, ...]:
        """Why it is not decided, as far as it is not."""
        out = [*self.open, *(c.undecided for c in self.checks if c.undecided)]
        out += [f"margin of {m.point}, {m.side}: {m.undecided}" for m in self.margins if m.undecided]
        if self.course is not None:
            missing = self.course.profile.missing_cycles(self.course.cycles_beside)
            out += [] if self.course.profile.decides else ["numbers of the profile are quoted from memory"]
            out += [f"{missing:g} of the cycles that the clause requires are missing"] if missing > 0.0 else []
        return tuple(dict.fromkeys([*out, *(self.trial.open if self.trial is not None else ())]))

    @property
    def worst(self) -> LimitCheck | None:
        """The check that comes nearest to a limit, or passes it furthest."""
        return min((c for c in self.checks if np.isfinite(c.room)), key=lambda c: c.room, default=None)

    @property
    def shown(self) -> tuple[str, ...]:
        """Nodes whose curves are shown: chamber, base, those with limits, then the widest swings."""
        course = self.course
        first = [*(course.chamber[:1] if course is not None else ()), *([course.base] if course is not None and course.base else [])]
        first += [one.node for one in self.limits]
        driven = set(course.chamber) if course is not None else set()
        swings = sorted((n for n in self.solution.nodes if n not in driven), key=lambda n: -float(np.ptp(self.solution[n].kelvin)))
        nodes = list(dict.fromkeys(self.solution[n].path for n in first))
        return tuple(dict.fromkeys([*nodes, *swings[: max(SHOWN_NODES - len(nodes), 0)]]))


def run_course(shelf: Shelf, desk: Desk, course: Course, values: Mapping[str, float], query: Mapping[str, Any], progress: Told) -> Outcome:
    """Return what a course comes to, with the sliders' values; a plan's test runs on the plan's own model.

    Parameters
    ----------
    shelf, desk, course     What is run, and on what.
    values : dict           Slider -> value in its unit.
    query : dict            Of a profile as in `profile_for`, ``chamber``, ``base``; of a scenario ``gas``; ``state``, ``uncertain``.
    progress : callable     Told how far it is; what it raises ends the run.

    Raises
    ------
    ThermidError   When it cannot be run; the message says why.
    """
    if course.kind == "test":
        return _tested(shelf, course, progress)
    state = str(query.get("state") or "operating")
    run: ProfileRun | None = None
    if course.kind == "profile":
        chamber = list(texts_of(query, "chamber") or desk.boundaries)
        run = run_profile(
            desk.tuned(values), profile_for(course, query), chamber=chamber, base=str(query.get("base") or ""), progress=progress
        )
        solution, scenario = run.solution, run.scenario
    else:
        model, scenario = desk.run_of(course.of[0], values, sensors=False)
        gas = str(query.get("gas") or "air")
        refuse_unknown([gas], ("air", "vacuum", "printed"), "studio", "'{}' is not one of {known}.", ScenarioError)
        scenario = scenario if gas == "air" else scenario.vacuum(gas == "printed")
        solution = simulate(model, scenario, every=max(scenario.seconds / STORED_TIMES, 1e-3))
    limits, source = shelf.limits(desk)
    checks = check_limits(solution, limits, state=state)
    progress(1, 1, scenario.seconds)
    rooms: tuple[Margin, ...] = ()
    bands: Mapping[str, Band] | None = None
    if query.get("uncertain") and limits:
        if desk.calibration is None or values:
            raise ScenarioError(
                "the uncertainty applies to fitted values only. Run the stage, and reset the sliders (Reset).",
                desk.title,
                code="studio.not-now",
            )
        expected = foresee(Knowledge.of_source(desk.calibration), scenario, nodes=[one.node for one in limits], times=solution.times)
        rooms, bands = margins({course.title: expected}, limits, states={course.title: state}), expected.prediction.bands
    remarks = run.remarks if run is not None else tuple(solution.warnings)
    fewer: tuple[str, ...] = ()
    if run is not None and run.profile.has("cycles"):
        whole, done = profile_for(course, {}).value("cycles"), run.profile.value("cycles")
        fewer = (f"{done:g} of {whole:g} cycles were run",) if done < whole else ()
    title = f"{course.title} on {desk.title}"
    return Outcome(title, solution, limits, checks, run, rooms, bands, state, source, tuple(remarks), open=fewer)


def _tested(shelf: Shelf, course: Course, progress: Told) -> Outcome:
    """Return a plan's test as the whole plan has it; no log is read before the plan is locked, or its logs were looked at."""
    file, name = course.of
    done, unread = shelf.qualified(file, progress)
    trial = done[name]
    title = f"{name} on {trial.knowledge.model.title}"
    remarks = (*(trial.course.remarks if trial.course is not None else ()), *trial.outside, *unread)
    return Outcome(
        title,
        trial.foresight.solution,
        trial.limits,
        trial.checks,
        trial.course,
        done.cases[name],
        trial.foresight.prediction.bands,
        "operating" if trial.test.operating else "non-operating",
        file.name,
        remarks,
        trial.foresight.standing,
        trial,
    )


def outcome_object(outcome: Outcome, window: Window = None) -> dict[str, Any]:
    """Return a run for a page: curves thinned to a window, all else whole."""
    run, solution = outcome.course, outcome.solution
    return {
        "title": outcome.title,
        "duration": float(solution.times[-1]),
        "waited": None if run is None else run.waited,
        "trust": "" if run is None else run.profile.trust,
        "decides": run is None or run.profile.decides,
        "standing": outcome.standing.to_dict(),
        "verdict": _doubted(outcome, _verdict(outcome)),
        "passed": outcome.passed,
        "test": None if outcome.trial is None else outcome.trial.to_dict(),
        "worst": _check(outcome.worst) if outcome.worst is not None else None,
        "phases": []
        if run is None
        else [
            {"name": p.name, "cycle": p.cycle, "kind": p.kind if p.power else "off", "from": p.start, "to": p.end}
            | {"rule": p.rule, "slowest": p.slowest}
            for p in run.phases
        ],
        "levels": [] if run is None else _levels(run),
        "nodes": len(solution.nodes),
        "curves": [_curve(outcome, n, window) for n in outcome.shown],
        "points": [_point(outcome, one) for one in outcome.limits],
        "checks": [_check(c) for c in outcome.checks],
        "margins": [_margin(m) for m in outcome.margins],
        "source": outcome.source,
        "moisture": _moisture(run, window),
        "remarks": list(outcome.remarks),
    }


def _doubted(outcome: Outcome, verdict: dict[str, str]) -> dict[str, str]:
    """Return a verdict that decides nothing where the values of the run are not credible or failed."""
    state, why = outcome.standing.state.upper(), outcome.standing.reason()
    if outcome.standing.fair:
        return verdict
    if outcome.standing.usable:
        return {**verdict, "text": f"The values are {state}: {why}. {verdict['text']}"}
    return {"word": "not decided", "text": f"The values are {state}, so do not use them: {why}. With them: {verdict['text']}"}


def _verdict(outcome: Outcome) -> dict[str, str]:
    """Return the worst part and time as a sentence, with a word that a mark can stand for."""
    worst, run = outcome.worst, outcome.course
    if worst is None:
        driven = set(run.chamber) if run is not None else set()
        nodes = [n for n in outcome.solution.nodes if n not in driven]
        hot = max(nodes, key=lambda n: outcome.solution[n].highest)
        trace = outcome.solution[hot].maximum
        at = duration_text(trace.time)
        why = "No limits are stored for the nodes of this deck"
        return {"word": "open", "text": f"{why}. The hottest part is {hot}: {trace.celsius:.1f} °C at {at}.{_settling(run)}"}
    side, temperature, time = _nearest(worst)
    limit = worst.limits[1 if side == "upper" else 0]
    what = f"{worst.point} ({worst.node}), {worst.state}: {temperature - ICE_POINT:.1f} °C at {duration_text(time)}"
    if worst.crossings:
        first = min(worst.crossings, key=lambda c: c.time)
        text = (
            f"Limit exceeded. Worst: {what}, {-worst.room:.1f} K beyond its {side} limit of {limit - ICE_POINT:.4g} °C; first exceeded at "
        )
        text += f"{duration_text(first.time)}, {duration_text(sum(c.outside for c in worst.crossings))} beyond."
        word = "passed a limit"
    else:
        text = f"All limits met. Smallest margin: {what}, {worst.room:.1f} K left to its {side} limit of {limit - ICE_POINT:.4g} °C."
        word = "kept"
    is_kept, bad = word == "kept", min((m for m in outcome.margins if m.passed is False), key=lambda m: m.margin, default=None)
    if is_kept and outcome.passed is False:
        text = f"No limit is passed. Smallest room: {what}, {worst.room:.1f} K."
        word = "margin not met"
    if is_kept and (trial := outcome.trial) is not None and trial.passed is False:
        failed = [] if trial.correlation is None else [str(g) for g in trial.correlation.failed]
        failed += [f"heater {h.load}" for h in trial.heaters if h.passed is False]
        word, text = "not met", f"{text} The test is not met: {'; '.join(failed)}."
    if bad is not None:
        text = f"{text} Margin not met: {bad.point}, {bad.side}, {bad.margin:.1f} K, with uncertainty and what the policy adds."
    if is_kept and outcome.passed is None:
        word, text = "not decided", f"{text} Not decided: {'; '.join(outcome.undecided)}."
    return {"word": word, "text": text + _settling(run)}


def _settling(run: ProfileRun | None) -> str:
    """Return where water settles first, of a humidity test."""
    if run is None or run.moisture is None or not run.moisture.surfaces:
        return ""
    s = min(run.moisture.surfaces.values(), key=lambda s: float(s.margin.min()))
    least, at = float(s.margin.min()), duration_text(float(s.times[int(s.margin.argmin())]))
    if least >= 0.0:
        return f" No surface reaches the dew point; nearest: {s.surface}, {least:.1f} K above it at {at}."
    return f" Water condenses: worst {s.surface}, {-least:.1f} K below the dew point at {at}, condensing for {duration_text(s.condensing)}."


def _nearest(check: LimitCheck) -> tuple[str, float, float]:
    """Return the side of a check that is nearer to its limit, with the extreme temperature there [K] and its time [s]."""
    if check.limits[1] - check.highest <= check.lowest - check.limits[0]:
        return "upper", check.highest, check.highest_time
    return "lower", check.lowest, check.lowest_time


def _check(c: LimitCheck) -> dict[str, Any]:
    """Return the check of a point for a page. [degC, K, s]"""
    side, temperature, time = _nearest(c)
    crossings = [{"side": x.side, "time": x.time, "worst": x.worst - ICE_POINT, "outside": x.outside} for x in c.crossings]
    out: dict[str, Any] = {
        "point": c.point,
        "node": c.node,
        "state": c.state,
        "side": side,
        "mark": c.mark,
        "passed": c.passed,
        "why": c.undecided,
    }
    out |= {"limits": [c.limits[0] - ICE_POINT, c.limits[1] - ICE_POINT], "lowest": c.lowest - ICE_POINT, "highest": c.highest - ICE_POINT}
    return out | {"room": c.room, "value": temperature - ICE_POINT, "time": time, "crossings": crossings}


def _point(outcome: Outcome, one: Limits) -> dict[str, Any]:
    """Return a reference point with its limits, and the stretches of time in which each of them holds."""
    drawn = [
        {"state": s.state, "from": s.start, "to": s.end, "limits": [s.limits[0] - ICE_POINT, s.limits[1] - ICE_POINT]}
        for s in spans(outcome.solution, one, outcome.state)
    ]
    return {"point": one.point, "node": outcome.solution[one.node].path, "spans": drawn, "mark": one.mark, "source": one.source}


def _curve(outcome: Outcome, node: str, window: Window) -> dict[str, Any]:
    """Return the course of a node for a page, with its band where there is one. [s, degC]"""
    trace, run = outcome.solution[node], outcome.course
    times, values = thinned_curve(trace.course[0], trace.course[1] - ICE_POINT, window)
    out: dict[str, Any] = {"name": node, "times": times, "values": values, "chamber": run is not None and node in run.chamber}
    band = None if outcome.bands is None else outcome.bands.get(node)
    if band is not None:
        at, error = thinned_curve(band.times, 1.96 * band.error, window, 200)
        out |= {"band_times": at, "band": error, "band_values": np.interp(at, trace.times, trace.celsius)}
    return out


def _levels(run: ProfileRun) -> list[dict[str, Any]]:
    """Return the hot and the cold level of a profile. [degC]"""
    used = run.profile.used
    return [{"name": f"{s} level", "value": float(used[s].value) - ICE_POINT, "mark": used[s].mark} for s in ("hot", "cold") if s in used]


def _margin(m: Margin) -> dict[str, Any]:
    """Return a margin for a page. [degC, K, s]"""
    return {
        "point": m.point,
        "side": m.side,
        "state": m.state,
        "time": m.time,
        "predicted": m.predicted - ICE_POINT,
        "uncertainty": m.printed,
        "added": m.policy.acceptance.value + m.policy.qualification.value,
        "limit": m.limit - ICE_POINT,
        "margin": m.margin,
        "passed": m.passed,
        "policy": m.policy.name,
    }


def _moisture(run: ProfileRun | None, window: Window) -> dict[str, Any] | None:
    """Return dew points, and every surface with its least margin above them."""
    if run is None or run.moisture is None:
        return None
    wet = run.moisture
    gases = [(g, *thinned_curve(wet.solution.times, v - ICE_POINT, window)) for g, v in wet.dew_points.items()]
    surfaces: Sequence[Any] = sorted(wet.surfaces.values(), key=lambda s: float(s.margin.min()))
    return {
        "dew": [{"name": f"dew point of {g}", "times": t, "values": v} for g, t, v in gases],
        "surfaces": [
            {
                "surface": s.surface,
                "margin": float(s.margin.min()),
                "time": float(s.times[int(s.margin.argmin())]),
                "condensing": s.condensing,
                "film": 1e3 * float(s.film.max()),
            }
            for s in surfaces
        ],
    }
