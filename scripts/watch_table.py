"""Write the section of docs/coverage.md on watched tests: ``python scripts/watch_table.py --tests 1000 --hidden 200 --hours 240``."""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from recovery.watch_cases import Outcome

ROOT = Path(__file__).parent.parent
DATA = ROOT.parent / "shared" / "data"
PAGE = ROOT / "docs" / "coverage.md"
BEGIN, END = "<!-- watch: begin -->", "<!-- watch: end -->"
LENGTH = 6.0
"""Hours of one test without a fault."""
GROWTH = (1.0, 100.0)
"""Hours of a growing log after which memory is measured."""


def upper(wrong: int, count: int) -> float:
    """Return the upper 95 % limit of a share (Clopper and Pearson). [-]"""
    from scipy.stats import beta

    return 1.0 if wrong >= count else float(beta.ppf(0.95, wrong + 1, count - wrong))


def row(kind: str, found: Sequence[Outcome]) -> str:
    """Return a row of the table of tests."""
    import numpy as np

    stopped = [o for o in found if o.stopped]
    wrong = sum(o.wrong for o in stopped)
    saving = "-"
    if stopped:
        low, middle, high = np.quantile([o.saving for o in stopped], [0.1, 0.5, 0.9])
        saving = f"{100 * middle:.0f} % ({100 * low:.0f} to {100 * high:.0f} %)"
    alarms = sum(bool(o.alarms) for o in found)
    share = f"{wrong} ({100 * upper(wrong, len(stopped)):.1f} %)" if stopped else "-"
    declined = len(found) - len(stopped)
    return f"| {kind} | {len(found)} | {len(stopped)} | {share} | {saving} | {declined} ({100 * declined / len(found):.0f} %) | {alarms} |"


def tests(count: int) -> str:
    """Return the table of tests with nothing hidden."""
    from recovery.watch_cases import KINDS, WITHOUT, drawn, watched

    found = {kind: [watched(drawn(seed)) for seed in range(k, count, len(KINDS))] for k, kind in enumerate(KINDS)}
    rows = [row(kind, outcomes) for kind, outcomes in found.items()]
    rows.append(row("**all with a deck**", [o for outcomes in found.values() for o in outcomes]))
    rows.append(row(WITHOUT, [watched(drawn(seed, WITHOUT)) for seed in range(max(count // 10, 1))]))
    head = (
        "| deck of the watcher | tests | stopped | wrong stops (upper 95 % limit) | median saving (10 to 90 %) | declined | false alarms |"
    )
    return "\n".join([head, "|---|---|---|---|---|---|---|", *rows])


def hidden(count: int) -> str:
    """Return what was done with hidden masses."""
    from recovery.watch_cases import drawn, hiding, watched

    found = [watched(hiding(case, watched(case).at)) for case in map(drawn, range(count))]
    stopped = [o for o in found if o.stopped]
    wrong = sum(o.wrong for o in stopped)
    return (
        "Hidden masses, behind a link of 0.05 to 0.4 W/K on the case, which the deck lacks, with a time constant of 3 to 10 times the time "
        f"at which the same test without it was stopped: of {count} tests {count - len(stopped)} were declined, {len(stopped) - wrong} "
        f"stopped rightly and {wrong} wrongly ({100 * (1 - wrong / count):.1f} % declined or right)."
    )


def faults(count: int) -> str:
    """Return which planted faults were named."""
    from recovery.watch_cases import named, planted

    kinds, right = Counter[str](), Counter[str]()
    for seed in range(count):
        kind = planted(seed)[0]
        kinds[kind] += 1
        right[kind] += named(seed)
    each = ", ".join(f"{kind} {right[kind]} of {kinds[kind]}" for kind in kinds)
    return (
        "Planted faults (a fan that slows, a joint that opens, a power that falls, a sensor that is off, slips, goes silent or drifts by "
        f"3 to 12 K/h): {right.total()} of {count} named within five minutes after their effect exceeds five times the noise ({each})."
    )


def quiet_hours(hours: float) -> str:
    """Return the false alarms of tests where nothing fails."""
    from recovery.watch_cases import quiet

    count, looks, alarms, begun = max(round(hours / LENGTH), 1), 0, 0, time.process_time()
    for seed in range(count):
        said = [bool(look.alarms) for look in quiet(seed, LENGTH)]
        looks += len(said)
        alarms += any(said)
    each = 1000.0 * (time.process_time() - begun) / looks
    return (
        f"False alarms with a deck: {alarms} in {LENGTH * count:g} h of synthetic tests without a fault, one look a minute "
        f"({looks} looks, {each:.0f} ms each)."
    )


def real(data: Path) -> str:
    """Return what was said of the real logs."""
    from recovery.watch_cases import replayed

    found = [o for o in map(replayed, sorted([*data.rglob("*.csv"), *data.rglob("*.csv.gz")])) if o is not None]
    hours = sum(o.hours for o in found)
    stops = [s for o in found for s in o.stops]
    alarms = [f"{o.name}: {a}" for o in found for a in o.alarms]
    told = "".join(f"\n- {a}" for a in alarms)
    return (
        f"Real logs replayed, readings alone: {len(found)} logs, {hours:.0f} sensor hours, a look a minute. A stop was advised in "
        f"{len(stops)} logs; in {sum(stops)} of them the readings that followed left the forecast. Alarms: {len(alarms)}"
        f"{f':{chr(10)}{told}' if alarms else '.'}"
    )


def memory() -> str:
    """Return the resident memory of a watch of a growing log after an hour and after a hundred."""
    with tempfile.TemporaryDirectory() as folder:
        done = subprocess.run(
            [sys.executable, __file__, "--grow", folder, *map(str, GROWTH)], check=True, capture_output=True, text=True, cwd=ROOT
        )
    said = json.loads(done.stdout.splitlines()[-1])
    sizes = " and ".join(f"{mb:.0f} MB after {h:g} h ({rows} rows, {kept} kept)" for h, mb, rows, kept in said)
    return (
        "Resident memory of a watch with a deck on a growing text log, one reading of two sensors a second, a look every ten minutes: "
        f"{sizes}."
    )


def grow(folder: Path, hours: Sequence[float]) -> None:
    """Write a log that grows, watch it in this process, and print resident memory at some hours."""
    from recovery.watch_cases import growing

    resident = []
    for at, rows, kept in growing(folder, max(hours)):
        if any(abs(at - h) < 1e-6 for h in hours):
            pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
            resident.append((at, pages * 4096 / 1e6, rows, kept))
    print(json.dumps(resident))


def section(asked: argparse.Namespace) -> str:
    """Return the section."""
    parts = []
    for make in (
        lambda: tests(asked.tests),
        lambda: hidden(asked.hidden),
        lambda: faults(asked.faults),
        lambda: quiet_hours(asked.hours),
        lambda: real(asked.data) if asked.data.is_dir() else "The real logs are not here.",
        memory,
    ):
        begun = time.process_time()
        parts.append(make())
        print(parts[-1], f"[{time.process_time() - begun:.0f} s]", flush=True)
    return f"""{BEGIN}
## Watched tests

`thermid watch` on synthetic tests of a heated chip, a case with a film and a lid nobody measures. Conductances, films and power are
drawn about the rig's by 30 %, noise is 0.02 to 0.1 K, a reading comes every 5 to 20 s. Asked is +- 1 K; the plan's rule is
'3 C/h'. A stop is wrong where one channel ends more than 1 K from its forecast. Saving is the part of the time until all measured
channels meet the rule that is not waited; a stop before the rule needs a plan that allows it. Made by
`python scripts/watch_table.py --tests {asked.tests} --hidden {asked.hidden} --faults {asked.faults} --hours {asked.hours:g}`.

{parts[0]}

Declined with a deck off by 2 %: where a channel ends some 40 K above the ambient, 2 % in each value move its end by more than
1 K, and the deck then says no more of a hidden mass than the readings do. Without a deck no forecast is narrow enough before the rule
holds.

{chr(10).join(f"{part}{chr(10)}" for part in parts[1:])}{END}"""


def main() -> None:
    """Write the page."""
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument("--tests", type=int, default=1000, help="tests with a deck; a tenth as many without")
    asked.add_argument("--hidden", type=int, default=200, help="tests with a hidden mass")
    asked.add_argument("--faults", type=int, default=40, help="planted faults")
    asked.add_argument("--hours", type=float, default=240.0, help="hours of tests without a fault")
    asked.add_argument("--data", type=Path, default=DATA, help="folder of the real logs")
    asked.add_argument("--grow", nargs=3, help=argparse.SUPPRESS)
    given = asked.parse_args()
    sys.path.insert(0, str(ROOT / "tests"))
    if given.grow:
        grow(Path(given.grow[0]), [float(h) for h in given.grow[1:]])
        return
    text = section(given)
    page = PAGE.read_text(encoding="utf-8")
    PAGE.write_text(page[: page.index(BEGIN)] + text + page[page.index(END) + len(END) :], encoding="utf-8")


if __name__ == "__main__":
    main()
