"""What a page needs beyond thermid itself: templates to write it, a browser to print it; and what is said where they are missing."""

from __future__ import annotations

import base64
import hashlib
import os
import re
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from thermid.base.arguments import takes_objects
from thermid.base.errors import MissingExtraError, ThermidError
from thermid.base.extensions import missing
from thermid.base.files import PAGE, PAPER, check_ending, may_write, scratch, write_bytes, write_text
from thermid.reporting._blocks.content import typeset
from thermid.reporting._blocks.numbering import Sheets, numbered

if TYPE_CHECKING:
    from jinja2 import Template


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
    kind = PAPER if target.suffix.lower() == ".pdf" else PAGE
    if kind is PAPER:
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
            page_to_pdf(write_text(folder / "page.html", content, PAGE), target)
    else:
        write_text(target, content, PAGE)
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


@takes_objects
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
    may_write(target, PAPER)
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
    return write_bytes(target, printed, PAPER)
