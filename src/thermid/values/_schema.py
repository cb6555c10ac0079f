"""The grammar of the values files that thermid wrote, in both formats, as pydantic models. One written by hand has the rows of a deck."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal, Self, TypeAlias

from pydantic import ConfigDict, Field, model_validator
from pydantic_core import PydanticCustomError

from thermid.base.errors import DeckError
from thermid.base.grammar import Finite, Flag, Real, StrictTable, Whole, reads, table_of
from thermid.base.units import unit
from thermid.model.tree import Dropped, Standing
from thermid.values._store import DISTRIBUTIONS, Distribution, LeftOut, Source, ValueOrigin

LEAD = "this is not a values file of thermid, or it was changed by hand. Run the calibration again, or take the file from version control."
Pair = Annotated[list[Real], Field(min_length=2, max_length=2)]


UnitText = Annotated[str, reads(str, lambda text: unit(text) and text)]
"""The text of a unit as it is written; one that nobody knows raises `UnitError`."""


def _law(table: Any) -> Distribution:
    """Return the distribution of a table such as ``{form = "Normal", mean = 0.0, sd = 1.0}``; a `law` inside it is read in the same way."""
    if not isinstance(table, dict) or not isinstance(table.get("form"), str) or table["form"] not in DISTRIBUTIONS:
        raise DeckError(f"a law has the form {', '.join(DISTRIBUTIONS)}.", code="value.wrong-kind")
    kind: Any = DISTRIBUTIONS[table["form"]]
    wanted, numbers_of_table = set(kind.__dataclass_fields__), {k: v for k, v in table.items() if k != "form"}
    if wanted != set(numbers_of_table):
        raise DeckError(f"a law of form {table['form']} has {', '.join(sorted(wanted)) or 'no numbers'}.", code="value.incomplete")
    numbers: dict[str, Any] = {k: _law(v) if k == "law" else v for k, v in numbers_of_table.items()}
    if any(isinstance(v, bool) or not isinstance(v, int | float) for k, v in numbers.items() if k != "law"):
        raise DeckError(f"a law of form {table['form']} is given by numbers.", code="value.wrong-kind")
    law: Distribution = kind(**numbers)
    return law


Origin: TypeAlias = Annotated[ValueOrigin, table_of(ValueOrigin)]
"""Who gave a value."""


TrustField: TypeAlias = Annotated[Standing, table_of(Standing)]
"""How far a value may be trusted."""


class StateTable(StrictTable):
    """One value with its error and origin."""

    value: Finite
    text: str = ""
    error: Annotated[Real, Field(ge=0.0)]
    error_random: Annotated[Real, Field(ge=0.0)]
    transform: Literal["log", "linear"]
    unit: UnitText
    start: Real
    bounds: Pair
    kind: str
    acts: list[str]
    hidden: list[str]
    at: str
    deck: str
    known: Flag
    origin: Origin
    history: list[Origin]
    standing: TrustField
    prior: Pair | None = None
    of_logs: Flag = False

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        """Refuse a value of zero or below that was fitted by its logarithm."""
        if self.transform == "log" and not self.value > 0.0:
            raise PydanticCustomError("thermid", "a value that was fitted by its logarithm lies above zero.")
        return self


class RootTable(StrictTable):
    """Rows of a root of the covariance: path of a value -> its response to some sources."""

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[str, list[Finite]]

    sources: list[Annotated[Whole, Field(ge=0)]]


class BesideTable(StrictTable):
    """Another sensor's first reading beside the one that a temperature stands on."""

    channel: str
    mean: Real
    slope: Real
    error: Real


class OwnTable(StrictTable):
    """A temperature that each run has for itself."""

    name: str
    start: str
    mean: Real
    sd: Real
    runs: Whole
    beside: list[BesideTable] = []


class SmoothTable(StrictTable):
    """How a conductor may depart from its law."""

    at: Pair
    kind: str
    pivots: list[Pair]
    centre: list[Real]
    thinned: list[Flag]
    outside: Annotated[Real, Field(ge=0.0, le=1.0)] = 0.0


class WayTable(StrictTable):
    """What is known of values and elements if the heat of surfaces is carried in one way."""

    name: str
    weight: Annotated[Real, Field(ge=0.0)]
    laws: dict[str, dict[str, Any]]
    values: dict[str, Real]
    smooth: dict[str, SmoothTable]
    hidden: list[Real]
    nodes: list[str]
    aside: Whole
    columns: list[tuple[str, str, float, str]]
    mean: list[Real]
    root: list[list[Real]]
    sizes: dict[str, Real]
    left: list[tuple[float, float, float]]

    @model_validator(mode="after")
    def _fits(self) -> Self:
        """Refuse a mean without a number for each column, and each value but in older files; and a root whose row k has not k numbers."""
        size = len(self.values) + len(self.columns)
        if len(self.mean) not in (len(self.columns), size) or [len(row) for row in self.root] != list(range(1, size + 1)):
            raise PydanticCustomError("thermid", "the mean and the root of a way have a number for each of its values and columns.")
        return self


class ErrorsTable(StrictTable):
    """The model of error of a fit."""

    at: str
    stage: str
    seen: dict[str, tuple[str, bool, list[tuple[str, float, float]], float, float, float, float]]
    ways: list[WayTable]
    misfit: Real
    spot: str = ""
    why: str
    without: list[str] = []


class StructuralTable(StrictTable):
    """What a fit leaves open of the model's structure."""

    model_config = ConfigDict(extra="allow")  # files of before hold more

    conditions: dict[str, Pair]
    names: list[str]
    surfaces: dict[str, Pair]
    separated: list[str]
    assumed: dict[str, list[Real]] = {}
    of_assumed: dict[str, Pair] = {}
    scheduled: dict[str, Pair] = {}


class MadeTable(StrictTable):
    """Which logs a stage saw, and what it left open; further keys are kept as they are."""

    model_config = ConfigDict(extra="allow")

    version: str = ""
    date: str = ""
    model: str = ""
    records: dict[str, str] = {}
    synthetic: Flag = False
    conditions: dict[str, Pair] = {}
    misfit: dict[str, Real] = {}
    structural: StructuralTable | None = None
    own: list[OwnTable] = []
    errors: ErrorsTable | None = None


class ValuesFile(StrictTable):
    """Everything that a stage knows."""

    lead: ClassVar[str] = LEAD
    model_config = ConfigDict(extra="forbid")

    format: Literal[2] = Field(alias="schema")
    stage: str
    seen: dict[str, str]
    cuts: list[Any]
    dropped: list[Annotated[Dropped, table_of(Dropped)]]
    left_out: list[Annotated[LeftOut, table_of(LeftOut)]]
    provenance: dict[str, MadeTable] = {}
    values: dict[str, StateTable]
    sources: list[Annotated[Source, table_of(Source, law=Annotated[Any, reads(dict[str, Any], _law)])]] = []
    root: list[RootTable] = []

    @model_validator(mode="after")
    def _rows_fit(self) -> Self:
        """Refuse rows of [[root]] of a value that the file lacks, or with another number of sources than they name."""
        for group in self.root:
            for path, row in (group.__pydantic_extra__ or {}).items():
                if path not in self.values or len(row) != len(group.sources) or max(group.sources, default=-1) >= len(self.sources):
                    message = f"the row of '{path}' in [[root]] fits no value or sources."
                    raise PydanticCustomError("thermid", "{message}", {"message": message})
        return self
