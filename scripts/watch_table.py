"""Write the section of docs/coverage.md on watched tests, or some of its parts: ``python scripts/watch_table.py --only hours log``."""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from recovery.watch_cases import Outcome

ROOT = Path(__file__).parent.parent
DATA = ROOT.parent / "shared" / "data"
PAGE = ROOT / "docs" / "coverage.md"
LENGTH = 6.0
"""Hours of one test without a fault."""
SPACINGS = (1, 5, 10, 20)
"""Minutes between looks."""
GROWTH = (1 / 24, 0.25, 0.5, 0.75, 1.0)
"""Shares of the hours of a growing log after which memory is measured."""


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


def looks(count: int) -> str:
    """Return what planted faults and clean tests alarm at looks of several spacings."""
    from recovery.watch_cases import alarmed, quiet, told_alike

    once = [alarmed(seed, 60.0) for seed in range(count)]
    rows = []
    for minutes in SPACINGS:
        every = 60.0 * minutes
        found = [alarmed(seed, every) if minutes > 1 else once[seed] for seed in range(count)]
        alike = sum(told_alike(f, o, every) for f, o in zip(found, once, strict=True))
        wrong = sum(any(look.alarms for look in quiet(seed, LENGTH, every)) for seed in range(count))
        rows.append(f"| {minutes} | {sum(f is not None for f in found)} | {alike} | {wrong} |")
    head = f"| minutes between looks | alarms on {count} planted faults | of the same, at the next look | alarms on {count} clean tests |"
    return "\n".join([head, "|---|---|---|---|", *rows])


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


def log(hours: float) -> str:
    """Return alarms, resident memory and time per look of a watch of one growing log."""
    with tempfile.TemporaryDirectory() as folder:
        done = subprocess.run(
            [sys.executable, __file__, "--grow", folder, str(hours)], check=True, capture_output=True, text=True, cwd=ROOT
        )
    said = json.loads(done.stdout.splitlines()[-1])
    rows = "\n".join(f"| {h:g} | {written:,} | {kept:,} | {mb:.1f} | {ms:.0f} |" for h, written, kept, mb, ms in said["stages"])
    return (
        f"One growing text log of {hours:g} h without a fault, a reading of two sensors a second, a look a minute with a deck "
        f"({said['looks']:,} looks): {said['alarms']} false alarms. The longest look took {said['longest']:.1f} s.\n\n"
        f"| hours | rows of the log | rows kept | resident memory [MB] | ms a look since the row above |\n|---|---|---|---|---|\n{rows}"
    )


def grow(folder: Path, hours: float) -> None:
    """Write a log that grows, watch it in this process, and print memory and times at some hours."""
    from recovery.watch_cases import growing

    stages: list[tuple[float, int, int, float, float]] = []
    spent, looks, longest, alarms = [0.0], 0, 0.0, 0
    for g in growing(folder, hours):
        looks, longest, alarms = looks + 1, max(longest, g.seconds), len(g.alarms)
        spent.append(g.seconds)
        if any(abs(g.hours - share * hours) < 1e-6 for share in GROWTH):
            pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
            stages.append((g.hours, g.rows, g.kept, pages * 4096 / 1e6, 1000.0 * sum(spent) / (len(spent) - 1)))
            spent = [0.0]
    print(json.dumps({"stages": stages, "looks": looks, "longest": longest, "alarms": alarms}))


DECLINED = """Declined with a deck off by 2 %: where a channel ends some 40 K above the ambient, 2 % in each value move its end by more than
1 K, and the deck then says no more of a hidden mass than the readings do. Without a deck no forecast is narrow enough before the rule
holds."""


def main() -> None:
    """Write the page, part by part."""
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument("--tests", type=int, default=1000, help="tests with a deck; a tenth as many without")
    asked.add_argument("--hidden", type=int, default=200, help="tests with a hidden mass")
    asked.add_argument("--faults", type=int, default=40, help="planted faults")
    asked.add_argument("--hours", type=float, default=240.0, help="hours of tests without a fault, and of the growing log")
    asked.add_argument("--looks", type=int, default=40, help="planted faults, and tests without one, at each spacing of looks")
    asked.add_argument("--data", type=Path, default=DATA, help="folder of the real logs")
    asked.add_argument(
        "--only", nargs="+", choices=("tests", "hidden", "faults", "looks", "hours", "log", "real"), help="parts that are made again"
    )
    asked.add_argument("--grow", nargs=2, help=argparse.SUPPRESS)
    given = asked.parse_args()
    sys.path.insert(0, str(ROOT / "tests"))
    if given.grow:
        grow(Path(given.grow[0]), float(given.grow[1]))
        return
    parts: dict[str, Callable[[], str]] = {
        "tests": lambda: f"{tests(given.tests)}\n\n{DECLINED}",
        "hidden": lambda: hidden(given.hidden),
        "faults": lambda: faults(given.faults),
        "looks": lambda: looks(given.looks),
        "hours": lambda: quiet_hours(given.hours),
        "log": lambda: log(given.hours),
        "real": lambda: real(given.data) if given.data.is_dir() else "The real logs are not here.",
    }
    for name in given.only or parts:
        begun = time.process_time()
        text = parts[name]()
        print(text, f"[{time.process_time() - begun:.0f} s]", flush=True)
        begin, end = (f"<!-- watch {name}: {word} -->" for word in ("begin", "end"))
        page = PAGE.read_text(encoding="utf-8")
        size = f" --{'hours' if name == 'log' else name} {getattr(given, 'hours' if name == 'log' else name):g}" if name != "real" else ""
        made = f"{begin}\n{text}\n\nMade by `python scripts/watch_table.py --only {name}{size}`.\n"
        PAGE.write_text(page[: page.index(begin)] + made + page[page.index(end) :], encoding="utf-8")


if __name__ == "__main__":
    main()
