"""Numbers and comparisons that decide: what `scripts/mutants.py` draws from, and what the guard of numbers counts.

A number is one of a module-level name, of a row of a table, of a default, or a literal in a function. Not counted are

- 0 and -1, in functions 1, and 2 as an exponent;
- indices, axes and shapes: what stands in a subscript, or as a whole number in the call of a function that takes shapes (`SHAPES`);
- formatting: what stands in an f-string, but for what is written in full (``!r``) and so read again, or is handed to `round`, `short`,
  `digits`;
- 273.15, which a unit test of physics pins, and in functions the slack of rounding and guards against division by zero: numbers of a
  size up to 1e-6 or from 1e30, of which a tenth changes no answer.

A comparison is one of ``< <= > >= == != is in`` or their opposites, outside f-strings.

A draw takes half of each, since two thirds of all are comparisons. It orders them by a hash of the seed and of what they are (room,
owner, text), not of where they stand: code that moves within its room does not change it.

Published coefficients stand in the files of `PUBLISHED`: correlations, properties of matter, constants of nature, the standard
atmosphere, units. They are drawn as other numbers are, since a test must repeat what was published, but nobody chose them, so
`numbers_that_decide` leaves them out.
"""

from __future__ import annotations

import ast
import hashlib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache

from .size import by_room
from .source import Module, room_of

SHAPES = {"swapaxes", "reshape", "zeros", "ones", "full", "combinations", "moveaxis", "round", "short", "digits", "maxsize", "lru_cache"}
PUBLISHED = {"physics", "_constants", "_units_table", "_atmosphere"}
"""Rooms, and files of any room, of which the numbers are published."""


@dataclass(frozen=True)
class Site:
    """A number or a comparison in the source.

    Parameters
    ----------
    module : str    The module that holds it.
    owner : str     The function that holds it, or the module-level name.
    text : str      As the source has it.
    number : bool   Whether it is a number.
    nth : int       Of equal ones of one owner.
    lines : tuple of int     First and last line.
    columns : tuple of int   First and past the last, in bytes of their lines.
    """

    module: str
    owner: str
    text: str
    number: bool
    nth: int
    lines: tuple[int, int]
    columns: tuple[int, int]

    @property
    def changed(self) -> str:
        """What a mutant has in its place: a number moved up by a fifth, a whole one by one at least; a comparison negated."""
        if not self.number:
            return f"(not ({self.text}))"
        value = ast.literal_eval(self.text)
        if isinstance(value, int):
            return str(value + max(1, round(0.2 * value)))
        return repr(float(f"{1.2 * value:.12g}"))

    def applied(self, text: str) -> str:
        """The source of the module with this one thing changed."""
        rows = [row.encode() for row in text.split("\n")]
        (first, last), (begin, end) = self.lines, self.columns
        rows[first - 1 : last] = [rows[first - 1][:begin] + self.changed.encode() + rows[last - 1][end:]]
        return b"\n".join(rows).decode()

    def rank(self, seed: int) -> str:
        """Its place in the draw."""
        return hashlib.sha256(f"{seed}:{room_of(self.module)}:{self.owner}:{self.text}:{self.nth}".encode()).hexdigest()


def in_order(modules: Iterable[Module], seed: int) -> list[Site]:
    """Every number and every comparison in the order of the draw, by turns; the table of units, which a script writes, apart."""
    every = [site for module in modules if not module.name.endswith("._units_table") for site in sites(module)]
    every.sort(key=lambda site: site.rank(seed))
    numbers, comparisons = ([site for site in every if site.number is kind] for kind in (True, False))
    pairs = [site for pair in zip(numbers, comparisons, strict=False) for site in pair]
    shorter = len(pairs) // 2
    return [*pairs, *numbers[shorter:], *comparisons[shorter:]]


@cache
def sites(module: Module) -> tuple[Site, ...]:
    """Every number and every comparison of a module that counts, in the order of the source."""
    out: list[Site] = []
    times: dict[tuple[str, str], int] = {}
    rows = module.text.split("\n")
    for owner, node in _nodes(module.tree):
        lines, columns = (node.lineno, node.end_lineno or 0), (node.col_offset, node.end_col_offset or 0)
        text = _text(rows, lines, columns)
        nth = times[owner, text] = times.get((owner, text), -1) + 1
        out.append(Site(module.name, owner, text, isinstance(node, ast.Constant), nth, lines, columns))
    return tuple(out)


def numbers_that_decide(modules: Mapping[str, Module]) -> dict[str, int]:
    """Room -> how many numbers of it count, published ones apart."""
    chosen = [m for m in modules.values() if not set(m.name.split(".")) & PUBLISHED]
    return by_room({m.name: sum(site.number for site in sites(m)) for m in chosen})


def _text(rows: list[str], lines: tuple[int, int], columns: tuple[int, int]) -> str:
    """What stands in the source from a first line and column to a last."""
    part = [row.encode() for row in rows[lines[0] - 1 : lines[1]]]
    part[-1] = part[-1][: columns[1]]
    part[0] = part[0][columns[0] :]
    return b"\n".join(part).decode()


def _nodes(tree: ast.Module) -> Iterator[tuple[str, ast.Constant | ast.Compare]]:
    """Owner and node of the numbers and comparisons that count."""

    def walk(node: ast.AST, owner: str, inside: bool) -> Iterator[tuple[str, ast.Constant | ast.Compare]]:
        for name, value in ast.iter_fields(node):
            for child in value if isinstance(value, list) else [value]:
                if not isinstance(child, ast.AST) or _skipped(node, name, child):
                    continue
                if isinstance(child, ast.Constant) and type(child.value) in (int, float):
                    one = child.value == 1 and (inside or isinstance(node, ast.UnaryOp))
                    if child.value not in (0, 273.15) and not one and not (inside and not 1e-6 < abs(child.value) < 1e30):
                        yield owner, child
                elif isinstance(child, ast.FunctionDef | ast.ClassDef):
                    yield from walk(child, f"{owner}.{child.name}".strip("."), inside or isinstance(child, ast.FunctionDef))
                elif isinstance(child, ast.Assign | ast.AnnAssign) and not inside:
                    target = child.targets[0] if isinstance(child, ast.Assign) else child.target
                    yield from walk(child, f"{owner}.{ast.unparse(target)}".strip("."), inside)
                else:
                    if isinstance(child, ast.Compare):
                        yield owner, child
                    yield from walk(child, owner, inside)

    yield from walk(tree, "", False)


def _skipped(node: ast.AST, field: str, child: ast.AST) -> bool:
    """Whether a child is an index, a shape, formatting or a square."""
    whole = isinstance(child, ast.Constant) and isinstance(child.value, int)
    match node:
        case ast.Subscript():
            return field == "slice"
        case ast.FormattedValue():
            return node.conversion != ord("r")
        case ast.Raise():
            return True
        case ast.keyword():
            return node.arg in ("axis", "ndmin", "maxsize")
        case ast.BinOp(op=ast.Pow()):
            return field == "right" and isinstance(child, ast.Constant) and child.value == 2
        case ast.Call(func=ast.Name(id=name) | ast.Attribute(attr=name)):
            return whole and name in SHAPES
    return False
