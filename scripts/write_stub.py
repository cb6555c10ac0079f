"""Write ``src/thermid/__init__.pyi``, by which type checkers and editors know the public names, which Python imports when asked for."""

from __future__ import annotations

from pathlib import Path

import thermid as td

STUB = Path(td.__file__).with_suffix(".pyi")


def stub() -> str:
    """Return the stub of the table of public names."""
    lines = sorted(f"from thermid.{module} import {name} as {name}" for name, module in td._PUBLIC.items())
    head = ['"""The public names with their types; written by scripts/write_stub.py from the table in `__init__.py`."""', ""]
    return "\n".join([*head, *lines, "", "__version__: str", "__all__: list[str]", ""])


if __name__ == "__main__":
    STUB.write_text(stub(), encoding="utf-8")
