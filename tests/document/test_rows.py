"""Every row of the acceptance sheet that this study answers has a test named after it, here or beside what it tests."""

from __future__ import annotations

import ast
import re
from functools import cache
from pathlib import Path

import pytest

pytestmark = pytest.mark.document
TESTS = Path(__file__).parents[1]
ROWS = [f"K{k}" for k in range(1, 5)] + [f"A{k}" for k in range(1, 8)] + [f"B{k}" for k in range(1, 18)] + [f"N{k}" for k in range(1, 5)]
ROWS += ["V1", "V2", "H1", "M1"]
ROWS += ["A9", "A10", "A11", "W1", "W3"]


def named_after(names: list[str]) -> set[str]:
    """Rows in the names of tests: test_A1_..., test_n1_n2_...

    >>> sorted(named_after(["test_b10_areas", "test_n1_n2_names", "test_b1"]))
    ['B1', 'B10', 'N1', 'N2']
    """
    return {row.upper() for name in names for row in re.findall(r"_([abhkmnvw]\d{1,2})(?=_|$)", name.lower())}


@cache
def every_test() -> list[str]:
    files = [*TESTS.glob("document/*.py"), *TESTS.glob("examples/*.py")]
    trees = [ast.parse(path.read_text(encoding="utf-8")) for path in files]
    return [node.name for tree in trees for node in ast.walk(tree) if isinstance(node, ast.FunctionDef) and node.name.startswith("test_")]


@pytest.mark.parametrize("row", ROWS)
def test_every_row_has_its_test(row: str) -> None:
    assert row in named_after(every_test())
