"""docs/nomenclature.md against the code, name by name and unit by unit."""

from __future__ import annotations

import inspect
from importlib import import_module
from typing import Any

import pytest

import thermid as td
from thermid import errors

from .pages import codes, tables
from .vocabulary import PAGE, disagreements, unheaded, words_of_the_code

TEXT = PAGE.read_text(encoding="utf-8")


def test_the_page_and_the_code_have_the_same_names() -> None:
    assert "\n".join(disagreements(TEXT)) == ""


def test_every_table_of_the_files_has_a_heading() -> None:
    assert unheaded() == set()


@pytest.mark.parametrize(
    ("old", "new", "word"),
    [
        ("| `emissivity` | - |", "| `emisivity` | - |", "lacks `emissivity`"),
        ("| `emissivity` | - |", "| `emisivity` | - |", "`emisivity`, which the code does not have"),
        ("| `mass` | kg |", "| `mass` | g |", "is in kg, the page says 'g'"),
        ("`thickness` [m];", "`thickness` [mm];", "kind `conduction`"),
        ("| `flow` |", "| `stream` |", "lacks `flow`"),
        ("(window, powers)", "(width, powers)", "options of step `median`"),
        ("| `simulate` |", "| `integrate` |", "lacks `simulate`"),
    ],
)
def test_a_stale_name_or_unit_is_seen(old: str, new: str, word: str) -> None:
    assert old in TEXT
    assert word in "\n".join(disagreements(TEXT.replace(old, new)))


def test_words_beside_other_tools_are_words_of_the_code() -> None:
    known = words_of_the_code()
    rows = tables(TEXT)["The same thing elsewhere"]
    assert len(rows) > 20
    assert [word for row in rows for word in codes(row[0]) if word not in known] == []


def test_exit_codes_are_those_of_the_classes() -> None:
    for row in tables(TEXT)["Errors"]:
        made = getattr(errors, codes(row[0])[0])
        if issubclass(made, errors.ThermidError):
            assert row[-1].rpartition(" ")[2] == str(made.exit_code), row


def public(name: str) -> Any:
    return getattr(import_module(f"thermid.{td._PUBLIC[name]}"), name)


@pytest.mark.parametrize("name", td._PUBLIC)
def test_every_public_name_has_a_docstring(name: str) -> None:
    thing = public(name)
    first = (inspect.getdoc(thing) or "").splitlines()
    assert first
    assert first[0][0].isupper()
    assert not first[0].startswith(f"{name}(")  # what a dataclass without a docstring gets


@pytest.mark.parametrize("name", [n for n in td._PUBLIC if n[0].isupper()])
def test_every_public_method_of_a_public_type_has_a_docstring(name: str) -> None:
    made = public(name)
    members = {n: m for n, m in vars(made).items() if not n.startswith("_") and (callable(m) or isinstance(m, property | classmethod))}
    assert [n for n, m in members.items() if not inspect.getdoc(m)] == []


@pytest.mark.parametrize("name", [n for n in td._PUBLIC if n[0].islower()])
def test_every_argument_of_a_public_function_is_described(name: str) -> None:
    """Where a function has more than one argument, its docstring names each of them."""
    made = public(name)
    arguments = [a for a in inspect.signature(made).parameters if a != "self"]
    text = inspect.getdoc(made) or ""
    if len(arguments) > 1:
        assert [a for a in arguments if a not in text] == []
