"""Where things stand in a TOML file: key path -> line, so that a message can point there."""

from __future__ import annotations

import re

_HEADER = re.compile(r"^\s*\[\[?\s*([^\]]+?)\s*\]\]?\s*(#.*)?$")
_KEY = re.compile(r"""^\s*((?:"[^"]*"|'[^']*'|[A-Za-z0-9_-]+)(?:\s*\.\s*(?:"[^"]*"|'[^']*'|[A-Za-z0-9_-]+))*)\s*=""")


def _plain(raw: str) -> str:
    return ".".join(part.strip().strip("\"'") for part in re.findall(r"\"[^\"]*\"|'[^']*'|[A-Za-z0-9_-]+", raw))


def line_numbers(text: str) -> dict[str, int]:
    """Return key path -> line (from 1) of every header and key that stands on a line of its own.

    Entries of arrays of tables are numbered: ``stages.0.free``.
    """
    out: dict[str, int] = {}
    prefix, counts = "", {}  # type: tuple[str, dict[str, int]]
    for number, line in enumerate(text.splitlines(), start=1):
        header = _HEADER.match(line)
        if header:
            prefix = _plain(header[1])
            if line.lstrip().startswith("[["):
                counts[prefix] = counts.get(prefix, -1) + 1
                prefix = f"{prefix}.{counts[prefix]}"
            out.setdefault(prefix, number)
            continue
        key = _KEY.match(line)
        if key:
            path = _plain(key[1])
            out.setdefault(f"{prefix}.{path}" if prefix else path, number)
    return out
