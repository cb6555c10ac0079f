"""The grammar of a qualification plan as pydantic models."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal

from pydantic import ConfigDict, Field

from thermid.base.grammar import Finite, StrictTable, Whole

KINDS = ("thermal cycling", "thermal vacuum", "thermal balance", "humidity", "transport", "hold", "ascent", "coast", "on-board", "other")


class DocumentTable(StrictTable):
    """What a report is filed under."""

    number: str = ""
    issue: str = ""
    date: str = ""
    prepared: str = ""
    checked: str = ""
    approved: str = ""


class DifferenceTable(StrictTable):
    """Something that is tested otherwise than it flies."""

    what: str
    effect: str = ""


class ConfigurationTable(StrictTable):
    """The hardware and its model as they are tested and as they fly."""

    as_tested: str = ""
    as_flown: str = ""
    differences: list[DifferenceTable] = []


class SourceTable(StrictTable):
    """The model: a deck with its values file, or a stage of a campaign."""

    deck: str = ""
    values: str = ""
    campaign: str = ""
    stage: str = ""
    data: str = ""
    reasons: dict[str, str] = {}


class HostTable(StrictTable):
    """A macro model whose unit is the model."""

    deck: str
    unit: str = "unit"


class PlanSensorTable(StrictTable):
    """A sensor: where it sits, why there, and how far it can be believed."""

    node: str
    reason: str
    location: str = ""
    accuracy: str = ""
    noise: str = ""
    certificate: str = ""


class MarginTable(StrictTable):
    """What is added to a predicted temperature."""

    policy: str = "SMC-S-016"
    balance_tested: bool = False


class ExclusionTable(StrictTable):
    """Sensors that do not count, with reasons, and how large a part of all they may be."""

    cap: Annotated[float, Field(ge=0.0, le=1.0)] = 0.0
    reasons: dict[str, str] = {}


class ValidityTable(StrictTable):
    """Where the model was calibrated."""

    temperature: list[str] = []
    pressure: list[str] = []
    power: list[str] = []
    gravity: list[str] = []
    orientation: list[str] = []
    basis: str = ""


class LogTable(StrictTable):
    """What was measured, and what a log's columns drive."""

    file: str
    simulated: str = ""
    time: str = ""
    boundaries: dict[str, str] = {}
    loads: dict[str, str] = {}
    start: str = "measured"
    prepare: list[dict[str, Any]] = []


class TestTable(StrictTable):
    """One environmental test, or the experiment on board."""

    name: str
    kind: Literal[KINDS]  # type: ignore[valid-type]
    purpose: str = ""
    state: Literal["planned", "run", "closed", "waived"] = "planned"
    service: bool = False
    profile: dict[str, Any] | None = None
    scenario: str | dict[str, Any] | None = None
    host: str = ""
    chamber: str | list[str] = []
    base: str = ""
    watch: list[str] = []
    equipment: list[str] | None = None
    operating: bool = True
    every: str = "2 [min]"
    sensors: list[str] = []
    criteria: list[str] = []
    weights: dict[str, float] = {}
    steady: list[list[str]] = []
    stable: str = "3 C/h"
    spread: dict[str, str | dict[str, str | float]] = {}
    heaters: dict[str, str] = {}
    gravity: str = ""
    orientation: str = ""
    log: LogTable | None = None
    deviations: list[str] = []
    heat_leaks: list[str] = []
    date: str = ""
    note: str = ""


class PlanFile(StrictTable):
    """A qualification plan."""

    title: str
    use: str = ""
    note: str = ""
    objectives: list[str] = []
    success: list[str] = []
    document: DocumentTable = DocumentTable()
    configuration: ConfigurationTable = ConfigurationTable()
    model: SourceTable
    hosts: dict[str, HostTable] = {}
    limits: str | dict[str, dict[str, Any]] = {}
    margins: MarginTable = MarginTable()
    sensors: dict[str, PlanSensorTable] = {}
    criteria: dict[str, dict[str, Any]] = {}
    exclusions: ExclusionTable = ExclusionTable()
    validity: ValidityTable = ValidityTable()
    discrepancies: list[str] = []
    tests: list[TestTable] = []


class LockTable(StrictTable):
    """What was planned on a day."""

    sha256: str
    date: str
    planned: dict[str, Any]
    predictions: dict[str, Any] = {}
    looked_beside: list[str] = []


class LookedTable(StrictTable):
    """A look at the log of a test."""

    test: str
    sha256: str
    date: str
    locks_before: Annotated[Whole, Field(ge=0)]


class LockFile(StrictTable):
    """The locks of a plan and the looks at its logs."""

    lead: ClassVar[str] = "it is no lock of a plan any more. Take it from the version control; a new one would forget the looks."

    format: Literal[1] = Field(1, alias="schema")
    locks: list[LockTable]
    looks: list[LookedTable]


class MetTable(StrictTable):
    """What must come out in one scenario."""

    model_config = ConfigDict(extra="allow")

    times: list[Finite] = Field(alias="times_s")
    temperatures: dict[str, list[Finite]] = Field(alias="temperatures_C")


class ChecksFile(StrictTable):
    """What a delivery holds and must give; further keys are for its reader."""

    lead: ClassVar[str] = "this is not a delivery."
    model_config = ConfigDict(extra="allow")

    files: dict[str, str]
    runs: dict[str, MetTable]
    reference_points: list[str]
