"""What the commands that write a page have in common: the page, its PDF, or both."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer

from thermid.errors import ScenarioError
from thermid.files import PAGE, PAPER, command, may_write, scratch


def _force(context: typer.Context, wanted: bool) -> bool:
    """Let this command replace any file that its options name."""
    if wanted:
        context.with_resource(command(force=True))
    return wanted


Force = Annotated[
    bool, typer.Option("--force", callback=_force, help="Write also over an input, or over a file that thermid did not write.")
]

Page = Annotated[Path | None, typer.Option("--to", help="The page to write.")]
Pdf = Annotated[Path | None, typer.Option("--pdf", help="The page as PDF, printed by an installed Chromium, Chrome or Edge.")]


def ready(to: Path | None, pdf: Path | None) -> None:
    """Look for the browser, and at the files to be written, before anything long begins.

    Raises
    ------
    ScenarioError    When its name is not that of a PDF.
    NoBrowserError   When a PDF is asked for and nothing can print it.
    OutputError      When a file may not be written.
    """
    if to is not None and to.parent.is_dir():  # the folder of a page is made where it is missing
        may_write(to, PAGE)
    if pdf is not None:
        if pdf.suffix.lower() != ".pdf":
            raise ScenarioError(f"'{pdf.name}' does not end in .pdf. The page itself is written by --to.", "--pdf")
        from thermid.reporting.blocks.pdf import browser

        browser()
        if pdf.parent.is_dir():
            may_write(pdf, PAPER)


def written(write: Callable[[Path], Path], to: Path | None, pdf: Path | None) -> dict[str, str]:
    """Write a page, its PDF, or both; return what was written by its name in the JSON object."""
    out = {"page": str(write(to))} if to is not None else {}
    if pdf is not None:
        from thermid.reporting.blocks.pdf import page_to_pdf

        with scratch() as folder:
            page = to if to is not None else write(folder / "page.html")
            out["pdf"] = str(page_to_pdf(page, pdf))
    return out
