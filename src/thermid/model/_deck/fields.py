"""Fields of the tables of a deck: values with bounds, coefficients, properties over a temperature; the base of every element."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Annotated, Any, Final, Literal, Self, TypeAlias

from pydantic import AfterValidator, BaseModel, Field, WrapValidator
from pydantic_core import PydanticCustomError

from thermid.base.errors import DeckError, NameNotFoundError, cap, raising
from thermid.base.grammar import Real, StrictTable, reads
from thermid.model._laws.options import Source
from thermid.model._laws.signal import literal
from thermid.model._laws.stores import SLOPES, TABULATED, Curve, curve, tabulated
from thermid.model._parts.parameter import Parameter
from thermid.model._parts.ranges import RANGES, outside
from thermid.model._tree.arrays import Use
from thermid.model._tree.flat import allows
from thermid.model._tree.model import Model
from thermid.physics.materials import Material

NO_CONVECTION = "0 [W/(m^2 K)]"
PROPERTIES: Final = {"specific_heat": "J/(kg K)", "conductivity": "W/(m K)"}
"""What a material gives to an element, with its unit."""


def plain(text: str | float, field: str, slot: str, where: str = "") -> float:
    """Return the SI value of a field that is a number and no parameter, checked against its slot and its range.

    Raises
    ------
    ThermidError   When it is not a number, of another dimension, or outside its range.
    """
    value, allowed = literal(text, slot, where), RANGES["temperature" if slot == "temperature" else field]
    if not allows(allowed, value):
        raise DeckError(outside(allowed, slot, value, field.rpartition(".")[2]), where, code="value.outside-range")
    return value


class ValueTable(StrictTable):
    """A value with its bounds and where it comes from."""

    value: str | Real
    min: str | Real | None = None
    max: str | Real | None = None
    source: Source | None = None
    note: str = ""
    basis: str = ""
    spread: str | Real | None = None

    def table(self) -> dict[str, Any]:
        """Return the keys that have a value, as a deck writes them."""
        return {key: value for key, value in self if value not in (None, "")}


def _quantity(written: Any) -> Any:
    """Return a `Parameter` of a text, a number or a table of value and bounds; a power law, a correlation or points stay as they are."""
    if isinstance(written, PowerLawTable | Correlated | Property):
        return written
    return Parameter.read(written.table() if isinstance(written, ValueTable) else written)


def _coefficient(written: Any) -> Any:
    """Return a coefficient of heat transfer as `_quantity` does; 0 (no convection on purpose) needs no unit."""
    if isinstance(written, ValueTable) and written.value in (0, "0"):
        return Parameter.read(written.table() | {"value": NO_CONVECTION})
    return _quantity(NO_CONVECTION if written in (0, "0") else written)


Raw: TypeAlias = str | Real | ValueTable
"""A value as it is written, where a name in it is another deck's or an index is still to be put in."""
Value: TypeAlias = Annotated[Parameter, reads(str | Real | ValueTable, _quantity)]


class PowerLawTable(StrictTable):
    """h = coefficient |dT / 1 K|^exponent."""

    coefficient: Value
    exponent: Value


class Correlated(StrictTable):
    """h by a correlation, from the properties of the gas at film temperature, its pressure, gravity and wind."""

    correlation: str = ""
    length: Value
    orientation: Literal["vertical", "up", "down"] = "vertical"


class Property(StrictTable):
    """A property over temperature: straight lines; a third text of a point is its slope and makes it smooth."""

    points: list[Annotated[list[str], Field(min_length=2, max_length=3)]]
    interpolation: Literal["linear", "smooth"] = "linear"
    outside: Literal["hold", "linear", "refuse"] = "hold"
    source: Source | None = None
    basis: str = ""

    def curve(self, slot: str, where: str, over: str = "temperature", steps: bool = False) -> Curve:
        """Return the curve through the points: temperature (or difference), value in the unit `slot`, and slope where it is given."""
        slots = ("temperature" if over == "temperature" else "K", slot, SLOPES[slot])
        points = [tuple(literal(v, s, where) for v, s in zip(p, slots, strict=False)) for p in self.points]
        return curve(over, points, where, self.source or "", self.basis, self.interpolation, self.outside, steps)

    def curve_of(self, name: str, where: str) -> Curve:
        """Return the curve of one property: conductivity, specific_heat or enthalpy."""
        return tabulated(name, self.curve(TABULATED[name], where, steps=name == "enthalpy"), where)


class Points(Property):
    """A table over a temperature or a temperature difference: straight lines; a third text of a point is its slope and makes it smooth."""

    over: Annotated[str, Field(pattern="^(temperature|difference)$")] = "temperature"


def or_instance(kind: type) -> WrapValidator:
    """Return the mark of a field in whose place a caller in Python may give an object."""
    return WrapValidator(lambda value, check: value if isinstance(value, kind) else check(value))


CurveTable: TypeAlias = Annotated[Points, or_instance(Curve)]
Coefficient: TypeAlias = Annotated[
    Parameter | PowerLawTable | Correlated, reads(str | Real | ValueTable | PowerLawTable | Correlated, _coefficient)
]
Tabulated: TypeAlias = Annotated[Parameter | Property, reads(str | Real | ValueTable | Property, _quantity)]


def curve_of(table: Points | Curve | None, slot: str, where: str) -> Curve | None:
    """Return the curve of a table, or the curve that a caller gave in its place."""
    return table.curve(slot, where, table.over) if isinstance(table, Points) else table


def property_of(entry: Material, name: str) -> Parameter | Property:
    """Return a property of a material as a deck has it: a value with its range, or points where it changes much over temperature."""
    of = PROPERTIES[name]
    if name in entry.over:
        pairs = zip(entry.over["temperature"], entry.over[name], strict=True)
        return Property(points=[[f"{t:g} [K]", f"{v:g} [{of}]"] for t, v in pairs], source="datasheet", basis=entry.basis)
    value, share = getattr(entry, name), entry.range[name]
    low, high = (f"{value * (1.0 + side * share):.6g} [{of}]" for side in (-1.0, 1.0))
    return Parameter.read({"value": f"{value:g} [{of}]", "min": low, "max": high, "source": "datasheet", "basis": entry.basis})


class ElementTable(StrictTable):
    """Base of the tables of elements."""

    test_only: bool = False

    def made_of(self, name: str, field: str, where: str) -> Self:
        """Return this table with `field` taken from the material `name`, unless the field is given beside it."""
        if field in self.model_fields_set:
            return self.model_copy(update={"material": ""})
        try:
            return self.model_copy(update={"material": "", field: property_of(Material.named(name), field)})
        except NameNotFoundError as error:
            raise DeckError(error.message, where, code=error.code) from None

    def parameters(self, names: Iterable[str]) -> dict[str, Parameter]:
        """Return field -> parameter of the fields among `names`; those of a group as ``group.field``."""
        out: dict[str, Parameter] = {}
        for name in names:
            value = getattr(self, name, None)
            if isinstance(value, Parameter):
                out[name] = value
            elif isinstance(value, BaseModel):
                out |= {f"{name}.{inner}": field for inner, field in value if isinstance(field, Parameter)}
        return out

    def words(self, names: Iterable[str]) -> dict[str, str]:
        """Return the fields among `names` that are words; those of a group as ``group.field``."""
        out: dict[str, str] = {}
        for name in sorted(names):
            group, _, inner = name.partition(".")
            value = getattr(self, group, None)
            word = getattr(value, inner, "") if inner else value
            out |= {name: word} if word and isinstance(word, str) else {}
        return out


class AirAndSees(StrictTable):
    """A need bound to two nodes: what its surfaces convect to, and what they see."""

    to: str
    sees: str


Count: TypeAlias = Annotated[int, Field(strict=True, ge=1)]


def _within_cap(count: Any) -> Any:
    """Return the count of an array (number, or rows and columns) unchanged, or refuse more instances than the cap."""
    whole = math.prod(count) if isinstance(count, list) else count or 1
    if whole > cap("instances"):
        text = f"{whole:.4g} instances are too many.{raising('instances')}"
        raise PydanticCustomError("thermid", "{message}", {"message": text, "code": "cap.exceeded"})
    return count


class UsedTable(StrictTable):
    """A deck used inside this one; several times where it has a count."""

    use: Annotated[str, or_instance(Model)]
    bind: dict[str, str | AirAndSees] = Field(default_factory=dict)
    values: dict[str, Raw | list[Raw]] = Field(default_factory=dict)
    count: Annotated[Count | Annotated[list[Count], Field(min_length=2, max_length=2)] | None, AfterValidator(_within_cap)] = None
    chain: dict[str, str] = Field(default_factory=dict)

    def use_of(self) -> Use:
        """Return the table as a `Use`: bindings, values, count and chain."""
        count = () if self.count is None else (self.count,) if isinstance(self.count, int) else tuple(self.count)
        return Use(
            bind={need: node if isinstance(node, str) else node.to for need, node in self.bind.items()},
            sees={need: node.sees for need, node in self.bind.items() if not isinstance(node, str)},
            values={
                path: [value_table(v) for v in raw] if isinstance(raw, list) else value_table(raw) for path, raw in self.values.items()
            },
            count=count,
            chain=self.chain,
        )


def value_table(raw: Any) -> dict[str, Any]:
    """Return a raw value as a table with the key `value` and what else is written of it."""
    return raw.table() if isinstance(raw, ValueTable) else {"value": raw}
