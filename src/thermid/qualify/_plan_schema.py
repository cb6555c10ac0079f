"""The grammar of a qualification plan as pydantic models."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal

from pydantic import ConfigDict, Field

from thermid.base.grammar import Finite, StrictTable, Whole

KINDS = ("thermal cycling", "thermal vacuum", "thermal balance", "humidity", "transport", "hold", "ascent", "coast", "on-board", "other")


class DocumentTable(StrictTable):
    """Number, issue, date and names under which a report is filed."""

    number: str = ""
    issue: str = ""
    date: str = ""
    prepared: str = ""
    checked: str = ""
    approved: str = ""


class DifferenceTable(StrictTable):
    """A difference between the tested and the flown hardware, and its effect."""

    what: str
    effect: str = ""


class ConfigurationTable(StrictTable):
    """The hardware and its model as tested and as flown, and their differences."""

    as_tested: str = ""
    as_flown: str = ""
    differences: list[DifferenceTable] = []


class SourceTable(StrictTable):
    """Where the model comes from: a deck with its values file, or a stage of a campaign."""

    deck: str = ""
    values: str = ""
    campaign: str = ""
    stage: str = ""
    data: str = ""
    reasons: dict[str, str] = {}


class HostTable(StrictTable):
    """A macro model (`deck`) whose submodel `unit` is replaced by the model."""

    deck: str
    unit: str = "unit"


class PlanSensorTable(StrictTable):
    """A sensor: its node, the reason for its place, accuracy, noise and certificate."""

    node: str
    reason: str
    location: str = ""
    accuracy: str = ""
    noise: str = ""
    certificate: str = ""


class MarginTable(StrictTable):
    """The margin policy, and whether the model was correlated in a thermal balance test."""

    policy: str = "SMC-S-016"
    balance_tested: bool = False


class ExclusionTable(StrictTable):
    """Sensors that do not count, each with a reason, and the largest share of all sensors that they may be."""

    cap: Annotated[float, Field(ge=0.0, le=1.0)] = 0.0
    reasons: dict[str, str] = {}


class ValidityTable(StrictTable):
    """Conditions under which the model was calibrated: ranges as [lowest, highest], and orientations."""

    temperature: list[str] = []
    pressure: list[str] = []
    power: list[str] = []
    gravity: list[str] = []
    orientation: list[str] = []
    basis: str = ""


class LogTable(StrictTable):
    """The log of a test: its file, and which boundaries and loads its columns drive."""

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

    @property
    def state_without_loads(self) -> str:
        """State of reference points whose limits name no loads: operating or non-operating."""
        return "operating" if self.operating else "non-operating"


class PlanFile(StrictTable):
    """A qualification plan, the whole file."""

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
    """One lock: the hash and the content of the plan on a day."""

    sha256: str
    date: str
    planned: dict[str, Any]
    predictions: dict[str, Any] = {}
    looked_beside: list[str] = []


class LookedTable(StrictTable):
    """A note that the log of a test was read, and how many locks there were then."""

    test: str
    sha256: str
    date: str
    locks_before: Annotated[Whole, Field(ge=0)]


class LockFile(StrictTable):
    """All locks of a plan, and all looks at its logs."""

    lead: ClassVar[str] = "it is no lock of a plan any more. Take it from the version control; a new one would forget the looks."

    format: Literal[1] = Field(1, alias="schema")
    locks: list[LockTable]
    looks: list[LookedTable]


class MetTable(StrictTable):
    """Temperatures of a delivered scenario that a run must give again. [s, degC]"""

    model_config = ConfigDict(extra="allow")

    times: list[Finite] = Field(alias="times_s")
    temperatures: dict[str, list[Finite]] = Field(alias="temperatures_C")


class ChecksFile(StrictTable):
    """``checks.json`` of a delivery: hashes, runs and reference points; further keys are for people."""

    lead: ClassVar[str] = "this is not a delivery."
    model_config = ConfigDict(extra="allow")

    files: dict[str, str]
    runs: dict[str, MetTable]
    reference_points: list[str]
