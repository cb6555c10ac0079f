"""From a stage of a campaign to what its fit is asked."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from thermid.identify.calibration import Calibration
from thermid.identify.campaignfile import CampaignSource, local_of, scenario_of
from thermid.identify.hand import hand_values
from thermid.identify.inherit import counted_twice, handed_on, may_move
from thermid.identify.request import LocalSpec, Reading, Request
from thermid.identify.selection import freed, priors_of
from thermid.identify.steady_points import steady_points
from thermid.knowledge.graft import graft
from thermid.knowledge.store import Store
from thermid.model.model import Model
from thermid.model.modelfile import resolve_inside
from thermid.model.signal import literal

if TYPE_CHECKING:
    from thermid.identify.campaign_schema import StageTable

__all__ = ["plain_readings", "readings_of", "request_of"]


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
            store = handed_on(done[name], inherit, here)
            below.append((part, store))
            ahead = "" if part == "." else f"{model.canonical(part)}."
            moving |= dict.fromkeys(ahead + p for p in may_move(store, inherit, here))
    whole, remarks = graft(model, below)
    return whole, tuple(p for p in whole.parameters if p in moving), remarks


def readings_of(tables: Mapping[str, Any]) -> dict[str, Reading]:
    """Return the readings of a stage or verdict."""
    return {n: Reading(t) if isinstance(t, str) else Reading(t.channel, t.offset) for n, t in tables.items()}


def plain_readings(tables: Mapping[str, Any]) -> dict[str, Any]:
    """Return the readings of a stage or verdict as `validate` takes them."""
    return {n: t if isinstance(t, str) else t.model_dump() for n, t in tables.items()}
