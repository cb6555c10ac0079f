"""What a page is made of: tables, words, notes, figures, pictures, code and formulas, in sections; numbers as a person reads them."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from thermid.base.sourced import MARKS

DASH = "\u2013"
_POWER = re.compile(r"(?<![\w.])(-?)(\d+(?:\.\d+)?)e([+-]\d+)(?![\w])(?!\.\w)")
_UNIT = re.compile(r"(?<![\w.\"])([-+]?\d[\d.]*(?:·10[⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)?) \[([^\[\]]{1,24})\]")
_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_PLAIN = ((r"\bdegC\b", "°C"), (r"\+- ?(?=\d)", "± "), (r"(?<![\w.])-(0(?:\.0+)?)(?![\d.])", r"\1"))


@dataclass(frozen=True)
class Cell:
    """One cell: its text, what is shown on pointing at it, and a class for its looks."""

    text: str
    tip: str = ""
    look: str = ""


SAME_AS_ABOVE = Cell("", "", "same")
"""What the row above says too: blank on a page, said again in a sheet."""


def group_cell(name: str, row: int) -> Cell:
    """Return what names a group of rows: in its first row the name, below it a blank."""
    return Cell(name, "", "main") if row == 0 else SAME_AS_ABOVE


def verdict_cell(passed: bool | None, why: str = "") -> Cell:
    """Return a verdict as a cell, why it is not decided behind it."""
    if passed is None:
        return Cell("not decided", why, "warn")
    return Cell("✓ met", "", "good") if passed else Cell("✗ not met", "", "bad")


Line = list["Cell | str"]
"""One line of a table while it is made; a text stands for a plain cell."""


@dataclass(frozen=True)
class Head:
    """One column: its heading, whether it holds numbers, what is shown on pointing at it, and whether its texts take several lines."""

    title: str
    numeric: bool = False
    tip: str = ""
    wrapped: bool = False


class PageBlock:
    """One thing on a page; the template asks for its kind."""

    @property
    def kind(self) -> str:
        """Its class as the template writes it."""
        return type(self).__name__.lower()


@dataclass(frozen=True)
class Table(PageBlock):
    """A table of a report.

    Parameters
    ----------
    columns : tuple of Head
    rows : tuple of tuples of Cell  As many cells as columns each.
    caption : str                   What it shows, and how to read it.
    title : str                     Its name; that of the heading above it by default.
    key : str                       Its place, for references.
    """

    columns: tuple[Head, ...]
    rows: tuple[tuple[Cell, ...], ...]
    caption: str = ""
    title: str = ""
    key: str = ""

    @classmethod
    def of_rows(cls, columns: Sequence[Head], rows: Sequence[Sequence[Cell | str]], caption: str = "", title: str = "") -> Table:
        """Return a table; texts become cells."""
        lines = tuple(tuple(c if isinstance(c, Cell) else Cell(c) for c in row) for row in rows)
        if any(len(row) != len(columns) for row in lines):
            raise ValueError("a row needs as many cells as there are columns")
        return cls(tuple(columns), lines, caption, title)

    def without_usual(self, usual: Mapping[str, str]) -> Table:
        """Return the table less those columns in which every cell says what is usual, by title of the column."""
        kept = [k for k, c in enumerate(self.columns) if c.title not in usual or {row[k].text for row in self.rows} - {usual[c.title]}]
        rows = tuple(tuple(row[k] for k in kept) for row in self.rows)
        return replace(self, columns=tuple(self.columns[k] for k in kept), rows=rows)


def pretty(text: str) -> str:
    """Return a unit as it is printed.

    >>> pretty("W/(m^2 K)")
    'W/(m² K)'
    """
    for old, new in (("^2", "²"), ("^3", "³"), ("^-1", "⁻¹"), ("degC", "°C"), ("*", "·")):
        text = text.replace(old, new)
    return DASH if text in ("", "1") else text


def typeset(text: str) -> str:
    """Return words that were written for a terminal or a deck as a page prints them: units, signs and powers of ten.

    >>> typeset("worth 5.6e+02 of 9.81 [m/s^2] +- 3e-12, 4 [read]")
    'worth 560 of 9.81 m/s² ± 3·10⁻¹², 4 (read)'
    """
    text = _POWER.sub(lambda m: m[1] + _power(m[2], int(m[3])), text)
    text = _UNIT.sub(lambda m: f"{m[1]} ({m[2]})" if m[2] in MARKS else m[1] if m[2] == "1" else f"{m[1]} {m[2]}", text)
    for old, new in _PLAIN:
        text = re.sub(old, new, text)
    return re.sub(r"(?<=[A-Za-z)])\^(-?\d)(?![\d.])", lambda m: m[1].translate(_SUPERSCRIPTS), text)


def _power(digits: str, exponent: int) -> str:
    """Return digits times a power of ten, in full where that is short."""
    if -6 < exponent < 6:
        return f"{float(f'{digits}e{exponent}'):.{max(0, len(digits.partition('.')[2]) - exponent)}f}"
    power = str(exponent).translate(_SUPERSCRIPTS)
    return f"{digits}·10{power}"


def number(value: float, digits: int = 3) -> str:
    """Return a number with some significant digits, without an exponent from 1e-5 to 1e6.

    >>> number(1535.04), number(0.00012345)
    ('1535', '0.000123')
    """
    if not math.isfinite(value):
        return DASH
    size = abs(value)
    if size == 0.0:
        return "0"
    if not 1e-5 <= size < 1e6:
        return f"{value:.{digits}g}"
    return f"{value:.{max(0, digits - 1 - math.floor(math.log10(size)))}f}"


def rounded(value: float) -> str:
    """Return an error, a share or a chance: two significant digits.

    >>> rounded(0.0512), rounded(15.3)
    ('0.051', '15')
    """
    return number(value, 2)


def plain(value: float, digits: int = 6) -> str:
    """Return a number that somebody gave, such as a limit: without zeros that nobody wrote.

    >>> plain(0.3), plain(1535.0), plain(15.0)
    ('0.3', '1535', '15')
    """
    text = number(value, digits)
    return text.rstrip("0").rstrip(".") if "." in text and "e" not in text else text


def significant(value: float, error: float) -> str:
    """Return a number with as many decimals as its error has two digits.

    >>> significant(3.14159, 0.16), significant(3.14159, 0.0029), significant(314.159, 35.0)
    ('3.14', '3.1416', '314')
    """
    if not 1e-10 <= error < math.inf or abs(value) >= 1e6:
        return number(value, 6)
    return f"{value:z.{max(0, 1 - math.floor(math.log10(error)))}f}"


def signed(value: float, decimals: int) -> str:
    """Return a number with its sign; what rounds to zero has none.

    >>> signed(-0.0004, 3), signed(0.12, 2)
    ('0.000', '+0.12')
    """
    text = f"{value:+.{decimals}f}"
    return text if float(text) else text[1:]


def capitalised(text: str) -> str:
    """Return a text that begins with a capital."""
    return text[:1].upper() + text[1:]


def duration(seconds: float) -> str:
    """Return a time as a person says it.

    >>> duration(18000.0), duration(90.0)
    ('5 h', '90 s')
    """
    if seconds <= 300:
        return f"{seconds:.4g} s"
    return f"{seconds / 60:.4g} min" if seconds < 3 * 3600 else f"{seconds / 3600:.4g} h"


@dataclass(frozen=True)
class Words(PageBlock):
    """A paragraph; `refs` are the keys of figures and tables to which it refers at its end."""

    text: str
    refs: tuple[str, ...] = ()


@dataclass(frozen=True)
class Heading(PageBlock):
    """A heading within a section."""

    text: str


@dataclass(frozen=True)
class Notes(PageBlock):
    """What a reader must not miss, a line each."""

    lines: tuple[str, ...]
    title: str = ""


@dataclass(frozen=True)
class Facts(PageBlock):
    """Names with values, side by side."""

    pairs: tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class LegendEntry:
    """One line of a legend: what it is, the variable of its colour, its dash pattern ('band' for an area), or its mark; its width. [px]"""

    label: str
    variable: str
    dash: str = ""
    mark: str = ""
    width: float = 2.0


NARROW = 301.0
"""Width of a figure of which three fit on a sheet. [px]"""


@dataclass(frozen=True)
class Graphic:
    """A figure as markup to stand in the page.

    Parameters
    ----------
    markup : str                    An inline SVG.
    legend : tuple of LegendEntry   What the colours mean.
    """

    markup: str
    legend: tuple[LegendEntry, ...]

    @property
    def narrow(self) -> bool:
        """Whether three of it fit beside one another on a sheet, with letters of 6.5 pt."""
        width = re.search(r'viewBox="0 0 ([\d.]+)', self.markup)
        return width is not None and float(width[1]) <= NARROW


@dataclass(frozen=True)
class Plot:
    """A figure with its caption; `tag` marks what it rests on, such as synthetic data; `key` is its place, for references."""

    drawn: Graphic
    caption: str
    tag: str = ""
    key: str = ""


@dataclass(frozen=True)
class Figures(PageBlock):
    """Figures side by side under one legend, or one wide figure; `lead` figures decide, and each has its legend below it."""

    plots: tuple[Plot, ...]
    legend: tuple[LegendEntry, ...] = ()
    wide: bool = False
    lead: bool = False


SHEET = (820.0, 1250.0)
"""Width and height of a diagram whose letters have 6.5 pt where it fills a sheet. [px]"""


def oversized(svg: str, most: tuple[float, float] = SHEET) -> bool:
    """Return whether a diagram is wider or higher than a size [px]; by default too large for a sheet with letters that can be read."""
    sizes = re.search(r'viewBox="0 0 ([\d.]+) ([\d.]+)"', svg)
    return sizes is not None and any(float(size) > largest for size, largest in zip(sizes.groups(), most, strict=True))


@dataclass(frozen=True)
class Picture(PageBlock):
    """A diagram as SVG text made by thermid."""

    svg: str
    caption: str

    @property
    def oversized(self) -> bool:
        """Whether it is too large for a sheet with letters that can be read."""
        return oversized(self.svg)


@dataclass(frozen=True)
class Formulas(PageBlock):
    """Formulas as MathML made by thermid, a line each, with the number that each has elsewhere."""

    lines: tuple[tuple[str, str], ...]
    caption: str = ""


@dataclass(frozen=True)
class Code(PageBlock):
    """A text in a fixed width."""

    text: str
    caption: str = ""


@dataclass(frozen=True)
class FoldOut(PageBlock):
    """Blocks that open on demand."""

    title: str
    blocks: tuple[PageBlock, ...]
    note: str = ""


@dataclass(frozen=True)
class Section:
    """A section of a page.

    Parameters
    ----------
    key : str           Its place, for links.
    title : str         Its heading.
    blocks : tuple      What it holds; a `Table` may stand for itself.
    short : str         What the contents call it; the title by default.
    audiences : tuple   For whom it stands on the page.
    """

    key: str
    title: str
    blocks: tuple[PageBlock, ...]
    short: str = ""
    audiences: tuple[str, ...] = ("agency", "all")

    @classmethod
    def of_blocks(
        cls, key: str, title: str, blocks: Sequence[PageBlock], short: str = "", audiences: tuple[str, ...] = ("agency", "all")
    ) -> Section:
        """Return a section; tables become blocks, and one without a title has that of the heading above it."""
        return cls(key, title, _titled(title, blocks), short or title, audiences)


def folded(title: str, blocks: Sequence[PageBlock], note: str = "") -> FoldOut:
    """Return blocks that open on demand; tables become blocks, and one without a title has that of what is folded."""
    return FoldOut(title, _titled(title, blocks), note)


def _titled(title: str, blocks: Sequence[PageBlock]) -> tuple[PageBlock, ...]:
    """Return blocks in which a table without a title has that of the heading above it."""
    out: list[PageBlock] = []
    for block in blocks:
        if isinstance(block, Heading):
            title = block.text
        elif isinstance(block, Table) and not block.title:
            block = replace(block, title=title)
        out.append(block)
    return tuple(out)
