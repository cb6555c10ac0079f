"""What stands above the samples of a text log: names with units, rows of units, and which cells are neither names nor numbers."""

from __future__ import annotations

import re
from collections.abc import Container, Sequence
from functools import lru_cache
from typing import Final, NamedTuple

from thermid.base.errors import RecordError

MISSING: Final = frozenset(
    (
        *("", *"nan na n/a null none ol o.l. ovld overload open burnout #n/a 1.#qnan 1.#ind -1.#ind".split()),
        *("--", "---", "----", "-----", "-.-", "-.--", "--.-", "--.--", "---.-", "---.--"),
    )
)
"""Cells that stand for a missing number or for the overload of an instrument, in any case of letters: a display of dashes too. A single
dash is none: in real logs it shows columns that have slipped."""

NO_NUMBER: Final = "Write missing samples as empty, NaN, NA or ---"

_BRACKETS: Final = (("[", "]"), ("(", ")"), ("{", "}"), ("<", ">"))
# patterns as texts: `re` compiles them when the first log is read, and keeps them
_DEGREE: Final = r"(?i)(?:[°º˚]\s*|deg(?:rees?)?[ ._*]*)(c|f|k)(?:elsius|ahrenheit|elvin)?\Z|(c|f|k)(?:elsius|ahrenheit|elvin)\Z"
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
    "micros": "us",
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
_HOBO: Final = r"(?P<name>.+?), (?P<unit>\S+) \((?=[^()]*\b(?:LGR|SEN) S/N)(?:[^()]*LBL: (?P<label>[^(),]+))?[^()]*\)\Z"
_CHANNEL: Final = r"(?P<number>\d+) \((?P<unit>[^()]+)\)\s*-\s*(?P<name>\S.*)\Z"
_NAMED: Final = r"(?P<number>\d+) <(?P<name>[^<>]*\S)> \((?P<unit>[^()]+)\)\Z"
_AFTER: Final = r"(?P<name>.*\S)\s*[,/]\s*(?P<unit>[^\s,/][^,]*)\Z"


TIME_NAMES: Final = ("time", "time_s", "t", "t_s", "timestamp", "datetime", "seconds")
"""Names that a time column has by default; a single letter counts as written, because T is a temperature."""
DATED: Final = frozenset(
    "date time|date/time|date & time|date_time|date|time stamp|ts|_time|last_changed|last_updated|uhrzeit|zeitstempel|datum|datum/zeit|"
    "hora|data|data/hora|data hora|data_hora|carimbo|fecha|fecha/hora|fecha hora|heure|date/heure|horodatage|scan sweep time|"
    "elapsed time".split("|")
)
"""Names that are taken where no column has one of the usual ones and the cells are stamps."""
COUNTED: Final = frozenset(
    "time stamp|time_ms|t_ms|s|ms|millis|millis()|elapsed|elapsed time|elapsed_s|uptime|epoch|unix|unixtime|unix_time|scan sweep time|"
    "x_value|zeit|tempo|tempo_s|tiempo".split("|")
)
"""Names that are taken where the cells are numbers that rise; up to three letters count as written, because Ts and mS are none."""

TIMELY: Final = re.compile(r"\d:[0-5]\d|\d{1,4}[-/.]\d{1,2}[-/.]\d{1,4}")
"""What cells with a date or a clock time hold."""
_DONE: Final = frozenset("|smp|avg|max|min|std|tot|med|mean|last|sample".split("|"))
"""What a logger did with its samples, as a row below the units says it."""
_UNIT_CELL: Final = (
    r"[\[({]?(?:[°º˚]\s*[CFK]|deg[ ._]?[CFK]|[CFKWVA%s]|[mµuk]W|[mµuk]V|[mµu]A|[mµun]s|sec|min|h|hrs?|TS|RN|[kMh]?Pa|mbar|bar|m/s"
    r"|m/s\^2|W/m[\^²]?2?|mg/m3|g/m3|%RH|rpm|ohms?|Ω|l/min|arb|degC|degF|Celsius|Volts?|Watts?|YYYY.*|dd.*|hh:mm.*|HH:MM.*|datetime|unit)[\])}]?\Z"
)
"""Cells of a row of units."""


def signed(cell: str) -> str:
    """Return a cell without the blanks that loggers write between a sign and its number."""
    return re.sub(r"\A\s*([-+])\s+", r"\1", cell)


def is_number(cell: str) -> bool:
    """Whether a cell is a number, with a point or a comma."""
    try:
        float(signed(cell).replace(",", "."))
    except ValueError:
        return False
    return True


def spelt(text: str) -> str:
    """Return a unit as thermid writes it, of one as loggers write it; any other text as it is.

    >>> spelt("Deg C"), spelt("VDC"), spelt("mW")
    ('degC', 'V', 'mW')
    """
    plain = text.strip()
    if degree := re.match(_DEGREE, plain):
        letter = (degree[1] or degree[2]).upper()
        return "K" if letter == "K" else f"deg{letter}"
    return _SPELT.get(plain) or _SPELT.get(plain.lower()) or plain


# Names whose last word is one capital letter, which may be a unit: `T_room_C`, `supply V`
LETTERED: Final = re.compile(r"(?P<stem>.*\w)[_ ](?P<letter>[A-Z])\Z")


@lru_cache(maxsize=4096)
def name_and_unit(header: str) -> tuple[str, str | None]:
    """Return the name and the unit of a header; None where it names no unit.

    A unit stands in a bracket of any kind at the end, whatever it says: one that nobody knows is refused later and never dropped, and an
    empty bracket is none. Plain units also count after a comma, a slash or an underscore, and in a bracket before other words, as loggers
    write them.

    >>> name_and_unit("T1 [degC]"), name_and_unit("T1 (°F)"), name_and_unit("P, mW"), name_and_unit("T/°C")
    (('T1', 'degC'), ('T1', 'degF'), ('P', 'mW'), ('T', 'degC'))
    >>> name_and_unit("101 <case> (C)"), name_and_unit("Dev0/Ai0"), name_and_unit("heater_mW"), name_and_unit("T1_C")
    (('case', 'degC'), ('Dev0/Ai0', None), ('heater_mW', 'mW'), ('T1_C', None))
    """
    text = header.strip()
    if match := re.match(_HOBO, text):
        return (f"{match['name']} {match['label'].strip()}" if match["label"] else match["name"]), spelt(match["unit"])
    if match := re.match(_NAMED, text) or re.match(_CHANNEL, text):
        return match["name"], spelt(match["unit"])
    for opening, right in _BRACKETS:
        if text.endswith(right) and opening in text[1:]:
            name, _, inner = text[: -len(right)].rpartition(opening)
            if right not in inner and name.strip():
                return name.strip(" ,/"), spelt(inner) or None
    for opening, right in _BRACKETS[:2]:
        name, _, rest = text.partition(opening)
        inner, closed, tail = rest.partition(right)
        if closed and name.strip() and tail.strip() and spelt(inner) in _PLAIN:
            return f"{name.strip()} {tail.strip()}", spelt(inner)
    if (match := re.match(_AFTER, text)) and (spelt(match["unit"]) in _PLAIN or match["unit"][0] in "°º˚%"):
        return match["name"], spelt(match["unit"])
    tail = re.split("[_ ]", text)[-1]
    return text, spelt(tail) if tail != text and len(tail) > 1 and spelt(tail) in _SUFFIXES else None


_SUFFIXES: Final = frozenset(("degC", "degF", "mW", "uW", "kW", "%", "ms", "us", "ns", "rpm"))
"""Units that are taken for one after an underscore or a blank; others there, such as C, F, min and h, may be a word's first letter."""


def plainly(name: str) -> str:
    """Return a name as it is compared with usual ones: in small letters, or as written where it has up to three."""
    return name.strip().lower() if len(name.strip()) > 3 else name.strip()


class Header(NamedTuple):
    """Names of columns, each with its unit where a row of units stands below, and whether one does."""

    names: tuple[str, ...]
    units: bool


def with_units_row(rows: Sequence[Sequence[str]]) -> tuple[Header, int]:
    """Return the header of rows, and how many rows below the first hold no samples: units, and what a logger did (Avg, Smp)."""
    names = tuple(name.strip() or f"column {at}" for at, name in enumerate(rows[0], 1))
    extra, units = 0, False
    for row in rows[1:3]:
        texts = [cell.strip() for cell in row]
        if len(row) != len(names) or any(is_number(text) or TIMELY.search(text) for text in texts) or len(rows) <= extra + 2:
            break
        if all(text.lower() in _DONE for text in texts):
            extra += 1
        elif not extra and sum(bool(re.match(_UNIT_CELL, text)) for text in texts) >= 0.5 * sum(bool(text) for text in texts) > 0:
            names = tuple(_with_unit(name, text) for name, text in zip(names, texts, strict=True))
            extra, units = 1, True
        else:
            break
    return Header(names, units), extra


_UNIT_WORDS: Final = ("unit", "units", "einheit", "einheiten", "unité", "unités", "unidad", "unidades")
"""Words before the units that a line above the header states, in lower case."""


def with_units_above(names: tuple[str, ...], above: Sequence[Sequence[str]]) -> tuple[str, ...]:
    """Return names with the units of a line above the header: one of each column, `Unit;°C;W`, or one of all but times, `Unit: °C`."""
    for row in above:
        parts = [part.strip() for cell in row for part in cell.split(":", 1)]
        rest = parts[1 + next((k for k, part in enumerate(parts) if part.lower() in _UNIT_WORDS), len(parts)) :]
        texts = [text for text in rest if text]
        if not texts or not all(re.match(_UNIT_CELL, text) for text in texts):
            continue
        below = ["", *rest] if len(rest) == len(names) - 1 else ["", *texts * (len(names) - 1)] if len(texts) == 1 else [""] * len(names)
        clear = [_unit_of(name) or is_time_name(name) for name in names]
        return tuple(n if stated else _with_unit(n, text) for n, text, stated in zip(names, below, clear, strict=True))
    return names


def _with_unit(name: str, text: str) -> str:
    """Return a name with the unit below it in brackets, unless it has that unit or the cell stands for none."""
    plain = text.strip("[](){} ")
    stated = not plain or plain.upper() in ("TS", "RN") or name.endswith(f"[{plain}]") or _unit_of(name) == spelt(plain)
    stated = stated or is_time_name(plain, DATED | {"time"})  # "Time" below "Date&Time" is no unit
    return name if stated else f"{name} [{plain}]"


def refuse_two_units(names: Sequence[str], below: Sequence[str]) -> None:
    """Refuse a row of units that contradicts units in the names above it.

    Raises
    ------
    RecordError   At the first column with two units.
    """
    for name, text in zip(names, below, strict=True):
        stated, second = _unit_of(name.strip()), spelt(text.strip("[](){} "))
        if stated and second in _PLAIN and stated != second:
            raise RecordError(
                f"'{name.strip()}' has two units: [{stated}] in its name and [{second}] below it. {_WRONG}", code="record.unit-contradicts"
            )


MOST_NAMES: Final = 3
"""Lines of names that stand above each other."""
_DATED_WORDS: Final = r"\d{1,2}[ ./-]+[A-Za-zÀ-ÿ]{3,10}\.?[ ,./-]+\d{2,4}\b|[A-Za-zÀ-ÿ]{3,10}\.? \d{1,2},? \d{4}\b"
"""Dates with the month as a word, which no name holds."""
_NUMBERING: Final = (
    r"(?i)(?:(?:analog ?)?(?:ch|chan|channel|kanal|can|canal|voie|in|input|eingang|entrada|port|slot|pos|position|posi[cç][aã]o|platz"
    r"|u\d{1,2}(?=-)|stelle|mess-?stelle|sensor|sonde|probe|ai|ain|mp|no|nr|col|column|spalte|coluna))?[ ._:#/-]*\d{1,5}[a-z]?\Z"
)
"""Cells that number the channels or positions of a logger and name nothing that was measured."""

_WRONG: Final = "Put '#' before the line that is wrong."

Lines = Sequence[Sequence[str]]


def is_time_name(name: str, usual: Container[str] = DATED | COUNTED | {*TIME_NAMES}) -> bool:
    """Whether a name, with blanks or underscores between its words, is usual for a time column."""
    plain = plainly(name_and_unit(name)[0])
    return plain in usual or plain.replace(" ", "_") in usual


def may_name(row: Sequence[str], width: int) -> bool:
    """Whether a line can be one of several of names: as wide as the samples, two texts or more, no number, time or missing reading."""
    texts = [cell.strip() for cell in row if cell.strip()]
    return (
        len(row) == width
        and len(texts) > 1
        and all(any(character.isalpha() for character in text) or text == "#" for text in texts)
        and not any(text.lower() in MISSING or is_number(text) or TIMELY.search(text) or re.search(_DATED_WORDS, text) for text in texts)
    )


def may_number(row: Sequence[str], width: int) -> bool:
    """Whether a line above names numbers the columns: whole numbers that differ, names of a time column beside them."""
    texts = [cell.strip() for cell in row if cell.strip()]
    counts = [text for text in texts if text.isdigit() and len(text) < 5]
    others = [text for text in texts if text not in counts]
    return len(row) == width and len({*counts}) == len(counts) > 1 and all(is_time_name(text) for text in others)


def counts_columns(rows: Lines) -> bool:
    """Whether the first of some rows of samples counts the columns from 0 or 1, and only the others have decimals."""
    first = [cell.strip() for cell in rows[0]] if len(rows) > 2 else []
    counted = len(first) > 2 and first in ([str(k + begin) for k in range(len(first))] for begin in (0, 1))
    return counted and all(is_number(cell) and not cell.strip().lstrip("+-").isdigit() for row in rows[1:] for cell in row[1:])


def lines_of_names(rows: Lines, numbers: Sequence[int]) -> int:
    """Return how many of the first rows, directly below each other, hold names; 1 where only the first does."""
    width, count = len(rows[0]), 1
    while count < MOST_NAMES and len(rows) > count + 1 and may_name(rows[count], width) and numbers[count] == numbers[count - 1] + 1:
        if with_units_row(rows[count - 1 : count + 3])[1]:
            break
        count += 1
    return count if count == 1 or may_name(rows[0], width) or may_number(rows[0], width) else 1


def one_line_of_names(rows: Lines, numbers: Sequence[int]) -> tuple[list[str], str]:
    """Return the names of columns of which several lines above each other hold some, and what was assumed.

    The line that names what was measured is taken: every column has a name there, none twice, and they are not the numbers of channels.
    Empty cells of it, often that of the time, are filled from the other lines. Several such lines are combined, and so are lines that name
    the columns only together; a cell of a group is then the name of the empty ones to its right, where no name would occur twice
    otherwise. A unit in a bracket of any line counts.

    Raises
    ------
    RecordError   When lines contradict each other in which column is the time, or in a unit.
    """
    cells = [[cell.strip() for cell in row] for row in rows]
    timed = [{at for at, cell in enumerate(row) if is_time_name(cell)} for row in cells]
    for k, later in enumerate(timed):
        for j, earlier in enumerate(timed[:k]):
            if earlier and later and not earlier & later:
                raise RecordError(
                    f"lines {numbers[j]} and {numbers[k]} name different columns as the time. {_WRONG}", code="record.time-unclear"
                )
    clock = set.union(*timed)
    units = [_common_unit([row[at] for row in cells], numbers) for at in range(len(cells[0]))]
    # a line whose cells only number channels names nothing; one that names every column apart from the time, no two alike, tells all
    others = [[_bare_name(cell) for at, cell in enumerate(row) if cell and at not in clock] for row in cells]
    named = [k for k, row in enumerate(others) if not all(numbers_a_channel(name) for name in row)]
    every = {at for row in cells for at, cell in enumerate(row) if cell} - clock
    telling = [k for k in named if every and all(cells[k][at] for at in every) and not _twice([cells[k][at] for at in every])]
    if any(timed[k] for k in telling):  # a line with another word above or below the time is of another kind: a title, forms of cells
        telling = [k for k in telling if not any(cells[k][at] and at not in timed[k] for at in clock)]
    if len(telling) == 1:
        names, used = _filled(cells, telling[0]), telling
    else:
        names, used = _combined(cells, telling or named, clock)
        if not telling and _twice(names):
            spread = [_spread(row, clock) for row in cells[:-1]] + cells[-1:]
            for lines, among in ((spread, named), (cells, list(range(len(cells))))):
                other, taken = _combined(lines, among, clock)
                if not _twice(other):
                    names, used = other, taken
                    break
    full = [f"{name} [{unit}]" if unit and not _unit_of(name) else name for name, unit in zip(names, units, strict=True)]
    return full, _names_assumed(cells, numbers, used, names)


def numbers_a_channel(cell: str) -> bool:
    """Whether a cell numbers a channel or position of a logger and names nothing that was measured."""
    return bool(re.match(_NUMBERING, cell.strip()))


def _bare_name(cell: str) -> str:
    """Return a name without a unit that loggers write behind it."""
    return name_and_unit(cell)[0] if _unit_of(cell) else cell


def _unit_of(cell: str) -> str:
    """Return the unit in a name where it is one that loggers write, else an empty text."""
    unit_text = name_and_unit(cell)[1] if cell else None
    return unit_text if unit_text in _PLAIN else ""


def _common_unit(column: Sequence[str], numbers: Sequence[int]) -> str:
    """Return the unit in the names of one column; empty where none has one.

    Raises
    ------
    RecordError   When two differ.
    """
    stated = {unit: number for cell, number in zip(column, numbers, strict=True) if (unit := _unit_of(cell))}
    if len(stated) > 1:
        both = " and ".join(f"[{unit}] in line {number}" for unit, number in stated.items())
        raise RecordError(f"a column has two units: {both}. {_WRONG}", code="record.unit-contradicts")
    return next(iter(stated), "")


def _twice(names: Sequence[str]) -> bool:
    """Whether a name occurs twice; empty ones do not count."""
    held = [name for name in names if name]
    return len({*held}) < len(held)


def _filled(cells: Lines, line: int) -> list[str]:
    """Return the names of a line, its empty cells filled from the nearest other line; where any line names a time, that name."""
    others = [row for k, row in reversed(list(enumerate(cells))) if k != line]
    out = []
    for at, cell in enumerate(cells[line]):
        held = [row[at] for row in others if row[at] and not is_number(row[at])]
        out.append(next((name for name in (cell, *held) if is_time_name(name)), cell or (held[0] if held else "")))
    return out


def _combined(cells: Lines, lines: Sequence[int], clock: set[int]) -> tuple[list[str], list[int]]:
    """Return the names of some lines joined by blanks, the upper first, and these lines; a time column has its usual name."""
    out = []
    for at in range(len(cells[0])):
        held = list(dict.fromkeys(cells[k][at] for k in lines if cells[k][at]))
        time = next((row[at] for row in cells if at in clock and is_time_name(row[at])), "")
        bare = list(dict.fromkeys(_bare_name(cell) for cell in held))
        out.append(time or (held[0] if len(held) == 1 else " ".join(bare)))
    return out, list(lines)


def _spread(row: Sequence[str], clock: set[int]) -> list[str]:
    """Return a line with each name also in the empty cells to its right, as sheets write cells that span columns."""
    out: list[str] = []
    for at, cell in enumerate(row):
        out.append(cell if cell or at in clock or not out or at - 1 in clock else out[-1])
    return out


def _names_assumed(cells: Lines, numbers: Sequence[int], used: Sequence[int], names: Sequence[str]) -> str:
    """Return what was assumed about several lines of names, in words."""

    def first_cells(row: Sequence[str]) -> str:
        """Return the first cells of a row as text."""
        shown = [cell for cell in row if cell]
        return ", ".join(shown[:4]) + (", ..." if len(shown) > 4 else "")

    which = " and ".join(str(numbers[k]) for k in used)
    rest = [f"line {numbers[k]} ({first_cells(row)})" for k, row in enumerate(cells) if k not in used]
    omitted = f"; left out: {', '.join(rest)}" if rest else ""
    assumption = f"assumed names: those of line {which}" if len(used) == 1 else f"assumed names: lines {which} combined"
    return f"lines {numbers[0]} to {numbers[-1]} hold names above the samples; {assumption} ({first_cells(names)}){omitted}"
