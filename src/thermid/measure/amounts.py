"""Times above zero, and numbers and durations in the words of a report."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from math import floor, isfinite, log10

from thermid.base.errors import RecordError, ScenarioError
from thermid.base.expression import amount
from thermid.base.units import format_value

MINUTE, HOUR, DAY = 60.0, 3600.0, 86400.0
"""[s]"""
DEVIATION_OF_MEDIAN = 1.4826
"""Standard deviation of normal samples over the median of their absolute values (Hampel, J. Am. Stat. Assoc. 69 (1974) 383-393). [-]"""


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


def pairs(texts: Iterable[str], option: str) -> dict[str, str]:
    """Return ``NAME=VALUE`` texts as a dictionary; `option` is their place for messages.

    Raises
    ------
    ScenarioError   When one is of another form.
    """
    out = {}
    for text in texts:
        path, equals, value = text.partition("=")
        if not equals or not path.strip() or not value.strip():
            raise ScenarioError(f"'{text}' must be written as PATH=VALUE, such as air=24 [degC].", option, code="value.wrong-kind")
        out[path.strip()] = value.strip()
    return out


def with_unit(value: str, unit: str) -> str:
    """Return a value as text with `unit` behind it, unless it has a unit or is no number.

    >>> with_unit("5", "min"), with_unit("5 [h]", "min"), with_unit("end", "min")
    ('5 [min]', '5 [h]', 'end')
    """
    return value if "[" in value or not value.replace(".", "").replace("-", "").replace("e", "").isdigit() else f"{value} [{unit}]"
