"""Arithmetic over names: numbers, names, dotted paths downward, ``+ - * / **`` and parentheses. No calls, no attributes, no code.

A unit in brackets follows a pure-number expression only, ``"1*(15*0.015) [W]"``; an expression with names, ``"(1 - x)*area"``, takes its
dimension by algebra. Pure numbers are computed in fractions and rounded once.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Callable
from dataclasses import dataclass, field
from fractions import Fraction
from functools import lru_cache
from typing import Any

from thermid.dual import Dual, real_power
from thermid.errors import ExpressionError, ThermidError
from thermid.units import DIMENSIONLESS, Dimension, Unit, describe, to_si, unit

NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*(\.[A-Za-z_][A-Za-z0-9_]*)*\Z")
_BRACKET = re.compile(r"^(?P<number>[^\[\]]*)\[(?P<unit>[^\[\]]*)\]\s*$", re.DOTALL)
_BARE = re.compile(r"\s*([-+]?\d+(?:\.\d*)?(?:[eE][-+]?\d+)?)\s*([A-Za-z%][\w/^*% ]{0,20}?)\s*\Z")
"""A number whose unit stands without brackets."""
_DECIMAL_COMMA = re.compile(r"(?<=\d),(?=\d)")
_LONGEST = 2000
_LARGEST_POWER = 64
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
    """

    text: str
    names: tuple[str, ...]
    literal: Literal | None
    tree: ast.expr = field(repr=False, compare=False)

    def evaluate(self, lookup: Callable[[str], Any]) -> Any:
        """Return the value, with `lookup` giving the value of a name (float, `Dual` or array)."""
        return self.literal.value if self.literal is not None else _value(self.tree, lookup)

    def dimension(self, lookup: Callable[[str], Dimension]) -> Dimension:
        """Return the dimension by algebra.

        Raises
        ------
        ExpressionError   When quantities of two dimensions are added, or an exponent has a dimension.
        """
        return self.literal.unit.dimension if self.literal is not None else _dimension(self.tree, lookup, self.text)


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
    """
    if len(text) > _LONGEST:
        raise ExpressionError(f"the expression has {len(text)} characters; at most {_LONGEST} are read.")
    bracket = _BRACKET.match(text)
    if bracket is None and "[" in text:
        raise ExpressionError(f"'{_short(text)}': a unit stands in brackets once, at the end: '(0.5 + 1) [m]'.")
    body = bracket["number"] if bracket else text
    try:
        tree = ast.parse(body.strip(), mode="eval").body
    except (SyntaxError, ValueError, MemoryError, RecursionError) as error:
        bare = _BARE.match(text)
        meant = f"{bare[1]} [{'degC' if bare[2] == 'C' else bare[2]}]" if bare else "2.5 [W]"
        raise ExpressionError(
            f"'{_short(text)}' cannot be read as arithmetic. Write a number with its unit, '{meant}', or names with + - * / **."
        ) from error
    names: list[str] = []
    _check(tree, text, names)
    if names and bracket:
        raise ExpressionError(
            f"'{text}': a unit in brackets follows pure numbers only; names bring their own units. Leave the brackets out."
        )
    if names:
        return Expression(text, tuple(dict.fromkeys(names)), None, tree)
    of = unit(bracket["unit"]) if bracket else unit("1")
    return Expression(text, (), Literal(_number(tree, body.strip(), of, text), of), tree)


def _number(tree: ast.expr, body: str, of: Unit, text: str) -> float:
    """Compute a pure number in fractions; infinity stays infinity."""
    if isinstance(tree, ast.Name):
        return float("inf")
    try:
        return to_si(_fraction(tree, body), of)
    except (ArithmeticError, ValueError) as error:
        raise ExpressionError(f"'{_short(text)}' has no finite value.") from error


def _short(text: str) -> str:
    return text if len(text) <= 60 else f"{text[:60]}..."


def _power(base: Any, exponent: Any) -> Any:
    """Return a power of numbers with derivatives, arrays or floats; a float stays real."""
    return (
        base**exponent
        if isinstance(base, Dual) or isinstance(exponent, Dual) or not isinstance(base, float)
        else real_power(base, exponent)
    )


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
        return node.id
    if isinstance(node, ast.Attribute):
        inner = _path(node.value)
        return None if inner is None else f"{inner}.{node.attr}"
    return None


def _check(node: ast.expr, text: str, names: list[str], depth: int = 0) -> None:
    """Refuse everything but arithmetic over names, and collect the names."""
    if depth > 100:
        raise ExpressionError(f"'{_short(text)}' is nested too deeply.")
    if isinstance(node, ast.BinOp) and type(node.op) in _OPERATORS:
        _check(node.left, text, names, depth + 1)
        _check(node.right, text, names, depth + 1)
        return
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.UAdd):
        return _check(node.operand, text, names, depth + 1)
    if isinstance(node, ast.Constant) and isinstance(node.value, int | float) and not isinstance(node.value, bool):
        return
    path = _path(node)
    if path == "inf" and depth == 0:
        return
    if path is not None and path.isascii() and "__" not in path:
        names.append(path)
        return
    try:
        part = ast.unparse(node)
    except RecursionError:
        raise ExpressionError(f"'{_short(text)}' is nested too deeply.") from None
    if isinstance(node, ast.Tuple) and (pointed := _DECIMAL_COMMA.sub(".", text)) != text:
        raise ExpressionError(f"'{_short(text)}': numbers have a decimal point here, '{_short(pointed)}'.")
    raise ExpressionError(
        f"'{_short(text)}': '{_short(part)}' is not allowed. An expression holds numbers, names, dotted paths, "
        "+ - * / ** and parentheses; it runs no code."
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
    if not isinstance(node, ast.BinOp):
        raise ValueError("infinity inside arithmetic")
    left, right = _fraction(node.left, body), _fraction(node.right, body)
    if isinstance(node.op, ast.Pow):
        if abs(right) > _LARGEST_POWER:
            raise OverflowError
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
    return lookup(_path(node) or "")


def _dimension(node: ast.expr, lookup: Callable[[str], Dimension], text: str) -> Dimension:
    """Compute the dimension over names."""
    if isinstance(node, ast.Constant):
        return DIMENSIONLESS
    if isinstance(node, ast.UnaryOp):
        return _dimension(node.operand, lookup, text)
    if not isinstance(node, ast.BinOp):
        return lookup(_path(node) or "")
    left, right = _dimension(node.left, lookup, text), _dimension(node.right, lookup, text)
    if isinstance(node.op, ast.Mult):
        return tuple(a + b for a, b in zip(left, right, strict=True))
    if isinstance(node.op, ast.Div):
        return tuple(a - b for a, b in zip(left, right, strict=True))
    if isinstance(node.op, ast.Pow):
        return _power_dimension(node, left, right, text)
    if left != right:
        part = ast.unparse(node)
        raise ExpressionError(f"'{text}': '{part}' adds {describe(left)} and {describe(right)}.")
    return left


def _power_dimension(node: ast.BinOp, left: Dimension, right: Dimension, text: str) -> Dimension:
    """Return the dimension of a power: its exponent is a plain number, and a constant one where the base has a dimension."""
    if right != DIMENSIONLESS:
        raise ExpressionError(f"'{text}': an exponent must be a plain number.")
    if left == DIMENSIONLESS:
        return DIMENSIONLESS
    try:
        power = _fraction(node.right, text.strip())
    except (ArithmeticError, ValueError, ThermidError):
        raise ExpressionError(f"'{text}': a quantity with a unit can be raised to a constant power only.") from None
    return tuple(e * power for e in left)
