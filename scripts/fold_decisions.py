"""Fold notes of docs/decisions into the pages of docs/design: `python scripts/fold_decisions.py`, again after each merge that brings notes.

A page names the notes that it takes by their numbers in brackets, "(034, 195)". For every note that a page takes, docs/design/notes.toml
gets its page, its name and the last commit that changed it; the file goes, and links to it lead to the page. Its text is
`git show COMMIT:docs/decisions/NAME.md`. Notes that no page takes stay and are printed, with exit code 1: write a paragraph with their
number, and run this again.
"""

from __future__ import annotations

import re
import subprocess
import tomllib
from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path

ROOT = Path(__file__).parent.parent
DESIGN, NOTES = ROOT / "docs/design", ROOT / "docs/decisions"
TABLE = DESIGN / "notes.toml"
HEAD = """# Notes of decisions that the pages beside this file took up: number = page, name, and the commit in which it stood last.
# `git show COMMIT:docs/decisions/NAME.md` prints one. Written by scripts/fold_decisions.py.
"""
TAKEN = re.compile(r"\((\d{3}(?:, \d{3})*)\)")
FROM_ELSEWHERE = re.compile(r"(?<![\w-])decisions/(\d{3})-[a-z0-9-]+\.md(?:#[\w-]+)?")
FROM_A_NOTE = re.compile(r"\]\((\d{3})-[a-z0-9-]+\.md(?:#[\w-]+)?\)")
FOLDER = re.compile(r"(\]\((?:[\w.-]+/)*)decisions(?:/index\.md)?/?\)")

Rows = dict[str, dict[str, str]]


def git(*words: str) -> str:
    """Return what git prints in this tree."""
    return subprocess.run(["git", "-C", str(ROOT), *words], check=True, capture_output=True, text=True).stdout


def pages_by_number() -> dict[str, str]:
    """Return number of a note -> page that takes it.

    Raises
    ------
    SystemExit   When two pages take one note.
    """
    out: dict[str, str] = {}
    for path in sorted(DESIGN.glob("*.md")):
        for numbers in TAKEN.findall(path.read_text(encoding="utf-8")):
            for number in numbers.split(", "):
                if out.setdefault(number, path.stem) != path.stem:
                    raise SystemExit(f"both {out[number]}.md and {path.name} take note {number}. Leave its number on one of them.")
    return out


def rows() -> Rows:
    """Return the table of notes that were folded before: number -> page, name, commit."""
    return tomllib.loads(TABLE.read_text(encoding="utf-8")) if TABLE.exists() else {}


def folded(pages: Mapping[str, str]) -> tuple[Rows, list[Path]]:
    """Return the table with the notes that lie there now, and their files.

    Raises
    ------
    SystemExit   When two files have one number, or one is in no commit yet.
    """
    table, files = rows(), []
    for number, row in table.items():
        row["page"] = pages.get(number, row["page"])
    names = sorted(path.stem for path in NOTES.glob("[0-9]*.md"))
    if doubled := [(a, b) for a, b in pairwise(names) if a[:3] == b[:3]]:
        raise SystemExit(f"two notes have one number: {' and '.join(doubled[0])}. Rename one of them.")
    for path in sorted(NOTES.glob("[0-9]*.md")):
        if page := pages.get(path.name[:3]):
            commit = git("log", "-1", "--format=%H", "--", str(path)).strip()[:12]
            if not commit:
                raise SystemExit(f"{path.name} is in no commit yet. Commit it first, so that the table can name one.")
            table[path.name[:3]] = {"page": page, "name": path.stem, "commit": commit}
            files.append(path)
    return dict(sorted(table.items())), files


def relinked(text: str, table: Mapping[str, Mapping[str, str]], among_notes: bool) -> str:
    """Return a text whose links to folded notes lead to pages; `among_notes` says that it lies in their folder."""

    def page(found: re.Match[str], place: str, end: str = "") -> str:
        return f"{place}{table[found[1]]['page']}.md{end}" if found[1] in table else found[0]

    text = FROM_ELSEWHERE.sub(lambda found: page(found, "design/"), text)
    text = FOLDER.sub(r"\1design)", text)
    return FROM_A_NOTE.sub(lambda found: page(found, "](../design/", ")"), text) if among_notes else text


def main() -> int:
    """Write the table, move links, remove folded notes; return 1 where notes are left."""
    table, files = folded(pages_by_number())
    lines = [f'{number} = {{ page = "{r["page"]}", name = "{r["name"]}", commit = "{r["commit"]}" }}' for number, r in table.items()]
    TABLE.write_text(HEAD + "\n".join(lines) + "\n", encoding="utf-8")
    for path in files:
        path.unlink()
    moved = 0
    for name in git("ls-files", "-z").split("\0")[:-1]:
        path = ROOT / name
        try:
            text = path.read_bytes().decode("utf-8")
        except (UnicodeDecodeError, OSError):  # a picture, a removed note
            continue
        if (new := relinked(text, table, path.parent == NOTES)) != text:
            path.write_bytes(new.encode("utf-8"))
            moved += 1
    left = sorted(path.name for path in NOTES.glob("[0-9]*.md"))
    print(f"{len(files)} notes folded, {len(table)} in the table, links moved in {moved} files.")
    if left:
        print(f"{len(left)} notes that no page takes: {', '.join(left)}. Write a paragraph with their number, and run this again.")
    return 1 if left else 0


if __name__ == "__main__":
    raise SystemExit(main())
