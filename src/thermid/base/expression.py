"""Arithmetic over names: numbers, names, dotted paths downward, ``+ - * / **``, parentheses, ``pi`` and six functions. It runs no code.

A pure-number expression has one unit, at its end: ``"1*(15*0.015) [W]"``. An expression with names, ``"(1 - x)*area"``, takes its dimension
by algebra; a number in it may have its own unit, ``"area - 2 [cm^2]"``. Pure numbers are computed in fractions and rounded once; roots,
exponentials and ``pi`` are rounded where they stand.
"""

from __future__ import annotations

import ast
import keyword
import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from functools import lru_cache
from typing import Any

import numpy as np

from thermid.base.dual import Dual, real_power, value_of
from thermid.base.errors import ExpressionError, ThermidError, cap, raising
from thermid.base.units import DIMENSIONLESS, Dimension, Unit, describe, to_si, unit

NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*(\.[A-Za-z_][A-Za-z0-9_]*)*\Z")
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


@lru_cache(maxsize=4096)
def parse(text: str) -> Expression:
    """Return the expression that a text holds.

    Raises
    ------
    ExpressionError   When it is not arithmetic over names; the message shows the part that is not allowed.
    UnitError         When its unit is not known.

    Examples
    --------
    >>> parse("1*(15*0.015) [W]").literal.value
    0.225
    >>> parse("(1 - x)*skin.area").names
    ('x', 'skin.area')
    >>> parse("pi/4*diameter**2 - 2 [cm^2]").names
    ('diameter',)
    """
    if len(text) > cap("expression"):
        raise ExpressionError(
            f"the expression has {len(text)} characters; the limit is {cap('expression'):.0f}.{raising('expression')}", code="cap.exceeded"
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
    """Return the syntax tree of arithmetic."""
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

    def placed(found: re.Match[str]) -> str:
        of = unit(found["unit"])
        if of.absolute:
            raise ExpressionError(
                f"'{_short(text)}': '{found[0]}' inside arithmetic could be a temperature or a difference. Write it in [K] or define "
                "a parameter for it.",
                code="expression.scale-in-arithmetic",
            )
        name = f"{_PLACE}{len(quantities)}"
        quantities[name] = Literal(to_si(Fraction(found["number"]), of), of)
        return name

    body = text if _PLACE in text else _QUANTITY.sub(placed, text)
    names: list[str] = []
    if "[" not in body:
        tree = _tree(body, text)
        _check(tree, text, names, known=frozenset(quantities))
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


def _chosen(smaller: bool, first: Any, *others: Any) -> Any:
    """Return the smallest or largest of several; its derivative is that of the one chosen."""
    best = first
    for other in others:
        if type(best) is Dual or type(other) is Dual:
            best = other if (value_of(other) < value_of(best)) is smaller and value_of(other) != value_of(best) else best
        else:
            best = np.minimum(best, other) if smaller else np.maximum(best, other)
    return float(best) if isinstance(best, np.floating) else best


FUNCTIONS: dict[str, Callable[..., Any]] = {
    "sqrt": lambda x: _power(x, 0.5),
    "exp": _exponential,
    "abs": lambda x: _chosen(False, x, -x),
    "min": lambda *x: _chosen(True, *x),
    "max": lambda *x: _chosen(False, *x),
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
    return node.func.id if isinstance(node.func, ast.Name) else ""


def _check(node: ast.expr, text: str, names: list[str], depth: int = 0, known: frozenset[str] = frozenset()) -> None:
    """Refuse everything but arithmetic over names, and collect the names; `known` are places of numbers with units."""
    if depth > 100:
        raise ExpressionError(f"'{_short(text)}' is nested too deeply.", code="expression.not-arithmetic")
    operands = _operands(node)
    if operands is not None:
        if isinstance(node, ast.Call) and (len(operands) < 2 if _function(node) in SEVERAL else len(operands) != 1):
            asked = "two values or more" if _function(node) in SEVERAL else "one value"
            raise ExpressionError(
                f"'{_short(text)}': {_function(node)}() takes {asked}; it has {len(operands)}.", code="expression.not-arithmetic"
            )
        for operand in operands:
            _check(operand, text, names, depth + 1, known)
        return
    if isinstance(node, ast.Constant) and isinstance(node.value, int | float) and not isinstance(node.value, bool):
        return
    path = _path(node)
    if (path == "inf" and depth == 0) or path in CONSTANTS or path in known:
        return
    if path is not None and path.isascii() and "__" not in path and _MARK not in text:
        names.append(path)
        return
    try:
        part = ast.unparse(node)
    except RecursionError:
        raise ExpressionError(f"'{_short(text)}' is nested too deeply.", code="expression.not-arithmetic") from None
    if isinstance(node, ast.Tuple) and (pointed := _DECIMAL_COMMA.sub(".", text)) != text:
        raise ExpressionError(
            f"'{_short(text)}': write numbers with a decimal point: '{_short(pointed)}'.", code="expression.decimal-comma"
        )
    raise ExpressionError(
        f"'{_short(text)}': '{_short(part)}' is not allowed. An expression may hold numbers, names, dotted paths, + - * / **, "
        f"parentheses, pi, {', '.join(FUNCTIONS)}. It does not run code.",
        code="expression.not-arithmetic",
    )


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
        values = [_fraction(each, body) for each in node.args]
        exact: dict[str, Callable[..., Fraction]] = {"abs": abs, "min": min, "max": max}
        name = _function(node)
        return exact[name](*values) if name in exact else Fraction(FUNCTIONS[name](*map(float, values)))
    if isinstance(node, ast.Name) and node.id in CONSTANTS:
        return Fraction(CONSTANTS[node.id])
    if not isinstance(node, ast.BinOp):
        raise ValueError("infinity inside arithmetic")
    left, right = _fraction(node.left, body), _fraction(node.right, body)
    if isinstance(node.op, ast.Pow):
        if abs(right) > cap("power"):
            raise ExpressionError(
                f"'{_short(body)}' has no finite value, or needs a power above {cap('power'):.0f}.{raising('power')}",
                code="expression.no-finite-value",
            )
        if right.denominator != 1:  # a root is not a fraction; it is rounded here and once more at the end
            return Fraction(real_power(float(left), float(right)))
        if _bits(left) * abs(right) > _MOST_BITS:
            raise OverflowError
        return left**right.numerator
    made = Fraction(_OPERATORS[type(node.op)](left, right))
    if _bits(made) > _MOST_BITS:
        raise OverflowError
    return made


def _bits(number: Fraction) -> int:
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
        return FUNCTIONS[_function(node)](*(_value(each, lookup) for each in node.args))
    path = _path(node) or ""
    return CONSTANTS[path] if path in CONSTANTS else lookup(path)


def _dimension(node: ast.expr, lookup: Callable[[str], Dimension], text: str) -> Dimension:
    """Compute the dimension over names."""
    if isinstance(node, ast.Constant):
        return DIMENSIONLESS
    if isinstance(node, ast.UnaryOp):
        return _dimension(node.operand, lookup, text)
    if isinstance(node, ast.Call):
        return _function_dimension(node, [_dimension(each, lookup, text) for each in node.args], text)
    if not isinstance(node, ast.BinOp):
        path = _path(node) or ""
        return DIMENSIONLESS if path in CONSTANTS else lookup(path)
    left, right = _dimension(node.left, lookup, text), _dimension(node.right, lookup, text)
    if isinstance(node.op, ast.Mult):
        return tuple(a + b for a, b in zip(left, right, strict=True))
    if isinstance(node.op, ast.Div):
        return tuple(a - b for a, b in zip(left, right, strict=True))
    if isinstance(node.op, ast.Pow):
        return _power_dimension(node, left, right, text)
    if left != right:
        part = ast.unparse(node)
        raise ExpressionError(f"'{text}': '{part}' adds {describe(left)} and {describe(right)}.", code="expression.mixed-dimensions")
    return left


def _function_dimension(node: ast.Call, of: list[Dimension], text: str) -> Dimension:
    """Return the dimension of a function: a root halves it, an exponential takes plain numbers, the others keep one dimension."""
    name = _function(node)
    if name == "sqrt":
        return tuple(each / 2 for each in of[0])
    if name == "exp" and of[0] != DIMENSIONLESS:
        raise ExpressionError(
            f"'{text}': exp() takes a plain number; '{ast.unparse(node.args[0])}' is {describe(of[0])}.", code="expression.mixed-dimensions"
        )
    for each in of[1:]:
        if each != of[0]:
            raise ExpressionError(
                f"'{text}': '{ast.unparse(node)}' compares {describe(of[0])} and {describe(each)}.", code="expression.mixed-dimensions"
            )
    return of[0]


def _power_dimension(node: ast.BinOp, left: Dimension, right: Dimension, text: str) -> Dimension:
    """Return the dimension of a power: its exponent is a plain number, and a constant one where the base has a dimension."""
    if right != DIMENSIONLESS:
        raise ExpressionError(f"'{text}': an exponent must be a plain number.", code="expression.exponent-not-plain")
    if left == DIMENSIONLESS:
        return DIMENSIONLESS
    try:
        power = _fraction(node.right, text.strip())
    except (ArithmeticError, ValueError, ThermidError):
        raise ExpressionError(
            f"'{text}': a quantity with a unit can be raised to a constant power only.", code="expression.exponent-not-plain"
        ) from None
    return tuple(e * power for e in left)
