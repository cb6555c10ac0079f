"""From a stage of a campaign to what its fit is asked, and the hash of everything that its result depends on."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import replace
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

from thermid.errors import NameNotFoundError, nearest
from thermid.identify.cache import in_full
from thermid.identify.calibration import Calibration
from thermid.identify.campaignfile import CampaignSource, local_of, scenario_of
from thermid.identify.inherit import counted_twice
from thermid.identify.request import LocalSpec, Reading, Request
from thermid.identify.selection import freed, priors_of
from thermid.identify.steady_points import steady_points
from thermid.identify.values import FittedValues
from thermid.knowledge.standing import Standing
from thermid.measure import Channel
from thermid.model.model import Model
from thermid.model.resolve import parameter_table
from thermid.model.signal import literal

if TYPE_CHECKING:
    from thermid.identify.campaign_schema import StageTable

__all__ = ["key_of", "plain_readings", "readings_of", "request_of"]


def request_of(source: CampaignSource, stage: StageTable, k: int, done: Mapping[str, Calibration], model: Model | None = None) -> Request:
    """Return what a stage asks, with what it inherits laid under the parent's own [set]; of its deck, or of a model in its place."""
    where = source.where(f"stages.{k}")
    model = source.model(stage.model, where) if model is None else model
    model = model.cut(*stage.untie) if isinstance(stage.untie, list) else model
    handed: list[FittedValues] = []
    held: list[FittedValues] = []
    told: dict[str, Calibration] = {}
    bias_priors: dict[str, tuple[float, float]] = {}
    seen: dict[str, str] = {}
    remarks: list[str] = []
    instruments: dict[str, tuple[frozenset[str], Standing]] = {}
    for part, inherit in stage.inherit.items():
        for name in inherit.stages:
            below = done[name]
            values = below.values.only(inherit.only) if inherit.only else below.values
            part, prefix = model.canonical(part), "" if part == "." else f"{model.canonical(part)}."
            model = _inherited(model, part, values)
            hidden = _shadowed(model, prefix, values)
            remarks += hidden.values()
            seen |= below.seen
            instruments[_origin(values)] = (_told_of(values, inherit.as_ == "prior"), values.standing)
            if inherit.as_ == "prior":
                # a second part takes the same values, but what they say of sensors counts once
                values = values.only([p for p in values.parameters if p not in hidden])
                values = values.bare() if name in told else values
                told[name] = below
                handed.append(_prefixed(values, prefix))
            else:
                bias_priors |= {s: (v.value, v.error) for s, v in values.sensors.items()}
                bias_priors |= {p: (v.value, v.error) for p, v in values.items() if v.kind == "instrument"}
                remarks += _held(part, name, values)
                held.append(_prefixed(values.only([p for p in values.parameters if p not in hidden]).bare(), prefix))
    records = tuple(source.bound(n, stage) for n in source.pick(stage.records, where))
    scenario = scenario_of(stage.scenario, stage.name)
    points, settled = steady_points(source, stage, records, scenario, where)
    records = (*records, *points)
    free, frozen = freed(model, stage.free, stage.freeze, where, [p for values in handed for p in values.parameters])
    remarks += [line for values in handed for line in _frozen(values, frozen)]
    held += [values.only([p for p in values.parameters if p in frozen]).bare() for values in handed if frozen]
    handed = [values.only([p for p in values.parameters if p not in frozen]) if frozen else values for values in handed]
    return Request(
        model,
        records,
        tuple(free),
        {"*": scenario, **settled},
        {n: LocalSpec.read(t, f"{where}.local.{n}") for n, t in local_of(stage.local).items()},
        record_local={r.name: source.local_of_record(r.name) for r in records if r.name not in settled},
        priors=priors_of(model, {p: t if isinstance(t, str) else (t.mean, t.sd) for p, t in stage.priors.items()}, where),
        inherited=tuple(handed),
        bias_priors=bias_priors,
        weights=stage.weights,
        knee=stage.knee,
        untie=stage.untie is True,
        loss=stage.loss,
        search=stage.search,
        window=literal(stage.window, "s", where),
        name=stage.name,
        remarks=(*remarks, *counted_twice(told, records)),
        seen=seen,
        readings=readings_of(stage.readings),
        held=tuple(held),
        adequate=literal(stage.adequate, "K", f"{where}.adequate") if stage.adequate else 0.0,
        accepted=stage.name in source.accepted,
        instruments=instruments,
    )


def _told_of(values: FittedValues, prior: bool) -> frozenset[str]:
    """Return the channels of whose instruments a stage below hands errors on: as a prior those of boundaries and powers too."""
    shared = [p.removesuffix(" error") for p, v in values.items() if v.kind == "shared" and prior]
    return frozenset((*values.sensors, *(p.rpartition(" of ")[2] for p, v in values.items() if v.kind == "instrument"), *shared))


def _held(part: str, stage: str, values: FittedValues) -> list[str]:
    """Return a remark that values from below are taken as exact, where the stage below did not know them so."""
    unsure = [p for p, v in values.parameters.items() if v.error > 0]
    if not unsure:
        return []
    what = "the model" if part == "." else f"'{part}'"
    some = f"1 value of {what} is" if len(unsure) == 1 else f"{len(unsure)} values of {what} are"
    return [f"{some} held as found by stage '{stage}'; the errors here leave that out. Hand on with as = \"prior\" to count it."]


def _frozen(values: FittedValues, frozen: set[str]) -> list[str]:
    """Return a remark that some of the values handed on as a prior are held here."""
    held = [p for p in values.parameters if p in frozen]
    return [f"{', '.join(held)}: frozen as stage '{values.stage}' found them; the errors here leave theirs out."] if held else []


def readings_of(tables: Mapping[str, Any]) -> dict[str, Reading]:
    """Return the readings of a stage or verdict."""
    return {n: Reading(t) if isinstance(t, str) else Reading(t.channel, t.offset) for n, t in tables.items()}


def plain_readings(tables: Mapping[str, Any]) -> dict[str, Any]:
    """Return the readings of a stage or verdict as `validate` takes them."""
    return {n: t if isinstance(t, str) else t.model_dump() for n, t in tables.items()}


def _inherited(model: Model, part: str, below: FittedValues) -> Model:
    """Return the model with the values of a stage below laid over one of its parts; ``.`` is the model itself."""
    values = below.assignments
    if part == ".":
        return model.with_values(values, _origin(below))
    inner = model.submodel(part)
    known = parameter_table(inner)
    missing = [p for p in values if p not in known]
    if missing:
        raise NameNotFoundError(
            f"stage '{below.stage}' fitted '{missing[0]}', which '{part}' does not have.{nearest(missing[0], known)}", model.title
        )
    return model.with_values(values, _origin(below), at=part)


def _origin(below: FittedValues) -> str:
    return f"stage '{below.stage}'"


def _shadowed(model: Model, prefix: str, below: FittedValues) -> dict[str, str]:
    """Return path -> a remark for every inherited value that the deck's own [set] hides; it is not handed on as a prior either."""
    table = {p: parameter_table(model)[prefix + p] for p in below.assignments}
    return {
        p: f"'{prefix}{p}' is {entry.parameter.text} by {entry.origin}, which hides what stage '{below.stage}' found."
        for p, entry in table.items()
        if any(who == _origin(below) for who, _ in entry.shadowed)
    }


def _prefixed(values: FittedValues, prefix: str) -> FittedValues:
    """Return fitted values under the paths that they have in the model above."""
    items = {prefix + p if v.kind == "parameter" else p: replace(v, also=tuple(prefix + q for q in v.also)) for p, v in values.items()}
    conditions = {prefix + p: at for p, at in values.provenance.get("conditions", {}).items()}
    misfit = {prefix + n: size for n, size in values.provenance.get("misfit", {}).items()}
    return replace(values, items_=items, provenance={**values.provenance, "conditions": conditions, "misfit": misfit})


def _channel_key(c: Channel) -> list[Any]:
    """Return what a fit depends on of a channel beside its numbers in the file, whose hash is of them as they are written."""
    known = [c.role, c.target, c.gain, c.unit, c.quantity, c.noise, c.accuracy, c.resolution, c.prompt, c.correction]
    return [*known, *([repr(c.part)] if c.part else [])]


def key_of(request: Request, below: list[str]) -> str:
    """Return the hash of everything that a stage's result depends on.

    What it inherits is a result of the stages below, whose keys say what that depends on. Inherited errors are left out: a fit that was
    recalled computes them anew, with other last digits than the search that came upon it.
    """
    content = {
        "version": version("thermid"),
        "model": request.model.identity(),
        "records": {
            r.name: [
                r.origin.sha256,
                list(r.steps),
                *([repr(r.second)] if r.second else []),
                {n: _channel_key(c) for n, c in r.channels.items()},
            ]
            for r in request.records
        },
        "free": request.free,
        "scenario": request.scenarios,
        "local": repr(sorted(request.local.items())),
        "priors": repr(sorted(request.priors.items())),
        "bias": repr(sorted(request.held_bias.items())),
        "record_local": repr(sorted((n, sorted(t.items())) for n, t in request.record_local.items())),
        "bias priors": repr(sorted((name, mean) for name, (mean, _) in request.bias_priors.items())),
        "how": [request.untie, request.loss, request.knee, request.search, request.window, repr(request.options)],
        "readings": repr(sorted(request.readings.items())),
        "weights": sorted(request.weights.items()),
        "inherited": [list(values) for values in request.inherited],
        "below": below,
    }
    return hashlib.sha256(json.dumps(content, sort_keys=True, default=in_full).encode()).hexdigest()
