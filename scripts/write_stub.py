"""Write the stubs by which type checkers and editors know the public names, which Python imports when asked for: one a namespace."""

from __future__ import annotations

from pathlib import Path

import thermid as td

ROOT = Path(td.__file__).parent
WIDTH = 140


def stubs() -> dict[Path, str]:
    """Return path -> stub of the top and of every namespace."""
    spaces = _import("", [f"{name} as {name}" for name in sorted(td._NAMESPACES)]).replace("thermid. ", "thermid ")
    rooms = [spaces, "from thermid.base import errors as errors"]
    out = {ROOT / "__init__.pyi": _stub(td._TOP, [*rooms], ["", "__version__: str", "__all__: list[str]"])}
    for space, names in td._NAMESPACES.items():
        out[ROOT / (f"{space}.pyi" if space in td._WITHOUT_ROOM else f"{space}/__init__.pyi")] = _stub(names)
    return out


def _stub(names: dict[str, str], before: list[str] | None = None, after: list[str] | None = None) -> str:
    by_module: dict[str, list[str]] = {}
    for name in sorted(names, key=lambda n: (not n.isupper(), not n[0].isupper(), n)):
        by_module.setdefault(names[name], []).append(f"{name} as {name}")
    lines = [_import(module, given) for module, given in sorted(by_module.items())]
    head = ['"""The public names with their types; written by scripts/write_stub.py from the tables in `thermid/__init__.py`."""', ""]
    return "\n".join([*head, *(before or []), *lines, *(after or []), ""])


def _import(module: str, given: list[str]) -> str:
    """Return an import of several names, laid out as ruff does."""
    line = f"from thermid.{module} import {', '.join(given)}"
    return line if len(line) <= WIDTH else "\n".join([f"from thermid.{module} import (", *(f"    {name}," for name in given), ")"])


if __name__ == "__main__":
    for path, text in stubs().items():
        path.write_text(text, encoding="utf-8")
