"""The grammar of a study file as pydantic models."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from thermid.grammar import StrictTable


class KnowledgeTable(StrictTable):
    """Step 1: what is modelled, what for, and what is known of it."""

    subject: str = ""
    use: str = ""
    model: str
    names: list[str] = []
    facts: list[str] = []


class ComponentTable(StrictTable):
    """A physical item: where it stands in the model, and the limits at its reference point."""

    at: str
    what: str = ""
    lowest: str = ""
    highest: str = ""
    basis: str = ""


class BoxTable(StrictTable):
    """Step 2: why the parts have the box colours that their decks say."""

    reason: str = ""


class TheoryTable(StrictTable):
    """Step 3, theory: what solves the equations, and how closely."""

    solver: str = ""
    tolerance: str = "2e-7 [K]"
    relative: Annotated[float, Field(gt=0.0)] = 2e-8
    notes: list[str] = []


class ExperimentTable(StrictTable):
    """Step 3, experiment: the bench."""

    platform: str = ""
    notes: list[str] = []


class SensorTable(StrictTable):
    """Step 3, experiment: what a kind of sensor is said to do."""

    accuracy: str
    resolution: str = ""
    range: list[str] = []
    conversion: str = ""
    certificate: str = ""
    channels: list[str]
    basis: str = ""


class ProcedureTable(StrictTable):
    """Step 4: the campaign, its rules and its metrics."""

    campaign: str
    rules: list[str] = []
    metrics: list[str] = ["rmse", "max_error", "final_error"]


class ActionTable(StrictTable):
    """One action of the procedure, with the stages of the campaign that do it."""

    name: str
    state: Literal["done", "with qualification", "open"] = "open"
    stages: list[str] = []
    note: str = ""


class StudyFile(StrictTable):
    """The four steps of a study."""

    title: str
    document: str = ""
    note: str = ""
    knowledge: KnowledgeTable
    components: dict[str, ComponentTable] = {}
    box: BoxTable = BoxTable()
    theory: TheoryTable = TheoryTable()
    experiment: ExperimentTable = ExperimentTable()
    sensors: dict[str, SensorTable] = {}
    procedure: ProcedureTable
    actions: list[ActionTable] = []
