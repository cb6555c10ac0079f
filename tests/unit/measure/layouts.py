"""One synthetic test of a part in layouts drawn at random: separators, decimal signs, encodings, clocks, units, codes of faults, damage."""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta

import numpy as np

ROWS, STEP = 40, 30.0
BEGIN, EVENING = datetime(2026, 3, 5, 9, 58), datetime(2026, 3, 5, 23, 50)
AT = (11, 12)
"""Rows whose first temperature is replaced by a code."""
CLOCKS = {
    "Time (s)": "s",
    "time": "s",
    "Elapsed (min)": "min",
    "t [h]": "h",
    "millis": "ms",
    "timestamp": "epoch ms",
    "ts": "epoch ns",
    "Date/Time": "%Y-%m-%d %H:%M:%S",
    "Time": "%I:%M:%S %p",
    "Datum": "%d.%m.%Y %H:%M:%S",
    "Zeit": "%d.%m.%y %H:%M:%S",
    "Date": "%d/%m/%Y %H:%M:%S",
    "Date Time": "%m/%d/%Y %I:%M:%S %p",
    "Hora": "%H:%M:%S",
    "datetime": "%Y-%m-%d %H:%M:%S.000",
    "Uhrzeit": "%Y%m%d%H%M%S",
    "Fecha": "%d-%b-%Y %H:%M:%S",
    "Date|Time": "%d/%m/%Y|%H:%M:%S",
    "DATE|TIME": "%m/%d/%y|%I:%M:%S %p",
    "time stamp": "%Y/%m/%d %H:%M:%S",
}
UNITS = {
    "bracket": ("T1 (°C)", "Tair (°C)", "P (W)"),
    "square": ("T1 [degC]", "Tair [degC]", "P [W]"),
    "none": ("T1", "Tair", "P"),
    "F": ("T1 (°F)", "Tair (°F)", "P (mW)"),
    "row": ("T1", "Tair", "P"),
    "row F": ("T1", "Tair", "P"),
    "comma": ("T1, °C", "Tair, °C", "P, W"),
}
CODES = (
    None,
    None,
    "",
    "-",
    "NaN",
    "OL",
    "-127",
    "-127.00",
    "9999",
    "---",
    "####",
    "Open",
    "-999",
    "-999.9",
    "9.9E37",
    "1.#QNAN",
    "inf",
    "Error",
    "N/A",
    "?",
    "85",
    "0",
    "null",
    "-200",
    "1372",
    "3276.7",
    "6999",
    "-9999",
    "*",
    "#N/A",
    "32767",
    "850",
    "-40",
)
DAMAGE = (
    None,
    None,
    None,
    "comment below",
    "text below",
    "separator after samples",
    "separator after header",
    "blank lines",
    "one name twice",
    "header again",
    "comment in a row",
    "preamble",
    "no-break space",
    "minus sign",
    "thousands",
    "index",
    "time back",
    "row twice",
    "half a row",
    "two decimal signs",
    "plus",
    "spaces",
    "names above",
    "numbers above",
    "numbers below",
    "time above",
    "groups above",
    "two languages",
    "three lines",
    "two lines below a preamble",
    "statistics below",
    "short first row",
)


TWO_NAMES = {"T1": "Wand T1", "Tair": "Raumluft Tair", "P": "Heizung P"}


@dataclass(frozen=True, eq=False)
class Drawn:
    """A log as bytes, and what stands in it: times [s], T1 and Tair [degC], P [W]; rows of T1 that are no readings."""

    words: str
    data: bytes
    times: np.ndarray
    columns: dict[str, np.ndarray]
    coded: tuple[int, ...]
    heads: dict[str, str] = field(default_factory=dict)
    """What columns are called where it is not their own name."""


def _test() -> tuple[np.ndarray, dict[str, np.ndarray]]:
    rng, k = np.random.default_rng(3), np.arange(ROWS)
    warm = np.round(20 + 15 * (1 - np.exp(-k / 12.0)) + 0.02 * rng.standard_normal(ROWS), 2)
    return k * STEP, {"T1": warm, "Tair": np.round(20.5 + 0.2 * rng.standard_normal(ROWS), 2), "P": np.where(k < 4, 0.0, 2.5)}


def _stamps(form: str, times: np.ndarray, sign: str) -> list[str]:
    scale = {"s": 1.0, "min": 60.0, "h": 3600.0}
    if form in scale:
        return [f"{t / scale[form]:.7f}".replace(".", sign) for t in times]
    since = BEGIN.replace(tzinfo=UTC).timestamp()
    whole = {"ms": (0.0, 1e3), "epoch ms": (since, 1e3), "epoch ns": (since, 1e9)}
    if form in whole:
        return [str(int(whole[form][0] + t) * int(whole[form][1])) for t in times]
    begin = EVENING if "%p" in form and "%m" in form else BEGIN
    return [(begin + timedelta(seconds=float(t))).strftime(form) for t in times]


def drawn(seed: int) -> Drawn:
    """Return the log of a seed."""
    rng = random.Random(seed)
    name, units = rng.choice(list(CLOCKS)), rng.choice(list(UNITS))
    mark, damage = rng.choice(",;\t"), rng.choice(DAMAGE)
    sign = "." if mark == "," and rng.random() < 0.8 else rng.choice(".,")
    quoted, end = rng.choice(("none", "none", "all", "header")), rng.choice(("\n", "\r\n", "\r"))
    encoding = rng.choice(("utf-8", "utf-8-sig", "utf-16", "utf-16-le", "latin-1"))
    warm, code = "F" in units, rng.choice(CODES)
    code = None if code == "85" and warm else code  # 85 degF is a temperature of this test
    times, columns = _test()
    watts = 1e3 if warm else 1.0

    def written(value: float, digits: int = 3) -> str:
        return f"{value:.{digits}f}".replace(".", sign)

    shown = {n: 1.8 * v + 32.0 if warm else v for n, v in columns.items() if n != "P"}
    rows = [
        [*stamp.split("|"), written(a), written(b), written(p * watts, 1)]
        for stamp, a, b, p in zip(_stamps(CLOCKS[name], times, sign), shown["T1"], shown["Tair"], columns["P"], strict=True)
    ]
    for k in AT if code is not None else ():
        rows[k][-3] = str(code).replace(".", sign) if str(code).strip("-.").replace(".", "").isdigit() else str(code)
    header = [*name.split("|"), *UNITS[units]]
    below = {"row": ["°C", "°C", "W"], "row F": ["°F", "°F", "mW"]}.get(units)
    lines = [*_names(damage or "", header), *([[""] * (len(header) - 3) + below] if below else [])]
    times, columns = _damaged(damage or "", lines, rows, times, columns, (sign, watts, warm))

    def joined(row: Sequence[str], first: bool = False) -> str:
        all_ = quoted == "all" or (first and quoted == "header")
        return mark.join(f'"{c}"' if all_ or mark in c else c for c in row)

    top, body = [joined(row, True) for row in lines], [joined(row) for row in rows]
    text = end.join(_around(damage or "", top, body, mark)) + end
    data = (
        text.encode(encoding, errors="replace")
        if encoding == "latin-1" and "\u2212" not in text
        else text.encode(encoding if encoding != "latin-1" else "utf-8")
    )
    said = f"{seed}: {name} {CLOCKS[name]}, {units}, {mark!r} {sign!r}, quoted {quoted}, {encoding} {end!r}, code {code!r}, {damage}"
    return Drawn(said, data, times, columns, AT if code is not None else (), TWO_NAMES if damage == "two languages" else {})


def _damaged(
    damage: str,
    lines: list[list[str]],
    rows: list[list[str]],
    times: np.ndarray,
    columns: dict[str, np.ndarray],
    how: tuple[str, float, bool],
) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Damage header and rows in place, and return what stands in them then."""
    sign, watts, warm = how
    if damage == "one name twice":
        lines[0][-2] = lines[0][-3]
    elif damage == "index":
        lines[:] = [["", *line] for line in lines]
        rows[:] = [[str(k), *row] for k, row in enumerate(rows)]
    elif damage == "minus sign":
        rows[20][-3] = "\u2212" + f"{5:.3f}".replace(".", sign)
        columns["T1"][20] = (-5.0 - 32.0) / 1.8 if warm else -5.0
    elif damage == "thousands":
        rows[30][-1] = f"1{'.' if sign == ',' else ','}234{sign}5"
        columns["P"][30] = 1234.5 / watts
    elif damage == "time back":
        rows[20], rows[21] = rows[21], rows[20]
    elif damage == "row twice":
        rows.insert(20, list(rows[20]))
    elif damage == "half a row":
        rows[-1] = rows[-1][:-1]
        return times[:-1], {n: v[:-1] for n, v in columns.items()}
    elif damage == "two decimal signs":
        rows[25][-3] = rows[25][-3].replace(sign, "." if sign == "," else ",")
    elif damage in ("plus", "no-break space"):
        rows[:] = [[*row[:-3], *(("+" if damage == "plus" else "\u00a0") + c for c in row[-3:])] for row in rows]
    elif damage == "spaces":
        rows[:] = [[f"  {c} " for c in row] for row in rows]
    elif damage == "short first row":
        rows[0] = rows[0][:-1]
    return times, columns


def _names(damage: str, header: list[str]) -> list[list[str]]:
    """Return the lines of names above each other that a log has instead of its header, units in those of the header."""
    first, last = header[:-3], header[-3:]
    channels = ["CH1", "CH2", "CH3"]
    if damage == "numbers above":
        return [[*("" for _ in first), *channels], header]
    if damage == "numbers below":
        return [header, [*("CH0" for _ in first), *channels]]
    if damage == "time above":
        return [[*first, *channels], [*("" for _ in first), *last]]
    if damage == "groups above":
        return [[*first, "Chamber", "Chamber", "Supply"], [*("" for _ in first), *last]]
    if damage == "two languages":
        return [[*first, "Wand", "Raumluft", "Heizung"], header]
    if damage == "three lines":
        return [[*("1" for _ in first), *channels], [*("" for _ in first), "Chamber", "", "Supply"], header]
    return [[*("CH0" for _ in first), *channels], header] if damage == "two lines below a preamble" else [header]


def _around(damage: str, top: list[str], body: list[str], mark: str) -> list[str]:
    """Return the lines of a file with what stands around and between its samples."""
    wide = top[0].count(mark)
    if damage in ("preamble", "two lines below a preamble"):
        return ["Logger model XY-12", "Serial: 1234", "Started 2026-03-05", "", *top, *body]
    if damage == "names above":
        return [mark * (wide - 2) + mark.join(("Channel 1", "Channel 2", "Channel 3")), *top, *body]
    if damage == "separator after header":
        return [top[0] + mark, *top[1:], *body]
    if damage == "separator after samples":
        return [*top, *(line + mark for line in body)]
    if damage == "blank lines":
        return [*top, *(line for k, row in enumerate(body) for line in ([row, ""] if k % 7 == 0 else [row]))]
    if damage == "header again":
        return [*top, *body[:19], top[0], *body[19:]]
    if damage == "comment in a row":
        return [*top, *body[:15], f"{body[15]} # door opened", *body[16:]]
    below = {
        "comment below": ["# end of log"],
        "text below": ["End of file"],
        "statistics below": [f"{word}{mark * (wide - 2)}{value}{mark}{value}{mark}{value}" for word, value in (("Min", 0), ("Max", 99))],
    }
    return [*top, *body, *below.get(damage, [])]
