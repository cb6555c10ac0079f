"""Where texts for users are made, and the code that each has: calls of errors and warnings, findings, texts with a code."""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from thermid.base.code_table import CODES, SUBJECTS

from .source import Module

PASSED_ON = "passed on"
"""Stands for a code that is that of another text, so that no constant is seen."""
KINDS = {"error": "error", "warning": "warning", "note": "remark"}
"""Severity of a finding -> kind of text."""


@dataclass(frozen=True)
class Place:
    """A place that makes a text for users: its module and line, its kind, and its code (empty for none yet)."""

    module: str
    line: int
    kind: str
    code: str


def error_classes(modules: Mapping[str, Module]) -> dict[str, str]:
    """Every class of the tree of `ThermidError` with the code of the class, its own or inherited."""
    bodies = [node for module in modules.values() for node in module.nodes if isinstance(node, ast.ClassDef)]
    out = {"ThermidError": ""}
    while True:
        new = {
            node.name: _code_of_class(node) or next(out[name] for name in map(_name, node.bases) if name in out)
            for node in bodies
            if node.name not in out and out.keys() & set(map(_name, node.bases))
        }
        if not new:
            return out
        out |= new


def places(modules: Mapping[str, Module]) -> list[Place]:
    """Every place of the package that makes an error, a warning or a finding, and every remark that has a code."""
    classes = error_classes(modules)
    return [place for name, module in modules.items() for place in _places_in(name, module.tree, classes, "remark")]


def _places_in(module: str, node: ast.AST, classes: Mapping[str, str], kind: str) -> Iterator[Place]:
    """Places below a node; `kind` is that of a text with a code which stands in no call that says more."""
    for child in ast.iter_child_nodes(node):
        inner = kind
        if isinstance(child, ast.Call):
            name = _name(child.func)
            if name in classes or name == "fault":
                inner = "error"
                yield Place(module, child.lineno, inner, _code(child) or classes.get(name, ""))
            elif name == "ThermidWarning" or (name == "warn" and any(_name(a) == "ThermidWarning" for a in child.args)):
                inner = "warning"
                yield Place(module, child.lineno, inner, _code(child))
            elif name == "Finding":
                severity = child.args[0]
                inner = KINDS[severity.value] if isinstance(severity, ast.Constant) else kind
                yield Place(module, child.lineno, inner, _code(child, 3))
            elif name == "CodedText" and len(child.args) > 1:
                yield Place(module, child.lineno, kind, _text(child.args[1]))
            elif _text(_keyword(child)) not in ("", PASSED_ON):  # `refuse_unknown` and others that raise for their caller
                inner = "error"
                yield Place(module, child.lineno, inner, _text(_keyword(child)))
        elif isinstance(child, ast.FunctionDef):
            yield from (Place(module, child.lineno, "error", code) for code in _defaults(child))
        yield from _places_in(module, child, classes, inner)


def _code(call: ast.Call, position: int | None = None) -> str:
    """Code of a call that makes a text: by its argument, or by a text in it that has one; empty for none."""
    given = _keyword(call) or (call.args[position] if position is not None and len(call.args) > position else None)
    if given is not None:
        return _text(given)
    first = call.args[0] if call.args else None
    carries = isinstance(first, ast.Call) and _name(first.func) == "CodedText"
    return PASSED_ON if carries or (isinstance(first, ast.Attribute) and first.attr == "message") else ""


def _keyword(call: ast.Call) -> ast.expr | None:
    return next((k.value for k in call.keywords if k.arg == "code"), None)


def _text(node: ast.expr | None) -> str:
    if node is None:
        return ""
    return node.value if isinstance(node, ast.Constant) and isinstance(node.value, str) else PASSED_ON


def _name(node: ast.expr) -> str:
    return node.attr if isinstance(node, ast.Attribute) else getattr(node, "id", "")


def _code_of_class(node: ast.ClassDef) -> str:
    assigned = (s for s in node.body if isinstance(s, ast.Assign) and any(_name(t) == "code" for t in s.targets))
    return next((_text(s.value) for s in assigned), "")


def _defaults(node: ast.FunctionDef) -> list[str]:
    """Code that a function raises with where its caller gives none."""
    positional = zip(reversed(node.args.args), reversed(node.args.defaults), strict=False)
    pairs = [*positional, *zip(node.args.kwonlyargs, node.args.kw_defaults, strict=True)]
    return [code for argument, value in pairs if argument.arg == "code" and (code := _text(value)) not in ("", PASSED_ON)]


def constants(modules: Mapping[str, Module]) -> set[str]:
    """Every text of the package, outside the table of codes, that is a code or looks like one."""
    texts = (
        node.value
        for name, module in modules.items()
        if name != "thermid.base.code_table"
        for node in module.nodes
        if isinstance(node, ast.Constant) and isinstance(node.value, str)
    )
    return {text for text in texts if text in CODES or looks_like_a_code(text)}


def looks_like_a_code(text: str) -> bool:
    """Whether a text is a subject of codes, a dot, and words with a dash."""
    subject, dot, cause = text.partition(".")
    return bool(dot) and subject in SUBJECTS and "-" in cause and all(word.isalpha() and word.islower() for word in cause.split("-"))
