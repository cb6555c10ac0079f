"""A function fits on a screen; a file is as long as its concept. `make lengths` shows the long ones."""

from __future__ import annotations

from .size import SCREEN, function_lengths
from .source import Module

LIMIT = 80


def table(rows: dict[str, int]) -> str:
    """Longest first: what lies above the guide, then the count of the rest."""
    above = sorted(((lines, name) for name, lines in rows.items() if lines > SCREEN), reverse=True)
    marked = [f"{lines:5d}  {name}{'   <- too long' if lines > LIMIT else ''}" for lines, name in above]
    return "\n".join([*marked, f"{len(rows) - len(above)} of {len(rows)} lie within {SCREEN} lines; the limit is {LIMIT}."])


def test_functions(modules: dict[str, Module]) -> None:
    rows = {name: lines for module in modules.values() for name, lines in function_lengths(module).items()}
    report = table(rows)
    print(report)
    assert max(rows.values()) <= LIMIT, "\n" + report


def test_a_function_that_is_too_long_is_marked() -> None:
    assert table({"a": LIMIT + 1, "b": 1}).startswith(f"{LIMIT + 1:5d}  a   <- too long\n1 of 2 lie")


def test_a_function_is_measured_with_its_documentation() -> None:
    text = 'def f():\n    """One.\n\n    Two.\n    """\n    return 1\n'
    assert function_lengths(Module("thermid.model.x", text)) == {"thermid.model.x.f:1": 6}
