"""`run_stages`: component -> submodel -> full, each stage starting from what the ones below found; and the next command on a bad fit."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from thermid.base.errors import (
    DeckError,
    IdentificationError,
    RecordError,
    SolverError,
    StoppedError,
    ThermidError,
    errors_at,
    quoted,
    refuse_unknown,
)
from thermid.base.files import resolve_inside
from thermid.base.results import Named, Row
from thermid.base.units import counted, duration_text, short
from thermid.campaign._cache import file_name, kept_stages
from thermid.campaign._file import CampaignSource, accepting, plain_tables, scenario_of
from thermid.campaign._joint import JointFit, fit_jointly, joint_key
from thermid.campaign._judge.verdict import Criteria, Verdict, look, not_judged, validate
from thermid.fit.calibration import (
    FIRST,
    Calibration,
    KeptFit,
    LocalSpec,
    Reading,
    Request,
    counted_twice,
    digest,
    fit,
    freed,
    priors_of,
    shared_paths,
)
from thermid.fit.error_model import Keeping
from thermid.fit.power import SHAPES, PowerCourse
from thermid.inference.criticism import Mistakes, find_mistakes, mistakes_of
from thermid.measure.records import Record, stray_readings
from thermid.model.tree import Model, ParameterSet, Standing, StatedRange, definition_of, literal, outside
from thermid.simulation.runs import STEADY, KeptTasks, Scenario, Workers, in_tasks
from thermid.values.store import Store, graft, hand_values, stated_values

if TYPE_CHECKING:
    from thermid.campaign._schema import InheritTable, StageTable, VerdictTable


def next_command(campaign: str, fit: Calibration, mistakes: Mistakes) -> str:
    """Return the next `thermid` command to try on a bad fit; empty where a fit is good.

    In this order: `check` for stray readings; for a likely mistake `criticise` if it is a load, else `calibrate` again once it is mended;
    `plausibility` for a value at its bound; else `criticise`.

    Parameters
    ----------
    campaign : str      The campaign's file, as the user knows it.
    fit : Calibration   A stage.
    mistakes : Mistakes  What would explain it.
    """
    if fit.request is not None and stray_readings(fit.request.records):
        return f"thermid check {campaign}"
    mistake = mistakes.first
    if mistake is not None and mistake.kind == "load":
        return f"thermid criticise {campaign} --stage '{fit.stage}'"
    if mistake is not None:
        return f"thermid calibrate {campaign}"
    if fit.own.fair and not mistakes.bad:
        return ""
    if not (fit.own.fair or fit.contradicted) and "bound" in fit.own.because:
        return f"thermid plausibility {campaign} --stage '{fit.stage}'"
    return f"thermid criticise {campaign} --stage '{fit.stage}'"


def in_words(command: str) -> str:
    """Return a next command with what comes before it: the same fit again only makes sense after what a likely mistake asks to change."""
    return f"make that change, then {command}" if command.startswith("thermid calibrate") else command


def refused(error: ThermidError, request: Request, stage: str, campaign: str) -> ThermidError:
    """Return a refusal of a fit with the mistakes that would explain it, and the next command to try."""
    if not isinstance(error, IdentificationError | SolverError):
        return error
    explanations: Sequence[str] = stray_readings(request.records)
    command = f"thermid check {campaign}"
    if not explanations:
        explanations = find_mistakes(request, stage).lines() if request.model.runner is None else ()
        command = f"thermid calibrate {campaign}" if explanations else f"thermid identify {campaign} --stage '{stage}'"
    words = [f"{line.strip()[0].upper()}{line.strip()[1:]}" for line in explanations]
    return error.reworded(" ".join([error.message, *words, f"Next: {in_words(command)}"]))


Notice = Callable[[str, int, float], None]
"""Called with what is running, the number of evaluations and the RMS of the weighted residuals."""


def request_of(source: CampaignSource, stage: StageTable, k: int, done: Mapping[str, Calibration], model: Model | None = None) -> Request:
    """Return the fit request of a stage: its deck, or a model in its place, with inherited values under its own [set]."""
    where = source.where(f"stages.{k}")
    model = source.model(stage.model, where) if model is None else model
    store, moving, remarks = _from_below(model, stage, done, where)
    model = store.laid_over(model)
    store, hidden = store.acting_in(model)
    model = model.cut(*stage.untie) if isinstance(stage.untie, list) else model
    if stage.values:
        hand = hand_values(resolve_inside(source.path.parent, stage.values, f"{where}.values"), model, stage.name, f"{where}.values")
        gone = [f"'{d.path}' {d.text} by {d.origin} does not apply: {d.why}." for d in hand.dropped]
        return Request(model, (), store=store, name=stage.name, seen=store.seen, hand=hand, remarks=(*remarks, *hidden, *gone))
    if not stage.records:
        return _joined_request(model, stage, store, moving, (*remarks, *hidden), where)
    records = tuple(source.bound(n, stage) for n in source.pick(stage.records, where))
    scenario = scenario_of(stage.scenario, stage.name)
    points, settled = steady_points(source, stage, records, scenario, where)
    records = (*records, *points)
    shared = {} if stage.untie is True else shared_paths(model)
    store, free, prior = _free_here(model, stage, store, moving, shared, where)
    request = Request(
        model,
        records,
        free,
        {"*": scenario, **settled},
        {n: LocalSpec.read(t, f"{where}.local.{n}") for n, t in plain_tables(stage.local).items()},
        record_local={r.name: source.local_of_record(r.name) for r in records if r.name not in settled},
        priors=priors_of(model, {p: t if isinstance(t, str) else (t.mean, t.sd) for p, t in stage.priors.items()}, where),
        store=store,
        prior=prior,
        weights=stage.weights,
        loss_scale=stage.knee,
        untie=stage.untie is True,
        loss=stage.loss,
        search=stage.search,
        window=literal(stage.window, "s", where),
        name=stage.name,
        remarks=(
            *remarks,
            *hidden,
            *moving_together(store, prior, shared),
            *counted_twice(store, prior, records),
            *not_inherited(source, model, k, {*free, *(p for s in store.parameters.values() for p in s.paths)}, done, shared),
        ),
        seen=store.seen,
        readings=readings_of(stage.readings),
        adequate=literal(stage.adequate, "K", f"{where}.adequate") if stage.adequate else 0.0,
        accepted=stage.name in source.accepted,
        structural_errors=stage.structural_errors,
    )
    return with_courses(request, stage, where)


def _joined_request(model: Model, stage: StageTable, store: Store, moving: Sequence[str], remarks: tuple[str, ...], where: str) -> Request:
    """Return the request of a stage before its own test: what stages below found and its priors are all that is known of its values.

    A first line says which values no stage fitted, and which of the free ones count as exact, since nothing states their range.
    """
    shared = {} if stage.untie is True else shared_paths(model)
    store, free, prior = _free_here(model, stage, store, moving, shared, where)
    priors = priors_of(model, {p: t if isinstance(t, str) else (t.mean, t.sd) for p, t in stage.priors.items()}, where)
    values = ParameterSet(model)
    rows = {
        p: {"value": mean or values.table[p].parameter.text, "sd": sd}
        for p, (mean, sd) in priors.items()
        if not isinstance(sd, StatedRange)
    }
    exact = [p for p in free if p not in {*rows, *prior, *values.stated_ranges}]
    below = quoted(sorted({name for i in stage.inherit.values() for name in i.stages}))
    words = f"{FIRST}no log of this stage is fitted: its values are what {below} found and the deck's, with their stated ranges and priors"
    words += f". Without a range or prior and counted as exact: {quoted(exact)}" if exact else ""
    hand = stated_values(rows, model, stage.name)
    return Request(model, (), store=store, name=stage.name, seen=store.seen, hand=hand, remarks=(f"{words}.", *remarks))


def with_courses(request: Request, stage: StageTable, where: str) -> Request:
    """Return a stage's request with the courses of unlogged powers that its table asks for, their shapes and times where they fit best.

    Raises
    ------
    DeckError   When a course has the name of a load.
    """
    for name, table in stage.courses.items():
        if name in request.model.loads:
            raise DeckError(
                f"'{name}' is a load of the deck. Give the course another name; it adds to the load.",
                f"{where}.courses.{name}",
                code="name.taken",
            )
        shapes = tuple(SHAPES) if table.shape == "auto" else (table.shape,)
        power = literal(table.power, "W", f"{where}.courses.{name}.power")
        begin = literal(table.begin, "s", f"{where}.courses.{name}.begin")
        course = PowerCourse.recovered(request, name, table.into, shapes=shapes, power=power, begin=begin)
        request = course.within(request)
        error = f"+- {duration_text(float(short(course.error)))}" if np.isfinite(course.error) else "of unknown error"
        text = f"course '{name}' of a power at '{table.into}': {course.shape}, {duration_text(float(short(course.time, 3)))} {error}"
        held = "the errors of other values do not include its uncertainty"
        request = replace(request, remarks=(*request.remarks, f"{text}, on the profile of the fit; {held}."))
    return request


def _from_below(
    model: Model, stage: StageTable, done: Mapping[str, Calibration], where: str
) -> tuple[Store, tuple[str, ...], tuple[str, ...]]:
    """Return the values that a model inherits from earlier stages, the paths of those that may move, and remarks."""
    below: list[tuple[str, Store]] = []
    moving: dict[str, None] = {}
    replaced: list[str] = []
    for part, inherit in stage.inherit.items():
        ahead = "" if part == "." else f"{model.canonical(part)}."
        fits = [done[name] for name in inherit.stages]
        inner = model if part == "." else model.submodel(part)
        for c, whole_store in zip(fits, _handed_on(fits, inherit, f"{where}.inherit.{part}"), strict=True):
            store, gone = _of_same_parts(c, whole_store, inner, ahead)
            replaced += gone
            below.append((part, store))
            moves = (p for p in store.parameters if inherit.as_ == "prior" and (not inherit.move or p in inherit.move))
            moving |= dict.fromkeys(ahead + p for p in moves)
    whole, remarks = graft(model, below, stage.untie if isinstance(stage.untie, list) else ())
    return whole, tuple(p for p in whole.parameters if p in moving), tuple(f"{FIRST}{r}" for r in (*replaced, *remarks))


def _of_same_parts(below: Calibration, store: Store, model: Model, ahead: str) -> tuple[Store, list[str]]:
    """Return what a stage hands on without the values of parts that have another deck in this model, and a remark on each such part.

    What was found of a part is no knowledge of the part that replaced it. A part that differs only by one that it holds keeps its own.
    """
    before, now = dict(below.model.instances()), dict(model.instances())
    changed = [at for at, deck in now.items() if before.get(at, deck) != deck]
    places = [at.removesuffix(".") for at in changed if not any(other != at and other.startswith(at) for other in changed)]
    known = [p for s in store.parameters.values() for p in s.paths]
    words = f"does not get what stage '{below.stage}' found of the part that had its place: its deck is another one."
    replaced = [place for place in places if len(outside(known, [place])) < len(known)]
    return store.drop(*replaced) if replaced else store, [f"'{ahead}{place}' {words}" for place in replaced]


def _free_here(
    model: Model, stage: StageTable, store: Store, moving: Sequence[str], shared: Mapping[str, tuple[str, ...]], where: str
) -> tuple[Store, tuple[str, ...], tuple[str, ...]]:
    """Return what is known, what is free, and which of what is known may move once `freeze` is taken off."""
    may_move = {p for name in moving for s in (store.states[name],) if s.known and store.rows([name]).any() for p in s.acts}
    free, frozen = freed(model, stage.free, stage.freeze, where, may_move, shared)
    store = store.parted(frozen)  # twins that are untied may be frozen one by one
    return (
        store,
        tuple(free),
        tuple(p for p, s in store.parameters.items() if s.acts and not {*s.acts} - may_move and frozen.isdisjoint(s.acts)),
    )


def readings_of(tables: Mapping[str, Any]) -> dict[str, Reading]:
    """Return the readings of a stage or verdict."""
    return {n: Reading(t) if isinstance(t, str) else Reading(t.channel, t.offset) for n, t in tables.items()}


def keyed(request: Request, stage: StageTable, keys: Mapping[str, str]) -> tuple[Request, dict[str, str]]:
    """Return a stage's request with its key, and the ingredients of that; `keys` are those of the stages below."""
    ingredients = request.ingredients([keys[name] for i in stage.inherit.values() for name in i.stages])
    return replace(request, key=digest(ingredients)), ingredients


def _handed_on(below: Sequence[Calibration], inherit: InheritTable, where: str) -> list[Store]:
    """Return what each of several stages hands on of its store, at every depth: all of it, less what `only` and `without` keep back.

    Raises
    ------
    DeckError   When either names a value that none of the stages has, or `move` what is not handed on, or values that are fixed.
    """
    if inherit.move and inherit.as_ != "prior":
        raise DeckError(
            '`move` lists the values of a prior that may move, but as = "fixed" keeps all of them fixed. Leave one of the two out.',
            f"{where}.move",
            code="value.excludes-another",
        )
    several = f"{'stage' if len(below) == 1 else 'stages'} {quoted([c.stage for c in below])}"
    fitted_paths, known = {p for c in below for p in c.values.parameters}, {p for c in below for p in c.store.parameters}
    refuse_unknown(inherit.only, fitted_paths, f"{where}.only", f"'{{}}' was not fitted by {several}.", DeckError)
    refuse_unknown(inherit.without, known, f"{where}.without", f"'{{}}' is not known to {several}.", DeckError)
    back = {p for p in fitted_paths if inherit.only and p not in inherit.only} | set(inherit.without)
    stores = [c.store.only(lambda s: s.path not in back) if back else c.store for c in below]
    refuse_unknown(inherit.move, {p for s in stores for p in s.parameters}, f"{where}.move", "'{}' is not inherited.", DeckError)
    return stores


def moving_together(store: Store, prior: Sequence[str], shared: Mapping[str, tuple[str, ...]]) -> list[str]:
    """Return a remark where values that are inherited as fixed are one with a prior, and move with it.

    Parameters
    ----------
    store : Store       What the stages below know.
    prior : sequence    Which of it may move.
    shared : dict       Path -> every path with its value, as `shared_paths` has it.
    """
    moving = {q for p in prior for a in store.states[p].acts for q in shared.get(a, ())}
    fixed = [p for p, s in store.parameters.items() if p not in prior and moving & {*s.acts}]
    words = "inherited as fixed, but one value with twins that are inherited as priors, so they move together. Untie them to fix them"
    return [f"{FIRST}{quoted(fixed)} {'is' if len(fixed) == 1 else 'are'} {words}."] if fixed else []


def not_inherited(
    source: CampaignSource,
    model: Model,
    k: int,
    paths: Iterable[str],
    done: Mapping[str, Calibration],
    shared: Mapping[str, Sequence[str]],
) -> Iterator[str]:
    """Yield a remark for every earlier stage whose deck is a part of this model, with the parts or values that nothing inherits.

    Parameters
    ----------
    k : int             Position of this stage among the stages, from 0; in the studio, later ones may be done too.
    paths : iterable    What the stage frees or inherits.
    shared : dict       As in `moving_together`.
    """
    reached = {q for p in paths for q in shared.get(p, (p,))}
    stages = source.content.stages
    for earlier in (e for e in stages[:k] if e.name in done and e.model != stages[k].model):
        deck = definition_of(source.model(earlier.model, earlier.name))
        fitted = [p for p, s in done[earlier.name].store.parameters.items() if s.origin.stage == earlier.name and not s.of_logs]
        missing = {at: [at + p for p in fitted if at + p not in reached] for at, definition in model.instances() if definition == deck}
        places = [p for at, paths in missing.items() for p in ([at[:-1]] if at and 0 < len(fitted) == len(paths) else paths)]
        if places:
            yield f"{FIRST}what stage '{earlier.name}' fitted is not inherited at {quoted(places)}: the values of the deck stay there."


def steady_points(
    source: CampaignSource, stage: StageTable, records: tuple[Record, ...], scenario: Scenario, where: str
) -> tuple[tuple[Record, ...], dict[str, Scenario]]:
    """Return the steady points of a stage as records, and name -> scenario in which each starts settled.

    Parameters
    ----------
    source, stage   The campaign and its stage.
    records : tuple The stage's transients.
    scenario        What the stage says that its logs do not.
    where : str     For messages.

    Raises
    ------
    RecordError     When a stretch is not settled, or is fitted as part of a transient too.
    """
    points: dict[str, Record] = {}
    for name, table in stage.steady.items():
        place = f"{where}.steady.{name}"
        (one,) = source.pick([table.record], place)[:1]
        log = source.bound(one, stage)
        point = log.steady(table.start, table.end, tau=table.tau, limit=table.limit, name=name)
        _apart(point.start, point.end, log, records, place, name)
        points[name] = point.record
    return tuple(points.values()), {name: scenario.with_(start=STEADY) for name in points}


def _apart(start: float, end: float, log: Record, records: tuple[Record, ...], where: str, name: str) -> None:
    """Refuse a stretch that a transient of the stage holds too: its readings would count twice."""
    for other in records:
        if other.origin.sha256 == log.origin.sha256 and other.times[0] < end and other.times[-1] > start:
            raise RecordError(
                f"steady point '{name}' covers {start:g} to {end:g} s of '{log.name}', and the stage fits it from {other.times[0]:g} to "
                f"{other.times[-1]:g} s: its readings would count twice. Trim the transient in `prepare`, or leave one of them out.",
                where,
                code="campaign.refused",
            )


@dataclass(frozen=True, eq=False)
class Campaign(Named[Calibration]):
    """The result of a campaign.

    Parameters
    ----------
    title : str                 The campaign's.
    stages : dict               Stage -> Calibration, in order.
    verdicts : tuple            Verdicts, in order.
    keys : dict                 Stage -> hash of everything that its result depends on.
    note : str                  What the author says of it.
    joint : JointFit or None       The last fit over all levels, where the campaign asks for one.
    source : CampaignSource     The file; None for one made in Python.
    requests : dict             Stage -> what it asked.
    changed : dict              Stage that was fitted anew -> what changed since the results folder kept its end; none where it kept none.
    """

    title: str
    stages: Mapping[str, Calibration]
    verdicts: tuple[Verdict, ...]
    keys: Mapping[str, str]
    note: str = ""
    joint: JointFit | None = None
    source: CampaignSource | None = field(default=None, repr=False)
    requests: Mapping[str, Request] = field(default_factory=dict, repr=False)
    changed: Mapping[str, tuple[str, ...]] = field(default_factory=dict, repr=False)

    _refusal = "no stage '{}'."

    def _entries(self) -> Mapping[str, Calibration]:
        """Return stage -> its calibration."""
        return self.stages

    def table(self, field_name: str) -> dict[str, dict[str, float]]:
        """Return part -> stage -> value of every parameter of a name, parts down, levels across: the document's Table 2. [SI]"""
        out: dict[str, dict[str, float]] = {}
        for stage, calibration in self.stages.items():
            values = ParameterSet(calibration.model).evaluate({})
            for path in calibration.model.parameter_table():
                if path == field_name or path.endswith(f".{field_name}"):
                    part = path.removesuffix(field_name).rstrip(".") or calibration.given_model.title
                    out.setdefault(part, {})[stage] = float(values[path])
        return out

    @property
    def passed(self) -> bool:
        """Whether every verdict passed and every fit is usable: it neither is nor rests on what is not credible or failed."""
        return all(v.passed for v in self.verdicts) and all(c.standing.usable for c in self.fits)

    @property
    def standing(self) -> Standing:
        """The worst standing of its stages and of the joint fit."""
        return Standing.worst(c.standing for c in self.fits)

    @property
    def exit_code(self) -> int:
        """Exit code: 1 where a verdict failed or was not judged, else that of the standing; what is accepted does not count."""
        accepted = self.source.accepted if self.source is not None else ()
        missed = [v for v in self.verdicts if v.passed is False and v.model not in accepted]
        return 1 if missed else self.standing.exit_code

    @property
    def fits(self) -> tuple[Calibration, ...]:
        """The calibrations of all stages, and the joint one where there is one."""
        return (*self.stages.values(), *([self.joint] if self.joint is not None else []))

    def save(self, folder: str | os.PathLike[str]) -> list[Path]:
        """Write one values file per stage and return their paths."""
        target = Path(folder)
        target.mkdir(parents=True, exist_ok=True)
        out = []
        for name, calibration in self.stages.items():
            path = target / f"{file_name(name)}.values.toml"
            calibration.save(path)
            out.append(path)
        if self.joint is not None:
            out.append(target / "joint.values.toml")
            self.joint.save(out[-1])
        return out

    @cached_property
    def mistakes(self) -> Mapping[str, Mistakes]:
        """Stage -> mistakes in logs, decks or on the bench that would explain what it misses; looked for when first asked for."""
        return {name: mistakes_of(fit) for name, fit in self.stages.items()}

    @property
    def file(self) -> str:
        """Name of the campaign's file for commands to try."""
        return self.source.path.name if self.source is not None else "CAMPAIGN"

    def next_step(self, name: str) -> str:
        """Return what to do about the fit of a stage, in words; empty where it is good."""
        return in_words(next_command(self.file, self[name], self.mistakes[name]))

    def __str__(self) -> str:
        """Return all stages and verdicts as text, below lines that say which must not be used and which mistake would explain it."""
        head = self.standing.over(self.title, "stage")
        head += "".join(f"\n{name}: {line}" for name, mistakes in self.mistakes.items() for line in mistakes.lines())
        parts = []
        for name, calibration in self.stages.items():
            step = self.next_step(name)
            parts.append(f"{calibration}\n  next: {step}" if step else str(calibration))
        return "\n\n".join([head, *parts, *([str(self.joint)] if self.joint else []), *map(str, self.verdicts)])

    @property
    def doubted(self) -> str:
        """How many verdicts are within limits by values that are not adequate, not credible or failed, in words; empty for none."""
        states = Counter(v.standing.state for v in self.verdicts if v.passed and not v.standing.fair)
        return "; ".join(f"{n} within limits by values that are {state}" for state, n in states.items())

    @property
    def counts(self) -> str:
        """How many stages there are, and how many verdicts passed."""
        passed = sum(v.passed is True and not v.unfounded for v in self.verdicts)
        verdicts = [f"{passed} of {counted(len(self.verdicts), 'verdict')} passed"] if self.verdicts else []
        return ", ".join([counted(len(self.stages), "stage"), *verdicts, *([self.doubted] if self.doubted else [])])

    def _summary(self) -> str:
        """Return title, standing, and how many verdicts passed."""
        return f"{self.title}: {self.standing.state}, {self.counts}"

    def _as_rows(self) -> list[Row]:
        """Return the stages with their standing and the sensor that is met worst."""
        out: list[Row] = []
        for name, c in self.stages.items():
            worst = max(c.sensors.items(), key=lambda item: item[1].rmse, default=None)
            worst_row = {"worst_sensor": worst[0], "rmse_K": worst[1].rmse} if worst is not None else {}
            out.append({"stage": name, "state": c.standing.state, **worst_row, "values": len(c.values.parameters)})
        return out

    def judged(self, folder: Path | None = None, notice: Notice | None = None) -> Campaign:
        """Return a campaign of a file with the verdicts on its hold-out records, and what they make of its stages.

        Verdicts on stages that are not there yet, or by a joint fit that is not, are left out.

        Parameters
        ----------
        folder : path       A results folder, which knows of earlier looks at hold-out records; this look is noted there.
        notice : callable   Called with the name of each record that is judged, before it is.

        Raises
        ------
        ThermidError   From reading or judging; the message says at which verdict.
        """
        source = self.source
        assert source is not None
        used = {sha: user for c in self.stages.values() for sha, user in c.used_records.items()}
        tables = [
            (k, t) for k, t in enumerate(source.content.verdicts) if t.model in self and (t.values != "joint" or self.joint is not None)
        ]
        verdicts = tuple(v for k, table in tables for v in _judge(source, table, k, self, used, notice))
        return _with_verdict_standing(replace(self, verdicts=tuple(_looked(folder, v, self) for v in verdicts)))


def run_stages(
    campaign: str | os.PathLike[str] | CampaignSource,
    *,
    data: str | os.PathLike[str] | None = None,
    notice: Notice | None = None,
    cache: str | os.PathLike[str] | None = None,
    accept: Sequence[str] = (),
    fresh: bool = False,
    only: Collection[str] = (),
    executor: Workers = None,
) -> Campaign:
    """Return the calibrations and verdicts of a campaign.

    A stage that is not credible, or rests on one, is not judged: its hold-out records stay unopened.

    Parameters
    ----------
    campaign, data : path   The campaign file; a folder of logs outside the project.
    notice : callable       Called while stages run.
    cache : path            A results folder: logs and stages of which nothing changed, the code included, are taken from it.
    accept : sequence       Stages accepted as they are, beside those of the file: their standing is told, exit codes do not count it.
    fresh : bool            Whether every stage is fitted anew, whatever the results folder keeps; it keeps what comes out.
    only : collection       Stages that are fitted, with what they inherit from and without a joint fit; all of them when empty.
    executor                As in `ensemble`: stages that do not rest on one another are fitted at the same time, and descents of one.

    Raises
    ------
    ThermidError   From reading, fitting or judging; the message says at which stage.
    """
    source = campaign if isinstance(campaign, CampaignSource) else CampaignSource.read(campaign, data)
    folder = Path(cache) if cache is not None else None
    source = accepting(replace(source, results=folder or source.results), accept)
    memories = kept_stages(folder, (*(s.name for s in source.content.stages), "joint"), fresh)
    done, keys, requests, changed = dict[str, Calibration](), dict[str, str](), dict[str, Request](), dict[str, tuple[str, ...]]()
    todo = {k: s for k, s in enumerate(source.content.stages) if not only or s.name in only or s.name in source.below(only)}
    workers = KeptTasks.of_workers(executor).workers
    while todo:
        # a stage waits for the earlier ones that it rests on
        rests = {k: {n for i in s.inherit.values() for n in i.stages} for k, s in todo.items()}
        ready = [k for k in todo if rests[k].isdisjoint(todo[j].name for j in todo if j < k)][: None if workers else 1]
        tasks, ingredients = [], {}
        for k in ready:
            name, place = todo[k].name, source.where(f"stages.{k}")
            with errors_at(place, ": "):
                request, ingredients[name] = keyed(request_of(source, todo[k], k, done), todo[k], keys)
            requests[name], keys[name] = request, (key := request.key)
            alone = (progress_of(notice, name), executor) if len(ready) == 1 else (None, None)
            tasks.append((place, (request, source.path.name, place, memories[name].recall(key), memories[name].errors(key), *alone)))
        for _, (fitted, new) in in_tasks(_fitted, tasks, workers if len(ready) > 1 else None):
            name = fitted.stage
            changed |= {name: memories[name].changed_since(ingredients[name])} if new else {}
            if new and fitted.converged:
                memories[name].remember(keys[name], fitted.end.place if fitted.end is not None else None, ingredients[name])
            done[name] = fitted
            _go_on(fitted, [s.name for s in todo.values() if s.name not in done], source)
        todo = {k: s for k, s in todo.items() if k not in ready}
    done = {s.name: done[s.name] for s in source.content.stages if s.name in done}
    result = Campaign(source.content.title, done, (), keys, source.content.note, None, source, requests, changed)
    result = replace(result, joint=_joint(result, notice, folder)) if source.content.joint is not None and not only else result
    return result.judged(folder, notice)


def _fitted(
    request: Request,
    file: str,
    place: str,
    recalled: KeptFit | None,
    keeping: Keeping | None,
    progress: StageNotice | None,
    executor: Workers,
) -> tuple[Calibration, bool]:
    """Return the fit of a stage, and whether it is a new one; a task of a worker, or of this process with workers for its descents.

    Raises
    ------
    ThermidError   With the place of the stage in the file, and what a campaign advises.
    """
    if progress is not None:
        progress(0, 0.0)
    with errors_at(place, ": "):
        try:
            return fit(request, progress, recalled, stoppable=True, executor=executor, keeping=keeping), recalled is None
        except ThermidError as error:
            raise refused(error, request, request.name, file) from None


def joint(
    campaign: str | os.PathLike[str] | CampaignSource | Campaign,
    *,
    data: str | os.PathLike[str] | None = None,
    notice: Notice | None = None,
    cache: str | os.PathLike[str] | None = None,
) -> JointFit:
    """Return one fit over the records of all levels of a campaign, each with the model of its own level.

    Levels share a parameter where the part stands in the uppermost model as it stood below, so a component's ``skin.htc`` is
    ``pre.ele.skin.htc`` above unless a ``[set]`` on the way sets it anew. It starts where the stages ended.

    Parameters
    ----------
    campaign : path or Campaign     The campaign file, or what `run_stages` made of it; a ``[joint]`` table in it is heeded.
    data, notice, cache             As in `run_stages`.

    Raises
    ------
    ThermidError   From reading or fitting; a campaign that was made in Python has no file to read stages from.
    """
    run = campaign if isinstance(campaign, Campaign) else run_stages(campaign, data=data, notice=notice, cache=cache)
    if run.source is None:
        raise DeckError(
            "a joint fit needs the campaign's file; this campaign was made in Python. Call run_stages on a file.",
            run.title,
            code="campaign.not-from-file",
        )
    return run.joint or _joint(run, notice, Path(cache) if cache is not None else None)


def _with_verdict_standing(campaign: Campaign) -> Campaign:
    """Return a campaign in which failed verdicts are known to the stages that they are about, and to all that rests on these."""
    accepted = campaign.source.accepted if campaign.source is not None else ()
    stages: dict[str, Calibration] = {}
    for name, result in campaign.stages.items():
        failed = [v for v in campaign.verdicts if v.model == result.stage and v.passed is False]
        stages[name] = result.judged(_with_current_standing(result.rests, stages), _verdict_standing(failed, name in accepted))
    if campaign.joint is None:
        return replace(campaign, stages=stages)
    failed = [v for v in campaign.verdicts if v.passed is False and v.model not in stages]
    joint = campaign.joint.judged(_with_current_standing(campaign.joint.rests, stages), _verdict_standing(failed, False))
    return replace(campaign, stages=stages, joint=joint)


def _joint(campaign: Campaign, notice: Notice | None, folder: Path | None) -> JointFit:
    """Return the last fit over all levels, which the campaign asks for."""
    source = campaign.source
    assert source is not None
    key = joint_key(campaign.keys, source.content.joint_table)
    return fit_jointly(source, campaign.requests, campaign.stages, key, progress_of(notice, "joint"), folder)


def _looked(folder: Path | None, verdict: Verdict, campaign: Campaign) -> Verdict:
    """Return a verdict with what the results folder knows of earlier looks at its record; this one is noted there if it was one."""
    if verdict.prediction is None or verdict.passed is None:
        return verdict
    joint = verdict.model not in campaign.keys
    key = (
        joint_key(campaign.keys, campaign.source.content.joint_table)
        if joint and campaign.source is not None
        else campaign.keys[verdict.model]
    )
    record = next(iter(verdict.prediction.records.items()))
    return replace(verdict, failed_before=look(folder, *record, verdict.model, key, verdict.passed and not verdict.unfounded))


def _go_on(last: Calibration, following: Sequence[str], source: CampaignSource) -> None:
    """Do nothing, unless the interrupt key ended a fit and others would follow.

    Raises
    ------
    StoppedError    With the best values so far.
    """
    then = [*(f"'{name}'" for name in following), *(["the joint fit"] if source.content.joint is not None else [])]
    if not last.stopped or not then:
        return
    best = ", ".join(f"{v.path} = {short(v.in_unit, 4)} {v.unit}".rstrip() for v in last.values.parameters.values())
    raise StoppedError(
        f"stopped by the user after {counted(last.evaluations, 'evaluation')} of stage '{last.stage}'. Best so far, not credible: {best}."
        f" Not fitted: {', '.join(then)}. The stages before it are kept in the results folder."
    )


@dataclass(frozen=True)
class StageNotice:
    """What a fit calls, from what is called with the name of what is running besides."""

    notice: Notice
    name: str

    def __call__(self, count: int, rms: float) -> None:
        """Say how many evaluations there were, and the weighted RMS."""
        self.notice(self.name, count, rms)

    def ahead(self, words: str, seconds: float) -> None:
        """Say what follows and what it will take [s], where anyone listens."""
        tell = getattr(self.notice, "ahead", None)
        if tell is not None:
            tell(self.name, words, seconds)


def progress_of(notice: Notice | None, name: str) -> StageNotice | None:
    """Return what a fit calls, from what is called with the name of what is running besides."""
    return None if notice is None else StageNotice(notice, name)


def _judge(
    source: CampaignSource, table: VerdictTable, k: int, campaign: Campaign, used: Mapping[str, str], notice: Notice | None
) -> Iterator[Verdict]:
    """Yield one verdict per record of a verdict's pattern."""
    where = source.where(f"verdicts.{k}")
    stage = next(s for s in source.content.stages if s.name == table.model)
    for name in source.pick([table.record], where):
        fit = campaign.joint.at(table.model) if table.values == "joint" and campaign.joint is not None else campaign[table.model]
        if not fit.standing.judgeable:
            yield not_judged(fit, name, table.name)
            continue
        if notice is not None:
            notice(f"running {name} for its verdict", 0, 0.0)
        with errors_at(where, ": "):
            record = source.bound(name, stage)
            if record.origin.sha256 in used:
                raise IdentificationError(
                    f"record '{name}' was used by {used[record.origin.sha256]}. A validation needs a hold-out record: use one that no "
                    "fit used.",
                    code="campaign.record-used",
                )
            yield validate(
                fit,
                record,
                Criteria.read(table.criteria, where),
                scenario=scenario_of(table.scenario or stage.scenario, table.name or name),
                local=plain_tables(table.local),
                window=literal(stage.window, "s", where),
                readings=plain_tables(table.readings if table.readings is not None else stage.readings),
                title=table.name,
            )


def _with_current_standing(rests: Mapping[str, Standing], stages: Mapping[str, Calibration]) -> dict[str, Standing]:
    """Return what a fit rests on with the standing that stages have now."""
    now = {f"stage '{name}'": fit.standing for name, fit in stages.items()}
    return {who: now.get(who, standing) for who, standing in rests.items()}


def _verdict_standing(failed: list[Verdict], accepted: bool) -> Standing | None:
    """Return what failed verdicts on one stage make of it; None without any."""
    if not failed:
        return None
    first = max((c for v in failed for c in v.missed), key=lambda c: c.used)
    records = ", ".join(dict.fromkeys(v.record for v in failed))
    return Standing("failed", f"verdict on {records}: {first.sensor} {first.words}", failed[0].model, accepted)
