"""Numbers that remember how they were made: their text computes to their value, and the rows of a network keep theirs."""

from __future__ import annotations

import math

import pytest

import thermid as td
from thermid.interop._wired import Formula, Text, named, number_text, with_formulas
from unit.interop.networks import hot_box

A, B = named("a", 2.5), named("b", -3.0)


@pytest.mark.parametrize(
    ("formula", "text"),
    [
        (A - (B - A), "a - (b - a)"),
        (A - B - A, "a - b - a"),
        (A / (B / A), "a/(b/a)"),
        (A / B / A, "a/b/a"),
        (A * (B + 1), "a*(b + 1)"),
        (2 * (A + B), "2*(a + b)"),
        (-(A + B), "-(a + b)"),
        ((-B) ** 2, "(-b)**2"),
        (-(B**2), "-b**2"),
        ((A**2) ** 3, "(a**2)**3"),
        (A ** (B**2), "a**(b**2)"),
        (2.0**A, "2**a"),
        (A * -2.0, "a*(-2)"),
        (1 - A, "1 - a"),
        (1 / A, "1/a"),
        (1.0 * A / 1.0, "a"),
        (+A + 0.5, "a + 0.5"),
    ],
)
def test_the_text_computes_to_the_value(formula: Formula, text: str) -> None:
    written = Text(lambda path: path, "**").text_of(formula)
    assert written == text
    assert eval(written, {"a": 2.5, "b": -3.0}) == pytest.approx(float(formula), rel=1e-15)


def test_the_rows_keep_their_numbers() -> None:
    network = td.simulation.compile_network(hot_box())
    plain, made = network.numbers(), with_formulas(network)
    for one, other in zip((*plain.conductors, *plain.loads), (*made.conductors, *made.loads), strict=True):
        assert [float(c) for c in other.coefficients] == [float(c) for c in one.coefficients]
    glow = next(row for row in made.conductors if row.name == "glow")
    assert glow.coefficients[0].paths() == {"glow.emissivity", "glow.area"}  # type: ignore[union-attr]


def test_numbers_are_written_so_that_they_are_read_as_the_same() -> None:
    assert [number_text(x) for x in (3.0, 0.1, 1e-8, 1e22, math.inf, -math.inf)] == ["3", "0.1", "1e-08", "1e+22", "Inf", "-Inf"]
