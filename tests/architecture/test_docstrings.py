"""Names of the package that docstrings quote exist."""

from __future__ import annotations

import ast
import builtins
import re
from collections.abc import Mapping

import thermid as td

from .source import Module

PUBLIC = re.compile(r"`td((?:\.[A-Za-z_]\w*)+)")
"""A public name in back quotes, its call left out."""
MEMBER = re.compile(r"`([A-Z]\w+)\.([a-z_]\w*)")
"""A class with one of its names, in back quotes."""
TYPED = re.compile(r"^\s*[a-z_]\w*(?:, \w+)* : (\S.*?)  ", re.MULTILINE)
"""The type of a parameter or field."""
CLASS = re.compile(r"\b[A-Z][a-z]\w+\b")


def docstrings(modules: Mapping[str, Module]) -> list[tuple[str, str]]:
    """Return where each docstring stands, and its text."""
    every = ((n, x) for n, m in modules.items() for x in m.nodes if isinstance(x, ast.ClassDef | ast.FunctionDef))
    return [(f"{n}:{x.lineno}", text) for n, x in every if (text := ast.get_docstring(x))]


def classes(modules: Mapping[str, Module]) -> dict[str, set[str]]:
    """Return class of the package -> the words of its body and of the bodies of its bases."""
    bodies: dict[str, set[str]] = {}
    bases: dict[str, list[str]] = {}
    for module in modules.values():
        for x in (x for x in module.nodes if isinstance(x, ast.ClassDef)):
            bodies.setdefault(x.name, set()).update(re.findall(r"\w+", "\n".join(module.text.splitlines()[x.lineno - 1 : x.end_lineno])))
            bases.setdefault(x.name, []).extend(b.id for b in x.bases if isinstance(b, ast.Name))
    return {name: own.union(*(bodies.get(b, set()) for b in bases[name])) for name, own in bodies.items()}


def test_names_that_docstrings_quote_exist(modules: Mapping[str, Module]) -> None:
    """`Known.of` stood in one long after the class had another name."""

    def lacks(dotted: str) -> bool:
        place: object = td
        for part in dotted.split(".")[1:]:
            if not hasattr(place, part):
                return True
            place = getattr(place, part)
        return False

    known = classes(modules)
    code = {
        w
        for m in modules.values()
        for line in re.findall(r"^ *(?:from|import|[A-Z]\w+:? ).*", m.text, re.MULTILINE)
        for w in CLASS.findall(line)
    }
    wrong = []
    for where, text in docstrings(modules):
        wrong += [(where, f"td{name}") for name in PUBLIC.findall(text) if lacks(name)]
        wrong += [(where, f"{name}.{of}") for name, of in MEMBER.findall(text) if of not in known.get(name, {of} if name in code else ())]
        typed = {w for line in TYPED.findall(text) for w in CLASS.findall(re.sub(r"[`'\"].*?[`'\"]|\(.*?\)", "", line))}
        wrong += [(where, w) for w in sorted(typed) if w not in known and w not in code and not hasattr(builtins, w)]
    assert not wrong, "\n".join(map(str, wrong))
