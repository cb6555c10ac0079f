"""How often the test of inherited values is right on autocorrelated residuals: the table of docs/levels.md.

``python scripts/shifts.py [--cases 200] [--write]`` prints the table, or writes it there; a quarter of an hour on two processors.
"""

from __future__ import annotations

import argparse
import multiprocessing
import sys
from pathlib import Path
from typing import TYPE_CHECKING

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "levels.md"
SEED = 20261122
sys.path.insert(0, str(ROOT / "tests"))

if TYPE_CHECKING:
    from recovery.shift_cases import Cell, Count


def one(asked: tuple[Cell, int]) -> Count:
    """Return what was said in one cell."""
    from recovery.shift_cases import counted

    return counted(*asked, SEED)


def table(cases: int) -> str:
    """Return the table in Markdown, a line per layout and size of the deviation; ranges are over its correlation times."""
    from recovery.shift_cases import CELLS

    with multiprocessing.Pool(2) as pool:
        found = dict(zip(CELLS, pool.map(one, [(cell, cases) for cell in CELLS], chunksize=1), strict=True))
    heads = ["sensors, records, values", "deviation, K", "error, %", "false, %", "found, %", "not rejected, %", "shift of 11 %, %"]
    lines = ["| " + " | ".join(heads) + " |", "|" + "---|" * len(heads)]
    for layout in dict.fromkeys((c.sensors, c.records, c.values) for c in CELLS):
        for slow in dict.fromkeys(c.slow for c in CELLS):
            some = [k for c, k in found.items() if (c.sensors, c.records, c.values, c.slow) == (*layout, slow)]
            cells = [range_of([100 * k.error for k in some], 1)]
            cells += [range_of([100 * getattr(k, name) for k in some]) for name in ("false", "found", "quiet", "missed")]
            lines.append(f"| {', '.join(map(str, layout))} | {slow} | " + " | ".join(cells) + " |")
    every = list(found.values())
    false, hit = ([100 * getattr(k, name) for k in every] for name in ("false", "found"))
    missed, largest = (100 * max(getattr(k, name) for k in every) for name in ("missed", "largest"))
    lines.append(
        f"\nOver all: false {sum(false) / len(false):.1f} % (largest {max(false):.1f} %), found {sum(hit) / len(hit):.1f} % (smallest "
        f"{min(hit):.1f} %), the shift of 11 % called not rejected in at most {missed:.1f} %; no value was called so with a detectable "
        f"shift above {largest:.1f} %."
    )
    return "\n".join(lines)


def range_of(numbers: list[float], digits: int = 0) -> str:
    """Return smallest and largest, once where they agree."""
    low, high = (f"{v:.{digits}f}" for v in (min(numbers), max(numbers)))
    return low if low == high else f"{low} to {high}"


def main() -> None:
    """Print or write the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=200)
    parser.add_argument("--write", action="store_true")
    given = parser.parse_args()
    made = table(given.cases)
    if not given.write:
        print(made)
        return
    before, _, rest = PAGE.read_text(encoding="utf-8").partition("<!-- shifts -->\n")
    PAGE.write_text(f"{before}<!-- shifts -->\n{made}\n<!-- end -->{rest.partition('<!-- end -->')[2]}", encoding="utf-8")


if __name__ == "__main__":
    main()
