"""The pages of the project as their blocks, tables, headings and links."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
FOLDERS = (".", "from", "howto")
"""Folders of docs/ whose pages are worked through."""
PAGES = ("README.md", "CONTRIBUTING.md", "CHANGELOG.md")
PAGES += tuple(str(path.relative_to(ROOT)) for folder in FOLDERS for path in sorted((ROOT / "docs" / folder).glob("*.md")))
DESIGN = tuple(str(path.relative_to(ROOT)) for path in sorted((ROOT / "docs" / "design").glob("*.md")))
"""Pages that say why rooms are as they are."""

NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?![\w])")


@dataclass(frozen=True)
class Block:
    """A fenced block: the words after the fence, the text in it, and the line where it begins."""

    words: tuple[str, ...]
    text: str
    line: int


def blocks(text: str) -> list[Block]:
    """Every fenced block of a page, in order."""
    out: list[Block] = []
    opened: tuple[tuple[str, ...], int] | None = None
    inside: list[str] = []
    for number, line in enumerate(text.splitlines(), 1):
        if line.startswith("```"):
            if opened is None:
                opened, inside = (tuple(line[3:].split()), number + 1), []
            else:
                out.append(Block(opened[0], "\n".join(inside) + "\n", opened[1]))
                opened = None
        elif opened is not None:
            inside.append(line)
    assert opened is None, f"the block that begins at line {opened} does not end"
    return out


def prose(text: str) -> str:
    """A page without its fenced blocks."""
    return re.sub(r"^```.*?^```$", "", text, flags=re.DOTALL | re.MULTILINE)


def headings(text: str) -> list[tuple[int, str]]:
    """Depth and words of every heading."""
    return [(len(m[1]), m[2].strip()) for m in re.finditer(r"^(#+) (.*)$", prose(text), re.MULTILINE)]


def anchor(heading: str) -> str:
    """What a heading is linked by."""
    return re.sub(r"[^\w -]", "", heading.lower()).strip().replace(" ", "-")


def links(text: str) -> list[str]:
    """Targets of all links."""
    return re.findall(r"\]\(([^)\s]+)\)", prose(text))


def tables(text: str) -> dict[str, list[list[str]]]:
    """Heading -> rows of the tables below it, without their heads."""
    out: dict[str, list[list[str]]] = {}
    here, ruled = "", False
    for line in prose(text).splitlines():
        if found := re.match(r"#+ (.*)", line):
            here, ruled = found[1].strip(), False
        elif not line.startswith("|"):
            ruled = False
        elif re.fullmatch(r"[|\s:-]+", line):
            ruled = True
        elif ruled:
            out.setdefault(here, []).append([cell.strip() for cell in re.split(r"(?<!\\)\|", line.strip()[1:-1])])
    return out


def codes(text: str) -> list[str]:
    """Everything between single backticks."""
    return re.findall(r"`([^`]+)`", text)


def _last_place(number: str) -> float:
    """One unit in the last place of a number as it is written."""
    mantissa, _, exponent = number.partition("e")
    return 10.0 ** (int(exponent or 0) - len(mantissa.partition(".")[2]))


def near(shown: str, found: float) -> bool:
    """Whether a number on a page is what was found, to one unit of its last place."""
    return abs(float(shown) - found) <= 1.000001 * _last_place(shown)


def differences(shown: str, found: str) -> Iterator[str]:
    """What a page shows and the code does not say. A line of three points stands for any lines, three points at its end for any words."""
    left = [line for line in found.splitlines() if line.strip()]
    skipping = False
    for line in (line for line in shown.splitlines() if line.strip()):
        if line.strip() == "...":
            skipping = True
            continue
        while skipping and left and not same_line(line, left[0]):
            left.pop(0)
        if not left or not same_line(line, left[0]):
            yield f"shown: {line.strip()}\nfound: {left[0].strip() if left else '(nothing more)'}"
            return
        left.pop(0)
        skipping = False
    if left and not skipping:
        yield f"found, but not shown: {left[0]}"


def same_line(shown: str, found: str) -> bool:
    """Whether a line of a page is what was found: its words, and its numbers to one unit of their last place."""
    if shown.endswith(" ..."):
        shown = shown.removesuffix("...")
        found = " ".join(found.split()[: len(shown.split())])
    if NUMBER.sub("#", shown).split() != NUMBER.sub("#", found).split():
        return False
    return all(near(a, float(b)) for a, b in zip(NUMBER.findall(shown), NUMBER.findall(found), strict=True))
