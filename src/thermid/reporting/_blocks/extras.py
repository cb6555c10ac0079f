"""How a page becomes a file: figures and tables numbered, long tables beside it, templates to write it, a browser to print it.

What is said where one of these is missing stands here too.
"""

from __future__ import annotations

import base64
import csv
import hashlib
import io
import os
import re
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Final

from thermid.base.errors import MissingExtraError, ScenarioError, ThermidError
from thermid.base.extensions import missing
from thermid.base.files import FileKinds, check_ending, may_write, scratch, write_bytes, write_text
from thermid.reporting._blocks.content import FoldOut, PageBlock, Section, Table, typeset

if TYPE_CHECKING:
    from jinja2 import Template


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
    parts = [page[a:b] + notes.get(b, "") for a, b in pairwise([0, *sorted(notes), len(page)])]
    return "".join(parts)


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
            write_text(self.folder / name, text, FileKinds.SHEET)


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
    return check_ending(target, kind) if not target.parent.is_dir() else may_write(target, kind) and target


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
            page_to_pdf(write_text(folder / "page.html", content, FileKinds.PAGE), target)
    else:
        write_text(target, content, FileKinds.PAGE)
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
    may_write(target, FileKinds.PAPER)
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
    return write_bytes(target, printed, FileKinds.PAPER)
