"""From a stage of a campaign to what its fit is asked."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from thermid.campaign.file import CampaignSource, local_of, scenario_of
from thermid.campaign.hand import hand_values
from thermid.errors import DeckError, RecordError, nearest
from thermid.fit.calibration import Calibration
from thermid.fit.problem.keys import digest, ingredients_of
from thermid.fit.problem.request import LocalSpec, Reading, Request
from thermid.fit.problem.selection import freed, priors_of
from thermid.knowledge.graft import graft
from thermid.knowledge.store import Store
from thermid.measure import Record
from thermid.model.deck.modelfile import resolve_inside
from thermid.model.laws.signal import literal
from thermid.model.tree.model import Model
from thermid.simulation.scenarios.scenario import STEADY, Scenario

if TYPE_CHECKING:
    from thermid.campaign.schema import InheritTable, StageTable


def request_of(source: CampaignSource, stage: StageTable, k: int, done: Mapping[str, Calibration], model: Model | None = None) -> Request:
    """Return what a stage asks, with what it inherits laid under the parent's own [set]; of its deck, or of a model in its place."""
    where = source.where(f"stages.{k}")
    model = source.model(stage.model, where) if model is None else model
    model = model.cut(*stage.untie) if isinstance(stage.untie, list) else model
    store, moving, remarks = _from_below(model, stage, done, where)
    model = store.on(model)
    store, hidden = store.acting_in(model)
    if stage.values:
        hand = hand_values(resolve_inside(source.path.parent, stage.values, f"{where}.values"), model, stage.name, f"{where}.values")
        gone = [f"'{d.path}' {d.text} by {d.origin} does not apply: {d.why}." for d in hand.dropped]
        return Request(model, (), store=store, name=stage.name, seen=store.seen, hand=hand, remarks=(*remarks, *hidden, *gone))
    records = tuple(source.bound(n, stage) for n in source.pick(stage.records, where))
    scenario = scenario_of(stage.scenario, stage.name)
    points, settled = steady_points(source, stage, records, scenario, where)
    records = (*records, *points)
    prior = [p for p in moving if store.states[p].acts and store.states[p].known and store.rows([p]).any()]
    free, frozen = freed(model, stage.free, stage.freeze, where, prior)
    prior = [p for p in prior if p not in frozen]
    return Request(
        model,
        records,
        tuple(free),
        {"*": scenario, **settled},
        {n: LocalSpec.read(t, f"{where}.local.{n}") for n, t in local_of(stage.local).items()},
        record_local={r.name: source.local_of_record(r.name) for r in records if r.name not in settled},
        priors=priors_of(model, {p: t if isinstance(t, str) else (t.mean, t.sd) for p, t in stage.priors.items()}, where),
        store=store,
        prior=tuple(prior),
        weights=stage.weights,
        knee=stage.knee,
        untie=stage.untie is True,
        loss=stage.loss,
        search=stage.search,
        window=literal(stage.window, "s", where),
        name=stage.name,
        remarks=(*remarks, *hidden, *counted_twice(store, prior, records)),
        seen=store.seen,
        readings=readings_of(stage.readings),
        adequate=literal(stage.adequate, "K", f"{where}.adequate") if stage.adequate else 0.0,
        accepted=stage.name in source.accepted,
    )


def _from_below(
    model: Model, stage: StageTable, done: Mapping[str, Calibration], where: str
) -> tuple[Store, tuple[str, ...], tuple[str, ...]]:
    """Return what the stages below know of a model, which of it may move, and remarks."""
    below: list[tuple[str, Store]] = []
    moving: dict[str, None] = {}
    for part, inherit in stage.inherit.items():
        for name in inherit.stages:
            here = f"{where}.inherit.{part}"
            store = _handed_on(done[name], inherit, here)
            below.append((part, store))
            ahead = "" if part == "." else f"{model.canonical(part)}."
            moving |= dict.fromkeys(ahead + p for p in _may_move(store, inherit, here))
    whole, remarks = graft(model, below)
    return whole, tuple(p for p in whole.parameters if p in moving), remarks


def readings_of(tables: Mapping[str, Any]) -> dict[str, Reading]:
    """Return the readings of a stage or verdict."""
    return {n: Reading(t) if isinstance(t, str) else Reading(t.channel, t.offset) for n, t in tables.items()}


def plain_readings(tables: Mapping[str, Any]) -> dict[str, Any]:
    """Return the readings of a stage or verdict as `validate` takes them."""
    return {n: t if isinstance(t, str) else t.model_dump() for n, t in tables.items()}


def keyed(request: Request, stage: StageTable, keys: Mapping[str, str]) -> tuple[Request, dict[str, str]]:
    """Return a stage's request with its key, and the ingredients of that; `keys` are those of the stages below."""
    below = [keys[name] for i in stage.inherit.values() for name in i.stages]
    made = ingredients_of(request, below)
    return replace(request, key=digest(made)), made


def _handed_on(below: Calibration, inherit: InheritTable, where: str) -> Store:
    """Return what a stage hands on of its store, at every depth: all of it, less what `only` and `without` keep back.

    Raises
    ------
    DeckError   When either names a value that the stage does not have.
    """
    store, own = below.store, set(below.values.parameters)
    _check_known(inherit.only, own, f"{where}.only", f"was not fitted by stage '{below.stage}'")
    _check_known(inherit.without, store.parameters, f"{where}.without", f"is not known to stage '{below.stage}'")
    back = {p for p in own if inherit.only and p not in inherit.only} | set(inherit.without)
    return store.only(lambda s: s.path not in back) if back else store


def _may_move(store: Store, inherit: InheritTable, where: str) -> set[str]:
    """Return the values handed on, by their paths in the stage below, that are free in the stage above.

    Raises
    ------
    DeckError   When `move` names what is not handed on, or values are fixed.
    """
    if inherit.move and inherit.as_ != "prior":
        raise DeckError('`move` says which values of a prior may move; with as = "fixed" none does.', f"{where}.move")
    _check_known(inherit.move, store.parameters, f"{where}.move", "is not handed on")
    return set(inherit.move or store.parameters) if inherit.as_ == "prior" else set()


def _check_known(names: Sequence[str], among: Mapping[str, object] | set[str], where: str, words: str) -> None:
    for name in names:
        if name not in among:
            raise DeckError(f"'{name}' {words}.{nearest(name, among)}", where)


def counted_twice(store: Store, prior: Sequence[str], records: Sequence[Record]) -> list[str]:
    """Return a remark for every record whose readings reach a stage as samples and, through a stage below, as prior too.

    Parameters
    ----------
    store : Store       What the stages below know.
    prior : sequence    Which of it may move.
    records : tuple     The stage's own.
    """
    origins = {o.stage for p in prior for s in (store.states[p],) for o in (s.origin, *s.history)}
    used = {sha: stage for stage in origins for sha in store.provenance.get(stage, {}).get("records", {}).values()}
    return [
        f"record '{r.name}' was fitted by stage '{used[r.origin.sha256]}' too, whose result is a prior here: its readings count twice, and "
        "the errors are too small. Hand the values on as fixed, or use another record."
        for r in records
        if r.origin.sha256 in used
    ]


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
    return tuple(points.values()), _scenarios(points, scenario)


def _scenarios(points: Mapping[str, Record], scenario: Scenario) -> dict[str, Scenario]:
    return {name: scenario.with_(start=STEADY) for name in points}


def _apart(start: float, end: float, log: Record, records: tuple[Record, ...], where: str, name: str) -> None:
    """Refuse a stretch that a transient of the stage holds too: its readings would count twice."""
    for other in records:
        if other.origin.sha256 == log.origin.sha256 and other.times[0] < end and other.times[-1] > start:
            raise RecordError(
                f"steady point '{name}' is of {start:g} to {end:g} s of '{log.name}', and the stage fits it from {other.times[0]:g} to "
                f"{other.times[-1]:g} s: its readings would count twice. Trim the transient in `prepare`, or leave one of them out.",
                where,
            )
