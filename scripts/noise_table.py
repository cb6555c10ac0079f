"""Write the section of docs/coverage.md on consumers of a likelihood and kinds of noise: ``python scripts/noise_table.py --logs 40``."""

from __future__ import annotations

import argparse
import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from recovery.noise_cases import Cell

ROOT = Path(__file__).parent.parent
PAGE = ROOT / "docs" / "coverage.md"
BEGIN, END = "<!-- noise: begin -->", "<!-- noise: end -->"
SEED = 20261122
DEAR = {
    "profile": 4,
    "posterior": 10,
    "next_test": 4,
    "next_test, room repeated": 10,
    "power_history": 10,
    "clock": 10,
}
"""Consumers that take so many times as long, and get so many times fewer logs."""


def binomial_range(count: int, level: float = 0.95, sure: float = 0.99) -> tuple[float, float]:
    """Return the shares between which so many independent intervals that hold with a level lie with a probability."""
    chances = [math.comb(count, k) * level**k * (1.0 - level) ** (count - k) for k in range(count + 1)]
    tail, low, high = 0.5 * (1.0 - sure), 0, count
    while sum(chances[: low + 1]) <= tail:
        low += 1
    while high > 0 and sum(chances[high:]) <= tail:
        high -= 1
    return low / count, high / count


def shown(cell: Cell, promises: bool) -> str:
    """Return a cell: the lowest and the highest share among what was stated, bold below the 99 % range; refusals; sizes of promises."""
    if not cell.claims:
        return "declined"
    names = sorted(cell.shares, key=cell.shares.__getitem__)
    worst, best = cell.shares[names[0]], cell.shares[names[-1]]
    low, _ = binomial_range(cell.claims[names[0]])
    text = f"{100 * worst:.0f}" + (f" to {100 * best:.0f}" if round(100 * best) > round(100 * worst) else "") + " %"
    text = f"**{text}**" if worst < low - 1e-9 else text
    refused = sum(cell.declined.values())
    text += f", {refused} declined" if refused else ""
    sizes = [v**0.5 for v in cell.squares.values() if v == v]
    return text + (f"; {min(sizes):.2f} to {max(sizes):.2f}" if promises and sizes else "")


def row(consumer: str, logs: int) -> str:
    """Return the row of a consumer."""
    from recovery.noise_cases import KINDS, campaign

    count, cells = max(4, logs // DEAR.get(consumer, 1)), []
    for kind in KINDS:
        cell = campaign(consumer, kind, count, SEED)
        scores = {n: round(v**0.5, 2) for n, v in cell.squares.items()}
        print(consumer, "|", kind, "|", count, shown(cell, True), "|", scores, cell.declined, flush=True)
        cells.append(shown(cell, consumer.startswith("next_test")))
    return f"| {consumer} | {count} | {' | '.join(cells)} |"


def section(rows: list[str], logs: int) -> str:
    """Return the section."""
    from recovery.noise_cases import KINDS

    low, high = binomial_range(logs)
    head = f"| consumer | logs | {' | '.join(KINDS)} |\n|{'---|' * (len(KINDS) + 2)}"
    return f"""{BEGIN}
## Noise: what each consumer of a likelihood makes of it

Synthetic logs of a heated plate under a cover ({logs} a cell, fewer where a consumer is slow; truth, phases of the sensors' steps and
noise are drawn anew): the lowest and the highest share of 95 % intervals that hold the truth among the values that a consumer states.
White noise is 0.05 K; autocorrelated noise adds 0.1 K over 300 s; sensors in steps read with 0.02 K of noise before rounding, and "found"
says nothing of noise and step; the noise of the ambient (0.5 K) and of the power (0.6 of 6 W) is never stated. Of {logs} intervals that
hold with 95 %, {100 * low:.0f} to {100 * high:.0f} % do with a probability of 99 %; shares below the range of their count are bold.
`next_test` promises the error of a refit with the same test made again, with the same instruments in a room up to 1 K warmer or colder;
behind its shares stands the root mean square of the errors of refits, over the promise. "Room repeated" is the same in an identical room,
where both logs round alike: there the error counts that `next_test` promises for that case.
`energy_balance` states whether a fitted model of the right structure closes. Made by
`python scripts/noise_table.py --logs {logs}`.

{head}
{chr(10).join(rows)}

`power_history` states twelve means a log, of which the lowest share is shown: of twelve shares that hold, one in some twenty cells
lies below the range.
Shares above the range: an error that is even between two limits, as that of a mean in steps, never leaves 1.96 of its standard deviations
(the root mean square of errors over what is stated is 0.9 where the noise before rounding is stated, and 0.7 where it is not and two
levels alone show it); an energy balance adds such errors of two means. Without a logged power the column "noisy power" repeats white noise
for `power_history`.
{END}"""


def main() -> None:
    """Write the section in its place."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--logs", type=int, default=400)
    parser.add_argument("--only", nargs="*", default=[], help="consumers whose rows are made again; all by default")
    parser.add_argument("--page", type=Path, default=PAGE)
    given = parser.parse_args()
    sys.path.insert(0, str(ROOT / "tests"))
    from recovery.noise_cases import CONSUMERS

    for consumer in given.only or CONSUMERS:
        made = row(consumer, given.logs)
        text = given.page.read_text(encoding="utf-8")  # a row at a time: what was made stays where the rest is interrupted
        before, _, rest = text.partition(BEGIN)
        old, _, after = rest.partition(END)
        rows = {
            name: line for line in old.splitlines() if (name := line.split("|")[1].strip() if line.startswith("| ") else "") in CONSUMERS
        }
        rows[consumer] = made
        own = section([rows[c] for c in CONSUMERS if c in rows], given.logs)
        given.page.write_text(f"{before.rstrip()}\n\n{own}{after or chr(10)}", encoding="utf-8")


if __name__ == "__main__":
    main()
