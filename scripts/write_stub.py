"""Write the stubs by which type checkers and editors know the public names, which Python imports when asked for: one a namespace."""

from __future__ import annotations

from pathlib import Path

import thermid as td

ROOT = Path(td.__file__).parent


def stubs() -> dict[Path, str]:
    """Return path -> stub of the top and of every namespace."""
    rooms = [f"from thermid import {name} as {name}" for name in sorted(["errors", *td._NAMESPACES])]
    out = {ROOT / "__init__.pyi": _stub(td._TOP, [*rooms], ["", "__version__: str", "__all__: list[str]"])}
    for space, names in td._NAMESPACES.items():
        out[ROOT / space / "__init__.pyi"] = _stub(names)
    return out


def _stub(names: dict[str, str], before: list[str] | None = None, after: list[str] | None = None) -> str:
    lines = sorted(f"from thermid.{module} import {name} as {name}" for name, module in names.items())
    head = ['"""The public names with their types; written by scripts/write_stub.py from the tables in `thermid/__init__.py`."""', ""]
    return "\n".join([*head, *(before or []), *lines, *(after or []), ""])


if __name__ == "__main__":
    for path, text in stubs().items():
        path.write_text(text, encoding="utf-8")
