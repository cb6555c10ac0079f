"""Derivatives of arithmetic against finite differences and against the rules of the book."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, strategies as st

from thermid.base.units import Dual, gradient_of, real_power, value_of

FORMULAS: dict[str, Callable[[Any, Any], Any]] = {
    "sum": lambda x, y: x + y + 2.0 + x,
    "number first": lambda x, y: 3.0 - x + 2.0 * y + 1.0 / x + 1.7**y,
    "difference": lambda x, y: x - y - 0.3,
    "product": lambda x, y: x * y * 1.3 * x,
    "quotient": lambda x, y: x / y + y / 3.0 - 2.0 / (x * y),
    "powers": lambda x, y: x**2 + y**-1 + x**0.5 + x**y,
    "signs": lambda x, y: -x + (+y) - (-x * y),
    "series of two": lambda x, y: x * y / (x + y),
    "radiation": lambda x, y: (x**2 + y**2) * (x + y),
    "constant power": lambda x, y: x**0 + y,
}


def duals(x: float, y: float) -> tuple[Dual, Dual]:
    return Dual(x, np.array([1.0, 0.0])), Dual(y, np.array([0.0, 1.0]))


@pytest.mark.parametrize("name", FORMULAS)
@given(x=st.floats(0.2, 5.0), y=st.floats(0.2, 5.0))
def test_against_finite_differences(name: str, x: float, y: float) -> None:
    formula = FORMULAS[name]
    got = formula(*duals(x, y))
    assert value_of(got) == pytest.approx(formula(x, y), rel=1e-14)
    for k, (dx, dy) in enumerate(((1.0, 0.0), (0.0, 1.0))):
        # five points: the error is of order h^4 of a smooth formula
        h = 2e-3
        f = [formula(x + n * h * dx, y + n * h * dy) for n in (-2, -1, 1, 2)]
        slope = (f[0] - 8.0 * f[1] + 8.0 * f[2] - f[3]) / (12.0 * h)
        assert gradient_of(got, 2)[k] == pytest.approx(slope, rel=1e-5, abs=1e-7)


def test_infinite_resistance_has_no_conductance_and_no_slope() -> None:
    g = 1.0 / Dual(math.inf, np.array([1.0]))
    assert g.value == 0.0
    assert g.gradient.tolist() == [0.0]
    assert (Dual(2.0, np.array([1.0])) / math.inf).gradient.tolist() == [0.0]


def test_negative_base_with_a_constant_exponent() -> None:
    cube = Dual(-2.0, np.array([1.0])) ** 3
    assert (cube.value, cube.gradient[0]) == (-8.0, 12.0)


def test_base_zero() -> None:
    x, y = duals(0.0, 2.0)
    assert (x**2).gradient.tolist() == [0.0, 0.0]
    assert (x**y).gradient.tolist() == [0.0, 0.0]
    assert (0.0**y).value == 0.0


def test_no_complex_numbers() -> None:
    x, y = duals(-2.0, 2.0)
    with pytest.raises(ArithmeticError, match="no real root"):
        x**0.5
    with pytest.raises(ArithmeticError, match="no real root"):
        real_power(-2.0, 0.5)
    with pytest.raises(ArithmeticError, match="no derivative over its exponent"):
        x**y
    with pytest.raises(ZeroDivisionError):
        Dual(0.0, np.zeros(1)) ** -1


def test_plain_numbers_have_no_gradient() -> None:
    assert value_of(3) == 3.0
    assert gradient_of(3.0, 2).tolist() == [0.0, 0.0]
