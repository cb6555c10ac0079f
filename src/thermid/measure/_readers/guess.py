"""What the columns of a log seem to be. A guess is shown with its reason and never used by itself: a campaign says what a column is."""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from thermid.base.errors import CodedText, ThermidError, code_of
from thermid.base.units import DIMENSIONLESS, counted, describe, from_si, unit
from thermid.measure._readers.columns import kelvin_sized, numbers
from thermid.measure._readers.headers import LETTERED, MISSING, NO_NUMBER, is_number, name_and_unit
from thermid.measure._readers.questions import begins_again, counts_time
from thermid.measure._readers.textfile import Cells
from thermid.measure._record.channel import MIN_OVERLOAD_READING, SENSOR_FAULT_CODES, BoolArray, FloatArray, codes_of

_SURROUNDINGS: Final = re.compile(
    r"room|amb|air\b|_air|luft|raum|umgebung|sala|ambiente|\bar\b|shroud|bath|coolant|water|chamber|outdoor|outside|inlet|sky|"
    r"(?<!heat)(?<!heat[_ -])sink|plate_ref|forno",
    re.IGNORECASE,
)
_INSIDE: Final = re.compile(r"inside|inner|internal|innen|dentro|intern[ao]", re.IGNORECASE)
_TEMPERATURE: Final = re.compile(r"t($|[\d_ ]|[A-Z])|temp|tc\d|rtd|pt100|ds18|ntc|thermo|heat[_ -]?sink", re.IGNORECASE)
_CLEAR: Final = re.compile(r"t($|[\d_ ])|.*temp|tc\d|rtd|pt100|ds18|ntc|thermo", re.IGNORECASE)
_OTHER: Final = re.compile(
    r"t(orque|otal|ra|ension|hr|ach|ilt|ank|are|ime|arget|ool|op|est|urb|ub|yp|rip|ick|ogg)"
    r"|.*(press|flow|level|speed|rpm|light|lux|co2|force|weight|energy|valve|angle|volume)",
    re.IGNORECASE,
)
"""Names of other quantities, and of things that begin with a t: without a unit they may be no temperatures."""
_TO_THINK_OF: Final = (-100.0, 500.0)
"""Readings that a temperature without a unit may have. [degC]"""
_POWER: Final = re.compile(r"p($|[\d_ ])|power|watt|leistung|pot[eê]ncia|heat_?load", re.IGNORECASE)
_ELECTRIC: Final = {
    "V": ("a voltage", re.compile(r"(^|[_ ])(volts?|voltage|spannung|tens[aã]o)($|[_ ])", re.IGNORECASE)),
    "A": ("a current", re.compile(r"(^|[_ ])(amps?|amperes?|current|strom|corrente)($|[_ ])", re.IGNORECASE)),
}
_SCALES: Final = {"C": "degC", "F": "degF", "K": "K"}
_DUTY: Final = re.compile(r"duty|pwm|pct|percent|heater|q\d|u\d|throttle", re.IGNORECASE)
_HUMID: Final = re.compile(r"\brh\b|humid|feucht|umidade", re.IGNORECASE)
_COUNTS: Final = re.compile(r"(^|[_ ])(cnt|adc)\d*($|[_ ])", re.IGNORECASE)
_STATE: Final = re.compile(r"alarm|record|status|flag|diag|scan|index|#|count|number|stopped|connected|button|end of file", re.IGNORECASE)


@dataclass(frozen=True, eq=False)
class Column:
    """One column of a log, and what it seems to be.

    Parameters
    ----------
    header, name : str          As written; and without its unit, where no other column has that name.
    unit : str                  Its unit; empty where none is known.
    assumed : bool              Whether the unit is the usual one, because the log names none.
    guess : str                 'time', 'temperature', 'boundary', 'power', 'duty', 'unclear' or 'ignored'.
    why : str                   What the guess rests on.
    values : array (samples,)   Readings in the unit of the column; NaN where there is none.
    missing : int               How many readings are missing.
    faults : dict               How many are no readings, by reason.
    codes : dict                Values that are no readings -> what they stand for. [the column's unit]
    jumps : array (jumps,)      Positions of readings that leap against the usual change between samples.
    """

    header: str
    name: str
    unit: str
    assumed: bool
    guess: str
    why: str
    values: FloatArray = field(default_factory=lambda: np.zeros(0))
    missing: int = 0
    faults: dict[str, int] = field(default_factory=dict)
    codes: dict[float, str] = field(default_factory=dict)
    jumps: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))

    @property
    def good(self) -> BoolArray:
        """Where a reading is one (samples,)."""
        return np.asarray(np.isfinite(self.values) & (np.abs(self.values) < MIN_OVERLOAD_READING) & ~np.isin(self.values, list(self.codes)))


def columns_of(cells: Cells, decimal: str, times: tuple[int, ...]) -> list[Column]:
    """Return every column of a log with a guess of what it is.

    Parameters
    ----------
    cells : Cells    The log.
    decimal : str    Its decimal sign.
    times : tuple    Places of the time column, or of the date and the time.
    """
    out, bare = [], [name_and_unit(header)[0] for header in cells.header]
    # one letter as the last word is a unit, where no name of the same beginning has a letter there that is none (board A, B, C)
    numbered = {m["stem"] for name in bare if (m := LETTERED.match(name)) and m["letter"] not in {*_SCALES, *_ELECTRIC, "W"}}
    for at, header in enumerate(cells.header):
        name, text = header if bare.count(bare[at]) > 1 else bare[at], name_and_unit(header)[1]
        if at in times:
            out.append(Column(header, name, text or "", False, "time", "its cells are the times"))
            continue
        parsed = numbers(cells.columns[at], decimal)
        if isinstance(parsed, int):
            why = f"text, such as '{cells.columns[at][parsed].strip()[:40]}' ({cells.where(parsed)})"
            few = sum(not is_number(cell) and cell.strip().lower() not in MISSING for cell in cells.columns[at])
            why += f" in {few} of {len(cells.columns[at])} cells. {NO_NUMBER}" if 2 * few < len(cells.columns[at]) else ""
            out.append(Column(header, name, text or "", False, "ignored", why))
            continue
        guess, unit_text, why = _guess(name, text, parsed, m["letter"] if (m := LETTERED.match(name)) and m["stem"] not in numbered else "")
        assumed = text is None and bool(unit_text) and code_of(why) != "record.unit-by-name"
        out.append(_with_faults(Column(header, name, unit_text, assumed, guess, why, parsed, int(np.isnan(parsed).sum()))))
    rooms = [c.name for c in out if c.guess == "boundary" and not _is_sink(c)]
    return [
        replace(c, guess="temperature", why=f"a heat sink, as '{rooms[0]}' is the surroundings") if rooms and _is_sink(c) else c
        for c in out
    ]


def _is_sink(column: Column) -> bool:
    """Whether a column is a guess of surroundings by the word sink alone, which a heat sink has too."""
    match = _SURROUNDINGS.search(column.name)
    return column.guess == "boundary" and match is not None and match[0].lower() == "sink"


def _guess(name: str, text: str | None, values: FloatArray, letter: str) -> tuple[str, str, str]:
    """Return the guess, the unit and the reason.

    Parameters
    ----------
    name, text : str        Name of the column, and its unit or None.
    values : array          Readings (samples,).
    letter : str            Last word of the name, where it may be a unit.
    """
    finite = values[np.isfinite(values)]
    if not finite.size:
        return "ignored", text or "", "empty"
    if text is None:
        return _by_name(name, finite, letter)
    try:
        dimension = unit(text).dimension
    except ThermidError:
        return "ignored", text, f"unknown unit '{text}': give unit = '...'"
    if dimension == unit("K").dimension:
        return _temperature(name, text, f"its unit is {text}")
    if dimension == unit("W").dimension:
        return "power", text, f"its unit is {text}"
    if dimension == DIMENSIONLESS and text == "%":
        return ("ignored", text, "a humidity") if _HUMID.search(name) else ("duty", text, "in per cent: a load needs its power at 100 %")
    words = {unit("1/s").dimension: "a speed or a frequency; a channel with schedule = '...' gives a parameter, such as the speed of a fan"}
    return "ignored", text, words.get(dimension) or describe(dimension)


def _temperature(name: str, text: str, why: str) -> tuple[str, str, str]:
    """Return the guess of a temperature in the unit `text`: boundary where its name is of surroundings and not inside."""
    if (match := _SURROUNDINGS.search(name)) and not _INSIDE.search(name):
        return "boundary", text, CodedText(f"{why}, and '{match[0]}' names surroundings", code_of(why))
    return "temperature", text, why


def _by_name(name: str, finite: FloatArray, letter: str) -> tuple[str, str, str]:
    """Return the guess, the unit and the reason for a column without a unit; `letter` as of `_guess`, `finite` its finite readings."""
    if _STATE.search(name) or (finite.size > 2 and np.all(np.diff(finite) == 1) and not _TEMPERATURE.match(name)):
        return "ignored", "", CodedText("counts rows or states", "record.counter")
    if counts_time(finite):
        again = int(np.count_nonzero(begins_again(finite)))
        return (
            "ignored",
            "",
            CodedText("counts milliseconds" + f", and begins again {counted(again, 'time')}" * (again > 0), "record.counter"),
        )
    if _COUNTS.search(name):
        return "ignored", "", "counts of a converter: `temperature` of a channel takes a formula of them, such as that of an NTC"
    ends = CodedText(f"its name ends in {name[-2:].strip()}", "record.unit-by-name")
    if letter in _SCALES:
        return _temperature(name, _SCALES[letter], ends)
    if letter == "W":
        return "power", "W", ends
    if _POWER.match(name):
        return "power", "W", "by its name"
    for text, (what, words) in _ELECTRIC.items():
        if words.search(name):
            return "ignored", text, f"{what}, by its name"
    if _DUTY.search(name):
        return "duty", "%", "by its name"
    if _TEMPERATURE.match(name) or _SURROUNDINGS.search(name):
        hot = kelvin_sized(finite)
        real = finite[~np.isin(finite, list(codes_of(finite))) & (np.abs(finite) < MIN_OVERLOAD_READING)]
        sized = not real.size or (min(_TO_THINK_OF) <= real.min() and real.max() <= max(_TO_THINK_OF))
        if not (hot or sized) or (_OTHER.match(name) and not _CLEAR.match(name)):
            return "unclear", "", "a temperature or another quantity: state its unit"
        return _temperature(name, "K" if hot else "degC", "by its name" + (" and size" if hot else ""))
    if min(SENSOR_FAULT_CODES) in codes_of(finite):
        return _temperature(name, "degC", f"by the {min(SENSOR_FAULT_CODES):g} of a lost sensor")
    if letter in _ELECTRIC:
        return "ignored", letter, f"{_ELECTRIC[letter][0]}, as {ends}"
    return "ignored", "", "no unit, and its name gives none"


def _with_faults(column: Column) -> Column:
    """Return a column with `codes` (value of a fault -> what it is), `faults` (what it is -> count) and `jumps` (places of readings).

    Only temperatures have codes and jumps. A jump is a step above 8 q, q the 90 % quantile of all steps and 0.25 of the column's unit at
    least. Other columns are looked through for readings of an overload, counters excepted.
    """
    values, heat = column.values, column.guess in ("temperature", "boundary")
    codes = codes_of(values, float(from_si(0.0, column.unit))) if heat else {}
    faults = Counter(codes[v] for v in values.tolist() if v in codes)
    counter = code_of(column.why) == "record.counter"  # counts as high as it likes
    if not (heat or counter) and (over := int(np.count_nonzero(np.isfinite(values) & (np.abs(values) >= MIN_OVERLOAD_READING)))):
        faults["overload or open sensor"] = over
    column = replace(column, codes=codes)
    good = np.flatnonzero(column.good)
    jumps = np.zeros(0, dtype=np.int64)
    if heat and good.size > 3:
        steps = np.abs(np.diff(values[good]))
        usual = max(float(np.quantile(steps, 0.9)), 0.25)
        jumps = good[1:][steps > 8.0 * usual]
    return replace(column, faults=dict(faults), jumps=jumps)
