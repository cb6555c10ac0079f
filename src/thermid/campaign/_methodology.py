"""`Study`: the four steps of a methodology on record - knowledge and use, box colours, set-ups, procedure - and what was found."""

from __future__ import annotations

import fnmatch
import os
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from thermid.base.errors import DeckError, NameNotFoundError, nearest, refuse_unknown
from thermid.base.files import FileKinds, Places, by_grammar, read_toml, resolve_inside
from thermid.base.results import Shown
from thermid.base.units import ICE_POINT, Kelvin
from thermid.campaign._file import CampaignSource
from thermid.campaign._judge.verdict import Residuals, metric
from thermid.campaign._stages import Campaign
from thermid.campaign._study_items import Component
from thermid.fit.calibration import SensorTrace
from thermid.model.tree import Model, Names, literal, load_model
from thermid.simulation.runs import Options, Solution

if TYPE_CHECKING:
    from thermid.campaign._schema import StudyFile


@dataclass(frozen=True, eq=False)
class LogEntry:
    """One line of the log: how one sensor was met in one record of one stage or verdict.

    Parameters
    ----------
    action : str                            The action that the stage belongs to.
    stage, record, sensor : str
    residuals : Residuals                   Measured less simulated, the sensor's constant error taken off. [K]
    held_out : bool                         Whether no stage has seen the record.
    """

    action: str
    stage: str
    record: str
    sensor: str
    residuals: Residuals
    held_out: bool = False

    def __getitem__(self, key: str) -> float:
        """A metric of the residuals, by its key or an alias. [K]"""
        return metric(key).of(self.residuals)


@dataclass(frozen=True)
class Exceeded:
    """A limit that a run passes.

    Parameters
    ----------
    component, node : str       Whose limit, and where.
    limit, reached : float      The limit, and the farthest temperature beyond it. [degC]
    time : float                When it is passed first. [s]
    """

    component: str
    node: str
    limit: float
    reached: float
    time: float


@dataclass(frozen=True)
class Study(Shown):
    """What a study is about and how it is done, in four steps.

    Parameters
    ----------
    title : str             What it is called.
    content : StudyFile     Its tables and keys, checked by the grammar.
    model : Model           The model of the whole.
    components : dict       Physical item -> Component, each at the path of its place.
    options : Options       The error of its runs.
    campaign : Path         The campaign file.
    """

    title: str
    content: StudyFile = field(repr=False)
    model: Model
    components: Mapping[str, Component]
    options: Options
    campaign: Path = field(compare=False)
    _data: Mapping[str, Any] = field(compare=False, repr=False)

    def find(self, name: str) -> str:
        """Return the path of a submodel or node by any of its names: a component, an alias, with or without a name of the whole before it.

        The whole itself is the empty path.

        Raises
        ------
        NameNotFoundError   With the nearest name.
        """
        heads = sorted({self.model.title, *self.content.knowledge.names}, key=len, reverse=True)
        if name in heads:
            return ""
        if name in self.components:
            return self.components[name].at
        places = {*self.model.part_boxes, *self.model.node_boxes} - {""}
        for text in (name, *(name[len(h) + 1 :] for h in heads if name.startswith((f"{h}.", f"{h}_")))):
            path = self.model.canonical(text)
            if path in places:
                return path
        raise NameNotFoundError(
            f"there is no '{name}' in the model.{nearest(name, [*places, *self.components, *self.model.aliases])}", self.title
        )

    def log(self, campaign: Campaign) -> tuple[LogEntry, ...]:
        """Return what every stage and every verdict found, sensor by sensor."""
        action = {stage: a.name for a in self.content.actions for stage in a.stages}
        steps = [_entry(action.get(stage, ""), stage, block) for stage, c in campaign.stages.items() for block in c.blocks]
        steps += [_entry(action.get(v.model, ""), v.model, block, True) for v in campaign.verdicts for block in v.blocks]
        return tuple(steps)

    def exceeded(self, solution: Solution, at: str = "") -> tuple[Exceeded, ...]:
        """Return the limits of components that a run passes, each with the time.

        Parameters
        ----------
        solution : Solution     Of the whole, or of one of its parts.
        at : str                Where that part stands in the whole.
        """
        prefix = f"{self.model.canonical(at)}." if at else ""
        points = {n for n, node in _reference_points(self.model)}
        out = []
        for name, c in self.components.items():
            for path in (n for n in points if c.holds(n) and n.startswith(prefix) and n.removeprefix(prefix) in solution.nodes):
                out += _passed(name, c, solution, path.removeprefix(prefix))
        return tuple(sorted(out, key=lambda e: e.time))

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the study as a file and return its path; put it beside the campaign and decks that it names."""
        import tomlkit

        return FileKinds.STUDY.save_text(path, tomlkit.dumps(dict(self._data)))


def _reference_points(model: Model, prefix: str = "") -> list[tuple[str, Any]]:
    """Return path and node of every reference point, those of parts below their prefix."""
    points = [(prefix + n, node) for n, node in model.nodes.items() if node.reference_point]
    return points + [point for name, part in model.submodels.items() for point in _reference_points(part.model, f"{prefix}{name}.")]


def _passed(name: str, component: Component, solution: Solution, node: str) -> list[Exceeded]:
    """Return each limit that a node passes in a run, with its extreme [degC] and the time of crossing [s]."""
    trace = solution[node]
    out = []
    for limit, sign in ((component.highest, 1.0), (component.lowest, -1.0)):
        if limit is None:
            continue
        celsius = limit - ICE_POINT
        time = trace.crossing(Kelvin(limit), below=sign < 0.0)
        if time is not None:
            out.append(Exceeded(name, node, celsius, trace.highest if sign > 0.0 else trace.lowest, time))
    return out


def _entry(action: str, stage: str, block: SensorTrace, held_out: bool = False) -> LogEntry:
    """Return a line of the step log: the residuals of one sensor in one record."""
    return LogEntry(action, stage, block.record, block.sensor, Residuals.equally_weighted(block.times, block.residuals), held_out)


def load_study(path: str | os.PathLike[str]) -> Study:
    """Return the study that a file describes, with the model it names; its campaign is checked, not run.

    Raises
    ------
    DeckError           When it has no intended use or no components, a part of the model belongs to no component, an action names no stage,
                        or a channel has no sensor behind it.
    NameNotFoundError   When a component is not in the model.
    """
    target = Path(path)
    data, lines = read_toml(target)

    where = Places(target.name, lines)
    content: StudyFile = by_grammar("thermid.campaign._schema.StudyFile", data, where)
    for k, key in enumerate(content.procedure.metrics):
        metric(key, where(f"procedure.metrics.{k}"))
    if not content.knowledge.use.strip():
        raise DeckError(
            "the intended use of the model is missing. It decides the box colours and the criteria; give it under [knowledge].",
            where("knowledge.use"),
            code="value.incomplete",
        )
    if not content.components:
        raise DeckError(
            "the components are missing. List the physical items, each with its place in the model.",
            where("components"),
            code="value.incomplete",
        )
    model = load_model(resolve_inside(target.parent, content.knowledge.model, where("knowledge.model")))
    components = {name: _placed(model, name, c, where(f"components.{name}")) for name, c in content.components.items()}
    _all_belong(model, components, where("components"))
    campaign = resolve_inside(target.parent, content.procedure.campaign, where("procedure.campaign"))
    _campaign_fits(campaign, content, where)
    return Study(
        content.title,
        content,
        model,
        components,
        Options(error=literal(content.theory.error, "K", where("theory.error"))),
        campaign,
        data,
    )


def _placed(model: Model, name: str, component: Component, where: str) -> Component:
    """Return a component of a study at the path of its place; one that the model does not have is refused."""
    path = model.canonical(component.at)
    places = {*model.part_boxes, *Names(model).nodes} - {""}
    refuse_unknown([path], places, where, f"'{name}' has the place '{component.at}', which the model does not have.", NameNotFoundError)
    return replace(component, at=path)


def _all_belong(model: Model, components: Mapping[str, Component], where: str) -> None:
    """Refuse a mass of the model that is part of no component, or of two."""
    for path, (owner, name) in Names(model).nodes.items():
        if not name or not owner.nodes[name].fields:
            continue
        holders = [n for n, c in components.items() if c.holds(path)]
        if len(holders) != 1:
            complaint = f"belongs to {' and '.join(holders)}" if holders else "belongs to no component"
            raise DeckError(f"node '{path}' of the model {complaint}. Assign every mass to one component.", where, code="campaign.refused")


def _campaign_fits(campaign: Path, content: StudyFile, where: Any) -> None:
    """Refuse an action that names no stage, and a temperature channel without a sensor behind it."""
    content_of_campaign = CampaignSource.read(campaign).content
    stages = [s.name for s in content_of_campaign.stages]
    for k, action in enumerate(content.actions):
        refuse_unknown(
            action.stages,
            stages,
            where(f"actions.{k}.stages"),
            f"'{action.name}' names stage '{{}}', which {campaign.name} does not have.",
            DeckError,
        )
    patterns = [p for sensor in content.sensors.values() for p in sensor.channels]
    for name, record in content_of_campaign.records.items():
        for channel, target in record.channels.items():
            thermometer = isinstance(target, Mapping) and bool({"node", "boundary"} & set(target))
            if thermometer and not any(fnmatch.fnmatchcase(channel, p) for p in patterns):
                raise DeckError(
                    f"channel '{channel}' of record '{name}' belongs to no sensor of the study. Add it to the channels of one.",
                    where("sensors"),
                    code="name.unknown",
                )
