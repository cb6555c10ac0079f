"""Text to SI and back: exact, checked, and in words."""

from __future__ import annotations

import importlib.util
import time
from fractions import Fraction
from pathlib import Path

import pytest
from hypothesis import given, strategies as st

from by_code import raises_code
from thermid.base._units_table import TABLE
from thermid.base.errors import UnitError
from thermid.base.units import NAMES, TEMPERATURE, Expression, describe, format_value, quantity, require, si_unit, to_si, unit

SCRIPT = Path(__file__).parents[2] / "scripts/generate_units.py"


def test_table_is_what_pint_says() -> None:
    """Every row, exactly; and the table holds what the script asks for, nothing more."""
    import pint

    spec = importlib.util.spec_from_file_location("generate_units", SCRIPT)
    assert spec is not None
    assert spec.loader is not None
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    assert list(TABLE) == script.units()
    registry = pint.UnitRegistry(non_int_type=Fraction)
    for text, (n, d, on, od, dims) in TABLE.items():
        assert (Fraction(n, d), Fraction(on, od), dims) == script.row(registry, text), text


@pytest.mark.parametrize(
    ("text", "zero", "hundred"), [("degC", "273.15", "373.15"), ("degF", "255.372222222222222222", "310.927777777777777778")]
)
def test_scales_against_pint(text: str, zero: str, hundred: str) -> None:
    """The script writes the two offsets itself; pint's own conversion must agree."""
    import pint

    registry = pint.UnitRegistry(non_int_type=Fraction)
    for number, printed in ((0, zero), (100, hundred)):
        exact = Fraction(number) * unit(text).factor + unit(text).offset
        assert exact == Fraction(registry.Quantity(Fraction(number), text).to("kelvin").magnitude)
        assert float(exact) == pytest.approx(float(printed), rel=1e-15)


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ("25.4 [mm]", "1 [in]"),
        ("10 [mm]", "0.01 [m]"),
        ("0.1 [mm]", "0.0001 [m]"),
        ("29.2 [cm^2]", "0.00292 [m^2]"),
        ("20 [m3/h]", "20 [m^3/h]"),
        ("29.2 [cm2]", "29.2 [cm^2]"),
        ("1.2 [kW/m2]", "1.2 [kW/m^2]"),
        ("31.25 [K/h]", "0.520833333333333333333333333333333333 [K/min]"),
        ("24 [degC]", "297.15 [K]"),
        ("32 [degF]", "0 [degC]"),
        ("35 [%]", "0.35"),
    ],
)
def test_same_number_bit_for_bit(one: str, other: str) -> None:
    assert Expression.parse(one).literal.value == Expression.parse(other).literal.value  # type: ignore[union-attr]


@given(st.decimals(min_value="-1e6", max_value="1e6", places=6, allow_nan=False, allow_infinity=False))
def test_millimetres_are_metres_rounded_once(number: object) -> None:
    """Property 7: the float nearest to the exact value, whatever the unit."""
    written = Expression.parse(f"{number} [mm]").literal
    assert written is not None
    assert written.value == float(Fraction(str(number)) / 1000)


@given(st.sampled_from(sorted(TABLE)), st.fractions(min_value=-1000, max_value=1000, max_denominator=10**6))
def test_conversion_is_exact(text: str, number: Fraction) -> None:
    of = unit(text)
    assert to_si(number, of) == float(number * of.factor + of.offset)


@given(st.sampled_from(sorted(TABLE)), st.integers(min_value=-99999, max_value=99999))
def test_format_and_parse_are_inverse(text: str, number: int) -> None:
    value = to_si(Fraction(number), unit(text))
    literal = Expression.parse(format_value(value, text, digits=12)).literal
    assert literal is not None
    # twelve digits are printed; an offset of 273 K in the float costs the number at most 273/1e-12 of its last digit
    assert literal.value == pytest.approx(value, rel=1e-11, abs=abs(float(unit(text).offset)) * 1e-15)


def test_format_value() -> None:
    assert format_value(297.15, "degC") == "24 [degC]"
    assert format_value(0.00292, "cm^2") == "29.2 [cm^2]"
    assert format_value(0.3, "1") == "0.3"


@pytest.mark.parametrize(
    ("text", "factor", "offset"),
    [
        ("celsius", "1", "273.15"),
        ("°C", "1", "273.15"),
        ("inch", "0.0254", "0"),
        ("W m^-2 K^-1", "1", "0"),
        ("W / (m² K)", "1", "0"),
        ("m**2", "1", "0"),
    ],
)
def test_spellings_beyond_the_table(text: str, factor: str, offset: str) -> None:
    assert (unit(text).factor, unit(text).offset) == (Fraction(factor), Fraction(offset))


def test_fahrenheit_sign_is_the_scale() -> None:
    assert (unit("°F").factor, unit("°F").offset) == (unit("degF").factor, unit("degF").offset)
    assert unit("fahrenheit").offset == unit("degF").offset


def test_a_quantity_of_one_number_is_that_number_in_si() -> None:
    assert (float(quantity(3.0, unit="km")), float(quantity([3.0], unit="km"))) == (3000.0, 3000.0)
    with raises_code("value.wrong-kind", UnitError, match="2"):
        float(quantity([1.0, 2.0], unit="W"))


@pytest.mark.parametrize(
    ("text", "code", "message"),
    [
        (
            "degC/min",
            "unit.scale-in-product",
            r"'\[degC/min\]'.*1.*1",
        ),
        ("BTU/(h ft^2 degF)", "unit.scale-in-product", "degF.*Write"),
        ("W/degC", "unit.scale-in-product", ""),
        ("Wat", "unit.unknown", r"'\[Wat\]'.*'atm'"),
        ("W/(m^2 k K", "unit.unknown", r"'\[W/\(m\^2 k K\]'.*'W/\(m\^2 K\)'"),
        ("m^", "unit.unknown", r"'\[m\^\]'"),
        ("dBm", "unit.unknown", r"'\[dBm\]'"),
        ("mol", "unit.not-thermal", r"\[substance\]"),
    ],
)
def test_bad_units(text: str, code: str, message: str) -> None:
    with raises_code(code, UnitError, match=message):
        unit(text)


@pytest.mark.parametrize(
    "text",
    [
        "9^9^9^9 m",
        "m^9^9^9",
        "((m^99)^99)^99",
        "__import__('os').system('true')",
        "m.__class__",
        "lambda: 1",
        "m" * 500,
        "m" * 10_000_000,
        "cm^2e9",
        "cm^1e30",
        "cm^2E9",
        "cm^-1e30",
        "cm^9999999999",
        "cm^21",
        "cm^-20.5",
        "cm^2.55",
        "cm^2_9",
        "cm⁹⁹⁹⁹⁹⁹",
        "cm^⁹⁹⁹⁹⁹⁹",
        "cm^٩٩",
        "cm**9e9",
        "K/cm^9e9",
        "Ym^20" + " Ym^20" * 12 + " x",
        "a!" * 30,
        "2^99999999 m",
    ],
)
def test_a_unit_is_not_computed(text: str) -> None:
    """Towers of powers and code never reach pint's evaluator; what is refused is refused at once."""
    begun = time.process_time()
    with pytest.raises(UnitError, match=r"\[") as caught:
        unit(text)
    assert time.process_time() - begun < 2.0  # the first one loads pint
    assert caught.value.code in ("unit.unknown", "cap.exceeded")
    assert len(str(caught.value)) < 400


def test_the_largest_exponent_is_named() -> None:
    with raises_code("unit.unknown", UnitError, match=r"'\[cm\^2e9\]'.*2e9.*20"):
        Expression.parse("1 [cm^2e9]")
    assert unit("cm^20").factor == Fraction(1, 10**40)
    assert unit("m^0.5").dimension[0] == Fraction(1, 2)


@pytest.mark.parametrize(
    ("given_unit", "slot", "code", "message"),
    [
        ("m", "m^2", "unit.wrong-dimension", r"'\[m\]'.*\[m\^2\]"),
        ("W", "W/K", "unit.wrong-dimension", r"'\[W\]'.*\[W/K\]"),
        ("degC", "K", "unit.scale-for-difference", r"'\[degC\]'.*\[K\]"),
        ("degC", "W", "unit.wrong-dimension", r"'\[degC\]'.*\[W\]"),
        ("W", TEMPERATURE, "unit.wrong-dimension", r"'\[W\]'.*\[degC\].*\[K\]"),
        ("1", "m", "unit.wrong-dimension", r"\[m\]"),
        ("kg m^2", "kg", "unit.wrong-dimension", r"2.*\[kg\]"),
    ],
)
def test_wrong_dimension(given_unit: str, slot: str, code: str, message: str) -> None:
    of = unit(given_unit)
    with raises_code(code, UnitError, match=message):
        require(of.dimension, slot, given_unit, of.absolute)


@pytest.mark.parametrize(("text", "slot"), [("mm", "m"), ("degC", TEMPERATURE), ("K", TEMPERATURE), ("K", "K"), ("%", "1")])
def test_right_dimension(text: str, slot: str) -> None:
    of = unit(text)
    require(of.dimension, slot, text, of.absolute)


@pytest.mark.parametrize(("text", "si"), [("kJ", "J"), ("mW", "W"), ("ft", "m"), ("W/(mm^2 K)", "W/(m^2 K)"), ("m^4", "m^4"), ("%", "1")])
def test_a_dimension_has_its_usual_name_in_si_or_base_units(text: str, si: str) -> None:
    assert unit(si_unit(unit(text).dimension)) == unit(si)


def test_names_of_dimensions() -> None:
    for text, name in NAMES.items():
        assert describe(unit(text).dimension) == name


@pytest.mark.parametrize("text", ["gr", "J/(gr K)"])
def test_the_grain_is_no_gram(text: str) -> None:
    with raises_code("unit.ambiguous", UnitError, match=r"0\.0648"):
        unit(text)
    assert float(unit("grain").factor) == pytest.approx(6.479891e-5)


def test_a_dash_is_the_unit_of_a_pure_number() -> None:
    assert unit("-").dimension == unit("1").dimension
    assert (unit("-").factor, unit("-").offset) == (1, 0)
