"""Write docs/schema: a JSON Schema of every kind of file, by which an editor checks and completes it.

Run it as ``.venv/bin/python scripts/write_schema.py``; tests/unit/test_schemas.py fails when a file is not current.
"""

from __future__ import annotations

import json
from pathlib import Path

from thermid.base.files import file_kinds, json_schema

FOLDER = Path(__file__).parent.parent / "docs/schema"


def text(kind: str) -> str:
    """Return the schema of a kind of file as JSON text."""
    return json.dumps(json_schema(kind), indent=2) + "\n"


def main() -> None:
    """Write the files."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    for kind in file_kinds():
        (FOLDER / f"{kind}.schema.json").write_text(text(kind), encoding="utf-8")


if __name__ == "__main__":
    main()
