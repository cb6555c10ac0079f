"""Parameters: a value as the author wrote it, with its unit, bounds, source and note."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final, get_args

from thermid.errors import DeckError, ThermidError, UnitError
from thermid.expression import Expression, Literal, parse
from thermid.model.laws.options import Source
from thermid.model.parts.standing import Standing
from thermid.units import describe, unit

SOURCES: Final = get_args(Source)


@dataclass(frozen=True)
class Parameter:
    """A value with what is known of it.

    Parameters
    ----------
    expression : Expression     A literal with its unit, or arithmetic over other names.
    minimum, maximum : float    Bounds, or None. [SI]
    source : str                published, datasheet, derived, assumed, measured, or empty.
    note, basis : str           Free text: what it is, and what it rests on.
    standing : Standing         How far a value that was laid over a model may be trusted; None for that of a deck. It is no part of what
                                the value is: two that differ in it alone are equal.
    """

    expression: Expression
    minimum: float | None = None
    maximum: float | None = None
    source: str = ""
    note: str = ""
    basis: str = ""
    standing: Standing | None = field(default=None, compare=False, repr=False)

    @property
    def text(self) -> str:
        """The value as written."""
        return self.expression.text

    @property
    def is_literal(self) -> bool:
        """Whether the value is a number; only a literal can be freed."""
        return self.expression.literal is not None

    @property
    def unit(self) -> str:
        """The unit it was written in; empty for a derived value."""
        return self.expression.literal.unit.text if self.expression.literal else ""


def exact(value: float, unit_text: str, note: str = "") -> Parameter:
    """Return an SI number as a parameter written in a unit; the float itself is kept, so that writing and reading do not change it."""
    import ast

    of = unit(unit_text)
    plain = (value - float(of.offset)) / float(of.factor)
    tree = ast.parse(repr(abs(plain)), mode="eval").body
    return Parameter(Expression(f"{plain!r} [{unit_text}]", (), Literal(value, of), tree), source="", note=note)


def _bound(value: Any, expression: Expression) -> float | None:
    """Return a bound in SI: a number in the value's own unit, or a text with its own."""
    if value is None:
        return None
    if isinstance(value, str):
        literal = parse(value).literal
        if literal is None:
            raise DeckError(f"the bound '{value}' must be a number with a unit.")
        if expression.literal is not None and literal.unit.dimension != expression.literal.unit.dimension:
            raise UnitError(
                f"the bound '{value}' is {describe(literal.unit.dimension)}; the value is {describe(expression.literal.unit.dimension)}."
            )
        return literal.value
    number = float(_written_number(value))
    if expression.literal is None or abs(number) == float("inf"):
        return number
    own = expression.literal.unit
    return parse(f"{number!r} [{own.text}]").literal.value  # type: ignore[union-attr]  # a pure number is a literal


def _written_number(value: Any) -> str:
    """Return the text of a number that was given without one."""
    if isinstance(value, bool) or value != value or not hasattr(value, "__float__"):
        raise DeckError(f"{value!r} is no value. Write a text with a unit, '2.5 [W]', or a number.")
    return repr(float(value))


def parameter(value: str | float | Mapping[str, Any] | Parameter, where: str = "") -> Parameter:
    """Return a parameter from what a deck or a Python caller writes.

    Parameters
    ----------
    value : str, number, table or Parameter
        ``"2.168 [W]"``, ``"(1 - x)*area"``, ``0.3``, or a table with `value` and any of `min`, `max`, `source`, `note`, `basis`.
    where : str     File and key path, for messages.

    Raises
    ------
    ThermidError    When the text cannot be read, a bound is reversed or has another dimension, or a key is unknown.
    """
    if isinstance(value, Parameter):
        return value
    table: Mapping[str, Any] = value if isinstance(value, Mapping) else {"value": value}
    try:
        unknown = set(table) - {"value", "min", "max", "source", "note", "basis"}
        if unknown or "value" not in table:
            raise DeckError(
                f"a parameter has value, min, max, source, note and basis, not {', '.join(sorted(unknown)) or 'a table without value'}."
            )
        raw = table["value"]
        expression = parse(raw if isinstance(raw, str) else _written_number(raw))
        low, high = _bound(table.get("min"), expression), _bound(table.get("max"), expression)
        if low is not None and high is not None and low > high:
            raise DeckError(f"its minimum {table['min']} is above its maximum {table['max']}. Bounds are never swapped silently.")
        source = table.get("source", "")
        if source and source not in SOURCES:
            raise DeckError(f"source '{source}' is none of {', '.join(SOURCES)}.")
        return Parameter(expression, low, high, source, table.get("note", ""), table.get("basis", ""))
    except ThermidError as error:
        raise error.located(where) from None


def check_bounds(value: float, given: Parameter, where: str) -> None:
    """Refuse a value outside its bounds.

    Raises
    ------
    DeckError   Never moved silently (R6).
    """
    for bound, side, beyond in ((given.minimum, "minimum", -1.0), (given.maximum, "maximum", 1.0)):
        if bound is not None and (value - bound) * beyond > 1e-12 * abs(bound):
            word = "below" if beyond < 0 else "above"
            of = unit(given.unit or "1")
            shown = [f"{(v - float(of.offset)) / float(of.factor):.6g}" for v in (value, bound)]
            raise DeckError(
                f"{shown[0]} lies {word} its {side} {shown[1]} [{of.text}]. Values are never moved into bounds silently.", where
            )
