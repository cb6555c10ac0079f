"""Mutants: numbers that can move by a fifth, and comparisons that can be negated, before a test fails.

``python scripts/mutants.py`` draws 60 from all rooms, half of them numbers and half comparisons, and prints a table; ``--list`` prints all
in the order of the draw. The seed is the day's unless ``--seed`` says another. What counts as a number or a comparison, and how each is
changed, says tests/architecture/decisive.py.

A mutant lives in a private copy of the tree. First the tests of its room run (``tests/unit/<room>``; for a room without such a folder the
files of ``tests/unit`` itself), with ``--whole`` every other test for what survived. The guards of tests/architecture do not judge: they
know how many numbers there are, and not what a number does.
"""

from __future__ import annotations

import argparse
import datetime
import re
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT / "tests"))

from architecture.decisive import Site, in_order
from architecture.source import SOURCE, Module, read_modules, room_of
from private_tree import PrivateTree

DRAWN = 60


def tests_of(room: str) -> list[str]:
    """The tests of a room, those of its constants first."""
    folder = f"tests/unit/{room}"
    if not room or not (ROOT / folder).is_dir():
        return [str(path.relative_to(ROOT)) for path in sorted((ROOT / "tests/unit").glob("test_*.py"))]
    first = f"{folder}/test_constants.py"
    return [first, folder] if (ROOT / first).exists() else [folder]


def died(tree: PrivateTree, module: Module, site: Site, whole: bool) -> str:
    """The test that a mutant died by; empty where it survived."""
    own = tests_of(room_of(module.name))
    runs = [(own, ())]
    if whole:
        runs.append((["tests"], ("-n", "2", "--ignore=tests/architecture", *(f"--ignore={name}" for name in own))))
    path = tree.root / "src" / module.path.relative_to(SOURCE)
    path.write_text(site.applied(module.text), encoding="utf-8")
    try:
        for tests, options in runs:
            run = tree.pytest(tests, "-x", "--no-header", "--tb=no", "-rfE", *options, seconds=3600.0)
            if run.returncode not in (0, 5):
                lines = [x for x in run.stdout.splitlines() if x.startswith(("FAILED", "ERROR"))] or [*run.stdout.splitlines(), "?"][-3:]
                return lines[0].split(" - ")[0].removeprefix("FAILED ").removeprefix("ERROR ")
    finally:
        path.write_text(module.text, encoding="utf-8")
    return ""


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--list", action="store_true", help="print every number and comparison, in the order of the draw")
    parser.add_argument("--seed", type=int, default=int(f"{datetime.date.today():%Y%m%d}"), help="of the draw; the day by default")
    parser.add_argument("--number", type=int, default=DRAWN, help="how many are drawn")
    parser.add_argument("--skip", type=int, default=0, help="leave out the first of the draw")
    parser.add_argument("--only", default="", help="a pattern: of these, the mutants whose owner or module has it")
    parser.add_argument("--whole", action="store_true", help="let every other test judge what its room lets live")
    arguments = parser.parse_args()
    modules = read_modules()
    sites = in_order(modules.values(), arguments.seed)
    if not arguments.list:
        sites = sites[arguments.skip : arguments.skip + arguments.number]
    sites = [site for site in sites if re.search(arguments.only, f"{site.owner} {site.module}")]
    if arguments.list:
        for site in sites:
            print(f"{site.module}:{site.lines[0]}  {site.owner}  {site.text} -> {site.changed}")
        return
    print(f"seed {arguments.seed}, {len(sites)} mutants\n\n| owner | module | mutant | died by | s |\n|---|---|---|---|---|", flush=True)
    alive = 0
    with tempfile.TemporaryDirectory() as directory:
        tree = PrivateTree(Path(directory) / "tree")
        for site in sites:
            begin = time.monotonic()
            by = died(tree, modules[site.module], site, arguments.whole)
            alive += not by
            change = " ".join(f"{site.text} -> {site.changed}".split()).replace("|", "\\|")
            print(f"| {site.owner} | {site.module} | `{change}` | {by or '**survived**'} | {time.monotonic() - begin:.0f} |", flush=True)
    print(f"\n{alive} of {len(sites)} survive.")


if __name__ == "__main__":
    main()
