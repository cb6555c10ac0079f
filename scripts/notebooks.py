"""Notebooks of the site: executed when the pages are built and when the tests run; what they print and draw is kept in no file.

A notebook is worked through as it stands, cell by cell in one name space, from a folder that has the examples. What a cell prints, the
value of its last line and its figures stand below it.
"""

from __future__ import annotations

import ast
import contextlib
import io
import json
import os
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT / "docs" / "notebooks"


@dataclass(frozen=True)
class Done:
    """One cell after it was run: its kind and text, what it said, and its figures as SVG."""

    kind: str
    text: str
    said: str = ""
    figures: tuple[str, ...] = ()


def notebooks() -> dict[str, Path]:
    """Return the notebooks by their names."""
    return {path.stem: path for path in sorted(FOLDER.glob("*.ipynb"))}


def executed(path: Path) -> list[Done]:
    """Return the cells of a notebook after they were run in a new folder beside the examples.

    Raises
    ------
    ValueError   When the notebook was committed with output, or with cells that are neither code nor Markdown.
    """
    import matplotlib

    matplotlib.use("Agg")
    content = json.loads(path.read_text(encoding="utf-8"))
    space: dict[str, Any] = {"__name__": "__main__"}
    out = []
    with tempfile.TemporaryDirectory() as made, contextlib.chdir(made):
        os.symlink(ROOT / "examples", "examples")
        for cell in content["cells"]:
            text = "".join(cell["source"])
            if cell["cell_type"] == "markdown":
                out.append(Done("markdown", text))
                continue
            if cell["cell_type"] != "code" or cell.get("outputs"):
                raise ValueError(f"{path.name}: cells are code without output, or Markdown.")
            out.append(_ran(text, space, path.name))
    return out


def _ran(text: str, space: dict[str, Any], name: str) -> Done:
    """Return a cell of code after it was run."""
    from matplotlib import pyplot

    tree = ast.parse(text, name)
    last = tree.body.pop() if tree.body and isinstance(tree.body[-1], ast.Expr) else None
    said = io.StringIO()
    with contextlib.redirect_stdout(said):
        exec(compile(tree, name, "exec"), space)
        value = eval(compile(ast.Expression(last.value), name, "eval"), space) if isinstance(last, ast.Expr) else None
    if value is not None and not text.rstrip().endswith(";"):
        said.write(f"{value!r}\n")
    figures = []
    for number in pyplot.get_fignums():
        drawn = io.StringIO()
        pyplot.figure(number).savefig(drawn, format="svg", metadata={"Date": None}, bbox_inches="tight")
        figures.append(drawn.getvalue())
    pyplot.close("all")
    return Done("code", text, said.getvalue(), tuple(figures))


def page(name: str, cells: list[Done]) -> tuple[str, dict[str, str]]:
    """Return the page of an executed notebook, and its pictures by their names beside it."""
    parts, pictures = [], {}
    for cell in cells:
        if cell.kind == "markdown":
            parts.append(cell.text)
            continue
        parts.append(f"```python\n{cell.text.rstrip()}\n```")
        if cell.said.strip():
            parts.append(f"```text\n{cell.said.rstrip()}\n```")
        for figure in cell.figures:
            picture = f"pictures/{name}_{len(pictures) + 1}.svg"
            pictures[picture] = figure[figure.index("<svg") :]
            parts.append(f"![Figure {len(pictures)} of this notebook]({picture})")
    return "\n\n".join(parts) + "\n", pictures


def title(path: Path) -> str:
    """Return the title of a notebook: the first heading of its first cell."""
    first = json.loads(path.read_text(encoding="utf-8"))["cells"][0]
    return "".join(first["source"]).splitlines()[0].removeprefix("# ")


def plain(path: Path) -> str:
    """Return the page of a notebook before it is run: its words and its code."""
    cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
    texts = ["".join(c["source"]) for c in cells]
    return "\n\n".join(t if c["cell_type"] == "markdown" else f"```python\n{t}\n```" for c, t in zip(cells, texts, strict=True)) + "\n"


def contents() -> str:
    """Return the page that lists the notebooks."""
    rows = "\n".join(f"- [{title(path)}]({name}.md)" for name, path in notebooks().items())
    said = "Notebooks of `docs/notebooks`, run when these pages were built. Open them with Jupyter from the folder that holds `examples`."
    return f"# Notebooks\n\n{said}\n\n{rows}\n"


if __name__ == "__main__":
    for each, where in notebooks().items():
        print(each, len(executed(where)), file=sys.stderr)
