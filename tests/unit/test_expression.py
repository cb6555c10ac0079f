"""Arithmetic over names: exact, dimensioned, and nothing but arithmetic."""

from __future__ import annotations

import ast
import math
import operator
import re
import sys
from collections.abc import Callable
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from hypothesis import given, strategies as st

import thermid as td
from by_code import raises_code
from thermid.base.errors import ExpressionError, UnitError
from thermid.base.units import Dual, Expression, gradient_of, unit, value_of
from thermid.model.tree import ParameterSet

NUMBERS = st.one_of(
    st.integers(0, 999).map(str),
    st.decimals(min_value="0", max_value="99", places=3, allow_nan=False, allow_infinity=False).map(lambda d: f"{d:f}"),
    st.sampled_from(["1e3", "2.5e-4", "1_000", ".5", "3."]),
)


def sums(leaves: st.SearchStrategy[str]) -> st.SearchStrategy[str]:
    return st.recursive(
        leaves,
        lambda inner: st.one_of(
            st.tuples(inner, st.sampled_from(["+", "-", "*", "/"]), inner).map(lambda t: f"({t[0]} {t[1]} {t[2]})"),
            inner.map(lambda e: f"-{e}"),
            st.tuples(inner, st.integers(0, 3)).map(lambda t: f"({t[0]})**{t[1]}"),
        ),
        max_leaves=8,
    )


def exact(node: ast.expr, source: str) -> Fraction:
    """Compute with fractions, by another way than the library: decimal texts, one operator at a time."""
    if isinstance(node, ast.Constant):
        return Fraction(str(ast.get_source_segment(source, node)).replace("_", ""))
    if isinstance(node, ast.UnaryOp):
        return -exact(node.operand, source)
    assert isinstance(node, ast.BinOp)
    table: dict[type, Callable[[Any, Any], Any]] = {
        ast.Add: operator.add,
        ast.Sub: operator.sub,
        ast.Mult: operator.mul,
        ast.Div: operator.truediv,
    }
    left, right = exact(node.left, source), exact(node.right, source)
    return left ** int(right) if isinstance(node.op, ast.Pow) else table[type(node.op)](left, right)


@given(sums(NUMBERS))
def test_pure_numbers_are_exact(text: str) -> None:
    """Fractions, rounded once; a division by zero is refused in words."""
    try:
        wanted = float(exact(ast.parse(text, mode="eval").body, text))
    except ZeroDivisionError:
        with raises_code("expression.no-finite-value", ExpressionError):
            Expression.parse(text)
        return
    literal = Expression.parse(text).literal
    assert literal is not None
    assert literal.value == wanted


@given(sums(st.sampled_from(["x", "y", "part.area", "2.5"])), st.floats(0.5, 3.0), st.floats(0.5, 3.0))
def test_names_against_pythons_own_arithmetic(text: str, x: float, y: float) -> None:
    values = {"x": x, "y": y, "part.area": 1.25}
    spelled = text.replace("part.area", "1.25")
    try:
        wanted = eval(spelled, {"__builtins__": {}}, {"x": x, "y": y})  # the reference; the library itself never evaluates text
    except (ZeroDivisionError, OverflowError) as error:
        with pytest.raises((type(error), ExpressionError)):  # of numbers alone, it is refused when it is read
            Expression.parse(text).evaluate(values.__getitem__)
        return
    expression = Expression.parse(text)
    if expression.literal is None:
        assert expression.evaluate(values.__getitem__) == wanted


def test_values_of_the_document() -> None:
    assert Expression.parse("1*(15*0.015) [W]").literal.value == 0.225  # type: ignore[union-attr]
    assert Expression.parse("0.001406 + 1.08*0.002592 [m^2]").literal.value == 0.00420536  # type: ignore[union-attr]
    assert Expression.parse("  2.5 [W] ").literal.value == 2.5  # type: ignore[union-attr]
    assert Expression.parse("0x1F").literal.value == 31.0  # type: ignore[union-attr]
    assert Expression.parse("inf [K/W]").literal.value == float("inf")  # type: ignore[union-attr]


def test_names_in_order_once() -> None:
    assert Expression.parse("(1 - x)*skin.area + x*b").names == ("x", "skin.area", "b")


def test_a_logarithm_of_one_number_that_is_not_positive_is_refused() -> None:
    """Not NaN, which a network would take for a value."""
    for value in (-1.0, 0.0, Dual(-1.0, np.array([1.0]))):
        with pytest.raises(ArithmeticError):
            Expression.parse("2*log(x)").evaluate({"x": value}.__getitem__)


def test_arrays_and_duals_go_through() -> None:
    expression = Expression.parse("area*htc**2/2")
    found = expression.evaluate({"area": Dual(3.0, np.array([1.0])), "htc": 2.0}.__getitem__)
    assert (found.value, found.gradient[0]) == (6.0, 2.0)
    assert expression.evaluate({"area": np.array([1.0, 2.0]), "htc": 2.0}.__getitem__).tolist() == [2.0, 4.0]


@pytest.mark.parametrize(
    ("text", "of", "result"),
    [
        ("a*h", {"a": "m^2", "h": "W/(m^2 K)"}, "W/K"),
        (" a**2 ", {"a": "m"}, "m^2"),
        ("v**(1/3)", {"v": "m^3"}, "m"),
        ("-a + b*c", {"a": "m", "b": "m", "c": "1"}, "m"),
        ("2**n", {"n": "1"}, "1"),
    ],
)
def test_dimension_by_algebra(text: str, of: dict[str, str], result: str) -> None:
    assert Expression.parse(text).dimension(lambda name: unit(of[name]).dimension) == unit(result).dimension


@pytest.mark.parametrize(
    ("text", "code", "message"),
    [
        ("a + b", "expression.mixed-dimensions", r"'a \+ b'"),
        ("2*(a - 1)", "expression.mixed-dimensions", "'a - 1'"),
        ("2**a", "expression.exponent-not-plain", ""),
        ("a**n", "expression.exponent-not-plain", ""),
    ],
)
def test_dimensions_that_do_not_fit(text: str, code: str, message: str) -> None:
    of = {"a": unit("m").dimension, "b": unit("W").dimension, "n": unit("1").dimension}
    with raises_code(code, ExpressionError, match=message):
        Expression.parse(text).dimension(of.__getitem__)


@pytest.mark.parametrize(
    "text",
    [
        "__import__('os').system('true')",
        "().__class__.__base__.__subclasses__()",
        "x.__class__",
        "x.__init__.__globals__",
        "open('f')",
        "exec('1')",
        "(lambda: 1)()",
        "x if y else 1",
        "f'{x}'",
        "'text'",
        "x and y",
        "not x",
        "~x",
        "x // 2",
        "x % 2",
        "x @ y",
        "1 < 2",
        "1j",
        "True",
        "...",
        "x, y",
        "{}",
        "*x",
    ],
)
def test_runs_no_code(text: str) -> None:
    with raises_code("expression.not-arithmetic", ExpressionError):
        Expression.parse(text)


@pytest.mark.parametrize(
    "text", ["x := 3", "import os", "x; y", "", "   ", "[W]", "5W", "2 W", "in", "x\0", "(" * 300, "2 +", "def f(): 1"]
)
def test_unreadable(text: str) -> None:
    with raises_code("expression.not-arithmetic", ExpressionError):
        Expression.parse(text)


@pytest.mark.parametrize(("text", "meant"), [("3h", "3 [h]"), ("0.05 m^2", "0.05 [m^2]"), ("5 W/(m^2 K)", "2.5 [W]"), ("2 +", "2.5 [W]")])
def test_a_unit_without_brackets_is_shown_with_them(text: str, meant: str) -> None:
    with pytest.raises(ExpressionError, match=re.escape(f"its unit, '{meant}', or")):
        Expression.parse(text)


@pytest.mark.parametrize(
    "text", ["9**9**9**9", "2**65", "1e999999999", "1e-999999999", "1/0", "0**-1", "(-1)**0.5 [m]", "1e308*1e308", "2*1e401 [W]"]
)
def test_no_finite_value(text: str) -> None:
    """Refused at once: nothing here may take long or fill the memory."""
    with raises_code("expression.no-finite-value", ExpressionError):
        Expression.parse(text)


def test_roots_of_pure_numbers() -> None:
    assert Expression.parse("4**0.5").literal.value == 2.0  # type: ignore[union-attr]
    assert Expression.parse("2**(1/3) [m]").literal.value == pytest.approx(2 ** (1 / 3), rel=1e-15)  # type: ignore[union-attr]


@pytest.mark.parametrize(
    ("text", "code", "message"),
    [
        ("2*area [m^2]", "expression.unit-misplaced", ""),
        ("2 [m] [m]", "expression.unit-misplaced", r"'2 \[m\] \[m\]'.*'\(0\.5 \+ 1\) \[m\]'"),
        ("2 [m] + 1 [m]", "expression.unit-misplaced", ""),
        ("[y for y in x] + 1", "expression.unit-misplaced", ""),
        ("x[0] + 1", "expression.unit-misplaced", ""),
        ("2 [W", "expression.unit-misplaced", ""),
        ("1" + "+1" * 500, "expression.not-arithmetic", ""),
        ("-" * 1500 + "1", "expression.not-arithmetic", ""),
        ("f(" + "-" * 1500 + "1)", "expression.not-arithmetic", ""),
        ("not " * 400 + "1", "expression.not-arithmetic", ""),
        ("10**10**10", "expression.no-finite-value", ""),
        ("(" + "*".join(["9**60"] * 60) + ")**60", "expression.no-finite-value", ""),
        ("1" * 2001, "cap.exceeded", "2001.*2000"),
    ],
)
def test_other_refusals(text: str, code: str, message: str) -> None:
    with raises_code(code, ExpressionError, match=message):
        Expression.parse(text)


def test_messages_stay_short() -> None:
    with pytest.raises(ExpressionError) as caught:
        Expression.parse("f(" + "x" * 1500 + ")")
    assert len(str(caught.value)) < 400


def test_unknown_unit_of_a_number() -> None:
    with raises_code("unit.unknown", UnitError, match=r"'\[Wat\]'"):
        Expression.parse("2 [Wat]")


def test_root_of_a_negative_value() -> None:
    with pytest.raises(ArithmeticError):
        Expression.parse("x**0.5").evaluate({"x": -2.0}.__getitem__)


def test_nothing_is_evaluated_by_reading() -> None:
    """No attack leaves a module loaded."""
    sys.modules.pop("antigravity", None)
    with pytest.raises(ExpressionError):
        Expression.parse("__import__('antigravity')")
    assert "antigravity" not in sys.modules


@pytest.mark.parametrize("text", ["0,4 [kg]", "0,4", "1 + 0,25 [m]"])
def test_a_decimal_comma_is_shown_with_a_point(text: str) -> None:
    with pytest.raises(ExpressionError, match=rf"write numbers with a decimal point: '{re.escape(text.replace(',', '.'))}'"):
        Expression.parse(text)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("sqrt(2)", math.sqrt(2)),
        ("exp(-1.5)", math.exp(-1.5)),
        ("log(7.5)", math.log(7.5)),
        ("abs(1 - 3) [m]", 2.0),
        ("min(3, 2, 5) [W]", 2.0),
        ("max(3, 2, 5)", 5.0),
        ("pi/4*0.02**2 [m^2]", math.pi / 4 * 0.02**2),
    ],
)
def test_functions_of_pure_numbers(text: str, value: float) -> None:
    literal = Expression.parse(text).literal
    assert literal is not None
    assert literal.value == pytest.approx(value, rel=1e-15)


FORMULAS = [
    ("pi*x**2", lambda x, y: math.pi * x**2),
    ("sqrt(x*y)", lambda x, y: (x * y) ** 0.5),
    ("exp(-x/y)", lambda x, y: np.exp(-x / y)),
    ("log(x/y)**2", lambda x, y: np.log(x / y) ** 2),
    ("abs(x - y)", lambda x, y: (x - y) if x.real > y.real else y - x),
    ("min(x, 2*y, 3 [m])", lambda x, y: min(x, 2 * y, 3.0, key=np.real)),
    ("max(x, y) + 20 [cm]", lambda x, y: max(x, y, key=np.real) + 0.2),
    ("x - 2 [mm] + 1e-3 [m]*y/y", lambda x, y: x - 2e-3 + 1e-3),
]


@pytest.mark.parametrize(("text", "formula"), FORMULAS)
@pytest.mark.parametrize(("x", "y"), [(0.7, 0.2), (0.2, 0.7), (5.0, 4.0)])
def test_functions_and_their_derivatives(text: str, formula: Callable[..., Any], x: float, y: float) -> None:
    """Against complex steps of the formula; in arrays as in single numbers."""
    read = Expression.parse(text)
    assert read.names == tuple(n for n in ("x", "y") if n in text.replace("max", "").replace("exp", ""))
    values = {"x": Dual(x, np.array([1.0, 0.0])), "y": Dual(y, np.array([0.0, 1.0]))}
    found = read.evaluate(values.__getitem__)
    step = 1e-30
    slopes = [formula(complex(x, step), complex(y)).imag / step, formula(complex(x), complex(y, step)).imag / step]
    assert value_of(found) == pytest.approx(formula(complex(x), complex(y)).real, rel=1e-14)
    np.testing.assert_allclose(gradient_of(found, 2), slopes, rtol=1e-12, atol=1e-15)
    arrays = read.evaluate({"x": np.array([x, y]), "y": np.array([y, y])}.__getitem__)
    assert arrays[0] == pytest.approx(value_of(found), rel=1e-14)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("exp(x)", "'x'"),
        ("log(x)", "'x'"),
        ("min(x, p)", r"'min\(x, p\)'"),
        ("x + 2 [W]", ""),
    ],
)
def test_dimensions_of_functions(text: str, message: str) -> None:
    of = {"x": unit("m").dimension, "p": unit("W").dimension}
    with raises_code("expression.mixed-dimensions", ExpressionError, match=message):
        Expression.parse(text).dimension(of.__getitem__)
    assert Expression.parse("sqrt(x*x)").dimension(of.__getitem__) == of["x"]


def test_a_constant_power_of_a_product_beside_a_number_with_a_unit() -> None:
    """The exponent was read at its place in another text: it was refused, and a message named a number `__quantity0`."""
    of = {"U": unit("V").dimension, "I": unit("A").dimension}
    for text in ("0.00095 [1/W]*(U*I)**2", "2.5 [W] + 0.1 [1/W]*(U*I)**2", "(U*I)**(1/2 + 1.5)/1 [W]", "(U*I)**-1*(3 [W])**2"):
        assert Expression.parse(text).dimension(of.__getitem__) == unit("W").dimension
    with raises_code("expression.mixed-dimensions", ExpressionError, match=r"'3 \[K\] \+ U \* I'"):
        Expression.parse("3 [K] + U*I").dimension(of.__getitem__)
    with raises_code("expression.mixed-dimensions", ExpressionError, match=r"'max\(U \* I, 3 \[K\]\)'"):
        Expression.parse("max(U*I, 3 [K])").dimension(of.__getitem__)


@pytest.mark.parametrize(
    ("text", "code", "message"),
    [
        ("min(x)", "expression.not-arithmetic", "1"),
        ("sqrt(x, 2)", "expression.not-arithmetic", "2"),
        ("sqrt(x=2)", "expression.not-arithmetic", ""),
        ("x.sqrt(2)", "expression.not-arithmetic", ""),
        ("t + 20 [degC]", "expression.scale-in-arithmetic", r"'20 \[degC\]'"),
        ("in__word.x + 1", "expression.not-arithmetic", ""),
        ("__quantity0*x + 2 [m]", "expression.not-arithmetic", ""),
        ("exp(1000)", "expression.no-finite-value", ""),
        ("log(0)", "expression.no-finite-value", ""),
        ("log(-2)", "expression.no-finite-value", ""),
        ("sqrt(-1)", "expression.no-finite-value", ""),
    ],
)
def test_functions_refused(text: str, code: str, message: str) -> None:
    with raises_code(code, ExpressionError, match=message):
        Expression.parse(text)


def test_nodes_may_be_called_as_words_of_the_language() -> None:
    """A duct has `in` and `from`; they stand in paths, where no word of the language can be meant."""
    deck = {
        "title": "duct",
        "needs": ["room"],
        "parameters": {"heat": "2*in.capacitance"},
        "nodes": {"in": {"capacitance": "10 [J/K]"}, "from": {"capacitance": "heat + 1 [J/K]"}},
        "conductors": {
            "wall": {"kind": "conduction", "between": ["in", "from"], "conductance": "1 [W/K]"},
            "film": {"kind": "convection", "between": ["from", "room"], "htc": "5 [W/(m^2 K)]", "area": "pi/4*(0.2)**2*side"},
        },
    }
    deck["parameters"]["side"] = "2 [m^2]"  # type: ignore[index]
    model = td.model_from_dict(deck)
    assert ParameterSet(model).evaluate({})["from.capacitance"] == pytest.approx(21.0)
    moved = model.with_values({"in.capacitance": "30 [J/K]"})
    assert ParameterSet(moved).evaluate({})["from.capacitance"] == pytest.approx(61.0)
    settled = td.steady(moved, td.Scenario(boundaries={"room": "20 [degC]"}))
    assert settled["from"] == pytest.approx(293.15)


def test_a_gap_in_a_proposed_line_asks_to_be_filled() -> None:
    with raises_code("expression.not-arithmetic"):
        Expression.parse("... [s]")
