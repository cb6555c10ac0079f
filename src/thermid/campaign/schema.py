"""The grammar of a campaign file as pydantic models."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, WithJsonSchema

from thermid.grammar import StrictTable
from thermid.measure.readers.bindings import channel_schema


class LocalTable(StrictTable):
    """A value that each record has for itself."""

    start: str
    sd: str | None = None


class JoinedTable(StrictTable):
    """Another log of the same test, on a clock of its own; pairs are ranges in which the fit finds offset and rate."""

    record: str
    offset: str | tuple[str, str] = "0 [s]"
    rate: float | tuple[float, float] = 1.0


class RecordTable(StrictTable):
    """A log, or a pattern of logs, with what its columns are."""

    file: str | None = None
    files: str | list[str] | None = None
    time: str | None = None
    channels: dict[str, str | Annotated[dict[str, Any], WithJsonSchema(channel_schema())]]
    prepare: list[dict[str, Any]] = []
    joined: JoinedTable | None = None
    local: dict[str, LocalTable] = {}
    separator: str | None = None
    decimal: str | None = None
    clock: str | None = None
    units: dict[str, str] = {}
    get: str = ""


class ScenarioTable(StrictTable):
    """What the logs do not say."""

    boundaries: dict[str, Any] = {}
    loads: dict[str, Any] = {}
    commands: dict[str, Any] = {}
    gains: dict[str, str] = {}
    schedule: dict[str, Any] = {}
    prescribed: dict[str, Any] = {}
    start: str = ""
    initial: dict[str, str] = {}


class ReadingTable(StrictTable):
    """A channel whose first reading stands for a temperature, and a parameter [K] that is added to it."""

    channel: str
    offset: str = ""


class InheritTable(StrictTable):
    """Values of a stage below, at every depth, handed to a submodel; ``fixed`` or with their covariance as ``prior``."""

    stage: str | list[str]
    as_: Literal["fixed", "prior"] = Field("fixed", alias="as")
    only: list[str] = []
    without: list[str] = []
    move: list[str] = []

    @property
    def stages(self) -> list[str]:
        """The stages whose values are handed on."""
        return [self.stage] if isinstance(self.stage, str) else self.stage


class PriorTable(StrictTable):
    """A normal prior."""

    mean: str = ""
    sd: str


class SteadyTable(StrictTable):
    """A settled stretch of a log, fitted as a steady point."""

    record: str
    start: str = "start"
    end: str = "end"
    tau: str | None = None
    limit: str = "1 [K/h]"


class StageTable(StrictTable):
    """One level of aggregation."""

    name: str
    model: str
    records: list[str] = []
    values: str = ""
    steady: dict[str, SteadyTable] = {}
    free: list[str] = []
    freeze: list[str] = []
    bind: dict[str, str | dict[str, str]] = {}
    ignore: list[str] = []
    local: dict[str, LocalTable] = {}
    inherit: dict[str, InheritTable] = {}
    priors: dict[str, PriorTable | Literal["range"]] = {}
    scenario: ScenarioTable = ScenarioTable()
    readings: dict[str, str | ReadingTable] = {}
    weights: dict[str, float] = {}
    loss: Literal["linear", "soft_l1", "huber", "cauchy"] = "linear"
    knee: float = Field(1.0, gt=0.0)
    search: Literal["auto", "local", "multistart", "differential evolution", "cma"] = "auto"
    untie: bool | list[str] = False
    window: str = "0 [s]"
    adequate: str = ""
    note: str = ""


class VerdictTable(StrictTable):
    """A judgement of a stage on a record that no stage used."""

    name: str = ""
    model: str
    record: str
    criteria: dict[str, Any]
    local: dict[str, LocalTable] = {}
    scenario: ScenarioTable | None = None
    readings: dict[str, str | ReadingTable] | None = None
    values: Literal["stage", "joint"] = "stage"


class JointTable(StrictTable):
    """A last fit over the records of all levels at once."""

    stages: list[str] = []
    freeze: list[str] = []
    priors: dict[str, PriorTable] = {}
    loss: Literal["linear", "soft_l1", "huber", "cauchy"] | None = None
    knee: float | None = Field(None, gt=0.0)
    note: str = ""


class CampaignFile(StrictTable):
    """What is asked of the data."""

    title: str
    use: str = ""
    note: str = ""
    checksums: dict[str, str] = {}
    records: dict[str, RecordTable]
    stages: list[StageTable]
    joint: JointTable | None = None
    verdicts: list[VerdictTable] = []
    accept: list[str] = []

    @property
    def joint_table(self) -> JointTable:
        """What is said of a joint fit; nothing where the campaign has no such table."""
        return self.joint or JointTable.model_validate({})


def json_schema() -> dict[str, Any]:
    """Return the JSON Schema of a campaign, for editors."""
    return CampaignFile.model_json_schema()
