"""Stamps as text: dates by day, month and year in any order, months by name, clock times of 12 and 24 hours, zones."""

from __future__ import annotations

import re
from datetime import UTC, datetime, timedelta
from typing import Final

CLOCK: Final = re.compile(r"(\d+):([0-5]\d):([0-5]\d(?:[.,]\d+)?)\Z", re.ASCII)
HALF_DAY_CLOCK: Final = re.compile(r"(\d{1,2}):([0-5]\d)(?::([0-5]\d(?:[.,]\d+)?))?\s*([AaPp])\.?\s?[Mm]\.?\Z", re.ASCII)
_ZONE: Final = r"(?:\s*(?P<zone>Z|UTC|GMT|[+-]\d\d:?\d\d))?"
_HOURS: Final = (
    r"(?:[T, ]+(?P<h>\d{1,2}):(?P<m>[0-5]\d)(?::(?P<s>[0-5]\d)(?:[.,:](?P<f>\d{1,9}))?)?"
    r"\s*(?:(?P<half>[AaPp])\.?\s?[Mm]\.?)?" + _ZONE + r")?\Z"
)
NUMERIC: Final = re.compile(r"(?P<a>\d{1,4})(?P<sign>[/.-])(?P<b>\d{1,2})(?P=sign)(?P<c>\d{1,4})\.?" + _HOURS, re.ASCII)
_WORD: Final = r"(?P<word>[A-Za-zÀ-ÿ]{3,10})\.?"
_NAMED: Final = re.compile(r"(?P<a>\d{1,2})[ ./-]+" + _WORD + r"[ ,./-]+(?P<c>\d{4}|\d\d)" + _HOURS)
_AMERICAN: Final = re.compile(_WORD + r" (?P<a>\d{1,2}),? (?P<c>\d{4})" + _HOURS)
_MONTHS: Final = {
    name: month
    for month, names in enumerate(
        "jan ene|feb fev|mar mär mrz|apr abr avr|may mai|jun|jul|aug ago aoû|sep set|oct okt out|nov|dec dez dic déc".split("|"), 1
    )
    for name in names.split()
}
ORDERS: Final = {"day/month/year": ("c", "b", "a"), "month/day/year": ("c", "a", "b"), "year/month/day": ("a", "b", "c")}
"""Which of the three numbers of a stamp are year, month and day."""


def is_date(text: str) -> bool:
    """Whether a text is a date without a clock time."""
    match = NUMERIC.match(text) or _NAMED.match(text) or _AMERICAN.match(text)
    return match is not None and match["h"] is None and len(text) >= 6


def is_stamp(text: str) -> bool:
    """Whether a text is a date with a clock time."""
    plain = text.strip()
    match = NUMERIC.match(plain) or _NAMED.match(plain) or _AMERICAN.match(plain)
    if match is not None:
        return match["h"] is not None
    try:
        return len(plain) > 10 and datetime.fromisoformat(plain) is not None
    except ValueError:
        return False


def is_iso(text: str) -> bool:
    """Whether a text is an ISO 8601 stamp."""
    try:
        datetime.fromisoformat(text)
    except ValueError:
        return False
    return True


def zone_of_stamp(text: str) -> str:
    """Return the time zone at the end of a stamp; empty where it has none."""
    match = re.search(r"(Z|UTC|GMT|[+-]\d\d:?\d\d)\s*\Z", text)
    return match[1] if match and ":" in text else ""


def zone_of_header(header: str) -> str:
    """Return the time zone that the header of a time column names, such as GMT-05:00."""
    match = re.search(r"\b((?:GMT|UTC)(?:[+-]\d{1,2}(?::?\d\d)?)?)", header)
    return match[1] if match else ""


def of_day(match: re.Match[str]) -> float:
    """Return the seconds since midnight of a stamp."""
    if match["h"] is None:
        return 0.0
    hour = int(match["h"])
    if match["half"]:
        hour = hour % 12 + (12 if match["half"] in "Pp" else 0)
    fraction = float(f"0.{match['f']}") if match["f"] else 0.0
    return 3600.0 * hour + 60.0 * int(match["m"]) + int(match["s"] or 0) + fraction - _offset(match["zone"])


def _offset(zone: str | None) -> float:
    if not zone or zone[0] not in "+-":
        return 0.0
    digits = zone[1:].replace(":", "")
    return (1.0 if zone[0] == "+" else -1.0) * (3600.0 * int(digits[:2]) + 60.0 * int(digits[2:] or 0))


def _years(text: str) -> int:
    return int(text) if len(text) > 2 else 2000 + int(text)


def day_number(year: str, month: str, day: str) -> int | None:
    """Return the number of a day, or None where there is no such day."""
    if len(month) > 2 or len(day) > 2 or len(year) == 3:
        return None
    try:
        return datetime(_years(year), int(month), int(day)).toordinal()
    except ValueError:
        return None


def one_stamp(text: str) -> datetime:
    """Return an ISO 8601 stamp, or one with the month as a word."""
    if text[:1].isdigit() and text[4:5] in "-0123456789":
        return datetime.fromisoformat(text)
    match = _NAMED.match(text) or _AMERICAN.match(text)
    if match is None:
        return datetime.fromisoformat(text)
    month = _MONTHS.get(match["word"].lower()[:3])
    if month is None:
        raise ValueError("no month")
    day = datetime(_years(match["c"]), month, int(match["a"]), tzinfo=UTC if match["zone"] else None)
    return day + timedelta(seconds=of_day(match))
