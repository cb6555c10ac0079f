"""Docstrings of this project for the reference: its compact entries, `name : type   meaning` on one line, as numpydoc has them on two."""

from __future__ import annotations

import re
from typing import Any

import griffe

ENTRIES = ("Parameters", "Returns", "Yields", "Raises", "Warns", "Attributes")
HEAD = re.compile(r"^([A-Z]\w+)\n-{3,}$", re.MULTILINE)
ENTRY = re.compile(r"^(\S.*?\S|\S) {2,}(\S.*)$")


def spread(text: str) -> str:
    """Return a docstring with each entry's meaning on lines of its own."""
    parts = HEAD.split(text)
    out = [parts[0]]
    for head, body in zip(parts[1::2], parts[2::2], strict=True):
        out.append(f"{head}\n{'-' * len(head)}" + (_entries(body) if head in ENTRIES else body))
    return "".join(out)


def _entries(body: str) -> str:
    lines = []
    for line in body.splitlines():
        if found := ENTRY.match(line):
            lines += [found[1], f"    {found[2]}"]
        else:
            lines.append(f"    {line.strip()}" if line.startswith(" ") else line)
    return "\n".join(lines) + "\n"


class Spread(griffe.Extension):
    """Spreads every docstring that the reference shows."""

    def on_instance(self, *, obj: griffe.Object, **_: Any) -> None:
        """Rewrite one docstring."""
        if obj.docstring:
            obj.docstring.value = spread(obj.docstring.value)
