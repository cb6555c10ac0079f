"""Texts of the code and the pages against the words that none of them may have."""

from __future__ import annotations

import re

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


@pytest.mark.parametrize("phrase", BANNED)
def test_no_text_has_a_banned_phrase(phrase: str) -> None:
    hits = [
        f"{path.relative_to(ROOT)}:{k}: {line.strip()[:100]}"
        for path in WRITTEN
        for k, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
        if re.search(phrase, line) and not any(q in line for q in QUOTED)
    ]
    assert hits == [], f"write: {BANNED[phrase]}"


@pytest.mark.parametrize("phrase", BOUND)
def test_no_message_uses_a_word_for_another_meaning(phrase: str) -> None:
    sources = sorted((ROOT / "src" / "thermid").rglob("*.py"))
    hits = [f"{p.relative_to(ROOT)}:{line}: {text[:160]}" for p in sources for line, text in messages(p) if re.search(phrase, text)]
    assert hits == [], f"write: {BOUND[phrase]}"


@pytest.mark.parametrize(("phrase", "text"), [(0, "a and b cannot be told apart"), (1, "the model as it stands"), (4, "leaves with 2")])
def test_a_banned_phrase_is_found(phrase: int, text: str) -> None:
    assert re.search(list(BANNED)[phrase], text)
