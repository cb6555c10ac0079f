"""`Study`: the four steps of a methodology on record - knowledge and use, box colours, set-ups, procedure - and what was found."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from thermid.arguments import takes_objects
from thermid.campaign.stages import Campaign
from thermid.errors import NameNotFoundError, nearest
from thermid.files import STUDY, write_text
from thermid.fit.problem.residuals import SensorTrace
from thermid.judge.metrics import Residuals, metric
from thermid.model.tree.boxes import node_boxes, part_boxes
from thermid.model.tree.model import Model
from thermid.physics.constants import ICE_POINT
from thermid.simulation.solution import Solution
from thermid.simulation.solver.problem import Options


@dataclass(frozen=True)
class Component:
    """A physical item of the subject.

    Parameters
    ----------
    at : str                        Path of its submodel or node in the model of the whole.
    what : str                      What it is.
    lowest, highest : float or None Limits at its reference points. [K]
    basis : str                     What the limits rest on.
    """

    at: str
    what: str = ""
    lowest: float | None = None
    highest: float | None = None
    basis: str = ""

    def holds(self, path: str) -> bool:
        """Whether a node belongs to it."""
        return path == self.at or path.startswith(f"{self.at}.")


@dataclass(frozen=True)
class SensorSpec:
    """What a kind of sensor is said to do.

    Parameters
    ----------
    accuracy : float        Largest error. [K]
    resolution : float      Step of its readings; 0 where none is given. [K]
    range : tuple           Lowest and highest temperature, empty where none is given. [K]
    conversion : float      Time from the instant of a value to its reading. [s]
    certificate : str       How it was calibrated.
    channels : tuple of str Patterns of the channels of the campaign that it stands behind.
    basis : str             Where this is said.
    """

    accuracy: float
    resolution: float = 0.0
    range: tuple[float, ...] = ()
    conversion: float = 0.0
    certificate: str = ""
    channels: tuple[str, ...] = ()
    basis: str = ""


@dataclass(frozen=True)
class Action:
    """One action of the procedure: its name, its state, the stages that do it, a note."""

    name: str
    state: str
    stages: tuple[str, ...] = ()
    note: str = ""


@dataclass(frozen=True, eq=False)
class Step:
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
class Study:
    """What a study is about and how it is done, in four steps.

    Parameters
    ----------
    title, document, note : str     What it is called, what it follows, what its author says.
    subject, use : str              Step 1: what is modelled, and the intended use of the model.
    facts : tuple of str            Step 1: what is known beforehand.
    components : dict               Step 1: physical item -> Component.
    model : Model                   The model of the whole.
    names : tuple of str            Other names of the whole.
    reason : str                    Step 2: why the box colours are what they are.
    solver : str                    Step 3: what solves the equations.
    options : Options               Step 3: its tolerances.
    theory, experiment : tuple      Step 3: remarks on both set-ups.
    sensors : dict                  Step 3: kind of sensor -> SensorSpec.
    campaign : Path                 Step 4: the campaign file.
    rules, metrics : tuple of str   Step 4.
    actions : tuple of Action       Step 4: in order.
    """

    title: str
    document: str
    note: str
    subject: str
    use: str
    facts: tuple[str, ...]
    components: Mapping[str, Component]
    model: Model
    names: tuple[str, ...]
    reason: str
    solver: str
    options: Options
    theory: tuple[str, ...]
    experiment: tuple[str, ...]
    sensors: Mapping[str, SensorSpec]
    campaign: Path = field(compare=False)
    rules: tuple[str, ...]
    metrics: tuple[str, ...]
    actions: tuple[Action, ...]
    _data: Mapping[str, Any] = field(compare=False, repr=False)

    @property
    def boxes(self) -> dict[str, str]:
        """Node -> box colour of the part that it belongs to."""
        return node_boxes(self.model)

    @property
    def part_boxes(self) -> dict[str, str]:
        """Submodel -> its box colour with those of everything in it; the empty path is the whole."""
        return part_boxes(self.model)

    def find(self, name: str) -> str:
        """Return the path of a submodel or node by any of its names: a component, an alias, with or without a name of the whole before it.

        The whole itself is the empty path.

        Raises
        ------
        NameNotFoundError   With the nearest name.
        """
        if name in (self.model.title, *self.names):
            return ""
        if name in self.components:
            return self.components[name].at
        known = {*self.part_boxes, *self.boxes} - {""}
        heads = sorted({self.model.title, *self.names}, key=len, reverse=True)
        for text in (name, *(name[len(h) + 1 :] for h in heads if name.startswith((f"{h}.", f"{h}_")))):
            path = self.model.canonical(text)
            if path in known:
                return path
        raise NameNotFoundError(f"nothing is called '{name}'.{nearest(name, [*known, *self.components, *self.model.aliases])}", self.title)

    @takes_objects
    def log(self, campaign: Campaign) -> tuple[Step, ...]:
        """Return what every stage and every verdict found, sensor by sensor."""
        action = {stage: a.name for a in self.actions for stage in a.stages}
        steps = [_step(action.get(stage, ""), stage, block) for stage, c in campaign.stages.items() for block in c.blocks]
        steps += [_step(action.get(v.model, ""), v.model, block, True) for v in campaign.verdicts for block in v.blocks]
        return tuple(steps)

    @takes_objects
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

        return write_text(path, tomlkit.dumps(dict(self._data)), STUDY)


def _reference_points(model: Model, prefix: str = "") -> list[tuple[str, Any]]:
    own = [(prefix + n, node) for n, node in model.nodes.items() if node.reference_point]
    return own + [found for name, part in model.submodels.items() for found in _reference_points(part.model, f"{prefix}{name}.")]


def _passed(name: str, component: Component, solution: Solution, node: str) -> list[Exceeded]:
    trace = solution[node]
    out = []
    for limit, sign in ((component.highest, 1.0), (component.lowest, -1.0)):
        if limit is None:
            continue
        celsius = limit - ICE_POINT
        time = trace.crossing(celsius, below=sign < 0.0)
        if time is not None:
            out.append(Exceeded(name, node, celsius, trace.highest if sign > 0.0 else trace.lowest, time))
    return out


def _step(action: str, stage: str, block: SensorTrace, held_out: bool = False) -> Step:
    return Step(action, stage, block.record, block.sensor, Residuals.of(block.times, block.residuals), held_out)
