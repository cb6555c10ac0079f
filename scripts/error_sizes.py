"""Sizes of model error from public test sets: ``python scripts/error_sizes.py`` prints them, and what leaving whole sets out says of them.

Each set gives a likelihood of every size (kept in build/error_sizes by what it depends on), the population over sets the numbers of
`thermid.fit.error_model.SIZES`. ``--write`` keeps the likelihoods for the tests, ``--page`` writes the section of docs/statistics.md.
Sets are looked for in ``--data`` and under THERMID_PUBLIC; one that is not here is named and skipped.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

from sizing import crossed
from sizing.likelihood import CHAINS, FIRST, GRID, SEED, STEPS, WARMING, likelihoods
from sizing.population import Scale, rounded, scales
from sizing.sets import LEFT_OUT, TestSet, present

import thermid as td
from thermid.fit.error_model import SIZES

ROOT = Path(__file__).parent.parent
DATA = ROOT.parent / "shared" / "data"
KEPT = ROOT / "scripts" / "sizing" / "likelihoods.json"
PAGE = ROOT / "docs" / "statistics.md"
CACHE = ROOT / "build" / "error_sizes"
BEGIN, END = "<!-- sizes: begin -->", "<!-- sizes: end -->"


def key_of(of: TestSet) -> str:
    """Return what the likelihoods of a set depend on: what was read of its files, structure, model of error, and how they are made."""
    code = [p.read_bytes() for p in sorted((ROOT / "src" / "thermid" / "fit" / "_error_model").glob("*.py")) if p.name != "sizes.py"]
    read = [x for c in of.conditions for many in (c.readings, c.rooms, c.loads, c.commands) for x in many.values()]
    starts = [[c.name, c.noise, c.starts, [str(x) for x in c.local.items()]] for c in of.conditions]
    told = json.dumps([of.deck, of.free, of.stated, starts, GRID.tolist(), CHAINS, STEPS, WARMING, SEED], sort_keys=True)
    return hashlib.sha256(b"".join([told.encode(), *(x.tobytes() for x in read), *code])).hexdigest()[:16]


def kept(of: TestSet) -> dict[str, list[float]]:
    """Return the likelihoods of a set, from the cache where it has them; a room that nobody logged is a size of its own."""
    path = CACHE / f"{of.name}-{key_of(of)}.json"
    if not path.is_file():
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(likelihoods(of)), encoding="utf-8")
    found: dict[str, list[float]] = json.loads(path.read_text(encoding="utf-8"))
    return found if of.logged else {"unlogged" if g == "room" else g: row for g, row in found.items()}


def judged_rows(of: TestSet, found: Mapping[str, Mapping[str, Sequence[float]]]) -> list[crossed.s.Row]:
    """Return the rows of a set under sizes from the others, from the cache where it has them."""
    rules = crossed.priors_without(of, found)
    told = json.dumps([key_of(of), rules, of.taught], sort_keys=True)
    path = CACHE / f"{of.name}-{hashlib.sha256(told.encode()).hexdigest()[:16]}-rows.json"
    if not path.is_file():
        path.write_text(json.dumps([r.to_dict() for r in crossed.rows_of(of, rules)]), encoding="utf-8")
    return [crossed.s.Row.from_dict(r) for r in json.loads(path.read_text(encoding="utf-8"))]


def table(found: Mapping[str, Scale]) -> str:
    """Return the sizes, as Markdown."""
    lines = ["| size | unit | scale | 5 .. 95 % | sets | first prior |", "|---|---|---|---|---|---|"]
    for g, of in found.items():
        size = SIZES[g]
        lines.append(f"| {size.effect} | {size.unit} | {rounded(of.value):g} | {of.low:.2g} .. {of.high:.2g} | {of.sets} | {FIRST[g]:g} |")
    return "\n".join(lines)


def sources(sets: Sequence[TestSet], rows: Sequence[crossed.s.Row]) -> str:
    """Return the makers of the sizes, as Markdown, with what the sizes of the others make of each."""
    head = "| set | source, licence, commit; structure | runs | left out | inside % | half-width / RMS K | score K |"
    lines = [head, "|---|---|---|---|---|---|---|"]
    for of in sets:
        lines.append(f"| {of.name} | {of.source}; {of.structure} | {len(of.conditions)} | {crossed.figures(rows, of.name)} |")
    return "\n".join(lines)


def main() -> None:
    """Print, and write what is asked for."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--data", type=Path, default=DATA, help="folder of the sets that scripts/judge.py has too")
    parser.add_argument("--no-judge", action="store_true", help="leave out what leaving whole sets out says")
    parser.add_argument("--only", nargs="*", help="some of the sets, to be left out; the sizes are of all")
    parser.add_argument("--write", action="store_true", help=f"write {KEPT.relative_to(ROOT)}")
    parser.add_argument("--page", action="store_true", help=f"write the section of docs/{PAGE.name}")
    options = parser.parse_args()
    begun, sets = time.process_time(), []
    for name, of in present(options.data):
        if isinstance(of, str):
            print(f"{name}: skipped, {of}", file=sys.stderr)
        else:
            sets.append(of)
    found = {}
    for of in sets:
        found[of.name] = kept(of)
        print(f"{of.name}: {time.process_time() - begun:.0f} s of processor time", file=sys.stderr, flush=True)
    for name, why in LEFT_OUT.items():
        print(f"{name}: not used, {why}", file=sys.stderr)
    if options.write:
        made = {"version": td.__version__, "grid": GRID.tolist(), "files": {s.name: dict(s.files) for s in sets}, "likelihoods": found}
        KEPT.write_text(json.dumps(made, indent=1), encoding="utf-8")
    asked = [] if options.no_judge else [of for of in sets if not options.only or of.name in options.only]
    rows = [r for of in asked for r in judged_rows(of, found)]
    page = "\n\n".join([table(scales(found)), *([crossed.summary(rows)] if rows else []), sources(sets, rows)])
    print(f"{page}\n\n{(time.process_time() - begun) / 60.0:.1f} minutes of processor time")
    if options.page:
        before, _, rest = PAGE.read_text(encoding="utf-8").partition(BEGIN)
        PAGE.write_text(f"{before}{BEGIN}\n\n{page}\n\n{END}{rest.partition(END)[2]}", encoding="utf-8")


if __name__ == "__main__":
    main()
