"""Figures of the house: ``python scripts/house.py`` prints the table, ``--shrink`` lowers the lists of tests/architecture to what there is.

Each figure is counted as the guards of tests/architecture count it; the last column names the function, whose docstring is the definition.
``--flat`` takes every file below a room's `__init__` for an inner one, as long as no underscores mark them. ``--anew`` writes both lists as
things are, after files have moved: the difference to before is then for a person to read. ``--since COMMIT`` compares statements and
tokens with those of a commit and lists the files that are new since.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT / "tests"))

from additions import additions

from architecture import size
from architecture.house import BUDGETS, GUARDS, HEADS, LIST, amounts, as_toml, files_by_package, listed, lowered, shrunk
from architecture.source import Module, is_below_init, is_inner, read_modules, read_tests


class Figure(NamedTuple):
    """A row: what it is, how much today, what these definitions gave at f02e5b31, what is to reach, what counts it."""

    name: str
    today: str
    before: str
    aim: str
    by: str


def figures(flat: bool) -> list[Figure]:
    """Every figure of the house."""
    modules = read_modules()
    rows = amounts(modules, read_tests(), is_below_init if flat else is_inner)
    guards = {guard: measure(modules) for guard, measure in GUARDS.items()}
    every = {table: f"{sum(counts.values()):,}" for table, counts in rows.items()}
    walks, wide = rows["warm_calls"], rows["signatures"]
    largest, files = max(files_by_package(modules).items(), key=lambda item: item[1])
    circles = [len(group.split()) for group in guards["circles"]]
    longest = sorted(rows["names_used_outside"].items(), key=lambda item: -item[1])[:6]

    def both(what: str) -> str:
        return f"{walks[f'{what} of calibrate']:,}; {walks[f'{what} of predict']:,}"

    return [
        Figure(
            "rooms; floors; arrows between rooms; arrows between files of different rooms, imports by text counted",
            *(joined(rows["map"]), "45; 8; 436; 2,045", "16; 11; 75; 1,200", "doors.map_of_rooms"),
        ),
        Figure("imports of another room's inner files", every["inner_imports"], "1,255 (--flat)", "0", "doors.inner_imports"),
        Figure(
            "different names of a room used outside it: sum",
            f"{every['names_used_outside']} ({', '.join(f'{room} {n}' for room, n in longest)})",
            *("837", "450; base 90, model 50, measure 50, simulation 50, others 30", "doors.names_used_outside"),
        ),
        Figure(
            "circles between files, imports by text counted",
            f"{len(circles)} of {sum(circles)} files",
            "1 of 60 files",
            "0",
            "house.circles",
        ),
        Figure("different source lines run in a warm calibrate; predict", both("lines"), "2,392; 1,836", "1,800; 1,400", "warm.walk"),
        Figure("named functions", both("functions"), "465; 384", "340; 290", "warm.walk"),
        Figure("room crossings", both("crossings"), "1,089; 1,582 (46 rooms)", "half of those after the moves", "warm.walk"),
        Figure("tokens", f"{sum(size.tokens(modules).values()):,}", "761,342", "669,980 (12 % fewer)", "size.tokens"),
        Figure("statements", every["statements"], "51,711", "-", "size.statements"),
        Figure(
            "statements without the additions of other issues",
            f"{sum(rows['statements'].values()) - sum(additions(modules).values()):,}",
            *("51,711", "46,500", "python scripts/additions.py"),
        ),
        Figure(
            "numbers that decide; names of constants with different numbers in several files",
            f"{every['numbers_that_decide']}; {len(guards['constants_of_several_numbers'])}",
            *("3,754; 99", "2,252 (40 % fewer); 0", "decisive.numbers_that_decide; words.constants_of_several_numbers"),
        ),
        Figure(
            "functions and classes, constants named by a dialect word alone",
            f"{every['functions_named_by_dialect']}, {every['constants_named_by_dialect']}",
            *("179, 132", "20 in all", "words.dialect_functions, dialect_constants"),
        ),
        Figure(
            "functions that use one of the 14 words as a variable or argument",
            every["functions_with_dialect_variables"],
            *("1,278", "300", "words.functions_with_dialect_variables"),
        ),
        Figure(
            f"functions and methods with one use and at most {size.SMALL} statements, outside doors",
            every["functions_with_one_use"],
            *("430 (--flat)", "200", "size.functions_with_one_use"),
        ),
        Figure(f"functions above {size.SCREEN} lines", str(len(guards["long_functions"])), "21", "none longer", "size.long_functions"),
        Figure("checks of tests that quote prose", every["quoted_prose"], "1,190", "-", "words.quoted_prose"),
        Figure("tests that fail when every text is reworded", "-", "-", "100", "python scripts/reworded.py"),
        Figure(
            "fields of the largest public record; with records that no other has; most arguments of a public function; of thermid watch",
            *(joined(wide), "30; 65; 17; 32", "18; -; 12; 20", "public.signatures"),
        ),
        Figure("words of decisions", f"{words_of_decisions():,}", "72,082", "12,000", "house.words_of_decisions"),
        Figure("lines of CHANGELOG", str(lines_of_changelog()), "751", "60", "house.lines_of_changelog"),
        Figure("mutants that survive, of 60", "-", "18 of 40", "3", "python scripts/mutants.py --whole"),
        Figure("own imports inside functions", str(sum(guards["imports_in_functions"].values())), "0", "0", "house.lazy_imports"),
        Figure("files with one importer, in the same room", str(len(guards["one_importer"])), "5", "-", "house.slices"),
        Figure("class names with more than one meaning", str(len(guards["doubled_classes"])), "0", "0", "house.doubled_classes"),
        Figure("files in the largest package", f"{files} ({largest})", "15", "15", "house.crowded"),
    ]


def joined(counts: Mapping[str, int]) -> str:
    """Counts beside each other."""
    return "; ".join(f"{n:,}" for n in counts.values())


def words_of_decisions() -> int:
    """Words of the pages that say why the code is as it is."""
    return sum(len(page.read_text(encoding="utf-8").split()) for page in (ROOT / "docs/design").glob("*.md"))


def lines_of_changelog() -> int:
    """Lines of CHANGELOG.md."""
    return len((ROOT / "CHANGELOG.md").read_text(encoding="utf-8").splitlines())


def since(commit: str) -> list[str]:
    """Statements and tokens of a commit beside today's, and the statements of each file that is new since; a file that moved is not."""

    def git(*words: str) -> str:
        return subprocess.run(["git", "-C", str(ROOT), *words], check=True, capture_output=True, text=True).stdout

    def dotted(file: str) -> str:
        return file.removeprefix("src/").removesuffix(".py").removesuffix("/__init__").replace("/", ".")

    files = [n for n in git("ls-tree", "-r", "--name-only", commit, "src/thermid").splitlines() if n.endswith(".py")]
    then = {dotted(n): Module(dotted(n), git("show", f"{commit}:{n}")) for n in files}
    now = read_modules()
    new = git("diff", "-M40%", "--diff-filter=A", "--name-only", commit, "--", "src/thermid").splitlines()
    counts = {"statements": size.statements, "tokens": size.tokens}
    return [
        *(f"{name}: {sum(count(then).values()):,} at {commit}, {sum(count(now).values()):,} today" for name, count in counts.items()),
        *(f"{n}: new, {len(size.statement_lines(now[dotted(n)]))} statements" for n in new if dotted(n) in now),
    ]


def write_lists(anew: bool) -> None:
    """Lower the lists to what there is, or write them as things are."""
    modules = read_modules()
    offenders = {guard: measure(modules) for guard, measure in GUARDS.items()}
    there_is = amounts(modules, read_tests())
    for table in there_is.values():
        for row in [name for name in table if name.startswith("crossings")]:
            del table[row]  # how often depends on the steps that a fit takes, and so on the machine
    if not anew:
        offenders = {guard: shrunk(offenders[guard], rows) for guard, rows in listed().items()}
        there_is = {table: lowered(there_is[table], rows) for table, rows in listed(BUDGETS).items()}
    for path, lists in ((LIST, offenders), (BUDGETS, there_is)):
        path.write_text(as_toml(HEADS[path], lists), encoding="utf-8")


def main() -> None:
    """Print the table, or write the lists."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--shrink", action="store_true", help="lower the lists of offenders and the budgets to what there is")
    parser.add_argument("--anew", action="store_true", help="write them as things are, higher too: after files have moved")
    parser.add_argument("--flat", action="store_true", help="take every file below a room's __init__ for an inner one")
    parser.add_argument("--since", default="", metavar="COMMIT", help="compare statements and tokens with those of a commit")
    arguments = parser.parse_args()
    if arguments.shrink or arguments.anew:
        write_lists(arguments.anew)
    elif arguments.since:
        print("\n".join(since(arguments.since)))
    else:
        print("| figure | today | f02e5b31 | to reach | counted by |\n|---|---|---|---|---|")
        for figure in figures(arguments.flat):
            print(f"| {' | '.join(figure)} |")


if __name__ == "__main__":
    main()
