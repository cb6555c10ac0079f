"""Write the section of docs/coverage.md on fits with process noise: ``python scripts/process_table.py --cases 1000``."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from recovery.process_cases import Fitted

ROOT = Path(__file__).parent.parent
PAGE = ROOT / "docs" / "coverage.md"
BEGIN, END = "<!-- process noise: begin -->", "<!-- process noise: end -->"
SAMPLES = 1000


def section(found: Sequence[Fitted], samples: int) -> str:
    """Return the section."""
    import numpy as np

    from recovery.process_cases import NAMES, SHARE, rejected, shares

    off = np.array([f.off for f in found])
    said = np.median([f.said for f in found], axis=0)
    rows = []
    for k, (name, share) in enumerate(shares(found).items()):
        text = f"{100 * share:.1f} %"
        text = text if SHARE[0] < share < SHARE[1] else f"**{text}**"
        rows.append(f"| {name} | {text} | {off[:, k].mean():+.2f} | {off[:, k].std():.2f} | {100 * said[k]:.1f} % |")
    assert len(rows) == len(NAMES)
    return f"""{BEGIN}
## Process noise

Synthetic logs of a house ({len(found)} logs of {samples} half-hourly readings of the indoor air): two masses, a wall driven by white
noise, a heater switched at random, an outside that is logged. The four values, both noises and the start of each search are drawn about
the house's by 30 %. Fitted are the four values, the noise of the wall and that of the readings, with `estimate`'s likelihood. Of a
thousand intervals that hold with 95 %, {100 * SHARE[0]:.1f} to {100 * SHARE[1]:.1f} % do; shares outside are bold. z is the error in
logarithms over its standard error. Made by `python scripts/process_table.py --cases {len(found)}`.

| value | inside | mean of z | deviation of z | median standard error |
|---|---|---|---|---|
{chr(10).join(rows)}

Innovations are judged as residuals are, by the correlation of neighbours at the 99 % level: {100 * rejected(found):.1f} % of the logs
are called not white.
Searches that did not converge: {sum(not f.converged for f in found)}. Filter and smoother agree with one dense normal distribution of
all states and readings to 1e-9 (`tests/unit/fit/estimation/test_filter.py`).
{END}"""


def main() -> None:
    """Write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=1000)
    given = parser.parse_args()
    sys.path.insert(0, str(ROOT / "tests"))
    from threadpoolctl import threadpool_limits

    from recovery.process_cases import fitted

    with threadpool_limits(limits=1):
        text = section([fitted(seed, SAMPLES) for seed in range(given.cases)], SAMPLES)
    page = PAGE.read_text(encoding="utf-8")
    before, _, rest = page.partition(BEGIN)
    after = rest.partition(END)[2]
    PAGE.write_text(f"{before.rstrip()}\n\n{text}{after or chr(10)}", encoding="utf-8")


if __name__ == "__main__":
    main()
