"""How much there is, counted: statements, tokens, long functions, functions with one use."""

from __future__ import annotations

import ast
import io
import tokenize
from collections import Counter
from collections.abc import Callable, Mapping

from .source import FUNCTIONS, Module, is_inner, room_of

SCREEN = 60
"""Lines of a function, its documentation included, above which it is long."""
SMALL = 6
"""Statements of a function, its docstring among them, up to which its one caller could hold it."""

_COUNTED = {tokenize.NAME, tokenize.OP, tokenize.NUMBER, tokenize.STRING}


def is_documentation(node: ast.AST) -> bool:
    """Whether a statement is a text alone: a docstring, or that of a constant."""
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)


def statement_lines(module: Module) -> list[int]:
    """The first lines of the statements of a module; docstrings, those of its constants too, are none."""
    return [node.lineno for node in module.nodes if isinstance(node, ast.stmt) and not is_documentation(node)]


def statements(modules: Mapping[str, Module]) -> dict[str, int]:
    """Room -> statements, docstrings apart."""
    return by_room({name: len(statement_lines(m)) for name, m in modules.items()})


def tokens(modules: Mapping[str, Module]) -> dict[str, int]:
    """Room -> names, operators, numbers and strings; comments and layout are none, a docstring is one."""

    def count(text: str) -> int:
        return sum(token.type in _COUNTED for token in tokenize.generate_tokens(io.StringIO(text).readline))

    return by_room({name: count(m.text) for name, m in modules.items()})


def by_room(counts: Mapping[str, int]) -> dict[str, int]:
    """Room -> the sum over its modules, where there is any; the package's own `__init__` is `thermid`."""
    out: Counter[str] = Counter()
    for name, n in counts.items():
        out[room_of(name) or name] += n
    return dict(+out)


def function_lengths(module: Module) -> dict[str, int]:
    """Lines of each function, its documentation included."""
    functions = (node for node in module.nodes if isinstance(node, FUNCTIONS))
    return {f"{module.name}.{node.name}:{node.lineno}": (node.end_lineno or 0) - node.lineno + 1 for node in functions}


def long_functions(modules: Mapping[str, Module]) -> dict[str, int]:
    """Functions of more than `SCREEN` lines -> how many; of several with one name in a file the longest."""
    out: dict[str, int] = {}
    for module in modules.values():
        for place, lines in function_lengths(module).items():
            name = place.partition(":")[0].removeprefix("thermid.")
            if lines > SCREEN:
                out[name] = max(lines, out.get(name, 0))
    return out


def functions_with_one_use(modules: Mapping[str, Module], inner: Callable[[str], bool] = is_inner) -> dict[str, int]:
    """Room -> functions and methods outside doors that are used once and hold at most `SMALL` statements.

    A use is one loading of the name, bare or after a dot, in the whole package; names that several functions share, special methods and
    what a text names are left out, since a name does not say which of them is used. A door is a file that is not inner: what it names
    without an underscore is not counted.
    """
    uses: Counter[str] = Counter()
    by_text: set[str] = set()
    places: dict[str, list[tuple[str, ast.AST]]] = {}
    for module in modules.values():
        for node in module.nodes:
            match node:
                case ast.Name(id=name, ctx=ast.Load()) | ast.Attribute(attr=name):
                    uses[name] += 1
                case ast.Constant(value=str(text)):
                    by_text.add(text.rpartition(".")[2])
                case ast.FunctionDef(name=name) | ast.AsyncFunctionDef(name=name):
                    places.setdefault(name, []).append((module.name, node))
    counts: Counter[str] = Counter()
    for name, ((module_name, function), *others) in places.items():
        special = name in by_text or name.startswith("__") or not (name.startswith("_") or inner(module_name))
        if uses[name] == 1 and not others and not special:
            # the function itself is a statement of the walk
            counts[module_name] += sum(isinstance(node, ast.stmt) for node in ast.walk(function)) <= SMALL + 1
    return by_room(counts)
