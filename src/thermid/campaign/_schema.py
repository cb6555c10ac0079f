"""The grammar of campaign files and study files as pydantic models; loaded when a file is read: pydantic takes a tenth of a second."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal, TypeAlias

from pydantic import Field, WithJsonSchema

from thermid.base.grammar import Amount, SineTable, StrictTable, TimesTable, in_form, reads, table_of
from thermid.base.units import TEMPERATURE
from thermid.campaign._study_items import Component, ProcedureAction, SensorSpec
from thermid.measure.readers import channel_schema
from thermid.model.tree import literal
from thermid.simulation.grammars import GasTable

CourseField: TypeAlias = Annotated[Any, in_form(Amount, (SineTable, ("mean", "amplitude")), (TimesTable, ()))]
"""What may change with time, as `thermid.model._laws.signal.signal` reads it."""


class LocalTable(StrictTable):
    """A value that each record has for itself."""

    start: str
    sd: str | None = None


class JoinedTable(StrictTable):
    """Another log of the same test, on a clock of its own; pairs are ranges in which the fit finds offset and rate."""

    record: str
    offset: str | tuple[str, str] | None = None
    rate: float | tuple[float, float] = 1.0


class RecordTable(StrictTable):
    """A log, or a pattern of logs, with what its columns are."""

    file: str | None = None
    files: str | list[str] | None = None
    time: str | None = None
    channels: dict[str, str | Annotated[dict[str, Any], WithJsonSchema(channel_schema())]]
    prepare: list[dict[str, Any]] = []
    joined: JoinedTable | list[JoinedTable] | None = None
    local: dict[str, LocalTable] = {}
    environment: dict[str, GasTable] = {}
    separator: str | None = None
    decimal: str | None = None
    clock: str | None = None
    units: dict[str, str] = {}
    get: str = ""


class ScenarioTable(StrictTable):
    """What the logs do not say."""

    boundaries: dict[str, CourseField] = {}
    loads: dict[str, CourseField] = {}
    commands: dict[str, CourseField] = {}
    gains: dict[str, str] = {}
    schedule: dict[str, CourseField] = {}
    prescribed: dict[str, CourseField] = {}
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


class CourseTable(StrictTable):
    """A power that no log gives, from some time after the beginning of each record: its shape and time are fitted with the stage."""

    into: str
    shape: Literal["auto", "step", "ramp", "decay"] = "auto"
    power: str = "1 [W]"
    begin: str = "0 [s]"


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
    courses: dict[str, CourseTable] = {}
    weights: dict[str, float] = {}
    loss: Literal["linear", "soft_l1", "huber", "cauchy"] = "linear"
    knee: float = Field(1.0, gt=0.0)
    search: Literal["auto", "local", "multistart", "differential evolution"] = "auto"
    untie: bool | list[str] = False
    window: str = "0 [s]"
    adequate: str = ""
    structural_errors: bool = False
    note: str = ""

    def with_spreads(self, spreads: Mapping[str, str]) -> dict[str, PriorTable | Literal["range"]]:
        """Its priors, and one about the deck's value for each path of `spreads`, of that standard deviation."""
        return {**self.priors, **{path: PriorTable(sd=sd) for path, sd in spreads.items()}}


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


class PredictionTable(StrictTable):
    """A scenario to predict with fitted values, and the limits of its nodes."""

    scenario: str
    stage: str = ""
    vacuum: bool = False
    limits: dict[str, tuple[str, str]] = {}


class JointFitTable(StrictTable):
    """A last fit over the records of all levels at once."""

    stages: list[str] = []
    freeze: list[str] = []
    priors: dict[str, PriorTable] = {}
    loss: Literal["linear", "soft_l1", "huber", "cauchy"] | None = None
    knee: float | None = Field(None, gt=0.0)
    note: str = ""


class FleetUnitTable(StrictTable):
    """One unit of a fleet: its records, and what is known of it, numbers or texts."""

    records: list[str]
    covariates: dict[str, float | str] = {}


class FleetTable(StrictTable):
    """Units of one design: the stage that each is asked for itself. Without units, every record of the stage is one."""

    stage: str = ""
    units: dict[str, FleetUnitTable] = {}


class CampaignFile(StrictTable):
    """What is asked of the data."""

    title: str
    use: str = ""
    note: str = ""
    checksums: dict[str, str] = {}
    records: dict[str, RecordTable]
    stages: list[StageTable]
    joint: JointFitTable | None = None
    verdicts: list[VerdictTable] = []
    predictions: dict[str, PredictionTable] = {}
    fleet: FleetTable | None = None
    accept: list[str] = []

    @property
    def joint_table(self) -> JointFitTable:
        """What is said of a joint fit; nothing where the campaign has no such table."""
        return self.joint or JointFitTable.model_validate({})


class KnowledgeTable(StrictTable):
    """Step 1: what is modelled, what for, and what is known of it."""

    subject: str = ""
    use: str = ""
    model: str
    names: list[str] = []
    facts: list[str] = []


class BoxTable(StrictTable):
    """Step 2: why the parts have the box colours that their decks say."""

    reason: str = ""


class TheoryTable(StrictTable):
    """Step 3, theory: what solves the equations, and how closely."""

    solver: str = ""
    error: str = "1e-4 [K]"
    notes: list[str] = []


class ExperimentTable(StrictTable):
    """Step 3, experiment: the bench."""

    platform: str = ""
    notes: list[str] = []


def _in(unit: str, empty: float | None = 0.0) -> Any:
    """Return the form of a number in SI that is written as a text with a unit; an empty text is `empty`."""
    return Annotated[Any, reads(str, lambda text: literal(text, unit) if text else empty)]


_LIMITS = dict.fromkeys(("lowest", "highest"), _in(TEMPERATURE, None))
_SENSOR = {"accuracy": _in("K"), "resolution": _in("K"), "range": list[_in(TEMPERATURE)], "conversion": _in("s")}  # type: ignore[misc]


class ProcedureTable(StrictTable):
    """Step 4: the campaign, its rules and its metrics."""

    campaign: str
    rules: list[str] = []
    metrics: list[str] = ["rmse", "max_error", "final_error"]


class StudyFile(StrictTable):
    """The four steps of a study."""

    title: str
    document: str = ""
    note: str = ""
    knowledge: KnowledgeTable
    components: dict[str, Annotated[Component, table_of(Component, **_LIMITS)]] = {}
    box: BoxTable = BoxTable()
    theory: TheoryTable = TheoryTable()
    experiment: ExperimentTable = ExperimentTable()
    sensors: dict[str, Annotated[SensorSpec, table_of(SensorSpec, **_SENSOR)]] = {}
    procedure: ProcedureTable
    actions: list[Annotated[ProcedureAction, table_of(ProcedureAction)]] = []
