"""Names and quotes, counted: names by a word of the dialect alone, constants of one name with several numbers, prose in tests."""

from __future__ import annotations

import ast
from collections.abc import Iterable, Iterator, Mapping

from .size import by_room
from .source import FUNCTIONS, Module

VARIABLES = frozenset("found known given own kept told said made seen left laid felt asked each".split())
"""The fourteen words that say nothing of what a variable or an argument holds."""
DIALECT = VARIABLES | {"on", "of", "turns"} | set("most least far near sure many few wide close small strong enough quiet same".split())
"""Words that, alone, do not say what a function, a class or a constant is."""

PROSE = 25
"""Characters from which a quoted text is prose, if it has a space."""
OWN_PAGE = ("docs/messages", "docs/test_messages")
"""Tests of which the product is the prose."""


def is_dialect(name: str) -> bool:
    """Whether a name is a word of the dialect alone, underscores around it and capitals apart."""
    return name.strip("_").lower() in DIALECT


def dialect_functions(modules: Mapping[str, Module]) -> dict[str, int]:
    """Room -> functions, methods and classes that are named by a word of the dialect alone."""
    kinds = (*FUNCTIONS, ast.ClassDef)
    return by_room({m.name: sum(isinstance(k, kinds) and is_dialect(k.name) for k in m.nodes) for m in modules.values()})


def dialect_constants(modules: Mapping[str, Module]) -> dict[str, int]:
    """Room -> names in capitals that are assigned and are a word of the dialect alone."""
    names = {m.name: [name for node in m.nodes if (name := _assigned(node)).isupper()] for m in modules.values()}
    return by_room({module: sum(map(is_dialect, every)) for module, every in names.items()})


def functions_with_dialect_variables(modules: Mapping[str, Module]) -> dict[str, int]:
    """Room -> functions and methods that name a variable or an argument by one of the fourteen words.

    A function inside another counts with the one that it stands in.
    """

    def many(module: Module) -> int:
        lines = [node.lineno for node in module.nodes if isinstance(node, ast.Name | ast.arg) and _assigned(node) in VARIABLES]
        bodies = [n.body for n in module.nodes if isinstance(n, ast.Module | ast.ClassDef)] if lines else []
        functions = [k for body in bodies for k in body if isinstance(k, FUNCTIONS)]
        return sum(any(k.lineno <= line <= (k.end_lineno or 0) for line in lines) for k in functions)

    return by_room({m.name: many(m) for m in modules.values()})


def _assigned(node: ast.AST) -> str:
    """The name that a node gives to a variable or an argument."""
    match node:
        case ast.Name(id=name, ctx=ast.Store()) | ast.arg(arg=name):
            return name
    return ""


def numeric_constants(module: Module) -> Iterator[tuple[str, float]]:
    """Names in capitals of a module with their numbers, where a number is written: ``A = 1e3``, ``A, B = 1, -2``, ``A: Final = 1 / 3``."""
    for node in module.tree.body:
        if not isinstance(node, ast.Assign | ast.AnnAssign) or node.value is None:
            continue
        target, value = node.targets[0] if isinstance(node, ast.Assign) else node.target, node.value
        pairs: Iterable[tuple[ast.expr, ast.expr]] = [(target, value)]
        if isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple):
            pairs = zip(target.elts, value.elts, strict=True)
        for name, number in pairs:
            if isinstance(name, ast.Name) and name.id.isupper() and (written := written_number(number)) is not None:
                yield name.id, written


def written_number(node: ast.expr) -> float | None:
    """The number that an expression of numbers alone has."""
    for part in ast.walk(node):
        if isinstance(part, ast.Constant) and type(part.value) not in (int, float):
            return None
        if not isinstance(part, ast.Constant | ast.UnaryOp | ast.BinOp | ast.unaryop | ast.operator):
            return None
    return float(eval(compile(ast.Expression(node), "", "eval")))


def constants_of_several_numbers(modules: Mapping[str, Module]) -> dict[str, int]:
    """Names of numeric constants that have different numbers in several files -> how many numbers."""
    numbers: dict[str, dict[str, set[float]]] = {}
    for module in modules.values():
        for name, number in numeric_constants(module):
            numbers.setdefault(name, {}).setdefault(module.name, set()).add(number)
    out = {name: len(set().union(*places.values())) for name, places in numbers.items() if len(places) > 1}
    return {name: n for name, n in out.items() if n > 1}


def quoted_prose(tests: Mapping[str, str]) -> dict[str, int]:
    """Folder of tests -> checks that quote prose: an `assert`, or a `match=`, that holds a literal text of `PROSE` characters or more.

    Texts of a table that a check takes by name are not seen. `tests` are the texts of the files by their path below tests/.
    """
    out: dict[str, int] = {}
    for name, text in tests.items():
        if name.startswith(OWN_PAGE):
            continue
        folder = "/".join(name.split("/")[:-1][:2]) or "."
        checks = (_checked(node) for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Assert | ast.keyword))
        if many := sum(check is not None and any(map(_is_prose, ast.walk(check))) for check in checks):
            out[folder] = out.get(folder, 0) + many
    return out


def _checked(node: ast.AST) -> ast.expr | None:
    """What a check looks at."""
    match node:
        case ast.Assert(test=looked_at) | ast.keyword(arg="match", value=looked_at):
            return looked_at
    return None


def _is_prose(node: ast.AST) -> bool:
    return isinstance(node, ast.Constant) and isinstance(node.value, str) and len(node.value) >= PROSE and " " in node.value
