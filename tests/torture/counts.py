"""Counts of tests that judge by separate solutions: campaigns drawn at random, and networks whose run ends on an edge.

``python -m torture.counts campaigns|edges NUMBER FIRST`` in the folder tests prints one JSON object.
"""

from __future__ import annotations

import json
import sys
import tempfile
import warnings
from collections import Counter
from pathlib import Path
from typing import Any

from properties.test_ends_on_edges import check
from unit.campaign.test_random_campaigns import ERRORS, VALUES, compare


def campaigns(number: int, first: int) -> dict[str, Any]:
    """Compare campaigns with a least-squares fit that shares no code with the package; values, errors and places that are not named."""
    counts: Counter[str] = Counter()
    found: list[str] = []
    apart, wider = 0.0, 0.0
    for seed in range(first, first + number):
        with tempfile.TemporaryDirectory() as place:
            try:
                seen = compare(seed, Path(place))
            except Exception as error:  # what ends a campaign is a finding
                found.append(f"{seed}: {type(error).__name__}: {str(error)[:300]}")
                counts["wrong"] += 1
                continue
        counts["with white residuals" if seen.plain else "with residuals that wander"] += 1
        apart, wider = max(apart, seen.apart), max(wider, seen.wider)
    said = f"values at most {apart:.3f} standard errors apart (allowed {VALUES}), errors {100.0 * wider:.2f} % ({100 * ERRORS:.0f} %)"
    return {"counts": counts, "findings": found, "measured": {"campaigns": said}}


def edges(number: int, first: int) -> dict[str, Any]:
    """Compare runs that end on an edge with Radau: last sample, lowest and highest."""
    found: list[str] = []
    for seed in range(first, first + number):
        try:
            check(seed)
        except Exception as error:
            found.append(f"{type(error).__name__}: {str(error)[:300]}")
    return {"counts": {"right": number - len(found), "wrong": len(found)}, "findings": found}


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    sys.stdout.write(json.dumps({"campaigns": campaigns, "edges": edges}[sys.argv[1]](int(sys.argv[2]), int(sys.argv[3])), indent=1) + "\n")
