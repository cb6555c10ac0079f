"""Write docs/schema/deck.schema.json, by which an editor checks and completes a deck.

Run it as ``.venv/bin/python scripts/write_schema.py``; tests/unit/model/test_parts.py fails when the file is not current.
"""

from __future__ import annotations

import json
from pathlib import Path

from thermid.model.deck.schema import json_schema

TARGET = Path(__file__).parent.parent / "docs/schema/deck.schema.json"


def text() -> str:
    """Return the schema as JSON text."""
    head = {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": "thermid deck"}
    return json.dumps(head | {k: v for k, v in json_schema().items() if k != "title"}, indent=2) + "\n"


def main() -> None:
    """Write the file."""
    TARGET.parent.mkdir(parents=True, exist_ok=True)
    TARGET.write_text(text(), encoding="utf-8")


if __name__ == "__main__":
    main()
