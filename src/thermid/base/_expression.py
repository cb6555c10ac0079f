"""Arithmetic over names: numbers, names, dotted paths downward, ``+ - * / **``, parentheses, ``pi`` and some functions. It runs no code.

A pure-number expression has one unit, at its end: ``"1*(15*0.015) [W]"``. An expression with names, ``"(1 - x)*area"``, takes its dimension
by algebra; a number in it may have its own unit, ``"area - 2 [cm^2]"``. Pure numbers are computed in fractions and rounded once; roots,
exponentials and ``pi`` are rounded where they stand.

Values that enter from Python state their unit as a text does (``"24 [degC]"``), by `celsius` or `quantity`, or are a Quantity of pint, a
pandas Series or an xarray DataArray with a unit; `si_values` is the one door of all of them. A number without a unit is SI where a function
states this; it is never a temperature.
"""

from __future__ import annotations

import ast
import keyword
import math
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from fractions import Fraction
from functools import lru_cache, reduce
from numbers import Real
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from thermid.base._numbers import Array, Dual, real_power
from thermid.base._units import (
    DIMENSIONLESS,
    TEMPERATURE,
    Dimension,
    Unit,
    describe,
    format_value,
    in_si,
    require_unit,
    to_si,
    unit,
    unit as read_unit,
)
from thermid.base.errors import ExpressionError, RecordError, ThermidError, UnitError, cap, errors_at, raising

_BRACKET = re.compile(r"^(?P<number>[^\[\]]*)\[(?P<unit>[^\[\]]*)\]\s*$", re.DOTALL)
_BARE = re.compile(r"\s*([-+]?\d+(?:\.\d*)?(?:[eE][-+]?\d+)?)\s*([A-Za-z%][\w/^*% ]{0,20}?)\s*\Z")
"""A number whose unit stands without brackets."""
_DECIMAL_COMMA = re.compile(r"(?<=\d),(?=\d)")
_QUANTITY = re.compile(r"(?<![\w.\]])(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*\[(?P<unit>[^\[\]]*)\]")
"""A number with its unit inside an expression with names."""
_PLACE = "__quantity"
"""Name that stands for such a number in the tree; no text holds two underscores in a name."""
_WORD = re.compile(rf"\b(?:{'|'.join(keyword.kwlist)})(?=\.[A-Za-z_])|(?<=\.)(?:{'|'.join(keyword.kwlist)})\b")
"""A part of a path that is a word of Python: a node may be called `in`."""
_MARK = "__word"
_MOST_BITS = 4096
"""Digits of a number in between, as bits: more than any float needs, and few enough to compute at once."""
_LARGEST_EXPONENT = 400


@dataclass(frozen=True)
class Literal:
    """A pure number with its unit.

    Parameters
    ----------
    value : float   The value. [SI]
    unit : Unit     The unit it was written in.
    """

    value: float
    unit: Unit


@dataclass(frozen=True)
class Expression:
    """A parsed text: a literal, or arithmetic over names.

    Parameters
    ----------
    text : str                  As written.
    names : tuple of str        The names and dotted paths it needs, in order of appearance.
    literal : Literal or None   Set when the text is a pure number.
    quantities : dict           Place in the tree -> number with a unit that stands inside the expression.
    """

    text: str
    names: tuple[str, ...]
    literal: Literal | None
    tree: ast.expr = field(repr=False, compare=False)
    quantities: Mapping[str, Literal] = field(default_factory=dict, repr=False, compare=False)

    def evaluate(self, lookup: Callable[[str], Any]) -> Any:
        """Return the value, with `lookup` giving the value of a name (float, `Dual` or array)."""
        if self.literal is not None:
            return self.literal.value
        return _value(self.tree, lambda name: self.quantities[name].value if name in self.quantities else lookup(name))

    def dimension(self, lookup: Callable[[str], Dimension]) -> Dimension:
        """Return the dimension by algebra.

        Raises
        ------
        ExpressionError   When quantities of two dimensions are added, or an exponent has a dimension.
        """
        if self.literal is not None:
            return self.literal.unit.dimension
        inside = self.quantities
        return _dimension(self.tree, lambda name: inside[name].unit.dimension if name in inside else lookup(name), self.text)

    @staticmethod
    @lru_cache(maxsize=4096)
    def parse(text: str) -> Expression:
        """Return the expression that a text holds.

        Raises
        ------
        ExpressionError   When it is not arithmetic over names; the message shows the part that is not allowed.
        UnitError         When its unit is not known.

        Examples
        --------
        >>> Expression.parse("1*(15*0.015) [W]").literal.value
        0.225
        >>> Expression.parse("(1 - x)*skin.area").names
        ('x', 'skin.area')
        >>> Expression.parse("pi/4*diameter**2 - 2 [cm^2]").names
        ('diameter',)
        """
        if len(text) > cap("expression"):
            raise ExpressionError(
                f"the expression has {len(text)} characters; the limit is {cap('expression'):.0f}.{raising('expression')}",
                code="cap.exceeded",
            )
        bracket = _BRACKET.match(text)
        body = bracket["number"] if bracket else text
        names: list[str] = []
        if "[" not in body:
            tree = _tree(body, text)
            _check(tree, text, names)
            if not names:
                of = unit(bracket["unit"]) if bracket else unit("1")
                return Expression(text, (), Literal(_number(tree, body.strip(), of, text), of), tree)
        return _with_quantities(text) if "[" in text else Expression(text, tuple(dict.fromkeys(names)), None, tree)


def _tree(body: str, text: str) -> ast.expr:
    """Return the syntax tree of an expression.

    Parts of paths that are keywords of Python, such as `in`, are marked so that they parse as names.

    Parameters
    ----------
    body : str      What is parsed.
    text : str      The whole value, which an error quotes.

    Raises
    ------
    ExpressionError   When it is not arithmetic.
    """
    try:
        return ast.parse(_WORD.sub(rf"\g<0>{_MARK}", body.strip()) if _MARK not in body else body.strip(), mode="eval").body
    except (SyntaxError, ValueError, MemoryError, RecursionError) as error:
        bare = _BARE.match(text)
        meant = f"{bare[1]} [{'degC' if bare[2] == 'C' else bare[2]}]" if bare else "2.5 [W]"
        raise ExpressionError(
            f"'{_short(text)}' cannot be read as arithmetic. Write a number with its unit, '{meant}', or names with + - * / **.",
            code="expression.not-arithmetic",
        ) from error


def _with_quantities(text: str) -> Expression:
    """Return an expression with names in which numbers have units of their own."""
    quantities: dict[str, Literal] = {}

    def placed(match: re.Match[str]) -> str:
        """Return a number with its unit as a factor to SI; refuse a unit that could mean a temperature or a difference."""
        of = unit(match["unit"])
        if of.absolute:
            raise ExpressionError(
                f"'{_short(text)}': '{match[0]}' inside arithmetic could be a temperature or a difference. Write it in [K] or define "
                "a parameter for it.",
                code="expression.scale-in-arithmetic",
            )
        name = f"{_PLACE}{len(quantities)}"
        quantities[name] = Literal(to_si(Fraction(match["number"]), of), of)
        return name

    body = text if _PLACE in text else _QUANTITY.sub(placed, text)
    names: list[str] = []
    if "[" not in body:
        tree = _tree(body, text)
        _check(tree, text, names, places=frozenset(quantities))
    if "[" not in body and names:
        return Expression(text, tuple(dict.fromkeys(names)), None, tree, quantities)
    if _BRACKET.match(text) and re.search(r"[A-Za-z_)]\s*\[[^\[\]]*\]\s*$", text):
        raise ExpressionError(
            f"'{_short(text)}': a unit in brackets may follow pure numbers only; names have their own units. Leave the brackets out.",
            code="expression.unit-misplaced",
        )
    raise ExpressionError(
        f"'{_short(text)}': write the unit in brackets once, at the end: '(0.5 + 1) [m]'. In an expression with names write it after "
        "a number: 'area + 2 [cm^2]'.",
        code="expression.unit-misplaced",
    )


def _number(tree: ast.expr, body: str, of: Unit, text: str) -> float:
    """Compute a pure number in fractions; infinity stays infinity."""
    if isinstance(tree, ast.Name) and tree.id == "inf":
        return float("inf")
    try:
        return to_si(_fraction(tree, body), of)
    except ThermidError:
        raise
    except (ArithmeticError, ValueError) as error:
        raise ExpressionError(f"'{_short(text)}' has no finite value.", code="expression.no-finite-value") from error


def _short(text: str) -> str:
    """Return a text in at most 60 characters, for messages."""
    return text if len(text) <= 60 else f"{text[:60]}..."


def _power(base: Any, exponent: Any) -> Any:
    """Return a power of numbers with derivatives, arrays or floats; a float stays real."""
    return (
        base**exponent
        if isinstance(base, Dual) or isinstance(exponent, Dual) or not isinstance(base, float)
        else real_power(base, exponent)
    )


def _exponential(x: Any) -> Any:
    """Return e to the power x, of a float, a number with derivatives or an array."""
    if type(x) is Dual:
        value = math.exp(x.value)
        return Dual(value, value * x.gradient)
    return math.exp(x) if isinstance(x, float) else np.exp(x)


def _logarithm(x: Any) -> Any:
    """Return ln x of a float, a number with derivatives or an array; an array has NaN where it is not above zero, or infinite.

    Raises
    ------
    ArithmeticError   Of one number that is not above zero.
    """
    if type(x) is Dual:
        return Dual(_logarithm(x.value), x.gradient / x.value)
    if isinstance(x, float):
        if x <= 0.0:
            raise ArithmeticError("only a positive number has a logarithm")
        return math.log(x)
    if not isinstance(x, np.ndarray):
        return np.log(x)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where((x > 0.0) & np.isfinite(x), np.log(x), np.nan)


def _chosen(choose: Callable[[Any, Any], Any], *values: Any) -> Any:
    """Return the smallest or largest of several; its derivative is that of the one chosen."""
    best = reduce(choose, values)
    return float(best) if isinstance(best, np.floating) else best


FUNCTIONS: dict[str, Callable[..., Any]] = {
    "sqrt": lambda x: _power(x, 0.5),
    "exp": _exponential,
    "log": _logarithm,
    "abs": lambda x: _chosen(np.maximum, x, -x),
    "min": lambda *x: _chosen(np.minimum, *x),
    "max": lambda *x: _chosen(np.maximum, *x),
}
"""Functions of an expression; the last two take several values."""
SEVERAL = ("min", "max")
CONSTANTS = {"pi": math.pi}
RESERVED = ("inf", *CONSTANTS)
"""Names that no parameter may have."""


_OPERATORS: dict[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: lambda a, b: a + b,
    ast.Sub: lambda a, b: a - b,
    ast.Mult: lambda a, b: a * b,
    ast.Div: lambda a, b: a / b,
    ast.Pow: _power,
}


def _path(node: ast.expr) -> str | None:
    """Return a name or a dotted path, or None when the node is neither."""
    if isinstance(node, ast.Name):
        return node.id.removesuffix(_MARK)
    if isinstance(node, ast.Attribute):
        inner = _path(node.value)
        return None if inner is None else f"{inner}.{node.attr.removesuffix(_MARK)}"
    return None


def _operands(node: ast.expr) -> list[ast.expr] | None:
    """Return what an operation or function acts on; None where the node is neither."""
    if isinstance(node, ast.BinOp) and type(node.op) in _OPERATORS:
        return [node.left, node.right]
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.UAdd):
        return [node.operand]
    if isinstance(node, ast.Call) and _function(node) in FUNCTIONS and not node.keywords:
        return node.args
    return None


def _function(node: ast.Call) -> str:
    """Return the name of the function that is called; empty where it is no plain name."""
    return node.func.id if isinstance(node.func, ast.Name) else ""


def _check(node: ast.expr, text: str, names: list[str], depth: int = 0, places: frozenset[str] = frozenset()) -> None:
    """Refuse everything but arithmetic over names, and collect the names; `places` are places of numbers with units."""
    if depth > 100:
        raise ExpressionError(f"'{_short(text)}' is nested too deeply.", code="expression.not-arithmetic")
    operands = _operands(node)
    if operands is not None:
        if isinstance(node, ast.Call) and (len(operands) < 2 if _function(node) in SEVERAL else len(operands) != 1):
            needed = "two values or more" if _function(node) in SEVERAL else "one value"
            raise ExpressionError(
                f"'{_short(text)}': {_function(node)}() takes {needed}; it has {len(operands)}.", code="expression.not-arithmetic"
            )
        for operand in operands:
            _check(operand, text, names, depth + 1, places)
        return
    if isinstance(node, ast.Constant) and isinstance(node.value, int | float) and not isinstance(node.value, bool):
        return
    path = _path(node)
    if (path == "inf" and depth == 0) or path in CONSTANTS or path in places:
        return
    if path is not None and path.isascii() and "__" not in path and _MARK not in text:
        names.append(path)
        return
    try:
        part = _written(node, text)
    except RecursionError:
        raise ExpressionError(f"'{_short(text)}' is nested too deeply.", code="expression.not-arithmetic") from None
    if part == "...":
        raise ExpressionError(f"'{_short(text)}' is a gap to fill: write the value instead of '...'.", code="expression.not-arithmetic")
    if isinstance(node, ast.Tuple) and (pointed := _DECIMAL_COMMA.sub(".", text)) != text:
        raise ExpressionError(
            f"'{_short(text)}': write numbers with a decimal point: '{_short(pointed)}'.", code="expression.decimal-comma"
        )
    raise ExpressionError(
        f"'{_short(text)}': '{_short(part)}' is not allowed. An expression may hold numbers, names, dotted paths, + - * / **, "
        f"parentheses, pi, {', '.join(FUNCTIONS)}. It does not run code.",
        code="expression.not-arithmetic",
    )


def _written(node: ast.expr, text: str) -> str:
    """Return a part of an expression as its text has it: numbers with their units, and words of Python as they are."""
    quantities = _QUANTITY.findall(text)
    part = re.sub(rf"{_PLACE}(\d+)", lambda match: "{} [{}]".format(*quantities[int(match[1])]), ast.unparse(node))
    return part.replace(_MARK, "")


def _fraction(node: ast.expr, body: str) -> Fraction:
    """Compute a pure number exactly."""
    if isinstance(node, ast.Constant):
        segment = (ast.get_source_segment(body, node) or repr(node.value)).replace("_", "")
        if isinstance(node.value, float) and abs(int(segment.lower().partition("e")[2] or 0)) > _LARGEST_EXPONENT:
            raise OverflowError
        return Fraction(segment) if not segment.lower().startswith(("0x", "0b", "0o")) else Fraction(node.value)  # type: ignore[arg-type]
    if isinstance(node, ast.UnaryOp):
        inner = _fraction(node.operand, body)
        return -inner if isinstance(node.op, ast.USub) else inner
    if isinstance(node, ast.Call):
        values = [_fraction(argument, body) for argument in node.args]
        exact: dict[str, Callable[..., Fraction]] = {"abs": abs, "min": min, "max": max}
        name = _function(node)
        return exact[name](*values) if name in exact else Fraction(FUNCTIONS[name](*map(float, values)))
    if isinstance(node, ast.Name) and node.id in CONSTANTS:
        return Fraction(CONSTANTS[node.id])
    if not isinstance(node, ast.BinOp):
        raise ValueError("infinity inside arithmetic")
    lhs, right = _fraction(node.left, body), _fraction(node.right, body)
    if isinstance(node.op, ast.Pow):
        if abs(right) > cap("power"):
            raise ExpressionError(
                f"'{_short(body)}' has no finite value, or needs a power above {cap('power'):.0f}.{raising('power')}",
                code="expression.no-finite-value",
            )
        if right.denominator != 1:  # a root is not a fraction; it is rounded here and once more at the end
            return Fraction(real_power(float(lhs), float(right)))
        if _bits(lhs) * abs(right) > _MOST_BITS:
            raise OverflowError
        return lhs**right.numerator
    result = Fraction(_OPERATORS[type(node.op)](lhs, right))
    if _bits(result) > _MOST_BITS:
        raise OverflowError
    return result


def _bits(number: Fraction) -> int:
    """Return the number of bits of the longer of numerator and denominator."""
    return max(number.numerator.bit_length(), number.denominator.bit_length())


def _value(node: ast.expr, lookup: Callable[[str], Any]) -> Any:
    """Compute the value over names."""
    if isinstance(node, ast.Constant):
        return float(node.value)  # type: ignore[arg-type]  # _check let only numbers through
    if isinstance(node, ast.UnaryOp):
        inner = _value(node.operand, lookup)
        return -inner if isinstance(node.op, ast.USub) else inner
    if isinstance(node, ast.BinOp):
        return _OPERATORS[type(node.op)](_value(node.left, lookup), _value(node.right, lookup))
    if isinstance(node, ast.Call):
        return FUNCTIONS[_function(node)](*(_value(argument, lookup) for argument in node.args))
    path = _path(node) or ""
    return CONSTANTS[path] if path in CONSTANTS else lookup(path)


def _dimension(node: ast.expr, lookup: Callable[[str], Dimension], text: str) -> Dimension:
    """Compute the dimension over names."""
    if isinstance(node, ast.Constant):
        return DIMENSIONLESS
    if isinstance(node, ast.UnaryOp):
        return _dimension(node.operand, lookup, text)
    if isinstance(node, ast.Call):
        return _function_dimension(node, [_dimension(argument, lookup, text) for argument in node.args], text)
    if not isinstance(node, ast.BinOp):
        path = _path(node) or ""
        return DIMENSIONLESS if path in CONSTANTS else lookup(path)
    lhs, right = _dimension(node.left, lookup, text), _dimension(node.right, lookup, text)
    if isinstance(node.op, ast.Mult):
        return lhs if right is DIMENSIONLESS else tuple(a + b for a, b in zip(lhs, right, strict=True))
    if isinstance(node.op, ast.Div):
        return lhs if right is DIMENSIONLESS else tuple(a - b for a, b in zip(lhs, right, strict=True))
    if isinstance(node.op, ast.Pow):
        return _power_dimension(node, lhs, right, text)
    if lhs != right:
        raise ExpressionError(
            f"'{text}': '{_written(node, text)}' adds {describe(lhs)} and {describe(right)}.", code="expression.mixed-dimensions"
        )
    return lhs


def _function_dimension(node: ast.Call, of: list[Dimension], text: str) -> Dimension:
    """Return the dimension of a function: a root halves it, exponentials and logarithms take plain numbers, the others keep one."""
    name = _function(node)
    if name == "sqrt":
        return tuple(dimension / 2 for dimension in of[0])
    if name in ("exp", "log") and of[0] != DIMENSIONLESS:
        raise ExpressionError(
            f"'{text}': {name}() takes a plain number; '{_written(node.args[0], text)}' is {describe(of[0])}.",
            code="expression.mixed-dimensions",
        )
    for dimension in of[1:]:
        if dimension != of[0]:
            raise ExpressionError(
                f"'{text}': '{_written(node, text)}' compares {describe(of[0])} and {describe(dimension)}.",
                code="expression.mixed-dimensions",
            )
    return of[0]


def _power_dimension(node: ast.BinOp, base_dimension: Dimension, right: Dimension, text: str) -> Dimension:
    """Return the dimension of a power: its exponent is a plain number, and a constant one where the base has a dimension."""
    if right != DIMENSIONLESS:
        raise ExpressionError(f"'{text}': an exponent must be a plain number.", code="expression.exponent-not-plain")
    if base_dimension == DIMENSIONLESS:
        return DIMENSIONLESS
    try:
        power = _fraction(_tree(exponent := ast.unparse(node.right), text), exponent)
    except (ArithmeticError, ValueError, ThermidError):
        raise ExpressionError(
            f"'{text}': a quantity with a unit can be raised to a constant power only.", code="expression.exponent-not-plain"
        ) from None
    return tuple(e * power for e in base_dimension)


# ---- values with their unit

THREE_WAYS: Final = "Write '24 [degC]', td.celsius(24), or td.quantity([24, 25], unit='degC') for an array"
"""How a temperature is given."""


class Kelvin(float):
    """A temperature that was given with its unit. [K]"""


class Stamp(NamedTuple):
    """An instant: seconds since 1970 in UTC, or by a clock whose zone nobody stated. [s]"""

    seconds: float
    zoned: bool

    @property
    def text(self) -> str:
        """It as `Stamp.read` reads it."""
        return (datetime(1970, 1, 1, tzinfo=UTC if self.zoned else None) + timedelta(seconds=self.seconds)).isoformat(" ")

    @staticmethod
    def read(written: Any, where: str = "") -> Stamp:
        """Return a stamp: a text such as ``"2026-02-01 08:00"``, or what datetime, NumPy or pandas make of one.

        Raises
        ------
        UnitError   When it is none.
        """
        if isinstance(written, Stamp):
            return written
        with errors_at(where):
            try:
                stamp = clocked([datetime.fromisoformat(written) if isinstance(written, str) else written])[1]
            except ValueError:
                stamp = None
            if stamp is None or not math.isfinite(stamp.seconds):
                raise UnitError(f"{_shown(written)} is no stamp. Write '2026-02-01 08:00'.", code="record.time-not-read")
        return stamp


@dataclass(frozen=True, eq=False)
class Quantity:
    """A number, or an array of them, with its unit.

    Parameters
    ----------
    si : float or array         [SI]
    unit : Unit                 In which it was given.
    times : array or None       Of the index of a pandas Series, or the coordinate of an xarray DataArray. [s]
    stamp : Stamp or None       Instant of time zero, where these were stamps.
    """

    si: float | Array
    unit: Unit
    times: Array | None = None
    stamp: Stamp | None = None

    def __repr__(self) -> str:
        """Show a single number as a text has it."""
        return format_value(float(self), self.unit.text) if np.ndim(self.si) == 0 else f"{len(self)} numbers in [{self.unit.text}]"

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Array:
        """The numbers as an array. [SI]"""
        return np.array(self.si, dtype=dtype)

    def __float__(self) -> float:
        """The number, of a single one. [SI]

        Raises
        ------
        UnitError   When there are several.
        """
        if np.size(self.si) != 1:
            raise UnitError(f"one number is needed, not {np.size(self.si)}.", code="value.wrong-kind")
        return float(np.ravel(self.si)[0])

    def __len__(self) -> int:
        """How many numbers it holds."""
        return len(np.atleast_1d(self.si))

    def __iter__(self) -> Iterator[Quantity]:
        """Each number with its unit."""
        return (self[k] for k in range(len(self)))

    def __getitem__(self, index: Any) -> Quantity:
        """Some of the numbers with their unit."""
        return Quantity(np.atleast_1d(self.si)[index], self.unit, None if self.times is None else self.times[index], self.stamp)


def quantity(values: Any, *, unit: str) -> Quantity:
    """Return numbers with their unit, to be given wherever a value is taken.

    Parameters
    ----------
    values : float, array, series, DataArray    In that unit. Of a Series or a DataArray the index gives the times of a signal: numbers in
                                                seconds, stamps or durations.
    unit : str                                  Such as ``"degC"``, ``"K"`` or ``"W"``.

    Raises
    ------
    UnitError   When nobody knows the unit, the values are no numbers, or state another unit themselves.

    Examples
    --------
    >>> float(quantity(77, unit="degF").si)
    298.15
    """
    of, with_own_unit = read_unit(unit), stated(values)
    if with_own_unit is not None and with_own_unit.unit != of:
        raise UnitError(
            f"the values are in [{with_own_unit.unit.text}] themselves. Leave out unit='{unit}', or give plain numbers.",
            code="value.without-effect",
        )
    if with_own_unit is not None:
        return with_own_unit
    return Quantity(_in_si(values, of), of, *_index(values))


def celsius(values: Any) -> Quantity:
    """Return one or more temperatures given in degrees Celsius.

    Raises
    ------
    UnitError   As `quantity`.

    Examples
    --------
    >>> float(celsius(24).si)
    297.15
    """
    return quantity(values, unit="degC")


def stated(value: Any) -> Quantity | None:
    """Return what states its unit, as a `Quantity`; None for texts, and for numbers without a unit. A duration states its unit itself.

    Raises
    ------
    UnitError   When nobody knows the unit.
    """
    if isinstance(value, Quantity):
        return value
    if isinstance(value, Kelvin):
        return Quantity(float(value), read_unit("K"))
    if isinstance(value, timedelta | np.timedelta64):  # of pandas too
        return Quantity(float(np.timedelta64(value) / np.timedelta64(1, "s")), read_unit("s"))
    if hasattr(value, "magnitude") and hasattr(value, "units"):  # pint
        of = read_unit(str(value.units))
        return Quantity(_in_si(value.magnitude, of), of)
    attributes = getattr(value, "attrs", None)  # pandas and xarray
    text = attributes.get("units", attributes.get("unit")) if isinstance(attributes, dict) else None
    if text is None:
        return None
    of = read_unit(str(text))
    return Quantity(_in_si(value, of), of, *_index(value))


def si_values(raw: Any, slot: str) -> float | Array | None:
    """Return what was given for a slot, in SI, of its own shape; None for numbers without a unit where the slot is no temperature.

    Parameters
    ----------
    raw : Any       A text, a number or an array, with a unit in one of the ways of this module or without one.
    slot : str      The unit that is needed, or `TEMPERATURE`.

    Raises
    ------
    UnitError           When it has another dimension, or is a temperature without a unit.
    ExpressionError     When a text cannot be read.
    """
    if isinstance(raw, str):
        return text_value(raw, slot)
    with_unit = stated(raw)
    if with_unit is not None:
        require_unit(with_unit.unit, slot)
        return with_unit.si
    if isinstance(raw, list | tuple) and any(isinstance(v, str) or stated(v) is not None for v in raw):
        return np.array([si_value(v, slot) for v in raw])
    if slot == TEMPERATURE:
        raise UnitError(f"a temperature with its unit is needed, not {_shown(raw)}. {THREE_WAYS}.", code="value.wrong-kind")
    return None


@lru_cache(maxsize=4096)
def text_value(text: str, slot: str) -> float:
    """Return the number of a text with a unit, in SI.

    Raises
    ------
    UnitError           When it has another dimension.
    ExpressionError     When it is no number.
    """
    literal = Expression.parse(text).literal
    if literal is None:
        example = "24 [degC]" if slot == TEMPERATURE else f"5 [{slot}]"
        raise ExpressionError(
            f"'{text}' must be a number with a unit, such as '{example}'; names of parameters are not allowed here.",
            code="value.wrong-kind",
        )
    require_unit(literal.unit, slot)
    return literal.value


def si_value(raw: Any, slot: str) -> float | None:
    """Return one number for a slot, as `si_values`.

    Raises
    ------
    UnitError   As `si_values`, or when there are several numbers or it is not a number (nan), such as the mean of an empty series.
    """
    value = si_values(raw, slot)
    if value is not None and (np.size(value) != 1 or np.isnan(value).any()):
        raise UnitError(f"one number is needed, not {np.size(value) if np.size(value) != 1 else 'nan'}.", code="value.wrong-kind")
    return None if value is None else float(np.ravel(value)[0])


def amount(written: object, slot: str, where: str = "") -> float:
    """Return an SI value for a slot: the one door of sizes, durations among them.

    Parameters
    ----------
    written : Any          Text with a unit, ``"0.3 [K]"``, another value with its unit, a duration, or a number in SI of no temperature.
    slot : str             The unit that is needed, or `TEMPERATURE`.
    where : str            What the value is for, for the message.

    Raises
    ------
    UnitError     When it is neither a number nor a text with a unit, is not finite, or its unit has another dimension or is missing.
    """
    with errors_at(where):
        value = si_value(written, slot)
        if value is None:
            if isinstance(written, bool) or not isinstance(written, Real):
                text = f"{_shown(written)} is neither a number nor a text with a unit, such as '4 [{slot or 's'}]'."
                raise UnitError(text, code="value.not-an-amount")
            try:
                value = float(written)
            except OverflowError:  # a whole number of Python beyond all floats
                value = math.inf
        if not math.isfinite(value):
            raise UnitError(f"{_shown(written)} is not finite.", code="value.outside-range")
    return value


def kelvin(raw: Any) -> Kelvin:
    """Return one temperature. [K]

    Raises
    ------
    UnitError   When it has no unit, or is no temperature.
    """
    if isinstance(raw, Kelvin):
        return raw
    value = si_value(raw, TEMPERATURE)
    assert value is not None
    return Kelvin(value)


def end_of_range(raw: Any) -> Kelvin:
    """Return one end of a range of temperatures, infinite where it is open. [K]

    Raises
    ------
    UnitError   As `kelvin`.
    """
    return Kelvin(raw) if isinstance(raw, float) and np.isinf(raw) else kelvin(raw)


def seconds(times: Any) -> Array:
    """Return times (times,): plain numbers are seconds, stamps count from the first. [s]

    Raises
    ------
    UnitError   When they are neither numbers, texts with a unit, durations nor stamps.
    """
    return clocked(times)[0]


def clocked(times: Any) -> tuple[Array, Stamp | None]:
    """Return times (times,) [s] as `seconds` does, and the instant of their zero where they are stamps.

    Raises
    ------
    UnitError   As `seconds`.
    """
    si_times = si_values(times, "s")
    if si_times is not None:
        return np.atleast_1d(np.asarray(si_times, dtype=float)), None
    try:
        values, stamp = np.asarray(times), None
    except ValueError:  # rows of several lengths
        values, stamp = np.empty(0, dtype="U"), None
    if values.dtype.kind == "O" and values.size:
        zoned = [t.timestamp() for t in values.ravel() if getattr(t, "tzinfo", None) is not None]
        if len(zoned) == values.size:
            values, stamp = np.array(zoned) - zoned[0], Stamp(zoned[0], True)
        else:
            values = np.asarray(_stamps(values))
    if values.dtype.kind == "M" and values.size:
        stamp = Stamp(float((values.ravel()[0] - np.datetime64(0, "s")) / np.timedelta64(1, "s")), False)
        values = values - values.ravel()[0]
    if values.dtype.kind == "m":
        values = values / np.timedelta64(1, "s")
    if values.dtype.kind not in "iuf":
        raise UnitError(
            "times are numbers in seconds, texts such as '2 [h]', durations or stamps. Convert them with pandas.to_datetime.",
            code="record.time-not-read",
        )
    return np.asarray(values, dtype=float), stamp


def _stamps(values: NDArray[Any]) -> NDArray[Any]:
    """Return values as instants where they can be; as they are otherwise."""
    try:
        return values.astype("datetime64[us]")
    except (TypeError, ValueError, OverflowError):
        return values


def _in_si(values: ArrayLike, of: Unit) -> float | Array:
    """Return numbers of any shape in the unit `of` as SI numbers; a single one is rounded once, as that of a text."""
    numbers = plain_numbers(values)
    if isinstance(numbers, float):
        return to_si(Fraction(repr(numbers)), of) if np.isfinite(numbers) else numbers
    return in_si(numbers, of)


def plain_numbers(values: Any) -> float | Array:
    """Return numbers as a float or an array of floats, of the shape and in the unit in which they were given.

    Raises
    ------
    UnitError   When they are none.
    """
    try:
        numbers = np.asarray(values)
        if numbers.dtype.kind not in "iufO":
            raise TypeError
        numbers = numbers.astype(float)
    except (TypeError, ValueError, OverflowError):
        raise UnitError(f"{_shown(values)} is no number. {THREE_WAYS}.", code="value.wrong-kind") from None
    return float(numbers) if numbers.ndim == 0 else numbers


def _index(values: Any) -> tuple[Array | None, Stamp | None]:
    """Return the times (times,) [s] of the index of a pandas Series, or of the one coordinate of an xarray DataArray, and their zero.

    None where there are none.
    """
    coordinates, dimensions = getattr(values, "coords", None), list(getattr(values, "dims", []))
    if coordinates is not None:
        return clocked(coordinates[dimensions[0]].variable) if len(dimensions) == 1 and dimensions[0] in coordinates else (None, None)
    return (None, None) if not hasattr(values, "iloc") or counts_rows(values.index) else clocked(values.index)


def counts_rows(index: Any) -> bool:
    """Return whether an index of pandas is the one that it makes itself, which says nothing of times."""
    return type(index).__name__ == "RangeIndex" and index.step == 1


def _shown(value: Any) -> str:
    """Return a value as messages quote it: its text, or its kind where that is long."""
    text = repr(value)
    return text if len(text) < 60 and "\n" not in text else f"this {type(value).__name__}"


def positive_seconds(written: object, what: str) -> float:
    """Return a time above zero, such as a window, from a number or a text with a unit. [s]

    Raises
    ------
    RecordError   When it is zero or negative.
    """
    value = amount(written, "s", what)
    if value <= 0:
        raise RecordError(f"{format_value(value, 's')} is not above zero.", what, code="value.outside-range")
    return value
