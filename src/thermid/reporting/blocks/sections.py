"""What a page is made of beyond tables: words, notes, figures, pictures, code and formulas, gathered in sections."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from thermid.reporting.blocks.cells import Table


@dataclass(frozen=True)
class Words:
    """A paragraph."""

    text: str
    kind: str = "words"


@dataclass(frozen=True)
class Heading:
    """A heading within a section."""

    text: str
    kind: str = "heading"


@dataclass(frozen=True)
class Notes:
    """What a reader must not miss, a line each."""

    lines: tuple[str, ...]
    title: str = ""
    kind: str = "notes"


@dataclass(frozen=True)
class Facts:
    """Names with values, side by side."""

    pairs: tuple[tuple[str, str], ...]
    kind: str = "facts"


@dataclass(frozen=True)
class LegendEntry:
    """One line of a legend: what it is, the variable of its colour, its dash pattern ('band' for an area), or its mark; its width. [px]"""

    label: str
    variable: str
    dash: str = ""
    mark: str = ""
    width: float = 2.0


@dataclass(frozen=True)
class Graphic:
    """A figure as markup to stand in the page.

    Parameters
    ----------
    markup : str                    An inline SVG.
    legend : tuple of LegendEntry   What the colours mean.
    points : int                    How many points were drawn.
    """

    markup: str
    legend: tuple[LegendEntry, ...]
    points: int


@dataclass(frozen=True)
class Plot:
    """A figure with its caption; `tag` marks what it rests on, such as synthetic data."""

    drawn: Graphic
    caption: str
    tag: str = ""


@dataclass(frozen=True)
class Figures:
    """Figures side by side under one legend, or one wide figure."""

    plots: tuple[Plot, ...]
    legend: tuple[LegendEntry, ...] = ()
    wide: bool = False
    kind: str = "figures"


@dataclass(frozen=True)
class Picture:
    """A diagram as SVG text made by thermid."""

    svg: str
    caption: str
    kind: str = "picture"


@dataclass(frozen=True)
class Formulas:
    """Formulas as MathML made by thermid, a line each, with the number that each has elsewhere."""

    lines: tuple[tuple[str, str], ...]
    caption: str = ""
    kind: str = "formulas"


@dataclass(frozen=True)
class Code:
    """A text in a fixed width."""

    text: str
    caption: str = ""
    kind: str = "code"


@dataclass(frozen=True)
class FoldOut:
    """Blocks that open on demand."""

    title: str
    blocks: tuple[Block, ...]
    note: str = ""
    kind: str = "folded"


@dataclass(frozen=True)
class Tabled:
    """A table as a block."""

    table: Table
    kind: str = "table"


Block = Words | Heading | Notes | Facts | Figures | Picture | Formulas | Code | FoldOut | Tabled
"""One thing on a page."""


@dataclass(frozen=True)
class Section:
    """A section of a page.

    Parameters
    ----------
    key : str           Its place, for links.
    title : str         Its heading.
    blocks : tuple      What it holds; a `Table` may stand for itself.
    short : str         What the contents call it; the title by default.
    """

    key: str
    title: str
    blocks: tuple[Block, ...]
    short: str = ""

    @classmethod
    def of(cls, key: str, title: str, blocks: Sequence[Block | Table], short: str = "") -> Section:
        """Return a section; tables become blocks, and one without a title has that of the heading above it."""
        return cls(key, title, _titled(title, blocks), short or title)


def as_block(block: Block | Table) -> Block:
    """Return a table as a block, and a block as it is."""
    return Tabled(block) if isinstance(block, Table) else block


def folded(title: str, blocks: Sequence[Block | Table], note: str = "") -> FoldOut:
    """Return blocks that open on demand; tables become blocks, and one without a title has that of what is folded."""
    return FoldOut(title, _titled(title, blocks), note)


def _titled(title: str, blocks: Sequence[Block | Table]) -> tuple[Block, ...]:
    out: list[Block] = []
    for block in (as_block(b) for b in blocks):
        if isinstance(block, Heading):
            title = block.text
        elif isinstance(block, Tabled) and not block.table.title:
            block = Tabled(replace(block.table, title=title))
        out.append(block)
    return tuple(out)
