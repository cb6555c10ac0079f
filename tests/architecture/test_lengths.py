"""A module fits in one sitting, a function on a screen. `make lengths` shows the tables."""

from __future__ import annotations

import ast

from .source import SOURCE, Module

MODULE_GUIDE, MODULE_LIMIT = 300, 400
FUNCTION_GUIDE, FUNCTION_LIMIT = 60, 80


def table(rows: dict[str, int], guide: int, limit: int) -> str:
    """Longest first: what lies above the guide, then the count of the rest."""
    above = sorted(((lines, name) for name, lines in rows.items() if lines > guide), reverse=True)
    marked = [f"{lines:5d}  {name}{'   <- too long' if lines > limit else ''}" for lines, name in above]
    return "\n".join([*marked, f"{len(rows) - len(above)} of {len(rows)} lie within {guide} lines; the limit is {limit}."])


def function_lengths(module: Module) -> dict[str, int]:
    """Lines of each function, its documentation included."""
    functions = (node for node in ast.walk(module.tree) if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef))
    return {f"{module.name}.{node.name}:{node.lineno}": (node.end_lineno or 0) - node.lineno + 1 for node in functions}


def test_modules(modules: dict[str, Module]) -> None:
    rows = {module.name: len(module.text.splitlines()) for module in modules.values()}
    kernel = [path for path in (SOURCE / "kernel").iterdir() if path.suffix in {".cpp", ".hpp", ".inc"}]
    rows |= {f"kernel/{path.name}": len(path.read_text(encoding="utf-8").splitlines()) for path in kernel}
    assert kernel
    report = table(rows, MODULE_GUIDE, MODULE_LIMIT)
    print(report)
    assert max(rows.values()) <= MODULE_LIMIT, "\n" + report


def test_functions(modules: dict[str, Module]) -> None:
    rows = {name: lines for module in modules.values() for name, lines in function_lengths(module).items()}
    report = table(rows, FUNCTION_GUIDE, FUNCTION_LIMIT)
    print(report)
    assert max(rows.values()) <= FUNCTION_LIMIT, "\n" + report


def test_a_function_is_measured_with_its_documentation() -> None:
    text = 'def f():\n    """One.\n\n    Two.\n    """\n    return 1\n'
    assert function_lengths(Module("thermid.model.x", text)) == {"thermid.model.x.f:1": 6}
