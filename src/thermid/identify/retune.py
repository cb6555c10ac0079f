"""The local retune after a swap: only the stages that are due, and in each only what the new part touches."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from thermid.errors import MissingDataError, ThermidError
from thermid.identify.calibrate import fit
from thermid.identify.calibration import Calibration
from thermid.identify.campaignfile import CampaignSource, placed, read_campaign
from thermid.identify.keys import key_of
from thermid.identify.request import Request
from thermid.identify.stages import Campaign
from thermid.identify.staging import request_of
from thermid.knowledge.store import Store, graft
from thermid.model.model import Model

if TYPE_CHECKING:
    from thermid.identify.campaign_schema import StageTable
    from thermid.identify.retune_plan import RetunePlan, StagePlan

__all__ = ["retuned"]

CARRIED = "carried over a swap: its model has the new part, its values and statistics are those of the tests before."


def retuned(
    plan: RetunePlan,
    data: str | os.PathLike[str] | CampaignSource,
    notice: Callable[[str, int, float], None] | None = None,
    everything: bool = False,
) -> Campaign:
    """Return the campaign after a retune; see `RetunePlan.run`."""
    before = plan.campaign
    assert before.source is not None
    source = data if isinstance(data, CampaignSource) else read_campaign(before.source.path, data)
    source = _source(source, plan, everything)
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
        if stage.action == "kept" and not again:
            done[stage.name] = before[stage.of]
            continue
        try:
            told = _told_by(table, stage, renamed, again)
            request = request_of(source, told, k, done, _model(source, table, k, stage, plan))
            request = request if stage.alone or again else _local(request, stage, before[stage.of], plan)
            requests[stage.name] = request
            keys[stage.name] = key_of(request, [keys[n] for i in told.inherit.values() for n in i.stages])
            if stage.action == "carried" and not again:
                store = _store(before[stage.of].store, request, stage) if stage.part else before[stage.of].store
                warnings = (*before[stage.of].warnings, CARRIED)
                done[stage.name] = replace(before[stage.of], model=request.model, warnings=warnings, store=store)
            else:
                done[stage.name] = fit(request, None if notice is None else _named(notice, stage.name))
        except ThermidError as error:
            raise placed(error, source.where(f"stages.{k}")) from None
    note = (
        f"After {plan.old} was replaced by {plan.new} at {plan.part}: {len(plan.tests)} tests repeated, {len(plan.freed)} values retuned."
    )
    return Campaign(before.title, done, (), keys, note, requests=requests)


def _named(notice: Callable[[str, int, float], None], name: str) -> Callable[[int, float], None]:
    return lambda count, rms: notice(name, count, rms)


def _source(source: CampaignSource, plan: RetunePlan, everything: bool) -> CampaignSource:
    """Return the campaign for the new logs, those of the repeated tests alone unless everything is run; other logs need not be there."""
    old = plan.campaign.source
    assert old is not None
    tables = [table for name, (_, table) in old.names().items() if everything or name in plan.tests]
    records = {name: source.content.records[name] for name, table in old.content.records.items() if any(table is t for t in tables)}
    found = replace(source, content=source.content.model_copy(update={"records": records, "verdicts": [], "checksums": {}}))
    if found.data is not None and found.data != old.data:
        _check_repeated(found, found.data, plan.tests)
    return found


def _check_repeated(source: CampaignSource, data: Path, tests: Sequence[str]) -> None:
    """Refuse logs from before the swap, which stand beside the campaign under the same names."""
    before = [name for name, (file, _) in source.names().items() if name in tests and not file.resolve().is_relative_to(data)]
    if before:
        raise MissingDataError(
            f"the folder '{data.name}' of the repeated tests has no log of {', '.join(before)}; those beside the campaign are from before "
            "the swap. Put the new logs there, under the names that the campaign gives.",
            source.path.name,
        )


def _model(source: CampaignSource, table: StageTable, k: int, stage: StagePlan, plan: RetunePlan) -> Model:
    """Return the deck of a stage with the new part in its place, nothing laid over it."""
    if stage.alone:
        return plan.model
    model = source.model(table.model, source.where(f"stages.{k}"))
    return model.replace(stage.part, plan.model) if stage.part else model


def _told_by(table: StageTable, stage: StagePlan, renamed: Mapping[str, str], everything: bool) -> StageTable:
    """Return the stage's table: its name, its records by name, and the stage of the new part where it inherits at the part's place."""
    inherit = {}
    for part, i in table.inherit.items():
        at_part = stage.part and part == stage.part
        inherit[part] = i.model_copy(update={"stage": [renamed.get(n, n) for n in i.stages]}) if at_part else i
    if everything:
        return table.model_copy(update={"name": stage.name, "inherit": inherit})
    changes = {"name": stage.name, "inherit": inherit, "records": list(stage.records), "free": list(stage.free), "freeze": []}
    kept = {p: t for p, t in table.priors.items() if p in stage.free}
    return table.model_copy(update=changes | {"priors": kept})


def _inside(path: str, stage: StagePlan) -> bool:
    return path.startswith(f"{stage.part}.")


def _store(before: Store, request: Request, stage: StagePlan) -> Store:
    """Return what was known before the swap, with what is known of the new part in the place of the old one."""
    new = request.store.only(lambda s: s.kind == "parameter" and all(_inside(p, stage) for p in s.paths))
    return graft(request.model, [(".", before.drop(stage.part)), (".", new)])[0]


def _local(request: Request, stage: StagePlan, before: Calibration, plan: RetunePlan) -> Request:
    """Return a request in which all but the stage's freed values stand where they stood, constant errors of instruments among them."""
    held = {p: v for p, v in before.values.assignments.items() if not _inside(p, stage) or p in stage.free}
    return replace(
        request,
        model=request.model.with_values(held, f"stage '{stage.name}' before the swap"),
        store=_store(before.store, request, stage),
        prior=tuple(p for p in request.prior if _inside(p, stage)),
        bias_priors={},
        held_bias=before.bias,
        held_errors=before.instrument_errors,
        remarks=(
            *request.remarks,
            f"retuned locally for {plan.new} at {plan.part}: all else is held as it was, constant errors of instruments among it. "
            "The totals count what these leave open.",
        ),
    )
