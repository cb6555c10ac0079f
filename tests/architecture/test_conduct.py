"""Library code speaks only through values and exceptions, keeps no state of its own and runs no text as code."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator

import pytest

from .source import Module

SAYS = {"print": "prints", "exit": "ends the process", "quit": "ends the process", "SystemExit": "ends the process"}
SAYS_AT = {("sys", "exit"): "ends the process", ("os", "_exit"): "ends the process", ("os", "abort"): "ends the process"}
SAYS_AT |= {("sys", stream): f"writes to sys.{stream}" for stream in ("stdout", "stderr")}
RUNS = {"eval", "exec", "compile", "__import__"}
PICKLES = {"pickle", "_pickle", "marshal", "shelve", "dill", "cloudpickle"}
PICKLE_CALLS = {"read_pickle", "to_pickle", "allow_pickle"}
OWN_PROCESS = {
    "thermid.interop._fmu.child:imports pickle": "requests of the session to the process that it started; answers are plain bytes",
    "thermid.interop._fmu.as_model:imports pickle": "it writes these requests, and restores nothing",
    "thermid.interop._fmu.child:ends the process": "its own, once the session is gone",
}
"""Module and what it may do: why."""
CONTAINERS = {"dict", "list", "set", "defaultdict", "OrderedDict", "Counter", "deque"}
CHANGES = {"append", "extend", "insert", "add", "update", "setdefault", "pop", "popitem", "remove", "discard", "clear", "appendleft"}


def own_names(module: Module) -> set[str]:
    """Names that the module binds itself, which therefore are not the built-in ones."""
    names = {node.name for node in module.nodes if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef)}
    names |= {(a.asname or a.name) for n in module.nodes if isinstance(n, ast.ImportFrom) and n.module != "sys" for a in n.names}
    return names - {"print"}  # another library's `print` prints as well


def noises(module: Module) -> Iterator[str]:
    """Places that print, write to the terminal or end the process."""
    own = own_names(module)
    for node in module.nodes:
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load) and node.id in SAYS and node.id not in own:
            yield f"{module.name}:{node.lineno} {SAYS[node.id]} ({node.id})"
        elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and (node.value.id, node.attr) in SAYS_AT:
            yield f"{module.name}:{node.lineno} {SAYS_AT[node.value.id, node.attr]}"


def code_from_text(module: Module) -> Iterator[str]:
    """Places that run text as code or restore pickled objects."""
    own = own_names(module)
    for imported in module.imports():
        if imported.target.partition(".")[0] in PICKLES:
            yield f"{module.name}:{imported.line} imports {imported.target}"
    for node in module.nodes:
        if isinstance(node, ast.Name) and node.id in RUNS - own:
            yield f"{module.name}:{node.lineno} uses {node.id}"
        elif isinstance(node, ast.Attribute | ast.keyword) and {getattr(node, "attr", None), getattr(node, "arg", None)} & PICKLE_CALLS:
            yield f"{module.name}:{node.lineno} pickles"


def state(module: Module) -> Iterator[str]:
    """`global` statements, and containers of the module that its functions change."""
    shared = set()
    for node in module.tree.body:
        value = node.value if isinstance(node, ast.Assign | ast.AnnAssign) else None
        built = isinstance(value, ast.Call) and isinstance(value.func, ast.Name) and value.func.id in CONTAINERS
        if built or isinstance(value, ast.Dict | ast.List | ast.Set | ast.DictComp | ast.ListComp | ast.SetComp):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            shared |= {target.id for target in targets if isinstance(target, ast.Name)}
    for function in module.nodes:
        if isinstance(function, ast.Global):
            yield f"{module.name}:{function.lineno} global {', '.join(function.names)}"
        if shared and isinstance(function, ast.FunctionDef | ast.AsyncFunctionDef):
            inside = list(ast.walk(function))
            local = {n.id for n in inside if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store)}
            local |= {n.arg for n in inside if isinstance(n, ast.arg)}
            for node in inside:
                if changed_name(node) in shared - local:
                    yield f"{module.name}:{node.lineno} changes the module's {changed_name(node)}"


def changed_name(node: ast.AST) -> str:
    """Name of the container that a statement or a call changes in place; empty for everything else."""
    inside: ast.AST | None = None
    if isinstance(node, ast.Subscript) and not isinstance(node.ctx, ast.Load):
        inside = node.value
    elif isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr in CHANGES:
        inside = node.func.value
    return inside.id if isinstance(inside, ast.Name) else ""


def listed(problems: Iterator[str]) -> str:
    return "\n".join(sorted(problems))


def without_reason(lines: Iterator[str]) -> Iterator[str]:
    return (line for line in lines if re.sub(r":\d+ ", ":", line) not in OWN_PROCESS)


def test_library_code_is_silent(modules: dict[str, Module]) -> None:
    assert listed(without_reason(line for m in modules.values() if m.room != "app" for line in noises(m))) == ""


def test_no_code_from_text(modules: dict[str, Module]) -> None:
    assert listed(without_reason(line for m in modules.values() for line in code_from_text(m))) == ""


def test_no_global_state(modules: dict[str, Module]) -> None:
    assert listed(line for m in modules.values() for line in state(m)) == ""


@pytest.mark.parametrize(
    ("check", "text"),
    [
        (noises, "print('x')"),
        (noises, "from rich import print\nprint('x')"),
        (noises, "import sys\nsys.exit(1)"),
        (noises, "from sys import exit\nexit(1)"),
        (noises, "raise SystemExit"),
        (noises, "import os\nos._exit(1)"),
        (noises, "import sys\nsys.stderr.write('x')"),
        (code_from_text, "def f():\n    import pickle"),
        (code_from_text, "eval('1')"),
        (code_from_text, "run = exec"),
        (code_from_text, "compile('1', '', 'eval')"),
        (code_from_text, "np.load('x', allow_pickle=True)"),
        (state, "def f():\n    global x\n    x = 1"),
        (state, "KNOWN = {}\ndef f(a):\n    KNOWN[a] = 1"),
        (state, "KNOWN: list[int] = []\ndef f(a):\n    KNOWN.append(a)"),
    ],
)
def test_misconduct_is_seen(check, text: str) -> None:
    assert len(list(check(Module("thermid.model.x", text)))) == 1


@pytest.mark.parametrize(
    ("check", "text"),
    [
        (noises, "table.print()"),
        (code_from_text, "import re\nre.compile('x')\nast.literal_eval('1')"),
        (code_from_text, "from thermid.simulation._network import compile\ncompile(model)"),
        (state, "KNOWN = {}\ndef f(a):\n    KNOWN = {}\n    KNOWN[a] = 1"),
        (state, "KNOWN = {}\nKNOWN['a'] = 1\ndef f():\n    return KNOWN['a']"),
    ],
)
def test_good_conduct_is_let_pass(check, text: str) -> None:
    assert list(check(Module("thermid.model.x", text))) == []
