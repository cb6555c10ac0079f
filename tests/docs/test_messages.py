"""Texts of the code and the pages against the words that none of them may have."""

from __future__ import annotations

import re
from functools import cache

import pytest

from .messages import BANNED, BOUND, ROOT, messages

WRITTEN = [
    *(ROOT / "src" / "thermid").rglob("*.py"),
    *(ROOT / "src" / "thermid").rglob("*.js"),
    *(ROOT / "docs").rglob("*.md"),
    *(ROOT / "examples").rglob("*.md"),
    *(ROOT / "README.md", ROOT / "CONTRIBUTING.md", ROOT / "CHANGELOG.md"),
]
QUOTED = ("the board says so", "| told apart |", "| makes up for |", "| how surely |")
"""Lines that quote a banned phrase: a mark in logs of earlier versions, and the table of words itself."""


@cache
def lines() -> list[tuple[str, str]]:
    """Place and text of every line that is written."""
    return [
        (f"{path.relative_to(ROOT)}:{k}", line)
        for path in WRITTEN
        for k, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
        if not any(q in line for q in QUOTED)
    ]


@cache
def every_message() -> list[tuple[str, str]]:
    """Place and text of every message of the code."""
    sources = sorted((ROOT / "src" / "thermid").rglob("*.py"))
    return [(f"{p.relative_to(ROOT)}:{line}", text) for p in sources for line, text in messages(p)]


@pytest.mark.parametrize("phrase", BANNED)
def test_no_text_has_a_banned_phrase(phrase: str) -> None:
    hits = [f"{place}: {line.strip()[:100]}" for place, line in lines() if re.search(phrase, line)]
    assert hits == [], f"write: {BANNED[phrase]}"


@pytest.mark.parametrize("phrase", BOUND)
def test_no_message_uses_a_word_for_another_meaning(phrase: str) -> None:
    hits = [f"{place}: {text[:160]}" for place, text in every_message() if re.search(phrase, text)]
    assert hits == [], f"write: {BOUND[phrase]}"


@pytest.mark.parametrize(("phrase", "text"), [(0, "a and b cannot be told apart"), (1, "the model as it stands"), (4, "leaves with 2")])
def test_a_banned_phrase_is_found(phrase: int, text: str) -> None:
    assert re.search(list(BANNED)[phrase], text)
