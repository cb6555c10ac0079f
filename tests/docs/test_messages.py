"""Texts of the code and the pages against the words that none of them may have."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from functools import cache

import pytest
import typer

from thermid.app.cli import app as cli

from .messages import BANNED, BOUND, DIALECT, ROOT, guides, messages, sentences

WRITTEN = [
    *(ROOT / "src" / "thermid").rglob("*.py"),
    *(ROOT / "src" / "thermid").rglob("*.js"),
    *(ROOT / "src" / "thermid").rglob("*.jinja"),
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


@cache
def prose() -> list[tuple[str, str]]:
    """Place and text of every line of prose of the guides."""
    return [(f"{p.relative_to(ROOT)}:{k}", line) for p in guides() for k, line in sentences(p.read_text(encoding="utf-8"))]


@cache
def whole(rows: Callable[[], list[tuple[str, str]]]) -> str:
    """All texts in one."""
    return "\n".join(text for _, text in rows())


CALLS = re.compile(r"(?:[`\"(]|: |^ *(?:\$ )?)thermid (?P<words>[a-z][a-z-]*(?: [^`\"|;&\n]*)?)", re.MULTILINE)
"""A command as it is written: in backticks, quoted, in brackets, after a colon or at the beginning of a line."""
PROSE = re.compile(r"(as|command|did|exchanges|reads|remembers|that|therefore|was|wrote)\b")
"""How a sentence goes on where the name of the package begins a line or a bracket."""


@cache
def options_of(name: str) -> set[str]:
    """Options of a command, those of the whole program among them."""
    group = typer.main.get_command(cli.app)
    command = group.commands[name].make_context(name, [], resilient_parsing=True).command  # type: ignore[attr-defined]
    return {opt for p in (*group.params, *command.params) for opt in (*p.opts, *p.secondary_opts)} | {"--help"}


def commands_advised() -> Iterator[tuple[str, str]]:
    """Place and words of every command that a text names."""
    for place, text in (*(row for row in lines() if not row[0].startswith("docs/renames.md")), *every_message()):
        yield from ((place, m["words"]) for m in CALLS.finditer(text) if not PROSE.match(m["words"]))


def test_every_command_that_a_text_names_is_one() -> None:
    """Five messages advised `thermid split` and `thermid reduce`, which are functions."""
    named, wrong = 0, []
    for place, words in commands_advised():
        name = words.split()[0]
        if place.startswith("docs/recipes.md") and name == "paths":  # there once the recipe of a command was carried out
            continue
        if name not in cli.COMMANDS:
            wrong.append(f"{place}: {words}")
            continue
        named += 1
        wrong += [f"{place}: {name} {option}" for option in re.findall(r"(?<= )--[a-z][a-z-]*", words) if option not in options_of(name)]
    assert wrong == []
    assert named > 200


def found(phrase: str, rows: Callable[[], list[tuple[str, str]]]) -> Iterator[tuple[str, str]]:
    """Place and text of what has a phrase; looked for line by line only where it is somewhere."""
    if re.search(phrase, whole(rows)):
        yield from ((place, text) for place, text in rows() if re.search(phrase, text))


@pytest.mark.parametrize("phrase", BANNED)
def test_no_text_has_a_banned_phrase(phrase: str) -> None:
    hits = [f"{place}: {line.strip()[:100]}" for place, line in found(phrase, lines)]
    assert hits == [], f"write: {BANNED[phrase]}"


@pytest.mark.parametrize("phrase", BOUND)
def test_no_message_uses_a_word_for_another_meaning(phrase: str) -> None:
    hits = [f"{place}: {text[:160]}" for place, text in found(phrase, every_message)]
    assert hits == [], f"write: {BOUND[phrase]}"


@pytest.mark.parametrize(("phrase", "text"), [(0, "a and b cannot be told apart"), (1, "the model as it stands"), (4, "leaves with 2")])
def test_a_banned_phrase_is_found(phrase: int, text: str) -> None:
    assert re.search(list(BANNED)[phrase], text)


@pytest.mark.parametrize("phrase", DIALECT)
def test_no_guide_has_a_phrase_of_dialect(phrase: str) -> None:
    hits = [f"{place}: {line.strip()[:120]}" for place, line in found(phrase, prose)]
    assert hits == [], f"write: {DIALECT[phrase]}"


@pytest.mark.parametrize("phrase", ["thermid", r"\bflows? of\b"])
def test_what_is_somewhere_is_found_line_by_line(phrase: str) -> None:
    assert list(found(phrase, lines)) == [(place, line) for place, line in lines() if re.search(phrase, line)] != []


def test_a_phrase_of_dialect_is_found_in_prose_alone() -> None:
    page = "Logged by nobody.\n\n```sh\nnobody\n```\n`nobody` and [x](nobody.md)\n<p>{{ nobody }}</p> {% if\nnobody %} nobody"
    assert [k for k, line in sentences(page) if re.search(next(iter(DIALECT)), line)] == [1, 8]
    assert len(guides()) > 30
