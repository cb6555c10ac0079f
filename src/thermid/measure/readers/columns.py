"""Cells to names, units and numbers. A cell that is neither a number nor a known sign of a missing one stops the reader, with its line."""

from __future__ import annotations

import re
from functools import lru_cache
from typing import Final

import numpy as np

from thermid.errors import NameNotFoundError, RecordError, nearest
from thermid.measure.readers.textfile import MISSING, Cells
from thermid.measure.record.channel import FloatArray

_BRACKETS: Final = (("[", "]"), ("(", ")"), ("{", "}"), ("<", ">"))
_FRACTION = re.compile(r"\s*[+-]?(\d+[.,]\d*|[.,]\d+)([eE][+-]?\d+)?\s*\Z")
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?\Z|[+-]?inf(inity)?\Z", re.IGNORECASE | re.ASCII)
_UNUSED: Final = "\x1f"  # no text log has it: `textfile` refuses control characters
_DEGREE: Final = re.compile(
    r"(?:[°º˚]\s*|deg(?:rees?)?[ ._*]*)(c|f|k)(?:elsius|ahrenheit|elvin)?\Z|(c|f|k)(?:elsius|ahrenheit|elvin)\Z", re.IGNORECASE
)
_SPELT: Final = {
    "C": "degC",
    "F": "degF",
    "centigrade": "degC",
    "vdc": "V",
    "vac": "V",
    "volt": "V",
    "volts": "V",
    "adc": "A",
    "amp": "A",
    "amps": "A",
    "watt": "W",
    "watts": "W",
    "newtons": "N",
    "sec": "s",
    "secs": "s",
    "second": "s",
    "seconds": "s",
    "msec": "ms",
    "millis": "ms",
    "milliseconds": "ms",
    "millisecond": "ms",
    "microseconds": "us",
    "nanoseconds": "ns",
    "minute": "min",
    "minutes": "min",
    "hr": "h",
    "hrs": "h",
    "hour": "h",
    "hours": "h",
    "day": "d",
    "days": "d",
    "pct": "%",
    "percent": "%",
    "%rh": "%",
    "rh%": "%",
    "rel%": "%",
    "µW": "uW",
    "μW": "uW",
}
"""Units as loggers write them above their columns. A lone C or F there is a temperature: no logger writes coulomb or farad so."""
_PLAIN: Final = frozenset("degC degF K W mW uW kW V mV uV A mA uA Ohm s ms us ns min h d % Pa hPa kPa mbar bar m/s W/m^2 ohm l/min".split())
"""Units that are taken for one after a comma, a slash or an underscore, where other words stand too."""
_HOBO: Final = re.compile(r"(?P<name>.+?), (?P<unit>\S+) \((?=[^()]*\b(?:LGR|SEN) S/N)(?:[^()]*LBL: (?P<label>[^(),]+))?[^()]*\)\Z")
_CHANNEL: Final = re.compile(r"(?P<number>\d+) \((?P<unit>[^()]+)\)\s*-\s*(?P<name>\S.*)\Z")
_NAMED: Final = re.compile(r"(?P<number>\d+) <(?P<name>[^<>]*\S)> \((?P<unit>[^()]+)\)\Z")
_AFTER: Final = re.compile(r"(?P<name>.*\S)\s*[,/]\s*(?P<unit>[^\s,/][^,]*)\Z")


def spelt(text: str) -> str:
    """Return a unit as it is written here, of one as loggers write it; any other text as it is.

    >>> spelt("Deg C"), spelt("VDC"), spelt("mW")
    ('degC', 'V', 'mW')
    """
    plain = text.strip()
    degree = _DEGREE.match(plain)
    if degree:
        letter = (degree[1] or degree[2]).upper()
        return "K" if letter == "K" else f"deg{letter}"
    return _SPELT.get(plain) or _SPELT.get(plain.lower()) or plain


@lru_cache(maxsize=4096)
def name_and_unit(header: str) -> tuple[str, str | None]:
    """Return the name and the unit of a header; None where it names no unit.

    A unit stands in a bracket of any kind at the end, whatever it says: one that nobody knows is refused later and never dropped. Plain
    units also count after a comma, a slash or an underscore, and in a bracket before other words, as loggers write them.

    >>> name_and_unit("T1 [degC]"), name_and_unit("T1 (°F)"), name_and_unit("P, mW"), name_and_unit("T/°C")
    (('T1', 'degC'), ('T1', 'degF'), ('P', 'mW'), ('T', 'degC'))
    >>> name_and_unit("101 <case> (C)"), name_and_unit("Dev0/Ai0"), name_and_unit("heater_mW"), name_and_unit("T1_C")
    (('case', 'degC'), ('Dev0/Ai0', None), ('heater_mW', 'mW'), ('T1_C', None))
    """
    text = header.strip()
    if match := _HOBO.match(text):
        return (f"{match['name']} {match['label'].strip()}" if match["label"] else match["name"]), spelt(match["unit"])
    if match := _NAMED.match(text) or _CHANNEL.match(text):
        return match["name"], spelt(match["unit"])
    for left, right in _BRACKETS:
        if text.endswith(right) and left in text[1:]:
            name, _, inner = text[: -len(right)].rpartition(left)
            if right not in inner and name.strip():
                return name.strip(" ,/"), spelt(inner)
    for left, right in _BRACKETS[:2]:
        name, _, rest = text.partition(left)
        inner, closed, tail = rest.partition(right)
        if closed and name.strip() and tail.strip() and spelt(inner) in _PLAIN:
            return f"{name.strip()} {tail.strip()}", spelt(inner)
    if (match := _AFTER.match(text)) and (spelt(match["unit"]) in _PLAIN or match["unit"][0] in "°º˚%"):
        return match["name"], spelt(match["unit"])
    tail = text.rpartition("_")[2] if "_" in text else ""
    return text, spelt(tail) if len(tail) > 1 and spelt(tail) in _SUFFIXES else None


_SUFFIXES: Final = frozenset(("degC", "degF", "mW", "uW", "kW", "%", "ms", "us", "ns"))
"""Units that are taken for one after an underscore; others there, such as C, F, min and h, may be a word's first letter."""


def find_column(header: tuple[str, ...], wanted: str, where: str) -> int:
    """Return the place of a column, asked for by its header as written or by the name before its unit.

    Raises
    ------
    NameNotFoundError   When there is none.
    RecordError         When there are several.
    """
    hits = [at for at, name in enumerate(header) if name == wanted] or [
        at for at, name in enumerate(header) if name_and_unit(name)[0] == wanted
    ]
    if not hits:
        raise NameNotFoundError(f"no column '{wanted}'; there are {', '.join(header)}.{nearest(wanted, header)}", where)
    if len(hits) > 1:
        raise RecordError(f"{len(hits)} columns have the name '{wanted}'. Rename all but one.", where)
    return hits[0]


def decimal_sign(cells: Cells, given: str | None) -> str:
    """Return '.' or ',': as given, or the one that the numbers of the file use.

    Raises
    ------
    RecordError   When the file has numbers with a comma and numbers with a point.
    """
    if given is not None:
        if given not in (".", ","):
            raise RecordError(f"decimal={given!r} is neither '.' nor ','.", cells.file)
        return given
    if not cells.commas or not any("," in "".join(column) for column in cells.columns):
        return "."
    seen: dict[str, tuple[str, int]] = {}
    for column in cells.columns:
        for sign in {",", "."} - set(seen):
            hits = ((cell, cells.lines[row]) for row, cell in enumerate(column) if sign in cell and _FRACTION.match(cell))
            first = next(hits, None)
            if first is not None:
                seen[sign] = first
    if len(seen) == 2:
        (comma, one), (point, other) = seen[","], seen["."]
        raise RecordError(
            f"the decimal sign is ambiguous: '{comma}' (line {one}) and '{point}' (line {other}). Give decimal=',' or decimal='.'.",
            cells.file,
        )
    return next(iter(seen), ".")


def numbers(cells: tuple[str, ...], decimal: str) -> FloatArray | int:
    """Return the numbers of a column, NaN where one is missing, or the row of the first cell that is text."""
    joined = _UNUSED.join(cells)
    if decimal == ",":
        # a point beside decimal commas would be a thousands sign; it is text here, so that 1.234 is never read as 1.2
        joined = joined.replace(".", "x").replace(",", ".")
    plain = joined.split(_UNUSED) if decimal == "," else cells
    if joined.isascii() and "_" not in joined:
        try:
            return np.array(list(map(float, plain)))
        except ValueError:
            pass  # some cell is empty, which is the usual sign of a missing one
        try:
            return np.array([float(cell) if cell else np.nan for cell in plain])
        except ValueError:
            pass  # another sign, or text
    out = np.full(len(plain), np.nan)
    for row, cell in enumerate(plain):
        word = cell.strip()
        if _NUMBER.match(word):
            out[row] = float(word)
        elif cells[row].strip().lower() not in MISSING and word.lower().lstrip("+-") != "nan":
            return row
    return out


def kelvin_sized(values: FloatArray) -> bool:
    """Whether readings (samples,) would all be hot in degC and usual in kelvin: -50 to 127 degC."""
    return bool(values.size and values.min() >= 223.0 and values.max() <= 400.0)
