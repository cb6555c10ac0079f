"""Statements that other issues than "Doors" added since f02e5b31: ``python scripts/additions.py`` lists them, ``--since`` checks names.

The issue "Doors" asks for 46,500 statements "of what passes the tests of f02e5b31, additions of the other issues listed by file". An
addition is a module, function, class or method whose subject f02e5b31 did not have **and** another issue asks for; ``additions.toml``
lists each with its subject and issue. What mends or refines an older subject is none, however new its name; where it does the work of
older code in another way, the statements of that code (`replaces`) are taken off. Whatever is not listed counts against 46,500.
Statements are counted as `architecture.size.statements` counts them. ``--since COMMIT`` prints each listed name that some function,
class or method of the package had at that commit, for a person to look at: six today, each then the name of something else.
"""

from __future__ import annotations

import argparse
import ast
import subprocess
import sys
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT / "tests"))

from architecture import size
from architecture.source import FUNCTIONS, Module, read_modules

TABLE = Path(__file__).with_suffix(".toml")


def rows() -> list[dict[str, Any]]:
    """The table of additions."""
    return list(tomllib.loads(TABLE.read_text(encoding="utf-8"))["addition"])


def definitions(tree: ast.AST, owner: str = "") -> Iterator[tuple[str, ast.AST]]:
    """Functions, classes and methods of a module, each with its name in it."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, (*FUNCTIONS, ast.ClassDef)):
            yield owner + node.name, node
            if isinstance(node, ast.ClassDef):
                yield from definitions(node, f"{node.name}.")


def statements_of(row: Mapping[str, Any], modules: Mapping[str, Module]) -> int:
    """Statements of a row of the table, less those that it replaces; a `KeyError` for a module or name that is not there."""
    place = f"thermid.{row['module']}"
    parts = {name: module for name, module in modules.items() if name == place or name.startswith(f"{place}.")}
    if "names" in row:
        there = dict(definitions(parts[place].tree))
        bodies = [ast.walk(there[name]) for name in row["names"]]
        count = sum(isinstance(node, ast.stmt) and not size.is_documentation(node) for body in bodies for node in body)
    elif parts:
        count = sum(size.statements(parts).values())
    else:
        raise KeyError(place)
    return count - row.get("replaces", 0)


def additions(modules: Mapping[str, Module]) -> dict[int, int]:
    """Issue -> statements that it added."""
    counts: dict[int, int] = {}
    for row in rows():
        counts[row["issue"]] = counts.get(row["issue"], 0) + statements_of(row, modules)
    return counts


def had_already(commit: str) -> list[str]:
    """Names of the table that a function, class or method of the package had at a commit: each is for a person to look at."""

    def git(*words: str) -> str:
        return subprocess.run(["git", "-C", str(ROOT), *words], check=True, capture_output=True, text=True).stdout

    files = [name for name in git("ls-tree", "-r", "--name-only", commit, "src/thermid").splitlines() if name.endswith(".py")]
    then = {name for file in files for name, _ in definitions(ast.parse(git("show", f"{commit}:{file}")))}
    return [f"{row['module']}: {name}" for row in rows() for name in row.get("names", ()) if name in then]


def main() -> None:
    """Print the table with its sums, or the names that were there before."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--since", default="", metavar="COMMIT", help="print the names of the table that the package of a commit has")
    commit = parser.parse_args().since
    if commit:
        print("\n".join(had_already(commit)) or "none")
        return
    modules = read_modules()
    print("| issue | module | statements | replaced | subject |\n|---|---|---|---|---|")
    for row in sorted(rows(), key=lambda row: (row["issue"], row["module"])):
        print(f"| {row['issue']} | {row['module']} | {statements_of(row, modules)} | {row.get('replaces', '')} | {row['subject']} |")
    counts, every = additions(modules), sum(size.statements(modules).values())
    print("\n" + ", ".join(f"issue {issue}: {n:,}" for issue, n in sorted(counts.items())))
    print(f"{every:,} statements less {sum(counts.values()):,} of additions: {every - sum(counts.values()):,}")


if __name__ == "__main__":
    main()
