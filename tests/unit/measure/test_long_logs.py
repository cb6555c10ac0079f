"""Long text logs are read in blocks of numbers, with the values and the faults of the way that reads cell by cell."""

from __future__ import annotations

import tracemalloc
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from thermid.base.errors import ThermidError
from thermid.measure._readers import columns
from thermid.measure._readers.columns import NumberColumn, decimal_sign, numbers, table_of_text
from thermid.measure._readers.textfile import cells_of_text
from thermid.measure.readers import read_record

ROWS = 1500
Lines = list[str]


def log(rng: np.random.Generator, stamps: bool, mark: str) -> Lines:
    """Return the lines of a log, its time in numbers or stamps."""
    times = [f"2026-03-{1 + k // 1440:02d} {k // 60 % 24:02d}:{k % 60:02d}:00" if stamps else f"{10.0 * k:g}" for k in range(ROWS)]
    readings = 20.0 + np.cumsum(0.01 * rng.standard_normal((ROWS, 3)), axis=0)
    rows = [mark.join([t, *(f"{v:.3f}" for v in row)]) for t, row in zip(times, readings, strict=True)]
    return [mark.join(["stamp" if stamps else "time_s", "T1 [degC]", "T2 [degC]", "P [W]"]), *rows]


def cell(word: str) -> Callable[[Lines, int, str], Lines]:
    """Return what writes a word into the second column of a line."""

    def write(lines: Lines, at: int, mark: str) -> Lines:
        cells = lines[at].split(mark)
        return [*lines[:at], mark.join([cells[0], word, *cells[2:]]), *lines[at + 1 :]]

    return write


def line(text: str) -> Callable[[Lines, int, str], Lines]:
    """Return what puts a line before another one."""
    return lambda lines, at, mark: [*lines[:at], text.replace("|", mark), *lines[at:]]


HARM: dict[str, Callable[[Lines, int, str], Lines]] = {
    **{
        f"cell '{word}'": cell(word)
        for word in ("", " ", "NaN", "n/a", "OL", "open", "inf", "-Infinity", "1_0", "0x1", "1e999", "1,5", "1.234,5")
    },
    **{f"cell '{word}'": cell(word) for word in (" 21.5 ", "+21.5", ".5", "5.", "1d3", "9.9e37", "#", '"21"', "21 °C", "٢١", "1e-320")},
    **{f"line '{text}'": line(text) for text in ("", "  ", "# 1|2|3|4", "1|2|3", "1|2|3|4|5", "a|b|c|d", "|||", "time_s|T1|T2|P")},
    "a repeated header": lambda lines, at, mark: [*lines[:at], lines[0], *lines[at:]],
    "a preamble": lambda lines, at, mark: ["Logger 7", f"serial{mark}12", "", *lines],
    "a row of units": lambda lines, at, mark: [
        lines[0].replace(" [degC]", "").replace(" [W]", ""),
        mark.join(["s", "degC", "degC", "W"]),
        *lines[1:],
    ],
    "separators at the ends": lambda lines, at, mark: [row + mark for row in lines],
    "separators below the header": lambda lines, at, mark: [lines[0], *(row + mark for row in lines[1:])],
    "decimal commas": lambda lines, at, mark: [lines[0], *(row.replace(".", ",") for row in lines[1:])],
    "no header": lambda lines, at, mark: lines[1:],
    "a header in a comment": lambda lines, at, mark: ["# " + lines[0], *lines[1:]],
    "two columns with time": lambda lines, at, mark: [row + mark + row.split(mark)[0] for row in lines],
    "nothing": lambda lines, at, mark: lines,
}
ENDS: dict[str, Callable[[str], str]] = {
    "whole": lambda text: text + "\n",
    "without a last line end": lambda text: text,
    "a last line that is cut": lambda text: text[: text.rfind("\n") + 9],
    "a last cell that is cut": lambda text: text[:-1] + "-",
    "blank lines behind": lambda text: text + "\n\n\n",
}


def read(way: Callable[..., Any], text: str, separator: str | None) -> Any:
    """Return all that a way of reading says of a text, or its refusal."""
    try:
        cells = way(text, "log.csv", separator, ["a note"])
        sign = decimal_sign(cells, None)
        found = [numbers(column, sign) for column in cells.columns]
    except ThermidError as error:
        return type(error).__name__, error.where, error.message, error.code
    values = [column if isinstance(column, int) else column.tobytes() for column in found]
    whole = [tuple(column) for column in cells.columns], list(cells.lines)
    return cells.header, whole, cells.notes, cells.synthetic, cells.commas, cells.layout, sign, values


def hostile(seed: int) -> tuple[str, str, str | None]:
    """Return what was done to a log, its text, and the separator that is stated."""
    rng = np.random.default_rng([36, seed])
    mark = str(rng.choice([",", ";", "\t"]))
    lines, done = log(rng, bool(rng.integers(2)), mark), []
    for _ in range(int(rng.integers(0, 3))):
        name = str(rng.choice(list(HARM)))
        lines = HARM[name](lines, int(rng.choice([1, 2, 590, 602, 900, len(lines) - 2, len(lines) - 1])), mark)
        done.append(name)
    end = str(rng.choice(list(ENDS)))
    return f"{done} {end}", ENDS[end]("\n".join(lines)), mark if rng.random() < 0.2 else None


def check(seed: int) -> bool:
    """Fail where the ways differ; return whether the log was read in blocks."""
    done, text, separator = hostile(seed)
    assert read(table_of_text, text, separator) == read(cells_of_text, text, separator), (seed, done)
    try:
        return any(isinstance(c, NumberColumn) for c in table_of_text(text, "log.csv", separator).columns)
    except ThermidError:
        return False


@pytest.fixture(autouse=True)
def small_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(columns, "LINES_AT_ONCE", 600)


def test_hostile_logs_are_read_as_cell_by_cell() -> None:
    assert sum(check(seed) for seed in range(24)) >= 6


@pytest.mark.campaign
def test_many_hostile_logs_are_read_as_cell_by_cell() -> None:
    assert sum(check(seed) for seed in range(1000, 1600)) >= 150


def test_a_cell_is_looked_up_where_it_stands(tmp_path: Path) -> None:
    text = "\n".join(log(np.random.default_rng(1), False, ",")) + "\n"
    column = table_of_text(text, "log.csv", None).columns[1]
    assert isinstance(column, NumberColumn)
    plain = cells_of_text(text, "log.csv", None).columns[1]
    assert [column[k] for k in (0, -1, 700)] == [plain[k] for k in (0, -1, 700)]
    assert [*column] == [*plain]
    with pytest.raises(IndexError):
        column[ROWS]


def test_memory_stays_two_and_a_half_times_the_numbers(tmp_path: Path) -> None:
    """Text of the file, numbers and channels in SI among them, though each of these is as large as the numbers."""
    file, names, count = tmp_path / "log.csv", [f"T{k}" for k in range(11)], 100_000
    cells = ",".join(f"{20.0 + k:.4f}" for k in range(11))
    head = ",".join(["time_s", *(f"{name} [degC]" for name in names)])
    peaks = []
    for rows in (1000, count):  # the first loads what is loaded once
        file.write_text("\n".join([head, *(f"{t},{cells}" for t in range(rows)), ""]))
        tracemalloc.start()
        try:
            read_record(file, {name: {"node": name} for name in names})
            peaks.append(tracemalloc.get_traced_memory()[1])
        finally:
            tracemalloc.stop()
    assert peaks[1] < 2.5 * 8 * 12 * count
