"""Make two tables of docs/coverage.md: how often intervals contain the true values. ``python scripts/coverage.py`` takes some minutes.

``--only mismatched --draws 60`` makes one of them, of so many campaigns.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parent.parent
PAGE = ROOT / "docs" / "coverage.md"
SEED = 20261121
HEADS = {
    "matched": "| assembly | value or node | 95 % interval contains the true value | half-width | without constant errors | half-width |",
    "mismatched": "| assembly | scenario | node | rise | contains the true value | half-width | error | without | half-width | error |",
}


def matched(draws: int) -> Iterator[str]:
    """Yield the rows of the table of matched truths; without constant errors of three tenths of the draws."""
    from recovery.matched import CASES, campaign

    for case in CASES:
        known, blind = campaign(case, draws, SEED), campaign(case, max(1, draws * 3 // 10), SEED, biases=False)
        for name, row in known.items():
            other = blind[name]
            yield (
                f"| {case} | `{name}` | {100 * row.coverage:.1f} % | {row.half:.2g} {row.unit} "
                f"| {100 * other.coverage:.1f} % | {other.half:.2g} {other.unit} |"
            )


def mismatched(draws: int) -> Iterator[str]:
    """Yield the rows of the table of truths of another law, and how many campaigns were refused."""
    from recovery.mismatch import CASES, campaign

    refused = {}
    for case in CASES:
        for (scenario, node), h in campaign(case, draws, SEED).items():
            refused[case] = h.refused
            yield (
                f"| {case} | {scenario} | `{node}` | {float(sorted(h.rise)[h.rise.size // 2]):.1f} "
                f"| {100 * h.coverage():.1f} % | {h.half_width():.2f} | {h.rms():.2f} "
                f"| {100 * h.coverage(False):.1f} % | {h.half_width(False):.2f} | {h.rms(False):.2f} |"
            )
    yield f"\nRefused: {' and '.join(f'{count} of the {case}' for case, count in refused.items())}."


def main() -> None:
    """Make the tables that are asked for, and lay them into the page."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--only", nargs="*", choices=HEADS, default=list(HEADS))
    parser.add_argument("--draws", type=int, default=1000)
    options = parser.parse_args()
    sys.path.insert(0, str(ROOT / "tests"))
    for name in options.only:
        rows = "\n".join((matched if name == "matched" else mismatched)(options.draws))
        begin, end = f"<!-- {name}: begin -->", f"<!-- {name}: end -->"
        before, _, rest = PAGE.read_text(encoding="utf-8").partition(begin)
        made = f"Made by `python scripts/coverage.py --only {name} --draws {options.draws}`."
        head = f"{HEADS[name]}\n|{'---|' * (HEADS[name].count('|') - 1)}"
        PAGE.write_text(f"{before}{begin}\n{head}\n{rows}\n\n{made}\n{end}{rest.partition(end)[2]}", encoding="utf-8")


if __name__ == "__main__":
    main()
