"""Text with a unit in, SI number out, and back.

Numbers are SI inside (R3 of the design): kelvin, watt, metre, kilogram, second. A unit is text at the border only. Conversion is
exact (fractions) and rounded to a float once, so that ``25.4 [mm]`` and ``1 [in]`` are the same number. About 80 common units come from a
generated table; pint, which takes half a second to load, is asked for the rest.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from math import floor, isfinite, log10
from typing import Final, TypeVar

import numpy as np
from numpy.typing import NDArray

from thermid.base._units_table import TABLE
from thermid.base.errors import UnitError, cap, nearest, raising, refuse_first

Dimension = tuple[Fraction, ...]
"""Exponents of metre, kilogram, second, ampere and kelvin."""

ICE_POINT: Final = 273.15
"""Zero of the Celsius scale. [K]"""

MINUTE, HOUR, DAY = 60.0, 3600.0, 86400.0
"""[s]"""

TEMPERATURE: Final = "temperature"
"""The slot of a temperature on the scale (``24 [degC]`` or ``297.15 [K]``); the slot ``K`` is a difference of temperatures."""

NAMES: Final = {
    "1": "a plain number",
    "m": "a length",
    "m^2": "an area",
    "m^3": "a volume",
    "kg": "a mass",
    "s": "a time",
    "K": "a temperature difference",
    "W": "a power",
    "V": "a voltage",
    "A": "a current",
    "V/K": "a Seebeck coefficient",
    "V/A": "an electrical resistance",
    "J": "an energy",
    "Pa": "a pressure",
    "W/(m^2 K)": "a heat transfer coefficient",
    "W/(m K)": "a conductivity",
    "W/K": "a conductance",
    "K/W": "a thermal resistance",
    "J/K": "a capacitance",
    "J/(kg K)": "a specific heat",
    "kg/m^3": "a density",
    "kg/s": "a mass flow",
    "W/m^2": "a heat flux",
    "1/K": "a temperature coefficient",
    "1/K^2": "a quadratic temperature coefficient",
    "m/s^2": "an acceleration",
    "K/s": "a rate of temperature change",
    "m^2 K/W": "an area resistance",
}


_SPELT: Final = {"Celsius": "degC", "Centigrade": "degC", "deg*C": "degC", "Fahrenheit": "degF", "deg*F": "degF", "Kelvin": "K"}
"""Units as people write them, and how they are written here."""
_FLOWS: Final = {"cfm": "ft^3/min", "lfm": "ft/min", "gpm": "gal/min", "lpm": "l/min"}
"""Flows by their initials, and how they are written here; pint reads cfm as a hundredth of a femtometre."""


@dataclass(frozen=True)
class Unit:
    """A unit as text, with its exact factor and offset to SI and its dimension."""

    text: str
    factor: Fraction
    offset: Fraction
    dimension: Dimension

    @property
    def absolute(self) -> bool:
        """Whether the unit is a temperature scale with an offset, such as degC."""
        return self.offset != 0


def _normalised(text: str) -> str:
    """Write products with one sign: ``W/(m^2 K)`` -> ``W/(m^2*K)``."""
    for old, new in (
        ("**", "^"),
        ("·", "*"),
        ("²", "^2"),
        ("³", "^3"),
        ("°C", "degC"),
        ("℃", "degC"),
        ("°F", "degF"),
        ("℉", "degF"),
        ("percent", "%"),
    ):
        text = text.replace(old, new)
    # m2 and cm3 are how loggers and data sheets write areas and volumes
    parts = (
        re.sub(r"\b([cdm]?m|ft|in)([23])\b", r"\1^\2", text)
        .replace("(", " ( ")
        .replace(")", " ) ")
        .replace("/", " / ")
        .replace("*", " ")
        .split()
    )
    out = ""
    for part in parts:
        if out and part not in ")/" and out[-1] not in "(/":
            out += "*"
        out += part
    return out


@lru_cache(maxsize=512)
def unit(text: str) -> Unit:
    """Return the unit that a text names.

    Raises
    ------
    UnitError   When nobody knows the unit, or a temperature scale stands inside a compound unit.

    Examples
    --------
    >>> unit("mm").factor
    Fraction(1, 1000)
    """
    if not isinstance(text, str):
        raise UnitError(f"a unit is a text such as 'W', not {text!r:.60}.", code="value.wrong-kind")
    if len(text) > cap("unit"):
        raise UnitError(
            f"'[{text[:40]}...]' is not a known unit: it has {len(text)} characters, the limit is {cap('unit'):.0f}.{raising('unit')}",
            code="cap.exceeded",
        )
    key = "1" if text.strip() == "-" else _normalised(text) or "1"  # a dash says that there is none
    row = TABLE.get(key)
    if row is not None:
        return Unit(text.strip() or "1", Fraction(row[0], row[1]), Fraction(row[2], row[3]), tuple(Fraction(d) for d in row[4]))
    for scale, instead in (("degC", "K"), ("degF", "degR")):
        if scale in key:
            raise UnitError(
                f"'[{text}]' multiplies or divides the scale {scale}, which has an offset. Write {instead}: a difference of 1 {scale} "
                f"equals 1 {instead}.",
                code="unit.scale-in-product",
            )
    if key in _SPELT:
        raise UnitError(f"'[{text}]' is not a known unit. Write [{_SPELT[key]}].", code="unit.unknown")
    for flow in re.findall(r"\w+", key):
        if flow.lower() in _FLOWS:
            raise UnitError(f"'[{text}]' is not a known unit. Write {_FLOWS[flow.lower()]} for {flow}.", code="unit.unknown")
    refuse_first(
        "",
        (re.search(r"/\(?mK\b", key), f"'[{text}]': mK is the millikelvin. Write (m K) for metres times kelvin.", "unit.ambiguous"),
        (re.search(r"\bgr\b", key), f"'[{text}]': gr is the grain, 0.0648 g. Write g for grams, or grain.", "unit.ambiguous"),
        error=UnitError,
    )
    # refuse exponents that no physical unit has: their powers of ten would be computed digit by digit
    for exponent in _EXPONENT.findall(key):
        if exponent[:1].isdigit() or exponent[:1] == "-":
            if not _PLAIN_EXPONENT.match(exponent) or abs(float(exponent)) > cap("exponent"):
                raise UnitError(
                    f"'[{text}]' is not a known unit: it has the exponent {exponent}. "
                    f"Exponents go up to {cap('exponent'):.0f}, as plain numbers with at most one decimal."
                    f"{_intended(key)}{raising('exponent')}",
                    code="unit.unknown",
                )
    return _from_pint(text, key)


_EXPONENT = re.compile(r"\^([^*/()^]*)")
_PLAIN_EXPONENT = re.compile(r"-?\d{1,2}(?:\.\d)?\Z", re.ASCII)
# names with small powers, * / and parentheses: pint would compute a tower of powers, read raised digits as powers, and other text as code
_LETTER = "[A-Za-zµμΩΩÅ°_]"
_READABLE = re.compile(rf"(?:{_LETTER}(?:{_LETTER}|\d)*+(?:\^-?\d{{1,2}}(?:\.\d)?(?![\w.]))?+|1(?=/)|%|[*/()])+\Z", re.ASCII)


def _intended(key: str) -> str:
    """Return `` Did you mean ...?`` for a unit without its signs, such as ``W/m2K``; an empty text where that gives no known one."""
    spaced = re.sub(r"(?<=[A-Za-z])(-?\d)", r"^\1", key)
    spaced = re.sub(r"(\^-?\d)(?=[A-Za-z])", r"\1*", spaced)
    spaced = re.sub(r"\b(kg|g|m)(?=K\b)", r"\1*", spaced)
    head, *below = re.sub("[()]", "", spaced).split("/")
    factors = [f for part in below for f in part.split("*") if f]
    guess = head + (f"/({'*'.join(factors)})" if len(factors) > 1 else f"/{factors[0]}" if factors else "")
    try:
        is_unit = guess != key and key.count("(") == key.count(")") and unit(guess) is not None
    except UnitError:
        is_unit = False
    return f" Did you mean '{guess.replace('*', ' ')}'?" if is_unit else ""


def _from_pint(text: str, key: str) -> Unit:
    """Ask pint for a unit that the table does not hold."""
    from tokenize import TokenError

    import pint

    dimensions = ("[length]", "[mass]", "[time]", "[current]", "[temperature]")
    unknown = UnitError(f"'[{text}]' is not a known unit.{_intended(key) or nearest(key, TABLE).replace('*', ' ')}", code="unit.unknown")
    if not _READABLE.match(key) or key.count("(") != key.count(")"):
        raise unknown
    try:
        name = key.replace("^", "**").replace("%", "percent")
        zero, quantity, two = (_registry().Quantity(Fraction(n), name).to_base_units() for n in (0, 1, 2))
        factor, offset = Fraction(quantity.magnitude) - Fraction(zero.magnitude), Fraction(zero.magnitude)
        if Fraction(two.magnitude) - Fraction(quantity.magnitude) != factor:
            raise ValueError("a logarithmic unit")
        dimension = tuple(Fraction(quantity.dimensionality.get(d, 0)) for d in dimensions)
        strange = set(map(str, quantity.dimensionality)) - set(dimensions)
    except (
        pint.PintError,
        TokenError,
        AssertionError,
        AttributeError,
        ArithmeticError,
        LookupError,
        SyntaxError,
        TypeError,
        ValueError,
    ) as error:
        raise unknown from error
    if strange:
        raise UnitError(
            f"'[{text}]' has a dimension that does not occur in a thermal network: {', '.join(sorted(strange))}.", code="unit.not-thermal"
        )
    return Unit(text.strip(), factor, offset, dimension)


@lru_cache(maxsize=1)
def _registry():  # type: ignore[no-untyped-def]  # pint's registry type is dynamic
    """Return the registry of pint with exact factors, made once."""
    import pint

    return pint.UnitRegistry(non_int_type=Fraction)


DIMENSIONLESS: Final = unit("1").dimension


def si_unit(dimension: Dimension) -> str:
    """Return the SI unit of a dimension: its usual name, such as ``W/(m^2 K)``, or base units; 1 for a plain number."""
    bases = " ".join(f"{b}^{e}" if e != 1 else b for b, e in zip(("m", "kg", "s", "A", "K"), dimension, strict=True) if e)
    return next((text for text in NAMES if unit(text).dimension == dimension), bases or "1")


def describe(dimension: Dimension) -> str:
    """Return a dimension in words, such as 'an area', or in base units where it has no name."""
    for text, name in NAMES.items():
        if unit(text).dimension == dimension:
            return name
    bases = ("m", "kg", "s", "A", "K")
    return "a quantity in " + " ".join(f"{b}^{e}" if e != 1 else b for b, e in zip(bases, dimension, strict=True) if e)


def require(dimension: Dimension, slot: str, written: str = "", absolute: bool = False) -> None:
    """Check a dimension against a slot.

    Parameters
    ----------
    dimension : Dimension   What was given.
    slot : str              A unit text, or `TEMPERATURE` for a temperature on the scale.
    written : str           The unit text as written, for the message.
    absolute : bool         Whether it was written on a temperature scale with an offset.

    Raises
    ------
    UnitError   When they differ, or a temperature on the scale is given where a difference is needed.
    """
    wanted = unit("K" if slot == TEMPERATURE else slot)
    if dimension != wanted.dimension:
        what = (
            f"'[{written}]' is {'a temperature' if absolute else describe(dimension)}"
            if written and written != "1"
            else f"this is {describe(dimension)}"
        )
        need = "a temperature [degC] or [K]" if slot == TEMPERATURE else f"{describe(wanted.dimension)} [{slot}]"
        bare = dimension == DIMENSIONLESS and written in ("", "1")
        shown = f' Write its unit with it: "2.5 [{"degC" if slot == TEMPERATURE else slot}]".' if bare else ""
        raise UnitError(f"{what}; {need} is needed here.{shown}", code="unit.wrong-dimension")
    refuse_first(
        "",
        (
            slot == TEMPERATURE and written.startswith("delta"),
            f"'[{written}]' is a temperature difference; a temperature [degC] or [K] is needed here.",
            "unit.wrong-dimension",
        ),
        (
            absolute and slot != TEMPERATURE,
            f"'[{written}]' is a temperature in degC or degF; a temperature difference is needed here. Write it in [K].",
            "unit.scale-for-difference",
        ),
        error=UnitError,
    )


@lru_cache(maxsize=512)
def require_unit(of: Unit, slot: str) -> None:
    """Check the unit that a number was written in against a slot; one that fits is looked at once.

    Raises
    ------
    UnitError   As `require`.
    """
    require(of.dimension, slot, of.text, of.absolute)


def to_si(value: Fraction, of: Unit) -> float:
    """Return an exact number of some unit as an SI float, rounded once."""
    return float(value * of.factor + of.offset)


N = TypeVar("N", float, NDArray[np.float64])
"""A number or an array of them."""


def from_si(values: N, of: str | Unit) -> N:
    """Return SI numbers in a unit for people; an empty text is the unit 1."""
    of = unit(of) if isinstance(of, str) else of
    return (values - float(of.offset)) / float(of.factor)


def in_si(values: N, of: str | Unit) -> N:
    """Return numbers in a unit as SI numbers."""
    of = unit(of) if isinstance(of, str) else of
    return values * float(of.factor) + float(of.offset)


def counted(number: int, noun: str) -> str:
    """Return a number of things in words.

    >>> counted(1, "test"), counted(3, "test")
    ('1 test', '3 tests')
    """
    return f"{number} {noun}{'' if number == 1 else 's'}"


def format_value(value: float, text: str, digits: int = 6) -> str:
    """Return an SI value in a unit, as text with the unit.

    >>> format_value(297.15, "degC"), format_value(0.3, "1")
    ('24 [degC]', '0.3')
    """
    return f"{from_si(value, text):.{digits}g} [{unit(text).text}]".removesuffix(" [1]")


def duration_text(value: float) -> str:
    """Return a time [s] as text in h from 2 h, in min from 2 min, else in s, with four digits.

    >>> duration_text(18000.0)
    '5 h'
    """
    for size, name in ((HOUR, "h"), (MINUTE, "min")):
        if value >= 2.0 * size:
            return f"{value / size:.4g} {name}"
    return f"{value:.4g} s"


def digits(value: float, error: float) -> str:
    """Return a number with the decimals that give its error two digits; with six digits where the error is zero or not finite.

    >>> digits(1.23456, 0.012)
    '1.235'
    """
    if not isfinite(error) or error <= 0:
        return f"{value:.6g}"
    decimals = max(0, 1 - floor(log10(error)))
    return f"{value:.{decimals}f}" if abs(value) < 1e6 and decimals < 12 else f"{value:.6g}"


def short(number: float, digits: int = 2) -> str:
    """Return a number with some significant digits, without a power of ten below ten million.

    >>> short(557.3), short(0.05574), short(1027.26, 3), short(3e9)
    ('560', '0.056', '1030', '3e+09')
    """
    text = f"{number:.{digits}g}"
    return f"{float(text):.0f}" if "e+" in text and abs(number) < 1e7 else text


def some(names: Sequence[str], noun: str) -> str:
    """Return up to four names joined by commas; of more the first, the last and the number.

    >>> some(["a", "b", "c", "d", "e"], "records")
    'a ... e (5 records)'
    """
    return ", ".join(names) if len(names) <= 4 else f"{names[0]} ... {names[-1]} ({len(names)} {noun})"
