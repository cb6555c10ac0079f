"""What the commands that write a page have in common: the page, its PDF, or both."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer

from thermid.errors import ScenarioError

__all__ = ["Page", "Pdf", "ready", "written"]

Page = Annotated[Path | None, typer.Option("--to", help="The page to write.")]
Pdf = Annotated[Path | None, typer.Option("--pdf", help="The page as PDF, printed by an installed Chromium, Chrome or Edge.")]


def ready(pdf: Path | None) -> None:
    """Look for the browser before anything long begins.

    Raises
    ------
    ScenarioError    When its name is not that of a PDF.
    NoBrowserError   When a PDF is asked for and nothing can print it.
    """
    if pdf is not None:
        if pdf.suffix.lower() != ".pdf":
            raise ScenarioError(f"'{pdf.name}' does not end in .pdf. The page itself is written by --to.", "--pdf")
        from thermid.reporting.pdf import browser

        browser()


def written(write: Callable[[Path], Path], to: Path | None, pdf: Path | None) -> dict[str, str]:
    """Write a page, its PDF, or both; return what was written by its name in the JSON object."""
    out = {"page": str(write(to))} if to is not None else {}
    if pdf is not None:
        from thermid.reporting.pdf import page_to_pdf

        with tempfile.TemporaryDirectory(prefix="thermid-page-") as folder:
            page = to if to is not None else write(Path(folder) / "page.html")
            out["pdf"] = str(page_to_pdf(page, pdf))
    return out
