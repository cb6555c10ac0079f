"""The tests that docs/environment.md names are there."""

from __future__ import annotations

import re

import pytest

from .pages import ROOT

NAMED = re.findall(r"\| (tests/[\w/]+\.py)::(\w+) \|", (ROOT / "docs" / "environment.md").read_text(encoding="utf-8"))


def test_the_page_names_tests() -> None:
    assert len(NAMED) > 20


@pytest.mark.parametrize(("path", "name"), NAMED)
def test_each_of_them_exists(path: str, name: str) -> None:
    assert re.search(rf"^ *def {name}\(", (ROOT / path).read_text(encoding="utf-8"), re.M)
