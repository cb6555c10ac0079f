"""Print the decisions about rooms with the files that hold them: `python scripts/decisions.py simulation`; without a name, all of them."""

from __future__ import annotations

import re
import sys

from docs_hooks import decisions


def about(*rooms: str) -> str:
    """Return the decisions about some rooms, all without a name, as Markdown by group of rooms.

    Raises
    ------
    SystemExit   With the names there are, when a room is none of them.
    """
    groups = {section.partition("\n")[0]: section for section in decisions().split("\n## ")[1:]}
    words = {title: [word.lower() for word in re.findall(r"\w+", title) if word not in ("and", "the")] for title in groups}
    known = sorted(word for each in words.values() for word in each)
    if unknown := [room for room in rooms if room not in known]:
        raise SystemExit(f"no decisions are listed under '{unknown[0]}'. The names are: {', '.join(known)}.")
    wanted = [section for title, section in groups.items() if not rooms or {*rooms} & {*words[title]}]
    return "\n\n".join(f"## {section.strip()}" for section in wanted)


if __name__ == "__main__":
    print(about(*sys.argv[1:]))
