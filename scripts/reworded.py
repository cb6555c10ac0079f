"""Tests that fail when every text of the product is worded otherwise: ``python scripts/reworded.py`` counts them and lists where.

In a private copy of the tree each text of at least four words in src/thermid gets its words reversed: messages, remarks, lines of tables.
Names, numbers, units, codes, what stands in quotes or backticks, lists of words, expressions, statements of C, commands of a shell,
docstrings, help texts and templates stay. A test that fails then, and passes with the words as they are, quotes prose. Tests of which
the product is the prose (tests/docs/messages*) and the guards of tests/architecture do not count.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT / "tests"))

from architecture.rewording import otherwise
from architecture.words import OWN_PAGE
from private_tree import PrivateTree

LIMIT = """import signal
import pytest

def overdue(*_):
    raise TimeoutError("waits for words that do not come")

@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol():
    signal.signal(signal.SIGALRM, overdue)
    signal.alarm(300)
    try:
        return (yield)
    finally:
        signal.alarm(0)
"""
"""A plugin that ends what would wait for ever for a line of a process that it started, s."""


def failed(tree: PrivateTree, tests: list[str], workers: int) -> set[str]:
    """Tests of the tree that do not pass."""
    apart = [f"--ignore-glob={tree.root}/tests/{page}*" for page in (*OWN_PAGE, "architecture")]
    (tree.root / "startup" / "limit.py").write_text(LIMIT, encoding="utf-8")
    run = tree.pytest(tests, "-p", "limit", "--no-header", "--tb=no", "-rfE", "-n", str(workers), *apart, seconds=36000.0)
    lines = (line for line in run.stdout.splitlines() if line.startswith(("FAILED ", "ERROR ")))
    return {line.split(" ", 1)[1].split(" - ")[0] for line in lines}


def main() -> None:
    """Count."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("tests", nargs="*", default=["tests"], help="files or folders of tests; all by default")
    parser.add_argument("--workers", type=int, default=1)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as directory:
        tree = PrivateTree(Path(directory) / "tree")
        texts = {path: path.read_text(encoding="utf-8") for path in sorted(tree.package.rglob("*.py"))}
        for path, text in texts.items():
            path.write_text(otherwise(text), encoding="utf-8")
        names = failed(tree, arguments.tests, arguments.workers)
        for path, text in texts.items():
            path.write_text(text, encoding="utf-8")
        if names:
            names -= failed(tree, sorted(names), arguments.workers)
    for file, n in Counter(name.partition("::")[0] for name in names).most_common():
        print(f"{n:5d}  {file}")
    print(f"{len(names)} tests fail when every text is reworded.")


if __name__ == "__main__":
    main()
