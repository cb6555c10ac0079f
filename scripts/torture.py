"""`make torture MINUTES=8`: mutants of files, commands and arguments, random networks, kills, outputs, a hostile client; a table of counts.

    python scripts/torture.py --minutes 8 [--seed 1] [--only PART ...] [--kept scripts/torture.json] [--page docs/torture.md]

Each part takes its share of the minutes, or with `--only` all of them; `--count` gives a number of cases in place of a time, and `--aim`
that of the page. What a part found is kept in a file of this repository, with its seed and day, so that long parts can be run one at a
time and a short run loses no row: the page shows the largest run of each part, or a later one that found something. Notes about findings
are written there by hand and stay. The exit code is 1 when there is a finding; each is printed with its seed.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from thermid.base.errors import CAPS

ROOT = Path(__file__).parent.parent
ENVIRONMENT = {
    **os.environ,
    "OMP_NUM_THREADS": "1",
    "PYTHONPATH": str(ROOT / "tests"),
    "PYTHONDONTWRITEBYTECODE": "1",
    "PYTHONHASHSEED": "0",
}
JOBS = ("values", "plan", "decks", "studio", "simulate", "hold", "calibrate", "report")
"""Jobs of tests/unit/interrupted.py, the quick ones first."""
BESIDE = 45
"""Cases that scripts/accused_logs.py runs beside its synthetic plants: 21 real logs and 24 planted mistakes."""
Found = dict[str, Any]
"""Counts, findings, and what else a part measures."""


@dataclass(frozen=True)
class Part:
    """A part of the torture: its words in the table, its share of the time, what runs it, and the aim of the project."""

    title: str
    share: float
    run: Callable[[float, int, int], Found]
    aim: int | str = ""


def run(*command: str) -> subprocess.CompletedProcess[str]:
    """Run a part of the tests in a process of its own."""
    return subprocess.run([sys.executable, *command], capture_output=True, text=True, cwd=ROOT / "tests", env=ENVIRONMENT, check=False)


def told(*command: str) -> Found:
    """Run a part that prints one JSON object."""
    made = run(*command)
    if made.returncode:
        return {"counts": {}, "findings": [f"the process ended with {made.returncode}: {made.stderr[-300:]}"]}
    found: Found = json.loads(made.stdout)
    if isinstance(found["findings"], dict):
        found["findings"] = [f"{what} ({where})" for what, where in found["findings"].items()]
    return found


def mutants(how: str) -> Callable[[float, int, int], Found]:
    """Return what runs mutants of files in Python, on the command line, or of arguments."""
    return lambda seconds, seed, count: told("-m", "torture.files", how, f"{seconds:.0f}", str(seed), str(count))


def kernels(seconds: float, seed: int, count: int) -> Found:
    """Random networks of the kernel, against matrix exponentials and integrators of scipy."""
    made = run(str(ROOT / "scripts/fuzz.py"), "--minutes", f"{seconds / 60.0:.3f}", "--seed", str(seed))
    *found, last = made.stdout.splitlines() or ["0 cases"]
    return {"counts": {"cases": int(last.split()[0])}, "findings": found}


def elements(seconds: float, seed: int, count: int) -> Found:
    """Random decks of every kind of element, against Radau."""
    return told("-m", "torture.elements", str(count if count < sys.maxsize else max(5, round(seconds / 0.4))), str(seed))


def values(seconds: float, seed: int, count: int) -> Found:
    """Decks with one hostile number each, by every way that a number comes in."""
    return told("-m", "torture.values", str(count if count < sys.maxsize else max(100, round(seconds / 0.004))), str(seed))


def campaigns(seconds: float, seed: int, count: int) -> Found:
    """Random campaigns against a least-squares fit of its own."""
    return told("-m", "torture.counts", "campaigns", str(count if count < sys.maxsize else max(2, round(seconds / 0.25))), str(seed))


def edges(seconds: float, seed: int, count: int) -> Found:
    """Networks whose run ends on an edge, against Radau."""
    return told("-m", "torture.counts", "edges", str(count if count < sys.maxsize else max(2, round(seconds / 0.25))), str(seed))


def accused(seconds: float, seed: int, count: int) -> Found:
    """Right logs under decks that lack something; the seed is the first plant."""
    number = max(1, count - BESIDE if count < sys.maxsize else round(seconds / 5.0))
    made = run(str(ROOT / "scripts/accused_logs.py"), "--count", str(number), "--first", str(seed))
    if made.returncode:
        return {"counts": {}, "findings": [f"the process ended with {made.returncode}: {made.stderr[-300:]}"]}
    sums = re.findall(r"^(real|synthetic): (\d+) accused of (\d+), (\d+) misfit", made.stdout, re.MULTILINE)
    blamed, missed = ([line for line in made.stdout.splitlines() if word in line] for word in ("ACCUSED", "MISSED"))
    few = all(int(wrong) <= 0.03 * int(seen) for _, wrong, seen, _ in sums)
    measured = {f"{kind} logs": f"{wrong} of {seen} accused, {bad} misfit" for kind, wrong, seen, bad in sums}
    right, of = re.findall(r"^planted: (\d+) named first of (\d+)", made.stdout, re.MULTILINE)[0]
    counts = {f"{kind} logs": int(seen) for kind, _, seen, _ in sums} | {"planted mistakes": int(of)}
    return {
        "counts": counts,
        "findings": missed + ([] if few else blamed),
        "measured": measured | {"planted mistakes": f"{right} of {of} named first"},
    }


def kills(seconds: float, seed: int, count: int) -> Found:
    """Jobs that are killed or find the disk full at each call that writes, or at every so many as far as the time allows."""
    every = 1 if count < sys.maxsize else max(1, round(600.0 / max(seconds, 1.0)))
    counts, wrong = {}, []
    for job in JOBS[: len(JOBS) if every < 20 else 3]:
        for how in ("kill", "full"):
            with tempfile.TemporaryDirectory() as folder:
                made = run("unit/interrupted.py", job, folder, how, str(every))
                found = json.loads(made.stdout.splitlines()[-1]) if made.returncode == 0 else {"runs": 0, "wrong": [made.stderr[-300:]]}
            counts[f"{job}, {how}"] = found["runs"]
            wrong += [f"{job}, {how}: {each}" for each in found["wrong"]]
    return {"counts": counts, "findings": wrong}


def outputs(seconds: float, seed: int, count: int) -> Found:
    """Outputs of commands aimed at inputs."""
    found = told("-m", "torture.outputs", f"{seconds:.0f}")
    return found | {"counts": {"aimed": found["counts"].get("aimed", 0)}, "of": found["counts"]}


def hostile(seconds: float, seed: int, count: int) -> Found:
    """Hostile requests to the studio."""
    return told("-m", "torture.hostile", str(count if count < sys.maxsize else max(50, round(seconds * 40.0))), str(seed))


def logs(seconds: float, seed: int, count: int) -> Found:
    """Logs that are large, packed, pipes or exchanged, closed pipes, and signals at random moments."""
    return told("-m", "torture.logs", f"{seconds:.0f}", str(seed))


PARTS = {
    "python": Part("files read in Python", 0.2, mutants("python"), 50_000),
    "readings": Part("logs of every format, binary ones in their process", 0.1, mutants("logs"), 50_000),
    "commands": Part("files given to commands", 0.1, mutants("commands"), 10_000),
    "spawned": Part("files given to commands, each in a process of its own", 0.05, mutants("spawned")),
    "calls": Part("arguments of functions", 0.05, mutants("calls")),
    "kernel": Part("random networks of the kernel, against exponentials and scipy", 0.15, kernels),
    "elements": Part("random decks of every kind of element, against Radau at 1e-10", 0.15, elements, 500),
    "values": Part("decks with a hostile number, by every way that it comes in", 0.05, values, 20_000),
    "edges": Part("networks whose run ends on an edge, last sample and extremes against Radau", 0.02, edges, 500),
    "campaigns": Part("random campaigns, against a separate least-squares fit", 0.02, campaigns, 200),
    "accused": Part("right logs that misfit a deck, at most 3 % accused of a mistake; planted mistakes", 0.02, accused, 145),
    "kills": Part("jobs killed or on a full disk, at calls that write", 0.1, kills, "each call of eight jobs"),
    "outputs": Part("outputs of commands aimed at inputs, by four names of each", 0.05, outputs, "every output at every file"),
    "hostile": Part("hostile requests to the studio", 0.1, hostile, 10_000),
    "logs": Part("large, packed, exchanged and silent logs, closed pipes, signals", 0.05, logs),
}


def main() -> int:
    """Run the parts; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, default=8.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", choices=PARTS, action="append", help="run this part alone; may be repeated")
    parser.add_argument("--count", type=int, default=sys.maxsize, help="at most so many cases of a part")
    parser.add_argument("--aim", action="store_true", help="as many cases as the page aims at, where it gives a number")
    parser.add_argument("--kept", type=Path, default=ROOT / "scripts/torture.json", help="file that keeps a run of each part")
    parser.add_argument("--page", type=Path, help="file to which the tables are written")
    given = parser.parse_args()
    kept: dict[str, Found] = json.loads(given.kept.read_text(encoding="utf-8")) if given.kept.exists() else {}
    chosen = given.only or [*PARTS]
    whole = sum(PARTS[name].share for name in chosen)
    findings = 0
    for name in chosen:
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        aim = PARTS[name].aim
        count = aim if given.aim and isinstance(aim, int) else given.count
        found = PARTS[name].run(60.0 * given.minutes * PARTS[name].share / whole, given.seed, count)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        minutes = (after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime) / 60.0
        kept[name] = merged(kept.get(name), found | {"seed": given.seed, "day": time.strftime("%Y-%m-%d"), "minutes": round(minutes, 1)})
        given.kept.write_text(json.dumps(kept, indent=1) + "\n", encoding="utf-8")
        findings += len(found["findings"])
        print(f"{PARTS[name].title}: {sum(found['counts'].values()):,} cases, {len(found['findings'])} findings", flush=True)
        print("\n".join(f"finding: {each}" for each in found["findings"]), end="\n" if found["findings"] else "", flush=True)
    if given.page:
        given.page.write_text(page(kept), encoding="utf-8")
    return 1 if findings else 0


def merged(before: Found | None, found: Found) -> Found:
    """Return what is kept of a part: the larger run, or the later one where it is as large or found something; notes stay."""
    if before and not found["findings"] and sum(found["counts"].values()) < sum(before["counts"].values()):
        return before
    return found | ({"notes": before["notes"]} if before and "notes" in before else {})


def page(kept: dict[str, Found]) -> str:
    """Return the page with the tables of the last runs."""
    rows = []
    for name, part in PARTS.items():
        of = kept.get(name, {"counts": {}, "findings": [], "seed": "", "day": "not run"})
        every = of.get("of", {})
        aim = f"{4 * every['outputs'] * every['kinds']:,}" if every else f"{part.aim:,}" if isinstance(part.aim, int) else part.aim
        ends = f"{len(of['findings'])} | {of['seed']} | {of.get('minutes', '')} | {of['day']} |"
        rows.append(f"| {part.title} | {sum(of['counts'].values()):,} | {aim} | {ends}")
    by = {how: kept.get(how, {"counts": {}})["counts"] for how in ("python", "commands")}
    kinds = list(dict.fromkeys(name for how in by for name in by[how]))
    inside = {
        "kinds": [f"| {name} | {by['python'].get(name, 0):,} | {by['commands'].get(name, 0):,} |" for name in kinds],
        "elements": [f"| {name} | {number:,} |" for name, number in kept.get("elements", {}).get("kinds", {}).items()],
        "ends": [f"{number:,} {how}" for how, number in kept.get("elements", {"counts": {}})["counts"].items()],
        "others": [
            f"| {name} | {number:,} |"
            for part in ("outputs", "kills", "hostile", "logs")
            for name, number in named(part, kept.get(part)).items()
        ],
        "findings": [f"- {each}" for n in PARTS for how in ("findings", "notes") for each in kept.get(n, {}).get(how, [])] or ["None."],
        "caps": [f"| `{name}` | {most:g} | {what} |" for name, (most, what) in CAPS.items()],
    }
    measured = [f"{what}: {said}" for name in PARTS for what, said in kept.get(name, {}).get("measured", {}).items()]
    text = (ROOT / "scripts/torture.md").read_text(encoding="utf-8")
    filled = {name: (", " if name == "ends" else "\n").join(lines) for name, lines in inside.items()}
    return text.format(table="\n".join(rows), measured="; ".join(measured), **filled)


def named(part: str, found: Found | None) -> dict[str, int]:
    """Return the counts of a part with names that say what they count."""
    if part == "outputs":
        every = (found or {}).get("of", {})
        return {what: every[key] for key, what in (("outputs", "outputs of commands"), ("kinds", "files they are aimed at")) if every}
    words = {"kills": "job: {}", "hostile": "answers of {} to hostile requests", "logs": "{}"}
    silent = {"0": "closed without a word"}
    return {words[part].format(silent.get(name, name)): number for name, number in (found or {"counts": {}})["counts"].items()}


if __name__ == "__main__":
    sys.exit(main())
