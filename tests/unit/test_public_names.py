"""Public names stand once, in a table; type checkers know them by a stub that is written from it."""

from __future__ import annotations

import runpy
from pathlib import Path

import thermid as td

ROOT = Path(__file__).parents[2]


def test_the_stub_is_that_of_the_table() -> None:
    script = runpy.run_path(str(ROOT / "scripts" / "write_stub.py"))
    assert script["STUB"].read_text(encoding="utf-8") == script["stub"](), "run: python scripts/write_stub.py"


def test_the_stub_knows_every_public_name_and_no_other() -> None:
    lines = (ROOT / "src" / "thermid" / "__init__.pyi").read_text(encoding="utf-8").splitlines()
    assert sorted(line.rpartition(" as ")[2] for line in lines if line.startswith("from ")) == sorted(td.__all__)
