"""A study file read: components, sensors, set-ups and the campaign that belongs to them."""

from __future__ import annotations

import fnmatch
import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from thermid.arguments import takes_objects
from thermid.campaign.file import read_campaign
from thermid.campaign.study.study import Action, Component, SensorSpec, Study
from thermid.errors import DeckError, NameNotFoundError, nearest
from thermid.judge.metrics import metric
from thermid.model.deck.modelfile import load_model
from thermid.model.laws.signal import literal
from thermid.model.tree.boxes import part_boxes
from thermid.model.tree.model import Model
from thermid.model.tree.tree import Names
from thermid.simulation.solver.problem import Options
from thermid.toml_files import Places, read_toml, resolve_inside
from thermid.units import TEMPERATURE

if TYPE_CHECKING:
    from thermid.campaign.study.schema import ComponentTable, SensorTable, StudyFile


@takes_objects
def load_study(path: str | os.PathLike[str]) -> Study:
    """Return the study that a file describes, with the model it names; its campaign is checked, not run.

    Raises
    ------
    DeckError           When it has no intended use or no components, a part of the model belongs to no component, an action names no stage,
                        or a channel has no sensor behind it.
    NameNotFoundError   When a component is not in the model.
    """
    from thermid.campaign.study.schema import StudyFile

    target = Path(path)
    data, lines = read_toml(target)
    where = Places(target.name, lines)
    content = StudyFile.from_file(data, where)
    if not content.knowledge.use.strip():
        raise DeckError("a study needs the intended use of its model; it decides the box colours and the criteria.", where("knowledge.use"))
    if not content.components:
        raise DeckError("a study needs its components: the physical items, each with its place in the model.", where("components"))
    model = load_model(resolve_inside(target.parent, content.knowledge.model, where("knowledge.model")))
    components = {name: _component(model, name, table, where(f"components.{name}")) for name, table in content.components.items()}
    _all_belong(model, components, where("components"))
    sensors = {name: _sensor(table, where(f"sensors.{name}")) for name, table in content.sensors.items()}
    for k, key in enumerate(content.procedure.metrics):
        metric(key, where(f"procedure.metrics.{k}"))
    campaign = resolve_inside(target.parent, content.procedure.campaign, where("procedure.campaign"))
    _campaign_fits(campaign, content, where)
    theory = content.theory
    return Study(
        content.title,
        content.document,
        content.note,
        content.knowledge.subject,
        content.knowledge.use,
        tuple(content.knowledge.facts),
        components,
        model,
        tuple(content.knowledge.names),
        content.box.reason,
        theory.solver,
        Options(tolerance=literal(theory.tolerance, "K", where("theory.tolerance")), relative=theory.relative),
        tuple(theory.notes),
        (*([content.experiment.platform] if content.experiment.platform else []), *content.experiment.notes),
        sensors,
        campaign,
        tuple(content.procedure.rules),
        tuple(content.procedure.metrics),
        tuple(Action(a.name, a.state, tuple(a.stages), a.note) for a in content.actions),
        data,
    )


def _component(model: Model, name: str, table: ComponentTable, where: str) -> Component:
    path = model.canonical(table.at)
    known = {*part_boxes(model), *Names(model).nodes} - {""}
    if path not in known:
        raise NameNotFoundError(f"'{name}' stands at '{table.at}', which the model does not have.{nearest(table.at, known)}", where)
    low, high = (literal(t, TEMPERATURE, where) if t else None for t in (table.lowest, table.highest))
    return Component(path, table.what, low, high, table.basis)


def _all_belong(model: Model, components: Mapping[str, Component], where: str) -> None:
    """Refuse a mass of the model that is part of no component, or of two."""
    for path, (owner, name) in Names(model).nodes.items():
        if not name or not owner.nodes[name].fields:
            continue
        holders = [n for n, c in components.items() if c.holds(path)]
        if len(holders) != 1:
            said = f"belongs to {' and '.join(holders)}" if holders else "belongs to no component"
            raise DeckError(f"node '{path}' of the model {said}. Give every mass one physical item.", where)


def _sensor(table: SensorTable, where: str) -> SensorSpec:
    def kelvin(text: str) -> float:
        return literal(text, "K", where) if text else 0.0

    return SensorSpec(
        kelvin(table.accuracy),
        kelvin(table.resolution),
        tuple(literal(t, TEMPERATURE, where) for t in table.range),
        literal(table.conversion, "s", where) if table.conversion else 0.0,
        table.certificate,
        tuple(table.channels),
        table.basis,
    )


def _campaign_fits(campaign: Path, content: StudyFile, where: Any) -> None:
    """Refuse an action that names no stage, and a temperature channel without a sensor behind it."""
    asked = read_campaign(campaign).content
    stages = [s.name for s in asked.stages]
    for k, action in enumerate(content.actions):
        for stage in action.stages:
            if stage not in stages:
                raise DeckError(
                    f"'{action.name}' names stage '{stage}', which {campaign.name} does not have.{nearest(stage, stages)}",
                    where(f"actions.{k}.stages"),
                )
    patterns = [p for table in content.sensors.values() for p in table.channels]
    for name, record in asked.records.items():
        for channel, target in record.channels.items():
            thermometer = isinstance(target, Mapping) and bool({"node", "boundary"} & set(target))
            if thermometer and not any(fnmatch.fnmatchcase(channel, p) for p in patterns):
                raise DeckError(
                    f"channel '{channel}' of record '{name}' has no sensor behind it. Add it to the channels of one.", where("sensors")
                )
