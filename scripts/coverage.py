"""Write docs/coverage.md: how often stated intervals hold hidden truths. ``python scripts/coverage.py --draws 1000`` takes some minutes."""

from __future__ import annotations

import argparse
import re
import sys
from pathlib import Path

ROOT = Path(__file__).parent.parent
PAGE = ROOT / "docs" / "coverage.md"
SEED = 20261121
OTHERS = re.compile(r"^<!-- (?:heat paths|real runs|noise): begin -->", re.MULTILINE)
"""From here on the page is made by benchmarks/real_runs.py and scripts/noise_table.py."""
REFUSALS = (
    "There the joint ends at its bound, and its error spans all bounds: it drops a third of a kelvin while each sensor may be 0.25 K off\n"
    "and the meters 1 %, and the constant law pulls it further. A refusal that names these instruments is the right answer to such a log."
)


def matched(draws: int) -> list[str]:
    """Return the rows of the table of matched truths."""
    from recovery.matched import CASES, campaign

    lines = []
    for case in CASES:
        known, blind = campaign(case, draws, SEED), campaign(case, max(1, draws * 3 // 10), SEED, biases=False)
        for name, row in known.items():
            other = blind[name]
            lines.append(
                f"| {case} | `{name}` | {100 * row.coverage:.1f} % | {row.half:.2g} {row.unit} "
                f"| {100 * other.coverage:.1f} % | {other.half:.2g} {other.unit} |"
            )
    return lines


def mismatched(draws: int) -> list[str]:
    """Return the rows of the table of truths of another law."""
    from recovery.mismatch import CASES, campaign

    lines, refused = [], {}
    for case in CASES:
        for (scenario, node), h in campaign(case, max(1, draws * 3 // 10), SEED).items():
            refused[case] = h.refused
            lines.append(
                f"| {case} | {scenario} | `{node}` | {float(sorted(h.rise)[h.rise.size // 2]):.1f} "
                f"| {100 * h.coverage():.1f} % | {h.half_width():.2f} | {h.rms():.2f} "
                f"| {100 * h.coverage(False):.1f} % | {h.half_width(False):.2f} | {h.rms(False):.2f} |"
            )
    counts = " and ".join(f"{count} of the {case}" for case, count in refused.items())
    return [*lines, "", f"Refused, and not in the table: {counts}. {REFUSALS}"]


def page(draws: int) -> str:
    """Return the page."""
    text = f"""# Coverage

How often stated 95 % intervals hold hidden truths, in {draws} synthetic campaigns (matched) and {draws * 3 // 10} (without constant errors;
mismatched). Made by `python scripts/coverage.py`; the campaigns are in `tests/recovery`, and a run of 25 draws is a test.

## Matched: the truth follows the model

Truths are drawn from their ranges, constant errors of sensors (0.25 K, one standard deviation) and meters (1 %) from their accuracies. Logs
have noise of 0.05 K, steps of 1/16 K and a room that drifts by 0.5 K; two tests of five hours, 101 samples each. Predicted is the end of a
test that no fit saw: a room at 45 C from a start at 20 C, powers 1.5 and 0.5 times as large in turn. On the right the same fits without a
model of constant errors: the misfit shows and widens their intervals, which hardly ever hold the truth all the same.
A share of 95 % scatters by 0.7 % in 1000 draws. The intervals are of the right size where a share leaves 93 to 97 %: of `d.case` the mean
square of truth less prediction, in standard errors, is 0.95 +- 0.09 (250 draws), and 0.98 where nothing is added for residuals that seem
to wander, which in rounded readings one fit in six does. That one share of sixteen is so far off has a chance of one in twenty-five.

| assembly | value or node | 95 % interval holds the truth | half-width | without constant errors | half-width |
|---|---|---|---|---|---|
"""
    text += "\n".join(matched(draws))
    text += """

## Mismatched: the truth convects by dT^0.25 and radiates, the model has one constant coefficient a surface

Hidden coefficients are drawn between 0.8 and 2.2 W/(m^2 K) at 1 K and emissivities between 0.05 and 0.9. Fitted is one test at 24 C.
Half-widths and errors (root mean square of truth less prediction) are in kelvin, rises are those of the truth (median). On the right the
same predictions without the discrepancy of [decision 034](decisions/034-constant-coefficients.md).

| assembly | scenario | node | rise | holds the truth | half-width | error | without | half-width | error |
|---|---|---|---|---|---|---|---|---|---|
"""
    return text + "\n".join(mismatched(draws)) + "\n"


def main() -> None:
    """Write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--draws", type=int, default=1000)
    sys.path.insert(0, str(ROOT / "tests"))
    before = PAGE.read_text(encoding="utf-8") if PAGE.exists() else ""
    kept = before[found.start() :] if (found := OTHERS.search(before)) else ""
    PAGE.write_text(page(parser.parse_args().draws) + ("\n" + kept if kept else ""), encoding="utf-8")


if __name__ == "__main__":
    main()
