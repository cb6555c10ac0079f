"""The local retune after a swap: only the stages that are due, and in each only what the new part touches."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from thermid.campaign.file import CampaignSource, read_campaign
from thermid.campaign.file import placed as placed_in
from thermid.campaign.stages import Campaign
from thermid.campaign.staging import request_of
from thermid.campaign.swap.placing import known_below, placed
from thermid.errors import MissingDataError, ThermidError
from thermid.fit.calibrate import fit
from thermid.fit.calibration import Calibration
from thermid.fit.problem.request import Request, key_of
from thermid.knowledge.values import view
from thermid.model.tree.identity import definition_of, inside, instances
from thermid.model.tree.model import Model

if TYPE_CHECKING:
    from thermid.campaign.schema import InheritTable, StageTable
    from thermid.campaign.swap.retune_plan import RetunePlan, StagePlan

START = "start after a replacement"
CARRIED = "carried over a swap: its model has the new part, its values and statistics are those of the tests before."


def retuned(
    plan: RetunePlan,
    data: str | os.PathLike[str] | CampaignSource,
    notice: Callable[[str, int, float], None] | None = None,
    everything: bool = False,
    part_only: bool = False,
) -> Campaign:
    """Return the campaign after a retune; see `RetunePlan.run`."""
    before = plan.campaign
    assert before.source is not None
    source = data if isinstance(data, CampaignSource) else read_campaign(before.source.path, data)
    due = tuple(r for s in plan.stages if s.alone for r in s.records) if part_only else plan.tests
    source = _source(source, plan, due, everything)
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
        carried = not again and (stage.action == "carried" or (part_only and not stage.alone))
        try:
            told = _told_by(table, stage, renamed, again, plan, done)
            told = told.model_copy(update={"records": [], "steady": {}, "free": [], "priors": {}}) if carried else told
            request = request_of(source, told, k, done, _model(source, table, k, stage, plan, before[stage.of] if again else None))
            request = request if stage.alone or again else _local(request, stage, before[stage.of], plan)
            requests[stage.name] = request
            keys[stage.name] = key_of(request, [keys[n] for i in told.inherit.values() for n in i.stages])
            if carried:
                done[stage.name] = _carried(before[stage.of], request) if stage.part else before[stage.of]
            else:
                done[stage.name] = fit(request, None if notice is None else _named(notice, stage.name))
        except ThermidError as error:
            raise placed_in(error, source.where(f"stages.{k}")) from None
    count = 0 if part_only else len(plan.freed)
    note = f"After {plan.old} was replaced by {plan.new} at {plan.part}: {len(due)} tests repeated, {count} values retuned."
    return Campaign(before.title, done, (), keys, note, requests=requests)


def _carried(before: Calibration, request: Request) -> Calibration:
    """Return a fit with what is known after the swap: nothing of the old part."""
    own = [p for p, s in request.store.states.items() if s.origin.stage == before.stage]
    return replace(
        before,
        model=request.model,
        values=view(request.store, own, before.stage),
        store=request.store,
        request=request,
        problem=None,
        warnings=(*before.warnings, CARRIED),
    )


def _named(notice: Callable[[str, int, float], None], name: str) -> Callable[[int, float], None]:
    return lambda count, rms: notice(name, count, rms)


def _source(source: CampaignSource, plan: RetunePlan, due: Sequence[str], everything: bool) -> CampaignSource:
    """Return the campaign for the new logs, those of the repeated tests alone unless everything is run; other logs need not be there."""
    old = plan.campaign.source
    assert old is not None
    tables = [table for name, (_, table) in old.names().items() if everything or name in due]
    records = {name: source.content.records[name] for name, table in old.content.records.items() if any(table is t for t in tables)}
    found = replace(source, content=source.content.model_copy(update={"records": records, "verdicts": [], "checksums": {}}))
    if found.data is not None and found.data != old.data:
        _check_repeated(found, found.data, due)
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
    what = before.fitted_model.replaced(stage.part, plan.model)[1]
    return model.with_values({s.path: s.text for s in what.starts if s.of_part or s in stage.starts}, START)


def _told_by(
    table: StageTable, stage: StagePlan, renamed: Mapping[str, str], everything: bool, plan: RetunePlan, done: Mapping[str, Calibration]
) -> StageTable:
    """Return the stage's table: its name, its records by name, and the stage of the new part where it inherits at the part's place."""
    inherit = {}
    for part, i in _of_new(table.inherit, stage, plan).items():
        at_part = stage.part and part == stage.part
        names = [renamed.get(n, n) if at_part else n for n in i.stages]
        inherit[part] = _handed(i.model_copy(update={"stage": names}), plan, done)
    if everything:
        from thermid.campaign.schema import PriorTable

        more = [p for p in stage.free if p not in table.free]
        free = {*table.free, *more}
        wide = {s.path: PriorTable(sd=f"{100 * s.log_sd} [%]") for s in stage.starts if s.path in free and s.path not in table.priors}
        return table.model_copy(
            update={"name": stage.name, "inherit": inherit, "free": [*table.free, *more], "priors": {**table.priors, **wide}}
        )
    changes = {"name": stage.name, "inherit": inherit, "records": list(stage.records), "free": list(stage.free), "freeze": []}
    kept = {p: t for p, t in table.priors.items() if p in stage.free}
    return table.model_copy(update=changes | {"priors": kept})


def _handed(inherit: InheritTable, plan: RetunePlan, done: Mapping[str, Calibration]) -> InheritTable:
    """Return what is inherited of stages that a swap lets fit other values: what `only` kept back before still is, nothing else."""
    if not inherit.only:
        return inherit
    before = [plan.campaign.stages[s.of] for s in plan.stages if s.name in inherit.stages]
    back = dict.fromkeys(p for c in before for p in c.values.parameters if p not in inherit.only)
    known = [p for p in back if all(p in done[n].store.parameters for n in inherit.stages if n in done)]
    return inherit.model_copy(update={"only": [], "without": [*inherit.without, *known]})


def _of_new(inherit: Mapping[str, InheritTable], stage: StagePlan, plan: RetunePlan) -> dict[str, InheritTable]:
    """Return what a stage inherits, without what stages found of parts of the old part that the new one does not have."""
    out = {}
    for part, i in inherit.items():
        path = part if stage.alone else stage.model.canonical(part)
        rest = path if stage.alone else path.removeprefix(f"{stage.part}.") if inside(path, stage.part) else ""
        if rest in ("", stage.part) or (rest != "." and all(_same_part(plan, n, rest) for n in i.stages)):
            out[part] = i
    return out


def _same_part(plan: RetunePlan, stage: str, path: str) -> bool:
    """Return whether the new part has, at a path, the deck that a stage was fitted with."""
    known = dict(instances(plan.model))
    below = plan.campaign.requests.get(stage)
    return below is not None and known.get(f"{plan.model.canonical(path)}.") == definition_of(below.model)


def _local(request: Request, stage: StagePlan, before: Calibration, plan: RetunePlan) -> Request:
    """Return a request in which all but the stage's freed values stand where they stood, constant errors of instruments among them."""
    old = before.fitted_model
    what = old.replaced(stage.part, plan.model)[1]
    told = known_below(request.store, what).states
    starts = {s.path: s.text for s in what.starts if s.path not in told}
    gone = [*(s.path for s in what.starts), stage.part]
    stood = {p: v for p, v in before.values.assignments.items() if not any(inside(p, place) for place in gone)}
    model = request.model.with_values(stood, f"stage '{stage.name}' before the swap").with_values(starts, START)
    store = placed(before.store, old, model, what, request.store, stage.name)
    anew = [s.path for s in what.starts if s.path in stage.free and s.path not in request.priors]
    prior = [p for p in request.prior if inside(p, stage.part) and p in told and p not in anew]
    return replace(
        request,
        model=model,
        store=store,
        prior=(*prior, *anew),
        held_bias=before.bias,
        held_errors=before.instrument_errors,
        remarks=(
            *request.remarks,
            f"only the values that {plan.new} at {plan.part} affects were fitted again. All others, constant errors of instruments among "
            "them, were fixed; the totals count their errors.",
        ),
    )
