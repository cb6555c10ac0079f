"""What a page is made of: tables, words, notes, figures, pictures, code and formulas, in sections; numbers as a person reads them.

How a page becomes a file: figures and tables numbered, long tables beside it, templates to write it, a browser to print it.

What is said where one of these is missing stands here too.
"""

from __future__ import annotations

import base64
import csv
import hashlib
import io
import math
import os
import re
import shutil
import subprocess
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Final

from thermid.base.errors import MissingExtraError, ScenarioError, ThermidError, missing
from thermid.base.files import FileKinds, scratch
from thermid.base.results import MARKS
from thermid.base.units import HOUR

if TYPE_CHECKING:
    from jinja2 import Template

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
    return f"{seconds / 60:.4g} min" if seconds < 3 * HOUR else f"{seconds / 3600:.4g} h"


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
    """

    key: str
    title: str
    blocks: tuple[PageBlock, ...]
    short: str = ""

    @classmethod
    def of_blocks(cls, key: str, title: str, blocks: Sequence[PageBlock], short: str = "") -> Section:
        """Return a section; tables become blocks, and one without a title has that of the heading above it."""
        return cls(key, title, _titled(title, blocks), short or title)


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


AUDIENCES: Final = ("summary", "agency", "all")
"""For whom a report is: two pages with the answer; what an agency reads; everything."""
LONG: Final = {"summary": 6, "agency": 25, "all": 25}
"""Rows from which a table is a file beside the page too."""
SHOWN: Final = {"summary": 5, "agency": 12, "all": 10**9}
"""Rows of a long table on the page itself."""

_COUNTED: Final = re.compile(r'<figure(?: id="([^"]*)")?[^>]*>|<table(?: id="([^"]*)")?[^>]*>|(<i class="no"></i>)')
_FOLDED: Final = re.compile(r'<details[^>]*>|</details>|</summary>|<b class="no">Fig\.\u00a0(\d+)</b>')
_REFERENCE: Final = re.compile(r'<a class="ref" href="#([^"]*)"></a>')


def numbered(page: str) -> str:
    """Return a page whose figures and tables are numbered in the order of reading, and whose references say these numbers.

    A figure or table is an element whose caption begins with an empty ``<i class="no"></i>``; one that is referred to has an id. A
    reference to what the page does not hold is left out.
    """
    counts = {"Fig.": 0, "Table": 0}
    places: dict[str, str] = {}
    kind, place = "", ""

    def count(element: re.Match[str]) -> str:
        """Number a table or figure, and its caption."""
        nonlocal kind, place
        if element[3] is None:
            kind, place = ("Table", element[2] or "") if element[0].startswith("<table") else ("Fig.", element[1] or "")
            return element[0]
        counts[kind] += 1
        text = f"{kind}\u00a0{counts[kind]}"
        if place:
            places[place] = text
        return f'<b class="no">{text}</b> '

    page = _with_folded_numbers(_COUNTED.sub(count, page))
    return _REFERENCE.sub(lambda m: f'<a href="#{m[1]}">{places[m[1]]}</a>' if m[1] in places else "", page)


def _with_folded_numbers(page: str) -> str:
    """Return a page on which what folds out says the numbers of its figures, so that the numbers around it do not seem to jump."""
    open_folds: list[tuple[int, list[str]]] = []
    notes: dict[int, str] = {}
    for m in _FOLDED.finditer(page):
        if m[1]:
            for _, numbers in open_folds:
                numbers.append(m[1])
        elif m[0] == "</summary>" and open_folds:
            open_folds[-1] = (m.start(), open_folds[-1][1])
        elif m[0] == "</details>":
            at, numbers = open_folds.pop()
            if numbers:
                ends = numbers[0] if len(numbers) == 1 else f"{numbers[0]} to {numbers[-1]}"
                notes[at] = f' <span class="soft">Fig.\u00a0{ends}</span>'
        elif m[0].startswith("<details"):
            open_folds.append((m.end(), []))
    return "".join([page[a:b] + notes.get(b, "") for a, b in pairwise([0, *sorted(notes), len(page)])])


def check_audience(audience: str) -> str:
    """Return for whom a report is.

    Raises
    ------
    ScenarioError   When there is no such audience.
    """
    if audience not in AUDIENCES:
        raise ScenarioError(
            f"a report is for {', '.join(AUDIENCES[:-1])} or {AUDIENCES[-1]}, not for '{audience}'.", "audience", code="value.wrong-kind"
        )
    return audience


def tables_folder(page: str | os.PathLike[str]) -> Path:
    """Return the folder beside a page that holds its long tables."""
    return Path(page).with_suffix(".tables")


@dataclass
class Sheets:
    """Long tables of a page, each a file of comma-separated values in one folder.

    Parameters
    ----------
    folder : Path       Where they go; made when the first is written.
    audience : str      For whom the page is; decides how much of a long table stands on it.
    """

    folder: Path
    audience: str = "all"
    files: dict[str, str] = field(default_factory=dict)

    @classmethod
    def beside(cls, page: str | os.PathLike[str], folder: str | os.PathLike[str] | None = None, audience: str = "all") -> Sheets:
        """Return the tables of a page for an audience, in a folder beside the page where no other is named.

        Raises
        ------
        ScenarioError   When there is no such audience.
        """
        return cls(Path(folder) if folder is not None else tables_folder(page), check_audience(audience))

    def place_of(self, table: Table, title: str) -> tuple[int, str]:
        """Return how many rows of a table stand on the page, and the file that holds all of them; empty for a short one."""
        rows = len(table.rows)
        if rows < LONG[self.audience]:
            return rows, ""
        return min(rows, SHOWN[self.audience]), self.keep(table, title)

    def keep(self, table: Table, title: str = "") -> str:
        """Return the name of the file that holds a table."""
        base = re.sub(r"[^a-z0-9]+", "_", (table.title or title or "table").lower()).strip("_")[:48] or "table"
        text = csv_of(table)
        name = base
        for k in range(2, 10_000):
            if self.files.get(f"{name}.csv", text) == text:
                break
            name = f"{base}_{k}"
        self.files[f"{name}.csv"] = text
        return f"{self.folder.name}/{name}.csv"

    def shortened(self, sections: list[Section]) -> list[Section]:
        """Return the sections for the audience: what opens on demand is kept in files alone, unless everything is asked for."""
        if self.audience == "all":
            return sections
        return [replace(s, blocks=tuple(b for b in s.blocks if not self._put_away(b))) for s in sections]

    def _put_away(self, block: PageBlock) -> bool:
        """Whether a block folds out; its tables are then kept, under its title, for the page of numbers."""
        if not isinstance(block, FoldOut):
            return False
        for inner in block.blocks:
            if isinstance(inner, Table):
                self.keep(inner, block.title)
            else:
                self._put_away(inner)
        return True

    def write(self) -> None:
        """Write the files."""
        if self.files:
            self.folder.mkdir(parents=True, exist_ok=True)
        for name, text in self.files.items():
            FileKinds.SHEET.save_text(self.folder / name, text)


def csv_of(table: Table) -> str:
    """Return a table as comma-separated values, its heads first."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow([typeset(c.title) for c in table.columns])
    last: list[str] = []
    for row in table.rows:
        cells = [typeset(c.text) for c in row]
        same = [k for k, c in enumerate(row) if c.look == "same"]  # blank because it is that of the line above
        last = [last[k] if k in same and last else text for k, text in enumerate(cells)]
        writer.writerow(last)
    return out.getvalue()


@contextmanager
def extra() -> Iterator[None]:
    """Turn a failed import inside the block into words.

    Raises
    ------
    MissingExtraError   When matplotlib or jinja2 cannot be imported.
    """
    try:
        yield
    except ImportError as error:
        what = (error.name or "a package").partition(".")[0]
        raise MissingExtraError(missing([what], "a report")) from error


@dataclass(frozen=True)
class Script:
    """The one script that a page runs: its text, and what the page's policy permits, which is this text and no other."""

    text: str
    permit: str


def page_template(name: str, sheets: Sheets) -> Template:
    """Return a template of this folder; every text that goes in is escaped.

    Raises
    ------
    MissingExtraError   When jinja2 is not installed.
    """
    with extra():
        from jinja2 import Environment, FunctionLoader, StrictUndefined
        from markupsafe import Markup, escape

    def finished(value: object) -> object:
        """Return a text typeset for a page; other values as they are."""
        return typeset(value) if isinstance(value, str) and not isinstance(value, Markup) else value

    loader = FunctionLoader(_asset)
    environment = Environment(
        loader=loader, autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True, finalize=finished
    )
    environment.filters["parted"] = lambda text: Markup(
        re.sub(r"([._/])(?=\w)", r"\1<wbr>", str(escape(typeset(text))))
    )  # where a name may break
    environment.filters["coded"] = lambda text: Markup(re.sub("`([^`]+)`", r"<code>\1</code>", str(escape(typeset(text)))))
    environment.filters["css_text"] = lambda text: Markup(css_text(str(text)))
    environment.globals["sheets"] = sheets
    environment.globals["style"] = Markup(environment.get_template("page.css.jinja").render())
    text = _asset("page.js")
    digest = base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
    environment.globals["script"] = Script(Markup(text), f"'sha256-{digest}'")
    return environment.get_template(name)


def check_page(to: str | os.PathLike[str]) -> Path:
    """Return the file that a page is written to, a PDF where its name ends in .pdf; ask before long work.

    Raises
    ------
    OutputError      When the file may not be written, or has the ending of another format.
    NoBrowserError   When it is a PDF and no browser is installed that prints it.
    """
    target = Path(to)
    kind = FileKinds.PAPER if target.suffix.lower() == ".pdf" else FileKinds.PAGE
    if kind is FileKinds.PAPER:
        browser()
    # the folder of a page is made where it is missing
    return kind.check_ending(target) if not target.parent.is_dir() else kind.may_write(target) and target


def write_page(name: str, to: str | os.PathLike[str], *, sheets: Sheets | None = None, **values: object) -> Path:
    """Fill a template of this folder, write the page and its long tables, and return its path; its folder is made where it is missing.

    Parameters
    ----------
    name : str          The template.
    to : path           The page; it is printed into a PDF where its name ends in .pdf.
    sheets : Sheets     Where the long tables go, and for whom the page is; beside the page and for all by default.
    values              What the template says.

    Raises
    ------
    MissingExtraError   When jinja2 is not installed.
    NoBrowserError      When it is a PDF and no browser is installed that prints it.
    OutputError         When the file may not be written, or has the ending of another format.
    """
    target = check_page(to)
    files = sheets if sheets is not None else Sheets.beside(target)
    content = numbered(page_template(name, files).render(audience=files.audience, **values))
    content = content.replace(FORMULAS, formula_face() if "<math" in content else "", 1)
    target.parent.mkdir(parents=True, exist_ok=True)
    if target.suffix.lower() == ".pdf":
        with scratch() as folder:
            page_to_pdf(FileKinds.PAGE.save_text(folder / "page.html", content), target)
    else:
        FileKinds.PAGE.save_text(target, content)
    files.write()
    return target


FORMULAS = "/*formulas*/"
"""Where the style of a page takes the font of its formulas."""


def formula_face() -> str:
    """Return the font of formulas with its own bytes, so that they look the same where no such font is installed (decision 209)."""
    from importlib.resources import files

    font = files("thermid.reporting._blocks").joinpath("mathematics.woff2").read_bytes()
    address = f"data:font/woff2;base64,{base64.b64encode(font).decode()}"
    family = '"Thermid Mathematics"'
    return f'@font-face{{font-family:{family};src:url("{address}") format("woff2")}} math{{font-family:{family},math}}'


def css_text(text: str) -> str:
    """Return a text as a string of a style sheet, in which nothing but letters, digits and spaces stands for itself."""
    return '"' + "".join(c if c.isascii() and (c.isalnum() or c == " ") else f"\\{ord(c):x} " for c in text) + '"'


def _asset(name: str) -> str:
    """Return the text of a file that stands beside this module."""
    from importlib.resources import files

    return files("thermid.reporting._blocks").joinpath(name).read_text(encoding="utf-8")


NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome", "microsoft-edge", "msedge")
PLACES = ("/Applications/Google Chrome.app/Contents/MacOS/Google Chrome", "/Applications/Chromium.app/Contents/MacOS/Chromium")
BROWSER_OPTIONS = (
    "--headless",
    "--disable-gpu",
    "--disable-quic",
    "--disable-extensions",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--no-first-run",
    "--no-default-browser-check",
    "--host-resolver-rules=MAP * ~NOTFOUND",
    "--no-pdf-header-footer",
    "--generate-pdf-document-outline",
)


class NoBrowserError(ThermidError):
    """There is no browser that can print a page, or it could not; the message says what to do."""

    code = "extra.no-browser"


def browser() -> str:
    """Return the path of an installed Chromium, Chrome or Edge.

    Raises
    ------
    NoBrowserError   When there is none.
    """
    program = next((path for name in NAMES if (path := shutil.which(name))), None) or next((p for p in PLACES if Path(p).exists()), None)
    if program is None:
        raise NoBrowserError(
            "a PDF needs a browser to print it, but neither Chromium nor Chrome nor Edge is installed. Install one of them, or open "
            "the page in another browser and print it to a file."
        )
    return program


def page_to_pdf(page: str | os.PathLike[str], to: str | os.PathLike[str], *, seconds: float = 120.0) -> Path:
    """Print a page into a PDF and return its path. The browser sees no network and leaves no profile behind.

    Parameters
    ----------
    page : path         A page as `report` and its kin write it.
    to : path           The file to write; its folder is made where it is missing.
    seconds : float     How long the browser may take. [s]

    Raises
    ------
    NoBrowserError   When no browser is installed, or when it made no PDF.
    """
    program, source, target = browser(), Path(page).resolve(strict=True), Path(to)
    target.parent.mkdir(parents=True, exist_ok=True)
    FileKinds.PAPER.may_write(target)
    with scratch() as folder:
        pdf = folder / "page.pdf"
        # the browser's sandbox does not run for root; the page's policy permits no script but its own
        root = ("--no-sandbox",) if getattr(os, "geteuid", lambda: 1)() == 0 else ()
        command = [program, *BROWSER_OPTIONS, *root, f"--user-data-dir={folder}/profile", f"--print-to-pdf={pdf}", source.as_uri()]
        home = {name: f"{folder}/{name}" for name in ("XDG_CONFIG_HOME", "XDG_CACHE_HOME")}
        try:
            run = subprocess.run(command, capture_output=True, timeout=seconds, env={**os.environ, **home}, check=False)
        except subprocess.TimeoutExpired:
            raise NoBrowserError(f"'{Path(program).name}' did not print '{source.name}' within {seconds:g} s.") from None
        printed = pdf.read_bytes() if pdf.exists() else b""
        if not printed.startswith(b"%PDF-"):
            complaints = run.stderr.decode(errors="replace").strip().splitlines()
            why = f" It said: {complaints[-1][:200]}" if complaints else ""
            raise NoBrowserError(f"'{Path(program).name}' made no PDF of '{source.name}'.{why}")
    return FileKinds.PAPER.save_bytes(target, printed)
