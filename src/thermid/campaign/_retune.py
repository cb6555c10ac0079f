"""A part is replaced: the values that it touches, the stages and tests that are due again, and the retune of those alone."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from thermid.base.errors import DeckError, IdentificationError, MissingDataError, SolverError, errors_at
from thermid.base.results import Result
from thermid.base.units import ICE_POINT, counted, value_of
from thermid.campaign._file import CampaignSource
from thermid.campaign._joint import Level, places_of
from thermid.campaign._stages import Campaign, Notice, progress_of, request_of
from thermid.fit.calibration import MOVED, Calibration, Experiment, Request, as_found, fit, moved_instruments
from thermid.fit.error_model import ERRORS_KEY, errors_after, errors_without
from thermid.model.tree import (
    Constant,
    Model,
    Names,
    Parameter,
    ParameterSet,
    PlaceStart,
    Replacement,
    Standing,
    definition_of,
    inside,
    load_model,
    short_text,
    touching,
)
from thermid.simulation.runs import Scenario, Workers, compile_network, steady
from thermid.values.store import FittedValues, Normal, Source, State, Store, ValueOrigin, graft

if TYPE_CHECKING:
    from thermid.campaign._schema import InheritTable, StageTable

MIN_EFFECT = 0.05
"""A value is worth retuning when what it may be off by moves some sensor by this much. [K]"""
CHANGE_WITHOUT_SPREAD = 0.1
"""What a value may be off by where the replacement assumes no spread of it. [-]"""
START = "start after a replacement"
CARRIED = "kept after a swap: the model has the new part, but values and statistics are from the tests before."
SEAT = "sensors = {{'{0}': 'NODE'}}, or --sensor-at {0}=NODE"
RELATIVE_STEP = 1e-4
"""Relative change by which the response of a joint to the number behind it is found."""


@dataclass(frozen=True)
class Touch:
    """A value at the interface of the new part.

    Parameters
    ----------
    stage, path : str       The stage that fits it, and its path there.
    through : tuple         Elements or settings by which it acts on the part.
    kelvin : float          How far it moves the most sensitive sensor for a change by `change`, at rest. [K]
    change : float          Spread with which it starts again, else a usual change. [-]
    held : str              Why it is not freed; empty where it is.
    """

    stage: str
    path: str
    through: tuple[str, ...]
    kelvin: float
    change: float
    held: str = ""


@dataclass(frozen=True, eq=False)
class StagePlan:
    """What becomes of one stage.

    Parameters
    ----------
    name : str          The stage; a new one where one instance of several gets the new part.
    of : str            The stage of the campaign that it follows.
    action : str        'kept': nothing that it depends on changed; 'run': fitted again; 'carried': its model changes, its values hold.
    why : str           In words.
    free : tuple        What is fitted.
    records : tuple     Tests to repeat.
    identity : tuple    Hash of its model before and after.
    model : Model       Its model after the swap.
    part : str          Where the part stands in it; empty where it is the part itself, or does not hold it.
    alone : bool        Whether it is the part alone.
    starts : tuple      Starts of its replacement that the stage decides: values of the place that it fitted before.
    bind : dict         Channel -> where its sensor sits in the model after the swap, of those that sat on the old part.
    """

    name: str
    of: str
    action: str
    why: str
    free: tuple[str, ...]
    records: tuple[str, ...]
    identity: tuple[str, str]
    model: Model = field(repr=False)
    part: str = ""
    alone: bool = False
    starts: tuple[PlaceStart, ...] = ()
    bind: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class RetunePlan(Result):
    """What replacing a part costs, before any test.

    Parameters
    ----------
    part : str              Its path in the uppermost model.
    old, new : str          Titles of the old and the new part.
    stages : tuple          StagePlan of every stage.
    touched : tuple         Touch of every value of the campaign at the part's interfaces.
    before, after : dict    Sensor -> temperature at rest, the old part at the power of its model and the new one at that of its deck, all
                            else as in the last record. [K]
    watts : (float, float)  Power of the part by its old model and by the new deck. [W]
    powered : str           Who gave the old part's power in its model, in words.
    replacement : Replacement   What became of the values at the place, in the uppermost model.
    campaign : Campaign     What was done before.
    model : Model           The new part.
    """

    part: str
    old: str
    new: str
    stages: tuple[StagePlan, ...]
    touched: tuple[Touch, ...]
    before: Mapping[str, float]
    after: Mapping[str, float]
    watts: tuple[float, float]
    powered: str
    replacement: Replacement
    campaign: Campaign = field(repr=False)
    model: Model = field(repr=False)

    @property
    def standing(self) -> Standing:
        """Of the values that the plan rests on: those of the last stage before."""
        return list(self.campaign.stages.values())[-1].standing

    @property
    def deck(self) -> Model:
        """The deck of the last stage with the new part in its place; the values files of a retune are laid over it."""
        source, top = self.campaign.source, self.stages[-1]
        assert source is not None
        k, table = next((k, s) for k, s in enumerate(source.content.stages) if s.name == top.of)
        return _model(source, table, k, top, self, None)

    @property
    def freed(self) -> tuple[str, ...]:
        """Values that are retuned, ``stage: path``."""
        return tuple(f"{t.stage}: {t.path}" for t in self.touched if not t.held)

    @property
    def tests(self) -> tuple[str, ...]:
        """Records that must be taken again."""
        return tuple(dict.fromkeys(r for s in self.stages if s.action == "run" for r in s.records))

    @property
    def kept_tests(self) -> tuple[str, ...]:
        """Records that still hold."""
        records = (r.name for request in self.campaign.requests.values() for r in request.records)
        return tuple(dict.fromkeys(r for r in records if r not in self.tests))

    def run(
        self,
        data: str | os.PathLike[str] | CampaignSource,
        *,
        everything: bool = False,
        part_only: bool = False,
        notice: Any = None,
        executor: Workers = None,
    ) -> Campaign:
        """Return the campaign after the retune: the stages that are due are fitted to the repeated tests, all others are as they were.

        Parameters
        ----------
        data : path         Folder with the logs of the repeated tests, named as in the campaign; or the campaign as read with it.
        everything : bool   Fit every stage anew with all that it frees, which needs all tests: what a retune is measured against.
        part_only : bool    Fit the new part to its own tests alone; the stages above know it then, and count what is assumed of its place.
        notice : callable   As in `run_stages`.
        executor            As in `ensemble`: the descents of a stage.

        Raises
        ------
        ThermidError   From reading or fitting.
        """
        return retuned(self, data, notice, everything, part_only, executor)

    @property
    def assumes(self) -> tuple[str, ...]:
        """What the plan takes for granted of the new part and its place, in words."""
        tested = any(s.alone for s in self.stages)
        own_test = "its own test must be repeated" if tested else "no stage tests it alone"
        return (
            f"{self.new} has the {self.watts[1]:.4g} W and all other values of its deck; {own_test}",
            f"at rest: temperatures compare {self.old} at the {self.watts[0]:.4g} W {self.powered} with {self.new} at the "
            f"{self.watts[1]:.4g} W of its deck, before any test of it; they have no band",
            *(f"sensor {sensor}: {why}" for sensor, why in self.unplaced.items()),
            *self.replacement.assumes[1:],
            *self._clocks(),
        )

    def _clocks(self) -> list[str]:
        """Return in words at which stated offsets logs are joined to those of repeated tests; nothing where there is none."""
        source = self.campaign.source
        tables = [source.names()[name][1].joined for name in self.tests] if source is not None else []
        joined = (one for t in tables for one in (t if isinstance(t, list) else [t] if t is not None else []))
        stated = ", ".join(f"'{one.record}' {one.offset}" for one in joined if isinstance(one.offset, str))
        return [f"clocks of the new logs: the offsets that the campaign states of the old ones, {stated}"] * bool(stated)

    @property
    def unplaced(self) -> dict[str, str]:
        """Sensor -> why the model after the swap has no place for it."""
        out = {}
        for s in self.stages:
            names = Names(s.model)
            for channel, target in s.bind.items():
                if target not in names.nodes:
                    seat = target if s.alone else target.removeprefix(f"{s.part}.")
                    nodes = ", ".join(Names(self.model).nodes)
                    out[channel] = f"{self.new} has no node '{seat}', where it sat (it has {nodes}). State its place: {SEAT.format(seat)}"
        return out

    def __str__(self) -> str:
        """Return the plan as text, below the standing of the values that it rests on."""
        return self.standing.over(self.text)

    @property
    def text(self) -> str:
        """The plan alone as text."""
        lines = [f"{self.part}: {self.old} -> {self.new}", "  assumed:", *(f"    {a}" for a in self.assumes)]
        lines += ["  removed with the old part:"] * bool(self.replacement.dropped)
        lines += [f"    {d.path} {short_text(d.text)}, {d.origin}, {d.why}" for d in self.replacement.dropped]
        if self.replacement.untied:
            lines.append(f"  no longer shared with other instances: {', '.join(self.replacement.untied)}")
        lines.append(f"  retuned values: {len(self.freed)}, {', '.join(self.freed) or 'none'}")
        for t in self.touched:
            what = "freed" if not t.held else f"fixed: {t.held}"
            lines.append(f"    {t.stage}: {t.path}  {t.kelvin:.2f} K for {100 * t.change:.0f} %, through {', '.join(t.through)}; {what}")
        lines.append("  stages:")
        for s in self.stages:
            changed = "" if s.identity[0] == s.identity[1] else f" ({s.identity[0][:8]} -> {s.identity[1][:8]})"
            lines.append(f"    {s.name}: {s.action}{changed}, {s.why}")
        total = len(self.tests) + len(self.kept_tests)
        lines.append(f"  tests to repeat: {len(self.tests)} of {total}: {', '.join(self.tests)}")
        lines.append("  at rest before -> after:")
        lines += [f"    {s}: {self.before[s] - ICE_POINT:.2f} -> {t - ICE_POINT:.2f} degC" for s, t in self.after.items()]
        return "\n".join(lines)


def plan_retune(
    campaign: Campaign, part: str, new: Model | str | os.PathLike[str], *, sensors: Mapping[str, str] | None = None
) -> RetunePlan:
    """Return the plan of a replacement: what it assumes, drops and touches, which stages and tests are due, predictions before and after.

    Parameters
    ----------
    campaign : Campaign     As `run_stages` returned it.
    part : str              Path of the part in the model of the last stage.
    new : Model or path     The new part, or its deck.
    sensors : dict          Node of the old part where a sensor sat -> node of the new one where it sits; the same name by default.

    Raises
    ------
    ThermidError   When there is no such part, the new one does not fit its place, or the campaign was made in Python.
    """
    source = campaign.source
    if source is None:
        raise DeckError(
            "a plan needs the campaign's file; this campaign was made in Python. Call run_stages on a campaign file.",
            campaign.title,
            code="campaign.not-from-file",
        )
    model = new if isinstance(new, Model) else load_model(new)
    levels = [Level(name, request) for name, request in campaign.requests.items()]
    top = levels[-1].name
    above = campaign[top].model
    part = above.canonical(part)
    old = above.submodel(part)
    places = places_of(source, levels, top)
    swapped, what = above.replaced(part, model)
    swapped = what.starting(swapped)
    seats = {Names(old).find(a): Names(model).find(b) for a, b in (sensors or {}).items()}
    plans: list[StagePlan] = []
    touched: list[Touch] = []
    for level in levels:
        plan, touches = _staged(campaign, level, places[level.name], part, model)
        plans += [replace(p, bind=_bound(campaign.requests[p.of], p, seats)) for p in plan]
        touched += touches
    last = campaign[top].experiments[-1]
    rest = _at_rest(last, part)
    before = _observed(_steady(above, rest), last)
    after = _observed(_steady(swapped, rest), last, {f"{part}.{a}": f"{part}.{b}" for a, b in seats.items()})
    return RetunePlan(
        part,
        old.title,
        model.title,
        tuple(plans),
        tuple(touched),
        before,
        after,
        (_watts(above, rest, part), _watts(swapped, rest, part)),
        _powered(above, part),
        what,
        campaign,
        model,
    )


def check_replacement(
    campaign: str | os.PathLike[str],
    part: str,
    new: str | os.PathLike[str],
    logs: CampaignSource | None = None,
    part_only: bool = False,
    sensors: Mapping[str, str] | None = None,
) -> None:
    """Refuse a part that does not fit its place in the model of a campaign's last stage, or has no such nodes, before any stage runs.

    Of new `logs` one must be there of each stage that is due whatever the stages find: of the tests of the part alone, and of the last
    stage where it fits values of the part.

    Raises
    ------
    ThermidError   As `plan_retune`, such as for areas that the view factors of an enclosure do not allow, or for logs that are missing.
    """
    source, model = CampaignSource.read(campaign), load_model(new)
    *below, top = source.content.stages
    above = source.model(top.model, source.where(f"stages.{len(below)}.model"))
    path = above.canonical(part)
    swapped = above.replaced(path, model)[0]
    with errors_at(f"'{model.title}' at {path}", ": "):
        compile_network(swapped)
        [(Names(above.submodel(path)).find(a), Names(model).find(b)) for a, b in (sensors or {}).items()]
    if logs is None:
        return
    alone = {n for p, i in top.inherit.items() if above.canonical(p) == path for n in i.stages}
    due = [s.records for s in below if s.name in alone]
    values, touched = ParameterSet(above), touching(above, path)
    own = {p for p in map(above.canonical, top.free) if inside(p, path) and p not in {*touched.settings, *top.freeze}}
    own &= ParameterSet(swapped).table.keys()
    if any(not touched.why(values, p)[1] for p in own) and not part_only:
        due.append(top.records)
    absent = {n for n in logs.content.records if not logs.in_data(n)}
    if missing := dict.fromkeys(n for records in due if absent.issuperset(records) for n in records):
        raise MissingDataError(_missing(logs, missing), logs.path.name)


def _bound(request: Request, plan: StagePlan, seats: Mapping[str, str]) -> dict[str, str]:
    """Return channel -> its node after the swap, of the sensors on the part in the tests of a stage."""
    if not (plan.alone or plan.part):
        return {}
    ahead = "" if plan.alone else f"{plan.part}."
    names, out = Names(request.model), {}
    for record in request.records:
        for c in (c for c in record.channels.values() if c.role == "node"):
            at = names.find(c.target or "")
            if at.startswith(ahead):
                seat = at.removeprefix(ahead)
                out[c.name] = ahead + seats.get(seat, seat)
    return out


def _powered(model: Model, part: str) -> str:
    """Return who gave the powers of a part in a model, in words."""
    values, deck = ParameterSet(model), model.submodel(part)
    loads = [f"{part}.{prefix}{name}.power" for inner, prefix in deck.walk() for name in inner.loads]
    origins = dict.fromkeys(values.table[values.literal_behind(p)].origin for p in loads if p in values.table)
    sources = [o for o in origins if o.startswith(("stage", "[set]"))]
    return f"of {' and '.join(sources)}" if sources else "of its deck"


def _staged(campaign: Campaign, level: Level, places: tuple[str, ...], part: str, new: Model) -> tuple[list[StagePlan], list[Touch]]:
    """Return what becomes of a stage, and what of its values the part touches."""
    done, request = campaign[level.name], level.request
    records = tuple(r.name for r in request.records)
    same = done.given_model.identity()
    unchanged = StagePlan(level.name, level.name, "kept", "none of its inputs changes", (), (), (same, same), done.given_model)
    if f"{part}." in places:
        free = tuple(p for p in request.free if request.model.canonical(p) in ParameterSet(new).table)
        lost = [p for p in request.free if p not in free]
        why = "the new part, tested alone" + (f"; it has no {', '.join(lost)}" if lost else "")
        alone = StagePlan(level.name, level.name, "run", why, free, records, (same, new.identity()), new, "", True)
        if len(places) == 1:
            return [alone], []
        name = f"{level.name} at {part}"
        return [unchanged, StagePlan(name, level.name, "run", why, free, records, (same, new.identity()), new, "", True)], []
    within = {prefix for prefix, _ in request.model.instances()}  # a bench deck has some of the parts that stand at its place
    holds = [place for place in places if part.startswith(place) and f"{part.removeprefix(place)}." in within]
    if not holds:
        return [unchanged], []
    if len(places) > 1:
        raise IdentificationError(
            f"stage '{level.name}' is used at {len(places)} places of '{campaign.title}', but the part is replaced at one only. Give the "
            "rebuilt unit a separate stage.",
            part,
            code="campaign.refused",
        )
    inner = part.removeprefix(holds[0])
    model = request.model.replace(inner, new)
    touches, starts = _touched_values(done, level, inner, new)
    free = tuple(t.path for t in touches if not t.held)
    identity = (request.model.identity(), model.identity())
    if not free:
        why = "its model changes, but none of its fitted values needs a new fit"
        return [StagePlan(level.name, level.name, "carried", why, (), (), identity, model, inner, starts=starts)], touches
    why = f"{', '.join(free)} anew"
    return [StagePlan(level.name, level.name, "run", why, free, records, identity, model, inner, starts=starts)], touches


def _touched_values(done: Calibration, level: Level, inner: str, new: Model) -> tuple[list[Touch], tuple[PlaceStart, ...]]:
    """Return a `Touch` of every value of a stage that acts at the part's interfaces, and the values of the place that start anew.

    A touch has the largest change of a sensor's steady temperature of any record [K] as the value changes by its spread,
    `CHANGE_WITHOUT_SPREAD` without one, and says why it is held: it is shared with values that the swap does not affect, or moves no sensor
    by `MIN_EFFECT`.
    """
    model = done.model
    values, touched = ParameterSet(model), touching(model, inner)
    bare, what = model.replaced(inner, new)
    after = what.starting(bare)
    parameters = ParameterSet(after)
    numbers = parameters.evaluate({})
    fitted = done.values.assignments
    behind = {s.path: [p for p in fitted if s.path in values.downstream([p])] for s in what.starts if s.path in values.table}
    starts = tuple(s for s in what.starts if behind.get(s.path))
    start_of = {p: s for s in starts for p in behind[s.path]}
    spreads = {s.path: s.log_sd for s in starts}
    rests = [(e, _at_rest(e, inner)) for e in done.experiments]
    still = [_observed(_steady(after, rest), e) for e, rest in rests]
    out = []
    for path in dict.fromkeys((*spreads, *fitted)):
        through, elsewhere = touched.why(values, path)
        of_part = path.startswith(f"{inner}.") and path not in touched.settings
        stays = path in start_of and start_of[path].path != path
        if path not in parameters.table or not (through or of_part) or (stays and not elsewhere):
            continue
        parameter = parameters.table[path].parameter
        high = parameter.maximum if parameter.maximum is not None else np.inf
        change = spreads.get(path, CHANGE_WITHOUT_SPREAD)
        number = float(numbers[path]) * (1.0 + change if (1.0 + change) * float(numbers[path]) <= high else 1.0 / (1.0 + change))
        words = f"a change of {100 * change:.0f} %"
        changed = after.with_values({path: Parameter.exact(number, parameter.unit)}, words) if parameter.is_literal else after
        moved = [_observed(_steady(changed, rest), e) for e, rest in rests]
        kelvin = max(abs(t - before[o]) for now, before in zip(moved, still, strict=True) for o, t in now.items())
        held = ""
        if stays:
            held = f"stays with {', '.join(elsewhere)}; {start_of[path].path} now has a separate value"
        elif elsewhere and path not in spreads:
            held = f"shared with {', '.join(elsewhere)}, which the swap does not affect"
        elif kelvin < MIN_EFFECT and not of_part:
            held = f"{words} moves no sensor by {MIN_EFFECT} K"
        out.append(Touch(level.name, path, tuple(through) or ("the part itself",), kelvin, change, held))
    if any(not t.held for t in out):  # in a test that is due anyway, what starts again is no longer what it was
        out = [replace(t, held="") if t.path in spreads else t for t in out]
    return out, starts


def _at_rest(experiment: Experiment, without: str) -> Scenario:
    """Return the record of an experiment with every input at its mean; loads of a part are left to its deck."""
    bare = experiment.bare

    def constant(signals: Mapping[str, Any], unit: str) -> dict[str, Any]:
        """Return signals with their means over the run as texts with a unit, those of the part left out."""
        remaining = {k: v for k, v in signals.items() if not k.startswith(f"{without}.")}
        return {k: f"{v.mean_over(0.0, bare.seconds)!r} [{unit}]" if not isinstance(v, Constant) else v for k, v in remaining.items()}

    return replace(
        bare,
        title="at rest",
        boundaries=constant(bare.boundaries, "K"),
        loads=constant(bare.loads, "W"),
        commands=constant(bare.commands, "1"),
        gains={k: v for k, v in bare.gains.items() if not k.startswith(f"{without}.")},
    )


def _watts(model: Model, scenario: Scenario, part: str) -> float:
    """Return the power of a part: by its deck, or as a scenario gives it. [W]"""
    loads = {model.canonical(n): v.value for n, v in scenario.loads.items() if isinstance(v, Constant)}
    rows = compile_network(model, media=scenario.media()).numbers().loads
    inside = {row.name: float(value_of(row.coefficients[0])) for row in rows if row.name.startswith(f"{part}.")}
    return float(sum(loads.get(name, watts) for name, watts in inside.items()))


def _steady(model: Model, scenario: Scenario) -> Mapping[str, float]:
    """Return the temperatures at rest. [K]"""
    try:
        return steady(model, scenario)
    except SolverError as error:
        raise IdentificationError(
            f"a swap is judged in the steady state, which does not exist here: {error.message}", model.title, code=error.code
        ) from None


def _observed(rest: Mapping[str, float], experiment: Experiment, seats: Mapping[str, str] | None = None) -> dict[str, float]:
    """Return sensor -> temperature at rest, of the nodes that a model still has; `seats` says where sensors sit by now. [K]"""
    now = {o.sensor: (seats or {}).get(o.seat, o.seat) for o in experiment.observations}
    return {sensor: rest[seat] for sensor, seat in now.items() if seat in rest}


def retuned(
    plan: RetunePlan,
    data: str | os.PathLike[str] | CampaignSource,
    notice: Notice | None = None,
    everything: bool = False,
    part_only: bool = False,
    executor: Workers = None,
) -> Campaign:
    """Return the campaign after a retune; see `RetunePlan.run`."""
    before = plan.campaign
    assert before.source is not None
    if plan.unplaced:
        raise DeckError(" ".join(f"'{sensor}': {why}." for sensor, why in plan.unplaced.items()), plan.part, code="campaign.refused")
    source = data if isinstance(data, CampaignSource) else CampaignSource.read(before.source.path, data)
    due = tuple(r for s in plan.stages if s.alone for r in s.records) if part_only else plan.tests
    idle = () if everything or part_only else _idle(source, plan)
    source, absent = _source(source, plan, due, everything)
    due = tuple(name for name in due if name not in absent)
    tables = {s.name: (k, s) for k, s in enumerate(before.source.content.stages)}
    renamed = {s.of: s.name for s in plan.stages if s.name != s.of}
    done: dict[str, Calibration] = {}
    keys: dict[str, str] = {}
    requests: dict[str, Request] = {}
    for stage in plan.stages:
        k, table = tables[stage.of]
        keys[stage.name] = before.keys[stage.of]
        requests[stage.name] = before.requests[stage.of]
        again = everything and not (stage.name == stage.of and stage.of in renamed)
        stage = replace(stage, records=tuple(r for r in stage.records if r not in absent))
        if stage.action == "kept" and not again:
            done[stage.name] = before[stage.of]
            continue
        carried = not again and (stage.action == "carried" or (part_only and not stage.alone))
        with errors_at(source.where(f"stages.{k}"), ": "):
            changed_table = _told_by(table, stage, renamed, again, plan, done)
            moved = {c: node for c, node in stage.bind.items() if c not in changed_table.ignore}
            changed_table = changed_table.model_copy(update={"bind": {**changed_table.bind, **moved}})
            changed_table = (
                changed_table.model_copy(update={"records": [], "steady": {}, "free": [], "priors": {}}) if carried else changed_table
            )
            request = request_of(source, changed_table, k, done, _model(source, table, k, stage, plan, before[stage.of] if again else None))
            request = request if stage.alone or again else _local(request, stage, before[stage.of], plan)
            if carried:
                done[stage.name] = _carry_over(before[stage.of], request, _replaced_places(stage)) if stage.part else before[stage.of]
            else:
                anew = () if stage.alone or again else (*_replaced_places(stage), *stage.free)
                request, done[stage.name] = _fitted(request, before[stage.of], anew, progress_of(notice, stage.name), executor)
            requests[stage.name] = request
            keys[stage.name] = request.stage_key([keys[n] for i in changed_table.inherit.values() for n in i.stages])
    count = 0 if part_only else len(plan.freed)
    tests, values = counted(len(due), "test"), counted(count, "value")
    note = f"After {plan.old} was replaced by {plan.new} at {plan.part}: {tests} repeated, {values} retuned."
    if absent:
        note += f" No new log of {', '.join(absent)}: the values rest on the other tests."
    if idle:
        note += f" Not used, though there are new logs of them: {', '.join(idle)}, because no value of their stage is fitted again."
    return Campaign(before.title, done, (), keys, note, requests=requests)


def _replaced_places(stage: StagePlan) -> tuple[str, ...]:
    """Return the part and the values of its place that start again, in the model of a stage."""
    return (stage.part, *(s.path for s in stage.starts))


def _fitted(request: Request, before: Calibration, anew: Sequence[str], progress: Any, executor: Workers) -> tuple[Request, Calibration]:
    """Return the fit of a stage with its request; instruments that are not those of the tests before have constant errors of their own.

    The constant errors are fitted with the accuracy that is stated of them. Where they agree with those before, by the errors of both, the
    instruments are the same: their errors, scales and lags are then fixed, since what is known of the other values goes together with them.
    What is known of all but the parts and values `anew` is that of before, by its model of error too.
    """
    if not anew:
        return request, fit(request, progress, executor=executor)
    held_request = replace(request, records=tuple(as_found(r, before.values, before.bias) for r in request.records))
    own_request = replace(request, held_bias={}, held_errors=None, store=request.store.only(lambda s: s.kind == "parameter"), remarks=())
    try:
        refit = fit(own_request, progress, executor=executor) if any(s.kind != "parameter" for s in before.store.states.values()) else None
    except IdentificationError:
        refit = None
    changed = moved_instruments(before.store, refit.store) if refit is not None else None
    if refit is None or changed is None or changed.verdict != MOVED:
        return held_request, _with_errors_before(fit(held_request, progress, executor=executor), before, anew, held_request)
    remark = (
        f"the logs after the swap come from other instruments, or these drifted: {', '.join(changed.paths)}. Their constant errors "
        "were fitted again, within the stated accuracy. Of the other values, only those were fitted again that the new part affects."
    )
    return own_request, _with_errors_before(replace(refit, warnings=(remark, *refit.warnings)), before, anew, own_request)


def _with_errors_before(refit: Calibration, before: Calibration, anew: Sequence[str], request: Request) -> Calibration:
    """Return a fit of some values with what the fit before it left open of all others; not credible where its logs contradict these."""
    provenance, earlier = refit.values.provenance, request.store.provenance.get(before.stage, {})
    if ERRORS_KEY in provenance and ERRORS_KEY in earlier:
        provenance = {**provenance, ERRORS_KEY: errors_after(provenance[ERRORS_KEY], earlier[ERRORS_KEY], anew)}
    rest = {k: x for k, x in earlier.items() if k != ERRORS_KEY}
    every = {n: x for n, x in refit.store.provenance.items() if n != refit.stage}
    store = replace(refit.store, provenance={**every, f"{before.stage} before": rest, refit.stage: provenance})
    refit = replace(refit, values=replace(refit.values, provenance=provenance), store=store)
    if not refit.contradicts_held:
        return refit
    own = Standing("not credible", "; ".join(refit.moved.contradictions()), refit.stage, request.accepted)
    return replace(refit, own=own).judged(refit.rests, refit.verdict)


def _carry_over(before: Calibration, request: Request, gone: Sequence[str]) -> Calibration:
    """Return a fit with what is known after the swap: nothing of the old part, nor of a joint to it, by its model of error either."""
    store, stage = request.store, before.stage
    kept = dict(store.provenance.get(stage, {}))
    kept |= {ERRORS_KEY: errors_without(kept[ERRORS_KEY], gone)} if ERRORS_KEY in kept else {}
    store = replace(store, provenance={**store.provenance, stage: kept})
    new_paths = [p for p, s in store.states.items() if s.origin.stage == stage]
    return replace(
        before,
        given_model=request.model,
        values=FittedValues.of_store(store, new_paths, stage),
        store=store,
        request=request,
        problem=None,
        warnings=(*before.warnings, CARRIED),
    )


def new_logs(campaign: str | os.PathLike[str], data: str | os.PathLike[str]) -> CampaignSource:
    """Return a campaign with the folder of the repeated tests.

    Raises
    ------
    MissingDataError   When the folder has no log under any name of the campaign's logs.
    """
    source = CampaignSource.read(campaign, data)
    assert source.data is not None
    if not any(map(source.in_data, source.content.records)):
        raise MissingDataError(_missing(source, source.content.records), source.path.name)
    return source


def _missing(source: CampaignSource, records: Iterable[str]) -> str:
    """Return in words that the folder of the repeated tests lacks logs."""
    assert source.data is not None
    return (
        f"the folder '{source.data.name}' of the repeated tests has no log of {', '.join(records)}. The logs beside the campaign "
        "are from before the swap. Put the new logs there, with the file names of the campaign."
    )


def _source(source: CampaignSource, plan: RetunePlan, due: Sequence[str], everything: bool) -> tuple[CampaignSource, tuple[str, ...]]:
    """Return the campaign for the new logs, those of the repeated tests alone unless everything is run, and which of these are absent.

    Raises
    ------
    MissingDataError   When a stage has no log of any of its tests, or a log lacks one that is joined to it.
    """
    old = plan.campaign.source
    assert old is not None
    tables = old.names()

    def logs_of(name: str) -> tuple[str, ...]:
        """Return a record and those of other loggers that are joined to it."""
        joined = tables[name][1].joined or ()
        return (name, *(one.record for one in (joined if isinstance(joined, (list, tuple)) else [joined])))

    with_joined = {log for name in due for log in logs_of(name)}
    due_tables = [table for name, (_, table) in tables.items() if everything or name in with_joined]
    records = {name: source.content.records[name] for name, table in old.content.records.items() if any(table is t for t in due_tables)}
    reduced = replace(source, content=source.content.model_copy(update={"records": records, "verdicts": [], "checksums": {}}))
    if reduced.data is None or reduced.data == old.data:
        return reduced, ()
    before = {name for name, (file, _) in reduced.names().items() if not file.resolve().is_relative_to(reduced.data)} & with_joined
    absent = tuple(name for name in due if before.issuperset(logs_of(name)))
    needed = [r for s in plan.stages if s.records and {*s.records} & {*due} and {*s.records} <= {*absent} for r in s.records]
    if lacking := [name for name in before if everything or name in needed or any(name in logs_of(r) for r in {*due} - {*absent})]:
        raise MissingDataError(_missing(reduced, sorted(lacking)), reduced.path.name)
    return reduced, absent


def _idle(source: CampaignSource, plan: RetunePlan) -> tuple[str, ...]:
    """Return the tests with the new part that no stage is fitted to, though the folder of the repeated tests has logs of them."""
    old = plan.campaign.source
    assert old is not None
    if source.data is None or source.data == old.data:
        return ()
    with_part = {r.name for s in plan.stages if s.part and s.action == "carried" for r in plan.campaign.requests[s.of].records}
    files = {name: file for name, (file, _) in old.names().items() if name in with_part - {*plan.tests}}
    return tuple(name for name, file in files.items() if any(source.data.rglob(file.name)))


def _model(source: CampaignSource, table: StageTable, k: int, stage: StagePlan, plan: RetunePlan, before: Calibration | None) -> Model:
    """Return the deck of a stage with the new part in its place; to fit all anew, after a fit before, with its place at its start."""
    if stage.alone:
        return plan.model
    model = source.model(table.model, source.where(f"stages.{k}"))
    if not stage.part:
        return model
    model = model.replace(stage.part, plan.model).cut(stage.part)  # a new unit, even of the same deck, has values of its own
    if before is None:
        return model
    what = before.model.replaced(stage.part, plan.model)[1]
    return model.with_values({s.path: s.text for s in what.starts if s.of_part or s in stage.starts}, START)


def _told_by(
    table: StageTable, stage: StagePlan, renamed: Mapping[str, str], everything: bool, plan: RetunePlan, done: Mapping[str, Calibration]
) -> StageTable:
    """Return the stage's table: its name, its records by name, and the stage of the new part where it inherits at the part's place."""
    inherit = {}
    for part, i in _of_new(table.inherit, stage, plan).items():
        at_part = stage.part and part == stage.part
        names = [renamed.get(n, n) if at_part else n for n in i.stages]
        inherit[part] = _inheritance(i.model_copy(update={"stage": names}), plan, done)
    if everything:
        more = [p for p in stage.free if p not in table.free]
        free = {*table.free, *more}
        wide = {s.path: f"{100 * s.log_sd} [%]" for s in stage.starts if s.path in free and s.path not in table.priors}
        return table.model_copy(
            update={"name": stage.name, "inherit": inherit, "free": [*table.free, *more], "priors": table.with_spreads(wide)}
        )
    changes = {"name": stage.name, "inherit": inherit, "records": list(stage.records), "free": list(stage.free), "freeze": []}
    priors = {p: t for p, t in table.priors.items() if p in stage.free}
    return table.model_copy(update=changes | {"priors": priors})


def _inheritance(inherit: InheritTable, plan: RetunePlan, done: Mapping[str, Calibration]) -> InheritTable:
    """Return what is inherited of stages that a swap lets fit other values: what `only` kept back before still is, nothing else."""
    if not inherit.only:
        return inherit
    before = [plan.campaign.stages[s.of] for s in plan.stages if s.name in inherit.stages]
    back = dict.fromkeys(p for c in before for p in c.values.parameters if p not in inherit.only)
    fitted_paths = [p for p in back if all(p in done[n].store.parameters for n in inherit.stages if n in done)]
    return inherit.model_copy(update={"only": [], "without": [*inherit.without, *fitted_paths]})


def _of_new(inherit: Mapping[str, InheritTable], stage: StagePlan, plan: RetunePlan) -> dict[str, InheritTable]:
    """Return what a stage inherits, without what stages found of parts of the old part that the new one does not have."""
    definitions, requests = dict(plan.model.instances()), plan.campaign.requests
    out = {}
    for part, i in inherit.items():
        path = part if stage.alone else stage.model.canonical(part)
        rest = path if stage.alone else path.removeprefix(f"{stage.part}.") if inside(path, stage.part) else ""
        there = definitions.get(f"{plan.model.canonical(rest)}.") if rest not in ("", ".", stage.part) else None
        # a part stays where the new one has, in its place, the deck that the stages were fitted with
        if rest in ("", stage.part) or (rest != "." and all(n in requests and there == definition_of(requests[n].model) for n in i.stages)):
            out[part] = i
    return out


def _local(request: Request, stage: StagePlan, before: Calibration, plan: RetunePlan) -> Request:
    """Return a request in which all but the stage's freed values stand where they stood, constant errors of instruments among them."""
    old = before.model
    what = old.replaced(stage.part, plan.model)[1]
    states = known_below(request.store, what).states
    starts = {s.path: replace(Parameter.read(s.text), standing=before.standing) for s in what.starts if s.path not in states}
    gone = [*(s.path for s in what.starts), stage.part]
    stood = {p: v for p, v in before.values.assignments.items() if not any(inside(p, place) for place in gone)}
    model = request.model.with_values(stood, f"stage '{stage.name}' before the swap").with_values(starts, START)
    store = placed(before.store, old, model, what, request.store, stage.name)
    anew = [s.path for s in what.starts if s.path in stage.free and s.path not in request.priors]
    prior = [p for p in request.prior if inside(p, stage.part) and p in states and p not in anew]
    return replace(
        request,
        model=model,
        store=store,
        prior=(*prior, *anew),
        held_bias=before.bias,
        held_errors=before.instrument_errors,
        search="local",  # all stands where the fit before left it; what fixed values do not explain, no other start of the few explains
        remarks=(
            *request.remarks,
            f"only the values that {plan.new} at {plan.part} affects were fitted again. All others, constant errors of instruments among "
            "them, were fixed; the totals count their errors.",
        ),
    )


def placed(before: Store, old: Model, new: Model, what: Replacement, below: Store, stage: str) -> Store:
    """Return what is known of a model after a replacement.

    Parameters
    ----------
    before : Store          What was known of the model with the old part.
    old, new : Model        The model before, and after with every value of the place at its start.
    what : Replacement      What became of the values.
    below : Store           What stages below found of the new part and its place; its values win over starts.
    stage : str             The stage whose model it is; it hands on the starts as what it knows.
    """
    below_part = known_below(below, what)
    starts = starts_of(before, old, new, [s for s in what.starts if s.path not in below_part.states], stage)
    rest = before.drop(what.path, *(s.path for s in what.starts))
    whole = graft(new, [(".", rest), (".", starts), (".", below_part)])[0]
    return replace(whole, dropped=(*whole.dropped, *what.dropped))


def known_below(below: Store, what: Replacement) -> Store:
    """Return what stages below found of the new part and its place.

    What a test of the part alone says of a coefficient is that of its bench; where it is installed it starts from what the place had.
    """
    place = {s.path for s in what.starts}
    bench = {s.path for s in what.starts if s.of_part}
    return below.only(
        lambda s: (
            s.kind == "parameter"
            and all(inside(p, what.path) or p in place for p in s.paths)
            and not (s.path in bench and s.at == what.path)
        )
    )


def starts_of(before: Store, old: Model, new: Model, starts: Sequence[PlaceStart], stage: str) -> Store:
    """Return the starts of values of a place as states, whose errors are in ln of the value.

    A joint has the error of the joint that it is taken from and, besides, what joints of one kind differ by. A coefficient inside the part
    has the stated error s, of which what the fit before left open, k, is a part, so that sqrt(s^2 - k^2) is its own; k alone where that is
    more.
    """
    values, table = ParameterSet(old), ParameterSet(new).table
    columns = len(before.sources)
    new_sources, states = [], {}
    root = np.zeros((len(starts), columns + len(starts)))
    for k, one in enumerate(starts):
        written = table[one.path].parameter
        literal = written.expression.literal
        assert literal is not None
        row = _response(before, values, one.path)
        known_sd = float(np.linalg.norm(row)) if one.of_part else 0.0
        root[k, :columns], root[k, columns + k] = row, math.sqrt(max(one.log_sd**2 - known_sd**2, 0.0))
        new_sources.append(Source(f"start of {one.path} after a replacement", "stated", Normal(), str(one)))
        low, high = (w if w is not None else end for w, end in zip(written.walls, (0.0, math.inf), strict=True))
        at, origin = literal.value, ValueOrigin("twin", stage)
        ends = (low, high)
        states[one.path] = State(
            one.path, at, True, written.unit, ends, origin, paths=(one.path,), deck=table[one.path].deck_text, start=at
        )
    return Store(states, (*before.sources, *new_sources), root)


def _response(before: Store, values: ParameterSet, path: str) -> NDArray[np.float64]:
    """Return d ln(value at `path`) / d source (sources,), by a relative step `RELATIVE_STEP` of each number behind it."""
    out = np.zeros(len(before.sources))
    at = float(values.evaluate({})[path])
    for state in before.parameters.values():
        if not state.known or path not in values.downstream(state.acts):
            continue
        moved = float(values.evaluate(dict.fromkeys(state.acts, state.value * (1.0 + RELATIVE_STEP)))[path])
        share = math.log(moved / at) / (math.log1p(RELATIVE_STEP) if state.log else RELATIVE_STEP * state.value)
        out += share * before.rows([state.path])[0]
    return out
