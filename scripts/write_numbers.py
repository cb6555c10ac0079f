"""Write into docs/statistics.md by which numbers a cause is named or passed over: those of inference's table, from their own comments.

Run it as ``.venv/bin/python scripts/write_numbers.py``; tests/architecture/test_codes.py fails when the page is not current.
"""

from __future__ import annotations

import ast
from pathlib import Path

ROOT = Path(__file__).parent.parent
PAGE = ROOT / "docs" / "statistics.md"
TABLE = ROOT / "src" / "thermid" / "inference" / "_explain" / "thresholds.py"
BEGIN, END = "<!-- numbers: begin -->", "<!-- numbers: end -->"


def section() -> str:
    """Return the section: name, value, and what the comment beside it says, with its unit and source."""
    rows, text = [], TABLE.read_text(encoding="utf-8")
    for node, after in zip(body := ast.parse(text).body, body[1:], strict=False):
        if isinstance(node, ast.Assign | ast.AnnAssign) and isinstance(after, ast.Expr):
            target = node.targets[0] if isinstance(node, ast.Assign) else node.target
            name, said = ast.unparse(target).strip("()"), ast.literal_eval(after.value)
            rows.append(f"| `{name}` | {ast.unparse(node.value).strip('()')} | {' '.join(said.split())} |")
    head = [
        "## Numbers that decide which cause is named",
        "",
        "By these `criticise`, `diagnose`, hidden defects and the search for mistakes decide; the widths of causes are in `causes.py`.",
        "",
        "| name | value | what it decides |",
        "|---|---|---|",
    ]
    return "\n".join([BEGIN, *head, *rows, END])


def page() -> str:
    """Return the page with the section as the code has it."""
    text = PAGE.read_text(encoding="utf-8")
    before, _, rest = text.partition(BEGIN)
    return f"{before.rstrip()}\n\n{section()}{rest.partition(END)[2] or chr(10)}"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
