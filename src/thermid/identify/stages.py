"""`run_stages`: component -> submodel -> full, each stage starting from what the ones below found."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from thermid.errors import NameNotFoundError, ThermidError, nearest
from thermid.identify.cache import file_name, in_full, recall, remember
from thermid.identify.calibrate import fit
from thermid.identify.calibration import Calibration
from thermid.identify.campaignfile import CampaignSource, local_of, placed, read_campaign, scenario_of
from thermid.identify.inherit import counted_twice
from thermid.identify.request import LocalSpec, Reading, Request
from thermid.identify.validate import Criteria, Verdict, validate
from thermid.identify.values import FittedValues
from thermid.model.model import Model
from thermid.model.resolve import parameter_table
from thermid.model.signal import literal

if TYPE_CHECKING:
    from thermid.identify.campaign_schema import StageTable, VerdictTable

__all__ = ["Campaign", "run_stages"]

Notice = Callable[[str, int, float], None]
"""Called with what is running, the number of evaluations and the RMS of the weighted residuals."""


@dataclass(frozen=True, eq=False)
class Campaign:
    """The result of a campaign.

    Parameters
    ----------
    title : str                 The campaign's.
    stages : dict               Stage -> Calibration, in order.
    verdicts : tuple            Verdicts, in order.
    keys : dict                 Stage -> hash of everything that its result depends on.
    note : str                  What the author says of it.
    """

    title: str
    stages: Mapping[str, Calibration]
    verdicts: tuple[Verdict, ...]
    keys: Mapping[str, str]
    note: str = ""

    def __getitem__(self, stage: str) -> Calibration:
        """Return the calibration of a stage.

        Raises
        ------
        NameNotFoundError   With the nearest name.
        """
        if stage not in self.stages:
            raise NameNotFoundError(f"no stage '{stage}'.{nearest(stage, self.stages)}", self.title)
        return self.stages[stage]

    def __iter__(self) -> Iterator[str]:
        """Yield the names of the stages."""
        return iter(self.stages)

    def table(self, field_name: str) -> dict[str, dict[str, float]]:
        """Return part -> stage -> value of every parameter of a name, parts down, levels across: the document's Table 2. [SI]"""
        out: dict[str, dict[str, float]] = {}
        for stage, calibration in self.stages.items():
            from thermid.model.resolve import ParameterSet

            values = ParameterSet(calibration.fitted_model).evaluate({})
            for path in parameter_table(calibration.fitted_model):
                if path == field_name or path.endswith(f".{field_name}"):
                    part = path.removesuffix(field_name).rstrip(".") or calibration.model.title
                    out.setdefault(part, {})[stage] = float(values[path])
        return out

    @property
    def passed(self) -> bool:
        """Whether every verdict passed."""
        return all(v.passed for v in self.verdicts)

    def save(self, folder: str | os.PathLike[str]) -> list[Path]:
        """Write one values file per stage and return their paths."""
        target = Path(folder)
        target.mkdir(parents=True, exist_ok=True)
        out = []
        for name, calibration in self.stages.items():
            path = target / f"{file_name(name)}.values.toml"
            calibration.save(path)
            out.append(path)
        return out

    def __str__(self) -> str:
        """Return all stages and verdicts as text."""
        return "\n\n".join([self.title, *map(str, self.stages.values()), *map(str, self.verdicts)])


def run_stages(
    campaign: str | os.PathLike[str] | CampaignSource,
    *,
    data: str | os.PathLike[str] | None = None,
    notice: Notice | None = None,
    cache: str | os.PathLike[str] | None = None,
) -> Campaign:
    """Return the calibrations and verdicts of a campaign.

    Parameters
    ----------
    campaign : path         The campaign file.
    data : path             A folder of logs outside the project.
    notice : callable       Called while stages run.
    cache : path            A results folder; a stage whose model, records, request and version are as they were is not fitted again.

    Raises
    ------
    ThermidError   From reading, fitting or judging; the message says at which stage.
    """
    source = campaign if isinstance(campaign, CampaignSource) else read_campaign(campaign, data)
    folder = Path(cache) if cache is not None else None
    done: dict[str, Calibration] = {}
    keys: dict[str, str] = {}
    for k, stage in enumerate(source.content.stages):
        try:
            request = _request(source, stage, k, done)
            keys[stage.name] = _key(request, [keys[name] for i in stage.inherit.values() for name in i.stages])
            kept = recall(folder, stage.name, keys[stage.name])
            found = fit(request, _told(notice, stage.name), kept)
            if kept is None and found.converged:
                remember(folder, stage.name, keys[stage.name], list(found.fitted), np.array(list(found.fitted.values())))
            done[stage.name] = found
        except ThermidError as error:
            raise placed(error, source.where(f"stages.{k}")) from None
    used = {sha: user for c in done.values() for sha, user in c.seen.items()}
    verdicts = tuple(v for k, table in enumerate(source.content.verdicts) for v in _judge(source, table, k, done, used, notice))
    return Campaign(source.content.title, done, verdicts, keys, source.content.note)


def _told(notice: Notice | None, name: str) -> Callable[[int, float], None] | None:
    return None if notice is None else lambda count, rms: notice(name, count, rms)


def _request(source: CampaignSource, stage: StageTable, k: int, done: Mapping[str, Calibration]) -> Request:
    """Return what a stage asks, with what it inherits laid under the parent's own [set]."""
    where = source.where(f"stages.{k}")
    model = source.model(stage.model, where)
    handed: list[FittedValues] = []
    told: dict[str, Calibration] = {}
    bias_priors: dict[str, tuple[float, float]] = {}
    seen: dict[str, str] = {}
    remarks: list[str] = []
    for part, inherit in stage.inherit.items():
        for name in inherit.stages:
            below = done[name]
            values = below.values.only(inherit.only) if inherit.only else below.values
            part, prefix = model.canonical(part), "" if part == "." else f"{model.canonical(part)}."
            model = _inherited(model, part, values)
            hidden = _shadowed(model, prefix, values)
            remarks += hidden.values()
            seen |= below.seen
            if inherit.as_ == "prior":
                # a second part takes the same values, but what they say of sensors counts once
                values = values.only([p for p in values.parameters if p not in hidden])
                values = values.bare() if name in told else values
                told[name] = below
                handed.append(_prefixed(values, prefix))
            else:
                bias_priors |= {s: (v.value, v.error) for s, v in values.sensors.items()}
                remarks += _held(part, name, values)
    records = tuple(source.bound(n, stage) for n in source.pick(stage.records, where))
    return Request(
        model,
        records,
        tuple(stage.free),
        {"*": scenario_of(stage.scenario, stage.name)},
        {n: LocalSpec.read(t, f"{where}.local.{n}") for n, t in local_of(stage.local).items()},
        record_local={r.name: source.local_of_record(r.name) for r in records},
        priors={p: (t.mean, t.sd) for p, t in stage.priors.items()},
        inherited=tuple(handed),
        bias_priors=bias_priors,
        weights=stage.weights,
        knee=stage.knee,
        untie=stage.untie,
        loss=stage.loss,
        window=literal(stage.window, "s", where),
        name=stage.name,
        remarks=(*remarks, *counted_twice(told, records)),
        seen=seen,
        readings=readings_of(stage.readings),
    )


def _held(part: str, stage: str, values: FittedValues) -> list[str]:
    """Return a remark that values from below are taken as exact, where the stage below did not know them so."""
    unsure = [p for p, v in values.parameters.items() if v.error > 0]
    if not unsure:
        return []
    what = "the model" if part == "." else f"'{part}'"
    return [
        f"{len(unsure)} values of {what} are held as stage '{stage}' found them; the errors here leave theirs out. Hand them on with "
        'as = "prior" to count them.'
    ]


def readings_of(tables: Mapping[str, Any]) -> dict[str, Reading]:
    """Return the readings of a stage or verdict."""
    return {n: Reading(t) if isinstance(t, str) else Reading(t.channel, t.offset) for n, t in tables.items()}


def _plain(tables: Mapping[str, Any]) -> dict[str, Any]:
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
    return model.replace(part, inner.with_values(values, _origin(below)))


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
    return FittedValues(values.stage, items, values.covariance, values.provenance)


def _key(request: Request, below: list[str]) -> str:
    """Return the hash of everything that a stage's result depends on."""
    content = {
        "version": version("thermid"),
        "model": request.model.identity(),
        "records": {
            r.name: [r.origin.sha256, list(r.steps), {n: [c.role, c.target, c.gain, c.noise, c.accuracy] for n, c in r.channels.items()}]
            for r in request.records
        },
        "free": request.free,
        "scenario": request.scenarios,
        "local": repr(sorted(request.local.items())),
        "priors": repr(sorted(request.priors.items())),
        "bias": repr(sorted(request.held_bias.items())),
        "record_local": repr(sorted((n, sorted(t.items())) for n, t in request.record_local.items())),
        "bias priors": repr(sorted(request.bias_priors.items())),
        "how": [request.untie, request.loss, request.knee, request.window, repr(request.options)],
        "readings": repr(sorted(request.readings.items())),
        "weights": sorted(request.weights.items()),
        "inherited": [list(values) for values in request.inherited],
        "below": below,
    }
    return hashlib.sha256(json.dumps(content, sort_keys=True, default=in_full).encode()).hexdigest()


def _judge(
    source: CampaignSource, table: VerdictTable, k: int, done: Mapping[str, Calibration], used: Mapping[str, str], notice: Notice | None
) -> Iterator[Verdict]:
    """Yield one verdict per record of a verdict's pattern."""
    where = source.where(f"verdicts.{k}")
    stage = next(s for s in source.content.stages if s.name == table.model)
    for name in source.pick([table.record], where):
        record = source.bound(name, stage)
        if notice is not None:
            notice(f"verdict on {name}", 0, 0.0)
        try:
            if record.origin.sha256 in used:
                from thermid.errors import IdentificationError

                raise IdentificationError(
                    f"record '{name}' was used by {used[record.origin.sha256]}; a validation needs data that no fit has seen."
                )
            yield validate(
                done[table.model],
                record,
                Criteria.read(table.criteria, where),
                scenario=scenario_of(table.scenario or stage.scenario, table.name or name),
                local=local_of(table.local),
                window=literal(stage.window, "s", where),
                readings=_plain(table.readings if table.readings is not None else stage.readings),
                title=table.name,
            )
        except ThermidError as error:
            raise placed(error, where) from None
