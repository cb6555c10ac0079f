"""`make torture MINUTES=8`: mutants of files, commands and arguments, random networks, kills and full disks; a table of counts.

    python scripts/torture.py --minutes 8 [--seed 1] [--page docs/torture.md]

Six tenths of the time go to mutants, three to random networks against independent solvers, one to jobs that are killed or find the disk
full at calls that write. The exit code is 1 when there is a finding; each is printed with its seed.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

from thermid.errors import CAPS

ROOT = Path(__file__).parent.parent
ENVIRONMENT = {**os.environ, "OMP_NUM_THREADS": "1", "PYTHONPATH": str(ROOT / "tests"), "PYTHONDONTWRITEBYTECODE": "1"}
MUTANTS = {"python": ("files read in Python", 0.3), "commands": ("files given to commands", 0.2), "calls": ("arguments of functions", 0.1)}
JOBS = (("values", "kill"), ("values", "full"), ("plan", "full"), ("decks", "kill"))
"""Jobs of tests/unit/interrupted.py and what happens to them, as far as the time allows."""
Row = tuple[str, int, list[str]]


def run(*command: str) -> subprocess.CompletedProcess[str]:
    """Run a part of the tests in a process of its own."""
    return subprocess.run([sys.executable, *command], capture_output=True, text=True, cwd=ROOT / "tests", env=ENVIRONMENT, check=False)


def mutants(how: str, seconds: float, seed: int) -> tuple[Row, dict[str, int]]:
    """Return how many mutants were tried and what was found, and their numbers by kind."""
    made = run("-m", "torture.files", how, f"{seconds:.0f}", str(seed))
    if made.returncode:
        return (MUTANTS[how][0], 0, [f"the process ended with {made.returncode}: {made.stderr[-300:]}"]), {}
    found = json.loads(made.stdout)
    lines = [f"{what} ({number} times, seed '{first}')" for what, (number, first) in found["findings"].items()]
    return (MUTANTS[how][0], sum(found["counts"].values()), lines), found["counts"]


def networks(seconds: float, seed: int) -> Row:
    """Return how many random networks were solved and what was found."""
    made = run(str(ROOT / "scripts/fuzz.py"), "--minutes", f"{seconds / 60.0:.3f}", "--seed", str(seed))
    *found, last = made.stdout.splitlines() or ["0 cases"]
    return "random networks against independent solvers", int(last.split()[0]), found


def kills(seconds: float) -> Row:
    """Return how many jobs were disturbed at a call that writes, and what was wrong."""
    every, runs, wrong = max(1, round(240.0 / max(seconds, 1.0))), 0, []
    for job, how in JOBS:
        with tempfile.TemporaryDirectory() as folder:
            made = run("unit/interrupted.py", job, folder, how, str(every))
            found = json.loads(made.stdout.splitlines()[-1]) if made.returncode == 0 else {"runs": 0, "wrong": [made.stderr[-300:]]}
        runs += found["runs"]
        wrong += [f"{job}, {how}: {each}" for each in found["wrong"]]
    return "jobs killed or on a full disk, at calls that write", runs, wrong


def main() -> int:
    """Run all parts; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=8.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--page", type=Path, help="file to which the table is written")
    given = parser.parse_args()
    seconds = 60.0 * given.minutes
    rows: list[Row] = []
    kinds: dict[str, dict[str, int]] = {}
    for how, (_, share) in MUTANTS.items():
        row, kinds[how] = mutants(how, share * seconds, given.seed)
        rows.append(row)
    rows += [networks(0.3 * seconds, given.seed), kills(0.1 * seconds)]
    lines = ["| part | cases | findings |", "|---|---|---|", *(f"| {name} | {count:,} | {len(found)} |" for name, count, found in rows)]
    text = "\n".join(lines)
    print(text)
    for _, _, found in rows:
        print("\n".join(f"finding: {each}" for each in found), end="\n" if found else "")
    if given.page:
        given.page.write_text(page(text, kinds, given), encoding="utf-8")
    return 1 if any(found for _, _, found in rows) else 0


def page(table: str, kinds: dict[str, dict[str, int]], given: argparse.Namespace) -> str:
    """Return the page with the table, and the mutants by kind."""
    names = list(dict.fromkeys(name for how in ("python", "commands") for name in kinds[how]))
    by_kind = [f"| {name} | {kinds['python'].get(name, 0):,} | {kinds['commands'].get(name, 0):,} |" for name in names]
    return (
        (ROOT / "scripts/torture.md")
        .read_text(encoding="utf-8")
        .format(
            table=table,
            kinds="\n".join(by_kind),
            caps="\n".join(f"| `{name}` | {most:g} | {what} |" for name, (most, what) in CAPS.items()),
            minutes=f"{given.minutes:g}",
            seed=given.seed,
        )
    )


if __name__ == "__main__":
    sys.exit(main())
